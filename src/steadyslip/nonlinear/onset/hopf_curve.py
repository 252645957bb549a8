"""Follow the oscillatory edge of stability in the plane of two parameters, by continuation of the Hopf condition.

Unknowns are the two parameters and the frequency; equations are the real and the imaginary part of the
characteristic polynomial at s = iβ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array, checked_array
from steadyslip.core.errors import InternalError, NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity, format_range
from steadyslip.core.options import checked, finite
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.linear.boundary import boundary
from steadyslip.linear.roots import roots
from steadyslip.linear.search import Search
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import characteristic, in_range
from steadyslip.nonlinear.continuation import Failure, Point, SolutionCurve, turned_round
from steadyslip.nonlinear.onset.coefficient import coefficients
from steadyslip.nonlinear.onset.hopf import onsets

DECADES = 6.0  # default range of a parameter: this many decades to each side of the rig's value
SMALLEST_FREQUENCY = 1e-4  # share of the frequency at the start below which the edge counts as one of divergence


@dataclass(frozen=True)
class SpecialPoint(Displayed):
    """A point of a Hopf curve at which the kind of onset changes.

    Attributes
    ----------
    kind : str
        ``generalised Hopf``.
    values : dict of str to float
        Both parameters at the point, SI units.
    bracket : tuple of dict
        The parameters, as in `values`, at a point on each side.
    angular_frequency : float
        rad/s.
    """

    kind: str
    values: dict[str, float]
    bracket: tuple[dict[str, float], dict[str, float]]
    angular_frequency: float


@dataclass(frozen=True, eq=False)
class HopfCurve(ReadOnly):
    """The oscillatory edge of stability in two parameters.

    Attributes
    ----------
    rig : Slider or Machine
    names, units : tuple of str
        Full names and SI units of the two parameters.
    first, second : ndarray (n,)
        Values of the two parameters at the points of the edge, SI units.
    angular_frequency : ndarray (n,)
        rad/s.
    coefficient : ndarray (n,)
        Cubic coefficient c1 of the onset (1/s), see `steadyslip.hopf`.
    kind : ndarray of str (n,)
        Kind of onset, as `Onset.kind`.
    is_edge : ndarray of bool (n,)
        False where another eigenvalue is unstable, so that stability does not change at this point.
    special : tuple of SpecialPoint
        ``generalised Hopf``: where the kind of onset changes.
    ends : tuple of str
        Why the curve stops at its beginning and at its end.
    """

    rig: Slider | Machine = field(repr=False)
    names: tuple[str, str]
    units: tuple[str, str]
    first: Array = field(repr=False)
    second: Array = field(repr=False)
    angular_frequency: Array = field(repr=False)
    coefficient: Array = field(repr=False)
    kind: Array = field(repr=False)
    is_edge: Array = field(repr=False)
    special: tuple[SpecialPoint, ...]
    ends: tuple[str, str]

    def plot(self, ax: Any = None) -> Any:
        """Draw the edge, coloured by the kind of onset; see `steadyslip.figures.hopf_curve`."""
        return draw(self, ax=ax)

    def __str__(self) -> str:
        a, b = self.names
        lines = [f"oscillatory edge in {a} and {b}: {len(self.first)} points"]
        for name, unit, column in zip(self.names, self.units, (self.first, self.second), strict=True):
            lines.append(
                f"  {name}  {format_range(float(column.min()), float(column.max()), unit, self.rig.printed_area(name))}"
            )
        for point in self.special:
            where = ", ".join(
                f"{n} = {format_quantity(point.values[n], u, 7, self.rig.printed_area(n))}"
                for n, u in zip(self.names, self.units, strict=True)
            )
            lines.append(f"  {point.kind} at {where}")
        lines.append(f"  ends: {self.ends[0]}; {self.ends[1]}")
        return "\n".join(lines)


@checked(spacing=finite(1e-4, 10, closed=True))
def hopf_curve(
    rig: Slider | Machine,
    first: str,
    second: str = "stiffness",
    *,
    between: Mapping[str, Sequence[Any]] | None = None,
    branch: int = 0,
    spacing: float = 0.05,
) -> HopfCurve:
    """Follow the oscillatory edge of stability through the plane of two parameters.

    Parameters
    ----------
    rig : Slider or Machine
        The curve starts at this rig's own `first`, at the edge in `second` nearest to its own value.
    first, second : str
        Dotted names or unique last parts.
    between : mapping of str to (low, high), optional
        Ranges of the parameters; by default their domains, and six decades to each side of positive values.
    branch : int, optional
        Index of the steady sliding, by rising normal stress, where a rig has several.
    spacing : float, optional
        Largest distance of neighbouring points, in natural logarithms of positive parameters or radians of angles.

    Returns
    -------
    HopfCurve

    Raises
    ------
    NotAvailable
        If there is no oscillatory edge to start from.
    UnknownNameError, ParameterError
        If names or ranges are wrong.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> curve = ss.hopf_curve(rig, "angle", between={"angle": ("-50 deg", "-40 deg")})
    >>> curve.names
    ('contact.angle', 'slider.stiffness')
    """
    names = (rig.parameter_along(first), rig.parameter_along(second))
    if names[0] == names[1]:
        raise ParameterError([Problem("second", f"got {second!r}, the same parameter as first; give another one")])
    plane = _Plane(rig, names, between or {}, branch)
    edges = [e for e in boundary(rig, names[1], branch=branch) if e.kind == "oscillatory" and e.stable != "neither"]
    if not edges:
        raise NotAvailable(f"no oscillatory edge of stability along {names[1]} to start from; try steadyslip.boundary")
    own = float(rig.parameters()[names[1]].value)  # type: ignore[arg-type]
    edge = min(edges, key=lambda e: abs(e.value - own))
    plane.reference = edge.angular_frequency
    guess = plane.coordinates(float(rig.parameters()[names[0]].value), edge.value, edge.angular_frequency)  # type: ignore[arg-type]
    curve = SolutionCurve(plane.equations, tolerance=1e-12)
    try:
        start = curve.start(guess, np.array([1.0, 0.0, 0.0]))
    except Failure:
        start = curve.start(guess, np.array([0.0, 1.0, 0.0]))
    forward, end = _followed(curve, start, plane, spacing)
    backward: list[Point] = []
    begin = end
    if end != "closed":
        backward, begin = _followed(curve, turned_round(start), plane, spacing)
    points = [*(turned_round(p) for p in reversed(backward)), start, *forward]
    return _described(rig, plane, curve, points, (begin, end))


class _Plane:
    """Hopf equations in coordinates (3,) of order one, and conversion to two parameters and a frequency."""

    def __init__(
        self, rig: Slider | Machine, names: tuple[str, str], between: Mapping[str, Sequence[Any]], branch: int
    ) -> None:
        self.rig, self.names, self.branch = rig, names, branch
        self.present = tuple({*rig.kept_zeros()} & {*names})
        if operating_point(rig).model.delays:
            raise NotAvailable("an edge with a delay cannot be followed in two parameters; stable_values has it in one")
        self.reference = 1.0
        self.roles = [rig.parameters()[name].role for name in names]
        given = {rig.parameter_along(name): pair for name, pair in between.items()}
        unknown = [name for name in given if name not in names]
        if unknown:
            raise ParameterError([Problem(f"between.{n}", f"allowed: {' and '.join(names)}") for n in unknown])
        self.logarithmic, self.scales, limits = [], [], []
        for name, role in zip(names, self.roles, strict=True):
            value = rig.parameters()[name].value
            if value is None:
                raise ParameterError([Problem(name, "missing in the rig; give it a value first")])
            positive = role.domain.low == 0 and not np.isfinite(role.domain.high) and value > 0
            size = abs(float(value)) or Search(rig, name, self.present, branch).natural_size()
            self.logarithmic.append(positive)
            self.scales.append(1.0 if np.isfinite(role.domain.high) and not positive else size)
            low, high = (size * 10.0**-DECADES, size * 10.0**DECADES) if positive else (
                max(role.domain.low, -size * 10.0**DECADES), min(role.domain.high, size * 10.0**DECADES))  # fmt: skip
            if name in given:
                if len(given[name]) != 2:
                    raise ParameterError([Problem(f"between.{name}", "allowed: two values, low and high")])
                low, high = (float(checked_array(name, role, x)) for x in given[name])
            limits.append((low, high))
        self.limits = limits

    def coordinates(self, first: float, second: float, omega: float) -> Array:
        """Coordinates (3,) of two parameter values (SI units) and an angular frequency (rad/s)."""
        parts = [
            np.log(value / scale) if logarithmic else value / scale
            for value, scale, logarithmic in zip((first, second), self.scales, self.logarithmic, strict=True)
        ]
        return np.array([*parts, np.log(omega / self.reference)])

    def parameters(self, u: Array) -> tuple[Array, Array, Array]:
        """Both parameters (SI units) and the angular frequency (rad/s), each (...), from coordinates (..., 3)."""
        first, second = (
            scale * (np.exp(u[..., i]) if logarithmic else u[..., i])
            for i, (scale, logarithmic) in enumerate(zip(self.scales, self.logarithmic, strict=True))
        )
        return first, second, self.reference * np.exp(u[..., 2])

    def values(self, u: Array) -> OperatingPoint:
        """Operating points at coordinates (m, 3); raises Failure outside the domain."""
        first, second, _ = self.parameters(u)
        for column, role in zip((first, second), self.roles, strict=True):
            if not np.all(role.domain.contains(column)):
                raise Failure("a parameter leaves its allowed range")
        both = dict(zip(self.names, (first, second), strict=True))
        found = operating_point(self.rig, both, self.present, self.branch, scan=True)
        if not np.all(found.valid):
            raise Failure("parameters leave the domain of the rig")
        return found

    def _polynomials(self, u: Array) -> tuple[Array, Array]:
        """Characteristic polynomial P(iβ) at coordinates (m, 3), and the sum of absolute values of its terms; (m,)."""
        values = self.values(u)
        if not np.all(in_range(values)):
            raise Failure("numbers leave the range of floating point")
        c = characteristic(values)
        if not np.all(np.isfinite(c)):
            raise Failure("no steady sliding")
        powers = (1j * self.parameters(u)[2][:, None]) ** np.arange(c.shape[-1])
        return np.sum(c * powers, axis=-1), np.sum(np.abs(c * powers), axis=-1)

    def equations(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (2,), real and imaginary part of P(iβ), and its Jacobian (2, 3) by central differences."""
        step = 1e-5
        shifts = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        found, size = self._polynomials(u + shifts)
        found = found / size[0]
        slope = (found[1:4] - found[4:]) / (2 * step)
        return np.array([found[0].real, found[0].imag]), np.array([slope.real, slope.imag])

    def outside(self, u: Array) -> str:
        """Reason for which the curve ends at this point; empty if it goes on."""
        first, second, omega = self.parameters(u)
        for name, value, (low, high) in zip(self.names, (first, second), self.limits, strict=True):
            if not low <= value <= high:
                return f"end of the range of {name}"
        if omega < SMALLEST_FREQUENCY * self.reference:
            return "the oscillation becomes infinitely slow (divergence beyond)"
        return ""


