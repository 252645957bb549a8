"""Determinants of matrices of polynomials in s and in exp(−s delay), whose coefficients are expressions.

Exact in the structure: what cancels whatever the numbers are, of stiffnesses and dampings of several bodies, does so
here. A machine's contacts are first taken out of the matrix: memory and friction of each come down to one row, whose
few entries stand as symbols for polynomials of their own, so that terms do not multiply with states and powers of s.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.polys.domains import ZZ

from steadyslip.core.errors import InternalError
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.equations import Model
from steadyslip.model.stand_ins import StandIns

Powers = tuple[int, ...]
"""Of s, then of exp(−s delay) of each delay."""
Polynomial = dict[Powers, sp.Expr]
"""Coefficients; what is zero is not in it."""
Rows = Mapping[sp.Symbol, list[Polynomial]]
Terms = list[tuple[Powers, Any]]
LONGEST = 4000
"""Terms of a minor beyond which writing the determinant of a machine out takes longer than its answers."""


class TooLong(Exception):
    """A determinant with more terms than are of use."""


def determinant(
    matrix: list[list[Polynomial]], longest: int | None = None
) -> tuple[list[sp.Symbol], dict[Powers, Terms]]:
    """Symbols, and by powers the coefficients of a determinant as polynomials in them: powers of each, and numbers.

    Exact: by rows, each minor of the rows below once. Entries are polynomials in symbols with whole coefficients.

    Raises
    ------
    TooLong
        If there are more than so many terms.
    """
    names = sorted({n for row in matrix for entry in row for e in entry.values() for n in e.free_symbols}, key=str)
    width = max((len(powers) for row in matrix for entry in row for powers in entry), default=1)
    main = [inner_symbol(f"s.{i}") for i in range(width)]
    ring = ZZ[(*main, *names)].ring
    table = [[_in_ring(entry, ring) for entry in row] for row in matrix]
    known = {frozenset[int](): ring.one}

    def minor(columns: frozenset[int]) -> Any:
        """Of the last rows, as many as there are columns."""
        if columns not in known:
            row, total, sign = table[len(table) - len(columns)], ring.zero, 1
            for column in sorted(columns):
                if row[column]:
                    total += sign * row[column] * minor(columns - {column})
                sign = -sign
            known[columns] = total
            if longest is not None and len(total) > longest:
                raise TooLong
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


def machine_determinant(model: Model, rows: Rows) -> Polynomial:
    """The determinant of the characteristic matrix of a machine.

    Raises
    ------
    TooLong
        If a minor has more than `LONGEST` terms.
    """
    columns = {name: place for place, name in enumerate(rows)}
    blocks = [_Block(rows, columns, i, model) for i in range(len(model.contacts))]
    inside = {place for block in blocks for place in block.own}
    core = [place for place in columns.values() if place not in inside]
    kept = [*core, *(block.own[-1] for block in blocks)]
    table = list(rows.items())
    if any(row[j] for i, (_, row) in enumerate(table) for j in inside.difference(kept) if i not in inside):
        raise InternalError("memory of friction acts by way of friction only")
    stand_ins = StandIns()
    forces = {one.velocity for one in model.coordinates}
    matrix = []
    for place in core:
        name, row = table[place]
        stand_in = stand_ins.polynomial if name in forces else lambda e: -stand_ins.whole(-e)
        matrix.append([{powers: stand_in(e) for powers, e in row[column].items()} for column in kept])
    nothing = (0,) * (1 + len(model.delays))
    for block in blocks:
        own = [block.symbols.get(place) for place in core]
        own += [block.whole if other is block else block.symbols.get(other.own[-1]) for other in blocks]
        matrix.append([{} if symbol is None else {nothing: symbol} for symbol in own])
    names, found = determinant(matrix, LONGEST)
    meant = {symbol: value for block in blocks for symbol, value in block.meant.items()}
    factors = [stand_ins.back(name) for name in names]
    levels = [[i for i, name in enumerate(names) if name in block.meant] for block in blocks]
    terms = [(powers, inner, number) for powers, polynomial in found.items() for inner, number in polynomial]
    return _joined(terms, levels, [meant.get(name) for name in names], factors)


class _Block:
    """Memory and friction of a contact as one row of the matrix: D τ + Σ G_j x_j = 0, by Cramer's rule.

    `symbols` stand for the G_j by column, `whole` for D; `meant` says what they are.
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
        self.meant = {self.whole: _expanded(square)}
        self.symbols: dict[int, sp.Symbol] = {}
        for j in outside:
            replaced = [[*line[:-1], table[i][j]] for i, line in zip(self.own, square, strict=True)]
            value = _expanded(replaced)
            if value:
                self.symbols[j] = inner_symbol(f"G.{index}.{j}")
                self.meant[self.symbols[j]] = value


def _expanded(matrix: list[list[Polynomial]]) -> Polynomial:
    """A small determinant, its coefficients as expressions."""
    stand_ins = StandIns()
    symbols = [[{powers: -stand_ins.whole(-e) for powers, e in entry.items()} for entry in row] for row in matrix]
    names, found = determinant(symbols)
    factors = [stand_ins.back(name) for name in names]
    return {powers: _nested(c, factors) for powers, c in found.items()}


def _joined(
    terms: list[tuple[Powers, Powers, Any]],
    levels: list[list[int]],
    meant: list[Polynomial | None],
    factors: list[sp.Expr],
) -> Polynomial:
    """The sum of all terms, with what symbols of contacts stand for, contact by contact; each has one in every term."""
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
        other = _joined(group, rest, meant, factors)
        for mine, value in (meant[chosen] or {}).items():
            for powers, e in other.items():
                both = tuple(a + b for a, b in zip(mine, powers, strict=True))
                sums.setdefault(both, []).append(sp.Mul(value, e, evaluate=False))
    return {powers: sp.Add(*parts, evaluate=False) if len(parts) > 1 else parts[0] for powers, parts in sums.items()}


def expanded(terms: Terms, factors: list[sp.Expr]) -> sp.Expr:
    """A polynomial as the sum of its terms."""
    return sp.Add(*(sp.Mul(int(n), *(f**p for f, p in zip(factors, powers, strict=True) if p)) for powers, n in terms))


def _nested(terms: Terms, factors: list[sp.Expr], first: int = 0) -> sp.Expr:
    """A polynomial with each factor taken out of the terms that have it, one after the other: thousands stay few.

    Nothing is added that was not: what cancels had cancelled in `terms`.
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
