"""A drive that is let go and moves on: laws of nature, and equations typed by hand across both switches."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import steadyslip as ss
from machines import rate_state, surface, two_mass
from moving_machines import aging, friction

LAW = rate_state(0.3, 0.1, 1.0)
TIMES = np.linspace(0.0, 40.0, 161)
PLAN = (
    ss.protocol.VelocityStep(at=1.0, to=1.5), ss.protocol.Creep(at=5.0, duration=10.0),
    ss.protocol.CreepStep(at=8.0, by=0.03),
    ss.protocol.VelocityStep(at=25.0, to=1.2),
)  # fmt: skip
FINE = {"until": 40.0, "times": TIMES, "rtol": 1e-9}


def slider(**changes):
    given = {"stiffness": 0.7, "mass": 0.5, "damping": 0.2} | changes
    return ss.Slider(
        friction=LAW, contact=ss.laws.ConstantNormalStress(preload=1.0), drive=ss.machine.SteadyDrive(1.0), **given
    )


def drive_speed(t):
    return 1.5 if 1 <= t < 25 else 1.2 if t >= 25 else 1.0


def solved(right, start, edges, change=lambda k, y: y):
    """Radau from edge to edge, with what changes at each: states at TIMES."""
    y, found = np.array(start, dtype=float), []
    for k, (begin, end) in enumerate(pairwise(edges)):
        y = change(k, y)
        inside = TIMES[(begin <= TIMES) & ((end > TIMES) | (end == edges[-1]))]
        done = solve_ivp(right(k), (begin, end), y, "Radau", dense_output=True, rtol=1e-10, atol=1e-12)
        found.append(done.sol(inside))
        y = done.y[:, -1]
    return np.concatenate(found, axis=1)


def test_a_press_that_creeps_between_motions_against_equations_typed_by_hand():
    """A spring k with a dashpot c; the load point stands where spring and dashpot carry what is carried."""
    k, c, m = 0.7, 0.2, 0.5
    edges = [0.0, 1.0, 5.0, 8.0, 15.0, 25.0, 40.0]

    def pull(y, speed):  # state: load point, block, v, theta, force held
        return 0.6 + k * (y[0] - y[1]) + c * (speed - y[2])

    def change(span, y):
        y = y.copy()
        if span == 2:
            y[4] = pull(y, 1.5)
        if span == 3:
            y[4] += 0.03
        if span == 4:  # the load point goes on from where the force is what it was
            y[0] = y[1] + (y[4] - 0.6 - c * (1.5 - y[2])) / k
        return y

    def right(span):
        def rates(t, y):
            speed = drive_speed(0.5 * (edges[span] + edges[span + 1]))
            force = y[4] if span in (2, 3) else pull(y, speed)
            return [speed, y[2], (force - friction(LAW, 1.0, y[2], y[3])) / m, aging(LAW, y[2], y[3]), 0.0]

        return rates

    found = ss.simulate(slider(), PLAN, **FINE)
    expected = solved(right, [0, 0, 1, 0, 0], edges, change)
    assert found["v"] == pytest.approx(expected[2], abs=3e-7)
    assert found["slip"] == pytest.approx(expected[1], abs=1e-6)
    assert found["Theta"] == pytest.approx(expected[3], abs=3e-7)
    driven = (TIMES < 5) | (TIMES >= 15)
    assert found["load_displacement"][driven] == pytest.approx(expected[0][driven], abs=1e-6)
    force = 0.6 + k * (expected[0] - expected[1]) + c * (np.vectorize(drive_speed)(TIMES) - expected[2])
    force[~driven] = expected[4][~driven]
    assert found["spring_stress"] == pytest.approx(force, abs=3e-7)


def test_a_press_without_mass_goes_on_as_its_memory_has_it():
    """Theory 1 with m = c = 0, η = .1: the balance of forces makes the velocity, T = τ + η v."""
    edges = [0.0, 1.0, 5.0, 8.0, 15.0, 25.0, 40.0]

    def speed_of(force, theta):
        def left(u):
            return friction(LAW, 1.0, np.exp(u), theta) + 0.1 * np.exp(u) - force

        return np.exp(brentq(left, -30, 10, xtol=1e-14))

    def change(span, y):
        y = y.copy()
        if span in (2, 3):
            y[2] = (0.7 - 0.7 * y[0] if span == 2 else y[2]) + (0.03 if span == 3 else 0.0)
        if span == 4:
            y[0] = (0.7 - y[2]) / 0.7
        return y

    def right(span):
        def rates(t, y):
            force = y[2] if span in (2, 3) else 0.7 - 0.7 * y[0]
            v = speed_of(force, y[1])
            return [v - drive_speed(0.5 * (edges[span] + edges[span + 1])), aging(LAW, v, y[1]), 0.0]

        return rates

    found = ss.simulate(slider(mass=0.0, damping=0.0, radiation_damping=0.1), PLAN, **FINE)
    expected = solved(right, [0, 0, 0], edges, change)
    assert found["Theta"] == pytest.approx(expected[1], abs=3e-7)
    driven = (TIMES < 5) | (TIMES >= 15)
    assert found["x"][driven] == pytest.approx(expected[0][driven], abs=1e-6)
    assert found["spring_stress"][~driven] == pytest.approx(expected[2][~driven], abs=1e-7)


@pytest.mark.parametrize("integral", [0.0, 0.05])
def test_a_servo_that_is_let_go_and_takes_over_without_a_jerk(integral):
    """Motor with PD or PID, screw, table. The integral waits, and goes on from where the motor is taken up."""
    kp, kd = 2.0, 0.3
    law = rate_state(0.5, 0.3, 1.0)
    machine = two_mass(kp=kp, kd=kd, friction=law)
    if integral:
        machine = replace(machine, drive=ss.machine.PositionPID(velocity=1.0, body="motor", kp=kp, kd=kd, ki=integral))
    edges = [0.0, 1.0, 5.0, 15.0, 25.0, 40.0]

    def pull(y, speed):  # motor, table, v, w, theta, integral, commanded place, held
        return kp * (y[6] - y[0]) + kd * (speed - y[2]) - integral * y[5]

    def change(span, y):
        y = y.copy()
        if span == 2:
            y[7] = pull(y, 1.5) + 0.1
        if span == 3:
            y[6] = y[0] + (y[7] - kd * (1.5 - y[2]) + integral * y[5]) / kp
        return y

    def right(span):
        speed = drive_speed(0.5 * (edges[span] + edges[span + 1]))

        def rates(t, y):
            force = y[7] if span == 2 else pull(y, speed)
            screw = 100.0 * (y[0] - y[1]) + 0.5 * (y[2] - y[3])
            rub = friction(law, 1.0, y[3], y[4]) - friction(law, 1.0, 1.0, 0.0)
            error = 0.0 if span == 2 else y[0] - y[6]
            return [y[2], y[3], (force - screw) / 2, (screw - rub) / 5, aging(law, y[3], y[4]), error, speed, 0.0]

        return rates

    plan = [PLAN[0], PLAN[1], ss.protocol.CreepStep(at=5.0, by=0.1), PLAN[3]]
    found = ss.simulate(machine, plan, **FINE)
    expected = solved(right, [0, 0, 1, 1, 0, 0, 0, 0], edges, change)
    assert found["motor.v"] == pytest.approx(expected[2], abs=1e-6)
    assert found["table.v"] == pytest.approx(expected[3], abs=1e-6)
    assert found["table.displacement"] == pytest.approx(expected[1], abs=3e-6)
    driven = (TIMES < 5) | (TIMES >= 15)
    assert found["load_displacement"][driven] == pytest.approx(expected[6][driven], abs=3e-6)


def test_force_goes_on_at_both_switches():
    run = ss.simulate(
        slider(),
        [ss.protocol.Hold(at=2.0, duration=6.0), ss.protocol.Creep(at=8.0, duration=5.0)],
        until=20.0,
        rtol=1e-9,
    )
    for at in (8.0, 13.0):
        before, after = np.flatnonzero(run["t"] == at)[[0, -1]]
        for name in ("spring_stress", "v", "slip", "Theta"):
            assert run[name][after] == pytest.approx(run[name][before], rel=1e-12)
    held = run["creep"] == 1
    assert np.ptp(run["spring_stress"][held]) < 1e-12
    assert run["load_velocity"][-1] == 1.0


@pytest.mark.parametrize("at", [0.1, 0.3, 0.7])
def test_rounding_does_not_part_the_end_of_creep_from_the_next_piece(at):
    """The load point is taken up with the velocity that follows: without a jump of the force through the dashpot."""
    for end in np.nextafter(1.1, [0.0, 1.1, 2.0]):
        plan = [
            ss.protocol.VelocityStep(at=0.0, to=1.3),
            ss.protocol.Creep(at=at, duration=end - at),
            ss.protocol.VelocityStep(at=1.1, to=0.4),
        ]
        run = ss.simulate(slider(), plan, until=2.0, times=[1.1 - 1e-9, 1.1 + 1e-9])
        assert run["load_velocity"][1] == 0.4
        assert run["spring_stress"][1] == pytest.approx(run["spring_stress"][0], abs=1e-7)


def test_what_is_told_is_pulled():
    """`to` says the whole pull, at once; what comes after it adds up."""
    inclined = replace(slider(), contact=ss.laws.InclinedSpring(preload=1.0, angle=0.3))
    plan = [ss.protocol.Creep(at=3.0, to=0.7), ss.protocol.CreepRamp(at=4.0, by=0.05, duration=2.0),
        ss.protocol.VelocityStep(at=10.0, to=0.5),
            ss.protocol.Creep(at=12.0, duration=2.0, to=0.4),
            ss.protocol.Creep(at=14.0, duration=1.0, to=0.45)]  # fmt: skip
    for rig in (
        slider(),
        slider(damping=0.0),
        inclined,
        replace(slider(), drive=ss.machine.PID(1.0, kp=1.0, kd=0.1, ki=0.2)),
    ):
        run = ss.simulate(rig, plan, until=20.0, times=[3.0, 4.0, 5.0, 9.0, 12.0, 13.9, 14.0, 14.9])
        assert run["spring_stress"] == pytest.approx([0.7, 0.7, 0.725, 0.75, 0.4, 0.4, 0.45, 0.45], abs=1e-9)


def test_told_forces_of_machines_are_those_of_the_drive():
    machine = replace(
        two_mass(), drive=ss.machine.Pull(velocity=1.0),
        links={**two_mass().links, "rope": ss.machine.Spring(between=("motor", "drive"), stiffness=9.0, damping=1.0)},
    )  # fmt: skip
    run = ss.simulate(
        machine, [ss.protocol.Creep(at=1.0, duration=2.0, to=0.65)], until=6.0, times=np.linspace(0, 6, 25)
    )
    held = run["creep"] == 1
    assert -run["links.rope.force"][held] == pytest.approx(0.65, abs=1e-9)
    spring = 9.0 * (run["load_displacement"] - run["motor.displacement"]) + run["load_velocity"] - run["motor.v"]
    driven = run["t"] > 3.0
    assert -run["links.rope.force"][driven] == pytest.approx(0.6 - 1.0 + 1.0 + spring[driven], abs=1e-6)


def test_creep_from_begin_to_end_is_creep_throughout():
    """Two equations of motion: one that knows a moving drive, one that does not."""
    parts = [ss.protocol.Creep(at=0.0), ss.protocol.CreepRamp(at=1.0, by=0.05, duration=3.0)]
    for rig in (
        slider(),
        slider(mass=0.0, damping=0.0),
        replace(slider(), drive=ss.machine.PID(1.0, kp=3.0, kd=0.4, ki=0.1)),
    ):
        one, two = ss.simulate(rig, parts, **FINE), ss.simulate(rig, parts[1:], **FINE)
        assert one["v"] == pytest.approx(two["v"], rel=1e-7)
        assert one["spring_stress"] == pytest.approx(two["spring_stress"], rel=1e-9)


def test_a_machine_of_one_body_is_let_go_as_its_slider():
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=0.5)},
        links={"rod": ss.machine.Spring(between=("drive", "block"), stiffness=0.7, damping=0.2)},
        contacts={"rock": surface("block", LAW)},
        drive=ss.machine.Pull(velocity=1.0),
    )
    one, two = ss.simulate(slider(), PLAN, **FINE), ss.simulate(machine, PLAN, **FINE)
    assert two["block.v"] == pytest.approx(one["v"], rel=1e-7)
    assert two["block.x"] == pytest.approx(one["x"], abs=1e-7)
    assert two["load_velocity"] == pytest.approx(one["load_velocity"], rel=1e-6)


def test_energy_is_kept_across_both_switches():
    """What the drive does, moving or let go, is in the block, the spring and friction."""
    times = np.linspace(0, 20, 40001)
    plan = [ss.protocol.Creep(at=5.0, duration=5.0), ss.protocol.CreepRamp(at=6.0, by=0.1, duration=3.0)]
    run = ss.simulate(slider(damping=0.0), plan, until=20.0, times=times, rtol=1e-9, initial={"x": -0.2})
    pull, v = run["spring_stress"], run["v"]
    power = pull * run["load_velocity"] - run["shear_stress"] * v
    ends = np.searchsorted(times, [5.0, 6.0, 9.0, 10.0])
    work, start = 0.0, 0
    for stop in (*ends, len(times) - 1):  # the load point's velocity jumps at the switches
        part = power[start : stop + 1].copy()
        part[-1] = 2 * part[-2] - part[-3]
        work += np.sum(0.5 * (part[1:] + part[:-1])) * (20 / 40000)
        start = stop
    energy = 0.5 * 0.5 * v**2 + 0.5 * pull**2 / 0.7
    assert work == pytest.approx(energy[-1] - energy[0], abs=2e-7)


def test_a_run_that_starts_anew_from_the_last_values_is_the_run_that_went_on():
    """Displacements count from where the load point is, so they say the force, let go or taken up."""
    for m in (0.5, 0.0):
        rig = slider(mass=m, damping=0.0)
        whole = ss.simulate(rig, PLAN[:3], until=40.0, times=TIMES, rtol=1e-10)
        later, shifted = TIMES >= 16.0, [ss.protocol.VelocityStep(at=0.0, to=1.5)]
        at = np.flatnonzero(later)[0]
        last = {name: whole[name][at] for name in (("x", "v", "Theta") if m else ("x", "Theta"))}
        again = ss.simulate(rig, shifted, until=24.0, times=TIMES[later] - 16.0, rtol=1e-10, initial=last)
        assert again["v"] == pytest.approx(whole["v"][later], rel=1e-7)
        at = np.flatnonzero(TIMES >= 10.0)[0]
        last = {name: whole[name][at] for name in last}
        plan = [ss.protocol.Creep(at=0.0, duration=5.0), ss.protocol.VelocityStep(at=5.0, to=1.5)]
        again = ss.simulate(rig, plan, until=30.0, times=TIMES[at:] - 10.0, rtol=1e-10, initial=last)
        assert again["v"] == pytest.approx(whole["v"][at:], rel=1e-7)


@pytest.mark.parametrize("kd", [0.0, 0.3])
def test_a_motor_without_mass_is_let_go_as_one_of_hardly_any(kd):
    """To first order in its mass: its place and speed follow from forces, which go on at both switches."""
    plan = [
        *PLAN[:2],
        ss.protocol.CreepRamp(at=6.0, by=0.05, duration=1.0),
        ss.protocol.DisturbanceStep(at=7.0, by=0.02, on="motor"),
        PLAN[3],
    ]
    moved = []
    for mass in (0.0, 1e-4, 1e-5):
        machine = two_mass(kp=2.0, kd=kd, friction=rate_state(0.5, 0.3, 1.0))
        machine = replace(machine, bodies={**machine.bodies, "motor": ss.machine.SlidingBody(mass=mass)})
        moved.append(ss.simulate(machine, plan, **FINE)["table.v"])
    apart = [np.max(np.abs(one - moved[0])) for one in moved[1:]]
    assert apart[0] < 1e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.05)


def test_ensembles_let_go_when_each_is_told_to():
    vary = {
        "protocol.pieces.2.at": [5.0, 6.0, 4.0],
        "protocol.pieces.3.by": [0.03, -0.02, 0.01],
        "stiffness": [0.7, 0.9, 1.1],
    }
    for m in (0.5, 0.0):
        many = ss.simulate_many(slider(mass=m), vary, PLAN, **FINE)
        for i in range(3):
            own = (PLAN[0], replace(PLAN[1], at=vary["protocol.pieces.2.at"][i]),
                   replace(PLAN[2], by=vary["protocol.pieces.3.by"][i]), PLAN[3])  # fmt: skip
            alone = ss.simulate(slider(mass=m, stiffness=vary["stiffness"][i]), own, **FINE)
            for name in ("v", "x", "load_displacement", "load_velocity", "spring_stress"):
                assert many.samples[name][i] == pytest.approx(alone[name], rel=1e-7, abs=1e-8)


def test_ensembles_pull_as_each_is_told():
    plan = [ss.protocol.Creep(at=1.0, duration=4.0, to=0.6), ss.protocol.CreepStep(at=2.0, by=0.0)]
    vary = {"protocol.pieces.1.to": [0.6, 0.62, 0.64], "protocol.pieces.2.by": [0.0, 0.01, -0.01]}
    for some in ({name: values} for name, values in vary.items()):
        many = ss.simulate_many(slider(), some, plan, until=10.0, times=[3.0])
        (values,) = some.values()
        changes = np.array(values) - (0.6 if next(iter(some)).endswith(".to") else 0.0)
        assert many.samples["spring_stress"][:, 0] == pytest.approx(0.6 + changes, abs=1e-9)


def test_bodies_are_pushed_and_contacts_pressed_while_a_drive_is_let_go():
    law = rate_state(0.5, 0.3, 1.0)
    plan = [*PLAN[:2], ss.protocol.DisturbanceStep(at=7.0, by=0.05, on="table"),
        ss.protocol.DisturbanceStep(at=7.0, by=0.05, on="motor"),
            ss.protocol.NormalStressStep(at=9.0, by=0.1)]  # fmt: skip
    run = ss.simulate(two_mass(friction=law), plan, **FINE)
    assert run["table.disturbance"][-1] == run["motor.disturbance"][-1] == 0.05
    assert run["guide.normal_force"][-1] == pytest.approx(1.1)
    stiff = two_mass(friction=law).with_values({"screw.stiffness": 1e5, "screw.damping": 300.0})
    both = ss.simulate(stiff, plan[:4], **FINE)
    one = ss.simulate(stiff, [*PLAN[:2], ss.protocol.CreepStep(at=7.0, by=0.1)], **FINE)
    during = (TIMES > 8) & (TIMES < 15)
    assert both["table.v"][during] == pytest.approx(one["table.v"][during], abs=1e-5)


@pytest.mark.parametrize(
    ("pieces", "said"),
    [
        (
            [ss.protocol.Creep(at=5.0, duration=5.0), ss.protocol.CreepStep(at=11.0, by=0.1)],
            "creep-step begins where nothing creeps",
        ),
        (
            [ss.protocol.Creep(at=5.0, duration=5.0), ss.protocol.VelocityStep(at=8.0, to=2.0)],
            "before piece 1 .creep. ends",
        ),
        (
            [ss.protocol.Creep(at=5.0), ss.protocol.VelocityHarmonic(amplitude=0.1, period=2.0)],
            "velocity-harmonic moves the load point",
        ),
        (
            [ss.protocol.Creep(at=5.0), ss.protocol.DisplacementStep(at=6.0, by=1.0)],
            "displacement-step moves the load point",
        ),
    ],
)
def test_what_a_drive_that_is_let_go_does_not_do(pieces, said):
    with pytest.raises(ss.ParameterError, match=said):
        ss.Protocol(pieces=tuple(pieces))


def test_problems_in_ensembles_and_of_rigs_are_told():
    with pytest.raises(ss.ParameterError, match="creep-step begins where nothing creeps"):
        ss.simulate_many(slider(), {"protocol.pieces.2.at": [5.0, 9.0]}, PLAN, until=40.0)
    with pytest.raises(ss.NotAvailable, match="needs a stiffness"):
        ss.simulate(slider(stiffness=0.0), PLAN, until=40.0)


def test_files_words_and_results_have_it(tmp_path):
    plan = ss.Protocol(
        pieces=(ss.protocol.Hold(at=1.0, duration=4.0), ss.protocol.Creep(at=5.0, duration=3.0, to=0.62)), until=12.0
    )
    assert ss.protocol_from_text(ss.rig_to_text(slider(), plan)) == plan
    run = ss.simulate(slider(), plan)
    assert "let go" in str(run)
    panels = run.plot()
    assert "drive let go" in [text.get_text() for text in panels[0].get_legend().get_texts()]
    shaded = [patch.get_x() for patch in panels[1].patches]
    assert shaded[0] == pytest.approx(5.0)
    assert panels[1].patches[0].get_width() == pytest.approx(3.0)
    run.save(tmp_path / "run.nc")
    again = ss.load_history(tmp_path / "run.nc")
    assert again.units == run.units
    assert np.array_equal(again["creep"], run["creep"])
    shaft = ss.Machine(
        bodies={"shaft": ss.machine.RotatingBody(inertia=0.5)},
        links={"key": ss.machine.Shaft(between=("drive", "shaft"), stiffness=2.0)},
        contacts={"seal": surface("shaft", LAW, radius=1.0)},
        drive=ss.machine.RotaryPull(velocity=1.0),
    )
    piece = ss.piece_from_text("creep at=1s duration=2s to='0.7 N m'", machine=shaft)
    turned = ss.simulate(shaft, piece, until=5.0, times=[2.0])
    assert turned["links.key.force"][0] == pytest.approx(0.7)
    with pytest.raises(ss.ParameterError, match="N m"):
        ss.simulate(shaft, ss.protocol.Creep(at=1.0, to="0.7 N"), until=5.0)
