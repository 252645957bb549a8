"""`tolerate`: verdicts on rigs sampled within the tolerances of their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_percent, format_range
from steadyslip.core.names import resolve
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.records import Address
from steadyslip.core.results import ReadOnly
from steadyslip.core.roles import Parameter
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.stable_values import edge_along, name_along, safety_factor
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, status
from steadyslip.linear.stiffness import STIFFNESS, growth_rate
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point

# Numbers of samples, chosen by trial: computing time against resolution of shares (1/4096) and of ranges (1/64).
LOG2_RIGS = 12  # 2**12 = 4096 rigs with all parameters varied at once; Sobol points need a power of two
VALUES_ALONE = 65  # values of a parameter that is varied alone, both ends included


@dataclass(frozen=True)
class Alone(Displayed):
    """Safety factor, growth rate and stability over the tolerance of one parameter, the others unchanged.

    Attributes
    ----------
    parameter : str
    low, high : float
        Its range, SI units.
    safety : tuple of float
        Least and largest safety factor: value over edge of the parameter `Tolerated.along`; NaN without edge.
    growth : tuple of float
        Least and largest growth rate of small disturbances, 1/s.
    stable : bool or None
        Whether sliding is stable throughout the range; None if in a part of it only.
    """

    parameter: str
    low: float
    high: float
    unit: str
    safety: tuple[float, float]
    growth: tuple[float, float]
    stable: bool | None
    area: float | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Tolerated(ReadOnly):
    """Verdicts on m rigs whose parameters lie within tolerances.

    Attributes
    ----------
    rig : Slider or Machine
    alone : tuple of Alone
        Each parameter by itself, the one that matters most first.
    stable : ndarray of bool (m,)
        True for rigs, spread evenly over all ranges at once, that slide steadily and stably.
    exists : ndarray of bool (m,)
        True for rigs that slide steadily.
    growth : ndarray (m,)
        Growth rate of small disturbances, 1/s: of the leading eigenvalue.
    along : str
        The parameter of `edge` and `safety`: ``slider.stiffness`` for a slider unless another is named; empty for a
        machine unless one is named.
    edge : ndarray (m,)
        Nearest edge of stability in the parameter `along`, SI units; NaN where there is none.
    safety : ndarray (m,)
        Value of the parameter `along` over its nearest edge.
    """

    rig: Slider | Machine = field(repr=False)
    alone: tuple[Alone, ...]
    stable: Array = field(repr=False)
    exists: Array = field(repr=False)
    growth: Array = field(repr=False)
    along: str
    edge: Array = field(repr=False)
    safety: Array = field(repr=False)

    @property
    def share(self) -> float:
        """Share of the rigs that slide steadily and stably."""
        return float(np.mean(self.stable))

    def __str__(self) -> str:
        count, share = len(self.stable), self.share
        whole = {1.0: f"Stable in all {count} rigs", 0.0: f"Stable in none of {count} rigs"}
        wide = max(26, 2 + max(len(one.parameter) for one in self.alone))
        lines = [f"{whole.get(share, f'Stable in {format_percent(share)} of {count} rigs')} within the tolerances"]
        if not np.all(self.exists):
            lines.append(f"{'no steady sliding':<{wide}}in {format_percent(1 - float(np.mean(self.exists)))} of them")
        own = self.along == STIFFNESS and isinstance(self.rig, Slider)
        edge, over = (
            ("critical stiffness", "stiffness over critical") if own else (f"edge in {self.along}", "over its edge")
        )
        ranges = [(edge, self.edge, self.unit), (over, self.safety, "1")] if self.along else []
        if not self.along or not np.any(np.isfinite(self.edge)):
            ranges.append(("growth rate", self.growth, "1/s"))
        for label, values, unit in ranges:
            if (span := _finite_range(values)) is not None:
                lines.append(f"{label:<{wide}}{format_range(*span, unit, self.area)}")
        for one in self.alone:
            if not np.isnan(one.safety[0]):
                beside = f", {one.safety[0]:.4g} to {one.safety[1]:.4g} times {'critical' if own else 'its edge'}"
            else:
                beside = f", growth rate {format_range(*one.growth, '1/s')}" if not self.along else ""
            word = {True: "stable", False: "unstable", None: "stable in a part of it"}[one.stable]
            ends = format_range(one.low, one.high, one.unit, one.area)
            lines.append(f"{one.parameter:<{wide}}{ends} alone: {word}{beside}")
        return "\n".join(lines)

    @property
    def unit(self) -> str:
        """Unit of `edge`; ``1`` where no parameter is named."""
        return self.rig.parameters()[self.along].role.unit if self.along else "1"

    @property
    def area(self) -> float | None:
        """Contact area (m²) by which `edge` is multiplied for a total; None where there is none."""
        return self.rig.area_of(self.along) if self.along else None

    def plot(self, ax: Any = None) -> Any:
        """Draw the safety factor or growth rate over each tolerance; see `steadyslip.figures.tolerances`."""
        return draw(self, ax=ax)


@checked()
def tolerate(rig: Slider | Machine, tolerances: Mapping[str, Any], *, along: str | None = None) -> Tolerated:
    """Verdicts on rigs whose parameters lie within tolerances, all varied at once and each alone.

    Parameters
    ----------
    rig : Slider or Machine
    tolerances : mapping of str to float or str
        By dotted name the largest deviation to either side: a number in SI units, text with a unit, or a share of the
        value such as ``"5 %"``.
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
    """
    name = "" if along is None and isinstance(rig, Machine) else name_along(rig, along)
    ranges = _ranges(rig, tolerances)
    from scipy.stats import qmc

    even = qmc.Sobol(len(ranges), scramble=True, rng=np.random.default_rng(0)).random_base2(LOG2_RIGS)
    varied = {name: low + (high - low) * even[:, i] for i, (name, (low, high)) in enumerate(ranges.items())}
    every = _outcomes(rig, varied, name)
    alone = [_alone(rig, one, low, high, name) for one, (low, high) in ranges.items()]
    alone.sort(key=lambda one: (one.stable is not None, -_spread(one)))
    return Tolerated(rig, tuple(alone), every.stable, every.exists, every.growth, name, every.edge, every.safety)


def _finite_range(values: Array) -> tuple[float, float] | None:
    """Least and largest of the finite values; None where there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if len(finite) else None


