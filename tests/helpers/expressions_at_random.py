"""Random expressions, their values by NumPy, and by programs in every language.

By the thousand: ``python tests/helpers/expressions_at_random.py [first seed] [count]``.
"""

import sys

import numpy as np
import sympy as sp

from javascript import Script
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, asinh_exp, numpy_asinh_exp
from steadyslip.kernels import build
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.printers import javascript, python
from steadyslip.kernels.source import Formulas
from tiny_kernel import called

VARIABLES = sp.symbols("u v w", real=True)
FUNCTIONS = {
    sp.exp: np.exp, sp.log: np.log, sp.sin: np.sin, sp.cos: np.cos, sp.tan: np.tan, sp.sinh: np.sinh, sp.cosh: np.cosh,
    sp.tanh: np.tanh, sp.asinh: np.arcsinh, sp.Abs: np.abs, sp.sign: np.sign, asinh_exp: numpy_asinh_exp,
}  # fmt: skip
UNKNOWN = (sp.atan, sp.floor, sp.Heaviside, sp.gamma)
COMPARED = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal,
            "!=": np.not_equal}  # fmt: skip
JOINED = (sp.And, sp.Or, sp.Xor, sp.Nand, sp.Nor, sp.Implies, sp.Equivalent, sp.ITE, sp.Not)
MODERATE = 1e-280, 1e280  # beyond, functions of kernels are not those of NumPy
FARTHEST = 2.6e7  # largest angle whose sine is exact in kernels
LANES = 24
LANGUAGES = ("python", "scalar", "lanes", "JavaScript", "arrays")
RATIONAL = [sp.Rational(p, q) for p in (-7, -5, -3, -1, 1, 3, 5, 7) for q in (2, 3, 4)]


class Random:
    """Draws expressions."""

    def __init__(self, seed, refused=0.0):
        self.rng, self.refused = np.random.default_rng(seed), refused

    def of(self, choices):
        return choices[self.rng.integers(len(choices))]

    def expression(self, depth):
        """One with at most so many operations inside each other."""
        if depth == 0:
            return self.of([*VARIABLES, *VARIABLES, sp.Integer(self.rng.integers(-3, 4)), sp.Rational(1, 3), sp.pi])
        part = self.expression(depth - 1)
        match self.of(("sum", "product", "quotient", "whole", "whole", "odd", "function", "branches", "branches")):
            case "sum":
                return part + self.expression(depth - 1)
            case "product":
                return part * self.expression(depth - 1)
            case "quotient":
                return part / (self.expression(depth - 1) ** 2 + 1)
            case "whole":
                exponent = int(self.rng.integers(2, 65 if depth == 1 else 10)) * self.of((1, 1, -1))
                return part ** (sp.Float(exponent) if self.rng.random() < 0.1 else exponent)
            case "odd":
                return sp.Pow(part, self.of([*RATIONAL, sp.Float(0.7), sp.Float(0.5), sp.Float(2.5)]))
            case "function":
                if self.rng.random() < self.refused:
                    return self.of(UNKNOWN)(part)
                known = self.of(list(FUNCTIONS))
                return known(part, self.expression(depth - 1)) if known is asinh_exp else known(part)
        ends = [(self.expression(depth - 1), self.condition(depth)) for _ in range(self.rng.integers(1, 3))]
        return sp.Piecewise(*ends, *([(part, True)] if self.rng.random() < 0.9 else []))

    def condition(self, depth):
        """A comparison, or several joined."""
        if depth <= 1 or self.rng.random() < 0.4:
            known = self.of((sp.Lt, sp.Le, sp.Gt, sp.Ge, sp.Eq, sp.Ne))
            return known(self.expression(min(depth - 1, 1)), self.of((0, 1, -1, VARIABLES[0])))
        if self.rng.random() < self.refused:
            return sp.Contains(VARIABLES[0], sp.Interval(0, 1))
        known, parts = self.of(JOINED), [self.condition(depth - 1) for _ in range(3)]
        count = {sp.Not: 1, sp.Implies: 2, sp.ITE: 3}.get(known, int(self.rng.integers(2, 4)))
        return known(*parts[:count])


class ByNumPy:
    """Values of an expression, and where on the way something leaves the range that all have in common."""

    def __init__(self, values, moved=0.0):
        self.values, self.moved = values, moved
        self.far = np.zeros(LANES, bool)

    def __call__(self, e):
        if e in (sp.true, sp.false):
            return np.full(len(self.far), bool(e))
        found = self._value(e)
        if found.dtype != bool:
            size = np.abs(found)
            self.far |= (size > MODERATE[1]) | ((size < MODERATE[0]) & (size > 0))
            if isinstance(e, (sp.exp, sp.Pow)):  # no zero but by vanishing, or of zero
                self.far |= (size == 0) & (isinstance(e, sp.exp) or self(e.args[0]) != 0)
        return found

    def _value(self, e):
        if e.is_Symbol:
            return self.values[e]
        if e.is_number and not e.args:
            rounded = 1.0 + self.moved * (e == sp.pi)
            return np.full(len(self.far), float(e) * rounded if e is not sp.zoo else np.nan)
        if isinstance(e, sp.Piecewise):
            found = np.full(len(self.far), np.nan)
            for branch, condition in reversed(e.args):
                found = np.where(self(condition), self(branch), found)
            return found
        parts = [self(part) for part in e.args]
        if isinstance(e, (sp.sin, sp.cos, sp.tan)):
            self.far |= np.abs(parts[0]) > FARTHEST
        if isinstance(e, sp.core.relational.Relational):
            return COMPARED[e.rel_op](*parts)
        if isinstance(e, sp.Add):
            return sum(parts)
        if isinstance(e, sp.Mul):
            return np.prod(parts, axis=0)
        if isinstance(e, sp.Pow):
            return np.power(*parts)
        return {
            sp.And: lambda *p: np.all(p, axis=0), sp.Or: lambda *p: np.any(p, axis=0), sp.Not: np.logical_not,
            sp.Xor: lambda *p: np.sum(p, axis=0) % 2 == 1, sp.Implies: lambda a, b: ~a | b,
            sp.Equivalent: lambda *p: np.all(p, axis=0) | ~np.any(p, axis=0), sp.ITE: np.where, **FUNCTIONS,
        }[e.func](*parts)  # fmt: skip


