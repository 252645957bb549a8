"""Relations that numbers must obey together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.errors import Problem


@dataclass(frozen=True)
class Condition:
    """A relation that numbers of a record must obey together.

    Attributes
    ----------
    name : str
        Field that a message names, or a member of one, such as ``contacts.guide``.
    holds : bool or ndarray of bool
        Per rig, where the numbers are arrays.
    message : str
        What came and what is allowed, with places ``{}`` for `numbers`.
    numbers : tuple of float or ndarray
        On which the condition depends.
    """

    name: str
    holds: Any
    message: str
    numbers: tuple[Any, ...] = ()

    def problem(self, name: str = "") -> Problem | None:
        """What is wrong, at the first position where it is; None if the condition holds."""
        holds = np.asarray(self.holds)
        if np.all(holds):
            return None
        arrays = np.broadcast_arrays(holds, *self.numbers)
        where = tuple(int(i) for i in np.argwhere(~arrays[0])[0])
        place = f" (at position {where})" if arrays[0].size > 1 else ""
        return Problem(name or self.name, self.message.format(*(f"{float(a[where]):.12g}" for a in arrays[1:])) + place)
