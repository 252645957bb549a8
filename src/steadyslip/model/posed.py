"""Checks near steady sliding: well-posedness of the motion, and its sensitivity to rounding."""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.model.equations import Model
from steadyslip.model.kinematics import kinematics
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import OperatingPoint
from steadyslip.model.weights import arrays_of, slip_rates, weights

_UNDETERMINED = 1e-9  # damping over other dampings, below which it does not determine a velocity
MOST_NOISE = 1e-2  # largest accepted change of ln v due to rounding of forces; chosen by trial


@cached
def well_posed(point: OperatingPoint) -> np.ndarray:
    """True where the motion near steady sliding is well-posed, shape (rigs,).

    The residual of a balance of forces must increase with its unknown (velocity or acceleration); for several balances
    the eigenvalues of the Jacobian must have positive real part. Otherwise neglected lags or masses would determine the
    motion, however small they are.
    """
    if point.model.is_single:
        return np.atleast_1d(weights(point).by_unknown > 0)
    function, size = _rising(point.model)
    entries = [np.broadcast_to(np.asarray(e, dtype=float), point.shape or (1,)) for e in function(*arrays_of(point))]
    matrix = np.moveaxis(np.array(entries).reshape(size, size, -1), -1, 0)
    good = np.isfinite(matrix).all(axis=(1, 2))
    rises = np.ones(len(matrix), dtype=bool)
    if size:
        rises = np.linalg.eigvals(np.where(good[:, None, None], matrix, 0.0)).real.min(axis=1) > 0
    return np.asarray(rises & good)


def balance_jacobian(model: Model) -> list[list[sp.Expr]]:
    """Jacobian of the balances of forces with respect to accelerations, or velocities of massless coordinates."""
    moving = kinematics(model)
    places = [one for one in model.coordinates if one.inertial or moving.contact_at(one) is not None]
    slopes = {}
    for contact in model.contacts:  # friction stresses are eliminated
        balance = model.inlined(contact.balance)
        slopes[contact.friction] = {
            s: -derivative(balance, s) / derivative(balance, contact.friction)
            for one in places
            for s in (one.acceleration, one.velocity)
        }
    rows = []
    for one in places:
        balance = model.inlined(sp.Integer(0) if one.balance is None else one.balance)
        entries = []
        for other in places:
            symbol = other.acceleration if other.inertial else other.velocity
            total = derivative(balance, symbol)
            for friction, slope in slopes.items():
                total += derivative(balance, friction) * slope[symbol]
            entries.append(model.at_steady(total.doit()))
        rows.append(entries)
    return rows


def vanishing_terms(model: Model) -> list[tuple[sp.Expr, ...]]:
    """Coefficients of each coordinate that lower the degree in s if they are zero: first its inertia, then its damping.

    The damping is listed only if no contact determines the velocity and the equations contain inertia or damping. The
    number of zeros over all coordinates is `spare_powers`, except where dampings leave only combinations of velocities
    undetermined.
    """
    found = [(one.inertia,) if one.inertial else () for one in model.coordinates]
    for i in np.flatnonzero(~_of_contacts(model)):
        damping = _dissipation_entries(model)[i * (len(found) + 1)]
        if found[i] or damping != 0:
            found[i] += (damping,)
    return found


@cached
def spare_powers(point: OperatingPoint) -> np.ndarray:
    """Number (...) by which inertias and dampings of 0 may lower the degree of the characteristic equation in s.

    A coordinate with inertia contributes two powers. Coordinates without inertia contribute one for each velocity that
    a contact (if its friction rises with velocity) or a damping determines; springs determine the rest. If the degree
    is still lower, friction does not rise with velocity at once, and the equations are ill-posed.
    """
    model, light = point.model, _light(point)
    powers = np.sum(np.where(light, 1, 2), axis=-1)
    if np.any(alone := np.any(light & ~_of_contacts(model), axis=-1)):
        values = [np.broadcast_to(one, point.shape)[alone] for one in point.evaluate(_dissipation(model))]
        powers = np.array(powers)
        powers[alone] = np.sum(~light[alone], axis=-1) * 2 + _determined(np.array(values), light[alone])
    return np.asarray(2 * np.sum(_inertial(model)) + _determined_in_general(model) - powers)


