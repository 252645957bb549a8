"""Plan of a fit: rig, records, loading and free parameters."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import InternalError
from steadyslip.core.records import parameters
from steadyslip.experiments.fitting.beginning import Beginning
from steadyslip.experiments.fitting.commanded import CommandedInputs
from steadyslip.experiments.fitting.comparison import (
    Comparison,
    RecordPart,
    initial_unknowns,
    jump_unknowns,
    start_unknowns,
    step_unknowns,
    trend_rows,
    trend_unknowns,
)
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.forward import Forward
from steadyslip.experiments.fitting.input_tables import MeasuredInputs, ProtocolInputs, Sharp, sharp_changes
from steadyslip.experiments.fitting.unknowns import Space, Unknown, unknown
from steadyslip.experiments.loading.kinks import smooth_load
from steadyslip.experiments.loading.loading import Loading, resting_rate, with_reference
from steadyslip.experiments.measured.record import Record
from steadyslip.kernels.experiment import experiment_program
from steadyslip.laws.contact import pressed_at
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.scales import memory_scales
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import NORMAL_STRESS

FRICTION_SIZE = 0.01  # typical initial difference of friction from steady sliding, the unit of its coordinate
TRIAL_RTOL = 1e-6  # tolerance of a step in trial fits: about 1e-8 of friction, far below the scatter of any record


@dataclass(frozen=True)
class Plan:
    """Definition of a fit: everything but its result.

    Attributes
    ----------
    rig : Slider
        Laws, and values of the parameters that are not free.
    records : tuple of Record
    free : tuple of str
        Full names of the free parameters of the rig, and of free times ``protocol.pieces.1.at``.
    separate : tuple of str
        Free parameters that have a separate value in every record.
    drive : str
        Loading of the model: ``commanded`` (found in the record), ``smoothed`` (a smooth curve through the measured
        displacement), ``measured`` (the measured columns) or ``protocol``.
    protocol : Protocol or None
        Protocol with times on the records' clock.
    trend : int
        Order of a polynomial that is added to friction.
    trend_axis : str
        ``displacement`` or ``time``.
    offset : bool
        True to add a constant to friction, besides mu_ref.
    lag : bool
        True if friction may lag its loading, by a time that is fitted for each record.
    initial : str
        ``steady`` if the motion begins with steady sliding, ``free`` if its initial friction and states are fitted.
    loss : str
    width : float or None
        Residual from which outliers have less weight.
    weights : tuple of ndarray or None
        One array (n,) for each record; equal weights if None.
    calibrated : float or None
        Stiffness of the machine from a calibration, Pa/m, for comparison with the fitted one.
    rtol : float
        Relative tolerance of an integration step of the model.
    sharp : tuple of Sharp
        Sudden changes of each record, if the loading is as measured.
    loading : tuple of Loading
        Commanded loading found in the columns of each record.
    beginnings : tuple of Beginning
        Initial difference of each record from steady sliding, if it is known; empty otherwise.
    """

    rig: Slider
    records: tuple[Record, ...]
    free: tuple[str, ...]
    separate: tuple[str, ...] = ()
    drive: str = "commanded"
    protocol: Protocol | None = None
    trend: int = 0
    trend_axis: str = "displacement"
    offset: bool = False
    lag: bool = False
    initial: str = "steady"
    loss: str = "linear"
    width: float | None = None
    weights: tuple[Array, ...] | None = field(default=None, repr=False)
    calibrated: float | None = None
    rtol: float = 1e-8
    sharp: tuple[Sharp, ...] = field(default=(), repr=False)
    loading: tuple[Loading, ...] = field(default=(), repr=False)
    beginnings: tuple[Beginning, ...] = ()

    @property
    def follows(self) -> bool:
        """True if the model is driven by the commanded or smoothed loading, not by samples or a protocol."""
        return self.protocol is None and self.drive != "measured"

    @property
    def pressed(self) -> bool:
        """True if the contact's normal stress is imposed, so that the measured normal stress drives the model."""
        return self.rig.contact.is_imposed() or self.rig.contact.has_pores()

    def space(self) -> Space:
        """Unknowns of the fit in order: free parameters, then times, initial states and trends of each record."""
        several = len(self.records) > 1
        found: list[Unknown] = []
        for name in self.free:
            for record in range(len(self.records)) if name in self.separate and several else [None]:
                found.append(self._unknown(name, record))
        for i in range(len(self.records)):
            label = i if several else None
            if self.follows:
                found += step_unknowns(label, self.loading[i], self.pressed)
                found += start_unknowns(label, self.loading[i], float(np.ptp(self.records[i].time)), self.lag)
            else:
                found += jump_unknowns(label, self.sharp[i])
            if self.initial == "free" and not self.rests(i):
                found += initial_unknowns(label, self.initial_sizes)
            found += trend_unknowns(i if several else None, self.trend, self.offset)
        return Space(tuple(found))

    def for_trial(self) -> Plan:
        """Plan with a larger integration tolerance, for short trial fits."""
        return replace(self, rtol=max(self.rtol, TRIAL_RTOL))

    def beginning(self, i: int) -> Beginning:
        """Known initial difference of record `i` from steady sliding, for memories of the law; empty if unknown."""
        return self.beginnings[i].of(self.initial_sizes) if self.beginnings else Beginning({})

    def rests(self, i: int) -> bool:
        """True if record `i` begins at rest; a hold of free duration then precedes it."""
        return self.follows and resting_rate(self.loading[i]) is not None

    @cached_property
    def initial_sizes(self) -> dict[str, float]:
        """Typical sizes, by name, of initial differences from steady sliding: 0.01 of friction, 1 of ln(state)."""
        point = operating_point(self.rig, {})
        program = experiment_program(point.model, 0, "tsit5", settled=False)
        scales = memory_scales(point)
        return {name: scales.get(name, FRICTION_SIZE) for name in program.unsettled}

    def _unknown(self, name: str, record: int | None) -> Unknown:
        if name.startswith("protocol."):
            if self.protocol is None:
                raise InternalError(f"the time {name} is fitted, but the plan has no protocol with it")
            address = parameters(self.protocol, "protocol.")[name]
            return unknown(address, record, scale=0.01 * float(np.ptp(self.records[record or 0].time)))
        return unknown(self.rig.parameters()[name], record)

    def comparison(self, effort: Effort | None = None, given: Collection[str] = ()) -> Comparison:
        """Comparison of the records with the compiled model, which has no derivatives by the durations in `given`."""
        space, effort = self.space(), effort or Effort()
        parts = tuple(self._part(i, record, space, effort, given) for i, record in enumerate(self.records))
        return Comparison(parts, space, self.loss, self.width or 1.0)

    def _part(self, i: int, record: Record, space: Space, effort: Effort, given: Collection[str]) -> RecordPart:
        rig, pressed = self.driven(record, i)
        places: dict[str, list[int]] = {"rig": [], "time": [], "initial": [], "trend": []}
        for place, one in enumerate(space.unknowns):
            if one.record in (None, i):
                kinds = dict.fromkeys(("protocol", "jump", "step", "lag", "start"), "time")
                kinds |= {"trend": "trend", "offset": "trend", "initial": "initial"}
                places[kinds.get(one.parameter.partition(".")[0], "rig")].append(place)
        names = [space.unknowns[place].parameter for place in places["rig"]]
        times = [space.unknowns[place].parameter for place in places["time"]]
        begins = [space.unknowns[place].parameter.partition(".")[2] for place in places["initial"]]
        known = self.beginning(i).values
        held = [k for k, place in enumerate(places["time"]) if space.unknowns[place].name in given]
        forward = Forward(
            rig, names, self.rtol, len(times) - len(held), begins or [*known], effort=effort, begins_free=not known
        )
        inputs: Any
        moved: Array | None = None
        if self.follows:
            pressing = self.pressed and record.normal is not None
            pores = rig.contact.has_pores() and self.loading[i].pore is not None
            inputs = CommandedInputs(self.loading[i], record.time, pressing, pores, self.lag, held)
            load = self.loading[i].load
            moved = load.integral(record.time) if load is not None and self.trend else None
        elif self.protocol is None:
            inputs = MeasuredInputs(record, self.sharp[i], pressed)
        else:
            own_stress = any(piece.channel == NORMAL_STRESS for piece in self.protocol.pieces)
            inputs = ProtocolInputs(
                self.protocol, rig.drive.velocity, record.time, times, None if own_stress else pressed
            )
        weights = np.ones(len(record)) if self.weights is None else self.weights[i]
        return RecordPart(
            record, rig, forward, inputs, record.friction, weights, tuple(places["rig"]), tuple(places["time"]),
            tuple(places["initial"]), tuple(places["trend"]),
            trend_rows(record, self.trend, self.offset, self.trend_axis, moved), tuple(known.values()),
            tuple(places["time"][k] for k in held),
        )  # fmt: skip

    def driven(self, record: Record, i: int) -> tuple[Slider, Array | None]:
        """Rig with the initial velocity and stress of a record; measured change of normal stress (n,), Pa, or None."""
        rig = self.rig
        if self.protocol is None:
            load = self.loading[i].load if self.follows else None
            rate = record.initial_rate if load is None else float(load.at(record.time[:1])[0])
            rate = (resting_rate(self.loading[i]) if self.follows else None) or rate
            if rate is None:
                raise InternalError(f"no initial velocity was found in {record.source}")
            rig = _driven_at(rig, rate)
        if not self.pressed or record.normal is None:
            return rig, None
        stress = None if self.drive == "measured" else self.loading[i].stress
        if stress is not None and not self.follows:  # a protocol and a measured normal stress
            pressed = stress.at(record.time)
            rig = _pressed_with(rig, float(pressed[0]))
            return rig, (record.normal if stress.changes else pressed) - pressed[0]
        if stress is not None:
            pore = self.loading[i].pore
            level = stress.at(record.time[:1]) - (0.0 if pore is None else pore.at(record.time[:1]))
            return _pressed_with(rig, float(level[0])), None
        rig = _pressed_with(rig, float(record.normal[0]))
        return rig, record.normal - record.normal[0]


@lru_cache(maxsize=64)
def _driven_at(rig: Slider, rate: float) -> Slider:
    return rig.with_values({"drive.velocity": rate})


@lru_cache(maxsize=64)
def _pressed_with(rig: Slider, stress: float) -> Slider:
    return replace(rig, contact=pressed_at(stress, rig.contact))


def with_loading(plan: Plan) -> Plan:
    """Plan with the loading of its records; it must be found before records are reduced to few samples."""
    if plan.drive == "measured":
        drivers = (record if plan.pressed else replace(record, normal=None) for record in plan.records)
        return replace(plan, sharp=tuple(sharp_changes(driver) for driver in drivers), loading=())
    found = []
    for record in plan.records:
        loading = record.loading
        if plan.drive == "smoothed" and record.displacement is not None:
            loading = replace(loading, load=smooth_load(record.time, record.displacement))
        found.append(loading)
    plan = replace(plan, sharp=tuple(Sharp() for _ in plan.records), loading=tuple(found))
    return with_lag(plan) if plan.lag else plan


def with_lag(plan: Plan) -> Plan:
    """Plan in which friction may lag its loading; in each record the time of one change is known, as a reference."""
    return replace(plan, lag=True, loading=tuple(map(with_reference, plan.loading)))
