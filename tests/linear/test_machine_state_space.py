"""Machines as state spaces: eigenvalues, and responses of a matrix typed by hand, theory 11."""

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, surface, two_mass


def response(system, s):
    return system.C @ np.linalg.solve(s * np.eye(len(system.A)) - system.A, system.B) + system.D


@pytest.mark.parametrize("seed", [0, 1, 3, *(pytest.param(s, marks=pytest.mark.campaign) for s in (2, 4, 5))])
def test_places_answer_to_forces_as_the_matrix_typed_by_hand(seed):
    machine, matrix = at_random(seed)
    system, names = ss.state_space(machine), list(machine.bodies)
    rows = [system.output_names.index(f"{name}.x") for name in names]
    for s in (0.7 + 1.3j, 5j):
        found, inverse = response(system, s), np.linalg.inv(matrix(s))
        for j, name in enumerate(names):
            column = found[rows, system.input_names.index(f"{name}.push")]
            np.testing.assert_allclose(column, inverse[:, j], rtol=1e-11, atol=1e-12 * np.max(np.abs(inverse)))
    poles, own = (np.sort_complex(found) for found in (np.linalg.eigvals(system.A), ss.eigenvalues(machine)))
    np.testing.assert_allclose(poles, own[~np.isnan(own)], rtol=1e-9)


def nut(damping=0.0):
    """A motor, a nut without mass between two springs, and a table: the nut's place follows from its neighbours'."""
    return ss.Machine(
        bodies={
            "motor": ss.machine.SlidingBody(mass=2.0),
            "nut": ss.machine.SlidingBody(mass=0.0),
            "table": ss.machine.SlidingBody(mass=5.0),
        },
        links={
            "shaft": ss.machine.Spring(between=("drive", "motor"), stiffness=3.0, damping=0.7),
            "screw": ss.machine.Spring(between=("motor", "nut"), stiffness=40.0, damping=damping),
            "bracket": ss.machine.Spring(between=("nut", "table"), stiffness=60.0),
        },
        contacts={"guide": surface("table", ss.laws.RateState(a=0.5, b=0.8, d_c=1.0, mu_ref=0.6, v_ref=1.0))},
        drive=ss.machine.Pull(velocity=1.0),
    )


def typed(s, damping=0.0):
    """Of `nut`: forces on motor, nut and table from their places."""
    f, slope, r = 0.5, -0.3, 1.0
    screw, bracket = 40.0 + damping * s, 60.0
    friction = s * (f * s + r * slope) / (s + r)
    return np.array([
        [2 * s**2 + 3 + 0.7 * s + screw, -screw, 0],
        [-screw, screw + bracket, -bracket],
        [0, -bracket, 5 * s**2 + bracket + friction],
    ])  # fmt: skip


def test_a_body_without_mass_between_springs_is_no_state():
    system = ss.state_space(nut())
    assert system.state_names == ("motor.x", "motor.v", "table.x", "table.v", "guide.Theta")
    assert "nut.push" not in system.input_names
    assert "nut.v" in system.output_names
    rows = [system.output_names.index(f"{name}.x") for name in ("motor", "nut", "table")]
    s = 0.3 + 2j
    found, inverse = response(system, s), np.linalg.inv(typed(s))
    for j, name in ((0, "motor"), (2, "table")):
        column = found[rows, system.input_names.index(f"{name}.push")]
        np.testing.assert_allclose(column, inverse[:, j], rtol=1e-12)
    # places count from steady sliding at the drive's own velocity: the shaft pulls with (k + c s) times its way, v/s
    by_drive = inverse @ np.array([(3 + 0.7 * s) / s, 0, 0])
    velocities = [system.output_names.index(f"{name}.v") for name in ("motor", "nut", "table")]
    column = found[velocities, system.input_names.index("load_velocity")]
    np.testing.assert_allclose(column, s * by_drive, rtol=1e-12)
    with pytest.raises(ss.NotAvailable, match=r"nut\.push moves a body without mass at once.*a mass or a dashpot"):
        ss.state_space(nut(), inputs=["nut.push"])


@pytest.mark.parametrize("stiff", [1e5, 1e16, 1e26])
def test_a_state_space_has_the_eigenvalues_of_its_machine_or_is_refused(stiff):
    """Whichever link is the stiff one: beside bodies with mass, beside one without, with a dashpot or without."""
    refused = 0
    for machine, name in ((two_mass(), "screw"), (nut(), "screw"), (nut(0.01), "screw"), (nut(0.01), "bracket")):
        stiffened = machine.with_values({f"links.{name}.stiffness": stiff})
        right = ss.eigenvalues(stiffened)
        right = right[~np.isnan(right)]
        assert len(right) == len(ss.eigenvalues(machine)[~np.isnan(ss.eigenvalues(machine))])
        try:
            found = np.linalg.eigvals(ss.state_space(stiffened).A)
        except ss.NotAvailable:
            with pytest.raises(ss.NotAvailable, match=rf"links\.{name}\.stiffness = 1e\+\d\d N/m is the largest"):
                ss.state_space(stiffened)
            refused += 1
            continue
        assert len(found) == len(right)
        apart = np.abs(found[:, None] - right[None, :])
        assert np.all(np.min(apart, axis=0) <= 1e-6 * np.abs(right))
    assert refused == {1e5: 0, 1e16: refused, 1e26: 4}[stiff]


def test_a_little_damping_makes_it_one():
    system, s = ss.state_space(nut(damping=0.01)), 0.3 + 2j
    assert "nut.x" in system.state_names
    inverse = np.linalg.inv(typed(s, damping=0.01))
    found = response(system, s)[system.output_names.index("nut.x"), system.input_names.index("nut.push")]
    np.testing.assert_allclose(found, inverse[1, 1], rtol=1e-11)


def test_what_is_asked_for_comes_in_that_order():
    system = ss.state_space(two_mass(), ["table.v", "guide.friction_force"], ["table.push"])
    assert system.C.shape == (2, 5)
    assert system.D.shape == (2, 1)
    with pytest.raises(ss.UnknownNameError, match=r"did you mean 'table\.v'"):
        ss.state_space(two_mass(), ["tabel.v"])
    with pytest.raises(ss.UnknownNameError, match=r"unknown input 'table'"):
        ss.state_space(two_mass(), inputs=["table"])
    named = ss.linear.to_control(two_mass(), ["table.v"])
    assert (named.output_labels, named.input_labels[1]) == (["table_v"], "motor_push")
