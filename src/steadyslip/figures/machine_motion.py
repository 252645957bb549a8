"""Simulated motion of machines: what every contact does in time, in the units of its user."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.format import format_quantity
from steadyslip.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    arrows,
    axes_or_new,
    display_unit,
    labelled,
)
from steadyslip.machine.machine import Machine
from steadyslip.model.sliding import steady_contact_at
from steadyslip.motion.events import ContactSlip
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import LOAD_POINT

if TYPE_CHECKING:
    from steadyslip.motion import History

_CONTACTS = (BLUE, ORANGE, GREEN, PURPLE, SKY, BLACK)  # told apart where lines cross
_SPANS = 40  # slip events are shaded only if they are fewer than this
_LEAST_BAND = 4e-3  # share of the time shown: shorter slip events are drawn so wide, to be seen at all
_STEADY = 1e-3  # of the size of a velocity: changes below are drawn as none
_WIDE = 3.0  # highest over lowest slip rate beyond which they are drawn by their logarithm
_SLOWEST = 1e-3  # of the highest slip rate is where the line of steady states begins
_FASTEST = 1e12  # times as fast as in steady sliding is out of the picture


def history(run: History, panels: np.ndarray) -> np.ndarray:
    """Slip rate, friction and normal force of every contact, one panel each; slip events in the contact's colour."""
    names = list(run.rig.contacts)  # type: ignore[union-attr]
    colors = {name: _CONTACTS[i % len(_CONTACTS)] for i, name in enumerate(names)}
    factor, unit = display_unit("s", float(run.end) or 1.0)
    time = run["t"] / factor
    series = (("slip_rate", "m/s", "slip rate"), ("friction", "", "friction"), ("normal_force", "N", "normal force"))
    for panel, (what, si, label) in zip(panels, series, strict=True):
        values = {name: run[f"{name}.{what}"] for name in names}
        largest = max(float(np.nanmax(np.abs(own), initial=0.0)) for own in values.values()) or 1.0
        scale, own_unit = display_unit(si, largest) if si else (1.0, "1")
        positive = all(np.all(own > 0) for own in values.values())
        if what == "slip_rate" and positive and largest > 30 * min(float(own.min()) for own in values.values()):
            panel.set_yscale("log")
        for name in names:
            panel.plot(time, values[name] / scale, color=colors[name], linewidth=1, label=name)
        panel.set_ylabel(labelled(label, own_unit))
        _plain(panel, largest / scale)
        panel.grid(color=GREY, linewidth=0.3)
    let_go(run, panels, factor)
    _shade(run, panels, colors, factor)
    panels[-1].set_xlabel(labelled("time", unit))
    panels[0].legend(
        loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4, frameon=False, fontsize="small", borderaxespad=0.2
    )
    if run.status != "done":
        where = f" ({run.contact})" if run.contact else ""
        title = f"{run.status}{where} at {format_quantity(run.end, 's')}"
        panels[0].set_title(title, color=VERMILION, fontsize="medium", pad=22)
    return panels


