"""Roles and units of the columns of a table, found in their names or given by the user."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import Problem, QuantityError, unknown_name
from steadyslip.core.quantities import described, example

ROLES = {
    "time": "s",
    "displacement": "m",
    "velocity": "m/s",
    "friction": "1",
    "shear": "Pa",
    "normal": "Pa",
    "pore_pressure": "Pa",
}
"""Roles of columns, with SI units; displacement and velocity are those of the load point."""

MOST_LISTED = 40  # largest number of names in a message: more would not be read

_WORDS = {
    "s": ("sec", "secs", "second", "seconds"),
    "min": ("minutes", "minute"),
    "h": ("hr", "hrs", "hours"),
    "um": ("micron", "microns", "mic", "micrometer", "micrometers", "micrometre", "micrometres"),
    "mm": ("millimeter", "millimeters", "millimetre", "millimetres"),
    "um/s": ("microns/s", "micron/s", "microns/sec", "um/sec", "umps"),
    "mm/s": ("mm/sec",),
    "1": ("-", "none", "unitless", "dimensionless", "adim", "ratio"),
}
_SPELLINGS = {word: name for name, words in _WORDS.items() for word in words}
_SUFFIXES = ("s", "ms", "min", "h", "m", "cm", "mm", "um", "nm", "Pa", "kPa", "MPa", "GPa", "N", "kN", "mN", "uN")
_TIMES = {"time", "times", "elapsed", "elapsedtime", "uhrzeit", "datetime", "date", "datum", "tiempo", "tempo"}
_FRICTION = re.compile(r"friction|fricción|rozamiento|attrito|^reib(ungs?)?(wert|zahl|koeff|beiwert|$)")
_DISPLACED = re.compile(r"disp|position|slip|ram|verschieb|vorschub|weg$|déplacement|desplaza|spostament")
LETTERS = ("x", "X", "d")  # letters for a displacement; not D, which may be a diameter or a thickness
_ACROSS = re.compile(r"normalweg|vertikal|normalversch")
_SHEAR = re.compile(
    r"shear|tau|τ|scher|schub|reibkraft|reibungskraft|tangential|querkraft|cisaillement|cortante|cizall|tagli|tangenzial"
)
_PORES = re.compile(r"pore|pf|pp|fluid|interstiti|poren")
_BRACKETS = re.compile(r"^(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*$")


@dataclass(frozen=True)
class Column:
    """Column of a file that has a role, with its unit.

    Attributes
    ----------
    role : str
    name : str
        Name in the file.
    unit : str
    factor : float
        Factor to SI units, without the division of a force by an area.
    force : bool
        True if a shear or normal stress was measured as a force.
    place : int
        Index of the column; needed because names may occur twice.
    """

    role: str
    name: str
    unit: str
    factor: float
    force: bool = False
    place: int = 0


def listed(names: Iterable[str]) -> str:
    """Text for a message with the first `MOST_LISTED` names, and the number of names left out."""
    every = list(names)
    more = [f"and {len(every) - MOST_LISTED} more"] if len(every) > MOST_LISTED else []
    return ", ".join([*every[:MOST_LISTED], *more])


def split_name(name: str) -> tuple[str, str | None]:
    """Name of a column without the unit that it contains, and that unit, or None if it contains none.

    >>> split_name("Normal_stress(MPa)"), split_name("lp_disp_um"), split_name("t/s"), split_name("Friction")
    (('Normal_stress', 'MPa'), ('lp_disp', 'um'), ('t', 's'), ('Friction', None))
    """
    name = name.strip().strip("\"'").strip()
    if match := _BRACKETS.match(name):
        found = known_unit(match[2])
        if found is not None and match[1]:
            return match[1].strip("/ "), found
    for separator in (",", "_", " "):
        head, _, tail = name.rpartition(separator)
        tail = tail.strip()
        plain = tail in _SUFFIXES or tail.lower() in _SPELLINGS or ("/" in tail and known_unit(tail) is not None)
        if head and plain:
            return head.strip(), known_unit(tail)
    head, _, tail = (part.strip() for part in name.partition("/"))  # quantity/unit, as ISO 80000-1 has it
    if head and head not in _SUFFIXES and head.lower() not in _SPELLINGS and (found := known_unit(tail.strip("()"))):
        return head, found
    return name, None


def known_unit(text: str) -> str | None:
    """Unit that `text` names, in the spelling of this package, such as um for microns; None if it is no unit."""
    text = text.strip()
    spelled = _SPELLINGS.get(text.lower(), text)
    if not spelled:
        return None
    try:
        unit(spelled)
    except QuantityError:
        return None
    return spelled


def guess_role(name: str, has_unit: str | None) -> str | None:
    """Role that a column has by its name (without unit) and its unit; None if they suggest no role."""
    plain = re.sub(r"[^a-zµμστäöüßéèóáíñàç]+", " ", name.lower().replace("_", " ")).strip()
    words = set(plain.split())
    dimension = None if has_unit is None else unit(has_unit)[1]
    if dimension == unit("m/s")[1]:
        return "velocity"
    joined = plain.replace(" ", "")
    if joined in ("t", "timestamp", "temps") or words & _TIMES:
        return "time"
    if re.search(r"zeit", joined) and dimension in (None, unit("s")[1]):
        return "time"
    stress = dimension in (unit("Pa")[1], unit("N")[1])
    if joined in ("mu", "µ", "μ", "f", "cof") or words & {"frict", "frottement"} or _FRICTION.search(joined):
        return "shear" if stress else "friction"
    if words & {"velocity", "vel", "rate", "speed", "vlp", "v", "vitesse"} or re.search(r"velocity|geschw", joined):
        return "velocity"
    letter = name.strip() in LETTERS and dimension == unit("m")[1]
    displaced = letter or _DISPLACED.search(joined) or words & {"lp", "lpd", "weg", "hub"}
    across = words & {"normal", "vertical", "horizontal normal"} or _ACROSS.search(joined)
    if displaced and not (stress or across):
        return "displacement"
    if dimension == unit("Pa")[1] and any(_PORES.match(word) for word in words) and "effective" not in words:
        return "pore_pressure"
    if re.search(r"normal|sigma|σ", joined) or words & {"sn", "fn", "effective", "nor", "norm"}:
        return None if dimension == unit("m")[1] or displaced else "normal"
    if _SHEAR.search(joined) or words & {"ft", "fs", "shr"}:
        return "shear"
    return None


def assign_columns(
    names: Sequence[str], given: Mapping[str, Any], file_units: Sequence[str | None]
) -> tuple[dict[str, Column], list[Problem], list[str]]:
    """Column of the file for each role, from the user's options or else from the names of columns.

    Parameters
    ----------
    names : sequence of str
        Names of the file's columns.
    given : mapping of str to Any
        For each role, name or number (from 1) of a column, a unit, or a pair of column and unit.
    file_units : sequence of str or None
        Units that the file gives apart from the names.

    Returns
    -------
    columns : dict of str to Column
    problems : list of Problem
    notes : list of str
    """
    bare = [split_name(name) for name in names]
    units = [own or other for (_, own), other in zip(bare, file_units, strict=True)]
    problems: list[Problem] = []
    notes: list[str] = []
    chosen: dict[str, tuple[int, str | None]] = {}
    for role, value in given.items():
        place, stated, fault = _from_option(role, value, names, [head for head, _ in bare])
        if fault:
            problems.append(Problem(role, fault))
        if place is not None:
            chosen[role] = (place, stated)
        elif stated is not None:
            chosen[role] = (-1, stated)
    taken = {place for place, _ in chosen.values()}
    guesses: dict[str, list[int]] = {}
    for i, (head, _) in enumerate(bare):
        guess = guess_role(head, units[i])
        if guess is not None and i not in taken:
            guesses.setdefault(guess, []).append(i)
    for role in ROLES:
        if role in chosen and chosen[role][0] >= 0:
            continue
        candidates = _preferred(role, guesses.get(role, []), names)
        if len(candidates) > 1:
            several = listed(f"{names[i]!r} (column {i + 1})" for i in candidates)
            which = "NAME" if len({names[i] for i in candidates}) == len(candidates) else "NUMBER"
            problems.append(Problem(role, f"several columns could be it: {several}; say which with {role}={which}"))
        elif candidates:
            chosen[role] = (candidates[0], chosen.get(role, (0, None))[1])
        elif role in chosen:
            problems.append(Problem(role, _missing(role, names)))
            del chosen[role]
    columns = {}
    for role, (place, stated) in chosen.items():
        column, fault, note = _with_unit(role, names[place], units[place], stated)
        if fault:
            problems.append(Problem(role, fault))
        elif column is not None:
            columns[role] = replace(column, place=place)
        notes += note
    return columns, problems, notes


def _from_option(
    role: str, value: Any, names: Sequence[str], heads: Sequence[str]
) -> tuple[int | None, str | None, str | None]:
    """Index and unit of a column from a user's option, and message on a fault in it; None for each that is absent."""
    stated: str | None = None
    if isinstance(value, Mapping):
        unknown = set(value) - {"column", "unit"}
        if unknown:
            return None, None, unknown_name("key", unknown.pop(), ["column", "unit"])
        stated, value = value.get("unit"), value.get("column")
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        value, stated = value
    if stated is not None and (not isinstance(stated, str) or known_unit(stated) is None):
        wanted = ROLES[role]
        return None, None, f"got unit {stated!r}; allowed: that of {described(wanted)}, such as {example(wanted)}"
    if value is None:
        return None, stated, None
    if isinstance(value, int) and not isinstance(value, bool):
        if not 1 <= value <= len(names):
            return None, None, f"got column {value}; allowed: 1 to {len(names)}"
        return value - 1, stated, None
    if isinstance(value, str):
        for known in (list(names), list(heads)):
            if known.count(value) == 1:
                return known.index(value), stated, None
            if value in known:
                places = [i + 1 for i, name in enumerate(known) if name == value]
                several = f"columns {', '.join(map(str, places[:-1]))} and {places[-1]} are named {value!r}"
                return None, None, f"{several}; give the number of the column"
        found = known_unit(value)
        if stated is None and found is not None and _fits(role, found):
            return None, found, None
    return None, None, unknown_name("column", value, names)


