"""Histories in files: netCDF with the rig inside, and plain columns."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, SteadyslipError
from steadyslip.core.quantities import outside
from steadyslip.files.output import write_columns
from steadyslip.files.sealed import FileKind
from steadyslip.files.tables import ColumnRule, ExpectedTable, write_table
from steadyslip.kernels.methods import METHODS
from steadyslip.kernels.runner import LOG_KINDS
from steadyslip.motion.events import Event
from steadyslip.motion.history import HistoryData
from steadyslip.motion.observe import observable_units
from steadyslip.motion.status import WORDS

RUN = FileKind("run", 3, 2**29, "simulate again and save the run anew")
MOST_EVENTS = 10**6
_EVENT_UNITS = {
    "time": "s", "velocity": "m/s", "normal_stress": "Pa", "shear_stress": "Pa", "spring_stress": "Pa", "slip": "m",
}  # fmt: skip
_ATTRIBUTES = {
    "rig": str, "status": str, "end": float, "method": str, "rtol": float, "steps": int, "rejected": int,
    "lowest_velocity": float, "peak_velocity": float,
    "steadyslip": str,
}  # fmt: skip


def to_dataset(history: HistoryData) -> Any:
    """See `History.to_xarray`."""
    import xarray as xr

    from steadyslip import __version__
    from steadyslip.files.specifications import rig_to_text

    variables = {
        name: ("time", values, {"units": history.units[name]}) for name, values in history.data.items() if name != "t"
    }
    events = history.events
    variables |= {
        f"event_{name}": ("event", np.array([getattr(e, name) for e in events], dtype=float), {"units": unit})
        for name, unit in _EVENT_UNITS.items()
    }
    variables["event_kind"] = ("event", np.array([e.kind for e in events], dtype=object), {})
    attributes = {
        "rig": rig_to_text(history.rig, history.protocol),
        "status": history.status,
        "end": history.end,
        "method": history.method,
        "rtol": history.rtol,
        "steps": history.steps,
        "rejected": history.rejected,
        "lowest_velocity": history.velocities[0],
        "peak_velocity": history.velocities[1],
        "steadyslip": __version__,
    }
    return xr.Dataset(variables, coords={"time": ("time", history.data["t"], {"units": "s"})}, attrs=attributes)


def save(history: HistoryData, path: str | PathLike[str]) -> None:
    """Write a history as netCDF; a file of that name is replaced only once the new one is whole.

    Raises
    ------
    NotAvailable
        If the file cannot be written, or the run is too large for one.
    """
    if len(history.events) > MOST_EVENTS:
        message = f"the run has {len(history.events)} events, a file holds up to {MOST_EVENTS}; simulate a shorter time"
        raise NotAvailable(f"cannot write {str(path)!r}: {message}")
    write_table(path, RUN, to_dataset(history))


def read(path: str | PathLike[str]) -> dict[str, Any]:
    """The fields of a history that `save` wrote.

    Nothing in the file is executed; damage is found, whatever it is.

    Raises
    ------
    NotAvailable
        If the file is not one of ours, is damaged, or cannot be read.
    """
    from steadyslip.files.specifications import protocol_from_text, slider_from_text
    from steadyslip.model import build_model
    from steadyslip.protocol import Protocol

    table = ExpectedTable(path, RUN, _ATTRIBUTES)
    attributes = table.attributes
    _check_words(table)
    try:
        rig = slider_from_text(attributes["rig"], str(path))
        protocol = protocol_from_text(attributes["rig"], str(path)) or Protocol()
        units = {"t": "s"} | observable_units(build_model(rig))
    except SteadyslipError as error:
        raise table.fault(f"its rig is refused: {error}") from error
    columns = {"time" if name == "t" else name: ColumnRule(("time",), unit) for name, unit in units.items()}
    columns |= {f"event_{name}": ColumnRule(("event",), unit) for name, unit in _EVENT_UNITS.items()}
    found = table.columns(columns | {"event_kind": ColumnRule(("event",), text=True)})
    if table.sizes["event"] > MOST_EVENTS:
        raise table.fault(f"it has {table.sizes['event']} events, allowed are {MOST_EVENTS}")
    kinds = found["event_kind"]
    if unknown := set(kinds) - set(LOG_KINDS[1:]):
        raise table.fault(f"it has an event of unknown kind, {unknown.pop()!r:.40}")
    moments = zip(*(found[f"event_{name}"].tolist() for name in _EVENT_UNITS), strict=True)
    data = {name: found["time" if name == "t" else name] for name in units}
    _check_samples(table, data)
    return {
        "rig": rig,
        "protocol": protocol,
        "data": data,
        "units": units,
        "events": tuple(Event(kind, *row) for kind, row in zip(kinds, moments, strict=True)),
        **{name: attributes[name] for name in ("status", "end", "method", "rtol", "steps", "rejected")},
        "velocities": (attributes["lowest_velocity"], attributes["peak_velocity"]),
    }


def _check_words(table: ExpectedTable) -> None:
    attributes = table.attributes
    known = {"status": WORDS, "method": tuple(METHODS)}
    for name, words in known.items():
        if attributes[name] not in words:
            raise table.fault(f"{name} is {attributes[name]!r:.40}; allowed: {', '.join(words)}")
    if not (math.isfinite(attributes["end"]) and 0 < attributes["rtol"] < 1):
        raise table.fault(f"end is {attributes['end']!r} and rtol {attributes['rtol']!r}")
    if attributes["steps"] < 0 or attributes["rejected"] < 0:
        raise table.fault("it has a negative number of steps")


def _check_samples(table: ExpectedTable, data: dict[str, np.ndarray]) -> None:
    """Times rise, and a run that is done has a number for everything."""
    if not (np.all(np.isfinite(data["t"])) and np.all(np.diff(data["t"]) >= 0)):
        raise table.fault("its times do not rise")
    if table.attributes["status"] == "done":
        for name, values in data.items():
            if not np.all(np.isfinite(values)):
                raise table.fault(f"it says that it is done, but {name} is not finite throughout")


def to_csv(history: HistoryData, path: str | PathLike[str]) -> None:
    """Write the samples as comma-separated text, forces of the whole contact where the rig has an area.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    names = list(history.data)
    written = [outside(history.units[name], history.rig.area) for name in names]
    columns = {
        f"{name} ({unit})": history.data[name] * factor for name, (factor, unit) in zip(names, written, strict=True)
    }
    write_columns(path, columns, "%.15g")
