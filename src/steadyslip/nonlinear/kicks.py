"""Kicks: what is done to a rig in steady sliding at time zero, and what comes of it.

A kick has a size without unit, from nothing upwards; all of them change the state or the inputs once, after which
the inputs are constant, so that one kernel runs them all.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.compiled.program import STATUSES, TALLY
from steadyslip.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.linear.polynomials import roots
from steadyslip.linear.stiffness import characteristic
from steadyslip.motion.engine import LANES, Outcome, run_chunk, run_many
from steadyslip.motion.setup import Jobs, Options, prepare
from steadyslip.protocol import Segments
from steadyslip.slider import Slider
from steadyslip.values import Values, model_values

Array = np.ndarray
SETTLED = 1e-3  # ln(peak velocity/drive) of two peaks in a row below which a motion has returned
SAME = 1e-8  # relative change between peaks below which a motion repeats itself
NEUTRAL = 1e-8  # growth per radian below which small motions neither grow nor decay
PERIODS = 12.0  # run at least for so many natural periods,
DECAYS = 40.0  # and for so many decay times,
MOST_PERIODS = 2000.0  # but no longer than this; on top of it,
LOADING = 500.0  # while the load point moves so many natural lengths, to take up what a kick has let go
OUTCOMES = ("returns", "blow-up", "contact lost", "oscillation", "no solution", "interrupted")
RETURNS, BLOW_UP, CONTACT_LOST, OSCILLATION, NO_SOLUTION, INTERRUPTED = range(6)


@dataclass(frozen=True)
class Kick:
    """One kind of kick.

    Attributes
    ----------
    name : str
    unit : str
        Of `amount`.
    low, high : float
        Range of sizes that is searched.
    """

    name: str
    unit: str
    low: float
    high: float
    doc: str


KICKS = {
    kick.name: kick
    for kick in (
        Kick("velocity", "m/s", 1e-3, 46.0, "step of the load-point velocity; size ln(new/old)"),
        Kick("displacement", "m", 1e-4, 1e5, "step of the load point; size in natural lengths (d_c)"),
        Kick("normal-stress", "Pa", 1e-6, 1e2, "step of the normal stress; size as a share of the steady one"),
        Kick("impulse", "Pa s", 1e-4, 1e12, "blow on a block with mass; size as change of velocity over the drive's"),
    )
}


def leading_eigenvalue(values: Values) -> Array:
    """The eigenvalue with the largest real part (m,), 1/s; NaN without steady sliding."""
    with np.errstate(all="ignore"):
        found = np.atleast_2d(roots(characteristic(values)))
    real = np.where(np.isnan(found), -np.inf, found.real)
    best = np.take_along_axis(found, np.argmax(real, axis=1)[:, None], axis=1)[:, 0]
    return np.atleast_1d(best)


class Kicked:
    """A rig, or many, about to be kicked.

    Parameters
    ----------
    rig : Slider
    kick : str
        A name in `KICKS`.
    direction : int
        1 or -1: faster, forward, pressed harder; or the reverse.
    reference : str
        For ``velocity``: ``before`` if the rig's drive is the velocity before the step, ``after`` if it is
        the velocity after it.
    vary : mapping of str to ndarray
        Parameters of the rig, flat arrays of equal length.

    Attributes
    ----------
    size : int
        Number of rigs.
    stable : ndarray of bool (size,)
        Whether small motions about the rig's own steady sliding decay (or, within rounding, stay).
    """

    def __init__(
        self, rig: Slider, kick: str, direction: int, reference: str, vary: Mapping[str, Any], branch: int,
        rtol: float | None,
    ) -> None:  # fmt: skip
        problems = []
        if kick not in KICKS:
            problems.append(Problem("kick", unknown_name("kick", kick, KICKS)))
        if direction not in (1, -1):
            problems.append(Problem("direction", f"got {direction!r}; allowed: 1 or -1"))
        if reference not in ("before", "after"):
            problems.append(Problem("reference", f"got {reference!r}; allowed: 'before' or 'after'"))
        if problems:
            raise ParameterError(problems)
        self.rig, self.kick, self.sign, self.reference = rig, KICKS[kick], float(direction), reference
        self.vary, self.branch = dict(vary), branch
        values = model_values(rig, self.vary, branch=branch)
        rtol = rtol or (1e-8 if values.model.inertial else 1e-10)
        self.options = Options(rtol=rtol, most_steps=2_000_000, settled=SETTLED, same=SAME)
        if kick == "impulse" and "slider.mass" not in values.named():
            raise NotAvailable(
                "an impulse needs a mass: without it the block takes any velocity at once; use a displacement or "
                "normal-stress kick, or give the slider a mass"
            )
        if values.model.imposed != 0:
            raise NotAvailable("a rig whose normal stress is prescribed in time has no steady sliding to return to")
        self.size = max(values.size, 1)
        leading = leading_eigenvalue(values)
        self.exists = np.isfinite(leading.real)
        self.neutral = np.abs(leading.real) <= NEUTRAL * np.abs(leading)
        self.stable = self.exists & ((leading.real < 0) | self.neutral)
        named = values.named()
        self.drive = np.broadcast_to(np.asarray(named["drive.velocity"], dtype=float), (self.size,))
        self.mass = np.broadcast_to(np.asarray(named.get("slider.mass", 0.0), dtype=float), (self.size,))
        one = prepare(rig, None, 1.0, self.vary, {}, self.options, branch)
        self.sigma = np.broadcast_to(one.sigma, (self.size,))
        _, _, settings, _ = one.tables(one.program(LANES, dense=True), 0, self.size, True, False)
        first = one.reduction.names.index("x")
        self.length = np.broadcast_to(settings[:, len(settings[0]) - len(one.reduction.names) + first] / rtol,
                                      (self.size,))  # fmt: skip

    # -- sizes

    @property
    def highest(self) -> float:
        """Largest size that makes sense."""
        if self.kick.name == "normal-stress" and self.sign < 0:
            return 0.999
        if self.kick.name == "impulse" and self.sign < 0:
            return 0.999
        return self.kick.high

    def amount(self, size: Any, which: Any = slice(None)) -> Array:
        """The kick in SI units: velocity beside the rig's own drive, displacement, stress, or impulse; signed."""
        size = np.asarray(size, dtype=float)
        with np.errstate(over="ignore"):
            if self.kick.name == "velocity":
                sign = self.sign if self.reference == "before" else -self.sign
                return np.asarray(self.drive[which] * np.exp(sign * size))
            if self.kick.name == "displacement":
                return np.asarray(self.sign * size * self.length[which])
            if self.kick.name == "normal-stress":
                return np.asarray(self.sign * size * self.sigma[which])
            return np.asarray(self.sign * size * self.mass[which] * self.drive[which])

    def size_of(self, amount: float) -> float:
        """The size of a kick given in SI units (of the first rig); negative if against `direction`."""
        if self.kick.name == "velocity":
            sign = self.sign if self.reference == "before" else -self.sign
            return float(sign * np.log(amount / self.drive[0]))
        unit = {"displacement": self.length, "normal-stress": self.sigma, "impulse": self.mass * self.drive}
        return float(self.sign * amount / unit[self.kick.name][0])

    # -- outcomes

    def jobs(self, which: Array, sizes: Array) -> tuple[Jobs, Array]:
        """Runs of rigs `which` (n,) after kicks of `sizes` (n,), and whether small motions there are neutral."""
        count = len(which)
        own = {name: np.asarray(a)[which] if np.ndim(a) else a for name, a in self.vary.items()}
        drive, amount = self.drive[which], self.amount(sizes, which)
        initial: dict[str, Any] = {}
        new = drive
        if self.kick.name == "velocity":
            if self.reference == "before":
                new = amount
            else:
                own["drive.velocity"] = amount
        if self.kick.name == "impulse":
            initial["v"] = drive + amount / self.mass[which]
        jobs = prepare(self.rig, None, 1.0, own, initial, self.options, self.branch)
        after = own | {"drive.velocity": new} if self.kick.name == "velocity" else own
        leading = np.broadcast_to(leading_eigenvalue(model_values(self.rig, after, branch=self.branch)), (count,))
        nothing = np.zeros(count)
        jump = amount if self.kick.name == "displacement" else nothing
        pressure = amount if self.kick.name == "normal-stress" else nothing
        with np.errstate(all="ignore"):
            horizon = horizon_of(leading) + (LOADING * self.length[which] + 2 * np.abs(jump)) / new
        horizon = np.where(np.isfinite(horizon), horizon, 1.0)
        segments = constant_inputs(horizon, np.broadcast_to(new, (count,)), jump, pressure)
        return replace(jobs, segments=segments, size=count), np.abs(leading.real) <= NEUTRAL * np.abs(leading)

    def outcomes(
        self, which: Array, sizes: Array, threads: int | None = None, advanced: Callable[[int], None] | None = None
    ) -> Array:
        """What comes of kicks: indices into `OUTCOMES`, (n,)."""
        jobs, neutral = self.jobs(which, sizes)
        return outcomes_of(jobs, neutral, threads, advanced)


