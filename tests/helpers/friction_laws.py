"""Friction laws of every kind for tests, rigs with them, and what a linearisation of them is made of."""

import itertools

import numpy as np
from hypothesis import settings, strategies as st

import steadyslip as ss
from steadyslip.core.expressions import ArrayFunction
from steadyslip.linear.response import response
from steadyslip.model.linearisation import characteristic_coefficients
from steadyslip.model.point import operating_point
from steadyslip.testing import Conditions

ROCK = {"a": 0.0145, "mu_ref": 0.7, "v_ref": 1e-6}

ONE = {"b": 0.016, "d_c": 1e-6}

FADING = {"a_cutoff_velocity": 2e-5, "b_cutoff_velocity": 5e-6}

TWO = {"states": [ss.laws.State(b=0.0145, d_c=1e-6), ss.laws.State(b=0.004, d_c=2e-5)]}

THREE = {
    "states": [ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=-0.003, d_c=5e-6), ss.laws.State(b=0.009, d_c=4e-5)]
}

OWN_ALPHA = {"states": [ss.laws.State(b=0.0, d_c=1e-6, alpha=0.2), ss.laws.State(b=0.016, d_c=2e-5, alpha=0.1)]}

EVOLUTIONS = (ss.laws.Slip(), ss.laws.Aging(), ss.laws.PRZ(), ss.laws.Nagata(c_nagata=2.0))

MEMORIES = (
    ss.laws.NoMemory(),
    ss.laws.LinkerDieterich(alpha=0.3),
    ss.laws.PrakashClifton(slip_distance=3e-6),
    ss.laws.PrakashClifton(direct_share=0.4, slip_distance=3e-6),
)

BRISTLE = {"mu_coulomb": 0.3, "mu_static": 0.45, "v_stribeck": 2e-6, "viscous": 0.1}

WEAKENING = Conditions(instant_weakening=True)


def combinations():
    """Every second rate-and-state law that is allowed, so that any two parts meet, and the third in one of its kinds.

    Nagata's law has one state and no prakash-clifton.
    """
    found = {}
    for place in itertools.product(*map(range, (len(EVOLUTIONS), len(MEMORIES), 3, 2))):
        i, j, k, regularised = place
        evolution, memory, states = EVOLUTIONS[i], MEMORIES[j], (ONE, TWO, THREE)[k]
        if sum(place) % 2:
            continue
        if isinstance(evolution, ss.laws.Nagata) and (states is not ONE or isinstance(memory, ss.laws.PrakashClifton)):
            continue
        found[place] = ss.laws.RateState(
            **ROCK, **states, evolution=evolution, normal_memory=memory, regularised=bool(regularised)
        )
    return found


def pairs(place):
    """Any two parts of a law."""
    return set(itertools.combinations(enumerate(place), 2))


def every_pair(places):
    """Some of the places, in which every two parts that are together somewhere are so too."""
    left = set().union(*map(pairs, places))
    while left:
        best = max(places, key=lambda place: len(pairs(place) & left))
        yield best
        left -= pairs(best)


COMBINATIONS = combinations()

FURTHER = [law for place, law in COMBINATIONS.items() if place not in set(every_pair(COMBINATIONS))]
"""Laws whose parts meet in others too."""

LAWS = [
    *COMBINATIONS.values(),
    ss.laws.RateState(**ROCK, **OWN_ALPHA, normal_memory=ss.laws.LinkerDieterich()),
    ss.laws.RateState(**ROCK, b=0.0, d_c=1e-6),
    ss.laws.RateState(**ROCK, b=0.0, d_c=1e-6, evolution=ss.laws.Aging()),
    ss.laws.RateState(**ROCK, b=0.0, d_c=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)),
    ss.laws.RateState(
        **ROCK, b=-0.003, d_c=1e-6, evolution=ss.laws.PRZ(), normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
    ),
    ss.laws.RateState(**ROCK, b=-0.003, d_c=1e-6, evolution=ss.laws.Nagata(c_nagata=0.5)),
    ss.laws.RateState(**ROCK, **ONE, normal_memory=ss.laws.PrakashClifton()),
    ss.laws.RateState(**ROCK, **ONE, normal_memory=ss.laws.PrakashClifton(direct_share=1.0)),
    ss.laws.RateState(
        **ROCK, **ONE, evolution=ss.laws.Aging(), **FADING, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
    ),
    ss.laws.RateState(
        **ROCK, states=[ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.009, d_c=4e-5, b_cutoff_velocity=3e-6)]
    ),
    ss.laws.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3),
    ss.laws.LuGre(**BRISTLE, bristle_stiffness=1e5),
    ss.laws.CoulombStribeck(**BRISTLE),
    ss.laws.Coulomb(mu_coulomb=0.3, mu_static=0.4, viscous=0.5),
    ss.laws.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3, stribeck_exponent=0.7),
    ss.laws.CoulombStribeck(**BRISTLE, stribeck_exponent=1.3),
]


def rig_with(law, velocity=1e-6, sigma=5e6, contact=None, **slider):
    contact = contact or ss.laws.ConstantNormalStress(steady_normal_stress=sigma)
    return ss.Slider(
        friction=law, contact=contact, drive=ss.machine.SteadyDrive(velocity), **({"stiffness": 1e9} | slider)
    )


def numbers_of(rig, expressions):
    values = operating_point(rig)
    sigma = ss.steady_state(rig).normal_stress
    function = ArrayFunction([*values.model.arguments], expressions(values.model))
    return [float(number) for number in function(*values.arguments, sigma)]


def ingredients(law, velocity, sigma):
    """f, S, r, f1, μ by differentiating the law."""
    return numbers_of(
        rig_with(law, velocity, sigma), lambda m: [getattr(response(m), n) for n in ("f", "S", "r", "f1", "mu")]
    )


def polynomial(rig):
    """Characteristic polynomial, lowest power first, the highest coefficient that is not zero made 1."""
    c = np.array(numbers_of(rig, characteristic_coefficients))
    return c / c[np.flatnonzero(c)[-1]]


small = st.floats(0.002, 0.03)

velocities = st.floats(1e-9, 1e-3)

modest = settings(max_examples=20, deadline=None)
