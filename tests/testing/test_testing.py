"""The contract suite: each check catches a law broken on purpose, and says what is wrong."""

import math

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from steadyslip import testing
from steadyslip.core.domains import positive, real
from steadyslip.testing import Conditions, ContractViolation, Surroundings
from steadyslip.testing.precise import disagreement


@pytest.fixture(autouse=True)
def _own_registry(monkeypatch):
    """Laws defined in a test are forgotten after it."""
    for family in (ss.laws.FrictionLaw, ss.laws.ContactLaw):
        monkeypatch.setattr(family, "registry", dict(family.registry))


class Ruina(ss.laws.FrictionLaw):
    """The slip law once more, as an author would write it; the broken laws below change one thing each."""

    a: float = ss.laws.parameter("1", positive, "direct effect")
    b: float = ss.laws.parameter("1", real, "evolution effect")
    d_c: float = ss.laws.parameter("m", positive, "slip distance")

    def memory(self):
        return ("Theta",)

    def strength(self, v, sigma, memory, tau):
        return sigma * (0.7 + self.a * sp.log(v / 1e-6) + self.b * memory[0])

    def rates(self, v, sigma, memory, tau):
        return (-v / self.d_c * (sp.log(v / 1e-6) + memory[0]),)

    def steady_memory(self, v, sigma):
        return (-sp.log(v / 1e-6),)


NUMBERS = {"a": 0.0145, "b": 0.016, "d_c": 1e-6}


def broken(**methods):
    """A registered law like `Ruina` with some methods replaced."""
    law = type("Broken", (Ruina,), methods | {"__doc__": "Wrong on purpose."}, name="broken")
    return law(**NUMBERS)


class Unheard(sp.Function):
    """A function that only its author knows."""

    nargs = 1


def resetting(self, v, sigma, memory, tau):
    """A state that is wiped out while the normal stress passes 6.2 MPa."""
    slip = -v / self.d_c * (sp.log(v / 1e-6) + memory[0])
    wiping = 1e5 * v / self.d_c * sp.exp(-(((sigma - 6.2e6) / 2e5) ** 2))
    return (slip - wiping * (memory[0] - 3),)


def doubled(self):
    """A record that changes what it was given."""
    super(Ruina, self).__post_init__()
    object.__setattr__(self, "a", 2 * self.a)


