"""Ends of a search that grows with the record: its beginning is fitted first, then more of it, change by change.

One change of the rate tells a, b, d_c and the stiffness nearly apart from the memory of normal stress, and over a
short time the model is far less nonlinear: wrong minima, in which one of several changes is followed and the others are
not, are no minima of the beginning alone.
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

KEPT = 4  # different ends of one stage from which the next begins: the eight lanes take two sizes of a memory of each
SHARES = (0.05, 0.75)  # range of a memory of normal stress that is tried: what laboratories find and half more


def grown(
    plan: Plan, begin: Array, low: Array, high: Array, effort: Effort, options: Mapping[str, Any]
) -> Minima:  # fmt: skip
    """Ends, on all samples of a plan, of starts (m, p) that follow the first change of its records, then more of them.

    Parameters
    ----------
    plan : Plan
        With few samples.
    begin : ndarray (m, p)
    low, high : ndarray (p,)
    effort : Effort
    options : mapping of str to object
        Of `minimise`.
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
    """True if a record has a change of normal stress that acts, and other changes besides."""
    return plan.follows and plan.pressed and any(
        record.stress_changes and len(loading.changes) > 1
        for record, loading in zip(plan.records, plan.loading, strict=True)
    )  # fmt: skip


def stress_alone(plan: Plan) -> bool:
    """True if the normal stress changes in a record and drives the contact, and the rate of no record changes."""
    steady = all(channel != "load" for loading in plan.loading for channel, *_ in loading.changes)
    return steady and plan.pressed and any(record.stress_changes for record in plan.records)


def _beginnings(plan: Plan) -> Iterator[Plan]:
    """Plans of the records up to their second change, their third and so on."""
    often = max(len(loading.changes) for loading in plan.loading)
    for count in range(1, often):
        parts = zip(plan.records, plan.loading, strict=True)
        records = tuple(_until(record, [c.earliest for *_, c in loading.changes], count) for record, loading in parts)
        yield replace(plan, records=records)


def _until(record: Record, changes: list[float], count: int) -> Record:
    """A record up to where the change after so many may begin."""
    later = sorted(changes)[count:]
    rows = np.flatnonzero(record.time <= later[0]) if later else np.arange(len(record))
    return record.taken(rows, "its beginning") if len(rows) < len(record) else record


def _spread(space: Space, ends: Minima, count: int) -> Array:
    """Starting points (count, p) from the best ends, each with several sizes of a memory of normal stress."""
    kept, _ = ends.distinct(KEPT)
    if not len(kept):
        return kept
    found = np.resize(kept, (count, len(space)))  # repeats them in turn
    sizes = np.linspace(*SHARES, count - len(kept))
    for i, one in enumerate(space.unknowns):
        if one.kind in ("stress share", "immediate share"):
            values = sizes if one.kind == "stress share" else 1 - sizes
            found[len(kept) :, i] = one.coordinate(values)
    return found
