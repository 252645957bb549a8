"""Expressions become array functions and programs; both are what SymPy's own translation gives."""

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from steadyslip.core.expressions import FEW, ArrayFunction, asinh_exp, derivative, occurrences, replaced
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.source import Formulas

X, Y = sp.symbols("x y", real=True)
Z = sp.Symbol("z", positive=True)
EXPRESSIONS = {
    "sum": X - 2 * Y + sp.Rational(1, 3) - Z,
    "negative first": -X - Y,
    "product": -3 * X * Y / (Z * (1 + Z)),
    "reciprocal": 1 / (X**2 + Z),
    "shared": (X + Y) ** 2 / (1 + X**2) + sp.exp(X + Y) / (1 + X**2) - 1 / (1 + X**2),
    "powers": Z**-3 + X**3 + Z ** sp.Rational(1, 2) + Z ** sp.Rational(-3, 2) + Z**Y,
    "roots": sp.sqrt(1 + X**2) / sp.sqrt(Z),
    "functions": sp.sinh(X) - sp.cosh(Y) * sp.tanh(X) + sp.asinh(Y) + sp.sin(X) * sp.cos(Y) + sp.tan(X) + sp.log(Z),
    "sizes": sp.Abs(X - Y) + sp.sign(X) * sp.sign(Y - X),
    "branches": sp.Piecewise((X, X > Y), (Y**2, X <= -1), (sp.exp(-Z), True)),
    "conditions": sp.Piecewise((1, sp.And(X > 0, Y > 0)), (2, sp.Or(X > 1, sp.Not(Y > -1))), (3, True)),
    "numbers": sp.pi * X + sp.E + sp.Float("0.1") * Y + sp.Rational(2, 7),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_values_are_those_of_sympy(name):
    expression = EXPRESSIONS[name]
    random = np.random.default_rng(len(name))
    x, y, z = random.uniform(-2, 2, 50), random.uniform(-2, 2, 50), random.uniform(0.1, 3, 50)
    expected = np.array([float(expression.subs({X: a, Y: b, Z: c})) for a, b, c in zip(x, y, z, strict=True)])
    (found,) = ArrayFunction([X, Y, Z], [expression])(x, y, z)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)
    (single,) = ArrayFunction([X, Y, Z], [expression])(float(x[0]), float(y[0]), float(z[0]))
    assert single == pytest.approx(expected[0], rel=1e-13, abs=1e-14)


def test_extremes_of_several():
    (found,) = ArrayFunction([X, Y, Z], [sp.Max(X, Y, Z) - sp.Min(X, Y, Z)])(np.array([1.0, -3.0]), 2.0, 0.5)
    np.testing.assert_array_equal(found, [1.5, 5.0])


@pytest.mark.parametrize("name", [*EXPRESSIONS, "regularised"])
def test_few_rows_in_numbers_are_those_of_arrays(name):
    expression = EXPRESSIONS.get(name, asinh_exp(X * Z, Y - sp.log(Z)) * Z)
    random = np.random.default_rng(len(name))
    rows = random.uniform(-2, 2, (FEW + 1, 3))
    rows[:, 2] = np.abs(rows[:, 2]) + 0.1
    rows[::3, 0] = 0.0
    function = ArrayFunction([X, Y, Z], [expression, expression + X, sp.Integer(2)])
    many = function.rows(rows)
    assert many.shape == (FEW + 1, 3)
    np.testing.assert_allclose(function.rows(rows[:FEW]), many[:FEW], rtol=1e-13)


def test_rows_beyond_floating_point():
    """Python's numbers raise, or become complex, where NumPy's are inf or NaN."""
    function = ArrayFunction([X, Y], [sp.exp(X), 1 / X, sp.log(X), X**Y, sp.Max(X, Y), sp.sqrt(X)])
    rows = np.array([[1e3, 0.5], [0.0, 1.0], [-1.0, 0.5], [np.nan, 1.0], [1.0, np.nan], [1.0, 2.0]])
    with np.errstate(all="ignore"):
        expected = np.array(np.broadcast_arrays(*function(*rows.T))).T
    for row, own in zip(rows, expected, strict=True):
        np.testing.assert_array_equal(function.rows(row[None])[0], own)
    np.testing.assert_array_equal(function.rows(rows), expected)


