"""What motion of machines obeys: energy, eigenvalues, other names, idle bodies, masses that vanish, jumps."""

import dataclasses

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, brake, rate_state, same_block, surface, two_blocks, two_mass
from moving_machines import FINE, TIMES, slopes_of_motion


def test_the_work_of_the_drive_is_dissipated_or_stored():
    """Two blocks on springs: what the load point does equals friction, dashpots, springs and kinetic energy."""
    machine = two_blocks(0.6, -0.1, 0.3)
    damped = {**machine.links, "hose": ss.machine.Spring(between=("one", "two"), damping=0.2)}
    machine = dataclasses.replace(machine, links=damped)
    times = np.linspace(0.0, 15.0, 6001)
    run = ss.simulate(machine, ss.protocol.VelocityStep(at=0.0, to=1.5), times=times, until=15.0, **FINE)
    one, two, load = run["one.displacement"], run["two.displacement"], run["load_displacement"]
    resting = [run[f"{name}.friction_force"][0] for name in ("one", "two")]

    def work(power):
        return np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))])

    # what springs are stretched by in steady sliding, from the balance of each block
    stretch = np.linalg.solve([[0.9, -0.3], [-0.3, 0.9]], resting)
    pulls = [0.6 * (stretch[i] + load - place) for i, place in enumerate((one, two))]
    stored = sum(0.5 * pull**2 / 0.6 for pull in pulls) + 0.15 * (stretch[0] - stretch[1] - (one - two)) ** 2
    moving = 0.05 * (run["one.v"] ** 2 + run["two.v"] ** 2)
    rubbed = sum(work(run[f"{name}.friction_force"] * run[f"{name}.slip_rate"]) for name in ("one", "two"))
    damped_away = work(0.2 * (run["one.v"] - run["two.v"]) ** 2)
    driven = work(sum(pulls) * run["load_velocity"])
    energy = stored + moving
    lost = driven - rubbed - damped_away - (energy - energy[0])
    assert np.max(np.abs(lost)) < 1e-5 * driven[-1]
    assert np.max(np.abs(energy - energy[0])) > 1e-2 * driven[-1] / 15


def test_growth_and_period_of_small_motion_are_those_of_the_eigenvalues():
    for machine, contact in ((two_mass(kp=1.0), "guide"), (brake(rate_state(0.02, -0.01, 0.5)), "disc")):
        leading = max(ss.eigenvalues(machine), key=lambda one: (one.real, one.imag))
        period = 2 * np.pi / leading.imag
        times = np.linspace(0.0, 8 * period, 1601)
        body = next(iter(machine.bodies))
        run = ss.simulate(machine, initial={f"{body}.x": 1e-7}, times=times, until=times[-1], rtol=1e-11)
        tail = times > 2 * period  # what dies out faster is gone
        x = run[f"{body}.x"][tail]
        waves = np.exp(leading * times[tail])
        columns = np.column_stack([waves.real, waves.imag])
        fitted = columns @ np.linalg.lstsq(columns, x, rcond=None)[0]
        others = [one.real for one in ss.eigenvalues(machine) if abs(abs(one.imag) - leading.imag) > 1e-9]
        gap = leading.real - max(others)
        assert np.max(np.abs(fitted - x)) < (1e-3 + np.exp(-gap * 2 * period)) * np.max(np.abs(x))
        assert run[f"{contact}.slip_rate"].min() > 0


@pytest.mark.parametrize("seed", range(16))
@pytest.mark.campaign
def test_small_motion_has_the_eigenvalues_of_the_linear_verdict(seed):
    """Machines of one to four bodies, some without mass: two routes from the Model to the same numbers."""
    machine = at_random(seed)[0]
    jacobian, rates, _ = slopes_of_motion(machine)
    found, wanted = np.linalg.eigvals(jacobian), ss.eigenvalues(machine)
    assert len(found) == len(wanted)
    assert np.max(np.abs(rates)) < 1e-12
    for s in wanted:
        assert np.min(np.abs(found - s)) < 1e-7 * np.max(np.abs(wanted))


def test_bodies_without_mass_take_every_form():
    forms = (slopes_of_motion(at_random(seed)[0])[2].form for seed in range(16))
    wanted = {"explicit", "eliminated"}
    for form in forms:
        wanted.discard(form)
        if not wanted:
            break
    assert not wanted


def test_light_bodies_move_as_those_of_little_mass():
    """Two blocks without mass, joined by a dashpot: their balances are solved together after a jump."""
    own = [rate_state(0.3, 0.1, 1.0), rate_state(0.2, -0.05, 2.0)]
    apart = []

    def blocks(mass):
        return ss.Machine(
            bodies={name: ss.machine.SlidingBody(mass=mass) for name in ("one", "two")},
            links={
                "pull": ss.machine.Spring(between=("drive", "one"), stiffness=0.5),
                "hold": ss.machine.Spring(between=("drive", "two"), stiffness=0.4),
                "joint": ss.machine.Spring(between=("one", "two"), stiffness=0.3, damping=0.4),
            },
            contacts={"first": surface("one", own[0]), "second": surface("two", own[1])},
            drive=ss.machine.Pull(velocity=1.0),
        )

    pulse = [ss.protocol.DisturbancePulse(at=1.0, by=0.2, duration=3.0, on="two")]
    assert slopes_of_motion(blocks(0.0))[2].form == "eliminated"
    light = ss.simulate(blocks(0.0), pulse, times=TIMES, until=20.0, **FINE)
    assert light.status == "done"
    after = np.searchsorted(TIMES, 1.0)
    assert light["second.slip_rate"][after] > 1.2  # at once
    for mass in (1e-3, 1e-4):
        heavy = ss.simulate(blocks(mass), pulse, times=TIMES, until=20.0, **FINE)
        settled = (TIMES > 1.5) & (np.abs(TIMES - 4.0) > 0.5)
        apart.append(np.max(np.abs(heavy["two.v"] - light["two.v"])[settled]))
    assert apart[1] < 1e-3
    assert apart[0] / apart[1] == pytest.approx(10, rel=0.3)


