"""Where everything lies in the arrays that kernels and their driver share: declared once, for both and for NumPy.

A *record* holds one trajectory: first the numbers of `Row`, at the same place whatever the model, then groups whose
sizes depend on the model and the method, where `Layout` says. Kernels of several lanes keep their records side by
side: quantity ``row`` of lane ``l`` is ``S[row * lanes + l]``.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

GROUP = 8
"""Lanes that are computed as one vector; kernels of several lanes have some of these."""


class Row(IntEnum):
    """Numbers of a record that every kernel has."""

    V, ACCELERATION, SIGMA = 0, 1, 2
    """Outputs at the end of the step."""
    Z, Z_SCALE = 3, 4
    """The first unknown of the balances, or a guess of it, and its scale."""
    TAU, H, END = 5, 6, 7
    """Time since the start of the segment, next step, length of the segment."""
    START, STOP, SEGMENT = 8, 9, 10
    """Start and end of the segment since the start of the run, and its number."""
    RTOL = 11
    ACTIVE, FLAG, GOOD = 12, 13, 14
    """Whether there is a job, whether it needs the driver, whether the last step was accepted."""
    ACCEPTED, REJECTED, FAILURES, ERROR = 15, 16, 17, 18
    MOST, V_HIGH, V_LOW, SIGMA_LOW, WATCH, RECORD = 19, 20, 21, 22, 23, 24
    NEXT, TAKEN = 25, 26
    """How far into the segment the next sample is, and its number."""
    V_DRIVE, LOG = 27, 28
    """Velocity of the drive, and whether there is a log."""
    DONE, TAU_OLD, W_RATE_OLD = 29, 30, 31
    """Length of the last step, where it began, and the rate of the velocity variable there."""
    EXTENDED = 32
    """Whether the dense output of the last step is there."""
    HAPPENED = 33
    """How many events the last step has."""
    W_LIMIT, W_LP = 34, 35
    """Velocity variable above which the block slips and that of the load point, while inputs are constant."""
    # what is known about a trajectory's slip events; from here to PEAK_GROWTH it is a result
    EVENTS, PEAK_VELOCITY, LOWEST_VELOCITY = 36, 37, 38
    EVENT_BEGIN, EVENT_DURATION, EVENT_SLIP, EVENT_STRESS_DROP, EVENT_PEAK_VELOCITY, RECURRENCE = 39, 40, 41, 42, 43, 44
    LAST_PEAK_TIME, PEAK_PERIOD, PEAK_GROWTH = 45, 46, 47
    PEAK_SIZE, LOAD_MOVED, ANY_BEGIN = 48, 49, 50
    # slip that may become a slip event: since when, and what was there
    NOW_FROM, NOW_EVENT, NOW_PEAK, NOW_BEGIN = 51, 52, 53, 54
    NOW_V, NOW_SIGMA, NOW_TAU, NOW_STRESS, NOW_X, NOW_SEGMENT = 55, 56, 57, 58, 59, 60
    Z_OLD = 61
    """The first unknown of the balances at the start of the last step."""
    H_OLD = 62
    """Length of the last step that was accepted."""
    PULL, STRETCH = 63, 64
    """Of a drive that is let go and moves on, at the end of the last segment: its force less that of steady sliding,
    and what its motion alone would make of it with the load point at rest."""


TALLIED = Row.NOW_SEGMENT - Row.EVENTS + 1
"""Numbers from `Row.EVENTS` to `Row.NOW_SEGMENT`, of the first contact; those of others have a group of their own."""


MOST_FAILURES = 400.0
"""Steps in a row that may be in vain. A block with mass that is stopped falls by hundreds of decades in a moment: so
much shorter may the step have to be than the one before."""
SLIP_EVENT = 2.0  # peak velocity of a slip event over that of the load point, at least: a block that sticks between
# slips, on a spring and constant friction, exceeds twice (see docs/explanation/motion.md)


class Out(IntEnum):
    """Places of the outputs, counted from the end of the state."""

    V, ACCELERATION, SIGMA, TAU, T, V_LP, ADVANCE, W_SLOPE, UNKNOWN, PLACE, SHARE, COUNT = range(12)
    """V_LP is the velocity of the load point as the contact feels it, ADVANCE the way of the load point since the start
    of the segment. W_SLOPE is the slope of the dense output of the velocity variable and UNKNOWN a guess of the first
    unknown of the balances: outputs need both. PLACE is the distance slipped since the start of the run, SHARE the
    slip rate in steady sliding over that of the first contact. Further contacts follow, COUNT numbers each, then
    events, what else is observed, and guesses of further unknowns. What `observe` gives of a contact ends with
    ADVANCE."""


class Setting(IntEnum):
    """Columns of the settings of a trajectory; absolute tolerances of the state follow, then guesses and scales of
    further unknowns."""

    RTOL, MOST_STEPS, V_HIGH, V_LOW, SIGMA_LOW, WATCH, RECORD = 0, 1, 2, 3, 4, 5, 6
    GUESS, Z_SCALE, FIRST_STEP, V_DRIVE, ATOL = 7, 8, 9, 10, 11


SETTINGS = tuple(setting.name.lower() for setting in Setting if setting < Setting.ATOL)


class Cursor(IntEnum):
    """Where a chain of calls stands."""

    NEXT_JOB, LAST_JOB, BUSY, PAUSED, LOGGED, RECORDED, FIRST_JOB, SIZE = 0, 1, 2, 3, 4, 5, 6, 7


class Status(IntEnum):
    """How a trajectory ended."""

    RUNNING, DONE, CONTACT_LOST, BLOW_UP, TOO_MANY_STEPS, STUCK, NO_VELOCITY = 0, 1, 2, 3, 4, 5, 6


class EventPlace(IntEnum):
    """Places of the events that the driver knows in `steadyslip.kernels.events.EVENTS`."""

    SLIP, TURN, CONTACT = 0, 1, 2


class Kind(IntEnum):
    """What a row of the log says: 2 e + 1 where event number e falls, 2 e + 2 where it rises.

    Events of further contacts have higher numbers, in the same order.
    """

    SLIP_ENDS, SLIP_BEGINS, PEAK, TROUGH, LOST = 1, 2, 3, 4, 5


LOG_COLUMNS = 8
"""Kind, time, v, sigma, tau, T, slip, segment."""


# A *point* is what is written down of a trajectory at a moment: the first unknown of the balances, the state, then
# further unknowns. Where forces balance at several velocities, the state alone does not say which of them is meant.


class Sampled(IntEnum):
    """Columns of a point, and of the samples at requested times."""

    UNKNOWN, STATE = 0, 1


class Recorded(IntEnum):
    """Columns of the solver's own steps."""

    TIME, SEGMENT, POINT, STATE = 0, 1, 2, 3


