"""What comes of kicks is said only where it is certain: motion that is followed to its end, and doubt."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import steadyslip as ss
from kicked_rigs import heavy, tilted
from rigs_of_theory import CONTACTS, SIGMA, V0, rate_state, rig
from steadyslip.model.start import initial_values
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.kicks import (
    kicks as kicks_module,
    outcomes as outcomes_module,
    spans as spans_module,
    threshold as threshold_module,
)
from steadyslip.nonlinear.kicks.brackets import threshold_brackets
from steadyslip.nonlinear.kicks.fold import at_fold
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.settled import rest_of
from steadyslip.nonlinear.kicks.spans import BLOW_UP, DOUBTS, EXHAUSTED, LATE, OUTCOMES, RETURNS, StepBudget, doubt_of

# -- with mass: recovery is no oscillation, and unstable sliding gets no return


def outcomes(a_rig, kick, sizes, direction=1):
    found = Kicked(a_rig, kick, direction, "before", {}, 0, None).outcomes(np.zeros(len(sizes), int), np.array(sizes))
    return [OUTCOMES[i] for i in found]


def test_ringing_while_the_block_sticks_is_no_cycle():
    """It makes two peaks agree to 1e-8 on the way back to steady sliding."""
    a_rig = heavy(ss.laws.Slip(), 1.3, 1e10)
    assert outcomes(a_rig, "displacement", [5.0, 20.0, 39.1, 60.0, 150.0]) == ["returns"] * 5


@pytest.mark.parametrize("direction", [1, -1])
def test_a_block_may_be_stopped_beyond_floating_point(direction):
    """Friction follows ln v to -65 000 e-folds while the spring is taken up again: no kick is too large to be told."""
    a_rig = heavy(ss.laws.Slip(), 1.3, 1e10)
    found = ss.threshold(a_rig, "displacement", direction=direction, up_to=1e5)
    assert (found.size, found.searched, found.decided) == (np.inf, 1e5, True)
    lengths = 2000.0
    step = ss.protocol.DisplacementStep(at=0.0, by=direction * lengths * 1e-6)
    run = ss.simulate(a_rig, step, until=2 * lengths, times=[30.0, 0.9 * lengths, 2 * lengths], rtol=1e-8)
    assert run["v"][:2] == pytest.approx(0.0, abs=1e-30)
    assert np.diff(run["x"][:2]) == pytest.approx(1e-6 * (30.0 - 0.9 * lengths))  # the load point alone moves
    assert run["v"][2] == pytest.approx(1e-6, rel=1e-6)


def test_peaks_that_shrink_towards_a_cycle_are_no_return():
    a_rig = heavy(ss.laws.Aging(), 0.5, 2.5e9)
    assert outcomes(a_rig, "displacement", [1.0, 50.0, 90.8, 120.0]) == ["oscillation"] * 4
    assert outcomes(a_rig, "velocity", [0.5], -1) == ["oscillation"]


def test_cycles_of_several_slip_events_are_cycles():
    """Two states, past two period doublings: four events, no two alike, until the motion repeats itself."""
    states = (
        ss.laws.State(b=0.010313918056883623, d_c=1e-6),
        ss.laws.State(b=0.008294462572654671, d_c=4.530570134031203e-6),
    )
    friction = ss.laws.RateState(
        a=0.013579666218587378, mu_ref=0.6, v_ref=1e-6, states=states, evolution=ss.laws.Slip()
    )
    a_rig = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=6945501792.881493,
                      drive=ss.machine.SteadyDrive(1e-6))  # fmt: skip
    assert outcomes(a_rig, "normal-stress", [0.008168182941285275], -1) == ["oscillation"]


def test_outcomes_change_at_a_threshold_with_mass():
    """A step of velocity, beyond which mass makes the new sliding unstable."""
    a_rig = heavy(ss.laws.Slip(), 1.3, 1e10)
    found = ss.threshold(a_rig, "velocity", precision=1e-3)
    below, above = outcomes(a_rig, "velocity", [0.95 * found.size, 1.05 * found.size])
    assert (below, above) == ("returns", "oscillation")


# -- kicks that are hard to follow


def test_a_block_thrown_far_ahead_is_waited_for():
    """It stands still until the load point has caught up, for as long as that takes: friction stops what it may."""
    friction = ss.laws.RateState(a=0.0128, b=0.0172, d_c=1e-6, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Slip())
    base = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=2.8e10, mass=1.5e8,
                     drive=ss.machine.SteadyDrive(1e-6))  # fmt: skip
    sizes = np.array([1e5, 2e6, 1e9])
    assert outcomes(base, "impulse", sizes) == ["returns"] * 3
    kicked = Kicked(base, "impulse", 1, "before", {}, 0, None)
    lengths = sizes * 1e-6 * np.sqrt(base.mass / base.stiffness) / kicked.rest.natural_slip[0]
    assert lengths[1] > 10 * spans_module.MOST_LOADING  # the load point moves so far before anything happens


def test_steps_that_damping_makes_stiff_are_followed():
    """At e^20 times the velocity memory follows slip at once, and damping lets the spring follow slowly."""
    friction = ss.laws.RateState(a=0.0139, b=0.0208, d_c=1e-6, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.PRZ())
    damped = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=6.8e10,
        radiation_damping=3.2e8,
                       drive=ss.machine.SteadyDrive(1e-6))  # fmt: skip
    assert outcomes(damped, "velocity", [5.0, 20.0, 25.0]) == ["returns"] * 3
    kicked = Kicked(damped, "velocity", 1, "before", {}, 0, None)
    roots = kicked.rest_after(np.zeros(1, dtype=int), np.array([25.0])).roots[0].real
    assert roots.min() / roots.max() > 1e8
    exact = -damped.stiffness / damped.radiation_damping  # of a damper and a spring
    assert roots.max() == pytest.approx(exact, rel=1e-6)


def folding(factor=1.03):
    """Bristles without mass, whose forces balance at three velocities: .6, .8 and 1 times the drive's."""
    friction = ss.laws.LuGre(mu_coulomb=0.148, mu_static=0.214, v_stribeck=0.00168, viscous=4.55,
                        bristle_stiffness=1.29e4, bristle_damping=26.3)  # fmt: skip
    base = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=4e9,
        radiation_damping=2490.0,
                     drive=ss.machine.SteadyDrive(0.00285))  # fmt: skip
    return base.with_values({"stiffness": factor * ss.hopf(base).value})


