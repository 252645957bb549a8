"""Checks of each number of a verdict by a second, independent computation.

- Steady sliding: with the laws' own methods, forces balance and memory variables are constant.
- Eigenvalues: the characteristic matrix is singular at them; the argument principle counts as many growing ones.
- Edges: small disturbances grow on one side and decay on the other.
- Critical stiffness: a root lies on the imaginary axis.

A number that fails is left out of the verdict; the text about it begins with ``not decided``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.caching import cached
from steadyslip.core.checks import UNDECIDED, Check, check
from steadyslip.core.expressions import ArrayFunction
from steadyslip.laws.friction.law import FrictionLaw
from steadyslip.linear.allowance import at_most
from steadyslip.linear.boundary import Margin, without_edges
from steadyslip.linear.pencil import GOOD, checked_spectrum
from steadyslip.linear.search import Boundary
from steadyslip.linear.spectrum import can_be_counted, counts, distance_from_axis, is_ill_posed, spectrum
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE, is_neutral
from steadyslip.linear.undamped import is_undamped
from steadyslip.machine.rig import Rig
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import in_range
from steadyslip.model.steady_results import SteadyMachine

Array = NDArray[np.float64]

BALANCE_TOLERANCE = 1e-8
"""Allowed residual of steady sliding: of a stress relative to that stress; of a memory rate relative to its change
when velocity, stress or memory changes by a factor e. Chosen by trial: above rounding, below the effect of a wrong
number."""
SIDE_OFFSETS = (1e-7, 1e-5, 1e-9)
"""Distances from an edge, relative to its value, at which stability on both sides is computed, in this order, until it
agrees with the edge. Chosen by trial: too near, rounding decides; too far, another edge lies between."""
FURTHER_OFFSETS = (1e-3, 1e-2)
"""Larger distances, tried after `SIDE_OFFSETS` for ill-posed edges (with several delays, too many roots lie near them
to be counted) and for edges at which the parameter hardly moves the root on the imaginary axis."""
AXIS_TOLERANCE = 1e-6
"""Allowed distance of a root from the imaginary axis at the critical stiffness, relative to the size of the root.
Chosen by trial, like `GOOD`."""

DOUBLE_ROOT = 1e-6
"""Ratio of real part to modulus below which an eigenvalue of an undamped rig counts as imaginary: rounding of the
polynomial moves a double root by 1e-8; growth at the least of `SIDE_OFFSETS` is some 1e-5."""
NEUTRAL = 4
"""Status of undamped rigs without a growing root; added to those of `steadyslip.linear.status`."""

_TERMS = 3_000_000  # limit of terms evaluated on the imaginary axis to count roots of rigs with delays: 1 to 2 s
_DECIDING = ("steady sliding", "growing roots")  # checks that must pass for a verdict
_STEP = 1e-3  # change of ln(velocity), ln(stress) and ln(memory) from which the typical size of a memory rate is found
_ROUNDING = 8 * float(np.finfo(float).eps)  # relative rounding error of velocity and memory after a few operations
_ZERO = 1e-9  # a root counts as zero (rounding) if its size is less than this share of the largest


def verdict_checks(
    rig: Rig, point: OperatingPoint, stable: bool, on_edge: bool, steady: SteadyMachine | None = None
) -> tuple[Check, ...]:
    """Checks of steady sliding, of eigenvalues and of the number of growing eigenvalues.

    `steady` are the forces that the verdict on a machine reports.
    """
    return (steady_check(rig, point, steady), *spectrum_checks(point, stable, on_edge))


def undecided(checks: Sequence[Check]) -> str:
    """Text that names the failed checks among those that a verdict needs; empty if all of these passed."""
    failed = [str(one) for one in checks if not one.passed and one.what in _DECIDING]
    return UNDECIDED + "; ".join(failed) if failed else ""


# -- steady sliding


def steady_check(rig: Rig, point: OperatingPoint, steady: SteadyMachine | None = None) -> Check:
    """Check that laws evaluated at steady sliding return its stresses and zero memory rates, and forces balance."""
    laws = rig.laws_by_contact()
    frictions = [laws[contact.name].friction for contact in point.model.contacts]
    numbers = [float(one) for one in point.evaluate(_steady_numbers(point.model))]
    residuals: list[tuple[float, float]] = []
    for contact, law, sigma in zip(point.model.contacts, frictions, point.sigmas, strict=True):
        velocity, friction, normal, *memory = (numbers.pop(0) for _ in range(3 + len(contact.memory)))
        residuals.append((abs(normal - float(sigma)) / float(sigma), BALANCE_TOLERANCE))
        residuals += _law_residuals(law, velocity, float(sigma), tuple(memory), friction)
    forces = {} if steady is None else net_forces(rig, steady)
    residuals += [(one, BALANCE_TOLERANCE) for one in forces.values()]
    how = "forces and memory by the laws" + ("" if steady is None else ", forces on bodies added up")
    return check("steady sliding", how, *max(residuals, key=lambda pair: pair[0] / pair[1]))


def net_forces(rig: Rig, steady: SteadyMachine) -> dict[str, float]:
    """Net force of links and contacts on each coordinate, by name, relative to the largest force on it.

    Coordinates on which a controller acts are left out: `steady` does not contain its force.
    """
    mechanism = rig.mechanism()
    links = [one for one in mechanism.elements if one.name]
    found = {}
    for one in mechanism.coordinates:
        if any(one.name in other.acts for other in mechanism.elements if not other.name):
            continue
        terms = [float(one.force)]
        terms += [
            steady.links[link.name.removeprefix("links.")] * float(link.acts[one.name])
            for link in links if one.name in link.acts
        ]  # fmt: skip
        for port in mechanism.contacts:
            terms.append(-steady.contacts[port.name].friction_force * float(port.slip.get(one.name, 0)))
            terms.append(steady.contacts[port.name].normal_force * float(port.separation.get(one.name, 0)))
        found[one.name] = abs(math.fsum(terms)) / (max(map(abs, terms)) or 1.0)
    return found


@cached
def _steady_numbers(model: Model) -> ArrayFunction:
    """Function that returns for each contact: velocity, friction stress, normal stress by the contact law, memory."""
    found = []
    for contact in model.contacts:
        found += [model.steady[contact.velocity], model.steady[contact.friction], contact.steady_stress]
        found += [model.steady[item.symbol] for item in contact.memory]
    return model.function(found)


def _law_residuals(
    law: FrictionLaw, velocity: float, sigma: float, memory: tuple[float, ...], friction: float
) -> Iterator[tuple[float, float]]:
    """Relative residual and its tolerance, for a friction law's stress and then the rate of each memory variable.

    The tolerance of the stress allows for rounding of velocity and memory, which shows where bristles are damped so
    strongly that rounding of their rate matters.
    """
    v, s = abs(velocity), sp.Float(sigma)

    def strength(a: float, c: float) -> float:
        return float(law.strength(sp.Float(v * a), s, tuple(c * m for m in memory), friction))

    own, size = strength(1, 1), max(abs(friction), sigma * BALANCE_TOLERANCE)
    slopes = [abs(strength(*trial) - own) / _STEP for trial in ((1 + _STEP, 1), (1, 1 + _STEP))]
    yield abs(own - friction) / size, max(BALANCE_TOLERANCE, _ROUNDING * sum(slopes) / size)
    trials = ((1, 1, 1), (1 + _STEP, 1, 1), (1, 1 + _STEP, 1), (1, 1, 1 + _STEP))
    rest, *others = (
        np.array([float(rate) for rate in law.rates(sp.Float(v * a), s * b, tuple(c * m for m in memory), friction)])
        for a, b, c in trials
    )
    for rate, *changed in zip(rest, *others, strict=True):
        size = max(abs(other - rate) for other in changed) / _STEP
        yield abs(rate) / size if size else float(rate != 0), BALANCE_TOLERANCE


# -- eigenvalues


def relative_errors(point: OperatingPoint) -> tuple[Array, NDArray[np.bool_]]:
    """Relative error (n,) of each eigenvalue, and mask (n,) of the eigenvalues accurate enough to be reported.

    Eigenvalues that nearly coincide or are zero are reported even with larger errors if the whole spectrum is
    `decided`.
    """
    found = checked_spectrum(point)
    size = np.abs(found.values)
    zero = np.where(size <= found.errors, _ZERO * np.max(size, initial=0.0), 0.0)
    with np.errstate(all="ignore"):
        share = found.errors / np.maximum(size, zero)
        if is_neutral(point):  # the static stiffness is 0, so the root 0 is exact
            share[size <= _ZERO * np.max(size, initial=0.0)] = 0.0
    return share, (share <= GOOD) | np.full(share.shape, found.decided)


def spectrum_checks(point: OperatingPoint, stable: bool, on_edge: bool) -> tuple[Check, ...]:
    """Checks of the eigenvalues and of the number of growing ones; empty where the equations are ill-posed."""
    if is_ill_posed(point):
        return ()
    found, (share, good) = checked_spectrum(point), relative_errors(point)
    worst = float(np.max(share, initial=0.0)) if len(share) else math.inf
    values = check("eigenvalues", "least singular value of the rig's own matrix", worst, max(GOOD, worst * all(good)))
    how, growing = "argument along the imaginary axis", found.growing
    if growing < 0 and len(share) and not point.model.delays:  # the argument principle overflowed
        how, growing = "conditions of Routh and Hurwitz", int(np.sum(found.values.real > 0))
    right = growing >= 0 and (on_edge or (growing == 0) == stable)
    counted = Check("growing roots", how, float(not right), 0.0, right)
    none = found.complete and not len(share)  # no rightmost eigenvalue: infinitely many approach a vertical line
    return (counted,) if none else (values, counted)


def critical_check(point: OperatingPoint, stiffness: float, beta: float) -> Check:
    """Check that a root lies at i `beta` (rad/s) when the rig has the given critical `stiffness` (Pa/m)."""
    place = list(point.model.parameters).index("slider.stiffness")
    arguments = [stiffness if i == place else value for i, value in enumerate(point.arguments)]
    with np.errstate(all="ignore"):
        s = np.ravel(spectrum(point.with_arguments(arguments)))
        s = s[np.isfinite(s)]
        size = beta or float(np.exp(np.mean(np.log(np.maximum(np.sort(np.abs(s))[1:], 1e-300))))) or 1.0
        missed = np.min(np.abs(s - 1j * beta), initial=np.inf) / size
    return check("critical stiffness", "a root on the imaginary axis", float(missed), AXIS_TOLERANCE)


# -- edges


def missing_edges(names: Sequence[str], why: str) -> Iterator[Check]:
    """Yield one failed check that names the parameters whose edges were not searched for; none if there are none."""
    if names:
        how = f"{why}; steadyslip.boundary(rig, name) looks for one alone"
        yield Check(f"edges of {', '.join(names)}", how, np.inf, 0.0, False)


def edge_checks(
    rig: Rig, margins: Sequence[Margin], missing: Sequence[str], branch: int
) -> tuple[tuple[Margin, ...], tuple[Check, ...]]:
    """Margins without edges that fail the check of their roots on both sides, and all these checks.

    A failed check is added that names the parameters in `missing`, whose edges were not searched for.
    """
    edges = [(margin, edge) for margin in margins for edge in margin.edges]
    checks = list(missing_edges(missing, "too many roots under delays to be counted in time"))
    if not edges:
        return tuple(margins), tuple(checks)
    shares, touching = np.full(len(edges), np.inf), np.full(len(edges), np.inf)
    with at_most(_TERMS):
        posed = np.array([edge.kind != "ill-posed" for _, edge in edges])
        # with several delays too many roots lie near an ill-posed edge to be counted: `SIDE_OFFSETS` are skipped
        several = len(operating_point(rig, branch=branch).model.delays) > 1
        _find_sides(rig, edges, shares, SIDE_OFFSETS, branch, posed | (not several))
        lost = np.flatnonzero(np.isinf(shares) & posed)
        touching[lost] = _touching(rig, [edges[i] for i in lost], branch)
        slow = ~posed | ((touching <= AXIS_TOLERANCE) & (_room(edges) > max(FURTHER_OFFSETS)))
        # with several delays one edge at a time: `at_most` limits the work of each evaluation
        for some in np.eye(len(edges), dtype=bool)[slow] if several else (slow,):
            _find_sides(rig, edges, shares, FURTHER_OFFSETS[::-1] if several else FURTHER_OFFSETS, branch, some)
    lost = np.isinf(shares)
    touched = lost & (touching <= AXIS_TOLERANCE)
    for (_, edge), share in ((edges[i], shares[i]) for i in np.flatnonzero(~touched)):
        most = max(SIDE_OFFSETS if math.isinf(share) else (*SIDE_OFFSETS, share))
        checks.append(check(f"edge of {edge.parameter} at {_place(edge)}", "roots on both sides", share, most))
    for name in dict.fromkeys(edges[i][1].parameter for i in np.flatnonzero(touched)):
        own = [i for i in np.flatnonzero(touched) if edges[i][1].parameter == name]
        first = _place(edges[own[0]][1])
        which = f"an edge at {first}" if len(own) == 1 else f"edges at {len(own)} values, the first {first}"
        how = "a root on the imaginary axis, sides alike"
        checks.append(check(f"{name} touches {which}", how, float(np.max(touching[own])), AXIS_TOLERANCE))
    return without_edges(margins, [edges[i][1] for i in np.flatnonzero(lost)]), tuple(checks)


def _place(edge: Boundary) -> str:
    return f"{edge.value:.6g} {edge.unit}".removesuffix(" 1")


def _find_sides(
    rig: Rig,
    edges: Sequence[tuple[Margin, Boundary]],
    shares: Array,
    offsets: Sequence[float],
    branch: int,
    among: NDArray[np.bool_] | bool = True,
) -> None:
    """Replace infinite `shares` (n,) by the first of `offsets` at which both sides agree with the edge."""
    for share in offsets:
        rest = np.flatnonzero(np.isinf(shares) & among).tolist()
        if rest:
            sides = _sides(rig, [edges[i] for i in rest], share, branch)
            shares[rest] = [
                share if _sides_agree(edges[i][1], *pair) else np.inf for i, pair in zip(rest, sides, strict=True)
            ]


def _room(edges: Sequence[tuple[Margin, Boundary]]) -> Array:
    """Half the distance of each edge to the nearest other edge of its parameter, relative to its value, (n,); inf
    without another edge.
    """
    names, values = np.array([edge.parameter for _, edge in edges]), np.array([edge.value for _, edge in edges])
    order = np.lexsort((values, names))
    gaps = np.where(names[order][1:] == names[order][:-1], np.diff(values[order]), np.inf)
    room = np.empty(len(edges))
    room[order] = np.minimum(np.append(gaps, np.inf), np.insert(gaps, 0, np.inf))
    return 0.5 * room / _sizes(edges)


def _sizes(edges: Sequence[tuple[Margin, Boundary]]) -> Array:
    """Scale (n,) of the parameter at each edge: |edge|; if that is 0, the rig's own value or the largest searched."""
    return np.array([abs(edge.value) or abs(margin.value) or margin.searched[1] for margin, edge in edges])


