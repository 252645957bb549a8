"""Sensitivity of results to parameters: Sobol indices over ranges of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.pictures import draw
from steadyslip.core.progress import interrupts_held, progress_bar
from steadyslip.core.results import ReadOnly
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.axes import Samples
from steadyslip.maps.plan.map import Map, evaluate

POINTS = 4096  # default number of sets of points; chosen by trial, accuracy against time
RESAMPLES = 200  # number of bootstrap samples; chosen by trial, accuracy against time
BLOCK = 32  # number of sets of points that are evaluated between checks for Ctrl-C; chosen by trial
LEAST, MOST = 64, 2**20  # allowed numbers of sets of points; by trial: fewer give intervals as wide as an index's range
ROUNDING = 1e-10  # a result is constant if its relative range is smaller: a million rounding errors
WIDE = 0.2  # the summary warns if the interval of an index (0 to 1) is wider
LEVEL = 0.95  # confidence level of the intervals


@dataclass(frozen=True, eq=False)
class Sensitivity(ReadOnly):
    """Shares of a result's variance that are due to each parameter (Sobol indices).

    Attributes
    ----------
    rig : Slider or Machine
    parameters : tuple of str
    ranges : dict of str to (float, float, str)
        Ends in SI units, and spacing ``linear`` or ``log``.
    first, total : dict of str to ndarray (d,)
        By name of the result: share of the variance due to each parameter alone, and together with its interactions.
    first_interval, total_interval : dict of str to ndarray (2, d)
        95 % bootstrap intervals of the shares.
    missing : dict of str to float
        By name of the result: share of the points without a value; sets with such points are left out of the indices.
    points : dict of str to int
        Number of sets of points used, each of d + 2 evaluations.
    interrupted : bool
        True if Ctrl-C came before all sets were done.
    without : dict of str to str
        Results without indices, with the reason: too few points with a value, or no variation.
    """

    rig: Slider | Machine = field(repr=False)
    parameters: tuple[str, ...]
    ranges: dict[str, tuple[float, float, str]]
    first: dict[str, Array]
    total: dict[str, Array]
    first_interval: dict[str, Array] = field(repr=False)
    total_interval: dict[str, Array] = field(repr=False)
    missing: dict[str, float]
    points: dict[str, int]
    interrupted: bool = False
    without: dict[str, str] = field(default_factory=dict)

    def ranked(self, result: str) -> list[str]:
        """Parameters by decreasing total share."""
        return [self.parameters[i] for i in np.argsort(-self.total[result])]

    def __str__(self) -> str:
        width = max(len(name) for name in self.parameters)
        lines = []
        for result in self.first:
            lines.append(f"{result}: share of its variance, by a parameter alone and with others (95 %)")
            for name in self.ranked(result):
                i = self.parameters.index(name)
                one, all_ = self.first[result][i], self.total[result][i]
                low, high = self.total_interval[result][:, i]
                lines.append(f"  {name:<{width}}  {one:6.3f}  {all_:6.3f}  ({low:.3f} to {high:.3f})")
            intervals = np.stack([self.first_interval[result], self.total_interval[result]])
            if np.max(intervals[:, 1] - intervals[:, 0]) > WIDE:
                lines.append(f"  not settled: some intervals are wider than {WIDE:g}; ask for more points")
            if self.missing[result]:
                lines.append(
                    f"  does not exist at {100 * self.missing[result]:.3g} % of the points, which are left out"
                )
        lines += [f"no shares of {result}: {why}" for result, why in self.without.items()]
        if self.interrupted:
            lines.append(f"  stopped: these are the shares by {max(self.points.values())} sets of points")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Result as JSON-ready dict."""
        return {
            "parameters": list(self.parameters),
            "ranges": {name: list(ends) for name, ends in self.ranges.items()},
            "results": {
                result: {
                    "first": self.first[result].tolist(),
                    "first_interval": self.first_interval[result].T.tolist(),
                    "total": self.total[result].tolist(),
                    "total_interval": self.total_interval[result].T.tolist(),
                    "missing": self.missing[result],
                    "points": self.points[result],
                }
                for result in self.first
            },
            "without": dict(self.without),
        }

    def plot(self, ax: Any = None) -> Any:
        """Draw the shares as bars; see `steadyslip.figures.sensitivity`."""
        return draw(self, ax=ax)


