"""Fits a rig to records: nobody has to guess, and what the records cannot tell is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.errors import NotAvailable, ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.lab.comparison import Comparison
from steadyslip.lab.identify import Combination, combinations, prior_information
from steadyslip.lab.least_squares import Minima, minimise
from steadyslip.lab.noise import Noise, describe, white
from steadyslip.lab.plan import Plan, check_width, make_plan
from steadyslip.lab.record import Record, transient_rows
from steadyslip.lab.starts import STARTS, search_bounds, starting_points
from steadyslip.lab.unknowns import Space
from steadyslip.quantities import shown
from steadyslip.records import resolve
from steadyslip.slider import Slider

Array = np.ndarray
THIN = 400  # samples on which many starts are tried
FINALISTS = 8  # of them that go on with all samples: one vector of lanes
SAME = 1e-3  # distance of coordinates, in standard deviations of them, between equal minima
ERRORS = ("auto", "correlated", "independent")


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    Attributes
    ----------
    name : str
        Dotted name; ``@2`` behind it where it belongs to the second record alone.
    value, error : float
        SI units; the error is one standard deviation, inf where the records do not determine the parameter.
    unit : str
    low, high : float
        Ends of the 95 % interval.
    """

    name: str
    value: float
    error: float
    unit: str
    low: float
    high: float

    @property
    def determined(self) -> bool:
        return bool(np.isfinite(self.error))

    def __str__(self) -> str:
        return f"{self.name} = {self.shown()}"

    def shown(self) -> str:
        """Value and error for people."""
        if self.unit == "s":  # a time on the record's clock
            value, error = f"{self.value:.7g} s", f"{self.error:.2g} s"
        else:
            value, error = shown(self.value, self.unit), shown(self.error, self.unit, 2)
        return f"{value} ± {error}" if self.determined else f"{value} (not determined)"


@dataclass(frozen=True)
class Search:
    """How the minimum was found.

    Attributes
    ----------
    starts : int
        Points that the search started from.
    arrived : int
        How many of them ended at the best minimum.
    others : tuple of float
        Sums of squares of other minima, as multiples of the best.
    iterations : int
        Of the last stage.
    converged : bool
        Whether the sum of squares is within 1e-7 of where it ends.
    """

    starts: int
    arrived: int
    others: tuple[float, ...]
    iterations: int
    converged: bool


