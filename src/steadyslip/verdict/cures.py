"""`cure`: parameter changes after which a rig is stable with a required chance, and what they cost."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core import domains
from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_percent
from steadyslip.core.options import Tested, checked
from steadyslip.core.results import ReadOnly
from steadyslip.core.roles import Parameter
from steadyslip.files.specifications.tolerance_tables import Adjustment, Tolerances
from steadyslip.linear.boundary import REMOTE, boundary, searched
from steadyslip.linear.nearness import doublings, ends_about
from steadyslip.linear.status import stability
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.verdict.chances import Chances, chances_of, places
from steadyslip.verdict.change_costs import SPEED, unit_cost
from steadyslip.verdict.cure_window import LEAST, Window
from steadyslip.verdict.export import finite
from steadyslip.verdict.tolerances import GIVEN, format_chance
from steadyslip.verdict.unknown import ValuesWithin, stable_within

DECADES = 3.0  # decades searched to each side of a value without limits
SCANNED, COARSE = 97, 17  # numbers of values tried along one parameter, and along each of two parameters: by trial
FROM_ZERO = 145  # number of values tried of a parameter that is 0, over the twelve decades that `boundary` searches
BESIDE = 1e-6  # the chance is evaluated at this relative distance from the rig's own edges, too
HALVINGS, FEW_HALVINGS = 52, 12  # bisections of an edge: to the last digit for one rig, to 1e-5 for a sample of rigs
NEAR = np.linspace(-0.02, 0.02, 5)  # relative distances from an edge at which the whole sample is evaluated
FAR = math.log2(REMOTE)  # a loss of stability is not reported if it needs more doublings of a parameter than this
PAIRS = 3  # number of the cheapest pairs of the coarse search that are refined
PRELOAD = "normal stress"  # role kind of the parameters that press a contact, whatever their name in a law
DESIGN = (
    ("stiffness", "axial_stiffness", "kp", "kv"), ("damping", "kd", "ki", "tn"), ("mass", "inertia"), (PRELOAD,),
    ("viscous",), ("velocity",),
)  # fmt: skip
"""Last parts of the names of parameters that a designer chooses, in the order in which they are tried."""
OWN_VALUES = (
    "without tolerances this is of the rig's own values{}, whatever chance is asked for;\n"
    'its file takes them as stiffness = "12 ± 20 % N/um", or "12 +- 20 % N/um"'
)
SURE = Tested(
    f"{domains.chance.text}, or text such as '95 %'",
    lambda v: isinstance(v, str) or (isinstance(v, (int, float)) and not isinstance(v, bool) and 0 < v <= 1),
)


@dataclass(frozen=True, eq=False)
class Cures(ReadOnly):
    """Changes of a rig after which it is stable with a required chance.

    Attributes
    ----------
    rig : Slider or Machine
    sure : float
        The required chance.
    chance, error : float
        Chance of the rig as it is, and half-width of its 95 % interval; 0 or 1 and 0 without tolerances.
    windows : tuple of Window
        One window for every adjustable parameter, in the order of the file or of `default_adjust`.
    pair : dict of str to float
        Values of the two parameters that, changed together, cost least, SI units; empty if a single change costs no
        more, or if no pair reaches the chance.
    pair_cost : float
        Cost of `pair`; infinite if it is empty.
    fails : tuple of Window
        For a rig that has the required chance as it is: one window for every parameter whose change would lose the
        chance, the smallest change first.
    unlisted : tuple of Window
        If no adjustable parameter reaches the chance: one window for every other parameter that a designer chooses, in
        the order of `default_adjust`.
    without_tolerances : bool
        True if nothing of the rig varies: results are then for the rig's own values, whatever chance is required.
    unknown : tuple of ValuesWithin
        Parameters that are not known; the chance is reached at all their values.
    ranges : dict of str to (float, float)
        Tolerances: least and largest value by dotted name, SI units; for normal distributions the range of 95 %.
    """

    rig: Slider | Machine = field(repr=False)
    sure: float
    chance: float
    error: float
    windows: tuple[Window, ...]
    pair: Mapping[str, float]
    pair_cost: float
    fails: tuple[Window, ...]
    unlisted: tuple[Window, ...] = ()
    without_tolerances: bool = False
    unknown: tuple[ValuesWithin, ...] = ()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict, repr=False)

    @property
    def best(self) -> Window | None:
        """Window of the cheapest single change; None if no change reaches the chance, or none is needed."""
        found = [one for one in self.windows if one.nearest is not None]
        return min(found, key=lambda one: one.cost, default=None)

    def __str__(self) -> str:
        wide = 2 + max(len(one.parameter) for one in (*self.windows, *self.fails, *self.unlisted))
        lines = self.sentences()
        if self.chance >= self.sure:
            rows = [f"{one.parameter:<{wide}}{_change(one, *ends)}" for one, ends in self.losses().items()]
            return "\n".join([lines[0], *rows, *lines[1:]])
        enough = [one for one in self.unlisted if one.windows]
        rows = [f"{one.parameter:<{wide}}{one.written(one.value)} now; {one}" for one in (*self.windows, *enough)]
        if self.unlisted:
            names = ", ".join(one.parameter for one in self.unlisted)
            words = (
                "not listed as adjustable, but enough alone:" if enough else f"nor would do alone, not listed: {names}"
            )
            rows.insert(len(self.windows), words)
        return "\n".join([*lines, *rows])

    def losses(self) -> dict[Window, list[float]]:
        """Windows of the parameters whose change would lose the chance, with their edges within `FAR` doublings."""
        near = {one: [end for end in one.edges_around if one.doublings(end) <= FAR] for one in self.fails}
        return {one: ends for one, ends in near.items() if ends}

    def sentences(self) -> list[str]:
        """Lines on the required chance, its conditions and the cheapest changes, without the rows by parameter."""
        wanted = f"stable with a chance of {format_percent(self.sure)}" if self.error else "stable"
        now, tried = self._now(), places(len(self.unknown))
        alone = [f"at every value of {one.parameter} from {one.given}, {tried} of them tried" for one in self.unknown]
        alone += [OWN_VALUES.format(" for all else" if alone else "")] if self.without_tolerances else []
        if self.chance >= self.sure:
            already = f"Already {wanted} (now {now})" if self.error else f"Already {wanted}"
            whatever = f"whatever single value changes by less than a factor of {REMOTE}"
            return [f"{already}. What would lose it first:" if self.losses() else f"{already}, {whatever}", *alone]
        lines = [f"To be {wanted} (now {now})", *alone]
        if (best := self.best) is not None:
            only = best.parameter == SPEED and not any(one.nearest for one in self.windows if one is not best)
            first = "no other change alone reaches it, another speed does" if only else "cheapest single change"
            lines.append(f"{first}: {best.parameter} {_change(best, best.nearest)}, cost {best.cost:.3g}")
        else:
            lines.append("no single change reaches it")
        if self.pair:
            of = {one.parameter: one for one in self.windows}
            both = " and ".join(f"{name} {_change(of[name], value)}" for name, value in self.pair.items())
            lines.append(f"cheapest pair: {both}, cost {self.pair_cost:.3g}")
        else:
            lines.append("no pair is cheaper" if best is not None else "nor does any pair of changes")
        return lines

    def _now(self) -> str:
        """Text of the chance or verdict for the rig as it is; with unknown parameters, of the least chance."""
        if self.error:
            return format_chance(self.chance, self.error) + (" where least" if self.unknown else "")
        own = stability(self.rig)
        return "stable at some of these values only" if self.unknown and self.chance < 1 and own == "stable" else own

    def to_dict(self) -> dict[str, Any]:
        """Changes as JSON-ready dict in SI units, as ``--json`` prints it."""

        def data(one: Window) -> dict[str, Any]:
            return {
                "parameter": one.parameter, "unit": one.unit, "value": one.value, "limits": list(one.limits),
                "windows": [list(ends) for ends in one.windows], "cost": one.cost, "nearest": one.nearest,
                "leaves": one.leaves, "beyond": None if one.beyond is None else list(one.beyond),
            }  # fmt: skip

        found: dict[str, Any] = finite(
            {
                "sure": self.sure, "chance": self.chance, "error": self.error,
                "without_tolerances": self.without_tolerances,
                "unknown": {one.parameter: [one.low, one.high] for one in self.unknown},
                "best": None if self.best is None else self.best.parameter,
                "pair": dict(self.pair), "pair_cost": self.pair_cost,
                "unlisted": [data(one) for one in self.unlisted],
                "windows": [data(one) for one in self.windows], "fails": [data(one) for one in self.fails],
            }
        )  # fmt: skip
        return found


def _change(one: Window, *to: float | None) -> str:
    ends = [one.written(end) for end in to if end is not None]
    return f"from {one.written(one.value)} to {' or '.join(ends)}" if ends else "unchanged"


@checked(tolerances=GIVEN, sure=SURE)
def cure(
    rig: Slider | Machine, tolerances: Mapping[str, Any] | Tolerances | None = None, *, sure: float | str = 0.95,
    adjust: Mapping[str, Any] | None = None, unknown: Mapping[str, tuple[float, float]] | None = None,
) -> Cures:  # fmt: skip
    """Find changes of parameters after which a rig is stable with a required chance.

    Parameters
    ----------
    rig : Slider or Machine
    tolerances : mapping of str to float or str, or Tolerances, optional
        As for `tolerate`; without them the rig itself is to be stable.
    sure : float or str
        The chance, such as ``"95 %"``.
    adjust : mapping of str to Adjustment, optional
        Parameters that may change; by default those of `tolerances`, or else what a designer chooses: gains of the
        drive, stiffness, damping, mass, preload, lubricant and speed, within three decades to each side. Each doubling
        costs 1 for a part, 1/4 for a setting of the drive, 4 for the speed (`steadyslip.verdict.change_costs`), unless
        a cost is given.
    unknown : mapping of str to (float, float), optional
        Least and largest value of parameters that are not known, SI units; by default those of `tolerances`. The chance
        must be reached at all values: five of each interval are tried, with more than two parameters the ends.

    Returns
    -------
    Cures

    Raises
    ------
    ParameterError
        If an argument is not allowed, or the rig has nothing that may be changed.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> print(ss.cure(rig, adjust=None))
    To be stable (now unstable)
    without tolerances this is of the rig's own values, whatever chance is asked for;
    its file takes them as stiffness = "12 ± 20 % N/um", or "12 +- 20 % N/um"
    cheapest single change: slider.damping from 0 Pa s/m to 57.53 GPa s/m, cost 1
    no pair is cheaper
    slider.stiffness  9 GPa/m now; from 29.07 GPa/m up
    slider.damping    0 Pa s/m now; from 57.53 GPa s/m up
    contact.preload   5 MPa now; up to 1.548 MPa
    drive.velocity    1 um/s now; not reached from 0.001 um/s to 1000 um/s
    """
    wanted = _share(sure)
    unknown = unknown or (tolerances.unknown if isinstance(tolerances, Tolerances) else {})
    within = stable_within(rig, unknown).each if unknown else ()
    chances = chances_of(rig, tolerances or {}, {one.parameter: (one.low, one.high) for one in within}, wanted == 1)
    own = adjust or (tolerances.adjust if isinstance(tolerances, Tolerances) else {}) or default_adjust(rig)
    given = {rig.resolve(name): one for name, one in own.items()}
    if not given:
        raise ParameterError([Problem("adjust", "no parameter of this rig may change by default; name at least one")])
    chance, error = chances.whole({})
    windows = tuple(_windows(chances, name, one, wanted) for name, one in given.items())
    pair: dict[str, float] = {}
    cost = math.inf
    if chance < wanted:
        least = min((one.cost for one in windows), default=math.inf)
        pair, cost = _cheapest_pair(chances, windows, given, wanted, least)
    fails = _fails(chances, windows, wanted) if chance >= wanted else ()
    reached = chance >= wanted or pair or any(one.windows for one in windows)
    unlisted = () if reached else _unlisted(chances, given, wanted)
    ranges = {} if chances.spreads is None else {name: one.ends for name, one in chances.spreads.of.items()}
    return Cures(rig, wanted, chance, error, windows, pair, cost, fails, unlisted, chances.single, within, ranges)


def _share(sure: float | str) -> float:
    try:
        return Parameter("1", domains.chance, "chance").checked(sure)
    except ParameterError as error:
        raise ParameterError([one.under("sure") for one in error.problems]) from error


def default_adjust(rig: Slider | Machine) -> dict[str, Adjustment]:
    """Parameters that a designer chooses, cheapest kind first, then as in `DESIGN`; all with default limits."""
    found = {}
    for words in DESIGN:
        for name, one in rig.parameters().items():
            last = PRELOAD if one.role.kind == PRELOAD else name.rpartition(".")[2]
            starts = one.value or (last in ("damping", "kd", "viscous") and one.value is not None)
            if last in words and starts and not (one.value == 0 and one.role.adds_state):
                found[name] = Adjustment()
    return dict(sorted(found.items(), key=lambda one: unit_cost(one[0])))


def _unlisted(chances: Chances, listed: Mapping[str, Adjustment], sure: float) -> tuple[Window, ...]:
    """Windows of the parameters that a designer chooses and that are not `listed`."""
    besides = [(name, one) for name, one in default_adjust(chances.rig).items() if name not in listed]
    return tuple(_windows(chances, name, one, sure) for name, one in besides)


def _limits(chances: Chances, name: str, one: Adjustment) -> tuple[float, float]:
    """Range of a parameter to search, within its domain and the limits of `one`; SI units."""
    value, domain = chances.own(name), chances.rig.parameters()[name].role.domain
    ends = sorted((value * 10.0**-DECADES, value * 10.0**DECADES))
    if not value:
        ends = [0.0, searched(chances.rig, name)[1]]
    low = max(ends[0] if one.low is None else one.low, domain.low)
    high = min(ends[1] if one.high is None else one.high, domain.high)
    if domain.high == high and not domain.high_allowed:
        high = math.nextafter(high, low)
    if domain.low == low and not domain.low_allowed:
        low = math.nextafter(low, high)
    return low, high


def _scan(chances: Chances, name: str, limits: tuple[float, float]) -> Array:
    """Rising values of a parameter to be tried: the rig's own, evenly spread ones, and some close to edges."""
    low, high = limits
    own = chances.own(name)
    if low * high > 0:
        values = np.geomspace(low, high, SCANNED)
        values[0], values[-1] = low, high
    elif low == 0:
        values = np.append(0.0, np.geomspace(high * LEAST, high, FROM_ZERO))
    else:
        values = np.linspace(low, high, SCANNED)
    try:
        edges = np.array([edge.value for edge in boundary(chances.rig, name, between=limits)])
    except (NotAvailable, ParameterError):
        edges = np.array([])
    beside = np.concatenate([[own], edges * (1 - BESIDE), edges * (1 + BESIDE)])
    values = np.unique(np.concatenate([values, beside[(beside >= low) & (beside <= high)]]))
    return np.asarray(values[chances.allowed(name, values)])


