"""The compiled model of an experiment: parameters in, what the record should show and its derivatives out."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.kernels.experiment import LANES, experiment_program
from steadyslip.kernels.layout import Setting
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.scales import scale_rows
from steadyslip.motion.engine import run_many
from steadyslip.motion.jobs import automatic_method

LOOSE = 1e-4  # error allowed in sensitivities: they steer the search, they are not its result
LOOK = 0.3  # of the work of a step: to look up what is observed at a sample
SIZES = (6, 8, 12)  # directions that kernels are made for: few kernels serve fits with any number of parameters
RICHER = 0.025  # more patience for each parameter: what a simpler model can follow, a richer one can
LEAST_STEPS = 100  # that a motion is given
_STEP = 1e-6  # of the central difference through an axis at an angle, where k follows from other parameters


@dataclass(frozen=True, eq=False)
class InputTable:
    """Inputs of an experiment, as the kernels take them.

    Attributes
    ----------
    segments : ndarray (jobs or 1, k, 9 or more)
        Start, end, jump of the load point, values and slopes of load-point velocity, disturbance and added normal
        stress.
    times : ndarray (samples,)
        When friction is observed, on the clock of the rows.
    node_rates : ndarray (jobs or 1, directions or 0, k)
        How the start of each row moves in each direction.
    input_rates : ndarray (jobs or 1, directions or 0, k, 3)
        How the inputs at given times change in it.
    """

    segments: Array
    times: Array
    node_rates: Array = field(default_factory=lambda: np.zeros((1, 0, 0)))
    input_rates: Array = field(default_factory=lambda: np.zeros((1, 0, 0, 3)))

    def part(self, rows: Array | slice) -> InputTable:
        """That of some jobs."""

        def own(array: Array) -> Array:
            return array if len(array) == 1 else np.ascontiguousarray(array[rows])

        return InputTable(own(self.segments), self.times, own(self.node_rates), own(self.input_rates))

    def with_inputs(self, count: int) -> InputTable:
        """Table for a kernel with so many inputs; those that it does not have are zero."""
        known = (self.segments.shape[2] - 3) // 2
        if known == count:
            return self
        head, values, slopes = np.split(self.segments, [3, 3 + known], axis=2)
        values, slopes, rates = (
            np.concatenate([one, np.zeros((*one.shape[:-1], count - known))], axis=-1)
            for one in (values, slopes, self.input_rates)
        )
        return InputTable(np.concatenate([head, values, slopes], axis=2), self.times, self.node_rates, rates)

    def along(self, part: slice, size: int) -> InputTable:
        """That of some directions, filled up to as many as a kernel has."""
        rates = [
            _padded(array[:, part], size) if array.shape[1] else array for array in (self.node_rates, self.input_rates)
        ]
        return InputTable(self.segments, self.times, *rates)


def _padded(array: Array, size: int) -> Array:
    """Further directions in which nothing changes, up to a number of them."""
    if array.shape[1] == size:
        return np.ascontiguousarray(array)
    missing = np.zeros((array.shape[0], size - array.shape[1], *array.shape[2:]))
    return np.concatenate([array, missing], axis=1)


@lru_cache(maxsize=64)
def _point_of(rig: Slider, names: tuple[str, ...]) -> OperatingPoint:
    """Where a rig is, some of its parameters as arrays."""
    return operating_point(rig, {name: np.array([float(rig.parameters()[name].value or 0.0)]) for name in names})


class Forward:
    """Runs an experiment for many sets of parameters at once.

    Parameters
    ----------
    rig : Slider
    names : sequence of str
        Full dotted names of the parameters that vary.
    rtol : float
        Error allowed per step.
    shifts : int
        How many free times of the table there are besides.
    unsettled : sequence of str
        Which of `ExperimentProgram.unsettled` are free as well: their directions come last.
    sensitive : bool
        Whether derivatives are wanted.
    effort : Effort, optional
        What running may cost.
    """

    def __init__(
        self, rig: Slider, names: Sequence[str], rtol: float = 1e-7, shifts: int = 0, unsettled: Sequence[str] = (),
        sensitive: bool = True, effort: Effort | None = None,
    ) -> None:  # fmt: skip
        self.rig, self.names, self.rtol, self.shifts, self.unsettled = rig, tuple(names), rtol, shifts, tuple(unsettled)
        self.effort = effort or Effort()
        self.slowest = np.inf  # steps of a motion that came to its end
        self._base = _point_of(rig, self.names)
        self.model = self._base.model
        reduction = experiment_program(self.model, 0, "tsit5").reduction
        self.directions = len(names) + shifts + len(unsettled) if sensitive else 0
        self.size = next((n for n in (0, *SIZES) if n >= self.directions), SIZES[-1])
        self.program = experiment_program(self.model, self.size, automatic_method(reduction), not unsettled)

    def values(self, parameters: Array) -> OperatingPoint:
        """The model's parameters for rows of the free ones, (jobs, names)."""
        varied = {name: parameters[:, i] for i, name in enumerate(self.names)}
        if self.rig.axial_stiffness is not None:  # k follows from other parameters
            return operating_point(self.rig, varied)
        named = self._base.named() | varied
        return self._base.with_arguments(named.values(), (len(parameters),))

    @cached_property
    def _entries(self) -> Array:
        """Which parameters of the model, and where it begins, each direction changes: (directions, all)."""
        order = {name: i for i, name in enumerate(self.model.parameters)}
        begins = {name: len(order) + i for i, name in enumerate(self.program.unsettled)}
        found = np.zeros((-(-self.directions // max(self.size, 1)) * self.size, len(order) + len(begins)))
        if not self.directions:
            return found
        for i, name in enumerate(self.unsettled, start=self.directions - len(self.unsettled)):
            found[i, begins[name]] = 1.0
        for i, name in enumerate(self.names):
            if name in order:
                found[i, order[name]] = 1.0
        return found

    def _chain(self, parameters: Array, units: Array) -> Array:
        """How the model's parameters and where it begins change with the free ones; zero in directions to spare."""
        chain = np.tile(self._entries, (len(parameters), 1, 1))
        if not self.directions:
            return chain
        if self.rig.axial_stiffness is not None and "slider.stiffness" not in self.names:
            stiffness = list(self.model.parameters).index("slider.stiffness")
            for i, name in enumerate(self.names):
                if name == "slider.axial_stiffness" or name.startswith("contact."):
                    chain[:, i, stiffness] = self._stiffness_slope(parameters, i)
        chain[:, : len(self.names)] *= units[:, :, None]
        return chain

    def _stiffness_slope(self, parameters: Array, i: int) -> Array:
        step = _STEP * (np.abs(parameters[:, i]) + 1e-3)
        ends = []
        for sign in (1.0, -1.0):
            moved = parameters.copy()
            moved[:, i] += sign * step
            ends.append(np.asarray(self.values(moved).named()["slider.stiffness"], dtype=float))
        slope: Array = (ends[0] - ends[1]) / (2 * step)
        return slope

    def run(self, table: InputTable, parameters: Array, units: Array, begin: Array | None = None) -> Array:
        """The friction coefficient that would be observed.

        Parameters
        ----------
        table : InputTable
            Its shifts as many as given to the constructor.
        parameters : ndarray (jobs, names)
        units : ndarray (jobs, names)
            Change of each parameter that its derivative refers to.
        begin : ndarray (jobs, unsettled), optional
            How far from steady sliding the motion begins.

        Returns
        -------
        ndarray (jobs, 1 + directions, samples)
            Friction, then its derivatives; NaN from where a motion cannot be continued, or where there is no
            steady sliding to start from.
        """
        table = table.with_inputs(len(self.program.reduction.channels))
        values = self.values(parameters)
        chain = self._chain(parameters, units)
        away = np.zeros((len(parameters), len(self.program.unsettled)))
        if begin is not None:
            away[:, [list(self.program.unsettled).index(name) for name in self.unsettled]] = begin
        if self.directions <= self.size:
            own = table.along(slice(self.directions), self.size) if self.directions else table
            return self._run(own, values, chain, away)[:, : 1 + self.directions]
        parts = [slice(k, k + self.size) for k in range(0, self.directions, self.size)]
        found = [self._run(table.along(part, self.size), values, chain[:, part], away) for part in parts]
        return np.concatenate([found[0], *(more[:, 1:] for more in found[1:])], axis=1)[:, : 1 + self.directions]

    def _run(self, table: InputTable, values: OperatingPoint, chain: Array, away: Array) -> Array:
        """One pass, with as many directions as the kernel has."""
        jobs, sigma = len(chain), values.stresses
        constants, start = self.program.arrays(values, chain, away)
        settings = self._settings(table, values, jobs)
        good = (sigma > 0) & np.all(np.isfinite(constants), axis=1) & np.all(np.isfinite(start), axis=1)
        seen = np.full((jobs, 1 + chain.shape[1], len(table.times)), np.nan)
        steps = self.steps = np.zeros((jobs, 2))
        if not np.all(good):
            constants, start, settings, table = constants[good], start[good], settings[good], table.part(good)
        found, taken = (seen, steps) if np.all(good) else (seen[good], steps[good])

        def work(first: int, last: int, _: threading.Event | None = None) -> None:
            part = slice(first, last)
            own = table.part(part)
            self.program.through_table(
                constants[part], start[part], settings[part], own.segments, own.times, own.node_rates,
                own.input_rates, found[part], taken[part],
            )  # fmt: skip

        if len(found) <= LANES:
            work(0, len(found))
        elif not run_many(work, len(found), self.effort.threads, LANES, lanes=LANES):
            raise KeyboardInterrupt  # half of the runs would pass for runs that failed
        self.effort.budget.spend(np.sum(taken, axis=1) + LOOK * len(table.times), 1 + chain.shape[1])
        if self.effort.growth < np.inf:
            ended = np.sum(taken[np.isfinite(found[:, 0, -1])], axis=1)
            if len(ended):
                known = self.slowest if self.slowest < np.inf else 0.0
                self.slowest = max(known, float(np.max(ended)))
        if found is not seen:
            seen[good] = found
        return seen

    def _settings(self, table: InputTable, values: OperatingPoint, jobs: int) -> Array:
        """Rows of settings, absolute tolerances of state and sensitivities last."""
        scales, unknown = scale_rows(values, self.program.reduction)
        size = scales.shape[1]
        settings = np.zeros((jobs, Setting.ATOL + size * (1 + self.size)))
        settings[:, Setting.RTOL] = self.rtol
        settings[:, Setting.Z_SCALE] = unknown
        richer = 1 + RICHER * (len(self.names) + self.shifts + len(self.unsettled))
        most = int(self.effort.patience * richer * len(table.times)) + 1000
        settings[:, Setting.MOST_STEPS] = min(most, max(self.effort.growth * self.slowest, LEAST_STEPS))
        settings[:, Setting.FIRST_STEP] = np.inf
        settings[:, Setting.ATOL : Setting.ATOL + size] = self.rtol * scales
        settings[:, Setting.ATOL + size :] = np.tile(LOOSE * scales, self.size)
        return settings
