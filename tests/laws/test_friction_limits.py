"""Friction laws that are one another in a limit: closed forms and identities of theory 4."""

import numpy as np
import pytest

import steadyslip as ss
from friction_laws import (
    EVOLUTIONS,
    MEMORIES,
    ONE,
    ROCK,
    TWO,
    polynomial,
    rig_with,
)

RIGS = {
    "angled": {"contact": ss.laws.InclinedSpring(preload=5e6, angle=-0.6), "velocity": 3e-6},
    "heavy": {"contact": ss.laws.InclinedSpring(preload=5e6, angle=0.6), "mass": 1e10, "radiation_damping": 1e9},
    "linear": {
        "contact": ss.laws.LinearNormalStress(preload=5e6, b0=1e9, b1=-2e9, b2=0.2, b3=1e8),
        "velocity": 3e-6,
        "damping": 1e9,
    },
}


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_critical_stiffness_at_constant_normal_stress(evolution):
    """σ(b − a)/d_c; k_cr = −rS, so Nagata's slower relaxation divides it by 1 + c_N."""
    law = ss.laws.RateState(**ROCK, **ONE, evolution=evolution)
    share = 1 + getattr(evolution, "c_nagata", 0.0)
    expected = 5e6 * (0.016 - 0.0145) / 1e-6 / share
    np.testing.assert_allclose(ss.critical_stiffness(rig_with(law)), expected, rtol=1e-12)


def test_two_state_critical_stiffness():
    """Theory 4: β = (1, .84), ρ = .048."""
    a, d_1, rho, sigma = 0.01, 1e-6, 0.048, 5e6
    states = [ss.laws.State(b=a, d_c=d_1), ss.laws.State(b=0.84 * a, d_c=d_1 / rho)]
    for evolution in EVOLUTIONS[:3]:
        law = ss.laws.RateState(a=a, states=states, mu_ref=0.6, v_ref=1e-6, evolution=evolution)
        kappa = ss.critical_stiffness(rig_with(law, sigma=sigma)) * d_1 / (a * sigma)
        np.testing.assert_allclose(kappa, 0.08027556564916812, rtol=1e-12)


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("regularised", [False, True])
def test_evolutions_share_one_polynomial_for_several_states(place, regularised):
    found = [
        polynomial(rig_with(ss.laws.RateState(**ROCK, **TWO, evolution=e, regularised=regularised), **RIGS[place]))
        for e in EVOLUTIONS[:3]
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-12)


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("states", [ONE, TWO])
@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
def test_no_memory_is_alpha_zero(evolution, states, place):
    law, zero = (
        ss.laws.RateState(**ROCK, **states, evolution=evolution, normal_memory=memory)
        for memory in (ss.laws.NoMemory(), ss.laws.LinkerDieterich(alpha=0.0))
    )
    np.testing.assert_allclose(
        polynomial(rig_with(zero, **RIGS[place])), polynomial(rig_with(law, **RIGS[place])), rtol=1e-12
    )


@pytest.mark.parametrize("place", RIGS)
def test_c_nagata_zero_is_aging(place):
    memory = ss.laws.LinkerDieterich(alpha=0.3)
    nagata, aging = (
        ss.laws.RateState(**ROCK, **ONE, evolution=e, normal_memory=memory)
        for e in (ss.laws.Nagata(c_nagata=0.0), ss.laws.Aging())
    )
    np.testing.assert_allclose(
        polynomial(rig_with(nagata, **RIGS[place])), polynomial(rig_with(aging, **RIGS[place])), rtol=1e-12
    )


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("memory", MEMORIES)
def test_identical_states_are_one_state(place, memory):
    """With b = Σ b_i the roots are those of one state; each further state only adds s = −r."""
    one = ss.laws.RateState(**ROCK, b=0.016, d_c=1e-6, normal_memory=memory)
    shares = (0.005, 0.007, 0.004)
    three = ss.laws.RateState(**ROCK, states=[ss.laws.State(b=b, d_c=1e-6) for b in shares], normal_memory=memory)
    setting = RIGS[place]
    relaxing = np.array([setting.get("velocity", 1e-6) / 1e-6, 1.0])
    expected = np.convolve(np.convolve(polynomial(rig_with(one, **setting)), relaxing), relaxing)
    # the highest coefficients may be zero where there is no inertia
    found = polynomial(rig_with(three, **setting))
    np.testing.assert_allclose(found, expected[: len(found)], rtol=1e-11)


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_regularised_tends_to_logarithmic(evolution, place):
    """1 − tanh(μ/a) < 2 exp(−2μ/a), 1e-41 here: nothing but rounding is left."""
    log, asinh = (ss.laws.RateState(**ROCK, **ONE, evolution=evolution, regularised=r) for r in (False, True))
    np.testing.assert_allclose(
        polynomial(rig_with(asinh, **RIGS[place])), polynomial(rig_with(log, **RIGS[place])), rtol=1e-11
    )


@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
@pytest.mark.parametrize("b", [0.0, -0.003])
def test_velocity_strengthening_is_stable_at_every_stiffness(b, evolution):
    """b = 0 and b < 0 are legal (some gouges are measured with b < 0)."""
    law = ss.laws.RateState(
        **ROCK, b=b, d_c=1e-6, evolution=evolution, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
    )
    assert np.isnan(ss.critical_stiffness(rig_with(law)))
    np.testing.assert_array_equal(ss.stable_stiffness(rig_with(law)), [[0, np.inf]])


def test_roots_do_not_depend_on_references():
    """v* and σ_ref are conventions: with mu_ref adapted to v*, no root moves."""
    law = ss.laws.RateState(**ROCK, **ONE, normal_memory=ss.laws.LinkerDieterich(alpha=0.3))
    mu = 0.7 + (0.0145 - 0.016) * np.log(10)
    moved = ss.laws.RateState(
        a=0.0145, **ONE, mu_ref=mu, v_ref=1e-5, normal_memory=ss.laws.LinkerDieterich(alpha=0.3, sigma_ref=7.0)
    )
    for place in RIGS.values():
        np.testing.assert_allclose(polynomial(rig_with(moved, **place)), polynomial(rig_with(law, **place)), rtol=1e-12)
