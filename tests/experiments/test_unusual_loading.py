"""Loading that is not what it seems: displacement across the fault, wavy sensors, rates over many decades."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import lab_records as lab
import steadyslip as ss
from displacements_at_random import KINDS, drawn, outcome
from servo_records import record as servo_record
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.loading.across import yielding
from steadyslip.experiments.loading.kinks import load_course

STEPS = ss.Protocol(
    pieces=(ss.protocol.VelocityStep(at=60.13, to=10e-6), ss.protocol.VelocityStep(at=100.13, to=1e-6)), until=200.0
)


def measured(stiffness, sensor, across):
    """A record whose displacement is the load point's, or the fault's."""
    found = lab.columns(lab.rig().with_values({"stiffness": stiffness}), STEPS, 2000)
    chance = np.random.default_rng(1)
    stretched = (found["friction"] - found["friction"][0]) * found["normal"] / stiffness
    found["displacement"] = found["displacement"] - across * stretched + sensor * chance.standard_normal(2000)
    found["friction"] = found["friction"] + lab.NOISE * chance.standard_normal(2000)
    return ss.record_from_arrays(**found)


def spring(record):
    """Stiffness between sensor and load point (Pa/m); None if the sensor does not move with friction."""
    behind = yielding(record.time, record.displacement, record.friction, record.loading.load)
    return None if behind is None else float(np.mean(record.normal)) / behind.lost


@pytest.mark.parametrize("sensor", [2e-8, 2e-7])
@pytest.mark.parametrize("stiffness", [2e10, 1e11])
def test_a_displacement_across_the_fault_is_told_from_one_of_the_load_point(stiffness, sensor):
    assert spring(measured(stiffness, sensor, True)) == pytest.approx(stiffness, rel=0.1)
    assert spring(measured(stiffness, sensor, False)) is None


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(n, marks=pytest.mark.campaign) for n in range(3, 12))])
def test_a_servo_does_not_look_like_the_fault(seed):
    for law in (ss.laws.Slip(), ss.laws.Aging()):
        for lag, beyond in ((0.0, 0.0), (0.1, 0.0), (0.5, 0.0), (0.75, 0.1), (0.75, 0.35)):
            assert spring(servo_record(seed, lag, beyond, law)[0]) is None


def test_pieces_follow_the_load_point_and_not_the_fault():
    """Without what the machine takes, the displacement of the fault is that of the load point, servo and all."""
    found, source = servo_record(11)
    stretched = found.friction * found.normal / source.value("slider.stiffness")
    columns = {name: getattr(found, name) for name in ("time", "friction", "normal")}
    across = ss.record_from_arrays(**columns, displacement=found.displacement - stretched)
    own, fault = found.loading.load, across.loading.load
    assert len(fault.changes) == len(own.changes)
    assert fault.levels == pytest.approx(own.levels, rel=2e-3)
    assert servo_record(11, way="creep")[0].loading.load.otherwise is not None


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(n, marks=pytest.mark.campaign) for n in range(3, 30))])
def test_changes_that_are_the_faults_own_are_none(seed):
    """Its peak after a step was taken for two changes, a servo or a course of its own, in two records of five."""
    step = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=20.0, to=1e-5),), until=60.0)
    found, chance = lab.columns(lab.rig(ss.laws.Aging()), step, 3000), np.random.default_rng(seed)
    stretched = (found["friction"] - found["friction"][0]) * lab.STRESS / lab.STIFFNESS
    found["displacement"] = found["displacement"] - stretched + 5e-8 * chance.standard_normal(3000)
    found["friction"] = found["friction"] + lab.NOISE * chance.standard_normal(3000)
    record = ss.record_from_arrays(**found)
    (change,) = record.loading.load.changes
    assert change.time == pytest.approx(20.0, abs=0.02)
    assert (change.lag, change.pieces, record.loading.load.otherwise) == (0.0, (), None)
    assert spring(record) == pytest.approx(lab.STIFFNESS, rel=0.01)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(n, marks=pytest.mark.campaign) for n in range(2, 20))])
def test_a_sensor_that_slips_is_told_from_the_fault(seed):
    """A level that jumps after a step, and three wild samples, made 15 of 90 load points ones across the fault."""
    chance = np.random.default_rng(seed)
    found, _ = servo_record(seed, evolution=chance.choice([ss.laws.Slip(), ss.laws.Aging()]))
    moved = found.displacement.copy()
    moved[found.time > found.loading.load.changes[0].time + chance.uniform(1, 10)] += 0.8e-6 * chance.choice([-1, 1])
    moved[chance.integers(0, len(moved), 3)] += chance.choice([-3e-6, 4e-6], 3)
    columns = {name: getattr(found, name) for name in ("time", "friction", "normal")}
    assert spring(ss.record_from_arrays(**columns, displacement=moved)) is None


@pytest.mark.parametrize(("kind", "which"), [("soft, lag, across", 7), ("soft, overshoot, across", 5)])
def test_steps_are_found_with_friction_beside_them(kind, which):
    """On soft presses the fault's own motion made a servo, pieces or no change, and k up to ten times its truth."""
    *_, one = drawn(kind, which + 1, 1)
    assert spring(one.record) == pytest.approx(one.rig.value("slider.stiffness"), rel=0.1)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_displacements_of_the_fault_and_the_load_point_at_random(kind):
    """Of 20 of each kind at most one is taken for the other."""
    found = [spring(one.record) for one in drawn(kind, 20, 2)]
    assert sum((one is None) == ("across" in kind) for one in found) <= 1


