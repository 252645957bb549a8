"""Frequency response (Bode plot) of a rig, and stability at each moment of a slow change."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.format import format_quantity
from steadyslip.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, axis_label, display_unit, new_panels

if TYPE_CHECKING:
    from steadyslip.nonlinear import FrequencyResponse, FrozenVerdicts

_MARKERS = ("o", "s", "^", "D", "v")


def frequency_response(found: FrequencyResponse, ax: Any = None) -> Any:
    """Plot gain and phase over the period: linear response as lines, finite amplitudes as marks with their mean shift.

    Parameters
    ----------
    found : FrequencyResponse
    ax : sequence of matplotlib.axes.Axes, optional
        Two, for gain and phase; a third for the shift of the mean if the response has finite amplitudes.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    count = 3 if found.amplitudes.size else 2
    if ax is None:
        ax = new_panels(count, 1, (6.4, 2.3 * count), sharex=True)
    axes = np.atleast_1d(np.asarray(ax, dtype=object)).reshape(-1)
    unit = "1" if found.units[0] == found.units[1] else f"{found.units[1]}/({found.units[0]})"
    for one, values, label in zip(axes, (found.gain, found.phase), ("small amplitudes", None), strict=False):
        one.plot(found.periods, values, color=BLACK, label=label)
    shifts = np.abs(found.shift[np.isfinite(found.shift)])
    factor, shift_unit = display_unit(found.units[1], float(np.max(shifts, initial=0.0)))
    rows = zip(found.amplitudes, cycle((BLUE, VERMILION, GREEN, ORANGE)), cycle(_MARKERS), strict=False)
    for j, (amplitude, colour, mark) in enumerate(rows):
        style = {"color": colour, "marker": mark, "linestyle": "none", "fillstyle": "none", "markersize": 5}
        for one, values in zip(axes, (found.gains[j], found.phases[j], found.shift[j] / factor), strict=True):
            one.plot(found.periods, values, **style)
        axes[0].plot([], [], **style, label=f"amplitude {format_quantity(amplitude, found.units[0])}")
        if np.any(lost := ~np.isfinite(found.gains[j])):
            place = np.full(np.count_nonzero(lost), np.min(found.gain))
            axes[0].plot(found.periods[lost], place, "x", color=colour, label="no answer of that period")
    if found.resonance is not None:
        for one in axes:
            one.axvline(found.resonance[0], color=GREY, linestyle=":", linewidth=1)
    axes[0].set_xscale("log")
    axes[0].set_yscale("log")
    for one in axes[1:]:
        one.set_xscale("log")
    axes[0].set_ylabel(f"gain ({unit})")
    axes[1].set_ylabel("phase (deg)")
    if count == 3:
        axes[2].set_ylabel(axis_label("shift of the mean", shift_unit))
    axes[-1].set_xlabel("period (s)")
    axes[0].set_title(f"{found.output.replace('_', ' ')} under {found.input.replace('_', ' ')}", fontsize="medium")
    axes[0].legend(fontsize="small")
    return axes


def frozen_verdicts(found: FrozenVerdicts, ax: Any = None) -> Any:
    """Plot growth rate over time, with unstable times hatched, and the slip rate of the motion in a second panel.

    Parameters
    ----------
    found : FrozenVerdicts
    ax : sequence of matplotlib.axes.Axes, optional
        Two, for growth rate and slip rate.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    if ax is None:
        ax = new_panels(2, 1, (6.4, 4.8), sharex=True)
    axes = np.atleast_1d(np.asarray(ax, dtype=object)).reshape(-1)
    factor, unit = display_unit("s", float(found.t[-1]))
    t = found.t / factor
    axes[0].plot(t, found.growth_rate, color=BLACK)
    axes[0].axhline(0.0, color=GREY, linewidth=1)
    for one in axes:
        unstable = one.fill_between(
            t, 0, 1, where=found.growth_rate > 0, transform=one.get_xaxis_transform(), facecolor="none", hatch="//",
            edgecolor=VERMILION, linewidth=0, alpha=0.5,
        )  # fmt: skip
    unstable.set_label("steady sliding is unstable")
    for (name, own), colour in zip(found.slip_rates.items(), cycle((BLUE, GREEN, ORANGE)), strict=False):
        axes[1].plot(found.run["t"] / factor, np.abs(own), color=colour, label=name or "slip rate")
    if np.isfinite(found.departure):
        axes[1].axvline(found.departure / factor, color=BLACK, linestyle="--", linewidth=1, label="motion departs")
    axes[1].set_yscale("log")
    axes[0].set_ylabel("growth rate (1/s)")
    axes[1].set_ylabel("slip rate (m/s)")
    axes[1].set_xlabel(axis_label("time", unit))
    axes[1].legend(fontsize="small")
    return axes
