"""Search for the least sum of squares in a fit of a machine, starting at the machine's parameters and around them.

The sum of squares has many local minima: a search does not correct a model frequency that is off by more than one
period over a ring-down, or by more than the width of a peak. Therefore each start is first fitted to a short beginning
of the motions, then to a longer beginning, and to the logarithm of responses. A weak penalty on the distance from the
start keeps parameters that a beginning does not determine near their start.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.effort import Effort, work_of_search
from steadyslip.experiments.fitting.machines.machine_plan import MachineComparison, MachinePlan, Model
from steadyslip.experiments.fitting.machines.series import EXACT, MotionModel, ResponseModel
from steadyslip.experiments.fitting.search import (
    FINALISTS,
    FIRST_STARTS,
    MIN_ARRIVED,
    ROUGH_ITERATIONS,
    Progress,
    SearchSummary,
)
from steadyslip.experiments.measured.motion_record import MotionRecord
from steadyslip.experiments.numerics.least_squares import DAMPING_NEAR, MERGE_DISTANCE, SAME_SSQ, Minima, minimise

BEGINNINGS = (1 / 16, 1 / 4)
"""Shares of a record that are fitted before the whole record: a frequency found in a part is precise enough to fit four
times its length. Without these parts, fits to ring-downs of 60 and 120 periods took 1.3 to 6 times as long."""
FEWEST_FOLLOWED = 10  # least number of samples in such a part
MOST_ITERATIONS = 100  # most iterations on whole records; longer searches are in a valley that the record leaves open
ROUGH_RTOL = 1e-6  # relative tolerance of the integration in the first parts
ROUGH_HOPE = 100.0  # fits to a first part with more than this multiple of the best sum of squares are dropped
HELD_BACK = 1e-4  # penalty if a parameter changes by a factor e, as a mean square of residuals over their size
ELSEWHERE, RISE = 0.1, 2.0
"""Two minima are different if they are farther apart than the first number in a coordinate, and if the sum of squares
halfway between them exceeds theirs by at least the second number as a factor."""
SPREAD = 1.15  # largest distance of a start from the machine's parameters, in ln(parameter): a factor of three


class FirstPart:
    """Residuals of the first part of all motions in a plan, and residuals of the logarithm of its frequency responses.

    Parameters
    ----------
    plan : MachinePlan
    share : float
        Length of the part as a share of each record, from its first disturbance on.
    effort : Effort
    """

    def __init__(self, plan: MachinePlan, share: float, effort: Effort) -> None:
        records, models = [], []
        for record in plan.records:
            if isinstance(record, MotionRecord):
                record = _cut(record, share, _disturbed(plan, record))
                model: Model = MotionModel(plan.rig, plan.protocol, record, ROUGH_RTOL, effort)
            else:
                model = ResponseModel(plan.rig, record)
            records.append(record)
            models.append(model)
        self.whole = plan.series
        self.comparison = MachineComparison(replace(plan, records=tuple(records)), models, rough=True)
        self.weights = [1 / own.size for own in self.whole]

    @property
    def size(self) -> int:
        return self.comparison.size

    def residuals(self, coordinates: Array, starts: Array) -> tuple[Array, Array]:
        """Residuals (m, n) and derivatives (m, p, n), including the p penalties on the distance from the starts."""
        predicted, slopes = self.comparison.model(coordinates)
        r, rows = self.comparison.data - predicted, np.array(slopes)
        for k, (one, where) in enumerate(zip(self.comparison.series, self.comparison.slices, strict=True)):
            if one.name.endswith(" real"):
                pair = slice(where.start, self.comparison.slices[k + 1].stop)
                r[:, pair], rows[:, :, pair] = _of_logarithms(self.comparison.data[pair], predicted[:, pair],
                                                              slopes[:, :, pair])  # fmt: skip
            elif not one.name.endswith(" imag"):
                r[:, where] *= self.weights[k]
                rows[:, :, where] *= self.weights[k]
        hold = np.sqrt(HELD_BACK * self.size)
        held = hold * np.broadcast_to(np.eye(coordinates.shape[1]), (len(coordinates), *2 * coordinates.shape[1:]))
        return np.concatenate([r, hold * (starts - coordinates)], axis=1), np.concatenate([rows, held], axis=2)


def _of_logarithms(data: Array, predicted: Array, slopes: Array) -> tuple[Array, Array]:
    """Residuals and derivatives of the logarithms of complex responses; real parts come before imaginary parts."""
    half = len(data) // 2

    def whole(parts: Array) -> Array:
        return np.asarray(parts[..., :half] + 1j * parts[..., half:])

    with np.errstate(all="ignore"):
        apart, rate = np.log(whole(data) / whole(predicted)), whole(slopes) / whole(predicted)[:, None]
    return (np.concatenate([one.real, one.imag], axis=-1) for one in (apart, rate))  # type: ignore[return-value]


def _disturbed(plan: MachinePlan, record: MotionRecord) -> float:
    """Time (s) of the first disturbance of a motion, or of its first sample if the protocol has no disturbance."""
    times = [float(getattr(piece, "at", 0.0) or 0.0) for piece in (plan.protocol.pieces if plan.protocol else ())]
    first = float(record.time[0])
    return first if plan.initial == "free" or not times else float(np.clip(min(times), first, record.time[-1]))


def _cut(record: MotionRecord, share: float, begin: float) -> MotionRecord:
    count = int(np.searchsorted(record.time, begin + share * (record.time[-1] - begin), side="right"))
    count = min(max(count, FEWEST_FOLLOWED), len(record))
    return replace(record, time=record.time[:count], columns={n: one[:count] for n, one in record.columns.items()})


def find_near(
    plan: MachinePlan, starts: int, effort: Effort, progress: Progress | None
) -> tuple[Array, SearchSummary, MachineComparison]:
    """Best-fit coordinates (p,), the summary of the search, and the comparison with the records.

    The first start has the machine's parameters. Further starts follow, up to `starts` in all, until `MIN_ARRIVED`
    starts have reached the best minimum.

    Raises
    ------
    NotAvailable
        If the machine cannot move as the records do from any start.
    """
    whole = plan.comparison(effort)
    for model in whole.models:
        if isinstance(model, MotionModel):
            model.run({}, {}, 1)  # raises an error with the reason if the machine cannot move
    stop = effort.budget.part(work_of_search(whole.size, len(whole.space)) * effort.budget.scale)
    motions = any(isinstance(record, MotionRecord) for record in plan.records)
    parts = [FirstPart(plan, share, effort) for share in (BEGINNINGS if motions else BEGINNINGS[:1])]
    parts = [one for one in parts if one.size >= 2 * len(whole.space)]
    begin, found, floor = _starts(plan, whole, starts), Minima.none(len(whole.space)), EXACT * whole.size
    tried, arrived, arrivals = 0, 0, np.empty(0, dtype=int)
    for upto in dict.fromkeys((min(FIRST_STARTS, starts), -(-starts // 3), starts)):
        if upto <= tried or (tried and stop()):
            continue
        here, counts = begin[tried:upto], np.ones(upto - tried, dtype=int)
        for part in parts:
            first = here.copy()
            ends = minimise(
                lambda z, which, part=part, first=first: part.residuals(z, first[which]), here, whole.low, whole.high,  # type: ignore[misc]
                most=ROUGH_ITERATIONS, tolerance=1e-4, stop=stop,
            )  # fmt: skip
            here, which = _hopeful(ends)
            counts = np.array([np.sum(counts[which == k]) for k in range(len(here))], dtype=int)
        if not tried:  # the machine's parameters may be near a minimum, and first parts mislead if a time is free
            here, counts = np.concatenate([here, begin[:1]]), np.append(counts, 1)
        tried = upto
        ends = minimise(
            lambda z, _: whole.residuals(z), here, whole.low, whole.high, most=MOST_ITERATIONS, race=1, stop=stop,
            damping=DAMPING_NEAR,
        )  # fmt: skip
        found, arrivals = found + ends, np.append(arrivals, counts)
        least = float(np.min(found.ssq, initial=np.inf))
        if progress is not None:
            progress("searching", tried, float(np.sqrt(least / whole.size)))
        arrived = min(int(np.sum(arrivals[found.ssq <= least * (1 + SAME_SSQ) + floor])), tried)
        if np.isfinite(least) and arrived >= min(MIN_ARRIVED, starts):
            break
    if not np.any(np.isfinite(found.ssq)):
        raise NotAvailable(
            "the machine cannot move as in these records from any start: are its values, protocol and initial state "
            "(initial) those of the test?"
        )
    found = found.sorted()
    others = found.ssq[found.converged] / max(least, floor)
    ratios = {float(f"{x:.3g}") for x in others if np.isfinite(x) and x > 1 + SAME_SSQ} if least > floor else set()
    if _is_another(whole, found, least * (1 + SAME_SSQ) + floor):
        ratios.add(1.0)
    ended = bool(found.converged[0]) or least <= floor
    summary = SearchSummary(tried, arrived, tuple(sorted(ratios)), int(found.iterations[0]), ended, stop.was_met)
    return found.coordinates[0], summary, whole


def _is_another(whole: MachineComparison, found: Minima, most: float) -> bool:
    """True if another minimum is as good as the first, and the sum of squares is larger between the two."""
    alike = found.coordinates[found.converged & (found.ssq <= most)]
    far = alike[np.max(np.abs(alike - found.coordinates[0]), axis=1, initial=0.0) > ELSEWHERE]
    return bool(len(far)) and bool(np.any(whole.misfit(0.5 * (far + found.coordinates[0])) > RISE * most))


def _hopeful(ends: Minima) -> tuple[Array, Array]:
    """Distinct end points (k, p) that may lead to the best minimum; for each of m ends, index of the point near it.

    The index is -1 for an end that is dropped. If no sum of squares could be computed, all ends are kept, as the sum
    over a longer part may be computable.
    """
    if not np.any(np.isfinite(ends.ssq)):
        return ends.coordinates, np.arange(len(ends.ssq))
    kept, _ = ends.distinct(FINALISTS, ROUGH_HOPE)
    apart = np.max(np.abs(ends.coordinates[:, None] - kept), axis=2)
    near = np.argmin(apart, axis=1)
    return kept, np.where((apart[np.arange(len(near)), near] < MERGE_DISTANCE) & np.isfinite(ends.ssq), near, -1)


def _starts(plan: MachinePlan, whole: MachineComparison, count: int) -> Array:
    """Starting coordinates (count, p): the machine's parameters, then points around them in a Halton sequence."""
    from scipy.stats import qmc

    own = plan.begins(whole.space)
    spread = np.array([0.0 if u.parameter not in plan.free else SPREAD if u.logarithmic else 0.5
                       for u in whole.space.unknowns])  # fmt: skip
    grid = qmc.Halton(len(own), rng=12345).random(count)
    grid[0] = 0.5
    found = own + (2 * grid - 1) * spread
    found[1::2] += plan.begins(whole.space, steadily=True) - own  # the noisy first sample may be no possible state
    return np.asarray(np.clip(found, whole.low, whole.high))
