"""Small perturbations of friction laws, theory 3: against closed forms of each law."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import steadyslip as ss
from friction_laws import (
    EVOLUTIONS,
    ONE,
    ROCK,
    ingredients,
    modest,
    polynomial,
    rig_with,
    small,
    velocities,
)


@modest
@given(a=small, b=st.floats(-0.02, 0.03), v=velocities, alpha=st.floats(0, 0.6), which=st.sampled_from(EVOLUTIONS[:3]))
def test_one_state_laws_share_one_linearisation(a, b, v, alpha, which):
    memory = ss.laws.LinkerDieterich(alpha=alpha)
    law = ss.laws.RateState(a=a, b=b, d_c=2e-6, mu_ref=0.7, v_ref=1e-6, evolution=which, normal_memory=memory)
    sigma, mu = 3e6, 0.7 + (a - b) * np.log(v / 1e-6)
    expected = [a * sigma / v, -(b - a) * sigma / v, v / 2e-6, mu - alpha, mu]
    size = [sigma / v * (a + abs(b)), sigma / v * (a + abs(b)), v / 2e-6, 1, 1]
    np.testing.assert_array_less(np.abs(np.subtract(ingredients(law, v, sigma), expected)), 1e-13 * np.array(size))


@modest
@given(mu=st.floats(0.005, 0.1), b=small, v=velocities, alpha=st.floats(0, 0.6), which=st.sampled_from(EVOLUTIONS[:3]))
def test_regularised_law(mu, b, v, alpha, which):
    """With w = tanh(μss/a); friction as low as a here, so that w is far from 1."""
    a, sigma, memory = 0.02, 3e6, ss.laws.LinkerDieterich(alpha=alpha)
    law = ss.laws.RateState(
        a=a, b=b, d_c=2e-6, mu_ref=mu, v_ref=1e-6, evolution=which, normal_memory=memory, regularised=True
    )
    steady = float(law.steady_strength(v, sigma)) / sigma
    w = np.tanh(steady / a)
    expected = [a * sigma / v * w, -(b - a) * sigma / v * w, v / 2e-6, steady - alpha * w, steady]
    size = [sigma / v * (a + b), sigma / v * (a + b), v / 2e-6, 1, 1]
    np.testing.assert_array_less(np.abs(np.subtract(ingredients(law, v, sigma), expected)), 1e-13 * np.array(size))


@modest
@given(c=st.floats(0, 5), v=velocities, alpha=st.floats(0, 0.6), regularised=st.booleans(), low=st.booleans())
def test_nagata_law(c, v, alpha, regularised, low):
    a, b, sigma, mu_ref = 0.012, 0.017, 3e6, 0.02 if low and regularised else 0.7
    law = ss.laws.RateState(
        a=a,
        b=b,
        d_c=2e-6,
        mu_ref=mu_ref,
        v_ref=1e-6,
        evolution=ss.laws.Nagata(c_nagata=c),
        normal_memory=ss.laws.LinkerDieterich(alpha=alpha),
        regularised=regularised,
    )
    mu = float(law.steady_strength(v, sigma)) / sigma
    w = np.tanh(mu / a) if regularised else 1.0
    share = 1 + c * w
    expected = [a * sigma / v * w / share, -(b - a) * sigma / v * w, v / 2e-6 / share, mu - alpha * w / share, mu]
    size = [sigma / v * (a + b), sigma / v * (a + b), v / 2e-6, 1, 1]
    np.testing.assert_array_less(np.abs(np.subtract(ingredients(law, v, sigma), expected)), 1e-13 * np.array(size))


@modest
@given(
    v=st.floats(1e-9, 1e-4),
    sigma0=st.floats(1e3, 1e8),
    sigma1=st.just(0.0) | st.floats(1e-9, 1e4),
    viscous=st.just(0.0) | st.floats(1e-9, 100),
    static=st.floats(0.05, 0.9),
)
def test_lugre_closed_forms(v, sigma0, sigma1, viscous, static):
    """Theory 4: r = σ0 v0/g, f = σ2 + σ1 v0 g'/g, S = σ2 + g', μ = g + σ2 v0, f1 = μ; per unit normal stress."""
    sigma, v_s = 3e6, 1e-5
    law = ss.laws.LuGre(
        mu_coulomb=0.3,
        mu_static=static,
        v_stribeck=v_s,
        viscous=viscous,
        bristle_stiffness=sigma0,
        bristle_damping=sigma1,
    )
    g = 0.3 + (static - 0.3) * np.exp(-((v / v_s) ** 2))
    slope = -(static - 0.3) * 2 * v / v_s**2 * np.exp(-((v / v_s) ** 2))
    mu = g + viscous * v
    expected = [sigma * (viscous + sigma1 * v * slope / g), sigma * (viscous + slope), sigma0 * v / g, mu, mu]
    # f is differentiated as the difference of 1 and 1 − v g'/g; exp turns the rounding of its argument into relative
    rounding = 1e-13 * (1 + (v / v_s) ** 2)
    size = [sigma * (viscous + sigma1 * (1 + v * abs(slope) / g)), sigma * (viscous + abs(slope)), sigma0 * v / g, 1, 1]
    found = ingredients(law, v, sigma)
    assert np.all(np.abs(np.subtract(found, expected)) <= rounding * np.array(size) + 1e-200)  # underflow aside


def test_lugre_weakening_at_once():
    """f < 0: without mass no stiffness is stable; with mass those below rS(mr + f)/(−f), where S > 0."""
    falling = ss.laws.LuGre(
        mu_coulomb=0.3,
        mu_static=0.5,
        v_stribeck=1e-3,
        viscous=150.0,
        bristle_stiffness=1e4,
        bristle_damping=1e3,
    )
    sigma, v = 1e6, 1e-3
    f, S, r, _, _ = ingredients(falling, v, sigma)
    assert f < 0 < S
    assert np.isnan(ss.stable_stiffness(rig_with(falling, v, sigma))).all()
    m = -2 * f / r
    heavy = rig_with(falling, v, sigma, mass=m)
    np.testing.assert_allclose(ss.stable_stiffness(heavy), [[0.0, r * S * (m * r + f) / -f]], rtol=1e-12)
    light = rig_with(falling, v, sigma, mass=-0.5 * f / r)
    assert np.isnan(ss.stable_stiffness(light)).all()


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
def test_prakash_clifton_characteristic_equation(share, evolution):
    """(ms² + k)(s + r)(s + r_σ) + s(fs + rS)(s + r_σ) + μ(gs + r_σ)(s + r)B(s) = 0 (theory 2)."""
    law = ss.laws.RateState(
        **ROCK, **ONE, evolution=evolution, normal_memory=ss.laws.PrakashClifton(direct_share=share, slip_distance=3e-6)
    )
    v, sigma, m, k, c, eta = 2e-6, 5e6, 1e10, 7e9, 2e9, 3e9
    b0, b1, b2, b3 = 4e9, -1e10, 0.3, 2e9
    rig = rig_with(
        law,
        v,
        contact=ss.laws.LinearNormalStress(steady_normal_stress=sigma, b0=b0, b1=b1, b2=b2, b3=b3),
        stiffness=k,
        mass=m,
        damping=c,
        radiation_damping=eta,
    )
    r, r_s, mu = v / 1e-6, v / 3e-6, 0.7 + (0.0145 - 0.016) * np.log(2)
    f, S = 0.0145 * sigma / v + c + eta, (0.0145 - 0.016) * sigma / v + c + eta
    P = np.polynomial.Polynomial
    by_hand = (
        P([k, 0, m]) * P([r, 1]) * P([r_s, 1])
        + P([0, r * S, f]) * P([r_s, 1])
        + mu * P([r_s, share]) * P([r, 1]) * P([k * b2 + b3, b1, b0])
    ).coef
    np.testing.assert_allclose(polynomial(rig), by_hand / by_hand[-1], rtol=1e-12)


def test_prakash_clifton_distance_is_d_c_unless_given():
    law = ss.laws.RateState(**ROCK, **ONE, normal_memory=ss.laws.PrakashClifton())
    same = ss.laws.RateState(**ROCK, **ONE, normal_memory=ss.laws.PrakashClifton(slip_distance=ONE["d_c"]))
    angled = ss.laws.InclinedSpring(preload=5e6, angle=0.5)
    found, expected = (polynomial(rig_with(one, contact=angled)) for one in (law, same))
    np.testing.assert_allclose(found, expected, rtol=1e-13)
