"""Fit of a friction law's steady curve to friction measured at constant speeds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import InternalError, NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.format import format_count
from steadyslip.core.results import ReadOnly
from steadyslip.core.roles import Parameter
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.steady_curve import DAMPING, OFFSET, SteadyCurve, steady_curve
from steadyslip.experiments.measured.speeds import PreslidingLoop, SpeedTable
from steadyslip.experiments.numerics.profiled import ProfiledMinimum, intervals, least
from steadyslip.laws.friction.law import FrictionLaw

LEVELS = (0.6827, 0.95)
"""Probabilities of the intervals: 68 %, as of one standard deviation of a normal error, and 95 %."""
HELD = ("exponent", "viscosity")
"""Kinds of parameters that are fixed, in this order, if rows are few: at their default value or, without one, at 0."""
SAME = 1e-6  # speeds or loads with a smaller relative difference count as equal


@dataclass(frozen=True)
class SpeedEstimate(Estimate):
    """Parameter of a steady friction curve with its error, which is half the width of the 68 % interval.

    Attributes
    ----------
    likely : tuple of float
        68 % interval.
    remark : str
        Text on what the table does not determine; empty if there is nothing.
    """

    likely: tuple[float, float] = (float("nan"), float("nan"))
    remark: str = ""


@dataclass(frozen=True, eq=False)
class DirectionFit(ReadOnly):
    """Fit of a friction law to the steady friction in one direction.

    Attributes
    ----------
    forward : bool
    estimates : tuple of SpeedEstimate
        Friction coefficients and values per load if the table has a load; otherwise forces (torques) and values that
        refer to them.
    law : FrictionLaw
        Law with the estimates; parameters that a table does not determine have default values.
    load : float
        Median load of the table, N; 1 if the table has no load, so that coefficients are forces.
    speed, friction, fitted : ndarray (n,)
        Speed, m/s (rad/s); measured and fitted friction, N (N m) or coefficients.
    scatter : float
        Standard deviation of friction about the curve: a share of friction, or N (N m) with absolute errors.
    freedom : int
        Number of rows minus number of parameters.
    correlation : ndarray (p, p)
    notes : tuple of str
    """

    forward: bool
    estimates: tuple[SpeedEstimate, ...]
    law: FrictionLaw = field(repr=False)
    load: float
    speed: Array = field(repr=False)
    friction: Array = field(repr=False)
    fitted: Array = field(repr=False)
    scatter: float
    freedom: int
    correlation: Array = field(repr=False)
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> SpeedEstimate:
        """Estimate of a parameter by its name."""
        found = {one.name: one for one in self.estimates}
        if name not in found:
            raise KeyError(unknown_name("estimate", name, found))
        return found[name]

    def further(self, name: str) -> float:
        """Value of an estimate in addition to the law (internal preload, damping); 0 if it was not fitted."""
        return {one.name: one.value for one in self.estimates}.get(name, 0.0)


def fit_direction(
    table: SpeedTable, law: type[FrictionLaw], forward: bool, held: Mapping[str, float], relative: bool
) -> DirectionFit:
    """Fit to the rows of one direction of a table.

    Raises
    ------
    NotAvailable
        If the direction has too few speeds for the law.
    """
    rows = (table.speed > 0) == forward
    speed, friction = np.abs(table.speed[rows]), table.friction[rows]
    load = np.ones(len(speed)) if table.load is None or table.is_coefficient else table.load[rows]
    curve, notes = _chosen(table, law, speed, load, held, forward)
    low, high = curve.bounds(speed, load, friction)

    def residuals(inner: Array) -> tuple[Array, Array]:
        return curve.residuals(inner, speed, load, friction, relative)

    starts = curve.starts(speed, load, friction, relative)
    found, ends = intervals(least(residuals, starts, low, high), LEVELS)
    values = curve.values(found.at)
    typical = float(np.median(load))
    if table.load is not None:
        typical = float(np.median(table.load[rows]))
    estimates = tuple(
        _estimate(curve, i, values[i], ends[i], (low[i], high[i]), speed, table) for i in range(len(curve.free))
    )
    own = {name: float(value) for name, value in zip(curve.free, values, strict=True) if name not in (OFFSET, DAMPING)}
    return DirectionFit(
        forward, estimates, _with(curve.law, own), typical, speed, friction, curve.force(values, speed, load)[0],
        float(np.sqrt(found.variance)), found.freedom, _correlation(found), tuple(notes),
    )  # fmt: skip


def _with(law: FrictionLaw, values: Mapping[str, float]) -> FrictionLaw:
    """Law with some new values, which its constructor checks."""
    every = {item.name: getattr(law, item.name) for item in fields(law)} | dict(values)
    return type(law)(**every)


def _distinct(values: Array) -> int:
    return 1 + int(np.sum(np.diff(np.sort(values)) > SAME * np.abs(values).max()))


def _chosen(
    table: SpeedTable,
    law: type[FrictionLaw],
    speed: Array,
    load: Array,
    held: Mapping[str, float],
    forward: bool,
) -> tuple[SteadyCurve, list[str]]:
    """Curve with as many free parameters as the rows determine, and notes on parameters that are fixed."""
    notes: list[str] = []
    reference = float(np.exp(np.mean(np.log(speed))))
    speeds, fixed = _distinct(speed), dict(held)
    rows = f"{format_count(len(speed), 'row')} at {format_count(speeds, 'speed')}"
    curve = steady_curve(law, reference, fixed, ())
    if unknown := [name for name in held if name not in curve.roles]:
        raise ParameterError([Problem(unknown[0], unknown_name("parameter", unknown[0], curve.roles))])
    more = [OFFSET] if _distinct(load) > 1 else []
    more += [DAMPING] if more and any(curve.roles[name].kind == HELD[1] for name in curve.free) else []
    droppable = [name for kind in HELD for name in curve.free if curve.roles[name].kind == kind]
    for name in droppable:
        if len(curve.free) > speeds or len(curve.free) + len(more) >= len(speed):
            value = fixed[name] = curve.roles[name].standing or 0.0
            notes.append(f"{name} is held at {value:g}: {rows} are too few to determine it too")
            curve = steady_curve(law, reference, fixed, ())
    while more and len(curve.free) + len(more) >= len(speed):
        notes.append(f"{more.pop()} is left out: {len(speed)} rows are too few to determine it too")
    if len(curve.free) > speeds or len(curve.free) >= len(speed):
        way = "forward" if forward else "backward"
        raise NotAvailable(
            f"{table.source!r} has {rows} {way}; the law {law.name!r} needs "
            f"{len(curve.free)} speeds in {len(curve.free) + 1} rows at least"
        )
    return (steady_curve(law, reference, fixed, more) if more else curve), notes


def _correlation(found: ProfiledMinimum) -> Array:
    covariance = found.covariance()
    with np.errstate(all="ignore"):
        size = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(size, size))


def _estimate(
    curve: SteadyCurve, i: int, value: float, ends: Array, bounds: tuple[float, float], speed: Array, table: SpeedTable
) -> SpeedEstimate:
    name, role = curve.free[i], curve.roles[curve.free[i]]
    si = np.exp(ends) if curve.logarithmic[i] else np.array(ends)
    least_one = 0.0 if role.domain.low == 0 else -np.inf
    si = np.where(np.isneginf(ends), least_one, si)
    (low68, high68), (low, high) = si
    error = float(high68 - low68) / 2
    remark = ""
    if role.kind == "velocity scale" and not speed.min() <= value <= speed.max():
        side, end = ("below the slowest", speed.min()) if value < speed.min() else ("above the fastest", speed.max())
        size = unit(table.speed_unit)[0]
        remark = f"{side} measured speed, {end / size:.4g} {table.speed_unit}: beyond the table"
    open_below = bool(np.isneginf(ends[1, 0])) and (curve.logarithmic[i] or least_one < 0)
    open_above = bool(np.isposinf(ends[1, 1]))
    if open_below or open_above:
        which = "" if open_below and open_above else " from below" if open_below else " from above"
        remark = "; ".join(filter(None, [remark, f"not determined{which} by these speeds"]))
    return SpeedEstimate(
        name, float(value), error, unit_of(role, table, bool(curve.logarithmic[i])), float(low), float(high),
        likely=(float(low68), float(high68)), remark=remark,
    )  # fmt: skip


def unit_of(role: Parameter, table: SpeedTable, bent: bool) -> str:
    """SI unit of a parameter for a table: per force if the table has no load, per angle if its speeds are angular.

    `bent` is true for parameters to which friction is not proportional (scales and exponents).
    """
    shown = role.unit
    if shown == "N":  # the parameter is a load
        return "N m" if table.load_turns else "N"
    if table.load is None and not table.is_coefficient and not bent:
        shown = {"1": "N", "s/m": "N s/m"}.get(shown, shown)
    if table.turns:
        turned = {"N": "N m", "N s/m": "N m s/rad", "m/s": "rad/s", "s/m": "s/rad"}
        shown = turned.get(shown, shown)
    return shown


@dataclass(frozen=True, eq=False)
class SpeedFindings(ReadOnly):
    """Fits of a friction law to a table of speeds, separately forward and backward.

    Attributes
    ----------
    table : SpeedTable
    law : str
        Name of the law.
    forward, backward : DirectionFit or None
        None if the table has no speeds in that direction.
    bristles : BristleStiffness or None
        Stiffness from a loop before sliding, if a loop was given.
    relative : bool
        True if errors are in proportion to friction.
    """

    table: SpeedTable = field(repr=False)
    law: str
    forward: DirectionFit | None
    backward: DirectionFit | None
    bristles: BristleStiffness | None = None
    relative: bool = True

    @property
    def main(self) -> DirectionFit:
        """Fit of the forward direction, or of the backward direction if there is no other."""
        if (found := self.forward or self.backward) is None:
            raise InternalError("a fit of a table without rows")
        return found

    def __getitem__(self, name: str) -> SpeedEstimate:
        """Estimate of `main` by name."""
        return self.main[name]


FEWEST_ROWS = 5  # least number of rows of a loop: two forward, two backward, and the turning point
LEAST_RISE = 1e-3  # steps of displacement below this share of the largest step are not used for the stiffness


@dataclass(frozen=True)
class BristleStiffness:
    """Stiffness of bristles with its intervals, N/m (N m/rad for a rotation).

    Attributes
    ----------
    value, error : float
    low, high : float
        Ends of the 95 % interval.
    breakaway : float
        Force at which the bristles would slip, extrapolated from the curvature of the loop; N.
    scatter : float
        Standard deviation of the forces about the loop, N.
    """

    value: float
    error: float
    low: float
    high: float
    breakaway: float
    scatter: float


def loop_forces(displacement: Array, stiffness: float, breakaway: float, first: float) -> tuple[Array, Array]:
    """Forces (n,) of LuGre bristles at displacements (n,), and derivatives (n, 3) by ln K, ln F_S and the first force.

    At low speed dF/dx = K (1 − F sign(dx)/F_S) with stiffness K and breakaway force F_S: between turning points the
    force approaches ±F_S exponentially.
    """
    force, slopes = np.empty(len(displacement)), np.empty((len(displacement), 3))
    now, by = first, np.array([0.0, 0.0, 1.0])
    force[0], slopes[0] = now, by
    for i, step in enumerate(np.diff(displacement), start=1):
        end, decay = math.copysign(breakaway, step), math.exp(-abs(step) * stiffness / breakaway)
        rate = abs(step) * stiffness / breakaway * decay * (end - now)  # derivative of the force by ln(K/F_S)
        by = by * decay + np.array([rate, (1 - decay) * end - rate, 0.0])
        now = end + (now - end) * decay
        force[i], slopes[i] = now, by
    return force, slopes


def fit_loop(loop: PreslidingLoop) -> BristleStiffness:
    """Stiffness of bristles from a loop of force over displacement, with errors from the scatter of its forces.

    Raises
    ------
    NotAvailable
        If the loop has too few rows, or its force does not follow the displacement.
    """
    x, f = loop.displacement, loop.force
    if len(x) < FEWEST_ROWS:
        raise NotAvailable(
            f"{loop.source!r} has {format_count(len(x), 'row')} of a loop; allowed: {FEWEST_ROWS} or more"
        )
    if still := [name for name, column in (("displacement", x), ("force", f)) if not np.ptp(column) > 0]:
        raise NotAvailable(f"{loop.source!r}: its {still[0]} is the same in all rows; a loop goes forward and back")
    steps = np.diff(x)
    large = np.abs(steps) > LEAST_RISE * np.abs(steps).max()
    steep = float(np.median(np.diff(f)[large] / steps[large]))
    size, slope = float(np.abs(f).max()), max(steep, float(np.ptp(f) / np.ptp(x)) / 10)

    def residuals(inner: Array) -> tuple[Array, Array]:
        found, slopes = loop_forces(x, math.exp(inner[0]), math.exp(inner[1]), inner[2])
        return (found - f) / size, slopes / size

    low = np.array([math.log(slope) - 7, math.log(size) - 2, -2 * size])
    high = np.array([math.log(slope) + 7, math.log(size) + 5, 2 * size])
    starts = [np.array([math.log(slope * k), math.log(size * s), f[0]]) for k in (1, 3) for s in (1.02, 1.5)]
    found, ends = intervals(least(residuals, starts, low, high), LEVELS)
    if not np.all(np.isfinite(ends[0])):
        raise NotAvailable(f"no stiffness follows from the loop {loop.source!r}: its forces do not follow displacement")
    (low68, high68), (low95, high95) = np.exp(ends[0])
    return BristleStiffness(
        float(np.exp(found.at[0])), float(high68 - low68) / 2, float(low95), float(high95),
        float(np.exp(found.at[1])), float(np.sqrt(found.variance)) * size,
    )  # fmt: skip
