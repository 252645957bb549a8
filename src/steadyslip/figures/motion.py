"""Figures of simulated motion: histories in time, and the phase plane of Figs 5 and 6 of Dupont & Bapna (1994)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.areas import stress_name
from steadyslip.core.errors import NoSteadySliding
from steadyslip.core.format import format_quantity, typeset
from steadyslip.core.palette import BLACK, BLOW_UP, BLUE, GREY, ORANGE
from steadyslip.figures import machine_motion
from steadyslip.figures.machine_motion import MAX_SHADED_EVENTS, MIN_BAND_SHARE, leaves
from steadyslip.figures.style import (
    WIDTH,
    add_arrowheads,
    add_legend_above,
    add_title_above_legend,
    axes_or_new,
    axis_label,
    display_unit,
    given_panels,
    new_panels,
    plain_log_ticks,
)
from steadyslip.kernels.layout import SLIP_EVENT
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.sliding import steady_state
from steadyslip.model.steady_results import SteadySliding
from steadyslip.motion.result import check_contact
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import NORMAL_STRESS

if TYPE_CHECKING:
    from steadyslip.motion import History

_ROUNDING = 1e-6  # a normal force is constant if its relative change is smaller: above errors of integration
_MIN_SPAN = 2e-3  # least span of an axis over its largest value, so that rounding errors are not magnified (by trial)
_STEADY_POINTS = 161  # points of the line of steady states: a bend over a decade is smooth in a figure 160 mm wide


def history(run: History, ax: Sequence[Axes] | None = None) -> np.ndarray:
    """Plot velocity, friction and normal stress over time in three panels; for machines for every contact.

    A constant normal stress has no panel: its value is the title of the friction panel.

    Parameters
    ----------
    run : History
    ax : three matplotlib Axes, optional
        New Axes by default.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        Two or three; `ax` itself if given.

    Raises
    ------
    ParameterError
        If `ax` is not three Axes.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> run = ss.simulate(rig, until=10)
    >>> axes = ss.figures.history(run)
    >>> axes[0].figure.savefig("history.svg")
    """
    given = None if ax is None else given_panels(ax, (3,), "a sequence of three")
    pressed = _constant_load(run) if given is None else ""
    rows = 2 if pressed else 3
    panels = new_panels(rows, 1, (WIDTH, WIDTH * (rows + 1) / 4), sharex=True)[:, 0] if given is None else given
    if pressed:
        panels[1].set_title(pressed, loc="left", fontsize="small")
    if isinstance(run.rig, Machine):
        return machine_motion.history(run, panels)
    area = run.rig.area
    factor, unit = display_unit("s", float(run.end) or 1.0)
    time = run["t"] / factor
    left = leaves(run, run["v"], run.rig.drive.velocity)
    v, friction, normal = (np.where(left, np.nan, run[name]) for name in ("v", "friction", "normal_stress"))
    _velocity_panel(run, v, panels[0], time)
    panels[1].plot(time, friction, color=BLUE)
    panels[1].set_ylabel("friction τ/σ (1)")
    machine_motion.limit_friction(run, panels[1], [(friction, run["normal_stress"])])
    _limit_zoom(panels[1], friction)
    if not pressed:
        stress_factor, stress_unit = display_unit("Pa", float(np.nanmax(np.abs(normal), initial=1.0)), area)
        panels[2].plot(time, normal / stress_factor, color=BLUE)
        panels[2].set_ylabel(axis_label(stress_name("normal stress", area), stress_unit))
        _limit_zoom(panels[2], normal / stress_factor)
    panels[-1].set_xlabel(axis_label("time", unit))
    machine_motion.shade_let_go(run, panels, factor)
    slips = run.slip_events if len(run.slip_events) < MAX_SHADED_EVENTS else ()
    _add_slip_legend(panels[0], len(run.slip_events))
    narrowest = MIN_BAND_SHARE * run.end
    for panel in panels:
        panel.grid(color=GREY, linewidth=0.3)
        for slip in slips:
            wider = max(0.5 * (narrowest - (slip.end - slip.begin)), 0.0)
            panel.axvspan((slip.begin - wider) / factor, (slip.end + wider) / factor, **machine_motion.shading(ORANGE))
        if run.status != "done":
            panel.axvline(run.end / factor, color=BLOW_UP, linewidth=1.5, linestyle="--")
    if run.status != "done":
        add_title_above_legend(panels[0], machine_motion.end_title(run, left), BLOW_UP)
    return panels


def _constant_load(run: History) -> str:
    """Text with the constant normal stress or force of every contact; empty if one of them changes."""
    rig = run.rig
    many = {name: run[f"{name}.normal_force"] for name in rig.contacts} or {"": run["normal_stress"]}
    if not all(len(one) and np.ptp(one) <= _ROUNDING * np.max(np.abs(one)) for one in many.values()):
        return ""
    unit, area = ("N", None) if rig.contacts else ("Pa", rig.area)
    texts = [typeset(format_quantity(float(one[0]), unit, area=area)) for one in many.values()]
    if len(many) > 1:
        texts = [f"{value} at {name}" for value, name in zip(texts, many, strict=True)]
    return f"constant {stress_name(rig.result_name('normal stress'), rig.area)}: {', '.join(texts)}"


def _limit_zoom(ax: Axes, *shown: np.ndarray) -> None:
    """Make the y axis span at least `_MIN_SPAN` times the largest value, so that rounding is not magnified.

    Tick labels get no offset.
    """
    values = np.concatenate([values[np.isfinite(values)] for values in shown])
    if ax.get_yscale() == "linear":
        ax.ticklabel_format(axis="y", useOffset=False)
    if not len(values):
        return
    low, high = float(values.min()), float(values.max())
    least = _MIN_SPAN * max(abs(low), abs(high))
    if high - low < least:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - (0.5 * least or 1.0), middle + (0.5 * least or 1.0))


def _add_slip_legend(ax: Axes, count: int) -> None:
    """Add the legend of the first panel, with the meaning of the shading and the number of slip events."""
    meaning = f"at least {SLIP_EVENT:g} × the load point"
    if count >= MAX_SHADED_EVENTS:
        ax.plot([], [], " ", label=f"{count} slip events ({meaning}), too many to shade")
    elif count:
        ax.fill_between([], [], **machine_motion.shading(ORANGE), label=f"slip event ({meaning})")
    add_legend_above(ax, 3, 1.0, fontsize="small")


def _velocity_panel(run: History, v: np.ndarray, ax: Axes, time: np.ndarray) -> None:
    """Plot block and load-point velocity, on a logarithmic axis if the block never rests or reverses.

    Velocities `v` (m/s, (n,)) of the block are NaN where they are not to be drawn; `time` is in the unit of the axis.
    """
    load, moves = run["load_velocity"], bool(np.all(run["v"] > 0))
    reference = "steady sliding" if Protocol.of(run.protocol).frees_load_point else "load point"
    drive = run.rig.drive.velocity
    factor, unit = display_unit("m/s", drive)
    load_shown = np.where(load > 0, load, np.nan) if moves else load
    together = np.concatenate([v[np.isfinite(v)], load_shown[np.isfinite(load_shown)]])
    if moves and _ticks_between(together.min() / factor, together.max() / factor) > 1:
        ax.set_yscale("log")
        load = load_shown
        if np.nanmax(v) < 100 * np.nanmin(v):  # for less than two decades, ticks have plain numbers
            plain_log_ticks(ax.yaxis)
    ax.plot(time, load / factor, color=BLACK, linewidth=0.8, zorder=1.5, label=reference)
    ax.plot(time, v / factor, color=BLUE, label="block")
    ax.set_ylabel(axis_label("velocity", unit))
    if ax.get_yscale() == "linear":
        _limit_zoom(ax, v / factor, load / factor)


def _ticks_between(low: float, high: float) -> int:
    """Number of ticks 1, 2, 5 times a power of ten within a range of positive numbers."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return sum(low <= digit * 10.0**decade <= high for decade in decades for digit in (1, 2, 5))


