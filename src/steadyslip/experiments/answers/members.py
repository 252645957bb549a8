"""Estimates and covariances of fits in the coordinates of a population: logarithms of parameters, and a − b.

Rocks with very different a and b may have nearly the same a − b, which decides their stability. Therefore a − b takes
the place of b as a coordinate: the small spread of a − b would be lost in the large spreads of a and b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.names import resolve
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.settings import STRESS
from steadyslip.experiments.fitting.unknowns import Unknown
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.measured.same import is_same_measurement
from steadyslip.experiments.numerics.pooling import ExperimentEstimate
from steadyslip.model.sliding import steady_state

DIFFERENCE = "a - b"  # name of a minus the sum of all b, as in fits


@dataclass(frozen=True)
class MemberQuantity:
    """Parameter of a population, or a − b, as a function of the coordinates of an experiment.

    Attributes
    ----------
    name, unit : str
    logarithmic : bool
        True if spreads and slopes are those of the logarithm of the value.
    parts : tuple of (Unknown, int, float)
        For each term of the sum that is the value: unknown, index of its coordinate, and sign.
    """

    name: str
    unit: str
    logarithmic: bool
    parts: tuple[tuple[Unknown, int, float], ...] = field(repr=False)

    def value(self, coordinates: Array) -> Array:
        """Values (...) in SI units at coordinates (..., p)."""
        return np.asarray(sum(sign * one.value(coordinates[..., k]) for one, k, sign in self.parts))

    def gradient(self, coordinates: Array) -> Array:
        """Derivatives (..., p) of the value or, if `logarithmic`, of its logarithm, by the coordinates."""
        found = np.zeros_like(coordinates)
        for one, k, sign in self.parts:
            found[..., k] = 1.0 if self.logarithmic else sign * one.slope(coordinates[..., k])
        return found


class Axes:
    """Coordinates of the experiments of a population: the coordinates of fits, but with a − b in place of the first b.

    Parameters
    ----------
    fits : mapping of str to Fit
    names : sequence of str
        Parameters of the population.

    Attributes
    ----------
    quantities : dict of str to MemberQuantity
        Parameters by name, in the order of `names`, then ``a - b`` if a and all b are parameters.
    """

    def __init__(self, fits: Mapping[str, Fit], names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.unknowns = tuple(
            next(one.space.unknowns[one.names.index(name)] for one in fits.values() if name in one.names)
            for name in names
        )
        rig = next(iter(fits.values())).plan.rig
        own = {name: k for k, name in enumerate(names)}
        effects = [*rig.of_kind("direct effect"), *rig.of_kind("evolution effect")]
        self.effects = [own[name] for name in effects] if effects and set(effects) <= set(own) else []
        if len(rig.of_kind("direct effect")) != 1 or any(self.unknowns[k].logarithmic for k in self.effects[1:]):
            self.effects = []
        signs = [1.0, *[-1.0] * (len(self.effects) - 1)]
        self.quantities = {
            name: MemberQuantity(name, one.unit, one.logarithmic, ((one, k, 1.0),))
            for k, (name, one) in enumerate(zip(names, self.unknowns, strict=True))
        }
        if len(self.effects) > 1:
            replaced = self.effects[1]
            parts = tuple(zip((self.unknowns[k] for k in self.effects), self.effects, signs, strict=True))
            name, level = names[replaced], self.unknowns[replaced]
            self.quantities[name] = MemberQuantity(
                name, level.unit, False, (parts[0], (level, replaced, -1.0), *parts[2:])
            )
            self.quantities[DIFFERENCE] = MemberQuantity(DIFFERENCE, level.unit, False, ((level, replaced, 1.0),))
        else:
            self.effects = []

    def __getitem__(self, name: str) -> MemberQuantity:
        """Quantity with a name, whose leading parts may be left out; ``b - a`` is the negative of ``a - b``."""
        plain = name.replace(" ", "").replace("−", "-")
        if plain not in ("a-b", "b-a") or DIFFERENCE not in self.quantities:
            return self.quantities[resolve(name, self.quantities)]
        one = self.quantities[DIFFERENCE]
        if plain == "a-b":
            return one
        return MemberQuantity("b - a", one.unit, False, tuple((level, k, -sign) for level, k, sign in one.parts))

    def estimate(self, one: Fit, design: Array) -> ExperimentEstimate:
        """Estimate of the coordinates that a fit determines, with their covariance.

        Parameters
        ----------
        one : Fit
        design : ndarray (q,)
            Row of the regression matrix: 1 and the conditions of the experiment.
        """
        places = {p: one.names.index(name) for p, name in enumerate(self.names) if name in one.names}
        known = {p: k for p, k in places.items() if np.isfinite(one.covariance[k, k])}
        mine, theirs = [self.unknowns[p] for p in known], [one.space.unknowns[k] for k in known.values()]
        units = np.array([1.0 if a.logarithmic else b.size / a.size for a, b in zip(mine, theirs, strict=True)])
        own = list(known.values())
        values, covariance = one.coordinates[own] * units, one.covariance[np.ix_(own, own)] * np.outer(units, units)
        seen = list(known)
        if self.effects:
            replaced = self.effects[1]
            if set(self.effects) <= set(seen):
                inner = [seen.index(k) for k in self.effects]
                size = self.unknowns[replaced].size
                levels = [self.unknowns[k].value(values[i]) for k, i in zip(self.effects, inner, strict=True)]
                slopes = [self.unknowns[k].slope(values[i]) for k, i in zip(self.effects, inner, strict=True)]
                change = np.eye(len(seen))
                change[inner[1], inner] = np.array([slopes[0], *(-x for x in slopes[1:])]) / size
                covariance = change @ covariance @ change.T
                values[inner[1]] = (levels[0] - sum(levels[1:])) / size
            elif replaced in seen:  # this fit determines b but not a: other experiments give a − b
                kept = [i for i, p in enumerate(seen) if p != replaced]
                seen, values = [seen[i] for i in kept], values[kept]
                covariance = covariance[np.ix_(kept, kept)]
        return ExperimentEstimate(np.array(seen, dtype=int), values, covariance, design)


def shared_names(fits: Mapping[str, Fit], names: Sequence[str] | None) -> tuple[str, ...]:
    """Full names of a population's parameters; by default the friction parameters that are fitted in every fit."""
    every = dict.fromkeys(name for one in fits.values() for name in one.names if "@" not in name)
    if names is None:
        found = [n for n in every if n.startswith("friction.") and all(n in one.names for one in fits.values())]
    else:
        found = [resolve(name, every) for name in ([names] if isinstance(names, str) else names)]
    if not found:
        raise ParameterError([Problem("names", "no parameter is fitted in every experiment")])
    return tuple(dict.fromkeys(found))


