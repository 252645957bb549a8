"""Simpler models inside a richer one: a fit of the richer must not end above what they reach.

A parameter whose record says at which value it does nothing (`Parameter.idle`) makes the model without it part of the
model with it. Such models are fitted too, in the same coordinates with the idle ones held, and where each ends the
richer one starts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from steadyslip.core.records import Address
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.condensed import Condensed
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.experiments.numerics.least_squares import Minima, minimise

Array = np.ndarray
Told = Callable[[Minima], None]
SPREAD = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # multiples of its other scales from which a member that was idle starts
FEW = 8  # starts of a simpler model
ROUGH, FINE = 40, 300  # iterations on few samples and on all


@dataclass(frozen=True)
class Idle:
    """A simpler model: the coordinates that it holds, and at which of them the held part would begin to act.

    Attributes
    ----------
    held : ndarray of bool (p,)
    at : ndarray (p,)
        Where they are held, elsewhere zero.
    scales : tuple of int
        Logarithmic coordinates among them, which say nothing while the part is idle.
    """

    held: Array
    at: Array
    scales: tuple[int, ...]


def simpler(space: Space, addresses: Mapping[str, Address]) -> tuple[Idle, ...]:
    """The models that lack one part of a law, one order of a trend, or the offset."""
    together: dict[str, list[int]] = {}
    orders = [int(u.parameter.rpartition(".")[2]) for u in space.unknowns if u.parameter.startswith("trend.")]
    for i, one in enumerate(space.unknowns):
        name = one.parameter
        owner, _, _ = name.rpartition(".")
        role = addresses[name].role if name in addresses else None
        member = owner.rpartition(".")[2]
        if name in (f"trend.{max(orders, default=0)}", "offset"):
            together.setdefault(name, []).append(i)
        elif role is not None and member.isdigit() and int(member) > 1:
            together.setdefault(owner, []).append(i)
        elif role is not None and role.idle is not None and not member.isdigit():
            together.setdefault(name, []).append(i)
    found = []
    for places in together.values():
        held, at = np.zeros(len(space), dtype=bool), np.zeros(len(space))
        idle = 0
        for i in places:
            one = space.unknowns[i]
            role = addresses[one.parameter].role if one.parameter in addresses else None
            value = 0.0 if role is None else role.idle
            if value is not None:
                at[i] = float(one.coordinate(value))
                idle += 1
            held[i] = True
        if idle:
            found.append(Idle(held, at, tuple(i for i in places if space.unknowns[i].logarithmic)))
    return tuple(found)


def from_simpler(
    models: tuple[Idle, ...], quick: Comparison, whole: Comparison | Condensed, starts: Array, low: Array, high: Array,
    known: float, told: Told,
) -> Array:  # fmt: skip
    """Where the simpler models end, as starts of the richer one, (m, p).

    Parameters
    ----------
    models : tuple of Idle
    quick, whole : Comparison
        With few samples, and with all (or what stands for all).
    starts : ndarray (n, p)
        Of the richer model, the most promising first.
    low, high : ndarray (p,)
    known : float
        Sum of squares that the richer model is known to reach on what stands for all samples.
    told : callable
    """
    found = [np.empty((0, len(low)))]
    for model in models:
        begin = np.where(model.held & ~_within(model.scales, len(low)), model.at, starts[:FEW])
        held = np.tile(model.held, (len(begin), 1))
        rough = minimise(
            lambda z, _: quick.residuals(z), begin, low, high, most=ROUGH, held=held, tolerance=1e-4, race=3, told=told
        )
        if not np.any(np.isfinite(rough.ssq)):
            continue
        best, _ = rough.distinct(2)
        held = np.tile(model.held, (len(best), 1))
        ends = minimise(
            lambda z, _: whole.residuals(z), best, low, high, most=FINE, held=held, race=1, known=known, told=told
        )
        ended = ends.sorted().coordinates[0]
        spread = np.tile(ended, (len(SPREAD) if model.scales else 1, 1))
        for i in model.scales:
            spread[:, i] = np.clip(_usual(whole.space, i, ended) + np.log(SPREAD), low[i], high[i])
        found.append(spread)
    return np.concatenate(found)


def _within(places: tuple[int, ...], size: int) -> Array:
    inside = np.zeros(size, dtype=bool)
    inside[list(places)] = True
    return inside


def _usual(space: Space, place: int, coordinates: Array) -> float:
    """The scale of the same kind in the part before: of the first state for that of the second."""
    kind = space.unknowns[place].kind
    alike = [i for i, u in enumerate(space.unknowns) if u.kind == kind and i != place]
    return float(coordinates[alike[0] if alike else place])
