"""A Model as an ordinary differential equation: which variables are integrated and how velocity is found.

A massless model fixes its velocity by one scalar equation, the balance of forces. `reduce_model` turns that
into explicit rates in one of three ways and records which:

- *eliminated*: logarithmic laws. ln v is integrated and one memory variable follows from the balance, which
  is linear in it; no equation is left to solve and nothing can drift.
- *explicit*: the unknown (velocity variable, or acceleration with inertia) has a closed form.
- *implicit*: it is found by Newton's method at every evaluation.

The velocity variable w is ln(v/v0) where a law is singular at rest, the argument of the regularised law's
asinh where there is one (exact through rest and reversal), v itself otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.core.expressions import asinh_exp, derivative
from steadyslip.core.questions import Keeper, question
from steadyslip.model.equations import Model

Row = dict[sp.Symbol, sp.Expr]
STANDSTILL = -200
"""Of ln(v/v0): a block with mass slower than this keeps still to every purpose; products of 1/v stay numbers there."""


@dataclass(frozen=True, eq=False)
class Reduction(Keeper):
    """Explicit rates of a Model.

    Every expression is in terms of `state`, `inputs`, `slopes`, the parameters and (form *implicit*) the
    `unknown` only.

    Attributes
    ----------
    form : str
        ``eliminated``, ``explicit`` or ``implicit``.
    velocity : str
        Meaning of w: ``logarithm``, ``asinh`` or ``linear``.
    state : tuple of sympy.Symbol
        What is integrated: x, w (unless massless and not eliminated), memory variables, integral.
    names : tuple of str
        Names of the state variables; ``w`` is the velocity variable.
    continuous : tuple of sympy.Symbol
        What a jump of the inputs leaves unchanged: x, velocity (with inertia), memory, integral.
    rates : tuple of sympy.Expr
        d(state)/dt.
    unknown : sympy.Symbol or None
        What Newton's method finds, in form *implicit*: w or the acceleration.
    residual : sympy.Expr or None
        Its equation, in form *implicit*.
    restart : sympy.Expr or None
        Massless: the balance as an equation for w, to be solved after a jump, in terms of `continuous`.
    restored : tuple of sympy.Expr
        `continuous` from the state.
    outputs : dict of str to sympy.Expr
        v, acceleration, sigma, tau, T and the memory variables.
    w_of_v : sympy.Expr
        The velocity variable from v and the memory.
    directions : tuple of tuple of sympy.Symbol
        State variables (see `steadyslip.model.variational`) that answer to changes of the constants, one tuple
        for each independent change; the kernel adds that to their `rates`, in the order of the first variables
        of `state`.
    """

    model: Model
    form: str
    velocity: str
    state: tuple[sp.Symbol, ...]
    names: tuple[str, ...]
    continuous: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    unknown: sp.Symbol | None
    residual: sp.Expr | None
    restart: sp.Expr | None
    restored: tuple[sp.Expr, ...]
    outputs: dict[str, sp.Expr]
    w_of_v: sp.Expr
    directions: tuple[tuple[sp.Symbol, ...], ...] = ()

    @property
    def inputs(self) -> tuple[sp.Symbol, ...]:
        """v_lp, q, p and time."""
        return INPUTS

    def derivative(self, expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """Derivative along the solution of the balance, where there is an unknown left to solve for."""
        total = derivative(expression, variable)
        if self.unknown is not None and expression.has(self.unknown):
            slope = -derivative(self.residual, variable) / derivative(self.residual, self.unknown)
            total += derivative(expression, self.unknown) * slope
        return total

    def jacobian(self) -> list[list[sp.Expr]]:
        """d(rates)/d(state)."""
        return [[self.derivative(rate, variable) for variable in self.state] for rate in self.rates]

    def time_derivative(self) -> list[sp.Expr]:
        """Partial derivative of the rates in time, through the inputs."""
        return [
            sp.Add(*(self.derivative(rate, symbol) * slope for symbol, slope in zip(INPUTS, SLOPES, strict=True)))
            for rate in self.rates
        ]


V_LP, Q, P, TIME = sp.symbols("v_lp q p t", real=True)
INPUTS = (V_LP, Q, P, TIME)
SLOPES = (*sp.symbols("v_lp_dot q_dot p_dot", real=True), sp.Integer(1))
W = sp.Symbol("w", real=True)


class _Equations:
    """A Model's equations with the velocity written through w, and derivatives through T, τ and σ."""

    def __init__(self, model: Model) -> None:
        self.model, contact = model, model.contact
        self.x, self.v, self.acceleration = contact.slip, contact.velocity, contact.acceleration
        self.tau, self.sigma, self.spring = contact.friction, contact.normal, contact.spring
        self.memory = tuple(item.symbol for item in model.memory)
        self.integrals = tuple(item.symbol for item in model.integrals)
        self.velocity, self.of_w, self.w_of_v = _velocity_variable(model, self.memory)

        def written(expression: sp.Expr) -> sp.Expr:
            smooth = expression.replace(sp.sign, lambda argument: contact.direction.xreplace({self.v: argument}))
            return _in_w(smooth, self.v, self.of_w, self.velocity, model)

        pressed = P + contact.imposed.xreplace({model.inputs["time"]: TIME})
        given = {
            model.inputs["load_velocity"]: V_LP,
            model.inputs["disturbance"]: Q,
            model.inputs["normal_disturbance"]: pressed,
            model.inputs["time"]: TIME,
        }
        self.definitions = {s: written(e.xreplace(given)) for s, e in model.definitions.items()}
        self.balance = written(contact.balance.xreplace(given))
        self.rates = {symbol: written(rate.xreplace(given)) for symbol, rate in model.rate_of.items()}

    def inlined(self, expression: sp.Expr) -> sp.Expr:
        """T, τ and σ replaced by what they are, in w."""
        return self.model.inlined(expression, self.definitions)


