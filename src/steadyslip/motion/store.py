"""Files of histories: netCDF that contains the rig, and CSV."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.errors import NotAvailable, SteadyslipError
from steadyslip.files.output import write_columns
from steadyslip.files.result_tables import ColumnRule, ExpectedTable, write_table
from steadyslip.files.sealed import FileKind
from steadyslip.kernels.methods import METHODS
from steadyslip.kernels.runner import LOG_KINDS
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.motion.events import ContactEvent, Event
from steadyslip.motion.history import HistoryData
from steadyslip.motion.observe import observable_units
from steadyslip.motion.status import WORDS
from steadyslip.motion.targets import targets

RUN = FileKind("run", 3, 2**29, "simulate again and save the run anew")
MOST_EVENTS = 10**6  # largest number of events in a file, to limit memory: an event takes some 100 bytes
_EVENT_UNITS = {
    "time": "s", "velocity": "m/s", "normal_stress": "Pa", "shear_stress": "Pa", "spring_stress": "Pa", "slip": "m",
}  # fmt: skip
_CONTACT_UNITS = {
    "time": "s", "velocity": "m/s", "normal_force": "N", "friction_force": "N", "pull": "N", "slip": "m",
}  # fmt: skip
_ATTRIBUTES = {
    "rig": str, "status": str, "end": float, "method": str, "rtol": float, "steps": int, "rejected": int,
    "lowest_velocity": float, "peak_velocity": float,
    "steadyslip": str,
}  # fmt: skip


def to_dataset(history: HistoryData) -> Any:
    """xarray.Dataset of a history; see `History.to_xarray`."""
    import xarray as xr

    from steadyslip.files.specifications import stored_text

    variables = {
        name: ("time", values, {"units": history.units[name]}) for name, values in history.data.items() if name != "t"
    }
    events, numbers = history.events, _event_units(history.rig)
    variables |= {
        f"event_{name}": ("event", np.array([getattr(e, name) for e in events], dtype=float), {"units": unit})
        for name, unit in numbers.items()
    }
    variables["event_kind"] = ("event", np.array([e.kind for e in events], dtype=object), {})
    lowest, highest = history.velocities if isinstance(history.velocities, tuple) else _extremes(history.velocities)
    if isinstance(history.velocities, dict):
        contacts = [e.contact for e in events if isinstance(e, ContactEvent)]
        variables["event_contact"] = ("event", np.array(contacts, dtype=object), {})
        for i, name in enumerate(("lowest_velocity", "peak_velocity")):
            variables[name] = ("contact", np.array([own[i] for own in history.velocities.values()]), {"units": "m/s"})
    attributes = {
        "rig": stored_text(history.rig, history.protocol),
        "status": history.status,
        "end": history.end,
        "method": history.method,
        "rtol": history.rtol,
        "steps": history.steps,
        "rejected": history.rejected,
        "lowest_velocity": lowest,
        "peak_velocity": highest,
        "steadyslip": history.version,
    }
    return xr.Dataset(variables, coords={"time": ("time", history.data["t"], {"units": "s"})}, attrs=attributes)


def _extremes(velocities: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """Lowest and highest velocity of all contacts."""
    return min(low for low, _ in velocities.values()), max(high for _, high in velocities.values())


def _event_units(rig: Slider | Machine) -> dict[str, str]:
    return _CONTACT_UNITS if rig.in_forces else _EVENT_UNITS


def save(history: HistoryData, path: str | PathLike[str]) -> None:
    """Write a history as netCDF; an existing file is replaced only when the new one is complete.

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
    """Fields of a history from a file written by `save`.

    Nothing in the file is executed; the content is verified.

    Raises
    ------
    NotAvailable
        If the file is not a saved history, is damaged, or cannot be read.
    """
    from steadyslip.files.specifications import protocol_from_text, rig_from_text
    from steadyslip.model.build import model_of
    from steadyslip.protocol import Protocol

    table = ExpectedTable(path, RUN, _ATTRIBUTES)
    attributes = table.attributes
    _check_words(table)
    try:
        rig = rig_from_text(attributes["rig"], str(path))
        protocol = protocol_from_text(attributes["rig"], str(path)) or Protocol()
        acting = targets(rig, protocol)
        units = {"t": "s"} | observable_units(model_of(rig, (), acting.drive), acting)
    except SteadyslipError as error:
        raise table.fault(f"its rig is refused: {error}") from error
    columns = {"time" if name == "t" else name: ColumnRule(("time",), unit) for name, unit in units.items()}
    numbers = _event_units(rig)
    columns |= {f"event_{name}": ColumnRule(("event",), unit) for name, unit in numbers.items()}
    columns["event_kind"] = ColumnRule(("event",), text=True)
    if rig.contact_names:
        columns["event_contact"] = ColumnRule(("event",), text=True)
        columns |= {name: ColumnRule(("contact",), "m/s") for name in ("lowest_velocity", "peak_velocity")}
    found = table.columns(columns)
    if table.sizes["event"] > MOST_EVENTS:
        raise table.fault(f"it has {table.sizes['event']} events, allowed are {MOST_EVENTS}")
    kinds = found["event_kind"]
    if unknown := set(kinds) - set(LOG_KINDS[1:]):
        raise table.fault(f"it has an event of unknown kind, {unknown.pop()!r:.40}")
    moments = list(zip(*(found[f"event_{name}"].tolist() for name in numbers), strict=True))
    velocities: Any = (attributes["lowest_velocity"], attributes["peak_velocity"])
    if rig.contact_names:
        velocities = _velocities(table, rig, found)
    contacts = found.get("event_contact", [""] * len(kinds))
    events = [
        ContactEvent(kind, row[0], contact, *row[1:]) if contact else Event(kind, *row)
        for kind, contact, row in zip(kinds, contacts, moments, strict=True)
    ]
    data = {name: found["time" if name == "t" else name] for name in units}
    _check_samples(table, data)
    return {
        "rig": rig,
        "protocol": protocol,
        "data": data,
        "units": units,
        "events": tuple(events),
        **{name: attributes[name] for name in ("status", "end", "method", "rtol", "steps", "rejected")},
        "velocities": velocities,
        "version": attributes["steadyslip"],
    }


def _velocities(table: ExpectedTable, rig: Rig, found: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Lowest and highest slip rate of every contact."""
    names = list(rig.contacts)
    if table.sizes["contact"] != len(names) or set(found["event_contact"]) - set(names):
        raise table.fault(f"its contacts are not those of its rig, {', '.join(names)}")
    pairs = zip(found["lowest_velocity"].tolist(), found["peak_velocity"].tolist(), strict=True)
    return dict(zip(names, pairs, strict=True))


def _check_words(table: ExpectedTable) -> None:
    """Check that attributes of a file have values that a history can have."""
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
    """Check that times rise, and that a run with status done has finite values only."""
    if not (np.all(np.isfinite(data["t"])) and np.all(np.diff(data["t"]) >= 0)):
        raise table.fault("its times do not rise")
    if table.attributes["status"] == "done":
        for name, values in data.items():
            if not np.all(np.isfinite(values)):
                raise table.fault(f"it says that it is done, but {name} is not finite throughout")


def to_csv(history: HistoryData, path: str | PathLike[str]) -> None:
    """Write the samples as comma-separated text; stresses become forces if the rig has an area.

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
