"""Reason of a verdict on a slider, in one sentence; browser pages fill the phrases of `REASONS` themselves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from steadyslip.core.format import format_as_written, format_quantity
from steadyslip.verdict.causes import ILL_POSED, why_always_stable, why_ill_posed, why_never_stable
from steadyslip.verdict.support import gain_words, support_stiffness

if TYPE_CHECKING:
    from steadyslip.machine.slider import Slider
    from steadyslip.verdict.findings import Findings

# Relative distance of a parameter from an edge of stability within which the rig counts as lying on the edge. It is
# larger than rounding, because rounding of the growth rate moves edges in parameters of weak effect by more. By trial:
# with a much larger value two neighbouring edges would count as one.
NEXT_TO_IT = 1e-6

ON_EDGE = "neither verdict should be relied on: the least change of a number decides; give it a damping if it has none"
"""Reason given for a slider or machine on an edge of stability."""

UNDAMPED = (
    "nothing damps it, so no disturbance dies out: give it a damping; the least one decides, and may move the edges of "
    "growth far"
)
"""Reason given for a machine without damping of which no root grows."""

REASONS = {
    "are ill-posed": ILL_POSED,
    "on edge": ON_EDGE,
    "free": "without stiffness nothing restores the block's place, so a disturbance neither grows nor dies",
    "never": "no {name} makes sliding stable",
    "windows": "sliding is stable in windows of {name} too many to be listed",
    "always": "sliding is stable at every {name}",
    "beside": "with this controller sliding is stable whatever the stiffness beside it",
    "stiffness": "the stiffness {own} is {ratio} the critical stiffness {critical}",
    "gain": "the {name}, {own}, is {ratio} the critical {critical}",
    "together": "the stiffness and {name} together, {own}, are {ratio} the critical {critical}",
    "times": "{many} times",
    "at it": "to within rounding",
    "one edge": ", {side} which sliding is stable",
    "several": ", the nearest edge of the stable set",
}
"""Phrases for the reasons of sliders' verdicts; browser pages use the same keys (`page_reasons`)."""


def reason(analysis: Findings) -> str:
    """Sentence that explains a slider's verdict, with the ratio of stiffness to critical stiffness if that exists."""
    if analysis.growth_rate == math.inf:
        return why_ill_posed(analysis)
    support = support_stiffness(analysis)
    own = support.own + support.beside
    if analysis.on_edge and own == 0 and 0 in analysis.eigenvalues:
        return REASONS["free"]
    ratio = math.nan if support.critical is None else own / (support.critical + support.beside)
    if analysis.on_edge and not abs(ratio - 1) <= NEXT_TO_IT:  # the rig is on the edge of another parameter
        return ON_EDGE
    if support.critical is None:
        if not support.stable and analysis.stable:
            return REASONS["windows"].format(name=support.name)
        if not support.stable:
            return REASONS["never"].format(name=support.name) + why_never_stable(analysis)
        return (
            REASONS["beside"]
            if support.beside
            else REASONS["always"].format(name=support.name) + why_always_stable(analysis)
        )
    which = "together" if support.beside and support.own else "stiffness" if support.name == "stiffness" else "gain"
    text = REASONS[which].format(
        name=support.gain,
        own=in_stiffness(analysis, own),
        ratio=REASONS["at it"] if analysis.on_edge else REASONS["times"].format(many=_many(ratio)),
        critical=in_stiffness(analysis, support.critical + support.beside),
    )
    alone = support.stable == ((support.critical, math.inf) if support.side == "above" else (0.0, support.critical),)
    text += REASONS["one edge"].format(side=support.side) if alone else REASONS["several"]
    return f"{text}; {ON_EDGE}" if analysis.on_edge else text


def page_reasons(rig: Slider) -> dict[str, str]:
    """Phrases for a browser page: `REASONS`, and under ``name`` the controller gain that acts as a stiffness."""
    return REASONS | {"name": gain_words(rig)}


def _many(ratio: float) -> str:
    """Text of a ratio with 3 to 8 digits, enough to show that it differs from 1."""
    apart = np.floor(np.log10(abs(ratio - 1) or 1.0))
    return format_quantity(ratio, "1", int(np.clip(1 - apart, 3, 8)))


def in_stiffness(analysis: Findings, value: float) -> str:
    """Format a stiffness (Pa/m) in the unit of the rig's own; as N/m of the contact where the rig has an area."""
    own = analysis.rig.value(analysis.rig.stiffness_name()) or 0.0
    return format_as_written(value, own, "Pa/m", area=analysis.rig.area)
