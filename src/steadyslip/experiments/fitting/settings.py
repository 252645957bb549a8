"""The table ``[fit]`` of a file, and the options of `steadyslip.fit`: declared once, for both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import Settings, option, parameter, setting
from steadyslip.core.roles import Domain, Names, Whole

STARTS = 48
LOSSES = ("linear", "soft-l1", "huber", "cauchy")
MOST_STARTS = 10**6
MOST_TREND = 6
MOST_STATES = 100
_width = Domain(0, math.inf, False, False, "a finite number above 0, in units of what is fitted")


class FitSettings(Settings):
    """What to fit, and how."""

    free: tuple[str, ...] | None = setting(
        Names("parameters to fit, what is missing unless given; with a `[protocol]` also times of its pieces, "
              "`protocol.pieces.1.at`"), default=None,
    )  # fmt: skip
    fixed: tuple[str, ...] = setting(Names("parameters to keep"), default=())
    separate: tuple[str, ...] = setting(Names("free parameters that every record has to itself"), default=())
    states: int = setting(Whole("number of states of the friction law", 1, MOST_STATES), default=1)
    drive: str = option(
        "commanded", "smoothed", "measured", default="commanded",
        doc="`commanded`: rates and normal stress found in the record, times of their changes fitted; `smoothed`: a "
        "smooth curve through the displacement; `measured`: as measured, noise included",
    )  # fmt: skip
    trend: int = setting(Whole("order of a polynomial that is added to friction", 0, MOST_TREND), default=0)
    trend_axis: str = option("displacement", "time", doc="what it is a polynomial of", default="displacement")
    offset: bool = option(False, True, doc="add a constant too, beside mu_ref", default=False)
    lag: bool = option(
        False, True, default=False,
        doc="friction may come later than what drives it, each record by a time of its own, `lag`",
    )  # fmt: skip
    loss: str = option(*LOSSES, doc="of residuals; all but `linear` let outliers weigh less", default="linear")
    width: float | None = parameter(
        "1", _width, "residual from which on they do; 1.345 standard deviations of most unless given", default=None
    )
    errors: str = option(
        "auto", "correlated", "independent", doc="whether residuals remember each other", default="auto"
    )
    starts: int = setting(Whole("points that the search may start from", 1, MOST_STARTS), default=STARTS)
    windows: bool = option(False, True, doc="every step of a record becomes a record of its own", default=False)
    compare: tuple[str, ...] = setting(
        Names("laws to compare: `slip`, `aging`, `prz`, each also with `, two states`"), default=()
    )


def faults(options: Mapping[str, Any]) -> tuple[Problem, ...]:
    """What is wrong with options of a fit."""
    try:
        FitSettings(**options)
    except ParameterError as error:
        return error.problems
    return ()
