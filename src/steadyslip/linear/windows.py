"""Exact stable sets of machines with delay: of the delay itself, and of a parameter θ that enters linearly.

Of θ in P(s) + θ Q(s), both with delays, edges are θ = −P(iω)/Q(iω) where that is real, as without delay; ω follows from
a function that oscillates, so that there are ever more of them and the set is one of windows (theory 4, 10). Where it
changes sign is found along the axis; roots counted on both sides of every edge tell whether one was missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.polynomials import Array, StableSet, quietly, roots
from steadyslip.linear.quasi import count_right, crossing_delays, value

_PER_TURN = 24  # places on the axis for every turn of the longest delay
_PER_DECADE = 120
_TURNS = 100  # of an oscillation during the delay, beyond which windows are not looked for any more,
_MANY = 20_000  # where the rig itself has none so fast
_FINER = 4  # times as many places where an edge was missed, up to twice


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


def _of_cells(edges: Array, frequencies: Array, stable: NDArray[np.bool_]) -> StableSet:
    """Cells between candidates for edges, and whether each is stable, as a set."""
    changes = stable[1:] != stable[:-1]
    edges, frequencies = edges[changes], frequencies[changes]
    ends = np.concatenate([[0.0] if stable[0] else [], edges, [np.inf] if stable[-1] else []])
    return StableSet(ends.reshape(-1, 2), edges, frequencies, np.ones(len(edges), dtype=bool))


@quietly
def linear_windows(p: Array, q: Array, h: Array, low: float, high: float) -> StableSet | None:
    """Where P + θ Q is stable for θ from `low` to `high`, in between of which is the rig's own one.

    P and Q are (m, n+1), with delays h (m,). The range is cut where there may be windows without end. An interval
    that begins at `low`, or ends at an uncut `high`, is given as from zero, or to infinity. None where the delay is
    so long for the rig itself that its windows are too many.
    """
    scale = np.geomspace(low, high, 97)
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
    cut = [0.0 if start == low else start, np.inf if end == high else end]
    intervals = np.where(found.intervals == 0, cut[0], np.where(np.isinf(found.intervals), cut[1], found.intervals))
    return StableSet(intervals, found.edges, found.frequencies, found.changes)


def _windows(p: Array, q: Array, h: Array, low: float, high: float, fast: float) -> StableSet:
    finer = 1
    while True:
        theta, beta = _candidates(p, q, h, low, high, fast, finer)
        ends = np.concatenate([[low], theta, [high]])
        left, right = ends[:-1], ends[1:]
        probes = np.sqrt(left) * np.sqrt(right)
        near = (0.02, 0.98)
        counts = [_right(p, q, h, probes)] + [_right(p, q, h, left ** (1 - x) * right**x) for x in near]
        missed = np.any((counts[1] != counts[0]) | (counts[2] != counts[0]))
        if not missed or finer >= _FINER**2:
            break
        finer *= _FINER
    posed = _posed(p, q, probes)
    return _of_cells(theta, beta, (counts[0] == 0) & posed)


def _right(p: Array, q: Array, h: Array, theta: Array) -> NDArray[np.int64]:
    return count_right(p + theta[:, None, None] * q, h)


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


def _candidates(p: Array, q: Array, h: Array, low: float, high: float, fast: float, finer: int) -> tuple[Array, Array]:
    """Values of θ at which a root may be on the axis, rising, and the frequencies: zero, or infinite at the top."""
    longest = float(np.max(h))
    slow = np.geomspace(1e-9 * fast, fast, 9 * _PER_DECADE * finer)
    even = np.linspace(0.0, fast, int(_PER_TURN * finer * fast * longest / (2 * np.pi)) + 2)[1:]
    omega = np.unique(np.concatenate([slow, even]))

    def crossing(w: Array) -> Array:
        return np.asarray((value(p, h, 1j * w) * np.conj(value(q, h, 1j * w))).imag)

    at = crossing(omega)
    cells = np.flatnonzero(np.sign(at[1:]) * np.sign(at[:-1]) < 0)
    left, right, falls = omega[cells], omega[cells + 1], at[cells] > 0
    for _ in range(60):
        middle = 0.5 * (left + right)
        before = (crossing(middle) > 0) == falls
        left, right = np.where(before, middle, left), np.where(before, right, middle)
    beta = np.concatenate([0.5 * (left + right), omega[at == 0]])
    above, below = value(p, h, 1j * beta), value(q, h, 1j * beta)
    theta = -(above * np.conj(below)).real / np.abs(below) ** 2
    static = -np.sum(p[:, 0]) / np.sum(q[:, 0])
    tops = [-p[0, -1] / q[0, -1]]
    if len(p) == 2:
        tops += [-(p[0, -1] - p[1, -1]) / (q[0, -1] - q[1, -1]), -(p[0, -1] + p[1, -1]) / (q[0, -1] + q[1, -1])]
    theta = np.concatenate([theta, [static], tops])
    beta = np.concatenate([beta, [0.0], np.full(len(tops), np.inf)])
    inside = np.isfinite(theta) & (theta > low) & (theta < high)
    theta, beta = theta[inside], beta[inside]
    order = np.argsort(theta)
    theta, beta = theta[order], beta[order]
    apart = np.append(True, np.diff(theta) > 1e-12 * theta[1:]) if len(theta) else np.empty(0, dtype=bool)
    return theta[apart], beta[apart]
