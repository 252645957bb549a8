"""Regions of a plane in which a yes-or-no question about a rig has one answer, with exact outlines.

A grid finds the regions; every point of their outlines is then moved along its grid line to where the
answer changes, by bisection, so that the outline is exact and not a staircase.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from contourpy import FillType, LineType, contour_generator
from matplotlib.path import Path

Question = Callable[[Any, Any], Any]  # shares of the two axes, 0 to 1, to bool
_HALVINGS = 40


def filled(question: Question, points: int) -> Path:
    """Outline of where the answer is yes, as one closed path in shares of the axes (empty if nowhere)."""
    mask = _on_grid(question, points)
    generator = contour_generator(z=mask.astype(float), name="serial", fill_type=FillType.OuterOffset)
    vertices, codes = [np.empty((0, 2))], [np.empty(0, np.uint8)]
    for outline, offsets in zip(*generator.filled(0.5, 2.0), strict=True):
        vertices.append(_refined(outline, mask, question))
        code = np.full(len(outline), Path.LINETO, np.uint8)
        code[offsets[:-1]] = Path.MOVETO
        code[offsets[1:] - 1] = Path.CLOSEPOLY
        codes.append(code)
    return Path(np.concatenate(vertices), np.concatenate(codes))


def edges(question: Question, points: int, where: Question | None = None) -> Any:
    """Lines along which the answer changes, (n, 2) in shares of the axes, NaN between lines.

    Cells of the grid with a corner outside `where` are left out.
    """
    mask = _on_grid(question, points)
    left_out = np.zeros_like(mask) if where is None else ~_on_grid(where, points)
    z = np.ma.masked_array(mask.astype(float), left_out)
    generator = contour_generator(z=z, name="serial", line_type=LineType.Separate, corner_mask=False)
    gap = np.full((1, 2), np.nan)
    lines = [gap]
    for line in generator.lines(0.5):
        lines += [_refined(line, mask, question), gap]
    return np.concatenate(lines)


def _on_grid(question: Question, points: int) -> Any:
    share = np.linspace(0, 1, points)
    x, y = np.meshgrid(share, share)
    return np.asarray(question(x, y), bool)


def _refined(outline: Any, mask: Any, question: Question) -> Any:
    """Move outline points that lie halfway between two grid points to where the answer changes."""
    last = len(mask) - 1
    low, high = np.floor(outline).astype(int), np.ceil(outline).astype(int)
    start = mask[low[:, 1], low[:, 0]]
    moves = start != mask[high[:, 1], high[:, 0]]
    result = outline / last
    if not moves.any():
        return result
    origin, step, start = low[moves] / last, (high - low)[moves] / last, start[moves]
    near, far = np.zeros(len(start)), np.ones(len(start))
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        x, y = (origin + step * middle[:, None]).T
        same = np.asarray(question(x, y), bool) == start
        near, far = np.where(same, middle, near), np.where(same, far, middle)
    result[moves] = origin + step * (0.5 * (near + far))[:, None]
    return result
