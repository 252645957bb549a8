"""Kicks of machines: those of a slider by another route, of bodies in their own units, and what motion does."""

import numpy as np
import pytest

import steadyslip as ss
from joint_unknowns import heavy_footed, two_smooth, wedges
from machines import same_block, surface, two_mass

COARSE = 1e-3


def pair(seed, factor=1.6):
    """A slider that is stable with a margin, and the machine that it is."""
    block, machine = same_block(seed)
    k = factor * ss.hopf(block).value
    return block.with_values({"stiffness": k}), machine.with_values({"links.spring.stiffness": k})


@pytest.mark.parametrize(
    ("seed", "kick", "of_machine", "at", "direction"),
    [
        (7, "velocity", "velocity", None, -1), (5, "impulse", "impulse", "block", 1),
        pytest.param(1, "impulse", "impulse", "block", 1, marks=pytest.mark.campaign),
        pytest.param(7, "normal-stress", "normal-force", "base", 1, marks=pytest.mark.campaign),
        pytest.param(1, "velocity", "velocity", None, 1, marks=pytest.mark.campaign),
    ],
)  # fmt: skip
def test_a_machine_of_one_body_survives_what_its_slider_does(seed, kick, of_machine, at, direction):
    """The steady sliding after the kick is a formula for a slider, found by Newton's method for a machine."""
    block, machine = pair(seed)
    own = ss.threshold(block, kick, direction=direction, precision=COARSE)
    found = ss.threshold(machine, of_machine, at=at, direction=direction, precision=COARSE)
    assert (found.outcome, found.edge, found.decided) == (own.outcome, own.edge, own.decided)
    if own.edge:
        assert found.amount == pytest.approx(own.amount, rel=1e-7)
    elif np.isfinite(own.size):
        assert found.amount == pytest.approx(own.amount, rel=3 * COARSE)
    else:
        np.testing.assert_equal(found.size, own.size)


def weak():
    """A light table on a controlled motor, all of it without dashpots at the load point."""
    return ss.Machine(
        bodies={"motor": ss.machine.RotatingBody(inertia=0.5), "table": ss.machine.SlidingBody(mass=0.0)},
        links={
            "shaft": ss.machine.Shaft(between=("drive", "motor"), stiffness=4.0),
            "brake": ss.machine.Shaft(between=("ground", "motor"), damping=1.5),
            "screw": ss.machine.Screw(between=("motor", "table"), lead=1.0, stiffness=3.0),
        },
        contacts={"guide": surface("table", ss.laws.RateState(a=0.5, b=0.8, d_c=1.0, mu_ref=0.6, v_ref=1.0))},
        drive=ss.machine.RotaryPull(velocity=1.0),
    )


@pytest.mark.parametrize(
    ("kick", "at", "unit"),
    [
        ("velocity", None, "rad/s"), ("displacement", None, "rad"), ("velocity", "motor", "rad/s"),
        ("displacement", "table", "m"), ("force", "motor", "N m"), ("force", "table", "N"),
        ("normal-force", "guide", "N"), ("impulse", "motor", "N m s"),
    ],
)  # fmt: skip
def test_kicks_are_in_the_units_of_what_is_kicked(kick, at, unit):
    from steadyslip.nonlinear.kicks.kicks import Kicked

    kicked = Kicked(weak(), kick, 1, "before", {}, 0, 1e-6, at)
    assert kicked.unit_name == unit
    assert kicked.stable[0]
    assert kicked.size_of(float(kicked.amount(0.3)[0])) == pytest.approx(0.3)


def test_after_a_kick_of_its_inputs_a_machine_slides_where_it_would():
    """A step of the drive's velocity leads to the steady sliding of the machine that is driven so fast."""
    from steadyslip.nonlinear.kicks.kicks import Kicked

    machine = two_mass(kp=4.0)
    kicked = Kicked(machine, "velocity", 1, "before", {}, 0, 1e-6)
    which, sizes = np.zeros(2, dtype=int), np.array([0.1, -0.7])
    rest = kicked.rest_after(which, sizes)
    for i, velocity in enumerate(np.exp(sizes)):
        other = machine.with_values({"drive.velocity": velocity})
        found = np.sort_complex(rest.roots[i])
        np.testing.assert_allclose(found, np.sort_complex(ss.eigenvalues(other)), rtol=1e-6)


