"""Chart of a machine's modes: frequencies and damping ratios over a parameter."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from steadyslip.core.format import typeset
from steadyslip.core.palette import BLACK, BLUE, GREEN, GREY, LINES, ORANGE, PURPLE, SKY, VERMILION
from steadyslip.core.written import displayed_as
from steadyslip.figures.style import (
    add_legend_above,
    axis_label,
    display_unit,
    given_panels,
    new_panels,
    parameter_label,
)
from steadyslip.linear import ModeChart

_GROWING, _OTHERS = (VERMILION, ORANGE, PURPLE), (BLUE, GREEN, SKY)
_ROOM = 0.1  # free height above and below the coloured oscillations, as share of their range
_DECADES = 20.0  # the frequency axis is logarithmic if highest over lowest frequency is at least this
_DEEP = 3.0  # damping ratios are drawn up to this many times the largest growth or least decay


def mode_chart(found: ModeChart, ax: Any = None) -> Any:
    """Plot frequencies and damping ratios of modes over a parameter.

    The eight least damped oscillations are coloured; those that grow somewhere have warm colours, and thick lines where
    they grow. Grey: other modes. Dashed: edges of stability. Dotted: the machine's own value.

    Parameters
    ----------
    found : ModeChart
    ax : sequence of matplotlib.axes.Axes, optional
        Two, for frequencies and for damping ratios.

    Returns
    -------
    ndarray of matplotlib.axes.Axes, shape (2,)

    Raises
    ------
    ParameterError
        If `ax` is not two Axes.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/brake-pad.toml")
    >>> found = ss.linear.mode_chart(machine, "links.caliper.stiffness")
    >>> axes = ss.figures.mode_chart(found)
    >>> axes[0].figure.savefig("mode-chart.svg")
    """
    if ax is None:
        axes = new_panels(2, 1, (6.4, 5.6), sharex=True)[:, 0]
    else:
        axes = given_panels(ax, (2,), "two, for frequencies and damping ratios")
    frequencies, ratios = found.frequencies, found.damping_ratios
    shown = found.least_damped
    with displayed_as(found.rig.written_as(found.parameter)):
        factor, unit = display_unit(
            found.unit, float(np.max(np.abs(found.values))), found.rig.printed_area(found.parameter)
        )
    values = found.values / factor
    high = float(np.nanmax(frequencies[:, shown]))
    scale, hertz = display_unit("Hz", high)
    for i in range(len(found.numbers)):
        if i not in shown:
            axes[0].plot(values, frequencies[:, i] / scale, color=GREY, linewidth=0.8, label="_other")
    styles = {grows: iter(product(LINES, known)) for grows, known in ((True, _GROWING), (False, _OTHERS))}
    for i in shown:
        grows = bool(np.any(ratios[:, i] < 0))
        line, colour = next(styles[grows])
        for one, column in zip(axes, (frequencies[:, i] / scale, ratios[:, i]), strict=True):
            one.plot(values, column, line, color=colour, linewidth=1.3, label=found.titles[i])
            if grows:
                where = np.where(ratios[:, i] < 0, column, np.nan)
                one.plot(values, where, color=colour, linewidth=3.2, label="_grows")
    _set_heights(axes, frequencies[:, shown] / scale, ratios[:, shown])
    own = found.rig.parameters()[found.parameter].value
    for one in axes:
        for edge in found.edges:
            one.axvline(edge.value / factor, color=BLACK, linestyle="--", linewidth=1, label="_edge")
        if own is not None and found.values[0] <= own <= found.values[-1]:
            one.axvline(own / factor, color=BLACK, linestyle=":", linewidth=1, label="_own")
    for edge in found.edges:
        text = typeset(found.told(edge.value))
        axes[1].annotate(
            text, (edge.value / factor, 1), xycoords=("data", "axes fraction"), xytext=(0, 2),
            textcoords="offset points", ha="center", va="bottom", fontsize="small",
        )  # fmt: skip
    axes[1].axhline(0.0, color=BLACK, linewidth=1, label="_zero")
    if found.is_geometric:
        axes[1].set_xscale("log")
    axes[1].set_xlim(values[0], values[-1])
    axes[0].set_ylabel(axis_label("frequency", hertz))
    axes[1].set_ylabel(axis_label("damping ratio", ""))
    axes[1].set_xlabel(axis_label(parameter_label(found.rig, found.parameter), unit))
    _name_marks(axes)
    add_legend_above(axes[0], 4, 1.0, fontsize="small")
    return axes


def _name_marks(axes: Any) -> None:
    """Add legend entries for the marks that are drawn: growing modes, edges, this machine, other modes."""
    marks = {
        "_grows": ("grows", {"color": BLACK, "linewidth": 3.2}),
        "_edge": ("edge of stability", {"color": BLACK, "linestyle": "--", "linewidth": 1}),
        "_own": ("this machine", {"color": BLACK, "linestyle": ":", "linewidth": 1}),
        "_other": ("other modes", {"color": GREY, "linewidth": 0.8}),
    }
    drawn = {line.get_label() for line in axes[0].lines}
    for key, (words, style) in marks.items():
        if key in drawn:
            axes[0].plot([], [], label=words, **style)


def _set_heights(axes: Any, frequencies: np.ndarray, ratios: np.ndarray) -> None:
    """Set the ranges of both y axes so that the coloured oscillations and zero damping are in view."""
    low, high = float(np.nanmin(frequencies)), float(np.nanmax(frequencies))
    if high > _DECADES * low:
        axes[0].set_yscale("log")
        axes[0].set_ylim(low * (1 - _ROOM), high * (1 + _ROOM))
    else:
        room = _ROOM * (high - low) or _ROOM * high
        axes[0].set_ylim(low - room, high + room)
    least = float(np.nanmin(ratios))
    deep = _DEEP * max(abs(least), float(np.nanmin(np.nanmax(ratios, axis=0))))
    top = min(float(np.nanmax(ratios)), deep)
    axes[1].set_ylim(min(least, 0) - _ROOM * (top - min(least, 0)), top + _ROOM * (top - min(least, 0)))
