"""Cycles and their continuation: against simulation, independent numbers, and laws of nature."""

import csv
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import MU, A, unit_rig
from rigs_of_theory import CONTACTS, rate_state, rig
from steadyslip.files.specifications import read_rig
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.continuation import Failure, Point, Track
from steadyslip.nonlinear.kicks.spans import constant_inputs
from steadyslip.nonlinear.orbits import flow as flow_module, tracer as tracer_module
from steadyslip.nonlinear.orbits.cycle import SpecialCycle
from steadyslip.nonlinear.orbits.flow import Flow, Runs
from steadyslip.nonlinear.orbits.measure import measured
from steadyslip.nonlinear.orbits.shooting import Shooting
from steadyslip.nonlinear.orbits.special import Known, changes
from steadyslip.nonlinear.orbits.tracer import ENDS, STANDING, Tracer, _stands, _winds
from steadyslip.nonlinear.orbits.verify import cycle_near

REFERENCE = Path(__file__).parent / "reference"


def table(name):
    return list(csv.DictReader((REFERENCE / name).read_text("utf-8").splitlines()))


def two_states(kappa=0.08):
    """Theory 4: β = (1, .84), ρ = .048; κ = k d_1/(aσ)."""
    states = (ss.State(b=A, d_c=0.048), ss.State(b=0.84 * A, d_c=1.0))
    law = ss.RateState(a=A, states=states, mu_ref=MU, v_ref=1.0, evolution=ss.Slip())
    stiffness = kappa * A / 0.048
    return ss.Slider(friction=law, contact=ss.Constant(preload=1.0), stiffness=stiffness, drive=ss.Steady(1.0))


@pytest.fixture(scope="module")
def damped():
    """A supercritical branch over many decades."""
    return ss.cycles(unit_rig("slip", 0.5, 0.4, damping=1e-3))


# -- branches


@pytest.mark.parametrize("row", table("stickslip.csv"), ids=lambda r: f"{r['law']} H={r['H']}")
def test_cycles_are_those_of_the_reference(row):
    """Theory 10: found with other tools from other equations."""
    number = {name: float(value) for name, value in row.items() if name != "law"}
    branch = ss.cycles(unit_rig(row["law"], number["lam"], number["kappa"], damping=number["H"]))
    (cycle,) = branch.at(number["kappa"] * A)
    assert cycle.period == pytest.approx(number["period_DOP853"], rel=1e-9)
    assert cycle.stress_drop / A == pytest.approx(number["dtau_DOP853"], rel=1e-8)
    assert np.log(cycle.peak_velocity) == pytest.approx(number["phimax_DOP853"], rel=1e-8)
    assert np.log(cycle.lowest_velocity) == pytest.approx(number["phimin_DOP853"], rel=1e-8)
    assert cycle.stable
    assert cycle.trivial == pytest.approx(1, abs=1e-6)


def test_branch_begins_at_the_edge_with_the_predicted_amplitude(damped):
    assert damped["amplitude"][0] == pytest.approx(1e-6, rel=1e-3)
    assert damped["value"][0] == pytest.approx(damped.onset.value, rel=1e-8)
    assert damped["period"][0] == pytest.approx(2 * np.pi / damped.onset.angular_frequency, rel=1e-8)
    small = (damped["amplitude"] > 3e-2) & (damped["amplitude"] < 0.3)
    assert small.sum() > 2
    expected = damped.onset.velocity_amplitude(damped["value"][small])
    assert damped["amplitude"][small] == pytest.approx(expected, rel=0.06)
    assert np.log10(damped["peak_velocity"][-1] / damped["lowest_velocity"][-1]) > 7.9
    assert damped["stable"].all()
    assert np.abs(damped["trivial"] - 1).max() < 1e-6
    assert damped["slip"] == pytest.approx(damped["period"] * 1.0)


