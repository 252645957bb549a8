"""Test of residuals for structure: are they white noise plus noise that decays exponentially, the same throughout?"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.numerics.noise import LAGS, first_order, portmanteau


@dataclass(frozen=True)
class Whiteness:
    """Result of the test of one record or several.

    Attributes
    ----------
    statistic : float
        Ljung and Box's (1978) Q of the residuals, less what white noise plus a first-order autoregression explains,
        and McLeod and Li's (1983) of their squares, added up: the latter sees misfit that gathers at some times.
    degrees : int
        Of freedom of its chi-squared distribution, which is also its mean if there is no structure.
    """

    statistic: float
    degrees: int

    @property
    def p(self) -> float:
        """Probability that noise alone makes the statistic as large."""
        from scipy.stats import chi2

        return float(chi2.sf(self.statistic, self.degrees)) if self.degrees else 1.0


def whiteness(residuals: Iterable[Array]) -> Whiteness:
    """Test the residuals (n,) of each record."""
    statistic, degrees = 0.0, 0
    for own in residuals:
        lags = min(LAGS, len(own) // 10)
        if lags > 1 and np.ptp(own) > 0:
            left = min((own, first_order(own).innovations), key=lambda one: portmanteau(one, lags))
            statistic += portmanteau(left, lags) + portmanteau(left**2, lags)
            degrees += 2 * lags - 2  # two coefficients were fitted
    return Whiteness(statistic, degrees)
