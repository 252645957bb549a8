"""Coordinates of structures on which no link, contact or controller acts are left out where one parameter varies.

A parameter of a link, contact or drive changes the equations of the other coordinates (k) only. In steady sliding the
coordinates left out (i) follow from K_ii q_i = f_i − K_ik q_k, and their effect is added to the balances of the kept
coordinates. In the equations of motion, rows and columns of kept coordinates are those of the whole machine.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.machine.mechanism import Mechanism, StructurePart

MANY = 64  # least number of coordinates that are left out; for fewer it would take longer than it saves
_REGULAR = 1e-10  # least reciprocal condition of the scaled K_ii, for rounding errors of q_i to be negligible


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Coordinates of structures that are kept, and the effect of the coordinates left out on steady sliding.

    Attributes
    ----------
    parts : tuple of StructurePart
        Structures with the kept coordinates only.
    kept : ndarray of int (k,)
        Indices of the kept coordinates among all coordinates of the machine; bodies come first.
    stiffness : ndarray (k, k)
        K_ki K_ii⁻¹ K_ik, to be subtracted from the stiffness.
    force, force_by_pace : ndarray (k,), (k, structures)
        To be subtracted from the forces: a constant, and a column for each structure, per unit of its pace.
    """

    parts: tuple[StructurePart, ...]
    kept: NDArray[np.int64]
    stiffness: Array
    force: Array
    force_by_pace: Array

    def of(self, mechanism: Mechanism) -> Mechanism:
        """The mechanism with its structures replaced by `parts`, one for one.

        Each takes over the pace of the structure it replaces.
        """
        pairs = zip(self.parts, mechanism.structures, strict=True)
        return replace(mechanism, structures=tuple(replace(part, pace=one.pace) for part, one in pairs))


def left_out(mechanism: Mechanism, names: Set[str]) -> LeftOut | None:
    """Coordinates that can be left out of a mechanism, which is not touched there.

    None if they are few or cannot be eliminated.

    The result is valid for all mechanisms with equal structures (`alike`) in which links, contacts and controllers act
    only on coordinates in `names`.
    """
    from scipy.linalg import block_diag  # slow to import

    count = sum(len(part.coordinates) for part in mechanism.structures)
    if count - len(names) < MANY:
        return None
    at = len(mechanism.coordinates)
    kept, parts = list(range(at)), []
    stiffness, force, by_pace = [np.zeros((at, at))], [np.zeros(at)], [np.zeros((at, 0))]
    for part in mechanism.structures:
        outer = np.array([name in names for name in part.coordinates])
        followed = _followed(part, outer)
        if followed is None:
            return None
        moved = part.damping[np.ix_(outer, ~outer)] @ part.motion[~outer]
        back = part.stiffness[np.ix_(outer, ~outer)] @ followed
        stiffness.append(back[:, :-2])
        force.append(back[:, -2])
        by_pace.append((back[:, -1] + moved)[:, None])
        parts.append(_among(part, outer))
        kept += (at + np.flatnonzero(outer)).tolist()
        at += len(outer)
    return LeftOut(tuple(parts), np.array(kept), block_diag(*stiffness), np.concatenate(force), block_diag(*by_pace))


def touched(mechanism: Mechanism) -> set[str]:
    """Names of the coordinates on which links, contacts and controllers act, or which they sense."""
    rows = [row for one in mechanism.elements for row in (one.acts, one.senses)]
    rows += [row for one in mechanism.contacts for row in (one.slip, one.separation)]
    if mechanism.integral is not None:
        rows += [mechanism.integral.acts, mechanism.integral.senses]
    return {name for row in rows for name in row}


def alike(some: tuple[StructurePart, ...], others: tuple[StructurePart, ...]) -> bool:
    """True if all structures have the same matrices, forces and rigid motions."""
    pairs = zip(some, others, strict=True)
    names = ("mass", "damping", "stiffness", "force", "motion")
    arrays = ((getattr(one, name), getattr(two, name)) for one, two in pairs for name in names)
    return all(one is two or np.array_equal(one, two) for one, two in arrays)


def _followed(part: StructurePart, outer: NDArray[np.bool_]) -> Array | None:
    """Solutions of K_ii X = (K_ik, f_i, −C_i: motion), (i, k + 2). None if nothing holds the coordinates left out."""
    from scipy.linalg import solve  # slow to import

    inner = ~outer
    matrix = part.stiffness[np.ix_(inner, inner)]
    dragged = -part.damping[inner] @ part.motion
    known = np.column_stack([part.stiffness[np.ix_(inner, outer)], part.force[inner], dragged])
    size = np.sqrt(np.abs(np.diag(matrix)))
    if not np.all(size > 0):
        return None
    even = matrix / size[:, None] / size
    if not np.linalg.cond(even) < 1 / _REGULAR:
        return None
    return np.asarray(solve(even, known / size[:, None])) / size[:, None]


def _among(part: StructurePart, chosen: NDArray[np.bool_]) -> StructurePart:
    """The structure with its `chosen` coordinates only."""
    both = np.ix_(chosen, chosen)
    return replace(
        part, coordinates=tuple(name for name, one in zip(part.coordinates, chosen, strict=True) if one),
        mass=part.mass[both], damping=part.damping[both], stiffness=part.stiffness[both],
        force=part.force[chosen], motion=part.motion[chosen],
    )  # fmt: skip
