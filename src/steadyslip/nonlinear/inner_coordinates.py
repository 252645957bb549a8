"""Limit of the degrees of freedom of structures for analyses whose work grows fast with their number."""

from __future__ import annotations

from steadyslip.core.errors import NotAvailable
from steadyslip.model.equations import Model

MOST_INNER = 8
"""Largest number of degrees of freedom of structures: a branch of cycles takes 5 CPU s with 3 and 14 with 5; with 24
compilation alone takes minutes. The number of terms in a basin's neighbourhood grows as the fourth power of it."""


def inner_count(model: Model) -> int:
    """Number of degrees of freedom of structures."""
    return sum(one.inner for one in model.coordinates)


def refuse_many_inner(model: Model, what: str) -> None:
    """Raise NotAvailable if structures have too many degrees of freedom for `what` (plural noun in the message)."""
    count = inner_count(model)
    if count > MOST_INNER:
        raise NotAvailable(
            f"{what} are not offered with {count} degrees of freedom of structures; allowed: {MOST_INNER}; reduce "
            "them: kept_modes = 5 keeps five modes beside those of points, as ss.machine.reduced does; simulate takes "
            "more"
        )
