"""Indices of all quantities in the arrays that kernels and driver share.

A *record* is the array of numbers of one trajectory: first those of `Row`, at the same index for every model, then
groups whose sizes depend on model and method, which begin at the indices in `Layout`. Kernels of several lanes
interleave their records: row ``row`` of lane ``l`` is ``S[row * lanes + l]``.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from steadyslip.core.arrays import Array

GROUP = 8
"""Number of lanes computed as one vector; the lanes of a kernel are a multiple of it, or one."""


class Row(IntEnum):
    """Rows of a record that all kernels have."""

    V, ACCELERATION, SIGMA = 0, 1, 2
    """Outputs at the end of the step."""
    Z, Z_SCALE = 3, 4
    """First unknown of the balances (or a guess of it), and the scale of this unknown."""
    TAU, H, LENGTH = 5, 6, 7
    """Time since the start of the segment, size of the next step, length of the segment (s)."""
    START, STOP, SEGMENT = 8, 9, 10
    """Start and end of the segment since the start of the run (s), and its number."""
    RTOL = 11
    ACTIVE, FLAG, GOOD = 12, 13, 14
    """Flags: lane has a job, lane needs the driver, last step was accepted."""
    ACCEPTED, REJECTED, FAILURES, ERROR = 15, 16, 17, 18
    """Numbers of accepted steps, of rejected steps, and of rejected steps in a row; ln of the last squared error."""
    MOST_STEPS, V_HIGH, V_LOW, SIGMA_LOW, WATCH, RECORD = 19, 20, 21, 22, 23, 24
    """Settings: most steps, limits of velocity (m/s) and of normal stress (Pa). Flags: watch events, record
    steps."""
    NEXT_TIME, NEXT_SAMPLE = 25, 26
    """Local time of the next requested sample (s), and its number."""
    V_DRIVE, LOG = 27, 28
    """Velocity of the drive (m/s); flag: a log is kept."""
    STEP_SIZE, TAU_OLD, W_RATE_OLD = 29, 30, 31
    """Size of the last step, its local starting time, and the rate of the velocity variable there."""
    EXTENDED = 32
    """Flag: the polynomials of the dense output of the last step are stored."""
    EVENT_COUNT = 33
    """Number of events in the last step."""
    W_LIMIT, W_LP = 34, 35
    """Velocity variable at the slip limit and at the load-point velocity, valid while inputs are constant."""
    # statistics of slip events (s, m, Pa, m/s, Hz); up to PEAK_GROWTH they are results, about the last complete event
    EVENTS, PEAK_VELOCITY, LOWEST_VELOCITY = 36, 37, 38
    EVENT_BEGIN, EVENT_DURATION, EVENT_SLIP, EVENT_STRESS_DROP, EVENT_PEAK_VELOCITY, RECURRENCE = 39, 40, 41, 42, 43, 44
    EVENT_RINGS, EVENT_RING_FREQUENCY, LAST_PEAK_TIME, PEAK_PERIOD, PEAK_GROWTH = 45, 46, 47, 48, 49
    # size of the last velocity peak; load point's displacement; largest stress drop; begin of the last event in each
    # direction; then T and slip at the begin of the last event, and the begin of the last ring after it
    PEAK_SIZE, LOAD_MOVED, LARGEST_DROP, FORWARD_BEGIN, BACKWARD_BEGIN = 50, 51, 52, 53, 54
    EVENT_STRESS, EVENT_X, LAST_RING = 55, 56, 57
    # slip in progress: lowest speed, 1 if fast, highest speed, begin, sign; then the state when the speed was lowest
    NOW_FROM, NOW_EVENT, NOW_PEAK, NOW_BEGIN, NOW_SIGN = 58, 59, 60, 61, 62
    NOW_V, NOW_SIGMA, NOW_TAU, NOW_STRESS, NOW_X, NOW_SEGMENT = 63, 64, 65, 66, 67, 68
    # end of the last fast forward slip; number and last stress drop of similar small slips after rests (`ALIKE`)
    FAST_END, SMALL_COUNT, SMALL_DROP = 69, 70, 71
    Z_OLD = 72
    """First unknown of the balances at the start of the last step."""
    H_OLD = 73
    """Size of the last accepted step."""
    PULL, STRETCH = 74, 75
    """At the end of the last segment: force (minus that of steady sliding) of a drive that can be released, and the
    part of it that the drive's own motion would cause with the load point at rest."""
    LOAD_SPEED = 76
    """Velocity of the load point at the end of the last segment, stored if its jumps change velocity variables."""


