"""Find closed orbits near the ends of many runs by Newton's method, and their stability from multipliers.

This module searches for orbits of one slip event, or one turn; `orbits.cycle_from_motion` searches for longer orbits,
run by run.

The flow over one period and its derivative are computed by runs side by side: one from the state itself, and two for
each variable (central differences). That is less accurate than the variational equations of `orbits.flow`, but enough
to distinguish attraction from repulsion, and it uses the kernel of the runs. `orbits.shooting` would compile a kernel
with sensitivities for each model and solve for one cycle at a time; here dozens are solved for together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.runner import STATUSES
from steadyslip.nonlinear.inner_coordinates import inner_count
from steadyslip.nonlinear.kicks.field import rates_at
from steadyslip.nonlinear.kicks.spans import MotionBatch, advanced_runs, constant_inputs
from steadyslip.nonlinear.orbits.cycle_from_motion import cycle_near
from steadyslip.nonlinear.orbits.flow import FlowRunner

BESIDE = 1e-4  # step of finite differences, in natural sizes
MOST_COMPILED = 18  # largest number of variables times contacts of a rig with structures: 15 take 3 CPU s to compile
ROUNDS = 8  # limit of Newton iterations
CLOSED = 1e-6  # an orbit is closed if the start and the end of a period are closer than this, in natural sizes
LOOSE = 1e3  # or if start and end are closer than this multiple of the relative integration tolerance
ATTRACTS = 1e-3  # smallest distance of multipliers from 1 that finite differences resolve
WORTH = 0.1  # error of the trivial multiplier above which the other multipliers are not used
ON = 0.05  # largest distance of the run from the orbit, as a share of the orbit's size
PRECISE = 0.01  # allowed error of the orbit, as a share of its size
AWAY = 1e-3  # an orbit closer to steady sliding than this (natural sizes) is not distinguished from steady sliding
DONE = STATUSES.index("done")


def on_long_cycle(runs: MotionBatch, one: int, state: Array, unknowns: Array) -> bool:
    """True if the run of index `one`, now at `state` (n,), is on an attracting cycle of several slip events or turns.

    `unknowns` (u,) solve the algebraic equations at `state`, NaN where they are not known. False for structures whose
    variational equations take long to compile.
    """
    which, rest = np.array([one]), runs.rest
    model = rest.reduction.model
    if inner_count(model) and len(state) * len(model.contacts) > MOST_COMPILED:
        return False
    inputs = constant_inputs(
        np.ones(1), rest.velocity[which], np.zeros(1), rest.pressure[which], rest.force[which]
    )  # fmt: skip
    jobs = replace(runs.repeated(one, 1).jobs, segments=inputs)
    cycle = cycle_near(FlowRunner(jobs, contact=rest.contact), state, unknowns=unknowns) if jobs.posed[0] else None
    return cycle is not None and cycle.growth < 1 - ATTRACTS


@dataclass
class _Turn:
    """One period of k runs: final state (k, n) and its derivative in the initial one (k, n, n), natural sizes."""

    end: Array
    derivative: Array
    good: Array


def attracted(
    runs: MotionBatch, which: Array, states: Array, unknowns: Array, period: Array, threads: int | None = None
) -> tuple[Array, Array]:
    """True (k,) for runs on an attracting closed orbit, and True (k,) for runs close to any closed orbit.

    Runs `which` (k,) are at `states` (k, n), orbits have about the `period` (k,), s. `unknowns` (k, u) solve the
    algebraic equations at the states, NaN where they are not known.
    """
    rest = runs.rest.part(which)
    scale, n = rest.scales, states.shape[1]
    y, log_period = states / scale, np.log(period)
    speed = rates_at(rest, states[:, None, :])[:, 0] / scale
    size = np.linalg.norm(speed, axis=1)
    alive = np.isfinite(size) & (size > 0)
    ahead = np.where(alive[:, None], speed / np.where(alive, size, 1.0)[:, None], 0.0)
    found, back = np.zeros(len(which), dtype=bool), np.zeros(len(which), dtype=bool)
    tolerance = max(CLOSED, LOOSE * runs.jobs.options.rtol)
    start, steady = y.copy(), rest.state / scale
    for attempt in range(ROUNDS):
        here = np.flatnonzero(alive)
        if not len(here):
            break
        at, near = y[here] * scale[here], unknowns[here]
        turn = _turned(runs, which[here], at, near, scale[here], np.exp(log_period[here]), threads)
        arrival = rates_at(rest.part(here), (turn.end * scale[here])[:, None, :])[:, 0] / scale[here]
        missed = turn.end - y[here]
        weight = 1 + np.abs(y[here])
        off = np.max(np.abs(missed) / weight, axis=1)
        margin = _attraction(turn.derivative, arrival)
        size = np.max(np.abs(y[here] - steady[here]), axis=1)
        size = np.where(np.isfinite(size), np.minimum(size, 1.0), 1.0)
        if attempt == 0:
            back[here] = turn.good & (off < ON * size)
        close = turn.good & (off < tolerance) & ((off < PRECISE * margin * size) | (margin <= 0))
        found[here[close]] = (margin > 0)[close] & (size > AWAY)[close]
        near = np.max(np.abs(y[here] - start[here]) / (1 + np.abs(start[here])), axis=1) < ON * size
        found[here[close & ~near]] = False
        alive[here[close | ~turn.good]] = False
        go = np.flatnonzero(turn.good & ~close)
        if not len(go):
            break
        matrix = np.zeros((len(go), n + 1, n + 1))
        matrix[:, :n, :n] = turn.derivative[go] - np.eye(n)
        matrix[:, :n, n] = arrival[go] * np.exp(log_period[here[go]])[:, None]
        matrix[:, n, :n] = ahead[here[go]]
        right = np.zeros((len(go), n + 1))
        right[:, :n] = -missed[go]
        right[:, n] = -np.sum(ahead[here[go]] * (y[here[go]] - start[here[go]]), axis=1)
        usable = np.all(np.isfinite(matrix), axis=(1, 2))
        change = np.zeros((len(go), n + 1))
        for i in np.flatnonzero(usable):
            change[i] = np.linalg.lstsq(matrix[i], right[i], rcond=None)[0]
        usable &= np.all(np.abs(change) < 1, axis=1)
        y[here[go]] += change[:, :n]
        log_period[here[go]] += change[:, n]
        alive[here[go[~usable]]] = False
    return found, back


def _turned(
    runs: MotionBatch, which: Array, states: Array, unknowns: Array, scale: Array, period: Array, threads: int | None
) -> _Turn:
    """One period from k states, with derivatives by central differences."""
    count, n = states.shape
    beside = BESIDE * np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)])  # (2n+1, n)
    many = (states[:, None, :] + scale[:, None, :] * beside[None]).reshape(-1, n)
    repeat = np.repeat(np.arange(count), 2 * n + 1)
    ended = advanced_runs(runs, which[repeat], many, period[repeat], False, threads, unknowns=unknowns[repeat])
    ends = ended.state.reshape(count, 2 * n + 1, n) / scale[:, None, :]
    good = np.all(ended.status.reshape(count, -1) == DONE, axis=1) & np.all(np.isfinite(ends), axis=(1, 2))
    derivative = (ends[:, 1 : n + 1] - ends[:, n + 1 :]).transpose(0, 2, 1) / (2 * BESIDE)
    return _Turn(ends[:, 0], derivative, good)


def _attraction(derivative: Array, ahead: Array) -> Array:
    """Distance (k,) of the largest multiplier except the trivial one from the unit circle, inwards; 0 if uncertain.

    `ahead` (k, n) are the rates. Their direction, which the flow maps to itself, is deflated first: together with the
    trivial multiplier, another one near 1 would be a double one and lose half of its digits. The error of the trivial
    multiplier estimates that of the finite differences.
    """
    found = np.zeros(len(derivative))
    for i, (matrix, rate) in enumerate(zip(derivative, ahead, strict=True)):
        if not (np.all(np.isfinite(rate)) and np.all(np.isfinite(matrix)) and np.any(rate)):
            continue
        basis = np.linalg.qr(rate[:, None] / np.linalg.norm(rate), mode="complete")[0]
        turned = basis.T @ matrix @ basis
        error = max(abs(turned[0, 0] - 1), float(np.max(np.abs(turned[1:, 0]), initial=0.0)))
        largest = np.max(np.abs(np.linalg.eigvals(turned[1:, 1:])), initial=0.0)
        if error < WORTH and largest < 1 - max(ATTRACTS, error):
            found[i] = 1 - largest
    return found
