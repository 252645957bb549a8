"""Verdicts along slow changes: crossings where closed forms say, and motion that departs after them."""

import numpy as np
import pytest

import steadyslip as ss

ROCK = ss.RateState(a=0.010, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-5)
"""k_cr = σ (b − a)/d_c: 5 GPa/m at 10 MPa."""


def press(contact=None, **own):
    given = {"stiffness": 5e9, "mass": 1e3, "drive": ss.Steady(1e-5)} | own
    return ss.Slider(friction=ROCK, contact=contact or ss.Constant(preload=5e6), **given)


def test_a_press_that_is_loaded_ever_harder():
    ramp = ss.NormalStressRamp(at=10, by=10e6, duration=200)
    found = ss.frozen_verdicts(press(), ramp, until=400)
    ((time, verdict),) = found.crossings
    assert (time, verdict) == (pytest.approx(110, abs=0.01), "unstable")
    np.testing.assert_allclose(found.critical_stiffness, found.values["contact.preload"] * 500, rtol=1e-5)
    assert time < found.departure < 400
    assert found.e_folds > 1
    assert "contact.preload 10 MPa" in str(found)
    assert len(found.plot()) == 2
    slower = ss.frozen_verdicts(press(), ss.NormalStressRamp(at=10, by=10e6, duration=400), until=800)
    assert slower.crossings[0][0] == pytest.approx(210, abs=0.01)


def test_injection_unloads():
    """The effective stress falls from 15 to 7 MPa: stable from 10 MPa on."""
    wet = ss.PoreFluid(preload=15e6, suction=0.0, drainage=1.0, slip_distance=1e-5, v_ref=1e-5)
    found = ss.frozen_verdicts(press(wet), ss.InjectionRamp(at=0, by=8e6, duration=80), until=100)
    ((time, verdict),) = found.crossings
    assert (time, verdict) == (pytest.approx(50, abs=0.05), "stable")


def test_nothing_changes_where_nothing_matters():
    found = ss.frozen_verdicts(press(), ss.VelocityRamp(at=1, to=2e-5, duration=20), until=60)
    assert found.crossings == ()
    assert np.isnan(found.departure)
    assert "the same at every moment" in str(found)
    stopped = ss.frozen_verdicts(press(), ss.VelocityRamp(at=1, to=0.0, duration=20), until=60)
    assert stopped.crossings[-1][1] == "no steady sliding"


def test_refusals():
    with pytest.raises(ss.NotAvailable, match="a push or creep has no verdict of its own"):
        ss.frozen_verdicts(press(), ss.DisturbanceStep(at=1, by=1.0), until=2)
    spring = ss.InclinedSpring(steady_normal_stress=5e6, angle=0.1)
    with pytest.raises(ss.NotAvailable, match="contact is not given by its preload"):
        ss.frozen_verdicts(press(spring), ss.NormalStressStep(at=1, by=1.0), until=2)