def outcomes_of(
    jobs: Jobs, neutral: Array, threads: int | None = None, advanced: Callable[[int], None] | None = None
) -> Array:
    """Run jobs with constant inputs and say what comes of them: indices into `OUTCOMES`, (n,)."""
    machine = jobs.program(LANES, dense=True)
    _ = machine.module  # compile before the threads start
    found = np.full(jobs.size, INTERRUPTED)

    def work(start: int, stop: int, stopped: threading.Event) -> None:
        outcome = run_chunk(jobs, machine, start, stop, np.empty(0), True, stopped)
        found[start:stop] = _judged(jobs, outcome, start, neutral[start:stop])

    run_many(work, jobs.size, threads, advanced=advanced)
    return found


def horizon_of(leading: Array) -> Array:
    """How long to run, s: many decay times of the slowest small motion, within limits in natural periods."""
    with np.errstate(all="ignore"):
        rate = np.maximum(np.abs(leading.real), 1e-300)
        period = 2 * np.pi / np.abs(leading)
        horizon = np.clip(DECAYS / rate, PERIODS * period, MOST_PERIODS * period)
    return np.where(np.isfinite(horizon), horizon, 1.0)


def constant_inputs(horizon: Array, velocity: Array, jump: Array, pressure: Array) -> Segments:
    """One segment for each run, with the load point moved at its start; arguments (n,)."""
    count = len(horizon)
    value = np.zeros((count, 1, 3))
    value[:, 0, 0], value[:, 0, 2] = velocity, pressure
    waves = np.zeros((count, 1, 3, 0))
    return Segments(
        np.zeros((count, 1)), horizon[:, None], jump[:, None], value, np.zeros_like(value), waves, waves, waves
    )


