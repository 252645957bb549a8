"""The second question behind every number of a verdict: it passes what is right and finds what is wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import steadyslip as ss
from delays import lagging
from edges_at_random import drawn
from machines import at_random
from rigs_of_theory import LAWS, rig
from steadyslip.core.checks import in_words
from steadyslip.core.errors import SteadyslipError
from steadyslip.linear.boundary import margins
from steadyslip.linear.high_precision_eigenvalues import precise_eigenvalues
from steadyslip.linear.pencil import checked_spectrum
from steadyslip.linear.response import response_numbers
from steadyslip.model.point import operating_point
from steadyslip.verdict import checks, numbers
from steadyslip.verdict.checks import critical_check, edge_checks, net_forces, spectrum_checks, steady_check
from steadyslip.verdict.words import headline

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", ["inclined-spring", "machines/two-guides"])
def test_a_verdict_lists_its_checks_and_prints_one_line(name):
    analysis = ss.analyze(ss.read_rig(EXAMPLES / f"{name}.toml"))
    assert all(one.passed and one.error <= one.allowed for one in analysis.checks)
    assert [one.what for one in analysis.checks][:3] == ["steady sliding", "eigenvalues", "growing roots"]
    edges = sum(len(margin.edges) for margin in analysis.margins)
    assert sum(one.what.startswith("edge of ") for one in analysis.checks) == edges
    data = json.loads(analysis.to_json())
    assert data["checked"] in str(analysis)
    assert f"{edges} edges" in data["checked"]
    assert [one["what"] for one in data["checks"]] == [one.what for one in analysis.checks]


@pytest.mark.parametrize("law", LAWS)
def test_steady_sliding_is_balanced_by_every_law_and_by_no_other(law):
    held = rig(friction=LAWS[law])
    point = operating_point(held)
    assert steady_check(held, point).passed
    name = next(name for name in ("friction.mu_ref", "friction.mu_static") if name in held.parameters())
    other = held.with_values({name: held.value(name) * (1 + 1e-6)})
    missed = steady_check(other, point)
    assert not missed.passed
    assert missed.error == pytest.approx(1e-6, rel=0.2)


@pytest.mark.parametrize("name", ["two-guides", "brake-pad", "two-surfaces", "telescope"])
def test_forces_on_every_body_of_a_machine_add_up(name):
    """Of links and contacts as they are told; a link or a contact that is told wrong leaves something."""
    machine = ss.read_rig(EXAMPLES / "machines" / f"{name}.toml")
    steady, point = ss.steady_state(machine), operating_point(machine)
    right = net_forces(machine, steady)
    assert right
    assert max(right.values()) < 1e-14
    assert steady_check(machine, point, steady).passed
    link, force = max(steady.links.items(), key=lambda one: abs(one[1]))
    wrong = [replace(steady, links=steady.links | {link: force * (1 + 1e-6)})]
    for contact, own in steady.contacts.items():
        told = replace(own, friction_force=own.friction_force * (1 + 1e-6))
        wrong.append(replace(steady, contacts=steady.contacts | {contact: told}))
    for one in wrong:
        assert 1e-8 < max(net_forces(machine, one).values()) < 1e-5
        assert not steady_check(machine, point, one).passed


@pytest.mark.parametrize("decades", [0, 5, 9, 10, 13])
def test_bristles_of_any_damping_leave_the_verdict_decided(decades):
    """From 1e9 times the example's on, rounding of their rate was taken for forces out of balance."""
    screw = ss.read_rig(EXAMPLES / "lead-screw.toml")
    damped = screw.with_values({"bristle_damping": screw.value("bristle_damping") * 10.0**decades})
    found = ss.analyze(damped)
    assert str(found).startswith("UNSTABLE")
    assert all(one.passed for one in found.checks)
    point, own = operating_point(damped), ss.eigenvalues(damped)
    np.testing.assert_allclose(own, precise_eigenvalues(point, own), rtol=1e-9)
    assert ss.growth_rate(damped) == pytest.approx(own[0].real, rel=1e-12)
    other = damped.with_values({"friction.mu_coulomb": 0.13})
    assert not steady_check(other, point).passed