TALLIED = Row.SMALL_DROP - Row.EVENTS + 1
"""Number of rows of event statistics, EVENTS to SMALL_DROP; those of further contacts are in a separate group."""


MOST_FAILURES = 400.0
"""Rejected steps in a row after which a job stops. The velocity of a stopping block with mass falls by hundreds of
decades almost at once, and steps have to shrink as much."""
EVENT_SHARE = 0.1
"""Smallest stress drop of a slip event over the largest so far, and smallest reload between two events; smaller changes
are ringing. Any value between the largest ring of a damped block (some hundredths) and 1, a full event, separates the
two; a tenth is far from both."""
RESTED = 3.0
"""Smallest rest before a slip over the slip's duration that distinguishes it from ringing, whose rests are at most
twice as long: a sine that peaks at SLIP_EVENT times the load-point velocity exceeds that for a third of the period."""
ALIKE = 3.0  # number of small slips in a row, each after a rest and with similar drops, that count as slip events
SLIP_EVENT = 2.0  # smallest ratio of peak velocity to load-point velocity of a slip event: stick-slip of a block on a
# spring with constant friction exceeds 2 (see docs/explanation/motion.md)


class Out(IntEnum):
    """Indices of a contact's outputs, counted from the end of the state."""

    V, ACCELERATION, SIGMA, TAU, T, V_LP, ADVANCE, W_SLOPE, UNKNOWN, PLACE, SHARE, COUNT = range(12)
    """V_LP is the load-point velocity times the contact's steady slip rate over the drive's velocity, ADVANCE the load
    point's displacement since the start of the segment, times the same ratio. W_SLOPE is the derivative of the dense
    output of the velocity variable, and UNKNOWN a guess of the first unknown of the balances; both are inputs of the
    routine `outputs`. PLACE is the distance slipped since the start of the run, SHARE the slip rate in steady sliding
    over that of the first contact. Each contact has COUNT numbers; event functions, additional observables and guesses
    of further unknowns follow. `observe` returns the outputs up to ADVANCE."""


class Setting(IntEnum):
    """Columns of the settings of a trajectory. From ATOL on: absolute tolerances of the state, then guesses and scales
    of further unknowns."""

    RTOL, MOST_STEPS, V_HIGH, V_LOW, SIGMA_LOW, WATCH, RECORD = 0, 1, 2, 3, 4, 5, 6
    GUESS, Z_SCALE, FIRST_STEP, V_DRIVE, ATOL = 7, 8, 9, 10, 11


SETTINGS = tuple(setting.name.lower() for setting in Setting if setting < Setting.ATOL)


class Cursor(IntEnum):
    """Elements of the array with the progress of a series of calls of `advance`."""

    NEXT_JOB, LAST_JOB, BUSY, PAUSED, LOGGED, RECORDED, FIRST_JOB, SIZE = 0, 1, 2, 3, 4, 5, 6, 7


class Status(IntEnum):
    """Status of a trajectory: running, or the reason of its end."""

    RUNNING, DONE, CONTACT_LOST, BLOW_UP, TOO_MANY_STEPS, STUCK, NO_VELOCITY = 0, 1, 2, 3, 4, 5, 6


class EventPlace(IntEnum):
    """Indices in `steadyslip.kernels.events.EVENTS` of the events that the driver treats specially."""

    SLIP, TURN, CONTACT, BACKWARD = 0, 1, 2, 3


class Kind(IntEnum):
    """Kind of a row of the log: 2 e + 1 where event function e falls through zero, 2 e + 2 where it rises.

    For contact c the number of kinds per contact is added c times.
    """

    SLIP_ENDS, SLIP_BEGINS, PEAK, TROUGH, LOST, BACKWARD_ENDS, BACKWARD_BEGINS, ARREST = 1, 2, 3, 4, 5, 7, 8, 9


LOG_COLUMNS = 9
"""Columns of the log: kind, time, v, sigma, tau, T, slip, segment, number of the slip event (0 for ringing)."""
NUMBER = 8
"""Column with the number of the slip event. A second end with the same number means that the event has continued.
Numbers start again at 1 if all earlier slip turns out to be small."""


