"""Integrate the motion over given times, with its derivatives in the starting state and one parameter.

Cycles are fixed points of this map. Inputs are constant: `FlowRunner` takes inputs and rig from prepared `Jobs`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.layout import Final, Recorded, Sampled, Setting
from steadyslip.kernels.runner import LOG_KINDS, SETTINGS, Runner, runner
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import Reduction
from steadyslip.model.scales import natural_scales, shortest_time
from steadyslip.model.start import restored_of
from steadyslip.model.variational import with_sensitivities
from steadyslip.motion.engine import INTERRUPTED, Call, Outcome, run_tables
from steadyslip.motion.jobs import Jobs, Options, automatic_method
from steadyslip.motion.observe import observe
from steadyslip.motion.single import areas as areas_of
from steadyslip.motion.status import BLOWN_UP, LOST, WORDS, ending_contact
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.inner_coordinates import refuse_many_inner
from steadyslip.protocol.segments import Segments

DONE = WORDS.index("done")
NEVER = np.empty(0)
STIFF = "rodas5p"  # Rosenbrock method of order 5, as tolerances are tight
MOST_STEPS = 100_000  # limit of integration steps of one run: some tenths of a second
FAR_MORE, FEW_STEPS = 20, 5_000  # limit of steps of a run: FAR_MORE times those of the last run, at least FEW_STEPS
MORE = 8  # used instead of FAR_MORE for a run close to a known run
QUICKER = 4  # assumed ratio of the times of a step with and without sensitivities: that of machines with three bodies
HARDLY_HEARD = 1e6  # factor on the tolerances of sensitivities with which they hardly affect step sizes
UNHEARD = 1e12  # factor on the tolerances of sensitivities with which they do not affect step sizes
NEIGHBOURHOOD = 0.05  # relative change of the parameter within which tolerances are reused
KINDS_EACH = len(LOG_KINDS) - 2  # number of event kinds at one contact


class FlowFailure(Failure):
    """Error: an integration stopped before its end.

    `status` is the reason, one of `steadyslip.motion.status.WORDS`; `contact` is the contact of a machine concerned.
    """

    def __init__(self, status: str, contact: str = "") -> None:
        self.status, self.contact = status, contact
        super().__init__(f"a run ended with: {self.place}")

    @property
    def place(self) -> str:
        """Text of the status; for machines the contact concerned follows it."""
        return f"{self.status} at {self.contact}" if self.contact else self.status


@cached
def _with_sensitivities(reduction: Reduction, method: str) -> Runner:
    """Compiled equations of motion with their variational equations (cached)."""
    return Runner(with_sensitivities(reduction), Choice(method, dense=False))


@cached
def _slip_shares(reduction: Reduction, contact: int) -> ArrayFunction:
    """Derivatives of slip at a contact in each state variable, and steady slip rate over drive velocity (cached)."""
    sliding = reduction.slidings[contact]
    return reduction.model.function([*(derivative(sliding.slip, s) for s in reduction.state), sliding.ratio])


@dataclass(frozen=True, eq=False)
class FlowSetting:
    """A rig at one value of the free parameter, in the form that kernels need.

    Attributes
    ----------
    value, unit : float
        The parameter (SI units), and the change of it to which derivatives refer.
    point : OperatingPoint
        Arrays of length 1.
    inputs : ndarray (3,)
        Load-point velocity (m/s), disturbance and added normal stress (Pa); of machines also in rad/s, N and N m.
    slip : ndarray (n,)
        Derivatives of slip (m) at the watched contact in the state variables.
    speed : float
        Slip rate of the watched contact in steady sliding, m/s.
    plain, varied : tuple of ndarray
        Constants and settings (one row each) of the plain kernel, and of the kernel with sensitivities.
    """

    value: float
    unit: float
    point: OperatingPoint
    inputs: Array
    slip: Array
    speed: float
    plain: tuple[Array, Array]
    varied: tuple[Array, Array]


class FlowRunner:
    """Integrates one rig under constant inputs.

    Parameters
    ----------
    jobs : Jobs
        Prepared runs, with one segment each.
    which : int, optional
        Index of the run whose rig and inputs are used.
    rtol : float, optional
        Relative error allowed per step; by default 1e-10 for explicit methods, 1e-9 for Rosenbrock methods, 1e-8 if
        `costly`.
    contact : int, optional
        Index of the watched contact: a cycle begins where its slip, accelerating, passes the steady slip rate.

    Attributes
    ----------
    noise : float
        Smallest absolute error, in natural sizes, that integration can attain.
    size : int
        Number of state variables n.
    scales : ndarray (n,)
        Natural sizes of the state variables, at the rig's own parameter.
    time : float
        Natural time, s.
    steps : int
        Integration steps so far, in equivalents of steps with sensitivities.
    rounding : float
        Error of a state by rounding of forces, in natural sizes; 0 if unknown.
    costly : bool
        True for machines with mass, whose sensitivities take ten to a hundred times as long as the motion alone.
    slack : float
        Factor on the tolerances of sensitivities: above 1 the error of the motion decides step sizes.

    Raises
    ------
    NotAvailable
        If the rig is pressed by a force prescribed in time.
    """

    def __init__(self, jobs: Jobs, which: int = 0, rtol: float | None = None, contact: int = 0) -> None:
        if jobs.point.model.imposed:
            raise NotAvailable("a rig whose normal stress is prescribed in time has no cycles of its own")
        refuse_many_inner(jobs.point.model, "cycles")
        self.reduction, self.size, self.contact = jobs.reduction, len(jobs.reduction.state), contact
        method = automatic_method(self.reduction)
        self.stiff = method != "tsit5"
        method = STIFF if self.stiff else method
        self.costly = self.stiff and not self.reduction.model.is_single
        usual = 1e-8 if self.costly else 1e-9 if self.stiff else 1e-10
        self.options = Options(rtol=rtol or usual, most_steps=MOST_STEPS)
        self.base, self.which = replace(jobs, options=self.options), which
        self.noise = 1e-13 if self.stiff else 1e-16
        self.finest = self.noise / self.options.rtol
        self.machine = runner(
            self.reduction.model, Choice(method), jobs.eliminate, jobs.targets.pushes, jobs.targets.presses
        )
        self.sensitive = _with_sensitivities(self.reduction, method)
        self.steps, self._usual, self.last_step = 0, MOST_STEPS, math.inf
        self.slack = HARDLY_HEARD if self.costly else 1.0
        self.far_more = FAR_MORE
        self.rounding = 0.0
        self._near: tuple[float, Array] = (0.0, np.empty((0, 0)))
        own = jobs.point.part(slice(which, which + 1))
        inputs = jobs.segments.value[which if len(jobs.segments.value) > 1 else 0, 0]
        self.own = self._set(own, inputs)
        self.scales = self.own.plain[1][0, self.tolerances] / self.options.rtol
        self.time = self._natural_time()

    @property
    def led(self) -> bool:
        """True if the error of the motion, and not that of the sensitivities, decides step sizes."""
        return self.slack > 1.0

    @property
    def tolerances(self) -> slice:
        """Slice of the kernel settings that holds the absolute tolerances of the state."""
        return slice(Setting.ATOL, Setting.ATOL + self.size)

    @property
    def natural_slip(self) -> float:
        """Natural size of slip at the watched contact, m."""
        shares = np.abs(self.own.slip) > 0
        return float(np.min(self.scales[shares] / np.abs(self.own.slip[shares])))

    def _natural_time(self) -> float:
        """Natural time of the rig, s."""
        if self.reduction.model.is_single:
            return self.natural_slip / self.own.speed
        return float(np.ravel(shortest_time(natural_scales(self.own.point, self.reduction)[0]))[0])

    # -- one rig

    def setting(self, value: float) -> FlowSetting:
        """Kernel tables of the rig; `value` is ignored, as there is no free parameter."""
        return self.own

    def _set(
        self, point: OperatingPoint, inputs: Array, value: float = 0.0, unit: float = 1.0,
        rates: tuple[Array, Mapping[sp.Symbol, Array]] | None = None,
    ) -> FlowSetting:  # fmt: skip
        """Kernel tables of the rig at an operating point, with inputs (3,).

        `rates` are derivatives of the constants and inputs with respect to the free parameter, per `unit` of it.
        """
        constants = self.machine.constants(point)
        settings = self._settings_at(point, value)
        scales, behind = settings[0, self.tolerances], self.tolerances.stop
        ratio = (scales[None, :] / scales[:, None] * self.options.rtol).ravel()  # S column by column
        varied = np.concatenate([settings[0, :behind], ratio, scales, settings[0, behind:]])[None]
        found = self.sensitive.constants(point)
        varying = self.sensitive.kernel.constants.with_rates(found, *(rates or (np.zeros((1, 1, found.shape[1])), {})))
        slip = [float(np.ravel(share)[0]) for share in point.evaluate(_slip_shares(self.reduction, self.contact))]
        speed = float(inputs[0]) * slip.pop()
        return FlowSetting(
            value, unit, point, inputs, np.array(slip), speed, (constants, settings), (varying, varied)
        )  # fmt: skip

    def _settings_at(self, point: OperatingPoint, value: float) -> Array:
        """Kernel settings (tolerances, natural sizes) at a parameter value, cached within `NEIGHBOURHOOD` of it."""
        at, settings = self._near
        if not len(settings) or abs(value - at) > NEIGHBOURHOOD * abs(at):
            jobs = replace(self.base, point=point)
            settings = jobs.tables(self.machine, self.which, self.which + 1, True, True)[2]
            self._near = value, settings
        return settings

    # -- runs

    def begin_motion(self) -> None:
        """Reset the limit of steps, because the next run is of another motion, which may be far longer."""
        self._usual = MOST_STEPS

    def run(
        self, setting: FlowSetting, states: Array, times: Array, amplitude: float = 1.0
    ) -> tuple[Array, Array, Array]:
        """Integrate with sensitivities from `states` (m, n) over `times` (m,), s.

        Returns
        -------
        ends : ndarray (m, n)
            Final states.
        sensitivities : ndarray (m, n, n)
            Derivatives of the final states in the starting states.
        slopes : ndarray (m, n)
            Derivatives of the final states in the parameter, per ``setting.unit``.
        """
        count, n = len(states), self.size
        initial = np.hstack([self._continuous(setting, states), self._unit(count)])
        try:
            final = self._advanced(setting, self._sensitive_settings(setting, amplitude), initial, times)
        except FlowFailure as failure:
            if failure.status != "too many steps" or not self.stiff or self.slack == UNHEARD:
                raise
            usual, self.slack = self.slack, UNHEARD
            try:
                final = self._advanced(setting, self._sensitive_settings(setting, amplitude), initial, times)
            except FlowFailure:  # the motion alone needs as many steps: mostly at a point far from the curve
                self.slack = usual
                raise
        matrix = final[:, n : n + n * n].reshape(count, n, n).transpose(0, 2, 1)
        return final[:, :n], matrix, final[:, n + n * n :]

    def ends(self, setting: FlowSetting, states: Array, times: Array, amplitude: float = 1.0) -> Array:
        """Final states (m, n) of runs from `states` (m, n) over `times` (m,), s, without sensitivities."""
        initial = self._continuous(setting, states)
        return self._advanced(setting, self._finer(setting.plain[1], amplitude), initial, times, self.machine)

    def _sensitive_settings(self, setting: FlowSetting, amplitude: float) -> Array:
        """Settings of the kernel with sensitivities.

        With `slack` above 1 the error of the sensitivities is not controlled: fast, little damped modes of frames, at
        rest in the motion itself, oscillate in the sensitivities and would need tiny steps. Rosenbrock methods damp
        modes that they step over, and the result is the derivative of the discrete steps.
        """
        settings, n, behind = self._finer(setting.varied[1], amplitude), self.size, self.tolerances.stop
        settings[:, SETTINGS.index("most_steps")] = min(MOST_STEPS, max(FEW_STEPS, self.far_more * self._usual))
        settings[:, behind : behind + n * n + n] *= self.slack
        return settings

    def _unit(self, count: int) -> Array:
        """Initial sensitivities of `count` runs: unit matrix in the state, zero in the parameter."""
        return np.tile(np.append(np.eye(self.size).ravel(), np.zeros(self.size)), (count, 1))

    def _finer(self, settings: Array, amplitude: float) -> Array:
        """Kernel settings with absolute tolerances reduced in proportion to `amplitude`, if that is small."""
        finer = settings.copy()
        finer[:, self.tolerances] *= max(min(1.0, amplitude), self.finest)
        finer[:, SETTINGS.index("watch")] = finer[:, SETTINGS.index("record")] = 0.0
        return finer

    def _continuous(self, setting: FlowSetting, states: Array) -> Array:
        """Continuous variables (m, n) that the kernel integrates, from states (m, n)."""
        found = setting.point.evaluate(restored_of(self.reduction), *states.T, *setting.inputs, 0.0)
        return np.column_stack(np.broadcast_arrays(*(np.atleast_1d(c) for c in found)))

    def _advanced(
        self, setting: FlowSetting, settings: Array, initial: Array, times: Array, machine: Runner | None = None
    ) -> Array:
        """Final values with sensitivities, or without if a plain `machine` is given; raises FlowFailure."""
        self._refuse_more()
        constants = (setting.plain if machine else setting.varied)[0]
        tables = (constants, np.ascontiguousarray(initial), settings, _rows(setting.inputs, times))
        call = Call(machine or self.sensitive, tables, len(times), np.empty(0))
        call.run_steps(2**62)
        outcome = call.outcome()
        taken = np.nansum(outcome.steps, axis=1)
        self.steps += int(taken.sum()) // (QUICKER if machine else 1)
        if np.any(call.status != DONE):
            raise self._failure(setting, outcome, int(np.flatnonzero(call.status != DONE)[0]))
        self._usual = self._usual if machine else int(taken.max())
        return outcome.state

    def _refuse_more(self) -> None:
        """Raise FlowFailure if all integration steps are used up."""
        if self.steps >= self.last_step:
            raise FlowFailure("too many steps")

    def field(self, setting: FlowSetting, states: Array) -> tuple[Array, Array, Array]:
        """Time derivatives (m, n) of states (m, n), their Jacobian (m, n, n) and derivative in the parameter (m, n)."""
        count, n = len(states), self.size
        further = max(len(self.reduction.unknowns) - 1, 0)
        open_ = np.full((count, 1), np.nan)
        full = np.hstack([open_, states, self._unit(count), np.repeat(open_, further, axis=1)])
        inputs = np.zeros((count, 7))
        inputs[:, :3] = setting.inputs
        values = np.empty((count, full.shape[1] - Sampled.STATE - further))
        own = np.zeros(count, dtype=np.int64)
        self.sensitive.code.field(*setting.varied, full, inputs, own, values)
        matrix = values[:, n : n + n * n].reshape(count, n, n).transpose(0, 2, 1)
        return values[:, :n], matrix, values[:, n + n * n :]

    def watched(
        self, setting: FlowSetting, state: Array, time: float, amplitude: float = 1.0, times: Array = NEVER,
        unknowns: Array | None = None,
    ) -> Outcome:  # fmt: skip
        """Integrate once without sensitivities, with events, all steps, and samples at given times.

        `unknowns` (u,) are the solutions of the algebraic equations at `state`, NaN where they are not known.

        Raises
        ------
        FlowFailure
            If the run stops before its end.
        KeyboardInterrupt
            If it was interrupted.
        """
        self._refuse_more()
        initial = self._continuous(setting, state[None])
        settings = self._finer(setting.plain[1], amplitude)
        settings[:, SETTINGS.index("watch")] = settings[:, SETTINGS.index("record")] = 1.0
        behind = self.tolerances.stop
        for k, known in enumerate([] if unknowns is None else unknowns):
            if np.isfinite(known):
                settings[:, Setting.GUESS if k == 0 else behind + k - 1] = known
        tables = (*setting.plain[:1], initial, settings, _rows(setting.inputs, np.array([time])))
        outcome = run_tables(self.machine, tables, times)
        self.steps += int(np.nansum(outcome.steps)) // QUICKER
        if outcome.status[0] == INTERRUPTED:
            raise KeyboardInterrupt
        if outcome.status[0] != DONE:
            raise self._failure(setting, outcome, 0)
        return outcome

    def _failure(self, setting: FlowSetting, outcome: Outcome, row: int) -> FlowFailure:
        """FlowFailure of one run that stopped early, with the contact concerned."""
        status = WORDS[int(outcome.status[row])]
        names = [contact.name for contact in self.reduction.model.contacts]
        end = np.hstack([outcome.point[row, : 1 + self.size], outcome.point[row, 1 + outcome.size :]])[None]
        if not names[0] or status not in (LOST, BLOWN_UP):
            return FlowFailure(status)
        seen = self.observed(setting, outcome.final[row, [Final.TIME]], end)
        stresses, rates = ([seen[f"{name}.{what}"] for name in names] for what in ("normal_stress", "slip_rate"))
        return FlowFailure(status, names[int(ending_contact(setting.point, status, stresses, rates)[0])])

    def observed(self, setting: FlowSetting, times: Array, points: Array) -> dict[str, Array]:
        """All observables (m,), by name, at times (m,), s, and points (m, 1 + n) of a run."""
        rows = _rows(setting.inputs, np.array([float(times[-1]) or 1.0]))[0]
        waves = np.zeros((1, 1, 3, 0))
        segments = Segments(
            rows[None, :, 0], rows[None, :, 1], rows[None, :, 2], rows[None, :, 3:6], rows[None, :, 6:9],
            waves, waves, waves,
        )  # fmt: skip
        jobs = replace(self.base, point=setting.point, segments=segments)
        zero = np.zeros(len(times), dtype=int)
        return observe(jobs, self.machine, 0, zero, zero, times, points)

    def speeds(self, setting: FlowSetting, outcome: Outcome) -> Array:
        """Slip rates at the watched contact (m/s), at events and at the solver's steps."""
        return self.at_contacts(setting, outcome)[self.contact][0]

    def at_contacts(self, setting: FlowSetting, outcome: Outcome) -> list[tuple[Array, Array, Array]]:
        """Slip rate (m/s), normal and spring stress (Pa, machines: N) of each contact, at events and solver steps."""
        record, log = outcome.recorded, outcome.log
        seen = self.observed(setting, record[:, Recorded.TIME], record[:, Recorded.POINT :])
        contacts = self.reduction.model.contacts
        if not contacts[0].name:
            v, sigma, pull = seen["v"], seen["normal_stress"], seen["spring_stress"]
            return [(np.append(log[:, 2], v), np.append(log[:, 3], sigma), np.append(log[:, 5], pull))]
        found = []
        areas = setting.point.evaluate(areas_of(self.reduction.model))
        for i, (contact, area) in enumerate(zip(contacts, areas, strict=True)):
            here = log[(log[:, 0] - 1) // KINDS_EACH == i]
            size, own = float(np.ravel(area)[0]), f"{contact.name}."
            v = np.append(here[:, 2], seen[f"{own}slip_rate"])
            sigma, pull = (
                size * np.append(here[:, k], seen[own + name])
                for k, name in ((3, "normal_stress"), (5, "spring_stress"))
            )
            found.append((v, sigma, pull))
        return found


def states_between(runs: FlowRunner, setting: FlowSetting, record: Array, at: Array) -> Array:
    """States (m, n) at times `at` (m,), s, from recorded steps by cubic Hermite interpolation."""
    time, states = record[:, Recorded.TIME], record[:, Recorded.STATE : Recorded.STATE + runs.size]
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = (time[i + 1] - time[i])[:, None]
    s = (at - time[i])[:, None] / h
    rates = runs.field(setting, states[np.append(i, i + 1)])[0]
    first, last = rates[: len(i)] * h, rates[len(i) :] * h
    value = states[i] * (1 + 2 * s) * (1 - s) ** 2 + states[i + 1] * s**2 * (3 - 2 * s)
    return np.asarray(value + first * s * (1 - s) ** 2 - last * s**2 * (1 - s))


def passages(runs: FlowRunner, setting: FlowSetting, record: Array) -> tuple[Array, Array]:
    """Times (s) at which slip, accelerating, passes the load point's velocity, and its acceleration there (m/s²).

    Both by linear interpolation between recorded steps.
    """
    time, states = record[:, Recorded.TIME], record[:, Recorded.STATE : Recorded.STATE + runs.size]
    ahead = runs.field(setting, states)[0] @ setting.slip
    i = np.flatnonzero((ahead[:-1] < 0) & (ahead[1:] > 0) & (np.diff(time) > 0))
    slopes = (ahead[i + 1] - ahead[i]) / (time[i + 1] - time[i])
    return time[i] - ahead[i] / slopes, slopes


def _rows(inputs: Array, times: Array) -> Array:
    """Kernel table (m, 1, 9) of one segment of constant inputs for each run, of durations `times` (m,), s."""
    rows = np.zeros((len(times), 1, 9))  # start, end, jump, values, slopes
    rows[:, 0, 1] = times
    rows[:, 0, 3:6] = inputs
    return rows
