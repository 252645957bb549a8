"""The exact stable set of any parameter that enters the characteristic polynomial linearly: p(s) + θ q(s) (theory 11).

Stiffnesses, dampings, masses and gains do, and much of friction as well. Whether a parameter does is read off the
polynomial itself, at three values that are decades apart.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.linear.polynomials import Array, StableSet, quietly, stable_set
from steadyslip.linear.windows import delay_set, linear_windows
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.linearisation import characteristic_terms
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import quasi, require_range

_APART = 1e6  # factor between the values at which the polynomial is looked at
_LEFT = 1e-13  # share of its terms that rounding leaves of a difference that is zero
_ROUNDING = 1e-10  # share of a coefficient that rounding alone can make


@checked()
def stable_values(rig: Slider | Machine, name: str) -> Array:
    """All values of a parameter at which steady sliding is stable, exactly.

    Parameters
    ----------
    rig : Slider or Machine
    name : str
        Dotted name, or a unique last part, of a positive parameter that the rig has: a link's stiffness or damping, a
        gain, a mass, a preload, ...; or a delay, whether it is there yet or not.

    Returns
    -------
    ndarray, shape (m, 2)
        Open intervals (low, high) in SI units, rising; high is inf where there is no upper limit. None: no value > 0.

    Raises
    ------
    NotAvailable
        If the parameter does not enter linearly; `boundary` scans for its edges.

    Notes
    -----
    With a delay, roots are counted, no rational function stands for it. All delays are found; of other parameters of a
    rig with delay, which may have windows without end, those up to a factor of a million from its own value in which no
    oscillation turns more than a hundred times during the delay; the last interval ends there.
    """
    full = rig.resolve(name)
    value = rig.value(full)
    late = rig.parameters()[full].role.kind == "delay"
    if not late and (not value or value < 0):
        message = "has no positive value to start from; give it one first"
        raise ParameterError([Problem(full, message)])
    point = operating_point(rig, None, (full,) if late else ())
    require_range(point)
    found = linear_set(point, full)
    if found is None:
        raise NotAvailable(
            f"the equations do not depend on {full} linearly, so that its stable set has no exact form; boundary(rig, "
            f"{full!r}) scans for its edges"
        )
    return np.asarray(found.intervals[np.isfinite(found.intervals[:, 0])])


@quietly
def linear_set(point: OperatingPoint, name: str) -> StableSet | None:
    """The stable set of one parameter of a single rig; None where it does not enter linearly, or is not positive."""
    value = float(point.named()[name])
    symbol = point.model.parameters[name]
    if any(delay.has(symbol) for delay in point.model.delays):
        return _delay_set(point, symbol)
    if not value > 0:
        return None
    place = list(point.model.parameters).index(name)
    factors = np.array([1 / _APART, 1.0, _APART])
    arguments = [a if i != place else value * factors for i, a in enumerate(point.arguments)]
    c, h = quasi(point.with_arguments(arguments, (3,)))
    if not np.all(np.isfinite(c)):
        return None
    q = _beyond_rounding(c[2] - c[0], c[2]) / (factors[2] - factors[0])
    p = _beyond_rounding(c[0] - factors[0] * q, c[0])
    if np.any(np.abs(c[1] - (p + q)) > _ROUNDING * (np.abs(p) + np.abs(q))) or not np.any(q):
        return None
    late = bool(point.model.delays)
    found = linear_windows(p, q, h[1], factors[0], factors[2]) if late else stable_set(p[0], q[0])
    return (
        None
        if found is None
        else StableSet(found.intervals * value, found.edges * value, found.frequencies, found.changes)
    )


def _delay_set(point: OperatingPoint, symbol: sp.Symbol) -> StableSet | None:
    """That of a delay, where it is the only one."""
    terms = characteristic_terms(point.model)
    if [term.delay for term in terms] != [0, symbol]:
        return None
    c, _ = quasi(point)
    return delay_set(c[0], c[1]) if np.all(np.isfinite(c)) else None


def _beyond_rounding(difference: Array, of: Array) -> Array:
    """A difference without what rounding alone leaves of nothing, which would be an edge at a value of 1e-20."""
    return np.where(np.abs(difference) <= _LEFT * np.abs(of), 0.0, difference)