def _followed(curve: SolutionCurve, start: Point, plane: _Plane, spacing: float) -> tuple[list[Point], str]:
    """Points of the curve that follow `start` along its tangent, and the reason for which the curve ends.

    Where the curve leaves the range of a parameter, the last point lies on the limit.
    """
    found: list[Point] = []
    here = start
    try:
        for point in curve.follow(start, 0.2 * spacing, 1e-4 * spacing, spacing):
            reason = plane.outside(point.u)
            if reason:
                found += _on_the_limit(curve, here, point, plane)
                return found, reason
            found.append(point)
            here = point
            if len(found) > 20 and np.linalg.norm(point.u - start.u) < 0.6 * spacing:
                return found, "closed"
            if len(found) >= 5000:
                return found, "too many points; give ranges with between="
    except Failure as failure:
        return found, str(failure)
    raise InternalError("following the oscillatory edge stopped without a reason; this is a bug, please report it")


def _on_the_limit(curve: SolutionCurve, inside: Point, outside: Point, plane: _Plane) -> list[Point]:
    """List with the point at which the curve leaves the range of a parameter; empty if the point is not found."""
    values = [plane.parameters(p.u) for p in (inside, outside)]
    for i, (low, high) in enumerate(plane.limits):
        a, b = float(values[0][i]), float(values[1][i])
        for limit in (low, high):
            if (a - limit) * (b - limit) < 0:
                measure = lambda p, i=i, limit=limit: float(plane.parameters(p.u)[i]) - limit  # noqa: E731
                try:
                    pair = curve.located(inside, outside, measure, a - limit, b - limit)
                except Failure:
                    return []
                return [min(pair, key=lambda p: bool(plane.outside(p.u)))]
    return []


