"""What a fit compares: rig, records, what drives the model, what is free."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from steadyslip.core.errors import InternalError, NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.quantities import shown
from steadyslip.core.records import Address, parameters, resolve
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
from steadyslip.experiments.fitting.inputs import LEAST_RATE, MeasuredInputs, ProtocolInputs, Sharp, sharp_changes
from steadyslip.experiments.fitting.settings import faults
from steadyslip.experiments.fitting.unknowns import Space, Unknown, unknown
from steadyslip.experiments.loading.kinks import smooth_load
from steadyslip.experiments.loading.loading import Loading, resting_rate
from steadyslip.experiments.measured.record import Record
from steadyslip.kernels.experiment import experiment_program
from steadyslip.laws.contact import pressed_at
from steadyslip.machine.doing import in_units_of
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.scales import natural_scales
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import LOAD_POINT, NORMAL_STRESS

Array = np.ndarray
MOST_SAMPLES, HANDY_SAMPLES = 40_000, 8_000
"""Samples of a record beyond which a fit works with means of them, and how many."""
FRICTION = 0.01  # of friction: what matters
NEVER_FREE = ("drive.velocity", "slider.area")


@dataclass(frozen=True)
class Plan:
    """Everything about a fit but its result.

    Attributes
    ----------
    rig : Slider
        Laws, and the values of what is not free.
    records : tuple of Record
    free : tuple of str
        Full names of the free parameters of the rig, and of free times ``protocol.pieces.1.at``.
    separate : tuple of str
        Those of them that every record has to itself.
    drive : str
        What moves the load point: the ``commanded`` loading found in the record, its displacement ``smoothed`` or as
        ``measured``, or the ``protocol``.
    protocol : Protocol or None
        On the records' clock.
    trend : int
        Order of a polynomial that is added to friction.
    trend_axis : str
        ``displacement`` or ``time``.
    offset : bool
        Whether a constant is added to friction, besides mu_ref.
    lag : bool
        Whether friction may come later than what drives it, each record by a time of its own.
    initial : str
        Whether the motion begins with ``steady`` sliding, or with a friction and a memory of its own that are ``free``.
    loss : str
    width : float or None
        Residual from which on outliers weigh less.
    weights : tuple of ndarray or None
    rtol : float
        Error allowed per step of the model.
    sharp : tuple of Sharp
        What happens at once in each record that drives the model as measured.
    loading : tuple of Loading
        What was commanded in each record, as found in its columns.
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
    rtol: float = 1e-8
    sharp: tuple[Sharp, ...] = field(default=(), repr=False)
    loading: tuple[Loading, ...] = field(default=(), repr=False)

    @property
    def follows(self) -> bool:
        """Whether the model follows a loading that was found, not a column sample by sample."""
        return self.protocol is None and self.drive != "measured"

    @property
    def pressed(self) -> bool:
        """Whether the normal stress is imposed, so that the record's own drives the model."""
        return self.rig.contact.is_imposed()

    def space(self) -> Space:
        """The unknowns: shared ones, separate ones record by record, trends."""
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
                found += initial_unknowns(label, self._natural_sizes)
            found += trend_unknowns(i if several else None, self.trend, self.offset)
        return Space(tuple(found))

    def rests(self, i: int) -> bool:
        """Whether a record begins at rest, so that a hold of free length leads to where it begins."""
        return self.follows and resting_rate(self.loading[i]) is not None

    @cached_property
    def _natural_sizes(self) -> dict[str, float]:
        """Of how far from steady sliding a motion may begin: 0.01 of friction, an e-fold of each state."""
        point = operating_point(self.rig, {})
        program = experiment_program(point.model, 0, "tsit5", settled=False)
        scales, _ = natural_scales(point, program.reduction)
        return {name: float(np.max(scales.get(name, FRICTION))) for name in program.unsettled}

    def _unknown(self, name: str, record: int | None) -> Unknown:
        if name.startswith("protocol."):
            if self.protocol is None:
                raise InternalError("self.protocol is not None")
            address = parameters(self.protocol, "protocol.")[name]
            return unknown(address, record, scale=0.01 * float(np.ptp(self.records[record or 0].time)))
        return unknown(self.rig.parameters()[name], record)

    def comparison(self, effort: Effort | None = None) -> Comparison:
        """Records against the model."""
        space, effort = self.space(), effort or Effort()
        parts = tuple(self._part(i, record, space, effort) for i, record in enumerate(self.records))
        return Comparison(parts, space, self.loss, self.width or 1.0)

    def _part(self, i: int, record: Record, space: Space, effort: Effort) -> RecordPart:
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
        forward = Forward(rig, names, self.rtol, len(times), begins, effort=effort)
        inputs: Any
        moved: Array | None = None
        if self.follows:
            inputs = CommandedInputs(self.loading[i], record.time, self.pressed and record.normal is not None, self.lag)
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
            trend_rows(record, self.trend, self.offset, self.trend_axis, moved),
        )  # fmt: skip

    def driven(self, record: Record, i: int) -> tuple[Slider, Array | None]:
        """The rig as a record drives it, and the measured change of normal stress (Pa) where that is imposed."""
        rig = self.rig
        if self.protocol is None:
            load = self.loading[i].load if self.follows else None
            rate = record.initial_rate if load is None else float(load.at(record.time[:1])[0])
            rate = (resting_rate(self.loading[i]) if self.follows else None) or rate
            if rate is None:
                raise InternalError("rate is not None")
            rig = _driven_at(rig, rate)
        if not self.pressed or record.normal is None:
            return rig, None
        stress = None if self.drive == "measured" else self.loading[i].stress
        if stress is not None and not self.follows:  # of a protocol that leaves the normal stress to the record
            pressed = stress.at(record.time)
            rig = _pressed_with(rig, float(pressed[0]))
            return rig, (record.normal if stress.changes else pressed) - pressed[0]
        if stress is not None:
            return _pressed_with(rig, float(stress.at(record.time[:1])[0])), None
        rig = _pressed_with(rig, float(record.normal[0]))
        return rig, record.normal - record.normal[0]


