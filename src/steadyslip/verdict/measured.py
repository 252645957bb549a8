"""Numbers and text rows of the verdict on a machine whose structure is a measured frequency response."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_growth, format_quantity
from steadyslip.linear.boundary import Margin
from steadyslip.linear.identification.modal_machine import modal_machine
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.measured import MeasuredMachine, measured_machine
from steadyslip.verdict.numbers import rates_of

_REPORTED = 1e-4  # the error of an edge or growth rate is reported if its relative size is larger than this
_EDGES = 3  # number of nearest edges that are computed from the identified modes, too
_SURE = 4.0  # two computations agree if they differ by fewer standard errors than this
_UNLIKE = (
    " (more than errors away from the turns: modes near the ends of the band cannot be distinguished from those beyond)"
)
_COUNTED = {0: "no root grows", 1: "a root grows without oscillating", 2: "a pair of roots grows"}


def growing_root(machine: Machine) -> tuple[complex | None, float]:
    """Growing root (1/s) of a machine with one growing pair of roots, and its error bound (1/s).

    It is found by the determinant or, if errors may make that root decay, by the modes; None if neither finds it.
    """
    found = measured_machine(machine)
    own = found.root()
    if own[0] is None or own[1] < own[0].real:
        return own
    try:
        modal = modal_machine(machine)
    except NotAvailable:
        return own
    first = next(iter(modal.roots()), 0j)
    root, error = modal.root_near(complex(first.real, abs(first.imag))) if first.real > 0 else (first, math.inf)
    return (root, _SURE * error) if _SURE * error < root.real else own


def doubt_of_growth(machine: Machine) -> str:
    """Reason why a pair counted as growing may in fact decay; empty if it certainly grows, or if none was counted."""
    root, error = growing_root(machine) if measured_machine(machine).count.growing == 2 else (None, 0.0)
    if root is None or error < root.real:
        return ""
    return (
        f"errors of the response near {format_quantity(abs(root.imag) / (2 * np.pi), 'Hz')} leave open whether a pair "
        f"of roots grows, at {format_growth(root.real)} ± {format_growth(error)}: measure with more averages there"
    )


def response_numbers(found: MeasuredMachine) -> dict[str, Any]:
    """Fields of `Analysis` by name from a count of growing roots; with the eigenvalue if a single pair grows."""
    growing = found.count.growing
    root = growing_root(found.machine)[0] if growing == 2 else None
    if not found.contacts.posed:
        return {"stable": False} | rates_of((), math.inf)
    counted = {"stable": growing == 0, "unstable_roots": growing}
    if root is None:
        return counted | rates_of((), None)
    return counted | {"eigenvalues": (root, root.conjugate())} | rates_of((root,), root.real)


def response_facts(machine: Machine, margins: Sequence[Margin]) -> list[tuple[str, str]]:
    """Rows (label, text) on the measured response behind a verdict, its modes and its errors; none if undecided."""
    found = measured_machine(machine)
    if found.count.growing is None:
        return []
    own, growing = found.response, found.count.growing
    ends = [format_quantity(one / (2 * np.pi), "Hz") for one in own.omega[[0, -1]]]
    counted = _COUNTED.get(growing, f"{growing} roots grow")
    rows = [(
        "the response", f"{len(own.omega)} frequencies from {ends[0]} to {ends[1]}; {counted}, by the turns of "
        "det(I + R G) round 0. That the structure is stable with open contacts is taken for granted",
    )]  # fmt: skip
    root, error = growing_root(machine) if growing == 2 else (None, 0.0)
    if root is not None and error > _REPORTED * root.real:
        rows += [("its growth rate", f"{format_growth(root.real)} ± {format_growth(error)}")]
    rows += [("its modes", _by_modes(machine, margins))]
    if not np.any(own.deviation):
        return [*rows, ("its errors", "not given, neither by coherence nor by repeats: taken as none")]
    wide = [one.edge for one in margins if one.edge and np.ptp(one.edge.bracket) > _REPORTED * abs(one.edge.value)]
    text = "; ".join(
        f"{edge.parameter} "
        + " to ".join(
            format_quantity(end, edge.unit, area=machine.printed_area(edge.parameter)) for end in edge.bracket
        )
        for edge in wide
    )
    return [*rows, ("its errors", f"leave open where edges lie: {text}")] if text else rows


def _by_modes(machine: Machine, margins: Sequence[Margin]) -> str:
    """Text on growing roots and edges by the modes identified from the response, and whether they agree with those by
    the turns of the determinant.
    """
    try:
        found = modal_machine(machine)
    except NotAvailable as why:
        return str(why)
    known, growing = found.modes, found.measured.count.growing
    text = [f"{int(np.sum(known.inside))} identified in the band"]
    roots = found.roots()
    count = int(np.sum(roots.real > 0))
    text += [_COUNTED.get(count, f"{count} roots grow") + " by them" + ("" if count == growing else _UNLIKE)]
    if count == growing == 2:
        root, error = found.root_near(complex(roots[0].real, abs(roots[0].imag)))
        text[-1] += f", at {format_growth(root.real)} ± {format_growth(error)}"
    edges = [one.edge for one in margins if one.edge and one.edge.angular_frequency]
    for edge in edges[:_EDGES]:
        area = machine.printed_area(edge.parameter)
        near = found.edge_near(edge.parameter, edge.value, edge.angular_frequency)
        if near is None:
            text += [f"{edge.parameter} has no edge by them"]
            continue
        place, spread = (format_quantity(x, edge.unit, area=area) for x in (near.value, near.error))
        apart = max(edge.bracket[0] - near.value, near.value - edge.bracket[1])
        unlike = apart > _SURE * near.error + _REPORTED * abs(near.value)
        text += [f"edge of {edge.parameter} at {place} ± {spread}" + (_UNLIKE if unlike else "")]
    return "; ".join(text)
