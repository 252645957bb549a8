"""The problems of benchmarks/motion.py, as steadyslip rigs and as plain dimensionless equations.

Dimensionless: time d_c/v0, u = ln(v/v0), X = x/d_c, stresses in units of the steady normal stress. Massless:
(u, X), the state eliminated by hand; with mass (u, X, θ). Parameters: κ, a, b, μ, α, tan ψ, η v0/σ or m*.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit

import steadyslip as ss

NAMES = ("kappa", "a", "b", "mu", "alpha", "slope", "extra")


@dataclass(frozen=True)
class Problem:
    """One rig with many variants; `variants` is (n, 7), columns NAMES."""

    name: str
    law: str
    inertial: bool
    until: float
    start: dict[str, float]
    variants: np.ndarray
    rivals: tuple[str, ...] = field(default=())

    def rig(self) -> ss.Slider:
        """The first variant, lengths in d_c and times in d_c/v0."""
        kappa, a, b, mu, alpha, slope, extra = self.variants[0]
        memory = ss.laws.LinkerDieterich(alpha=alpha, sigma_ref=1.0) if alpha else ss.laws.NoMemory()
        evolution = ss.laws.Slip() if self.law == "slip" else ss.laws.Aging()
        friction = ss.laws.RateState(a=a, b=b, d_c=1.0, mu_ref=mu, v_ref=1.0, evolution=evolution, normal_memory=memory)
        contact: Any = ss.laws.ConstantNormalStress(preload=1.0)
        if slope:
            contact = ss.laws.InclinedSpring(steady_normal_stress=1.0, angle=float(np.arctan(slope)))
        masses = {"mass": extra} if self.inertial else {"radiation_damping": extra}
        return ss.Slider(
            friction=friction, contact=contact, stiffness=kappa, drive=ss.machine.SteadyDrive(1.0), **masses
        )

    def vary(self, count: int) -> dict[str, np.ndarray]:
        """Arguments of simulate_many for the first `count` variants."""
        columns = dict(zip(NAMES, self.variants[:count].T, strict=True))
        found = {"stiffness": columns["kappa"], "friction.a": columns["a"], "friction.b": columns["b"]}
        if np.any(columns["slope"]):
            found["contact.angle"] = np.arctan(columns["slope"])
        if np.any(columns["extra"]):
            found["slider.mass" if self.inertial else "slider.radiation_damping"] = columns["extra"]
        return found

    def initial(self, variant: np.ndarray) -> np.ndarray:
        """Dimensionless start."""
        u, x = np.log(self.start.get("v", 1.0)), self.start.get("x", 0.0)
        return np.array([u, x, 0.0] if self.inertial else [u, x])


def problems(size: int = 16384) -> list[Problem]:
    """Spirals, damped stick-slip, inertial stick-slip at three masses."""
    random = np.random.default_rng(1)
    a = random.uniform(0.012, 0.016, size)
    b = a + random.uniform(0.001, 0.003, size)
    slope = np.tan(random.uniform(-np.pi / 4, np.pi / 6, size))
    mu, alpha = np.full(size, 0.7), np.full(size, 0.56)
    edge = (b - a) / (1 + (mu - alpha) * slope)
    zero, one = np.zeros(size), np.ones(size)
    spiral = np.column_stack([random.uniform(0.97, 1.3, size) * edge, a, b, mu, alpha, slope, zero])
    a2 = 0.01 * one
    kappa = a2 * random.uniform(0.25, 0.4, size)
    damped = np.column_stack([kappa, a2, 1.5 * a2, 0.6 * one, zero, zero, 1e-6 * a2])
    found = [
        Problem("quasistatic spiral", "slip", False, 200.0, {"v": float(np.exp(0.01))}, spiral),
        Problem("damped stick-slip, aging", "aging", False, 800.0, {"v": 1.1}, damped),
    ]
    for mass in (1e-3, 1e-6, 1e-10):
        heavy = np.column_stack([0.4 * a2, a2, 1.5 * a2, 0.6 * one, zero, zero, mass * one])
        heavy[1:, 0] = kappa[1:]
        found.append(Problem(f"inertial stick-slip, m* = {mass:g}", "slip", True, 460.0, {"x": 1.0}, heavy))
    return found


@njit(error_model="numpy", fastmath={"contract", "nsz"})
def slip_massless(y, p, out):
    u, x = y[0], y[1]
    kappa, a, b, mu, alpha, slope, eta = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
    e = np.exp(u)
    s = 1.0 + kappa * slope * x
    friction = (mu - kappa * x - eta * (e - 1.0)) / s
    rate = -e * (b * u + friction - mu - a * u)
    out[0] = -(kappa * (e - 1.0) + kappa * slope * (e - 1.0) * (friction - alpha) + s * rate) / (a * s + eta * e)
    out[1] = e - 1.0


@njit(error_model="numpy", fastmath={"contract", "nsz"})
def aging_massless(y, p, out):
    u, x = y[0], y[1]
    kappa, a, b, mu, alpha, slope, eta = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
    e = np.exp(u)
    s = 1.0 + kappa * slope * x
    friction = (mu - kappa * x - eta * (e - 1.0)) / s
    rate = b * (np.exp(-(friction - mu - a * u) / b) - e)
    out[0] = -(kappa * (e - 1.0) + kappa * slope * (e - 1.0) * (friction - alpha) + s * rate) / (a * s + eta * e)
    out[1] = e - 1.0


@njit(error_model="numpy", fastmath={"contract", "nsz"})
def slip_inertial(y, p, out):
    u, x, theta = y[0], y[1], y[2]
    kappa, a, b, mu, alpha, slope, mass = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
    e = np.exp(u)
    s = 1.0 + kappa * slope * x
    out[0] = (mu - kappa * x - s * (mu + a * u + b * theta)) / (mass * e)
    out[1] = e - 1.0
    out[2] = -e * (u + theta) - alpha * kappa * slope / b * (e - 1.0) / s


@njit(error_model="numpy", fastmath={"contract", "nsz"})
def slip_inertial_jacobian(y, p, out):
    u, x, theta = y[0], y[1], y[2]
    kappa, a, b, mu, alpha, slope, mass = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
    e = np.exp(u)
    s = 1.0 + kappa * slope * x
    inner = mu + a * u + b * theta
    out[0, 0] = -a * s / (mass * e) - (mu - kappa * x - s * inner) / (mass * e)
    out[0, 1] = -(kappa + kappa * slope * inner) / (mass * e)
    out[0, 2] = -b * s / (mass * e)
    out[1, 0], out[1, 1], out[1, 2] = e, 0.0, 0.0
    out[2, 0] = -e * (u + theta + 1.0) - alpha * kappa * slope / b * e / s
    out[2, 1] = alpha * kappa * slope / b * (e - 1.0) / s**2 * kappa * slope
    out[2, 2] = -e


def equations(problem: Problem) -> Any:
    """The compiled right-hand side of a problem."""
    if problem.inertial:
        return slip_inertial
    return slip_massless if problem.law == "slip" else aging_massless
