"""Branches of cycles: against simulation, independent numbers, AUTO, and laws of nature."""

import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import A, two_states, unit_rig
from steadyslip.files.specifications import read_rig

TESTS = Path(__file__).parents[2]


def table(name):
    return list(csv.DictReader((TESTS / "reference" / name).read_text("utf-8").splitlines()))


ROWS = [
    pytest.param(row, marks=[pytest.mark.campaign] * ((row["law"], float(row["H"])) == ("aging", 1e-4)))
    for row in table("stickslip.csv")
]


@pytest.mark.parametrize("row", ROWS, ids=lambda r: f"{r['law']} H={r['H']}")
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


@pytest.mark.parametrize(
    ("lam", "damping"), [(0.25, 1e-8), pytest.param(1.0, 1e-8, marks=pytest.mark.campaign), (2.0, 1e-4)]
)
def test_aging_cycles_have_the_period_that_simulation_shows(lam, damping):
    """Of the issue's scan: the smaller the damping, the more the branch stands on end at the edge."""
    a_rig = unit_rig("aging", lam, 0.5 * lam, damping=damping)
    branch = ss.cycles(a_rig, between=(0.49 * lam * A, 1.2 * lam * A))
    assert np.abs(np.diff(np.log(branch["period"]))).max() < np.log(1.9)
    (cycle,) = branch.at(0.5 * lam * A)
    run = ss.simulate(a_rig, until=8 * cycle.period, initial={"x": -2.0}, rtol=1e-9)
    peaks = [e.time for e in run.events if e.kind == "velocity peak"]
    assert np.diff(peaks)[-1] == pytest.approx(cycle.period, rel=1e-7)


@pytest.mark.parametrize("mass", [pytest.param(1e-6, marks=pytest.mark.campaign), 1e-9])
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


def test_cycles_on_sheets_of_their_own_are_found_where_they_are_asked_for():
    """Two states, among irregular motion: one large slip event and two small ones, on no sheet from the edge."""
    states = (ss.laws.State(b=0.0185158760, d_c=8.909265618e-6), ss.laws.State(b=0.0160886248, d_c=3.90524125e-5))
    friction = ss.laws.RateState(a=0.0151007230, mu_ref=0.6, v_ref=9.268313582e-7, states=states)
    a_rig = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.38968961e7), stiffness=2e10,
                      radiation_damping=5.337161414e8, drive=ss.machine.SteadyDrive(9.268313582e-7))  # fmt: skip
    edge = ss.hopf(a_rig).value
    branch = ss.cycles(a_rig, between=(0.79 * edge, 1.01 * edge), doublings=0)
    *unstable, cycle = branch.at(0.8 * edge)
    assert cycle.stable
    assert not any(one.stable for one in unstable)
    until = 60 * cycle.period
    run = ss.simulate(a_rig.with_values({"stiffness": 0.8 * edge}), until=until, initial=cycle.start, rtol=1e-9)
    peaks = np.array([event.time for event in run.events if event.kind == "velocity peak"])
    assert len(peaks) == 3 * 60
    assert np.diff(peaks[::3]) == pytest.approx(cycle.period, rel=1e-6)
    assert not branch.at(1.005 * edge)  # motions settle there


@pytest.mark.slow
def test_lead_screw_is_followed_through_its_windings_to_sticking():
    """LuGre: the branch doubles, winds round one stiffness, and goes on from a simulated cycle as stick-slip."""
    example = read_rig(TESTS.parent / "examples" / "lead-screw.toml", [])
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
    memory = ss.laws.LinkerDieterich(alpha=0.56)
    rock = ss.laws.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=memory, evolution=ss.laws.Slip()
    )
    contact = ss.laws.InclinedSpring(preload=5e6, angle=np.radians(angle))
    return ss.Slider(friction=rock, contact=contact, stiffness=9e9, drive=ss.machine.SteadyDrive(1e-6), **more)


@pytest.mark.parametrize(
    "a_rig",
    [
        paper(-45),
        paper(30),
        paper(60),
        unit_rig("slip", 0.2, 0.2, damping=0.05),
        unit_rig("aging", 0.2, 0.2, mass=0.02),
        *(
            pytest.param(one, marks=pytest.mark.campaign)
            for one in (
                unit_rig("aging", 1.0, 1.0, damping=0.3),
                unit_rig("slip", 0.2, 0.2, mass=0.3),
                unit_rig("aging", 0.5, 0.5, mass=1.0),
            )
        ),
    ],
    ids=["-45", "30", "60", "slip H=.05", "aging M=.02", "aging H=.3", "slip M=.3", "aging M=1"],
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


@pytest.mark.parametrize("angle", [30, -45])
def test_branch_of_the_paper_s_rig_is_that_of_auto(angle):
    """Numbers of AUTO-07p 0.9.2 (NTST = 300, NCOL = 6); its period in d_c/v0, x in d_c, found with tests/auto."""
    branch = ss.cycles(paper(angle))
    rows = [row for row in table("auto_branch.csv") if float(row["angle_deg"]) == angle]
    for row in rows[::2]:
        (cycle,) = branch.at(float(row["k_over_kcr"]) * branch.onset.value)
        assert cycle.period == pytest.approx(float(row["period"]), rel=1e-9)
        around = ss.orbit(branch.rig.with_values({"stiffness": cycle.value}), cycle)
        assert around["x"].max() / 1e-6 == pytest.approx(float(row["x_max"]), rel=2e-4)


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("auto-07p") and shutil.which("gfortran")), reason="AUTO-07p is not installed")
def test_auto_itself_agrees(tmp_path):
    for name in ("paper.f90", "c.paper", "follow.auto"):
        shutil.copy(TESTS / "auto" / name, tmp_path)
    subprocess.run(["auto-07p", "follow.auto"], cwd=tmp_path, check=True, capture_output=True, timeout=300)
    lines = [line.split() for line in (tmp_path / "b.cycles").read_text().splitlines()]
    found = {float(w[4]): float(w[8]) for w in lines if len(w) == 9 and w[2] == "-4"}
    branch = ss.cycles(paper(30))
    assert len(found) == 3
    for ratio, period in found.items():
        (cycle,) = branch.at(ratio * branch.onset.value)
        assert cycle.period == pytest.approx(period, rel=1e-8)
