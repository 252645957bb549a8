"""`compare_rigs`: the verdicts on two rigs beside each other, and which of their differences matter."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import enumerated, format_growth, format_percent, format_quantity
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.records import FrozenRecord
from steadyslip.files.specifications.tolerance_tables import Tolerances, rig_and_tolerances
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.verdict.analyze import analyze
from steadyslip.verdict.between import Between, Place, comparable, ones_and_others, places, shapley
from steadyslip.verdict.export import finite
from steadyslip.verdict.findings import Findings
from steadyslip.verdict.support import support_stiffness
from steadyslip.verdict.tolerances import Tolerated, differing_tolerances, format_chance, tolerate
from steadyslip.verdict.words import edge_rows, headline, told

PAIR = Tested("two of them, for the first and the second rig", lambda v: isinstance(v, (tuple, list)) and len(v) == 2)
NONE = (None, None)


@dataclass(frozen=True)
class Difference(Displayed):
    """A difference between two rigs, and its part in the change of the verdict.

    Attributes
    ----------
    parameter : str
        Dotted name; of keys that exclude each other joined by ``+``.
    first, second : str
        What each rig has.
    part : float
        Its Shapley value: of ``measure = "safety"`` the factor by which it changes k/k_cr, of ``"growth"`` its change
        of the growth rate, 1/s; NaN where that is not known.
    share : float
        Size of its Shapley value over the sizes of all (of the logarithm of k/k_cr, or of the growth rate).
    first_with, second_with : str
        Verdict on the first rig with the second's value, and on the second rig with the first's: ``stable``,
        ``unstable``, ``no steady sliding`` or ``not possible``.
    """

    parameter: str
    first: str
    second: str
    part: float
    share: float
    first_with: str
    second_with: str


@dataclass(frozen=True, eq=False)
class RigComparison(Displayed):
    """Two rigs beside each other.

    Attributes
    ----------
    names : tuple of str
    verdicts : tuple of Analysis
    within : tuple of Tolerated or None
        Chances of stable sliding, of a rig with tolerances.
    differences : tuple of Difference
        The one with the largest part first; empty if the rigs have the same equations and numbers.
    measure : str
        What the parts are of: ``safety``, ``growth``, or empty if rigs between the two have neither.
    """

    names: tuple[str, str]
    verdicts: tuple[Findings, Findings] = field(repr=False)
    within: tuple[Tolerated | None, Tolerated | None] = field(repr=False)
    differences: tuple[Difference, ...]
    measure: str

    def __str__(self) -> str:
        lines = [f"{name}: {headline(one)}" for name, one in zip(self.names, self.verdicts, strict=True)]
        rows = list(self.side_by_side())
        wide = [max(len(row[i]) for row in rows) for i in range(2)]
        lines += ["", *(f"{a:<{wide[0]}}  {b:<{wide[1]}}  {c}".rstrip() for a, b, c in rows)]
        return "\n".join([*lines, "", *self._differences()])

    def side_by_side(self) -> Iterator[tuple[str, str, str]]:
        """Rows of a table: what is told, and its text for either rig; the first row has the names."""
        yield ("", *self.names)
        for label, of in (
            ("k/k_cr", _ratio), ("growth rate", _growth), ("oscillation", _period), ("nearest edge", _edge),
        ):  # fmt: skip
            first, second = (of(one) for one in self.verdicts)
            if first or second:
                yield label, first or "none", second or "none"
        if any(self.within):
            first, second = ("no tolerances" if one is None else _chance(one) for one in self.within)
            yield "stable in", first, second

    def _differences(self) -> Iterator[str]:
        if not self.differences:
            yield self._alike()
            return
        wide = 2 + max(len(one.parameter) for one in self.differences)
        values = [f"{one.first} -> {one.second}" for one in self.differences]
        across = 2 + max(map(len, values))
        yield (
            f"What differs, by its part in the change of {self.of} (Shapley value)"
            if self.of
            else ("What differs; no parts are told, since some rig between the two has no growth rate")
        )
        for one, value in zip(self.differences, values, strict=True):
            text = f"{one.parameter:<{wide}}{value:<{across}}{self.part_in_words(one)}"
            yield from (
                textwrap.wrap(text, 110, subsequent_indent=" " * (wide + 2), drop_whitespace=True)
                if (len(text) > 110)
                else [text.rstrip()]
            )
        yield from self.decisive()

    def _alike(self) -> str:
        """Sentence on rigs with the same equations and numbers."""
        first, second = self.within
        if first is None and second is None:
            return "The rigs have the same equations and numbers"
        if apart := differing_tolerances(first, second):
            return f"The rigs have the same equations and numbers, but other tolerances of {enumerated(apart)}"
        return "The rigs have the same equations, numbers and tolerances"

    @property
    def of(self) -> str:
        """What the parts are of, in words; empty if there are none."""
        return {"safety": "k/k_cr", "growth": "the growth rate"}.get(self.measure, "")

    def part_in_words(self, one: Difference) -> str:
        """Part of a difference as text, with its share of all."""
        if not self.measure:
            return ""
        part = f"x {one.part:.3g}" if self.measure == "safety" else f"{one.part:+.3g} 1/s"
        return part if math.isnan(one.share) else f"{part} ({format_percent(round(one.share, 2))})"

    def decisive(self) -> Iterator[str]:
        """Sentences on the differences that decide the verdict alone."""
        first, second = ("stable" if one.stable else "unstable" for one in self.verdicts)
        if first == second:
            return
        makes = [one.parameter for one in self.differences if one.first_with == second]
        undoes = [one.parameter for one in self.differences if one.second_with == first]
        a, b = self.names
        yield (
            f"{a} becomes {second} with that of {b} in {', or in '.join(makes)}"
            if makes
            else (f"no single value of {b} makes {a} {second}")
        )
        yield (
            f"{b} becomes {first} with that of {a} in {', or in '.join(undoes)}"
            if undoes
            else (f"no single value of {a} makes {b} {first}")
        )

    def plot(self, ax: Any = None) -> Any:
        """Draw how near the edge of stability both are; see `steadyslip.figures.two_rigs`."""
        return draw(self, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it."""
        rigs = [
            {
                "name": name, "stable": one.stable, "reason": one.reason, "safety_factor": _factor(one),
                "growth_rate": one.growth_rate, "period": one.period,
                "nearest_edge": None if not one.margins or one.margins[0].edge is None else {
                    "parameter": one.margins[0].parameter, "value": one.margins[0].edge.value,
                    "unit": one.margins[0].unit, "own_value": one.margins[0].value,
                },
                "tolerances": None if within is None else within.to_dict(),
            }
            for name, one, within in zip(self.names, self.verdicts, self.within, strict=True)
        ]  # fmt: skip
        differences = [
            {
                "parameter": one.parameter, "first": one.first, "second": one.second, "part": one.part,
                "share": one.share, "first_with": one.first_with, "second_with": one.second_with,
            }
            for one in self.differences
        ]  # fmt: skip
        found: dict[str, Any] = finite({"rigs": rigs, "measure": self.measure or None, "differences": differences})
        return found


