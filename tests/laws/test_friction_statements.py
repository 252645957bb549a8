"""What friction laws say of themselves: jumps, observables in their own words, reversal, the Stribeck curve."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, strategies as st

import steadyslip as ss
from friction_laws import BRISTLE, EVOLUTIONS, LAWS, ONE, ROCK, TWO, modest
from steadyslip.core.expressions import asinh_exp, numpy_asinh_exp
from steadyslip.laws.friction.bristle import StribeckCurve
from steadyslip.testing.symbolic import symbolic_law


@modest
@given(ratio=st.floats(0.2, 5), alpha=st.floats(0.01, 0.6), which=st.sampled_from(EVOLUTIONS), two=st.booleans())
def test_sudden_change_of_normal_stress_moves_theta(ratio, alpha, which, two):
    """By −(α/b) ln(σ2/σ1), at fixed memory variables; with Nagata's coupling by 1/(1 + c_N) of it at fixed v."""
    nagata = isinstance(which, ss.laws.Nagata)
    states = TWO if two and not nagata else ONE
    law = ss.laws.RateState(**ROCK, **states, evolution=which, normal_memory=ss.laws.LinkerDieterich(alpha=alpha))
    v, before = 3e-6, 4e6
    after = before * ratio
    memory = tuple(float(y) for y in law.steady_memory(v, before))
    tau = sp.Symbol("tau")
    thetas = []
    for sigma in (before, after):
        (stress,) = sp.solve(law.strength(v, sigma, memory, tau) - tau, tau)
        seen = law.observables(v, sigma, memory, stress)
        thetas.append([float(value) for name, (value, _) in seen.items() if name.startswith("Theta")])
        times = [float(value) for name, (value, _) in seen.items() if name.startswith("theta")]
        slip = [1e-6, 2e-5][: len(times)]
        factor = 2 if isinstance(which, ss.laws.PRZ) else 1
        np.testing.assert_allclose(np.log(np.divide(times, slip) * 1e-6 / factor), thetas[-1], atol=1e-11)
    total = sum(s.b for s in TWO["states"]) if states is TWO else ONE["b"]
    share = 1 + which.c_nagata if nagata else 1.0
    expected = -alpha / total * np.log(ratio) / share  # α_i/b_i is α/Σb for each state
    np.testing.assert_allclose(np.subtract(thetas[1], thetas[0]), expected, rtol=1e-9, atol=1e-9)


def test_nagata_in_its_own_words():
    """θ̇ = 1 − vθ/d_c − (c_N θ/b) d(τ/σ)/dt along an arbitrary motion (theory 2), σ varying, α > 0 too."""
    t = sp.Symbol("t", real=True)
    v, sigma = 2e-6 * (1 + 0.3 * sp.sin(t)), 4e6 * (1 + 0.2 * sp.cos(2 * t))
    psi = sp.Function("psi")(t)
    alpha, c, b, d_c = 0.3, 2.0, ONE["b"], ONE["d_c"]
    law = ss.laws.RateState(
        **ROCK, **ONE, evolution=ss.laws.Nagata(c_nagata=c), normal_memory=ss.laws.LinkerDieterich(alpha=alpha)
    )
    unknown = sp.Symbol("tau")
    (tau,) = sp.solve(law.strength(v, sigma, (psi,), unknown) - unknown, unknown)
    theta = law.observables(v, sigma, (psi,), tau)["theta"][0]
    (rate,) = law.rates(v, sigma, (psi,), tau)
    stated = (
        1 - v * theta / d_c - c * theta / b * sp.diff(tau / sigma, t) - alpha * theta / b * sp.diff(sigma, t) / sigma
    )
    gap = (sp.diff(theta, t) - stated).subs(sp.Derivative(psi, t), rate).subs({psi: 0.49, t: 0.7})
    assert abs(float(gap)) < 1e-11


@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
def test_linker_dieterich_in_its_own_words(evolution):
    """Θ̇ = (rate at constant σ) − α σ̇/(bσ) along an arbitrary motion."""
    t = sp.Symbol("t", real=True)
    v, sigma = 2e-6 * (1 + 0.3 * sp.sin(t)), 4e6 * (1 + 0.2 * sp.cos(2 * t))
    psi = sp.Function("psi")(t)
    law = ss.laws.RateState(**ROCK, **ONE, evolution=evolution, normal_memory=ss.laws.LinkerDieterich(alpha=0.3))
    theta = law.observables(v, sigma, (psi,), sp.nan)["Theta"][0]
    (rate,) = law.rates(v, sigma, (psi,), sp.nan)
    constant = evolution.rate(v, theta, ONE["d_c"], ROCK["v_ref"])
    gap = sp.diff(theta, t) - (constant - 0.3 / ONE["b"] * sp.diff(sigma, t) / sigma)
    assert abs(float(gap.subs(sp.Derivative(psi, t), rate).subs({psi: 0.42, t: 0.7}))) < 1e-10


@pytest.mark.parametrize(
    ("evolution", "in_seconds"),
    [
        (ss.laws.Aging(), lambda v, theta, d_c: 1 - v * theta / d_c),
        (ss.laws.PRZ(), lambda v, theta, d_c: 1 - (v * theta / (2 * d_c)) ** 2),
        (ss.laws.Slip(), lambda v, theta, d_c: -v * theta / d_c * np.log(v * theta / d_c)),
    ],
)
def test_evolution_in_seconds(evolution, in_seconds):
    """θ̇ of the literature from Θ̇ = θ̇/θ."""
    v, state, d_c, v_ref = 3e-6, 0.4, 2e-6, 1e-6
    theta = float(evolution.state_time(state, d_c, v_ref))
    rate = float(evolution.rate(v, state, d_c, v_ref))
    np.testing.assert_allclose(rate * theta, in_seconds(v, theta, d_c), rtol=1e-13)


