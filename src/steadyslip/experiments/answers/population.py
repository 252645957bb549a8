"""Hierarchical (partially pooled) analysis of several experiments on one rock.

Every experiment has parameters of its own, drawn from a population with unknown mean and spread. Parameters that an
experiment determines poorly are drawn towards the others, the more so the less the experiments differ.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity, format_range
from steadyslip.core.names import resolve
from steadyslip.core.options import checked, finite, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.answers.inference import inference_data
from steadyslip.experiments.fitting import store
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.settings import DRAWS, STRESS
from steadyslip.experiments.fitting.unknowns import Unknown
from steadyslip.experiments.numerics.pooling import ExperimentEstimate, Pooled, pooled
from steadyslip.files.sealed import FileKind
from steadyslip.files.tables import ColumnRule, ExpectedTable, write_table
from steadyslip.model.sliding import steady_state

FEWEST = 3  # experiments that determine a parameter: two cannot tell a spread from a difference
POPULATION = FileKind("population", 1, 2**30, "make the population of its fits again and save it anew")
_ATTRIBUTES = {"names": str, "scale": float, "chains": int, "time": float}
_NAMES = {"experiments": [str], "parameters": [str], "conditions": [str]}
_COLUMNS = {
    "conditions": ColumnRule(("condition", "experiment")), "mean": ColumnRule(("draw", "parameter", "slope")),
    "spread": ColumnRule(("draw", "parameter")), "members": ColumnRule(("draw", "experiment", "parameter")),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Population(ReadOnly):
    """Population that several experiments are members of, with draws from its posterior.

    Attributes
    ----------
    fits : dict of str to Fit
        Fits of the experiments, by label.
    names : tuple of str
        Names of the parameters.
    conditions : dict of str to ndarray (experiments,)
        Conditions on which the means may depend, by name.
    scale : float
        Scale of the half-normal prior of the spreads, e-folds or natural sizes.
    unknowns : tuple of Unknown
        Conversion from coordinates to values, in the order of the names.
    draws : Pooled
        Draws from the posterior, in coordinates: logarithms of positive parameters, natural sizes of others.
    """

    fits: Mapping[str, Fit]
    names: tuple[str, ...]
    conditions: Mapping[str, Array]
    scale: float
    unknowns: tuple[Unknown, ...] = field(repr=False)
    draws: Pooled = field(repr=False)

    def index(self, name: str) -> int:
        """Index of a parameter; leading parts of its name may be left out."""
        return self.names.index(resolve(name, dict.fromkeys(self.names)))

    def mean(self, name: str) -> Estimate:
        """Mean of the population (for a positive parameter its median), at mean conditions."""
        p = self.index(name)
        return self._estimate(p, self.draws.mean[:, p, 0])

    def experiment(self, label: str, name: str) -> Estimate:
        """Parameter of one experiment, estimated together with the others."""
        if label not in self.fits:
            raise ParameterError([Problem("label", f"got {label!r}; allowed: {', '.join(map(repr, self.fits))}")])
        p = self.index(name)
        return self._estimate(p, self.draws.members[:, list(self.fits).index(label), p])

    def another(self, name: str, seed: int = 0) -> Estimate:
        """Parameter predicted for a new experiment on this rock at mean conditions, with all uncertainties."""
        p = self.index(name)
        noise = np.random.default_rng(seed).standard_normal(len(self.draws.spread))
        return self._estimate(p, self.draws.mean[:, p, 0] + self.draws.spread[:, p] * noise)

    def spread(self, name: str, level: float = 0.95) -> tuple[float, float, float]:
        """Standard deviation between experiments: median and ends of its central interval of probability `level`.

        Of the logarithm of a positive parameter, else in SI units.
        """
        p = self.index(name)
        one = self.unknowns[p]
        size = 1.0 if one.logarithmic else one.size
        low, middle, high = size * np.quantile(self.draws.spread[:, p], [0.5 - level / 2, 0.5, 0.5 + level / 2])
        return float(middle), float(low), float(high)

    def slope(self, name: str, condition: str) -> tuple[float, float, float]:
        """Change of the mean per unit of a condition: median and 95 % interval, in the units of `spread`."""
        if condition not in self.conditions:
            allowed = ", ".join(map(repr, self.conditions)) or "none were given"
            raise ParameterError([Problem("condition", f"got {condition!r}; allowed: {allowed}")])
        p = self.index(name)
        one = self.unknowns[p]
        values = self.draws.mean[:, p, 1 + list(self.conditions).index(condition)]
        low, middle, high = (1.0 if one.logarithmic else one.size) * np.quantile(values, [0.025, 0.5, 0.975])
        return float(middle), float(low), float(high)

    def _estimate(self, p: int, coordinates: Array) -> Estimate:
        one = self.unknowns[p]
        low, middle, high = (float(one.value(z)) for z in np.quantile(coordinates, [0.025, 0.5, 0.975]))
        error = float(np.std(coordinates) * one.slope(np.median(coordinates)))
        return Estimate(one.name, middle, error, one.unit, low, high, next(iter(self.fits.values())).plan.rig.area)

    def __str__(self) -> str:
        lines = [f"population of {len(self.fits)} experiments, each with {len(self.names)} parameters of its own"]
        wide = max(map(len, self.fits))
        for name, one in zip(self.names, self.unknowns, strict=True):
            mean, other = self.mean(name), self.another(name)
            lines += ["", f"{name}: mean {mean.shown()}, 95 %: {mean.range()}"]
            lines.append(f"  experiments differ by {_spread_words(self.spread(name), one)}")
            lines += [f"  {_slope_words(self.slope(name, c), one, c, x)}" for c, x in self.conditions.items()]
            lines.append(f"  another experiment, 95 %: {other.range()}")
            for label, own in self.fits.items():
                alone = f"alone {own[name].shown()}" if name in own.names else "not fitted alone"
                lines.append(f"  {label:<{wide}}  {alone}, with the others {self.experiment(label, name).shown()}")
        lines += ["", f"priors          of means flat; of spreads half-normal, {self.scale:g} e-folds or natural sizes"]
        if self.conditions:
            middles = {name: float(np.mean(x)) for name, x in self.conditions.items()}
            means = ", ".join(
                f"{n} {format_quantity(x, 'Pa') if n == STRESS else f'{x:.4g}'}" for n, x in middles.items()
            )
            lines.append(f"means           at {means}")
        return "\n".join(lines)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the population, its fits and their records to a netCDF file; `load_population` reads it back.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        import xarray as xr

        values = {
            "conditions": np.array(list(self.conditions.values())).reshape(len(self.conditions), len(self.fits)),
            "mean": self.draws.mean, "spread": self.draws.spread, "members": self.draws.members,
        }  # fmt: skip
        named = {"experiments": self.fits, "parameters": self.names, "conditions": self.conditions}
        attributes = {
            "names": json.dumps({what: list(own) for what, own in named.items()}), "scale": float(self.scale),
            "chains": self.draws.chains, "time": float(self.draws.time),
        }  # fmt: skip
        table = xr.Dataset({name: (_COLUMNS[name].dims, own) for name, own in values.items()}, attrs=attributes)
        write_table(path, POPULATION, table, [store.to_dataset(one) for one in self.fits.values()])

    def plot(self, ax: Any = None) -> Any:
        """Draw every parameter of every experiment, fitted alone and pooled, and of the population.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
        """
        return draw(self, ax=ax)

    def to_arviz(self) -> Any:
        """Convert the draws, in SI units, to ArviZ.

        Returns
        -------
        arviz.InferenceData, or xarray.DataTree from version 1 of ArviZ on
            Group ``posterior``: for every parameter, as ``friction.a``, that of each experiment, its ``.mean`` and
            ``.spread`` (as `spread` counts), and its slope with every condition, as ``friction.a.temperature``.

        Raises
        ------
        NotAvailable
            If ArviZ is not installed.
        """
        found: dict[str, Array] = {}
        units: dict[str, str] = {}
        for p, (name, one) in enumerate(zip(self.names, self.unknowns, strict=True)):
            size, unit = (1.0, "1") if one.logarithmic else (one.size, one.unit)
            found |= {name: one.value(self.draws.members[:, :, p]), f"{name}.mean": one.value(self.draws.mean[:, p, 0]),
                      f"{name}.spread": size * self.draws.spread[:, p]}  # fmt: skip
            units |= {name: one.unit, f"{name}.mean": one.unit, f"{name}.spread": unit}
            for k, condition in enumerate(self.conditions, start=1):
                found[f"{name}.{condition}"] = size * self.draws.mean[:, p, k]
                units[f"{name}.{condition}"] = unit
        return inference_data(found, units, self.draws.chains, members=list(self.fits))

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data, SI units."""
        ends = ("median", "low", "high")
        parameters = {
            name: {
                "unit": one.unit,
                "mean": _plain(self.mean(name)),
                "spread": dict(zip(ends, self.spread(name), strict=True)),
                "spread_of": "logarithm" if one.logarithmic else "value",
                "another": _plain(self.another(name)),
                "slopes": {c: dict(zip(ends, self.slope(name, c), strict=True)) for c in self.conditions},
                "experiments": {label: _plain(self.experiment(label, name)) for label in self.fits},
            }
            for name, one in zip(self.names, self.unknowns, strict=True)
        }
        conditions = {name: values.tolist() for name, values in self.conditions.items()}
        return {"experiments": list(self.fits), "conditions": conditions, "parameters": parameters}


