"""Global search for the least sum of squares: many starts on few samples, then the best of them on all samples.

Constants without a stated reason were chosen by trial on synthetic and published records: they balance computing time
against the chance that the best minimum is missed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.comparison import Comparison, DataComparison
from steadyslip.experiments.fitting.condensed import Condensed, condensed_along
from steadyslip.experiments.fitting.effort import Effort, work_of_search
from steadyslip.experiments.fitting.growing import grown, several_changes, stress_alone
from steadyslip.experiments.fitting.nested import NestedModel, nested_models
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.starts import features_of, of_other_sign, search_bounds, starting_points
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.experiments.measured.record import transient_rows
from steadyslip.experiments.numerics.least_squares import DAMPING_NEAR, HOPE, SAME_SSQ, Minima, minimise
from steadyslip.experiments.numerics.noise import SIGNIFICANT, STRUCTURE, lag_one, largest_jump, whiteness

ROUGH_SAMPLES = 400  # number of samples of all records together in the first stage
ROUGH_PATIENCE = 8
"""Largest number of integration steps per sample in the first stage; later stages allow `effort.MAX_STEPS_PER_ROW`."""
ROUGH_GROWTH = 2.0  # first stage: a motion is given up after this multiple of the slowest completed motion's steps
ROUGH_ITERATIONS = 40  # most iterations in the first stage, whose tolerance is so large that most starts end earlier
MAX_ITERATIONS = 300  # most iterations on all samples, or on condensed samples
FINAL_ITERATIONS = 12  # most iterations on all samples after condensed samples, which lead nearly to the minimum
FIRST_STARTS = 8  # number of starts in the first round: eight SIMD lanes run them in about the time of one start
MIN_ARRIVED = 3  # starts that must reach the best minimum before the search may stop; a single one may be chance
FINALISTS = 8  # number of end points of the first stage that are refined: one per SIMD lane
NESTED_STARTS = 8  # number of starts that test whether a nested model can compete: one per SIMD lane
MAX_POLISHED = 3  # largest number of end points on condensed samples that are refined on all samples
ROUGH_SHARE, REFINE_SHARE = 0.5, 0.8  # the first and the second stage end when this share of a search's work is spent
NESTED_SHARE = 0.2  # work allowed for each nested model in addition to its own search, as a share of one search's work
REORDER_TOLERANCE = 1e-9  # relative change of the sum of squares by rounding when states are renumbered
MIN_GAIN = 1e-8  # a smaller relative gain on condensed samples is not worth iterations on all samples
MIN_CONDENSED_SIZE = 50_000  # samples are condensed if the finalists have at least this many derivatives, to save time
WINDOW_SHARES = (0.25, 0.5, 0.75)  # a time that reached an end of its window starts again at these shares of it

Progress = Callable[[str, int, float], None]
"""Progress callback: name of the stage, number of starts tried, root mean square of the best residuals."""


@dataclass(frozen=True)
class SearchSummary:
    """Record of a search: how many starts agree, and whether it converged.

    Attributes
    ----------
    starts : int
        Number of starting points.
    arrived : int
        Number of starts that ended at the best minimum.
    others : tuple of float
        Sums of squares of other minima, as multiples of the best.
    iterations : int
        Iterations of the last stage.
    converged : bool
        True if further iterations would reduce the sum of squares by less than a share of 1e-7.
    cut : bool
        True if the search ended because its budget of work was spent.
    """

    starts: int
    arrived: int
    others: tuple[float, ...]
    iterations: int
    converged: bool
    cut: bool = False

    @property
    def is_chance(self) -> bool:
        """True if so few starts lead to the best minimum that it may have been found by chance."""
        return self.arrived < min(MIN_ARRIVED, self.starts)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search: the best minimum, its sum of squares and how it was reached.

    Attributes
    ----------
    coordinates : ndarray (p,)
        Coordinates of the best minimum.
    ssq : float
        Sum of squares at the best minimum.
    comparison : Comparison
        Model and records whose sum of squares was minimised.
    summary : SearchSummary
    bounds : (ndarray, ndarray)
        Lower and upper bounds of the coordinates, each (p,).
    ends : ndarray (m, p)
        Points at which other starts ended, the best first; there may be minima near them that fit as well.
    """

    coordinates: Array
    ssq: float
    comparison: Comparison
    summary: SearchSummary
    bounds: tuple[Array, Array]
    ends: Array