def test_memory_that_does_not_rest_is_found():
    held = rig(friction=LAWS["lugre"])
    other = held.with_values({"friction.v_stribeck": held.value("friction.v_stribeck") * 30})
    assert not steady_check(other, operating_point(held)).passed


def test_an_edge_that_is_none_is_left_out():
    held = rig()
    known = margins(held)
    (margin,) = [one for one in known if one.parameter == "friction.b"]
    wrong = replace(margin.edges[0], value=margin.edges[0].value * 1.001)
    shifted = replace(margin, edges=(wrong,), edge=wrong)
    kept, found = edge_checks(held, [shifted if one is margin else one for one in known], (), 0)
    assert [one.parameter for one in kept if one.edge is None and one.parameter == "friction.b"] == ["friction.b"]
    assert [one.passed for one in found if "friction.b" in one.what] == [False]
    assert all(one.passed for one in found if "friction.b" not in one.what)
    assert in_words(found).startswith(f"not decided: edge of friction.b at {wrong.value:.6g}; checked: ")


def test_an_edge_of_a_parameter_that_hardly_moves_the_root_is_kept():
    """A dashpot at a post that hardly moves, just beside the edge of the gain: within 1e-5 of it rounding decides."""
    values = {"links.l4.damping": 0.04557352634950696, "contacts.c0.friction.b": 0.581503327157371}
    values |= {"contacts.c1.friction.mu_ref": 0.81207, "drive.kp": 169.11}
    machine, name = at_random(100)[0].with_values(values), "links.l4.damping"
    (margin,) = [one for one in margins(machine) if one.parameter == name]
    kept, found = edge_checks(machine, [margin], (), 0)
    assert kept == (margin,)
    assert all(one.passed for one in found)
    sides = [ss.stability(machine.with_values({name: factor * margin.edge.value})) for factor in (0.99, 1.01)]
    assert sides == ["stable", "unstable"]


def test_where_the_growth_rate_touches_zero_it_is_said_to_touch():
    """The largest of the critical stiffnesses over the velocity: unstable at that velocity alone, stable around."""
    held = drawn(np.random.default_rng(0)).with_values({"drive.velocity": 1e-4})

    def critical(velocity):
        return -float(ss.critical_stiffness(held, {"drive.velocity": velocity}))

    found = minimize_scalar(critical, bounds=(5e-4, 1.5e-3), options={"xatol": 1e-9})
    known = margins(held.with_values({"slider.stiffness": -found.fun * (1 - 1e-4)}))
    (margin,) = [one for one in known if one.parameter == "drive.velocity"]
    assert [edge.stable for edge in margin.edges] == ["below", "above"]
    touched = replace(margin.edges[0], value=float(found.x))
    told = [replace(margin, edges=(touched,), edge=touched)]
    kept, (one,) = edge_checks(held.with_values({"slider.stiffness": -found.fun}), told, (), 0)
    assert one.passed
    assert in_words([one]) == f"checked: drive.velocity touches an edge at {found.x:.6g} m/s"
    assert kept[0].edge is None
    _, (one,) = edge_checks(held.with_values({"slider.stiffness": -found.fun * 1.001}), told, (), 0)
    assert in_words([one]).startswith("not decided: edge of drive.velocity")


def test_the_critical_stiffness_has_its_root_on_the_axis():
    held = rig()
    analysis, point = ss.analyze(held), operating_point(held)
    right = analysis.critical_stiffness, analysis.critical_angular_frequency
    assert critical_check(point, *right).passed
    for wrong in ((right[0] * 1.0001, right[1]), (right[0], right[1] * 1.0001)):
        assert not critical_check(point, *wrong).passed


@pytest.mark.parametrize("name", ["inclined-spring", "machines/two-guides"])
def test_the_kind_of_onset_is_checked_by_the_error_of_its_coefficient(name):
    analysis = ss.analyze(ss.read_rig(EXAMPLES / f"{name}.toml"))
    onset = analysis.onset
    assert analysis.checks[-1:] == onset.checks
    (right,) = onset.checks
    assert right.error == onset.coefficient_error / abs(onset.coefficient) < 1e-6
    assert "checked: kind of onset" in str(onset)
    (wrong,) = replace(onset, coefficient_error=2 * abs(onset.coefficient)).checks
    assert (wrong.passed, wrong.error) == (False, 2.0)
    assert not replace(onset, coefficient=np.nan).checks[0].passed
    assert replace(onset, kind="degenerate", coefficient=0.0, coefficient_error=0.0).checks[0].passed


