"""The house: a name means one thing, only laws know laws, and the changelog is short; imports are in pyproject.toml."""

import ast
import dataclasses
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import steadyslip
import steadyslip as ss

SOURCE = Path(steadyslip.__file__).parent
ROOT = Path(__file__).parents[2]


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
    assert not twice


def test_no_three_folders_have_a_file_of_the_same_name():
    """`commands.py` stood in five folders, so that a file's name did not say what is in it."""
    folders = defaultdict(list)
    for path in trees():
        folders[path.name].append(str(path.parent))
    assert {name: own for name, own in folders.items() if len(own) > 2 and name != "__init__.py"} == {}


OVER_ALL = ("reports", "reproduce")
"""Folders that may import from the package's own list of public names, which imports nearly everything else."""


def test_modules_name_the_module_they_need():
    """`from steadyslip import units` anywhere below makes one circle of all stubs: mypy would check the whole anew."""
    found = [
        f"{path}:{node.lineno}"
        for path, tree in trees().items()
        for node in ast.walk(tree)
        if path.parts[0] not in OVER_ALL
        if isinstance(node, ast.ImportFrom) and node.module == "steadyslip"
    ]
    assert found == []


KNOWS_LAWS = ("laws", "machine", "testing", "reproduce")
"""Folders that may name a law; and the figure of the paper that is about one."""
OF_THE_PAPER = {Path("figures/paper_figure_7.py"), Path("linear/paper.py")}
FOUNDED = {"velocity", "stiffness", "axial_stiffness", "mass", "damping", "radiation_damping", "area"}
"""Parameters of every rig: the slider's own, and the velocity of its drive."""


def laws_and_their_fields():
    """Classes of every family, the words that rig files use for them, and the names of their parameters."""
    families = (ss.laws.FrictionLaw, ss.laws.ContactLaw, ss.laws.Evolution, ss.laws.NormalMemory, ss.machine.Drive)
    laws = [law for family in families for law in family.registry.values()]
    laws = [law for law in laws if law.__module__.startswith("steadyslip.")]
    fields = {item.name for law in (*laws, ss.laws.State) for item in dataclasses.fields(law)} - {
        "direction"
    }  # a method too
    roles = {item.name for family in families for item in dataclasses.fields(family)} - {"velocity"}
    assert not roles
    parts = {"evolution", "states", "normal_memory"}
    return {law.__name__ for law in laws} | {"State"}, {law.name for law in laws}, (fields | parts) - FOUNDED


def prose(tree):
    """Strings that are docstrings, or text for people: with a blank in them."""
    return {id(node) for node in ast.walk(tree) if isinstance(node, ast.Constant) and " " in str(node.value)}


def test_only_laws_know_laws():
    """No class of a law imported, no parameter or private method of one used, no name of one compared."""
    classes, words, fields = laws_and_their_fields()
    # arguments of `lab_rig`, which makes a rig of the usual law
    arguments = {("experiments/spec.py", name) for name in ("v_ref", "normal_memory")}
    sizes = ("mu_coulomb", "mu_static", "mu_ref", "sample_time", "drive.resolution")  # told by name from others
    sizes += ("stribeck_exponent",)
    arguments |= {("files/specifications/bare_numbers.py", name) for name in sizes}
    arguments |= {
        ("files/specifications/sizes.py", f"drive.{name}") for name in ("kp", "kd", "ki", "sample_time", "delay")
    }
    arguments.add(("nonlinear/hunting/hunt_result.py", "drive.resolution"))  # an encoder's step in words
    telling = {word for word in words | fields if {"_", "-"} & set(word)}  # others mean more than a law
    found = []
    for path, tree in trees().items():
        if path.parts[0] in KNOWS_LAWS or path in OF_THE_PAPER:
            continue
        spoken = prose(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("steadyslip.laws"):
                found += [f"{path}:{node.lineno} imports {a.name}" for a in node.names if a.name in classes]
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Attribute | ast.Name):
                owner = node.value.attr if isinstance(node.value, ast.Attribute) else node.value.id
                if owner in ("friction", "contact", "drive") and (node.attr in fields or node.attr.startswith("_")):
                    found.append(f"{path}:{node.lineno} uses {owner}.{node.attr}")
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in spoken:
                last = node.value.rpartition(".")[2]
                dotted = node.value.startswith(("friction.", "contact.", "drive.")) and last in fields
                if (dotted or node.value in telling) and (path.as_posix(), node.value) not in arguments:
                    found.append(f"{path}:{node.lineno} says {node.value!r}")
    assert "\n".join(found) == ""


def bound_around(node, above):
    """Names that comprehensions around a node bind anew for each of their elements."""
    found = set()
    while (node := above.get(node)) is not None and not isinstance(node, ast.FunctionDef | ast.ClassDef):
        for one in getattr(node, "generators", ()):
            found |= {name.id for name in ast.walk(one.target) if isinstance(name, ast.Name)}
    return found


def test_no_generator_that_is_kept_reads_the_variable_of_a_loop():
    """A list of generators computes them when it is whole, and all of them find the variable's last value."""
    found = []
    for path, tree in trees().items():
        above = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
        for node in ast.walk(tree):
            kept = isinstance(above.get(node), ast.ListComp | ast.SetComp | ast.DictComp | ast.List | ast.Tuple)
            if not (kept and isinstance(node, ast.GeneratorExp)):
                continue
            own = {name.id for one in node.generators for name in ast.walk(one.target) if isinstance(name, ast.Name)}
            late = [
                node.elt,
                *(one.iter for one in node.generators[1:]),
                *(e for one in node.generators for e in one.ifs),
            ]
            read = {name.id for part in late for name in ast.walk(part) if isinstance(name, ast.Name)} - own
            if names := read & bound_around(node, above):
                found.append(f"{path}:{node.lineno} reads {', '.join(names)} late; make it a list")
    assert not found


def test_the_changelog_is_short_and_names_what_there_is():
    """At most 10 kB, so that it is read; a name in it that code and documentation do not know is false."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert len(text.encode()) <= 10_000, "merge lines, or leave details to the documentation"
    known = set()
    for folder, kind in (("src", "*.py"), ("docs", "*.md"), ("examples", "*.toml")):
        for path in (ROOT / folder).rglob(kind):
            known.update(re.findall(r"[\w-]+", path.read_text(encoding="utf-8")))
            known.update(re.findall(r"\w+", path.read_text(encoding="utf-8")))
    named = {word for code in re.findall(r"`([^`]+)`", text) for word in re.findall(r"[A-Za-z_][\w-]*", code)}
    assert named <= known
