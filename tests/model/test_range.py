"""Numbers beyond floating point: one question, the same answer from everybody, and never a NaN without a word."""

import importlib.util
import random
import warnings
from collections import Counter
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from explored import Explored
from steadyslip.core.expressions import PreciseFunction
from steadyslip.linear.polynomials import is_hurwitz
from steadyslip.linear.status import WORDS, without_edge
from steadyslip.linear.stiffness import in_chunks, interval_ends
from steadyslip.model.linearisation import characteristic_coefficients, is_written_out
from steadyslip.model.point import operating_point
from steadyslip.model.posed import resolved
from steadyslip.model.range import in_range, surely_in_range

EXAMPLES = Path(__file__).parents[2] / "examples"
SCREW = EXAMPLES / "lead-screw.toml"
QUESTIONS = {
    "analyze": ss.analyze,
    "steady_state": ss.steady_state,
    "critical_stiffness": ss.critical_stiffness,
    "safety_factor": ss.safety_factor,
    "stable_stiffness": ss.stable_stiffness,
    "eigenvalues": ss.eigenvalues,
    "growth_rate": ss.growth_rate,
    "margins": ss.margins,
    "boundary": lambda rig: ss.boundary(rig, "contact.axial_load"),
    "stable_values": lambda rig: ss.stable_values(rig, "slider.stiffness"),
    "small_signal": ss.small_signal,
    "state_space": ss.state_space,
    "hopf": ss.hopf,
    "simulate": lambda rig: ss.simulate(rig, until=1.0),
    "simulate_many": lambda rig: ss.simulate_many(rig, {}, until=1.0),
    "threshold": ss.threshold,
    "basin": lambda rig: ss.basin(rig, [0.0], [5e-4]),
    "cycles": ss.cycles,
    "explore": lambda rig: ss.explore(rig).html,
    "report": lambda rig: ss.report(rig).html,
}


@pytest.mark.parametrize(
    ("change", "word"),
    [
        # far above the Stribeck velocity such a screw is stable; (v/v_S)^2 overflows, and its slope is no number
        ("v_stribeck=1e-200", "friction.v_stribeck = 1e-200 m/s is too small"),
        ("velocity=1e160", "drive.velocity = 1e[+]160 m/s is too large"),
    ],
)
@pytest.mark.parametrize("question", QUESTIONS)
def test_every_question_refuses_the_same_rig_in_the_same_words(question, change, word):
    screw = ss.read_rig(SCREW, [change])
    with pytest.raises(ss.NotAvailable, match=f"{word} for this rig: .*leave the range of floating point"):
        QUESTIONS[question](screw)


def test_what_several_numbers_do_together_is_said_of_all_of_them():
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml", ["friction.a=1e200", "contact.preload=1e200"])
    with pytest.raises(
        ss.NotAvailable, match=r"friction\.a = 1e\+200, contact\.preload = 1e\+200 Pa: with these together"
    ):
        ss.analyze(rig)


VARIED = {"friction.v_stribeck": np.array([1e-3, 1e-200, 1.1e-3, 1e-180])}
BEYOND = np.array([False, True, False, True])


@pytest.mark.parametrize(
    "name", ["critical_stiffness", "safety_factor", "stable_stiffness", "eigenvalues", "growth_rate"]
)
def test_rigs_of_an_array_without_an_answer_are_spoken_of(name):
    screw, ask = ss.read_rig(SCREW), getattr(ss, name)
    with pytest.warns(ss.OutOfRangeWarning, match="2 of 4 rigs have no answer"):
        found = np.asarray(ask(screw, VARIED)).reshape(4, -1)
    np.testing.assert_array_equal(np.all(np.isnan(found), axis=1), BEYOND)
    for row, value in zip(found[~BEYOND], VARIED["friction.v_stribeck"][~BEYOND], strict=True):
        own = np.asarray(ask(screw.with_values({"friction.v_stribeck": float(value)}))).reshape(-1)
        np.testing.assert_allclose(row, own, rtol=1e-12)
    words = ss.stability(screw, VARIED)
    np.testing.assert_array_equal(words == "out of range", BEYOND)


