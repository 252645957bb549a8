"""`mode_chart`: frequencies and damping ratios of a machine's oscillations along one of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import LOW_AND_HIGH, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.written import displayed_as
from steadyslip.files.output import write_columns
from steadyslip.linear.boundary import boundary
from steadyslip.linear.mode_origin import Origin
from steadyslip.linear.mode_table import MOST, growth_origin, with_modes
from steadyslip.linear.roots import ComplexArray
from steadyslip.linear.search import Boundary
from steadyslip.linear.status import stability
from steadyslip.linear.stiffness import eigenvalues
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

LOWER, HIGHER = 0.1, 2.0  # ends of the default range of the parameter, as multiples of its value in the machine
_SHY = 0.98  # the default range goes at most this share of the way from the value to an end of the domain
POINTS = 33  # initial number of values; midpoints are added, and more values where eigenvalues cannot be matched
MOST_POINTS = 8 * POINTS  # largest number of values; bounds the computing time
_CLEAR = 0.5  # largest step of an eigenvalue between neighbouring values, over the distance to other eigenvalues
_SAME = 1e-6  # relative distance up to which two eigenvalues count as one double eigenvalue
_SPREAD = 30.0  # ratio of the ends of a range above which the values are spaced evenly in their logarithm


@dataclass(frozen=True, repr=False)
class ModeChart(Displayed):
    """Frequencies and damping ratios of all oscillations along a parameter, by `mode_chart`.

    Attributes
    ----------
    rig : Machine
    parameter, unit : str
    values : ndarray (p,)
        Values of the parameter (SI), rising; closer together where eigenvalues change quickly.
    eigenvalues : ndarray (p, n), complex
        Eigenvalues (1/s) with β > 0: one column for each oscillation, NaN where it does not exist.
    numbers : tuple of int
        `Mode.number` of the oscillation in each column: its place by rising frequency in the machine as it is, or at
        the nearest end of the range; 0 for oscillations that exist only at other values of the parameter.
    edges : tuple of Boundary
        Values at which stability changes.
    origins : tuple of Origin
        Reasons of growth, one for each interval of unstable values, at the value of fastest growth.
    """

    rig: Machine
    parameter: str
    unit: str
    values: Array
    eigenvalues: ComplexArray
    numbers: tuple[int, ...]
    edges: tuple[Boundary, ...]
    origins: tuple[Origin, ...]

    @property
    def frequencies(self) -> Array:
        """Frequencies in Hz, (p, n)."""
        return self.eigenvalues.imag / (2 * np.pi)

    @property
    def damping_ratios(self) -> Array:
        """Damping ratios −Re λ/|λ|, (p, n); negative where the oscillation grows."""
        return -self.eigenvalues.real / np.abs(self.eigenvalues)

    @property
    def is_geometric(self) -> bool:
        """True if the values are spaced evenly in their logarithm, which is the case for a wide range."""
        return _is_wide(float(self.values[0]), float(self.values[-1]))

    @property
    def least_damped(self) -> tuple[int, ...]:
        """Columns of the oscillations (at most eight) with the smallest damping ratios, by rising frequency."""
        least = np.nanmin(self.damping_ratios, axis=0)
        kept = np.sort(np.argsort(least)[:MOST])
        return tuple(int(i) for i in kept)

    def plot(self, kind: str | None = None, ax: Any = None) -> Any:
        """Figure of frequencies and damping ratios over the parameter; kind ``"chart"``."""
        return draw(self, kind, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it; None for NaN."""

        def listed(table: Array) -> list[list[float | None]]:
            return [[float(one) if np.isfinite(one) else None for one in column] for column in table.T]

        return {
            "parameter": self.parameter,
            "unit": self.unit,
            "values": self.values.tolist(),
            "modes": [
                {"number": number, "frequencies": frequencies, "damping_ratios": ratios}
                for number, frequencies, ratios in zip(
                    self.numbers, listed(self.frequencies), listed(self.damping_ratios), strict=True
                )
            ],
            "edges": [{"value": one.value, "kind": one.kind, "stable": one.stable} for one in self.edges],
            "why_it_grows": [one.to_dict() for one in self.origins],
        }

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write a CSV file with one row for each value of the parameter; the header has the units.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        columns = {f"{self.parameter} ({self.unit})": self.values}
        for i, title in enumerate(self.titles):
            columns[f"frequency of {title} (Hz)"] = self.frequencies[:, i]
            columns[f"damping ratio of {title}"] = self.damping_ratios[:, i]
        write_columns(path, columns, "%.12g")

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the columns: ``mode 3``; ``another mode``, ``another mode 2`` for oscillations without number."""
        found, others = [], 0
        for number in self.numbers:
            others += not number
            found.append(f"mode {number}" if number else f"another mode {others}".removesuffix(" 1"))
        return tuple(found)

    def __str__(self) -> str:
        ends = [self.told(float(self.values[i])) for i in (0, -1)]
        lines = [f"oscillations for {self.parameter} from {ends[0]} to {ends[1]}"]
        lines += [f"  {one}" for one in self.edges] or [f"  {stability(self._at(0))} throughout"]
        lines += list(dict.fromkeys(one.words for one in self.origins))
        rows = [("", "frequency", "damping ratio")]
        for i in self.least_damped:
            known = np.isfinite(self.damping_ratios[:, i])
            frequencies, ratios = self.frequencies[known, i], self.damping_ratios[known, i]
            rows.append((
                self.titles[i],
                " to ".join(format_quantity(float(frequencies[at]), "Hz") for at in (0, -1)),
                f"{ratios[0]:.3g} to {ratios[-1]:.3g}, least {np.min(ratios):.3g}",
            ))  # fmt: skip
        widths = [max(len(row[i]) for row in rows) for i in range(2)]
        lines += ["", *("  ".join([*map(str.ljust, row[:2], widths), row[2]]).rstrip() for row in rows)]
        left = len(self.numbers) - len(self.least_damped)
        return "\n".join([*lines, *([f"and {left} that are damped more; files and JSON have all"] if left else [])])

    def _at(self, place: int) -> Machine:
        return self.rig.with_values({self.parameter: float(self.values[place])})

    def told(self, value: float) -> str:
        """Text of a value (SI) of the parameter with its unit."""
        with displayed_as(self.rig.written_as(self.parameter)):
            return format_quantity(value, self.unit, area=self.rig.printed_area(self.parameter)) or "0"


@checked(between=LOW_AND_HIGH)
def mode_chart(rig: Slider | Machine, name: str, between: Sequence[Any] | None = None) -> ModeChart:
    """Frequencies and damping ratios of all oscillations of a machine along a parameter, which show where modes couple.

    Parameters
    ----------
    rig : Machine
    name : str
        Dotted name, or a unique last part, of a parameter: a friction coefficient, a load, the drive's velocity.
    between : (low, high), optional
        Range, in SI units or text such as ``"10 mm/s"``; by default from 0.1 to 2 times the machine's own value.

    Returns
    -------
    ModeChart

    Raises
    ------
    UnknownNameError, ParameterError
        If the name is unknown, or the range is not inside the parameter's domain; without `between` also if the
        parameter is zero in the machine.
    NotAvailable
        For a slider, and if nothing oscillates in the range.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/brake-pad.toml")
    >>> found = ss.linear.mode_chart(machine, "links.caliper.stiffness")
    >>> print(found.edges[0])
    links.caliper.stiffness = 11.0483 N/um: oscillatory, period 1.374 ms, stable above
    >>> found.plot()[0].figure.savefig("modes.svg")
    """
    rig = with_modes(rig)
    full = rig.resolve(name)
    low, high = _range(rig, full, between)
    edges = boundary(rig, full, (low, high))
    own = float(rig.parameters()[full].value or 0.0)
    spaced = np.geomspace if _is_wide(low, high) else np.linspace
    inside = [own] if low < own < high else []
    start = np.unique([*spaced(low, high, POINTS), *(one.value for one in edges), *inside])
    values, found = followed(lambda at: eigenvalues(rig, {full: at}), start)
    if not found.size:
        raise NotAvailable(f"nothing oscillates for {full} from {low:g} to {high:g}; choose another range")
    unit = rig.parameters()[full].role.unit
    at_own = found[int(np.argmin(np.abs(values - own)))]
    order = np.argsort(np.where(np.isnan(at_own), np.inf, at_own.imag), kind="stable")
    found, oscillates = found[:, order], np.isfinite(at_own[order])
    numbers = tuple(i + 1 if some else 0 for i, some in enumerate(oscillates))
    return ModeChart(rig, full, unit, values, found, numbers, edges, _origins(rig, full, values, found, numbers))


def _is_wide(low: float, high: float) -> bool:
    return low > 0 and high > _SPREAD * low


def _range(rig: Machine, name: str, between: Sequence[Any] | None) -> tuple[float, float]:
    if between is not None:
        low, high = (float(rig.read(name, one)) for one in between)
        return low, high
    own = float(rig.parameters()[name].value or 0.0)
    if not own:
        raise ParameterError([Problem(name, "is zero in this machine; give a range, low and high")])
    low, high = sorted((own * LOWER, own * HIGHER))
    domain = rig.parameters()[name].role.domain
    return max(low, own + _SHY * (domain.low - own)), min(high, own + _SHY * (domain.high - own))


def followed(roots_at: Callable[[Array], ComplexArray], values: Array) -> tuple[Array, ComplexArray]:
    """Oscillations along a parameter: its values (p,), with more added, and eigenvalues (p, n), NaN if absent.

    Eigenvalues at neighbouring values are matched, and eigenvalues at their midpoint check the match. Where the check
    fails, or an eigenvalue moves too far, further values are added, up to `MOST_POINTS`. Matches that remain ambiguous
    are of eigenvalues that meet; either match is right there.
    """
    known = dict(zip(values.tolist(), map(_oscillations, roots_at(values)), strict=True))
    least = (values[-1] - values[0]) / MOST_POINTS**2
    unclear = list(pairwise(values.tolist()))
    while unclear := [(a, b) for a, b in unclear if b - a > least][: MOST_POINTS - len(known)]:
        middles = [0.5 * (a + b) for a, b in unclear]
        known |= dict(zip(middles, map(_oscillations, roots_at(np.array(middles))), strict=True))
        parts = [(a, middle, b) for (a, b), middle in zip(unclear, middles, strict=True)]
        doubted = [part for part in parts if not _is_clear(*(known[value] for value in part))]
        unclear = [pair for part in doubted for pair in pairwise(part)]
    order = sorted(known)
    paths: list[ComplexArray] = []
    last: dict[int, int] = {}  # index of the path of each root at the previous value
    for place, value in enumerate(order):
        roots = known[value]
        now = {}
        if last:
            for i, j in zip(*_pairs(known[order[place - 1]], roots), strict=True):
                now[int(j)] = last[int(i)]
        for j, root in enumerate(roots):
            if j not in now:
                paths.append(np.full(len(order), np.nan + 0j))
                now[j] = len(paths) - 1
            paths[now[j]][place] = root
        last = now
    return np.array(order), np.array(paths, dtype=complex).reshape(len(paths), len(order)).T


def _oscillations(roots: ComplexArray) -> ComplexArray:
    found = roots[np.isfinite(roots) & (roots.imag > 0)]
    return np.asarray(found[np.argsort(found.imag)])


def _pairs(before: ComplexArray, after: ComplexArray) -> tuple[Array, Array]:
    """Indices of matching eigenvalues in two sets: the assignment with the least sum of distances."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    rows, columns = linear_sum_assignment(np.abs(before[:, None] - after))
    return rows, columns


