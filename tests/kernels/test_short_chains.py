"""Rates written as A e + B in the exponentials that a stage waits for: the same numbers after a shorter wait."""

from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from steadyslip.kernels.formulation import with_short_chains
from steadyslip.model.build import model_of
from steadyslip.model.reducing import reduce_model

EXAMPLES = Path(__file__).parents[2] / "examples"
W, X = sp.symbols("w x", real=True)


def operations_after(expression, atom):
    """How many operations wait for an atom, one behind the other."""
    if expression is atom or not expression.has(atom):
        return 0
    return 1 + max(operations_after(a, atom) for a in expression.args if a.has(atom))


def test_what_is_linear_in_an_exponential_waits_for_two_operations():
    e = sp.exp(W)
    rate = X * (2 + X * (e - 1) / (1 + X) - e * sp.sin(X)) / (3 + X**2)
    (short,) = with_short_chains([rate], [W])
    assert operations_after(rate, e) == 4
    assert operations_after(short, e) == 2
    assert sp.simplify(short - rate) == 0


def test_an_exponential_of_an_exponential():
    """Radiation damping: friction feels the velocity, and healing feels friction."""
    e = sp.exp(W)
    heal = sp.exp(-(X - 3 * (2 * e - 1)) / (1 + X))
    rate = (X * (heal - e) - 2 * (e - 1)) / (X + 5 * e)
    (short,) = with_short_chains([rate], [W])
    late = next(node for node in sp.preorder_traversal(short) if isinstance(node, sp.exp) and node.args[0].has(e))
    assert operations_after(late.args[0], e) == 2
    assert operations_after(short, late) == 2
    assert sp.simplify(short - rate) == 0


@pytest.mark.parametrize("name", ["slow-axis", "two-states", "triaxial", "machines/feed-axis", "machines/two-guides"])
def test_rates_of_rigs_keep_their_values(name):
    rig = ss.read_rig(EXAMPLES / f"{name}.toml")
    reduction = reduce_model(model_of(rig))
    own = [one.variable.w for one in reduction.slidings if one.variable is not None]
    short = with_short_chains(reduction.rates, own)
    symbols = sorted(set().union(*(rate.free_symbols for rate in reduction.rates)), key=str)
    given = np.random.default_rng(4).uniform(0.2, 1.5, (len(symbols), 20))
    before, after = (
        sp.lambdify(symbols, list(rates), ["numpy", {"asinh_exp": lambda x, y: np.arcsinh(x * np.exp(y))}], cse=True)(
            *given
        )
        for rates in (reduction.rates, short)
    )
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-11, atol=1e-12 * np.max(np.abs(one)))