# check, what is replaced in `Ruina`, what the message says; arguments are v, σ, memory, τ
FRICTION_FAULTS = [
    ("check_names", {"memory_units": lambda self: ("1", "Pa")}, r"memory_units\(\) has 2 units for 1"),
    ("check_names", {"memory_units": lambda self: ("cubits",)}, "unit of Theta: .*write an SI unit"),
    ("check_names", {"memory": lambda self: ("state variable",)}, "names must be letters"),
    ("check_names", {"rates": lambda self, v, s, y, t: (v * y[0], v)}, r"rates\(\) has 2 values for 1 memory"),
    ("check_names", {"steady_memory": lambda self, v, s: ()}, r"steady_memory\(\) has 0 values for 1 memory"),
    ("check_names", {"observables": lambda self, v, s, y, t: {"age": (y[0], "days old")}}, "unit of age"),
    (
        "check_symbols",
        {"rates": lambda self, v, s, y, t: (-v * y[0] - 0.5 * sp.Symbol("sigma_dot") / s,)},
        "rates contains sigma_dot; .*choose memory variables that stay",
    ),
    (
        "check_symbols",
        {"rates": lambda self, v, s, y, t: (-v * y[0] - 0.5 * sp.Function("sigma")(v).diff(v) / s,)},
        r"rates contains Derivative\(sigma",
    ),
    ("check_symbols", {"strength": lambda self, v, s, y, t: s * sp.Symbol("mu")}, "strength contains mu; allowed"),
    (
        "check_symbols",
        {"strength": lambda self, v, s, y, t: s * (0.7 + math.log(v / 1e-6))},
        "strength does not accept SymPy symbols .*sympy.log, not math.log",
    ),
    (
        "check_symbols",
        {"strength": lambda self, v, s, y, t: s if v > 1e-6 else 2 * s},
        "strength does not accept SymPy symbols .*Piecewise",
    ),
    (
        "check_steady_state",
        {"steady_memory": lambda self, v, s: (-sp.log(v / 1.01e-6),)},
        r"the steady state is not steady at v = 1.0e-6 m/s.*rates\(\) gives -0.00995033 for Theta",
    ),
    (  # right at 1 um/s, wrong elsewhere
        "check_steady_state",
        {"steady_memory": lambda self, v, s: (-2 * sp.log(v / 1e-6),)},
        "the steady state is not steady at v = 1.0e-9",
    ),
    (
        "check_steady_state",
        {"steady_strength": lambda self, v, s: s * (0.7 + (self.b - self.a) * sp.log(v / 1e-6))},
        r"steady_strength\(\) is .*leave steady_strength out",
    ),
    (
        "check_signs",
        {"strength": lambda self, v, s, y, t: s * (0.005 + self.a * sp.log(v / 1e-6) + self.b * y[0])},
        "the strength is -.* Pa at v = 0.0001 m/s, .*must be > 0.*narrow velocity_decades",
    ),
    (
        "check_signs",
        {"strength": lambda self, v, s, y, t: s * (0.7 - self.a * sp.log(v / 1e-6) + self.b * y[0])},
        "the direct effect .*instant_weakening=True",
    ),
    (
        "check_signs",
        {"rates": lambda self, v, s, y, t: (v / self.d_c * (sp.log(v / 1e-6) + y[0]),)},
        "Theta does not relax .*grows at 1.0 1/s, must decay",
    ),
    ("check_signs", {"rates": lambda self, v, s, y, t: (sp.Integer(0),)}, "Theta does not relax .*grows at 0"),
    (
        "check_signs",
        {
            "strength": lambda self, v, s, y, t: 10 * t + s * (1 + sp.log(v / 1e-6) + y[0]),
            "steady_strength": lambda self, v, s: s,
        },
        "rises with tau by 10.0 .*must be < 1",
    ),
    (
        "check_derivatives",
        {"strength": lambda self, v, s, y, t: s * (0.7 + self.a * sp.Abs(sp.log(v / 1.5e-6) + y[0]))},
        r"∂\(strength\)/∂v is .* by SymPy and .* by central differences",
    ),
    (
        "check_symbols",
        {"strength": lambda self, v, s, y, t: s * (0.7 + self.a * Unheard(v / 1e-6))},
        r"strength contains Unheard\(...\), which is not offered; allowed",
    ),
    (
        "check_numbers",
        {"strength": lambda self, v, s, y, t: s * (0.7 + (0.01 if isinstance(v, float) else 0))},
        "strength called with floats is .*one expression for numbers and symbols",
    ),
    ("check_jumps", {"rates": resetting}, "Theta jumps with the normal stress.*choose a memory variable"),
    (
        "check_jumps",
        {"strength": lambda self, v, s, y, t: s * (0.7 + self.a * sp.log(v / 1e-6) + sp.sqrt(1 - s / 6e6))},
        "no finite value after a sudden change of normal stress",
    ),
    (
        "check_signs",
        {"strength": lambda self, v, s, y, t: s * (0.7 + self.a * sp.log(v / 1e-6) + sp.sqrt(1 - s / 6e6))},
        "the strength is nan Pa at v = 1.0e-9 m/s, σ = 5.0e.7 Pa",
    ),
    ("check_two_routes", {"steady_strength": lambda self, v, s: 0.7 * s}, "coefficient of s.1 .*different laws"),
    ("check_friction_round_trip", {"__post_init__": doubled}, "a rig file changes it"),
    (
        "check_renaming",
        {"strength": lambda self, v, s, y, t: s * (len(self.memory()[0]) + sp.log(v / 1e-6))},
        "has other equations as Broken.*must not depend on what",
    ),
]


@pytest.mark.parametrize(("check", "methods", "words"), FRICTION_FAULTS)
def test_broken_friction_law_is_caught(check, methods, words):
    law = broken(**methods)
    with pytest.raises(ContractViolation, match=f"(?s){words}"):
        getattr(testing, check)(law, Conditions())
    narrow = {"stress_decades": 0.05} if check == "check_jumps" else {}
    with pytest.raises(ContractViolation):
        testing.check_friction_law(law, **narrow)


def test_every_friction_check_has_a_fault_of_its_own():
    assert {check.__name__ for check in testing.FRICTION_CHECKS} == {fault[0] for fault in FRICTION_FAULTS}


def test_sound_law_passes():
    testing.check_friction_law(broken())


def test_law_must_be_registered():
    with pytest.raises(ContractViolation, match=r"is not registered; write class Ruina\(FrictionLaw, name="):
        testing.check_friction_law(Ruina(**NUMBERS))


def test_wrong_fdiff_is_caught(monkeypatch):
    """The one primitive that differentiates itself."""
    from steadyslip.core.expressions import asinh_exp

    monkeypatch.setattr(asinh_exp, "fdiff", lambda self, argindex=1: sp.Integer(1))
    law = ss.laws.RateState(a=0.0123, b=0.02, d_c=1e-6, mu_ref=0.61, v_ref=1e-6, regularised=True)
    with pytest.raises(ContractViolation, match=r"∂\(strength\)/∂v is .*check fdiff"):
        testing.check_derivatives(law, Conditions())


def test_instant_weakening_must_be_meant():
    law = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.5, v_stribeck=1e-6)
    with pytest.raises(ContractViolation, match="without mass such a rig is ill-posed"):
        testing.check_friction_law(law)
    testing.check_friction_law(law, instant_weakening=True)