@pytest.mark.parametrize("share", [0.9, 0.5])
def test_cycles_agree_with_simulation(damped, share):
    """Started at the cycle the motion stays there; started elsewhere it comes to it."""
    (cycle,) = damped.at(share * damped.onset.value)
    assert cycle.growth < 0.1
    a_rig = damped.rig.with_values({"stiffness": cycle.value})
    run = ss.simulate(a_rig, until=12 * cycle.period, initial={"x": 1.3 * cycle.start["x"]}, rtol=1e-11)
    peaks = [e for e in run.events if e.kind == "velocity peak"]
    assert peaks[-1].time - peaks[-2].time == pytest.approx(cycle.period, rel=1e-8)
    assert peaks[-1].velocity == pytest.approx(cycle.peak_velocity, rel=1e-7)
    around = ss.orbit(a_rig, cycle)
    assert around["x"][-1] == pytest.approx(around["x"][0], rel=1e-6)


def test_mass_and_aging_turn_back_at_a_fold():
    """Subcritical by theory 6: unstable cycles above the edge, which become stable at a fold."""
    branch = ss.cycles(unit_rig("aging", 0.5, 0.5, mass=0.05))
    assert branch.onset.kind == "subcritical"
    (fold,) = [point for point in branch.special if point.kind == "fold"]
    assert fold.cycle.value > branch.onset.value
    assert max(abs(m) for m in fold.cycle.multipliers) == pytest.approx(1, abs=1e-5)
    before = branch["period"] < fold.cycle.period
    assert not branch["stable"][before].any()
    assert branch["stable"][~before].all()
    middle = 0.5 * (fold.cycle.value + branch.onset.value)
    small, large = branch.at(middle)
    assert not small.stable
    assert large.stable
    assert small.peak_velocity < large.peak_velocity


@pytest.mark.slow
def test_two_state_law_doubles_its_period_where_theory_says():
    """Theory 7: at .8662587 and .8570388 of the critical stiffness."""
    branch = ss.cycles(two_states(), between=(0.8 * two_states().stiffness, 0.02))
    (first,) = [point for point in branch.special if point.kind == "period doubling"]
    assert first.cycle.value / branch.onset.value == pytest.approx(0.8662587, abs=1e-6)
    assert min(m.real for m in first.cycle.multipliers) == pytest.approx(-1, abs=1e-6)
    second = next(point for point in branch.doubled.special if point.kind == "period doubling")
    assert second.cycle.value / branch.onset.value == pytest.approx(0.8570388, abs=1e-6)
    assert branch.doubled["period"][0] == pytest.approx(2 * first.cycle.period, rel=1e-4)
    stable = branch.doubled["value"][branch.doubled["stable"]] / branch.onset.value
    assert (stable.min() > 0.857, stable.max() < 0.8663) == (True, True)


def started(a_rig, **initial):
    """Jobs of one run of a rig, and the kernel's state at its start, at the drive's velocity."""
    one = np.ones(1)
    jobs = prepare(a_rig, None, 1.0, {}, initial, Options())
    jobs = replace(jobs, segments=constant_inputs(one, one * a_rig.drive.velocity, 0 * one, 0 * one))
    state = np.zeros(Runs(jobs).size)
    state[0], state[2:] = jobs.initial[0][0], jobs.initial[0][2:]
    return jobs, state


@pytest.mark.parametrize("mass", [0.0, 1.0])
def test_motion_is_on_a_cycle_only_if_there_is_one(mass, damped):
    """The cycle next to a motion is that of the branch; a motion that settles, or grows, is on none."""
    rigs = [unit_rig("slip", 0.5, kappa, damping=0 if mass else 1e-3, mass=mass) for kappa in (0.4, 1.4)]
    jobs, state = started(rigs[0], x=0.3)
    found = cycle_near(Runs(jobs), state, patience=20)
    (cycle,) = (damped if not mass else ss.cycles(rigs[0], doublings=0)).at(0.4 * A)
    assert found.period == pytest.approx(cycle.period, rel=1e-8)
    assert found.multipliers == pytest.approx(cycle.multipliers, rel=1e-5, abs=1e-8)
    assert cycle_near(Runs(jobs), found._orbit.states[0]).period == pytest.approx(found.period, rel=1e-9)
    jobs, state = started(rigs[1], x=0.3)
    assert cycle_near(Runs(jobs), state, patience=20) is None


