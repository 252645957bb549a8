"""Text and plain data of fits to tables of speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.dimensions import unit
from steadyslip.core.format import display_units, format_quantity, format_with_error
from steadyslip.core.records import parameters
from steadyslip.core.version import stamped
from steadyslip.experiments.fitting.speed_fit import DirectionFit, SpeedEstimate, SpeedFindings
from steadyslip.experiments.fitting.speed_rig import BRISTLES, untold

CLOSE = 0.95  # correlation from which two parameters are told to stand for each other


def words(found: SpeedFindings) -> str:
    """Whole text of a fit, about 100 columns wide."""
    table = found.table
    lines = [f"Friction of {table.source} as the law {found.law}"]
    lines += [f"  {note}" for note in table.notes]
    for one in (found.forward, found.backward):
        lines += ["", *_direction(found, one)] if one is not None else []
    lines.append("")
    if found.bristles is not None:
        at = "" if table.load is None else f" at {format_quantity(found.main.load, 'N')}"
        size = "N m/rad" if table.turns else "N/m"
        low, high = (format_quantity(end, size) for end in (found.bristles.low, found.bristles.high))
        value = format_quantity(found.bristles.value, size)
        lines.append(f"bristle stiffness {value}{at}, from the loop (95 %: {low} to {high})")
    known = parameters(found.main.law)
    names = [name for name in untold(found) if found.bristles is None or known[name].role.kind != BRISTLES]
    if names:
        told = f"The table does not tell {' and '.join(names)}"
        lines.append(f"{told}: the rig file carries intervals, which analyze answers for.")
    return "\n".join(lines)


def _direction(found: SpeedFindings, one: DirectionFit) -> list[str]:
    table = found.table
    size = unit(table.speed_unit)[0]
    speeds = f"{one.speed.min() / size:.4g} to {one.speed.max() / size:.4g} {table.speed_unit}"
    if found.relative:
        scatter = f"{100 * one.scatter:.2g} %"
    else:
        scatter = format_quantity(one.scatter, "1" if table.is_coefficient else "N m" if table.turns else "N", 2)
    way = "forward" if one.forward else "backward"
    lines = [f"{way}: {len(one.speed)} rows, {speeds}; scatter {scatter}, from {_count(one.freedom, 'row')} to spare"]
    wide = max(len(estimate.name) for estimate in one.estimates)
    with display_units([table.speed_unit]):
        for estimate in one.estimates:
            text = f"  {estimate.name:<{wide}}  {_shown(estimate)}"
            lines.append(text + (f" ({estimate.remark})" if estimate.remark else ""))
    if (derived := _difference(one)) is not None:
        lines.append(derived)
    lines += [f"  {note}" for note in one.notes]
    lines += _together(one)
    return lines


def _difference(one: DirectionFit) -> str | None:
    """Line on the change of friction with ln v, where the law's direct effect is held."""
    kinds = {address.role.kind: (name, address.value) for name, address in parameters(one.law).items()}
    (a, direct), (b, _) = kinds.get("direct effect", ("", None)), kinds.get("evolution effect", ("", None))
    found = [estimate for estimate in one.estimates if estimate.name == b]
    if direct is None or not found:
        return None
    text = format_with_error(direct - found[0].value, found[0].error, found[0].unit)
    return f"  {a} - {b} = {text}: the table tells the difference alone; {a} is held at {direct:g}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _shown(one: SpeedEstimate) -> str:
    low, high = (_end(end, one.unit) for end in (one.low, one.high))
    return f"{one.shown()}, 95 %: {low} to {high}"


def _end(value: float, si_unit: str) -> str:
    return "any" if not np.isfinite(value) else format_quantity(value, si_unit)


def _together(one: DirectionFit) -> list[str]:
    """Lines on pairs of parameters whose errors go together."""
    names = [estimate.name for estimate in one.estimates]
    pairs = [
        f"{names[i]} and {names[j]} ({one.correlation[i, j]:+.3f})"
        for i in range(len(names))
        for j in range(i)
        if abs(one.correlation[i, j]) >= CLOSE
    ]
    return [f"  errors go together: {', '.join(pairs)}"] if pairs else []


def as_dict(found: SpeedFindings) -> dict[str, Any]:
    """Plain data of a fit for JSON, SI units; ends that do not exist are None."""
    data: dict[str, Any] = {"source": found.table.source, "law": found.law, "notes": list(found.table.notes)}
    for name, one in (("forward", found.forward), ("backward", found.backward)):
        if one is None:
            continue
        data[name] = {
            "load": one.load, "scatter": one.scatter, "degrees_of_freedom": one.freedom, "notes": list(one.notes),
            "parameters": {e.name: {"value": e.value, "error": _plain(e.error), "unit": e.unit,
                                    "interval_68": [_plain(end) for end in e.likely],
                                    "interval_95": [_plain(e.low), _plain(e.high)], "remark": e.remark}
                           for e in one.estimates},
            "correlation": [[_plain(value) for value in row] for row in one.correlation],
        }  # fmt: skip
    if found.bristles is not None:
        loop = found.bristles
        data["bristles"] = {"stiffness": loop.value, "error": loop.error, "interval_95": [loop.low, loop.high]}
    return dict(stamped(data))


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
