"""Contents of the document of a rig whose drive holds a place: whether it hunts, and what ends that."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.format import format_quantity
from steadyslip.machine.letters import said
from steadyslip.nonlinear.hunting.hunt import hunt
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.reports.elements import heading, paragraph, table

BAND = 2.0  # dead band over the amplitude; a band a little wider than the cycle only slows it down
HOLDS = (
    "Each contact has one normal force, and bodies are rigid. The motion is simulated for the values below and one "
    "step of the target; it says nothing of wear, heat or of what the laws leave out."
)


def recommendation(result: Hunt) -> Iterator[str]:
    """HTML of what ends hunting, each change alone and simulated anew; of an axis that settles, that it does."""
    yield heading("The recommendation")
    if result.runs_away:
        yield paragraph("It is not friction that has to change: the controller is unstable, or too weak for its load.")
    elif not result.hunts:
        settles = (
            "Keep it as it is." if result.hunts is False else "Simulate it for longer (until) before it is judged."
        )
        yield paragraph(settles)
    else:
        found = [(what, hunt(rig, result.protocol)) for what, rig in _changed(result)]
        good = [(what, one) for what, one in found if np.isfinite(one.settled_at)]
        good.sort(key=lambda pair: max(abs(pair[1].lowest), abs(pair[1].highest)))
        best = f"the best is {good[0][0]}" if good else "none of them ends it"
        yield paragraph(f"Each change below was tried alone; {best}.")
        why = "What ends hunting: the integral winds up while friction at rest, larger than in sliding, holds the axis."
        yield table([(what, one.sentence.capitalize()) for what, one in found], ("change", "then"), caption=why)
    yield heading("Assumptions")
    yield paragraph(HOLDS)


def _changed(result: Hunt) -> Iterator[tuple[str, Any]]:
    """What may end the hunting of an axis, in words, and the rig so changed."""
    rig: Any = result.rig
    known = rig.parameters()
    band = BAND * max(abs(result.lowest), abs(result.highest))
    with suppress(ParameterError, NotAvailable, TypeError):  # a drive without these keys
        words = f"a dead band of {format_quantity(band, result.unit)} of the integral ({BAND:g} amplitudes)"
        yield words, replace(rig, drive=replace(rig.drive, dead_band=band, dead_band_of="integral"))
    for name, one in known.items():
        if name.startswith("drive.") and one.role.adds_state and one.value:
            yield f"no integral ({said(rig, name)} = 0)", rig.with_values({name: 0.0})
