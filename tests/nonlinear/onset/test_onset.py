"""Kind of onset against theory 6, against simulated motion, and along edges in two parameters."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from dimensionless import A, unit_rig
from rigs_of_theory import CONTACTS, LAWS, rig
from steadyslip.linear.boundary import boundary
from steadyslip.model.point import operating_point
from steadyslip.model.taylor import taylor

LAMBDAS = st.floats(0.05, 3.0)


def c1(a_rig):
    return ss.hopf(a_rig).coefficient


# -- theory 6, row by row; d_c = v0 = 1, so that c1 is as printed


@pytest.mark.parametrize("law", ["slip", "aging"])
@pytest.mark.parametrize("lam", [0.1, 0.5, 2.0])
def test_massless_undamped_laws_are_degenerate(law, lam):
    onset = ss.hopf(unit_rig(law, lam, 1.3 * lam))
    assert onset.kind == "degenerate"
    assert onset.coefficient == onset.coefficient_error == 0.0
    assert np.isnan(onset.velocity_amplitude(0.9 * onset.value))


@settings(max_examples=25, deadline=None)
@given(lam=LAMBDAS, share=st.floats(0.01, 0.95))
def test_radiation_damping(lam, share):
    """c1 = −H(1+λ−H)/[8(1+H)²] with the slip law, −H/[8(1+H)²] with the aging law."""
    h = share * lam
    assert c1(unit_rig("slip", lam, lam, damping=h)) == pytest.approx(-h * (1 + lam - h) / (8 * (1 + h) ** 2), rel=1e-9)
    assert c1(unit_rig("aging", lam, lam, damping=h)) == pytest.approx(-h / (8 * (1 + h) ** 2), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(lam=LAMBDAS, m=st.floats(1e-4, 3.0))
def test_mass(lam, m):
    delta = ((1 + lam) * m**2 + 2 * m + 1) * ((1 + 4 * lam) * m**2 + 2 * m + 1)
    slip = -m * lam * (1 + lam) * (1 + m) * (1 + 9 * m) / (8 * delta)
    aging = -m * lam * ((4 * lam + 7) * m**2 + 6 * m - 1) / (8 * delta)
    assert c1(unit_rig("slip", lam, lam, mass=m)) == pytest.approx(slip, rel=1e-8)
    assert c1(unit_rig("aging", lam, lam, mass=m)) == pytest.approx(aging, rel=1e-8, abs=1e-9 * m * lam)


def inclined(angle, law=None, a=0.0145, b=0.016, alpha=0.56, **more):
    memory = ss.laws.LinkerDieterich(alpha=alpha)
    rock = ss.laws.RateState(
        a=a, b=b, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, evolution=law or ss.laws.Slip(), normal_memory=memory
    )
    contact = ss.laws.InclinedSpring(preload=5e6, angle=np.radians(angle))
    numbers = {"stiffness": 9e9, "drive": ss.machine.SteadyDrive(1e-6)} | more
    return ss.Slider(friction=rock, contact=contact, **numbers)


@settings(max_examples=25, deadline=None)
@given(angle=st.floats(-50, 70).filter(lambda x: abs(x) > 0.1), alpha=st.floats(0.05, 0.65), excess=st.floats(0.02, 1))
def test_inclined_spring(angle, alpha, excess):
    a = 0.0145
    t = np.tan(np.radians(angle))
    c, g, lam = alpha * t / (1 + 0.7 * t), a * t / (1 + 0.7 * t), excess
    slip = g * lam**2 * (c**2 - 3 * c + 2 - 2 * g) / (16 * (1 - c) ** 2)
    aging = g * lam**2 * (c**2 - 2 * c - 2 * g * (1 + lam)) / (16 * (1 - c) ** 2 * (1 + lam))
    for law, expected in ((ss.laws.Slip(), slip), (ss.laws.Aging(), aging)):
        found = ss.hopf(inclined(angle, law, b=a * (1 + lam), alpha=alpha))
        assert found.coefficient == pytest.approx(expected, rel=1e-7, abs=1e-14)


def test_printed_values():
    """Theory 6 to the digits given there."""
    assert c1(unit_rig("slip", 0.5, 0.5, mass=0.05)) == pytest.approx(-0.00583826939, rel=1e-8)
    assert c1(unit_rig("aging", 0.5, 0.5, mass=0.05)) == pytest.approx(0.00173198796, rel=1e-8)
    assert c1(inclined(-45)) == pytest.approx(-4.39849e-5, rel=1e-5)
    assert [ss.hopf(inclined(angle)).kind for angle in (-30, 30)] == ["supercritical", "subcritical"]


@pytest.mark.parametrize("lam", [0.1, 0.5, 1.0])
def test_aging_with_mass_changes_kind_where_theory_says(lam):
    curve = ss.hopf_curve(unit_rig("aging", lam, 1.2 * lam, mass=0.05), "mass")
    expected = (np.sqrt(16 + 4 * lam) - 3) / (4 * lam + 7)
    (point,) = curve.special
    assert point.kind == "generalised Hopf"
    assert point.values["slider.mass"] / A == pytest.approx(expected, rel=1e-6)


# -- meaning: the amplitude that is predicted is the one that motion has


@pytest.mark.parametrize(
    "a_rig",
    [
        unit_rig("aging", 0.5, 0.4, damping=0.2),
        unit_rig("slip", 0.5, 0.4, mass=0.1),
    ],
    ids=["aging+damping", "slip+mass"],
)
def test_predicted_amplitude_is_that_of_simulated_motion(a_rig):
    """At 1 % from the edge the lowest order is right to a few per cent, and the error shrinks with distance."""
    onset = ss.hopf(a_rig)
    errors = []
    for distance in (4e-3, 1e-3):
        value = onset.value * (1 - distance)
        expected = onset.velocity_amplitude(value)
        near = a_rig.with_values({"stiffness": value})
        until = 12 / abs(onset.growth_slope * onset.value * distance)
        run = ss.simulate(near, until=until, initial={"v": np.exp(0.9 * expected)} if near.mass else {"x": -expected})
        late = [e for e in run.events if e.kind in ("velocity peak", "velocity trough")][-2:]
        found = 0.5 * abs(np.log(late[0].velocity / late[1].velocity))
        errors.append(abs(found / expected - 1))
    assert errors[0] < 0.05
    assert errors[1] < 0.6 * errors[0] + 1e-3


# -- machinery


@pytest.mark.parametrize("law", sorted(LAWS))
@pytest.mark.parametrize("mass", [0.0, 1e8])
def test_first_derivatives_are_those_of_the_linearisation(law, mass):
    """The system of all unknowns, reduced to the variables, has the Model's eigenvalues."""
    a_rig = rig(friction=LAWS[law], mass=mass)
    values = operating_point(a_rig)
    found = taylor(values)
    n = found.system.dynamic
    g = found.gradient[0]
    reduced = g[:n, :n] - g[:n, n:] @ np.linalg.solve(g[n:, n:], g[n:, :n])
    own = np.linalg.eigvals(reduced)
    expected = ss.eigenvalues(a_rig)
    expected = expected[np.isfinite(expected)]
    assert np.sort_complex(own) == pytest.approx(np.sort_complex(expected), rel=1e-7)


