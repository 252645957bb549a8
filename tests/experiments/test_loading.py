"""Commanded loading: found through noise, glitches and slips of the sensor, and run through exactly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.commanded import CommandedInputs
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.loading import runs
from steadyslip.experiments.loading.kinks import _Lines, load_course, smooth_load
from steadyslip.experiments.loading.loading import Loading, shifted
from steadyslip.experiments.loading.pressing import oscillation, stress_course
from steadyslip.experiments.loading.runs import Run, _joined_across_flanks, fitted_run, straight_runs

STEPS = [(40.3, 1.0, 3.0), (80.1, 3.0, 10.0), (121.7, 10.0, 3.0), (160.2, 3.0, 1.0)]
HOLDS = [(30.3, 1.0, 0.0), (40.3, 0.0, 1.0), (90.1, 1.0, 0.0), (120.2, 0.0, 1.0)]
NOTHING = []


def moved(time, changes, ramp=0.0):
    """Displacement of a load point, um: an ideal one, or with every change spread over some time."""
    found = (changes[0][1] if changes else 1.0) * time
    for at, before, after in changes:
        since = np.maximum(time - at, 0.0)
        bent = since - 0.5 * ramp if not ramp else np.where(since < ramp, since**2 / (2 * ramp), since - ramp / 2)
        found = found + (after - before) * bent
    return found


def measured(time, changes, noise, glitches, slips, seed, ramp=0.0):
    """What a sensor would make of it, m."""
    rng = np.random.default_rng(seed)
    found = moved(time, changes, ramp) + noise * rng.standard_normal(len(time))
    for _ in range(glitches):
        middle, width = rng.uniform(time[0], time[-1]), rng.uniform(0.05, 0.5)
        found += rng.uniform(2, 5) * rng.choice([-1, 1]) * np.exp(-0.5 * ((time - middle) / width) ** 2)
    for _ in range(slips):
        found += rng.uniform(-1.5, 1.5) * (time > rng.uniform(time[0], time[-1]))
    return 1e-6 * found


@pytest.mark.parametrize("changes", [STEPS, HOLDS, NOTHING])
@pytest.mark.parametrize(("noise", "glitches", "slips"), [(0, 0, 0), (0.03, 4, 0), (0.14, 0, 0), (0.14, 4, 3)])
def test_rates_and_their_changes_are_found(changes, noise, glitches, slips):
    time = np.arange(0.0, 200.0, 0.05)
    for seed in (1, 2, 3):
        course = load_course(time, measured(time, changes, noise, glitches, slips, seed))
        assert course.curve is None
        assert len(course.changes) == len(changes)
        for found, (at, before, after) in zip(course.changes, changes, strict=True):
            assert found.duration == 0
            assert found.earliest - 1e-6 <= at <= found.latest + 1e-6
            assert (1e6 * found.before, 1e6 * found.after) == pytest.approx((before, after), rel=0.01, abs=1e-9)


def test_a_load_point_that_never_moves_rests():
    course = load_course(np.arange(100.0), np.full(100, 3e-3))
    assert (course.first, course.changes, course.curve) == (0.0, (), None)


def test_a_clean_column_leaves_nothing_open():
    time = np.sort(np.random.default_rng(0).uniform(0, 200, 3000))
    course = load_course(time, measured(time, STEPS, 0, 0, 0, 0))
    for found, (at, _, _) in zip(course.changes, STEPS, strict=True):
        assert not found.free
        assert found.time == pytest.approx(at, abs=1e-6)
    assert not list(shifted(Loading(course, None), pressed=True))


def test_rates_are_as_sure_as_they_say():
    """Deviations of rates over their errors have about unit spread."""
    time = np.arange(0.0, 200.0, 0.1)
    found = []
    for seed in range(40):
        course = load_course(time, measured(time, [(100.0, 1.0, 3.0)], 0.14, 0, 0, seed))
        found += list((1e6 * course.levels - [1.0, 3.0]) / (1e6 * course.errors))
    assert 0.8 < np.std(found) < 1.25
    assert abs(np.mean(found)) < 0.4


def test_a_ramp_is_told_from_a_step_or_said_not_to_be():
    time = np.arange(0.0, 100.0, 0.02)
    for ramp in (2.0, 5.0):
        (change,) = load_course(time, measured(time, [(50.0, 1.0, 10.0)], 0.1, 0, 0, 1, ramp)).changes
        assert change.duration == pytest.approx(ramp, rel=0.1)
        assert change.time == pytest.approx(50.0, abs=0.2)
        assert change.shortest <= ramp <= change.longest
    (change,) = load_course(time, measured(time, [(50.0, 1.0, 10.0)], 0.1, 0, 0, 1)).changes
    assert change.duration == 0
    assert 0 < change.longest < 1
    (change,) = load_course(time, measured(time, [(50.0, 1.0, 10.0)], 0.0, 0, 0, 1, 2.0)).changes
    assert change.duration == pytest.approx(2.0, rel=1e-3)
    assert not change.free


def test_what_is_not_piecewise_linear_becomes_a_smooth_curve():
    time = np.linspace(0.0, 100.0, 4000)
    rate = 2.0 + np.sin(0.2 * time)
    displacement = 2.0 * time - 5.0 * (np.cos(0.2 * time) - 1.0) + 0.05 * np.random.default_rng(1).standard_normal(4000)
    course = smooth_load(time, 1e-6 * displacement)
    inner = slice(100, -100)
    assert np.sqrt(np.mean((1e6 * course.at(time) - rate)[inner] ** 2)) < 0.05


# -- normal stress


def test_noise_in_a_constant_normal_stress_is_left_out():
    time = np.linspace(0, 100, 2000)
    course = stress_course(time, 1e7 * (1 + 5e-4 * np.random.default_rng(0).standard_normal(2000)))
    assert not course.changes
    assert course.curve is None
    assert course.first == pytest.approx(1e7, rel=5e-5)


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_steps_and_short_ramps_of_normal_stress(noise):
    time = np.arange(0.0, 100.0, 0.1)
    for ramp in (0.0, 0.14, 0.55):
        stress = 1e7 + 5e5 * np.clip((time - 60.03) / max(ramp, 1e-9), 0, 1)
        course = stress_course(time, stress + 1e7 * noise * np.random.default_rng(2).standard_normal(len(time)))
        (change,) = course.changes
        assert change.earliest - 1e-6 <= 60.03 <= change.latest + 1e-6
        assert (change.before, change.after) == pytest.approx((1e7, 1.05e7), rel=1e-4)
        if ramp:
            assert change.shortest - 1e-6 <= ramp <= change.longest + 1e-6
        else:
            assert change.duration == 0
        middle = course.at(np.array([change.time + 0.5 * change.duration]))
        if ramp:
            assert middle[0] == pytest.approx(0.5 * (change.before + change.after), rel=1e-9)  # straight


def test_a_slow_change_of_normal_stress_is_a_ramp_or_a_curve_not_a_staircase():
    time = np.linspace(0, 100, 2000)
    share = np.clip((time - 20) / 60, 0, 1)
    for noise in (0.0, 5e3):
        fresh = noise * np.random.default_rng(1).standard_normal(2000)
        for clean in (1e7 + 2e6 * share, 1e7 + 2e6 * share**2 * (3 - 2 * share)):
            course = stress_course(time, clean + fresh)
            assert len(course.changes) <= 1
            assert np.sqrt(np.mean((course.at(time) - clean) ** 2)) < 3e3


def test_an_oscillation_is_followed_without_its_noise():
    time = np.linspace(0, 220, 2200)
    clean = 1e7 + 2e5 * np.where(time > 20, np.sin(2 * np.pi * (time - 20) / 20), 0.0)
    noisy = clean + 5e3 * np.random.default_rng(0).standard_normal(len(time))
    wave = oscillation(time, noisy)
    assert wave.period == pytest.approx(20, rel=0.02)
    course = stress_course(time, noisy)
    assert np.sqrt(np.mean((course.at(time) - clean) ** 2)) < 2e3


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
@pytest.mark.parametrize("between", [4, 6, 10, 40])
def test_two_steps_of_the_normal_stress_one_way_are_no_ramp(between, noise):
    """A short level between two steps was read as a ramp that lasted 300 s, or took negative time; a ramp is one."""
    stress = np.repeat([1e7, 1.1e7, 1.2e7], [200, between, 200])
    time, rng = np.arange(len(stress), dtype=float), np.random.default_rng(between)
    course = stress_course(time, stress * (1 + noise * rng.standard_normal(len(time))))
    assert [(one.time, one.duration) for one in course.changes] == [(199.5, 0.0), (199.5 + between, 0.0)]
    ramp = np.interp(time, [199.0, 200.0 + between], [1e7, 1.2e7])
    (one,) = stress_course(time, ramp * (1 + noise * rng.standard_normal(len(time)))).changes
    assert one.time == pytest.approx(199.0, abs=2.0)
    assert one.duration == pytest.approx(between + 1.0, abs=3.0)


@pytest.mark.parametrize("at", [30.0, 41.0337, 60.0071])
def test_a_change_among_very_many_samples_is_found_to_the_sample(monkeypatch, at):
    """Runs are looked for on means of samples; where they part is known better."""
    monkeypatch.setattr(runs, "COARSE", 400)
    time = np.arange(0.0, 100.0, 5e-3)
    rng = np.random.default_rng(2)
    moved = 1e-6 * time + 4e-6 * np.maximum(time - at, 0.0) + 3e-8 * rng.standard_normal(len(time))
    (change,) = load_course(time, moved).changes
    assert change.earliest <= at <= change.latest
    assert change.latest - change.earliest < 0.08  # three times the noise over the change of rate, on both sides
    assert change.time == pytest.approx(at, abs=5e-3)


@pytest.mark.parametrize(("at", "count"), [(93.3, 1), (27990.0, 1), (45.0, 1), (17.0, 1), (28070.0, 1), (7.0, 0)])
def test_a_short_run_at_an_end_of_the_record_is_one(at, count):
    """Two samples of another rate where nothing is noisy; one has no rate."""
    time = np.linspace(0.0, 28087.0, 2000)
    moved = 1e-6 * np.minimum(time, at) + 1e-7 * np.maximum(time - at, 0.0)
    found = load_course(time, moved).changes
    assert [change.time for change in found] == [pytest.approx(at, abs=0.1)] * count


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("rate", "noise", "enough"), [(10.0, 0.0, 2), (10.0, 0.03, 12), (0.0, 0.001, 2), (3.5, 0.001, 5)]
)
def test_a_rate_of_few_samples_at_an_end_is_found_where_they_tell_it(turned, rate, noise, enough):
    """It and its time within their errors; of fewer samples nothing, or the same; never another story."""
    time = np.arange(0.0, 40.0, 0.02)
    for count in range(1, 21):
        at = (count - 0.63) * 0.02
        changes = [(time[-1] - at, 3.0, rate)] if turned else [(at, rate, 3.0)]
        course = load_course(time, measured(time, changes, noise, 0, 0, count))
        assert len(course.changes) == 1 or (count < enough and not course.changes)
        lead = (count - 0.63) * abs(rate - 3.0) * 0.02
        assert len(course.changes) or lead < 10 * noise or course.late + course.early > 0
        for change in course.changes:
            end = -1 if turned else 0
            assert change.earliest - 2e-4 <= changes[0][0] <= change.latest + 2e-4
            assert abs(1e6 * course.levels[end] - rate) < 5e6 * course.errors[end] + 1e-3


def test_a_flank_of_a_glitch_at_an_end_is_no_rate():
    """Half of a glitch as it fades, or a level of its own: left out, and said."""
    time = np.arange(0.0, 40.0, 0.02)
    rng = np.random.default_rng(5)
    for width, height in ((0.1, -3.0), (0.1, 3.0), (0.3, -4.0), (0.05, 2.0)):
        off = height * np.exp(-0.5 * (time / width) ** 2)
        for faulty in (off, -off[::-1]):
            course = load_course(time, 1e-6 * (3 * time + faulty + 0.03 * rng.standard_normal(len(time))))
            assert course.changes == ()
            assert course.levels == pytest.approx(3e-6, rel=1e-3)
            assert course.early + course.late > 1


@pytest.mark.parametrize("noise", [0.0, 1e-5, 2e-3])
def test_a_step_of_normal_stress_is_found_from_two_samples_on(noise):
    """One alone at an end may be the sensor's, and is left out."""
    time = np.arange(0.0, 40.0, 0.02)
    for count in range(1, 21):
        for at in ((count - 0.63) * 0.02, time[-1] - (count - 0.63) * 0.02):
            rng = np.random.default_rng(count)
            course = stress_course(time, np.where(time > at, 2.1e7, 2e7) * (1 + noise * rng.standard_normal(len(time))))
            assert course.curve is None
            assert len(course.changes) == (count > 1)
            assert all(change.earliest <= at <= change.latest for change in course.changes)
            assert course.early + course.late == (count == 1)