def _plain(one: Estimate) -> dict[str, float]:
    return {"value": one.value, "error": one.error, "low": one.low, "high": one.high}


def _spread_words(found: tuple[float, float, float], one: Unknown) -> str:
    middle, low, high = found
    if one.logarithmic:
        return f"{100 * middle:.2g} % ({100 * low:.2g} to {100 * high:.2g} %)"
    return f"{format_quantity(middle, one.unit)} ({format_range(low, high, one.unit)})"


def _slope_words(found: tuple[float, float, float], one: Unknown, condition: str, values: Array) -> str:
    """Text of the change of the mean from the least to the largest value of a condition."""
    ends = (float(np.min(values)), float(np.max(values)))
    whole = " to ".join(format_quantity(x, "Pa") if condition == STRESS else f"{x:.4g}" for x in ends)
    middle, low, high = (x * (ends[1] - ends[0]) for x in found)
    if one.logarithmic:  # of the mean itself, not its logarithm
        middle, low, high = (100 * np.expm1(x) for x in (middle, low, high))
        change = f"{middle:+.3g} % ({low:+.3g} to {high:+.3g} %)"
    else:
        change = (
            f"{format_quantity(middle, one.unit)} ({format_quantity(low, one.unit)} to "
            f"{format_quantity(high, one.unit)})"
        )
    return f"from {condition} {whole} the mean changes by {change}"


