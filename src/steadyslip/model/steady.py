"""Steady sliding: the normal stress that the contact and the friction agree on, and what follows.

σss solves σ = contact(x = 0, v = v0, v̇ = 0, T = τss + ηv0, τ = τss(v0, σ)) and must be positive (theory 3).
Where the contact is linear in the stresses it is σss = (σ0 + g0)/(1 − g1), with g0 + g1 σ the coupling in
steady sliding: g1 >= 1 is lock-up (friction grows faster than the spring can pull), σ0 + g0 <= 0 lift-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import OUT_OF_RANGE, NoSteadySliding, NotAvailable
from steadyslip.core.expressions import array_function
from steadyslip.core.quantities import shown, stress_name
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.point import Values, model_values


@dataclass(frozen=True)
class SteadySliding:
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
    """
    return steady_states(rig)[0]


def steady_states(rig: Slider) -> tuple[SteadySliding, ...]:
    """All states of steady sliding, by rising normal stress.

    Raises
    ------
    NoSteadySliding
        If there is none.
    """
    values = model_values(rig)
    stresses = steady_stress_roots(values)
    if not stresses:
        raise explain_absence(rig, values)
    names, function = _observable_function(values.model)
    results = []
    for sigma in stresses:
        numbers = {
            name: float(number) + 0.0  # no minus zero
            for name, number in zip(names, function(*values.arguments, sigma), strict=True)
        }
        velocity = float(values.named()["drive.velocity"])
        shear = numbers.pop("shear_stress")
        spring = numbers.pop("spring_stress")
        friction = numbers.pop("friction")
        units = {name: values.model.observables[name][1] for name in numbers}
        results.append(SteadySliding(velocity, float(sigma), shear, spring, friction, numbers, units, rig.area))
    return tuple(results)


@lru_cache(maxsize=128)
def _observable_function(model: Model) -> tuple[list[str], Callable[..., Any]]:
    """Steady values of all observables but x, v and the normal stress."""
    names = [name for name in model.observables if name not in ("x", "v", "normal_stress")]
    expressions = [model.observables[name][0].xreplace(model.steady) for name in names]
    return names, array_function([*model.parameters.values(), model.sigma_ss], expressions)


@dataclass(frozen=True)
class SteadyEquation:
    """The steady normal stress as arrays: closed form where the contact is linear in the stresses.

    ``parts(*arguments)`` gives (load, g0, g1), the load being σss itself where that is `given`; `sigma` and
    `slope` are σss and g1 in symbols. Without a closed form only `residual` is there.
    """

    affine: bool
    given: bool
    residual: Callable[..., Any]
    parts: Callable[..., Any] | None = None
    sigma: sp.Expr | None = None
    slope: sp.Expr | None = None


@lru_cache(maxsize=128)
def steady_equation(model: Model) -> SteadyEquation:
    """How a model determines its steady normal stress."""
    sigma = model.sigma_ss
    slope = sp.diff(model.steady_coupling, sigma)
    # where σss is given, the contact hands back that parameter and sigma_ss does not occur
    load = model.steady_stress if model.steady_load is None else model.steady_load
    arguments = list(model.parameters.values())
    given = model.steady_load is None
    affine = sigma not in slope.free_symbols and sigma not in load.free_symbols
    residual = array_function([*arguments, sigma], [model.steady_stress - sigma])
    if not affine:
        return SteadyEquation(False, given, residual)
    offset = model.steady_coupling.xreplace({sigma: sp.Integer(0)})
    parts = array_function(arguments, [load, offset, slope])
    solved = load if given else (load + offset) / (1 - slope)
    return SteadyEquation(True, given, residual, parts, solved, slope)


def steady_stress(values: Values) -> Any:
    """σss (Pa) as an array over the varied parameters, NaN where steady sliding does not exist.

    Where there are several solutions, the one of ``values.branch``.
    """
    equation = steady_equation(values.model)
    if equation.parts is None:
        return _by_search(values)
    load, offset, slope = equation.parts(*values.arguments)
    sigma = load if equation.given else (load + offset) / (1 - slope)
    return np.where((slope < 1) & (np.asarray(sigma) > 0), sigma, np.nan)[()]


def out_of_range(values: Values) -> Any:
    """Where the equation for σss leaves the range of floating point, so that nothing can be said."""
    equation = steady_equation(values.model)
    if equation.parts is None:
        return np.zeros(values.shape, dtype=bool)
    return ~np.isfinite(sum(np.broadcast_to(part, values.shape) for part in equation.parts(*values.arguments)))


def steady_stress_roots(values: Values) -> list[float]:
    """All positive σss of a single rig, rising."""
    equation = steady_equation(values.model)
    if equation.affine:
        sigma = float(steady_stress(values))
        return [sigma] if sigma > 0 else []
    return _search(lambda sigma: equation.residual(*values.arguments, sigma)[0])


def _by_search(values: Values) -> Any:
    equation = steady_equation(values.model)
    arrays = np.broadcast_arrays(*values.arguments)
    result = np.full(arrays[0].shape, np.nan)
    for index in np.ndindex(result.shape):
        arguments = [a[index] for a in arrays]
        found = _search(lambda sigma, a=arguments: equation.residual(*a, sigma)[0])  # type: ignore[misc]
        result[index] = found[values.branch] if len(found) > values.branch else np.nan
    return result[()]


def _search(residual: Callable[[Any], Any]) -> list[float]:
    """Roots of the residual over thirty decades of stress, each bracketed by a sign change."""
    from scipy.optimize import brentq

    grid = np.geomspace(1e-12, 1e18, 6001)
    with np.errstate(all="ignore"):
        value = np.broadcast_to(residual(grid), grid.shape)
    good = np.isfinite(value)
    roots = [float(s) for s in grid[good & (value == 0)]]
    for i in np.flatnonzero(good[:-1] & good[1:] & (value[:-1] * value[1:] < 0)):
        low, high = float(grid[i]), float(grid[i + 1])
        root = brentq(lambda s: float(residual(s)), low, high, xtol=1e-14 * low, rtol=1e-14)
        if abs(float(residual(root))) <= 1e-6 * root:  # a pole changes sign too
            roots.append(float(root))
    return sorted(roots)


def explain_absence(rig: Slider, values: Values) -> NoSteadySliding:
    """The exception that says why a rig has no steady sliding.

    Raises
    ------
    NotAvailable
        If the numbers leave the range of floating point.
    """
    if np.any(out_of_range(values)):
        raise NotAvailable(OUT_OF_RANGE)
    equation = steady_equation(values.model)
    if equation.parts is None:
        return NoSteadySliding(
            "no steady sliding: no positive normal stress satisfies the contact law at the steady shear stress",
            "no solution",
        )
    load, offset, slope = (float(part) for part in equation.parts(*values.arguments))
    mu = _friction_coefficient(values)
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


def _friction_coefficient(values: Values) -> float:
    """Friction coefficient in steady sliding at a normal stress of 1 MPa (exact where τ is proportional to σ)."""
    model = values.model
    expression = model.steady[model.symbols["tau"]] / model.sigma_ss
    function = array_function([*model.parameters.values(), model.sigma_ss], [expression])
    value = float(function(*values.arguments, 1e6)[0])
    return value if math.isfinite(value) else float("nan")