def test_a_block_without_mass_takes_the_nearest_velocity_that_balances_forces():
    """A step of a thousandth changes the velocity by as little, whichever way the search for it steps."""
    a_rig, drive = folding(), 0.00285
    for size in np.linspace(-0.02, 0.01, 11):
        run = ss.simulate(a_rig, ss.protocol.VelocityStep(at=0.0, to=drive * (1 + size)), until=1e-6)
        assert run["v"] == pytest.approx(drive, rel=0.03)
    assert outcomes(a_rig, "velocity", np.geomspace(1e-3, 5e-3, 9)) == ["returns"] * 9


def test_where_no_velocity_balances_forces_any_further_there_is_no_solution():
    """Two of the three velocities meet: the slope of the balance vanishes, and beyond there is but one far away."""
    a_rig = folding()
    assert outcomes(a_rig, "displacement", [0.02, 0.1, 1.0]) == ["returns", "no solution", "no solution"]
    kicked = Kicked(a_rig, "displacement", 1, "before", {}, 0, None)
    runs = kicked.runs(np.zeros(1, dtype=int), np.array([0.1]))
    ended = spans_module.advanced_runs(runs, np.zeros(1, dtype=int), None, runs.times()[0])
    assert at_fold(runs.rest, ended.state).all()
    assert not at_fold(runs.rest, runs.rest.state).any()


