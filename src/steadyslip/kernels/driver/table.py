"""The loop of fits: all lanes go through one table of inputs together, with sensitivities (`kernels/lockstep.py`).

A row of `segments` is start, end, jump of the load point, then values and slopes of the inputs.
"""

from __future__ import annotations

import math

import numpy as np

from steadyslip.kernels.driver.jobs import exhausted, load_job
from steadyslip.kernels.driver.segments import begin_segment
from steadyslip.kernels.layout import INPUTS, Array, Layout, Routines, Row, Status, call

INSTANT = 1e-14  # share of the time so far: shorter steps lead nowhere


def enter_row(S: Array, layout: Layout, group: int, k: int, segments: Array, input_rates: Array, places: Array) -> None:
    """Start row k of the table: new inputs, jump of the load point."""
    W = layout.lanes
    for lane in range(W):
        row = segments[min(group + lane, segments.shape[0] - 1), k]
        begin_segment(S, layout, W, lane, row)
        S[(layout.state + layout.x) * W + lane] -= row[2]
        if input_rates.shape[1] > 0:
            own = min(group + lane, input_rates.shape[0] - 1)
            for d in range(layout.directions):
                for i in range(INPUTS):
                    place = places[INPUTS * d + i]
                    if place >= 0:
                        S[(layout.constant + place) * W + lane] = input_rates[own, d, k, i]


def move_nodes(S: Array, layout: Layout, group: int, k: int, node_rates: Array) -> bool:
    """Sensitivities jump where the start of a row moves with a direction: by the difference of the rates there."""
    moved = False
    W, own = layout.lanes, layout.own
    for lane in range(W):
        job = min(group + lane, node_rates.shape[0] - 1)
        for d in range(layout.directions):
            rate = node_rates[job, d, k]
            if rate != 0.0:
                moved = True
                for i in range(own):
                    change = S[(layout.before + i) * W + lane] - S[(layout.rate + i) * W + lane]
                    S[(layout.state + own * (1 + d) + i) * W + lane] += rate * change
    return moved


def cross(S: Array, layout: Layout, routines: Routines, y: Array) -> None:
    """Take every living lane to the end of the row; a motion that runs away in no time at all ends there."""
    W = layout.lanes
    while True:
        waiting = 0
        for lane in range(W):
            if S[Row.TAU * W + lane] < S[Row.END * W + lane]:
                brief = S[Row.H * W + lane] < INSTANT * S[Row.END * W + lane]
                if S[Row.ACTIVE * W + lane] == 0.0 or brief or exhausted(S, W, lane) != Status.RUNNING:
                    S[Row.ACTIVE * W + lane] = 0.0
                    S[Row.TAU * W + lane] = S[Row.END * W + lane]
                else:
                    waiting += 1
        if waiting == 0:
            return
        call(routines.step, S, 0.0, y)


def keep_seen(
    S: Array, layout: Layout, routines: Routines, group: int, k: int, samples: Array, seen: Array, y: Array
) -> None:  # fmt: skip
    """Write down what is observed in every lane that has a sample here."""
    W = layout.lanes
    any_here = False
    for lane in range(W):
        any_here = any_here or samples[min(group + lane, samples.shape[0] - 1), k] >= 0
    if not any_here:
        return
    call(routines.see_lanes, S, 0.0, y)
    for lane in range(W):
        sample = samples[min(group + lane, samples.shape[0] - 1), k]
        if group + lane < seen.shape[0] and sample >= 0:
            for i in range(1 + layout.directions):
                value = S[(layout.seen + i) * W + lane]
                seen[group + lane, i, sample] = value if S[Row.ACTIVE * W + lane] > 0.0 else math.nan


def through_table(
    layout: Layout, routines: Routines, places: Array, constants: Array, initial: Array, settings: Array,
    segments: Array, samples: Array, node_rates: Array, input_rates: Array, seen: Array, steps: Array,
) -> None:  # fmt: skip
    """Take all jobs through the table.

    One row per job, or one shared row: `constants`, `initial` (states), `settings`, `segments` (jobs, k, 9), `samples`
    (jobs, k + 1), the place in `seen` (jobs, 1 + directions, samples) of what is observed at the start of each row and
    at the end, -1 for none. `node_rates` (jobs, directions, k) and `input_rates` (jobs, directions, k, 3) have no
    directions where none moves the table; `places` says where among the constants the rates of the inputs belong.
    """
    W = layout.lanes
    S, y = np.zeros(layout.rows * W), np.empty(2)
    rows = segments.shape[1]
    jobs = seen.shape[0]
    for group in range(0, jobs, W):
        for lane in range(W):  # lanes without a job repeat the last
            load_job(S, layout, W, lane, min(group + lane, jobs - 1), layout.state, constants, initial, settings)
        for k in range(rows):
            for i in range(layout.own * W):
                S[layout.before * W + i] = S[layout.rate * W + i]
            enter_row(S, layout, group, k, segments, input_rates, places)
            call(routines.rates_lanes, S, 0.0, y)
            if k > 0 and node_rates.shape[1] > 0 and move_nodes(S, layout, group, k, node_rates):
                call(routines.rates_lanes, S, 0.0, y)
            keep_seen(S, layout, routines, group, k, samples, seen, y)
            cross(S, layout, routines, y)
        keep_seen(S, layout, routines, group, rows, samples, seen, y)
        for lane in range(W):
            if group + lane < jobs:
                steps[group + lane, 0] = S[Row.ACCEPTED * W + lane]
                steps[group + lane, 1] = S[Row.REJECTED * W + lane]