def test_windings_that_close_in_on_a_value_are_an_end(damped):
    def folds(values, periods):
        return [
            SpecialCycle("fold", replace(damped.cycles[0], value=v, period=p), (v, v), 0.0)
            for v, p in zip(values, periods, strict=True)
        ]

    closing = 1.0 + (-0.5) ** np.arange(8.0)
    assert _winds(folds(closing, np.arange(1.0, 9.0)))
    assert not _winds(folds(closing, np.ones(8)))
    assert not _winds(folds(closing[:4], np.arange(1.0, 5.0)))
    assert not _winds(folds(1.0 + 0.1 * (-1.0) ** np.arange(8.0), np.arange(1.0, 9.0)))


def test_parameter_that_stands_still_is_an_end(damped):
    base = damped.cycles[0]

    def along(values, periods):
        return [replace(base, value=v, period=p) for v, p in zip(values, periods, strict=True)]

    rounding = 1.0 + 1e-12 * (-1.0) ** np.arange(STANDING)
    assert _stands(along(rounding, np.geomspace(1.0, 1.04, STANDING)))
    assert not _stands(along(rounding, np.geomspace(1.0, 1.2, STANDING)))  # a canard that goes on
    assert not _stands(along(1.0 + 1e-9 * np.arange(STANDING), np.ones(STANDING)))
    assert not _stands(along(rounding[1:], np.ones(STANDING - 1)))


def test_multipliers_are_not_read_where_the_parameter_stands_still(damped):
    looked = []

    def read(u):
        looked.append(u)
        raise Failure("enough")

    def known(value, multiplier):
        cycle = replace(damped.cycles[-1], value=value, multipliers=(multiplier, 0.01))
        shooting = SimpleNamespace(flow=SimpleNamespace(size=3), multipliers=read)
        return Known(Point(np.zeros(2), np.ones(2), 0.0, 1), shooting, cycle, np.zeros(2))

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
        assert measured(shooting, u).turns == {1: 1, 2: 2, 3: 3, 6: 2}[turns]
    tracer = Tracer(flow, damped.onset, (0.0, 1.0), 10)
    with pytest.raises(Failure, match="run through 2 times"):
        tracer.resumed(replace(orbit, period=2 * orbit.period), 1.0)


@pytest.mark.parametrize(("lam", "damping"), [(0.25, 1e-8), (1.0, 1e-8), (2.0, 1e-4)])
def test_aging_cycles_have_the_period_that_simulation_shows(lam, damping):
    """Of the issue's scan: the smaller the damping, the more the branch stands on end at the edge."""
    a_rig = unit_rig("aging", lam, 0.5 * lam, damping=damping)
    branch = ss.cycles(a_rig, between=(0.49 * lam * A, 1.2 * lam * A))
    assert np.abs(np.diff(np.log(branch["period"]))).max() < np.log(1.9)
    (cycle,) = branch.at(0.5 * lam * A)
    run = ss.simulate(a_rig, until=8 * cycle.period, initial={"x": -2.0}, rtol=1e-9)
    peaks = [e.time for e in run.events if e.kind == "velocity peak"]
    assert np.diff(peaks)[-1] == pytest.approx(cycle.period, rel=1e-7)