class Final(IntEnum):
    """Columns of where a trajectory ended."""

    TIME, SEGMENT, ACCEPTED, REJECTED, POINT, STATE = 0, 1, 2, 3, 4, 5


class Layout(NamedTuple):
    """Sizes of one kernel, and where the groups of its record begin."""

    lanes: int
    size: int
    """Length of the state."""
    kept: int
    """Number of variables that jumps leave alone."""
    constants: int
    inputs: int
    """Channels of what is done to the rig: velocity of the load point, pushes, normal stresses."""
    harmonics: int
    """Sine waves of each."""
    stages: int
    """That are kept for dense output; none without."""
    extra: int
    """Whether dense output has stages of its own: then steps are long."""
    contacts: int
    events: int
    """That are watched, of all contacts; none without dense output."""
    further: int
    """How many other quantities are observed."""
    watched: int
    """Whether frequent events are found in all lanes at once."""
    massless: int
    """How many balances are solved after a jump, for the unknowns and for velocity variables."""
    unknowns: int
    """How many unknowns balances fix at every moment."""
    solved: int
    """Whether the balances have to be solved to restore the variables that jumps leave alone."""
    w: int
    """Place in the state of the velocity variable, or the first of those that balances fix; -1 if none is there."""
    own: int
    """Length of the state without sensitivities."""
    directions: int
    x: int
    """Place of the slip in the state."""
    state: int
    rate: int
    continuous: int
    atol: int
    level: int
    """Inputs at the start of the segment,"""
    slope: int
    """their slopes, and their waves."""
    amplitude: int
    omega: int
    phase: int
    constant: int
    old: int
    stage: int
    curve: int
    """Dense output of the last step: coefficients of powers of the fraction of it, variable by variable."""
    mark: int
    """Values of the functions of events."""
    happened: int
    """Which of them changed sign in the last step: 1 rose, -1 fell."""
    counted: int
    """How often each kind of event happened."""
    seen: int
    before: int
    guess: int
    """Guesses of further unknowns and velocity variables that balances fix,"""
    scale: int
    """and their scales."""
    earlier: int
    """Further unknowns at the start of the last step."""
    elsewhere: int
    """Velocity, normal stress and velocity again at further contacts, the latter two as shares of the first's."""
    tallies: int
    """What is known about slip events of further contacts."""
    jumped: int
    """Of each contact: velocity before a jump, and whether it slipped."""
    rows: int


