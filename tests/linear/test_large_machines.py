"""Machines too large to be written out in symbols: matrices, against symbols on small ones and typed equations."""

import numpy as np
import pytest

import steadyslip as ss
from machines import stacked_pads
from machines_both_ways import differences, machine_of, row_of_blocks
from machines_in_the_plane import is_root
from steadyslip.linear.boundary import _search
from steadyslip.linear.coupling import search_for
from steadyslip.linear.matrix_route import require_matrices
from steadyslip.linear.matrix_search import MatrixSearch
from steadyslip.model.numeric import by_matrices
from steadyslip.verdict.matrix_checks import _growing_by_turns


@pytest.mark.parametrize(("kind", "seed"), [("row", 3), ("plane", 3)])
def test_both_routes_agree(kind, seed):
    """Eigenvalues, and the edges of all parameters with lock-up and lift-off."""
    assert not differences(machine_of(kind, seed))


@pytest.mark.parametrize("seed", [14, 25, 28])
def test_eigenvalues_agree_where_friction_remembers_a_normal_stress_that_follows(seed):
    machine = machine_of("row", seed)
    np.testing.assert_allclose(require_matrices(machine).pencil.eigenvalues, ss.eigenvalues(machine), rtol=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("kind", "seed"), [*(("row", seed) for seed in (8, *range(20, 24))), ("plane", 0), ("plane", 1), ("plane", 6)]
)
def test_both_routes_agree_on_more(kind, seed):
    assert not differences(machine_of(kind, seed))


@pytest.mark.parametrize(("count", "everywhere"), [(20, False), (8, True)])
def test_rows_of_blocks_have_the_roots_of_typed_equations(count, everywhere):
    machine, matrix = row_of_blocks(count, everywhere)
    assert by_matrices(machine)
    found = ss.eigenvalues(machine)
    assert len(found) == 2 * count + (count if everywhere else 1)
    assert all(is_root(matrix, s) for s in found)
    edge = (
        ss.boundary(machine, "to-b3.stiffness")[0]
        if everywhere
        else ss.boundary(machine, f"at-b{count - 1}.friction.b")[0]
    )
    at = ss.eigenvalues(machine, {edge.parameter: edge.value})
    assert abs(at[0].real) < 1e-9 * abs(at[0])


@pytest.mark.parametrize("name", ["contacts.at-pad0.contact.normal_stiffness", "bodies.pad2.mass", "drive.velocity"])
def test_edges_of_machines_without_a_written_polynomial_are_sought_by_matrices(name):
    """Three pads have 15 states: on both routes edges are numbers, and alike; the onset stays with the equations."""
    machine = stacked_pads(3)
    assert not by_matrices(machine)
    found = _search(machine, name, machine.kept_zeros(), 0)
    assert isinstance(found, MatrixSearch)
    assert not isinstance(_search(stacked_pads(2), "bodies.pad0.mass", (), 0), MatrixSearch)
    own, other = found.boundaries(), search_for(machine, name, machine.kept_zeros(), 0).boundaries(None)
    least = 1e-9 * found.value  # what lies nearer to zero is a zero that rounding hides
    one, two = ([(edge.kind, edge.stable, edge.value) for edge in several if edge.value > least]
                for several in (own, other))  # fmt: skip
    assert [row[:2] for row in one] == [row[:2] for row in two]
    assert one
    np.testing.assert_allclose([row[2] for row in one], [row[2] for row in two], rtol=1e-8)


def test_turns_that_rounding_makes_are_not_followed_for_long():
    """A body that only friction holds: without contacts the slow end of the response is rounding."""
    with np.errstate(all="ignore"):  # as in `analyze`: the slow end overflows
        assert _growing_by_turns(require_matrices(machine_of("plane", 14))) is None
        assert _growing_by_turns(require_matrices(machine_of("plane", 23))) is None


@pytest.mark.campaign
def test_four_pads_in_a_row_are_answered():
    """Edges lie where the rightmost pair crosses the axis, found by eigenvalues on both sides."""
    machine = stacked_pads(4)
    assert by_matrices(machine)
    assert not by_matrices(stacked_pads(3))
    found = ss.analyze(machine)
    assert found.stable
    assert all(one.passed for one in found.checks)
    edge = found.margins[0].edge
    rates = ss.growth_rate(machine, {edge.parameter: [edge.value * (1 - 1e-6), edge.value * (1 + 1e-6)]})
    assert (rates[0] < 0) != (rates[1] < 0)
    assert "the nearest edge is that of" in found.reason


def test_kicks_and_motion_use_the_same_machine():
    """A large machine is simulated by its Model: at steady sliding nothing moves."""
    machine, _ = row_of_blocks(10)
    run = ss.simulate(machine, until=5.0)
    np.testing.assert_allclose(run["b9.v"], run["b9.v"][0], rtol=1e-9)
