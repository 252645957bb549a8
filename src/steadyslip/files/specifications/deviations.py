"""Tolerances written in the values of a rig's tables, and the schemas of the tables beside them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from steadyslip.core.errors import Problem, QuantityError
from steadyslip.core.roles import Schema
from steadyslip.core.tolerances import Tolerance, split_tolerance
from steadyslip.files.specifications.layout import machine_sections, sections
from steadyslip.files.specifications.toml import Table

_PAIR = {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}
SCHEMA: Schema = {
    "tolerances": {
        "type": "object",
        "description": "how far values may be off, by dotted name: text such as '20 %', '+5 % -1 %' or '2 N/um'",
    },
    "correlations": {
        "type": "array",
        "description": "pairs of parameters whose tolerances depend on each other",
        "items": {
            "type": "object",
            "required": ["between", "value"],
            "additionalProperties": False,
            "properties": {"between": _PAIR, "value": {"type": "number", "minimum": -1, "maximum": 1}},
        },
    },
    "adjust": {
        "type": "object",
        "description": "what may be changed, by dotted name: { from = ..., to = ..., cost = ... }",
    },
}
"""JSON schemas of the tables."""


def taken_out(tables: Table) -> tuple[dict[str, Tolerance], list[Problem]]:
    """Tolerances written in the values of a rig's tables, which keep the values alone; and the problems."""
    found: dict[str, Tolerance] = {}
    problems: list[Problem] = []
    names = dict.fromkeys(section.name for section in (*sections(), *machine_sections()))
    for path, owner, key, text in _texts({name: tables[name] for name in names if name in tables}, ""):
        try:
            parts = split_tolerance(text)
        except QuantityError as error:
            problems.append(Problem(path, str(error)))
            continue
        if parts is not None:
            owner[key], found[path] = parts
    return found, problems


def _texts(table: Any, path: str) -> Iterator[tuple[str, Any, Any, str]]:
    """Dotted name, container, key and text of every text in nested tables; members of lists count from 1."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in list(pairs):
        name = f"{path}{key if isinstance(table, dict) else key + 1}"
        if isinstance(value, str):
            yield name, table, key, value
        elif isinstance(value, (dict, list)):
            yield from _texts(value, f"{name}.")
