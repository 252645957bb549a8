"""Fits: the truth comes back, with errors that mean what they say, from no guess at all."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.comparison import scaled_by_loss
from steadyslip.experiments.numerics.noise import lag_one

# -- truth


@pytest.mark.parametrize(
    ("rig", "protocol", "guess", "jumps"),
    [
        (lab.rig(), lab.STEP, ss.lab_rig(), ()),
        (lab.rig(ss.laws.Aging()), lab.STEP, ss.lab_rig("aging"), ()),
        (lab.rig(b=0.006), lab.STEP, ss.lab_rig(), ()),
        (lab.rig(b=-0.004), lab.STEP, ss.lab_rig(), ()),
        (lab.rig(), lab.HOLD, ss.lab_rig(), ()),
        (lab.rig(ss.laws.Aging()), lab.HOLD, ss.lab_rig("aging"), ()),
        (lab.rig(alpha=0.35), lab.PRESSED, ss.lab_rig(normal_memory="linker-dieterich"), (140.41,)),
        (lab.rig(alpha=0.2), lab.PULSED, ss.lab_rig(normal_memory="linker-dieterich"), (120.2, 160.5)),
        (lab.rig(alpha=0.5), lab.SHAKEN, ss.lab_rig(normal_memory="linker-dieterich"), ()),
        (lab.two_states(), replace(lab.STEP, until=400.0), ss.lab_rig(states=2), ()),
    ],
)
@pytest.mark.campaign
def test_the_truth_comes_back_from_no_guess(rig, protocol, guess, jumps):
    for uniform in (True, False):  # in one test, so that one kernel is compiled once
        record = lab.record(rig, protocol, seed=8, uniform=uniform)
        fit = ss.fit(guess, record)
        assert fit.search.converged
        assert not fit.unidentified
        assert np.max(np.abs(lab.deviations(fit, rig, jumps))) < 3.5
        assert fit.rms == pytest.approx(lab.NOISE, rel=0.06)


def test_cutoff_velocities_are_looked_for_at_those_of_the_record():
    """Both free, wherever the rig has them: a start far below all velocities of the record cannot follow it."""
    truth = {"a_cutoff_velocity": 3e-4, "b_cutoff_velocity": 3e-6}
    law = ss.laws.RateState(a=0.010, b=0.012, d_c=2e-5, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Aging(), **truth)
    source = replace(lab.rig(), friction=law, stiffness=1e10)
    rates = {100.0: 3e-6, 160.0: 1e-5, 190.0: 3e-5, 220.0: 1e-4, 250.0: 1e-5, 280.0: 1e-6}
    steps = tuple(ss.protocol.VelocityStep(at=at, to=rate) for at, rate in rates.items())
    record = lab.record(source, ss.Protocol(pieces=steps, until=380.0), noise=5e-4, count=4000)
    for guess in ((1e-7, 1e-3), (1e-9, 1e-9), (1e3, 1e3)):
        fit = ss.fit(source.with_values(dict(zip(truth, guess, strict=True))), record)
        assert fit.rms == pytest.approx(5e-4, rel=0.03)
        for name, value in truth.items():
            assert abs(np.log(fit[name].value / value)) < 0.05


@pytest.mark.parametrize("seed", range(6))
def test_random_truths_come_back(seed):
    """The best minimum is at least as good as the truth itself: no start is trapped for good."""
    rng = np.random.default_rng(seed)
    a = rng.uniform(0.004, 0.015)
    b = a + rng.uniform(-0.005, 0.005)
    rig = lab.rig(a=a, b=b, d_c=10 ** rng.uniform(-5.6, -4.4), mu_ref=rng.uniform(0.4, 0.7))
    unit = rig.value("friction.d_c") / lab.SLOW
    least = max(0.4, 2 * (b - a) / a)
    rig = rig.with_values(
        {"slider.stiffness": least * 10 ** rng.uniform(0, 1) * a * lab.STRESS / rig.value("friction.d_c")}
    )
    ratio = rng.choice([0.1, 0.3, 3.0, 10.0])
    end = 12 * unit + 30 * unit / min(ratio, 1)
    protocol = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=12 * unit, to=ratio * lab.SLOW),), until=end)
    record = lab.record(rig, protocol, seed=seed)
    fit = ss.fit(ss.lab_rig(), record)
    truth = fit.space.coordinates(np.array([rig.value(u.parameter) for u in fit.space.unknowns]))
    assert fit.ssq <= fit.comparison.misfit(truth[None])[0] * (1 + 1e-9)
    assert fit.search.converged


def test_scipy_finds_the_same_minimum():
    """The other route: SciPy's least squares from our minimum, disturbed."""
    fit = lab.stepped()
    comparison = fit.comparison

    def residuals(z):
        return comparison.residuals(z[None])[0][0]

    def jacobian(z):
        return -comparison.residuals(z[None])[1][0].T

    start = fit.coordinates + 0.02
    found = least_squares(residuals, start, jac=jacobian, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert 2 * found.cost == pytest.approx(fit.ssq, rel=1e-7)
    np.testing.assert_allclose(found.x, fit.coordinates, rtol=1e-5, atol=1e-5)


# -- options


def test_trends_offsets_and_weights():
    rig = lab.rig()
    record = lab.record(rig, lab.STEP)
    share = (record.displacement - record.displacement[0]) / np.ptp(record.displacement)
    tilted = replace(record, friction=record.friction + 0.004 * share - 0.003 * share**2)
    fit = ss.fit(ss.lab_rig(), tilted, trend=2)
    assert fit.values["trend.1"] == pytest.approx(0.004, abs=4 * fit.errors["trend.1"])
    assert fit.values["trend.2"] == pytest.approx(-0.003, abs=4 * fit.errors["trend.2"])
    assert np.max(np.abs(deviations_of(fit, rig))) < 3.5
    heavy = np.where(record.time > 100, 0.0, 1.0)
    spoiled = replace(record, friction=np.where(record.time > 100, 0.9, record.friction))
    fit = ss.fit(ss.lab_rig(), spoiled, weights=heavy)
    assert np.max(np.abs(deviations_of(fit, rig))) < 3.5
    fixed = ss.fit(rig, record, fixed=["slider.stiffness", "friction.mu_ref"], offset=True)
    assert fixed.rig().stiffness == lab.STIFFNESS
    assert fixed.values["offset"] == pytest.approx(0, abs=4 * fixed.errors["offset"])


def deviations_of(fit, rig):
    known = rig.parameters()
    return np.array(
        [
            (fit.coordinates[i] - u.coordinate(known[u.parameter].value)) / np.sqrt(fit.covariance[i, i])
            for i, u in enumerate(fit.space.unknowns)
            if u.parameter in known
        ]
    )


@pytest.fixture(scope="module")
def spoiled():
    """A record with outliers in it, and how far off a fit is that does not bear them."""
    record = lab.record(lab.rig(), lab.STEP)
    rng = np.random.default_rng(4)
    hit = np.repeat(rng.random(len(record) // 3 + 1) < 0.03, 3)[: len(record)]  # single ones would be left out
    found = replace(record, friction=record.friction + np.where(hit, rng.uniform(0.005, 0.02, len(record)), 0.0))
    return found, abs(ss.fit(ss.lab_rig(), found).values["friction.mu_ref"] - 0.62)


@pytest.mark.parametrize("loss", ["soft-l1", "huber", "cauchy"])
def test_robust_losses_bear_outliers(spoiled, loss):
    record, off = spoiled
    fit = ss.fit(ss.lab_rig(), record, loss=loss)
    assert np.max(np.abs(deviations_of(fit, lab.rig()))) < 5
    assert off > 5 * abs(fit.values["friction.mu_ref"] - 0.62)


def test_wild_samples_are_left_out_and_a_loss_bears_them():
    """Neither where the search starts nor the width of the loss follows it; at a step friction may have a peak."""
    run = lab.columns(lab.rig(), lab.STEP, count=600)
    run["friction"] = run["friction"] + lab.NOISE * np.random.default_rng(0).standard_normal(600)
    clean = ss.fit(ss.lab_rig(), ss.record_from_arrays(**run))
    run["friction"][[20, 300]] = 0.5, 50.0
    record = ss.record_from_arrays(**run)
    left = ss.fit(ss.lab_rig(), record)
    told = " ".join(str(left).split())
    assert "2 of the samples from 5.008347 to 75.12521 s left out, friction is far off the samples beside" in told
    assert "left out" not in str(clean)
    for fit in (left, ss.fit(ss.lab_rig(), record, loss="cauchy")):
        for name in clean.names:
            assert fit.values[name] == pytest.approx(clean.values[name], abs=2 * clean.errors[name])
    run["friction"][241] += 0.03
    left = ss.fit(ss.lab_rig(), ss.record_from_arrays(**run))
    told = " ".join(str(left).split())
    assert "1 of the samples at 60.35058 s left out, friction is so far off the fit that half of its misfit" in told
    for name in clean.names:
        assert left.values[name] == pytest.approx(clean.values[name], abs=2 * clean.errors[name])


@pytest.mark.parametrize("loss", ["soft-l1", "huber", "cauchy"])
def test_losses_are_what_scipy_calls_them(loss):
    r = np.concatenate([-np.geomspace(1e-3, 30, 40), np.geomspace(1e-3, 30, 40)])
    transformed, slope = scaled_by_loss(loss, r, 2.0)
    word = loss.replace("-", "_")
    costs = [
        2 * least_squares(lambda x, v=v: np.array([x[0] + v]), [0.0], loss=word, f_scale=2.0, max_nfev=1).cost
        for v in r
    ]
    np.testing.assert_allclose(transformed**2, costs, rtol=1e-9)
    step = 1e-6
    np.testing.assert_allclose(
        slope,
        (scaled_by_loss(loss, r + step, 2.0)[0] - scaled_by_loss(loss, r - step, 2.0)[0]) / (2 * step),
        rtol=1e-5,
        atol=1e-8,
    )


def test_joint_fits_share_what_they_should():
    """Two records of one rock in two machines."""
    soft = lab.rig().with_values({"slider.stiffness": 1.2e10})
    records = [lab.record(lab.rig(), lab.STEP, 1), lab.record(soft, lab.HOLD, 2)]
    fit = ss.fit(ss.lab_rig(), records, separate=["slider.stiffness"])
    assert {"slider.stiffness@1", "slider.stiffness@2"} <= set(fit.names)
    assert fit["slider.stiffness@1"].value == pytest.approx(lab.STIFFNESS, abs=4 * fit["slider.stiffness@1"].error)
    assert fit["slider.stiffness@2"].value == pytest.approx(1.2e10, abs=4 * fit["slider.stiffness@2"].error)
    for name in ("friction.a", "friction.b", "friction.d_c"):
        assert fit[name].value == pytest.approx(lab.rig().value(name), abs=4 * fit[name].error)
        assert fit[name].error < lab.stepped().errors[name]
    assert fit.rig(1).stiffness == fit.values["slider.stiffness@2"]
    assert len(fit.noise) == 2


def test_steps_of_one_record_can_be_fitted_apart():
    record = lab.record(lab.rig(alpha=0.35), lab.PRESSED)
    fit = ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), record.windows())
    assert fit["alpha"].value == pytest.approx(0.35, abs=4 * fit["alpha"].error)


def test_a_commanded_step_whose_time_is_not_known():
    rig = lab.rig()
    record = lab.record(rig, lab.STEP)
    blind = ss.record_from_arrays(record.time, friction=record.friction, normal=record.normal)
    guess = ss.lab_rig().with_values({"drive.velocity": lab.SLOW, "friction.d_c": lab.TRUTH["d_c"]})
    fit = ss.fit(
        guess, blind, protocol=ss.protocol.VelocityStep(at=58.0, to=5e-6),
        free=["a", "b", "stiffness", "protocol.pieces.1.at"],
    )  # fmt: skip
    at = fit["protocol.pieces.1.at"]
    assert at.value == pytest.approx(60.13, abs=4 * at.error)
    assert at.error < 0.05
    assert str(at).endswith(" s")


def test_a_measured_rate_drives_the_model_too():
    """Only the rate of the load point was measured; it jumps between two samples."""
    columns = lab.columns(lab.rig(), lab.STEP)
    run = ss.simulate(lab.rig(), lab.STEP, times=columns["time"], events=False)
    friction = columns["friction"] + lab.NOISE * np.random.default_rng(1).standard_normal(len(columns["time"]))
    record = ss.record_from_arrays(
        columns["time"], friction=friction, normal=columns["normal"], velocity=run["load_velocity"]
    )
    fit = ss.fit(ss.lab_rig(), record)
    assert fit["step.1.at"].value == pytest.approx(60.13, abs=4 * fit["step.1.at"].error)
    assert np.max(np.abs(lab.deviations(fit, lab.rig(), (60.13,)))) < 3.5


# -- real records


def test_basalt():
    """Figures of this fit, so that they cannot drift unseen; the minimum itself is checked by SciPy elsewhere."""
    fit = lab.basalt()
    assert fit.search.converged
    assert fit.search.arrived >= 10
    assert fit.ssq == pytest.approx(3.8832e-3, rel=1e-3)
    assert fit.values["friction.a"] == pytest.approx(0.009204, rel=0.003)
    assert fit.values["friction.d_c"] == pytest.approx(9.465e-6, rel=0.003)
    assert fit.noise[0].lag1 == pytest.approx(0.70, abs=0.02)
    said = " ".join(str(fit).split())
    assert "driven by commanded loading found in the record, 1 change of rate" in said
    assert "the measured displacement would make a -24%, b -22%, k -54%" in said
    assert re.search(r"k/σ 0\.00662[67] ± 0\.00064 /um", said)  # it is 0.0066267
    assert "a ramp of up to" not in said  # it would move a, b and k by less than their errors


@pytest.mark.campaign
def test_a_noisy_sensor_drives_the_model_on_request_only():
    """Errors in variables: the stiffness that the measured displacement leads to, and the warning."""
    fit = ss.fit(ss.lab_rig(), ss.read_record(lab.BASALT), trend=1, drive="measured")
    assert fit.ssq == pytest.approx(4.0799e-3, rel=1e-3)
    assert fit.values["slider.stiffness"] < 0.6 * lab.basalt().values["slider.stiffness"]
    assert "leave drive at 'commanded'" in " ".join(str(fit).split())


def test_a_measured_history_is_integrated_as_scipy_does_it():
    """Interval by interval with SciPy at 1e-9, on the part of the basalt record around its step."""
    record = ss.read_record(lab.BASALT, between=(11675.5, 11678))
    fit = ss.fit(ss.lab_rig(), record, drive="measured")
    a, b, d_c, mu, k = (fit[n].value for n in ("friction.a", "friction.b", "d_c", "mu_ref", "stiffness"))
    time, stress = record.time - record.time[0], record.normal
    load, rise = np.diff(record.displacement) / np.diff(time), np.diff(stress) / np.diff(time)
    rate, v_ref = record.initial_rate, fit.plan.rig.value("friction.v_ref")
    y = np.array([stress[0] * (mu + (a - b) * np.log(rate / v_ref)), -np.log(rate / v_ref)])
    seen = [y[0] / stress[0]]
    for i in range(len(load)):

        def slopes(t, y, i=i):
            sigma = stress[i] + rise[i] * (t - time[i])
            u = (y[0] / sigma - mu - b * y[1]) / a
            v = v_ref * np.exp(u)
            return [k * (load[i] - v), -v / d_c * (u + y[1])]

        y = solve_ivp(slopes, time[i : i + 2], y, rtol=1e-9, atol=[1e-3, 1e-11]).y[:, -1]
        seen.append(y[0] / stress[i + 1])
    np.testing.assert_allclose(fit.model, seen, rtol=0, atol=1e-8)


@pytest.mark.campaign
def test_sepiolite_strengthens():
    fit = ss.fit(ss.lab_rig("aging"), ss.read_record(lab.SEPIOLITE), trend=2, starts=9)
    assert fit.search.converged
    assert fit["b"].high < 0
    assert fit.ssq == pytest.approx(1.6109e-2, rel=1e-3)  # 1.805e-2 with the measured displacement
    assert fit.plan.loading[0].load.changes[0].after == pytest.approx(2e-6, rel=5e-4)  # m/s, as commanded
    assert 0.7 < fit.noise[0].lag1 < 0.9
    said = " ".join(str(fit).split())  # friction rises faster and later than the law can
    assert "step.1.at ended at the smallest value" in said
    assert "by friction the change is earlier than the record's other columns allow" in said


# -- which law


@pytest.mark.slow
def test_criteria_prefer_the_law_that_made_the_record():
    record = lab.record(lab.rig(ss.laws.Aging()), lab.HOLD)
    found = ss.compare_laws(ss.lab_rig(), record, ("slip", "aging"))
    assert found.best == "aging"
    assert found.weights["aging"] > 0.999
    assert str(found).splitlines()[1].startswith("aging")
    other = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 3))
    with pytest.raises(ss.ParameterError, match="other records"):
        ss.experiments.compare({"one": found.fits["slip"], "two": other})
    with pytest.raises(ss.ParameterError, match="two states"):
        ss.compare_laws(ss.lab_rig(), record, ("slips",))