def _spread(one: Alone) -> float:
    low, high = one.growth if np.isnan(one.safety[0]) else one.safety
    return high - low if np.isfinite(high - low) else 0.0


def _alone(rig: Slider | Machine, name: str, low: float, high: float, along: str) -> Alone:
    found, nothing = _outcomes(rig, {name: np.linspace(low, high, VALUES_ALONE)}, along), (float("nan"),) * 2
    whole = bool(found.stable[0]) if np.all(found.stable == found.stable[0]) else None
    safety, growth = _finite_range(found.safety) or nothing, _finite_range(found.growth) or nothing
    return Alone(name, low, high, rig.parameters()[name].role.unit, safety, growth, whole, rig.area_of(name))


@dataclass(frozen=True)
class _Outcomes:
    """Verdicts on m rigs as arrays (m,): steady sliding exists, is stable, growth rate (1/s), edge, safety factor."""

    exists: Array
    stable: Array
    growth: Array
    edge: Array
    safety: Array


def _outcomes(rig: Slider | Machine, varied: Mapping[str, Array], along: str) -> _Outcomes:
    found = status(operating_point(rig, varied, present_zeros(rig)))
    growth = np.asarray(growth_rate(rig, varied), dtype=float)
    edge = safety = np.full(len(growth), np.nan)
    if along:
        edge = np.asarray(edge_along(rig, along, varied)[0], dtype=float)
        safety = np.asarray(safety_factor(rig, varied, along=along), dtype=float)
    return _Outcomes((found != ABSENT) & (found != UNKNOWN), found == STABLE, growth, edge, safety)


def _ranges(rig: Slider | Machine, tolerances: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    known = {name: one for name, one in rig.parameters().items() if one.value is not None}
    problems: list[Problem] = []
    found: dict[str, tuple[float, float]] = {}
    for given, tolerance in tolerances.items():
        try:
            name = resolve(given, known)
            half, value = _half_width(known[name], tolerance, rig.area_of(name)), float(known[name].value or 0.0)
            for end in (value - half, value + half):
                rig.with_values({name: end})
            found[name] = (value - half, value + half)
        except ParameterError as error:
            problems += error.problems if given in str(error) else [one.under(given) for one in error.problems]
    if not tolerances:
        problems.append(Problem("tolerances", "none given; name one at least, such as friction.a='5 %'"))
    if problems:
        raise ParameterError(problems)
    return found


def _half_width(one: Address, tolerance: Any, area: float | None) -> float:
    """Largest deviation of a parameter to either side, SI units, from a number, text with a unit or a percentage."""
    if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
        share = Parameter("1", positive, "tolerance in percent").checked(tolerance.rstrip()[:-1].strip())
        return 0.01 * share * abs(float(one.value or 0.0))
    role = Parameter(one.role.unit, positive, "tolerance")
    return role.read(tolerance, area) if isinstance(tolerance, str) else role.checked(tolerance)
