"""Shooting equations: residual and Jacobian of a cycle over one or several segments of the period.

Unknowns are asinh(state/scale) at the start of each segment, the logarithm of the period, and the free parameter:
linear for small motions, logarithmic for large ones, so that branches over many decades are nearly straight.
The cycle starts where the block, accelerating, is as fast as the load point: every cycle has such a state, whatever its
size. Several segments are used where one would be too unstable.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly
from steadyslip.nonlinear.continuation import Failure, SolutionCurve
from steadyslip.nonlinear.orbits.flow import FlowRunner, FlowSetting, passages

ONE = np.ones(1)
ROUNDED = 300.0  # largest last Newton step, in rounding errors of the state, if steps no longer shrink
KNOWN = 1e-3  # bound of that last step as a share of the cycle's size
FAR = 0.1  # if the residual of a prediction is larger, its period is corrected before Newton's method is used
SAME = 1e-8  # cached sensitivities are used if unknowns differ by less than this, the largest last Newton step


@dataclass(frozen=True, eq=False)
class Orbit(ReadOnly):
    """Solution of the shooting equations: states at the segments' starts (K, n), period (s), parameter, shares (K,).

    `fractions` are the segments' shares of the period, `scales` (n,) those of the unknowns; natural sizes if None.
    """

    states: Array
    period: float
    value: float
    fractions: Array = field(default_factory=lambda: np.ones(1))
    scales: Array | None = None


class Shooting:
    """Shooting equations of a cycle, to be solved by `continuation.SolutionCurve`.

    Parameters
    ----------
    flow : FlowRunner
    fractions : ndarray (K,)
        Each segment's share of the period; they add up to one.
    logarithmic : bool
        True if the unknown is the logarithm of the parameter over `size`, False if it is their ratio.
    size : float
        Scale of the parameter, SI units.
    scales : ndarray (n,), optional
        Sizes of state variables below which unknowns are linear, above logarithmic; natural sizes by default.
    """

    def __init__(
        self, flow: FlowRunner, fractions: Array, logarithmic: bool, size: float, scales: Array | None = None
    ) -> None:  # fmt: skip
        self.flow, self.fractions = flow, fractions
        self.scales = flow.scales if scales is None else scales
        self.logarithmic, self.size = logarithmic, size
        self.amplitude = 1.0
        self._last: tuple[Array, Array, Array] | None = None
        self._jacobian: Array | None = None

    def curve(self) -> SolutionCurve:
        """Continuation curve of these equations.

        Lengths and angles along the curve count only the first state, the period and the parameter, because the other
        segments belong to the same cycle.
        """
        weights = np.ones(self.segments * self.flow.size + 2)
        weights[self.flow.size : -2] = 0.0
        tolerance = max(1e-9, 100 * self.flow.noise / self.amplitude)
        rounding = min(ROUNDED * self.flow.rounding, KNOWN * self.amplitude)
        return SolutionCurve(
            self.equations, tolerance, most_turn=0.8, weights=weights, rounding=rounding,
            residuals=self.residuals if self.flow.costly else None, jacobian=self._jacobian,
            improved=self.retimed if self.flow.costly else None,
        )  # fmt: skip

    @property
    def segments(self) -> int:
        """Number of shooting segments K."""
        return len(self.fractions)

    def packed(self, orbit: Orbit) -> Array:
        """Vector of unknowns (K n + 2,) of an orbit."""
        value = np.log(orbit.value / self.size) if self.logarithmic else orbit.value / self.size
        return np.append(np.arcsinh(orbit.states / self.scales).ravel(), [np.log(orbit.period / self.flow.time), value])

    def orbit(self, u: Array) -> Orbit:
        """Orbit of a vector of unknowns (K n + 2,): states, ln(period/natural time), parameter."""
        states = np.sinh(u[:-2].reshape(self.segments, self.flow.size)) * self.scales
        value = self.size * (np.exp(u[-1]) if self.logarithmic else u[-1])
        return Orbit(states, float(self.flow.time * np.exp(u[-2])), float(value), self.fractions, self.scales)

    def equations(self, u: Array) -> tuple[Array, Array]:
        """Residuals (K n + 1,) and Jacobian (K n + 1, K n + 2); see `continuation.Equations`."""
        flow, n, count = self.flow, self.flow.size, self.segments
        orbit, setting = self._tried(u)
        times = self.fractions * orbit.period
        ends, sensitivity, slopes = flow.run(setting, orbit.states, times, self.amplitude)
        start, gradient, across = flow.field(setting, orbit.states)
        rates = np.einsum(
            "kij,kj->ki", sensitivity, start
        )  # where mass is small, less noisy than the rates at the ends
        slip, speed = setting.slip, setting.speed
        to_unknown = (orbit.value if self.logarithmic else self.size) / setting.unit
        jacobian = np.zeros((count * n + 1, count * n + 2))
        stretch = self._stretch(orbit)
        for k in range(count):
            rows, after = slice(k * n, (k + 1) * n), (k + 1) % count
            size = stretch[after]
            jacobian[rows, rows] += sensitivity[k] * stretch[k] / size[:, None]
            jacobian[rows, after * n : (after + 1) * n] -= np.eye(n)
            jacobian[rows, -2] = rates[k] * times[k] / size
            jacobian[rows, -1] = slopes[k] * to_unknown / size
        jacobian[-1, :n] = slip @ gradient[0] * stretch[0] / speed
        jacobian[-1, -1] = slip @ across[0] * to_unknown / speed
        self._last, self._jacobian = (u, ends, sensitivity), jacobian
        return self._residual(orbit, setting, ends, start[0]), jacobian

    def residuals(self, u: Array) -> Array:
        """Residuals (K n + 1,) of unknowns (K n + 2,), without Jacobian."""
        orbit, setting = self._tried(u)
        ends = self.flow.ends(setting, orbit.states, self.fractions * orbit.period, self.amplitude)
        return self._residual(orbit, setting, ends, self.flow.field(setting, orbit.states[:1])[0][0])

    def retimed(self, u: Array, reach: float) -> Array:
        """Unknowns with the period of the nearest return of the motion to the load point's velocity, within `reach`.

        Slip may begin in seconds after a rest of minutes: a period off by a thousandth then ends before it or within
        it, where Newton's method fails. Returns `u` itself if its residuals are small.
        """
        if self.segments > 1 or np.max(np.abs(self.residuals(u))) < FAR:
            return u
        orbit, setting = self._tried(u)
        outcome = self.flow.watched(setting, orbit.states[0], orbit.period * np.exp(reach), self.amplitude)
        moved = np.log(np.append(passages(self.flow, setting, outcome.recorded)[0], np.inf) / orbit.period)
        nearest = float(moved[np.argmin(np.abs(moved))])
        return np.asarray(u + (nearest if abs(nearest) <= reach else 0.0) * np.eye(len(u))[-2])

    def _tried(self, u: Array) -> tuple[Orbit, FlowSetting]:
        """Orbit and kernel tables of unknowns; raises Failure if unknowns are too large."""
        if not np.all(np.isfinite(u)) or np.max(np.abs(u[:-1])) > 60 or (self.logarithmic and abs(u[-1]) > 60):
            raise Failure("the unknowns of a cycle leave the range of floating point")
        orbit = self.orbit(u)
        return orbit, self.flow.setting(orbit.value)

    def _residual(self, orbit: Orbit, setting: FlowSetting, ends: Array, start: Array) -> Array:
        """Residuals (K n + 1,): segments' ends minus next starts, scaled, and slip rate minus its target at `start`."""
        missed = (ends - np.roll(orbit.states, -1, axis=0)) / np.roll(self._stretch(orbit), -1, axis=0)
        return np.append(missed.ravel(), setting.slip @ start / setting.speed)

    def _stretch(self, orbit: Orbit) -> Array:
        """Derivatives of states with respect to their unknowns, (K, n)."""
        return np.asarray(np.hypot(self.scales, orbit.states))

    def multipliers(self, u: Array) -> tuple[float, Array]:
        """Trivial Floquet multiplier, and the others (n−1,); see the function `multipliers`."""
        orbit = self.orbit(u)
        rates, _, _ = self.flow.field(self.flow.setting(orbit.value), orbit.states)
        return multipliers(self.sensitivities(u), rates / self.flow.scales)

    def sensitivities(self, u: Array) -> Array:
        """Derivatives of each segment's end in its start, in natural sizes, (K, n, n)."""
        return np.asarray(self._run(u)[1] * self.flow.scales[None, :] / self.flow.scales[:, None])

    def forget(self) -> None:
        """Drop the cached results of the last integration."""
        self._last = None

    def _run(self, u: Array) -> tuple[Array, Array]:
        """Ends and sensitivities of the segments; cached for the latest unknowns, also within a last Newton step."""
        if self._last is None or np.max(np.abs(self._last[0] - u)) > SAME * self.flow.costly:
            orbit = self.orbit(u)
            times = self.fractions * orbit.period
            found = self.flow.run(self.flow.setting(orbit.value), orbit.states, times, self.amplitude)
            self._last = (u, found[0], found[1])
        return self._last[1:]


