"""Answers to inputs that swing: against transfer functions, closed forms of fast modulation, and SciPy."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss
from command import run

ROCK = {"a": 0.010, "b": 0.008, "d_c": 1e-5, "mu_ref": 0.6, "v_ref": 1e-5}
OSCILLATING = {  # amplitude, period: mean shear over mean normal stress, gain, phase in degrees
    (1e4, 3.0): (0.599998, 0.0986039, -108.112),
    (1e4, 10.0): (0.599996, 0.689867, -66.4816),
    (1e4, 100.0): (0.600000, 0.603783, -3.03887),
    (1e6, 3.0): (0.584806, 0.0644824, -98.2545),
    (1e6, 10.0): (0.583600, 0.259649, -68.7987),
    (1e6, 100.0): (0.599816, 0.603919, -3.27344),
}


def press(**law):
    rock = ss.RateState(**(ROCK | {"normal_memory": ss.LinkerDieterich(alpha=0.2)} | law))
    return ss.Slider(friction=rock, contact=ss.Constant(preload=25e6), stiffness=1e10, drive=ss.Steady(1e-5))


def test_an_oscillating_normal_stress():
    """Figures of an integration elsewhere, those that had settled."""
    found = ss.response(press(), [3.0, 10.0, 100.0], output="shear-stress", amplitudes=[1e4, 1e6])
    for (amplitude, period), (mean, gain, phase) in OSCILLATING.items():
        at = [*found.amplitudes].index(amplitude), [*found.periods].index(period)
        assert found.mean_friction[at] == pytest.approx(mean, rel=2e-6)
        assert found.gains[at] == pytest.approx(gain, rel=1e-5)
        assert found.phases[at] == pytest.approx(phase, rel=1e-4)


@pytest.mark.campaign
def test_a_fast_oscillation_is_waited_for():
    """After 20 periods of 1 s the motion still differs by 3e-3 from what it settles to; LSODA says what that is."""
    a, b, d_c, mu, v, alpha, sigma, k, size, period = 0.010, 0.008, 1e-5, 0.6, 1e-5, 0.2, 25e6, 1e10, 1e6, 1.0

    def rates(t, y):
        x, phi = y  # Φ = Θ + (α/b) ln σ is continuous
        normal = sigma + size * np.sin(2 * np.pi * t / period)
        theta = phi - alpha / b * np.log(normal / sigma)
        speed = v * np.exp(((mu * sigma - k * x) / normal - mu - b * theta) / a)
        return [speed - v, -speed / d_c * (np.log(speed / v) + theta)]

    times = period * (80 + np.arange(256) / 256)
    settled = solve_ivp(rates, (0, times[-1]), [0.0, 0.0], "LSODA", times, rtol=1e-11, atol=[1e-18, 1e-13])
    shear = mu * sigma - k * settled.y[0]
    first = 1j * np.fft.rfft(shear)[1] / 128 / size
    found = ss.response(press(), [period], output="shear-stress", amplitudes=[size])
    assert found.gains[0, 0] == pytest.approx(abs(first), rel=1e-6)
    assert found.phases[0, 0] == pytest.approx(np.degrees(np.angle(first)), rel=1e-6)
    assert found.mean_friction[0, 0] == pytest.approx(np.mean(shear) / sigma, rel=1e-7)


def test_small_amplitudes_answer_as_perfettini():
    """Theory 4: φ/ε = −s[(μ − α)s + μ]/[a s² + (κ − (b − a))s + κ], s in v/d_c, κ = k d_c/σ."""
    periods = np.logspace(-1, 3, 9)
    found = ss.response(press(), periods, output="v")
    s, kappa = 2j * np.pi / periods, 1e10 * 1e-5 / 25e6
    exact = -s * (0.4 * s + 0.6) / (0.010 * s**2 + (kappa + 0.002) * s + kappa) * 1e-5 / 25e6
    np.testing.assert_allclose(found.gain, np.abs(exact), rtol=1e-11)
    np.testing.assert_allclose(found.phase, np.degrees(np.angle(exact)), atol=1e-9)


@pytest.mark.parametrize(
    ("swings", "answers", "amplitude"),
    [("normal-stress", "v", 50.0), ("drive-velocity", "friction", 1e-10), ("push", "x", 50.0)],
)
def test_small_amplitudes_answer_as_the_transfer_function(swings, answers, amplitude):
    rig = press().with_values({"mass": 1e6, "damping": 1e9})
    periods = np.array([2.0, 20.0])
    found = ss.response(rig, periods, input=swings, output=answers, amplitudes=[amplitude], rtol=1e-12)
    name = {"normal-stress": "normal_disturbance", "drive-velocity": "load_velocity", "push": "disturbance"}[swings]
    exact = ss.to_control(rig, (answers,), (name,))(2j * np.pi / periods)
    np.testing.assert_allclose(found.gain, np.abs(exact), rtol=1e-10)
    np.testing.assert_allclose(found.gains[0], np.abs(exact), rtol=1e-6)
    np.testing.assert_allclose(found.phases[0], np.degrees(np.angle(exact)), rtol=1e-6)


@pytest.mark.parametrize(
    ("evolution", "drop"), [(ss.Aging(), -0.0034235), (ss.Slip(), -0.0075895)], ids=["aging", "slip"]
)
def test_fast_modulation_lowers_friction(evolution, drop):
    """Theory 4: a = .01, b = .015, μ = .6, ε = .02, much faster than d_c/v; here at 1/50 of that."""
    law = {"b": 0.015, "evolution": evolution, "normal_memory": ss.NoMemory()}
    rig = press(**law).with_values({"stiffness": 3e10})
    found = ss.response(rig, [0.02], output="shear-stress", amplitudes=[0.02 * 25e6])
    assert found.shift[0, 0] / 25e6 == pytest.approx(drop, rel=2e-3)


def test_what_cannot_swing_any_more():
    """Above its critical stiffness a weakening rig without mass is lost at some amplitude, and says from which."""
    rig = press(b=0.015, normal_memory=ss.NoMemory()).with_values({"stiffness": 1.3 * 12.5e9})
    found = ss.response(rig, [5.0], amplitudes=[1e5, 1.2e7], limits=True)
    assert found.status[0, 0] == "periodic"
    assert found.status[1, 0] != "periodic"
    assert np.isnan(found.gains[1, 0])
    assert 0 < found.linear_to[0] < found.lost_at[0] <= 1.2e7 * 1.06
    beside = ss.response(rig, [5.0], amplitudes=[found.lost_at[0] / 1.07, found.lost_at[0] * 1.01])
    assert beside.status[0, 0] == "periodic"
    assert beside.status[1, 0] in ("every 2nd period", "irregular", "blow-up")
    assert "lost from an amplitude of" in str(found)
    assert json.loads(json.dumps(found.to_dict()))["gains"][1] == [None]


def test_a_machine_of_one_body_answers_as_its_slider():
    friction = press().friction
    machine = ss.Machine(
        bodies={"block": ss.SlidingBody(mass=2e5)},
        links={"spring": ss.Spring(between=("drive", "block"), stiffness=1e10)},
        contacts={"face": ss.Surface(body="block", friction=friction, contact=ss.Constant(preload=25e6))},
        drive=ss.Pull(velocity=1e-5),
    )
    slider = press().with_values({"mass": 2e5})
    periods, amplitudes = [5.0, 20.0], [1e6]
    one = ss.response(slider, periods, output="shear-stress", amplitudes=amplitudes)
    other = ss.response(machine, periods, output="face.friction_force", amplitudes=amplitudes)
    assert other.input == "face.press"
    for name in ("gain", "phase", "gains", "phases", "shift", "distortion", "mean_friction"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-6)


def test_refusals():
    with pytest.raises(ss.UnknownNameError, match="unknown input 'heat'"):
        ss.response(press(), [1.0], input="heat")
    with pytest.raises(ss.UnknownNameError, match="unknown output"):
        ss.response(press(), [1.0], output="noise")
    with pytest.raises(ss.ParameterError, match="periods"):
        ss.response(press(), [2.0, 1.0])
    with pytest.raises(ss.ParameterError, match="amplitudes: got -1"):
        ss.response(press(), [1.0], amplitudes=[-1.0])
    with pytest.raises(ss.NotAvailable, match="nothing that an input of kind injection acts on"):
        ss.response(press(), [1.0], input="injection")


def test_the_command(tmp_path):
    """Text, columns and a picture, in the units that were asked for."""
    rig, table, picture = tmp_path / "press.toml", tmp_path / "bode.csv", tmp_path / "bode.svg"
    ss.write_rig(press(), rig)
    words = ["response", str(rig), "--output", "friction", "--periods", "1s", "100s", "--points", "5"]
    found = run(*words, "--amplitude", "1 MPa", "-o", str(table), "-o", str(picture))
    assert "friction under normal_disturbance" in found.stdout
    assert "amplitude 1 MPa" in found.stdout
    lines = table.read_text().splitlines()
    assert lines[0].startswith("amplitude (Pa),period (s),gain (1/(Pa)),")
    assert len(lines) == 11
    assert picture.read_text().startswith("<?xml")
    wrong = run(*words, "--amplitude", "1 mm")
    assert (wrong.returncode, "--amplitude" in wrong.stderr) == (2, True)