def _velocity_variable(model: Model, memory: tuple[sp.Symbol, ...]) -> tuple[str, sp.Expr, sp.Expr]:
    """The kind of w, v as a function of it, and the other way round."""
    contact = model.contact
    v = contact.velocity
    everything = [contact.balance, *model.rates, *model.definitions.values()]
    for expression in (contact.balance, *model.definitions.values()):
        if _singular_at_rest(expression, v):
            scale = model.parameters["drive.velocity"]
            return "logarithm", scale * sp.exp(W), sp.log(v / scale)
    regularised = {primitive for e in everything for primitive in e.atoms(asinh_exp) if primitive.has(v)}
    if len(regularised) == 1:
        scaled, exponent = regularised.pop().args
        factor = scaled / v
        reference = _at_steady_stress(exponent, model)
        if not factor.has(v) and not exponent.has(v) and reference.free_symbols & set(memory):
            return "asinh", sp.sinh(W) * sp.exp(-reference) / factor, asinh_exp(scaled, reference)
    return "linear", W, v


def _at_steady_stress(exponent: sp.Expr, model: Model) -> sp.Expr:
    """The exponent of the regularised law with memory as it is, stresses as in steady sliding."""
    contact = model.contact
    return exponent.xreplace({stress: model.steady[stress] for stress in (contact.friction, contact.normal)})


def _singular_at_rest(expression: sp.Expr, v: sp.Symbol) -> bool:
    """Whether an expression has ln v or a negative or fractional power of v in it."""
    for logarithm in expression.atoms(sp.log):
        if logarithm.has(v) and logarithm.args[0].xreplace({v: sp.Integer(0)}) == 0:
            return True
    return any(
        power.base.xreplace({v: sp.Integer(0)}) == 0 and not (power.exp.is_integer and power.exp.is_positive)
        for power in expression.atoms(sp.Pow)
        if power.base.has(v)
    )


