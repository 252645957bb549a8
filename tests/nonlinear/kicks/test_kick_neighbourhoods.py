"""Where a kick leads to: the new steady sliding, the neighbourhood from which motion returns to it, closed orbits."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss
from dimensionless import unit_rig
from kicked_rigs import tilted
from rigs_of_theory import CONTACTS, D_C, ONE_MEMORY, SIGMA, V0, rate_state, rig
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.kicks.closed_orbits import _attraction
from steadyslip.nonlinear.kicks.field import rates_at
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.quartic import Rays
from steadyslip.nonlinear.kicks.settled import rest_of

STEEP = rate_state(b=0.022, normal_memory=ss.laws.LinkerDieterich(alpha=0.3))


def rest_at(a_rig, velocity=None, pressure=0.0):
    jobs = prepare(a_rig, None, 1.0, {}, {}, Options())
    return rest_of(jobs, np.array([velocity or a_rig.drive.velocity]), np.array([pressure]))


# -- the steady sliding that a kick leads to


@pytest.mark.parametrize("contact", CONTACTS, ids=lambda c: c.name)
def test_own_steady_sliding_and_its_growth_rate(contact):
    """Nothing moves there, and the eigenvalues are those of the characteristic polynomial."""
    heavy = CONTACTS.index(contact) % 2
    for friction, mass in zip(ONE_MEMORY[1:3], (1e3 * heavy, 1e3 * (1 - heavy)), strict=True):
        a_rig = rig(friction=friction, contact=contact, mass=mass)
        rest = rest_at(a_rig)
        rates = rates_at(rest, rest.state[:, None, :])[0, 0] / rest.scales[0]
        assert np.max(np.abs(rates)) < 1e-12 * np.max(np.abs(rest.roots))
        assert rest.leading[0].real == pytest.approx(
            ss.growth_rate(a_rig), rel=1e-6, abs=1e-12 * np.abs(rest.roots).max()
        )


@pytest.mark.parametrize("friction", ONE_MEMORY, ids=lambda f: f.name + str(getattr(f, "regularised", "")))
def test_after_a_velocity_step_the_rig_is_one_driven_at_the_new_velocity(friction):
    contact = ss.laws.InclinedSpring(preload=SIGMA, angle=0.3)
    a_rig = rig(friction=friction, contact=contact)
    for factor in (0.2, 7.0):
        moved = rest_at(a_rig, factor * V0)
        expected = ss.growth_rate(a_rig.with_values({"drive.velocity": factor * V0}))
        assert moved.leading[0].real == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.4])
def test_after_a_step_of_normal_stress_the_rig_is_one_with_more_preload(angle):
    for share in (-0.4, 0.3):
        moved = rest_at(tilted(angle, 1.5), pressure=share * SIGMA)
        expected = ss.growth_rate(tilted(angle, 1.5).with_values({"preload": (1 + share) * SIGMA}))
        assert moved.leading[0].real == pytest.approx(expected, rel=1e-7)


def test_there_is_none_where_the_stress_is_gone():
    assert not rest_at(tilted(0.0, 1.5), pressure=-1.01 * SIGMA).exists[0]


# -- the neighbourhood


TWO_STATES = ss.laws.RateState(a=0.0145, mu_ref=0.7, v_ref=V0, evolution=ss.laws.Slip(),
                          states=(ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.01, d_c=1e-5)))  # fmt: skip
UNIT_MASS = 0.0145 * SIGMA * D_C / V0**2  # of mass in units of theory 5


def bristles(velocity, mass, damping=10.0, stiffness=1e12, contact=None):
    friction = ss.laws.LuGre(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, bristle_stiffness=1e5,
                        bristle_damping=damping, viscous=5.0)  # fmt: skip
    return ss.Slider(friction=friction, contact=contact or ss.laws.ConstantNormalStress(preload=1e6),
        stiffness=stiffness,
        mass=mass,
                     drive=ss.machine.SteadyDrive(velocity))  # fmt: skip


def of_law(friction, mass=0.0, factor=1.03):
    """Close to the edge, where balls are small and modes decay at very different rates."""
    base = rig(friction=friction, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=0.4), mass=mass * UNIT_MASS)
    return base.with_values({"stiffness": factor * ss.critical_stiffness(base)})


STABLE = {
    "massless": lambda: tilted(0.5, 2.0),
    "mass of 1e-8": lambda: rig(friction=STEEP, stiffness=1e11, mass=1e-8 * UNIT_MASS),
    "ringing": lambda: unit_rig("aging", 0.5, 0.8, mass=1e-2),
    "prz": lambda: unit_rig("prz", 0.5, 2.0, mass=1e-6, damping=1e-3),
    "regularised prz": lambda: of_law(ONE_MEMORY[2], 1e-2),
    "nagata": lambda: of_law(ONE_MEMORY[3], 1e-2),
    "regularised nagata": lambda: of_law(ONE_MEMORY[4]),
    "regularised nagata, mass of 1e-8": lambda: of_law(ONE_MEMORY[4], 1e-8, factor=3.0),
    "two states": lambda: of_law(TWO_STATES),
    "two states, mass": lambda: of_law(TWO_STATES, 1e-2),
    "lugre, massless": lambda: bristles(3e-4, 0.0, contact=ss.laws.InclinedSpring(preload=1e6, angle=0.3)),
    "lugre, light": lambda: bristles(3e-3, 1.0, damping=0.0),
    "lugre, heavy": lambda: bristles(3e-3, 3e3),
    "lugre, damped bristles": lambda: bristles(3e-3, 3e3, damping=300.0),
}


@pytest.mark.parametrize("stable", STABLE.values(), ids=STABLE)
def test_distance_falls_everywhere_in_the_neighbourhood(stable):
    """In states that were not among those tested, next to the slow modes above all, where most could be missed."""
    rest = rest_at(stable())
    near = Neighbourhood(rest)
    radius = float(near.computed()[0])
    assert radius > 1e-4
    random, n = np.random.default_rng(1), rest.state.shape[1]
    decay = np.sort(-rest.roots[0].real)
    q = random.normal(size=(8000, n)) * (decay[0] / decay) ** random.uniform(0, 1, size=(8000, 1))
    q *= radius * random.uniform(0.02, 1, size=(8000, 1)) / np.linalg.norm(q, axis=1)[:, None]
    matrix, scales = near.inverse[0] @ rest.matrix[0] @ near.basis[0], rest.scales[0]
    rates = rates_at(rest, (rest.state[0] + scales * (q @ near.basis[0].T))[None])[0] / scales
    slope, linear = np.sum(q * (rates @ near.inverse[0].T), axis=1), np.sum(q * (q @ matrix.T), axis=1)
    assert np.min(slope / linear) > 0.35


QUICK = ("massless", "mass of 1e-8", "ringing", "prz", "lugre, massless", "lugre, light", "lugre, heavy")


FEW = ("massless", "ringing", "lugre, massless", "lugre, heavy")


@pytest.mark.parametrize(
    "stable",
    [pytest.param(STABLE[name], marks=[pytest.mark.campaign] * (name not in FEW)) for name in QUICK],
    ids=QUICK,
)
def test_motion_from_the_edge_of_the_neighbourhood_only_goes_inwards(stable):
    """By SciPy on the uncompiled rates, from directions that were not among those tested."""
    rest = rest_at(stable())
    near = Neighbourhood(rest)
    radius = float(near.computed()[0])
    assert radius > 1e-4
    random = np.random.default_rng(3)
    slowest = 1 / -rest.leading[0].real
    for q in random.normal(size=(4, rest.state.shape[1])):
        start = near.basis[0] @ (radius * q / np.linalg.norm(q))

        def rates(t, z):
            return rates_at(rest, (rest.state[0] + rest.scales[0] * z)[None, None])[0, 0] / rest.scales[0]

        run = solve_ivp(rates, (0, 2 * slowest), start, method="LSODA", rtol=1e-8, atol=1e-8 * radius)
        away = near.distance(np.zeros(len(run.t), dtype=int), rest.state + rest.scales * run.y.T)
        assert np.all(np.diff(away) < 1e-5 * radius)
        assert away[-1] < 0.4 * radius


# -- beyond the ball: V = V2 + V3 + V4


def motor_screw_table(damping):
    """Theory 15: the motor drives a table that slides, by a screw with a share of critical damping."""
    critical = 0.005 * (1 + 0.0505 / 0.01)
    stiff, together = 20 * critical, 0.0005 * 0.05 / 0.0505
    law = ss.laws.RateState(a=0.01, b=0.015, d_c=1.0, mu_ref=0.6, v_ref=1.0, evolution=ss.laws.Slip())
    return ss.Machine(
        bodies={"motor": ss.machine.SlidingBody(mass=0.0005), "table": ss.machine.SlidingBody(mass=0.05)},
        links={
            "drive": ss.machine.Spring(between=("drive", "motor"), stiffness=1.5 * critical),
            "screw": ss.machine.Spring(
                between=("motor", "table"), stiffness=stiff, damping=2 * damping * np.sqrt(stiff * together)
            ),
        },
        contacts={
            "bed": ss.machine.Surface(body="table", friction=law, contact=ss.laws.ConstantNormalStress(preload=1.0))
        },
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip


@pytest.mark.parametrize("damping", [1e-1, 1e-3, 1e-5])
def test_v_reaches_several_times_as_far_as_the_ball_however_long_the_screw_rings(damping):
    near = Neighbourhood(rest_at(motor_screw_table(damping)))
    radius, (*_, size) = near.computed(), near._levels(np.arange(1))
    assert size[0] > max(0.05, 5 * radius[0])


LONG = {f"screw of {damping:g}": (lambda damping=damping: motor_screw_table(damping)) for damping in (1e-2, 1e-4)}


@pytest.mark.parametrize("stable", [*STABLE.values(), *LONG.values()], ids=[*STABLE, *LONG])
def test_v_falls_everywhere_below_its_level(stable):
    """In states that were not among those tested."""
    rest = rest_at(stable())
    near, random, n = Neighbourhood(rest), np.random.default_rng(2), rest.state.shape[1]
    radius = near.computed()[0]
    v3, v4, size = near._levels(np.arange(1))
    assert size[0] == 0 or size[0] >= radius
    if not size[0]:
        return  # the ball is larger
    decay = near.decay[0]
    way = random.normal(size=(8000, n)) * (np.min(decay) / decay) ** random.uniform(0, 1, size=(8000, 1))
    rays = Rays.along((way / np.linalg.norm(way, axis=1)[:, None])[None], v3, v4)
    worst = np.inf
    for share in (0.05, 0.3, 0.6, 0.9, 1.0):
        rho = rays.distance((share * size) ** 2)
        q, gradient = (rho[..., None] * rays.way)[0], rays.gradient(rho)[0]
        scales = rest.scales[0]
        rates = rates_at(rest, (rest.state[0] + scales * (q @ near.basis[0].T))[None])[0] / scales
        matrix = near.inverse[0] @ rest.matrix[0] @ near.basis[0]
        linear = 2 * np.sum(q * (q @ matrix.T), axis=1)
        worst = min(worst, np.min(np.sum(gradient * (rates @ near.inverse[0].T), axis=1) / linear))
    assert worst > 0.35


def test_unstable_or_neutral_sliding_has_none():
    for a_rig in (unit_rig("slip", 0.5, 0.4), unit_rig("slip", 0.5, 0.5)):
        assert Neighbourhood(rest_at(a_rig)).computed()[0] == 0


# -- closed orbits


def test_a_double_multiplier_of_one_does_not_attract():
    """A family of closed orbits: periods differ, so that errors split the double multiplier by their root."""
    ahead = np.array([[1.0, 0.0]])
    family = np.array([[[1.0, 40.0], [-1e-6, 1.0]]])
    assert not _attraction(family, ahead)[0]
    assert np.min(np.abs(np.linalg.eigvals(family[0]))) < 1.01  # which eigenvalues alone would not tell
    assert _attraction(np.array([[[1.0, 40.0], [0.0, 0.9]]]), ahead)[0]
    assert not _attraction(np.array([[[1.0, 40.0], [0.0, -1.1]]]), ahead)[0]
    assert not _attraction(np.array([[[0.5, 0.0], [0.0, 0.1]]]), ahead)[0]  # not even the motion itself comes back
