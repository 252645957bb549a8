"""A machine with one body is a slider: steady sliding, polynomial, eigenvalues, verdict."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.model.linearisation import characteristic_coefficients
from steadyslip.model.point import operating_point

V = 1e-6

FRICTIONS = {
    "slip": ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V),
    "aging, Linker-Dieterich, regularised": ss.laws.RateState(
        a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, regularised=True, evolution=ss.laws.Aging(),
        normal_memory=ss.laws.LinkerDieterich(alpha=0.3),
    ),
    "Nagata": ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, evolution=ss.laws.Nagata(c_nagata=2.0)),
    "two states": ss.laws.RateState(
        a=0.01, mu_ref=0.6, v_ref=V, states=(ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.006, d_c=2e-5))
    ),
    "LuGre": ss.laws.LuGre(
        mu_coulomb=0.5, mu_static=0.6, v_stribeck=1e-5, bristle_stiffness=1e5, bristle_damping=1.0, viscous=10.0
    ),
}  # fmt: skip

CONTACTS = {
    "constant": ss.laws.ConstantNormalStress(preload=5e6),
    "inclined": ss.laws.InclinedSpring(preload=5e6, angle=-0.3),
    "self-energising": ss.laws.SelfEnergising(preload=5e6, gain=0.2),
    "lift": ss.laws.Lift(preload=5e6, lift=1e11, v_ref=2e-6),
    "linear": ss.laws.LinearNormalStress(preload=5e6, b0=1e3, b1=1e9, b2=0.2, b3=-1e8),
}

DRIVES = {
    "pull": (ss.machine.SteadyDrive(V), ss.machine.Pull(velocity=V)),
    "pd": (ss.machine.PD(V, kp=2e8, kd=1e9), ss.machine.PositionPD(velocity=V, body="block", kp=2e8, kd=1e9)),
    "pid": (
        ss.machine.PID(V, kp=2e8, kd=1e9, ki=1e6),
        ss.machine.PositionPID(velocity=V, body="block", kp=2e8, kd=1e9, ki=1e6),
    ),
}


LATE = {
    "late pd": (
        ss.machine.PD(V, kp=2e8, kd=1e9, delay=0.3),
        ss.machine.PositionPD(velocity=V, body="block", kp=2e8, kd=1e9, delay=0.3),
    ),
    "late pid": (
        ss.machine.PID(V, kp=2e8, kd=1e9, ki=1e6, delay=0.3),
        ss.machine.PositionPID(velocity=V, body="block", kp=2e8, kd=1e9, ki=1e6, delay=0.3),
    ),
}

LATE_FRICTION = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.5, v_stribeck=V, viscous=1e4, lag=0.05)
WET = ss.laws.PoreFluid(preload=5e6, suction=2e5, drainage=0.1, slip_distance=7e-6, v_ref=V)


def pair(friction, contact, drive, idle):
    """A slider and the machine that it is the short form of; with an idle body, assembled the general way."""
    slider = ss.Slider(
        friction=friction, contact=contact, stiffness=1e9, mass=1e4, damping=1e8, radiation_damping=2e8, drive=drive[0]
    )
    bodies = {"block": ss.machine.SlidingBody(mass=1e4)} | ({"idle": ss.machine.SlidingBody()} if idle else {})
    links = {
        "spring": ss.machine.Spring(between=("drive", "block"), stiffness=1e9, damping=1e8),
        "guide": ss.machine.Spring(between=("ground", "block"), damping=2e8),
    } | ({"hook": ss.machine.Spring(between=("block", "idle"), stiffness=3e7)} if idle else {})
    contacts = {"slide": ss.machine.Surface(body="block", friction=friction, contact=contact)}
    return slider, ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=drive[1])


def varied(slider, machine, count, seed):
    """The same random numbers under the names of both."""
    random = np.random.default_rng(seed)

    def around(value):
        return value * np.exp(random.uniform(-2, 2, count))

    names = {"slider.stiffness": "links.spring.stiffness", "slider.mass": "bodies.block.mass"}
    names |= {"slider.damping": "links.spring.damping", "slider.radiation_damping": "links.guide.damping"}
    if slider.drive.name != "steady":
        names |= {f"drive.{n}": f"drive.{n}" for n in ("kp", "kd", "ki") if f"drive.{n}" in slider.parameters()}
    names |= {"drive.velocity": "drive.velocity"}
    names |= {n: f"contacts.slide.{n}" for n in slider.of_kind("slip distance") + slider.of_kind("direct effect")}
    names |= {n: f"contacts.slide.{n}" for n in slider.of_kind("normal stress")}
    both = {(one, other): around(slider.value(one)) for one, other in names.items()}
    return {a: x for (a, _), x in both.items()}, {b: x for (_, b), x in both.items()}


@pytest.mark.parametrize("idle", [False, True], ids=["alone", "idle body"])
@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_machine_with_one_body_is_a_slider(friction, contact, idle):
    """On random numbers: steady normal stress, characteristic polynomial and eigenvalues, to rounding."""
    place = list(FRICTIONS).index(friction) + list(CONTACTS).index(contact)
    drive = list(DRIVES.values())[place % 3]
    slider, machine = pair(FRICTIONS[friction], CONTACTS[contact], drive, idle)
    mine, other = varied(slider, machine, 100, place)
    one, two = operating_point(slider, mine), operating_point(machine, other)
    assert two.sigmas[0] == pytest.approx(one.sigma, rel=1e-12, nan_ok=True)
    a, b = ss.eigenvalues(slider, mine), ss.eigenvalues(machine, other)
    assert np.array_equal(np.isnan(a), np.isnan(b))
    good = ~np.isnan(a).any(axis=-1)
    assert good.sum() > 50
    first, second = np.sort_complex(a[good]), np.sort_complex(b[good])
    assert second == pytest.approx(first, rel=1e-5)  # roots that nearly meet move by the root of rounding;
    # the polynomials themselves agree to rounding
    c, d = (np.stack(np.broadcast_arrays(*p.evaluate(p.model.function(characteristic_coefficients(p.model)))), -1)
            for p in (one, two))  # fmt: skip
    ratio = d[good] / c[good]
    assert ratio == pytest.approx(ratio[:, :1] * np.ones_like(ratio), rel=1e-9)


def test_a_machine_with_one_body_has_the_verdict_of_a_slider():
    slider, machine = pair(FRICTIONS["slip"], CONTACTS["inclined"], DRIVES["pull"], False)
    one, two = ss.analyze(slider), ss.analyze(machine)
    assert (one.stable, one.growth_rate, one.period) == (two.stable, two.growth_rate, two.period)
    expected = one.stable_stiffness
    assert ss.stable_values(machine, "links.spring.stiffness") == pytest.approx(np.array(expected), rel=1e-9)
    edges = {m.parameter: m.edge.value for m in one.margins if m.edge is not None}
    found = {m.parameter: m.edge.value for m in two.margins if m.edge is not None}
    same = {"contact.preload": "contacts.slide.contact.preload", "slider.mass": "bodies.block.mass"}
    same |= {f"friction.{n}": f"contacts.slide.friction.{n}" for n in ("a", "b", "d_c")}
    for name, other in same.items():
        if name in edges:
            assert found[other] == pytest.approx(edges[name], rel=1e-8), name


def test_stable_values_of_a_slider_are_its_stable_stiffness():
    """By another route: where the polynomial is looked at, not p and q of the Model."""
    slider, _ = pair(FRICTIONS["two states"], CONTACTS["inclined"], DRIVES["pull"], False)
    assert ss.stable_values(slider, "stiffness") == pytest.approx(ss.stable_stiffness(slider), rel=1e-9)


SHORT = {
    "late pd": (FRICTIONS["slip"], CONTACTS["constant"], LATE["late pd"]),
    "late pid": (FRICTIONS["two states"], CONTACTS["inclined"], LATE["late pid"]),
    "lag": (LATE_FRICTION, CONTACTS["inclined"], DRIVES["pull"]),
    "pore fluid": (FRICTIONS["slip"], WET, DRIVES["pull"]),
    "pore fluid, pid": (FRICTIONS["aging, Linker-Dieterich, regularised"], WET, DRIVES["pid"]),
}
SHORT_KINDS = [pytest.param(kind, marks=[pytest.mark.campaign] * (kind == "late pid")) for kind in SHORT]


def short(kind):
    """With so much mass that nothing is faster than the delays by decades."""
    slider, machine = pair(*SHORT[kind], False)
    return replace(slider, mass=1e10), machine.with_values({"bodies.block.mass": 1e10})


@pytest.mark.parametrize("kind", SHORT_KINDS)
def test_a_slider_has_all_that_its_machine_has(kind):
    """Friction and controllers that are late, contacts with states of their own: random numbers under both names."""
    slider, machine = short(kind)
    mine, other = varied(slider, machine, 8, list(SHORT).index(kind))
    a, b = ss.eigenvalues(slider, mine), ss.eigenvalues(machine, other)
    assert np.array_equal(np.isnan(a), np.isnan(b))
    assert np.isfinite(a).sum() > 8
    assert np.nan_to_num(b) == pytest.approx(np.nan_to_num(a), rel=1e-6)
    assert np.array_equal(ss.stability(slider, mine), ss.stability(machine, other))
    mine.pop("slider.stiffness")
    other.pop("links.spring.stiffness")
    mine, other = ({name: values[:4] for name, values in each.items()} for each in (mine, other))
    sets = ss.stable_stiffness(slider, mine), ss.stable_values(machine, "links.spring.stiffness", other)
    count = min(one.shape[-2] for one in sets)
    assert sets[1][:, :count] == pytest.approx(sets[0][:, :count], rel=1e-7, nan_ok=True)


@pytest.mark.parametrize("kind", SHORT_KINDS)
def test_the_verdict_of_such_a_slider_is_that_of_its_machine(kind):
    slider, machine = short(kind)
    one, two = ss.analyze(slider), ss.analyze(machine)
    assert (one.stable, one.unstable_roots) == (two.stable, two.unstable_roots)
    assert one.growth_rate == pytest.approx(two.growth_rate, rel=1e-9)
    assert [delay for delay, _ in one.characteristic_terms] == [delay for delay, _ in two.characteristic_terms]
    edges = {m.parameter: m.edge.value for m in one.margins if m.edge is not None}
    found = {m.parameter: m.edge.value for m in two.margins if m.edge is not None}
    assert len(edges) > 3
    for name, edge in edges.items():
        own = {
            "slider.mass": "bodies.block.mass",
            "slider.stiffness": "links.spring.stiffness",
            "slider.damping": "links.spring.damping",
            "slider.radiation_damping": "links.guide.damping",
        }.get(name)
        own = own or (name if name.startswith("drive.") else f"contacts.slide.{name}")
        assert found[own] == pytest.approx(edge, rel=1e-7), name
    assert ss.rig_from_text(ss.rig_to_text(slider)) == slider
    assert "NaN" not in one.to_json()


def test_pore_fluid_under_a_slider_follows_in_motion():
    slider, machine = pair(FRICTIONS["slip"], WET, DRIVES["pull"], False)
    times = np.linspace(0.0, 60.0, 31)
    for a, b in ((slider, machine), (replace(slider, mass=0.0), machine.with_values({"bodies.block.mass": 0.0}))):
        one, two = (
            ss.simulate(rig, ss.protocol.VelocityStep(at=5.0, to=1.5 * V), times=times, until=60.0) for rig in (a, b)
        )
        assert one["v"] == pytest.approx(two["block.v"], rel=1e-12)
        assert one["pore_pressure"] == pytest.approx(two["slide.pore_pressure"], rel=1e-9, abs=1e-6)
        assert np.ptp(one["pore_pressure"]) > 1e4
    assert one.units["dilation"] == "Pa"


@pytest.mark.parametrize("kind", ["late pd", "lag"])
def test_what_a_delay_does_not_offer_is_said(kind):
    slider, _ = short(kind)
    for ask in (ss.state_space, ss.formula):
        with pytest.raises(ss.NotAvailable, match="delay"):
            ask(slider)


def test_stable_stiffnesses_of_late_friction_are_the_windows_of_theory():
    """Theory 10: m s² + (c + S e^(−sδ)) s + k, boundaries m β² − S β sin βδ where cos βδ = −c/S; m = δ = 1."""
    law = ss.laws.CoulombStribeck(mu_coulomb=0.1, mu_static=0.5, v_stribeck=1.0, lag=1.0)
    slope = -2.0 * 0.4 * np.exp(-1.0)  # of the curve at v = 1
    slider = ss.Slider(
        friction=law, contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=5.0, mass=1.0,
        radiation_damping=0.05,
        drive=ss.machine.SteadyDrive(1.0),
    )  # fmt: skip
    found = ss.stable_stiffness(slider)
    turns = np.arccos(-0.05 / slope)
    beta = np.sort([*(turns + 2 * np.pi * np.arange(4)), *(2 * np.pi * np.arange(1, 4) - turns)])
    expected = beta**2 - slope * beta * np.sin(beta)
    assert found.ravel()[: len(expected) - 1] == pytest.approx(expected[: len(expected) - 1], rel=1e-9)
