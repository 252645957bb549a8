"""How sure a verdict is where the numbers of a rig are known to within tolerances only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.quantities import percent, shown_range
from steadyslip.core.records import Address, resolve
from steadyslip.core.results import ReadOnly
from steadyslip.core.roles import Parameter, positive
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, status
from steadyslip.linear.stiffness import critical_stiffness, safety_factor
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point

Array = np.ndarray
POWER = 12  # of 2: how many rigs inside the tolerances are looked at
ALONE = 65  # values of a parameter that varies alone


@dataclass(frozen=True)
class Alone(Displayed):
    """What one parameter does within its tolerance, the others as they are.

    Attributes
    ----------
    parameter : str
    low, high : float
        Its range, SI units.
    safety : tuple of float
        Least and largest stiffness over critical stiffness; NaN where there is none.
    stable : bool or None
        Whether sliding is stable throughout the range; None if in a part of it only.
    """

    parameter: str
    low: float
    high: float
    unit: str
    safety: tuple[float, float]
    stable: bool | None
    area: float | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Tolerated(ReadOnly):
    """The verdicts on rigs within tolerances.

    Attributes
    ----------
    rig : Slider
    alone : tuple of Alone
        Each parameter by itself, the one that matters most first.
    stable : ndarray of bool (m,)
        Of rigs spread evenly over all ranges at once.
    exists : ndarray of bool (m,)
        Whether they slide steadily at all.
    critical_stiffness : ndarray (m,)
        Pa/m; NaN where there is no edge.
    safety : ndarray (m,)
        Stiffness over critical stiffness.
    """

    rig: Slider = field(repr=False)
    alone: tuple[Alone, ...]
    stable: Array = field(repr=False)
    exists: Array = field(repr=False)
    critical_stiffness: Array = field(repr=False)
    safety: Array = field(repr=False)

    @property
    def share(self) -> float:
        """Share of the rigs that slide steadily and stably."""
        return float(np.mean(self.stable))

    def __str__(self) -> str:
        count, share = len(self.stable), self.share
        whole = {1.0: f"Stable in all {count} rigs", 0.0: f"Stable in none of {count} rigs"}
        lines = [f"{whole.get(share, f'Stable in {percent(share)} of {count} rigs')} within the tolerances"]
        if not np.all(self.exists):
            lines.append(f"no steady sliding         in {percent(1 - float(np.mean(self.exists)))} of them")
        for words, values, unit in (
            ("critical stiffness", self.critical_stiffness, "Pa/m"),
            ("stiffness over critical", self.safety, "1"),
        ):
            known = values[np.isfinite(values)]
            if len(known):
                ends = shown_range(float(known.min()), float(known.max()), unit, self.rig.area)
                lines.append(f"{words:<26}{ends}")
        for one in self.alone:
            known = "" if np.isnan(one.safety[0]) else f", {one.safety[0]:.4g} to {one.safety[1]:.4g} times critical"
            word = {True: "stable", False: "unstable", None: "stable in a part of it"}[one.stable]
            ends = shown_range(one.low, one.high, one.unit, one.area)
            lines.append(f"{one.parameter:<26}{ends} alone: {word}{known}")
        return "\n".join(lines)

    def plot(self, ax: Any = None) -> Any:
        """Draw what each parameter does alone; see `steadyslip.figures.tolerances`."""
        return draw(self, ax=ax)


@checked()
def tolerate(rig: Slider, tolerances: Mapping[str, Any]) -> Tolerated:
    """The verdicts on all rigs whose parameters lie within tolerances.

    Parameters
    ----------
    rig : Slider
    tolerances : mapping of str to float or str
        By dotted name how far a value may be off to either side: a number in SI units, text with a unit, or a share of
        the value such as ``"5 %"``.

    Returns
    -------
    Tolerated

    Raises
    ------
    ParameterError
        If a name or a tolerance is not allowed, or leads out of what the rig can have.
    """
    ranges = _ranges(rig, tolerances)
    from scipy.stats import qmc

    even = qmc.Sobol(len(ranges), scramble=True, rng=np.random.default_rng(0)).random_base2(POWER)
    varied = {name: low + (high - low) * even[:, i] for i, (name, (low, high)) in enumerate(ranges.items())}
    exists, stable, critical, safety = _judged(rig, varied)
    alone = [_alone(rig, name, low, high) for name, (low, high) in ranges.items()]
    alone.sort(key=lambda one: (one.stable is not None, -_spread(one)))
    return Tolerated(rig, tuple(alone), stable, exists, critical, safety)


def _spread(one: Alone) -> float:
    return one.safety[1] - one.safety[0] if np.isfinite(one.safety[0]) else 0.0


def _alone(rig: Slider, name: str, low: float, high: float) -> Alone:
    _, stable, _, safety = _judged(rig, {name: np.linspace(low, high, ALONE)})
    known = safety[np.isfinite(safety)]
    ends = (float(known.min()), float(known.max())) if len(known) else (float("nan"),) * 2
    whole = bool(stable[0]) if np.all(stable == stable[0]) else None
    return Alone(name, low, high, rig.parameters()[name].role.unit, ends, whole, rig.area)


def _judged(rig: Slider, varied: Mapping[str, Array]) -> tuple[Array, Array, Array, Array]:
    """Whether rigs slide steadily, whether that is stable, critical stiffness, and stiffness over that."""
    found = status(operating_point(rig, varied, present_zeros(rig)))
    critical, safety = (np.asarray(ask(rig, varied), dtype=float) for ask in (critical_stiffness, safety_factor))
    return (found != ABSENT) & (found != UNKNOWN), found == STABLE, critical, safety


def _ranges(rig: Slider, tolerances: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    known = {name: one for name, one in rig.parameters().items() if one.value is not None}
    problems: list[Problem] = []
    found: dict[str, tuple[float, float]] = {}
    for given, tolerance in tolerances.items():
        try:
            name = resolve(given, known)
            half, value = _half(known[name], tolerance, rig.area), float(known[name].value or 0.0)
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


def _half(one: Address, tolerance: Any, area: float | None) -> float:
    """How far a value may be off."""
    if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
        share = Parameter("1", positive, "tolerance in percent").checked(tolerance.rstrip()[:-1].strip())
        return 0.01 * share * abs(float(one.value or 0.0))
    role = Parameter(one.role.unit, positive, "tolerance")
    return role.read(tolerance, area) if isinstance(tolerance, str) else role.checked(tolerance)
