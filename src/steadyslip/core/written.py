"""Context of the units in which text and figures tell quantities: those in which the user wrote the rig's file."""

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
    """Names of the units of the context."""
    return _names.get()


@contextmanager
def display_units(names: Iterable[str]) -> Iterator[None]:
    """Context in which quantities are formatted in the user's units, such as rpm, bar, mm^2 or N/um.

    They are added to those of the context around. Of several units of a dimension the one is used whose number is
    closest to 10. Units that differ from the default by a leading prefix alone, such as kN or um, have no effect on
    results, since a suitable prefix is chosen in any case; but speeds and all that turns keep theirs, from 0.001 to
    10 000 of it, forces and stresses that are in N or Pa alone those, and parameters what they were written in
    (`steadyslip.core.format.format_as_written`). Friction per load is told at the load of `told_as`, or without one at
    the largest that is named.

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


class WrittenAs(NamedTuple):
    """How a file writes a parameter.

    Attributes
    ----------
    unit : str
        Empty if it is not known.
    load : float or None
        Load (N) at which friction per load is told without a unit; 0 where it is told per load, None if not known.
    """

    unit: str = ""
    load: float | None = None


_NOT_WRITTEN = WrittenAs()
_written_as: ContextVar[WrittenAs] = ContextVar("how a parameter is written", default=_NOT_WRITTEN)


def display_as() -> WrittenAs:
    """How the file writes the parameter of which quantities are told."""
    return _written_as.get()


@contextmanager
def told_as(written: WrittenAs) -> Iterator[None]:
    """Context in which values of a parameter are told: in the unit in which the file writes it, or at its load.

    >>> from steadyslip.core.format import format_quantity
    >>> with display_units(["N/um at 500 N", "N/um at 60 N"]), told_as(WrittenAs(load=70.0)):
    ...     format_quantity(1000.0, "1/m"), format_quantity(1e5, "1/m")
    ('0.07 N/um at 70 N', '7 N/um at 70 N')
    >>> with display_units(["mm/s", "mm/min"]), told_as(WrittenAs("mm/s")):
    ...     format_quantity(8e-4, "m/s")
    '0.8 mm/s'
    """
    before = _written_as.set(written)
    try:
        yield
    finally:
        _written_as.reset(before)


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
