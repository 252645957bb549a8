"""Formulas of one reduced Model for one method, and the layout of its record.

A single trajectory is limited by latency: each stage of a step needs the result of the last stage. An expression that
is linear in an exponential e (or another slow function) of the state is rewritten as A e + B: A and B are computed in
parallel with e, so that only one multiplication and addition follow.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy as sp
from sympy.core.function import AppliedUndef

from steadyslip.core.errors import InternalError
from steadyslip.core.expressions import derivative
from steadyslip.core.symbols import inner_symbol
from steadyslip.kernels.events import EVENTS
from steadyslip.kernels.layout import Layout, make_layout
from steadyslip.kernels.methods import METHODS, Method
from steadyslip.kernels.nodes import Value
from steadyslip.kernels.rosenbrock import Pattern
from steadyslip.kernels.source import Constants, Formulas
from steadyslip.model.reduction import JUMP, TIME, V_LP, Reduction, Unknowns

LEVELS = ("constant", "linear", "harmonic")
OUTPUTS = ("v", "acceleration", "sigma", "tau", "T")


@dataclass(frozen=True)
class Choice:
    """Options of a kernel, which decide what code is compiled.

    Attributes
    ----------
    method : str
        Name of the method.
    level : str
        Highest complexity of inputs within a segment: ``constant``, ``linear`` or ``harmonic``.
    harmonics : int
        Harmonic terms per input (level ``harmonic``).
    lanes : int
        Number of trajectories that are integrated in parallel.
    dense : bool
        True to store stages for dense output (events, samples).
    """

    method: str
    level: str = "constant"
    harmonics: int = 0
    lanes: int = 1
    dense: bool = True


class Formulation:
    """Formulas of the equations, and the layout of a record.

    Attributes
    ----------
    layout : Layout
    constants : Constants
    size : int
        Length of the state.
    moving : list of int
        Indices of the state variables on which velocities of contacts depend. Only for implicit methods with dense
        output, whose rates at the end of a step have an error that is corrected (`steadyslip.kernels.step`).
    """

    # inputs that may change with the varied parameters, as the velocity of the drive does
    varied_inputs: tuple[sp.Symbol, ...] = (V_LP,)

    def __init__(self, reduction: Reduction, choice: Choice) -> None:
        self.reduction, self.choice = reduction, choice
        self.method: Method = METHODS[choice.method]()
        self.size = len(reduction.state)
        unheard = len(reduction.model.held) + len(reduction.model.past)
        self.counted = self.size - unheard  # number of variables that the error norm averages over
        self.names = {s: f"y{i}" for i, s in enumerate(reduction.state)} | self._inputs
        own = (one.variable.w for one in reduction.slidings if one.variable is not None)
        variables = {*reduction.state, *reduction.continuous, *self._inputs, *own, JUMP}
        self.unknowns = len(reduction.unknowns)
        self.names |= {symbol: f"z{k}" for k, symbol in enumerate(reduction.unknowns)}
        variables.update(reduction.unknowns)
        self.rated = tuple(inner_symbol(f"rate{i}", real=True) for i in range(self.size))
        variables.update(self.rated)
        self.constants = Constants(variables)
        self._rates = [self._with_constants(rate) for rate in reduction.rates]
        self.driven = self._rates_with_constants()
        self.timed = choice.level != "constant" or any(rate.has(TIME) for rate in self._rates)
        self._write()
        self.layout = self._made_layout()

    @cached_property
    def elimination(self) -> list[int]:
        """State indices in order of elimination: first the variables of delayed signals, which cause least fill-in."""
        past = {item.symbol for item in self.reduction.model.past}
        return sorted(range(self.size), key=lambda i: self.reduction.state[i] not in past)

    @property
    def _inputs(self) -> dict[sp.Symbol, str]:
        """Names used in programs for the input channels, their slopes and time, by symbol."""
        channels = {s: f"in{i}" for i, s in enumerate(self.reduction.channels)}
        return channels | {s: f"slope{i}" for i, s in enumerate(self.reduction.slopes)} | {TIME: "time"}

    def _with_constants(self, expression: sp.Expr) -> sp.Expr:
        """Expression with parameter-only parts replaced by constants, and slopes of constant inputs by zero."""
        if self.choice.level == "constant":
            expression = expression.xreplace(dict.fromkeys(self.reduction.slopes, sp.Integer(0)))
        return self.constants.with_constants(expression)

    def _rates_with_constants(self) -> dict[int, sp.Expr]:
        """Terms that changing constants add to the rates of sensitivities, by index in the state.

        They are also added to the rates.
        """
        reduction = self.reduction
        found = {
            reduction.state.index(symbol): self._change(self._rates[i], direction)
            for direction, symbols in enumerate(reduction.directions)
            for i, symbol in enumerate(symbols)
        }
        self._rates = [rate + found.get(k, 0) for k, rate in enumerate(self._rates)]
        return found

    def _change(self, expression: sp.Expr, direction: int) -> sp.Expr:
        """Derivative of an expression in a direction of parameter space, by constants and unknowns, at fixed state."""

        def explicit(e: sp.Expr) -> sp.Expr:
            known = [*self.constants.symbols.values(), *self.varied_inputs]
            return sp.Add(*(derivative(e, c) * self.constants.rate_of(c, direction) for c in known if e.has(c)))

        return explicit(expression) + self._solved.followed(expression, list(map(explicit, self._solved.residuals)))

    def _entry(self, matrix: list[list[sp.Expr]], i: int, k: int) -> sp.Expr:
        """Entry (i, k) of the Jacobian, including the terms due to changing constants."""
        entry = matrix[i][k]
        entry = entry if entry is sp.S.Zero else self._with_constants(entry)
        if i not in self.driven:
            return entry
        return entry + self._solved.along(self.driven[i], self.reduction.state[k])

    # -- the equations

    @cached_property
    def _solved(self) -> Unknowns:
        """Unknowns and their residuals, written with constants in place of parameters."""
        return Unknowns(self.reduction.unknowns, tuple(map(self._with_constants, self.reduction.residuals)))

    @staticmethod
    def named(z: Sequence[Value]) -> dict[str, Value]:
        """Values of the unknowns by their names in formulas, z0, z1, ..."""
        return {f"z{k}": value for k, value in enumerate(z)}

    def _formulas(self, expressions: Sequence[sp.Expr]) -> Formulas:
        return Formulas(expressions, self.names)

    def _write(self) -> None:
        """Make all formulas; constants are numbered in the order in which formulas use them."""
        reduction, n = self.reduction, self.size
        seen = [[self._with_constants(one.outputs[name]) for name in OUTPUTS] for one in reduction.slidings]
        outputs = [e for one in seen for e in one]
        self.residuals: Formulas | None = None
        matrix = reduction.solved.matrix
        self.slopes = [(i, k) for i, row in enumerate(matrix) for k, slope in enumerate(row) if slope != 0]
        if reduction.unknowns:
            slopes = [matrix[i][k] for i, k in self.slopes]
            self.residuals = self._formulas([self._with_constants(e) for e in (*reduction.residuals, *slopes)])
        if self.choice.lanes == 1 and not self.method.implicit:
            own = [one.variable.w for one in reduction.slidings if one.variable is not None]
            self._rates = with_short_chains(self._rates, own)
        self.rates = self._formulas(self._rates)
        self.full = self._formulas(self._rates + [e for one in seen for e in one[:3]])
        also = [*reduction.further.values(), *(one.slip for one in reduction.slidings)]
        self.outputs = self._formulas(outputs + [self._with_constants(e) for e in also])
        self.restored = self._formulas([self._with_constants(e) for e in reduction.restored])
        self.pattern: Pattern = set()
        if self.method.implicit:
            matrix = reduction.jacobian()
            found = {(i, k): self._entry(matrix, i, k) for i in range(n) for k in range(n)}
            self.pattern = {place for place, entry in found.items() if entry != 0}
            entries = [found[place] for place in sorted(self.pattern)]
            if self.timed:
                entries += [self._with_constants(e) for e in reduction.time_derivative()]
            self.jacobian = self._formulas(entries)
        self.moving: list[int] = []
        if self.choice.dense and self.method.implicit:
            changes = [reduction.change(one.outputs["v"], self.rated) for one in reduction.slidings]
            self.accelerations = self._formulas([self._with_constants(e) for e in changes])
            self.moving = [i for i, rate in enumerate(self.rated) if any(e.has(rate) for e in changes)]
        self._write_velocity()
        known = {s: f"k{i}" for i, s in enumerate(reduction.continuous)} | self._inputs
        known |= {w: f"w{k}" for k, (w, _) in enumerate(reduction.restarts)}
        balances = [balance for _, balance in reduction.restarts]
        balances += [derivative(balance, w) for balance in balances for w, _ in reduction.restarts]
        self.restart = Formulas([self._with_constants(e) for e in balances], known) if balances else None
        self.letting_go = self._formulas([self._with_constants(e) for e in reduction.letting_go])
        self.shift = self._formulas([self._with_constants(e) for e in reduction.shifts])
        drive = reduction.model.steady[reduction.model.inputs["load_velocity"]]
        sped = [drive, *(e for _, e in reduction.sped)] if reduction.sped else []
        self.sped = Formulas([self._with_constants(e) for e in sped], known | {JUMP: "jump"})
        self.shares = self._formulas([self._with_constants(e) for i in range(self.contacts) for e in self._shares(i)])

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.reduction.slidings)

    def _shares(self, index: int) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Ratios for a contact in steady sliding: slip rate over the drive's, slip rate and σ over the first
        contact's."""
        one, first = self.reduction.slidings[index], self.reduction.slidings[0]
        stresses = [contact.sigma_ss for contact in self.reduction.model.contacts]
        return one.ratio, one.ratio / first.ratio, stresses[index] / stresses[0]

    def _write_velocity(self) -> None:
        """Make formulas for velocity from w alone and for w from velocity, for one contact whose w is integrated."""
        reduction = self.reduction
        self.speed: Formulas | None = None
        self.limit: Formulas | None = None
        if self.contacts > 1:
            return
        ((contact,), (sliding,)) = reduction.model.contacts, reduction.slidings
        speed, v, own = sliding.outputs["v"], contact.velocity, sliding.variable
        if own is None:
            raise InternalError("a velocity variable at a single contact")
        inverse = own.w_of_v
        variables = {*reduction.state, *reduction.continuous, *reduction.inputs, *reduction.unknowns}
        alone = speed.free_symbols & variables == {own.w} and not inverse.free_symbols & variables
        if own.w not in reduction.state:
            return
        if self.choice.dense and alone:
            self.speed = self._formulas([self._with_constants(speed)])
            self.limit = Formulas([self._with_constants(inverse.xreplace({v: own.w}))], {own.w: "v"})

    @property
    def terms(self) -> int:
        """Number of polynomial coefficients of a variable's dense output."""
        return len(self.method.dense) + 2 if self.method.implicit else len(self.method.dense[0]) + 1

    def _made_layout(self) -> Layout:
        reduction, choice = self.reduction, self.choice
        massless = len(reduction.restarts)
        own = [w for w, _ in reduction.restarts if w not in reduction.unknowns]
        own += [one.variable.w for one in reduction.slidings if self.contacts == 1 and one.variable is not None]
        return make_layout(
            lanes=choice.lanes,
            size=self.size,
            kept=len(reduction.continuous),
            constants=len(self.constants.all),
            inputs=len(reduction.channels),
            harmonics=choice.harmonics,
            stages=self.method.stages if choice.dense else 0,
            terms=self.terms,
            moving=len(self.moving),
            extra=choice.dense and self.method.all_stages > self.method.stages,
            massless=massless,
            unknowns=self.unknowns,
            solved=massless > 0 and self.unknowns > 0 and reduction.form != "eliminated",
            w=reduction.state.index(own[0]) if own and own[0] in reduction.state else -1,
            contacts=self.contacts,
            events=self.contacts * len(EVENTS) if choice.dense else 0,
            further=len(reduction.further),
            watched=choice.lanes > 1 and self.speed is not None and not reduction.unknowns,
        )


