"""Errors of fits mean what they say, and what the data cannot tell is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import binom, multivariate_normal

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.at_minimum import fit_with_errors
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.valleys import along_valleys
from steadyslip.experiments.numerics.least_squares import minimise
from steadyslip.experiments.numerics.noise import describe, first_order
from steadyslip.experiments.numerics.pooling import spread_of_chains

# -- errors


@pytest.mark.slow
@pytest.mark.campaign
def test_intervals_cover_as_often_as_they_say():
    """160 replicates: 68 and 95 % intervals contain the truth that often, within binomial bounds."""
    rig, count = lab.rig(), 160
    record = lab.record(rig, lab.STEP, noise=0.0, count=600)
    plan = make_plan(rig, record)
    comparison = plan.comparison()
    space = plan.space()
    truth = space.coordinates(np.array([rig.value(u.parameter) for u in space.unknowns]))
    data = record.friction + lab.NOISE * np.random.default_rng(5).standard_normal((count, len(record)))
    found = minimise(
        lambda z, lanes: comparison.residuals(z, data[lanes]), np.tile(truth, (count, 1)), space.low, space.high
    )
    assert np.all(found.converged)
    search = lab.stepped().search
    inside = np.zeros((count, 2, len(space)))
    for i in range(count):
        own = replace(plan, records=(replace(record, friction=data[i]),))
        fit = fit_with_errors(Fit, own, own.comparison(), found.coordinates[i], search, "auto", (space.low, space.high))
        for k, level in enumerate((0.68, 0.95)):
            ends = np.array([fit.interval(n, level) for n in fit.names])
            values = np.array([rig.value(u.parameter) for u in space.unknowns])
            inside[i, k] = (ends[:, 0] <= values) & (values <= ends[:, 1])
    for k, level in enumerate((0.68, 0.95)):
        low, high = binom.interval(0.999, count, level)
        for covered in inside[:, k].sum(axis=0):
            assert low <= covered <= high


def correlated_noise(size, memory, seed):
    fresh = np.random.default_rng(seed).standard_normal(size)
    found = np.empty(size)
    found[0] = fresh[0]
    for i in range(1, size):
        found[i] = memory * found[i - 1] + np.sqrt(1 - memory**2) * fresh[i]
    return found


@pytest.mark.slow
def test_correlated_residuals_are_noticed_and_errors_honest():
    """Noise with lag-1 correlation .8: plain errors are three times too small, ours are those of repetition."""
    rig, count = lab.rig(), 64
    record = lab.record(rig, lab.STEP, noise=0.0)
    plan = make_plan(rig, record)
    space = plan.space()
    truth = space.coordinates(np.array([rig.value(u.parameter) for u in space.unknowns]))
    data = record.friction + lab.NOISE * np.array([correlated_noise(len(record), 0.8, s) for s in range(count)])
    comparison = plan.comparison()
    found = minimise(
        lambda z, lanes: comparison.residuals(z, data[lanes]), np.tile(truth, (count, 1)), space.low, space.high
    )
    repeated = np.std(found.coordinates, axis=0)
    noisy = replace(record, friction=data[0])
    honest = ss.fit(ss.lab_rig(), noisy)
    plain = ss.fit(ss.lab_rig(), noisy, errors="independent")
    assert honest.correlated
    assert honest.noise[0].lag1 == pytest.approx(0.8, abs=0.05)
    ratio = np.sqrt(np.diag(honest.covariance)) / repeated
    assert np.all((ratio > 0.7) & (ratio < 1.4))
    assert np.all(np.sqrt(np.diag(plain.covariance)) < 0.5 * repeated)
    assert not lab.stepped().correlated


@pytest.mark.parametrize("memory", [0.7, 0.97])
def test_slow_noise_that_parameters_took_up_is_known(memory):
    """Of the residuals alone, memory .97 gives errors that are too small: parameters have taken up what is slow."""
    fit = lab.stepped()
    rows = fit.comparison.residuals(fit.coordinates[None])[1][0]
    basis = np.linalg.qr(rows.T)[0].T
    off = []
    for seed in range(40):
        white = np.random.default_rng(seed + 99).standard_normal(rows.shape[1])
        noise = correlated_noise(rows.shape[1], memory, seed) + 0.5 * white
        taken = basis @ noise
        found = describe(noise - basis.T @ taken, len(rows), rows=rows)
        off.append(taken / np.sqrt(np.diag(found.spread(basis))))
    assert 0.9 < np.sqrt(np.mean(np.square(off))) < 1.1


def test_white_noise_beside_an_autoregression_is_one_too():
    """Its coefficients and its covariance are of the same noise: the equations of Yule and Walker."""
    chance = np.random.default_rng(5)
    noise = describe(correlated_noise(4000, 0.9, 4) + 0.7 * chance.standard_normal(4000))
    order, own = len(noise.coefficients), noise.covariance
    assert order > 5
    np.testing.assert_allclose(toeplitz(own[:order]) @ noise.coefficients, own[1 : order + 1], atol=2e-3 * own[0])
    assert own[0] - noise.coefficients @ own[1 : order + 1] == pytest.approx(noise.innovation, rel=2e-3)


def test_noise_of_the_same_residuals_is_sought_once(monkeypatch):
    """As of a fit, whose minimum, errors and text ask for it; with other derivatives it is other noise."""
    import scipy.optimize

    asked, search = [], scipy.optimize.minimize
    monkeypatch.setattr(scipy.optimize, "minimize", lambda *given, **named: asked.append(1) or search(*given, **named))
    rng = np.random.default_rng(8)
    own, rows = np.cumsum(rng.standard_normal(400)) * 0.1 + rng.standard_normal(400), rng.standard_normal((2, 400))
    ways = (own, None), (own, rows), (own, rows[::-1]), (own + 1e-9, None)
    first = [first_order(*way) for way in ways]
    assert len(asked) == len(ways)
    for found, again in zip(first, [first_order(*way) for way in ways], strict=True):
        assert (found.decay, found.average, found.alternatives) == (again.decay, again.average, again.alternatives)
        np.testing.assert_array_equal(found.innovations, again.innovations)
    assert len(asked) == len(ways)


def test_an_autoregression_is_recovered():
    noise = describe(correlated_noise(20000, 0.7, 1))
    assert noise.coefficients[0] == pytest.approx(0.7, abs=0.05)
    assert noise.covariance[3] / noise.covariance[0] == pytest.approx(0.7**3, abs=0.05)
    assert noise.inflation == pytest.approx(1.7 / 0.3, rel=0.2)
    white = np.random.default_rng(2).standard_normal(20000)
    assert not describe(white).correlated
    rows = np.stack([np.ones(500), np.linspace(-1, 1, 500), np.random.default_rng(3).standard_normal(500)])
    column = np.zeros(500)
    count = min(500, len(noise.covariance))
    column[:count] = noise.covariance[:count]
    np.testing.assert_allclose(noise.spread(rows), rows @ toeplitz(column) @ rows.T, rtol=1e-9, atol=1e-9)
    slow = noise.spread(rows)[0, 0] / (500 * noise.covariance[0])  # what is slow sees the memory
    assert slow == pytest.approx(1.7 / 0.3, rel=0.2)


def test_bootstrap_profile_and_covariance_agree_where_noise_is_white():
    fit = lab.stepped()
    draws = ss.experiments.bootstrap(fit, 200)
    assert draws.details["converged"] == 1
    for name in fit.names:
        assert draws.error(name) == pytest.approx(fit.errors[name], rel=0.2)
    outline = ss.experiments.profile(fit, "d_c")
    assert outline.gaussian
    low, high = outline.interval(0.95)
    assert (low, high) == pytest.approx(fit.interval("d_c"), rel=0.01)
    assert np.min(outline.rise) == pytest.approx(0, abs=1e-3)
    assert str(outline).startswith("friction.d_c, 95 %")


@pytest.mark.slow
@pytest.mark.campaign
def test_posterior_agrees_with_the_covariance_where_the_likelihood_is_gaussian():
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300))
    draws = ss.experiments.posterior(fit, 500, walkers=24)
    assert 0.2 < draws.details["acceptance"] < 0.8
    for name in fit.names:
        assert draws.error(name) == pytest.approx(fit.errors[name], rel=0.3)
        assert np.mean(draws[name]) == pytest.approx(fit.values[name], abs=0.5 * fit.errors[name])
    handed = draws.to_arviz()
    assert handed["posterior"].sizes["chain"] == 24
    first = handed["posterior"]["friction.a"]
    assert first.attrs["units"] == "1"
    np.testing.assert_array_equal(first.values.ravel(), draws["friction.a"])
    best = draws.log_probability.argmax()
    assert abs(draws["friction.d_c"][best] / fit.values["friction.d_c"] - 1) < 3 * fit.errors["friction.d_c"] / 1e-5
    assert handed["sample_stats"]["lp"].values.max() == draws.log_probability[best]
    assert ss.experiments.normal_draws(fit, 10).to_arviz()["posterior"].sizes["draw"] == 10


def test_draws_bring_data_likelihood_and_predictions_to_arviz():
    arviz = pytest.importorskip("arviz")
    fit = ss.fit(
        ss.lab_rig(), [lab.record(lab.rig(), lab.STEP, seed, count=200) for seed in (1, 2)], errors="independent"
    )
    draws = ss.experiments.normal_draws(fit, 400)
    handed = draws.to_arviz()
    record = fit.plan.records[1]
    np.testing.assert_array_equal(handed["observed_data"]["friction_2"], record.friction)
    np.testing.assert_array_equal(handed["posterior_predictive"]["friction_2.time"], record.time)
    assert handed["observed_data"]["friction_2"].attrs["units"] == "1"
    assert handed["posterior_predictive"]["friction_2.time"].attrs["units"] == "s"
    likely = handed["log_likelihood"]
    total = sum(likely[name].values.sum(axis=-1) for name in ("friction_1", "friction_2")).ravel()
    z = fit.space.coordinates(np.column_stack([draws.values[name] for name in fit.names]))
    drop = np.einsum("ij,ij->i", z - fit.coordinates, np.linalg.solve(fit.covariance, (z - fit.coordinates).T).T)
    assert np.max(np.abs(total - total.max() + 0.5 * (drop - drop.min()))) < 1.0
    assert float(arviz.loo(handed, var_name="friction_1").elpd_loo) > 0
    off = handed["posterior_predictive"]["friction_1"].values - fit.plan.records[0].friction
    assert np.std(off) == pytest.approx(np.sqrt(2) * fit.rms, rel=0.05)  # both have their noise
    assert "observed_data" not in draws.to_arviz(samples=False).groups()


def test_noise_has_the_density_of_its_covariance():
    generator = np.random.default_rng(1)
    pushes = generator.standard_normal(4000)
    own = np.zeros(4000)
    for i in range(1, 4000):
        own[i] = 0.8 * own[i - 1] + pushes[i]
    noise = describe(own)
    drawn = noise.drawn(300, 60, generator)
    assert np.var(drawn) == pytest.approx(noise.covariance[0], rel=0.1)
    column = np.zeros(60)
    column[: len(noise.covariance)] = noise.covariance[:60]
    joint = multivariate_normal(np.zeros(60), toeplitz(column)).logpdf(drawn)
    own = noise.log_density(drawn).sum(axis=1)
    assert np.mean(own) == pytest.approx(np.mean(joint), abs=1.0)  # the first samples are taken as independent
    assert np.std(own - joint) < 1.0


def test_chains_that_have_not_mixed_are_named():
    fit = lab.stepped()
    told = str(ss.experiments.posterior(fit, 40, walkers=12))
    assert "the chains have not mixed" in told
    assert "have not mixed" not in str(ss.experiments.normal_draws(fit, 100))
    chance = np.random.default_rng(0)
    same = chance.standard_normal((20, 200))
    assert spread_of_chains(same) == pytest.approx(1, abs=0.02)
    assert spread_of_chains(same + 2 * np.arange(20)[:, None]) > 2
    assert spread_of_chains(same + np.linspace(0, 4, 200)) > 1.3


@pytest.mark.campaign
def test_blocks_keep_correlation():
    fit = lab.basalt()
    assert fit.correlated
    blocks = ss.experiments.bootstrap(fit, 40)
    single = ss.experiments.bootstrap(fit, 40, kind="residual")
    assert blocks.details["block"] == pytest.approx(54, abs=5)
    for name in ("friction.a", "friction.d_c", "slider.stiffness"):
        assert blocks.error(name) > 1.7 * single.error(name)
        assert blocks.error(name) == pytest.approx(fit.errors[name], rel=0.5)


def test_a_jump_at_an_unknown_time_makes_errors_that_are_not_gaussian():
    """After a small step the first response is lost between samples; the fit says so, and the profile knows it."""
    rig = lab.rig(alpha=0.45)
    protocol = ss.Protocol(
        pieces=(
            ss.protocol.VelocityStep(at=60.13, to=3e-6),
            ss.protocol.NormalStressStep(at=140.37, by=-0.02 * lab.STRESS),
        ),
        until=260.0,
    )
    fit = ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), lab.record(rig, protocol, 3, count=800))
    assert "errors of parameters that depend on the jump" in " ".join(str(fit).split())
    assert "the load point is measured" not in str(fit)
    outline = ss.experiments.profile(fit, "alpha", reach=8, count=65)
    low, high = outline.interval(0.999)
    assert low < 0.45 < high
    assert not outline.gaussian
    assert "not Gaussian" in str(outline)


# -- what the data cannot tell


def test_alpha_is_not_given_an_absurd_error_from_a_velocity_step():
    fit = ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), lab.record(lab.rig(), lab.STEP))
    (lost_one,) = fit.unidentified
    assert set(lost_one.weights) == {"friction.normal_memory.alpha"}
    assert not fit["alpha"].determined
    assert fit["a"].determined
    assert "friction.normal_memory.alpha is not determined by these data" in str(fit)
    assert fit.to_dict()["parameters"]["friction.normal_memory.alpha"]["error"] is None


PRESSED_ONCE = ss.Protocol(pieces=(ss.protocol.NormalStressStep(at=60.41, by=0.08 * lab.STRESS),), until=150.0)


VALLEY = ("friction.normal_memory.alpha", "friction.b", "friction.d_c", "slider.stiffness")


def pressed_once(seed):
    """Fit to one step of the normal stress at constant rate, from the truth to the minimum beside it; and the truth."""
    rig = lab.rig(alpha=0.3)
    plan = make_plan(ss.lab_rig(normal_memory="linker-dieterich"), lab.record(rig, PRESSED_ONCE, seed))
    comparison, space = plan.comparison(), plan.space()
    values = {name: one.value for name, one in rig.parameters().items()}
    begin = np.array(
        [[one.coordinate(values.get(one.parameter, 0.5 * (one.low + one.high))) for one in space.unknowns]]
    )
    found = minimise(lambda z, _: comparison.residuals(z), begin, space.low, space.high)
    search = replace(lab.stepped().search, converged=bool(found.converged[0]))
    fit = fit_with_errors(Fit, plan, comparison, found.coordinates[0], search, "auto", (space.low, space.high))
    return fit, {name: values[name] for name in fit.names if name in values}


def test_all_parameters_of_an_open_direction_are_marked():
    """a, b, d_c, alpha and k can be exchanged over a long valley; none has an error, each names the others."""
    fit, truth = pressed_once(0)
    assert fit["mu_ref"].low < truth["friction.mu_ref"] < fit["mu_ref"].high
    lost = {*VALLEY, "friction.a"}
    assert {one.name for one in fit.estimates if not one.determined} >= lost
    for name in lost:
        assert set(fit[name].along) >= lost - {name}
    assert "friction.normal_memory.alpha" in str(fit["b"]).partition("not determined by these data (with ")[2]
    assert not {"a - b", "k_c"} & {one.name for one in fit.derived}


@pytest.mark.parametrize("seed", [4, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(5, 12))])
def test_errors_along_a_valley_are_as_long_as_the_valley(seed):
    """No interval leaves the truth out, although the curvature at the minimum says a third of the valley's length."""
    fit, truth = pressed_once(seed)
    for name in VALLEY:
        one, value = fit[name], truth[name]
        assert not one.determined or one.low < value < one.high, one


