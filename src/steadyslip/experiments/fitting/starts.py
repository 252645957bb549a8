"""Starting points and bounds of the search, derived from features of the records.

The direct effect is at least the first response to a step of the rate. The change to the new steady friction gives
a − b. The steepest rise of friction with displacement is at most the stiffness over normal stress. The slip distance
lies between the slip per sample and the slip of the whole record. Many combinations of such values are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import InternalError
from steadyslip.core.results import read_only
from steadyslip.experiments.fitting.commanded import CommandedInputs, time_windows
from steadyslip.experiments.fitting.comparison import RecordPart
from steadyslip.experiments.fitting.input_tables import ProtocolInputs
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.fitting.unknowns import Space, Unknown
from steadyslip.experiments.loading.loading import resting_rate
from steadyslip.experiments.loading.pressing import LoadStep
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA
from steadyslip.model.sliding import steady_state

WINDOW_SHARE = 0.5  # share of the window of a free time over which its starting values are spread
SPIKE_RATIO = 2.0  # a sample is a spike if it is off its neighbours by more than this multiple of the range of friction
MAX_STIFFNESS_RATIO = 100.0  # largest starting value of k d_c/(aσ): records do not determine a stiffer machine
FASTER = 100.0  # largest starting value of a velocity scale over the fastest rate of the load point: slip can be faster
FURTHER = 2  # number of velocity scales that start independently of each other: v_a and v_b
_DIRECT = (0.004, 0.01, 0.025)  # starting values of a without a velocity step: the range usual for rocks
_SIGN = ("direct effect", "evolution effect")  # kinds of a and b
OTHER_SIDE = (0.5, 2.0)  # starting values of b/a in a search for a − b of the other sign: usual in laboratories


@dataclass(frozen=True)
class Features:
    """Rough properties of a record, from which starting values are derived.

    Attributes
    ----------
    friction : float
        Initial friction coefficient.
    direct : float or None
        Peak change of friction after the largest velocity step, over the change of ln(velocity).
    drop : float or None
        Change of steady friction over the change of ln(velocity), a − b.
    slope : float
        Steepest rise of friction with displacement of the load point, 1/m.
    least_slope : float
        Range of friction over the whole displacement, 1/m.
    shortest, longest : float
        Range of slip distances that the record resolves, m.
    slowest, fastest : float
        Range of the rates of the load point, m/s, without holds.
    """

    friction: float
    direct: float | None
    drop: float | None
    slope: float
    least_slope: float
    shortest: float
    longest: float
    slowest: float
    fastest: float


@cached
def features(record: Record, rate: float) -> Features:
    """Features of a record; `rate` is the load-point velocity at its start, m/s."""
    record = replace(record, friction=_without_spikes(record.friction), commanded=record.loading)
    time, mu = record.time, record.friction
    moved = _displacement(record, 0.0 if resting_rate(record.loading) is not None else rate)
    first = max(5, len(mu) // 50)
    level = float(np.median(mu[:first]))
    steps = [s for s in record.steps if s.kind == "velocity step" and min(s.before, s.after) > 0]
    steps.sort(key=lambda s: -abs(np.log(s.after / s.before)))
    slope = max((_slope_after_step(record, moved, s) for s in record.steps), default=_steepest_slope(moved, mu))
    total = max(float(moved[-1]), 1e-12)
    spacing = float(np.median(np.diff(time))) * max(rate, *(s.after for s in steps), 0.0) if steps else total / len(mu)
    shortest = max(min(0.5 * spacing, total / 50), total * 1e-5)
    direct = drop = None
    if steps:
        direct, drop = _step_response(record, moved, steps[0])
    rates = [rate, *(one for step in record.steps if step.unit != "Pa" for one in (step.before, step.after) if one > 0)]
    least_slope = float(np.ptp(mu)) / total
    return Features(level, direct, drop, slope, least_slope, shortest, total / 2, min(rates), max(rates))


def _without_spikes(friction: Array) -> Array:
    """Friction (n,) with isolated outliers replaced by the median of their neighbours."""
    around = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(friction, 2, mode="edge"), 5), axis=1)
    low, high = np.quantile(friction, [0.01, 0.99])
    return np.where(np.abs(friction - around) > SPIKE_RATIO * (high - low), around, friction)


def _displacement(record: Record, rate: float) -> Array:
    """Displacement of the load point (n,), m, integrated from its velocity steps and thus free of noise."""
    time = record.time
    changes = [(s.time, s.duration, s.after) for s in record.steps if s.unit != "Pa"]
    knots, rates = [float(time[0])], [rate]
    for moment, duration, after in changes:
        knots += [moment, moment + max(duration, 1e-9 * (time[-1] - time[0]))]
        rates += [rates[-1], after]
    knots.append(float(time[-1]) + 1.0)
    rates.append(rates[-1])
    along = np.interp(time, knots, rates)
    return np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1]) * np.diff(time))])


def _step_response(record: Record, moved: Array, step: LoadStep) -> tuple[float, float]:
    """Peak and steady change of friction after a velocity step, both over the change of ln(velocity)."""
    time, mu = record.time, record.friction
    fold = float(np.log(step.after / step.before))
    others = [s.time for s in record.steps if s.time > step.time + step.duration]
    first = min(int(np.searchsorted(time, step.time)), len(time) - 1)  # another change may follow before this sample
    end = max(min(others, default=float(time[-1])), float(time[first]))
    earlier = [s.time + s.duration for s in record.steps if s.time < step.time]
    begin = max(earlier, default=float(time[0]))
    before = (time < step.time) & (time > step.time - 0.5 * (step.time - begin))
    after = (time >= step.time) & (time <= end)
    late = after & (moved > moved[after][0] + 0.7 * (moved[after][-1] - moved[after][0]))
    level = float(np.mean(mu[before])) if np.any(before) else float(mu[0])
    noise = float(np.std(mu[before])) if np.sum(before) > 5 else 0.0
    deviation = (mu[after] - level) * np.sign(fold)
    soon = deviation[: max(5, int(0.3 * len(deviation)))]
    peak = max(float(np.max(_smoothed(soon))) - noise, 1e-4)
    return peak / abs(fold), (float(np.mean(mu[late])) - level) / fold if np.any(late) else 0.0


def _smoothed(values: Array, width: int = 3) -> Array:
    if len(values) < width:
        return values
    return np.convolve(values, np.ones(width) / width, mode="valid")


def _slope_after_step(record: Record, moved: Array, step: LoadStep) -> float:
    """Steepest rise of friction with displacement, 1/m, in the samples after a step of velocity or normal stress."""
    begin = max(int(np.searchsorted(record.time, step.time)) - 1, 0)
    if step.unit == "Pa":
        begin = int(np.searchsorted(record.time, step.time + step.duration, side="right")) + 1
    part = slice(begin, begin + 200)
    if len(record.time[part]) < 3:
        return 0.0
    return _steepest_slope(moved[part], record.friction[part])


def _steepest_slope(moved: Array, mu: Array) -> float:
    """Largest slope of friction with displacement, 1/m, that exceeds the noise."""
    noise = MAD_TO_SIGMA * float(np.median(np.abs(np.diff(mu)))) / np.sqrt(2) if len(mu) > 3 else 0.0
    best = 0.0
    for width in (2, 3, 5, 9, 17, 33, 65):
        if len(mu) <= width:
            break
        rise = np.abs(mu[width:] - mu[:-width]) - 5 * noise
        gone = moved[width:] - moved[:-width]
        moving = gone > 3e-4 * (moved[-1] - moved[0])
        best = max(best, float(np.max(rise[moving] / gone[moving], initial=0.0)))
    return max(best, float(np.ptp(mu)) / max(float(np.ptp(moved)), 1e-12))


def features_of(parts: Sequence[RecordPart]) -> tuple[Features, ...]:
    """Features of each record."""
    return tuple(features(part.record, part.rig.drive.velocity) for part in parts)


def starting_points(
    parts: Sequence[RecordPart], found: Sequence[Features], space: Space, count: int = STARTS, already: int = 0
) -> Array:
    """Starting coordinates (count, p), spread by a Halton sequence; the first `already` points are left out."""
    grid = _design(already + count)[already:]
    shortest, longest = min(f.shortest for f in found), max(f.longest for f in found)
    d_c = shortest * (longest / shortest) ** (0.05 + 0.85 * grid[:, 0])
    directs = [f.direct for f in found if f.direct is not None]
    drops = [f.drop for f in found if f.drop is not None]
    if directs:
        a = np.clip(max(directs), 5e-4, 0.2) * 4.0 ** grid[:, 1]
        b = a - (float(np.median(drops)) if drops else 0.0)
    else:
        a = np.array(_DIRECT)[(grid[:, 1] * len(_DIRECT)).astype(int)]
        b = a * (0.7 + 0.8 * grid[:, 2])
    steepness = max(f.slope for f in found) * 10.0 ** (1.2 * grid[:, 3] - 0.1)
    steepness = np.minimum(steepness, MAX_STIFFNESS_RATIO * a / d_c)
    alpha = 0.1 + 0.5 * grid[:, 4]
    alike = np.argsort(steepness / a)  # similar stiffness next to each other, as SIMD lanes wait for the slowest lane
    d_c, a, b, steepness, alpha, grid = (x[alike] for x in (d_c, a, b, steepness, alpha, grid))
    values = np.zeros((count, len(space)))
    for i, unknown in enumerate(space.unknowns):
        part = parts[unknown.record or 0]
        own = found[unknown.record or 0]
        alone = sum(one.kind == unknown.kind and one.record == unknown.record for one in space.unknowns) == 1
        spread = grid[:, 5]
        if unknown.kind == "velocity scale":
            spread = grid[:, 6 + sum(one.kind == unknown.kind for one in space.unknowns[:i]) % FURTHER]
        values[:, i] = _start(unknown, part, own, (d_c, a, b, steepness, alpha, spread), alone)
    return space.coordinates(np.clip(values, [u.low for u in space.unknowns], [u.high for u in space.unknowns]))


@lru_cache(maxsize=8)
def _design(count: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(read_only(qmc.Halton(6 + FURTHER, rng=12345).random(count)))


def search_bounds(parts: Sequence[RecordPart], known: Sequence[Features], space: Space) -> tuple[Array, Array]:
    """Bounds of the coordinates, (p,) each, from the parameters' domains and the resolution of the records.

    A slip distance far below the slip between samples, or far above the whole record, has no effect on the model.
    """
    low, high = space.low.copy(), space.high.copy()
    for i, unknown in enumerate(space.unknowns):
        own = known if unknown.record is None else [known[unknown.record]]
        if unknown.kind == "slip distance":
            ends = min(f.shortest for f in own) / 5, max(f.longest for f in own) * 40
        elif unknown.kind == "drainage":  # slower than the record, or faster than its sampling, drainage has no effect
            times = [parts[k].record.time for k in range(len(parts)) if unknown.record in (None, k)]
            ends = 0.03 / max(map(np.ptp, times)), 10.0 / min(float(np.min(np.diff(time))) for time in times)
        elif unknown.kind == "direct effect":
            ends = 1e-5, 1.0
        elif unknown.kind == "stiffness":
            stress = max(_stress(part) for part in parts)
            ends = min(f.least_slope for f in own) * stress * 1e-2, max(f.slope for f in own) * stress * 1e3
        else:
            continue
        low[i] = max(low[i], float(unknown.coordinate(ends[0])))
        high[i] = min(high[i], float(unknown.coordinate(ends[1])))
    return low, high


def _start(unknown: Unknown, part: RecordPart, own: Features, design: tuple[Array, ...], alone: bool) -> Array:
    """Starting values (count,) of one unknown; `alone` is True if no other unknown is of the same kind."""
    name = unknown.parameter
    d_c, a, b, steepness, alpha, spare = design
    rig = part.rig
    member = next((int(part) for part in name.split(".") if part.isdigit()), 0)
    if unknown.kind == "direct effect":
        return a
    if unknown.kind == "friction level":
        references = [rig.value(name) for name in rig.of_kind("reference rate") if name.startswith("friction.")]
        rate = rig.drive.velocity / (references[0] or 1.0) if references else 1.0
        return np.asarray(own.friction - (a - b) * np.log(rate))
    if unknown.kind == "evolution effect":
        if member and not alone:  # the first state gets what the other states leave
            return b * (0.35 + 0.5 * spare) if member == 1 else b * (0.65 - 0.5 * spare)
        return b
    if unknown.kind == "slip distance":
        return d_c * (3.0 + 30.0 * spare) ** max(member - 1, 0)
    if unknown.kind == "stress share":
        return alpha
    if unknown.kind == "velocity scale":
        return own.slowest * (FASTER * own.fastest / own.slowest) ** spare
    if unknown.kind == "drainage":  # drainage takes between a few samples and the whole record
        span, spacing = float(np.ptp(part.record.time)), float(np.median(np.diff(part.record.time)))
        return (0.3 / spacing) * (10 * spacing / span) ** spare
    if unknown.kind == "immediate share":
        return 1.0 - alpha
    if unknown.kind == "stiffness":
        return steepness * _stress(part)
    if name.startswith(("trend.", "offset")):
        return np.zeros_like(a)
    if name.startswith("initial."):
        return 0.5 * (spare - 0.5) * unknown.size
    if name == "lag":
        return 0.5 * (spare - 0.5) * (unknown.high - unknown.low)
    if name == "start.hold":
        return float(np.ptp(part.record.time)) * 10.0 ** (3 * spare - 1.5)
    if name.startswith("step."):
        return _change_time(unknown, part, spare)
    if name.startswith("jump."):
        return unknown.low + (unknown.high - unknown.low) * spare
    present = float(rig.parameters()[name].value or 0.0) if name in rig.parameters() else None
    if present is None:
        return np.full_like(a, _protocol_time(name, part))
    return present * 10.0 ** (2 * spare - 1) if present else 0.02 * (spare - 0.5)


def _change_time(unknown: Unknown, part: RecordPart, spare: Array) -> Array:
    """Starting values (count,) of the time of a change, s, spread over part of its window."""
    if not isinstance(part.inputs, CommandedInputs):
        raise InternalError("times of changes are free in commanded loading only")
    begin = {(low, high): value for value, low, high in time_windows(part.inputs.changes)}[(unknown.low, unknown.high)]
    return np.asarray(begin + WINDOW_SHARE * (spare - 0.5) * (unknown.high - unknown.low))


def _stress(part: RecordPart) -> float:
    """Initial normal stress of a record, Pa."""
    return float(part.record.normal[0]) if part.record.normal is not None else steady_state(part.rig).normal_stress


def _protocol_time(name: str, part: RecordPart) -> float:
    """Starting value of a free time of the protocol, s: its value in the protocol."""
    if not isinstance(part.inputs, ProtocolInputs):
        raise InternalError(f"{name} is free, but the record is not driven by a protocol")
    return float(part.inputs.plain[name] or 0.0)


def of_other_sign(space: Space, coordinates: Array) -> Array:
    """Coordinates (1, p) with the other sign of a − b; empty (0, p) unless exactly one a and one b are unknown."""
    kinds = [one.kind for one in space.unknowns]
    if any(kinds.count(kind) != 1 for kind in _SIGN):
        return coordinates[:0]
    a, b = map(kinds.index, _SIGN)
    values, found = space.values(coordinates), coordinates.copy()
    ratio = OTHER_SIDE[int(values[0, b] < values[0, a])]
    found[0, b] = space.unknowns[b].coordinate(ratio * values[0, a])
    return found