__all__ = ["with_short_chains"]


def with_short_chains(expressions: Iterable[sp.Expr], variables: Iterable[sp.Symbol]) -> list[sp.Expr]:
    """Expressions rewritten as A s + B wherever they are linear in a slow function s (exponential, ...) of `variables`.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
    variables : iterable of sympy.Symbol
        Symbols on which the slow functions depend: the velocity variables.
    """
    written, late = list(expressions), frozenset(variables)
    names: list[tuple[sp.Symbol, sp.Expr]] = []
    while slow := _innermost(written, late | {name for name, _ in names}):
        name = inner_symbol(f"slow.{len(names)}", real=True)
        names.append((name, slow))
        written = [e.xreplace({slow: name}) for e in written]
        written = [_Collector(name).collected(e) for e in written]
    for name, slow in reversed(names):
        written = [e.xreplace({name: slow}) for e in written]
    return written


def _innermost(expressions: Iterable[sp.Expr], late: frozenset[sp.Symbol]) -> sp.Expr | None:
    """A function in the expressions that depends on `late` symbols, innermost first; None if there is none."""
    for expression in expressions:
        for node in sp.postorder_traversal(expression):
            is_slow = isinstance(node, sp.Function) and not isinstance(node, (AppliedUndef, sp.Piecewise))
            if is_slow and node.free_symbols & late:
                return node
    return None


