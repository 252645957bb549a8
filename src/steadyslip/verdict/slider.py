"""Parts of a verdict that only sliders have: stresses, pull of the spring, stable stiffnesses, warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.areas import display_area, stress_name
from steadyslip.core.checks import Check
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.linear.nearness import nearest_end
from steadyslip.linear.stiffness import set_of_one
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint
from steadyslip.model.steady_results import SteadySliding
from steadyslip.verdict.checks import critical_check
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.reasons import in_stiffness
from steadyslip.verdict.support import support_stiffness
from steadyslip.verdict.words import STABLE_MEANS, instead

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings

UNLIMITED = (
    "Neither mass nor damping limits what grows: another disturbance may end in stick-slip or a run-away (blow-up)."
)
"""Line added after the simulated motion of an unstable rig whose velocity nothing limits."""
MEANS = STABLE_MEANS.format(what="an oscillation or a run-away")
"""Limits of the verdict "stable" on a slider, as text."""
HOW_LARGE = "The size of such a kick does not follow from the kind of onset; steadyslip threshold computes it."
"""Second line of text on those limits, if the verdict has a kind of onset but no thresholds of kicks."""
AT_EDGE = {"at the edge": "oscillation with period {period}", "along the axis": "critical stiffness {critical}"}
"""Text of rows on the critical stiffness, by label; browser pages use the same."""
MOST_WINDOWS = 4  # largest number of stable stiffness intervals that the text lists; by trial


def numbers_of(rig: Slider, point: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` by name from the characteristic equation and from the stable set in stiffness."""
    return linear_numbers(point) | stiffness_numbers(rig, point)