@checked(tolerances=PAIR, names=PAIR)
def compare_rigs(
    first: Slider | Machine, second: Slider | Machine, *,
    tolerances: tuple[Mapping[str, Any] | Tolerances | None, Mapping[str, Any] | Tolerances | None] = NONE,
    names: tuple[str, str] = ("first", "second"),
) -> RigComparison:  # fmt: skip
    """Verdicts on two rigs beside each other, and the part of each of their differences in the change.

    Parameters
    ----------
    first, second : Slider or Machine
    tolerances : (tolerances, tolerances), optional
        Of the first and the second rig, as for `tolerate`.
    names : (str, str), optional
        What the rigs are called in the text.

    Returns
    -------
    RigComparison
        Parts are Shapley values: the mean, over all orders in which the differences can be introduced one after
        another, of what each changes. They are of the logarithm of k/k_cr where that tells the verdict of all sliders
        between the two, else of the growth rate. Two sliders with different areas are compared in forces.

    Raises
    ------
    ParameterError
        If an argument is not allowed, or one of the rigs is a slider and the other a machine.
    NotAvailable
        If the numbers of a rig leave the range of floating point.

    Examples
    --------
    >>> import steadyslip as ss
    >>> axis = ss.read_rig("examples/slow-axis.toml")
    >>> found = ss.compare_rigs(axis, axis.with_values({"stiffness": "40 N/um"}))
    >>> [one.parameter for one in found.differences]
    ['slider.stiffness']
    """
    if type(first) is not type(second):
        message = "one is a slider and the other a machine; describe the slider as a machine of one body"
        raise ParameterError([Problem("rigs", message)])
    _check_slides((first, second), names)
    a, b = comparable(first, second)
    found = places(a, b)
    measure, differences = _differences(Between(a, b, found)) if found else ("", ())
    within = tuple(tolerate(rig, one) if one else None for rig, one in zip((first, second), tolerances, strict=True))
    return RigComparison(
        (str(names[0]), str(names[1])), (analyze(first), analyze(second)), (within[0], within[1]), differences, measure
    )


