"""JSON schema of rig files for editors and other programs, generated from the declarations of records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from steadyslip.core.records import Declared, FrozenRecord, Named, Part, is_required, key_of
from steadyslip.core.roles import Schema
from steadyslip.files.specifications.deviations import SCHEMA as TOLERANCES
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    UNKNOWN,
    UNKNOWN_SCHEMA,
    Section,
    has_choice,
    machine_sections,
    own_fields,
    sections,
    selector,
)
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

MOST_DOTS = 4  # largest number of dots in a parameter's name: protocol.pieces.1.to has 3
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def rig_schema(further: Sequence[Section] = ()) -> Schema:
    """JSON schema of a rig file with the additional tables `further`."""
    properties: Schema = {}
    for section in sections():
        if section.family is Slider:
            properties[section.name] = _table(Slider, {}, "the block, its spring and dampers")
        else:
            properties[section.name] = _family(section.family)
    slider = [section.name for section in sections() if section.family is not Slider]
    for section in machine_sections():
        table = (
            _by_key(section.family, section.family.family or "contacts") if section.keyed else _family(section.family)
        )
        both = [properties[section.name], table] if section.name in properties else None
        properties[section.name] = table if both is None else {"anyOf": both}
    properties[PROTOCOL.name] = protocol_schema()
    properties |= TOLERANCES | {UNKNOWN: UNKNOWN_SCHEMA} | further_schema(further)
    machine = [section.name for section in machine_sections() if section.name != "links"]
    either = [{"required": slider}, {"required": machine}]
    return {"type": "object", "properties": properties, "anyOf": either, "additionalProperties": False}


def _by_key(family: type[FrozenRecord], doc: str) -> Schema:
    """Schema of a table that contains one table for each name chosen by the user."""
    one = _family(family) if has_choice(family) else _table(family, {}, _summary(family))
    return {"type": "object", "description": f"{doc}, a table for each name", "additionalProperties": one}


def protocol_schema() -> Schema:
    """Schema of the table of a protocol."""
    return _table(Protocol, {}, _summary(Protocol))


def further_schema(further: Sequence[Section]) -> Schema:
    """Schemas of additional tables, by name."""
    return {one.name: _table(one.family, {}, _summary(one.family)) for one in further}


def partial(schema: Any) -> Any:
    """Schema without required keys, for incomplete files."""
    if isinstance(schema, list):
        return [partial(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: partial(one) for key, one in schema.items() if not (key == "required" and isinstance(one, list))}
    return {"anyOf" if key == "oneOf" else key: one for key, one in kept.items()}


def _family(family: type[FrozenRecord]) -> Schema:
    """Schema of a table for a record of this family, with one alternative for each registered law."""
    key, default = selector(family)
    alternatives = []
    for name, law in family.registry.items():
        schema = _table(law, {key: {"const": name}}, _summary(law))
        if name != default:
            schema["required"] = [key, *schema.get("required", [])]
        alternatives.append(schema)
    return {"description": family.family, "oneOf": alternatives}


def _table(law: type[FrozenRecord], properties: Schema, description: str) -> Schema:
    properties = dict(properties)
    required: list[str] = []
    schema: Schema = {"type": "object", "description": description, "properties": properties}
    rest: Schema | bool = False
    for item, role in own_fields(law):
        if isinstance(role, Part) and role.inline:
            properties[item.name] = {"enum": list(role.family.registry), "description": role.doc}
            for choice in role.family.registry.values():
                for inner, inner_role in own_fields(choice):
                    properties[inner.name] = _value(inner_role)
        elif isinstance(role, Part) and role.by_name:
            properties |= {name: _table(one, {}, _summary(one)) for name, one in role.family.registry.items()}
            rest = {"type": "object", "description": f"{role.doc} that an installed package offers"}
        else:
            properties[key_of(item)] = _value(role)
            required += [key_of(item)] if is_required(item) else []
    if required:
        schema["required"] = required
    schema["additionalProperties"] = rest
    return schema


def _value(role: Declared) -> Schema:
    if isinstance(role, Part):
        return _part(role)
    if isinstance(role, Named):
        return {"type": "object", "description": role.doc, "additionalProperties": _by_dotted_name(role, MOST_DOTS)}
    return role.schema()


def _by_dotted_name(role: Named, depth: int) -> Schema:
    """Schema of a value, or of values in nested tables, into which TOML turns unquoted dots in names."""
    either = [_table(role.family, {}, _summary(role.family))]
    if role.listed:
        either.append({"type": "array", "items": {"anyOf": [{"type": "number"}, {"type": "string"}]}})
    if depth:
        either.append({"type": "object", "additionalProperties": _by_dotted_name(role, depth - 1)})
    return {"anyOf": either}


def _part(role: Part) -> Schema:
    if role.keyed:
        return _by_key(role.family, role.doc)
    if role.many:
        member = _family(role.family) if has_choice(role.family) else _table(role.family, {}, _summary(role.family))
        return {"type": "array", "items": member, "description": role.doc}
    if has_choice(role.family):
        return {"description": role.doc, "anyOf": [{"enum": list(role.family.registry)}, _family(role.family)]}
    table = _table(role.family, {}, _summary(role.family))
    if not role.family.short:
        return table | {"description": role.doc}
    items = {key_of(item): _value(inner) for item, inner in own_fields(role.family)}
    several = {"type": "array", "prefixItems": [items[key] for key in role.family.short], "items": False}
    return {"description": role.doc, "anyOf": [items[role.family.short[0]], several, table]}


def _summary(law: type[FrozenRecord]) -> str:
    return (law.__doc__ or law.__name__).strip().splitlines()[0]
