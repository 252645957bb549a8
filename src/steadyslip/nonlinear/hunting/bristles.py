"""Contacts with memory (bristles) as a compiled routine, and the steps of Rodas5P that call it.

The routine computes friction forces, rates of the memories and the derivatives of both, from slip rates and memories.
It is compiled once for each combination of laws; their parameters are constants in its tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.core.records import parameters, shape_of, with_values
from steadyslip.core.symbols import inner_symbol
from steadyslip.kernels.build import Code, code_of, interpreting
from steadyslip.kernels.layout import Held, Routines, make_layout
from steadyslip.kernels.methods import rodas5p
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.source import Constants, Formulas
from steadyslip.laws.friction import FrictionLaw
from steadyslip.nonlinear.hunting.held_modes import HeldPiece
from steadyslip.nonlinear.hunting.plant import Array, HeldContact, Plant

SHORTEST = 1e-15  # shortest step, s; far below the period of any bristle
RATES, ALLOWED, FIXED = 0, 1, 2  # last argument of `steadyslip.kernels.driver.bristles.bristle_step`


class Bristles:
    """Equations Y' = A Y + H f(G Y) of a plant as arrays for the compiled core; f: friction forces and memory rates.

    Parameters
    ----------
    plant : Plant
    rtol : float
        Error allowed per step, relative to the largest size of each variable so far.
    scale : ndarray (width,)
        Smallest size of each variable for error control.

    Attributes
    ----------
    arrays : tuple of ndarray
        Constants of the routine, and coefficients of Rodas5P.
    clock : ndarray
        See `steadyslip.kernels.layout.Held`.
    code : Code
    """

    def __init__(self, plant: Plant, rtol: float, scale: Array) -> None:
        contacts = [one for one in plant.contacts if one.curved]
        self.scale, self.clock, self._contacts = scale.copy(), np.zeros(Held.SIZE), contacts
        self._out_of = _outputs(plant, contacts)
        self._maps: dict[HeldPiece, tuple[Array, Array]] = {}
        self.clock[[Held.RTOL, Held.SHORTEST, Held.LENGTH]] = rtol, SHORTEST, np.nan
        if contacts:
            laws = tuple(one.port.friction if one.slow else None for one in contacts)
            loaded = tuple(bool(one.loads) for one in contacts)
            shapes = tuple(None if law is None else shape_of(law) for law in laws)
            routine = _routine(_Kinds(shapes, loaded, laws))
            self.code, self.arrays = routine.code, (routine.constants(contacts), _tableau())
        else:
            layout = make_layout(lanes=1, size=0, kept=0, constants=0, inputs=0)
            self.code = Code(layout, Routines(*[0] * len(Routines._fields)), interpreting())  # type: ignore[arg-type]
            self.arrays = np.zeros(1), np.zeros((1, 1))

    def maps(self, piece: HeldPiece) -> tuple[Array, Array]:
        """Matrices G (inputs, width) and H (width, outputs) in a mode; G has no rows where the motion is linear."""
        if piece not in self._maps:
            self._maps[piece] = _inputs(piece, [] if piece.linear else self._contacts), self._out_of
        return self._maps[piece]


class BristleSteps(Bristles):
    """Steps of Rodas5P for contacts with nonlinear friction; the last step length is the first of the next piece."""

    def begin(self, piece: HeldPiece, state: Array) -> None:
        """Set the length of the first step, unless a step has been taken."""
        if np.isnan(self.clock[Held.LENGTH]):
            fastest = self.fastest(piece, state)  # 0 where no force presses a contact yet
            self.clock[Held.LENGTH] = 1.0 / fastest if fastest else np.inf

    def step(self, piece: HeldPiece, state: Array, most: float) -> tuple[float, Array]:
        """Length (s) of a step within the error tolerance, at most `most`, and its dense output (5, width)."""
        self.begin(piece, state)
        self.clock[Held.STOP] = most
        found, _, _ = self._called(piece, state, ALLOWED)
        return float(self.clock[Held.STOP]), found

    def noise(self, piece: HeldPiece, rows: Array, coefficients: Array, length: float) -> Array:
        """Errors (rows, 3) of the first three polynomial coefficients of guards; only that of the value is not 0."""
        found = np.zeros((len(rows), 3))
        found[:, 0] = 1e-9 * np.abs(rows) @ np.abs(coefficients[0])
        return found

    def until(self, piece: HeldPiece, state: Array, coefficients: Array, length: float, share: float) -> Array:
        """State (width,) at a share of a step, by a new step of that length: dense output would be less accurate."""
        if share == 0:
            return state
        self.clock[Held.STOP] = share * length
        return np.asarray(self._called(piece, state, FIXED)[0].sum(axis=0))

    def rate(self, piece: HeldPiece, state: Array) -> Array:
        """Time derivative (width,) of the state."""
        return self._called(piece, state, RATES)[1]

    def fastest(self, piece: HeldPiece, state: Array) -> float:
        """Largest absolute eigenvalue (1/s) of the Jacobian at a state."""
        return float(np.max(np.abs(np.linalg.eigvals(self._called(piece, state, RATES)[2]))))

    def _called(self, piece: HeldPiece, state: Array, way: int) -> tuple[Array, Array, Array]:
        """Dense output (5, width) of one step, rates (width,) at its start, and the Jacobian there.

        `way` says which of them are computed: one of `RATES`, `ALLOWED` and `FIXED`.
        """
        width = len(state)
        found, rates, jacobian = np.zeros((5, width)), np.zeros(width), np.zeros((width, width))
        if self.code.bristle_step(
            *self.arrays, piece.matrix, *self.maps(piece), self.scale, state, self.clock, found, rates, jacobian, way
        ):
            raise NotAvailable(TOO_SHORT)
        return found, rates, jacobian


TOO_SHORT = "the motion of the bristles cannot be followed: steps become too short"


def _inputs(piece: HeldPiece, contacts: Sequence[HeldContact]) -> Array:
    """Matrix G (inputs, width), which gives the inputs of the routine from the state Y.

    The inputs of a contact are its slip rate, then its memory (and, with a load, its normal stress), or else its drag.
    """
    plant, found = piece.plant, []
    place = 2 * plant.size + 4
    for one in contacts:
        index = plant.contacts.index(one)
        found.append(plant.slip(one))
        if not one.slow:
            found.append(piece.drag(index))
            continue
        if one.loads:
            found.append(piece.normal(index))
        for _ in one.port.friction.memory():
            found.append(np.eye(plant.width)[place])
            place += 1
    return np.array(found) if found else np.zeros((0, plant.width))


def _outputs(plant: Plant, contacts: Sequence[HeldContact]) -> Array:
    """Matrix H (width, outputs), which gives rates of the state from friction forces and memory rates."""
    found, n, place, k = np.zeros((plant.width, plant.memory + len(contacts))), plant.size, 2 * plant.size + 4, 0
    for one in contacts:
        found[n : 2 * n, k] = -one.row / plant.inertia
        for _ in one.port.friction.memory() if one.slow else ():
            k += 1
            found[place, k] = 1.0
            place += 1
        k += 1
    return found


@lru_cache(maxsize=1)
def _tableau() -> Array:
    """Coefficients of Rodas5P as the table that `steadyslip.kernels.driver.bristles` expects (cached)."""
    method = rodas5p()
    rows = [*method.arguments(), *method.c, method.error, *method.dense, (method.gamma,)]
    return np.array([(*row, *(0.0,) * (method.stages - len(row))) for row in rows])


# -- the routine


@dataclass(frozen=True)
class _Kinds:
    """Cache key of a compiled routine; it is equal for laws of equal kinds, whatever their parameters."""

    shapes: tuple[Any, ...]
    loaded: tuple[bool, ...]
    laws: tuple[FrictionLaw | None, ...] = field(compare=False)


@lru_cache(maxsize=64)
def _routine(kinds: _Kinds) -> _Routine:
    return _Routine(kinds.laws, kinds.loaded)


class _Routine:
    """Compiled routine of friction laws; for contacts with a load (`loaded`) normal stress is a variable.

    None in place of a law is the viscous friction of a load: slip rate times drag.
    """

    def __init__(self, laws: Sequence[FrictionLaw | None], loaded: Sequence[bool]) -> None:
        arguments: list[sp.Symbol] = []
        groups: list[list[sp.Symbol]] = []
        values: list[list[sp.Expr]] = []
        for index, (law, has_load) in enumerate(zip(laws, loaded, strict=True)):
            if law is None:
                v, drag = (inner_symbol(f"drag{index}.{k}", real=True) for k in range(2))
                groups.append([v, drag])
                values.append([v * drag])
                continue
            names = _own_names(law)
            area, sigma, *values_of_law = own = [
                inner_symbol(f"law{index}.{name}", real=True) for name in ("area", "sigma", *names)
            ]
            arguments += own
            symbolic = with_values(law, dict(zip(names, values_of_law, strict=True)))
            v, *memory = (inner_symbol(f"bristle{index}.{k}", real=True) for k in range(1 + len(law.memory())))
            group = [v, *memory]
            if has_load:
                sigma = inner_symbol(f"load{index}", real=True)
                group.insert(1, sigma)
            strength = area * symbolic.strength(v, sigma, tuple(memory), sp.nan)
            groups.append(group)
            values.append([strength, *map(sp.sympify, symbolic.rates(v, sigma, tuple(memory), sp.nan))])
        variables = [one for group in groups for one in group]
        slopes = [derivative(value, by) if by in group else sp.Integer(0)
                  for group, own in zip(groups, values, strict=True) for value in own for by in variables]  # fmt: skip
        constants = Constants(variables)
        written = [constants.with_constants(one) for one in (*(one for own in values for one in own), *slopes)]
        self._function = constants.function(arguments)
        program = Program("bristles")
        loads: dict[str, Any] = {one.name: program.load(k, "y") for k, one in enumerate(variables)}
        loads |= {one.name: program.load(k) for k, one in enumerate(constants.all)}
        for k, value in enumerate(Formulas(written, {})(loads)):
            program.store(len(variables) + k, value, "y")
        layout = make_layout(lanes=1, size=0, kept=0, constants=len(constants.all), inputs=0)
        self.code = code_of([program], layout, interpreting())

    def constants(self, contacts: Sequence[HeldContact]) -> Array:
        """Constants of the routine for contacts with the routine's laws."""
        values: list[Any] = []
        for one in contacts:
            if not one.slow:
                continue
            found = parameters(one.port.friction)
            values += [one.port.area, one.normal, *(found[name].value for name in _own_names(one.port.friction))]
        return np.array([float(value) for value in self._function(*values)] or [0.0])


def _own_names(law: FrictionLaw) -> list[str]:
    """Names of the parameters of a law that have a value."""
    return [name for name, one in parameters(law).items() if one.value is not None]
