"""Simulation of one run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import DURATION, TIMES, checked
from steadyslip.kernels.layout import Final, Recorded, Sampled
from steadyslip.kernels.runner import TALLY, Runner
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.delay_order import finer_order
from steadyslip.model.point import OperatingPoint
from steadyslip.model.sliding import steady_state
from steadyslip.motion.engine import Outcome, run_single
from steadyslip.motion.events import AnyEvent, event_of, events_of
from steadyslip.motion.jobs import Jobs, Options, prepare
from steadyslip.motion.late_check import LATE_TOLERANCE, late_error, parts_anyway
from steadyslip.motion.observe import observable_units, observe, out_of_range
from steadyslip.motion.result import History
from steadyslip.motion.status import BLOWN_UP, LOST, UNRESOLVED, WORDS, ending_contact, remedy
from steadyslip.protocol import Protocol
from steadyslip.protocol.inputs import segment_of

CLOSER = 0.1  # factor on rtol for a third run, if the second run, with more variables for delayed signals, differs
OWN_STEPS = 500_000
"""Limit of steps of a run that records its steps: a point takes 100 bytes, and order 8 records four per step."""


@checked(until=DURATION, times=TIMES)
def simulate(
    rig: Slider | Machine,
    protocol: Any = None,
    *,
    until: float | str | None = None,
    initial: Mapping[str, float] | None = None,
    times: Any = None,
    events: bool = True,
    method: str = "auto",
    rtol: float = 1e-7,
    most_steps: int | None = None,
    arrest: float = 1e-3,
    branch: int = 0,
    progress: Callable[[float], None] | None = None,
) -> History:
    """Motion of a rig in time, under a protocol.

    Parameters
    ----------
    rig : Slider or Machine
    protocol : Protocol, Piece or sequence of Piece, optional
        Motion of load point, normal stress and disturbance; by default steady motion of the drive.
    until : float or str, optional
        End, s, or text such as ``"200 s"``; by default the protocol's own.
    initial : mapping of str to float or str, optional
        Starting values that differ from steady sliding, in SI units or as text: ``x``, ``v`` and the memory variables
        of the friction law (names as in ``build_model(rig)``). Without mass, velocity follows from the memory:
        give one of the two (a given ``v`` adjusts the first memory variable that is not given).
    times : array_like, optional
        Rising times at which to report, s; by default the solver's own steps, with three points within each step of
        order 8. At a jump, the value after it.
    events : bool, optional
        True to locate events.
    method : str, optional
        ``explicit``, ``rosenbrock``, a method's own name, or ``auto``: explicit for massless rate-and-state models,
        which are not stiff in ln v (of order 8 where `rtol` is 1e-5 or less), Rosenbrock for everything else.
    rtol : float, optional
        Error allowed per step, relative to the size of each variable or to its scale (1 for ln v).
    most_steps : int, optional
        Limit of steps; by default 10 million, or half a million where the solver's own steps are recorded, which stay
        in memory.
    arrest : float, optional
        Share of the drive velocity below which the block counts as arrested.
    branch : int, optional
        Index of the steady sliding to start from, by rising normal stress, where a rig has several.
    progress : callable, optional
        Called with the time reached, s, while the run goes on.

    Returns
    -------
    History
        Its `status` is the reason for which the run ended. A run that cannot go on, or that Ctrl-C stops
        (``interrupted``), has the motion up to its end.

    Raises
    ------
    ParameterError
        If any argument is wrong; lists every problem.
    NoSteadySliding
        If there is no steady sliding to start from.
    NotAvailable
        If the rig's motion is ill-posed, or its laws or drive exclude the run.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> run = ss.simulate(rig, ss.protocol.VelocityStep(at="10 s", to="2 um/s"), until=200)
    >>> run.status, round(float(run["v"][-1]) * 1e6, 2)
    ('done', 2.0)
    """
    most = most_steps or (OWN_STEPS if times is None else Options.most_steps)
    options = Options(method, rtol, most, arrest)
    plan = in_units_of(rig, Protocol.of(protocol))
    run, order = _simulated(rig, plan, until, times, initial, events, options, branch, progress)
    if not order or run.status == "interrupted":
        return run

    def again(**changed: Any) -> History:
        return _simulated(rig, plan, until, times, initial, True, replace(options, **changed), branch)[0]

    finer = again(order=finer_order(order))
    error = late_error(run, finer)
    if error > LATE_TOLERANCE and run.status == finer.status and parts_anyway(run, finer, again(rtol=CLOSER * rtol)):
        return replace(run, late_error=math.inf)
    return replace(run, late_error=error, status=UNRESOLVED if error > LATE_TOLERANCE else run.status)


def _simulated(
    rig: Slider | Machine, plan: Protocol, until: float | str | None, times: Any, initial: Mapping[str, Any] | None,
    events: bool, options: Options, branch: int, progress: Callable[[float], None] | None = None,
) -> tuple[History, int]:  # fmt: skip
    """History of a run, and the number of variables of each delayed signal (0 without delays)."""
    jobs = prepare(rig, plan, until, {}, initial or {}, options, branch)
    events = events or jobs.late_order > 0
    if not jobs.exists[0]:
        steady_state(rig)  # raises NoSteadySliding with the reason
    if not jobs.posed[0]:
        raise NotAvailable(f"the motion of this rig is ill-posed: {remedy('ill-posed', rig)}")
    final = float(jobs.segments.end.max())
    requested = checked_times(times, final)
    machine = jobs.runner(lanes=1, dense=True)
    outcome = run_single(jobs, machine, requested, watch=events, record=times is None, progress=progress)
    run = _history(rig, _with_end(plan, final), jobs, machine, outcome, requested, times is None)
    return run, jobs.late_order


@lru_cache(maxsize=32)
def _with_end(plan: Protocol, until: float) -> Protocol:
    """Copy of the protocol that ends at `until` (s)."""
    return plan if plan.until == until else replace(plan, until=until)


def checked_times(times: Any, until: float) -> np.ndarray:
    """Requested times (n,), s, as an array; empty for None.

    Raises
    ------
    ParameterError
        If times do not rise, or lie outside the run.
    """
    if times is None:
        return np.empty(0)
    try:
        array = np.ascontiguousarray(np.atleast_1d(np.asarray(times, dtype=float)))
    except (TypeError, ValueError):
        array = np.array([np.nan])
    good = array.ndim == 1 and np.all(np.isfinite(array)) and np.all(np.diff(array) >= 0)
    if not good or (len(array) and (array[0] < 0 or array[-1] > until * (1 + 1e-12))):
        message = f"got {np.array2string(array, threshold=6)}; allowed: rising times in s from 0 to {until!r}"
        raise ParameterError([Problem("times", message)])
    return np.asarray(np.minimum(array, until))


def _history(
    rig: Slider | Machine,
    plan: Protocol,
    jobs: Jobs,
    machine: Runner,
    outcome: Outcome,
    requested: np.ndarray,
    own: bool,
) -> History:
    """History from the outcome of a run; `own` is True if the solver's steps were recorded."""
    status = WORDS[int(outcome.status[0])]
    steps, end = outcome.steps[0], float(outcome.final[0, Final.TIME])
    if own:
        own_steps = outcome.recorded
        time, segment = own_steps[:, Recorded.TIME], own_steps[:, Recorded.SEGMENT].astype(int)
        points = own_steps[:, Recorded.POINT :]
    else:
        reached = np.isfinite(outcome.samples[0, :, Sampled.STATE])
        time, points = requested[reached], outcome.samples[0][reached]
        segment = segment_of(jobs.segments, np.zeros(len(time), dtype=int), time)
    lane = np.zeros(len(time), dtype=int)
    found = observe(jobs, machine, 0, lane, segment, time, points, outcome.tables)
    model = machine.reduction.model
    units = {"t": "s"} | observable_units(model, jobs.targets)
    contacts = tuple(contact.name for contact in model.contacts)
    surfaces = _surfaces(jobs.point)
    events = events_of(outcome.log, contacts, surfaces)
    if status in (BLOWN_UP, LOST) and not any(event.kind == status for event in events):
        events += (_last_event(status, jobs, machine, outcome, surfaces),)
    if np.any(bad := out_of_range(found)):
        first = int(np.argmax(bad))
        if status == "done":
            status, end = "out of range", float(time[first])
        time = time[:first]
        found = {name: values[:first] for name, values in found.items()}
        events = tuple(event for event in events if event.time <= end)
    return History(
        rig=rig,
        protocol=plan,
        data={"t": time} | {name: found[name] for name in units if name in found},
        units=units,
        events=events,
        status=status,
        end=end,
        method=machine.choice.method,
        rtol=jobs.options.rtol,
        steps=int(steps[0]),
        rejected=int(steps[1]),
        velocities=_velocities(outcome, contacts, found, events),
    )


