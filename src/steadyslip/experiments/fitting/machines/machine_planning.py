"""Plan of a fit of a machine from the user's arguments; one error lists everything that is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.experiments.fitting.machines.machine_plan import MachinePlan
from steadyslip.experiments.fitting.machines.series import coordinate_of, pairs_of
from steadyslip.experiments.fitting.planning import resolved
from steadyslip.experiments.fitting.settings import FitSettings, faults
from steadyslip.experiments.measured.motion_record import MotionRecord
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData
from steadyslip.protocol import Protocol

OF_SLIDERS = ("drive", "trend_axis", "lag", "loss", "width", "calibrated", "states", "compare", "windows", "weights")
"""Options that only fits of sliders have."""


def make_machine_plan(
    machine: Machine, records: Any, free: Sequence[str] | None = None, *, fixed: Sequence[str] = (),
    separate: Sequence[str] = (), protocol: Any = None, trend: int = 0, offset: bool = False, initial: str = "steady",
    **others: Any,
) -> MachinePlan:  # fmt: skip
    """Plan from the arguments of `steadyslip.fit`.

    Raises
    ------
    ParameterError
        If arguments are wrong; lists all faults.
    NotAvailable
        If the machine has a structure or holds a place: such machines cannot be fitted.
    """
    many = tuple(records) if isinstance(records, (list, tuple)) else (records,)
    if not many or not all(isinstance(record, (MotionRecord, ResponseData)) for record in many):
        message = (
            f"got {records!r:.80}; allowed for a machine: a record from experiments.read_motion or "
            "experiments.read_frequency_response, or several"
        )
        raise ParameterError([Problem("records", message)])
    if any(body.is_structure for body in machine.bodies.values()) or machine.holds:
        what = "that holds a place (velocity = 0)" if machine.holds else "with a structure"
        raise NotAvailable(f"fits are not offered for a machine {what}; allowed: bodies that links join, sliding")
    chosen = {"trend": trend, "offset": offset, "initial": initial} | others
    problems = list(faults({name: value for name, value in chosen.items() if name != "weights"}))
    usual = FitSettings()
    problems += [
        Problem(name, "has no effect on a fit of a machine; leave it out")
        for name in OF_SLIDERS
        if name in others and others[name] != getattr(usual, name, None)
    ]
    given = None if protocol is None else in_units_of(machine, Protocol.of(protocol))
    plan = MachinePlan(machine, many, (), protocol=given, trend=trend, offset=offset, initial=initial)
    known = plan.known()
    names = resolved("free", () if free is None else free, known, problems)
    held = resolved("fixed", fixed, known, problems)
    names = [name for name in dict.fromkeys(names) if name not in held]
    apart = resolved("separate", separate, dict.fromkeys(names), problems)
    if not names and not problems:
        shown = [name for name, a in known.items() if a.role.kind == "stiffness" or name.endswith("damping")]
        problems.append(
            Problem("free", f"nothing is free; name parameters such as {', '.join((shown or list(known))[:3])}")
        )
    problems += [
        Problem(name, "is 0 in the machine; give it a value above 0, from which the search starts")
        for name in names
        if not known[name].value and known[name].role.domain.low == 0 and known[name].role.size is None
    ]
    for i, record in enumerate(many, start=1):
        where = "record" if len(many) == 1 else f"record {i}"
        problems += (
            _of_motion(plan, record, where) if isinstance(record, MotionRecord) else _of_response(plan, record, where)
        )
    if problems:
        raise ParameterError(problems)
    plan = replace(plan, free=tuple(names), separate=tuple(apart))
    samples, unknowns = sum(len(one.data) for one in plan.series), len(plan.space())
    if samples <= unknowns:
        raise ParameterError([Problem("records", f"{samples} samples for {unknowns} unknowns")])
    return plan


def _of_motion(plan: MachinePlan, record: MotionRecord, where: str) -> list[Problem]:
    """Problems with the columns of a record, and with a protocol that is missing or starts after the record."""
    found = []
    for name, written in record.units.items():
        if name not in plan.units:
            found.append(Problem(f"{where}, {name}", unknown_name("motion or force of the machine", name, plan.units)))
        elif written and unit(written)[1] != unit(plan.units[name])[1]:
            found.append(Problem(f"{where}, {name}", f"is in {written}; expected a unit such as {plan.units[name]}"))
    if plan.initial == "steady" and not (plan.protocol is not None and plan.protocol.pieces):
        message = (
            "nothing disturbs the machine, and undisturbed steady sliding determines no parameters; allowed: a "
            "protocol (a push, a step of the drive), or initial = 'free' for a motion that begins away from steady "
            "sliding"
        )
        found.append(Problem("protocol", message))
    if plan.protocol is not None and record.time[0] < 0:
        message = f"{record.source} starts at {record.time[0]:.6g} s, before the protocol's 0 s"
        found.append(Problem(where, message))
    return found


def _of_response(plan: MachinePlan, record: ResponseData, where: str) -> list[Problem]:
    """Problems with a frequency response: unknown names, missing values, and a frequency of 0."""
    known = [name for name in plan.units if name.endswith(".x")]
    ends = [name.removesuffix(".x").replace(".normal", ".y") for name in known]
    ends = [end if end.endswith(".y") else f"{end}.x" for end in ends]
    found = [
        Problem(f"{where}, {name}", unknown_name("body with a direction", name, ends))
        for name in record.names
        if f"{coordinate_of(name)}.x" not in known
    ]
    if not found and not pairs_of(record):
        found.append(Problem(where, f"{record.source} has no response without gaps"))
    if record.omega[0] <= 0:
        found.append(Problem(where, "its first frequency is 0, where a sliding machine has no stiffness; leave it out"))
    return found
