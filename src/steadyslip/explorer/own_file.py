"""Rig file that a page saves: the user's file with its comments and units, or a generated one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from steadyslip.core.areas import display_area, outside
from steadyslip.core.records import with_values
from steadyslip.files.specifications.template import ParameterSource, RigTemplate, rig_template
from steadyslip.files.specifications.write import rig_to_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

_SENTINEL = 1.2345678901e-211  # placeholder for values in a generated rig file; no parameter has it


@dataclass(frozen=True)
class OwnFile:
    """Template of the rig file that a page saves, and the source of each parameter in the user's file.

    Attributes
    ----------
    pieces : list
        Texts of the file and, between them, slots. A list of one index: the parameter as its source in the file writes
        it. A list of index, text before and text after: its number in SI units between them; with one more text, the
        slot is left out if the value is unchanged. A dict of ``head`` and ``lines``: a heading above such slots.
    """

    pieces: list[Any]
    rig: Slider | Machine = field(repr=False)
    given: Mapping[str, ParameterSource]

    def source_fields(self, name: str) -> dict[str, Any]:
        """Data on a parameter's source in the file; ``own``: unit as written, size of the unit in SI, and text.

        ``factor`` and ``unit`` are added if the file gives a value per unit area of a rig with totals; ``si`` in the
        opposite case; ``was`` is the value in the file if the rig's differs. Empty if the file does not give the
        parameter.
        """
        own = self.given.get(name)
        if own is None:
            return {}
        one = self.rig.parameters()[name]
        factor, unit = display_unit(self.rig, one.role.unit)
        kept = self.rig.area is None and own.total  # the area may vary, so values are shown as stresses
        found: dict[str, Any] = {"own": ["" if kept else own.unit, 1.0 if kept else own.size, own.text]}
        if factor != 1.0 and not own.total:
            found |= {"factor": 1.0, "unit": one.role.unit}
        elif unit != one.role.unit or kept:
            found["si"] = one.role.unit
        return found | ({} if own.value == one.value else {"was": own.value})


def own_file(rig: Slider | Machine, names: Sequence[str], text: str) -> OwnFile:
    """Template of the rig file that a page saves; slots are indices in `names`, `text` is the user's file or empty."""
    found = rig_template(text, rig, names) if text else None
    if found is None or not found.pieces:
        return OwnFile(_generated_pieces(rig, names), rig, {} if found is None else found.sources)
    return OwnFile(_file_pieces(rig, names, found), rig, found.sources)


def display_unit(rig: Slider | Machine, unit: str) -> tuple[float, str]:
    """Factor and unit in which a page displays a parameter: SI units, for sliders given in forces those of totals."""
    return outside(unit, display_area(unit, rig.area))


def _file_pieces(rig: Slider | Machine, names: Sequence[str], found: RigTemplate) -> list[Any]:
    pieces: list[Any] = []
    for kind, words in found.pieces:
        if kind == "text":
            pieces.append(words)
        elif kind == "value":
            pieces.append([names.index(words)])
        else:
            lines = [[*_slot(rig, names, name, f"{key} = "), "\n"] for name, key in found.keys(words).items()]
            pieces.append({"head": f"\n[{words}]\n" if kind == "table" else "", "lines": lines})
    return pieces


def _slot(rig: Slider | Machine, names: Sequence[str], name: str, before: str) -> list[Any]:
    """Slot of a parameter: index, text before and text after its number (SI units per unit area, all digits)."""
    unit = rig.parameters()[name].role.unit
    return [names.index(name), before, ""] if unit == "1" else [names.index(name), f'{before}"', f' {unit}"']


def _generated_pieces(rig: Slider | Machine, names: Sequence[str]) -> list[Any]:
    """Pieces of a generated rig file, with a slot for each value."""
    marks = {name: _SENTINEL * (1 + i) for i, name in enumerate(names)}
    pieces: list[Any] = []
    for line in rig_to_text(with_values(rig, marks)).splitlines():
        key, _, value = line.partition(" = ")
        for name in names:
            unit = rig.parameters()[name].role.unit
            factor, _ = outside(unit, rig.area_of(name))
            mark = marks[name]
            if value.partition("  #")[0] in {repr(mark), repr(mark * factor), f'"{mark!r} {unit}"'}:
                pieces += [_slot(rig, names, name, f"{key} = "), "\n"]
                break
        else:
            pieces.append(line + "\n")
    return _merge_texts(pieces)


def _merge_texts(pieces: Sequence[Any]) -> list[Any]:
    """Pieces with adjacent texts joined."""
    found: list[Any] = []
    for one in pieces:
        if found and isinstance(one, str) and isinstance(found[-1], str):
            found[-1] += one
        else:
            found.append(one)
    return found
