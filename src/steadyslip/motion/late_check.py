"""Check of runs with delays against runs with more variables of each delayed signal (`steadyslip.model.dead_time`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from steadyslip.motion.result import History
from steadyslip.motion.status import BLOWN_UP

LATE_TOLERANCE = 0.01
"""Largest relative change allowed of slips, their peaks and the times between them, or of the range of velocity."""
NAMES = ("slip", "peak_velocity", "recurrence")
FEWEST = 3
"""Least number of first slip events that must agree in irregular motion; between three lie two recurrence times."""
STILL = 1e-6  # motion is steady if velocity varies by less than this share of its largest value: ten times default rtol


def late_error(run: History, finer: History) -> float:
    """Relative difference of two histories in slip events and range of velocity; infinite if they differ in kind."""
    if run.status != finer.status:
        return np.inf
    found = [abs(run.end - finer.end) / run.end]
    if run.status != BLOWN_UP:  # in a blow-up the highest velocity depends on the last step
        first, second = _extremes(run), _extremes(finer)
        moving = np.maximum(np.ptp(first, axis=1), STILL * np.abs(first).max(axis=1))
        found.append(float(np.max(np.abs(first - second) / moving[:, None])))
    events, others = run.slip_events, finer.slip_events
    if abs(len(events) - len(others)) > 1:  # one event may be cut off by the start or end of the run
        return np.inf
    for one, other in zip(events, others, strict=False):
        found += [float(_apart(getattr(one, name), getattr(other, name))) for name in NAMES]
    return max(found)


def parts_anyway(run: History, finer: History, closer: History) -> bool:
    """True if slip events change with any change of accuracy, as in chaotic motion, not only with that of the delay.

    `finer` is the run with more variables for every delayed signal, `closer` the run with a smaller rtol. The result is
    True if the first slip events of `run` agree with `closer`, but not all of them, and at least half as many with
    `finer`.
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
    """Relative difference of two values; 0 where both are NaN or equal, infinite where only one is NaN or zero."""
    with np.errstate(all="ignore"):
        apart = np.abs(np.subtract(one, other)) / np.abs(one)
    neither = (np.isnan(one) & np.isnan(other)) | (np.equal(one, other))
    return np.where(neither, 0.0, np.where(np.isfinite(apart), apart, np.inf))
