"""Quantities that follow from fitted parameters, with errors: a − b, critical stiffness, ratios of stiffnesses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import critical_stiffness
from steadyslip.machine.slider import Slider

DERIVED = ("a - b", "k_c", "k/k_c", "k/k_cal")
TOGETHER = 0.1
"""A derived quantity is given although its parameters are not determined if its own error (of the logarithm, or over
`SIZE`) is at most this large."""
SIZE = 0.01  # typical size of a - b, and of b
LIKELY = 1.96  # half the width of a 95 % interval, in standard deviations: points within it fit as well
STEP = 1e-2  # step of finite differences, in standard deviations: far above rounding, with little effect of curvature
LARGEST = 1e-2  # larger standard deviations (of coordinates) are limited to this size for a step


@dataclass(frozen=True)
class Minimum:
    """Minimum of a fit: coordinates (p,) in `space`, their covariance (p, p), and degrees of freedom.

    `joint` holds, by name, errors of derived quantities that the data determine although they do not determine all
    parameters of these quantities; see `joint_errors`.
    """

    space: Space
    coordinates: Array
    covariance: Array
    degrees: int
    joint: Mapping[str, float] = field(default_factory=dict)

    @property
    def deviations(self) -> Array:
        """Standard deviations (p,) of the coordinates, inf for coordinates that are not determined."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def steps(self) -> Array:
        """Steps (p,) of the coordinates for finite differences, 0 for coordinates that are not determined."""
        return STEP * np.where(np.isfinite(self.deviations), np.minimum(self.deviations, LARGEST), 0.0)

    @property
    def lost(self) -> set[str]:
        """Names of parameters that are not determined, or have no step for finite differences."""
        return {one.parameter for one, step in zip(self.space.unknowns, self.steps, strict=True) if not step > 0}


