"""Kind of onset (supercritical or subcritical) at an oscillatory edge of stability, from the cubic coefficient c1.

At an oscillatory edge the amplitude ρ of ln(v/v0) (of a machine: at the contact where it is largest) obeys to lowest
order

    ρ' = Re(dλ/dp) (p − p_edge) ρ + c1 ρ³

(theory 6). c1 < 0: supercritical, a small stable oscillation grows out of the edge on its unstable side.
c1 > 0: subcritical, an unstable oscillation shrinks onto steady sliding on its stable side, so that small kicks make
the rig leave steady sliding. c1 is local: it does not predict the effect of large kicks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.checks import Check, check, in_words
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.core.options import BRANCH, NAME, checked
from steadyslip.core.pages import Displayed
from steadyslip.linear.boundary import boundary, edges_about
from steadyslip.linear.linear_sets import linear_sets
from steadyslip.linear.nearness import nearest_end
from steadyslip.linear.polynomials import stable_set
from steadyslip.linear.search import Boundary
from steadyslip.linear.stiffness import in_chunks, stiffness_polynomials
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.eigenvalues import eigenvalues_of
from steadyslip.model.linearisation import is_written_out
from steadyslip.model.numeric import refuse_response
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.posed import spare_powers
from steadyslip.model.range import quasipolynomial, require_range
from steadyslip.nonlinear.onset.coefficient import Cubic, coefficients
from steadyslip.nonlinear.onset.high_precision import coefficient as in_digits

TRUSTED = 1e-6
"""Relative error of c1 above which it is computed again, in fifty digits."""
WEAK = 1e-9
"""|c1| over the sum of the sizes of its terms, below which motion computed in double precision does not resolve it."""
UNDECIDED = "not decided"


@dataclass(frozen=True)
class Onset(Displayed):
    """Kind of onset at an oscillatory edge of stability, with the numbers that decide it.

    Attributes
    ----------
    rig : Slider or Machine
    along : str
        The parameter that is varied.
    value : float
        Value of the parameter at the edge, SI units.
    unit : str
    kind : str
        ``supercritical``, ``subcritical``, ``degenerate`` (`coefficient` vanishes in exact arithmetic) or ``not
        decided`` (`coefficient` is below `coefficient_error`).
    coefficient : float
        c1, growth rate of the amplitude per squared amplitude of ln v (for a machine: at `contact`), 1/s. NaN if it is
        beyond floating point.
    coefficient_error : float
        Bound of the change of c1 by rounding, that of the rig's own numbers included, 1/s.
    share : float
        |c1| over the sum of the absolute values of its terms; small where they cancel.
    angular_frequency : float
        rad/s.
    growth_slope : float
        Re(dλ/dp), 1/s per unit of the parameter.
    stress_ratio : float
        Amplitude of the spring stress (Pa) for unit amplitude of ln v; for a machine, of the pull at `contact` (N).
    stable : str
        ``above`` or ``below``: the side of the edge on which sliding is stable.
    contact : str
        For a machine: the contact whose slip rate oscillates most, relative to its steady value; else empty.
    shares : dict of str to float
        For a machine, by name of the contact: amplitude of ln v there over that at `contact`.
    """

    rig: Slider | Machine
    along: str
    value: float
    unit: str
    kind: str
    coefficient: float
    coefficient_error: float
    share: float
    angular_frequency: float
    growth_slope: float
    stress_ratio: float
    stable: str
    contact: str = ""
    shares: Mapping[str, float] = field(default_factory=dict)

    @property
    def has_sign(self) -> bool:
        """True if the sign of the cubic coefficient is known."""
        return self.kind in ("supercritical", "subcritical")

    @property
    def checks(self) -> tuple[Check, ...]:
        """Check that the cubic coefficient exceeds its error, or vanishes in exact arithmetic."""
        share = 0.0 if self.kind == "degenerate" else self.coefficient_error / (abs(self.coefficient) or np.nan)
        return (check("kind of onset", "error of the cubic coefficient", share, 1.0),)

    @property
    def is_weak(self) -> bool:
        """True if the cubic coefficient is too small to affect motion in double precision, or its sign is unknown."""
        return not (self.has_sign and self.share > WEAK)

    @property
    def title(self) -> str:
        """Noun phrase for the kind, such as "supercritical onset"."""
        return "onset of a kind not decided" if self.kind == UNDECIDED else f"{self.kind} onset"

    @property
    def normalised(self) -> float:
        """c1 in units of the angular frequency: growth per radian at unit amplitude of ln v."""
        return self.coefficient / self.angular_frequency

    def velocity_amplitude(self, value: Any) -> Any:
        """Amplitude of ln(v/v0) of the small cycle at values of the parameter; NaN on the side without one.

        Lowest order: the error grows with the distance from the edge.
        """
        if not self.has_sign:
            return np.full(np.shape(value), np.nan)[()]
        with np.errstate(invalid="ignore"):
            squared = -self.growth_slope * (np.asarray(value, dtype=float) - self.value) / self.coefficient
            return np.sqrt(np.where(squared >= 0, squared, np.nan))[()]

    @property
    def is_near(self) -> bool:
        """True if the rig is so near the edge that the predicted amplitude of ln v of its small cycle is below 1.

        Friction depends on ln v, so an amplitude of ln v below 1 (velocity changes by a factor below e) is small.
        """
        own = self.rig.parameters()[self.along].value
        return own is not None and bool(self.velocity_amplitude(own) < 1.0)

    def stress_amplitude(self, value: Any) -> Any:
        """Amplitude of the spring stress (Pa), or of the pull at a machine's contact (N), at values of the parameter.

        NaN and errors as for `velocity_amplitude`.
        """
        return self.stress_ratio * self.velocity_amplitude(value)

    @property
    def meaning(self) -> str:
        """One sentence that explains the kind of onset."""
        return MEANINGS[self.kind]

    def __str__(self) -> str:
        edge = format_quantity(self.value, self.unit, 6, self.rig.printed_area(self.along))
        lines = [f"{self.title} at {self.along} = {edge}", f"  {self.meaning}"]
        where = f" at {self.contact}" if self.contact else ""
        size = f"{self.normalised:.4g}{self._within()} of the frequency per squared amplitude of ln v{where}"
        lines.append(f"  cubic coefficient {size}, period {format_quantity(2 * np.pi / self.angular_frequency, 's')}")
        return "\n".join([*lines, f"  {in_words(self.checks)}"])

    def _within(self) -> str:
        """Format the error of the coefficient, as " ± 0.1" in units of the frequency; empty if the sign is known."""
        return f" ± {self.coefficient_error / self.angular_frequency:.2g}" if self.kind == UNDECIDED else ""


MEANINGS = {
    "supercritical": "just beyond the edge a small steady oscillation appears and grows with the distance; "
    "this says nothing about large kicks",
    "subcritical": "just on the stable side a small unstable oscillation surrounds steady sliding, "
    "and a small kick is enough to throw it out; farther from the edge this says nothing",
    "degenerate": "the cubic coefficient vanishes: at the edge small oscillations neither grow nor decay to lowest "
    "order, and larger ones decide",
    UNDECIDED: "the cubic coefficient is smaller than what rounding of the numbers may have made of it",
}


@checked(branch=BRANCH, along=NAME)
def hopf(rig: Slider | Machine, along: str = "stiffness", *, branch: int = 0) -> Onset:
    """Find the kind of onset at the oscillatory edge of stability nearest to the rig.

    Parameters
    ----------
    rig : Slider or Machine
    along : str, optional
        Dotted name, or unique last part, of the parameter whose edge is meant; required for a machine with
        several stiffnesses.
    branch : int, optional
        Index of the steady sliding, by rising normal stress, where a rig has several.

    Returns
    -------
    Onset

    Raises
    ------
    NotAvailable
        If stability has no oscillatory edge in that parameter; the message lists the edges it has.
    UnknownNameError, ParameterError
        If the parameter is unknown.

    Notes
    -----
    First Lyapunov coefficient as in `steadyslip.nonlinear.onset.coefficient`; theory 6 has closed forms.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> onset = ss.hopf(rig)
    >>> onset.kind, round(onset.value / 1e9, 3)
    ('supercritical', 29.07)
    """
    refuse_response(rig)
    name = rig.parameter_along(along)
    edges = [edge for edge in boundary(rig, name, branch=branch) if edge.stable != "neither"]
    oscillatory = [edge for edge in edges if edge.kind == "oscillatory"]
    if not oscillatory:
        require_range(operating_point(rig, branch=branch))
        found = "; ".join(str(edge) for edge in edges) or "stability does not change at all"
        raise NotAvailable(f"no oscillatory edge of stability along {name}: {found}")
    own = float(rig.parameters()[name].value)  # type: ignore[arg-type]  # boundary() refuses None
    return onset_at(rig, edges_about(own, oscillatory)[0], branch)


def onset_at(rig: Slider | Machine, edge: Boundary, branch: int = 0) -> Onset:
    """Kind of onset at a given oscillatory edge."""
    name = edge.parameter
    point = _points_at(rig, name, [edge.value], branch)
    found, kind = onsets(point, np.array([edge.angular_frequency]), name)
    names = [contact.name for contact in point.model.contacts]
    most = int(found.contact[0])
    return Onset(
        rig=rig,
        along=name,
        value=edge.value,
        unit=edge.unit,
        kind=str(kind[0]),
        coefficient=float(found.c1[0]),
        coefficient_error=float(found.error[0]),
        share=float(found.share[0]),
        angular_frequency=edge.angular_frequency,
        growth_slope=_growth_slope(rig, name, edge, branch),
        stress_ratio=float(found.stress_ratio[0]),
        stable=edge.stable,
        contact=names[most],
        shares=dict(zip(names, map(float, found.shares[0]), strict=True)) if names[most] else {},
    )


def _points_at(rig: Slider | Machine, name: str, at: Any, branch: int) -> OperatingPoint:
    """Operating points with the parameter `name` at the values `at` (m,), SI units."""
    present = (name,) if rig.parameters()[name].role.structural else ()
    return operating_point(rig, {name: np.asarray(at, dtype=float)}, present, branch, scan=True)


def _growth_slope(rig: Slider | Machine, name: str, edge: Boundary, branch: int) -> float:
    """Re(dλ/dp) from the characteristic function, or from eigenvalues where its polynomial is too long to be written.

    Central differences along the parameter, with Richardson extrapolation.
    """
    size = abs(edge.value) or 1e-3
    steps = np.array([1e-3, -1e-3, 5e-4, -5e-4]) * size
    s, points = 1j * edge.angular_frequency, _points_at(rig, name, edge.value + steps, branch)
    by_roots = not (points.model.delays or is_written_out(points.model))
    if by_roots:
        found = eigenvalues_of(points)
        at = found[np.arange(len(steps)), np.nanargmin(np.abs(found - s), axis=-1)]
    else:
        at, _ = _characteristic(points, s)
    slope = (4 * (at[2] - at[3]) / (2 * steps[2]) - (at[0] - at[1]) / (2 * steps[0])) / 3
    if by_roots:
        return float(slope.real)
    _, down = _characteristic(_points_at(rig, name, [edge.value], branch), s)
    return float((-slope / down[0]).real)


def _characteristic(point: OperatingPoint, s: complex) -> tuple[Array, Array]:
    """Characteristic function (m,) of rigs at a complex s (1/s), and its derivative in s (m,)."""
    c, delays = quasipolynomial(point)
    n = np.arange(c.shape[-1])
    late = np.exp(-s * delays)
    terms, slopes = c @ s**n, (c[..., 1:] * n[1:]) @ s ** n[:-1]
    return np.sum(terms * late, axis=-1), np.sum((slopes - delays * terms) * late, axis=-1)


def onsets(point: OperatingPoint, omega: Array, along: str) -> tuple[Cubic, Array]:
    """Cubic coefficients (m,) of rigs on an oscillatory edge, and their kinds of onset (m,), as in `Onset.kind`.

    Where the relative error of a coefficient exceeds `TRUSTED`, it is computed again in fifty digits, after solving for
    the edge in the parameter `along` to as many.
    """
    found = coefficients(point, omega)
    c1, error = found.c1.copy(), found.error.copy()
    name = along if along in point.model.parameters else "slider.stiffness"  # for axial stiffness too
    for i in np.flatnonzero(~(error <= TRUSTED * np.abs(c1))):
        own = point.part(np.array([i]))
        exact = in_digits(own, name, float(omega[i]), int(found.contact[i]), found.vector[i], float(error[i]))
        if exact is not None:
            c1[i], error[i] = exact
    kind = np.where(c1 < 0, "supercritical", "subcritical").astype(object)
    kind[~(np.abs(c1) > error)] = UNDECIDED
    kind[(c1 == 0) & (error == 0)] = "degenerate"
    return replace(found, c1=c1, error=error), kind


KINDS = ("none", "supercritical", "subcritical", "degenerate", UNDECIDED)
"""Kinds of onset; `onset_map` returns indices into this tuple."""


def onset_map(
    rig: Slider | Machine, vary: Mapping[str, Any] | None = None, along: str = "slider.stiffness"
) -> dict[str, Any]:
    """Kinds of onset of many rigs, each at the oscillatory edge nearest to its own value of a parameter.

    Parameters
    ----------
    rig : Slider or Machine
    vary : mapping of str to array_like or xarray.DataArray, optional
        Arrays of values (SI units) by dotted name of the parameter; they are broadcast.
    along : str, optional
        A parameter that enters the equations linearly; by default a slider's stiffness.

    Returns
    -------
    dict of str to ndarray or xarray.DataArray
        ``kind`` (index into `KINDS`), ``edge`` (SI; of the gain kp for a rig without spring) and ``coefficient`` (c1,
        1/s). Without an oscillatory edge ``kind`` is the index of ``none``, and edge and c1 are NaN.

    Raises
    ------
    ParameterError
        If a name or value is not allowed.
    NotAvailable
        If the parameter does not enter linearly, or with a delay.
    """
    point = operating_point(rig, vary)
    name = rig.parameter_along(along)
    unit = rig.parameters()[name].role.unit
    name = name if name in point.model.parameters else "slider.stiffness"  # as in `onsets`
    found = in_chunks(point, lambda part: _onsets(part, name))
    kind, edge, coefficient = np.moveaxis(np.asarray(found), -1, 0)
    return {
        "kind": point.wrap(kind.astype(np.int8), "onset", "1"),
        "edge": point.wrap(edge, "onset_edge", unit),
        "coefficient": point.wrap(coefficient, "onset_coefficient", "1/s"),
    }


def _onsets(point: OperatingPoint, name: str) -> Array:
    """Index of the kind of onset, edge (SI) and c1 (1/s) of each rig, array (..., 3), along the parameter `name`."""
    place = list(point.model.parameters).index(name)
    arguments = list(point.arguments)
    own = np.broadcast_to(arguments[place], point.shape).reshape(-1)
    if name == "slider.stiffness":
        p, q = (np.broadcast_to(c, (*point.shape, c.shape[-1])) for c in stiffness_polynomials(point))
        found = stable_set(p, q, spare_powers(point))
    else:
        found = linear_sets(point, name)
    count = point.size
    edges, frequencies, changes = (a.reshape(count, -1) for a in (found.edges, found.frequencies, found.changes))
    usable = changes.astype(bool) & (frequencies > 0) & np.isfinite(frequencies)
    nearest = nearest_end(np.where(usable, edges, np.nan), own, point.model.roles[name].unit)
    rows = np.flatnonzero(usable.any(axis=1))
    result = np.full((count, 3), np.nan)
    result[:, 0] = KINDS.index("none")
    if len(rows):
        flat = [np.broadcast_to(a, point.shape).reshape(-1)[rows] if np.ndim(a) else a for a in arguments]
        flat[place] = edges[rows, nearest[rows]]
        at_edge = replace(point, arguments=tuple(flat), shape=(len(rows),))
        numbers, kind = onsets(at_edge, frequencies[rows, nearest[rows]], name)
        result[rows, 0] = [KINDS.index(one) for one in kind]
        result[rows, 1] = flat[place]
        result[rows, 2] = numbers.c1
    return result.reshape(*point.shape, 3)