def _touching(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], branch: int) -> Array:
    """Distance of the rightmost root from the imaginary axis at each edge, relative to its size, (n,).

    inf where stability differs between the two sides: a root that only touches the axis leaves them equal.
    """
    if not edges:
        return np.empty(0)
    sides = np.array(_sides(rig, edges, max(SIDE_OFFSETS), branch))
    alike = (sides[:, 0] == sides[:, 1]) & np.isin(sides[:, 0], (STABLE, UNSTABLE))
    distance = distance_from_axis(_rigs_beside(rig, edges, 0.0, branch)).reshape(2, len(edges))[0]
    return np.where(alike, distance, np.inf)


def _sides(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], share: float, branch: int) -> list[list[int]]:
    """Status below and above each edge, at `share` times its value from it; shape (n, 2)."""
    with np.errstate(all="ignore"):
        found = _status_by_roots(_rigs_beside(rig, edges, share, branch)).reshape(2, len(edges))
    return [[int(one) for one in pair] for pair in found.T]


def _rigs_beside(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], share: float, branch: int) -> OperatingPoint:
    """Operating points at `share` times the edge's value below each of n edges, then above each; shape (2 n,)."""
    values = np.array([edge.value for _, edge in edges])
    beside = values + share * _sizes(edges) * np.array([[-1.0], [1.0]])
    names = np.array([margin.parameter for margin, _ in edges])
    vary = {}
    for name, value in {margin.parameter: margin.value for margin, _ in edges}.items():
        own = np.full(beside.shape, value)
        at = names == name
        allowed = rig.parameters()[name].role.domain.contains(beside[:, at])
        own[:, at] = np.where(allowed, beside[:, at], values[at])
        vary[name] = own.ravel()
    return operating_point(rig, vary, rig.kept_zeros(), branch, scan=True)


