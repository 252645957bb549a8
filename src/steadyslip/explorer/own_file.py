"""The rig file that a page saves: the user's own with its comments and units, or one made for the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from steadyslip.core.areas import outside
from steadyslip.core.records import with_values
from steadyslip.files.specifications.template import ParameterSource, RigTemplate, rig_template
from steadyslip.files.specifications.write import rig_to_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

_SENTINEL = 1.2345678901e-211  # first of the numbers that stand for values in the template of a rig file


@dataclass(frozen=True)
class OwnFile:
    """What a page must know to save a rig file.

    Attributes
    ----------
    pieces : list
        Its text; in between, lists: of a place alone what `told` says of that parameter is written there, of a place
        with what stands before and behind it, its number in SI units, or, with a third word, nothing at all if it has
        not changed; of a heading and such lists, these lines below it, if there are any.
    """

    pieces: list[Any]
    rig: Slider | Machine = field(repr=False)
    given: Mapping[str, ParameterSource]

    def told(self, name: str) -> dict[str, Any]:
        """How the file gives a parameter: ``own``, its unit as it is written, SI units to one of it, its text there.

        ``factor`` and ``unit`` where the file gives per unit area what the rig has totals of; ``si`` where it is the
        other way round; ``was``, the value of the file where that of the rig is another.
        """
        own = self.given.get(name)
        if own is None:
            return {}
        one = self.rig.parameters()[name]
        factor, unit = outside_of(self.rig, one.role.unit)
        kept = isinstance(self.rig, Machine) and own.total  # areas may vary: shown as stresses
        found: dict[str, Any] = {"own": ["" if kept else own.unit, 1.0 if kept else own.size, own.text]}
        if factor != 1.0 and not own.total:
            found |= {"factor": 1.0, "unit": one.role.unit}
        elif unit != one.role.unit or kept:
            found["si"] = one.role.unit
        return found | ({} if own.value == one.value else {"was": own.value})


def own_file(rig: Slider | Machine, names: Sequence[str], text: str) -> OwnFile:
    """The file of a rig that a page saves, by the places of parameters among `names`; `text` may be empty."""
    found = rig_template(text, rig, names) if text else None
    if found is None or not found.pieces:
        return OwnFile(_template(rig, names), rig, {} if found is None else found.sources)
    return OwnFile(_pieces(rig, names, found), rig, found.sources)


def outside_of(rig: Slider | Machine, unit: str) -> tuple[float, str]:
    """Factor and unit in which a page tells a parameter; areas of a machine may vary, so that stresses stay those."""
    return outside(unit, rig.area) if isinstance(rig, Slider) else (1.0, unit)


def _pieces(rig: Slider | Machine, names: Sequence[str], found: RigTemplate) -> list[Any]:
    pieces: list[Any] = []
    for kind, words in found.pieces:
        if kind == "text":
            pieces.append(words)
        elif kind == "value":
            pieces.append([names.index(words)])
        else:
            lines = [[*_place(rig, names, name, f"{key} = "), "\n"] for name, key in found.keys(words).items()]
            pieces.append({"head": f"\n[{words}]\n" if kind == "table" else "", "lines": lines})
    return pieces


def _place(rig: Slider | Machine, names: Sequence[str], name: str, before: str) -> list[Any]:
    """A number in SI units per unit area, so that every digit comes back: place, what is before it, what behind."""
    unit = rig.parameters()[name].role.unit
    return [names.index(name), before, ""] if unit == "1" else [names.index(name), f'{before}"', f' {unit}"']


def _template(rig: Slider | Machine, names: Sequence[str]) -> list[Any]:
    """A rig file made for the page, with a place for each value."""
    marks = {name: _SENTINEL * (1 + i) for i, name in enumerate(names)}
    pieces: list[Any] = []
    for line in rig_to_text(with_values(rig, marks)).splitlines():
        key, _, value = line.partition(" = ")
        for name in names:
            unit = rig.parameters()[name].role.unit
            factor, _ = outside(unit, rig.area_of(name))
            mark = marks[name]
            if value.partition("  #")[0] in {repr(mark), repr(mark * factor), f'"{mark!r} {unit}"'}:
                pieces += [_place(rig, names, name, f"{key} = "), "\n"]
                break
        else:
            pieces.append(line + "\n")
    return _joined(pieces)


def _joined(pieces: Sequence[Any]) -> list[Any]:
    """Texts in a row as one."""
    found: list[Any] = []
    for one in pieces:
        if found and isinstance(one, str) and isinstance(found[-1], str):
            found[-1] += one
        else:
            found.append(one)
    return found
