"""Why points of a map have no number, in words: asked of the rigs at some of them."""

from __future__ import annotations

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE, WORDS, status, without_edge
from steadyslip.machine.machine import Machine
from steadyslip.maps.view.cut import View
from steadyslip.maps.view.result import MapResult
from steadyslip.model.point import operating_point

ASKED = 12
_ABOUT_EDGES = ("critical_stiffness", "safety_factor", "margin", "edge")
_SAYS = {
    ABSENT: WORDS[ABSENT],
    UNKNOWN: WORDS[UNKNOWN],
    STABLE: "stable at every value",
    UNSTABLE: "stable at no value",
}
_INFINITE = {"growth_rate": "ill-posed", "threshold": "no kick in the range fails"}


def without_number(found: MapResult, view: View, name: str, hatched: bool = False) -> str:
    """What it means that points of a picture have no number of a result; empty where all have one.

    `hatched`: the picture tells already where there is no steady sliding, or numbers are out of range.
    """
    values = np.asarray(view.values[name], dtype=float)
    if hatched:
        values = np.where(np.isin(view.values["status"], (ABSENT, UNKNOWN)), 0.0, values)
    if np.isfinite(values).all():
        return ""
    reasons = [_INFINITE.get(name, "without limit")] if np.isinf(values).any() else []
    missing = np.argwhere(np.isnan(values))
    if len(missing):
        reasons += sorted(set(_reasons(found, view, missing)) - {""}) if name in _ABOUT_EDGES else []
    if len(missing) and not found.complete:
        reasons.append("not computed yet")
    words = name.replace("_", " ")
    return f"no {words}" + (f" ({', '.join(reasons)})" if reasons else "")


def points_at(view: View, rows: np.ndarray) -> list[dict[str, float]]:
    """Parameters of the rig at some of a picture's places, by their indices (n, dimensions)."""
    points = []
    for row in rows[np.unique(np.linspace(0, len(rows) - 1, ASKED).astype(int))]:
        place = {n: float(p[i]) for n, p, i in zip(view.names, view.places, row[::-1], strict=True)}
        points.append({n: v for n, v in (view.held | place).items() if not n.startswith("protocol.")})
    return points


def _reasons(found: MapResult, view: View, rows: np.ndarray) -> list[str]:
    """Of single rigs; none are told of samples, of which a picture shows medians."""
    try:
        rig = found.rig
        points = points_at(view, rows) if not view.bands else []
        asked = [operating_point(rig, one) for one in points]
        if isinstance(rig, Machine):
            return [_SAYS[int(status(one))] for one in asked]
        return [str(without_edge(one)) for one in asked]
    except (NotAvailable, ParameterError):
        return []
