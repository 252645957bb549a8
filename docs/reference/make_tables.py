"""Write rig-file.md and python.md from the package's own declarations: python docs/reference/make_tables.py"""

from __future__ import annotations

import ast
import importlib
import inspect
from dataclasses import MISSING
from pathlib import Path

import steadyslip
from steadyslip import figures
from steadyslip.core.quantities import is_per_area, total_unit
from steadyslip.core.records import FrozenRecord, Option, Parameter, Part, Series
from steadyslip.files.specifications.layout import PROTOCOL, has_choice, own_fields, sections, selector
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

HERE = Path(__file__).parent

# --- rig-file.md ------------------------------------------------------------------------------------

RIG_HEAD = """# Rig file

A rig file is TOML, plain text in UTF-8, with the tables `[friction]`, `[contact]`, `[slider]` and `[drive]`; a
table `[protocol]` may say what is done to the rig in an experiment. A whole one is
[examples/inclined-spring.toml](../../examples/inclined-spring.toml).

- A number without quotes is in the SI unit of the table below. Text such as `"9 GPa/m"` or `"-45 deg"` carries its
  unit and is checked for the right dimension; anything that can be written so may be.
- Everything is per unit contact area. With `area` in `[slider]`, a quantity that has two units below is the total for
  the whole contact, in the second one; text may then be in either.
- A key has a dotted name, `contact.angle`, the same in Python and with `--set`. Members of a list count from 1:
  `friction.states.1.b`.
- A law inside a table is a table of its own: `[friction.normal_memory]` with `law = "linker-dieterich"`; one
  without parameters may be a word, `normal_memory = "prakash-clifton"`. The parameters of `evolution` stand beside it
  in `[friction]`.
- Several states are a list: `[[friction.states]]` once for each; so are the pieces of a protocol, `[[protocol.pieces]]`
  with `kind = "velocity-step"` and its keys.
- A measured column is a list of numbers, `[0, 1.5, 3]`, or of texts with units.
- A key without default that is not required is absent unless given.
- A table `[map]` says what to compute for many rigs at once: see [Table of a map](map-file.md).
- `law` may also name a law of yours: see [Add a friction law](../how-to/add-a-friction-law.md).

`steadyslip schema` prints the JSON schema of this format, for editors. This page is written by `make_tables.py` from
the declarations in the source.
"""


def default_of(item) -> str:
    if item.default is MISSING:
        return "required"
    if item.default is None or item.default == ():
        return ""
    if isinstance(item.default, FrozenRecord):
        return f"`{item.default.name}`"
    if isinstance(item.default, bool):
        return f"`{str(item.default).lower()}`"
    return f"`{item.default:g}`" if isinstance(item.default, float) else f"`{item.default}`"


def unit_of(role) -> str:
    if role.unit == "1":
        return "–"
    return f"{role.unit} or {total_unit(role.unit)}" if is_per_area(role.unit) else role.unit


def row(item, role) -> str:
    if isinstance(role, Parameter):
        unit, allowed = unit_of(role), role.domain.text
    elif isinstance(role, Series):
        unit, allowed = unit_of(role), "list of finite numbers"
    elif isinstance(role, Option):
        unit, allowed = "", ", ".join(f"`{str(c).lower() if isinstance(c, bool) else c}`" for c in role.choices)
    else:
        words = ", ".join(f"`{name}`" for name in role.family.registry)
        unit, allowed = "", "list of tables" if role.many else f"one of {words}"
    return f"| `{item.name}` | {unit} | {allowed} | {default_of(item)} | {role.doc} |"


def table(law) -> list[str]:
    rows = [row(item, role) for item, role in own_fields(law)]
    if not rows:
        return ["No parameters.", ""]
    return ["| key | unit | allowed | default | meaning |", "|---|---|---|---|---|", *rows, ""]


def summary(thing) -> str:
    """The first line of a docstring, safe inside a Markdown table."""
    line = (inspect.getdoc(thing) or "").partition("\n")[0].replace("``", "`").replace("|", "\\|")
    pieces = line.split("`")  # every second one is code
    return "`".join(piece if i % 2 else piece.replace("*", "\\*") for i, piece in enumerate(pieces))


