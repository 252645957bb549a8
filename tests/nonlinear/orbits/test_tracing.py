"""How a branch of cycles is followed: what counts as a cycle, where it ends, what breaks off, how far steps go."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import A, unit_rig
from rigs_of_theory import CONTACTS, plain_guide, rate_state, rig
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.continuation import Failure, Point, SolutionCurve
from steadyslip.nonlinear.kicks.spans import constant_inputs
from steadyslip.nonlinear.orbits import flow as flow_module, follow as follow_module, tracer as tracer_module
from steadyslip.nonlinear.orbits.at_value import own_motion
from steadyslip.nonlinear.orbits.cycle import SpecialCycle
from steadyslip.nonlinear.orbits.cycle_from_motion import cycle_data, cycle_near
from steadyslip.nonlinear.orbits.end_reasons import STANDING, retraces, stands, winds
from steadyslip.nonlinear.orbits.flow import FlowRunner
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.shooting import Shooting
from steadyslip.nonlinear.orbits.special import BranchPoint, changes
from steadyslip.nonlinear.orbits.tracer import Tracer


def started(a_rig, **initial):
    """Jobs of one run of a rig, and the kernel's state at its start, at the drive's velocity."""
    one = np.ones(1)
    jobs = prepare(a_rig, None, 1.0, {}, initial, Options())
    jobs = replace(jobs, segments=constant_inputs(one, one * a_rig.drive.velocity, 0 * one, 0 * one, 0 * one))
    state = np.zeros(FlowRunner(jobs).size)
    state[0], state[2:] = jobs.initial[0][0], jobs.initial[0][2:]
    return jobs, state


@pytest.mark.parametrize("mass", [0.0, 1.0])
def test_motion_is_on_a_cycle_only_if_there_is_one(mass, damped):
    """The cycle next to a motion is that of the branch; a motion that settles, or grows, is on none."""
    rigs = [unit_rig("slip", 0.5, kappa, damping=0 if mass else 1e-3, mass=mass) for kappa in (0.4, 1.4)]
    jobs, state = started(rigs[0], x=0.3)
    found = cycle_near(FlowRunner(jobs), state, patience=20)
    (cycle,) = (damped if not mass else ss.cycles(rigs[0], doublings=0)).at(0.4 * A)
    assert found.period == pytest.approx(cycle.period, rel=1e-8)
    assert found.multipliers == pytest.approx(cycle.multipliers, rel=1e-5, abs=1e-8)
    assert cycle_near(FlowRunner(jobs), found._orbit.states[0]).period == pytest.approx(found.period, rel=1e-9)
    jobs, state = started(rigs[1], x=0.3)
    assert cycle_near(FlowRunner(jobs), state, patience=20) is None


def test_windings_that_close_in_on_a_value_are_an_end(damped):
    def folds(values, periods):
        return [
            SpecialCycle("fold", replace(damped.cycles[0], value=v, period=p), (v, v), 0.0)
            for v, p in zip(values, periods, strict=True)
        ]

    closing = 1.0 + (-0.5) ** np.arange(8.0)
    assert winds(folds(closing, np.arange(1.0, 9.0)))
    assert not winds(folds(closing, np.ones(8)))
    assert not winds(folds(closing[:4], np.arange(1.0, 5.0)))
    assert not winds(folds(1.0 + 0.1 * (-1.0) ** np.arange(8.0), np.arange(1.0, 9.0)))


def test_parameter_that_stands_still_is_an_end(damped):
    base = damped.cycles[0]

    def along(values, periods):
        return [replace(base, value=v, period=p) for v, p in zip(values, periods, strict=True)]

    rounding = 1.0 + 1e-12 * (-1.0) ** np.arange(STANDING)
    assert stands(along(rounding, np.geomspace(1.0, 1.04, STANDING)))
    assert not stands(along(rounding, np.geomspace(1.0, 1.2, STANDING)))  # a canard that goes on
    assert not stands(along(1.0 + 1e-9 * np.arange(STANDING), np.ones(STANDING)))
    assert not stands(along(rounding[1:], np.ones(STANDING - 1)))


def test_a_way_back_passes_the_amplitudes_of_the_way_there(damped):
    """A branch that rises upright from a degenerate onset does not, though values of its small cycles are rounding."""
    one = damped.cycles[0]

    def of(value, size):
        peak, lowest = one.speed * np.exp([size, -size])
        return replace(one, value=value, peak_velocity=peak, lowest_velocity=lowest, amplitude=size)

    rounding = np.array([-2500, -660, -86, 340, -370, -240, 34, 42, -5.6, -10.5, -8.6, 3]) * 1e-12
    upright = [of(1 + off, 5e-7 * 2**i) for i, off in enumerate(rounding)]
    assert not retraces(upright)
    sizes = [*np.linspace(0.1, 1, 19), *np.linspace(0.975, 0.5, 19)]
    back = [of(1 - 0.1 * size, size) for size in sizes]
    assert [retraces(back[:19]), retraces(back)] == [False, True]
    stopping = [replace(cycle, amplitude=np.inf) for cycle in back]
    assert [retraces(stopping[:19]), retraces(stopping)] == [False, True]


def test_multipliers_are_not_read_where_the_parameter_stands_still(damped):
    looked = []

    def read(u):
        looked.append(u)
        raise Failure("enough")

    def known(value, multiplier):
        cycle = replace(damped.cycles[-1], value=value, multipliers=(multiplier, 0.01))
        shooting = SimpleNamespace(flow=SimpleNamespace(size=3), multipliers=read)
        return BranchPoint(Point(np.zeros(2), np.ones(2), 0.0, 1), shooting, cycle, np.zeros(2), np.zeros(2))

    changes(known(1.0, -0.9), known(1.0 + 1e-13, -1.1), None, 1)
    assert not looked
    changes(known(1.0, -0.9), known(1.001, -1.1), None, 1)
    assert looked


def test_cycle_is_counted_once_round(damped):
    """Run through twice or three times it closes too, and is told from a true one; Newton's method alone is not."""
    (cycle,) = damped.at(0.8 * damped.onset.value)
    flow = Flow(damped.rig.with_values({"stiffness": damped.onset.value}), "slider.stiffness")
    orbit = cycle._orbit
    for turns in (1, 2, 3, 6):
        shooting = Shooting(flow, np.ones(1), True, damped.onset.value)
        u = shooting.packed(replace(orbit, period=turns * orbit.period))
        residual, _ = shooting.equations(u)
        assert np.abs(residual).max() < 1e-7
        assert cycle_data(shooting, u).turns == {1: 1, 2: 2, 3: 3, 6: 2}[turns]
    tracer = Tracer(flow, damped.onset, (0.0, 1.0), 10)
    with pytest.raises(Failure, match="run through 2 times"):
        tracer.resumed(replace(orbit, period=2 * orbit.period), 1.0)