def _windows(chances: Chances, name: str, one: Adjustment, sure: float) -> Window:
    """`Window` of one parameter: all intervals in which the chance `sure` is reached."""
    low, high = _limits(chances, name, one)
    values = _scan(chances, name, (low, high))
    unit, about = (
        chances.rig.parameters()[name].role.unit,
        (chances.rig.printed_area(name), chances.rig.display_value(name, 1.0), chances.rig.written_as(name)),
    )
    if not values.size:
        return Window(name, unit, chances.own(name), (), (low, high), math.inf, *about)

    def reached(at: Array) -> Array:
        return np.asarray(chances.few({name: at}) >= sure)

    inside = reached(values)
    sharp = chances.single or chances.certain  # without sampling errors, edges are sharp
    at = np.flatnonzero(inside[1:] != inside[:-1])
    edges = _narrowed(reached, values[at], values[at + 1], inside[at], HALVINGS if sharp else FEW_HALVINGS)
    edges = edges if sharp else np.array([_settled(chances, name, edge, sure) for edge in edges])
    ends = [values[0], *edges, values[-1]]
    windows = tuple(
        (float(first), float(last))
        for i, (first, last) in enumerate(itertools.pairwise(ends))
        if (bool(inside[0]) ^ bool(i % 2)) and first <= last
    )
    found = Window(name, unit, chances.own(name), windows, (float(values[0]), float(values[-1])), 0.0, *about)
    if not windows:
        return replace(found, cost=math.inf, beyond=_beyond(chances, name, (low, high)))
    if found.nearest is None:
        return found
    return replace(found, cost=_unit_cost(name, one) * found.doublings(found.nearest))


