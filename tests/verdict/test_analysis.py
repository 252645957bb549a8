"""The verdict says what the numbers say."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import CONTACTS
from steadyslip.verdict.judder import motion_after
from steadyslip.verdict.support import support_stiffness
from steadyslip.verdict.whole_text import facts

PAPER = ss.read_rig(Path(__file__).parents[2] / "examples" / "inclined-spring.toml")
PLAIN = ss.Slider(
    friction=ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-6),
    contact=ss.laws.ConstantNormalStress(preload=1e7),
    stiffness=4e9,
    drive=ss.machine.SteadyDrive(1e-6),
)


def lines(rig, **options):
    return str(ss.analyze(rig, **options)).splitlines()


def test_numbers_are_those_of_the_library():
    a = ss.analyze(PLAIN)
    assert a.stable is False
    assert a.critical_stiffness == pytest.approx(ss.critical_stiffness(PLAIN), rel=1e-14)
    assert a.critical_stiffness == pytest.approx(1e7 * 0.005 / 1e-5, rel=1e-13)  # σ(b−a)/d_c, theory 4
    assert a.critical_angular_frequency == pytest.approx(0.1 * math.sqrt(0.5), rel=1e-13)
    np.testing.assert_allclose(a.eigenvalues, ss.eigenvalues(PLAIN), rtol=1e-14)
    assert a.growth_rate == pytest.approx(ss.growth_rate(PLAIN), rel=1e-14)
    assert a.time_to_double == pytest.approx(math.log(2) / a.growth_rate, rel=1e-14)
    assert a.time_to_halve is None
    leading = a.eigenvalues[0]
    assert a.period == pytest.approx(2 * math.pi / abs(leading.imag), rel=1e-14)
    assert a.damping_ratio == pytest.approx(-leading.real / abs(leading), rel=1e-14)
    assert (a.critical_side, a.critical_axial_stiffness) == ("above", None)
    value = np.polynomial.polynomial.polyval(np.array(a.eigenvalues), a.characteristic_polynomial)
    assert np.all(np.abs(value) < 1e-12 * abs(a.characteristic_polynomial[0]))


def test_what_a_gain_alone_holds_is_told_of_the_gain():
    """In JSON too: `critical_stiffness` is of a spring beside it."""
    press = replace(PLAIN, stiffness=None, drive=ss.machine.PID(1e-6, kp=2e9), area=0.01)
    data = ss.analyze(press).to_dict()
    support, (edge,) = data["held_by"], ss.boundary(press, "drive.kp")
    assert (support["parameter"], support["value"], support["critical_side"]) == ("drive.kp", 2e9, "above")
    assert support["critical"] == pytest.approx(edge.value, rel=1e-9)
    assert support["total"] == pytest.approx(0.01 * edge.value, rel=1e-9)
    assert data["critical_stiffness"] == pytest.approx(support["critical"] - 2e9, rel=1e-9)
    assert "held_by" not in ss.analyze(PLAIN).to_dict()


@pytest.mark.parametrize(
    ("rig", "head", "words"),
    [
        (PLAIN, "UNSTABLE: steady sliding at 1 um/s", "0.8 times the critical stiffness 5 GPa/m, above which"),
        (PLAIN.with_values({"stiffness": 6e9}), "STABLE", "1.2 times the critical stiffness"),
        (PLAIN.with_values({"friction.b": 0.005}), "STABLE", "stable at every stiffness"),
        (PAPER.with_values({"angle": "-60 deg"}), "NO STEADY SLIDING", "above −arccot μss = -55.01 deg"),
        (PAPER.with_values({"angle": "30 deg", "mass": 2e11}), "UNSTABLE", "no stiffness makes sliding stable"),
    ],
)
def test_words(rig, head, words):
    text = " ".join(line.strip() for line in lines(rig))
    assert text.startswith(head)
    assert words in text


def test_a_stable_verdict_is_never_called_safe():
    assert "A large enough kick" in str(ss.analyze(PLAIN.with_values({"stiffness": 6e9})))
    assert "safe" not in str(ss.analyze(PLAIN.with_values({"stiffness": 6e9}))).lower()


def test_margins_say_what_happens_beyond():
    table = {line.split()[0]: line for line in lines(PLAIN.with_values({"stiffness": 6e9})) if "->" in line}
    assert table["slider.stiffness"].endswith("an oscillation grows")
    assert "-16.67 %" in table["slider.stiffness"]
    table = {line.split()[0]: line for line in lines(PLAIN) if "->" in line}
    assert table["slider.stiffness"].endswith("becomes stable")
    assert "+25 %" in table["slider.stiffness"]


def test_lugre_is_stable_below_the_edge_with_mass():
    """Theory 4: f < 0, S > 0: stable iff k < r S (m r + f)/(−f)."""
    lugre = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800.0, viscous=80.0
    )
    rig = ss.Slider(
        friction=lugre,
        contact=ss.laws.ConstantNormalStress(preload=1e5),
        stiffness=1e3,
        mass=5e5,
        drive=ss.machine.SteadyDrive(1e-3),
    )
    a = ss.analyze(rig)
    assert a.critical_side == "below"
    assert a.stable is (rig.stiffness < a.critical_stiffness)
    assert a.stable_stiffness[0][0] == 0
    assert "below which sliding is stable" in a.reason


def test_memoryless_law_is_warned_about():
    law = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3)
    rig = ss.Slider(
        friction=law,
        contact=ss.laws.ConstantNormalStress(preload=1e6),
        stiffness=1e9,
        drive=ss.machine.SteadyDrive(1e-4),
    )
    a = ss.analyze(rig)
    assert a.stable is False
    assert a.growth_rate == math.inf
    assert "ill-posed" in a.reason
    assert any("no memory" in w for w in a.warnings)
    heavy = ss.analyze(rig.with_values({"mass": 10.0}))
    assert (heavy.stable, heavy.stable_stiffness, heavy.critical_stiffness) == (False, (), None)


def test_on_the_edge_is_said():
    rig = PLAIN.with_values({"stiffness": ss.critical_stiffness(PLAIN)})
    assert any("edge of stability" in w for w in ss.analyze(rig).warnings)
    assert ss.analyze(rig).on_edge
    assert not ss.analyze(PLAIN).on_edge
    assert ss.analyze(PLAIN).warnings == ()


def test_axial_stiffness_is_given_back():
    press = ss.Slider(
        friction=PLAIN.friction,
        contact=ss.laws.Triaxial(angle="30 deg", confining_pressure="50 MPa"),
        axial_stiffness=1e11,
        drive=ss.machine.SteadyDrive(1e-6),
    )
    a = ss.analyze(press)
    factor = math.sin(math.pi / 6) * math.cos(math.pi / 6) ** 2
    assert a.critical_axial_stiffness == pytest.approx(a.critical_stiffness / factor, rel=1e-14)
    assert ss.boundary(press, "axial_stiffness")[0].value == pytest.approx(a.critical_axial_stiffness, rel=1e-12)
    assert "along the axis" in str(a)


def test_json_and_forces():
    rig = ss.rig_from_text(ss.rig_to_text(PLAIN).replace("[slider]", "[slider]\narea = 0.01"))
    a = ss.analyze(rig)
    data = json.loads(a.to_json())
    assert data["forces"]["critical_stiffness"] == pytest.approx(a.critical_stiffness * 0.01)
    assert data["forces"]["normal_force"] == pytest.approx(1e7)  # the file's 1e7 is now newtons
    assert "N/m" in str(a)
    assert data["boundaries"] == json.loads(json.dumps(data["boundaries"]))
    stable = ss.analyze(PLAIN.with_values({"friction.b": 0.005})).to_dict()
    assert stable["stable_stiffness"] == [[0.0, None]]


def test_formula_and_plain_result():
    a = ss.analyze(PLAIN)
    numbers = {"sigma_ss": 1e7, "a": 0.01, "b": 0.015, "d_c": 1e-5}
    right = a.formula().rhs
    assert float(right.subs({s: numbers[s.name] for s in right.free_symbols})) == pytest.approx(5e9)
    with pytest.raises(AttributeError):
        a.stable = True


@pytest.mark.parametrize("mass", [1e15, 1e20, 1e25])
def test_a_mass_that_swamps_the_direct_effect_costs_no_digits(mass):
    """σ(b−a)/d_c (1 + m v0²/(aσd_c)), of which the polynomial alone would keep few digits."""
    expected = 5e9 * (1 + mass * 1e-12 / (0.01 * 1e7 * 1e-5))
    a = ss.analyze(PLAIN.with_values({"mass": mass}))
    assert a.critical_stiffness == pytest.approx(expected, rel=1e-13)
    assert a.critical_angular_frequency == pytest.approx(0.1 * math.sqrt(0.5), rel=1e-13)
    (edge,) = ss.boundary(PLAIN.with_values({"mass": mass}), "stiffness", between=(1.0, 1e30))
    assert (edge.value, edge.kind, edge.stable) == (a.critical_stiffness, "oscillatory", "above")


def test_static_edge_of_the_closed_form_is_a_divergence():
    contact = ss.laws.LinearNormalStress(steady_normal_stress=1e7, b3=-1e10)
    rig = PLAIN.with_values({"friction.b": 0.005})
    rig = ss.Slider(friction=rig.friction, contact=contact, stiffness=1e10, drive=rig.drive)
    kinds = {e.kind: e.value for e in ss.boundary(rig, "stiffness")}
    assert kinds == {"divergence": pytest.approx(6e9, rel=1e-13)}


def test_what_is_printed_is_accepted():
    """The short names of the verdict's table work in Python and with --set."""
    for line in lines(PAPER):
        if "->" in line:
            assert PAPER.resolve(line.split()[0]) in PAPER.parameters()
    text = ss.rig_to_text(PAPER)
    assert ss.rig_from_text(text, "x", ["friction.alpha=0.3"]).value("alpha") == 0.3
    assert ss.rig_from_text(text, "x", ["control=pd", "kp=1"]).drive == ss.machine.PD(1e-6, kp=1.0)
    with pytest.raises(ss.UnknownNameError):
        PAPER.resolve("contact.alpha")


