"""Count of roots right of the imaginary axis of sums of polynomials times exp(−sh), by the argument principle.

Where one term is larger than all other terms together, the argument of the sum follows that of this term, however long
the delays are. The axis needs to be resolved only near the few frequencies at which two terms are equal in size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.allowance import at_a_time, may_take
from steadyslip.linear.neutral import Sets, argument_at, bound_on_axis, highest, leads
from steadyslip.linear.roots import Array, ComplexArray, evaluate, quietly

UNKNOWN = -2  # stands for the number of roots where counting takes too long
_MOST = 400_000  # most unresolved pieces of the axis, of all rigs together; more would take too much memory (by trial)
_NEAR = 1e-13  # a piece shorter than this share of its frequency is not cut further: a root lies on it, to rounding


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces of the imaginary axis.

    Arrays are the index of the rig (pieces,) and, for both ends of each piece, the frequency (2, pieces), the terms
    without their factors e^(−sh), (2, m, pieces), and their sum with these factors (2, pieces).

    Arrays are the index of the rig (pieces,) and, at both ends of a piece, the frequency (2, pieces), the terms without
    their factors e^(−sh), (2, m, pieces), and their sum with these factors (2, pieces).
    """

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
    """Sums (rows, m, n+1) with delays (rows, m) on the positive imaginary axis, from zero to an upper bound of roots.

    `sets` (m, d) is True where a delay acts in a term; the highest power must not be able to vanish (`neutral`).

    The axis is cut until the change of argument on each piece is known. Either one term is larger than all other terms
    together: the argument of the sum then follows the argument of that term, with a difference of less than π/2 at
    either end, whatever the delays. Or the sum cannot wind around zero on the piece: its path is at most as long as the
    piece times the largest slope; if that is less than the sum of the sizes at both ends, path and chord pass zero on
    one side.
    """

    c: Array
    h: Array
    sets: Sets

    def at(self, row: NDArray[np.int64], omega: Array) -> tuple[ComplexArray, ComplexArray]:
        """The terms at s = iω without their factors exp(−sh), (m, frequencies), and their sum with them."""
        terms = np.array([evaluate(self.c[row, j], 1j * omega) for j in range(self.c.shape[1])])
        late = (p * np.exp(-1j * self.h[row, j + 1] * omega) for j, p in enumerate(terms[1:]))
        return terms, np.asarray(terms[0] + sum(late))

    def whole(self) -> _Pieces:
        shares = np.append(0.0, np.geomspace(1e-9, 1.0, 120))
        omega = bound_on_axis(self.c, self.sets)[:, None] * shares
        row = np.broadcast_to(np.arange(len(self.c))[:, None], omega.shape)
        found = self.at(row.ravel(), omega.ravel())
        both = [
            np.stack([part[..., :-1], part[..., 1:]]).reshape(2, *part.shape[:-2], -1)
            for part in (omega, *(one.reshape(*one.shape[:-1], *omega.shape) for one in found))
        ]
        return _Pieces(row[:, 1:].ravel(), *both)

    def cut(self, old: _Pieces) -> _Pieces:
        """Two pieces for each piece, which is cut in the middle."""
        middle = 0.5 * (old.omega[0] + old.omega[1])
        parts = zip((old.omega, old.terms, old.total), (middle, *self.at(old.row, middle)), strict=True)
        both = (np.concatenate([np.stack([own[0], new]), np.stack([new, own[1]])], axis=-1) for own, new in parts)
        return _Pieces(np.tile(old.row, 2), *both)

    def units(self, pieces: _Pieces) -> Iterator[tuple[Array, Array, Array]]:
        """Yield two units (2, pieces) by which terms are divided before they are compared: 1, and the highest power of
        ω. The second is for high frequencies. Each unit comes with two bounds (pieces,) of the slope of the sum: the
        part due to the polynomials, and the part due to the delays.

        """
        size, (_, top) = np.abs(self.c), highest(self.c)
        power, (low, high) = np.arange(size.shape[-1]), pieces.omega
        late, every = np.sum(size * self.h[..., None], axis=1), np.sum(size, axis=1)
        yield np.ones((2, len(low))), evaluate((every * power)[pieces.row, 1:], high), evaluate(late[pieces.row], high)
        at = top[:, None] - power  # coefficients in powers of 1/ω
        late, every = (
            np.where(at >= 0, np.take_along_axis(one, np.maximum(at, 0), axis=1), 0.0) for one in (late, every)
        )
        inverse, every = 1.0 / low, every * power
        steep = evaluate(every[pieces.row], inverse) * inverse
        yield pieces.omega ** top[pieces.row], steep, evaluate(late[pieces.row], inverse)

    def resolved_pieces(self) -> Iterator[tuple[_Pieces, NDArray[np.int64]]]:
        """Yield pieces with a known change of argument, with the index of the dominant term (−1 if no term dominates).

        For a rig that needs more pieces than are allowed, unresolved pieces have `UNKNOWN` instead of the index.
        """
        pieces = self.whole()
        while pieces.row.size:
            size = np.sum(np.abs(pieces.terms), axis=0)
            leader = np.argmax(size, axis=0)
            led, done = np.zeros((2, len(pieces.row)), dtype=bool)
            for unit, steep, turning in self.units(pieces):
                size = np.sum(np.abs(pieces.terms) / unit[:, None], axis=0)
                change = steep * pieces.length
                led |= 2 * np.take_along_axis(size, leader[None], axis=0)[0] - np.sum(size, axis=0) > change
                done |= change + turning * pieces.length < 0.99 * np.sum(np.abs(pieces.total) / unit, axis=0)
            row = pieces.row
            done |= led | (pieces.length <= _NEAR * pieces.omega[1])
            yield pieces.where(done), np.where(led, leader, -1)[done]
            terms = self.c.shape[1]
            few = np.bincount(row[~done], minlength=len(self.c)) <= at_a_time(_MOST * terms) // self.c[..., 0].size
            few &= may_take(np.count_nonzero(~done & few[row]) * terms)
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


@quietly
def count_by_argument(c: Array, h: Array, sets: Sets) -> NDArray[np.int64]:
    """Number of roots right of the axis of sums c (rows, m, n+1) with delays h (rows, m), combined as in `sets`.

    `UNKNOWN` where counting takes too long. By the argument principle the number is n/2 minus the change of argument
    along the positive imaginary axis over π. Above the bound of frequencies the argument of the sum differs by less
    than π/2 from that of the highest power of s, which for Re s to infinity becomes that of the term without delay.
    """
    coefficients, top = highest(c)
    end = bound_on_axis(c, sets)
    counted = np.flatnonzero(
        leads(c) | (end * np.max(h, axis=-1) < _MOST // len(c))
    )  # all other rigs would need more pieces of the axis than `_MOST`
    found = np.full(len(c), np.nan)
    c, h, end, top = c[counted], h[counted], end[counted], top[counted]
    axis = SumsOnAxis(c, h, sets)
    last = axis.at(np.arange(len(c)), end)[1]
    leading, turned = argument_at(coefficients[counted], h, sets, end)
    beyond = np.angle(1j ** (top % 4) * leading / last) - turned
    found[counted] = top / 2 - (axis.change_of_argument() + beyond) / np.pi
    return np.asarray(np.where(np.isnan(found), UNKNOWN, np.rint(found)), dtype=np.int64)