def multipliers(sensitivities: Array, rates: Array) -> tuple[float, Array]:
    """Floquet multipliers from sensitivities of consecutive segments (K, n, n) and rates at their starts (K, n).

    Returns
    -------
    trivial : float
        The multiplier along the motion, which is 1 apart from errors.
    others : ndarray (n-1,), complex
        The other multipliers, by falling size.

    Notes
    -----
    Sensitivities map the rates at one segment's start to those at the next. That direction is deflated first, so that
    another multiplier near 1 keeps its digits. In a strongly stable cycle (small mass) rounding of the state dominates
    the rates, and rates mapped from the segment before are more accurate; in an unstable one they are less: those with
    the trivial multiplier closer to 1 are used. The rest forms a block-cyclic matrix whose eigenvalues are the K-th
    roots of the multipliers, so that large and small ones keep their digits.
    """
    count, n, _ = sensitivities.shape
    carried = np.roll(np.einsum("kij,kj->ki", sensitivities, rates), 1, axis=0)
    trivial, along = min(
        ((_trivial(sensitivities, way), way) for way in (rates, carried)), key=lambda found: abs(found[0] - 1)
    )
    bases = [np.linalg.qr(way[:, None], mode="complete")[0][:, 1:] for way in along]
    cyclic = np.zeros((count * (n - 1), count * (n - 1)))
    for k in range(count):
        after = (k + 1) % count
        rows, columns = (slice(i * (n - 1), (i + 1) * (n - 1)) for i in (after, k))
        cyclic[rows, columns] = bases[after].T @ sensitivities[k] @ bases[k]
    if count == 1:
        found = np.linalg.eigvals(cyclic)
    else:
        powers = np.linalg.eigvals(cyclic) ** count
        order = np.argsort(-np.abs(powers))
        found = np.array([np.mean(powers[order[i * count : (i + 1) * count]]) for i in range(n - 1)])
    return trivial, np.asarray(found[np.argsort(-np.abs(found))], dtype=complex)


def _trivial(sensitivities: Array, along: Array) -> float:
    """Factor by which one period multiplies the direction of motion `along` (K, n): 1 apart from errors."""
    ends = np.einsum("kij,kj->ki", sensitivities, along)
    starts = np.roll(along, -1, axis=0)
    return float(np.prod(np.sum(starts * ends, axis=1) / np.sum(starts * starts, axis=1)))