def _sides_agree(edge: Boundary, below: int, above: int) -> bool:
    """True if the status codes below and above an edge agree with its fields `stable` and `quiet`."""
    if UNKNOWN in (below, above):
        return False
    if edge.quiet:
        quiet, other = (below, above) if edge.quiet == "below" else (above, below)
        return quiet == NEUTRAL and other in (UNSTABLE, ABSENT)
    stable = {"above": (below != STABLE and above == STABLE), "below": (below == STABLE and above != STABLE)}
    return stable.get(edge.stable, {below, above} == {ABSENT, UNSTABLE})


def _status_by_roots(point: OperatingPoint) -> NDArray[np.int64]:
    """Status codes (n,) of rigs from eigenvalues, independent of the Routh-Hurwitz conditions used in searches."""
    if point.model.delays:
        grows = counts(point) != 0
    else:
        s = spectrum(point)
        grows = np.max(np.where(np.isnan(s.real), -np.inf, s.real), axis=-1) >= 0
    found = np.where(grows | is_ill_posed(point), UNSTABLE, STABLE)
    if np.any(undamped := is_undamped(point)):
        share = np.max(np.where(np.isnan(s), -np.inf, s.real / np.abs(s)), axis=-1)
        found = np.where(undamped & (share <= DOUBLE_ROOT), NEUTRAL, found)
    found = np.where(point.exists, found, ABSENT)
    return np.asarray(np.where(in_range(point) & point.valid & can_be_counted(point), found, UNKNOWN))
