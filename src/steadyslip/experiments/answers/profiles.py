"""Likelihood profiles: least sum of squares with one parameter fixed at each of several values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.core.options import NAME, THREADS, checked, finite, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.fitting.at_minimum import spread_of_gradient
from steadyslip.experiments.fitting.condensed import condensed
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.numerics.least_squares import minimise

LEVEL = 0.95  # probability of the intervals from a profile and from the error of the fit that are compared
END_TOLERANCE = 0.15
"""Largest difference between the ends of these two intervals of a Gaussian profile, over half the width."""


@dataclass(frozen=True, eq=False)
class Profile(ReadOnly):
    """Likelihood profile of one parameter: least sum of squares at each of its values.

    Attributes
    ----------
    name : str
    unit : str
    values : ndarray (m,)
        Values of the parameter, SI units.
    ssq : ndarray (m,)
        Least sums of squares.
    rise : ndarray (m,)
        Minus twice the logarithm of the profile likelihood, zero at the best value; 1 at one standard deviation.
    normal : ndarray (m,)
        Rise for a normal distribution with the fit's error; NaN if the fit does not determine the parameter.
    area : float or None
        Contact area of the rig, m²; if given, text shows totals for the whole contact.
    """

    name: str
    unit: str
    values: Array
    ssq: Array = field(repr=False)
    rise: Array
    normal: Array = field(repr=False)
    area: float | None = None

    def interval(self, level: float = LEVEL) -> tuple[float, float]:
        """Confidence interval of probability `level`, SI units; an end beyond the profile is infinite."""
        low, high = self._ends(self.rise, level)
        return low, high

    @property
    def gaussian(self) -> bool:
        """True if the 95 % interval from the profile nearly equals the interval from the error of the fit."""
        if not np.all(np.isfinite(self.normal)):
            return False
        own, usual = np.array(self._ends(self.rise, LEVEL)), np.array(self._ends(self.normal, LEVEL))
        best = float(self.values[int(np.argmin(self.normal))])
        both = np.isfinite(own)
        return bool(np.all(both == np.isfinite(usual)) and
                    np.all(np.abs(own[both] - usual[both]) <= END_TOLERANCE * np.abs(usual[both] - best)))  # fmt: skip

    def _ends(self, rise: Array, level: float) -> tuple[float, float]:
        limit = float(chi2.ppf(level, 1))
        best = int(np.argmin(rise))
        ends = []
        for side in (slice(best, None, -1), slice(best, None, 1)):
            own, values = rise[side], self.values[side]
            beyond = np.flatnonzero(own > limit)
            if not len(beyond):
                ends.append(-np.inf if side.step == -1 else np.inf)
                continue
            i = int(beyond[0])
            share = (limit - own[i - 1]) / (own[i] - own[i - 1]) if i else 0.0
            ends.append(float(values[i - 1] + share * (values[i] - values[i - 1])) if i else float(values[0]))
        return ends[0], ends[1]

    def __str__(self) -> str:
        text = f"{self.name}, 95 % by its profile: {self._interval_text(self.rise)}"
        if self.gaussian:
            return text
        if not np.all(np.isfinite(self.normal)):
            return f"{text}; not Gaussian, and not determined"
        return f"{text}; not Gaussian, its standard error would give {self._interval_text(self.normal)}"

    def _interval_text(self, rise: Array) -> str:
        ends = self._ends(rise, LEVEL)
        return " to ".join(
            "beyond the profile" if not np.isfinite(x) else format_quantity(x, self.unit, area=self.area) for x in ends
        )

    def plot(self, ax: Any = None) -> Any:
        """Plot the profile with its intervals, and the parabola of the fit's error.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return draw(self, ax=ax)


@checked(reach=finite(0, 1e6), count=whole(2, 10**5), threads=THREADS, name=NAME)
def profile(fit: Fit, name: str, *, reach: float = 4.0, count: int = 33, threads: int | None = None) -> Profile:
    """Likelihood profile of a parameter: at each of its values, all other parameters are fitted again.

    Parameters
    ----------
    fit : Fit
    name : str
    reach : float
        Range on both sides of the estimate in standard deviations. If the fit does not determine the parameter, the
        range is a factor exp(2), or for a parameter that may be negative two typical sizes (0.01 for b).
    count : int
        Number of values.
    threads : int, optional
        Number of threads; all cores unless given.

    Raises
    ------
    NotAvailable
        If the search of the fit was stopped before it ended.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> ss.experiments.profile(fit, "friction.a", count=3).values.round(4)
    array([0.0116, 0.0119, 0.0123])
    """
    fit.check_ended()
    i = fit.index(name)
    variance = float(fit.covariance[i, i])
    width = np.sqrt(variance) * reach if np.isfinite(variance) else 2.0
    z = np.tile(fit.coordinates, (count, 1))
    z[:, i] = fit.coordinates[i] + width * np.linspace(-1, 1, count)
    if np.isfinite(variance):  # the covariance predicts the other coordinates at each value: start there
        slope = fit.covariance[:, i] / variance
        slope[~np.isfinite(slope)] = 0.0
        z = fit.coordinates + (z[:, i : i + 1] - fit.coordinates[i]) * slope
    low, high = fit.bounds
    z = np.clip(z, low, high)
    held = np.zeros_like(z, dtype=bool)
    held[:, i] = True
    few = condensed(fit.plan, fit.plan.comparison(Effort(threads)), np.stack([fit.coordinates, z[0], z[-1]]))
    found = minimise(lambda x, _: few.residuals(x), z, low, high, held=held)
    least = float(np.sum(few.residuals(fit.coordinates[None])[0] ** 2))
    rise = (found.ssq - least) / _unit_of_rise(fit, i)
    keep = np.isfinite(found.ssq)
    order = np.argsort(z[keep, i])
    one = fit.space.unknowns[i]
    values = one.value(z[keep, i][order])
    away = z[keep, i][order] - fit.coordinates[i]
    normal = away**2 / variance if np.isfinite(variance) else np.full(len(away), np.nan)
    return Profile(one.name, one.unit, values, found.ssq[keep][order], rise[keep][order], normal, fit.plan.rig.area)


def _unit_of_rise(fit: Fit, i: int) -> float:
    """Rise of the sum of squares one standard deviation of parameter i from the minimum; its error has all causes."""
    _, jacobian = fit.comparison.residuals(fit.coordinates[None])
    rows = jacobian[0]
    inverse = np.linalg.pinv(rows @ rows.T, rcond=1e-13, hermitian=True)
    spread = spread_of_gradient(fit.plan, fit.comparison, fit.coordinates, rows, fit.noise)
    naive, variance = float(inverse[i, i]), float((inverse @ spread @ inverse)[i, i])
    return variance / naive if np.isfinite(fit.covariance[i, i]) and naive > 0 else fit.ssq / max(fit.degrees, 1)
