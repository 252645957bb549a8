"""Context with the display units of texts and figures: the units in which the user wrote the rig's file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")
_names: ContextVar[frozenset[str]] = ContextVar("names of units", default=frozenset())


def display_names() -> frozenset[str]:
    """Names of the display units of the current context; empty outside `display_units`."""
    return _names.get()


@contextmanager
def display_units(names: Iterable[str]) -> Iterator[None]:
    """Context in which quantities are formatted in the user's units, such as rpm, bar, mm^2 or N/um.

    They are added to the units of the enclosing context. Among several units of one dimension, the one in which the
    number is closest to 10 is used. Units that differ from the default only by a leading prefix, such as kN or um, have
    no effect on results, since a suitable prefix is chosen anyway. Exceptions keep the user's unit: speeds and angular
    quantities from 0.001 to 10 000 units; forces and stresses if all of them are in plain N or Pa; and parameters
    (`steadyslip.core.format.format_as_written`). Friction per load is printed at the load set by `displayed_as`, or
    else at the largest load among the units.

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
    """Context in which the user's units are ignored: for rates and frequencies, whose unit may equal that of a gain.

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


class WrittenAs(NamedTuple):
    """Unit of a parameter in the rig's file, and the load at which friction per load is printed.

    Attributes
    ----------
    unit : str
        Unit in the file; empty if it is not known.
    load : float or None
        Load (N) at which friction per load is printed as a force if `unit` is empty; 0 to print it per load, None if
        not known.
    """

    unit: str = ""
    load: float | None = None


_NOT_WRITTEN = WrittenAs()
_written_as: ContextVar[WrittenAs] = ContextVar("how a parameter is written", default=_NOT_WRITTEN)


def display_as() -> WrittenAs:
    """Unit and load that `displayed_as` has set for the current context; without it, no unit and no load."""
    return _written_as.get()


@contextmanager
def displayed_as(written: WrittenAs) -> Iterator[None]:
    """Context in which quantities are formatted in a parameter's unit in the file, or friction per load at its load.

    >>> from steadyslip.core.format import format_quantity
    >>> with display_units(["N/um at 500 N", "N/um at 60 N"]), displayed_as(WrittenAs(load=70.0)):
    ...     format_quantity(1000.0, "1/m"), format_quantity(1e5, "1/m")
    ('0.07 N/um at 70 N', '7 N/um at 70 N')
    >>> with display_units(["mm/s", "mm/min"]), displayed_as(WrittenAs("mm/s")):
    ...     format_quantity(8e-4, "m/s")
    '0.8 mm/s'
    """
    before = _written_as.set(written)
    try:
        yield
    finally:
        _written_as.reset(before)


def in_written_units(make: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorator of functions that make text or figures: quantities are formatted in the units of the rig's file.

    The rig is an argument of the function, or the ``rig`` of a result among the arguments.
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
    """Units of the file of a rig, or of a result's rig; empty for any other object."""
    return getattr(one, "written_in", ()) or getattr(getattr(one, "rig", None), "written_in", ())
