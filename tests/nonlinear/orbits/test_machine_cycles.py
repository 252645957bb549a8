"""Cycles of machines: those of a slider, of motion, of its small perturbations; energy; nothing of names."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from machines import renamed, same_block, two_mass
from steadyslip.nonlinear.orbits import follow, tracer
from steadyslip.nonlinear.orbits.flow import FEW_STEPS
from structure_work_at_random import drawn

EXAMPLES = Path(__file__).parents[3] / "examples" / "machines"
KP, LOW = "drive.kp", 1.5


@cache
def branch():
    return ss.cycles(two_mass(), KP, between=(LOW, 10.0))


@cache
def cycle():
    """One of a factor of several in velocity."""
    (found,) = branch().at(1.6)
    return found


def looks(one):
    return np.array([one.period, one.peak_velocity, one.lowest_velocity, one.stress_drop, one.growth, one.slip])


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.campaign), 7])
def test_a_machine_of_one_body_has_the_cycles_of_its_slider(seed):
    block, machine = same_block(seed)
    k = ss.hopf(block).value
    ends = (0.5 * k, 2 * k)
    (own,), (found,) = (
        ss.cycles(rig, along, between=ends).at(0.7 * k)
        for rig, along in ((block, "stiffness"), (machine, "links.spring.stiffness"))
    )
    np.testing.assert_allclose(looks(found), looks(own), rtol=1e-5)
    assert (found.stable, found.contact, set(found.contacts)) == (own.stable, "base", {"base"})
    assert found.start["block.x"] == pytest.approx(own.start["x"], rel=1e-6)


def test_small_cycles_are_those_that_the_onset_foretells():
    found, onset = branch(), ss.hopf(two_mass(), KP)
    small = next(one for one in found.cycles if one.amplitude > 3e-3)
    assert onset.kind == "supercritical"
    assert small.amplitude == pytest.approx(float(onset.velocity_amplitude(small.value)), rel=1e-3)
    assert small.stress_drop == pytest.approx(2 * float(onset.stress_amplitude(small.value)), rel=1e-3)
    assert small.period == pytest.approx(2 * np.pi / onset.angular_frequency, rel=1e-4)


def test_a_motion_started_on_a_cycle_comes_back_to_it():
    one, machine = cycle(), two_mass().with_values({KP: cycle().value})
    times = np.linspace(0.0, one.period, 401)
    run = ss.simulate(machine, until=times[-1], times=times, initial=one.start, rtol=1e-11)
    for name, value in one.start.items():
        np.testing.assert_allclose(run[name][[0, -1]], value, rtol=1e-6, atol=1e-7, err_msg=name)
    speed, pull = run["guide.slip_rate"], run["guide.friction_force"]
    assert speed.max() == pytest.approx(one.peak_velocity, rel=1e-3)
    assert speed.min() == pytest.approx(one.lowest_velocity, rel=1e-3)
    assert speed[0] == pytest.approx(one.speed, rel=1e-7)
    # energy: what the controller does is lost in friction and in the screw
    held = 0.6 - one.value * run["motor.x"] - 0.1 * (run["motor.v"] - 1)
    work = held * run["motor.v"] - pull * run["table.v"] - 0.5 * (run["motor.v"] - run["table.v"]) ** 2
    mean = np.trapezoid(work, times) / one.period
    assert abs(mean) < 1e-6 * np.trapezoid(np.abs(work), times) / one.period + 1e-6


def test_multipliers_are_those_of_perturbed_motions():
    one, machine = cycle(), two_mass().with_values({KP: cycle().value})
    names, step = list(one.start), 1e-5
    count = len(names)
    sides = np.concatenate([np.eye(count), -np.eye(count)]) * step
    start = {name: one.start[name] + sides[:, i] for i, name in enumerate(names)}
    same = np.full(2 * count, one.value)
    ends = ss.simulate_many(machine, {KP: same}, until=one.period, initial=start, rtol=1e-11, progress=False).final
    last = np.array([ends[name] for name in names])
    matrix = (last[:, :count] - last[:, count:]) / (2 * step)
    found = np.linalg.eigvals(matrix)
    found = found[np.argsort(-np.abs(found))]
    expected = np.array(sorted([1.0 + 0j, *one.multipliers], key=lambda m: -abs(m)))
    np.testing.assert_allclose(np.abs(found[:4]), np.abs(expected[:4]), rtol=1e-4, atol=1e-6)
    assert one.trivial == pytest.approx(1.0, abs=1e-7)


def test_long_motions_come_to_the_stable_cycle():
    one, machine = cycle(), two_mass().with_values({KP: cycle().value})
    run = ss.simulate_many(machine, {KP: [one.value]}, until=60 * one.period, initial={"table.v": 1.3}, progress=False)
    assert one.stable
    assert run.events["guide.peak_period"][0] == pytest.approx(one.period, rel=1e-5)
    assert run.events["guide.velocity_peaks"][0] > 50


def test_names_and_an_idle_body_change_nothing():
    machine = two_mass()
    idle = replace(
        machine, bodies={**machine.bodies, "idle": ss.machine.SlidingBody(mass=0.3)},
        links={**machine.links, "held": ss.machine.Spring(between=("drive", "idle"), stiffness=5.0, damping=0.4)},
    )  # fmt: skip
    (found,) = ss.cycles(renamed(idle), KP, between=(LOW, 10.0)).at(cycle().value)
    apart = np.abs(looks(found) / looks(cycle()) - 1)
    assert apart[3] < 1e-4  # forces are seen at the solver's steps, not located
    assert np.delete(apart, 3).max() < 1e-6


def test_tables_and_words_are_in_forces(tmp_path):
    found = branch()
    text, data = str(found), found.to_dict()
    assert "force swing  up to" in text
    assert "at guide" in text
    assert "Pa" not in text
    one = data["cycles"][-1]
    assert one["contact"] == "guide"
    assert one["contacts"]["guide"]["force_drop"] == one["force_drop"]
    assert not any("stress" in name for name in one)
    found.to_csv(tmp_path / "cycles.csv")
    header = (tmp_path / "cycles.csv").read_text().splitlines()[0]
    assert header.startswith("drive.kp (N/m),period (s)")
    assert "guide.force_drop (N)" in header
    assert found.to_xarray()["force_drop"].attrs["units"] == "N"
    np.testing.assert_array_equal(found["guide.peak_velocity"], found["peak_velocity"])
    axes = found.plot()
    assert axes.get_xlabel() == r"drive proportional gain $k_{\mathrm{p}}$ (N/m)"
    assert axes.get_ylabel() == "highest and lowest velocity at guide (m/s)"


def carriages(left, velocity):
    """Two carriages on a plate that the drive moves; springs hold the left one to the ground."""
    return ss.Machine(
        bodies={"left": ss.machine.SlidingBody(mass=1.0), "right": ss.machine.SlidingBody(mass=2.0)},
        links={
            "ground": ss.machine.Spring(between=("ground", "left"), stiffness=3e3, damping=1.0),
            "bar": ss.machine.Spring(between=("left", "right"), stiffness=2e3),
        },
        contacts={
            "one": ss.machine.Surface(body="drive", against="left", friction=left,
            contact=ss.laws.ConstantNormalStress(preload=10.0)),
            "two": ss.machine.Surface(
                body="drive", against="right", contact=ss.laws.ConstantNormalStress(preload=20.0),
                friction=ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.5, v_stribeck=5e-3),
            ),
        },
        drive=ss.machine.Pull(velocity=velocity),
    )  # fmt: skip


def test_small_cycles_are_found_beside_forces_that_are_far_larger_than_theirs():
    """Friction of 15 N, of which a cycle changes some micronewtons: rounding of the sum is much of that."""
    bristles = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.5, v_stribeck=5e-3, bristle_stiffness=1e4, bristle_damping=20, stribeck_exponent=1
    )
    machine = carriages(bristles, 4e-3)
    edge = ss.boundary(machine, "drive.velocity")[0].value  # the slowest; the nearest is a subcritical one
    slow = machine.with_values({"drive.velocity": edge})
    found = ss.cycles(slow, "drive.velocity", between=(0.999 * edge, 1.00002 * edge), doublings=0)
    assert found.onset.kind == "supercritical"
    assert found.end.startswith("end of the range")
    assert not found.special
    assert all(one.stable for one in found.cycles)
    for one in found.cycles:
        assert one.amplitude == pytest.approx(float(found.onset.velocity_amplitude(one.value)), rel=0.15)


@pytest.mark.campaign
def test_a_frame_that_rings_ten_thousand_times_a_cycle_does_not_lead_its_steps():
    """The side blocks' frames have no dashpots, and hardly move in the cycle; its equations would ring with them."""
    example = ss.read_rig(EXAMPLES / "two-surfaces.toml")
    machine = example.with_values({f"links.{side}-frame.damping": 0.0 for side in ("left", "right")})
    onset = ss.hopf(machine, "links.ram.stiffness")
    found = ss.cycles(machine, "links.ram.stiffness", between=(0.999 * onset.value, 1.001 * onset.value), most_points=3)
    assert len(found) == 3
    assert all(one.stable for one in found.cycles)
    assert found.cycles[0].period == pytest.approx(2 * np.pi / onset.angular_frequency, rel=1e-5)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "along", "end"),
    [
        ("two-surfaces", "links.ram.stiffness", "end of the range"),
        ("feed-axis", "drive.kp", "the cycles grow without bound"),
        ("telescope", "drive.kp", "the cycles grow without bound"),
    ],
)
def test_branches_of_ringing_machines_come_to_an_end(name, along, end):
    found = ss.cycles(ss.read_rig(EXAMPLES / f"{name}.toml"), along, doublings=0)
    assert found.end.startswith(end)
    assert np.mean([cycle.checks[0].passed for cycle in found]) > 0.99


