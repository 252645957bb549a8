"""Critical stiffness against mass for several spring angles: Fig. 7 of Dupont & Bapna (1994), from the rig's Model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.palette import BLACK, CURVES, LINES
from steadyslip.figures.style import axes_or_new, axis_label
from steadyslip.laws.contact import InclinedSpring
from steadyslip.linear import boundary, critical_stiffness
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.units import deg

ANGLES = tuple(degrees * deg for degrees in (-45, -30, 0, 30, 45))  # rad, as in the paper
_MAX_MASS = 1e6  # highest m* searched; a higher limit counts as no limit
_MIN_MASS = 1e-12  # lowest m* searched, which stands for a quasistatic rig
_CROSSING_TOLERANCE = 1e-6  # largest relative spread of the curves of all angles that counts as one crossing point


@checked()
def critical_stiffness_against_mass(
    rig: Slider, angles: Sequence[float] | None = None, m_star: Any = None, ax: Axes | None = None
) -> Axes:
    """Dimensionless critical stiffness against dimensionless mass, one curve for each spring angle.

    The paper's Fig. 7, computed from the general equations, for any friction with a slip distance. Steady sliding is
    stable above a curve. Circle: m*_cr1, at which the angle has no effect (eq. 30); dotted lines: m*_cr2, above which
    no stiffness is stable (eq. 31).

    Parameters
    ----------
    rig : Slider
        Rig with an inclined spring; its own angle and mass are not used.
    angles : sequence of float, optional
        Spring angles (rad); −45, −30, 0, 30, 45 degrees by default. Angles at which the rig locks up are in the legend
        only.
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
    slip_distance(rig)  # raises NotAvailable before anything is drawn
    angles = ANGLES if angles is None else [float(angle) for angle in angles]
    m_star = np.geomspace(1e-4, 0.2, 600) if m_star is None else np.unique(np.asarray(m_star, float))
    if m_star.size < 2 or not np.all(m_star > 0):
        raise ParameterError([Problem("m_star", f"got {m_star!r}; allowed: two or more different numbers > 0")])
    kappa = dimensionless_critical_stiffness(rig, np.array(angles)[:, None], m_star[None, :])
    locked = is_locked(rig, np.array(angles))

    ax = axes_or_new(ax)
    for i, (angle, curve) in enumerate(zip(angles, kappa, strict=True)):
        style: dict[str, Any] = {"color": CURVES[i % len(CURVES)], "linestyle": LINES[i // len(CURVES) % len(LINES)]}
        name = f"ψ = {angle / deg:.4g}°".replace("-", "−")
        if locked[i]:
            ax.plot([], [], label=f"{name}: locked up", **style)
            continue
        ax.plot(m_star, curve, label=name, **style)
        limit = mass_of_no_stiffness(rig, angle)
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
    crossing = mass_of_equal_stiffness(rig, angles)
    if not m_star.min() < crossing < m_star.max():
        return
    kappa = float(np.nanmean(dimensionless_critical_stiffness(rig, np.array(angles), crossing)))
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


def dimensionless_critical_stiffness(rig: Slider, angles: Any, m_star: Any) -> Any:
    """κ_cr = k_cr d_c/σss at spring angles (rad) and dimensionless masses m* = m v0²/(σss d_c), which broadcast.

    NaN without a critical stiffness, and for angles past lock-up. If the rig has a preload, σss depends on the angle,
    so that one m* is a different mass at each angle.

    Raises
    ------
    NotAvailable
        If the contact is not an inclined spring, or friction has no slip distance.
    """
    angles, m_star = np.broadcast_arrays(np.asarray(angles, float), np.asarray(m_star, float))
    mass = mass_at(rig, angles, m_star)
    heavy = {"contact.angle": angles, "slider.mass": np.where(np.isnan(mass), 0.0, mass)}
    return critical_stiffness(rig, heavy) * slip_distance(rig) / _steady_stress(rig, angles)


def mass_at(rig: Slider, angles: Any, m_star: Any) -> Any:
    """Masses (kg/m²) for dimensionless masses m* at spring angles (rad), which broadcast; NaN past lock-up."""
    return m_star * _steady_stress(rig, angles) * slip_distance(rig) / rig.drive.velocity**2


def is_locked(rig: Slider, angles: Any) -> Any:
    """Mask of spring angles (rad) at which no steady sliding exists (lock-up)."""
    return np.isnan(_steady_stress(rig, angles))


def _steady_stress(rig: Slider, angles: Any) -> Any:
    # broadcast: a rig with a given σss has one value for all angles short of lock-up
    return np.broadcast_to(operating_point(rig, {"contact.angle": angles}).sigma, np.shape(angles))


def slip_distance(rig: Slider) -> float:
    """Slip distance d_c (m) of a rig with an inclined spring; that of the first state if friction has several."""
    if not isinstance(rig.contact, InclinedSpring):
        raise NotAvailable(
            f"the contact is {rig.contact.name!r}, which has no spring angle to vary; allowed: inclined-spring"
        )
    for name in rig.of_kind("slip distance"):
        return float(rig.value(name) or 0.0)
    raise NotAvailable(f"the friction law {rig.friction.name!r} has no slip distance to scale with")


def mass_of_equal_stiffness(rig: Slider, angles: Iterable[float]) -> float:
    """Dimensionless mass m*_cr1 at which κ_cr is equal at all `angles` (rad); NaN if there is none.

    Angles past lock-up are ignored. Found as the crossing of the general curves, independently of the paper's eq. 30.
    """
    from scipy.optimize import brentq

    angles = np.unique(np.asarray(list(angles), float))
    open_angles = angles[np.isfinite(dimensionless_critical_stiffness(rig, angles, 0.0))]
    if len(open_angles) < 2:
        return math.nan

    def spread(m_star: Any) -> Any:
        ends = dimensionless_critical_stiffness(rig, open_angles[[0, -1]], np.asarray(m_star)[..., None])
        return ends[..., 0] - ends[..., 1]

    grid = np.geomspace(_MIN_MASS, _MAX_MASS, 721)
    value = spread(grid)
    with np.errstate(invalid="ignore"):
        at = np.flatnonzero(value[:-1] * value[1:] < 0)
    for i in at:
        crossing = float(brentq(lambda m: float(spread(m)), grid[i], grid[i + 1], xtol=1e-300, rtol=1e-15))
        kappa = dimensionless_critical_stiffness(rig, open_angles, crossing)
        if np.ptp(kappa) <= _CROSSING_TOLERANCE * np.abs(kappa).max():
            return crossing
    return math.nan


def mass_of_no_stiffness(rig: Slider, angle: float) -> float:
    """Dimensionless mass m*_cr2 above which no stiffness is stable at an angle (rad); NaN if there is none.

    Found as the mass at which the critical stiffness ceases to exist, independently of the paper's eq. 31.
    """

    def exists(m_star: Any) -> Any:
        return np.isfinite(dimensionless_critical_stiffness(rig, angle, m_star))

    low, high = _MIN_MASS, _MAX_MASS
    if not exists(low) or exists(high):
        return math.nan
    for _ in range(16):  # each round divides the logarithmic bracket by 32: from 18 decades to far below rounding
        samples = np.geomspace(low, high, 33)
        first = int(np.argmin(exists(samples)))
        low, high = samples[first - 1], samples[first]
    return float(0.5 * (low + high))
