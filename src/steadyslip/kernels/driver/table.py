"""Loop for fits: all lanes follow one table of inputs row by row, with sensitivities (`kernels/experiment.py`).

A row of `segments` is start, end, jump of the load point, then values and slopes of the inputs. All jobs are observed
at the same times. Each lane takes steps of its own size and interpolates at the times within them. If there are fewer
jobs than lanes, several lanes integrate the same job, and each observes some of the times.
"""

from __future__ import annotations

import math

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.jobs import exhausted, load_job
from steadyslip.kernels.driver.segments import begin_segment
from steadyslip.kernels.layout import Layout, Routines, Row, Status, call

INSTANT = 1e-14  # shortest step over the length of the row, about 50 roundings of time; shorter ones mean blow-up


def lanes_of_job(layout: Layout, count: int, lane: int) -> int:
    """Number of lanes that integrate the same job as the given lane, if there are `count` jobs."""
    return (layout.lanes - 1 - lane % count) // count + 1


def enter_row(
    S: Array, layout: Layout, group: int, count: int, k: int, segments: Array, times: Array, input_rates: Array,
    places: Array,
) -> None:  # fmt: skip
    """Enter row k of the table in all lanes: inputs, jump of the load point, time of the next sample."""
    W = layout.lanes
    for lane in range(W):
        job = group + lane % count
        row = segments[min(job, segments.shape[0] - 1), k]
        begin_segment(S, layout, W, lane, row)
        S[(layout.state + layout.x) * W + lane] -= row[2]
        schedule_table_sample(S, W, lane, times, k == segments.shape[1] - 1)
        if input_rates.shape[1] > 0:
            own = min(job, input_rates.shape[0] - 1)
            for d in range(layout.directions):
                for i in range(layout.inputs):
                    place = places[layout.inputs * d + i]
                    if place >= 0:
                        S[(layout.constant + place) * W + lane] = input_rates[own, d, k, i]


def schedule_table_sample(S: Array, lanes: int, lane: int, times: Array, is_last: bool) -> None:
    """Set the time of a lane's next sample from the start of the row; infinite if it is not in this row.

    A sample at the end of a row belongs to the next row.
    """
    S[Row.NEXT_TIME * lanes + lane] = math.inf
    k = int(S[Row.NEXT_SAMPLE * lanes + lane])
    if k < times.shape[0]:
        stop = S[Row.STOP * lanes + lane]
        if times[k] < stop or (is_last and times[k] <= stop):
            S[Row.NEXT_TIME * lanes + lane] = times[k] - S[Row.START * lanes + lane]


def shift_sensitivities(S: Array, layout: Layout, group: int, count: int, k: int, node_rates: Array) -> bool:
    """Shift sensitivities by the change of rates at the start of row k, if that time depends on a direction.

    Returns True if any sensitivity was shifted.
    """
    moved = False
    W, own = layout.lanes, layout.own
    for lane in range(W):
        job = min(group + lane % count, node_rates.shape[0] - 1)
        for d in range(layout.directions):
            rate = node_rates[job, d, k]
            if rate != 0.0:
                moved = True
                for i in range(own):
                    change = S[(layout.rate_before + i) * W + lane] - S[(layout.rate + i) * W + lane]
                    S[(layout.state + own * (1 + d) + i) * W + lane] += rate * change
    return moved


def finish_row(
    S: Array, layout: Layout, routines: Routines, group: int, count: int, times: Array, is_last: bool, seen: Array,
    y: Array,
) -> None:  # fmt: skip
    """Integrate all active lanes to the end of the row; a lane whose steps become too small stops."""
    W = layout.lanes
    while True:
        waiting = 0
        for lane in range(W):
            if S[Row.TAU * W + lane] < S[Row.LENGTH * W + lane]:
                brief = S[Row.H * W + lane] < INSTANT * S[Row.LENGTH * W + lane]
                if S[Row.ACTIVE * W + lane] == 0.0 or brief or exhausted(S, W, lane) != Status.RUNNING:
                    S[Row.ACTIVE * W + lane] = 0.0
                    S[Row.TAU * W + lane] = S[Row.LENGTH * W + lane]
                else:
                    waiting += 1
        if waiting == 0:
            return
        call(routines.step, S, 0.0, y)
        passed = lanes_due(S, W)
        if passed > 0:
            call(routines.extend_lanes, S, 0.0, y)
        while passed > 0:
            call(routines.look_lanes, S, 0.0, y)
            passed = store_samples(S, layout, group, count, times, is_last, seen)