@cached
def late_on_springs(point: OperatingPoint) -> np.ndarray:
    """True (...) where a delayed force acts on the motion that it measures, and the bodies have no mass and are held by
    springs only.

    With a mass m on springs k, m s² + k + kp exp(−s delay) has more unstable roots, with larger growth rates, the
    smaller m is. The equations without mass are therefore ill-posed, even if their own roots decay.
    """
    model, n = point.model, len(point.model.coordinates)
    late, found = _late_entries(model), np.zeros(point.shape, dtype=bool)
    if not late:
        return found
    light = (_light(point) & ~_of_contacts(model)).reshape(-1, n)
    if not np.any(light):
        return found
    both = [[np.broadcast_to(one, point.shape).ravel() for one in point.evaluate(model.function(part))]
            for part in (_dissipation_entries(model), late)]  # fmt: skip
    values, gains = (np.nan_to_num(np.array(one), posinf=0.0, neginf=0.0) for one in both)
    size, vectors = np.linalg.eigh(_damped(values, light))
    free = np.where(size[:, None, :] <= _UNDETERMINED**2, vectors, 0.0) * light[:, :, None]
    gains = np.moveaxis(gains.reshape(-1, n, n, len(light)), -1, 0)
    inside = np.swapaxes(free, 1, 2)[:, None] @ gains @ free[:, None]
    shares = np.max(np.abs(inside), axis=(1, 2, 3)) > _UNDETERMINED * np.max(np.abs(gains), axis=(1, 2, 3))
    return np.asarray(shares.reshape(point.shape))


@cached
def _late_entries(model: Model) -> list[sp.Expr]:
    """Derivatives of the coordinates' forces with respect to each delayed displacement or velocity: (n, n) each, by
    rows."""
    linear = linearise(model)
    places = {symbol: one for one in model.coordinates for symbol in (one.displacement, one.velocity)}
    found = []
    for symbol, (base, _) in model.late.items():
        if base in places:
            found += [
                linear.rows[row.velocity][symbol] if column is places[base] else sp.Integer(0)
                for row in model.coordinates for column in model.coordinates
            ]  # fmt: skip
    return found


def _light(point: OperatingPoint) -> np.ndarray:
    """True for each coordinate without inertia, shape (..., n)."""
    model, inertial = point.model, _inertial(point.model)
    light = np.broadcast_to(~inertial, (*point.shape, len(inertial))).copy()
    masses = point.evaluate(model.function([one.inertia for one in model.coordinates if one.inertial]))
    for i, mass in zip(np.flatnonzero(inertial), masses, strict=True):
        light[..., i] = np.asarray(mass) == 0
    return light


def _inertial(model: Model) -> np.ndarray:
    return np.array([one.inertial for one in model.coordinates])


@cached
def _of_contacts(model: Model) -> np.ndarray:
    return np.array([kinematics(model).contact_at(one) is not None for one in model.coordinates])


@cached
def _dissipation_entries(model: Model) -> list[sp.Expr]:
    """Entries of the damping matrix (n, n), then derivatives of slip rates by velocities (contacts, n), both by rows.

    The damping matrix does not contain friction stresses, which are separate unknowns.
    """
    linear, moving = linearise(model), [one.velocity for one in model.coordinates]
    slips = [sp.sympify(model.definitions.get(one.velocity, one.velocity)) for one in model.contacts]
    dampings = [-linear.rows[v][other] for v in moving for other in moving]
    return dampings + [model.at_steady(derivative(slip, v)) for slip in slips for v in moving]


@cached
def _dissipation(model: Model) -> ArrayFunction:
    return model.function(_dissipation_entries(model))


@cached
def _determined_in_general(model: Model) -> int:
    """Number of velocities of massless coordinates that friction and dampings determine for generic parameter
    values."""
    light = ~_inertial(model)
    if not np.any(light & ~_of_contacts(model)):
        return int(np.sum(light))
    chance = np.random.default_rng(0)
    entries = _dissipation_entries(model)
    some = {symbol: sp.Float(chance.uniform(1, 2)) for symbol in sorted(sp.Tuple(*entries).free_symbols, key=str)}
    values = np.array([float(e.xreplace(some)) for e in entries])
    return int(_determined(values[:, None], light[None])[0])


