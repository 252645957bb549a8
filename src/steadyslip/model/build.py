"""From a rig to its Model: symbols in place of the numbers, and the parts joined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import sympy as sp

from steadyslip.core.options import checked
from steadyslip.core.records import Address, parameters, shape_of, twin
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.assembly import RESERVED, assemble
from steadyslip.model.equations import MOVED, Model

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
    symbols = _parameter_symbols(rig, structure.present)
    given = {name: symbol for name, symbol in symbols.items() if isinstance(symbol, sp.Symbol)}
    for name in rig.instead:
        given.pop(name, None)
    roles = {name: address.role for name, address in rig.parameters().items()}
    taken = set(RESERVED) | {str(symbol) for symbol in given.values()}
    mechanism = twin(rig, symbols).mechanism()
    return assemble(mechanism, given, roles, lambda name: _unused_letter(name, taken), structure.drive)


def _parameter_symbols(rig: Rig, present: frozenset[str]) -> dict[str, Any]:
    """A symbol for every given parameter; structural zeros stay zero, gauges stay symbols."""
    symbols: dict[str, Any] = {}
    letters = Counter(a.role.letter for a in parameters(rig).values())
    taken = set(RESERVED) | set(_LETTERS.values()) | set(letters)
    for name, address in parameters(rig).items():
        if name in rig.aside or address.value is None:
            continue
        if name in rig.assumed:
            symbols[name] = sp.Symbol(rig.assumed[name], nonnegative=True)
            continue
        if address.role.structural and address.value == 0 and name not in present:
            symbols[name] = sp.Integer(0)
            continue
        domain = address.role.domain
        symbols[name] = sp.Symbol(
            _LETTERS.get(name) or _own_letter(address, letters, taken),
            real=True,
            positive=True if domain.low == 0 and not domain.low_allowed else None,
            nonnegative=True if domain.low == 0 else None,
        )
    for name in rig.assumed.keys() - symbols.keys():
        symbols[name] = sp.Symbol(rig.assumed[name], nonnegative=True)
    return symbols


def _own_letter(address: Address, letters: Mapping[str, int], taken: set[str]) -> str:
    """The letter that is declared for a parameter, with its name behind it where others have the same."""
    letter = address.role.letter
    if letter and letters[letter] == 1:
        return letter
    before = address.name.rpartition(".")[0]
    return _unused_letter(f"{before}.{letter}" if letter else address.name, taken)


def _unused_letter(name: str, taken: set[str]) -> str:
    """The last part of a dotted name, with as many earlier parts behind it as make it unique, or else a number.

    A body and a contact may have the same name, and ``a-b`` and ``a_b`` are two.
    """
    *before, letter = name.replace("-", "_").split(".")
    if before[-1].isdigit():
        letter = f"{letter}_{before.pop()}"
    while letter in taken and before:
        letter = f"{letter}_{before.pop()}"
    free = (letter, *(f"{letter}_{number}" for number in range(2, len(taken) + 3)))
    letter = next(one for one in free if one not in taken)
    taken.add(letter)
    return letter
