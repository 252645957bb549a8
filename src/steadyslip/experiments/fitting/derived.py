"""Numbers that follow from fitted parameters: a − b, critical stiffness, and ratios of stiffnesses, with errors."""

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
TOGETHER = 0.1  # e-folds or natural sizes to which a number must be known: beyond, models with open directions curve
SIZE = 0.01  # natural size of a - b, as of b
LIKELY = 1.96  # standard deviations that the places stand for which fit as well: 95 %
STEP = 1e-2  # of a standard deviation, for slopes: far above rounding, and what is curved is that by less than 1e-2
LARGEST = 1e-2  # e-folds of which a step is a share at most: errors along open directions are small differences


@dataclass(frozen=True)
class Minimum:
    """Least sum of squares of a fit: coordinates (p,) in `space`, their covariance (p, p), and degrees of freedom.

    `joint` has errors of numbers that data tell although not of all parameters in them, by name and record; see
    `joint_errors`.
    """

    space: Space
    coordinates: Array
    covariance: Array
    degrees: int
    joint: Mapping[str, float] = field(default_factory=dict)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the coordinates (p,), inf where one is not determined."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def steps(self) -> Array:
        """Steps of coordinates (p,) for slopes, 0 where one is not determined."""
        return STEP * np.where(np.isfinite(self.deviations), np.minimum(self.deviations, LARGEST), 0.0)

    @property
    def lost(self) -> set[str]:
        """Parameters that are not determined, or of which rounding leaves nothing."""
        return {one.parameter for one, step in zip(self.space.unknowns, self.steps, strict=True) if not step > 0}


def derived_estimates(
    minimum: Minimum, rigs: Sequence[Slider], calibrated: float | None = None
) -> tuple[Estimate, ...]:
    """Numbers that follow from the parameters of a rate-and-state law, with errors to first order.

    ``a - b`` is a less the sum of all b; ``k_c`` (Pa/m) and ``k/k_c`` are at the velocity and normal stress of the
    record. What a law does not have, or no record determines, is left out; ``a - b`` may be determined where neither a
    nor b is. Of several records each has its own, with ``@1`` and so on behind the name, unless they are alike.

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
    """Values (m,) of a number, with the parameters that it needs; errors are of its logarithm where `logarithmic`.

    `levels` are a and all b, of which steady sliding tells the difference.
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
    levels = {*direct, *evolving}
    found = [_Derived("a - b", "1", gain - loss, False, levels, levels)]
    try:
        edge, share = (
            np.broadcast_to(np.asarray(number(rig, own)), len(places)) for number in (critical_stiffness, safety_factor)
        )
    except (NotAvailable, ParameterError):  # a law without an edge, or draws that no rig has
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
    """Standard deviations (of logarithms, where positive) of numbers of which a parameter in `lost` has none, by name.

    ``a - b`` may be told where neither a nor b is, and then k_c where the slip distance is. An error reaches to the
    number at each of the places `near` (m, p) that fit as well; numbers that are not known well are left out. Names end
    with ``@1`` and so on.
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
    """Values at the minimum, then a step up and a step down in each coordinate."""
    steps = minimum.steps
    places = minimum.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
    return _of_rig(minimum.space, rig, record, calibrated, places)


def _of_record(minimum: Minimum, rig: Slider, record: int, calibrated: float | None) -> list[Estimate]:
    every = _at_minimum(minimum, rig, record, calibrated)
    errors = [_error(minimum, one, f"{one.name}@{record + 1}") for one in every]
    return [_estimate(minimum, rig.area, one, error) for one, error in zip(every, errors, strict=True)
            if np.isfinite(error)]  # fmt: skip


def _counted(one: _Derived, values: Array) -> Array:
    """Values, or their logarithms where errors are of these; inf where there are none."""
    with np.errstate(all="ignore"):
        found = np.log(values) if one.logarithmic else values
    return np.where(np.isfinite(found), found, np.inf)


def _error(minimum: Minimum, one: _Derived, name: str) -> float:
    """Standard deviation to first order, from a number `_at_minimum`; inf where it does not exist."""
    if one.needed & minimum.lost:
        return minimum.joint.get(name, np.inf)
    x, count, known = _counted(one, one.values), len(minimum.coordinates), minimum.steps > 0
    if not np.all(np.isfinite(x)):
        return np.inf
    slopes = (x[1 : 1 + count] - x[1 + count :])[known] / (2 * minimum.steps[known])
    inner = np.ix_(known, known)
    return float(np.sqrt(max(slopes @ minimum.covariance[inner] @ slopes, 0.0)))


def _estimate(minimum: Minimum, area: float | None, one: _Derived, error: float) -> Estimate:
    """Estimate of a number `_at_minimum` with its standard deviation, which is that of the logarithm if positive."""
    from scipy.stats import t

    value = float(one.values[0])
    x = float(_counted(one, one.values)[0])
    reach = float(t.ppf(0.975, max(minimum.degrees, 1))) * error
    low, high = x - reach, x + reach
    if one.logarithmic:
        low, high, error = float(np.exp(low)), float(np.exp(high)), error * value
    return Estimate(one.name, value, float(error), one.unit, low, high, area)
