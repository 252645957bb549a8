"""Closed forms of the theory, typed here a second time and independently; errata of the paper; formulas."""

import math
from itertools import product

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from rigs_of_theory import CONTACTS, D_C, ONE_MEMORY, SIGMA, V0, A, B, rate_state, rig
from steadyslip.linear import cubic
from steadyslip.linear.formula import MU_SS, formula_in_parts
from steadyslip.linear.polynomials import is_hurwitz
from steadyslip.linear.roots import roots
from steadyslip.model import build_model
from steadyslip.model.linearisation import characteristic_coefficients
from steadyslip.model.point import operating_point


@pytest.mark.parametrize("mass", [0.0, 1e9, 1e12])
@pytest.mark.parametrize("evolution", [ss.laws.Slip(), ss.laws.Aging(), ss.laws.PRZ()])
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
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    a = ss.analyze(rig(friction=friction, contact=ss.laws.InclinedSpring(preload=5e6, angle=f"{angle} deg")))
    assert a.critical_stiffness * D_C / a.steady.normal_stress == pytest.approx(KAPPA[angle], rel=1e-11)
    if angle in BETA:
        assert a.critical_angular_frequency * D_C / V0 == pytest.approx(BETA[angle], rel=1e-11)


def test_masses_of_the_paper():
    """m*_cr1 = .003625; m*_cr2 at 15° and 45°, where the last stabilising stiffness goes to infinity."""
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    for angle, expected in ((15, 0.1002584584), (45, 0.02951785714)):
        r = rig(friction=friction, contact=ss.laws.InclinedSpring(steady_normal_stress=SIGMA, angle=f"{angle} deg"))
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
    states = [ss.laws.State(b=a, d_c=0.048e-5), ss.laws.State(b=0.84 * a, d_c=1e-5)]
    friction = ss.laws.RateState(a=a, states=states, mu_ref=0.6, v_ref=V0)
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
    held = rig(stiffness=None, mass=mass, drive=ss.machine.PD(V0, kp=kp, kd=kd))
    critical = -rate * (slope + kd) * (1 + mass * rate / (f + kd))
    (edge,) = [e for e in ss.boundary(held, "drive.kp") if e.kind == "oscillatory"]
    assert edge.value == pytest.approx(critical, rel=1e-12)
    strong = held.with_values({"kd": 1.01 * -slope})
    assert not ss.boundary(strong, "drive.kp", between=(1.0, 1e15))
    assert ss.analyze(strong).stable
    quartic = [rate * ki, ki + rate * kp, kp + rate * kd + rate * slope, mass * rate + kd + f, mass]
    full = rig(stiffness=None, mass=mass, drive=ss.machine.PID(V0, kp=kp, kd=kd, ki=ki))
    np.testing.assert_allclose(
        np.sort_complex(ss.eigenvalues(full)), np.sort_complex(np.roots(quartic[::-1])), rtol=1e-11
    )


def test_lugre():
    """r = σ0 v0/g, f = σ2 + σ1 v0 g'/g, S = σ2 + g' per unit normal stress; the bound of theory 4."""
    v, n = 1e-3, 1e5
    law = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800, viscous=80
    )
    g = 0.3 + 0.1 * math.exp(-1)
    dg = -0.2 * math.exp(-1) / 1e-3
    r = rig(friction=law, contact=ss.laws.ConstantNormalStress(preload=n), mass=5e5, drive=ss.machine.SteadyDrive(v))
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
    law = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3)
    for velocity, mass in product((1e-4, 1e-3), (0.0, 1e3)):
        falling = rig(friction=law, mass=mass, drive=ss.machine.SteadyDrive(velocity))
        assert np.isnan(ss.critical_stiffness(falling))
        assert np.all(np.isnan(ss.stable_stiffness(falling)))
        damped = falling.with_values({"friction.viscous": 1e3})
        assert ss.stable_stiffness(damped).tolist() == [[0.0, math.inf]]


