"""Loss of the highest power of s in the characteristic equation by exponentials that vanish only in floating point.

Friction of a body without mass falls by exp(−(v/v_S)²) of its drop: from 26 Stribeck velocities on that is below
exp(−700), and a root is lost with it, or is nothing but rounding. Arrays of rigs and pages ask the same functions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.expressions import ArrayFunction, Choose, occurrences
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_rows, characteristic_terms, is_written_out
from steadyslip.model.point import OperatingPoint

Pair = tuple[Any, Any]
"""A coefficient with vanishing exponentials set to zero, and with exponents bounded below by `_REPLACEMENT`."""
_LEAST = -700.0
"""Exponent below which exp underflows or loses digits (the smallest normal float is exp(−708))."""
_REPLACEMENT = -100.0
"""Replacement of smaller exponents in the test of their influence; products of seven exp(−100) do not underflow."""
_SMALL = -300.0
"""Exponent above which products of an exponential with parameters are not expected to underflow."""
_ABSENT = -1e6  # degree of a zero entry, so that no product of entries with it is the largest


def loses_highest_power(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where the highest power of s in the characteristic equation vanishes only by underflow, shape of point."""
    small = np.zeros(point.shape, dtype=bool)
    for one in point.evaluate(_exponents(point.model)):
        small = small | (np.asarray(one) < _SMALL)
    if not np.any(small):
        return small
    if not is_written_out(point.model):
        return small & _loses_generic_degree(point)
    values = iter(point.evaluate(_highest_function(point.model)))
    levels = [[(next(values), next(values)) for _ in level] for level in highest_coefficients(point.model)]
    return np.asarray(small & (highest_is_lost(levels) > 0))


def highest_coefficients(model: Model) -> list[list[Pair]]:
    """Coefficients of the characteristic equation that exponentials can take away, from the highest power of s down.

    For each power the coefficient of each term, that without delay first; empty if there are no exponentials.
    """
    terms = [term.coefficients for term in characteristic_terms(model)]
    rows = [list(row) for row in zip(*terms, strict=True)]
    lowest = next((power for power, row in enumerate(rows) if _exponentials(row)), len(rows))
    return [_pairs(row) for row in reversed(rows[lowest:])]


def highest_is_lost(levels: Sequence[Sequence[Pair]], choose: Choose = np.where) -> Any:
    """1 where the highest coefficient that is not 0 vanishes by underflow, else 0; takes `highest_coefficients`.

    A term with a delay counts above the highest power without delay: there it makes the equation ill-posed.

    Parameters
    ----------
    levels : sequence of sequence of pairs
        Numbers, arrays or nodes of a program.
    choose : callable
        ``choose(condition, value, other)``; that of a program, where values are its nodes.
    """
    lost, is_open = 0.0, 1.0
    for level in levels:
        main_is_zero = abs(level[0][1]) <= 0
        for place, (low, bounded) in enumerate(level):
            counts = choose(main_is_zero, is_open, 0.0) if place else is_open
            lost = choose(abs(low) <= 0, choose(abs(bounded) <= 0, lost, choose(counts > lost, counts, lost)), lost)
        is_open = choose(main_is_zero, is_open, 0.0)
    return lost


def _loses_generic_degree(point: OperatingPoint) -> NDArray[np.bool_]:
    """As `loses_highest_power` where the equation is known as a matrix in s only: its degree but for cancellations."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    function, places, size = _matrix_function(point.model)
    values = np.stack([np.broadcast_to(one, point.shape) for one in point.evaluate(function)], axis=-1)
    lost = np.zeros(point.shape, dtype=bool)
    for index in np.ndindex(point.shape):
        degrees = []  # without and with the delayed entries, of zeroed and of bounded exponentials
        for with_delays in (False, True):
            for start in (0, 1):
                matrix = np.full((size, size), _ABSENT)
                for (row, column, power, is_late), value in zip(places, values[index][start::2], strict=True):
                    if value != 0 and (with_delays or not is_late):
                        matrix[row, column] = max(matrix[row, column], power)
                degrees.append(matrix[linear_sum_assignment(matrix, maximize=True)].sum())
        low, bounded, low_late, bounded_late = degrees
        lost[index] = low < bounded or (bounded_late > bounded and low_late < bounded_late)
    return lost


@question
def _matrix_function(model: Model) -> tuple[ArrayFunction, list[tuple[int, int, int, bool]], int]:
    """Array function of pairs of entries of the characteristic matrix; row, column, power and delay of each; size."""
    rows = list(characteristic_rows(model).values())
    places, entries = [], []
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            for powers, e in entry.items():
                places.append((i, j, powers[0], any(powers[1:])))
                entries.append(e)
    return model.function([e for pair in _pairs(entries) for e in pair]), places, len(rows)


def _exponentials(expressions: Iterable[Any]) -> list[sp.Expr]:
    return [node for node in occurrences(map(sp.sympify, expressions)) if isinstance(node, sp.exp)]


def _pairs(expressions: Sequence[Any]) -> list[Pair]:
    nodes = _exponentials(expressions)
    zeroed = {node: sp.Piecewise((0, node.args[0] < _LEAST), (node, True)) for node in nodes}
    bounded = {node: sp.Piecewise((np.exp(_REPLACEMENT), node.args[0] < _REPLACEMENT), (node, True)) for node in nodes}
    return [(sp.sympify(e).xreplace(zeroed), sp.sympify(e).xreplace(bounded)) for e in expressions]


@question
def _exponents(model: Model) -> ArrayFunction:
    """Array function of the exponents of all exponentials in the characteristic equation."""
    if is_written_out(model):
        found = [c for term in characteristic_terms(model) for c in term.coefficients]
    else:
        found = [e for row in characteristic_rows(model).values() for entry in row for e in entry.values()]
    return model.function([node.args[0] for node in _exponentials(found)])


@question
def _highest_function(model: Model) -> ArrayFunction:
    return model.function([e for level in highest_coefficients(model) for pair in level for e in pair])