# A *point* is the full state at one time: first unknown of the balances, state, further unknowns. Unknowns are stored
# because the state alone does not determine them if forces balance at several velocities.


class Sampled(IntEnum):
    """Columns of a point, and of the samples at requested times."""

    UNKNOWN, STATE = 0, 1


class Recorded(IntEnum):
    """Columns of the recorded solver steps."""

    TIME, SEGMENT, POINT, STATE = 0, 1, 2, 3


class Final(IntEnum):
    """Columns of the final state of a trajectory."""

    TIME, SEGMENT, ACCEPTED, REJECTED, POINT, STATE = 0, 1, 2, 3, 4, 5


class Held(IntEnum):
    """Elements of the array with the progress, over calls of `follow_held`, of a rig that holds a place."""

    TIME, END, STOP = 0, 1, 2
    """Present time, end of the target's segment, and time of the next sample or change of force (s)."""
    LENGTH, RTOL, SHORTEST = 3, 4, 5
    """With bristles: length of the next step (s), allowed error relative to a variable's size, shortest step (s)."""
    CHANGED, STEPS, MOST_STEPS = 6, 7, 8
    """Flag: the force has changed since the last span; number of steps or passages so far, and at most."""
    ROWS, EVERY = 9, 10
    """Number of rows of the motion written so far; every EVERY-th node of a step is written."""
    RESTS, SINCE, LAST_ROW = 11, 12, 13
    """Flag: at rest under a sampled controller; begin of the rest (s), time of the last row (s)."""
    LOWEST, HIGHEST, FASTEST = 14, 15, 16
    """Lowest and highest error (m or rad) and highest speed (m/s or rad/s) of the stroke."""
    STILL, PACE, FAR = 17, 18, 19
    """Speeds below STILL times the larger of PACE (m/s or rad/s) and FASTEST may mean rest; from the error FAR (m or
    rad) on the motion is no longer hunting."""
    SIZE = 20


class Control(IntEnum):
    """Elements of the array of a sampled controller: its settings, then its memory."""

    PERIOD, RESOLUTION, DELAY, ON_MEASUREMENT = 0, 1, 2, 3
    """PERIOD is 0 for a controller without sampling, which is part of the linear system."""
    BAND, BANDS_RATE, OF_INTEGRAL = 4, 5, 6
    INTEGRAL, MOST_INTEGRAL, MOST_FORCE = 7, 8, 9
    COUNT, AIM, LATE, CONSTANT = 10, 11, 12, 13
    """Number of samples so far, last target, number of delayed forces; flag: last sample changed nothing."""
    ROUNDED = 14
    """Number of loops, from the first on, whose place is measured by the encoder and rounded to its step."""
    SIZE = 15


class Turn(IntEnum):
    """Reason why `follow_held` returns, and what its caller has to do.

    LOOK: decide whether to continue. STEP: take the next step, in which a guard may fail. LENGTH: provide a passage for
    the time to `Held.STOP`. STUCK: stop, because steps have become too short.
    """

    LOOK, STEP, LENGTH, STUCK = 0, 1, 2, 3


class Layout(NamedTuple):
    """Sizes of one kernel and indices of the groups of its record (first row of each)."""

    lanes: int
    size: int
    """Length of the state."""
    kept: int
    """Number of variables that are continuous in jumps."""
    constants: int
    inputs: int
    """Number of input channels: load-point velocity, pushes, normal stresses."""
    harmonics: int
    """Number of sine waves of each input."""
    stages: int
    """Number of stages kept for dense output; 0 without it."""
    extra: int
    """1 if dense output needs additional stages: methods of high order, whose steps are long."""
    contacts: int
    events: int
    """Number of event functions of all contacts; 0 without dense output."""
    further: int
    """Number of additional observables."""
    watched: int
    """1 if frequent events are found in all lanes at once."""
    massless: int
    """Number of balances solved after a jump, for unknowns and velocity variables."""
    unknowns: int
    """Number of unknowns that are determined by balances at all times."""
    solved: int
    """1 if the balances have to be solved to get the continuous variables from the state."""
    w: int
    """Index in the state of the (first) velocity variable that balances determine after a jump; -1 if there is none."""
    own: int
    """Length of the state without sensitivities."""
    directions: int
    x: int
    """Index of the slip in the state."""
    state: int
    rate: int
    continuous: int
    atol: int
    level: int
    """Inputs at the start of the segment."""
    slope: int
    """Slopes of the inputs; the next three groups are amplitudes, angular frequencies and phases of their waves."""
    amplitude: int
    omega: int
    phase: int
    constant: int
    state_old: int
    stage: int
    polynomial: int
    """Dense output of the last step: for each variable, coefficients of powers of the fraction of the step."""
    rate_error: int
    """For implicit methods: errors of the rates, at the end of the step, of variables on which velocities depend."""
    event_value: int
    """Values of the event functions at the end of the step."""
    sign_change: int
    """Sign changes of event functions in the last step: 1 for rising, -1 for falling, 0 for none."""
    event_count: int
    """Number of events so far, by kind."""
    observable: int
    rate_before: int
    guess: int
    """Guesses of further unknowns and of velocity variables that balances determine."""
    scale: int
    """Scales of further unknowns."""
    unknown_old: int
    """Further unknowns at the start of the last step."""
    further_contact: int
    """For each further contact: velocity, then normal stress and velocity over their ratios to the first contact."""
    further_statistics: int
    """Event statistics of further contacts."""
    before_jump: int
    """For each contact: velocity before a jump, and its `slip_sense` then."""
    rows: int


