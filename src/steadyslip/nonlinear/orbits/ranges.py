"""Stable ranges of a branch, the nearest bifurcations beside a value, and checks over all cycles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf

from steadyslip.core.checks import Check
from steadyslip.core.format import format_quantity
from steadyslip.nonlinear.orbits.cycle import Cycle, End, SpecialCycle
from steadyslip.nonlinear.orbits.special import NOISE, SMALL


@dataclass(frozen=True, eq=False)
class Stretch:
    """Consecutive cycles of a branch that are all stable or all unstable, between changes of stability.

    Attributes
    ----------
    stable : bool
    cycles : tuple of Cycle
        The cycles of the stretch, together with the cycles at its ends if there are any.
    ends : tuple of End
        First and last end along the branch, with a kind of `SpecialCycle` or `End`, or ``not located`` if no
        bifurcation was found between the last cycle of the stretch and its neighbour of other stability.
    """

    stable: bool
    cycles: tuple[Cycle, ...]
    ends: tuple[End, End]

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value of the parameter, SI units; cycles within rounding of an end get the end's value."""
        ends = [end.value for end in self.ends]
        values = [value for value in (cycle.value for cycle in self.cycles) if not _near(value, ends)]
        return min([*values, *ends]), max([*values, *ends])


def _near(value: float, ends: Sequence[float]) -> bool:
    """True if a value equals one of the ends within rounding."""
    return any(abs(value - end) <= NOISE * abs(end) for end in ends)


def stretches_of(
    cycles: Sequence[Cycle], special: Sequence[SpecialCycle], gaps: Sequence[int], bounds: Sequence[tuple[End, End]]
) -> Iterator[Stretch]:
    """Yield the stretches of equal stability of a branch, in order; `bounds` are the ends of its continuous parts."""
    where = {point.index: End(point.kind, point.cycle.value, point.cycle) for point in special}
    for (start, stop), (begins, stops) in zip(pairwise((0, *gaps, len(cycles))), bounds, strict=True):
        changes = [i for i in range(start + 1, stop) if cycles[i].stable != cycles[i - 1].stable]
        for low, high in pairwise([start, *changes, stop] if stop > start else []):
            first = begins if low == start else where.get(low, End("not located", cycles[low].value))
            last = stops if high == stop else where.get(high, End("not located", cycles[high - 1].value))
            inside = cycles[low:high]
            before = [one.cycle for one in (first,) if one.cycle is not None and one.cycle is not inside[0]]
            after = [one.cycle for one in (last,) if one.cycle is not None and one.cycle is not inside[-1]]
            yield Stretch(inside[0].stable, (*before, *inside, *after), (first, last))


@dataclass(frozen=True)
class Neighbour:
    """Bifurcation or end of a branch (or of its doublings) that is nearest to a value of the parameter.

    Attributes
    ----------
    kind : str
        Kind of a `SpecialCycle` or `End`.
    value : float
        Value of the parameter, SI units.
    multiple : int
        1 on the branch itself, 2 on its cycles of twice the period, and so on.
    """

    kind: str
    value: float
    multiple: int

    def words(self, unit: str, area: float | None) -> str:
        """Format name and parameter value of the neighbour, for messages."""
        name = WORDS.get(self.kind, self.kind)
        of = "" if self.multiple == 1 else f" of the cycles of {self.multiple} times the period"
        return f"the {name}{of} at {format_quantity(self.value, unit, 6, area)}"


WORDS = {
    "last cycle": "last cycle that could be followed", "range": "end of the range",
    "not located": "change of stability that was not located",
}  # fmt: skip
Changing = tuple[Sequence[SpecialCycle], Sequence[Stretch]]


def neighbours(levels: Sequence[Changing], value: float) -> tuple[Neighbour | None, Neighbour | None]:
    """Nearest bifurcations or ends below and above a value; `levels` are the branch and its successive doublings."""
    places = list[Neighbour]()
    for i, (special, stretches) in enumerate(levels):
        places += [Neighbour(one.kind, one.cycle.value, 2**i) for one in special]
        ends = [end for one in stretches for end in one.ends]
        places += [Neighbour(end.kind, end.value, 2**i) for end in ends if end.kind != "period doubling"]
    below = max((one for one in places if one.value <= value), key=lambda one: one.value, default=None)
    above = min((one for one in places if one.value > value), key=lambda one: one.value, default=None)
    return below, above


def checks_of(cycles: Sequence[Cycle], repeated: int = 0) -> tuple[Check, ...]:
    """Worst checks of several cycles, with the number of cycles that fail; `repeated` were computed again."""
    kinds = (
        ("", 0, is_open, cycles),
        ("stability of ", 1, is_undecided, [one for one in cycles if not _is_small(one)]),
    )
    found = []
    for what, place, fails, some in kinds:
        if not some:
            continue
        worst = max(
            (one.checks[place] for one in some), key=lambda one: one.error / one.allowed if one.allowed else inf
        )
        failing, how = sum(map(fails, some)), worst.how
        how += f"; {repeated} computed again with smaller errors per step" if repeated else ""
        many = f"{failing} of {len(cycles)}" if failing else f"{len(some)}"
        found.append(replace(worst, what=f"{what}{many} cycle{'' if many == '1' else 's'}", how=how))
    return tuple(found)


def is_open(cycle: Cycle) -> bool:
    """True if the closing error of a cycle is too large."""
    return not cycle.checks[0].passed


def is_undecided(cycle: Cycle) -> bool:
    """True if neither the multipliers, because of their errors, nor the kind of onset decide the stability."""
    return not (cycle.checks[1].passed or _is_small(cycle))


def _is_small(cycle: Cycle) -> bool:
    """True if the cycle is so small that the kind of onset decides its stability."""
    return cycle.amplitude <= SMALL
