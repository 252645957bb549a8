"""JSON schema of the rig file, from the records' own declarations, for editors and other programs."""

from __future__ import annotations

import math
from typing import Any

from steadyslip.core.quantities import example
from steadyslip.core.records import FrozenRecord, Option, Parameter, Part, Role, Series, is_required
from steadyslip.files.specifications.layout import MAP, PROTOCOL, has_choice, own_fields, sections, selector
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

Schema = dict[str, Any]


def json_schema() -> Schema:
    """The schema (draft 2020-12) of a rig file as a dict; its JSON is what ``steadyslip schema`` prints."""
    properties: Schema = {}
    required = []
    for section in sections():
        if section.family is None:
            properties[section.name] = _table(Slider, {}, "the block, its spring and dampers")
        else:
            properties[section.name] = _family(section.family)
            required.append(section.name)
    properties[PROTOCOL.name] = _table(Protocol, {}, _summary(Protocol))
    properties[MAP] = _map()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "steadyslip rig",
        "description": "Numbers are SI, per unit contact area (totals if slider.area is given); text carries a unit.",
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


def _map() -> Schema:
    """The table of a map; which parameters and results there are depends on the rig and is checked by its reader."""
    value: Schema = {"anyOf": [{"type": "number"}, {"type": "string"}]}
    spacing: Schema = {"enum": ["linear", "log"], "description": "even in the value or in its logarithm"}
    ends: Schema = {"from": value, "to": value, "spacing": spacing}
    count: Schema = {"type": "integer", "minimum": 1}
    names: Schema = {"type": "array", "items": {"type": "string"}}
    axis: Schema = {"anyOf": [{"type": "array", "items": value}, {"type": "object"}]}
    samples: Schema = {
        "over": {"type": "object", "description": "ranges by dotted name", "additionalProperties": {"type": "object"}},
        "points": count,
        "method": {"enum": ["sobol", "latin-hypercube"]},
        "seed": {"type": "integer", "minimum": 0},
        "fit": {"type": "string", "description": "file of a fit (.nc) from which to draw"},
    }
    return {
        "type": "object",
        "description": "a map: what to compute over which parameters; a further table for the options of each result",
        "properties": {
            "compute": {"anyOf": [{"type": "string"}, names], "description": "results, such as status"},
            "over": {
                "type": "object",
                "description": f"values by dotted name: a list, or a table with points and {', '.join(ends)}",
                "additionalProperties": axis,
            },
            "samples": {"type": "object", "properties": samples, "additionalProperties": False},
            "chunk": count | {"description": "points computed in one go"},
        },
        "additionalProperties": {"type": "object"},
    }


def _family(family: type[FrozenRecord]) -> Schema:
    """One alternative for each registered law."""
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
    for item, role in own_fields(law):
        if isinstance(role, Part) and role.inline:
            properties[item.name] = {"enum": list(role.family.registry), "description": role.doc}
            for choice in role.family.registry.values():
                for inner, inner_role in own_fields(choice):
                    properties[inner.name] = _value(inner_role)
            continue
        properties[item.name] = _value(role)
        if is_required(item):
            required.append(item.name)
    if required:
        schema["required"] = required
    schema["additionalProperties"] = False
    return schema


def _value(role: Role) -> Schema:
    if isinstance(role, Option):
        return {"enum": list(role.choices), "description": role.doc}
    if isinstance(role, Part):
        if role.many:
            member = _family(role.family) if has_choice(role.family) else _table(role.family, {}, _summary(role.family))
            return {"type": "array", "items": member, "description": role.doc}
        return {"description": role.doc, "anyOf": [{"enum": list(role.family.registry)}, _family(role.family)]}
    if isinstance(role, Series):
        member = {"anyOf": [{"type": "number"}, _text(role.unit)]}
        return {"type": "array", "items": member, "description": f"{role.doc}, {role.unit}"}
    return _number(role)


def _number(role: Parameter) -> Schema:
    domain = role.domain
    number: Schema = {"type": "integer" if domain.whole else "number"}
    if math.isfinite(domain.low):
        number["minimum" if domain.low_allowed else "exclusiveMinimum"] = domain.low
    if math.isfinite(domain.high):
        number["maximum" if domain.high_allowed else "exclusiveMaximum"] = domain.high
    unit = "" if role.unit == "1" else f", {role.unit}"
    return {"description": role.doc + unit, "anyOf": [number, _text(role.unit)]}


def _text(unit: str) -> Schema:
    return {"type": "string", "description": f"text such as {example(unit)}"}


def _summary(law: type[FrozenRecord]) -> str:
    return (law.__doc__ or law.__name__).strip().splitlines()[0]
