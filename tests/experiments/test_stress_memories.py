"""Records in which the normal stress changes: fits notice it, free a memory of it, and tell which."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

import fits_at_random
import lab_records as lab
import steadyslip as ss
import stress_steps_at_random as random_steps
from steadyslip.experiments.answers.laws import with_law
from steadyslip.experiments.fitting import memories, numbers, remedies
from steadyslip.experiments.fitting.effort import Budget
from steadyslip.experiments.fitting.equal_minima import EqualMinimum, opened
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.spec import spec_from_text

fitting = import_module("steadyslip.experiments.fitting.fit")
ALPHA = 0.3
BY = 0.04 * lab.STRESS
PRESSED = ss.Protocol(
    pieces=(ss.protocol.VelocityStep(at=30.13, to=3e-6), ss.protocol.NormalStressStep(at=60.41, by=BY),
            ss.protocol.NormalStressStep(at=100.41, by=-BY)), until=140.0,
)  # fmt: skip
PRAKASH = ss.laws.PrakashClifton(direct_share=0.4, slip_distance=30e-6)
MEMORIES = ("none", "linker-dieterich", "prakash-clifton")
UNDECIDED = tuple(f"{evolution}, {memory}" for evolution in ("slip", "aging") for memory in MEMORIES)


@cache
def pressed():
    return lab.record(lab.rig(alpha=ALPHA), PRESSED, 1, count=300)


def lagging_rig():
    rig = lab.rig()
    return ss.Slider(
        friction=ss.laws.RateState(**lab.TRUTH, v_ref=lab.SLOW, normal_memory=PRAKASH),
        contact=rig.contact, stiffness=rig.stiffness, drive=rig.drive,
    )  # fmt: skip


@cache
def compared():
    return spec_from_text("[friction]\n").compare([pressed()])


def near(fit, name, truth):
    one = fit[name]
    return one.determined and abs(one.value - truth) < 4 * one.error


def test_a_record_tells_whether_its_normal_stress_was_changed():
    assert pressed().stress_changes
    assert not lab.record(lab.rig(), lab.STEP, count=300).stress_changes
    columns = lab.columns(lab.rig(), lab.STEP, 300)
    for drift, changes in ((0.005, False), (0.1, True)):
        normal = columns["normal"] * np.linspace(1, 1 + drift, 300)
        assert ss.record_from_arrays(**{**columns, "normal": normal}).stress_changes is changes
    del columns["normal"]
    assert not ss.record_from_arrays(**columns).stress_changes


def test_a_file_that_says_nothing_of_it_has_the_memories_compared():
    found = compared()
    assert set(found.fits) == set(UNDECIDED)
    assert found.best == "slip, linker-dieterich"
    best = found.fits[found.best]
    assert near(best, "alpha", ALPHA)
    assert near(best, "a", lab.TRUTH["a"])
    assert "'slip, linker-dieterich' is the best" in str(found)


@pytest.mark.campaign
def test_a_file_that_says_nothing_has_the_evolution_compared_too():
    """With the slip law alone this record is said to have the other memory."""
    record = lab.record(lab.rig(ss.laws.Aging(), alpha=ALPHA), PRESSED, 1, count=300)
    found = spec_from_text("[friction]\n").compare([record])
    assert found.best == "aging, linker-dieterich"
    assert near(found.fits[found.best], "alpha", ALPHA)


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        ('normal_memory = "none"', ()),
        ('normal_memory = "linker-dieterich"', ()),
        ('[fit]\ncompare = ["slip", "aging"]', ("slip", "aging")),
        ('[contact]\nlaw = "inclined-spring"\nangle = "5 deg"\npreload = "10 MPa"', ()),
        ('evolution = "aging"', MEMORIES),
        ("", UNDECIDED),
    ],
)
def test_what_a_file_says_is_kept(text, labels):
    assert spec_from_text(f"[friction]\n{text}\n").compared([pressed()]) == labels


def test_constant_normal_stress_asks_for_no_memory():
    assert spec_from_text("[friction]\n").compared([lab.record(lab.rig(), lab.STEP, count=300)]) == ()


def test_a_change_of_the_memory_frees_what_it_has():
    said = spec_from_text("[friction]\na = 0.011\n", changes=["friction.normal_memory=prakash-clifton"])
    own = {name for name in said.options["free"] if "memory" in name}
    assert own == {"friction.normal_memory.direct_share", "friction.normal_memory.slip_distance"}
    assert "friction.a" not in said.options["free"]
    given = spec_from_text(
        "[friction]\n", changes=["friction.normal_memory=linker-dieterich", "friction.normal_memory.alpha=0.25"]
    )
    assert given.rig.value("friction.normal_memory.alpha") == 0.25
    assert not [name for name in given.options["free"] if "memory" in name]
    for word in ("none", "linker-dieterich", "prakash-clifton"):
        assert make_plan(ss.lab_rig(states=2, normal_memory=word), pressed()).rig.friction.normal_memory.name == word


def test_the_memories_are_told_apart():
    """A lag of the normal stress is no shift of the state, and the other way round."""
    record = lab.record(lagging_rig(), PRESSED, 2, count=300)
    found = ss.compare_laws(ss.lab_rig(), record, MEMORIES)
    assert found.best == "prakash-clifton"
    best = found.fits[found.best]
    assert near(best, "direct_share", PRAKASH.direct_share)
    assert near(best, "slip_distance", PRAKASH.slip_distance)
    assert near(best, "d_c", lab.TRUTH["d_c"])


def test_labels_say_what_is_changed_and_the_rest_is_kept():
    own = ss.lab_rig("aging", normal_memory="linker-dieterich")
    for label, wanted in {
        "slip": ("slip", 0, "linker-dieterich"), "none": ("aging", 0, "none"), "two states": ("aging", 2, own),
        "two states, prz + prakash-clifton": ("prz", 2, "prakash-clifton"), "linker-dieterich": ("aging", 0, own),
    }.items():  # fmt: skip
        law = with_law(own, label).friction
        memory = law.normal_memory if wanted[2] is own else law.normal_memory.name
        assert (law.evolution.name, len(law.states), memory) == (
            *wanted[:2], own.friction.normal_memory if wanted[2] is own else wanted[2]
        )  # fmt: skip
    with pytest.raises(ss.ParameterError, match="linker-dieterich"):
        with_law(own, "linker")


def test_what_is_known_stays_known_in_a_comparison():
    """Values of a file are not fitted, whatever the law; what a law has besides is."""
    spec = spec_from_text('[friction]\na = 0.011\n[slider]\nstiffness = "20 GPa/m"\n')
    found = spec.compare([pressed()], starts=9)
    for label, fit in found.fits.items():
        assert not {"friction.a", "slider.stiffness"} & set(fit.names)
        assert ("friction.normal_memory.alpha" in fit.names) == label.endswith("linker-dieterich")


def test_a_law_that_cannot_follow_is_named_and_the_others_are_compared(monkeypatch):
    from steadyslip.experiments.answers import laws

    whole = laws.search_fit

    def failing(rig, *args, **options):
        if rig.friction.normal_memory.name == "none":
            raise ss.NotAvailable("cannot follow")
        return whole(rig, *args, **options)

    monkeypatch.setattr(laws, "search_fit", failing)
    found = ss.compare_laws(ss.lab_rig(), pressed(), MEMORIES[:2], starts=9)
    assert found.refused == ("none",)
    assert found.best == "linker-dieterich"
    assert "cannot follow the records from any start: none" in str(found)
    with pytest.raises(ss.NotAvailable, match="none of the laws"):
        ss.compare_laws(ss.lab_rig(), pressed(), ["none"])


def test_a_law_without_memory_says_what_one_would_make_of_it():
    fit = compared().fits["slip, none"]
    said = " ".join(str(fit).split())
    assert "no memory of it: with friction.normal_memory = 'linker-dieterich' (normal_memory.alpha 0.3" in said
    assert fit.remedies[0].ssq < 0.1 * fit.ssq
    assert fit.to_dict()["remedies"][0]["choice"] == "friction.normal_memory = 'linker-dieterich'"
    constant = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300), starts=9)
    assert constant.remedies == ()
    assert "no memory" not in str(constant)


def test_white_residuals_speak_for_no_memory():
    by = 0.01 * lab.STRESS  # of more the block would be left behind, or run ahead, with no memory at all
    protocol = ss.Protocol(
        pieces=(ss.protocol.VelocityStep(at=30.13, to=3e-6), ss.protocol.NormalStressStep(at=60.41, by=by)), until=120
    )
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), protocol, 1, count=300))
    assert (
        "residuals are noise, and the fit is worse with the memories that were tried, which speaks against them"
        in " ".join(str(fit).split())
    )


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "told"), [(15.0, True), (5.0, False)])
def test_another_evolution_that_is_better_is_told_before_memories_that_fit_as_well(monkeypatch, gain, told):
    """A record that another law follows 15 better in BIC was 'fitted as well' with a memory, and a - b quoted."""
    other = "friction.evolution = 'aging'"
    monkeypatch.setattr(numbers, "mended", lambda *_: True)
    monkeypatch.setattr(numbers, "remedies", lambda plan, ssq, values, rounds: (
        remedies.Remedy(other, 0.97 * ssq, gain, 0.9, dict(values)),))  # fmt: skip
    by = 0.01 * lab.STRESS
    protocol = ss.Protocol(
        pieces=(ss.protocol.VelocityStep(at=30.13, to=3e-6), ss.protocol.NormalStressStep(at=60.41, by=by)), until=120
    )
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), protocol, 1, count=300))
    assert any(one.choice == other for one in fit.remedies) is told
    assert (f"no memory of it: with {other} the sum of squares" in " ".join(str(fit).split())) is told


def test_bic_decides():
    """With no memory at all, an α from noise must not win: Akaike's criterion lets it in one of twelve records."""
    record = SimpleNamespace(friction=np.zeros(3))

    def fit(size, aic, bic):
        return SimpleNamespace(
            plan=SimpleNamespace(records=(record,)), ssq=1.0 - 0.1 * size, noise=(), space=range(size),
            unidentified=(), names=(), estimates=(), derived=(), criteria=lambda noise: (aic, bic),
        )  # fmt: skip

    found = ss.experiments.compare({"rich": fit(2, 0.0, 4.0), "poor": fit(1, 1.0, 0.0)})
    assert found.best == "poor"
    assert found.weights == pytest.approx({"poor": 1 / (1 + np.exp(-2)), "rich": 1 - 1 / (1 + np.exp(-2))})
    assert found.verdict.startswith("The records hardly distinguish 'poor' from 'rich', which has a sum of")