# -- files and words


def test_a_fit_saved_is_the_same_fit(tmp_path):
    fit = lab.basalt()
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert str(again) == str(fit)
    assert again.to_dict() == fit.to_dict()
    np.testing.assert_array_equal(again.model, fit.model)
    (tmp_path / "other.nc").write_text("nothing")
    with pytest.raises(ss.NotAvailable, match="cannot read"):
        ss.load_fit(tmp_path / "other.nc")
    ss.simulate(lab.rig(), until=1.0).save(tmp_path / "history.nc")
    with pytest.raises(ss.NotAvailable, match="not a steadyslip fit"):
        ss.load_fit(tmp_path / "history.nc")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"free": ["friction.q"]}, "unknown parameter 'friction.q'"),
        ({"free": ["drive.velocity"]}, "unknown parameter 'drive.velocity'"),
        ({"trend": 9}, "allowed: a whole number from 0"),
        ({"trend_axis": "slip"}, "allowed: displacement, time"),
        ({"loss": "cubic"}, "allowed: linear"),
        ({"drive": "guessed"}, "allowed: commanded, smoothed, measured"),
        ({"errors": "none"}, "allowed: auto"),
        ({"starts": 0}, "allowed: a whole number from 1"),
        ({"weights": [1.0, 2.0]}, "finite numbers >= 0"),
        ({"width": -1.0}, "allowed: a finite number above 0"),
        ({"fixed": ["a", "b", "d_c", "mu_ref", "stiffness"]}, "nothing is free"),
        ({"protocol": ss.protocol.NormalStressStep(at=1, by=1e5)}, "does not move the load point"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ss.ParameterError, match=message):
        ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=100), **options)


