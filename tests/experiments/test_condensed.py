"""Few numbers that stand for all samples have the sum of squares of all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.condensed import Condensed, condensed
from steadyslip.experiments.fitting.planning import make_plan


@pytest.fixture(scope="module")
def rig():
    return lab.rig()


@pytest.mark.parametrize("noisy", [False, True])
def test_sums_of_squares_and_slopes_are_those_of_all_samples(rig, noisy):
    """Near the minimum, for any weights; a noisy displacement leaves the time of the step open."""
    record = lab.record(rig, lab.STEP, seed=3, count=4000)
    rng = np.random.default_rng(1)
    if noisy:
        record = ss.record_from_arrays(
            record.time, friction=record.friction, normal=record.normal,
            displacement=record.displacement + 1e-7 * rng.standard_normal(len(record)),
        )  # fmt: skip
    weights = rng.uniform(0.5, 2.0, len(record))
    plan = make_plan(ss.lab_rig(), record, weights=weights, trend=1)
    whole = plan.comparison()
    values = [rig.parameters()[u.parameter].value if u.parameter in rig.parameters() else 0.5 * (u.low + u.high)
              if np.isfinite(u.low) else 0.01 for u in whole.space.unknowns]  # fmt: skip
    z = whole.space.coordinates(np.array([values]))
    few = condensed(plan, whole, z)
    assert isinstance(few, Condensed)
    assert few.size < 0.15 * whole.size
    near = z + 0.02 * rng.standard_normal((5, z.shape[1]))
    for (r, rows), (own, own_rows) in [(whole.residuals(near), few.residuals(near))]:
        np.testing.assert_allclose(np.sum(own**2, 1), np.sum(r**2, 1), rtol=1e-4)
        np.testing.assert_allclose(
            np.einsum("mpn,mn->mp", own_rows, own), np.einsum("mpn,mn->mp", rows, r),
            atol=2e-3 * np.sqrt(np.sum(r**2) / 5 * np.max(np.sum(rows**2, 2))),
        )  # fmt: skip
        np.testing.assert_allclose(
            own_rows @ own_rows.transpose(0, 2, 1), rows @ rows.transpose(0, 2, 1),
            rtol=1e-3, atol=1e-4 * np.max(np.sum(rows**2, 2)),
        )  # fmt: skip


def test_nothing_is_condensed_where_all_samples_matter(rig):
    """A measured displacement drives the model sample by sample, and a robust loss is no sum of squares."""
    record = lab.record(rig, lab.STEP, seed=3, count=1000)
    for options in ({"drive": "measured"}, {"loss": "huber"}):
        plan = replace(make_plan(ss.lab_rig(), record, **options), width=1e-3)
        whole = plan.comparison()
        z = np.clip(np.zeros((1, len(whole.space))), whole.space.low, whole.space.high)
        assert condensed(plan, whole, z) is whole


def test_what_was_just_run_is_not_run_again():
    comparison = make_plan(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300)).comparison()
    z = lab.stepped().coordinates
    seen, slopes = comparison.model(np.stack([z, z + 0.01]))
    kept = [array.copy() for array in (seen[1], slopes[1])]
    for array in (seen, slopes):
        with pytest.raises(ValueError, match="read-only"):  # or it would be remembered wrongly
            array[:] = 0.0
    for fresh, old in zip(comparison.model((z + 0.01)[None]), kept, strict=True):
        np.testing.assert_array_equal(fresh[0], old)


def test_a_motion_that_runs_away_is_given_up_at_once():
    """Without inertia a spring too soft lets the block reach any velocity in no time, however short the steps."""
    comparison = make_plan(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300)).comparison()
    soft = lab.stepped().values | {"friction.b": 0.03, "slider.stiffness": 1e9}
    z = comparison.space.coordinates(np.array([[soft[one.name] for one in comparison.space.unknowns]]))
    assert np.any(np.isnan(comparison.model(z)[0]))
    accepted, rejected = comparison.parts[0].forward.steps[0]
    assert rejected < 100
    assert accepted < 2 * len(comparison.data)
