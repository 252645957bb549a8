"""The house: a name means one thing, and the folders keep their order."""

import ast
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import steadyslip

SOURCE = Path(steadyslip.__file__).parent


@cache
def trees() -> dict[Path, ast.Module]:
    return {path.relative_to(SOURCE): ast.parse(path.read_text(encoding="utf-8")) for path in SOURCE.rglob("*.py")}


def test_a_class_has_its_name_to_itself():
    owners = defaultdict(list)
    for path, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                owners[node.name].append(str(path))
    twice = {name for name, paths in owners.items() if len(paths) > 1}
    assert twice == {
        "Curve",
        "Event",
        "Program",
        "Record",
        "Runs",
        "Setting",
    }  # still to be told apart: kernels, nonlinear


def module_of(path: Path) -> str:
    parts = ("steadyslip", *path.with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_modules_do_not_import_in_circles():
    """Not even for types alone, or late: what a module needs can be read before the module."""
    modules = {module_of(path) for path in trees()}
    graph = defaultdict(set)
    for path, tree in trees().items():
        own = module_of(path)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                named = {f"{node.module}.{alias.name}" for alias in node.names} & modules
                graph[own] |= {*named, *({node.module} & modules if len(named) < len(node.names) else ())} - {own}
    still = ("kernels", "model", "nonlinear")  # folders whose own circles are still to go
    for own, needed in graph.items():
        folder = own.split(".")[1:2]
        needed -= {other for other in needed if other.split(".")[1:2] == folder and folder and folder[0] in still}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle
