"""Motion of machines: against equations typed by hand, energy, eigenvalues, one-body machines, names, idle bodies."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import steadyslip as ss
from command import run
from machines import at_random, brake, coulomb, rate_state, same_block, surface, two_blocks, two_mass
from steadyslip.model.point import operating_point
from steadyslip.model.reduction import SLOPES, TIME, P, Q, reduce_model
from steadyslip.model.scales import eliminable

ROOT = Path(__file__).parents[1]
FINE = {"rtol": 1e-10}


def radau(right, start, times):
    done = solve_ivp(right, (0.0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-9, atol=1e-11)
    assert done.success
    return done.y


def agree(history, name, values, size=1.0):
    assert np.max(np.abs(history[name] - values)) < 2e-6 * size


TIMES = np.linspace(0.0, 20.0, 201)


def law(machine, contact="guide"):
    own = machine.contacts[contact]
    return own.friction, own.contact.preload


def friction(own, load, v, theta):
    """Rate and state in terms of Θ = ln(v* θ/d_c), the slip law of the fixtures."""
    return load * (own.mu_ref + own.a * np.log(v / own.v_ref) + own.b * theta)


def aging(own, v, theta):
    return -v / own.d_c * (np.log(v / own.v_ref) + theta)


@pytest.fixture(scope="module")
def axis():
    return two_mass(kp=1.0)


def test_a_two_mass_axis_with_a_step_of_the_drive_and_a_push(axis):
    own, load = law(axis)
    pieces = [ss.VelocityStep(at=0.0, to=1.2), ss.DisturbanceStep(at=0.0, by=0.05, on="table")]
    run = ss.simulate(axis, pieces, times=TIMES, until=20.0, **FINE)
    resting = friction(own, load, 1.0, 0.0)

    def right(t, y):
        motor, table, v, w, theta = y
        ahead = motor - (1.2 - 1.0) * t, table - (1.2 - 1.0) * t  # of what the drive asks
        screw = 100.0 * (motor - table) + 0.5 * (v - w)
        control = -1.0 * ahead[0] - 0.1 * (v - 1.2)
        return [v - 1, w - 1, (control - screw) / 2, (screw + resting - friction(own, load, w, theta) + 0.05) / 5,
                aging(own, w, theta)]  # fmt: skip

    motor, table, v, w, theta = radau(right, [0, 0, 1, 1, 0], TIMES)
    agree(run, "motor.displacement", motor + TIMES)
    agree(run, "table.displacement", table + TIMES)
    agree(run, "motor.v", v)
    agree(run, "table.v", w)
    agree(run, "guide.slip_rate", w)
    agree(run, "guide.Theta", theta)
    agree(run, "guide.friction_force", friction(own, load, w, theta))
    agree(run, "guide.slip", table + TIMES)
    assert run.units["guide.friction_force"] == "N"


def test_two_unlike_blocks_on_a_load_point_that_jumps():
    machine = two_blocks(0.5, -0.1, 0.1)
    laws = [machine.contacts[name].friction for name in ("one", "two")]
    run = ss.simulate(machine, ss.DisplacementStep(at=0.0, by=0.1), times=TIMES, until=20.0, **FINE)
    resting = [friction(own, 1.0, 1.0, 0.0) for own in laws]

    def right(t, y):
        x, v, theta = y[:2], y[2:4], y[4:]
        spring = -0.5 * (x - 0.1) - 0.1 * (x - x[::-1])
        push = [(spring[i] + resting[i] - friction(laws[i], 1.0, v[i], theta[i])) / 0.1 for i in range(2)]
        return [*(v - 1), *push, *(aging(laws[i], v[i], theta[i]) for i in range(2))]

    found = radau(right, [0, 0, 1, 1, 0, 0], TIMES)
    for i, name in enumerate(("one", "two")):
        agree(run, f"{name}.v", found[2 + i])
        agree(run, f"{name}.x", found[i] - 0.1)  # behind the load point that jumped
        agree(run, f"{name}.Theta", found[4 + i])


def test_flutter_of_a_pad_on_coulomb_friction_that_is_regularised():
    machine = brake(coulomb(1.1 * 0.4166666666666667))
    times = np.linspace(0.0, 30.0, 301)
    run = ss.simulate(machine, ss.NormalStressStep(at=0.0, by=0.01), times=times, until=30.0, **FINE)
    assert run.status == "done"
    mu = 1.1 * 0.4166666666666667
    stiff = np.array([[1.0, 0.3], [0.3, 1.2]])

    def right(t, y):
        x, v = y[:2], y[2:]
        normal = -0.8 * x[1] + 0.01
        force = -(stiff - np.diag([0, 0.8])) @ x + np.array([-mu * normal, normal])
        return [*(v - np.array([0, 0])), *force]

    found = radau(right, [0, 0, 0, 0], times)
    size = np.abs(found[0]).max()
    assert size < 0.9  # the pad never stops: friction keeps its sign
    agree(run, "pad.x", found[0], size)
    agree(run, "pad.normal.x", found[1], size)
    steady = ss.steady_state(machine).contacts["disc"].normal_force
    agree(run, "disc.normal_force", steady + 0.01 - 0.8 * found[1], size)


def test_the_friction_of_a_gear_grows_with_the_torque_it_carries():
    tilt = -0.3
    own = rate_state(0.5, -0.1, 1.0, mu=0.3)
    teeth = ss.InclinedSpring(preload=1.0, angle=tilt)
    machine = ss.Machine(
        bodies={"motor": ss.SlidingBody(mass=1.0), "load": ss.SlidingBody(mass=2.0, force=-0.1)},
        links={"gear": ss.Spring(between=("motor", "load"), stiffness=20.0, damping=0.3)},
        contacts={
            "mesh": ss.Surface(body="motor", friction=own, contact=teeth, loaded_by="gear"),
            "guide": surface("load", rate_state(0.4, 0.1, 2.0, mu=0.2)),
        },
        drive=ss.PositionPD(velocity=1.0, body="motor", kp=3.0, kd=0.4),
    )
    guide = machine.contacts["guide"].friction
    run = ss.simulate(machine, initial={"load.v": 1.3}, times=TIMES, until=20.0, **FINE)
    carried = friction(guide, 1.0, 1.0, 0.0) + 0.1  # by the teeth in steady sliding

    def pressed(force):  # that of the teeth on the motor is -force
        return 1.0 + force * np.tan(tilt)

    at_rest = friction(own, pressed(carried), 1.0, 0.0)

    def right(t, y):
        x, z, v, w, theta, phi = y
        force = carried + 20.0 * (x - z) + 0.3 * (v - w)
        control = carried + at_rest - 3.0 * x - 0.4 * (v - 1)
        rub = friction(own, pressed(force), v, theta)
        return [v - 1, w - 1, control - force - rub, (force - 0.1 - friction(guide, 1.0, w, phi)) / 2,
                aging(own, v, theta), aging(guide, w, phi)]  # fmt: skip

    x, z, v, w, theta, _ = radau(right, [0, 0, 1, 1.3, 0, 0], TIMES)
    agree(run, "motor.v", v)
    agree(run, "load.v", w)
    agree(run, "mesh.Theta", theta)
    agree(run, "mesh.normal_force", pressed(carried + 20.0 * (x - z) + 0.3 * (v - w)))
    agree(run, "links.gear.force", carried + 20.0 * (x - z) + 0.3 * (v - w))


# -- what follows from the machine as a whole


def test_the_work_of_the_drive_is_dissipated_or_stored():
    """Two blocks on springs: what the load point does equals friction, dashpots, springs and kinetic energy."""
    machine = two_blocks(0.6, -0.1, 0.3)
    damped = {**machine.links, "hose": ss.Spring(between=("one", "two"), damping=0.2)}
    machine = dataclasses.replace(machine, links=damped)
    times = np.linspace(0.0, 15.0, 6001)
    run = ss.simulate(machine, ss.VelocityStep(at=0.0, to=1.5), times=times, until=15.0, **FINE)
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


def test_names_do_not_matter():
    machine = two_blocks(0.45, -0.1, 0.2)
    turned = ss.Machine(
        bodies={"zwei": machine.bodies["two"], "eins": machine.bodies["one"]},
        links={
            "c": ss.Spring(between=("eins", "zwei"), stiffness=0.2),
            "b": ss.Spring(between=("drive", "zwei"), stiffness=0.45),
            "a": ss.Spring(between=("drive", "eins"), stiffness=0.45),
        },
        contacts={
            "y": dataclasses.replace(machine.contacts["two"], body="zwei"),
            "x": dataclasses.replace(machine.contacts["one"], body="eins"),
        },
        drive=machine.drive,
    )
    step = ss.VelocityStep(at=1.0, to=1.3)
    first, second = (ss.simulate(m, step, times=TIMES, until=20.0, **FINE) for m in (machine, turned))
    for own, other in (("one", "eins"), ("two", "zwei")):
        assert second[f"{other}.v"] == pytest.approx(first[f"{own}.v"], abs=1e-8)
    for own, other in (("one", "x"), ("two", "y")):
        assert second[f"{other}.friction_force"] == pytest.approx(first[f"{own}.friction_force"], abs=1e-8)
    kinds = [(e.kind, round(e.time, 5)) for e in first.events]
    assert sorted(kinds) == sorted((e.kind, round(e.time, 5)) for e in second.events)
    assert kinds


def test_an_idle_body_changes_nothing_and_a_stiff_link_little():
    machine, step = two_mass(kp=1.0), ss.VelocityStep(at=1.0, to=1.2)
    alone = ss.simulate(machine, step, times=TIMES, until=20.0, **FINE)
    idle = dataclasses.replace(
        machine,
        bodies={**machine.bodies, "lamp": ss.SlidingBody(mass=0.0)},
        links={**machine.links, "hook": ss.Spring(between=("table", "lamp"), stiffness=3.0)},
    )
    hung = ss.simulate(idle, step, times=TIMES, until=20.0, **FINE)
    assert hung["table.v"] == pytest.approx(alone["table.v"], abs=1e-9)
    assert hung["lamp.v"] == pytest.approx(alone["table.v"], abs=1e-9)
    apart, ends = [], ("table", "load")
    for size in (1e4, 1e5):  # half of the table's mass beyond a link that hardly gives
        split = dataclasses.replace(
            machine,
            bodies={**machine.bodies, "table": ss.SlidingBody(mass=2.0), "load": ss.SlidingBody(mass=3.0)},
            links={**machine.links, "bolts": ss.Spring(between=ends, stiffness=size, damping=0.05 * size)},
        )
        run = ss.simulate(split, step, times=TIMES, until=20.0, **FINE)
        apart.append(np.max(np.abs(run["table.v"] - alone["table.v"])))
    assert apart[1] < 1e-4
    assert apart[0] / apart[1] == pytest.approx(10, rel=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_a_machine_of_one_body_moves_as_a_slider(seed):
    block, machine = same_block(seed)
    pieces = [
        ss.VelocityStep(at=0.5, to=1.3),
        ss.DisturbanceStep(at=1.0, by=0.02),
        ss.NormalStressStep(at=2.0, by=0.05),
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


# -- which contact does what


def two_tables(**changes):
    """Two tables on one belt, each on its own guide; the second one's law goes through rest."""
    return ss.Machine(
        bodies={"front": ss.SlidingBody(mass=1.0), "back": ss.SlidingBody(mass=1.0)},
        links={
            "belt": ss.Spring(between=("drive", "front"), stiffness=5.0, damping=0.2),
            "bar": ss.Spring(between=("front", "back"), stiffness=8.0, damping=0.2),
        },
        contacts={
            "dry": surface("front", rate_state(0.3, 0.1, 1.0), load=2.0),
            "oiled": surface("back", rate_state(0.1, 0.05, 1.0, regularised=True), load=1.0),
        },
        drive=ss.Pull(velocity=1.0),
    )