def test_a_record_whose_ends_do_not_tell_is_fitted_without_them_and_says_so():
    run = lab.columns(lab.rig(), lab.STEP)
    rng = np.random.default_rng(0)
    early, late = np.zeros(1000), np.zeros(1000)
    early[:3], late[-2:] = (2e-7, 5e-7, -4e-7), (3e-7, -8e-7)
    run["friction"] = run["friction"] + lab.NOISE * rng.standard_normal(1000)
    run["friction"][-6:] += 0.01
    run["displacement"] = run["displacement"] + early + late + 1e-8 * rng.standard_normal(1000)
    words = str(ss.fit(ss.lab_rig(), ss.record_from_arrays(**run))).replace("\n  ", " ")
    assert (
        "of the load point, the first 3 (until 0.3003003 s) and the last 2 (from 149.8498 s) samples are off" in words
    )
    assert "friction ends +0.0" in words


# -- tables


def loading(noise=0.1, ramp=2.0):
    time = np.arange(0.0, 100.0, 0.1)
    load = load_course(time, measured(time, [(50.0, 1.0, 10.0)], noise, 0, 0, 1, ramp))
    stress = stress_course(time, np.where(time > 70.02, 1.05e7, 1e7))
    return time, Loading(load, stress)


def inputs_of(table, job, at):
    """Load-point rate and added normal stress of a table at a time."""
    rows = table.segments[job if len(table.segments) > 1 else 0]
    k = np.flatnonzero((rows[:, 0] <= at) & (at < rows[:, 1]))[-1]
    since = at - rows[k, 0]
    return rows[k, 3] + since * rows[k, 6], rows[k, 5] + since * rows[k, 8]