class _Collector:
    """Rewriter of expressions in the form A s + B for one symbol s."""

    def __init__(self, symbol: sp.Symbol) -> None:
        self.symbol = symbol
        self._known: dict[sp.Basic, tuple[sp.Expr, sp.Expr] | None] = {}

    def collected(self, e: sp.Basic) -> sp.Basic:
        """Expression in which each maximal part that is linear in s is written as A s + B."""
        if not e.has(self.symbol) or e is self.symbol:
            return e
        linear = self.linear(e)
        if linear is not None:
            return linear[0] * self.symbol + linear[1]
        if e.is_Add or e.is_Mul:
            parts = [self.linear(a) for a in e.args]
            if e.is_Add:
                together = [p for p in parts if p is not None]
                others = [self.collected(a) for a, p in zip(e.args, parts, strict=True) if p is None]
                return sp.Add(self.symbol * sp.Add(*(a for a, _ in together)), *(b for _, b in together), *others)
        return e.func(*map(self.collected, e.args))

    def linear(self, e: sp.Basic) -> tuple[sp.Expr, sp.Expr] | None:
        """Pair (A, B) with e = A s + B; None if e is not linear in s (cached)."""
        if e not in self._known:
            self._known[e] = self._linear(e)
        return self._known[e]

    def _linear(self, e: sp.Basic) -> tuple[sp.Expr, sp.Expr] | None:
        if not e.has(self.symbol):
            return sp.Integer(0), e
        if e is self.symbol:
            return sp.Integer(1), sp.Integer(0)
        if e.is_Add:
            parts = [part for part in map(self.linear, e.args) if part is not None]
            if len(parts) < len(e.args):
                return None
            return sp.Add(*(a for a, _ in parts)), sp.Add(*(b for _, b in parts))
        if e.is_Mul:
            own = [a for a in e.args if a.has(self.symbol)]
            inner = self.linear(own[0]) if len(own) == 1 else None
            if inner is None:
                return None
            rest = sp.Mul(*(a for a in e.args if a is not own[0]))
            return rest * inner[0], rest * inner[1]
        return None