def _in_w(expression: sp.Expr, v: sp.Symbol, of_w: sp.Expr, kind: str, model: Model) -> sp.Expr:
    """Write an expression in w, so that ln v and the regularised law become linear in it."""
    if kind == "logarithm":
        scale = model.parameters["drive.velocity"]

        def log_of(argument: sp.Expr) -> sp.Expr:
            rest = argument / v
            return sp.log(argument) if rest.has(v) else W + sp.log(scale * rest)

        expression = expression.replace(sp.log, log_of).replace(sp.Abs, lambda a: a if (a / v).is_positive else abs(a))
        expression = expression.replace(_is_product_with_sum, lambda product: sp.expand_mul(product, deep=False))
    elif kind == "asinh":

        def regularised(x: sp.Expr, y: sp.Expr) -> sp.Expr:
            if not x.has(v):
                return asinh_exp(x, y)
            rest = y - _at_steady_stress(y, model)
            return W if rest == 0 else asinh_exp(sp.sinh(W), rest)

        expression = expression.replace(asinh_exp, regularised)
    return expression.xreplace({v: of_w})


def _is_product_with_sum(expression: sp.Expr) -> bool:
    """Whether this is a plain factor times (w + constant), which has to be spread for terms to cancel."""
    if not expression.is_Mul or sum(factor.is_Add for factor in expression.args) != 1:
        return False
    return any(factor.is_Add and W in factor.args for factor in expression.args)


@question
def reduce_model(model: Model, eliminate: int | None = 0) -> Reduction:
    """Choose the variables of a model and write their rates.

    Parameters
    ----------
    model : Model
    eliminate : int, optional
        Index of the memory variable that follows from the balance, where the form *eliminated* is
        possible; None forbids that form (the variable's weight in friction is zero or tiny).
    """
    if model.delays:
        raise NotAvailable("motion with a delay is not offered; its verdict is: analyze, stable_values, boundary")
    if model.states:
        raise NotAvailable(
            "motion of contacts with states of their own, such as pore fluid, is not offered; their verdict is"
        )
    equations = _Equations(model)
    if model.inertial:
        return _inertial(model, equations)
    if eliminate is not None and equations.velocity == "logarithm" and len(equations.memory) > eliminate:
        victim = equations.memory[eliminate]
        slope = derivative(equations.balance, victim)
        if slope != 0 and not slope.has(victim) and not slope.has(W):
            return _eliminated(model, equations, victim, slope)
    return _massless(model, equations)


def _solved(residual: sp.Expr, unknown: sp.Symbol) -> sp.Expr | None:
    """The unknown, if the residual is linear in it."""
    slope = derivative(residual, unknown)
    if slope.has(unknown):
        return None
    return -residual.xreplace({unknown: sp.Integer(0)}) / slope


def _names(eq: _Equations, state: tuple[sp.Symbol, ...]) -> tuple[str, ...]:
    by_symbol = {item.symbol: item.name for item in eq.model.variables}
    return tuple("w" if symbol is W else by_symbol[symbol] for symbol in state)


def _inertial(model: Model, eq: _Equations) -> Reduction:
    """Velocity is a variable; the balance gives the acceleration."""
    state = (eq.x, W, *eq.memory, *eq.integrals)
    residual = eq.inlined(eq.balance)
    acceleration = _solved(residual, eq.acceleration)
    unknown = None if acceleration is not None else eq.acceleration
    found = {} if acceleration is None else {eq.acceleration: acceleration}

    def written(expression: sp.Expr) -> sp.Expr:
        return eq.inlined(expression).xreplace(found)

    memory_rates = {symbol: written(eq.rates[symbol]) for symbol in eq.memory}
    push = written(eq.acceleration)
    for symbol, rate in memory_rates.items():
        slope = derivative(eq.of_w, symbol)
        if slope != 0:
            push -= slope * rate
    rates = {eq.x: written(eq.rates[eq.x]), W: push / derivative(eq.of_w, W), **memory_rates}
    rates |= {symbol: eq.rates[symbol] for symbol in eq.integrals}
    if eq.velocity == "logarithm":
        rates = {symbol: _kept_moving(rate) for symbol, rate in rates.items()}
    outputs = _outputs(eq, written, written(eq.acceleration))
    return Reduction(
        model, "explicit" if unknown is None else "implicit", eq.velocity, state, _names(eq, state),
        state, tuple(rates[s] for s in state), unknown, None if unknown is None else residual, None,
        state, outputs, eq.w_of_v,
    )  # fmt: skip


