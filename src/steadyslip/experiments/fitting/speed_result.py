"""Result of a fit to a table of speeds, with its text, data and rig file."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from steadyslip.core.dimensions import unit
from steadyslip.core.format import format_count, format_quantity, format_with_error
from steadyslip.core.quantities import PER_LOAD
from steadyslip.core.records import FrozenRecord, parameters
from steadyslip.core.version import stamped
from steadyslip.core.written import display_units
from steadyslip.experiments.fitting.load_dependence import (
    dependence,
    internal_preload,
    load_comments,
    load_free_drag,
    summary,
)
from steadyslip.experiments.fitting.speed_fit import DirectionFit, SpeedEstimate, SpeedFindings
from steadyslip.experiments.fitting.steady_curve import ONLY_COMBINED
from steadyslip.files.specifications.layout import UNKNOWN

BRISTLES, BRISTLE_DAMPING, SLIP = "bristle stiffness", "bristle damping", "slip distance"
DEFLECTION = (1e-6, 1e-5, 1e-4)
"""Smallest, usual and largest deflection of bristles before they slip, or slip distance, m: guides and seals deflect by
1 to 50 um before sliding (Armstrong-Helouvry 1991)."""
RAD_A_METRE = 10.0  # rad per m of deflection in joints, whose contact is some 10 cm from the axis
STIFFNESS, MASS, SHAFT, INERTIA = (
    "20 N/um",
    100.0,
    "1e4 N m/rad",
    0.1,
)  # of a common axis, of a common joint; kg, kg m^2
COEFFICIENT_LOAD = 1000.0  # load (N) of the rig for a table of coefficients that has no load
SHARES = ("exponent", "stress share", "immediate share")
"""Kinds of parameters without a unit that are no ratio of a force to the load."""
CHANGE = "CHANGE: a table of speeds does not determine it"


def undetermined(found: SpeedFindings) -> dict[str, tuple[float, float, float]]:
    """Smallest, usual and largest value, in units of the law, of parameters not determined by a table of speeds."""
    one, turns = found.main, found.table.turns
    load = rig_load(found)
    level = float(one.fitted.max()) / (1.0 if found.table.is_coefficient else one.load + internal_preload(one))
    turned = 1 / found.table.radius if found.table.radius else RAD_A_METRE
    short, usual, long = (length * (turned if turns else 1.0) for length in DEFLECTION)
    ranges: dict[str, tuple[float, float, float]] = {}
    known = parameters(one.law)
    for name, address in known.items():
        if address.role.kind == SLIP and address.value is not None:
            ranges[name] = (short, usual, long)
    of_kind = {address.role.kind: name for name, address in known.items()}
    if BRISTLES in of_kind:
        own = (level / long, level / usual, level / short)
        if found.bristles is not None:
            own = (found.bristles.low / load, found.bristles.value / load, found.bristles.high / load)
        ranges[of_kind[BRISTLES]] = own
        if BRISTLE_DAMPING in of_kind:
            critical = 2 * math.sqrt(own[1] * (INERTIA if turns else MASS) / load)
            ranges[of_kind[BRISTLE_DAMPING]] = (0.0, 0.0, critical)
    return ranges


def rig_load(found: SpeedFindings) -> float:
    """Load (N) of the rig: median of the table; without a load, `COEFFICIENT_LOAD` for coefficients or 1 for forces."""
    if found.table.load is None and found.table.is_coefficient:
        return COEFFICIENT_LOAD
    return found.main.load


def rig_text(found: SpeedFindings) -> str:
    """Text of a complete rig file: a slider, or a machine of one rotating body for a table of torques."""
    with display_units([found.table.speed_unit]):
        return _text(found, undetermined(found))


def _text(found: SpeedFindings, ranges: dict[str, tuple[float, float, float]]) -> str:
    lines = [f"# Friction of {found.table.source}: steadyslip fit --law {found.law}."]
    lines += ["# Lines with CHANGE do not follow from a table of speeds: write the values of your machine."]
    if found.table.load is None and not found.table.is_coefficient:
        turned = found.table.turns and found.table.radius is None
        what = "torques in N m" if turned else "forces in N"
        lines += [f"# The table has no load: it is 1 N here, and coefficients are {what}."]
    lines += [f"# To check: {text}" for text in (*found.table.questions, *_scattered(found))]
    lines += ["", *(_joint if found.table.turns else _axis)(found, ranges)]
    where = "contacts.bearing.friction" if found.table.turns else "friction"
    if ranges:
        lines += ["", f"[{UNKNOWN}]  # analyze says which of these values are stable; delete a line once it is known"]
        lines += [
            f"{where}.{name} = [{_written(found, name, low)}, {_written(found, name, high)}]"
            for name, (low, _, high) in ranges.items()
        ]
    return "\n".join(lines) + "\n"


def _axis(found: SpeedFindings, ranges: dict[str, tuple[float, float, float]]) -> list[str]:
    one = found.main
    offset, damping = internal_preload(one), load_free_drag(one)
    slowest = one.speed.min() / unit(found.table.speed_unit)[0]
    drag = [f'radiation_damping = "{damping:.6g} N s/m"  # viscous drag that does not follow the load']
    return [
        *_friction(found, ranges, "friction"), "", "[contact]", 'law = "constant"',
        _preload(found) + (f", plus an internal preload of {format_quantity(offset, 'N')}" if offset else ""),
        *load_comments(found, 1.0), "",
        "[slider]", 'area = "1 m^2"  # so that forces and stresses have the same numbers',
        f'stiffness = "{STIFFNESS}"  # {CHANGE}', f'mass = "{MASS:g} kg"  # {CHANGE}',
        *(drag if damping else []), "", "[drive]",
        f'velocity = "{slowest:.6g} {found.table.speed_unit}"  # CHANGE: the slowest speed of the table',
    ]  # fmt: skip


_RADIUS = {
    False: "so that m/s are rad/s, and N are N m: the table's torques, whatever the real radius",
    True: "CHANGE: at a radius of 0.1 m a tenth of v_stribeck and ten times viscous and bristles belong to it",
}
"""Comments on a radius that was not given: for a table of torques (False), or of coefficients (True)."""
AT_ONE_METRE = (
    "The rig file has the friction at a radius of 1 m, where m/s are rad/s and N are N m; for that of your contact "
    'give radius, --set radius="40 mm".'
)


def _lever(found: SpeedFindings) -> float:
    """Load (N) of the rig over the load of the table, which may be a torque."""
    return 1 / (found.table.radius or 1.0) if found.table.load_turns else 1.0


def _at_radius(found: SpeedFindings, si_unit: str, kind: str) -> float:
    """Factor that converts a parameter of the law from a radius of 1 m (rad/s are m/s) to the radius of the contact."""
    table = found.table
    if not table.turns or table.radius is None:
        return 1.0
    per_load = si_unit in PER_LOAD and kind not in SHARES and not table.is_coefficient and not table.load_turns
    return float(table.radius ** (unit(si_unit)[1].length - per_load))


def _joint(found: SpeedFindings, ranges: dict[str, tuple[float, float, float]]) -> list[str]:
    one, where = found.main, "contacts.bearing"
    slowest = one.speed.min() / unit(found.table.speed_unit)[0]
    damping = load_free_drag(one)
    drag = [
        "[links.drag]",
        'kind = "shaft"',
        'between = ["joint", "ground"]',
        f'damping = "{damping:.6g} N m s/rad"',
        "",
    ]
    return [
        "[bodies.joint]", 'motion = "rotation"', f'inertia = "{INERTIA:g} kg m^2"  # {CHANGE}', "",
        "[links.shaft]", 'kind = "shaft"', 'between = ["drive", "joint"]', f'stiffness = "{SHAFT}"  # {CHANGE}', "",
        *(drag if damping else []), f"[{where}]", 'body = "joint"',
        _radius(found), "",
        *_friction(found, ranges, f"{where}.friction"), "",
        f"[{where}.contact]", 'law = "constant"', _preload(found), *load_comments(found, _lever(found)), "", "[drive]",
        'control = "rotary-steady"',
        f'velocity = "{slowest:.6g} {found.table.speed_unit}"  # CHANGE: the slowest speed of the table',
    ]  # fmt: skip


def _radius(found: SpeedFindings) -> str:
    radius = found.table.radius
    return f'radius = "{radius:.6g} m"' if radius else f'radius = "1 m"  # {_RADIUS[found.table.is_coefficient]}'


def _preload(found: SpeedFindings) -> str:
    told = (
        "the table's"
        if found.table.load is not None
        else CHANGE
        if found.table.is_coefficient
        else "the table has none"
    )
    load = _lever(found) * (rig_load(found) + internal_preload(found.main))
    return f'preload = "{load:.6g} N"  # {told}'


def _friction(found: SpeedFindings, ranges: dict[str, tuple[float, float, float]], where: str) -> list[str]:
    lines = [f"[{where}]", f'law = "{found.law}"']
    told = {estimate.name: estimate for estimate in found.main.estimates}
    for name, address in parameters(found.main.law).items():
        if name in told:
            lines.append(f"{name} = {_written(found, name, told[name].value)}  # {_interval(found.main, name)}")
        elif name in ranges:
            source = (
                "from the loop"
                if address.role.kind == BRISTLES and found.bristles is not None
                else f"{CHANGE}, see [{UNKNOWN}]"
            )
            lines.append(f"{name} = {_written(found, name, ranges[name][1])}  # {source}")
        elif address.value is not None and address.value != _default(found.main.law, name):
            said = "held, not fitted" if address.role.kind not in ONLY_COMBINED else "determined only with others"
            lines.append(f"{name} = {_written(found, name, address.value)}  # {said}")
    if found.forward is not None and found.backward is not None:
        lines.append("# backward:")
        lines += [
            f"# {one.name} = {_written(found, one.name, one.value)}  # {_interval(found.backward, one.name)}"
            for one in found.backward.estimates
        ]
    return lines


def _default(law: FrozenRecord, name: str) -> object:
    return next(item.default for item in fields(law) if item.name == name)  # type: ignore[arg-type]


def _interval(one: DirectionFit, name: str) -> str:
    estimate = one[name]
    ends = [
        "any" if not math.isfinite(end) else format_quantity(end, estimate.unit)
        for end in (estimate.low, estimate.high)
    ]
    return f"95 %: {ends[0]} to {ends[1]}" + (f"; {estimate.remark}" if estimate.remark else "")


def _written(found: SpeedFindings, name: str, value: float) -> str:
    """TOML value of a parameter, in the units of the table; bristle stiffness and damping hold at the rig's load."""
    known = parameters(found.main.law)
    own, kind = (known[name].role.unit, known[name].role.kind) if name in known else ("1", "")
    load, value = rig_load(found), value * _at_radius(found, own, kind)
    if own == "1":
        return f"{value:.8g}"
    if kind in (BRISTLES, BRISTLE_DAMPING) and not found.table.turns:
        scale, size = (1e-6, "N/um") if kind == BRISTLES else (1e-3, "N s/mm")
        return f'"{value * load * scale:.6g} {size} at {load:.6g} N"'
    if own == "m/s" and not found.table.turns:
        return f'"{value / unit(found.table.speed_unit)[0]:.8g} {found.table.speed_unit}"'
    return f'"{value:.8g} {own}"'


