"""Plan of a fit from the user's arguments; a single error lists everything that is wrong with them.

Records are checked before the search, and errors say what to change.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.format import format_quantity
from steadyslip.core.names import resolve
from steadyslip.core.records import Address, parameters
from steadyslip.core.roles import Placeholder
from steadyslip.experiments.fitting.beginning import Beginning
from steadyslip.experiments.fitting.input_tables import MIN_RATE_STEP
from steadyslip.experiments.fitting.plan import Plan, with_loading
from steadyslip.experiments.fitting.settings import FitSettings, faults
from steadyslip.experiments.loading.loading import Loading, resting_rate
from steadyslip.experiments.measured.clipped import without_clipped, without_wild
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.measured.same import is_same_measurement
from steadyslip.experiments.measured.waves import without_wave
from steadyslip.experiments.numerics.splitting import spread
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.slider import Slider
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import LOAD_POINT

MAX_SAMPLES, AVERAGED_SAMPLES = 40_000, 8_000
"""A record with more samples than the first number is averaged to about the second number of means, to save time; by
trial."""
NEVER_FREE = ("drive.velocity", "slider.area")


def make_plan(
    rig: Slider, records: Any, free: Sequence[str] | None = None, *, fixed: Sequence[str] = (),
    separate: Sequence[str] = (), protocol: Any = None, beginnings: tuple[Beginning, ...] = (),
    clean: bool = True, **options: Any,
) -> Plan:  # fmt: skip
    """Plan from the arguments of `steadyslip.fit`, and from the `beginnings` of records if these are known.

    Clipped samples, wild samples and waves are taken out of the records, and very long records are averaged, unless
    `clean` is False, as for the records of an earlier plan: what is left of them may look clipped or wild again.

    Raises
    ------
    ParameterError
        If arguments or records are wrong; lists all faults.
    """
    many = tuple(records) if isinstance(records, (list, tuple)) else (records,)
    if not many or not all(isinstance(record, Record) for record in many):
        raise ParameterError(
            [Problem("records", f"got {records!r:.80}; allowed: a Record, as read_record gives, or several")]
        )
    plan_protocol = None if protocol is None else in_units_of(rig, Protocol.of(protocol))
    if plan_protocol is not None:
        acting = targets(rig, plan_protocol)
        if any(acting.pushes) or any(acting.presses):
            raise NotAvailable("fits are not offered for creep and injection; allowed: other pieces, that move the "
                               "load point or change the normal stress")  # fmt: skip
    problems: list[Problem] = []
    known = can_be_free(rig, plan_protocol)
    names = _default_free(rig) if free is None else resolved("free", free, known, problems)
    if free is not None:  # the level of friction is free even if it is not named, as it is never known
        names = [*names, *(name for name in rig.of_kind("friction level") if name in known and name not in names)]
    held = resolved("fixed", fixed, rig.parameters(), problems)
    names = [name for name in dict.fromkeys(names) if name not in held]
    apart = resolved("separate", separate, dict.fromkeys(names), problems)
    problems += faults({name: value for name, value in options.items() if name != "weights"})
    for name in ("errors", "starts", "effort"):  # options of the search are not part of the plan
        options.pop(name, None)
    if not names and not problems:
        problems.append(Problem("free", f"nothing is free; name parameters such as {', '.join(list(known)[:3])}"))
    weights = options.get("weights")
    if weights is not None and not problems:
        options["weights"] = _checked_weights(weights, many, problems)
    if problems:
        raise ParameterError(problems)
    if clean and plan_protocol is None and options.get("drive", "commanded") == "commanded":
        many = tuple(without_wave(record) for record in many)
    if clean and weights is None:
        many = tuple(without_clipped(record) for record in many)
        if options.get("loss", "linear") == "linear":  # other losses give outliers little weight
            many = tuple(without_wild(record) for record in many)
        many, options["weights"] = _averaged(many)
    if options.get("calibrated") is not None:
        options["calibrated"] = FitSettings(calibrated=options["calibrated"]).calibrated
    if plan_protocol is not None:
        options["drive"] = "protocol"
        rig = _driven_as_recorded(rig, many)
    plan = Plan(rig, many, tuple(names), tuple(apart), protocol=plan_protocol, beginnings=beginnings, **options)
    check_records(plan)
    plan = with_loading(plan)
    check_changes(plan)
    return plan


def _driven_as_recorded(rig: Slider, records: Sequence[Record]) -> Slider:
    """Rig whose drive velocity, if it is a placeholder, is the initial rate of the first record that has a rate."""
    if not isinstance(rig.drive.velocity, Placeholder):
        return rig
    rate = next((rate for record in records if (rate := record.initial_rate or 0.0) > 0), None)
    if rate is None:
        message = (
            "missing, and no record shows it; give the rate before the first step: "
            "lab_rig(velocity='1 um/s'), or velocity = '1 um/s' in [drive] of a file"
        )
        raise ParameterError([Problem("drive.velocity", message)])
    return rig.with_values({"drive.velocity": rate})


def can_be_free(rig: Slider, protocol: Protocol | None = None) -> dict[str, Address]:
    """Parameters that may be free, by dotted name: they have a value, and an effect on the motion."""
    found = {
        name: a for name, a in rig.parameters().items()
        if a.value is not None and name not in NEVER_FREE and not a.role.gauge
        and not (a.role.kind == "reference rate" and name.startswith("friction."))
    }  # fmt: skip
    if protocol is not None:
        found |= {n: a for n, a in parameters(protocol, "protocol.").items() if n.endswith(".at")}
    return found


def _default_free(rig: Slider) -> list[str]:
    """Names of the parameters that are free by default: those of the friction law, drainage and stiffness."""
    drains = rig.of_kind("drainage")
    found = [name for name in can_be_free(rig) if name.startswith("friction.") or name in drains]
    return [*found, "slider.axial_stiffness" if rig.axial_stiffness is not None else "slider.stiffness"]


def resolved(what: str, names: Any, known: Any, problems: list[Problem]) -> list[str]:
    """Full names, as in `known`, of the parameters `names`; for an unknown name, a problem with `what` is added."""
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


def _averaged(records: tuple[Record, ...]) -> tuple[tuple[Record, ...], tuple[Array, ...] | None]:
    """Records, the long ones averaged to fewer samples, and weights of samples (None if no sample is a mean)."""
    handy = tuple(r if len(r) <= MAX_SAMPLES else r.decimated(AVERAGED_SAMPLES) for r in records)
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


def with_width(plan: Plan, residuals: Array) -> Plan:
    """Plan with a width of its loss: 1.345 robust standard deviations (Huber: 95 % efficient for normal errors)."""
    deviation = spread(residuals)
    if not deviation > 0:
        raise NotAvailable("residuals have no width; use loss='linear'")
    return replace(plan, width=1.345 * deviation)


def check_friction(records: Iterable[Record]) -> None:
    """Raise ParameterError for records with constant friction: their column probably holds something else."""
    problems = [
        Problem("record", f"{record.source}: friction is {record.friction[0]:.6g} in all samples; is it its column?")
        for record in records
        if np.ptp(record.friction) == 0
    ]
    if problems:
        raise ParameterError(problems)


def check_records(plan: Plan) -> None:
    """Raise ParameterError for records whose start, drive or length does not suit the options of the plan."""
    problems = []
    drives = plan.protocol is not None and any(piece.channel == LOAD_POINT for piece in plan.protocol.pieces)
    given = float(plan.rig.drive.velocity)
    for i, record in enumerate(plan.records, start=1):
        where = "record" if len(plan.records) == 1 else f"record {i}"
        if plan.protocol is None and record.displacement is None:
            problems.append(Problem(where, f"{record.source} has no column for the load point's displacement or rate; "
                                    "name it, or give the protocol of the experiment"))  # fmt: skip
        elif plan.protocol is None and not (record.initial_rate or 0.0) > 0 and not _begins_at_rest(plan, record):
            backwards = "change the sign of displacement and friction, or " if (record.initial_rate or 0.0) < 0 else ""
            problems.append(Problem(where, f"{record.source}: the load point does not move forward at the start "
                                    f"({record.initial_rate:.3g} m/s); a fit starts from steady sliding or, driven by "
                                    f"commanded loading, at rest; {backwards}cut it (between)"))  # fmt: skip
        if plan.lag and (plan.protocol is not None or plan.drive != "commanded" or _curved(record.loading)):
            problems.append(Problem("lag", f"{record.source} is not driven by steps and ramps found in it; allowed: "
                                    "false, or drive = 'commanded' and a record of steps and ramps"))  # fmt: skip
        if record.pressure_changes and plan.pressed and not plan.follows:
            problems.append(Problem("drive", f"{record.source} changes the pore pressure; allowed: 'commanded' or "
                                    "'smoothed', without a protocol"))  # fmt: skip
        rate = record.initial_rate or 0.0
        if plan.protocol is not None and rate > 0 and abs(np.log(rate / given)) > MIN_RATE_STEP:
            message = (
                f"got {format_quantity(given, 'm/s')}, but {record.source} begins at "
                f"{format_quantity(rate, 'm/s')}; make them agree"
            )
            problems.append(Problem("drive.velocity", message))
        if plan.protocol is not None and not drives and record.displacement is not None:
            problems.append(Problem("protocol", "does not move the load point, but the record does; leave it "
                                    "out, or give it a velocity-step, hold or velocity-table"))  # fmt: skip
        if plan.protocol is not None and record.time[0] < 0:
            problems.append(
                Problem(where, f"{record.source} starts at {record.time[0]:.6g} s, before the protocol's 0 s")
            )
        for k, other in enumerate(plan.records[: i - 1], start=1):
            if is_same_measurement(record, other):
                again = f"is record {k} again ({record.source}), whole, cut or averaged; give each experiment once"
                problems.append(Problem(where, again))
        needed = len(plan.free) + plan.trend + plan.offset + (plan.initial == "free")
        if len(record) <= needed:
            problems.append(Problem(where, f"{len(record)} samples for {needed} unknowns"))
    if problems:
        raise ParameterError(problems)


def check_changes(plan: Plan) -> None:
    """Raise ParameterError if no loading changes in any record: friction of steady sliding is constant."""
    asked = [name for name in plan.free if name not in plan.rig.of_kind("friction level")]
    if not (asked and plan.follows and plan.initial == "steady"):
        return
    problems = []
    for i, (record, loading) in enumerate(zip(plan.records, plan.loading, strict=True)):
        courses = [loading.load, *([loading.stress, loading.pore] if plan.pressed else [])]
        if plan.rests(i) or any(c is not None and (c.changes or c.curve is not None) for c in courses):
            return
        problems.append(
            Problem("record" if len(plan.records) == 1 else f"record {i + 1}",
                    f"{record.source}: no change of the load point's rate or the normal stress was found, and steady "
                    "sliding that nothing disturbs determines only the level of friction; allowed: a record with a "
                    "change, the experiment's protocol, or initial = 'free' if sliding is not steady at first")
        )  # fmt: skip
    raise ParameterError(problems)


def _begins_at_rest(plan: Plan, record: Record) -> bool:
    return plan.drive == "commanded" and resting_rate(record.loading) is not None


def _curved(loading: Loading) -> bool:
    return any(
        course is not None and course.curve is not None for course in (loading.load, loading.stress, loading.pore)
    )
