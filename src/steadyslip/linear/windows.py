"""Exact stable sets of machines with delay: of the delay itself, and of a parameter θ that enters linearly.

Of θ in P(s) + θ Q(s), both with delays, edges are θ = −P(iω)/Q(iω) where that is real, as without delay; ω follows from
a function that oscillates, so that there are ever more of them and the set is one of windows (theory 4, 10). Its zeros
are enclosed (`waves`), so that none is missed; between two neighbours one count of roots holds.

Of one delay θ among several, A(s) + B(s) exp(−sθ), roots are on the axis only at the ω with |A(iω)| = |B(iω)|, enclosed
in the same way, and cross to the right where |A| − |B| rises with ω.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.argument import bound_on_axis
from steadyslip.linear.polynomials import StableSet
from steadyslip.linear.quasi import (
    count_right,
    crossing_delays,
    in_own_time,
    outweighed,
    repeated,
    slope,
    value,
)
from steadyslip.linear.roots import Array, quietly, roots
from steadyslip.linear.waves import where_alike, where_real

_TURNS = 100  # of an oscillation during the delay, beyond which windows are not looked for any more,
_PLAIN = 1e-6  # share of a root's speed that leads it across the axis, below which it may as well run along it
_STEPS = 8  # a decade, at which it is asked where that begins
_MANY = 20_000  # where the rig itself has none so fast


def none() -> StableSet:
    """No edge and no stable interval."""
    return StableSet(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0, dtype=bool))


@quietly
def delay_set(p: Array, q: Array) -> StableSet:
    """Every delay h > 0 at which p(s) + q(s) exp(−sh) is stable."""
    top = int(np.flatnonzero((p != 0) | (q != 0))[-1])
    if abs(q[top]) >= abs(p[top]) or p[0] + q[0] == 0 or p[top] <= 0 or top < len(p) - 2:
        return none()
    delays, frequencies, directions = crossing_delays(p, q)
    right = np.sum(roots((p + q)[None])[0].real > 0) + np.concatenate([[0], np.cumsum(2 * directions)])
    return _of_cells(delays, frequencies, right == 0)


@quietly
def delay_set_among(c: Array, h: Array, late: NDArray[np.bool_]) -> StableSet | None:
    """Every value above zero of one delay, at which a sum with other delays is stable.

    `c` (m, n+1) are the coefficients of Σ p_j(s) exp(−s h_j), `h` (m,) the other delays, `late` (m,) says where the one
    that is sought comes on top of them. None where its edges cannot be told apart.
    """
    (scaled,), (others,), (rate,) = in_own_time(c[None], h[None])
    top = int(np.flatnonzero(np.any(c != 0, axis=0))[-1])
    if outweighed(scaled[None])[0] or np.sum(c[:, 0]) == 0 or c[0, top] <= 0 or top < c.shape[1] - 2:
        return none()
    start = int(count_right(scaled, others))
    parts = [(scaled[which], others[which]) for which in (~late, late)]
    zeros = where_alike(*parts[0], *parts[1]).zeros(bound_on_axis(scaled))
    if zeros is None:
        return None
    omega, direction = (one[zeros[1] != 0] for one in zeros)
    at_once, delayed = (value(*part, 1j * omega) for part in parts)
    phase = np.mod(np.angle(-delayed / at_once), 2 * np.pi)
    delays, frequencies, ways = repeated(omega[::-1], direction[::-1], np.where(phase == 0, 2 * np.pi, phase)[::-1])
    right = start + np.concatenate([[0], np.cumsum(2 * ways)])
    return _of_cells(delays / rate, frequencies * rate, right == 0)


def _of_cells(edges: Array, frequencies: Array, stable: NDArray[np.bool_]) -> StableSet:
    """Cells between candidates for edges, and whether each is stable, as a set."""
    changes = stable[1:] != stable[:-1]
    edges, frequencies = edges[changes], frequencies[changes]
    ends = np.concatenate([[0.0] if stable[0] else [], edges, [np.inf] if stable[-1] else []])
    return StableSet(ends.reshape(-1, 2), edges, frequencies, np.ones(len(edges), dtype=bool))


@quietly
def linear_windows(p: Array, q: Array, h: Array, low: float, high: float) -> StableSet | None:
    """Where P + θ Q is stable for θ from `low` to `high`, in between of which is the rig's own one.

    P and Q are (m, n+1), with delays h (m,). The range is cut where there may be windows without end, at the same
    places whatever it is. An interval that begins at `low`, or ends at an uncut `high`, is given as from zero, or to
    infinity. None where the delay is so long for the rig itself that its windows are too many.
    """
    scale = 10 ** (np.arange(np.floor(_STEPS * np.log10(low)), np.ceil(_STEPS * np.log10(high)) + 1) / _STEPS)
    low, high = float(scale[0]), float(scale[-1])
    bound = _fastest(p, q, scale)
    turn = 2 * np.pi / max(float(np.max(h)), 1e-300)
    own = float(np.interp(0.0, np.log(scale), bound))
    most = turn * max(_TURNS, 2 * own / turn)
    if not most < turn * _MANY:
        return None
    above, below = np.flatnonzero((bound > most) & (scale > 1)), np.flatnonzero((bound > most) & (scale < 1))
    end = high if not above.size else float(scale[above[0] - 1])
    start = low if not below.size else float(scale[below[-1] + 1])
    found = _windows(p, q, h, start, end, min(most, float(np.max(bound))))
    if found is None:
        return None
    cut = [0.0 if start == low else start, np.inf if end == high else end]
    intervals = np.where(found.intervals == 0, cut[0], np.where(np.isinf(found.intervals), cut[1], found.intervals))
    return StableSet(intervals, found.edges, found.frequencies, found.changes)


def _windows(p: Array, q: Array, h: Array, low: float, high: float, fast: float) -> StableSet | None:
    candidates = _candidates(p, q, h, low, high, fast)
    if candidates is None:
        return None
    theta, beta = candidates
    ends = np.concatenate([[low], theta, [high]])
    probes = np.sqrt(ends[:-1]) * np.sqrt(ends[1:])  # between two neighbours nothing crosses the axis
    count = _right if len(h) <= 2 else _right_by_crossings  # with one delay a count takes no time
    return _of_cells(theta, beta, (count(p, q, h, theta, beta, probes) == 0) & _posed(p, q, probes))


def _right(p: Array, q: Array, h: Array, theta: Array, beta: Array, probes: Array) -> NDArray[np.int64]:
    """Roots to the right, counted at every probe."""
    return count_right(p + probes[:, None, None] * q, h)


def _right_by_crossings(p: Array, q: Array, h: Array, theta: Array, beta: Array, probes: Array) -> NDArray[np.int64]:
    """The same from few counts: what crosses the axis between two probes does so as ds/dθ = −Q/(P' + θ Q') says.

    Where that is no plain crossing, roots are counted anew, and so they are at the last probe before: a row of
    crossings that does not lead from one count to the next is counted throughout.
    """
    s = 1j * np.where(np.isinf(beta), np.nan, beta)
    speed = -value(q, h, s) / (slope(p, h, s) + theta * slope(q, h, s))
    plain = np.isfinite(speed) & (np.abs(speed.real) > _PLAIN * np.abs(speed))
    steps = np.where(plain, np.sign(speed.real) * np.where(beta == 0, 1, 2), 0).astype(np.int64)
    first = np.concatenate([[0], np.flatnonzero(~plain) + 1])
    last = np.append(first[1:] - 1, len(theta))
    ends = np.unique(np.concatenate([first, last]))
    counted = np.full(len(probes), -1, dtype=np.int64)
    counted[ends] = _right(p, q, h, theta, beta, probes[ends])
    for a, b in zip(first, last, strict=True):
        found = counted[a] + np.concatenate([[0], np.cumsum(steps[a:b])])
        if found[-1] == counted[b] and np.all(found >= 0):
            counted[a : b + 1] = found
        else:
            counted[a : b + 1] = _right(p, q, h, theta, beta, probes[a : b + 1])
    return counted


def _posed(p: Array, q: Array, theta: Array) -> NDArray[np.bool_]:
    """Whether the undelayed part has a positive highest coefficient and has lost no more than its inertia."""
    c = p[0] + theta[:, None] * q[0]
    return np.asarray(np.where(c[:, -1] == 0, c[:, -2] > 0, c[:, -1] > 0))


def _fastest(p: Array, q: Array, theta: Array) -> Array:
    """For each θ a frequency that no root on the axis exceeds (Fujiwara); that of others where there is none."""
    size = np.abs(p + theta[:, None, None] * q)
    top = int(np.flatnonzero(np.any(size > 0, axis=(0, 1)))[-1])
    left = size[:, 0, top] - np.sum(size[:, 1:, top], axis=-1)
    left = np.where(left > 0, left, np.nan)
    total = np.sum(size[:, :, :top], axis=1)
    bound = 2 * np.max((total / left[:, None]) ** (1.0 / (top - np.arange(top))), axis=-1)
    return np.asarray(np.where(np.isfinite(bound), bound, np.nanmax(bound) if np.any(np.isfinite(bound)) else 1.0))


def _candidates(p: Array, q: Array, h: Array, low: float, high: float, fast: float) -> tuple[Array, Array] | None:
    """Values of θ at which a root may be on the axis, rising, and the frequencies: zero, or infinite at the top."""
    zeros = where_real(p, q, h).zeros(fast)
    if zeros is None:
        return None
    beta = zeros[0]
    above, below = value(p, h, 1j * beta), value(q, h, 1j * beta)
    theta = -(above * np.conj(below)).real / np.abs(below) ** 2
    static = -np.sum(p[:, 0]) / np.sum(q[:, 0])
    late = np.array(list(product((-1.0, 0.0, 1.0), repeat=len(p) - 1)))  # signs of what is delayed, in the highest
    tops = -(p[0, -1] + late @ p[1:, -1]) / (q[0, -1] + late @ q[1:, -1])
    theta = np.concatenate([theta, [static], tops])
    beta = np.concatenate([beta, [0.0], np.full(len(tops), np.inf)])
    inside = np.isfinite(theta) & (theta > low) & (theta < high)
    theta, beta = theta[inside], beta[inside]
    order = np.argsort(theta, kind="stable")
    theta, beta = theta[order], beta[order]
    apart = np.append(True, np.diff(theta) > 1e-12 * theta[1:]) if len(theta) else np.empty(0, dtype=bool)
    return theta[apart], beta[apart]
