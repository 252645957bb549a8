"""A Model as an ordinary differential equation: explicit rates in the variables that are integrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import sympy as sp

from steadyslip.core.questions import Keeper
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.equations import TIME, V_LP, Model, P, Q
from steadyslip.model.kinematics import VelocityVariable, W, only
from steadyslip.model.unknowns import Unknowns

__all__ = ["TIME", "V_LP", "P", "Q", "Reduction", "Sliding", "W"]


SPEED = "w of v"
"""Name of a contact's velocity variable among those of the state, which no variable of a law can have."""


def channels_for(pushes: int, presses: int) -> tuple[sp.Symbol, ...]:
    """Symbols of the channels: load point, first push, first normal stress, there always; further ones behind them.

    Their order is that of `steadyslip.protocol.protocol.channel_of`.
    """
    more = [inner_symbol(f"q.{i}", real=True) for i in range(2, pushes + 1)]
    return V_LP, Q, P, *more, *(inner_symbol(f"p.{i}", real=True) for i in range(2, presses + 1))


def slope_of(channel: sp.Symbol) -> sp.Symbol:
    """Its rate of change."""
    return inner_symbol(f"{channel.name}_dot", real=True)


@dataclass(frozen=True, eq=False)
class Sliding:
    """A contact in motion.

    Attributes
    ----------
    variable : VelocityVariable or None
        Its velocity variable; None where its velocity follows from those of others.
    outputs : dict of str to sympy.Expr
        v, acceleration, sigma, tau and T.
    slip : sympy.Expr
        How far it is ahead of steady sliding.
    ratio : sympy.Expr
        Slip rate over the velocity of the drive, in steady sliding.
    """

    variable: VelocityVariable | None
    outputs: Mapping[str, sp.Expr]
    slip: sp.Expr
    ratio: sp.Expr


@dataclass(frozen=True, eq=False)
class Reduction(Keeper):
    """Explicit rates of a Model.

    Every expression is in terms of `state`, `inputs`, `slopes`, the parameters and the `unknowns` only.

    Attributes
    ----------
    form : str
        How velocities that balances fix are found: ``eliminated``, ``explicit`` or ``implicit``; see
        `steadyslip.model.reducing`.
    state : tuple of sympy.Symbol
        What is integrated: displacements, velocity variables (unless massless and not eliminated), memory variables,
        integral.
    names : tuple of str
        Names of the state variables; `SPEED` is the velocity variable, with the contact's name before it if it has one.
    continuous : tuple of sympy.Symbol
        What a jump of the inputs leaves unchanged: displacements, velocities (with inertia), memory, integral.
    rates : tuple of sympy.Expr
        d(state)/dt.
    unknowns : tuple of sympy.Symbol
        What Newton's method finds at every moment: velocity variables, accelerations, or frictions of contacts.
    residuals : tuple of sympy.Expr
        As many equations, zero in motion.
    restarts : tuple of (sympy.Symbol, sympy.Expr)
        Where a body has no inertia: what is solved for after a jump, the unknowns first, then other velocity
        variables; and the balances that fix that, in terms of `continuous`, each rising with its own.
    restored : tuple of sympy.Expr
        `continuous` from the state.
    slidings : tuple of Sliding
        The contacts, in the order of the Model.
    shifts : tuple of sympy.Expr
        How far each displacement moves back, the first ones of `continuous`, when the load point jumps ahead by one.
    further : dict of str to sympy.Expr
        What else is observed: velocity, acceleration and displacement of the coordinates of machines.
    channels : tuple of sympy.Symbol
        What is done to the rig: velocity of the load point, pushes and normal stresses; see `channels_for`.
    letting_go : tuple of sympy.Expr
        Of a drive that is let go and moves on: its force, what its motion alone would make of it with the load point at
        rest (both less those of steady sliding), by how much the latter grows with the velocity of the load point, and
        the force of steady sliding; see `steadyslip.model.equations.LettingGo`.
    directions : tuple of tuple of sympy.Symbol
        State variables (see `steadyslip.model.variational`) that answer to changes of the constants, one tuple
        for each independent change; the kernel adds that to their `rates`, in the order of the first variables
        of `state`.
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
    further: Mapping[str, sp.Expr] = field(default_factory=dict)
    directions: tuple[tuple[sp.Symbol, ...], ...] = ()
    channels: tuple[sp.Symbol, ...] = (V_LP, Q, P)
    letting_go: tuple[sp.Expr, ...] = ()

    @property
    def velocity(self) -> str:
        """Meaning of w of a single contact: ``logarithm``, ``asinh`` or ``linear``."""
        return only(one.variable for one in self.slidings).kind

    @property
    def w_of_v(self) -> sp.Expr:
        """The velocity variable of a single contact from its velocity and memory."""
        return only(one.variable for one in self.slidings).w_of_v

    @property
    def outputs(self) -> Mapping[str, sp.Expr]:
        """v, acceleration, sigma, tau and T of a single contact."""
        (one,) = self.slidings
        return one.outputs

    @property
    def inputs(self) -> tuple[sp.Symbol, ...]:
        """The channels, and time."""
        return (*self.channels, TIME)

    @property
    def slopes(self) -> tuple[sp.Symbol, ...]:
        """How fast the channels change."""
        return tuple(map(slope_of, self.channels))

    @property
    def searched(self) -> tuple[sp.Symbol, ...]:
        """What there are guesses of: the unknowns, then further velocity variables that a jump leaves open."""
        return tuple(symbol for symbol, _ in self.restarts) or self.unknowns

    @cached_property
    def solved(self) -> Unknowns:
        """The unknowns with their residuals."""
        return Unknowns(self.unknowns, self.residuals)

    def derivative(self, expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """Derivative along the solution of the balances, where there are unknowns left to solve for."""
        return self.solved.along(expression, variable)

    def jacobian(self) -> list[list[sp.Expr]]:
        """d(rates)/d(state)."""
        return [[self.derivative(rate, variable) for variable in self.state] for rate in self.rates]

    def time_derivative(self) -> list[sp.Expr]:
        """Partial derivative of the rates in time, through the inputs."""
        return [
            sp.Add(*(self.derivative(rate, s) * slope for s, slope in zip(self.inputs, (*self.slopes, 1), strict=True)))
            for rate in self.rates
        ]