@cached
def _surfaces(point: OperatingPoint) -> tuple[float, ...]:
    return tuple(float(area) for area in point.evaluate(areas(point.model)))


@cached
def areas(model: Model) -> ArrayFunction:
    """Compiled function: areas of the contacts, m² (forces are stresses times areas) (cached)."""
    return model.function(contact.area for contact in model.contacts)


def _velocities(
    outcome: Outcome, contacts: tuple[str, ...], found: dict[str, np.ndarray], events: tuple[AnyEvent, ...]
) -> tuple[float, float] | dict[str, tuple[float, float]]:
    """Lowest and highest velocity (m/s) of a run, for a machine by contact; from samples, events and statistics."""
    each: dict[str, tuple[float, float]] = {}
    for i, name in enumerate(contacts):
        first, samples = i * len(TALLY), found[f"{name}.slip_rate" if name else "v"]
        known = [float(outcome.tally[0, first + TALLY.index(of)]) for of in ("lowest_velocity", "peak_velocity")]
        known += [float(samples.min()), float(samples.max())] if len(samples) else []
        known += [e.velocity for e in events if e.contact == name]
        finite = [v for v in known if math.isfinite(v)]
        each[name] = (min(finite), max(finite)) if finite else (math.nan, math.nan)
    return each if contacts[0] else each[""]


def _last_event(kind: str, jobs: Jobs, machine: Runner, outcome: Outcome, surfaces: tuple[float, ...]) -> AnyEvent:
    """Event at the early end of a run; for a machine, at the contact that is lost or, in a blow-up, the fastest."""
    zero, final = np.zeros(1, dtype=int), outcome.final[0]
    segment, time = final[[Final.SEGMENT]].astype(int), final[[Final.TIME]]
    found = observe(jobs, machine, 0, zero, segment, time, outcome.point, outcome.tables)
    names = [contact.name for contact in machine.reduction.model.contacts]
    if not names[0]:
        wanted = ("v", "normal_stress", "shear_stress", "spring_stress", "slip")
        return event_of(kind, "", 1.0, [float(time[0]), *(float(found[name][0]) for name in wanted)])
    stresses, rates = ([found[f"{name}.{what}"] for name in names] for what in ("normal_stress", "slip_rate"))
    place = int(ending_contact(jobs.point, kind, stresses, rates)[0])
    wanted = ("slip_rate", "normal_stress", "shear_stress", "spring_stress", "slip")
    numbers = [float(found[f"{names[place]}.{name}"][0]) for name in wanted]
    return event_of(kind, names[place], surfaces[place], [float(time[0]), *numbers])
