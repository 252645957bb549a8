"""Search with a growing part of the record: its beginning is fitted first, then longer parts, change by change.

One change of the rate determines a, b, d_c and the stiffness nearly independently of the memory of normal stress, and
over a short time the model is far less nonlinear. A wrong minimum of the whole record, in which the model follows only
one of several changes, is not a minimum for the beginning alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.least_squares import Minima, minimise

KEPT = 4  # number of end points that start the next stage, each with two sizes of the memory: fills eight SIMD lanes
SHARES = (0.05, 0.75)  # range of a memory's share α that is tried: the range found in laboratories and half more


def grown(
    plan: Plan, begin: Array, low: Array, high: Array, effort: Effort, options: Mapping[str, Any]
) -> Minima:  # fmt: skip
    """Minima for the whole records of a plan, from searches that begin at `begin` (m, p) and fit more and more changes.

    Parameters
    ----------
    plan : Plan
        With few samples.
    begin : ndarray (m, p)
    low, high : ndarray (p,)
    effort : Effort
    options : mapping of str to object
        Further arguments of `minimise`.
    """
    space, count, ends = plan.space(), len(begin), Minima.none(len(low))
    for own in (*_beginnings(plan), plan):
        model = own.comparison(effort)
        ends = minimise(lambda z, _, model=model: model.residuals(z), begin, low, high, **options)  # type: ignore[misc]
        begin = _spread(space, ends, count)
        if not len(begin):
            break
    return ends


def several_changes(plan: Plan) -> bool:
    """True if the normal stress drives the contact and, with other changes of the loading, changes in a record."""
    return plan.follows and plan.pressed and any(
        record.stress_changes and len(loading.changes) > 1
        for record, loading in zip(plan.records, plan.loading, strict=True)
    )  # fmt: skip


def stress_alone(plan: Plan) -> bool:
    """True if the normal stress changes in a record and drives the contact, while the rate changes in no record."""
    steady = all(channel != "load" for loading in plan.loading for channel, *_ in loading.changes)
    return steady and plan.pressed and any(record.stress_changes for record in plan.records)


def _beginnings(plan: Plan) -> Iterator[Plan]:
    """Plans with the records up to their second change, then up to their third change, and so on."""
    often = max(len(loading.changes) for loading in plan.loading)
    for count in range(1, often):
        parts = zip(plan.records, plan.loading, strict=True)
        records = tuple(_until(record, [c.earliest for *_, c in loading.changes], count) for record, loading in parts)
        yield replace(plan, records=records)


def _until(record: Record, changes: list[float], count: int) -> Record:
    """Record up to the earliest time of the change that follows the first `count` changes."""
    later = sorted(changes)[count:]
    rows = np.flatnonzero(record.time <= later[0]) if later else np.arange(len(record))
    return record.taken(rows, "its beginning") if len(rows) < len(record) else record


def _spread(space: Space, ends: Minima, count: int) -> Array:
    """Starting points (count, p) from the best end points, with several sizes of a memory of normal stress."""
    kept, _ = ends.distinct(KEPT)
    if not len(kept):
        return kept
    found = np.resize(kept, (count, len(space)))  # repeats the kept points in turn
    sizes = np.linspace(*SHARES, count - len(kept))
    for i, one in enumerate(space.unknowns):
        if one.kind in ("stress share", "immediate share"):
            values = sizes if one.kind == "stress share" else 1 - sizes
            found[len(kept) :, i] = one.coordinate(values)
    return found
