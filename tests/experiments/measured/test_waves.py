"""Waves of a displacement sensor that repeat with travel: taken out as the sensor's, unless friction shows them."""

import numpy as np
import pytest

import lab_records as lab
import servo_records
import steadyslip as ss
from steadyslip.experiments.measured import waves
from steadyslip.experiments.measured.waves import WAVE, without_wave

FREE = ("friction.a", "friction.b", "friction.d_c", "slider.stiffness")


def _with_wave(record, size, period, phase):
    """Record whose sensor adds a sine of the place to it; the noise of the sensor comes after that."""
    place = record.loading.load.integral(record.time)
    wave = size * np.sin(2 * np.pi * place / period + phase)
    return ss.record_from_arrays(
        time=record.time, friction=record.friction, normal=record.normal, displacement=record.displacement + wave,
        source="record",
    )  # fmt: skip


@pytest.mark.parametrize(("seed", "lag"), [(1, 0.0), (2, 0.0), (3, 0.3), pytest.param(4, 0.2, marks=pytest.mark.slow)])
def test_a_wave_of_the_sensor_is_taken_out(seed, lag):
    """Values were up to 45 errors off: rates between the wave's periods, and steps and servos that were none."""
    chance = np.random.default_rng(seed)
    plain, rig = servo_records.record(seed, lag)
    size, period = chance.uniform(0.15e-6, 0.5e-6), chance.uniform(9e-6, 25e-6)
    record = _with_wave(plain, size, period, chance.uniform(0, 6))
    fit = ss.fit(ss.lab_rig(), record)
    (note,) = (note for note in fit.plan.records[0].notes if WAVE in note)
    kept = fit.plan.records[0]
    left = kept.displacement - plain.displacement
    assert np.std(left) < 0.05 * size
    assert abs(fit.plan.loading[0].load.levels - plain.loading.load.levels).max() < 2e-9
    assert note in " ".join(str(fit).split())
    for name in FREE:
        assert abs(fit[name].value - rig.value(name)) < 3.5 * fit[name].error


def test_no_wave_is_found_where_there_is_none():
    for seed, lag, overshoot, way in ((0, 0, 0, None), (1, 0.3, 0, None), (2, 0.75, 0.3, None), (3, 0, 0, "creep")):
        record, _ = servo_records.record(seed, lag, overshoot, way=way)
        assert without_wave(record) is record
    chance = np.random.default_rng(3)
    slow = np.convolve(chance.standard_normal(3000), 0.9 ** np.arange(60), mode="valid") * 1e-7
    time = np.arange(len(slow)) * 0.05
    moved = np.where(time < 70, 1e-6 * time, 7e-5 + 1e-5 * (time - 70)) + slow
    record = ss.record_from_arrays(time=time, friction=0.6 + 1e-4 * slow, displacement=moved, source="slow noise")
    assert without_wave(record) is record


def test_slopes_of_a_place_are_those_of_differences():
    moved, parts = np.linspace(0, 1e-4, 400), np.array([2e-7, -1e-7, 1.1e-5])
    slopes = waves._place_slopes(waves._place(moved, parts), parts)
    for i, size in enumerate(1e-6 * np.abs(parts)):
        ends = [waves._place(moved, parts + way * size * np.eye(3)[i]) for way in (1, -1)]
        assert slopes[:, i] == pytest.approx((ends[0] - ends[1]) / (2 * size), abs=1e-6)


def test_the_search_for_a_wave_that_is_not_there_ends_soon(monkeypatch):
    """Its period wandered off, in 2 300 evaluations of 5 800 samples: a third of what the whole fit took."""
    record, calls = ss.read_record("examples/data/basalt_b819_velocity_step.txt"), []
    place = waves._place
    monkeypatch.setattr(waves, "_place", lambda *given: (calls.append(1), place(*given))[1])
    assert without_wave(record) is record
    assert 0 < len(calls) < 100


def test_friction_tells_a_wave_of_the_load_point_from_one_of_its_sensor():
    chance, time, fine = np.random.default_rng(1), np.arange(0, 119.9, 0.05), np.arange(0, 120, 0.01)
    place = np.where(fine < 60, 1e-6 * fine, 60e-6 + 5e-6 * (fine - 60))
    moved = place + 0.3e-6 * np.sin(2 * np.pi * place / 10e-6)
    piece = ss.protocol.LoadPointTable(time=tuple(fine), displacement=tuple(moved))
    rig = lab.rig()
    run = ss.simulate(rig, ss.Protocol(pieces=(piece,), until=119.9), times=time, rtol=1e-9, events=False)
    record = ss.record_from_arrays(
        time=run["t"], friction=run["friction"] + 2e-4 * chance.standard_normal(len(time)), normal=run["normal_stress"],
        displacement=run["load_displacement"] + 5e-8 * chance.standard_normal(len(time)), source="moves",
    )  # fmt: skip
    assert any(WAVE in note for note in without_wave(record).notes)
    fit = ss.fit(ss.lab_rig(), record)
    assert fit.plan.drive == "smoothed"
    for name in FREE:
        assert abs(fit[name].value - rig.value(name)) < 4 * fit[name].error
