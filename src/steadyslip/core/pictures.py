"""Registry of the functions that draw results.

Results must not import the figures above them, so the figures register their functions here when they are loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any

from steadyslip.core.errors import NotAvailable, keywords_of, refuse_unknown, unknown_name
from steadyslip.core.written import in_written_units

_figures: dict[type, dict[str, Callable[..., Any]]] = {}
_sources: list[Callable[[], object]] = []
_savers: list[Callable[[Any, str, Any], object]] = []
_columns: list[Callable[[], AbstractContextManager[None]]] = []
_is_column: ContextVar[bool] = ContextVar("files are figures of one column", default=False)


def register_figures(result: type, **figures: Callable[..., Any]) -> None:
    """Register drawing functions of a result type, by kind of plot; the first kind is the default.

    Each function takes the result and ``ax``, and returns the Axes. A later registration of a kind replaces the
    earlier one, so that users can substitute a figure of their own.
    """
    _figures.setdefault(result, {}).update(figures)


def figures_from(load: Callable[[], object]) -> None:
    """Set a function that imports the figures; it is called once, when the first figure is drawn."""
    _sources.append(load)


def saved_by(save: Callable[[Any, str, Any], object], column: Callable[[], AbstractContextManager[None]]) -> None:
    """Set the function that saves drawn Axes to a file, given the path and the result that they show.

    In the context `column` figures are drawn as wide as one column of a journal.
    """
    _savers[:], _columns[:] = [save], [column]


@contextmanager
def for_a_journal() -> Iterator[None]:
    """Context in which figures drawn for a file are as wide as one column of a journal."""
    before = _is_column.set(True)
    try:
        yield
    finally:
        _is_column.reset(before)


def drawn_for_file(figure: Callable[[], Any]) -> Any:
    """Axes returned by the drawing function `figure`, as wide as figures in files are in this context."""
    _load_figures()
    with _columns[-1]() if _is_column.get() else nullcontext():
        return figure()


@in_written_units
def save(axes: Any, path: str, result: Any) -> None:
    """Save the figure of Axes (or an array of them) to a file, with the result's rig, version and date in a footer."""
    _savers[-1](axes, path, result)


def _load_figures() -> None:
    while _sources:
        _sources[-1]()
        _sources.pop()


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
    _load_figures()
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
