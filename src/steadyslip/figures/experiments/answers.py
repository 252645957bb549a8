"""Figures of results from fits: likelihood profiles, comparison of laws, ranking of experiments, predictions."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from scipy.stats import chi2

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.core.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from steadyslip.experiments.answers.predict import probability_text
from steadyslip.figures.experiments.panels import panel_grid
from steadyslip.figures.style import axes_or_new, axis_label, display_unit, with_subscripts
from steadyslip.machine.letters import estimate_label
from steadyslip.nonlinear.kicks.kicks import KICKS

if TYPE_CHECKING:
    from steadyslip.experiments import LawComparison, Prediction, Profile
    from steadyslip.experiments.answers.precision import Ranking

MAX_AXIS_DISTANCE = 10.0  # a rig farther from the draws' 95 % range than this many widths of it is not drawn (by trial)


def profile(result: Profile, ax: Axes | None = None) -> Axes:
    """Plot the rise of the misfit away from the best value of a parameter, and the resulting 68 and 95 % intervals.

    Grey: parabola of a Gaussian likelihood with the error of the fit; the likelihood is not Gaussian where it differs.

    Parameters
    ----------
    result : Profile
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> axes = ss.figures.profile(ss.experiments.profile(fit, "friction.a", count=3))
    >>> axes.figure.savefig("profile.svg")
    """
    ax = axes_or_new(ax)
    factor, unit = display_unit(result.unit, float(np.median(np.abs(result.values))), result.area)
    ax.plot(result.values / factor, result.rise, color=BLUE, marker=".", label="all other parameters fitted anew")
    if np.all(np.isfinite(result.normal)):
        ax.plot(result.values / factor, result.normal, color=GREY, linestyle=":", linewidth=2, label="its error alone")
    top = float(np.max(result.rise[np.isfinite(result.rise)], initial=0.0))
    for level, style in ((0.68, "-"), (0.95, "--")):
        limit = float(chi2.ppf(level, 1))
        top = max(top, 1.2 * limit)
        ends = np.array(result.interval(level)) / factor
        ax.axhline(limit, color=GREY, linewidth=0.8)
        for end in ends[np.isfinite(ends)]:
            ax.axvline(end, color=VERMILION, linewidth=1, linestyle=style)
        ax.plot([], [], color=VERMILION, linestyle=style, label=f"{100 * level:.0f} %")
    ax.set_ylim(0.0, min(top, 12.0))
    ax.set_xlabel(axis_label(with_subscripts(estimate_label(result.name)), unit))
    ax.set_ylabel("rise of the misfit, −2 ln of the profile likelihood (1)")
    cut = "" if np.all(np.isfinite(result.interval(0.95))) else "; the profile ends before 95 %"
    ax.set_title(f"likelihood: {'Gaussian' if result.gaussian else 'not Gaussian'}{cut}", fontsize="medium")
    ax.legend(loc="upper center", fontsize="small")
    return ax


def comparison(result: LawComparison, ax: Axes | None = None) -> Axes:
    """Plot AIC and BIC of each law, minus the smallest of all laws.

    Parameters
    ----------
    result : LawComparison
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> axes = ss.figures.comparison(ss.experiments.compare({"slip": fit, "the same": fit}))
    >>> axes.figure.savefig("comparison.svg")
    """
    ax = axes_or_new(ax)
    labels = list(result.fits)[::-1]
    place = np.arange(len(labels))
    for k, (name, colour) in enumerate((("AIC", BLUE), ("BIC", ORANGE))):
        values = np.array([result.criteria[label][k] for label in labels])
        ax.barh(place + 0.2 - 0.4 * k, values - values.min(), 0.38, color=colour, label=name)
    for y, label in zip(place, labels, strict=True):
        text = f"{len(result.fits[label].space)} parameters, weight {_format_weight(result.weights[label])}"
        ax.annotate(text, (1.0, y), (4, 0), ("axes fraction", "data"), "offset points", va="center", fontsize="small")
    ax.set_yticks(place, labels)
    ax.set_xlabel("criterion above that of the best (1)")
    ax.legend(loc="best", fontsize="small")
    return ax


def _format_weight(share: float) -> str:
    """Format a weight (0 to 1) in percent, never rounded to 0 or 100 %."""
    return "< 0.1 %" if share < 0.001 else "> 99.9 %" if share > 0.999 else format_percent(round(share, 3))


def ranking(result: Ranking, ax: Axes | None = None) -> Axes:
    """Plot the expected error of one parameter for each planned experiment.

    Parameters
    ----------
    result : Ranking
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> values = {"a": 0.012, "b": 0.015, "d_c": "10 um", "mu_ref": 0.6, "stiffness": "30 GPa/m"}
    >>> rig = ss.lab_rig("slip", velocity="1 um/s").with_values(values)
    >>> step = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=20, to="2 um/s"),), until=100)
    >>> ranking = ss.experiments.best_protocol(rig, {"a step": step}, "friction.d_c")
    >>> axes = ss.figures.ranking(ranking)
    >>> axes.figure.savefig("ranking.svg")
    """
    ax = axes_or_new(ax)
    labels = list(result.found)[::-1]
    first = result.found[result.best]
    errors = np.array([result.found[label].errors[result.parameter] for label in labels])
    known = np.isfinite(errors)
    if not np.any(known):
        raise NotAvailable(f"none of the experiments determines {result.parameter}")
    si = first.units[result.parameter]
    factor, unit = display_unit(si, float(np.min(errors[known])), first.area)
    place = np.arange(len(labels))
    ax.barh(place[known], errors[known] / factor, color=BLUE)
    if np.max(errors[known]) > 20 * np.min(errors[known]):
        ax.set_xscale("log")
    for y, error in zip(place, errors, strict=True):
        text = format_quantity(float(error), si, 2, first.area) if np.isfinite(error) else "not determined"
        ax.annotate(text, (1.0, y), (4, 0), ("axes fraction", "data"), "offset points", va="center", fontsize="small")
    ax.set_yticks(place, labels)
    ax.set_ylim(-0.6, len(labels) - 0.4)
    ax.set_xlabel(axis_label(f"error of {with_subscripts(estimate_label(result.parameter))}", unit))
    return ax


def prediction(result: Prediction, ax: Axes | None = None) -> Axes:
    """Plot a histogram of the predicted critical stiffness, and the stiffness of the rig.

    Parameters
    ----------
    result : Prediction
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> rig = ss.read_rig("examples/double-direct-shear.toml")
    >>> axes = ss.figures.prediction(ss.predict(rig, fit))
    >>> axes.figure.savefig("prediction.svg")
    """
    ax = axes_or_new(ax)
    critical = result.critical_stiffness[np.isfinite(result.critical_stiffness)]
    own = float(np.nanmedian(result.safety * result.critical_stiffness)) if len(critical) else float("nan")
    if not len(critical):
        raise NotAvailable("no draw has a critical stiffness; the verdict does not depend on the stiffness")
    factor, unit = display_unit("Pa/m", max(float(np.median(critical)), own), result.rig.area)
    ax.hist(critical / factor, bins=_bin_count(len(critical)), color=SKY, label="critical stiffness")
    low, high = np.quantile(critical, [0.025, 0.975])
    if low - MAX_AXIS_DISTANCE * (high - low) <= own <= high + MAX_AXIS_DISTANCE * (high - low):
        ax.axvline(own / factor, color=VERMILION, linewidth=1.5, label="this rig")
    else:  # the rig is far away: including it would squeeze the histogram to a line
        side = "beyond" if own > high else "below"
        ax.plot(
            [],
            [],
            color=VERMILION,
            label=f"this rig: {format_quantity(own, 'Pa/m', 3, result.rig.area)}, {side} this axis",
        )
    middle = result.quantiles(result.critical_stiffness)[2]
    ax.axvline(middle / factor, color=BLACK, linewidth=1, linestyle="--", label="median")
    if missing := np.mean(~np.isfinite(result.critical_stiffness)):
        ax.plot([], [], " ", label=f"{format_percent(missing)} of the draws have none")
    ax.set_xlabel(axis_label("stiffness", unit))
    ax.set_ylabel("draws (1)")
    probability = probability_text(result.probability_stable, len(result.stable))
    ax.set_title(f"stable with probability {probability}", fontsize="medium",
                 color=GREEN if result.probability_stable > 0.5 else VERMILION)  # fmt: skip
    ax.legend(loc="best", fontsize="small")
    return ax


def _bin_count(count: int) -> int:
    """Number of bins for a histogram of `count` draws: Rice's rule, limited to 5 to 60."""
    return int(np.clip(round(2 * count ** (1 / 3)), 5, 60))


