"""Verdicts within tolerances: what lies inside them is looked at, and said."""

import numpy as np
import pytest

import steadyslip as ss
from machines import leading, same_block, two_mass
from rigs_of_theory import SIGMA, rate_state, rig

OWN = rig(friction=rate_state(), stiffness=9e9)
EDGE = float(ss.critical_stiffness(OWN))
GIVEN = {"stiffness": "20 %", "friction.a": "5 %"}


def test_tolerances_that_leave_the_edge_outside_leave_the_verdict():
    for factor, share in ((1.5, 1.0), (0.5, 0.0)):
        found = ss.tolerate(OWN.with_values({"stiffness": factor * EDGE}), {"stiffness": "10 %"})
        assert found.share == share
        assert found.alone[0].stable is bool(share)
        assert found.alone[0].safety == pytest.approx((0.9 * factor, 1.1 * factor), rel=1e-12)


def test_half_of_the_rigs_about_the_edge_are_stable():
    """The edge in the middle of a range of stiffness cuts it into halves."""
    found = ss.tolerate(OWN.with_values({"stiffness": EDGE}), {"slider.stiffness": 0.2 * EDGE})
    assert found.share == pytest.approx(0.5, abs=1e-3)
    assert found.alone[0].stable is None
    assert "Stable in 50 % of 4096 rigs" in str(found)
    assert "stable in a part of it" in str(found)


def test_every_rig_looked_at_lies_inside_and_is_judged_as_by_itself():
    law = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.3))
    inclined = rig(friction=law, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=3e10)
    found = ss.tolerate(
        inclined, {"contact.angle": "10 deg", "friction.a": "20 %", "friction.normal_memory.alpha": 0.05}
    )
    ends = {one.parameter: (one.low, one.high) for one in found.alone}
    assert ends["contact.angle"] == pytest.approx((-0.5 - np.pi / 18, -0.5 + np.pi / 18))
    assert ends["friction.a"] == pytest.approx((0.8 * inclined.friction.a, 1.2 * inclined.friction.a))
    corners = [ss.safety_factor(inclined.with_values({"contact.angle": angle})) for angle in ends["contact.angle"]]
    alone = next(one.safety for one in found.alone if one.parameter == "contact.angle")
    assert min(corners) >= alone[0] * (1 - 1e-12)
    assert max(corners) <= alone[1] * (1 + 1e-12)
    edged = np.isfinite(found.safety)
    assert edged.any()
    assert np.all(found.stable[edged] == (found.safety[edged] > 1))
    assert 0 < found.share < 1


def test_rigs_that_lock_up_within_tolerances_are_told():
    found = ss.tolerate(rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.9)), {"contact.angle": 0.1})
    assert not np.all(found.exists)
    assert "no steady sliding" in str(found)


@pytest.mark.parametrize(
    ("given", "words"),
    [({"stiffnes": "5 %"}, "did you mean 'slider.stiffness'"), ({"contact.preload": "3 m"}, "wrong dimension"),
     ({"stiffness": "150 %"}, r"stiffness: got -4500000000\.0"), ({}, "none given"),
     ({"friction.a": -0.1}, "friction.a: got -0.1; allowed: a finite number > 0")],
)  # fmt: skip
def test_tolerances_that_cannot_be_are_refused(given, words):
    with pytest.raises((ss.ParameterError, ss.UnknownNameError), match=words):
        ss.tolerate(OWN, given)


def test_reports_say_how_sure_the_verdict_is():
    document = ss.report(ss.tolerate(OWN, GIVEN), explorer=False).html
    assert "How sure is that, within the tolerances?" in document
    assert "friction.a" in document
    assert "all together" in document


@pytest.mark.usefixtures("unpainted")
def test_a_report_with_tolerances_is_one_of_what_they_make():
    assert (
        ss.report(OWN, explorer=False, tolerances=GIVEN).html == ss.report(ss.tolerate(OWN, GIVEN), explorer=False).html
    )


def test_a_machine_of_one_body_is_tolerated_as_its_slider():
    block, machine = same_block(7)
    edge = float(ss.critical_stiffness(block))
    block, machine = block.with_values({"stiffness": 1.1 * edge}), machine.with_values({"stiffness": 1.1 * edge})
    given = {"stiffness": "20 %", "friction.a": "10 %"}
    own = ss.tolerate(block, given)
    of_machine = {"links.spring.stiffness": "20 %", "contacts.base.friction.a": "10 %"}
    found = ss.tolerate(machine, of_machine, along="links.spring.stiffness")
    assert 0 < own.share < 1
    np.testing.assert_array_equal(found.stable, own.stable)
    np.testing.assert_allclose(found.edge, own.edge, rtol=1e-10)
    np.testing.assert_allclose(found.safety, own.safety, rtol=1e-10)
    np.testing.assert_allclose(found.growth, own.growth, rtol=1e-7, atol=1e-9)
    assert found.unit == "N/m"


def test_growth_rates_tell_how_sure_a_machine_is():
    """Kp of theory 11 is stable above 2.63."""
    machine = two_mass(kp=2.8)
    found = ss.tolerate(machine, {"drive.kp": "20 %", "bodies.table.mass": "1 %"})
    assert (found.along, found.alone[0].parameter, found.alone[0].stable) == ("", "drive.kp", None)
    ends = [leading(machine.with_values({"drive.kp": kp})).real for kp in (0.8 * 2.8, 1.2 * 2.8)]
    assert found.alone[0].growth == pytest.approx(sorted(ends), rel=1e-9)
    assert np.all(found.stable == (found.growth < 0))
    assert "growth rate" in str(found)
    assert found.plot().get_xlabel() == "growth rate of disturbances (1/s)"
    document = ss.report(machine, explorer=False, tolerances={"drive.kp": "20 %", "bodies.table.mass": "1 %"}).html
    assert "right of 0 disturbances grow" in document
    assert document == ss.report(found, explorer=False).html


def test_the_safety_of_a_machine_is_that_of_the_parameter_that_is_named():
    machine = two_mass(kp=4.0)
    edge = ss.stable_values(machine, "drive.kp")[0, 0]
    assert ss.safety_factor(machine, along="kp") == pytest.approx(4.0 / edge, rel=1e-12)
    masses = np.array([5.0, 7.0])
    found = ss.safety_factor(machine, {"bodies.table.mass": masses}, along="kp")
    edges = [ss.stable_values(machine.with_values({"bodies.table.mass": m}), "kp")[0, 0] for m in masses]
    np.testing.assert_allclose(found, 4.0 / np.array(edges), rtol=1e-12)
    with pytest.raises(ss.ParameterError, match=r"along: missing; name a parameter .* 'links\.screw\.stiffness'"):
        ss.safety_factor(machine)
    with pytest.raises(ss.NotAvailable, match="linearly"):
        ss.tolerate(machine, {"drive.kp": "5 %"}, along="contacts.guide.friction.mu_ref")
