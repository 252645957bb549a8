"""Writing of rigs and protocols as the text of a rig file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike
from typing import Any

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.records import Address, FrozenRecord, Named, key_of
from steadyslip.core.roles import Entry
from steadyslip.files.output import write_text
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    UNITS_LINE,
    has_choice,
    machine_sections,
    own_fields,
    sections,
    selector,
)
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol


@checked()
def write_rig(rig: Slider | Machine, path: str | PathLike[str], protocol: Protocol | None = None) -> None:
    """Write a rig file, with a protocol if one is given; see `rig_to_text`.

    Raises
    ------
    ParameterError
        If the rig has a law without registered name.
    NotAvailable
        If the file cannot be written.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.write_rig(rig, "copy.toml")
    >>> ss.read_rig("copy.toml") == rig
    True
    """
    write_text(path, rig_to_text(rig, protocol))


@checked()
def rig_to_text(rig: Slider | Machine, protocol: Protocol | None = None) -> str:
    """Rig as TOML text: SI numbers with the unit as a comment; totals (N, N/m, kg) if it has an area.

    Raises
    ------
    ParameterError
        If the rig or the protocol has a law without registered name, which a file cannot refer to.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> print(ss.rig_to_text(rig))
    [friction]
    law = "rate-state"
    a = 0.0145
    b = 0.016
    d_c = 1e-06  # m
    mu_ref = 0.7
    v_ref = 1e-06  # m/s
    <BLANKLINE>
    [friction.normal_memory]
    law = "linker-dieterich"
    alpha = 0.56
    <BLANKLINE>
    [contact]
    law = "inclined-spring"
    preload = 5000000.0  # Pa
    angle = -0.7853981633974483  # rad
    <BLANKLINE>
    [slider]
    stiffness = 9000000000.0  # Pa/m
    <BLANKLINE>
    [drive]
    velocity = 1e-06  # m/s
    """
    blocks = []
    area = rig.area
    for section in machine_sections() if isinstance(rig, Machine) else sections():
        if section.keyed:
            blocks += [_members(section.family, inner, section.name)] if (inner := getattr(rig, section.name)) else []
            continue
        record = rig if section.family is Slider else getattr(rig, section.name)
        first: list[str] = []
        if section.family is not Slider:
            key, default = selector(section.family)
            word = _law_name(record, section.name)
            first = [] if word == default else [f'{key} = "{word}"']
        own = rig.parameters() if rig.bodies and section.name == "drive" else {}
        blocks.append(table_text(f"[{section.name}]", record, first, section.name, area, own))
    if protocol is not None:
        blocks.append(
            table_text(f"[{PROTOCOL.name}]", in_units_of(rig, protocol), [], PROTOCOL.name, rig.protocol_area)
        )
    return "\n".join(blocks)


def stored_text(rig: Slider | Machine, protocol: Protocol | None = None) -> str:
    """Text of `rig_to_text` for stored results, with a first line on the units in which the rig is printed."""
    units = "; ".join([*sorted(rig.written_in), *(f"{name} = {one}" for name, one in rig.units_named.items())])
    return f"{UNITS_LINE}{units}\n{rig_to_text(rig, protocol)}"


def _law_name(record: FrozenRecord, where: str) -> str:
    if not record.name:
        kind = type(record).__name__
        raise ParameterError([Problem(where, f'{kind} has no name; declare it as class {kind}(..., name="...")')])
    return record.name


def table_text(
    header: str, record: FrozenRecord, first: list[str], path: str, area: float | None,
    own: Mapping[str, Address] | None = None,
) -> str:  # fmt: skip
    """TOML text of a record; `own` are parameters by dotted name with the units that they have in this rig."""
    lines = [header, *first]
    if record.in_totals:
        area = getattr(record, "area", None) or 1.0  # a record without an area is in forces
    below: list[str] = []
    for item, role in own_fields(type(record)):
        value, key = getattr(record, item.name), key_of(item)
        if value is None or value == item.default:
            continue
        if isinstance(role, Entry):
            known = (own or {}).get(f"{path}.{key}")
            lines.append(f"{key} = {(role if known is None else known.role).written(value, area)}")
        elif isinstance(role, Named):
            below.append(_named(role, value, f"{path}.{key}"))
        elif role.keyed:
            below.append(_members(role.family, value, f"{path}.{key}"))
        elif role.by_name:
            below += [table_text(f"[{path}.{one.name}]", one, [], f"{path}.{one.name}", area) for one in value]
        elif role.many:
            below += [_member(role.family, member, f"{path}.{key}", path, area) for member in value]
        elif role.inline:
            lines.append(f'{key} = "{_law_name(value, path)}"')
            lines += table_text("", value, [], path, area).splitlines()[1:]
        else:
            name = f"{path}.{key}"
            words = [f'law = "{_law_name(value, name)}"'] if has_choice(role.family) else []
            below.append(table_text(f"[{name}]", value, words, name, area))
    return "\n".join(["\n".join(lines) + "\n", *below])


def _members(family: type[FrozenRecord], members: Mapping[str, FrozenRecord], path: str) -> str:
    """TOML text of members by name, with one table for each member."""
    blocks = []
    for name, one in members.items():
        first = []
        if has_choice(family):
            key, default = selector(family)
            word = _law_name(one, f"{path}.{name}")
            first = [] if word == default else [f'{key} = "{word}"']
        blocks.append(table_text(f"[{path}.{name}]", one, first, f"{path}.{name}", None))
    return "\n".join(blocks)


def _named(role: Named, values: Mapping[str, Any], path: str) -> str:
    """TOML text of values by dotted name, each as an inline table or a list."""
    lines = [f"[{path}]"]
    for name, one in values.items():
        if isinstance(one, role.family):
            inner = (line.partition("  #")[0] for line in table_text("", one, [], path, None).splitlines()[1:])
            text = f"{{ {', '.join(inner)} }}"
        else:
            text = f"[{', '.join(json.dumps(v) if isinstance(v, str) else repr(float(v)) for v in one)}]"
        lines.append(f"{json.dumps(name)} = {text}")
    return "\n".join(lines) + "\n"


def _member(family: type[FrozenRecord], member: FrozenRecord, name: str, path: str, area: float | None) -> str:
    """TOML text of one member of a list of tables."""
    first = [f'{selector(family)[0]} = "{_law_name(member, name)}"'] if has_choice(family) else []
    return table_text(f"[[{name}]]", member, first, path, area)
