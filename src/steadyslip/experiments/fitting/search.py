"""The search for the best minimum: from many starts on few samples, then on all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.condensed import Condensed, condensed_along
from steadyslip.experiments.fitting.effort import Effort, work_of_search
from steadyslip.experiments.fitting.nested import Simpler, simpler
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.starts import features_of, search_bounds, starting_points
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.experiments.measured.record import transient_rows
from steadyslip.experiments.numerics.least_squares import CLOSE, HOPE, SAME, Minima, minimise
from steadyslip.experiments.numerics.noise import DETECTED, lag_one

THIN = 400  # samples on which many starts are tried
HASTY = 8  # steps of the model per sample, on average, before a trial on few of them is given up
SLOWER = 2.0  # times the steps of the slowest motion so far: beyond, one of a trial is given up
ROUGH = 40  # iterations on few samples
MOST = 300  # iterations on all samples, or on what stands for them;
LAST = 12  # on all samples after that
FIRST = 8  # starts, which fill the lanes of one vector
ENOUGH = 3  # starts that lead to the best minimum, and a third of the first few: else more starts are tried
FINALISTS = 8  # of them that go on with all samples: one vector of lanes
FEW = 8  # starts of a simpler model, to see whether it comes near
NEAREST = 3  # of the ends on few numbers that go on with all samples
STARTING, REFINING = 0.5, 0.8  # of the work of a search: what may be done by the ends of its first two stages
BESIDES = 0.2  # of it: what may be done with each simpler model, besides its own search
SAME_IN_ORDER = 1e-9  # of the sum of squares: what the order of states may change of it
SURPASSED = 1e-8  # of the sum of squares: by so much less on few numbers, an end is worth a look on all samples
SMALL = 50_000  # derivatives at all samples, of all the promising: so few that nothing is won by fewer
INSIDE = (0.25, 0.5, 0.75)  # of its window: where a time that ran to an end of it begins anew

Told = Callable[[str, int, float], None]
"""What a search tells: what it is doing, starts that it has tried, root mean square of the residuals reached."""


@dataclass(frozen=True)
class SearchStory:
    """How the minimum was found.

    Attributes
    ----------
    starts : int
        Points that the search started from.
    arrived : int
        How many of them ended at the best minimum.
    others : tuple of float
        Sums of squares of other minima, as multiples of the best.
    iterations : int
        Of the last stage.
    converged : bool
        Whether the sum of squares is within 1e-7 of where it ends.
    cut : bool
        Whether the search ended because the work that it may be was done.
    """

    starts: int
    arrived: int
    others: tuple[float, ...]
    iterations: int
    converged: bool
    cut: bool = False


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes
    ----------
    coordinates : ndarray (p,)
        Of the best minimum.
    ssq : float
    comparison : Comparison
        In which it is one.
    story : SearchStory
    bounds : (ndarray, ndarray)
        Of the search.
    """

    coordinates: Array
    ssq: float
    comparison: Comparison
    story: SearchStory
    bounds: tuple[Array, Array]


Known = dict[tuple[tuple[str, ...], int, bool, str], Found | None]
"""Fits of simpler models that are there already, by what is free."""


def _tried(plan: Plan, starts: int, effort: Effort, progress: Told | None, known: Known) -> Found | None:
    """The best minimum of a simpler model, if it has any."""
    try:
        return searched(plan, starts, effort, progress, known)
    except NotAvailable:
        return None


