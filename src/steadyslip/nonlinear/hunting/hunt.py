"""`hunt`: simulate a rig that holds a position until it rests, its strokes repeat, or the time ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import DURATION, checked
from steadyslip.core.version import version
from steadyslip.machine.holding import Holding
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.nonlinear.hunting.other_bodies import rows_of, swings_of
from steadyslip.nonlinear.hunting.plant import Plant, plant_of
from steadyslip.nonlinear.hunting.stick_and_slip import Motion, Stroke, friction_at_rest, swings
from steadyslip.protocol import Protocol
from steadyslip.protocol.pieces import DisplacementStep
from steadyslip.protocol.protocol import LOAD_POINT
from steadyslip.protocol.segments import pack

EXACT = 1e-9  # relative difference below which two cycles are equal, if the motion is solved exactly
MOST_STROKES = 400  # limit of strokes; the decision is then made from the last strokes; chosen by trial
SAMPLED_STROKES = 24  # MOST_STROKES for a sampled controller, whose strokes vary with the phase of sampling
MOST_SAMPLED_STROKES = 100  # SAMPLED_STROKES while strokes still shrink
IN_CORE = 2_000_000  # limit of steps of the compiled core: some ten seconds
MOST_STEPS = 50_000  # limit of steps outside the compiled core, at switches of the mode
OFTEN = 0.02  # repetition is tested again after this share of new strokes: a ringing drive makes thousands
LONGEST = 1e9  # default end, s; the motion ends earlier by rest, repetition or the limits above
CYCLES = 8  # largest number of strokes of cycles that are looked for; a cycle usually has two strokes
SHRINKING = 0.9  # strokes shrink if the ratio of later to earlier strokes is below this; chosen by trial


@checked(until=DURATION)
def hunt(
    rig: Slider | Machine,
    protocol: Any = None,
    *,
    until: float | str | None = None,
    rtol: float = 1e-8,
    progress: Callable[[float, int], None] | None = None,
) -> Hunt:
    """Motion of an axis that is held (velocity 0), and the decision whether it hunts about its target or settles.

    Motion begins at rest at position 0, as does the target, which then moves by the protocol. Contacts with Coulomb
    friction stick and slide; between switches the system is linear and solved exactly. It is integrated numerically
    with bristles (LuGre), and with viscous friction under a `transmitted` load during sliding.

    Parameters
    ----------
    rig : Slider or Machine
        Rig with a controller at velocity 0.
    protocol : Protocol, piece or list of pieces, optional
        Motion of the target. By default it steps by twice the error that friction at rest can hold.
    until : float or str, optional
        End of the motion (s). By default it ends when the axis rests or its strokes repeat.
    rtol : float
        Relative error allowed per step of numerical integration.
    progress : callable, optional
        Called with the time reached and the number of strokes.

    Returns
    -------
    Hunt

    Raises
    ------
    ParameterError
        If the drive does not hold a position, or the protocol acts on anything but the target.
    NotAvailable
        If a coordinate has no inertia, or a friction law, contact law or dead time is not supported at rest.

    Examples
    --------
    >>> import steadyslip as ss
    >>> axis = ss.rig_from_text('''
    ... friction = {law = "coulomb", mu_coulomb = 1, mu_static = 1.5, viscous = "0.4 s/m"}
    ... contact = {law = "constant", preload = "1 N"}
    ... slider = {area = 1, mass = "1 kg"}
    ... drive = {control = "pid", velocity = 0, kp = "3 N/m", kd = "6 N s/m", ki = "4 N/(m s)"}
    ... ''')
    >>> print(ss.hunt(axis).sentence)
    HUNTS ±65.65 mm about the target every 24.01 s
    """
    if not rig.holds:
        now = format_quantity(*rig.display_value("drive.velocity", float(rig.drive.velocity)))
        control = "rotary-pid" if rig.drive.turns else "pid"
        gains = "" if isinstance(rig.drive, Holding) else f", and control = '{control}' with gains"
        message = f"got {now}; hunting is of a drive that holds a place: write velocity = 0{gains}"
        raise ParameterError([Problem("drive.velocity", message)])
    given = _target(in_units_of(rig, Protocol.of(protocol)))
    plant = plant_of(rig)
    if plant.delay and plant.limits.sample_time is None:
        raise NotAvailable("drive.delay: hunting takes a dead time only together with a sample_time")
    if not given.pieces:
        step = DisplacementStep(at=0.0, by=_usual_step(plant, "deg" if rig.drive.turns else "mm"))
        given = Protocol(pieces=(step,), until=given.until)
    end = until if until is not None else given.until
    motion = Motion(plant, pack(given, 0.0, LONGEST if end is None else end), rtol, rows_of(rig, plant))
    last_change = max((float(t) for t in motion.segments.start[0]), default=0.0)
    close = EXACT if motion.exact else 100 * rtol
    at_rest, used_up, judged = False, False, 0
    for done in motion.run():
        if done is not None and progress is not None:
            progress(motion.time, len(motion.trace.strokes))
        if not motion.changes and motion.at_rest:
            at_rest = True
            break
        used_up = motion.steps >= MOST_STEPS or motion.core.steps >= IN_CORE
        if motion.runs_away or used_up:
            break
        if end is None and done is not None and len(motion.trace.strokes) > (1 + OFTEN) * judged:
            judged = len(motion.trace.strokes)
            own = swings(one for one in motion.trace.strokes if one.start > last_change)
            if _enough(own, motion.sampled) or cycle_length(own, close):
                break
    return replace(_result(rig, given, motion, at_rest, (close, rtol), last_change), stopped=used_up)


def _enough(strokes: Sequence[Stroke], sampled: bool) -> bool:
    """True if the limit of strokes is reached, so that the decision must be made from `strokes`."""
    if not sampled:
        return len(strokes) >= MOST_STROKES
    goes_on = len(strokes) >= SAMPLED_STROKES and _trend(strokes) is True
    return goes_on or len(strokes) >= MOST_SAMPLED_STROKES


def _target(protocol: Protocol) -> Protocol:
    """The protocol itself; raises ParameterError unless it only moves the target, without waves."""
    problems = []
    for number, piece in enumerate(protocol.pieces, start=1):
        if piece.channel != LOAD_POINT or piece.frees_load_point or piece.wave() is not None:
            message = f"{piece.name!r} is not offered: only steps, ramps, holds and tables of the target are"
            problems.append(Problem(f"protocol.pieces.{number}", message))
    if problems:
        raise ParameterError(problems)
    return protocol


def _usual_step(plant: Plant, unit: str) -> float:
    """Twice the error (m or rad) that friction at rest holds against the controller's gain and the springs."""
    gain = sum(np.outer(plant.acts, place) * k for place, (k, _) in zip(plant.places, plant.gains, strict=True))
    pull = plant.acts * sum(k for k, _ in plant.gains) - plant.target_stiffness
    try:
        moved = np.linalg.solve(plant.stiffness + gain, pull)
    except np.linalg.LinAlgError:
        moved = np.full(plant.size, np.nan)
    steady = float(np.abs(plant.force).sum())
    held = sum(friction_at_rest(one, steady) * abs(float(one.row @ moved)) for one in plant.contacts)
    step = 2 * held / float(pull @ moved)
    if not (np.isfinite(step) and step > 0):
        missing = "there is no gain kp or spring" if held else "friction at rest without a load is 0"
        message = (
            f"missing; {missing} from which the size of a step of the target follows: give one, such as "
            f"\"displacement-step at=0s by='1 {unit}'\""
        )
        raise ParameterError([Problem("protocol", message)])
    return float(f"{step:.6g}")  # rounded for display: the exact size of the step does not matter


