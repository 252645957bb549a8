"""Controllers that act late on bodies without mass: edges by an equation typed elsewhere, and words on unknown ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

import late_light_machines as late
import steadyslip as ss
from machines import coulomb, surface


def motor(kd=0.36, damping=1.63, stiffness=40.0, delay=2.61):
    """A motor without mass in oil that a late controller holds, and a table on a spring."""
    return ss.Machine(
        bodies={"motor": ss.machine.SlidingBody(), "table": ss.machine.SlidingBody(mass=1.0)},
        links={
            "l0": ss.machine.Spring(between=("ground", "motor"), damping=damping),
            "l1": ss.machine.Spring(between=("motor", "table"), stiffness=stiffness),
            "hose": ss.machine.Spring(between=("ground", "table"), damping=0.5),
        },
        contacts={"guide": surface("table", coulomb(0.3))},
        drive=ss.machine.PositionPD(velocity=1.0, body="motor", kp=0.02, kd=kd, delay=delay),
    )


@pytest.mark.parametrize("damping", [0.5, 1.63, 20.0])
def test_the_damping_that_a_late_gain_outweighs_is_an_edge(damping):
    """At c = kd the highest power s³ (c + kd exp(−s delay)) can vanish: told from any damping above."""
    (edge,) = ss.boundary(motor(damping=damping), "links.l0.damping")
    assert (edge.kind, edge.stable, edge.value) == ("ill-posed", "above", pytest.approx(0.36, rel=1e-12))
    (gain, *_) = ss.boundary(motor(damping=damping), "drive.kd")
    assert late.status(motor(kd=gain.value * 0.9, damping=damping)) == "stable"


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [1, 157, 162])
def test_random_machines_have_the_edges_of_their_typed_equations(seed):
    compared, wrong = late.differences(seed)
    assert wrong == []
    assert compared > 50


def endless(stiffness):
    """theory 10's lag check: stable and unstable by turns for ever as the stiffness rises."""
    friction = ss.laws.CoulombStribeck(mu_coulomb=0.6, mu_static=0.6 - 0.05 * np.e, v_stribeck=1.0, lag=1.0)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=stiffness, damping=0.05)},
        contacts={"guide": surface("block", friction)},
        drive=ss.machine.Pull(velocity=1.0),
    )


def test_where_windows_are_too_many_is_said():
    name = "links.spring.stiffness"
    with pytest.warns(
        ss.linear.UndecidedWarning, match=r"edges of links\.spring\.stiffness above 316\.2 kN/m are not decid"
    ):
        edges = ss.boundary(endless(10.0), name)
    assert 0.9 * 316.2e3 < edges[-1].value < 316.3e3
    assert len(ss.boundary(endless(10.0), name, between=(1.0, 300e3))) > 150
    (margin,) = (one for one in ss.margins(endless(10.0)) if one.parameter == name)
    assert margin.searched[1] == pytest.approx(316.2278e3, rel=1e-6)
    near = min(edges, key=lambda edge: abs(math.log(edge.value / 10.0))).value
    assert ss.safety_factor(endless(10.0), along=name) == pytest.approx(10.0 / near, rel=1e-4)


def test_a_late_pull_on_a_motor_without_mass_that_only_a_spring_holds_is_ill_posed():
    """m s² + k + kp exp(−s delay): of smaller masses ever more roots grow, ever faster; without mass they were told to
    decay. A dashpot beside the spring gives the massless machine's answer to any small mass."""
    bare = replace(motor(kd=0.0), links={name: one for name, one in motor().links.items() if name != "l0"})
    small = {"bodies.motor.mass": np.array([1e-5, 1e-7, 1e-9])}
    growing = [late.growing(bare.with_values({"bodies.motor.mass": m, "drive.kp": 5.0})) for m in (1e-3, 1e-4)]
    assert growing[1] > growing[0] > 2
    assert np.all(np.diff(ss.growth_rate(bare, small)) > 0)
    assert ss.stability(bare) == "unstable"
    assert ss.growth_rate(bare) == np.inf
    assert "only springs hold" in ss.analyze(bare).reason
    assert len(ss.stable_values(bare, "drive.kp")) == 0
    damped = motor(kd=0.0)
    assert ss.stability(damped) == "stable"
    assert ss.growth_rate(damped, small) == pytest.approx(np.full(3, ss.growth_rate(damped)), rel=1e-3)


def light(link):
    """Such a machine that 10 N s/m of oil and `link` damp at once, and a gain of 500 N s/m a millisecond late."""
    found = motor(500.0, 10.0, 1e6, 1e-3)
    return found.with_values({"links.l1.damping": link, "bodies.table.mass": 5.0, "drive.kp": 1e5})


def test_eigenvalues_among_infinitely_many_are_missed_in_words():
    """Roots of a chain tend to Re s = ln(late / at once) / delay; where others lie right of it, these are told."""
    for link, told in ((499.0, 0), (700.0, 2)):
        rig = light(link)
        line = np.log(500.0 / (link + 10.0)) / 1e-3
        with pytest.warns(ss.linear.UndecidedWarning, match="many are nearly alike"):
            found = ss.eigenvalues(rig)
        assert np.sum(~np.isnan(found)) == told
        if told:
            assert np.min(found.real[:told]) > line
        else:
            assert ss.growth_rate(rig) == pytest.approx(line, rel=1e-6)
            with pytest.raises(ss.NotAvailable, match="modes cannot be distinguished"):
                ss.modes(rig)


def test_what_grows_without_limit_has_no_frequency_on_a_map():
    found = map_of(light(310.0), "drive.kd", [100.0, 520.0])
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


def map_of(rig, name, values):
    """Frequency and damping ratio along a parameter, (n, 2), as a map computes them."""
    from steadyslip.maps.plan.measures import Measure

    made = Measure.registry["frequency"]().arrays(rig, ss.Protocol(until=1.0), {name: np.array(values)})
    return np.stack([made["frequency"], made["damping_ratio"]], axis=-1)
