"""Response of a servo to a step of the commanded rate: it is late, and may overshoot.

The rate of the load point responds as a second-order system with poles s₁, s₂: a time t after the command, the rate has
changed by the share g(t) = 1 − (s₂ exp(s₁ t) − s₁ exp(s₂ t)) / (s₂ − s₁) of the step. Long after the step, the load
point is behind the command by the step times `lag` = 2 ζ/ω, so that the lines through its displacement before and after
the step meet a time `lag` after the command. ω is the natural angular frequency and ζ the damping ratio.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from steadyslip.core.arrays import Array

DAMPINGS = (0.2, 0.35, 0.6, 1.05, 2.0, 8.0)
"""Damping ratios from which a search starts: from an overshoot of 53 % to none, and nearly a single exponential."""
GAIN = 8.0
"""Decrease of chi squared by which a servo must fit better than steps or ramps. In 670 records without a servo, with
white or correlated noise, the largest decrease was 9.4, the next 7.4."""
SETTLED = 1e-3  # a step counts as complete when the rate is within this share of the step of its final value
PIECES = 24  # number of straight ramps that approximate a response: its rate is then right to 1 % of the step


def _poles(lag: float, damping: float) -> tuple[complex, complex]:
    """Poles s₁, s₂ (1/s) of a servo."""
    damping = damping if abs(damping - 1) > 1e-8 else 1 + 1e-8  # a double pole divides by zero
    omega, root = 2 * damping / lag, np.sqrt(complex(damping**2 - 1))
    return complex(omega * (root - damping)), complex(omega * (-root - damping))


def late_response(since: Array, lag: float, damping: float) -> tuple[Array, Array]:
    """Response of a servo to a unit step of the commanded rate, `since` seconds after it: displacement and rate.

    The displacement is in seconds, as the rate has no unit. It solves x'' + 2 ζ ω x' + ω² (x - t) = 0 from rest, with
    ω = 2 ζ/lag.
    """
    one, other = _poles(lag, damping)
    t = np.maximum(since, 0.0)
    if damping < 1:
        decayed = np.exp(one.real * t)
        even, odd = decayed * np.cos(one.imag * t), decayed * np.sin(one.imag * t) / one.imag
    else:
        slow, fast = np.exp(one.real * t), np.exp(other.real * t)
        even, odd = 0.5 * (slow + fast), (slow - fast) / (one.real - other.real)
    decay = -0.5 * (one + other).real
    return t - lag + lag * even + (decay * lag - 1) * odd, 1 - even - decay * odd


def settling(lag: float, damping: float) -> float:
    """Time (s) after the command from which the rate is within about a share `SETTLED` of its final value."""
    return float(-np.log(SETTLED) / min(-pole.real for pole in _poles(lag, damping)))


@lru_cache(maxsize=256)
def ramps(lag: float, damping: float) -> tuple[tuple[float, float, float], ...]:
    """Straight ramps that approximate a response: begin after the command (s), duration (s) and share of the step."""
    t = np.linspace(0.0, settling(lag, damping), 4000)
    bend = np.sqrt(np.abs(np.gradient(np.gradient(late_response(t, lag, damping)[1], t), t)))
    along = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) * np.diff(t))])
    nodes = np.interp(np.linspace(0.0, along[-1], PIECES + 1), along, t)
    _, share = late_response(nodes, lag, damping)
    share[0], share[-1] = 0.0, 1.0
    return tuple(zip(nodes[:-1].tolist(), np.diff(nodes).tolist(), np.diff(share).tolist(), strict=True))


def overshoot(damping: float) -> float:
    """Largest overshoot of the rate beyond its new level, as a share of the step."""
    return float(np.exp(-np.pi * damping / np.sqrt(1 - damping**2))) if damping < 1 else 0.0
