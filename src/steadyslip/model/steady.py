"""Steady normal stresses of contacts: their equations and solutions.

σss solves σ = contact(x = 0, v = v0, v̇ = 0, T = τss + ηv0, τ = τss(v0, σ)) and must be positive (theory 3). If the
contact is linear in the stresses, σss = (σ0 + g0)/(1 − g1), with g0 + g1 σ the coupling in steady sliding. g1 >= 1 is
lock-up (friction grows faster than the spring can pull), σ0 + g0 <= 0 is lift-off.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.model.equations import Carried, Entries, Model

Arguments = tuple[Any, ...]
GRID = np.geomspace(1e-12, 1e18, 6001)  # Pa; grid for sign changes, 200 points per decade; chosen by trial
ROOT_TOLERANCE = 1e-6  # residual relative to the stress; above it a change of sign is a pole and not a root
_NEARLY_REAL = 1e-9  # largest relative imaginary part of an eigenvalue that counts as real; chosen by trial
_BATCH = 64  # number of rigs whose roots are searched together, so that arrays stay in the processor's cache
MAX_BENDS = 8  # most absolute values |e| in coupled equations; each |e| doubles the number of linear systems to solve
# number of bisections: a cell of `GRID` has a relative width of 0.012, and 0.012 / 2**48 is below rounding
_HALVINGS = 48


@dataclass(frozen=True)
class SteadyEquation:
    """Equation of the steady normal stress of one contact.

    It has a closed form if the contact is linear in the stresses.

    ``parts(*arguments)`` returns (load, g0, g1), where load is σss itself if the rig gives it (`given`); `sigma` and
    `slope` are the expressions of σss and g1. Without a closed form only the function `residual` is set.
    """

    affine: bool
    given: bool
    residual: Callable[..., Any]
    parts: Callable[..., Any] | None = None
    sigma: sp.Expr | None = None
    slope: sp.Expr | None = None


@cached
def steady_equation(model: Model, place: int | None = None) -> SteadyEquation:
    """Equation of the steady normal stress of the contact with index `place`, or of a slider's contact.

    Raises
    ------
    NotAvailable
        If the stress depends on another contact's (see `joint_equation`), or if `place` is None for a machine.
    """
    contact = model.contact if place is None else model.contacts[place]
    sigma = contact.sigma_ss
    others = {other.sigma_ss for other in model.contacts} - {sigma}
    if others & contact.steady_stress.free_symbols:
        raise NotAvailable("this contact is pressed by others; all steady normal stresses follow together")
    slope = derivative(contact.steady_coupling, sigma)
    given = contact.steady_load is None
    # if σss is given, the contact law returns that parameter and sigma_ss does not occur
    load = contact.steady_stress if contact.steady_load is None else contact.steady_load
    arguments = list(model.parameters.values())
    affine = sigma not in slope.free_symbols and sigma not in load.free_symbols
    residual = ArrayFunction([*arguments, sigma], [contact.steady_stress - sigma])
    if not affine:
        return SteadyEquation(False, given, residual)
    # other contacts' stresses occur only if steady_normal_stress is given, and cancel then: set them to 0
    offset = contact.steady_coupling.xreplace(dict.fromkeys({sigma, *others}, sp.Integer(0)))
    parts = ArrayFunction(arguments, [load, offset, slope])
    sigma_ss = load if given else (load + offset) / (1 - slope)
    return SteadyEquation(True, given, residual, parts, sigma_ss, slope)


@dataclass(frozen=True)
class Bends:
    """Absolute values |e| in the equations of coupled steady normal stresses, written as s e with the sign s of e.

    Attributes
    ----------
    signs : tuple of sympy.Symbol
        The signs s.
    inner : tuple of sympy.Expr
        The expressions e, linear in the stresses once the signs are given.
    values : callable
        ``values(*arguments, *signs, *stresses, *carried)`` returns all e.
    """

    signs: tuple[sp.Symbol, ...] = ()
    inner: tuple[sp.Expr, ...] = ()
    values: Callable[..., Any] | None = None

    @property
    def patterns(self) -> list[tuple[float, ...]]:
        """All combinations of signs; all positive first."""
        return list(itertools.product((1.0, -1.0), repeat=len(self.signs)))


@dataclass(frozen=True)
class JointEquation:
    """Equations of coupled steady normal stresses: σ = A σ + b, for each combination of the signs of `bends`.

    ``parts(*arguments, *signs)`` returns A row by row, then b; `matrix` and `rest` are the expressions of A and b.
    """

    size: int
    parts: Callable[..., Any]
    matrix: tuple[tuple[sp.Expr, ...], ...]
    rest: tuple[sp.Expr, ...]
    bends: Bends = Bends()

    def arrays(self, arguments: Arguments) -> tuple[Array, Array]:
        """Values of A, (..., n, n), and b, (..., n), at arguments with signs."""
        count = self.size**2
        found = stacked_values(self.parts, arguments)
        return found[..., :count].reshape(*found.shape[:-1], self.size, self.size), found[..., count:]

    def range_arrays(self, arguments: Arguments) -> tuple[Array, Array]:
        """Values of A and b with all signs positive, for tests of overflow."""
        return self.arrays((*arguments, *self.bends.patterns[0]))

    def solve(self, arguments: Arguments) -> tuple[Array, Array]:
        """Solution σ (..., n) in Pa, and largest real eigenvalue of A (−inf if none is real); >= 1 is lock-up.

        With `bends`, the first combination of signs is taken whose solution has these signs, is positive and has
        det(I − A) > 0 (no lock-up); if there is none, the solution for all signs positive.
        """
        patterns = self.bends.patterns
        sigma, gain, holds = self._one_pattern(arguments, patterns[0])
        for signs in patterns[1:]:
            other, other_gain, other_holds = self._one_pattern(arguments, signs)
            takes = other_holds & ~holds
            sigma, gain = np.where(takes[..., None], other, sigma), np.where(takes, other_gain, gain)
            holds = holds | takes
        return sigma, gain

    def _one_pattern(self, arguments: Arguments, signs: tuple[float, ...]) -> tuple[Array, Array, Array]:
        """Solution and largest real eigenvalue for given signs; True where signs are consistent and contacts slide."""
        matrix, right = self.arrays((*arguments, *signs))
        good = np.all(np.isfinite(matrix), axis=(-2, -1)) & np.all(np.isfinite(right), axis=-1)
        matrix = np.where(good[..., None, None], matrix, 0.0)
        gains = np.linalg.eigvals(matrix)
        largest = np.max(np.where(np.abs(gains.imag) <= _NEARLY_REAL * np.abs(gains), gains.real, -np.inf), axis=-1)
        sigma = solve_or_nan(np.eye(self.size) - matrix, np.where(good[..., None], right, np.nan))
        if self.bends.values is None:
            return sigma, largest, good
        sigmas = [sigma[..., i] for i in range(self.size)]
        inner = stacked_values(
            self.bends.values, (*arguments, *signs, *sigmas, *self._carried(arguments, sigmas, signs))
        )
        holds = np.all(inner * np.array(signs) >= 0, axis=-1) & np.all(sigma > 0, axis=-1)
        return sigma, largest, holds & (np.linalg.det(np.eye(self.size) - matrix) > 0)

    def _carried(self, arguments: Arguments, sigmas: Sequence[Any], signs: tuple[float, ...]) -> tuple[Any, ...]:
        return ()


@dataclass(frozen=True)
class CarriedEquation(JointEquation):
    """Equations of coupled steady normal stresses and link forces z: M z = r + F τ + G σ, with linear laws.

    ``parts(*arguments, *signs)`` returns the nonzero entries of nine blocks: M, r, F, G, derivatives of σ by z and by
    σ, of τ by σ, and the constants of σ and τ; `places` has their rows and columns by block.
    """

    places: tuple[tuple[tuple[int, int], ...], ...] = ()
    count: int = 0

    def _blocks(self, arguments: Arguments) -> list[Array]:
        found, start = stacked_values(self.parts, arguments), 0
        many, few = self.count, self.size
        shapes = [(many, many), (many, 1), (many, few), (many, few), (few, many), (few, few), (few, few), (few, 1),
                  (few, 1)]  # fmt: skip
        blocks = []
        for shape, places in zip(shapes, self.places, strict=True):
            block = np.zeros((*found.shape[:-1], *shape))
            for i, (row, column) in enumerate(places, start=start):
                block[..., row, column] = found[..., i]
            start += len(places)
            blocks.append(block)
        return blocks

    def _by_stress(self, blocks: list[Array]) -> tuple[Array, Array]:
        """Matrix Z (..., n, contacts) and column z0 (..., n, 1) with z = Z σ + z0."""
        matrix, rest, by_friction, by_normal, _, _, friction, _, offset = blocks
        right = np.concatenate([by_friction @ friction + by_normal, rest + by_friction @ offset], axis=-1)
        z = solve_all_or_nan(matrix, right)
        return z[..., :-1], z[..., -1:]

    def arrays(self, arguments: Arguments) -> tuple[Array, Array]:
        blocks = self._blocks(arguments)
        by_stress, alone = self._by_stress(blocks)
        by_carried, direct, load = blocks[4], blocks[5], blocks[7]
        return direct + by_carried @ by_stress, (load + by_carried @ alone)[..., 0]

    def carried(self, arguments: Arguments, sigmas: Sequence[Any]) -> tuple[Any, ...]:
        """Link forces and displacements z at given normal stresses (Pa).

        Signs do not matter: balances and friction contain no absolute values |e|.
        """
        return self._carried(arguments, sigmas, self.bends.patterns[0])

    def _carried(self, arguments: Arguments, sigmas: Sequence[Any], signs: tuple[float, ...]) -> tuple[Any, ...]:
        by_stress, alone = self._by_stress(self._blocks((*arguments, *signs)))
        sigma = np.stack(np.broadcast_arrays(*(np.asarray(one, dtype=float) for one in sigmas)), axis=-1)
        found = (by_stress @ sigma[..., None] + alone)[..., 0]
        return tuple(found[..., i][()] for i in range(self.count))


def stacked_values(function: Callable[..., Any], arguments: Arguments) -> Array:
    """Values of an array function stacked along a last axis."""
    with np.errstate(all="ignore"):
        return np.stack(np.broadcast_arrays(*(np.asarray(e, dtype=float) for e in function(*arguments))), axis=-1)


def solve_or_nan(matrix: Array, right: Array) -> Array:
    """Solution of linear equations, (..., n); NaN if singular or not finite."""
    return solve_all_or_nan(matrix, right[..., None])[..., 0]


def solve_all_or_nan(matrix: Array, right: Array) -> Array:
    """Solutions of linear equations for several right sides, (..., n, m), with equilibration; NaN if singular."""
    with np.errstate(all="ignore"):
        rows = np.max(np.abs(matrix), axis=-1, keepdims=True)
        even = matrix / np.where(rows > 0, rows, 1.0)
        columns = np.max(np.abs(even), axis=-2, keepdims=True)
        columns = np.where(columns > 0, columns, 1.0)
        even = even / columns
        bad = ~np.all(np.isfinite(even), axis=(-2, -1)) | ~np.all(np.isfinite(right), axis=(-2, -1))
        even = np.where(bad[..., None, None], np.eye(matrix.shape[-1]), even)
        bad |= np.linalg.det(even) == 0
        even = np.where(bad[..., None, None], np.eye(matrix.shape[-1]), even)
        found = np.linalg.solve(even, right / np.where(rows > 0, rows, 1.0)) / np.swapaxes(columns, -1, -2)
        return np.asarray(np.where(bad[..., None, None], np.nan, found))


@cached
def joint_equation(model: Model) -> JointEquation | None:
    """Equations of coupled steady normal stresses; None if no contact depends on another.

    Raises
    ------
    NotAvailable
        If a contact is not linear in the stresses, apart from amounts |e|.
    """
    sigmas = [contact.sigma_ss for contact in model.contacts]
    unknowns = [*sigmas, *(() if model.carried is None else model.carried.symbols)]
    laws, bends = _straightened(model, unknowns)
    slopes = tuple(tuple(derivative(law, one) for one in sigmas) for law in laws)
    size = len(sigmas)
    if model.carried is None and all(slopes[i][j] == 0 for i in range(size) for j in range(size) if i != j):
        return None
    for contact, row in zip(model.contacts, slopes, strict=True):
        if any(slope.free_symbols & set(unknowns) for slope in row):
            raise _curved(contact.name)
    nothing = dict.fromkeys(sigmas, sp.Integer(0))
    if model.carried is not None:
        return _carried_equation(model, model.carried, nothing, laws, bends)
    rest = tuple(law.xreplace(nothing) for law in laws)
    arguments = [*model.parameters.values(), *bends.signs]
    parts = ArrayFunction(arguments, [*(slope for row in slopes for slope in row), *rest])
    return JointEquation(size, parts, slopes, rest, bends)


def _curved(name: str) -> NotAvailable:
    return NotAvailable(
        f"the steady normal stress of contact '{name}' depends on that of others and is not linear in them; allowed: "
        "any such law at a single contact, and for contacts that press on each other laws that are linear in the forces"
    )


def _straightened(model: Model, unknowns: Sequence[sp.Symbol]) -> tuple[list[sp.Expr], Bends]:
    """Expressions of the steady normal stresses, with s e in place of each |e| that depends on the unknowns, and the
    `Bends`."""
    laws = [contact.steady_stress for contact in model.contacts]
    wanted = set(unknowns)
    found = {atom: None for law in laws for atom in sorted(law.atoms(sp.Abs), key=str) if atom.free_symbols & wanted}
    if len(found) > MAX_BENDS:
        raise NotAvailable(
            f"{len(found)} contacts that are pressed by the amount of a load depend on each other; allowed: at most "
            f"{MAX_BENDS}"
        )
    signs = tuple(sp.Symbol(f"sign_{i}", real=True) for i in range(len(found)))
    inner = tuple(atom.args[0] for atom in found)
    straight = {atom: sign * e for atom, sign, e in zip(found, signs, inner, strict=True)}
    if not straight:
        return laws, Bends()
    values = ArrayFunction([*model.parameters.values(), *signs, *unknowns], inner)
    return [law.xreplace(straight) for law in laws], Bends(signs, inner, values)


def _carried_equation(
    model: Model, carried: Carried, nothing: dict[sp.Symbol, sp.Expr], laws: list[sp.Expr], bends: Bends
) -> CarriedEquation:
    sigmas, symbols = list(nothing), carried.symbols
    none = nothing | dict.fromkeys(symbols, sp.Integer(0))
    frictions = [model.steady[contact.friction] for contact in model.contacts]

    def slopes(expressions: list[sp.Expr], along: Sequence[sp.Symbol]) -> Entries:
        return {(i, j): derivative(e, s) for i, e in enumerate(expressions) for j, s in enumerate(along) if e.has(s)}

    def column(expressions: Iterable[sp.Expr]) -> Entries:
        return {(i, 0): e for i, e in enumerate(expressions) if e != 0}

    groups = [
        carried.matrix, column(carried.rest), carried.friction, carried.normal, slopes(laws, symbols),
        slopes(laws, sigmas), slopes(frictions, sigmas), column(e.xreplace(none) for e in laws),
        column(e.xreplace(none) for e in frictions),
    ]  # fmt: skip
    flat = [e for group in groups for e in group.values()]
    if any(e.free_symbols & none.keys() for e in flat):
        raise NotAvailable("friction and contacts of a machine with many supports must be linear in the stresses")
    parts = ArrayFunction([*model.parameters.values(), *bends.signs], flat)
    places = tuple(tuple(group) for group in groups)
    return CarriedEquation(len(laws), parts, (), (), bends, places, len(symbols))


def carried_forces(model: Model, arguments: Arguments, sigmas: Sequence[Any]) -> tuple[Any, ...]:
    """Values of `Model.carried` in steady sliding; empty if the Model has none."""
    joint = joint_equation(model) if model.carried is not None else None
    return joint.carried(arguments, sigmas) if isinstance(joint, CarriedEquation) else ()


def steady_stresses(model: Model, arguments: Arguments, branch: int) -> tuple[Any, ...]:
    """Steady normal stress σss (Pa) of every contact, each over the varied parameters; NaN without steady sliding."""
    joint = joint_equation(model)
    if joint is None:
        return tuple(steady_stress(model, arguments, branch, place) for place in range(len(model.contacts)))
    sigma, gain = joint.solve(arguments)
    good = (gain < 1) & np.all(sigma > 0, axis=-1)
    return tuple(np.where(good, sigma[..., i], np.nan)[()] for i in range(joint.size))


def steady_stress(model: Model, arguments: Arguments, branch: int, place: int) -> Any:
    """Steady normal stress σss (Pa) of the contact with index `place` over the varied parameters.

    NaN without steady sliding.

    Of several solutions, the solution with index `branch` by rising stress is returned.
    """
    equation = steady_equation(model, place)
    if equation.parts is None:
        return _by_search(equation, arguments, branch)
    load, offset, slope = equation.parts(*arguments)
    sigma = load if equation.given else (load + offset) / (1 - slope)
    return np.where((slope < 1) & (np.asarray(sigma) > 0), sigma, np.nan)[()]


def out_of_range(model: Model, arguments: Arguments, shape: tuple[int, ...]) -> Any:
    """Boolean array of `shape`, True where the equations of σss overflow.

    It is unknown there whether steady sliding exists.
    """
    found = np.zeros(shape, dtype=bool)
    joint = joint_equation(model)
    if joint is not None:
        matrix, right = joint.range_arrays(arguments)
        return found | ~(np.all(np.isfinite(matrix), axis=(-2, -1)) & np.all(np.isfinite(right), axis=-1))
    for equation in (steady_equation(model, place) for place in range(len(model.contacts))):
        if equation.parts is not None:
            found |= ~np.isfinite(sum(np.broadcast_to(part, shape) for part in equation.parts(*arguments)))
    return found


def steady_roots(model: Model, arguments: Arguments) -> list[float]:
    """All positive σss (Pa) of a single slider, rising."""
    equation = steady_equation(model)
    if equation.affine:
        sigma = float(steady_stress(model, arguments, 0, model.contacts.index(model.contact)))
        return [sigma] if sigma > 0 else []
    return _search(equation.residual, [np.atleast_1d(np.asarray(one, dtype=float)) for one in arguments])[0]


def _by_search(equation: SteadyEquation, arguments: Arguments, branch: int) -> Any:
    arrays = np.broadcast_arrays(*(np.asarray(one, dtype=float) for one in arguments))
    flat = [one.reshape(-1) for one in arrays]
    result = np.full(flat[0].shape, np.nan)
    for start in range(0, len(result), _BATCH):
        found = _search(equation.residual, [one[start : start + _BATCH] for one in flat])
        for i, roots in enumerate(found, start=start):
            result[i] = roots[branch] if len(roots) > branch else np.nan
    return result.reshape(arrays[0].shape)[()]


def _search(residual: Callable[..., Any], arguments: list[Array]) -> list[list[float]]:
    """Roots of the residual (Pa) of each rig over thirty decades of stress, in rising order.

    Brackets are sign changes on `GRID`; all are bisected at once to rounding.
    """
    with np.errstate(all="ignore"):
        shape = (len(arguments[0]), len(GRID))
        value = np.broadcast_to(residual(*(one[:, None] for one in arguments), GRID)[0], shape)
        good = np.isfinite(value)
        rows, cells = np.nonzero(good[:, :-1] & good[:, 1:] & (np.sign(value[:, :-1]) * np.sign(value[:, 1:]) < 0))
        low, high, rises = GRID[cells], GRID[cells + 1], value[rows, cells] < 0
        own = [one[rows] for one in arguments]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            before = (np.asarray(residual(*own, middle)[0]) < 0) == rises
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        ends = np.stack([low, high])
        apart = np.abs(np.stack([np.broadcast_to(residual(*own, end)[0], low.shape) for end in ends]))
        nearer = (apart[1] < apart[0]).astype(int)
        roots, apart = (np.take_along_axis(one, nearer[None], axis=0)[0] for one in (ends, apart))
    found: list[list[float]] = [[float(one) for one in GRID[good[i] & (value[i] == 0)]] for i in range(shape[0])]
    for i in np.flatnonzero(apart <= ROOT_TOLERANCE * roots):
        found[rows[i]].append(float(roots[i]))
    return [sorted(one) for one in found]
