"""The kernels' text, run as plain Python, against SciPy on the Model's own equations: every law, contact, regime."""

import math
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest

import steadyslip as ss
from oracle import Oracle
from rigs_of_theory import CONTACTS, LAWS, quarter, rig
from steadyslip.kernels import primitives
from steadyslip.kernels.printers import python
from steadyslip.kernels.runner import Runner
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare
from steadyslip.motion.observe import observe

# Python's own elementary functions, within the rounding of the kernels' (test_compiled.py), take less time.
QUICK = SimpleNamespace(
    **vars(primitives)
    | {
        "exp": lambda x: np.float64(math.exp(min(x, 700.0)) if x >= -700.0 else 0.0),
        "log": lambda x: np.float64(math.log(max(x, 2.2250738585072014e-308)) if x >= 0 else math.nan),
        "sin": lambda x: np.float64(math.sin(x)),
        "cos": lambda x: np.float64(math.cos(x)),
    }
)


def interpreted(a_rig, protocol, until, initial, rtol):
    """x, v, memory at the end, and the outcome, from the kernel's text as plain Python."""
    jobs = prepare(a_rig, protocol, until, {}, initial, Options(rtol=rtol))
    machine = Runner(jobs.reduction, jobs.choice(1, True), plain=True)
    with np.errstate(all="ignore"), patch.object(python, "primitives", QUICK):
        outcome = run_single(jobs, machine, np.empty(0), False, False)
        final = outcome.final[0]
        zero = np.zeros(1, int)
        found = observe(jobs, machine, 0, zero, final[1:2].astype(int), final[0:1], outcome.point)
    names = ["x", "v", *(m.name for m in jobs.point.model.variables if m.name not in ("x", "v"))]
    return np.array([found[name][0] for name in names]), outcome


@pytest.mark.parametrize(("law", "contact", "mass"), quarter(0))
def test_kernels_follow_the_model(law, contact, mass):
    """Kick, then a step of normal stress: the end state is that of the independent integration.

    Another quarter of the combinations is kicked in test_motion.py; `benchmarks/laws.py` does both with all.

    The kernel's rtol is 1e-9 per step, some tens to hundreds of steps; LuGre rings, which multiplies errors.
    """
    friction, plain, until, kick = LAWS[law], law == "lugre", 3.0, 0.3e-6
    if plain:
        until, kick = 0.3, 1e-10
        if isinstance(contact, ss.laws.Lift):
            pytest.skip("bristles ring at velocities at which this lift takes the contact off")
    plain = plain and not isinstance(contact, ss.laws.DilatingLayer)  # that one has ln v in it
    if law == "lugre" and not plain:
        pytest.skip("bristles ring through zero velocity, where this contact law ends")
    if law == "prakash-clifton" and contact.name == "linear" and not mass:
        pytest.skip("friction does not answer at once to a normal stress that feels acceleration: ill-posed, see below")
    a_rig = rig(friction=friction, contact=contact, mass=mass, radiation_damping=0.0 if law == "lugre" else 2e10)
    got, outcome = interpreted(a_rig, ss.protocol.NormalStressStep(at=until / 3, by=1e5), until, {"x": kick}, 1e-9)
    assert outcome.status[0] == 1
    method = "LSODA" if mass or law == "lugre" else "DOP853"  # for what may be stiff, and what is not
    x, v, *memory = Oracle(a_rig, plain=plain).run(until / 3, x=kick, method=method)
    pressed = Oracle(a_rig, pressure=lambda t: 1e5, plain=plain)
    expected = pressed.run(until, x=x, v=v, memory=memory, start=until / 3, method=method)
    scale = np.maximum(np.abs(expected), [1e-6, 1e-6, *[1e-9 if plain else 1e-3] * len(memory)])
    assert np.max(np.abs(got - expected) / scale) < (5e-6 if law == "lugre" else 2e-8)


