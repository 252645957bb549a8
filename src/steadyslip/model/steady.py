"""Steady sliding: the normal stress that the contact and the friction agree on, and what follows.

σss solves σ = contact(x = 0, v = v0, v̇ = 0, T = τss + ηv0, τ = τss(v0, σ)) and must be positive (theory 3).
Where the contact is linear in the stresses it is σss = (σ0 + g0)/(1 − g1), with g0 + g1 σ the coupling in
steady sliding: g1 >= 1 is lock-up (friction grows faster than the spring can pull), σ0 + g0 <= 0 lift-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import array_function, derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model

Arguments = tuple[Any, ...]


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


@question
def steady_equation(model: Model, place: int | None = None) -> SteadyEquation:
    """How a model determines the steady normal stress of a contact, by its place, or of the one it has.

    Raises
    ------
    NotAvailable
        If it depends on that of another contact: equations for several stresses at once are not solved yet. Or if no
        place is named and there are several contacts.
    """
    contact = model.contact if place is None else model.contacts[place]
    sigma = contact.sigma_ss
    others = {other.sigma_ss for other in model.contacts} - {sigma}
    if others & contact.steady_stress.free_symbols:
        raise NotAvailable("contacts that press on each other in steady sliding are not offered yet")
    slope = derivative(contact.steady_coupling, sigma)
    given = contact.steady_load is None
    # where σss is given, the contact hands back that parameter and sigma_ss does not occur
    load = contact.steady_stress if contact.steady_load is None else contact.steady_load
    arguments = list(model.parameters.values())
    affine = sigma not in slope.free_symbols and sigma not in load.free_symbols
    residual = array_function([*arguments, sigma], [contact.steady_stress - sigma])
    if not affine:
        return SteadyEquation(False, given, residual)
    offset = contact.steady_coupling.xreplace({sigma: sp.Integer(0)})
    parts = array_function(arguments, [load, offset, slope])
    solved = load if given else (load + offset) / (1 - slope)
    return SteadyEquation(True, given, residual, parts, solved, slope)


def steady_stress(model: Model, arguments: Arguments, branch: int, place: int) -> Any:
    """σss (Pa) of a contact as an array over the varied parameters, NaN where steady sliding does not exist.

    Where there are several solutions, the one of number `branch`.
    """
    equation = steady_equation(model, place)
    if equation.parts is None:
        return _by_search(equation, arguments, branch)
    load, offset, slope = equation.parts(*arguments)
    sigma = load if equation.given else (load + offset) / (1 - slope)
    return np.where((slope < 1) & (np.asarray(sigma) > 0), sigma, np.nan)[()]


def beyond_floats(model: Model, arguments: Arguments, shape: tuple[int, ...]) -> Any:
    """Where an equation for σss leaves the range of floating point, so that nothing can be said."""
    found = np.zeros(shape, dtype=bool)
    for equation in (steady_equation(model, place) for place in range(len(model.contacts))):
        if equation.parts is not None:
            found |= ~np.isfinite(sum(np.broadcast_to(part, shape) for part in equation.parts(*arguments)))
    return found


def steady_roots(model: Model, arguments: Arguments) -> list[float]:
    """All positive σss of a single rig with one contact, rising."""
    equation = steady_equation(model)
    if equation.affine:
        sigma = float(steady_stress(model, arguments, 0, model.contacts.index(model.contact)))
        return [sigma] if sigma > 0 else []
    return _search(lambda sigma: equation.residual(*arguments, sigma)[0])


def _by_search(equation: SteadyEquation, arguments: Arguments, branch: int) -> Any:
    arrays = np.broadcast_arrays(*arguments)
    result = np.full(arrays[0].shape, np.nan)
    for index in np.ndindex(result.shape):
        single = [a[index] for a in arrays]
        found = _search(lambda sigma, a=single: equation.residual(*a, sigma)[0])  # type: ignore[misc]
        result[index] = found[branch] if len(found) > branch else np.nan
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