@dataclass(frozen=True, eq=False)
class Fit:
    """A rig fitted to records.

    Attributes
    ----------
    plan : Plan
        What was compared.
    coordinates : ndarray (p,)
        Where the sum of squares is least, in the coordinates of ``plan.space()``.
    ssq : float
        Sum of squared residuals (weighted, or as the loss has them).
    search : Search
    noise : tuple of Noise
        Of the residuals of every record.
    covariance : ndarray (p, p)
        Of the coordinates; infinite where a parameter is not determined.
    unidentified : tuple of Combination
        What the records cannot tell.
    bounds : tuple of two ndarray (p,)
        Where the coordinates were searched.
    version : str
    """

    plan: Plan
    coordinates: Array = field(repr=False)
    ssq: float
    search: Search
    noise: tuple[Noise, ...] = field(repr=False)
    covariance: Array = field(repr=False)
    unidentified: tuple[Combination, ...]
    bounds: tuple[Array, Array] = field(repr=False)
    version: str = field(repr=False)

    @cached_property
    def space(self) -> Space:
        return self.plan.space()

    @cached_property
    def comparison(self) -> Comparison:
        return self.plan.comparison()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return tuple(one.name for one in self.space.unknowns)

    @cached_property
    def values(self) -> dict[str, float]:
        """Fitted values, SI units."""
        return {n: float(v) for n, v in zip(self.names, self.space.values(self.coordinates), strict=True)}

    @cached_property
    def errors(self) -> dict[str, float]:
        """Standard deviations, SI units."""
        deviation = np.sqrt(np.diag(self.covariance)) * self.space.slopes(self.coordinates)
        return {name: float(error) for name, error in zip(self.names, deviation, strict=True)}

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Interval of a parameter; of a positive one symmetric in its logarithm.

        Parameters
        ----------
        name : str
        level : float
            Probability, such as 0.95.
        """
        from scipy.stats import t

        if not 0 < level < 1:
            raise ParameterError([Problem("level", f"got {level!r}; allowed: a number between 0 and 1")])
        i = self.index(name)
        reach = float(t.ppf(0.5 + 0.5 * level, max(self.degrees, 1))) * float(np.sqrt(self.covariance[i, i]))
        one = self.space.unknowns[i]
        if not np.isfinite(reach):
            return one.low, one.high
        low, high = (float(one.value(self.coordinates[i] + sign * reach)) for sign in (-1, 1))
        return max(low, one.low), min(high, one.high)

    def index(self, name: str) -> int:
        """Place of a parameter, which may leave out leading parts of its name."""
        try:
            return self.names.index(resolve(name, dict.fromkeys(self.names)))
        except UnknownNameError:
            raise UnknownNameError("fitted parameter", name, self.names) from None

    def __getitem__(self, name: str) -> Estimate:
        i = self.index(name)
        full = self.names[i]
        low, high = self.interval(full)
        return Estimate(full, self.values[full], self.errors[full], self.space.unknowns[i].unit, low, high)

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every fitted parameter with its error."""
        return tuple(self[name] for name in self.names)

    @cached_property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters that ran to the end of what was searched, each in a sentence."""
        low, high = self.bounds
        found = []
        for i, one in enumerate(self.space.unknowns):
            if one.parameter.startswith("jump."):  # bounded by the samples on both sides
                continue
            for bound, word in ((low[i], "smallest"), (high[i], "largest")):
                if np.isfinite(bound) and abs(self.coordinates[i] - bound) < 1e-9 * (1 + abs(bound)):
                    end = shown(float(one.value(bound)), one.unit)
                    found.append(f"{one.name} ended at the {word} value that was searched, {end}")
        return tuple(found)

    @property
    def samples(self) -> int:
        return self.comparison.size

    @property
    def degrees(self) -> int:
        """Samples less parameters."""
        return self.samples - len(self.space)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @cached_property
    def model(self) -> Array:
        """Friction of the fitted model, trend included, at all samples."""
        found: Array = self.comparison.model(self.coordinates[None])[0][0]
        return found

    @property
    def residuals(self) -> Array:
        """Data less model."""
        found: Array = self.comparison.data - self.model
        return found

    def part(self, values: Array, record: int = 0) -> Array:
        """Those of `values` at all samples that belong to one record."""
        return values[self.comparison.slices[record]]

    @property
    def correlated(self) -> bool:
        """Whether errors take residuals as correlated from sample to sample."""
        return any(noise.correlated for noise in self.noise)

    @cached_property
    def correlation(self) -> Array:
        """Correlation of the estimates; NaN where one is not determined."""
        with np.errstate(all="ignore"):
            size = np.sqrt(np.diag(self.covariance))
            found = self.covariance / np.outer(size, size)
        found[~np.isfinite(found)] = np.nan
        return found

    def rig(self, record: int = 0) -> Slider:
        """The rig with fitted values, driven as a record drives it."""
        driven = self.comparison.parts[record].rig
        own = {
            one.parameter: self.values[one.name]
            for one in self.space.unknowns
            if one.record in (None, record) and one.parameter in driven.parameters()
        }
        return driven.with_values(own)

    @property
    def aic(self) -> float:
        """Akaike's criterion; of fits to the same records the one with less is to be preferred."""
        return self.criteria(self.noise)[0]

    @property
    def bic(self) -> float:
        """Schwarz's criterion."""
        return self.criteria(self.noise)[1]

    def criteria(self, noise: Sequence[Noise]) -> tuple[float, float]:
        """AIC and BIC, counting as many samples as are independent with a given noise."""
        deviance = independent = 0.0
        for i, one in enumerate(noise):
            r = self.part(self.residuals * self.comparison.weights, i)
            worth = len(r) / max(one.inflation, 1.0)
            deviance += worth * float(np.log(np.mean(r**2)))
            independent += worth
        size = len(self.space)
        return deviance + 2 * size, deviance + size * float(np.log(max(independent, 2.0)))

    def __str__(self) -> str:
        from steadyslip.lab.words import words

        return words(self)

    def __repr__(self) -> str:
        inner = ", ".join(f"{e.name}={e.value:.4g}" for e in self.estimates)
        return f"<Fit: {inner}; print it for errors and warnings>"

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it; numbers that do not exist are None."""
        from steadyslip.lab.words import as_dict

        return as_dict(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything, the records included, to a netCDF file; `load_fit` reads it back."""
        from steadyslip.lab.store import save

        save(self, path)

    def plot(self, kind: str = "fit", ax: Any = None) -> Any:
        """Draw the fit: ``fit`` (records, model and residuals) or ``corner`` (estimates against each other).

        Returns
        -------
        array of matplotlib.axes.Axes
        """
        from steadyslip import figures

        kinds: dict[str, Any] = {"fit": figures.fit, "corner": figures.corner}
        if kind not in kinds:
            raise NotAvailable(unknown_name("kind of plot", kind, kinds))
        return kinds[kind](self, ax=ax)


