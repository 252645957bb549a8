"""Modes identified from responses: the reed of theory 13, and random structures whose roots are known by QZ."""

import numpy as np
import pytest
import scipy.linalg as la

import steadyslip as ss
from responses_at_random import reed_band, reed_response, response_of
from steadyslip.core.errors import NotAvailable
from steadyslip.linear.identification.identify import identify
from steadyslip.linear.identification.modal_machine import modal_machine
from steadyslip.linear.identification.partial_fractions import ModalSum
from steadyslip.machine import ResponseData, StructureBody, StructurePoint
from structures_at_random import reed, reed_matrices

LOAD = "contacts.tip.contact.steady_normal_stress"
EDGES = ((355.529682, 4543.24791), (6297.80596, 2316.02563))


def by_modes(data):
    body = StructureBody(response=data, points={"tip": StructurePoint(angle=np.radians(60))})
    return modal_machine(reed(100.0, body))


def test_derivatives_are_those_of_differences():
    chance = np.random.default_rng(1)
    unknowns, s = chance.standard_normal(2 * 6 + 3), 1j * np.linspace(1, 3, 5)
    slopes = ModalSum.from_unknowns(unknowns, 2, 2).derivatives(s)
    np.testing.assert_array_equal(ModalSum.from_unknowns(unknowns, 2, 2).unknowns, unknowns)
    for i, unit in enumerate(1e-6 * np.eye(len(unknowns))):
        apart = ModalSum.from_unknowns(unknowns + unit, 2, 2)(s) - ModalSum.from_unknowns(unknowns - unit, 2, 2)(s)
        np.testing.assert_allclose(slopes[..., i], apart / 2e-6, atol=1e-6)


