"""Dimensionless masses and critical stiffnesses of Fig. 7 of Dupont & Bapna (1994), from the Model of the rig."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.laws.contact import InclinedSpring
from steadyslip.linear import critical_stiffness
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point

_MAX_MASS = 1e6  # highest m* searched: a limit above it counts as none
_MIN_MASS = 1e-12  # lowest m* searched: stands for a quasistatic rig
_CROSSING_TOLERANCE = 1e-6  # largest relative spread of the curves of all angles that counts as one crossing point


def dimensionless_critical_stiffness(rig: Slider, angles: Any, m_star: Any) -> Any:
    """κ_cr = k_cr d_c/σss at spring angles (rad) and dimensionless masses m* = m v0²/(σss d_c), which broadcast.

    NaN where no stiffness is an edge, and for angles past lock-up. σss depends on the angle where the rig
    gives its preload, so the same m* is another mass at every angle.

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
    """m (kg/m²) of dimensionless masses m* at spring angles (rad), which broadcast; NaN past lock-up."""
    return m_star * _steady_stress(rig, angles) * slip_distance(rig) / rig.drive.velocity**2


def is_locked(rig: Slider, angles: Any) -> Any:
    """True where a spring at these angles (rad) leaves no steady sliding."""
    return np.isnan(_steady_stress(rig, angles))


def _steady_stress(rig: Slider, angles: Any) -> Any:
    # broadcast because a rig that gives σss itself has one value for all angles short of lock-up
    return np.broadcast_to(operating_point(rig, {"contact.angle": angles}).sigma, np.shape(angles))


def slip_distance(rig: Slider) -> float:
    """d_c (m) of an inclined-spring rig, of the first state where friction has several."""
    if not isinstance(rig.contact, InclinedSpring):
        raise NotAvailable(
            f"the contact is {rig.contact.name!r}, which has no spring angle to vary; allowed: inclined-spring"
        )
    for name in rig.of_kind("slip distance"):
        return float(rig.value(name) or 0.0)
    raise NotAvailable(f"the friction law {rig.friction.name!r} has no slip distance to scale with")


def mass_of_equal_stiffness(rig: Slider, angles: Iterable[float]) -> float:
    """m*_cr1: the mass at which κ_cr is the same at all these angles (rad); NaN if there is none.

    Angles past lock-up do not count. Found as a crossing of the general curves; the paper's eq. 30 is a check.
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
    """m*_cr2: the mass from which on no stiffness is stable at this angle (rad); NaN if there is none.

    The mass at which the critical stiffness ceases to exist, narrowed to rounding; eq. 31 is a check.
    """

    def exists(m_star: Any) -> Any:
        return np.isfinite(dimensionless_critical_stiffness(rig, angle, m_star))

    low, high = _MIN_MASS, _MAX_MASS
    if not exists(low) or exists(high):
        return math.nan
    for _ in range(16):  # each divides the logarithmic bracket by 32: 18 decades to far below rounding
        samples = np.geomspace(low, high, 33)
        first = int(np.argmin(exists(samples)))
        low, high = samples[first - 1], samples[first]
    return float(0.5 * (low + high))