def _described(
    rig: Slider | Machine, plane: _Plane, curve: SolutionCurve, points: list[Point], ends: tuple[str, str]
) -> HopfCurve:
    """Result of `hopf_curve`, with the kind of onset at each point and the points at which it changes."""
    u = np.array([point.u for point in points])
    values = plane.values(u)
    first, second, omega = plane.parameters(u)
    found, kind = onsets(values, omega, plane.names[1])
    growth = roots(characteristic(values))
    beside = np.where(np.abs(np.abs(growth.imag) - omega[:, None]) < 1e-6 * omega[:, None], -np.inf, growth.real)
    is_edge = np.max(np.where(np.isnan(beside), -np.inf, beside), axis=1) <= 0

    def measure(point: Point) -> float:
        at = point.u[None]
        return float(coefficients(plane.values(at), plane.parameters(at)[2]).c1[0])

    def named(point: Point) -> dict[str, float]:
        return dict(zip(plane.names, map(float, plane.parameters(point.u)[:2]), strict=True))

    special = []
    c1, signs = found.c1, {"supercritical", "subcritical"}
    for i in range(len(points) - 1):
        if {kind[i], kind[i + 1]} == signs:
            try:
                pair = curve.located(points[i], points[i + 1], measure, float(c1[i]), float(c1[i + 1]))
            except Failure:
                continue
            best = pair[1]
            bracket = (named(pair[0]), named(pair[1]))
            special.append(SpecialPoint("generalised Hopf", named(best), bracket, float(plane.parameters(best.u)[2])))
    units = tuple(role.unit for role in plane.roles)
    return HopfCurve(
        rig, plane.names, (units[0], units[1]), first, second, omega, c1, kind, is_edge, tuple(special), ends
    )