MOST_SCATTER = 1.0  # if the scatter is a larger share of friction, the law does not describe the table


def _scattered(found: SpeedFindings) -> list[str]:
    """Questions to the user about directions in which the scatter exceeds the friction."""
    sides = [one for one in (found.forward, found.backward) if one is not None]
    shares = [one.scatter / (1.0 if found.relative else float(np.median(one.friction))) for one in sides]
    return [
        f"{'forward' if one.forward else 'backward'}: scatter {100 * share:.2g} %, more than the friction itself: the "
        f"law {found.law} does not follow these rows; are their signs, loads and units right?"
        for one, share in zip(sides, shares, strict=True)
        if share > MOST_SCATTER
    ]


CLOSE = 0.95  # pairs of parameters are listed if the correlation of their errors is larger


def words(found: SpeedFindings) -> str:
    """Text of a fit to a table of speeds, about 100 columns wide."""
    table = found.table
    lines = [f"Friction of {table.source} as the law {found.law}"]
    lines += [f"  to check: {note}" if note in table.questions else f"  {note}" for note in table.notes]
    lines += [f"  to check: {note}" for note in _scattered(found)]
    for one in (found.forward, found.backward):
        lines += ["", *_direction(found, one)] if one is not None else []
    lines.append("")
    if table.turns and table.radius is None:
        lines += textwrap.wrap(AT_ONE_METRE, 100)
    if (loads := summary(found, rig_load(found))) is not None:
        lines += textwrap.wrap(loads, 100)
    if found.bristles is not None:
        at = "" if table.load is None else f" at {format_quantity(found.main.load, 'N m' if table.load_turns else 'N')}"
        size = "N m/rad" if table.turns else "N/m"
        with display_units([] if table.turns else ["N/um"]):
            value, low, high = (
                format_quantity(end, size) for end in (found.bristles.value, found.bristles.low, found.bristles.high)
            )
        lines.append(f"bristle stiffness {value}{at}, from the loop (95 %: {low} to {high})")
    known = parameters(found.main.law)
    names = [name for name in undetermined(found) if found.bristles is None or known[name].role.kind != BRISTLES]
    if names:
        unknown = f"The table does not determine {' and '.join(names)}"
        lines.append(f"{unknown}: the rig file has intervals for them, which analyze examines.")
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
    lines = [
        f"{way}: {format_count(len(one.speed), 'row')}, {speeds}; scatter {scatter}, "
        f"from {format_count(one.freedom, 'row')} to spare"
    ]
    wide = max(len(estimate.name) for estimate in one.estimates)
    with display_units([table.speed_unit]):
        for estimate in one.estimates:
            text = f"  {estimate.name:<{wide}}  {_shown(estimate)}"
            lines.append(text + (f" ({estimate.remark})" if estimate.remark else ""))
    if (derived := _difference(one)) is not None:
        lines.append(derived)
    lines += [f"  {note}" for note in one.notes]
    lines += filter(None, [dependence(found, one)])
    lines += _together(one)
    return lines


