"""Compute the cycles at one value of the parameter: by continuation from the branch, or by simulation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.checks import in_words
from steadyslip.core.errors import SteadyslipError
from steadyslip.core.format import format_quantity
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion import simulate
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.cycle_from_motion import motion_from
from steadyslip.nonlinear.orbits.cycle_search import AHEAD, PATIENCE
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.ranges import Neighbour, checks_of, is_open
from steadyslip.nonlinear.orbits.tracer import LARGEST_STEP, Tracer, orbit_of

MOST_STEPS_BETWEEN = 40  # limit of continuation steps between two neighbouring cycles on a branch
PERIODS = 4  # simulated periods: a recurrence time needs a third slip event, two periods after the start
ASIDE = 1e-2  # initial distance of a simulated motion from an unstable cycle, in shooting unknowns


def tracer_of(onset: Onset, steady: int, rtol: float | None) -> Tracer:
    """A `Tracer` for the cycles of an onset, without limits of the parameter; `steady`: index of steady sliding."""
    rig = onset.rig.with_values({onset.along: onset.value})
    return Tracer(Flow(rig, onset.along, steady, rtol, onset.contact), onset, (-np.inf, np.inf), MOST_STEPS_BETWEEN)


def cycles_at(
    onset: Onset, steady: int, rtol: float | None, value: float, stretches: Sequence[Sequence[Cycle]]
) -> tuple[list[Cycle], list[tuple[Cycle, Cycle]]]:
    """Cycles at one parameter value, and pairs of neighbours around it between which none was found.

    `stretches` are the continuous parts of a branch; cycles are returned in its order.
    """
    tracer = tracer_of(onset, steady, rtol)
    found, missed = list[Cycle](), list[tuple[Cycle, Cycle]]()
    for stretch in stretches:
        for low, high in pairwise(stretch):
            if (low.value - value) * (high.value - value) <= 0 and high.value != value:
                cycle = _at_value(tracer, low, high, value)
                found += [] if cycle is None else [cycle]
                missed += [(low, high)] if cycle is None else []
        if stretch and stretch[-1].value == value:
            found.append(stretch[-1])
    return found, missed


@dataclass(frozen=True)
class Simulation:
    """Outcome of one simulated motion at a value of the parameter.

    Attributes
    ----------
    start : str
        Description of the initial state.
    outcome : str
        Description of the motion.
    cycle : Cycle or None
        Stable cycle that the motion approaches; None if it settles, ends, or does not repeat within the simulated time.
    multiple : float
        Period of `cycle` over that of the unstable cycle near which the motion began; NaN if either is missing.
    """

    start: str
    outcome: str
    cycle: Cycle | None = None
    multiple: float = np.nan

    def __str__(self) -> str:
        return f"motion from {self.start} {self.outcome}"


class CyclesAt(tuple[Cycle, ...]):
    """The cycles at one value of a parameter.

    Attributes
    ----------
    multiples : tuple of int
        For each cycle 1 if it lies on the branch, 2 on its cycles of twice the period and so on; 0 if it was found by
        simulation.
    missed : tuple of str
        Descriptions of cycles between neighbours on the branch or its doublings that could not be computed.
    simulated : tuple of Simulation
        Simulated motions, if no cycle of the branch or its doublings attracts; else empty.
    between : tuple of Neighbour or None
        With `simulated`: nearest bifurcation or end of the branch or its doublings below the value and above it, the
        bounds of the window in which none of these cycles attracts; None where there is none.
    sentence : str
        At the rig itself (`CycleBranch.at_rig`): description of the slip events of its stable cycle; else empty.
    """

    multiples: tuple[int, ...]
    missed: tuple[str, ...]
    simulated: tuple[Simulation, ...]
    between: tuple[Neighbour | None, Neighbour | None]
    sentence: str
    _window: str

    def __new__(
        cls, cycles: Iterable[Cycle], multiples: Sequence[int] = (), missed: Sequence[str] = (),
        simulated: Sequence[Simulation] = (), between: tuple[Neighbour | None, Neighbour | None] = (None, None),
        window: str = "",
    ) -> CyclesAt:  # fmt: skip
        """Tuple of cycles with the outcomes of simulations and the description of the window."""
        self = super().__new__(cls, cycles)
        self.multiples, self.missed = tuple(multiples), tuple(missed)
        self.simulated, self.between = tuple(simulated), between
        self._window, self.sentence = window, ""
        return self

    def with_sentence(self, sentence: str) -> CyclesAt:
        """Copy of these cycles with a sentence on the slip events."""
        copy = CyclesAt(self, self.multiples, self.missed, self.simulated, self.between, self._window)
        copy.sentence = sentence
        return copy

    def __str__(self) -> str:
        rows = list(map(_row, self, self.multiples))
        rows += [("simulated", str(one)) for one in self.simulated]
        rows += [("", one) for one in (*self.missed, self._window, self.sentence, in_words(checks_of(self))) if one]
        return "\n".join(f"{name:<{NAMES}}{what}" if name else what for name, what in rows)


NAMES = 16  # width of the first column of the text, characters


def _row(cycle: Cycle, multiple: int) -> tuple[str, str]:
    """First column and text of the line on a cycle."""
    low, high = (format_quantity(v, "m/s") for v in (cycle.lowest_velocity, cycle.peak_velocity))
    of = f", of those of {multiple} times the period" if multiple > 1 else ""
    name = "stable cycle" if cycle.stable else "unstable cycle"
    return name, f"period {format_quantity(cycle.period, 's')}{of}, velocity {low} to {high}"


def slip_sentence(rig: Slider | Machine, cycle: Cycle, steady: int = 0) -> str:
    """Sentence on the slip events of a cycle of the rig, simulated for `PERIODS` periods; empty if there are none."""
    with suppress(SteadyslipError):
        return simulate(rig, until=PERIODS * cycle.period, initial=cycle.start, branch=steady).sentence
    return ""


def own_motion(rig: Slider | Machine, along: str) -> str:
    """Sentence on the rig's motion from near steady sliding: the stable cycle that it approaches, with slip events.

    Empty if the motion cannot be computed. `along` is the name of a parameter that the rig has.
    """
    with suppress(SteadyslipError, Failure, np.linalg.LinAlgError):
        name = rig.parameter_along(along)
        flow, value = Flow(rig, name), float(rig.value(name) or 0.0)
        seen = motion_from(flow, flow.ahead(value, AHEAD), value, PATIENCE, attracts=True)
        if seen.cycle is None:
            return f"the rig itself {seen.words}"
        period = format_quantity(seen.cycle.period, "s", 7)
        sentence = slip_sentence(rig, seen.cycle)
        after = f"; {'' if rig.contacts else 'it '}{sentence}" if sentence else ""
        return f"the rig itself comes to a stable cycle of period {period}{after}"
    return ""


def simulations(
    onset: Onset, steady: int, rtol: float | None, value: float, beside: Sequence[Cycle]
) -> list[Simulation]:  # fmt: skip
    """Simulated motions from near unstable cycles and steady sliding, up to the first that reaches a stable cycle."""
    tracer, found = tracer_of(onset, steady, rtol), list[Simulation]()
    for cycle in (*beside, None):
        start = "beside a cycle" if cycle else "beside steady sliding"
        try:
            state, start = _start(tracer, value, cycle)
            seen = motion_from(tracer.flow, state, value, PATIENCE, attracts=True)
        except (Failure, np.linalg.LinAlgError) as failure:
            found.append(Simulation(start, f"cannot begin: {failure}"))
            continue
        except KeyboardInterrupt:
            found.append(Simulation(start, "was interrupted"))
            break
        multiple = np.nan if cycle is None or seen.cycle is None else seen.cycle.period / cycle.period
        times = f", {multiple:.4g} times that of the unstable cycle" if np.isfinite(multiple) else ""
        found.append(Simulation(start, seen.words + times, seen.cycle, multiple))
        if seen.cycle is not None:
            break
    return found


def _start(tracer: Tracer, value: float, cycle: Cycle | None) -> tuple[Array, str]:
    """Starting state (n,) of a simulation, and its description."""
    if cycle is None:
        return tracer.flow.ahead(value, AHEAD), "beside steady sliding"
    orbit, vector = orbit_of(cycle), tracer.deviation(cycle, cycle.multipliers[0])[0]
    return orbit.states[0] + ASIDE * vector, f"beside the unstable cycle of period {format_quantity(cycle.period, 's')}"


def _at_value(tracer: Tracer, low: Cycle, high: Cycle, value: float) -> Cycle | None:
    """Cycle at a value between two neighbours, by continuation from either; None if that fails."""
    for one, other in ((low, high), (high, low)):
        if one.value == value:
            return one
        try:
            return _closed(tracer, _reached(tracer, one, other, value))
        except (Failure, np.linalg.LinAlgError):
            continue
    return None


def _closed(tracer: Tracer, cycle: Cycle) -> Cycle:
    """The cycle itself; if it is stable and its closing error too large, the cycle solved from a simulated motion."""
    if not (is_open(cycle) and cycle.stable):
        return cycle
    again = motion_from(tracer.flow, orbit_of(cycle).states[0], cycle.value, attracts=True).cycle
    return again if again is not None and again.is_like(cycle) else cycle


def _reached(tracer: Tracer, start: Cycle, end: Cycle, value: float) -> Cycle:
    """Cycle at a value of the parameter, by following the branch from one known cycle towards another."""
    orbits = orbit_of(start), orbit_of(end)
    first = tracer.shooting(scales=orbits[0].scales)
    ends = [first.packed(replace(orbit, states=orbit.states[:1])) for orbit in orbits]
    here = tracer.resumed(orbits[0], min(1.0, start.amplitude), ends[1] - ends[0])
    curve = here.shooting.curve()
    step = min(LARGEST_STEP, float(np.linalg.norm(ends[1] - ends[0])))
    for _, point in zip(range(MOST_STEPS_BETWEEN), curve.follow(here.point, step, 1e-9, LARGEST_STEP), strict=False):
        now = tracer.branch_point(here.shooting, point)
        if (here.cycle.value - value) * (now.cycle.value - value) <= 0:
            return tracer.between(here, now, value).cycle
        here = now
    raise Failure("the value was not reached from the neighbouring cycles")
