"""Registry of the functions that draw results.

Results must not import the figures above them, so the figures register their functions here when they are loaded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from steadyslip.core.errors import NotAvailable, keywords_of, refuse_unknown, unknown_name
from steadyslip.core.written import in_written_units

_figures: dict[type, dict[str, Callable[..., Any]]] = {}
_sources: list[Callable[[], object]] = []
_savers: list[Callable[[Any, str, Any], object]] = []


def register_figures(result: type, **figures: Callable[..., Any]) -> None:
    """Register drawing functions of a result type, by kind of plot; the first kind is the default.

    Each function takes the result and ``ax``, and returns the Axes. A later registration of a kind replaces the
    earlier one, so that users can substitute a figure of their own.
    """
    _figures.setdefault(result, {}).update(figures)


def figures_from(load: Callable[[], object]) -> None:
    """Set a function that imports the figures; it is called once, when the first figure is drawn."""
    _sources.append(load)


def saved_by(save: Callable[[Any, str, Any], object]) -> None:
    """Set the function that saves drawn Axes to a file, given the path and the result that they show."""
    _savers[:] = [save]


@in_written_units
def save(axes: Any, path: str, result: Any) -> None:
    """Save the figure of Axes, or of an array of them, with what it shows: the rig of the result, version and date."""
    _savers[-1](axes, path, result)


@in_written_units
def draw(result: Any, kind: str | None = None, **options: Any) -> Any:
    """Draw a result and return what its drawing function returns, usually the Axes.

    Raises
    ------
    NotAvailable
        If the result type has no figure of this kind.
    ParameterError
        If the figure does not take one of the options.
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
    function, *first = known[chosen], *keywords_of(known[chosen])[:1]
    refuse_unknown(f"{type(result).__name__}.plot(kind={chosen!r})", options, keywords_of(function, first))
    return function(result, **options)
