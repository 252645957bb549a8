"""Write rig-file.md and python.md from the code's own declarations: python docs/reference/make_tables.py"""

from __future__ import annotations

from dataclasses import MISSING
from pathlib import Path

import steadyslip as ss
from steadyslip.config.layout import own_fields, sections, selector
from steadyslip.records import Option, Parameter, Part, Record
from steadyslip.slider import Slider

HERE = Path(__file__).parent
HEAD = """# Rig file

A rig file is TOML with the tables `[friction]`, `[contact]`, `[slider]` and `[drive]`. Numbers are SI; text
such as `"9 GPa/m"` or `"-45 deg"` carries its unit and is checked for the right dimension. The keys are the
last parts of the dotted names used in Python and with `--set`.

All stresses, stiffnesses, dampings and the mass are per unit contact area. With `area` in `[slider]` those
quantities are totals instead (N, N/m, N s/m, kg); text may then give either.

`steadyslip schema` prints the JSON schema of this format, for editors. This page is written by
`make_tables.py` from the same declarations.
"""


def default_of(item) -> str:
    if item.default is MISSING:
        return "required"
    if item.default is None:
        return ""
    value = item.default
    if isinstance(value, Record):
        return f"`{value.name}`"
    if value == ():
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def row(item, role) -> str:
    if isinstance(role, Parameter):
        unit = "" if role.unit == "1" else role.unit
        return f"| `{item.name}` | {unit} | {role.domain.text} | {default_of(item)} | {role.doc} |"
    if isinstance(role, Option):
        words = ", ".join(f"`{str(c).lower() if isinstance(c, bool) else c}`" for c in role.choices)
        return f"| `{item.name}` | | {words} | {default_of(item)} | {role.doc} |"
    kind = "list of tables" if role.many else "one of " + ", ".join(f"`{n}`" for n in role.family.registry)
    return f"| `{item.name}` | | {kind} | {default_of(item)} | {role.doc} |"


def table(law) -> list[str]:
    rows = [row(item, role) for item, role in own_fields(law)]
    if not rows:
        return ["No parameters.", ""]
    return ["| key | unit | allowed | default | meaning |", "|---|---|---|---|---|", *rows, ""]


def summary(law) -> str:
    return (law.__doc__ or "").strip().splitlines()[0]


def parts_of(law, done: set[type]) -> list[str]:
    """Sections for the tables inside a table."""
    lines: list[str] = []
    for item, role in own_fields(law):
        if isinstance(role, Part) and role.family not in done:
            done.add(role.family)
            if role.many:
                lines += [f"### Each of `{item.name}`", "", *table(role.family)]
            for name, choice in role.family.registry.items():
                lines += [f"### `{item.name}` = `{name}`", "", summary(choice), "", *table(choice)]
    return lines


def rig_file() -> str:
    lines = [HEAD]
    done: set[type] = set()
    for section in sections():
        if section.family is None:
            lines += [f"## `[{section.name}]`", "", *table(Slider)]
            continue
        key, _ = selector(section.family)
        for name, law in section.family.registry.items():
            lines += [f'## `[{section.name}]` with `{key} = "{name}"`', "", summary(law), "", *table(law)]
            lines += parts_of(law, done)
    return "\n".join(lines).rstrip() + "\n"


PYTHON_HEAD = """# Python

Public names of `steadyslip`, loaded on first use; `help(ss.NAME)` tells the whole of each. Results are frozen and print
themselves. Quantities are SI floats, per unit contact area; `steadyslip.units` has the usual units as numbers.
This page is written by `make_tables.py`.
"""


def python() -> str:
    groups: dict[str, list[str]] = {}
    for name in ss.__all__:
        thing = getattr(ss, name)
        home = getattr(thing, "__module__", None) or "steadyslip modules"
        groups.setdefault(".".join(home.split(".")[:2]), []).append(f"| `{name}` | {summary(thing)} |")
    lines = [PYTHON_HEAD]
    for home in sorted(groups):
        lines += [f"## {home}", "", "| name | what it is |", "|---|---|", *groups[home], ""]
    return "\n".join(lines).rstrip() + "\n"


PAGES = {"rig-file.md": rig_file, "python.md": python}

if __name__ == "__main__":
    for name, make in PAGES.items():
        (HERE / name).write_text(make(), encoding="utf-8")