@pytest.mark.parametrize("mass", [1e-6, 1e-9])
def test_smallest_masses_lead_to_the_stable_cycles(mass):
    """The branch is not lost where rounding over mass is all that is left of the acceleration."""
    branch = ss.cycles(unit_rig("aging", 0.5, 0.5, mass=mass), between=(0.5 * 0.5 * A, 1.2 * 0.5 * A))
    assert "end of the range" in branch.end
    assert branch.gaps == ()
    cycle = branch.cycles[-1]
    assert cycle.stable
    a_rig = branch.rig.with_values({"stiffness": cycle.value})
    run = ss.simulate(a_rig, until=16 * cycle.period, initial={"x": -2.0}, rtol=1e-9)
    peaks = [e for e in run.events if e.kind == "velocity peak" and e.velocity > 10]
    assert peaks[-1].time - peaks[-2].time == pytest.approx(cycle.period, rel=1e-6)


def test_sheet_that_breaks_off_is_found_again_by_simulation(damped, monkeypatch):
    """What lies beyond is the same as without the break; the gap is said, and `at` simulates in it."""
    onset, broken = damped.onset, 0.8 * damped.onset.value
    real = Tracer.known

    def known(self, shooting, point):
        found = real(self, shooting, point)
        if 0.7 * onset.value < found.cycle.value < broken:
            raise Failure("a hole")
        return found

    monkeypatch.setattr(Tracer, "known", known)
    branch = ss.cycles(damped.rig, between=(0.3 * onset.value, 1.1 * onset.value))
    monkeypatch.undo()
    assert len(branch.gaps) == 1
    assert "a hole" in branch.broken[0]
    assert "another sheet, found by simulation" in str(branch)
    for share in (0.95, 0.75, 0.5):
        (cycle,), (same,) = branch.at(share * onset.value), damped.at(share * onset.value)
        assert cycle.period == pytest.approx(same.period, rel=1e-9)
    assert branch.to_dict()["gaps"][0]["before"] == branch.gaps[0]


def test_cycles_on_sheets_of_their_own_are_found_where_they_are_asked_for():
    """Two states, among irregular motion: one large slip event and two small ones, on no sheet from the edge."""
    states = (ss.State(b=0.0185158760, d_c=8.909265618e-6), ss.State(b=0.0160886248, d_c=3.90524125e-5))
    friction = ss.RateState(a=0.0151007230, mu_ref=0.6, v_ref=9.268313582e-7, states=states)
    a_rig = ss.Slider(friction=friction, contact=ss.Constant(preload=1.38968961e7), stiffness=2e10,
                      radiation_damping=5.337161414e8, drive=ss.Steady(9.268313582e-7))  # fmt: skip
    edge = ss.hopf(a_rig).value
    branch = ss.cycles(a_rig, between=(0.79 * edge, 1.01 * edge), doublings=0)
    *unstable, cycle = branch.at(0.8 * edge)
    assert cycle.stable
    assert not any(one.stable for one in unstable)
    start = {name: number for name, number in cycle.start.items() if name != "v"}  # which follows from memory
    until = 60 * cycle.period
    run = ss.simulate(a_rig.with_values({"stiffness": 0.8 * edge}), until=until, initial=start, rtol=1e-9)
    peaks = np.array([event.time for event in run.events if event.kind == "velocity peak"])
    assert len(peaks) == 3 * 60
    assert np.diff(peaks[::3]) == pytest.approx(cycle.period, rel=1e-6)
    assert not branch.at(1.005 * edge)  # motions settle there


@pytest.mark.slow
def test_lead_screw_is_followed_through_its_windings_to_sticking():
    """LuGre: the branch doubles, winds round one stiffness, and goes on from a simulated cycle as stick-slip."""
    example = read_rig(Path(__file__).parents[1] / "examples" / "lead-screw.toml", [])
    branch = ss.cycles(example, doublings=0)
    assert "end of the range" in branch.end
    flip = next(point for point in branch.special if point.kind == "period doubling")
    assert min(m.real for m in flip.cycle.multipliers) == pytest.approx(-1, abs=1e-5)
    for value in (110e9, 40e9):
        (cycle,) = (one for one in branch.at(value) if one.stable)
        a_rig = example.with_values({"stiffness": value})
        run = ss.simulate(a_rig, until=300 * 2 * np.pi / branch.onset.angular_frequency, initial={"x": 1e-7}, rtol=1e-9)
        peaks = [e for e in run.events if e.kind == "velocity peak"]
        high = [e.time for e in peaks if e.velocity > 0.99 * cycle.peak_velocity]
        assert high[-1] - high[-2] == pytest.approx(cycle.period, rel=1e-6)


