"""Build the Model of a rig: numbers become symbols, the mechanism is assembled; rigs of one structure share a Model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.options import checked
from steadyslip.core.records import Address, parameters, shape_of, with_values
from steadyslip.core.symbols import Letters
from steadyslip.machine.letters import MEMBERS
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT, Mechanism
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.machine.structure_elements import with_elements
from steadyslip.model.assembly import assemble
from steadyslip.model.equations import MOVED, Model
from steadyslip.model.numeric import refuse_response
from steadyslip.model.numeric.machine_matrices import NO_PULL

HELD = (
    "the drive holds a place (velocity = 0), so there is no steady sliding to be stable or not: linear stability does "
    "not speak of hunting, and a loaded bristle at rest has no linearisation; ask `steadyslip hunt`, "
    "or ss.hunt(rig) in Python"
)
RESERVED = ("x", "v", "a_x", "I_x", "T", "tau", "sigma", "sigma_ss", "v_lp", "q", "p", "t", "mu_ss", "k_cr")
"""Letters that the equations use, which parameters cannot have."""


@checked()
def build_model(rig: Slider | Machine, present: Iterable[str] = ()) -> Model:
    """Build the Model of a rig.

    Parameters
    ----------
    rig : Slider or Machine
        Rig; only its structure matters, not its numbers (rigs of one structure share a Model).
    present : iterable of str
        Dotted names of parameters that are kept as symbols although they are zero, such as ``slider.mass`` if it is
        about to be varied.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> print(ss.build_model(rig))
    Model, quasistatic; algebraic unknown v
    variables
      x          m        slip of the block ahead of the load point
      Psi        1        b Θ with the part of the stresses, continuous where they jump
    parameters
      a              1        friction.a
      b              1        friction.b
      d_c            m        friction.d_c
      mu_ref         1        friction.mu_ref
      v_ref          m/s      friction.v_ref
      alpha          1        friction.normal_memory.alpha
      sigma_ref      Pa       friction.normal_memory.sigma_ref
      sigma_0        Pa       contact.preload
      psi            rad      contact.angle
      k              Pa/m     slider.stiffness
      v_0            m/s      drive.velocity
    equations
      T = -k*x + sigma_ss*(mu_ref + (a - b)*log(v_0/v_ref))
      tau = T + q
      sigma = -T*tan(psi) + p + sigma_0
      sigma*(Psi + a*log(v/v_ref) - alpha*log(sigma/sigma_ref) + mu_ref) - tau = 0
      dx/dt = v - v_lp
      dPsi/dt = -v*(Psi - alpha*log(sigma/sigma_ref) + b*log(v/v_ref))/d_c
    """
    return model_of(rig, present)


def model_of(rig: Rig, present: Iterable[str] = (), drive: str = MOVED) -> Model:
    """Build the Model without checks; `drive` is `MOVED`, `PULLED` or `EITHER`."""
    if rig.holds:
        raise NotAvailable(HELD)
    refuse_response(rig)
    kept = frozenset(present)
    key = (shape_of(rig), kept, drive, *((name, rig.value(name)) for name in in_matrices(rig)))
    return _build_cached(_Structure(key, rig, kept, drive), 0)


class _Structure:
    """Cache key of a rig; keys of rigs with the same structure are equal."""

    def __init__(self, key: Any, rig: Rig, present: frozenset[str], drive: str) -> None:
        self.key, self.rig, self.present, self.drive = key, rig, present, drive

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self.key == other.key


@lru_cache(maxsize=128)
def _build_cached(structure: _Structure, order: int) -> Model:
    """The Model of a rig structure. For `order` > 0 it is for motion, and that many variables replace each delay."""
    rig = structure.rig
    symbols, known = _parameter_symbols(rig, structure.present)
    given = {name: symbol for name, symbol in symbols.items() if symbol.is_Symbol}
    for name in rig.replaces:
        given.pop(name, None)
    roles = {name: address.role for name, address in rig.parameters().items()}
    own = with_values(rig, symbols).mechanism()
    mechanism = with_elements(own)
    laws = [law for one in rig.laws_by_contact().values() for law in (one.friction, one.contact)]
    several = {name for name, many in Counter(name for law in laws for name in law.memory()).items() if many > 1}
    taken = {*RESERVED, *known.values(), *several, *(("a",) if rig.contact_names else ())}  # a: an acceleration
    model = assemble(mechanism, given, roles, Letters(taken, known), structure.drive, order)
    _check_pulls(model, own)
    return replace(model, for_motion=partial(_build_cached, structure)) if model.late else model


def _check_pulls(model: Model, mechanism: Mechanism) -> None:
    """Raise NotAvailable if the normal stress at a contact of a structure depends on the pull of a spring."""
    inner = {name for part in mechanism.structures for name in part.coordinates}
    for contact, port in zip(model.contacts, mechanism.contacts, strict=True):
        body = next(name for name in port.slip if name != LOAD_POINT)
        if body in inner and model.definitions[contact.normal].has(contact.spring):
            raise NotAvailable(NO_PULL.format(name=port.name))


def _parameter_symbols(rig: Rig, present: frozenset[str]) -> tuple[dict[str, Any], dict[sp.Symbol, str]]:
    """Symbols of the rig's parameters by dotted name, and their display letters.

    A parameter that is 0, and whose term is then left out of the equations, is the number 0.
    """
    symbols: dict[str, Any] = {}
    every, numbers = parameters(rig), in_matrices(rig)
    declared = Counter(address.role.letter for address in every.values())
    shared = Counter(_plain_letter(name, one) for name, one in every.items() if one.value is not None)
    letters = Letters({*RESERVED, *declared, *(letter for letter, many in shared.items() if many > 1)})
    for place, (name, address) in enumerate(every.items()):
        called = f"parameter_{place:03d}"
        if name in rig.always_symbols:
            symbols[name] = letters.symbol(called, name, rig.always_symbols[name], nonnegative=True)
        elif name in (*rig.not_in_model, *numbers) or address.value is None:
            continue
        elif address.role.structural and address.value == 0 and name not in present:
            symbols[name] = sp.Integer(0)
        else:
            letter = address.role.letter
            letter = letter if declared[letter] == 1 and letter not in RESERVED else ""
            low, reached = address.role.domain.low == 0, address.role.domain.low_allowed
            signs = {"positive": True if low and not reached else None, "nonnegative": True if low else None}
            symbols[name] = letters.symbol(called, _owned(name, address), letter, real=True, **signs)
    return symbols, letters.known


def in_matrices(rig: Rig) -> tuple[str, ...]:
    """Names of structure parameters that the Model contains as numbers, not as symbols: point angles, spin, modal
    damping."""
    found = []
    for body, one in rig.bodies.items():
        if one.is_structure:
            inside = (f"bodies.{body}.points.{point}.angle" for point in one.points)
            own = (f"bodies.{body}.{name}" for name in ("spin", "modal_damping") if getattr(one, name) is not None)
            found += [*own, *inside]
    return tuple(found)


def _plain_letter(name: str, address: Address) -> str:
    """Declared letter of a parameter, or the last part of its dotted name."""
    return address.role.letter or name.rpartition(".")[2]


def _owned(name: str, address: Address) -> str:
    """Letter of a parameter, preceded by the names that make it unique in a machine: `bodies.pad.m`."""
    before = name.split(".")[:-1]
    if before[0] in MEMBERS:
        before = [*before[:2], *(one for one in before[2:] if one.isdigit())]
    return ".".join([*before, _plain_letter(name, address)])
