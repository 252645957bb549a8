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

TWO = {"states": [ss.State(b=0.0145, d_c=1e-6), ss.State(b=0.004, d_c=2e-5)]}

THREE = {"states": [ss.State(b=0.01, d_c=1e-6), ss.State(b=-0.003, d_c=5e-6), ss.State(b=0.009, d_c=4e-5)]}

OWN_ALPHA = {"states": [ss.State(b=0.0, d_c=1e-6, alpha=0.2), ss.State(b=0.016, d_c=2e-5, alpha=0.1)]}

EVOLUTIONS = (ss.Slip(), ss.Aging(), ss.PRZ(), ss.Nagata(c_nagata=2.0))

MEMORIES = (
    ss.NoMemory(),
    ss.LinkerDieterich(alpha=0.3),
    ss.PrakashClifton(slip_distance=3e-6),
    ss.PrakashClifton(direct_share=0.4, slip_distance=3e-6),
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
        if isinstance(evolution, ss.Nagata) and (states is not ONE or isinstance(memory, ss.PrakashClifton)):
            continue
        found[place] = ss.RateState(
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
    ss.RateState(**ROCK, **OWN_ALPHA, normal_memory=ss.LinkerDieterich()),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6, evolution=ss.Aging()),
    ss.RateState(**ROCK, b=0.0, d_c=1e-6, normal_memory=ss.LinkerDieterich(alpha=0.3)),
    ss.RateState(**ROCK, b=-0.003, d_c=1e-6, evolution=ss.PRZ(), normal_memory=ss.LinkerDieterich(alpha=0.3)),
    ss.RateState(**ROCK, b=-0.003, d_c=1e-6, evolution=ss.Nagata(c_nagata=0.5)),
    ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton()),
    ss.RateState(**ROCK, **ONE, normal_memory=ss.PrakashClifton(direct_share=1.0)),
    ss.RateState(**ROCK, **ONE, evolution=ss.Aging(), **FADING, normal_memory=ss.LinkerDieterich(alpha=0.3)),
    ss.RateState(**ROCK, states=[ss.State(b=0.01, d_c=1e-6), ss.State(b=0.009, d_c=4e-5, b_cutoff_velocity=3e-6)]),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5),
    ss.CoulombStribeck(**BRISTLE),
    ss.LuGre(**BRISTLE, bristle_stiffness=1e5, bristle_damping=1e3, stribeck_exponent=0.7),
    ss.CoulombStribeck(**BRISTLE, stribeck_exponent=1.3),
]


def rig_with(law, velocity=1e-6, sigma=5e6, contact=None, **slider):
    contact = contact or ss.Constant(steady_normal_stress=sigma)
    return ss.Slider(friction=law, contact=contact, drive=ss.Steady(velocity), **({"stiffness": 1e9} | slider))


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
