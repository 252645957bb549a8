"""`boundary` and `margins`: edges of stability in one parameter; distance of each parameter from its nearest edge."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import checked_array
from steadyslip.core.errors import ParameterError, Problem, UndecidedWarning
from steadyslip.core.format import format_quantity
from steadyslip.core.options import LOW_AND_HIGH, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.roles import Parameter
from steadyslip.linear.allowance import at_most
from steadyslip.linear.coupling import search_for
from steadyslip.linear.matrix_coupling import search_matrices
from steadyslip.linear.matrix_route import require_matrices
from steadyslip.linear.matrix_search import MatrixSearch
from steadyslip.linear.measured_search import MeasuredSearch
from steadyslip.linear.nearness import doublings, ends_about
from steadyslip.linear.search import Boundary, Search
from steadyslip.linear.undamped import is_undamped
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.linearisation import is_written_out
from steadyslip.model.numeric import by_matrices, has_response, in_numbers
from steadyslip.model.numeric.machine_point import machine_point
from steadyslip.model.point import operating_point
from steadyslip.model.range import require_digits, require_range

_TOO_MANY = "roots under the delays are too many there to be counted; shorten the delays"
_ERRORS = "the response is too short, too coarse or too uncertain there; analyze says which"
_TERMS = 12_000_000  # most terms evaluated on the imaginary axis in the searches of all margins: some five seconds
REMOTE = 100  # factor between value and edge above which the edge ranks last: nobody changes a rig as much
_TIED = 6  # significant digits to which distances are compared, so that rounding errors do not change their order


@dataclass(frozen=True)
class Margin(Displayed):
    """Distance of one parameter from its nearest edge of stability, and all its edges.

    Attributes
    ----------
    parameter, unit : str
    value : float
        Value in the rig, SI unit.
    edge : Boundary or None
        Nearest edge by `steadyslip.linear.nearness`; None if stability does not change in the range searched.
    edges : tuple of Boundary
        All edges in the range searched.
    absolute : float
        Signed distance edge − value; NaN without edge.
    relative : float
        ``absolute``/|value|; NaN where the value is zero or there is no edge.
    searched : tuple of float
        The range searched.
    """

    parameter: str
    unit: str
    value: float
    edge: Boundary | None
    edges: tuple[Boundary, ...]
    absolute: float
    relative: float
    searched: tuple[float, float]

    @property
    def remote(self) -> bool:
        """True if the nearest edge is more than a factor `REMOTE` from the value; never for angles and zero values."""
        return self.edge is not None and self.is_remote(self.edge)

    @property
    def about(self) -> tuple[Boundary, ...]:
        """The next edge below the value and the next above, nearer one first.

        A remote edge is given only if it is the nearest.
        """
        found = edges_about(self.value, self.edges)
        return found[:1] + tuple(edge for edge in found[1:] if not self.is_remote(edge))

    def is_remote(self, edge: Boundary) -> bool:
        """True if an edge is more than a factor `REMOTE` from the value; never for angles and zero values."""
        return self.unit != "rad" and bool(doublings(self.value, edge.value) >= math.log2(REMOTE))


@checked(between=LOW_AND_HIGH)
def boundary(
    rig: Slider | Machine, name: str, between: Sequence[Any] | None = None, *, branch: int = 0
) -> tuple[Boundary, ...]:
    """Every value of a parameter at which stability of steady sliding changes.

    Parameters
    ----------
    rig : Slider
    name : str
        Dotted name, or a unique last part, of any parameter that the rig has.
    between : (low, high), optional
        Range to search, SI units or text such as ``"10 deg"``. By default it is the whole domain of angles and shares;
        for other parameters six decades to each side of the value and of its typical size, with both signs if they
        are allowed. The range does not change the edges that are found inside it.
    branch : int
        Index of the steady state, by rising normal stress, if there are several.

    Returns
    -------
    tuple of Boundary
        Edges by rising value; empty if stability does not change in the range. A `linear.UndecidedWarning` names
        parts of the range in which edges are not known, as roots under long delays are too many to be counted.

    Raises
    ------
    UnknownNameError, ParameterError
        If the name is unknown or the range is not inside the parameter's domain.
    NotAvailable
        If the numbers of the rig leave the range of floating point, or rounding hides eigenvalues.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> for edge in ss.boundary(rig, "stiffness"):
    ...     print(edge)
    slider.stiffness = 29.0698 GPa/m: oscillatory, period 33.08 s, stable above
    """
    full = rig.resolve(name)
    role = _role(rig, full)
    limits = None if between is None else _checked_range(full, role, [rig.read(full, one) for one in between])
    if not by_matrices(rig):
        _require_answers(rig, branch)
        if limits is not None:
            operating_point(
                rig, {full: np.asarray(limits)}, rig.kept_zeros(full), branch
            )  # raises an error if an end of the range breaks a condition between parameters
    search = _search(rig, full, rig.kept_zeros(full), branch)
    found = search.boundaries(limits)
    if unknown := _unknown(rig, search, *(limits or search.searched)):
        why = _ERRORS if isinstance(search, MeasuredSearch) else _TOO_MANY
        warnings.warn(f"edges of {unknown} are not decided: {why}", UndecidedWarning, stacklevel=3)
    return found


def searched(rig: Rig, name: str) -> tuple[float, float]:
    """Range of a parameter (SI units) that `boundary` searches by default."""
    return _search(rig, name, rig.kept_zeros(name), 0).searched


def _search(rig: Rig, name: str, present: tuple[str, ...], branch: int) -> Search | MatrixSearch | MeasuredSearch:
    if by_matrices(rig):
        return _matrix_search(rig, name)
    if isinstance(rig, Machine) and not (present or branch) and _is_numeric(rig, name):
        return search_matrices(rig, name)
    return search_for(rig, name, present, branch)


def _is_numeric(machine: Machine, name: str) -> bool:
    """True if both the equations and the matrices would be evaluated as numbers; matrices need fewer samples then."""
    own = operating_point(machine)
    if is_written_out(own.model) or not (own.exists and in_numbers(machine)):
        return False
    return bool(machine.parameters()[name].value) and not machine_point(machine).balance.problem


def _matrix_search(rig: Machine, name: str) -> MatrixSearch | MeasuredSearch:
    if has_response(rig):
        return MeasuredSearch(rig, name)
    require_matrices(rig)
    return search_matrices(rig, name)


def _unknown(rig: Rig, search: Search | MatrixSearch | MeasuredSearch, low: float, high: float) -> str:
    """Text that names the parameter and the parts of `low` to `high` in which its edges are unknown, or ""."""
    if search.hides:
        return f"{search.name} near some values"
    first, last = search.decided
    gaps = search.gaps if isinstance(search, MeasuredSearch) else ((low, first), (last, high))
    parts = [_where(rig, search, gap, low, high) for gap in gaps if gap[0] < gap[1]]
    return f"{search.name} {' and '.join(parts)}" if parts else ""


def _where(
    rig: Rig, search: Search | MatrixSearch | MeasuredSearch, gap: tuple[float, float], low: float, high: float
) -> str:
    """Text that describes a part `gap` of the range from `low` to `high`, such as "below 3 Pa"."""
    first, last = (format_quantity(end, search.role.unit, area=rig.area_of(search.name)) for end in gap)
    if gap[0] <= low and gap[1] < high:
        return f"below {last}"
    return f"above {first}" if gap[0] > low and gap[1] >= high else f"from {first} to {last}"


def _require_answers(rig: Rig, branch: int) -> None:
    point = operating_point(rig, branch=branch)
    require_range(point)
    require_digits(point)


@checked()
def margins(rig: Slider | Machine, *, branch: int = 0) -> tuple[Margin, ...]:
    """Distance of every parameter to its nearest edge of stability, the most critical first.

    Parameters whose edges take too long to find are left out (with delays, or if a parameter changes a whole
    structure): the searches together take at most some ten seconds. `boundary` has no such limit; `analyze` names the
    parameters that are missing.

    Raises
    ------
    NotAvailable
        If the numbers of the rig leave the range of floating point, or rounding hides eigenvalues.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> nearest = ss.margins(rig)[0]
    >>> nearest.parameter, round(nearest.relative, 4)
    ('friction.b', -0.0647)
    """
    return margins_and_missing(rig, branch)[0]


def margins_and_missing(rig: Rig, branch: int = 0) -> tuple[tuple[Margin, ...], tuple[str, ...]]:
    """Result of `margins`, and the names of the parameters whose edges took too long to find.

    If edges are known in a part of the range only, that part is `searched` of the margin; the parameter is also listed
    as missing, with the rest of the range in words, if its nearest edge may lie there.
    """
    if not by_matrices(rig):
        _require_answers(rig, branch)
    present, zeros = rig.kept_zeros(), _zero_dampings(rig)
    asked = [
        (name, address)
        for name, address in rig.parameters().items()
        if not address.role.gauge
        and address.value is not None
        and (address.value != 0 or not address.role.structural or name in present or name in zeros)
    ]
    found, cut, share, left = [], [], 0, _TERMS
    while asked and left // len(asked) > share:  # repeat slow searches with the terms that fast searches left over
        missing, share = [], left // len(asked)
        for name, address in asked:
            with at_most(share) as allowance:
                search = _search(rig, name, present if address.value else rig.kept_zeros(name), branch)
                edges = search.boundaries(None)
            left -= share - allowance.left
            if allowance.spent or search.hides:
                missing.append((name, address))
                continue
            (low, high), (first, last) = search.searched, search.decided
            own = _margin(name, address.role.unit, search.value, edges, (max(low, first), min(high, last)))
            cut_off = [end for end in (first, last) if low < end < high]
            next_to = [*cut_off, *(() if own.edge is None else (own.edge.value,))]
            if ends_about(search.value, next_to, own.unit)[:1] in [(end,) for end in cut_off]:
                cut.append(_unknown(rig, search, low, high))
                if not isinstance(search, MeasuredSearch):  # measured structures report edges and gaps together
                    continue
            found.append(own)
        asked = missing
    return tuple(sorted(found, key=_urgency)), (*(name for name, _ in asked), *cut)


def _zero_dampings(rig: Rig) -> tuple[str, ...]:
    """Names of a machine's dampings that are 0 but may be changed.

    Empty if the machine is undamped: any damping decides then.
    """
    found = [name for name, one in rig.parameters().items() if name.endswith(".damping") and one.value == 0]
    if not found or by_matrices(rig) or is_undamped(operating_point(rig)):
        return ()
    return tuple(found)


def without_edges(found: Sequence[Margin], lost: Sequence[Boundary]) -> tuple[Margin, ...]:
    """Margins recomputed without the edges in `lost`, the most critical first."""
    if not lost:
        return tuple(found)
    gone = set(lost)
    kept = [(one, tuple(edge for edge in one.edges if edge not in gone)) for one in found]
    others = [_margin(one.parameter, one.unit, one.value, edges, one.searched) for one, edges in kept]
    return tuple(sorted(others, key=_urgency))


def _margin(name: str, unit: str, value: float, edges: tuple[Boundary, ...], searched: tuple[float, float]) -> Margin:
    """Margin of a parameter, from its value and its edges."""
    edge = next(iter(edges_about(value, edges)), None)
    gap = edge.value - value if edge else float("nan")
    return Margin(name, unit, value, edge, edges, gap, gap / abs(value) if value else float("nan"), searched)


def _urgency(margin: Margin) -> tuple[bool, float]:
    """Sorting key: number of doublings to the edge; remote edges, zero values and missing edges come last.

    Distances that differ by rounding only give equal keys, so that parameters stay in the order of the rig.
    """
    if margin.edge is None:
        return True, np.inf
    if not margin.value and margin.unit != "rad":
        return True, 1e300
    far = float(doublings(margin.value, margin.edge.value, margin.unit))
    return margin.remote, float(f"{far:.{_TIED}g}") if far > 10.0**-_TIED else 0.0


def edges_about(own: float, edges: Sequence[Boundary]) -> tuple[Boundary, ...]:
    """The next edge below a parameter's value `own` and the next above, nearer one first."""
    at = {edge.value: edge for edge in edges}
    return tuple(at[end] for end in ends_about(own, list(at), edges[0].unit if edges else ""))


def _role(rig: Rig, full: str) -> Parameter:
    address = rig.parameters()[full]
    if address.value is None:
        raise ParameterError([Problem(full, "has no boundary: the rig does not have it; give it a value first")])
    return address.role


def _checked_range(name: str, role: Parameter, between: Sequence[Any]) -> tuple[float, float]:
    if len(between) != 2:
        raise ParameterError([Problem(name, f"between={between!r}; allowed: two values, low and high")])
    low, high = (float(checked_array(name, role, value)) for value in between)
    if not low < high:
        raise ParameterError([Problem(name, f"between={between!r}; allowed: low < high")])
    return low, high


def oscillatory_edge(distances: Sequence[Margin]) -> Boundary | None:
    """Edge of the first margin (nearest first) at which oscillations begin; None if there is none."""
    edges = [one.edge for one in distances if one.edge is not None]
    return next((edge for edge in edges if edge.kind == "oscillatory" and edge.stable != "neither"), None)