@pytest.mark.slow
@pytest.mark.campaign
def test_memories_of_records_at_random():
    """Six of what `stress_steps_at_random` draws by the hundred: one of each law."""
    inside = []
    for one in random_steps.drawn(1, len(random_steps.LABELS)):
        found, own = random_steps.told(one)
        assert found.best == one.label
        inside += own.values()
    assert np.mean(inside) > 0.8


def pressed_once(law):
    protocol = ss.Protocol(pieces=(ss.protocol.NormalStressStep(at=60.41, by=0.03 * lab.STRESS),), until=180)
    return lab.record(lab.rig(law, alpha=0.2), protocol, 1, count=900)


def test_a_step_of_normal_stress_alone_leaves_open_what_no_memory_would_tell():
    """Without a memory the law fits as well as with α, and has a − b of the wrong sign with a small error."""
    rigs = [ss.lab_rig("aging", normal_memory=memory) for memory in MEMORIES[:2]]
    none, free = (ss.fit(rig, pressed_once(ss.laws.Aging()), starts=9) for rig in rigs)
    for fit in (none, pickle.loads(pickle.dumps(none))):
        said = " ".join(str(fit).split())
        assert "speaks against them" not in said
        assert "where a - b is -" in said
        assert "so that not even its sign is determined" in said
        assert "friction.normal_memory = 'linker-dieterich' (normal_memory.alpha" in said
        assert "also fit a record with steps of velocity on the same rock" in said
    truth = {"a": lab.TRUTH["a"], "b": lab.TRUTH["b"], "d_c": lab.TRUTH["d_c"], "stiffness": lab.STIFFNESS}
    for fit in (none, free):
        for name, value in truth.items():
            low, high = fit.interval(name)
            assert low <= value <= high, (fit, name)
    assert free.interval("alpha")[0] <= 0.2 <= free.interval("alpha")[1]
    found = ss.experiments.compare({"none": none, "free": free})
    assert found.best == "free"
    assert "the records do not determine friction.normal_memory.alpha: 'none', which lacks it, has" in found.verdict