def derived_estimates(
    minimum: Minimum, rigs: Sequence[Slider], calibrated: float | None = None
) -> tuple[Estimate, ...]:
    """Quantities that follow from the parameters of a rate-and-state law, with errors to first order.

    ``a - b`` is a minus the sum of all b; ``k_c`` (Pa/m) and ``k/k_c`` are at the velocity and normal stress of the
    record. Quantities that the law does not have, or that no record determines, are left out; ``a - b`` may be
    determined even if neither a nor b is. If values differ between records, their names end with ``@1`` and so on.

    Parameters
    ----------
    minimum : Minimum
    rigs : sequence of Slider
        Rig of each record, with its rate and normal stress.
    calibrated : float, optional
        Stiffness of the machine from a calibration, Pa/m, by which the fitted stiffness is divided in ``k/k_cal``.
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
    """Values (m,) of a derived quantity, with the names of the parameters that it depends on (`needed`).

    If `logarithmic`, errors are those of the logarithm of the quantity. `levels` are the names of a and all b: steady
    sliding determines their difference even if it determines none of them.
    """

    name: str
    unit: str
    values: Array
    logarithmic: bool
    needed: set[str]
    levels: set[str]


def derived_values(
    space: Space, rigs: Sequence[Slider], calibrated: float | None, coordinates: Array
) -> dict[str, Array]:
    """Derived values (m,) at coordinates (m, p), by name and by name with ``@1`` and so on; NaN if undefined."""
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
    levels = {*direct, *evolving}
    found = [_Derived("a - b", "1", gain - loss, False, levels, levels)]
    try:
        edge, share = (
            np.broadcast_to(np.asarray(number(rig, own)), len(places)) for number in (critical_stiffness, safety_factor)
        )
    except (NotAvailable, ParameterError):  # the law has no edge of stability, or values are impossible
        edge = share = np.full(len(places), np.nan)
    found.append(_Derived("k_c", "Pa/m", edge, True, set(own) - {"slider.stiffness"}, levels))
    found.append(_Derived("k/k_c", "1", share, True, set(own), levels))
    stiffness = next((name for name in rig.of_kind("stiffness") if name in own), None)
    if calibrated is not None and stiffness is not None:
        found.append(_Derived("k/k_cal", "1", own[stiffness] / calibrated, True, {stiffness}, levels))
    return found


def joint_errors(
    minimum: Minimum, rigs: Sequence[Slider], calibrated: float | None, lost: set[str], near: Array
) -> dict[str, float]:
    """Standard deviations, by name, of derived quantities that depend on an undetermined parameter (in `lost`).

    The data may determine ``a - b`` although they determine neither a nor b; if they determine the slip distance, they
    then also determine k_c. An error includes the change of the quantity at other points `near` (m, p) that fit as
    well; quantities with a large error are left out. Standard deviations of positive quantities are those of the
    logarithm. Names end with ``@1`` and so on.
    """
    found = {}
    for record, rig in enumerate(rigs):
        for one, place in zip(_at_minimum(minimum, rig, record, calibrated),
                              _of_rig(minimum.space, rig, record, calibrated, near), strict=True):  # fmt: skip
            if not one.needed & lost or one.needed & lost - one.levels:
                continue
            name = f"{one.name}@{record + 1}"
            own = float(_counted(one, one.values)[0])
            if not np.isfinite(own):
                continue
            error = float(
                np.hypot(_error(minimum, one, name), np.max(np.abs(_counted(one, place.values) - own)) / LIKELY)
            )
            if error <= TOGETHER * (1.0 if one.logarithmic else SIZE):
                found[name] = error
    return found


def _at_minimum(minimum: Minimum, rig: Slider, record: int, calibrated: float | None) -> list[_Derived]:
    """Derived quantities at the minimum, then after a step up and a step down in each coordinate."""
    steps = minimum.steps
    places = minimum.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
    return _of_rig(minimum.space, rig, record, calibrated, places)


def _of_record(minimum: Minimum, rig: Slider, record: int, calibrated: float | None) -> list[Estimate]:
    every = _at_minimum(minimum, rig, record, calibrated)
    errors = [_error(minimum, one, f"{one.name}@{record + 1}") for one in every]
    return [_estimate(minimum, rig.area, one, error) for one, error in zip(every, errors, strict=True)
            if np.isfinite(error)]  # fmt: skip


def _counted(one: _Derived, values: Array) -> Array:
    """Values (m,), or their logarithms for a quantity whose errors are those of the logarithm; inf if undefined."""
    with np.errstate(all="ignore"):
        found = np.log(values) if one.logarithmic else values
    return np.where(np.isfinite(found), found, np.inf)


def _error(minimum: Minimum, one: _Derived, name: str) -> float:
    """Standard deviation, to first order, of a quantity from `_at_minimum`; inf if it is not determined."""
    if one.needed & minimum.lost:
        return minimum.joint.get(name, np.inf)
    x, count, known = _counted(one, one.values), len(minimum.coordinates), minimum.steps > 0
    if not np.all(np.isfinite(x)):
        return np.inf
    slopes = (x[1 : 1 + count] - x[1 + count :])[known] / (2 * minimum.steps[known])
    inner = np.ix_(known, known)
    return float(np.sqrt(max(slopes @ minimum.covariance[inner] @ slopes, 0.0)))


def _estimate(minimum: Minimum, area: float | None, one: _Derived, error: float) -> Estimate:
    """Estimate of a quantity from `_at_minimum` with standard deviation `error` (of the logarithm if `logarithmic`)."""
    from scipy.stats import t

    value = float(one.values[0])
    x = float(_counted(one, one.values)[0])
    reach = float(t.ppf(0.975, max(minimum.degrees, 1))) * error
    low, high = x - reach, x + reach
    if one.logarithmic:
        low, high, error = float(np.exp(low)), float(np.exp(high)), error * value
    return Estimate(one.name, value, float(error), one.unit, low, high, area)
