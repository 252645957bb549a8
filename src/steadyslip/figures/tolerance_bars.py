"""Bar chart of safety factor or growth rate within the tolerances of each parameter."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.format import typeset
from steadyslip.core.palette import BLACK, STABLE, UNKNOWN, UNSTABLE
from steadyslip.figures.style import add_legend_above, axes_or_new, is_narrow, parameter_label
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.stiffness import STIFFNESS, growth_rate
from steadyslip.verdict.tolerances import Tolerated
from steadyslip.verdict.words import format_parameter_range

COLOURS = {True: STABLE, False: UNSTABLE, None: UNKNOWN}
_DECADE = 10.0  # the axis is logarithmic if the ratio of safety factors is at least this
WORDS = {True: "stable throughout", False: "unstable throughout", None: "stable in a part"}


def tolerances(found: Tolerated, ax: Axes | None = None) -> Axes:
    """Plot ranges of the safety factor (stiffness over critical stiffness), or of the growth rate, within tolerances.

    There is one bar for each parameter varied alone, and one for all parameters together. Growth rates are drawn if
    `found.along` is empty.

    Parameters
    ----------
    found : Tolerated
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> axes = ss.figures.tolerances(ss.tolerate(rig, {"friction.a": "3 %"}))
    >>> axes.figure.savefig("tolerances.svg")
    """
    edges = bool(found.along)
    spans = {one.parameter: one.safety if edges else one.growth for one in found.alone}
    shown = [one for one in found.alone if np.all(np.isfinite(spans[one.parameter]))][::-1]
    ax = axes_or_new(ax, (1.6 + 0.55 * len(shown)) * (1.4 if is_narrow() else 1.0))  # letters shrink less
    for row, one in enumerate(shown, start=1):
        low, high = spans[one.parameter]
        label = WORDS[one.stable] if one.stable not in [other.stable for other in shown[: row - 1]] else None
        ax.barh(row, high - low, 0.55, left=low, color=COLOURS[one.stable], edgecolor=BLACK, label=label)
    known = np.array(found.ranges.get("safety" if edges else "growth", ()))
    if len(known):
        ax.barh(
            0,
            known.max() - known.min(),
            0.55,
            left=known.min(),
            color="white",
            edgecolor=BLACK,
            linewidth=1.8,
            label="all together",
        )
    ranges = [
        typeset(format_parameter_range(found.rig, one.parameter, one.low, one.high)).replace("-", "−") for one in shown
    ]
    rows = [f"{parameter_label(found.rig, one.parameter)}\n{text}" for one, text in zip(shown, ranges, strict=True)]
    ax.set_yticks(range(len(shown) + 1), ["all together", *rows])
    ax.margins(x=0.06)
    ends = np.concatenate([known, *(spans[one.parameter] for one in shown)])
    if edges and 0 < ends.min() < ends.max() / _DECADE:
        ax.set_xscale("log")
    ax.use_sticky_edges = False  # otherwise the widest bar touches the frame
    ax.axvline(1.0 if edges else 0.0, color=BLACK, linewidth=1)
    own = safety_factor(found.rig, along=found.along) if edges else growth_rate(found.rig)
    ax.axvline(float(own), color=BLACK, linewidth=1, linestyle=":", label="the rig itself")
    words = "growth rate of disturbances (1/s)"
    if edges:
        stiffness = found.along == STIFFNESS
        words = (
            "stiffness over critical stiffness"
            if stiffness
            else f"{parameter_label(found.rig, found.along)} over its edge"
        )
        words += " (1)"
    ax.set_xlabel(words)
    add_legend_above(ax, 4, 1.0, fontsize="small")
    return ax
