"""Results as HTML: a result asks here, and the reports say so when they are loaded.

Results lie below the reports and know none of them; this table is what they share, as `pictures` is for figures.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from steadyslip.core.errors import NotAvailable

Maker = Callable[..., str]
_sources: list[Callable[[], object]] = []
_makers: dict[str, Maker] = {}


def pages_from(load: Callable[[], object]) -> None:
    """Name a function that loads the reports; called once, when a page is made for the first time."""
    _sources.append(load)


def register_pages(*, brief: Maker, whole: Maker) -> None:
    """Say which functions make HTML of a result: a part of a page, and a document."""
    _makers.update(brief=brief, whole=whole)


def brief(result: Any) -> str:
    """A result as a part of a page, for notebooks."""
    return _made("brief")(result)


def whole(result: Any, **options: Any) -> str:
    """A result as a document of its own."""
    return _made("whole")(result, **options)


def _made(kind: str) -> Maker:
    while _sources:
        _sources[-1]()
        _sources.pop()
    if kind not in _makers:
        raise NotAvailable("there are no pages here: the reports are not loaded")
    return _makers[kind]


class Displayed:
    """Base of what notebooks show as HTML."""

    def _repr_html_(self) -> str:
        return brief(self)
