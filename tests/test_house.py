"""The house: a name means one thing, and the folders keep their order."""

import ast
from collections import defaultdict
from functools import cache
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