def test_reason_names_the_direct_effect_where_that_is_the_fault():
    lugre = ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800.0)
    rig = ss.Slider(
        friction=lugre,
        contact=ss.laws.ConstantNormalStress(preload=1e5),
        stiffness=1e3,
        drive=ss.machine.SteadyDrive(1e-3),
    )
    assert "direct effect is negative" in ss.analyze(rig).reason
    taking = ss.Slider(
        friction=PLAIN.friction,
        contact=ss.laws.LinearNormalStress(steady_normal_stress=1e7, b1=-1e12),
        stiffness=1e9,
        drive=PLAIN.drive,
    )
    assert "velocity relieves the normal stress" in ss.analyze(taking).reason


def test_controllers_are_judged_by_their_gain():
    rig = ss.Slider(friction=PLAIN.friction, contact=PLAIN.contact, drive=ss.machine.PD(1e-6, kp=4e9))
    assert "drive proportional gain, 4 GPa/m, is 0.8 times the critical 5 GPa/m" in ss.analyze(rig).reason
    assert all(edge.value > 0 for edge in ss.boundary(rig, "kp"))


@pytest.mark.parametrize("contact", [0, 8, pytest.param(4, marks=pytest.mark.campaign)])
@pytest.mark.parametrize(
    ("drive", "mass"), [(ss.machine.PD(1e-6, kp=4e9, kd=1e9), 0.0), (ss.machine.PID(1e-6, kp=4e9, ki=1e8), 1e6)]
)
def test_a_gain_that_is_all_the_stiffness_is_what_is_said_to_be_stable(drive, mass, contact):
    """The same edges as those of a spring beside the gain, the gain added; none is lost below the gain."""
    rig = ss.Slider(friction=PLAIN.friction, contact=CONTACTS[contact], drive=drive, mass=mass)
    found = ss.analyze(rig)
    support = support_stiffness(found)
    assert (support.name, support.own, support.beside) == ("drive proportional gain", 4e9, 0.0)
    small = [end for pair in support_stiffness(ss.analyze(rig.with_values({"kp": 1.0}))).stable for end in pair]
    assert [end for pair in support.stable for end in pair] == pytest.approx(small, rel=1e-9)
    beyond = [max(end - 4e9, 0.0) for end in small if end > 4e9]
    assert [end for pair in found.stable_stiffness for end in pair if end] == pytest.approx(beyond, rel=1e-8)
    assert "stiffness" not in found.reason.partition(":")[0]
    (words,) = [words for name, words in facts(found) if name == "stable for"]
    assert "drive proportional gain" in words
    assert "stiffness" not in words
    beside = ss.analyze(replace(rig, stiffness=1e9))
    assert "stiffness beside the drive proportional gain" in dict(facts(beside))["stable for"]


