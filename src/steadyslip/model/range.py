"""Range check: values and slopes of the equations in steady sliding must be finite in floating point.

The slopes enter the characteristic polynomial, so its coefficients are checked: an infinite slope, or a product that
overflows, makes a coefficient infinite or NaN. All stages check the range before they compute.

An exponential that underflows must not change the degree. The Stribeck term of friction contains exp(−(v/v_S)²): above
26 Stribeck velocities it is below exp(−700). For a body without mass, a root is then lost, or is only rounding error.
Single rigs, arrays of rigs and pages use the functions here.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable, OutOfRangeWarning
from steadyslip.core.expressions import ArrayFunction, Choose, occurrences
from steadyslip.model.eigenvalues import coefficients_from_eigenvalues, digits_lost, eigenvalues_of
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import (
    characteristic_coefficients,
    characteristic_rows,
    characteristic_terms,
    delays_of_terms,
    is_written_out,
)
from steadyslip.model.point import OperatingPoint, stacked
from steadyslip.model.steady import out_of_range

ORDINARY = 1e20
"""Numbers from 1/ORDINARY to ORDINARY count as ordinary: products of a dozen stay below 1e308."""
_REDUCED_DECADES = (0.75, 0.5, 0.25, 0.0)
"""Factors on a parameter's decimal exponent, with which its influence on the range is tested; chosen by trial."""


@cached
def characteristic(point: OperatingPoint) -> Array:
    """Coefficients of the characteristic polynomial, (..., n+1), lowest power first; NaN without steady sliding."""
    if not is_written_out(point.model):
        return coefficients_from_eigenvalues(point)[0]
    return stacked(point.evaluate(_coefficient_function(point.model)), point)


@cached
def quasipolynomial(point: OperatingPoint) -> tuple[Array, Array]:
    """Characteristic quasipolynomial: polynomials in s times exp(−s delay), first the polynomial without delay.

    Returns
    -------
    coefficients : ndarray (..., m, n+1)
        Lowest power first; NaN without steady sliding.
    delays : ndarray (..., m)
        s; the first is zero.
    """
    if not point.model.delays:
        return characteristic(point)[..., None, :], np.zeros((*point.shape, 1))
    delays = delays_of(point) @ delays_in_terms(point.model).T
    if not is_written_out(point.model):
        return np.stack(coefficients_from_eigenvalues(point), axis=-2), delays
    width, function = _term_functions(point.model)
    c = stacked(point.evaluate(function), point)
    return c.reshape(*c.shape[:-1], -1, width), delays


def delays_of(point: OperatingPoint) -> Array:
    """Delays in the equations (s), (..., d)."""
    if not point.model.delays:
        return np.zeros((*point.shape, 0))
    found = point.evaluate(point.model.function(point.model.delays))
    return np.stack([np.broadcast_to(np.asarray(one, dtype=float), point.shape) for one in found], axis=-1)


@cached
def delays_in_terms(model: Model) -> NDArray[np.bool_]:
    """Table (m terms of the quasipolynomial, d delays): True where the delay acts in the term."""
    return np.array([[own in late for own in model.delays] for late in delays_of_terms(model)], dtype=bool)


@cached
def _term_functions(model: Model) -> tuple[int, ArrayFunction]:
    terms = characteristic_terms(model)
    return len(terms[0].coefficients), model.function([c for term in terms for c in term.coefficients])


@cached
def _coefficient_function(model: Model) -> ArrayFunction:
    return model.function(characteristic_coefficients(model))


@cached
def _steady_function(model: Model) -> ArrayFunction:
    """Array function of the steady friction stresses, memory variables and states."""
    frictions = [model.steady[contact.friction] for contact in model.contacts]
    return model.function([*frictions, *(model.steady[item.symbol] for item in (*model.memory, *model.states))])


@cached
def in_range(point: OperatingPoint) -> NDArray[np.bool_]:
    """True for each rig (shape of the point) whose equations have finite values and slopes in steady sliding.

    Without steady sliding, True if the equation for the normal stress is finite, so that steady sliding certainly does
    not exist. False for rigs of an array whose eigenvalues are lost to rounding (`digits_lost`); a single rig's
    eigenvalues are computed in higher precision then.
    """
    with np.errstate(all="ignore"):
        slopes = _finite_slopes(point)
        values = np.ones(point.shape, dtype=bool)
        for one in point.evaluate(_steady_function(point.model)):
            values &= np.isfinite(one)
        values &= ~loses_highest_power(point)
        if point.shape:
            values &= ~digits_lost(point)
        known = ~out_of_range(point.model, point.arguments, point.shape)
        return np.asarray(known & (~point.exists | (slopes & values)))