def test_a_motion_goes_on_at_the_velocity_at_which_it_stopped():
    """Two spans are one: where three velocities balance forces, a state alone begins at the wrong one of them."""
    friction = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.8, v_stribeck=0.05, viscous=1.0, bristle_stiffness=5e5, bristle_damping=140.0
    )
    a_rig = rig(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=1.4e10,
        drive=ss.machine.SteadyDrive(5e-4),
    )
    kicked = Kicked(a_rig, "displacement", 1, "before", {}, 0, None)
    runs, one, span = kicked.runs(np.zeros(1, dtype=int), np.array([1e-9])), np.zeros(1, dtype=int), np.array([1e-5])
    initial, velocity = initial_values(runs.jobs.reduction, runs.jobs.point, {"v": 50.0})
    runs = replace(runs, jobs=replace(runs.jobs, initial=initial, velocity=velocity), jump=np.zeros(1))
    whole = spans_module.advanced_runs(runs, one, None, 2 * span)
    half = spans_module.advanced_runs(runs, one, None, span)
    assert half.unknowns[0, 0] > 100 * 5e-4
    again = spans_module.advanced_runs(runs, one, half.state, span, unknowns=half.unknowns)
    assert again.state == pytest.approx(whole.state, rel=1e-4)
    assert again.unknowns == pytest.approx(whole.unknowns, rel=1e-4)
    near = [spans_module.advanced_runs(runs, one, half.state * (1 + k * 1e-9), span) for k in range(-2, 3)]
    assert min(lost.unknowns[0, 0] for lost in near) < 0.1 * whole.unknowns[0, 0]  # rounding decides which it is


# -- no threshold beyond an edge


def test_no_threshold_beyond_the_edge_of_the_new_sliding():
    """A step of normal stress: the edge is that of a rig with as much more preload."""
    a_rig = tilted(-0.5, 1.15)
    edge = ss.boundary(a_rig, "contact.preload")
    edges = [one.value for one in edge] if isinstance(edge, (list, tuple)) else [edge.value]
    step = min(e for e in edges if e > SIGMA) - SIGMA
    found = ss.threshold(a_rig, "normal-stress")
    assert 0 < found.amount <= step * (1 + 1e-9)
    assert found.bracket[0] < found.size <= found.bracket[1]
    if found.edge:
        assert found.amount == pytest.approx(step, rel=1e-6)
        assert found.bracket[0] > 0.99 * found.bracket[1]
        assert "edge of stability" in str(found)


# -- the velocity after the step


@pytest.mark.parametrize(("angle", "expected"), [(30, 2.9124235), (-30, 2.2918127)])
def test_a_given_steady_stress_holds_at_the_rigs_own_velocity(angle, expected):
    rock = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    loaded = rig(friction=rock, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=np.radians(angle)))
    loaded = loaded.with_values({"stiffness": 1.2 * ss.critical_stiffness(loaded)})
    stress = ss.steady_state(loaded).normal_stress
    given = rig(friction=rock, contact=ss.laws.InclinedSpring(steady_normal_stress=stress, angle=np.radians(angle)),
                stiffness=loaded.stiffness)  # fmt: skip
    found = ss.threshold(given, reference="after").size
    assert found == pytest.approx(ss.threshold(loaded, reference="after").size, rel=1e-7)
    assert found == pytest.approx(expected, abs=2e-7)  # by SciPy in slip time: 2.9124232 returns, 2.9124236 does not


# -- doubt


def doubtful(low, high, limit):
    """Outcomes of a made-up rig: returns below `limit`, blow-up above, undecided in between, for want of steps."""

    def made(runs, threads=None, advanced=None):
        if advanced is not None:
            advanced(len(runs.jump))
        size = np.abs(runs.jump) / runs.rest.scales[:, 0]
        return np.where((size > low) & (size < high), EXHAUSTED, np.where(size < limit, RETURNS, BLOW_UP))

    return made


