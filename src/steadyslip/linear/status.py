"""Status of arrays of rigs (no steady sliding, stable, unstable, unknown) as integers, for scans and charts."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import checked
from steadyslip.linear import matrix_route
from steadyslip.linear.crossing import share_left
from steadyslip.linear.response import has_closed_form, response_numbers
from steadyslip.linear.spectrum import can_be_counted, is_near_edge, is_stable, outgrown, static_sum
from steadyslip.linear.stiffness import interval_ends, stiffness_polynomials
from steadyslip.linear.undamped import grows, is_undamped
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.eigenvalues import digits_lost
from steadyslip.model.linearisation import characteristic_terms, is_written_out
from steadyslip.model.numeric import by_matrices
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import in_range

ON_THE_EDGE = 1e-9  # a rig is on an edge if its damping ratio, or its static stiffness over its terms, is smaller
# Number of copies of a rig, with parameters changed by rounding errors, of which the status is compared; by trial: more
# copies miss fewer changes of status and take longer.
LAST_DIGITS = 24
ABSENT, STABLE, UNSTABLE, UNKNOWN, UNDAMPED = range(5)
WORDS = ("no steady sliding", "stable", "unstable", "out of range", "undamped")
"""Names of the status values; "out of range" refers to floating point, "undamped" means that no disturbance grows."""
QUIET = (STABLE, UNDAMPED)
"""Status values with which no disturbance grows."""
EVERY, NONE = "stable at every stiffness", "stable at no stiffness"


@checked()
def stability(rig: Slider | Machine, vary: Vary | None = None) -> Any:
    """Stability of steady sliding as text, for one rig or many.

    Parameters
    ----------
    rig : Slider
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary, by dotted name, in SI units; they broadcast.

    Returns
    -------
    str, ndarray of str or xarray.DataArray
        ``stable``, ``unstable`` (ill-posed included), ``undamped`` (nothing damps a machine, and nothing grows),
        ``no steady sliding`` (lock-up or lift-off), or ``out of range`` where numbers leave the range of floating
        point, so that stability is not known. Within rounding of an edge the
        word is that of one side; `analyze` reports such an edge.

    Raises
    ------
    ParameterError
        If a name or value is not allowed.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.stability(rig)
    'unstable'
    >>> ss.stability(rig, {"stiffness": [10e9, 40e9]})
    array(['unstable', 'stable'], dtype='<U17')
    """
    if by_matrices(rig):
        return matrix_route.stability(rig, vary)
    point = operating_point(rig, vary)
    words = np.array(WORDS)[status(point)]
    return point.wrap(words, "stability", "1") if point.shape else str(words)


def without_edge(point: OperatingPoint) -> NDArray[np.str_]:
    """Reason (...) why a rig has no critical stiffness, as text; empty where it has one."""
    found = status(point)
    with np.errstate(all="ignore"):
        low, high = interval_ends(point)
    some = np.any(low >= 0, axis=-1)
    edge = np.any((low > 0) | np.isfinite(high), axis=-1)
    known = np.where(edge, "", np.where(some, EVERY, NONE))
    return np.where(np.isin(found, (STABLE, UNSTABLE)), known, np.array(WORDS)[found])


def status(point: OperatingPoint) -> NDArray[np.int64]:
    """Status of rigs, (...), as an index of `WORDS`.

    UNSTABLE includes ill-posed rigs; UNDAMPED is for machines only.
    """
    with np.errstate(all="ignore"):
        found = _status(point, is_stable(point))
        if not np.any(undamped := (found == UNSTABLE) & is_undamped(point)):
            return found
        return np.where(undamped & ~grows(point), UNDAMPED, found)


def status_where_counted(point: OperatingPoint) -> NDArray[np.int64]:
    """Result of `status`, but UNKNOWN where roots under delays cannot be counted (`status` raises then)."""
    with np.errstate(all="ignore"):
        return np.where(can_be_counted(point), _status(point, is_stable(point, unless_long=True)), UNKNOWN)


def _status(point: OperatingPoint, stable: NDArray[np.bool_]) -> NDArray[np.int64]:
    found = np.where(point.exists, np.where(stable, STABLE, UNSTABLE), ABSENT)
    return np.where(in_range(point) & point.valid, found, UNKNOWN)


def decided_by_rounding(point: OperatingPoint) -> bool:
    """True if changes in the last digits of a single rig's numbers change its status.

    That is so at an edge, and if terms cancel that are many orders of magnitude larger than their sum. It is not so if
    another disturbance grows in any case.
    """
    if np.any(digits_lost(point)):  # eigenvalues need many digits, with which arrays of copies are not computed
        return False
    chance = np.random.default_rng(0)
    arguments = [
        value * (1 + np.finfo(float).eps * chance.uniform(-8.0, 8.0, LAST_DIGITS)) for value in point.arguments
    ]
    others = point.with_arguments(arguments, (LAST_DIGITS,))
    if static_sum(point) == 0 and not np.all(outgrown(others, True, ON_THE_EDGE)):  # a root of zero, and none grows
        return True
    with np.errstate(all="ignore"):
        own = _status(point, is_stable(point))
    return bool(np.any((status_where_counted(others) != own) & can_be_counted(others)))


@cached
def _static_terms(model: Model) -> ArrayFunction:
    """Function that returns the terms of a machine's static stiffness a0.

    No terms if a0 is not written out in symbols.
    """
    if not is_written_out(model):
        return model.function([])
    parts = (sp.Add.make_args(term.coefficients[0]) for term in characteristic_terms(model))
    return model.function(part for own in parts for part in own)


@cached
def is_neutral(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where the static stiffness is zero, to 9 digits of its terms."""
    if has_closed_form(point.model):
        part = response_numbers(point)
        terms = [part.k * np.ones(point.shape), part.mu * part.k * part.B2, part.mu * part.B3]
    elif point.model.delays or not point.model.is_slider:
        terms = [np.broadcast_to(term, point.shape) for term in point.evaluate(_static_terms(point.model))]
        terms = terms or [static_sum(point)]
    else:
        p, q = stiffness_polynomials(point)
        terms = [p[..., 0], point.named()["slider.stiffness"] * q[..., 0]]
    return np.asarray(share_left(terms) <= ON_THE_EDGE)


def on_edge(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where a rig is on an edge to 9 digits: an oscillation is undamped, or the static stiffness is zero.

    The static stiffness is also zero for a block without any stiffness. If another disturbance grows, sliding is
    unstable and the rig is not on an edge.
    """
    with np.errstate(all="ignore"):
        undamped = is_near_edge(point, ON_THE_EDGE)
        neutral = is_neutral(point)
        edge = np.array(np.broadcast_to(undamped | neutral, point.shape))
        if point.single or len(point.shape) != 1:
            return edge & ~outgrown(point, neutral, ON_THE_EDGE) if np.any(edge) else edge
        rows = np.flatnonzero(edge)  # `outgrown` is called for these rigs only, as it takes long with a delay
        if rows.size:
            edge[rows] = ~outgrown(point.part(rows), np.broadcast_to(neutral, point.shape)[rows], ON_THE_EDGE)
        return edge
