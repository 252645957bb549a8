"""Source text of the driver's modules for the translators, and syntax trees with numbers in place of enum members."""

from __future__ import annotations

import ast
import re
from importlib.resources import files
from typing import Any, cast

from steadyslip.kernels.layout import (
    Control,
    Cursor,
    EventPlace,
    Final,
    Held,
    Kind,
    Layout,
    Out,
    Recorded,
    Routines,
    Row,
    Sampled,
    Setting,
    Status,
    Turn,
)

DRIVER = "steadyslip.kernels.driver"
_ENUMS = {
    enum.__name__: enum
    for enum in (Row, Setting, Cursor, Status, EventPlace, Kind, Sampled, Recorded, Final, Out, Held, Control, Turn)
}
_IMPORTED = re.compile(rf"^from ({re.escape(DRIVER)}\.\w+) import ", re.MULTILINE)
"""Matches imports of driver modules; parsing the modules to find them would take a twentieth of a verdict's time."""
_TUPLES: dict[str, Any] = {"layout": Layout, "routines": Routines}


def text_of(module: str) -> str:
    """Source text of a module of the package."""
    package, _, name = module.rpartition(".")
    return files(package).joinpath(f"{name}.py").read_text(encoding="utf-8")


def texts(*modules: str) -> dict[str, str]:
    """Source text of driver modules by name; the modules that a module imports precede it."""
    found: dict[str, str] = {}
    for module in modules:
        _gather(module, found)
    return found


def _gather(module: str, found: dict[str, str]) -> None:
    if module in found:
        return
    text = text_of(module)
    for imported in _IMPORTED.findall(text):
        _gather(imported, found)
    found[module] = text


def is_driver(module: str | None) -> bool:
    """True for a module of the driver."""
    return (module or "").startswith(f"{DRIVER}.")


def numbered(text: str) -> ast.Module:
    """Syntax tree of a module with numbers in place of enum members and layout fields, without driver imports."""
    return cast(ast.Module, ast.fix_missing_locations(_Numbered().visit(ast.parse(text))))


class _Numbered(ast.NodeTransformer):
    """Replace enum members by numbers and fields of `Layout` and `Routines` by array subscripts.

    Imports between driver modules are removed, because all functions are put into one namespace.
    """

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.ImportFrom | None:
        return None if is_driver(node.module) else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if not isinstance(node.value, ast.Name):
            return cast(ast.expr, self.generic_visit(node))
        owner = node.value.id
        if owner in _ENUMS:
            return ast.copy_location(ast.Constant(int(_ENUMS[owner][node.attr])), node)
        if owner in _TUPLES:
            place = ast.Constant(_TUPLES[owner]._fields.index(node.attr))
            return ast.copy_location(ast.Subscript(node.value, place, ast.Load()), node)
        return node
