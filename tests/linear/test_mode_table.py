"""Why a mode grows, which modes meet, and slopes of eigenvalues: laws, closed forms, and equations typed by hand."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eig

import steadyslip as ss
from command import run
from machines import (
    ACROSS,
    ALONG,
    at_random,
    block,
    brake,
    coulomb,
    rate_state,
    stacked_pads,
    three_bodies,
    two_mass,
)
from steadyslip.linear.mode_changes import Perturbation
from steadyslip.linear.mode_origin import feeds_of
from steadyslip.model.numeric.machine_point import machine_point
from steadyslip.verdict.whole_text import facts
from structures_at_random import by_hand, random_structure, reed

HELD = 1e-6  # share of its stiffness by which the shoe of a brake is held besides
EXAMPLES = ("brake-pad", "feed-axis", "geared-servo", "telescope", "two-guides", "two-surfaces")


def everything():
    """Machines of all kinds of links, laws and drives, and structures."""
    yield from (three_bodies(), stacked_pads(3), reed(), two_mass(kp=2.0), brake(rate_state(0.02, -0.01, 0.5)))
    yield from (ss.read_rig(f"examples/machines/{name}.toml") for name in EXAMPLES)
    yield from (at_random(seed)[0] for seed in range(12))
    yield from (random_structure(np.random.default_rng(seed), 20, 2)[0] for seed in range(3))


def test_work_of_all_forces_is_the_growth_rate():
    """Of every mode: 2 Re λ E = Σ work, to rounding of the largest."""
    for machine in everything():
        point = machine_point(machine)
        for s in point.pencil.eigenvalues[:6]:
            if s.imag > 0:
                feeds = feeds_of(point, complex(s))
                assert abs(sum(feeds.values()) - s.real) < 1e-9 * abs(s), (machine, s, feeds)


def test_dampers_take_and_falling_friction_feeds():
    found = ss.modes(two_mass(kp=2.0))
    feeds = found.origin.feeds
    assert feeds["contacts.guide by velocity"] > 0 > feeds["links.screw"]
    assert found.origin.words == "mode 1 at 0.08103 Hz grows: friction at guide falls with velocity and feeds it"
    still = two_mass(kp=2.0, friction=coulomb(0.5)).with_values({"links.screw.damping": 0.0, "drive.kd": 0.0})
    assert np.abs(list(feeds_of(machine_point(still), 1j * ss.modes(still)[0].eigenvalue.imag).values())).max() < 1e-12


# --- modes that meet: Hoffmann & Gaul, Hultén


@pytest.mark.parametrize(
    ("machine", "friction", "kind"),
    [
        (block(), 1.1, "coupling"),
        (block(ALONG.format(0.05)), 1.2, "coupling"),
        (block(ALONG.format(0.05)), 0.9, "early"),  # grows above .866
        (block(contact=0.05), 0.5, "early"),  # above .411
        (block(ACROSS.format(0.05)), 0.9, "early"),
        (block(ACROSS.format(0.05), ALONG.format(0.05)), 1.04, "coupling"),  # above 1.033
    ],
)
def test_modes_of_hoffmann_and_gaul_meet(machine, friction, kind):
    """Damping moves the edge (theory 13), but not where the two would meet: 1.0284051669940213, at √3 rad/s."""
    origin = ss.modes(machine.with_values({"mu_coulomb": friction})).origin
    assert (origin.kind, origin.name, origin.modes) == (kind, "belt", (1, 2))
    assert origin.friction == pytest.approx(1.0284051669940213, rel=1e-10)
    if kind == "coupling":
        assert origin.frequency == pytest.approx(np.sqrt(3) / (2 * np.pi), rel=1e-6)
    assert "modes 1 and 2" in origin.words
    assert "1.03" in origin.words


def hulten(friction, damping=(0.02, 0.02), others=()):
    """A drum brake's shoe, 1 kg, that two surfaces rub across each other: a machine, and its C and K by hand.

    Hultén 1993, with 100 and 75 Hz and dampings η ω of Sinou & Jézéquel 2007; `others` (Hz) do not couple.
    """
    omega = 2 * np.pi * np.array([100.0, 75.0, *others])
    size = len(omega)
    damp, held = np.diag(omega * np.array([*damping, *(1e-3 for _ in others)])), np.diag(omega**2)
    held[:2, :2] *= HELD  # the surfaces hold it
    turned = np.eye(size)
    turned[:2, :2] = np.sqrt(0.5) * np.array([[1, 1], [-1, 1]])  # the structure's x lies between the two normals
    own = ss.machine.StructureData(np.eye(size), turned.T @ damp @ turned, turned.T @ held @ turned, 0 * held)
    points = {
        name: ss.machine.StructurePoint(x=1, y=2, angle=a)
        for name, a in zip("ab", (-np.pi / 4, np.pi / 4), strict=True)
    }
    contacts = {
        name: ss.machine.Surface(
            body="drive", against=f"shoe.{name}", friction=coulomb(friction),
            contact=ss.laws.Compliant(normal_stiffness=stiffness, steady_normal_stress=10.0),
        )
        for name, stiffness in zip("ab", omega[:2] ** 2, strict=True)
    }  # fmt: skip
    shoe = ss.machine.StructureBody(matrices=own, points=points)
    machine = ss.Machine(bodies={"shoe": shoe}, contacts=contacts, drive=ss.machine.Pull(velocity=1.0))
    held[:2, :2] += [[omega[0] ** 2, friction * omega[1] ** 2], [-friction * omega[0] ** 2, omega[1] ** 2]]
    return machine, damp, held


def test_modes_of_a_drum_brake_meet():
    """μ_c = (ω1² − ω2²)/(2 ω1 ω2) = 7/24, at the mean of the squares; eigenvalues as SciPy has them."""
    for damping, friction in (((0.02, 0.02), 0.3), ((0.02, 0.06), 0.35)):
        machine, damp, stiffness = hulten(friction, damping=damping)
        size = len(damp)
        state = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damp]])
        expected = np.sort_complex(eig(state, right=False))
        np.testing.assert_allclose(np.sort_complex(ss.eigenvalues(machine)), expected, rtol=1e-10)
        origin = ss.modes(machine).origin
        assert (origin.kind, origin.modes) == ("coupling", (1, 2))
        assert origin.friction == pytest.approx(7 / 24 * (1 + HELD), rel=1e-10)
        assert origin.frequency == pytest.approx(np.hypot(100, 75) * np.sqrt((1 + HELD) / 2), rel=1e-10)


def test_modes_are_numbered_among_all():
    """Two modes below and one above the pair that couples."""
    found = ss.modes(hulten(0.35, others=(20.0, 50.0, 300.0))[0])
    assert found.origin.modes == (3, 4)
    assert [one.number for one in sorted(found, key=lambda one: one.frequency)] == [1, 2, 3, 4, 5]
    assert found.chosen.number in (3, 4)
    assert sum(found.chosen.kinetic.values()) + sum(found.chosen.elastic.values()) == pytest.approx(1.0)


# --- slopes


def test_slopes_are_differences_of_eigenvalues():
    """Central differences of the eigenvalues themselves, for every parameter that is not zero."""
    for machine in everything():
        point = machine_point(machine)
        s = complex(point.pencil.eigenvalues[0])
        slopes = Perturbation(point, s)
        for name, one in list(machine.parameters().items())[:30]:
            if not one.value:
                continue
            slope, h = slopes.by_parameter(name, float(one.value)), 1e-4 * float(one.value)
            if not np.isfinite(slope):
                continue
            ends = []
            for value in (float(one.value) - h, float(one.value) + h):
                roots = point.varied(name, value).pencil.eigenvalues
                ends.append(roots[np.argmin(np.abs(roots - s))])
            assert abs(slope * one.value - (ends[1] - ends[0]) / 2e-4) < 1e-5 * abs(s), (name, slope)


def check_by_hand(seed, size):
    """Slopes of the rightmost root with what is added at a point, and with stiffness and level of the first contact.

    By left and right eigenvectors of SciPy, and by differences of the equations typed by hand.
    """
    machine, numbers = random_structure(np.random.default_rng(seed), size, int(seed % 3) + 1)
    mass, damping, stiffness, speed, contacts = numbers
    point = machine_point(machine)
    s = complex(point.pencil.eigenvalues[0])
    found = Perturbation(point, s)
    e, a = by_hand(*numbers)
    roots, left, right = eig(a, e, left=True)
    at = np.argmin(np.abs(roots - s))
    u, v = left[:, at].conj(), right[:, at]

    def by_differences(matrices):
        """Slope with a share of which `matrices` makes equations."""
        (e1, a1), (e0, a0) = (by_hand(*matrices(h)) for h in (1e-4, -1e-4))
        return u @ ((a1 - a0) - s * (e1 - e0)) @ v / (u @ e @ v) / 2e-4

    x, y, angle = contacts[0][:3]
    row = np.zeros(size)
    row[x], row[y] = np.cos(angle), np.sin(angle)
    own = [stiffness, damping, mass]
    for power, unit in enumerate(np.abs(one).max() for one in own):

        def added(h, power=power, unit=unit):
            k, c, m = (one + h * unit * np.outer(row, row) * (i == power) for i, one in enumerate(own))
            return m, c, k, speed, contacts

        assert found.by_addition(row, power) * unit == pytest.approx(by_differences(added), rel=1e-6, abs=1e-9 * abs(s))
    for place, name in ((9, "contact.normal_stiffness"), (6, "friction.mu_ref")):

        def changed(h, place=place):
            first = [one * (1 + h) if i == place else one for i, one in enumerate(contacts[0])]
            return mass, damping, stiffness, speed, [tuple(first), *contacts[1:]]

        value = float(machine.value(f"contacts.c0.{name}"))
        slope = found.by_parameter(f"contacts.c0.{name}", value) * value
        assert slope == pytest.approx(by_differences(changed), rel=1e-6, abs=1e-9 * abs(s))


@pytest.mark.parametrize("seed", range(6))
def test_slopes_of_structures_typed_by_hand(seed):
    check_by_hand(seed, 20)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(6, 60))
def test_slopes_of_many_structures_typed_by_hand(seed):
    check_by_hand(seed, 20 + seed % 21)


def test_slopes_move_the_edge():
    """dμ/dc of an edge is −Re(∂λ/∂c)/Re(∂λ/∂μ); by differences of edges that were computed on their own."""
    machine = block(ALONG.format(0.05), contact=0.05)
    (edge,) = ss.boundary(machine, "mu_coulomb")
    at = {one.name: one for one in ss.modes(machine.with_values({"mu_coulomb": edge.value})).changes if not one.added}
    by_friction = at["contacts.belt.friction.mu_coulomb"].slope.real
    for name in ("links.along.damping", "links.one.stiffness", "contacts.belt.contact.normal_stiffness"):
        value = float(machine.value(name))
        ends = [
            ss.boundary(machine.with_values({name: value * f}), "mu_coulomb")[0].value for f in (1 - 1e-3, 1 + 1e-3)
        ]
        expected = (ends[1] - ends[0]) / (2e-3 * value)
        assert -at[name].slope.real / by_friction == pytest.approx(expected, rel=1e-5)


# --- results, verdict, command


def test_the_verdict_says_which_modes_meet():
    found = ss.analyze(ss.read_rig("examples/machines/brake-pad.toml"))
    assert dict(facts(found))["why it grows"] == found.origin.words
    assert found.origin.words.startswith("modes 1 and 2 meet at 746.5 Hz where friction at disc exceeds 0.417")
    told = found.to_dict()["why_it_grows"]
    assert (told["modes"], told["words"]) == ([1, 2], found.origin.words)
    assert sum(told["feeds"].values()) == pytest.approx(found.growth_rate)
    assert any(one.what == "why it grows" and one.passed for one in found.checks)
    assert ss.modes(two_mass(kp=5.0)).origin is None
    assert ss.modes(reed()).origin.kind == "normal force"


def test_machines_with_a_delay_have_modes_without_slopes():
    late = two_mass(kp=2.0).with_values({"drive.delay": 0.1})
    found = ss.modes(late)
    assert len(found) > 1
    assert (found.origin, found.changes) == (None, ())


def test_what_is_refused():
    with pytest.raises(ss.NotAvailable, match="a slider is one body"):
        ss.modes(ss.read_rig("examples/stick-slip.toml"))
    with pytest.raises(ss.ParameterError, match="allowed: 1 to 2"):
        ss.modes(two_mass(), 3)


def test_the_command_tells_modes(tmp_path):
    rig = "examples/machines/brake-pad.toml"
    told = json.loads(run("modes", rig, "--mode", "2", "--json").stdout)
    assert told["modes"][told["chosen"]]["number"] == 2
    assert told["why_it_grows"] is None
    names = [tmp_path / f"modes.{ending}" for ending in ("csv", "html", "svg")]
    done = run("modes", rig, *(word for name in names for word in ("-o", name)))
    assert "modes 1 and 2 meet at 746.5 Hz" in done.stdout
    assert "growth rate of mode 1, to first order, for 1 % more of" in done.stdout
    assert names[0].read_text().startswith("number,frequency (Hz),growth (1/s),damping ratio,amplitude of pad,")
    assert "modes 1 and 2 meet at 746.5 Hz" in names[1].read_text(encoding="utf-8").replace("\xa0", " ")
    assert names[2].stat().st_size > 0


def test_a_mode_of_many_points_names_those_that_move_most_and_contacts_that_feed_alike():
    """Six contacts of a pad were named one by one, with every share, and the first alone as what feeds the mode."""
    size = 5
    stiffness = 4e5 * np.eye(size) + 3e6 * (2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    data = ss.machine.StructureData(0.1 * np.eye(size), 1e-7 * stiffness, stiffness, np.zeros((size, size)))
    points = {f"p{i}": ss.machine.StructurePoint(x=i + 1) for i in range(size)}
    law = ss.laws.RateState(a=0.010, b=0.014, d_c=2e-5, mu_ref=0.45, v_ref=1.0)
    load = ss.laws.ConstantNormalStress(preload=500.0)
    contacts = {
        f"c{i}": ss.machine.Surface(body="drive", against=f"s.p{i}", friction=law, contact=load) for i in range(size)
    }
    body = ss.machine.StructureBody(matrices=data, points=points)
    found = ss.analyze(ss.Machine(bodies={"s": body}, contacts=contacts, drive=ss.machine.Pull(velocity=1.0)))
    assert "c0, c1, c2, c3 and c4 each slide at 1 m/s" in str(found)
    assert re.search(r"friction at c\d and \d other contacts falls with velocity", found.origin.words)
    mode = replace(found.mode, amplitudes={f"s.p{i}": 0.9**i + 0j for i in range(9)})
    assert mode.words().startswith("the s.p0, the s.p1 and the s.p2 oscillate most, of 9 coordinates; ")
