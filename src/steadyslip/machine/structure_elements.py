"""Structures as coordinates and elements of a mechanism, so that a Model can be assembled from them.

Nothing is approximated: displacements u = B z are expressed in coordinates z in which the inertia is diagonal, and
forces at contacts and links act only on the first few. If the stiffness is symmetric, the other coordinates form a
chain (band Lanczos, Golub & Van Loan, Matrix Computations, 10.1), so that equations stay short.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.machine.mechanism import DegreeOfFreedom, Element, Mechanism, Shares, StructurePart

_DEPENDENT = 1e-10  # a direction depends on earlier directions if less than this share of it is orthogonal to them
_ROUNDING = 8 * np.finfo(float).eps  # rounding error in matrix products over norm times size of the matrix (a bound)
MOST_COORDINATES, MOST_TERMS = 100, 1500
"""Largest number of degrees of freedom of a structure, and of entries of its damping and stiffness, for which code is
compiled; both take some half a minute to compile."""


def with_elements(mechanism: Mechanism) -> Mechanism:
    """Copy of the mechanism with structures replaced by coordinates, springs and dashpots.

    Raises
    ------
    NotAvailable
        If a structure is so large that code for its motion would take minutes to compile.
    """
    for part in mechanism.structures:
        mechanism = _with_elements(mechanism, part)
    return replace(mechanism, structures=())


def terms_of(mechanism: Mechanism) -> int:
    """Number of matrix entries of structures for which code is compiled; NotAvailable if there are too many."""
    return sum(len(one.senses) for one in with_elements(mechanism).elements) if mechanism.structures else 0


def _with_elements(own: Mechanism, part: StructurePart) -> Mechanism:
    if len(part.coordinates) > MOST_COORDINATES:
        raise _too_large(part, f"allowed: {MOST_COORDINATES}")
    names = {name: i for i, name in enumerate(part.coordinates)}
    basis = _Basis(part, [_numbers(row, names) for row in _rows(own)])
    if (terms := int(np.count_nonzero(basis.stiffness) + np.count_nonzero(basis.damping))) > MOST_TERMS:
        raise _too_large(part, f"whose matrices have {terms} entries, allowed: {MOST_TERMS}")

    def written(row: Shares) -> dict[str, Any]:
        """Row of the old coordinates expressed in the new ones."""
        inside = _numbers(row, names) @ basis.vectors
        kept = np.flatnonzero(np.abs(inside) > _ROUNDING * len(names) * np.max(np.abs(inside), initial=0.0))
        others = {name: share for name, share in row.items() if name not in names}
        return others | {part.coordinates[i]: float(inside[i]) for i in kept}

    coordinates = [
        DegreeOfFreedom(name, float(inertia), _plain(speed), _plain(force), inner=True)
        for name, inertia, speed, force in zip(
            part.coordinates,
            basis.inertia,
            (basis.inverse @ part.motion) * part.pace,
            basis.vectors.T @ part.force,
            strict=True,
        )
    ]
    elements = [replace(one, acts=written(one.acts), senses=written(one.senses)) for one in own.elements]
    integral = own.integral and replace(
        own.integral, acts=written(own.integral.acts), senses=written(own.integral.senses)
    )
    return replace(
        own,
        coordinates=(*own.coordinates, *coordinates),
        elements=(*elements, *basis.elements()),
        integral=integral,
        contacts=tuple(
            replace(one, slip=written(one.slip), separation=written(one.separation)) for one in own.contacts
        ),
        points={name: written(row) for name, row in own.points.items()},
    )


def _rows(own: Mechanism) -> Iterable[Shares]:
    """Yield the rows of contacts, then of links and controllers: displacements that they act on or sense."""
    for port in own.contacts:
        yield from (port.slip, port.separation)
    for one in own.elements:
        yield from (one.acts, one.senses)
    if own.integral is not None:
        yield from (own.integral.acts, own.integral.senses)


def _numbers(row: Shares, names: dict[str, int]) -> Array:
    found = np.zeros(len(names))
    for name, share in row.items():
        if name in names:
            found[names[name]] = float(share)
    return found


def _too_large(part: StructurePart, why: str) -> NotAvailable:
    return NotAvailable(
        f"bodies.{part.name}: motion, kicks, cycles, cures, chances and maps are not offered with "
        f"{len(part.coordinates)} degrees of freedom, {why}; reduce them: kept_modes = 10, or "
        "ss.machine.reduced, keeps ten modes besides the degrees of freedom of points"
    )


def _plain(value: Any) -> Any:
    """The value itself, with 0.0 replaced by the integer 0, which removes terms from equations."""
    return 0 if value == 0 else value


class _Basis:
    """Coordinates z of a structure that are coupled by few terms.

    Attributes
    ----------
    vectors, inverse : ndarray (n, n)
        Transformations of displacements: u = vectors z, z = inverse u.
    inertia : ndarray (n,)
        Inertia of each coordinate (kg).
    """

    def __init__(self, part: StructurePart, directions: list[Array]) -> None:
        self.part = part
        root = np.linalg.cholesky(part.mass)
        lower = np.linalg.inv(root)  # M = root rootᵀ
        self.stiffness, self.damping = (lower @ one @ lower.T for one in (part.stiffness, part.damping))
        even = 0.5 * (self.stiffness + self.stiffness.T)
        pushed = [lower @ one for one in directions if np.any(one)]
        axes = _chain(even, pushed)
        size = (
            1 / np.linalg.norm(pushed[0]) if pushed else 1.0
        )  # scales the first coordinate to the displacement of the first direction, in m
        self.vectors = size * (lower.T @ axes)
        self.inverse = axes.T @ root.T / size
        self.inertia = np.full(len(axes), size**2)
        self.stiffness, self.damping = (size**2 * _clean(axes.T @ one @ axes) for one in (self.stiffness, self.damping))

    def elements(self) -> list[Element]:
        """Springs and dashpots, one for each nonzero row of the stiffness and the damping matrix."""
        found = []
        for i, name in enumerate(self.part.coordinates):
            for matrix, own in ((self.stiffness, (1, 0)), (self.damping, (0, 1))):
                senses = {self.part.coordinates[j]: float(matrix[i, j]) for j in np.flatnonzero(matrix[i])}
                if senses:
                    found.append(Element("", {name: 1}, senses, *own, grounded=True))
        return found


def _clean(matrix: Array) -> Array:
    """Copy of a matrix with entries within rounding errors set to zero."""
    least = _ROUNDING * len(matrix) * np.linalg.norm(matrix, 2)
    return np.where(np.abs(matrix) > least, matrix, 0.0)


def _chain(even: Array, first: list[Array]) -> Array:
    """Orthonormal axes as columns (n, n), by Lanczos' method, first from the directions `first`, then from `even`
    times axes."""
    axes = np.zeros((0, len(even)))
    waiting = [*first]
    for place in range(len(even)):
        axes = _with_axis(axes, waiting, even)
        if len(axes) <= place:  # the axes span all motions that forces excite; any orthogonal axes complete them
            rest = np.linalg.svd(axes)[2][len(axes) :] if len(axes) else np.eye(len(even))
            waiting = [*rest]
            axes = _with_axis(axes, waiting, even)
    return np.asarray(axes.T)


def _with_axis(axes: Array, waiting: list[Array], even: Array) -> Array:
    """Axes (k, n) and one axis more, from the first independent direction in `waiting`, to which `even` times it is
    added."""
    while waiting:
        one = waiting.pop(0)
        length, left = np.linalg.norm(one), one
        for _ in range(2):  # twice is enough for orthogonality to rounding
            left = left - axes.T @ (axes @ left)
        if np.linalg.norm(left) > _DEPENDENT * length:
            axis = left / np.linalg.norm(left)
            axis = axis - axes.T @ (axes @ axis)
            axis = axis / np.linalg.norm(axis)
            waiting.append(even @ axis)
            return np.vstack([axes, axis])
    return axes
