"""One friction law and one contact law under any names of their parameters, memories and states."""

from functools import cache

import sympy as sp

import steadyslip as ss
from steadyslip.core.domains import positive
from steadyslip.core.records import parameter

NUMBERS = {"a": 0.0145, "b": 0.016, "d_c": 1e-6, "level": 0.7, "film": 1e5}
OF_CONTACT = {"preload": 5e6, "share": 0.3, "distance": 3e-6}
UNITS = {"a": "1", "b": "1", "d_c": "m", "level": "1", "film": "Pa", "share": "1", "distance": "m"}
V0 = 1e-6
PLAIN = {name: name for name in UNITS} | {"age": "age", "gap": "gap"}
WORDS = """
    w v_lp_dot q_dot normal_stress v t x friction Theta sigma tau T k m v_lp q p w_0 in0 slope0 y0 z0 c0 c0_rate_0 e0 s
    s0 S_0_0 D_0 friction_0 place_0 distance held held_back integral loading share_of_q initial_friction I_x a_x
    sigma_ss mu_ss k_cr faster E I pi S N O Q C oo zoo nan beta gamma zeta Lambda Symbol Function Piecewise lambda_
    constructor __proto__ toString hasOwnProperty prototype arguments eval delete new function var let static
    this null undefined NaN Infinity Math double float i1 ret define select load store entry alpha psi true false
    inf time until index values dims coords attrs data units start slip acceleration load_velocity disturbance
    event event_time velocity stiffness mass damping a1 σ_ß R row parameter_000 at_000_memory_000
"""
NAMES = WORDS.split()
"""Names with a meaning in equations, printers, SymPy, LLVM, JavaScript, TOML, NumPy or xarray."""


@cache
def laws(*pairs):
    """Classes of both laws in which the first of each pair is called by the second."""
    names = PLAIN | dict(pairs)
    families = (ss.laws.FrictionLaw, ss.laws.ContactLaw)
    before = [dict(family.registry) for family in families]

    class Aging(ss.laws.FrictionLaw, name="renamed-friction"):
        """The slip law with viscous friction that saturates."""

        __annotations__ = {names[one]: "float" for one in NUMBERS}
        locals().update({names[one]: parameter(UNITS[one], positive, one) for one in NUMBERS})

        def memory(self):
            return (names["age"],)

        def strength(self, v, sigma, memory, tau):
            a, b, _, level, film = (getattr(self, names[one]) for one in NUMBERS)
            return sigma * (level + a * sp.log(v / V0) + b * memory[0]) + film * sp.tanh(v / (1000 * V0))

        def rates(self, v, sigma, memory, tau):
            return (-v / getattr(self, names["d_c"]) * (sp.log(v / V0) + memory[0]),)

        def steady_memory(self, v, sigma):
            return (-sp.log(v / V0),)

    class Film(ss.laws.PreloadedContact, name="renamed-contact"):
        """A film that follows the velocity over some distance and carries a share of the load."""

        __annotations__ = {names[one]: "float" for one in ("share", "distance")}
        locals().update({names[one]: parameter(UNITS[one], positive, one) for one in ("share", "distance")})

        def memory(self):
            return (names["gap"],)

        def coupling(self, motion):
            return -getattr(self, names["share"]) * motion.memory[0]

        def rates(self, motion):
            target = 1e5 * sp.log(motion.velocity / V0)
            return (motion.velocity / getattr(self, names["distance"]) * (target - motion.memory[0]),)

        def steady_memory(self, velocity):
            return (1e5 * sp.log(velocity / V0),)

    for family, registry in zip(families, before, strict=True):
        family.registry = registry
    return Aging, Film


def renamed(own=(), contact=None, **slider):
    """A slider with both laws, some of whose names are others: pairs of the plain one and the new one."""
    names = PLAIN | dict(own)
    aging, film = laws(*own)
    friction = aging(**{names[one]: value for one, value in NUMBERS.items()})
    touch = film(**{names.get(one, one): value for one, value in OF_CONTACT.items()}) if contact is None else contact
    return ss.Slider(
        **{"friction": friction, "contact": touch, "drive": ss.machine.SteadyDrive(V0), "stiffness": 6e9} | slider
    )


def machine(own=(), mass=1e3):
    """Machine of two bodies with the given laws."""
    rig = renamed(own)
    surface = {"friction": rig.friction, "contact": rig.contact}
    return ss.Machine(
        bodies={"one": ss.machine.SlidingBody(mass=mass), "two": ss.machine.SlidingBody(mass=mass)},
        links={
            "belt": ss.machine.Spring(between=("drive", "one"), stiffness=8e9, damping=1e6),
            "bar": ss.machine.Spring(between=("one", "two"), stiffness=9e9, damping=1e6),
        },
        contacts={
            "first": ss.machine.Surface(body="one", **surface),
            "second": ss.machine.Surface(body="two", **surface),
        },
        drive=ss.machine.Pull(velocity=V0),
    )
