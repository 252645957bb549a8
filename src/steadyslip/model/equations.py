"""The Model class: symbolic equations of a rig, with variables, coordinates and contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import sympy as sp

from steadyslip.core.caching import HasCache, cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, latex, replaced
from steadyslip.core.pages import Displayed
from steadyslip.core.roles import Parameter
from steadyslip.core.symbols import inner_symbols
from steadyslip.machine.mechanism import NORMAL, Shares
from steadyslip.model.dead_time import LateSignal
from steadyslip.model.variables import Variable


@dataclass(frozen=True, eq=False)
class Coordinate:
    """Coordinate of a body.

    Attributes
    ----------
    name : str
        Name of the body, with a suffix for motion away from the surface.
    displacement, velocity, acceleration : sympy.Symbol
        The displacement is relative to steady sliding.
    inertia, speed : sympy.Expr
        Mass or moment of inertia, and the speed in steady sliding.
    inertial : bool
        True if the velocity is a variable (with inertia, or if a normal stress depends on the acceleration).
    balance : sympy.Expr or None
        Inertia minus forces, zero in motion; None for a slider, whose only balance is that of its contact.
    unit : str
        Unit of the displacement, m or rad.
    push : sympy.Symbol
        Disturbance acting on the coordinate: a force or torque, on a slider a stress.
    inner : bool
        True for an internal coordinate of a structure; results have the motion of the structure's points instead.
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
    inner: bool = False

    @property
    def words(self) -> str:
        """Name of the body, followed by "away from the surface" for a coordinate normal to it."""
        return self.name.replace(NORMAL, " away from the surface")


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact with its algebraic equation and unknown, and its steady normal stress.

    Attributes
    ----------
    name : str
        Name of the contact; empty for a slider.
    slip, velocity, acceleration : sympy.Expr
        Slip x, slip rate v (a symbol) and its time derivative.
    spring, friction, normal : sympy.Symbol
        Stresses T, τ and σ; expressions are in the Model's `definitions`.
    memory : tuple of Variable
        Memory variables of the friction law.
    own_states : tuple of Variable
        States of the contact law, of kind ``state``.
    balance : sympy.Expr
        Friction stress by the law minus τ; zero in motion.
    unknown : sympy.Symbol
        Unknown determined by `balance`: τ; for a slider, whose τ follows from the balance of forces, the
        `acceleration`, or the `velocity` without inertia.
    area : sympy.Expr
        Area (m²) over which the stresses act; 1 for laws in forces.
    press : sympy.Symbol
        Disturbance of the normal stress.
    outside : sympy.Symbol or None
        Change of the surrounding pressure, for a contact law with pore fluid.
    sigma_ss : sympy.Symbol
        Normal stress in steady sliding.
    steady_stress : sympy.Expr
        Normal stress by the contact law at `sigma_ss`; equal to it in steady sliding.
    steady_coupling : sympy.Expr
        Part of `steady_stress` that is due to the motion.
    steady_load : sympy.Expr or None
        Load σ0; None if the steady normal stress is given instead.
    imposed : sympy.Expr
        Prescribed change of normal stress with time.
    direction : sympy.Expr
        Smooth replacement of sign(v) in simulations, by the friction law.
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
        """True if `balance` determines an acceleration (with mass, or a normal stress that depends on acceleration)."""
        return self.unknown is self.acceleration


V_LP, Q, P, TIME = inner_symbols("v_lp q p t", real=True)
"""Symbols of load-point velocity, first disturbance, first added normal stress, and time."""
HELD = "held back"
"""Name of the variable `LettingGo.held`; laws cannot use it because of the space."""
MOVED, PULLED, EITHER = "moved", "pulled", "either"
"""Modes of a drive during a run: its motion is prescribed, its force is imposed, or both alternate."""


