"""The verdict on arrays of rigs as one small number each, for scans and charts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.polynomials import damping_measures, is_hurwitz, roots
from steadyslip.linear.response import has_closed_form, response_numbers
from steadyslip.linear.stiffness import characteristic, stiffness_polynomials
from steadyslip.model.point import OperatingPoint

ON_THE_EDGE = 1e-9  # damping ratio, and share of static stiffness in its terms, that rounding alone can make
ABSENT, STABLE, UNSTABLE, UNKNOWN = range(4)


def status(point: OperatingPoint) -> NDArray[np.int64]:
    """ABSENT (no steady sliding), STABLE, UNSTABLE (ill-posed too) or UNKNOWN (out of floating point, or no rig)."""
    with np.errstate(all="ignore"):
        exists = np.isfinite(point.sigma)
        c = characteristic(point)
        verdict = np.where(is_hurwitz(c), STABLE, UNSTABLE)
        known = np.where(np.all(np.isfinite(c), axis=-1), verdict, UNKNOWN)
        found = np.where(exists, known, np.where(point.out_of_range(), UNKNOWN, ABSENT))
        return np.where(point.valid, found, UNKNOWN)


def on_edge(point: OperatingPoint) -> NDArray[np.bool_]:
    """Where the verdict is a matter of rounding: an undamped oscillation, or static stiffness zero, to 9 digits.

    Without any stiffness nothing restores the place of the block: that is static stiffness zero, too.
    """
    with np.errstate(all="ignore"):
        ratio = 0.5 * damping_measures(roots(characteristic(point)))[0]
        if has_closed_form(point.model):
            part = response_numbers(point)
            terms = [part.k * np.ones_like(ratio), part.mu * part.k * part.B2, part.mu * part.B3]
        else:
            p, q = stiffness_polynomials(point)
            terms = [p[..., 0], point.named()["slider.stiffness"] * q[..., 0]]
        largest = sum(np.abs(term) for term in terms)
        static = np.where(largest == 0, 0.0, np.abs(sum(terms)) / largest)
        return np.asarray((np.abs(ratio) <= ON_THE_EDGE) | (static <= ON_THE_EDGE))
