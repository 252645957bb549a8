"""Eigenvalues and stability of machines whose equations are matrices, one by one for arrays of parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.linear.roots import ComplexArray
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.machine_point import MachinePoint, machine_point
from steadyslip.model.point import Vary, checked_arrays

STABLE_WORD, UNSTABLE_WORD, ABSENT_WORD = "stable", "unstable", "no steady sliding"


def require_matrices(machine: Machine) -> MachinePoint:
    """Numeric operating point of a machine, checked to be within the range of floating point.

    Raises
    ------
    NotAvailable
        If numbers of the machine overflow, or steady sliding was not found.
    """
    point = machine_point(machine)
    with np.errstate(all="ignore"):
        if point.balance.problem:
            raise NotAvailable(point.balance.problem)
        if point.balance.exists and not (np.all(np.isfinite(point.pencil.a)) and np.all(np.isfinite(point.pencil.e))):
            raise NotAvailable(
                "the slopes of the equations leave the range of floating point (1e-308 to 1e308); check the sizes of "
                "the machine's parameters"
            )
    return point


def over(machine: Machine, vary: Vary | None, one: Callable[[MachinePoint], Any]) -> tuple[list[Any], Any]:
    """Results of the function `one` for every machine of an array, as a flat list, and the checked arrays."""
    arrays = checked_arrays(machine, vary or {})
    flat = arrays.flat()
    found = []
    for i in range(max(int(np.prod(arrays.shape)), 1)):
        own = {name: float(v[i]) if np.ndim(v) else float(v) for name, v in flat.items()}
        point = require_matrices(machine.with_values(own) if own else machine)
        with np.errstate(all="ignore"):
            found.append(one(point))
    return found, arrays


def eigenvalues(machine: Machine, vary: Vary | None) -> Any:
    """Eigenvalues (1/s), (..., n), by falling real part; padded with NaN, and all NaN without steady sliding."""

    def one(point: MachinePoint) -> ComplexArray:
        return point.pencil.eigenvalues if point.balance.exists else np.full(len(point.matrices.names), np.nan + 0j)

    found, arrays = over(machine, vary, one)
    width = max(len(row) for row in found)
    table = np.full((len(found), width), np.nan + 0j)
    for row, own in zip(table, found, strict=True):
        row[: len(own)] = own
    return arrays.wrap(table.reshape(*arrays.shape, width), "eigenvalues", "1/s", ("mode",))


def growth_rate(machine: Machine, vary: Vary | None) -> Any:
    """Largest real part of the eigenvalues (1/s), (...); inf where ill-posed, NaN without steady sliding."""

    def one(point: MachinePoint) -> float:
        if not point.balance.exists:
            return np.nan
        return float(point.pencil.eigenvalues[0].real) if point.pencil.posed else np.inf

    found, arrays = over(machine, vary, one)
    return arrays.wrap(np.array(found, dtype=float).reshape(arrays.shape), "growth_rate", "1/s")


def stability(machine: Machine, vary: Vary | None) -> Any:
    """Stability as text for each machine, (...); see `stability_word`."""
    found, arrays = over(machine, vary, stability_word)
    words = np.array(found)
    return arrays.wrap(words.reshape(arrays.shape), "stability", "1") if arrays.shape else str(words[0])


def stability_word(point: MachinePoint) -> str:
    """Stability of one machine: stable, unstable, or no steady sliding."""
    if not point.balance.exists:
        return ABSENT_WORD
    return STABLE_WORD if point.pencil.posed and np.all(point.pencil.eigenvalues.real < 0) else UNSTABLE_WORD
