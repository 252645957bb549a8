"""Units of protocol quantities, which depend on the rig: stresses, forces or torques; displacements or angles."""

from __future__ import annotations

from difflib import get_close_matches

from steadyslip.core.areas import total_unit
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import parameters, replaced
from steadyslip.core.roles import InUnit
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol
from steadyslip.protocol.protocol import DISTURBANCE, LOAD_POINT, Piece

TURNING = {"m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2"}
"""Units of the motion of a load point that rotates, by the unit of one that slides."""


def turns(machine: Machine, piece: Piece) -> bool:
    """True if the body or load point that a piece acts on rotates."""
    if piece.channel == LOAD_POINT or piece.frees_load_point:
        return machine.drive.turns
    return piece.channel == DISTURBANCE and turns_on(machine, getattr(piece, "on", None))


def turns_on(machine: Machine, body: str | None) -> bool:
    """True if the named body rotates; None names the only body of a machine that has one."""
    name = body or (next(iter(machine.bodies)) if len(machine.bodies) == 1 else "")
    # a misspelt name is reported later, by motion/targets.py
    meant = [name] if name in machine.bodies else get_close_matches(name, machine.bodies, 1)
    return any(machine.bodies[one].turns for one in meant)


def unit_of(rig: Slider | Machine, piece: Piece, unit: str) -> str:
    """SI unit of a quantity of a piece on this rig; `unit` is the declared one, which sliders use."""
    if not isinstance(rig, Machine):
        return unit
    if unit in TURNING:
        return TURNING[unit] if turns(rig, piece) else unit
    if unit != "Pa":
        return unit
    return "N m" if turns(rig, piece) else "N"


def in_units_of(rig: Slider | Machine, plan: Protocol) -> Protocol:
    """Copy of a protocol whose numbers with rig-dependent units are checked and converted for this rig.

    Raises
    ------
    ParameterError
        If a unit does not fit the body or contact that the piece acts on.
    """
    problems, changes = [], {}
    for name, address in parameters(plan, "protocol.").items():
        if not isinstance(address.value, InUnit):
            continue
        _, _, number, _ = name.split(".", 3)
        piece, given = plan.pieces[int(number) - 1], address.value
        wanted = unit_of(rig, piece, address.role.unit)
        if given.unit == wanted:
            changes[name] = float(given)
        elif rig.area is not None and given.unit == total_unit(wanted):
            changes[name] = float(given) / rig.area
        else:
            hint = "; of a slider with an area a force will do" if (given.unit, wanted) == ("N", "Pa") else ""
            problems.append(
                Problem(name, f"got {float(given):g} {given.unit}; allowed here: a number in {wanted}{hint}")
            )
    if problems:
        raise ParameterError(problems)
    return replaced(plan, changes, "protocol.") if changes else plan
