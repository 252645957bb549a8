"""Pseudo-arclength continuation: follow the curve of solutions of n equations in n + 1 unknowns.

Independent of the meaning of the equations. Unknowns are expected to be of order one (the caller scales them).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array

Equations = Callable[[Array], tuple[Array, Array]]
"""Function of u (n+1,): residuals (n,) and their Jacobian (n, n+1). May raise `Failure`."""
MOST_ITERATIONS = 10  # limit of Newton iterations for one point
ASIDE = 10.0  # intermediate Newton iterates must stay within this many times `reach` of the guess
NEARLY = 1e-5  # steps below this size may grow without counting as divergence, and end Broyden's method
CHORDS = 8  # limit of iterations with an earlier Jacobian: beyond it, a new Jacobian takes less time
GROW, FASTER, SHRINK = (
    1.4,
    2.0,
    0.4,
)  # factors by which the step changes after a quick, a straight and a failed step; chosen by trial


class Failure(ArithmeticError):
    """The equations cannot be evaluated here, or Newton's method does not converge."""


@dataclass(frozen=True, eq=False)
class Point:
    """A solution on the curve, the unit tangent there, and the arclength from the start.

    `rounding` is the error of the last unknown, the parameter, by rounding in the equations; 0 where Newton's method
    converged to its tolerance.
    """

    u: Array
    tangent: Array
    length: float
    iterations: int
    rounding: float = 0.0


