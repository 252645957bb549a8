"""Units of protocol quantities, which depend on the rig: stresses, forces or torques; displacements or angles."""

from __future__ import annotations

from steadyslip.core.areas import total_unit
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import parameters, replaced
from steadyslip.core.roles import InUnit
from steadyslip.machine.rig import Rig
from steadyslip.protocol import Protocol

TURNING = {"m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2"}
"""Units of the motion of a load point that rotates, by the unit of one that slides."""


def in_units_of(rig: Rig, plan: Protocol) -> Protocol:
    """Copy of a protocol whose numbers with rig-dependent units are checked and converted for this rig.

    Raises
    ------
    ParameterError
        If a unit does not fit the body or contact that the piece acts on.
    """
    problems, changes = [], {}
    ratio, turns = rig.feed()
    for name, address in parameters(plan, "protocol.").items():
        if not isinstance(address.value, InUnit):
            continue
        _, _, number, _ = name.split(".", 3)
        piece, given = plan.pieces[int(number) - 1], address.value
        declared = address.role.unit
        moved = declared in TURNING  # a motion of the target or load point, told of the body whose feed is given
        wanted = TURNING[declared] if moved and turns else declared if moved else rig.protocol_unit(piece, declared)
        if given.unit == wanted:
            changes[name] = float(given) / ratio if moved else float(given)
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
