"""A second, independent question behind every number of a verdict, and what came of it.

Steady sliding is asked whether the laws themselves, given its numbers, leave forces and memory at rest; eigenvalues
whether the rig's own matrix is singular there, and their number of the argument of its determinant; edges whether small
disturbances grow on one side and die on the other; the critical stiffness whether a root lies on the axis there. What
fails is left out, and said in words that begin with ``not decided``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.checks import UNDECIDED, Check, check
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.questions import question
from steadyslip.laws.friction.law import FrictionLaw
from steadyslip.linear.boundary import Margin, present_zeros, without_edges
from steadyslip.linear.pencil import GOOD, checked_spectrum
from steadyslip.linear.search import Boundary
from steadyslip.linear.spectrum import is_ill_posed, spectrum, unstable_roots
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE, is_neutral
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import in_range
from steadyslip.model.sliding import SteadyMachine

Array = NDArray[np.float64]

BALANCED = 1e-8
"""Share of stresses, and of the rates of memory that are e-folds away, by which a balance may be missed."""
BESIDE = (1e-7, 1e-5, 1e-9)
"""Shares of an edge's value at which both of its sides are looked at, until they differ as the edge says."""
ON_AXIS = 1e-6
"""Share of its size by which a root may miss the axis at the critical stiffness."""

_DECIDING = ("steady sliding", "growing roots")  # without which there is no verdict
_STEP = 1e-3  # of the logarithms of velocity, stress and memory, whose effect on its rates says how large these are
_ZERO = 1e-9  # of the largest root: what a root of zero, which has no share of its own, may be by rounding


def verdict_checks(
    rig: Rig, point: OperatingPoint, stable: bool, on_edge: bool, steady: SteadyMachine | None = None
) -> tuple[Check, ...]:
    """What the verdict itself rests on: steady sliding (of a machine as it is told), eigenvalues and how many grow."""
    return (steady_check(rig, point, steady), *spectrum_checks(point, stable, on_edge))


def undecided(checks: Sequence[Check]) -> str:
    """Why there is no verdict; empty where there is one."""
    failed = [str(one) for one in checks if not one.passed and one.what in _DECIDING]
    return UNDECIDED + "; ".join(failed) if failed else ""


# -- steady sliding


def steady_check(rig: Rig, point: OperatingPoint, steady: SteadyMachine | None = None) -> Check:
    """Whether the laws, given the numbers of steady sliding, leave forces and memory as they are, and bodies too."""
    frictions = (
        [rig.contacts[contact.name].friction for contact in point.model.contacts]
        if isinstance(rig, Machine)
        else [rig.friction]  # type: ignore[attr-defined]
    )
    numbers = [float(one) for one in point.evaluate(_steady_numbers(point.model))]
    missed = []
    for contact, law, sigma in zip(point.model.contacts, frictions, point.sigmas, strict=True):
        velocity, friction, normal, *memory = (numbers.pop(0) for _ in range(3 + len(contact.memory)))
        missed.append(abs(normal - float(sigma)) / float(sigma))
        missed += _missed_by_law(law, velocity, float(sigma), tuple(memory), friction)
    missed += [] if steady is None else net_forces(rig, steady).values()
    how = "forces and memory by the laws" + ("" if steady is None else ", forces on bodies added up")
    return check("steady sliding", how, max(missed), BALANCED)


