"""Contact laws: the public contract over all of them, the table of mechanisms of theory 3, statics by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from steadyslip.core.expressions import ArrayFunction
from steadyslip.linear.response import contact_coefficients
from steadyslip.linear.state_space import state_matrices
from steadyslip.model.point import operating_point
from steadyslip.testing import CONTACT_CHECKS, Surroundings
from steadyslip.units import deg

ROCK = ss.laws.RateState(
    a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
)
V = 1e-6
MU = 0.7  # steady friction coefficient at V, the rock's reference
CRANK = {"crank_angle": 1.1, "crank_radius": 0.1, "rod_length": 0.3}
LAYER = {"ram_stiffness": 2e10, "dilatancy": 1e-6, "v_ref": 3e-6}

CONTACTS = [
    ss.laws.ConstantNormalStress(preload=5e6),
    ss.laws.ConstantNormalStress(steady_normal_stress=5e6),
    ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=10.0),
    ss.laws.Prescribed(steady_normal_stress=5e6),
    ss.laws.LinearNormalStress(preload=5e6, b0=1e8, b1=-2e9, b2=0.3, b3=-4e8),
    ss.laws.LinearNormalStress(steady_normal_stress=5e6, b2=-0.3),
    ss.laws.InclinedSpring(preload=5e6, angle=-45 * deg),
    ss.laws.InclinedSpring(steady_normal_stress=5e6, angle=30 * deg),
    ss.laws.Transmitted(preload=5e6, transmitted=0.4, transmitted_back=0.2),
    ss.laws.SliderCrank(preload=5e6, **CRANK),
    ss.laws.SliderCrank(preload=5e6, **CRANK, stroke="push"),
    ss.laws.SliderCrank(steady_normal_stress=5e6, crank_angle=-1.1, crank_radius=0.1, rod_length=0.3),
    ss.laws.Triaxial(confining_pressure=5e6, angle=30 * deg),
    ss.laws.Triaxial(steady_normal_stress=5e6, angle=30 * deg),
    ss.laws.SelfEnergising(preload=5e6, gain=-0.4),
    ss.laws.SelfEnergising(preload=5e6, wedge_angle=70 * deg),
    ss.laws.SelfEnergising(steady_normal_stress=5e6, lead_angle=10 * deg),
    ss.laws.LeadScrew(axial_load=5e6, lead_angle=10 * deg),
    ss.laws.LeadScrew(axial_load=5e6, lead_angle=10 * deg, direction="lowering"),
    ss.laws.DilatingLayer(preload=5e6, **LAYER),
    ss.laws.DilatingLayer(steady_normal_stress=5e6, **LAYER),
    ss.laws.Lift(preload=5e6, lift=1e11, v_ref=2e-6),
    ss.laws.SlopedGuide(preload=5e6, guide_stiffness=1e9, slope=-0.1),
    ss.laws.PoreFluid(preload=5e6, suction=2e4, drainage=1.0, slip_distance=1e-6, v_ref=1e-6),
    ss.laws.Compliant(normal_stiffness=1e11, normal_damping=1e9),
]


@pytest.mark.parametrize("check", CONTACT_CHECKS)
@pytest.mark.parametrize("contact", CONTACTS, ids=repr)
def test_contract(contact, check):
    check(contact, Surroundings())


def test_contract_reaches_every_contact():
    assert {type(contact) for contact in CONTACTS} == {
        law for law in ss.laws.ContactLaw.registry.values() if law.__module__.startswith("steadyslip.")
    }


# --- the table of mechanisms ------------------------------------------------------------------------


def rig_with(contact, **slider):
    return ss.Slider(
        **({"friction": ROCK, "contact": contact, "stiffness": 9e9, "drive": ss.machine.SteadyDrive(V)} | slider)
    )


def coefficients(rig):
    """B0...B3, derived from the nonlinear normal stress."""
    values = operating_point(rig)
    sigma = ss.steady_state(rig).normal_stress
    function = ArrayFunction([*values.model.arguments], contact_coefficients(values.model))
    return [float(b) for b in function(*values.arguments, sigma)]


def sin_of_rod(crank):
    return CRANK["crank_radius"] / CRANK["rod_length"] * math.sin(crank)


def mechanisms(angle, gain, size):
    """Contact and, as a function of m, c, η, its B0, B1, B2, B3."""
    tan = math.tan(angle)
    rod = math.tan(math.asin(sin_of_rod(CRANK["crank_angle"])))
    layer = {"ram_stiffness": 1e11 * size, "dilatancy": 1e-6, "v_ref": V}
    yield ss.laws.ConstantNormalStress(preload=5e6), lambda m, c, eta: (0, 0, 0, 0)
    yield ss.laws.Prescribed(preload=5e6), lambda m, c, eta: (0, 0, 0, 0)
    yield (
        ss.laws.LinearNormalStress(preload=5e6, b0=size, b1=-2.0, b2=gain, b3=4.0),
        lambda m, c, eta: (size, -2.0, gain, 4.0),
    )
    yield ss.laws.InclinedSpring(preload=5e6, angle=angle), lambda m, c, eta: (0, c * tan, tan, 0)
    yield ss.laws.SliderCrank(preload=5e6, **CRANK), lambda m, c, eta: (0, c * rod, rod, 0)
    yield ss.laws.SliderCrank(preload=5e6, **CRANK, stroke="push"), lambda m, c, eta: (0, -c * rod, -rod, 0)
    thrust = math.tan(abs(angle) + 0.01)
    yield (
        ss.laws.Triaxial(confining_pressure=5e6, angle=abs(angle) + 0.01),
        lambda m, c, eta: (0, -c * thrust, -thrust, 0),
    )
    yield ss.laws.SelfEnergising(preload=5e6, gain=gain), lambda m, c, eta: (-gain * m, -gain * (c + eta), -gain, 0)
    yield ss.laws.SelfEnergising(preload=5e6, lead_angle=angle), lambda m, c, eta: (-tan * m, -tan * (c + eta), -tan, 0)
    cot = 1 / math.tan(1.2)
    yield ss.laws.SelfEnergising(preload=5e6, wedge_angle=1.2), lambda m, c, eta: (-cot * m, -cot * (c + eta), -cot, 0)
    for sign, direction in ((1, "raising"), (-1, "lowering")):
        lead = sign * math.tan(0.3)
        yield (
            ss.laws.LeadScrew(axial_load=5e6, lead_angle=0.3, direction=direction),
            lambda m, c, eta, lead=lead: (-lead * m, -lead * (c + eta), -lead, 0),
        )
    yield ss.laws.DilatingLayer(preload=5e6, **layer), lambda m, c, eta: (0, 1e5 * size / V, 0, 0)
    yield ss.laws.Lift(preload=5e6, lift=1e10 * size, v_ref=V), lambda m, c, eta: (0, -1e10 * size, 0, 0)
    yield (
        ss.laws.SlopedGuide(preload=5e6, guide_stiffness=1e9 * size, slope=angle),
        lambda m, c, eta: (0, 0, 0, 1e9 * size * tan),
    )


@settings(max_examples=10, deadline=None)
@given(
    angle=st.floats(-0.8, 0.8),
    gain=st.floats(-2, 1.2),
    size=st.floats(0.1, 10),
    m=st.sampled_from([0.0, 3e9]),
    c=st.sampled_from([0.0, 2e9]),
    eta=st.sampled_from([0.0, 1e9]),
)
def test_table_of_mechanisms(angle, gain, size, m, c, eta):
    for contact, expected in mechanisms(angle, gain, size):
        rig = rig_with(contact, mass=m, damping=c, radiation_damping=eta)
        found = coefficients(rig)
        np.testing.assert_allclose(found, expected(m, c, eta), rtol=1e-13, atol=0, err_msg=repr(contact))


def test_controller_counts_as_spring_and_dashpot():
    """B1 and K of an inclined spring under PD control: k + Kp and c + Kd pull at the angle."""
    rig = rig_with(ss.laws.InclinedSpring(preload=5e6, angle=0.5), damping=2e9, drive=ss.machine.PD(V, kp=3e9, kd=4e9))
    np.testing.assert_allclose(coefficients(rig), [0, 6e9 * math.tan(0.5), math.tan(0.5), 0], rtol=1e-13, atol=1e-3)


def test_disturbance_reaches_the_normal_stress_of_a_self_energising_contact():
    """B4 = γq at the instant of the disturbance, while velocity and memory stand still (with mass)."""
    rig = rig_with(ss.laws.SelfEnergising(preload=5e6, gain=0.4), mass=1e9)
    D = state_matrices(rig, ("normal_stress", "shear_stress")).d
    by_disturbance = D[:, 1]
    # the balance fixes v̇, τ = strength(σ): σ̂ = γτ̂ and τ̂ = f1 σ̂ leave nothing but zero
    np.testing.assert_allclose(by_disturbance, 0, atol=1e-12)
    slow = rig_with(ss.laws.SelfEnergising(preload=5e6, gain=0.4))
    D = state_matrices(slow, ("normal_stress", "shear_stress")).d
    np.testing.assert_allclose(D[0, 1] / D[1, 1], 0.4, rtol=1e-12)  # σ̂ = γ τ̂ with τ̂ = q without mass
    np.testing.assert_allclose(D[1, 1], 1.0, rtol=1e-12)


# --- steady state and closed forms ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("contact", "expected"),
    [
        (ss.laws.ConstantNormalStress(preload=5e6), 5e6),
        (ss.laws.InclinedSpring(preload=5e6, angle=-0.6), (5e6 + 2e3 * math.tan(0.6)) / (1 - MU * math.tan(0.6))),
        (ss.laws.Triaxial(confining_pressure=5e6, angle=0.6), (5e6 + 2e3 * math.tan(0.6)) / (1 - MU * math.tan(0.6))),
        (ss.laws.SelfEnergising(preload=5e6, gain=0.5), 5e6 / (1 - 0.5 * MU)),
        (ss.laws.SelfEnergising(preload=5e6, gain=-0.5), 5e6 / (1 + 0.5 * MU)),
        (ss.laws.DilatingLayer(preload=5e6, **LAYER), 5e6 + 2e10 * 1e-6 * math.log(V / 3e-6)),
        (ss.laws.Lift(preload=5e6, lift=1e11, v_ref=3e-6), 5e6 + 2e5),
        (ss.laws.SlopedGuide(preload=5e6, guide_stiffness=1e9, slope=0.3), 5e6),
        (ss.laws.LinearNormalStress(preload=5e6, b1=1e9, b2=0.3), 5e6),
    ],
)
def test_steady_normal_stress(contact, expected):
    """σss of theory 1 and 3; the damping to the ground, ηv0 = 2 kPa, is carried by the spring only."""
    rig = rig_with(contact, radiation_damping=2e9)
    state = ss.steady_state(rig)
    np.testing.assert_allclose(state.normal_stress, expected, rtol=1e-14)
    np.testing.assert_allclose(state.shear_stress, MU * expected, rtol=1e-14)
    np.testing.assert_allclose(state.spring_stress, MU * expected + 2e3, rtol=1e-14)


@pytest.mark.parametrize("v", [1e-6, 5e-6])
def test_critical_stiffness_of_a_dilating_layer(v):
    """k_cr = [σ(b − a) − μss k_n e]/d_c, with σ and μss those of steady sliding at v."""
    layer = ss.laws.DilatingLayer(preload=5e6, ram_stiffness=5e9, dilatancy=1e-6, v_ref=1e-6)
    rig = rig_with(layer, drive=ss.machine.SteadyDrive(v))
    sigma, mu = 5e6 + 5e3 * math.log(v / 1e-6), 0.7 - 0.0015 * math.log(v / 1e-6)
    np.testing.assert_allclose(ss.critical_stiffness(rig), (sigma * 0.0015 - mu * 5e3) / 1e-6, rtol=1e-12)


@pytest.mark.parametrize(("psi", "kappa"), [(-45, 0.00174418604651), (-30, 0.00163190533807), (30, 0.00138782355738)])
def test_inclined_spring_of_the_paper(psi, kappa):
    rock = replace(ROCK, normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    rig = rig_with(ss.laws.InclinedSpring(preload=5e6, angle=psi * deg), friction=rock)
    sigma = 5e6 / (1 + 0.7 * math.tan(psi * deg))
    np.testing.assert_allclose(ss.critical_stiffness(rig) * 1e-6 / sigma, kappa, rtol=5e-12)  # twelve digits are given


@pytest.mark.parametrize(
    "contact",
    [
        c
        for c in CONTACTS
        if hasattr(c, "steady_normal_stress")
        and (getattr(c, "preload", None) or getattr(c, "confining_pressure", None))
    ],
    ids=repr,
)
def test_preload_and_steady_normal_stress_say_the_same(contact):
    """A contact given by the σss that its load leads to has the same roots and stable stiffnesses."""
    place = {"mass": 1e9, "damping": 2e9, "radiation_damping": 3e9}
    rig = rig_with(contact, **place)
    sigma = ss.steady_state(rig).normal_stress
    load = "confining_pressure" if isinstance(contact, ss.laws.Triaxial) else "preload"
    same = rig_with(replace(contact, **{load: None, "steady_normal_stress": sigma}), **place)
    assert ss.steady_state(same).normal_stress == sigma
    np.testing.assert_allclose(ss.eigenvalues(same), ss.eigenvalues(rig), rtol=1e-10)
    np.testing.assert_allclose(ss.stable_stiffness(same), ss.stable_stiffness(rig), rtol=1e-10)


# --- geometry ---------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(angle=st.floats(-1.4, 1.4), axial=st.floats(1e6, 1e12))
def test_axial_stiffness_of_an_inclined_spring(angle, axial):
    """By geometry: the force along the axis for a small slip, and its component along the slide."""
    contact = ss.laws.InclinedSpring(steady_normal_stress=5e6, angle=angle)
    length, slip = 1.0, 1e-4
    foot = np.array([length * math.cos(angle), length * math.sin(angle)])  # load point seen from the block
    shortening = [np.linalg.norm(foot - [x, 0]) - length for x in (slip, -slip)]
    force = axial * (shortening[1] - shortening[0]) / 2
    # central difference: third order in slip/length
    np.testing.assert_allclose(float(contact.sliding_stiffness(axial)), force * math.cos(angle) / slip, rtol=1e-7)
    same = rig_with(contact, stiffness=None, axial_stiffness=axial)
    direct = rig_with(contact, stiffness=axial * math.cos(angle) ** 2)
    np.testing.assert_allclose(ss.eigenvalues(same), ss.eigenvalues(direct), rtol=1e-9)


def test_axial_stiffness_of_a_triaxial_press():
    """Slip δ on the cut shortens the sample by δ cos θ; Q = K δ cos θ has the shear component Q sin θ cos θ."""
    theta, axial = 0.6, 3e10
    contact = ss.laws.Triaxial(confining_pressure=5e6, angle=theta)
    by_hand = axial * math.cos(theta) * math.sin(theta) * math.cos(theta)
    np.testing.assert_allclose(float(contact.sliding_stiffness(axial)), by_hand, rtol=1e-14)
    same = rig_with(contact, stiffness=None, axial_stiffness=axial)
    np.testing.assert_allclose(ss.eigenvalues(same), ss.eigenvalues(rig_with(contact, stiffness=by_hand)), rtol=1e-12)


def test_contact_without_axis_refuses_an_axial_stiffness():
    with pytest.raises(ss.ParameterError, match="no axis at an angle; give stiffness instead"):
        rig_with(ss.laws.ConstantNormalStress(preload=5e6), stiffness=None, axial_stiffness=1e9)
    with pytest.raises(ss.NotAvailable, match="'lift' has no axis"):
        ss.laws.Lift(preload=5e6, lift=0.0, v_ref=V).sliding_stiffness(1.0)


def same_rig(one, other):
    np.testing.assert_allclose(ss.steady_state(one).normal_stress, ss.steady_state(other).normal_stress, rtol=1e-13)
    np.testing.assert_allclose(ss.eigenvalues(one), ss.eigenvalues(other), rtol=1e-11)
    np.testing.assert_allclose(ss.stable_stiffness(one), ss.stable_stiffness(other), rtol=1e-12)


@pytest.mark.parametrize("stroke", ["pull", "push"])
@settings(max_examples=10, deadline=None)
@given(crank=st.floats(-math.pi, math.pi))
def test_slider_crank_is_an_inclined_spring_of_the_same_angle(stroke, crank):
    """The rod from the slider to the crank pin, drawn: rising towards the crank it lifts a slider it pulls."""
    pin = CRANK["crank_radius"] * np.array([math.cos(crank), math.sin(crank)])
    slider = pin[0] + math.sqrt(CRANK["rod_length"] ** 2 - pin[1] ** 2)  # on the line through the crank's centre
    rod = math.atan2(pin[1], slider - pin[0])
    psi = rod if stroke == "pull" else -rod
    mechanism = ss.laws.SliderCrank(preload=5e6, **(CRANK | {"crank_angle": crank}), stroke=stroke)
    place = {"stiffness": None, "axial_stiffness": 9e9, "damping": 1e9, "mass": 1e9}
    same_rig(rig_with(mechanism, **place), rig_with(ss.laws.InclinedSpring(preload=5e6, angle=psi), **place))


def test_triaxial_press_is_an_inclined_spring_pressing_in():
    place = {"damping": 1e9, "mass": 1e9, "radiation_damping": 1e9}
    press = ss.laws.Triaxial(confining_pressure=5e6, angle=0.5)
    same_rig(rig_with(press, **place), rig_with(ss.laws.InclinedSpring(preload=5e6, angle=-0.5), **place))


@pytest.mark.parametrize(("direction", "sign"), [("raising", 1), ("lowering", -1)])
@settings(max_examples=20, deadline=None)
@given(lead=st.floats(0.01, 0.8), mu=st.floats(0.02, 0.9))
def test_lead_screw_statics(direction, sign, lead, mu):
    """A body on a plane inclined at the lead angle, pushed up or down by a horizontal force P.

    Vertical balance: σ cos β ∓ τ sin β = W. The classic result P = W tan(β ± φ), tan φ = μ, follows.
    """
    rock = replace(ROCK, mu_ref=mu)
    state = ss.steady_state(
        rig_with(ss.laws.LeadScrew(axial_load=3e6, lead_angle=lead, direction=direction), friction=rock)
    )
    normal, shear = state.normal_stress, state.shear_stress
    vertical = normal * math.cos(lead) - sign * shear * math.sin(lead)
    horizontal = normal * math.sin(lead) + sign * shear * math.cos(lead)
    np.testing.assert_allclose(vertical, 3e6, rtol=1e-13)
    np.testing.assert_allclose(horizontal, 3e6 * math.tan(lead + sign * math.atan(mu)), rtol=1e-9, atol=1e-6)


def test_lead_screw_is_a_self_energising_contact():
    """σ0 = W/cos β and γ = tan β (theory 3)."""
    place = {"mass": 1e9, "damping": 2e9, "radiation_damping": 3e9}
    screw = ss.laws.LeadScrew(axial_load=3e6, lead_angle=0.2)
    wedge = ss.laws.SelfEnergising(preload=3e6 / math.cos(0.2), lead_angle=0.2)
    same_rig(rig_with(screw, **place), rig_with(wedge, **place))
    lowering = ss.laws.LeadScrew(axial_load=3e6, lead_angle=0.2, direction="lowering")
    released = ss.laws.SelfEnergising(preload=3e6 / math.cos(0.2), gain=-math.tan(0.2))
    same_rig(rig_with(lowering, **place), rig_with(released, **place))


def test_wedge_statics():
    """A wedge under a frictionless roof: the roof's force R is normal to it, R sin = τ and R cos adds to σ."""
    angle = 1.2
    state = ss.steady_state(rig_with(ss.laws.SelfEnergising(preload=5e6, wedge_angle=angle)))
    roof = state.shear_stress / math.sin(angle)
    np.testing.assert_allclose(state.normal_stress, 5e6 + roof * math.cos(angle), rtol=1e-14)


