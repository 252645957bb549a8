"""Make the plan of a fit from the arguments of a user; one error lists everything that is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.names import resolve
from steadyslip.core.records import Address, parameters
from steadyslip.experiments.fitting.checks import check_changes, check_records
from steadyslip.experiments.fitting.plan import Plan, with_loading
from steadyslip.experiments.fitting.settings import FitSettings, faults
from steadyslip.experiments.measured.clipped import without_clipped
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import spread
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.slider import Slider
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol

MAX_SAMPLES, AVERAGED_SAMPLES = 40_000, 8_000
"""Samples above which a record is averaged, and number of means then; chosen by trial, to save time."""
NEVER_FREE = ("drive.velocity", "slider.area")


def make_plan(
    rig: Slider, records: Any, free: Sequence[str] | None = None, *, fixed: Sequence[str] = (),
    separate: Sequence[str] = (), protocol: Any = None, **options: Any,
) -> Plan:  # fmt: skip
    """Make a plan from the arguments of `steadyslip.fit`.

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
            [Problem("records", f"got {records!r}; allowed: a Record, as read_record gives, or several")]
        )
    plan_protocol = None if protocol is None else in_units_of(rig, Protocol.of(protocol))
    if plan_protocol is not None:
        acting = targets(rig, plan_protocol)
        if any(acting.pushes) or any(acting.presses):
            raise NotAvailable("fits are not offered for creep and injection; allowed: other pieces, that move the "
                               "load point or change the normal stress")  # fmt: skip
    problems: list[Problem] = []
    known = can_be_free(rig, plan_protocol)
    names = _default_free(rig) if free is None else _resolved("free", free, known, problems)
    if free is not None:  # the level of friction is never known beforehand: it is free even if not named
        names = [*names, *(name for name in rig.of_kind("friction level") if name in known and name not in names)]
    held = _resolved("fixed", fixed, rig.parameters(), problems)
    names = [name for name in dict.fromkeys(names) if name not in held]
    apart = _resolved("separate", separate, dict.fromkeys(names), problems)
    problems += faults({name: value for name, value in options.items() if name != "weights"})
    for name in ("errors", "starts", "effort"):  # options of the search, which are no part of the plan
        options.pop(name, None)
    if not names and not problems:
        problems.append(Problem("free", f"nothing is free; name parameters such as {', '.join(list(known)[:3])}"))
    weights = options.get("weights")
    if weights is not None and not problems:
        options["weights"] = _checked_weights(weights, many, problems)
    if problems:
        raise ParameterError(problems)
    if weights is None:
        many, options["weights"] = _averaged(tuple(without_clipped(record) for record in many))
    if options.get("calibrated") is not None:
        options["calibrated"] = FitSettings(calibrated=options["calibrated"]).calibrated
    if plan_protocol is not None:
        options["drive"] = "protocol"
    plan = Plan(rig, many, tuple(names), tuple(apart), protocol=plan_protocol, **options)
    check_records(plan)
    plan = with_loading(plan)
    check_changes(plan)
    return plan


def can_be_free(rig: Slider, protocol: Protocol | None = None) -> dict[str, Address]:
    """Parameters that may be free, by dotted name: those that have a value and an effect."""
    found = {
        name: a for name, a in rig.parameters().items()
        if a.value is not None and name not in NEVER_FREE and not a.role.gauge
        and not (a.role.kind == "reference rate" and name.startswith("friction."))
    }  # fmt: skip
    if protocol is not None:
        found |= {n: a for n, a in parameters(protocol, "protocol.").items() if n.endswith(".at")}
    return found


def _default_free(rig: Slider) -> list[str]:
    """Names that are free by default: parameters of the friction law, drainage and stiffness."""
    drains = rig.of_kind("drainage")
    found = [name for name in can_be_free(rig) if name.startswith("friction.") or name in drains]
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


def _averaged(records: tuple[Record, ...]) -> tuple[tuple[Record, ...], tuple[Array, ...] | None]:
    """Records, long ones averaged, and weights of the means; None if no sample is a mean."""
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