def test_bad_records_are_named():
    record = lab.record(lab.rig(), lab.STEP, count=100)
    with pytest.raises(ss.ParameterError, match="no column for the load point"):
        ss.fit(ss.lab_rig(), ss.record_from_arrays(record.time, friction=record.friction))
    backward = ss.record_from_arrays(record.time, friction=record.friction, displacement=-record.displacement)
    with pytest.raises(ss.ParameterError, match="does not move forward"):
        ss.fit(ss.lab_rig(), backward)
    flat = ss.record_from_arrays(record.time, friction=np.full(100, 0.9), displacement=record.displacement)
    with pytest.raises(ss.ParameterError, match=r"friction is 0\.9 in all samples"):
        ss.fit(ss.lab_rig(), flat)
    calm = ss.record_from_arrays(record.time, friction=record.friction, displacement=1e-6 * record.time)
    with pytest.raises(ss.ParameterError, match="no change of the load point's rate"):
        ss.fit(ss.lab_rig(), calm)
    with pytest.raises(ss.ParameterError, match="allowed: a Record"):
        ss.fit(ss.lab_rig(), "record.csv")
    with pytest.raises(ss.ParameterError, match="allowed: a Slider"):
        ss.fit("rig", record)
    with pytest.raises(ss.UnknownNameError, match="fitted parameter"):
        lab.stepped()["mass"]


@pytest.mark.parametrize("records", [5, None, "run.csv", [1, 2], [], object()])
@pytest.mark.parametrize("rig", ["lab", "machine"])
def test_what_is_no_record_is_named(rig, records):
    """The number 5 ended in a TypeError."""
    chosen = ss.lab_rig() if rig == "lab" else ss.read_rig("examples/machines/two-guides.toml")
    with pytest.raises(ss.ParameterError, match="records: got"):
        ss.fit(chosen, records)


def test_lag_one_of_a_constant_is_zero():
    assert lag_one(np.ones(5)) == 0
