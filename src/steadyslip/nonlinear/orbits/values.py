"""The cycles at one value of the parameter: of a branch, or of a motion that comes to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.flow import Flow
from steadyslip.nonlinear.orbits.search import seed_at
from steadyslip.nonlinear.orbits.tracer import LARGEST_STEP, Tracer

MOST_STEPS_BETWEEN = 40


def tracer_of(onset: Onset, steady: int, rtol: float | None) -> Tracer:
    """What follows the cycles that begin at an onset, anywhere."""
    rig = onset.rig.with_values({onset.along: onset.value})
    return Tracer(Flow(rig, onset.along, steady, rtol, onset.contact), onset, (-np.inf, np.inf), MOST_STEPS_BETWEEN)


def cycles_at(
    onset: Onset, steady: int, rtol: float | None, value: float, stretches: Sequence[Sequence[Cycle]]
) -> tuple[Cycle, ...]:
    """The cycles at one value among stretches of a branch that are continuous, in the order of the branch."""
    tracer = tracer_of(onset, steady, rtol)
    found: list[Cycle] = []
    for stretch in stretches:
        for low, high in pairwise(stretch):
            if (low.value - value) * (high.value - value) <= 0 and high.value != value:
                cycle = _at_value(tracer, low, high, value)
                found += [] if cycle is None else [cycle]
        if stretch and stretch[-1].value == value:
            found.append(stretch[-1])
    return tuple(found)


def attracting(
    onset: Onset, steady: int, rtol: float | None, value: float, beside: Sequence[Cycle]
) -> Cycle | None:  # fmt: skip
    """The stable cycle that motions at a value come to, from steady sliding or known cycles; None if none does."""
    try:
        found = seed_at(tracer_of(onset, steady, rtol), value, beside, attracts=True)
    except NotAvailable:
        return None
    return found.cycle if found is not None and found.cycle.stable else None


def _at_value(tracer: Tracer, low: Cycle, high: Cycle, value: float) -> Cycle | None:
    """The cycle between two neighbours: along the branch from one to the other, from either side."""
    for one, other in ((low, high), (high, low)):
        if one.value == value:
            return one
        try:
            return _reached(tracer, one, other, value)
        except (Failure, np.linalg.LinAlgError):
            continue
    return None


def _reached(tracer: Tracer, start: Cycle, end: Cycle, value: float) -> Cycle:
    """Follow the cycles from one known to another until the value is passed; the cycle there."""
    if start._orbit is None:
        raise InternalError("start._orbit is not None")
    if end._orbit is None:
        raise InternalError("end._orbit is not None")
    first = tracer.shooting(scales=start._orbit.scales)
    ends = [first.packed(replace(c._orbit, states=c._orbit.states[:1])) for c in (start, end) if c._orbit is not None]
    here = tracer.resumed(start._orbit, min(1.0, start.amplitude), ends[1] - ends[0])
    curve = here.shooting.curve()
    step = min(LARGEST_STEP, float(np.linalg.norm(ends[1] - ends[0])))
    for _, point in zip(range(MOST_STEPS_BETWEEN), curve.follow(here.point, step, 1e-9, LARGEST_STEP), strict=False):
        now = tracer.known(here.shooting, point)
        if (here.cycle.value - value) * (now.cycle.value - value) <= 0:
            return tracer.between(here, now, value).cycle
        here = now
    raise Failure("not reached")
