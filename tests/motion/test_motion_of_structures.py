"""Motion of structures: limits that are known machines, equations typed by hand, and roots of the reed."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss
from steadyslip.machine import (
    Machine,
    Pull,
    SlidingBody,
    Spring,
    StructureBody,
    StructureData,
    StructurePoint,
    Surface,
    reduced,
)
from steadyslip.model.point import operating_point
from steadyslip.nonlinear.kicks.places import struck
from steadyslip.reports.sections import motion
from structures_at_random import ROCK, random_structure, reed

EXAMPLE = "examples/structures/reed.toml"
FINE = {"rtol": 1e-10, "times": np.linspace(0, 0.02, 41)}


def on_belt(against, body, contacts, links=None):
    surfaces = {
        f"c{i}": Surface(body="drive", against=against.format(i), friction=ROCK, contact=one)
        for i, one in contacts.items()
    }
    bodies = {"s": body} if isinstance(body, StructureBody) else body
    return Machine(bodies=bodies, links=links or {}, contacts=surfaces, drive=Pull(velocity=0.05))


def structure(mass, damping, stiffness, **more):
    size = len(mass)
    points = {f"p{i}": StructurePoint(x=i + 1) for i in range(size)}
    data = StructureData(np.array(mass), np.array(damping), np.array(stiffness), np.zeros((size, size)))
    return StructureBody(matrices=data, points=points, **more)


def same(one, other, names, most):
    """Both runs agree in the results of the first, by their names in the second, relative to the largest value."""
    for name, called in names.items():
        size = np.max(np.abs(other[called]))
        assert np.max(np.abs(one[name] - other[called])) < most * size, name


def test_one_mode_moves_as_the_slider():
    load = ss.laws.ConstantNormalStress(preload=100.0)
    machine = on_belt("s.p{}", structure([[0.7]], [[3.0]], [[4e4]]), {0: load})
    body = {"p0": SlidingBody(mass=0.7)}
    links = {"a": Spring(between=("ground", "p0"), stiffness=4e4, damping=3.0)}
    slider = on_belt("p{}", body, {0: load}, links)
    runs = [
        ss.simulate(rig, ss.protocol.DisturbanceStep(at=0, by=0.4, on=on), until=0.02, **FINE)
        for rig, on in ((machine, "s.p0"), (slider, "p0"))
    ]
    names = {"s.p0.x": "p0.x", "s.p0.v": "p0.v", "c0.slip": "c0.slip", "c0.friction_force": "c0.friction_force"}
    same(*runs, names, 1e-9)


def test_two_masses_move_as_the_machine():
    load = {0: ss.laws.ConstantNormalStress(preload=90.0), 1: ss.laws.ConstantNormalStress(preload=40.0)}
    stiffness, damping = [[5e4, -2e4], [-2e4, 3e4]], [[4.0, -1.0], [-1.0, 2.5]]
    machine = on_belt("s.p{}", structure(np.diag([0.7, 0.3]), damping, stiffness), load)
    bodies = {"p0": SlidingBody(mass=0.7), "p1": SlidingBody(mass=0.3)}
    links = {"a": Spring(between=("ground", "p0"), stiffness=3e4, damping=3.0),
             "b": Spring(between=("p0", "p1"), stiffness=2e4, damping=1.0),
             "c": Spring(between=("ground", "p1"), stiffness=1e4, damping=1.5)}  # fmt: skip
    row = on_belt("p{}", bodies, load, links)
    runs = [
        ss.simulate(rig, [ss.protocol.DisturbanceStep(at=0, by=0.4, on=on.format(1)),
                          ss.protocol.NormalStressStep(at=0.003, by=5.0, on="c0")], until=0.02, **FINE)
        for rig, on in ((machine, "s.p{}"), (row, "p{}"))
    ]  # fmt: skip
    names = {f"s.p{i}.{what}": f"p{i}.{what}" for i in (0, 1) for what in "xv"}
    same(*runs, names | {"c1.slip_rate": "c1.slip_rate", "c0.normal_force": "c0.normal_force"}, 1e-9)


def test_a_free_structure_moves_as_the_chain_that_it_is():
    """Two masses with a spring, pulled by a link from the drive over the ground; a constant force on the first."""
    load, pull = ss.laws.ConstantNormalStress(preload=90.0), {"stiffness": 3e4, "damping": 2.0}
    data = StructureData(np.diag([0.7, 0.3]), np.zeros((2, 2)), 2e4 * np.array([[1, -1], [-1, 1]]), np.zeros((2, 2)))
    points = {"p0": StructurePoint(x=1, force=3.0), "p1": StructurePoint(x=2)}
    machine, chain = (
        Machine(bodies=bodies, links={"pull": Spring(between=("drive", f"{at}p0"), **pull), **links},
                contacts={"c": Surface(body=f"{at}p1", friction=ROCK, contact=load)}, drive=Pull(velocity=0.05))
        for at, bodies, links in (
            ("s.", {"s": StructureBody(matrices=data, points=points)}, {}),
            ("", {"p0": SlidingBody(mass=0.7, force=3.0), "p1": SlidingBody(mass=0.3)},
             {"b": Spring(between=("p0", "p1"), stiffness=2e4)}),
        )
    )  # fmt: skip
    ramp = ss.protocol.VelocityStep(at=0.001, to=0.052)
    runs = [ss.simulate(rig, ramp, until=0.02, **FINE) for rig in (machine, chain)]
    same(*runs, {"s.p0.v": "p0.v", "s.p1.v": "p1.v", "links.pull.force": "links.pull.force"}, 1e-9)


def by_hand(numbers, push, times):
    """Motion (displacements and velocities) under a constant push on the first point, by LSODA.

    M q'' + C q' + K q = Σ t F + n N, v = V − t q', N = N0 − k_n n q − c_n n q', with the slip law and Linker and
    Dieterich's memory; all but the memory minus steady sliding.
    """
    mass, damping, stiffness, speed, contacts = numbers
    size, inverse = len(mass), np.linalg.inv(mass)
    rows = []
    for x, y, angle, *own in contacts:
        along, away = np.zeros((2, size))
        along[x], along[y], away[x], away[y] = np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)
        rows.append((along, away, *own))

    def rates(_, z):
        q, w, memory = z[:size], z[size : 2 * size], z[2 * size :]
        force, changes = push * rows[0][0] - damping @ w - stiffness @ q, []
        for (along, away, a, b, d_c, level, alpha, load, normal, dashpot), kept in zip(rows, memory, strict=True):
            v, pressed = speed - along @ w, load - normal * (away @ q) - dashpot * (away @ w)
            state = kept - alpha / b * np.log(pressed / load)
            friction = pressed * (level + a * np.log(v / speed) + b * state)
            force = force + along * (friction - level * load) + away * (pressed - load)
            changes.append(-v / d_c * (state + np.log(v / speed)))
        return np.concatenate([w, inverse @ force, changes])

    start = np.zeros(2 * size + len(rows))
    found = solve_ivp(rates, (0, times[-1]), start, "LSODA", times, rtol=1e-11, atol=1e-16)
    assert found.success
    return found.y[:size], found.y[size : 2 * size], rows


@pytest.mark.parametrize(("seed", "size", "contacts"), [(1, 4, 1), (2, 6, 2), (3, 9, 2), (4, 4, 1)])
def test_random_structures_move_as_equations_typed_by_hand(seed, size, contacts):
    """Of full dampings, gyroscopic matrices, compliant contacts; the push is a tenth of the direct effect."""
    machine, numbers = random_structure(np.random.default_rng(seed), size, contacts)
    _, _, _, a, _, _, _, _, load, *_ = numbers[4][0]
    push, times = 0.1 * a * load, np.linspace(0, 0.05, 26)
    run = ss.simulate(machine, ss.protocol.DisturbanceStep(at=0, by=push, on="s.p0"), times=times, rtol=1e-10,
                      until=times[-1])  # fmt: skip
    assert run.status == "done"
    q, w, rows = by_hand(numbers, push, times)
    for i, (along, away, *_) in enumerate(rows):
        for name, right in ((f"s.p{i}.x", along @ q), (f"s.p{i}.v", along @ w), (f"s.p{i}.normal.x", away @ q)):
            assert np.max(np.abs(run[name] - right)) < 1e-6 * np.max(np.abs(right)), name


@pytest.mark.parametrize("force", [250.0, 600.0])
def test_small_motion_of_the_reed_grows_and_decays_as_its_rightmost_root_says(force):
    """On both sides of the edge at 355.5 N, by the envelope at two times when other modes have died out."""
    machine = ss.read_rig(EXAMPLE).with_values({"steady_normal_stress": force})
    leading = ss.eigenvalues(machine)[0]
    period = 2 * np.pi / leading.imag
    early, late = (count * period + period * np.arange(64) / 64 for count in (60, 100))
    blow = ss.protocol.DisturbancePulse(at=0, by=1e-4 * force, duration=period / 4, on="reed.tip")
    run = ss.simulate(machine, blow, times=np.concatenate([early, late]), until=late[-1], rtol=1e-9)
    sizes = [np.abs(np.mean(one * np.exp(-2j * np.pi * np.arange(64) / 64)))
             for one in np.split(run["reed.tip.v"], 2)]  # fmt: skip
    assert np.log(sizes[1] / sizes[0]) / (40 * period) == pytest.approx(leading.real, abs=2e-3 * abs(leading))
    assert (sizes[1] > sizes[0]) == (leading.real > 0)


def test_state_space_of_a_structure_has_its_roots():
    machine = reed()
    found = np.linalg.eigvals(ss.state_space(machine).A)
    leading = ss.eigenvalues(machine)[0]
    assert np.min(np.abs(found - leading)) < 1e-8 * abs(leading)


def test_onset_of_the_reed_is_the_same_with_more_elements():
    """The growth of the rightmost root with load is that of `growth_rate`, the edge that of `boundary`."""
    found = ss.hopf(reed(), along="steady_normal_stress")
    assert (found.kind, found.value) == ("supercritical", pytest.approx(355.529682, rel=1e-8))
    step = 1e-3 * found.value
    rates = ss.growth_rate(reed(), {"steady_normal_stress": found.value + step * np.array([-1, 1])})
    assert found.growth_slope == pytest.approx((rates[1] - rates[0]) / (2 * step), rel=1e-3)
    coarse = ss.hopf(ss.read_rig(EXAMPLE), along="steady_normal_stress")
    assert found.coefficient == pytest.approx(coarse.coefficient, rel=1e-2)


def test_results_are_of_points_and_contacts_not_of_inner_coordinates():
    run = ss.simulate(ss.read_rig(EXAMPLE), until=1e-4)
    assert {"reed.tip.x", "reed.tip.v", "reed.tip.normal.x", "tip.slip_rate", "tip.Psi"} <= set(run.data)
    assert not [name for name in run.data if " " in name]


def test_many_runs_vary_loads_but_no_directions():
    machine, push = ss.read_rig(EXAMPLE), ss.protocol.DisturbanceStep(at=0, by=0.1, on="reed.tip")
    loads = [50.0, 500.0]
    many = ss.simulate_many(machine, {"steady_normal_stress": loads}, push, until=0.002)
    for load, end in zip(loads, many.final["reed.tip.v"], strict=True):
        run = ss.simulate(machine.with_values({"steady_normal_stress": load}), push, until=0.002)
        assert end == pytest.approx(run["reed.tip.v"][-1], rel=1e-4)
    with pytest.raises(ss.NotAvailable, match="angle is in the matrices of the structure"):
        ss.simulate_many(machine, {"points.tip.angle": [0.5, 0.6]}, push, until=0.002)


def test_forces_on_points_that_do_not_exist_are_refused():
    with pytest.raises(ss.ParameterError, match=r"reed\.tip"):
        ss.simulate(ss.read_rig(EXAMPLE), ss.protocol.DisturbanceStep(at=0, by=1.0, on="reed.top"), until=1e-3)


@pytest.mark.parametrize(("size", "said"), [(60, "entries, allowed"), (120, "120 degrees of freedom, allowed")])
def test_a_structure_that_is_too_large_to_move_says_what_to_do(size, said):
    full = np.eye(size) + 0.1
    body = structure(np.eye(size), 1e-3 * full @ np.diag(np.arange(1, size + 1)) @ full, 1e4 * full)
    machine = on_belt("s.p{}", body, {0: ss.laws.ConstantNormalStress(preload=10.0)})
    found = ss.analyze(machine)
    assert found.stable is not None
    assert not found.judders
    with pytest.raises(ss.NotAvailable, match=rf"bodies\.s: motion, .*{said}.* reduce"):
        ss.simulate(machine, until=1.0)


def test_a_report_on_a_structure_that_is_too_large_to_move_tells_what_eigenvalues_do(monkeypatch):
    monkeypatch.setattr("steadyslip.machine.structure_elements.MOST_COORDINATES", 20)
    found = ss.analyze(ss.read_rig(EXAMPLE).with_values({"points.tip.angle": 1.04}))
    text = " ".join(motion(found)).replace("\xa0", " ")
    assert (
        "It was not simulated: bodies.reed: motion, kicks, cycles, cures, chances and maps are not offered with" in text
    )
    assert "By its eigenvalues a disturbance of the slip rate by 10 % oscillates at 72" in text
    assert not found.judders


def test_verdict_on_the_reed_tells_what_it_does_instead():
    """Its oscillation at 100 N has grown over the whole run; at 50 N it is large within it."""
    found = ss.analyze(ss.read_rig(EXAMPLE))
    assert found.judders.startswith("tip oscillates: every 1.38 ms between ")
    assert found.judders in str(found).replace("\n", " ")


def test_a_blow_at_a_point_changes_velocities_by_the_inverse_of_the_inertia():
    """q' changes by M⁻¹ e J; where that changes the velocity at the point by one, J is the mass felt there."""
    mass = np.array([[0.7, 0.2, 0.1], [0.2, 0.5, -0.1], [0.1, -0.1, 0.4]])
    body = structure(mass, np.eye(3), 1e4 * (np.eye(3) + 0.1))
    machine = on_belt("s.p{}", body, {0: ss.laws.ConstantNormalStress(preload=10.0)})
    point = operating_point(machine)
    speeds = struck(point, "s.p1", 1.0)
    found = [
        sum(float(share) * speeds[f"{name}.v"] for name, share in point.model.points[f"s.p{i}"].items())
        for i in range(3)
    ]
    right = np.linalg.inv(mass)[:, 1]
    np.testing.assert_allclose(found, right / right[1], rtol=1e-12, atol=1e-14)


