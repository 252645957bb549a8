"""Several experiments on one rock: the population comes back, with errors that mean what they say."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

import lab_records as lab
import steadyslip as ss
from command import run
from steadyslip.experiments.answers.members import problems_together
from steadyslip.experiments.numerics.pooling import ExperimentEstimate, log_evidence, pooled

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"
MEAN, SPREAD = np.array([-4.5, 1.2]), np.array([0.12, 0.05])


def experiments(seed, count, errors=(0.03, 0.04), slope=None):
    """What experiments say of two coordinates that are correlated in each; the truth of every one."""
    rng = np.random.default_rng(seed)
    told, truth = [], []
    for j in range(count):
        x = np.array([1.0]) if slope is None else np.array([1.0, j - 0.5 * (count - 1)])
        own = MEAN + (0.0 if slope is None else slope * x[1]) + SPREAD * rng.standard_normal(2)
        deviation = np.array(errors) * 10 ** rng.uniform(-0.3, 0.3, 2)
        covariance = np.outer(deviation, deviation) * np.array([[1.0, 0.8], [0.8, 1.0]])
        told.append(ExperimentEstimate(np.arange(2), rng.multivariate_normal(own, covariance), covariance, x))
        truth.append(own)
    return told, np.array(truth)


@pytest.mark.campaign
def test_the_full_joint_posterior_sampled_by_emcee_is_the_same():
    """The other route: mean, spreads, correlation and all members sampled together, nothing integrated out."""
    import emcee

    told, _ = experiments(3, 3)
    found = pooled(told, 2, np.ones(2), 4000, 1)

    inverse = np.array([np.linalg.inv(one.covariance) for one in told])
    values = np.array([one.values for one in told])

    def log_probability(z):
        mean, log_spread, u = (
            z[:, None, :2],
            z[:, 2:4],
            z[:, 4:10].reshape(-1, 3, 2),
        )  # members in spreads from the mean
        spread, correlation = np.exp(log_spread), z[:, 10]
        inside = np.all((log_spread > -16) & (log_spread < 4), axis=1) & (np.abs(correlation) < 1)
        left = 1 - np.where(inside, correlation, 0.0) ** 2
        r = values - mean - u * spread[:, None]
        value = np.sum(0.5 * log_spread - 0.5 * spread**2, axis=1) - 1.5 * np.log(left)
        value += 2 * np.log(left)  # the prior of the correlation
        square = np.sum(u**2, axis=2) - 2 * correlation[:, None] * u[:, :, 0] * u[:, :, 1]
        value -= 0.5 * np.sum(square, axis=1) / left + 0.5 * np.einsum("mjk,jkl,mjl->m", r, inverse, r)
        return np.where(inside, value, -np.inf)

    rng = np.random.default_rng(0)
    centre = np.concatenate([MEAN, np.log([0.1, 0.1]), np.zeros(6), [0.0]])
    sampler = emcee.EnsembleSampler(
        64, 11, log_probability, vectorize=True, moves=[(emcee.moves.DEMove(), 0.8), (emcee.moves.StretchMove(), 0.2)]
    )
    sampler._random = np.random.RandomState(4)
    sampler.run_mcmc(centre + 0.02 * rng.standard_normal((64, 11)), 3000)
    chain = sampler.get_chain(discard=700, flat=True)
    chain[:, 4:10] = np.tile(chain[:, :2], 3) + chain[:, 4:10] * np.tile(np.exp(chain[:, 2:4]), 3)
    correlation = found.root[:, 1, 0] / found.spread[:, 1]
    ours = np.column_stack([found.mean[:, :, 0], np.log(found.spread), found.members.reshape(-1, 6), correlation])
    for level in (0.1, 0.5, 0.9):
        theirs = np.quantile(chain, level, axis=0)
        np.testing.assert_allclose(
            np.quantile(ours, level, axis=0), theirs, atol=0.2 * np.std(chain, axis=0).max(), rtol=0.02
        )


def test_the_spread_of_five_exact_estimates():
    """Its posterior in closed form: with the half-normal prior alone its median was a fifth larger."""
    values = 0.1 * np.array([-1.2, -0.4, 0.1, 0.6, 0.9])
    told = [ExperimentEstimate(np.array([0]), np.array([one]), np.array([[1e-12]]), np.ones(1)) for one in values]
    found = pooled(told, 1, np.ones(1), 4000, 1).spread[:, 0]
    s = np.geomspace(0.01, 3, 20_000)
    log_density = -4.5 * np.log(s) - 0.5 * s**2 - 0.5 * np.sum((values - values.mean()) ** 2) / s**2
    mass = np.exp(log_density - log_density.max()) * np.gradient(s)
    middle = np.interp(0.5, np.cumsum(mass) / np.sum(mass), s)
    assert np.median(found) == pytest.approx(middle, rel=0.06)


def test_known_spreads_leave_generalised_least_squares():
    """Given the spread, the mean is that of weighted least squares of stacked estimates."""
    told, _ = experiments(5, 6, slope=np.array([0.02, -0.01]))
    _, precision, best = log_evidence(told, np.diag(SPREAD**2)[None])
    rows = np.concatenate([one.slopes(2) for one in told])
    variance = np.zeros((12, 12))
    for j, one in enumerate(told):
        variance[2 * j : 2 * j + 2, 2 * j : 2 * j + 2] = one.covariance + np.diag(SPREAD**2)
    information = rows.T @ np.linalg.solve(variance, rows)
    values = np.concatenate([one.values for one in told])
    np.testing.assert_allclose(precision[0], information, rtol=1e-12)
    np.testing.assert_allclose(
        best[0], np.linalg.solve(information, rows.T @ np.linalg.solve(variance, values)), rtol=1e-10
    )


@pytest.mark.parametrize("count", [4])
@pytest.mark.campaign
def test_intervals_contain_the_truth_as_often_as_they_say(count):
    """Means, spreads and members of populations of few experiments; see benchmarks/population.py for many."""
    trials = 10
    hits = {"mean": 0, "spread": 0, "members": 0}
    for seed in range(trials):
        told, truth = experiments(seed, count)
        found = pooled(told, 2, np.ones(2), 400, seed)
        for what, draws, value in (
            ("mean", found.mean[:, 0, 0], MEAN[0]),
            ("spread", found.spread[:, 0], SPREAD[0]),
            ("members", found.members[:, 0, 0], truth[0, 0]),
        ):
            low, high = np.quantile(draws, [0.025, 0.975])
            hits[what] += low <= value <= high
    for what, hit in hits.items():
        assert binom.cdf(hit, trials, 0.95) > 1e-3, what
        assert what == "members" or hit >= 0.75 * trials


def test_experiments_that_say_little_are_drawn_to_the_others():
    """Partial pooling lies between none and complete, and leaves smaller errors than none."""
    told, truth = experiments(11, 8, errors=(0.05, 0.05))
    vague = ExperimentEstimate(np.arange(2), truth[0] + 0.6, 0.5**2 * np.eye(2), np.array([1.0]))
    found = pooled([*told, vague], 2, np.ones(2), 1000, 0)
    own = found.members[:, -1]
    assert np.all(np.std(own, axis=0) < 0.3)
    assert np.all(np.mean(own, axis=0) < truth[0] + 0.35)
    unseen = ExperimentEstimate(
        np.array([1]), truth[:1, 1], np.array([[1e-4]]), np.array([1.0])
    )  # says nothing of the first
    members = pooled([*told, unseen], 2, np.ones(2), 1000, 0).members[:, -1, 0]
    assert np.mean(members) == pytest.approx(MEAN[0], abs=0.15)
    assert np.std(members) > 0.8 * SPREAD[0]


def test_an_experiment_that_determines_nothing_is_one_more_rock():
    """The others are drawn as without it, and it as a rock that is not among them."""
    told, _ = experiments(11, 8, errors=(0.05, 0.05))
    none = ExperimentEstimate(np.array([], dtype=int), np.empty(0), np.empty((0, 0)), np.array([1.0]))
    found = pooled([*told, none], 2, np.ones(2), 1000, 0)
    np.testing.assert_array_equal(found.root, pooled(told, 2, np.ones(2), 1000, 0).root)
    other, member = found.another(1), found.members[:, -1]
    np.testing.assert_allclose(np.mean(member, axis=0), np.mean(other, axis=0), atol=0.2 * np.std(other, axis=0).max())
    np.testing.assert_allclose(np.std(member, axis=0), np.std(other, axis=0), rtol=0.15)


@pytest.fixture(scope="module")
def fits():
    """Six experiments on one rock at three normal stresses; a rises with the stress."""
    rng = np.random.default_rng(8)
    found = {}
    for j, stress in enumerate((5e6, 5e6, 10e6, 10e6, 20e6, 20e6)):
        a = 0.011 * (stress / 10e6) ** 0.2 * np.exp(0.02 * rng.standard_normal())
        rig = lab.rig(a=a).with_values(
            {"contact.steady_normal_stress": stress, "slider.stiffness": 2e10 * stress / 1e7}
        )
        found[f"run {j + 1}"] = ss.fit(ss.lab_rig(), lab.record(rig, lab.STEP, j, count=400))
    return found


def test_a_population_of_fits(fits):
    everyone = ss.population(fits, count=400)
    assert everyone.draws.mixed
    assert set(everyone.names) == {"friction.a", "friction.mu_ref", "friction.b", "friction.d_c"}
    assert everyone.spread("a")[0] == pytest.approx(0.13, abs=0.08)
    assert everyone.mean("d_c").low < 12e-6 < everyone.mean("d_c").high
    assert everyone.another("a").high - everyone.another("a").low > everyone.mean("a").high - everyone.mean("a").low
    by_stress = ss.population(fits, ["a"], conditions="normal stress", count=400)
    assert by_stress.spread("a")[0] < 0.6 * everyone.spread("a")[0]
    assert by_stress.slope("a", "normal stress")[1] > 0
    text = str(by_stress)
    assert "normal stress" in text
    assert "run 1" in text
    assert by_stress.to_dict()["parameters"]["friction.a"]["mean"]["low"] > 0
    panels = everyone.plot()
    assert len(panels) == 5  # four parameters, and a - b
    assert panels[0].get_xlabel()


def test_a_population_for_arviz(fits):
    """Draws chain by chain, what every experiment has by its label, units, and values as the population's own."""
    arviz = pytest.importorskip("arviz")
    rock = ss.population(fits, ["a", "mu_ref"], conditions="normal stress", count=1000)
    posterior = rock.to_arviz()["posterior"]
    assert dict(posterior.sizes) == {"chain": 40, "draw": 25, "experiment": 6}
    assert list(posterior["experiment"].values) == list(fits)
    assert posterior["friction.a"].attrs["units"] == "1"
    low, high = np.quantile(posterior["friction.a"].sel(experiment="run 3"), [0.025, 0.975])
    own = rock.experiment("run 3", "a")
    assert (low, high) == pytest.approx((own.low, own.high), rel=1e-6)
    assert np.median(posterior["friction.a.normal stress"]) == pytest.approx(rock.slope("a", "normal stress")[0])
    assert np.median(posterior["friction.mu_ref.spread"]) == pytest.approx(rock.spread("mu_ref")[0])
    assert float(arviz.rhat(posterior["friction.a.mean"].values)) < 1.1