def _unit_cost(name: str, one: Adjustment) -> float:
    return unit_cost(name) if one.cost is None else one.cost


def _beyond(chances: Chances, name: str, limits: tuple[float, float]) -> tuple[str, float] | None:
    """Nearest edge outside the limits beyond which the rig is stable: stable side and value; None without one."""
    try:
        edges = boundary(chances.rig, name)
    except (NotAvailable, ParameterError):
        return None
    outside = {"above": lambda value: value > limits[1], "below": lambda value: value < limits[0]}
    found = [(one.stable, one.value) for one in edges if one.stable in outside and outside[one.stable](one.value)]
    ends = ends_about(chances.own(name), [value for _, value in found], chances.rig.parameters()[name].role.unit)
    return next((one for one in found if one[1] == ends[0]), None)


def _narrowed(reached: Callable[[Array], Array], low: Array, high: Array, first: Array, halvings: int) -> Array:
    """Bisect brackets `low`, `high` (n,) of edges; returns the last values (n,) at which the chance is reached.

    `first` is True where the chance is reached at `low`.
    """
    if not low.size:
        return low
    low, high = low.copy(), high.copy()
    for _ in range(halvings):
        both = low * high > 0
        middle = np.where(both, np.sign(low) * np.sqrt(np.abs(low * high)), 0.5 * (low + high))
        same = reached(middle) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.where(first, low, high)


