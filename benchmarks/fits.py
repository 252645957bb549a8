"""What does a fit cost, next to SciPy, and how often does it find the best minimum from no guess?

    python benchmarks/fits.py [--quick]

The rival is what a user would write: SciPy's least_squares on SciPy's LSODA with a compiled right-hand side, started
near the truth, which ours is not. Everything is measured warm, in this one process, in seconds of CPU; speeds are
ratios. The floor of a fit is what its last steps need: runs through all samples with all derivatives.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from quick import QUICK
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import least_squares

import steadyslip as ss

SAMPLES, NOISE, SLOW, FAST, STRESS = 500 if QUICK else 5000, 2e-4, 1e-6, 5e-6, 1e7
TRUTH = {"a": 0.011, "b": 0.0145, "d_c": 12e-6, "mu_ref": 0.62}
STIFFNESS = 2e10


def rig_of(law: str, states: int = 1, **numbers: float) -> ss.Slider:
    """The rig that makes records."""
    values = TRUTH | numbers
    evolution = {"slip": ss.laws.Slip, "aging": ss.laws.Aging}[law]()
    stiffness, stress = values.pop("stiffness", STIFFNESS), values.pop("stress", STRESS)
    alpha = values.pop("alpha", None)
    memory = ss.laws.NoMemory() if alpha is None else ss.laws.LinkerDieterich(alpha=alpha)
    if states == 2:
        b, d_c = values.pop("b"), values.pop("d_c")
        pair = (ss.laws.State(b=0.6 * b, d_c=d_c), ss.laws.State(b=0.4 * b, d_c=12 * d_c))
        friction = ss.laws.RateState(**values, states=pair, v_ref=SLOW, evolution=evolution, normal_memory=memory)
    else:
        friction = ss.laws.RateState(**values, v_ref=SLOW, evolution=evolution, normal_memory=memory)
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=stress)
    return ss.Slider(friction=friction, contact=contact, stiffness=stiffness, drive=ss.machine.SteadyDrive(SLOW))


def record_of(rig: ss.Slider, protocol: ss.Protocol, rng: np.random.Generator, samples: int = SAMPLES) -> Any:
    """A noisy record, uniform or not; None if the block shoots ahead a hundredfold, which is no such experiment."""
    whole = ss.simulate(rig, protocol, events=False)
    if whole.status != "done" or whole["v"].max() > 100 * whole["load_velocity"].max():
        return None
    times = np.linspace(0.0, protocol.until or 0.0, samples)
    if rng.random() < 0.5:
        times = np.concatenate([[0.0], np.sort(rng.uniform(0.0, times[-1], samples - 2)), times[-1:]])
    run = ss.simulate(rig, protocol, times=times, rtol=1e-10, events=False)
    friction = run["friction"] + NOISE * rng.standard_normal(samples)
    return ss.record_from_arrays(
        run["t"], friction=friction, normal=run["normal_stress"], displacement=run["load_displacement"]
    )


@njit(cache=False)
def rates(y: np.ndarray, t: float, a: float, b: float, d: float, mu: float, k: float, step: float) -> np.ndarray:
    """Slip law in ln v, for LSODA."""
    load = SLOW if t < step else FAST
    v = SLOW * np.exp(y[0])
    theta = (y[1] - mu - a * y[0]) / b
    state = -v / d * (y[0] + theta)
    stress = -k / STRESS * (v - load)
    return np.array([(stress - b * state) / a, stress])


def rival(record: ss.experiments.Record, step: float, solver: str) -> tuple[float, Any]:
    """SciPy from ten per cent beside the truth, by either of its two interfaces to LSODA."""
    before = record.time < step

    def friction(p: np.ndarray) -> np.ndarray:
        a, b, d, k = np.exp(p[0]), p[1] * 0.01, np.exp(p[2]), np.exp(p[4])
        constants = (a, b, d, p[3], k, step)
        grid = np.concatenate([[step], record.time[~before]])
        if solver == "odeint":
            seen = odeint(rates, [0.0, p[3]], grid, args=constants, rtol=1e-7, atol=1e-9, mxstep=100_000)[1:, 1]
        else:
            span = (grid[0], grid[-1])
            seen = solve_ivp(
                lambda t, y: rates(y, t, *constants), span, [0.0, p[3]], "LSODA", grid[1:], rtol=1e-7, atol=1e-9
            ).y[1]
        return np.concatenate([np.full(before.sum(), p[3]), seen])

    truth = np.array([np.log(0.011), 1.45, np.log(12e-6), 0.62, np.log(STIFFNESS)])
    start = truth + np.array([0.1, 0.1, 0.1, 0.005, 0.1])
    begin = time.process_time()
    found = least_squares(lambda p: friction(p) - record.friction, start, x_scale="jac", xtol=1e-10, ftol=1e-10)
    return time.process_time() - begin, found


@njit(cache=False)
def measured_rates(
    y: np.ndarray, t: float, a: float, b: float, d: float, mu: float, k: float, time: np.ndarray, load: np.ndarray,
    stress: np.ndarray, v0: float,
) -> np.ndarray:  # fmt: skip
    """Slip law in friction and state, driven by a table: rates of the load point, normal stress between samples."""
    i = min(max(np.searchsorted(time, t, side="right") - 1, 0), len(load) - 1)
    slope = (stress[i + 1] - stress[i]) / (time[i + 1] - time[i])
    sigma = stress[i] + slope * (t - time[i])
    u = (y[0] / sigma - mu - b * y[1]) / a
    v = v0 * np.exp(u)
    return np.array([k * (load[i] - v), -v / d * (u + y[1])])


def measured_rival(record: ss.experiments.Record) -> tuple[float, Any]:
    """SciPy on a measured history, which breaks off at every sample; from ten per cent beside our minimum."""
    assert record.displacement is not None
    assert record.normal is not None
    assert record.initial_rate is not None
    time_, stress, v0 = record.time - record.time[0], np.array(record.normal), record.initial_rate
    load = np.diff(record.displacement) / np.diff(record.time)
    share = (record.displacement - record.displacement[0]) / np.ptp(record.displacement)

    def friction(p: np.ndarray) -> np.ndarray:
        a, b, d, k = np.exp(p[0]), p[1] * 0.01, np.exp(p[2]), np.exp(p[4])
        constants = (a, b, d, p[3], k, time_, load, stress, v0)
        start = [p[3] * stress[0], 0.0]
        y = odeint(
            measured_rates, start, time_, args=constants, rtol=1e-7, atol=[1e-2, 1e-9], tcrit=time_, mxstep=10_000
        )
        return y[:, 0] / stress + 0.1 * p[5] * share

    truth = np.array([np.log(0.00696), 0.75, np.log(10.1e-6), 0.6074, np.log(61e9), 0.0194])
    begin = time.process_time()
    start = truth + np.array([0.1, 0.1, 0.1, 0.001, 0.1, 0.0])
    found = least_squares(lambda p: friction(p) - record.friction, start, x_scale="jac", xtol=1e-10, ftol=1e-10)
    return time.process_time() - begin, found


def speed() -> None:
    """One velocity step, five parameters."""
    step = 60.13
    protocol = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=step, to=FAST),), until=150.0)
    record = record_of(rig_of("slip"), protocol, np.random.default_rng(2))
    guess = ss.lab_rig()
    fit = ss.fit(guess, record)
    rival(record, step, "odeint")
    ours = min(_timed(lambda: ss.fit(guess, record)) for _ in range(1 if QUICK else 5))
    print(f"one velocity step, {SAMPLES} samples, {len(fit.names)} parameters")
    print(f"  steadyslip, no guess, {fit.search.starts} starts   {1e3 * ours:8.1f} ms   ssq {fit.ssq:.9e}")
    near = [fit.coordinates[None] * (1 + 1e-9 * i) for i in range(1, 6)]  # what was just run would not be run again
    once = min(_timed(lambda z=z: fit.comparison.residuals(z)) for z in near)
    print(f"  one run with all derivatives          {1e3 * once:8.1f} ms   the floor is two or three of them")
    print("  SciPy, 10 % beside the truth, told that the step is ideal and when")
    for solver in ("solve_ivp", "odeint"):
        theirs, found = min((rival(record, step, solver) for _ in range(1 if QUICK else 3)), key=lambda pair: pair[0])
        text = f"ssq {2 * found.cost:.9e}, {theirs / ours:.1f} x ours"
        print(f"    LSODA by {solver:<10}                 {1e3 * theirs:8.1f} ms   {text}")
    count = 4 if QUICK else 1000
    seconds = _timed(lambda: ss.experiments.bootstrap(fit, count))
    print(f"{count} warm refits of it                  {seconds:8.2f} s")
    path = Path(__file__).parents[1] / "examples" / "data" / "basalt_b819_velocity_step.txt"
    few = ss.read_record(path, between=(11674, 11680))
    real = few if QUICK else ss.read_record(path)
    basalt = ss.fit(guess, real, trend=1)
    ours = min(_timed(lambda: ss.fit(guess, real, trend=1)) for _ in range(1 if QUICK else 3))
    if not QUICK:  # compiled and warm
        measured_rival(few)
    theirs, found = measured_rival(real)
    print(f"basalt, {len(real)} samples, driven by the measured load point and normal stress")
    print(f"  steadyslip, no guess                  {1e3 * ours:8.1f} ms   ssq {basalt.ssq:.9e}")
    print(f"  SciPy on LSODA, 10 % beside it        {1e3 * theirs:8.1f} ms   ssq {2 * found.cost:.9e}")
    print(f"  ratio                                 {theirs / ours:8.1f}")
    seconds = _timed(lambda: ss.experiments.bootstrap(basalt, count))
    print(f"{count} block-bootstrap refits of it       {seconds:8.2f} s")


def _timed(work: Any) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def random_case(rng: np.random.Generator, kind: str, law: str) -> tuple[ss.Slider, ss.Protocol]:
    """A rig and an experiment on it; stable at both rates."""
    a, d_c = rng.uniform(0.004, 0.015), 10 ** rng.uniform(-5.7, -4.0)
    b, stress = a + rng.uniform(-0.006, 0.006), 10 ** rng.uniform(6.3, 7.7)
    kappa = max(10 ** rng.uniform(-0.3, 1.3), 1.5 * max((b - a) / a, 0) + 0.3)
    numbers = {"a": a, "b": b, "d_c": d_c, "mu_ref": rng.uniform(0.4, 0.7), "stress": stress}
    if "normal" in kind:
        numbers["alpha"] = rng.uniform(0.1, 0.6)
    states = 2 if kind == "two states" else 1
    rig = rig_of(law, states, stiffness=kappa * a * stress / d_c, **numbers)
    unit, ratio = d_c / SLOW, rng.choice([0.1, 1 / 3, 3.0, 10.0])
    at, later = 10 * unit, unit / ratio
    pieces: list[Any] = [ss.protocol.VelocityStep(at=at, to=ratio * SLOW)]
    end = at + (20 if states == 1 else 300) * later
    if kind == "slide-hold-slide":
        pieces.append(ss.protocol.Hold(at=end, duration=30 * later))
        end += 55 * later
    elif kind == "normal step":
        pieces.append(ss.protocol.NormalStressStep(at=end, by=0.1 * stress * rng.choice([-1, 1])))
        end += 25 * later
    elif kind == "normal pulse":
        pieces.append(ss.protocol.NormalStressPulse(at=end, by=0.05 * stress, duration=10 * later))
        end += 35 * later
    elif kind == "normal harmonic":
        pieces.append(ss.protocol.NormalStressHarmonic(at=end, amplitude=0.02 * stress, period=6 * later))
        end += 40 * later
    return rig, ss.Protocol(pieces=tuple(pieces), until=end)


KINDS = ("velocity step", "two states", "slide-hold-slide", "normal step", "normal pulse", "normal harmonic")


def robustness(count: int) -> None:
    """How often is the best minimum found, and how often is the truth within the intervals?"""
    print(f"\n{'experiment':<18} {'law':<6} fits  best minimum  within 3.5 s.e.  68 %  95 %  median, longest (s)")
    total = best = 0
    for kind in KINDS[: 1 if QUICK else None]:
        for law in ("slip", "aging")[: 1 if QUICK else None]:
            rng = np.random.default_rng(KINDS.index(kind))
            reached, inside, deviations, seconds = [], [], [], []
            while len(reached) < count:
                rig, protocol = random_case(rng, kind, law)
                record = record_of(rig, protocol, rng, 2000)
                if record is None:
                    continue
                memory = "linker-dieterich" if "normal" in kind else "none"
                guess = ss.lab_rig(law, states=2 if kind == "two states" else 1, normal_memory=memory)
                begin = time.process_time()
                fit = ss.fit(guess, record)
                seconds.append(time.process_time() - begin)
                own, z = _against_truth(fit, rig, protocol)
                reached.append(fit.ssq <= fit.comparison.misfit(z[None])[0] * (1 + 1e-6))
                inside.append(np.all(np.abs(own) < 3.5))
                deviations += list(own)
            scatter = np.abs(np.array(deviations))
            total, best = total + count, best + sum(reached)
            print(
                f"{kind:<18} {law:<6} {count:>4}  {np.mean(reached):>12.3f}  {np.mean(inside):>15.3f}  "
                f"{np.mean(scatter < 0.9945):>4.2f}  {np.mean(scatter < 1.96):>4.2f}  "
                f"{np.median(seconds):.2f}, {max(seconds):.2f}",
                flush=True,
            )
    print(f"the best minimum was found in {best} of {total} fits ({100 * best / total:.2f} %)")


def _against_truth(fit: ss.experiments.Fit, rig: ss.Slider, protocol: ss.Protocol) -> tuple[np.ndarray, np.ndarray]:
    """Deviations in standard errors of what is determined, and the coordinates of the truth."""
    known = {name: a.value for name, a in rig.parameters().items()}
    times: list[float] = []
    for piece in protocol.pieces:
        if isinstance(piece, (ss.protocol.NormalStressStep, ss.protocol.NormalStressPulse)):
            times.append(piece.at)
        if isinstance(piece, ss.protocol.NormalStressPulse):
            times.append(piece.at + piece.duration)
    z = fit.coordinates.copy()
    for i, one in enumerate(fit.space.unknowns):
        value = known.get(one.parameter)
        if value is None and one.parameter.startswith("jump."):
            place = int(one.parameter.partition(".")[2]) - 1
            value = times[place] if place < len(times) else None
        if value is not None:
            z[i] = one.coordinate(value)
    deviation = np.sqrt(np.diag(fit.covariance))
    rigs = [i for i, one in enumerate(fit.space.unknowns) if one.parameter in known and np.isfinite(deviation[i])]
    return ((fit.coordinates - z) / deviation)[rigs], z


if __name__ == "__main__":
    speed()
    if "--speed" not in sys.argv:
        robustness(1 if QUICK else 25)
