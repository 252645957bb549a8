"""Explanations of missing values in a map, found by analysing the rigs at some of the points."""

from __future__ import annotations

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.linear.status import ABSENT, STABLE, UNDAMPED, UNKNOWN, UNSTABLE, WORDS, status, without_edge
from steadyslip.machine.machine import Machine
from steadyslip.maps.plan.measures import NO_EDGE, NOT_SLIDING
from steadyslip.maps.view.cut import View
from steadyslip.maps.view.map_result import MapResult
from steadyslip.model.point import operating_point

ASKED = 12  # largest number of points that are analysed to explain missing values; chosen by trial
_REASONS = {
    ABSENT: WORDS[ABSENT],
    UNKNOWN: WORDS[UNKNOWN],
    STABLE: "stable at every value",
    UNSTABLE: "stable at no value",
    UNDAMPED: "nothing damps it",
}


def without_number(found: MapResult, view: View, name: str, hatched: bool = False) -> str:
    """Text that explains why points of a figure have no value of a result; empty if all have one.

    With `hatched`, the figure already marks points without steady sliding or out of range.
    """
    values = np.asarray(view.values[name], dtype=float)
    if hatched:
        values = np.where(np.isin(view.values["status"], (ABSENT, UNKNOWN)), 0.0, values)
    if np.isfinite(values).all():
        return ""
    reasons = [found.what_infinite(name)] if np.isinf(values).any() else []
    missing, why = np.argwhere(np.isnan(values)), found.why_missing(name)
    if len(missing) and why == NO_EDGE:
        reasons += sorted(set(_reasons(found, view, missing)) - {""})
    if len(missing) and not found.complete:
        reasons.append("not computed yet")
    if len(missing) and why not in ("", NO_EDGE, NOT_SLIDING):
        reasons.append(why)
    words = name.replace("_", " ")
    return f"no {words}" + (f" ({', '.join(reasons)})" if reasons else "")


def points_at(view: View, rows: np.ndarray) -> list[dict[str, float]]:
    """Parameters of the rig, by name, at up to `ASKED` of a figure's points with indices `rows` (n, dimensions)."""
    points = []
    for row in rows[np.unique(np.linspace(0, len(rows) - 1, ASKED).astype(int))]:
        place = {n: float(p[i]) for n, p, i in zip(view.names, view.places, row[::-1], strict=True)}
        points.append({n: v for n, v in (view.held | place).items() if not n.startswith("protocol.")})
    return points


def _reasons(found: MapResult, view: View, rows: np.ndarray) -> list[str]:
    """Reason for each point that is analysed; empty for samples, of which the figure shows medians."""
    try:
        rig = found.rig
        points = points_at(view, rows) if not view.bands else []
        asked = [operating_point(rig, one) for one in points]
        if isinstance(rig, Machine):
            return [_REASONS[int(status(one))] for one in asked]
        return [str(without_edge(one)) for one in asked]
    except (NotAvailable, ParameterError):
        return []
