"""Options of the table ``[map]`` of a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from steadyslip.core.entries import Names, Quantity, Text, Whole
from steadyslip.core.errors import Problem
from steadyslip.core.records import Settings, named, option, part, parts, setting
from steadyslip.maps.plan.axes import MOST_POINTS, SAMPLERS, SPACINGS, Grid, Samples
from steadyslip.maps.plan.measures import Measure

MOST_GIVEN = 2**24  # largest chunk that a file may ask for, points: results of 8 bytes then have 128 MiB
FIT_POINTS = 1000  # default number of draws from a fit: quantiles at 2.5 % have an error of 0.5 %
LARGEST_SEED = 2**63 - 1  # largest integer of TOML


class RangeSettings(Settings):
    """Both ends of a parameter's range."""

    start: Any = setting(Quantity("first value"), key="from")
    stop: Any = setting(Quantity("last value"), key="to")
    spacing: str = option(*SPACINGS, doc="even in the value, or in its logarithm", default="linear")


class GridSettings(RangeSettings):
    """Evenly spaced values of a parameter, both ends included."""

    points: int = setting(Whole("how many", 1, MOST_POINTS))

    def grid(self) -> Grid:
        return Grid(self.start, self.stop, self.points or 1, self.spacing)


class SampleSettings(Settings):
    """Parameters that vary together along the dimension `sample`."""

    over: Mapping[str, RangeSettings] | None = named(
        RangeSettings, "ranges by dotted name; samples are uniform in them"
    )
    points: int | None = setting(
        Whole(f"how many, {FIT_POINTS} for a fit unless given; a power of 2 suits `sobol`", 1, MOST_POINTS),
        default=None,
    )
    method: str | None = option(
        *SAMPLERS, default=None,
        doc="`sobol` (unless given): scrambled Sobol points, up to 2³²; `latin-hypercube`: up to 2²²",
    )  # fmt: skip
    seed: int = setting(Whole("samples follow from it", 0, LARGEST_SEED), default=0)
    fit: str | None = setting(
        Text("instead of `over` and `method`: a fit (`.nc`), beside this file, whose friction the rig gets and from "
             "whose covariance parameters are drawn"), default=None,
    )  # fmt: skip

    def inconsistencies(self) -> Iterator[Problem]:
        if self.fit is None:
            if self.points is None:
                yield Problem("points", "missing; give the number of sample points, such as 1024")
            return
        for key in ("over", "method"):
            if getattr(self, key) is not None:
                yield Problem(key, "is for samples of ranges; a fit says itself what varies, and how")

    def samples(self) -> Samples:
        ranges = {name: (one.start, one.stop, one.spacing) for name, one in (self.over or {}).items()}
        return Samples(ranges, self.points or 1, self.method or SAMPLERS[0], self.seed)


class MapSettings(Settings):
    """Quantities to compute for which rigs; options of a quantity are in a table named after it."""

    compute: tuple[str, ...] | None = setting(
        Names("results, see below; unless given `status`, with `critical_stiffness` for a slider, `growth_rate` for a "
              "machine"), default=None,
    )  # fmt: skip
    chunk: int | None = setting(
        Whole("points computed in one go; by what a point costs unless given", 1, MOST_GIVEN), default=None
    )
    over: Mapping[str, Any] | None = named(
        GridSettings, listed=True,
        doc="parameters by dotted name, quoted or not, or by their unique last part; those of the protocol as "
        "`protocol.pieces.1.to`: a list of values, or a table",
    )  # fmt: skip
    samples: SampleSettings | None = part(
        SampleSettings, "parameters that vary together along the dimension `sample`", default=None
    )
    options: tuple[Measure, ...] = parts(Measure, "options of a result", default=(), by_name=True)

    def inconsistencies(self) -> Iterator[Problem]:
        for one in self.options:
            if one.name not in (self.compute or ()):
                yield Problem(one.name, f"options of something that is not computed; add {one.name!r} to map.compute")

    def measures(self) -> list[Any] | None:
        """Measures to compute, as records where they have options, else by name; None if the file does not choose."""
        if self.compute is None:
            return None
        with_options = {one.name: one for one in self.options}
        return [with_options.get(name, name) for name in self.compute]
