"""Every cubic coefficient has an error, below which the kind of onset is not decided."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from dimensionless import A, unit_rig
from onsets_at_random import alike, compared
from scaled_machines import ALONG, built
from steadyslip.core import expressions as expressions_module
from steadyslip.core.expressions import ArrayFunction, PreciseFunction, asinh_exp
from steadyslip.nonlinear.onset import hopf as onset_module
from steadyslip.nonlinear.onset.coefficient import even_scales

LAMBDA = 0.5
TURNS = (np.sqrt(16 + 4 * LAMBDA) - 3) / (4 * LAMBDA + 7)  # theory 6: aging with this mass changes kind
CHAIN = {"masses": (0.2, 0.3), "damping": 0.05, "stiffness": 2.0, "a": 0.1, "falls": 0.5, "evolution": ss.laws.Aging()}


def heavy(share):
    return unit_rig("aging", LAMBDA, LAMBDA, mass=TURNS * share)


def test_units_of_very_unlike_sizes_cost_no_digits():
    own, other = ss.hopf(built(CHAIN), ALONG), ss.hopf(built(CHAIN, 6.0, 2e-5, 3e-6), ALONG)
    assert other.normalised == pytest.approx(own.normalised, rel=1e-12)
    assert own.coefficient_error < 1e-9 * abs(own.coefficient)


def test_scales_turn_with_the_units():
    random = np.random.default_rng(3)
    size = np.where(random.random((7, 7)) < 0.5, 10.0 ** random.uniform(-3, 3, (7, 7)), 0.0)
    size[range(7), range(7)] = 1.0
    rows, columns = 10.0 ** random.uniform(-12, 12, (2, 1, 7))
    even = [r[:, :, None] * s * c[:, None] for s, (r, c) in
            ((one[None], even_scales(one[None])) for one in (size, rows.T * size * columns))]  # fmt: skip
    np.testing.assert_allclose(even[0], even[1], rtol=1e-6)


def test_where_the_kind_changes_it_is_not_decided():
    onset = ss.hopf(heavy(1.0))
    assert onset.kind == "not decided"
    assert 0 < abs(onset.coefficient) < onset.coefficient_error < 1e-12
    assert np.isnan(onset.velocity_amplitude(0.9 * onset.value))
    assert "onset of a kind not decided at" in str(onset)
    assert "±" in str(onset)
    found = ss.analyze(heavy(1.0))
    assert "not decided: at the edge in stiffness" in str(found)
    assert found.to_dict()["onset"]["kind"] == "not decided"
    assert found.to_dict()["onset"]["coefficient_error"] == onset.coefficient_error


@pytest.mark.parametrize(("share", "kind"), [(1 - 1e-12, "subcritical"), (1 + 1e-12, "supercritical")])
def test_beside_that_more_digits_decide(share, kind):
    """c1 is 1e-12 of the terms that it is the sum of: less than what rounding leaves of it."""
    onset = ss.hopf(heavy(share))
    assert onset.kind == kind
    assert onset.coefficient_error < 0.1 * abs(onset.coefficient)


def test_both_routes_give_the_same_coefficient(monkeypatch):
    """At a mass that is an ordinary one: sixteen digits within their error of fifty."""
    own = ss.hopf(heavy(0.5))
    monkeypatch.setattr(onset_module, "TRUSTED", 0.0)
    found = ss.hopf(heavy(0.5))
    assert 0 < found.coefficient_error < own.coefficient_error < 1e-9 * abs(own.coefficient)
    assert abs(found.coefficient - own.coefficient) < own.coefficient_error


def test_maps_and_curves_tell_what_is_not_decided():
    mass = A * TURNS * np.array([0.5, 1.0, 2.0])
    found = onset_module.onset_map(heavy(1.0), {"slider.mass": mass})
    assert [onset_module.KINDS[i] for i in found["kind"]] == ["subcritical", "not decided", "supercritical"]
    assert np.all(np.isfinite(found["edge"]))
    curve = ss.hopf_curve(unit_rig("slip", 0.5, 0.7), "friction.a", between={"friction.a": (0.012, 0.0125)})
    assert {*curve.kind} == {"degenerate"}


def test_equations_are_evaluated_to_many_digits():
    assert expressions_module._PRECISE.keys() >= expressions_module._WORLD.keys()
    x, y = sp.symbols("x y")
    expressions = [x ** sp.Rational(1, 3) / 3, sp.exp(-x) - 1, asinh_exp(x, y), sp.pi * x**2,
                   sp.Piecewise((sp.log(x), x > 0), (y, True)), sp.Max(x, y, 1)]  # fmt: skip
    with mpmath.workdps(40):
        found = PreciseFunction([x, y], expressions)(mpmath.mpf(2), mpmath.mpf(-3))
        expected = [sp.N(e.subs({x: 2, y: -3}), 40) for e in expressions]
        for one, right in zip(found, expected, strict=True):
            assert abs(one - mpmath.mpf(str(right))) < mpmath.mpf("1e-37")
    np.testing.assert_allclose([float(one) for one in found], ArrayFunction([x, y], expressions)(2.0, -3.0))


@pytest.mark.campaign
def test_random_machines_have_one_kind_of_onset_in_all_units_and_orders():
    found = [one for one in map(compared, range(12)) if one is not None]
    assert len(found) >= 10
    for kinds, apart in found:
        assert alike(kinds)
        assert "not decided" not in kinds
        assert apart < 1e-9
