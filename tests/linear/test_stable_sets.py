"""Two routes to the same answer, stable sets, limits and symmetries."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from rigs_of_theory import CONTACTS, D_C, EPS, ONE_MEMORY, SIGMA, V0, A, rate_state, rig
from steadyslip.core.dimensions import unit
from steadyslip.linear import cubic
from steadyslip.linear.polynomials import stable_set
from steadyslip.linear.state_space import jacobian
from steadyslip.linear.stiffness import closed_form_interval, general_set
from steadyslip.model import build_model
from steadyslip.model.point import operating_point
from steadyslip.model.range import characteristic


@pytest.mark.parametrize("friction", ONE_MEMORY, ids=lambda law: type(getattr(law, "evolution", law)).__name__)
@pytest.mark.parametrize("contact", CONTACTS, ids=lambda law: law.name)
@pytest.mark.parametrize("inertia", [False, True])
@pytest.mark.campaign
def test_both_routes_agree_on_random_rigs(friction, contact, inertia):
    """Closed form against Jacobian on 40 random rigs of each kind: some 5000 rigs in all."""
    rng = np.random.default_rng(7)
    start = rig(
        friction=friction, contact=contact, mass=1e9 if inertia else 0.0, damping=1e9, radiation_damping=1e9,
        drive=ss.machine.PD(V0, kp=1e9, kd=1e9),
    )  # fmt: skip
    names = [n for n, a in start.parameters().items() if a.value and not a.role.gauge and a.role.unit != "rad"]
    vary = {n: start.value(n) * 10 ** rng.uniform(-0.3, 0.3, 40) for n in names if n != "contact.rod_length"}
    values = operating_point(start, vary)
    with np.errstate(invalid="ignore"):
        closed = np.stack(ss.small_signal(start, vary).characteristic_polynomial(), axis=-1)
    general = characteristic(values)
    closed = closed if inertia or general.shape[-1] == 4 else closed[:, :3]
    good = np.all(np.isfinite(general), axis=-1)
    assert good.sum() > 5
    factor = general[good, -1:] / closed[good, -1:]
    assert np.all(factor > 0)
    size = np.abs(general[good]) + np.abs(factor * closed[good])
    # the terms of one coefficient may cancel: compare roots' scale through the largest neighbour
    scale = np.maximum(size, np.sqrt(np.roll(size, 1, -1) * np.roll(size, -1, -1)))
    assert np.all(np.abs(factor * closed[good] - general[good]) < 1e3 * EPS * scale)
    low, high = closed_form_interval(values)
    sets = general_set(values).intervals
    for i in np.flatnonzero(good):
        mine = [] if np.isnan(low[i]) else [low[i], np.broadcast_to(high, low.shape)[i]]
        theirs = sets[i][~np.isnan(sets[i])].ravel().tolist()
        assert theirs == pytest.approx(mine, rel=1e-8)


@pytest.mark.parametrize("contact", CONTACTS, ids=lambda law: law.name)
@pytest.mark.parametrize("mass", [0.0, 1e10])
def test_jacobian_has_the_roots_of_the_polynomial(contact, mass):
    states = [ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.008, d_c=5e-6)]
    friction = ss.laws.RateState(
        a=A, states=states, mu_ref=0.6, v_ref=V0, normal_memory=ss.laws.LinkerDieterich(alpha=0.2)
    )
    r = rig(friction=friction, contact=contact, mass=mass)
    found = np.sort_complex(np.linalg.eigvals(jacobian(r)))
    np.testing.assert_allclose(np.sort_complex(ss.eigenvalues(r)), found, rtol=1e-6, atol=1e-9 * V0 / D_C)


@given(st.integers(2, 5), st.randoms(use_true_random=False))
@settings(max_examples=150, deadline=None)
def test_membership_in_the_stable_set_is_the_sign_of_the_roots(degree, random):
    p = np.array([random.uniform(-1, 1) * 10 ** random.uniform(-2, 2) for _ in range(degree)] + [1.0])
    q = np.array([random.uniform(-1, 1) * 10 ** random.uniform(-2, 2) for _ in range(degree - 1)] + [0.0, 0.0])
    found = stable_set(p, q, 1)
    for _ in range(12):
        k = 10 ** random.uniform(-4, 4)
        inside = bool(np.any((found.intervals[:, 0] < k) & (k < found.intervals[:, 1])))
        with np.errstate(all="ignore"):  # coefficients of the size of 1e-300 come too
            growth = np.max(np.roots((p + k * q)[::-1]).real)
            near = np.any(np.abs(found.edges - k) < 1e-6 * k)
        assert near or abs(growth) < 1e-9 or inside == (growth < 0)


def test_a_union_of_intervals():
    """Membership over six decades of k of a polynomial that is stable, unstable and stable again."""
    base = np.polynomial.polynomial.polyfromroots([-0.1 + 1j, -0.1 - 1j, -0.2 + 2j, -0.2 - 2j, -3]).real
    push = np.array([-0.54, -0.32, 0.41, 1.04, 0.0, 0.0])
    found = stable_set(base, push, 1)
    k = np.geomspace(1e-3, 1e3, 4001)
    truth = np.array([np.max(np.roots((base + x * push)[::-1]).real) < 0 for x in k])
    inside = np.any((found.intervals[:, 0] < k[:, None]) & (k[:, None] < found.intervals[:, 1]), axis=-1)
    assert np.array_equal(truth, inside)
    assert len(found.intervals) == 2


def test_reversed_inequality():
    """D < 0 with N < 0: stable only below N/D."""
    known = {"f": 1.0, "S": 0.5, "r": 1.0, "f1": 0.1, "mu": 0.7, "B0": 0.0, "B1": 0.0, "B2": 1.0, "B3": 0.0, "m": 5.0}
    numerator, denominator = cubic.hopf_line(**known)
    assert numerator < 0
    assert denominator < 0
    low, high = cubic.stable_interval(numerator, denominator, 0.7, 0.0, 5.0 + 1.0, 5.0)
    assert (low, high) == (0.0, numerator / denominator)
    for k in (0.9 * high, 1.1 * high):
        growth = np.max(np.roots(cubic.coefficients(**known, k=k)[::-1]).real)
        assert (growth < 0) == (k < high)


@pytest.mark.parametrize(("mass", "b0"), [(1e9, -1e10), (0.0, -1e8)])
def test_negative_effective_mass_is_ill_posed(mass, b0):
    r = rig(contact=ss.laws.LinearNormalStress(steady_normal_stress=SIGMA, b0=b0), mass=mass, stiffness=1e11)
    assert ss.growth_rate(r) == math.inf
    assert not ss.analyze(r).stable
    assert np.all(np.isnan(ss.stable_stiffness(r)))
    assert "ill-posed" in ss.analyze(r).reason


def test_quasistatic_with_too_much_lift_is_ill_posed():
    """a2 = f + f1 B1 <= 0 without mass: any small lag grows at once, even where all roots lie left."""
    f = A * SIGMA / V0
    r = rig(contact=ss.laws.LinearNormalStress(steady_normal_stress=SIGMA, b1=-2 * f / 0.7), stiffness=1e11)
    assert ss.growth_rate(r) == math.inf
    assert not ss.analyze(r).stable


@pytest.mark.parametrize("velocity", [1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("stiffness", [1e4, 1e7])
def test_bristles_without_damping_need_a_mass(velocity, stiffness):
    """Velocity then has no effect at once on friction; all routes tell so."""
    friction = ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.45, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=0)
    r = rig(friction=friction, stiffness=stiffness, drive=ss.machine.SteadyDrive(velocity))
    masses = {"slider.mass": [0.0, 1e-6 * SIGMA]}
    assert ss.stability(r) == ss.stability(r, masses)[0] == "unstable"
    assert ss.growth_rate(r) == ss.growth_rate(r, masses)[0] == math.inf
    assert np.all(np.isnan(ss.stable_stiffness(r)))
    assert not ss.analyze(r).stable
    damped = r.with_values({"slider.damping": 10.0 * SIGMA})
    assert ss.stability(damped) == ss.stability(damped, masses)[0]
    assert ss.growth_rate(damped) == pytest.approx(ss.growth_rate(damped, masses)[0], rel=1e-9)


@pytest.mark.parametrize(
    "name", ["contact.angle", "slider.mass", "slider.radiation_damping", "friction.normal_memory.alpha"]
)
def test_small_terms_vanish_at_first_order(name):
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.4))
    full = rig(friction=friction, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=0.3))
    size = {"contact.angle": 1.0, "slider.mass": 1e10, "slider.radiation_damping": 1e9}.get(name, 1.0)
    small = size * np.array([0.0, 1e-5, 2e-5])
    k = ss.critical_stiffness(full, {name: small})
    bare = ss.critical_stiffness(full.with_values({name: 0.0}))
    assert k[0] == pytest.approx(bare, rel=4 * EPS)
    assert (k[2] - k[0]) / (k[1] - k[0]) == pytest.approx(2, rel=1e-3)


def test_eigenvalues_as_mass_vanishes():
    """One runs off as −f/m, the others converge at first order."""
    mass = 1e5 * np.array([4.0, 2.0, 1.0])
    found = ss.eigenvalues(rig(), {"mass": mass})
    limit = ss.eigenvalues(rig())
    error = np.abs(found[:, :2] - limit)
    np.testing.assert_allclose(error[:-1] / error[1:], 2, rtol=1e-3)
    np.testing.assert_allclose(found[:, 2].real * mass, -A * SIGMA / V0, rtol=1e-4)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=6, deadline=None)
def test_results_do_not_depend_on_the_units(kilogram, metre, second):
    """Rescaling mass, length and time in every parameter rescales every answer."""
    r = rig(
        friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
        contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.4), mass=1e9, damping=1e8, radiation_damping=1e8,
    )  # fmt: skip
    base = 10.0 ** np.array([kilogram, metre, second])

    def factor(name):
        d = unit(name)[1]
        return float(base[0] ** d.mass * base[1] ** d.length * base[2] ** d.time)

    changed = r.with_values({n: a.value * factor(a.role.unit) for n, a in r.parameters().items() if a.value})
    assert ss.critical_stiffness(changed) == pytest.approx(ss.critical_stiffness(r) * factor("Pa/m"), rel=1e-11)
    np.testing.assert_allclose(ss.eigenvalues(changed), ss.eigenvalues(r) / base[2], rtol=1e-9)
    for name in ("contact.angle", "friction.a", "slider.mass", "drive.velocity"):
        scale = factor(r.parameters()[r.resolve(name)].role.unit)
        mine, theirs = ss.boundary(r, name), ss.boundary(changed, name)
        assert [e.kind for e in mine] == [e.kind for e in theirs]
        assert [e.value * scale for e in mine] == pytest.approx([e.value for e in theirs], rel=1e-8)


@pytest.mark.parametrize("contact", CONTACTS, ids=lambda law: law.name)
def test_the_model_is_at_rest_in_its_own_steady_state(contact):
    """T, τ, σ and the rates, evaluated where the Model says that steady sliding is."""
    r = rig(friction=ONE_MEMORY[1], contact=contact, mass=1e9, damping=1e9, radiation_damping=1e9)
    model, values = build_model(r), operating_point(r)
    numbers = dict(zip(model.parameters.values(), values.arguments, strict=True))
    numbers[model.contact.sigma_ss] = ss.steady_state(r).normal_stress

    def value(expression):
        return float(sp.sympify(expression.xreplace(model.steady)).subs(numbers))

    for symbol, definition in model.definitions.items():
        assert value(definition) == pytest.approx(value(symbol), rel=1e-13)
    assert abs(value(model.contact.balance)) < 1e-13 * value(model.contact.friction)
    for rate in model.rates:
        assert abs(value(rate)) < 1e-13


def test_pid_without_integral_gain_is_pd():
    gains = {"kp": 1e9, "kd": 1e9}
    pid, pd = (rig(stiffness=None, mass=1e9, drive=law(V0, **gains)) for law in (ss.machine.PID, ss.machine.PD))
    np.testing.assert_array_equal(ss.eigenvalues(pid), ss.eigenvalues(pd))
