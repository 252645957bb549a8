"""Continuation itself, and the flow that it continues cycles of."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import CONTACTS, LAWS, rig
from steadyslip.nonlinear.continuation import Failure, SolutionCurve
from steadyslip.nonlinear.orbits import flow as flow_module
from steadyslip.nonlinear.orbits.cut_segments import _cuts
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.shooting import multipliers

# -- continuation itself


def test_continuation_follows_a_circle_all_the_way_round():
    def circle(u):
        return np.array([u @ u - 1]), 2 * u[None]

    curve = SolutionCurve(circle)
    start = curve.start(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    angles = []
    for point in curve.follow(start, 0.05, 1e-6, 0.2):
        assert point.u @ point.u == pytest.approx(1, abs=1e-12)
        angles.append(np.arctan2(point.u[1], point.u[0]))
        if point.length > 7:
            break
    assert np.unwrap(angles)[-1] > 2 * np.pi


def test_continuation_asks_for_a_jacobian_once_a_point_where_residuals_are_cheap():
    full, cheap = [], []

    def both(u):
        return np.array([u @ u - 1]), 2 * u[None]

    def equations(u):
        full.append(u)
        return both(u)

    def residuals(u):
        cheap.append(u)
        return both(u)[0]

    curve = SolutionCurve(equations, residuals=residuals)
    here = curve.start(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    full.clear()
    points = [point for _, point in zip(range(40), curve.follow(here, 0.05, 1e-6, 0.2), strict=False)]
    assert max(abs(point.u @ point.u - 1) for point in points) < 1e-12
    assert (len(full), len(cheap) > 80) == (40, True)


def test_continuation_starts_from_an_improved_prediction():
    """The first unknown is exponential in the second: it is off by far more than the curve is bent."""

    def late(u):
        grown = np.exp(np.minimum(2000 * (u[0] - np.sin(3 * u[1])), 700.0))
        return np.array([grown - 1]), 2000 * grown * np.array([[1.0, -3 * np.cos(3 * u[1])]])

    taken = []
    for improved in (None, lambda u, reach: np.array([u[0] + np.clip(np.sin(3 * u[1]) - u[0], -reach, reach), u[1]])):
        curve = SolutionCurve(late, improved=improved)
        here = curve.start(np.zeros(2), np.array([3.0, 1.0]) / np.sqrt(10))
        taken.append(next(i for i, point in enumerate(curve.follow(here, 0.2, 1e-6, 0.5)) if point.u[1] > 2))
    assert taken[1] < 0.7 * taken[0]


def test_a_zero_is_located_between_points_that_are_not_neighbours_in_length():
    """Planes lie as far apart as the points do along the tangent, however long the curve between them is."""
    curve = SolutionCurve(lambda u: (np.array([u @ u - 1]), 2 * u[None]))
    low = curve.start(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    high = replace(curve.start(np.array([0.5, 0.8]), np.array([-0.8, 0.5])), length=1.9)
    ends = [point.u[1] - 0.3 for point in (low, high)]
    found = curve.located(low, high, lambda point: point.u[1] - 0.3, *ends)[1]
    assert found.u == pytest.approx([np.sqrt(0.91), 0.3], abs=1e-9)


def test_continuation_locates_a_fold():
    def parabola(u):
        return np.array([u[0] ** 2 + u[1] - 0.3]), np.array([[2 * u[0], 1.0]])

    curve = SolutionCurve(parabola)
    here = curve.start(np.array([-1.0, -0.7]), np.array([1.0, 1.0]) / np.sqrt(2))
    for ahead in curve.follow(here, 0.1, 1e-6, 0.3):
        if here.tangent[1] * ahead.tangent[1] < 0:
            pair = curve.located(here, ahead, lambda p: p.tangent[1], here.tangent[1], ahead.tangent[1])
            assert pair[1].u == pytest.approx([0, 0.3], abs=1e-9)
            break
        here = ahead


def test_continuation_says_when_it_cannot_go_on():
    def ends(u):
        if u[1] > 1:
            raise Failure("a wall")
        return np.array([u[0] - u[1]]), np.array([[1.0, -1.0]])

    curve = SolutionCurve(ends)
    start = curve.start(np.zeros(2), np.ones(2) / np.sqrt(2))
    with pytest.raises(Failure, match="a wall"):
        list(curve.follow(start, 0.1, 1e-4, 0.2))


def test_continuation_does_not_jump_to_another_curve():
    """Two lines side by side: Newton's method, sent too far, lands on the other one; the step is refused."""

    def two_lines(u):
        y = u[0] - 0.3 * np.tanh(20 * (u[1] - 0.5))  # a bend, and the same curve one further up
        bend = 6 / np.cosh(20 * (u[1] - 0.5)) ** 2
        slope = np.pi * np.cos(np.pi * y)
        return np.array([np.sin(np.pi * y)]), np.array([[slope, -slope * bend]])

    curve = SolutionCurve(two_lines)
    start = curve.start(np.array([-0.3, 0.0]), np.array([0.0, 1.0]))
    for point in curve.follow(start, 0.4, 1e-6, 0.4):
        assert point.u[0] == pytest.approx(0.3 * np.tanh(20 * (point.u[1] - 0.5)), abs=1e-9)
        if point.u[1] > 1.5:
            break