def soft_fit(seed):
    """Fit of a record of a press at 2.45 of the critical stiffness, with white noise."""
    source = lab.rig(ss.laws.Aging(), a=0.01255, b=0.01341, d_c=7.18e-6).with_values(
        {"slider.stiffness": 1.24e9, "contact.steady_normal_stress": 4.2e6}
    )
    pieces = tuple(ss.protocol.VelocityStep(at=at, to=to) for at, to in ((30.1, 3e-6), (59.1, 1e-6)))
    record = lab.record(source, ss.Protocol(pieces=pieces, until=145.0), seed, 1e-3, count=354)
    return ss.fit(ss.lab_rig("aging"), record, errors="independent")


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(2, 8))])
def test_a_valley_longer_than_its_curvature_lessens_no_error(seed):
    """Whatever follows from the parameters, a - b too, is known no better than without the length of the valley."""
    fit = soft_fit(seed)
    rows = fit.comparison.residuals(fit.coordinates[None])[1][0]
    information = rows @ rows.T
    linear = fit.ssq / fit.degrees * np.linalg.inv(information)
    wider = along_valleys(fit.plan, fit.comparison, fit.coordinates, fit.bounds, information, linear)[0]
    known = np.isfinite(np.diag(wider))
    gained = (wider - linear)[np.ix_(known, known)] / np.outer(size := np.sqrt(np.diag(linear)[known]), size)
    assert np.min(np.linalg.eigvalsh(gained)) > -1e-9
    assert np.max(gained) > 0.2