def test_memories_that_fit_far_worse_are_soon_given_up(monkeypatch):
    """Their slip distance went down to nanometres, and each trial took 20 times the work of the fit itself."""
    spent = {}
    for module in (fitting, memories):

        class Kept(Budget):
            @classmethod
            def of_fit(cls, *arguments, own=module, **options):
                return spent.setdefault(own, []).append(made := Budget.of_fit(*arguments, **options)) or made

        monkeypatch.setattr(module, "Budget", Kept)
    for one in [*fits_at_random.drawn("pressed", 5, 7)][::4]:
        spent.clear()
        ss.fit(ss.lab_rig(one.law, normal_memory="linker-dieterich"), one.record)
        own = sum(budget.spent for budget in spent[fitting])
        assert max(budget.spent for budget in spent[memories]) < 2 * own  # .8 to 1.1 by processor, 20 before


def test_a_memory_of_equal_fit_widens_the_intervals_of_what_it_moves_by_some_errors():
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300), starts=9)
    own = np.sqrt(np.diag(fit.covariance))
    moved = 3 * own * (np.arange(len(own)) == 0)
    covariance, found = opened(fit.space, fit.covariance, [EqualMinimum(fit.space, f * moved) for f in (1.0, 0.5)])
    wider = np.sqrt(np.diag(covariance))
    assert 1.96 * wider[0] > 3 * own[0]
    assert wider[1:] == pytest.approx(own[1:])
    assert not found