def stiffness_numbers(rig: Slider, point: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` by name on stiffness: stable intervals (Pa/m) and the edge nearest to the rig's own."""
    try:
        found = set_of_one(point)
    except NotAvailable:  # with a delay there may be infinitely many stable intervals
        return {}
    own = float(point.named()["slider.stiffness"])
    intervals = found.intervals[np.all(np.isfinite(found.intervals[:, :1]), axis=-1)]
    numbers: dict[str, Any] = {"stable_stiffness": tuple((float(a), float(b)) for a, b in intervals)}
    at = np.flatnonzero(found.changes)
    if at.size:
        i = at[nearest_end(found.edges[at], own)]
        critical, beta = float(found.edges[i]), float(found.frequencies[i])
        numbers["critical_stiffness"] = critical
        numbers["critical_angular_frequency"] = beta if math.isfinite(beta) else None
        numbers["critical_side"] = "above" if np.any(intervals[:, 0] == critical) else "below"
        if rig.axial_stiffness is not None:
            numbers["critical_axial_stiffness"] = critical / float(point.axial_share)
    return numbers


def checked_stiffness_numbers(rig: Slider, point: OperatingPoint) -> tuple[dict[str, Any], tuple[Check, ...]]:
    """`stiffness_numbers` and the check of the critical stiffness, which is left out if it fails."""
    numbers = stiffness_numbers(rig, point)
    if numbers.get("critical_angular_frequency") is None:
        return numbers, ()
    found = critical_check(point, numbers["critical_stiffness"], numbers["critical_angular_frequency"])
    if found.passed:
        return numbers, (found,)
    return {name: one for name, one in numbers.items() if not name.startswith("critical_")}, (found,)


def sliding_rows(analysis: Findings) -> list[tuple[str, str]]:
    """Rows (label, text) on steady sliding, and on the parts of the pull T if it sets the normal force."""
    normal, shear = (stress_name(f"{one} stress", analysis.rig.area) for one in ("normal", "shear"))
    steady = analysis.steady
    text = (
        f"{normal} {_stress(analysis, steady.normal_stress)}, "
        f"{shear} {_stress(analysis, steady.shear_stress)}, friction {steady.friction:.4g}"
    )
    return [("steady sliding", text), *_pull(analysis.rig)]


def stability_rows(analysis: Findings) -> list[tuple[str, str]]:
    """Rows (label, text) on the stable stiffnesses and on the critical stiffness."""
    rows = [("stable for", _stable_set(analysis))]
    if beta := analysis.critical_angular_frequency:
        rows.append(("at the edge", AT_EDGE["at the edge"].format(period=format_quantity(2 * math.pi / beta, "s"))))
    if (axial := analysis.critical_axial_stiffness) is not None:
        rows.append(("along the axis", AT_EDGE["along the axis"].format(critical=in_stiffness(analysis, axial))))
    return rows


def _stress(analysis: Findings, value: float) -> str:
    """Text of a stress; with a contact area, of force and stress, where the one used in the rig's file comes first."""
    area = analysis.rig.area
    stress = format_quantity(value, "Pa")
    if area is None:
        return stress
    force = format_quantity(value * area, "N")
    return f"{stress} ({force})" if display_area("Pa", area) is None else f"{force} ({stress})"


def _pull(rig: Slider) -> list[tuple[str, str]]:
    """Row (label, text) on the parts of the pull T; none if T is the spring's force alone or sets no normal force."""
    control = [rig.drive.proportional(), rig.drive.dashpot(), rig.drive.integral()]
    inside = {"spring": rig.stiffness or rig.axial_stiffness, "damper": rig.damping, "controller": any(control)}
    pulling = [f"the {name}" for name, there in inside.items() if there]
    if (pulling == ["the spring"] and not rig.radiation_damping) or not rig.contact.follows_spring():
        return []
    text = f"the normal force follows T, the pull of {' and '.join(pulling)}"
    return [("the pull T", text + ("; radiation damping is not in it" if rig.radiation_damping else ""))]


def _stable_set(analysis: Findings) -> str:
    support = support_stiffness(analysis)
    parts = []
    for low, high in support.stable:
        if low == 0 and high == math.inf:
            parts.append(f"every {support.words}{' above zero' if analysis.on_edge else ''}")
        elif high == math.inf:
            parts.append(f"{support.words} above {in_stiffness(analysis, low)}")
        elif low == 0:
            parts.append(f"{support.words} below {in_stiffness(analysis, high)}")
        else:
            parts.append(f"{support.words} from {in_stiffness(analysis, low)} to {in_stiffness(analysis, high)}")
    if len(parts) > MOST_WINDOWS:  # list the intervals around the rig's own stiffness, or the lowest
        at = next((i for i, (low, high) in enumerate(support.stable) if low < support.own < high), 0)
        first = max(0, min(at - MOST_WINDOWS // 2, len(parts) - MOST_WINDOWS))
        more = f"{len(parts) - MOST_WINDOWS} windows more, see stable_stiffness"
        parts = [*parts[first : first + MOST_WINDOWS], more]
    if not parts and analysis.characteristic_terms and analysis.stable:
        return f"windows of {support.words} too many to be listed"
    return ", or ".join(parts) or f"no {support.words}"


def meaning(analysis: Findings) -> list[str]:
    """Lines on the limits of a decided verdict: large kicks if stable, growth without bound if unstable."""
    if analysis.stable:
        lines = [MEANS]
        if not analysis.kicks:
            lines.append(HOW_LARGE)
        return lines if analysis.onset is not None or analysis.kicks else lines[:1]
    if analysis.growth_rate != math.inf and analysis.rig.friction.runs_away() and not _limited(analysis.rig):
        if analysis.judders:
            return [instead(analysis), UNLIMITED]
        return [
            "Neither mass nor damping limits what grows: it may end in a run-away (blow-up) rather than in stick-slip.",
            "steadyslip simulate shows which.",
        ]
    return [] if analysis.growth_rate == math.inf else [instead(analysis)]


def _limited(rig: Slider) -> bool:
    """True if mass or damping keeps velocity finite."""
    return bool(rig.mass or rig.damping or rig.radiation_damping or float(rig.drive.dashpot()))


def warnings(analysis: Findings, states: Sequence[SteadySliding]) -> Iterator[str]:
    """Warnings on several steady states, a friction law without memory, and friction that is not positive."""
    rig, steady = analysis.rig, states[analysis.branch]
    if len(states) > 1:
        stresses = [format_quantity(one.normal_stress, "Pa", area=rig.area) for one in states]
        yield (
            f"steady sliding is possible at {len(states)} values of {stress_name('normal stress', rig.area)} "
            f"({', '.join(stresses)}); this verdict is for the one at {stresses[analysis.branch]}"
        )
    if not rig.friction.memory() and rig.friction.lateness() == 0:
        yield (
            "this friction law has no memory of sliding, so it cannot predict a critical stiffness; "
            "use a law with memory"
        )
    if steady.friction <= 0:
        level = "".join(f"{name.rpartition('.')[2]} and " for name in rig.of_kind("friction level"))
        yield f"the friction coefficient in steady sliding is not positive; check {level}the velocity"
