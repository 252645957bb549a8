"""Joint fits: a record counts once, and weighs by its own noise."""

from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss


def stepped(seed, noise=lab.NOISE):
    return lab.record(lab.rig(), lab.STEP, seed, noise, count=400)


def test_a_record_counts_once():
    one = stepped(1)
    thinned = ss.record_from_arrays(
        one.time[::2], friction=one.friction[::2], normal=one.normal[::2], displacement=one.displacement[::2]
    )
    for again in (one, thinned):
        with pytest.raises(ss.ParameterError, match=r"record 2: is record 1 again .* give each experiment once"):
            ss.fit(ss.lab_rig(), [one, again])


@pytest.fixture(scope="module")
def unequal():
    return [stepped(1), stepped(2, 8 * lab.NOISE)]


@pytest.fixture(scope="module")
def weighed(unequal):
    return ss.fit(ss.lab_rig(), unequal, starts=9)


def test_records_weigh_by_their_own_noise(unequal, weighed):
    """Errors are below those of each record alone; with weights by the true noise they are the same."""
    level = [np.median(row) for row in weighed.plan.weights]
    assert level[0] / level[1] == pytest.approx(8, rel=0.15)
    alone = ss.fit(ss.lab_rig(), unequal[0], starts=9)
    given = ss.fit(ss.lab_rig(), unequal, starts=9, weights=[np.full(400, 1.0), np.full(400, 1 / 8)])
    for name in ("a", "b", "d_c", "stiffness"):
        assert weighed[name].error < 1.02 * alone[name].error
        assert weighed[name].error == pytest.approx(given[name].error, rel=0.03)
    assert "records weigh by their noise: 1, 0.12" in str(weighed)


def test_weights_are_saved(weighed, tmp_path):
    weighed.save(tmp_path / "joint.nc")
    again = ss.load_fit(tmp_path / "joint.nc")
    assert again.errors == weighed.errors
    assert str(again) == str(weighed)


def test_equal_noise_weighs_alike():
    assert ss.fit(ss.lab_rig(), [stepped(1), stepped(2)], starts=9).plan.weights is None


def test_outliers_do_not_lessen_the_weight_of_a_record():
    quiet, loud = stepped(1), stepped(2, 3 * lab.NOISE)
    friction = quiet.friction.copy()
    friction[np.random.default_rng(1).choice(400, 20, replace=False)] += 30 * lab.NOISE
    fit = ss.fit(ss.lab_rig(), [replace(quiet, friction=friction), loud], starts=9, loss="huber")
    level = [np.median(row) for row in fit.plan.weights]
    assert level[0] / level[1] == pytest.approx(3, rel=0.25)


def test_criteria_do_not_depend_on_the_unit_of_weights(unequal, weighed):
    other = replace(weighed, plan=replace(weighed.plan, weights=tuple(7 * row for row in weighed.plan.weights)))
    assert other.criteria(weighed.noise) == pytest.approx(weighed.criteria(weighed.noise), rel=1e-12)


def test_a_quiet_end_off_the_model_is_told_beside_a_loud_record(unequal):
    quiet, loud = unequal
    friction = quiet.friction.copy()
    friction[-6:] += 10 * lab.NOISE
    fit = ss.fit(ss.lab_rig(), [replace(quiet, friction=friction), loud], starts=9)
    assert "friction ends" in str(fit)


@pytest.mark.parametrize(("calibrated", "said"), [
    (lab.STIFFNESS * 1000, "a column or the calibration is probably in another unit"),
    (lab.STIFFNESS * 1.5, "a channel that comes late or a servo that lags may be the cause"),
])  # fmt: skip
def test_a_stiffness_far_off_its_calibration_is_in_another_unit(calibrated, said):
    fit = ss.fit(ss.lab_rig(), stepped(1), starts=9, calibrated=calibrated)
    assert said in " ".join(str(fit).split())


def test_a_time_at_the_end_of_its_window_is_told_where_friction_pulls_it_beyond():
    """By three errors and more: windows are no wider than noise makes them, so that times end there by chance."""
    seen = stepped(1)
    place = seen.displacement + 5e-8 * np.random.default_rng(3).standard_normal(400)
    record = ss.record_from_arrays(seen.time, friction=seen.friction, normal=seen.normal, displacement=place)
    fit = ss.fit(ss.lab_rig(), record, starts=9)
    k = fit.names.index("step.1.at")
    low, high = (np.array(ends, dtype=float) for ends in fit.bounds)
    for off, told in ((0.5, False), (8.0, True)):
        end = fit.coordinates + off * np.sqrt(fit.covariance[k, k]) * (np.arange(len(low)) == k)
        moved = replace(fit, coordinates=end, bounds=(np.where(np.arange(len(low)) == k, end, low), high))
        found = [one for one in moved.at_bounds if "step.1.at" in one]
        assert bool(found) is told
        assert not told or "earlier than the record's other columns allow" in found[0]
