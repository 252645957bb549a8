"""Options of `steadyslip.fit` and `steadyslip.population`, which are also the tables ``[fit]`` and ``[population]``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from steadyslip.core.domains import Domain, positive
from steadyslip.core.entries import LabelledNumbers, Names, Text, Whole
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import Settings, option, parameter, setting

STARTS = 48  # default number of starting points: six batches of eight, as eight motions are integrated at a time
LOSSES = ("linear", "soft-l1", "huber", "cauchy")
MOST_STARTS = 10**6  # largest number of starts, to limit memory: all are drawn at once, some 100 bytes each
MOST_EFFORT = 1e6  # largest effort, against mistakes: with more, a fit of a second would take days
MOST_TREND = 6  # highest order of a trend: a polynomial of higher order would follow the steps instead of the law
MOST_STATES = 100  # largest number of states, against mistakes: records determine two or three states
_effort = Domain(0, MOST_EFFORT, False, True, "a number above 0, up to a million")
_width = Domain(0, math.inf, False, False, "a finite number above 0, in units of what is fitted")


class FitSettings(Settings):
    """Options of a fit: free parameters, loading, trend, noise and search."""

    free: tuple[str, ...] | None = setting(
        Names("parameters to fit, by default those without a value; with a `[protocol]` also times of its pieces, "
              "`protocol.pieces.1.at`; for a machine any of its parameters and of the protocol's"), default=None,
    )  # fmt: skip
    fixed: tuple[str, ...] = setting(Names("parameters to keep"), default=())
    separate: tuple[str, ...] = setting(Names("free parameters with a separate value in every record"), default=())
    states: int = setting(Whole("number of states of the friction law", 1, MOST_STATES), default=1)
    drive: str = option(
        "commanded", "smoothed", "measured", default="commanded",
        doc="`commanded`: rates and normal stress found in the record, times of their changes fitted; `smoothed`: a "
        "smooth curve through the displacement; `measured`: as measured, noise included",
    )  # fmt: skip
    trend: int = setting(
        Whole("order of a polynomial that is added to friction, or to every column of a machine", 0, MOST_TREND),
        default=0,
    )
    trend_axis: str = option("displacement", "time", doc="variable of the trend polynomial", default="displacement")
    offset: bool = option(
        False, True, doc="add a constant to friction (besides mu_ref), or to every column of a machine", default=False
    )
    lag: bool = option(
        False, True, default=False,
        doc="friction may be recorded later or earlier than the loading; the time `lag` is fitted for each record",
    )  # fmt: skip
    initial: str = option(
        "steady", "free", default="steady",
        doc="`steady`: the record begins with steady sliding; `free`: it slides, but not steadily: friction and memory "
        "at its beginning are fitted, as differences from steady sliding (`initial.friction`, `initial.Theta`); for a "
        "machine, initial displacements and velocities of all bodies are fitted (`initial.table.x`), as in a ring-down",
    )  # fmt: skip
    loss: str = option(*LOSSES, doc="loss of residuals; all but `linear` give outliers less weight", default="linear")
    width: float | None = parameter(
        "1", _width, "residual beyond which they get less weight; by default 1.345 robust standard deviations",
        default=None,
    )  # fmt: skip
    errors: str = option(
        "auto", "correlated", "independent", doc="noise model of residuals in errors; `auto` tests for correlation",
        default="auto",
    )  # fmt: skip
    starts: int = setting(Whole("largest number of starting points of the search", 1, MOST_STARTS), default=STARTS)
    effort: float = parameter(
        "1", _effort, "limit on the length of the search, as a multiple of what nearly always suffices", default=1.0
    )
    calibrated: float | None = parameter(
        "Pa/m", positive, "stiffness of the machine from a calibration, for comparison with the fitted one",
        default=None,
    )  # fmt: skip
    windows: bool = option(False, True, doc="fit every step of a record as a separate record", default=False)
    compare: tuple[str, ...] = setting(
        Names(
            "laws to compare: `slip`, `aging`, `prz`, each also with `, two states` and with a memory of normal "
            "stress, `, none`, `, linker-dieterich` or `, prakash-clifton`; a label changes only what it names"
        ),
        default=(),
    )


STRESS = "normal stress"
DRAWS = (100, 10**6)  # fewest draws, so that some are beyond the ends of 95 % intervals; most draws, for memory
_scale = Domain(0, 100, False, True, "a number above 0, up to 100")


class PopulationSettings(Settings):
    """Options of a population, in which every record is a separate experiment, such as on samples of one rock."""

    parameters: tuple[str, ...] | None = setting(
        Names("parameters that differ between experiments; by default all of the friction law"),
        default=None,
    )
    condition: str | None = setting(
        Text(f"condition on which their means may depend: `{STRESS}` (of the records), or a name for `values`"),
        default=None,
    )
    values: tuple[float, ...] | dict[str, float] | None = setting(
        LabelledNumbers(
            "values of the condition, one for each record: in the order of the records, or by the names of their files "
            "without endings"
        ),
        default=None,
    )
    scale: float = parameter("1", _scale, "scale of the prior of spreads, e-folds or natural sizes", default=1.0)
    draws: int = setting(Whole("number of draws from the posterior", *DRAWS), default=4000)

    def depends_on(self) -> str | dict[str, tuple[float, ...] | dict[str, float]] | None:
        """Conditions in the form of the argument of `steadyslip.population`."""
        if self.condition is None or self.values is None:
            return self.condition
        return {self.condition: self.values}

    def faults(self) -> tuple[Problem, ...]:
        """Problems with combinations of settings."""
        if self.condition is None and self.values is not None:
            return (Problem("population.condition", "missing; name what the values are, such as 'temperature'"),)
        if self.condition == STRESS and self.values is not None:
            return (Problem("population.values", f"the {STRESS} is that of the records; leave the values out"),)
        if self.condition not in (None, STRESS) and self.values is None:
            message = f"missing; give the {self.condition} of every record, or write condition = {STRESS!r}"
            return (Problem("population.values", message),)
        return ()


def faults(options: Mapping[str, Any]) -> tuple[Problem, ...]:
    """Problems with the options of a fit; empty if all are valid."""
    try:
        FitSettings(**options)
    except ParameterError as error:
        return error.problems
    return ()
