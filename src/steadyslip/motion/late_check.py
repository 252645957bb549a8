"""Check of motion with delays: the same run by more variables of every late signal (`steadyslip.model.dead_time`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from steadyslip.motion.result import History
from steadyslip.motion.status import BLOWN_UP

LATE_TOLERANCE = 0.01
"""Largest relative change of slips, their peaks and the times between, or of the range of velocity."""
NAMES = ("slip", "peak_velocity", "recurrence")
FEWEST = 3
"""Slips that must agree before runs part: a slip, and two times between slips."""
STILL = 1e-6  # range of velocity over the largest below which a motion counts as steady: ten times the default rtol


def late_error(run: History, finer: History) -> float:
    """Relative difference of two histories in slip events and range of velocity; infinite if they differ in kind."""
    if run.status != finer.status:
        return np.inf
    found = [abs(run.end - finer.end) / run.end]
    if run.status != BLOWN_UP:  # where the highest velocity is that of the last step
        first, second = _extremes(run), _extremes(finer)
        moving = np.maximum(np.ptp(first, axis=1), STILL * np.abs(first).max(axis=1))
        found.append(float(np.max(np.abs(first - second) / moving[:, None])))
    events, others = run.slip_events, finer.slip_events
    if abs(len(events) - len(others)) > 1:  # one may begin or end with the run
        return np.inf
    for one, other in zip(events, others, strict=False):
        found += [float(_apart(getattr(one, name), getattr(other, name))) for name in NAMES]
    return max(found)


def parts_anyway(run: History, finer: History, closer: History) -> bool:
    """True if single slips cannot be repeated, as in chaotic motion, whatever is done about the delay.

    `finer` has more variables of every late signal, `closer` a smaller rtol. The first slips agree with both; with the
    former for half as long, at least, as with the latter.
    """
    alike = _alike(run, finer)
    own = min(len(run.slip_events), len(closer.slip_events))
    return alike >= FEWEST and _alike(run, closer) < own and 2 * alike >= _alike(run, closer)


def _alike(run: History, other: History) -> int:
    """Number of leading slip events that agree in both runs within `LATE_TOLERANCE`."""
    count = 0
    for one, two in zip(run.slip_events, other.slip_events, strict=False):
        if max(float(_apart(getattr(one, name), getattr(two, name))) for name in NAMES) > LATE_TOLERANCE:
            break
        count += 1
    return count


def late_errors(events: Mapping[str, np.ndarray], finer: Mapping[str, np.ndarray]) -> np.ndarray:
    """Relative difference of the event statistics of runs, (runs,); see `late_error`."""
    found: list[np.ndarray] = []
    for name, own in events.items():
        what, other = name.rpartition(".")[2], finer[name]
        if what in ("event_slip", "event_peak_velocity", "recurrence"):
            same = events[name.removesuffix(what) + "events"] == finer[name.removesuffix(what) + "events"]
            found.append(np.where(same, _apart(own, other), 0.0))
        if what == "events":
            found.append(np.where(np.abs(own - other) > 1, np.inf, 0.0))
        if what == "peak_velocity":
            found.append(_apart(own, other))
    return np.asarray(np.max(found, axis=0))


def _extremes(run: History) -> np.ndarray:
    """Lowest and highest velocity of every contact, (contacts, 2)."""
    return np.array(list(run.velocities.values()) if isinstance(run.velocities, dict) else [run.velocities])


def _apart(one: float | np.ndarray, other: float | np.ndarray) -> np.ndarray:
    """Relative difference; 0 where both are missing or zero, infinite where one is."""
    with np.errstate(all="ignore"):
        apart = np.abs(np.subtract(one, other)) / np.abs(one)
    neither = (np.isnan(one) & np.isnan(other)) | (np.equal(one, other))
    return np.where(neither, 0.0, np.where(np.isfinite(apart), apart, np.inf))
