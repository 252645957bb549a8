"""Bound on structures in stages whose work grows with the square and cube of the number of variables."""

from __future__ import annotations

from steadyslip.core.errors import NotAvailable
from steadyslip.model.equations import Model

MOST_INNER = 8
"""Most degrees of freedom of structures: a branch of cycles takes 5 CPU s with 3 and 14 with 5, code alone minutes with
24; the neighbourhood that surely returns has as many terms as the fourth power of the variables."""


def refuse_many_inner(model: Model, what: str) -> None:
    """Raise NotAvailable if structures have too many degrees of freedom for `what`."""
    count = sum(one.inner for one in model.coordinates)
    if count > MOST_INNER:
        raise NotAvailable(
            f"{what} are not offered with {count} degrees of freedom of structures; allowed: {MOST_INNER}; reduce "
            "them: kept_modes = 5 keeps five modes beside those of points, as ss.machine.reduced does; simulate takes "
            "more"
        )
