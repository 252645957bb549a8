"""Friction laws: the public contract over all of them, theory 2 to 4 by closed form, limits and identities."""

import itertools

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from steadyslip.core.expressions import array_function, asinh_exp, numpy_asinh_exp
from steadyslip.laws.friction.bristle import StribeckCurve
from steadyslip.linear.response import response
from steadyslip.model.linearisation import characteristic_coefficients
from steadyslip.model.point import operating_point
from steadyslip.testing import FRICTION_CHECKS, Conditions
from steadyslip.testing.statement import statement

ROCK = {"a": 0.0145, "mu_ref": 0.7, "v_ref": 1e-6}
ONE = {"b": 0.016, "d_c": 1e-6}
TWO = {"states": [ss.State(b=0.0145, d_c=1e-6), ss.State(b=0.004, d_c=2e-5)]}
THREE = {"states": [ss.State(b=0.01, d_c=1e-6), ss.State(b=-0.003, d_c=5e-6), ss.State(b=0.009, d_c=4e-5)]}
OWN_ALPHA = {"states": [ss.State(b=0.0, d_c=1e-6, alpha=0.2), ss.State(b=0.016, d_c=2e-5, alpha=0.1)]}
EVOLUTIONS = (ss.Slip(), ss.Aging(), ss.PRZ(), ss.Nagata(c_nagata=2.0))
MEMORIES = (
    ss.NoMemory(),
    ss.LinkerDieterich(alpha=0.3),
    ss.PrakashClifton(slip_distance=3e-6),
    ss.PrakashClifton(direct_share=0.4, slip_distance=3e-6),
)
BRISTLE = {"mu_coulomb": 0.3, "mu_static": 0.45, "v_stribeck": 2e-6, "viscous": 0.1}
WEAKENING = Conditions(instant_weakening=True)


def combinations():
    """Every second rate-and-state law that is allowed, so that any two parts meet, and the third in one of its kinds.

    Nagata's law has one state and no prakash-clifton.
    """
    for place in itertools.product(*map(range, (len(EVOLUTIONS), len(MEMORIES), 3, 2))):
        i, j, k, regularised = place
        evolution, memory, states = EVOLUTIONS[i], MEMORIES[j], (ONE, TWO, THREE)[k]
        if sum(place) % 2:
            continue
        if isinstance(evolution, ss.Nagata) and (states is not ONE or isinstance(memory, ss.PrakashClifton)):
            continue
        yield ss.RateState(**ROCK, **states, evolution=evolution, normal_memory=memory, regularised=bool(regularised))


LAWS = [
    *combinations(),
    ss.RateState(**ROCK, **OWN_ALPHA, normal_memory=ss.LinkerDieterich()),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6, evolution=ss.Aging()),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6, normal_memory=ss.LinkerDieterich(alpha=0.3)),
    ss.RateState(**ROCK, b=-0.003, d_c=1e-6, evolution=ss.PRZ(), normal_memory=ss.LinkerDieterich(alpha=0.3)),
    ss.RateState(**ROCK, b=-0.003, d_c=1e-6, evolution=ss.Nagata(c_nagata=0.5)),
    ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton()),
    ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton(direct_share=1.0)),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5),
    ss.CoulombStribeck(**BRISTLE),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3, stribeck_exponent=0.7),
    ss.CoulombStribeck(**BRISTLE, stribeck_exponent=1.3),
]


@pytest.mark.parametrize("check", FRICTION_CHECKS)
@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_contract(law, check):
    check(law, WEAKENING if isinstance(law, StribeckCurve) else Conditions())


