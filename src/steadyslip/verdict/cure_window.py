"""`Window`: values of one parameter at which a rig is stable with a required chance."""

from __future__ import annotations

from dataclasses import dataclass, field

from steadyslip.core.format import digits_apart, format_like
from steadyslip.core.pages import Displayed
from steadyslip.core.written import WrittenAs, displayed_as
from steadyslip.linear.nearness import doublings, ends_about

LEAST = 1e-12  # ratio of the smallest to the largest value searched, for a parameter whose own value is 0


@dataclass(frozen=True)
class Window(Displayed):
    """Values of one parameter at which the required chance of stable sliding is reached, the others unchanged.

    Attributes
    ----------
    parameter, unit : str
    value : float
        The rig's own.
    windows : tuple of (float, float)
        Intervals where the chance is reached, rising; an end equal to one of `limits` is no edge.
    limits : tuple of float
        Range that was searched.
    cost : float
        Cost of the change to the nearest window; 0 inside a window, infinite if there is none.
    """

    parameter: str
    unit: str
    value: float
    windows: tuple[tuple[float, float], ...]
    limits: tuple[float, float]
    cost: float
    area: float | None = field(default=None, repr=False)
    told: tuple[float, str] | None = field(default=None, repr=False)
    """Factor from SI and unit in which the values are printed, as `Rig.display_value` returns them for 1."""
    written_as: WrittenAs = field(default=WrittenAs(), repr=False)
    """Notation of the parameter in the rig's file, kept in printed values."""
    beyond: tuple[str, float] | None = None
    """Side (above, below) and value of an edge outside `limits` beyond which the rig, without tolerances, is stable."""

    @property
    def nearest(self) -> float | None:
        """End of a window nearest to the rig's own value; None without windows, or if the value lies inside one."""
        if not self.windows or any(low <= self.value <= high for low, high in self.windows):
            return None
        return ends_about(self.value, [end for one in self.windows for end in one], self.unit)[0]

    @property
    def leaves(self) -> float | None:
        """Nearest edge of the window around the rig's own value; None outside windows, or if the window has no edge."""
        return next(iter(self.edges_around), None)

    @property
    def edges_around(self) -> tuple[float, ...]:
        """Edges of the window around the rig's own value, nearest first: two, one or none."""
        around = [ends for ends in self.windows if ends[0] <= self.value <= ends[1]]
        return ends_about(self.value, [end for ends in around for end in ends if end not in self.limits], self.unit)

    def doublings(self, to: float) -> float:
        """Distance of a value from the rig's own in doublings, by `steadyslip.linear.nearness`."""
        return float(doublings(self.value, to, self.unit))

    def __str__(self) -> str:
        if not self.windows:
            text = "not reached from {} to {}".format(*map(self.written, self.limits))
            if self.beyond is None:
                return text
            side, value = self.beyond
            return f"{text}; beyond the range: the rig itself is stable {side} {self.written(value)}"
        return "; ".join(self._window(*one) for one in self.windows)

    def _window(self, low: float, high: float) -> str:
        if low == self.limits[0]:
            return (
                f"at every value up to {self.written(high)}"
                if high == self.limits[1]
                else f"up to {self.written(high)}"
            )
        if high == self.limits[1]:
            return f"from {self.written(low)} up"
        first, last = self.written(low, high), self.written(high, low)
        name = last.partition(" ")[2]
        return f"{first.removesuffix(f' {name}') if name else first} to {last}"

    def written(self, value: float, beside: float | None = None) -> str:
        """Text of a value in the unit of the rig's own value, with enough digits to differ from it or from `beside`."""
        if 0 == self.limits[0] < value < LEAST * self.limits[1]:
            return "anything above 0"  # the edge is at 0, as for the damping of a machine that nothing damps
        factor, unit = self.told or (1.0, self.unit)
        with displayed_as(self.written_as):
            digits = digits_apart(value, self.value if beside is None else beside)
            return format_like(value * factor, self.value * factor, unit, digits, self.area)