@pytest.mark.parametrize(
    "machine",
    [two_smooth(), wedges(one=1.0, two=2.0), heavy_footed()],
    ids=["velocities", "frictions", "accelerations"],
)
def test_kicks_where_several_equations_are_solved_together(machine):
    """They lead to the steady sliding of the machine that is driven so fast, with its eigenvalues."""
    from steadyslip.nonlinear.kicks.kicks import Kicked

    kicked = Kicked(machine, "velocity", 1, "before", {}, 0, 1e-6)
    assert kicked.rest.unknowns.shape == (1, 2)
    rest = kicked.rest_after(np.zeros(2, dtype=int), np.array([0.3, -0.4]))
    for roots, velocity in zip(rest.roots, np.exp([0.3, -0.4]), strict=True):
        other = machine.with_values({"drive.velocity": velocity})
        np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(ss.eigenvalues(other)), rtol=1e-6)


def test_bodies_without_mass_joined_by_a_dashpot_return_after_a_kick():
    from steadyslip.nonlinear.kicks.kicks import Kicked
    from steadyslip.nonlinear.kicks.spans import RETURNS

    kicked = Kicked(two_smooth(), "force", 1, "before", {}, 0, 1e-6, "two")
    assert kicked.stable[0]
    assert kicked.outcomes(np.zeros(1, dtype=int), np.array([0.02])).tolist() == [RETURNS]


def test_what_a_push_makes_of_a_machine_is_what_it_comes_to():
    """Far below the threshold a step of force leads to the steady sliding that was found for it."""
    from steadyslip.nonlinear.kicks.kicks import Kicked

    machine = two_mass(kp=4.0, kd=1.0)
    kicked = Kicked(machine, "force", 1, "before", {}, 0, 1e-6, "table")
    size = 0.05
    rest = kicked.rest_after(np.zeros(1, dtype=int), np.array([size]))
    push = ss.protocol.DisturbanceStep(at=0.0, by=float(kicked.amount(size)[0]), on="table")
    run = ss.simulate(machine, push, until=400.0, times=[0.0, 400.0])
    names = dict(zip(rest.reduction.names, rest.state[0], strict=True))
    for name in ("motor.x", "table.x"):
        assert run[name][-1] == pytest.approx(names[name], rel=1e-4)
    assert rest.exists[0]


@pytest.mark.parametrize(
    ("kick", "at", "words"),
    [
        ("force", None, r"at: missing; name the body that a force kick acts at: motor, table"),
        ("normal-force", "table", "unknown contact 'table'"), ("velocity", "tabel", "did you mean 'table'"),
        ("normal-stress", None, "unknown kick 'normal-stress'; did you mean 'normal-force'"),
    ],
)  # fmt: skip
def test_where_a_kick_acts_has_to_be_said(kick, at, words):
    with pytest.raises(ss.ParameterError, match=words):
        ss.threshold(two_mass(kp=4.0), kick, at=at)


def test_kicks_that_cannot_be_are_refused():
    with pytest.raises(ss.NotAvailable, match="dashpot"):
        ss.threshold(two_mass(kp=4.0), "displacement")
    with pytest.raises(ss.ParameterError, match="leave the argument out"):
        ss.threshold(pair(7)[0], at="block")
    with pytest.raises(ss.ParameterError, match="'table' has no mass"):
        ss.threshold(weak(), "velocity", at="table")
    assert ss.threshold(two_mass(kp=1.0), "velocity").outcome == "unstable"


def test_the_verdict_tells_kicks_of_bodies():
    found = ss.analyze(two_mass(kp=1.0), kick=("force at table", "velocity"))
    assert [(one.kick, one.at, one.unit) for one in found.kicks] == [("force", "table", "N"), ("velocity", "", "m/s")]
    assert str(found).count("a kick") == 2
    assert found.to_dict()["kicks"][0]["at"] == "table"
    with pytest.raises(ss.ParameterError, match="name the body"):
        ss.analyze(two_mass(kp=1.0), kick="force")
    with pytest.raises(ss.ParameterError, match="one steady sliding"):
        ss.analyze(two_mass(), branch=1)


