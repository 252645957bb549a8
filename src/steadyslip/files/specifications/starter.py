"""Commented starting files: a rig with chosen laws, or an example of another kind of file."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Iterator
from dataclasses import Field
from functools import cache
from importlib import resources
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.quantities import example
from steadyslip.core.records import Declared, FrozenRecord, Part, is_required, key_of
from steadyslip.core.roles import Parameter
from steadyslip.files.examples import example_text
from steadyslip.files.specifications.layout import Section, find_law, has_choice, own_fields, sections, selector
from steadyslip.laws.contact import ContactLaw
from steadyslip.machine.slider import Slider

EXAMPLES = {
    "machine": "machines/feed-axis.toml", "protocol": "stick-slip.toml", "fit": "fits/basalt.toml",
    "map": "maps/safe-stiffness.toml",
}  # fmt: skip
"""Example file for each kind of file that is not a rig with chosen laws."""
KINDS = ("rig", *EXAMPLES)
_WIDE = 30  # width (characters) of key and value before the comment
_HEAD = """# A rig to begin with: replace the numbers, then ask
#     steadyslip analyze FILE
# Text carries its unit; a tolerance may follow, such as "12 ± 20 % N/um". Lines that begin with # are what else may be
# given. With area quantities are forces (N, N/um, kg); without it they are per unit area (MPa, GPa/m).
"""


def starter_text(kind: str = "rig", friction: str = "lugre", contact: str = "constant", drive: str = "steady") -> str:
    """TOML text of a commented starting file.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    friction, contact, drive : str
        Names of the laws of a rig, as in files.

    Raises
    ------
    ParameterError
        If there is no such kind or law.
    NotAvailable
        If the package was installed without its examples.
    """
    if kind not in KINDS:
        raise ParameterError([Problem("kind", unknown_name("kind of file", kind, KINDS))])
    if kind != "rig":
        return example_text(EXAMPLES[kind])
    words = {"friction": friction, "contact": contact, "drive": drive}
    problems = [Problem(f"--{name}", fault) for name, word in words.items() if (fault := _fault(name, word))]
    if problems:
        raise ParameterError(problems)
    return "\n".join([_HEAD, *(_table(section, words.get(section.name, "")) for section in sections())])


def _fault(name: str, word: str) -> str:
    """Message on an unknown law for the table `name`; empty if it is known."""
    family = next(section.family for section in sections() if section.name == name)
    return "" if word in (fit := _laws_of_sliders(family)) else unknown_name(family.family, word, fit)


def _laws_of_sliders(family: type[FrozenRecord]) -> list[str]:
    """Names of the laws of a family, without compliant contact laws, which need a body that can leave the surface."""
    usual = ContactLaw.is_compliant
    return [name for name, law in family.registry.items() if getattr(law, "is_compliant", usual) is usual]


def _table(section: Section, word: str) -> str:
    law = Slider if section.family is Slider else find_law(section.family, word)
    key, _ = selector(section.family)
    lines = [f"[{section.name}]"]
    if law is not Slider:
        lines += [*_comment(f"one of {', '.join(_laws_of_sliders(section.family))}"), f'{key} = "{word}"']
    lines += [line for item, role in own_fields(law) for line in _field(law, item, role)]
    return "\n".join(lines) + "\n"


def _field(law: type[FrozenRecord], item: Field[Any], role: Declared) -> Iterator[str]:
    """Lines of one key with a value; commented out unless it is required or usual."""
    key = key_of(item)
    if isinstance(role, Part):
        if has_choice(role.family) and not role.many:
            words = ", ".join(role.family.registry)
            default = getattr(item.default, "name", "") or next(iter(role.family.registry))
            yield from _comment(f"{role.doc}: one of {words}")
            yield f'# {key} = "{default}"'
        return
    values, suggested, not_beside = _usual_values()
    usual = key in values and key not in not_beside.get(law.name, ())
    if isinstance(role, Parameter):
        value = values.get(key) or suggested.get(key) or example(role.unit).replace("'", '"')
        text = f"{key} = {value}"
        yield f"{text if usual or is_required(item) else '# ' + text:<{_WIDE}} # {role.doc}"
    elif hasattr(role, "choices"):
        default = item.default
        shown = str(default).lower() if isinstance(default, bool) else f'"{default}"'
        yield f"{f'# {key} = {shown}':<{_WIDE}} # {role.doc}: {role.allowed()}"


@cache
def _usual_values() -> tuple[dict[str, str], dict[str, str], dict[str, list[str]]]:
    """Values of a slow machine slide as TOML text by key, values of keys that are commented out, and keys left out.

    The keys that are left out are listed by law.
    """
    text = resources.files(__package__).joinpath("starter.toml").read_text(encoding="utf-8")
    usual, _, rest = text.partition("[suggested]")
    suggested, _, _ = rest.partition("[not_beside]")
    return _values(usual), _values(suggested), tomllib.loads(text)["not_beside"]


def _values(text: str) -> dict[str, str]:
    """TOML text of values by key, from lines ``key = value``."""
    lines = (line.partition(" = ") for line in text.splitlines() if " = " in line)
    return {key: value for key, _, value in lines}


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, 110, initial_indent="# ", subsequent_indent="#   ")
