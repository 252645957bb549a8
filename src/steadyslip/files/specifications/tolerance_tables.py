"""Tolerances, correlations and adjustable parameters of a rig file.

A value of a rig's tables may be a text with a tolerance, ``stiffness = "12 ± 20 % N/um"``; reading a rig takes the
value only, `read_tolerances` the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

from steadyslip.core.domains import nonnegative
from steadyslip.core.errors import ParameterError, Problem, QuantityError, UnknownNameError, repr_short, unknown_name
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.roles import Parameter
from steadyslip.core.tolerances import Tolerance, read_tolerance
from steadyslip.files.specifications.layout import nested_keys
from steadyslip.files.specifications.read import read_whole
from steadyslip.files.specifications.toml import Table
from steadyslip.files.specifications.unknowns import intervals_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

_KEYS = ("from", "to", "cost")


@dataclass(frozen=True)
class Adjustment(Displayed):
    """Allowed change of one parameter of a rig.

    Attributes
    ----------
    low, high : float or None
        Limits of the value, SI units; None to use the limits of the search.
    cost : float or None
        Cost of doubling or halving the value; other changes in proportion to their logarithm. None for the default, see
        `steadyslip.verdict.change_costs`.
    """

    low: float | None = None
    high: float | None = None
    cost: float | None = None


@dataclass(frozen=True)
class Tolerances(Displayed):
    """Tolerances of a rig file: deviations, correlations, adjustable and unknown parameters.

    Attributes
    ----------
    values : dict of str to Tolerance
        Tolerances by dotted name.
    correlations : tuple of (str, str, float)
        Two parameters and their coefficient of correlation.
    adjust : dict of str to Adjustment
        Parameters that may be changed; empty without a table ``[adjust]``.
    unknown : dict of str to (float, float)
        Intervals of the table ``[unknown]``, SI units.
    """

    values: Mapping[str, Tolerance] = field(default_factory=dict)
    correlations: tuple[tuple[str, str, float], ...] = ()
    adjust: Mapping[str, Adjustment] = field(default_factory=dict)
    unknown: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """True if any parameter has a tolerance."""
        return bool(self.values)


@checked()
def read_tolerances(path: str | PathLike[str], changes: Iterable[str] = ()) -> Tolerances:
    """Read the tolerances, correlations and adjustable parameters of a rig file.

    Parameters
    ----------
    path : path
        TOML file, UTF-8.
    changes : iterable of str
        Values that replace or add to those of the file, as ``"stiffness=12 ± 20 % N/um"``.

    Returns
    -------
    Tolerances
        Empty if the file has none.

    Raises
    ------
    RigFileError
        If the file cannot be read or anything in it is wrong (the rig included).

    Examples
    --------
    >>> found = ss.verdict.read_tolerances("examples/inclined-spring.toml", ["stiffness=9 ± 1 GPa/m"])
    >>> found.values["slider.stiffness"].above
    '1 GPa/m'
    """
    return rig_and_tolerances(path, changes)[1]


def rig_and_tolerances(path: str | PathLike[str], changes: Iterable[str] = ()) -> tuple[Slider | Machine, Tolerances]:
    """Rig and tolerances of a rig file; see `read_tolerances`."""
    changes = list(changes)
    contents = read_whole(path, changes)
    rig = contents.rig
    if rig is None:  # invalid or absent
        contents.refuse()
        return contents.checked_rig(), Tolerances()
    reader = _Reader(rig, contents.tables)
    found = Tolerances(reader.values(contents.tolerances), reader.correlations(), reader.adjust())
    contents.refuse(*reader.problems)
    return rig, replace(found, unknown=intervals_of(rig, path, changes))


class _Reader:
    """Reader of the tables on tolerances for one rig; collects problems."""

    def __init__(self, rig: Slider | Machine, tables: Table) -> None:
        self.rig, self.tables = rig, tables
        self.problems: list[Problem] = []

    def values(self, written: Mapping[str, Tolerance]) -> dict[str, Tolerance]:
        found = {}
        for path, one in written.items():
            if name := self._name(path, path):
                found[name] = one
        for path, raw in self._table("tolerances"):
            if not (name := self._name(path, f"tolerances.{path}")):
                continue
            if name in found:
                self._problem(f"tolerances.{path}", "is given with the value as well; write it once")
            elif not isinstance(raw, str):
                self._problem(f"tolerances.{path}", f"got {repr_short(raw)}; allowed: text such as '20 %'")
            else:
                try:
                    found[name] = read_tolerance(raw)
                except QuantityError as error:
                    self._problem(f"tolerances.{path}", str(error))
        return found

    def correlations(self) -> tuple[tuple[str, str, float], ...]:
        raw = self.tables.get("correlations", [])
        form = "[[correlations]] with between = ['mu_static', 'mu_coulomb'] and value = 0.8"
        found: list[tuple[str, str, float]] = []
        if not isinstance(raw, list):
            self._problem("correlations", f"got a single table; allowed: {form}")
            return ()
        for place, one in enumerate(raw, start=1):
            pair = one.get("between") if isinstance(one, dict) else None
            value = one.get("value") if isinstance(one, dict) else None
            number = isinstance(value, (int, float)) and not isinstance(value, bool) and -1 < value < 1
            two = isinstance(pair, list) and len(pair) == 2 and set(one) == {"between", "value"}
            if not (two and number):
                self._problem(
                    f"correlations.{place}", f"got {repr_short(one)}; allowed: {form}, a number between -1 and 1"
                )
                continue
            names = [self._name(str(name), f"correlations.{place}.between") for name in pair]  # type: ignore[union-attr]
            if names[0] and names[1]:
                found.append((names[0], names[1], float(value)))  # type: ignore[arg-type]
        return tuple(found)

    def adjust(self) -> dict[str, Adjustment]:
        found = {}
        for path, raw in self._table("adjust"):
            where = f"adjust.{path}"
            owner, _, key = path.rpartition(".")
            if not isinstance(raw, dict) and self._known(owner):  # a misspelt key makes it look like a parameter
                self._problem(where, unknown_name("key", key, _KEYS))
                continue
            if not (name := self._name(path, where)):
                continue
            if not isinstance(raw, dict):
                self._problem(where, f"got {repr_short(raw)}; allowed: {{ from = ..., to = ..., cost = ... }}")
                continue
            for key in raw:
                if key not in _KEYS:
                    self._problem(f"{where}.{key}", unknown_name("key", key, _KEYS))
            low, high = (self._limit(name, raw.get(key), f"{where}.{key}") for key in ("from", "to"))
            cost = self._read(Parameter("1", nonnegative, "").checked, raw["cost"], where) if "cost" in raw else None
            if low is not None and high is not None and not low < high:
                self._problem(where, "from must be below to; exchange the two")
            found[name] = Adjustment(low, high, cost)
        return found

    def _limit(self, name: str, raw: Any, where: str) -> float | None:
        if raw is None:
            return None
        role = self.rig.parameters()[name].role
        return self._read(lambda value: role.checked(self.rig.read(name, value)), raw, where)

    def _read(self, read: Callable[[Any], float], raw: Any, where: str) -> float | None:
        try:
            return read(raw)
        except ParameterError as error:
            self._problem(where, error.problems[0].message)
            return None

    def _table(self, name: str) -> Iterator[tuple[str, Any]]:
        """Values of a table by dotted name."""
        table = self.tables.get(name, {})
        if not isinstance(table, dict):
            self._problem(name, f"got {repr_short(table)}; allowed: a table [{name}]")
            return
        yield from ((".".join(path), value) for path, value in nested_keys(table, _KEYS))

    def _known(self, given: str) -> bool:
        """True if a parameter has this name."""
        with suppress(UnknownNameError):
            return bool(self.rig.resolve(given))
        return False

    def _name(self, given: str, where: str) -> str:
        """Full name of a parameter in the rig's equations; empty after reporting a problem."""
        known = {name: one for name, one in self.rig.parameters().items() if one.value is not None}
        try:
            name = self.rig.resolve(given)
        except UnknownNameError as error:
            self._problem(where, str(error))
            return ""
        if name not in known or name in self.rig.not_in_model:
            self._problem(where, "takes no part in the equations of this rig; leave it out")
            return ""
        return name

    def _problem(self, name: str, message: str) -> None:
        self.problems.append(Problem(name, message))
