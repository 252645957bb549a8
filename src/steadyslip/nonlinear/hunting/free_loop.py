"""Test of a controller for instability without any friction, and changes of its gains that make it stable.

Friction at rest may hide the instability: then neither the verdict on sliding nor a simulation shows its cause.
"""

from __future__ import annotations

import cmath
import itertools
import math
import warnings
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from steadyslip.core.errors import IllPosedWarning, NotAvailable, ParameterError, UndecidedWarning
from steadyslip.core.format import format_quantity
from steadyslip.kernels.driver.holding import wanted_force
from steadyslip.laws.friction import weakest
from steadyslip.linear import eigenvalues, stability
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import Limits
from steadyslip.machine.slider import Slider
from steadyslip.model.numeric import has_response
from steadyslip.nonlinear.hunting.held_modes import HeldMode, HeldPiece
from steadyslip.nonlinear.hunting.plant import Array, Plant, free_plant

GROWS = 1e-6  # a root grows if its real part over its size (sampled: size − 1) exceeds this; rounding is smaller
NOTHING = 1e-12  # friction coefficient whose force is below rounding
FACTOR, FACTORS = 2.0, 10  # gains and times are changed by this factor up to ten times: a thousandfold either way
FROM_ZERO = 1 / 32  # first value tried for a derivative gain of zero, as share of proportional gain over root size
HALVINGS = 14  # bisections of the last factor, to four digits
MOST_LATE = 50  # limit of samples in a dead time: the matrix of one sample grows with their number
NAMED = 3  # number of changes of gains that the text lists, smallest first
ALONE = "the controller is unstable without any friction: {what}; {remedy}"
"""Clause on a controller that is unstable without friction, for all texts and messages."""


def unstable_by_itself(rig: Slider | Machine) -> str:
    """Clause `ALONE` if the controller is unstable without any friction; empty if it is stable or there is none.

    Linear analysis: limits, dead band and encoder resolution are left out. For a sampled controller roots are those of
    the matrix of one sample.
    """
    if has_response(rig) or not any(one.active and (one.stiffness or one.damping) for one in rig.mechanism().elements):
        return ""
    try:
        root = growing_root(rig)
    except NotAvailable:
        return ""
    if root is None:
        return ""
    pace = f"doubles in {format_quantity(math.log(2) / root.real, 's')}"
    what = f"an error {pace}"
    if root.imag:
        what = f"an oscillation with period {format_quantity(2 * math.pi / abs(root.imag), 's')} {pace}"
    moves = tuple(_moves(rig, root))
    found = sorted(_changes(rig, [(one,) for one in moves]))
    remedy = "no change of one of its gains and times makes it stable"
    if not found and _has_matrices(rig):  # pairs are tried only where a trial takes milliseconds
        found = sorted(_changes(rig, itertools.combinations(moves, 2)))[:1]
        remedy = "no change of one or two of its gains and times makes it stable"
    if found:
        remedy = f"it is stable with {', or '.join(words for _, words in found[:NAMED])}"
    return ALONE.format(what=what, remedy=remedy)


def growing_root(rig: Slider | Machine) -> complex | None:
    """Unstable root (1/s) of the control loop without friction with the largest growth rate; None if it is stable.

    Raises
    ------
    NotAvailable
        If the roots cannot be computed.
    """
    with np.errstate(all="ignore"), warnings.catch_warnings():
        for kind in (IllPosedWarning, UndecidedWarning):  # warned of if roots are NaN, which are ignored here
            warnings.simplefilter("ignore", kind)
        if _has_matrices(rig):
            plant = free_plant(rig)
            return _leading(plant) if plant.limits.sample_time is None else _leading_sampled(plant)
        free = without_friction(rig)
        roots = eigenvalues(free) if stability(free) == "unstable" else np.zeros(0)
    return complex(roots[0]) if roots.size and np.isfinite(roots[0]) else None  # infinite for a rig without inertia


def without_friction(rig: Slider | Machine) -> Any:
    """Copy of the rig with a friction force far below rounding."""
    law = weakest(NOTHING)
    if isinstance(rig, Slider):
        return replace(rig, friction=law)
    return replace(rig, contacts={name: replace(one, friction=law) for name, one in rig.contacts.items()})


def _has_matrices(rig: Slider | Machine) -> bool:
    """True if the loop can be written as matrices: no dead time without sampling, no structure, all inertias > 0."""
    mechanism = rig.mechanism()
    late = any(one.delay for one in mechanism.elements) and not (mechanism.limits and mechanism.limits.sample_time)
    return not (late or mechanism.structures) and all(one.inertia for one in mechanism.coordinates)


def _linear(plant: Plant) -> Array:
    """Matrix of the linear system of positions, speeds, integral and force of a sampled controller, without limits."""
    limits = Limits(on_measurement=plant.limits.on_measurement, sample_time=plant.limits.sample_time)
    kept = [*range(2 * plant.size + 1), 2 * plant.size + 3]
    return HeldPiece(replace(plant, limits=limits), HeldMode(()), 0.0).matrix[np.ix_(kept, kept)]