def _judged(jobs: Jobs, outcome: Outcome, first: int, neutral: Array) -> Array:
    """Outcomes of a chunk of runs."""
    status = outcome.status
    code = {word: i for i, word in enumerate(STATUSES)}
    found = np.full(len(status), NO_SOLUTION)
    found[status == code["settled"]] = RETURNS
    found[status == code["blow-up"]] = BLOW_UP
    found[status == code["contact lost"]] = CONTACT_LOST
    found[(status == code["periodic"]) | (status == code["too many steps"])] = OSCILLATION
    found[status >= len(STATUSES)] = INTERRUPTED
    done = status == code["done"]
    if np.any(done):  # overdamped rigs return without a peak; slow ones are on their way, their peaks shrinking
        peaks = outcome.tally[:, TALLY.index("velocity_peaks")]
        shrinking = outcome.tally[:, TALLY.index("peak_growth")] < 0
        drive = jobs.segments.value[first : first + len(status), 0, 0]
        w = jobs.reduction.names.index("w") if "w" in jobs.reduction.names else None
        reference = np.asarray(
            dict(zip(jobs.values.model.parameters, jobs.values.arguments, strict=True))["drive.velocity"]
        )
        reference = np.broadcast_to(reference, (jobs.size,))[first : first + len(status)]
        if w is not None and jobs.reduction.velocity == "logarithm":
            near = np.abs(outcome.final[:, 4 + w] - np.log(np.abs(drive / reference))) < 0.1
        else:
            near = peaks < 2
        found[done] = np.where(np.where(peaks < 2, near, shrinking)[done], RETURNS, OSCILLATION)
    bounded = (found == OSCILLATION) & neutral
    found[bounded] = RETURNS
    return found
