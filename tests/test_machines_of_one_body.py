"""A machine with one body is a slider: steady sliding, polynomial, eigenvalues, verdict."""

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.model import operating_point
from steadyslip.model.linearisation import characteristic_coefficients

V = 1e-6

FRICTIONS = {
    "slip": ss.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V),
    "aging, Linker-Dieterich, regularised": ss.RateState(
        a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, regularised=True, evolution=ss.Aging(),
        normal_memory=ss.LinkerDieterich(alpha=0.3),
    ),
    "Nagata": ss.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, evolution=ss.Nagata(c_nagata=2.0)),
    "two states": ss.RateState(
        a=0.01, mu_ref=0.6, v_ref=V, states=(ss.State(b=0.01, d_c=1e-6), ss.State(b=0.006, d_c=2e-5))
    ),
    "LuGre": ss.LuGre(
        mu_coulomb=0.5, mu_static=0.6, v_stribeck=1e-5, bristle_stiffness=1e5, bristle_damping=1.0, viscous=10.0
    ),
}  # fmt: skip

CONTACTS = {
    "constant": ss.Constant(preload=5e6),
    "inclined": ss.InclinedSpring(preload=5e6, angle=-0.3),
    "self-energising": ss.SelfEnergising(preload=5e6, gain=0.2),
    "lift": ss.Lift(preload=5e6, lift=1e11, v_ref=2e-6),
    "linear": ss.Linear(preload=5e6, b0=1e3, b1=1e9, b2=0.2, b3=-1e8),
}

DRIVES = {
    "pull": (ss.Steady(V), ss.Pull(velocity=V)),
    "pd": (ss.PD(V, kp=2e8, kd=1e9), ss.PositionPD(velocity=V, body="block", kp=2e8, kd=1e9)),
    "pid": (ss.PID(V, kp=2e8, kd=1e9, ki=1e6), ss.PositionPID(velocity=V, body="block", kp=2e8, kd=1e9, ki=1e6)),
}


def pair(friction, contact, drive, idle):
    """A slider and the machine that it is the short form of; with an idle body, assembled the general way."""
    slider = ss.Slider(
        friction=friction, contact=contact, stiffness=1e9, mass=1e4, damping=1e8, radiation_damping=2e8, drive=drive[0]
    )
    bodies = {"block": ss.SlidingBody(mass=1e4)} | ({"idle": ss.SlidingBody()} if idle else {})
    links = {
        "spring": ss.Spring(between=("drive", "block"), stiffness=1e9, damping=1e8),
        "guide": ss.Spring(between=("ground", "block"), damping=2e8),
    } | ({"hook": ss.Spring(between=("block", "idle"), stiffness=3e7)} if idle else {})
    contacts = {"slide": ss.Surface(body="block", friction=friction, contact=contact)}
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
