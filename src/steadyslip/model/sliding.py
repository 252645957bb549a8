"""Steady sliding in words and numbers: each state of it, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from steadyslip.core.errors import NoSteadySliding
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.quantities import shown, stress_name
from steadyslip.core.questions import question
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import require_range
from steadyslip.model.steady import steady_equation


@dataclass(frozen=True)
class SteadySliding(Displayed):
    """One state of steady sliding.

    Attributes
    ----------
    velocity : float
        m/s, that of the drive.
    normal_stress, shear_stress, spring_stress : float
        Pa; the spring also carries the damping to the ground.
    friction : float
        Shear over normal stress.
    states : dict of str to float
        What the friction law calls its states (Θ, θ in s, z in m, ...).
    """

    velocity: float
    normal_stress: float
    shear_stress: float
    spring_stress: float
    friction: float
    states: dict[str, float]
    units: dict[str, str] = field(repr=False)
    area: float | None = field(default=None, repr=False)

    def __str__(self) -> str:
        rows = [
            f"steady sliding at {shown(self.velocity, 'm/s')}: {stress_name('normal stress', self.area)} "
            f"{shown(self.normal_stress, 'Pa', area=self.area)}, {stress_name('shear stress', self.area)} "
            f"{shown(self.shear_stress, 'Pa', area=self.area)}, friction {self.friction:.4g}"
        ]
        rows += [f"  {name} = {shown(value, self.units[name], area=self.area)}" for name, value in self.states.items()]
        return "\n".join(rows)


@checked()
def steady_state(rig: Slider) -> SteadySliding:
    """The steady sliding of a rig.

    Returns
    -------
    SteadySliding
        If there are several, the one with the lowest normal stress; see `steady_states`.

    Raises
    ------
    NoSteadySliding
        Saying which condition fails (lock-up, lift-off) and by how much.
    NotAvailable
        If numbers leave the range of floating point.
    """
    return steady_states(rig)[0]


@checked()
def steady_states(rig: Slider) -> tuple[SteadySliding, ...]:
    """All states of steady sliding, by rising normal stress.

    Raises
    ------
    NoSteadySliding
        If there is none.
    NotAvailable
        If numbers leave the range of floating point.
    """
    point = operating_point(rig)
    require_range(point)
    stresses = point.all_stresses()
    if not stresses:
        raise explain_absence(rig, point)
    names, function = _observable_function(point.model)
    results = []
    for sigma in stresses:
        numbers = {
            name: float(number) + 0.0  # no minus zero
            for name, number in zip(names, function(*point.arguments, sigma), strict=True)
        }
        velocity = float(point.drive)
        shear = numbers.pop("shear_stress")
        spring = numbers.pop("spring_stress")
        friction = numbers.pop("friction")
        units = {name: point.model.observables[name][1] for name in numbers}
        results.append(SteadySliding(velocity, float(sigma), shear, spring, friction, numbers, units, rig.area))
    return tuple(results)


def observed_in_steady_sliding(model: Model) -> tuple[list[str], list[sp.Expr]]:
    """Names and steady values of all observables but x, v and the normal stress."""
    names = [name for name in model.observables if name not in ("x", "v", "normal_stress")]
    return names, [model.observables[name][0].xreplace(model.steady) for name in names]


@question
def _observable_function(model: Model) -> tuple[list[str], Callable[..., Any]]:
    names, expressions = observed_in_steady_sliding(model)
    return names, model.function(expressions)


def explain_absence(rig: Slider, point: OperatingPoint) -> NoSteadySliding:
    """The exception that says why a rig has no steady sliding.

    Raises
    ------
    NotAvailable
        If the numbers leave the range of floating point.
    """
    require_range(point)
    equation = steady_equation(point.model)
    if equation.parts is None:
        return NoSteadySliding(
            "no steady sliding: no positive normal stress satisfies the contact law at the steady shear stress",
            "no solution",
        )
    load, offset, slope = (float(part) for part in equation.parts(*point.arguments))
    mu = _friction_coefficient(point)
    if not slope < 1:
        margin = 1 - slope
        hint = rig.contact.lock_up(mu)
        return NoSteadySliding(
            "no steady sliding: lock-up. The pull raises friction by more than itself: "
            f"1 − μss dσ/dτ = {margin:.4g}, must be > 0" + (f"; {hint}" if hint else ""),
            "lock-up",
            margin,
        )
    remaining = load + offset
    return NoSteadySliding(
        "no steady sliding: lift-off. The motion takes away more normal stress than the contact has: "
        f"{shown(load, 'Pa', area=rig.area)} less {shown(-offset, 'Pa', area=rig.area)} leaves "
        f"{shown(remaining, 'Pa', area=rig.area)}, must be > 0",
        "lift-off",
        remaining,
    )


@question
def _friction_function(model: Model) -> Callable[..., Any]:
    contact = model.contact
    return model.function([model.steady[contact.friction] / contact.sigma_ss])


def _friction_coefficient(point: OperatingPoint) -> float:
    """Friction coefficient in steady sliding at a normal stress of 1 MPa (exact where τ is proportional to σ)."""
    value = float(_friction_function(point.model)(*point.arguments, 1e6)[0])
    return value if math.isfinite(value) else float("nan")
