"""Measures of stability boundaries along a slider's stiffness or any parameter that enters the equations linearly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.entries import Text
from steadyslip.core.errors import ParameterError, Problem, SteadyslipError
from steadyslip.core.records import setting
from steadyslip.linear import critical_stiffness, safety_factor, stable_stiffness
from steadyslip.linear.linear_sets import most_values
from steadyslip.linear.response import has_closed_form
from steadyslip.linear.stable_values import edge_along, intervals_along, is_own_stiffness, name_along, stable_intervals
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.measures import NO_EDGE, NOT_SLIDING, Measure, Output
from steadyslip.model.point import Vary, operating_point
from steadyslip.nonlinear.onset.hopf import KINDS, onset_map
from steadyslip.protocol import Protocol


def _of_sliders(rig: Slider | Machine) -> Iterator[Problem]:
    """Yield a Problem if the rig is a machine, which has no single stiffness as measures of sliders need."""
    if rig.default_along is None:
        yield Problem(
            "", "is only for sliders, which have one stiffness; for machines compute 'edge' or 'stable_values' with "
            "along = 'links.NAME.stiffness', a gain, or any other parameter",
        )  # fmt: skip


class CriticalStiffness(Measure, name="critical_stiffness"):
    """Stability edge nearest to the rig's own stiffness, for sliders; see `steadyslip.critical_stiffness`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        return (Output("critical_stiffness", "Pa/m", "critical stiffness", missing=NO_EDGE),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"critical_stiffness": critical_stiffness(cast(Slider, rig), vary)}

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        yield from _of_sliders(rig)


class StableStiffness(Measure, name="stable_stiffness"):
    """All stable stiffnesses as intervals, for sliders; see `steadyslip.stable_stiffness`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        values = operating_point(rig, None, [n for n in varied if n in rig.parameters()])
        one = has_closed_form(values.model)
        most = 1 if one else most_values(values)
        extra = (("interval", most), ("end", 2))
        meaning = "ends of the intervals of stable stiffness"
        return (Output("stable_stiffness", "Pa/m", meaning, extra=extra, missing=NOT_SLIDING),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"stable_stiffness": stable_stiffness(cast(Slider, rig), vary)}

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        yield from _of_sliders(rig)


ALONG = "dotted name of the parameter, which must enter the equations linearly: a stiffness, a gain, ..."


class Along(Measure):
    """Base of measures of the stability boundary along one parameter that enters the equations linearly."""

    along: str | None = setting(Text(ALONG), default=None)

    def name_of(self, rig: Slider | Machine) -> str:
        """Full name of the parameter."""
        return name_along(rig, self.along)

    def is_own(self, rig: Slider | Machine) -> bool:
        """True if the parameter is the stiffness of a slider, for which there are closed forms."""
        return is_own_stiffness(rig, self.name_of(rig))

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        try:
            full = self.name_of(rig)
            if not self.is_own(rig):
                if not (value := rig.value(full)) or value < 0:
                    raise ParameterError([Problem("along", f"{full} has no positive value; give it one first")])
                stable_intervals(operating_point(rig), full)
        except ParameterError as error:
            yield from (Problem("along", problem.message) for problem in error.problems)
        except SteadyslipError as error:
            yield Problem("along", str(error))

    def unit(self, rig: Slider | Machine) -> tuple[float, str]:
        """Factor from SI values of the model to results, and unit of the results: totals for a machine's contact."""
        full = self.name_of(rig)
        return outside(rig.parameters()[full].role.unit, None if rig.area else rig.area_of(full))

    def room(self, rig: Slider | Machine, varied: Sequence[str]) -> int:
        """Largest possible number of stable intervals at a point."""
        return most_values(operating_point(rig, None, [n for n in varied if n in rig.parameters()]))

    def intervals(self, rig: Slider | Machine, vary: Vary) -> Any:
        """Low and high ends of the stable intervals, SI units, (..., m, 2)."""
        return intervals_along(rig, self.name_of(rig), vary)

    def edge(self, rig: Slider | Machine, vary: Vary) -> tuple[Any, Any]:
        """End of a stable interval nearest to the rig's own value, and that value, SI units."""
        return edge_along(rig, self.name_of(rig), vary)


class Edge(Along, name="edge"):
    """Exact stability edge of any parameter, nearest to the rig's value of it; see `steadyslip.stable_values`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        return (Output("edge", self.unit(rig)[1], f"edge of stability in {self.name_of(rig)}", missing=NO_EDGE),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"edge": self.edge(rig, vary)[0] * self.unit(rig)[0]}


class StableValues(Along, name="stable_values"):
    """All stable values of any parameter as exact intervals; see `steadyslip.stable_values`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        extra = (("interval", self.room(rig, varied)), ("end", 2))
        meaning = f"ends of the intervals in which {self.name_of(rig)} is stable"
        return (Output("stable_values", self.unit(rig)[1], meaning, extra=extra, missing=NOT_SLIDING),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"stable_values": np.asarray(self.intervals(rig, vary)) * self.unit(rig)[0]}


class SafetyFactor(Along, name="safety_factor"):
    """Stiffness, or another parameter, divided by its value at the edge; see `steadyslip.safety_factor`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        what = "stiffness over critical stiffness" if self.is_own(rig) else f"{self.name_of(rig)} over its edge"
        return (Output("safety_factor", "1", what, missing=NO_EDGE),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"safety_factor": safety_factor(rig, vary, along=self.along)}


class LogMargin(SafetyFactor, name="margin"):
    """Logarithm of the safety factor, ln(k/k_cr): zero at the edge, symmetric for factors above and below."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        (factor,) = super().outputs(rig, varied)
        return (Output("margin", "1", f"logarithm of {factor.meaning}", missing=NO_EDGE),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        with np.errstate(all="ignore"):
            return {"margin": np.log(safety_factor(rig, vary, along=self.along))}


class OnsetKind(Along, name="onset"):
    """Kind of onset at the nearest oscillatory edge in stiffness, or in another parameter; see `steadyslip.hopf`."""

    def name_of(self, rig: Slider | Machine) -> str:
        return rig.parameter_along(self.along or "slider.stiffness")

    def is_own(self, rig: Slider | Machine) -> bool:
        return self.along is None and rig.default_along is not None

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        full = self.name_of(rig)
        edge = "stiffness" if self.is_own(rig) else full
        return (
            Output("onset", "1", "kind of onset", KINDS),
            Output("onset_edge", "Pa/m" if self.is_own(rig) else self.unit(rig)[1], f"{edge} at the oscillatory edge"),
            Output("onset_coefficient", "1/s", "cubic coefficient of the onset"),
        )

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        found = onset_map(rig, vary, self.name_of(rig))
        edge = found["edge"] * (1.0 if self.is_own(rig) else self.unit(rig)[0])
        return {"onset": found["kind"], "onset_edge": edge, "onset_coefficient": found["coefficient"]}

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        if operating_point(rig).model.delays:
            yield Problem("", "is not offered with a delay")
            return
        yield from super().problems(rig, protocol)

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        return 1e-4  # measured