def test_doubt_is_carried_through(monkeypatch):
    a_rig = tilted(0.3, 1.2)
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(5.0, 6.0, 5.5))
    found = ss.threshold(a_rig, "displacement")
    assert (found.decided, found.outcome) == (False, "blow-up")
    assert found.bracket == pytest.approx((5.0, 6.0), rel=0.02)
    why = doubt_of(EXHAUSTED)
    assert f"survives up to {found.survived / 1e-6:.6g}"[:-1] in str(found)
    assert f"; from there to 5.512244 um, not decided: {why}; beyond: blow-up" in str(found)
    assert (found.to_dict()["decided"], found.to_dict()["doubt"]) == (False, why)
    assert found.survived == pytest.approx(found.bracket[0] / found.size * found.amount, rel=1e-12)
    brackets, _, _ = threshold_brackets(a_rig, {"mass": np.zeros(2)}, "displacement")
    assert np.isnan(brackets.size).all()
    assert np.all(brackets.low <= 5.0)
    assert np.all((brackets.low > 4.8) & (brackets.high >= 6.0) & (brackets.high < 6.2))
    margin = ss.margin_to_kick(a_rig, ss.protocol.DisplacementStep(at=0.0, by=5.5 * found.amount / found.size))
    assert margin.survives is None
    assert f"undecided ({why})" in str(margin)
    assert (margin.to_dict()["survives"], margin.to_dict()["doubt"]) == (None, why)
    analysis = " ".join(str(ss.analyze(a_rig, kick="displacement")).split())
    assert "survives a displacement step of 4.9" in analysis
    assert f"({why}); more leads to blow-up" in analysis


def test_doubt_is_said_on_maps(monkeypatch):
    """Beside sizes that are not given: in the coordinate of an array, in map results, in the legend of the picture."""
    a_rig, why = tilted(0.3, 1.2), f"undecided: {doubt_of(EXHAUSTED)}"
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(5.0, 6.0, 5.5))
    angle = xr.DataArray([-1.4, 0.2, 0.3], dims="angle", coords={"angle": [-1.4, 0.2, 0.3]})
    mass = xr.DataArray([0.0, 0.0, 0.0], dims="mass", coords={"mass": [0.0, 1.0, 2.0]})
    found = ss.threshold_map(a_rig, {"contact.angle": angle, "mass": mass}, "displacement")
    assert np.isnan(found).all()
    assert set(found["limit"].sel(angle=-1.4).values) == {"no steady sliding"}
    assert set(found["limit"].sel(angle=0.3).values) == {why}
    words = " | ".join(ss.figures.threshold_map(found).get_legend_handles_labels()[1]).replace("\n", " ")
    assert words == f"no steady sliding | {why}"
    measured = ss.maps.KickThreshold(kick="displacement").arrays(
        a_rig, ss.Protocol(), {"contact.angle": np.array([0.3])}
    )
    (limit,) = [o for o in ss.maps.KickThreshold(kick="displacement").outputs(a_rig, ()) if o.name == "threshold_limit"]
    assert limit.flags[int(measured["threshold_limit"][0])] == why


def test_an_edge_is_a_threshold_though_motions_next_to_it_return_too_slowly(monkeypatch):
    a_rig = tilted(-0.5, 1.15)
    edge = ss.threshold(a_rig, "normal-stress", precision=1e-3)
    share = edge.amount / edge.size

    def slow(runs, threads=None, advanced=None):
        size = runs.rest.pressure / share / edge.size
        return np.where(size > 1, BLOW_UP, np.where(size > 1 - 2e-6, LATE, RETURNS))

    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", slow)
    found = ss.threshold(a_rig, "normal-stress")
    assert (found.edge, found.decided, found.outcome) == (True, True, "blow-up")
    assert 0 < 1 - found.bracket[0] / found.bracket[1] <= 1e-5


def test_below_an_edge_that_is_not_certain_the_certain_end_is_said(monkeypatch):
    """Undecided up to the edge of the new steady sliding: the edge itself is no kick that is survived."""
    a_rig = tilted(-0.5, 1.15)
    edge = ss.threshold(a_rig, "normal-stress", precision=1e-3)
    assert edge.edge

    share = edge.amount / edge.size

    def slow(runs, threads=None, advanced=None):
        size = runs.rest.pressure / share
        return np.where(size > edge.size, BLOW_UP, np.where(size > 0.9 * edge.size, LATE, RETURNS))

    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", slow)
    found = ss.threshold(a_rig, "normal-stress")
    assert (found.edge, found.decided) == (True, False)
    assert found.survived == pytest.approx(found.bracket[0] * share, rel=1e-9)
    assert found.survived < 0.91 * edge.amount
    for text in (str(found), " ".join(str(replace(ss.analyze(a_rig), kicks=(found,))).split())):
        assert f"{found.survived / 1e3:.6g}"[:4] in text
        assert doubt_of(LATE) in text


