"""Which figure shows which result: a result asks here, and the figures say so when they are loaded.

Results lie below the figures and know none of them; this table is what they share.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from steadyslip.core.errors import NotAvailable, unknown_name

_figures: dict[type, dict[str, Callable[..., Any]]] = {}
_sources: list[Callable[[], object]] = []


def register_figures(result: type, **figures: Callable[..., Any]) -> None:
    """Say by which functions a type of result is drawn, by kind; the first kind is drawn unless another is asked for.

    Each takes the result first, and ``ax``, and returns the Axes. A later registration of a kind replaces it, so that
    users can put a figure of their own in place of ours.
    """
    _figures.setdefault(result, {}).update(figures)


def figures_from(load: Callable[[], object]) -> None:
    """Name a function that loads figures; called once, when something is drawn for the first time."""
    _sources.append(load)


def draw(result: Any, kind: str | None = None, **options: Any) -> Any:
    """Draw a result; what comes back is what its figure returns.

    Raises
    ------
    NotAvailable
        If there is no such figure of it.
    """
    while _sources:
        _sources[-1]()
        _sources.pop()
    known: dict[str, Callable[..., Any]] = {}
    for base in reversed(type(result).__mro__):
        known |= _figures.get(base, {})
    if not known:
        raise NotAvailable(f"there is no figure of a {type(result).__name__}")
    chosen = next(iter(known)) if kind is None else kind
    if chosen not in known:
        raise NotAvailable(unknown_name("kind of plot", chosen, known))
    return known[chosen](result, **options)