@modest
@given(x=st.floats(1e-12, 1e6), y=st.floats(-700, 700), sign=st.sampled_from([-1, 1]))
def test_asinh_exp(x, y, sign):
    exact = sign * mpmath.asinh(mpmath.mpf(x) * mpmath.exp(mpmath.mpf(y)))
    # exp turns the rounding of its argument, up to 700 units, into a relative error
    np.testing.assert_allclose(float(numpy_asinh_exp(sign * x, y)), float(exact), rtol=2e-16 * (abs(y) + 30))


def test_asinh_exp_beyond_floating_point_warns_of_nothing():
    """x e^y = 2e308: its logarithm is taken instead."""
    assert float(numpy_asinh_exp(17725.0, 700.0)) == pytest.approx(np.log(2 * 17725.0) + 700.0, rel=1e-15)


def test_asinh_exp_differentiates():
    x, y = sp.symbols("x y", real=True)
    plain = sp.asinh(x * sp.exp(y))
    for name in (x, y):
        difference = sp.diff(asinh_exp(x, y), name) - sp.diff(plain, name)
        assert abs(difference.subs({x: 0.3, y: 1.7}).evalf()) < 1e-14


def test_regularised_law_is_odd_in_velocity():
    law = ss.laws.RateState(**ROCK, **ONE, regularised=True)
    forward, back = (float(law.strength(v, 5e6, (0.3,), 0)) for v in (2e-6, -2e-6))
    assert forward == -back
    assert float(law.strength(0.0, 5e6, (0.3,), 0)) == 0


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_regularised_memory_evolves_alike_in_reverse(evolution):
    """State rates use |v| (theory 2)."""
    law = ss.laws.RateState(**ROCK, **ONE, evolution=evolution, regularised=True)
    memory = tuple(float(y) + 0.01 for y in law.steady_memory(1e-6, 5e6))
    forward, back = (float(law.rates(v, 5e6, memory, tau)[0]) for v, tau in ((2e-6, 3e6), (-2e-6, 3e6)))
    assert forward == back != 0


@pytest.mark.parametrize("law", [law for law in LAWS if isinstance(law, StribeckCurve)], ids=repr)
def test_machine_friction_is_odd(law):
    """Bristles bend the other way in reverse."""
    bent = (2e-6,) if law.memory() else ()
    back = tuple(-z for z in bent)
    assert float(law.strength(-3e-6, 5e6, back, 0)) == -float(law.strength(3e-6, 5e6, bent, 0)) < 0
    assert [float(r) for r in law.rates(-3e-6, 5e6, back, 0)] == [-float(r) for r in law.rates(3e-6, 5e6, bent, 0)]


def curve(v, exponent):
    """The Stribeck curve, typed by hand."""
    return 0.3 + 0.15 * np.exp(-((np.abs(v) / 2e-6) ** exponent))


@pytest.mark.parametrize("exponent", [None, 0.5, 1.0, 1.7, 2.0, 4.0])
def test_stribeck_exponent(exponent):
    """Strength and its slope are those of the curve; the exponent is 2 unless given."""
    law = ss.laws.CoulombStribeck(**BRISTLE, stribeck_exponent=exponent)
    v = np.geomspace(1e-9, 1e-3, 60)
    expected = curve(v, exponent or 2.0) + 0.1 * v
    found = np.array([float(law.strength(one, 1.0, (), 0)) for one in v])
    assert found == pytest.approx(expected, rel=1e-14)
    assert float(law.strength(1e-30, 1.0, (), 0)) == pytest.approx(0.45, rel=1e-5)


@pytest.mark.parametrize(("exponent", "stable"), [(1.0, False), (2.0, False), (4.0, True)])
def test_stribeck_exponent_can_flip_a_verdict(exponent, stable):
    """With mass and without memory the rig is stable where friction rises: m s² + σ μ'(v) s + k = 0."""
    v, sigma = 0.5e-6, 5e6
    law = ss.laws.CoulombStribeck(**(BRISTLE | {"viscous": 2.6e4}), stribeck_exponent=exponent)
    a_rig = ss.Slider(
        friction=law,
        contact=ss.laws.ConstantNormalStress(preload=sigma),
        mass=1e6,
        stiffness=1e10,
        drive=ss.machine.SteadyDrive(v),
    )
    u = (v / 2e-6) ** exponent
    slope = -0.15 * exponent / v * u * np.exp(-u) + 2.6e4
    roots = np.roots([1e6, sigma * slope, 1e10])
    found = np.sort_complex(ss.eigenvalues(a_rig))
    assert found == pytest.approx(np.sort_complex(roots), rel=1e-10)
    assert ss.analyze(a_rig).stable is stable is bool(np.all(roots.real < 0))


def test_statement_of_a_law_is_symbolic_throughout():
    """No number of a law enters its equations: the contract and the Model see parameters."""
    for law in LAWS:
        said = symbolic_law(law)
        floats = [n for e in (said.strength, *said.rates) for n in e.atoms(sp.Float)]
        assert not floats, law
