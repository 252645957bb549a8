"""A fit: what was found, how sure that is, and what it was found from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem, UnknownNameError
from steadyslip.core.format import format_quantity, format_range, format_with_error
from steadyslip.core.names import resolve
from steadyslip.core.options import checked, finite
from steadyslip.core.pages import Displayed
from steadyslip.core.results import ReadOnly, read_only
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.identify import Combination
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.refit import (
    Ramped,
    Remembered,
    driven_as_measured,
    with_memories,
    with_ramps,
)
from steadyslip.experiments.fitting.search import SearchSummary
from steadyslip.experiments.fitting.unknowns import Space, Unknown
from steadyslip.experiments.numerics.noise import SIGNIFICANT, Noise
from steadyslip.machine.slider import Slider


@dataclass(frozen=True)
class Estimate(Displayed):
    """One fitted parameter.

    Attributes
    ----------
    name : str
        Dotted name; ``@2`` behind it where it belongs to the second record alone.
    value, error : float
        SI units; the error is one standard deviation, inf where the records do not determine the parameter.
    unit : str
    low, high : float
        Ends of the 95 % interval.
    area : float or None
        Of the rig, m²: people are told totals then.
    """

    name: str
    value: float
    error: float
    unit: str
    low: float
    high: float
    area: float | None = None

    @property
    def determined(self) -> bool:
        return bool(np.isfinite(self.error))

    def __str__(self) -> str:
        return f"{self.name} = {self.shown()}"

    def shown(self) -> str:
        """Value and error for people."""
        if self.unit == "s":  # times are those of the record's clock
            return (
                f"{self.value:.7g} ± {self.error:.2g} s" if self.determined else f"{self.value:.7g} s (not determined)"
            )
        if not self.determined:
            return f"{format_quantity(self.value, self.unit, area=self.area)} (not determined)"
        return format_with_error(self.value, self.error, self.unit, self.area)

    def range(self) -> str:
        """The 95 % interval for people."""
        if self.unit == "s":
            return f"{self.low:.7g} to {self.high:.7g} s"
        return format_range(self.low, self.high, self.unit, self.area)


@dataclass(frozen=True, eq=False)
class FitNumbers(ReadOnly):
    """A rig fitted to records.

    Attributes
    ----------
    plan : Plan
        What was compared.
    coordinates : ndarray (p,)
        Where the sum of squares is least, in the coordinates of ``plan.space()``.
    ssq : float
        Sum of squared residuals (weighted, or as the loss has them).
    search : SearchSummary
    noise : tuple of Noise
        Of the residuals of every record.
    covariance : ndarray (p, p)
        Of the coordinates; infinite where a parameter is not determined.
    unidentified : tuple of Combination
        What the records cannot tell.
    bounds : tuple of two ndarray (p,)
        Where the coordinates were searched.
    version : str
    """

    plan: Plan
    coordinates: Array = field(repr=False)
    ssq: float
    search: SearchSummary
    noise: tuple[Noise, ...] = field(repr=False)
    covariance: Array = field(repr=False)
    unidentified: tuple[Combination, ...]
    bounds: tuple[Array, Array] = field(repr=False)
    version: str = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """What makes the fit, without what was derived from it: kernels cannot be copied, nor need they be."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @cached_property
    def space(self) -> Space:
        return self.plan.space()

    @cached_property
    def comparison(self) -> Comparison:
        return self.plan.comparison()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return tuple(one.name for one in self.space.unknowns)

    @cached_property
    def values(self) -> dict[str, float]:
        """Fitted values, SI units."""
        return {n: float(v) for n, v in zip(self.names, self.space.values(self.coordinates), strict=True)}

    @cached_property
    def errors(self) -> dict[str, float]:
        """Standard deviations, SI units."""
        deviation = np.sqrt(np.diag(self.covariance)) * self.space.slopes(self.coordinates)
        return {name: float(error) for name, error in zip(self.names, deviation, strict=True)}

    @checked(level=finite(0, 1))
    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Interval of a parameter; of a positive one symmetric in its logarithm.

        Parameters
        ----------
        name : str
        level : float
            Probability, such as 0.95.
        """
        from scipy.stats import t

        if not 0 < level < 1:
            raise ParameterError([Problem("level", f"got {level!r}; allowed: a number between 0 and 1")])
        i = self.index(name)
        reach = float(t.ppf(0.5 + 0.5 * level, max(self.degrees, 1))) * float(np.sqrt(self.covariance[i, i]))
        one = self.space.unknowns[i]
        if not np.isfinite(reach):
            return one.low, one.high
        low, high = (float(one.value(self.coordinates[i] + sign * reach)) for sign in (-1, 1))
        return max(low, one.low), min(high, one.high)

    def index(self, name: str) -> int:
        """Place of a parameter, which may leave out leading parts of its name."""
        try:
            return self.names.index(resolve(name, dict.fromkeys(self.names)))
        except UnknownNameError:
            raise UnknownNameError("fitted parameter", name, self.names) from None

    def __getitem__(self, name: str) -> Estimate:
        i = self.index(name)
        full = self.names[i]
        low, high = self.interval(full)
        unit, area = self.space.unknowns[i].unit, self.plan.rig.area
        return Estimate(full, self.values[full], self.errors[full], unit, low, high, area)

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every fitted parameter with its error."""
        return tuple(self[name] for name in self.names)

    @cached_property
    def as_measured(self) -> dict[str, float] | None:
        """Values that the displacement and normal stress as measured, instead of the commanded ones, would lead to.

        None where the model does not follow commanded loading, or the columns have no noise to speak of.
        """
        return driven_as_measured(self.plan, self.values, self._ends)

    @cached_property
    def as_ramps(self) -> tuple[Ramped, ...]:
        """What would come of it if steps of the rate that the displacement cannot tell from ramps were ramps."""
        return with_ramps(self.plan, self.values, self._ends)

    @cached_property
    def with_memories(self) -> tuple[Remembered, ...]:
        """Fits with memories of the normal stress, the best first, where it changes and the law has none.

        None are tried if the residuals are white, which speaks for no memory.
        """
        return with_memories(self.plan) if self.has_structure else ()

    @property
    def has_structure(self) -> bool:
        """True if residuals of a record are correlated from sample to sample."""
        pairs = zip(self.noise, self.plan.records, strict=True)
        return any(abs(noise.lag1) > SIGNIFICANT / np.sqrt(len(record)) for noise, record in pairs)

    @property
    def _ends(self) -> dict[str, tuple[float, float]]:
        """Where the coordinates were find_minimum, by name."""
        return dict(zip(self.names, zip(*self.bounds, strict=True), strict=True))

    @cached_property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters that ran to the end of what was find_minimum, each in a sentence."""
        low, high = self.bounds
        found = []
        for i, one in enumerate(self.space.unknowns):
            if one.parameter.startswith("jump.") or self._within_interval(one):  # bounded by samples on both sides
                continue
            for bound, word in ((low[i], "smallest"), (high[i], "largest")):
                if np.isfinite(bound) and abs(self.coordinates[i] - bound) < 1e-9 * (1 + abs(bound)):
                    value = float(one.value(bound))
                    end = (
                        f"{value:.7g} s"
                        if one.unit == "s"
                        else format_quantity(value, one.unit, area=self.plan.rig.area)
                    )
                    text = f"{one.name} ended at the {word} value that was find_minimum, {end}"
                    found.append(text + self._beyond_window(one, "earlier" if bound == low[i] else "later"))
        return tuple(found)

    def _beyond_window(self, one: Unknown, when: str) -> str:
        """What it means that friction would have a change at a time that the columns exclude."""
        if not (self.plan.follows and one.parameter.startswith("step.") and one.parameter.endswith(".at")):
            return ""
        return (
            f": friction would have the change {when} than the record's other columns allow; the model does not follow "
            "friction around it (another law, two states, a ramp), or friction was not sampled at the same times"
        )

    def _within_interval(self, one: Unknown) -> bool:
        """Whether an unknown is the time of a step that lies between two samples."""
        time = self.plan.records[one.record or 0].time
        return one.parameter.startswith("step.") and one.high - one.low < 1.01 * float(np.max(np.diff(time)))

    @property
    def samples(self) -> int:
        return self.comparison.size

    @property
    def degrees(self) -> int:
        """Samples less parameters."""
        return self.samples - len(self.space)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @cached_property
    def model(self) -> Array:
        """Friction of the fitted model, trend included, at all samples."""
        return np.asarray(read_only(self.comparison.model(self.coordinates[None])[0][0]))

    @property
    def residuals(self) -> Array:
        """Data less model."""
        return np.asarray(read_only(self.comparison.data - self.model))

    def part(self, values: Array, record: int = 0) -> Array:
        """Those of `values` at all samples that belong to one record."""
        return values[self.comparison.slices[record]]

    @property
    def correlated(self) -> bool:
        """Whether errors take residuals as correlated from sample to sample."""
        return any(noise.correlated for noise in self.noise)

    @cached_property
    def correlation(self) -> Array:
        """Correlation of the estimates; NaN where one is not determined."""
        with np.errstate(all="ignore"):
            size = np.sqrt(np.diag(self.covariance))
            found: Array = self.covariance / np.outer(size, size)
        found[~np.isfinite(found)] = np.nan
        return np.asarray(read_only(found))

    def rig(self, record: int = 0) -> Slider:
        """The rig with fitted values, driven as a record drives it."""
        driven = self.comparison.parts[record].rig
        own = {
            one.parameter: self.values[one.name]
            for one in self.space.unknowns
            if one.record in (None, record) and one.parameter in driven.parameters()
        }
        return driven.with_values(own)

    @property
    def aic(self) -> float:
        """Akaike's criterion; of fits to the same records the one with less is to be preferred."""
        return self.criteria(self.noise)[0]

    @property
    def bic(self) -> float:
        """Schwarz's criterion."""
        return self.criteria(self.noise)[1]

    def criteria(self, noise: Sequence[Noise]) -> tuple[float, float]:
        """AIC and BIC, counting as many samples as are independent with a given noise."""
        deviance = independent = 0.0
        for i, one in enumerate(noise):
            r = self.part(self.residuals * self.comparison.weights, i)
            worth = len(r) / max(one.inflation, 1.0)
            deviance += worth * float(np.log(np.mean(r**2)))
            independent += worth
        size = len(self.space)
        return deviance + 2 * size, deviance + size * float(np.log(max(independent, 2.0)))
