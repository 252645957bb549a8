"""Contribution of each difference between two rigs to the change of their verdict, as Shapley values.

They are computed from verdicts on mixed rigs, which take some of the differing values from one rig and the rest from
the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from steadyslip.core.areas import is_per_area
from steadyslip.core.arrays import Array, valid_together
from steadyslip.core.differences import Differing, differing, mixed
from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.records import replaced
from steadyslip.linear.spectrum import growth
from steadyslip.linear.status import STABLE, UNSTABLE, WORDS, status
from steadyslip.linear.stiffness import own_safety_factor
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point

MOST_EXACT = 12  # up to this many differences every subset is judged (4096 rigs); for more, random orders are sampled
MOST_RIGS = 1024  # limit of mixed rigs that are built one by one (some ms each), where laws or zeros differ
IMPOSSIBLE = "not possible"
ORDERS = 256  # number of random orders of the differences, each also reversed: shares have errors of some percent

Place = tuple[Differing, ...]
"""Differences that are exchanged together: one, or two keys that exclude each other (stiffness, axial_stiffness)."""


def comparable(first: Slider | Machine, second: Slider | Machine) -> tuple[Slider | Machine, Slider | Machine]:
    """Copies of both rigs in a common form, per unit area or as totals of the contact, without areas in equations.

    If their areas differ, the form in which fewer values differ is taken.
    """
    if first.area == second.area:
        return first, second
    stresses = replaced(first, {"slider.area": None}), replaced(second, {"slider.area": None})
    if first.area is None or second.area is None:
        return stresses
    totals = _in_totals(first), _in_totals(second)
    return min(stresses, totals, key=lambda pair: len(list(differing(*pair))))


def _in_totals(rig: Slider | Machine) -> Slider | Machine:
    values = {name: one for name, one in rig.parameters().items() if one.value is not None}
    stresses = {name: one.value * rig.area for name, one in values.items() if is_per_area(one.role.unit)}  # type: ignore[operator]
    return replaced(rig, stresses | {"slider.area": 1.0})


def places(first: Slider | Machine, second: Slider | Machine) -> tuple[Place, ...]:
    """Differences between two comparable rigs that enter their equations, grouped as `Place`."""
    idle = {*first.not_in_model, *second.not_in_model}
    found: list[Place] = []
    exchanged: dict[str, list[Differing]] = {}  # by table: the keys that only one of the rigs has
    for one in differing(first, second):
        if one.name in idle:
            continue
        table = one.name.rpartition(".")[0]
        if one.role is not None and (one.first is None) != (one.second is None):
            exchanged.setdefault(table, []).append(one)
        else:
            found.append((one,))
    for several in exchanged.values():
        swap = len({one.first is None for one in several}) == 2
        found += [tuple(several)] if swap else [(one,) for one in several]
    return tuple(found)


@dataclass(frozen=True)
class Outcomes:
    """Verdicts on m rigs, each field (m,): word of `stability` or ``not possible``; growth rate (1/s) and safety factor
    k/k_cr, NaN where unknown.
    """

    words: Array
    growth: Array
    safety: Array


@dataclass(frozen=True)
class Between:
    """Mixed rigs, which have some of the differing values from a first rig and the others from a second rig.

    Attributes
    ----------
    first, second : Slider or Machine
        As `comparable` returns them.
    places : tuple of Place
    """

    first: Slider | Machine
    second: Slider | Machine
    places: tuple[Place, ...]

    def outcomes(self, masks: Array) -> Outcomes:
        """Verdicts on m mixed rigs, which have the second rig's values where `masks` (m, places) is True."""
        unknown = np.full(len(masks), math.nan)
        found = Outcomes(np.full(len(masks), IMPOSSIBLE, dtype=object), unknown, unknown.copy())
        built = np.array([not self._varies(place) for place in self.places], dtype=bool)
        kinds, which = np.unique(masks[:, built], axis=0, return_inverse=True)
        for i, kind in enumerate(kinds):
            rows = np.flatnonzero(np.ravel(which) == i)
            taken = {one.name for j in np.flatnonzero(built)[kind] for one in self.places[j]}
            try:
                rig = mixed(self.first, self.second, taken)
                self._judge(rig, masks[rows], built, rows, found)
            except (ParameterError, NotAvailable):
                continue  # this mixture is not a valid rig: its verdict stays `IMPOSSIBLE`
        return found

    def _judge(self, rig: Slider | Machine, masks: Array, built: Array, rows: Array, found: Outcomes) -> None:
        vary = {
            place[0].name: np.where(masks[:, j], place[0].second, place[0].first)
            for j, place in enumerate(self.places)
            if not built[j]
        }
        possible = np.broadcast_to(valid_together(rig, "", vary), rows.shape)
        rows = rows[possible]
        if not rows.size:
            return
        point = operating_point(rig, {name: values[possible] for name, values in vary.items()})
        with np.errstate(all="ignore"):
            found.words[rows] = np.broadcast_to(np.array(WORDS)[status(point)], rows.shape)
            found.growth[rows] = growth(point)
            if rig.default_along:
                found.safety[rows] = own_safety_factor(point)

    def _varies(self, place: Place) -> bool:
        """True if the place is one number, nonzero in both rigs, so that one symbolic model serves both values."""
        (one, *more) = place
        plain = not more and one.role is not None and bool(one.first) and bool(one.second)
        return plain and one.name in self.first.parameters() and one.name in self.second.parameters()


