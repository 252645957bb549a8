"""Steps of a drive on which bodies with mass slide: they keep their velocities, and the slip rate jumps."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss

BELT = """
[bodies.block]
motion = "slide"
mass = "{mass} kg"
[links.spring]
between = ["ground", "block"]
stiffness = "{stiffness} N/m"
damping = "{damping} N s/m"
[contacts.c]
body = "drive"
against = "block"
[contacts.c.friction]
law = "rate-state"
evolution = "slip"
a = {a}
b = {b}
d_c = "10 um"
mu_ref = 0.5
v_ref = "1 mm/s"
regularised = {regularised}
[contacts.c.contact]
law = "constant"
steady_normal_stress = "10 N"
[drive]
velocity = "1 mm/s"
"""
LOAD, REFERENCE, DISTANCE, START = 10.0, 1e-3, 1e-5, 0.2


def friction_by_hand(v, memory, a, b, regularised):
    """Friction coefficient of a slip rate and ln θ v₀/d_c."""
    if regularised:
        return a * np.arcsinh(0.5 * v / REFERENCE * np.exp((0.5 + b * memory) / a))
    return 0.5 + a * np.log(v / REFERENCE) + b * memory


def by_hand(times, to, mass, stiffness, damping, a, b, regularised):
    """Slip rate and velocity of the block after a step of the belt from steady sliding, typed by hand."""

    def rates(_, y):
        place, speed, memory = y
        v = to - speed
        force = LOAD * friction_by_hand(v, memory, a, b, regularised) - stiffness * place - damping * speed
        ratio = abs(v) / REFERENCE * np.exp(memory)
        return speed, force / mass, -abs(v) / DISTANCE * np.log(ratio)

    begin = (LOAD * friction_by_hand(1e-3, 0.0, a, b, regularised) / stiffness, 0.0, 0.0)
    found = solve_ivp(rates, (0, times[-1]), begin, "LSODA", times, rtol=1e-11, atol=1e-15)
    return to - found.y[1], found.y[1]


@pytest.mark.parametrize("seed", [*range(8), *(pytest.param(n, marks=pytest.mark.campaign) for n in range(8, 60))])
def test_a_step_of_the_belt_leaves_the_block_its_velocity(seed):
    """It was the block whose velocity jumped, and the slip rate that went on."""
    rng = np.random.default_rng(seed)
    regularised = bool(seed % 2)
    own = {
        "mass": 10 ** rng.uniform(-1, 1), "stiffness": 10 ** rng.uniform(3.3, 4.3), "damping": rng.uniform(0, 20),
        "a": rng.uniform(0.008, 0.015), "b": rng.uniform(0.004, 0.008),
    }  # fmt: skip
    to = rng.choice([-2e-4, 3e-4]) if regularised and seed % 4 == 3 else 10 ** rng.uniform(-3.5, -2.5)
    machine = ss.rig_from_text(BELT.format(**own, regularised=str(regularised).lower()))
    period = 2 * np.pi * np.sqrt(own["mass"] / own["stiffness"])
    times = np.linspace(0, 2 * period, 40)
    run = ss.simulate(
        machine, ss.protocol.VelocityStep(at=START, to=to), times=START + times, rtol=1e-9, events=False,
        until=START + times[-1],
    )  # fmt: skip
    slip, speed = by_hand(times, to, **own, regularised=regularised)
    assert run["block.v"][0] == pytest.approx(0.0, abs=1e-12)
    size = np.max(np.abs(slip))
    np.testing.assert_allclose(run["c.slip_rate"], slip, atol=1e-5 * size)
    np.testing.assert_allclose(run["block.v"], speed, atol=1e-5 * size)


def test_slip_that_a_step_turns_round_needs_a_law_for_it():
    """ln v knows one way only; the regularised law goes on backwards, which the words say."""
    own = {"mass": 2.0, "stiffness": 5e3, "damping": 1.0, "a": 0.01, "b": 0.006}
    back = ss.protocol.VelocityStep(at=START, to=-1e-3)
    one_way, both_ways = (
        ss.simulate(ss.rig_from_text(BELT.format(**own, regularised=word)), back, until=2 * START)
        for word in ("false", "true")
    )
    assert one_way.status == "no velocity"
    assert "take a law that slides both ways (regularised = true)" in " ".join(str(one_way).split())
    assert both_ways.status == "done"
    assert both_ways["c.slip_rate"].min() < -9e-4