@checked()
def load_population(path: str | PathLike[str]) -> Population:
    """Read a population that `Population.save` wrote.

    Nothing in the file is executed; a damaged file is refused.

    Raises
    ------
    NotAvailable
        If the file is not one of ours, is damaged, or cannot be read.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> ss.population([fit, fit, fit], ["a", "b"]).save("pooled.nc")
    >>> ss.experiments.load_population("pooled.nc").names
    ('friction.a', 'friction.b')
    """
    table = ExpectedTable(path, POPULATION, _ATTRIBUTES, store.ATTRIBUTES)
    named, about, found = table.json(table.attributes["names"], _NAMES), table.attributes, table.columns(_COLUMNS)
    fits = {label: store.from_table(part, Fit) for label, part in zip(named["experiments"], table.parts, strict=False)}
    conditions = dict(zip(named["conditions"], found["conditions"], strict=False))
    sizes = {"experiment": len(fits), "condition": len(conditions), "parameter": len(named["parameters"]),
             "slope": 1 + len(conditions)}  # fmt: skip
    counted = len(fits) == len(table.parts) and all(table.sizes[name] == size for name, size in sizes.items())
    if not counted or any(len(set(own)) != len(own) for own in named.values()):
        raise table.fault(f"its sizes are {table.sizes}, of {len(table.parts)} fits")
    if unknown := [name for name in named["parameters"] if not any(name in one.names for one in fits.values())]:
        raise table.fault(f"no fit has the parameter {unknown[0]!r:.60}")
    if about["chains"] < 1 or table.sizes["draw"] % about["chains"]:
        raise table.fault(f"it has {table.sizes['draw']} draws of {about['chains']} chains")
    if not all(np.all(np.isfinite(own)) for own in found.values()) or np.any(found["spread"] < 0):
        raise table.fault("no population has its numbers")
    return Population(
        fits, tuple(named["parameters"]), conditions, about["scale"],
        tuple(_unknown(fits, name) for name in named["parameters"]),
        Pooled(found["mean"], found["spread"], found["members"], about["time"], about["chains"]),
    )  # fmt: skip