def test_narrow_doubt_leaves_a_threshold_and_endless_doubt_none(monkeypatch):
    a_rig = tilted(0.3, 1.2)
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(5.0, 5.1, 5.05))
    size = ss.threshold_map(a_rig, {"mass": np.zeros(1)}, "displacement")
    assert size[0] == pytest.approx(5.05, rel=0.03)
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(5.0, np.inf, 1e9))
    found = ss.threshold(a_rig, "displacement")
    assert np.isnan(found.size)
    assert "; beyond not decided: " in str(found)
    assert found.to_dict()["size"] is None
    assert np.isnan(ss.threshold_map(a_rig, {"mass": np.zeros(1)}, "displacement")[0])


@pytest.mark.parametrize("calls", [1, 3, 6])
def test_ctrl_c_keeps_the_bracket_that_was_reached(monkeypatch, calls):
    a_rig, seen = tilted(0.3, 1.2), []
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(5.5, 5.5, 5.5))

    def progress(tried, low, high):
        seen.append((tried, low, high))
        if len(seen) == calls:
            raise KeyboardInterrupt

    found = ss.threshold(a_rig, "displacement", progress=progress)
    assert (found.interrupted, found.decided) == (True, False)
    assert found.bracket == seen[-1][1:]
    assert found.bracket[0] < 5.5 < found.bracket[1]
    assert [tried for tried, _, _ in seen] == sorted(tried for tried, _, _ in seen)
    assert "stopped" in str(found)
    assert found.to_dict()["interrupted"] is True
    verdict = " ".join(str(replace(ss.analyze(a_rig), kicks=(found,))).split())
    assert "stopped, not known" in verdict
    if np.isinf(found.bracket[1]):
        assert np.isnan(found.size)
    whole = ss.threshold(a_rig, "displacement", progress=lambda *_: None)
    assert (whole.interrupted, whole.decided) == (False, True)


def test_all_kicks_of_a_threshold_share_their_steps(monkeypatch):
    """With few steps altogether the rest is undecided, not followed for ever."""
    a_rig = tilted(0.3, 1.02)
    whole = ss.threshold(a_rig, precision=1e-4)
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.STEPS", 1e4)
    found = ss.threshold(a_rig, precision=1e-4)
    assert (whole.decided, found.decided, found.interrupted) == (True, False, False)
    assert found.bracket[0] < whole.size < found.bracket[1]
    assert "not decided" in str(found)


def lugre_with_mass(static, coulomb, v_stribeck, viscous, stiffness, damping, k, mass, drive):
    friction = ss.laws.LuGre(mu_coulomb=coulomb, mu_static=static, v_stribeck=v_stribeck, viscous=viscous,
                        bristle_stiffness=stiffness, bristle_damping=damping)  # fmt: skip
    return ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=k,
        mass=mass,
        drive=ss.machine.SteadyDrive(drive),
    )


BURSTS = lugre_with_mass(0.28515067591143456, 0.22351646292795108, 6.94289845661168e-4, 0.2596307205355822,
                         166284.25485873976, 3.6975851110961147, 96609339175.84653, 8342.87273888764,
                         5.171806599804903e-4)  # fmt: skip
IRREGULAR = lugre_with_mass(0.43046778, 0.26011183, 5.6138831e-4, 1.7738102, 236582.66, 53.432126, 6.5651327e11,
                            425.22112, 2.5630575e-4)  # fmt: skip


