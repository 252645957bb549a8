"""Outlines and labels of areas on a grid where each point has one of several kinds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.arrays import Array
from steadyslip.core.palette import BLACK
from steadyslip.figures.chart import write_inside

_FINE = 161  # number of points along each axis at which room for words is measured: half a 7-point letter in 85 mm


def mark_areas(ax: Axes, x: Array, y: Array, kinds: Array, words: Mapping[int, str]) -> None:
    """Draw lines between cells of different kinds, and write each kind's word into its areas where it fits.

    Cells extend halfway to the next points, as with ``pcolormesh(shading="nearest")``. Scales and limits of the axes
    must be set before. `kinds`, shape (len(y), len(x)), are integers; kinds that are not in `words` get no word.
    """
    bounds = [0.5 * (one[1:] + one[:-1]) for one in (x, y)]
    line = _borders(x, y, bounds, kinds)
    if len(line):
        ax.plot(*line.T, color=BLACK, linewidth=1, label="edge, to the nearest point of the grid")
    share = np.linspace(0, 1, _FINE)
    across, up = _in_data(ax, np.column_stack([share, share]))
    fine = kinds[np.ix_(np.searchsorted(bounds[1], up), np.searchsorted(bounds[0], across))]
    for kind, word in words.items():
        if (fine == kind).any():
            write_inside(ax, fine == kind, word, lambda shares: _in_data(ax, shares))


def _in_data(ax: Axes, shares: Array) -> tuple[Array, Array]:
    """Data coordinates x and y, each (n,), of points given as fractions of the axes, shape (n, 2)."""
    points = np.asarray(ax.transData.inverted().transform(ax.transAxes.transform(shares)))
    return points[:, 0], points[:, 1]


def _borders(x: Array, y: Array, bounds: list[Array], kinds: Array) -> Array:
    """Borders between cells of different kinds, as points (n, 2) with NaN between the line segments."""
    left, low = (np.concatenate([one[:1], mid]) for one, mid in zip((x, y), bounds, strict=True))
    right, high = (np.concatenate([mid, one[-1:]]) for one, mid in zip((x, y), bounds, strict=True))
    row, column = np.nonzero(kinds[:, 1:] != kinds[:, :-1])
    upright = [bounds[0][column], low[row], bounds[0][column], high[row]]
    row, column = np.nonzero(kinds[1:] != kinds[:-1])
    flat = [left[column], bounds[1][row], right[column], bounds[1][row]]
    ends = np.concatenate([np.stack(upright, -1), np.stack(flat, -1)]).reshape(-1, 2, 2)
    return np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)
