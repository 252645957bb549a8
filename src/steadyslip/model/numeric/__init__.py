"""Machines of any size in numbers: matrices and contacts, steady sliding, eigenvalues, edges; no machine-wide symbols.

Knows the laws by their expressions, contact by contact; knows nothing of the symbolic Model of a machine.
"""

from __future__ import annotations

from typing import TypeGuard

from steadyslip.machine.machine import Machine


def by_matrices(rig: object) -> TypeGuard[Machine]:
    """True for a machine whose equations are matrices: it has a structure, or is too large to be written out."""
    return isinstance(rig, Machine) and any(body.is_structure for body in rig.bodies.values())
