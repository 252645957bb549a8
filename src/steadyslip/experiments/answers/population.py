"""Hierarchical (partially pooled) analysis of several experiments on one rock.

The true parameters of each experiment are taken as a sample from a population with unknown mean and covariance.
Estimates that an experiment determines poorly are shifted towards the population's mean; the shift is the larger, the
less the experiments differ.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_percent, format_quantity, format_range
from steadyslip.core.options import checked, finite, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.answers.inference import inference_data
from steadyslip.experiments.answers.members import (
    DIFFERENCE,
    Axes,
    MemberQuantity,
    conditions_of,
    labelled,
    problems_together,
    shared_names,
)
from steadyslip.experiments.fitting import store
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.settings import DRAWS, STRESS
from steadyslip.experiments.numerics.pooling import Pooled, pooled
from steadyslip.files.result_tables import ColumnRule, ExpectedTable, write_table
from steadyslip.files.sealed import FileKind

FEWEST = 3  # each parameter must be determined by this many experiments at least: two do not show a spread
ENDS = (0.025, 0.16, 0.5, 0.84, 0.975)  # probabilities of the quantiles: median, and 68 % and 95 % intervals
POPULATION = FileKind("population", 3, 2**30, "make the population of its fits again and save it anew")
_ATTRIBUTES = {"names": str, "scale": float, "chains": int, "steps": int, "time": float}
_NAMES = {"experiments": [str], "parameters": [str], "conditions": [str]}
_COLUMNS = {
    "conditions": ColumnRule(("condition", "experiment")), "mean": ColumnRule(("draw", "parameter", "slope")),
    "root": ColumnRule(("draw", "parameter", "other")), "members": ColumnRule(("draw", "experiment", "parameter")),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Population(ReadOnly):
    """Population of the parameters of several experiments, as draws from its posterior.

    Attributes
    ----------
    fits : dict of str to Fit
        Fits of the experiments, by label.
    names : tuple of str
        Names of the parameters. If a and all b are among them, methods also take ``a - b`` (a minus the sum of all b).
    conditions : dict of str to ndarray (experiments,)
        Conditions on which the means may depend, by name.
    scale : float
        Scale s₀ of the prior exp(−s²/2s₀²)/√s of a spread s. A spread is the standard deviation between experiments of
        the logarithm of a positive parameter, or of another parameter over its typical size (0.01 for b).
    draws : Pooled
        Draws from the posterior, in the coordinates of `axes`.
    where : dict of str to float
        Values, set by `at`, of the conditions to which means and new experiments refer; other conditions are at their
        mean.
    """

    fits: Mapping[str, Fit]
    names: tuple[str, ...]
    conditions: Mapping[str, Array]
    scale: float
    draws: Pooled = field(repr=False)
    where: Mapping[str, float] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Text that says to what a prediction from the population applies: another experiment."""
        return f"another experiment of a population{self._at}"

    @property
    def _at(self) -> str:
        at = " and ".join(f"{name} {_condition(name, value)}" for name, value in self.where.items())
        return f" at {at}" if at else ""

    @cached_property
    def axes(self) -> Axes:
        """Coordinates: logarithms of positive parameters, other parameters over a typical size, a − b instead of b."""
        return Axes(self.fits, self.names)

    def at(self, where: Mapping[str, float]) -> Population:
        """Population whose means, new experiments and predictions refer to given conditions.

        Parameters
        ----------
        where : mapping of str to float
            Conditions by name, such as ``{"temperature": 80}``, SI units; conditions left out are at their mean.

        Raises
        ------
        ParameterError
            If a condition is unknown or not a finite number.
        """
        allowed = ", ".join(map(repr, self.conditions)) or "none were given"
        if not isinstance(where, Mapping):
            wanted = f"numbers by the name of a condition, which are {allowed}"
            raise ParameterError([Problem("where", f"got {where!r:.80}; allowed: {wanted}")])
        problems = [
            Problem("where", f"got {name!r}; allowed: {allowed}") for name in where if name not in self.conditions
        ]
        problems += [
            Problem(f"where.{name}", f"got {value!r}; allowed: a finite number")
            for name, value in where.items()
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value)
        ]
        if problems:
            raise ParameterError(problems)
        return replace(self, where={name: float(value) for name, value in where.items()})

    @cached_property
    def _shift(self) -> Array:
        """Change (m, p) of the means' coordinates from mean conditions to the conditions `where`."""
        away = [self.where.get(name, np.mean(x)) - np.mean(x) for name, x in self.conditions.items()]
        return np.asarray(self.draws.mean[:, :, 1:] @ np.array(away).reshape(-1))

    @cached_property
    def _mean(self) -> Array:
        """Coordinates (m, p) of the means at the conditions `where`."""
        return np.asarray(self.draws.mean[:, :, 0] + self._shift)

    def mean(self, name: str) -> Estimate:
        """Mean of the population (for a positive parameter its median), at mean conditions or those of `at`."""
        one = self.axes[name]
        return self._estimate(one, one.value(self._mean))

    def experiment(self, label: str, name: str) -> Estimate:
        """Parameter of one experiment, estimated from all experiments together."""
        if label not in self.fits:
            raise ParameterError([Problem("label", f"got {label!r}; allowed: {', '.join(map(repr, self.fits))}")])
        one = self.axes[name]
        return self._estimate(one, one.value(self.draws.members[:, list(self.fits).index(label)]))

    def others(self, seed: int = 0) -> dict[str, Array]:
        """Draws (m,) of the parameters of new experiments on this rock; draw k of all parameters is experiment k."""
        found = self.draws.another(seed) + self._shift
        return {name: one.value(found) for name, one in self.axes.quantities.items()}

    def another(self, name: str, seed: int = 0) -> Estimate:
        """Parameter of a new experiment on this rock at the conditions of `mean`, with all uncertainties."""
        one = self.axes[name]
        return self._estimate(one, one.value(self.draws.another(seed) + self._shift))

    def spread(self, name: str, level: float = 0.95) -> tuple[float, float, float]:
        """Standard deviation between experiments: median and ends of its central interval of probability `level`.

        For a positive parameter, the standard deviation is that of the logarithm; for others, it is in SI units.
        """
        slopes = self.axes[name].gradient(self._mean)
        return _middle_and_ends(np.linalg.norm(slopes[:, None, :] @ self.draws.root, axis=(1, 2)), level)

    def slope(self, name: str, condition: str) -> tuple[float, float, float]:
        """Change of the mean per unit of a condition: median and 95 % interval, in the units of `spread`."""
        if condition not in self.conditions:
            allowed = ", ".join(map(repr, self.conditions)) or "none were given"
            raise ParameterError([Problem("condition", f"got {condition!r}; allowed: {allowed}")])
        return _middle_and_ends(self._slopes(self.axes[name], 1 + list(self.conditions).index(condition)))

    def correlation(self, name: str, other: str) -> tuple[float, float, float]:
        """Correlation of two parameters between experiments: median and 95 % interval."""
        first, second = ((self.axes[n].gradient(self._mean)[:, None, :] @ self.draws.root)[:, 0] for n in (name, other))
        sizes = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        return _middle_and_ends(np.clip(np.sum(first * second, axis=1) / np.maximum(sizes, 1e-300), -1, 1))

    def _slopes(self, one: MemberQuantity, k: int) -> Array:
        return np.asarray(np.sum(one.gradient(self._mean) * self.draws.mean[:, :, k], axis=1))

    def _estimate(self, one: MemberQuantity, values: Array) -> Estimate:
        """Estimate from draws `values` (m,): median, error (half of the 68 % interval) and 95 % interval."""
        low, below, middle, above, high = (float(x) for x in np.quantile(values, ENDS))
        area = next(iter(self.fits.values())).plan.rig.area
        return Estimate(one.name, middle, (above - below) / 2, one.unit, low, high, area)

    def __str__(self) -> str:
        count = len(self.names)
        lines = [f"population of {len(self.fits)} experiments, {count} parameter{'s' * (count != 1)} each"]
        wide = max(map(len, self.fits))
        for i, label in enumerate(self.fits if self.conditions else ()):
            given = ", ".join(f"{c} {_condition(c, x[i])}" for c, x in self.conditions.items())
            lines.append(f"  {label:<{wide}}  {given}")
        for name, one in self.axes.quantities.items():
            mean, other = self.mean(name), self.another(name)
            lines += ["", f"{name}: mean{self._at} {mean.shown()}, 95 %: {mean.range()}"]
            lines.append(f"  experiments differ by {_spread_words(self.spread(name), one, mean.value)}")
            lines += [
                f"  {_slope_words(self.slope(name, c), one, c, x, mean.value)}" for c, x in self.conditions.items()
            ]
            lines.append(f"  another experiment{self._at}, 95 %: {other.range()}")
            if name == DIFFERENCE:
                lines.append(f"  of further experiments{self._at} {format_percent(self.weakening)} have b > a")
            for label, alone in self.alone(name).items():
                said = "not determined alone" if alone is None else f"alone {alone.shown()}"
                lines.append(f"  {label:<{wide}}  {said}, with the others {self.experiment(label, name).shown()}")
        return "\n".join([*lines, "", *self._about()])

    def _about(self) -> list[str]:
        """Lines of text on correlations, priors, conditions, and chains that have not mixed."""
        pairs = {pair: found for pair, found in self._correlations().items() if found[1] * found[2] > 0}
        lines = [
            f"correlated      {first} and {second}, correlation {middle:.2g} ({low:.2g} to {high:.2g})"
            for (first, second), (middle, low, high) in pairs.items()
        ]
        lines.append(
            f"priors          flat for means; exp(-s²/2s0²)/√s for spreads s, s0 = {self.scale:g} e-folds or natural "
            "sizes; small correlations preferred"
        )
        if self.conditions:
            where = {name: self.where.get(name, float(np.mean(x))) for name, x in self.conditions.items()}
            lines.append(f"means           at {', '.join(f'{n} {_condition(n, x)}' for n, x in where.items())}")
            for name, x in self.conditions.items():
                if not np.min(x) <= where[name] <= np.max(x):
                    ends = " to ".join(_condition(name, float(end)) for end in (np.min(x), np.max(x)))
                    lines.append(f"! {name} {_condition(name, where[name])} is outside {ends} of the experiments: the "
                                 "straight lines through them are extrapolated")  # fmt: skip
        if not self.draws.mixed:
            lines.append(
                f"! the chains have not mixed ({self.draws.steps} steps, autocorrelation over {self.draws.time:.3g}): "
                "these numbers depend on where the chains began; take more draws, or fewer parameters"
            )
        return lines

    def _correlations(self) -> dict[tuple[str, str], tuple[float, float, float]]:
        return {(a, b): self.correlation(a, b) for i, a in enumerate(self.names) for b in self.names[i + 1 :]}

    @property
    def weakening(self) -> float:
        """Probability that a new experiment has b > a (b: sum of all b); NaN if a or a b is not among them."""
        level = self.others().get(DIFFERENCE)
        return float("nan") if level is None else float(np.mean(level < 0))

    def alone(self, name: str) -> dict[str, Estimate | None]:
        """Estimate of a parameter from each fit alone, by label; None if a fit lacks or does not determine it."""
        full = self.axes[name].name
        found = {label: next((e for e in (*one.estimates, *one.derived) if e.name == full), None)
                 for label, one in self.fits.items()}  # fmt: skip
        return {label: one if one is not None and one.determined else None for label, one in found.items()}

    def save(self, path: str | PathLike[str]) -> None:
        """Write the population, its fits and their records to a netCDF file; `load_population` reads it back.

        Conditions of `at` are not kept.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        import xarray as xr

        values = {
            "conditions": np.array(list(self.conditions.values())).reshape(len(self.conditions), len(self.fits)),
            "mean": self.draws.mean, "root": self.draws.root, "members": self.draws.members,
        }  # fmt: skip
        named = {"experiments": self.fits, "parameters": self.names, "conditions": self.conditions}
        attributes = {
            "names": json.dumps({what: list(own) for what, own in named.items()}), "scale": float(self.scale),
            "chains": self.draws.chains, "steps": self.draws.steps, "time": float(self.draws.time),
        }  # fmt: skip
        table = xr.Dataset({name: (_COLUMNS[name].dims, own) for name, own in values.items()}, attrs=attributes)
        write_table(path, POPULATION, table, [store.to_dataset(one) for one in self.fits.values()])

    def plot(self, ax: Any = None) -> Any:
        """Plot every parameter: for each experiment, from its fit alone and from all fits, and for the population.

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
            Group ``posterior``: for every parameter, such as ``friction.a``, its values in the experiments, its
            ``.mean`` and ``.spread`` (as in `spread`), and its slope with each condition: ``friction.a.temperature``.

        Raises
        ------
        NotAvailable
            If ArviZ is not installed.
        """
        found: dict[str, Array] = {}
        units: dict[str, str] = {}
        mean = self._mean
        for name, one in self.axes.quantities.items():
            unit = "1" if one.logarithmic else one.unit
            spread = np.linalg.norm(one.gradient(mean)[:, None, :] @ self.draws.root, axis=(1, 2))
            found |= {name: one.value(self.draws.members), f"{name}.mean": one.value(mean), f"{name}.spread": spread}
            units |= {name: one.unit, f"{name}.mean": one.unit, f"{name}.spread": unit}
            for k, condition in enumerate(self.conditions, start=1):
                found[f"{name}.{condition}"] = self._slopes(one, k)
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
            for name, one in self.axes.quantities.items()
        }
        conditions = {name: dict(zip(self.fits, x.tolist(), strict=True)) for name, x in self.conditions.items()}
        correlations = [
            {"names": list(pair), **dict(zip(ends, found, strict=True))} for pair, found in self._correlations().items()
        ]
        weakening = self.weakening
        return {
            "experiments": list(self.fits), "conditions": conditions, "parameters": parameters,
            "correlations": correlations, "probability_b_above_a": weakening if np.isfinite(weakening) else None,
            "mixed": self.draws.mixed,
        }  # fmt: skip


def _middle_and_ends(values: Array, level: float = 0.95) -> tuple[float, float, float]:
    """Median of draws (m,), and ends of their central interval of probability `level`."""
    low, middle, high = np.quantile(values, [0.5 - level / 2, 0.5, 0.5 + level / 2])
    return float(middle), float(low), float(high)


def _condition(name: str, value: float) -> str:
    return format_quantity(value, "Pa") if name == STRESS else f"{value:.4g}"


def _plain(one: Estimate) -> dict[str, float]:
    return {"value": one.value, "error": one.error, "low": one.low, "high": one.high}


def _spread_words(found: tuple[float, float, float], one: MemberQuantity, mean: float) -> str:
    middle, low, high = found
    if one.name == DIFFERENCE:  # the mean of a − b may be 0
        return f"{format_quantity(middle, one.unit)} ({format_range(low, high, one.unit)})"
    middle, low, high = (100 * (np.expm1(x) if one.logarithmic else x / abs(mean)) for x in found)
    return f"{middle:.2g} % ({low:.2g} to {high:.2g} %)"


def _slope_words(
    found: tuple[float, float, float], one: MemberQuantity, condition: str, values: Array, mean: float
) -> str:
    """Text on the change of the mean from the smallest to the largest value of a condition."""
    ends = (float(np.min(values)), float(np.max(values)))
    whole = " to ".join(_condition(condition, x) for x in ends)
    middle, low, high = (x * (ends[1] - ends[0]) for x in found)
    if one.name == DIFFERENCE:
        change = (
            f"{format_quantity(middle, one.unit)} ({format_quantity(low, one.unit)} to "
            f"{format_quantity(high, one.unit)})"
        )
    else:
        middle, low, high = (100 * np.expm1(x) if one.logarithmic else 100 * x / mean for x in (middle, low, high))
        change = f"{middle:+.3g} % ({low:+.3g} to {high:+.3g} %)"
    return f"from {condition} {whole} the mean changes by {change}"


@checked()
def load_population(path: str | PathLike[str]) -> Population:
    """Read a population that `Population.save` wrote.

    Nothing in the file is executed; a damaged file is refused.

    Raises
    ------
    NotAvailable
        If the file was not written by `Population.save`, is damaged, or cannot be read.

    Examples
    --------
    >>> every = ss.read_record("examples/data/made_velocity_step.csv")
    >>> columns = every.time, every.displacement, every.normal, every.friction
    >>> fits = []
    >>> for k in range(3):  # in place of three experiments
    ...     time, displacement, normal, friction = (column[k::3] for column in columns)
    ...     part = ss.record_from_arrays(time, displacement=displacement, normal=normal, friction=friction)
    ...     fits.append(ss.fit(ss.lab_rig("slip"), part, starts=4))
    >>> ss.population(fits, ["a", "b"], count=100).save("pooled.nc")
    >>> ss.experiments.load_population("pooled.nc").names
    ('friction.a', 'friction.b')
    """
    table = ExpectedTable(path, POPULATION, _ATTRIBUTES, store.ATTRIBUTES)
    named, about, found = table.json(table.attributes["names"], _NAMES), table.attributes, table.columns(_COLUMNS)
    fits = {label: store.from_table(part, Fit) for label, part in zip(named["experiments"], table.parts, strict=False)}
    conditions = dict(zip(named["conditions"], found["conditions"], strict=False))
    sizes = {"experiment": len(fits), "condition": len(conditions), "parameter": len(named["parameters"]),
             "other": len(named["parameters"]), "slope": 1 + len(conditions)}  # fmt: skip
    counted = len(fits) == len(table.parts) and all(table.sizes[name] == size for name, size in sizes.items())
    if not counted or any(len(set(own)) != len(own) for own in named.values()):
        raise table.fault(f"its sizes are {table.sizes}, of {len(table.parts)} fits")
    if unknown := [name for name in named["parameters"] if not any(name in one.names for one in fits.values())]:
        raise table.fault(f"no fit has the parameter {unknown[0]!r:.60}")
    if about["chains"] < 1 or table.sizes["draw"] % about["chains"]:
        raise table.fault(f"it has {table.sizes['draw']} draws of {about['chains']} chains")
    if not all(np.all(np.isfinite(own)) for own in found.values()):
        raise table.fault("its numbers are impossible for a population")
    return Population(
        fits, tuple(named["parameters"]), conditions, about["scale"],
        Pooled(found["mean"], found["root"], found["members"], about["time"], about["steps"], about["chains"]),
    )  # fmt: skip


@checked(scale=finite(0, 100), count=whole(*DRAWS))
def population(
    fits: Mapping[str, Fit] | Sequence[Fit], names: Sequence[str] | None = None, *,
    conditions: str | Mapping[str, Sequence[float] | Mapping[str, float]] | None = None, scale: float = 1.0,
    count: int = 4000, seed: int = 0,
) -> Population:  # fmt: skip
    """Population of the parameters of several experiments, estimated from a fit to each of them.

    The estimates of each fit and their full covariance are used as a normal likelihood of the logarithms of positive
    parameters and of the values of other parameters, with a − b in place of the first b. Differences between
    experiments may be correlated. A parameter that an experiment does not determine is estimated from the others.

    Parameters
    ----------
    fits : mapping of str to Fit, or sequence of Fit
        Fits by label; labels are the file names of the records unless given. All have the same friction law.
    names : sequence of str, optional
        Parameters; by default all of the friction law that are fitted in every experiment.
    conditions : mapping of str to sequence of float or mapping, or str, optional
        Conditions on which the means depend linearly (their logarithms, for positive parameters), one number for every
        experiment, in their order or by label, such as ``{"temperature": {"p1": 20, "p2": 100, "p3": 250}}``; or
        ``"normal stress"`` for the normal stress of the records.
    scale : float
        s₀ of the prior exp(−s²/2s₀²)/√s of a spread s of the logarithm of a parameter (or, if it may be negative, of
        the parameter over its typical size). With few experiments, the prior excludes implausibly large spreads.
    count : int
        Number of draws.
    seed : int

    Returns
    -------
    Population

    Raises
    ------
    ParameterError
        If there are too few experiments, or they do not have the parameters.
    NotAvailable
        If emcee is not installed.

    Examples
    --------
    >>> every = ss.read_record("examples/data/made_velocity_step.csv")
    >>> columns = every.time, every.displacement, every.normal, every.friction
    >>> fits = []
    >>> for k in range(3):  # in place of three experiments
    ...     time, displacement, normal, friction = (column[k::3] for column in columns)
    ...     part = ss.record_from_arrays(time, displacement=displacement, normal=normal, friction=friction)
    ...     fits.append(ss.fit(ss.lab_rig("slip"), part, starts=4))
    >>> pooled = ss.population(fits, ["a", "b"], count=100)
    >>> pooled.names
    ('friction.a', 'friction.b')
    """
    own = dict(fits) if isinstance(fits, Mapping) else labelled(fits)
    problems = [
        Problem(f"fits.{label}", f"got {one!r}; allowed: a Fit")
        for label, one in own.items()
        if not isinstance(one, Fit)
    ]
    if not own:
        problems.append(Problem("fits", f"got none; allowed: {FEWEST} or more"))
    if problems or (problems := problems_together(own)):
        raise ParameterError(problems)
    axes = Axes(own, shared_names(own, names))
    given = conditions_of(own, conditions)
    centred = np.array([x - np.mean(x) for x in given.values()]).reshape(len(given), len(own))
    estimates = [axes.estimate(one, np.append(1.0, x)) for one, x in zip(own.values(), centred.T, strict=True)]
    needed = FEWEST + len(given)
    for p, name in enumerate(axes.names):
        determined = sum(p in one.indices for one in estimates)
        if determined < needed:
            message = f"is determined by {determined} of the experiments; a mean and a spread"
            message += f" with {len(given)} conditions" if given else ""
            problems.append(Problem(name, f"{message} need {needed}"))
    if problems:
        raise ParameterError(problems)
    draws = pooled(estimates, len(axes.names), np.full(len(axes.names), scale), count, seed)
    return Population(own, axes.names, given, scale, draws)