def corrected_by(steps, reach=np.inf):
    """Newton's method where its steps are given, one after another; the last is taken again and again."""
    left = list(steps)

    def equations(u):
        return np.array([left.pop(0) if len(left) > 1 else left[0]]), np.array([[1.0, 0.0]])

    return SolutionCurve(equations).corrected(np.zeros(2), np.array([0.0, 1.0]), 0.0, reach)


def test_newton_ends_at_rounding_and_may_step_back_once():
    """Steps no longer shrink where what is solved is noisy; next to the solution one may be larger than before."""
    assert corrected_by([0.1, 1e-3, 4e-9, 3e-9]).iterations == 4  # tolerance 1e-9
    assert corrected_by([0.1, 1e-3, 1e-5, 1e-7, 8e-6, 1e-10]).iterations == 6
    for growing in ([0.1, 1e-2, 1e-3, 1e-6, 1e-3, 1e-10], [0.1, 1e-2, 1e-2, 0.3, 1e-10]):
        with pytest.raises(Failure, match="does not converge"):
            corrected_by(growing)


def test_newton_must_end_near_the_guess_and_may_stray_a_little():
    found = corrected_by([0.5, -0.45, 1e-10], reach=0.1)
    assert np.abs(found.u).max() == pytest.approx(0.05)
    for straying in ([0.3, 1e-10], [1.5, -1.5, 1e-10]):  # ends beyond reach; was ten times farther on the way
        with pytest.raises(Failure, match="too far"):
            corrected_by(straying, reach=0.1)


# -- the flow and its derivatives


def uncompiled(made):
    """What makes a program, with the program left as text."""
    return lambda *arguments: replace(made(*arguments), plain=True)


