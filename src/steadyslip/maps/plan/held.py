"""Measure for rigs that hold a place: a simulation of each rig decides if it hunts about its target or settles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.domains import positive, tolerance
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.records import parameter, replaced
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.measures import Measure, Output
from steadyslip.model.point import Vary
from steadyslip.nonlinear.hunting.hunt import hunt
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.nonlinear.hunting.plant import plant_of
from steadyslip.protocol import Protocol

SETTLES, HUNTS, RUNS_AWAY, UNDECIDED = range(4)
SECONDS_OF_HUNTING = 0.5  # s, CPU time assumed for one simulation (measured: 0.1 to 4 s); only sets the size of chunks


class Hunting(Measure, name="hunt"):
    """Outcome for an axis that holds a place: settles or hunts, with amplitude and times; see `steadyslip.hunt`."""

    moves = True
    held: ClassVar[bool | None] = True
    until: float | None = parameter("s", positive, "end of every motion that has not ended before", default=None)
    rtol: float = parameter("1", tolerance, "error allowed per step, with bristles", default=1e-6)

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        unit = "rad" if rig.feed()[1] else "m"
        words = ("settles", "hunts", "runs away", "not decided")
        return (
            Output("hunts", "1", "whether it hunts", words),
            Output("hunt_amplitude", unit, "largest distance from the target while hunting", missing="does not hunt"),
            Output("hunt_period", "s", "period of hunting", missing="does not hunt"),
            Output("settling_time", "s", "time after which it rests", missing="does not settle"),
            Output("rest_error", unit, "distance from the target at rest", missing="does not settle"),
        )

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        names, shape = list(vary), np.broadcast_shapes(*map(np.shape, vary.values()))
        rows = zip(*(np.broadcast_to(vary[name], shape).reshape(-1) for name in names), strict=True)
        found = np.array([self._at(rig, protocol, dict(zip(names, map(float, row), strict=True))) for row in rows])
        own = [output.name for output in self.outputs(rig, names)]
        return {name: found[:, i].reshape(shape) for i, name in enumerate(own)}

    def _at(self, rig: Slider | Machine, protocol: Protocol, values: dict[str, float]) -> tuple[float, ...]:
        """Values of all outputs at one point, in their order."""
        moved = {name: value for name, value in values.items() if name.startswith("protocol.")}
        own = rig.with_values({name: value for name, value in values.items() if name not in moved})
        try:
            return _numbers(hunt(own, replaced(protocol, moved, "protocol."), until=self.until, rtol=self.rtol))
        except NotAvailable:  # raised only during simulation: too many switches at once, or steps too short
            return (UNDECIDED, np.nan, np.nan, np.nan, np.nan)

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        try:
            plant_of(rig)
        except NotAvailable as error:
            yield Problem("", f"is not offered: {error}")
        except ParameterError as error:
            yield from error.problems

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        return SECONDS_OF_HUNTING


def _numbers(found: Hunt) -> tuple[float, ...]:
    """Values of all outputs for the result of a simulation, in their order."""
    reach = max(abs(found.lowest), abs(found.highest))
    if found.hunts is None:
        return (UNDECIDED, np.nan, np.nan, np.nan, np.nan)
    if found.runs_away:
        return (RUNS_AWAY, np.nan, np.nan, np.nan, np.nan)
    if found.hunts:
        return (HUNTS, reach, found.period, np.nan, np.nan)
    return (SETTLES, np.nan, np.nan, found.settled_at, reach)
