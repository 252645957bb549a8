"""The tables ``[fit]`` and ``[population]`` of a file, and the options of `steadyslip.fit`: declared once, for both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from steadyslip.core.domains import Domain, positive
from steadyslip.core.entries import LabelledNumbers, Names, Text, Whole
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import Settings, option, parameter, setting

STARTS = 48  # points that a search starts from: six batches of the eight sets that run side by side
LOSSES = ("linear", "soft-l1", "huber", "cauchy")
MOST_STARTS = 10**6  # bound of memory: starts are drawn together, some 100 bytes each
MOST_EFFORT = 1e6  # bound against mistaken numbers: a fit of a second would take days
MOST_TREND = 6  # order: a longer polynomial would bend as slips do and take their place
MOST_STATES = 100  # bound against mistaken numbers: records tell two or three states
_effort = Domain(0, MOST_EFFORT, False, True, "a number above 0, up to a million")
_width = Domain(0, math.inf, False, False, "a finite number above 0, in units of what is fitted")


class FitSettings(Settings):
    """What to fit, and how."""

    free: tuple[str, ...] | None = setting(
        Names("parameters to fit, what is missing unless given; with a `[protocol]` also times of its pieces, "
              "`protocol.pieces.1.at`; of a machine any of its parameters, and of the protocol"), default=None,
    )  # fmt: skip
    fixed: tuple[str, ...] = setting(Names("parameters to keep"), default=())
    separate: tuple[str, ...] = setting(Names("free parameters that every record has to itself"), default=())
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
    trend_axis: str = option("displacement", "time", doc="what it is a polynomial of", default="displacement")
    offset: bool = option(
        False, True, doc="add a constant too, beside mu_ref, or to every column of a machine", default=False
    )
    lag: bool = option(
        False, True, default=False,
        doc="friction may come later or earlier than what drives it, each record by a time of its own, `lag`",
    )  # fmt: skip
    initial: str = option(
        "steady", "free", default="steady",
        doc="`steady`: the record begins with steady sliding; `free`: it slides, but not steadily: friction and memory "
        "at its beginning are fitted, as differences from steady sliding (`initial.friction`, `initial.Theta`); of a "
        "machine places and velocities of all bodies (`initial.table.x`), as of a ring-down",
    )  # fmt: skip
    loss: str = option(*LOSSES, doc="of residuals; all but `linear` let outliers weigh less", default="linear")
    width: float | None = parameter(
        "1", _width, "residual from which on they do; 1.345 standard deviations of most unless given", default=None
    )
    errors: str = option(
        "auto", "correlated", "independent", doc="whether residuals remember each other", default="auto"
    )
    starts: int = setting(Whole("points that the search may start from", 1, MOST_STARTS), default=STARTS)
    effort: float = parameter(
        "1", _effort, "how long the search may last, as a multiple of what nearly always suffices", default=1.0
    )
    calibrated: float | None = parameter(
        "Pa/m", positive, "stiffness of the machine from a calibration, to which the fitted one is compared",
        default=None,
    )  # fmt: skip
    windows: bool = option(False, True, doc="every step of a record becomes a record of its own", default=False)
    compare: tuple[str, ...] = setting(
        Names(
            "laws to compare: `slip`, `aging`, `prz`, each also with `, two states` and with a memory of normal "
            "stress, `, none`, `, linker-dieterich` or `, prakash-clifton`; a word alone changes nothing else"
        ),
        default=(),
    )


STRESS = "normal stress"
DRAWS = (100, 10**6)  # least: 95 % intervals end among the outer few draws; most: bound of memory
_scale = Domain(0, 100, False, True, "a number above 0, up to 100")


class PopulationSettings(Settings):
    """Every record is an experiment of its own, and a member of a population, such as samples of one rock."""

    parameters: tuple[str, ...] | None = setting(
        Names("parameters that differ from experiment to experiment; all of the friction law unless given"),
        default=None,
    )
    condition: str | None = setting(
        Text(f"what their means may depend on: `{STRESS}`, which is that of the records, or a name for `values`"),
        default=None,
    )
    values: tuple[float, ...] | dict[str, float] | None = setting(
        LabelledNumbers(
            "of the condition, one for each record: in the order in which records are given, or by the names of their "
            "files without endings"
        ),
        default=None,
    )
    scale: float = parameter("1", _scale, "of the prior of the spreads, e-folds or natural sizes", default=1.0)
    draws: int = setting(Whole("draws from the posterior", *DRAWS), default=4000)

    def depends_on(self) -> str | dict[str, tuple[float, ...] | dict[str, float]] | None:
        """Conditions in the form of the argument of `steadyslip.population`."""
        if self.condition is None or self.values is None:
            return self.condition
        return {self.condition: self.values}

    def faults(self) -> tuple[Problem, ...]:
        """Problems with combinations of settings."""
        if self.condition is None and self.values is not None:
            return (Problem("population.condition", "missing; say what the values are, such as 'temperature'"),)
        if self.condition == STRESS and self.values is not None:
            return (Problem("population.values", f"the {STRESS} is that of the records; leave them away"),)
        if self.condition not in (None, STRESS) and self.values is None:
            message = f"missing; give the {self.condition} of every record, or write condition = {STRESS!r}"
            return (Problem("population.values", message),)
        return ()


def faults(options: Mapping[str, Any]) -> tuple[Problem, ...]:
    """Problems with the options of a fit."""
    try:
        FitSettings(**options)
    except ParameterError as error:
        return error.problems
    return ()
