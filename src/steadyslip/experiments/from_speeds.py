"""Fits of a friction law to a table of friction at constant speeds (`fit_friction_table`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem, keywords_of, refuse_unknown, unknown_name
from steadyslip.core.options import checked
from steadyslip.core.records import role_of
from steadyslip.core.roles import Parameter
from steadyslip.experiments.fitting.speed_fit import fit_direction, fit_loop
from steadyslip.experiments.fitting.speed_result import SpeedFit
from steadyslip.experiments.measured.speed_headers import UNITS_OF_ROLES
from steadyslip.experiments.measured.speeds import (
    SpeedTable,
    checked_option,
    is_loop,
    read_loop,
    read_speed_table,
    table_from_arrays,
)
from steadyslip.files.specifications.changes import named_value
from steadyslip.files.specifications.layout import find_law
from steadyslip.laws.friction.law import FrictionLaw

ERRORS = ("relative", "absolute")


@checked()
def fit_friction_table(
    table: str | PathLike[str] | Mapping[str, Any] | SpeedTable,
    law: str,
    *,
    load: Any = None,
    loop: str | PathLike[str] | None = None,
    hold: Mapping[str, Any] | None = None,
    errors: str = "relative",
    radius: float | str | None = None,
    **columns: Any,
) -> SpeedFit:
    """Fit a friction law to friction that was measured at constant speeds.

    Each direction is fitted separately. If there are too few rows for all parameters, some are fixed: the Stribeck
    exponent at 2, then the viscosity at 0. If the load differs between rows, two more parameters are fitted: a constant
    load that acts in addition, and a viscous drag that does not depend on the load.

    Parameters
    ----------
    table : path, or mapping of str to array_like
        File with columns of speed, of force, torque or friction coefficient, and optionally of load and direction; or
        arrays by these names in SI units, ``{"speed": [...], "force": [...]}``. Negative speeds are backward motion.
    law : str
        Registered name of a friction law.
    load : float or str, optional
        Constant load, N, if the table has no column for it. Without any load, fitted coefficients are forces.
    loop : path, optional
        Table of displacement and force before sliding, from which the stiffness of bristles follows.
    hold : mapping of str to float or str, optional
        Known parameters of the law, which are not fitted.
    errors : str
        ``"relative"`` if errors are in proportion to the measured friction, such as 1 % of the reading; ``"absolute"``
        if all errors have the same size, such as 1 % of full scale.
    radius : float or str, optional
        Radius, m, at which friction acts in the rig file, for a table of torques; by default 1 m.
    **columns
        Column or unit by role, if the names of columns do not suffice: ``speed="mm/min"``, ``force="F2"``.

    Returns
    -------
    SpeedFit
        Estimates with errors and 68 and 95 % intervals; `print` shows them, and `rig_text` is a rig file.

    Raises
    ------
    ParameterError
        If the table, a column, or an option is not valid.
    NotAvailable
        If there are too few speeds for the law, or a file cannot be read.

    Notes
    -----
    An interval contains the values at which the sum of squares, minimised over the other parameters, exceeds its
    minimum by no more than s² t². The variance s² follows from the residuals. The number of degrees of freedom of
    Student's t is the number of rows minus the number of parameters.

    Examples
    --------
    >>> import steadyslip as ss
    >>> speed = [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2]  # m/s
    >>> table = {"speed": speed, "force": [91.2, 82.4, 64.9, 53.1, 53.3, 59.6]}
    >>> found = ss.experiments.fit_friction_table(table, "lugre", load="500 N",
    ...                                           hold={"stribeck_exponent": 1.0})
    >>> print(found["mu_coulomb"])
    mu_coulomb = 0.1012 ± 0.00092
    """
    roles = () if isinstance(table, Mapping | SpeedTable) else UNITS_OF_ROLES  # the names of arrays are roles
    refuse_unknown("fit_friction_table", columns, [*roles, *keywords_of(fit_friction_table)])
    if errors not in ERRORS:
        raise ParameterError([Problem("errors", f"got {errors!r}; allowed: {' or '.join(map(repr, ERRORS))}")])
    if isinstance(table, SpeedTable):
        read = table
    elif isinstance(table, Mapping):
        pressed = {} if load is None else {"load": checked_option("load", load, "N", "arrays")}
        read = table_from_arrays({**table, **pressed})
    else:
        read = read_speed_table(table, load=load, **columns)
    if radius is not None:
        if not read.turns:
            raise ParameterError([Problem("radius", "applies only to torques over rpm or rad/s; leave it out")])
        read = replace(read, radius=checked_option("radius", radius, "m", read.source))
    kind = _law(law)
    held = _held(kind, hold or {})
    sides = {
        side: fit_direction(read, kind, side, held, errors == "relative")
        for side in (True, False)
        if np.any((read.speed > 0) == side)
    }
    bristles = None
    if loop is not None:
        measured = read_loop(loop)
        if measured.turns != read.turns:
            raise ParameterError(
                [
                    Problem(
                        "loop",
                        "is for a rotation and the table for sliding, or the reverse; give both for the same motion",
                    )
                ]
            )
        bristles = fit_loop(measured)
    return SpeedFit(read, law, sides.get(True), sides.get(False), bristles, errors == "relative")


def _law(name: str) -> Any:
    """Friction law with a registered name; raises a ParameterError on the argument ``law`` if there is none."""
    try:
        return find_law(FrictionLaw, name)
    except ParameterError as error:
        raise ParameterError([Problem("law", problem.message) for problem in error.problems]) from error


def _held(law: Any, given: Mapping[str, Any]) -> dict[str, float]:
    """Values, in SI units and by name, of the parameters that are fixed in a fit of a law."""
    found, problems = {}, []
    roles = {item.name: role for item in fields(law) if isinstance(role := role_of(item), Parameter)}
    for name, value in given.items():
        try:
            if name not in roles:
                raise ParameterError([Problem("", unknown_name("parameter", name, roles))])
            found[name] = roles[name].checked(_number(value))
        except ParameterError as error:
            problems += [one.under(name) for one in error.problems]
    if problems:
        raise ParameterError(problems, title="hold")
    return found


def _number(value: Any) -> Any:
    """Number from a text without a unit; other values are returned unchanged."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return value


def fit_speed_files(files: Sequence[Path], law: str, changes: Sequence[str]) -> SpeedFit:
    """Fit to the tables given on a command line: one table of friction over speed, and optionally a presliding loop.

    Raises
    ------
    NotAvailable
        If there is not exactly one table of speeds, or more than one loop.
    """
    loops = [path for path in files if is_loop(path)]
    tables = [path for path in files if path not in loops]
    if len(tables) != 1 or len(loops) > 1:
        message = (
            f"got {len(tables)} tables of speeds and {len(loops)} of displacement; allowed: one table of speeds, and "
            "one of displacement or none"
        )
        raise NotAvailable(message)
    options: dict[str, Any] = {}
    hold: dict[str, Any] = {}
    names = {item.name for item in fields(_law(law))}
    for name, value in map(named_value, changes):
        own = name.removeprefix("friction.")
        (hold if own in names else options)[own] = value
    if len(loops) == 1:
        options["loop"] = loops[0]
    return fit_friction_table(tables[0], law, hold=hold, **options)
