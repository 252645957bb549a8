"""Numbers and checks of the verdict on a machine analysed by its matrices.

- Steady sliding: forces by the laws' own methods and by the matrices balance.
- Eigenvalues: the matrices are singular at the rightmost ones; turns of the contacts' return difference about 0, with
  the machine without contact forces as reference, give the same number of growing ones (theory 13).
- Edges: eigenvalues on both sides agree with the edge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.checks import Check, check
from steadyslip.linear.boundary import Margin, without_edges
from steadyslip.linear.matrix_coupling import growing_squares, squares_of
from steadyslip.linear.matrix_route import STABLE_WORD, stability_word
from steadyslip.linear.pencil import GOOD
from steadyslip.linear.search import Boundary
from steadyslip.linear.status import ON_THE_EDGE
from steadyslip.model.numeric.change import Turns, change_between
from steadyslip.model.numeric.machine_point import MachinePoint
from steadyslip.model.numeric.pencil import linearised
from steadyslip.verdict.checks import BALANCE_TOLERANCE, SIDE_OFFSETS, missing_edges
from steadyslip.verdict.numbers import rates_of

_CHECKED = 8  # number of rightmost eigenvalues that are checked; each check takes a matrix decomposition


def matrix_numbers(point: MachinePoint) -> dict[str, Any]:
    """Fields of `Analysis` by name that follow from the eigenvalues."""
    pencil = point.pencil
    if not pencil.posed:
        return {"stable": False} | rates_of((), math.inf)
    found = tuple(complex(s) for s in pencil.eigenvalues)
    return {"stable": stability_word(point) == STABLE_WORD, "eigenvalues": found} | rates_of(found, found[0].real)


def is_on_edge(point: MachinePoint) -> bool:
    """True if the real part of an eigenvalue is 0 to within `ON_THE_EDGE` of its modulus, and no other grows."""
    found = point.pencil.eigenvalues
    near = np.abs(found.real) <= ON_THE_EDGE * np.abs(found)
    return bool(np.any(near) and not np.any(found.real[~near] > 0))


def matrix_checks(point: MachinePoint, stable: bool, on_edge: bool) -> tuple[Check, ...]:
    """Checks of steady sliding, eigenvalues and, where it can be counted, the number of growing ones."""
    steady = check(
        "steady sliding", "forces by the laws and the matrices added up", _imbalance(point), BALANCE_TOLERANCE
    )
    if not point.pencil.posed:
        return (steady,)
    first = [s for s in point.pencil.eigenvalues if s.imag >= 0][:_CHECKED]
    errors = [point.pencil.error(complex(s)) / max(abs(s), 1e-300) for s in first]
    values = check("eigenvalues", "least singular value of the machine's own matrices", max(errors, default=0.0), GOOD)
    growing = _growing_by_turns(point)
    right = growing is None or on_edge or (growing == 0) == stable
    if growing is None:
        return steady, values
    counted = Check("growing roots", "turns of the contacts' return difference", float(not right), 0.0, right)
    return steady, values, counted


def _growing_by_turns(point: MachinePoint) -> int | None:
    """Number of growing roots: those of the machine without contact forces plus the turns of the contacts' return
    difference; None if a root without contact forces lies on the imaginary axis, the turns cannot be counted, or
    contacts alone determine how some coordinate moves.
    """
    sites = tuple(replace(site, area=0.0) for site in point.matrices.sites)
    free = linearised(replace(point.matrices, sites=sites), point.balance)
    roots = free.eigenvalues
    if np.any(np.abs(roots.real) <= ON_THE_EDGE * np.abs(roots)):
        return None
    change = change_between(free, [point.pencil])
    try:
        more = 0 if change is None else Turns(change).more_growing(change.core_of(point.pencil))
    except np.linalg.LinAlgError:
        return None
    return None if more is None else int(np.sum(roots.real > 0)) + more


def _imbalance(point: MachinePoint) -> float:
    """Largest relative residual of steady sliding, by the laws' own methods: net force on a coordinate over the largest
    force on any, or friction stress.
    """
    matrices, found = point.matrices, point.balance
    terms = [matrices.force, -matrices.damping @ matrices.speeds, -matrices.stiffness @ found.displacement]
    terms += [-matrices.integral_acts * found.integral]
    worst = 0.0
    for i, site in enumerate(matrices.sites):
        law = point.machine.contacts[site.name].friction
        sigma, tau = float(found.sigma[i]), float(found.tau[i])
        strength = float(law.steady_strength(sp.Float(site.velocity), sp.Float(sigma)))
        worst = max(worst, abs(strength - tau) / max(abs(tau), sigma * BALANCE_TOLERANCE))
        terms += [-site.area * site.slip * strength, site.area * site.apart * sigma]
    table = np.array(terms)
    size = np.sum(np.abs(matrices.stiffness) @ np.abs(found.displacement)) + np.max(np.abs(table))
    return max(worst, float(np.max(np.abs(np.sum(table, axis=0)), initial=0.0) / size))


def matrix_edge_checks(
    point: MachinePoint, margins: Sequence[Margin], missing: Sequence[str]
) -> tuple[tuple[Margin, ...], tuple[Check, ...]]:
    """Margins without edges that fail the check of the eigenvalues on both sides, and all these checks.

    A failed check is added that names the parameters in `missing`, whose edges were not searched for.
    """
    lost, checks = [], list(missing_edges(missing, "eigenvalues of the whole structure at every value take minutes"))
    for margin in margins:
        for edge in margin.edges:
            share = next((one for one in SIDE_OFFSETS if _sides_agree(point, margin, edge, one)), math.inf)
            lost += [edge] if math.isinf(share) else []
            where = f"{edge.value:.6g} {edge.unit}".removesuffix(" 1")
            checks.append(
                check(f"edge of {edge.parameter} at {where}", "roots on both sides", share, max(SIDE_OFFSETS))
            )
    return without_edges(margins, lost), tuple(checks)


def _sides_agree(point: MachinePoint, margin: Margin, edge: Boundary, share: float) -> bool:
    """True if stability at `share` times the edge's value below and above it agrees with the edge."""
    size = abs(edge.value) or abs(margin.value) or margin.searched[1]
    domain = point.machine.parameters()[edge.parameter].role.domain
    beside = []
    for sign in (-1, 1):
        value = edge.value + sign * share * size
        beside.append(point.varied(edge.parameter, value if domain.contains(np.array([value]))[0] else edge.value))
    if edge.quiet and all(one.balance.exists for one in beside):  # nothing damps the machine
        return bool(np.diff([growing_squares(squares_of(one.pencil)) for one in beside])[0])
    words = [stability_word(one) for one in beside]
    below, above = (word == STABLE_WORD for word in words)
    if edge.stable == "neither":
        return words[0] != words[1] and not below and not above
    return bool(above and not below) if edge.stable == "above" else bool(below and not above)
