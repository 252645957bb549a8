"""Undamped rigs (theory 13): test for them, and test for growing roots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.roots import ComplexArray, roots
from steadyslip.model.linearisation import is_written_out
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic


def is_undamped(point: OperatingPoint) -> NDArray[np.bool_]:
    """True (...) where the characteristic polynomial has only even powers of s, and not only s^0.

    False for a slider: it has a single oscillation, which cannot couple with another one.
    """
    if point.model.is_single or point.model.delays or not is_written_out(point.model):
        return np.zeros(point.shape, dtype=bool)
    c = characteristic(point)
    return np.asarray(np.all(c[..., 1::2] == 0, axis=-1) & np.any(c[..., 2::2] != 0, axis=-1))


def squares(point: OperatingPoint) -> ComplexArray:
    """Squares s² of the roots of undamped rigs, (..., n); NaN where a rig has fewer."""
    return roots(characteristic(point)[..., ::2])


def grows(point: OperatingPoint) -> NDArray[np.bool_]:
    """True (...) where a root of an undamped rig grows: a squared root is complex or positive."""
    u = squares(point)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.any((u.imag != 0) | (u.real > 0), axis=-1))
