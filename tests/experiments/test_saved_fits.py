"""Fits of every kind of record are what they were once they are read back: to the last bit, and nothing is searched."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting import numbers, refit
from steadyslip.experiments.fitting.estimates import Combination
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.remedies import Remedy
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import SearchSummary
from steadyslip.experiments.numerics.noise import Noise, white


def drifting(chance, rows=3000, drift=0.02):
    """A record whose normal stress drifts and whose load point changes its rate, both noisy."""
    time = np.linspace(0.0, 300.0, rows)
    at = np.sort(chance.uniform(40.0, 260.0, int(chance.integers(1, 4))))
    rates = 1e-6 * np.exp(chance.uniform(-2, 2, len(at) + 1))
    moved = rates[0] * time + sum(
        (b - a) * np.maximum(time - t, 0) for a, b, t in zip(rates, rates[1:], at, strict=False)
    )
    moved = moved + 2e-9 * chance.standard_normal(rows)
    normal = 1e7 * (1 + drift * np.sin(time / 60.0) + 1e-4 * chance.standard_normal(rows))
    friction = 0.6 + sum(0.01 * np.exp(-np.maximum(time - t, 0) / 5) * (time > t) for t in at)
    friction = friction + 2e-4 * chance.standard_normal(rows)
    return ss.record_from_arrays(time, friction=friction, normal=normal, displacement=moved, source="µ 1")


def curved(record):
    return any(
        course is not None and course.curve is not None for course in (record.loading.load, record.loading.stress)
    )


def made(rig, records, chance, **options):
    """A fit with numbers that nobody had to search."""
    plan = make_plan(rig, records, **options)
    space = plan.space()
    count = len(space)
    coordinates = chance.standard_normal(count)
    root = chance.standard_normal((count, count))
    noise = tuple(
        Noise(
            *chance.standard_normal(1), bool(k % 2), chance.standard_normal(k), 1e-8, 1e-8 * np.exp(-np.arange(k + 1.0))
        )
        for k in range(1, len(plan.records) + 1)
    )
    fit = Fit(
        plan, coordinates, float(chance.uniform()),
        SearchSummary(8, 3, (1.5, 1 / 3), 12, True, bool(chance.integers(2))),
        noise, root @ root.T, (Combination({space.unknowns[0].name: 1 / 3}, float("inf")),),
        (coordinates - chance.uniform(size=count), coordinates + 1), "0.0.7",
    )  # fmt: skip
    samples = sum(map(len, plan.records))
    ramps = (refit.RampFit(0.1, 1 / 7, {"friction.a": 0.1}),)
    mended = (Remedy("friction.normal_memory = 'linker-dieterich'", 1 / 9, 1 / 11, 0.5, {"friction.a": 0.2}),)
    fit.__dict__.update(
        model=chance.standard_normal(samples), as_measured={"friction.a": 1 / 3}, as_ramps=ramps, remedies=mended
    )  # fmt: skip
    return fit


def same(again, fit):
    """Everything that a fit is made of, and what drives its model, at all samples."""
    assert again.space.unknowns == fit.space.unknowns
    assert again.search == fit.search
    assert again.unidentified == fit.unidentified
    assert (again.ssq, again.version, again.plan.free, again.plan.separate) == (
        fit.ssq, fit.version, fit.plan.free, fit.plan.separate)  # fmt: skip
    for name in (
        "rig",
        "drive",
        "trend",
        "trend_axis",
        "offset",
        "lag",
        "initial",
        "loss",
        "width",
        "rtol",
        "sharp",
        "protocol",
    ):
        assert getattr(again.plan, name) == getattr(fit.plan, name), name
    assert (again.as_measured, again.as_ramps) == (fit.as_measured, fit.as_ramps)
    assert again.remedies == fit.remedies
    for one, other in ((again.coordinates, fit.coordinates), (again.covariance, fit.covariance),
                       (again.model, fit.model), *zip(again.bounds, fit.bounds, strict=True)):  # fmt: skip
        np.testing.assert_array_equal(one, other, strict=True)
    assert (again.plan.weights is None) == (fit.plan.weights is None)
    for i, (one, other) in enumerate(zip(again.plan.records, fit.plan.records, strict=True)):
        assert (one.source, one.notes, one.integrated) == (other.source, other.notes, other.integrated)
        for name in ("time", "friction", "normal", "shear", "displacement", "velocity", "worth"):
            mine, theirs = getattr(one, name), getattr(other, name)
            assert (mine is None) == (theirs is None), name
            if mine is not None:
                np.testing.assert_array_equal(mine, theirs, strict=True)
        if fit.plan.weights is not None:
            np.testing.assert_array_equal(again.plan.weights[i], fit.plan.weights[i], strict=True)
        if fit.plan.loading:
            for channel in ("load", "stress"):
                mine, theirs = (getattr(plan.loading[i], channel) for plan in (again.plan, fit.plan))
                assert (mine is None) == (theirs is None)
                if mine is not None:
                    assert mine.changes == theirs.changes
                    np.testing.assert_array_equal(mine.errors, theirs.errors)
                    np.testing.assert_array_equal(mine.at(other.time), theirs.at(other.time))
        for mine, theirs in ((again.noise[i], fit.noise[i]),):
            assert (mine.lag1, mine.correlated, mine.innovation) == (theirs.lag1, theirs.correlated, theirs.innovation)
            np.testing.assert_array_equal(mine.coefficients, theirs.coefficients)
            np.testing.assert_array_equal(mine.covariance, theirs.covariance)


def test_a_fit_of_means_is_read_back_with_its_loading(tmp_path):
    """Where the stress drifts, steps were found anew in the means, elsewhere; residuals were five times as large."""
    chance = np.random.default_rng(1)
    record = drifting(chance).decimated(300)
    fit = made(ss.lab_rig(), record, chance)
    assert fit.plan.loading[0].stress.curve is not None
    assert fit.plan.records[0].worth is not None
    fit.save(tmp_path / "fit.nc")
    same(ss.load_fit(tmp_path / "fit.nc"), fit)


def test_a_record_that_was_cleaned_is_not_cleaned_again(tmp_path):
    """After a clipped peak and wild samples one more looked wild: samples and model were of two lengths."""
    chance = np.random.default_rng(10)
    steps = (ss.protocol.VelocityStep(at=60.13, to=5e-6), ss.protocol.VelocityStep(at=110.37, to=1e-6))
    found = lab.columns(lab.rig(), ss.Protocol(pieces=steps, until=180.0), 1500)
    friction = found["friction"] + lab.NOISE * chance.standard_normal(1500)
    wild = chance.choice(1500, 8, replace=False)
    friction[wild] += chance.choice([-1, 1], 8) * chance.uniform(0.005, 0.05, 8)
    friction = np.minimum(friction, np.quantile(found["friction"], 0.985))
    fit = search_fit(ss.lab_rig(), ss.record_from_arrays(**(found | {"friction": friction})), starts=3)
    assert len(fit.plan.records[0]) < 1500
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert again.samples == fit.samples
    np.testing.assert_array_equal(again.residuals, fit.residuals)
    assert str(again) == str(fit)


def test_a_fit_is_checked_by_its_residuals(tmp_path):
    """White residuals pass; those that drift beside what their noise says leave the errors open, and words say so."""
    chance = np.random.default_rng(2)
    record = drifting(chance, rows=400)
    fit = made(ss.lab_rig(), record, chance)
    fit = replace(fit, coordinates=np.abs(fit.coordinates))
    size, scatter = len(record), 1e-4

    def left(residuals, **changes):
        one = replace(fit, ssq=float(residuals @ residuals), noise=(white(scatter * np.ones(size)),), **changes)
        one.__dict__.update(model=record.friction - residuals, as_measured=None, as_ramps=(), remedies=())
        return one

    noise = scatter * chance.standard_normal(size)
    right = left(noise, search=replace(fit.search, cut=False))
    assert [one.what for one in right.checks] == ["sum of squares", "minimum", "errors"]
    assert all(one.passed for one in right.checks)
    assert right.to_dict()["checked"] == "checked: sum of squares, minimum, errors"
    assert "checked: sum of squares, minimum, errors" in str(right)
    slow = left(noise + scatter * np.sin(np.arange(size) * 12 / size), search=replace(fit.search, converged=False))
    assert "not decided: minimum, errors; checked: sum of squares" in str(slow)
    right.save(tmp_path / "fit.nc")
    assert ss.load_fit(tmp_path / "fit.nc").checks == right.checks
    assert not replace_ssq(right, 1 + 1e-5).checks[0].passed


def replace_ssq(fit, factor):
    other = replace(fit, ssq=factor * fit.ssq)
    other.__dict__.update(model=fit.model)
    return other


def test_a_fit_is_printed_without_a_search_before_and_after_it_was_saved(tmp_path, monkeypatch):
    """With structure in its residuals a first print took up to a minute."""
    fit = lab.basalt()
    assert fit.remedies

    def searched(*_, **__):
        raise AssertionError("a search")

    for module, name in ((numbers, "driven_as_measured"), (numbers, "with_ramps"), (numbers, "remedies"),
                         (refit, "minimise")):  # fmt: skip
        monkeypatch.setattr(module, name, searched)
    fit.__dict__.pop("model", None)
    text, data = str(fit), fit.to_dict()
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert str(again) == text
    assert json.dumps(again.to_dict()) == json.dumps(data)


def test_a_fit_with_a_lag_a_trend_and_an_offset_is_printed_by_its_names():
    record = lab.record(lab.rig(), lab.STEP, count=300)
    fit = ss.fit(ss.lab_rig(), record, ["mu_ref"], lag=True, trend=1, offset=True, starts=2)
    text = str(fit)
    assert all(f"  {name} " in text for name in ("friction.mu_ref", "lag", "trend.1", "offset"))


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(12))
def test_fits_of_records_at_random_are_read_back(tmp_path, seed):
    """Whole, cut, thinned, several together, with every option, once and again."""
    chance = np.random.default_rng(seed)
    records = []
    for _ in range(int(chance.integers(1, 4))):
        record = drifting(chance, rows=int(chance.integers(400, 3000)), drift=chance.choice([0.0, 0.02]))
        record = record.between(5.0, float(chance.uniform(200, 299))) if chance.integers(2) else record
        records.append(record.decimated(int(chance.integers(100, 350))) if chance.integers(2) else record)
    drive = str(chance.choice(["commanded", "smoothed", "measured"]))
    options = {
        "trend": int(chance.integers(0, 3)), "trend_axis": str(chance.choice(["displacement", "time"])),
        "loss": str(chance.choice(["linear", "huber"])), "drive": drive,
        "initial": str(chance.choice(["steady", "free"])),
        "lag": bool(chance.integers(2)) and drive == "commanded" and not any(curved(one) for one in records),
    }  # fmt: skip
    if len(records) > 1 and chance.integers(2):
        options["separate"] = ["friction.mu_ref"]
    rig = ss.lab_rig() if chance.integers(2) else lab.two_states()
    fit = made(rig, records, chance, **options)
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    same(again, fit)
    again.save(tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "fit.nc").read_bytes()
