"""Edges of machines as formulas: the numbers of `stable_values`, which finds roots of polynomials."""

import numpy as np
import pytest

import steadyslip as ss
from machines import same_block, two_mass
from steadyslip.model.point import operating_point


def number(rig, equation):
    """What a formula is for the values of a rig."""
    point = operating_point(rig)
    letters = [str(point.model.written(symbol)) for symbol in point.model.arguments]
    symbols = dict(zip(letters, map(float, (*point.arguments, *point.sigmas)), strict=True))
    mu = point.model.steady[point.model.contacts[0].friction] / point.model.contacts[0].sigma_ss
    symbols["mu_ss"] = float(mu.subs(dict(zip(point.model.arguments, (*point.arguments, *point.sigmas), strict=True))))
    return float(equation.rhs.subs({s: symbols[str(s)] for s in equation.rhs.free_symbols}))


@pytest.mark.parametrize(
    ("rig", "along"),
    [(same_block(7)[1], None), (same_block(16)[1], "links.spring.stiffness"),
     (same_block(16)[0].with_values({"mass": 0.3}), "mass"), (same_block(7)[1], "damping")],
)  # fmt: skip
def test_the_formula_is_the_edge(rig, along):
    name = along or "stiffness"
    ends = ss.stable_values(rig, name).ravel()
    edge = number(rig, ss.formula(rig, along))
    wanted = ends[np.isfinite(ends) & (ends > 0)]
    assert (np.min(np.abs(wanted - edge)) < 1e-9 * abs(edge)) if len(wanted) else edge <= 0


@pytest.mark.parametrize(
    ("ask", "words"),
    [(lambda: ss.formula(two_mass(), "kp"), r"degree 5.*stable_values\(rig, 'drive\.kp'\)"),
     (lambda: ss.formula(same_block(16)[1], "damping"), "linearly"),
     (lambda: ss.formula(ss.read_rig("examples/machines/two-surfaces.toml")), "several stiffnesses; formula"),
     (lambda: ss.formula(same_block(1)[1], "contacts.base.friction.mu_ref"), "steady normal stress depends")],
)  # fmt: skip
def test_what_has_no_short_formula_is_told_why(ask, words):
    with pytest.raises(ss.NotAvailable, match=words):
        ask()
