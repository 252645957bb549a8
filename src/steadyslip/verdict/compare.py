"""`compare_rigs`: verdicts on two rigs side by side, and how much each difference contributes to the change."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import enumerated, format_growth, format_quantity
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.files.specifications.tolerance_tables import Tolerances, rig_and_tolerances
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.verdict.analyze import analyze
from steadyslip.verdict.between import comparable
from steadyslip.verdict.chances import chances_of
from steadyslip.verdict.export import finite
from steadyslip.verdict.findings import Findings
from steadyslip.verdict.rig_differences import PARTLY, Difference, differences_of, one_word
from steadyslip.verdict.support import support_stiffness
from steadyslip.verdict.tolerances import Tolerated, differing_tolerances, format_chance, tolerate
from steadyslip.verdict.unknown import StableWithin, stable_within
from steadyslip.verdict.unknown_in_pairs import Intervals, pairs_of
from steadyslip.verdict.words import edge_rows, headline

PAIR = Tested("two of them, for the first and the second rig", lambda v: isinstance(v, (tuple, list)) and len(v) == 2)
NONE = (None, None)


@dataclass(frozen=True, eq=False)
class RigComparison(Displayed):
    """Verdicts on two rigs side by side, and the contribution of each difference between them.

    Attributes
    ----------
    names : tuple of str
    verdicts : tuple of Analysis
    within : tuple of Tolerated or None
        Verdicts within tolerances; None for a rig without tolerances.
    unknown : tuple of StableWithin or None
        Values of its unknown parameters at which a rig is stable; None for a rig without unknown parameters.
    chances : tuple of ((float, float) or None)
        Chance of stable sliding within tolerances and half-width of its 95 % interval, the least over the unknown
        parameters; None for a rig without tolerances.
    alike : tuple of (str, str)
        Verdict on each rig: ``stable`` or ``unstable`` if so at all values tried of its unknown parameters, else
        ``not at every value``.
    differences : tuple of Difference
        The one with the largest part first; empty if the rigs have the same equations and numbers.
    measure : str
        Quantity of which each difference has a part: ``safety`` (k/k_cr), ``growth`` (growth rate), or empty if
        mixtures of the two rigs have neither.
    """

    names: tuple[str, str]
    verdicts: tuple[Findings, Findings] = field(repr=False)
    within: tuple[Tolerated | None, Tolerated | None] = field(repr=False)
    unknown: tuple[StableWithin | None, StableWithin | None] = field(repr=False)
    chances: tuple[tuple[float, float] | None, tuple[float, float] | None]
    alike: tuple[str, str]
    differences: tuple[Difference, ...]
    measure: str

    def __str__(self) -> str:
        lines = [
            f"{name}: {headline(one)}" + (", with the file's values of what is not known" if unknown else "")
            for name, one, unknown in zip(self.names, self.verdicts, self.unknown, strict=True)
        ]
        rows = list(self.side_by_side())
        wide = [max(len(row[i]) for row in rows) for i in range(2)]
        lines += ["", *(f"{a:<{wide[0]}}  {b:<{wide[1]}}  {c}".rstrip() for a, b, c in rows)]
        return "\n".join([*lines, "", *self._differences()])

    def side_by_side(self) -> Iterator[tuple[str, str, str]]:
        """Rows (label, text of first rig, text of second rig) of a table; the first row has the names."""
        yield ("", *self.names)
        for label, of in (
            ("k/k_cr", _ratio), ("growth rate", _growth), ("oscillation", _period), ("nearest edge", _edge),
        ):  # fmt: skip
            first, second = (of(one) for one in self.verdicts)
            if first or second:
                yield label, first or "none", second or "none"
        yield from self._unknown()
        if any(self.within):
            first, second = (
                "no tolerances" if one is None or chance is None
                else _chance(one) if unknown is None else f"{_share(*chance)} where least"
                for one, chance, unknown in zip(self.within, self.chances, self.unknown, strict=True)
            )  # fmt: skip
            yield "stable in", first, second

    def _unknown(self) -> Iterator[tuple[str, str, str]]:
        """Rows (label, first rig, second rig) on unknown parameters: each varied alone, then all at once."""
        of = [{} if one is None else {each.parameter: each.told for each in one.each} for one in self.unknown]
        for name in {**of[0], **of[1]}:
            yield name, of[0].get(name, "known"), of[1].get(name, "known")
        at_once = ["" if one is None else one.at_once for one in self.unknown]
        if any(at_once):
            first, second = (
                text or ("known" if one is None else "as above")
                for text, one in zip(at_once, self.unknown, strict=True)
            )
            yield "all these at once", first, second

    def _differences(self) -> Iterator[str]:
        if not self.differences:
            yield self._alike()
            return
        over = ", over values of what is not known" if any(self.unknown) else ""
        wide = 2 + max(len(one.parameter) for one in self.differences)
        values = [f"{one.first} -> {one.second}" for one in self.differences]
        across = 2 + max(map(len, values))
        yield (
            f"What differs, by its part in the change of {self.of} (Shapley value){over}"
            if self.of
            else ("What differs; no parts are given, since some mixture of the two has no growth rate")
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
        """Sentence on two rigs whose equations and numbers do not differ."""
        first, second = self.within
        same = ["equations", "numbers", *(["intervals of what is not known"] if any(self.unknown) else [])]
        if apart := differing_tolerances(first, second):
            return f"The rigs have the same {enumerated(same)}, but other tolerances of {enumerated(apart)}"
        same += ["tolerances"] if any(self.within) else []
        return f"The rigs have the same {enumerated(same)}"

    @property
    def of(self) -> str:
        """Text for the quantity in `measure`; empty if the differences have no parts."""
        return {"safety": "k/k_cr", "growth": "the growth rate"}.get(self.measure, "")

    def part_in_words(self, one: Difference) -> str:
        """Part of a difference as text, with its share of the sum of all parts."""
        return one.told(self.measure)

    def decisive(self) -> Iterator[str]:
        """Sentences on those differences that would change the verdict by themselves."""
        first, second = self.alike
        for name, word, unknown in zip(self.names, self.alike, self.unknown, strict=True):
            if word == PARTLY and unknown is not None:
                which = enumerated([one.parameter for one in unknown.each])
                yield f"whether {name} is stable depends on what is not known of it, {which}"
        if first == second or PARTLY in self.alike:
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
        """Draw the distance of both rigs from the edge of stability; see `steadyslip.figures.two_rigs`."""
        return draw(self, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Comparison as JSON-ready dict in SI units, as ``--json`` prints it."""
        rigs = [
            {
                "name": name, "stable": one.stable, "reason": one.reason, "safety_factor": _factor(one),
                "growth_rate": one.growth_rate, "period": None if (s := _oscillation(one)) is None
                else 2 * math.pi / abs(s.imag),
                "nearest_edge": None if not one.margins or one.margins[0].edge is None else {
                    "parameter": one.margins[0].parameter, "value": one.margins[0].edge.value,
                    "unit": one.margins[0].unit, "own_value": one.margins[0].value,
                },
                "tolerances": None if within is None else within.to_dict(),
                "least_chance": None if chance is None else list(chance),
                "unknown": None if unknown is None else unknown.to_dict(), "at_unknown": word,
            }
            for name, one, within, chance, unknown, word in zip(
                self.names, self.verdicts, self.within, self.chances, self.unknown, self.alike, strict=True
            )
        ]  # fmt: skip
        differences = [
            {
                "parameter": one.parameter, "first": one.first, "second": one.second, "part": one.part,
                "share": one.share, "parts": list(one.parts),
                "first_with": one.first_with, "second_with": one.second_with,
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
    """Verdicts on two rigs side by side, and the part that each of their differences has in the change.

    Parameters
    ----------
    first, second : Slider or Machine
    tolerances : (tolerances, tolerances), optional
        Tolerances of the first and of the second rig, as for `tolerate`. Tolerances read from files may have intervals
        of unknown parameters: parts and verdicts are then over values tried in these intervals; an interval common to
        both rigs is one unknown, with equal values in both.
    names : (str, str), optional
        Names of the rigs in the text.

    Returns
    -------
    RigComparison
        Parts are Shapley values: the mean change of a measure when a difference is introduced, over all orders of
        introducing the differences one after another. The measure is the logarithm of k/k_cr if k/k_cr > 1 means stable
        for all mixtures of the two rigs, else the growth rate. Sliders with different areas are compared in forces.

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
    of_first, of_second = map(_intervals, tolerances)
    pairs = pairs_of((first, second), (a, b), (of_first, of_second))
    measure, differences = differences_of(pairs)
    verdicts = [analyze(rig) for rig in (first, second)]
    alike = [
        one_word(["stable" if word == "stable" else "unstable" for word in words]) if ends
        else "stable" if verdict.stable else "unstable"
        for verdict, words, ends in zip(verdicts, pairs.stability(), (of_first, of_second), strict=True)
    ]  # fmt: skip
    each = list(zip((first, second), tolerances, (of_first, of_second), strict=True))
    within = [tolerate(rig, one) if one else None for rig, one, _ in each]
    unknown = [stable_within(rig, ends) if ends else None for rig, _, ends in each]
    chances = [chances_of(rig, one, ends).whole({}) if one else None for rig, one, ends in each]
    return RigComparison(
        (str(names[0]), str(names[1])), (verdicts[0], verdicts[1]), (within[0], within[1]), (unknown[0], unknown[1]),
        (chances[0], chances[1]), (alike[0], alike[1]), differences, measure,
    )  # fmt: skip


def _intervals(given: Mapping[str, Any] | Tolerances | None) -> Intervals:
    return given.unknown if isinstance(given, Tolerances) else {}


def compare_files(
    first: str | PathLike[str], second: str | PathLike[str], changes: Iterable[str] = ()
) -> RigComparison:
    """Compare the rigs of two files, with the tolerances that are written there; see `compare_rigs`."""
    kept = list(changes)
    (a, of_a), (b, of_b) = (rig_and_tolerances(path, kept) for path in (first, second))
    _check_slides((a, b), (str(first), str(second)))
    names = (Path(first).stem, Path(second).stem)
    names = names if names[0] != names[1] else (str(first), str(second))
    return compare_rigs(a, b, tolerances=(of_a, of_b), names=names)


def _check_slides(rigs: Iterable[Slider | Machine], names: Iterable[str]) -> None:
    """Raise ParameterError that names the rigs whose drive holds a position (velocity 0)."""
    message = (
        "drive.velocity is 0, but verdicts on sliding are compared; give it a speed, such as '1 mm/min', without keys "
        "for holding a position, or use `steadyslip hunt`, ss.hunt(rig) in Python, for each rig"
    )
    held = dict.fromkeys(name for rig, name in zip(rigs, names, strict=True) if rig.holds)  # each name once
    problems = [Problem(name, message) for name in held]
    if problems:
        raise ParameterError(problems)


def _factor(one: Findings) -> float | None:
    """Ratio k/k_cr of a slider, with the gain of a parallel controller added to both stiffnesses.

    None for machines and for sliders without a critical stiffness.
    """
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


def _oscillation(one: Findings) -> complex | None:
    """Eigenvalue (1/s) of the leading mode, whose growth rate is reported; None if the mode does not oscillate."""
    leading = one.eigenvalues[0] if one.eigenvalues else None
    return leading if leading is not None and leading.imag else None


def _period(one: Findings) -> str:
    leading = _oscillation(one)
    if leading is None:
        return ""
    period = format_quantity(2 * math.pi / abs(leading.imag), "s")
    return f"period {period}, damping ratio {-leading.real / abs(leading):.3g}"


def _edge(one: Findings) -> str:
    rows = edge_rows(one, one.margins[0]) if one.margins else []
    return " ".join(rows[0][i] for i in (0, 3)) if rows else ""


def _chance(one: Tolerated) -> str:
    return f"{_share(one.share, one.error)}{' but some' if one.otherwise else ''}"


def _share(share: float, error: float) -> str:
    return format_chance(share, error) if 0 < share < 1 else "all" if share else "none"