def test_tables_follow_the_course_and_pass_every_sample():
    time, found = loading()
    inputs = CommandedInputs(found, time, pressed=True)
    assert [what for _, what in inputs.free] == ["at", "duration", "at"]
    start = np.array([[49.0, 3.0, 70.05], [50.2, 1.0, 70.01]])
    table = inputs.table(start, first=1, directions=4)
    for job, (at, duration, jump) in enumerate(start):
        for t in (20.0, at + 0.3 * duration, at + duration + 1.0, jump - 1e-3, jump + 1e-3):
            rate, stress = inputs_of(table, job, t)
            share = np.clip((t - at) / duration, 0, 1)
            low, high = found.load.levels
            assert rate == pytest.approx(low + share * (high - low), rel=1e-9)
            assert stress == pytest.approx(5e5 * (t > jump), abs=1e-3)
        rows = table.segments[job]
        np.testing.assert_array_equal(rows[1:, 0], rows[:-1, 1])
        assert (rows[0, 0], rows[-1, 1]) == (table.times[0], table.times[-1])
        np.testing.assert_allclose(table.times, time - time[0], atol=1e-12)


def test_tables_say_how_they_change():
    """Nodes that move, and inputs that change where they stand, against differences of tables."""
    time, found = loading()
    inputs = CommandedInputs(found, time, pressed=True)
    start, step = np.array([[49.03, 3.01, 70.05]]), 1e-5
    table = inputs.table(start, first=0, directions=3)
    for direction in range(3):
        shift = step * np.eye(3)[direction]
        after, before = inputs.table(start + shift), inputs.table(start - shift)
        moves = (after.segments[0, :, 0] - before.segments[0, :, 0]) / (2 * step)
        np.testing.assert_allclose(table.node_rates[0, direction], moves, atol=1e-6)
        for t in (49.77, 51.13):
            change = (inputs_of(after, 0, t)[0] - inputs_of(before, 0, t)[0]) / (2 * step)
            rows = table.segments[0]
            k = np.flatnonzero((rows[:, 0] <= t) & (t < rows[:, 1]))[-1]
            assert table.input_rates[0, direction, k, 0] == pytest.approx(change, rel=0.05, abs=1e-12)


