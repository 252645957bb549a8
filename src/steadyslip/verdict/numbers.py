"""Fields of a verdict that follow from the characteristic equation: eigenvalues, Routh array, period, damping."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from steadyslip.linear.allowance import at_most
from steadyslip.linear.pencil import checked_spectrum
from steadyslip.linear.polynomials import routh_column
from steadyslip.linear.quasipolynomial import INFINITE
from steadyslip.linear.roots import roots
from steadyslip.linear.spectrum import growth, is_ill_posed, is_stable, spectrum, unstable_roots
from steadyslip.linear.undamped import is_undamped
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic, quasipolynomial, require_range
from steadyslip.verdict.checks import relative_errors

_BESIDE_AXIS = 1e-12  # |real part| over modulus below which it is rounding: a pair off the axis has at least 1e-8
_TERMS = 4_000_000  # limit of terms evaluated on the imaginary axis for a rig with delays: two to four seconds


def _without_delay(values: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` by name for a rig whose characteristic equation is a polynomial."""
    c = characteristic(values)
    stable = bool(is_stable(values))
    while len(c) > 2 and c[-1] == 0:
        c = c[:-1]
    return {
        "stable": stable,
        "eigenvalues": tuple(complex(s) for s in roots(c)),
        "characteristic_polynomial": tuple(float(x) for x in c),
        "routh": tuple(float(x) for x in routh_column(c)),
    }


def _with_delays(values: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` by name for a rig with delays: its characteristic equation is a sum of polynomials times
    exp(−s delay).
    """
    c, h = quasipolynomial(values)
    count = int(unstable_roots(values))
    return {
        "stable": bool(is_stable(values)),
        "eigenvalues": tuple(complex(s) for s in spectrum(values) if np.isfinite(s)),
        "characteristic_terms": tuple(
            (float(delay), tuple(float(x) for x in own)) for delay, own in zip(h, c, strict=True)
        ),
        "unstable_roots": None if count in (-1, INFINITE) else count,
    }


def linear_numbers(values: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` by name, from the characteristic equation; eigenvalues that fail their check are left out.

    Raises
    ------
    NotAvailable
        If the growing roots of a rig with delays cannot be counted, so that there is no verdict.
    """
    require_range(values)
    if values.model.delays:
        unstable_roots(values)
    with at_most(_TERMS):
        return _numbers(values)


def _numbers(values: OperatingPoint) -> dict[str, Any]:
    numbers = _with_delays(values) if values.model.delays else _without_delay(values)
    rate: float | None = math.inf
    if not is_ill_posed(values):
        found, good = checked_spectrum(values), relative_errors(values)[1]
        if found.refined and found.complete:  # eigenvalues computed with many digits overrule the polynomial
            numbers["stable"] = bool(found.growing == 0 and np.all(found.values != 0))  # eigenvalue 0: neutral
        leading = bool(good[:1].all() and good.size)
        numbers["eigenvalues"] = tuple(complex(s) for s in found.values[good]) if leading else ()
        no_rightmost = found.complete and not found.values.size
        rate = float(found.values[0].real) if leading else float(growth(values)) if no_rightmost else None
        rate = None if rate is not None and math.isnan(rate) else rate
    if bool(is_undamped(values)):
        numbers["eigenvalues"] = _on_the_axis(numbers["eigenvalues"])
        rate = max((s.real for s in numbers["eigenvalues"]), default=rate)
    eigenvalues = numbers["eigenvalues"]
    if eigenvalues and eigenvalues[-1].imag > 0:  # the list was cut between the two members of a pair
        eigenvalues = numbers["eigenvalues"] = (*eigenvalues, eigenvalues[-1].conjugate())
    return numbers | rates_of(eigenvalues, rate)


def _on_the_axis(eigenvalues: tuple[complex, ...]) -> tuple[complex, ...]:
    """Eigenvalues of an undamped machine, the slowest first; real parts that are only rounding are set to 0."""
    found = (s if abs(s.real) > _BESIDE_AXIS * abs(s) else complex(0.0, s.imag) for s in eigenvalues)
    return tuple(sorted(found, key=lambda s: (-s.real, abs(s.imag), -s.imag)))


def rates_of(eigenvalues: tuple[complex, ...], rate: float | None) -> dict[str, Any]:
    """Fields of `Analysis` on growth rate, time to halve or double, period and damping ratio; `rate` in 1/s."""
    numbers: dict[str, Any] = {"growth_rate": rate}
    if rate is not None and math.isfinite(rate) and rate != 0:
        numbers["time_to_halve" if rate < 0 else "time_to_double"] = math.log(2) / abs(rate)
    oscillation = next((s for s in eigenvalues if s.imag != 0), None)
    if oscillation is not None:
        numbers["period"] = float(2 * math.pi / abs(oscillation.imag))
        numbers["damping_ratio"] = float(-oscillation.real / abs(oscillation))
    return numbers
