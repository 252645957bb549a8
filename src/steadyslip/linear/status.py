"""The verdict on arrays of rigs as one small number each, for scans and charts."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import checked
from steadyslip.core.questions import question
from steadyslip.linear.crossing import share_left
from steadyslip.linear.response import has_closed_form, response_numbers
from steadyslip.linear.spectrum import is_near_edge, is_stable, outgrown, static_sum
from steadyslip.linear.stiffness import interval_ends, stiffness_polynomials
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.linearisation import characteristic_terms, is_written_out
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import in_range

ON_THE_EDGE = 1e-9  # damping ratio, and share of static stiffness in its terms, that rounding alone can make
LAST_DIGITS = 24  # trials of other last digits
ABSENT, STABLE, UNSTABLE, UNKNOWN = range(4)
WORDS = ("no steady sliding", "stable", "unstable", "out of range")
"""What they are called; out of the range of floating point."""
EVERY, NONE = "stable at every stiffness", "stable at no stiffness"


@checked()
def stability(rig: Slider | Machine, vary: Vary | None = None) -> Any:
    """Whether steady sliding is stable, in words, for one rig or many.

    Parameters
    ----------
    rig : Slider
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary, by dotted name, in SI units; they broadcast.

    Returns
    -------
    str, ndarray of str or xarray.DataArray
        ``stable``, ``unstable`` (ill-posed included), ``no steady sliding`` (lock-up or lift-off), or ``out of range``
        where numbers leave the range of floating point, so that nothing can be said.

    Raises
    ------
    ParameterError
        If a name or value is not allowed.
    """
    point = operating_point(rig, vary)
    words = np.array(WORDS)[status(point)]
    return point.wrap(words, "stability", "1") if point.shape else str(words)


def without_edge(point: OperatingPoint) -> NDArray[np.str_]:
    """Why rigs have no critical stiffness, in words; the empty text where they have one."""
    found = status(point)
    with np.errstate(all="ignore"):
        low, high = interval_ends(point)
    some = np.any(low >= 0, axis=-1)
    edge = np.any((low > 0) | np.isfinite(high), axis=-1)
    known = np.where(edge, "", np.where(some, EVERY, NONE))
    return np.where(np.isin(found, (STABLE, UNSTABLE)), known, np.array(WORDS)[found])


def status(point: OperatingPoint) -> NDArray[np.int64]:
    """ABSENT (no steady sliding), STABLE, UNSTABLE (ill-posed too) or UNKNOWN (out of floating point, or no rig)."""
    with np.errstate(all="ignore"):
        verdict = np.where(is_stable(point), STABLE, UNSTABLE)
        found = np.where(point.exists, verdict, ABSENT)
        return np.where(in_range(point) & point.valid, found, UNKNOWN)


def decided_by_rounding(point: OperatingPoint) -> bool:
    """Whether the verdict on a single rig changes as its numbers do in their last digits.

    So it does at an edge, and where terms of the equations cancel that are many orders of magnitude larger than what
    is left of them; not where a disturbance grows beside one that an edge leaves as it is.
    """
    chance = np.random.default_rng(0)
    arguments = [
        value * (1 + np.finfo(float).eps * chance.uniform(-8.0, 8.0, LAST_DIGITS)) for value in point.arguments
    ]
    others = point.with_arguments(arguments, (LAST_DIGITS,))
    if static_sum(point) == 0 and not np.all(outgrown(others, True, ON_THE_EDGE)):  # a root of zero, and none grows
        return True
    return bool(np.any(status(others) != status(point)))


@question
def _static_terms(model: Model) -> ArrayFunction:
    """What adds up to the static stiffness of a machine, a0; nothing where that is not written out."""
    if not is_written_out(model):
        return model.function([])
    parts = (sp.Add.make_args(term.coefficients[0]) for term in characteristic_terms(model))
    return model.function(part for own in parts for part in own)


@question
def is_neutral(point: OperatingPoint) -> NDArray[np.bool_]:
    """Where the static stiffness is zero to within rounding, to 9 digits."""
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
    """Where the verdict is a matter of rounding: an undamped oscillation, or static stiffness zero, to 9 digits.

    Without any stiffness nothing restores the place of the block: that is static stiffness zero, too. Where another
    disturbance grows, sliding is unstable, and no edge decides.
    """
    with np.errstate(all="ignore"):
        undamped = is_near_edge(point, ON_THE_EDGE)
        neutral = is_neutral(point)
        edge = np.array(np.broadcast_to(undamped | neutral, point.shape))
        if point.single or len(point.shape) != 1:
            return edge & ~outgrown(point, neutral, ON_THE_EDGE) if np.any(edge) else edge
        rows = np.flatnonzero(edge)  # few of many, whose eigenvalues take long with a delay
        if rows.size:
            edge[rows] = ~outgrown(point.part(rows), np.broadcast_to(neutral, point.shape)[rows], ON_THE_EDGE)
        return edge