@pytest.mark.campaign
@pytest.mark.parametrize("kind", [kind for kind in KINDS if "across" in kind])
def test_fits_along_the_fault_have_the_stiffness_of_the_press(kind):
    found = [outcome(one) for one in drawn(kind, 4, 3)]
    assert not [(ratio, z) for ratio, z, _, named in found if abs(z) > 3 and not named]
    assert np.median([ratio for ratio, *_ in found]) == pytest.approx(1, abs=0.05)


@pytest.mark.campaign
def test_a_fit_says_that_it_cannot_show_a_servo():
    told = {across: str(ss.fit(ss.lab_rig(), measured(1e11, 2e-8, across))) for across in (True, False)}
    assert "cannot show how a servo follows" in " ".join(told[True].split())
    assert "behind a spring of 1" in " ".join(told[True].split())
    assert "cannot show" not in told[False]
    little = " ".join(str(ss.fit(ss.lab_rig(), measured(2e10, 2e-8, 0.1))).split())
    assert "by little, as behind a part of the press 10 times as stiff as the whole, or by chance" in little


def test_rounding_of_a_displacement_is_no_spring():
    """The displacement of this record is exact: what moves with friction is its last digit."""
    fit, _ = ss.fit_files(["examples/data/made_velocity_step.csv"])
    assert "cannot show" not in str(fit)
    assert spring(fit.plan.records[0]) is None


@pytest.mark.parametrize("noise", ["waves", "slow", "white"])
def test_waves_of_a_sensor_are_told_and_slow_noise_is_not(noise):
    """Waves of half a micrometre made a servo and errors of four standard deviations, without a word."""
    chance = np.random.default_rng(4)
    found = lab.columns(lab.rig(), ss.Protocol(pieces=(ss.protocol.VelocityStep(at=20.0, to=1e-5),), until=60.0), 3000)
    steps, time = chance.standard_normal(3000), found["time"]
    added = {"white": 5e-8 * steps, "slow": 5e-8 * lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], steps),
             "waves": 5e-8 * steps + 5e-7 * np.sin(2 * np.pi * time / 16)}[noise]  # fmt: skip
    friction = found["friction"] + lab.NOISE * chance.standard_normal(3000)
    columns = found | {"friction": friction, "displacement": found["displacement"] + added}
    said = " ".join(str(ss.fit(ss.lab_rig(), ss.record_from_arrays(**columns))).split())
    assert ("the displacement wanders about straight lines" in said) == (noise == "waves")


