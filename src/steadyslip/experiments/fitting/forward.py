"""Compiled model of an experiment: friction coefficient at the samples and its derivatives by the parameters."""

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

SENSITIVITY_RTOL = 1e-4  # relative tolerance of derivatives, which guide the search but do not affect its result
SAMPLE_WORK = 0.3  # work of interpolating friction at one sample, in integration steps
SIZES = (6, 8, 12)  # numbers of derivatives for which models are compiled: few compiled models serve all fits
STEPS_PER_DIRECTION = 0.025
"""Relative increase of the allowed steps for each derivative: a model with more parameters must complete the motions of
models that are nested in it."""
MIN_STEPS = 100  # number of steps that every motion may take at least
_STEP = 1e-6  # relative step of central differences (error about 1e-10) for k if it follows from other parameters


@dataclass(frozen=True, eq=False)
class InputTable:
    """Input table of an experiment, in the layout that the compiled models read.

    Attributes
    ----------
    segments : ndarray (jobs or 1, k, 9 or more)
        Rows of start (s), end (s), jump of the load point (m), then values and slopes of load-point velocity (m/s),
        disturbance and added normal stress (Pa).
    times : ndarray (samples,)
        Times at which friction is observed, s, on the same clock as `segments`.
    node_rates : ndarray (jobs or 1, directions or 0, k)
        Derivative of the start of each row by each direction (free parameter).
    input_rates : ndarray (jobs or 1, directions or 0, k, 3)
        Derivatives of the inputs at fixed times by each direction.
    """

    segments: Array
    times: Array
    node_rates: Array = field(default_factory=lambda: np.zeros((1, 0, 0)))
    input_rates: Array = field(default_factory=lambda: np.zeros((1, 0, 0, 3)))

    def for_jobs(self, rows: Array | slice) -> InputTable:
        """Table with only the jobs that `rows` selects."""

        def own(array: Array) -> Array:
            return array if len(array) == 1 else np.ascontiguousarray(array[rows])

        return InputTable(own(self.segments), self.times, own(self.node_rates), own(self.input_rates))

    def with_inputs(self, count: int) -> InputTable:
        """Table for a compiled model with `count` inputs; inputs that this table lacks are zero."""
        known = (self.segments.shape[2] - 3) // 2
        if known == count:
            return self
        head, values, slopes = np.split(self.segments, [3, 3 + known], axis=2)
        values, slopes, rates = (
            np.concatenate([one, np.zeros((*one.shape[:-1], count - known))], axis=-1)
            for one in (values, slopes, self.input_rates)
        )
        return InputTable(np.concatenate([head, values, slopes], axis=2), self.times, self.node_rates, rates)

    def for_directions(self, part: slice, size: int) -> InputTable:
        """Table with the directions `part`, padded with zeros to the `size` directions of a compiled model."""
        rates = [
            _padded_directions(array[:, part], size) if array.shape[1] else array
            for array in (self.node_rates, self.input_rates)
        ]
        return InputTable(self.segments, self.times, *rates)


def _padded_directions(array: Array, size: int) -> Array:
    """Array padded with zeros along the direction axis (1) to `size`."""
    if array.shape[1] == size:
        return np.ascontiguousarray(array)
    missing = np.zeros((array.shape[0], size - array.shape[1], *array.shape[2:]))
    return np.concatenate([array, missing], axis=1)


@lru_cache(maxsize=64)
def _point_of(rig: Slider, names: tuple[str, ...]) -> OperatingPoint:
    """Operating point of a rig with the named parameters as arrays of length 1; cached."""
    return operating_point(rig, {name: np.array([float(rig.parameters()[name].value or 0.0)]) for name in names})


