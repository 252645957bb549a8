"""Rewriting of rates as A e + B, so that each stage waits little for the exponential e of a velocity variable.

A single trajectory is limited by latency: each stage of a step begins with the result of the last one. Where an
expression is linear in an exponential e (or other slow function) of the state, A and B are computed while e is, and
one multiplication and addition are left to wait for.
"""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp
from sympy.core.function import AppliedUndef

from steadyslip.core.symbols import inner_symbol

__all__ = ["with_short_chains"]


def with_short_chains(expressions: Iterable[sp.Expr], variables: Iterable[sp.Symbol]) -> list[sp.Expr]:
    """Rewrite expressions as linear in functions of `variables` wherever they are linear in them.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
    variables : iterable of sympy.Symbol
        Symbols that the slow functions depend on: the velocity variables.
    """
    written, late = list(expressions), frozenset(variables)
    names: list[tuple[sp.Symbol, sp.Expr]] = []
    while slow := _innermost(written, late | {name for name, _ in names}):
        name = inner_symbol(f"slow.{len(names)}", real=True)
        names.append((name, slow))
        written = [e.xreplace({slow: name}) for e in written]
        written = [_Collector(name).collected(e) for e in written]
    for name, slow in reversed(names):
        written = [e.xreplace({name: slow}) for e in written]
    return written


def _innermost(expressions: Iterable[sp.Expr], late: frozenset[sp.Symbol]) -> sp.Expr | None:
    """First function found that depends on `late` symbols and has no such function in its argument; None if none."""
    for expression in expressions:
        for node in sp.postorder_traversal(expression):
            is_slow = isinstance(node, sp.Function) and not isinstance(node, (AppliedUndef, sp.Piecewise))
            if is_slow and node.free_symbols & late:
                return node
    return None


class _Collector:
    """Rewriting of expressions as A s + B for one symbol s."""

    def __init__(self, symbol: sp.Symbol) -> None:
        self.symbol = symbol
        self._known: dict[sp.Basic, tuple[sp.Expr, sp.Expr] | None] = {}

    def collected(self, e: sp.Basic) -> sp.Basic:
        """Expression with each maximal part that is linear in s written as A s + B."""
        if not e.has(self.symbol) or e is self.symbol:
            return e
        linear = self.linear(e)
        if linear is not None:
            return linear[0] * self.symbol + linear[1]
        if e.is_Add or e.is_Mul:
            parts = [self.linear(a) for a in e.args]
            if e.is_Add:
                together = [p for p in parts if p is not None]
                others = [self.collected(a) for a, p in zip(e.args, parts, strict=True) if p is None]
                return sp.Add(self.symbol * sp.Add(*(a for a, _ in together)), *(b for _, b in together), *others)
        return e.func(*map(self.collected, e.args))

    def linear(self, e: sp.Basic) -> tuple[sp.Expr, sp.Expr] | None:
        """(A, B) with e = A s + B; None if e is not linear in s (cached)."""
        if e not in self._known:
            self._known[e] = self._linear(e)
        return self._known[e]

    def _linear(self, e: sp.Basic) -> tuple[sp.Expr, sp.Expr] | None:
        if not e.has(self.symbol):
            return sp.Integer(0), e
        if e is self.symbol:
            return sp.Integer(1), sp.Integer(0)
        if e.is_Add:
            parts = [part for part in map(self.linear, e.args) if part is not None]
            if len(parts) < len(e.args):
                return None
            return sp.Add(*(a for a, _ in parts)), sp.Add(*(b for _, b in parts))
        if e.is_Mul:
            own = [a for a in e.args if a.has(self.symbol)]
            inner = self.linear(own[0]) if len(own) == 1 else None
            if inner is None:
                return None
            rest = sp.Mul(*(a for a in e.args if a is not own[0]))
            return rest * inner[0], rest * inner[1]
        return None
