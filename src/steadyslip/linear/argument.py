"""Count of roots right of the imaginary axis of sums of polynomials times exp(−sh), by the argument principle.

Where one term is larger than all others together, the argument of the sum follows that of the term, however long the
delays are. The axis needs to be resolved only near the few frequencies at which two terms are equal in size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.roots import Array, ComplexArray, evaluate

UNKNOWN = -2  # count of roots where counting takes too long
_MOST = 400_000  # unresolved pieces of the axis, of all rigs together, before counting is given up; by trial: memory
_NEAR = 1e-13  # relative length at which a piece is not cut further (rounding): a root lies on it


def bound_on_axis(c: Array) -> float:
    """Upper bound (Fujiwara) of |s| of roots right of the imaginary axis, for coefficients c (m, n+1) of one rig."""
    size = np.abs(c)
    top = int(np.flatnonzero(np.any(size > 0, axis=0))[-1])
    if top == 0:
        return 1.0
    left = size[0, top] - np.sum(size[1:, top])
    total = np.sum(size[:, :top], axis=0)
    powers = 1.0 / (top - np.arange(top))
    return 2.0 * float(np.max((total / left) ** powers)) or 1.0


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Stretches of the imaginary axis, of one rig of several each: frequencies of both ends, what all terms are there
    without e^(−sh), (2, m, pieces), and what the sum is."""

    row: NDArray[np.int64]
    omega: Array
    terms: ComplexArray
    total: ComplexArray

    def where(self, which: NDArray[np.bool_]) -> _Pieces:
        return _Pieces(self.row[which], self.omega[:, which], self.terms[..., which], self.total[:, which])

    @property
    def length(self) -> Array:
        return np.asarray(self.omega[1] - self.omega[0])


@dataclass(frozen=True, eq=False)
class SumsOnAxis:
    """Sums (rows, m, n+1) with delays (rows, m) on the positive imaginary axis, from zero to where no root can be.

    The axis is cut until on each piece either one term is larger than all others together, so that the sum turns as
    that one does but for less than a quarter at either end, whatever the delays; or the sum cannot wind around zero
    unseen: its length between two places is at most their distance times the largest slope, and where that is less
    than the sum of the sizes at both, the chord and the sum go around zero on the same side.
    """

    c: Array
    h: Array

    def at(self, row: NDArray[np.int64], omega: Array) -> tuple[ComplexArray, ComplexArray]:
        """Terms at iω without their factors exp(−sh), (m, frequencies), and the sum with these factors."""
        terms = np.array([evaluate(self.c[row, j], 1j * omega) for j in range(self.c.shape[1])])
        late = (p * np.exp(-1j * self.h[row, j + 1] * omega) for j, p in enumerate(terms[1:]))
        return terms, np.asarray(terms[0] + sum(late))

    def whole(self) -> _Pieces:
        shares = np.append(0.0, np.geomspace(1e-9, 1.0, 120))
        omega = np.array([bound_on_axis(one) for one in self.c])[:, None] * shares
        row = np.broadcast_to(np.arange(len(self.c))[:, None], omega.shape)
        found = self.at(row.ravel(), omega.ravel())
        both = [
            np.stack([part[..., :-1], part[..., 1:]]).reshape(2, *part.shape[:-2], -1)
            for part in (omega, *(one.reshape(*one.shape[:-1], *omega.shape) for one in found))
        ]
        return _Pieces(row[:, 1:].ravel(), *both)

    def cut(self, old: _Pieces) -> _Pieces:
        """Pieces cut into halves."""
        middle = 0.5 * (old.omega[0] + old.omega[1])
        parts = zip((old.omega, old.terms, old.total), (middle, *self.at(old.row, middle)), strict=True)
        both = (np.concatenate([np.stack([own[0], new]), np.stack([new, own[1]])], axis=-1) for own, new in parts)
        return _Pieces(np.tile(old.row, 2), *both)

    def resolved_pieces(self) -> Iterator[tuple[_Pieces, NDArray[np.int64]]]:
        """Pieces on which the change of argument is known, with the index of the dominant term, −1 where none is.

        For a rig that needs too many pieces, the last ones come with `UNKNOWN` instead.
        """
        sizes = np.abs(self.c)
        steep = np.sum(sizes[..., 1:] * np.arange(1, self.c.shape[-1]), axis=1)
        turning = np.sum(sizes * self.h[..., None], axis=1)
        pieces = self.whole()
        while pieces.row.size:
            row, high = pieces.row, pieces.omega[1]
            change = evaluate(steep[row], high) * pieces.length
            size = np.sum(np.abs(pieces.terms), axis=0)
            leader = np.argmax(size, axis=0)
            ahead = 2 * np.take_along_axis(size, leader[None], axis=0)[0] - np.sum(size, axis=0)
            led = ahead > change
            turn = change + evaluate(turning[row], high) * pieces.length
            short = turn < 0.99 * np.sum(np.abs(pieces.total), axis=0)
            done = led | short | (pieces.length <= _NEAR * high)
            yield pieces.where(done), np.where(led, leader, -1)[done]
            few = np.bincount(row[~done], minlength=len(self.c)) <= _MOST // len(self.c)
            yield pieces.where(~done & ~few[row]), np.full(np.count_nonzero(~done & ~few[row]), UNKNOWN)
            pieces = self.cut(pieces.where(~done & few[row]))

    def change_of_argument(self) -> Array:
        """Change of argument (rad) of each sum along the whole axis, (rows,); NaN where pieces are too many."""
        total = np.zeros(len(self.c))
        for pieces, leader in self.resolved_pieces():
            which = np.maximum(leader, 0)
            lead = np.take_along_axis(pieces.terms, which[None, None], axis=1)[:, 0]
            late = self.h[pieces.row, which]
            beside = np.angle(pieces.total / (lead * np.exp(-1j * late * pieces.omega)))
            led = np.angle(lead[1] / lead[0]) - late * pieces.length + beside[1] - beside[0]
            angle = np.where(leader < 0, np.angle(pieces.total[1] / pieces.total[0]), led)
            total[pieces.row[leader == UNKNOWN]] = np.nan
            total += np.bincount(pieces.row, weights=np.where(np.isfinite(angle), angle, 0.0), minlength=len(total))
        return total


def count_by_argument(c: Array, h: Array) -> NDArray[np.int64]:
    """Number of roots right of the axis of sums c (rows, m, n+1) with delays h (rows, m).

    `UNKNOWN` where counting takes too long. By the argument principle the number is n/2 minus the change of argument
    along the positive imaginary axis over π.
    """
    axis = SumsOnAxis(c, h)
    present = np.any(c != 0, axis=1)
    top = c.shape[-1] - 1 - np.argmax(present[:, ::-1], axis=-1)
    end = np.array([[bound_on_axis(one)] for one in c])
    rows = np.arange(len(c))
    last = axis.at(rows, end[:, 0])[1]
    beyond = np.angle(1j ** (top % 4) * c[rows, 0, top] / last)  # there the highest power leads by less than π/2
    found = top / 2 - (axis.change_of_argument() + beyond) / np.pi
    return np.asarray(np.where(np.isnan(found), UNKNOWN, np.rint(found)), dtype=np.int64)