@checked(scale=finite(0, 100), count=whole(*DRAWS))
def population(
    fits: Mapping[str, Fit] | Sequence[Fit], names: Sequence[str] | None = None, *,
    conditions: str | Mapping[str, Sequence[float]] | None = None, scale: float = 1.0, count: int = 4000, seed: int = 0,
) -> Population:  # fmt: skip
    """Estimate the population of several experiments, each fitted on its own.

    Every experiment enters with its estimates and their full covariance: a normal likelihood in the coordinates of the
    fit, logarithms of positive parameters. A parameter that an experiment does not determine follows from the others.

    Parameters
    ----------
    fits : mapping of str to Fit, or sequence of Fit
        By label; the file of the record unless labelled. All of one friction law.
    names : sequence of str, optional
        Parameters; all of the friction law that are fitted in every experiment unless given.
    conditions : mapping of str to sequence of float, or str, optional
        What the means may depend on, one number for every experiment, such as ``{"temperature": [20, 100, 250]}``:
        straight lines, of the logarithm where a parameter must be positive. ``"normal stress"``: that of the records.
    scale : float
        Of the half-normal prior of the spreads, in e-folds (or natural sizes): with few experiments it keeps out
        spreads that nobody would believe.
    count : int
        Draws.
    seed : int

    Returns
    -------
    Population

    Raises
    ------
    ParameterError
        If there are too few experiments for this, or they do not have the parameters.
    NotAvailable
        If emcee is not installed.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> pooled = ss.population([fit, fit, fit], ["a", "b"])
    >>> pooled.names
    ('friction.a', 'friction.b')
    """
    labelled = dict(fits) if isinstance(fits, Mapping) else _labelled(fits)
    problems = [
        Problem(f"fits.{label}", f"got {one!r}; allowed: a Fit")
        for label, one in labelled.items()
        if not isinstance(one, Fit)
    ]
    if not labelled:
        problems.append(Problem("fits", f"got none; allowed: {FEWEST} or more"))
    if not problems and len({type(one.plan.rig.friction) for one in labelled.values()}) > 1:
        problems.append(Problem("fits", "are of several friction laws; allowed: one"))
    problems += [] if problems else _references(labelled)
    if problems:
        raise ParameterError(problems)
    own_names = _names(labelled, names)
    given = _conditions(labelled, conditions)
    centred = np.array([x - np.mean(x) for x in given.values()]).reshape(len(given), len(labelled))
    unknowns = tuple(_unknown(labelled, name) for name in own_names)
    estimates = [
        _estimate_of(one, own_names, unknowns, np.append(1.0, x))
        for one, x in zip(labelled.values(), centred.T, strict=True)
    ]
    needed = FEWEST + len(given)
    for p, name in enumerate(own_names):
        determined = sum(p in one.indices for one in estimates)
        if determined < needed:
            message = f"is determined by {determined} of the experiments; a mean and a spread"
            message += f" with {len(given)} conditions" if given else ""
            problems.append(Problem(name, f"{message} need {needed}"))
    if problems:
        raise ParameterError(problems)
    draws = pooled(estimates, len(own_names), np.full(len(own_names), scale), count, seed)
    return Population(labelled, own_names, given, scale, unknowns, draws)