class Forward:
    """Compiled model of an experiment that runs for many sets of parameters at once.

    Parameters
    ----------
    rig : Slider
    names : sequence of str
        Full dotted names of the free parameters.
    rtol : float
        Relative tolerance of a step.
    shifts : int
        Number of free times of the input table.
    unsettled : sequence of str
        Names, from `ExperimentProgram.unsettled`, of initial values that are given; derivatives by them come last.
    begins_free : bool
        True if these initial values are free, so that there are derivatives by them.
    sensitive : bool
        True to compute derivatives.
    observed : str, optional
        Name of the memory variable that is observed instead of friction.
    effort : Effort, optional
        Limits on the integration.
    """

    def __init__(
        self, rig: Slider, names: Sequence[str], rtol: float = 1e-7, shifts: int = 0, unsettled: Sequence[str] = (),
        sensitive: bool = True, effort: Effort | None = None, begins_free: bool = True, observed: str | None = None,
    ) -> None:  # fmt: skip
        self.rig, self.names, self.rtol, self.shifts, self.unsettled = rig, tuple(names), rtol, shifts, tuple(unsettled)
        self.effort = effort or Effort()
        self.slowest = np.inf  # largest number of steps in a completed motion; inf before the first run
        self._base = _point_of(rig, self.names)
        self.model = self._base.model
        reduction = experiment_program(self.model, 0, "tsit5").reduction
        self.begin_directions = self.unsettled if begins_free else ()
        self.directions = len(names) + shifts + len(self.begin_directions) if sensitive else 0
        self.size = next((n for n in (0, *SIZES) if n >= self.directions), SIZES[-1])
        method = automatic_method(reduction)
        self.program = experiment_program(self.model, self.size, method, not unsettled, observed)

    def values(self, parameters: Array) -> OperatingPoint:
        """Operating points for values (jobs, names) of the free parameters."""
        varied = {name: parameters[:, i] for i, name in enumerate(self.names)}
        if self.rig.axial_stiffness is not None:  # the stiffness k follows from other parameters
            return operating_point(self.rig, varied)
        named = self._base.named() | varied
        return self._base.with_arguments(named.values(), (len(parameters),))

    @cached_property
    def _unit_directions(self) -> Array:
        """Matrix (directions, parameters and initial values): 1 if a direction is this parameter or value, else 0."""
        order = {name: i for i, name in enumerate(self.model.parameters)}
        begins = {name: len(order) + i for i, name in enumerate(self.program.unsettled)}
        found = np.zeros((-(-self.directions // max(self.size, 1)) * self.size, len(order) + len(begins)))
        if not self.directions:
            return found
        for i, name in enumerate(self.begin_directions, start=self.directions - len(self.begin_directions)):
            found[i, begins[name]] = 1.0
        for i, name in enumerate(self.names):
            if name in order:
                found[i, order[name]] = 1.0
        return found

    def _chain_rule(self, parameters: Array, units: Array) -> Array:
        """Derivatives (jobs, directions, parameters and initial values) of the model's parameters by the directions."""
        chain = np.tile(self._unit_directions, (len(parameters), 1, 1))
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
        """Compute the friction coefficient at the samples, and its derivatives.

        Parameters
        ----------
        table : InputTable
            Table with as many free times as `shifts`.
        parameters : ndarray (jobs, names)
        units : ndarray (jobs, names)
            Change of each parameter per unit of the coordinate by which derivatives are taken.
        begin : ndarray (jobs, unsettled), optional
            Initial differences from steady sliding.

        Returns
        -------
        ndarray (jobs, 1 + directions, samples)
            Friction, then its derivatives; NaN from where a motion cannot be continued, or if there is no steady
            sliding to start from.
        """
        table = table.with_inputs(len(self.program.reduction.channels))
        values = self.values(parameters)
        chain = self._chain_rule(parameters, units)
        away = np.zeros((len(parameters), len(self.program.unsettled)))
        if begin is not None:
            away[:, [list(self.program.unsettled).index(name) for name in self.unsettled]] = begin
        if self.directions <= self.size:
            own = table.for_directions(slice(self.directions), self.size) if self.directions else table
            return self._run(own, values, chain, away)[:, : 1 + self.directions]
        parts = [slice(k, k + self.size) for k in range(0, self.directions, self.size)]
        found = [self._run(table.for_directions(part, self.size), values, chain[:, part], away) for part in parts]
        return np.concatenate([found[0], *(more[:, 1:] for more in found[1:])], axis=1)[:, : 1 + self.directions]

    def _run(self, table: InputTable, values: OperatingPoint, chain: Array, away: Array) -> Array:
        """Friction and derivatives (jobs, 1 + directions, samples) from one run of the compiled model."""
        jobs, sigma = len(chain), values.stresses
        constants, start = self.program.arrays(values, chain, away)
        settings = self._settings(table, values, jobs)
        valid = (sigma > 0) & np.all(np.isfinite(constants), axis=1) & np.all(np.isfinite(start), axis=1)
        predicted = np.full((jobs, 1 + chain.shape[1], len(table.times)), np.nan)
        steps = self.steps = np.zeros((jobs, 2))
        if not np.all(valid):
            constants, start, settings, table = constants[valid], start[valid], settings[valid], table.for_jobs(valid)
        found, taken = (predicted, steps) if np.all(valid) else (predicted[valid], steps[valid])

        def work(first: int, last: int, _: threading.Event | None = None) -> None:
            part = slice(first, last)
            own = table.for_jobs(part)
            self.program.through_table(
                constants[part], start[part], settings[part], own.segments, own.times, own.node_rates,
                own.input_rates, found[part], taken[part],
            )  # fmt: skip

        if len(found) <= LANES:
            work(0, len(found))
        elif not run_many(work, len(found), self.effort.threads, LANES, lanes=LANES):
            raise KeyboardInterrupt  # runs that were not made must not count as failed
        self.effort.budget.spend(np.sum(taken, axis=1) + SAMPLE_WORK * len(table.times), 1 + chain.shape[1])
        if self.effort.growth < np.inf:
            ended = np.sum(taken[np.isfinite(found[:, 0, -1])], axis=1)
            if len(ended):
                known = self.slowest if self.slowest < np.inf else 0.0
                self.slowest = max(known, float(np.max(ended)))
        if found is not predicted:
            predicted[valid] = found
        return predicted

    def _settings(self, table: InputTable, values: OperatingPoint, jobs: int) -> Array:
        """Settings of the compiled model for each job; the last are absolute tolerances of states and derivatives."""
        scales, unknown = scale_rows(values, self.program.reduction)
        size = scales.shape[1]
        settings = np.zeros((jobs, Setting.ATOL + size * (1 + self.size)))
        settings[:, Setting.RTOL] = self.rtol
        settings[:, Setting.Z_SCALE] = unknown
        richer = 1 + STEPS_PER_DIRECTION * (len(self.names) + self.shifts + len(self.unsettled))
        most = int(self.effort.patience * richer * max(len(table.times), table.segments.shape[1])) + 1000
        settings[:, Setting.MOST_STEPS] = min(most, max(self.effort.growth * self.slowest, MIN_STEPS))
        settings[:, Setting.FIRST_STEP] = np.inf
        settings[:, Setting.ATOL : Setting.ATOL + size] = self.rtol * scales
        settings[:, Setting.ATOL + size :] = np.tile(SENSITIVITY_RTOL * scales, self.size)
        return settings