def test_rocks_that_have_a_minus_b_alike_tell_of_the_next_one():
    """However a and b differ: the spread of a - b is its own, and verdicts on machines with another rock follow."""
    rng = np.random.default_rng(2)
    fits, level = {}, -0.003
    for j in range(4):
        a = 0.011 * np.exp(0.3 * rng.standard_normal())
        fits[f"p{j}"] = ss.fit(ss.lab_rig(), lab.record(lab.rig(a=a, b=a - level), lab.STEP, j, count=400), starts=4)
    rock = ss.population(fits, ["a", "b", "d_c"], count=400)
    own, negative = rock.another("a - b"), rock.another("b-a")
    assert own.low < level < own.high
    assert own.error < 0.05 * rock.another("a").error
    assert (negative.value, negative.low, negative.high) == pytest.approx((-own.value, -own.high, -own.low), rel=1e-9)
    assert rock.weakening > 0.98
    assert rock.spread("b")[0] == pytest.approx(0.0033, rel=0.5)
    middle, low, high = rock.correlation("a", "b")
    assert 0 < low < middle < high
    assert middle > 0.95
    text = str(rock)
    assert "a - b: mean -0.003" in text
    about = {part.partition(":")[0].split()[-1]: part.partition("differ by")[2] for part in text.split("\n\n")}
    shares = {name: "%" in said.partition("\n")[0] for name, said in about.items() if said}
    assert shares.pop("b") is False  # of a − b, which may be 0
    assert set(shares) > {"friction.a", "friction.b"}
    assert all(shares.values())
    assert "correlated      friction.a and friction.b" in text
    found = rock.others(3)
    np.testing.assert_allclose(found["a - b"], found["friction.a"] - found["friction.b"], rtol=1e-12)
    soft, stiff = (ss.predict(lab.rig().with_values({"slider.stiffness": k}), rock) for k in (1e9, 1e10))
    assert soft.probability_stable < 0.05
    assert stiff.probability_stable > 0.95
    critical = lab.STRESS * -rock.others()["a - b"] / rock.others()["friction.d_c"]
    np.testing.assert_allclose(stiff.critical_stiffness, np.where(critical > 0, critical, np.nan), rtol=1e-9)
    assert "another experiment of a population" in str(stiff)
    with pytest.raises(ss.NotAvailable, match=r"friction\.d_c: fitted, but not in the population"):
        ss.predict(lab.rig(), ss.population(fits, ["a", "b"], count=100))


