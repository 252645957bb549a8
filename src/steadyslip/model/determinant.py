"""Exact determinants of matrices of polynomials in s and exp(−s delay) with symbolic coefficients.

Terms that cancel for all values of stiffnesses, dampings and inertias cancel exactly. For machines, the rows of memory
and friction of each contact are first condensed to one row, whose entries are symbols for polynomials, so that the
number of terms does not grow with states and powers of s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.polys.domains import ZZ

from steadyslip.core.errors import InternalError
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.equations import Model

Powers = tuple[int, ...]
"""Exponents: of s, then of exp(−s delay) for each delay."""
Polynomial = dict[Powers, sp.Expr]
"""Nonzero coefficients by exponents."""
Rows = Mapping[sp.Symbol, list[Polynomial]]
Terms = list[tuple[Powers, Any]]
MAX_TERMS = 4000
"""Number of terms of a minor above which the symbolic determinant takes longer than numerical eigenvalues; by trial."""


class TooManyTerms(Exception):
    """Raised if a determinant exceeds the allowed number of terms."""


class Placeholders:
    """Symbols that replace subexpressions which are not polynomials, so that exact polynomial arithmetic is
    possible."""

    def __init__(self) -> None:
        self.names: dict[sp.Symbol, sp.Expr] = {}
        self._known: dict[sp.Expr, sp.Symbol] = {}

    def symbol_for(self, expression: sp.Expr) -> sp.Expr:
        """A new symbol that replaces an expression; whole numbers are returned unchanged."""
        if expression.is_Integer:
            return expression
        symbol = inner_symbol(f"e{len(self.names)}")
        self.names[symbol] = expression
        return symbol

    def polynomial(self, expression: sp.Expr) -> sp.Expr:
        """Polynomial with non-polynomial parts replaced by placeholders; equal parts have equal placeholders."""
        e = sp.sympify(expression)
        if e.is_Symbol or e.is_Integer:
            return e
        if e.is_Number:  # coefficients of the ring are whole numbers
            if e not in self._known:
                self._known[e] = inner_symbol(f"e{len(self.names)}")
                self.names[self._known[e]] = e
            return self._known[e]
        if e.is_Add or e.is_Mul:
            return e.func(*(self.polynomial(part) for part in e.args))
        if e.is_Pow and e.exp.is_Integer and e.exp.is_positive:
            return self.polynomial(e.base) ** e.exp
        if e not in self._known:
            self._known[e] = self.symbol_for(e)
        return self._known[e]

    def restored(self, expression: sp.Expr) -> sp.Expr:
        """Expression with placeholders replaced by the original subexpressions."""
        return expression.xreplace(self.names)


def determinant(
    matrix: list[list[Polynomial]], longest: int | None = None
) -> tuple[list[sp.Symbol], dict[Powers, Terms]]:
    """Determinant of a matrix of polynomials in symbols with integer coefficients, expanded.

    Laplace's expansion by rows is used, in which each minor of the last rows is computed only once.

    Returns
    -------
    names : list of sympy.Symbol
    parts : dict
        Coefficients by exponents of s and delays; each is a list of (exponents of `names`, integer).

    Raises
    ------
    TooManyTerms
        If a minor has more than `longest` terms.
    """
    names = sorted({n for row in matrix for entry in row for e in entry.values() for n in e.free_symbols}, key=str)
    width = max((len(powers) for row in matrix for entry in row for powers in entry), default=1)
    main = [inner_symbol(f"s.{i}") for i in range(width)]
    ring = ZZ[(*main, *names)].ring
    table = [[_in_ring(entry, ring) for entry in row] for row in matrix]
    known = {frozenset[int](): ring.one}

    def minor(columns: frozenset[int]) -> Any:
        """Minor of given columns and as many last rows."""
        if columns not in known:
            row, total, sign = table[len(table) - len(columns)], ring.zero, 1
            for column in sorted(columns):
                if row[column]:
                    total += sign * row[column] * minor(columns - {column})
                sign = -sign
            known[columns] = total
            if longest is not None and len(total) > longest:
                raise TooManyTerms
        return known[columns]

    parts: dict[Powers, Terms] = {}
    for powers, number in minor(frozenset(range(len(table)))).terms():
        parts.setdefault(powers[:width], []).append((powers[width:], number))
    return names, parts


def _in_ring(entry: Polynomial, ring: Any) -> Any:
    total = ring.zero
    for powers, e in entry.items():
        term = ring.from_expr(e)
        for generator, power in zip(ring.gens, powers, strict=False):
            term *= generator**power
        total += term
    return total


def machine_determinant(model: Model, rows: Rows, tensions: Sequence[sp.Symbol] = ()) -> Polynomial:
    """Determinant of the characteristic matrix `rows` of a machine; the forces `tensions` of links are unknowns.

    Raises
    ------
    TooManyTerms
        If a minor has more than `MAX_TERMS` terms.
    """
    columns = {name: place for place, name in enumerate(rows)}
    blocks = [_Block(rows, columns, i, model) for i in range(len(model.contacts))]
    inside = {place for block in blocks for place in block.own}
    core = [place for place in columns.values() if place not in inside]
    kept = [*core, *(block.own[-1] for block in blocks)]
    table = list(rows.items())
    if any(row[j] for i, (_, row) in enumerate(table) for j in inside.difference(kept) if i not in inside):
        raise InternalError("memory variables to act on other equations through friction only")
    placeholders = Placeholders()
    forces = {one.velocity for one in model.coordinates}.union(tensions)
    matrix = []
    for place in core:
        name, row = table[place]
        stand_in = placeholders.polynomial if name in forces else lambda e: -placeholders.symbol_for(-e)
        matrix.append([{powers: stand_in(e) for powers, e in row[column].items()} for column in kept])
    nothing = (0,) * (1 + len(model.delays))
    for block in blocks:
        own = [block.symbols.get(place) for place in core]
        own += [block.whole if other is block else block.symbols.get(other.own[-1]) for other in blocks]
        matrix.append([{} if symbol is None else {nothing: symbol} for symbol in own])
    names, found = determinant(matrix, MAX_TERMS)
    values = {symbol: value for block in blocks for symbol, value in block.values.items()}
    factors = [placeholders.restored(name) for name in names]
    levels = [[i for i, name in enumerate(names) if name in block.values] for block in blocks]
    terms = [(powers, inner, number) for powers, polynomial in found.items() for inner, number in polynomial]
    return _substituted(terms, levels, [values.get(name) for name in names], factors)


class _Block:
    """Memory and friction of a contact condensed to one row of the matrix: D τ + Σ G_j x_j = 0, by Cramer's rule.

    `symbols` has the symbol of G_j by column j, `whole` is the symbol of D; `values` has the polynomials of all
    symbols.
    """

    def __init__(self, rows: Rows, columns: Mapping[sp.Symbol, int], index: int, model: Model) -> None:
        contact = model.contacts[index]
        self.own = [columns[item.symbol] for item in (*contact.memory, *contact.own_states)] + [
            columns[contact.friction]
        ]
        table = list(rows.values())
        square = [[table[i][j] for j in self.own] for i in self.own]
        outside = [j for j in columns.values() if j not in self.own and any(table[i][j] for i in self.own)]
        self.whole = inner_symbol(f"D.{index}")
        self.values = {self.whole: _small_determinant(square)}
        self.symbols: dict[int, sp.Symbol] = {}
        for j in outside:
            replaced = [[*line[:-1], table[i][j]] for i, line in zip(self.own, square, strict=True)]
            value = _small_determinant(replaced)
            if value:
                self.symbols[j] = inner_symbol(f"G.{index}.{j}")
                self.values[self.symbols[j]] = value


def without_cancellation(matrix: list[list[Polynomial]]) -> Polynomial | None:
    """Determinant of a small matrix, expanded in its symbols, if terms cancel in it; else None.

    Terms cancel where friction depends on the rate of its own memory variable, as for bristles with damping. The
    terms may be many orders of magnitude larger than their sum, so that in floating point they would not cancel.
    """
    placeholders = Placeholders()
    entries = [[{powers: placeholders.polynomial(e) for powers, e in entry.items()} for entry in row] for row in matrix]
    names, found = determinant(entries)
    kept = sum(abs(number) for terms in found.values() for _, number in terms)
    if kept == _permanent([[_sum_of_sizes(entry) for entry in row] for row in entries]):
        return None
    factors = [placeholders.restored(name) for name in names]
    return {powers: _nested(terms, factors) for powers, terms in found.items()}


def _sum_of_sizes(entry: Polynomial) -> int:
    """Sum of the absolute values of the integer coefficients of an entry."""
    return sum(int(sum(map(abs, sp.Poly(e, *e.free_symbols or [sp.Dummy()]).coeffs()))) for e in entry.values())


def _permanent(matrix: list[list[int]]) -> int:
    """Permanent of a square matrix: the determinant's expansion with all signs positive."""
    if not matrix:
        return 1
    first, *rest = matrix
    return sum(one * _permanent([row[:j] + row[j + 1 :] for row in rest]) for j, one in enumerate(first) if one)