def _fits(role: str, name: str) -> bool:
    """True if the unit `name` is allowed for a role; units of force are also allowed for stresses."""
    dimension = unit(name)[1]
    return dimension == unit(ROLES[role])[1] or (role in ("shear", "normal") and dimension == unit("N")[1])


def _preferred(role: str, candidates: list[int], names: Sequence[str]) -> list[int]:
    """Columns that suit a role best: named after load point or effective stress, or with two letters; else all."""
    if len(candidates) < 2:
        return candidates
    marks = {"displacement": (r"load|lp|shear|ram", r"^\W*\w{2}"), "velocity": (r"load|lp",), "normal": (r"eff",)}
    for mark in marks.get(role, ()):
        if better := [i for i in candidates if re.search(mark, names[i].strip().lower())]:
            return better
    return candidates


def _missing(role: str, names: Sequence[str]) -> str:
    return f"no column for it; the file has {listed(map(repr, names))}; name one with {role}=NAME"


def _with_unit(
    role: str, name: str, own: str | None, stated: str | None
) -> tuple[Column | None, str | None, list[str]]:
    """Column with its unit (None for a fault), message on the fault (or None), and notes.

    The unit comes from the column's name (`own`) or from the option (`stated`). The two must not contradict each other,
    and the unit must fit the role.
    """
    notes: list[str] = []
    stated = None if stated is None else known_unit(stated)
    if own is not None and stated is not None and unit(own) != unit(stated):
        fault = f"column {name!r} is in {own} by its name, but the option says {stated}; make them agree"
        return None, fault, notes
    found = stated or own
    if found is None:
        if role == "friction":
            found = "1"
        elif role == "time":
            found = "s"
            notes.append(f"time: column {name!r} has no unit; taken as s")
        else:
            fault = f"column {name!r} has no unit; write it in the name, such as '{name}({_usual(role)})', or say "
            return None, fault + f"{role}=({name!r}, {_usual(role)!r})", notes
    factor, dimension = unit(found)
    force = role in ("shear", "normal") and dimension == unit("N")[1]
    if not _fits(role, found):
        wanted = described(ROLES[role]) + (" or a force" if role in ("shear", "normal") else "")
        return None, f"column {name!r} is in {found}; expected {wanted}", notes
    return Column(role, name, found, factor, force), None, notes


def _usual(role: str) -> str:
    return {"displacement": "um", "velocity": "um/s", "shear": "MPa", "normal": "MPa", "pore_pressure": "MPa"}[role]


def missing_roles(columns: Mapping[str, Column], names: Sequence[str]) -> list[Problem]:
    """Problems, one for each role that a record needs and for which there is no column."""
    problems = []
    if "time" not in columns:
        remedy = "; without one, give sampling (the time between rows), or rate (of the load point) with a displacement"
        problems.append(Problem("time", _missing("time", names) + remedy))
    if "friction" not in columns and not {"shear", "normal"} <= set(columns):
        lacking = [role for role in ("shear", "normal") if role not in columns]
        message = f"no column for friction, nor for {' and '.join(lacking)} to compute it from; the file has "
        problems.append(Problem("friction", message + f"{listed(map(repr, names))}; name one with friction=NAME"))
    return problems
