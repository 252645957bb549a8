"""The Reduction class: a Model as an ordinary differential equation with explicit rates.

Unknowns without a closed form are determined by residuals and differentiated implicitly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import sympy as sp

from steadyslip.core.caching import HasCache
from steadyslip.core.errors import InternalError
from steadyslip.core.expressions import derivative, symbols_of
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.equations import TIME, V_LP, Model, P, Q
from steadyslip.model.kinematics import VelocityVariable, W, single_variable

__all__ = ["TIME", "V_LP", "P", "Q", "Reduction", "Sliding", "W"]


JUMP = inner_symbol("jump", real=True)  # sudden change of the load point's velocity
SPEED = "w of v"
"""Name of a contact's velocity variable in the state; laws cannot use it because of the spaces."""


def channels_for(pushes: int, presses: int) -> tuple[sp.Symbol, ...]:
    """Symbols of the input channels, in the order of `steadyslip.protocol.protocol.channel_of`.

    Load point, first push and first normal stress are always present; further pushes and normal stresses follow.
    """
    more = [inner_symbol(f"q.{i}", real=True) for i in range(2, pushes + 1)]
    return V_LP, Q, P, *more, *(inner_symbol(f"p.{i}", real=True) for i in range(2, presses + 1))


def slope_of(channel: sp.Symbol) -> sp.Symbol:
    """Symbol of the time derivative of a channel."""
    return inner_symbol(f"{channel.name}_dot", real=True)


@dataclass(frozen=True, eq=False)
class Sliding:
    """Outputs of a contact in motion.

    Attributes
    ----------
    variable : VelocityVariable or None
        Velocity variable; None if the slip rate is a function of other velocities.
    outputs : dict of str to sympy.Expr
        Expressions of v, acceleration, sigma, tau and T.
    slip : sympy.Expr
        Slip x ahead of steady sliding.
    ratio : sympy.Expr
        Ratio of slip rate to the velocity of the drive in steady sliding.
    """

    variable: VelocityVariable | None
    outputs: Mapping[str, sp.Expr]
    slip: sp.Expr
    ratio: sp.Expr

    @property
    def one_way(self) -> bool:
        """True if the friction law is defined for forward slip only: its velocity variable is a logarithm."""
        return self.variable is not None and self.variable.kind == "logarithm"


