"""Start, continuation and end of a job in a lane."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.event_detection import events_of_jump, process_events, save_before_jump
from steadyslip.kernels.driver.interpolate import state_now
from steadyslip.kernels.driver.places import (
    events_per_contact,
    guess_at,
    guess_count,
    point_at,
    scale_at,
    slip_sense,
    tally_at,
    velocity_at,
)
from steadyslip.kernels.driver.samples import record_now, record_step, schedule_sample, take_samples
from steadyslip.kernels.driver.segments import clock, enter_segment
from steadyslip.kernels.driver.slip import record_event
from steadyslip.kernels.layout import MOST_FAILURES, Cursor, Final, Kind, Layout, Routines, Row, Setting, Status

RUNAWAY = 1e9
"""If steps of a massless block fail above this velocity over the drive's, the run counts as blow-up. Contacts joined by
a dashpot run away together, and rounding of time prevents resolving that until the velocity overflows."""
Arrays = tuple[Array, Array, Array, Array, Array]
Results = tuple[Array, Array, Array, Array, Array, Array]


def first_step(R: Array, layout: Layout) -> float:
    """First step (s), at most `Row.H`: about 0.01 of the time in which the fastest variable changes by its size."""
    rtol = R[Row.RTOL]
    fastest = 0.0
    for i in range(layout.size):
        scale = R[layout.atol + i] / rtol + abs(R[layout.state + i])
        fastest = max(fastest, abs(R[layout.rate + i]) / scale)
    most = R[Row.H]
    return float(min(most, 0.01 * rtol**0.2 / fastest)) if fastest > 0.0 else float(most)


def load_job(
    S: Array, layout: Layout, lanes: int, lane: int, j: int, first: int, constants: Array, initial: Array,
    settings: Array,
) -> None:  # fmt: skip
    """Copy the inputs of job j into a lane; its initial values go to the rows from `first` on."""
    for i in range(layout.rows):
        S[i * lanes + lane] = 0.0
    for i in range(layout.constants):
        S[(layout.constant + i) * lanes + lane] = constants[j if constants.shape[0] > 1 else 0, i]
    for i in range(initial.shape[1]):
        S[(first + i) * lanes + lane] = initial[j if initial.shape[0] > 1 else 0, i]
    own = settings[j if settings.shape[0] > 1 else 0]
    S[Row.RTOL * lanes + lane] = own[Setting.RTOL]
    S[Row.MOST_STEPS * lanes + lane] = own[Setting.MOST_STEPS]
    S[Row.V_HIGH * lanes + lane] = own[Setting.V_HIGH]
    S[Row.V_LOW * lanes + lane] = own[Setting.V_LOW]
    S[Row.SIGMA_LOW * lanes + lane] = own[Setting.SIGMA_LOW]
    S[Row.WATCH * lanes + lane] = own[Setting.WATCH]
    S[Row.RECORD * lanes + lane] = own[Setting.RECORD]
    S[Row.Z * lanes + lane] = own[Setting.GUESS]
    S[Row.Z_SCALE * lanes + lane] = own[Setting.Z_SCALE]
    S[Row.V_DRIVE * lanes + lane] = own[Setting.V_DRIVE]
    S[Row.H * lanes + lane] = own[Setting.FIRST_STEP]
    for i in range(layout.size):
        S[(layout.atol + i) * lanes + lane] = own[Setting.ATOL + i]
    count = guess_count(layout)
    for k in range(1, count):
        S[guess_at(layout, k) * lanes + lane] = own[Setting.ATOL + layout.size + k - 1]
        S[scale_at(layout, k) * lanes + lane] = own[Setting.ATOL + layout.size + count + k - 2]
    S[Row.ACTIVE * lanes + lane] = 1.0


def exhausted(S: Array, lanes: int, lane: int) -> int:
    """Status of a lane: STUCK or TOO_MANY_STEPS after too many rejected steps in a row, or steps; else RUNNING."""
    if S[Row.FAILURES * lanes + lane] >= MOST_FAILURES:
        return Status.STUCK
    if S[Row.ACCEPTED * lanes + lane] + S[Row.REJECTED * lanes + lane] >= S[Row.MOST_STEPS * lanes + lane]:
        return Status.TOO_MANY_STEPS
    return Status.RUNNING


def start_job(
    R: Array, layout: Layout, routines: Routines, j: int, cursor: Array, log: Array, arrays: Arrays, y: Array
) -> bool:
    """Load job j into a record and enter its first segment; False if the balances have no solution."""
    constants, initial, settings, segments, times = arrays
    load_job(R, layout, 1, 0, j, layout.continuous, constants, initial, settings)
    if not enter_segment(R, layout, routines, j, 0, segments, y):
        return False
    schedule_sample(R, times)
    R[Row.H] = first_step(R, layout)
    R[Row.LOG] = 1.0 if log.shape[0] > 0 else 0.0
    for c in range(layout.contacts):
        start_tally(R, layout, routines, c, log, cursor, y)
    return True


def start_tally(
    R: Array, layout: Layout, routines: Routines, contact: int, log: Array, cursor: Array, y: Array
) -> None:
    """Initialise the event statistics of a contact; if it slips already, a begin of slip is recorded."""
    own, v = tally_at(layout, contact), velocity_at(R, layout, contact)
    R[own + Row.PEAK_VELOCITY] = v
    R[own + Row.LOWEST_VELOCITY] = v
    for i in (Row.EVENT_BEGIN, Row.EVENT_PEAK_VELOCITY, Row.RECURRENCE, Row.EVENT_RING_FREQUENCY, Row.LAST_PEAK_TIME):
        R[own + i] = math.nan
    R[own + Row.PEAK_PERIOD] = math.nan
    R[own + Row.PEAK_GROWTH] = math.nan
    for i in (Row.FORWARD_BEGIN, Row.BACKWARD_BEGIN, Row.NOW_BEGIN):
        R[own + i] = math.nan
    R[own + Row.NOW_SIGN] = 1.0
    R[own + Row.NOW_FROM] = math.inf
    sense = slip_sense(R, layout, contact) if R[Row.WATCH] > 0.0 else 0.0
    if sense != 0.0:
        state_now(R, layout, routines, 0.0, y)
        kind = Kind.SLIP_BEGINS if sense > 0.0 else Kind.BACKWARD_BEGINS
        record_event(R, layout, kind + 2 * events_per_contact(layout) * contact, 0.0, y, log, cursor)


def highest_velocity(R: Array, layout: Layout) -> float:
    """Largest |velocity| (m/s) of all contacts, each divided by its ratio to the first contact in steady sliding."""
    found = abs(R[Row.V])
    for c in range(1, layout.contacts):
        found = max(found, abs(R[layout.further_contact + 3 * (c - 1) + 2]))
    return float(found)


def lowest_stress(R: Array, layout: Layout) -> float:
    """Lowest normal stress (Pa) of all contacts, each divided by its ratio to the first contact in steady sliding."""
    found = R[Row.SIGMA]
    for c in range(1, layout.contacts):
        found = min(found, R[layout.further_contact + 3 * (c - 1) + 1])
    return float(found)


def finish(R: Array, layout: Layout, row: int, status: int, results: Results) -> None:
    """Write the final results of a job to its row, and mark the lane as free."""
    statuses, final, tally = results[0], results[1], results[2]
    statuses[row] = status
    final[row, Final.TIME] = clock(R, R[Row.TAU])
    final[row, Final.SEGMENT] = R[Row.SEGMENT]
    final[row, Final.ACCEPTED] = R[Row.ACCEPTED]
    final[row, Final.REJECTED] = R[Row.REJECTED]
    for i in range(layout.size):
        final[row, Final.STATE + i] = R[layout.state + i]
    for k in range(max(layout.unknowns, 1)):
        final[row, Final.POINT + point_at(layout, k)] = R[guess_at(layout, k)]
    first, counted = Row.PEAK_SIZE - Row.EVENTS, 2 * events_per_contact(layout)
    for c in range(layout.contacts):
        place = c * (tally.shape[1] // layout.contacts)
        for i in range(first):
            tally[row, place + i] = R[tally_at(layout, c) + Row.EVENTS + i]
        for i in range(counted):
            tally[row, place + first + i] = R[layout.event_count + counted * c + i]
    R[Row.ACTIVE] = 0.0
    R[Row.FLAG] = 0.0


def continue_job(
    R: Array, layout: Layout, routines: Routines, j: int, cursor: Array, arrays: Arrays, results: Results, y: Array,
    order: Array,
) -> int:  # fmt: skip
    """Process the last step of a job whose flag is set (events, samples, segment ends); returns its `Status`."""
    j0 = cursor[Cursor.FIRST_JOB]
    segments, times = arrays[3], arrays[4]
    samples, log, recorded = results[3], results[4], results[5]
    good = R[Row.GOOD] > 0.0
    if layout.massless > 0 and layout.w >= 0:
        for k in range(layout.unknowns, layout.massless):
            R[guess_at(layout, k)] = R[layout.state + layout.w + k - layout.unknowns]  # guess for the next jump
    if layout.stages > 0 and good:
        lost = R[Row.WATCH] > 0.0 and process_events(R, layout, routines, cursor, log, y, order)
        take_samples(R, layout, routines, j - j0, times, samples, False, y)
        if R[Row.RECORD] > 0.0 and lost:
            record_now(R, layout, cursor, recorded, y)
        elif R[Row.RECORD] > 0.0:
            record_step(R, layout, routines, cursor, recorded, y)
        if lost:
            return Status.CONTACT_LOST
    if highest_velocity(R, layout) >= R[Row.V_HIGH]:
        return Status.BLOW_UP
    if lowest_stress(R, layout) <= R[Row.SIGMA_LOW]:
        return Status.CONTACT_LOST
    status = exhausted(R, 1, 0)
    if status == Status.STUCK and layout.massless > 0 and highest_velocity(R, layout) >= RUNAWAY * abs(R[Row.V_DRIVE]):
        return Status.BLOW_UP
    if status != Status.RUNNING:
        return status
    while R[Row.TAU] >= R[Row.LENGTH]:
        k = int(R[Row.SEGMENT]) + 1
        s = j if segments.shape[0] > 1 else 0
        if k >= segments.shape[1] or segments[s, k, 1] <= segments[s, k, 0]:  # rows of no length pad shorter protocols
            return Status.DONE
        h = R[Row.H]
        save_before_jump(R, layout)
        if not enter_segment(R, layout, routines, j, k, segments, y):
            return Status.NO_VELOCITY
        schedule_sample(R, times)
        R[Row.H] = h
        if R[Row.RECORD] > 0.0:
            record_now(R, layout, cursor, recorded, y)
        if R[Row.WATCH] > 0.0:
            events_of_jump(R, layout, routines, cursor, log, y)
    return Status.RUNNING


def serve_lane(
    R: Array, layout: Layout, routines: Routines, lane: int, ids: Array, cursor: Array, arrays: Arrays,
    results: Results, y: Array, order: Array,
) -> None:  # fmt: skip
    """Continue the job of a lane whose flag is set, or finish it and start the next job in this lane."""
    j = ids[lane]
    if j >= 0:
        status = continue_job(R, layout, routines, j, cursor, arrays, results, y, order)
        R[Row.FLAG] = 0.0
        if status == Status.RUNNING:
            return
        if status == Status.NO_VELOCITY:  # no state exists after the jump, as the contact may have lifted off
            if lowest_stress(R, layout) <= R[Row.SIGMA_LOW]:
                status = Status.CONTACT_LOST
        else:
            take_samples(R, layout, routines, j - cursor[Cursor.FIRST_JOB], arrays[4], results[3], True, y)
        finish(R, layout, j - cursor[Cursor.FIRST_JOB], status, results)
    while cursor[Cursor.NEXT_JOB] < cursor[Cursor.LAST_JOB]:
        j = cursor[Cursor.NEXT_JOB]
        cursor[Cursor.NEXT_JOB] = j + 1
        ids[lane] = j
        if start_job(R, layout, routines, j, cursor, results[4], arrays, y):
            if R[Row.RECORD] > 0.0:
                record_now(R, layout, cursor, results[5], y)
            return
        finish(R, layout, j - cursor[Cursor.FIRST_JOB], Status.NO_VELOCITY, results)
    ids[lane] = -1
    cursor[Cursor.BUSY] -= 1
    for i in range(layout.rows):
        R[i] = 0.0
    R[Row.RTOL] = 1.0  # a lane without job takes steps like the other lanes; these settings keep its numbers finite
    R[Row.H] = 1e-3
    R[Row.LENGTH] = 1e300