@pytest.mark.parametrize("exponent", [0.7, 3.0])
def test_bristles_with_a_stribeck_exponent(exponent):
    """Another exponent than 2 takes a power of velocity instead of a square."""
    friction = ss.laws.LuGre(
        mu_coulomb=0.1, mu_static=0.2, v_stribeck=1e-3, viscous=10.0, bristle_stiffness=1e5, bristle_damping=100.0,
        stribeck_exponent=exponent,
    )  # fmt: skip
    a_rig = rig(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        mass=1e3,
        stiffness=1e9,
        drive=ss.machine.SteadyDrive(1e-4),
    )
    got, _ = interpreted(a_rig, None, 0.01, {"v": 1.3e-4}, 1e-9)
    x, v, *memory = Oracle(a_rig, plain=True).run(0.01, v=1.3e-4, method="LSODA")
    assert got == pytest.approx([x, v, *memory], rel=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_times_are_exact(seed):
    """Own steps never go back, land on every breakpoint (twice: before and after) and on the end, to the last bit."""
    random = np.random.default_rng(seed)
    until = random.uniform(0.5, 5.0)
    breakpoints = np.sort(random.uniform(0, until, 6))
    pieces = [ss.protocol.VelocityStep(at=t, to=1e-6 * (1 + i % 2)) for i, t in enumerate(breakpoints)]
    jobs = prepare(rig(stiffness=2e10), ss.Protocol.of(pieces), until, {}, {}, Options(rtol=1e-4))
    machine = Runner(jobs.reduction, jobs.choice(1, True), plain=True)
    requested = np.sort(np.concatenate([[0.0, until], breakpoints, random.uniform(0, until, 5)]))
    outcome = run_single(jobs, machine, requested, True, True)
    own = outcome.recorded[:, 0]
    assert outcome.final[0, 0] == own[-1] == until
    assert np.all(np.diff(own) >= 0)
    for moment in breakpoints:
        assert np.sum(own == moment) == 2
    assert np.all(np.diff(outcome.log[:, 1]) >= 0)
    assert np.all(np.isfinite(outcome.samples))
    np.testing.assert_array_equal(outcome.samples[0, -1], outcome.point[0])


INPUTS = {
    "ramp of velocity": (
        ss.protocol.VelocityRamp(at=0.5, to=3e-6, duration=1.0),
        {"velocity": lambda t: 1e-6 + 2e-6 * np.clip(t - 0.5, 0, 1)},
    ),
    "wave of velocity": (
        ss.protocol.VelocityHarmonic(amplitude=3e-7, period=0.7, phase=0.3),
        {"velocity": lambda t: 1e-6 + 3e-7 * np.sin(2 * np.pi * t / 0.7 + 0.3)},
    ),
    "wave of normal stress": (
        ss.protocol.NormalStressHarmonic(amplitude=1e5, period=0.5),
        {"pressure": lambda t: 1e5 * np.sin(2 * np.pi * t / 0.5)},
    ),
    "ramp of disturbance": (
        ss.protocol.DisturbanceRamp(at=0.0, by=5e4, duration=3.0),
        {"disturbance": lambda t: 5e4 * t / 3},
    ),
}


CHANGES = [
    {},
    {"mass": 1e9},
    {"damping": 1e10, "friction": LAWS["aging+ld"], "contact": CONTACTS[1]},
    {"damping": 1e10, "mass": 1e9, "friction": LAWS["aging+ld"], "contact": CONTACTS[1]},
    {"friction": LAWS["nagata regularised"], "radiation_damping": 1e10},
    {"contact": CONTACTS[-1], "friction": LAWS["aging+ld"]},
    {"drive": ss.machine.PID(1e-6, kp=2e10, kd=1e9, ki=1e9), "stiffness": None},
    {"contact": ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=0.9)},
    {"contact": ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=0.9), "mass": 1e9},
]


@pytest.mark.parametrize(
    ("changes", "inputs"),
    [
        pytest.param(changes, inputs, id=f"{'-'.join(changes) or 'plain'}-{inputs}")
        for i, changes in enumerate(CHANGES)
        for j, inputs in enumerate(INPUTS)
        if (i + j) % 2 == 0
    ],
)
def test_inputs_that_vary_in_time(changes, inputs):
    """Every channel reaches the equations with its rate, with and without mass (the Rosenbrock time derivative)."""
    a_rig = rig(**({"stiffness": 2e10} | changes))
    piece, functions = INPUTS[inputs]
    got, outcome = interpreted(a_rig, piece, 2.0, {"x": 1e-7}, 1e-9)
    assert outcome.status[0] == 1
    oracle, state = Oracle(a_rig, **functions), None
    for start, stop in ((0.0, 0.5), (0.5, 1.5), (1.5, 2.0)):  # kinks at the ends of the ramp
        begin = {"x": 1e-7} if state is None else {"x": state[0], "v": state[1], "memory": state[2:]}
        state = oracle.run(stop, start=start, method="LSODA" if "mass" in changes else "DOP853", **begin)
    scale = np.maximum(np.abs(state), [1e-6, 1e-6, *[1e-3] * (len(state) - 2)])
    assert np.max(np.abs(got - state) / scale) < 2e-8
