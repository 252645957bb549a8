"""Text and data common to all fits: quality of the fit, errors, and warnings."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.areas import total
from steadyslip.core.checks import as_data
from steadyslip.core.version import of_another
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.residuals import residual_checks
from steadyslip.experiments.fitting.search import MIN_ARRIVED
from steadyslip.experiments.numerics.noise import STRUCTURE

WIDTH = 100  # largest number of characters in a line of text
LEAST_CHANCE = 1e-99  # smaller probabilities are printed as "below 1e-99"


def quality(fit: Fitted) -> list[str]:
    """Lines of text on the whiteness of the residuals, on the errors, and on the search for the minimum."""
    search = fit.search
    independent = "residuals taken as correlated" if fit.correlated else "residuals taken as independent"
    reached = f"{search.arrived} of {search.starts} starts lead here"
    enough = min(MIN_ARRIVED, search.starts)
    reached += (
        f", {enough} are enough" if not search.is_chance
        else f", fewer than {enough}: there may be a better minimum, search with more (starts)"
    )  # fmt: skip
    if search.others:
        minima = "minima" if len(search.others) > 1 else "minimum"
        reached += f"; {len(search.others)} other {minima}, the next {search.others[0]:.4g} times as bad"
    return [
        f"whiteness       {_whiteness(fit)}",
        f"errors          one standard deviation, {independent}",
        f"minimum         {reached}",
    ]


def _whiteness(fit: Fitted) -> str:
    one = fit.whiteness
    if fit.jump:
        return f"structure is left: residuals jump by {fit.jump:.0f} standard deviations of their noise"
    verdict = "structure is left" if one.p < STRUCTURE else "noise is left"
    return f"{verdict}: Ljung-Box {one.statistic:.4g} where noise has {one.degrees}, probability {chance(one.p)}"


def chance(p: float) -> str:
    """Probability as text."""
    return f"{p:.2g}" if p > LEAST_CHANCE else f"below {LEAST_CHANCE:g}"


def fitted_warnings(fit: Fitted) -> list[str]:
    """Warnings on undetermined parameters and on the search for the minimum, each a sentence."""
    found = [str(one) for one in fit.unidentified] if fit.search.converged else []
    if fit.jump:
        found.append(
            f"residuals jump by {fit.jump:.0f} standard deviations of their noise, as where a sudden slip of a record "
            "is not followed, or the model slips where the record does not: the numbers have no errors; search with "
            "more (starts), with a trend if friction drifts (trend), or leave out what is beyond that slip (between), "
            "in which a machine's mass plays its part"
        )
    elif fit.search.cut:
        found.append(_cut_off(fit))
    elif not fit.search.converged and fit.search.is_chance:
        found.append(
            f"{fit.search.arrived} of {fit.search.starts} starts lead to this minimum, and structure is left in the "
            "residuals: there may be a better minimum, so that the numbers have no errors; search with more (starts), "
            "or fit another model"
        )
    elif not fit.search.converged:
        found.append(
            "the search was stopped before it ended: the numbers are rough and have no errors; hold what is known "
            "(fixed), or give it more work (effort) or other starts (starts)"
        )
    close = [ratio for ratio in fit.search.others if ratio < 1.05]
    if close:
        found.append(
            f"another minimum is nearly as good ({close[0]:.4g} times the sum of squares): other values follow the "
            "records nearly as well; give (fix) what is known, or fit a record with more changes along"
        )
    return found + (list(fit.at_bounds) if fit.search.converged else [])


def _cut_off(fit: Fitted) -> str:
    """Warning that the search reached its limit of work, which happens if the model cannot follow the records well."""
    rough = "" if fit.search.converged else " (not even at a minimum, so that there are no errors)"
    return (
        f"the search ended at its limit of work; this is the best fit found{rough}, and there may be a better one; "
        "most often the model does not suit the experiment; otherwise let it search longer (effort)"
    )


def version_warnings(fit: Fitted) -> list[str]:
    """Warning on a fit that was made by another version of steadyslip."""
    other = of_another(fit.version)
    return [f"{other}; fit again to compare with fits of this version"] if other else []


def estimate_dict(one: Estimate) -> dict[str, Any]:
    """Data of an estimate for JSON; None for numbers that do not exist."""
    return {
        "value": one.value,
        "error": one.error if one.determined else None,
        "low": one.low if np.isfinite(one.low) and one.determined else None,
        "high": one.high if np.isfinite(one.high) and one.determined else None,
        "unit": one.unit,
        "determined": one.determined,
    } | total(one.value, one.unit, one.area)


def fitted_dict(fit: Fitted) -> dict[str, Any]:
    """Data of a fit for JSON, in SI units; None for numbers that do not exist."""
    return {
        "version": fit.version,
        "records": [record.source for record in fit.plan.records],
        "samples": fit.samples,
        "parameters": {one.name: estimate_dict(one) for one in fit.estimates},
        "correlation": [[float(x) if np.isfinite(x) else None for x in row] for row in fit.correlation],
        "ssq": fit.ssq,
        "lag1": [noise.lag1 for noise in fit.noise],
        "whiteness": vars(fit.whiteness) | {"p": fit.whiteness.p},
        "correlated": fit.correlated,
        "aic": fit.aic,
        "bic": fit.bic,
        "search": {
            "starts": fit.search.starts,
            "arrived": fit.search.arrived,
            "other_minima": list(fit.search.others),
            "iterations": fit.search.iterations,
            "converged": fit.search.converged,
            "cut": fit.search.cut,
        },
        "unidentified": [
            {"weights": one.weights, "deviation": one.deviation if np.isfinite(one.deviation) else None}
            for one in fit.unidentified
        ],
        **as_data(residual_checks(fit)),
    }
