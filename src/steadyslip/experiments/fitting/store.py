"""Storage of fits, with their records, in netCDF files; reading a file executes nothing in it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import astuple, fields, replace
from functools import partial
from itertools import chain
from os import PathLike
from typing import Any, TypeVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, SteadyslipError
from steadyslip.core.results import read_only
from steadyslip.experiments.fitting.beginning import Beginning
from steadyslip.experiments.fitting.estimates import Combination
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.numbers import FitNumbers
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.refit import RampFit
from steadyslip.experiments.fitting.remedies import Remedy
from steadyslip.experiments.fitting.search import SearchSummary
from steadyslip.experiments.loading.loading import Change, Course, Loading
from steadyslip.experiments.loading.pressing import JoinedCurves
from steadyslip.experiments.measured.columns import ROLES
from steadyslip.experiments.measured.record import Record, whole_record
from steadyslip.experiments.numerics.noise import Noise
from steadyslip.experiments.numerics.smoothing import Smooth
from steadyslip.files.result_tables import ColumnRule, ExpectedTable, write_table
from steadyslip.files.sealed import FileKind

FIT = FileKind("fit", 10, 2**29, "write one with 'steadyslip fit ... -o fit.nc'")
RESULT_ATTRIBUTES = {"ssq": float, "search": str, "unidentified": str, "noise": str, "steadyslip": str}
ATTRIBUTES = RESULT_ATTRIBUTES | dict.fromkeys(("rig", "options", "records", "loading", "refits"), str)
_OPTIONS = {
    "free": [str], "separate": [str], "drive": str, "trend": int, "trend_axis": str, "offset": bool, "lag": bool,
    "initial": str, "loss": str, "width": {float, None},
    "calibrated": {float, None}, "rtol": float,
}  # fmt: skip
_CURVE = ([float], float, float, float, int, [float], [float])  # ends of the curve's span, or none; then `Smooth.parts`
_NUMBERS = len(fields(Change)) - 1  # count of numbers that describe a change without pieces; 8 in files without lags
_COURSE = (float, [[float]], [float], [_CURVE], float, int, int, int, int, [[float]])  # servos or shapes last
_COLUMNS = (*ROLES, "worth")
KNOWN = "known"  # option `initial` in files of fits whose `beginnings` are known from a fit to the time before
RESULT_FORMS: dict[str, Any] = {
    "search": {"starts": int, "arrived": int, "others": [float], "iterations": int, "converged": bool, "cut": bool},
    "unidentified": [{"weights": {str: float}, "deviation": float}],
    "noise": [(float, bool, float)],
}
"""Types of the attributes of any fit in JSON; see `steadyslip.files.result_tables.fits_form`."""
_FORMS = RESULT_FORMS | {
    "options": _OPTIONS | {"weighted": bool, "columns": [[str]]},
    "records": [(str, [str], bool)],
    "loading": [[[_COURSE]]],
    "refits": {
        "measured": [{str: float}],
        "ramps": [(float, float, {str: float})],
        "remedies": [(str, float, float, float, {str: float})],
        "joint": {str: float},
    },
}


F = TypeVar("F", bound=Fitted)
S = TypeVar("S", bound=FitNumbers)


def result_variables(fit: Fitted, samples: Sequence[str]) -> dict[str, Any]:
    """Variables that are in the files of all fits; `samples` holds the name of each series' dimension."""
    variables: dict[str, Any] = {
        "coordinates": ("parameter", fit.coordinates, {"long_name": "place of the minimum, logarithms where positive"}),
        "value": ("parameter", np.array(list(fit.values.values())), {}),
        "error": ("parameter", np.array(list(fit.errors.values())), {}),
        "unit": ("parameter", np.array([one.unit for one in fit.space.unknowns], dtype=object), {}),
        "covariance": (("parameter", "other"), fit.covariance, {"long_name": "of the coordinates"}),
        "bound": (("parameter", "side"), np.array(fit.bounds).T, {}),
    }
    for i, (dim, noise) in enumerate(zip(samples, fit.noise, strict=True), start=1):
        variables[f"model_{i}"] = (dim, fit.part(fit.model, i - 1), {})
        variables[f"noise_coefficients_{i}"] = (f"order_{i}", noise.coefficients, {})
        variables[f"noise_covariance_{i}"] = (f"lag_{i}", noise.covariance, {})
    return variables


