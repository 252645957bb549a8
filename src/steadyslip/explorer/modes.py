"""Programs and data for the modes of a machine on a page: characteristic matrix, speeds, energies."""

from __future__ import annotations

from typing import Any

import sympy as sp

from steadyslip.core.records import with_values
from steadyslip.explorer.programs import program
from steadyslip.kernels.nodes import Program
from steadyslip.linear.modes import HARDLY, MANY, MOVES, NAMED, WORDS, stores
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import NORMAL
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_rows


def mode_part(machine: Machine, model: Model) -> tuple[list[Program], dict[str, Any]]:
    """Programs and facts of the modes of a machine.

    Returns
    -------
    programs : list of Program
        ``matrix``: non-zero coefficients of the characteristic matrix. ``measures``: speeds of the drive and of every
        coordinate, then for each energy store its weight and its factor for each coordinate.
    facts : dict
        ``coordinates`` (names), ``matrix`` (size, then row, column and power of s of each coefficient), ``stores``
        (name, True if kinetic, indices of the coordinates), ``shape`` (sentences and their limits).
    """
    entries = [
        (i, j, powers[0], value)
        for i, row in enumerate(characteristic_rows(model).values())
        for j, entry in enumerate(row)
        for powers, value in entry.items()
    ]
    names = [one.name for one in model.coordinates]
    held = stores(with_values(machine, dict(model.parameters)).mechanism())
    weights = [sp.sympify(value) for one in held for value in (one.weight, *one.row.values())]
    speeds = [model.parameters["drive.velocity"], *(one.speed for one in model.coordinates)]
    programs = [
        program(model, "matrix", [value for *_, value in entries]),
        program(model, "measures", [*speeds, *weights]),
    ]
    facts = {
        "coordinates": names,
        "matrix": [len(characteristic_rows(model)), [[i, j, power] for i, j, power, _ in entries]],
        "stores": [[one.name, one.kinetic, [names.index(name) for name in one.row]] for one in held],
        "shape": {"moves": MOVES, "hardly": HARDLY, "many": MANY, "named": NAMED, "suffix": NORMAL, "words": WORDS},
    }
    return programs, facts
