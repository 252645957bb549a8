"""Pore fluid with dilatancy and drainage: theory 4's critical stiffness, limits, a matrix typed by hand, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals

import steadyslip as ss

A, B, F0 = 0.01, 0.015, 0.6


def layer(k=0.005, suction=0.003 / F0, drainage=1.0, mass=0.0, **further):
    """A block on a wet layer; d_c = v0 = σ' = 1, so that suction is E, drainage χ and k κ."""
    friction = ss.laws.RateState(a=A, b=B, d_c=1.0, mu_ref=F0, v_ref=1.0)
    contact = ss.laws.PoreFluid(preload=1.0, suction=suction, drainage=drainage, slip_distance=1.0, v_ref=0.3)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=mass)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=k)},
        contacts={"layer": ss.machine.Surface(body="block", friction=friction, contact=contact, **further)},
        drive=ss.machine.Pull(velocity=1.0),
    )


def closed_form(suction, chi):
    """theory 4: the larger root of [a(1+χ) − b + f0 E + κ][κ(1+χ) − (b−a)χ] = aκχ."""
    p = np.poly1d([1.0, A * (1 + chi) - B + F0 * suction]) * np.poly1d([1 + chi, -(B - A) * chi])
    return np.max((p - np.poly1d([A * chi, 0.0])).roots.real)


def test_critical_stiffness_of_theory_4():
    ((low, high),) = ss.stable_values(layer(), "links.spring.stiffness")
    assert low == pytest.approx(0.004229118216792, rel=1e-12)
    assert high == np.inf


@pytest.mark.parametrize("suction", [1e-4, 0.003, 0.02, -0.004])
@pytest.mark.parametrize("chi", [0.01, 0.3, 5.0])
def test_critical_stiffness_over_dilatancy_and_drainage(suction, chi):
    """Of either sign: a layer that compacts destabilises."""
    ((low, high),) = ss.stable_values(layer(k=1.0, suction=suction, drainage=chi), "links.spring.stiffness")
    assert high == np.inf
    assert low == pytest.approx(max(closed_form(suction, chi), 0.0), rel=1e-9)


def test_drained_at_once_it_is_dry_and_undrained_it_is_stiffer():
    """χ → ∞: the dry critical stiffness b − a, order two; without dilatancy at every drainage."""
    off = [ss.stable_values(layer(k=1.0, drainage=chi), "links.spring.stiffness")[0, 0] - (B - A) for chi in
           (1e2, 1e3, 1e4)]  # fmt: skip
    assert np.diff(np.log10(np.abs(off))) == pytest.approx([-2, -2], abs=0.01)
    for chi in (0.1, 10.0):
        dry = ss.stable_values(layer(k=1.0, suction=0.0, drainage=chi), "links.spring.stiffness")
        assert dry[0, 0] == pytest.approx(B - A, rel=1e-12)
    edges = [ss.stable_values(layer(k=1.0, suction=e), "links.spring.stiffness")[0, 0] for e in (0.0, 0.002, 0.004)]
    assert np.all(np.diff(edges) < 0)  # dilatancy hardens


def test_eigenvalues_are_those_of_a_matrix_typed_by_hand():
    """x, v, Θ, D, p with mass: m v' = −k x − τ̂, τ̂ = (a v + b Θ) σ' − f0 p."""
    k, e, chi, m = 0.003, 0.01, 0.4, 0.02
    machine = layer(k, e, chi, m)
    rows = np.array([
        [0, 1, 0, 0, 0],
        [-k / m, -A / m, -B / m, 0, F0 / m],
        [0, -1, -1, 0, 0],
        [0, e, 0, -1, 0],
        [0, -e, 0, 1, -chi],
    ])  # fmt: skip
    assert np.sort_complex(ss.eigenvalues(machine)) == pytest.approx(np.sort_complex(eigvals(rows)), rel=1e-9)


def test_from_where_porosity_counts_does_not_matter_and_an_area_only_says_in_what():
    one = layer(suction=0.01)
    other = one.with_values({"contacts.layer.contact.v_ref": 7.0})
    assert ss.eigenvalues(other) == pytest.approx(ss.eigenvalues(one), rel=1e-12)
    spread = layer(suction=0.04, area=0.25).with_values({"contacts.layer.contact.preload": 4.0})
    assert ss.eigenvalues(spread) == pytest.approx(ss.eigenvalues(one), rel=1e-12)
    steady = ss.steady_state(one).contacts["layer"]
    assert steady.states["pore_pressure"] == 0.0
    assert steady.normal_force == 1.0


def test_wet_layers_in_a_machine_of_several_bodies():
    """Two equal wet blocks, coupled: the common mode is that of one."""
    one = layer(k=0.005).with_values({"contacts.layer.contact.slip_distance": 0.7})
    contacts = {"left": one.contacts["layer"], "right": replace(one.contacts["layer"], body="other")}
    both = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(), "other": ss.machine.SlidingBody()},
        links={
            "spring": ss.machine.Spring(between=("drive", "block"), stiffness=0.005),
            "second": ss.machine.Spring(between=("drive", "other"), stiffness=0.005),
            "coupling": ss.machine.Spring(between=("block", "other"), stiffness=0.02),
        },
        contacts=contacts,
        drive=one.drive,
    )
    found = ss.eigenvalues(both)
    for s in ss.eigenvalues(one):
        assert np.min(np.abs(found - s)) < 1e-9 * abs(s)
    text = ss.rig_to_text(both)
    assert ss.rig_from_text(text) == both
    assert "STABLE" in str(ss.analyze(both))