def test_a_normal_stress_history_leaves_one_direction_open():
    """At constant load-point velocity (a, b, d_c, alpha) have one direction without effect, to first order."""
    protocol = ss.Protocol(
        pieces=(ss.protocol.NormalStressHarmonic(amplitude=1e-4 * lab.STRESS, period=15.0, at=20.0),), until=200.0
    )
    small = ss.experiments.precision(lab.rig(alpha=0.4), protocol, fixed=["slider.stiffness"], noise=2e-6)
    (open_one,) = small.unidentified
    names = {"friction.a", "friction.b", "friction.d_c", "friction.normal_memory.alpha"}
    assert set(open_one.weights) <= names
    assert len(open_one.weights) >= 3
    for name in names:
        assert not np.isfinite(small.errors[name])
    large = replace(
        protocol, pieces=(ss.protocol.NormalStressHarmonic(amplitude=0.05 * lab.STRESS, period=15.0, at=20.0),)
    )
    assert not ss.experiments.precision(lab.rig(alpha=0.4), large, fixed=["slider.stiffness"], noise=1e-4).unidentified
    both = protocol + ss.protocol.VelocityStep(at=100.0, to=3e-6)
    assert not ss.experiments.precision(lab.rig(alpha=0.4), both, fixed=["slider.stiffness"], noise=2e-7).unidentified