@dataclass(frozen=True, eq=False)
class Reduction(HasCache):
    """Explicit rates of a Model; expressions contain `state`, `inputs`, `slopes`, parameters and `unknowns` only.

    Attributes
    ----------
    form : str
        Solution for velocities determined by balances: ``eliminated``, ``explicit`` or ``implicit``; see
        `steadyslip.model.reducing`.
    state : tuple of sympy.Symbol
        Integrated variables: displacements, velocity variables (unless massless and not eliminated), memory variables,
        integral.
    names : tuple of str
        Names of the state variables; a velocity variable is `SPEED`, preceded by the contact's name and a dot.
    continuous : tuple of sympy.Symbol
        Variables unchanged by a jump of the inputs: displacements, velocities (with inertia), memory, integral.
    rates : tuple of sympy.Expr
        d(state)/dt.
    unknowns : tuple of sympy.Symbol
        Unknowns of Newton's method at every time: velocity variables, accelerations, or friction stresses.
    residuals : tuple of sympy.Expr
        Equations of the unknowns, zero in motion.
    restarts : tuple of (sympy.Symbol, sympy.Expr)
        With massless bodies: variables solved for after a jump, the unknowns first, then other velocity variables; and
        their balances as functions of `continuous`, each increasing with its variable.
    restored : tuple of sympy.Expr
        `continuous` as functions of the state.
    slidings : tuple of Sliding
        Contacts, in the order of the Model.
    shifts : tuple of sympy.Expr
        Decrease of each displacement (the first items of `continuous`) per unit jump of the load point.
    sped : tuple of (sympy.Symbol, sympy.Expr)
        Velocity variables of bodies with inertia on which the drive slides, after a jump `JUMP` of the load point's
        velocity, as functions of `continuous` before it: the bodies keep their own velocities.
    further : dict of str to sympy.Expr
        Further observables: velocity, acceleration and displacement of the coordinates of machines.
    channels : tuple of sympy.Symbol
        Inputs set by protocols: velocity of the load point, pushes and normal stresses; see `channels_for`.
    letting_go : tuple of sympy.Expr
        For a drive that is released during a part of the run: its force, the part caused by its motion with the load
        point at rest (both minus their steady values), the derivative of that with respect to the velocity of the load
        point, and the steady force; see `steadyslip.model.equations.LettingGo`.
    directions : tuple of tuple of sympy.Symbol
        State variables that are sensitivities to changes of the constants (see `steadyslip.model.variational`), one
        tuple for each independent change; the kernel adds the direct dependence on the constants to their `rates`.
    """

    model: Model
    form: str
    state: tuple[sp.Symbol, ...]
    names: tuple[str, ...]
    continuous: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    unknowns: tuple[sp.Symbol, ...]
    residuals: tuple[sp.Expr, ...]
    restarts: tuple[tuple[sp.Symbol, sp.Expr], ...]
    restored: tuple[sp.Expr, ...]
    slidings: tuple[Sliding, ...]
    shifts: tuple[sp.Expr, ...]
    sped: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    further: Mapping[str, sp.Expr] = field(default_factory=dict)
    directions: tuple[tuple[sp.Symbol, ...], ...] = ()
    channels: tuple[sp.Symbol, ...] = (V_LP, Q, P)
    letting_go: tuple[sp.Expr, ...] = ()

    @property
    def velocity(self) -> str:
        """Kind of a slider's velocity variable: ``logarithm``, ``asinh`` or ``linear``."""
        return single_variable(one.variable for one in self.slidings).kind

    @property
    def w_of_v(self) -> sp.Expr:
        """Velocity variable of a slider as a function of velocity and memory."""
        return single_variable(one.variable for one in self.slidings).w_of_v

    @property
    def outputs(self) -> Mapping[str, sp.Expr]:
        """Expressions of v, acceleration, sigma, tau and T of a slider."""
        (one,) = self.slidings
        return one.outputs

    @property
    def inputs(self) -> tuple[sp.Symbol, ...]:
        """Channels and time."""
        return (*self.channels, TIME)

    @property
    def slopes(self) -> tuple[sp.Symbol, ...]:
        """Time derivatives of the channels."""
        return tuple(map(slope_of, self.channels))

    @property
    def searched(self) -> tuple[sp.Symbol, ...]:
        """Variables with initial guesses: the unknowns, then other velocity variables solved for after a jump."""
        return tuple(symbol for symbol, _ in self.restarts) or self.unknowns

    @cached_property
    def solved(self) -> Unknowns:
        """Unknowns with their residuals, for implicit differentiation."""
        return Unknowns(self.unknowns, self.residuals)

    def derivative(self, expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """Total derivative of an expression: the unknowns follow the solution of their equations."""
        return self.solved.along(expression, variable)

    def jacobian(self) -> list[list[sp.Expr]]:
        """Jacobian d(rates)/d(state), rows of expressions."""
        return [[self.derivative(rate, variable) for variable in self.state] for rate in self.rates]

    def time_derivative(self) -> list[sp.Expr]:
        """Partial time derivatives of the rates, through the inputs."""
        return [self._in_time(rate) for rate in self.rates]

    def change(self, expression: sp.Expr, rates: Sequence[sp.Expr]) -> sp.Expr:
        """Total time derivative of an expression at given rates of the state."""
        moved = (self.derivative(expression, s) * rate for s, rate in zip(self.state, rates, strict=True))
        return sp.Add(*moved, self._in_time(expression))

    def _in_time(self, expression: sp.Expr) -> sp.Expr:
        """Partial time derivative of an expression, through the inputs."""
        slopes = zip(self.inputs, (*self.slopes, sp.Integer(1)), strict=True)
        return sp.Add(*(self.derivative(expression, s) * slope for s, slope in slopes))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns and an equal number of residuals, which are zero in motion.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
    residuals : tuple of sympy.Expr
    """

    symbols: tuple[sp.Symbol, ...]
    residuals: tuple[sp.Expr, ...]

    @cached_property
    def matrix(self) -> list[list[sp.Expr]]:
        """Jacobian of the residuals with respect to the unknowns, rows of expressions."""
        return [[derivative(residual, symbol) for symbol in self.symbols] for residual in self.residuals]

    def followed(self, expression: sp.Expr, perturbation: Sequence[sp.Expr]) -> sp.Expr:
        """First-order change of an expression through the unknowns, for a `perturbation` of the residuals."""
        own = [(k, derivative(expression, symbol)) for k, symbol in enumerate(self.symbols) if expression.has(symbol)]
        if not own:
            return sp.Integer(0)
        changes = self.changes(perturbation)
        return sp.Add(*(slope * changes[k] for k, slope in own))

    def along(self, expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """Total derivative with respect to a variable, with unknowns that change so that the residuals stay zero."""
        if not self._moves(expression, variable):  # true of nearly all pairs when variables are many
            return sp.S.Zero
        own = [derivative(residual, variable) for residual in self.residuals]
        return derivative(expression, variable) + self.followed(expression, own)

    def _moves(self, expression: sp.Expr, variable: sp.Symbol) -> bool:
        """True if an expression contains a variable, or contains unknowns whose residuals contain the variable."""
        own = symbols_of(expression)
        return variable in own or (variable in self._causes and not own.isdisjoint(self.symbols))

    @cached_property
    def _causes(self) -> frozenset[sp.Symbol]:
        """Symbols of the residuals."""
        return frozenset().union(*map(symbols_of, self.residuals))

    def changes(self, perturbation: Sequence[sp.Expr]) -> list[sp.Expr]:
        """First-order changes −M⁻¹ `perturbation` of the unknowns, M the `matrix`, by elimination without expansion."""
        rows, factors = self._factors
        right = [-one for one in perturbation]
        for i, k, factor in factors:
            right[i] -= factor * right[k]
        found: dict[int, sp.Expr] = {}
        for k in reversed(range(len(rows))):
            row, entries = rows[k]
            known = sp.Add(*(entries[c] * change for c, change in found.items()))
            found[k] = (right[row] - known) / entries[k]
        return [found[k] for k in range(len(rows))]

    @cached_property
    def _factors(self) -> tuple[list[tuple[int, list[sp.Expr]]], list[tuple[int, int, sp.Expr]]]:
        """LU factors: rows of the upper triangle with the number of their equation, and steps (i, k, f): equation i
        minus f times k."""
        rows, factors = list(enumerate(map(list, self.matrix))), []
        for k in range(len(rows)):
            pivot = next((i for i in range(k, len(rows)) if rows[i][1][k] != 0), None)
            if pivot is None:
                raise InternalError("equations with a regular Jacobian")
            rows[k], rows[pivot] = rows[pivot], rows[k]
            above, own = rows[k]
            for i in range(k + 1, len(rows)):
                below, entries = rows[i]
                if entries[k] != 0:
                    factor = entries[k] / own[k]
                    factors.append((below, above, factor))
                    rows[i] = below, [a if b == 0 else a - factor * b for a, b in zip(entries, own, strict=True)]
        return rows, factors