def _small_determinant(matrix: list[list[Polynomial]]) -> Polynomial:
    """Determinant of a small matrix, with expressions as coefficients."""
    if exact := without_cancellation(matrix):
        return exact
    placeholders = Placeholders()
    symbols = [
        [{powers: -placeholders.symbol_for(-e) for powers, e in entry.items()} for entry in row] for row in matrix
    ]
    names, found = determinant(symbols)
    factors = [placeholders.restored(name) for name in names]
    return {powers: _nested(c, factors) for powers, c in found.items()}


def _substituted(
    terms: list[tuple[Powers, Powers, Any]],
    levels: list[list[int]],
    values: list[Polynomial | None],
    factors: list[sp.Expr],
) -> Polynomial:
    """Sum of all terms in which the symbols of contacts are replaced by their polynomials, contact by contact.

    Every term contains exactly one symbol of each contact; `levels` has the indices of these symbols by contact.
    """
    if not levels:
        groups: dict[Powers, Terms] = {}
        for powers, inner, number in terms:
            groups.setdefault(powers, []).append((inner, number))
        return {powers: _nested(group, factors) for powers, group in groups.items()}
    places, *rest = levels
    by_symbol: dict[int, list[tuple[Powers, Powers, Any]]] = {}
    for powers, inner, number in terms:
        chosen = next(place for place in places if inner[place])
        without = (*inner[:chosen], 0, *inner[chosen + 1 :])
        by_symbol.setdefault(chosen, []).append((powers, without, number))
    sums: dict[Powers, list[sp.Expr]] = {}
    for chosen, group in by_symbol.items():
        other = _substituted(group, rest, values, factors)
        for mine, value in (values[chosen] or {}).items():
            for powers, e in other.items():
                both = tuple(a + b for a, b in zip(mine, powers, strict=True))
                sums.setdefault(both, []).append(sp.Mul(value, e, evaluate=False))
    return {powers: sp.Add(*parts, evaluate=False) if len(parts) > 1 else parts[0] for powers, parts in sums.items()}


def sum_of_terms(terms: Terms, factors: list[sp.Expr]) -> sp.Expr:
    """Expression of a polynomial as a plain sum of terms."""
    return sp.Add(*(sp.Mul(int(n), *(f**p for f, p in zip(factors, powers, strict=True) if p)) for powers, n in terms))


def _nested(terms: Terms, factors: list[sp.Expr], first: int = 0) -> sp.Expr:
    """Expression of a polynomial in Horner-like form: each factor is taken out of the terms that contain it.

    This shortens polynomials of thousands of terms; `terms` are distinct, so none of them cancel.
    """
    if len(terms) == 1:
        powers, number = terms[0]
        return sp.Mul(int(number), *(factors[i] ** power for i, power in enumerate(powers) if power and i >= first))
    while first < len(factors) and not any(powers[first] for powers, _ in terms):
        first += 1
    groups: dict[int, Terms] = {}
    for term in terms:
        groups.setdefault(term[0][first], []).append(term)
    inner = {power: _nested(group, factors, first + 1) for power, group in groups.items()}
    return sp.Add(*(sp.Mul(factors[first] ** power, part) for power, part in inner.items()))
