"""Exact stable sets of machines with delay: of the delay itself, and of a parameter θ that enters linearly.

For θ in P(s) + θ Q(s), both with delays, edges are θ = −P(iω)/Q(iω) where that is real, as without delay. The ω are
zeros of a function that oscillates, so that the stable set consists of many windows (theory 4, 10). The zeros are
enclosed (`waves`), so that none is missed; between two neighbouring edges the number of unstable roots is constant.

For one delay θ among several, A(s) + B(s) exp(−sθ), roots are on the axis only at the ω with |A(iω)| = |B(iω)|, which
are enclosed by `waves` as well; roots cross to the right where |A| − |B| rises with ω.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.argument import UNKNOWN
from steadyslip.linear.crossing import is_ill_posed
from steadyslip.linear.neutral import Sets, bound_on_axis, can_vanish, corners, highest, leads
from steadyslip.linear.polynomials import StableSet, columns, squared_size
from steadyslip.linear.quasipolynomial import (
    count_right_if_feasible,
    crossing_delays,
    list_crossing_delays,
    nondimensional,
    slope,
    value,
)
from steadyslip.linear.roots import Array, quietly, roots
from steadyslip.linear.waves import difference_of_squares, im_of_product

# Limits of the search, chosen by trial: computing time against how many windows are found.
_TURNS = 100  # number of periods during the longest delay above which windows are not searched
_STEPS = 8  # number of values of θ per decade at which the highest possible frequency is estimated
_FEW = 8  # with more growing roots no stable window is assumed to be near (as in `search`)
_TOWARDS = 10.0 ** -np.arange(1, 9)  # relative distances of samples from a value at which equations become ill-posed
_CLOSE = 1e-3  # relative distance from an ill-posed value within which no other edge is assumed to lie
_HALVINGS = 50  # bisections of a bracket of an eighth of a decade, down to rounding
_SPARE = 0.1  # share of (undelayed term − sum of other terms) that is added to each weight, so that no weight is zero
_TIMES_CUT, _PIECES = 3, 4  # times that an interval of θ without frequency bound is cut, each time into 4 pieces
_ON_AXIS = 1e-3  # relative imaginary part up to which a root counts as real; rounding gives a double root some 1e-8
_MANY = 20_000  # number of periods during the longest delay, at the rig's value, above which the search is refused
_ROUNDING = 1e-12  # relative rounding error of edges θ
_CORNER = 1e-8  # relative rounding error of edges θ at which a root comes from infinity
_TOUCHED = 1e-7  # relative width up to which a window is rounding error of a root that touches the axis: ~sqrt(eps)
_PLAIN = 1e-6  # |Re ds/dθ| over |ds/dθ| below which a root may move along the axis; roots are then counted again


def empty_set() -> StableSet:
    """Stable set without edges and without stable intervals."""
    return StableSet(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0, dtype=bool))


@quietly
def delay_set(p: Array, q: Array, spare: int) -> StableSet:
    """Stable set of the delay h > 0 (s) of p(s) + q(s) exp(−sh), for one rig; `spare` highest powers may be missing."""
    top = int(np.flatnonzero((p != 0) | (q != 0))[-1])
    if abs(q[top]) >= abs(p[top]) or p[0] + q[0] == 0 or p[top] <= 0 or top < len(p) - 1 - spare:
        return empty_set()
    delays, frequencies, directions = crossing_delays(p, q)
    right = np.sum(roots((p + q)[None])[0].real > 0) + np.concatenate([[0], np.cumsum(2 * directions)])
    return _set_of_cells(delays, frequencies, right == 0)


@quietly
def delay_set_among(c: Array, h: Array, sets: Sets, late: NDArray[np.bool_], spare: int) -> StableSet | None:
    """Values of one delay θ > 0 (s) at which a rig with several delays is stable.

    None where edges are too many to separate.

    `c` (m, n+1) are the coefficients of Σ p_j(s) exp(−s h_j), `h` (m,) the delays without θ; `sets` (m, d) is True
    where a delay acts in a term, `late` (m,) where θ does. The `spare` highest powers may be missing.
    """
    (scaled,), (others,), (rate,) = nondimensional(c[None], h[None])
    top = int(np.flatnonzero(np.any(c != 0, axis=0))[-1])
    if can_vanish(scaled, sets) or np.sum(c[:, 0]) == 0 or c[0, top] <= 0 or top < c.shape[1] - 1 - spare:
        return empty_set()
    start = int(count_right_if_feasible(scaled, others, sets))
    if start == UNKNOWN:
        return None
    parts = [(scaled[which], others[which]) for which in (~late, late)]
    zeros = difference_of_squares(*parts[0], *parts[1]).zeros(float(bound_on_axis(scaled[None], sets)[0]))
    if zeros is None:
        return None
    omega, direction = (one[zeros[1] != 0] for one in zeros)
    at_once, delayed = (value(*part, 1j * omega) for part in parts)
    phase = np.mod(np.angle(-delayed / at_once), 2 * np.pi)
    delays, frequencies, ways = list_crossing_delays(
        omega[::-1], direction[::-1], np.where(phase == 0, 2 * np.pi, phase)[::-1]
    )
    right = start + np.concatenate([[0], np.cumsum(2 * ways)])
    return _set_of_cells(delays / rate, frequencies * rate, right == 0)


def _set_of_cells(edges: Array, frequencies: Array, stable: NDArray[np.bool_]) -> StableSet:
    """Stable set made of the cells between candidate edges (e,) with their frequencies.

    `stable` (e + 1,) is by cell.
    """
    changes = stable[1:] != stable[:-1]
    edges, frequencies = edges[changes], frequencies[changes]
    ends = np.concatenate([[0.0] if stable[0] else [], edges, [np.inf] if stable[-1] else []])
    return StableSet(ends.reshape(-1, 2), edges, frequencies, np.ones(len(edges), dtype=bool))


@quietly
def linear_windows(p: Array, q: Array, h: Array, low: float, high: float, sets: Sets, spare: int) -> StableSet | None:
    """Stable set of θ in P + θ Q between `low` and `high`, where θ = 1 is the parameter's value in the rig.

    P and Q are (m, n+1), with delays h (m,), combined as in `sets` (m, d); the `spare` highest powers may be missing.
    The set is known within `searched`, which ends before values with infinitely many windows, whatever the range. An
    interval that begins at `low` is extended to zero, an interval that ends at `high` to infinity. None if the delay is
    so long that there are too many windows already near θ = 1.
    """
    theta = 10 ** (np.arange(np.floor(_STEPS * np.log10(low)), np.ceil(_STEPS * np.log10(high)) + 1) / _STEPS)
    low, high = float(theta[0]), float(theta[-1])
    edges = _edges_of_ill_posed(p, q, sets, spare, theta)
    if len(h) <= 2:  # with one delay, roots are counted quickly even next to the edges
        beside = edges[:, None] * np.concatenate([1 - _TOWARDS, 1 + _TOWARDS])
        theta = np.unique(np.append(theta, beside[(beside > low) & (beside < high)]))
    lost = _ill_posed(p, q, sets, spare, theta)
    bound = np.where(lost, 0.0, _frequency_bound(p, q, sets, theta))
    turn = 2 * np.pi / max(float(np.max(h)), 1e-300)
    own = float(np.interp(0.0, np.log(theta), bound))
    most = turn * max(_TURNS, 2 * own / turn)
    if not most < turn * _MANY:
        return None
    start, end = _known(p, q, h, sets, theta, bound <= most, edges)
    fast = _largest_between(p, q, sets, theta[(theta >= start) & (theta <= end)])
    fast = max(float(np.max(bound[bound <= most])), min(fast, most))
    found = _windows(p, q, h, start, end, fast, sets, spare, edges)
    if found is None:
        return None
    cut = (0.0 if start == low else start, np.inf if end == high else end)
    intervals = np.where(found.intervals == 0, cut[0], np.where(np.isinf(found.intervals), cut[1], found.intervals))
    return StableSet(intervals, found.edges, found.frequencies, found.changes, cut)


def _ill_posed(p: Array, q: Array, sets: Sets, spare: int, theta: Array) -> NDArray[np.bool_]:
    """True for each θ (n,) at which the equations are ill-posed."""
    c = p + theta[:, None, None] * q
    return np.asarray(can_vanish(c, sets) | is_ill_posed(columns(c[:, 0]), spare))


def _edges_of_ill_posed(p: Array, q: Array, sets: Sets, spare: int, theta: Array) -> Array:
    """Values within the range of `theta` at which the equations become ill-posed; values from `corners` are exact."""
    top = int(np.flatnonzero(np.any((p != 0) | (q != 0), axis=0))[-1])
    tops = -(p[:, top] @ corners(sets)) / (q[:, top] @ corners(sets))
    tops = np.unique(tops[(tops > theta[0]) & (tops < theta[-1])])
    sides = _ill_posed(p, q, sets, spare, np.append(tops * (1 - _CORNER), tops * (1 + _CORNER))).reshape(2, -1)
    tops = tops[sides[0] != sides[1]]
    lost = _ill_posed(p, q, sets, spare, theta)
    at = np.flatnonzero(lost[1:] != lost[:-1])
    # without an exact edge between them
    at = at[np.searchsorted(tops, theta[at]) == np.searchsorted(tops, theta[at + 1])]
    left, right = theta[at], theta[at + 1]
    for _ in range(_HALVINGS if at.size else 0):
        middle = 0.5 * (left + right)
        before = _ill_posed(p, q, sets, spare, middle) == lost[at]
        left, right = np.where(before, middle, left), np.where(before, right, middle)
    return np.sort(np.append(tops, 0.5 * (left + right)))


def _known(
    p: Array, q: Array, h: Array, sets: Sets, theta: Array, known: NDArray[np.bool_], edges: Array
) -> tuple[float, float]:
    """Lowest and highest θ, below and above 1, between which all stable windows are known.

    Windows are known at samples `known`, whose oscillations are slow enough to be followed. At other samples roots are
    counted. Such a sample is accepted if many roots grow, so that nothing nearby is stable; or if a value at which the
    equations become ill-posed is so close, with as many roots as at the sample before, that no other edge can lie
    between. With several delays counts take too long there, and this is assumed within the distance of two samples.
    """
    ends, close = [], _CLOSE if len(h) <= 2 else 10 ** (1 / _STEPS) - 1
    for order in (np.arange(len(theta))[theta >= 1], np.arange(len(theta))[theta <= 1][::-1]):
        last, place = float(theta[order[0]]), int(order[0])
        for at in order:
            if not known[at]:
                near = np.min(np.abs(edges / theta[at] - 1), initial=np.inf)
                skipped = len(h) > 2 and near <= close
                count = UNKNOWN if skipped else int(count_right_if_feasible(p + theta[at] * q, h, sets))
                if count == UNKNOWN and near > close:
                    break
                if UNKNOWN < count <= _FEW:
                    before = int(count_right_if_feasible(p + theta[place] * q, h, sets))
                    if near > 2 * _TOWARDS[0] or (count == 0) != (before == 0):
                        break
            last, place = float(theta[at]), int(at)
        ends.append(last)
    return ends[1], ends[0]


def _windows(
    p: Array, q: Array, h: Array, low: float, high: float, fast: float, sets: Sets, spare: int, ill_posed: Array
) -> StableSet | None:
    candidates = _candidates(p, q, h, low, high, fast, ill_posed)
    if candidates is None:
        return None
    theta, beta = candidates
    ends = np.concatenate([[low], theta, [high]])
    probes = np.sqrt(ends[:-1]) * np.sqrt(ends[1:])  # one between each two neighbouring edges
    count = _count_each if len(h) <= 2 else _count_by_crossings  # with one delay counts are fast
    well_posed = ~is_ill_posed(columns(p[0] + probes[:, None] * q[0]), spare)
    right = count(p, q, h, sets, theta, beta, probes)
    if np.any(right == UNKNOWN):
        return None
    stable = (right == 0) & well_posed
    inner, before, after = stable[1:-1], stable[:-2], stable[2:]
    touched = (np.diff(theta) <= _TOUCHED * theta[1:]) & (before == after)
    stable[1:-1] = np.where(touched, before, inner)
    return _set_of_cells(theta, beta, stable)


def _count_each(
    p: Array, q: Array, h: Array, sets: Sets, theta: Array, beta: Array, probes: Array
) -> NDArray[np.int64]:
    """Number of roots right of the axis at every probe θ; `theta` and `beta` are not used."""
    return count_right_if_feasible(p + probes[:, None, None] * q, h, sets)


def _count_by_crossings(
    p: Array, q: Array, h: Array, sets: Sets, theta: Array, beta: Array, probes: Array
) -> NDArray[np.int64]:
    """Number of roots right of the axis at every probe θ, from counts at a few probes and from crossings between these.

    A root crosses the axis at (theta, i beta) with ds/dθ = −Q/(P' + θ Q'). Where the root may run along the axis,
    roots are counted on both sides. If the crossings between two counts do not explain their difference, roots are
    counted at every probe between them.
    """
    s = 1j * np.where(np.isinf(beta), np.nan, beta)
    speed = -value(q, h, s) / (slope(p, h, s) + theta * slope(q, h, s))
    plain = np.isfinite(speed) & (np.abs(speed.real) > _PLAIN * np.abs(speed))
    steps = np.where(plain, np.sign(speed.real) * np.where(beta == 0, 1, 2), 0).astype(np.int64)
    first = np.concatenate([[0], np.flatnonzero(~plain) + 1])
    last = np.append(first[1:] - 1, len(theta))
    ends = np.unique(np.concatenate([first, last]))
    counted = np.full(len(probes), -1, dtype=np.int64)
    counted[ends] = _count_each(p, q, h, sets, theta, beta, probes[ends])
    for a, b in zip(first, last, strict=True):
        found = counted[a] + np.concatenate([[0], np.cumsum(steps[a:b])])
        if found[-1] == counted[b] and np.all(found >= 0):
            counted[a : b + 1] = found
        else:
            counted[a : b + 1] = _count_each(p, q, h, sets, theta, beta, probes[a : b + 1])
    return counted


def _frequency_bound(p: Array, q: Array, sets: Sets, theta: Array) -> Array:
    """Upper bound of frequencies of roots on the axis, for each θ; inf where no bound is known."""
    return _bound_of_terms(p + theta[:, None, None] * q, sets)


def _largest_between(p: Array, q: Array, sets: Sets, theta: Array) -> float:
    """Upper bound of frequencies of roots on the axis between the first and the last θ, where a bound exists.

    Between two samples, a pair of frequencies may appear at which terms are equal in size, far above those at the
    samples. The change of θ Q within an interval therefore counts as one more term of arbitrary phase per part of Q.
    """
    parts = np.any(q != 0, axis=-1)
    own = np.eye(len(sets) + np.sum(parts), dtype=bool)[:, len(sets) :]
    around = np.hstack([np.vstack([sets, sets[parts]]), own])
    found, low, high = 0.0, theta[:-1], theta[1:]
    for _ in range(_TIMES_CUT):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        c = [p + middle[:, None, None] * q, half[:, None, None] * q[parts]]
        bound = _bound_of_terms(np.concatenate(c, axis=1), around)
        found = max(found, float(np.max(bound[np.isfinite(bound)], initial=0.0)))
        cut = low + (high - low) * np.linspace(0, 1, _PIECES + 1)[:, None]
        low, high = (one[:, np.isinf(bound)].ravel() for one in (cut[:-1], cut[1:]))
    return found


def _bound_of_terms(c: Array, sets: Sets) -> Array:
    """Upper bounds (rows,) of frequencies of roots on the axis for c (rows, m, n+1); inf where none exists."""
    bound = bound_on_axis(c, sets)
    where = leads(c) & np.isfinite(bound)
    bound[where] = np.minimum(bound[where], _last_crossing(c[where]))
    return np.asarray(np.where(np.isfinite(bound), bound, np.inf))


def _last_crossing(c: Array) -> Array:
    """Frequency (rows,) above which the term without delay exceeds all others together, for c (rows, m, n+1).

    It must exceed them in the highest power (`leads`). By the inequality of Cauchy and Schwarz
    (Σ|p_j|)² <= Σ w_j Σ|p_j|²/w_j, exact for two terms, and nearly exact at high frequency with the highest
    coefficients as w_j.
    """
    sizes = np.abs(highest(c)[0])
    weights = sizes[:, 1:] + _SPARE * (sizes[:, :1] - np.sum(sizes[:, 1:], axis=-1, keepdims=True))
    factor = np.sum(weights, axis=-1, keepdims=True) / weights
    squares = squared_size(c[:, 0]) - np.sum(factor[..., None] * squared_size(c[:, 1:]), axis=1)
    w = roots(squares)
    highest_root = np.max(np.where((np.abs(w.imag) <= _ON_AXIS * np.abs(w)) & (w.real > 0), w.real, 0.0), axis=-1)
    return np.asarray((1 + _ON_AXIS) * np.sqrt(highest_root))


def _candidates(
    p: Array, q: Array, h: Array, low: float, high: float, fast: float, ill_posed: Array
) -> tuple[Array, Array] | None:
    """Values of θ at which a root may be on the axis, rising, with the frequency of the root.

    The frequency is 0 for a root at s = 0, and inf where the equations become `ill_posed` (the root is infinite).
    """
    zeros = im_of_product(p, q, h).zeros(fast) if fast else (np.empty(0),)
    if zeros is None:
        return None
    beta = zeros[0]
    above, below = value(p, h, 1j * beta), value(q, h, 1j * beta)
    theta = -(above * np.conj(below)).real / np.abs(below) ** 2
    static = -np.sum(p[:, 0]) / np.sum(q[:, 0])
    theta = np.concatenate([theta, [static], ill_posed])
    beta = np.concatenate([beta, [0.0], np.full(len(ill_posed), np.inf)])
    inside = np.isfinite(theta) & (theta > low) & (theta < high)
    theta, beta = theta[inside], beta[inside]
    order = np.argsort(theta, kind="stable")
    theta, beta = theta[order], beta[order]
    blur = np.where(np.isinf(beta), _CORNER, _ROUNDING) * theta
    apart = np.append(True, np.diff(theta) > np.maximum(blur[1:], blur[:-1])) if len(theta) else np.empty(0, dtype=bool)
    return theta[apart], np.maximum.reduceat(beta, np.flatnonzero(apart)) if len(beta) else beta
