"""All samples of a fit in fewer numbers, where the model is smooth between them.

Between the changes of the loading friction is a smooth curve: a polynomial through a few samples gives it at all
others. The sum of squares over all samples is then one over those few, with other data and weights, and a constant;
nothing is lost of the noise that many samples average out, and the model is run through far fewer of them. Around the
changes, whose times are free, all samples stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.loading.loading import Loading

NODES = 7  # of one polynomial
MISSED = 1e-3  # error of the interpolation: of the scatter for the model, of the largest for derivatives
WORTHWHILE = 0.5  # share of the samples that may be left
REFERENCES = 3  # motions from which nodes are chosen
MARGIN = 2  # samples kept on both sides of where a change may lie


class Condensed:
    """A comparison on few of its samples that has, near given coordinates, the sum of squares of all.

    Parameters
    ----------
    plan : Plan
        Of least squares, following a loading that was found.
    whole : Comparison
        Of that plan.
    seen, slopes : ndarray (m, n), (m, p, n)
        Model and derivatives where it is wanted, the best first; without weights.
    """

    def __init__(self, plan: Plan, whole: Comparison, seen: Array, slopes: Array) -> None:
        self.space = whole.space
        scatter = float(np.std((whole.data - seen[0]) * whole.weights))
        largest = np.max(np.abs(slopes), axis=(0, 2), initial=0.0)
        curves = [seen / max(MISSED * scatter, 1e-300)]
        curves += [slopes[:, k] / (MISSED * size) for k, size in enumerate(largest) if size > 0]
        stacked = np.concatenate(curves)
        self.pieces = [
            _Nodes(record.time, stacked[:, where], list(_held(record.time, loading, plan.pressed)))
            for record, where, loading in zip(plan.records, whole.slices, plan.loading, strict=True)
        ]
        self.size = sum(len(piece.rows) for piece in self.pieces)
        records = tuple(r.taken(p.rows, "thinned") for r, p in zip(plan.records, self.pieces, strict=True))
        effort = whole.parts[0].forward.effort
        longer = replace(effort, patience=effort.patience * whole.size // self.size)  # motions are as long as before
        self.few = replace(plan, records=records, weights=None).comparison(longer)
        self.data, constant = [], 0.0
        for piece, where in zip(self.pieces, whole.slices, strict=True):
            piece.weigh(whole.weights[where])
            data, rest = piece.condensed(whole.data[where], whole.weights[where], seen[0, where][piece.rows])
            self.data.append(data)
            constant += rest
        self.constant = float(np.sqrt(max(constant, 0.0)))

    def residuals(self, coordinates: Array) -> tuple[Array, Array]:
        """Residuals and derivatives of the model, as `Comparison.residuals`; their squares are those of all samples."""
        seen, slopes = self.few.model(coordinates)
        r = np.empty((len(seen), self.size + 1))
        rows = np.zeros((len(seen), len(self.space), self.size + 1))
        for piece, where, data in zip(self.pieces, self.few.slices, self.data, strict=True):
            r[:, where] = data - piece.weighed(seen[:, where])
            rows[:, :, where] = piece.weighed(slopes[:, :, where])
        r[:, -1] = self.constant
        return r, rows


def condensed(plan: Plan, whole: Comparison, coordinates: Array) -> Comparison | Condensed:
    """The same in fewer numbers near coordinates (m, p), the best first, where that is possible and worthwhile."""
    if not len(coordinates) or not _possible(plan):
        return whole
    return condensed_along(plan, whole, *whole.model(coordinates[:REFERENCES]))


def condensed_along(plan: Plan, whole: Comparison, seen: Array, slopes: Array) -> Comparison | Condensed:
    """The same near what `whole.model` says: friction (m, n) and its slopes (m, p, n), the best first."""
    usable = np.all(np.isfinite(seen), axis=1) & np.all(np.isfinite(slopes), axis=(1, 2))
    if not np.any(usable) or not _possible(plan):
        return whole
    found = Condensed(plan, whole, seen[usable][:REFERENCES], slopes[usable][:REFERENCES])
    return found if found.size < WORTHWHILE * whole.size else whole


def _possible(plan: Plan) -> bool:
    return plan.follows and plan.loss == "linear"


def _held(time: Array, loading: Loading, pressed: bool) -> Iterator[tuple[int, int]]:
    """Ranges of samples within which the model may have a kink, first and last of each."""
    for channel, _, change in loading.changes:
        if channel != "load" and not pressed:
            continue
        taken = max(change.longest, change.duration) if change.stretches else change.duration
        first, last = np.searchsorted(time, [change.earliest, change.latest + taken])
        margin = MARGIN if change.free else 0
        yield max(int(first) - 1 - margin, 0), min(int(last) + margin, len(time) - 1)


@dataclass(eq=False)
class _Element:
    """Neighbouring samples, first and last, and the polynomial through some of them: (samples, nodes)."""

    first: int
    last: int
    nodes: Array
    weights: Array


class _Nodes:
    """The samples of one record that are kept, and how the others follow from them."""

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
        """Elements between two samples, halved until polynomials give the curves."""
        waiting = [(first, last)]
        while waiting:
            i, j = waiting.pop()
            if j - i < 2 * NODES:
                nodes = np.arange(i, j + 1)
                for k in range(0, len(nodes) - 1, NODES - 1):  # nothing is saved, but the band stays narrow
                    part = nodes[k : k + NODES]
                    self.elements.append(_Element(int(part[0]), int(part[-1]), part, np.eye(len(part))))
                continue
            share = 0.5 - 0.5 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))
            nodes = i + np.round((j - i) * share).astype(int)
            weights = _lagrange(time[nodes], time[i : j + 1])
            missed = curves[:, i : j + 1] - curves[:, nodes] @ weights.T
            if np.max(np.abs(missed)) <= 1.0:
                self.elements.append(_Element(i, j, nodes, weights))
            else:
                waiting += [(i, (i + j) // 2), ((i + j) // 2, j)]

    def _spread(self, values: Array) -> Array:
        """Values at all samples from those at the kept ones."""
        found = np.zeros(len(self.kept))
        found[self.rows] = values
        for one in self.elements:
            found[one.first : one.last + 1] = one.weights @ values[self.place[one.nodes]]
        return found

    def _gathered(self, values: Array) -> Array:
        """The transpose of that."""
        found = np.zeros(len(self.rows))
        own = self.kept.copy()
        for one in self.elements:
            inner = slice(one.first + 1, one.last)
            own[inner] = False
            found[self.place[one.nodes]] += one.weights[1:-1].T @ values[inner]
        found += np.where(own, values, 0.0)[self.rows]
        return found

    def weigh(self, weights: Array) -> None:
        """Find the upper triangle that weighs kept samples as all together weigh."""
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
        """The upper triangle times values at the kept samples (..., kept)."""
        found = self.upper[-1] * values
        for k in range(1, NODES):
            found[..., :-k] += self.upper[NODES - 1 - k, k:] * values[..., k:]
        return np.asarray(found)

    def condensed(self, data: Array, weights: Array, seen: Array) -> tuple[Array, float]:
        """Data for the kept samples, and the sum of squares that no model of them can take away.

        Reckoned from what a model says, `seen`, at the kept samples, for the sake of rounding.
        """
        rest = weights * (data - self._spread(seen))
        gathered = self._gathered(weights * rest)
        lower = np.zeros_like(self.upper)  # the transpose, in the band storage of lower triangles
        for k in range(NODES):
            lower[k, : lower.shape[1] - k] = self.upper[NODES - 1 - k, k:]
        own = np.asarray(solve_banded((NODES - 1, 0), lower, gathered))
        return self.weighed(seen) + own, float(rest @ rest - own @ own)


def _lagrange(nodes: Array, at: Array) -> Array:
    """Weights (m, k) of values at nodes in the polynomial through them, at given places; barycentric."""
    differences = (nodes[:, None] - nodes[None, :]) / (nodes[-1] - nodes[0])
    np.fill_diagonal(differences, 1.0)
    bary = 1.0 / np.prod(differences, axis=1)
    gaps = at[:, None] - nodes[None, :]
    exact = gaps == 0.0
    terms = bary / np.where(exact, 1.0, gaps)
    found = terms / np.sum(terms, axis=1, keepdims=True)
    return np.asarray(np.where(np.any(exact, axis=1, keepdims=True), exact.astype(float), found))
