"""Whether the numbers of a rig stay within floating point: the one question that every stage asks before it answers.

Values and slopes of the equations in steady sliding must be numbers. The slopes meet in the characteristic
polynomial: a slope that is none makes a coefficient that is none, and so does a product that leaves the range.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, OutOfRangeWarning
from steadyslip.core.expressions import ArrayFunction, occurrences
from steadyslip.core.questions import question
from steadyslip.model.eigenvalues import by_eigenvalues
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import (
    characteristic_coefficients,
    characteristic_rows,
    characteristic_terms,
    delays_of_terms,
    is_written_out,
)
from steadyslip.model.point import OperatingPoint, stacked
from steadyslip.model.steady import beyond_floats

ORDINARY = 1e20
"""Sizes up to which, and down to whose inverse, no product of a dozen numbers leaves the range."""
_NEARER = (0.75, 0.5, 0.25, 0.0)
"""Shares of its decades that a number keeps when it is asked whether it is to blame."""


@question
def characteristic(point: OperatingPoint) -> Array:
    """Coefficients of the characteristic polynomial, (..., n+1), lowest first; NaN without steady sliding."""
    if not is_written_out(point.model):
        return by_eigenvalues(point)[0]
    return stacked(point.evaluate(_coefficient_function(point.model)), point)


@question
def quasi(point: OperatingPoint) -> tuple[Array, Array]:
    """The characteristic equation with delays, a sum of polynomials in s times exp(−s delay), that without delay first.

    Returns
    -------
    coefficients : ndarray (..., m, n+1)
        Lowest power first; NaN without steady sliding.
    delays : ndarray (..., m)
        s; the first is zero.
    """
    if not point.model.delays:
        return characteristic(point)[..., None, :], np.zeros((*point.shape, 1))
    late = point.evaluate(point.model.function(delays_of_terms(point.model)))
    delays = np.stack([np.broadcast_to(one, point.shape) for one in late], axis=-1)
    if not is_written_out(point.model):
        return np.stack(by_eigenvalues(point), axis=-2), np.asarray(delays, dtype=float)
    width, function = _term_functions(point.model)
    c = stacked(point.evaluate(function), point)
    return c.reshape(*c.shape[:-1], -1, width), np.asarray(delays, dtype=float)


def delays_of(point: OperatingPoint) -> Array:
    """The delays in the equations, (..., d), s."""
    if not point.model.delays:
        return np.zeros((*point.shape, 0))
    found = point.evaluate(point.model.function(point.model.delays))
    return np.stack([np.broadcast_to(np.asarray(one, dtype=float), point.shape) for one in found], axis=-1)


@question
def _term_functions(model: Model) -> tuple[int, ArrayFunction]:
    terms = characteristic_terms(model)
    return len(terms[0].coefficients), model.function([c for term in terms for c in term.coefficients])


@question
def _coefficient_function(model: Model) -> ArrayFunction:
    return model.function(characteristic_coefficients(model))


@question
def _steady_function(model: Model) -> ArrayFunction:
    """Stresses and memory in steady sliding."""
    frictions = [model.steady[contact.friction] for contact in model.contacts]
    return model.function([*frictions, *(model.steady[item.symbol] for item in (*model.memory, *model.states))])


@question
def in_range(point: OperatingPoint) -> NDArray[np.bool_]:
    """Whether values and slopes of the equations are numbers in steady sliding, for each rig of a point.

    Where there is no steady sliding: whether that can be said.
    """
    with np.errstate(all="ignore"):
        c, _ = quasi(point)
        main = c[..., 0, :]
        top = np.where(main[..., -1] == 0, main[..., -2], main[..., -1])[..., None, None]
        slopes = np.all(np.isfinite(c) & np.isfinite(c / np.where(top == 0, 1.0, top)), axis=(-2, -1))
        values = np.ones(point.shape, dtype=bool)
        for one in point.evaluate(_steady_function(point.model)):
            values &= np.isfinite(one)
        known = ~beyond_floats(point.model, point.arguments, point.shape)
        return np.asarray(known & (~point.exists | (slopes & values)))


def surely_in_range(point: OperatingPoint, complete: bool) -> bool:
    """Whether no rig of a point can leave the range, which is quicker to tell than whether one does.

    That is so where all numbers have sizes of which `ORDINARY` speaks. Powers and exponentials of such may leave it;
    then no number comes of them, so that it matters whether all answers are numbers (`complete`).
    """
    for value in point.arguments:
        size = np.abs(value) if np.ndim(value) else abs(value)
        least = np.min(size, initial=1.0, where=size != 0) if np.ndim(value) else size or 1.0
        if not (least > 1 / ORDINARY and np.max(size, initial=0.0) < ORDINARY):
            return False
    return complete or _is_rational(point.model)


@question
def _is_rational(model: Model) -> bool:
    """Whether the slopes are made of sums, products and whole powers only."""
    nodes = occurrences(e for row in characteristic_rows(model).values() for entry in row for e in entry.values())
    return all(node.is_Atom or node.is_Add or node.is_Mul or (node.is_Pow and node.exp.is_Integer) for node in nodes)


def require_range(point: OperatingPoint) -> None:
    """Refuse a single rig whose numbers leave the range of floating point.

    Raises
    ------
    NotAvailable
        Naming the parameters that do it, where some do.
    """
    if not in_range(point):
        raise beyond_range(point)


def warn_of_range(count: int, size: int) -> None:
    """Say to the caller of a public function how many rigs of an array have no answer."""
    message = (
        f"{count} of {size} rigs have no answer (NaN): their numbers leave the range of floating point; "
        "steadyslip.stability tells which"
    )
    warnings.warn(message, OutOfRangeWarning, stacklevel=6)


def beyond_range(point: OperatingPoint) -> NotAvailable:
    """The exception that says so of a single rig."""
    return NotAvailable(_message(point))


def _message(point: OperatingPoint) -> str:
    beyond = "the values of the equations, or their slopes, leave the range of floating point (1e-308 to 1e308)"
    named = point.named()
    guilty = list(_guilty(point))
    words = []
    for name in guilty:
        shown = "slider.axial_stiffness" if name == "slider.stiffness" and point.model.axial_share is not None else name
        value, unit = float(named[name]), point.model.roles[name].unit
        if shown != name:
            value /= float(point.axial_share)
        words.append(f"{shown} = {value:.4g} {unit}".removesuffix(" 1"))
    if len(words) == 1:
        size = "small" if abs(float(named[guilty[0]])) < 1 else "large"
        return f"{words[0]} is too {size} for this rig: {beyond}"
    if words:
        return f"{', '.join(words)}: with these together {beyond}"
    return f"{beyond}; check the sizes of the rig's parameters"


def _guilty(point: OperatingPoint) -> Iterator[str]:
    """Parameters that bring a single rig back into range as they come nearer to one: each alone, or all huge ones."""
    names = list(point.model.parameters)
    numbers = np.array([float(value) for value in point.arguments])
    with np.errstate(all="ignore"):
        decades = np.where(numbers == 0, 0.0, np.log10(np.abs(numbers)))
    huge = np.abs(decades) > np.log10(ORDINARY)
    blamed = [i for i in range(len(names)) if decades[i] and _mended(point, numbers, decades, [i])]
    if any(huge[i] for i in blamed):
        blamed = [i for i in blamed if huge[i]]
    if not blamed and huge.any() and _mended(point, numbers, decades, list(np.flatnonzero(huge))):
        blamed = list(np.flatnonzero(huge))
    for i in blamed:
        yield names[i]


def _mended(point: OperatingPoint, numbers: Array, decades: Array, which: list[int]) -> bool:
    """Whether a rig is in range with some of its numbers nearer to one."""
    arguments: list[Any] = list(numbers)
    for i in which:
        arguments[i] = np.sign(numbers[i]) * 10.0 ** (decades[i] * np.array(_NEARER))
    return bool(np.any(in_range(point.with_arguments(arguments, (len(_NEARER),)))))