def test_oscillating_normal_stress():
    """Perfettini et al. (2001): φ̂/ε̂ = −s[(μ−α)s + μ]/[a s² + (κ̃−(b−a))s + κ̃], resonance at 2π√(a/κ̃)."""
    alpha, k = 0.3, 2e10
    r = rig(
        friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=alpha)),
        contact=ss.laws.Prescribed(preload=SIGMA),
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
        model.written(symbol).name: value
        for symbol, value in zip(model.parameters.values(), operating_point(r).arguments, strict=True)
    }
    numbers |= {"sigma_ss": ss.steady_state(r).normal_stress, "mu_ss": 0.7}
    value = float(right.subs({s: numbers[s.name] for s in right.free_symbols}))
    critical = ss.critical_stiffness(r)
    assert value == pytest.approx(critical, rel=1e-9) or math.isnan(critical)


def test_formula_of_the_inclined_spring_and_of_what_has_none():
    r = rig(
        friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.5)),
        contact=ss.laws.InclinedSpring(preload=1e6, angle=0.1),
    )
    assert str(ss.formula(r).rhs) == "sigma_ss*(-a + b)/(d_c*(-alpha*tan(psi) + mu_ss*tan(psi) + 1))"
    two = rig(friction=ss.laws.RateState(a=A, states=[ss.laws.State(b=B, d_c=1.0)] * 2, mu_ref=0.7, v_ref=V0))
    with pytest.raises(ss.NotAvailable, match="2 memory variables"):
        ss.formula(two)


def test_model_prints_itself():
    r = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=0.1), mass=1.0)
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
    assert is_hurwitz(c, 1)
    assert not is_hurwitz(-c, 1)


def test_names_of_a_law_never_clash_with_those_of_the_model():
    """A law may call its parameters and memory what it likes: the answer is that of the same law renamed."""
    import sympy as sp

    from steadyslip.core.domains import positive

    def law(first, second, memory):
        def strength(self, v, sigma, memory, tau):
            return sigma * (0.6 + getattr(self, first) * sp.log(v / 1e-6) + memory[0])

        def rates(self, v, sigma, memory, tau):
            return (-v / 1e-5 * (memory[0] + getattr(self, second) * sp.log(v / 1e-6)),)

        def steady_memory(self, v, sigma):
            return (-getattr(self, second) * sp.log(v / 1e-6),)

        body = {
            "__annotations__": {first: float, second: float},
            first: ss.laws.parameter("1", positive, "direct effect"),
            second: ss.laws.parameter("1", positive, "evolution effect"),
            "memory": lambda self: (memory,),
            "strength": strength,
            "rates": rates,
            "steady_memory": steady_memory,
        }
        return type("Renamed", (ss.laws.FrictionLaw,), body)(**{first: 0.01, second: 0.015})

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


@pytest.mark.parametrize("stem", ["slow-axis", "lead-screw", "stick-slip"])
def test_the_formula_in_parts_is_the_formula(stem):
    """Long ones are told in ingredients that fit on a line; numbers put in, they are those of `critical_stiffness`."""
    own = ss.read_rig(f"examples/{stem}.toml")
    whole, *parts = formula_in_parts(own)
    assert sp.count_ops(whole) <= 60
    assert bool(parts) == (stem != "stick-slip")
    for part in parts[::-1]:
        whole = whole.subs(part.lhs, part.rhs)
    point = operating_point(own)
    names = dict(zip(map(point.model.written, point.model.parameters.values()), point.arguments, strict=True))
    steady = ss.steady_state(own)
    names |= {point.model.written(point.model.contact.sigma_ss): steady.normal_stress, MU_SS: steady.friction}
    assert float(whole.rhs.subs(names)) == pytest.approx(
        float(ss.critical_stiffness(own)) + float(own.drive.proportional()), rel=1e-9
    )