# --- no steady sliding ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("contact", "gain", "words"),
    [
        (
            ss.laws.InclinedSpring(preload=5e6, angle=-60 * deg),
            MU * math.tan(60 * deg),
            "above −arccot μss = -55.01 deg",
        ),
        (
            ss.laws.Triaxial(confining_pressure=5e6, angle=60 * deg),
            MU * math.tan(60 * deg),
            "below arccot μss = 55.01 deg",
        ),
        (ss.laws.SelfEnergising(preload=5e6, gain=1.5), MU * 1.5, "gain must be below 1/μss = 1.429"),
        (
            ss.laws.LeadScrew(axial_load=5e6, lead_angle=60 * deg),
            MU * math.tan(60 * deg),
            "below arccot μss = 55.01 deg",
        ),
        (
            ss.laws.SliderCrank(preload=5e6, crank_angle=90 * deg, crank_radius=0.29, rod_length=0.3, stroke="push"),
            MU * 0.29 / math.sqrt(0.3**2 - 0.29**2),
            "inclination must be below 1/μss = 1.429",
        ),
    ],
    ids=repr,
)
def test_lock_up(contact, gain, words):
    rig = rig_with(contact)
    with pytest.raises(ss.NoSteadySliding, match="lock-up") as caught:
        ss.steady_state(rig)
    assert caught.value.condition == "lock-up"
    np.testing.assert_allclose(caught.value.shortfall, 1 - gain, rtol=1e-12)
    assert words in str(caught.value)
    assert np.isnan(ss.critical_stiffness(rig))
    assert np.isnan(ss.eigenvalues(rig)).all()


