"""Corner plot: parameters of a fit against each other, with regions of 68 and 95 % probability."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from scipy.ndimage import gaussian_filter
from scipy.stats import chi2, norm

from steadyslip.core.errors import NotAvailable
from steadyslip.core.palette import BLACK, BLUE, SKY, VERMILION
from steadyslip.experiments.answers.uncertainty import Draws
from steadyslip.figures.experiments.panels import panel_grid
from steadyslip.figures.style import axis_label, display_unit, is_narrow, with_subscripts
from steadyslip.machine.letters import estimate_label, letter_of
from steadyslip.machine.rig import Rig

if TYPE_CHECKING:
    from steadyslip.experiments import Estimate, Fit

LEVELS = (0.68, 0.95)  # probability inside each contour, as for one and two standard deviations
STYLES: tuple[Literal["-"], Literal["--"]] = ("-", "--")
PILE_UP_SHARE = 0.02  # an extreme value at which a larger share of draws lies is a bound of the search (by trial)
BINS = 48  # number of bins along each axis for the density of draws: finer than its smoothing (by trial)
MOST_IN_COLUMN = 4  # largest number of panels side by side in 85 mm: a name and three numbers of 7 points take 18 mm
TWO_COLUMNS = 180 / 25.4  # inches: width of two journal columns with the gap between them
MAX_DOTS = 4000  # largest number of draws plotted as dots; more dots only darken the panel (by trial)


def corner(result: Fit | Draws, ax: Any = None) -> np.ndarray:
    """Plot determined parameters against each other, with regions of 68 and 95 % probability.

    The regions are those of the normal distribution of a fit, or of the smoothed density of draws. In a journal figure
    more than four parameters take the width of two columns.

    Parameters
    ----------
    result : Fit or Draws
    ax : array of matplotlib Axes, optional
        As many rows and columns as there are determined parameters.

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> axes = ss.figures.corner(fit)
    >>> axes.flat[0].figure.savefig("corner.svg")
    """
    source = result.fit if isinstance(result, Draws) else result
    names = [e.name for e in source.estimates if e.determined]
    if not names:
        raise NotAvailable("no parameter is determined; there is nothing to draw")
    size = max(3.0, 1.5 * len(names) + 0.8)
    panels = panel_grid(ax, len(names), len(names), (size, size))
    if ax is None and is_narrow() and len(names) > MOST_IN_COLUMN:
        panels[0, 0].figure.set_size_inches(TWO_COLUMNS, TWO_COLUMNS)
    letters = _letters(source.rig(), names)
    scales = [_Scale(source[name], letters[name]) for name in names]
    for i, row in enumerate(names):
        for k, column in enumerate(names):
            panel = panels[i, k]
            if k > i:
                panel.set_visible(False)
                continue
            if isinstance(result, Draws):
                _draw_sample(panel, scales[k](result[column]), scales[i](result[row]), i == k)
            else:
                _draw_normal_regions(panel, result, (column, row), (scales[k], scales[i]))
            if i == len(names) - 1:
                panel.set_xlabel(scales[k].label, fontsize="small")
            if k == 0 and i:
                panel.set_ylabel(scales[i].label, fontsize="small")
            panel.tick_params(labelsize="x-small", labelbottom=i == len(names) - 1, labelleft=k == 0 and i > 0)
            panel.ticklabel_format(useOffset=False)
            panel.tick_params(axis="x", rotation=45)
            panel.locator_params(nbins=3)
            panel.axvline(scales[k].best, color=VERMILION, linewidth=0.8)
            if i != k:
                panel.axhline(scales[i].best, color=VERMILION, linewidth=0.8)
    if len(names) > 1:  # the legend is in the empty upper triangle
        color = BLACK if isinstance(result, Draws) else BLUE
        lines = [Line2D([], [], color=color, linestyle=style, linewidth=1) for style in STYLES]
        words = [f"holds {100 * level:.0f} %" for level in LEVELS]
        lines.append(Line2D([], [], color=VERMILION, linewidth=0.8))
        place = {"loc": "upper left", "bbox_to_anchor": (1.15, 1.0), "borderaxespad": 0.0}
        legend = panels[0, 0].legend(lines, [*words, "best fit"], fontsize="small", frameon=False, **place)
        legend.set_in_layout(False)  # otherwise the layout moves the second column
    return panels


def _letters(rig: Rig, names: Sequence[str]) -> dict[str, str]:
    """Letters of parameters for axes, by name; short names for parameters without a letter of their own."""
    known = rig.parameters()
    letters = {name: letter_of(rig, name) for name in names if name in known}
    own = {name: letter for name, letter in letters.items() if letter and [*letters.values()].count(letter) == 1}
    return {name: with_subscripts(own.get(name) or estimate_label(name)) for name in names}


class _Scale:
    """Display unit and label of a parameter; calling it converts SI values. Times are relative to the best value."""

    def __init__(self, one: Estimate, name: str) -> None:
        clock = one.unit == "s"
        self.origin = one.value if clock else 0.0
        self.size, unit = display_unit(one.unit, one.error if clock else abs(one.value) or one.error, one.area)
        self.best = (one.value - self.origin) / self.size
        self.label = axis_label(f"{name}\n\u2212 {one.value:.7g} s" if clock else name, unit)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return (values - self.origin) / self.size


def _draw_normal_regions(panel: Axes, fit: Fit, names: tuple[str, str], scales: tuple[_Scale, _Scale]) -> None:
    """Plot the normal distribution of one or two search coordinates of a fit, transformed to the parameters.

    It is truncated at the bounds of the search, such as the samples between which a step lies.
    """
    one, other = (fit.index(name) for name in names)
    places = [fit.coordinates[i] for i in (one, other)]
    if one == other:
        deviation = float(np.sqrt(fit.covariance[one, one]))
        z = places[0] + deviation * np.linspace(-3.5, 3.5, 401)
        z = z[(z >= fit.bounds[0][one]) & (z <= fit.bounds[1][one])]
        density = norm.pdf(z, places[0], deviation)
        values = scales[0](np.asarray(fit.space.unknowns[one].value(z)))
        panel.fill_between(values, density / np.gradient(values, z), color=SKY, linewidth=0)
        panel.set_yticks([])
        panel.set_ylim(0.0, None)
        return
    root = np.linalg.cholesky(fit.covariance[np.ix_([one, other], [one, other])])
    angle = np.linspace(0.0, 2 * np.pi, 181)
    for level, style in zip(LEVELS, STYLES, strict=True):
        ring = root @ (np.sqrt(chi2.ppf(level, 2)) * np.array([np.cos(angle), np.sin(angle)]))
        curve = [
            scale(np.asarray(fit.space.unknowns[i].value(np.clip(place + part, fit.bounds[0][i], fit.bounds[1][i]))))
            for i, place, part, scale in zip((one, other), places, ring, scales, strict=True)
        ]
        panel.plot(*curve, color=BLUE, linewidth=1, linestyle=style, label=f"{100 * level:.0f} %")


def _draw_sample(panel: Axes, x: np.ndarray, y: np.ndarray, alone: bool) -> None:
    """Plot draws as dots, with contours of density around 68 and 95 % of them; a histogram if `alone`."""
    if alone:
        panel.hist(x, bins=round(np.clip(2 * len(x) ** (1 / 3), 5, 40)), color=SKY)  # Rice's rule
        panel.set_yticks([])
        return
    few = slice(0, MAX_DOTS)
    panel.plot(x[few], y[few], ".", color=SKY, markersize=1, alpha=0.4, rasterized=True)
    spread = np.cov(x, y)
    if np.linalg.det(spread) > 0:
        root = np.linalg.cholesky(spread)  # whitened coordinates u, v: unit covariance, so one width smooths both
        u, v = np.linalg.solve(root, np.array([x, y]))
        counts, columns, rows = np.histogram2d(u, v, bins=BINS)
        widths = [len(u) ** (-1 / 6) / (edges[1] - edges[0]) for edges in (columns, rows)]  # Scott's rule, in bins
        beyond = int(3 * max(widths)) + 1
        density = gaussian_filter(np.pad(counts, beyond), widths)
        places = np.arange(BINS + 2 * beyond) - beyond + 0.5
        middles = np.meshgrid(*(e[0] + (e[1] - e[0]) * places for e in (columns, rows)), indexing="ij")
        panel.contour(
            *np.einsum("ij,jkl->ikl", root, np.array(middles)), density,
            levels=[density_level(density, level) for level in LEVELS[::-1]], colors=BLACK, linewidths=1,
            linestyles=STYLES[::-1],
        )  # fmt: skip
    for values, limit in ((x, panel.set_xlim), (y, panel.set_ylim)):  # axes end at bounds of the search
        low, high = float(np.min(values)), float(np.max(values))
        limit(
            low if np.mean(values == low) > PILE_UP_SHARE else None,
            high if np.mean(values == high) > PILE_UP_SHARE else None,
        )


def density_level(density: np.ndarray, share: float) -> float:
    """Density level above which cells contain the given share (0 to 1) of the total."""
    falling = np.sort(density, axis=None)[::-1]
    return float(falling[np.searchsorted(np.cumsum(falling), share * np.sum(falling))])
