"""`tolerate`: verdicts on rigs sampled within the tolerances of a rig's parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array, valid_together
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_growth, format_percent, format_range
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.files.specifications.tolerance_tables import (
    Adjustment as Adjustment,
    Tolerances as Tolerances,
    read_tolerances as read_tolerances,
)
from steadyslip.linear.stable_values import edge_along, name_along, safety_factor
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, status
from steadyslip.linear.stiffness import STIFFNESS, growth_rate
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.build import model_of
from steadyslip.model.point import operating_point
from steadyslip.verdict.export import finite
from steadyslip.verdict.spreads import GROUPS, Spreads, spreads_of
from steadyslip.verdict.words import format_parameter, format_parameter_range

# Sizes of samples, chosen by trial: computing time against the error of shares and the resolution of ranges (1/64).
LOG2_CLOSED, LOG2_OTHERS, LOG2_LATE = 12, 8, 4  # log2 of rigs per group: with closed form, others, with a delay
VALUES_ALONE = 65  # number of values of a parameter that is varied alone, both ends included
VALUES_SEARCHED = 17  # number of values of each parameter that `_otherwise` tries in turn
REACHES = (1.0, 0.1, 0.01, 0.001)  # shares of the range that `_otherwise` searches in successive rounds
BINS = 32  # number of bins with equally many rigs; the variance between bins is attributed to the parameter
LEAST = 0.01  # a parameter with a smaller share of the variance is not named
ALIKE = 1e-12  # a smaller difference of relative deviations is rounding in a conversion of units
STUDENT = 2.131  # two-sided 95 % quantile of Student's distribution with GROUPS - 1 degrees of freedom
GIVEN = Tested(
    "names and their tolerances, or what read_tolerances gives", lambda v: isinstance(v, (Mapping, Tolerances))
)


@dataclass(frozen=True)
class Alone(Displayed):
    """Safety factor, growth rate and stability over the tolerance of one parameter, the others unchanged.

    Attributes
    ----------
    parameter : str
    low, high : float
        Range of the parameter, SI units; for a normal distribution that of 95 %.
    safety : tuple of float
        Least and largest safety factor: value of the parameter `Tolerated.along` over its edge; NaN without an edge.
    growth : tuple of float
        Least and largest growth rate of small disturbances, 1/s.
    stable : bool or None
        True if sliding is stable throughout the range, False if nowhere, None if in a part of it.
    share : float
        Share of the variance of the verdict, all parameters varied, that vanishes once this parameter is known; if all
        sampled rigs have one verdict, of the variance of the growth rate.
    """

    parameter: str
    low: float
    high: float
    unit: str
    safety: tuple[float, float]
    growth: tuple[float, float]
    stable: bool | None
    share: float
    area: float | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Tolerated(ReadOnly):
    """Verdicts on m rigs whose parameters lie within tolerances.

    Attributes
    ----------
    rig : Slider or Machine
    tolerances : mapping or Tolerances
        The argument of `tolerate`.
    alone : tuple of Alone
        Each parameter varied by itself, the largest `Alone.share` first.
    stable : ndarray of bool (m,)
        True for rigs drawn from the distributions of all parameters that slide steadily and stably.
    exists : ndarray of bool (m,)
        True for rigs that slide steadily.
    growth : ndarray (m,)
        Growth rate of small disturbances, 1/s: of the leading eigenvalue.
    along : str
        Parameter to which `edge` and `safety` refer: by default ``slider.stiffness`` for a slider, empty for a machine.
    edge : ndarray (m,)
        Nearest edge of stability in the parameter `along`, SI units; NaN where there is none.
    safety : ndarray (m,)
        Value of the parameter `along` over its nearest edge.
    ranges : dict of str to (float, float)
        Least and largest ``edge``, ``safety`` and ``growth`` of the drawn rigs, of those at the corners and of
        `otherwise`; without quantities that none of these rigs has.
    error : float
        Half-width of the 95 % interval of `share`.
    corners : int
        Number of corners of the ranges that were tried; 0 if every parameter is distributed normally.
    otherwise : dict of str to float
        If all drawn rigs have one verdict, values of a rig within the ranges with the other, by dotted name in SI
        units: a corner, or found by a search from the drawn rig nearest to the edge; empty if none was found.
    """

    rig: Slider | Machine = field(repr=False)
    tolerances: Mapping[str, Any] | Tolerances = field(repr=False)
    alone: tuple[Alone, ...]
    stable: Array = field(repr=False)
    exists: Array = field(repr=False)
    growth: Array = field(repr=False)
    along: str
    edge: Array = field(repr=False)
    safety: Array = field(repr=False)
    ranges: Mapping[str, tuple[float, float]] = field(repr=False)
    error: float
    corners: int
    otherwise: Mapping[str, float]

    @property
    def share(self) -> float:
        """Share of the rigs that slide steadily and stably: the chance of a stable rig."""
        return float(np.mean(self.stable))

    def __str__(self) -> str:
        wide = max(26, 2 + max(len(one.parameter) for one in self.alone))
        unknown = isinstance(self.tolerances, Tolerances) and self.tolerances.unknown
        lines = [self.headline() + (", with the file's values of what is not known" if unknown else "")]
        if not np.all(self.exists):
            lines.append(f"{'no steady sliding':<{wide}}in {format_percent(1 - float(np.mean(self.exists)))} of them")
        own = self.along == STIFFNESS
        edge, over = (
            ("critical stiffness", "stiffness over critical") if own else (f"edge in {self.along}", "over its edge")
        )
        ranges = [(edge, "edge", self.unit), (over, "safety", "1")] if self.along else []
        if "edge" not in self.ranges:
            ranges.append(("growth rate", "growth", ""))
        for label, of, unit in ranges:
            if (span := self.ranges.get(of)) is not None:
                text = format_range(*span, unit, self.area) if unit else format_growth(*span)
                lines.append(f"{label:<{wide}}{text}")
        for one in self.alone:
            if not np.isnan(one.safety[0]):
                beside = f", {one.safety[0]:.4g} to {one.safety[1]:.4g} times {'critical' if own else 'its edge'}"
            else:
                beside = f", growth rate {format_growth(*one.growth)}" if not self.along else ""
            word = {True: "stable", False: "unstable", None: "stable in a part of it"}[one.stable]
            ends = format_parameter_range(self.rig, one.parameter, one.low, one.high)
            lines.append(f"{one.parameter:<{wide}}{ends} alone: {word}{beside}")
        if len(self.alone) > 1:
            lines.append(f"{'measure next':<{wide}}{self._next()}")
        return "\n".join(lines)

    def headline(self) -> str:
        """Sentence on the share of stable rigs; if that is all or none, on corners of the ranges and exceptions too."""
        count, share = len(self.stable), self.share
        if 0 < share < 1:
            return f"Stable in {format_chance(share, self.error)} of {count} rigs within the tolerances"
        words = f"Stable in {'all' if share else 'none of'} {count} rigs within the tolerances"
        if self.otherwise:
            values = (f"{name} {format_parameter(self.rig, name, value)}" for name, value in self.otherwise.items())
            kind = "but not in every one: unstable" if share else "but in another one: stable"
            return f"{words}, {kind} at {', '.join(values)}"
        if not self.corners:
            return words
        return f"{words}, {'and' if share else 'nor'} at {'all' if share else 'any'} of their {self.corners} corners"

    def _next(self) -> str:
        parts = [f"{one.parameter} ({format_percent(round(one.share, 2))})" for one in self.alone if one.share >= LEAST]
        of = "verdict" if 0 < self.share < 1 else "growth rate"
        return f"{', '.join(parts[:3]) or 'no single one matters much'}; shares of the variance of the {of}"

    def to_dict(self) -> dict[str, Any]:
        """Verdicts as JSON-ready dict in SI units, as ``--json`` prints it."""
        parameters = [
            {
                "parameter": one.parameter, "low": one.low, "high": one.high, "unit": one.unit, "stable": one.stable,
                "safety": list(one.safety), "growth": list(one.growth), "share_of_variance": one.share,
            }
            for one in self.alone
        ]  # fmt: skip
        found: dict[str, Any] = finite(
            {
                "chance": self.share, "error": self.error, "rigs": len(self.stable), "corners": self.corners,
                "otherwise": dict(self.otherwise),
                "ranges": {of: list(ends) for of, ends in self.ranges.items()},
                "exists": float(np.mean(self.exists)), "along": self.along,
                "parameters": parameters,
            }
        )  # fmt: skip
        return found

    @property
    def unit(self) -> str:
        """Unit of `edge`; ``1`` where no parameter is named."""
        return self.rig.parameters()[self.along].role.unit if self.along else "1"

    @property
    def area(self) -> float | None:
        """Contact area (m²) by which `edge` is multiplied for a total; None where there is none."""
        return self.rig.printed_area(self.along) if self.along else None

    def plot(self, ax: Any = None) -> Any:
        """Draw the safety factor or growth rate over each tolerance; see `steadyslip.figures.tolerance_bars`."""
        return draw(self, ax=ax)


@checked(tolerances=GIVEN)
def tolerate(
    rig: Slider | Machine, tolerances: Mapping[str, Any] | Tolerances, *, along: str | None = None
) -> Tolerated:
    """Verdicts on sampled rigs whose parameters lie within tolerances, all varied at once and each alone.

    Parameters
    ----------
    rig : Slider or Machine
    tolerances : mapping of str to float or str, or Tolerances
        Largest deviation to either side by dotted name: a number in SI units, text with a unit, or a share of the
        value such as ``"5 %"``; also ``"+5 % -1 %"`` and ``"5 % (normal)"``. Or what
        `steadyslip.verdict.read_tolerances` gives.
    along : str, optional
        Dotted name of the parameter whose edge and safety factor are computed; it must enter the equations linearly.
        By default a slider's stiffness; for a machine growth rates only.

    Returns
    -------
    Tolerated

    Raises
    ------
    ParameterError
        If a name or a tolerance is not allowed, or leads out of the domain of a parameter.
    NotAvailable
        If the parameter `along` does not enter linearly.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> print(ss.tolerate(rig, {"friction.a": "3 %"}))
    Stable in none of 65536 rigs within the tolerances, nor at any of their 2 corners
    critical stiffness        20.64 to 37.5 GPa/m
    stiffness over critical   0.24 to 0.4361
    friction.a                0.01407 to 0.01494 alone: unstable, 0.24 to 0.4361 times critical
    """
    name = name_along(rig, along) if along or rig.default_along else ""
    spreads = spreads_of(rig, tolerances)
    drawn = spreads.drawn(log2_of(rig))
    possible = np.broadcast_to(spreads.possible(drawn), next(iter(drawn.values())).shape)
    if not np.all(np.any(possible, axis=1)):
        raise ParameterError([Problem("tolerances", "contradict each other: hardly any rig within them can exist")])
    varied = {one: values[possible] for one, values in drawn.items()}
    every = _outcomes(rig, varied, name)
    share, error = chance_of(every.stable, possible)
    uniform = any(not one.normal for one in spreads.of.values())
    corners = spreads.corners() if uniform else {}
    rare = {} if 0 < share < 1 else _otherwise(spreads, corners, varied, every)
    target = every.stable.astype(float) if 0 < share < 1 else every.growth
    alone = [
        _alone(rig, one, *spread.ends, name, _share_of_variance(varied[one], target))
        for one, spread in spreads.of.items()
    ]
    alone.sort(key=lambda one: -one.share)
    count = len(next(iter(corners.values()))) if corners else 0
    beside = [{key: np.array([value]) for key, value in rare.items()}, _possible(spreads, corners)]
    judged = [every, *(_outcomes(rig, rigs, name) for rigs in beside if any(map(len, rigs.values())))]
    return Tolerated(
        rig, tolerances, tuple(alone), every.stable, every.exists, every.growth, name, every.edge, every.safety,
        _ranges(judged), error, count, rare,
    )  # fmt: skip


def chance_of(stable: Array, possible: Array) -> tuple[float, float]:
    """Mean of `stable` (m,), for the m True entries of `possible` (GROUPS, n), and half-width of its 95 % interval.

    If all have one verdict, the half-width is that of m independent draws, 3/m.
    """
    table = np.full(possible.shape, np.nan)
    table[possible] = stable
    spread = float(np.std(np.nanmean(table, axis=1), ddof=1))
    return float(np.mean(stable)), STUDENT * spread / GROUPS**0.5 if spread else 3.0 / len(stable)


def differing_tolerances(first: Tolerated | None, second: Tolerated | None) -> list[str]:
    """Names of the parameters whose relative tolerances, and pairs whose correlations, differ between two rigs."""
    one, other = ({} if it is None else spreads_of(it.rig, it.tolerances).shapes() for it in (first, second))
    none = (np.nan,)
    return [
        name for name in {**one, **other}
        if not np.allclose(one.get(name, none), other.get(name, none), rtol=ALIKE, atol=ALIKE)
    ]  # fmt: skip


def format_chance(share: float, error: float) -> str:
    """Format a share and its error in percent, the error with two digits.

    >>> format_chance(0.24373, 0.00121), format_chance(0.99991, 0.00004)
    ('24.37 ± 0.12 %', '99.9910 ± 0.0040 %')
    """
    digits = max(0, 1 - int(np.floor(np.log10(100 * error)))) if error else 2
    return f"{100 * share:.{digits}f} ± {100 * error:.{digits}f} %"


def _possible(spreads: Spreads, rigs: Mapping[str, Array]) -> dict[str, Array]:
    """Values by name of those `rigs` whose values are valid together."""
    if not rigs:
        return {}
    mask = np.broadcast_to(spreads.possible(rigs), next(iter(rigs.values())).shape)
    return {name: values[mask] for name, values in rigs.items()}


def _ranges(judged: Sequence[_Outcomes]) -> dict[str, tuple[float, float]]:
    """Least and largest finite edge, safety factor and growth rate over several sets of rigs, where any is finite."""
    found = {
        of: _finite_range(np.concatenate([getattr(one, of) for one in judged])) for of in ("edge", "safety", "growth")
    }
    return {of: ends for of, ends in found.items() if ends is not None}


def _otherwise(
    spreads: Spreads, corners: Mapping[str, Array], varied: Mapping[str, Array], every: _Outcomes
) -> dict[str, float]:
    """Values of a rig within the ranges whose verdict differs from that of all rigs drawn; empty if none is found.

    Corners of the ranges are tried first, then values around the drawn rig, or corner, that is closest to the edge.
    """
    sign = 1.0 if every.stable[0] else -1.0  # a growth rate of the other sign is searched for

    def judged(rigs: Mapping[str, Array]) -> tuple[Array, Array]:
        mask = np.broadcast_to(spreads.possible(rigs), next(iter(rigs.values())).shape)
        if not np.any(mask):
            return mask, np.full(mask.shape, -np.inf)
        stable, score = np.broadcast_to(every.stable[0], mask.shape).copy(), np.full(mask.shape, -np.inf)
        found = _outcomes(spreads.rig, {name: values[mask] for name, values in rigs.items()}, "")
        stable[mask], score[mask] = found.stable, sign * np.nan_to_num(found.growth, nan=-np.inf)
        return stable != every.stable[0], score

    def at(rigs: Mapping[str, Array], i: int) -> dict[str, float]:
        return {name: float(values[i]) for name, values in rigs.items()}

    starts = [at(varied, int(np.argmax(np.nan_to_num(sign * every.growth, nan=-np.inf))))]
    if corners:
        other, score = judged(corners)
        if np.any(other):
            return at(corners, int(np.flatnonzero(other)[np.argmax(score[other])]))
        starts.append(at(corners, int(np.argmax(score))))
    for here in starts:
        for reach in REACHES:
            for name, one in spreads.of.items():
                if one.normal:
                    continue
                line = {key: np.full(VALUES_SEARCHED, value) for key, value in here.items()}
                near = here[name] + reach * (one.high - one.low) * np.linspace(-1, 1, VALUES_SEARCHED)
                line[name] = np.clip(near, one.low, one.high)
                other, score = judged(line)
                if np.any(other):
                    return at(line, int(np.argmax(other)))
                here = at(line, int(np.argmax(score)))
    return {}


def _share_of_variance(values: Array, target: Array) -> float:
    """Share of the variance of `target` (m,) explained by bins of `values` (m,), corrected for sampling noise."""
    known = np.isfinite(target)
    values, target = values[known], target[known]
    count = len(target)
    if count <= BINS or not np.ptp(target) > 0:
        return 0.0
    bins = np.array_split(target[np.argsort(values)], BINS)
    between = sum(len(one) * (np.mean(one) - np.mean(target)) ** 2 for one in bins) / (count * np.var(target))
    return float(max(0.0, 1 - (1 - between) * (count - 1) / (count - BINS)))


def log2_of(rig: Slider | Machine) -> int:
    """Base-2 logarithm of the number of rigs sampled in each group, by the cost of a verdict on this rig."""
    model = model_of(rig, ())
    return LOG2_CLOSED if model.has_closed_form else LOG2_LATE if model.delays else LOG2_OTHERS


def _finite_range(values: Array) -> tuple[float, float] | None:
    """Least and largest finite value; None if no value is finite."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if len(finite) else None


