"""Basins of machines: those of sliders by another route, planes of bodies with and without mass, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from machines import same_block, two_mass

X, V = np.linspace(-6.0, 6.0, 4), np.geomspace(0.1, 30.0, 3)


@pytest.mark.parametrize("seed", [7, pytest.param(1, marks=pytest.mark.campaign)])
def test_a_machine_of_one_body_has_the_basin_of_its_slider(seed):
    """With mass and without, where the first memory variable follows from the velocity."""
    block, machine = same_block(seed)
    k = 1.6 * ss.hopf(block).value
    block, machine = block.with_values({"stiffness": k}), machine.with_values({"links.spring.stiffness": k})
    own, found = ss.basin(block, X, V), ss.basin(machine, X, V)
    np.testing.assert_array_equal(found.outcome, own.outcome)
    assert (found.names, found.units, found.steady) == (("block.x", "block.v"), ("m", "m/s"), (0.0, 1.0))


def test_a_start_within_a_basin_returns_and_one_beyond_does_not():
    machine = two_mass(kp=4.0, kd=1.0)
    found = ss.basin(machine, [0.0, 0.5], [1.0, 400.0])
    assert found.names == ("table.x", "table.v")
    assert found.outcome[0, 0] == "returns"
    for (i, j), outcome in np.ndenumerate(found.outcome):
        start = {"table.x": found.x[j], "table.v": found.v[i]}
        run = ss.simulate(machine, until=300.0, initial=start, times=np.linspace(280.0, 300.0, 200))
        settled = run.status == "done" and np.ptp(run["table.v"]) < 1e-2
        assert settled == (outcome == "returns")
    motor = ss.basin(machine, [0.0, 0.1], [1.0, 1.5], at="motor")
    assert motor.names == ("motor.x", "motor.v")
    assert motor.plot().get_ylabel() == "velocity of motor (m/s)"


def test_without_mass_the_memory_of_its_contact_is_beside_the_place_of_a_body():
    machine = two_mass(kp=4.0).with_values({"bodies.table.mass": 0.0})
    found = ss.basin(machine, [0.0, 0.1], [0.0, 0.1])
    assert (found.names, found.units) == (("table.x", "guide.Theta"), ("m", "1"))
    assert found.plot().get_ylabel() == "memory Theta of guide (1)"
    said = any("every starting point" in text.get_text() for text in found.plot().texts)
    assert (said, np.unique(found.outcome).tolist()) == (True, ["returns"])
    fails = replace(found, outcome=np.where(found.x > 0, "oscillation", found.outcome))
    assert not any("every starting point" in text.get_text() for text in fails.plot().texts)


def test_planes_that_cannot_be_are_refused():
    with pytest.raises(ss.ParameterError, match="did you mean 'table'"):
        ss.basin(two_mass(), at="tabel")
    with pytest.raises(ss.ParameterError, match="one block without a name; leave the argument out"):
        ss.basin(same_block(7)[0], at="block")


def test_a_massless_machine_starts_as_fast_as_it_is_told():
    """It was ignored: the memory that goes with a velocity is the same as that of the slider."""
    block, machine = same_block(2)
    own = ss.simulate(block, until=1.0, initial={"v": 2.0})
    found = ss.simulate(machine, until=1.0, initial={"block.v": 2.0})
    assert found["block.v"][0] == pytest.approx(2.0, rel=1e-12)
    assert found["block.v"][-1] == pytest.approx(own["v"][-1], rel=1e-9)


def test_nothing_is_drawn_where_nothing_returns():
    with pytest.raises(ss.NotAvailable, match="no basin: steady sliding of this rig is unstable"):
        ss.basin(two_mass(kp=1.0))