@pytest.mark.campaign
def test_a_table_that_turns_round_in_its_cycle_is_followed_through_its_ringing():
    """Beside the table that sticks the motor rings, and slip begins, or only just does, at any of its swings."""
    axis = ss.read_rig(EXAMPLES / "feed-axis.toml")
    found = ss.cycles(axis, "drive.kp", between=(0.038, 1.0), doublings=0)
    assert found.end.startswith("end of the range")
    assert [one.kind for one in found.special] == ["fold", "fold", "period doubling", "period doubling"]
    late = [one for one in found.cycles if one.peak_velocity > 1e-3]
    assert (np.diff([one.value for one in late]) < 0).all()
    assert (np.diff([one.peak_velocity for one in late]) > 0).all()


def test_a_branch_of_a_structure_takes_the_steps_allowed_and_says_what_leads_further(monkeypatch):
    (machine, _, along), made = drawn(2), []
    monkeypatch.setattr(tracer, "MOST_STEPS", 200_000)
    monkeypatch.setattr(follow, "Tracer", lambda *given: made.append(tracer.Tracer(*given)) or made[-1])
    branch = ss.cycles(machine, along)
    allowed = 200_000 * (3 / 7) ** 2  # seven variables
    assert len(branch) > 10  # cycles that were found are kept
    assert allowed <= made[0].flow.steps <= 1.25 * allowed + FEW_STEPS  # of one run
    assert branch.end.endswith(
        "million steps of integration taken, all that are spent on this part; ask for the rest with "
        "between=(low, high), or give structures fewer modes (kept_modes) or more damping"
    )
