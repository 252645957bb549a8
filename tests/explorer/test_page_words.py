"""The first line and the reason on the page of a slider are those of Python, letter by letter."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import steadyslip as ss
from explored_edges import Edges, other_edges, written
from rigs_of_theory import LAWS, SIGMA, V0, rate_state, rig

BRISTLES = ss.laws.LuGre(
    mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800.0, viscous=80.0
)
HEAVY = ss.Slider(
    friction=BRISTLES,
    contact=ss.laws.LinearNormalStress(steady_normal_stress=1e5, b3=0.0),
    stiffness=1e6,
    mass=5e5,
    drive=ss.machine.SteadyDrive(1e-3),
)
RIGS = {
    "plain": rig(),
    "area": rig(area=0.01, contact=ss.laws.Lift(preload=SIGMA, lift=1e11, v_ref=V0)),
    "inclined": rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5)),
    "axial": rig(contact=ss.laws.Triaxial(confining_pressure=SIGMA, angle=0.5), stiffness=None, axial_stiffness=9e10),
    "lifted": rig(
        friction=rate_state(mu_ref=0.3, normal_memory=ss.laws.LinkerDieterich(alpha=0.9)),
        contact=ss.laws.InclinedSpring(preload=SIGMA, angle=1.2),
    ),
    "gain": rig(stiffness=None, drive=ss.machine.PD(V0, kp=4e9)),
    "integrated": rig(stiffness=None, drive=ss.machine.PID(V0, kp=9e9, ki=1e8), mass=1e3),
    "together": rig(stiffness=1e9, drive=ss.machine.PD(V0, kp=4e9, kd=1e9)),
    "two states": rig(friction=LAWS["two states"]),
    "heavy": HEAVY,
    "undamped": replace(HEAVY, friction=ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3, v_stribeck=1e-3)),
}
NEAR, FAR = 1.0003, 1e3  # times an edge; to three digits the first would be one


@cache
def page(name):
    return Edges(RIGS[name])


def compared(name, **changes):
    there = page(name)
    own = {there.own(there.home).resolve(key): value for key, value in changes.items()}
    values = [own.get(key, value) for key, value in zip(there.names, there.home, strict=True)]
    wrong, _ = other_edges(there, values)
    assert wrong == []
    told = there(values)
    return written(f"{told['headline']} {told['reason']}")


@pytest.mark.parametrize(("name", "stiffness"), [
    ("area", "stiffness"),
    ("gain", "kp"),
    *(pytest.param(*one, marks=pytest.mark.campaign) for one in (
        ("plain", "stiffness"), ("inclined", "stiffness"), ("axial", "axial_stiffness"), ("integrated", "kp"),
        ("together", "stiffness"), ("two states", "stiffness"),
    )),
])  # fmt: skip
def test_beside_and_on_an_edge_a_page_says_what_python_says(name, stiffness):
    (edge,) = [one.value for one in ss.boundary(RIGS[name], stiffness) if one.kind == "oscillatory"]
    for factor, words in ((1 / NEAR, "Unstable:"), (NEAR, "Stable:"), (1 / FAR, "Unstable:"), (FAR, "Stable:")):
        assert compared(name, **{stiffness: factor * edge}).startswith(words)
    text = compared(name, **{stiffness: edge})
    assert text.startswith("On the edge of stability to within rounding: ")
    assert "to within rounding the critical" in text
    assert text.endswith(
        "; neither verdict should be relied on: the least change of a number decides; give it a damping if it has none."
    )


@pytest.mark.parametrize(("name", "changes", "words"), [
    ("plain", {"b": 0.01}, "Sliding is stable at every stiffness."),
    ("plain", {"b": 0.01, "stiffness": 0.0}, "Without stiffness nothing restores the block's place"),
    ("plain", {"stiffness": 0.0}, "0 times the critical stiffness"),
    ("gain", {"b": 0.01}, "Sliding is stable at every drive proportional gain."),
    ("together", {"b": 0.01}, "whatever the stiffness beside it."),
    ("together", {"stiffness": 0.0}, "The drive proportional gain, 4 GPa/m, is"),
    ("lifted", {}, "No stiffness makes sliding stable."),
    ("heavy", {}, "below which sliding is stable."),
    ("heavy", {"b3": -1e7}, "the nearest edge of the stable set."),
    ("undamped", {}, "Neither verdict should be relied on: the least change of a number decides; give it a damping"),
    ("inclined", {"angle": -1.2}, "; the spring angle must be above -arccot μss = -55.01 deg (eq. 27)."),
    ("axial", {"angle": 1.2}, "; the saw-cut angle must be below"),
    ("area", {"drive.velocity": 1e-4}, "Lift-off. The motion takes away more normal force than the contact has"),
])  # fmt: skip
def test_away_from_edges_too(name, changes, words):
    text = compared(name, **changes)
    assert words in text
    assert text.startswith("On the edge") == ("restores" in words or "Neither" in words)


def pressed_on(angle, mu):
    law = ss.laws.RateState(a=0.01, b=0.012, d_c=1e-5, mu_ref=mu, v_ref=1e-3)
    return ss.machine.Surface(body="p", friction=law, contact=ss.laws.InclinedSpring(preload=100.0, angle=angle))


def test_of_contacts_that_press_on_each_other_a_page_names_the_one_that_python_names():
    """Whether they lock up or one lifts off, at angles and frictions drawn at random."""
    gripped = ss.Machine(
        bodies={"p": ss.machine.SlidingBody(mass=1.0)},
        links={"s": ss.machine.Spring(between=("drive", "p"), stiffness=1e5, damping=3.0)},
        contacts={"c": pressed_on(-0.5, 0.7), "d": pressed_on(-0.6, 0.8)},
        drive=ss.machine.Pull(velocity=1e-3),
    )
    there, chance, kinds = Edges(gripped), np.random.default_rng(2), set()
    for _ in range(60):
        values = list(there.home)
        for n, name in enumerate(there.names):
            if name.endswith("angle"):
                values[n] = chance.uniform(-1.5, 1.5)
            elif name.endswith(("mu_ref", "preload")):
                values[n] *= 10 ** chance.uniform(-1, 1)
        told = there.script(
            "(rig.values = values, reason({ ...rig.assess(), own: rig.linear.R }, data))", values=values
        )
        try:
            ss.steady_state(there.own(values))
        except ss.NoSteadySliding as absent:
            why = str(absent).removeprefix("no steady sliding: ")
            assert written(told) == written(f"{why[0].upper()}{why[1:]}.")
            kinds.add((absent.condition, absent.contact))
    assert kinds == {(kind, contact) for kind in ("lock-up", "lift-off") for contact in "cd"}