def test_runs_out_of_range_have_a_status_and_not_the_wrong_one():
    screw = ss.read_rig(SCREW)
    found = ss.simulate_many(screw, VARIED, until=0.01, progress=False)
    np.testing.assert_array_equal(found.status == "out of range", BEYOND)
    assert set(found.status[~BEYOND]) == {"done"}


def test_so_have_thresholds():
    import xarray as xr

    varied = {"friction.v_stribeck": xr.DataArray([1e-2, 1e-200], dims="v")}
    found = ss.threshold_map(ss.read_rig(SCREW, ["stiffness=4e11"]), varied, precision=0.1, progress=False)
    assert np.isnan(found.values[1])
    assert found.limit.values[1] == "out of range"
    assert found.limit.values[0] != "out of range"


def test_stability_in_words():
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    edge = ss.critical_stiffness(rig)
    varied = {"stiffness": np.array([0.5, 2.0, 2.0]) * edge, "contact.angle": np.deg2rad([-45.0, -45.0, -80.0])}
    assert ss.stability(rig, varied).tolist() == ["unstable", "stable", "no steady sliding"]
    assert ss.stability(rig) == "unstable"


@pytest.mark.parametrize("stem", ["inclined-spring", "two-states", "lead-screw"])
def test_why_there_is_no_critical_stiffness(stem):
    """The words agree with the intervals and the status, for one memory and for several."""
    rig = ss.read_rig(EXAMPLES / f"{stem}.toml")
    name = next(n for n, a in rig.parameters().items() if a.value and n.rpartition(".")[2] in ("b", "v_stribeck"))
    values = rig.value(name) * np.geomspace(1e-3, 1e3, 30)
    point = operating_point(rig, {name: values})
    words = without_edge(point)
    critical, words_of_status = ss.critical_stiffness(rig, {name: values}), ss.stability(rig, {name: values})
    np.testing.assert_array_equal(words == "", np.isfinite(critical))
    assert (words != "").any()
    for word, known in zip(words, words_of_status, strict=True):
        assert word in ("", "stable at every stiffness", "stable at no stiffness", "no steady sliding")
        assert word != "stable at every stiffness" or known == "stable"
        assert word != "stable at no stiffness" or known == "unstable"


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_the_quick_look_never_overlooks(data):
    """Wherever it is said at a glance that no rig leaves the range, the question itself says so too."""
    stem = data.draw(st.sampled_from(["inclined-spring", "lead-screw", "two-states", "slow-axis"]))
    rig = ss.read_rig(EXAMPLES / f"{stem}.toml")
    names = [n for n, a in rig.parameters().items() if a.value and not a.role.structural and a.role.unit != "rad"]
    chosen = data.draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    varied = {}
    for name in chosen:
        factor = 10.0 ** data.draw(st.floats(-30, 30))
        varied[name] = rig.value(name) * factor * np.array([1.0, 2.0])
    try:
        point = operating_point(rig, varied)
    except ss.ParameterError:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ss.OutOfRangeWarning)
        ends = in_chunks(point, lambda part: sum(interval_ends(part)))
    if surely_in_range(point, complete=bool(np.all(np.isfinite(ends)))):
        assert np.all(in_range(point))


FAR_APART = ["damping=1e60", "friction.a=1e-60", "alpha=1e60"]


@pytest.mark.parametrize("change", FAR_APART)
def test_what_rounding_decides_is_not_told_as_mechanics(change):
    """Steady sliding balances the forces; a run that starts there cannot be without a velocity."""
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml", [change])
    with pytest.raises(ss.NotAvailable, match="rounding decides how it moves"):
        ss.simulate(rig, until=1.0)
    name, value = change.split("=")
    plain = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    full = plain.resolve(name)
    if plain.value(full):
        found = ss.simulate_many(plain, {full: [plain.value(full), float(value)]}, until=1.0, progress=False)
        assert found.status.tolist() == ["done", "out of range"]


