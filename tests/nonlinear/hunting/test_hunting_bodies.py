"""What is told of which body of a machine that hunts, by SciPy; and both sides of a cycle."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss

TELESCOPE = """
[bodies.motor]
motion = "rotation"
inertia = "1.8 kg cm^2"
[bodies.mount]
motion = "rotation"
inertia = "1400 kg m^2"
[links.worm]
kind = "shaft"
between = ["motor", "mount"]
gear = "1/360"
stiffness = "928200 N m/rad"
damping = "4e3 N m s/rad"
[contacts.azimuth]
body = "mount"
radius = "450 mm"
[contacts.azimuth.friction]
law = "lugre"
mu_coulomb = 0.006
mu_static = 0.011
v_stribeck = "0.3 mm/s"
bristle_stiffness = "200 N/um at 28 kN"
bristle_damping = "2 s/m"
viscous = "0.1 s/m"
[contacts.azimuth.contact]
law = "constant"
preload = "28 kN"
[drive]
control = "rotary-pid"
velocity = 0
body = "motor"
kp = "0.8 N m/rad"
ki = "1 N m/(rad s)"
kd = "0.02 N m s/rad"
"""


@cache
def found():
    return ss.hunt(ss.rig_from_text(TELESCOPE))


def by_scipy(step, until):
    """Times, and errors of motor and mount (rad), written by hand."""
    ratio, radius, load = 1 / 360, 0.45, 28e3
    bristles = 200e6 / load

    def rates(t, y):
        held, motor, fast, mount, slow, bent = y
        v = slow * radius
        most = 0.006 + 0.005 * np.exp(-((v / 0.3e-3) ** 2))
        bends = v - bristles * abs(v) * bent / most
        friction = load * (bristles * bent + 2 * bends + 0.1 * v)
        shaft = 928200 * (ratio * motor - mount) + 4e3 * (ratio * fast - slow)
        force = 0.8 * (step - motor) - 0.02 * fast + held
        return [step - motor, fast, (force - ratio * shaft) / 1.8e-4, slow, (shaft - radius * friction) / 1400, bends]

    # the integral gain is 1 N m/(rad s)
    run = solve_ivp(rates, (0, until), [0.0] * 6, method="LSODA", rtol=1e-8, atol=1e-12, max_step=5e-3)
    return run.t, run.y[1] - step, run.y[3] - step * ratio


def test_motor_and_mount_swing_as_by_scipy():
    """The mount swings less than the motor over the gear, which winds the worm up."""
    hunt = found()
    time, motor, mount = by_scipy(hunt.protocol.pieces[0].by, 55.0)
    late = time > 35
    (other,) = hunt.others
    assert (other.body, other.unit) == ("mount", "rad")
    for low, high, swing in ((hunt.lowest, hunt.highest, motor), (other.lowest, other.highest, mount)):
        assert [low, high] == pytest.approx([swing[late].min(), swing[late].max()], rel=2e-4)  # SciPy's is settling
    assert abs(other.highest) < 0.98 * abs(hunt.highest) / 360
    assert hunt.sentence == (
        f"HUNTS ±{np.degrees(hunt.highest):.4g} deg at motor (±{np.degrees(other.highest):.4g} deg at mount) "
        f"about the target every {hunt.period:.4g} s"
    )


@pytest.mark.parametrize(("until", "rtol"), [(None, 1e-10), (None, 1e-7), (60.0, 1e-8), (73.1, 1e-8), (74.6, 1e-8)])
def test_sides_of_a_cycle_agree_whenever_the_motion_ends(until, rtol):
    """It ended where a stroke came to rest, before its bristles and worm had given: -13.84 to 13.86 deg was told."""
    hunt = ss.hunt(ss.rig_from_text(TELESCOPE), until=until, rtol=rtol)
    assert [-hunt.lowest, hunt.highest] == pytest.approx([found().highest] * 2, rel=1e-4)  # some still settle
    assert hunt.sentence.startswith("HUNTS ±13.86 deg at motor")


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ('measured = "mount"', r"±[\d.]+ deg at motor by the place of mount \(±[\d.]+ deg at mount\) about"),
        ('velocity_of = "mount"', r"±0.03851 deg at mount by the place of motor \(itself ±0.03724 deg\) about"),
    ],
)
def test_a_body_that_is_told_by_the_place_of_another_is_so_named(key, words):
    assert re.search(words, ss.hunt(ss.rig_from_text(f"{TELESCOPE}{key}\n")).sentence)


def test_sides_that_differ_are_both_told_unless_strokes_of_one_side_differ_as_much():
    hunt = replace(found(), lowest=-0.2, others=())
    assert hunt.sentence.startswith("HUNTS from -11.46 deg to 13.86 deg at motor about")
    assert replace(hunt, scatter=0.05).sentence.startswith("HUNTS ±13.86 deg at motor about")


def test_what_hangs_on_a_soft_gear_rests_off_the_target():
    """2.5 kN m twist the worm, less or more what friction holds; the encoder at the motor does not see it."""
    text = TELESCOPE.replace('"1400 kg m^2"', '"1400 kg m^2"\ntorque = "-2.5 kN m"').replace("0.011", "0.006")
    hunt = ss.hunt(ss.rig_from_text(text.replace('kd = "0.02', 'kd = "0.2')))
    (mount,) = hunt.others
    assert mount.lowest == mount.highest < 0
    assert -mount.lowest * 928200 == pytest.approx(2500, abs=0.006 * 28e3 * 0.45)
    off = f"{np.degrees(-mount.lowest):.4g}"
    assert hunt.sentence.startswith(f"SETTLES on the target at motor ({off} deg off it at mount) after")


def test_figures_and_tables_name_the_body_and_the_torque(tmp_path):
    labels = [axes.get_ylabel() for axes in found().plot()]
    assert labels == ["target minus position at motor (deg)", "torque of the drive (mN m)"]
    found().to_csv(tmp_path / "run.csv")
    head = (tmp_path / "run.csv").read_text().partition("\n")[0]
    assert head == "time (s),target minus position at motor (rad),speed (rad/s),torque of the drive (N m)"