def test_only_rigs_are_judged():
    with pytest.raises(ss.ParameterError, match="allowed: a Slider"):
        ss.analyze("rig.toml")
    assert repr(ss.analyze(PLAIN)).startswith("<Analysis: UNSTABLE")


@pytest.mark.parametrize("path", ["examples/slow-axis.toml", "examples/machines/geared-servo.toml"])
def test_an_unstable_rig_says_what_it_does_instead(path):
    """As a run from another disturbance says, which ends in the same motion."""
    rig = ss.read_rig(path)
    found = ss.analyze(rig)
    assert found.stable is False
    speed = rig.value("drive.velocity")
    push = [ss.protocol.VelocityStep(at=1.0, to=1.4 * speed), ss.protocol.VelocityStep(at=3.0, to=speed)]
    run = ss.simulate(rig, push, until=300.0)
    assert len(run.slip_events) > 9
    assert "judders: every" in found.judders
    assert found.judders == run.sentence
    assert found.to_dict()["judders"] == run.sentence
    assert f"{run.sentence} (simulated, after a small disturbance)" in " ".join(str(found).split())


def near_an_edge(path, share):
    """Verdict on a rig just beyond its lowest oscillatory edge in stiffness."""
    rig = ss.read_rig(path)
    name = rig.stiffness_name() or rig.gain_name()
    edge = next(one for one in ss.boundary(rig, name) if one.kind == "oscillatory")
    return ss.analyze(rig.with_values({name: edge.value * (share if edge.stable == "above" else 1 / share)}))