@pytest.mark.parametrize("name", ["friction.a", "slider.damping", "friction.normal_memory.alpha"])
def test_rounding_is_blamed_where_it_decides_and_not_before(name):
    """At the limit, rounding of a stress in ln v is what `resolved` takes it for: about eps T / (a σ)."""
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml", ["damping=1e3"] if name == "slider.damping" else [])
    own = rig.value(name)
    sizes = own * 10.0 ** (np.arange(0, 40) * (-1 if name.endswith(".a") else 1))
    point = operating_point(rig, {name: sizes})
    fine = np.broadcast_to(resolved(point), sizes.shape)
    assert fine[0]
    assert not fine[-1]
    assert np.all(np.diff(fine.astype(int)) <= 0)  # once lost, lost for good


def test_a_run_that_blows_up_has_no_sample_that_is_none():
    run = ss.simulate(ss.read_rig(EXAMPLES / "inclined-spring.toml", ["friction.b=1e200"]), until=100.0)
    assert run.status == "blow-up"
    assert all(np.all(np.isfinite(values)) for values in run.data.values())


CANCELLED = [
    ("inclined-spring", "friction.normal_memory.alpha", 1e50),
    ("two-states", "friction.states.1.d_c", 1e-50),
]


@pytest.mark.parametrize(("stem", "name", "value"), CANCELLED)
def test_a_verdict_that_rounding_decides_says_so(stem, name, value):
    """Terms cancel that are fifty orders of magnitude larger than what is left: signs of coefficients are chance."""
    found = ss.analyze(ss.read_rig(EXAMPLES / f"{stem}.toml").with_values({name: value}))
    assert found.on_edge
    assert "neither verdict should be relied on" in str(found)


@pytest.mark.parametrize("stem", ["double-direct-shear", "strengthening-gouge"])
def test_a_verdict_does_not_depend_on_how_slow_a_rig_is_driven(stem):
    """These strengthen with velocity at any rate; 1e-150 m/s makes coefficients differ by 1e400."""
    rig = ss.read_rig(EXAMPLES / f"{stem}.toml")
    slow = ss.analyze(rig.with_values({"drive.velocity": 1e-150}))
    assert slow.stable is ss.analyze(rig).stable is True
    assert not slow.on_edge
    assert slow.stable_stiffness


@given(st.lists(st.floats(0.3, 3.0), min_size=2, max_size=4), st.integers(-240, 240), st.integers(0, 1))
@settings(max_examples=60, deadline=None)
def test_hurwitz_is_the_same_in_any_unit_of_time(rates, decades, flip):
    """A product of factors s + r, one of them perhaps s - r, in units of time that put coefficients far apart."""
    signs = [-1.0 if flip and i == 0 else 1.0 for i in range(len(rates))]
    c = np.array([1.0])
    for rate, sign in zip(rates, signs, strict=True):
        c = np.convolve(c, [sign * rate, 1.0])
    unit = 10.0 ** (decades / len(rates))
    scaled = c * unit ** -np.arange(len(c))
    if np.all(np.isfinite(scaled)) and np.all(np.abs(scaled) > 1e-300):
        assert is_hurwitz(scaled, 1) == (not flip)


@pytest.mark.campaign
def test_verdicts_at_absurd_sizes_are_those_of_numbers_without_end(monkeypatch):
    """A sample of `benchmarks/sizes.py`: the same polynomial in 700 digits, whose exponents have no end."""
    monkeypatch.syspath_prepend(EXAMPLES.parent / "benchmarks")
    spec = importlib.util.spec_from_file_location("sizes", EXAMPLES.parent / "benchmarks" / "sizes.py")
    sizes = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sizes)
    cases = [
        (stem, change, rig)
        for stem in ("inclined-spring", "lead-screw", "two-states")
        for change, rig in sizes.changed(ss.read_rig(EXAMPLES / f"{stem}.toml"))
    ]
    found = Counter()
    with sizes.mp.workdps(700):
        for stem, change, rig in random.Random(4).sample(cases, 60):
            said, known = sizes.verdict(rig), sizes.truth(rig)
            assert said in (known, "out of range", "on the edge to within rounding"), (stem, change)
            found[said == known] += 1
    assert found[True] > 40


