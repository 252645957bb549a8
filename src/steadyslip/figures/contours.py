"""Contours of k/k_cr over a plane of two parameters, smooth up to the edges of steady sliding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from steadyslip.core.arrays import Array
from steadyslip.figures.style import CONTOURS, HALO
from steadyslip.linear.status import STABLE, UNSTABLE

SAFETY_LEVELS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Contour levels of the safety factor k/k_cr."""
_FALL = 1.7  # the field may be 0 at a point if |field two points away|/|field one point away| is larger; 2 if linear
_ROUNDING = 1e-6  # status depends on rounding where |share - 0.5| is smaller: 1e10 times the rounding of a double
_ROOM = 24.0  # least distance in pixels between a contour's label and another line (by trial)
# Median distance to an edge or another contour, over the width of a figure, below which a piece of a contour is left
# out (by trial).
_BESIDE = 0.017
_CLOSE = 6.0  # least distance in pixels between vertices kept by `_thinned` (by trial)


def safety_fields(factor: Array, status: Array) -> list[Array]:
    """Fields k/(k + k_cr), (rows, columns), from k/k_cr: one where k_cr is a lower limit of stable k, one where it
    is an upper limit.

    k/(k + k_cr) is bounded, so that contours continue where k_cr is zero or infinite: 1 where every stiffness is
    stable, 0 where no stiffness is. NaN where the nearest limit is of the other kind, or not known.
    """
    with np.errstate(invalid="ignore"):
        share = np.where(np.isinf(factor), 1.0, factor / (1 + factor))
    known, stable = np.isfinite(share), status == STABLE
    is_lower = ~known | ((share >= 0.5) == stable) | (np.abs(share - 0.5) < _ROUNDING)
    lower, upper = (np.where(known & here, share, np.nan) for here in (is_lower, ~is_lower))
    with np.errstate(divide="ignore", invalid="ignore"):
        ends_at_zero, ends_at_infinity = _vanishes(1 / lower - 1), _vanishes(lower / (1 - lower))
    lower[~known & stable & ends_at_zero] = 1.0
    lower[~known & (status == UNSTABLE) & ends_at_infinity] = 0.0
    return [one for one in (lower, upper) if np.isfinite(one).sum() > 1]


def extended(field: Array, missing: Array) -> Array:
    """Field extrapolated linearly by one grid spacing into points of the mask `missing`."""
    near = [np.stack(values) for values in zip(*_neighbours(field), strict=True)]
    straight = 2 * near[0] - near[1]
    with np.errstate(invalid="ignore"):
        ends = [np.nansum(one, axis=0) / np.isfinite(one).sum(axis=0) for one in (straight, near[0])]
    return np.where(missing & ~np.isfinite(field), np.where(np.isfinite(ends[0]), *ends), field)


def _vanishes(field: Array) -> Array:
    """Mask of points without a known neighbour, or towards which the field, extrapolated linearly, falls to zero."""
    known, falls = np.zeros(field.shape, bool), np.zeros(field.shape, bool)
    for one, two in _neighbours(field):
        known |= np.isfinite(one)
        falls |= two >= _FALL * one
    return ~known | falls


def _neighbours(field: Array) -> Iterator[tuple[Array, Array]]:
    """Pairs of fields shifted by one and by two grid points, in eight directions; NaN outside."""
    rows, columns = field.shape
    padded = np.pad(field, 2, constant_values=np.nan)
    for step in product((-1, 0, 1), repeat=2):
        if step != (0, 0):
            one, two = ([2 + n * part for part in step] for n in (1, 2))
            yield tuple(padded[i : i + rows, j : j + columns] for i, j in (one, two))  # type: ignore[misc]


