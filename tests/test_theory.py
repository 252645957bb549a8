"""Laws of nature and closed forms of the theory, typed here a second time and independently."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from steadyslip.linear import cubic
from steadyslip.linear.linearise import characteristic_coefficients
from steadyslip.linear.polynomials import is_hurwitz, roots, stable_set
from steadyslip.linear.state_space import jacobian
from steadyslip.linear.stiffness import characteristic, closed_form_interval, general_set
from steadyslip.model import build_model
from steadyslip.quantities import unit
from steadyslip.values import model_values

A, B, D_C, V0, SIGMA = 0.0145, 0.0160, 1e-6, 1e-6, 5e6
EPS = np.finfo(float).eps


def rate_state(**changes):
    return ss.RateState(**({"a": A, "b": B, "d_c": D_C, "mu_ref": 0.7, "v_ref": V0} | changes))


def rig(**changes):
    parts = {"friction": rate_state(), "contact": ss.Constant(preload=SIGMA), "stiffness": 7e9, "drive": ss.Steady(V0)}
    return ss.Slider(**(parts | changes))


# --- closed forms of theory 4 ------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [0.0, 1e9, 1e12])
@pytest.mark.parametrize("evolution", [ss.Slip(), ss.Aging(), ss.PRZ()])
def test_constant_normal_stress(mass, evolution):
    r = rig(friction=rate_state(evolution=evolution), mass=mass)
    expected = SIGMA * (B - A) / D_C * (1 + mass * V0**2 / (A * SIGMA * D_C))
    assert ss.critical_stiffness(r) == pytest.approx(expected, rel=1e-13)
    frequency = ss.analyze(r).critical_angular_frequency
    assert frequency == pytest.approx(V0 / D_C * math.sqrt((B - A) / A), rel=1e-12)


@pytest.mark.parametrize("name", ["damping", "radiation_damping"])
@pytest.mark.parametrize("mass", [0.0, 1e10])
def test_extra_damping(name, mass):
    """k_cr = −r S_e (1 + m r/f_e), β² = −r² S_e/f_e with f_e = f + c, S_e = S + c."""
    c = 3e9
    r = rig(**{name: c}, mass=mass)
    f, slope, rate = A * SIGMA / V0 + c, -(B - A) * SIGMA / V0 + c, V0 / D_C
    assert ss.critical_stiffness(r) == pytest.approx(-rate * slope * (1 + mass * rate / f), rel=1e-13)
    assert ss.analyze(r).critical_angular_frequency == pytest.approx(rate * math.sqrt(-slope / f), rel=1e-12)
    if name == "radiation_damping" and mass == 0:
        assert ss.critical_stiffness(r) == pytest.approx((SIGMA * (B - A) - c * V0) / D_C, rel=1e-13)


KAPPA = {-45: 0.00174418604651, -30: 0.00163190533807, 0: 0.0015, 30: 0.00138782355738, 45: 0.00131578947368}
BETA = {-45: 0.189964754254, 0: 0.321633760451, 45: 0.392765798889}


@pytest.mark.parametrize("angle", KAPPA)
def test_paper_numbers(angle):
    friction = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.56))
    a = ss.analyze(rig(friction=friction, contact=ss.InclinedSpring(preload=5e6, angle=f"{angle} deg")))
    assert a.critical_stiffness * D_C / a.steady.normal_stress == pytest.approx(KAPPA[angle], rel=1e-11)
    if angle in BETA:
        assert a.critical_angular_frequency * D_C / V0 == pytest.approx(BETA[angle], rel=1e-11)


def test_masses_of_the_paper():
    """m*_cr1 = .003625; m*_cr2 at 15° and 45°, where the last stabilising stiffness goes to infinity."""
    friction = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.56))
    for angle, expected in ((15, 0.1002584584), (45, 0.02951785714)):
        r = rig(friction=friction, contact=ss.InclinedSpring(steady_normal_stress=SIGMA, angle=f"{angle} deg"))
        size = SIGMA * D_C / V0**2
        k = ss.critical_stiffness(r, {"mass": expected * size * np.array([1 - 1e-6, 1 + 1e-6])})
        assert k[0] > 1e3 * ss.critical_stiffness(r)
        assert np.isnan(k[1])
    masses = 0.003625 * size
    angles = np.radians([-50, -20, 0, 20, 60])
    k = ss.critical_stiffness(r, {"mass": masses, "angle": angles})
    assert np.ptp(k) < 1e-12 * k[0]


def test_two_states():
    """Slip law with β = (1, .84), ρ = .048: κ_cr = .08027556564916812."""
    a = 0.01
    states = [ss.State(b=a, d_c=0.048e-5), ss.State(b=0.84 * a, d_c=1e-5)]
    friction = ss.RateState(a=a, states=states, mu_ref=0.6, v_ref=V0)
    r = rig(friction=friction)
    k = ss.critical_stiffness(r) * states[0].d_c / (a * SIGMA)
    assert k == pytest.approx(0.08027556564916812, rel=1e-12)
    beta1, beta2, rho, kappa = 1.0, 0.84, 0.048, 0.05
    mine = np.array(
        [kappa * rho, kappa * (1 + rho) + rho * (1 - beta1 - beta2), 1 + rho + kappa - beta1 - rho * beta2, 1]
    )
    scaled = r.with_values({"stiffness": kappa * a * SIGMA / states[0].d_c})
    np.testing.assert_allclose(
        np.sort_complex(ss.eigenvalues(scaled)) * states[0].d_c / V0, np.sort_complex(np.roots(mine[::-1])), rtol=1e-12
    )


def test_position_control():
    """PD: k = Kp, c = Kd; PID: the quartic of theory 4."""
    mass, kd, kp, ki = 1e9, 2e9, 6e9, 1e8
    f, slope, rate = A * SIGMA / V0, -(B - A) * SIGMA / V0, V0 / D_C
    held = rig(stiffness=None, mass=mass, drive=ss.PD(V0, kp=kp, kd=kd))
    critical = -rate * (slope + kd) * (1 + mass * rate / (f + kd))
    (edge,) = [e for e in ss.boundary(held, "drive.kp") if e.kind == "oscillatory"]
    assert edge.value == pytest.approx(critical, rel=1e-12)
    strong = held.with_values({"kd": 1.01 * -slope})
    assert not ss.boundary(strong, "drive.kp", between=(1.0, 1e15))
    assert ss.analyze(strong).stable
    quartic = [rate * ki, ki + rate * kp, kp + rate * kd + rate * slope, mass * rate + kd + f, mass]
    full = rig(stiffness=None, mass=mass, drive=ss.PID(V0, kp=kp, kd=kd, ki=ki))
    np.testing.assert_allclose(
        np.sort_complex(ss.eigenvalues(full)), np.sort_complex(np.roots(quartic[::-1])), rtol=1e-11
    )


def test_lugre():
    """r = σ0 v0/g, f = σ2 + σ1 v0 g'/g, S = σ2 + g' per unit normal stress; the bound of theory 4."""
    v, n = 1e-3, 1e5
    law = ss.LuGre(
        mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800, viscous=80
    )
    g = 0.3 + 0.1 * math.exp(-1)
    dg = -0.2 * math.exp(-1) / 1e-3
    r = rig(friction=law, contact=ss.Constant(preload=n), mass=5e5, drive=ss.Steady(v))
    known = ss.small_signal(r)
    rate, f, slope = 1e4 * v / g, 80 + 800 * v * dg / g, 80 + dg
    assert (known.r, known.f / n, known.S / n) == pytest.approx((rate, f, slope), rel=1e-12)
    assert known.f1 == known.mu == pytest.approx(g + 80 * v, rel=1e-14)
    assert f < 0 < slope
    assert ss.stable_stiffness(r) == pytest.approx(
        np.array([[0, rate * slope * n * (5e5 * rate + f * n) / (-f * n)]]), rel=1e-11
    )
    massless = ss.analyze(r.with_values({"mass": 0.0}))
    assert (massless.stable, massless.stable_stiffness) == (False, ())


def test_memoryless_friction_misses_the_critical_stiffness():
    """Stribeck friction: no stiffness at all or every stiffness, with or without mass."""
    law = ss.CoulombStribeck(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3)
    for velocity, mass in product((1e-4, 1e-3), (0.0, 1e3)):
        falling = rig(friction=law, mass=mass, drive=ss.Steady(velocity))
        assert np.isnan(ss.critical_stiffness(falling))
        assert np.all(np.isnan(ss.stable_stiffness(falling)))
        damped = falling.with_values({"friction.viscous": 1e3})
        assert ss.stable_stiffness(damped).tolist() == [[0.0, math.inf]]


def test_oscillating_normal_stress():
    """Perfettini et al. (2001): φ̂/ε̂ = −s[(μ−α)s + μ]/[a s² + (κ̃−(b−a))s + κ̃], resonance at 2π√(a/κ̃)."""
    alpha, k = 0.3, 2e10
    r = rig(
        friction=rate_state(normal_memory=ss.LinkerDieterich(alpha=alpha)),
        contact=ss.Prescribed(preload=SIGMA),
        stiffness=k,
    )
    kappa = k * D_C / SIGMA
    omega = np.geomspace(1e-2, 1e2, 41)  # in v0/d_c
    s = 1j * omega
    expected = -s * ((0.7 - alpha) * s + 0.7) / (A * s**2 + (kappa - (B - A)) * s + kappa)
    system = ss.state_space(r, ["v"])

    def response_at(w):
        inner = np.linalg.solve(1j * w * V0 / D_C * np.eye(len(system.A)) - system.A, system.B[:, 2])
        return (system.C @ inner + system.D[:, 2])[0]

    found = np.array([response_at(w) for w in omega])
    np.testing.assert_allclose(found * SIGMA / V0, expected, rtol=1e-11)
    resonance = math.sqrt(kappa / A)  # where −ω²a + κ̃ vanishes, the response is in phase with the damping term
    assert abs(response_at(resonance) * SIGMA / V0) == pytest.approx(
        abs((0.7 - alpha) * 1j * resonance + 0.7) / (kappa - (B - A)), rel=1e-11
    )


def test_fault_mode():
    """Theory 8: antiplane mode of wavelength λ is a slider of stiffness πG/λ: λ_cr = πGd_c/(σ(b−a))."""
    shear_modulus = 30e9
    wavelength = math.pi * shear_modulus * D_C / (SIGMA * (B - A))
    assert ss.critical_stiffness(rig()) == pytest.approx(shear_modulus * (2 * math.pi / wavelength) / 2, rel=1e-13)


# --- two routes ---------------------------------------------------------------------------------------

CONTACTS = (
    ss.Constant(preload=SIGMA),
    ss.InclinedSpring(preload=SIGMA, angle=-0.5),
    ss.SliderCrank(preload=SIGMA, crank_angle=1.0, crank_radius=0.1, rod_length=0.3),
    ss.Triaxial(confining_pressure=SIGMA, angle=0.5),
    ss.SelfEnergising(preload=SIGMA, gain=0.4),
    ss.LeadScrew(axial_load=SIGMA, lead_angle=0.2, direction="lowering"),
    ss.DilatingLayer(preload=SIGMA, ram_stiffness=1e11, dilatancy=1e-8, v_ref=V0),
    ss.Lift(preload=SIGMA, lift=1e11, v_ref=V0),
    ss.SlopedGuide(preload=SIGMA, guide_stiffness=1e10, slope=0.1),
    ss.Linear(steady_normal_stress=SIGMA, b0=2e9, b1=1e10, b2=0.3, b3=2e9),
)
ONE_MEMORY = (
    rate_state(),
    rate_state(evolution=ss.Aging(), normal_memory=ss.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.PRZ(), regularised=True, normal_memory=ss.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.Nagata(c_nagata=0.7), normal_memory=ss.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.Nagata(c_nagata=0.7), regularised=True),
    ss.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10, viscous=5),
)


@pytest.mark.parametrize("friction", ONE_MEMORY, ids=lambda law: type(getattr(law, "evolution", law)).__name__)
@pytest.mark.parametrize("contact", CONTACTS, ids=lambda law: law.name)
@pytest.mark.parametrize("inertia", [False, True])
def test_both_routes_agree_on_random_rigs(friction, contact, inertia):
    """Closed form against Jacobian on 40 random rigs of each kind: some 5000 rigs in all."""
    rng = np.random.default_rng(7)
    start = rig(
        friction=friction, contact=contact, mass=1e9 if inertia else 0.0, damping=1e9, radiation_damping=1e9,
        drive=ss.PD(V0, kp=1e9, kd=1e9),
    )  # fmt: skip
    names = [n for n, a in start.parameters().items() if a.value and not a.role.gauge and a.role.unit != "rad"]
    vary = {n: start.value(n) * 10 ** rng.uniform(-0.3, 0.3, 40) for n in names if n != "contact.rod_length"}
    values = model_values(start, vary)
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
    states = [ss.State(b=0.01, d_c=1e-6), ss.State(b=0.008, d_c=5e-6)]
    friction = ss.RateState(a=A, states=states, mu_ref=0.6, v_ref=V0, normal_memory=ss.LinkerDieterich(alpha=0.2))
    r = rig(friction=friction, contact=contact, mass=mass)
    found = np.sort_complex(np.linalg.eigvals(jacobian(r)))
    np.testing.assert_allclose(np.sort_complex(ss.eigenvalues(r)), found, rtol=1e-6, atol=1e-9 * V0 / D_C)


# --- stable sets ---------------------------------------------------------------------------------------


@given(st.integers(2, 5), st.randoms(use_true_random=False))
@settings(max_examples=150, deadline=None)
def test_membership_in_the_stable_set_is_the_sign_of_the_roots(degree, random):
    p = np.array([random.uniform(-1, 1) * 10 ** random.uniform(-2, 2) for _ in range(degree)] + [1.0])
    q = np.array([random.uniform(-1, 1) * 10 ** random.uniform(-2, 2) for _ in range(degree - 1)] + [0.0, 0.0])
    found = stable_set(p, q)
    for _ in range(12):
        k = 10 ** random.uniform(-4, 4)
        inside = bool(np.any((found.intervals[:, 0] < k) & (k < found.intervals[:, 1])))
        with np.errstate(all="ignore"):
            growth = np.max(np.roots((p + k * q)[::-1]).real)
        near = np.any(np.abs(found.edges / k - 1) < 1e-6)
        assert near or abs(growth) < 1e-9 or inside == (growth < 0)


def test_a_union_of_intervals():
    """Membership over six decades of k of a polynomial that is stable, unstable and stable again."""
    base = np.polynomial.polynomial.polyfromroots([-0.1 + 1j, -0.1 - 1j, -0.2 + 2j, -0.2 - 2j, -3]).real
    push = np.array([-0.54, -0.32, 0.41, 1.04, 0.0, 0.0])
    found = stable_set(base, push)
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
    r = rig(contact=ss.Linear(steady_normal_stress=SIGMA, b0=b0), mass=mass, stiffness=1e11)
    assert ss.growth_rate(r) == math.inf
    assert not ss.analyze(r).stable
    assert np.all(np.isnan(ss.stable_stiffness(r)))
    assert "ill-posed" in ss.analyze(r).reason


def test_quasistatic_with_too_much_lift_is_ill_posed():
    """a2 = f + f1 B1 <= 0 without mass: any small lag grows at once, even where all roots lie left."""
    f = A * SIGMA / V0
    r = rig(contact=ss.Linear(steady_normal_stress=SIGMA, b1=-2 * f / 0.7), stiffness=1e11)
    assert ss.growth_rate(r) == math.inf
    assert not ss.analyze(r).stable


# --- limits, symmetries --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["contact.angle", "slider.mass", "slider.radiation_damping", "friction.normal_memory.alpha"]
)
def test_small_terms_vanish_at_first_order(name):
    friction = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.4))
    full = rig(friction=friction, contact=ss.InclinedSpring(preload=SIGMA, angle=0.3))
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
@settings(max_examples=40, deadline=None)
def test_results_do_not_depend_on_the_units(kilogram, metre, second):
    """Rescaling mass, length and time in every parameter rescales every answer."""
    r = rig(
        friction=rate_state(normal_memory=ss.LinkerDieterich(alpha=0.4)),
        contact=ss.InclinedSpring(preload=SIGMA, angle=-0.4), mass=1e9, damping=1e8, radiation_damping=1e8,
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


# --- edges ------------------------------------------------------------------------------------------------


def test_edge_values_invert_the_closed_forms():
    friction = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.56))
    r = rig(friction=friction, contact=ss.InclinedSpring(steady_normal_stress=SIGMA, angle=-0.5), stiffness=7.8e9)
    t = math.tan(-0.5)
    expected = {
        "friction.b": A + 7.8e9 * D_C / SIGMA * (1 + 0.14 * t),
        "friction.d_c": SIGMA * (B - A) / (7.8e9 * (1 + 0.14 * t)),
        "slider.stiffness": SIGMA * (B - A) / (D_C * (1 + 0.14 * t)),
        "contact.angle": math.atan((SIGMA * (B - A) / (7.8e9 * D_C) - 1) / 0.14),
        "friction.normal_memory.alpha": 0.7 - (SIGMA * (B - A) / (7.8e9 * D_C) - 1) / t,
    }
    for name, value in expected.items():
        edges = [e for e in ss.boundary(r, name) if e.kind == "oscillatory"]
        assert min(abs(e.value / value - 1) for e in edges) < 1e-11, name
        for edge in edges:
            low, high = edge.bracket
            assert low <= edge.value <= high
            growth = ss.growth_rate(r, {name: np.array([edge.value * (1 - 1e-6), edge.value * (1 + 1e-6)])})
            assert growth[0] * growth[1] < 0


def test_lock_up_edge_and_its_kind():
    r = rig(contact=ss.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=1e12)
    lock = [e for e in ss.boundary(r, "angle") if e.kind == "lock-up"]
    assert [e.value for e in lock] == pytest.approx([-math.atan(1 / 0.7)], rel=1e-12)


def test_a_window_between_samples_is_found():
    """A narrow unstable window in velocity: friction weakens only around one speed."""
    from steadyslip.records import positive

    class Dip(ss.FrictionLaw):
        centre: float = ss.parameter("m/s", positive, "velocity of the dip")

        def memory(self):
            return ("Theta",)

        def strength(self, v, sigma, memory, tau):
            import sympy as sp

            return sigma * (0.6 + 0.01 * sp.log(v / self.centre) + memory[0])

        def rates(self, v, sigma, memory, tau):
            return (-v / 1e-5 * (memory[0] - self.steady_memory(v, sigma)[0]),)

        def steady_memory(self, v, sigma):
            import sympy as sp

            return (-1e-3 * sp.tanh(80 * sp.log(v / self.centre)),)

    r = rig(friction=Dip(centre=2.3041e-6), contact=ss.Constant(preload=SIGMA), stiffness=1.0)
    edges = ss.boundary(r, "velocity")
    assert [e.stable for e in edges] == ["below", "above"]
    assert (
        edges[0].value < 2.3041e-6 < edges[1].value < 10 ** (1 / 40) * edges[0].value
    )  # narrower than the spacing of the samples


def test_range_is_checked():
    r = rig(contact=ss.InclinedSpring(preload=SIGMA, angle=-0.5))
    assert ss.boundary(r, "angle", between=("-60 deg", "-50 deg"))[0].kind == "lock-up"
    with pytest.raises(ss.ParameterError, match="between -90 deg and 90 deg"):
        ss.boundary(r, "angle", between=("-100 deg", 0))
    with pytest.raises(ss.ParameterError, match="low < high"):
        ss.boundary(r, "angle", between=(0.1, 0.0))
    with pytest.raises(ss.ParameterError, match="does not have it"):
        ss.boundary(r, "axial_stiffness")
    with pytest.raises(ss.UnknownNameError, match="did you mean"):
        ss.boundary(r, "contact.angel")


# --- arrays ----------------------------------------------------------------------------------------------


def test_arrays_equal_one_at_a_time():
    friction = rate_state(normal_memory=ss.LinkerDieterich(alpha=0.56))
    r = rig(friction=friction, contact=ss.InclinedSpring(preload=SIGMA, angle=0.1))
    angles, masses = np.radians([-70, -40, 0.0, 30])[:, None], np.array([0.0, 1e9, 1e11])
    vary = {"contact.angle": angles, "slider.mass": masses}
    k, sets, growth = ss.critical_stiffness(r, vary), ss.stable_stiffness(r, vary), ss.growth_rate(r, vary)
    assert (k.shape, sets.shape, growth.shape) == ((4, 3), (4, 3, 1, 2), (4, 3))
    assert ss.eigenvalues(r, vary).shape == (4, 3, 3)
    for i, j in np.ndindex(4, 3):
        one = r.with_values({"contact.angle": angles[i, 0], "slider.mass": masses[j]})
        assert k[i, j] == pytest.approx(ss.critical_stiffness(one), rel=1e-13, nan_ok=True)
        assert growth[i, j] == pytest.approx(ss.growth_rate(one), rel=1e-9, nan_ok=True)
    assert np.all(np.isnan(k[0]))  # locked up, and no other rig suffers
    assert np.all(np.isfinite(k[1:3]))


def test_large_arrays_go_in_pieces():
    r = rig(friction=rate_state(normal_memory=ss.LinkerDieterich(alpha=0.56)))
    a = np.linspace(0.005, 0.02, 100_003)
    whole = ss.critical_stiffness(r, {"friction.a": a})
    np.testing.assert_array_equal(whole[::97], ss.critical_stiffness(r, {"friction.a": a[::97]}))
    two = rig(
        friction=ss.RateState(a=A, states=[ss.State(b=B, d_c=D_C), ss.State(b=0.1, d_c=1.0)], mu_ref=0.7, v_ref=V0)
    )
    sets = ss.stable_stiffness(two, {"friction.a": a})
    few = ss.stable_stiffness(two, {"friction.a": a[:100]})
    np.testing.assert_array_equal(sets[:100, : few.shape[1]], few)


def test_labelled_arrays_keep_labels_and_gain_units():
    import xarray as xr

    angle = xr.DataArray(np.radians([-30, 0, 30]), dims="angle", coords={"angle": [-30, 0, 30]})
    mass = xr.DataArray([0.0, 1e9], dims="mass")
    r = rig(contact=ss.InclinedSpring(preload=SIGMA, angle=0.1))
    k = ss.critical_stiffness(r, {"contact.angle": angle, "mass": mass})
    assert k.dims == ("angle", "mass")
    assert (k.name, k.attrs["units"]) == ("critical_stiffness", "Pa/m")
    assert k.sel(angle=0).item(0) == pytest.approx(
        ss.critical_stiffness(r.with_values({"contact.angle": 0.0})), rel=1e-13
    )
    assert ss.stable_stiffness(r, {"contact.angle": angle}).dims == ("angle", "interval", "end")


def test_bad_arrays_are_all_reported():
    with pytest.raises(ss.ParameterError) as caught:
        ss.critical_stiffness(rig(), {"friction.a": [0.01, -1], "friction.d_c": [math.nan], "angel": 1, "mass": []})
    found = {p.name: p.message for p in caught.value.problems}
    assert "-1.0 at position (1,)" in found["friction.a"]
    assert "nan at position (0,)" in found["friction.d_c"]
    assert "unknown parameter" in found["angel"]
    assert "empty" in found["slider.mass"]
    with pytest.raises(ss.ParameterError, match="do not broadcast"):
        ss.critical_stiffness(rig(), {"a": [0.01, 0.02], "b": [1, 2, 3]})


# --- errata and formulas ---------------------------------------------------------------------------------


def test_printed_equations_are_wrong_and_ours_right():
    """Theory 9: eqs 19, 20 and 25 as printed do not put a root on the imaginary axis."""
    n = {
        "f": 2.2445,
        "f1": 0.2569,
        "r": 2.0649,
        "lam": 1.012,
        "lam1": 5.8639,
        "B0": 0.2,
        "B1": -0.43,
        "B2": 0.36,
        "B3": 0.07,
    }
    m = 0.3
    k = ss.paper.critical_stiffness(m=m, **n)
    beta = math.sqrt(ss.paper.critical_frequency_squared(k, **n))
    assert abs(ss.paper.characteristic_at(beta, k, m=m, **n)) < 1e-13 * n["r"] ** 2 * k
    known = {"f": n["f"], "S": -n["lam"] * n["f"], "r": n["r"], "f1": n["f1"], "mu": n["lam1"] * n["f1"], "m": m}
    known |= {b: n[b] for b in ("B0", "B1", "B2", "B3")}
    a0, a1, a2, a3 = cubic.coefficients(**known, k=k)
    assert a1 * a2 == pytest.approx(a0 * a3, rel=1e-13)

    f, f1, r, lam, lam1 = (n[x] for x in ("f", "f1", "r", "lam", "lam1"))
    B0, B1, B2, B3 = (n[x] for x in ("B0", "B1", "B2", "B3"))
    bottom = f * (1 + f1 * B2) + r * f1 * (lam1 - 1) * (B0 - m * B2) + B1 * B2 * f1**2
    top = -B1 * f1 * (f1 * (B3 + B1 * lam1 * r) + f1 * (lam1 - lam) + lam1 * r**2 * (m + B0 * f1 * lam1))
    top += r * f * lam * (f + m * r) - B3 * (f * f1 - m * r * f1 * (lam1 - 1)) + B0 * f * f1 * lam * lam1 * r**2
    a0, a1, a2, a3 = cubic.coefficients(**known, k=top / bottom)
    assert abs(a1 * a2 / (a0 * a3) - 1) > 1e-2

    spurious = ss.paper.spurious_stiffness(**n)
    assert ss.paper.critical_frequency_squared(spurious, **n) == pytest.approx(ss.paper.spurious_frequency_squared(r))
    printed = -(f1 * (lam1 - 1) * (B3 - B1 * r + B0 * r**2) + f1 * (lam + 1)) / (B2 * f1 * (lam1 - 1))
    assert abs(ss.paper.critical_frequency_squared(printed, **n) / -(r**2) - 1) > 1e-2


@pytest.mark.parametrize("contact", CONTACTS, ids=lambda law: law.name)
@pytest.mark.parametrize("mass", [0.0, 1e10])
def test_formula_gives_the_number(contact, mass):
    r = rig(friction=ONE_MEMORY[1], contact=contact, mass=mass)
    right = ss.formula(r).rhs
    model = build_model(r)
    numbers = {
        symbol.name: value for symbol, value in zip(model.parameters.values(), model_values(r).arguments, strict=True)
    }
    numbers |= {"sigma_ss": ss.steady_state(r).normal_stress, "mu_ss": 0.7}
    value = float(right.subs({s: numbers[s.name] for s in right.free_symbols}))
    critical = ss.critical_stiffness(r)
    assert value == pytest.approx(critical, rel=1e-9) or math.isnan(critical)


def test_formula_of_the_inclined_spring_and_of_what_has_none():
    r = rig(
        friction=rate_state(normal_memory=ss.LinkerDieterich(alpha=0.5)),
        contact=ss.InclinedSpring(preload=1e6, angle=0.1),
    )
    assert str(ss.formula(r).rhs) == "sigma_ss*(-a + b)/(d_c*(-alpha*tan(psi) + mu_ss*tan(psi) + 1))"
    two = rig(friction=ss.RateState(a=A, states=[ss.State(b=B, d_c=1.0)] * 2, mu_ref=0.7, v_ref=V0))
    with pytest.raises(ss.NotAvailable, match="2 memory variables"):
        ss.formula(two)


def test_model_prints_itself():
    r = rig(contact=ss.InclinedSpring(preload=SIGMA, angle=0.1), mass=1.0)
    model = build_model(r)
    text = str(model)
    for words in ("with inertia", "slip of the block", "contact.angle", "dv/dt = a_x", "tan(psi)"):
        assert words in text
    assert model._repr_latex_().startswith("$$\\begin{aligned}")
    assert build_model(r.with_values({"mass": 2.0})) is model  # numbers are no structure
    assert len(characteristic_coefficients(model)) == 4


def test_roots_keep_their_digits_beside_very_fast_ones():
    wanted = np.array([-1e-3 + 2e-3j, -1e-3 - 2e-3j, -5.0, -1e9])
    c = np.polynomial.polynomial.polyfromroots(wanted).real
    np.testing.assert_allclose(np.sort_complex(roots(c)), np.sort_complex(wanted), rtol=1e-12)
    assert is_hurwitz(c)
    assert not is_hurwitz(-c)


def test_names_of_a_law_never_clash_with_those_of_the_model():
    """A law may call its parameters and memory what it likes: the answer is that of the same law renamed."""
    import sympy as sp

    from steadyslip.records import positive

    def law(first, second, memory):
        def strength(self, v, sigma, memory, tau):
            return sigma * (0.6 + getattr(self, first) * sp.log(v / 1e-6) + memory[0])

        def rates(self, v, sigma, memory, tau):
            return (-v / 1e-5 * (memory[0] + getattr(self, second) * sp.log(v / 1e-6)),)

        def steady_memory(self, v, sigma):
            return (-getattr(self, second) * sp.log(v / 1e-6),)

        body = {
            "__annotations__": {first: float, second: float},
            first: ss.parameter("1", positive, "direct effect"),
            second: ss.parameter("1", positive, "evolution effect"),
            "memory": lambda self: (memory,),
            "strength": strength,
            "rates": rates,
            "steady_memory": steady_memory,
        }
        return type("Renamed", (ss.FrictionLaw,), body)(**{first: 0.01, second: 0.015})

    def answers(friction):
        r = rig(friction=friction, damping=1e9, radiation_damping=1e9, mass=1e9, contact=CONTACTS[1])
        return [
            ss.critical_stiffness(r),
            *ss.eigenvalues(r),
            *ss.state_space(r).B.ravel(),
            *ss.state_space(r).D.ravel(),
        ]

    expected = answers(law("direct", "evolution", "state"))
    for names in (("c", "m", "T"), ("k", "eta", "p"), ("v_0", "sigma_0", "q"), ("x", "v", "sigma"), ("t", "tau", "a_x"),
                  ("I_x", "v_lp", "sigma_ss"), ("psi", "mu_ss", "psi_friction")):  # fmt: skip
        np.testing.assert_allclose(answers(law(*names)), expected, rtol=1e-12)