def test_branch_remembers_its_steady_state_and_tolerance(damped):
    assert (damped.steady, damped.rtol) == (0, None)
    coarse = ss.cycles(damped.rig, most_points=30, rtol=1e-7)
    assert coarse.rtol == 1e-7
    value = 0.5 * (coarse["value"][-1] + coarse["value"][-2])
    errors = [abs(branch.at(value)[0].period / damped.at(value)[0].period - 1) for branch in (coarse, damped)]
    assert errors[0] > 10 * errors[1]


def test_massless_branch_ends_in_blow_up():
    branch = ss.cycles(paper(30))
    assert branch.end.startswith("blow-up")
    assert not branch["stable"].any()
    assert (branch["value"] > branch.onset.value * (1 - 1e-7)).all()
    assert branch["value"].max() > 1.005 * branch.onset.value


def test_degenerate_edge_carries_the_closed_orbits_of_the_reference():
    """Theory 10, orbits.csv and Gu's invariant: all cycles at one stiffness."""
    branch = ss.cycles(unit_rig("slip", 0.5, 0.6), most_points=60)
    assert branch["value"] == pytest.approx(np.full(len(branch), 0.5 * A), rel=1e-7)
    assert (np.diff(branch["period"][20:40]) > 0).all()


def paper(angle, **more):
    memory = ss.LinkerDieterich(alpha=0.56)
    rock = ss.RateState(a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=memory, evolution=ss.Slip())
    contact = ss.InclinedSpring(preload=5e6, angle=np.radians(angle))
    return ss.Slider(friction=rock, contact=contact, stiffness=9e9, drive=ss.Steady(1e-6), **more)


