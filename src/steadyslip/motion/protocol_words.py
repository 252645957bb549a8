"""Text for the pieces of a protocol, and the parameters that a protocol changes."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.format import format_quantity
from steadyslip.core.records import key_of
from steadyslip.core.roles import Parameter
from steadyslip.files.specifications.layout import own_fields
from steadyslip.machine.rig import Rig
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import LOAD_POINT, NORMAL_STRESS, Piece

_MOST = 4  # largest number of pieces that `protocol_words` lists, so that the text is a line or two (by trial)


def piece_words(rig: Rig, piece: Piece) -> tuple[str, list[str]]:
    """Name and fields of a piece, formatted with units: ``("velocity step", ["at 10 s", "to 2 um/s"])``."""
    turns, area = rig.parameters()["drive.velocity"].role.unit == "rad/s", rig.protocol_area
    items = []
    for item, role in own_fields(type(piece)):
        value: Any = getattr(piece, item.name)
        if value is None or value == item.default:
            continue
        if isinstance(role, Parameter) and isinstance(value, float | int):
            unit = {"m/s": "rad/s", "m": "rad"}.get(role.unit, role.unit) if turns else role.unit
            items.append(f"{key_of(item)} {format_quantity(value, unit, area=area)}")
        else:
            items.append(f"{key_of(item)} {value if isinstance(value, str) else f'{np.size(value)} numbers'}")
    return piece.name.replace("-", " "), items


def protocol_words(rig: Rig, protocol: Protocol) -> str:
    """Format a protocol in a line: ``"velocity step at 10 s, to 2 um/s; hold at 50 s, duration 10 s"``."""
    parts = [f"{name} {', '.join(items)}" for name, items in (piece_words(rig, one) for one in protocol.pieces[:_MOST])]
    more = len(protocol.pieces) - _MOST
    return "; ".join([*parts, *([f"{more} more"] if more > 0 else [])])


def changed_by(rig: Rig, protocol: Protocol) -> list[str]:
    """Names of parameters that a protocol changes: velocity of the drive, normal loads of contacts."""
    pressed = [one for one in protocol.pieces if one.channel == NORMAL_STRESS]
    where = tuple(f"contacts.{name}." if (name := getattr(one, "on", None)) else "" for one in pressed)
    drives = any(one.channel == LOAD_POINT or one.frees_load_point for one in protocol.pieces)
    return [
        name
        for name, one in rig.parameters().items()
        if (drives and name == "drive.velocity") or (one.role.kind == "normal stress" and name.startswith(where))
    ]
