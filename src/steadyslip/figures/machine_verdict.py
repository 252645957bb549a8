"""Figures of the verdict on a machine: stable range of each parameter, leading mode, eigenvalues."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_percent, format_quantity, typeset
from steadyslip.core.palette import BLACK, BLUE, ORANGE, SKY, VERMILION
from steadyslip.figures.style import AREAS, add_legend_above, axes_or_new, is_narrow, parameter_label
from steadyslip.linear import Modes
from steadyslip.linear.boundary import Margin
from steadyslip.linear.status import ABSENT, STABLE, UNSTABLE
from steadyslip.machine.mechanism import NORMAL
from steadyslip.verdict import Analysis
from steadyslip.verdict.words import PACE, format_parameter

_SPAN_FACTOR = 100.0  # ranges are drawn from value / 100 to value × 100
LOST = ("lock-up", "lift-off", "no solution")
"""Kinds of edges beyond which no steady sliding exists."""
_MAX_PARAMETERS = 24  # largest number of rows of `stable_ranges`, so that the figure fits on a page (by trial)


def machine_verdict(found: Analysis) -> np.ndarray:
    """Plot stable ranges, leading mode and eigenvalues side by side.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        Axes of `stable_ranges`, `mode_shape` and `eigenvalue_plane`; only the first without a mode.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> axes = ss.figures.machine_verdict(ss.analyze(machine))
    >>> axes[0].figure.savefig("machine-verdict.svg")
    """
    from matplotlib import pyplot as plt

    rows = max(len(_drawn_margins(found)), 4)
    if found.mode is None:
        return np.array([stable_ranges(found, axes_or_new(None, 1.4 + 0.32 * rows))])
    width = rcParams["figure.figsize"][0]
    bars = 1.2 + 0.28 * len(found.mode.amplitudes)  # height (inches) of the panel with the mode and its energies
    if not is_narrow():
        size = 1.5 * width, max(1.6 + 0.34 * rows, 3.0 + bars)
        layout: Any = [["ranges", "mode"], ["ranges", "plane"]]
        shares: Any = {"width_ratios": (1.5, 1), "height_ratios": (bars, 2.0)}
    else:
        heights = (0.6 + 0.2 * rows, 0.7 * bars, 1.7)
        size, layout, shares = (width, sum(heights)), [["ranges"], ["mode"], ["plane"]], {"height_ratios": heights}
    axes = plt.figure(figsize=size, layout="constrained").subplot_mosaic(layout, **shares)
    for draw, name in ((stable_ranges, "ranges"), (mode_shape, "mode"), (eigenvalue_plane, "plane")):
        draw(found, axes[name])
    return np.array([axes[name] for name in ("ranges", "mode", "plane")])


def stable_ranges(found: Analysis, ax: Axes | None = None) -> Axes:
    """Plot the stable range of each parameter, the others unchanged, as a bar over the parameter divided by its value.

    Only positive parameters with an edge within a factor of 100 are drawn, nearest edge first; the value at that edge
    is printed beside the bar.

    Raises
    ------
    NotAvailable
        If no parameter has an edge.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> axes = ss.figures.stable_ranges(ss.analyze(machine))
    >>> axes.figure.savefig("stable-ranges.svg")
    """
    margins = _drawn_margins(found)
    if not margins:
        raise NotAvailable("no parameter of this machine has an edge that could be drawn")
    ax = axes_or_new(ax, 1.4 + 0.32 * len(margins))
    beside = partial(ax.text, 1.02, va="center", fontsize="small", transform=ax.get_yaxis_transform())
    named: set[int] = set()
    for row, margin in enumerate(margins):
        known = (
            max(margin.searched[0] / margin.value, 1 / _SPAN_FACTOR),
            min(margin.searched[1] / margin.value, _SPAN_FACTOR),
        )
        for low, high, status in _pieces(margin):
            a, b = max(low / margin.value, known[0]), min(high / margin.value, known[1])
            if a < b:
                words, style = AREAS[status]
                label = f"_{words}" if status in named else words
                ax.barh(row, b - a, left=a, height=0.62, label=label, **style)
                ax.barh(row, b - a, left=a, height=0.62, color="none", edgecolor=BLACK, linewidth=0.6, label="_outline")
                named.add(status)
        if margin.edge is not None:
            beside(row, typeset(format_parameter(found.rig, margin.parameter, margin.edge.value)))
    ax.axvline(1.0, color=BLACK, linewidth=2.5)
    ax.set_xscale("log")
    ax.set_xlim(1 / _SPAN_FACTOR, _SPAN_FACTOR)
    ax.set_xticks([0.01, 0.1, 1, 10, 100], ["1/100", "1/10", "1", "10", "100"])
    _label_rows(ax, [parameter_label(found.rig, margin.parameter) for margin in margins])
    left = len(undrawn_edges(found))
    more = f"\n{left} more edge{'s' if left > 1 else ''} not drawn" if left else ""
    ax.set_xlabel(f"value over its own, now at 1;\nat the right: the value at the nearest edge{more}")
    add_legend_above(ax, 3, 1.0, fontsize="small")
    return ax


def _drawn_margins(found: Analysis) -> list[Margin]:
    low, high = 1 / _SPAN_FACTOR, _SPAN_FACTOR
    drawn = [m for m in found.margins if m.edge is not None and m.value > 0 and low < m.edge.value / m.value < high]
    return drawn[:_MAX_PARAMETERS]


def undrawn_edges(found: Analysis) -> list[str]:
    """Names of parameters with an edge that `stable_ranges` leaves out: too far away, too many, or not positive."""
    drawn = {one.parameter for one in _drawn_margins(found)}
    return [one.parameter for one in found.margins if one.edge is not None and one.parameter not in drawn]


def _label_rows(ax: Axes, labels: list[str]) -> None:
    """Label the rows of a horizontal bar chart, first row at the top, without ticks and frame."""
    ax.set_yticks(range(len(labels)), labels)
    ax.set_ylim(len(labels) - 0.45, -0.55)
    ax.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)


def _pieces(margin: Margin) -> list[tuple[float, float, int]]:
    """Intervals between the edges of a parameter: low and high end (SI units), and status code."""
    edges = sorted(margin.edges, key=lambda edge: edge.value)
    ends = [0.0, *(edge.value for edge in edges), math.inf]
    stable = [edges[0].stable == "below", *(edge.stable == "above" for edge in edges)]
    lost = [sum(edge.kind in LOST for edge in edges[:n]) for n in range(len(edges) + 1)]
    own = lost[sum(edge.value < margin.value for edge in edges)]  # the rig's own interval: it slides steadily
    status = [
        ABSENT if (many - own) % 2 else STABLE if good else UNSTABLE for many, good in zip(lost, stable, strict=True)
    ]
    return [(low, high, code) for low, high, code in zip(ends[:-1], ends[1:], status, strict=True) if low < high]


def mode_shape(found: Analysis | Modes, ax: Axes | None = None) -> Axes:
    """Plot the amplitude of every body in a mode, and the largest shares of its energy.

    For an analysis this is the leading mode, for `steadyslip.modes` the chosen mode. Blue bars: amplitudes over the
    largest amplitude, each relative to the rigid motion of the machine; bars of bodies in opposite phase point to the
    left. Orange bars: shares of energy.

    Raises
    ------
    NotAvailable
        If there is no mode, because sliding is not steady or the equations are ill-posed.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> axes = ss.figures.mode_shape(ss.analyze(machine))
    >>> axes.figure.savefig("mode-shape.svg")
    """
    mode = found.mode
    if mode is None:
        raise NotAvailable("this rig has no mode: modes are of machines that slide steadily and are not ill-posed")
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
                ha="left" if size < 0 else "right", fontsize="small")  # fmt: skip
    for row, (_, share) in enumerate(energy.items(), start=len(names)):
        ax.barh(row, share, height=0.6, color=ORANGE)
        ax.text(-0.03, row, format_percent(round(share, 3)), va="center", ha="right", fontsize="small")
    labels = [name.replace(NORMAL, " (normal)") for name in names]
    labels += [f"energy in {name.partition('.')[2]}" for name in energy]
    ax.axvline(0.0, color=BLACK, linewidth=1)
    _label_rows(ax, labels)
    ax.set_xlim(-1.1, 1.1)
    rate = mode.eigenvalue.real
    does = "grows" if rate > 0 else "decays" if rate < 0 else PACE["stays"]
    kind = (
        f"period {format_quantity(2 * math.pi / abs(mode.eigenvalue.imag), 's')}"
        if mode.eigenvalue.imag
        else "no oscillation"
    )
    title = f"mode {mode.number}" if isinstance(found, Modes) and mode.number else "leading mode"
    ax.set_xlabel(typeset(f"amplitude,\nshare of energy\n{title}\n{does}, {kind}"), fontsize="small")
    ax.tick_params(axis="x", labelsize="small")
    return ax


def eigenvalue_plane(found: Analysis, ax: Axes | None = None) -> Axes:
    """Plot eigenvalues in the complex plane; axes are linear up to the smallest part, and logarithmic beyond.

    Raises
    ------
    NotAvailable
        If there are no eigenvalues.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> axes = ss.figures.eigenvalue_plane(ss.analyze(machine))
    >>> axes.figure.savefig("eigenvalue-plane.svg")
    """
    s = np.array(found.eigenvalues)
    s = s[np.isfinite(s)]
    if not s.size:
        raise NotAvailable("this rig has no eigenvalues: it does not slide steadily, or its equations are ill-posed")
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
    ax.tick_params(labelsize="small")
    ax.set_xlabel("growth rate Re s (1/s)", fontsize="small")
    ax.set_ylabel("Im s (rad/s)", fontsize="small")
    add_legend_above(ax, 2, 1.0, fontsize="small")
    return ax


def _few_ticks(axis: Any, low: float, high: float, least: float) -> None:
    """Set ticks at zero and at up to two powers of ten on each side, none below `least`; no minor ticks."""
    ticks = [0.0]
    for end in (low, high):
        top = math.floor(math.log10(abs(end)))
        step = max(2, (top - math.floor(math.log10(least))) // 2)
        ticks += [math.copysign(10.0**power, end) for power in (top, top - step) if 10.0**power >= least]
    axis.set_ticks(sorted(ticks))
    axis.set_minor_locator(NullLocator())