@lru_cache(maxsize=64)
def _driven_at(rig: Slider, rate: float) -> Slider:
    return rig.with_values({"drive.velocity": rate})


@lru_cache(maxsize=64)
def _pressed_with(rig: Slider, stress: float) -> Slider:
    return replace(rig, contact=pressed_at(stress))


def make_plan(
    rig: Slider, records: Any, free: Sequence[str] | None = None, *, fixed: Sequence[str] = (),
    separate: Sequence[str] = (), protocol: Any = None, **options: Any,
) -> Plan:  # fmt: skip
    """A plan from what a user gives; see `steadyslip.fit`.

    Raises
    ------
    ParameterError
        Listing everything that is wrong.
    """
    if not isinstance(rig, Slider):
        raise ParameterError([Problem("rig", f"got {rig!r}; allowed: a Slider, such as read_rig or lab_rig gives")])
    many = (records,) if isinstance(records, Record) else tuple(records)
    if not many or not all(isinstance(record, Record) for record in many):
        raise ParameterError(
            [Problem("record", f"got {records!r}; allowed: a Record, as read_record gives, or several")]
        )
    plan_protocol = None if protocol is None else in_units_of(rig, Protocol.of(protocol))
    if plan_protocol is not None:
        push, press = targets(rig, plan_protocol)
        if push or press:
            raise NotAvailable("fits are not offered for creep and injection; allowed: other pieces, that move the "
                               "load point or change the normal stress")  # fmt: skip
    problems: list[Problem] = []
    known = _can_be_free(rig, plan_protocol)
    names = _default_free(rig) if free is None else _resolved("free", free, known, problems)
    if free is not None:  # the level of friction is not asked for, but never known beforehand
        names = [*names, *(name for name in rig.of_kind("friction level") if name in known and name not in names)]
    held = _resolved("fixed", fixed, rig.parameters(), problems)
    names = [name for name in dict.fromkeys(names) if name not in held]
    apart = _resolved("separate", separate, dict.fromkeys(names), problems)
    problems += faults({name: value for name, value in options.items() if name != "weights"})
    for name in ("errors", "starts", "effort"):  # of the search, not of what is compared
        options.pop(name, None)
    if not names and not problems:
        problems.append(Problem("free", f"nothing is free; name parameters such as {', '.join(list(known)[:3])}"))
    weights = options.get("weights")
    if weights is not None and not problems:
        options["weights"] = _checked_weights(weights, many, problems)
    if problems:
        raise ParameterError(problems)
    if weights is None:
        many, options["weights"] = _weighed(many)
    if plan_protocol is not None:
        options["drive"] = "protocol"
    plan = Plan(rig, many, tuple(names), tuple(apart), protocol=plan_protocol, **options)
    _check_records(plan)
    return with_loading(plan)


def with_loading(plan: Plan) -> Plan:
    """The plan knowing what drives the model in its records, which thinned ones no longer tell."""
    if plan.drive == "measured":
        drivers = (record if plan.pressed else replace(record, normal=None) for record in plan.records)
        return replace(plan, sharp=tuple(sharp_changes(driver) for driver in drivers), loading=())
    found = []
    for record in plan.records:
        loading = record.loading
        if plan.drive == "smoothed" and record.displacement is not None:
            loading = replace(loading, load=smooth_load(record.time, record.displacement))
        found.append(loading)
    return replace(plan, sharp=tuple(Sharp() for _ in plan.records), loading=tuple(found))


def _can_be_free(rig: Slider, protocol: Protocol | None) -> dict[str, Address]:
    found = {
        name: a for name, a in rig.parameters().items()
        if a.value is not None and name not in NEVER_FREE and not a.role.gauge
        and not (a.role.kind == "reference rate" and name.startswith("friction."))
    }  # fmt: skip
    if protocol is not None:
        found |= {n: a for n, a in parameters(protocol, "protocol.").items() if n.endswith(".at")}
    return found


def _default_free(rig: Slider) -> list[str]:
    """What experiments are made for: the friction law's parameters, and the machine's stiffness."""
    found = [name for name in _can_be_free(rig, None) if name.startswith("friction.")]
    return [*found, "slider.axial_stiffness" if rig.axial_stiffness is not None else "slider.stiffness"]


