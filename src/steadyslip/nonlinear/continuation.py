"""Pseudo-arclength continuation: follow the curve of solutions of n equations in n + 1 unknowns.

Nothing here knows what the equations mean. Unknowns are expected to be of order one (the caller scales them).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from steadyslip.core.arrays import Array

Equations = Callable[[Array], tuple[Array, Array]]
"""u (n+1,) to residuals (n,) and their Jacobian (n, n+1). May raise `Failure`."""
MOST_ITERATIONS = 10  # of Newton's method for one point
ASIDE = 10.0  # factor of `reach` by which intermediate Newton iterates may be farther away
ALIKE = 1e-6  # residuals, of the order of unknowns, below which a solution by residuals alone is one
BEYOND = 1e100  # Newton step that counts as infinite: its square is still a number
NEARLY = 1e-5  # Newton step below which one larger step may follow
MOST_STEPS = 60  # of the search for one zero
CHORDS = 8  # iterations with an earlier Jacobian: where more are needed, a new one is worth its time
LONGER, SHRINK = 2.0, 0.4  # largest factor of the step after a point, and the factor after a failure; chosen by trial
ORDER = 2  # of the error of prediction as a share of the step: a parabola misses by the third power
CONTRACT = 0.5  # ratio wanted of the first two steps of Newton's method
FAR = 1.0  # step beyond which a point may be no farther from its prediction: unknowns are of order one
PAST = 1.1  # share of a step that leaves the range, of the part that lies in it
TURN, OFF = (
    0.55,
    0.15,
)  # shares wanted of the largest turn, and of the largest distance from the prediction to the point


class Failure(ArithmeticError):
    """The equations cannot be evaluated here, or Newton's method does not converge."""


@dataclass(frozen=True, eq=False)
class Point:
    """A solution on the curve, the unit tangent there, and the length of curve since the start.

    `rounding` is how much the last unknown, the parameter, is blurred by rounding in the equations, where that shows.
    `contraction` is the ratio of the first two steps of Newton's method; zero where these are near the solution.
    """

    u: Array
    tangent: Array
    length: float
    iterations: int
    rounding: float = 0.0
    contraction: float = 0.0