def test_shared_symbols_are_caught(monkeypatch):
    """Two meanings of one letter in the Model would be one unknown."""
    from dataclasses import replace

    from steadyslip import model

    build = model.build_model

    def confused(rig, present=()):
        right = build(rig, present=present)
        return replace(right, inputs=right.inputs | {"disturbance": right.contact.friction})

    monkeypatch.setattr(model, "build_model", confused)
    with pytest.raises(ContractViolation, match="tau and disturbance share the symbol tau"):
        testing.check_symbols(broken(), Conditions())


def test_violation_is_an_assertion_and_names_the_law():
    with pytest.raises(AssertionError, match=r"Broken\(a=0.0145, b=0.016, d_c=1e-06\): ") as caught:
        testing.check_friction_law(broken(rates=lambda self, v, s, y, t: (v,)))
    assert isinstance(caught.value, ss.SteadyslipError)


# --- contacts ---------------------------------------------------------------------------------------


class Springy(ss.laws.ContactLaw):
    """A contact that stiffens with slip; the broken ones below change one thing each."""

    preload: float = ss.laws.parameter("Pa", positive, "normal stress at rest")
    gradient: float = ss.laws.parameter("Pa/m", real, "rise of normal stress with slip")

    def load(self):
        return self.preload

    def coupling(self, motion):
        return self.gradient * motion.lead


def broken_contact(**methods):
    law = type("Broken", (Springy,), methods | {"__doc__": "Wrong on purpose."}, name="broken")
    return law(preload=5e6, gradient=1e9)


def kinked(self, motion):
    return self.gradient * sp.Abs(motion.lead)


def doubled_contact(self):
    super(Springy, self).__post_init__()
    object.__setattr__(self, "gradient", 2 * self.gradient)


def with_film(**methods):
    """A state that follows velocity over a slip distance, and thins the normal stress; with one thing changed."""
    sound = {
        "memory": lambda self: ("film",),
        "rates": lambda self, motion: (1e6 * motion.velocity * (sp.log(motion.velocity / 1e-6) - motion.memory[0]),),
        "steady_memory": lambda self, velocity: (sp.log(velocity / 1e-6),),
        "coupling": lambda self, motion: -1e4 * motion.memory[0],
    }
    return sound | methods