@pytest.mark.parametrize(
    "a_rig",
    [
        paper(-45),
        paper(30),
        paper(60),
        unit_rig("slip", 0.2, 0.2, damping=0.05),
        unit_rig("aging", 1.0, 1.0, damping=0.3),
        unit_rig("slip", 0.2, 0.2, mass=0.3),
        unit_rig("aging", 0.2, 0.2, mass=0.02),
        unit_rig("aging", 0.5, 0.5, mass=1.0),
    ],
    ids=["-45", "30", "60", "slip H=.05", "aging H=.3", "slip M=.3", "aging M=.02", "aging M=1"],
)
def test_small_cycles_have_the_predicted_amplitude_stable_or_not(a_rig):
    """Theory 6 against the cycles themselves: velocity and stress, with an error that falls with the amplitude."""
    branch = ss.cycles(a_rig, most_points=60, doublings=0)
    errors = []
    for low, high in ((0.1, 0.3), (0.02, 0.1)):
        inside = np.flatnonzero((branch["amplitude"] > low) & (branch["amplitude"] < high))
        cycle = branch.cycles[inside[len(inside) // 2]]
        assert cycle.stable == (branch.onset.kind == "supercritical")
        velocity = branch.onset.velocity_amplitude(cycle.value)
        stress = branch.onset.stress_amplitude(cycle.value)
        errors.append([abs(cycle.amplitude / velocity - 1), abs(0.5 * cycle.stress_drop / stress - 1)])
    assert max(errors[0]) < 0.06
    assert max(errors[1]) < 0.02


def test_another_parameter_leads_to_the_same_cycle(damped):
    """Along the drive velocity, H and the cycles in its units are those along the stiffness."""
    a_rig = unit_rig("slip", 0.5, 0.4, damping=1e-2)
    along_velocity = ss.cycles(a_rig, "drive.velocity", between=(0.5, 12.0))
    along_stiffness = ss.cycles(a_rig)
    one = along_velocity.at(1.0)[0]
    other = along_stiffness.at(0.4 * A)[0]
    assert one.period == pytest.approx(other.period, rel=1e-8)
    assert one.peak_velocity == pytest.approx(other.peak_velocity, rel=1e-7)
    assert one.multipliers == pytest.approx(other.multipliers, rel=1e-4, abs=1e-8)


def test_range_and_interruption(damped):
    value = damped.onset.value
    branch = ss.cycles(damped.rig, between=(0.9 * value, 1.1 * value))
    assert branch["value"][-1] == pytest.approx(0.9 * value, rel=1e-7)
    assert "end of the range" in branch.end

    def stop(count, cycle):
        if count == 7:
            raise KeyboardInterrupt

    partial = ss.cycles(damped.rig, progress=stop)
    assert (len(partial), partial.end) == (7, "interrupted by the user")


def test_ctrl_c_keeps_what_there_is_wherever_it_comes(damped, monkeypatch):
    """While a simulation looks for another sheet, and at the start of the branch of twice the period."""
    between = (0.9 * damped.onset.value, 1.1 * damped.onset.value)

    def stop(*_arguments):
        raise KeyboardInterrupt

    def broken(self, before, now, first, twice):
        return (ENDS["growth"], True) if now.cycle.amplitude > 0.1 else ("", True)

    with monkeypatch.context() as patched:
        patched.setattr(Tracer, "_finished", broken)
        patched.setattr(sys.modules["steadyslip.nonlinear.orbits.search"], "cycle_near", stop)
        partial = ss.cycles(damped.rig, between=between)
    assert (len(partial) > 3, partial.end, partial.gaps) == (True, "interrupted by the user", ())

    def flips(before, now, made, index):
        return [SpecialCycle("period doubling", now.cycle, (0.0, 1.0), 0.0, index)] if index == 5 else []

    with monkeypatch.context() as patched:
        patched.setattr(sys.modules["steadyslip.nonlinear.orbits.tracer"], "changes", flips)
        patched.setattr(Tracer, "doubled", stop)
        partial = ss.cycles(damped.rig, between=between)
    assert (partial.doubled, partial.end) == (None, "interrupted by the user")
    assert partial["value"][-1] == pytest.approx(between[0], rel=1e-7)


def test_no_small_cycle_at_the_edge_is_no_traceback(damped, monkeypatch):
    """Nothing is found at the edge: simulation still leads to the stable cycles."""

    def fails(*_arguments):
        raise Failure("no convergence")

    monkeypatch.setattr(Tracer, "small", fails)
    branch = ss.cycles(damped.rig, between=(0.4 * damped.onset.value, 1.1 * damped.onset.value))
    (cycle,), (same,) = branch.at(0.5 * damped.onset.value), damped.at(0.5 * damped.onset.value)
    assert cycle.period == pytest.approx(same.period, rel=1e-9)
    monkeypatch.setattr(sys.modules["steadyslip.nonlinear.orbits.search"], "cycle_near", lambda *_: None)
    nothing = ss.cycles(damped.rig)
    assert (len(nothing), nothing.at(damped.onset.value)) == (0, ())
    assert "no small cycle was found" in nothing.end
    assert "no small cycle" in str(nothing)
    assert nothing.plot().lines
    assert nothing.to_dict()["cycles"] == []


def test_a_reason_is_kept_where_the_edge_fails(damped, monkeypatch):
    """No small cycle, and the sheet that simulation leads to breaks off before the edge: both are said."""
    onset, real = damped.onset, Tracer.known

    def fails(*_arguments):
        raise Failure("no convergence")

    def known(self, shooting, point):
        found = real(self, shooting, point)
        if found.cycle.value > 0.9 * onset.value:
            raise Failure("a hole")
        return found

    monkeypatch.setattr(Tracer, "small", fails)
    monkeypatch.setattr(Tracer, "known", known)
    branch = ss.cycles(damped.rig, between=(0.4 * onset.value, 1.1 * onset.value))
    assert branch.gaps[0] == 0
    assert "no small cycle was found" in branch.broken[0]
    assert "no small cycle was found" in str(branch)
    assert branch.to_dict()["gaps"][0] == {"before": 0, "end": branch.broken[0]}
    assert branch.plot().lines


def test_files_and_figure(damped, tmp_path):
    data = damped.to_xarray()
    assert data.sizes["point"] == len(damped)
    assert data["stress_drop"].attrs["units"] == "Pa"
    damped.to_csv(tmp_path / "branch.csv")
    head = (tmp_path / "branch.csv").read_text().splitlines()[0]
    assert head.startswith("slider.stiffness (Pa/m),period (s)")
    ax = damped.plot()
    assert ax.get_xlabel() == "stiffness (mPa/m)"
    assert "stable cycle" in ax.get_legend_handles_labels()[1]
    plain = damped.to_dict()
    assert len(plain["cycles"]) == len(damped)
    assert plain["cycles"][0]["multipliers"][0] == [pytest.approx(1), 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"along": "stifness"}, "stiffness"),
        ({"between": (1.0, 2.0)}, "must contain the edge"),
        ({"between": (2.0, 1.0)}, "low < high"),
        ({"amplitude": 3.0}, "up to 0.1"),
    ],
)
def test_bad_arguments_are_named(damped, options, message):
    with pytest.raises(ss.SteadyslipError, match=message):
        ss.cycles(damped.rig, **options)


