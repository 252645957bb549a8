"""Check of memory variables: they must be continuous when velocity or normal stress jump."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.precise import ContractViolation, eigenvalues, format_number, require
from steadyslip.testing.symbolic import DEFAULT_CONDITIONS, Conditions, SymbolicLaw, symbolic_law

_VELOCITY_JUMP, _STRESS_JUMP = 3.0, 1.5  # value after over before: far from small, within the range of most laws
_RAMP_DURATION = 1e-3  # duration of the ramp over the fastest relaxation time
_HALVING_RATIO = 0.6  # a change of first order halves with the duration; 0.1 is left for second order


def check_jumps(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that memory is continuous when normal stress or velocity jump, and that strength follows at once.

    The rates are integrated through a smooth ramp of ever shorter duration: the change of each memory
    variable must vanish with the duration at first order, and the strength at the end must tend to
    strength(v2, σ2, memory before the jump).
    """
    symbolic = symbolic_law(law)
    v, sigma = conditions.velocity, conditions.normal_stress
    start = [float(x) for x in symbolic.steady(v, sigma)]
    ends = {"normal stress": (v, sigma * _STRESS_JUMP), "velocity": (v * _VELOCITY_JUMP, sigma)}
    stress = _strength_solver(symbolic)
    for what, (v2, sigma2) in ends.items():
        at_once = stress(v2, sigma2, start[2:-1], start[-1])
        require(np.isfinite(at_once), law, f"strength() has no finite value after a sudden change of {what}")
        if not symbolic.memory:
            continue
        duration = _RAMP_DURATION / _fastest_rate(symbolic, (start, [v2, sigma2, *start[2:-1], at_once]))
        memory = np.array(start[2:-1])
        found = [_memory_after_ramp(symbolic, stress, start, (v2, sigma2), d) for d in (duration, duration / 2)]
        changes = [np.abs(end - memory) for end in found]
        noise = 1e-9 * np.maximum(np.abs(memory), np.abs(changes[0]))
        for i, name in enumerate(law.memory()):
            long, short = changes[0][i], changes[1][i]
            require(
                short <= _HALVING_RATIO * long + noise[i],
                law,
                f"{name} jumps with the {what}: it changes by {format_number(long)} in a ramp of {duration:.3g} s and "
                f"by {format_number(short)} in one half as long; choose a memory variable that stays continuous, such "
                "as Θ + (α/b) ln σ, and leave the rate of the normal stress out of rates()",
            )
        misses = [abs(stress(v2, sigma2, end, at_once) - at_once) for end in found]
        require(
            misses[1] <= _HALVING_RATIO * misses[0] + 1e-9 * abs(at_once),
            law,
            f"after a sudden change of {what} the strength tends to {format_number(at_once + misses[1])} Pa, not to "
            f"strength(v2, σ2, memory before) = {format_number(at_once)} Pa",
        )


def _fastest_rate(symbolic: SymbolicLaw, points: Any) -> float:
    """Largest eigenvalue magnitude (1/s) of the relaxation of memory, over points before and after the jump."""
    relaxation = symbolic.relaxation()
    sizes = [abs(root) for point in points for root in eigenvalues(relaxation(*point))]
    return float(max(sizes))


def _strength_solver(symbolic: SymbolicLaw) -> Callable[..., float]:
    """Function that solves τ = strength(v, σ, memory, τ) for τ (Pa) by Newton's method."""
    function = symbolic.floats(symbolic.strength, sp.diff(symbolic.strength, symbolic.tau))

    def solve(v: float, sigma: float, memory: Any, guess: float) -> float:
        tau = guess
        for _ in range(50):
            with np.errstate(all="ignore"):
                strength, slope = (float(x) for x in function(v, sigma, *memory, tau))
            step = (strength - tau) / (1 - slope)
            tau += step
            if not abs(step) > 1e-14 * abs(tau):  # NaN is returned too: the caller checks
                return tau
        raise ContractViolation(
            f"{symbolic.law!r}: strength(v, σ, memory, tau) = tau cannot be solved at v = {v}, σ = {sigma}"
        )

    return solve


def _memory_after_ramp(
    symbolic: SymbolicLaw, stress: Callable[..., float], start: list[float], end: tuple[float, float], duration: float
) -> Any:
    """Memory variables at the end of a smooth ramp of velocity and normal stress; `duration` in s."""
    from scipy.integrate import solve_ivp

    rates = symbolic.floats(*symbolic.rates)
    first = np.log(start[:2])
    last = np.log(end)

    def slope(t: float, memory: Any) -> Any:
        s = t / duration
        v, sigma = np.exp(first + (last - first) * s * s * (3 - 2 * s))
        return [float(rate) for rate in rates(v, sigma, *memory, stress(v, sigma, memory, start[-1]))]

    scale = np.maximum(np.abs(start[2:-1]), 1e-3 * np.max(np.abs([duration * r for r in slope(duration, start[2:-1])])))
    run = solve_ivp(
        slope, (0.0, duration), start[2:-1], method="DOP853", rtol=1e-11, atol=1e-13 * np.maximum(scale, 1e-300)
    )
    if not run.success or not np.all(np.isfinite(run.y[:, -1])):
        raise ContractViolation(
            f"{symbolic.law!r}: rates() cannot be integrated through a smooth ramp of velocity or normal stress "
            f"({run.message}); they must be finite and continuous"
        )
    return run.y[:, -1]