def test_sheet_that_breaks_off_is_found_again_by_simulation(damped, monkeypatch):
    """What lies beyond is the same as without the break; the gap is said, and `at` simulates in it."""
    onset, broken = damped.onset, 0.8 * damped.onset.value
    real = Tracer.branch_point

    def known(self, shooting, point):
        found = real(self, shooting, point)
        if 0.7 * onset.value < found.cycle.value < broken:
            raise Failure("a hole")
        return found

    monkeypatch.setattr(Tracer, "branch_point", known)
    branch = ss.cycles(damped.rig, between=(0.3 * onset.value, 1.1 * onset.value))
    monkeypatch.undo()
    assert len(branch.gaps) == 1
    assert "a hole" in branch.broken[0]
    assert "another sheet, found by simulation" in str(branch)
    for share in (0.95, 0.75, 0.5):
        (cycle,), (same,) = branch.at(share * onset.value), damped.at(share * onset.value)
        assert cycle.period == pytest.approx(same.period, rel=1e-9)
    assert branch.to_dict()["gaps"][0]["before"] == branch.gaps[0]


def test_cycles_end_where_no_velocity_balances_the_forces(monkeypatch):
    """A pad that lifts with velocity, without mass: forces fold, and what lies beyond has no velocity to tell.

    The cycle comes as close to the fold as steps allow, which takes ever more of them, but not minutes.
    """
    monkeypatch.setattr("steadyslip.nonlinear.orbits.flow.MOST_STEPS", 8_000)
    friction = rate_state(evolution=ss.laws.PRZ(), regularised=True)
    lift = next(contact for contact in CONTACTS if contact.name == "lift")
    branch = ss.cycles(
        rig(friction=friction, contact=lift, stiffness=9e9, drive=ss.machine.PD(1e-6, kp=2e10, kd=1e9)), doublings=0
    )
    assert branch.end == tracer_module.ENDS["too many steps"]
    assert len(branch) > 5
    for name in ("peak_velocity", "lowest_velocity", "stress_drop"):
        assert np.all(np.isfinite(branch[name]))