def test_conditions_by_label_and_the_same_record_twice(fits):
    given = dict(zip(fits, (20.0, 20.0, 150.0, 150.0, 250.0, 250.0), strict=True))
    by_label = ss.population(fits, ["a"], conditions={"temperature": dict(reversed(given.items()))}, count=100)
    listed = ss.population(fits, ["a"], conditions={"temperature": list(given.values())}, count=100)
    assert str(by_label) == str(listed)
    assert "  run 3  temperature 150\n" in str(by_label)
    assert by_label.to_dict()["conditions"]["temperature"] == given
    with pytest.raises(
        ss.ParameterError, match=r"temperature: got values for run 1; allowed: one for each of run 1, run 2"
    ):
        ss.population(fits, ["a"], conditions={"temperature": {"run 1": 20.0}})
    with pytest.raises(ss.ParameterError, match=r"fits\.again: has the record of run 1 again \(synthetic\)"):
        ss.population(fits | {"again": fits["run 1"]})


def test_other_conditions_move_means_and_what_follows(fits):
    """Along the straight line of the means, a prediction for a machine as well; beyond the experiments it is told."""
    rock = ss.population(fits, ["a", "b", "d_c"], conditions="normal stress", count=400)
    ends = {stress: rock.at({"normal stress": stress}) for stress in (5e6, 20e6)}
    low, high = (ends[stress].mean("a").value for stress in (5e6, 20e6))
    assert high / low == pytest.approx(4**0.2, rel=0.05)
    slope = rock.slope("a", "normal stress")[0]
    assert np.log(high / low) == pytest.approx(15e6 * slope, rel=0.02)
    middle = rock.at({"normal stress": np.mean([5e6, 10e6, 20e6])})
    assert middle.mean("a").value == pytest.approx(rock.mean("a").value, rel=1e-12)
    others = {stress: np.median(one.others()["friction.a"]) for stress, one in ends.items()}
    assert others[20e6] / others[5e6] == pytest.approx(high / low, rel=0.02)
    told = str(ss.predict(lab.rig(), ends[20e6], count=100))
    assert "another experiment of a population at normal stress 20 MPa" in told
    assert "means           at normal stress 5 MPa" in str(ends[5e6])
    there = str(rock.at({"normal stress": 40e6}))
    assert "! normal stress 40 MPa is outside 5 MPa to 20 MPa" in there
    assert "mean at normal stress 40 MPa " in there
    assert "another experiment at normal stress 40 MPa, 95 %" in there
    with pytest.raises(ss.ParameterError, match=r"where: got 40000000\.0; allowed: numbers by the name of a condition"):
        rock.at(40e6)
    for wrong, words in (({"stress": 1e6}, "allowed: 'normal stress'"), ({"normal stress": "hot"}, "finite number")):
        with pytest.raises(ss.ParameterError, match=words):
            rock.at(wrong)


