"""Kicks (sudden disturbances of steady sliding at time zero): their kinds, sizes, and the motions after them.

The size of a kick is dimensionless and positive. A kick changes the state or the inputs once, after which the inputs
are constant, so that one kernel integrates the motions after all kinds of kick.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Model
from steadyslip.model.point import operating_point
from steadyslip.model.reducing import reduce_model
from steadyslip.model.start import initial_values
from steadyslip.motion.jobs import Jobs, Options, automatic_method, prepare
from steadyslip.motion.status import NEEDS_MASS
from steadyslip.motion.targets import Targets
from steadyslip.nonlinear.inner_coordinates import inner_count, refuse_many_inner
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.outcomes import contacts_of, outcomes_of
from steadyslip.nonlinear.kicks.places import largest_blow, place_problems, refuse_jump, size_units, struck
from steadyslip.nonlinear.kicks.rest import Rest, picked
from steadyslip.nonlinear.kicks.settled import rest_of
from steadyslip.nonlinear.kicks.spans import STIFF, MotionBatch, StepBudget, continuous_at

STEPS = 1e9  # limit of integration steps for all motions of one threshold: about a minute on two cores
STEPS_OF_STRUCTURES = 2e8  # as STEPS, for structures: some 10 CPU s; reduced by the square of the number of variables
PATIENCE = 5.0  # motions near the threshold are simulated up to this many times as long as those of the first scan


@dataclass(frozen=True)
class Kick:
    """One kind of kick, with the unit of its amount and the range of sizes that is searched.

    Attributes
    ----------
    name : str
    unit : str
        SI unit of the amount of a kick.
    low, high, most : float
        Range of sizes that is searched by default, and the largest that can be.
    size : str
        Definition of the dimensionless size.
    doc : str
        Description for lists of kicks.
    usual : bool
        True if the kick is tried by default.
    """

    name: str
    unit: str
    low: float
    high: float
    most: float
    size: str
    doc: str
    usual: bool = False


KICKS = {
    kick.name: kick
    for kick in (
        Kick("velocity", "m/s", 1e-3, log(1e4), 25.0, "ln(new/old velocity)", "step of the load-point velocity", True),
        Kick("displacement", "m", 1e-4, 1e5, 1e5, "natural lengths (d_c)", "step of the load point", True),
        Kick("normal-stress", "Pa", 1e-6, 10.0, 1e2, "share of the steady one", "step of the normal stress"),
        Kick("impulse", "Pa s", 1e-4, 1e4, 1e10, "change of velocity over the drive's", "blow on a block with mass"),
    )
}
OF_MACHINES = {
    kick.name: kick
    for kick in (
        replace(KICKS["velocity"], doc="step of the drive's velocity, or of that of the body at which it is"),
        replace(KICKS["displacement"], doc="step of the load point, or of the body at which it is", usual=False),
        Kick("force", "N", 1e-6, 10.0, 1e2, "share of the largest steady normal force", "step of a force on a body"),
        Kick("normal-force", "N", 1e-6, 10.0, 1e2, "share of the steady one", "step of the normal force at a contact"),
        replace(KICKS["impulse"], unit="N s", size="change of velocity over its own", doc="blow on a body with mass"),
    )
}
"""Kinds of kick of machines, by name."""


def kicks_of(rig: Slider | Machine) -> dict[str, Kick]:
    """Kinds of kick for a rig, by name."""
    return OF_MACHINES if rig.in_forces else KICKS


def kick_problems(rig: Slider | Machine, kick: str, at: str | None = None) -> list[Problem]:
    """Problems with the kind of a kick and with the body or contact `at`, as a list for error messages.

    Raises
    ------
    NotAvailable
        If the kick would need an infinite force.
    """
    known = kicks_of(rig)
    if kick not in known:
        return [Problem("kick", unknown_name("kick", kick, known))]
    found = place_problems(rig, kick, at)
    if not found and kick == "displacement" and not at:
        refuse_jump(rig)
    return found


def options_for(model: Model, rtol: float | None) -> Options:
    """Integration options for motions after kicks: rtol 1e-10, or 1e-8 with mass or bristles (implicit method).

    Rounding in the force of stiff bristles exceeds the finer tolerance.
    """
    stiff = automatic_method(reduce_model(model)) == STIFF
    return Options(rtol=rtol or (1e-8 if stiff else 1e-10), most_steps=400_000)


class Kicked:
    """One rig or many, with one kind of kick: prepares and simulates motions after kicks of any size.

    Parameters
    ----------
    rig : Slider or Machine
    kick : str
        A key of ``kicks_of(rig)``.
    at : str or None
        For a machine: the body or contact that is kicked; None for its drive.
    direction : int
        1: faster, forward, pressed harder; -1: the reverse.
    reference : str
        For ``velocity``: ``before`` if the rig's drive velocity is the velocity before the step, ``after`` if it is the
        velocity after the step. The rig's parameters, such as a steady normal stress, refer to its drive velocity.
    vary : mapping of str to ndarray
        Parameters of the rig, flat arrays of equal length.
    up_to : float or None
        Largest size that is searched; by default `Kick.high`.

    Attributes
    ----------
    size : int
        Number of rigs.
    rest : Rest
        Steady sliding of the rigs before kicks.
    exists, neutral, stable : ndarray of bool (size,)
        True if steady sliding exists; if small motions about steady sliding neither grow nor decay; and if these
        motions do not grow.
    budget : StepBudget
        Integration steps left for all motions.
    """

    def __init__(
        self, rig: Slider | Machine, kick: str, direction: int, reference: str, vary: Mapping[str, Any], branch: int,
        rtol: float | None, at: str | None = None, up_to: float | None = None,
    ) -> None:  # fmt: skip
        problems, known = kick_problems(rig, kick, at), kicks_of(rig)
        if direction not in (1, -1):
            problems.append(Problem("direction", f"got {direction!r}; allowed: 1 or -1"))
        if reference not in ("before", "after"):
            problems.append(Problem("reference", f"got {reference!r}; allowed: 'before' or 'after'"))
        if problems:
            raise ParameterError(problems)
        self.kick, self.sign, self.budget, self.at = known[kick], float(direction), StepBudget(), at or ""
        most = known["impulse"].most if kick == "velocity" and at else self.kick.most
        if up_to is not None and not self.kick.low <= up_to <= most:
            allowed = f"{self.kick.low:g} to {most:g}"
            raise ParameterError([Problem("up_to", f"got {up_to!r}; allowed: {allowed} ({self.kick.size})")])
        self.up_to = up_to
        self.of_drive = not at and kick in ("velocity", "displacement")
        self.from_other = kick == "velocity" and reference == "after" and self.of_drive
        values = operating_point(rig, vary, branch=branch)
        refuse_many_inner(values.model, "kicks")
        if kick == "impulse" and not at and "slider.mass" not in values.named():
            raise NotAvailable(
                f"an impulse {NEEDS_MASS}; use a displacement or normal-stress kick, or give the slider a mass"
            )
        if values.model.imposed:
            raise NotAvailable("a rig whose normal stress is prescribed in time has no steady sliding to return to")
        self.size = max(values.size, 1)
        jobs = prepare(rig, None, 1.0, vary, {}, options_for(values.model, rtol), branch)
        if kick in ("force", "normal-force"):
            pushes, presses = ((self.at,), ()) if kick == "force" else ((), (self.at,))
            reduction = reduce_model(jobs.reduction.model, jobs.eliminate, pushes, presses)
            jobs = replace(jobs, targets=Targets(pushes, presses), reduction=reduction)
        self.jobs = jobs
        self.drive = np.broadcast_to(np.asarray(values.drive, dtype=float), (self.size,))
        self.rest = rest_of(self.jobs, self.drive, np.zeros(self.size))
        self.near = Neighbourhood(self.rest)
        self.exists = self.rest.exists & self.jobs.in_range
        self.neutral = self.exists & self.rest.neutral
        self.stable = (self.rest.stable | self.neutral) & np.broadcast_to(self.jobs.posed, (self.size,))
        self.unit_name, units, speeds = size_units(self.jobs, self.rest, kick, self.at)
        self.units, self.body_speed = (np.broadcast_to(one, (self.size,)) for one in (units, speeds))

    def limit_steps(self) -> None:
        """Limit the integration steps of all motions to those that one threshold may take."""
        structures, variables = inner_count(self.jobs.reduction.model), self.rest.state.shape[1]
        limit = (STEPS_OF_STRUCTURES, variables, 2) if structures else (STEPS, variables)
        self.budget = StepBudget.of(*limit)

    # -- sizes

    @property
    def highest(self) -> float:
        """Largest size that is searched: `up_to` or the default, but below sizes that stop or lift the body."""
        usual, stops = KICKS["impulse"].high if self._is_blow else self.kick.high, np.inf
        if self._is_blow:
            stops = largest_blow(self.jobs, self.at, self.sign * self.body_speed)
        elif self.sign < 0 and self.kick.name in ("normal-stress", "normal-force"):
            stops = 1.0
        return min(self.up_to or usual, 0.999 * stops)

    @property
    def _is_blow(self) -> bool:
        """True if the kick changes the velocity of a body suddenly (an impulse, or a velocity kick at a body)."""
        return self.kick.name == "impulse" or (self.kick.name == "velocity" and not self.of_drive)

    def amount(self, size: Any, which: Any = slice(None)) -> Array:
        """Signed amount of kicks in SI units: for a velocity step of the drive the new velocity, else the change."""
        size = np.asarray(size, dtype=float)
        with np.errstate(over="ignore"):
            if self.kick.name == "velocity" and self.of_drive:
                sign = -self.sign if self.from_other else self.sign
                return np.asarray(self.drive[which] * np.exp(sign * size))
            return np.asarray(self.sign * size * self.units[which])

    def size_of(self, amount: float) -> float:
        """Dimensionless size of an amount in SI units (for the first rig); negative if against `direction`."""
        if self.kick.name == "velocity" and self.of_drive:
            sign = -self.sign if self.from_other else self.sign
            return float(sign * np.log(amount / self.drive[0]))
        return float(self.sign * amount / self.units[0])

    # -- motions after kicks

    @property
    def moves_rest(self) -> bool:
        """True if the kick changes a constant input, so that steady sliding after the kick differs from that before."""
        if self.kick.name == "velocity":
            return self.of_drive and not self.from_other
        return self.kick.name in ("normal-stress", "normal-force", "force")

    def inputs(self, which: Array, sizes: Array) -> tuple[Array, Array, Array]:
        """Constant inputs (n,) each, SI units, after kicks: load-point velocity, added normal stress, force."""
        velocity, nothing = self.drive[which], np.zeros(len(which))
        if not self.moves_rest:
            return velocity, nothing, nothing
        amount = self.amount(sizes, which)
        if self.kick.name == "velocity":
            return amount, nothing, nothing
        return (velocity, nothing, amount) if self.kick.name == "force" else (velocity, amount, nothing)

    def rest_after(self, which: Array, sizes: Array) -> Rest:
        """The steady sliding that exists after kicks of `sizes` (n,) of the rigs with indices `which` (n,)."""
        if not self.moves_rest:
            return self.rest.part(which)
        return rest_of(self._jobs(which), *self.inputs(which, sizes))

    def may_return(self, which: Array, sizes: Array) -> Array:
        """True (n,) if stable or neutral steady sliding exists after kicks of `sizes` (n,)."""
        rest = self.rest_after(which, sizes)
        return np.asarray(rest.exists & (rest.stable | rest.neutral))

    def runs(self, which: Array, sizes: Array, effort: float = 1.0) -> MotionBatch:
        """Prepared motions, not simulated yet, of the rigs with indices `which` (n,) after kicks of `sizes` (n,)."""
        jobs, amount = self._jobs(which), self.amount(sizes, which)
        if self.moves_rest:
            rest = self.rest_after(which, sizes)
            near, group = Neighbourhood(rest), np.arange(len(which))
        else:
            self.near.computed(np.unique(which))
            rest, near = self.rest.part(which), self.near.part(which)
            _, one, back = np.unique(which, return_index=True, return_inverse=True)
            group = one[back]
        if self.from_other:
            jobs = self._started_at(jobs, amount)
        if self._is_blow:
            jobs = self._struck(jobs, self.sign * np.asarray(sizes) * self.body_speed[which], which)
        if self.kick.name == "displacement" and not self.of_drive:
            jobs = self._started(jobs, {f"{self.at}.x": amount})
        jumps = self.kick.name == "displacement" and self.of_drive
        jump = amount if jumps else np.zeros(len(which))
        return MotionBatch(jobs, rest, near, jump, group, effort, self.budget)

    def outcomes(
        self, which: Array, sizes: Array, threads: int | None = None,
        advanced: Callable[[int], None] | None = None, effort: float = PATIENCE,
    ) -> Array:  # fmt: skip
        """Simulate kicks of `sizes` (n,) of rigs `which` (n,), and return their outcomes as indices into `OUTCOMES`."""
        return outcomes_of(self.runs(which, sizes, effort), threads, advanced)

    def contacts(self, which: Array, sizes: Array, threads: int | None = None) -> Array:
        """Names (n,) of the contacts that lose contact or blow up after each kick; empty for other outcomes."""
        runs = replace(self.runs(which, sizes), budget=StepBudget())  # no limit of steps: the motions end
        return contacts_of(runs, np.arange(len(which)), threads)

    def _jobs(self, which: Array) -> Jobs:
        """Simulation jobs of the rigs with indices `which`, which start in the rigs' steady sliding."""
        return replace(
            self.jobs, point=self.jobs.point.part(which), initial=picked(self.jobs.initial, which),
            velocity=picked(self.jobs.velocity, which), size=len(which),
        )  # fmt: skip

    def _started_at(self, jobs: Jobs, velocity: Array) -> Jobs:
        """The jobs with their initial state replaced by steady sliding at the load-point `velocity` (m/s)."""
        nothing = np.zeros(len(velocity))
        before = rest_of(jobs, velocity, nothing)
        inputs = velocity, nothing, nothing
        initial, near = continuous_at(jobs.reduction, jobs.point, before.state, inputs, before.unknowns)
        return replace(jobs, initial=initial, near=near)

    def _struck(self, jobs: Jobs, change: Array, which: Array) -> Jobs:
        """The jobs with `change` added to the initial velocity of the kicked body: `at`, or the block of a slider."""
        if not self.at:
            return self._started(jobs, {"v": self.drive[which] + change})
        return self._started(jobs, struck(jobs.point, self.at, change))

    def _started(self, jobs: Jobs, given: Mapping[str, Any]) -> Jobs:
        """The jobs with the initial values of some variables replaced by those in `given` (SI units, by name)."""
        initial, speed = initial_values(jobs.reduction, jobs.point, given)
        return replace(jobs, initial=initial, velocity=speed)