@pytest.mark.parametrize(
    ("power", "name"), [(-660, "inclined-spring"), (640, "slow-axis"), (-660, "two-states"),
     *(pytest.param(-power, name, marks=pytest.mark.campaign)
       for power, name in ((-640, "inclined-spring"), (660, "slow-axis"), (-640, "two-states")))],
)  # fmt: skip
def test_the_unit_of_stress_changes_no_verdict(name, power):
    """Products of stresses leave the range long before stresses do; powers of two change no other digit."""
    a_rig, unit = ss.read_rig(EXAMPLES / f"{name}.toml"), 2.0**power
    address = a_rig.parameters()
    stresses = [n for n, one in address.items() if one.role.unit.startswith(("Pa", "kg/m^2")) and one.value is not None]
    scaled = a_rig.with_values({n: address[n].value * unit for n in stresses})
    plain, found = ss.analyze(a_rig), ss.analyze(scaled)
    assert found.stable == plain.stable
    assert np.array(found.stable_stiffness) == pytest.approx(np.array(plain.stable_stiffness) * unit, rel=1e-9)
    for before, after in zip(ss.boundary(a_rig, "stiffness" if a_rig.stiffness else "kp"),
                             ss.boundary(scaled, "stiffness" if a_rig.stiffness else "kp"), strict=True):  # fmt: skip
        assert after.value == pytest.approx(before.value * unit, rel=1e-9)


@pytest.mark.parametrize(
    "question",
    [
        lambda r: ss.critical_stiffness(r, {"mass": 10**400}),
        lambda r: ss.eigenvalues(r, {"stiffness": 10**6000}),
        lambda r: ss.boundary(r, "stiffness", between=(1, 10**400)),
        lambda r: ss.simulate_many(r, {"stiffness": [10**400]}, until=1.0),
        lambda r: ss.simulate(r, until=1.0, initial={"v": 10**400}),
        lambda r: ss.simulate(r, until=1.0, initial={"v": []}),
        lambda r: ss.simulate(r, until=1.0, initial={"v": True}),
        lambda r: ss.critical_stiffness(r, {"mass": True}),
    ],
)
def test_what_is_no_number_in_range_is_told_so(question):
    with pytest.raises(ss.ParameterError, match=r"got .*; allowed: "):
        question(ss.read_rig(EXAMPLES / "inclined-spring.toml"))


STRIBECK = {
    "falls": {"mu_coulomb": 0.2, "mu_static": 0.3}, "rises": {"mu_coulomb": 0.3, "mu_static": 0.2},
}  # fmt: skip
LEVEL = ss.laws.InclinedSpring(preload=100.0, angle=0.0)
BRISTLES = {
    "bristles": lambda **curve: ss.laws.LuGre(**curve, v_stribeck=1e-3, bristle_stiffness=1e5),
    "damped bristles": lambda **curve: ss.laws.LuGre(
        **curve, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=0.07
    ),
    "no memory": lambda **curve: ss.laws.CoulombStribeck(**curve, v_stribeck=1e-3),
    "viscous": lambda **curve: ss.laws.LuGre(**curve, v_stribeck=1e-3, bristle_stiffness=1e5, viscous=1e-9),
}


def massless(law, delay=0.0, masses=1):
    """A body without mass that rubs, between the drive, or a controller with delay, and bodies with mass."""
    spring, mass = ss.machine.Spring, ss.machine.SlidingBody
    bodies = {"carriage": mass()} | {f"table{i}": mass(mass=0.6 + 0.1 * i) for i in range(masses)}
    links = {
        f"belt{i}{j}": spring(between=(one, other), stiffness=1.3e4 + 7e2 * i + 3e2 * j)
        for i, one in enumerate(bodies) for j, other in enumerate(bodies) if i < j
    } | {"air": spring(between=("table0", "ground"), damping=2.0)}  # fmt: skip
    drive = ss.machine.PositionPD(body="carriage", kp=1e5, delay=delay, velocity=1e-3) if delay else None
    if drive is None:
        links["screw"] = spring(between=("drive", "carriage"), stiffness=1e5)
    surface = ss.machine.Surface(body="carriage", friction=law, contact=LEVEL)
    return ss.Machine(
        bodies=bodies, links=links, contacts={"guide": surface}, drive=drive or ss.machine.Pull(velocity=1e-3)
    )


