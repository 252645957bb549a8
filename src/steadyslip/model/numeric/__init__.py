"""Machines of any size by numbers, not symbols: matrices and contacts, steady sliding, eigenvalues, edges.

Laws enter by their expressions, contact by contact; the symbolic Model of a machine is not used.
"""

from __future__ import annotations

from typing import TypeGuard

from steadyslip.core.errors import NotAvailable
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig

_WRITTEN_OUT = 18
"""Largest number of first-order states for which the polynomial of a machine is written out in symbols, in some ten
seconds. Eight blocks in a row with one contact have 17 states; with each further block the time doubles."""
MEASURED = (
    "a structure given by its measured response has no equations; `analyze` gives its verdict and edges, in Python "
    "also boundary and margins, and identified_modes its modes. Describe it by matrices or modes for more"
)


def has_structure(rig: Rig) -> bool:
    """True for a machine with a structure, of which there are matrices only."""
    return any(body.is_structure for body in rig.bodies.values())


def has_response(rig: Rig) -> bool:
    """True for a machine with a structure given by its measured response, which has no eigenvalues to be computed."""
    return any(getattr(body, "response", None) is not None for body in rig.bodies.values())


def refuse_response(rig: Rig) -> None:
    """Raise NotAvailable for a machine with a structure given by its measured response: it has no equations."""
    if has_response(rig):
        raise NotAvailable(MEASURED)


def by_matrices(rig: Rig) -> TypeGuard[Machine]:
    """True for a machine whose equations are matrices: it has a structure, or is too large to be written out."""
    if has_structure(rig):
        return True
    return isinstance(rig, Machine) and _states(rig) > _WRITTEN_OUT and in_numbers(rig)


def in_numbers(machine: Machine) -> bool:
    """True for a machine of which matrices can be made: it slides, and has no delays and no measured response."""
    return not (machine.holds or _delayed(machine) or has_response(machine))


def _states(machine: Machine) -> int:
    """Number of displacements, velocities and states of laws in a machine."""
    places = sum(2 if body.lifts else 1 for body in machine.bodies.values())
    own = (len(one.friction.memory()) + len(one.contact.memory()) for one in machine.contacts.values())
    return 2 * places + sum(own)


def _delayed(machine: Machine) -> bool:
    late = [machine.drive.lateness(), *(one.friction.lateness() for one in machine.contacts.values())]
    return any(one != 0 for one in late)
