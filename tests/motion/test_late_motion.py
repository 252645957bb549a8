"""Motion with delays: against delay equations typed by hand, exact eigenvalues, and the limit of no delay."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import factorial

import steadyslip as ss
from late_motion import PUSH, axis, campaign_errors, event_errors, lagging, massless, slider, smooth_error
from steadyslip.model.dead_time import ORDERS, transport
from steadyslip.model.delay_order import LATE_ACCURACY, pade_error
from steadyslip.motion.jobs import Options, prepare
from steadyslip.motion.late_check import late_error
from steadyslip.nonlinear.kicks.settled import rest_of

RIGS = {
    "late servo on a slider": slider(),
    "late integral": slider("aging", kd=0.0, ki=0.05, delay=0.6),
    "without mass": massless(),
    "geared axis": axis(delay=0.1),
    "scale at the table": axis("aging", measured="table", kp=2.0, kd=0.5, ki=0.1, delay=0.2),
    "late friction": lagging(c=0.15),
    "friction and servo late": lagging(kp=0.3, delay=0.4, c=0.1),
}
JUDDERS = {
    "late servo on a slider": slider("aging", k=0.02, kp=0.1),
    "slip law": slider("slip", a=0.4, b=0.6, m=0.05, k=0.06, kp=0.1, kd=0.0, delay=0.5),
    "late integral": slider("aging", k=0.05, kp=0.09, ki=0.001, kd=0.0, delay=0.3),
    "geared axis": axis("aging", kp=1.0, kd=0.1, delay=0.2),
    "scale at the table": axis("aging", measured="table", kp=2.0, kd=0.1, delay=0.3),
    "late friction": lagging(c=0.0),
    "friction and servo late": lagging(kp=0.3, delay=0.4, c=0.05),
}


@pytest.mark.parametrize("order", ORDERS)
def test_late_signals_are_pade_approximants(order):
    """Markov parameters up to 2n − 1 of exp(−s), poles to the left, and no jump through."""
    one = transport(order)
    assert np.linalg.eigvals(one.matrix).real.max() < 0
    vector, moments = one.inflow, []
    for _ in range(min(2 * order, 12)):
        vector = -np.linalg.solve(one.matrix, vector)
        moments.append(one.outflow @ vector)
    signs = (-1.0) ** np.arange(len(moments))
    assert np.array(moments) * signs == pytest.approx(
        (-1.0) ** np.arange(len(moments)) / factorial(np.arange(len(moments))), abs=1e-12
    )
    for turn in (1.0, 2.0, 5.0, 10.0):
        there = one.outflow @ np.linalg.solve(1j * turn * np.eye(order) - one.matrix, one.inflow)
        assert abs(there - np.exp(-1j * turn)) <= 1.1 * pade_error(order, turn) + 1e-13 * order


@pytest.mark.parametrize("name", RIGS)
def test_smooth_motion_is_that_of_the_delay_equation(name):
    one = RIGS[name]
    assert smooth_error(one, 15 * one.natural) < LATE_ACCURACY


@pytest.mark.parametrize("name", JUDDERS)
def test_slip_events_are_those_of_the_delay_equation(name):
    one = JUDDERS[name]
    errors, count = event_errors(one, 120 * one.natural)
    assert count > 1
    assert np.max(errors) < 1e-3


@pytest.mark.parametrize("name", RIGS)
def test_growth_is_that_of_the_exact_roots(name):
    rig = RIGS[name].rig
    jobs = prepare(rig, None, 1.0, {}, {}, Options())
    found = rest_of(jobs, np.array([1.0]), np.zeros(1)).roots[0]
    for root in ss.eigenvalues(rig)[:2]:
        assert np.min(np.abs(found - root)) < 1e-8 * (1 + abs(root))


def test_without_delay_is_the_limit():
    for own, name in ((slider().rig, "drive.delay"), (lagging(c=0.15).rig, "friction.lag")):
        at = np.linspace(0.0, 10.0, 41)[1:]
        none, short, long = (
            ss.simulate(own.with_values({name: d}), until=10.0, times=at, rtol=1e-10, initial={"v": PUSH})["x"]
            for d in (0.0, 1e-3, 2e-3)
        )
        size = np.ptp(none)
        assert np.max(np.abs(short - none)) > 1e-5 * size
        assert 2 * short - long == pytest.approx(none, abs=2e-5 * size)


def test_many_runs_are_the_single_ones():
    rig, delays = slider("aging", k=0.02, kp=0.1).rig, np.array([0.1, 0.3])
    many = ss.simulate_many(rig, {"drive.delay": delays}, until=60.0, initial={"v": PUSH})
    assert list(many.status) == ["done"] * 2
    for i, delay in enumerate(delays):
        one = ss.simulate(rig.with_values({"drive.delay": delay}), until=60.0, initial={"v": PUSH})
        assert many.events["event_slip"][i] == pytest.approx(one.slip_events[-1].slip, rel=1e-4)
        assert many.final["x"][i] == pytest.approx(one["x"][-1], rel=1e-3)
    plain = ss.simulate_many(rig, {"drive.delay": delays}, until=60.0, initial={"v": PUSH}, events=False)
    assert not plain.events
    assert plain.final["v"] == pytest.approx(many.final["v"], rel=1e-6)


def test_the_accuracy_is_told(tmp_path):
    run = ss.simulate(slider("aging").rig, until=60.0, initial={"v": PUSH})
    assert 0 <= run.late_error < 1e-3
    assert "delay " in str(run)
    run.save(tmp_path / "run.nc")
    assert ss.load_history(tmp_path / "run.nc").status == "done"


def test_what_is_not_resolved_is_said(monkeypatch):
    rig = slider().rig
    for where in ("single", "many"):
        monkeypatch.setattr(f"steadyslip.motion.{where}.LATE_TOLERANCE", -1.0)
    run = ss.simulate(rig, until=5.0, initial={"v": PUSH})
    assert run.status == "delay not resolved"
    assert "shorten the delay" in run.message
    many = ss.simulate_many(rig, {"stiffness": [0.3, 5.0]}, until=5.0, initial={"v": PUSH})
    assert list(many.status) == ["delay not resolved"] * 2


def test_irregular_stick_slip_is_not_blamed_on_the_delay():
    """A slide with bristles, an encoder's scale and 2 ms of dead time: its slips part by any change of accuracy."""
    rig = ss.Slider(
        friction=ss.laws.LuGre(mu_coulomb=0.1, mu_static=0.16, v_stribeck=5e-3, bristle_stiffness=5e4, viscous=0.5),
        contact=ss.laws.ConstantNormalStress(preload=4e5), area=2e-3, mass=2e4,
        drive=ss.machine.PD(2e-3, kp=1.5e9, kd=1e6, delay=2e-3),
    )  # fmt: skip
    step = ss.protocol.VelocityStep(at=0.1, to=2.1e-3)
    run = ss.simulate(rig, step, until=1.5)
    assert (run.status, run.late_error) == ("done", np.inf)
    assert "the motion is irregular" in str(run)
    short = ss.simulate(rig, step, until=0.35)
    assert len(short.slip_events) > 3
    assert short.late_error < 1e-3