def fit(
    rig: Slider,
    records: Record | Sequence[Record],
    free: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    separate: Sequence[str] = (),
    drive: str = "measured",
    protocol: Any = None,
    trend: int = 0,
    trend_axis: str = "displacement",
    offset: bool = False,
    loss: str = "linear",
    width: float | None = None,
    weights: Any = None,
    errors: str = "auto",
    starts: int = STARTS,
    threads: int | None = None,
) -> Fit:
    """Fit a rig to one or several records of experiments.

    The model is driven by the measured motion of the load point and the measured normal stress, exactly at the
    samples and straight between them, from steady sliding at the first sample. Starting values come from the records.

    Parameters
    ----------
    rig : Slider
        Its laws, and the values of what is not free; values of what is free do not matter. Drive velocity and (with a
        constant contact) normal stress are those of each record.
    records : Record or sequence of Record
        Fitted together.
    free : sequence of str, optional
        Parameters to fit. Unless given, all of the friction law and the stiffness. The level of friction,
        ``friction.mu_ref``, is free in any case unless it is fixed. With a protocol, times of its pieces too
        (``protocol.pieces.1.at``).
    fixed : sequence of str, optional
        Parameters that keep the rig's value.
    separate : sequence of str, optional
        Free parameters that every record has to itself; all others are shared.
    drive : str, optional
        ``measured``: the load point moves as measured, exactly at the samples; ``smoothed``: along straight lines
        between the places where the measured displacement changes its slope, without the noise of its sensor.
    protocol : Protocol, Piece or sequence of Piece, optional
        What moves the load point, on the records' clock, instead of the measured displacement.
    trend : int, optional
        Order of a polynomial that is added to the model's friction, every record's own.
    trend_axis : str, optional
        What it is a polynomial of: ``displacement`` of the load point, or ``time``.
    offset : bool, optional
        Add a constant to friction as well, beside mu_ref.
    loss : str, optional
        ``linear`` (least squares), or ``soft-l1``, ``huber``, ``cauchy``, in which outliers weigh less.
    width : float, optional
        Residual at which that begins; 1.345 standard deviations of most residuals unless given.
    weights : array_like, optional
        One over each sample's standard deviation, up to a factor; one array for each record.
    errors : str, optional
        ``auto``: correlation of the residuals is taken into account where it stands out; ``correlated``: always;
        ``independent``: never.
    starts : int, optional
        Points to start from.
    threads : int, optional
        All cores unless given.

    Returns
    -------
    Fit

    Raises
    ------
    ParameterError
        Listing everything that is wrong.
    NotAvailable
        If the model cannot follow the records from any start.
    """
    plan = make_plan(
        rig, records, free, fixed=fixed, separate=separate, drive=drive, protocol=protocol, trend=trend,
        trend_axis=trend_axis, offset=offset, loss=loss, width=width, weights=weights,
    )  # fmt: skip
    if errors not in ERRORS:
        raise ParameterError([Problem("errors", unknown_name("choice", errors, ERRORS))])
    if not (isinstance(starts, int) and starts >= 1):
        raise ParameterError([Problem("starts", f"got {starts!r}; allowed: a whole number >= 1")])
    if plan.loss != "linear" and plan.width is None:
        first, _, _ = _searched(replace(plan, loss="linear"), starts, threads)
        comparison = replace(plan, loss="linear").comparison(threads)
        plan = check_width(plan, comparison.residuals(first.coordinates[:1])[0][0])
    found, search, bounds = _searched(plan, starts, threads)
    return finished(plan, plan.comparison(threads), found.coordinates[0], search, errors, bounds)


