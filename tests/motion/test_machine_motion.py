"""Motion of machines against equations typed by hand."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import steadyslip as ss
from machines import brake, coulomb, rate_state, stacked_pads, surface, two_blocks, two_mass
from moving_machines import FINE, TIMES, aging, agree, friction, law, radau, slopes_of_motion


@pytest.fixture(scope="module")
def axis():
    return two_mass(kp=1.0)


def test_a_two_mass_axis_with_a_step_of_the_drive_and_a_push(axis):
    own, load = law(axis)
    pieces = [ss.protocol.VelocityStep(at=0.0, to=1.2), ss.protocol.DisturbanceStep(at=0.0, by=0.05, on="table")]
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
    run = ss.simulate(machine, ss.protocol.DisplacementStep(at=0.0, by=0.1), times=TIMES, until=20.0, **FINE)
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


def test_pads_in_the_plane_that_hold_each_other_along_and_aslant():
    """What their springs carry has no formula in the Model."""
    machine = stacked_pads(2)
    run = ss.simulate(machine, ss.protocol.VelocityStep(at=0.0, to=1.05), times=TIMES[TIMES <= 6], until=6.0, **FINE)
    own, cos, sin = machine.contacts["at-pad0"].friction, np.cos(0.5), np.sin(0.5)

    def forces(t, y, speed):
        """On both pads, along and away, without friction and the press of the contacts."""
        found, before = np.zeros((2, 2)), np.array([speed * t, 0.0, speed, 0.0])
        for i in range(2):
            dx, dy, dv, dw = y[[i, 2 + i, 4 + i, 6 + i]] - before
            along, aslant = 50 * dx + 0.5 * dv, 20 * (cos * dx + sin * dy) + 0.2 * (cos * dv + sin * dw)
            pull = np.array([along + aslant * cos, aslant * sin])
            found[i] -= pull
            found[i - 1] += pull if i else 0.0
            before = y[[i, 2 + i, 4 + i, 6 + i]]
        return found

    def right(t, y, speed=1.05):
        load, v = -30 * y[2:4] - 0.1 * y[6:8], y[4:6]
        rubbing = np.array([friction(own, load[i], v[i], y[8 + i]) for i in range(2)])
        pulled = forces(t, y, speed)
        rates = [(pulled[:, 0] - rubbing) / [1.0, 2.0], (pulled[:, 1] + load - 5.0) / [1.0, 2.0]]
        return np.array([*v, *y[6:8], *np.concatenate(rates), *(aging(own, v[i], y[8 + i]) for i in range(2))])

    def steady(places):
        return right(0.0, np.array([*places, 1, 1, 0, 0, 0, 0]), 1.0)[4:8]

    start = np.array([*fsolve(steady, [-0.1] * 4, xtol=1e-14), 1, 1, 0, 0, 0, 0])
    found = radau(right, start, TIMES[TIMES <= 6])
    for i in range(2):
        agree(run, f"at-pad{i}.slip_rate", found[4 + i])
        agree(run, f"at-pad{i}.normal_force", -30 * found[2 + i] - 0.1 * found[6 + i])
        agree(run, f"at-pad{i}.Theta", found[8 + i])


def test_flutter_of_a_pad_on_coulomb_friction_that_is_regularised():
    machine = brake(coulomb(1.1 * 0.4166666666666667))
    times = np.linspace(0.0, 30.0, 301)
    run = ss.simulate(machine, ss.protocol.NormalStressStep(at=0.0, by=0.01), times=times, until=30.0, **FINE)
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
    teeth = ss.laws.InclinedSpring(preload=1.0, angle=tilt)
    machine = ss.Machine(
        bodies={"motor": ss.machine.SlidingBody(mass=1.0), "load": ss.machine.SlidingBody(mass=2.0, force=-0.1)},
        links={"gear": ss.machine.Spring(between=("motor", "load"), stiffness=20.0, damping=0.3)},
        contacts={
            "mesh": ss.machine.Surface(body="motor", friction=own, contact=teeth, loaded_by="gear"),
            "guide": surface("load", rate_state(0.4, 0.1, 2.0, mu=0.2)),
        },
        drive=ss.machine.PositionPD(velocity=1.0, body="motor", kp=3.0, kd=0.4),
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


def test_pore_fluid_follows_in_motion():
    own = rate_state(0.3, -0.05, 1.0)
    wet = ss.laws.PoreFluid(preload=1.0, suction=0.05, drainage=1.3, slip_distance=0.7, v_ref=1.0)
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=0.5)},
        contacts={"gouge": ss.machine.Surface(body="block", friction=own, contact=wet)},
        drive=ss.machine.Pull(velocity=1.0),
    )
    run = ss.simulate(machine, ss.protocol.VelocityStep(at=0, to=1.5), times=TIMES, until=20.0, **FINE)

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
    still = dataclasses.replace(machine, bodies={"block": ss.machine.SlidingBody(mass=0.0)})
    assert slopes_of_motion(still)[2].form == "eliminated"
    jacobian = slopes_of_motion(still)[0]
    assert np.sort_complex(np.linalg.eigvals(jacobian)) == pytest.approx(np.sort_complex(ss.eigenvalues(still)))


def test_friction_that_acts_on_its_own_normal_force_is_solved_for():
    """A self-energising contact with memory of normal stress: τ stands in ln σ(τ), on a block that another drags."""
    own = rate_state(0.02, -0.01, 1.0, mu=0.4, normal_memory=ss.laws.LinkerDieterich(alpha=0.2, sigma_ref=1.0))
    machine = ss.Machine(
        bodies={"one": ss.machine.SlidingBody(mass=1.0), "two": ss.machine.SlidingBody(mass=2.0)},
        links={
            "pull": ss.machine.Spring(between=("drive", "two"), stiffness=1.0, damping=0.1),
            "bar": ss.machine.Spring(between=("two", "one"), stiffness=3.0, damping=0.1),
        },
        contacts={
            "wedge": ss.machine.Surface(body="one", friction=own, contact=ss.laws.SelfEnergising(preload=1.0, gain=0.3))
        },
        drive=ss.machine.Pull(velocity=1.0),
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