def _settled(chances: Chances, name: str, edge: float, sure: float, others: Mapping[str, float] | None = None) -> float:
    """Edge refined by interpolation of chances near it, from the whole sample; `edge` if they do not enclose `sure`.

    `others` are changed values of other parameters.
    """
    places = edge * (1 + NEAR)
    places = places[chances.allowed(name, places)]
    above = np.array([chances.whole({**(others or {}), name: place})[0] for place in places]) - sure
    at = np.flatnonzero(np.sign(above[1:]) != np.sign(above[:-1]))
    if not at.size:
        return float(edge)
    i = at[np.argmin(np.abs(places[at] - edge))]
    return float(places[i] + (places[i + 1] - places[i]) * above[i] / (above[i] - above[i + 1]))


def _fails(chances: Chances, windows: Sequence[Window], sure: float) -> tuple[Window, ...]:
    """Windows of all parameters whose change would lose the chance `sure`, the smallest change first."""
    known = {one.parameter: one for one in windows}
    names = [
        name
        for name, one in chances.rig.parameters().items()
        if one.value and not one.role.gauge and name not in chances.rig.not_in_model
    ]
    every = [known.get(name) or _windows(chances, name, Adjustment(), sure) for name in names]
    far = [(one.doublings(one.leaves), one) for one in every if one.leaves is not None]
    return tuple(one for _, one in sorted(far, key=lambda both: both[0]))