class SolutionCurve:
    """A curve of solutions, followed by pseudo-arclength continuation.

    Parameters
    ----------
    equations : callable
    tolerance : float
        Size of the last Newton step that counts as converged, relative to unknowns that exceed one.
    most_turn : float
        Largest angle (cosine) between tangents of neighbouring points.
    weights : ndarray (n+1,), optional
        Of the unknowns' squares in lengths and angles; one unless given.
    rounding : float, optional
        Size of Newton steps that counts as converged where they no longer shrink: rounding in the equations.
    residuals : callable, optional
        The residuals alone, where they take far less time than with their Jacobian: points are then approached with the
        Jacobian of the one before.
    jacobian : ndarray (n, n+1), optional
        At a point near by.
    improved : callable, optional
        Takes the prediction of a point, and how far it may be moved, and returns a better one.
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
        """tan of half the largest turn: how far an arc that turns by so much leaves its tangent, per length."""

    def size(self, u: Array) -> float:
        """Length of a difference of unknowns."""
        return float(np.sqrt(np.sum(self.weights * u * u)))

    def start(self, guess: Array, tangent: Array) -> Point:
        """Solve for the point nearest to a guess, in the plane across `tangent`; its tangent points that way."""
        return self.corrected(guess, tangent, 0.0)

    def corrected(self, guess: Array, tangent: Array, length: float, reach: float = np.inf) -> Point:
        """Solve by Newton's method in the plane through `guess` across `tangent`.

        Raises
        ------
        Failure
            If it does not converge, or only farther than `reach` from the guess: on something else.
        """
        across = self.weights * tangent
        u, before, contraction, close, solved = guess.copy(), np.inf, 0.0, self.residuals is None, -1
        for iteration in range(MOST_ITERATIONS):
            if not close:
                u, before, close = self._approached(u, before, guess, across, ASIDE * reach)
                solved = iteration if close else solved
                if close and self.size(u - guess) > reach:
                    raise Failure("the equations lead elsewhere")
            residual, jacobian = self.equations(u)
            self.jacobian = jacobian
            matrix = np.vstack([jacobian, across])
            right = np.append(residual, across @ (u - guess))
            try:
                step = np.linalg.solve(matrix, right)
            except np.linalg.LinAlgError as error:
                raise Failure("singular") from error
            if not np.max(np.abs(step)) < BEYOND:
                raise Failure("not finite")
            size = self._largest(step, u)
            contraction = size / (before + NEARLY) if iteration == 1 else contraction
            # solved by residuals, from which these differ by errors of evaluation
            known = iteration == solved and size <= NEARLY and np.max(np.abs(residual)) <= ALIKE
            u = u if known else u - step
            size = min(before, self.tolerance) if known else size
            standing = size > 0.3 * before
            rounded = standing and iteration > 2 and size <= self.rounding
            converged = size <= self.tolerance or (size < 10 * self.tolerance and standing) or rounded
            if self.size(u - guess) > (reach if converged else ASIDE * reach):
                raise Failure("the equations lead elsewhere")
            if converged:
                along = np.zeros(len(u))
                along[-1] = 1.0
                direction = np.linalg.solve(matrix, along)
                blurred = abs(float(step[-1])) if size > 10 * self.tolerance else 0.0
                return Point(u, direction / self.size(direction), length, iteration + 1, blurred, contraction)
            if size > 2.0 * max(before, NEARLY) and iteration > 2:
                break
            before = size
        raise Failure("no convergence")

    def _approached(
        self, start: Array, moved: float, guess: Array, across: Array, reach: float
    ) -> tuple[Array, float, bool]:
        """Near the solution, from residuals and the last Jacobian, kept up by Broyden's rule; and the last step's size.

        `start` itself, and the step `moved` that led there, where that does not converge; last True where it does.
        """
        if self.residuals is None or self.jacobian is None:
            return start, moved, False
        u, size = start, np.inf
        with suppress(Failure, np.linalg.LinAlgError):
            inverse = np.linalg.inv(np.vstack([self.jacobian, across]))
            left = np.append(self.residuals(u), across @ (u - guess))
            for _ in range(CHORDS):
                step = -inverse @ left
                before, size = size, self._largest(step, u)
                if not size < before or self.size(u + step - guess) > reach:
                    size = before
                    break
                u = u + step
                if size <= self.tolerance:
                    return u, size, True
                now = np.append(self.residuals(u), across @ (u - guess))
                change = inverse @ (now - left)
                inverse += np.outer(step - change, step @ inverse) / (step @ change)
                left = now
        return (u, size, size <= 10 * self.tolerance) if size < NEARLY else (start, moved, False)

    @staticmethod
    def _largest(step: Array, u: Array) -> float:
        """Largest change of an unknown, relative to unknowns that exceed one."""
        return float(np.max(np.abs(step) / np.maximum(1.0, np.abs(u))))

    def follow(
        self, first: Point, step: float, least: float, most: float, accept: Callable[[Point], None] | None = None,
        limits: tuple[float, float] = (-np.inf, np.inf),
    ) -> Iterator[Point]:  # fmt: skip
        """Yield points along the curve from `first`, which is not among them.

        A point is taken for the continuation of the one before only if it is as close to its prediction as an arc would
        be to its tangent that turns no more than is allowed, and does turn no more. It is predicted by the parabola
        that the last two tangents make, and as much of the cubic through the last two points as would have been right
        for the last one: where equations are strongly bent, steps along the tangent alone would stay tiny. The next
        step is such that the turn, the error of prediction and Newton's contraction are what is wanted: continuous
        measures, so that rounding does not change where points lie. It is at most `LONGER` times the one before, and at
        most `most`, or a fifth of the largest unknown where that is more.

        Parameters
        ----------
        accept : callable, optional
            Raises `Failure` for points that are refused for other reasons.
        limits : tuple of float, optional
            Range of the last unknown: a step that would leave it by far is made shorter.

        Raises
        ------
        Failure
            Where steps of `least` no longer succeed.
        """
        before, here, cubic = first, first, 0.0
        while True:
            try:
                parabola, further = self._ahead(before, here, step)
                inside = min(max(parabola[-1], limits[0]), limits[1])
                if inside != parabola[-1] and limits[0] < here.u[-1] < limits[1]:
                    share = (inside - here.u[-1]) / (parabola[-1] - here.u[-1])
                    step = max(min(PAST * share, 1.0) * step, 4 * least)
                    parabola, further = self._ahead(before, here, step)
                reach = self.bend * min(step, FAR) + 100 * self.tolerance
                guess = parabola + cubic * further
                guess = guess if self.improved is None else self.improved(guess, reach)
                ahead = self.corrected(guess, here.tangent, here.length + step, reach)
                turned = float(ahead.tangent @ (self.weights * here.tangent))
                if turned < self.most_turn and step > 4 * least:
                    raise Failure("turns too sharply")
                if accept is not None:
                    accept(ahead)
            except Failure:
                step *= SHRINK
                if step < least:
                    raise
                continue
            yield ahead
            turn = np.arccos(min(turned, 1.0)) / np.arccos(self.most_turn)
            off = self.size(ahead.u - guess) / reach
            measures = turn / TURN, (off / OFF) ** (1 / ORDER), ahead.contraction / CONTRACT
            longer = min(LONGER, 1 / max(*measures, 1 / LONGER))
            step = min(step * longer, max(most, 0.2 * float(np.max(np.abs(ahead.u)))))
            size = self.size(further) ** 2
            best = float(further @ (self.weights * (ahead.u - parabola))) / size if size else 0.0
            before, here, cubic = here, ahead, min(max(best, 0.0), 1.0)

    def _ahead(self, before: Point, here: Point, step: float) -> tuple[Array, Array]:
        """Predict the point a step ahead: on the parabola of the last two tangents, and what the cubic adds to that.

        The cubic goes through both points along their tangents. Where the two points are one, the tangent is all.
        """
        back = before.u - here.u
        chord, turned = self.size(back), float(before.tangent @ (self.weights * here.tangent))
        straight = here.u + step * here.tangent
        if not (chord > 0 and turned > 0):
            return straight, 0 * straight
        arc = chord / np.sinc(0.5 * np.arccos(min(turned, 1.0)) / np.pi)  # of a circle
        rise, bend, share = back / arc + here.tangent, here.tangent - before.tangent, step / arc
        curved = 0.5 * (bend - here.tangent * (here.tangent @ (self.weights * bend)))
        parabola = straight + step * share * curved
        return parabola, step * share * (3 * rise - bend - curved + share * (2 * rise - bend))

    def located(
        self, low: Point, high: Point, measure: Callable[[Point], float], at_low: float, at_high: float,
        width: float = 1e-11,
    ) -> tuple[Point, Point]:  # fmt: skip
        """Bracket the zero of a function along the curve (Brent's method); the second point is the zero's.

        Raises
        ------
        Failure
            If a point between the two cannot be found.
        """
        end = float((self.weights * low.tangent) @ (high.u - low.u))  # as planes across are apart
        reach = 2 * self.bend * abs(end) + 100 * self.tolerance
        known = {0.0: (at_low, low), end: (at_high, high)}

        def value(s: float) -> float:
            if s not in known:
                near, far = _around(sorted(known), s)
                guess = self._between(low, known[near][1], known[far][1], s)
                middle = self.corrected(guess, low.tangent, low.length + s, reach)
                known[s] = measure(middle), middle
                if not np.isfinite(known[s][0]):
                    raise Failure("not finite")
            return known[s][0]

        zero = brentq(value, 0.0, end, xtol=width * (1 + abs(low.length)), maxiter=MOST_STEPS, disp=False)
        others = [s for s in known if (known[s][0] > 0) != (known[zero][0] > 0)] or [0.0, end]
        return known[min(others, key=lambda s: abs(s - zero))][1], known[zero][1]

    def at_share(self, low: Point, high: Point, share: float) -> Point:
        """Solve for the point between two at a share of the distance of their planes.

        Raises
        ------
        Failure
            If it is not found.
        """
        end = float((self.weights * low.tangent) @ (high.u - low.u))
        reach = 2 * self.bend * abs(end) + 100 * self.tolerance
        guess = self._between(low, low, high, share * end)
        return self.corrected(guess, low.tangent, low.length + share * (high.length - low.length), reach)

    def at_parameter(self, low: Point, high: Point, last: float, reach: float = np.inf) -> Point:
        """Solve for the point between two at which the last unknown, the parameter, has a value between theirs.

        Raises
        ------
        Failure
            If it is not found, or only farther than `reach` from its prediction.
        """
        end = float((self.weights * low.tangent) @ (high.u - low.u))
        share = brentq(lambda s: self._between(low, low, high, s * end)[-1] - last, 0.0, 1.0)
        guess = np.append(self._between(low, low, high, share * end)[:-1], last)
        length = low.length + share * (high.length - low.length)
        reach = min(reach, self.size(high.u - low.u))
        guess = guess if self.improved is None else self.improved(guess, reach)
        point = self.corrected(guess, np.eye(len(guess))[-1], length, reach)
        return point if point.tangent @ (self.weights * low.tangent) > 0 else replace(point, tangent=-point.tangent)

    def _between(self, low: Point, near: Point, far: Point, s: float) -> Array:
        """Predict the point at distance `s` along the tangent of `low`, on the cubic through two points."""
        across = self.weights * low.tangent
        a, b = (float(across @ (one.u - low.u)) for one in (near, far))
        share, chord = (s - a) / (b - a), far.u - near.u
        bends = [(b - a) * one.tangent / float(across @ one.tangent) - chord for one in (near, far)]
        if not max(map(self.size, bends)) < self.size(chord):
            bends = [0.0 * chord] * 2
        guess: Array = near.u + share * chord + share * (1 - share) * ((1 - share) * bends[0] - share * bends[1])
        return guess


def _around(known: list[float], s: float) -> tuple[float, float]:
    """Neighbours of a number in a sorted list."""
    i = int(np.searchsorted(known, s))
    return known[i - 1], known[i]


def turned_round(point: Point) -> Point:
    """Reverse a point: tangent and arclength change sign."""
    return replace(point, tangent=-point.tangent, length=-point.length)
