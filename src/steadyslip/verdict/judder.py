"""What a rig does that does not slide steadily: its motion after a small disturbance, until slip events repeat."""

from __future__ import annotations

import math
from collections.abc import Sequence

from steadyslip.core.errors import SteadyslipError
from steadyslip.core.format import format_quantity
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion import History, simulate
from steadyslip.motion.events import AnySlip
from steadyslip.motion.sentence import DIGITS
from steadyslip.protocol import VelocityStep

STEP = 1.1  # factor by which the drive is faster for a while: small, yet above what rounding makes of steady sliding
PERIODS = 12  # length of the first run in periods of the leading disturbance, so that its growth is seen
BEGIN, END = 0.05, 0.1  # shares of the first run between which the drive is faster
LONGER = 4.0  # length of a run over that of the run before
MOST_STEPS = 300_000  # integration steps of a run: some tenths of a second
BEATS = 1.2  # ratio of the largest to the smallest swing of an oscillation that goes on, which may beat; by trial
ALIKE = 0.01  # largest relative difference of slips, and of recurrences, of events that repeat


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
    leading = next((s for s in eigenvalues if s.imag > 0), next(iter(eigenvalues), None))
    if leading is None or not 0 < abs(leading) < math.inf:
        return None
    first = PERIODS * (2 * math.pi / leading.imag if leading.imag else 1 / abs(leading.real))
    speed = float(rig.value("drive.velocity") or 0.0)
    pieces = [VelocityStep(at=BEGIN * first, to=STEP * speed), VelocityStep(at=END * first, to=speed)]
    until = first
    run = simulate(rig, pieces, until=until, branch=branch, most_steps=MOST_STEPS)
    rate = max(leading.real, 0.0)
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


def swings(run: History, rate: float) -> dict[str, tuple[float, float, float]]:
    """Mean period (s) and extremes of velocity of each contact whose oscillation grows no more, by name.

    That is seen in the last half of the run.

    Empty in a run with slip events, and in one so short that small disturbances, which grow at `rate` (1/s), would
    not have doubled in that time: then nothing tells a cycle from slow growth.
    """
    half = 0.5 * float(run["t"][-1])
    if run.slip_events or rate * half < math.log(2):
        return {}
    found = {}
    for name in dict.fromkeys(one.contact for one in run.events):
        late = [one for one in run.events if one.contact == name and one.time > half]
        peaks, troughs = ([one for one in late if one.kind == f"velocity {kind}"] for kind in ("peak", "trough"))
        sizes = [peak.velocity - trough.velocity for peak, trough in zip(peaks, troughs, strict=False)]
        if len(sizes) > 1 and max(sizes) < BEATS * min(sizes):
            period = (peaks[-1].time - peaks[0].time) / (len(peaks) - 1)
            found[name] = period, min(one.velocity for one in troughs), max(one.velocity for one in peaks)
    return found


def _alike(events: list[AnySlip]) -> bool:
    return len(events) > 1 and all(
        math.isclose(getattr(one, what), getattr(events[-1], what), rel_tol=ALIKE)
        for one in events for what in ("slip", "recurrence")
    )  # fmt: skip


def judder_sentence(rig: Slider | Machine, eigenvalues: Sequence[complex], branch: int = 0) -> str:
    """Sentence on the slip events of an unstable rig; empty where they were not found to repeat."""
    try:
        run = motion_after(rig, eigenvalues, branch, repeated=True)
    except SteadyslipError:
        return ""
    if run is None or run.status != "done":
        return ""
    if repeats(run):
        return run.sentence
    growing = max((s.real for s in eigenvalues), default=0.0)
    told = []
    for name, (period, *ends) in swings(run, growing).items():
        low, high = (format_quantity(end, "m/s", DIGITS) for end in ends)
        told.append(f"{name} oscillates: every {format_quantity(period, 's', DIGITS)} between {low} and {high}".strip())
    return "; ".join(told)
