"""Formulas become programs that give the numbers of NumPy, or are refused in words."""

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from expressions_at_random import LANES, MODERATE, VARIABLES, by_programs, differing, programs, wrong
from friction_laws import LAWS
from rigs_of_theory import CONTACTS
from steadyslip.core.expressions import ArrayFunction, asinh_exp, derivative
from steadyslip.testing.contact import SymbolicContactLaw
from steadyslip.testing.precise import symbolic_copy

U, V, W = VARIABLES


def test_whole_powers_of_negative_numbers():
    """And halves; SymPy itself makes the sixteenth power of the eighth's square."""
    exponents = [
        *range(2, 18),
        31,
        63,
        64,
        65,
        -1,
        -8,
        -9,
        -16,
        -63,
        -64,
        999,
        sp.Float(3.0),
        sp.Float(17.0),
        sp.Float(-2.0),
    ]
    powers = [sp.Pow(U, exponent) for exponent in exponents] + [((U + V) ** 8) ** 2]
    halves = [sp.Pow(U, sp.Rational(k, 2)) for k in (-65, -3, -1, 1, 3, 65)] + [sp.Pow(U, sp.Float(2.5))]
    table = np.array([np.linspace(-2.0, 2.0, LANES), np.full(LANES, 0.25), np.zeros(LANES)])
    values = by_programs([*powers, *halves], table)
    with np.errstate(all="ignore"):
        expected = np.array([table[0] ** float(one) for one in exponents] + [(table[0] + 0.25) ** 16])
        roots = np.array([table[0] ** k for k in (-32.5, -1.5, -0.5, 0.5, 1.5, 32.5, 2.5)])
    expected = np.concatenate([expected, roots])
    moderate = ~((np.abs(expected) > MODERATE[1]) | (np.abs(expected) < MODERATE[0]) & (expected != 0.0))
    for own in values:
        np.testing.assert_allclose(own[moderate], expected[moderate], rtol=3e-13)


def test_powers_of_what_only_the_rig_knows():
    """The exponent is a number of the trajectory: whole ones are right for negative numbers too."""
    table = np.array([np.linspace(-3.0, 3.0, LANES), np.resize([-3.0, 2.0, 5.0, 0.5, 16.0], LANES), np.zeros(LANES)])
    with np.errstate(all="ignore"):
        expected = np.power(table[0], table[1])
        for own in by_programs([U**V], table):
            np.testing.assert_allclose(own[0], expected, rtol=1e-13)


CONDITIONS = {
    "xor": (sp.Xor(U > 0, V > 0), lambda u, v, w: u ^ v),
    "xor of three": (sp.Xor(U > 0, V > 0, W > 0), lambda u, v, w: u ^ v ^ w),
    "nand": (sp.Nand(U > 0, V > 0, W > 0), lambda u, v, w: ~(u & v & w)),
    "nor": (sp.Nor(U > 0, V > 0), lambda u, v, w: ~(u | v)),
    "implies": (sp.Implies(U > 0, V > 0), lambda u, v, w: ~u | v),
    "equivalent": (sp.Equivalent(U > 0, V > 0, W > 0), lambda u, v, w: (u & v & w) | ~(u | v | w)),
    "if then else": (sp.ITE(U > 0, V > 0, W > 0), lambda u, v, w: np.where(u, v, w)),
    "not": (sp.Not(sp.And(U > 0, sp.Or(V > 0, W > 0))), lambda u, v, w: ~(u & (v | w))),
    "equal": (sp.Eq(U > 0, V > 0), lambda u, v, w: u == v),
    "unequal": (sp.Ne(U > 0, sp.Xor(V > 0, W > 0)), lambda u, v, w: u ^ v ^ w),
    "nested": (sp.ITE(sp.Xor(U > 0, V > 0), sp.Implies(V > 0, W > 0), U > 0),
               lambda u, v, w: np.where(u ^ v, ~v | w, u)),
    "always": (sp.true, lambda u, v, w: np.ones_like(u)),
}  # fmt: skip


def test_conditions_of_every_kind():
    expressions = [sp.Piecewise((2 * U, condition), (-V, True)) for condition, _ in CONDITIONS.values()]
    table = np.array(np.meshgrid([-2.0, 0.0, 3.0], [-1.0, 0.0, 0.5], [-1.0, 2.0])).reshape(3, -1)
    table = np.resize(table, (3, LANES)) if table.shape[1] > LANES else np.pad(table, ((0, 0), (0, LANES - 18)))
    expected = np.array([np.where(of(*(table > 0)), 2 * table[0], -table[1]) for _, of in CONDITIONS.values()])
    arrays = ArrayFunction(VARIABLES, expressions)
    several = np.array(np.broadcast_arrays(*arrays(*table)))
    for name, values in zip(("arrays", "rows", *"1234"), [several, arrays.rows(table.T[:8]).T,
                            *by_programs(expressions, table)], strict=True):  # fmt: skip
        assert np.array_equal(values, expected[:, : values.shape[1]]), name


@pytest.mark.parametrize(
    "condition", [sp.Contains(U, sp.Interval(0, 1)), sp.Q.positive(U), sp.Symbol("valid")], ids=str
)
def test_other_conditions_are_refused_by_name(condition):
    with pytest.raises(ss.NotAvailable, match=r"condition .*cannot be compiled; .*And, Or, Not, Xor"):
        programs([sp.Piecewise((1, sp.Or(condition, V > 0)), (2, True))], "rates")