def test_given_durations_change_no_motion():
    """Without derivatives in durations tables have fewer rows; friction and all other derivatives are the same."""
    ramp = ss.protocol.VelocityRamp(at=60.0, to=5e-6, duration=1.5)
    found = lab.columns(lab.rig(), ss.Protocol(pieces=(ramp,), until=150.0), count=2000)
    found["displacement"] = found["displacement"] + 5e-8 * np.random.default_rng(4).standard_normal(2000)
    plan = make_plan(lab.rig(), ss.record_from_arrays(**found))
    whole, given = plan.comparison(), plan.comparison(given=["step.1.duration"])
    names = [one.name for one in whole.space.unknowns]
    place, (part,) = names.index("step.1.duration"), whole.parts
    z = whole.space.coordinates(
        np.array([[part.rig.parameters()[n].value if "step" not in n else 60.0 for n in names]])
    )
    z = np.repeat(z, 3, axis=0)
    z[:, place] = np.array([0.3, 1.5, 2.0]) / whole.space.unknowns[place].size
    values = whole.space.values(z)
    assert given.parts[0].table(values).segments.shape[1] < 0.1 * part.table(values).segments.shape[1]
    (friction, slopes), (same, others) = whole.model(z), given.model(z)
    assert np.ptp(friction, axis=0).max() > 1e-4
    np.testing.assert_allclose(same, friction, atol=1e-7)
    assert not np.any(others[:, place])
    kept = np.arange(len(names)) != place
    size = np.max(np.abs(slopes), axis=2, keepdims=True)
    np.testing.assert_allclose((others / size)[:, kept], (slopes / size)[:, kept], atol=1e-3)


