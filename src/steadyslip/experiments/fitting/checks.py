"""Checks of the records of a fit, made before the search; they raise errors that say what to change."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.experiments.fitting.inputs import MIN_RATE_STEP
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.loading.loading import Loading, resting_rate
from steadyslip.experiments.measured.record import Record
from steadyslip.protocol.protocol import LOAD_POINT


def check_friction(records: Iterable[Record]) -> None:
    """Raise ParameterError for records whose friction is constant: the column is probably not that of friction."""
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
            problems.append(Problem(where, f"{record.source}: the load point does not move forward at the start "
                                    f"({record.initial_rate:.3g} m/s); a fit starts from steady sliding or, driven by "
                                    "commanded loading, at rest; cut it with between=(start, end)"))  # fmt: skip
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


def check_changes(plan: Plan) -> None:
    """Raise ParameterError if no record has a change of loading: undisturbed steady sliding gives constant friction."""
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
                    "sliding that nothing disturbs tells the level of friction alone; allowed: a record with a change, "
                    "the experiment's protocol, or initial = 'free' where sliding is not steady at first")
        )  # fmt: skip
    raise ParameterError(problems)


def _begins_at_rest(plan: Plan, record: Record) -> bool:
    return plan.drive == "commanded" and resting_rate(record.loading) is not None


def _curved(loading: Loading) -> bool:
    return any(
        course is not None and course.curve is not None for course in (loading.load, loading.stress, loading.pore)
    )
