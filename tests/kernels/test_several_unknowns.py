"""Velocities, frictions and accelerations that are found together at every moment, against equations typed by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

import steadyslip as ss
from joint_unknowns import GAINS, SMOOTH, WEDGED, heavy_footed, two_smooth, wedges
from machines import at_random
from moving_machines import aging, agree, radau, slopes_of_motion
from steadyslip.kernels.newton import eliminated
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.printers import python as plain

TIMES = np.linspace(0.0, 8.0, 33)
FINE = {"rtol": 1e-9, "times": TIMES, "until": 8.0}


def solved(residuals, near):
    """What balances forces, close to the last that did."""
    found = root(residuals, near, tol=1e-13)
    assert np.max(np.abs(residuals(found.x))) < 1e-10
    near[:] = found.x
    return found.x


def smooth(own, v, theta):
    return own.a * np.arcsinh(v / 2 * np.exp((own.mu_ref + own.b * theta) / own.a))


def test_two_blocks_without_mass_on_laws_that_go_through_rest_joined_by_a_dashpot():
    run = ss.simulate(
        two_smooth(),
        [ss.protocol.VelocityStep(at=1.0, to=1.5), ss.protocol.DisturbanceStep(at=3.0, by=0.2, on="two")],
        **FINE,
    )

    def velocities(t, x, theta, near):
        ahead, push = x - 0.5 * max(t - 1.0, 0.0), 0.2 * (t >= 3.0)
        pull = np.array([-0.5, -0.4]) * ahead + 0.3 * (x[::-1] - x) + np.array([0.0, push])
        pull += [smooth(own, 1.0, 0.0) for own in SMOOTH]

        def left(v):
            return pull + 0.4 * (v[::-1] - v) - [smooth(own, *one) for own, *one in zip(SMOOTH, v, theta, strict=True)]

        return solved(left, near)

    near = np.ones(2)

    def right(t, y):
        v = velocities(t, y[:2], y[2:], near)
        return [*(v - 1.0), *(aging(own, *one) for own, *one in zip(SMOOTH, v, y[2:], strict=True))]

    found = pieces(right, np.zeros(4), (1.0, 3.0))
    for i, name in enumerate(("one", "two")):
        agree(run, f"{name}.displacement", found[i] + TIMES)
    agree(run, "first.Theta", found[2])
    agree(run, "second.Theta", found[3])
    speeds = np.array([velocities(t, y[:2], y[2:], np.ones(2)) for t, y in zip(TIMES, found.T, strict=True)])
    agree(run, "first.slip_rate", speeds[:, 0])
    agree(run, "second.slip_rate", speeds[:, 1])
    assert len(slopes_of_motion(two_smooth())[2].unknowns) == 2


def pieces(right, start, breaks):
    """The solution at `TIMES`, stretch by stretch between the times at which something jumps."""
    found, state = [], np.array(start)
    for begin, end in zip((0.0, *breaks), (*breaks, TIMES[-1]), strict=True):
        inside = TIMES[(begin <= TIMES) & (end > TIMES)]
        stretch = radau(lambda s, y, begin=begin: right(begin + s, y), state, np.append(inside, end) - begin)
        found.append(stretch[:, :-1])
        state = stretch[:, -1]
    return np.hstack([*found, state[:, None]])


def rubbed(own, gain, v, kept, near):
    """Friction with Ψ = bΘ + α ln σ as it is, and Θ."""
    (tau,) = solved(
        lambda t: (1 + gain * t) * (own.mu_ref + own.a * np.log(v) + kept - 0.2 * np.log(1 + gain * t)) - t, near
    )
    return tau, (kept - 0.2 * np.log(1 + gain * tau)) / own.b


RESTING = [own.mu_ref / (1 - gain * own.mu_ref) for own, gain in zip(WEDGED, GAINS, strict=True)]
KEPT = [0.2 * np.log(1 + gain * tau) for gain, tau in zip(GAINS, RESTING, strict=True)]


def compare_memory(run, kept):
    for name, own, values in zip(("left", "right"), WEDGED, kept, strict=True):
        if f"{name}.Psi" in run:
            agree(run, f"{name}.Psi", values)
        else:
            agree(run, f"{name}.Phi", values / own.b)


def test_frictions_that_change_their_own_normal_forces_at_two_contacts():
    run = ss.simulate(wedges(one=1.0, two=2.0), ss.protocol.VelocityStep(at=1.0, to=1.3), **FINE)
    assert len(slopes_of_motion(wedges(one=1.0, two=2.0))[2].unknowns) == 2
    near = [np.array([tau]) for tau in RESTING]

    def right(t, y):
        (x, z, v, w), kept = y[:4], y[4:]
        rubs = [rubbed(*one) for one in zip(WEDGED, GAINS, (v, w), kept, near, strict=True)]
        bar = 3.0 * (z - x) + 0.1 * (w - v)
        pull = -(z - 0.3 * max(t - 1.0, 0.0)) - 0.1 * (w - 1.0 - 0.3 * (t >= 1.0))
        forces = [bar + RESTING[0] - rubs[0][0], (pull - bar + RESTING[1] - rubs[1][0]) / 2.0]
        kept_rates = [own.b * aging(own, u, theta) for own, u, (_, theta) in zip(WEDGED, (v, w), rubs, strict=True)]
        return [v - 1.0, w - 1.0, *forces, *kept_rates]

    found = pieces(right, [0.0, 0.0, 1.0, 1.0, *KEPT], (1.0,))
    agree(run, "one.v", found[2])
    agree(run, "two.v", found[3])
    compare_memory(run, found[4:])


def test_a_carriage_without_mass_on_two_such_guides():
    """Its velocity and both frictions are found together after each jump; before and between one of them is."""
    run = ss.simulate(
        wedges(car=0.0),
        [ss.protocol.VelocityStep(at=1.0, to=1.3), ss.protocol.DisturbanceStep(at=4.0, by=-0.01, on="car")],
        **FINE,
    )
    reduction = slopes_of_motion(wedges(car=0.0))[2]
    assert (reduction.form, len(reduction.unknowns), len(reduction.restarts)) == ("eliminated", 1, 2)
    near = np.array([1.0, *RESTING])

    def moving(t, x, kept):
        pull = -(x - 0.3 * max(t - 1.0, 0.0)) - 0.01 * (t >= 4.0) + sum(RESTING)

        def left(u):
            v, loads = u[0], 1.0 + np.array(GAINS) * u[1:]
            laws = [own.mu_ref + own.a * np.log(v) + one - 0.2 * np.log(load)
                    for own, one, load in zip(WEDGED, kept, loads, strict=True)]  # fmt: skip
            return np.array([pull - 0.1 * (v - 1.0 - 0.3 * (t >= 1.0)) - sum(u[1:]), *(loads * laws - u[1:])])

        v, *rubs = solved(left, near)
        thetas = [(one - 0.2 * np.log(1 + g * tau)) / own.b
                  for own, g, tau, one in zip(WEDGED, GAINS, rubs, kept, strict=True)]  # fmt: skip
        return v, rubs, thetas

    def right(t, y):
        v, _, thetas = moving(t, y[0], y[1:])
        return [v - 1.0, *(own.b * aging(own, v, theta) for own, theta in zip(WEDGED, thetas, strict=True))]

    found = pieces(right, [0.0, *KEPT], (1.0, 4.0))
    agree(run, "car.displacement", found[0] + TIMES)
    compare_memory(run, found[1:])
    near[:] = [1.0, *RESTING]
    seen = [moving(t, y[0], y[1:]) for t, y in zip(TIMES, found.T, strict=True)]
    agree(run, "left.slip_rate", [v for v, _, _ in seen])
    agree(run, "right.friction_force", [rubs[1] for _, rubs, _ in seen])


def test_accelerations_that_normal_forces_feel():
    run = ss.simulate(heavy_footed(), initial={"one.v": 1.1}, **FINE)
    assert len(slopes_of_motion(heavy_footed())[2].unknowns) == 2
    near = np.zeros(2)

    def right(t, y):
        x, v, kept = y[:2], y[2:4], y[4:]
        bar = 0.3 * (x[1] - x[0]) + 0.2 * (v[1] - v[0])
        pull = np.array([bar - 0.5 * x[0] - 0.1 * (v[0] - 1.0), -bar]) + [own.mu_ref for own in WEDGED]

        def left(a):
            loads = 1.0 + np.array([0.1, -0.05]) * a
            laws = [own.mu_ref + own.a * np.log(u) + one - 0.2 * np.log(load)
                    for own, u, one, load in zip(WEDGED, v, kept, loads, strict=True)]  # fmt: skip
            return np.array([1.0, 2.0]) * a - pull + loads * laws

        loads = 1.0 + np.array([0.1, -0.05]) * solved(left, near)
        thetas = [(one - 0.2 * np.log(load)) / own.b for own, one, load in zip(WEDGED, kept, loads, strict=True)]
        rates = [own.b * aging(own, u, theta) for own, u, theta in zip(WEDGED, v, thetas, strict=True)]
        return [*(v - 1.0), *near, *rates]

    found = radau(right, [0.0, 0.0, 1.1, 1.0, 0.0, 0.0], TIMES)
    agree(run, "one.v", found[2])
    agree(run, "two.v", found[3])


@pytest.mark.parametrize(
    "made",
    [two_smooth(), two_smooth(dashpot=300.0), wedges(one=1.0, two=2.0), wedges(one=0.0, two=2.0), wedges(car=0.0),
     wedges(car=1.0), heavy_footed()],
    ids=["smooth", "stiff dashpot", "wedges", "one light", "light car", "car", "heavy-footed"],
)  # fmt: skip
def test_small_motion_has_the_eigenvalues_of_the_linear_verdict(made):
    jacobian, rates, reduction = slopes_of_motion(made)
    found, wanted = np.linalg.eigvals(jacobian), ss.eigenvalues(made)
    assert reduction.unknowns
    assert len(found) == len(wanted)
    assert np.max(np.abs(rates)) < 1e-12
    for s in wanted:
        assert np.min(np.abs(found - s)) < 1e-7 * np.max(np.abs(wanted))


def test_blocks_that_a_stiff_dashpot_ties_together_move_as_one():
    """Each solved for with the other as it is would take thousands of rounds."""
    pulse = ss.protocol.DisturbancePulse(at=1.0, by=0.2, duration=3.0, on="two")
    apart = []
    for dashpot in (1e3, 1e4):
        run = ss.simulate(two_smooth(dashpot=dashpot), pulse, times=TIMES, until=8.0)
        assert run.status == "done"
        apart.append(np.max(np.abs(run["one.v"] - run["two.v"])))
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.05)


def test_a_lane_moves_as_a_run_alone():
    forces = np.array([0.1, 0.2, 0.3])
    many = ss.simulate_many(
        two_smooth(),
        {"protocol.pieces.1.by": forces},
        ss.protocol.DisturbanceStep(at=1.0, by=0.2, on="two"),
        times=TIMES,
        until=8.0,
    )
    alone = ss.simulate(two_smooth(), ss.protocol.DisturbanceStep(at=1.0, by=0.3, on="two"), times=TIMES, until=8.0)
    assert many.samples["first.slip_rate"][2] == pytest.approx(alone["first.slip_rate"], rel=1e-12)


PLACES = {
    "full": {(i, k) for i in range(3) for k in range(3)},
    "nothing on the diagonal": {(0, 1), (1, 2), (2, 0), (0, 2)},
    "a chain": {(0, 0), (0, 1), (1, 0), (1, 1), (1, 2), (2, 1), (2, 2)},
    "apart": {(0, 0), (1, 1), (2, 2)},
}


@pytest.mark.parametrize("places", PLACES)
def test_equations_are_eliminated_in_programs(places):
    random = np.random.default_rng(1)
    matrix, right = random.normal(size=(3, 3)), random.normal(size=3)
    matrix[0, 0] *= 1e-9  # no pivot
    matrix = np.where([[(i, k) in PLACES[places] for k in range(3)] for i in range(3)], matrix, 0.0)
    program = Program("solve")
    entries = {(i, k): program.load(3 * i + k) for i, k in PLACES[places]}
    for k, value in enumerate(eliminated(entries, [program.load(9 + i) for i in range(3)])):
        program.store(k, value, "y")
    found, expected = np.zeros(3), np.linalg.solve(matrix, right)
    plain.function(program)(np.append(matrix.ravel(), right), 0.0, found)
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(24))
def test_machines_at_random_on_laws_that_go_through_rest(seed):
    """Every second one without mass: up to three velocities to be found together."""
    machine = at_random(seed)[0]
    contacts = {
        name: replace(one, friction=replace(one.friction, regularised=True)) for name, one in machine.contacts.items()
    }
    light = {name: ss.machine.SlidingBody() for name in machine.bodies} if seed % 2 else {}
    machine = replace(machine, contacts=contacts, bodies={**machine.bodies, **light})
    jacobian, rates, _ = slopes_of_motion(machine)
    if not np.all(np.isfinite(rates)):
        with pytest.raises(ss.NoSteadySliding):
            ss.steady_state(machine)
        return
    found, wanted = np.linalg.eigvals(jacobian), ss.eigenvalues(machine)
    assert len(found) == len(wanted)
    for s in wanted:
        assert np.min(np.abs(found - s)) < 1e-7 * np.max(np.abs(wanted))
