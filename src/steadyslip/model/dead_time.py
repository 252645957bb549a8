"""Dead times in motion: a delayed signal as the end of a transport equation, in Legendre polynomials.

What a signal u was during the last τ seconds, w(θ, t) = u(t − θτ), obeys τ w_t + w_θ = 0 with w(0) = u, and the late
signal is w(1). Polynomials of degree n − 1 in θ, tested with themselves, with the flux taken from upstream (Galerkin;
Breda, Diekmann, Gyllenberg, Scarabel and Vermiglio 2016 for collocation) turn that into n linear equations. Their
transfer function is the Padé approximant [n−1/n] of exp(−sτ) (Lesaint and Raviart 1974): as good as exact for all that
swings fewer than about n/6 times in τ, strictly proper, so that nothing acts before its time by a jump, and stable.

A Model for motion has these n variables for every late signal in place of the symbols `Model.late` of linear stability,
which takes the delay exactly. The variables are those of the real Schur form, an orthogonal change of the orthonormal
polynomials: half of the coefficients vanish, and none is larger than before.
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
"""Variables of a late signal that are chosen from: e^(−iωτ) to 1e-6 up to ωτ = 2.8, 7.4, 15, 26, 44."""
USUAL_ORDER = ORDERS[1]


@dataclass(frozen=True)
class Transport:
    """Equations τ q' = `matrix` q + `inflow` u and late signal `outflow` q, shapes (n, n), (n,), (n,)."""

    matrix: NDArray[np.float64]
    inflow: NDArray[np.float64]
    outflow: NDArray[np.float64]


@cache
def transport(order: int) -> Transport:
    """Transport over the unit interval by orthonormal Legendre polynomials, in real Schur form."""
    from scipy.linalg import schur  # slow to import

    k = np.arange(order)
    size = np.sqrt(2.0 * k + 1.0)  # values of the polynomials at the end; at the beginning they alternate
    ahead = k[None, :] >= k[:, None]
    matrix = -np.outer(size, size) * np.where(ahead, 1.0, (-1.0) ** (k[:, None] - k[None, :]))
    upper, turned = schur(matrix, output="real")
    turned = turned * np.where(turned.T @ (size * (-1.0) ** k) < 0, -1.0, 1.0)  # signs that LAPACK leaves open
    upper = np.triu(turned.T @ matrix @ turned, -1) * (np.abs(np.tril(upper, -1)) + np.triu(np.ones_like(upper)) > 0)
    return Transport(upper, turned.T @ (size * (-1.0) ** k), turned.T @ size)


@dataclass(frozen=True, eq=False)
class LateSignal:
    """A signal that acts late, in a Model for motion.

    Attributes
    ----------
    signal, steady : sympy.Expr
        The signal now, and its value in steady sliding.
    delay : sympy.Expr
        s.
    variables : tuple of Variable
        Of kind ``past``; zero after steady sliding for the delay.
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
        """The signal a delay ago."""
        end = transport(len(self.variables)).outflow
        return self.steady + sp.Add(*(float(c) * s for c, s in zip(end, self.symbols, strict=True)))

    @property
    def settled(self) -> dict[sp.Symbol, sp.Expr]:
        """Values of the variables after a signal that did not change for the delay."""
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
    """Late signal number `place` of a Model, by `order` polynomials."""
    symbols = [inner_symbol(f"past_{place:03d}_{k:03d}", real=True) for k in range(order)]
    variables = (
        Variable(f"late {place + 1}.{k + 1}", s, unit, "part of what acts late", "past") for k, s in enumerate(symbols)
    )
    return LateSignal(signal, steady, delay, tuple(variables))
