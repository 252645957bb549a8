"""Outlines of the regions of a plane in which a predicate is true.

Regions are found on a grid; each outline point is then moved along its grid line, by bisection, to where the
predicate changes, so that the outline is exact instead of a staircase.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from contourpy import FillType, LineType, contour_generator
from matplotlib.path import Path

Predicate = Callable[[Any, Any], Any]  # function of the fractions of the two axes, 0 to 1, that returns bool
_HALVINGS = 40  # number of bisections of a grid spacing: to 1e-12 of the spacing


def region_path(predicate: Predicate, mask: Any, known: Any = True) -> Path:
    """Outline of the region where the predicate is true, in fractions of the axes; empty path if there is none.

    `mask`, shape (rows, columns), has values of the predicate on a grid over the axes, any others where not `known`.
    """
    generator = contour_generator(z=mask.astype(float), name="serial", fill_type=FillType.OuterOffset)
    vertices, codes = [np.empty((0, 2))], [np.empty(0, np.uint8)]
    for outline, offsets in zip(*generator.filled(0.5, 2.0), strict=True):
        vertices.append(_bisected(outline, mask, predicate, known))
        code = np.full(len(outline), Path.LINETO, np.uint8)
        code[offsets[:-1]] = Path.MOVETO
        code[offsets[1:] - 1] = Path.CLOSEPOLY
        codes.append(code)
    return Path(np.concatenate(vertices), np.concatenate(codes))


def edges(predicate: Predicate, mask: Any, left_out: Any = False, known: Any = True) -> Any:
    """Lines along which the predicate changes, shape (n, 2) in fractions of the axes, NaN between lines.

    `mask` as in `region_path`; grid cells with a corner where `left_out` is True are skipped.
    """
    z = np.ma.masked_array(mask.astype(float), np.array(np.broadcast_to(left_out, mask.shape)))
    generator = contour_generator(z=z, name="serial", line_type=LineType.Separate, corner_mask=False)
    gap = np.full((1, 2), np.nan)
    lines = [gap]
    for line in generator.lines(0.5):
        lines += [_bisected(line, mask, predicate, known), gap]
    return np.concatenate(lines)


def carried(grid: Any, missing: Any) -> tuple[Any, Any]:
    """Grid with missing values replaced by the nearest known values, and mask of points far from known values.

    The mask is True more than one grid point from any known value.

    Regions and lines drawn from it extend beneath the region of missing values, so that no gap shows at its outline.
    """
    from scipy.ndimage import binary_erosion, distance_transform_edt

    if not missing.any() or missing.all():
        return grid, missing
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return grid[tuple(nearest)], binary_erosion(missing, np.ones((3, 3)), border_value=1)


def on_grid(function: Predicate, points: int) -> Any:
    """Values of a function of fractions of both axes on a grid, shape (points, points)."""
    share = np.linspace(0, 1, points)
    return np.asarray(function(*np.meshgrid(share, share)))


def widest_place(mask: Any, size: tuple[float, float]) -> tuple[float, float, float]:
    """Centre of the largest ellipse inside a region, in fractions of the axes, and ratio of its size to `size`.

    `size` has half the width and half the height of an ellipse of the wanted shape, in fractions of the axes.
    """
    from scipy.ndimage import distance_transform_edt

    rows, columns = mask.shape
    steps = 1 / (rows - 1) / size[1], 1 / (columns - 1) / size[0]
    away = distance_transform_edt(np.pad(mask, 1), sampling=steps)[1:-1, 1:-1]
    row, column = np.unravel_index(np.argmax(away), mask.shape)
    return float(column / (columns - 1)), float(row / (rows - 1)), float(away[row, column])


def _bisected(outline: Any, mask: Any, predicate: Predicate, known: Any) -> Any:
    """Outline (n, 2) with each point between two grid points moved to where the predicate changes, by bisection.

    Points between two grid points that are not `known` stay halfway.
    """
    last = np.array(mask.shape)[::-1] - 1
    low, high = np.floor(outline).astype(int), np.ceil(outline).astype(int)
    start = mask[low[:, 1], low[:, 0]]
    known = np.broadcast_to(known, mask.shape)
    moves = start != mask[high[:, 1], high[:, 0]]
    moves &= known[low[:, 1], low[:, 0]] | known[high[:, 1], high[:, 0]]
    result = outline / last
    if not moves.any():
        return result
    origin, step, start = low[moves] / last, (high - low)[moves] / last, start[moves]
    near, far = np.zeros(len(start)), np.ones(len(start))
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        x, y = (origin + step * middle[:, None]).T
        same = np.asarray(predicate(x, y), bool) == start
        near, far = np.where(same, middle, near), np.where(same, far, middle)
    result[moves] = origin + step * (0.5 * (near + far))[:, None]
    return result