def draw_levels(
    ax: Axes, x: Array, y: Array, fields: Sequence[Array], levels: Sequence[float], words: Sequence[str], within: Any,
    beside: Sequence[Array] = (), **style: Any,
) -> list[Array]:  # fmt: skip
    """Draw labelled contours of fields over a plane; return the lines drawn, as vertices (n, 2).

    They are clipped to the outline `within`, a path in the units of the axes or None. Labels keep clear of the lines
    `beside`; pieces of contours that run along one of these, or along another contour, are left out.
    """
    drawn, clip = [], None if within is None else PathPatch(within, transform=ax.transData, visible=False)
    for field in fields:
        shown = [n for n, level in enumerate(levels) if np.nanmin(field) < level < np.nanmax(field)]
        if not shown:
            continue
        drawing = CONTOURS | style
        lines = ax.contour(x, y, field, levels=[levels[n] for n in shown], **drawing)
        pieces = _not_along(ax, [pieces_of(path) for path in lines.get_paths()], beside)
        if not all(pieces):  # redraw without those levels of which every piece is left out
            lines.remove()
            shown = [n for n, several in zip(shown, pieces, strict=True) if several]
            pieces = [several for several in pieces if several]
            if not shown:
                continue
            lines = ax.contour(x, y, field, levels=[levels[n] for n in shown], **drawing)
        lines.set_paths([Path.make_compound_path(*map(Path, several)) for several in pieces])
        if clip is not None:
            lines.set_clip_path(clip)
        found = {n: max(several, key=len) for n, several in zip(shown, pieces, strict=True) if several}
        of = {level: words[n] for n, level in enumerate(levels)}
        longest = list(found.values())
        places: list[tuple[float, float]] = []
        for one in longest:
            others = [*beside, *(other for other in longest if other is not one)]
            places.append(_apart(ax, one, others, [np.array([place]) for place in places]))
        labels = ax.clabel(lines, fontsize="small", fmt=lambda level, of=of: of[level], manual=places)
        for label in labels:
            label.set_path_effects(HALO)
        drawn += [one for several in pieces for one in several]
    return drawn


def pieces_of(path: Path) -> list[Array]:
    """Pieces of a path of straight lines, each (n, 2), with all vertices; `Path.to_polygons` would drop vertices."""
    vertices = np.asarray(path.vertices)
    starts = [0] if path.codes is None else np.flatnonzero(path.codes == Path.MOVETO)
    return [piece for piece in np.split(vertices, starts[1:]) if len(piece) > 1]


def _not_along(ax: Axes, contours: Sequence[Sequence[Array]], beside: Sequence[Array]) -> list[list[Array]]:
    """Pieces of the contours that keep the distance `_BESIDE` from the lines `beside` and from each other.

    Of two pieces that are too close to each other, the piece farther from the lines `beside` is kept.
    """
    least = _BESIDE * ax.get_figure(root=True).bbox.width  # type: ignore[union-attr]

    def in_pixels(lines: Sequence[Array]) -> list[Array]:
        return [_thinned(ax.transData.transform(one)) for one in lines if len(one) > 1]

    def away(line: Array, others: Sequence[Array]) -> float:
        if not others:
            return np.inf
        rest = np.concatenate(others)
        return float(np.median(np.linalg.norm(line[:, None] - rest[None], axis=-1).min(axis=1)))

    edges, pieces = in_pixels(beside), [(n, piece) for n, several in enumerate(contours) for piece in several]
    found = in_pixels([piece for _, piece in pieces])
    far = [away(one, edges) for one in found]
    kept: list[int] = []
    for k in sorted(range(len(found)), key=lambda k: -far[k]):
        if min(far[k], away(found[k], [found[m] for m in kept if pieces[m][0] != pieces[k][0]])) >= least:
            kept.append(k)
    return [[piece for k, (m, piece) in enumerate(pieces) if m == n and k in kept] for n in range(len(contours))]


def _apart(ax: Axes, line: Array, others: Sequence[Array], labels: Sequence[Array]) -> tuple[float, float]:
    """Vertex for a label, (x, y): at least `_ROOM` from other lines and twice that from labels, nearest to mid-line."""
    seen = ax.transData.transform(line)
    inside = np.all(np.abs(ax.transAxes.inverted().transform(seen) - 0.5) < 0.45, axis=1)
    beside = [(_thinned(ax.transData.transform(one)), 0.0) for one in others]
    beside += [(ax.transData.transform(one), _ROOM) for one in labels]
    gaps = [np.linalg.norm(seen[:, None] - one[None], axis=-1).min(axis=1) - size for one, size in beside]
    gap = np.min([np.full(len(seen), _ROOM), *gaps], axis=0)
    best = np.argmax(np.where(inside, gap, gap - 10 * _ROOM) - np.abs(np.linspace(-0.5, 0.5, len(seen))))
    return float(line[best, 0]), float(line[best, 1])


def _thinned(line: Array) -> Array:
    """Line thinned to vertices about `_CLOSE` pixels apart; its first and last vertex are kept."""
    gone = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))]) // _CLOSE
    return np.asarray(line[np.concatenate([[True], np.diff(gone) > 0]) | (np.arange(len(line)) == len(line) - 1)])