def result_columns(samples: Sequence[str]) -> dict[str, ColumnRule]:
    """Rules for reading the columns that `result_variables` makes."""
    along = ("parameter",)
    found = {name: ColumnRule(along) for name in ("coordinates", "value", "error")}
    found |= {"parameter": ColumnRule(along, text=True), "other": ColumnRule(("other",), text=True)}
    found |= {"unit": ColumnRule(along, text=True), "covariance": ColumnRule(("parameter", "other"))}
    found["bound"] = ColumnRule(("parameter", "side"))
    for i, dim in enumerate(samples, start=1):
        found[f"model_{i}"] = ColumnRule((dim,))
        found[f"noise_coefficients_{i}"] = ColumnRule((f"order_{i}",))
        found[f"noise_covariance_{i}"] = ColumnRule((f"lag_{i}",))
    return found


def result_attributes(fit: Fitted) -> dict[str, Any]:
    """Attributes that are in the files of all fits, see `RESULT_ATTRIBUTES`."""
    return {
        "ssq": fit.ssq,
        "search": json.dumps(vars(fit.search)),
        "unidentified": json.dumps([vars(one) for one in fit.unidentified]),
        "noise": json.dumps([[n.lag1, n.correlated, n.innovation] for n in fit.noise]),
        "steadyslip": fit.version,
    }


def result_of(
    table: ExpectedTable, found: dict[str, Any], stored: dict[str, Any], made: Callable[..., F], plan: Any
) -> F:
    """Fit of the class `made` from the columns and attributes of a file; raises an error if they are damaged."""
    names = [one.name for one in plan.space().unknowns]
    if not (names == found["parameter"] == found["other"]):
        raise table.fault(f"its parameters are {', '.join(found['parameter']):.200}; expected {', '.join(names)}")
    if table.sizes["side"] != 2:
        raise table.fault("its bounds have no two sides")
    search, noises = stored["search"], stored["noise"]
    fit = made(
        plan=plan,
        coordinates=found["coordinates"],
        ssq=table.attributes["ssq"],
        search=SearchSummary(**search | {"others": tuple(search["others"])}),
        noise=tuple(
            Noise(lag1, correlated, found[f"noise_coefficients_{i}"], innovation, found[f"noise_covariance_{i}"])
            for i, (lag1, correlated, innovation) in enumerate(noises, start=1)
        ),
        covariance=found["covariance"],
        unidentified=tuple(Combination(**one) for one in stored["unidentified"]),
        bounds=(found["bound"][:, 0].copy(), found["bound"][:, 1].copy()),
        version=table.attributes["steadyslip"],
    )
    _check(table, fit)
    model = np.concatenate([found[f"model_{i}"] for i in range(1, len(noises) + 1)])
    fit.__dict__["model"] = read_only(model)  # taken from the file to save its computation
    return fit


def to_dataset(fit: FitNumbers) -> Any:
    """Fit as an xarray.Dataset."""
    import xarray as xr

    from steadyslip.files.specifications import stored_text

    variables = result_variables(fit, [f"sample_{i}" for i in range(1, len(fit.plan.records) + 1)])
    for i, record in enumerate(fit.plan.records, start=1):
        dim = f"sample_{i}"
        for name in _COLUMNS:
            if (column := getattr(record, name)) is not None:
                about = {"units": ROLES[name]} if name in ROLES else {}
                variables[f"{name}_{i}"] = (dim, np.asarray(column), about)
        if fit.plan.beginnings:
            about = {"long_name": "differences from steady sliding, then changes by one standard deviation"}
            variables[f"beginning_{i}"] = ((f"direction_{i}", f"memory_{i}"), fit.plan.beginning(i - 1).rows(), about)
        if fit.plan.weights is not None:
            variables[f"weight_{i}"] = (dim, fit.plan.weights[i - 1], {})
    options = {name: getattr(fit.plan, name) for name in _OPTIONS}
    options["weighted"] = fit.plan.weights is not None
    options["initial"] = KNOWN if fit.plan.beginnings else fit.plan.initial
    options["columns"] = [[n for n in _COLUMNS if getattr(r, n) is not None] for r in fit.plan.records]
    attributes = result_attributes(fit) | {
        "rig": stored_text(fit.plan.rig, fit.plan.protocol),
        "options": json.dumps(options),
        "records": json.dumps([[r.source, list(r.notes), r.integrated] for r in fit.plan.records]),
        "loading": json.dumps([_loading_to_json(r.commanded) for r in fit.plan.records]),
        "refits": json.dumps(
            {
                "measured": [] if fit.as_measured is None else [fit.as_measured],
                "ramps": [[one.share, one.ssq, one.values] for one in fit.as_ramps],
                "remedies": [[one.choice, one.ssq, one.gain, one.p, one.values] for one in fit.remedies],
                "joint": dict(fit.joint),
            }
        ),
    }
    names = list(fit.names)
    return xr.Dataset(variables, coords={"parameter": names, "other": names}, attrs=attributes)


