"""Comparison of a given protocol with the measured displacement of the load point."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.experiments.loading.across import yielding
from steadyslip.experiments.loading.loading import Course
from steadyslip.experiments.numerics.splitting import displacement_noise, line, spread

RATE_SHARE = 0.02  # smaller relative differences of rates are not reported: calibrations agree to about one percent
BEYOND = 5.0  # a difference of more than this many standard deviations is not noise of the sensor
FEWEST = 8  # least number of samples from which a rate is computed
SETTLED = 0.3  # first share of the time at a rate that is ignored, as a servo may still be settling


@dataclass(frozen=True)
class _Stretch:
    """Part of a protocol at one rate, with a straight line through the measured minus the commanded displacement.

    `count` is the number of samples on the line; `offset` (m) and `excess` (m/s) are its mean and its slope, `noise`
    (m) is the scatter about it.
    """

    begin: float
    end: float
    count: int
    rate: float
    offset: float
    excess: float
    excess_error: float
    noise: float


def protocol_against_record(part: Any, times: Array) -> str:
    """Sentence that says where a protocol contradicts the measured displacement of a record; empty if they agree.

    Parameters
    ----------
    part : RecordPart
        Record with its model, which a protocol drives.
    times : ndarray (free,)
        Values of the protocol's free times, s.
    """
    record = part.record
    rows = part.inputs.table(times[None]).segments[0]
    stretches = _stretches(record.time, record.displacement, rows)
    wrong = [one for one in stretches if abs(one.excess) > max(
        BEYOND * one.excess_error, RATE_SHARE * max(abs(one.rate), abs(one.rate + one.excess)))]  # fmt: skip
    if wrong:
        worst = max(wrong, key=lambda one: abs(one.excess) * (one.end - one.begin))
        had = format_quantity(worst.rate + worst.excess, "m/s")
        return (
            f"{record.source}: from {worst.begin:.6g} to {worst.end:.6g} s the protocol moves the load point at "
            f"{format_quantity(worst.rate, 'm/s')}, but the record's displacement moves at {had}: one of them is "
            f"wrong, and so is every number above if it is the protocol; {_CURE}"
        )
    course = record.loading.load
    if course is not None and yielding(record.time, record.displacement, record.friction, course) is not None:
        return ""  # a displacement across the fault does not show when the load point changed its rate
    return _late(record.source, stretches, course)


_CURE = "correct it, or leave the protocol out, so that the displacement drives the fit"


def _late(source: str, stretches: list[_Stretch], course: Course | None) -> str:
    """Sentence on a change of rate that was earlier or later than in the protocol; empty if there is none."""
    for before, after in pairwise(stretches):
        behind = before.offset - after.offset
        noise = max(before.noise, after.noise)
        if abs(behind) > max(BEYOND * noise * np.sqrt(1 / before.count + 1 / after.count), noise):
            late = behind / (after.rate - before.rate)
            when = f"{format_quantity(abs(late), 's')} {'later' if late > 0 else 'earlier'}"
            lags = course is not None and any(change.lag or change.pieces for change in course.changes)
            why = (
                "the load point follows it late"
                if lags
                else "it came then, or a servo follows it"
                if late > 0
                else "it came then"
            )
            return (
                f"{source}: the displacement shows the protocol's change to {format_quantity(after.rate, 'm/s')} at "
                f"{after.begin:.6g} s {when}: {why}; the model moves as the protocol says, which makes the stiffness "
                f"and the direct effect wrong; {_CURE}"
            )
    return ""


def _stretches(time: Array, displacement: Array, rows: Array) -> list[_Stretch]:
    """Parts of a protocol at constant rates, from its input table, compared with the measured displacement."""
    rows = rows[rows[:, 1] > rows[:, 0]]
    begins, rates, slopes = rows[:, 0], rows[:, 3], rows[:, 6]
    spans = rows[:, 1] - begins
    moved = np.concatenate([[0.0], np.cumsum((rates + 0.5 * slopes * spans) * spans)])[:-1] + np.cumsum(rows[:, 2])
    own = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, len(rows) - 1)
    since = time - begins[own]
    strays = displacement - (moved[own] + (rates[own] + 0.5 * slopes[own] * since) * since)
    noise = displacement_noise(time, displacement)
    found = []
    edges = [0, *(np.flatnonzero((np.diff(rates) != 0) | (np.diff(slopes) != 0)) + 1), len(rows)]
    for first, last in pairwise(edges):
        begin, end = float(begins[first]), float(rows[last - 1, 1])
        settled = (time >= begin + (SETTLED * (end - begin) if first else 0.0)) & (time <= end)
        if slopes[first] or np.sum(settled) < FEWEST:
            continue
        t, y = time[settled], strays[settled]
        start, slope = line(t, y)
        scatter = max(spread(y - start - slope * (t - t[0])), noise)
        error = scatter / max(float(np.sqrt(np.sum((t - t.mean()) ** 2))), 1e-300)
        found.append(_Stretch(begin, end, len(t), float(rates[first]), float(y.mean()), slope, error, scatter))
    return found