@checked()
def sensitivity(
    rig: Slider | Machine,
    over: Mapping[str, Sequence[Any]],
    of: Any = None,
    *,
    points: int = POINTS,
    seed: int = 0,
    protocol: Any = None,
    progress: bool | None = None,
) -> Sensitivity:
    """Compute Sobol indices of results over ranges of parameters.

    Parameters
    ----------
    rig : Slider or Machine
    over : mapping of str to (low, high) or (low, high, "log")
        At least two parameters by dotted name and their ranges (SI units or text); independent and uniform in the value
        or its logarithm.
    of : sequence of str, Measure or function
        Measures with one number per point, as for `Map`; ``margin`` is ln(k/k_cr). By default critical stiffness and
        margin of a slider, growth rate of a machine.
    points : int
        Number of sets of points, a power of 2; each takes d + 2 evaluations for d parameters.
    seed : int
    protocol : Protocol or piece, optional
        Protocol of measures that simulate.
    progress : bool, optional
        True to show a progress bar; by default on a terminal. After Ctrl-C the indices are those of the finished sets,
        if there are enough (`Sensitivity.interrupted`).

    Returns
    -------
    Sensitivity

    Raises
    ------
    ParameterError
        If any argument is wrong.
    NotAvailable
        If all results have too few points with a value, or do not vary.

    Notes
    -----
    First-order indices by Saltelli et al. (2010, table 2 b), total indices by Jansen (2 f), from Sobol points, by
    `scipy.stats.sobol_indices`. Where a result does not exist at one of the points of a set, the set is left out; the
    largest power of 2 of the remaining sets is used.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> found = ss.sensitivity(rig, {"friction.a": (0.0140, 0.0150), "friction.b": (0.0155, 0.0165)}, points=256)
    >>> print(found)
    critical_stiffness: share of its variance, by a parameter alone and with others (95 %)
      friction.a   0.500   0.500  (0.412 to 0.568)
      friction.b   0.500   0.500  (0.421 to 0.587)
      not settled: some intervals are wider than 0.2; ask for more points
    margin: share of its variance, by a parameter alone and with others (95 %)
      friction.a   0.498   0.513  (0.431 to 0.601)
      friction.b   0.482   0.513  (0.446 to 0.600)
      not settled: some intervals are wider than 0.2; ask for more points
    """
    whole = isinstance(points, int) and not isinstance(points, bool)
    if not (whole and LEAST <= points <= MOST and points & (points - 1) == 0):
        raise ParameterError([Problem("points", f"got {points!r}; allowed: a power of 2, from {LEAST} to {MOST}")])
    if rig.holds:
        raise NotAvailable("shares of variance need steady sliding, but the drive holds a place; compute a map instead")
    plan = Map(
        rig,
        compute=default_results(rig) if of is None else of,
        samples=Samples(over, points, seed=seed),
        protocol=protocol,
    )
    if len(plan.varied) < 2:
        raise ParameterError([Problem("over", "give at least two parameters; one alone has all the variance")])
    outputs = plan.outputs()
    several = [output.name for output in outputs if output.flags or output.extra]
    if several:
        raise ParameterError([Problem("of", f"{name!r} is not one number per point") for name in several])
    sets = _sets(plan, points, seed)
    values = _evaluated(plan, sets, progress)  # (d + 2, points) each
    asked, points = points, next(iter(values.values())).shape[1]
    if points < LEAST:
        raise KeyboardInterrupt(f"after {points} of {asked} sets of points; {LEAST} would have been enough")
    generator = np.random.default_rng(seed)
    found: dict[str, dict[str, Any]] = {n: {} for n in ("first", "total", "low", "high", "missing", "points")}
    without: dict[str, str] = {}
    for output in outputs:
        column = values[output.name]
        good = np.all(np.isfinite(column), axis=0)
        used = np.flatnonzero(good)[: 2 ** int(np.log2(max(good.sum(), 1)))]
        if len(used) < LEAST:
            count = f"{output.name} exists at {good.sum()} of {points} sets of points only"
            without[output.name] = f"{count}; ask for more points, or for other ranges"
            continue
        column = column[:, used]
        if np.ptp(column) <= ROUNDING * np.max(np.abs(column)):
            without[output.name] = f"{output.name} does not depend on {', '.join(plan.varied)}"
            continue
        found["first"][output.name], found["total"][output.name] = _indices(column)
        again = np.stack([_indices(column[:, generator.integers(0, len(used), len(used))]) for _ in range(RESAMPLES)])
        interval = np.quantile(again, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0)
        found["low"][output.name], found["high"][output.name] = interval[:, 0], interval[:, 1]
        found["missing"][output.name] = float(np.mean(~np.isfinite(values[output.name])))
        found["points"][output.name] = len(used)
    if not found["first"]:
        raise NotAvailable("; ".join(without.values()))
    ranges = {name: (low, high, spacing) for name, low, high, spacing in plan.sampling.ranges}  # type: ignore[union-attr]
    return Sensitivity(
        plan.rig, plan.varied, ranges, found["first"], found["total"], found["low"], found["high"], found["missing"],
        found["points"], points < asked, without,
    )  # fmt: skip