def cycle_length(strokes: Sequence[Stroke], close: float) -> int:
    """Number of strokes in a cycle, if the last two cycles agree to the relative error `close`; else 0."""
    done = [one for one in strokes if np.isfinite(one.end)]
    for count in range(1, CYCLES + 1):
        if len(done) < 2 * count + 1:
            return 0
        last, before = done[-count - 1 :], done[-2 * count - 1 : -count]
        size = max(abs(one.ends) for one in last)
        period = last[-1].start - last[0].start
        pairs = list(zip(last, before, strict=True))
        same = all(abs(a.ends - b.ends) <= close * size and abs(a.begins - b.begins) <= close * size for a, b in pairs)
        if same and abs(period - (before[-1].start - before[0].start)) <= close * period:
            return count
    return 0


def _result(
    rig: Slider | Machine, protocol: Protocol, motion: Motion, at_rest: bool, errors: tuple[float, float],
    since: float,
) -> Hunt:  # fmt: skip
    """Result of `hunt`; `errors`: tolerance of repetition and rtol, `since`: time (s) of the last change of target."""
    close, rtol = errors
    table, strokes = motion.table(), motion.trace.strokes
    own = swings(one for one in strokes if one.start >= since)
    count = 0 if at_rest or motion.runs_away else cycle_length(own, close)
    period = own[-1].start - own[-1 - count].start if count else np.nan
    scatter, begin, after = 0.0, 0.0, np.inf
    hunts: bool | None = False if at_rest else True if count or motion.runs_away else _trend(own)
    rested = max([since, *(one.end for one in strokes if np.isfinite(one.end))])
    creeps = any(motion.mode.contacts) or bool(motion.plant.memory)
    settled = (motion.time if creeps else rested) if at_rest else np.nan
    if at_rest:
        seen = -motion.watched[0:1] @ motion.state
    elif motion.runs_away:
        seen = motion.farthest * np.array([-1.0, 1.0])
    elif own:
        recent = _recent(own, count, hunts is False)
        seen = -np.array([value for one in recent for value in (one.lowest, one.highest)])
        if hunts and not count and len(recent) > 2:
            period, scatter = _average_period(recent), _scatter(recent)
        begin = recent[0].start
        after = next((one.start for one in own if one.start > recent[-1].start), np.inf)
    else:
        seen = -table[-1:, 1] if len(table) else np.zeros(1)
    late = table[-1:] if at_rest else table[(table[:, 0] >= begin) & (table[:, 0] <= after)]
    ratio, turns = rig.feed()
    force = "N m" if rig.drive.turns else rig.result_unit("Pa")
    return Hunt(
        rig=rig, protocol=protocol, hunts=hunts, lowest=ratio * float(seen.min()), highest=ratio * float(seen.max()),
        period=float(period), repeats=bool(count), runs_away=bool(motion.runs_away),
        strokes=tuple(_at_reported_body(one, ratio) for one in strokes), time=table[:, 0], error=ratio * table[:, 1],
        velocity=ratio * table[:, 2], force=table[:, 3], exact=motion.exact, rtol=rtol, settled_at=float(settled),
        unit="rad" if turns else "m", force_unit=force, version=version(), scatter=ratio * scatter,
        others=() if motion.runs_away else swings_of(rig, late[:, 0], late[:, 4:]),
    )  # fmt: skip


