"""Condensed least squares: the sum of squares over all samples, computed from the model at a few of the samples.

Between changes of the loading, the friction of the model is a smooth curve: a polynomial through a few samples gives it
at all other samples. The sum of squares over all samples then equals a sum over these few samples, with transformed
data and weights, plus a constant. The noise is averaged as in the whole sum, but the model is computed at far fewer
samples. Around changes, whose times are free, all samples are kept. The constants were chosen by trial as a compromise
between accuracy and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.comparison import Comparison, DataComparison
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.loading.loading import Loading

NODES = 7  # number of samples through which each polynomial passes (degree 6)
INTERPOLATION_ERROR = 1e-3
"""Largest interpolation error, relative to the scatter of the residuals for the model, and to the largest value for its
derivatives."""
MAX_KEPT_SHARE = 0.5  # samples are condensed if at most this share of them remains
MAX_REFERENCES = 3  # largest number of motions in which the polynomials must be accurate
MARGIN = 2  # number of samples that are kept before and after the window of a change


class Condensed:
    """Comparison that computes the model at few samples but has the sum of squares of all, near given coordinates.

    Parameters
    ----------
    plan : Plan
        Plan with linear loss and commanded (or smoothed) loading.
    whole : Comparison
        Comparison of the plan on all samples.
    predicted, slopes : ndarray (m, n), (m, p, n)
        Model friction and derivatives at the reference coordinates, the best first; not weighted.
    """

    def __init__(self, plan: Plan, whole: Comparison, predicted: Array, slopes: Array) -> None:
        self.space = whole.space
        scatter = float(np.std((whole.data - predicted[0]) * whole.weights))
        largest = np.max(np.abs(slopes), axis=(0, 2), initial=0.0)
        curves = [predicted / max(INTERPOLATION_ERROR * scatter, 1e-300)]
        curves += [slopes[:, k] / (INTERPOLATION_ERROR * size) for k, size in enumerate(largest) if size > 0]
        stacked = np.concatenate(curves)
        self.pieces = [
            _Interpolation(record.time, stacked[:, where], list(_kept_ranges(record.time, loading, plan.pressed)))
            for record, where, loading in zip(plan.records, whole.slices, plan.loading, strict=True)
        ]
        self.size = sum(len(piece.rows) for piece in self.pieces)
        records = tuple(r.taken(p.rows, "thinned") for r, p in zip(plan.records, self.pieces, strict=True))
        effort = whole.parts[0].forward.effort
        longer = replace(effort, patience=effort.patience * whole.size // self.size)  # as many steps on fewer rows
        self.few = replace(plan, records=records, weights=None).comparison(longer)
        self.data, constant = [], 0.0
        for piece, where in zip(self.pieces, whole.slices, strict=True):
            piece.weigh(whole.weights[where])
            data, rest = piece.condensed(whole.data[where], whole.weights[where], predicted[0, where][piece.rows])
            self.data.append(data)
            constant += rest
        self.constant = float(np.sqrt(max(constant, 0.0)))

    def residuals(self, coordinates: Array) -> tuple[Array, Array]:
        """Residuals and derivatives as in `Comparison.residuals`, with the sum of squares of all samples."""
        predicted, slopes = self.few.model(coordinates)
        r = np.empty((len(predicted), self.size + 1))
        rows = np.zeros((len(predicted), len(self.space), self.size + 1))
        for piece, where, data in zip(self.pieces, self.few.slices, self.data, strict=True):
            r[:, where] = data - piece.weighed(predicted[:, where])
            rows[:, :, where] = piece.weighed(slopes[:, :, where])
        r[:, -1] = self.constant
        return r, rows


def condensed(plan: Any, whole: DataComparison, coordinates: Array) -> DataComparison | Condensed:
    """Condensed comparison near coordinates (m, p), the best first; `whole` itself if condensing saves no time."""
    if not len(coordinates) or not _possible(plan) or not isinstance(whole, Comparison):
        return whole
    return condensed_along(plan, whole, *whole.model(coordinates[:MAX_REFERENCES]))


def condensed_along(plan: Plan, whole: Comparison, predicted: Array, slopes: Array) -> Comparison | Condensed:
    """Condensed comparison near model friction (m, n) with derivatives (m, p, n), as `whole.model` returns them."""
    usable = np.all(np.isfinite(predicted), axis=1) & np.all(np.isfinite(slopes), axis=(1, 2))
    if not np.any(usable) or not _possible(plan):
        return whole
    found = Condensed(plan, whole, predicted[usable][:MAX_REFERENCES], slopes[usable][:MAX_REFERENCES])
    return found if found.size < MAX_KEPT_SHARE * whole.size else whole


def _possible(plan: Plan) -> bool:
    return plan.follows and plan.loss == "linear"


def _kept_ranges(time: Array, loading: Loading, pressed: bool) -> Iterator[tuple[int, int]]:
    """First and last sample of each range in which the model may have a kink; all samples in it are kept."""
    for channel, _, change in loading.changes:
        if channel != "load" and not pressed:
            continue
        taken = max(change.longest, change.duration) if change.stretches else change.duration
        first, last = np.searchsorted(time, [change.earliest, change.latest + taken])
        margin = MARGIN if change.free else 0
        yield max(int(first) - 1 - margin, 0), min(int(last) + margin, len(time) - 1)


@dataclass(eq=False)
class _Element:
    """Range of samples, and weights (samples, nodes) that interpolate values at its nodes to all of its samples."""

    first: int
    last: int
    nodes: Array
    weights: Array


class _Interpolation:
    """Kept samples of one record, and the interpolation from them to all samples."""

    def __init__(self, time: Array, curves: Array, held: list[tuple[int, int]]) -> None:
        keep = np.zeros(len(time), dtype=bool)
        keep[[0, -1]] = True
        for first, last in held:
            keep[first : last + 1] = True
        self.elements: list[_Element] = []
        ends = np.flatnonzero(keep)
        for first, last in pairwise(ends.tolist()):
            if last - first > 1:
                self._divide(time, curves, first, last)
        for element in self.elements:
            keep[element.nodes] = True
        self.rows = np.flatnonzero(keep)
        self.place = np.cumsum(keep) - 1
        self.kept = keep
        self.upper = np.zeros((NODES, len(self.rows)))

    def _divide(self, time: Array, curves: Array, first: int, last: int) -> None:
        """Add elements between two samples, halved until polynomials interpolate the curves accurately enough."""
        waiting = [(first, last)]
        while waiting:
            i, j = waiting.pop()
            if j - i < 2 * NODES:
                nodes = np.arange(i, j + 1)
                # all samples are kept, in small groups so that the band of the matrix remains narrow
                for k in range(0, len(nodes) - 1, NODES - 1):
                    part = nodes[k : k + NODES]
                    self.elements.append(_Element(int(part[0]), int(part[-1]), part, np.eye(len(part))))
                continue
            share = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
            nodes = i + np.round((j - i) * share).astype(int)
            weights = _lagrange(time[nodes], time[i : j + 1])
            errors = curves[:, i : j + 1] - curves[:, nodes] @ weights.T
            if np.max(np.abs(errors)) <= 1.0:
                self.elements.append(_Element(i, j, nodes, weights))
            else:
                waiting += [(i, (i + j) // 2), ((i + j) // 2, j)]

    def _interpolate(self, values: Array) -> Array:
        """Values at all samples, interpolated from values at the kept samples."""
        found = np.zeros(len(self.kept))
        found[self.rows] = values
        for one in self.elements:
            found[one.first : one.last + 1] = one.weights @ values[self.place[one.nodes]]
        return found

    def _transpose(self, values: Array) -> Array:
        """Sums at the kept samples of values at all samples: the transpose of the linear map `_interpolate`."""
        found = np.zeros(len(self.rows))
        own = self.kept.copy()
        for one in self.elements:
            inner = slice(one.first + 1, one.last)
            own[inner] = False
            found[self.place[one.nodes]] += one.weights[1:-1].T @ values[inner]
        found += np.where(own, values, 0.0)[self.rows]
        return found

    def weigh(self, weights: Array) -> None:
        """Compute the banded Cholesky factor with which the kept samples have the weight of all samples."""
        squares, own = weights**2, self.kept.copy()
        band = np.zeros((NODES, len(self.rows)))
        for one in self.elements:
            inner = slice(one.first + 1, one.last)
            own[inner] = False
            block = one.weights[1:-1].T @ (squares[inner, None] * one.weights[1:-1])
            at = self.place[one.nodes]
            for k in range(len(at)):
                band[NODES - 1 - k, at[k:]] += np.diagonal(block, k)
        band[-1] += np.where(own, squares, 0.0)[self.rows]
        band[-1] += 1e-12 * np.max(band[-1])
        self.upper = np.asarray(cholesky_banded(band))

    def weighed(self, values: Array) -> Array:
        """Product of the Cholesky factor (upper triangle) with values at the kept samples (..., kept)."""
        found = self.upper[-1] * values
        for k in range(1, NODES):
            found[..., :-k] += self.upper[NODES - 1 - k, k:] * values[..., k:]
        return np.asarray(found)

    def condensed(self, data: Array, weights: Array, predicted: Array) -> tuple[Array, float]:
        """Transformed data at the kept samples, and the constant part of the sum of squares.

        Both are computed for the difference of the data from model friction `predicted` at the kept samples, which
        reduces rounding errors.
        """
        rest = weights * (data - self._interpolate(predicted))
        gathered = self._transpose(weights * rest)
        lower = np.zeros_like(self.upper)  # the transposed Cholesky factor, stored as bands
        for k in range(NODES):
            lower[k, : lower.shape[1] - k] = self.upper[NODES - 1 - k, k:]
        own = np.asarray(solve_banded((NODES - 1, 0), lower, gathered))
        return self.weighed(predicted) + own, float(rest @ rest - own @ own)


def _lagrange(nodes: Array, at: Array) -> Array:
    """Weights (m, k) that interpolate values at k nodes to m points; barycentric Lagrange interpolation."""
    differences = (nodes[:, None] - nodes[None, :]) / (nodes[-1] - nodes[0])
    np.fill_diagonal(differences, 1.0)
    bary = 1.0 / np.prod(differences, axis=1)
    gaps = at[:, None] - nodes[None, :]
    exact = gaps == 0.0
    terms = bary / np.where(exact, 1.0, gaps)
    found = terms / np.sum(terms, axis=1, keepdims=True)
    return np.asarray(np.where(np.any(exact, axis=1, keepdims=True), exact.astype(float), found))