def test_the_same_record_cut_thinned_or_averaged_is_not_another():
    measured = [lab.record(lab.rig(), lab.STEP, seed, count=600) for seed in (1, 2)]
    first = measured[0]
    fits = {str(i): ss.fit(ss.lab_rig(), one, starts=2) for i, one in enumerate(measured)}
    assert problems_together(fits) == []
    for same in (first.decimated(250), first.between(20, 120), first.taken(np.arange(0, 600, 2), "thinned")):
        again = ss.fit(ss.lab_rig(), same, starts=2)
        assert [one.name for one in problems_together(fits | {"again": again})] == ["fits.again"]


def test_a_level_of_friction_that_the_population_lacks_is_the_rigs(fits):
    rock = ss.population(fits, ["a", "b", "d_c"], count=100)
    found = ss.predict(lab.rig(mu_ref=0.7), rock)
    assert found.rig.value("friction.mu_ref") == 0.7
    assert "not in the population   friction.mu_ref = 0.7, taken from the rig" in str(found)
    whole = ss.population(fits, ["a", "b", "d_c", "mu_ref"], count=100)
    assert "not in the population" not in str(ss.predict(lab.rig(mu_ref=0.7), whole))


def test_a_population_read_back_says_the_same(fits, tmp_path):
    rock = ss.population(fits, ["a", "mu_ref"], conditions="normal stress", count=400)
    rock.save(tmp_path / "rock.nc")
    again = ss.experiments.load_population(tmp_path / "rock.nc")
    assert str(again) == str(rock)
    assert again.to_dict() == rock.to_dict()
    assert again.another("a", seed=3) == rock.another("a", seed=3)
    with pytest.raises(ss.NotAvailable, match="it holds a population and is not a steadyslip fit"):
        ss.load_fit(tmp_path / "rock.nc")


