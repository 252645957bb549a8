"""From a rig to its Model: symbols in place of the numbers, and the parts joined."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import sympy as sp

from steadyslip.core.options import checked
from steadyslip.core.records import parameters, shape_of, twin
from steadyslip.core.roles import Parameter
from steadyslip.laws.contact import Motion
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Contact, Model, Variable

_LETTERS = {
    "slider.stiffness": "k",
    "slider.mass": "m",
    "slider.damping": "c",
    "slider.radiation_damping": "eta",
    "drive.velocity": "v_0",
}
_RESERVED = ("x", "v", "a_x", "I_x", "T", "tau", "sigma", "sigma_ss", "v_lp", "q", "p", "t", "mu_ss", "k_cr")


@checked()
def build_model(rig: Slider, present: Iterable[str] = ()) -> Model:
    """The model of a rig.

    Parameters
    ----------
    rig : Slider
        The rig; its numbers do not matter, only its structure (models are shared between rigs).
    present : iterable of str
        Dotted names of parameters kept as symbols although they are zero, such as ``slider.mass`` when it
        is about to be varied.
    """
    kept = frozenset(present)
    key = (shape_of(rig), kept)
    return _build_cached(_Structure(key, rig, kept))


class _Structure:
    """A rig that compares equal to every other of the same structure."""

    def __init__(self, key: Any, rig: Slider, present: frozenset[str]) -> None:
        self.key, self.rig, self.present = key, rig, present

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.key == other.key


@lru_cache(maxsize=128)
def _build_cached(structure: _Structure) -> Model:
    rig = structure.rig
    symbols = _parameter_symbols(rig, structure.present)
    copy = twin(rig, symbols)
    k = sp.Symbol("k", nonnegative=True)
    given = {name: symbol for name, symbol in symbols.items() if isinstance(symbol, sp.Symbol)}
    given.pop("slider.axial_stiffness", None)
    given["slider.stiffness"] = k
    roles = {name: address.role for name, address in parameters(rig).items()}
    return _assemble(copy, k, given, roles)


def _parameter_symbols(rig: Slider, present: frozenset[str]) -> dict[str, Any]:
    """A symbol for every given parameter; structural zeros stay zero, gauges stay symbols."""
    symbols: dict[str, Any] = {}
    taken = set(_RESERVED) | set(_LETTERS.values()) | {a.role.letter for a in parameters(rig).values()}
    for name, address in parameters(rig).items():
        if name == "slider.area" or address.value is None:
            continue
        if address.role.structural and address.value == 0 and name not in present:
            symbols[name] = sp.Integer(0)
            continue
        domain = address.role.domain
        symbols[name] = sp.Symbol(
            _LETTERS.get(name) or address.role.letter or _unused_letter(name, taken),
            real=True,
            positive=True if domain.low == 0 and not domain.low_allowed else None,
            nonnegative=True if domain.low == 0 else None,
        )
    return symbols


def _unused_letter(name: str, taken: set[str]) -> str:
    """The last part of a dotted name, with as many earlier parts behind it as make it unique."""
    *before, letter = name.split(".")
    if before[-1].isdigit():
        letter = f"{letter}_{before.pop()}"
    while letter in taken and before:
        letter = f"{letter}_{before.pop()}"
    taken.add(letter)
    return letter


def _assemble(rig: Slider, k: sp.Symbol, given: dict[str, sp.Symbol], roles: dict[str, Parameter]) -> Model:
    """Join friction, contact, body and drive; `rig` holds symbols."""
    x, v, acceleration = sp.symbols("x v a_x", real=True)
    integral = sp.Symbol("I_x", real=True)
    spring, tau, sigma = sp.Symbol("T", real=True), sp.Symbol("tau", real=True), sp.Symbol("sigma", positive=True)
    sigma_ss = sp.Symbol("sigma_ss", positive=True)
    v_lp, q, p = sp.symbols("v_lp q p", real=True)
    time = sp.Symbol("t", real=True)
    v0 = rig.drive.velocity
    friction, contact, drive = rig.friction, rig.contact, rig.drive
    taken = set(_RESERVED) | {str(symbol) for symbol in given.values()}
    memory = tuple(sp.Symbol(_unused_letter(f"memory.{name}", taken), real=True) for name in friction.memory())

    tau_ss = sp.sympify(friction.steady_strength(v0, sigma_ss))
    spring_ss = tau_ss + rig.radiation_damping * v0
    gain = sp.sympify(drive.proportional())
    stiffness = k + gain
    dashpot = rig.damping + drive.derivative()
    ki = drive.integral()
    spring_stress = spring_ss - stiffness * x - dashpot * (v - v_lp)
    if ki is not None:
        spring_stress -= ki * integral
    friction_stress = spring - rig.radiation_damping * v - rig.mass * acceleration + q
    motion = Motion(x, v, acceleration, spring, spring_ss, tau, tau_ss, stiffness, v0)
    normal_stress = sp.sympify(contact.normal_stress(motion)) + p
    balance = sp.sympify(friction.strength(v, sigma, memory, tau)) - tau

    inertial = rig.mass != 0 or normal_stress.has(acceleration)
    variables = [Variable("x", x, "m", "slip of the block ahead of the load point", "slip")]
    rates: list[sp.Expr] = [v - v_lp]
    if inertial:
        variables.append(Variable("v", v, "m/s", "velocity of the block", "velocity"))
        rates.append(acceleration)
    remembered = tuple(
        Variable(name, symbol, unit, "memory of friction", "memory")
        for name, symbol, unit in zip(friction.memory(), memory, friction.memory_units(), strict=True)
    )
    variables += remembered
    rates += [sp.sympify(rate) for rate in friction.rates(v, sigma, memory, tau)]
    if ki is not None:
        variables.append(Variable("integral", integral, "m s", "time integral of x (controller)", "integral"))
        rates.append(x)

    steady: dict[sp.Symbol, sp.Expr] = {
        x: sp.Integer(0),
        v: v0,
        acceleration: sp.Integer(0),
        integral: sp.Integer(0),
        spring: spring_ss,
        tau: tau_ss,
        sigma: sigma_ss,
        v_lp: v0,
        q: sp.Integer(0),
        p: sp.Integer(0),
    }
    steady |= dict(zip(memory, map(sp.sympify, friction.steady_memory(v0, sigma_ss)), strict=True))
    load = contact.load()
    touching = Contact(
        slip=x,
        velocity=v,
        acceleration=acceleration,
        spring=spring,
        friction=tau,
        normal=sigma,
        memory=remembered,
        balance=balance,
        unknown=acceleration if inertial else v,
        sigma_ss=sigma_ss,
        steady_stress=sp.sympify(contact.normal_stress(motion.steady)),
        steady_coupling=sp.sympify(contact.coupling(motion.steady)),
        steady_load=None if load is None else sp.sympify(load),
        imposed=sp.sympify(contact.imposed(time)),
        direction=sp.sympify(friction.direction(v, v0)),
    )
    return Model(
        variables=tuple(variables),
        rates=tuple(rates),
        definitions={spring: spring_stress, tau: friction_stress, sigma: normal_stress},
        contacts=(touching,),
        inputs={"load_velocity": v_lp, "disturbance": q, "normal_disturbance": p, "time": time},
        parameters=given,
        roles={name: roles[name] for name in given},
        gain=gain,
        axial_share=None if rig.axial_stiffness is None else contact.sliding_stiffness(sp.Integer(1)),
        steady=steady,
        observables=_observables(friction, v, sigma, memory, tau, spring, x),
    )


def _observables(
    friction: Any, v: sp.Symbol, sigma: sp.Symbol, memory: Any, tau: sp.Symbol, spring: sp.Symbol, x: sp.Symbol
) -> dict[str, tuple[sp.Expr, str]]:
    """The named results that every stage shows, with units."""
    return {
        "x": (x, "m"),
        "v": (v, "m/s"),
        "friction": (tau / sigma, "1"),
        "shear_stress": (tau, "Pa"),
        "normal_stress": (sigma, "Pa"),
        "spring_stress": (spring, "Pa"),
        **{n: (sp.sympify(e), unit) for n, (e, unit) in friction.observables(v, sigma, memory, tau).items()},
    }