def phase_plane(
    run: History, ax: Axes | None = None, label: str = "", color: str = BLUE, contact: str | None = None
) -> Axes:
    """Plot spring stress against ln(v/v0), with the line of steady states and a dot at the last load-point velocity.

    For machines: friction force against slip rate at one contact.

    Arrows show the direction of motion. Runs drawn on the same Axes share the line of steady states of the first run.
    It is computed at the normal stress of the rig, without changes by a protocol; v0 is the velocity of the rig's
    drive.

    Parameters
    ----------
    run : History
        Motion; points at which the block rests or reverses are left out.
    ax : matplotlib.axes.Axes, optional
    label : str, optional
        Label of the run in the legend.
    color : str, optional
    contact : str, optional
        For machines: name of the contact; by default the contact whose slip rate changes most.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If there is no such contact.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> run = ss.simulate(rig, ss.protocol.VelocityStep(at="1 s", to="2 um/s"), until=100)
    >>> axes = ss.figures.phase_plane(run)
    >>> axes.figure.savefig("phase-plane.svg")
    """
    check_contact(run.rig, contact)
    if isinstance(run.rig, Machine):
        return machine_motion.phase_plane(run, run.rig, ax, label, color, contact)
    ax, area = axes_or_new(ax), run.rig.area
    drive = run.rig.drive.velocity
    moving = run["v"] > 0
    with np.errstate(all="ignore"):
        u = np.where(moving, np.log(np.where(moving, run["v"], 1.0) / drive), np.nan)
    left = leaves(run, run["v"], drive)
    u[left] = np.nan
    factor, unit = display_unit("Pa", float(np.nanmax(np.abs(run["spring_stress"]), initial=1.0)), area)
    x, y = u, np.where(np.isnan(u), np.nan, run["spring_stress"] / factor)
    ax.plot(x, y, color=color, label=label or "the run", linewidth=1)
    add_arrowheads(ax, x, y, color)
    machine_motion.mark_end(run, ax, x, y, left)
    if not ax.get_xlabel():
        _draw_steady_states(run, run.rig, ax, x, factor)
        ax.set_xlabel("ln($v/v_0$) (1)")
        ax.set_ylabel(axis_label(stress_name(f"{_puller(run.rig)} stress", area), unit))
    add_legend_above(ax, 3, 1.0, fontsize="small")
    return ax