def test_the_contact_that_a_kick_lifts_off_is_named():
    """A block on two surfaces that its spring lifts: the lighter pressed one goes first."""
    away = ss.laws.InclinedSpring(steady_normal_stress=0.2, angle=0.5)
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=4.0, damping=1.0)},
        contacts={
            "base": surface("block", ss.laws.RateState(a=0.5, b=0.4, d_c=1.0, mu_ref=0.6, v_ref=1.0)),
            "rail": ss.machine.Surface(
                body="block", friction=ss.laws.RateState(a=0.5, b=0.4, d_c=1.0, mu_ref=0.6, v_ref=1.0), contact=away
            ),
        },
        drive=ss.machine.Pull(velocity=1.0),
    )
    assert ss.steady_state(machine).contacts["rail"].normal_force == pytest.approx(0.2)  # given, whatever the base rubs
    felt = 1 + 0.6 * np.tan(0.5)  # theory 11, typed: m = c = r = 1, k = 4, f and S of both surfaces together
    typed = np.roots(np.polyadd(np.polymul([1, felt, 4 * felt], [1, 1]), [0.6, 0.12, 0]))
    for s in typed:  # beside which the memories may differ, where nothing else moves
        assert np.min(np.abs(ss.eigenvalues(machine) - s)) < 1e-12 * abs(s)
    found = ss.threshold(machine, "impulse", at="block", direction=-1, precision=COARSE)
    assert (found.outcome, found.contact) == ("contact lost", "rail")
    assert str(found).endswith("beyond: contact lost at rail")
    assert found.to_dict()["contact"] == "rail"


def test_steady_sliding_is_found_where_rounding_moves_an_integral():
    """The controller of the telescope integrates a place so small that its last digits move the integral by 4e-8."""
    from pathlib import Path

    from steadyslip.nonlinear.kicks.kicks import Kicked

    telescope = ss.read_rig(Path(__file__).parents[3] / "examples" / "machines" / "telescope.toml")
    kicked = Kicked(telescope, "velocity", 1, "before", {}, 0, None)
    found = np.sort_complex(kicked.rest.roots[0])
    np.testing.assert_allclose(found, np.sort_complex(ss.eigenvalues(telescope)), rtol=1e-6)


def test_blows_against_a_belt_mirror_those_of_a_pulled_block():
    """A block held on a belt is the pulled block seen from the belt: forward there is backward here, limits too."""
    law = ss.laws.RateState(a=0.01, b=0.008, d_c=1e-5, mu_ref=0.5, v_ref=1e-3)
    held, load = (
        {"spring": ss.machine.Spring(between=("ground", "m"), stiffness=5e3)},
        ss.laws.ConstantNormalStress(preload=10.0),
    )
    pulled = {"spring": ss.machine.Spring(between=("drive", "m"), stiffness=5e3)}
    body, drive = {"m": ss.machine.SlidingBody(mass=2.0)}, ss.machine.Pull(velocity=1e-3)
    belt = ss.Machine(bodies=body, links=held, drive=drive, contacts={
        "c": ss.machine.Surface(body="drive", against="m", friction=law, contact=load)})  # fmt: skip
    block = ss.Machine(bodies=body, links=pulled, drive=drive, contacts={
        "c": ss.machine.Surface(body="m", friction=law, contact=load)})  # fmt: skip
    for way in (1, -1):
        own, other = (
            ss.threshold(one, "impulse", at="m", direction=sign) for one, sign in ((belt, way), (block, -way))
        )
        assert own.size == other.size == np.inf
        assert own.survived == pytest.approx(-other.survived, rel=1e-9)
    assert own.survived == pytest.approx(-20.0)
    assert ss.threshold(belt, "impulse", at="m").survived == pytest.approx(0.999 * 2e-3)  # more stops the slip