def make_layout(
    *, lanes: int, size: int, kept: int, constants: int, inputs: int, harmonics: int = 0, stages: int = 0,
    terms: int = 0, massless: int = 0, unknowns: int = 0, solved: bool = False, w: int = -1, own: int = 0,
    directions: int = 0, x: int = 0, seen: int = 0, events: int = 0, watched: bool = False, extra: bool = False,
    contacts: int = 1, further: int = 0,
) -> Layout:  # fmt: skip
    """Put the groups one behind the other."""
    waves, further_ones = inputs * harmonics, max(massless, unknowns, 1) - 1
    sizes = {
        "state": size, "rate": size, "continuous": kept, "atol": size, "level": inputs, "slope": inputs,
        "amplitude": waves, "omega": waves, "phase": waves,
        "constant": constants, "old": size if stages else 0, "stage": size * stages,
        "curve": size * terms if stages else 0,
        "mark": events, "happened": events, "counted": 2 * events, "seen": seen,
        "before": own if seen else 0,
        "guess": further_ones, "scale": further_ones, "earlier": max(unknowns - 1, 0),
        "elsewhere": 3 * (contacts - 1), "tallies": TALLIED * (contacts - 1),
        "jumped": 2 * contacts if events else 0,
    }  # fmt: skip
    places, position = {}, max(Row) + 1
    for name, count in sizes.items():
        places[name] = position
        position += count
    return Layout(
        lanes=lanes, size=size, kept=kept, constants=constants, inputs=inputs, harmonics=harmonics, stages=stages,
        massless=massless, unknowns=unknowns, solved=int(solved), w=w, own=own, directions=directions, x=x,
        events=events, watched=int(watched), extra=int(extra), contacts=contacts, further=further, rows=position,
        **places,
    )  # fmt: skip


Array = np.ndarray
Routine = Callable[[Array, float, Array], None]


class Routines(NamedTuple):
    """The straight-line functions of one model, each ``(record, number, array) -> None``.

    The driver runs with plain Python functions as it stands; compiled, it is given their addresses instead.

    Attributes
    ----------
    step : one step of every lane
    rates : rates, outputs and gap of the record's state
    outputs : ``array[size:]`` = `Out` of the state ``array[:size]`` at local time `number`, then functions of events;
        the unknowns of the balances are looked for near ``array[size + Out.UNKNOWN]`` and what stands at the end, and
        stand there afterwards
    restore : the variables that a jump leaves alone, from the record's state; what the load point moved is added up
    shift : these, when the load point has jumped ahead by `number`
    place : the record's state from them and from the velocity variables that balances fix
    balance : ``array`` = residuals of the balances that are solved after a jump at the record's guesses, then their
        derivatives, row by row
    dense : ``array[:size]`` = state at the fraction `number` of the last step, and `Out.W_SLOPE`, unknowns
    extend : the dense output of the last step, made ready for `dense`
    watch_group : of `GROUP` lanes from lane `number` on: frequent events within the last step, found and tallied
    rates_lanes, see_lanes : of every lane: the rates; what is observed
    extend_lanes, look_lanes : of every lane: `extend`; what was observed at `Row.NEXT`, within the last step
    """

    step: Routine
    rates: Routine
    outputs: Routine
    restore: Routine
    shift: Routine
    place: Routine
    balance: Routine
    dense: Routine
    extend: Routine
    watch_group: Routine
    rates_lanes: Routine
    see_lanes: Routine
    extend_lanes: Routine
    look_lanes: Routine


def call(routine: Routine, record: Array, number: float, array: Array) -> None:
    """Call a routine; compiled code jumps to its address instead (`steadyslip.kernels.build`)."""
    routine(record, number, array)