def save(fit: FitNumbers, path: str | PathLike[str]) -> None:
    """Write a fit to a file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    write_table(path, FIT, to_dataset(fit))


def read(path: str | PathLike[str], made: type[S]) -> S:
    """Fit that `save` wrote, as an instance of the class `made`.

    Nothing in the file is executed; a damaged file is refused.

    Raises
    ------
    NotAvailable
        If the file was not written by `save`, is damaged, or cannot be read.
    """
    return from_table(ExpectedTable(path, FIT, ATTRIBUTES), made)


def from_table(table: ExpectedTable, made: type[S]) -> S:
    """Fit from an open file, or from a part of one, with the attributes `ATTRIBUTES`."""
    stored = {name: table.json(table.attributes[name], form) for name, form in _FORMS.items()}
    described, noises, loading = stored["records"], stored["noise"], stored["loading"]
    weighted, present = stored["options"].pop("weighted"), stored["options"].pop("columns")
    if not 0 < len(described) == len(noises) == len(present) == len(loading):
        raise table.fault(f"it has {len(described)} records, {len(present)} sets of columns and {len(noises)} noises")
    known = stored["options"]["initial"] == KNOWN
    stored["options"] |= {"initial": "steady"} if known else {}
    found = table.columns(_columns(present, weighted, known))
    records = tuple(
        _record(table, found, i, (source, notes, integrated), _loading_from_json(table, own))
        for i, ((source, notes, integrated), own) in enumerate(zip(described, loading, strict=True), start=1)
    )
    weights = [found[f"weight_{i}"] for i in range(1, len(records) + 1)] if weighted else None
    plan = _plan(table, records, stored["options"], weights)
    if known:
        plan = replace(plan, beginnings=tuple(_beginning(table, plan, found[f"beginning_{i + 1}"])
                                              for i in range(len(records))))  # fmt: skip
    refits = stored["refits"]
    fit = result_of(table, found, stored, partial(made, joint=refits["joint"]), plan)
    stored_results = {  # taken from the file to save their computation
        "as_measured": next(iter(refits["measured"]), None),
        "as_ramps": tuple(RampFit(*one) for one in refits["ramps"]),
        "remedies": tuple(Remedy(*one) for one in refits["remedies"]),
    }
    fit.__dict__.update(stored_results)
    return fit


def _beginning(table: ExpectedTable, plan: Plan, rows: Array) -> Beginning:
    """Beginning from the rows that `Beginning.rows` returned."""
    if rows.shape[1] != len(plan.initial_sizes):
        raise table.fault(f"a record begins with {rows.shape[1]} differences, its law has {len(plan.initial_sizes)}")
    first, *spread = rows.tolist()
    return Beginning(dict(zip(plan.initial_sizes, first, strict=True)), tuple(map(tuple, spread)))


def _columns(present: list[list[str]], weighted: bool, known: bool) -> dict[str, ColumnRule]:
    """Rules for the columns that the file of a fit must have; `present` lists the columns of each record."""
    found = result_columns([f"sample_{i}" for i in range(1, len(present) + 1)])
    for i, names in enumerate(present, start=1):
        samples = (f"sample_{i}",)
        found |= {f"{name}_{i}": ColumnRule(samples, ROLES.get(name, "")) for name in names}
        if weighted:
            found[f"weight_{i}"] = ColumnRule(samples)
        if known:
            found[f"beginning_{i}"] = ColumnRule((f"direction_{i}", f"memory_{i}"))
    return found


def _loading_to_json(loading: Loading | None) -> Any:
    """Loading as JSON data, a list for each channel; empty if it can be found again in the record's columns."""
    return (
        []
        if loading is None
        else [[] if c is None else [_course_to_json(c)] for c in (loading.load, loading.stress, loading.pore)]
    )


def _course_to_json(course: Course) -> list[Any]:
    changes = [[*astuple(change)[:-1], *chain.from_iterable(change.pieces)] for change in course.changes]
    others = [[*one] for one in course.servos] or [np.concatenate([a, *b]).tolist() for a, b in course.shapes]
    return [course.first, changes, list(course.errors), _curves_to_json(course.curve), course.strays, course.slips,
            course.glitches, course.early, course.late, others]  # fmt: skip


def _curves_to_json(curve: Any) -> list[Any]:
    if isinstance(curve, JoinedCurves):
        return [[[first, last], *own.parts()] for first, last, own in curve.spans]
    return [] if curve is None else [[[], *curve.parts()]]


