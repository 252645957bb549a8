"""Why a rig is stable, unstable or on the edge, in one sentence; pages fill the same phrases."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from steadyslip.core.format import format_quantity
from steadyslip.verdict.causes import ILL_POSED, why_all, why_ill_posed, why_none
from steadyslip.verdict.holding import gain_words, holding

if TYPE_CHECKING:
    from steadyslip.machine.slider import Slider
    from steadyslip.verdict.findings import Findings

NEXT_TO_IT = 1e-6  # change of a parameter that only its weak effect sets apart from the edge that the rig is on

ON_EDGE = "neither verdict should be relied on: the least change of a number decides"
"""What holds on every edge, of machines too."""

REASONS = {
    "are ill-posed": ILL_POSED,
    "on edge": ON_EDGE,
    "free": "without stiffness nothing restores the block's place, so a disturbance neither grows nor dies",
    "never": "no {name} makes sliding stable",
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
"""Of sliders; `page_reasons` hands them to pages, which fill them with numbers of their own."""


def reason(analysis: Findings) -> str:
    """Why, in one sentence."""
    if analysis.growth_rate == math.inf:
        return why_ill_posed(analysis)
    held = holding(analysis)
    own = held.own + held.beside
    if analysis.on_edge and own == 0 and 0 in analysis.eigenvalues:
        return REASONS["free"]
    ratio = math.nan if held.critical is None else own / (held.critical + held.beside)
    if analysis.on_edge and not abs(ratio - 1) <= NEXT_TO_IT:  # on another edge than that of the stiffness
        return ON_EDGE
    if held.critical is None:
        if not held.stable:
            return REASONS["never"].format(name=held.name) + why_none(analysis)
        return REASONS["beside"] if held.beside else REASONS["always"].format(name=held.name) + why_all(analysis)
    which = "together" if held.beside and held.own else "stiffness" if held.name == "stiffness" else "gain"
    text = REASONS[which].format(
        name=held.gain,
        own=in_stiffness(analysis, own),
        ratio=REASONS["at it"] if analysis.on_edge else REASONS["times"].format(many=_many(ratio)),
        critical=in_stiffness(analysis, held.critical + held.beside),
    )
    alone = held.stable == ((held.critical, math.inf) if held.side == "above" else (0.0, held.critical),)
    text += REASONS["one edge"].format(side=held.side) if alone else REASONS["several"]
    return f"{text}; {ON_EDGE}" if analysis.on_edge else text


def page_reasons(rig: Slider) -> dict[str, str]:
    """The phrases, and the name of the gain that acts as a stiffness."""
    return REASONS | {"name": gain_words(rig.gain_name())}


def _many(ratio: float) -> str:
    """A ratio, with as many digits as tell it from one."""
    apart = np.floor(np.log10(abs(ratio - 1) or 1.0))
    return format_quantity(ratio, "1", int(np.clip(1 - apart, 3, 8)))


def in_stiffness(analysis: Findings, value: float) -> str:
    """A stiffness (Pa/m), or that of the whole area where the rig has one, as in its file."""
    return format_quantity(value, "Pa/m", area=analysis.rig.area)
