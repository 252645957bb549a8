"""What a user would integrate with instead: SciPy (compiled right-hand side), heyoka, diffrax.

Each rival is a function from problem, tolerance and variants to end states (n, variables) and seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from problems import Problem, equations, slip_inertial_jacobian
from scipy.integrate import solve_ivp

Run = Callable[[Problem, float, np.ndarray], tuple[np.ndarray, float]]


def scipy_rival(method: str) -> Run:
    """solve_ivp with everything that can be compiled compiled."""

    def run(problem: Problem, tolerance: float, variants: np.ndarray) -> tuple[np.ndarray, float]:
        compiled = equations(problem)
        ends = []
        seconds = 0.0
        for variant in variants:
            p = np.ascontiguousarray(variant)
            start = problem.initial(variant)
            out, matrix = np.empty(len(start)), np.empty((len(start), len(start)))
            compiled(start, p, out)

            def slope(t: float, y: np.ndarray, p: np.ndarray = p, out: np.ndarray = out) -> np.ndarray:
                compiled(y, p, out)
                return out.copy()

            options: dict[str, Any] = {}
            if problem.inertial and method != "DOP853":
                slip_inertial_jacobian(start, p, matrix)

                def jacobian(t: float, y: np.ndarray, p: np.ndarray = p, m: np.ndarray = matrix) -> np.ndarray:
                    slip_inertial_jacobian(y, p, m)
                    return m.copy()

                options["jac"] = jacobian
            begin = time.process_time()
            with np.errstate(all="ignore"):
                done = solve_ivp(
                    slope, (0, problem.until), start, method=method, rtol=max(tolerance, 1e-13), atol=tolerance,
                    t_eval=[problem.until], **options,
                )  # fmt: skip
            seconds += time.process_time() - begin
            ends.append(done.y[:, -1] if done.success and done.y.size else np.full(len(start), np.nan))
        return np.array(ends), seconds

    return run


def _heyoka_system(problem: Problem) -> list[tuple[Any, Any]]:
    import heyoka as hy

    u, x, theta = hy.make_vars("u", "x", "theta")
    kappa, a, b, mu, alpha, slope, extra = (hy.par[i] for i in range(7))
    e = hy.exp(u)
    s = 1.0 + kappa * slope * x
    if problem.inertial:
        force = (mu - kappa * x - s * (mu + a * u + b * theta)) / (extra * e)
        state = -e * (u + theta) - alpha * kappa * slope / b * (e - 1.0) / s
        return [(u, force), (x, e - 1.0), (theta, state)]
    friction = (mu - kappa * x - extra * (e - 1.0)) / s
    if problem.law == "slip":
        rate = -e * (b * u + friction - mu - a * u)
    else:
        rate = b * (hy.exp(-(friction - mu - a * u) / b) - e)
    top = kappa * (e - 1.0) + kappa * slope * (e - 1.0) * (friction - alpha) + s * rate
    return [(u, -top / (a * s + extra * e)), (x, e - 1.0)]


_MADE: dict[Any, Any] = {}


def heyoka_single(problem: Problem, tolerance: float, variants: np.ndarray) -> tuple[np.ndarray, float]:
    """Taylor method of adaptive order, one trajectory."""
    import heyoka as hy

    size = len(problem.initial(variants[0]))
    key = (problem.name, tolerance, 1)
    if key not in _MADE:
        _MADE[key] = hy.taylor_adaptive(_heyoka_system(problem), [0.0] * size, pars=[0.0] * 7, tol=tolerance)
    integrator = _MADE[key]
    ends = []
    seconds = 0.0
    for variant in variants:
        integrator.time = 0.0
        integrator.state[:] = problem.initial(variant)
        integrator.pars[:] = variant
        begin = time.process_time()
        integrator.propagate_until(problem.until)
        seconds += time.process_time() - begin
        ends.append(integrator.state.copy())
    return np.array(ends), seconds


def heyoka_batch(problem: Problem, tolerance: float, variants: np.ndarray) -> tuple[np.ndarray, float]:
    """The same on as many trajectories as a vector register holds."""
    import heyoka as hy

    width = hy.recommended_simd_size()
    size = len(problem.initial(variants[0]))
    key = (problem.name, tolerance, width)
    if key not in _MADE:
        _MADE[key] = hy.taylor_adaptive_batch(
            _heyoka_system(problem), np.zeros((size, width)), pars=np.zeros((7, width)), tol=tolerance
        )
    integrator = _MADE[key]
    ends = np.empty((len(variants), size))
    begin = time.process_time()
    for first in range(0, len(variants) - width + 1, width):
        chunk = variants[first : first + width]
        integrator.set_time(0.0)
        integrator.state[:] = np.array([problem.initial(v) for v in chunk]).T
        integrator.pars[:] = chunk.T
        integrator.propagate_until(problem.until)
        ends[first : first + width] = integrator.state.T
    return ends, time.process_time() - begin


def diffrax_vmap(problem: Problem, tolerance: float, variants: np.ndarray) -> tuple[np.ndarray, float]:
    """Tsit5 under vmap and jit, in double precision; compilation not counted."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import diffrax
    import jax.numpy as jnp

    def slope(t: Any, y: Any, p: Any) -> Any:
        u, x = y
        kappa, a, b, mu, alpha, tangent, eta = p
        e = jnp.exp(u)
        s = 1.0 + kappa * tangent * x
        friction = (mu - kappa * x - eta * (e - 1.0)) / s
        theta = (friction - mu - a * u) / b
        rate = -b * e * (u + theta) if problem.law == "slip" else b * (jnp.exp(-theta) - e)
        top = kappa * (e - 1.0) + kappa * tangent * (e - 1.0) * (friction - alpha) + s * rate
        return jnp.array([-top / (a * s + eta * e), e - 1.0])

    def one(p: Any, start: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(slope), diffrax.Tsit5(), 0.0, problem.until, 1e-3, start, args=p, max_steps=1_000_000,
            saveat=diffrax.SaveAt(t1=True), stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            throw=False,
        ).ys[0]  # fmt: skip

    key = (problem.name, tolerance, "diffrax", len(variants))
    if key not in _MADE:
        _MADE[key] = jax.jit(jax.vmap(one))
        _MADE[key](variants, np.array([problem.initial(v) for v in variants])).block_until_ready()
    starts = np.array([problem.initial(v) for v in variants])
    begin = time.process_time()
    ends = np.asarray(_MADE[key](variants, starts).block_until_ready())
    return ends, time.process_time() - begin


def installed(name: str) -> bool:
    """Whether an optional rival is there."""
    import importlib.util

    return importlib.util.find_spec(name) is not None
