"""Hunting under a sampled controller, by the compiled core: a second route by hand, long motions, bounds."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from hunting_by_scipy import RINGING, SAMPLED, axis, sampled, sampled_at_random
from steadyslip.nonlinear.hunting.in_mode import CompiledMotion

EXAMPLES = Path(__file__).parents[3] / "examples"
THEORY = {"mass": 1.0, "rest": 1.5, "sliding": 1.0, "viscous": 0.4, "kp": 3.0, "kd": 6.0, "ki": 4.0}
BRISTLES = (1e3, 30.0, 5e-3)
FINE = {"sample_time": 1e-3, "resolution": 1e-6, "derivative": "measurement"}


@pytest.mark.parametrize("kind", SAMPLED)
def test_a_sampled_controller_is_that_of_a_simulation_by_hand(kind):
    """Viscous friction of a load that is felt in motion is integrated, all else is exact."""
    assert sampled(THEORY, SAMPLED[kind], 0.05, 60.0, rtol=1e-10)[0] < 1e-9


@pytest.mark.parametrize("kind", SAMPLED)
def test_bristles_under_a_sampled_controller_are_those_of_scipy(kind):
    """SciPy's route allows 1e-10 a step, of 60 spans that each begin anew; the other 1e-10 as well."""
    assert sampled(THEORY, SAMPLED[kind], 0.05, 3.0, BRISTLES, rtol=1e-10)[0] < 1e-7


@pytest.mark.campaign
@pytest.mark.parametrize("bristles", [False, True])
@pytest.mark.parametrize("kind", SAMPLED)
def test_random_sampled_axes_are_those_of_a_simulation_by_hand(kind, bristles):
    found = [sampled_at_random(np.random.default_rng([4, i]), kind, bristles) for i in range(4 if bristles else 20)]
    assert max(found) < (1e-6 if bristles else 1e-10)


@pytest.mark.parametrize("bristles", [False, True])
def test_a_fine_encoder_and_short_samples_are_the_continuous_controller(bristles):
    """1 ms and 1 um: 270 000 samples, and the cycle of theory 14 within what such samples change."""
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml") if bristles else axis(**THEORY)
    one = ss.hunt(replace(held, drive=replace(held.drive, derivative="measurement")))
    two = ss.hunt(replace(held, drive=replace(held.drive, **FINE)))
    assert two.hunts
    assert not two.repeats
    assert two.time[-1] / 1e-3 > 2e5
    assert two.period == pytest.approx(one.period, rel=2e-3)
    assert two.highest == pytest.approx(one.highest, rel=3e-3)
    assert two.fastest == pytest.approx(one.fastest, rel=1e-3)
    assert len(two.time) < 5e5  # at rest not every sample is kept


@pytest.mark.parametrize("friction", ["coulomb", "lugre"])
def test_a_machine_moves_in_the_core_as_step_by_step(friction, monkeypatch):
    """The same pieces and switches, sample by sample from outside: with a dead time that is no multiple of them."""
    text = RINGING.replace('ki = "50', 'sample_time = "4 ms"\ndelay = "5 ms"\nderivative = "measurement"\nki = "50')
    if friction == "lugre":
        more = 'law = "lugre"\nv_stribeck = "80 mm/min"\nviscous = "1 s/m"\nbristle_stiffness = "1e5 1/m"'
        text = text.replace('law = "coulomb"', more)
    rig = ss.rig_from_text(text)
    one = ss.hunt(rig, until=0.6)
    follow = CompiledMotion.follow
    monkeypatch.setattr(CompiledMotion, "follow", lambda self, *given: follow(self, *given[:-1], True))
    two = ss.hunt(rig, until=0.6)
    assert len(one.strokes) == len(two.strokes) > 1
    starts, ends = ([[getattr(stroke, name) for stroke in found.strokes] for found in (one, two)]
                    for name in ("start", "ends"))  # fmt: skip
    assert starts[0] == pytest.approx(starts[1], rel=1e-7)
    assert ends[0] == pytest.approx(ends[1], abs=1e-7 * np.abs(one.error).max(), nan_ok=True)


def test_an_axis_whose_strokes_shrink_at_first_is_followed_until_they_do_not():
    """After 12 strokes, "SETTLES: ... in ever smaller strokes" was told; it hunts on for as long as one looks."""
    held = ss.rig_from_text("""
    friction = {law = "coulomb", mu_coulomb = 0.11, mu_static = 0.19, viscous = "0.1 s/m"}
    contact = {law = "constant", preload = "3.2 kN"}
    slider = {area = "200 cm^2", mass = "240 kg", damping = "1 N s/mm"}
    [drive]
    control = "pid"
    velocity = 0
    kp = "12 N/um"
    kd = "50 N s/mm"
    ki = "200 N/um/s"
    sample_time = "1 ms"
    resolution = "1 um"
    derivative = "measurement"
    """)
    short, long = ss.hunt(held), ss.hunt(held, until=60.0)
    assert short.hunts
    assert long.hunts
    assert short.highest == pytest.approx(long.highest, rel=0.1)
    assert short.period == pytest.approx(long.period, rel=0.02)