def test_prescribed_normal_stress_has_no_cycles_of_its_own():
    contact = ss.Prescribed(preload=5e6, amplitude=1e5, period=3.0)
    with pytest.raises(ss.NotAvailable, match="prescribed"):
        ss.cycles(ss.Slider(friction=rate_state(), contact=contact, stiffness=1e9, drive=ss.Steady(1e-6)))


def test_command_line_writes_branch_and_thresholds(tmp_path):
    """Files by their ending, JSON that is JSON, and errors in words."""
    import json

    from command import run
    from test_command_line import EXAMPLE

    stick_slip = EXAMPLE.with_name("stick-slip.toml")
    files = [str(tmp_path / name) for name in ("b.nc", "b.csv", "b.svg")]
    found = run("cycles", stick_slip, "--between", "20 GPa/m", "30 GPa/m", *(w for f in files for w in ("-o", f)))
    assert found.returncode == 0, found.stderr
    assert "end of the range, 20 GPa/m" in found.stdout
    assert all(Path(file).stat().st_size > 500 for file in files)
    data = json.loads(run("cycles", stick_slip, "--between", "24 GPa/m", "30 GPa/m", "--json").stdout)
    assert data["cycles"][-1]["value"] == pytest.approx(24e9)
    kicks = json.loads(
        run("threshold", EXAMPLE, "--set", "stiffness=40 GPa/m", "--kick", "displacement", "--json").stdout
    )
    assert kicks[0]["unit"] == "m"
    assert kicks[0]["bracket"][0] <= kicks[0]["size"] <= kicks[0]["bracket"][1]
    bad = run("threshold", EXAMPLE, "--kick", "shove")
    assert (bad.returncode, "unknown kick 'shove'" in bad.stderr) == (2, True)
    bad = run("cycles", stick_slip, "-o", str(tmp_path / "b.doc"), "--between", "24 GPa/m", "30 GPa/m")
    assert (bad.returncode, "allowed endings" in bad.stderr) == (2, True)


# -- AUTO-07p: collocation, other variables, another program


