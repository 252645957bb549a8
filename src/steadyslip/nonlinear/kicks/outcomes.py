"""What comes of motion under constant inputs, decided by what is certain and by nothing else.

A motion returns once it is in a computed neighbourhood of steady sliding that is never left (`neighbourhood`); it
oscillates once it is on a closed orbit that was found and attracts (`closed_orbits`); blow-up and loss of contact are
seen. Whatever is none of these runs on, and after a stated time it is *undecided*.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from steadyslip.kernels.program import STATUSES, TALLY, Program
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import Reduction
from steadyslip.model.start import restored_of
from steadyslip.motion.engine import LANES, run_chunk, run_many
from steadyslip.motion.jobs import Jobs
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.rest import Rest, picked
from steadyslip.protocol import Segments

Array = np.ndarray
OUTCOMES = ("returns", "blow-up", "contact lost", "oscillation", "no solution", "interrupted", "undecided")
RETURNS, BLOW_UP, CONTACT_LOST, OSCILLATION, NO_SOLUTION, INTERRUPTED, UNDECIDED = range(7)
CERTAIN = (BLOW_UP, CONTACT_LOST, OSCILLATION, NO_SOLUTION)
"""Outcomes that are not a return."""
OPEN = -1

LOADING = 40.0  # natural lengths that the load point moves at least, to take up what a kick has let go,
TURNS = 3.0  # natural periods,
DECAYS = 6.0  # and decay times in the first span of a run; each span is twice as long as the one before
MOST_TURNS = 1000.0  # natural periods, and
MOST_LOADING = 4000.0  # natural lengths after which a motion is undecided,
MOST_STEPS = 4_000_000  # or steps
LONG, LATE = 0.05, 0.4  # share of this time after which longer cycles are looked for too; where sliding is stable
NEUTRAL_TURNS = 100.0  # where small motions neither grow nor decay: what stays bounded so long counts as returned
ALIKE = 1e-2  # relative change of the time between slip events from span to span below which a cycle is looked for


@dataclass
class Budget:
    """Steps of integration that a search may still take, all its motions together."""

    steps: float = np.inf


@dataclass(frozen=True, eq=False)
class Judged:
    """Motions under constant inputs, about to be run.

    Attributes
    ----------
    jobs : Jobs
        Rigs and where they start, one for each motion.
    rest : Rest
        The steady sliding that their inputs allow.
    near : Neighbourhood
        Of that.
    jump : ndarray (m,)
        Step of the load point at the start, m.
    group : ndarray of int (m,)
        For each motion the first with the same rig and inputs.
    effort : float
        Multiplies how long a motion is followed before it is undecided.
    budget : Budget
        Motions that are open when it is used up are undecided.
    """

    jobs: Jobs
    rest: Rest
    near: Neighbourhood
    jump: Array
    group: Array
    effort: float = 1.0
    budget: Budget = field(default_factory=Budget)

    def repeated(self, one: int, count: int) -> Judged:
        """So many motions of one rig, to be started anywhere."""
        which = np.full(count, one)
        rest, near = self.rest.part(which), self.near.part(which)
        nothing = np.zeros(count)
        jobs = replace(self.jobs, point=self.jobs.point.part(which), size=count)
        return Judged(jobs, rest, near, nothing, which * 0, self.effort, self.budget)

    def times(self) -> tuple[Array, Array]:
        """Length of the first span, and the time after which a motion is undecided, s."""
        rest, leading = self.rest, self.rest.leading
        unit = rest.scales[:, rest.reduction.names.index("x")] / np.abs(rest.velocity)
        reload = 1.5 * np.abs(self.jump) / np.abs(rest.velocity)
        with np.errstate(all="ignore"):
            turn = 2 * np.pi / np.abs(leading)
            turn = np.where(np.isfinite(turn), turn, 0.0)
            decays = np.where(rest.stable, DECAYS / np.abs(leading.real), 0.0)
            decays = np.minimum(np.where(np.isfinite(decays), decays, 0.0), 0.1 * MOST_TURNS * turn)
        first = reload + LOADING * unit + TURNS * turn + decays
        turns = np.where(rest.neutral, NEUTRAL_TURNS, self.effort * MOST_TURNS)
        loading = np.where(rest.neutral, LOADING, self.effort * MOST_LOADING)
        return first, reload + loading * unit + turns * turn


def constant_inputs(span: Array, velocity: Array, jump: Array, pressure: Array) -> Segments:
    """One segment for each run, with the load point moved at its start; arguments (m,)."""
    count = len(span)
    value = np.zeros((count, 1, 3))
    value[:, 0, 0], value[:, 0, 2] = velocity, pressure
    waves = np.zeros((count, 1, 3, 0))
    return Segments(
        np.zeros((count, 1)), span[:, None], jump[:, None], value, np.zeros_like(value), waves, waves, waves
    )


@dataclass
class Spans:
    """What a span of some runs ended with: status, state (k, n), steps and tally."""

    status: Array
    state: Array
    steps: Array
    tally: Array
    whole: bool = True


def advanced_runs(
    runs: Judged, which: Array, start: Array | None, span: Array, watch: bool = False, threads: int | None = None
) -> Spans:
    """Let runs `which` (k,) go on for `span` (k,) from states `start` (k, n), or from their beginning."""
    jobs, rest = runs.jobs, runs.rest
    velocity, pressure = rest.velocity[which], rest.pressure[which]
    jump = runs.jump[which] if start is None else np.zeros(len(which))
    point = jobs.point.part(which)
    if start is None:
        initial, speed = picked(jobs.initial, which), picked(jobs.velocity, which)
    else:
        initial, speed = continuous_at(jobs.reduction, point, start, velocity, pressure)
    part = replace(
        jobs, point=point, initial=initial, velocity=speed,
        segments=constant_inputs(span, velocity, jump, pressure), size=len(which),
    )  # fmt: skip
    machine: Program = jobs.program(LANES, dense=True)
    _ = machine.code.advance  # compile before the threads start
    n = rest.state.shape[1]
    count = len(which)
    found = Spans(np.full(count, len(STATUSES)), np.full((count, n), np.nan), np.zeros(count),
                  np.full((count, len(TALLY)), np.nan))  # fmt: skip

    def work(begin: int, end: int, stopped: threading.Event) -> None:
        outcome = run_chunk(part, machine, begin, end, np.empty(0), watch, stopped)
        found.status[begin:end], found.state[begin:end] = outcome.status, outcome.final[:, 4:]
        found.steps[begin:end], found.tally[begin:end] = outcome.final[:, 2] + outcome.final[:, 3], outcome.tally

    found.whole = run_many(work, count, threads)
    runs.budget.steps -= float(np.nansum(found.steps))
    return found


def continuous_at(
    reduction: Reduction, point: OperatingPoint, state: Array, velocity: Array, pressure: Array
) -> tuple[Array, Array]:
    """What a kernel starts from: the continuous variables, and a velocity near which to look for its own."""
    with np.errstate(all="ignore"):
        found = point.evaluate(restored_of(reduction), *state.T, velocity, 0.0, pressure, 0.0)
        initial = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), (len(state),)) for c in found])
        speed = np.array(velocity)
        if reduction.form == "eliminated":
            speed = np.asarray(point.drive) * np.exp(state[:, reduction.names.index("w")])
    return np.ascontiguousarray(initial), speed


def outcomes_of(
    runs: Judged, threads: int | None = None, advanced: Callable[[int], None] | None = None, start: Array | None = None
) -> Array:
    """Run motions and say what comes of them: indices into `OUTCOMES`, (m,); from states `start` (m, n) if given.

    `advanced` is told now and then how many more have been decided.
    """
    from steadyslip.nonlinear.kicks.closed_orbits import attracted, on_long_cycle
    from steadyslip.nonlinear.kicks.shells import Shells

    count = len(runs.rest.velocity)
    found = np.full(count, OPEN)
    span, most = runs.times()
    elapsed, steps, state = np.zeros(count), np.zeros(count), np.full((count, runs.rest.state.shape[1]), np.nan)
    between = np.full(count, np.nan)
    open_, first = np.arange(count), start is None
    shells = Shells(runs, threads) if first else None
    if start is not None:
        state = np.array(start)
    while len(open_):
        ended = advanced_runs(runs, open_, None if first else state[open_], span[open_], not first, threads)
        elapsed[open_] += span[open_]
        steps[open_] += ended.steps
        state[open_] = ended.state
        found[open_] = _seen(ended.status)
        running = np.flatnonzero(found[open_] == OPEN)
        going = open_[running]
        found[going[runs.near.holds(going, state[going])]] = RETURNS
        neutral = runs.rest.neutral[going]
        found[going[neutral & (elapsed[going] >= most[going])]] = RETURNS
        if not ended.whole:
            found[found == OPEN] = INTERRUPTED
            break
        if shells is not None and not first:
            waiting = going[(found[going] == OPEN) & ~neutral]
            found[waiting] = shells.outcomes(waiting, state[waiting])
        apart, peaks = (ended.tally[:, TALLY.index(name)] for name in ("recurrence", "peak_period"))
        apart = np.where(apart > 0, apart, peaks)  # small cycles have no slip events
        tried = running[(found[going] == OPEN) & ~neutral & _alike(apart[running], between[going])]
        if len(tried):
            closed = attracted(runs, open_[tried], state[open_[tried]], apart[tried], threads)
            found[open_[tried[closed]]] = OSCILLATION
        long = np.where(runs.rest.stable[going], LATE, LONG) * most[going]
        several = ~_alike(apart[running], between[going])  # slip events that follow each other in various times
        waiting = going[(found[going] == OPEN) & ~neutral & several & (elapsed[going] > long)]
        found[[one for one in waiting if on_long_cycle(runs, one, state[one])]] = OSCILLATION
        between[open_] = apart
        late = (elapsed[open_] >= most[open_]) | (steps[open_] >= MOST_STEPS * runs.effort) | (runs.budget.steps <= 0)
        found[open_[late & (found[open_] == OPEN)]] = UNDECIDED
        if advanced is not None:
            advanced(int(np.sum(found[open_] != OPEN)))
        open_, first = open_[found[open_] == OPEN], False
        span[open_] = np.minimum(2 * span[open_], np.maximum(most[open_] - elapsed[open_], 0.1 * span[open_]))
    return found


def _alike(now: Array, before: Array) -> Array:
    """Whether slip events follow each other in the same time as at the end of the span before."""
    with np.errstate(invalid="ignore"):
        return np.asarray((now > 0) & (np.abs(now - before) < ALIKE * now))


def _seen(status: Array) -> Array:
    """Outcomes that a run's end itself tells; OPEN where it went on to the end of its span."""
    code = {word: i for i, word in enumerate(STATUSES)}
    found = np.full(len(status), NO_SOLUTION)
    found[status == code["done"]] = OPEN
    found[status == code["blow-up"]] = BLOW_UP
    found[status == code["contact lost"]] = CONTACT_LOST
    found[(status == code["too many steps"]) | (status == code["stuck"])] = UNDECIDED  # the integrator's limits
    found[status >= len(STATUSES)] = INTERRUPTED
    return found