def _puller(rig: Slider) -> str:
    """Text for what pulls the block: ``spring``, ``drive`` (a controller), or both."""
    held = rig.stiffness or rig.axial_stiffness
    if not rig.drive.proportional():
        return "spring"
    return "spring and drive" if held else "drive"


def _steady_spring_stress(rig: Slider, velocity: float) -> float:
    state = steady_state(rig.with_values({"drive.velocity": velocity}))
    return state.spring_stress if isinstance(state, SteadySliding) else math.nan


def _draw_steady_states(run: History, rig: Slider, ax: Axes, x: np.ndarray, factor: float) -> None:
    """Plot spring stress (Pa / `factor`) of steady sliding over ln(v/v0), with a dot at the last drive velocity."""
    low, high = float(np.nanmin(x)), float(np.nanmax(x))
    margin = 0.1 * (high - low) + 0.05
    steps = np.linspace(low - margin, high + margin, _STEADY_POINTS)
    bottom, top = ax.get_ylim()  # range of the motion: steady states far outside are not drawn
    beside = bottom - 0.5 * (top - bottom), top + 0.5 * (top - bottom)
    stress = []
    for u in steps:
        try:
            velocity = rig.drive.velocity * float(np.exp(u))
            stress.append(_steady_spring_stress(rig, velocity))
        except NoSteadySliding:
            stress.append(np.nan)
    pressed = any(piece.channel == NORMAL_STRESS for piece in Protocol.of(run.protocol).pieces)
    label = "steady states before the change of normal stress" if pressed else "steady states"
    drawn = np.array(stress) / factor
    drawn[(drawn < beside[0]) | (drawn > beside[1])] = np.nan
    ax.plot(steps, drawn, color=BLACK, linewidth=1, label=label)
    last = float(run["load_velocity"][-1])
    if not pressed and last > 0:
        with suppress(NoSteadySliding):
            level = _steady_spring_stress(rig, last) / factor
            u = np.log(last / rig.drive.velocity)
            ax.plot([u], [level], "o", color=BLACK, markersize=4, label="steady sliding of the last drive")
