"""Branches of a rig and of the same rig but for rounding: as many folds, doublings and ends, at the same places."""

from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from doubled_machines import ALONG, drawn

TELESCOPE = Path(__file__).parents[3] / "examples" / "machines" / "telescope.toml"
OFF = 1e-13  # relative change of stiffnesses, masses and dampings
WITHIN = 1e-6  # of places: ten times what steps of integration of 1e-8 leave
FEW = 0.06  # share of cycles by which two branches may differ in number


def rounded(rig, random):
    """The rig with every stiffness, mass and damping off by `OFF`, up or down."""
    names = [one for one in rig.parameters() if one.rpartition(".")[2] in ("stiffness", "mass", "damping")]
    values = {name: rig.value(name) for name in names}
    return rig.with_values(
        {name: value * (1 + OFF * random.choice([-1, 1])) for name, value in values.items() if value}
    )


def places(branch):
    """Kinds and values of the special cycles and ends of a branch, cycles of twice the period included."""
    found = []
    while branch is not None:
        found += [(one.kind, one.cycle.value) for one in branch.special]
        found += [(end.kind, end.value) for pair in branch.bounds for end in pair if end.kind != "last cycle"]
        branch = branch.doubled
    return [kind for kind, _ in found], np.array([value for _, value in found])


def same(rig, along, seed=0, **options):
    """Check the branches of a rig and of the rounded one."""
    found = [ss.cycles(one, along, **options) for one in (rig, rounded(rig, np.random.default_rng(seed)))]
    (kinds, values), (others, beside) = map(places, found)
    assert kinds == others
    np.testing.assert_allclose(values, beside, rtol=WITHIN)
    few = max(2.0, FEW * len(found[0]))
    assert abs(len(found[0]) - len(found[1])) <= few
    return kinds


@pytest.mark.campaign
def test_doublings_of_a_machine_do_not_depend_on_rounding():
    machine = drawn(np.random.default_rng(33))
    edge = ss.hopf(machine, ALONG).value
    kinds = same(machine, ALONG, between=(0.4 * edge, 1.05 * edge))
    assert kinds.count("period doubling") == 4  # two, and both ends of the cycles of twice the period


@pytest.mark.campaign
def test_a_slider_that_doubles_does_not_depend_on_rounding():
    slip = ss.laws.RateState(
        a=0.01, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Slip(),
        states=(ss.laws.State(b=0.012, d_c=1e-6), ss.laws.State(b=0.012, d_c=1e-5)),
    )  # fmt: skip
    block = ss.Slider(
        friction=slip, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=3e9, mass=1e10,
        drive=ss.machine.SteadyDrive(1e-6),
    )  # fmt: skip
    edge = ss.hopf(block).value
    same(block, "stiffness", between=(0.5 * edge, 1.2 * edge))


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [0, 1])
def test_folds_and_doublings_of_a_ringing_machine_do_not_depend_on_rounding(seed):
    """Twenty-five, two of them folds within one step."""
    kinds = same(ss.read_rig(TELESCOPE), "drive.kp", seed, doublings=0)
    assert len(kinds) == 26  # with the onset