def test_a_column_of_slip_is_noted(tmp_path):
    record = lab.record(lab.rig(), lab.STEP)
    record.to_csv(tmp_path / "r.csv")
    text = (tmp_path / "r.csv").read_text()
    (tmp_path / "r.csv").write_text(text.replace("Load displacement", "Fault slip"))
    assert any("across the fault, by its name" in note for note in ss.read_record(tmp_path / "r.csv").notes)
    assert not any("across the fault" in note for note in record.notes)


@pytest.mark.campaign
def test_changes_that_are_waviness_of_the_sensor_are_named():
    found = measured(2e10, 2e-8, False)
    slightly, wavy = (
        replace(found, displacement=found.displacement + size * np.sin(found.displacement * (2 * np.pi / 2e-5)))
        for size in (3e-7, 1e-6)
    )
    course = load_course(slightly.time, slightly.displacement)  # rates vary by 9 % in both directions
    assert [change.time for change in course.changes] == pytest.approx([60.13, 100.13], abs=0.1)
    few = {"starts": 2, "free": ["a", "b", "d_c"]}
    told = [" ".join(str(ss.fit(lab.rig(), record, **few)).split()) for record in (found, wavy)]
    assert ["a wave of 1 um every 20 um of travel was taken out" in text for text in told] == [False, True]


@pytest.mark.parametrize("rates", [(0.1, 1, 10, 100, 1000), (1, 10, 100, 1000, 100, 10, 1), (1, 1000, 1)])
@pytest.mark.parametrize("evenly", [True, False])
@pytest.mark.parametrize("sensor", [2e-8, 2e-7])
def test_rates_over_many_decades_with_equal_slip_are_all_found(rates, evenly, sensor):
    """Slow runs beside fast ones counted as rest, and fast ones between slow ones as glitches."""
    lengths = 300.0 / np.array(rates)
    begin = np.concatenate([[0.0], np.cumsum(lengths)])
    inner = (
        np.linspace(0, 1, 300, endpoint=False) if evenly else np.concatenate([[0.0], np.geomspace(1e-4, 0.999, 400)])
    )
    time = np.concatenate([start + length * inner for start, length in zip(begin[:-1], lengths, strict=True)])
    moved = np.interp(time, begin, 3e-4 * np.arange(len(rates) + 1))
    course = load_course(time, moved + sensor * np.random.default_rng(1).standard_normal(len(time)))
    assert course.levels == pytest.approx(1e-6 * np.array(rates), rel=5e-3)
    assert [change.time for change in course.changes] == pytest.approx(begin[1:-1].tolist(), rel=1e-3)


def test_a_hold_with_a_drifting_sensor_remains_a_hold():
    time = np.arange(0.0, 1200.0, 0.1)
    moved = np.interp(time, [0, 100, 1100, 1200], [0, 1e-3, 1.0005e-3, 2.0005e-3])
    course = load_course(time, moved + 2e-8 * np.random.default_rng(2).standard_normal(len(time)))
    assert course.levels[1] == 0.0
    assert len(course.changes) == 2


@pytest.mark.parametrize("answered", [True, False])
def test_a_small_step_that_friction_answers_is_none_of_the_sensor(answered):
    """A step by 20 %: friction of a load point that kept its rate shows none."""
    step, still = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=30, to=1.2e-6),), until=100), ss.Protocol(until=100)
    chance = np.random.default_rng(2)
    source = lab.rig(d_c=5e-6, b=0.013)
    found = lab.columns(source, step, 1000)
    found["displacement"] = found["displacement"] + 2e-8 * chance.standard_normal(1000)
    friction = found["friction"] if answered else lab.columns(source, still, 1000)["friction"]
    found["friction"] = friction + lab.NOISE * chance.standard_normal(1000)
    fit = search_fit(ss.lab_rig(), ss.record_from_arrays(**found))
    assert ("perhaps only waviness" in " ".join(str(fit).split())) is not answered