def net_forces(rig: Rig, steady: SteadyMachine) -> dict[str, float]:
    """Sum of the forces of links and contacts on every coordinate, as a share of the largest of them.

    Left out are coordinates on which a controller acts: its force is not told, it is what is left.
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


@question
def _steady_numbers(model: Model) -> ArrayFunction:
    """Of every contact velocity, friction stress, normal stress as the contact makes it, and memory."""
    found = []
    for contact in model.contacts:
        found += [model.steady[contact.velocity], model.steady[contact.friction], contact.steady_stress]
        found += [model.steady[item.symbol] for item in contact.memory]
    return model.function(found)


def _missed_by_law(
    law: FrictionLaw, velocity: float, sigma: float, memory: tuple[float, ...], friction: float
) -> Iterator[float]:
    """Shares by which a law misses a friction stress, and by which its memory does not rest."""
    v, s = abs(velocity), sp.Float(sigma)
    yield abs(float(law.strength(sp.Float(v), s, memory, friction)) - friction) / max(abs(friction), sigma * BALANCED)
    trials = ((1, 1, 1), (1 + _STEP, 1, 1), (1, 1 + _STEP, 1), (1, 1, 1 + _STEP))
    rest, *others = (
        np.array([float(rate) for rate in law.rates(sp.Float(v * a), s * b, tuple(c * m for m in memory), friction)])
        for a, b, c in trials
    )
    for rate, *changed in zip(rest, *others, strict=True):
        size = max(abs(other - rate) for other in changed) / _STEP
        yield abs(rate) / size if size else float(rate != 0)


# -- eigenvalues


def shares_of_errors(point: OperatingPoint) -> tuple[Array, NDArray[np.bool_]]:
    """Of every eigenvalue the error as a share of it, and whether it is told.

    One of several that meet is told with its error, which is larger; so is one of zero, which has no share of its own.
    """
    found = checked_spectrum(point)
    size = np.abs(found.values)
    zero = np.where(size <= found.errors, _ZERO * np.max(size, initial=0.0), 0.0)
    with np.errstate(all="ignore"):
        share = found.errors / np.maximum(size, zero)
        if is_neutral(point):  # the coefficient that vanishes says so better than any matrix
            share[size <= _ZERO * np.max(size, initial=0.0)] = 0.0
    return share, (share <= GOOD) | np.full(share.shape, found.decided)


def spectrum_checks(point: OperatingPoint, stable: bool, on_edge: bool) -> tuple[Check, ...]:
    """Of eigenvalues and of how many grow; none where the equations are ill-posed."""
    if is_ill_posed(point):
        return ()
    found, (share, good) = checked_spectrum(point), shares_of_errors(point)
    worst = float(np.max(share, initial=0.0)) if len(share) else math.inf
    values = check("eigenvalues", "least singular value of the rig's own matrix", worst, max(GOOD, worst * all(good)))
    how, growing = "argument along the imaginary axis", found.growing
    if growing < 0 and len(share) and not point.model.delays:  # sizes at which that leaves floating point
        how, growing = "conditions of Routh and Hurwitz", int(np.sum(found.values.real > 0))
    right = growing >= 0 and (on_edge or (growing == 0) == stable)
    return values, Check("growing roots", how, float(not right), 0.0, right)


def critical_check(point: OperatingPoint, stiffness: float, beta: float) -> Check:
    """Whether a root of the rig with its critical stiffness lies on the imaginary axis at its frequency (rad/s)."""
    place = list(point.model.parameters).index("slider.stiffness")
    arguments = [stiffness if i == place else value for i, value in enumerate(point.arguments)]
    with np.errstate(all="ignore"):
        s = np.ravel(spectrum(point.with_arguments(arguments)))
        s = s[np.isfinite(s)]
        size = beta or float(np.exp(np.mean(np.log(np.maximum(np.sort(np.abs(s))[1:], 1e-300))))) or 1.0
        missed = np.min(np.abs(s - 1j * beta), initial=np.inf) / size
    return check("critical stiffness", "a root on the imaginary axis", float(missed), ON_AXIS)


# -- edges


def edge_checks(rig: Rig, margins: Sequence[Margin], branch: int) -> tuple[tuple[Margin, ...], tuple[Check, ...]]:
    """Of every edge whether both sides are as it says; and the margins without edges that are not."""
    edges = [(margin, edge) for margin in margins for edge in margin.edges]
    if not edges:
        return tuple(margins), ()
    shares = np.full(len(edges), np.inf)
    for share in BESIDE:
        rest = np.flatnonzero(np.isinf(shares))
        if rest.size:
            sides = _sides(rig, [edges[i] for i in rest], share, branch)
            shares[rest] = [
                share if _as_said(edges[i][1], *pair) else np.inf for i, pair in zip(rest, sides, strict=True)
            ]
    lost = np.flatnonzero(np.isinf(shares))
    touching = dict(zip(lost.tolist(), _touching(rig, [edges[i] for i in lost], branch), strict=True))
    checks = []
    for i, ((_, edge), share) in enumerate(zip(edges, shares, strict=True)):
        where = f"{edge.value:.6g} {edge.unit}".removesuffix(" 1")
        if touching.get(i, np.inf) <= ON_AXIS:
            what, how = f"{edge.parameter} touches an edge at {where}", "a root on the imaginary axis, sides alike"
            checks.append(check(what, how, touching[i], ON_AXIS))
        else:
            checks.append(check(f"edge of {edge.parameter} at {where}", "roots on both sides", share, max(BESIDE)))
    return without_edges(margins, [edges[i][1] for i in lost]), tuple(checks)


def _touching(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], branch: int) -> Array:
    """Of each edge by what share of its size the rightmost root misses the axis there; inf where sides differ."""
    if not edges:
        return np.empty(0)
    sides = np.array(_sides(rig, edges, max(BESIDE), branch))
    alike = (sides[:, 0] == sides[:, 1]) & np.isin(sides[:, 0], (STABLE, UNSTABLE))
    with np.errstate(all="ignore"):
        roots = spectrum(_beside(rig, edges, 0.0, branch)).reshape(2, len(edges), -1)[0]
        real = np.where(np.isnan(roots.real), -np.inf, roots.real)
        least = np.take_along_axis(roots, np.argmax(real, axis=-1)[:, None], axis=-1)[:, 0]
        return np.where(alike, np.abs(least.real) / np.abs(least), np.inf)


def _sides(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], share: float, branch: int) -> list[list[int]]:
    """Of each edge the status below and above, a share of its value away; one question for all."""
    with np.errstate(all="ignore"):
        found = _by_roots(_beside(rig, edges, share, branch)).reshape(2, len(edges))
    return [[int(one) for one in pair] for pair in found.T]


def _beside(rig: Rig, edges: Sequence[tuple[Margin, Boundary]], share: float, branch: int) -> OperatingPoint:
    """The rigs a share of the value of each edge below it, and those above, (2 n,)."""
    values = np.array([edge.value for _, edge in edges])
    sizes = np.array([abs(edge.value) or abs(margin.value) or margin.searched[1] for margin, edge in edges])
    beside = values + share * sizes * np.array([[-1.0], [1.0]])
    vary = {}
    for margin, _ in edges:
        at = [i for i, (_, edge) in enumerate(edges) if edge.parameter == margin.parameter]
        own = np.full(beside.shape, margin.value)
        allowed = rig.parameters()[margin.parameter].role.domain.contains(beside[:, at])
        own[:, at] = np.where(allowed, beside[:, at], values[at])
        vary[margin.parameter] = own.ravel()
    return operating_point(rig, vary, present_zeros(rig), branch, scan=True)


def _as_said(edge: Boundary, below: int, above: int) -> bool:
    """Whether the sides of an edge are as it says."""
    if UNKNOWN in (below, above):
        return False
    stable = {"above": (below != STABLE and above == STABLE), "below": (below == STABLE and above != STABLE)}
    return stable.get(edge.stable, {below, above} == {ABSENT, UNSTABLE})


def _by_roots(point: OperatingPoint) -> NDArray[np.int64]:
    """The status of rigs by their eigenvalues, (n,), where scans go by the conditions of Routh and Hurwitz."""
    if point.model.delays:
        grows = unstable_roots(point) != 0
    else:
        real = spectrum(point).real
        grows = np.max(np.where(np.isnan(real), -np.inf, real), axis=-1) >= 0
    found = np.where(grows | is_ill_posed(point), UNSTABLE, STABLE)
    found = np.where(point.exists, found, ABSENT)
    return np.asarray(np.where(in_range(point) & point.valid, found, UNKNOWN))
