"""Dead times in motion: a delayed signal as the end of a transport equation, in Legendre polynomials.

The history of a signal u during the last τ seconds, w(θ, t) = u(t − θτ), obeys τ w_t + w_θ = 0 with w(0) = u, and the
late signal is w(1). A Galerkin method with upwind flux and polynomials of degree n − 1 in θ (compare
Breda, Diekmann, Gyllenberg, Scarabel and Vermiglio 2016 for collocation) turns that into n linear equations. Their
transfer function is the Padé approximant [n−1/n] of exp(−sτ) (Lesaint and Raviart 1974): accurate for signals with
fewer than about n/6 periods in τ, stable, and strictly proper, so that a jump of u does not act at once.

A Model for motion has these n variables for every late signal; a Model for linear stability has the symbols
`Model.late` and exact delays. The n equations are brought to real Schur form by an orthogonal transformation: half of
the coefficients vanish, and the others do not grow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.symbols import inner_symbol
from steadyslip.model.variables import Variable

ORDERS = (6, 10, 16, 24, 36)
"""Possible numbers of variables of a late signal; the error of e^(−iωτ) is 1e-6 at ωτ = 2.8, 7.4, 15, 26, 44."""
USUAL_ORDER = ORDERS[1]  # default number of variables of a late signal


@dataclass(frozen=True)
class Transport:
    """Matrices of the equations τ q' = `matrix` q + `inflow` u and of the delayed signal `outflow` q.

    (n, n), (n,), (n,).
    """

    matrix: NDArray[np.float64]
    inflow: NDArray[np.float64]
    outflow: NDArray[np.float64]


@cache
def transport(order: int) -> Transport:
    """Matrices of transport over the unit interval, by `order` orthonormal Legendre polynomials, in Schur form."""
    from scipy.linalg import schur  # slow to import

    k = np.arange(order)
    size = np.sqrt(2.0 * k + 1.0)  # values of the polynomials at θ = 1; at θ = 0 their signs alternate
    ahead = k[None, :] >= k[:, None]
    matrix = -np.outer(size, size) * np.where(ahead, 1.0, (-1.0) ** (k[:, None] - k[None, :]))
    upper, turned = schur(matrix, output="real")
    # LAPACK chooses signs arbitrarily; these make them unique
    turned = turned * np.where(turned.T @ (size * (-1.0) ** k) < 0, -1.0, 1.0)
    upper = np.triu(turned.T @ matrix @ turned, -1) * (np.abs(np.tril(upper, -1)) + np.triu(np.ones_like(upper)) > 0)
    return Transport(upper, turned.T @ (size * (-1.0) ** k), turned.T @ size)


@dataclass(frozen=True, eq=False)
class LateSignal:
    """A signal that acts after a delay, represented by variables of a Model for motion.

    Attributes
    ----------
    signal, steady : sympy.Expr
        The signal now, and its value in steady sliding.
    delay : sympy.Expr
        Delay in s.
    variables : tuple of Variable
        Variables of kind ``past``; zero once steady sliding has lasted for one delay.
    """

    signal: sp.Expr
    steady: sp.Expr
    delay: sp.Expr
    variables: tuple[Variable, ...]

    @property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(one.symbol for one in self.variables)

    @property
    def late(self) -> sp.Expr:
        """Expression of the signal one delay ago."""
        end = transport(len(self.variables)).outflow
        return self.steady + sp.Add(*(float(c) * s for c, s in zip(end, self.symbols, strict=True)))

    @property
    def settled(self) -> dict[sp.Symbol, sp.Expr]:
        """Values of the variables once the signal has been constant for one delay."""
        equations = transport(len(self.variables))
        shares = -np.linalg.solve(equations.matrix, equations.inflow)
        change = self.signal - self.steady
        return {s: float(share) * change for s, share in zip(self.symbols, shares, strict=True)}

    @property
    def rates(self) -> tuple[sp.Expr, ...]:
        """Time derivatives of the variables."""
        equations = transport(len(self.variables))
        change = self.signal - self.steady
        return tuple(
            sp.Add(*(float(c) * s for c, s in zip(row, self.symbols, strict=True) if c), float(b) * change) / self.delay
            for row, b in zip(equations.matrix, equations.inflow, strict=True)
        )


def late_signal(
    place: int, order: int, signal: sp.Expr, steady: sp.Expr, delay: sp.Expr, unit: str
) -> LateSignal:  # fmt: skip
    """Make the late signal with index `place` of a Model, represented by `order` polynomials."""
    symbols = [inner_symbol(f"past_{place:03d}_{k:03d}", real=True) for k in range(order)]
    variables = (
        Variable(f"late {place + 1}.{k + 1}", s, unit, "part of what acts late", "past") for k, s in enumerate(symbols)
    )
    return LateSignal(signal, steady, delay, tuple(variables))
