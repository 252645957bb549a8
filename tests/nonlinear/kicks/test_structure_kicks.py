"""Kicks of machines that a surface beneath drives, such as blades given by matrices: bounded work, same answers."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from scipy.integrate import solve_ivp

import steadyslip as ss
from machines import same_block
from steadyslip.machine import Machine, Pull, StructureBody, StructureData, StructurePoint, Surface
from steadyslip.nonlinear.kicks import kicks, outcomes, spans
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.spans import StepBudget
from structures_at_random import beam_matrices

A, B, SLIP, LEVEL, SPEED, LOAD = 0.010, 0.016, 20e-6, 0.45, 1e-3, 200.0


def blade(elements=2, damping=1e-3, load=LOAD):
    """A cantilever whose tip rests on a moving surface, and its M, C, K; its fastest mode turns at 1e5 rad/s."""
    mass, stiffness = beam_matrices(elements, length=0.1, width=0.02, height=0.004)
    squares, shapes = la.eigh(stiffness, mass)
    damped = mass @ shapes @ np.diag(2 * damping * np.sqrt(squares)) @ shapes.T @ mass
    points = {"tip": StructurePoint(x=len(mass) - 1)}
    body = StructureBody(matrices=StructureData(mass, damped, stiffness, 0 * mass), points=points)
    law = ss.laws.RateState(a=A, b=B, d_c=SLIP, mu_ref=LEVEL, v_ref=SPEED, evolution=ss.laws.Aging(), regularised=True)
    contact = ss.laws.ConstantNormalStress(preload=load)
    tip = Surface(body="drive", against="blade.tip", friction=law, contact=contact)
    return Machine(bodies={"blade": body}, contacts={"tip": tip}, drive=Pull(velocity=SPEED)), mass, damped, stiffness


def test_seen_from_the_drive_a_block_survives_the_same_blows():
    """Galilei: a block pulled over the ground is one tied to the ground on a belt, with blows reversed."""
    block, pulled = same_block(5)
    pulled = pulled.with_values({"links.spring.stiffness": 1.2 * ss.hopf(block).value})
    spring = replace(pulled.links["spring"], between=("ground", "block"))
    base = replace(pulled.contacts["base"], body="drive", against="block")
    tied = replace(pulled, links={"spring": spring}, contacts={"base": base})
    natural = [Kicked(one, "impulse", 1, "before", {}, 0, None, "block").rest.time for one in (pulled, tied)]
    assert natural[0] == pytest.approx(natural[1], rel=1e-9)  # infinite here, motions took all steps allowed
    own, other = (
        ss.threshold(one, "impulse", at="block", direction=way, precision=1e-4)
        for one, way in ((pulled, 1), (tied, -1))
    )
    assert own.outcome == other.outcome == "contact lost"
    assert all([own.decided, other.decided])
    assert other.amount == pytest.approx(-own.amount, rel=2e-4)


@pytest.mark.parametrize("kick", ["velocity", "impulse"])
def test_a_blade_comes_back_from_blows_as_integrated_by_scipy(kick):
    machine, mass, damped, stiffness = blade(elements=1, damping=0.1)
    found = ss.threshold(machine, kick, at="blade.tip", up_to=10.0, precision=1e-2)
    assert found.size == np.inf
    n = len(mass)
    inverse, tip = np.linalg.inv(mass), n - 2

    def friction(v, log_state):
        return A * np.arcsinh(v / (2 * SPEED) * np.exp((LEVEL + B * log_state) / A))

    def rates(_, y):
        q, u, log_state = y[:n], y[n : 2 * n], y[-1]
        v = SPEED - u[tip]
        force = -damped @ u - stiffness @ q
        force[tip] += LOAD * friction(v, log_state)
        growth = SPEED / SLIP * np.exp(-log_state) - abs(v) / SLIP  # state: ln of the age over the steady one's
        return np.concatenate([u, inverse @ force, [growth]])

    steady = LOAD * LEVEL * np.linalg.solve(stiffness, np.eye(n)[tip])
    blow = inverse[:, tip]  # of an impulse 1 at the tip
    for share in (0.1, 1.0):
        size = share * found.survived
        start = blow * (size if kick == "impulse" else size / blow[tip])
        slow = np.max(np.asarray(ss.eigenvalues(machine)).real)
        end = solve_ivp(rates, (0, -8 / slow + 20 * SLIP / SPEED), [*steady, *start, 0.0], "LSODA", rtol=1e-6,
                        atol=np.array([1e-12] * n + [1e-8] * n + [1e-8])).y[:, -1]  # fmt: skip
        assert abs(end[n + tip]) < 1e-2 * SPEED


def test_the_work_of_a_threshold_shrinks_as_steps_cost_more():
    steps = [StepBudget.of(1e9, n).steps for n in (1, 3, 6, 12)]
    np.testing.assert_allclose(steps, [1e9, 1e9, 1e9 / 8, 1e9 / 64])


def test_kicks_of_a_ringing_structure_take_the_steps_allowed_and_say_what_decides_more(monkeypatch):
    steps, allowed = [], 2e5
    monkeypatch.setattr(kicks, "STEPS_OF_STRUCTURES", allowed)
    monkeypatch.setattr(outcomes, "advanced_runs", counted(steps))
    machine, *_ = blade(damping=1e-5)
    found = ss.threshold(machine, "velocity", at="blade.tip")
    assert not found.decided
    assert sum(steps) <= 1.1 * allowed  # motions share what is left, in every span
    assert found.survived > 0.01 * SPEED  # what was found before is kept
    assert str(found).endswith(
        "; fewer steps suffice for smaller kicks (up_to), larger errors per step (rtol=1e-6), more damping, "
        "fewer modes (kept_modes)"
    )


def counted(steps):
    """`advanced_runs` that appends its integration steps to a list."""

    def advanced_runs(runs, *args, **more):
        found = spans.advanced_runs(runs, *args, **more)
        steps.append(float(np.nansum(found.steps)))
        return found

    return advanced_runs


def test_edges_of_many_kicks_are_those_of_each():
    """Steady slidings after kicks are solved for together; each must not depend on the others."""
    machine, *_ = blade(elements=1, load=80.0)
    kicked = Kicked(machine, "velocity", -1, "before", {}, 0, None)
    sizes = np.geomspace(1e-3, 9.0, 24)
    together = kicked.rest_after(np.zeros(24, dtype=int), sizes)
    alone = [kicked.rest_after(np.zeros(1, dtype=int), size[None]) for size in sizes]
    np.testing.assert_array_equal(together.state, np.concatenate([one.state for one in alone]))
    np.testing.assert_array_equal(together.stable, np.concatenate([one.stable for one in alone]))


def test_a_surface_beneath_cannot_be_displaced_at_once():
    machine, *_ = blade()
    with pytest.raises(ss.NotAvailable, match=r"only the surface beneath one; kick a body"):
        ss.threshold(machine, "displacement")


def test_balls_from_few_directions_first_are_those_from_all(monkeypatch):
    """Few directions only rule sizes out early; the size must pass in all."""
    machine, *_ = blade(elements=1)
    rest = Kicked(machine, "velocity", 1, "before", {}, 0, None, "blade.tip").rest
    own = Neighbourhood(rest).computed()
    monkeypatch.setattr("steadyslip.nonlinear.kicks.neighbourhood.FEW", 1)
    assert own > 0
    assert Neighbourhood(rest).computed() == own