@pytest.mark.parametrize("seed", range(1, 8))
def test_a_brief_hold_is_seen_though_the_sensor_wanders_in_another(seed):
    """Each stretch has its own noise; that of the other hides a hold of a second."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 300.0, 0.04)
    changes = [(60.0, 10.0, 0.0), (60.9, 0.0, 10.0), (150.0, 10.0, 0.0), (200.0, 0.0, 10.0)]
    x = 1e-6 * moved(time, changes) + 4e-8 * rng.standard_normal(len(time))
    other = (time > 150) & (time < 200)
    x[other] += 3e-7 * lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], rng.standard_normal(np.sum(other)))
    found = load_course(time, x).changes
    assert [one.time for one in found] == pytest.approx([at for at, *_ in changes], abs=0.1)
    assert [one.after for one in found] == pytest.approx([0.0, 1e-5, 0.0, 1e-5], abs=1e-7)


def test_misfit_of_a_ramp_is_that_of_all_its_samples():
    time = np.arange(0.0, 100.0, 0.02)
    rng = np.random.default_rng(3)
    x = measured(time, [(40.3, 1.0, 3.0)], 0.03, 2, 0, 3, ramp=1.0)
    (change,) = _Lines(time, x, straight_runs(time, x)).kinks
    for duration in rng.uniform(0.0, change.reach, 20):
        begin = change.meet - 0.5 * duration
        since = np.clip(change.time - begin, 0.0, duration)
        later = np.maximum(change.time - begin - duration, 0.0)
        line = change.levels[0] + change.rates[0] * (change.time - change.origin)
        model = line + (change.rates[1] - change.rates[0]) * (0.5 * since**2 / duration + later)
        costs = 9 * np.log1p(((change.displacement - model) / change.strays) ** 2 / 9)
        inside = (change.time > begin) & (change.time < begin + duration)
        assert change._misfit(duration) == pytest.approx(costs.sum(), rel=1e-9)
        assert change._misfit(duration, outside=False) == pytest.approx(costs[inside].sum(), rel=1e-9)


@pytest.mark.parametrize(
    ("seed", "height", "later", "width"),
    [(0, 2.7e-6, 0.15, 0.3), (1, -2.7e-6, 0.45, 0.2), (1, 4e-6, 0.3, 0.3), (2, 2.7e-6, 0.6, 0.2), (3, 4e-6, 0.3, 0.2)],
)
def test_a_glitch_at_a_step_does_not_hide_its_time(seed, height, later, width):
    """The bottom of the glitch passes for a level of the sensor, and lines that meet there do so at another time."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 90.0, 0.02)
    load = 3e-6 * time + 7e-6 * np.maximum(time - 30.263, 0.0) + 1.4e-7 * rng.standard_normal(len(time))
    load += height * np.exp(-0.5 * ((time - 30.263 - later) / width) ** 2)
    course = load_course(time, load)
    assert len(course.changes) == 1
    assert course.changes[0].earliest < 30.263 < course.changes[0].latest


