"""Result of a fit to a table of speeds: numbers, text, and the rig file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from steadyslip.experiments.fitting.speed_fit import SpeedFindings
from steadyslip.experiments.fitting.speed_rig import rig_text
from steadyslip.experiments.fitting.speed_words import as_dict, words


@dataclass(frozen=True, eq=False, repr=False)
class SpeedFit(SpeedFindings):  # noqa: D101 -- its base has it
    __doc__ = SpeedFindings.__doc__

    def __str__(self) -> str:
        return words(self)

    def rig_text(self) -> str:
        """A complete rig file with this friction, in which what the table does not tell is marked."""
        return rig_text(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, SI units."""
        return as_dict(self)
