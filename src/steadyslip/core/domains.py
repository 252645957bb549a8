"""Domains: intervals of allowed parameter values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Domain:
    """Interval of allowed values, open or closed at each end, of integers only if `whole`; `text` describes it."""

    low: float
    high: float
    low_allowed: bool
    high_allowed: bool
    text: str
    whole: bool = False

    def contains(self, value: Any) -> Any:
        """Test values elementwise; False for NaN and infinity."""
        above = value >= self.low if self.low_allowed else value > self.low
        below = value <= self.high if self.high_allowed else value < self.high
        return above & below & np.isfinite(value) & (not self.whole or np.floor(value) == value)


_INF = math.inf
positive = Domain(0, _INF, False, True, "a finite number > 0")
nonnegative = Domain(0, _INF, True, True, "a finite number >= 0")
real = Domain(-_INF, _INF, True, True, "a finite number")
share = Domain(0, 1, True, True, "a number from 0 to 1")
below_one = Domain(0, 1, True, False, "a number from 0 to below 1")
tolerance = Domain(1e-14, 0.1, True, True, "a number from 1e-14 to 0.1")  # from some roundings of a float on
steps = Domain(1, 1e12, True, True, "a whole number from 1 to 1e12", whole=True)  # upper bound chosen by trial
angle = Domain(-math.pi / 2, math.pi / 2, False, False, "an angle between -90 deg and 90 deg, both excluded")
line = Domain(
    -math.pi / 2, math.pi / 2, False, False,
    "an angle between -90 deg and 90 deg, both excluded (a line at 150 deg is one at -30 deg)",
)  # fmt: skip
acute = Domain(0, math.pi / 2, False, False, "an angle between 0 and 90 deg, both excluded")
turn = Domain(-2 * math.pi, 2 * math.pi, True, True, "an angle from -360 deg to 360 deg")
count = Domain(1, 100_000, True, True, "a whole number from 1 to 100000", whole=True)  # bound chosen by trial
