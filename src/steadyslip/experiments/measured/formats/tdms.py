"""Reader of TDMS files of LabVIEW: channels in groups; without a time channel, the sampling interval gives the time."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.columns import guess_role, listed, split_name
from steadyslip.experiments.measured.formats.table import Table, check_size, chosen_part, from_vectors

UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit")
TIME, WANTED = "time", {"friction", "shear"}
logging.getLogger("nptdms").setLevel(logging.CRITICAL)  # the raised error already reports the problem


def read(path: Path, table: str | None) -> Table:
    """Numeric channels of the group `table` or, without this option, of the groups that make up a record."""
    with path.open("rb") as stream, TdmsFile.open(stream) as file:  # TdmsFile leaves files open that it cannot read
        groups = {group.name: group for group in file.groups() if any(_numeric(c) for c in group.channels())}
        part = chosen_part(path, "group", table, list(groups))
        own = {name: [c for c in group.channels() if _numeric(c)] for name, group in groups.items()}
        chosen, notes = ([part], []) if part is not None else _of_a_record(path, own)
        channels = [channel for name in chosen for channel in own[name]]
        check_size(path, sum(len(channel) for channel in channels))
        found = {channel.name: (_values(channel), _unit(channel)) for channel in channels}
        if channels and not any(_role(name) == "time" for name in found):
            every = float(channels[0].properties.get("wf_increment", 0.0))
            if every > 0.0:
                found[TIME] = (every * np.arange(len(channels[0])), "s")
                notes.append(f"time counted from the sampling interval of the channels, {every:g} s")
        return from_vectors(path, found, notes)


def _of_a_record(path: Path, own: dict[str, list[Any]]) -> tuple[list[str], list[str]]:
    """Names of the groups that make up a record, and notes.

    These are all groups, if all channels are equally long and have different names; else the only group with a channel
    of friction or shear stress.
    """
    if len(own) <= 1:
        return list(own), []
    names = [channel.name for channels in own.values() for channel in channels]
    sizes = {len(channel) for channels in own.values() for channel in channels}
    if len(set(names)) == len(names) and len(sizes) == 1:
        return list(own), []
    wanted = [group for group, channels in own.items() if WANTED & {_role(channel.name) for channel in channels}]
    if len(wanted) == 1:
        left = ", ".join(group for group in own if group not in wanted)
        return wanted, [f"group {wanted[0]!r}, the only one with friction or stress in it; left out: {left}"]
    raise NotAvailable(f"{str(path)!r} has channels in several groups; say which with table=: {listed(own)}")


def _role(name: str) -> str | None:
    return guess_role(*split_name(name))


def _numeric(channel: Any) -> bool:
    return len(channel) > 1 and getattr(channel.dtype, "kind", "O") in "iufM"


def _values(channel: Any) -> Any:
    """Values of a channel; times are converted to seconds since the first time."""
    values = channel[:]
    if values.dtype.kind == "M":
        return (values - values[0]) / np.timedelta64(1, "s")
    return values


def _unit(channel: Any) -> str | None:
    for name in UNITS:
        if channel.properties.get(name):
            return str(channel.properties[name])
    return "s" if channel.dtype.kind == "M" else None
