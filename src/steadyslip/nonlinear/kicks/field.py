"""Equations of motion at constant inputs: rates, slip rates and normal stresses as functions of the state."""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import TIME, V_LP, P, Q, Reduction
from steadyslip.model.scales import natural_scales
from steadyslip.motion.single import areas as areas_of
from steadyslip.nonlinear.kicks.rest import Rest, in_columns

ROUNDING = 1e-14  # rounding error of stresses, as a share of the normal stress
BALANCED = 12  # limit of Newton iterations for the balance of forces


@cached
def field_of(reduction: Reduction) -> ArrayFunction:
    """Compiled function that returns rates, slip rates, residuals of the force balances and their Jacobian (cached).

    Its arguments are the parameters, σss, v_lp, q, p, the state and the unknowns.
    """
    slopes = [entry for row in reduction.solved.matrix for entry in row]
    speeds = (one.outputs["v"] for one in reduction.slidings)
    return _at_constant_inputs(reduction, [*reduction.rates, *speeds, *reduction.residuals, *slopes])


@cached
def _jacobian_of(reduction: Reduction) -> ArrayFunction:
    """Compiled function that returns the Jacobian of the rates, row by row (cached)."""
    return _at_constant_inputs(reduction, [entry for row in reduction.jacobian() for entry in row])


def _at_constant_inputs(reduction: Reduction, expressions: list[sp.Expr]) -> ArrayFunction:
    """Compiled function of expressions with the derivatives of the inputs set to zero."""
    still = dict.fromkeys((TIME, *reduction.slopes), sp.Integer(0))
    at_rest = (sp.sympify(e).xreplace(still) for e in expressions)
    return reduction.model.function(at_rest, V_LP, Q, P, *reduction.state, *reduction.unknowns)


def rates_at(rest: Rest, states: Array) -> Array:
    """Rates (m, d, n) at d states for each of m rigs, (m, d, n); NaN where forces cannot balance."""
    return motion_at(rest, states)[0]


def motion_at(rest: Rest, states: Array) -> tuple[Array, Array]:
    """Rates (m, d, n) and the slowest slip rate (m, d) at states (m, d, n); NaN where forces cannot balance."""
    rates, velocity, _ = solved_at(rest, states)
    return rates, velocity


def solved_at(rest: Rest, states: Array) -> tuple[Array, Array, Array]:
    """Rates (m, d, n), slowest slip rate (m, d), and unknowns of the force balances (m, d, u), at states (m, d, n)."""
    given = [rest.column(np.asarray(a)) for a in rest.arguments()]
    function, split, n = field_of(rest.reduction), np.moveaxis(states, 2, 0), states.shape[2]
    shape, count, speeds = states.shape[:2], len(rest.reduction.unknowns), len(rest.reduction.slidings)
    unknowns = np.array(np.broadcast_to(rest.unknowns[:, None, :], (*shape, count)))
    with np.errstate(all="ignore"):
        for _ in range(BALANCED if count else 1):
            found = function(*given, *split, *np.moveaxis(unknowns, 2, 0))
            numbers = np.empty((*shape, len(found)))
            for i, one in enumerate(found):
                numbers[..., i] = one
            if count:
                residuals, slopes = numbers[..., n + speeds : n + speeds + count], numbers[..., n + speeds + count :]
                change, sensitivity = _newton(residuals, slopes.reshape(*shape, count, count))
                unknowns = unknowns - change
        moving = numbers[..., n : n + speeds].min(axis=2)
        rates = numbers[..., :n]
        if count:
            rounding = ROUNDING * sensitivity * _forces(rest)[:, None, None]  # large if mass is small
            settled = np.abs(change) <= 1e-10 * (np.abs(unknowns) + _sizes(rest)[:, None, :]) + rounding
            rates = np.where(np.all(settled, axis=2)[..., None], rates, np.nan)
    return rates, moving, unknowns


def _newton(residuals: Array, slopes: Array) -> tuple[Array, Array]:
    """Newton corrections of the unknowns (m, d, u), and bounds (m, d, u) of their change per unit of all residuals."""
    if residuals.shape[-1] == 1:
        return residuals / slopes[..., 0], 1 / np.abs(slopes[..., 0])
    good = np.all(np.isfinite(slopes), axis=(-2, -1)) & (np.linalg.det(slopes) != 0)
    inverse = np.full_like(slopes, np.nan)
    inverse[good] = np.linalg.inv(slopes[good])
    return np.einsum("...ij,...j->...i", inverse, residuals), np.sum(np.abs(inverse), axis=-1)


def _forces(rest: Rest) -> Array:
    """Typical size of the balanced forces, (m,)."""
    areas = rest.point.evaluate(areas_of(rest.reduction.model))
    found = [np.maximum(1.0, np.abs(area)) * sigma for area, sigma in zip(areas, rest.sigmas, strict=True)]
    return np.asarray(np.maximum.reduce(np.broadcast_arrays(*found)))


def _sizes(rest: Rest) -> Array:
    """Natural sizes (m, u) of the unknowns, which are velocity variables, accelerations or frictions."""
    count = len(rest.reduction.unknowns)
    if rest.is_machine:
        return in_columns(natural_scales(rest.point, rest.reduction)[1][:count], len(rest.velocity))
    if not rest.reduction.model.inertial:
        own = np.ones(len(rest.velocity)) if rest.reduction.velocity != "linear" else rest.velocity
    else:
        own = rest.velocity**2 / rest.scales[:, rest.places[0]]
    return np.asarray(own[:, None])


def slopes_at(
    reduction: Reduction, point: OperatingPoint, inputs: tuple[Array, ...], state: Array, unknowns: Array, scales: Array
) -> Array:
    """Jacobian of the rates in natural sizes, (m, n, n)."""
    count, n = state.shape
    entries = point.evaluate(_jacobian_of(reduction), *inputs, *state.T, *unknowns.T)
    return np.asarray(in_columns(entries, count).reshape(count, n, n) * scales[:, None, :] / scales[:, :, None])


def normal_stresses(rest: Rest, state: Array, unknowns: Array) -> Array:
    """Normal stresses (m, contacts) at states (m, n) and unknowns (m, u), one for each rig."""
    inputs = rest.velocity, rest.force, rest.pressure
    found = rest.point.evaluate(_normal_of(rest.reduction), *inputs, *state.T, *unknowns.T)
    return in_columns(found, len(state))


def slip_rates_at(rest: Rest, state: Array, unknowns: Array) -> Array:
    """Slip rates (m, contacts), m/s, at states (m, n) and unknowns (m, u), one for each rig."""
    found = field_of(rest.reduction)(*rest.arguments(), *state.T, *unknowns.T)
    n = state.shape[1]
    return in_columns(found[n : n + len(rest.reduction.slidings)], len(state))


@cached
def _normal_of(reduction: Reduction) -> ArrayFunction:
    """Compiled function that returns the normal stresses of all contacts (cached)."""
    still = dict.fromkeys((TIME, *reduction.slopes), sp.Integer(0))
    wanted = (one.outputs["sigma"].xreplace(still) for one in reduction.slidings)
    return reduction.model.function(wanted, V_LP, Q, P, *reduction.state, *reduction.unknowns)
