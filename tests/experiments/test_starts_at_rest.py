"""Records that begin at rest, and channels that lag: both are found, with derivatives that are right."""

from __future__ import annotations

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.planning import make_plan

RELOADS = ss.Protocol(
    pieces=(ss.protocol.Hold(at=40.0, duration=60.0), ss.protocol.VelocityStep(at=160.37, to=4e-6)), until=260.0
)  # slides at 1 um/s until 40 s, rests until 100 s, slides again
REST = 70.0  # where the record is cut: 30 s into the hold


def cut(seed, lag=0.0):
    """The record from within the hold on, friction later than the load point by a lag."""
    found = lab.columns(lab.rig(), RELOADS, 2600)
    friction = np.interp(found["time"] - lag, found["time"], found["friction"])
    friction = friction + lab.NOISE * np.random.default_rng(seed).standard_normal(len(friction))
    keep = found["time"] >= REST
    columns = {name: values[keep] for name, values in found.items()} | {"friction": friction[keep]}
    return ss.record_from_arrays(**columns, source="cut")


@pytest.fixture(scope="module")
def fit():
    return ss.fit(ss.lab_rig(), cut(1))


def test_a_record_that_begins_at_rest(fit):
    for name, value in (("a", 0.011), ("b", 0.0145), ("d_c", 12e-6), ("stiffness", lab.STIFFNESS)):
        one = fit[name]
        assert abs(np.log(one.value / value)) < 3.5 * one.error / one.value
    hold = fit["start.hold"]
    assert abs(hold.value - (REST - 40.0)) < 3.5 * hold.error
    assert fit.rms == pytest.approx(lab.NOISE, rel=0.06)
    assert "at rest at first" in " ".join(str(fit).split())


def test_a_fit_that_begins_at_rest_is_kept_in_a_file(fit, tmp_path):
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert again.names == fit.names
    np.testing.assert_allclose(again.model, fit.model)


def test_a_common_lag_is_found():
    late = ss.fit(ss.lab_rig(), cut(2, 0.35), lag=True)
    lag = late["lag"]
    assert abs(lag.value - 0.35) < 3.5 * lag.error
    assert lag.error < 0.1
    assert abs(late["a"].value - 0.011) < 3.5 * late["a"].error


def test_a_lag_needs_changes_to_be_told_by():
    record = cut(3)
    with pytest.raises(ss.ParameterError, match="lag"):
        ss.fit(ss.lab_rig(), record.between(110, 260), lag=True, drive="measured")
    with pytest.raises(ss.ParameterError, match="at rest"):
        ss.fit(ss.lab_rig(), record, drive="measured")


def test_derivatives_in_hold_lag_and_ramps_are_slopes():
    """The other route: central differences."""
    time = np.linspace(0.0, 60.0, 400)
    rng = np.random.default_rng(0)
    rate = np.interp(time, [0, 19.99, 20.0, 40.0, 42.0, 60.0], [0, 0, 2e-6, 2e-6, 6e-6, 6e-6])
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    record = ss.record_from_arrays(
        time, friction=0.6 + 1e-3 * rng.standard_normal(400), normal=np.full(400, 1e7),
        displacement=moved + 2e-8 * rng.standard_normal(400),
    )  # fmt: skip
    plan = make_plan(ss.lab_rig(), record, lag=True)
    comparison = plan.comparison()
    names = [one.name for one in comparison.space.unknowns]
    assert {"lag", "start.hold"} <= set(names)
    assert any(name.endswith("duration") for name in names)
    values = {"friction.a": 0.01, "friction.b": 0.008, "friction.d_c": 1e-5, "friction.mu_ref": 0.6,
              "slider.stiffness": 1e10, "lag": 0.0123, "start.hold": 33.0}  # fmt: skip
    middle = [values.get(u.name, 0.5 * (u.low + u.high) + 0.0017) for u in comparison.space.unknowns]
    z = comparison.space.coordinates(np.array(middle))
    _, slopes = comparison.model(z[None])
    for i, name in enumerate(names):
        if name.startswith(("step", "lag", "start")):
            step = 1e-4 * np.eye(len(z))[i]
            ends = comparison.model(np.array([z + step, z - step]))[0]
            numeric = (ends[0] - ends[1]) / 2e-4
            close = np.abs(numeric - slopes[0, i]) <= 2e-2 * np.max(np.abs(numeric)) + 1e-9
            assert np.mean(close) > 0.98, name  # samples that a kink passes within the step may differ