def compare_files(
    first: str | PathLike[str], second: str | PathLike[str], changes: Iterable[str] = ()
) -> RigComparison:
    """Compare the rigs of two files, with the tolerances that are written there; see `compare_rigs`."""
    kept = list(changes)
    (a, of_a), (b, of_b) = (rig_and_tolerances(path, kept) for path in (first, second))
    _check_slides((a, b), (str(first), str(second)))
    names = (Path(first).stem, Path(second).stem)
    names = names if names[0] != names[1] else (str(first), str(second))
    return compare_rigs(a, b, tolerances=(of_a or None, of_b or None), names=names)


def _check_slides(rigs: Iterable[Slider | Machine], names: Iterable[str]) -> None:
    """Refuse rigs whose drive holds a place, by name."""
    message = (
        "drive.velocity is 0, and verdicts on sliding are compared; give it a speed, such as '1 mm/min', and leave out "
        "what is of a held place alone, or ask `steadyslip hunt`, ss.hunt(rig) in Python, of either rig"
    )
    held = dict.fromkeys(name for rig, name in zip(rigs, names, strict=True) if rig.holds)  # each file once
    problems = [Problem(name, message) for name in held]
    if problems:
        raise ParameterError(problems)


def _differences(between: Between) -> tuple[str, tuple[Difference, ...]]:
    measure, values = shapley(between)
    size = float(np.sum(np.abs(values)))
    count = len(between.places)
    alone = between.outcomes(ones_and_others(count))
    found = [
        Difference(
            _name(place),
            *_texts(between, place),
            math.exp(value) if measure == "safety" else value,
            abs(value) / size if size else math.nan,
            str(alone.words[j]),
            str(alone.words[count + j]),
        )
        for j, (place, value) in enumerate(zip(between.places, map(float, values), strict=True))
    ]
    order = sorted(range(count), key=lambda j: -abs(values[j]) if measure else 0.0)
    return measure, tuple(found[j] for j in order)


def _name(place: Place) -> str:
    """Name of a place, such as ``slider.stiffness + axial_stiffness``."""
    first, *others = place
    return " + ".join([first.name, *(one.name.rpartition(".")[2] for one in others)])


def _texts(between: Between, place: Place) -> tuple[str, str]:
    """What each rig has at a place."""
    first = [_text(between.first, one.name, one.first, len(place) > 1) for one in place]
    second = [_text(between.second, one.name, one.second, len(place) > 1) for one in place]
    return ", ".join(filter(None, first)) or "none", ", ".join(filter(None, second)) or "none"


def _text(rig: Slider | Machine, name: str, value: Any, named: bool) -> str:
    """A value with its unit, and its key where `named`; empty for None."""
    if value is None:
        return ""
    if isinstance(value, FrozenRecord):
        return value.name or type(value).__name__
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return "; ".join(_item_text(rig, f"{name}.{i}") for i in range(1, len(value) + 1))
    known = rig.parameters().get(name)
    if known is None or not isinstance(value, float):
        return str(value)
    words = told(rig, name, value)
    return f"{name.rpartition('.')[2]} {words}" if named else words


def _item_text(rig: Slider | Machine, name: str) -> str:
    """Parameters of an item of a list, such as ``b 0.006, d_c 4 um``."""
    own = {key.removeprefix(f"{name}."): address.value for key, address in rig.parameters().items()
           if key.startswith(f"{name}.") and address.value is not None}  # fmt: skip
    return ", ".join(f"{key} {told(rig, f'{name}.{key}', value)}" for key, value in own.items())


def _factor(one: Findings) -> float | None:
    """k/k_cr of a slider, a gain counted with both; None where there is none."""
    if one.rig.in_forces or one.steady is None:
        return None
    support = support_stiffness(one)
    if support.critical is None or not support.critical + support.beside:
        return None
    return (support.own + support.beside) / (support.critical + support.beside)


def _ratio(one: Findings) -> str:
    factor = _factor(one)
    return "" if factor is None else f"{factor:.4g}"


def _growth(one: Findings) -> str:
    return "" if one.growth_rate is None else format_growth(one.growth_rate)


def _period(one: Findings) -> str:
    if one.period is None or one.damping_ratio is None:
        return ""
    return f"period {format_quantity(one.period, 's')}, damping ratio {one.damping_ratio:.3g}"


def _edge(one: Findings) -> str:
    rows = edge_rows(one, one.margins[0]) if one.margins else []
    return " ".join(rows[0][i] for i in (0, 3)) if rows else ""


def _chance(one: Tolerated) -> str:
    if 0 < one.share < 1:
        return format_chance(one.share, one.error)
    return f"{'all' if one.share else 'none'}{' but some' if one.otherwise else ''}"