def _cheapest_pair(
    chances: Chances, windows: Sequence[Window], adjust: Mapping[str, Adjustment], sure: float, least: float
) -> tuple[dict[str, float], float]:
    """Cheapest change of two parameters that reaches the chance: values by name, and cost; empty and inf unless the
    cost is below `least`.
    """
    found: list[tuple[float, str, str, float, float]] = []
    for first, second in itertools.combinations(windows, 2):
        found += _coarse(chances, first, second, adjust, sure, least)
    best: dict[str, float] = {}
    limits = {one.parameter: one.limits for one in windows}
    for _, one, two, x, y in sorted(found)[:PAIRS]:
        for values, cost in _refined(chances, (one, two), (x, y), limits[two], adjust, sure):
            if cost < least:
                best, least = values, cost
    return best, least if best else math.inf


def _cost(chances: Chances, adjust: Mapping[str, Adjustment], name: str, to: Array) -> Array:
    far = doublings(chances.own(name), to, chances.rig.parameters()[name].role.unit)
    return np.asarray(_unit_cost(name, adjust[name]) * np.atleast_1d(far))


def _coarse(
    chances: Chances, first: Window, second: Window, adjust: Mapping[str, Adjustment], sure: float, least: float
) -> Iterator[tuple[float, str, str, float, float]]:
    """Yield the cheapest sufficient change of two parameters on a coarse grid: cost, names, values; or nothing."""
    grids = []
    for one in (first, second):
        low, high = one.limits
        values = np.geomspace(low, high, COARSE) if low * high > 0 else np.linspace(low, high, COARSE)
        values = np.clip(values, low, high)
        grids.append(values[chances.allowed(one.parameter, values)])
    x, y = (part.ravel() for part in np.meshgrid(*grids, indexing="ij"))
    cost = _cost(chances, adjust, first.parameter, x) + _cost(chances, adjust, second.parameter, y)
    cheap = cost < least
    if not np.any(cheap):
        return
    x, y, cost = x[cheap], y[cheap], cost[cheap]
    good = chances.fewest({first.parameter: x, second.parameter: y}) >= sure
    if np.any(good):
        i = int(np.argmin(np.where(good, cost, math.inf)))
        yield float(cost[i]), first.parameter, second.parameter, float(x[i]), float(y[i])


