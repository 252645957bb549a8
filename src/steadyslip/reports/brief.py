"""HTML of any result, rig or model, as notebooks display it.

An attribute name has one meaning in all results, so the unit follows from the name: `UNITS` has SI units by name;
attributes in `RESULT_UNIT` have the unit of the result (``result.unit``); those in `DIMENSIONLESS` have none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from steadyslip.core.areas import stress_name
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity, format_range
from steadyslip.core.pictures import draw
from steadyslip.core.records import FrozenRecord, parameters
from steadyslip.core.written import displayed_as, si_units
from steadyslip.explorer.sketch import sketch
from steadyslip.figures.inline import figure_html
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.reports.elements import (
    STYLE,
    Markup,
    equation as equation_html,
    figure,
    heading,
    html_text,
    inline_math,
    paragraph,
    table,
)

_BY_UNIT = {
    "s": "time begin end duration recurrence peak_time period time_to_halve time_to_double times periods t departure "
    "settled_at",
    "m/s": "velocity v speed peak_velocity lowest_velocity velocities slip_rate",
    "m": "slip x displacement",
    "Pa": "normal_stress shear_stress spring_stress stress_drop lowest_normal_stress highest_normal_stress normal "
    "shear stress_ratio pore_pressure",
    "Pa/m": "critical_stiffness stable_stiffness critical_axial_stiffness k B1",
    "Pa s/m": "f S",
    "kg/m^2": "m",
    "rad/s": "angular_frequency critical_angular_frequency omega",
    "1/s": "eigenvalue eigenvalues growth_rate growth coefficient coefficient_error r feeds",
    "Hz": "ring_frequency frequency frequency_error",
    "m^2": "area",
    "N": "load force normal_force friction_force force_drop pull",
    "kg": "mass",
    "N s/m": "damping gyroscopic",
    "N/m": "stiffness",
    "m/N": "receptance deviation",
}
_RATES = frozenset(f"{_BY_UNIT['rad/s']} {_BY_UNIT['1/s']}".split())
UNITS = {name: unit for unit, names in _BY_UNIT.items() for name in names.split()}
RESULT_UNIT = frozenset("value error low high amount absolute values lowest highest scatter".split())  # noqa: SIM905 -- a list of words
DIMENSIONLESS = frozenset(
    """relative size bracket searched damping_ratio amplitude trivial multipliers ratio share ssq rtol steps rejected
    routh characteristic_polynomial characteristic_terms growth_slope f1 mu B0 B2 B3 friction precision rise scale noise
    safety level points outcome fold status_code kind stable exists survived is_edge doubt details criteria predicted
    residuals contact closing returned late_error
    seen worth errors first second first_interval total_interval total missing spacing edge correlation
    log_probability covariance coordinates bounds shares thresholds final samples data events ranges states start
    sides conditions amplitudes speeds links steady characteristic_terms gain gains phase phases shift
    mean_friction steady_friction distortion status linear_to lost_at crossings e_folds unstable_roots
    correlations cost otherwise sure chance chances windows limits beyond pair pair_cost fails
    part parts kinetic elastic slope damping_ratio_error shape shape_error inside misfit unknown""".split()  # noqa: SIM905 -- a list of words
)
_BY_TYPE = {"Margin": {"searched"}, "Boundary": {"bracket"}, "Profile": set(), "Threshold": {"amount"}}
_HIDDEN = frozenset(
    """rig version plan data protocol area unit units html start fit fits draws search noise plot map resonances told
    where columns windows fails unlisted joint""".split()  # noqa: SIM905
)
_SKETCH_CAPTION = (
    "Motion is to the right. Thick bars and the rounded frame: the drive; dashed line: what it measures; arrows with a "
    "force: constant forces."
)
_MAX_ROWS = 12  # largest number of rows of a table of results, so that a notebook cell stays short (by trial)
_MAX_VALUES = 4  # an array with more numbers is printed as shape and range (by trial)


def brief(result: Any) -> str:
    """HTML of a result: its kind, numbers with units, and its figure if it has one.

    Parameters
    ----------
    result : object
        Any public result, a rig, a law, a protocol or a Model.

    Returns
    -------
    str
        A ``div`` element with its own style, without links to other files.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.reports.brief(rig)[:4]
    '<div'
    """
    return f'<div class="steadyslip-told"><style>{STYLE}</style>{result_html(result)}</div>'


def result_html(result: Any) -> str:
    """HTML of a result without the style sheet, for use inside a document that has it."""
    if isinstance(result, Model):
        return "".join(_model_html(result))
    return "".join(_record_html(result) if isinstance(result, FrozenRecord) else _result_html(result))


def sketch_of(record: Any) -> str:
    """HTML figure of a rig as a sketch; empty for other records."""
    if isinstance(record, Slider):
        return figure(sketch(record), "The rig.")
    if isinstance(record, Machine):
        return figure(figure_html(lambda: draw(record), "sketch of the machine"), _SKETCH_CAPTION)
    return ""


def text_html(text: str, caption: str = "") -> str:
    """HTML of printed text: lines with two or more columns (two spaces apart) become tables, others paragraphs.

    Every table gets the caption, so that documents number it.
    """
    parts: list[str] = []
    words: list[str] = []
    rows: list[list[str]] = []
    indent = 0
    for line in text.splitlines():
        found = re.match(r"(\S(?:.*?\S)?) {2,}(\S.*)$", line.strip())
        if rows and re.match(r" {8,}\S", line):
            rows[-1][-1] += f" {line.strip()}"
        elif found:
            rows.append([found[1], *re.split(r" {2,}", found[2])])
        elif line.strip() and words and _is_wrapped(words[-1], line, indent) and not rows:
            words[-1] += f" {line.strip()}"
            parts[-1] = paragraph(words[-1])
        elif line.strip():
            parts += [_padded_table(rows, caption), paragraph(line.strip())]
            words.append(line.strip())
            rows = []
        indent = len(line) - len(line.lstrip())
    return "".join([*parts, _padded_table(rows, caption)])


def _is_wrapped(line: str, after: str, indent: int) -> bool:
    """True if the line `after` seems to continue the sentence of `line`, which looks wrapped at a terminal's width.

    A line that is indented less than `indent`, or begins with a few words and a colon, does not continue a sentence.
    """
    cut = len(line) > 60 and line[-1] not in ".:;)"
    return cut and len(after) - len(after.lstrip()) >= indent and not re.match(r" *[A-Za-z][\w ]{0,20}: ", after)


def _padded_table(rows: list[list[str]], caption: str) -> str:
    widest = max(map(len, rows), default=0)
    return table([[*row, *[""] * (widest - len(row))] for row in rows], caption=caption)


# -- one function for each kind


def _model_html(model: Model) -> Iterator[str]:
    kind = "with inertia" if model.inertial else "quasistatic"
    yield heading(f"Model, {kind}", 3)
    for equation in model.equations():
        yield equation_html(equation)
    yield table(
        [(inline_math(model.written(one.symbol)), one.unit, one.doc) for one in model.variables],
        ("variable", "unit", "meaning"),
    )
    rows = [
        (name, inline_math(model.written(symbol)), model.roles[name].unit, model.roles[name].doc)
        for name, symbol in model.parameters.items()
    ]
    yield table(rows, ("parameter", "letter", "unit", "meaning"))


def _record_html(record: FrozenRecord) -> Iterator[str]:
    name = getattr(record, "name", "")
    yield heading(f"{type(record).__name__}{f' ({name})' if isinstance(name, str) and name else ''}", 3)
    yield sketch_of(record)
    rows = []
    for path, one in (record.parameters() if isinstance(record, Rig) else parameters(record)).items():
        if one.value is not None:
            values = np.asarray(one.value)
            area = record.printed_area(path) if isinstance(record, Rig) else None
            if values.ndim:
                words = _format_array(values, one.role.unit, area)
            elif isinstance(record, Rig):
                with displayed_as(record.written_as(path)):
                    words = format_quantity(*record.display_value(path, float(values)), 6, area)
            else:
                words = format_quantity(float(values), one.role.unit, 6)
            rows.append((path, words, stress_name(one.role.doc, area)))
    yield table(rows, ("parameter", "value", "meaning"))


def _result_html(result: Any) -> Iterator[str]:
    words = str(result)
    has_text = not words.startswith((f"{type(result).__name__}(", "<"))
    yield heading(kind_of(result), 3)
    if has_text:
        yield text_html(words)
    else:
        yield table(_attribute_rows(result))
    for name, many in _inner_tables(result):
        yield heading(name.replace("_", " ").capitalize(), 3) + many
    yield figure(_plot(result))


def kind_of(result: Any) -> str:
    """Kind of a result as text from its class name, such as "Rig comparison"."""
    return " ".join(re.findall("[A-Z]+[a-z]*", type(result).__name__)).capitalize()


def _plot(result: Any) -> str:
    if not hasattr(result, "plot"):
        return ""
    try:
        return figure_html(lambda: draw(result), type(result).__name__, 5.5)
    except NotAvailable:
        return ""


def _shown_attributes(result: Any) -> Iterator[tuple[str, Any]]:
    """Names and values of the displayed attributes of a result, in order of declaration."""
    names = [one.name for one in fields(result)] if is_dataclass(result) else getattr(result, "_fields", vars(result))
    for name in names:
        if not name.startswith("_") and name not in _HIDDEN:
            yield name, getattr(result, name)


def _attribute_rows(result: Any) -> Iterator[tuple[str, Any]]:
    area = getattr(result, "area", None) or getattr(getattr(result, "rig", None), "area", None)
    for name, value in _shown_attributes(result):
        cell = _named_cell(result, name, value, area)
        if cell:
            yield name.replace("_", " "), cell


def unit_of(result: Any, name: str) -> str:
    """SI unit of an attribute of a result, found by the name of the attribute."""
    own = getattr(result, "unit", None)
    if name == "force" and hasattr(result, "force_unit"):
        return str(result.force_unit)
    if own == "rad" and UNITS.get(name) == "m/s":
        return "rad/s"
    if isinstance(own, str) and name in RESULT_UNIT | _BY_TYPE.get(type(result).__name__, set()):
        return own
    return UNITS.get(name, "1")


def _named_cell(result: Any, name: str, value: Any, area: float | None) -> Any:
    """Table cell of an attribute of a result; rates are in SI units, not in the units of the rig file."""
    unit = unit_of(result, name)
    if name in _RATES:
        with si_units():
            return _cell(value, unit, area)
    return _cell(value, unit, area)


def _cell(value: Any, unit: str, area: float | None) -> Any:
    """Table cell of a value with its unit, as text or HTML; empty for None, NaN and sequences of results."""
    if value is None or isinstance(value, bool | np.bool_ | str):
        return "" if value is None else str(value) if isinstance(value, str) else "yes" if value else "no"
    if isinstance(value, int | np.integer) and unit == "1":
        return str(value)
    if isinstance(value, int | float | np.integer | np.floating):
        return "" if math.isnan(value) else format_quantity(float(value), unit, area=area)
    if isinstance(value, complex):
        sign = "+" if value.imag >= 0 else "-"
        return f"{value.real:.4g} {sign} {abs(value.imag):.4g} i {'' if unit == '1' else unit}"
    if isinstance(value, np.ndarray):
        return _format_array(value, unit, area)
    if isinstance(value, Mapping):
        plain = {k: v for k, v in value.items() if isinstance(v, int | float)}
        return Markup(
            "<br>".join(f"{html_text(k)}: {html_text(format_quantity(float(v), '1'))}" for k, v in plain.items())
        )
    if isinstance(value, tuple | list) and value and not is_dataclass(value[0]):
        cells = [str(_cell(one, unit, area)) for one in value[:_MAX_ROWS]]
        return Markup("<br>".join(one if isinstance(one, Markup) else html_text(one) for one in cells))
    return ""


def _format_array(values: np.ndarray, unit: str, area: float | None) -> str:
    """Text of an array: its values if there are at most `_MAX_VALUES`, else shape and range.

    For an array of words, the number of times that each occurs.
    """
    if values.size == 0:
        return "none"
    if values.dtype.kind not in "fiu":
        names, counts = np.unique(values.astype(str), return_counts=True)
        return ", ".join(f"{n} {name}" for name, n in zip(names[:_MAX_ROWS], counts, strict=False))
    finite = values[np.isfinite(values)]
    if not finite.size:
        return f"{values.size} values, none a number"
    if values.size <= _MAX_VALUES:
        return ", ".join(format_quantity(float(one), unit, area=area) for one in values.ravel())
    shape = " × ".join(map(str, values.shape))
    return f"{shape} values, {format_range(float(finite.min()), float(finite.max()), unit, area)}"


def _inner_tables(result: Any) -> Iterator[tuple[str, str]]:
    """Names and HTML tables of the results and time series that a result contains."""
    area = getattr(getattr(result, "rig", None), "area", None)
    for name, value in _shown_attributes(result):
        if isinstance(value, tuple) and value and is_dataclass(value[0]) and hasattr(type(value[0]), "_repr_html_"):
            yield name, _results_table(value, area)
    units = getattr(result, "units", None)
    for name in ("data", "final"):
        series = getattr(result, name, None)
        if isinstance(series, Mapping) and isinstance(units, Mapping):
            rows = [
                (key.replace("_", " "), _format_array(np.asarray(values), units.get(key, "1"), area))
                for key, values in series.items()
            ]
            yield name, table(rows)


def _results_table(results: Iterable[Any], area: float | None) -> str:
    many = list(results)
    every = dict.fromkeys(name for one in many for name, _ in _shown_attributes(one))
    names = [name for name in every if any(_short_cell(one, name, area) for one in many)]
    rows = [[_short_cell(one, name, area) for name in names] for one in many[:_MAX_ROWS]]
    if not names or len({type(one) for one in many}) > 1:  # results of different kinds, or without anything to show
        names = ["kind", *names]
        rows = [[getattr(one, "name", type(one).__name__), *row] for one, row in zip(many, rows, strict=False)]
    more = paragraph(f"and {len(many) - _MAX_ROWS} more", "small") if len(many) > _MAX_ROWS else ""
    return table(rows, [name.replace("_", " ") for name in names], left=False) + more


def _short_cell(result: Any, name: str, area: float | None) -> Any:
    """Cell of a table of results for a number, text or bool; empty for other values."""
    value = getattr(result, name, None)
    own = getattr(result, "area", None) or area
    return _named_cell(result, name, value, own) if isinstance(value, bool | int | float | str) else ""