def test_the_contact_that_lifts_off_is_named():
    lift = ss.NormalStressRamp(at=1.0, by=-3.0, duration=10.0, on="oiled")
    run = ss.simulate(two_tables(), lift, until=20.0)
    assert run.status == "contact lost"
    assert run.contact == "oiled"
    assert run.message.startswith("contact lost (oiled) at 4.33")
    assert run.end == pytest.approx(1 + 10 / 3, rel=1e-6)
    assert run.events[-1].kind == "contact lost"
    assert run.to_dict()["contact"] == "oiled"
    silent = ss.simulate(two_tables(), lift, until=20.0, events=False)
    assert (silent.status, silent.contact) == ("contact lost", "oiled")
    assert run.events[-1].normal_force == pytest.approx(0.0, abs=1e-6)
    assert ss.simulate(two_tables(), dataclasses.replace(lift, on="dry"), until=20.0).contact == "dry"


def test_the_contact_that_sticks_is_named_and_one_may_reverse():
    back = ss.DisturbancePulse(at=1.0, by=-6.0, duration=0.5, on="back")
    run = ss.simulate(two_tables(), back, until=20.0)
    assert run.status == "done"
    kinds = [(e.contact, e.kind) for e in run.events if e.kind in ("arrest", "restart")]
    assert kinds.count(("oiled", "arrest")) == kinds.count(("oiled", "restart")) >= 2
    assert ("dry", "arrest") not in kinds
    assert run.velocities["oiled"][0] < -0.1
    assert run.velocities["dry"][0] > 0
    for event in run.events:
        series = run[f"{event.contact}.friction_force"], run[f"{event.contact}.slip"]
        assert event.normal_force == pytest.approx({"dry": 2.0, "oiled": 1.0}[event.contact])
        force, slip = (np.interp(event.time, run["t"], values) for values in series)
        assert event.friction_force == pytest.approx(force, abs=0.02)
        assert event.slip == pytest.approx(slip, abs=1e-3)
    slips = run.slip_events
    assert {one.contact for one in slips} == {"dry", "oiled"}
    for one in slips:
        inside = (run["t"] >= one.begin) & (run["t"] <= one.end)
        assert run[f"{one.contact}.slip_rate"][inside].max() == pytest.approx(one.peak_velocity, rel=1e-3)
        ends = np.interp([one.begin, one.end], run["t"], run[f"{one.contact}.slip"])
        assert ends[1] - ends[0] == pytest.approx(one.slip, rel=1e-3)


