"""Joint fits: a record counts once, and records of unequal noise are told."""

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
        with pytest.raises(ss.ParameterError, match=r"record 2: is record 1 again .* an experiment counts once"):
            ss.fit(ss.lab_rig(), [one, again])


@pytest.mark.parametrize(("noise", "told"), [(lab.NOISE, False), (8 * lab.NOISE, True)])
def test_unequal_noise_is_told_unless_weights_are_given(noise, told):
    records = [stepped(1), stepped(2, noise)]
    fit = ss.fit(ss.lab_rig(), records, starts=9)
    assert ("and records weigh alike" in str(fit)) is told
    if told:
        weights = [np.full(400, 1.0), np.full(400, lab.NOISE / noise)]
        weighted = ss.fit(ss.lab_rig(), records, starts=9, weights=weights)
        assert "weigh alike" not in str(weighted)
        assert weighted["a"].error < 0.6 * fit["a"].error


@pytest.mark.parametrize(("calibrated", "said"), [
    (lab.STIFFNESS * 1000, "a column or the calibration is in another unit"),
    (lab.STIFFNESS * 1.5, "a channel that comes late or a servo that lags may make that"),
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
