"""Conversion of protocol quantities whose units depend on the rig: stress, force or torque; displacement or angle."""

from __future__ import annotations

from steadyslip.core.areas import total_unit
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import parameters, replaced
from steadyslip.core.roles import InUnit
from steadyslip.machine.rig import Rig
from steadyslip.protocol import Protocol

TURNING = {"m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2"}
"""Units of a rotation by the corresponding unit of a displacement."""


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
        moved = declared in TURNING  # motion of the drive, given in terms of the body whose feed the user gave
        wanted = TURNING[declared] if moved and turns else declared if moved else rig.protocol_unit(piece, declared)
        if given.unit == wanted:
            changes[name] = float(given) / ratio if moved else float(given)
        elif rig.area is not None and given.unit == total_unit(wanted):
            changes[name] = float(given) / rig.area
        else:
            hint = "; a slider with an area also takes a force" if (given.unit, wanted) == ("N", "Pa") else ""
            problems.append(
                Problem(name, f"got {float(given):g} {given.unit}; allowed here: a number in {wanted}{hint}")
            )
    if problems:
        raise ParameterError(problems)
    return replaced(plan, changes, "protocol.") if changes else plan