def test_many_machines_move_as_each_alone():
    pulse = ss.DisturbancePulse(at=1.0, by=-6.0, duration=0.5, on="back")
    stiff = [3.0, 8.0, 30.0]
    many = ss.simulate_many(two_tables(), {"links.bar.stiffness": stiff}, pulse, until=20.0, times=TIMES)
    for i, k in enumerate(stiff):
        alone = ss.simulate(two_tables().with_values({"links.bar.stiffness": k}), pulse, until=20.0, times=TIMES)
        assert many.status[i] == alone.status
        for name in ("front.v", "oiled.slip_rate", "dry.normal_force", "links.bar.force"):
            assert many.samples[name][i] == pytest.approx(alone[name], rel=1e-9, abs=1e-9)
        for contact in ("dry", "oiled"):
            own = [one for one in alone.slip_events if one.contact == contact]
            assert many.events[f"{contact}.events"][i] == len(own)
            if not own:
                continue
            assert many.events[f"{contact}.event_force_drop"][i] == pytest.approx(own[-1].force_drop, rel=1e-6)
            assert many.events[f"{contact}.event_slip"][i] == pytest.approx(own[-1].slip, rel=1e-6)
            arrests = [e for e in alone.events if e.contact == contact and e.kind == "arrest"]
            assert many.events[f"{contact}.arrests"][i] == len(arrests)
    assert many.events["dry.events"].sum() > 0
    assert many.to_xarray()["event_dry.event_force_drop"].attrs["units"] == "N"


