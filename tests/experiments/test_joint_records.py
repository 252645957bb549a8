"""Joint fits: a record counts once, and records of unequal noise are told."""

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
