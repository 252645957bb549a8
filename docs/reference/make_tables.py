"""Write the lists of keys and names from the package's own declarations: python docs/reference/make_tables.py"""

from __future__ import annotations

import ast
import inspect
from dataclasses import MISSING
from pathlib import Path

import steadyslip
from steadyslip import figures
from steadyslip.core.areas import is_per_area, total_unit
from steadyslip.core.entries import Option
from steadyslip.core.records import FrozenRecord, Named, Part, Settings, key_of
from steadyslip.core.roles import Entry, Parameter, Series
from steadyslip.experiments.spec import TABLES as FIT_TABLES
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    has_choice,
    machine_sections,
    own_fields,
    sections,
    selector,
)
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.map_file import GridSettings, MapSettings, RangeSettings, SampleSettings
from steadyslip.maps.plan.measures import Measure
from steadyslip.protocol import Protocol

HERE = Path(__file__).parent
EXAMPLE = steadyslip.read_rig(HERE.parents[1] / "examples" / "inclined-spring.toml")

# --- rig-file.md ------------------------------------------------------------------------------------

RIG_HEAD = """# Rig file

A rig file is TOML, plain text in UTF-8, with the tables `[friction]`, `[contact]`, `[slider]` and `[drive]`; a
table `[protocol]` may say what is done to the rig in an experiment. A whole one is
[examples/inclined-spring.toml](../../examples/inclined-spring.toml). Rigs of several bodies have the tables of a
[machine](#machines) instead.

- A number without quotes is in the SI unit of the table below. Text such as `"9 GPa/m"` or `"-45 deg"` carries its
  unit and is checked for the right dimension; anything that can be written so may be.
  Verdicts, figures and texts in Python are in the units of the file, and in those that `--set` brings; with an `area`
  each is told as force or as stress, whichever it is in the file. Copies by `with_values` or `dataclasses.replace`
  keep them. A torque may be in `Nm`, a gear ratio `"1/360"`.
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
- Friction per load may be written as that of a load: `bristle_stiffness = "400 N/um at 3.2 kN"` are 125 000 1/m.
- A table `[unknown]` has intervals of parameters that are not known, by dotted name, which `analyze` answers for:
  `friction.bristle_stiffness = ["6 N/um at 3.2 kN", "600 N/um at 3.2 kN"]`. See
  [Friction from a table](../how-to/friction-from-a-table.md).
- A table `[map]` says what to compute for many rigs at once: see [Table of a map](map-file.md).
- `law` may also name a law of yours: see [Add a friction law](../how-to/add-a-friction-law.md).
- A number may have a [tolerance](#tolerances): `"12 ± 20 % N/um"`.

`steadyslip schema` prints the JSON schema of this format, maps and fits included, for editors. This page is written by
`make_tables.py` from the declarations in the source.
"""


def default_of(item) -> str:
    if item.default is MISSING:
        return "required"
    if item.default is None or item.default == ():
        return ""
    if isinstance(item.default, FrozenRecord):
        return f"`{item.default.name}`"
    if isinstance(item.default, tuple):
        return ", ".join(f"`{word}`" for word in item.default)
    if isinstance(item.default, bool):
        return f"`{str(item.default).lower()}`"
    return f"`{item.default:g}`" if isinstance(item.default, float) else f"`{item.default}`"


def unit_of(role, totals: bool) -> str:
    if role.unit == "1":
        return "–"
    return f"{role.unit} or {total_unit(role.unit)}" if totals and is_per_area(role.unit) else role.unit


def row(item, role, totals: bool) -> str:
    if isinstance(role, Named):
        unit, allowed = "", "table of names"
    elif isinstance(role, Part) and not has_choice(role.family) and not role.many:
        short = role.family.short
        unit, allowed = "", f"{' or '.join(short)}, or a table with {' and '.join(short)}" if short else "table"
    elif isinstance(role, Parameter):
        unit, allowed = unit_of(role, totals), role.domain.text
    elif isinstance(role, Series):
        unit, allowed = unit_of(role, totals), "list of finite numbers"
    elif isinstance(role, Option):
        unit, allowed = "", ", ".join(f"`{str(c).lower() if isinstance(c, bool) else c}`" for c in role.choices)
    elif isinstance(role, Entry):
        unit, allowed = getattr(role, "unit", ""), role.allowed()
    else:
        words = ", ".join(f"`{name}`" for name in role.family.registry)
        unit, allowed = "", "list of tables" if role.many else f"one of {words}"
    return f"| `{key_of(item)}` | {unit} | {allowed} | {default_of(item)} | {role.doc} |"