def _resolved(what: str, names: Any, known: Any, problems: list[Problem]) -> list[str]:
    if isinstance(names, str):
        names = [names]
    found = []
    for name in names:
        try:
            found.append(resolve(name, known))
        except (UnknownNameError, AttributeError) as error:
            message = (
                str(error) if isinstance(error, UnknownNameError) else f"got {name!r}; allowed: names of parameters"
            )
            problems.append(Problem(what, message))
    return found


def _weighed(records: tuple[Record, ...]) -> tuple[tuple[Record, ...], tuple[Array, ...] | None]:
    """Long records as means that a fit can work with, and the weights of means; None where all was measured."""
    handy = tuple(r if len(r) <= MOST_SAMPLES else r.decimated(HANDY_SAMPLES) for r in records)
    if all(record.worth is None for record in handy):
        return handy, None
    worth = [np.ones(len(r)) if r.worth is None else r.worth for r in handy]
    return handy, tuple(np.sqrt(own / np.mean(own)) for own in worth)


def _checked_weights(weights: Any, records: tuple[Record, ...], problems: list[Problem]) -> tuple[Array, ...] | None:
    rows = [weights] if len(records) == 1 and np.ndim(weights[0]) == 0 else list(weights)
    found = []
    for i, record in enumerate(records):
        row = np.asarray(rows[i], dtype=float) if i < len(rows) else np.empty(0)
        if row.shape != (len(record),) or not np.all((row >= 0) & np.isfinite(row)):
            problems.append(Problem("weights", f"allowed: {len(record)} finite numbers >= 0 for record {i + 1}"))
            return None
        found.append(row)
    return tuple(found)


def check_friction(records: Iterable[Record]) -> None:
    """Refuse measured friction that never changes, which is another column than that of friction."""
    problems = [
        Problem("record", f"{record.source}: friction is {record.friction[0]:.6g} in all samples; is it its column?")
        for record in records
        if np.ptp(record.friction) == 0
    ]
    if problems:
        raise ParameterError(problems)


def _check_records(plan: Plan) -> None:
    problems = []
    drives = plan.protocol is not None and any(piece.channel == LOAD_POINT for piece in plan.protocol.pieces)
    given = float(plan.rig.drive.velocity)
    for i, record in enumerate(plan.records, start=1):
        where = "record" if len(plan.records) == 1 else f"record {i}"
        if plan.protocol is None and record.displacement is None:
            problems.append(Problem(where, f"{record.source} has no column for the load point's displacement or rate; "
                                    "name it, or give the protocol of the experiment"))  # fmt: skip
        elif plan.protocol is None and not (record.initial_rate or 0.0) > 0 and not _begins_at_rest(plan, record):
            problems.append(Problem(where, f"{record.source}: the load point does not move forward at the start "
                                    f"({record.initial_rate:.3g} m/s); a fit starts from steady sliding or, driven by "
                                    "commanded loading, at rest; cut it with between=(start, end)"))  # fmt: skip
        if plan.lag and (plan.protocol is not None or plan.drive != "commanded" or _curved(record.loading)):
            problems.append(Problem("lag", f"{record.source} is not driven by steps and ramps found in it; allowed: "
                                    "false, or drive = 'commanded' and a record of steps and ramps"))  # fmt: skip
        rate = record.initial_rate or 0.0
        if plan.protocol is not None and rate > 0 and abs(np.log(rate / given)) > LEAST_RATE:
            message = f"got {shown(given, 'm/s')}, but {record.source} begins at {shown(rate, 'm/s')}; make them agree"
            problems.append(Problem("drive.velocity", message))
        if plan.protocol is not None and not drives and record.displacement is not None:
            problems.append(Problem("protocol", "does not move the load point, but the record does; leave it "
                                    "away, or give it a velocity-step, hold or velocity-table"))  # fmt: skip
        if plan.protocol is not None and record.time[0] < 0:
            problems.append(
                Problem(where, f"{record.source} starts at {record.time[0]:.6g} s, before the protocol's 0 s")
            )
        needed = len(plan.free) + plan.trend + plan.offset + (plan.initial == "free")
        if len(record) <= needed:
            problems.append(Problem(where, f"{len(record)} samples for {needed} unknowns"))
    if problems:
        raise ParameterError(problems)


def _begins_at_rest(plan: Plan, record: Record) -> bool:
    return plan.drive == "commanded" and resting_rate(record.loading) is not None


def _curved(loading: Loading) -> bool:
    return any(course is not None and course.curve is not None for course in (loading.load, loading.stress))


def check_width(plan: Plan, residuals: Array) -> Plan:
    """The plan with a width for its loss: 1.345 standard deviations of most residuals, unless given."""
    if plan.loss == "linear" or plan.width is not None:
        return plan
    spread = 1.4826 * float(np.median(np.abs(residuals - np.median(residuals))))
    if not spread > 0:
        raise NotAvailable("residuals have no width; use loss='linear'")
    return replace(plan, width=1.345 * spread)