@dataclass(frozen=True, eq=False)
class LettingGo:
    """Expressions for a drive that is alternately moved and released (force imposed).

    Attributes
    ----------
    free : sympy.Symbol
        Input: 1 while the force is imposed, else 0.
    held : sympy.Symbol
        Variable: force of the drive minus the force that its motion since the start alone would cause; while the drive
        is released, the force minus its steady value and minus ``loading``. It jumps at the beginning and end of a
        release so that the force of the drive is continuous.
    force, driven, steady : sympy.Expr
        Force of the drive minus that of steady sliding; the part caused by its motion; the force in steady sliding.
        Stresses for a slider.
    stiffness : sympy.Expr
        Stiffness of the elements that carry the force of the drive.
    ahead, speed : sympy.Expr
        Displacement of the load point ahead of its steady motion since the start, and its time derivative.
    loading_rate : sympy.Symbol
        Time derivative of ``loading``.
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
    """Linear equations M z = r + F τ + G σ of displacements and link forces in steady sliding.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
        z: displacements, controller integral, forces of elements.
    matrix : dict of (int, int) to sympy.Expr
        Nonzero entries of M.
    rest : tuple of sympy.Expr
        r.
    friction, normal : dict of (int, int) to sympy.Expr
        Nonzero entries of F and G; columns are contacts.
    """

    symbols: tuple[sp.Symbol, ...]
    matrix: Entries
    rest: tuple[sp.Expr, ...]
    friction: Entries
    normal: Entries


@dataclass(frozen=True, eq=False)
class Model(HasCache, Displayed):
    """Equations of a rig.

    The variables y obey y' = `rates`. The equation `balance` = 0 of each contact determines its friction stress; the
    balance of forces of each coordinate determines its acceleration, or without inertia its velocity. A slider has one
    equation for friction and motion. Slip rates and the stresses T, τ, σ are given by `definitions`, in this order, as
    functions of variables, unknowns and inputs.

    Derived expressions and functions are cached with the Model (`steadyslip.core.caching`), those of neighbouring
    modules included: `linearise`, `reduce_model`, `system` (Taylor terms), `steady_equation`. A Model has no numbers;
    an `operating_point` adds them.

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
        Load-point velocity, disturbance stress q, normal-stress disturbance (B4 of eq. 12), time; for machines a
        disturbance of every coordinate and every normal stress. With pore fluid the change of the surrounding pressure;
        with an imposed force of the drive its change, ``loading``.
    parameters : dict of str to sympy.Symbol
        Symbols by dotted name. ``slider.stiffness`` is always the component along the sliding direction.
    roles : dict of str to Parameter
        Declarations of the parameters: unit, domain, meaning.
    letters : dict of sympy.Symbol to str
        Display letters of symbols whose letter is not their name, such as parameters; see `written`.
    gain : sympy.Expr
        Stiffness that a controller adds to ``slider.stiffness``.
    axial_share : sympy.Expr or None
        Ratio of ``slider.stiffness`` to the axial stiffness, if that is given instead.
    steady : dict of sympy.Symbol to sympy.Expr
        Steady values as functions of the parameters and the contacts' `sigma_ss`.
    observables : dict of str to (sympy.Expr, str)
        Named results and their SI units.
    late : dict of sympy.Symbol to (sympy.Symbol, sympy.Expr)
        Symbols of delayed displacements, velocities or integrals: the undelayed symbol, and the delay (s).
    late_signals : tuple of LateSignal
        Delayed signals of a Model for motion; see `steadyslip.model.dead_time`.
    for_motion : callable or None
        For a Model with delays, the function that builds the Model for motion, which has none, from the number of
        variables of each late signal (`steadyslip.model.dead_time`). Both have the same parameters.
    letting_go : LettingGo or None
        Expressions for a drive that is alternately moved and released; None for other drives.
    carried : Carried or None
        Equations of link forces in steady sliding, if the symbolic solution would be too long; else None.
    points : mapping of str to Shares
        Rows of the points of structures by the names of coordinates; see `Mechanism.points`.
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
    late_signals: tuple[LateSignal, ...] = ()
    for_motion: Callable[[int], Model] | None = field(default=None, repr=False)
    letting_go: LettingGo | None = None
    carried: Carried | None = None
    points: Mapping[str, Shares] = field(default_factory=dict)

    # -- properties and expressions

    @property
    def contact(self) -> Contact:
        """Contact of a slider.

        Raises
        ------
        NotAvailable
            For machines, which the caller does not support.
        """
        if not self.is_single:
            raise NotAvailable(
                f"this is not offered for a machine with {len(self.coordinates)} coordinates and {len(self.contacts)} "
                "contacts; allowed: a Slider"
            )
        return self.contacts[0]

    @property
    def is_single(self) -> bool:
        """True if the rig is one block on one contact, described by a single balance."""
        return len(self.contacts) == len(self.coordinates) == 1 and self.coordinates[0].balance is None

    @property
    def has_closed_form(self) -> bool:
        """True if the paper's cubic applies: a slider with one memory variable, no other state and no delay."""
        return self.is_slider and len(self.memory) == 1 and not self.integrals and not self.states and not self.delays

    @property
    def is_slider(self) -> bool:
        """True for the Model of a `Slider`, which has a stiffness k."""
        return self.is_single and "slider.stiffness" in self.parameters

    @cached_property
    def inertial(self) -> bool:
        """True if the velocity of every coordinate is a variable."""
        return all(one.inertial for one in self.coordinates)

    @cached_property
    def delays(self) -> tuple[sp.Expr, ...]:
        """Distinct delays (s) in the equations."""
        return tuple(dict.fromkeys(delay for _, delay in self.late.values()))

    @property
    def imposed(self) -> bool:
        """True if a normal stress is prescribed in time."""
        return any(contact.imposed != 0 for contact in self.contacts)

    @cached_property
    def memory(self) -> tuple[Variable, ...]:
        """Memory variables of all contacts."""
        return tuple(item for item in self.variables if item.kind == "memory")

    @cached_property
    def states(self) -> tuple[Variable, ...]:
        """States of all contact laws."""
        return tuple(item for item in self.variables if item.kind == "state")

    @cached_property
    def integrals(self) -> tuple[Variable, ...]:
        """Integral variables of controllers."""
        return tuple(item for item in self.variables if item.kind == "integral")

    @cached_property
    def past(self) -> tuple[Variable, ...]:
        """Variables of late signals, in a Model for motion."""
        return tuple(item for signal in self.late_signals for item in signal.variables)

    @property
    def late_order(self) -> int:
        """Number of variables of each late signal in a Model for motion; 0 if there is no late signal."""
        return len(self.late_signals[0].variables) if self.late_signals else 0

    @property
    def held(self) -> tuple[sp.Symbol, ...]:
        """Variable `LettingGo.held` as a tuple; empty if the drive is not released."""
        return () if self.letting_go is None else (self.letting_go.held,)

    @property
    def arguments(self) -> tuple[sp.Symbol, ...]:
        """Symbols with values at an operating point: parameters, σss of every contact, symbols of `carried`."""
        carried = () if self.carried is None else self.carried.symbols
        return (*self.parameters.values(), *(contact.sigma_ss for contact in self.contacts), *carried)

    def function(self, expressions: Iterable[sp.Expr], *further: sp.Symbol) -> ArrayFunction:
        """Array function of `arguments` and further symbols, cached; `OperatingPoint.evaluate` calls it."""
        return _function(self, tuple(sp.sympify(e) for e in expressions), further)

    @property
    def rate_of(self) -> dict[sp.Symbol, sp.Expr]:
        """Time derivatives by the symbol of the variable."""
        return {item.symbol: rate for item, rate in zip(self.variables, self.rates, strict=True)}

    def inlined(self, expression: sp.Expr, definitions: dict[sp.Symbol, sp.Expr] | None = None) -> sp.Expr:
        """Expression with T, τ and σ replaced by their definitions."""
        for symbol, definition in reversed((definitions or self.definitions).items()):
            expression = replaced(expression, {symbol: definition})
        return expression

    def at_steady(self, expression: sp.Expr) -> sp.Expr:
        """Steady value of an expression; derivatives of sign and |v| are evaluated, which exist for v > 0."""
        found = expression.xreplace({s: self.steady[s] for s in expression.free_symbols & self.steady.keys()})
        return found.doit() if found.has(sp.sign, sp.Derivative, sp.Abs, sp.DiracDelta) else found

    def with_role(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the parameters with a `kind` of `PARAMETER_KINDS`."""
        return tuple(name for name in self.parameters if self.roles[name].kind == kind)

    # -- display

    def written(self, expression: sp.Basic) -> sp.Basic:
        """Expression for display, with plain SymPy symbols named by their `letters`.

        Internal symbols are named by position and differ from all others (`steadyslip.core.symbols`).
        """
        return expression.xreplace(
            {one: sp.Symbol(self.letters.get(one, one.name), **one.assumptions0) for one in expression.atoms(sp.Dummy)}
        )

    def equations(self) -> list[sp.Eq]:
        """Equations of the Model as `sympy.Eq` with display letters, ready for LaTeX."""
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
        rows = [f"{latex(e.lhs)} &= {latex(e.rhs)}" for e in self.equations()]
        return "$$\\begin{aligned}" + r" \\ ".join(rows) + "\\end{aligned}$$"


@cached
def _function(model: Model, expressions: tuple[sp.Expr, ...], further: tuple[sp.Symbol, ...]) -> ArrayFunction:
    return ArrayFunction([*model.arguments, *further], expressions)