def problems_together(fits: Mapping[str, Fit]) -> list[Problem]:
    """Problems of fits that cannot form a population: other laws or reference velocities, or the same record twice."""
    rigs = {label: one.plan.rig for label, one in fits.items()}
    if len({type(rig.friction) for rig in rigs.values()}) > 1:
        return [Problem("fits", "are of several friction laws; allowed: one")]
    found = []
    for name in next(iter(rigs.values())).of_kind("reference rate"):
        rates = {label: rig.value(name) for label, rig in rigs.items() if name.startswith("friction.")}
        if len(set(rates.values())) > 1:
            each = ", ".join(f"{label} {format_quantity(rate or 0.0, 'm/s')}" for label, rate in rates.items())
            found.append(Problem(name, f"differs between the fits ({each}); give all rigs the same"))
    known: list[tuple[str, Record]] = []
    for label, one in fits.items():
        for record in one.plan.records:
            first = next(
                (owner for owner, other in known if owner != label and is_same_measurement(record, other)), None
            )
            known.append((label, record))
            if first is not None:
                message = f"has the record of {first} again ({record.source}), whole, cut or averaged; use it once only"
                found.append(Problem(f"fits.{label}", message))
    return found


def labelled(fits: Sequence[Fit]) -> dict[str, Fit]:
    """Fits by the file name of their first record; a number is added to names that occur twice."""
    found: dict[str, Fit] = {}
    for i, one in enumerate(fits, start=1):
        label = one.plan.records[0].source.replace("\\", "/").rpartition("/")[2] if isinstance(one, Fit) else str(i)
        found[f"{label} ({i})" if label in found else label] = one
    return found


def conditions_of(fits: Mapping[str, Fit], given: Any) -> dict[str, Array]:
    """Values (experiments,) of each condition, from the user's lists of numbers or mappings of labels to numbers."""
    if given is None:
        return {}
    if given == STRESS:
        return {STRESS: np.array([steady_state(one.rig(0)).normal_stress for one in fits.values()])}
    allowed = f"{STRESS!r}, or a mapping of names to {len(fits)} finite numbers that are not all the same"
    problems, found = [], {}
    for name, values in given.items() if isinstance(given, Mapping) else [("", None)]:
        if isinstance(values, Mapping):
            if set(values) != set(fits):
                message = f"got values for {', '.join(map(str, values))}; allowed: one for each of {', '.join(fits)}"
                problems.append(Problem(f"conditions.{name}", message))
                continue
            values = [values[label] for label in fits]
        try:
            column = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            column = np.empty(0)
        if column.shape != (len(fits),) or not np.all(np.isfinite(column)) or not np.ptp(column) > 0:
            problems.append(Problem(f"conditions.{name}".rstrip("."), f"got {values!r}; allowed: {allowed}"))
        found[str(name)] = column
    if problems:
        raise ParameterError(problems)
    return found