def test_steps_are_long_where_equations_are_bent():
    """x follows a slow curve, and an equation as steep as that of an unstable cycle holds it there."""

    def steep(u):
        x, p = u
        off = x - 0.5 * p * p
        return np.array([np.expm1(1e4 * off)]), np.array([[1e4, -1e4 * p]]) * np.exp(1e4 * off)

    curve, points = SolutionCurve(steep), []
    first = curve.start(np.array([0.0, 0.0]), np.array([0.0, 1.0]))
    for point in curve.follow(first, 0.01, 1e-9, 0.5):
        points.append(point)
        assert point.u[0] == pytest.approx(0.5 * point.u[1] ** 2, abs=1e-9)
        if point.u[1] > 1:
            break
    assert len(points) < 30  # 95 along the tangent alone


def test_what_lies_between_distant_neighbours_is_found_on_the_parabola_through_them():
    """A tenth of a circle apart the tangent is five hundredths off; where equations are steep that is too far."""

    def circle(u):
        off = u @ u - 1
        return np.array([np.expm1(40 * off)]), 80 * u[None] * np.exp(40 * off)

    curve = SolutionCurve(circle)
    low = curve.start(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    high = curve.corrected(np.array([np.cos(0.6), np.sin(0.6)]), low.tangent, np.sin(0.6))
    measure = lambda point: point.u[0] - np.cos(0.4)  # noqa: E731
    found = curve.located(low, high, measure, measure(low), measure(high))[1]
    assert found.u == pytest.approx([np.cos(0.4), np.sin(0.4)], abs=1e-9)


def test_a_branch_begins_at_larger_cycles_where_small_ones_drown_in_rounding():
    """An onset so nearly degenerate that the edge moves by a millionth while cycles grow a thousandfold."""
    friction = ss.laws.LuGre(mu_coulomb=0.1189310343, mu_static=0.1882742085, v_stribeck=1.6888334216e-3,
                        viscous=2.3663122754, bristle_stiffness=255249.776917, bristle_damping=7.12855521)  # fmt: skip
    contact = ss.laws.InclinedSpring(preload=1292214.83, angle=-0.05289007)
    heavy = ss.Slider(friction=friction, contact=contact, stiffness=1e10, mass=962.847238,
                      drive=ss.machine.SteadyDrive(1.5017969314e-3))  # fmt: skip
    edge = ss.hopf(heavy).value
    branch = ss.cycles(heavy, between=(0.5 * edge, 1.2 * edge))
    assert branch.end.startswith("end of the range")
    (cycle,) = branch.at(0.5 * edge * (1 + 1e-9))
    assert cycle.stable
    assert cycle.period == pytest.approx(5.8737658898e-5, rel=1e-6)  # of a long simulation


def test_a_run_that_leads_nowhere_is_cut_short():
    """Far more steps than the last run took are no continuation of it."""
    flow = Flow(unit_rig("slip", 0.5, 0.4, damping=1e-3), "slider.stiffness")
    setting, start = flow.setting(0.4), flow.steady(0.4)[None] + 0.1
    flow.run(setting, start, np.array([1.0]))
    before = flow.steps
    with pytest.raises(Failure, match="too many steps"):
        flow.run(setting, start, np.array([1e6]))
    assert flow.steps - before <= 2 * flow_module.FEW_STEPS


def test_a_run_that_leads_nowhere_does_not_change_those_after_it():
    """Sensitivities keep their accuracy after a trial far off the branch, which no choice of steps ends in time."""
    flow = Flow(unit_rig("slip", 0.5, 0.4, damping=1e-3, mass=1.0), "slider.stiffness")
    setting, start, time = flow.setting(0.4 * A), flow.steady(0.4 * A)[None] + 0.1, np.array([1.0])
    before = flow.run(setting, start, time)
    with pytest.raises(Failure, match="too many steps"):
        flow.run(setting, start, np.array([1e6]))
    assert not flow.led
    for now, own in zip(flow.run(setting, start, time), before, strict=True):
        np.testing.assert_array_equal(now, own)


def test_the_cycle_of_a_block_that_rings_after_each_slip_is_found():
    """An axis on undamped bristles returns to its place once in 4.92 s, and passes the drive's velocity 29 times."""
    axis = plain_guide()
    branch = ss.cycles(axis, between=(11e6 / 0.02, 16e6 / 0.02), doublings=0)
    own = branch.at_rig
    (cycle,) = (one for one in own if one.stable)
    assert cycle.period == pytest.approx(4.924428, rel=1e-6)
    assert all(one.passed for one in cycle.checks)
    assert cycle.multiplier_error < 1e-5
    assert own.sentence.startswith(
        "judders: every 4.92 s it sticks, then slips 33.2 um within 50.7 ms, a drop of 394 N; rings 21"
    )
    assert str(branch).endswith(f"{own.sentence}\n  checked: {len(own)} cycles, stability of {len(own)} cycles")
    plain = branch.to_dict()["at_rig"]
    assert (plain["value"], plain["sentence"]) == (axis.stiffness, own.sentence)
    assert [one["period"] for one in plain["cycles"]] == [one.period for one in own]
    marks = [line for line in branch.plot().lines if line.get_marker() == "D"]
    assert [line.get_ydata()[0] * 1e-6 for line in marks] == pytest.approx([one.peak_velocity for one in own], rel=1e-3)


@pytest.mark.parametrize("stiffness", [2.7, 8.7, 14.0])
def test_a_cycle_of_long_rests_is_found_soon_wherever_it_rings(stiffness):
    """Steps of a short ringing, tried first, are no limit of those of the cycle; spans grow until slip returns."""
    flow = Flow(plain_guide(), "slider.stiffness")
    found = cycle_near(flow, flow.ahead(stiffness * 1e6 / 0.02, 2.0), stiffness * 1e6 / 0.02, 12)
    assert found.returned < 1e-7
    assert found.multiplier_error < 1e-5


def test_a_stable_cycle_whose_multipliers_lose_their_digits_is_told_by_its_motion(monkeypatch):
    """Where the motion leads the steps of its sensitivities."""
    begin = flow_module.FlowRunner.begin_motion

    def led(runs):
        begin(runs)
        runs.slack = flow_module.UNHEARD

    monkeypatch.setattr(flow_module.FlowRunner, "begin_motion", led)
    axis = plain_guide()
    flow = Flow(axis, "slider.stiffness")
    cycle = cycle_near(flow, flow.ahead(axis.stiffness, 2.0), axis.stiffness, 12)
    assert (cycle.multiplier_error > 1e-3, cycle.returned < 1e-5) == (True, True)
    assert all(one.passed for one in cycle.checks)


def test_what_a_rig_does_as_it_is_is_told_before_its_branch():
    """In a second, whatever else is asked: also where the branch cannot be followed."""
    words = own_motion(plain_guide(), "drive.velocity")
    assert words.startswith("the rig itself comes to a stable cycle of period 4.924429 s; it judders: every 4.92 s")
    assert own_motion(unit_rig("slip", 0.4, 0.5), "stiffness").startswith("the rig itself settles to steady sliding")


def test_cycles_of_the_rig_itself_are_each_told_once(damped):
    """Sheets of doublings may be one; beyond the edge the motion is told; a start is one that `simulate` takes."""
    twice = replace(damped, doubled=damped)
    rig = damped.rig.with_values({"stiffness": 0.5 * damped.onset.value})
    (cycle,) = replace(twice, rig=rig).at_rig
    back = ss.simulate(rig, until=cycle.period, initial=cycle.start, rtol=1e-11)
    assert [back[name][-1] for name in cycle.start if name != "x"] == pytest.approx(
        [value for name, value in cycle.start.items() if name != "x"], rel=1e-6
    )
    beyond = replace(damped, rig=rig.with_values({"stiffness": 1.2 * damped.onset.value}))
    assert not beyond.at_rig
    assert "settles to steady sliding" in str(beyond)


def test_ctrl_c_while_the_rig_itself_is_simulated_keeps_the_rest(damped, monkeypatch):
    def stop(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr("steadyslip.nonlinear.orbits.at_value.motion_from", stop)
    beyond = replace(damped, rig=damped.rig.with_values({"stiffness": 1.2 * damped.onset.value}))
    assert "motion from beside steady sliding was interrupted" in str(beyond)


def test_repeated_cycles_take_no_more_than_a_branch_may(monkeypatch):
    """One long cycle among stiff bristles took five times as many steps as all of its branch, and minutes."""
    a_rig = unit_rig("slip", 0.5, 0.4, damping=1e-3)
    found = list(ss.cycles(a_rig, most_points=6, doublings=0).cycles)
    made = []

    def flow(*given):
        made.append(Flow(*given))
        return made[-1]

    onset = ss.hopf(a_rig)
    tracer = Tracer(Flow(a_rig, "slider.stiffness"), onset, (-np.inf, np.inf), 10)
    monkeypatch.setattr(follow_module, "is_open", lambda cycle: True)
    monkeypatch.setattr(follow_module, "Flow", flow)
    follow_module._repeated(tracer, list(found))
    whole = made[-1].steps
    monkeypatch.setattr(tracer_module, "MOST_STEPS", whole // 10)
    assert len(follow_module._repeated(tracer, list(found))[0]) == len(found)
    assert whole // 10 <= made[-1].steps < whole // 3
    with pytest.raises(Failure, match="too many steps"):
        made[-1].run(made[-1].setting(0.4), made[-1].steady(0.4)[None] + 0.1, np.array([1e-3]))
