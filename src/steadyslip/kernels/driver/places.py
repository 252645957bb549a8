"""Indices of quantities in the output array and in a record, as functions of contact and unknown."""

from __future__ import annotations

from steadyslip.core.arrays import Array
from steadyslip.kernels.layout import TALLIED, EventPlace, Layout, Out, Row, Sampled


def outputs_at(layout: Layout, contact: int) -> int:
    """Index of the first output of a contact, in the output array."""
    return layout.size + contact * Out.COUNT


def event_functions_at(layout: Layout) -> int:
    """Index of the first event function in the output array."""
    return layout.size + layout.contacts * Out.COUNT


def further_at(layout: Layout) -> int:
    """Index of the first additional observable in the output array."""
    return event_functions_at(layout) + layout.events


def unknown_at(layout: Layout, index: int) -> int:
    """Index of an unknown, or of its guess, in the output array."""
    return further_at(layout) + layout.further + index - 1 if index > 0 else layout.size + Out.UNKNOWN


def output_size(layout: Layout) -> int:
    """Length of the output array: state, outputs, event functions, further observables, further unknowns.

    The solver of the balances uses the array for residuals, derivatives, Newton changes and saved guesses.
    """
    return max(further_at(layout) + layout.further + layout.unknowns, 4 * layout.massless)


def point_size(layout: Layout) -> int:
    """Length of a point (first unknown, state, further unknowns)."""
    return Sampled.STATE + layout.size + max(layout.unknowns - 1, 0)


def point_at(layout: Layout, index: int) -> int:
    """Index of an unknown in a point."""
    return Sampled.STATE + layout.size + index - 1 if index > 0 else int(Sampled.UNKNOWN)


def events_per_contact(layout: Layout) -> int:
    """Number of event functions per contact."""
    return layout.events // layout.contacts


def tally_at(layout: Layout, contact: int) -> int:
    """Offset that converts a `Row` from EVENTS to SMALL_DROP to the row of a contact."""
    return layout.further_statistics + (contact - 1) * TALLIED - Row.EVENTS if contact > 0 else 0


def slip_sense(R: Array, layout: Layout, contact: int) -> float:
    """1 or -1 if a contact slips forward or backward faster than the load point at the end of the step; else 0."""
    first = layout.event_value + events_per_contact(layout) * contact
    if R[first + EventPlace.SLIP] > 0.0:
        return 1.0
    return -1.0 if R[first + EventPlace.BACKWARD] > 0.0 else 0.0


def guess_count(layout: Layout) -> int:
    """Number of quantities with a guess: unknowns, or velocity variables solved from balances; at least 1."""
    return max(max(layout.massless, layout.unknowns), 1)


def guess_at(layout: Layout, index: int) -> int:
    """Index in a record of an unknown, or of the guess of a velocity variable solved from a balance."""
    return layout.guess + index - 1 if index > 0 else int(Row.Z)


def scale_at(layout: Layout, index: int) -> int:
    """Index in a record of the scale of an unknown."""
    return layout.scale + index - 1 if index > 0 else int(Row.Z_SCALE)


def earlier_at(layout: Layout, index: int) -> int:
    """Index in a record of an unknown's value at the start of the last step."""
    return layout.unknown_old + index - 1 if index > 0 else int(Row.Z_OLD)


def velocity_at(R: Array, layout: Layout, contact: int) -> float:
    """Velocity (m/s) of a contact at the end of the step."""
    return float(R[layout.further_contact + 3 * (contact - 1)] if contact > 0 else R[Row.V])
