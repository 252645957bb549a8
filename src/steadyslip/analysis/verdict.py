"""An Analysis in words that a person can act on, or read aloud to a colleague."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING

from steadyslip.errors import InternalError, NotAvailable
from steadyslip.linear import small_signal
from steadyslip.linear.cubic import hopf_line
from steadyslip.quantities import shown
from steadyslip.records import resolve

if TYPE_CHECKING:
    from steadyslip.analysis.analyze import Analysis
    from steadyslip.linear.boundary import Margin
    from steadyslip.nonlinear.threshold import Threshold

_ONSETS = {
    "supercritical": "beyond the edge in stiffness, oscillation begins small and grows with distance",
    "subcritical": "on the stable side of the edge in stiffness, small kicks already start oscillation",
    "degenerate": "at the edge in stiffness, oscillations of many sizes neither grow nor decay",
}

_BEYOND = {
    "oscillatory": "stick-slip oscillation sets in",
    "divergence": "sliding runs away without oscillating",
    "ill-posed": "the equations become ill-posed",
    "lock-up": "it locks up",
    "lift-off": "it lifts off",
    "no solution": "steady sliding ceases to exist",
}


def verdict(analysis: Analysis) -> str:
    """The whole verdict as text, at most some 100 columns wide."""
    lines = [headline(analysis), *textwrap.wrap(analysis.reason, 98, initial_indent="  ", subsequent_indent="  "), ""]
    lines += _facts(analysis)
    lines += _margin_table(analysis)
    if analysis.stable:
        lines += ["", "Stable means: small disturbances die out. A large enough kick may still start stick-slip."]
        if analysis.onset is not None and not analysis.kicks:
            lines.append("The kind of onset does not tell how large; steadyslip threshold does.")
    for text in analysis.warnings:
        lines += ["", *textwrap.wrap(f"Warning: {text}", 100, subsequent_indent="  ")]
    return "\n".join(line for i, line in enumerate(lines) if line or (i and lines[i - 1]))


def headline(analysis: Analysis) -> str:
    """The first line: stable, unstable, or no steady sliding."""
    speed = shown(analysis.rig.drive.velocity, "m/s")
    if analysis.stable is None:
        return f"NO STEADY SLIDING at {speed}"
    return f"{'STABLE' if analysis.stable else 'UNSTABLE'}: steady sliding at {speed}"


def reason(analysis: Analysis) -> str:
    """Why, in one sentence."""
    own = analysis.rig.parameters()["slider.stiffness"].value
    critical, side = analysis.critical_stiffness, analysis.critical_side
    if analysis.growth_rate == math.inf:
        return _why_ill_posed(analysis)
    if critical is None:
        if analysis.stable_stiffness:
            if analysis.rig.drive.proportional():
                return "with this controller sliding is stable whatever the stiffness beside it"
            return "sliding is stable at every stiffness" + _why_all(analysis)
        if analysis.rig.friction.memory():
            return "no stiffness makes sliding stable" + _why_none(analysis)
        return "friction falls with velocity and has no memory: no stiffness makes sliding stable"
    if own is None:
        own = _own_stiffness(analysis)
    position = "above" if own > critical else "below"
    gain = float(analysis.rig.drive.proportional())
    which = "stiffness and gain kp together, " if gain and own else "gain kp, " if gain else "stiffness "
    text = (
        f"the {which}{_stiffness(analysis, own + gain)}{',' if gain else ''} is "
        f"{(own + gain) / (critical + gain):.3g} times the critical "
        f"{'' if gain else 'stiffness '}{_stiffness(analysis, critical + gain)}, {side} which sliding is stable"
    )
    if analysis.stable is (position == side):
        return text
    return text + " only in the intervals given below"


def _own_stiffness(analysis: Analysis) -> float:
    from steadyslip.values import model_values

    return float(model_values(analysis.rig).named()["slider.stiffness"])


def _why_none(analysis: Analysis) -> str:
    """Which condition of stability rules out every stiffness, where that can be told."""
    if analysis.characteristic_polynomial[0] <= 0:
        return ": a disturbance runs away without oscillating (static stability, a0 > 0, fails)"
    try:
        known = small_signal(analysis.rig).as_dict()
    except NotAvailable:
        return ""
    known.pop("k")
    if hopf_line(**known)[1] < 0 and known["f"] > 0:
        return ": with this mass the memory of normal stress drives the oscillation (eq. 31)"
    return ""


def _why_ill_posed(analysis: Analysis) -> str:
    """What makes the equations ill-posed: friction that falls at once, or a contact that takes too much."""
    try:
        falling = small_signal(analysis.rig).f < 0
    except NotAvailable:
        falling = not analysis.rig.friction.memory()
    if falling:
        return (
            "the equations are ill-posed: friction falls at once when velocity rises (its direct effect is negative), "
            "and there is no mass to slow that down"
        )
    return (
        "the equations are ill-posed: normal stress takes away more than the mass (or the direct effect of "
        "friction) provides, so any small lag grows at once"
    )


def _why_all(analysis: Analysis) -> str:
    """The plain cause of stability at every stiffness, where there is one."""
    try:
        known = small_signal(analysis.rig)
    except NotAvailable:
        return ""
    return ": friction in steady sliding rises with velocity, dampings included" if known.S >= 0 else ""


def _quantity(analysis: Analysis, value: float, unit: str) -> str:
    """A value per unit area, or for the whole area where the rig has one, as in its file."""
    return shown(value, unit, area=analysis.rig.area)


def _stiffness(analysis: Analysis, value: float) -> str:
    return _quantity(analysis, value, "Pa/m")


def _stress(analysis: Analysis, value: float) -> str:
    area = analysis.rig.area
    return shown(value, "Pa") if area is None else f"{shown(value * area, 'N')} ({shown(value, 'Pa')})"


def _facts(analysis: Analysis) -> list[str]:
    steady = analysis.steady
    if steady is None:
        return []
    force = "force" if analysis.rig.area is not None else "stress"
    rows = [
        (
            "steady sliding",
            f"normal {force} {_stress(analysis, steady.normal_stress)}, "
            f"shear {force} {_stress(analysis, steady.shear_stress)}, friction {steady.friction:.4g}",
        ),
        ("a disturbance", _disturbance(analysis)),
        ("stable for", _stable_set(analysis)),
    ]
    beta = analysis.critical_angular_frequency
    if beta:
        rows.append(("at the edge", f"oscillation with period {shown(2 * math.pi / beta, 's')}"))
    if analysis.critical_axial_stiffness is not None:
        rows.append(("along the axis", f"critical stiffness {_stiffness(analysis, analysis.critical_axial_stiffness)}"))
    if analysis.onset is not None:
        rows.append(("onset", f"{analysis.onset.kind}: {_ONSETS[analysis.onset.kind]}"))
    rows += [("a kick", _survived(kick)) for kick in analysis.kicks]
    lines: list[str] = []
    for name, text in rows:
        lines += textwrap.wrap(f"{name:<15} {text}", 100, subsequent_indent=" " * 16)
    return lines


def _survived(kick: Threshold) -> str:
    """A threshold in a few words."""
    if kick.size == 0:
        return "none is survived: steady sliding is unstable"
    if math.isinf(kick.size):
        return f"every {kick.kick} step in the range searched is survived"
    what = {"velocity": "a velocity step to", "displacement": "a displacement step of",
            "normal-stress": "a normal-stress step of", "impulse": "a blow of"}[kick.kick]  # fmt: skip
    return f"survives {what} {shown(kick.amount, kick.unit, area=kick.rig.area)}; more leads to {kick.outcome}"


def _disturbance(analysis: Analysis) -> str:
    if analysis.growth_rate == math.inf:
        return "grows without limit at once; the model misses an inertia or a direct effect that matters here"
    if analysis.time_to_double is not None:
        text = f"doubles in {shown(analysis.time_to_double, 's')}"
    elif analysis.time_to_halve is not None:
        text = f"halves in {shown(analysis.time_to_halve, 's')}"
    else:
        text = "neither grows nor dies"
    leading = analysis.eigenvalues[0]
    if leading.imag != 0 and analysis.period is not None and analysis.damping_ratio is not None:
        text += f", oscillating with period {shown(analysis.period, 's')}"
        return f"{text} (damping ratio {analysis.damping_ratio:.3g})"
    return f"{text} without oscillating"


def _stable_set(analysis: Analysis) -> str:
    parts = []
    for low, high in analysis.stable_stiffness:
        if low == 0 and high == math.inf:
            parts.append("every stiffness")
        elif high == math.inf:
            parts.append(f"stiffness above {_stiffness(analysis, low)}")
        elif low == 0:
            parts.append(f"stiffness below {_stiffness(analysis, high)}")
        else:
            parts.append(f"stiffness from {_stiffness(analysis, low)} to {_stiffness(analysis, high)}")
    return ", or ".join(parts) or "no stiffness"


def _margin_table(analysis: Analysis) -> list[str]:
    """The nearest edge of each parameter, the others unchanged."""
    with_edge = [margin for margin in analysis.margins if margin.edge is not None]
    without = [_short(analysis, margin.parameter) for margin in analysis.margins if margin.edge is None]
    if not analysis.margins:
        return []
    lines = ["", "Nearest edge in each parameter, the others unchanged, and what happens beyond it"]
    rows = [_margin_row(analysis, margin) for margin in with_edge]
    widths = [max(len(row[i]) for row in rows) for i in range(4)] if rows else []
    lines += [
        "  " + "  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]) for row in rows
    ]
    if without:
        lines += textwrap.wrap(
            f"no edge within range: {', '.join(without)}", 98, initial_indent="  ", subsequent_indent="    "
        )
    return lines


def _margin_row(analysis: Analysis, margin: Margin) -> tuple[str, str, str, str, str]:
    edge = margin.edge
    if edge is None:
        raise InternalError("edge is not None")
    if margin.unit == "rad":
        change = f"{math.degrees(margin.absolute):+.4g} deg"
    elif not margin.value:
        change = "from zero"
    elif 0 < (ratio := edge.value / margin.value) < 0.1 or ratio > 10:
        change = f"x {ratio:.4g}"
    else:
        change = f"{100 * margin.relative:+.4g} %"
    towards = "above" if margin.absolute > 0 else "below"
    if edge.stable == towards:
        words = "becomes stable"
    elif analysis.stable is None:
        words = "slides steadily, but unstable"
    else:
        words = _BEYOND.get(edge.kind, edge.kind)
    return (
        _short(analysis, margin.parameter),
        _quantity(analysis, margin.value, margin.unit),
        f"-> {_quantity(analysis, edge.value, margin.unit)}",
        change,
        words,
    )


def _short(analysis: Analysis, name: str) -> str:
    """The dotted name without its middle: friction.alpha for friction.normal_memory.alpha."""
    first, _, last = name.partition(".")[0], ".", name.rpartition(".")[2]
    known = analysis.rig.parameters()
    try:
        return f"{first}.{last}" if resolve(last, known) == name else name
    except LookupError:
        return name
