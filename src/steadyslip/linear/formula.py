"""The critical stiffness of the user's own rig as a formula."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from steadyslip.linear import cubic
from steadyslip.linear.response import response
from steadyslip.model import Model, build_model
from steadyslip.slider import Slider

MU_SS = sp.Symbol("mu_ss", real=True)


def formula(rig: Slider) -> sp.Eq:
    """Critical stiffness of a rig with one memory variable, as a SymPy equation k_cr = N/D.

    The formula holds for every rig of the same structure. It is in terms of the rig's parameters, the
    steady normal stress ``sigma_ss`` and, where the friction coefficient is steady sliding's,
    ``mu_ss``. Stable above it while D > 0, below it while D < 0 (theory 3).

    Raises
    ------
    NotAvailable
        If the model has several memory variables or none, or integral control: then the boundary is a
        root of a polynomial, which `stable_stiffness` solves.
    """
    return _formula(build_model(rig))


@lru_cache(maxsize=32)
def _formula(model: Model) -> sp.Eq:
    known = response(model).as_dict()
    gain = known.pop("k") - model.parameters["slider.stiffness"]
    numerator, denominator = cubic.hopf_line(**known)
    mu = sp.simplify(model.steady[model.symbols["tau"]] / model.sigma_ss)
    fraction = sp.together(_with_mu(numerator, mu) / _with_mu(denominator, mu) - gain)
    return sp.Eq(sp.Symbol("k_cr"), _tidy(sp.cancel(fraction)), evaluate=False)


def _with_mu(expression: sp.Expr, mu: sp.Expr) -> sp.Expr:
    """Write mu_ss for the steady friction coefficient wherever its reference value occurs in it."""
    free = sorted((s for s in mu.free_symbols if s.name == "mu_ref"), key=str)
    if not free or mu.diff(free[0]) != 1:
        return expression
    return sp.expand(expression.xreplace({free[0]: MU_SS - (mu - free[0])}))


def _tidy(expression: sp.Expr) -> sp.Expr:
    """Factor numerator and denominator."""
    numerator, denominator = sp.fraction(sp.together(expression))
    return sp.factor(numerator) / sp.collect(sp.factor(denominator), sp.Symbol("tan(psi)"))
