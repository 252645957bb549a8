"""Predictions of samples that were left out: by another route, and for what they are good."""

from __future__ import annotations

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss


@pytest.fixture(scope="module")
def record():
    return lab.record(lab.rig(), lab.STEP, 4, count=250)


@pytest.fixture(scope="module")
def fit(record):
    return ss.fit(ss.lab_rig(), record)


def test_a_fold_is_predicted_by_a_fit_that_gives_it_no_weight(record, fit):
    found = ss.experiments.cross_validate(fit, 4, block=20)
    for fold in (0, 3):
        out = found.fold == fold
        other = ss.fit(ss.lab_rig(), record, weights=np.where(out, 0.0, 1.0))
        np.testing.assert_allclose(found.residuals[out], (record.friction - other.model)[out], atol=0.01 * lab.NOISE)


def test_every_sample_is_predicted_once_a_little_worse_than_seen(fit):
    found = ss.experiments.cross_validate(fit)
    counts = np.bincount(found.fold)
    assert counts.sum() == fit.samples
    assert counts.min() > 0
    assert found.seen == pytest.approx(fit.rms)
    assert found.seen < found.rms < 1.2 * found.seen
    assert np.average(found.by_fold**2, weights=counts) == pytest.approx(found.rms**2)
    assert str(found).startswith("samples left out, 8 folds")


def test_the_law_that_made_the_record_predicts_it_better():
    made = lab.record(lab.rig(), lab.STEP, 4, count=400, noise=3e-4)
    compared = ss.compare_laws(ss.lab_rig(), made, ("slip", "aging"))
    assert compared.best == "slip"
    assert compared.predicted["slip"] < compared.predicted["aging"]
    assert "left out" in str(compared)


@pytest.mark.parametrize("folds", [1, 0, None, 2.5, True, 10**9])
def test_other_folds_are_refused(fit, folds):
    with pytest.raises(ss.ParameterError, match="folds: got"):
        ss.experiments.cross_validate(fit, folds)