def lanes_due(S: Array, lanes: int) -> int:
    """Number of active lanes that have passed their next sample."""
    found = 0
    for lane in range(lanes):
        if S[Row.NEXT_TIME * lanes + lane] <= S[Row.TAU * lanes + lane] and S[Row.ACTIVE * lanes + lane] > 0.0:
            found += 1
    return found


def store_samples(S: Array, layout: Layout, group: int, count: int, times: Array, is_last: bool, seen: Array) -> int:
    """Store observable and derivatives of lanes that are due; returns the number of lanes due again in this step."""
    W, passed = layout.lanes, 0
    for lane in range(W):
        if S[Row.NEXT_TIME * W + lane] <= S[Row.TAU * W + lane] and S[Row.ACTIVE * W + lane] > 0.0:
            sample = int(S[Row.NEXT_SAMPLE * W + lane])
            for i in range(1 + layout.directions):
                seen[group + lane % count, i, sample] = S[(layout.observable + i) * W + lane]
            S[Row.NEXT_SAMPLE * W + lane] = sample + lanes_of_job(layout, count, lane)
            schedule_table_sample(S, W, lane, times, is_last)
            if S[Row.NEXT_TIME * W + lane] <= S[Row.TAU * W + lane]:
                passed += 1
    return passed


def through_table(
    layout: Layout, routines: Routines, places: Array, constants: Array, initial: Array, settings: Array,
    segments: Array, times: Array, node_rates: Array, input_rates: Array, seen: Array, steps: Array,
) -> None:  # fmt: skip
    """Integrate all jobs through the table.

    `constants`, `initial` (states), `settings` and `segments` (jobs, k, 9) have one row per job or one row for all. At
    `times` (samples,) the observable and its derivatives are written to `seen` (jobs, 1 + directions, samples); entries
    of a motion that stops early stay unchanged. `node_rates` (jobs, directions, k) and `input_rates` (jobs, directions,
    k, 3) are the derivatives of breakpoint times and inputs; their second axis has length 0 if no direction changes the
    table. `places` has the indices of the rates of inputs among the constants. The numbers of accepted and rejected
    steps are written to `steps` (jobs, 2).
    """
    W = layout.lanes
    S, y = np.zeros(layout.rows * W), np.empty(2)
    rows = segments.shape[1]
    jobs = seen.shape[0]
    for group in range(0, jobs, W):
        count = min(W, jobs - group)
        for lane in range(W):
            load_job(S, layout, W, lane, group + lane % count, layout.state, constants, initial, settings)
            S[Row.NEXT_SAMPLE * W + lane] = lane // count
        for k in range(rows):
            is_last = k == rows - 1
            for i in range(layout.own * W):
                S[layout.rate_before * W + i] = S[layout.rate * W + i]
            enter_row(S, layout, group, count, k, segments, times, input_rates, places)
            call(routines.rates_lanes, S, 0.0, y)
            if k > 0 and node_rates.shape[1] > 0 and shift_sensitivities(S, layout, group, count, k, node_rates):
                call(routines.rates_lanes, S, 0.0, y)
            if lanes_due(S, W) > 0:
                call(routines.see_lanes, S, 0.0, y)
                store_samples(S, layout, group, count, times, is_last, seen)
            finish_row(S, layout, routines, group, count, times, is_last, seen, y)
        for lane in range(count):
            steps[group + lane, 0] = S[Row.ACCEPTED * W + lane]
            steps[group + lane, 1] = S[Row.REJECTED * W + lane]
