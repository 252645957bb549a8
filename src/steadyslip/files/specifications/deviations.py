"""Tolerances written in the values of a rig's tables, and JSON schemas of the tables on tolerances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from steadyslip.core.domains import nonnegative
from steadyslip.core.errors import ParameterError, Problem, QuantityError, UnknownNameError
from steadyslip.core.format import format_quantity
from steadyslip.core.quantities import units_in
from steadyslip.core.roles import Parameter, Schema
from steadyslip.core.tolerances import Tolerance, split_tolerance
from steadyslip.core.written import display_units
from steadyslip.files.specifications.layout import machine_sections, sections
from steadyslip.files.specifications.toml import Table
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

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
"""JSON schemas of the tables on tolerances, by table name."""


def taken_out(tables: Table) -> tuple[dict[str, Tolerance], list[Problem]]:
    """Remove the tolerances from the values in a rig's tables; returns the tolerances by name, and the problems."""
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


def ends_of(rig: Slider | Machine, name: str, tolerance: Tolerance) -> tuple[float, float]:
    """Lowest and highest value of a parameter within its tolerance, SI units.

    Raises
    ------
    ParameterError
        With an empty name: if a deviation has another dimension, both deviations are zero, or a value that is not
        normally distributed could leave its domain.
    """
    one = rig.parameters()[name]
    value = float(one.value or 0.0)

    def half_width(text: str) -> float:
        if text.endswith("%"):
            return 0.01 * float(text[:-1]) * abs(value)
        factor, unit = rig.display_value(name, 1.0)
        return Parameter(unit, nonnegative, "tolerance").read(text, rig.area_of(name)) / factor

    low, high = value - half_width(tolerance.below), value + half_width(tolerance.above)
    if not low < high:
        raise ParameterError([Problem("", "got a tolerance of zero; leave it out")])
    for end in () if tolerance.normal else (low, high):
        try:
            one.role.checked(end)
        except ParameterError as error:
            width = tolerance.below if end == low else tolerance.above
            share = f"{width.partition(' ')[0]} %"
            hint = "" if width.endswith("%") else f"; for a share of the value write '± {share}'"
            with display_units(units_in([width])):
                reached = format_quantity(*rig.display_value(name, end), area=rig.printed_area(name))
            wide = f"a tolerance of {width!r} is too wide: it reaches {reached}; allowed: {one.role.domain.text}{hint}"
            raise ParameterError([Problem("", wide)]) from error
    return low, high


def wrong_ends(rig: Slider | Machine, written: Mapping[str, Tolerance]) -> list[Problem]:
    """Problems with the tolerances in `written`, which a file has in its values, by dotted name."""
    problems: list[Problem] = []
    for path, tolerance in written.items():
        with suppress(UnknownNameError):  # unknown names are reported when tolerances are used
            name = rig.resolve(path)
            if rig.parameters()[name].value is None:
                continue
            try:
                ends_of(rig, name, tolerance)
            except ParameterError as error:
                problems += [Problem(path, one.message) for one in error.problems]
    return problems


def _texts(table: Any, path: str) -> Iterator[tuple[str, Any, Any, str]]:
    """Dotted name, container, key and content of every text in nested tables; members of lists count from 1."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in list(pairs):
        name = f"{path}{key if isinstance(table, dict) else key + 1}"
        if isinstance(value, str):
            yield name, table, key, value
        elif isinstance(value, (dict, list)):
            yield from _texts(value, f"{name}.")