def test_names_do_not_matter():
    machine = two_blocks(0.45, -0.1, 0.2)
    turned = ss.Machine(
        bodies={"zwei": machine.bodies["two"], "eins": machine.bodies["one"]},
        links={
            "c": ss.machine.Spring(between=("eins", "zwei"), stiffness=0.2),
            "b": ss.machine.Spring(between=("drive", "zwei"), stiffness=0.45),
            "a": ss.machine.Spring(between=("drive", "eins"), stiffness=0.45),
        },
        contacts={
            "y": dataclasses.replace(machine.contacts["two"], body="zwei"),
            "x": dataclasses.replace(machine.contacts["one"], body="eins"),
        },
        drive=machine.drive,
    )
    step = ss.protocol.VelocityStep(at=1.0, to=1.3)
    first, second = (ss.simulate(m, step, times=TIMES, until=20.0, **FINE) for m in (machine, turned))
    for own, other in (("one", "eins"), ("two", "zwei")):
        assert second[f"{other}.v"] == pytest.approx(first[f"{own}.v"], abs=1e-8)
    for own, other in (("one", "x"), ("two", "y")):
        assert second[f"{other}.friction_force"] == pytest.approx(first[f"{own}.friction_force"], abs=1e-8)
    kinds = [(e.kind, round(e.time, 5)) for e in first.events]
    assert sorted(kinds) == sorted((e.kind, round(e.time, 5)) for e in second.events)
    assert kinds


def test_an_idle_body_changes_nothing_and_a_stiff_link_little():
    machine, step = two_mass(kp=1.0), ss.protocol.VelocityStep(at=1.0, to=1.2)
    alone = ss.simulate(machine, step, times=TIMES, until=20.0, **FINE)
    idle = dataclasses.replace(
        machine,
        bodies={**machine.bodies, "lamp": ss.machine.SlidingBody(mass=0.0)},
        links={**machine.links, "hook": ss.machine.Spring(between=("table", "lamp"), stiffness=3.0)},
    )
    hung = ss.simulate(idle, step, times=TIMES, until=20.0, **FINE)
    assert hung["table.v"] == pytest.approx(alone["table.v"], abs=1e-9)
    assert hung["lamp.v"] == pytest.approx(alone["table.v"], abs=1e-9)
    apart, ends = [], ("table", "load")
    for size in (1e4, 1e5):  # half of the table's mass beyond a link that hardly gives
        split = dataclasses.replace(
            machine,
            bodies={
                **machine.bodies,
                "table": ss.machine.SlidingBody(mass=2.0),
                "load": ss.machine.SlidingBody(mass=3.0),
            },
            links={**machine.links, "bolts": ss.machine.Spring(between=ends, stiffness=size, damping=0.05 * size)},
        )
        run = ss.simulate(split, step, times=TIMES, until=20.0, **FINE)
        apart.append(np.max(np.abs(run["table.v"] - alone["table.v"])))
    assert apart[1] < 1e-4
    assert apart[0] / apart[1] == pytest.approx(10, rel=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_a_machine_of_one_body_moves_as_a_slider(seed):
    block, machine = same_block(seed)
    pieces = [
        ss.protocol.VelocityStep(at=0.5, to=1.3),
        ss.protocol.DisturbanceStep(at=1.0, by=0.02),
        ss.protocol.NormalStressStep(at=2.0, by=0.05),
    ]
    own, other = (ss.simulate(rig, pieces, times=TIMES, until=20.0) for rig in (block, machine))
    assert own.status == other.status
    assert own.steps == pytest.approx(other.steps, abs=2)
    names = {"v": "block.v", "x": "block.x", "slip": "base.slip", "shear_stress": "base.friction_force",
             "normal_stress": "base.normal_force", "acceleration": "block.acceleration"}  # fmt: skip
    for name, machine_name in names.items():
        assert other[machine_name] == pytest.approx(own[name], rel=1e-9, abs=1e-9), name
    assert [e.kind for e in own.events] == [e.kind for e in other.events]
    assert [e.time for e in own.events] == pytest.approx([e.time for e in other.events], rel=1e-8)


def test_a_jump_of_the_load_point_leaves_all_where_they_are():
    """Also what turns behind a screw: it falls behind by its own share."""
    machine = ss.Machine(
        bodies={"table": ss.machine.SlidingBody(mass=1.0), "nut": ss.machine.RotatingBody(inertia=0.2)},
        links={
            "pull": ss.machine.Spring(between=("drive", "table"), stiffness=2.0),
            "screw": ss.machine.Screw(between=("nut", "table"), lead=0.5, stiffness=5.0, damping=0.3),
        },
        contacts={"guide": surface("table", rate_state(0.5, 0.1, 1.0))},
        drive=ss.machine.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, ss.protocol.DisplacementStep(at=1.0, by=0.3), until=3.0)
    (before,) = np.flatnonzero(np.diff(run["t"]) == 0)
    for name in ("table.displacement", "nut.displacement", "nut.v", "guide.slip", "guide.slip_rate"):
        assert run[name][before + 1] == pytest.approx(run[name][before], abs=1e-12), name
    assert run["nut.x"][before + 1] - run["nut.x"][before] == pytest.approx(-0.3 / 0.5)
    assert run["nut.displacement"][before] == pytest.approx(2.0)
    assert run["table.acceleration"][before + 1] == pytest.approx(2.0 * 0.3)
    assert run.units["nut.v"] == "rad/s"