class SolutionCurve:
    """A curve of solutions, followed by pseudo-arclength continuation.

    Parameters
    ----------
    equations : callable
    tolerance : float
        Size of the last Newton step that counts as converged, relative to unknowns that exceed one.
    most_turn : float
        Cosine of the largest angle between tangents of neighbouring points.
    weights : ndarray (n+1,), optional
        Weights of the squared unknowns in lengths and angles; 1 by default.
    rounding : float, optional
        Newton steps below this size count as converged once they no longer shrink: rounding in the equations.
    residuals : callable, optional
        Function of u for the residuals (n,) alone, if that takes far less time than with their Jacobian: iterations
        then begin with the Jacobian of the point before.
    jacobian : ndarray (n, n+1), optional
        Jacobian at a nearby point, to begin with.
    improved : callable, optional
        Function of the predicted point (n+1,) and the distance that it may be moved; returns a better prediction.
    """

    def __init__(
        self, equations: Equations, tolerance: float = 1e-9, most_turn: float = 0.94, weights: Array | None = None,
        rounding: float = 0.0, residuals: Callable[[Array], Array] | None = None, jacobian: Array | None = None,
        improved: Callable[[Array, float], Array] | None = None,
    ) -> None:  # fmt: skip
        self.equations, self.tolerance, self.most_turn = equations, tolerance, most_turn
        self.rounding, self.residuals, self.jacobian, self.improved = rounding, residuals, jacobian, improved
        self.weights: Any = 1.0 if weights is None else weights
        self.bend = float(np.sqrt((1 - most_turn) / (1 + most_turn)))
        """tan of half the largest angle: distance from its tangent, per length, of an arc that turns by this angle."""

    def size(self, u: Array) -> float:
        """Weighted length of a difference of unknowns (n+1,)."""
        return float(np.sqrt(np.sum(self.weights * u * u)))

    def start(self, guess: Array, tangent: Array) -> Point:
        """Solution in the plane through `guess` normal to `tangent`; the tangent there is oriented as `tangent`."""
        return self.corrected(guess, tangent, 0.0)

    def corrected(self, guess: Array, tangent: Array, length: float, reach: float = np.inf) -> Point:
        """Solution, by Newton's method, in the plane through `guess` normal to `tangent`; `length` is its arclength.

        Raises
        ------
        Failure
            If it does not converge within `reach` of the guess: a farther solution would be on another curve.
        """
        across = self.weights * tangent
        u, before = guess.copy(), np.inf
        for iteration in range(MOST_ITERATIONS):
            if before > NEARLY:
                u, before = self._approached(u, before, guess, across, ASIDE * reach)
            residual, jacobian = self.equations(u)
            self.jacobian = jacobian
            matrix = np.vstack([jacobian, across])
            right = np.append(residual, across @ (u - guess))
            try:
                step = np.linalg.solve(matrix, right)
            except np.linalg.LinAlgError as error:
                raise Failure("the Jacobian is singular") from error
            if not np.all(np.isfinite(step)):
                raise Failure("a Newton step is not finite")
            u = u - step
            size = float(np.max(np.abs(step) / np.maximum(1.0, np.abs(u))))
            stagnant = size > 0.3 * before
            rounded = stagnant and iteration > 2 and size <= self.rounding
            converged = size <= self.tolerance or (size < 10 * self.tolerance and stagnant) or rounded
            if self.size(u - guess) > (reach if converged else ASIDE * reach):
                raise Failure("Newton's method leads too far from the predicted point")
            if converged:
                along = np.zeros(len(u))
                along[-1] = 1.0
                direction = np.linalg.solve(matrix, along)
                blurred = abs(float(step[-1])) if size > 10 * self.tolerance else 0.0
                return Point(u, direction / self.size(direction), length, iteration + 1, blurred)
            if size > 2.0 * max(before, NEARLY) and iteration > 2:
                break
            before = size
        raise Failure("Newton's method does not converge")

    def _approached(self, start: Array, moved: float, guess: Array, across: Array, reach: float) -> tuple[Array, float]:
        """Approximate solution by Broyden's method from the last Jacobian, and the size of its last step.

        If the method does not converge, `start` is returned, and the size `moved` of the step that led to `start`.
        """
        if self.residuals is None or self.jacobian is None:
            return start, moved
        u, size = start, np.inf
        with suppress(Failure, np.linalg.LinAlgError):
            inverse = np.linalg.inv(np.vstack([self.jacobian, across]))
            left = np.append(self.residuals(u), across @ (u - guess))
            for _ in range(CHORDS):
                step = -inverse @ left
                before, size = size, float(np.max(np.abs(step) / np.maximum(1.0, np.abs(u))))
                if not size < before or self.size(u + step - guess) > reach:
                    size = before
                    break
                u = u + step
                if size <= self.tolerance:
                    break
                now = np.append(self.residuals(u), across @ (u - guess))
                change = inverse @ (now - left)
                inverse += np.outer(step - change, step @ inverse) / (step @ change)
                left = now
        return (u, size) if size < NEARLY else (start, moved)

    def follow(
        self, first: Point, step: float, least: float, most: float, accept: Callable[[Point], None] | None = None
    ) -> Iterator[Point]:
        """Yield points along the curve that begins at `first`; `first` itself is not yielded.

        A point continues the curve only if its tangent turns by no more than `most_turn` from that of the point before,
        and if it lies no farther from that tangent than an arc with this turn. It is predicted on the parabola through
        the last two tangents: with strong curvature, steps along the tangent alone would stay tiny.

        Parameters
        ----------
        step, least, most : float
            First, smallest and largest step of arclength; a fifth of the largest unknown is allowed where that is more.
        accept : callable, optional
            Function of a point that raises `Failure` to refuse it for other reasons.

        Raises
        ------
        Failure
            If a step would have to be smaller than `least`.
        """
        here, curvature = first, np.zeros(len(first.u))
        while True:
            try:
                reach = self.bend * step + 100 * self.tolerance
                guess = here.u + step * here.tangent + 0.5 * step**2 * curvature
                guess = guess if self.improved is None else self.improved(guess, reach)
                ahead = self.corrected(guess, here.tangent, here.length + step, reach)
                turned = float(ahead.tangent @ (self.weights * here.tangent))
                if turned < self.most_turn and step > 4 * least:
                    raise Failure("the curve turns too sharply")
                if accept is not None:
                    accept(ahead)
            except Failure:
                step *= SHRINK
                if step < least:
                    raise
                continue
            yield ahead
            if ahead.iterations <= 4 and turned > 1 - 0.3 * (1 - self.most_turn):
                straight = turned > 1 - 0.02 * (1 - self.most_turn)
                step = min(step * (FASTER if straight else GROW), max(most, 0.2 * float(np.max(np.abs(ahead.u)))))
            elif ahead.iterations > 6:
                step *= 0.7
            curvature = (ahead.tangent - here.tangent) / (ahead.length - here.length)
            curvature -= ahead.tangent * (ahead.tangent @ (self.weights * curvature))
            here = ahead

    def located(
        self, low: Point, high: Point, measure: Callable[[Point], float], at_low: float, at_high: float,
        width: float = 1e-11,
    ) -> tuple[Point, Point]:  # fmt: skip
        """Two points of the curve between which `measure` is zero (Illinois method); the second is closer to the zero.

        Raises
        ------
        Failure
            If a point between the two cannot be found.
        """
        a, b, side = 0.0, float((self.weights * low.tangent) @ (high.u - low.u)), 0  # distance between the planes
        near, far = low, high
        reach = 2 * self.bend * abs(b) + 100 * self.tolerance
        for _ in range(60):
            rise = at_high - at_low  # 0 where both values of `measure` are only rounding errors
            s = b - at_high * (b - a) / rise if rise else a
            if not a < s < b:
                s = 0.5 * (a + b)
            middle = self.corrected(self._between(low, near, far, s), low.tangent, low.length + s, reach)
            value = measure(middle)
            if (value > 0) == (at_low > 0):
                a, at_low, near = s, value, middle
                at_high = at_high / 2 if side == 1 else at_high
                side = 1
            else:
                b, at_high, far = s, value, middle
                at_low = at_low / 2 if side == -1 else at_low
                side = -1
            if value == 0 or b - a <= width * (1 + abs(low.length)):
                break
        return (near, far) if side == -1 else (far, near)

    def _between(self, low: Point, near: Point, far: Point, s: float) -> Array:
        """Predicted unknowns (n+1,) at distance `s` along the tangent of `low`, on a cubic through two points."""
        across = self.weights * low.tangent
        a, b = (float(across @ (one.u - low.u)) for one in (near, far))
        share, chord = (s - a) / (b - a), far.u - near.u
        bends = [(b - a) * one.tangent / float(across @ one.tangent) - chord for one in (near, far)]
        if not max(map(self.size, bends)) < self.size(chord):
            bends = [0.0 * chord] * 2
        guess: Array = near.u + share * chord + share * (1 - share) * ((1 - share) * bends[0] - share * bends[1])
        return guess


def turned_round(point: Point) -> Point:
    """Copy of a point with reversed tangent and arclength, to follow the curve the other way."""
    return replace(point, tangent=-point.tangent, length=-point.length)