def table(law, totals: bool = True) -> list[str]:
    """The keys of a record; those of settings and machines have one unit only, whatever the rig's area."""
    rows = [
        row(item, role, totals and not issubclass(law, Settings))
        for item, role in own_fields(law)
        if not getattr(role, "by_name", False)
    ]
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
        if section.family is Slider:
            lines += [f"## `[{section.name}]`", "", summary(Slider), "", *table(Slider)]
            continue
        key, default = selector(section.family)
        for name, law in section.family.registry.items():
            absent = f", or without `{key}`" if name == default else ""
            lines += [f'## `[{section.name}]` with `{key} = "{name}"`{absent}', "", summary(law), "", *table(law)]
            lines += parts_of(law, done)
    lines += [f"## `[{PROTOCOL.name}]`", "", summary(Protocol), "", *table(Protocol), *parts_of(Protocol, done)]
    lines += [MACHINE_HEAD, *machine_tables(), TOLERANCES]
    return "\n".join(lines).rstrip() + "\n"


MACHINE_HEAD = """## Machines

A machine has bodies, links, contacts and a drive, each body, link and contact in a table under a name that you give it:
`[bodies.table]`, `[links.screw]`, `[contacts.guide]`. A whole one is
[examples/machines/feed-axis.toml](../../examples/machines/feed-axis.toml); see
[Describe several bodies](../how-to/describe-several-bodies.md).

- Names have letters, digits, hyphens and underscores; a dotted name such as `links.screw.stiffness` goes through them.
- Quantities are totals: kg, N/m, N. Where a contact has an `area`, its laws may be in stresses, too; without one only
  forces are allowed.
- Ends of links, and what contacts slide on, are bodies, `"ground"`, or `"drive"`, what moves at the drive's velocity.
"""


TOLERANCES = """## Tolerances

Any number of the tables of a rig or machine that takes part in its equations may be text with a tolerance; see
[Tolerances and cures](../how-to/tolerances-and-cures.md).

| text | meaning |
|---|---|
| `"12 ± 20 % N/um"`, also `+-` or `+/-` | anywhere from 9.6 to 14.4 N/um, evenly |
| `"12 ± 2 N/um"` | from 10 to 14 N/um |
| `"12 +5 % -1 % N/um"` | from 11.88 to 12.6 N/um; the rig itself has 12 |
| `"10..14 N/um"` | from 10 to 14 N/um; the rig itself has the middle |
| `"12 ± 2 N/um (normal)"` | normal, with the standard deviation 2 N/um, cut off where its domain ends |

Percent are of the value, also of a number without unit: `"0.19 ± 20 %"` is 0.152 to 0.228.

| table | keys | meaning |
|---|---|---|
| `[tolerances]` | `stiffness = "20 %"`, by dotted name | the same apart from the values; no ranges |
| `[[correlations]]` | `between = ["mu_static", "mu_coulomb"]`, `value = 0.8` | their coefficient of correlation |
| `[adjust]` | `stiffness = { from = "5 N/um", to = "60 N/um", cost = 3 }`, by dotted name | what may be changed |

Without correlations parameters are independent. The limits of `[adjust]` are those of a search unless given; `cost` is
that of doubling or halving the value; unless given 1, 0.25 of settings of the drive, and 4 of its speed.

Commands other than `analyze`, `report`, `cure` and `compare` take the values alone.
"""


def machine_tables() -> list[str]:
    """The tables of bodies, links, contacts and drives of machines."""
    lines: list[str] = []
    for section in machine_sections():
        head = f"[{section.name}.NAME]" if section.keyed else f"[{section.name}]"
        if not has_choice(section.family):
            lines += [f"### `{head}`", "", summary(section.family), "", *table(section.family, False)]
            continue
        key, default = selector(section.family)
        for name, law in section.family.registry.items():
            absent = f", or without `{key}`" if name == default else ""
            of = "" if section.keyed else " of a machine"
            lines += [f'### `{head}`{of} with `{key} = "{name}"`{absent}', "", summary(law), "", *table(law, False)]
    return lines


# --- fit-file.md ------------------------------------------------------------------------------------