@pytest.mark.parametrize(
    ("arguments", "name", "words"),
    [
        (TWO | {"evolution": ss.Nagata(c_nagata=1.0)}, "evolution", "nagata is defined for one state"),
        (
            ONE | {"evolution": ss.Nagata(c_nagata=1.0), "normal_memory": ss.PrakashClifton()},
            "normal_memory",
            "use none or linker-dieterich",
        ),
        ({"b": 0.0, "d_c": 1e-6, "evolution": ss.Nagata(c_nagata=1.0)}, "b", "use aging instead"),
        (TWO | {"b": 0.01}, "b", "given beside states"),
        (TWO | {"d_c": 1e-6}, "d_c", "given beside states"),
        ({"b": 0.016}, "d_c", "missing"),
        ({"d_c": 1e-6}, "b", "missing"),
        (TWO | {"normal_memory": ss.PrakashClifton()}, "normal_memory.slip_distance", "no default with several"),
        (ONE | {"normal_memory": ss.LinkerDieterich()}, "normal_memory.alpha", "missing"),
        (OWN_ALPHA, "states", "alpha needs normal_memory linker-dieterich"),
        (OWN_ALPHA | {"normal_memory": ss.LinkerDieterich(alpha=0.3)}, "normal_memory.alpha", "their sum is α"),
        (
            {
                "states": [ss.State(b=0.01, d_c=1e-6, alpha=0.1), ss.State(b=0.01, d_c=1e-5)],
                "normal_memory": ss.LinkerDieterich(),
            },
            "states",
            "for all or none",
        ),
        (
            {
                "states": [ss.State(b=0.01, d_c=1e-6), ss.State(b=-0.01, d_c=1e-5)],
                "normal_memory": ss.LinkerDieterich(alpha=0.3),
            },
            "states",
            "give each state its own alpha",
        ),
        (ONE | {"a": 0.0}, "a", "> 0"),
        (ONE | {"a": -0.01}, "a", "> 0"),
        ({"b": 0.016, "d_c": float("nan")}, "d_c", "> 0"),
        (ONE | {"mu_ref": True}, "mu_ref", "> 0"),
        (ONE | {"evolution": "slip"}, "evolution", "allowed: an Evolution"),
        (ONE | {"regularised": 1}, "regularised", "true or false"),
    ],
)
def test_refused(arguments, name, words):
    with pytest.raises(ss.ParameterError) as caught:
        ss.RateState(**(ROCK | arguments))
    assert [p.name for p in caught.value.problems] == [name]
    assert words in str(caught.value)


def test_all_problems_of_a_law_come_at_once():
    with pytest.raises(ss.ParameterError) as caught:
        ss.RateState(a=-1, b=0.016, d_c=0, mu_ref=0.7, v_ref="1 Pa")
    assert [p.name for p in caught.value.problems] == ["a", "d_c", "v_ref"]


# --- small perturbations, theory 3 ------------------------------------------------------------------


def rig_with(law, velocity=1e-6, sigma=5e6, contact=None, **slider):
    contact = contact or ss.Constant(steady_normal_stress=sigma)
    return ss.Slider(friction=law, contact=contact, drive=ss.Steady(velocity), **({"stiffness": 1e9} | slider))


def numbers_of(rig, expressions):
    values = operating_point(rig)
    sigma = ss.steady_state(rig).normal_stress
    function = array_function([*values.model.arguments], expressions(values.model))
    return [float(number) for number in function(*values.arguments, sigma)]


def ingredients(law, velocity, sigma):
    """f, S, r, f1, μ by differentiating the law."""
    return numbers_of(
        rig_with(law, velocity, sigma), lambda m: [getattr(response(m), n) for n in ("f", "S", "r", "f1", "mu")]
    )


def polynomial(rig):
    """Characteristic polynomial, lowest power first, the highest coefficient that is not zero made 1."""
    c = np.array(numbers_of(rig, characteristic_coefficients))
    return c / c[np.flatnonzero(c)[-1]]


small = st.floats(0.002, 0.03)
velocities = st.floats(1e-9, 1e-3)
modest = settings(max_examples=20, deadline=None)


@modest
@given(a=small, b=st.floats(-0.02, 0.03), v=velocities, alpha=st.floats(0, 0.6), which=st.sampled_from(EVOLUTIONS[:3]))
def test_one_state_laws_share_one_linearisation(a, b, v, alpha, which):
    memory = ss.LinkerDieterich(alpha=alpha)
    law = ss.RateState(a=a, b=b, d_c=2e-6, mu_ref=0.7, v_ref=1e-6, evolution=which, normal_memory=memory)
    sigma, mu = 3e6, 0.7 + (a - b) * np.log(v / 1e-6)
    expected = [a * sigma / v, -(b - a) * sigma / v, v / 2e-6, mu - alpha, mu]
    size = [sigma / v * (a + abs(b)), sigma / v * (a + abs(b)), v / 2e-6, 1, 1]
    np.testing.assert_array_less(np.abs(np.subtract(ingredients(law, v, sigma), expected)), 1e-13 * np.array(size))