@pytest.mark.parametrize(
    ("law", "mass"),
    [("slip", 0.0), ("nagata regularised", 0.0), ("two states", 0.0), ("aging+ld", 1e8),
     pytest.param("prakash-clifton", 1e8, marks=pytest.mark.campaign)],
)  # fmt: skip
@pytest.mark.slow
def test_sensitivities_are_derivatives_of_the_flow(law, mass, monkeypatch):
    """Of end states in starting states and in the parameter, against central differences of other runs.

    Those with mass on machine code, as their steps are many; the others on the text that it is made from.
    """
    if not mass:
        for name in ("runner", "_with_sensitivities"):
            monkeypatch.setattr(flow_module, name, uncompiled(getattr(flow_module, name)))
    a_rig = rig(friction=LAWS[law], mass=mass, stiffness=3e9, radiation_damping=1e10)
    flow = Flow(a_rig, "slider.stiffness", rtol=1e-11)
    setting = flow.setting(3e9)
    state = flow.steady(3e9) + 0.3 * flow.scales * np.cos(np.arange(flow.size) + 0.5)
    time = np.array([2 * flow.time])
    _, matrix, slope = flow.run(setting, state[None], time)
    for k in range(flow.size):
        step = 1e-4 * flow.scales * (np.arange(flow.size) == k)
        ends = [flow.run(setting, (state + sign * step)[None], time)[0][0] for sign in (1, -1)]
        expected = (ends[0] - ends[1]) / (2 * step[k])
        size = flow.scales / flow.scales[k]
        assert matrix[0, :, k] / size == pytest.approx(expected / size, rel=2e-5, abs=2e-6)
    ends = [flow.run(flow.setting(3e9 * (1 + sign * 1e-5)), state[None], time)[0][0] for sign in (1, -1)]
    expected = (ends[0] - ends[1]) / 2e-5
    assert slope[0] / flow.scales == pytest.approx(expected / flow.scales, rel=2e-5, abs=2e-5)


@pytest.mark.parametrize("contact", [CONTACTS[1], CONTACTS[9]], ids=lambda c: type(c).__name__)
def test_field_is_the_linearisation_at_steady_sliding(contact):
    a_rig = rig(contact=contact, stiffness=5e9)
    flow = Flow(a_rig, "slider.stiffness")
    setting = flow.setting(5e9)
    rates, jacobian, slope = flow.field(setting, flow.steady(5e9)[None])
    assert rates[0] / flow.scales == pytest.approx(np.zeros(flow.size), abs=1e-9)
    assert slope[0] / flow.scales == pytest.approx(np.zeros(flow.size), abs=1e-8)
    own = ss.eigenvalues(a_rig)
    found = np.linalg.eigvals(jacobian[0])
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(own[np.isfinite(own)]), rel=1e-7)


def test_multipliers_do_not_depend_on_the_number_of_segments():
    rng = np.random.default_rng(1)
    whole = [np.diag([1e3, 1.0, 1e-2]) + 0.1 * rng.normal(size=(3, 3)) for _ in range(3)]
    rates = [rng.normal(size=3)]
    for s in whole[:2]:
        rates.append(s @ rates[-1])
    back = np.outer(rates[0] - whole[2] @ rates[-1], rates[-1]) / (rates[-1] @ rates[-1])
    pieces = np.array([whole[0], whole[1], whole[2] + back])  # the last brings the rate back: a closed motion
    together = (pieces[2] @ pieces[1] @ pieces[0])[None]
    trivial, many = multipliers(pieces, np.array(rates))
    single, one = multipliers(together, np.array(rates[:1]))
    assert (trivial, single) == pytest.approx((1, 1), rel=1e-6)
    assert many[0] == pytest.approx(one[0], rel=1e-6)
    assert np.prod(many) == pytest.approx(np.linalg.det(together[0]), rel=1e-6)


def test_small_mass_does_not_hide_the_direction_of_motion():
    """Rounding in the state, blown up by 1/mass, is most of the rates; carried round once they are true."""
    rng = np.random.default_rng(3)
    along, fast, slow = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    whole = np.outer(along, along) + 0.3 * np.outer(slow, slow) + 1e-12 * np.outer(fast, fast)
    for noise in (0.0, 5.0):
        trivial, others = multipliers(whole[None], (along + noise * fast)[None])
        assert trivial == pytest.approx(1, abs=1e-9)
        assert others[0] == pytest.approx(0.3, rel=1e-9)


def test_cuts_are_made_where_deviations_across_the_motion_grow():
    grow, still = np.diag([0.0, 100.0, 1.0]), np.diag([0.0, 1.0, 0.5])
    assert _cuts(np.array([still, grow, still, grow, still, grow, still])) == [0, 3, 5]
    assert _cuts(np.array([still] * 9)) == [0]
