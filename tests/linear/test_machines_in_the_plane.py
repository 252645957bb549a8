"""Machines whose bodies hold each other in many ways: links' forces and polynomials that are too long to be written."""

import glob

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, stacked_pads
from machines_in_the_plane import compare
from steadyslip.model import build, point, statics
from steadyslip.model.eigenvalues import coefficients_from_eigenvalues
from steadyslip.model.linearisation import is_written_out
from steadyslip.model.point import operating_point
from steadyslip.model.range import quasipolynomial


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(12))
def test_eigenvalues_are_roots_of_theory_11s_matrix(seed):
    assert compare(seed) in ("agrees", "no steady sliding")


@pytest.mark.parametrize(
    "machine", [at_random(0)[0], at_random(3, 0.4)[0], stacked_pads(2), stacked_pads(2, 0.0, -10.0)]
)
def test_the_polynomial_of_the_eigenvalues_is_the_one_that_is_written_out(machine):
    """With a delay; and of bodies without mass with a root far right, where signs of the highest coefficient meet."""
    place = operating_point(machine)
    assert is_written_out(place.model)
    written, _ = quasipolynomial(place)
    scale = np.max(np.abs(written), axis=0)  # of q, what p + q and p leave
    for i, own in enumerate(coefficients_from_eigenvalues(place)):
        np.testing.assert_allclose(own / scale, written[i] / scale, atol=1e-9)


def test_what_links_carry_is_the_same_in_formulas_and_in_numbers(monkeypatch):
    """Of every example."""

    def told():
        build._build_cached.cache_clear()
        point._cached_point.cache_clear()
        found = []
        for path in sorted(glob.glob("examples/machines/*.toml")):
            machine = ss.read_rig(path)
            seen = ss.steady_state(machine)
            found.append((ss.eigenvalues(machine), [seen.links[name] for name in sorted(seen.links)]))
            assert (operating_point(machine).model.carried is not None) == (statics.MAX_TERMS == 0)
        return found

    formulas = told()
    monkeypatch.setattr(statics, "MAX_TERMS", 0)
    numbers = told()
    monkeypatch.undo()
    told()
    for (one, forces), (other, others) in zip(formulas, numbers, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-9)
        np.testing.assert_allclose(others, forces, rtol=1e-9, atol=1e-12 * np.max(np.abs(forces)))


def test_three_pads_answer_like_smaller_machines():
    """The verdict, edges and modes of what has no formulas; two routes to its eigenvalues; its motion."""
    machine = stacked_pads(3)
    model = operating_point(machine).model
    assert model.carried is not None
    assert not is_written_out(model)
    found = ss.eigenvalues(machine)
    own = np.linalg.eigvals(ss.state_space(machine).A)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(own), rtol=1e-9)
    (edge, *_) = ss.boundary(machine, "links.aslant-pad0.stiffness")
    at_edge = ss.eigenvalues(machine, {"links.aslant-pad0.stiffness": edge.value})
    assert abs(at_edge[0].real) < 1e-9 * abs(at_edge[0])
    assert abs(at_edge[0].imag) == pytest.approx(edge.angular_frequency, rel=1e-6)
    with pytest.raises(ss.NotAvailable, match="too long"):
        ss.explore(machine)
