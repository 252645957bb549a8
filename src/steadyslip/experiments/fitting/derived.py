"""What follows from fitted parameters, with errors: a − b, critical stiffness, and stiffness over critical."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.estimate import Estimate
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import critical_stiffness
from steadyslip.machine.slider import Slider

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


def _of_record(minimum: Minimum, rig: Slider, record: int, calibrated: float | None) -> list[Estimate]:
    parameters = {name: one.value for name, one in rig.parameters().items() if one.value is not None}
    direct, evolving = (
        [name for name in rig.of_kind(kind) if name in parameters] for kind in ("direct effect", "evolution effect")
    )
    if not direct or not evolving:
        return []
    deviations = minimum.deviations
    steps = STEP * np.where(np.isfinite(deviations), deviations, 0.0)
    places = minimum.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
    values = minimum.space.values(places)
    own = {
        one.parameter: values[:, i]
        for i, one in enumerate(minimum.space.unknowns)
        if one.record in (None, record) and one.parameter in parameters
    }

    def value(name: str) -> Array:
        return np.broadcast_to(own.get(name, np.array(parameters[name])), len(places)).astype(float)

    gain, loss = (np.sum([value(name) for name in names], axis=0) for names in (direct, evolving))
    level = gain - loss
    found = [(_estimate(minimum, rig.area, "a - b", "1", level, False), {*direct, *evolving})]
    try:
        edge, share = (np.asarray(number(rig, own)) for number in (critical_stiffness, safety_factor))
    except NotAvailable:
        edge = share = np.full(len(places), np.nan)
    if np.all(np.isfinite(edge)) and np.all(edge > 0):
        found.append((_estimate(minimum, rig.area, "k_c", "Pa/m", edge, True), set(own) - {"slider.stiffness"}))
    if np.all(np.isfinite(share)) and np.all(share > 0):
        found.append((_estimate(minimum, rig.area, "k/k_c", "1", share, True), set(own)))
    stiffness = next((name for name in rig.of_kind("stiffness") if name in own), None)
    if calibrated is not None and stiffness is not None:
        ratio = own[stiffness] / calibrated
        found.append((_estimate(minimum, rig.area, "k/k_cal", "1", ratio, True), {stiffness}))
    lost = {
        one.parameter for one, size in zip(minimum.space.unknowns, deviations, strict=True) if not np.isfinite(size)
    }
    return [one for one, needed in found if not needed & lost]


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