def test_units_do_not_matter():
    base = inclined(30, ss.laws.Aging())
    other = base.with_values(
        {"friction.d_c": 1e-2, "friction.v_ref": 1.0, "drive.velocity": 1.0, "contact.preload": 7.0}
    )
    ratio = ss.hopf(base).normalised / ss.hopf(other).normalised
    assert ratio == pytest.approx(1, rel=1e-9)


def test_no_oscillatory_edge_is_explained():
    with pytest.raises(ss.NotAvailable, match="no oscillatory edge"):
        ss.hopf(unit_rig("slip", -0.3, 0.5))


def test_onset_along_any_parameter_is_the_same_at_the_same_rig():
    """c1 depends on where the edge is, not on which parameter led there."""
    a_rig = inclined(30)
    critical = ss.hopf(a_rig)
    edge = a_rig.with_values({"stiffness": critical.value * (1 + 1e-9)})
    for name in ("friction.b", "friction.a", "contact.preload", "friction.d_c"):
        assert ss.hopf(edge, name).coefficient == pytest.approx(critical.coefficient, rel=1e-5), name


# -- edges in two parameters


@pytest.mark.parametrize("contact", CONTACTS, ids=lambda c: type(c).__name__)
def test_edge_in_two_parameters_is_the_critical_stiffness(contact):
    a_rig = rig(contact=contact, stiffness=2e10)
    if not [e for e in boundary(a_rig, "stiffness") if e.kind == "oscillatory" and e.stable != "neither"]:
        pytest.skip("no oscillatory edge in stiffness")
    b = a_rig.value("friction.b")
    curve = ss.hopf_curve(a_rig, "friction.b", between={"friction.b": (0.95 * b, 1.5 * b)})
    assert len(curve.first) > 3
    for value, stiffness in zip(curve.first, curve.second, strict=True):
        edges = [e.value for e in boundary(a_rig.with_values({"friction.b": value}), "stiffness")]
        assert min(abs(stiffness / e - 1) for e in edges) < 1e-9


@pytest.mark.parametrize("start", [-30, 30])
def test_inclined_spring_changes_kind_where_the_spring_is_level(start):
    curve = ss.hopf_curve(inclined(start), "contact.angle", between={"contact.angle": ("-45 deg", "60 deg")})
    (point,) = curve.special
    assert point.values["contact.angle"] == pytest.approx(0, abs=1e-8)
    assert curve.second == pytest.approx(ss.critical_stiffness(inclined(-30), {"contact.angle": curve.first}), rel=1e-9)
    assert curve.is_edge.all()
    assert set(curve.kind[curve.first < -1e-3]) == {"supercritical"}
    assert set(curve.kind[curve.first > 1e-3]) == {"subcritical"}
    assert "end of the range" in curve.ends[0]
    assert "generalised Hopf" in str(curve)


def test_same_parameter_twice_is_refused():
    with pytest.raises(ss.ParameterError, match="the same parameter"):
        ss.hopf_curve(inclined(30), "stiffness", "slider.stiffness")


def test_verdict_tells_the_kind_of_onset():
    text = str(ss.analyze(inclined(30, stiffness=9e9)))
    assert "subcritical" in text
    assert "does not follow from the kind of onset" in text
    data = ss.analyze(inclined(30)).to_dict()
    assert data["onset"]["kind"] == "subcritical"
    assert data["kicks"] == []


def test_a_gain_stands_in_for_the_stiffness():
    """A drive under position control has kp where others have a spring."""
    friction = ss.laws.RateState(a=0.01, b=0.016, d_c=4e-6, mu_ref=0.15, v_ref=1e-5, evolution=ss.laws.Aging())
    contact = ss.laws.ConstantNormalStress(preload=150e3)
    a_rig = ss.Slider(
        friction=friction, contact=contact, mass=2000.0, drive=ss.machine.PD(velocity=2e-5, kp=1.5e8, kd=5e5)
    )
    onset = ss.hopf(a_rig)
    assert onset.along == "drive.kp"
    assert ss.analyze(a_rig).onset == onset