def test_a_cycle_of_several_slip_events_is_one_though_two_of_them_always_follow_each_other(monkeypatch):
    """Bursts end with two events a fixed time apart; the period is the time between bursts."""
    monkeypatch.setattr(outcomes_module, "PEAKS", np.inf)  # it is no irregular motion,
    monkeypatch.setattr(outcomes_module, "_alike", lambda now, before: now > 0)  # and these two are all that is seen
    assert outcomes(BURSTS, "normal-stress", [0.02865162114725823], -1) == ["oscillation"]


def test_irregular_motion_about_unstable_sliding_goes_on():
    """No cycle is found, and none is needed: nothing returns to unstable sliding, and peaks have long been as high.

    Of irregular motions some reach a new height late, and stay undecided: which, the last digits decide.
    """
    assert ss.growth_rate(IRREGULAR) > 0
    found = outcomes(IRREGULAR, "displacement", [0.445, 0.4454, 0.4458, 0.4462, 0.4472])
    assert set(found) <= {"oscillation", "undecided"}
    assert found.count("oscillation") >= 2


def test_motion_that_still_grows_is_no_irregular_one():
    peak, count = (outcomes_module.TALLY.index(name) for name in ("peak_velocity", "velocity_peaks"))
    jobs = Kicked(IRREGULAR, "displacement", 1, "before", {}, 0, None).runs(np.zeros(4, int), np.ones(4))
    course = outcomes_module._Course(jobs, 1, None)
    tally = np.zeros((4, len(outcomes_module.TALLY)))
    tally[:, count], tally[:, peak] = (50, 50, 30, 50), 1e-3 * np.array([1.0, 1.2, 1.0, 1.0])
    course.peak[:], course.elapsed[:] = 1e-3, (1.0, 1.0, 1.0, 1e-5)
    assert course._goes_on(np.arange(4), tally).tolist() == [True, False, False, False]


@pytest.mark.parametrize("most", [pytest.param(400, marks=pytest.mark.campaign), 3000])
def test_a_span_with_too_many_steps_goes_on_from_where_it_ended(monkeypatch, most):
    """What comes of a motion does not depend on how many steps are taken at a time."""
    own = kicks_module.options_for
    monkeypatch.setattr(kicks_module, "options_for", lambda *given: replace(own(*given), most_steps=most))
    assert outcomes(heavy(ss.laws.Aging(), 0.5, 2.5e9), "displacement", [2.0]) == ["oscillation"]
    assert outcomes(heavy(ss.laws.Slip(), 1.3, 1e10), "displacement", [60.0]) == ["returns"]


def test_a_block_pulled_back_out_of_all_proportion_is_followed():
    """It stops so hard that ln v falls by thousands; numbers stay numbers on its way back, for every size."""
    friction = rate_state(a=0.0126, b=0.0153, mu_ref=0.6, normal_memory=ss.laws.LinkerDieterich(alpha=0.175))
    a_rig = ss.Slider(friction=friction, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.016), stiffness=2.74e10,
                      mass=2.58e5, drive=ss.machine.SteadyDrive(V0))  # fmt: skip
    kicked = Kicked(a_rig, "velocity", -1, "after", {}, 0, None)
    sizes = np.linspace(13.5, 14.9, 64)
    assert set(kicked.outcomes(np.zeros(64, dtype=int), sizes).tolist()) == {RETURNS}


def test_what_takes_too_long_is_undecided(monkeypatch):
    """An unstable rig whose cycle nobody may look for: nothing is said of it."""
    monkeypatch.setattr(outcomes_module, "_alike", lambda now, before: np.zeros(len(now), dtype=bool))
    monkeypatch.setattr(outcomes_module, "EARLY", np.inf)
    monkeypatch.setattr(spans_module, "MOST_TURNS", 20.0)
    monkeypatch.setattr(spans_module, "MOST_LOADING", 50.0)
    kicked = Kicked(heavy(ss.laws.Aging(), 0.5, 2.5e9), "displacement", 1, "before", {}, 0, None)
    assert kicked.outcomes(np.zeros(1, int), np.array([2.0])).tolist() == [LATE]