@pytest.mark.campaign
def test_stiffness_and_slip_distance_of_a_short_record():
    """Before the state has evolved, only slopes are seen."""
    protocol = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=30.13, to=1.2e-6),), until=33.0)
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), protocol, count=300), starts=8)
    lost_names = {name for one in fit.unidentified for name in one.weights}
    assert "friction.d_c" in lost_names
    with pytest.raises(ss.NotAvailable, match="does not determine"):
        ss.experiments.normal_draws(fit)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_window_much_wider_than_the_error_of_a_time_hardly_lessens_errors(seed):
    """A noisy displacement makes it so wide; the search, which does not know of it, scatters as without."""
    seen = lab.record(lab.rig(), lab.STEP, seed, 8 * lab.NOISE, count=400)
    place = seen.displacement + 5e-8 * np.random.default_rng(3).standard_normal(400)
    record = ss.record_from_arrays(seen.time, friction=seen.friction, normal=seen.normal, displacement=place)
    fit = ss.fit(ss.lab_rig(), record, starts=9)
    rows = fit.comparison.residuals(fit.coordinates[None])[1][0]
    inverse = np.linalg.inv(rows @ rows.T)
    alone = np.sqrt(np.diag(inverse @ fit.noise[0].spread(rows) @ inverse))
    wide = alone[fit.names.index("step.1.at")]
    assert 0.1 < wide < 0.25  # of the window
    k = fit.names.index("slider.stiffness")
    assert 0.97 * alone[k] < np.sqrt(fit.covariance[k, k]) < 1.01 * alone[k]