FIT_HEAD = """# File of a fit

It is a [rig file](rig-file.md) with three more tables. In the tables of the rig, what is missing is fitted: `a`, `b`,
`d_c`, `mu_ref`, what a `normal_memory` has (α; g and d_σ) and the stiffness; what is given is kept. If nothing is
missing, all of the friction law and the stiffness are fitted. Where the normal stress changes in the records and
neither `normal_memory` nor `compare` is there, the memories are compared, and unless `evolution` is there each with the
slip and the aging law. `[contact]`, `[drive]` and `v_ref` may be missing too: normal stress and rates are those
of the records. A `[protocol]` says what moved the load point where the records do not; the rate before it is
that of the record, or `[drive] velocity` where the record does not show it.

A file with bodies, links and contacts is that of a [machine](../how-to/fit-a-machine.md): it is complete, `[fit] free`
names what is fitted, the search starts from its values, and `[record]` says which column is what: `columns`, `time`,
`table`, `between`, `sampling`, `skip_bad_lines`, or `averages` of frequency responses. Of `[fit]` it has `free`,
`fixed`, `separate`, `trend`, `offset`, `initial`, `errors`, `starts` and `effort`.

```toml
[friction]
evolution = "aging"                # what is missing is fitted
normal_memory = "linker-dieterich"

[slider]
stiffness = "40 GPa/m"             # what is given is kept

[record]
normal = "MPa"                     # the unit of a column whose name does not say it
friction = "mu_corrected"          # the name of a column
between = ["10 s", "900 s"]

[fit]
trend = 1
```

A column of `[record]` is given by its name, by its number from 1, by its unit, or by a table of both,
`{column = "Fn", unit = "kN"}`. A bare number is in the unit of the table, also where the rig has an `area`. This page
is written by `make_tables.py` from the declarations in the source.
"""


def fit_page() -> str:
    lines = [FIT_HEAD]
    for section in FIT_TABLES:
        lines += [f"## `[{section.name}]`", "", summary(section.family), "", *table(section.family)]
    return "\n".join(lines).rstrip() + "\n"


# --- map-file.md ------------------------------------------------------------------------------------

MAP_HEAD = """# Table of a map

A [rig file](rig-file.md) may have a table `[map]`, read by `steadyslip map`, `steadyslip sensitivity` and `read_map`;
other commands pass it over.

```toml
[map]
compute = ["status", "events"]
chunk = 1000

[map.over]
angle = { from = "-30 deg", to = "30 deg", points = 61 }
stiffness = { from = "1 GPa/m", to = "100 GPa/m", points = 41, spacing = "log" }
"friction.d_c" = ["1 um", "10 um"]

[map.samples]
points = 256
method = "sobol"
seed = 0

[map.samples.over]
friction.a = { from = 0.012, to = 0.016 }

[map.events]
until = "500 s"
```

`over` and `samples` may both be there; one of them must be. The dimensions of the map are the parameters of `over`,
in order, then `sample`. With `area` in `[slider]`, values are for the whole contact here too (N, N/m, ...); text may
give either. Arrays of the map are per unit area. With `velocity_of`, text such as `"500 mm/min"` is the velocity of the
body that it names, a number without unit that of the drive, in rad/s of a motor. This page is written by
`make_tables.py` from the declarations in the source.
"""
MAP_TAIL = """An installed package may offer further results, as [laws](../how-to/add-a-friction-law.md): a class
derived from `steadyslip.maps.Measure`, named in the entry-point group `steadyslip.laws`.
"""


def arrays_of(measure) -> str:
    """The arrays of a result for an ordinary rig, with units and what their numbers stand for."""
    texts = []
    for output in measure().outputs(EXAMPLE, ()):
        unit = "" if output.unit == "1" else f" ({output.unit})"
        texts.append(f"`{output.name}`{unit}" + (f": {', '.join(output.flags)}" if output.flags else ""))
    return "; ".join(texts)


def map_page() -> str:
    lines = [MAP_HEAD]
    for name, family in (
        ("[map]", MapSettings),
        ("A parameter in `over`", GridSettings),
        ("[map.samples]", SampleSettings),
        ("A parameter in `samples.over`", RangeSettings),
    ):
        head = f"`{name}`" if name.startswith("[") else name
        lines += [f"## {head}", "", summary(family), "", *table(family)]
    lines += ["## Results", "", "| result | what it is | arrays |", "|---|---|---|"]
    lines += [f"| `{n}` | {summary(law)} | {arrays_of(law)} |" for n, law in Measure.registry.items()]
    lines.append("")
    for name, law in Measure.registry.items():
        if list(own_fields(law)):
            lines += [f"## `[map.{name}]`", "", f"Options of `{name}`.", "", *table(law)]
    return "\n".join([*lines, MAP_TAIL]).rstrip() + "\n"


# --- python.md --------------------------------------------------------------------------------------

