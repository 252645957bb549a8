"""Pairs of rigs with values of their unknown parameters filled in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from steadyslip.core.areas import is_per_area
from steadyslip.linear.status import stability
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.verdict.chances import values_tried

Rig = Slider | Machine
Intervals = Mapping[str, tuple[float, float]]
ALIKE = 1e-12  # a smaller relative difference of interval ends is rounding in a conversion of units
BOTH, FIRST, SECOND = "both", "first", "second"


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of rigs with all combinations tried of values of their unknown parameters.

    Attributes
    ----------
    of_first, of_second : mapping of str to (float, float)
        Intervals of each rig's unknown parameters, SI units.
    shared : tuple of str
        Names of unknown parameters with one interval in both rigs: they vary together, such as for a common guide.
    tried : tuple of (Slider or Machine, Slider or Machine)
        A single pair without unknown parameters.
    """

    of_first: Intervals
    of_second: Intervals
    shared: tuple[str, ...]
    tried: tuple[tuple[Rig, Rig], ...]

    @property
    def apart(self) -> tuple[str, ...]:
        """Names of the parameters unknown in one rig only, or in both within different intervals."""
        return tuple(name for name in {**self.of_first, **self.of_second} if name not in self.shared)

    def stability(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Verdicts on the first rig, and verdicts on the second rig, at the values tried."""
        first, second = (tuple(str(stability(one)) for one in rigs) for rigs in zip(*self.tried, strict=True))
        return first, second


def pairs_of(own: tuple[Rig, Rig], made: tuple[Rig, Rig], intervals: tuple[Intervals, Intervals]) -> Pairs:
    """`Pairs` of the comparable forms `made` of two rigs, with values from the intervals of the rigs `own`."""
    first, second = (
        {name: _converted(rig, other, name, ends) for name, ends in of.items()}
        for rig, other, of in zip(own, made, intervals, strict=True)
    )
    shared = tuple(name for name, ends in first.items() if name in second and _alike(ends, second[name]))
    several = {(BOTH, name): first[name] for name in shared}
    several |= {(FIRST, name): ends for name, ends in first.items() if name not in shared}
    several |= {(SECOND, name): ends for name, ends in second.items() if name not in shared}
    tried = tuple((_at(made[0], values, FIRST), _at(made[1], values, SECOND)) for values in values_tried(several))
    return Pairs(first, second, shared, tried)


def _at(rig: Rig, values: Mapping[tuple[str, str], float], which: str) -> Rig:
    own = {name: value for (side, name), value in values.items() if side in (BOTH, which)}
    return rig.with_values(own) if own else rig


def _converted(rig: Rig, made: Rig, name: str, ends: tuple[float, float]) -> tuple[float, float]:
    """Ends of an interval of `rig`, converted to the quantities of its comparable form `made`: stresses or totals."""
    total = made.area == 1.0 != rig.area and is_per_area(rig.parameters()[name].role.unit)
    factor = float(rig.area or 1.0) if total else 1.0
    return factor * ends[0], factor * ends[1]


def _alike(ends: tuple[float, float], others: tuple[float, float]) -> bool:
    return all(math.isclose(one, other, rel_tol=ALIKE) for one, other in zip(ends, others, strict=True))