SearchCache = dict[tuple[tuple[str, ...], int, bool, str], SearchResult | None]
"""Results of searches for nested models, by free parameters, order of the trend, offset and option `initial`."""


def _search_or_none(
    plan: Plan, starts: int, effort: Effort, progress: Progress | None, known: SearchCache
) -> SearchResult | None:
    """Result of the search for a nested model; None if it cannot follow the records."""
    try:
        return find_minimum(plan, starts, effort, progress, known)
    except NotAvailable:
        return None


def find_minimum(
    plan: Plan, starts: int, effort: Effort, progress: Progress | None, known: SearchCache | None = None
) -> SearchResult:
    """Search for the least sum of squares of a plan.

    The first round tries `FIRST_STARTS` starts. If the normal stress and the rate change, the second round fits a
    growing part of the record (`growing`). More rounds follow until several starts agree and the residuals are white
    noise, or until four times `starts` have been tried. If the model contains simpler (nested) models, their minima are
    further starts. When the budget of the search is spent, the best minimum so far is returned. A nested model has the
    budget of a separate fit, so that its search ends at the same minimum as a separate fit.

    Raises
    ------
    NotAvailable
        If the model cannot follow the records from any start.
    """
    search = _Search(plan, starts, effort, progress)
    third = -(-starts // 3)
    counts = [*dict.fromkeys((min(FIRST_STARTS, third), third, starts, 2 * starts, 3 * starts, 4 * starts))]
    rounds: list[tuple[int, Callable[[], None]]] = [(upto, partial(search.try_starts, upto)) for upto in counts]
    if several_changes(plan):
        rounds.insert(1, (counts[0], search.try_grown_starts))
    for upto, try_more in rounds:
        try_more()
        last = search.allowance.was_met
        if not search.any_followed:
            if last:
                break
            continue
        search.refine_finalists()
        if search.arrived < MIN_ARRIVED and upto >= starts:
            search.rough_model = search.rough_plan.comparison(effort)  # this model no longer gives motions up early
        if not last and (search.arrived < MIN_ARRIVED or (upto < starts and search.arrived < upto / 3)):
            continue
        found = search.refine_best()
        if last or upto >= starts or not _leaves_structure(search.whole, found.coordinates[0]):
            break
    else:
        found = search.refine_best() if search.any_followed else Minima.none(len(search.whole.space))
    if not search.any_followed:
        raise NotAvailable(f"the model cannot follow these records from any start; {_suspects(plan)}")
    found = first_computable(search.whole, found)
    found = first_computable(search.whole, search.nested(found, {} if known is None else known))
    if not np.isfinite(found.ssq[0]):
        raise NotAvailable(f"the model cannot follow these records; {_suspects(plan)}")
    if stress_alone(plan):
        found = first_computable(search.whole, search.with_other_sign(found))
    best, ssq = with_states_sorted(search.whole, found)
    return SearchResult(best, ssq, search.whole, search.summary(found), (search.low, search.high), search.ends(found))


def _suspects(plan: Plan) -> str:
    """Question to the user about the probable cause if a model cannot follow the records."""
    if plan.protocol is None:
        return "are law and drive those of the experiment?"
    return "are the law and the protocol (its rates, units, and times on the records' clock) those of the experiment?"


class _Search:
    """State of a search between its stages.

    Parameters
    ----------
    plan : Plan
    starts : int
        Number of starts that the user asked for, which also holds for the search of nested models.
    effort : Effort
        Limits of the computation, with the budget of the whole fit.
    progress : callable or None

    Attributes
    ----------
    rough : Minima
        End points of all starts on few samples, including starts with a growing part of the record.
    grown : int
        Number of starts with a growing part of the record.
    best : Minima
        End points of the finalists on condensed samples, or on all samples if samples are not condensed.
    finalists : ndarray (m, p)
        Finalists whose motion reaches the last sample.
    arrived : int
        Number of starts that lead to the best minimum.
    stages : list of Allowance
        Work allowed for the starts, the finalists, the end on all samples, and each nested model.
    allowance : Allowance
        The allowance of the current stage.
    """

    def __init__(self, plan: Plan, starts: int, effort: Effort, progress: Progress | None) -> None:
        self.plan, self.starts, self.effort, self.progress = plan, starts, effort, progress
        self.whole = plan.comparison(effort)
        self.rough_plan = replace(_rough_plan(plan), rtol=1e-5)
        self.rough_model = self.rough_plan.comparison(replace(effort, patience=ROUGH_PATIENCE, growth=ROUGH_GROWTH))
        self.features = features_of(self.whole.parts)
        self.low, self.high = search_bounds(self.whole.parts, self.features, self.whole.space)
        self.rough = self.best = Minima.none(len(self.whole.space))
        self.grown = 0
        self.condensed: Comparison | Condensed = self.whole
        self.finalists = self.best.coordinates
        self.arrived = 0
        self.work = work_of_search(self.whole.size, len(self.whole.space)) * effort.budget.scale
        self.stages = [effort.budget.part(share * self.work) for share in (ROUGH_SHARE, REFINE_SHARE, 1.0)]
        self.allowance = self.stages[0]

    @property
    def any_followed(self) -> bool:
        """True if the model could follow the records from at least one start."""
        return bool(np.any(np.isfinite(self.rough.ssq)))

    @property
    def cut(self) -> bool:
        """True if a stage ended at its limit of work."""
        return any(stage.was_met for stage in self.stages)

    def reporter(self, what: str, among: Comparison) -> Callable[[Minima], None]:
        def report(ends: Minima) -> None:
            if self.progress is not None:
                tried, least = len(self.rough.ssq), float(np.min(ends.ssq, initial=np.inf))
                self.progress(what, tried, float(np.sqrt(least / among.size)))

        return report

    def try_starts(self, upto: int) -> None:
        """Minimise on few samples from further starting points, until `upto` points have been tried in all."""
        already = len(self.rough.ssq) - self.grown
        begin = starting_points(self.whole.parts, self.features, self.whole.space, upto - already, already)
        model = self.rough_model
        ends = minimise(lambda z, _: model.residuals(z), begin, self.low, self.high, **self._of_starts())
        self.rough = self.rough + ends

    def try_grown_starts(self) -> None:
        """Minimise on few samples from the first starting points, fitting a growing part of the records."""
        begin = starting_points(self.whole.parts, self.features, self.whole.space, FIRST_STARTS, 0)
        effort = replace(self.effort, patience=ROUGH_PATIENCE, growth=ROUGH_GROWTH)
        ends = grown(self.rough_plan, begin, self.low, self.high, effort, self._of_starts())
        self.grown = len(ends.ssq)
        self.rough = self.rough + ends

    def _of_starts(self) -> dict[str, Any]:
        """Options of `minimise` for starts on few samples; makes the allowance of this stage the current one."""
        self.allowance = self.stages[0]
        return {
            "most": ROUGH_ITERATIONS, "tolerance": 1e-4, "race": MIN_ARRIVED, "stop": self.allowance,
            "callback": self.reporter("searching", self.rough_model),
        }  # fmt: skip

    def refine_finalists(self) -> None:
        """Refine the finalists on condensed samples (if there are none, on all) and count the starts that agree."""
        self.allowance = self.stages[1]
        begin, counts = self.rough.distinct(FINALISTS)
        if len(self.best.ssq):  # the best point of earlier rounds is a finalist as well
            begin = np.concatenate([begin, self.best.sorted().coordinates[:1]])
            counts = np.append(counts, 0)
        begin, counts, predicted, slopes = self._computable(begin, counts)
        self.finalists = begin
        self.condensed = self.whole
        if slopes.size > MIN_CONDENSED_SIZE:
            self.condensed = condensed_along(self.plan, self.whole, predicted, slopes)
        if self.condensed is self.whole:
            self.best = Minima.at(begin)
            self.arrived = int(np.sum(self.rough.ssq <= np.min(self.rough.ssq) * (1 + SAME_SSQ)))
            return
        self.best = minimise(
            lambda z, _: self.condensed.residuals(z), begin, self.low, self.high, most=MAX_ITERATIONS, race=MIN_ARRIVED,
            callback=self.reporter("refining", self.whole), stop=self.allowance, damping=DAMPING_NEAR,
        )  # fmt: skip
        self.arrived = int(np.sum(counts[self.best.ssq <= np.min(self.best.ssq) * (1 + SAME_SSQ)]))

    def _computable(self, begin: Array, counts: Array) -> tuple[Array, Array, Array, Array]:
        """Finalists whose motion reaches the last sample, with counts, model friction (m, n) and derivatives (m, p, n).

        A motion that is completed on few samples, with larger tolerances, may run away on all samples. If the motions
        of all finalists do so, the next best end points of the first stage are tried.
        """
        waiting, first = [(begin, counts)], 0
        while waiting:
            points, own = waiting.pop()
            predicted, slopes = self.whole.model(points)
            usable = np.all(np.isfinite(predicted), axis=1) & np.all(np.isfinite(slopes), axis=(1, 2))
            if np.any(usable):
                return points[usable], own[usable], predicted[usable], slopes[usable]
            first += len(points)
            every, numbers = self.rough.distinct(len(self.rough.ssq), hope=np.inf)
            if len(every) > first and not self.allowance():
                waiting = [(every[first : first + FINALISTS], numbers[first : first + FINALISTS])]
        return begin, counts, np.empty((0, self.whole.size)), np.empty((0, begin.shape[1], self.whole.size))

    def refine_best(self) -> Minima:
        """Minima on all samples from the best finalists, sorted by sum of squares."""
        self.allowance = self.stages[2]
        begin = self.best.coordinates if self.condensed is self.whole else self.best.distinct(MAX_POLISHED)[0]
        found = self._minimise_on_all(begin)
        if not len(begin) or not np.isfinite(found.ssq[0]):  # the condensed samples were misleading
            found = self._minimise_on_all(self.finalists)
        inside = _moved_inside(self.whole.space, found.coordinates[0], self.low, self.high)
        return (found + self._refine_from(inside)).sorted() if len(inside) else found

    def nested(self, found: Minima, known: SearchCache) -> Minima:
        """Minima `found` and those reached from the minima of nested models, sorted by sum of squares."""
        for model in nested_models(self.plan):
            if not self.cut and not self._can_compete(model):
                continue
            key = model.plan.free, model.plan.trend, model.plan.offset, model.plan.initial
            if key not in known:
                known[key] = _search_or_none(model.plan, self.starts, self.effort, self.progress, known)
            if (other := known[key]) is None:
                continue
            self.allowance = self.effort.budget.part(NESTED_SHARE * self.work)
            self.stages.append(self.allowance)
            begin = model.points_in(self.whole.space, other.coordinates, self.low, self.high)
            better = other.ssq < found.ssq[0] * (1 - MIN_GAIN)
            found = (found + (self._minimise_on_all(begin) if better else self._refine_from(begin))).sorted()
        return found

    def with_other_sign(self, found: Minima) -> Minima:
        """Minima `found` and the minimum reached from a start at which a - b has the other sign, the best first.

        If only the normal stress changes, a law that strengthens and a law that weakens with velocity fit nearly
        equally well, with different memories of normal stress, and all starts may lead to only one of the two.
        """
        begin = of_other_sign(self.whole.space, found.coordinates[:1])
        return (found + self._refine_from(np.clip(begin, self.low, self.high))).sorted() if len(begin) else found

    def ends(self, found: Minima) -> Array:
        """Coordinates (m, p) of other end points: those on all samples, then those of the first stage; best first."""
        others = [own.distinct(FINALISTS)[0] for own in (found, self.rough)]
        return sort_states(np.concatenate(others)[1 : FINALISTS + 1], self.whole.space)

    def _can_compete(self, model: NestedModel) -> bool:
        """True if a nested model, on few samples and from few starts, comes near the best sum of squares."""
        held, at = model.missing(self.whole.space)
        begin = np.where(held, at, self.rough.sorted().coordinates[:NESTED_STARTS])
        for i, one in enumerate(self.whole.space.unknowns):
            if one.parameter in model.scales:
                begin[:, i] = self.rough.sorted().coordinates[: len(begin), i]
        ends = minimise(
            lambda z, _: self.rough_model.residuals(z), begin, self.low, self.high, most=ROUGH_ITERATIONS,
            held=np.tile(held, (len(begin), 1)), tolerance=1e-4, race=3,
            callback=self.reporter("refining", self.rough_model),
            stop=self.effort.budget.part(NESTED_SHARE * self.work),
        )  # fmt: skip
        return bool(np.min(ends.ssq, initial=np.inf) <= HOPE * np.min(self.rough.ssq))

    def _refine_from(self, begin: Array) -> Minima:
        """Minima on all samples, searched on condensed samples first; empty if these do not improve on the best."""
        if self.condensed is not self.whole:
            known = float(np.min(self.best.ssq))
            ends = minimise(
                lambda z, _: self.condensed.residuals(z), begin, self.low, self.high, most=MAX_ITERATIONS, race=1,
                known=known, callback=self.reporter("refining", self.whole), stop=self.allowance,
            )  # fmt: skip
            begin = ends.distinct(MAX_POLISHED)[0] if np.any(ends.ssq < known * (1 - MIN_GAIN)) else begin[:0]
        return self._minimise_on_all(begin)

    def _minimise_on_all(self, begin: Array) -> Minima:
        """Minima on all samples; after condensed samples, few iterations are tried first, then more if needed."""

        def ends(start: Array, most: int, held: Array | None = None) -> Minima:
            report = self.reporter("refining", self.whole)
            return minimise(
                lambda z, _: self.whole.residuals(z), start, self.low, self.high, most=most, race=1, callback=report,
                stop=self.allowance, damping=DAMPING_NEAR, held=held,
            ).sorted()  # fmt: skip

        found = ends(begin, MAX_ITERATIONS if self.condensed is self.whole else FINAL_ITERATIONS)
        if len(begin) and np.isfinite(found.ssq[0]) and not found.converged[0] and self.condensed is not self.whole:
            found = (ends(found.coordinates[:1], MAX_ITERATIONS) + found).sorted()
        times = times_of_changes(self.whole.space)
        if len(begin) and np.isfinite(found.ssq[0]) and not found.converged[0] and np.any(times):
            beside = ends(found.coordinates[:1], MAX_ITERATIONS, times[None])  # a time at a kink stops the whole search
            beside.converged[:] = False
            found = (ends(beside.coordinates, FINAL_ITERATIONS) + beside + found).sorted()
        return found

    def summary(self, found: Minima) -> SearchSummary:
        """Summary of the search that ended with the minima `found`, of which the best is first."""
        others = [found.ssq / found.ssq[0]]
        for ends in (self.rough, self.best):
            done = ends.ssq[ends.converged]
            others.append(done / np.min(ends.ssq) if len(done) else done)
        ratios = {float(f"{x:.3g}") for x in np.concatenate(others) if np.isfinite(x) and x > 1 + SAME_SSQ}
        last = int(found.iterations[0])
        ended = bool(found.converged[0])
        return SearchSummary(len(self.rough.ssq), self.arrived, tuple(sorted(ratios)), last, ended, self.cut)


def _moved_inside(space: Space, coordinates: Array, low: Array, high: Array) -> Array:
    """Copies (0 or more, p) of a point in which times at a bound of their window are moved inside the window.

    Within a sampling interval the misfit may have several minima, and one inside the window may be better than that at
    its end.
    """
    ended = times_of_changes(space) & ((coordinates <= low) | (coordinates >= high))
    if not np.any(ended):
        return np.empty((0, len(coordinates)))
    share = np.array(WINDOW_SHARES)[:, None]
    return np.where(ended, low + share * np.where(ended, high - low, 0.0), coordinates)


def times_of_changes(space: Space) -> Array:
    """Mask (p,) of the unknowns that are the time or the duration of a change of the loading."""
    return np.array([one.parameter.startswith(("step.", "jump.")) for one in space.unknowns])


def _leaves_structure(whole: Comparison, coordinates: Array) -> bool:
    """True if residuals have structure that noise with decaying correlation lacks: a better minimum may exist."""
    r = whole.residuals(coordinates[None])[0][0]
    parts = [r[where] for where in whole.slices]
    if jump_left(whole, r):
        return True
    if all(abs(lag_one(own)) <= SIGNIFICANT / np.sqrt(len(own)) for own in parts):
        return False
    return whiteness(parts).p < STRUCTURE


def jump_left(comparison: DataComparison, residuals: Array) -> float:
    """Largest jump of weighted residuals (n,) in standard deviations of their noise; 0 if no record has a jump."""
    data = comparison.data * comparison.weights
    return max(largest_jump(residuals[where], data[where]) for where in comparison.slices)


def first_computable(comparison: Comparison, found: Minima) -> Minima:
    """Minima sorted by sum of squares, where the first has finite residuals and derivatives when computed alone.

    The steps of a motion that accelerates strongly depend on rounding, which differs with the lane of the SIMD vector;
    such a motion may be completed together with others but fail alone. Its sum of squares is then set to inf.
    """
    while np.isfinite(found.ssq[0]):
        residuals, slopes = comparison.residuals(found.coordinates[:1])
        if np.all(np.isfinite(residuals)) and np.all(np.isfinite(slopes)):
            break
        found = Minima(found.coordinates, np.append(np.inf, found.ssq[1:]), found.converged, found.iterations).sorted()
    return found


def minima_near(comparison: Comparison, begin: Array, bounds: tuple[Array, Array], effort: Effort) -> Minima:
    """Minima on all samples from starting points (m, p); the first is the best that can be computed alone."""
    ends = minimise(
        lambda z, _: comparison.residuals(z), begin, *bounds, most=MAX_ITERATIONS, stop=effort.budget.part(np.inf)
    )
    return first_computable(comparison, ends.sorted())


def with_states_sorted(comparison: Comparison, found: Minima) -> tuple[Array, float]:
    """Coordinates and sum of squares of the first minimum, with its states numbered by rising slip distance.

    The states keep their order if renumbering changes the sum of squares, as happens by rounding in unstable motions.
    """
    best, ssq = found.coordinates[0], float(found.ssq[0])
    rising = sort_states(found.coordinates[:1], comparison.space)
    if np.any(rising[0] != best):
        residuals, slopes = comparison.residuals(rising)
        again = float(residuals[0] @ residuals[0])
        if np.all(np.isfinite(slopes)) and again <= ssq * (1 + REORDER_TOLERANCE):
            return rising[0], min(again, ssq)
    return best, ssq


def sort_states(coordinates: Array, space: Space) -> Array:
    """Coordinates (m, p) with the states of each law numbered by rising slip distance, to compare minima."""
    members: dict[tuple[int | None, str], dict[str, dict[str, int]]] = {}
    for i, one in enumerate(space.unknowns):
        owner, _, last = one.parameter.rpartition(".")
        family, _, number = owner.rpartition(".")
        if number.isdigit():
            members.setdefault((one.record, family), {}).setdefault(number, {})[one.kind or last] = i
    found = coordinates.copy()
    for family_members in members.values():
        states = list(family_members.values())
        if len(states) < 2 or any(set(s) != set(states[0]) or "slip distance" not in s for s in states):
            continue
        ranks = np.argsort(coordinates[:, [s["slip distance"] for s in states]], axis=1)
        for what in states[0]:
            columns = [s[what] for s in states]
            found[:, columns] = np.take_along_axis(coordinates[:, columns], ranks, axis=1)
    return found


def _rough_plan(plan: Plan) -> Plan:
    """Plan with about `ROUGH_SAMPLES` samples in all records together, dense after changes of the loading."""
    count = max(ROUGH_SAMPLES // len(plan.records), 100)
    rows = []
    for record, sharp in zip(plan.records, plan.sharp, strict=True):
        few = transient_rows(record, count) if len(record) > count else np.arange(len(record))
        rows.append(np.union1d(few, sharp.rows(record.time)))
    thin = tuple(r.taken(k, "thinned") for r, k in zip(plan.records, rows, strict=True))
    weights = None if plan.weights is None else tuple(w[k] for w, k in zip(plan.weights, rows, strict=True))
    return replace(plan, records=thin, weights=weights)