PYTHON_HEAD = """# Python

What one calls is a name in `steadyslip`. What rigs, protocols, fits and maps are made of is in the modules `laws`,
`machine`, `protocol`, `experiments` and `maps`, and each type of result in the module that makes it, all of which are
attributes of `steadyslip`: `import steadyslip as ss`, then `ss.analyze`, `ss.laws.RateState`. Nothing needs importing
from deeper. Each entry is the first line of the docstring; `help(steadyslip.analyze)` shows the rest. Numbers in and
out are SI, per unit contact area also where the rig has an `area`; constructors, `with_values` and `between=` read text
such as `"9 GPa/m"` too. Laws are frozen; their arguments are the keys of a [rig file](rig-file.md), by keyword (a
drive's velocity also by position). "Theory 3" is section 3 of [Equations and where they live](equations.md).

Names that left the top with 0.3 are found by their short form until 1.0, with a warning that says where they are, and
so are those that changed:

| until 0.2 | now |
|---|---|
| `steadyslip.laws.ConstantNormalStress`, the contact law | `steadyslip.laws.ConstantNormalStress` |
| `steadyslip.laws.LinearNormalStress` | `steadyslip.laws.LinearNormalStress` |
| `steadyslip.laws.ContactInputs`, and of it `slip` | `steadyslip.laws.ContactInputs`, and of it `lead` |
| `steadyslip.machine.SteadyDrive`, the drive | `steadyslip.machine.SteadyDrive` |

This page is written by `make_tables.py`.
"""
GROUPS = {
    "machine.slider": "The rig",
    "machine.machine": "Machines",
    "files.specifications": "Files of rigs and protocols",
    "protocol": "Protocols of experiments",
    "verdict": "The verdict",
    "model.sliding": "Steady sliding",
    "linear": "Linear stability",
    "model": "The Model",
    "motion": "Motion",
    "nonlinear": "Beyond the edge",
    "experiments": "Records and fits",
    "maps": "Maps",
    "explorer": "The explorer",
    "reports": "Reports",
    "schemas": "Schema of files",
    "core.errors": "Exceptions",
}
MODULES = {
    "figures": tuple(name for name in figures.__all__ if name.islower()),
    "testing": ("check_friction_law", "check_contact_law", "Conditions", "Surroundings", "ContractViolation"),
    "units": (),
}
"""Names of modules that the page lists, where they are not all that have a docstring."""


def top_names() -> dict[str, list[str]]:
    """Names of ``__init__.pyi`` by the module they come from, modules themselves under ""."""
    tree = ast.parse((Path(steadyslip.__file__).with_suffix(".pyi")).read_text(encoding="utf-8"))
    return {node.module or "": [a.name for a in node.names] for node in tree.body if isinstance(node, ast.ImportFrom)}


def entry(name: str, thing) -> str:
    called = name
    if inspect.isfunction(thing):
        called += "(" + ", ".join(inspect.signature(thing).parameters) + ")"
    elif isinstance(getattr(thing, "name", ""), str) and getattr(thing, "name", ""):
        called += f'` `"{thing.name}"'
    return f"| `{called}` | {summary(thing)} |"


def listed(title: str, names: dict[str, object]) -> list[str]:
    return [title, "", "| name | what it is |", "|---|---|", *(entry(*one) for one in names.items()), ""]


def python_page() -> str:
    names = top_names()
    lines = [PYTHON_HEAD]
    for module, title in GROUPS.items():
        lines += listed(f"## {title}", {name: getattr(steadyslip, name) for name in names[module]})
    lines += listed("## Modules", {name: getattr(steadyslip, name) for name in names[""]})
    top = {name for found in names.values() for name in found}
    for part in names[""]:
        module = getattr(steadyslip, part)
        own = [name for name in names_of(part) if name not in top]
        if own:
            lines += listed(f"### `steadyslip.{part}`", {f"{part}.{name}": getattr(module, name) for name in own})
    return "\n".join(lines).rstrip() + "\n"


def names_of(part: str) -> tuple[str, ...]:
    """Classes and functions of a module's ``__all__``; values such as `laws.positive` are left out."""
    if part in MODULES:
        return MODULES[part]
    module = getattr(steadyslip, part)
    kinds = inspect.isclass, inspect.isfunction
    return tuple(name for name in module.__all__ if any(is_kind(getattr(module, name)) for is_kind in kinds))


PAGES = {"rig-file.md": rig_page, "fit-file.md": fit_page, "map-file.md": map_page, "python.md": python_page}

if __name__ == "__main__":
    for file, page in PAGES.items():
        (HERE / file).write_text(page(), encoding="utf-8", newline="\n")