def parts_of(law, done: set[type]) -> list[str]:
    """Sections for the tables inside a table."""
    lines: list[str] = []
    for item, role in own_fields(law):
        if isinstance(role, Part) and role.family not in done:
            done.add(role.family)
            if role.many and not has_choice(role.family):
                lines += [f"### Each of `{item.name}`", "", *table(role.family)]
            for name, choice in role.family.registry.items():
                word = selector(role.family)[0]
                key = f"{item.name} = " if role.inline else f"{item.name}: {word} = "
                lines += [f'### `{key}"{name}"`', "", summary(choice), "", *table(choice)]
    return lines


def rig_page() -> str:
    lines = [RIG_HEAD]
    done: set[type] = set()
    for section in sections():
        if section.family is None:
            lines += [f"## `[{section.name}]`", "", summary(Slider), "", *table(Slider)]
            continue
        key, default = selector(section.family)
        for name, law in section.family.registry.items():
            absent = f", or without `{key}`" if name == default else ""
            lines += [f'## `[{section.name}]` with `{key} = "{name}"`{absent}', "", summary(law), "", *table(law)]
            lines += parts_of(law, done)
    lines += [f"## `[{PROTOCOL.name}]`", "", summary(Protocol), "", *table(Protocol), *parts_of(Protocol, done)]
    return "\n".join(lines).rstrip() + "\n"


# --- python.md --------------------------------------------------------------------------------------

PYTHON_HEAD = """# Python

Everything public is a name in `steadyslip`; nothing needs importing from deeper. Each entry is the first line of the
docstring; `help(steadyslip.analyze)` shows the rest. Numbers in and out are SI, per unit contact area also where the
rig has an `area`; constructors, `with_values` and `between=` read text such as `"9 GPa/m"` too. Laws are frozen; their
arguments are the keys of a [rig file](rig-file.md), by keyword (a drive's velocity also by position). "Theory 3" is
section 3 of [Equations and where they live](equations.md). This page is written by `make_tables.py`.
"""
GROUPS = {
    "": "Modules",
    "verdict": "The verdict",
    "files.specifications": "Rig files",
    "laws.contact": "Contact laws",
    "machine.drive": "Drives",
    "core.errors": "Exceptions",
    "laws.friction": "Friction laws",
    "experiments": "Records and fits",
    "linear": "Linear stability",
    "model": "The Model",
    "motion": "Motion",
    "nonlinear": "Beyond the edge",
    "protocol": "Protocols of experiments",
    "core.records": "To declare a law of your own",
    "machine.slider": "The rig",
    "model.steady": "Steady sliding",
    "maps": "Maps",
}
ORDER = (
    *("machine.slider", "laws.friction", "laws.contact", "machine.drive", "protocol", "files.specifications"),
    *("verdict", "model.steady", "linear", "model", "core.records"),
    *("core.errors", "experiments", "motion", "nonlinear", "maps"),
)
MODULES = {
    "figures": tuple(name for name in figures.__all__ if name.islower()),
    "report": ("fit_report",),
    "testing": ("check_friction_law", "check_contact_law"),
}


def public_names() -> dict[str, list[str]]:
    """Names of ``__init__.pyi`` by the module they come from."""
    tree = ast.parse((Path(steadyslip.__file__).with_suffix(".pyi")).read_text(encoding="utf-8"))
    return {node.module or "": [a.name for a in node.names] for node in tree.body if isinstance(node, ast.ImportFrom)}


def entry(name: str, thing) -> str:
    called = name
    if inspect.isfunction(thing):
        called += "(" + ", ".join(inspect.signature(thing).parameters) + ")"
    elif getattr(thing, "name", ""):
        called += f'` `"{thing.name}"'
    return f"| `{called}` | {summary(thing)} |"


def python_page() -> str:
    names = public_names()
    lines = [PYTHON_HEAD]
    for module in (*(name for name in ORDER if name in names), *sorted(set(names) - set(ORDER) - {""}), ""):
        lines += [f"## {GROUPS[module]}", "", "| name | what it is |", "|---|---|"]
        lines += [entry(name, getattr(steadyslip, name)) for name in names[module]]
        lines.append("")
    for module, functions in MODULES.items():
        lines += [f"### `steadyslip.{module}`", "", "| name | what it is |", "|---|---|"]
        found = importlib.import_module(f"steadyslip.{module}")
        lines += [entry(name, getattr(found, name)) for name in functions]
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


PAGES = {"rig-file.md": rig_page, "python.md": python_page}

if __name__ == "__main__":
    for file, page in PAGES.items():
        (HERE / file).write_text(page(), encoding="utf-8", newline="\n")