@modest
@given(mu=st.floats(0.005, 0.1), b=small, v=velocities, alpha=st.floats(0, 0.6), which=st.sampled_from(EVOLUTIONS[:3]))
def test_regularised_law(mu, b, v, alpha, which):
    """With w = tanh(μss/a); friction as low as a here, so that w is far from 1."""
    a, sigma, memory = 0.02, 3e6, ss.LinkerDieterich(alpha=alpha)
    law = ss.RateState(
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
    law = ss.RateState(
        a=a,
        b=b,
        d_c=2e-6,
        mu_ref=mu_ref,
        v_ref=1e-6,
        evolution=ss.Nagata(c_nagata=c),
        normal_memory=ss.LinkerDieterich(alpha=alpha),
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
    sigma1=st.floats(0, 1e4),
    viscous=st.floats(0, 100),
    static=st.floats(0.05, 0.9),
)
def test_lugre_closed_forms(v, sigma0, sigma1, viscous, static):
    """Theory 4: r = σ0 v0/g, f = σ2 + σ1 v0 g'/g, S = σ2 + g', μ = g + σ2 v0, f1 = μ; per unit normal stress."""
    sigma, v_s = 3e6, 1e-5
    law = ss.LuGre(
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
    falling = ss.LuGre(
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
    law = ss.RateState(
        **ROCK, **ONE, evolution=evolution, normal_memory=ss.PrakashClifton(direct_share=share, slip_distance=3e-6)
    )
    v, sigma, m, k, c, eta = 2e-6, 5e6, 1e10, 7e9, 2e9, 3e9
    b0, b1, b2, b3 = 4e9, -1e10, 0.3, 2e9
    rig = rig_with(
        law,
        v,
        contact=ss.Linear(steady_normal_stress=sigma, b0=b0, b1=b1, b2=b2, b3=b3),
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
    law = ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton())
    same = ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton(slip_distance=ONE["d_c"]))
    angled = ss.InclinedSpring(preload=5e6, angle=0.5)
    found, expected = (polynomial(rig_with(one, contact=angled)) for one in (law, same))
    np.testing.assert_allclose(found, expected, rtol=1e-13)


# --- closed forms and limits, theory 4 --------------------------------------------------------------


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_critical_stiffness_at_constant_normal_stress(evolution):
    """σ(b − a)/d_c; k_cr = −rS, so Nagata's slower relaxation divides it by 1 + c_N."""
    law = ss.RateState(**ROCK, **ONE, evolution=evolution)
    share = 1 + getattr(evolution, "c_nagata", 0.0)
    expected = 5e6 * (0.016 - 0.0145) / 1e-6 / share
    np.testing.assert_allclose(ss.critical_stiffness(rig_with(law)), expected, rtol=1e-12)


def test_two_state_critical_stiffness():
    """Theory 4: β = (1, .84), ρ = .048."""
    a, d_1, rho, sigma = 0.01, 1e-6, 0.048, 5e6
    states = [ss.State(b=a, d_c=d_1), ss.State(b=0.84 * a, d_c=d_1 / rho)]
    for evolution in EVOLUTIONS[:3]:
        law = ss.RateState(a=a, states=states, mu_ref=0.6, v_ref=1e-6, evolution=evolution)
        kappa = ss.critical_stiffness(rig_with(law, sigma=sigma)) * d_1 / (a * sigma)
        np.testing.assert_allclose(kappa, 0.08027556564916812, rtol=1e-12)


RIGS = {
    "angled": {"contact": ss.InclinedSpring(preload=5e6, angle=-0.6), "velocity": 3e-6},
    "heavy": {"contact": ss.InclinedSpring(preload=5e6, angle=0.6), "mass": 1e10, "radiation_damping": 1e9},
    "linear": {"contact": ss.Linear(preload=5e6, b0=1e9, b1=-2e9, b2=0.2, b3=1e8), "velocity": 3e-6, "damping": 1e9},
}


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("regularised", [False, True])
def test_evolutions_share_one_polynomial_for_several_states(place, regularised):
    found = [
        polynomial(rig_with(ss.RateState(**ROCK, **TWO, evolution=e, regularised=regularised), **RIGS[place]))
        for e in EVOLUTIONS[:3]
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-12)


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("states", [ONE, TWO])
@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
def test_no_memory_is_alpha_zero(evolution, states, place):
    law, zero = (
        ss.RateState(**ROCK, **states, evolution=evolution, normal_memory=memory)
        for memory in (ss.NoMemory(), ss.LinkerDieterich(alpha=0.0))
    )
    np.testing.assert_allclose(
        polynomial(rig_with(zero, **RIGS[place])), polynomial(rig_with(law, **RIGS[place])), rtol=1e-12
    )


@pytest.mark.parametrize("place", RIGS)
def test_c_nagata_zero_is_aging(place):
    memory = ss.LinkerDieterich(alpha=0.3)
    nagata, aging = (
        ss.RateState(**ROCK, **ONE, evolution=e, normal_memory=memory) for e in (ss.Nagata(c_nagata=0.0), ss.Aging())
    )
    np.testing.assert_allclose(
        polynomial(rig_with(nagata, **RIGS[place])), polynomial(rig_with(aging, **RIGS[place])), rtol=1e-12
    )


@pytest.mark.parametrize("place", RIGS)
@pytest.mark.parametrize("memory", MEMORIES)
def test_identical_states_are_one_state(place, memory):
    """With b = Σ b_i the roots are those of one state; each further state only adds s = −r."""
    one = ss.RateState(**ROCK, b=0.016, d_c=1e-6, normal_memory=memory)
    shares = (0.005, 0.007, 0.004)
    three = ss.RateState(**ROCK, states=[ss.State(b=b, d_c=1e-6) for b in shares], normal_memory=memory)
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
    log, asinh = (ss.RateState(**ROCK, **ONE, evolution=evolution, regularised=r) for r in (False, True))
    np.testing.assert_allclose(
        polynomial(rig_with(asinh, **RIGS[place])), polynomial(rig_with(log, **RIGS[place])), rtol=1e-11
    )


@pytest.mark.parametrize("evolution", EVOLUTIONS[:3])
@pytest.mark.parametrize("b", [0.0, -0.003])
def test_velocity_strengthening_is_stable_at_every_stiffness(b, evolution):
    """b = 0 and b < 0 are legal (some gouges are measured with b < 0)."""
    law = ss.RateState(**ROCK, b=b, d_c=1e-6, evolution=evolution, normal_memory=ss.LinkerDieterich(alpha=0.3))
    assert np.isnan(ss.critical_stiffness(rig_with(law)))
    np.testing.assert_array_equal(ss.stable_stiffness(rig_with(law)), [[0, np.inf]])


def test_roots_do_not_depend_on_references():
    """v* and σ_ref are conventions: with mu_ref adapted to v*, no root moves."""
    law = ss.RateState(**ROCK, **ONE, normal_memory=ss.LinkerDieterich(alpha=0.3))
    mu = 0.7 + (0.0145 - 0.016) * np.log(10)
    moved = ss.RateState(
        a=0.0145, **ONE, mu_ref=mu, v_ref=1e-5, normal_memory=ss.LinkerDieterich(alpha=0.3, sigma_ref=7.0)
    )
    for place in RIGS.values():
        np.testing.assert_allclose(polynomial(rig_with(moved, **place)), polynomial(rig_with(law, **place)), rtol=1e-12)


# --- jumps and observables --------------------------------------------------------------------------


@modest
@given(ratio=st.floats(0.2, 5), alpha=st.floats(0.01, 0.6), which=st.sampled_from(EVOLUTIONS), two=st.booleans())
def test_sudden_change_of_normal_stress_moves_theta(ratio, alpha, which, two):
    """By −(α/b) ln(σ2/σ1), at fixed memory variables; with Nagata's coupling by 1/(1 + c_N) of it at fixed v."""
    nagata = isinstance(which, ss.Nagata)
    states = TWO if two and not nagata else ONE
    law = ss.RateState(**ROCK, **states, evolution=which, normal_memory=ss.LinkerDieterich(alpha=alpha))
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
        factor = 2 if isinstance(which, ss.PRZ) else 1
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
    law = ss.RateState(**ROCK, **ONE, evolution=ss.Nagata(c_nagata=c), normal_memory=ss.LinkerDieterich(alpha=alpha))
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
    law = ss.RateState(**ROCK, **ONE, evolution=evolution, normal_memory=ss.LinkerDieterich(alpha=0.3))
    theta = law.observables(v, sigma, (psi,), sp.nan)["Theta"][0]
    (rate,) = law.rates(v, sigma, (psi,), sp.nan)
    constant = evolution.rate(v, theta, ONE["d_c"], ROCK["v_ref"])
    gap = sp.diff(theta, t) - (constant - 0.3 / ONE["b"] * sp.diff(sigma, t) / sigma)
    assert abs(float(gap.subs(sp.Derivative(psi, t), rate).subs({psi: 0.42, t: 0.7}))) < 1e-10


@pytest.mark.parametrize(
    ("evolution", "in_seconds"),
    [
        (ss.Aging(), lambda v, theta, d_c: 1 - v * theta / d_c),
        (ss.PRZ(), lambda v, theta, d_c: 1 - (v * theta / (2 * d_c)) ** 2),
        (ss.Slip(), lambda v, theta, d_c: -v * theta / d_c * np.log(v * theta / d_c)),
    ],
)
def test_evolution_in_seconds(evolution, in_seconds):
    """θ̇ of the literature from Θ̇ = θ̇/θ."""
    v, state, d_c, v_ref = 3e-6, 0.4, 2e-6, 1e-6
    theta = float(evolution.state_time(state, d_c, v_ref))
    rate = float(evolution.rate(v, state, d_c, v_ref))
    np.testing.assert_allclose(rate * theta, in_seconds(v, theta, d_c), rtol=1e-13)


# --- the regularised law's own primitive ------------------------------------------------------------


@modest
@given(x=st.floats(1e-12, 1e6), y=st.floats(-700, 700), sign=st.sampled_from([-1, 1]))
def test_asinh_exp(x, y, sign):
    exact = sign * mpmath.asinh(mpmath.mpf(x) * mpmath.exp(mpmath.mpf(y)))
    # exp turns the rounding of its argument, up to 700 units, into a relative error
    np.testing.assert_allclose(float(numpy_asinh_exp(sign * x, y)), float(exact), rtol=2e-16 * (abs(y) + 30))


def test_asinh_exp_differentiates():
    x, y = sp.symbols("x y", real=True)
    plain = sp.asinh(x * sp.exp(y))
    for name in (x, y):
        difference = sp.diff(asinh_exp(x, y), name) - sp.diff(plain, name)
        assert abs(difference.subs({x: 0.3, y: 1.7}).evalf()) < 1e-14


def test_regularised_law_is_odd_in_velocity():
    law = ss.RateState(**ROCK, **ONE, regularised=True)
    forward, back = (float(law.strength(v, 5e6, (0.3,), 0)) for v in (2e-6, -2e-6))
    assert forward == -back
    assert float(law.strength(0.0, 5e6, (0.3,), 0)) == 0


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_regularised_memory_evolves_alike_in_reverse(evolution):
    """State rates use |v| (theory 2)."""
    law = ss.RateState(**ROCK, **ONE, evolution=evolution, regularised=True)
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
    law = ss.CoulombStribeck(**BRISTLE, stribeck_exponent=exponent)
    v = np.geomspace(1e-9, 1e-3, 60)
    expected = curve(v, exponent or 2.0) + 0.1 * v
    found = np.array([float(law.strength(one, 1.0, (), 0)) for one in v])
    assert found == pytest.approx(expected, rel=1e-14)
    assert float(law.strength(1e-30, 1.0, (), 0)) == pytest.approx(0.45, rel=1e-5)


@pytest.mark.parametrize(("exponent", "stable"), [(1.0, False), (2.0, False), (4.0, True)])
def test_stribeck_exponent_can_flip_a_verdict(exponent, stable):
    """With mass and without memory the rig is stable where friction rises: m s² + σ μ'(v) s + k = 0."""
    v, sigma = 0.5e-6, 5e6
    law = ss.CoulombStribeck(**(BRISTLE | {"viscous": 2.6e4}), stribeck_exponent=exponent)
    a_rig = ss.Slider(friction=law, contact=ss.Constant(preload=sigma), mass=1e6, stiffness=1e10, drive=ss.Steady(v))
    u = (v / 2e-6) ** exponent
    slope = -0.15 * exponent / v * u * np.exp(-u) + 2.6e4
    roots = np.roots([1e6, sigma * slope, 1e10])
    found = np.sort_complex(ss.eigenvalues(a_rig))
    assert found == pytest.approx(np.sort_complex(roots), rel=1e-10)
    assert ss.analyze(a_rig).stable is stable is bool(np.all(roots.real < 0))


def test_statement_of_a_law_is_symbolic_throughout():
    """No number of a law enters its equations: the contract and the Model see parameters."""
    for law in LAWS:
        said = statement(law)
        floats = [n for e in (said.strength, *said.rates) for n in e.atoms(sp.Float)]
        assert not floats, law