def searched(plan: Plan, starts: int, effort: Effort, progress: Told | None, known: Known | None = None) -> Found:
    """The best minimum, and how it was found.

    A few of the starts are tried first, then a third. The others follow unless these agree and leave nothing but white
    noise, and then more, as long as hardly any lead to the best minimum. Where the model contains simpler ones, it
    also starts from where these end. When the work that its own search may be is done, it goes on with the best that
    it has; what a simpler model may be is what it may be alone, so that it ends at the same place.

    Raises
    ------
    NotAvailable
        If the model cannot follow the records from any start.
    """
    search = _Search(plan, starts, effort, progress)
    third = -(-starts // 3)
    for upto in dict.fromkeys((min(FIRST, third), third, starts, 2 * starts, 3 * starts, 4 * starts)):
        search.try_starts(upto)
        last = search.enough.was_met
        if not search.any_followed:
            if last:
                break
            continue
        search.promising()
        if search.arrived < ENOUGH and upto >= starts:
            search.quick = search.thin.comparison(effort)  # with all the patience there is
        if not last and (search.arrived < ENOUGH or (upto < starts and search.arrived < upto / 3)):
            continue
        found = search.polished()
        if last or upto >= starts or not _leaves_structure(search.whole, found.coordinates[0]):
            break
    else:
        found = search.polished() if search.any_followed else Minima.none(len(search.whole.space))
    if not search.any_followed:
        raise NotAvailable(
            "the model cannot follow these records from any start; are law and drive those of the experiment?"
        )
    found = standing(search.whole, found)
    found = standing(search.whole, search.nested(found, {} if known is None else known))
    if not np.isfinite(found.ssq[0]):
        raise NotAvailable("the model cannot follow these records; is the rig's law and drive that of the experiment?")
    best, ssq = in_order(search.whole, found)
    return Found(best, ssq, search.whole, search.story(found), (search.low, search.high))


class _Search:
    """A search under way.

    Parameters
    ----------
    plan : Plan
    starts : int
        As the user has them, for simpler models.
    effort : Effort
        Its budget that of the fit.
    progress : callable or None

    Attributes
    ----------
    rough : Minima
        Where starts ended on few samples.
    best : Minima
        Where the most promising of those end on what stands for all samples.
    followed : ndarray (m, p)
        The finalists, whose motion goes through all samples.
    arrived : int
        How many starts lead to the best minimum.
    stages : list of Allowance
        Of work: for starts, for the promising, for the end on all samples, then for each simpler model.
    enough : Allowance
        That of the stage that it is in.
    """

    def __init__(self, plan: Plan, starts: int, effort: Effort, progress: Told | None) -> None:
        self.plan, self.starts, self.effort, self.progress = plan, starts, effort, progress
        self.whole = plan.comparison(effort)
        self.thin = replace(_thinned(plan), rtol=1e-5)
        self.quick = self.thin.comparison(replace(effort, patience=HASTY, growth=SLOWER))
        self.told_by_records = features_of(self.whole.parts)
        self.low, self.high = search_bounds(self.whole.parts, self.told_by_records, self.whole.space)
        self.rough = self.best = Minima.none(len(self.whole.space))
        self.few: Comparison | Condensed = self.whole
        self.followed = self.best.coordinates
        self.arrived = 0
        self.work = work_of_search(self.whole.size, len(self.whole.space)) * effort.budget.scale
        self.stages = [effort.budget.part(share * self.work) for share in (STARTING, REFINING, 1.0)]
        self.enough = self.stages[0]

    @property
    def any_followed(self) -> bool:
        """Whether the model could follow the records from any start."""
        return bool(np.any(np.isfinite(self.rough.ssq)))

    @property
    def cut(self) -> bool:
        """Whether something was left undone because the work for it was done."""
        return any(stage.was_met for stage in self.stages)

    def told(self, what: str, among: Comparison) -> Callable[[Minima], None]:
        def tell(ends: Minima) -> None:
            if self.progress is not None:
                tried, least = len(self.rough.ssq), float(np.min(ends.ssq, initial=np.inf))
                self.progress(what, tried, float(np.sqrt(least / among.size)))

        return tell

    def try_starts(self, upto: int) -> None:
        """Starts up to a number of them, on few samples."""
        already = len(self.rough.ssq)
        begin = starting_points(self.whole.parts, self.told_by_records, self.whole.space, upto - already, already)
        self.enough = self.stages[0]
        self.rough = self.rough + minimise(
            lambda z, _: self.quick.residuals(z), begin, self.low, self.high, most=ROUGH, tolerance=1e-4,
            race=ENOUGH, told=self.told("searching", self.quick), enough=self.enough,
        )  # fmt: skip

    def promising(self) -> None:
        """The most promising ends: on what stands for all samples, where anything does, and how many starts agree."""
        self.enough = self.stages[1]
        begin, counts = self.rough.distinct(FINALISTS)
        if len(self.best.ssq):  # where earlier starts have led
            begin = np.concatenate([begin, self.best.sorted().coordinates[:1]])
            counts = np.append(counts, 0)
        begin, counts, seen, slopes = self._followed(begin, counts)
        self.followed = begin
        self.few = self.whole
        if slopes.size > SMALL:
            self.few = condensed_along(self.plan, self.whole, seen, slopes)
        if self.few is self.whole:
            self.best = Minima.at(begin)
            self.arrived = int(np.sum(self.rough.ssq <= np.min(self.rough.ssq) * (1 + SAME)))
            return
        self.best = minimise(
            lambda z, _: self.few.residuals(z), begin, self.low, self.high, most=MOST, race=ENOUGH,
            told=self.told("refining", self.whole), enough=self.enough, damping=CLOSE,
        )  # fmt: skip
        self.arrived = int(np.sum(counts[self.best.ssq <= np.min(self.best.ssq) * (1 + SAME)]))

    def _followed(self, begin: Array, counts: Array) -> tuple[Array, Array, Array, Array]:
        """Those of the finalists whose motion goes through all samples, and what the model says there.

        On few samples, with looser tolerances, a motion may pass that runs away on all. If all of them do, the next.
        """
        waiting, first = [(begin, counts)], 0
        while waiting:
            points, own = waiting.pop()
            seen, slopes = self.whole.model(points)
            good = np.all(np.isfinite(seen), axis=1) & np.all(np.isfinite(slopes), axis=(1, 2))
            if np.any(good):
                return points[good], own[good], seen[good], slopes[good]
            first += len(points)
            every, numbers = self.rough.distinct(len(self.rough.ssq), hope=np.inf)
            if len(every) > first and not self.enough():
                waiting = [(every[first : first + FINALISTS], numbers[first : first + FINALISTS])]
        return begin, counts, np.empty((0, self.whole.size)), np.empty((0, begin.shape[1], self.whole.size))

    def polished(self) -> Minima:
        """The best of the promising brought to their end on all samples, the best first."""
        self.enough = self.stages[2]
        begin = self.best.coordinates if self.few is self.whole else self.best.distinct(NEAREST)[0]
        found = self._on_all(begin)
        if not len(begin) or not np.isfinite(found.ssq[0]):  # few numbers have led astray
            found = self._on_all(self.followed)
        inside = _released(self.whole.space, found.coordinates[0], self.low, self.high)
        return (found + self._refined(inside)).sorted() if len(inside) else found

    def nested(self, found: Minima, known: Known) -> Minima:
        """The same, or better ones where simpler models inside this one lead."""
        for model in simpler(self.plan):
            if not self.cut and not self._near(model):
                continue
            key = model.plan.free, model.plan.trend, model.plan.offset, model.plan.initial
            if key not in known:
                known[key] = _tried(model.plan, self.starts, self.effort, self.progress, known)
            if (other := known[key]) is None:
                continue
            self.enough = self.effort.budget.part(BESIDES * self.work)
            self.stages.append(self.enough)
            begin = model.within(self.whole.space, other.coordinates, self.low, self.high)
            better = other.ssq < found.ssq[0] * (1 - SURPASSED)
            found = (found + (self._on_all(begin) if better else self._refined(begin))).sorted()
        return found

    def _near(self, model: Simpler) -> bool:
        """Whether a simpler model comes anywhere near, on few samples and from a few starts."""
        held, at = model.held(self.whole.space)
        begin = np.where(held, at, self.rough.sorted().coordinates[:FEW])
        for i, one in enumerate(self.whole.space.unknowns):
            if one.parameter in model.scales:
                begin[:, i] = self.rough.sorted().coordinates[: len(begin), i]
        ends = minimise(
            lambda z, _: self.quick.residuals(z), begin, self.low, self.high, most=ROUGH,
            held=np.tile(held, (len(begin), 1)), tolerance=1e-4, race=3, told=self.told("refining", self.quick),
            enough=self.effort.budget.part(BESIDES * self.work),
        )  # fmt: skip
        return bool(np.min(ends.ssq, initial=np.inf) <= HOPE * np.min(self.rough.ssq))

    def _refined(self, begin: Array) -> Minima:
        """Where starts end on all samples: on what stands for them to begin with."""
        if self.few is not self.whole:
            known = float(np.min(self.best.ssq))
            ends = minimise(
                lambda z, _: self.few.residuals(z), begin, self.low, self.high, most=MOST, race=1,
                known=known, told=self.told("refining", self.whole), enough=self.enough,
            )  # fmt: skip
            begin = ends.distinct(NEAREST)[0] if np.any(ends.ssq < known * (1 - SURPASSED)) else begin[:0]
        return self._on_all(begin)

    def _on_all(self, begin: Array) -> Minima:
        """Where starts end on all samples; from what few numbers lead to, a few steps, and more if those do not do."""

        def ends(start: Array, most: int) -> Minima:
            told = self.told("refining", self.whole)
            return minimise(
                lambda z, _: self.whole.residuals(z), start, self.low, self.high, most=most, race=1, told=told,
                enough=self.enough, damping=CLOSE,
            ).sorted()  # fmt: skip

        if self.few is self.whole:
            return ends(begin, MOST)
        found = ends(begin, LAST)
        if len(begin) and np.isfinite(found.ssq[0]) and not found.converged[0]:
            found = (ends(found.coordinates[:1], MOST) + found).sorted()
        return found

    def story(self, found: Minima) -> SearchStory:
        """How the minimum was found."""
        others = [found.ssq / found.ssq[0]]
        for ends in (self.rough, self.best):
            done = ends.ssq[ends.converged]
            others.append(done / np.min(ends.ssq) if len(done) else done)
        ratios = {float(f"{x:.3g}") for x in np.concatenate(others) if np.isfinite(x) and x > 1 + SAME}
        last = int(found.iterations[0])
        ended = bool(found.converged[0])
        return SearchStory(len(self.rough.ssq), self.arrived, tuple(sorted(ratios)), last, ended, self.cut)


def _released(space: Space, coordinates: Array, low: Array, high: Array) -> Array:
    """The same point with times that ran to the end of their windows put back inside, (0 or more, p).

    Within a sampling interval the misfit need not fall one way only: a time held at an end may hide a better minimum.
    """
    times = np.array([one.parameter.startswith(("step.", "jump.")) for one in space.unknowns])
    ended = times & ((coordinates <= low) | (coordinates >= high))
    if not np.any(ended):
        return np.empty((0, len(coordinates)))
    share = np.array(INSIDE)[:, None]
    return np.where(ended, low + share * np.where(ended, high - low, 0.0), coordinates)


def _leaves_structure(whole: Comparison, coordinates: Array) -> bool:
    """Whether residuals are correlated: by the machine, or because this is not the best minimum."""
    r = whole.residuals(coordinates[None])[0][0]
    return any(abs(lag_one(r[where])) > DETECTED / np.sqrt(len(r[where])) for where in whole.slices)


def standing(comparison: Comparison, found: Minima) -> Minima:
    """The same, the first a minimum that its motion comes through alone, with its derivatives, if there is such a one.

    A motion that quickens without end for a moment may come through it or not by a rounding of the row it is in.
    """
    while np.isfinite(found.ssq[0]):
        residuals, slopes = comparison.residuals(found.coordinates[:1])
        if np.all(np.isfinite(residuals)) and np.all(np.isfinite(slopes)):
            break
        found = Minima(found.coordinates, np.append(np.inf, found.ssq[1:]), found.converged, found.iterations).sorted()
    return found


def in_order(comparison: Comparison, found: Minima) -> tuple[Array, float]:
    """The first of some minima and its sum of squares, states by rising slip distance.

    Of a motion that amplifies whatever there is, rounding too, the order decides; then it stays.
    """
    best, ssq = found.coordinates[0], float(found.ssq[0])
    rising = ordered(found.coordinates[:1], comparison.space)
    if np.any(rising[0] != best):
        residuals, slopes = comparison.residuals(rising)
        again = float(residuals[0] @ residuals[0])
        if np.all(np.isfinite(slopes)) and again <= ssq * (1 + SAME_IN_ORDER):
            return rising[0], min(again, ssq)
    return best, ssq


def ordered(coordinates: Array, space: Space) -> Array:
    """States by rising slip distance, so that equal minima look equal."""
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


def _thinned(plan: Plan) -> Plan:
    """The same plan on few samples of every record."""
    count = max(THIN // len(plan.records), 100)
    rows = []
    for record, sharp in zip(plan.records, plan.sharp, strict=True):
        few = transient_rows(record, count) if len(record) > count else np.arange(len(record))
        rows.append(np.union1d(few, sharp.rows(record.time)))
    thin = tuple(r.taken(k, "thinned") for r, k in zip(plan.records, rows, strict=True))
    weights = None if plan.weights is None else tuple(w[k] for w, k in zip(plan.weights, rows, strict=True))
    return replace(plan, records=thin, weights=weights)