def _is_clear(before: ComplexArray, between: ComplexArray, after: ComplexArray) -> bool:
    """True if the three sets are equally large, moves are small, and both ways of matching agree.

    The ways are direct, and through `between`.
    """
    if not len(before) == len(between) == len(after):
        return False
    first, second, whole = (_becomes(*two) for two in ((before, between), (between, after), (before, after)))
    for now, then, at in ((before, between, first), (between, after, second)):
        if np.any(np.abs(now - then[at]) > _CLEAR * np.minimum(_gaps(now), _gaps(then)[at])):
            return False
    return bool(np.all(np.abs(after[second[first]] - after[whole]) <= _SAME * np.abs(after[whole])))


def _becomes(before: ComplexArray, after: ComplexArray) -> Array:
    """For each eigenvalue in `before`, the index of its match in `after`, a set of equal size."""
    rows, columns = _pairs(before, after)
    return np.asarray(columns[np.argsort(rows)])


def _gaps(roots: ComplexArray) -> Array:
    """Distance of each root to the nearest other root that is not a copy of the same double root."""
    apart = np.abs(roots[:, None] - roots)
    apart[apart <= _SAME * np.abs(roots)] = np.inf
    return np.asarray(np.min(apart, axis=1, initial=np.inf))


def _origins(rig: Machine, name: str, values: Array, found: ComplexArray, numbers: Sequence[int]) -> tuple[Origin, ...]:
    """Reasons of growth, at the value of fastest growth in each interval of unstable values."""
    with np.errstate(invalid="ignore"):
        fastest = np.nanmax(np.where(np.isnan(found), -np.inf, found.real), axis=1)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], fastest > 0, [False]]).astype(int)))
    reasons = []
    for first, last in ends.reshape(-1, 2):
        at = first + int(np.argmax(fastest[first:last]))
        column = int(np.nanargmax(found[at].real))
        s = found[at, column]
        number = numbers[column] or int(np.sum(found[at].imag <= s.imag))
        reasons.append(growth_origin(rig.with_values({name: float(values[at])}), complex(s), number))
    return tuple(one for one in reasons if one is not None)