@pytest.mark.parametrize("contact", [c for c in CONTACTS if c.steady_stress() is not None], ids=repr)
def test_lock_up_is_not_hidden_by_a_given_steady_normal_stress(contact):
    """Past lock-up no positive load leads to that σss, although the contact could be written down."""
    for name, beyond in (("angle", 80 * deg), ("gain", 1.5), ("lead_angle", 80 * deg)):
        if getattr(contact, name, None) is not None:
            sign = -1 if isinstance(contact, ss.laws.InclinedSpring) else 1
            with pytest.raises(ss.NoSteadySliding, match="lock-up"):
                ss.steady_state(rig_with(replace(contact, **{name: sign * beyond})))


@pytest.mark.parametrize(
    ("contact", "remaining"),
    [
        (ss.laws.Lift(preload=5e6, lift=1e13, v_ref=1e-7), 5e6 - 9e6),
        (
            ss.laws.DilatingLayer(preload=5e6, ram_stiffness=1e13, dilatancy=-1e-6, v_ref=1e-7),
            5e6 - 1e7 * math.log(10),
        ),
    ],
    ids=repr,
)
def test_lift_off(contact, remaining):
    with pytest.raises(ss.NoSteadySliding, match="lift-off") as caught:
        ss.steady_state(rig_with(contact))
    assert caught.value.condition == "lift-off"
    np.testing.assert_allclose(caught.value.shortfall, remaining, rtol=1e-9)
    assert "must be > 0" in str(caught.value)