def test_a_memory_that_fits_better_is_told_though_residuals_are_white():
    fit = ss.fit(ss.lab_rig("slip"), pressed_once(ss.laws.Slip()), starts=9)
    assert fit.whiteness.p > 0.01
    assert "with friction.normal_memory = 'linker-dieterich'" in (said := " ".join(str(fit).split()))
    assert "do not use the values above" in said


@cache
def pressed_by_a_tenth(a, d_c, alpha):
    """Aging that strengthens with velocity, one step of normal stress: slip fits it as well, with other values."""
    source = replace(lab.rig(ss.laws.Aging(), alpha=alpha, a=a, b=a - 0.002, d_c=d_c, mu_ref=0.6), stiffness=3e10)
    protocol = ss.Protocol(pieces=(ss.protocol.NormalStressStep(at=30.57, by=0.1 * lab.STRESS),), until=80)
    noise = 2e-8 * np.random.default_rng(7).standard_normal(4000)
    seen = lab.columns(source, protocol, 4000)
    friction = seen["friction"] + lab.NOISE * np.random.default_rng(12).standard_normal(4000)
    return ss.record_from_arrays(**{**seen, "friction": friction, "displacement": seen["displacement"] + noise})


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "truth"), [
    ("prakash-clifton", (0.0129, 10e-6, 0.18)),
    *(pytest.param(memory, truth, marks=pytest.mark.campaign)
      for memory in MEMORIES for truth in ((0.0108, 20e-6, 0.23), (0.0129, 10e-6, 0.18))),
])  # fmt: skip
def test_values_of_a_wrong_evolution_law_are_not_given_with_small_errors(memory, truth):
    """Of a step of normal stress alone: they are marked as open, or a law with a memory that fits better is told."""
    fit = ss.fit(ss.lab_rig("slip", normal_memory=memory), pressed_by_a_tenth(*truth))
    said = " ".join(str(fit).split())
    assert "speaks against them" not in said
    true = {"a": truth[0], "b": truth[0] - 0.002, "a - b": 0.002}
    wrong = [name for name, value in true.items()
             if name in {one.name.removeprefix("friction.") for one in (*fit.estimates, *fit.derived)}
             and abs(fit[name].value - value) > 4 * fit[name].error]  # fmt: skip
    assert "do not use the values above" in said or not wrong, said


@pytest.mark.campaign
def test_a_minimum_in_which_a_less_b_has_the_other_sign_leaves_open_what_it_moves():
    """Steps of the normal stress alone: a of .0154, b of .0011 fit as well as .012 and .0245; b was 58 errors off."""
    drawn = list(fits_at_random.drawn("pressed", 25, 90210))[-1]
    fit = ss.fit(ss.lab_rig(drawn.law, normal_memory="linker-dieterich"), drawn.record)
    truth = drawn.rig.friction
    assert (fit.values["friction.a"] - fit.values["friction.b"]) * (truth.a - truth.b) < 0
    open_ones = {one.name for one in fit.estimates if not one.determined}
    assert open_ones >= {"friction.a", "friction.b", "friction.normal_memory.alpha"}
    assert "a - b" not in str(fit)