@pytest.mark.parametrize(
    ("path", "share"),
    [
        ("examples/stick-slip.toml", 0.9863),
        ("examples/stick-slip.toml", 0.7),
        *(
            pytest.param(path, share, marks=pytest.mark.campaign)
            for path in ("examples/stick-slip.toml", "examples/slow-axis.toml")
            for share in 1 - 10 ** np.random.default_rng(6).uniform(-3.5, -0.3, 6)
        ),
    ],
)
def test_an_oscillation_that_still_grows_is_not_told_as_what_a_rig_does(path, share):
    found = near_an_edge(path, share)
    assert found.stable is False
    assert found.judders or share > 0.9
    if found.judders.startswith("judders"):
        run = motion_after(found.rig, found.eigenvalues, repeated=True)
        long, speed = 16 * run["t"][-1], found.rig.drive.velocity
        push = [ss.protocol.VelocityStep(at=part * long, to=to * speed) for part, to in ((0.001, 1.2), (0.002, 1.0))]
        now, later = run.slip_events[-1], ss.simulate(found.rig, push, until=long).slip_events[-1]
        assert now.slip == pytest.approx(later.slip, rel=0.015)
        assert now.recurrence == pytest.approx(later.recurrence, rel=0.015)


def test_a_stable_rig_does_nothing_instead():
    stable = ss.analyze(ss.read_rig("examples/strengthening-gouge.toml"))
    assert stable.judders == ""
    assert stable.to_dict()["judders"] is None