@pytest.mark.parametrize(
    ("law", "arguments", "name", "words"),
    [
        (ss.laws.ConstantNormalStress, {}, "preload", "give preload or steady_normal_stress"),
        (
            ss.laws.ConstantNormalStress,
            {"preload": 5e6, "steady_normal_stress": 5e6},
            "steady_normal_stress",
            "give one of the two",
        ),
        (ss.laws.ConstantNormalStress, {"preload": 0.0}, "preload", "> 0"),
        (ss.laws.Triaxial, {"angle": 0.5}, "confining_pressure", "exactly one"),
        (ss.laws.Prescribed, {"preload": 1e6, "amplitude": 1e5}, "period", "missing"),
        (ss.laws.Prescribed, {"preload": 1e6, "amplitude": 1e6, "period": 1.0}, "amplitude", "less than the mean"),
        (ss.laws.SelfEnergising, {"preload": 1e6}, "gain", "exactly one of"),
        (ss.laws.SelfEnergising, {"preload": 1e6, "gain": 1.0, "lead_angle": 0.1}, "gain", "exactly one of"),
        (ss.laws.SliderCrank, {"preload": 1e6, **CRANK, "rod_length": 0.1}, "rod_length", "more than crank_radius"),
        (ss.laws.InclinedSpring, {"preload": 1e6, "angle": math.pi / 2}, "angle", "between -90 deg and 90 deg"),
        (ss.laws.LeadScrew, {"axial_load": 1e6, "lead_angle": -0.1}, "lead_angle", "between 0 and 90 deg"),
        (
            ss.laws.LeadScrew,
            {"axial_load": 1e6, "lead_angle": 0.1, "direction": "up"},
            "direction",
            "raising, lowering",
        ),
        (ss.laws.Lift, {"preload": 1e6, "lift": -1.0, "v_ref": V}, "lift", ">= 0"),
    ],
)
def test_refused(law, arguments, name, words):
    with pytest.raises(ss.ParameterError) as caught:
        law(**arguments)
    assert [p.name for p in caught.value.problems] == [name]
    assert words in str(caught.value)


def test_prescribed_normal_stress_oscillates_about_its_mean():
    contact = ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=8.0)
    samples = [float(contact.imposed(t)) for t in np.arange(0, 8.0, 0.5)]
    np.testing.assert_allclose(samples, 1e5 * np.cos(np.arange(16) * np.pi / 8), atol=1e-9)
    np.testing.assert_allclose(np.mean(samples), 0, atol=1e-9)
