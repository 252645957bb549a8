"""What follows from fitted parameters, with errors: a − b, critical stiffness, and stiffness over critical."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.estimate import Estimate
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import critical_stiffness

if TYPE_CHECKING:
    from steadyslip.experiments.fitting.numbers import FitNumbers

STEP = 1e-2  # of a standard deviation, for slopes: far above rounding, and what is curved is that by less than 1e-2
_EVOLUTION = re.compile(r"friction\.(states\.\d+\.)?b")


def derived_estimates(fit: FitNumbers) -> tuple[Estimate, ...]:
    """Numbers that follow from the parameters of a rate-and-state law, with errors to first order.

    ``a - b`` is a less the sum of all b; ``k_c`` (Pa/m) and ``k/k_c`` are at the velocity and normal stress of the
    record. What a law does not have, or no record determines, is left out. Of several records each has its own, with
    ``@1`` and so on behind the name, unless they are alike.
    """
    found: dict[str, list[Estimate]] = {}
    for record in range(len(fit.plan.records)):
        for one in _of_record(fit, record):
            found.setdefault(one.name, []).append(one)
    chosen: list[Estimate] = []
    for name, own in found.items():
        alike = len({(one.value, one.error) for one in own}) == 1
        chosen += own[:1] if alike else [replace(one, name=f"{name}@{i}") for i, one in enumerate(own, start=1)]
    return tuple(chosen)


def _of_record(fit: FitNumbers, record: int) -> list[Estimate]:
    rig = fit.comparison.parts[record].rig
    parameters = {name: one.value for name, one in rig.parameters().items() if one.value is not None}
    evolving = [name for name in parameters if _EVOLUTION.fullmatch(name)]
    if "friction.a" not in parameters or not evolving:
        return []
    deviations = np.sqrt(np.diag(fit.covariance))
    steps = STEP * np.where(np.isfinite(deviations), deviations, 0.0)
    places = fit.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
    values = fit.space.values(places)
    own = {
        one.parameter: values[:, i]
        for i, one in enumerate(fit.space.unknowns)
        if one.record in (None, record) and one.parameter in parameters
    }

    def value(name: str) -> Array:
        return np.broadcast_to(own.get(name, np.array(parameters[name])), len(places)).astype(float)

    level = value("friction.a") - sum(value(name) for name in evolving)
    found = [(_estimate(fit, "a - b", "1", level, False), {"friction.a", *evolving})]
    try:
        edge, share = (np.asarray(number(rig, own)) for number in (critical_stiffness, safety_factor))
    except NotAvailable:
        edge = share = np.full(len(places), np.nan)
    if np.all(np.isfinite(edge)) and np.all(edge > 0):
        found.append((_estimate(fit, "k_c", "Pa/m", edge, True), set(own) - {"slider.stiffness"}))
    if np.all(np.isfinite(share)) and np.all(share > 0):
        found.append((_estimate(fit, "k/k_c", "1", share, True), set(own)))
    lost = {one.parameter for one, size in zip(fit.space.unknowns, deviations, strict=True) if not np.isfinite(size)}
    return [one for one, needed in found if not needed & lost]


def _estimate(fit: FitNumbers, name: str, unit: str, values: Array, logarithmic: bool) -> Estimate:
    """Estimate from values at the minimum, then a step up and a step down in each coordinate."""
    from scipy.stats import t

    count = len(fit.coordinates)
    x = np.log(values) if logarithmic else values
    deviations = np.sqrt(np.diag(fit.covariance))
    known = np.isfinite(deviations)
    slopes = np.zeros(count)
    slopes[known] = (x[1 : 1 + count] - x[1 + count :])[known] / (2 * STEP * deviations[known])
    inner = np.ix_(known, known)
    error = float(np.sqrt(max(slopes[known] @ fit.covariance[inner] @ slopes[known], 0.0)))
    reach = float(t.ppf(0.975, max(fit.degrees, 1))) * error
    low, high = x[0] - reach, x[0] + reach
    if logarithmic:
        low, high, error = np.exp(low), np.exp(high), error * values[0]
    return Estimate(name, float(values[0]), float(error), unit, float(low), float(high), fit.plan.rig.area)
