"""The verdict on arrays of rigs as one small number each, for scans and charts."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.linear.polynomials import is_hurwitz
from steadyslip.linear.stiffness import characteristic
from steadyslip.steady import out_of_range, steady_stress
from steadyslip.values import Values

ABSENT, STABLE, UNSTABLE, UNKNOWN = range(4)


def status(values: Values) -> Any:
    """ABSENT (no steady sliding), STABLE, UNSTABLE (ill-posed too) or UNKNOWN (out of floating point, or no rig)."""
    with np.errstate(all="ignore"):
        exists = np.isfinite(steady_stress(values))
        c = characteristic(values)
        verdict = np.where(is_hurwitz(c), STABLE, UNSTABLE)
        known = np.where(np.all(np.isfinite(c), axis=-1), verdict, UNKNOWN)
        found = np.where(exists, known, np.where(out_of_range(values), UNKNOWN, ABSENT))
        return np.where(values.valid, found, UNKNOWN)