def _alone(rig: Slider | Machine, name: str, low: float, high: float, along: str, share: float) -> Alone:
    values, nothing = np.linspace(low, high, VALUES_ALONE), (float("nan"),) * 2
    possible = np.broadcast_to(valid_together(rig, "", {name: values}), values.shape)
    found = _outcomes(rig, {name: values[possible]}, along)
    whole = bool(found.stable[0]) if np.all(found.stable == found.stable[0]) else None
    safety, growth = _finite_range(found.safety) or nothing, _finite_range(found.growth) or nothing
    return Alone(
        name, low, high, rig.parameters()[name].role.unit, safety, growth, whole, share, rig.printed_area(name)
    )


@dataclass(frozen=True)
class _Outcomes:
    """Verdicts on m rigs as arrays (m,): steady sliding exists, is stable, growth rate (1/s), edge, safety factor."""

    exists: Array
    stable: Array
    growth: Array
    edge: Array
    safety: Array


def _outcomes(rig: Slider | Machine, varied: Mapping[str, Array], along: str) -> _Outcomes:
    found = status(operating_point(rig, varied, rig.kept_zeros()))
    growth = np.asarray(growth_rate(rig, varied), dtype=float)
    edge = safety = np.full(len(growth), np.nan)
    if along:
        edge = np.asarray(edge_along(rig, along, varied)[0], dtype=float)
        safety = np.asarray(safety_factor(rig, varied, along=along), dtype=float)
    return _Outcomes((found != ABSENT) & (found != UNKNOWN), found == STABLE, growth, edge, safety)
