"""Verdicts within tolerances: what lies inside them is looked at, and said."""

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import SIGMA, rate_state, rig

OWN = rig(friction=rate_state(), stiffness=9e9)
EDGE = float(ss.critical_stiffness(OWN))


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
    law = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.3))
    inclined = rig(friction=law, contact=ss.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=3e10)
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
    found = ss.tolerate(rig(contact=ss.InclinedSpring(preload=SIGMA, angle=-0.9)), {"contact.angle": 0.1})
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
    given = {"stiffness": "20 %", "friction.a": "5 %"}
    document = ss.report(OWN, explorer=False, tolerances=given).html
    assert "How sure is that, within the tolerances?" in document
    assert "friction.a" in document
    assert "all together" in document
    assert document == ss.report(ss.tolerate(OWN, given), explorer=False).html