def test_doubt_has_a_colour_and_a_reason():
    a_rig = tilted(0.3, 1.2)
    outcome = np.array([["returns", "undecided"], ["blow-up", "returns"]])
    doubt = np.array([["", DOUBTS[0]], ["", ""]])
    found = ss.nonlinear.Basin(a_rig, np.array([-1e-6, 1e-6]), np.array([1e-7, 1e-6]), outcome, doubt, ())
    words = [word.replace("\n", " ") for word in found.plot().get_legend_handles_labels()[1]]
    assert words[1:4] == ["returns", "blow-up", f"undecided: {DOUBTS[0]}"]


# -- folds and ends of the range

CLOSE_TO_A_FOLD = ss.Slider(
    friction=ss.laws.LuGre(mu_coulomb=0.30885889, mu_static=0.4471462411, v_stribeck=3.173016221e-4,
    viscous=0.6422815173,
                      bristle_stiffness=11754.66919, bristle_damping=7.284784178),
    contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=10145846886.0,
    drive=ss.machine.SteadyDrive(1.253958662e-4),
)  # fmt: skip


def test_next_to_a_fold_small_kicks_return():
    """Sliding is steady, and a hundredth slower the forces would no longer balance: the motion is not at that fold."""
    found = Kicked(CLOSE_TO_A_FOLD, "normal-stress", 1, "before", {}, 0, None)
    found.budget = StepBudget(3e5)  # rounding is not followed with tiny steps
    assert set(found.outcomes(np.zeros(24, dtype=int), np.geomspace(1e-6, 1e-3, 24)).tolist()) == {RETURNS}
    rest = found.rest
    assert at_fold(rest, rest.state).tolist() == [True]
    assert at_fold(rest, rest.state, rest.unknowns).tolist() == [False]
    limit = ss.threshold(CLOSE_TO_A_FOLD, "normal-stress")
    assert (limit.decided, limit.outcome) == (True, "no solution")
    assert 0.9 < limit.size < 1.1


def test_a_rig_that_survives_not_even_the_smallest_kick_ends_the_search(monkeypatch):
    """However small the kick, it fails: the bracket goes down to nothing in a few rounds, not for ever."""
    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", doubtful(0.0, 0.0, 0.0))
    found = ss.threshold(tilted(0.3, 1.2), "displacement", precision=1e-3)
    assert found.bracket[0] == 0
    assert 0 < found.bracket[1] < 1e-6
    assert found.outcome == "blow-up"


def test_beyond_an_edge_near_the_end_of_the_range_it_is_looked_at_the_end(monkeypatch):
    """Where all normal stress is nearly gone, a hundredth more would be more than there is."""
    a_rig, tried = tilted(0.3, 1.2), []

    def made(runs, threads=None, advanced=None):
        size = -runs.rest.pressure / runs.rest.sigmas[0]
        tried.append(float(np.max(size)))
        return np.where(size < 0.995, RETURNS, BLOW_UP)

    monkeypatch.setattr("steadyslip.nonlinear.kicks.kicks.outcomes_of", made)
    monkeypatch.setattr(threshold_module, "edges", lambda *_: np.array([0.995]))
    found = ss.threshold(a_rig, "normal-stress", direction=-1)
    assert (found.edge, found.outcome) == (True, "blow-up")
    assert tried[-1] == pytest.approx(0.999)


def test_where_the_balance_has_no_fold_no_state_is_at_one():
    """Forces of a press with a controller rise with velocity everywhere; the answer has one entry a rig."""
    press = next(contact for contact in CONTACTS if contact.name == "triaxial")
    a_rig = rig(friction=rate_state(evolution=ss.laws.PRZ(), regularised=True), contact=press, stiffness=9e9,
                drive=ss.machine.PD(1e-6, kp=2e10, kd=1e9))  # fmt: skip
    jobs = prepare(a_rig, (), 1.0, {}, {}, Options())
    assert jobs.reduction.unknowns
    rest = rest_of(jobs, np.full(3, 1e-6), np.zeros(3))
    assert at_fold(rest, rest.state).tolist() == [False] * 3