def phase_plane(
    run: History, rig: Machine, ax: Axes | None, label: str, color: str, contact: str | None
) -> Axes:  # fmt: skip
    """Friction force against slip rate at a contact, with the line of steady states and a dot at the last.

    Slip rates are drawn by their logarithm where they span more than a factor of three and never turn round.
    """
    name = contact or _moving_most(run, rig)
    ax, rate, force = axes_or_new(ax), run[f"{name}.slip_rate"], run[f"{name}.friction_force"]
    steady = steady_contact_at(rig, name, np.array([rig.drive.velocity]))
    own = abs(float(steady["slip_rate"][0]))
    scale, unit = display_unit("m/s", own)
    factor, force_unit = display_unit("N", float(np.nanmax(np.abs(force), initial=0.0)) or 1.0)
    shown_rate = np.where(np.abs(rate) < own * _FASTEST, rate, np.nan) / scale  # a blow-up leaves the picture
    ax.plot(shown_rate, force / factor, color=color, label=label or None, linewidth=1)
    low, high = float(np.nanmin(shown_rate)), float(np.nanmax(shown_rate))
    logarithmic = low > 0 and high > _WIDE * low
    if ax.get_xlabel():  # beside another run, on its axes
        arrows(ax, shown_rate, force / factor, color)
        return ax
    if logarithmic:
        ax.set_xscale("log")
    if abs(high - low) < _STEADY * max(abs(high), abs(low)):
        ax.set_xlim(*sorted((0.9 * low, 1.1 * high)))  # change that is only rounding is drawn as none
    else:
        arrows(ax, shown_rate, force / factor, color)
    beside = shown_rate * scale / steady["slip_rate"][0]
    fastest = max(float(np.nanmax(beside)), 1.0)
    slowest = min(max(float(np.nanmin(beside)), _SLOWEST * fastest), 1.0)
    speeds = rig.drive.velocity * np.geomspace(0.9 * slowest, 1.1 * fastest, 81)
    line = steady_contact_at(rig, name, speeds)
    pressed = any(piece.channel != LOAD_POINT for piece in Protocol.of(run.protocol).pieces)
    words = "steady states without what else is done" if pressed else "steady states"
    ax.plot(line["slip_rate"] / scale, line["friction_force"] / factor, color=BLACK, linewidth=1, label=words)
    if not pressed and (last := float(run["load_velocity"][-1])) > 0:
        dot = steady_contact_at(rig, name, np.array([last]))
        ax.plot(dot["slip_rate"] / scale, dot["friction_force"] / factor, "o", color=BLACK, markersize=4,
                label="_steady sliding")  # fmt: skip
    ax.set_xlabel(labelled(f"slip rate at {name}", unit))
    ax.set_ylabel(labelled(f"friction force at {name}", force_unit))
    ax.grid(color=GREY, linewidth=0.3)
    ax.legend(fontsize="small")
    return ax


def _moving_most(run: History, rig: Machine) -> str:
    """The contact whose slip rate goes through most, beside that of steady sliding; the first of equals."""

    def passed(name: str) -> float:
        steady = steady_contact_at(rig, name, np.array([rig.drive.velocity]))["slip_rate"][0]
        change = np.ptp(np.arcsinh(run[f"{name}.slip_rate"] / steady))
        return round(float(np.nan_to_num(change)), 6)

    return str(max(rig.contacts, key=passed))


def _plain(panel: Axes, size: float) -> None:
    """Ticks written out, and no change that is only rounding."""
    if panel.get_yscale() != "linear":
        return
    panel.ticklabel_format(axis="y", useOffset=False)
    low, high = panel.get_ylim()
    if high - low < _STEADY * size:
        middle = 0.5 * (low + high)
        panel.set_ylim(middle - 0.5 * _STEADY * size, middle + 0.5 * _STEADY * size)


def let_go(run: History, panels: np.ndarray, factor: float) -> None:
    """Shade the times in which the drive pulls with a force of its own, where it moves in others."""
    if "creep" not in run.data or not len(run["t"]):
        return
    free = np.concatenate([[False], run["creep"] > 0, [False]])
    edges = np.flatnonzero(free[1:] != free[:-1])
    time = np.append(run["t"], run["t"][-1]) / factor
    for first, behind in edges.reshape(-1, 2):
        for panel in panels:
            panel.axvspan(time[first], time[behind], color=GREY, alpha=0.2, linewidth=0)
    panels[0].fill_between([], [], color=GREY, alpha=0.3, linewidth=0, label="drive let go")


def _shade(run: History, panels: np.ndarray, colors: dict[str, Any], factor: float) -> None:
    slips = [one for one in run.slip_events if isinstance(one, ContactSlip)]
    narrowest = _LEAST_BAND * run.end
    for panel in panels:
        for one in slips if len(slips) < _SPANS else ():
            wider = max(0.5 * (narrowest - one.duration), 0.0)
            begin, end = (one.begin - wider) / factor, (one.end + wider) / factor
            panel.axvspan(begin, end, color=colors[one.contact], alpha=0.12, linewidth=0)
        if run.status != "done":
            panel.axvline(run.end / factor, color=VERMILION, linewidth=1, linestyle="--")
    if slips:
        shaded = "shaded" if len(slips) < _SPANS else "too many to shade"
        panels[0].plot([], [], " ", color=BLACK, label=f"{len(slips)} slip events ({shaded})")