@pytest.mark.parametrize(
    ("ramp", "noise", "scatter", "words"),
    [(0.0, 2e-6, 1e-5, ""), (0.0, 6e-6, 1e-5, ""), (0.0, 2e-7, 3e-4, "friction does not decide either: with"),
     (1.5, 2e-6, 1e-5, "friction fits ramps better")],
)  # fmt: skip
def test_friction_is_asked_whether_a_step_is_a_ramp(ramp, noise, scatter, words):
    """Where the displacement does not tell, friction may; a fit says so where ramps would move its parameters."""
    change = (
        ss.protocol.VelocityRamp(at=60.0, to=5e-6, duration=ramp)
        if ramp
        else ss.protocol.VelocityStep(at=60.0, to=5e-6)
    )
    found = lab.columns(lab.rig(), ss.Protocol(pieces=(change,), until=150.0), count=2000)
    rng = np.random.default_rng(4)
    found["friction"] = found["friction"] + scatter * rng.standard_normal(len(found["time"]))
    found["displacement"] = found["displacement"] + noise * rng.standard_normal(len(found["time"]))
    fit = ss.fit(ss.lab_rig(), ss.record_from_arrays(**found))
    said = " ".join(str(fit).split())
    assert words in said
    assert ("would fit the displacement as well" in said) == bool(words)
    best = min(fit.as_ramps, key=lambda one: one.ssq)
    assert best.values["step.1.duration"] == pytest.approx(ramp, abs=0.5)


@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_a_flank_of_a_glitch_is_no_change_of_rate(offset):
    """Its bottom passed for a level of the sensor, its way back for a run; a brief change of rate leads elsewhere."""
    time = np.arange(0.0, 100.0, 0.02)
    bottom, back = (time >= 48.0) & (time < 48.4), (time >= 48.4) & (time < 49.0)
    x = 10 * time - 3.2 * bottom - np.where(back, 3.2 * (49.0 - time) / 0.6, 0.0) + offset * (time >= 49.0)
    x = 1e-6 * (x + 0.03 * np.random.default_rng(2).standard_normal(len(time)))
    places = np.searchsorted(time, [0.0, 48.0, 48.4, 49.0, 100.0]).tolist()
    pieces = list(pairwise(places))
    runs = [fitted_run(Run(members), time, x) for members in (pieces[:2], pieces[2:3], pieces[3:])]
    noise = np.full(len(time), 3e-8)
    assert len(_joined_across_flanks(runs, time, x, noise)) == (1 if offset == 0.0 else 3)


def test_a_brief_fast_run_among_very_many_samples_is_one(monkeypatch):
    """Its two means were a slip of the sensor, and the fit 40 % low."""
    monkeypatch.setattr(runs, "COARSE", 400)
    time = np.arange(6000) * 1e-3
    gone = 1e-6 * np.interp(time, [0, 2.5, 2.53, 6], [0, 2.5, 32.5, 35.97])
    course = load_course(time, gone + 2e-8 * np.random.default_rng(1).standard_normal(6000))
    assert course.levels == pytest.approx([1e-6, 1e-3, 1e-6], rel=0.01)
    assert [change.time for change in course.changes] == pytest.approx([2.5, 2.53], abs=5e-4)
    assert course.slips == 0


