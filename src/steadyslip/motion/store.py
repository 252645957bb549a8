"""Histories in files: netCDF with the rig inside, and plain columns."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.errors import NotAvailable
from steadyslip.motion.events import Event
from steadyslip.output import read_dataset, write_dataset

if TYPE_CHECKING:
    from steadyslip.motion.result import History

_EVENT_FIELDS = {"velocity": "m/s", "normal_stress": "Pa", "shear_stress": "Pa", "spring_stress": "Pa", "slip": "m"}


def to_dataset(history: History) -> Any:
    """See `History.to_xarray`."""
    import xarray as xr

    from steadyslip import __version__
    from steadyslip.config import rig_to_text

    variables = {
        name: ("time", values, {"units": history.units[name]}) for name, values in history.data.items() if name != "t"
    }
    events = history.events
    variables |= {
        f"event_{name}": ("event", np.array([getattr(e, name) for e in events], dtype=float), {"units": unit})
        for name, unit in {"time": "s", **_EVENT_FIELDS}.items()
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
        "steadyslip": __version__,
    }
    return xr.Dataset(variables, coords={"time": ("time", history.data["t"], {"units": "s"})}, attrs=attributes)


def save(history: History, path: str | PathLike[str]) -> None:
    """Write a history as netCDF; a file of that name is replaced only once the new one is whole.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    write_dataset(to_dataset(history), path)


def load_history(path: str | PathLike[str]) -> History:
    """Read a history that `History.save` wrote.

    Raises
    ------
    NotAvailable
        If the file is not one of ours or cannot be read.
    """
    from steadyslip.config import protocol_from_text, rig_from_text
    from steadyslip.motion.result import History
    from steadyslip.protocol import Protocol

    dataset = read_dataset(path)
    if "rig" not in dataset.attrs or "time" not in dataset:
        raise NotAvailable(f"{str(path)!r} is not a steadyslip history: it has no rig in it")
    text = str(dataset.attrs["rig"])
    data = {"t": dataset["time"].values}
    units = {"t": "s"}
    for name, variable in dataset.data_vars.items():
        if variable.dims == ("time",):
            data[str(name)] = variable.values
            units[str(name)] = str(variable.attrs["units"])
    columns = [dataset[f"event_{name}"].values for name in ("time", *_EVENT_FIELDS)]
    kinds = [str(kind) for kind in dataset["event_kind"].values]
    return History(
        rig=rig_from_text(text, str(path)),
        protocol=protocol_from_text(text, str(path)) or Protocol(),
        data=data,
        units=units,
        events=tuple(Event(k, *(float(x) for x in row)) for k, *row in zip(kinds, *columns, strict=True)),
        status=str(dataset.attrs["status"]),
        end=float(dataset.attrs["end"]),
        method=str(dataset.attrs["method"]),
        rtol=float(dataset.attrs["rtol"]),
        steps=int(dataset.attrs["steps"]),
        rejected=int(dataset.attrs["rejected"]),
    )


def to_csv(history: History, path: str | PathLike[str]) -> None:
    """Write the samples as comma-separated text.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    names = list(history.data)
    header = ",".join(f"{name} ({history.units[name]})" for name in names)
    try:
        np.savetxt(path, np.column_stack([history.data[n] for n in names]), "%.15g", ",", header=header, comments="")
    except OSError as error:
        raise NotAvailable(f"cannot write {str(path)!r}: {error.strerror or error}") from error
