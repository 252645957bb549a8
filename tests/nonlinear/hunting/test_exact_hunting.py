"""Hunting with Coulomb friction: theory 14, a second route, limits."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run as command
from hunting_by_scipy import axis, by_hand, compared, lugre_starts
from steadyslip.protocol import DisplacementStep

EXAMPLES = Path(__file__).parents[3] / "examples"
THEORY = {"mass": 1.0, "rest": 1.5, "sliding": 1.0, "viscous": 0.4, "kp": 3.0, "kd": 6.0, "ki": 4.0}


def test_the_cycle_of_theory_14():
    found = ss.hunt(axis(**THEORY))
    assert found.hunts
    assert found.repeats
    assert found.exact
    assert found.every == pytest.approx(12.00651936, abs=5e-9)
    assert found.highest == pytest.approx(0.06565304, abs=5e-9)
    assert found.lowest == pytest.approx(-found.highest, rel=1e-9)
    assert found.period == pytest.approx(2 * found.every, rel=1e-9)
    assert found.sentence == "HUNTS ±65.65 mm about the target every 24.01 s"


@pytest.mark.parametrize("until", [30.0, 60.0, 80.0, 100.0])
def test_strokes_that_shrink_towards_a_cycle_are_not_told_to_settle(until):
    """Wherever the motion of an axis that hunts is cut; a later and larger step acts as one at the beginning does."""
    for at in (0.0, 1.0):
        assert ss.hunt(axis(**THEORY), DisplacementStep(at=at, by=1.0), until=until).hunts is not False
    assert ss.hunt(axis(**THEORY), DisplacementStep(at=1.0, by=1.0)).sentence.startswith("HUNTS ±65.65 mm")


def test_an_axis_that_slides_ever_slower_to_its_target_settles():
    """Coulomb friction is constant in sliding: with real roots the last stroke only creeps, and sticks nowhere."""
    held = {**THEORY, "kp": 9.0, "ki": 1.0}
    slowest = -np.roots([1.0, held["kd"] + held["viscous"], held["kp"], held["ki"]]).max()
    assert np.isreal(slowest)
    found = ss.hunt(axis(**held))
    assert found.hunts is False
    assert max(found.highest, -found.lowest) <= 1e-9 * np.abs(found.error).max()
    last = found.time > 0.9 * found.time[-1]
    assert -np.polyfit(found.time[last], np.log(np.abs(found.error[last])), 1)[0] == pytest.approx(slowest, rel=1e-5)


@pytest.mark.campaign
def test_the_bristle_cycle_of_theory_14():
    """To the digits printed. A stroke starts where the speed passes v_stribeck, 1 mm/s; theory's first gap, 5 mm/s.

    Only the first gap tells the two: the step starts the first stroke at once, the others creep.
    """
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml", ["friction.bristle_damping=316.22776601683796 s/m"])
    found = ss.hunt(held, DisplacementStep(at=0, by=1.0), until=200.0, rtol=1e-11)
    assert found.every == pytest.approx(12.21839323, abs=5e-9)
    assert found.period == pytest.approx(24.43679, abs=5e-6)
    assert [found.lowest, found.highest] == pytest.approx([-0.06390251, 0.06390251], abs=5e-9)
    assert found.fastest == pytest.approx(0.077744540, abs=1e-9)
    gaps = np.diff([one.start for one in found.strokes])[:4]
    slow, fast = (np.diff(starts) for starts in lugre_starts((1e-3, 5e-3), 40.0))
    assert gaps == pytest.approx(slow, abs=1e-5)
    assert fast == pytest.approx([4.676, 6.384, 8.762, 11.348], abs=5e-4)


@pytest.mark.parametrize("seed", range(6))
def test_strokes_are_those_of_scipy(seed):
    assert compared(np.random.default_rng([7, seed])) < 1e-9


@pytest.mark.campaign
def test_strokes_of_two_hundred_axes_are_those_of_scipy():
    assert max(compared(np.random.default_rng([1, i])) for i in range(200)) < 1e-9


def test_scales_of_length_and_time_and_force_change_nothing():
    """Lengths times L, times times T, masses times M: the same motion."""
    far, slow, heavy = 1e-4, 0.3, 70.0
    force = heavy * far / slow**2
    other = axis(
        mass=heavy, rest=1.5 * force, sliding=force, viscous=0.4 * heavy / slow, kp=3 * heavy / slow**2,
        kd=6 * heavy / slow, ki=4 * heavy / slow**3,
    )  # fmt: skip
    one, two = ss.hunt(axis(**THEORY)), ss.hunt(other)
    assert two.every == pytest.approx(slow * one.every, rel=1e-9)
    assert two.highest == pytest.approx(far * one.highest, rel=1e-9)
    assert len(two.strokes) == len(one.strokes)


def test_without_integral_it_rests_where_friction_holds():
    found = ss.hunt(axis(**THEORY | {"ki": 0.0}))
    assert found.hunts is False
    assert abs(found.error[-1]) * 3.0 <= 1.5
    assert found.sentence == "SETTLES within 333.3 mm of the target after 41.4 s"  # it creeps up to Coulomb friction


def test_a_stiff_controller_stops_at_a_time():
    found = ss.hunt(axis(**THEORY | {"ki": 0.0, "kd": 1.0}))
    assert found.hunts is False
    assert found.settled_at == found.strokes[-1].end
    assert abs(found.error[-1]) * 3.0 <= 1.5


def test_a_step_that_friction_holds_makes_no_stroke():
    found = ss.hunt(axis(**THEORY | {"ki": 0.0}), DisplacementStep(at=0, by=0.49))
    assert found.hunts is False
    assert found.strokes == ()
    assert found.highest == pytest.approx(-0.49)


@pytest.mark.parametrize("bristles", [False, True])
def test_a_force_limit_below_friction_at_rest_leaves_the_axis_where_it_is(bristles):
    """The integral winds up without end behind the limit; the axis never starts, and just above the limit it hunts."""
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml") if bristles else axis(**THEORY)
    found = ss.hunt(held.with_values({"drive.force_limit": 1.2}))
    assert found.hunts is False
    assert found.highest == pytest.approx(found.lowest)
    assert abs(found.lowest) > 0.9
    assert ss.hunt(held.with_values({"drive.force_limit": 1.6})).hunts


def test_friction_as_large_at_rest_does_not_hunt():
    found = ss.hunt(axis(**THEORY | {"rest": 1.0}), until=600.0)
    assert found.hunts is False
    reach = [abs(one.ends) for one in found.strokes]
    assert reach[-1] < 0.2 * reach[1]


def test_energy_is_what_the_controller_gives_less_friction():
    """Over one stroke: the work of the force is friction's and viscosity's, as it begins and ends at rest."""
    found = ss.hunt(axis(**THEORY))
    at = (found.time >= found.strokes[-1].start) & (found.time <= found.strokes[-1].end)
    t, v, u = (np.concatenate(([part[at][0]], part[at])) for part in (found.time, found.velocity, found.force))
    lost = 1.0 * abs(found.strokes[-1].ends - found.strokes[-1].begins)
    given = np.trapezoid(u * v, t) - np.trapezoid(0.4 * v**2, t)
    assert given == pytest.approx(lost, rel=2e-3)  # trapezoids over a hundred samples


BY_HAND = {"force_limit": "force", "integral_limit": "integral_limit", "dead_band": "band"}


@pytest.mark.parametrize("sampled", [{}, {"sample_time": 0.05}], ids=["continuous", "sampled"])
def test_a_motion_that_is_cut_short_says_what_it_did_so_far(sampled):
    ends = {
        until: ss.hunt(axis(**THEORY, **sampled), DisplacementStep(at=0, by=1.0), until=until)
        for until in (0.5, 6.0, 30.0)
    }
    assert [one.hunts for one in ends.values()] == [None] * 3
    assert re.fullmatch(r"NOT DECIDED by 500 ms: it is [\d.]+ m+ from the target, still on.*", ends[0.5].sentence)
    assert re.search(r"6 s: so far it has made one stroke of [\d.]+ m+, and is [\d.]+ m+ from", ends[6.0].sentence)
    assert re.search(
        r"made \d strokes, the last of [\d.]+ m+, [\d.]+ s after the one before, and is", ends[30.0].sentence
    )


@pytest.mark.parametrize("sampled", [{}, {"sample_time": 0.05}], ids=["continuous", "sampled"])
def test_a_target_that_steps_while_the_axis_rests_is_followed(sampled):
    """It was told to rest where it was before the second step."""
    held = axis(**THEORY | {"ki": 0.0, "kd": 1.0}, **sampled)
    steps = [DisplacementStep(at=0, by=1.0), DisplacementStep(at=60.0, by=1.0)]
    found = ss.hunt(held, steps)
    assert found.hunts is False
    assert found.strokes[-1].start == pytest.approx(60.0, abs=0.05)
    assert abs(found.error[-1]) < 0.5


LIMITED = {
    "none": {},
    "of the force": {"force_limit": 1.8},
    "of the integral": {"force_limit": 1.8, "integral_limit": 1.6},
    "a dead band": {"dead_band": 0.02},
    "a dead band of the integral": {"dead_band": 0.02, "dead_band_of": "integral"},
}


@pytest.mark.parametrize("more", LIMITED.values(), ids=LIMITED)
def test_a_controller_without_samples_is_the_limit_of_short_ones(more):
    """Places at the ends of strokes, extrapolated from two sample times: their difference is of first order."""
    numbers = {name: more[key] for key, name in BY_HAND.items() if key in more}
    held = axis(**THEORY, derivative="measurement", **more)
    found = [one for one in ss.hunt(held, DisplacementStep(at=0, by=1.0), until=30.0).strokes if one.end < 29.0]
    short, shorter = (
        np.array([places[round((one.end + 0.2) / sample)] for one in found])
        for sample in (4e-3, 2e-3)
        for places in [by_hand(1.0, 30.0, **THEORY, sample=sample, on_measurement=True,
                               of_integral="dead_band_of" in more, **numbers)]
    )  # fmt: skip
    assert len(found) >= 3
    ours = np.array([1 - one.ends for one in found])
    assert np.abs(short - ours).max() < 3e-3
    assert 2 * shorter - short == pytest.approx(ours, abs=3e-4)


def test_the_usual_step_is_a_round_number():
    assert [one.by for one in ss.hunt(ss.read_rig(EXAMPLES / "hunting-axis.toml"), until=0.01).protocol.pieces] == [1.0]


def test_bristles_that_creep_to_the_target_settle():
    """The integral brings them there; it was run on for 31 years, and the last of nine strokes told as hunting."""
    axis = ss.rig_from_text("""
    contact = {law = "constant", preload = "3.2 kN"}
    slider = {area = "200 cm^2", mass = "240 kg", stiffness = "12 N/um", damping = "5 N s/mm"}
    drive = {control = "pid", velocity = 0, kp = "12 N/um", kd = "5 N s/mm", ki = "20 N/um/s"}
    [friction]
    law = "lugre"
    mu_coulomb = 0.11
    mu_static = 0.19
    v_stribeck = "8 mm/min"
    viscous = "1.25 s/m"
    bristle_stiffness = 125000
    """)
    found = ss.hunt(axis)
    assert found.hunts is False
    assert found.sentence == f"SETTLES on the target after {found.settled_at:.1f} s"
    late = found.time > 0.5 * found.settled_at
    assert np.abs(found.error[late]).max() < 1e-3 * np.abs(found.error).max()
    assert found.settled_at == found.time[-1] < 60.0


def test_an_axis_that_friction_holds_where_it_is_is_told_so():
    """A limit of 1 N below friction at rest of 1.5 N: "SETTLES within 1 m after 0 s" was told."""
    law = ss.laws.Coulomb(mu_coulomb=1.0, mu_static=1.5)
    rig = replace(ss.read_rig(EXAMPLES / "hunting-axis.toml", ["drive.force_limit=1 N"]), friction=law)
    found = ss.hunt(rig)
    assert found.hunts is False
    assert found.sentence == "DOES NOT MOVE: friction at rest holds it 1 m from the target"


def test_bristles_without_an_integral_slide_before_they_rest():
    """At a step of the target all speeds are zero, which was told as rest: "SETTLES within 1 m after 0 s"."""
    found = ss.hunt(ss.read_rig(EXAMPLES / "hunting-axis.toml", ["drive.ki=0 N/(m s)"]))
    assert found.hunts is False
    assert found.settled_at > 1.0
    assert max(abs(found.lowest), abs(found.highest)) < 1.5 / 3.0  # what friction at rest holds, over the gain


def test_the_motion_is_written_as_columns_document_and_figure(tmp_path):
    held = EXAMPLES / "hunting-axis.toml"
    names = [tmp_path / f"hunt{ending}" for ending in (".csv", ".html", ".svg")]
    told = command("hunt", held, "--until", "9 s", *(word for name in names for word in ("-o", name)))
    assert told.stdout.splitlines()[-3:] == [f"wrote {name}" for name in names]
    found = ss.hunt(ss.read_rig(held), until=9.0)
    first, *_ = names[0].read_text().splitlines()
    assert first == "time (s),target minus position (m),speed (m/s),force of the drive (N)"
    columns = np.loadtxt(names[0], delimiter=",", skiprows=1).T
    for written, own in zip(columns, (found.time, found.error, found.velocity, found.force), strict=True):
        np.testing.assert_allclose(written, own, rtol=1e-11, atol=1e-11)
    assert "does it hunt" in names[1].read_text()
    upper, lower = found.plot()
    assert [upper.get_ylabel(), lower.get_ylabel()] == ["target minus position (m)", "force of the drive (N)"]
