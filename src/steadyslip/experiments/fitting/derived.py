"""Numbers that follow from fitted parameters: a − b, critical stiffness, and ratios of stiffnesses, with errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import critical_stiffness
from steadyslip.machine.slider import Slider

DERIVED = ("a - b", "k_c", "k/k_c", "k/k_cal")
STEP = 1e-2  # of a standard deviation, for slopes: far above rounding, and what is curved is that by less than 1e-2


@dataclass(frozen=True)
class Minimum:
    """Least sum of squares of a fit: coordinates (p,) in `space`, their covariance (p, p), and degrees of freedom."""

    space: Space
    coordinates: Array
    covariance: Array
    degrees: int

    @property
    def deviations(self) -> Array:
        """Standard deviations of the coordinates (p,), inf where one is not determined."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def derived_estimates(
    minimum: Minimum, rigs: Sequence[Slider], calibrated: float | None = None
) -> tuple[Estimate, ...]:
    """Numbers that follow from the parameters of a rate-and-state law, with errors to first order.

    ``a - b`` is a less the sum of all b; ``k_c`` (Pa/m) and ``k/k_c`` are at the velocity and normal stress of the
    record. What a law does not have, or no record determines, is left out. Of several records each has its own, with
    ``@1`` and so on behind the name, unless they are alike.

    Parameters
    ----------
    minimum : Minimum
    rigs : sequence of Slider
        Of each record, with its rate and normal stress.
    calibrated : float, optional
        Stiffness of the machine, Pa/m; the fitted one over it is ``k/k_cal``.
    """
    found: dict[str, list[Estimate]] = {}
    for record, rig in enumerate(rigs):
        for one in _of_record(minimum, rig, record, calibrated):
            found.setdefault(one.name, []).append(one)
    chosen: list[Estimate] = []
    for name, own in found.items():
        alike = len({(one.value, one.error) for one in own}) == 1
        chosen += own[:1] if alike else [replace(one, name=f"{name}@{i}") for i, one in enumerate(own, start=1)]
    return tuple(chosen)


@dataclass(frozen=True, eq=False)
class _Derived:
    """Values (m,) of a number, with the parameters that it needs; errors are of its logarithm where `logarithmic`."""

    name: str
    unit: str
    values: Array
    logarithmic: bool
    needed: set[str]


def derived_values(
    space: Space, rigs: Sequence[Slider], calibrated: float | None, coordinates: Array
) -> dict[str, Array]:
    """Values (m,) at coordinates (m, p) by name, alone and with ``@1`` and so on behind it; NaN for what is not."""
    found: dict[str, Array] = {}
    for record, rig in enumerate(rigs, start=1):
        for one in _of_rig(space, rig, record - 1, calibrated, coordinates):
            values = np.where(one.values > 0, one.values, np.nan) if one.logarithmic else one.values
            found[f"{one.name}@{record}"] = values
            found.setdefault(one.name, values)
    return found


def _of_rig(space: Space, rig: Slider, record: int, calibrated: float | None, places: Array) -> list[_Derived]:
    parameters = {name: one.value for name, one in rig.parameters().items() if one.value is not None}
    direct, evolving = (
        [name for name in rig.of_kind(kind) if name in parameters] for kind in ("direct effect", "evolution effect")
    )
    if not direct or not evolving:
        return []
    values = space.values(places)
    own = {
        one.parameter: values[:, i]
        for i, one in enumerate(space.unknowns)
        if one.record in (None, record) and one.parameter in parameters
    }

    def value(name: str) -> Array:
        return np.broadcast_to(own.get(name, np.array(parameters[name])), len(places)).astype(float)

    gain, loss = (np.sum([value(name) for name in names], axis=0) for names in (direct, evolving))
    found = [_Derived("a - b", "1", gain - loss, False, {*direct, *evolving})]
    try:
        edge, share = (
            np.broadcast_to(np.asarray(number(rig, own)), len(places)) for number in (critical_stiffness, safety_factor)
        )
    except (NotAvailable, ParameterError):  # a law without an edge, or draws that no rig has
        edge = share = np.full(len(places), np.nan)
    found.append(_Derived("k_c", "Pa/m", edge, True, set(own) - {"slider.stiffness"}))
    found.append(_Derived("k/k_c", "1", share, True, set(own)))
    stiffness = next((name for name in rig.of_kind("stiffness") if name in own), None)
    if calibrated is not None and stiffness is not None:
        found.append(_Derived("k/k_cal", "1", own[stiffness] / calibrated, True, {stiffness}))
    return found


def _of_record(minimum: Minimum, rig: Slider, record: int, calibrated: float | None) -> list[Estimate]:
    deviations = minimum.deviations
    steps = STEP * np.where(np.isfinite(deviations), deviations, 0.0)
    places = minimum.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
    lost = {
        one.parameter for one, size in zip(minimum.space.unknowns, deviations, strict=True) if not np.isfinite(size)
    }
    return [
        _estimate(minimum, rig.area, one.name, one.unit, one.values, one.logarithmic)
        for one in _of_rig(minimum.space, rig, record, calibrated, places)
        if np.all(np.isfinite(one.values))
        and not (one.logarithmic and np.any(one.values <= 0))
        and not one.needed & lost
    ]


def _estimate(minimum: Minimum, area: float | None, name: str, unit: str, values: Array, logarithmic: bool) -> Estimate:
    """Estimate from values at the minimum, then a step up and a step down in each coordinate."""
    from scipy.stats import t

    count = len(minimum.coordinates)
    x = np.log(values) if logarithmic else values
    deviations = minimum.deviations
    known = np.isfinite(deviations)
    slopes = np.zeros(count)
    slopes[known] = (x[1 : 1 + count] - x[1 + count :])[known] / (2 * STEP * deviations[known])
    inner = np.ix_(known, known)
    error = float(np.sqrt(max(slopes[known] @ minimum.covariance[inner] @ slopes[known], 0.0)))
    reach = float(t.ppf(0.975, max(minimum.degrees, 1))) * error
    low, high = x[0] - reach, x[0] + reach
    if logarithmic:
        low, high, error = np.exp(low), np.exp(high), error * values[0]
    return Estimate(name, float(values[0]), float(error), unit, float(low), float(high), area)