def _searched(plan: Plan, starts: int, threads: int | None) -> tuple[Minima, Search, tuple[Array, Array]]:
    """The best minimum: many starts on few samples, the best of them on all."""
    space = plan.space()
    thin = _thinned(plan)
    quick = replace(thin, rtol=1e-5).comparison(threads)
    whole = plan.comparison(threads)
    begin = starting_points(whole.parts, space, starts)
    low, high = search_bounds(whole.parts, space)
    rough = minimise(lambda z, _: quick.residuals(z), begin, low, high, most=40, tolerance=1e-4)
    if not np.any(np.isfinite(rough.ssq)):
        raise NotAvailable(
            "the model cannot follow these records from any start; is the rig's law and drive that of the experiment?"
        )
    chosen = _distinct(rough, FINALISTS)
    found = minimise(lambda z, _: whole.residuals(z), rough.coordinates[chosen], low, high, most=300, race=True)
    order = np.argsort(found.ssq, kind="stable")
    best = found.ssq[order[0]]
    if not np.isfinite(best):
        raise NotAvailable("the model cannot follow these records; is the rig's law and drive that of the experiment?")
    others = sorted({round(float(s / best), 4) for s in found.ssq if np.isfinite(s) and s > best * (1 + 1e-4)})
    arrived = int(np.sum(rough.ssq <= rough.ssq[chosen[order[0]]] * (1 + 1e-2)))
    found.coordinates = _ordered(found.coordinates, space)
    minima = Minima(found.coordinates[order], found.ssq[order], found.converged[order], found.iterations[order])
    search = Search(starts, arrived, tuple(others), int(minima.iterations[0]), bool(minima.converged[0]))
    return minima, search, (low, high)


def _ordered(coordinates: Array, space: Space) -> Array:
    """States by rising slip distance, so that equal minima look equal."""
    members: dict[tuple[str, str], dict[str, int]] = {}
    for i, one in enumerate(space.unknowns):
        if one.parameter.startswith("friction.states."):
            _, _, number, last = one.parameter.split(".")
            members.setdefault((str(one.record), number), {})[last] = i
    found = coordinates.copy()
    for label in dict.fromkeys(record for record, _ in members):
        states = [places for (record, _), places in members.items() if record == label]
        if len(states) < 2 or any(set(s) != set(states[0]) or "d_c" not in s for s in states):
            continue
        ranks = np.argsort(coordinates[:, [s["d_c"] for s in states]], axis=1)
        for last in states[0]:
            columns = [s[last] for s in states]
            found[:, columns] = np.take_along_axis(coordinates[:, columns], ranks, axis=1)
    return found


def _thinned(plan: Plan) -> Plan:
    """The same plan on few samples of every record."""
    count = max(THIN // len(plan.records), 100)
    rows = []
    for record, sharp in zip(plan.records, plan.sharp, strict=True):
        few = transient_rows(record, count) if len(record) > count else np.arange(len(record))
        rows.append(np.union1d(few, sharp.rows(record.time)))
    thin = tuple(r._taken(k, "thinned") for r, k in zip(plan.records, rows, strict=True))
    weights = None if plan.weights is None else tuple(w[k] for w, k in zip(plan.weights, rows, strict=True))
    return replace(plan, records=thin, weights=weights)


def _distinct(rough: Minima, most: int) -> Array:
    """The best of many ends, each once; repeated best ones if there are few."""
    order = [i for i in np.argsort(rough.ssq, kind="stable") if np.isfinite(rough.ssq[i])]
    chosen: list[int] = []
    for i in order:
        near = [np.max(np.abs(rough.coordinates[i] - rough.coordinates[k])) < 0.02 for k in chosen]
        if not any(near):
            chosen.append(int(i))
        if len(chosen) == most:
            break
    return np.array(chosen)


def finished(
    plan: Plan, comparison: Comparison, z: Array, search: Search, errors: str, bounds: tuple[Array, Array]
) -> Fit:
    """Errors and everything else that belongs to a minimum."""
    from steadyslip import __version__

    r, jacobian = comparison.residuals(z[None])
    residuals, rows = r[0], jacobian[0]
    free = len(z)
    information, spread = rows @ rows.T, np.zeros((free, free))
    noises = []
    for where in comparison.slices:
        own = residuals[where]
        share = free * len(own) // comparison.size
        noise = white(own, share) if errors == "independent" else describe(own, share, errors == "correlated")
        noises.append(noise)
        spread += noise.spread(rows[:, where])
    known = prior_information(comparison.space)
    scale = np.trace(spread) / max(np.trace(information), 1e-300)  # variance of the data, as information counts it
    covariance, lost = combinations(information + scale * known, spread + scale**2 * known, comparison.space)
    ssq = float(residuals @ residuals)
    return Fit(plan, z, ssq, search, tuple(noises), covariance, lost, bounds, __version__)
