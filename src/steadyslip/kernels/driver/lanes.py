"""Loop for single runs and ensembles: each lane integrates its own job, with its own breakpoints."""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.jobs import serve_lane
from steadyslip.kernels.driver.places import output_size
from steadyslip.kernels.driver.samples import BETWEEN
from steadyslip.kernels.layout import GROUP, Cursor, Layout, Routines, Row, Setting, call

LOGGED_AT_ONCE = 20  # most rows per contact that one call of `serve_lane` may add to the log: two per kind of event


def flagged(S: Array, lanes: int) -> int:
    """Number of lanes whose flag is set."""
    count = 0
    for lane in range(lanes):
        count += 1 if S[Row.FLAG * lanes + lane] != 0.0 else 0
    return count


def watch(layout: Layout, routines: Routines, S: Array, y: Array) -> None:
    """Search for frequent events in each group of lanes in which a flag is set."""
    for first in range(0, layout.lanes, GROUP):
        for lane in range(first, first + GROUP):
            if S[Row.FLAG * layout.lanes + lane] != 0.0:
                call(routines.watch_group, S, float(first), y)
                break


def advance(
    layout: Layout, routines: Routines, S: Array, ids: Array, cursor: Array, constants: Array, initial: Array,
    settings: Array, segments: Array, times: Array, statuses: Array, final: Array, tally: Array, samples: Array,
    log: Array, recorded: Array, quota: int,
) -> int:  # fmt: skip
    """Integrate the jobs from `Cursor.NEXT_JOB` to before `Cursor.LAST_JOB`.

    Returns
    -------
    int
        0 if all are done, 1 if the buffer of the log or of steps is full, 2 after `quota` steps; call again to go on.
    """
    arrays = (constants, initial, settings, segments, times)
    results = (statuses, final, tally, samples, log, recorded)
    lanes = layout.lanes
    y, order = np.empty(output_size(layout)), np.empty((layout.events, 2))
    R = S if lanes == 1 else np.zeros(layout.rows)
    together = layout.watched > 0 and log.shape[0] == 0 and settings[0, Setting.WATCH] > 0.0
    steps = 0
    if cursor[Cursor.PAUSED] < 0:
        for lane in range(lanes):
            ids[lane] = -1
            S[Row.FLAG * lanes + lane] = 1.0
        cursor[Cursor.PAUSED] = 1
    while cursor[Cursor.BUSY] > 0:
        if cursor[Cursor.PAUSED] == 0:
            call(routines.step, S, 0.0, y)
            steps += 1
        cursor[Cursor.PAUSED] = 0
        attention = flagged(S, lanes)
        if attention > 0 and together:
            watch(layout, routines, S, y)
            attention = flagged(S, lanes)
        if attention > 0:
            if (
                log.shape[0] > 0 and cursor[Cursor.LOGGED] + LOGGED_AT_ONCE * lanes * layout.contacts > log.shape[0]
            ) or (recorded.shape[0] > 0 and cursor[Cursor.RECORDED] + (4 + BETWEEN) * lanes > recorded.shape[0]):
                cursor[Cursor.PAUSED] = 1
                return 1
            for lane in range(lanes):
                if S[Row.FLAG * lanes + lane] != 0.0:
                    if lanes > 1:
                        for i in range(layout.rows):
                            R[i] = S[i * lanes + lane]
                    serve_lane(R, layout, routines, lane, ids, cursor, arrays, results, y, order)
                    if lanes > 1:
                        for i in range(layout.rows):
                            S[i * lanes + lane] = R[i]
        if steps >= quota:
            return 2
    return 0
