"""`Difference`s between two rigs, and the part that each has in the change of their verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_percent
from steadyslip.core.pages import Displayed
from steadyslip.core.records import FrozenRecord
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.machine.surfaces import Surface
from steadyslip.verdict.between import Between, Place, ones_and_others, places, shapley
from steadyslip.verdict.unknown_in_pairs import Pairs
from steadyslip.verdict.words import format_parameter, format_parameter_range

PARTLY = "not at every value"
"""Word for a verdict that depends on the values of unknown parameters."""


@dataclass(frozen=True)
class Difference(Displayed):
    """One difference between two rigs, and the part that it has in the change of the verdict.

    Attributes
    ----------
    parameter : str
        Dotted name; keys that exclude each other are joined by ``+``.
    first, second : str
        Value of each rig, as text.
    part : float
        Shapley value: the factor on k/k_cr with ``measure = "safety"``, the change of the growth rate (1/s) with
        ``"growth"``; NaN where that is not known. For rigs with unknown parameters the mean over the values tried.
    share : float
        Absolute Shapley value (of the logarithm of k/k_cr, or of the growth rate) over the sum for all differences.
    first_with, second_with : str
        Verdict on the first rig with the second's value, and on the second rig with the first's: ``stable``,
        ``unstable``, ``no steady sliding``, ``not possible``, or ``not at every value`` of unknown parameters.
    parts : tuple of float
        Least and largest part over the values of unknown parameters; both are `part` without unknown parameters.
    """

    parameter: str
    first: str
    second: str
    part: float
    share: float
    first_with: str
    second_with: str
    parts: tuple[float, float]

    def told(self, measure: str) -> str:
        """Part of the difference as text, with its share of the sum of all parts; empty without a measure."""
        if not measure:
            return ""
        low, high = (f"{one:.3g}" if measure == "safety" else f"{one:+.3g}" for one in self.parts)
        both = low if low == high else f"{low} to {high}"
        part = f"x {both}" if measure == "safety" else f"{both} 1/s"
        return part if math.isnan(self.share) else f"{part} ({format_percent(round(self.share, 2))})"


def differences_of(pairs: Pairs) -> tuple[str, tuple[Difference, ...]]:
    """Measure (see `shapley`) and differences of two comparable rigs, the largest part first."""
    betweens = [Between(a, b, places(a, b)) for a, b in pairs.tried]
    betweens = [one for one in betweens if one.places]
    if not betweens:
        return "", ()
    found = [shapley(one) for one in betweens]
    measure = found[0][0] if len({of for of, _ in found}) == 1 else "growth"
    if any(of != measure for of, _ in found):
        found = [shapley(one, measure) for one in betweens]
    measure = "" if any(not of for of, _ in found) else measure
    named: dict[str, Place] = {}
    for one in betweens:
        for place in one.places:
            named.setdefault(_name(place), place)
    values = np.zeros((len(betweens), len(named)))
    alone: list[list[tuple[str, str]]] = [[] for _ in named]
    for i, (one, (_, own)) in enumerate(zip(betweens, found, strict=True)):
        judged, count = one.outcomes(ones_and_others(len(one.places))), len(one.places)
        for k, place in enumerate(one.places):
            j = list(named).index(_name(place))
            values[i, j] = own[k]
            alone[j].append((str(judged.words[k]), str(judged.words[count + k])))
    return measure, _sorted(pairs, betweens[0], named, values, alone, measure)


def _sorted(
    pairs: Pairs, between: Between, named: Mapping[str, Place], values: Array, alone: Sequence[Any], measure: str
) -> tuple[Difference, ...]:
    """Differences, largest part first, from Shapley values (pairs, differences) and verdicts with each alone."""
    mean = values.mean(axis=0)
    size = float(np.sum(np.abs(mean)))
    found = []
    for j, (name, place) in enumerate(named.items()):
        low, high, middle = (
            math.exp(one) if measure == "safety" else float(one)
            for one in (values[:, j].min(), values[:, j].max(), mean[j])
        )
        share = abs(float(mean[j])) / size if size else math.nan
        first, second = (one_word(words) for words in zip(*alone[j], strict=True))
        found.append(Difference(name, *_texts(pairs, between, place), middle, share, first, second, (low, high)))
    order = sorted(range(len(found)), key=lambda j: -float(np.max(np.abs(values[:, j]))) if measure else 0.0)
    return tuple(found[j] for j in order)


def one_word(words: Sequence[str]) -> str:
    """The verdict that all `words` have in common, or `PARTLY` if they differ."""
    return words[0] if len(set(words)) == 1 else PARTLY


def _name(place: Place) -> str:
    """Name of a place, such as ``slider.stiffness + axial_stiffness``."""
    first, *others = place
    return " + ".join([first.name, *(one.name.rpartition(".")[2] for one in others)])


def _texts(pairs: Pairs, between: Between, place: Place) -> tuple[str, str]:
    """Values of the first and of the second rig at a place, as text."""
    rigs, named = ((between.first, pairs.of_first), (between.second, pairs.of_second)), len(place) > 1
    first, second = (
        [_within(rig, one.name, of[one.name]) if one.name in of else _text(rig, one.name, value, named)
         for one, value in ((one, getattr(one, side)) for one in place)]
        for (rig, of), side in zip(rigs, ("first", "second"), strict=True)
    )  # fmt: skip
    return ", ".join(filter(None, first)) or "none", ", ".join(filter(None, second)) or "none"


def _within(rig: Slider | Machine, name: str, ends: tuple[float, float]) -> str:
    """Interval of an unknown parameter, as text."""
    return f"somewhere in {format_parameter_range(rig, name, *ends)}"


def _text(rig: Slider | Machine, name: str, value: Any, named: bool) -> str:
    """Text of a value with its unit, and with its key if `named`; None gives the parameter's default, or nothing."""
    known = rig.parameters().get(name)
    if value is None:
        return "" if named or known is None else known.role.unless_given
    if isinstance(value, Surface):
        return f"{value.friction.name or type(value.friction).__name__} friction"
    if isinstance(value, FrozenRecord):
        return value.name or type(value).__name__
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple) and all(isinstance(one, str) for one in value):
        return " and ".join(value)
    if isinstance(value, tuple):
        return "; ".join(_item_text(rig, f"{name}.{i}") for i in range(1, len(value) + 1))
    if known is None or not isinstance(value, float):
        return str(value)
    words = format_parameter(rig, name, value)
    return f"{name.rpartition('.')[2]} {words}" if named else words


def _item_text(rig: Slider | Machine, name: str) -> str:
    """Format the parameters of a list item, such as ``b 0.006, d_c 4 um``."""
    own = {key.removeprefix(f"{name}."): address.value for key, address in rig.parameters().items()
           if key.startswith(f"{name}.") and address.value is not None}  # fmt: skip
    return ", ".join(f"{key} {format_parameter(rig, f'{name}.{key}', value)}" for key, value in own.items())
