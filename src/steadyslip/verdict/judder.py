"""Motion of an unstable rig after a small disturbance: simulated until its slip events repeat, then put in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from steadyslip.core.errors import SteadyslipError
from steadyslip.core.format import format_quantity
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.machine.structure_elements import terms_of
from steadyslip.motion import History, simulate
from steadyslip.motion.events import AnySlip
from steadyslip.motion.sentence import (
    ALIKE,
    BEATS,
    DIGITS,
    GROWS,
    ON,
    Swings,
    growing_swings,
    joined,
    oscillates,
    sentences,
    speeds,
    steady_swings,
)
from steadyslip.motion.status import BLOWN_UP, LOST
from steadyslip.protocol import VelocityStep

STEP = 1.1  # factor on the drive's speed during the disturbance: small, yet well above rounding errors
PERIODS = 12  # length of the first run, in periods of the leading mode, so that its growth is seen
BEGIN, END = 0.05, 0.1  # the drive is faster between these fractions of the first run
LONGER = 4.0  # ratio of the lengths of successive runs
MOST_STEPS = 300_000  # limit of integration steps of a run: some tenths of a second
MOST_TERMS = 300  # limit of entries in the matrices of structures: more take longer than some seconds to compile
FEWEST = 8  # least number of events in the second half of a run to conclude that their slips have no trend
TURNS = 0.25  # least share of events, by trial, after which slips change from growing to shrinking or back
ENDINGS = {LOST: ", until contact is lost after {time}", BLOWN_UP: ", until it runs away after {time}"}
"""Clause on the end of a motion, by `History.status`; {time} is counted from the disturbance."""


def _first(eigenvalues: Sequence[complex]) -> float:
    """Length (s) of the first run; NaN if no eigenvalue gives a time scale."""
    leading = next((s for s in eigenvalues if s.imag > 0), next(iter(eigenvalues), None))
    if leading is None or not 0 < abs(leading) < math.inf:
        return math.nan
    return PERIODS * (2 * math.pi / leading.imag if leading.imag else 1 / abs(leading.real))


def motion_after(
    rig: Slider | Machine, eigenvalues: Sequence[complex], branch: int = 0, repeated: bool = False
) -> History | None:
    """Motion of a rig whose drive is 10 % faster for a short time; None if no eigenvalue gives a time scale.

    With `repeated` the run is lengthened until its slip events or oscillations repeat, or `MOST_STEPS` is near.

    Raises
    ------
    SteadyslipError
        If the rig cannot be simulated.
    """
    first = _first(eigenvalues)
    if not math.isfinite(first):
        return None
    speed = float(rig.value("drive.velocity") or 0.0)
    pieces = [VelocityStep(at=BEGIN * first, to=STEP * speed), VelocityStep(at=END * first, to=speed)]
    until = first
    run = simulate(rig, pieces, until=until, branch=branch, most_steps=MOST_STEPS)
    rate = max(0.0, *(s.real for s in eigenvalues))
    while repeated and run.status == "done" and LONGER * run.steps < MOST_STEPS:
        if repeats(run) or swings(run, rate):
            break
        until *= LONGER
        run = simulate(rig, pieces, until=until, branch=branch, most_steps=MOST_STEPS)
    return run


def repeats(run: History) -> bool:
    """True if, at each contact that slips, all forward events in the last half of the run agree within `ALIKE`.

    Comparing only two successive events would also accept an oscillation that still grows slowly; within the last half
    of the run it grows by more than `ALIKE`.
    """
    half = 0.5 * float(run["t"][-1])
    names = {one.contact for one in run.slip_events if one.slip > 0}
    late = [one for one in run.slip_events if one.slip > 0 and one.begin > half]
    return bool(names) and all(_alike([one for one in late if one.contact == name]) for name in names)


def swings(run: History, rate: float) -> dict[str, Swings]:
    """Oscillations that have stopped growing in the last half of a run, by contact name.

    Empty if that half has slip events, or is too short for small disturbances, which grow at `rate` (1/s), to double:
    a cycle could not be distinguished from slow growth.
    """
    end = float(run["t"][-1])
    if any(one.begin > 0.5 * end for one in run.slip_events) or rate * 0.5 * end < math.log(2):
        return {}
    return steady_swings(run.events, end)


def _alike(events: list[AnySlip]) -> bool:
    return len(events) > 1 and all(
        math.isclose(getattr(one, what), getattr(events[-1], what), rel_tol=ALIKE)
        for one in events for what in ("slip", "recurrence")
    )  # fmt: skip


def grown(run: History) -> str:
    """Clause on the last swings of a run without slip events, if they grew; empty if there are none."""
    found = growing_swings(run.events, float(run["t"][-1]))
    return joined(run.rig, {name: f"{GROWS[True]}, last between {speeds(one)}" for name, one in found.items()})


def is_irregular(run: History) -> bool:
    """True if each contact that slips goes on slipping in the last half of the run, by amounts without a trend.

    There is no trend if slips grow and shrink in turn, and are no larger in the last quarter than in the third.
    """
    end = float(run["t"][-1])
    late = [one for one in run.slip_events if one.slip > 0 and one.begin > 0.5 * end]
    for name in {one.contact for one in run.slip_events if one.slip > 0}:
        own = [one for one in late if one.contact == name]
        sizes = np.array([one.slip for one in own])
        if len(sizes) < FEWEST:
            return False
        turns = np.mean(np.diff(np.sign(np.diff(sizes))) != 0)
        before, after = ([one.slip for one in own if (one.begin > 0.75 * end) is last] for last in (False, True))
        if turns < TURNS or not before or not after or max(after) > BEATS * max(before):
            return False
    return bool(late)


def judder_sentence(rig: Slider | Machine, eigenvalues: Sequence[complex], branch: int = 0) -> str:
    """Sentence on the motion of an unstable rig after a small disturbance; empty if the motion is not known.

    It describes slip events that repeat or vary without a trend, a lasting oscillation, or how the motion ends.
    """
    try:
        if terms_of(rig.mechanism()) > MOST_TERMS:
            return ""
        run = motion_after(rig, eigenvalues, branch, repeated=True)
    except SteadyslipError:
        return ""
    if run is None:
        return ""
    fastest = max(eigenvalues, key=lambda one: one.real)
    grows, since = GROWS[fastest.imag != 0], run.end - BEGIN * _first(eigenvalues)
    if run.status in ENDINGS:
        ends = ENDINGS[run.status].format(time=format_quantity(since, "s", DIGITS))
        return f"{run.contact} {grows}{ends}".strip()
    if run.status not in ("done", "too many steps"):
        return ""
    if repeats(run):
        return run.sentence
    if is_irregular(run):
        return joined(rig, sentences(rig, run.events, run.slip_events, 0.5 * float(run["t"][-1])))
    if steady := swings(run, fastest.real):
        return joined(rig, {name: oscillates(one) for name, one in steady.items()})
    time, found = format_quantity(since, "s", DIGITS), growing_swings(run.events, float(run["t"][-1]))
    return joined(rig, {name: grows + ON.format(time=time, speeds=speeds(one)) for name, one in found.items()})
