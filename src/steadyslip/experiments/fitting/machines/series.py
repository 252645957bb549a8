"""Measured series of a machine, over time or over frequency, and the models that predict them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.measured.motion_record import MotionRecord
from steadyslip.linear.receptance import receptance
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import NORMAL
from steadyslip.machine.responses import ResponseData
from steadyslip.model.point import operating_point
from steadyslip.motion import simulate_many
from steadyslip.protocol import Protocol

PUSH = ".push"
EXACT = 1e-12  # mean square of residuals, over the squared size of their series, that integration errors alone cause
STEPS_PER_SAMPLE, FEWEST_STEPS = 200, 20_000
"""A simulation is stopped after the first number of steps per sample plus the second number: stick-slip between two
samples takes some tens of steps."""


@dataclass(frozen=True, eq=False)
class MachineSeries(ReadOnly):
    """Measured series with independent noise: a column of a record, or a part of a frequency response.

    Attributes
    ----------
    record : int
        Index of its record.
    name : str
        ``table.x``, or ``table.x/motor.x real`` of a frequency response.
    unit : str
        SI unit.
    along : ndarray (n,)
        Times (s) or angular frequencies (rad/s).
    data : ndarray (n,)
    weights : ndarray (n,)
        Reciprocal of the standard deviation of each sample, up to a common factor.
    """

    record: int
    name: str
    unit: str
    along: Array
    data: Array
    weights: Array

    @property
    def size(self) -> float:
        """Assumed size of residuals until their scatter is known: standard deviation of the data, or largest value."""
        return float(np.std(self.data)) or float(np.max(np.abs(self.data))) or 1.0


def coordinate_of(end: str) -> str:
    """Name of the model's coordinate for an end of a frequency response, such as ``table.x`` or ``table.y``."""
    return f"{end.removesuffix('.y')}{NORMAL}" if end.endswith(".y") else end.removesuffix(".x")


def pairs_of(data: ResponseData) -> list[tuple[int, int]]:
    """Pairs of indices (response, force) of the receptances that were measured at all frequencies."""
    count = range(len(data.names))
    return [(i, j) for i in count for j in count if np.all(np.isfinite(data.receptance[:, i, j]))]


def series_of(index: int, record: MotionRecord | ResponseData, units: Mapping[str, str]) -> list[MachineSeries]:
    """Series of a record; `units` has the SI units of the quantities that a simulated run contains."""
    if isinstance(record, MotionRecord):
        even = np.ones(len(record))
        return [MachineSeries(index, n, units[n], record.time, values, even) for n, values in record.columns.items()]
    found = []
    for i, j in pairs_of(record):
        values, error = record.receptance[:, i, j], record.deviation[:, i, j]
        weights = np.median(error) / error if np.all(error > 0) else np.ones(len(error))
        ends = [coordinate_of(record.names[k]) for k in (i, j)]
        turns = [units[f"{end}.x"] == "rad" for end in ends]
        unit = f"{units[f'{ends[0]}.x']}/{'(N m)' if turns[1] else 'N'}"
        for part, own in (("real", values.real), ("imag", values.imag)):
            name = f"{record.names[i]}/{record.names[j]} {part}"
            found.append(MachineSeries(index, name, unit, record.omega, np.array(own), weights))
    return found


class MotionModel:
    """Model of the columns of a record, from a simulation of the machine.

    Parameters
    ----------
    rig : Machine
    protocol : Protocol or None
        Protocol on the clock of the record; without a protocol, the motion begins at the first sample.
    record : MotionRecord
    rtol : float
    effort : Effort
    """

    def __init__(
        self, rig: Machine, protocol: Protocol | None, record: MotionRecord, rtol: float, effort: Effort
    ) -> None:
        self.rig, self.protocol, self.names, self.rtol, self.effort = rig, protocol, tuple(record.columns), rtol, effort
        self.times = record.time - (record.time[0] if protocol is None else 0.0)
        self.most = FEWEST_STEPS + STEPS_PER_SAMPLE * len(record)

    def run(self, values: Mapping[str, Array], begin: Mapping[str, Array], jobs: int) -> Array:
        """Predicted columns (jobs, n), one after the other; raises the errors of `simulate_many`."""
        varied = dict(values) or {"drive.velocity": np.full(jobs, self.rig.drive.velocity)}
        found = simulate_many(
            self.rig, varied, self.protocol, until=float(self.times[-1]), times=self.times, initial=begin,
            observables=self.names, events=False, rtol=self.rtol, most_steps=self.most, threads=self.effort.threads,
            progress=False,
        )  # fmt: skip
        if np.any(found.status == "interrupted"):
            raise KeyboardInterrupt  # runs that were not made must not count as failed
        self.effort.budget.spend((found.steps + found.rejected).astype(float), 1)
        return np.concatenate([found.samples[name] for name in self.names], axis=1)

    def __call__(self, values: Mapping[str, Array], begin: Mapping[str, Array], jobs: int) -> Array:
        """Predicted columns (jobs, n), NaN for motions that end early or cannot begin (which raise errors in `run`)."""
        try:
            return self.run(values, begin, jobs)
        except (ParameterError, NotAvailable):
            if jobs == 1:
                return np.full((1, len(self.names) * len(self.times)), np.nan)
        parts = []
        for half in (slice(jobs // 2), slice(jobs // 2, jobs)):
            own, first = ({name: x[half] for name, x in given.items()} for given in (values, begin))
            parts.append(self(own, first, len(range(*half.indices(jobs)))))
        return np.concatenate(parts)


class ResponseModel:
    """Model of measured receptances, from the machine linearised about steady sliding.

    Parameters
    ----------
    rig : Machine
    data : ResponseData
    """

    def __init__(self, rig: Machine, data: ResponseData) -> None:
        self.rig, self.omega, self.pairs = rig, data.omega, pairs_of(data)
        self.ends = [coordinate_of(name) for name in data.names]

    def __call__(self, values: Mapping[str, Array], begin: Mapping[str, Array], jobs: int) -> Array:
        """Predicted real and imaginary parts of each receptance, one after the other, (jobs, n)."""
        varied = dict(values) or {"drive.velocity": np.full(jobs, self.rig.drive.velocity)}
        point = operating_point(self.rig, varied)
        found = receptance(point, self.omega, [f"{e}.x" for e in self.ends], [f"{e}{PUSH}" for e in self.ends])
        parts = [own for i, j in self.pairs for own in (found[..., i, j].real, found[..., i, j].imag)]
        return np.concatenate(parts, axis=-1)
