"""From a rig to its Model: symbols in place of the numbers, and the parts joined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import sympy as sp

from steadyslip.core.options import checked
from steadyslip.core.records import Address, parameters, shape_of, with_values
from steadyslip.core.symbols import Letters
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.assembly import assemble
from steadyslip.model.equations import MOVED, Model

RESERVED = ("x", "v", "a_x", "I_x", "T", "tau", "sigma", "sigma_ss", "v_lp", "q", "p", "t", "mu_ss", "k_cr")
"""Letters of the equations' own."""
_LETTERS = {
    "slider.stiffness": "k",
    "slider.mass": "m",
    "slider.damping": "c",
    "slider.radiation_damping": "eta",
    "drive.velocity": "v_0",
}


@checked()
def build_model(rig: Slider | Machine, present: Iterable[str] = ()) -> Model:
    """The model of a rig.

    Parameters
    ----------
    rig : Slider or Machine
        The rig; its numbers do not matter, only its structure (models are shared between rigs).
    present : iterable of str
        Dotted names of parameters kept as symbols although they are zero, such as ``slider.mass`` when it
        is about to be varied.
    """
    return model_of(rig, present)


def model_of(rig: Rig, present: Iterable[str] = (), drive: str = MOVED) -> Model:
    """`build_model` without its checks, of a drive that moves, that pulls with a force of its own, or both by turns."""
    kept = frozenset(present)
    key = (shape_of(rig), kept, drive)
    return _build_cached(_Structure(key, rig, kept, drive))


class _Structure:
    """A rig that compares equal to every other of the same structure."""

    def __init__(self, key: Any, rig: Rig, present: frozenset[str], drive: str) -> None:
        self.key, self.rig, self.present, self.drive = key, rig, present, drive

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.key == other.key


@lru_cache(maxsize=128)
def _build_cached(structure: _Structure) -> Model:
    rig = structure.rig
    symbols, known = _parameter_symbols(rig, structure.present)
    given = {name: symbol for name, symbol in symbols.items() if symbol.is_Symbol}
    for name in rig.replaces:
        given.pop(name, None)
    roles = {name: address.role for name, address in rig.parameters().items()}
    mechanism = with_values(rig, symbols).mechanism()
    return assemble(mechanism, given, roles, Letters({*RESERVED, *known.values()}, known), structure.drive)


def _parameter_symbols(rig: Rig, present: frozenset[str]) -> tuple[dict[str, Any], dict[sp.Symbol, str]]:
    """A symbol for every given parameter, and its letter; structural zeros stay zero, gauges stay symbols."""
    symbols: dict[str, Any] = {}
    every = parameters(rig)
    declared = Counter(address.role.letter for address in every.values())
    letters = Letters({*RESERVED, *_LETTERS.values(), *declared})
    for place, (name, address) in enumerate(every.items()):
        called, letter = f"parameter_{place:03d}", _LETTERS.get(name) or _declared_letter(address, declared)
        before = name.rpartition(".")[0]
        dotted = f"{before}.{address.role.letter}" if address.role.letter else name
        if name in rig.always_symbols:
            symbols[name] = letters.symbol(called, dotted, rig.always_symbols[name], nonnegative=True)
        elif name in rig.not_in_model or address.value is None:
            continue
        elif address.role.structural and address.value == 0 and name not in present:
            symbols[name] = sp.Integer(0)
        else:
            low, reached = address.role.domain.low == 0, address.role.domain.low_allowed
            signs = {"positive": True if low and not reached else None, "nonnegative": True if low else None}
            symbols[name] = letters.symbol(called, dotted, letter, real=True, **signs)
    return symbols, letters.known


def _declared_letter(address: Address, declared: Mapping[str, int]) -> str:
    """The letter that is declared for a parameter, unless others have the same or it is one of the equations' own."""
    letter = address.role.letter
    return letter if declared[letter] == 1 and letter not in (*RESERVED, *_LETTERS.values()) else ""
