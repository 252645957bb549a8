"""What a rig does that does not slide steadily: its motion after a small disturbance, until slip events repeat."""

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

STEP = 1.1  # factor by which the drive is faster for a while: small, yet above what rounding makes of steady sliding
PERIODS = 12  # length of the first run in periods of the leading disturbance, so that its growth is seen
BEGIN, END = 0.05, 0.1  # shares of the first run between which the drive is faster
LONGER = 4.0  # length of a run over that of the run before
MOST_STEPS = 300_000  # integration steps of a run: some tenths of a second
MOST_TERMS = 300  # entries of structures' matrices up to which code is compiled within some seconds
FEWEST = 8  # events in the second half of a run from which it is told that they have no trend
TURNS = 0.25  # share of these, by trial, at which slips of irregular events turn from growing to shrinking or back
ENDINGS = {LOST: ", until contact is lost after {time}", BLOWN_UP: ", until it runs away after {time}"}
"""How a motion ends, by its status, with the time since the disturbance."""


def _first(eigenvalues: Sequence[complex]) -> float:
    """Length of the first run, s; NaN without a rate of disturbances."""
    leading = next((s for s in eigenvalues if s.imag > 0), next(iter(eigenvalues), None))
    if leading is None or not 0 < abs(leading) < math.inf:
        return math.nan
    return PERIODS * (2 * math.pi / leading.imag if leading.imag else 1 / abs(leading.real))


def motion_after(
    rig: Slider | Machine, eigenvalues: Sequence[complex], branch: int = 0, repeated: bool = False
) -> History | None:
    """Motion of a rig after its drive was faster by a tenth for a while; None without a rate of disturbances.

    With `repeated` the run is made longer until its slip events or oscillations repeat, or its steps are used up.

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
    """True if of each contact that slips all forward events in the last half of the run are alike.

    Two in a row are alike also while an oscillation still grows slowly; over half of the time that it took to become
    visible it would grow by more than `ALIKE`.
    """
    half = 0.5 * float(run["t"][-1])
    names = {one.contact for one in run.slip_events if one.slip > 0}
    late = [one for one in run.slip_events if one.slip > 0 and one.begin > half]
    return bool(names) and all(_alike([one for one in late if one.contact == name]) for name in names)


def swings(run: History, rate: float) -> dict[str, Swings]:
    """Oscillation of each contact that grows no more in the last half of a run, by name.

    Empty in a run with slip events there, and in one so short that small disturbances, which grow at `rate` (1/s),
    would not have doubled in that time: then nothing tells a cycle from slow growth.
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
    """What a run without slip events did before it ended: its last swings, if they grew; empty if there are none."""
    found = growing_swings(run.events, float(run["t"][-1]))
    return joined(run.rig, {name: f"{GROWS[True]}, last between {speeds(one)}" for name, one in found.items()})


def is_irregular(run: History) -> bool:
    """True if slips of each contact that slips go on in the last half of the run and vary without a trend.

    That is if they become larger and smaller by turns, and no larger in its last quarter than in the one before.
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
    """Sentence on what an unstable rig does after a small disturbance; empty where that is not known.

    That is its slip events, if they repeat or vary without a trend, an oscillation that goes on, or how it ends.
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