def _leading(plant: Plant) -> complex | None:
    roots = np.linalg.eigvals(_linear(plant))
    grows = roots[roots.real > GROWS * np.abs(roots)]
    return complex(grows[np.argmax(grows.real)]) if grows.size else None


def _leading_sampled(plant: Plant) -> complex | None:
    period = float(plant.limits.sample_time or math.nan)
    steps = np.linalg.eigvals(sample_map(plant))
    step = complex(steps[np.argmax(np.abs(steps))])
    return cmath.log(step) / period if abs(step) > 1 + GROWS else None


def sample_map(plant: Plant) -> Array:
    """Matrix of one sample of a controller without limits, dead band and encoder resolution.

    It maps positions, speeds, integral, the last measurement of each loop, and the forces of the last samples that are
    delayed by the dead time.

    Raises
    ------
    NotAvailable
        If the dead time has more than `MOST_LATE` samples.
    """
    from scipy.linalg import expm  # not at start-up

    from steadyslip.nonlinear.hunting.bristles import Bristles
    from steadyslip.nonlinear.hunting.in_mode import CompiledMotion

    limits = Limits(on_measurement=plant.limits.on_measurement, sample_time=plant.limits.sample_time)
    plant = replace(plant, limits=limits)
    n, period = plant.size, float(limits.sample_time or math.nan)
    late = int(plant.delay / period * (1 + 1e-12))
    if late > MOST_LATE:
        raise NotAvailable(f"stability of the loop is not computed with more than {MOST_LATE} samples in its dead time")
    before = plant.delay - late * period  # time in a period (s) until the next force acts
    core = CompiledMotion(plant, Bristles(plant, 1.0, np.ones(plant.width)))
    matrix, loops = _linear(plant), len(plant.places)
    first, second = expm(before * matrix), expm((period - before) * matrix)
    held = 2 * n + 1
    count = held + loops + late + 1
    found = np.zeros((count, count))
    for column in range(count):
        state = np.eye(count)[column]
        Y, control, own = np.zeros(plant.width), core.control.copy(), core.loops.copy()
        Y[:held], own[:, 2] = state[:held], state[held : held + loops]
        force = wanted_force(Y, control, own)
        waiting = np.append(state[held + loops :], force)
        moved = first @ np.append(Y[:held], waiting[0])
        moved = second @ np.append(moved[:held], waiting[1])
        found[:, column] = np.concatenate([moved[:held], own[:, 2], waiting[1:]])
    return found


class _Move(NamedTuple):
    """A gain or time of a controller: name, present value (SI units), and factor by which it is changed repeatedly."""

    name: str
    own: float
    factor: float


def _moves(rig: Slider | Machine, root: complex) -> Iterator[_Move]:
    """Yield changes of all gains and times, up and down; a derivative gain of zero starts at `FROM_ZERO`."""
    known = {name: one.value for name, one in rig.parameters().items() if name.startswith("drive.")}
    for name, value in known.items():
        own = float(value or 0.0)
        path, _, last = name.rpartition(".")
        if last == "kd" and not own and (gain := known.get(f"{path}.kp")):
            own = FROM_ZERO * float(gain) / abs(root)
        if name == "drive.velocity" or not own:
            continue
        yield _Move(name, own, FACTOR)
        if value:
            yield _Move(name, own, 1 / FACTOR)


def _changes(rig: Slider | Machine, candidates: Iterable[tuple[_Move, ...]]) -> Iterator[tuple[float, str]]:
    """Yield the joint changes that make the loop stable without friction: power of the factors, and text."""
    for moves in candidates:
        if len({one.name for one in moves}) == len(moves) and (power := _least_power(rig, moves)) is not None:
            yield power, " and ".join(_bound(rig, one, power) for one in moves)


def _bound(rig: Slider | Machine, move: _Move, power: float) -> str:
    """Format the bound of one changed parameter, as "drive.kp below 3 N/m"."""
    value = format_quantity(*rig.display_value(move.name, _moved(move, power)), area=rig.printed_area(move.name))
    return f"{move.name} {'above' if move.factor > 1 else 'below'} {value}"


def _moved(move: _Move, power: float) -> float:
    return float(move.own * move.factor**power)


def _least_power(rig: Slider | Machine, moves: tuple[_Move, ...]) -> float | None:
    """Smallest power of the factors with which the loop is stable; None if there is none."""

    def stable(power: float) -> bool:
        with suppress(NotAvailable, ParameterError):
            return growing_root(rig.with_values({one.name: _moved(one, power) for one in moves})) is None
        return False

    far = next((k for k in range(1, FACTORS + 1) if stable(k)), None)
    if far is None:
        return None
    low, high = far - 1.0, float(far)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return high