def reduced_reed(modes, force):
    machine = ss.read_rig(EXAMPLE)
    small, _ = reduced(machine.bodies["reed"].matrices, (22, 23), modes)
    body = StructureBody(matrices=small, points={"tip": StructurePoint(x=1, y=2, angle=np.radians(60))})
    whole = Machine(bodies={"reed": body}, contacts=dict(machine.contacts), drive=machine.drive)
    return whole.with_values({"steady_normal_stress": force})


def test_cycles_of_a_reduced_reed_are_what_it_settles_on():
    machine = reduced_reed(1, 100.0)
    branch = ss.cycles(machine, along="steady_normal_stress", doublings=0)
    (cycle,) = (one for one in branch.at(100.0) if one.stable)
    times = np.linspace(4.95, 5.0, 20001)
    push = ss.protocol.DisturbancePulse(at=0, by=1.0, duration=1e-3, on="reed.tip")
    run = ss.simulate(machine, push, times=times, until=5.0)
    assert run["tip.slip_rate"].max() == pytest.approx(cycle.peak_velocity, rel=1e-3)


@pytest.mark.parametrize("ask", [
    lambda rig: ss.cycles(rig, along="steady_normal_stress"), lambda rig: ss.threshold(rig, "force", at="reed.tip"),
])  # fmt: skip
def test_cycles_and_kicks_of_many_degrees_of_freedom_say_what_to_do(ask):
    with pytest.raises(ss.NotAvailable, match=r"with 24 degrees of freedom .* reduce them"):
        ask(ss.read_rig(EXAMPLE))


@pytest.mark.parametrize(("kick", "at", "said"), [
    ("displacement", "reed.tip", "in many ways"), ("force", "reed", r"reed\.tip"), ("impulse", None, r"reed\.tip"),
])  # fmt: skip
def test_kicks_are_at_points(kick, at, said):
    with pytest.raises(ss.ParameterError, match=said):
        ss.threshold(reduced_reed(1, 600.0), kick, at=at)