def test_a_wrong_count_of_growing_roots_leaves_no_verdict(monkeypatch):
    """As if the roots of the polynomial were others than those of the rig's matrix."""
    held = rig()
    point = operating_point(held)
    assert all(one.passed for one in spectrum_checks(point, False, False))
    assert [one.passed for one in spectrum_checks(point, True, False)] == [True, False]
    good = numbers._without_delay
    monkeypatch.setattr(numbers, "_without_delay", lambda values: good(values) | {"stable": True})
    analysis = ss.analyze(held)
    assert analysis.stable is None
    assert analysis.reason.startswith("not decided: growing roots")
    assert headline(analysis).startswith("NOT DECIDED")
    json.loads(analysis.to_json())
    assert "not decided" in str(analysis)


@pytest.mark.parametrize("name", ["two-states", "machines/two-guides"])
def test_eigenvalues_that_fail_are_left_out(name, monkeypatch):
    """Stability is told all the same: it rests on their number."""

    def spoiled(point):
        found = checked_spectrum(point)
        return replace(found, errors=np.abs(found.values) * 0.01)

    for module in (numbers, checks):
        monkeypatch.setattr(module, "checked_spectrum", spoiled)
    analysis = ss.analyze(ss.read_rig(EXAMPLES / f"{name}.toml"))
    assert analysis.stable is not None
    assert (analysis.eigenvalues, analysis.growth_rate, analysis.period) == ((), None, None)
    assert "not decided: how fast" in str(analysis)
    assert "not decided: eigenvalues; checked: steady sliding, growing roots" in " ".join(str(analysis).split())
    json.loads(analysis.to_json())


@pytest.mark.campaign
def test_random_verdicts_pass_their_checks():
    """Of right numbers none is withheld."""
    found = []
    for seed in range(300, 314):
        try:
            analysis = ss.analyze(drawn(np.random.default_rng(seed)))
        except SteadyslipError:
            continue
        found += [(seed, one) for one in analysis.checks]
    assert len(found) > 100
    assert [(seed, str(one)) for seed, one in found if not one.passed] == []


def bristles(mu_static, mass=0.0):
    law = ss.laws.LuGre(
        bristle_stiffness=1e5, bristle_damping=0.0, mu_coulomb=0.3, mu_static=mu_static, v_stribeck=1e-3, viscous=0.0
    )
    contact = ss.laws.ConstantNormalStress(preload=1e4)
    return ss.Slider(friction=law, contact=contact, stiffness=1e6, mass=mass, drive=ss.machine.SteadyDrive(1e-3))


def test_undamped_bristles_without_mass_are_judged_by_the_limit_of_small_masses():
    """Real part of the oscillation of a small mass on them: −r² S/(2(k + r S)), whatever the mass (theory 3, f = 0)."""
    found = ss.analyze(bristles(0.25))
    assert (found.stable, found.growth_rate) == (None, None)
    assert found.reason.startswith("not decided: without mass")
    assert "slider.mass" in found.reason
    own = ss.eigenvalues(bristles(0.25), {"slider.mass": [1e-6, 1e-3]})
    part = response_numbers(operating_point(bristles(0.25)))
    assert own[:, -1].real == pytest.approx(-(part.r**2) * part.S / (2 * (part.k + part.r * part.S)), rel=1e-6)
    falling = ss.analyze(bristles(0.35))
    assert (falling.stable, falling.growth_rate) == (False, np.inf)
    assert ss.stability(bristles(0.35, 1e-6)) == "unstable"


def test_a_lag_whose_friction_balances_the_damping_touches_the_axis_many_times_in_one_check():
    """|c iω| = |S exp(−iωδ)| at one ω only: roots touch the axis once a period of it, for ever."""
    verdict = ss.analyze(lagging(0.3, damping=0.1, lag=0.5))
    (one,) = (check for check in verdict.checks if "lag touches" in check.what)
    assert "edges at 10002 values, the first 5.73574 s" in one.what
    assert one.passed
    assert one.error == pytest.approx(0.0, abs=1e-6)
    assert len(verdict.checks) < 20
