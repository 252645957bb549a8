"""What follows from a characteristic polynomial, as the fields of a verdict."""

from __future__ import annotations

import math
from typing import Any

from steadyslip.linear.polynomials import is_hurwitz, roots, routh_column
from steadyslip.linear.stiffness import ill_posed
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic, require_range


def linear_numbers(values: OperatingPoint) -> dict[str, Any]:
    """Everything that follows from the characteristic polynomial."""
    require_range(values)
    c = characteristic(values)
    bad = bool(ill_posed(c))
    while len(c) > 2 and c[-1] == 0:
        c = c[:-1]
    eigenvalues = roots(c)
    numbers: dict[str, Any] = {
        "stable": bool(is_hurwitz(c)) and not bad,
        "eigenvalues": tuple(complex(s) for s in eigenvalues),
        "characteristic_polynomial": tuple(float(x) for x in c),
        "routh": tuple(float(x) for x in routh_column(c)),
    }
    growth = math.inf if bad else float(eigenvalues[0].real)
    numbers["growth_rate"] = growth
    if math.isfinite(growth) and growth != 0:
        numbers["time_to_halve" if growth < 0 else "time_to_double"] = math.log(2) / abs(growth)
    oscillation = next((s for s in eigenvalues if s.imag != 0), None)
    if oscillation is not None:
        numbers["period"] = float(2 * math.pi / abs(oscillation.imag))
        numbers["damping_ratio"] = float(-oscillation.real / abs(oscillation))
    return numbers