def _difference(one: DirectionFit) -> str | None:
    """Line on the change of friction with ln v, if the direct effect of the law is fixed; else None."""
    kinds = {address.role.kind: (name, address.value) for name, address in parameters(one.law).items()}
    (a, direct), (b, _) = kinds.get("direct effect", ("", None)), kinds.get("evolution effect", ("", None))
    found = [estimate for estimate in one.estimates if estimate.name == b]
    if direct is None or not found:
        return None
    text = format_with_error(direct - found[0].value, found[0].error, found[0].unit)
    return f"  {a} - {b} = {text}: the table determines only the difference; {a} is held at {direct:g}"


def _shown(one: SpeedEstimate) -> str:
    low, high = (_end(end, one.unit) for end in (one.low, one.high))
    return f"{one.shown()}, 95 %: {low} to {high}"


def _end(value: float, si_unit: str) -> str:
    return "any" if not np.isfinite(value) else format_quantity(value, si_unit)


def _together(one: DirectionFit) -> list[str]:
    """Line on pairs of parameters with highly correlated errors; no line if there is no such pair."""
    names = [estimate.name for estimate in one.estimates]
    pairs = [
        f"{names[i]} and {names[j]} ({one.correlation[i, j]:+.3f})"
        for i in range(len(names))
        for j in range(i)
        if abs(one.correlation[i, j]) >= CLOSE
    ]
    return [f"  correlated errors: {', '.join(pairs)}"] if pairs else []


def as_dict(found: SpeedFindings) -> dict[str, Any]:
    """Data of a fit for JSON in SI units; None for ends of intervals that do not exist."""
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


@dataclass(frozen=True, eq=False, repr=False)
class SpeedFit(SpeedFindings):  # noqa: D101 -- its base has it
    __doc__ = SpeedFindings.__doc__

    def __str__(self) -> str:
        return words(self)

    def rig_text(self) -> str:
        """Text of a complete rig file with this friction; values that the table does not determine are marked."""
        return rig_text(self)

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data in SI units."""
        return as_dict(self)