def kicks(result: Prediction, ax: Any = None) -> np.ndarray:
    """Plot histograms of the largest kick that the rig survives, one panel for each kind of kick.

    The title has the shares of draws with a threshold (in the histogram), without one (every kick is survived), with
    unstable steady sliding, and with an undecided threshold.

    Parameters
    ----------
    result : Prediction
    ax : array of matplotlib Axes, optional
        One Axes for each kind of kick.

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> rig = ss.read_rig("examples/double-direct-shear.toml")
    >>> axes = ss.figures.kicks(ss.predict(rig, fit, kick="velocity", count=2))
    >>> axes.flat[0].figure.savefig("kicks.svg")
    """
    if not result.thresholds:
        raise NotAvailable("no thresholds were asked for; write predict(..., kick='velocity')")
    count = len(result.thresholds)
    panels = panel_grid(ax if ax is None else np.reshape(ax, (1, -1)), 1, count, (1.0 + 4.2 * count, 3.6))[0]
    for panel, (kick, sizes) in zip(panels, result.thresholds.items(), strict=True):
        fails = np.isfinite(sizes) & (sizes > 0)
        if np.any(fails):
            panel.hist(sizes[fails], bins=_bin_count(int(np.sum(fails))), color=SKY, label="draws")
            panel.axvline(
                float(np.median(sizes[fails])), color=BLACK, linewidth=1, linestyle="--", label="median of these"
            )
            panel.legend(loc="best", fontsize="small")
        shares = {
            "fails at a kick": np.mean(fails),
            "no kick fails": np.mean(np.isinf(sizes)),
            "unstable": np.mean(sizes == 0),
            "undecided, or no steady sliding": np.mean(np.isnan(sizes)),
        }
        words = [f"{name} {format_percent(float(share))}" for name, share in shares.items() if share]
        if len(words) == 1:
            words = [f"{words[0].rpartition(' 100')[0]}: all {len(sizes)} draws"]
        panel.set_title("\n".join(textwrap.wrap(", ".join(words), 48)), fontsize="small")
        panel.set_xlabel(axis_label(f"{kick} kick that is survived, {KICKS[kick].size}", "1"))
        panel.set_ylabel("draws (1)")
    return np.asarray(panels)
