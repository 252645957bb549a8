"""Critical stiffness against mass for several spring angles: Fig. 7 of Dupont & Bapna (1994)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.palette import BLACK, CURVES, LINES
from steadyslip.figures import mass
from steadyslip.figures.style import axes_or_new, axis_label
from steadyslip.linear import boundary
from steadyslip.machine.slider import Slider
from steadyslip.units import deg

ANGLES = tuple(degrees * deg for degrees in (-45, -30, 0, 30, 45))  # those of the paper


def critical_stiffness_against_mass(
    rig: Slider, angles: Sequence[float] | None = None, m_star: Any = None, ax: Axes | None = None
) -> Axes:
    """Dimensionless critical stiffness against dimensionless mass, one curve for each spring angle.

    The paper's Fig. 7, by the general route and for any friction with a slip distance. Steady sliding is
    stable above a curve. Circle: m*_cr1, where the angle makes no difference (eq. 30); dotted lines: m*_cr2,
    from which on no stiffness is stable (eq. 31).

    Parameters
    ----------
    rig : Slider
        With an inclined spring; its own angle and mass do not matter.
    angles : sequence of float, optional
        Spring angles (rad); −45, −30, 0, 30, 45 degrees by default. Locked-up ones appear in the legend only.
    m_star : array_like, optional
        Dimensionless masses m* = m v0²/(σss d_c), positive.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NotAvailable
        If the contact is not an inclined spring, or friction has no slip distance.
    ParameterError
        If an angle is outside ±90 degrees or a mass is not positive.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> axes = ss.figures.critical_stiffness_against_mass(rig, angles=[0], m_star=[1e-3, 1e-2])
    >>> axes.figure.savefig("critical-stiffness-against-mass.svg")
    """
    mass.slip_distance(rig)  # raises NotAvailable before anything is drawn
    angles = ANGLES if angles is None else [float(angle) for angle in angles]
    m_star = np.geomspace(1e-4, 0.2, 600) if m_star is None else np.unique(np.asarray(m_star, float))
    if m_star.size < 2 or not np.all(m_star > 0):
        raise ParameterError([Problem("m_star", f"got {m_star!r}; allowed: two or more different numbers > 0")])
    kappa = mass.dimensionless_critical_stiffness(rig, np.array(angles)[:, None], m_star[None, :])
    locked = mass.is_locked(rig, np.array(angles))

    ax = axes_or_new(ax)
    for i, (angle, curve) in enumerate(zip(angles, kappa, strict=True)):
        style: dict[str, Any] = {"color": CURVES[i % len(CURVES)], "linestyle": LINES[i // len(CURVES) % len(LINES)]}
        name = f"ψ = {angle / deg:.4g}°".replace("-", "−")
        if locked[i]:
            ax.plot([], [], label=f"{name}: locked up", **style)
            continue
        ax.plot(m_star, curve, label=name, **style)
        limit = mass.mass_of_no_stiffness(rig, angle)
        if m_star.min() < limit < m_star.max():
            ax.axvline(limit, color=style["color"], linestyle=":", linewidth=1.2, label="_m*_cr2")
            _vertical_text(ax, limit, f"$m_{{*cr2}}$, {angle / deg:.4g}°", style["color"])
    ax.set(xscale="log", yscale="log", xlim=(m_star.min(), m_star.max()))
    ax.set_xlabel("dimensionless mass $m_* = m v_0^2 / (σ_{ss} d_c)$ (1)")
    ax.set_ylabel("dimensionless critical stiffness\n$κ_{cr} = k_{cr} d_c / σ_{ss}$ (1)")
    _limit_height(ax, kappa)
    _mark_crossing(ax, rig, angles, m_star)
    ax.legend(loc="upper left", title=_lock_up_note(rig), title_fontsize="small", frameon=False, alignment="left")
    return ax


def _vertical_text(ax: Axes, x: float, text: str, colour: str) -> None:
    """Write text along the vertical line at `x`, near the bottom of the axes, below the curves."""
    ax.annotate(
        text,
        (x, 0.03),
        xycoords=ax.get_xaxis_transform(),
        xytext=(-2, 0),
        textcoords="offset points",
        rotation=90,
        ha="right",
        va="bottom",
        color=colour,
        fontsize="small",
    )


def _limit_height(ax: Axes, kappa: Any) -> None:
    """Cut the y axis at 100 times the lowest value: the curves rise to infinity at m*_cr2."""
    present = kappa[np.isfinite(kappa)]
    if present.size:
        ax.set_ylim(present.min() / 2.5, present.min() * 100)


def _mark_crossing(ax: Axes, rig: Slider, angles: Sequence[float], m_star: Any) -> None:
    crossing = mass.mass_of_equal_stiffness(rig, angles)
    if not m_star.min() < crossing < m_star.max():
        return
    kappa = float(np.nanmean(mass.dimensionless_critical_stiffness(rig, np.array(angles), crossing)))
    ax.plot(crossing, kappa, "o", color=BLACK, markerfacecolor="white", zorder=3, label="_m*_cr1")
    ax.annotate(
        f"$m_{{*cr1}}$ = {crossing:.4g}", (crossing, kappa), xytext=(0, -26), textcoords="offset points", ha="center"
    )


def _lock_up_note(rig: Slider) -> str:
    edges = [e for e in boundary(rig, "contact.angle") if e.kind == "lock-up"]
    if not edges:
        return axis_label("spring angle", "deg")
    value = f"{edges[0].value / deg:.3f}°".replace("-", "−")
    return f"spring angle (lock-up at ψ ≤ {value})"