def test_runs_that_differ_are_told_apart():
    own = slider("aging", k=0.02, kp=0.1).rig
    one, other = (ss.simulate(own.with_values({"drive.kp": kp}), until=60.0, initial={"v": PUSH}) for kp in (0.1, 0.11))
    assert late_error(one, one) == 0.0
    assert late_error(one, other) > 0.01
    assert late_error(one, ss.simulate(own, until=10.0)) == np.inf


def test_a_machine_without_its_servo_has_no_late_signal():
    """A drive that pulls with a force of its own has no controller, late or not."""
    own = slider().rig
    run = ss.simulate(own, ss.protocol.CreepStep(at=0.0, by=0.01), until=2.0)
    at_once = ss.simulate(
        replace(own, drive=replace(own.drive, delay=0.0)), ss.protocol.CreepStep(at=0.0, by=0.01), until=2.0
    )
    assert run["x"][-1] == pytest.approx(at_once["x"][-1], rel=1e-6)


@pytest.mark.campaign
def test_rigs_at_random():
    errors = [campaign_errors(1, i) for i in range(12)]
    assert max(smooth for smooth, _, _ in errors) < 1e-5
    assert max(np.max(events) for _, events, _ in errors) < 0.01
    assert sum(count > 1 for _, _, count in errors) > 3
