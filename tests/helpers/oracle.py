"""An independent integrator of a rig's motion: SciPy on the Model's own equations, root finding included.

It shares nothing with the kernels but the Model: the balance is solved by bracketing at every evaluation, in
the plain variables x, ln v, memory.
"""

import math
from functools import lru_cache

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from steadyslip.model.point import operating_point


class Oracle:
    """A rig with inputs v_lp(t), q(t), p(t) as plain functions."""

    def __init__(self, rig, velocity=None, disturbance=None, pressure=None, plain=False):
        """`plain`: integrate and search for v itself, which may pass through zero, instead of ln v."""
        self.plain, self.drive = plain, rig.drive.velocity
        self.model, self.balance, self.rates, self.start = equations(rig)
        self.inertial = self.model.inertial
        v_lp = velocity or (lambda t: self.drive)
        self.inputs = lambda t: (v_lp(t), (disturbance or zero)(t), (pressure or zero)(t), t)

    def unknown(self, t, x, v, rest):
        """Acceleration, or without inertia the velocity, that balances forces."""
        given = (*rest, *self.inputs(t))
        if self.inertial:
            return linear_root(lambda a: self.balance(x, v, a, *given)[0], self.drive)
        if self.plain:
            return bracketed(lambda v: self.balance(x, v, 0.0, *given)[0], 0.0, self.drive)
        u = bracketed(lambda u: self.balance(x, self.drive * math.exp(u), 0.0, *given)[0], 0.0, 0.5)
        return self.drive * math.exp(u)

    def slope(self, t, y):
        y = y.tolist()
        x, rest = y[0], y[2:] if self.inertial else y[1:]
        if self.inertial:
            v = y[1] if self.plain else self.drive * math.exp(y[1])
            a = self.unknown(t, x, v, rest)
            return [
                v - self.inputs(t)[0],
                a if self.plain else a / v,
                *map(float, self.rates(x, v, a, *rest, *self.inputs(t))),
            ]
        v = self.unknown(t, x, None, rest)
        return [v - self.inputs(t)[0], *map(float, self.rates(x, v, 0.0, *rest, *self.inputs(t)))]

    def run(self, until, x=0.0, v=None, memory=None, method="Radau", rtol=1e-10, times=None, start=0.0):
        """Final x, v and memory (and integral)."""
        memory = self.start if memory is None else memory
        v = self.drive if v is None else v
        y = [x, *([v if self.plain else np.log(v / self.drive)] if self.inertial else []), *memory]
        size = [self.drive if self.plain else 1.0] if self.inertial else []
        scale = np.array([1e-6, *size, *np.maximum(np.abs(memory), 0 if self.plain else 1e-3)])
        solution = solve_ivp(
            self.slope, (start, until), y, method=method, rtol=rtol, atol=rtol * scale * 0.1, t_eval=times
        )
        assert solution.success, solution.message
        y = solution.y[:, -1]
        rest = y[2:] if self.inertial else y[1:]
        if not self.inertial:
            return np.array([y[0], self.unknown(until, y[0], None, rest), *rest])
        return np.array([y[0], y[1] if self.plain else self.drive * np.exp(y[1]), *rest])


@lru_cache(maxsize=8)
def equations(rig):
    """Model; balance and rates as functions of floats; memory in steady sliding, integrals zero."""
    values = operating_point(rig)
    model, contact = values.model, values.model.contact
    numbers = dict(zip(model.arguments, (*values.arguments, float(values.sigma)), strict=True))
    memory = [m.symbol for m in model.memory]
    others = [*memory, *(m.symbol for m in model.integrals)]
    symbols = [contact.slip, contact.velocity, contact.acceleration, *others]
    symbols += [model.inputs[n] for n in ("load_velocity", "disturbance", "normal_disturbance", "time")]

    def inlined(expression):
        pressure = model.inputs["normal_disturbance"]
        definitions = {s: d.xreplace({pressure: pressure + contact.imposed}) for s, d in model.definitions.items()}
        for symbol, definition in reversed(definitions.items()):
            expression = expression.xreplace({symbol: definition})
        return expression.xreplace(numbers)

    balance = scalar_function(symbols, [inlined(contact.balance)])
    rates = scalar_function(symbols, [inlined(model.rate_of[s]) for s in others])
    start = [float(sp.sympify(model.steady[s]).xreplace(numbers)) for s in memory]
    return model, balance, rates, start + [0.0] * (len(others) - len(memory))


def zero(t):
    return 0.0


def asinh_exp(x, y):
    """asinh(x exp(y)) where exp(y) may leave floating point."""
    size = math.log(abs(x) + 5e-324) + y
    return math.copysign(math.asinh(math.exp(size)) if size < 300 else size + math.log(2), x)


def scalar_function(arguments, expressions):
    """Values of expressions from plain floats, all in Python's own mathematics; NaN beyond floating point."""
    function = sp.lambdify(arguments, expressions, modules=[{"asinh_exp": asinh_exp}, "math"], cse=True)

    def evaluate(*values):
        try:
            return function(*values)
        except (OverflowError, ValueError, ZeroDivisionError):
            return [math.nan] * len(expressions)

    return evaluate


def linear_root(function, step):
    """A root where the function is a straight line; bracketed if it turns out not to be one."""
    at, further = function(0.0), function(step)
    found = -at / (further - at) * step if further != at else math.nan
    return found if abs(function(found)) <= 1e-12 * abs(at) else bracketed(function, 0.0, step)


def bracketed(function, guess, step):
    """A root of an increasing function, bracketed outwards from the guess."""
    at = function(guess)
    if at == 0:
        return guess
    direction = -1 if at > 0 else 1
    low = guess
    for _ in range(200):
        high = low + direction * step
        value = function(high)
        if np.isfinite(value) and (value > 0) != (at > 0):
            return brentq(function, *sorted((low, high)), xtol=1e-300, rtol=1e-15)
        if np.isfinite(value):
            low, step = high, 2 * step
        else:
            step /= 4
    raise AssertionError("no root")
