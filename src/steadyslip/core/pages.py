"""Registry of the functions that turn results into HTML.

Results must not import the reports above them, so the reports register their functions here when they are loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Self

from steadyslip.core.errors import NotAvailable
from steadyslip.core.written import display_names, in_written_units

Maker = Callable[..., str]
_sources: list[Callable[[], object]] = []
_makers: dict[str, Maker] = {}


def pages_from(load: Callable[[], object]) -> None:
    """Set a function that imports the reports; it is called once, when the first page is made."""
    _sources.append(load)


def register_pages(*, brief: Maker, whole: Maker) -> None:
    """Register the functions that make HTML of a result: `brief` a fragment, `whole` a document."""
    _makers.update(brief=brief, whole=whole)


@in_written_units
def brief(result: Any) -> str:
    """HTML fragment of a result, for notebooks."""
    return _made("brief")(result)


@in_written_units
def whole(result: Any, **options: Any) -> str:
    """HTML document of a result."""
    return _made("whole")(result, **options)


def _made(kind: str) -> Maker:
    while _sources:
        _sources[-1]()
        _sources.pop()
    if kind not in _makers:
        raise NotAvailable("results have no HTML here: the reports are not loaded; import steadyslip as a whole")
    return _makers[kind]


class Displayed:
    """Base of objects that print themselves in the units of their rig's file, and that notebooks display as HTML."""

    written_in: ClassVar[tuple[str, ...]] = ()
    """Units of the rig's file, in which the rig and its results are printed; not compared by ==."""

    def __new__(cls, *_: Any, **__: Any) -> Self:
        made = super().__new__(cls)
        return made.set_display_units(sorted(display_names())) if display_names() else made

    def set_display_units(self, names: Iterable[str]) -> Self:
        """Set the units in which the object is printed from now on, and return the object itself."""
        object.__setattr__(self, "written_in", tuple(dict.fromkeys(names)))
        return self

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if text := cls.__dict__.get("__str__"):
            cls.__str__ = in_written_units(text)  # type: ignore[method-assign]

    def _repr_html_(self) -> str:
        return brief(self)
