"""Decide outcomes close to an edge of stability from the drift in single turns, without simulating thousands.

Close to an edge the distance |q| from steady sliding (see `neighbourhood`) changes by parts in thousands or millions a
turn, and oscillates by more within one.

If all modes but the slowest pair decay within a turn, motion takes place on a surface. Motions are simulated from
points on a ray out of steady sliding until they cross the ray again (after a first turn that brings them onto the
surface). Orbits on a surface do not cross: up to the first point that does not come back nearer, every motion returns.
Points that come back farther form a band through which motion is carried outwards; if motions from one turn's worth of
points at its outer end have one outcome, it is that of all motions in the band.

Other motions are left undecided; for most of these rigs the `neighbourhood` is large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.runner import STATUSES
from steadyslip.nonlinear.kicks.field import rates_at
from steadyslip.nonlinear.kicks.neighbourhood import LARGEST
from steadyslip.nonlinear.kicks.spans import CERTAIN, OPEN, RETURNS, MotionBatch, advanced_runs

DONE = STATUSES.index("done")
COUNT = 32  # number of shells between the ball of `neighbourhood` and a distance of a few natural sizes
FINE = 24  # number of shells between the last with inward and the first with outward drift, in each refinement
REFINED = 2  # number of refinements
NOISE = 25.0  # least significant drift in a turn, as a multiple of the tolerance per integration step
SHARE = 0.02  # least significant drift in a turn, as a share of the linear decay in a turn
POINTS = 16  # number of starting points on the outer rim of a band for the outcome beyond it
ROUNDS = 12  # limit of Newton iterations for the time of a turn
FLAT = 2.0  # if all other modes decay by more than this per radian, motion takes place on a surface
SLOW = 0.02  # if the leading mode decays by more than this per radian, simulation is as fast as shells


class Shells:
    """Shells around the steady sliding of some runs, computed on first use for each steady sliding.

    Parameters
    ----------
    runs : MotionBatch
    threads : int, optional
    fates : callable
        Returns the outcomes of runs from given states: ``fates(runs, threads, states)``, as `outcomes.outcomes_of`.
    """

    def __init__(
        self, runs: MotionBatch, threads: int | None, fates: Callable[[MotionBatch, int | None, Array], Array]
    ) -> None:  # fmt: skip
        self.runs, self.threads, self.fates = runs, threads, fates
        count = len(runs.rest.velocity)
        roots = runs.rest.roots
        with np.errstate(invalid="ignore"):
            others = np.sort(roots.real, axis=1)[:, :-2]
            self.flat = np.all(others < -FLAT * np.abs(runs.rest.leading.imag)[:, None], axis=1)
        self.known = np.zeros(count, dtype=bool)
        self.inner = np.zeros(count)  # radius up to which every motion returns
        self.band = np.tile([np.inf, -np.inf], (count, 1))  # inner and outer radius of the band
        self.fate_known = np.zeros(count, dtype=bool)  # True where `beyond` has been computed
        self.beyond = np.full(count, OPEN)  # outcome of motions in the band

    def outcomes(self, which: Array, states: Array) -> Array:
        """Outcomes (k,) of runs `which` at `states` (k, n) as far as shells decide them; else OPEN."""
        group = self.runs.group[which]
        self._ensure_computed(np.unique(group))
        useful = (self.inner[group] > 0) | (self.band[group, 0] < self.band[group, 1])
        away = np.full(len(which), np.inf)
        if useful.any():
            away[useful] = self._on_ray(which[useful], states[useful])
        found = np.where(away < self.inner[group], RETURNS, OPEN)
        inside = (away > self.band[group, 0]) & (away < self.band[group, 1])
        for one in np.unique(group[inside & ~self.fate_known[group]]):  # slow: only for bands with a motion
            fate = self._fate(one, self.band[one, 1])
            self.fate_known[one], self.beyond[one] = True, fate if fate in CERTAIN else OPEN
        return np.where(inside, self.beyond[group], found)

    def _ensure_computed(self, group: Array) -> None:
        """Compute the shells of some rigs, unless they are known or useless.

        They are useless where simulation is as fast, or where motion does not take place on a surface.
        """
        rest, near = self.runs.rest, self.runs.near
        group = group[~self.known[group]]
        self.known[group] = True
        leading = rest.leading[group]
        with np.errstate(invalid="ignore"):
            slow = rest.stable[group] & (np.abs(leading.real) < SLOW * np.abs(leading.imag))
        group = group[slow & self.flat[group]]
        group = group[near.computed(group) > 0]
        if len(group):
            self._compute(group)

    def _compute(self, group: Array) -> None:
        """Compute inner radius and band of some of the rigs."""
        near, leading = self.runs.near, self.runs.rest.leading[group]
        with np.errstate(divide="ignore"):
            blurred = NOISE * self.runs.jobs.options.rtol * np.abs(leading.imag / (2 * np.pi * leading.real))
        radii = np.geomspace(np.clip(blurred, near.radius[group], 0.5 * LARGEST), LARGEST, COUNT, axis=1)
        falls, rises = self._drift(group, radii)
        falls[:, 0] |= radii[:, 0] == near.radius[group]  # the neighbourhood's ball itself
        clear = falls[:, 0]
        group, radii, falls, rises = group[clear], radii[clear], falls[clear], rises[clear]
        if not len(group):
            return
        inner, begin, end = _drifts(radii, falls, rises)
        for _ in range(REFINED):
            top = np.where(np.isfinite(begin), begin, np.minimum(2 * inner, LARGEST))
            fine = np.geomspace(inner, top, FINE, axis=1)
            falls, rises = self._drift(group, fine[:, 1:-1])
            ends = np.ones((len(group), 1), dtype=bool)
            falls = np.hstack([ends, falls, ~ends])
            rises = np.hstack([~ends, rises, np.isfinite(begin)[:, None]])
            inner, nearer, to = _drifts(fine, falls, rises)
            begin = np.where(to == fine[:, -1], nearer, begin)
        self.inner[group] = inner
        self.band[group] = np.column_stack([begin, end])

    def _drift(self, group: Array, radii: Array) -> tuple[Array, Array]:
        """Masks (k, r): where the distance falls, and where it rises, over a turn from radii (k, r) on the ray."""
        rest, near = self.runs.rest, self.runs.near
        n = rest.state.shape[1]
        away = radii[:, :, None] * near.basis[group][:, None, :, 0]
        states = (rest.state[group][:, None] + rest.scales[group][:, None] * away).reshape(-1, n)
        turn = 2 * np.pi / np.abs(rest.leading[group].imag)
        lane, each = np.repeat(group, radii.shape[1]), np.repeat(turn, radii.shape[1])
        begin = radii.ravel()
        end, states = self._to_ray(lane, states, each)
        if n > 2:  # the first turn has brought them onto the surface
            begin = end
            end, _ = self._to_ray(lane, states, each)
        least = SHARE * np.abs(rest.leading[group].real * turn)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            change = np.log(end / begin).reshape(radii.shape)
        return change < -least, change > least

    def _to_ray(self, which: Array, states: Array, guess: Array) -> tuple[Array, Array]:
        """Distances (k,) at which runs from `states` (k, n) cross the ray near times `guess` (k,), s, and states there.

        NaN where a run does not cross it. Distances are measured in the plane of the two slowest modes.
        """
        rest, near = self.runs.rest, self.runs.near
        time, radius, found = guess.copy(), np.full(len(which), np.nan), np.full_like(states, np.nan)
        todo = np.flatnonzero(np.all(np.isfinite(states), axis=1))
        for _ in range(ROUNDS):
            if not len(todo):
                break
            lane = which[todo]
            ended = advanced_runs(self.runs, lane, states[todo], time[todo], False, self.threads)
            q = near.coordinates(lane, ended.state)
            speed = rates_at(rest.part(lane), ended.state[:, None, :])[:, 0] / rest.scales[lane]
            back = np.einsum("kij,kj->ki", near.inverse[lane], speed)
            with np.errstate(all="ignore"):
                size = np.hypot(q[:, 0], q[:, 1])
                angle = np.arctan2(q[:, 1], q[:, 0])
                change = -angle * size**2 / (q[:, 0] * back[:, 1] - q[:, 1] * back[:, 0])
                met = (np.abs(angle) < 1e-9) & (size > 0)
                radius[todo[met]], found[todo[met]] = size[met], ended.state[met]
                span = 0.5 * guess[todo]
                good = np.isfinite(change) & ~met & (ended.status == DONE)
                time[todo] += np.where(good, np.clip(change, -0.3 * span, 0.3 * span), 0.0)
                good &= time[todo] > span
            todo = todo[good]
        return radius, found

    def _on_ray(self, which: Array, states: Array) -> Array:
        """Distance |q| (k,) at which runs from `states` (k, n) cross the ray next; inf where they do not cross it."""
        rest, near = self.runs.rest, self.runs.near
        q = near.coordinates(which, states)
        sense = self._sense(which)
        angle = np.mod(-sense * np.arctan2(q[:, 1], q[:, 0]), 2 * np.pi)  # angle that is left to the ray
        found, _ = self._to_ray(which, states, (angle + 2 * np.pi) / np.abs(rest.leading[which].imag))
        return np.where(np.isnan(found), np.inf, found)

    def _sense(self, which: Array) -> Array:
        """Sense of rotation in the plane of the first two modes: 1 from the first to the second, else −1."""
        rest, near = self.runs.rest, self.runs.near
        turned = near.inverse[which] @ rest.matrix[which] @ near.basis[which]
        return np.asarray(np.sign(turned[:, 1, 0]))

    def _fate(self, one: int, radius: float) -> int:
        """Common outcome of motions from the outer edge of a band, at all phases of a turn; OPEN if outcomes differ."""
        rest, near = self.runs.rest, self.runs.near
        turn = 2 * np.pi / np.abs(rest.leading[one : one + 1].imag)
        ray = near.basis[one][:, 0]
        start = (rest.state[one] + rest.scales[one] * radius * ray)[None]
        after = float(self._to_ray(np.array([one]), start, turn)[0][0])
        if not after > radius:
            return OPEN
        states = rest.state[one] + rest.scales[one] * np.geomspace(radius, after, POINTS)[:, None] * ray
        found = self.fates(self.runs.repeated(one, POINTS), self.threads, states)
        return int(found[0]) if np.all(found == found[0]) else OPEN


def _drifts(radii: Array, falls: Array, rises: Array) -> tuple[Array, Array, Array]:
    """Radius up to which distances fall, and first and last radius at which they rise (inf if none), (k,) each.

    `radii` (k, r) are in rising order; `falls` and `rises` (k, r) are True where the distance falls or rises in a turn.
    """
    count, each = radii.shape[1], np.arange(len(radii))
    last = np.argmin(np.column_stack([falls, np.zeros(len(radii), dtype=bool)]), axis=1) - 1
    beyond = rises & (np.arange(count) > last[:, None])
    first = np.argmax(beyond, axis=1)
    after = np.column_stack([beyond, np.zeros(len(radii), dtype=bool)]) | (np.arange(count + 1) < first[:, None])
    end = np.argmin(after, axis=1) - 1
    some = beyond.any(axis=1)
    begin = np.where(some, radii[each, first], np.inf)
    return radii[each, np.maximum(last, 0)], begin, np.where(some, radii[each, end], np.inf)