def test_levels_of_friction_at_different_rates_are_no_population(fits):
    other = ss.fit(ss.lab_rig(v_ref="2 um/s"), lab.record(lab.rig(), lab.STEP, 9, count=400))
    with pytest.raises(ss.ParameterError, match=r"v_ref: differs between the fits .*run 1 1 um/s.*other 2 um/s"):
        ss.population(fits | {"other": other})


SPEC = """
[friction]
evolution = "slip"
{}
[population]
parameters = ["a", "mu_ref"]
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Three files of records that begin at different rates."""
    folder = tmp_path_factory.mktemp("rock")
    for j, (a, rate) in enumerate([(0.010, 1e-6), (0.011, 2e-6), (0.012, 1e-6)]):
        step = ss.protocol.VelocityStep(at=60.13, to=5e-6)
        rig = lab.rig(a=a).with_values({"drive.velocity": rate})
        found = lab.columns(rig, ss.Protocol(pieces=(step,), until=150.0), count=300)
        friction = found["friction"] + 1e-4 * np.random.default_rng(j).standard_normal(300)
        columns = np.column_stack([found["time"], 1e6 * found["displacement"], friction, 1e-6 * found["normal"]])
        np.savetxt(folder / f"p{j + 1}.csv", columns, delimiter=",", comments="",
                   header="time (s),displacement (um),friction,normal stress (MPa)")  # fmt: skip
    return folder


def fit_all(files, text, *arguments):
    (files / "rock.toml").write_text(text)
    return run("fit", "p1.csv", "p2.csv", "p3.csv", "rock.toml", *arguments, folder=files)


