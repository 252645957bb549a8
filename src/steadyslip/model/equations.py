"""The Model: the equations of one rig in symbols. Every later stage reads this and nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import sympy as sp

from steadyslip.core.records import parameters, shape_of, twin
from steadyslip.laws.contact import Motion
from steadyslip.machine.slider import Slider

_LETTERS = {
    "slider.stiffness": "k",
    "slider.mass": "m",
    "slider.damping": "c",
    "slider.radiation_damping": "eta",
    "drive.velocity": "v_0",
    "contact.preload": "sigma_0",
    "contact.angle": "psi",
}
_RESERVED = ("x", "v", "a_x", "I_x", "T", "tau", "sigma", "sigma_ss", "v_lp", "q", "p", "t", "mu_ss", "k_cr")


@dataclass(frozen=True)
class Variable:
    """A differential variable of the model: name, symbol, SI unit, meaning."""

    name: str
    symbol: sp.Symbol
    unit: str
    doc: str


@dataclass(frozen=True, eq=False)
class Model:
    """A rig's equations.

    The variables y obey y' = `rates`; the scalar equation `balance` = 0 (friction law against balance of
    forces) fixes the one algebraic unknown: the acceleration if the rig has inertia, else the velocity.
    Stresses T, τ, σ are given by `definitions`, in this order, from variables, unknown and inputs.

    Attributes
    ----------
    variables : tuple of Variable
        Slip x, velocity v (with inertia), memory variables, integral of x (with integral control).
    rates : tuple of sympy.Expr
        Time derivatives of the variables.
    definitions : dict of sympy.Symbol to sympy.Expr
        Spring stress T, friction stress tau by the balance of forces, normal stress sigma.
    balance : sympy.Expr
        Friction law minus tau; zero in motion.
    unknown : sympy.Symbol
        ``v`` (quasistatic) or ``a_x`` (the acceleration).
    inputs : dict of str to sympy.Symbol
        Load-point velocity, disturbance stress q, normal-stress disturbance (B4 of eq. 12), time.
    parameters : dict of str to sympy.Symbol
        By dotted name. ``slider.stiffness`` is always the component along the sliding direction.
    steady : dict of sympy.Symbol to sympy.Expr
        Steady sliding in terms of the parameters and the steady normal stress `sigma_ss`.
    steady_stress : sympy.Expr
        What the contact law makes of `sigma_ss`; equal to it in steady sliding.
    steady_load : sympy.Expr or None
        The contact's load σ0; None where the steady normal stress is given.
    observables : dict of str to (sympy.Expr, str)
        Named results and their SI units.
    imposed : sympy.Expr
        Prescribed change of normal stress with time.
    """

    variables: tuple[Variable, ...]
    rates: tuple[sp.Expr, ...]
    definitions: dict[sp.Symbol, sp.Expr]
    balance: sp.Expr
    unknown: sp.Symbol
    inputs: dict[str, sp.Symbol]
    parameters: dict[str, sp.Symbol]
    units: dict[str, str]
    steady: dict[sp.Symbol, sp.Expr]
    sigma_ss: sp.Symbol
    steady_stress: sp.Expr
    steady_coupling: sp.Expr
    steady_load: sp.Expr | None
    observables: dict[str, tuple[sp.Expr, str]]
    imposed: sp.Expr
    symbols: dict[str, sp.Symbol] = field(repr=False)

    @property
    def inertial(self) -> bool:
        """Whether velocity is a variable of its own (mass, or normal stress that feels acceleration)."""
        return str(self.unknown) == "a_x"

    def equations(self) -> list[sp.Eq]:
        """The model as SymPy equations, ready for LaTeX."""
        time = self.inputs["time"]
        found = [sp.Eq(symbol, expression, evaluate=False) for symbol, expression in self.definitions.items()]
        found.append(sp.Eq(self.balance, 0, evaluate=False))
        for variable, rate in zip(self.variables, self.rates, strict=True):
            found.append(sp.Eq(sp.Derivative(variable.symbol, time), rate, evaluate=False))
        return found

    def __str__(self) -> str:
        kind = "with inertia" if self.inertial else "quasistatic"
        lines = [f"Model, {kind}; algebraic unknown {self.unknown}", "variables"]
        lines += [f"  {v.symbol!s:<10} {v.unit:<8} {v.doc}" for v in self.variables]
        lines.append("parameters")
        lines += [f"  {symbol!s:<14} {self.units[name]:<8} {name}" for name, symbol in self.parameters.items()]
        lines.append("equations")
        for equation in self.equations():
            left = equation.lhs
            name = f"d{left.args[0]}/dt" if isinstance(left, sp.Derivative) else str(left)
            lines.append(f"  {name} = {equation.rhs}")
        return "\n".join(lines)

    def _repr_latex_(self) -> str:
        rows = [f"{sp.latex(e.lhs)} &= {sp.latex(e.rhs)}" for e in self.equations()]
        return "$$\\begin{aligned}" + r" \\ ".join(rows) + "\\end{aligned}$$"


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
    units = {name: address.role.unit for name, address in parameters(rig).items()}
    return _assemble(copy, k, given, units)


def _parameter_symbols(rig: Slider, present: frozenset[str]) -> dict[str, Any]:
    """A symbol for every given parameter; structural zeros stay zero, gauges stay symbols."""
    symbols: dict[str, Any] = {}
    taken = set(_RESERVED) | set(_LETTERS.values())
    for name, address in parameters(rig).items():
        if name == "slider.area" or address.value is None:
            continue
        if address.role.structural and address.value == 0 and name not in present:
            symbols[name] = sp.Integer(0)
            continue
        domain = address.role.domain
        symbols[name] = sp.Symbol(
            _LETTERS.get(name) or _unused_letter(name, taken),
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


def _assemble(rig: Slider, k: sp.Symbol, given: dict[str, sp.Symbol], units: dict[str, str]) -> Model:
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
    stiffness = k + drive.proportional()
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
    variables = [Variable("x", x, "m", "slip of the block ahead of the load point")]
    rates: list[sp.Expr] = [v - v_lp]
    if inertial:
        variables.append(Variable("v", v, "m/s", "velocity of the block"))
        rates.append(acceleration)
    for name, symbol, unit in zip(friction.memory(), memory, friction.memory_units(), strict=True):
        variables.append(Variable(name, symbol, unit, "memory of friction"))
    rates += [sp.sympify(rate) for rate in friction.rates(v, sigma, memory, tau)]
    if ki is not None:
        variables.append(Variable("integral", integral, "m s", "time integral of x (controller)"))
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
    coupling = sp.sympify(contact.coupling(motion.steady))
    return Model(
        variables=tuple(variables),
        rates=tuple(rates),
        definitions={spring: spring_stress, tau: friction_stress, sigma: normal_stress},
        balance=balance,
        unknown=acceleration if inertial else v,
        inputs={"load_velocity": v_lp, "disturbance": q, "normal_disturbance": p, "time": time},
        parameters=given,
        units=units | {"slider.stiffness": "Pa/m"},
        steady=steady,
        sigma_ss=sigma_ss,
        steady_stress=sp.sympify(contact.normal_stress(motion.steady)),
        steady_coupling=coupling,
        steady_load=None if load is None else sp.sympify(load),
        observables=_observables(friction, v, sigma, memory, tau, spring, x),
        imposed=sp.sympify(contact.imposed(time)),
        symbols={"x": x, "v": v, "acceleration": acceleration, "spring": spring, "tau": tau, "sigma": sigma}
        | ({"integral": integral} if ki is not None else {}),
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
