"""Result of a least-squares fit of any rig: estimates with errors, residuals and information criteria."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Self

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.format import enumerated, format_quantity
from steadyslip.core.names import resolve
from steadyslip.core.options import checked, finite
from steadyslip.core.results import ReadOnly, read_only
from steadyslip.experiments.fitting.comparison import DataComparison, scaled_by_loss
from steadyslip.experiments.fitting.estimates import Combination, Estimate
from steadyslip.experiments.fitting.search import SearchSummary, jump_left
from steadyslip.experiments.fitting.unknowns import Space, Unknown
from steadyslip.experiments.numerics.noise import Noise, Whiteness, whiteness


@dataclass(frozen=True, eq=False)
class Fitted(ReadOnly):
    """Fit of a rig to records: its definition, the minimum that was found, and errors.

    Attributes
    ----------
    plan : Plan
        Rig, records and options of the fit.
    coordinates : ndarray (p,)
        Coordinates of the least sum of squares, in ``plan.space()``.
    ssq : float
        Sum of squared residuals, weighted and scaled by the loss.
    search : SearchSummary
    noise : tuple of Noise
        Autocorrelation of the residuals of every record.
    covariance : ndarray (p, p)
        Covariance of the coordinates; infinite for parameters that are not determined.
    unidentified : tuple of Combination
        Combinations of parameters that the records do not determine.
    bounds : tuple of two ndarray (p,)
        Lower and upper bounds of the search, in coordinates.
    version : str
        Version of steadyslip that made the fit.
    """

    plan: Any
    coordinates: Array = field(repr=False)
    ssq: float
    search: SearchSummary
    noise: tuple[Noise, ...] = field(repr=False)
    covariance: Array = field(repr=False)
    unidentified: tuple[Combination, ...]
    bounds: tuple[Array, Array] = field(repr=False)
    version: str = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Fields of the fit, for pickling; cached results are left out, as kernels cannot be copied."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @cached_property
    def space(self) -> Space:
        found: Space = self.plan.space()
        return found

    @cached_property
    def comparison(self) -> DataComparison:
        found: DataComparison = self.plan.comparison()
        return found

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
        """Confidence interval of a parameter in SI units; for a positive parameter symmetric in its logarithm.

        Parameters
        ----------
        name : str
        level : float
            Probability, such as 0.95.
        """
        i = self.index(name)
        reach = self._reach(level) * float(np.sqrt(self.covariance[i, i]))
        one = self.space.unknowns[i]
        if not np.isfinite(reach):
            return one.low, one.high
        low, high = (float(one.value(self.coordinates[i] + sign * reach)) for sign in (-1, 1))
        return max(low, one.low), min(high, one.high)

    def check_ended(self) -> None:
        """Check that the search has reached a minimum, without which errors are unknown.

        Raises
        ------
        NotAvailable
            If the search was stopped before it reached a minimum, or too few of its starts lead to the minimum.
        """
        if not self.search.converged:
            raise NotAvailable(
                "the search of this fit was stopped before it ended, or too few of its starts lead to its minimum, so "
                "that its errors are unknown; let it search longer (effort, starts), or fit another model"
            )

    def _reach(self, level: float) -> float:
        """Number of standard deviations from an estimate to an end of its interval."""
        from scipy.stats import t

        if not 0 < level < 1:
            raise ParameterError([Problem("level", f"got {level!r}; allowed: a number between 0 and 1")])
        return float(t.ppf(0.5 + 0.5 * level, max(self.degrees, 1)))

    def index(self, name: str) -> int:
        """Index of a parameter; leading parts of its name may be left out."""
        try:
            return self.names.index(resolve(name, dict.fromkeys(self.names)))
        except UnknownNameError:
            raise UnknownNameError("fitted parameter", name, self.names) from None

    def __getitem__(self, name: str) -> Estimate:
        """Estimate of a parameter."""
        i = self.index(name)
        full = self.names[i]
        low, high = self.interval(full)
        unit, area, error = self.space.unknowns[i].unit, self.plan.rig.area, self.errors[full]
        together = [one.weights for one in self.unidentified if full in one.weights and not np.isfinite(error)]
        along = tuple(dict.fromkeys(other for one in together for other in one if other != full))
        return Estimate(full, self.values[full], error, unit, low, high, area, along, self.search.converged)

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """All fitted parameters with their errors."""
        return tuple(self[name] for name in self.names)

    @cached_property
    def whiteness(self) -> Whiteness:
        """Test of the residuals for structure beyond white noise and noise with exponentially decaying correlation."""
        return whiteness(self.scaled_residuals[where] for where in self.comparison.slices)

    @cached_property
    def jump(self) -> float:
        """Largest jump of the residuals in standard deviations of their noise; 0 if no jump is larger than noise."""
        return jump_left(self.comparison, self.scaled_residuals)

    @property
    def samples(self) -> int:
        return self.comparison.size

    @property
    def degrees(self) -> int:
        """Degrees of freedom: number of samples minus number of parameters."""
        return self.samples - len(self.space)

    @cached_property
    def model(self) -> Array:
        """Prediction (n,) of the fitted model, trends included, at all samples: friction, or columns of a machine."""
        return np.asarray(read_only(self.comparison.model(self.coordinates[None])[0][0]))

    @property
    def residuals(self) -> Array:
        """Residuals (n,): measured values minus the prediction of the model."""
        return np.asarray(read_only(self.comparison.data - self.model))

    @property
    def scaled_residuals(self) -> Array:
        """Residuals (n,) weighted and scaled by the loss; the sum of their squares is minimised."""
        r = self.residuals * self.comparison.weights
        return r if self.plan.loss == "linear" else scaled_by_loss(self.plan.loss, r, self.comparison.width)[0]

    def part(self, values: Array, record: int = 0) -> Array:
        """Slice of `values` that belongs to one record; `values` (n,) covers the samples of all records."""
        return values[self.comparison.slices[record]]

    @property
    def correlated(self) -> bool:
        """True if the errors allow for correlated residuals."""
        return any(noise.correlated for noise in self.noise)

    @cached_property
    def correlation(self) -> Array:
        """Correlation matrix (p, p) of the estimates; NaN for parameters that are not determined."""
        with np.errstate(all="ignore"):
            size = np.sqrt(np.diag(self.covariance))
            found: Array = self.covariance / np.outer(size, size)
        found[~np.isfinite(found)] = np.nan
        return np.asarray(read_only(found))

    @property
    def aic(self) -> float:
        """Akaike's information criterion with this fit's noise model (`compare_laws` uses one noise model for all)."""
        return self.criteria(self.noise)[0]

    @property
    def bic(self) -> float:
        """Schwarz's (Bayesian) information criterion, with this fit's noise model (see `aic`)."""
        return self.criteria(self.noise)[1]

    def criteria(self, noise: Sequence[Noise]) -> tuple[float, float]:
        """AIC and BIC, with the number of independent samples from a noise model of each record."""
        deviance = independent = 0.0
        for i, one in enumerate(noise):
            weights = self.part(self.comparison.weights, i)
            r = self.part(self.residuals, i) * weights
            worth = len(r) / max(one.inflation, 1.0)
            unit = np.mean(np.log(weights[weights > 0]))  # scale of the weights, which may differ between fits
            deviance += worth * float(np.log(np.mean(r**2)) - 2 * unit)
            independent += worth
        size = len(self.space)
        return deviance + 2 * size, deviance + size * float(np.log(max(independent, 2.0)))

    def with_open(self, covariance: Array, near: Array) -> Self:
        """Fit with errors of derived quantities that are determined although their parameters are not.

        Only fits of sliders have derived quantities; other fits are returned unchanged.

        Parameters
        ----------
        covariance : ndarray (p, p)
            Covariance of the coordinates, finite also for coordinates that are not determined.
        near : ndarray (m, p)
            Coordinates of other points that fit as well.
        """
        return self

    def with_memories(self) -> Self:
        """Fit in which parameters are undetermined if adding a memory of normal stress changes them but not the misfit.

        Only fits of sliders are changed; other fits are returned unchanged.
        """
        return self

    @cached_property
    def at_bounds(self) -> tuple[str, ...]:
        """Sentences on parameters that ended at a bound of the search; parameters with one explanation share one."""
        low, high = self.bounds
        found: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for i, one in enumerate(self.space.unknowns):
            if self._between_samples(one) or not self._beyond(i):
                continue
            for bound, word in ((low[i], "smallest"), (high[i], "largest")):
                if np.isfinite(bound) and abs(self.coordinates[i] - bound) < 1e-9 * (1 + abs(bound)):
                    value, area = float(one.value(bound)), self.plan.rig.area
                    end = f"{value:.7g} s" if one.unit == "s" else format_quantity(value, one.unit, area=area)
                    why = self._beyond_window(one, "earlier" if bound == low[i] else "later")
                    found.setdefault((word, why or one.name), []).append((one.name, end))
        said = []
        for (word, why), own in found.items():
            names, ends = (enumerated(list(column)) for column in zip(*own, strict=True))
            values = "value that was" if len(own) == 1 else "values that were"
            said.append(f"{names} ended at the {word} {values} searched, {ends}{'' if why == own[0][0] else why}")
        return tuple(said)

    def _beyond(self, which: int) -> bool:
        """True if the data would move an unknown beyond its bound by more than noise explains."""
        return True

    def _between_samples(self, one: Unknown) -> bool:
        """True for a time between two neighbouring samples, which may end at a bound without a fault of the fit."""
        return False

    def _beyond_window(self, one: Unknown, when: str) -> str:
        """Explanation, for the user, of an unknown that ended at a bound; empty if there is none."""
        return ""
