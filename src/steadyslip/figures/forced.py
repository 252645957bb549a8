"""Figures of the frequency response (Bode plot) of a rig, and of stability at each moment of a slow change."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.palette import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION
from steadyslip.figures.style import AREAS, add_legend_above, axis_label, display_unit, new_panels
from steadyslip.linear.status import ABSENT, UNSTABLE

if TYPE_CHECKING:
    from steadyslip.nonlinear import FrequencyResponse, FrozenVerdicts

_MARKERS = ("o", "s", "^", "D", "v")
_COLOURS = (BLUE, VERMILION, GREEN, ORANGE)
BESIDE = 0.2  # curves have more points within this share of the period to each side of a resonance
HALF_TURN = 180.0  # degrees; a larger jump of the phase is due to its period of 360


def frequency_response(found: FrequencyResponse, ax: Any = None) -> Any:
    """Plot gain and phase over the period: linear response as lines, finite amplitudes as marks.

    Further panels: shift of the mean at finite amplitudes; if the response has limits, the amplitudes up to which it is
    linear and from which sliding is lost.

    Parameters
    ----------
    found : FrequencyResponse
    ax : sequence of matplotlib.axes.Axes, optional
        For gain, phase, then shift of the mean (with finite amplitudes) and limits (if the response has them).

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> found = ss.response(rig, [10.0, 100.0])
    >>> axes = ss.figures.frequency_response(found)
    >>> axes[0].figure.savefig("frequency-response.svg")
    """
    drawn = [_gain, _phase]
    drawn += [_shift] if found.amplitudes.size else []
    drawn += [] if np.all(np.isnan(found.linear_to)) else [_limits]
    if ax is None:
        ax = new_panels(len(drawn), 1, (6.4, 2.3 * len(drawn)), sharex=True)
    axes = np.atleast_1d(np.asarray(ax, dtype=object)).reshape(-1)
    for one, draw in zip(axes, drawn, strict=True):
        draw(found, one)
        one.set_xscale("log")
        for period in found.resonances[:1, 0]:
            one.axvline(period, color=BLACK, linestyle=":", linewidth=1, label="resonance" if one is axes[0] else "")
    axes[-1].set_xlabel("period (s)")
    axes[0].set_title(found.title.replace("-", " "), fontsize="medium")
    axes[0].legend(fontsize="small")
    return axes


def _small(found: FrequencyResponse) -> tuple[np.ndarray, np.ndarray]:
    """Periods (s) for a smooth line, refined at resonances, and the linear response (complex) at them."""
    low, high = found.periods[0], found.periods[-1]
    peaks = np.outer(found.resonances[:, 0], 1 + np.linspace(-BESIDE, BESIDE, 41) ** 3 / BESIDE**2).ravel()
    periods = np.unique(np.concatenate([found.periods, np.geomspace(low, high, 400), peaks]))
    periods = periods[(periods >= low) & (periods <= high)]
    return periods, found.transfer(periods)


def _styles(found: FrequencyResponse) -> Iterator[tuple[int, float, dict[str, Any]]]:
    """Index, amplitude and marker style of each finite amplitude."""
    for j, amplitude in enumerate(found.amplitudes):
        style = {"color": _COLOURS[j % len(_COLOURS)], "marker": _MARKERS[j % len(_MARKERS)]}
        yield j, amplitude, style | {"linestyle": "none", "fillstyle": "none", "markersize": 5}


def _gain(found: FrequencyResponse, ax: Any) -> None:
    factor, unit = found.drawn_gain_unit
    periods, answer = _small(found)
    ax.plot(periods, factor * np.abs(answer), color=BLACK, label="small amplitudes")
    for j, amplitude, style in _styles(found):
        ax.plot(found.periods, factor * found.gains[j], **style, label=f"amplitude {found.told(amplitude)}")
        if np.any(lost := ~np.isfinite(found.gains[j])):
            place = np.full(np.count_nonzero(lost), factor * np.min(found.gain))
            ax.plot(found.periods[lost], place, "x", color=style["color"], label="no answer of that period")
    ax.set_yscale("log")
    ax.set_ylabel(f"gain ({unit or '1'})")


def _phase(found: FrequencyResponse, ax: Any) -> None:
    periods, answer = _small(found)
    phase = np.degrees(np.angle(answer))
    breaks = np.flatnonzero(np.abs(np.diff(phase)) > HALF_TURN) + 1
    ax.plot(np.insert(periods, breaks, np.nan), np.insert(phase, breaks, np.nan), color=BLACK)
    for j, _, style in _styles(found):
        ax.plot(found.periods, found.phases[j], **style)
    ax.set_ylabel("phase (deg)")


def _shift(found: FrequencyResponse, ax: Any) -> None:
    times, unit = found.shown_units[1]
    shifts = times * found.shift
    factor, unit = display_unit(unit, float(np.max(np.abs(shifts[np.isfinite(shifts)]), initial=0.0)))
    for j, _, style in _styles(found):
        ax.plot(found.periods, shifts[j] / factor, **style)
    ax.set_ylabel(axis_label("shift of the mean", unit))


def _limits(found: FrequencyResponse, ax: Any) -> None:
    times, unit = found.shown_units[0]
    limits = times * np.array([found.linear_to, found.lost_at])
    limits[~np.isfinite(limits) | (limits == 0)] = np.nan
    factor, unit = display_unit(unit, float(np.nanmax(limits, initial=0.0)))
    for own, line, label in zip(limits / factor, ("k--", "k-"), ("linear up to", "sliding lost from"), strict=True):
        ax.plot(found.periods, own, line, marker=".", label=label)
    ax.set_yscale("log")
    ax.set_ylabel(axis_label("amplitude", unit))
    ax.legend(fontsize="small")


def frozen_verdicts(found: FrozenVerdicts, ax: Any = None) -> Any:
    """Plot growth rate over time, with unstable times shaded, and in a second panel the slip rate of the motion.

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
            t, 0, 1, where=found.growth_rate > 0, transform=one.get_xaxis_transform(), zorder=0,
            **AREAS[UNSTABLE][1],
        )  # fmt: skip
        held = one.fill_between(
            t, 0, 1, where=~np.isfinite(found.growth_rate), transform=one.get_xaxis_transform(), zorder=0,
            **AREAS[ABSENT][1],
        )  # fmt: skip
    unstable.set_label("steady sliding is unstable")
    if not np.all(np.isfinite(found.growth_rate)):
        held.set_label(AREAS[ABSENT][0])
    fastest = max(float(np.max(np.abs(own))) for own in found.slip_rates.values())
    speed, speed_unit = display_unit("m/s", fastest or 1.0)
    for (name, own), colour in zip(found.slip_rates.items(), cycle((BLUE, GREEN, ORANGE)), strict=False):
        axes[1].plot(found.run["t"] / factor, np.abs(own) / speed, color=colour, label=name or "slip rate")
    if np.isfinite(found.departure):
        axes[1].axvline(found.departure / factor, color=BLACK, linestyle="--", linewidth=1, label="motion departs")
    axes[1].set_yscale("log")
    axes[0].set_ylabel("growth rate (1/s)")
    axes[1].set_ylabel(axis_label("slip rate", speed_unit))
    axes[1].set_xlabel(axis_label("time", unit))
    add_legend_above(axes[1], 4, 1.0, fontsize="small")
    return axes
