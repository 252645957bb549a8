"""Figures of simulated motion of machines: histories of contacts, and friction force against slip rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba

from steadyslip.core.format import format_quantity
from steadyslip.core.palette import BLACK, BLOW_UP, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION
from steadyslip.figures.style import (
    add_arrowheads,
    add_legend_above,
    add_title_above_legend,
    axes_or_new,
    axis_label,
    display_unit,
    plain_log_ticks,
)
from steadyslip.machine.machine import Machine
from steadyslip.model.sliding import steady_contact_at
from steadyslip.motion.events import ContactSlip
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import LOAD_POINT

if TYPE_CHECKING:
    from steadyslip.motion import History

_CONTACTS = (BLUE, ORANGE, GREEN, PURPLE, SKY, BLACK)  # line colours, in the order of the contacts
MAX_SHADED_EVENTS = 40  # slip events are shaded only if fewer than this: more would merge (by trial)
MIN_BAND_SHARE = 4e-3  # least width of a shaded slip event, as share of the time axis: about two pixels
_MIN_SPAN = 1e-3  # least span of an axis over its largest value, so that rounding errors are not magnified (by trial)
# In runs that lose contact, share of the largest normal force below which friction does not set its axis: a ratio of
# two vanishing forces grows without bound, and would press all else into a line.
_PRESSED = 0.1
_LOG_RATIO = 3.0  # the axis of slip rates is logarithmic if highest over lowest slip rate is larger (by trial)
_MIN_STEADY_RATIO = 1e-3  # the line of steady states begins at this share of the highest slip rate of the run
_SHADE = 0.4  # opacity of shading: differs from white by 10 of 100 in lightness, and curves stay visible (by trial)
# Slip rate over the steady one beyond which a run that ends early is not drawn: there effects decide that the model
# leaves out, such as mass.
LEAVES = 1e4


def history(run: History, panels: np.ndarray) -> np.ndarray:
    """Plot slip rate, friction and, if a third panel is given, normal force of every contact; shade slip events."""
    names = list(run.rig.contacts)
    colors = {name: _CONTACTS[i % len(_CONTACTS)] for i, name in enumerate(names)}
    factor, unit = display_unit("s", float(run.end) or 1.0)
    time = run["t"] / factor
    left = np.any([leaves(run, run[f"{name}.slip_rate"], steady_rate(run.rig, name)) for name in names], axis=0)
    series = (("slip_rate", "m/s", "slip rate"), ("friction", "", "friction"), ("normal_force", "N", "normal force"))
    for panel, (what, si, label) in zip(panels, series, strict=False):
        values = {name: np.where(left, np.nan, run[f"{name}.{what}"]) for name in names}
        largest = max(float(np.nanmax(np.abs(own), initial=0.0)) for own in values.values()) or 1.0
        scale, own_unit = display_unit(si, largest) if si else (1.0, "1")
        positive = all(np.all(own[~left] > 0) for own in values.values())
        if what == "slip_rate" and positive and largest > 30 * min(float(np.nanmin(own)) for own in values.values()):
            panel.set_yscale("log")
        for name in names:
            panel.plot(time, values[name] / scale, color=colors[name], linewidth=1, label=name)
        panel.set_ylabel(axis_label(label, own_unit))
        if what == "friction":
            limit_friction(run, panel, [(values[name], run[f"{name}.normal_force"]) for name in names])
        _limit_zoom(panel, largest / scale)
        panel.grid(color=GREY, linewidth=0.3)
    shade_let_go(run, panels, factor)
    _shade_slip_events(run, panels, colors, factor)
    panels[-1].set_xlabel(axis_label("time", unit))
    add_legend_above(panels[0], 4, 1.0, fontsize="small")
    if run.status != "done":
        add_title_above_legend(panels[0], end_title(run, left), VERMILION)
    return panels


def phase_plane(
    run: History, rig: Machine, ax: Axes | None, label: str, color: str, contact: str | None
) -> Axes:  # fmt: skip
    """Plot friction force against slip rate at a contact, with the line of steady states.

    A dot marks the steady state for the velocity of the drive at the end.

    The slip-rate axis is logarithmic if slip rates are positive and span more than a factor of three.
    """
    name = contact or _most_varying_contact(run, rig)
    ax, rate, force = axes_or_new(ax), run[f"{name}.slip_rate"], run[f"{name}.friction_force"]
    own = steady_rate(rig, name)
    scale, unit = display_unit("m/s", abs(own))
    factor, force_unit = display_unit("N", float(np.nanmax(np.abs(force), initial=0.0)) or 1.0)
    left = leaves(run, rate, own)
    shown_rate = np.where(left, np.nan, rate) / scale  # NaN is not drawn
    ax.plot(shown_rate, force / factor, color=color, label=label or "the run", linewidth=1)
    mark_end(run, ax, shown_rate, force / factor, left)
    low, high = float(np.nanmin(shown_rate)), float(np.nanmax(shown_rate))
    logarithmic = low > 0 and high > _LOG_RATIO * low
    if ax.get_xlabel():  # the Axes already show another run: keep their scales and labels
        add_arrowheads(ax, shown_rate, force / factor, color)
        add_legend_above(ax, 3, 1.0, fontsize="small")
        return ax
    if logarithmic:
        ax.set_xscale("log")
        if high < 100 * low:  # for less than two decades, ticks have plain numbers
            plain_log_ticks(ax.xaxis)
    if abs(high - low) < _MIN_SPAN * max(abs(high), abs(low)):
        ax.set_xlim(*sorted((0.9 * low, 1.1 * high)))  # otherwise rounding would fill the panel
    else:
        add_arrowheads(ax, shown_rate, force / factor, color)
    beside = shown_rate * scale / own
    fastest = max(float(np.nanmax(beside)), 1.0)
    slowest = min(max(float(np.nanmin(beside)), _MIN_STEADY_RATIO * fastest), 1.0)
    speeds = rig.drive.velocity * np.geomspace(0.9 * slowest, 1.1 * fastest, 81)
    line = steady_contact_at(rig, name, speeds)
    pressed = any(piece.channel != LOAD_POINT for piece in Protocol.of(run.protocol).pieces)
    words = "steady states without what else is done" if pressed else "steady states"
    ax.plot(line["slip_rate"] / scale, line["friction_force"] / factor, color=BLACK, linewidth=1, label=words)
    if not pressed and (last := float(run["load_velocity"][-1])) > 0:
        dot = steady_contact_at(rig, name, np.array([last]))
        ax.plot(dot["slip_rate"] / scale, dot["friction_force"] / factor, "o", color=BLACK, markersize=4,
                label="steady sliding of the last drive")  # fmt: skip
    ax.set_xlabel(axis_label(f"slip rate at {name}", unit))
    ax.set_ylabel(axis_label(f"friction force at {name}", force_unit))
    ax.grid(color=GREY, linewidth=0.3)
    add_legend_above(ax, 3, 1.0, fontsize="small")
    return ax


def limit_friction(run: History, ax: Axes, pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
    """Limit the friction axis of a run that loses contact to samples with more than `_PRESSED` of the largest load.

    `pairs` are friction and normal force (or stress), each (n,), of every contact.
    """
    kept = np.concatenate([own[(load >= _PRESSED * np.max(load)) & np.isfinite(own)] for own, load in pairs])
    if run.status == "contact lost" and len(kept) and np.ptp(kept):
        margin = rcParams["axes.ymargin"] * float(np.ptp(kept))
        ax.set_ylim(float(kept.min()) - margin, float(kept.max()) + margin)


def steady_rate(rig: Any, name: str) -> float:
    """Slip rate of a contact in steady sliding (m/s)."""
    return float(steady_contact_at(rig, name, np.array([rig.drive.velocity]))["slip_rate"][0])


def leaves(run: History, rates: np.ndarray, steady: float) -> np.ndarray:
    """Mask of the samples not drawn: in a run that ends early those above `LEAVES` times the `steady` rate (m/s)."""
    return np.asarray((run.status != "done") & (np.abs(rates) > LEAVES * abs(steady)))


def end_title(run: History, left: np.ndarray) -> str:
    """Title of a run that ended early: how, where, when, and the limit of the drawing if samples are `left` out."""
    how = "simulated" if run.status == "too many steps" else run.status
    where = f" ({run.contact})" if run.contact else ""
    limit = f",\ndrawn up to {LEAVES:.0f} times the steady velocity" if np.any(left) else ""
    until = "to" if how == "simulated" else "at"
    return f"{how}{where} {until} {format_quantity(run.end, 's')}{limit}"


def mark_end(run: History, ax: Axes, x: np.ndarray, y: np.ndarray, left: np.ndarray) -> None:
    """Mark the last drawn point of a run that ended early; the legend has how and when it ended."""
    drawn = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if run.status != "done" and len(drawn):
        at = x[drawn[-1:]], y[drawn[-1:]]
        ax.plot(*at, "X", color=BLOW_UP, markersize=8, markeredgecolor="white", zorder=5, label=end_title(run, left))


def shading(color: str) -> dict[str, Any]:
    """Style of shaded slip events; with an outline, since pale shading may not differ from the background in grey."""
    return {"facecolor": to_rgba(color, _SHADE), "edgecolor": to_rgba(color, 1.0), "linewidth": 0.6}


def _most_varying_contact(run: History, rig: Machine) -> str:
    """Name of the contact whose arcsinh(slip rate / steady slip rate) has the largest range; of ties the first."""

    def span(name: str) -> float:
        steady = steady_contact_at(rig, name, np.array([rig.drive.velocity]))["slip_rate"][0]
        change = np.ptp(np.arcsinh(run[f"{name}.slip_rate"] / steady))
        return round(float(np.nan_to_num(change)), 6)

    return str(max(rig.contacts, key=span))


def _limit_zoom(panel: Axes, size: float) -> None:
    """Keep a linear y axis at least `_MIN_SPAN` times `size` high, so that rounding stays small; no tick offset."""
    if panel.get_yscale() != "linear":
        return
    panel.ticklabel_format(axis="y", useOffset=False)
    low, high = panel.get_ylim()
    if high - low < _MIN_SPAN * size:
        middle = 0.5 * (low + high)
        panel.set_ylim(middle - 0.5 * _MIN_SPAN * size, middle + 0.5 * _MIN_SPAN * size)


def shade_let_go(run: History, panels: np.ndarray, factor: float) -> None:
    """Shade the times at which the load point is released and moves freely; `factor` is the unit of time in s."""
    if "creep" not in run.data or not len(run["t"]):
        return
    free = np.concatenate([[False], run["creep"] > 0, [False]])
    edges = np.flatnonzero(free[1:] != free[:-1])
    time = np.append(run["t"], run["t"][-1]) / factor
    for first, behind in edges.reshape(-1, 2):
        for panel in panels:
            panel.axvspan(time[first], time[behind], color=GREY, alpha=0.2, linewidth=0)
    panels[0].fill_between([], [], color=GREY, alpha=0.3, linewidth=0, label="drive let go")


def _shade_slip_events(run: History, panels: np.ndarray, colors: dict[str, Any], factor: float) -> None:
    slips = [one for one in run.slip_events if isinstance(one, ContactSlip)]
    narrowest = MIN_BAND_SHARE * run.end
    for panel in panels:
        for one in slips if len(slips) < MAX_SHADED_EVENTS else ():
            wider = max(0.5 * (narrowest - one.duration), 0.0)
            panel.axvspan((one.begin - wider) / factor, (one.end + wider) / factor, **shading(colors[one.contact]))
        if run.status != "done":
            panel.axvline(run.end / factor, color=VERMILION, linewidth=1, linestyle="--")
    if slips:
        shaded = "shaded" if len(slips) < MAX_SHADED_EVENTS else "too many to shade"
        panels[0].plot([], [], " ", color=BLACK, label=f"{len(slips)} slip events ({shaded})")