def test_a_sampled_axis_with_an_encoder_is_told_by_its_average():
    """Its strokes never repeat themselves: they end when the controller samples."""
    found = ss.hunt(axis(**THEORY, sample_time=0.01, resolution=1e-3, derivative="measurement"))
    assert found.hunts
    assert len(found.strokes) == pytest.approx(24, abs=2)
    assert found.highest == pytest.approx(0.0657, rel=0.05)
    assert re.fullmatch(r"HUNTS .* about the target every 2[34]\.\d+ s( on average)?", found.sentence)


@pytest.mark.parametrize("bristles", [False, True])
def test_work_in_the_core_is_bounded_and_said(bristles, monkeypatch):
    monkeypatch.setattr(sys.modules["steadyslip.nonlinear.hunting.hunt"], "IN_CORE", 5000)
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml") if bristles else axis(**THEORY)
    found = ss.hunt(replace(held, drive=replace(held.drive, **FINE)))
    assert found.stopped
    assert found.sentence.startswith("NOT DECIDED by ")
    less = " or rtol, or law = 'coulomb' with mu_static," if bristles else ""
    assert f"the limit of steps was reached; a larger sample_time{less} takes fewer" in str(found)


def held(text, **values):
    """The machine at velocity 0 under a proportional controller, with these keys in its drive."""
    head, _, _ = text.partition("[drive]")
    keys = "".join(f"{key} = {value}\n" for key, value in values.items())
    return ss.rig_from_text(f"{head}[drive]\nvelocity = 0\nsample_time = '1 ms'\n{keys}")


@pytest.mark.parametrize("measured", ["table", "motor"])
def test_a_controller_sees_multiples_of_the_step_at_the_body_that_it_measures(measured):
    """1 um of the table are .036 degrees of the motor: forces of a proportional gain are in steps of either."""
    rig = held(
        RINGING, control="'rotary-pd'", body="'motor'", measured=f"'{measured}'", kp="'5 N m/rad'",
        kd="'0.2 N m s/rad'", resolution="'1 um'" if measured == "table" else "'0.036 deg'",
    )  # fmt: skip
    rig = replace(rig, drive=replace(rig.drive, kd=0.0))
    found = ss.hunt(rig, ss.protocol.DisplacementStep(at=0, by=2.0), until=0.2)
    step = np.deg2rad(0.036)
    seen = (2.0 - found.force / 5.0) / step
    assert np.ptp(seen) > 100
    assert np.abs(seen - np.round(seen)).max() < 1e-6
    assert ("encoder         1 um of table, 0.036 deg of motor\n" in str(found)) == (measured == "table")


@pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")  # no scale has a step of a metre
def test_a_speed_that_is_measured_elsewhere_is_not_rounded():
    """A scale of a step that the table never makes: the speed of the motor is still felt."""
    rig = held(RINGING, control="'rotary-p-pi'", body="'motor'", measured="'table'", kv="'30 1/s'",
               kp="'0.2 N m s/rad'", tn="'20 ms'", resolution="'1 m'")  # fmt: skip
    found = ss.hunt(rig, ss.protocol.DisplacementStep(at=0, by=2.0), until=0.05)
    forces = found.force[np.flatnonzero(np.diff(found.force))]
    assert len(forces) > 20
    assert np.abs(np.diff(forces, 2)[2:]).max() > 1e-3  # an integral of an error that stays grows evenly


@pytest.mark.parametrize(("derivative", "sample"), [("error", ""), ("measurement", ""), ("measurement", "0.01 ms")])
def test_a_step_of_the_target_does_not_kick_a_cascade_of_the_measurement(derivative, sample):
    """F = Kp (Kv x_e + ∫ v_e dt / Tn): with the jump of the target in that integral it hunted where it settles."""
    drive = {"control": "rotary-p-pi", "body": "motor", "velocity": "0", "kv": "30 1/s", "kp": "2 N m s/rad",
             "tn": "20 ms", "derivative": derivative} | ({"sample_time": sample} if sample else {})  # fmt: skip
    lines = (f"{key} = {value if key == 'velocity' else repr(value)}" for key, value in drive.items())
    rig = ss.rig_from_text("\n".join([RINGING.partition("[drive]")[0], "[drive]", *lines]))
    found = ss.hunt(rig, ss.protocol.DisplacementStep(at=0.0, by=1e-4), until=2e-3)
    after = np.interp(1e-4, found.time, found.force)
    assert after == pytest.approx(2 * (30 + (1 / 0.02 if derivative == "error" else 0.0)) * 1e-4, rel=0.1)


def test_an_axis_that_creeps_to_its_target_is_told_to_end_there():
    """It "settles: within 13.93 mm of the target by 31.69 yr", and was there to 14 digits."""
    found = ss.hunt(ss.read_rig("examples/hunting-axis.toml", ["friction.mu_static=1"]))
    assert found.sentence.startswith("SETTLES on the target, within ")
    late = np.abs(found.error[found.time >= found.approached_at])
    assert late.max() <= max(abs(found.lowest), abs(found.highest)) * (1 + 1e-6)
    assert found.approached_at < 1e3 < found.time[-1]
    assert ss.figures.hunting(found)[0].get_xlim()[1] < 1e3
