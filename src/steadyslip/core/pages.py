"""Registry of the functions that turn results into HTML.

Results must not import the reports above them, so the reports register their functions here when they are loaded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from steadyslip.core.errors import NotAvailable

Maker = Callable[..., str]
_sources: list[Callable[[], object]] = []
_makers: dict[str, Maker] = {}


def pages_from(load: Callable[[], object]) -> None:
    """Set a function that imports the reports; it is called once, when the first page is made."""
    _sources.append(load)


def register_pages(*, brief: Maker, whole: Maker) -> None:
    """Register the functions that make HTML of a result: `brief` a fragment, `whole` a document."""
    _makers.update(brief=brief, whole=whole)


def brief(result: Any) -> str:
    """HTML fragment of a result, for notebooks."""
    return _made("brief")(result)


def whole(result: Any, **options: Any) -> str:
    """HTML document of a result."""
    return _made("whole")(result, **options)


def _made(kind: str) -> Maker:
    while _sources:
        _sources[-1]()
        _sources.pop()
    if kind not in _makers:
        raise NotAvailable("there are no pages here: the reports are not loaded")
    return _makers[kind]


class Displayed:
    """Base of objects that notebooks display as HTML."""

    def _repr_html_(self) -> str:
        return brief(self)
