"""Conditions between several numbers of a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.errors import Problem


@dataclass(frozen=True)
class Condition:
    """A condition between several numbers of a record, evaluated.

    Attributes
    ----------
    name : str
        Field named in the message, or a member of one, such as ``contacts.guide``.
    holds : bool or ndarray of bool
        One value per rig if the numbers are arrays.
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
        """The Problem at the first position where the condition fails; None if it holds everywhere."""
        holds = np.asarray(self.holds)
        if np.all(holds):
            return None
        arrays = np.broadcast_arrays(holds, *self.numbers)
        where = tuple(int(i) for i in np.argwhere(~arrays[0])[0])
        place = f" (at position {where})" if arrays[0].size > 1 else ""
        return Problem(name or self.name, self.message.format(*(f"{float(a[where]):.12g}" for a in arrays[1:])) + place)
