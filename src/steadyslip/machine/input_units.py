"""What is done to a rig, in its own units: stresses, forces or torques; ways or angles."""

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
"""Units of the ways of a load point that turns."""


def turns(machine: Machine, piece: Piece) -> bool:
    """Whether what a piece moves or pushes turns."""
    if piece.channel == LOAD_POINT or piece.frees_load_point:
        return machine.drive.turns
    return piece.channel == DISTURBANCE and turns_on(machine, getattr(piece, "on", None))


def turns_on(machine: Machine, body: str | None) -> bool:
    """Whether a body turns, or the only one where none is named."""
    name = body or (next(iter(machine.bodies)) if len(machine.bodies) == 1 else "")
    meant = [name] if name in machine.bodies else get_close_matches(name, machine.bodies, 1)  # a slip is told later
    return any(machine.bodies[one].turns for one in meant)


def unit_of(rig: Slider | Machine, piece: Piece, unit: str) -> str:
    """The SI unit that a rig gives a quantity of a piece, which is declared in that of a slider."""
    if not isinstance(rig, Machine):
        return unit
    if unit in TURNING:
        return TURNING[unit] if turns(rig, piece) else unit
    if unit != "Pa":
        return unit
    return "N m" if turns(rig, piece) else "N"


def in_units_of(rig: Slider | Machine, plan: Protocol) -> Protocol:
    """A protocol with the text of its numbers read as the rig has it.

    Raises
    ------
    ParameterError
        If text is of another dimension than what it is done to.
    """
    problems, changes = [], {}
    for name, address in parameters(plan, "protocol.").items():
        if not isinstance(address.value, InUnit):
            continue
        _, _, number, _ = name.split(".", 3)
        piece, told = plan.pieces[int(number) - 1], address.value
        wanted = unit_of(rig, piece, address.role.unit)
        area = rig.area if isinstance(rig, Slider) else None
        if told.unit == wanted:
            changes[name] = float(told)
        elif area is not None and told.unit == total_unit(wanted):
            changes[name] = float(told) / area
        else:
            hint = "; of a slider with an area a force will do" if (told.unit, wanted) == ("N", "Pa") else ""
            problems.append(Problem(name, f"got {float(told):g} {told.unit}; allowed here: a number in {wanted}{hint}"))
    if problems:
        raise ParameterError(problems)
    return replaced(plan, changes, "protocol.") if changes else plan