@pytest.mark.parametrize("name", [*EXPRESSIONS, "regularised"])
def test_derivatives_are_those_of_sympy(name):
    expression = EXPRESSIONS.get(name, asinh_exp(X * Z, Y - sp.log(Z)) * Z)
    random = np.random.default_rng(len(name))
    numbers = random.uniform(-2, 2, 20), random.uniform(-2, 2, 20), random.uniform(0.1, 3, 20)
    for symbol in (X, Y, Z):
        own, theirs = derivative(expression, symbol), sp.diff(expression, symbol)
        theirs = theirs.doit().replace(sp.DiracDelta, lambda *_: sp.S.Zero)  # the jump of a sign counts for none
        found, expected = (np.broadcast_to(ArrayFunction([X, Y, Z], [e])(*numbers)[0], 20) for e in (own, theirs))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_nothing_is_computed_twice():
    """Every part that several need is one operation."""
    part = sp.exp(X) + Y
    expressions = [1 / part, part**2, sp.sin(part) / part]
    assert occurrences(expressions)[part] >= 3
    formulas = Formulas(expressions, {X: "y0", Y: "y1"})
    assert formulas.symbols == {"y0", "y1"}
    program = Program("shared")
    for i, value in enumerate(formulas({"y0": program.load(0), "y1": program.load(1)})):
        program.store(2 + i, value)
    operations = [node.op for node in program.nodes()]
    assert (operations.count("exp"), operations.count("add"), operations.count("div")) == (1, 1, 1)


def test_what_leaves_floating_point_is_no_traceback():
    function = ArrayFunction([X, Y], [1 / X, sp.log(X), sp.exp(Y), sp.sqrt(X - 1), sp.zoo, sp.nan, sp.oo])
    found = function(0.0, 1000.0)
    assert [str(float(one)) for one in found] == ["inf", "-inf", "inf", "nan", "nan", "nan", "inf"]


@pytest.mark.parametrize("size", [sp.pi**700, sp.Integer(10) ** 400, sp.Pow(sp.pi, -700) ** -1])
def test_constants_beyond_floating_point_are_infinite(size):
    x = sp.Symbol("x", real=True)
    several = ArrayFunction([x], [size * x])
    assert several(2.0) == [np.inf]
    assert several.rows(np.array([[-1.0]])) == -np.inf


def test_functions_that_arrays_do_not_have_are_named():
    with pytest.raises(ss.NotAvailable, match=r"zeta\(\.\.\.\)"):
        ArrayFunction([X], [sp.zeta(X)])


def test_replacing_is_that_of_sympy():
    """Whatever was seen before: another thing for the same symbol, or a symbol that stands in what is put in."""
    x, y, z = sp.symbols("x y z", real=True)
    shared = sp.exp(x * y) + sp.log(1 + x**2)
    expressions = [shared, shared**2 / (1 + shared), sp.Piecewise((shared, x > y), (z, True)), x, sp.Integer(3), z + 1]
    mappings = [{x: y + 1}, {x: z, z: x}, {y: shared}, {x: sp.Integer(0)}, {x: y + 1, y: x}, {}]
    for mapping in (*mappings, *mappings):
        for e in expressions:
            assert replaced(e, mapping) == e.xreplace(mapping)


def test_replacing_goes_through_what_is_shared_once():
    x, y = sp.symbols("x y", real=True)
    nested = x
    for _ in range(50):  # a tree of 2^50 leaves
        nested = asinh_exp(nested, nested)
    parts = occurrences([replaced(nested, {x: y})])
    assert len(parts) == len(occurrences([nested])) == 51
    assert y in parts
    assert x not in parts