@pytest.mark.campaign
def test_the_reed_from_exact_responses():
    found = by_modes(reed_response(reed_band()))
    mass, _, stiffness = reed_matrices()
    omega = np.sqrt(la.eigvalsh(stiffness, mass)[:4])
    np.testing.assert_allclose(found.modes.frequency[:4], omega / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(found.modes.damping_ratio[:4], (1 + 2e-6 * omega**2) / (2 * omega), rtol=1e-8)
    root, _ = found.root_near(complex(10, 4560))
    assert abs(root - (12.4673358145 + 4565.039870161j)) < 1e-9 * abs(root)
    roots = found.roots()
    assert np.sum(roots.real > 0) == 2
    assert np.min(np.abs(roots - root)) < 1e-9 * abs(root)
    for value, omega in EDGES:
        assert found.edge_near(LOAD, 1.01 * value, omega).value == pytest.approx(value, rel=1e-8)


@pytest.mark.campaign
def test_the_reed_with_one_percent_of_noise_lies_within_told_errors():
    """Errors told are those of the best that this noise allows: .5 % of one edge, 1e-5 of the other."""
    scores = []
    for seed in (36, 37):
        found = by_modes(reed_response(reed_band(), 0.01, np.random.default_rng(seed)))
        assert np.sum(found.roots().real > 0) == 2
        root, error = found.root_near(complex(10, 4560))
        scores.append((root.real - 12.4673358145) / error)
        for (value, omega), least in zip(EDGES, (1e-2, 3e-5), strict=True):
            edge = found.edge_near(LOAD, value, omega)
            assert edge.error < least * value
            scores.append((edge.value - value) / edge.error)
    assert np.max(np.abs(scores)) < 3.5
    assert 0.4 < np.sqrt(np.mean(np.square(scores))) < 1.7


def random_response(chance, noise=0.01):
    """Response of two directions of a structure of separate modes, and its poles (1/s)."""
    size = int(chance.integers(2, 6))
    root, axes = chance.standard_normal((2, size, size))
    mass = root @ root.T / size + np.eye(size)
    lower = np.linalg.cholesky(mass)
    omega = 100 * np.cumprod(chance.uniform(1.3, 2, size))
    axes = lower @ la.qr(axes)[0]
    damping = axes @ np.diag(2 * omega * chance.uniform(0.003, 0.03, size)) @ axes.T
    stiffness = axes @ np.diag(omega**2) @ axes.T
    skew = np.block([[np.zeros((size, size)), np.eye(size)], [-la.solve(mass, stiffness), -la.solve(mass, damping)]])
    poles = la.eigvals(skew)
    places = np.linspace(10, 1.3 * omega[-1], 3000)
    data = response_of(mass, damping, stiffness, [0, 1], ["p.x", "p.y"], places, noise, chance)
    return data, np.sort_complex(poles[poles.imag > 0] / 1j)


def scores_of(chance, count):
    """Deviations of frequencies and dampings over their told errors, of random structures."""
    scores = []
    for _ in range(count):
        data, poles = random_response(chance)
        found = identify(data)
        assert np.sum(found.inside) == len(poles), (found.frequency, poles)
        own = np.abs(poles)
        scores += [
            *(
                (2 * np.pi * found.frequency[found.inside] - np.sort(own))
                / (2 * np.pi * found.frequency_error[found.inside])
            )
        ]
        damped = (poles.imag / own)[np.argsort(own)]
        scores += [*((found.damping_ratio[found.inside] - damped) / found.damping_ratio_error[found.inside])]
    return np.array(scores)


def test_errors_told_cover_those_made():
    scores = scores_of(np.random.default_rng(5), 4)
    assert np.max(np.abs(scores)) < 4
    assert 0.6 < np.sqrt(np.mean(scores**2)) < 1.5


@pytest.mark.campaign
def test_errors_told_cover_those_made_of_many():
    scores = scores_of(np.random.default_rng(6), 40)
    assert np.max(np.abs(scores)) < 4.5
    assert np.sqrt(np.mean(scores**2)) == pytest.approx(1, abs=0.15)
    assert np.mean(np.abs(scores) < 1.96) > 0.9


def test_shapes_are_those_of_unit_modal_mass():
    omega = np.linspace(5, 100, 1500)
    shape = np.array([0.8, -0.3])
    response = np.outer(shape, shape) / (900 - omega**2 + 0.6j * omega)[:, None, None]
    found = identify(ResponseData(omega, response, 0.01 * np.abs(response), ("p.x", "p.y")))
    assert len(found.frequency) == 1
    np.testing.assert_allclose(np.abs(found.shape[0]), np.abs(shape), rtol=1e-6)
    assert np.all(found.shape_error < 1e-3)
    assert "30/" not in str(found)
    assert f"{30 / (2 * np.pi):.6g}" in str(found)


def test_responses_of_no_reciprocal_modes_are_refused():
    omega = np.linspace(5, 100, 400)
    one = 1 / (900 - omega**2 + 0.6j * omega)
    response = np.stack([np.stack([one, 2 * one], 1), np.stack([-one, one], 1)], 1)
    with pytest.raises(NotAvailable, match="no sum of reciprocal modes describes the response"):
        identify(ResponseData(omega, response, 0.001 * np.abs(response), ("p.x", "p.y")))
    with pytest.raises(NotAvailable, match="give a structure its `response`"):
        ss.linear.identified_modes(reed())


@pytest.mark.parametrize(("of", "share", "said"), [
    (lambda omega, one: -np.ones_like(one) / omega[:, None, None] ** 2, 0.0, "describes the response"),
    (lambda omega, one: 1e200 * one, 0.01, "check units"), (lambda omega, one: 1e-200 * one, 0.01, "check units"),
    (lambda omega, one: 0 * one, 0.0, "never answer"), (lambda omega, one: one.conj(), 0.01, "times its errors"),
])  # fmt: skip
def test_what_holds_no_modes_is_refused_in_words(of, share, said):
    omega = np.linspace(1, 100, 200)
    one = of(omega, (1 / (900 - omega**2 + 0.6j * omega))[:, None, None] * np.array([[1, 0.3], [0.3, 0.09]]))
    with pytest.raises(NotAvailable, match=said):
        identify(ResponseData(omega, one, share * np.abs(one), ("p.x", "p.y")))
