"""How fast are arrays of stability answers, next to what a user would type or write instead?

    python benchmarks/linear.py [rigs]

Prints ratios measured side by side in this run, and rigs per second on one core.
1. A million critical stiffnesses of the inclined spring, against the same formula typed in NumPy.
2. Eigenvalues and stable sets by the general route for three states, against a loop over SciPy-style
   code for one rig at a time (numpy.linalg.eigvals on the Jacobian).
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from quick import QUICK, parsed

import steadyslip as ss
from steadyslip.linear.state_space import jacobian

A, B, D_C, MU, ALPHA, PRELOAD = 0.0145, 0.016, 1e-6, 0.7, 0.56, 5e6


def seconds(call: Callable[[], Any]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def side_by_side(ours: Callable[[], Any], other: Callable[[], Any], runs: int = 15) -> tuple[float, float, float]:
    """Median times of both, and the median of their ratios taken pair by pair."""
    ours(), other()
    pairs = [(seconds(ours), seconds(other)) for _ in range(runs)]
    return (
        statistics.median(a for a, _ in pairs),
        statistics.median(b for _, b in pairs),
        statistics.median(a / b for a, b in pairs),
    )


def paper_rig(**changes: Any) -> ss.Slider:
    rock = ss.laws.RateState(
        a=A, b=B, d_c=D_C, mu_ref=MU, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=ALPHA)
    )
    spring = ss.laws.InclinedSpring(preload=PRELOAD, angle=0.0)
    return ss.Slider(
        **({"friction": rock, "contact": spring, "stiffness": 9e9, "drive": ss.machine.SteadyDrive(1e-6)} | changes)
    )


def typed(angle: Any, a: Any = A, m_star: Any = None) -> Any:
    """The formula (eqs 25 and 28) as a user would type it."""
    t = np.tan(angle)
    sigma = PRELOAD / (1 + MU * t)
    if m_star is None:
        return sigma * (B - a) / (D_C * (1 + (MU - ALPHA) * t))
    inertia = m_star / sigma  # m v0²/(σss d_c) with m_star = m v0²/d_c
    return sigma / D_C * (B - a) * (a + inertia) / (a * (1 + (MU - ALPHA) * t) - ALPHA * inertia * t)


def closed_form(count: int) -> None:
    rng = np.random.default_rng(1)
    angle = rng.uniform(-0.8, 1.2, count)
    a = rng.uniform(0.010, 0.0155, count)
    mass = rng.uniform(1e8, 1e10, count)
    rig = paper_rig()
    cases = {
        "angle": ({"contact.angle": angle}, lambda: typed(angle)),
        "angle, a": ({"contact.angle": angle, "friction.a": a}, lambda: typed(angle, a)),
        "angle, a, mass": (
            {"contact.angle": angle, "friction.a": a, "slider.mass": mass},
            lambda: typed(angle, a, mass * 1e-12 / D_C),
        ),
    }
    print(f"{count} critical stiffnesses of the inclined spring, steadyslip against the typed formula")
    for name, (vary, formula) in cases.items():
        ours = ss.critical_stiffness(rig, vary)
        found = np.isfinite(ours)
        error = np.max(np.abs(ours[found] / formula()[found] - 1))
        mine, other, ratio = side_by_side(lambda vary=vary: ss.critical_stiffness(rig, vary), formula)
        print(f"  {name:<16} {1e3 * mine:7.2f} ms / {1e3 * other:6.2f} ms   ratio {ratio:.2f}   difference {error:.1e}")


def three_states() -> dict[str, ss.Slider]:
    two = ss.laws.RateState(
        a=0.01,
        mu_ref=0.6,
        v_ref=1e-6,
        states=[ss.laws.State(b=0.008, d_c=1e-6), ss.laws.State(b=0.006, d_c=2e-5)],
        normal_memory=ss.laws.LinkerDieterich(alpha=0.3),
    )
    three = ss.laws.RateState(
        a=0.01,
        mu_ref=0.6,
        v_ref=1e-6,
        states=[ss.laws.State(b=0.008, d_c=1e-6), ss.laws.State(b=0.006, d_c=2e-5), ss.laws.State(b=0.002, d_c=1e-4)],
        evolution=ss.laws.Aging(),
        normal_memory=ss.laws.LinkerDieterich(alpha=0.3),
    )
    return {
        "one state with mass (x, v, Ψ)": paper_rig(mass=1e9),
        "two states (x, Ψ1, Ψ2)": paper_rig(friction=two),
        "three friction states with mass": paper_rig(friction=three, mass=1e9),
    }


def general_route(count: int) -> None:
    rng = np.random.default_rng(2)
    vary = {
        "friction.a": rng.uniform(0.005, 0.02, count),
        "contact.angle": rng.uniform(-0.6, 0.6, count),
        "slider.stiffness": 10 ** rng.uniform(8, 11, count),
    }
    print(f"general route, {count} rigs, one core")
    for name, rig in three_states().items():
        # a gain of zero beside the closed form's own case still has to go the general way
        spectrum = min(seconds(lambda r=rig: ss.eigenvalues(r, vary)) for _ in range(5))
        sets = min(seconds(lambda r=rig: general_sets(r, vary)) for _ in range(5))
        few = min(200, count)
        rigs = [rig.with_values({k: float(v[i]) for k, v in vary.items()}) for i in range(few)]
        loop = min(seconds(lambda r=rigs: [np.linalg.eigvals(jacobian(one)) for one in r]) for _ in range(3)) / few
        both = (spectrum + sets) / count
        print(
            f"  {name:<34} eigenvalues {count / spectrum:9.0f}/s   stable sets {count / sets:9.0f}/s   "
            f"both {1 / both:8.0f}/s   loop/ours (eigenvalues) {loop / (spectrum / count):.0f}"
        )


def general_sets(rig: ss.Slider, vary: dict[str, Any]) -> Any:
    from steadyslip.linear.stiffness import general_set
    from steadyslip.model.point import operating_point

    return general_set(operating_point(rig, vary)).intervals


if __name__ == "__main__":
    chosen = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    chosen.add_argument("rigs", nargs="?", type=int, default=1_000_000)
    number = parsed(chosen, rigs=1000).rigs
    closed_form(number)
    general_route(max(number // 50, 50 if QUICK else 1000))