def _loading_from_json(table: ExpectedTable, written: list[Any]) -> Loading | None:
    """Loading from the data that `_loading_to_json` returns; None if they are empty."""
    if len(written) != 3:
        return None
    try:
        load, stress, pore = (_course_from_json(one[0]) if one else None for one in written)
    except ValueError as error:
        raise table.fault(f"its loading {error}") from error
    return Loading(load, stress, pore)


def _course_from_json(one: list[Any]) -> Course:
    first, changes, errors, curves, *numbers, others = one
    own = [(ends, Smooth.from_parts(*parts)) for ends, *parts in curves]
    curve: Any = None
    if own:
        curve = JoinedCurves([(*ends, smooth) for ends, smooth in own]) if own[0][0] else own[0][1]
    made = tuple(map(_change_from_json, changes))
    ends = np.cumsum([len(made) + 1, *(len(change.pieces) for change in made)])
    if any(len(own) not in (2, ends[-1]) for own in others):
        raise ValueError("has servos or shapes of other changes")
    shaped = any(change.pieces for change in made)
    parts = [np.split(np.array(own), ends[:-1]) for own in others if shaped]
    counted = dict(zip(("strays", "slips", "glitches", "early", "late"), numbers, strict=True))
    return Course(
        first, made, np.array(errors), curve, **counted,
        servos=() if shaped else tuple((lag, damping) for lag, damping in others),
        shapes=tuple((levels, shares) for levels, *shares in parts),
    )  # fmt: skip


def _change_from_json(one: list[float]) -> Change:
    """Change from its numbers in a file, followed by three numbers for each of its pieces."""
    rest = one[_NUMBERS:]
    if len(one) not in (8, _NUMBERS + 3 * (len(rest) // 3)):
        raise ValueError(f"has a change of {len(one)} numbers")
    pieces = tuple(zip(rest[::3], rest[1::3], rest[2::3], strict=True))
    numbers = dict(zip((item.name for item in fields(Change)), one[:_NUMBERS], strict=False))
    return Change(**numbers, pieces=pieces)


def _record(
    table: ExpectedTable, found: dict[str, Any], i: int, about: tuple[str, list[str], bool], commanded: Loading | None
) -> Record:  # fmt: skip
    source, notes, integrated = about
    columns = {name: found.get(f"{name}_{i}") for name in _COLUMNS}
    if columns["time"] is None or columns["friction"] is None:
        raise table.fault(f"record {i} has no time or no friction")
    try:
        return whole_record(source, tuple(notes), integrated, commanded, **columns)
    except ParameterError as error:
        raise table.fault(str(error)) from error


def _plan(table: ExpectedTable, records: tuple[Record, ...], options: dict[str, Any], weights: Any) -> Plan:
    """Plan from the options in a file, which are checked like user input."""
    from steadyslip.files.specifications import protocol_from_text, slider_from_text

    text, source = table.attributes["rig"], str(table.path)
    free, rtol, drive = options.pop("free"), options.pop("rtol"), options.pop("drive")
    commanded = drive == "protocol"
    try:
        rig = slider_from_text(text, source)
        plan = make_plan(
            rig, records, free, fixed=[name for name in rig.of_kind("friction level") if name not in free],
            protocol=protocol_from_text(text, source) if commanded else None,
            drive="commanded" if commanded else drive, weights=weights, clean=False, **options,
        )  # fmt: skip
    except SteadyslipError as error:
        raise table.fault(f"its rig or options are refused: {error}") from error
    if not 0 < rtol < 1 or list(plan.free) != free:
        raise table.fault(f"rtol is {rtol!r}, free parameters are {', '.join(free):.200}")
    return replace(plan, rtol=rtol)


def _check(table: ExpectedTable, fit: Fitted) -> None:
    """Raise an error for numbers that are impossible for a fit, such as negative variances."""
    bad = {
        "coordinates": not np.all(np.isfinite(fit.coordinates)),
        "ssq": not 0 <= fit.ssq < np.inf,
        "covariance": not np.all(np.diag(fit.covariance) >= 0),
        "bound": not np.all(fit.bounds[0] <= fit.bounds[1]),
        "noise": not all(
            len(one.covariance) and one.covariance[0] >= 0 and np.all(np.isfinite(one.covariance))
            and np.all(np.isfinite(one.coefficients)) for one in fit.noise
        ),
    }  # fmt: skip
    if wrong := [name for name, is_so in bad.items() if is_so]:
        raise table.fault(f"no fit has its {wrong[0]}")