def _recent(strokes: Sequence[Stroke], count: int, shrinks: bool) -> Sequence[Stroke]:
    """Strokes that the result reports: the last two if they shrink, the last cycle of `count`, or the last third.

    The last stroke is left out if there are others: the motion ended before bristles and springs had relaxed.
    """
    if shrinks or len(strokes) < 3:
        return strokes[-2:]
    return strokes[-1 - max(2, count or len(strokes) // 3) : -1]


def _scatter(strokes: Sequence[Stroke]) -> float:
    """Largest difference (m or rad) between the ends of strokes that have the same direction."""
    ends = [[one.ends for one in strokes if (one.ends > one.begins) is way] for way in (True, False)]
    return max(float(np.ptp(own)) for own in ends if own)


def _at_reported_body(stroke: Stroke, ratio: float) -> Stroke:
    """Stroke of the body whose motion is reported, which moves `ratio` times as far as the drive."""
    ways = ("begins", "ends", "fastest", "lowest", "highest")
    return stroke if ratio == 1.0 else replace(stroke, **{name: ratio * getattr(stroke, name) for name in ways})


def _trend(strokes: Sequence[Stroke]) -> bool | None:
    """True if later strokes reach as far as earlier ones, False if they shrink to zero, None if undecided.

    The trend is undecided with fewer than six strokes, and if strokes shrink towards a finite size, as before a cycle;
    that size is extrapolated by Aitken's method.
    """
    if len(strokes) < 6:
        return None
    third = len(strokes) // 3
    parts = strokes[:third], strokes[third : 2 * third], strokes[2 * third :]
    early, middle, late = (max(abs(one.ends) for one in part) for part in parts)
    if late > SHRINKING * middle:
        return True
    bend = (early - middle) - (middle - late)
    limit = late - (middle - late) ** 2 / bend if bend > 0 else 0.0
    return False if limit < (1 - SHRINKING) * late else None


def _average_period(strokes: Sequence[Stroke]) -> float:
    """Average time (s) between starts of strokes in the same direction; NaN without two."""
    starts = [one.start for one in strokes if (one.ends - one.begins) * (strokes[-1].ends - strokes[-1].begins) > 0]
    return float(np.mean(np.diff(starts))) if len(starts) > 1 else np.nan
