"""Free parameters of a fit, and the coordinates in which they are searched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.records import Address


@dataclass(frozen=True)
class Unknown:
    """Free parameter with the coordinate of its search: the logarithm of its value, or its value in units of `size`.

    Attributes
    ----------
    name : str
        Full dotted name, followed by ``@2`` if it belongs to the second record only.
    parameter : str
        Full dotted name in the rig or the protocol.
    unit : str
    record : int or None
        Index of the record to which the parameter belongs; None if all records share it.
    logarithmic : bool
        True if the coordinate is the logarithm of the value.
    size : float
        Change of the value per unit of a coordinate that is not logarithmic.
    low, high : float
        Bounds of the value.
    kind : str
        Kind that the law declares; see `steadyslip.core.roles.PARAMETER_KINDS`.
    """

    name: str
    parameter: str
    unit: str
    record: int | None
    logarithmic: bool
    size: float
    low: float
    high: float
    kind: str = ""

    def coordinate(self, value: Any) -> Any:
        return np.log(value) if self.logarithmic else np.asarray(value) / self.size

    def value(self, coordinate: Any) -> Any:
        return np.exp(coordinate) if self.logarithmic else np.asarray(coordinate) * self.size

    def slope(self, coordinate: Any) -> Any:
        """Derivative of the value with respect to the coordinate."""
        return np.exp(coordinate) if self.logarithmic else np.full(np.shape(coordinate), self.size)

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the coordinate."""
        with np.errstate(divide="ignore"):
            return float(self.coordinate(self.low)), float(self.coordinate(self.high))


def unknown(address: Address, record: int | None, scale: float | None = None) -> Unknown:
    """Unknown for a parameter, with a logarithmic coordinate if the parameter is positive and declares no size."""
    name, domain = address.name, address.role.domain
    own = f"{name}@{record + 1}" if record is not None else name
    role = address.role
    positive = domain.low == 0 and not domain.low_allowed
    nonnegative = domain.low == 0 and domain.low_allowed and role.unit != "1"
    size = scale or role.size or abs(address.value or 0.0) or 1.0
    logarithmic = (positive or nonnegative) and scale is None and role.size is None
    low = 1e-4 * size if positive and role.size is not None else domain.low
    return Unknown(own, name, role.unit, record, logarithmic, size, low, domain.high, role.kind)


class Space:
    """Coordinates of all unknowns of a fit."""

    def __init__(self, unknowns: tuple[Unknown, ...]) -> None:
        self.unknowns = unknowns
        bounds = [u.bounds for u in unknowns]
        self.low = np.array([low for low, _ in bounds])
        self.high = np.array([high for _, high in bounds])
        self._logarithmic = np.array([u.logarithmic for u in unknowns], dtype=bool)
        self._sizes = np.array([u.size for u in unknowns])

    def __len__(self) -> int:
        return len(self.unknowns)

    def values(self, coordinates: Array) -> Array:
        powers = np.exp(np.where(self._logarithmic, coordinates, 0.0))
        return np.where(self._logarithmic, powers, coordinates * self._sizes)

    def coordinates(self, values: Array) -> Array:
        return np.stack([u.coordinate(values[..., i]) for i, u in enumerate(self.unknowns)], axis=-1)

    def slopes(self, coordinates: Array) -> Array:
        """Derivatives (..., p) of the values with respect to the coordinates (..., p)."""
        powers = np.exp(np.where(self._logarithmic, coordinates, 0.0))
        return np.where(self._logarithmic, powers, self._sizes)