def default_results(rig: Slider | Machine) -> tuple[str, ...]:
    """Names of the results that are analysed by default for a rig."""
    return ("critical_stiffness", "margin") if rig.default_along else ("growth_rate",)


def _evaluated(plan: Map, sets: dict[str, Array], progress: bool | None) -> dict[str, Array]:
    """Results by name, each (d + 2, sets); only the sets finished before Ctrl-C if that is pressed."""
    count = next(iter(sets.values())).shape[1]
    parts: list[dict[str, Array]] = []
    with (
        progress_bar(count, progress, "sets of points") as advanced,
        interrupts_held() as interrupted,
        np.errstate(all="ignore"),
    ):
        for start in range(0, count, BLOCK):
            part = {name: values[:, start : start + BLOCK] for name, values in sets.items()}
            parts.append(evaluate(plan.rig, plan.protocol, plan.compute, part))
            if advanced is not None:
                advanced(min(BLOCK, count - start))
            if interrupted:
                break
    return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}


def _sets(plan: Map, points: int, seed: int) -> dict[str, Array]:
    """Values of each parameter at points A, at B, and at A with one parameter from B; (d + 2, points) by name."""
    from scipy.stats import qmc

    ranges = plan.sampling.ranges  # type: ignore[union-attr]
    d = len(ranges)
    unit = qmc.Sobol(2 * d, seed=seed).random(points).T.reshape(2, d, points)
    found = {}
    for i, (name, low, high, spacing) in enumerate(ranges):
        column = low * (high / low) ** unit[:, i] if spacing == "log" else low + (high - low) * unit[:, i]
        rows = np.repeat(column[:1], d + 2, axis=0)
        rows[1] = column[1]
        rows[2 + i] = column[1]
        found[name] = rows
    return found


def _indices(column: Array) -> Array:
    """First-order and total indices (2, d) from a result's values (d + 2, n), ordered as by `_sets`."""
    from scipy.stats import sobol_indices

    parts = {"f_A": column[:1], "f_B": column[1:2], "f_AB": column[2:, None, :]}
    result = sobol_indices(func=parts, n=column.shape[1])
    return np.array([np.atleast_1d(result.first_order), np.atleast_1d(result.total_order)])
