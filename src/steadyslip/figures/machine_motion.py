"""Simulated motion of machines: what every contact does in time, in the units of its user."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.quantities import shown
from steadyslip.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, display_unit, labelled
from steadyslip.motion.events import ContactSlip

if TYPE_CHECKING:
    from steadyslip.motion import History

_CONTACTS = (BLUE, ORANGE, GREEN, PURPLE, SKY, BLACK)  # told apart where lines cross
_SPANS = 40  # slip events are shaded only if they are fewer than this
_LEAST_BAND = 4e-3  # share of the time shown: shorter slip events are drawn so wide, to be seen at all
_STEADY = 1e-3  # of the size of a velocity: changes below are drawn as none


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
    _shade(run, panels, colors, factor)
    panels[-1].set_xlabel(labelled("time", unit))
    panels[0].legend(
        loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4, frameon=False, fontsize="small", borderaxespad=0.2
    )
    if run.status != "done":
        where = f" ({run.contact})" if run.contact else ""
        title = f"{run.status}{where} at {shown(run.end, 's')}"
        panels[0].set_title(title, color=VERMILION, fontsize="medium", pad=22)
    return panels


def _plain(panel: Axes, size: float) -> None:
    """Ticks written out, and no change that is only rounding."""
    if panel.get_yscale() != "linear":
        return
    panel.ticklabel_format(axis="y", useOffset=False)
    low, high = panel.get_ylim()
    if high - low < _STEADY * size:
        middle = 0.5 * (low + high)
        panel.set_ylim(middle - 0.5 * _STEADY * size, middle + 0.5 * _STEADY * size)


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
