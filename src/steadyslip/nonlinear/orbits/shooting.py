"""Shooting equations: residual and Jacobian of a cycle over one or several segments of the period.

Unknowns are asinh(state/scale) at the start of each segment, the logarithm of the period, and the free parameter:
linear for small motions, logarithmic for large ones, so that branches over many decades are nearly straight.
The cycle starts where the block, speeding up, is as fast as the load point: every cycle
passes there, whatever its size. Several segments are used where one would be too unstable.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly
from steadyslip.nonlinear.continuation import Failure, SolutionCurve
from steadyslip.nonlinear.orbits.flow import FlowRunner, FlowSetting, passages

ONE = np.ones(1)
ROUNDED = 300.0  # allowed last Newton step, in roundings of the state, where steps no longer shrink,
FAR = 0.1  # residual of a prediction that is off by more than the equations are straight
SAME = 1e-8  # difference of unknowns of which sensitivities are the same: the largest last Newton step
KNOWN = 1e-3  # but at most this share of the cycle's size


@dataclass(frozen=True, eq=False)
class Orbit(ReadOnly):
    """A cycle as the equations see it: states at the segment starts (K, n), period (s), parameter, shares (K,).

    `scales` (n,) are the sizes that its states were measured by; natural ones where there are none.
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
        Share of the period that each segment takes; they add up to one.
    logarithmic : bool
        Whether the parameter is positive and its logarithm the unknown.
    size : float
        Unit of the parameter otherwise.
    scales : ndarray (n,), optional
        Sizes of state variables beyond which unknowns count in logarithms; natural ones unless given.
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
        """Build the continuation curve of these equations.

        Its lengths and angles count the first state, period and parameter only: further segments are the same cycle.
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
        """Convert an orbit to the vector of unknowns (K n + 2,)."""
        value = np.log(orbit.value / self.size) if self.logarithmic else orbit.value / self.size
        return np.append(np.arcsinh(orbit.states / self.scales).ravel(), [np.log(orbit.period / self.flow.time), value])

    def orbit(self, u: Array) -> Orbit:
        """Convert a vector of unknowns (K n + 2,) to an orbit; the period comes from its last but one entry."""
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
        """Residuals (K n + 1,) alone."""
        orbit, setting = self._tried(u)
        ends = self.flow.ends(setting, orbit.states, self.fractions * orbit.period, self.amplitude)
        return self._residual(orbit, setting, ends, self.flow.field(setting, orbit.states[:1])[0][0])

    def retimed(self, u: Array, reach: float) -> Array:
        """The unknowns with the period after which the motion from their start is where cycles begin; itself if near.

        Between rests of minutes slip begins in seconds: a period that is wrong by a thousandth ends before or in it.
        """
        if self.segments > 1 or np.max(np.abs(self.residuals(u))) < FAR:
            return u
        orbit, setting = self._tried(u)
        outcome = self.flow.watched(setting, orbit.states[0], orbit.period * np.exp(reach), self.amplitude)
        moved = np.log(np.append(passages(self.flow, setting, outcome.recorded)[0], np.inf) / orbit.period)
        nearest = float(moved[np.argmin(np.abs(moved))])
        return np.asarray(u + (nearest if abs(nearest) <= reach else 0.0) * np.eye(len(u))[-2])

    def _tried(self, u: Array) -> tuple[Orbit, FlowSetting]:
        """Orbit and setting of unknowns; Failure where these are too large."""
        if not np.all(np.isfinite(u)) or np.max(np.abs(u[:-1])) > 60 or (self.logarithmic and abs(u[-1]) > 60):
            raise Failure("out of range")
        orbit = self.orbit(u)
        return orbit, self.flow.setting(orbit.value)

    def _residual(self, orbit: Orbit, setting: FlowSetting, ends: Array, start: Array) -> Array:
        """How far the segments' ends are from the next starts, and slip from constant speed at the first (`start`)."""
        missed = (ends - np.roll(orbit.states, -1, axis=0)) / np.roll(self._stretch(orbit), -1, axis=0)
        return np.append(missed.ravel(), setting.slip @ start / setting.speed)

    def _stretch(self, orbit: Orbit) -> Array:
        """Derivative of state with respect to unknown, (K, n)."""
        return np.asarray(np.hypot(self.scales, orbit.states))

    def multipliers(self, u: Array) -> tuple[float, Array]:
        """Trivial Floquet multiplier, and the others (n−1,); see the function `multipliers`."""
        orbit = self.orbit(u)
        rates, _, _ = self.flow.field(self.flow.setting(orbit.value), orbit.states)
        return multipliers(self.sensitivities(u), rates / self.flow.scales)

    def sensitivities(self, u: Array) -> Array:
        """Derivative of each segment's end in its start, in natural scales, (K, n, n)."""
        return np.asarray(self._run(u)[1] * self.flow.scales[None, :] / self.flow.scales[:, None])

    def forget(self) -> None:
        """Drop the cached integration."""
        self._last = None

    def _run(self, u: Array) -> tuple[Array, Array]:
        """Ends and sensitivities of the segments; those of the latest unknowns, a last Newton step away, are kept."""
        if self._last is None or np.max(np.abs(self._last[0] - u)) > SAME * self.flow.costly:
            orbit = self.orbit(u)
            times = self.fractions * orbit.period
            found = self.flow.run(self.flow.setting(orbit.value), orbit.states, times, self.amplitude)
            self._last = (u, found[0], found[1])
        return self._last[1:]


def multipliers(sensitivities: Array, rates: Array) -> tuple[float, Array]:
    """Floquet multipliers from the sensitivities of consecutive segments, and the rates where each starts.

    Returns
    -------
    trivial : float
        The multiplier of the direction of motion, 1 but for errors.
    others : ndarray (n-1,), complex
        By falling size.

    Notes
    -----
    Sensitivities carry the rates of one segment's start to those of the next. That direction is split off first, so
    that another multiplier near one keeps its digits. Where a cycle is very stable across (small mass), rounding in
    the state is most of the rates, and rates carried along from the segment before are true; where it is unstable
    they are worse. The multiplier tells which. Of what remains the block-cyclic matrix is formed, whose
    eigenvalues are the K-th roots of the multipliers: large and small ones keep their digits.
    """
    count, n, _ = sensitivities.shape
    carried = np.roll(np.einsum("kij,kj->ki", sensitivities, rates), 1, axis=0)
    trivial, along = min(
        ((_carried_round(sensitivities, way), way) for way in (rates, carried)), key=lambda found: abs(found[0] - 1)
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


def _carried_round(sensitivities: Array, along: Array) -> float:
    """Factor by which one period multiplies the direction of motion (1 but for errors)."""
    ends = np.einsum("kij,kj->ki", sensitivities, along)
    starts = np.roll(along, -1, axis=0)
    return float(np.prod(np.sum(starts * ends, axis=1) / np.sum(starts * starts, axis=1)))