def _refined(
    chances: Chances,
    names: tuple[str, str],
    to: tuple[float, float],
    limits: tuple[float, float],
    adjust: Mapping[str, Adjustment],
    sure: float,
) -> Iterator[tuple[dict[str, float], float]]:
    """Cheaper values of a pair, on the edge between the rig's own values and those in `to`, and their cost."""
    one, two = names
    own, own_two = chances.own(one), chances.own(two)
    values = np.geomspace(own, to[0], COARSE) if own * to[0] > 0 else np.linspace(own, to[0], COARSE)
    values = values[chances.allowed(one, values)]
    low = np.full(values.size, own_two)
    step = math.sqrt(to[1] / own_two) if own_two * to[1] > 0 else 1.0  # a margin: `to` was found with a small sample
    high = np.full(values.size, min(max(to[1] * step, limits[0]), limits[1]))

    def reached(at: Array) -> Array:
        return np.asarray(chances.few({one: values, two: at}) >= sure)

    ends, starts = reached(high), reached(low)
    edges = _narrowed(reached, low, high, np.zeros(values.size, dtype=bool), FEW_HALVINGS)
    edges = np.where(starts, low, edges)
    cost = _cost(chances, adjust, one, values) + _cost(chances, adjust, two, edges)
    good = ends & (values != own) & (edges != own_two)
    if not np.any(good):
        return
    i = int(np.argmin(np.where(good, cost, math.inf)))
    x, y = float(values[i]), float(edges[i])
    if not chances.single:
        y = _settled(chances, two, y, sure, {one: x})
    yield {one: x, two: y}, float(cost[i])