@pytest.mark.parametrize("angle", [30, -45])
def test_branch_of_the_paper_s_rig_is_that_of_auto(angle):
    """Numbers of AUTO-07p 0.9.2 (NTST = 300, NCOL = 6); its period in d_c/v0, x in d_c, found with tests/auto."""
    branch = ss.cycles(paper(angle))
    rows = [row for row in table("auto_branch.csv") if float(row["angle_deg"]) == angle]
    for row in rows:
        (cycle,) = branch.at(float(row["k_over_kcr"]) * branch.onset.value)
        assert cycle.period == pytest.approx(float(row["period"]), rel=1e-9)
        around = ss.orbit(branch.rig.with_values({"stiffness": cycle.value}), cycle)
        assert around["x"].max() / 1e-6 == pytest.approx(float(row["x_max"]), rel=2e-4)


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("auto-07p") and shutil.which("gfortran")), reason="AUTO-07p is not installed")
def test_auto_itself_agrees(tmp_path):
    for name in ("paper.f90", "c.paper", "follow.auto"):
        shutil.copy(Path(__file__).parent / "auto" / name, tmp_path)
    subprocess.run(["auto-07p", "follow.auto"], cwd=tmp_path, check=True, capture_output=True, timeout=300)
    lines = [line.split() for line in (tmp_path / "b.cycles").read_text().splitlines()]
    found = {float(w[4]): float(w[8]) for w in lines if len(w) == 9 and w[2] == "-4"}
    branch = ss.cycles(paper(30))
    assert len(found) == 3
    for ratio, period in found.items():
        (cycle,) = branch.at(ratio * branch.onset.value)
        assert cycle.period == pytest.approx(period, rel=1e-8)


def test_work_is_bounded_and_what_it_found_is_kept(monkeypatch):
    """A rig whose steps are tiny is not followed for minutes; as far as it goes, cycles are the same."""
    whole = ss.cycles(unit_rig("slip", 0.5, 0.6), most_points=60)
    monkeypatch.setattr(tracer_module, "MOST_STEPS", 20_000)
    part = ss.cycles(unit_rig("slip", 0.5, 0.6), most_points=60)
    assert 0 < len(part) < len(whole)
    assert part.end.startswith("0.02 million steps of integration taken")
    assert [cycle.period for cycle in part] == list(part["period"])
    with pytest.raises(KeyError, match="did you mean 'period'"):
        part["perod"]
    np.testing.assert_array_equal(part["period"], whole["period"][: len(part)])


def test_cycles_end_where_no_velocity_balances_the_forces(monkeypatch):
    """A pad that lifts with velocity, without mass: forces fold, and what lies beyond has no velocity to tell.

    The cycle comes as close to the fold as steps allow, which takes ever more of them, but not minutes.
    """
    monkeypatch.setattr("steadyslip.nonlinear.orbits.flow.MOST_STEPS", 20_000)
    friction = rate_state(evolution=ss.PRZ(), regularised=True)
    lift = next(contact for contact in CONTACTS if contact.name == "lift")
    branch = ss.cycles(
        rig(friction=friction, contact=lift, stiffness=9e9, drive=ss.PD(1e-6, kp=2e10, kd=1e9)), doublings=0
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

    curve, points = Track(steep), []
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

    curve = Track(circle)
    low = curve.start(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    high = curve.corrected(np.array([np.cos(0.6), np.sin(0.6)]), low.tangent, np.sin(0.6))
    measure = lambda point: point.u[0] - np.cos(0.4)  # noqa: E731
    found = curve.located(low, high, measure, measure(low), measure(high))[1]
    assert found.u == pytest.approx([np.cos(0.4), np.sin(0.4)], abs=1e-9)


def test_a_branch_begins_at_larger_cycles_where_small_ones_drown_in_rounding():
    """An onset so nearly degenerate that the edge moves by a millionth while cycles grow a thousandfold."""
    friction = ss.LuGre(mu_coulomb=0.1189310343, mu_static=0.1882742085, v_stribeck=1.6888334216e-3,
                        viscous=2.3663122754, bristle_stiffness=255249.776917, bristle_damping=7.12855521)  # fmt: skip
    contact = ss.InclinedSpring(preload=1292214.83, angle=-0.05289007)
    heavy = ss.Slider(friction=friction, contact=contact, stiffness=1e10, mass=962.847238,
                      drive=ss.Steady(1.5017969314e-3))  # fmt: skip
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
