"""Where what belongs to a contact is: in the outputs, in a record."""

from __future__ import annotations

from steadyslip.kernels.layout import TALLIED, Array, Layout, Out, Row, Sampled


def outputs_at(layout: Layout, contact: int) -> int:
    """Where the outputs of a contact begin."""
    return layout.size + contact * Out.COUNT


def marks_at(layout: Layout) -> int:
    """Where the functions of events begin, among the outputs."""
    return layout.size + layout.contacts * Out.COUNT


def further_at(layout: Layout) -> int:
    """Where what else is observed begins, among the outputs."""
    return marks_at(layout) + layout.events


def unknown_at(layout: Layout, index: int) -> int:
    """Where an unknown is, or a guess of it, among the outputs."""
    return further_at(layout) + layout.further + index - 1 if index > 0 else layout.size + Out.UNKNOWN


def width(layout: Layout) -> int:
    """How many numbers there are: state, outputs, functions of events, what else is observed, further unknowns.

    Balances to be solved leave residuals, derivatives and Newton's changes in the same array, and the guesses before.
    """
    return max(further_at(layout) + layout.further + layout.unknowns, 4 * layout.massless)


def breadth(layout: Layout) -> int:
    """How many numbers a point has."""
    return Sampled.STATE + layout.size + max(layout.unknowns - 1, 0)


def point_at(layout: Layout, index: int) -> int:
    """Where an unknown is in a point."""
    return Sampled.STATE + layout.size + index - 1 if index > 0 else int(Sampled.UNKNOWN)


def kinds(layout: Layout) -> int:
    """How many events every contact has."""
    return layout.events // layout.contacts


def tally_at(layout: Layout, contact: int) -> int:
    """What has to be added to `Row.EVENTS` and the places up to `Row.NOW_SEGMENT`."""
    return layout.tallies + (contact - 1) * TALLIED - Row.EVENTS if contact > 0 else 0


def searched(layout: Layout) -> int:
    """How many unknowns and velocity variables there are guesses of."""
    return max(max(layout.massless, layout.unknowns), 1)


def guess_at(layout: Layout, index: int) -> int:
    """Where an unknown is, or the guess of a velocity variable that a balance fixes."""
    return layout.guess + index - 1 if index > 0 else int(Row.Z)


def scale_at(layout: Layout, index: int) -> int:
    """Where its scale is."""
    return layout.scale + index - 1 if index > 0 else int(Row.Z_SCALE)


def earlier_at(layout: Layout, index: int) -> int:
    """Where an unknown is as it was at the start of the last step."""
    return layout.earlier + index - 1 if index > 0 else int(Row.Z_OLD)


def velocity_at(R: Array, layout: Layout, contact: int) -> float:
    """Velocity at a contact at the end of the step."""
    return float(R[layout.elsewhere + 3 * (contact - 1)] if contact > 0 else R[Row.V])
