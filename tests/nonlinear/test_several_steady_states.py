"""Rigs that slide steadily in more than one way: cycles, kicks and basins belong to the one asked for."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import steadyslip as ss
from steadyslip.core.domains import positive
from steadyslip.model.build import build_model
from steadyslip.model.point import operating_point
from steadyslip.model.steady import steady_equation

LOW, HIGH = 5e6, 15e6


class Latch(ss.laws.PreloadedContact, name="latch-of-tests"):
    """A contact that friction shuts: σ = σ0 + h(1 + tanh((τ − c)/w)), all but constant when open and when shut."""

    rise: float = ss.laws.parameter("Pa", positive, "half of the gain, h")
    centre: float = ss.laws.parameter("Pa", positive, "friction at which it shuts, c")
    width: float = ss.laws.parameter("Pa", positive, "width, w")

    def coupling(self, motion):
        """The gain."""
        return self.rise * (1 + sp.tanh((motion.friction - self.centre) / self.width))


def rig(contact, **changes):
    friction = ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Aging())
    return ss.Slider(**({"friction": friction, "contact": contact, "stiffness": 6e9, "radiation_damping": 1e8,
                         "drive": ss.machine.SteadyDrive(1e-6)} | changes))  # fmt: skip


SHUT = rig(ss.laws.ConstantNormalStress(preload=HIGH))
LATCH = rig(Latch(preload=LOW, rise=(HIGH - LOW) / 2, centre=6e6, width=3e5))


def test_there_are_three():
    found = [state.normal_stress for state in ss.steady_states(LATCH)]
    assert found == pytest.approx([LOW, 1e7, HIGH], rel=1e-3)


def test_stresses_of_many_rigs_are_roots_found_one_by_one():
    """Rigs are searched many at once: each stress is the root that SciPy finds in the same bracket."""
    preloads = np.geomspace(2e6, 2e7, 150)
    model = build_model(LATCH)
    residual = steady_equation(model).residual
    for branch in range(3):
        point = operating_point(LATCH, {"contact.preload": preloads}, branch=branch)
        own = [np.broadcast_to(one, preloads.shape) for one in point.arguments]
        assert np.isfinite(point.sigma).any()
        assert branch == 0 or np.isnan(point.sigma).any()
        for i in np.flatnonzero(np.isfinite(point.sigma)):
            low, high = point.sigma[i] * (1 - 1e-6), point.sigma[i] * (1 + 1e-6)
            root = brentq(
                lambda s, own=own, i=i: float(residual(*(a[i] for a in own), s)[0]), low, high, xtol=1e-9, rtol=1e-15
            )
            assert point.sigma[i] == pytest.approx(root, rel=2e-14)


def test_branch_remembers_its_steady_sliding():
    """Shut, it is the rig that is pressed as hard for good; `at` goes on from the same steady sliding."""
    options = {"between": (3e9, 9e9), "doublings": 0}
    found, same = ss.cycles(LATCH, branch=2, **options), ss.cycles(SHUT, **options)
    assert found.steady == 2
    assert found.onset.value == pytest.approx(same.onset.value, rel=1e-6)
    (cycle,), (other,) = found.at(6e9), same.at(6e9)
    assert cycle.period == pytest.approx(other.period, rel=1e-6)
    below = ss.cycles(LATCH, between=(1e9, 3e9), doublings=0).onset.value
    assert below == pytest.approx(ss.hopf(rig(ss.laws.ConstantNormalStress(preload=LOW))).value, rel=1e-6)


@pytest.mark.parametrize("kick", [pytest.param("velocity", marks=pytest.mark.campaign), "displacement"])
def test_thresholds_of_each(kick):
    law = ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Slip())
    shut, latch = (rig(one.contact, friction=law, stiffness=9e9, radiation_damping=0.0) for one in (SHUT, LATCH))
    same = ss.threshold(shut, kick, precision=1e-4)
    found = ss.threshold(latch, kick, branch=2, precision=1e-4)
    assert (found.size, found.outcome) == (pytest.approx(same.size, rel=1e-3), same.outcome)
    assert ss.threshold_map(latch, {}, kick, branch=2) == pytest.approx(found.size, rel=1e-3)


def test_basin_of_the_one_asked_for():
    pair = [a_rig.with_values({"stiffness": 9e9}) for a_rig in (LATCH, SHUT)]
    x, v = 1e-5 * np.linspace(-12, 3, 4), 1e-6 * np.geomspace(0.3, 30, 3)
    options = {"along": "drive.velocity"}  # which changes no cycle, so that none is looked for
    found, same = (ss.basin(a_rig, x, v, branch=branch, **options) for a_rig, branch in zip(pair, (2, 0), strict=True))
    assert found.outcome.tolist() == same.outcome.tolist()
