"""Intervals of parameters that have not been measured: the table [unknown] of a rig file.

    [unknown]
    friction.bristle_stiffness = ["20 N/um at 3.2 kN", "2000 N/um at 3.2 kN"]

Reading the rig takes the value from the rig's own tables; the interval is for verdicts over all its values.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from os import PathLike

from steadyslip.core.errors import ParameterError, Problem, RigFileError, SteadyslipError, repr_short
from steadyslip.core.options import checked
from steadyslip.files.specifications.changes import named_value
from steadyslip.files.specifications.layout import UNKNOWN, nested_keys
from steadyslip.files.specifications.read import read_rig, text_of
from steadyslip.files.specifications.toml import key_lines, line_of, tables_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider


@checked()
def read_unknowns(
    path: str | PathLike[str], changes: Iterable[str] = ()
) -> tuple[Slider | Machine, dict[str, tuple[float, float]]]:
    """Read a rig file with its table [unknown].

    Parameters
    ----------
    path : path
    changes : iterable of str
        As for `read_rig`; a parameter that is changed counts as known.

    Returns
    -------
    rig : Slider or Machine
    unknown : dict of str to (float, float)
        Least and largest value by dotted name, SI units.

    Raises
    ------
    RigFileError
        If anything in the file is wrong.
    """
    given = list(changes)
    rig = read_rig(path, given)
    return rig, intervals_of(rig, path, given)


def intervals_of(
    rig: Slider | Machine, path: str | PathLike[str], changes: Iterable[str]
) -> dict[str, tuple[float, float]]:
    """Intervals of the table [unknown] of a rig's file, without parameters that are changed: (low, high) by dotted
    name, SI units.
    """
    text = text_of(path)
    table, lines = tables_of(text).get(UNKNOWN, {}), key_lines(text)
    known = rig.parameters()
    found: dict[str, tuple[float, float]] = {}
    problems = []
    for keys, pair in nested_keys(table, ()) if isinstance(table, dict) else [((), table)]:
        name = ".".join(keys)
        try:
            full = rig.resolve(name)
            if not isinstance(pair, list) or len(pair) != 2:
                raise ParameterError([Problem("", f"got {repr_short(pair)}; allowed: a list of two, [least, largest]")])
            role, area = known[full].role, rig.area_of(full)
            low, high = (role.read(one, area) for one in pair)
            if not low < high:
                raise ParameterError([Problem("", f"got {repr_short(pair)}; allowed: the smaller value first")])
            found[full] = (low, high)
        except SteadyslipError as error:
            message = error.problems[0].message if isinstance(error, ParameterError) else str(error)
            where = f"{UNKNOWN}.{name}"
            problems.append(Problem(where, message, line_of(where, lines)))
    if problems:
        raise RigFileError(problems, title=str(path))
    changed = set()
    for name, _ in map(named_value, changes):
        with suppress(SteadyslipError):  # the change concerns another table
            changed.add(rig.resolve(name))
    return {name: ends for name, ends in found.items() if name not in changed}
