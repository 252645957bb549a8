"""Records that slide from the start, but not steadily: where they begin is fitted, and what they tell is unbiased."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.planning import make_plan

STEPS = ss.Protocol(
    pieces=(
        ss.protocol.VelocityStep(at=20.0, to=3e-6),
        ss.protocol.VelocityStep(at=80.37, to=9e-6),
        ss.protocol.VelocityStep(at=130.21, to=3e-6),
    ),
    until=200.0,
)
CUT = 22.0  # s: 2 s, half a slip distance, after a step, where friction and state are far from steady


def cut(seed, evolution=None, noise=lab.NOISE, rig=None, count=600):
    """A record that begins soon after a step of the rate, and the state it begins with."""
    found = lab.columns(rig or lab.rig(evolution), STEPS, count)
    friction = found["friction"] + noise * np.random.default_rng(seed).standard_normal(count)
    keep = found["time"] >= CUT
    columns = {name: values[keep] for name, values in found.items()} | {"friction": friction[keep]}
    return ss.record_from_arrays(**columns, source="cut")


def truth(rig):
    """How far friction and state are from steady sliding at the new rate where the record begins: by the simulator."""
    first = cut(0).time[0]
    run = ss.simulate(rig, STEPS, times=np.array([0.0, first, 200.0]), rtol=1e-10, events=False)
    settled = -np.log(3.0)
    level = 0.62 + (lab.TRUTH["a"] - lab.TRUTH["b"]) * np.log(3.0)
    return run["friction"][1] - level, run["Theta"][1] - settled


@pytest.mark.parametrize(("evolution", "guess"), [(ss.laws.Slip(), "slip"), (ss.laws.Aging(), "aging")])
def test_where_a_record_begins_is_found(evolution, guess):
    fit = ss.fit(ss.lab_rig(guess), cut(1, evolution), initial="free")
    friction, state = truth(lab.rig(evolution))
    assert abs(fit["initial.friction"].value - friction) < 3.5 * fit["initial.friction"].error
    assert abs(fit["initial.Theta"].value - state) < 3.5 * fit["initial.Theta"].error
    assert abs(friction) > 20 * fit["initial.friction"].error
    assert fit.rms == pytest.approx(lab.NOISE, rel=0.1)
    for name, value in (("a", 0.011), ("b", 0.0145), ("d_c", 12e-6), ("stiffness", lab.STIFFNESS)):
        assert abs(fit[name].value - value) < 3.5 * fit[name].error
    assert "not steady at first" in " ".join(str(fit).split())


@pytest.mark.campaign
def test_a_b_and_d_c_are_unbiased_and_their_intervals_contain_the_truth():
    """Deviations of 12 replicates in quoted errors have mean zero and size one."""
    guess, names = ss.lab_rig(), ("friction.a", "friction.b", "friction.d_c", "slider.stiffness")
    values = (0.011, 0.0145, 12e-6, lab.STIFFNESS)
    off = []
    for seed in range(12):
        fit = ss.fit(guess, cut(seed, count=400), initial="free", starts=3)
        places = [fit.index(name) for name in names]
        z = [fit.space.unknowns[k].coordinate(value) for k, value in zip(places, values, strict=True)]
        off.append((fit.coordinates[places] - z) / np.sqrt(np.diag(fit.covariance)[places]))
    assert np.all(np.abs(np.mean(off, axis=0)) < 4 / np.sqrt(12))
    assert np.mean(np.abs(off) < 1.96) > 0.85


def test_taken_as_steady_it_is_wrong_and_the_fit_says_so():
    fit = ss.fit(ss.lab_rig(), cut(1))
    assert fit.rms > 4 * lab.NOISE
    assert "initial = 'free'" in " ".join(str(fit).split())
    assert "initial = 'free'" not in " ".join(str(lab.stepped()).split())


def test_steady_sliding_is_found_to_be_steady():
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 2, count=400), initial="free")
    assert abs(fit.values["initial.friction"]) < 3.5 * fit.errors["initial.friction"]
    plain = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 2, count=400))
    assert fit.ssq <= plain.ssq * (1 + 1e-7)


@pytest.mark.parametrize(
    "guess",
    [pytest.param(ss.lab_rig(states=2), marks=pytest.mark.campaign), ss.lab_rig(normal_memory="linker-dieterich")],
    ids=["two states", "linker-dieterich"],
)
def test_derivatives_in_where_it_begins_are_slopes(guess):
    """The other route: central differences; in the stiffness too, which the friction of the beginning goes with."""
    record = cut(3)
    plan = make_plan(guess, record, initial="free")
    comparison = plan.comparison()
    space = comparison.space
    known = {"friction.a": 0.01, "friction.b": 0.012, "friction.d_c": 1e-5, "friction.mu_ref": 0.6,
             "slider.stiffness": 1e10, "friction.states.1.b": 0.007, "friction.states.1.d_c": 1e-5,
             "friction.states.2.b": 0.005, "friction.states.2.d_c": 1e-4, "friction.normal_memory.alpha": 0.3,
             "initial.friction": 0.004}  # fmt: skip
    begins = [u.name for u in space.unknowns if u.name.startswith("initial.")]
    assert len(begins) >= 2
    values = [known.get(u.name, 0.4 * u.size if u.name in begins else 0.5 * (u.low + u.high)) for u in space.unknowns]
    z = space.coordinates(np.array([v if np.isfinite(v) else 0.5 for v in values]))
    _, slopes = comparison.model(z[None])
    for name in (*begins, "slider.stiffness"):
        i = [u.name for u in space.unknowns].index(name)
        step = 1e-3 * np.eye(len(z))[i]
        ends = comparison.model(np.array([z + step, z - step]))[0]
        numeric = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(slopes[0, i], numeric, atol=2e-3 * np.max(np.abs(numeric)), err_msg=name)
    np.testing.assert_allclose(comparison.misfit(z[None])[0], np.sum(comparison.residuals(z[None])[0] ** 2), rtol=1e-5)


def test_a_memory_of_the_normal_stress_has_settled():
    plan = make_plan(ss.lab_rig(normal_memory="prakash-clifton"), cut(3), initial="free")
    begins = [one.name for one in plan.space().unknowns if one.name.startswith("initial.")]
    assert begins == ["initial.friction", "initial.Theta"]  # not sigma_e


def test_the_drive_may_be_the_spring():
    """A servo that pushes in proportion to what the load point lacks, behind no spring of its own."""
    base = lab.rig()
    plain = make_plan(base, cut(3), ["friction.a", "slider.stiffness"], initial="free")
    servo = replace(base, stiffness=0.0, drive=ss.machine.PID(velocity=lab.SLOW, kp=lab.STIFFNESS))
    other = make_plan(servo, cut(3), ["friction.a", "drive.kp"], initial="free")
    names = [one.name for one in plain.space().unknowns]
    values = [{"friction.a": 0.01, "slider.stiffness": 1e10, "initial.friction": 0.004}.get(n, 0.3) for n in names]
    z = plain.space().coordinates(np.array(values))
    own = other.space().coordinates(
        np.array([dict(zip(names, values, strict=True)).get(one.name, 1e10) for one in other.space().unknowns])
    )
    np.testing.assert_allclose(other.comparison().model(own[None])[0], plain.comparison().model(z[None])[0], rtol=1e-6)


def test_every_record_begins_on_its_own_and_a_file_keeps_that(tmp_path):
    fit = ss.fit(ss.lab_rig(), [cut(1, count=400), cut(2, count=400)], initial="free", starts=3)
    assert {"initial.Theta@1", "initial.Theta@2"} <= set(fit.names)
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert again.names == fit.names
    np.testing.assert_allclose(again.model, fit.model)


@pytest.fixture(scope="module")
def fit():
    return ss.fit(ss.lab_rig(), cut(1, count=400), initial="free", starts=3)


def test_figures_name_what_is_fitted_of_the_beginning(fit):
    """`friction` alone would be the record's."""
    panels = np.ravel(fit.plot("corner"))
    labels = {text for panel in panels if panel is not None for text in (panel.get_xlabel(), panel.get_ylabel())}
    assert {"friction at first (1)", "Theta at first (1)"} <= labels


@pytest.mark.parametrize("count", [27, 1000])
def test_histograms_of_few_draws_have_few_bars(count, fit):
    panels = np.ravel(ss.experiments.normal_draws(fit, count).plot())
    bars = len(next(panel for panel in panels if panel is not None).patches)
    assert bars == round(2 * count ** (1 / 3))