def make_layout(
    *, lanes: int, size: int, kept: int, constants: int, inputs: int, harmonics: int = 0, stages: int = 0,
    terms: int = 0, massless: int = 0, unknowns: int = 0, solved: bool = False, w: int = -1, own: int = 0,
    directions: int = 0, x: int = 0, seen: int = 0, events: int = 0, watched: bool = False, extra: bool = False,
    contacts: int = 1, further: int = 0, moving: int = 0,
) -> Layout:  # fmt: skip
    """Layout for given sizes, with the groups of the record one after the other."""
    waves, further_ones = inputs * harmonics, max(massless, unknowns, 1) - 1
    sizes = {
        "state": size, "rate": size, "continuous": kept, "atol": size, "level": inputs, "slope": inputs,
        "amplitude": waves, "omega": waves, "phase": waves,
        "constant": constants, "state_old": size if stages else 0, "stage": size * stages,
        "polynomial": size * terms if stages else 0,
        "rate_error": moving,
        "event_value": events, "sign_change": events, "event_count": 2 * events, "observable": seen,
        "rate_before": own if seen else 0,
        "guess": further_ones, "scale": further_ones, "unknown_old": max(unknowns - 1, 0),
        "further_contact": 3 * (contacts - 1), "further_statistics": TALLIED * (contacts - 1),
        "before_jump": 2 * contacts if events else 0,
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


Routine = Callable[[Array, float, Array], None]


class Routines(NamedTuple):
    """Straight-line functions of one model, each ``(record, number, array) -> None``.

    The driver gets Python functions, or their addresses when it is compiled.

    Attributes
    ----------
    step : one step of every lane
    rates : rates, outputs and event functions at the record's state
    outputs : ``array[size:]`` = `Out` of the state ``array[:size]`` at time `number` in the segment, then event
        functions; reads guesses of the unknowns from ``array[size + Out.UNKNOWN]`` and the last elements of ``array``,
        and writes the unknowns there
    restore : continuous variables (unchanged by jumps) from the record's state; adds the load point's displacement
    shift : continuous variables after a jump of the load point by `number`
    place : the record's state from the continuous variables and the velocity variables that balances determine
    balance : ``array`` = residuals, at the guesses, of the balances that are solved after a jump, their slopes in
        their own unknowns, and Newton's changes
    dense : ``array[:size]`` = state at the fraction `number` of the last step, with `Out.W_SLOPE` and unknowns
    extend : polynomials of the dense output of the last step, which `dense` reads
    watch_group : frequent events within the last step, for `GROUP` lanes from lane `number` on
    rates_lanes, see_lanes : rates; observables (all lanes)
    extend_lanes, look_lanes : `extend`; observables at `Row.NEXT_TIME`, within the last step (all lanes)
    bristles : for a rig that holds a place, whose record has its constants: ``array`` = inputs (slip rates and memories
        of the m contacts, with the normal stress after the slip rate if it varies), then friction forces and rates of
        the memories, then the derivatives of these by the inputs
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
    bristles: Routine


def call(routine: Routine, record: Array, number: float, array: Array) -> None:
    """Call a routine; compiled code jumps to its address instead (`steadyslip.kernels.build`)."""
    routine(record, number, array)
