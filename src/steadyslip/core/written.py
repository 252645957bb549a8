"""Context of the units in which text and figures tell quantities: those in which the user wrote the rig's file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")
_names: ContextVar[frozenset[str]] = ContextVar("names of units", default=frozenset())
_load: ContextVar[float | None] = ContextVar("load of a contact", default=None)


def display_names() -> frozenset[str]:
    """Names of the units of the context."""
    return _names.get()


@contextmanager
def display_units(names: Iterable[str]) -> Iterator[None]:
    """Context in which quantities are formatted in the user's units, such as rpm, bar, mm^2 or N/um.

    They are added to those of the context around. Of several units of a dimension the one is used whose number is
    closest to 10. Units that differ from the default by a leading prefix alone, such as kN or um, have no effect on
    results, since a suitable prefix is chosen in any case; but speeds and all that turns keep theirs, from 0.001 to
    10 000 of it, forces and stresses that are in N or Pa alone those, and parameters what they were written in
    (`steadyslip.core.format.format_as_written`). Friction per load is told at the largest load that is named, or that
    which `of_load` picks.

    >>> from steadyslip.core.format import format_quantity
    >>> with display_units(["rpm", "kN", "MPa", "bar", "N/um"]):
    ...     format_quantity(10.0, "rad/s"), format_quantity(2e4, "N"), format_quantity(2e5, "Pa")
    ...     format_quantity(2e7, "Pa"), format_quantity(12e6, "N/m")
    ('95.49 rpm', '20 kN', '2 bar')
    ('20 MPa', '12 N/um')
    """
    before = _names.set(_names.get().union(names))
    try:
        yield
    finally:
        _names.reset(before)


@contextmanager
def si_units() -> Iterator[None]:
    """Context in which the user's units do not count: of rates and frequencies, which are no speeds or gains.

    >>> from steadyslip.core.format import format_quantity
    >>> with display_units(["rpm"]), si_units():
    ...     format_quantity(110.9, "rad/s")
    '110.9 rad/s'
    """
    before = _names.set(frozenset())
    try:
        yield
    finally:
        _names.reset(before)


def display_load() -> float | None:
    """Load of the contact of which quantities are told, N; None if it is not known."""
    return _load.get()


@contextmanager
def of_load(load: float | None) -> Iterator[None]:
    """Context in which friction per load is told at the one of several loads that is nearest to that of its contact, N.

    >>> from steadyslip.core.format import format_quantity
    >>> with display_units(["N/um at 500 N", "N/um at 60 N"]), of_load(70.0):
    ...     format_quantity(1000.0, "1/m"), format_quantity(1e5, "1/m")
    ('0.06 N/um at 60 N', '6 N/um at 60 N')
    """
    before = _load.set(load)
    try:
        yield
    finally:
        _load.reset(before)


def in_written_units(make: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator of a function that makes text or figures: quantities are in the units of the file that was read.

    That is the file of the rig which is among the arguments, or which one of them is the result of.
    """

    @wraps(make)
    def made(*args: _P.args, **named: _P.kwargs) -> _T:
        written = [name for one in (*args, *named.values()) for name in _written_in(one)]
        if _names.get().issuperset(written):
            return make(*args, **named)
        with display_units(written):
            return make(*args, **named)

    return made


def _written_in(one: Any) -> tuple[str, ...]:
    """Units in which a rig, or the rig of a result, was written; none for anything else."""
    return getattr(one, "written_in", ()) or getattr(getattr(one, "rig", None), "written_in", ())