def programs(expressions, name, variables=VARIABLES):
    """Expressions of what a record begins with, behind it."""
    made = Program(name)
    inputs = {str(i): made.load(i) for i in range(len(variables))}
    for i, value in enumerate(Formulas(expressions, {one: str(i) for i, one in enumerate(variables)})(inputs)):
        made.store(len(variables) + i, value)
    return made


def by_programs(expressions, table, variables=VARIABLES):
    """Values, (4, expressions, points): plain Python, machine code one by one and in lanes, JavaScript."""
    alone, together = (programs(expressions, name, variables) for name in ("rates", "step"))
    addresses = build.machine_code([alone, together], LANES)
    records = np.zeros((4, len(variables) + len(expressions), LANES))
    records[:, : len(variables)] = table
    plain, script = python.function(alone), Script(javascript.as_script(javascript.runtime(), javascript.text(alone)))
    written = script("columns.map((R) => (rates(R, 0, []), R))", columns=records[3].T.copy())
    records[3] = np.array(written, dtype=float).T
    for lane in range(LANES):
        own = records[:2, :, lane].copy()
        plain(own[0], 0.0, np.empty(1))
        called(addresses["rates"], own[1])
        records[:2, :, lane] = own
    called(addresses["step"], records[2])
    return records[:, len(variables) :]


def differing(e, values, found):
    """Values by NumPy, and which of those found in several ways are others: [(way, point), ...].

    A hundred times what NumPy's change where its arguments move by 1e-14 is no difference. NumPy's are
    NaN where something on the way leaves the range that all have in common, and found ones may be anything there.
    """
    beside = {one: value * (1.0 + 1e-14 * (-1) ** i * (1 + i / 7)) for i, (one, value) in enumerate(values.items())}
    double, moved = ByNumPy(values), ByNumPy(beside, 1e-14)
    expected, beside = double(e), moved(e)
    allowed = MODERATE[0] + 1e-10 * np.abs(expected) + 1e2 * np.abs(expected - beside)
    sure = ~double.far & np.isclose(expected, beside, 1e-6, 0.0, True)
    alike = [(np.abs(own - expected) <= allowed) | (np.isnan(own) & np.isnan(expected)) for own in found]
    return np.where(sure, expected, np.nan), [(way, k) for way, k in np.argwhere(~np.array(alike) & sure)]


def points(rng):
    """Numbers of either sign, zero and one among them."""
    table = rng.choice([-1.0, 1.0], (len(VARIABLES), LANES)) * 10.0 ** rng.uniform(-2, 1.5, (len(VARIABLES), LANES))
    return np.where(rng.random(table.shape) < 0.15, rng.choice([0.0, 1.0, -1.0], table.shape), table)


def wrong(seed, count=20, depth=3, refused=0.02):
    """Differences among random expressions, number of values compared, and number of expressions refused."""
    drawn, found, refusals = Random(seed, refused), [], 0
    while len(found) < count:
        try:
            e = sp.sympify(drawn.expression(depth))
        except (ValueError, TypeError, NotImplementedError):  # SymPy cannot make it: compares nothing complex, say
            continue
        if e.has(sp.I, sp.zoo, sp.nan) or not e.free_symbols:
            continue
        unknown = e.has(*UNKNOWN, sp.Contains)
        try:
            Formulas([e], {})({str(symbol): Program("rates").load(0) for symbol in VARIABLES})
        except NotAvailable:
            assert unknown, e
            refusals += 1
        else:
            assert not unknown, e
            found.append(e)
    table = points(drawn.rng)
    others, compared = [], 0
    with np.errstate(all="ignore"):
        values = by_programs(found, table)
        arrays = ArrayFunction(VARIABLES, found)
        several, single = np.array([*np.broadcast_arrays(*arrays(*table), table[0])][:-1]), arrays.rows(table.T[:8])
        for i, e in enumerate(found):
            expected, bad = differing(e, dict(zip(VARIABLES, table, strict=True)), [*values[:, i], several[i]])
            others += [(e, table[:, k], LANGUAGES[way], expected[k]) for way, k in bad]
            fine = np.isfinite(several[i][:8])
            assert np.allclose(single[fine, i], several[i][:8][fine], 1e-13), e
            assert np.array_equal(np.isnan(single[:, i]), np.isnan(several[i][:8])), e
            compared += int(np.sum(np.isfinite(expected)))
    return others, compared, refusals


if __name__ == "__main__":
    first, count = (int(word) for word in [*sys.argv[1:], *("0", "25")[len(sys.argv) - 1 :]])
    for seed in range(first, first + count):
        others, compared, refusals = wrong(seed)
        print(seed, compared, refusals, *others, sep="\n   " if others else " ")
