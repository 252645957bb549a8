"""What do cycles and thresholds cost, next to waiting for them, and what does hunting?

    python benchmarks/nonlinear.py [--quick]

Everything is measured warm (kernels compiled before), in this one process. Cycles are compared with simulating until
the motion repeats itself to 1e-8; thresholds with bisection by single runs, the way one would do it with `simulate`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from quick import QUICK

import steadyslip as ss

POINTS, TIMES = (1, 1) if QUICK else (100, 3)


def paper_rig(angle: float, damping_share: float = 0.0) -> ss.Slider:
    """The paper's inclined spring; radiation damping in units of aσ0/v0."""
    rock = ss.laws.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, evolution=ss.laws.Slip(),
        normal_memory=ss.laws.LinkerDieterich(alpha=0.56),
    )  # fmt: skip
    contact = ss.laws.InclinedSpring(preload=5e6, angle=np.radians(angle))
    damping = damping_share * 0.0145 * 5e6 / 1e-6
    return ss.Slider(
        friction=rock, contact=contact, stiffness=9e9, radiation_damping=damping, drive=ss.machine.SteadyDrive(1e-6)
    )


def timed(work: Callable[[], Any], times: int = TIMES) -> tuple[float, Any]:
    """Best of several, after one run that compiles; with ``--quick`` only what is timed."""
    result = None if QUICK else work()
    best = np.inf
    for _ in range(times):
        start = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - start)
    return best, result


def waited(rig: ss.Slider, period: float) -> int:
    """Simulate until two peaks agree to 1e-8; the number of peaks that took."""
    until = 10 * period
    while True:
        run = ss.simulate(rig, until=until, initial={"x": -1e-6}, rtol=1e-10)
        peaks = [event.velocity for event in run.events if event.kind == "velocity peak"]
        if len(peaks) > 2 and abs(peaks[-1] / peaks[-2] - 1) < 1e-8:
            return len(peaks)
        until *= 2


def bisected(rig: ss.Slider, low: float = 1.0, high: float = 6.0) -> float:
    """Threshold of a velocity step by single runs."""
    while high - low > (1e-3 if QUICK else 1e-8) * high:
        middle = 0.5 * (low + high)
        run = ss.simulate(
            rig, ss.protocol.VelocityStep(at=0.0, to=1e-6 * np.exp(middle)), until=600.0, rtol=1e-10, events=False
        )
        low, high = (low, middle) if run.status == "blow-up" else (middle, high)
    return low


def held_axes() -> dict[str, ss.Slider]:
    """The axis of Canudas de Wit et al. (1995) that hunts, with an encoder of 1 um read every millisecond."""
    axis = ss.read_rig(Path(__file__).parents[1] / "examples/hunting-axis.toml")
    fine = replace(axis, drive=replace(axis.drive, sample_time=1e-3, resolution=1e-6, derivative="measurement"))
    coulomb = ss.laws.Coulomb(mu_coulomb=1.0, mu_static=1.5, viscous=0.4)
    return {
        "bristles": axis,
        "bristles, sampled": fine,
        "Coulomb": replace(axis, friction=coulomb),
        "Coulomb, sampled": replace(fine, friction=coulomb),
    }


def main() -> None:
    for name, axis in held_axes().items():
        seconds, hunt = timed(lambda axis=axis: ss.hunt(axis, until=20.0 if QUICK else None), 1)
        print(f"hunt, {name}: {hunt.time[-1]:.0f} s of motion in {seconds:.2f} s")
    rig = paper_rig(-45, 1e-7)
    seconds, branch = timed(lambda: ss.cycles(rig))
    decades = np.log10(branch["peak_velocity"].max() / branch["lowest_velocity"].min())
    print(
        f"branch of the paper's rig, damped: {len(branch)} cycles, {decades:.1f} decades of velocity, {seconds:.2f} s"
    )
    values = branch.onset.value * np.array([0.9] if QUICK else [0.99, 0.9, 0.5, 0.1])
    for value in values:
        (cycle,) = branch.at(value)
        seconds_wait, count = timed(lambda value=value, cycle=cycle: waited(rig.with_values({"stiffness": value}),
                                                                          cycle.period), 1)  # fmt: skip
        seconds_cycle, _ = timed(lambda value=value: branch.at(value))
        print(f"  cycle at {value / branch.onset.value:4.2f} k_cr: growth {cycle.growth:8.2g} a period; continuation "
              f"{seconds_cycle * 1e3:6.1f} ms, waiting ({count} peaks) {seconds_wait * 1e3:8.1f} ms, "
              f"{seconds_wait / seconds_cycle:6.1f} x")  # fmt: skip
    stiff = paper_rig(0)
    stiff = stiff.with_values({"stiffness": 1.2 * ss.critical_stiffness(stiff)})
    seconds, found = timed(lambda: ss.threshold(stiff))
    seconds_single, other = timed(lambda: bisected(stiff), 1)
    print(f"velocity step to 1e-8: {seconds * 1e3:.0f} ms; by single runs {seconds_single * 1e3:.0f} ms, "
          f"{seconds_single / seconds:.1f} x; difference {abs(other / found.size - 1):.1e}")  # fmt: skip
    angle = np.radians(np.linspace(-40, 60, POINTS))
    factor = np.linspace(1.02, 3.0, POINTS)[:, None]
    vary = {"contact.angle": angle, "stiffness": factor * ss.critical_stiffness(stiff, {"contact.angle": angle})}
    start = time.perf_counter()
    ss.threshold_map(stiff, vary, progress=False)
    seconds = time.perf_counter() - start
    print(
        f"map of {POINTS} x {POINTS} thresholds to 1e-4 on all cores: {seconds:.1f} s, "
        f"{seconds / POINTS**2 * 1e3:.2f} ms each"
    )


if __name__ == "__main__":
    main()
