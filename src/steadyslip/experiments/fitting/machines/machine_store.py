"""Storage of fits of machines, with their records, in netCDF files; reading a file executes nothing in it."""

from __future__ import annotations

import json
from dataclasses import replace
from os import PathLike
from typing import Any, TypeVar

from steadyslip.core.errors import ParameterError, SteadyslipError
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.machines.machine_plan import MachinePlan
from steadyslip.experiments.fitting.machines.machine_planning import make_machine_plan
from steadyslip.experiments.fitting.store import (
    RESULT_ATTRIBUTES,
    RESULT_FORMS,
    result_attributes,
    result_columns,
    result_of,
    result_variables,
)
from steadyslip.experiments.measured.motion_record import MotionRecord
from steadyslip.files.result_tables import ColumnRule, ExpectedTable, write_table
from steadyslip.files.sealed import FileKind
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData

MACHINE_FIT = FileKind("machinefit", 1, 2**29, "write one with 'steadyslip fit ... -o fit.nc'")
_OPTIONS = {
    "free": [str], "separate": [str], "trend": int, "offset": bool, "initial": str, "scatter": [float], "rtol": float,
    "protocol": bool, "series": [int],
}  # fmt: skip
_FORMS = RESULT_FORMS | {"options": _OPTIONS, "records": [(str, str, [str], [(str, str)])]}
_MOTION, _RESPONSE = "motion", "response"
F = TypeVar("F", bound=Fitted)


def save(fit: Fitted, path: str | PathLike[str]) -> None:
    """Write a fit of a machine to a file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    import xarray as xr

    from steadyslip.files.specifications import stored_text

    plan: MachinePlan = fit.plan
    variables = result_variables(fit, [f"sample_{one.record + 1}" for one in plan.series])
    about = []
    for i, record in enumerate(plan.records, start=1):
        dims = f"sample_{i}"
        if isinstance(record, MotionRecord):
            variables[f"along_{i}"] = (dims, record.time, {"units": "s"})
            for k, values in enumerate(record.columns.values(), start=1):
                variables[f"column_{i}_{k}"] = (dims, values, {})
            about.append([_MOTION, record.source, list(record.notes), list(map(list, record.units.items()))])
        else:
            every = (dims, f"end_{i}", f"force_{i}")
            variables[f"along_{i}"] = (dims, record.omega, {"units": "rad/s"})
            variables[f"real_{i}"] = (every, record.receptance.real, {})
            variables[f"imag_{i}"] = (every, record.receptance.imag, {})
            variables[f"deviation_{i}"] = (every, record.deviation, {})
            about.append([_RESPONSE, record.source, [], [[name, ""] for name in record.names]])
    options = {name: getattr(plan, name) for name in _OPTIONS if hasattr(plan, name)}
    options |= {"protocol": plan.protocol is not None, "series": [one.record + 1 for one in plan.series]}
    attributes = result_attributes(fit) | {
        "rig": stored_text(plan.rig, plan.protocol),
        "options": json.dumps(options),
        "records": json.dumps(about),
    }
    names = list(fit.names)
    write_table(path, MACHINE_FIT, xr.Dataset(variables, coords={"parameter": names, "other": names}, attrs=attributes))


def read(path: str | PathLike[str], made: type[F]) -> F:
    """Fit of a machine that `save` wrote, as an instance of the class `made`.

    Nothing in the file is executed; a damaged file is refused.

    Raises
    ------
    NotAvailable
        If the file was not written by `save`, is damaged, or cannot be read.
    """
    table = ExpectedTable(path, MACHINE_FIT, RESULT_ATTRIBUTES | dict.fromkeys(("rig", "options", "records"), str))
    stored = {name: table.json(table.attributes[name], form) for name, form in _FORMS.items()}
    expected: dict[str, ColumnRule] = {}
    for i, (kind, _, _, columns) in enumerate(stored["records"], start=1):
        dims = (f"sample_{i}",)
        expected[f"along_{i}"] = ColumnRule(dims, "s" if kind == _MOTION else "rad/s")
        if kind == _MOTION:
            expected |= {f"column_{i}_{k}": ColumnRule(dims) for k in range(1, len(columns) + 1)}
        else:
            every = ColumnRule((*dims, f"end_{i}", f"force_{i}"))
            expected |= {f"{name}_{i}": every for name in ("real", "imag", "deviation")}
    places = [f"sample_{i}" for i in stored["options"].pop("series")]
    found = table.columns(expected | result_columns(places))
    try:
        records = [_record(found, i, *one) for i, one in enumerate(stored["records"], start=1)]
        plan = _plan(table, records, stored["options"])
    except ParameterError as error:
        raise table.fault(str(error)) from error
    if [f"sample_{one.record + 1}" for one in plan.series] != places:
        raise table.fault(f"its records have {len(plan.series)} series, but it lists {len(places)}")
    return result_of(table, found, stored, made, plan)


def _record(
    found: dict[str, Any], i: int, kind: str, source: str, notes: list[str], columns: list[tuple[str, str]]
) -> MotionRecord | ResponseData:
    along, names = found[f"along_{i}"], [name for name, _ in columns]
    if kind == _MOTION:
        values = {name: found[f"column_{i}_{k}"] for k, name in enumerate(names, start=1)}
        return MotionRecord(along, values, dict(columns), source, tuple(notes))
    receptance = found[f"real_{i}"] + 1j * found[f"imag_{i}"]
    return ResponseData(along, receptance, found[f"deviation_{i}"], tuple(names), source)


def _plan(table: ExpectedTable, records: list[Any], options: dict[str, Any]) -> MachinePlan:
    """Plan from the options in a file, which are checked like user input."""
    from steadyslip.files.specifications import protocol_from_text, rig_from_text

    text, source = table.attributes["rig"], str(table.path)
    scatter, rtol, moved = tuple(options.pop("scatter")), options.pop("rtol"), options.pop("protocol")
    try:
        rig = rig_from_text(text, source)
        if not isinstance(rig, Machine):
            raise table.fault("its rig is a slider")
        plan = make_machine_plan(rig, records, protocol=protocol_from_text(text, source) if moved else None, **options)
    except SteadyslipError as error:
        raise table.fault(f"its machine or options are refused: {error}") from error
    if not 0 < rtol < 1 or list(plan.free) != options["free"] or len(scatter) not in (0, len(plan.series)):
        raise table.fault(f"rtol is {rtol!r}, free parameters are {', '.join(options['free']):.200}")
    return replace(plan, rtol=rtol, scatter=scatter)