def shapley(between: Between, measure: str = "") -> tuple[str, Array]:
    """Shapley value of every place: its contribution to the change of a measure from the first rig to the second.

    It is the mean change of the measure when the place is exchanged, over all orders in which places can be exchanged
    (L. S. Shapley, A value for n-person games, 1953); with more than `MOST_EXACT` places over random orders (J. Castro,
    D. Gómez and J. Tejada, Computers & Operations Research 36, 2009). The values add up to the whole change.

    Parameters
    ----------
    between : Between
    measure : str
        ``growth`` to force the growth rate, where the values of several pairs of rigs must have one measure.

    Returns
    -------
    measure : str
        ``safety``: natural logarithm of k/k_cr, if for all mixed rigs k/k_cr > 1 means stable; else ``growth``:
        growth rate, 1/s; empty if some mixed rig has neither.
    values : ndarray (places,)
    """
    count = len(between.places)
    built = sum(not between._varies(place) for place in between.places)
    exact = count <= MOST_EXACT and 2**built <= MOST_RIGS
    orders = _orders(count, ORDERS if 2**built <= MOST_RIGS else max(1, MOST_RIGS // (2 * count)))
    masks = _all_subsets(count) if exact else _prefixes(orders)
    found = between.outcomes(masks)
    of, worth = _measure(found, measure)
    if not of:
        return of, np.full(count, math.nan)
    if exact:
        return of, _exact(worth, count)
    steps = np.diff(worth.reshape(len(orders), count + 1), axis=1)
    values = np.zeros((len(orders), count))
    np.put_along_axis(values, orders, steps, axis=1)
    return of, values.mean(axis=0)


def _measure(found: Outcomes, wanted: str) -> tuple[str, Array]:
    """Measure (``safety``, ``growth`` or empty) that all mixed rigs have, and its values (m,); see `shapley`."""
    stable = found.words == WORDS[STABLE]
    if not np.all(stable | (found.words == WORDS[UNSTABLE])):
        return "", found.growth
    if wanted != "growth" and np.all(found.safety > 0) and np.all((found.safety > 1) == stable):
        return "safety", np.log(found.safety)
    return ("growth" if np.all(np.isfinite(found.growth)) else ""), found.growth


def _all_subsets(count: int) -> Array:
    """Rows of bool (2**count, count); row i has the binary digits of i, the lowest first."""
    return np.asarray((np.arange(2**count)[:, None] >> np.arange(count)) & 1 == 1)


def _exact(worth: Array, count: int) -> Array:
    rows = np.arange(2**count)
    size = _all_subsets(count).sum(axis=1)
    weight = np.array([1 / (count * math.comb(count - 1, n)) for n in range(count)])
    without = [rows[(rows >> j) & 1 == 0] for j in range(count)]
    return np.array([np.sum(weight[size[r]] * (worth[r | 1 << j] - worth[r])) for j, r in enumerate(without)])


def _orders(count: int, drawn_orders: int) -> Array:
    """Random orders of the places and their reversals, (2 drawn_orders, count)."""
    chance = np.random.default_rng(0)
    drawn = np.array([chance.permutation(count) for _ in range(drawn_orders)])
    return np.concatenate([drawn, drawn[:, ::-1]])


def _prefixes(orders: Array) -> Array:
    """Subsets of the first 0, 1, ..., count places of each order, as rows of bool (orders * (count + 1), count)."""
    count = orders.shape[1]
    rank = np.argsort(orders, axis=1)
    return np.asarray(rank[:, None, :] < np.arange(count + 1)[None, :, None]).reshape(-1, count)


def ones_and_others(count: int) -> Array:
    """Subsets with a single place, then with all places but one, as rows of bool (2 count, count)."""
    return np.concatenate([np.eye(count, dtype=bool), ~np.eye(count, dtype=bool)])
