"""Checks near steady sliding: well-posedness of the motion, and its sensitivity to rounding."""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.kinematics import kinematics
from steadyslip.model.point import OperatingPoint
from steadyslip.model.weights import arrays_of, slip_rates, weights

MOST_NOISE = 1e-2  # change of ln v by rounding of forces, above which it affects the motion; chosen by trial


@question
def well_posed(point: OperatingPoint) -> np.ndarray:
    """True where the motion near steady sliding is well-posed, (rigs,).

    The balances of forces must increase with their unknowns (velocities or accelerations); for several balances the
    eigenvalues of the Jacobian must have positive real part. Otherwise arbitrarily small neglected lags or masses would
    determine the motion.
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


def missing_inertias(model: Model) -> tuple[int, list[sp.Expr]]:
    """Number of coordinates that have neither inertia nor contact, and the inertias (which may be 0) of others."""
    moving = kinematics(model)
    free = sum(not one.inertial and moving.contact_at(one) is None for one in model.coordinates)
    return free, [one.inertia for one in model.coordinates if one.inertial]


@question
def spare_powers(point: OperatingPoint) -> np.ndarray:
    """Number of highest powers of s that the characteristic equation may lose, (...): one for each missing inertia.

    Without inertia, friction or dampings must still determine the velocity at a contact; of a body without contact,
    springs may determine the place.
    """
    free, inertias = missing_inertias(point.model)
    values = point.evaluate(point.model.function(inertias))
    return np.asarray(sum((np.asarray(one) == 0 for one in values), start=np.full(point.shape, free)))


@question
def _rising(model: Model) -> tuple[ArrayFunction, int]:
    rows = balance_jacobian(model)
    return model.function(e for row in rows for e in row), len(rows)


@question
def _force_function(model: Model, index: int) -> ArrayFunction:
    """Array function of the sizes of stresses (Pa) at a contact in steady sliding.

    Change of the pull by dashpots per e-fold of v; changes of σ by pull and friction; then stresses that cancel: pull,
    friction, and the contributions of normal stress and memory to friction.
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


@question
def resolved(point: OperatingPoint) -> np.ndarray:
    """True where rounding of the forces changes the velocity of steady sliding insignificantly, (rigs,).

    Rounding of the balance changes ln v by the error over the slope of the balance in ln v; with inertia, over the
    direct effect plus the inertia needed to change the velocity within a natural slip distance. Rounding of velocities
    must change the force of dashpots, and rounding of forces the normal stress, by little as well. Also True where the
    motion is ill-posed, which is reported instead.
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
