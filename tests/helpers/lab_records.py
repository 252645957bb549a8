"""Records with known truth, made by the simulator: another route than the kernel that fits use."""

from __future__ import annotations

from functools import cache

import numpy as np

import steadyslip as ss

NOISE = 2e-4
TRUTH = {"a": 0.011, "b": 0.0145, "d_c": 12e-6, "mu_ref": 0.62}
STIFFNESS = 2e10
STRESS = 10e6
SLOW = 1e-6


def rig(evolution: ss.laws.Evolution | None = None, alpha: float | None = None, **changes: float) -> ss.Slider:
    """A rig with the truth in it."""
    memory = ss.laws.NoMemory() if alpha is None else ss.laws.LinkerDieterich(alpha=alpha)
    values = TRUTH | changes
    friction = ss.laws.RateState(**values, v_ref=SLOW, evolution=evolution or ss.laws.Slip(), normal_memory=memory)
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=STRESS)
    return ss.Slider(friction=friction, contact=contact, stiffness=STIFFNESS, drive=ss.machine.SteadyDrive(SLOW))


def two_states() -> ss.Slider:
    """Rig whose friction has two states."""
    states = (ss.laws.State(b=0.008, d_c=6e-6), ss.laws.State(b=0.006, d_c=120e-6))
    friction = ss.laws.RateState(a=0.011, states=states, mu_ref=0.62, v_ref=SLOW)
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=STRESS)
    return ss.Slider(friction=friction, contact=contact, stiffness=STIFFNESS, drive=ss.machine.SteadyDrive(SLOW))


STEP = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=60.13, to=5e-6),), until=150.0)
HOLD = ss.Protocol(
    pieces=(ss.protocol.Hold(at=60.13, duration=100.0), ss.protocol.VelocityStep(at=200.37, to=3e-6)), until=300.0
)
PRESSED = ss.Protocol(
    pieces=(ss.protocol.VelocityStep(at=60.13, to=3e-6), ss.protocol.NormalStressStep(at=140.41, by=0.08 * STRESS)),
    until=220.0,
)
PULSED = ss.Protocol(
    pieces=(
        ss.protocol.VelocityStep(at=60.13, to=3e-6),
        ss.protocol.NormalStressPulse(at=120.2, by=0.05 * STRESS, duration=40.3),
    ),
    until=220.0,
)
SHAKEN = ss.Protocol(
    pieces=(
        ss.protocol.VelocityStep(at=60.13, to=3e-6),
        ss.protocol.NormalStressHarmonic(at=120.0, amplitude=0.02 * STRESS, period=20.0),
    ),
    until=220.0,
)


def columns(source: ss.Slider, protocol: ss.Protocol, count: int = 1000, uniform: bool = True) -> dict[str, np.ndarray]:
    """Time, friction, normal stress and displacement of the load point, without noise."""
    times = np.linspace(0.0, protocol.until, count)
    if not uniform:
        inner = np.sort(np.random.default_rng(3).uniform(0.0, protocol.until, count - 2))
        times = np.concatenate([[0.0], inner, [protocol.until]])
    run = ss.simulate(source, protocol, times=times, rtol=1e-10, events=False)
    assert run.status == "done"
    return {
        "time": run["t"],
        "friction": run["friction"],
        "normal": run["normal_stress"],
        "displacement": run["load_displacement"],
    }


def record(
    source: ss.Slider, protocol: ss.Protocol, seed: int = 0, noise: float = NOISE, **options: object
) -> ss.experiments.Record:
    """A noisy record."""
    found = columns(source, protocol, **options)
    found["friction"] = found["friction"] + noise * np.random.default_rng(seed).standard_normal(len(found["time"]))
    return ss.record_from_arrays(**found, source="synthetic")


BASALT, SEPIOLITE = (f"examples/data/{name}_velocity_step.txt" for name in ("basalt_b819", "sepiolite_013"))


@cache
def stepped(seed=0):
    """A fit to a velocity step, made once."""
    return ss.fit(ss.lab_rig(), record(rig(), STEP, seed))


@cache
def basalt():
    return ss.fit(ss.lab_rig(), ss.read_record(BASALT), trend=1)


def deviations(fit, rig, jumps=()):
    """Estimates less truth, in standard errors."""
    truth = dict(zip((n for n in fit.names if n.startswith(("jump", "step"))), jumps, strict=True))
    truth |= {name: a.value for name, a in rig.parameters().items()}
    v_ref = fit.plan.rig.parameters()["friction.v_ref"].value
    assert v_ref == SLOW
    found = []
    for i, one in enumerate(fit.space.unknowns):
        z = one.coordinate(truth[one.parameter])
        found.append((fit.coordinates[i] - z) / np.sqrt(fit.covariance[i, i]))
    return np.array(found)