CONTACT_FAULTS = [
    ("check_contact_names", {"steady_stress": lambda self: self.preload}, "give exactly one, None for the other"),
    ("check_contact_names", {"load": lambda self: None}, "give exactly one, None for the other"),
    ("check_contact_names", {"load": lambda self: -self.preload}, "the load is -5000000.0 Pa, must be > 0"),
    ("check_lock_up", {"lock_up": lambda self, friction: ""}, "lock_up is a method; allowed: a text; write it in the"),
    ("check_lock_up", {"lock_up": "below {mu}"}, "lock_up is 'below {mu}' .*allowed gaps: {inverse} and {angle}"),
    ("check_lock_up", {"lock_up": "below {"}, "lock_up is 'below {' .*allowed gaps"),
    (
        "check_contact_numbers",
        {"coupling": lambda self, motion: self.gradient * motion.slip},
        "normal_stress uses a former name: ContactInputs.slip is ContactInputs.lead now",
    ),
    (
        "check_contact_numbers",
        {"coupling": lambda self, motion: self.gradient * motion.displacement},
        "normal_stress uses motion.displacement, which does not exist; allowed: lead, velocity, ",
    ),
    (
        "check_contact_numbers",
        {"coupling": lambda self, motion: 1e4 if isinstance(motion.lead, float) else 0},
        "called with floats is .*one expression for numbers and symbols",
    ),
    (
        "check_contact_numbers",
        {"coupling": lambda self, motion: self.gradient * np.sin(motion.lead)},
        "normal_stress does not accept SymPy symbols",
    ),
    (
        "check_contact_numbers",
        {"coupling": lambda self, motion: self.gradient * sp.Symbol("temperature")},
        "normal_stress contains temperature; allowed",
    ),
    (
        "check_steady_stress",
        {"coupling": lambda self, motion: 2 * motion.friction},
        "no steady sliding: lock-up.*check it with numbers that have a steady state",
    ),
    (
        "check_steady_stress",
        {"normal_stress": lambda self, motion: 1.1 * self.preload + self.coupling(motion)},
        "normal_stress.. of steady sliding at 5000000.0 Pa is 5.5e.6 Pa; they must agree",
    ),
    (
        "check_steady_stress",
        {
            "load": lambda self: None,
            "steady_stress": lambda self: self.preload,
            "normal_stress": lambda self, motion: self.preload + 0.1 * motion.friction,
        },
        "the steady normal stress is 5376344.* Pa, but steady_stress.. says 5000000.0 Pa",
    ),
    ("check_linearisation", {"coupling": kinked}, r"∂σ/∂\(lead\) is 0 by differentiation.*check kinks"),
    ("check_axis", {"sliding_stiffness": lambda self, k: 2 * k}, r"sliding_stiffness\(1\) is 2.0"),
    ("check_axis", {"sliding_stiffness": lambda self, k: 0.5 * k**2}, "a projection is proportional"),
    ("check_contact_states", with_film(rates=lambda self, motion: ()), r"names 1 states and rates\(\) has 0"),
    ("check_contact_states", with_film(memory=lambda self: ("a film",)), "allowed: different names of letters"),
    ("check_contact_states", with_film(coupling=lambda self, motion: 0), "nothing depends on film; leave it out"),
    (
        "check_contact_states",
        with_film(steady_memory=lambda self, velocity: (sp.log(velocity / 2e-6),)),
        r"the rate of film is .* must vanish at steady_memory\(\)",
    ),
    (
        "check_contact_states",
        with_film(
            rates=lambda self, motion: (1e6 * motion.velocity * motion.memory[0],),
            steady_memory=lambda self, velocity: (sp.Integer(0),),
        ),
        "a state grows or stays at the rate",
    ),
    (
        "check_contact_states",
        with_film(rates=lambda self, motion: (sp.Symbol("temperature") - motion.memory[0],)),
        "rates contains temperature",
    ),
    (
        "check_contact_senses",
        {"coupling": lambda self, motion: -motion.outside},
        r"depends on the pressure around, and has_pores\(\) is False",
    ),
    (
        "check_contact_senses",
        {"is_compliant": lambda self: True},
        r"does not depend on the distance of the surfaces, and is_compliant\(\) is True",
    ),
    (
        "check_contact_senses",
        {
            "load": lambda self: 0.0,
            "is_compliant": lambda self: True,
            "coupling": lambda self, motion: -1e9 * motion.separation + 1e3 * motion.separation_rate,
        },
        r"∂σ/∂\(separation_rate\) is 1000.0 Pa s/m, must be <= 0",
    ),
    (
        "check_contact_routes",
        with_film(
            rates=lambda self, motion: (1e6 * (5e6 * sp.Abs(motion.velocity - 1e-6) - 1e-6 * motion.memory[0]),),
            steady_memory=lambda self, velocity: (sp.Integer(0),),
        ),
        "the rate of film has other slopes by differences",
    ),
    ("check_contact_round_trip", {"__post_init__": doubled_contact}, "a rig file changes it"),
    (
        "check_contact_renaming",
        with_film(steady_memory=lambda self, velocity: (float(len(self.memory()[0])),)),
        "has other equations as",
    ),
]


@pytest.mark.parametrize(("check", "methods", "words"), CONTACT_FAULTS)
def test_broken_contact_is_caught(check, methods, words):
    contact = broken_contact(**methods)
    with pytest.raises(ContractViolation, match=f"(?s){words}"):
        getattr(testing, check)(contact, Surroundings())
    with pytest.raises(ContractViolation):
        testing.check_contact_law(contact)


def test_every_contact_check_has_a_fault_of_its_own():
    assert {check.__name__ for check in testing.CONTACT_CHECKS} == {fault[0] for fault in CONTACT_FAULTS}


def test_sound_contact_passes():
    testing.check_contact_law(broken_contact())
    testing.check_contact_law(broken_contact(**with_film()))
    testing.check_contact_law(broken_contact(), Surroundings(velocity=1e-3, mass=0.0))


def test_contact_must_be_registered():
    with pytest.raises(ContractViolation, match=r"is not registered; write class Springy\(ContactLaw, name="):
        testing.check_contact_law(Springy(preload=5e6, gradient=1e9))


# --- the comparison with differences ----------------------------------------------------------------


@pytest.mark.parametrize("x", [-2.0, 0.0, 0.3, 30.0])
def test_right_derivatives_agree(x):
    from mpmath import cos, exp, mp, mpf, sin

    with mp.workdps(50):
        for function, slope in (
            (exp, exp),
            (sin, cos),
            (lambda x: x**5, lambda x: 5 * x**4),
            (lambda x: 3 * x, lambda x: 3),
        ):
            assert disagreement(function, slope(mpf(x)), mpf(x), max(abs(x), 1.0))[1] <= 0


def test_slightly_wrong_derivatives_and_kinks_do_not():
    from mpmath import exp, mp, mpf

    with mp.workdps(50):
        one = mpf(1)
        assert disagreement(exp, exp(one) * (1 + mpf("1e-14")), one, 1.0)[1] > 0
        assert disagreement(lambda x: x**2, 2 * one + mpf("1e-20"), one, 1.0)[1] > 0
        assert disagreement(abs, mpf(0), mpf(0), 1.0)[1] > 0