def _references(fits: Mapping[str, Fit]) -> list[Problem]:
    """Problems with reference velocities, which must be equal in all fits: levels of friction refer to them."""
    found = []
    rigs = {label: one.plan.rig for label, one in fits.items()}
    for name in next(iter(rigs.values())).of_kind("reference rate"):
        rates = {label: rig.value(name) for label, rig in rigs.items() if name.startswith("friction.")}
        if len(set(rates.values())) > 1:
            each = ", ".join(f"{label} {format_quantity(rate or 0.0, 'm/s')}" for label, rate in rates.items())
            found.append(Problem(name, f"differs between the fits ({each}); give all rigs the same"))
    return found


def _labelled(fits: Sequence[Fit]) -> dict[str, Fit]:
    found: dict[str, Fit] = {}
    for i, one in enumerate(fits, start=1):
        label = one.plan.records[0].source.replace("\\", "/").rpartition("/")[2] if isinstance(one, Fit) else str(i)
        found[f"{label} ({i})" if label in found else label] = one
    return found


def _names(fits: Mapping[str, Fit], names: Sequence[str] | None) -> tuple[str, ...]:
    every = dict.fromkeys(name for one in fits.values() for name in one.names if "@" not in name)
    if names is None:
        found = [n for n in every if n.startswith("friction.") and all(n in one.names for one in fits.values())]
    else:
        found = [resolve(name, every) for name in ([names] if isinstance(names, str) else names)]
    if not found:
        raise ParameterError([Problem("names", "no parameter is fitted in every experiment")])
    return tuple(dict.fromkeys(found))


def _conditions(fits: Mapping[str, Fit], conditions: Any) -> dict[str, Array]:
    if conditions is None:
        return {}
    if conditions == STRESS:
        return {STRESS: np.array([steady_state(one.rig(0)).normal_stress for one in fits.values()])}
    allowed = f"{STRESS!r}, or a mapping of names to {len(fits)} finite numbers that are not all the same"
    problems, found = [], {}
    for name, values in conditions.items() if isinstance(conditions, Mapping) else [("", None)]:
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


def _estimate_of(one: Fit, names: tuple[str, ...], unknowns: tuple[Unknown, ...], design: Array) -> ExperimentEstimate:
    """Estimates of the parameters that a fit determines, with their covariance."""
    places = {p: one.names.index(name) for p, name in enumerate(names) if name in one.names}
    seen = [p for p, k in places.items() if np.isfinite(one.covariance[k, k])]
    own = [places[p] for p in seen]
    mine, theirs = [unknowns[p] for p in seen], [one.space.unknowns[k] for k in own]
    units = np.array([1.0 if a.logarithmic else b.size / a.size for a, b in zip(mine, theirs, strict=True)])
    covariance = one.covariance[np.ix_(own, own)] * np.outer(units, units)
    return ExperimentEstimate(np.array(seen, dtype=int), one.coordinates[own] * units, covariance, design)


def _unknown(fits: Mapping[str, Fit], name: str) -> Unknown:
    return next(one.space.unknowns[one.names.index(name)] for one in fits.values() if name in one.names)
