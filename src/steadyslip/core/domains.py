"""Intervals of allowed parameter values (`Domain`), and conditions between several numbers of a record."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import Problem


@dataclass(frozen=True)
class Domain:
    """Interval of allowed values, open or closed at each end; `text` describes it in messages.

    With `whole`, only integers are allowed. `apart` is one more allowed value, outside the interval, that a record may
    have; a varied parameter cannot take it.
    """

    low: float
    high: float
    low_allowed: bool
    high_allowed: bool
    text: str
    whole: bool = False
    apart: float | None = None

    def contains(self, value: Any) -> Any:
        """True for values inside the domain, elementwise for arrays; False for NaN and infinity."""
        above = value >= self.low if self.low_allowed else value > self.low
        below = value <= self.high if self.high_allowed else value < self.high
        return above & below & np.isfinite(value) & (not self.whole or np.floor(value) == value)


_INF = math.inf
positive = Domain(0, _INF, False, True, "a finite number > 0")
moving = Domain(
    0, _INF, False, True, "a finite number > 0, or 0 to hold a place with control = 'pid' (steadyslip hunt)"
)
turning = replace(moving, text=moving.text.replace("'pid'", "'rotary-pid'"))
speed = Domain(0, _INF, False, True, "a finite number > 0, or 0 to hold a place", apart=0.0)
nonnegative = Domain(0, _INF, True, True, "a finite number >= 0")
real = Domain(-_INF, _INF, True, True, "a finite number")
share = Domain(0, 1, True, True, "a number from 0 to 1")
chance = Domain(0, 1, False, True, "a number above 0, up to 1 (100 %)")
below_one = Domain(0, 1, True, False, "a number from 0 to below 1")
tolerance = Domain(1e-14, 0.1, True, True, "a number from 1e-14 to 0.1")  # 1e-14 is some tens of rounding errors
steps = Domain(1, 1e12, True, True, "a whole number from 1 to 1e12", whole=True)  # upper bound chosen by trial
angle = Domain(-math.pi / 2, math.pi / 2, False, False, "an angle between -90 deg and 90 deg, both excluded")
line = Domain(
    -math.pi / 2, math.pi / 2, False, False,
    "an angle between -90 deg and 90 deg, both excluded (a line at 150 deg is one at -30 deg)",
)  # fmt: skip
acute = Domain(0, math.pi / 2, False, False, "an angle between 0 and 90 deg, both excluded")
turn = Domain(-2 * math.pi, 2 * math.pi, True, True, "an angle from -360 deg to 360 deg")
count = Domain(1, 100_000, True, True, "a whole number from 1 to 100000", whole=True)  # bound chosen by trial


@dataclass(frozen=True)
class Condition:
    """A condition between several numbers of a record, with its truth for the record's values.

    Attributes
    ----------
    name : str
        Field named in the message, or a member of a field, such as ``contacts.guide``.
    holds : bool or ndarray of bool
        True if the condition is met; one value per rig if the numbers are arrays.
    message : str
        Message for a failure: what was given and what is allowed, with a ``{}`` for each of `numbers`.
    numbers : tuple of float or ndarray
        Numbers on which the condition depends.
    """

    name: str
    holds: Any
    message: str
    numbers: tuple[Any, ...] = ()

    def problem(self, name: str = "") -> Problem | None:
        """Problem for the first position at which the condition fails; None if it is met everywhere."""
        holds = np.asarray(self.holds)
        if np.all(holds):
            return None
        arrays = np.broadcast_arrays(holds, *self.numbers)
        where = tuple(int(i) for i in np.argwhere(~arrays[0])[0])
        place = f" (at position {where})" if arrays[0].size > 1 else ""
        return Problem(name or self.name, self.message.format(*(f"{float(a[where]):.12g}" for a in arrays[1:])) + place)
