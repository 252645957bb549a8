"""Motion under protocols: normal stress that changes, breakpoints, tables, and times that are asked for."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import steadyslip as ss
from dimensionless import MU, A, phi_of, unit_rig
from rigs_of_theory import ONE_MEMORY, rig


@pytest.mark.parametrize(("evolution", "shift"), [("aging", -0.0034235), ("slip", -0.0075895), ("prz", None)])
def test_fast_modulation_lowers_friction(evolution, shift):
    """Theory 4: mean shear stress under fast oscillation of normal stress; a = .01, b = .015, μ = .6, ε = .02."""
    a, b, mu, eps = A, 0.015, MU, 0.02

    def mean(function):
        return quad(lambda c: function((t_of[0] / (1 + eps * np.cos(c)) - mu) / a), 0, np.pi)[0] / np.pi

    t_of = [mu]
    if evolution == "prz":

        def closure(t):
            t_of[0] = t
            # φ = [T/(1+ε cos) − μ − bϑ]/a with <e^φ> = 1 and ϑ = −½ ln <e^2φ>
            first, second = mean(np.exp), mean(lambda z: np.exp(2 * z))
            theta = a / b * np.log(first)
            return theta + 0.5 * np.log(second / first**2)

        shift = brentq(closure, mu - 0.02, mu) - mu
    a_rig = unit_rig(evolution, b / a - 1, 3.0)
    period = 2e-3
    wave = ss.protocol.NormalStressHarmonic(amplitude=eps, period=period, phase=np.pi / 2)
    run = ss.simulate(a_rig, wave, until=30.0, times=np.linspace(30 - period, 30, 9), events=False)
    assert run["spring_stress"].mean() - mu == pytest.approx(shift, abs=2e-6)


@pytest.mark.parametrize("memory", [0.0, 0.3])
def test_response_to_a_small_oscillation_of_normal_stress(memory):
    """Theory 4 (Perfettini et al. 2001): amplitude and phase of ln v, at and off resonance."""
    lam, kappa, eps = 0.5, 0.012, 1e-5
    friction = {"normal_memory": ss.laws.LinkerDieterich(alpha=memory)} if memory else {}
    a_rig = unit_rig("slip", lam, kappa / A, **friction)
    for period in (2 * np.pi * np.sqrt(A / kappa), 3.0):
        s = 2j * np.pi / period
        gain = -s * ((MU - memory) * s + MU) / (A * s**2 + (kappa - lam * A) * s + kappa)
        wave = ss.protocol.NormalStressHarmonic(amplitude=eps, period=period)
        times = 60 * period + np.linspace(0, period, 33)[:-1]
        run = ss.simulate(a_rig, wave, until=61 * period, times=times, events=False, rtol=1e-10)
        angle = 2 * np.pi * times / period
        amplitude = 2 * np.mean(phi_of(run) * np.exp(-1j * (angle - np.pi / 2)))
        assert amplitude / eps == pytest.approx(gain, rel=2e-3)


def test_step_of_normal_stress_is_exact():
    """A jump moves Θ by −(α/b) ln(σ2/σ1), leaves x, and τ = T at the new velocity."""
    a_rig = rig(friction=ONE_MEMORY[1], stiffness=2e10)
    run = ss.simulate(a_rig, ss.protocol.NormalStressStep(at=1.0, by=5e5), until=2.0)
    before, after = np.flatnonzero(run["t"] == 1.0)
    change = run["Theta"][after] - run["Theta"][before]
    assert change == pytest.approx(-0.4 / 0.016 * np.log(5.5 / 5), rel=1e-12)
    assert run["x"][after] == run["x"][before]
    assert run["Psi"][after] == pytest.approx(run["Psi"][before], rel=1e-14)
    assert run["shear_stress"][after] == run["spring_stress"][after]
    assert run["normal_stress"][after] - run["normal_stress"][before] == pytest.approx(5e5)


def test_every_breakpoint_is_a_step_of_the_solver():
    protocol = [
        ss.protocol.Hold(at=1.0, duration=2.0),
        ss.protocol.VelocityRamp(at=4.0, to=3e-6, duration=0.5),
        ss.protocol.DisplacementStep(at=5.25, by=1e-8),
        ss.protocol.NormalStressPulse(at=6.0, by=1e5, duration=0.125),
        ss.protocol.DisturbancePulse(at=7.0, by=1e4, duration=0.3),
    ]
    run = ss.simulate(rig(stiffness=2e10), protocol, until=8.0)
    for moment in (1.0, 3.0, 4.0, 4.5, 5.25, 6.0, 6.125, 7.0, 7.3):
        assert np.sum(np.abs(run["t"] - moment) < 1e-12) == 2, moment
    assert np.all(np.diff(run["t"]) >= 0)
    held = (run["t"] > 1.0) & (run["t"] < 3.0)
    assert np.all(run["load_velocity"][held] == 0)
    assert np.all(np.diff(run["v"][held]) < 0)


def test_breakpoints_where_nothing_happens_change_nothing():
    a_rig = rig(stiffness=9e9)
    plain = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=20.0, rtol=1e-10)
    idle = [ss.protocol.DisturbancePulse(at=t, by=0.0, duration=0.01) for t in (0.5, 3.3, 7.7, 12.0)]
    split = ss.simulate(a_rig, [ss.protocol.VelocityStep(at=1.0, to=2e-6), *idle], until=20.0, rtol=1e-10)
    assert split["v"][-1] == pytest.approx(plain["v"][-1], rel=1e-8)


def test_a_table_of_the_load_point_is_followed_exactly():
    """A sampled ramp is the same motion as the ramp of displacement it samples, however it is sampled."""
    random = np.random.default_rng(3)
    time = np.unique(np.concatenate([[0.0, 1.0], random.uniform(0, 6, 200), [6.0]]))
    displacement = 1e-6 * time + 2e-6 * np.maximum(time - 1.0, 0.0)
    a_rig = rig(stiffness=1.2e10)
    table = ss.simulate(a_rig, ss.protocol.LoadPointTable(time=time, displacement=displacement), until=6.0, rtol=1e-10)
    step = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=3e-6), until=6.0, rtol=1e-10)
    assert table["v"][-1] == pytest.approx(step["v"][-1], rel=1e-7)
    assert table["load_displacement"][-1] == pytest.approx(displacement[-1], rel=1e-12)


def test_slip_is_that_of_the_load_point_plus_x():
    protocol = [
        ss.protocol.DisplacementStep(at=1.0, by=2e-7),
        ss.protocol.VelocityHarmonic(amplitude=5e-7, period=1.7, at=0.4),
    ]
    run = ss.simulate(rig(stiffness=2e10), protocol, until=5.0, times=np.linspace(0, 5, 4001), rtol=1e-10)
    velocity = 0.5 * (run["v"][1:] + run["v"][:-1])
    slip = np.concatenate([[0], np.cumsum(np.diff(run["t"]) * velocity)])
    assert np.max(np.abs(slip - run["slip"])) < 2e-5 * run["slip"][-1]
    assert run["spring_stress"] == pytest.approx(run["spring_stress"][0] - 2e10 * run["x"], rel=1e-12)


def test_requested_times_agree_with_the_solver_s_own():
    a_rig = rig(stiffness=9e9)
    own = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9)
    asked = ss.simulate(
        a_rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9, times=np.unique(own["t"])
    )
    last = dict(zip(own["t"], own["v"], strict=True))  # after a jump
    assert asked["v"] == pytest.approx(np.array([last[t] for t in asked["t"]]), rel=1e-9)
    between = np.linspace(0, 10, 777)
    dense = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9, times=between)
    tight = ss.simulate(a_rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-12, times=between)
    assert dense["v"] == pytest.approx(tight["v"], rel=1e-6)
