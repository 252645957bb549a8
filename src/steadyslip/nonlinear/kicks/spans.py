"""Simulate motions of kicked rigs under constant inputs side by side, one span of time after another."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.layout import Final
from steadyslip.kernels.runner import STATUSES, TALLY, Runner
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import Reduction
from steadyslip.model.start import restored_of
from steadyslip.motion.engine import LANES, run_chunk, run_many
from steadyslip.motion.jobs import Jobs, Options
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.rest import Rest, picked
from steadyslip.protocol.segments import Segments

DOUBTS = (
    "within the longest time simulated it neither came back nor settled on a cycle",
    "one motion took more steps than are allowed, as where something rings on almost undamped",
    "all motions together took more steps than are allowed",
    "the integration could not go on",
    "how near to steady sliding counts as back was not found",
)
"""Reasons for which a motion is undecided."""
OUTCOMES = ("returns", "blow-up", "contact lost", "oscillation", "no solution", "interrupted",
            *len(DOUBTS) * ["undecided"])  # fmt: skip
RETURNS, BLOW_UP, CONTACT_LOST, OSCILLATION, NO_SOLUTION, INTERRUPTED, UNDECIDED = range(7)
"""Indices into `OUTCOMES`; `UNDECIDED` + i is an undecided outcome for the reason `DOUBTS[i]`."""
LATE, EXHAUSTED, SPENT, STUCK, UNSEEN = range(UNDECIDED, len(OUTCOMES))
CERTAIN = (BLOW_UP, CONTACT_LOST, OSCILLATION, NO_SOLUTION)
"""Decided outcomes other than a return."""
OPEN = -1  # in arrays of outcomes: the outcome is not decided yet

USUAL = 3  # number of state variables of a slider; budgets of steps refer to this number
FEWEST = 100  # least limit of steps of one motion, however few steps are left to all motions
STIFF = "rodas4"  # method for stiff motions, and for motions for which the explicit method needs too many steps
LOADING = 40.0  # advance of the load point in the first span, natural lengths; each span is twice as long as the last
TURNS = 3.0  # added to the first span, natural periods
DECAYS = 6.0  # added to the first span, decay times
MOST_TURNS = 1000.0  # longest simulated time, natural periods
MOST_DECAYS = 20.0  # longest simulated time in decay times; the longer of this and MOST_TURNS counts
MOST_LOADING = 4000.0  # added to the longest simulated time, natural lengths of advance
RELOAD = 1.5  # factor on the time in which the load point catches up with the block; nothing is decided earlier
NEUTRAL_TURNS = 100.0  # natural periods of bounded motion that count as a return if sliding is neutrally stable


def doubt_of(outcome: int) -> str:
    """Reason for which an outcome is undecided; empty for other outcomes."""
    return DOUBTS[outcome - UNDECIDED] if UNDECIDED <= outcome < len(OUTCOMES) else ""


@dataclass
class StepBudget:
    """Number of integration steps left to a search, for all its motions."""

    steps: float = np.inf

    @classmethod
    def of(cls, steps: float, variables: int, power: int = 3) -> StepBudget:
        """Budget of `steps` for a slider, reduced for more variables by a power of their number (cost of a step)."""
        return cls(steps * min(1.0, (USUAL / variables) ** power))

    def each(self, motions: int, most: int) -> int:
        """Limit of the steps of each of several motions in one span: `most`, or an equal share of the steps left."""
        return int(min(most, max(FEWEST, self.steps / motions)))


@dataclass(frozen=True, eq=False)
class MotionBatch:
    """Motions under constant inputs, ready to be simulated.

    Attributes
    ----------
    jobs : Jobs
        Rig and initial state of each motion.
    rest : Rest
        Steady sliding at the inputs of each motion.
    near : Neighbourhood
        Neighbourhood of `rest` from which all motion returns to it.
    jump : ndarray (m,)
        Step of the load point at the start, m.
    group : ndarray of int (m,)
        For each motion the index of the first one with equal rig and inputs.
    effort : float
        Factor on the longest simulated time.
    budget : StepBudget
        Integration steps left; motions without an outcome when they are used up are undecided.
    """

    jobs: Jobs
    rest: Rest
    near: Neighbourhood
    jump: Array
    group: Array
    effort: float = 1.0
    budget: StepBudget = field(default_factory=StepBudget)

    def repeated(self, one: int, count: int) -> MotionBatch:
        """Batch of `count` motions of the rig to which the motion of index `one` belongs, for any initial states."""
        which = np.full(count, one)
        rest, near = self.rest.part(which), self.near.part(which)
        nothing = np.zeros(count)
        jobs = replace(self.jobs, point=self.jobs.point.part(which), size=count)
        return MotionBatch(jobs, rest, near, nothing, which * 0, self.effort, self.budget)

    def times(self) -> tuple[Array, Array]:
        """Length of the first span and longest simulated time of each motion, s, (m,) each."""
        rest, leading = self.rest, self.rest.leading
        unit = rest.time
        reload = RELOAD * np.abs(self.jump) / np.abs(rest.velocity)
        with np.errstate(all="ignore"):
            turn = 2 * np.pi / np.abs(leading)
            turn = np.where(np.isfinite(turn), turn, 0.0)
            decay = np.where(rest.stable & ~rest.neutral, 1 / np.abs(leading.real), 0.0)
        first = reload + LOADING * unit + TURNS * turn + np.minimum(DECAYS * decay, 0.1 * MOST_TURNS * turn)
        turns = np.where(rest.neutral, NEUTRAL_TURNS * turn, np.maximum(MOST_TURNS * turn, MOST_DECAYS * decay))
        loading = np.where(rest.neutral, LOADING, self.effort * MOST_LOADING)
        return first, reload + loading * unit + turns * np.where(rest.neutral, 1.0, self.effort)

    def reload(self, which: Array, states: Array) -> Array:
        """Time (k,), s, in which the load point advances by the distance of states (k, n) from steady sliding."""
        slips = list(self.rest.places)
        away = np.abs(states[:, slips] - self.rest.state[which][:, slips]) / self.rest.speeds[which]
        return np.asarray(np.nan_to_num(RELOAD * np.max(away, axis=1)))


def constant_inputs(span: Array, velocity: Array, jump: Array, pressure: Array, force: Array) -> Segments:
    """One segment of constant inputs for each run, with a jump of the load point at its start; arguments (m,)."""
    count = len(span)
    value = np.zeros((count, 1, 3))
    value[:, 0, 0], value[:, 0, 1], value[:, 0, 2] = velocity, force, pressure
    waves = np.zeros((count, 1, 3, 0))
    return Segments(
        np.zeros((count, 1)), span[:, None], jump[:, None], value, np.zeros_like(value), waves, waves, waves
    )


ARRAYS = ("status", "time", "state", "unknowns", "steps", "tally")


@dataclass
class SpanResults:
    """State of k runs at the end of a span: status, time reached (s), state (k, n), steps and tally.

    `unknowns` (k, u) solve the algebraic equations; `whole` is False if Ctrl-C stopped some of the runs.
    """

    status: Array
    time: Array
    state: Array
    unknowns: Array
    steps: Array
    tally: Array
    whole: bool = True

    @classmethod
    def empty(cls, count: int, n: int, unknowns: int) -> SpanResults:
        """`SpanResults` filled with placeholders, for `count` runs that are not simulated yet."""
        return cls(np.full(count, len(STATUSES)), np.zeros(count), np.full((count, n), np.nan),
                   np.full((count, unknowns), np.nan), np.zeros(count),
                   np.full((count, len(TALLY)), np.nan))  # fmt: skip

    def part(self, which: Array) -> SpanResults:
        """Results of the runs with indices `which`."""
        return replace(self, **{name: getattr(self, name)[which] for name in ARRAYS})

    def put(self, which: Array, found: SpanResults) -> None:
        """Store the results `found` for the runs with indices `which`."""
        for name in ARRAYS:
            getattr(self, name)[which] = getattr(found, name)
        self.whole = self.whole and found.whole


def advanced_runs(
    runs: MotionBatch, which: Array, start: Array | None, span: Array, watch: bool = False, threads: int | None = None,
    options: Options | None = None, unknowns: Array | None = None,
) -> SpanResults:  # fmt: skip
    """Simulate runs `which` (k,) for `span` (k,) s from states `start` (k, n), or from their beginning.

    `unknowns` (k, u) solve the algebraic equations at `start`, NaN where they are not known.
    """
    options = options or runs.jobs.options
    options = replace(options, most_steps=runs.budget.each(len(which), options.most_steps))
    jobs, rest = replace(runs.jobs, options=options), runs.rest
    velocity, force, pressure = rest.velocity[which], rest.force[which], rest.pressure[which]
    jump = runs.jump[which] if start is None else np.zeros(len(which))
    point = jobs.point.part(which)
    if start is None:
        initial, near = picked(jobs.initial, which), None if jobs.near is None else jobs.near[which]
    else:
        initial, near = continuous_at(jobs.reduction, point, start, (velocity, force, pressure), unknowns)
    part = replace(
        jobs, point=point, initial=initial, velocity=picked(jobs.velocity, which), near=near,
        segments=constant_inputs(span, velocity, jump, pressure, force), size=len(which),
    )  # fmt: skip
    machine: Runner = jobs.runner(LANES, dense=True)
    _ = machine.code.advance  # compiles the kernel before the threads start
    count, own = len(which), rest.contact * len(TALLY)
    found = SpanResults.empty(count, rest.state.shape[1], rest.unknowns.shape[1])

    def work(begin: int, end: int, stopped: threading.Event) -> None:
        outcome = run_chunk(part, machine, begin, end, np.empty(0), watch, stopped)
        found.status[begin:end], found.tally[begin:end] = outcome.status, outcome.tally[:, own : own + len(TALLY)]
        found.time[begin:end], found.steps[begin:end] = outcome.final[:, Final.TIME], outcome.steps.sum(axis=1)
        found.state[begin:end], found.unknowns[begin:end] = outcome.state, outcome.unknowns

    found.whole = run_many(work, count, threads)
    runs.budget.steps -= float(np.nansum(found.steps))
    return found


def continuous_at(
    reduction: Reduction, point: OperatingPoint, state: Array, inputs: tuple[Array, ...], unknowns: Array | None = None
) -> tuple[Array, Array]:
    """Continuous variables (m, n) with which a kernel starts, and guesses of its unknowns, as in `Jobs.near`.

    `inputs` are the velocity of the load point, the force on a body and the added normal stress, each (m,);
    `unknowns` (m, u) solve the algebraic equations at the states, NaN where they are not known.
    """
    with np.errstate(all="ignore"):
        found = point.evaluate(restored_of(reduction), *state.T, *inputs, 0.0)
        initial = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), (len(state),)) for c in found])
    known = dict(zip(reduction.state, state.T, strict=True))
    known |= {} if unknowns is None else dict(zip(reduction.unknowns, unknowns.T, strict=True))
    near = [known.get(symbol, np.full(len(state), np.nan)) for symbol in reduction.searched]
    return np.ascontiguousarray(initial), np.column_stack(near) if near else np.empty((len(state), 0))