def test_functions_are_known_by_what_they_are_not_by_their_name():
    for name in ("power", "sqrt", "Abs", "DiracDelta", "tan", "expm1"):
        with pytest.raises(ss.NotAvailable, match=name):
            programs([sp.Function(name)(U)], "rates")


@pytest.mark.parametrize("inside", [sp.exp, abs, sp.tanh], ids=str)
def test_few_rows_are_what_many_are_where_a_root_does_not_exist(inside):
    """Python's own power of a negative number is complex, and its size or real part no answer."""
    function = ArrayFunction(
        [U], [inside(U ** sp.Rational(1, 3)), sp.Piecewise(((-3) ** sp.Rational(1, 3), U < 0), (U, True))]
    )
    few, many = function.rows(np.array([[-8.0], [8.0]])), function.rows(np.resize([-8.0, 8.0], (12, 1)))
    assert np.array_equal(few, many[:2], equal_nan=True)
    assert np.isnan(few[0]).all()
    assert np.isfinite(few[1]).all()


def test_asinh_exp_of_arrays_at_the_ends():
    function = ArrayFunction([U, V], [asinh_exp(U, V)])
    x = np.array([0.0, 0.0, -1.0, 1e-300, 1e200, 1e-6, -0.5])
    y = np.array([700.0, 1e4, -2000.0, 1e4, -400.0, 3.0, 0.0])
    expected = np.array([0.0, 0.0, 0.0, np.log(1e-300) + 1e4 + np.log(2), np.arcsinh(1e200 * np.exp(-400.0)),
                         1e-6 * np.exp(3.0), np.arcsinh(-0.5)])  # fmt: skip
    np.testing.assert_allclose(function(x, y)[0], expected, rtol=1e-9, atol=MODERATE[0])
    np.testing.assert_array_equal(function.rows(np.column_stack([x, y])[:7])[:, 0], function(x, y)[0])


@pytest.mark.parametrize("literal", [-1.0, 1e-30, 3.0])
def test_a_branch_that_is_a_number_may_become_a_divisor(literal):
    """Python's own floats raise where numbers of every other language become infinite."""
    branch = sp.Piecewise((literal, U > 0), (V, True))
    expressions = [1 / (branch - literal), 2 / (branch * branch - literal**2), W / (1 / (branch - literal))]
    table = np.array([np.resize(one, LANES) for one in ([1.0, -1.0], [0.0, -1.0, 2.0], [3.0, -3.0, 0.0, 1.0])])
    with np.errstate(divide="ignore", invalid="ignore"):
        plain, *others = by_programs(expressions, table)
    for other in others:
        np.testing.assert_array_equal(plain, other)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2))
def test_random_expressions_are_those_of_numpy(seed):
    others, compared, _ = wrong(seed)
    assert compared > 200
    assert not others


def _laws():
    """Laws of every kind: what they state in symbols of any sign, and their numbers in steady sliding."""
    for law in LAWS:
        copy, numbers = symbolic_copy(law)
        v, sigma, tau = (sp.Dummy(name, real=True) for name in ("v", "sigma", "tau"))
        memory = tuple(sp.Dummy(name, real=True) for name in law.memory())
        stated = [copy.strength(v, sigma, memory, tau), *copy.rates(v, sigma, memory, tau)]
        steady = tuple(map(float, law.steady_memory(1e-6, 5e6)))
        middle = {v: 1e-6, sigma: 5e6, tau: float(law.strength(1e-6, 5e6, steady, 3e6))}
        yield law, stated, middle | dict(zip(memory, steady, strict=True)), numbers
    for law in CONTACTS:
        said = SymbolicContactLaw(law)
        stated = [said.stress, *said.copy.rates(said.motion)]
        yield law, stated, dict.fromkeys(said.inputs, 1e-6) | {said.inputs[3]: 4e6, said.inputs[5]: 3e6}, said.numbers


@pytest.mark.campaign
def test_laws_at_negative_zero_and_huge_arguments():
    """What every law states, and how it changes with each argument, in all languages as by NumPy."""
    rng, compared = np.random.default_rng(11), 0
    factors = [0.0, 1.0, -1.0, 1e-3, 1e3, -1e3, 1e30, -1e30, 1e100]
    for law, stated, middle, numbers in _laws():
        names = [*middle, *numbers]
        everything = [sp.sympify(e) for e in stated]
        everything += [slope.doit() for e in everything for x in middle if (slope := derivative(e, x)) != 0]
        everything = [e.replace(sp.DiracDelta, lambda _: sp.S.Zero) for e in everything]
        table = np.array([*middle.values(), *numbers.values()])[:, None] * np.ones(LANES)
        for k in range(1, LANES):  # one argument of its own at a time, then all
            row = (k % len(middle)) if k < LANES // 2 else slice(len(middle))
            table[row, k] *= rng.choice(factors, np.shape(table[row, k]))
        with np.errstate(all="ignore"):
            values = by_programs(everything, table, names)
            for i, e in enumerate(everything):
                expected, bad = differing(e, dict(zip(names, table, strict=True)), values[:, i])
                compared += np.isfinite(expected).sum()
                assert not bad, (law, e, bad, table[:, bad[0][1]], expected[bad[0][1]])
    assert compared > 5000