def test_a_population_from_files(files):
    """One command; every level of friction is that at one rate, though the records begin at two."""
    outputs = [word for end in ("json", "png", "html", "nc") for word in ("-o", f"rock.{end}")]
    done = fit_all(files, SPEC.format("") + "draws = 400", *outputs)
    assert done.returncode == 0, done.stderr
    assert "population of 3 experiments" in done.stdout
    assert "p2  alone 0.01" in done.stdout
    found = json.loads((files / "rock.json").read_text())
    levels = found["parameters"]["friction.mu_ref"]["experiments"]
    assert [levels[f"p{j}"]["value"] for j in (1, 2, 3)] == pytest.approx([0.62] * 3, abs=2e-4)
    assert "Population of 3 experiments" in (files / "rock.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert (files / "rock.png").stat().st_size > 5000
    again = ss.experiments.load_population(files / "rock.nc")
    assert {
        label: one["value"] for label, one in again.to_dict()["parameters"]["friction.mu_ref"]["experiments"].items()
    } == {label: one["value"] for label, one in found["parameters"]["friction.mu_ref"]["experiments"].items()}
    judged = run("analyze", EXAMPLE, "--fit", "rock.nc", folder=files)
    assert "friction.b, friction.d_c: fitted, but not in the population" in judged.stderr


def test_a_condition_in_a_file_by_the_names_of_records(files):
    shutil.copy(files / "p3.csv", files / "p4.csv")
    text = (files / "p4.csv").read_text().splitlines()
    noise = np.random.default_rng(9)  # another experiment than p3
    columns = [line.split(",") for line in text[1:]]
    place = text[0].split(",").index(next(name for name in text[0].split(",") if "riction" in name))
    for row in columns:
        row[place] = f"{float(row[place]) + 2e-4 * noise.standard_normal():.8f}"
    (files / "p4.csv").write_text("\n".join([text[0], *map(",".join, columns)]))
    found = {}
    spec = SPEC.format("").replace('parameters = ["a", "mu_ref"]', "")  # all of friction
    for given in ("{p4 = 4, p2 = 2, p1 = 1, p3 = 3}", "[1, 2, 3, 4]"):
        (files / "heat.toml").write_text(spec + f'condition = "heat"\nvalues = {given}\ndraws = 100\n')
        found[given] = ss.experiments.population_files([files / f"p{j}.csv" for j in (1, 2, 3, 4)], files / "heat.toml")
    by_name, in_order = found.values()
    assert by_name.conditions["heat"].tolist() == [1, 2, 3, 4]
    assert by_name.to_dict() == in_order.to_dict()
    by_name.save(files / "heat.nc")
    judged = run("analyze", EXAMPLE, "--fit", "heat.nc", "--json", folder=files)
    assert judged.returncode == 0, judged.stderr
    predicted = ss.predict(ss.read_rig(EXAMPLE), by_name).to_dict()
    assert json.loads(judged.stdout)["prediction"] == json.loads(json.dumps(predicted))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('condition = "temperature"', "population.values: missing; give the temperature of every record"),
        ("values = [1, 2, 3]", "population.condition: missing"),
        ('condition = "normal stress"\nvalues = [1, 2, 3]', "population.values: the normal stress is that"),
        ('condition = "T"\nvalues = [1, 2]', "population: got 3 records; allowed: 4 or more"),
        (
            'condition = "T"\nvalues = {p1 = 1, p2 = 2, q = 3}',
            "population.values: got values for p1, p2, q; allowed: one for each of p1, p2, p3",
        ),
        ('condition = "T"\nvalues = {p1 = "hot"}', "population.values: "),
        ("draws = 5", "population.draws: got 5; allowed: a whole number from 100"),
    ],
)
def test_what_is_wrong_with_a_population_in_a_file(files, text, words):
    done = fit_all(files, SPEC.format("a = 0.01\nb = 0.014\nd_c = '12 um'") + text)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())


def test_a_population_goes_with_one_law_and_no_bootstrap(files):
    done = fit_all(files, SPEC.format("") + "[fit]\ncompare = ['slip', 'aging']\n")
    assert "fit.compare: cannot be combined with [population]" in done.stderr
    assert "--bootstrap: cannot be combined" in fit_all(files, SPEC.format(""), "--bootstrap", 5).stderr
    assert "rock.csv: a population has no table of steps" in fit_all(files, SPEC.format(""), "-o", "rock.csv").stderr


def test_what_cannot_be_a_population_is_refused(fits):
    with pytest.raises(ss.ParameterError, match="3"):
        ss.population(list(fits.values())[:2])
    with pytest.raises(ss.ParameterError, match="finite numbers"):
        ss.population(fits, conditions={"temperature": [1.0, 2.0]})
    with pytest.raises(ss.ParameterError, match=r"fits\.1: got namespace.*; allowed: a Fit"):
        ss.population([SimpleNamespace(), *fits.values()])
    with pytest.raises(ss.ParameterError, match="got none"):
        ss.population([])