def _determined(values: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Rank (rigs,) of dampings and contacts on the coordinates `light` (rigs, n); `values` is (entries, rigs)."""
    return np.asarray(np.linalg.matrix_rank(_resistance(values, light), tol=_UNDETERMINED))


def _damped(values: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Symmetric matrix (rigs, n, n) that is singular for motions which neither dampings nor contacts resist."""
    whole = _resistance(values, light)
    return np.asarray(np.swapaxes(whole, 1, 2) @ whole + np.eye(light.shape[-1]) * ~light[:, None, :])


def _resistance(values: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Dimensionless resistance matrix (rigs, n, n) of dampings and contacts on the coordinates `light` (rigs, n)."""
    n = light.shape[-1]
    table = np.moveaxis(values.reshape(-1, n, len(light)), -1, 0) * light[:, None, :]
    dampings, slips = table[:, :n] * light[..., None], table[:, n:]
    size = np.sqrt(np.abs(np.diagonal(dampings, axis1=1, axis2=2)))
    size = np.where(size > 0, size, 1.0)
    lengths = np.linalg.norm(slips, axis=-1, keepdims=True)
    slips = slips / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(dampings / (size[:, :, None] * size[:, None, :]) + np.swapaxes(slips, 1, 2) @ slips)


@cached
def _rising(model: Model) -> tuple[ArrayFunction, int]:
    rows = balance_jacobian(model)
    return model.function(e for row in rows for e in row), len(rows)


@cached
def _force_function(model: Model, index: int) -> ArrayFunction:
    """Array function of stresses (Pa) at a contact in steady sliding, by which rounding is judged.

    They are, in this order: change of the pull by dashpots per e-fold of v; changes of σ by pull and by friction; pull;
    friction; contributions of normal stress and of memory variables to friction.
    """
    contact = model.contacts[index]
    inner = [contact.normal, *(item.symbol for item in contact.memory)]
    shares = [model.at_steady(symbol * derivative(contact.balance, symbol)) for symbol in inner]
    dashpot = model.at_steady(contact.velocity * derivative(model.definitions[contact.spring], contact.velocity))
    pressing = [
        model.at_steady(symbol * derivative(model.definitions[contact.normal], symbol))
        for symbol in (contact.spring, contact.friction)
    ]
    return model.function([dashpot, *pressing, model.steady[contact.spring], model.steady[contact.friction], *shares])


@cached
def resolved(point: OperatingPoint) -> np.ndarray:
    """True where rounding of forces changes ln v in steady sliding by less than `MOST_NOISE`, shape (rigs,).

    Rounding of the balance changes ln v by the error over the slope of the balance in ln v; with inertia, over the
    direct effect plus the inertia needed to change the velocity within a natural slip distance. The effects of rounding
    of velocities on dashpot forces, and of forces on the normal stress, must be as small. Also True where the motion is
    ill-posed, which is reported separately.
    """
    apart = np.ones(1, dtype=bool)
    for index in range(len(point.model.contacts)):
        apart = apart & _resolved(point, index)
    return np.asarray(apart | ~well_posed(point))


def _resolved(point: OperatingPoint, index: int) -> np.ndarray:
    found, drive = weights(point, index), slip_rates(point)[index]
    place = kinematics(point.model).coordinates[index]
    dashpot, pull, friction, *forces = point.evaluate(_force_function(point.model, index))
    with np.errstate(all="ignore"):
        held = np.abs(np.asarray(drive, dtype=float) * found.by_unknown)
        if place is None or place.inertial:
            rates = [found.by_slip * drive / found.direct, *found.decay]
            held = np.abs(found.direct) + held * np.maximum.reduce(np.broadcast_arrays(*map(np.abs, rates)))
        largest = np.maximum.reduce(np.broadcast_arrays(*map(np.abs, forces)))
        least = MOST_NOISE / np.finfo(float).eps
        hidden = (largest > least * held) | (np.abs(dashpot) > least * largest)
        hidden |= np.maximum(np.abs(pull), np.abs(friction)) > least * np.atleast_1d(point.sigmas[index])
        return np.asarray(~hidden)
