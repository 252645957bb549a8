"""Numbers and lines of the verdict on a machine whose structure is a measured response."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from steadyslip.core.format import format_growth, format_quantity
from steadyslip.linear.boundary import Margin
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.measured import MeasuredMachine, measured_machine
from steadyslip.verdict.numbers import rates_of

_TOLD = 1e-4  # relative width of an edge's bracket above which it is told
_COUNTED = {0: "no root grows", 1: "a root grows without oscillating", 2: "a pair of roots grows"}


def response_numbers(found: MeasuredMachine) -> dict[str, Any]:
    """Fields of a verdict whose growing roots were counted; the root itself where one pair grows."""
    growing = found.count.growing
    root = found.root()[0] if growing == 2 else None
    if not found.contacts.posed:
        return {"stable": False} | rates_of((), math.inf)
    counted = {"stable": growing == 0, "unstable_roots": growing}
    if root is None:
        return counted | rates_of((), None)
    return counted | {"eigenvalues": (root, root.conjugate())} | rates_of((root,), root.real)


def response_facts(machine: Machine, margins: Sequence[Margin]) -> list[tuple[str, str]]:
    """Rows (label, text) on what a verdict from a measured response rests on, and on its errors."""
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
    root, error = found.root() if growing == 2 else (None, 0.0)
    if root is not None and error > _TOLD * root.real:
        rows += [("its growth rate", f"{format_growth(root.real)} ± {format_growth(error)}")]
    if not np.any(own.deviation):
        return [*rows, ("its errors", "not told, neither by coherence nor by repeats: taken as none")]
    wide = [one.edge for one in margins if one.edge and np.ptp(one.edge.bracket) > _TOLD * abs(one.edge.value)]
    text = "; ".join(
        f"{edge.parameter} "
        + " to ".join(
            format_quantity(end, edge.unit, area=machine.printed_area(edge.parameter)) for end in edge.bracket
        )
        for edge in wide
    )
    return [*rows, ("its errors", f"leave open where edges lie: {text}")] if text else rows
