"""Every example loads, is judged as its comments say, keeps to the schema, and comes back from its own text."""

import re
import tomllib
from pathlib import Path

import pytest

import steadyslip as ss
from file_schema import file_schema

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_verdict_is_that_of_the_comment(path):
    """One comment of each example reads '# Verdict: stable; stable for every stiffness.' or the like."""
    text, rig = path.read_text("utf-8"), ss.read_rig(path)
    if rig.holds:
        assert f"# Verdict: {ss.hunt(rig).sentence}.\n" in text
        return
    (verdict, stable_set) = re.search(r"^# Verdict: (\w+); stable for (.+)\.$", text, re.M).groups()
    analysis = ss.analyze(rig)
    assert verdict == {True: "stable", False: "unstable"}[analysis.stable]
    assert f"stable for      {stable_set}\n" in str(analysis)
    assert analysis.warnings == ()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_keeps_to_the_schema(path):
    file_schema().validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_comes_back_from_its_own_text(path):
    rig = ss.read_rig(path)
    text = ss.rig_to_text(rig)
    again = ss.rig_from_text(text)
    for name, address in rig.parameters().items():
        # to rounding: with an area, totals are divided by it and multiplied again
        assert again.value(name) == (address.value and pytest.approx(address.value, rel=1e-15)), name
    assert ss.rig_to_text(again).splitlines() == text.splitlines() or rig.area is not None


def test_two_states_have_the_critical_stiffness_of_their_closed_form():
    """κ_cr of the two-state slip law, β = (1, 0.84), ρ = 0.048 (theory 4)."""
    rig = ss.read_rig(EXAMPLES[0].with_name("two-states.toml"))
    sigma = ss.steady_state(rig).normal_stress
    kappa = ss.critical_stiffness(rig) * rig.value("friction.states.1.d_c") / (rig.value("friction.a") * sigma)
    assert kappa == pytest.approx(0.08027556564916812, rel=1e-13)


def test_dilating_gouge_needs_less_stiffness_than_one_of_constant_thickness():
    rig = ss.read_rig(EXAMPLES[0].with_name("double-direct-shear.toml"))
    assert ss.critical_stiffness(rig) < ss.critical_stiffness(rig.with_values({"contact.dilatancy": 0.0}))


def test_slow_axis_is_cured_by_gain():
    """Kp,cr = −r(S + Kd)[1 + m r/(f + Kd)] (theory 4), η counted in f and S; totals over the area."""
    rig = ss.read_rig(EXAMPLES[0].with_name("slow-axis.toml"))
    known = ss.small_signal(rig)  # f and S hold Kd and η already
    (edge,) = ss.boundary(rig, "drive.kp")
    assert edge.value == pytest.approx(-known.r * known.S * (1 + known.m * known.r / known.f), rel=1e-12)
    assert edge.stable == "above"
