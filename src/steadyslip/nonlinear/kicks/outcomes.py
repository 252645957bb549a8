"""Decide the outcome of motions under constant inputs, from criteria that are certain.

A motion returns if it enters a computed neighbourhood of steady sliding that no motion leaves (`neighbourhood`); it
oscillates if it is on a closed orbit that was found and attracts (`closed_orbits`); blow-up and loss of contact are
detected in the run, as is the end of continuous solutions (`fold`). Where steady sliding is unstable nothing returns to
it, and irregular motion that goes on for dozens of peaks without growing counts as oscillation too. Any other motion is
simulated further, and after the longest simulated time it is *undecided*, for a reason in `DOUBTS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.runner import STATUSES, TALLY
from steadyslip.motion.jobs import automatic_method
from steadyslip.motion.status import BLOWN_UP, LOST, ending_contact
from steadyslip.nonlinear.kicks.closed_orbits import attracted, on_long_cycle
from steadyslip.nonlinear.kicks.field import normal_stresses, slip_rates_at
from steadyslip.nonlinear.kicks.fold import at_fold
from steadyslip.nonlinear.kicks.shells import Shells
from steadyslip.nonlinear.kicks.spans import (
    BLOW_UP,
    CONTACT_LOST,
    EXHAUSTED,
    INTERRUPTED,
    LATE,
    NO_SOLUTION,
    OPEN,
    OSCILLATION,
    RETURNS,
    SPENT,
    STIFF,
    STUCK,
    UNSEEN,
    MotionBatch,
    SpanResults,
    advanced_runs,
)

MOST_STEPS = 2_000_000  # integration steps after which a motion is undecided; multiplied by `MotionBatch.effort`
EARLY, HALFWAY = (
    0.05,
    0.4,
)  # shares of the longest time after which cycles of several events are searched: unstable, stable sliding
AT_ONCE = 1e-12  # share of the first span, so short that the state after it is the initial one; see `_return_at_once`
ALIKE = 1e-2  # relative change of the time between slip events, from span to span, below which a cycle is searched for
PEAKS = 40  # more velocity peaks than this in the last span are required to call a motion an irregular oscillation
HIGHER = 0.01  # allowed relative excess of ln(velocity/drive) at these peaks over that at earlier peaks
LEFT = 30.0  # least duration of an irregular oscillation, in growth times of small motions about unstable sliding
CODE = {word: number for number, word in enumerate(STATUSES)}


def outcomes_of(
    runs: MotionBatch, threads: int | None = None, advanced: Callable[[int], None] | None = None,
    start: Array | None = None,
) -> Array:  # fmt: skip
    """Simulate motions, and return their outcomes (m,) as indices into `OUTCOMES`.

    The motions start at the states `start` (m, n) if these are given. `advanced` is called after each span with the
    number of motions that were decided in it.
    """
    return _Course(runs, threads, start).run(advanced)


def contacts_of(runs: MotionBatch, which: Array, threads: int | None = None) -> Array:
    """Names (m,) of the contacts that lose contact or blow up in each motion; empty for other outcomes.

    The motions are simulated again, to their end.
    """
    contacts = runs.rest.reduction.model.contacts
    found = np.full(len(runs.rest.velocity), "", dtype=object)
    for method in (runs.jobs.options.method, STIFF):
        if not len(which) or not contacts[0].name:
            break
        options = replace(runs.jobs.options, method=method)
        ended = advanced_runs(runs, which, None, runs.times()[1][which], False, threads, options)
        rest = runs.rest.part(which)
        rates = slip_rates_at(rest, ended.state, ended.unknowns).T
        stresses = normal_stresses(rest, ended.state, ended.unknowns).T
        for status in (LOST, BLOWN_UP):
            here = ended.status == CODE[status]
            own = ending_contact(rest.point, status, stresses, rates)
            found[which[here]] = [contacts[i].name for i in own[here]]
        which = which[ended.status == CODE["too many steps"]]
    return found.astype(str)


class _Course:
    """Motions that are simulated span by span until each has an outcome.

    Attributes
    ----------
    found : ndarray of int (m,)
        Outcomes; OPEN where not decided yet.
    elapsed, span, most : ndarray (m,)
        Time simulated so far, length of the next span, and longest simulated time, s.
    stiff : ndarray of bool (m,)
        True where the explicit method needed too many steps.
    between : ndarray (m,)
        Time between slip events, or peaks, at the end of the last span.
    peak : ndarray (m,)
        Highest velocity so far, m/s.
    """

    def __init__(self, runs: MotionBatch, threads: int | None, start: Array | None) -> None:
        self.runs, self.threads = runs, threads
        count = len(runs.rest.velocity)
        self.span, self.allowed = runs.times()
        self.most = self.allowed.copy()
        self.elapsed, self.steps, self.between = np.zeros(count), np.zeros(count), np.full(count, np.nan)
        self.peak = np.full(count, np.nan)
        self.found, self.stiff = np.full(count, OPEN), np.zeros(count, dtype=bool)
        self.state = np.full(runs.rest.state.shape, np.nan) if start is None else np.array(start)
        self.unknowns = np.full(runs.rest.unknowns.shape, np.nan)
        self.started, self.begun = start is not None, np.full(count, start is not None)
        self.shells = None if self.started else Shells(runs, threads, _fates)
        self.stiffly = replace(runs.jobs.options, method=STIFF)
        self.explicit = automatic_method(runs.rest.reduction) != STIFF

    def run(self, advanced: Callable[[int], None] | None) -> Array:
        """Simulate until every motion has an outcome; return the outcomes (m,) as indices into `OUTCOMES`."""
        if not self.started:
            self._return_at_once()
        open_ = np.flatnonzero(self.found == OPEN)
        while len(open_):
            before = self.begun[open_]
            ended = self._advanced(open_)
            if not ended.whole:
                self.found[self.found == OPEN] = INTERRUPTED
                break
            over = self._retried(open_, ended)
            if len(over):
                self._judge(open_[over], ended.part(over), before[over])
            self._give_up(open_)
            left = self.found[open_] == OPEN
            if advanced is not None:
                advanced(int(np.sum(~left)))
            open_ = open_[left]
            rest = np.maximum(self.most[open_] - self.elapsed[open_], 0.1 * self.span[open_])
            self.span[open_] = np.minimum(2 * self.span[open_], rest)
        return self.found

    def _return_at_once(self) -> None:
        """Record the outcome "returns" for motions whose initial state lies in the neighbourhood of steady sliding."""
        which = np.arange(len(self.found))
        begun = advanced_runs(self.runs, which, None, AT_ONCE * self.span, False, self.threads)
        near = which[begun.status == CODE["done"]]
        near = near[self.runs.rest.stable[near]]
        self.found[near[self.runs.near.holds(near, begun.state[near])]] = RETURNS

    def _advanced(self, open_: Array) -> SpanResults:
        """Simulate one span of the motions with indices `open_`.

        They are grouped by integration method, and by whether the span is their first.
        """
        fresh = ~self.begun[open_]
        found = SpanResults.empty(len(open_), self.state.shape[1], self.runs.rest.unknowns.shape[1])
        for stiff, anew in ((False, True), (False, False), (True, True), (True, False)):
            here = np.flatnonzero((self.stiff[open_] == stiff) & (fresh == anew))
            if not len(here) or not found.whole:
                continue
            which = open_[here]
            watch = bool(self.begun[which].any())
            found.put(here, advanced_runs(
                self.runs, which, None if anew else self.state[which], self.span[which], watch, self.threads,
                self.stiffly if stiff else None, self.unknowns[which],
            ))  # fmt: skip
        return found

    def _retried(self, open_: Array, ended: SpanResults) -> Array:
        """Mark motions whose span must be repeated, and return indices of the others into `open_` after updating them.

        A span is repeated by the implicit method if the explicit method took too many steps. If the implicit method
        took too many steps, the span ends where they were used up.
        """
        many = ended.status == CODE["too many steps"]
        again = many & ~self.stiff[open_] & self.explicit
        self.stiff[open_[again]] = True
        self.steps[open_] += np.where(again, 0.0, ended.steps)
        over = np.flatnonzero(~again)
        which = open_[over]
        short = many[over] & np.all(np.isfinite(ended.state[over]), axis=1)
        self.span[which[short]] = 0.5 * ended.time[over[short]]
        self.elapsed[which] += np.where(short, ended.time[over], self.span[which])
        self.state[which], self.unknowns[which], self.begun[which] = ended.state[over], ended.unknowns[over], True
        away = self.allowed[which] + self.runs.reload(which, self.state[which])
        self.most[which] = np.maximum(self.most[which], away)
        return over

    def _judge(self, which: Array, ended: SpanResults, watched: Array) -> None:
        """Record, for the motions with indices `which`, the outcomes that are certain at the end of a span."""
        runs, found, state = self.runs, self.found, self.state
        found[which] = _seen(runs, which, ended)
        running = np.flatnonzero(found[which] == OPEN)
        going = which[running]
        found[going[runs.near.holds(going, state[going], self.steps[going])]] = RETURNS
        neutral = runs.rest.neutral[going]
        found[going[neutral & (self.elapsed[going] >= self.most[going])]] = RETURNS
        if self.shells is not None:
            waiting = going[(found[going] == OPEN) & ~neutral & watched[running]]
            if len(waiting):
                found[waiting] = self.shells.outcomes(waiting, state[waiting])
        apart, peaks = (ended.tally[:, TALLY.index(name)] for name in ("recurrence", "peak_period"))
        apart = np.where(apart > 0, apart, peaks)  # small cycles have no slip events
        alike = _alike(apart, self.between[which])[running]
        tried = np.flatnonzero((found[going] == OPEN) & ~neutral & alike)
        again = np.zeros(len(going), dtype=bool)
        if len(tried):
            one = going[tried]
            closed, again[tried] = attracted(
                runs, one, state[one], self.unknowns[one], apart[running[tried]], self.threads
            )
            found[one[closed]] = OSCILLATION
        long = np.where(runs.rest.stable[going], HALFWAY, EARLY) * self.most[going]
        several = going[(found[going] == OPEN) & ~neutral & ~again & (self.elapsed[going] > long)]
        found[[one for one in several if on_long_cycle(runs, one, state[one], self.unknowns[one])]] = OSCILLATION
        left = running[np.isin(going, several) & (found[going] == OPEN)]
        found[which[left[self._goes_on(which[left], ended.tally[left])]]] = OSCILLATION
        self.peak[which] = np.fmax(self.peak[which], ended.tally[:, TALLY.index("peak_velocity")])
        self.between[which] = apart

    def _goes_on(self, which: Array, tally: Array) -> Array:
        """True (k,) for motions `which` that oscillate irregularly about unstable steady sliding without growing."""
        rest = self.runs.rest.part(which)
        count, peak = (tally[:, TALLY.index(name)] for name in ("velocity_peaks", "peak_velocity"))
        with np.errstate(invalid="ignore", divide="ignore"):
            slip = rest.slip_rate(self.runs.rest.contact)
            before, now = (np.log(np.abs(v / slip)) for v in (self.peak[which], peak))
            left = rest.leading.real * self.elapsed[which] > LEFT
            return np.asarray(left & (count > PEAKS) & (now <= before + HIGHER * np.abs(before)))

    def _give_up(self, open_: Array) -> None:
        """Record as undecided the motions that have used up their simulated time or their integration steps."""
        runs, open_ = self.runs, open_[self.found[open_] == OPEN]
        late = self.elapsed[open_] >= self.most[open_]
        unseen = runs.rest.stable[open_] & (runs.near.radius[open_] == 0)
        self.found[open_[late]] = np.where(unseen, UNSEEN, LATE)[late]
        self.found[open_[~late & (self.steps[open_] >= MOST_STEPS * runs.effort)]] = EXHAUSTED
        if runs.budget.steps <= 0:
            self.found[open_[self.found[open_] == OPEN]] = SPENT


def _fates(runs: MotionBatch, threads: int | None, start: Array) -> Array:
    """Outcomes, as indices into `OUTCOMES`, of motions from the states `start` (arguments as `Shells` calls it)."""
    return outcomes_of(runs, threads, start=start)


def _alike(now: Array, before: Array) -> Array:
    """True where the time between slip events `now` agrees within `ALIKE` with that of the span `before`."""
    with np.errstate(invalid="ignore"):
        return np.asarray((now > 0) & (np.abs(now - before) < ALIKE * now))


def _seen(runs: MotionBatch, which: Array, ended: SpanResults) -> Array:
    """Outcomes (k,) that follow from the integrator's status at the end of a span; OPEN where the run can go on."""
    status = ended.status
    found = np.full(len(status), NO_SOLUTION)
    found[status == CODE["done"]] = OPEN
    found[status == CODE["blow-up"]] = BLOW_UP
    found[status == CODE["contact lost"]] = CONTACT_LOST
    many = status == CODE["too many steps"]
    limited = np.flatnonzero((status == CODE["stuck"]) | many)
    if len(limited):  # the integrator has reached a limit, or there is no continuous solution
        folded = at_fold(runs.rest.part(which[limited]), ended.state[limited], ended.unknowns[limited])
        lost = ~np.all(np.isfinite(ended.state[limited]), axis=1)
        further = np.where(many[limited], np.where(lost, EXHAUSTED, OPEN), STUCK)
        found[limited[~folded]] = further[~folded]
    found[status >= len(STATUSES)] = INTERRUPTED
    return found