def _kept_moving(rate: sp.Expr) -> sp.Expr:
    """A rate in which the velocity falls no further than to `STANDSTILL`, while friction goes on with ln v.

    Whoever pulls the block back far below its strength would else divide by a velocity beneath floating point.
    """
    least = sp.Piecewise((W, W > STANDSTILL), (sp.Integer(STANDSTILL), True))
    bounded = sp.Dummy(real=True)  # put in last: a condition must not be bounded by itself
    slowed = rate.replace(lambda e: isinstance(e, sp.exp) and e.has(W), lambda e: e.xreplace({W: bounded}))
    return slowed.xreplace({bounded: least})


def _outputs(eq: _Equations, written: object, acceleration: sp.Expr) -> dict[str, sp.Expr]:
    if not callable(written):
        raise InternalError("callable(written)")
    return {
        "v": written(eq.of_w),
        "acceleration": acceleration,
        "sigma": written(eq.sigma),
        "tau": written(eq.tau),
        "T": written(eq.spring),
    } | {str(symbol): written(symbol) for symbol in eq.memory}


def _massless(model: Model, eq: _Equations) -> Reduction:
    """Slip and memory are integrated; the balance gives the velocity variable."""
    state = (eq.x, *eq.memory, *eq.integrals)
    residual = eq.inlined(eq.balance)
    solution = _solved(residual, W)
    unknown = None if solution is not None else W
    found = {} if solution is None else {W: solution}

    def written(expression: sp.Expr) -> sp.Expr:
        return eq.inlined(expression).xreplace(found)

    rates = {symbol: written(eq.rates[symbol]) for symbol in state}
    raw = {symbol: eq.inlined(eq.rates[symbol]) for symbol in state}
    w_rate = -_change(residual, raw) / derivative(residual, W)
    acceleration = derivative(eq.of_w, W) * w_rate
    acceleration += sp.Add(*(derivative(eq.of_w, s) * raw[s] for s in eq.memory))
    outputs = _outputs(eq, written, acceleration.xreplace(found))
    return Reduction(
        model, "explicit" if unknown is None else "implicit", eq.velocity, state, _names(eq, state),
        state, tuple(rates[s] for s in state), unknown, None if unknown is None else residual, residual,
        state, outputs, eq.w_of_v,
    )  # fmt: skip


def _change(residual: sp.Expr, rates: Row) -> sp.Expr:
    """Rate of a residual at fixed w."""
    terms = [derivative(residual, symbol) * rate for symbol, rate in rates.items()]
    terms += [derivative(residual, s) * slope for s, slope in zip(INPUTS, SLOPES, strict=True)]
    return sp.Add(*terms)


def _eliminated(model: Model, eq: _Equations, victim: sp.Symbol, slope: sp.Expr) -> Reduction:
    """ln v is integrated in place of the memory variable `victim`."""
    others = tuple(s for s in eq.memory if s is not victim)
    state = (eq.x, W, *others, *eq.integrals)
    rest = eq.balance.xreplace({victim: sp.Integer(0)})
    given = sp.expand_mul(sp.Add(*(-term / slope for term in sp.Add.make_args(rest))))  # so that ln σ cancels
    residual = eq.inlined(eq.balance)
    raw = {symbol: eq.inlined(eq.rates[symbol]) for symbol in (eq.x, *eq.memory, *eq.integrals)}
    w_rate = -_change(residual, raw) / derivative(residual, W)

    def written(expression: sp.Expr) -> sp.Expr:
        return eq.inlined(expression.xreplace({victim: given}))

    rates = {symbol: written(rate) for symbol, rate in raw.items() if symbol is not victim}
    rates[W] = written(w_rate)
    acceleration = derivative(eq.of_w, W) * rates[W]
    outputs = _outputs(eq, written, acceleration)
    continuous = (eq.x, *eq.memory, *eq.integrals)
    restored = tuple(written(symbol) for symbol in continuous)
    return Reduction(
        model, "eliminated", eq.velocity, state, _names(eq, state), continuous,
        tuple(rates[s] for s in state), None, None, residual, restored, outputs, eq.w_of_v,
    )  # fmt: skip
