"""Where what belongs to a contact is: in the outputs, in a record."""

from __future__ import annotations

from steadyslip.kernels.layout import TALLIED, Array, Layout, Out, Row


def outputs_at(layout: Layout, contact: int) -> int:
    """Where the outputs of a contact begin."""
    return layout.size + contact * Out.COUNT


def marks_at(layout: Layout) -> int:
    """Where the functions of events begin, among the outputs."""
    return layout.size + layout.contacts * Out.COUNT


def width(layout: Layout) -> int:
    """How many numbers there are: state, outputs, functions of events, what else is observed."""
    return marks_at(layout) + layout.events + layout.further


def kinds(layout: Layout) -> int:
    """How many events every contact has."""
    return layout.events // layout.contacts


def tally_at(layout: Layout, contact: int) -> int:
    """What has to be added to `Row.EVENTS` and the places up to `Row.NOW_SEGMENT`."""
    return layout.tallies + (contact - 1) * TALLIED - Row.EVENTS if contact > 0 else 0


def guess_at(layout: Layout, index: int) -> int:
    """Where the guess of a velocity variable is that a balance fixes."""
    return layout.guess + index - 1 if index > 0 else Row.Z


def velocity_at(R: Array, layout: Layout, contact: int) -> float:
    """Velocity at a contact at the end of the step."""
    return float(R[layout.elsewhere + 3 * (contact - 1)] if contact > 0 else R[Row.V])
