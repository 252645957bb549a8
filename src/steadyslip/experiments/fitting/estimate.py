"""An estimate with its error, as it is printed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.format import format_quantity, format_range, format_with_error
from steadyslip.core.pages import Displayed


@dataclass(frozen=True)
class Estimate(Displayed):
    """Fitted parameter with its error and 95 % interval.

    Attributes
    ----------
    name : str
        Dotted name; ``@2`` behind it where it belongs to the second record alone.
    value, error : float
        Estimate and standard deviation in SI units; the error is inf where the records do not determine the parameter.
    unit : str
    low, high : float
        Ends of the 95 % interval.
    area : float or None
        Contact area of the rig, m²; if given, text shows totals for the whole contact.
    """

    name: str
    value: float
    error: float
    unit: str
    low: float
    high: float
    area: float | None = None

    @property
    def determined(self) -> bool:
        return bool(np.isfinite(self.error))

    def __str__(self) -> str:
        return f"{self.name} = {self.shown()}"

    def shown(self) -> str:
        """Format value and error with units, as printed."""
        if self.unit == "s":  # a time on the record's clock needs its digits
            return (
                f"{self.value:.7g} ± {self.error:.2g} s" if self.determined else f"{self.value:.7g} s (not determined)"
            )
        if not self.determined:
            return f"{format_quantity(self.value, self.unit, area=self.area)} (not determined)"
        return format_with_error(self.value, self.error, self.unit, self.area)

    def range(self) -> str:
        """Format the 95 % interval with units, as printed."""
        if self.unit == "s":
            return f"{self.low:.7g} to {self.high:.7g} s"
        return format_range(self.low, self.high, self.unit, self.area)
