"""The verdict on a machine as pictures: its eigenvalues, its leading mode body by body, and where it is stable."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_percent, format_quantity, typeset
from steadyslip.figures.style import BLACK, BLUE, GREY, ORANGE, SKY, VERMILION, axes_or_new
from steadyslip.linear.boundary import Margin
from steadyslip.machine.mechanism import NORMAL
from steadyslip.verdict import MachineAnalysis

_SPAN = 100.0  # factor to each side of a value over which its stable range is drawn
_MOST = 24  # parameters at most


def machine_verdict(found: MachineAnalysis) -> np.ndarray:
    """Stable ranges, mode and eigenvalues side by side.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        Those of `stable_ranges`, `mode_shape` and `eigenvalue_plane`; the first alone without steady sliding.
    """
    from matplotlib import pyplot as plt

    rows = max(len(_shown(found)), 4)
    if found.mode is None:
        return np.array([stable_ranges(found, axes_or_new(None, 1.4 + 0.32 * rows))])
    figure = plt.figure(figsize=(9.6, 1.6 + 0.34 * rows), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.5, 1))
    axes = [figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])]
    for draw, ax in zip((stable_ranges, mode_shape, eigenvalue_plane), axes, strict=True):
        draw(found, ax)
    return np.array(axes)


def stable_ranges(found: MachineAnalysis, ax: Axes | None = None) -> Axes:
    """Where the machine is stable in each parameter, the others unchanged, as bars over the value in units of its own.

    Only positive parameters with an edge up to a factor of 100 away are drawn, the nearest first. Numbers are those of
    the nearest edge.

    Raises
    ------
    NotAvailable
        If no parameter has an edge.
    """
    margins = _shown(found)
    if not margins:
        raise NotAvailable("no parameter of this machine has an edge that could be drawn")
    ax = axes_or_new(ax, 1.4 + 0.32 * len(margins))
    for row, margin in enumerate(margins):
        known = max(margin.searched[0] / margin.value, 1 / _SPAN), min(margin.searched[1] / margin.value, _SPAN)
        ax.barh(row, known[1] - known[0], left=known[0], height=0.62, color="white", edgecolor=GREY, hatch="////",
                linewidth=0.6, label="_unstable")  # fmt: skip
        for low, high in _stable(margin):
            a, b = max(low / margin.value, known[0]), min(high / margin.value, known[1])
            if a < b:
                ax.barh(row, b - a, left=a, height=0.62, color=SKY, edgecolor=BLACK, linewidth=0.6, label="_stable")
        _edge_text(found, ax, row, margin)
    ax.axvline(1.0, color=VERMILION, linewidth=2)
    ax.set_xscale("log")
    ax.set_xlim(1 / _SPAN, _SPAN)
    ax.set_xticks([0.01, 0.1, 1, 10, 100], ["1/100", "1/10", "as it is", "× 10", "× 100"])
    ax.set_yticks(range(len(margins)), [_label(margin.parameter) for margin in margins])
    ax.set_ylim(len(margins) - 0.45, -0.55)
    ax.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    left = len(left_out(found))
    more = f"\n{left} more edge{'s' if left > 1 else ''} not drawn: see the list" if left else ""
    ax.set_xlabel(f"value over its own; blue: stable, hatched: unstable or none{more}")
    return ax


def _shown(found: MachineAnalysis) -> list[Margin]:
    return [m for m in found.margins if m.edge is not None and m.value > 0 and _in_view(m.edge.value / m.value)][:_MOST]


def left_out(found: MachineAnalysis) -> list[str]:
    """Parameters with an edge that `stable_ranges` does not draw: a factor of 100 away or more, or not positive."""
    drawn = {one.parameter for one in _shown(found)}
    return [one.parameter for one in found.margins if one.edge is not None and one.parameter not in drawn]


def _in_view(ratio: float) -> bool:
    return 1 / _SPAN < ratio < _SPAN


def _label(name: str) -> str:
    parts = name.split(".")
    return ".".join(parts[1:]) if parts[0] in ("bodies", "links", "contacts") else name


def _stable(margin: Margin) -> list[tuple[float, float]]:
    """Stable intervals between the edges of a parameter, of which there is one at least."""
    edges = sorted(margin.edges, key=lambda edge: edge.value)
    ends = [0.0, *(edge.value for edge in edges), math.inf]
    stable = [edges[0].stable == "below"]
    stable += [edge.stable == "above" for edge in edges]
    return [(low, high) for low, high, good in zip(ends[:-1], ends[1:], stable, strict=True) if good]


def _edge_text(found: MachineAnalysis, ax: Axes, row: int, margin: Margin) -> None:
    edge = margin.edge
    if edge is None:
        return
    text = typeset(format_quantity(edge.value, margin.unit, area=found.rig.area_of(margin.parameter)))
    ratio = edge.value / margin.value
    left = 1 / _SPAN**0.75 < ratio < 1 or ratio > _SPAN**0.75  # on the side that has room
    ax.annotate(
        text, (ratio, row), xytext=(-3 if left else 3, 0), textcoords="offset points", ha="right" if left else "left",
        va="center", fontsize=7.5, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85},
    )  # fmt: skip


def mode_shape(found: MachineAnalysis, ax: Axes | None = None) -> Axes:
    """How far every body moves in the leading mode, and where the energy is.

    Bars: amplitudes as shares of the largest, against the rigid motion of the machine; those of bodies that move the
    other way point to the left. Orange: shares of energy.

    Raises
    ------
    NotAvailable
        If there is no mode, because sliding is not steady or the equations are ill-posed.
    """
    mode = found.mode
    if mode is None:
        raise NotAvailable("this machine has no mode: it does not slide steadily, or its equations are ill-posed")
    names = list(mode.amplitudes)
    energy = {n: share for n, share in sorted(mode.energy.items(), key=lambda item: -item[1])[:3] if share > 0.005}
    ax = axes_or_new(ax, 1.2 + 0.32 * (len(names) + len(energy)))
    for row, name in enumerate(names):
        one = mode.amplitudes[name]
        size = math.copysign(abs(one), one.real or 1.0)
        ax.barh(row, size, height=0.6, color=BLUE)
        degrees = math.degrees(math.atan2(one.imag, one.real))
        behind = f", {degrees:+.0f}°" if abs(math.sin(math.radians(degrees))) > 0.1 and abs(one) > 0.01 else ""
        ax.text(0.03 if size < 0 else -0.03, row, f"{abs(one):.2g}{behind}".replace("-", "−"), va="center",
                ha="left" if size < 0 else "right", fontsize=7.5)  # fmt: skip
    for row, (_, share) in enumerate(energy.items(), start=len(names)):
        ax.barh(row, share, height=0.6, color=ORANGE)
        ax.text(-0.03, row, format_percent(round(share, 3)), va="center", ha="right", fontsize=7.5)
    labels = [name.replace(NORMAL, " (normal)") for name in names]
    labels += [f"energy in {name.partition('.')[2]}" for name in energy]
    ax.axvline(0.0, color=BLACK, linewidth=1)
    ax.set_yticks(range(len(labels)), labels)
    ax.set_ylim(len(labels) - 0.45, -0.55)
    ax.set_xlim(-1.1, 1.1)
    ax.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    does = "grows" if mode.eigenvalue.real > 0 else "decays"
    kind = (
        f"period {format_quantity(2 * math.pi / abs(mode.eigenvalue.imag), 's')}"
        if mode.eigenvalue.imag
        else "no oscillation"
    )
    ax.set_xlabel(typeset(f"leading mode\n{does}, {kind}"), fontsize=8)
    ax.tick_params(axis="x", labelsize=8)
    return ax


def eigenvalue_plane(found: MachineAnalysis, ax: Axes | None = None) -> Axes:
    """Eigenvalues in the complex plane, which fast and slow ones share: sizes are logarithmic beyond the slowest.

    Raises
    ------
    NotAvailable
        If there are none.
    """
    s = np.array(found.eigenvalues)
    s = s[np.isfinite(s)]
    if not s.size:
        raise NotAvailable(
            "this machine has no eigenvalues: it does not slide steadily, or its equations are ill-posed"
        )
    ax = axes_or_new(ax)
    sizes = np.abs(np.concatenate([s.real, s.imag]))
    least = float(np.min(sizes[sizes > 1e-9 * np.max(sizes)], initial=np.max(sizes) or 1.0))
    grows = s.real > 0
    for mask, colour, marker, words in ((~grows, SKY, "o", "decays"), (grows, VERMILION, "D", "grows")):
        if np.any(mask):
            ax.plot(s.real[mask], s.imag[mask], marker, color=colour, markeredgecolor=BLACK, label=words, clip_on=False)
    for set_scale in (ax.set_xscale, ax.set_yscale):
        set_scale("symlog", linthresh=least, linscale=0.5)
    ax.axvline(0.0, color=BLACK, linewidth=1)
    ax.axhline(0.0, color=BLACK, linewidth=0.5, alpha=0.4)
    right = 3 * float(np.max(s.real)) if np.any(grows) else 3 * least
    ax.set_xlim(3 * min(float(np.min(s.real)), -least), max(right, 3 * least))
    top = 3 * max(float(np.max(s.imag)), least)
    ax.set_ylim(-top, top)
    for axis, ends in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        _few_ticks(axis, *ends, least)
    ax.tick_params(labelsize=8)
    ax.set_xlabel("growth rate Re s (1/s)", fontsize=8)
    ax.set_ylabel("Im s (rad/s)", fontsize=8)
    ax.legend(loc="best", fontsize=7.5, frameon=True)
    return ax


def _few_ticks(axis: Any, low: float, high: float, least: float) -> None:
    """Zero and two powers of ten to each side."""
    ticks = [0.0]
    for end in (low, high):
        top = math.floor(math.log10(abs(end)))
        step = max(2, (top - math.floor(math.log10(least))) // 2)
        ticks += [math.copysign(10.0**power, end) for power in (top, top - step) if 10.0**power >= least]
    axis.set_ticks(sorted(ticks))
    axis.set_minor_locator(NullLocator())
