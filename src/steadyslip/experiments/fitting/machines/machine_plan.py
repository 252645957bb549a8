"""Plan of a fit of a machine: rig, records and free parameters; and the comparison of the rig with the records."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.records import Address, parameters
from steadyslip.experiments.fitting.comparison import DataComparison
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.machines.series import MachineSeries, MotionModel, ResponseModel, series_of
from steadyslip.experiments.fitting.unknowns import Space, Unknown, unknown
from steadyslip.experiments.measured.motion_record import MotionRecord
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.reducing import reduce_model
from steadyslip.model.scales import natural_scales
from steadyslip.motion.observe import observable_units
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol

STEP = 1e-4
"""Step of central differences in coordinates (ln of a positive parameter, or value over size). An integration error of
1e-9 of the motion causes an error of 1e-5 in a derivative; for a ring-down of 50 periods, truncation causes as much."""
ROUGH_STEP = 1e-3  # step of one-sided differences of motions that are integrated with a large tolerance
TIME_SPAN = 10.0  # a time of the protocol is searched within this many hundredths of the record on both sides
SPAN = 1e4  # a parameter is searched between the machine's value divided by, and multiplied by, this factor

Model = Callable[[Mapping[str, Array], Mapping[str, Array], int], Array]


@dataclass(frozen=True)
class MachinePlan:
    """Definition of a fit of a machine: everything but its result.

    Attributes
    ----------
    rig : Machine
    records : tuple of MotionRecord or ResponseData
    free : tuple of str
        Full names of the free parameters of the rig, and of the protocol (``protocol.pieces.1.at``).
    separate : tuple of str
        Free parameters that have a separate value in every record.
    protocol : Protocol or None
    trend : int
        Order of a polynomial in time that is added to every column.
    offset : bool
        True to add a constant to every column.
    initial : str
        ``steady``, or ``free`` if initial displacements and velocities are fitted.
    scatter : tuple of float
        Standard deviation of the noise of each series, SI units, by which its residuals are divided.
    rtol : float
        Relative tolerance of a step in simulations.
    """

    rig: Machine
    records: tuple[MotionRecord | ResponseData, ...]
    free: tuple[str, ...]
    separate: tuple[str, ...] = ()
    protocol: Protocol | None = None
    trend: int = 0
    offset: bool = False
    initial: str = "steady"
    scatter: tuple[float, ...] = field(default=(), repr=False)
    rtol: float = 1e-9
    loss: ClassVar[str] = "linear"
    follows: ClassVar[bool] = False

    @cached_property
    def units(self) -> dict[str, str]:
        """SI units of the quantities that a simulated run of the machine contains, by name."""
        return observable_units(self._point.model, targets(self.rig, self.protocol or Protocol()))

    @cached_property
    def _point(self) -> OperatingPoint:
        return operating_point(self.rig, {})

    @cached_property
    def series(self) -> tuple[MachineSeries, ...]:
        return tuple(one for i, record in enumerate(self.records) for one in series_of(i, record, self.units))

    def known(self) -> dict[str, Address]:
        """Parameters that may be free, by dotted name: they have a value, and an effect on the motion."""
        found = dict(self.rig.parameters())
        if self.protocol is not None:
            found |= parameters(self.protocol, "protocol.")
        return {
            name: a
            for name, a in found.items()
            if a.value is not None
            and not a.role.gauge
            and a.role.kind != "reference rate"
            and name != "protocol.until"
            and isinstance(a.value, (int, float))
        }

    def space(self) -> Space:
        """Unknowns of the fit: free parameters, then initial states, offsets and trends of each record."""
        several, known = len(self.records) > 1, self.known()
        found: list[Unknown] = []
        for name in self.free:
            scale = None
            if name.startswith("protocol.") and known[name].role.unit == "s":
                scale = 0.01 * max(float(np.ptp(one.along)) for one in self.series)
            for own in range(len(self.records)) if name in self.separate and several else [None]:
                found.append(unknown(known[name], own, scale))
        for i, record in enumerate(self.records):
            if isinstance(record, MotionRecord):
                found += self._of_record(i, record, f"@{i + 1}" if several else "")
        return Space(tuple(found))

    def _of_record(self, i: int, record: MotionRecord, label: str) -> list[Unknown]:
        """Unknowns of record `i` alone: initial states, offsets and trends; `label` follows their names."""
        found = []
        several = i if label else None

        def add(name: str, unit: str, size: float) -> None:
            found.append(Unknown(f"{name}{label}", name, unit, several, False, size, -np.inf, np.inf))

        if self.initial == "free":
            for name, (size, _) in self._starts.items():
                seen = record.columns.get(name)
                add(f"initial.{name}", self.units[name], size if seen is None else max(size, float(np.ptp(seen))))
        for one in self.series:
            if one.record == i:
                terms = (["offset"] if self.offset else []) + [f"trend.{k}" for k in range(1, self.trend + 1)]
                for term in terms:
                    add(f"{term}.{one.name}", one.unit, one.size)
        return found

    @cached_property
    def _starts(self) -> dict[str, tuple[float, float]]:
        """Typical size, and value in steady sliding, of each displacement and velocity with a free initial value."""
        model = self._point.model
        scales, _ = natural_scales(self._point, reduce_model(model, None))
        items = [item for item in model.variables if item.kind in ("slip", "velocity")]
        steady = self._point.evaluate(model.function(model.steady.get(item.symbol, 0) for item in items))
        return {
            item.name: (float(np.max(scales[item.name])), float(value))
            for item, value in zip(items, steady, strict=True)
        }

    def begins(self, space: Space, steadily: bool = False) -> Array:
        """Coordinates (p,) from which a search starts: those of the machine's parameter values.

        Unknown initial states start at the first sample of the record or, if `steadily` is true, at steady sliding.
        """
        known, values = self.known(), []
        for one in space.unknowns:
            kind, _, name = one.parameter.partition(".")
            record = self.records[one.record or 0]
            if kind == "initial" and isinstance(record, MotionRecord):
                seen = None if steadily else record.columns.get(name)
                values.append(self._starts[name][1] if seen is None else float(seen[0]))
            else:
                values.append(float(known[one.parameter].value or 0.0) if one.parameter in known else 0.0)
        return np.asarray(space.coordinates(np.array(values)))

    def ends(self, space: Space) -> tuple[Array, Array]:
        """Lower and upper bounds (p,) of the search in coordinates, from domains, `SPAN` and `TIME_SPAN`."""
        times = [one.parameter.startswith("protocol.") and one.unit == "s" for one in space.unknowns]
        reach = np.array([np.log(SPAN) if one.logarithmic else SPAN for one in space.unknowns])
        reach[times] = TIME_SPAN
        own = self.begins(space)
        return np.maximum(space.low, own - reach), np.minimum(space.high, own + reach)

    def comparison(self, effort: Effort | None = None) -> MachineComparison:
        """Comparison of the records with the machine."""
        effort = effort or Effort()
        models: list[Model] = [
            MotionModel(self.rig, self.protocol, record, self.rtol, effort)
            if isinstance(record, MotionRecord)
            else ResponseModel(self.rig, record)
            for record in self.records
        ]
        return MachineComparison(self, models)


class MachineComparison(DataComparison):
    """Comparison of all series of the records with their models; derivatives are finite differences.

    Parameters
    ----------
    plan : MachinePlan
    models : list of callable
        Model of each record.
    rough : bool
        True for derivatives from one-sided instead of central differences.
    """

    def __init__(self, plan: MachinePlan, models: list[Model], rough: bool = False) -> None:
        self.models, self.series, self.rough = models, plan.series, rough
        scatter = plan.scatter or tuple(one.size for one in self.series)
        weights = [one.weights / size for one, size in zip(self.series, scatter, strict=True)]
        super().__init__([one.data for one in self.series], weights, plan.space())
        self.low, self.high = plan.ends(self.space)

    def values(self, coordinates: Array) -> Array:
        """Predicted values (m, n) of all series at coordinates (m, p)."""
        values, jobs = self.space.values(coordinates), len(coordinates)
        found = []
        for i, model in enumerate(self.models):
            own = {u.parameter: values[:, k] for k, u in enumerate(self.space.unknowns) if u.record in (None, i)}
            begin = {n.partition(".")[2]: x for n, x in own.items() if n.startswith("initial.")}
            rest = {n: x for n, x in own.items() if not n.startswith(("initial.", "offset.", "trend."))}
            predicted = model(rest, begin, jobs)
            found.append(predicted + self._added(i, own, jobs))
        return np.concatenate(found, axis=1)

    def _added(self, record: int, own: Mapping[str, Array], jobs: int) -> Array:
        """Sum (jobs, n) of the offsets and trends of one record."""
        parts = []
        for one in self.series:
            if one.record == record:
                share = (one.along - one.along[0]) / (one.along[-1] - one.along[0])
                total = np.zeros((jobs, len(share)))
                for name, x in own.items():
                    if name == f"offset.{one.name}":
                        total += x[:, None]
                    elif name.startswith("trend.") and name.split(".", 2)[2] == one.name:
                        total += x[:, None] * share ** int(name.split(".")[1])
                parts.append(total)
        return np.concatenate(parts, axis=1)

    def _run(self, coordinates: Array) -> tuple[Array, Array]:
        count, size = coordinates.shape
        shifts = (ROUGH_STEP if self.rough else STEP) * np.eye(size)[None]
        after = np.minimum(coordinates[:, None] + shifts, self.high)
        before = np.maximum(coordinates[:, None] - shifts, self.low)
        if self.rough:
            after = np.where(after > coordinates[:, None] + 0.5 * shifts, after, before)
            before = before[:, :0]
        every = np.concatenate([coordinates[:, None], after, before], axis=1)
        with np.errstate(all="ignore"):
            found = self.values(every.reshape(-1, size)).reshape(count, every.shape[1], -1)
            rise = found[:, 1 : 1 + size] - found[:, :1]
            forward = rise / np.einsum("mii->mi", after - coordinates[:, None])[..., None]
            if self.rough:
                return found[:, 0].copy(), forward
            fall = found[:, :1] - found[:, 1 + size :]
            backward = fall / np.einsum("mii->mi", coordinates[:, None] - before)[..., None]
            return found[:, 0].copy(), _smooth_slopes(forward, backward)

    def misfit(self, coordinates: Array) -> Array:
        """Sums of squares (m,) of the weighted residuals, computed without derivatives."""
        r = (self.data - self.values(coordinates)) * self.weights
        total = np.einsum("mn,mn->m", r, r)
        return np.where(np.isfinite(total), total, np.inf)


def _smooth_slopes(forward: Array, backward: Array) -> Array:
    """Means of forward and backward derivatives (m, p, n), or the smaller of the two if they differ much.

    If a motion begins to stick, or ends early, on one side of a point, the difference on this side is no derivative.
    """
    sizes = [np.linalg.norm(one, axis=2) for one in (forward, backward)]
    sizes = [np.where(np.isfinite(one), one, np.inf) for one in sizes]
    unlike = ~(np.linalg.norm(forward - backward, axis=2) <= 0.5 * np.minimum(*sizes))
    less = np.where((sizes[0] <= sizes[1])[..., None], forward, backward)
    return np.asarray(np.where(unlike[..., None], less, 0.5 * (forward + backward)))