def test_runs_of_machines_in_files(tmp_path):
    run = ss.simulate(two_tables(), ss.DisturbancePulse(at=1.0, by=-4.0, duration=0.5, on="back"), until=5.0)
    run.save(tmp_path / "run.nc")
    again = ss.load_history(tmp_path / "run.nc")
    assert (again.rig, again.protocol, again.events, again.velocities) == (
        run.rig, run.protocol, run.events, run.velocities,
    )  # fmt: skip
    assert str(again) == str(run)
    for name, values in run.items():
        assert np.array_equal(again[name], values)
    run.to_csv(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert "oiled.friction_force (N)" in header
    assert "Pa" not in header
    assert "oiled" in ss.report(run).html


@pytest.mark.parametrize(
    ("pieces", "said"),
    [
        ([ss.DisturbanceStep(at=1, by=1.0)], "pieces.1.on: missing; name the body that disturbance-step acts on"),
        ([ss.NormalStressStep(at=1, by=1.0, on="belt")], "unknown contact 'belt'"),
        (
            [ss.DisturbanceStep(at=1, by=1.0, on="front"), ss.DisturbanceStep(at=2, by=1.0, on="back")],
            "allowed: one body a run",
        ),
        ([ss.DisplacementStep(at=1, by=1.0)], "a displacement step through a dashpot"),
    ],
)
def test_what_cannot_be_done_to_a_machine(pieces, said):
    with pytest.raises(ss.ParameterError, match=said):
        ss.simulate(two_tables(), pieces, until=5.0)


def test_starting_values_of_machines():
    with pytest.raises(ss.ParameterError, match=r"initial\.table\.w.*front\.v"):
        ss.simulate(two_tables(), until=1.0, initial={"table.w": 1.0})
    with pytest.raises(ss.ParameterError, match="make dry slip at -1 m/s"):
        ss.simulate(two_tables(), until=1.0, initial={"front.v": -1.0})
    with pytest.raises(ss.ParameterError, match="a slider is one block"):
        ss.simulate(same_block(0)[0], ss.DisturbanceStep(at=1, by=1.0, on="front"), until=5.0)


# -- the equations of motion behind it


def slopes_of_motion(machine):
    """Jacobian of the rates of motion in steady sliding, and the rates there."""
    point = operating_point(machine)
    model, reduction = point.model, reduce_model(point.model, eliminable(point))
    at = dict(model.steady) | dict.fromkeys((P, Q, TIME, *SLOPES[:3]), sp.Integer(0))
    for one in reduction.slidings:
        if one.variable is not None:
            at[one.variable.w] = one.variable.w_of_v.xreplace(model.steady)
    wanted = [*(e for row in reduction.jacobian() for e in row), *reduction.rates]
    numbers = point.evaluate(model.function(sp.sympify(e).xreplace(at) for e in wanted))
    n = len(reduction.state)
    values = np.array([float(value) for value in numbers])
    return values[: n * n].reshape(n, n), values[n * n :], reduction


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
    forms = {slopes_of_motion(at_random(seed)[0])[2].form for seed in range(16)}
    assert forms >= {"explicit", "eliminated"}


def test_light_bodies_move_as_those_of_little_mass():
    """Two blocks without mass, joined by a dashpot: their balances are solved together after a jump."""
    own = [rate_state(0.3, 0.1, 1.0), rate_state(0.2, -0.05, 2.0)]
    apart = []

    def blocks(mass):
        return ss.Machine(
            bodies={name: ss.SlidingBody(mass=mass) for name in ("one", "two")},
            links={
                "pull": ss.Spring(between=("drive", "one"), stiffness=0.5),
                "hold": ss.Spring(between=("drive", "two"), stiffness=0.4),
                "joint": ss.Spring(between=("one", "two"), stiffness=0.3, damping=0.4),
            },
            contacts={"first": surface("one", own[0]), "second": surface("two", own[1])},
            drive=ss.Pull(velocity=1.0),
        )

    pulse = [ss.DisturbancePulse(at=1.0, by=0.2, duration=3.0, on="two")]
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


def test_pore_fluid_follows_in_motion():
    own = rate_state(0.3, -0.05, 1.0)
    wet = ss.PoreFluid(preload=1.0, suction=0.05, drainage=1.3, slip_distance=0.7, v_ref=1.0)
    machine = ss.Machine(
        bodies={"block": ss.SlidingBody(mass=1.0)},
        links={"spring": ss.Spring(between=("drive", "block"), stiffness=0.5)},
        contacts={"gouge": ss.Surface(body="block", friction=own, contact=wet)},
        drive=ss.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, ss.VelocityStep(at=0, to=1.5), times=TIMES, until=20.0, **FINE)

    def right(t, y):
        x, v, theta, dilation, pressure = y
        opening = -v / 0.7 * (dilation - 0.05 * np.log(v))
        pull = own.mu_ref - 0.5 * (x - 0.5 * t)
        return [v - 1, pull - (1 - pressure) * friction(own, 1.0, v, theta), aging(own, v, theta), opening,
                -1.3 * pressure - opening]  # fmt: skip

    found = radau(right, [0, 1, 0, 0, 0], TIMES)
    agree(run, "block.v", found[1])
    agree(run, "gouge.dilation", found[3])
    agree(run, "gouge.pore_pressure", found[4])
    still = dataclasses.replace(machine, bodies={"block": ss.SlidingBody(mass=0.0)})
    assert slopes_of_motion(still)[2].form == "eliminated"
    jacobian = slopes_of_motion(still)[0]
    assert np.sort_complex(np.linalg.eigvals(jacobian)) == pytest.approx(np.sort_complex(ss.eigenvalues(still)))


def test_a_file_of_a_machine_is_run_in_its_own_units(tmp_path):
    done = run(
        "simulate", ROOT / "examples/machines/feed-axis.toml", "--until", "10 s",
        "--protocol", "velocity-step at=1s to='0.06 rpm'",
        "--protocol", "disturbance-pulse at=5s by='100 N' duration=1s on=table", "--json", "-o", tmp_path / "run.csv",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["status"] == "done"
    assert found["units"]["motor.v"] == "rad/s"
    assert found["units"]["guide.normal_force"] == "N"
    assert found["final"]["load_velocity"] == pytest.approx(0.06 * 2 * np.pi / 60)
    assert found["final"]["guide.normal_force"] == pytest.approx(3000.0)
    assert "motor.v (rad/s)" in (tmp_path / "run.csv").read_text().splitlines()[0]
    wrong = run(
        "simulate", ROOT / "examples/machines/feed-axis.toml", "--until", "10 s",
        "--protocol", "velocity-step at=1s to='1 mm/s'",
    )  # fmt: skip
    assert wrong.returncode == 2
    assert "rad/s" in wrong.stderr


def test_friction_that_acts_on_its_own_normal_force_is_solved_for():
    """A self-energising contact with memory of normal stress: τ stands in ln σ(τ), on a block that another drags."""
    own = rate_state(0.02, -0.01, 1.0, mu=0.4, normal_memory=ss.LinkerDieterich(alpha=0.2, sigma_ref=1.0))
    machine = ss.Machine(
        bodies={"one": ss.SlidingBody(mass=1.0), "two": ss.SlidingBody(mass=2.0)},
        links={
            "pull": ss.Spring(between=("drive", "two"), stiffness=1.0, damping=0.1),
            "bar": ss.Spring(between=("two", "one"), stiffness=3.0, damping=0.1),
        },
        contacts={"wedge": ss.Surface(body="one", friction=own, contact=ss.SelfEnergising(preload=1.0, gain=0.3))},
        drive=ss.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, initial={"two.v": 1.2}, times=TIMES, until=20.0, **FINE)
    assert run.status == "done"
    memory = "wedge.Psi" if "wedge.Psi" in run else "wedge.Phi"

    def rub(v, kept):
        """τ with Ψ = bΘ + α ln σ as it is."""
        return brentq(lambda t: t - (1 + 0.3 * t) * (0.4 + own.a * np.log(v) + kept - 0.2 * np.log(1 + 0.3 * t)), 0, 2)

    resting = 0.4 / (1 - 0.3 * 0.4)
    start = 0.2 * np.log(1 + 0.3 * resting)

    def right(t, y):
        x, z, v, w, kept = y
        bar = 3.0 * (z - x) + 0.1 * (w - v)
        theta = (kept - 0.2 * np.log(1 + 0.3 * rub(v, kept))) / own.b
        return [
            v - 1,
            w - 1,
            bar + resting - rub(v, kept),
            (-z - 0.1 * (w - 1) - bar) / 2,
            own.b * aging(own, v, theta),
        ]

    assert rub(1.0, start) == pytest.approx(resting, rel=1e-9)
    found = radau(right, [0, 0, 1, 1.2, start], TIMES)
    agree(run, "one.v", found[2])
    agree(run, "two.v", found[3])
    scale = own.b if memory == "wedge.Phi" else 1.0
    agree(run, memory, found[4] / scale)
    agree(run, "wedge.friction_force", [rub(v, kept) for v, kept in zip(found[2], found[4], strict=True)])


def test_the_picture_of_a_run_names_contacts_in_their_units():
    run = ss.simulate(two_tables(), ss.NormalStressRamp(at=1.0, by=-3.0, duration=10.0, on="oiled"), until=20.0)
    panels = run.plot()
    names = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert names[:2] == ["dry", "oiled"]
    assert [panel.get_ylabel() for panel in panels] == ["slip rate (m/s)", "friction (1)", "normal force (N)"]
    assert "contact lost (oiled)" in panels[0].get_title()
    drawn = {line.get_label(): line.get_ydata() for line in panels[2].lines}
    assert drawn["oiled"] == pytest.approx(run["oiled.normal_force"])
    with pytest.raises(ss.NotAvailable, match="machine"):
        run.plot("phase")


def test_a_machine_has_one_steady_sliding():
    with pytest.raises(ss.ParameterError, match="branch: got 1"):
        ss.simulate(two_tables(), until=1.0, branch=1)


def test_a_jump_of_the_load_point_leaves_all_where_they_are():
    """Also what turns behind a screw: it falls behind by its own share."""
    machine = ss.Machine(
        bodies={"table": ss.SlidingBody(mass=1.0), "nut": ss.RotatingBody(inertia=0.2)},
        links={
            "pull": ss.Spring(between=("drive", "table"), stiffness=2.0),
            "screw": ss.Screw(between=("nut", "table"), lead=0.5, stiffness=5.0, damping=0.3),
        },
        contacts={"guide": surface("table", rate_state(0.5, 0.1, 1.0))},
        drive=ss.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, ss.DisplacementStep(at=1.0, by=0.3), until=3.0)
    (before,) = np.flatnonzero(np.diff(run["t"]) == 0)
    for name in ("table.displacement", "nut.displacement", "nut.v", "guide.slip", "guide.slip_rate"):
        assert run[name][before + 1] == pytest.approx(run[name][before], abs=1e-12), name
    assert run["nut.x"][before + 1] - run["nut.x"][before] == pytest.approx(-0.3 / 0.5)
    assert run["nut.displacement"][before] == pytest.approx(2.0)
    assert run["table.acceleration"][before + 1] == pytest.approx(2.0 * 0.3)
    assert run.units["nut.v"] == "rad/s"
