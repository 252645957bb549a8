"""Conditions that several numbers obey together hold for given, changed and varied values alike, and for scans."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import CONTACTS, SIGMA, rate_state, rig
from steadyslip.linear.roots import quietly
from steadyslip.model.point import operating_point

CRANK = {"preload": SIGMA, "crank_angle": math.radians(30), "crank_radius": 0.1, "rod_length": 0.3}
TWO = (ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.008, d_c=2e-5))
# rig, parameter, a value that is allowed, one that is not, what a message names and says
CASES = {
    "rod": (rig(contact=ss.laws.SliderCrank(**CRANK)), "contact.rod_length", 0.2, 0.09, "more than crank_radius 0.1"),
    "crank": (rig(contact=ss.laws.SliderCrank(**CRANK)), "contact.crank_radius", 0.2, 0.31,
    "more than crank_radius 0.31"),
    "prescribed": (
        rig(contact=ss.laws.Prescribed(preload=SIGMA, amplitude=1e6, period=1.0)),
        "contact.amplitude", 2e6, 6e6, "less than the mean 5000000 Pa",
    ),
    "preload": (
        rig(contact=ss.laws.Prescribed(preload=SIGMA, amplitude=1e6, period=1.0)),
        "contact.preload", 2e6, 9e5, "less than the mean 900000 Pa",
    ),
    "no period": (rig(contact=ss.laws.Prescribed(preload=SIGMA)), "contact.amplitude", 0.0, 1e5, "needs a period"),
    "nagata": (rig(friction=rate_state(evolution=ss.laws.Nagata(c_nagata=0.7))), "friction.b", 0.1, 0.0,
    "divides by b"),
    "shared alpha": (
        rig(friction=rate_state(b=None, d_c=None, states=TWO, normal_memory=ss.laws.LinkerDieterich(alpha=0.4))),
        "friction.states.1.b", 0.1, -0.008, "no way to share",
    ),
    "controller": (rig(stiffness=None, drive=ss.machine.PD(1e-6, kp=9e9)), "drive.kp", 1e9, 0.0, "gain kp > 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=str)
def test_given_changed_and_varied_values_obey_the_same_conditions(case):
    a_rig, name, good, bad, message = CASES[case]
    a_rig.with_values({name: good})
    ss.critical_stiffness(a_rig, {name: [good]})
    with pytest.raises(ss.ParameterError, match=message):
        a_rig.with_values({name: bad})
    for function in (ss.critical_stiffness, ss.stable_stiffness, ss.eigenvalues, ss.growth_rate):
        with pytest.raises(ss.ParameterError, match=rf"{message}(.|\n)*position \(1,\)"):
            function(a_rig, {name: [good, bad, good]})
    with pytest.raises(ss.ParameterError, match=message):
        ss.simulate_many(a_rig, {name: [good, bad]}, until=1.0)
    low, high = sorted([good, bad])
    with pytest.raises(ss.ParameterError, match=message):
        ss.boundary(a_rig, name, between=(low, high))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_scans_stay_inside(case):
    """Edges and the ranges searched are of rigs that can be built, whatever the scan passes over."""
    a_rig, name, *_ = CASES[case]
    edges = ss.boundary(a_rig, name)
    for edge in edges:
        for value in edge.bracket:
            a_rig.with_values({name: value})


def test_several_varied_values_are_compared_position_by_position():
    a_rig = rig(contact=ss.laws.SliderCrank(**CRANK))
    radius, rod = np.array([0.05, 0.1, 0.2]), np.array([0.06, 0.15, 0.3])
    assert ss.critical_stiffness(a_rig, {"crank_radius": radius, "rod_length": rod}).shape == (3,)
    with pytest.raises(ss.ParameterError, match=r"got 0.06; .* crank_radius 0.1 \(at position \(0, 1\)\)"):
        ss.critical_stiffness(a_rig, {"crank_radius": radius, "rod_length": rod[:, None]})


@pytest.mark.parametrize(
    ("piece", "name", "values", "message"),
    [
        (
            ss.protocol.VelocityHarmonic(amplitude=1e-7, period=1.0, until=5.0),
            "protocol.pieces.1.at",
            [0.0, 6.0],
            "after the",
        ),
        (
            ss.protocol.SlideHoldSlide(at=0, hold=1, factor=2, slide=1, repeats=9),
            "protocol.pieces.1.factor",
            [2, 1e99],
            "grow",
        ),
    ],
)
def test_varied_protocols_too(piece, name, values, message):
    with pytest.raises(ss.ParameterError, match=message):
        ss.simulate_many(rig(), {name: np.array(values, dtype=float)}, piece, until=1.0)


def test_slider_cranks_can_be_analysed_at_any_angle():
    """Twelve of forty failed: the scan for edges explained a lock-up of a rod shorter than its crank."""
    random = np.random.default_rng(3)
    for _ in range(6):
        numbers = CRANK | {"crank_angle": random.uniform(-6, 6), "rod_length": 0.1 * (1 + 10 ** random.uniform(-2, 1))}
        contact = ss.laws.SliderCrank(**numbers, stroke=str(random.choice(["pull", "push"])))
        for margin in ss.analyze(rig(contact=contact, stiffness=9e9)).margins:
            if margin.parameter == "contact.rod_length":
                assert margin.searched[0] > 0.1


def test_lock_up_is_called_so():
    """The static stiffness vanishes at lock-up too; rounding may show an unstable sample or two before it."""
    random = np.random.default_rng(0)
    found = []
    for turn, k in zip(random.uniform(0.1, 3.0, 40), random.uniform(1e9, 1e11, 40), strict=True):
        contact = ss.laws.SliderCrank(**CRANK | {"crank_angle": turn}, stroke="push")
        found.append(ss.boundary(rig(friction=rate_state(b=0.01), contact=contact, stiffness=k), "mu_ref")[-1])
        assert found[-1].value == pytest.approx(1 / math.tan(math.asin(math.sin(turn) / 3)), rel=1e-12)
    assert {edge.kind for edge in found} == {"lock-up"}
    assert {edge.stable for edge in found} == {"below"}


def test_the_error_state_of_numpy_is_left_as_it_was():
    @quietly
    def inner():
        return np.geterr()

    @quietly
    def outer(depth):
        found = inner()
        return found if depth == 0 else outer(depth - 1)

    before = np.geterr()
    with ThreadPoolExecutor(4) as pool:
        states = list(pool.map(lambda i: outer(i % 5), range(64)))
    outer(5)
    assert all(state == dict.fromkeys(before, "ignore") for state in states)
    assert np.geterr() == before
    operating_point(CASES["rod"][0], {"contact.rod_length": 0.2})
    ss.critical_stiffness(rig(contact=CONTACTS[1]), {"contact.angle": np.linspace(-0.6, 0.6, 5)})
    assert np.geterr() == before


def test_maps_are_judged_where_their_axes_meet():
    """Each axis may break a condition with the rig's own numbers, but not with the other axis."""
    short = rig(contact=ss.laws.SliderCrank(**CRANK | {"rod_length": 0.15}))
    radius = [0.05, 0.1, 0.2]
    plan = ss.Map(short, over={"crank_radius": radius, "rod_length": [0.25, 0.3, 0.4]})
    assert plan.shape == (3, 3)
    with pytest.raises(ss.ParameterError, match="more than crank_radius"):
        ss.Map(short, over={"crank_radius": radius, "rod_length": [0.15, 0.3, 0.4]})