@pytest.mark.parametrize("seed", [3, 5, 16, 17, 20])
def test_noise_that_lasts_makes_no_slips_of_the_sensor_and_no_rates(seed):
    """As slips and glitches it left rates up to 5.7 errors off, and a hold that moved by five."""
    memory, time = 0.8, np.arange(0, 60, 1 / 40)
    pushes = np.random.default_rng(seed).standard_normal(len(time))
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], pushes)
    course = load_course(time, 1e-5 * np.interp(time, [0, 30, 31, 60], [0, 30, 30, 59]) + 6e-9 * noise)
    assert (course.levels[1], course.slips, course.glitches) == (0.0, 0, 0)
    assert np.all(np.abs(course.levels[[0, 2]] - 1e-5) < 3 * course.errors[[0, 2]])


def test_a_brief_stop_is_no_glitch():
    time = np.arange(0.0, 100.0, 0.02)
    for stop in (0.5, 1.0, 3.0):
        course = load_course(time, measured(time, [(48.0, 10.0, 0.0), (48.0 + stop, 0.0, 10.0)], 0.03, 0, 0, 7))
        assert len(course.changes) == 2, stop
        assert course.levels[1] == 0.0


@pytest.mark.parametrize("begin", [75.0, 75.07])
@pytest.mark.parametrize("lasts", [0.8, 1.0])
def test_a_hold_of_few_samples_between_long_slides_is_one_and_a_slip_of_the_sensor_is_none(begin, lasts):
    """One of 1 s, sampled every .15 s, in a series with others of 10 to 1000 s was a slip of the sensor."""
    time = np.arange(0.0, 150.0, 0.15)
    sensor = 2e-8 * np.random.default_rng(3).standard_normal(len(time))
    held = 1e-6 * moved(time, [(begin, 10.0, 0.0), (begin + lasts, 0.0, 10.0)]) + sensor
    course = load_course(time, held)
    assert [change.time for change in course.changes] == pytest.approx([begin, begin + lasts], abs=0.02)
    assert (course.levels[1], course.slips, course.glitches) == (0.0, 0, 0)
    for over in (0.0, lasts):  # at once, and through samples between
        slipped = 1e-5 * (time - lasts * (time > begin) - 0.5 * lasts * (np.abs(time - begin - over / 2) < over / 2))
        course = load_course(time, slipped + sensor)
        assert not course.changes
        assert course.slips > 0


def test_a_brief_hold_is_no_response_of_a_servo():
    """Among averages far from the other changes it was one outlier, so that a servo without it seemed to fit better."""
    ends = [0, 19.483, 20.44, 39.924, 49.262, 68.747, 161.396, 181]
    time, chance, memory = np.linspace(0, 180.9, 10_000), np.random.default_rng(5), 0.85
    moves = 1e-5 * np.interp(time, ends, np.cumsum(np.diff(ends, prepend=0) * [0, 1, 0, 1, 0, 1, 0, 1]))
    white, pushes = chance.standard_normal((2, len(time)))
    slow = lfilter([np.sqrt(1 - memory**2)], [1, -memory], pushes)
    course = load_course(time, moves + 1e-8 * white + 1.2e-8 * slow)
    assert [change.time for change in course.changes] == pytest.approx(ends[1:-1], abs=0.02)
    assert not any(change.lag for change in course.changes)


def test_long_ramps_of_a_displacement_without_noise():
    """Some last samples of a ramp seemed a level of the sensor: the ramp became a step, values were 4 errors off."""
    pieces = (
        ss.protocol.VelocityRamp(at=30.2, to=8e-6, duration=12),
        ss.protocol.VelocityRamp(at=70.3, to=1e-6, duration=20),
    )
    columns = lab.columns(lab.rig(), ss.Protocol(pieces=pieces, until=130.0), 1500)
    found = load_course(columns["time"], columns["displacement"]).changes
    assert [change.time for change in found] == pytest.approx([30.2, 70.3], abs=1e-3)
    assert [change.duration for change in found] == pytest.approx([12, 20], rel=1e-4)
