"""`stable_within`: values of unknown parameters at which sliding is stable."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import SteadyslipError
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.results import ReadOnly
from steadyslip.core.written import WrittenAs, displayed_as
from steadyslip.linear.status import STABLE, status
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import steady_state
from steadyslip.verdict.chances import spread_over

VALUES = 129  # number of values tried in each interval; a window narrower than 1 % of the interval may be missed
HALVINGS = 40  # number of bisections between two tried values with different verdicts: far below the printed digits
LOG2_RIGS = 10  # log2 of the number of rigs with all unknown parameters varied at once: shares to a few percent


@dataclass(frozen=True)
class ValuesWithin(Displayed):
    """Values of one unknown parameter at which sliding is stable, the others unchanged.

    Attributes
    ----------
    parameter, unit : str
    low, high : float
        The interval, SI units.
    values : tuple of (float, float)
        Intervals in it where sliding is stable, rising.
    load : float or None
        Normal force (N) in steady sliding; multiplies values in 1/m or s/m to give N/m or N s/m of the contact.
    """

    parameter: str
    unit: str
    low: float
    high: float
    values: tuple[tuple[float, float], ...]
    load: float | None = None
    written_as: WrittenAs = field(default=WrittenAs(), repr=False)
    """Notation of the parameter in the rig's file, kept in printed values."""

    def shown(self, value: float) -> str:
        """Text of a value with its unit; a value per load is also given as the value of the contact."""
        with displayed_as(self.written_as):
            text = format_quantity(value, self.unit)
        if self.load is None or self.unit not in PER_LOAD or " at " in text:
            return text
        whole = format_quantity(value * self.load, PER_LOAD[self.unit])
        return f"{text} ({whole} at {format_quantity(self.load, 'N')})"

    @property
    def given(self) -> str:
        """Text of the interval in which the parameter is known to lie."""
        return f"{self.shown(self.low)} to {self.shown(self.high)}"

    def __str__(self) -> str:
        return f"{self.parameter}: {self.told}"

    @property
    def told(self) -> str:
        """Text on those values in the interval at which sliding is stable."""
        given = self.given
        if not self.values:
            return f"stable nowhere in {given}"
        if self.values == ((self.low, self.high),):
            return f"stable everywhere in {given}"
        return f"stable {' and '.join(map(self._part, self.values))}, in {given}"

    def _part(self, one: tuple[float, float]) -> str:
        if one[0] == self.low:
            return f"below {self.shown(one[1])}"
        return (
            f"above {self.shown(one[0])}"
            if one[1] == self.high
            else f"from {self.shown(one[0])} to {self.shown(one[1])}"
        )


PER_LOAD = {"1/m": "N/m", "s/m": "N s/m"}
"""Unit of a value for the whole contact, by the unit of that value per normal load."""


@dataclass(frozen=True, eq=False)
class StableWithin(ReadOnly):
    """Verdicts over intervals of unknown parameters.

    Attributes
    ----------
    rig : Slider or Machine
    each : tuple of ValuesWithin
        Every parameter by itself.
    stable : ndarray of bool (m,)
        Verdicts on rigs spread evenly over all intervals at once, on a log scale where both ends are above 0.
    """

    rig: Slider | Machine = field(repr=False)
    each: tuple[ValuesWithin, ...]
    stable: Array = field(repr=False)

    @property
    def everywhere(self) -> bool:
        """True if no value in the intervals was found unstable."""
        return bool(np.all(self.stable)) and all(one.values == ((one.low, one.high),) for one in self.each)

    def __str__(self) -> str:
        lines = ["Not known, by the table [unknown] of the file:", *(f"  {one}" for one in self.each)]
        if self.at_once:
            lines.append(f"  all at once: {self.at_once}")
        return "\n".join(lines)

    @property
    def at_once(self) -> str:
        """Text on the share of stable rigs with all parameters varied at once; empty for a single parameter."""
        if len(self.each) == 1:
            return ""
        share = float(np.mean(self.stable))
        words = {1.0: f"stable in all {len(self.stable)} rigs", 0.0: f"stable in none of {len(self.stable)} rigs"}
        part = f"stable in {format_percent(share)} of {len(self.stable)} rigs"
        return f"{words.get(share, part)} spread over the intervals"

    def to_dict(self) -> dict[str, Any]:
        """Verdicts as JSON-ready dict, SI units."""
        return {
            "parameters": {
                one.parameter: {"interval": [one.low, one.high], "stable": [list(part) for part in one.values]}
                for one in self.each
            },
            "stable_share": float(np.mean(self.stable)),
        }


@checked()
def stable_within(rig: Slider | Machine, intervals: Mapping[str, tuple[float, float]]) -> StableWithin:
    """Find the values of unknown parameters at which steady sliding is stable.

    Parameters
    ----------
    rig : Slider or Machine
    intervals : mapping of str to (float, float)
        Least and largest value by dotted name, SI units.

    Returns
    -------
    StableWithin

    Raises
    ------
    ParameterError
        If a name or value is not allowed.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> print(ss.verdict.stable_within(rig, {"friction.a": (0.014, 0.017)}))
    Not known, by the table [unknown] of the file:
      friction.a: stable above 0.01554, in 0.014 to 0.017
    """
    from scipy.stats import qmc

    ranges = {rig.resolve(name): (float(low), float(high)) for name, (low, high) in intervals.items()}
    for name, ends in ranges.items():
        for end in ends:
            rig.with_values({name: end})
    even = qmc.Sobol(len(ranges), scramble=True, rng=np.random.default_rng(0)).random_base2(LOG2_RIGS)
    varied = {name: spread_over(*ends, even[:, i]) for i, (name, ends) in enumerate(ranges.items())}
    each = tuple(_values(rig, name, *ends) for name, ends in ranges.items())
    return StableWithin(rig, each, _is_stable(rig, varied))


def _is_stable(rig: Slider | Machine, varied: Mapping[str, Array]) -> Array:
    return np.asarray(status(operating_point(rig, varied, rig.kept_zeros())) == STABLE)


def _values(rig: Slider | Machine, name: str, low: float, high: float) -> ValuesWithin:
    share = np.linspace(0.0, 1.0, VALUES)
    found = _is_stable(rig, {name: spread_over(low, high, share)})
    at = np.flatnonzero(found[1:] != found[:-1])
    left, right, first = share[at], share[at + 1], found[at]
    for _ in range(HALVINGS if len(at) else 0):
        middle = (left + right) / 2
        same = _is_stable(rig, {name: spread_over(low, high, middle)}) == first
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    ends = [low, *spread_over(low, high, (left + right) / 2).tolist(), high]
    parts = tuple((a, b) for i, (a, b) in enumerate(pairwise(ends)) if bool(found[0]) != bool(i % 2))
    return ValuesWithin(name, rig.parameters()[name].role.unit, low, high, parts, _load(rig), rig.written_as(name))


def _load(rig: Slider | Machine) -> float | None:
    """Normal force (N) of a slider with an area in steady sliding; None for others."""
    if rig.area is None:
        return None
    with suppress(SteadyslipError):
        return float(steady_state(rig).normal_stress * rig.area)
    return None