def _finite_slopes(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where the slopes of the equations are finite, by polynomial coefficients, or else by eigenvalues."""
    if not (point.model.delays or is_written_out(point.model)):
        return np.asarray(np.any(np.isfinite(eigenvalues_of(point)), axis=-1))
    c, _ = quasipolynomial(point)
    main = c[..., 0, :]
    top = np.where(main[..., -1] == 0, main[..., -2], main[..., -1])[..., None, None]
    return np.asarray(np.all(np.isfinite(c) & np.isfinite(c / np.where(top == 0, 1.0, top)), axis=(-2, -1)))


def surely_in_range(point: OperatingPoint, complete: bool) -> bool:
    """True if a quick sufficient test shows that no rig of a point leaves the range of floating point.

    True if all parameters have ordinary sizes (`ORDINARY`) and the equations are rational. Otherwise powers and
    exponentials may overflow or underflow, so True only if all results are finite (`complete`) and none underflows.
    """
    for value in point.arguments:
        size = np.abs(value) if np.ndim(value) else abs(value)
        least = np.min(size, initial=1.0, where=size != 0) if np.ndim(value) else size or 1.0
        if not (least > 1 / ORDINARY and np.max(size, initial=0.0) < ORDINARY):
            return False
    return ((complete and not np.any(loses_highest_power(point))) or _is_rational(point.model)) and not np.any(
        digits_lost(point)
    )


@cached
def _is_rational(model: Model) -> bool:
    """True if the slopes consist of sums, products and integer powers only."""
    nodes = occurrences(e for row in characteristic_rows(model).values() for entry in row for e in entry.values())
    return all(node.is_Atom or node.is_Add or node.is_Mul or (node.is_Pow and node.exp.is_Integer) for node in nodes)


def require_range(point: OperatingPoint) -> None:
    """Raise NotAvailable if the numbers of a single rig leave the range of floating point.

    Raises
    ------
    NotAvailable
        If the numbers leave the range; the message names the parameters that cause this, if they can be found.
    """
    if not in_range(point):
        raise out_of_range_error(point)


def require_digits(point: OperatingPoint) -> None:
    """Raise NotAvailable if eigenvalues of a single rig are lost to rounding in double precision, which searches use.

    Raises
    ------
    NotAvailable
        If eigenvalues are lost; the message names the largest stiffness.
    """
    if np.any(digits_lost(point)):
        raise NotAvailable(f"in double precision no edge of this rig can be searched: {hidden_by_stiffest(point)}")


def hidden_by_stiffest(point: OperatingPoint) -> str:
    """Clause of a message: the reason why eigenvalues of a single rig are lost to rounding, and the remedy."""
    stiff = max(point.model.with_role("stiffness"), key=lambda name: float(point.named()[name]), default="")
    which = (
        f"; {stiff} = {float(point.named()[stiff]):.4g} {point.model.roles[stiff].unit} is the largest" if stiff else ""
    )
    return (
        f"rounding of the largest terms hides the least{which}; write links that are as good as rigid as rigid "
        "(stiffness = 'rigid' in a file, steadyslip.joined)"
    )


def warn_of_range(count: int, size: int) -> None:
    """Warn the caller of a public function that `count` of `size` rigs have no result."""
    message = (
        f"{count} of {size} rigs have no answer (NaN): their numbers leave the range of floating point; "
        "steadyslip.stability says which"
    )
    warnings.warn(message, OutOfRangeWarning, stacklevel=6)  # the line that called the public function


def out_of_range_error(point: OperatingPoint) -> NotAvailable:
    """Make the NotAvailable error for one rig whose numbers leave the range of floating point."""
    return NotAvailable(_out_of_range_message(point))


def _out_of_range_message(point: OperatingPoint) -> str:
    beyond = "the values of the equations, or their slopes, leave the range of floating point (1e-308 to 1e308) or are "
    beyond += "no real numbers"
    named = point.named()
    guilty = list(_blamed_parameters(point))
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


def _blamed_parameters(point: OperatingPoint) -> Iterator[str]:
    """Yield the parameters that bring a rig into range if they are moved towards 1: one alone, or all extreme
    parameters together."""
    names = list(point.model.parameters)
    numbers = np.array([float(value) for value in point.arguments])
    with np.errstate(all="ignore"):
        decades = np.where(numbers == 0, 0.0, np.log10(np.abs(numbers)))
    huge = np.abs(decades) > np.log10(ORDINARY)
    blamed = [i for i in range(len(names)) if decades[i] and _in_range_if_moderate(point, numbers, decades, [i])]
    if any(huge[i] for i in blamed):
        blamed = [i for i in blamed if huge[i]]
    if not blamed and huge.any() and _in_range_if_moderate(point, numbers, decades, list(np.flatnonzero(huge))):
        blamed = list(np.flatnonzero(huge))
    for i in blamed:
        yield names[i]


def _in_range_if_moderate(point: OperatingPoint, numbers: Array, decades: Array, which: list[int]) -> bool:
    """True if a rig is in range with the parameters `which` moved towards 1."""
    arguments: list[Any] = list(numbers)
    for i in which:
        arguments[i] = np.sign(numbers[i]) * 10.0 ** (decades[i] * np.array(_REDUCED_DECADES))
    return bool(np.any(in_range(point.with_arguments(arguments, (len(_REDUCED_DECADES),)))))


Pair = tuple[Any, Any]
"""Two forms of a coefficient: with underflowing exponentials set to 0, and with exponents not below `_REPLACEMENT`."""
_LEAST = -700.0
"""Exponent below which exp underflows or loses digits (the smallest normal float is exp(−708))."""
_REPLACEMENT = -100.0
"""Least exponent in the test whether an exponential matters; products of seven exp(−100) do not underflow."""
_SMALL = -300.0
"""Exponent above which an exponential times parameters is not expected to underflow."""
_ABSENT = -1e6  # degree of a zero entry, so that no product of entries with it is the largest


def loses_highest_power(point: OperatingPoint) -> NDArray[np.bool_]:
    """True (shape of the point) where the characteristic equation's highest power of s vanishes by underflow only."""
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
    """Coefficients of the highest powers of s that may vanish if exponentials underflow, highest power first.

    For each power it has the coefficients of all terms, first the term without delay; empty without exponentials.
    """
    terms = [term.coefficients for term in characteristic_terms(model)]
    rows = [list(row) for row in zip(*terms, strict=True)]
    lowest = next((power for power, row in enumerate(rows) if _exponentials(row)), len(rows))
    return [_pairs(row) for row in reversed(rows[lowest:])]


def highest_is_lost(levels: Sequence[Sequence[Pair]], choose: Choose = np.where) -> Any:
    """1 where the highest coefficient (of `highest_coefficients`) is 0 only because of underflow, else 0.

    A term with a delay counts only above the highest power without delay, where it makes the equation ill-posed.

    Parameters
    ----------
    levels : sequence of sequence of pairs
        Numbers, arrays, or nodes of a generated program.
    choose : callable
        Function ``choose(condition, value, other)``; for nodes of a generated program, the program's own.
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
    """Result of `loses_highest_power` for equations known only as a matrix in s.

    Its degree is taken as if no terms cancelled.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import

    function, places, size = _matrix_function(point.model)
    values = np.stack([np.broadcast_to(one, point.shape) for one in point.evaluate(function)], axis=-1)
    lost = np.zeros(point.shape, dtype=bool)
    for index in np.ndindex(point.shape):
        # of the entries without delay, then with delay; each with exponentials set to 0, then bounded below
        degrees = []
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


@cached
def _matrix_function(model: Model) -> tuple[ArrayFunction, list[tuple[int, int, int, bool]], int]:
    """Array function of a `Pair` for each entry of the characteristic matrix, the places of the entries, and the
    matrix size. A place is row, column, power of s, and True for a delayed entry."""
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


@cached
def _exponents(model: Model) -> ArrayFunction:
    """Array function of the exponents of all exponentials in the characteristic equation."""
    if is_written_out(model):
        found = [c for term in characteristic_terms(model) for c in term.coefficients]
    else:
        found = [e for row in characteristic_rows(model).values() for entry in row for e in entry.values()]
    return model.function([node.args[0] for node in _exponentials(found)])


@cached
def _highest_function(model: Model) -> ArrayFunction:
    return model.function([e for level in highest_coefficients(model) for pair in level for e in pair])