def slider(law, delay=0.0):
    drive = ss.machine.PD(velocity=1e-3, kp=1e5, delay=delay) if delay else ss.machine.SteadyDrive(velocity=1e-3)
    return ss.Slider(friction=law, contact=LEVEL, stiffness=0.0 if delay else 1e5, drive=drive)


def routh(coefficients):
    """First column of the Routh array of a polynomial, lowest power first, in numbers of any kind."""
    falling = list(coefficients)[::-1]
    above, row = falling[::2], falling[1::2]
    column = [above[0]]
    while row:
        column.append(row[0])
        if row[0] == 0:
            break
        padded = [*row, *[0] * (len(above) - len(row))]
        above, row = row, [b - above[0] * c / row[0] for b, c in zip(above[1:], padded[1:], strict=True)]
    return column


@pytest.mark.parametrize("curve", STRIBECK)
@pytest.mark.parametrize("law", BRISTLES)
def test_above_the_stribeck_velocity_no_sign_is_lost_with_an_exponential(law, curve):
    """exp(-(v/v_S)^2) vanishes from 27.3 on: friction that falls was called stable there, beyond 'ill-posed' at 25."""
    machine = massless(BRISTLES[law](**STRIBECK[curve]))
    ratios = np.array([1, 3, 9.5, 15, 20, 24, 25, 26, 27, 28, 29, 30, 100.0])
    told = ss.stability(machine, {"drive.velocity": 1e-3 * ratios})
    for ratio, words in zip(ratios, told, strict=True):
        point = operating_point(machine.with_values({"drive.velocity": 1e-3 * ratio}))
        with mpmath.workdps(50):
            numbers = [mpmath.mpf(float(np.asarray(one))) for one in (*point.arguments, *point.steady)]
            exact = PreciseFunction(point.model.arguments, characteristic_coefficients(point.model))(*numbers)
            posed = exact[-1] > 0  # friction of undamped bristles does not rise at once with velocity
            right = "stable" if posed and all(one > 0 for one in routh(exact)) else "unstable"
        assert words == right or (words == "out of range" and ratio > 25), ratio
    assert np.all(told != "out of range") or law != "viscous"


@pytest.mark.parametrize("curve", STRIBECK)
@pytest.mark.parametrize("make", [slider, massless, lambda law: slider(law, 1e-3), lambda law: massless(law, 1e-3),
                                  lambda law: massless(law, masses=7)])  # fmt: skip
def test_a_lost_exponential_is_refused_from_the_same_velocity_on_in_every_rig(curve, make):
    """With a delay and where no polynomial is written out it was told as a verdict; `stable` where none is."""
    rig = make(BRISTLES["no memory"](**STRIBECK[curve]))
    ratios = np.array([26.5, 26.8, 27.1, 27.4, 28, 30, 100.0])  # exp(-700) is at 26.46
    assert set(ss.stability(rig, {"drive.velocity": 1e-3 * ratios})) == {"out of range"}
    assert {ss.stability(rig.with_values({"drive.velocity": 1e-3 * ratio})) for ratio in ratios} == {"out of range"}
    if is_written_out(operating_point(rig).model):
        assert not set(ss.stability(rig, {"drive.velocity": 1e-3 * np.array([5, 20, 26, 26.4])})) & {"out of range"}
    with pytest.raises(ss.NotAvailable, match=r"v_stribeck = 0\.001 m/s is too small"):
        ss.growth_rate(rig.with_values({"drive.velocity": 0.03}))


@pytest.mark.parametrize("curve", STRIBECK)
@pytest.mark.parametrize(
    ("make", "law"),
    [(make, law) for make in (slider, massless) for law in BRISTLES if (make, law) != (slider, "bristles")],
)
def test_a_page_refuses_a_lost_exponential_where_python_does(make, law, curve):
    rig = make(BRISTLES[law](**STRIBECK[curve]))
    ratios = np.array([1, 9.5, 20, 25, 26, 26.4, 26.5, 27, 27.4, 28, 30, 100.0])
    explored, told = Explored(rig), ss.stability(rig, {"drive.velocity": 1e-3 * ratios})
    for ratio, words in zip(ratios, told, strict=True):
        assert WORDS[explored(rig.with_values({"drive.velocity": 1e-3 * ratio}))["status"]] == words, ratio
