"""The Model: the equations of one rig in symbols. Every later stage reads this and nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, replaced
from steadyslip.core.pages import Displayed
from steadyslip.core.questions import Keeper
from steadyslip.core.roles import Parameter
from steadyslip.core.symbols import inner_symbols


@dataclass(frozen=True)
class Variable:
    """A differential variable of the model: name, symbol, SI unit, meaning.

    `kind` says what it is to the stages that must know: ``slip``, ``velocity``, ``memory`` (of friction),
    ``state`` (of a contact law) or ``integral`` (of a controller).
    """

    name: str
    symbol: sp.Symbol
    unit: str
    doc: str
    kind: str


@dataclass(frozen=True, eq=False)
class Coordinate:
    """One way in which a body moves.

    Attributes
    ----------
    name : str
        Of the body, and what it moves in where that is not along the slide.
    displacement, velocity, acceleration : sympy.Symbol
        The first counts from steady sliding.
    inertia, speed : sympy.Expr
        Mass or moment of inertia, and the speed in steady sliding.
    inertial : bool
        Whether velocity is a variable of its own (inertia, or a normal stress that feels acceleration).
    balance : sympy.Expr or None
        Inertia less forces, zero in motion; None where the balance of a contact stands in its place.
    unit : str
        Of the displacement.
    push : sympy.Symbol
        A disturbance that acts on it, a force or torque; on a slider a stress.
    """

    name: str
    displacement: sp.Symbol
    velocity: sp.Symbol
    acceleration: sp.Symbol
    inertia: sp.Expr
    speed: sp.Expr
    inertial: bool
    balance: sp.Expr | None
    unit: str
    push: sp.Symbol


@dataclass(frozen=True, eq=False)
class Contact:
    """Where one body slides on another: an algebraic equation with its unknown, and the steady normal stress.

    Attributes
    ----------
    name : str
        Of the contact; empty where there is but one.
    slip, velocity, acceleration : sympy.Expr
        x, v and its rate, of the surfaces against each other; the velocity is a symbol.
    spring, friction, normal : sympy.Symbol
        Stresses T, τ and σ, which the Model's `definitions` define.
    memory : tuple of Variable
        The memory variables of its friction.
    own_states : tuple of Variable
        Those of its contact law, kind ``state``.
    balance : sympy.Expr
        Friction law minus τ by the balance of forces; zero in motion.
    unknown : sympy.Symbol
        What `balance` fixes: friction τ; or, where a single block has a single contact, so that the balance of forces
        gives τ, `acceleration`, or without inertia `velocity`.
    area : sympy.Expr
        Over which the stresses act.
    press : sympy.Symbol
        A disturbance of the normal stress.
    outside : sympy.Symbol or None
        Change of the pressure around, of a contact law with pore fluid.
    sigma_ss : sympy.Symbol
        Normal stress in steady sliding.
    steady_stress : sympy.Expr
        What the contact law makes of `sigma_ss`; equal to it in steady sliding.
    steady_coupling : sympy.Expr
        The part of it that is due to the motion.
    steady_load : sympy.Expr or None
        The contact's load σ0; None where the steady normal stress is given.
    imposed : sympy.Expr
        Prescribed change of normal stress with time.
    direction : sympy.Expr
        What motion takes for sign(v), as its friction law states it: a step at rest cannot be integrated.
    """

    name: str
    slip: sp.Expr
    velocity: sp.Symbol
    acceleration: sp.Expr
    spring: sp.Symbol
    friction: sp.Symbol
    normal: sp.Symbol
    memory: tuple[Variable, ...]
    balance: sp.Expr
    unknown: sp.Symbol
    sigma_ss: sp.Symbol
    steady_stress: sp.Expr
    steady_coupling: sp.Expr
    steady_load: sp.Expr | None
    imposed: sp.Expr
    direction: sp.Expr
    area: sp.Expr
    press: sp.Symbol
    outside: sp.Symbol | None = None
    own_states: tuple[Variable, ...] = ()

    @property
    def inertial(self) -> bool:
        """Whether velocity is a variable of its own (mass, or normal stress that feels acceleration)."""
        return self.unknown is self.acceleration


V_LP, Q, P, TIME = inner_symbols("v_lp q p t", real=True)
"""Velocity of the load point, the first push, the first normal stress that is added, and time."""
HELD = "held back"
"""Name of the variable `LettingGo.held`, which no variable of a law can have."""
MOVED, PULLED, EITHER = "moved", "pulled", "either"
"""What a drive does in the course of a run: it moves, it pulls with a force of its own, or both by turns."""


@dataclass(frozen=True, eq=False)
class LettingGo:
    """What there is to know of a drive that is moved and let go by turns.

    Attributes
    ----------
    free : sympy.Symbol
        Input, 1 while the drive pulls with a force of its own, else 0.
    held : sympy.Symbol
        Variable: by how much the force of the drive exceeds what its motion since the start would make of it, or while
        it is free, the force itself less that of steady sliding and less ``loading``. It changes where drives are let
        go or taken up, so that the force goes on.
    force, driven, steady : sympy.Expr
        Force of the drive less that of steady sliding; what its motion alone would make of it; that of steady sliding.
        Of a slider stresses.
    stiffness : sympy.Expr
        Of what carries the force of the drive.
    ahead, speed : sympy.Expr
        How far the load point is ahead of where steady motion since the start would have it, and how fast that grows.
    loading_rate : sympy.Symbol
        Rate of ``loading``.
    """

    free: sp.Symbol
    held: sp.Symbol
    force: sp.Expr
    driven: sp.Expr
    steady: sp.Expr
    stiffness: sp.Expr
    ahead: sp.Expr
    speed: sp.Expr
    loading_rate: sp.Symbol


Entries = dict[tuple[int, int], sp.Expr]


@dataclass(frozen=True)
class Carried:
    """Linear equations of what is displaced and carried in steady sliding: M z = r + F τ + G σ.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
        z: displacements, the integral of the controller, forces in elements.
    matrix : dict of (int, int) to sympy.Expr
        M, what is not zero of it.
    rest : tuple of sympy.Expr
        r.
    friction, normal : dict of (int, int) to sympy.Expr
        F and G, what is not zero of them; columns are contacts.
    """

    symbols: tuple[sp.Symbol, ...]
    matrix: Entries
    rest: tuple[sp.Expr, ...]
    friction: Entries
    normal: Entries


@dataclass(frozen=True, eq=False)
class Model(Keeper, Displayed):
    """A rig's equations.

    The variables y obey y' = `rates`; one scalar equation for each contact, its `balance` = 0, fixes that contact's
    algebraic unknown, its friction; one for each coordinate, its balance of forces, the acceleration, or without
    inertia the velocity. A single block with a single contact needs but one equation, friction law against forces.
    Velocities of slip and the stresses T, τ, σ are given by `definitions`, in this order, from variables, unknowns and
    inputs.

    A Model answers questions; what is worked out once is kept with it (`steadyslip.core.questions`): its `memory`,
    expressions `inlined` or `at_steady`, array functions of its parameters (`function`), and, in the modules beside
    this one, `linearise`, `reduce_model`, `system` (Taylor terms), `steady_equation`. Numbers come with an
    `operating_point`.

    Attributes
    ----------
    variables : tuple of Variable
        Slip x, velocity v (with inertia), memory variables, integral of x (with integral control).
    rates : tuple of sympy.Expr
        Time derivatives of the variables.
    definitions : dict of sympy.Symbol to sympy.Expr
        Spring stress T, friction stress tau by the balance of forces, normal stress sigma.
    coordinates : tuple of Coordinate
    contacts : tuple of Contact
    inputs : dict of str to sympy.Symbol
        Load-point velocity, disturbance stress q, normal-stress disturbance (B4 of eq. 12), time; of machines,
        pushes at every coordinate and normal-stress disturbances at every contact. Where there is pore fluid, the
        change of pressure around; where the force of the drive is imposed, its change, ``loading``.
    parameters : dict of str to sympy.Symbol
        By dotted name. ``slider.stiffness`` is always the component along the sliding direction.
    roles : dict of str to Parameter
        What the rig declares of its parameters: unit, domain, meaning.
    letters : dict of sympy.Symbol to str
        By what people know symbols that are not known by their own names, such as those of parameters; see `written`.
    gain : sympy.Expr
        Stiffness that a controller adds to ``slider.stiffness``.
    axial_share : sympy.Expr or None
        ``slider.stiffness`` over the axial stiffness, where that is given instead.
    steady : dict of sympy.Symbol to sympy.Expr
        Steady sliding in terms of the parameters and the contacts' `sigma_ss`.
    observables : dict of str to (sympy.Expr, str)
        Named results and their SI units.
    late : dict of sympy.Symbol to (sympy.Symbol, sympy.Expr)
        Symbols for what a displacement, velocity or integral was some time ago, and how long ago (s).
    letting_go : LettingGo or None
        Where the drive moves and pulls by turns.
    carried : Carried or None
        Symbols for what links carry in steady sliding, where formulas of that would be too long.
    """

    variables: tuple[Variable, ...]
    rates: tuple[sp.Expr, ...]
    definitions: dict[sp.Symbol, sp.Expr]
    coordinates: tuple[Coordinate, ...]
    contacts: tuple[Contact, ...]
    inputs: dict[str, sp.Symbol]
    parameters: dict[str, sp.Symbol]
    roles: dict[str, Parameter] = field(repr=False)
    letters: dict[sp.Symbol, str] = field(repr=False)
    gain: sp.Expr
    axial_share: sp.Expr | None
    steady: dict[sp.Symbol, sp.Expr]
    observables: dict[str, tuple[sp.Expr, str]]
    late: dict[sp.Symbol, tuple[sp.Symbol, sp.Expr]] = field(default_factory=dict)
    letting_go: LettingGo | None = None
    carried: Carried | None = None

    # -- questions

    @property
    def contact(self) -> Contact:
        """The contact of a single block, whose friction follows from its balance of forces.

        Raises
        ------
        NotAvailable
            If the model is of another kind; what asks for this is not ready for it.
        """
        if not self.is_single:
            raise NotAvailable(
                f"this is not offered for a machine with {len(self.coordinates)} coordinates and {len(self.contacts)} "
                "contacts; allowed: a Slider"
            )
        return self.contacts[0]

    @property
    def is_single(self) -> bool:
        """Whether this is a block with one contact: theory 1 and its closed forms."""
        return len(self.contacts) == len(self.coordinates) == 1 and self.coordinates[0].balance is None

    @property
    def has_closed_form(self) -> bool:
        """Whether the paper's cubic describes it: a slider with one memory variable, no other state and no delay."""
        return self.is_slider and len(self.memory) == 1 and not self.integrals and not self.states and not self.delays

    @property
    def is_slider(self) -> bool:
        """Whether it is the model of a slider, with a stiffness k of its own."""
        return self.is_single and "slider.stiffness" in self.parameters

    @cached_property
    def inertial(self) -> bool:
        """Whether every body has a velocity of its own."""
        return all(one.inertial for one in self.coordinates)

    @cached_property
    def delays(self) -> tuple[sp.Expr, ...]:
        """The delays (s) that are in the equations, each once."""
        return tuple(dict.fromkeys(delay for _, delay in self.late.values()))

    @property
    def imposed(self) -> bool:
        """Whether some normal stress is prescribed in time."""
        return any(contact.imposed != 0 for contact in self.contacts)

    @cached_property
    def memory(self) -> tuple[Variable, ...]:
        """The memory variables of all contacts."""
        return tuple(item for item in self.variables if item.kind == "memory")

    @cached_property
    def states(self) -> tuple[Variable, ...]:
        """The states of all contact laws."""
        return tuple(item for item in self.variables if item.kind == "state")

    @cached_property
    def integrals(self) -> tuple[Variable, ...]:
        """What controllers integrate."""
        return tuple(item for item in self.variables if item.kind == "integral")

    @property
    def held(self) -> tuple[sp.Symbol, ...]:
        """The variable that keeps the force of a drive which is let go; none of others."""
        return () if self.letting_go is None else (self.letting_go.held,)

    @property
    def arguments(self) -> tuple[sp.Symbol, ...]:
        """What numbers stand for at an operating point: the parameters, then σss of every contact, then `carried`."""
        carried = () if self.carried is None else self.carried.symbols
        return (*self.parameters.values(), *(contact.sigma_ss for contact in self.contacts), *carried)

    def function(self, expressions: Iterable[sp.Expr], *further: sp.Symbol) -> ArrayFunction:
        """Expressions as an array function of `arguments` and of further symbols; an operating point calls it."""
        return ArrayFunction([*self.arguments, *further], [sp.sympify(e) for e in expressions])

    @property
    def rate_of(self) -> dict[sp.Symbol, sp.Expr]:
        """Time derivatives by variable."""
        return {item.symbol: rate for item, rate in zip(self.variables, self.rates, strict=True)}

    def inlined(self, expression: sp.Expr, definitions: dict[sp.Symbol, sp.Expr] | None = None) -> sp.Expr:
        """An expression with T, τ and σ replaced by what they are, or by the same in other variables."""
        for symbol, definition in reversed((definitions or self.definitions).items()):
            expression = replaced(expression, {symbol: definition})
        return expression

    def at_steady(self, expression: sp.Expr) -> sp.Expr:
        """An expression in steady sliding, where terms that cancel do so exactly and |v| has a derivative."""
        found = expression.xreplace({s: self.steady[s] for s in expression.free_symbols & self.steady.keys()})
        return found.doit() if found.has(sp.sign, sp.Derivative, sp.Abs, sp.DiracDelta) else found

    def with_role(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the parameters whose laws declare them to be of a `kind`."""
        return tuple(name for name in self.parameters if self.roles[name].kind == kind)

    # -- words

    def written(self, expression: sp.Basic) -> sp.Basic:
        """An expression as people know it: with plain SymPy symbols, called by their `letters`.

        The symbols of the equations are called by their places, whatever names users give, and equal no others.
        """
        return expression.xreplace(
            {
                one: sp.Symbol(self.letters.get(one, one.name), **one.assumptions0)
                for one in expression.free_symbols
                if isinstance(one, sp.Dummy)
            }
        )

    def equations(self) -> list[sp.Eq]:
        """The model as SymPy equations in its letters, ready for LaTeX."""
        return list(map(self.written, self._equations()))

    def _equations(self) -> list[sp.Eq]:
        time = self.inputs["time"]
        found = [
            sp.Eq(late, sp.Function(str(self.written(symbol)))(time - delay), evaluate=False)
            for late, (symbol, delay) in self.late.items()
        ]
        found += [sp.Eq(symbol, expression, evaluate=False) for symbol, expression in self.definitions.items()]
        balances = [one.balance for one in self.contacts] + [one.balance for one in self.coordinates]
        found += [sp.Eq(balance, 0, evaluate=False) for balance in balances if balance is not None]
        for variable, rate in zip(self.variables, self.rates, strict=True):
            found.append(sp.Eq(sp.Derivative(variable.symbol, time), rate, evaluate=False))
        return found

    def __str__(self) -> str:
        kind = "with inertia" if self.inertial else "quasistatic"
        unknowns = ", ".join(str(self.written(contact.unknown)) for contact in self.contacts)
        lines = [f"Model, {kind}; algebraic unknown {unknowns}", "variables"]
        lines += [f"  {self.written(v.symbol)!s:<10} {v.unit:<8} {v.doc}" for v in self.variables]
        lines.append("parameters")
        letters = {name: self.written(symbol) for name, symbol in self.parameters.items()}
        lines += [f"  {letter!s:<14} {self.roles[name].unit:<8} {name}" for name, letter in letters.items()]
        lines.append("equations")
        for equation in self.equations():
            left = equation.lhs
            name = f"d{left.args[0]}/dt" if isinstance(left, sp.Derivative) else str(left)
            lines.append(f"  {name} = {equation.rhs}")
        return "\n".join(lines)

    def _repr_latex_(self) -> str:
        rows = [f"{sp.latex(e.lhs)} &= {sp.latex(e.rhs)}" for e in self.equations()]
        return "$$\\begin{aligned}" + r" \\ ".join(rows) + "\\end{aligned}$$"
