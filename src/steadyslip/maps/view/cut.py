"""Section of a map for a figure: one or two parameters vary, others are fixed, samples are summarised."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import (
    NotAvailable,
    ParameterError,
    Problem,
    SteadyslipError,
    UnknownNameError,
    unknown_name,
)
from steadyslip.core.names import resolve
from steadyslip.core.quantities import parse
from steadyslip.core.results import ReadOnly
from steadyslip.linear.status import STABLE
from steadyslip.maps.plan.axes import SAMPLE
from steadyslip.maps.view.map_result import MapResult

MOST = 500  # largest number of points along an axis: more than a figure resolves
MOST_IN_ALL = 2 * 10**7  # largest number of values read, samples included: 160 MB
MOST_SCATTERED = 5000  # largest number of points of a scatter plot; chosen by trial: more would overlap
BAND = (0.025, 0.5, 0.975)  # quantiles of samples that are computed: ends of the 95 % band, and median
FAILING = ("safety_factor", "margin")
"""Results that have no value for samples that are stable at all stiffnesses, stable at none, or do not slide."""


@dataclass(frozen=True, eq=False)
class View(ReadOnly):
    """Numbers of a section of a map for a figure, in SI units.

    Attributes
    ----------
    names : tuple of str
        Parameters on the axes, x first.
    places : tuple of ndarray
        Values of these parameters: along the grid, or at each scattered point.
    values : dict of str to ndarray
        Results: (nx,), (ny, nx), or (m,) if scattered, then extra dimensions of the result; medians over samples.
    bands : dict of str to ndarray
        2.5, 50 and 97.5 % quantiles over samples along the first axis; empty without samples. For results in `FAILING`,
        samples without a value count as failures, below all values; for other results they are left out.
    missing : dict of str to ndarray
        Share of samples without a value, for the results in `bands`.
    shares : dict of str to ndarray
        For results with kinds: share of samples of each kind along the first axis; empty without samples.
    held : dict of str to float
        Fixed values of the other parameters.
    scattered : bool
        True if the points are samples, not a grid.
    """

    names: tuple[str, ...]
    places: tuple[Array, ...] = field(repr=False)
    values: dict[str, Array] = field(repr=False)
    bands: dict[str, Array] = field(repr=False)
    shares: dict[str, Array] = field(repr=False)
    held: dict[str, float]
    scattered: bool
    missing: dict[str, Array] = field(default_factory=dict, repr=False)


def axes_of(found: MapResult, x: str | None, y: str | None, facet: str | None = None) -> tuple[str, ...]:
    """Full names of the parameters on the axes; by default the map's first one or two, without the `facet` parameter.

    Raises
    ------
    ParameterError
        If a name is not that of a varied parameter, or the two do not fit together.
    """
    own = [dim for dim in found.dims if dim not in (SAMPLE, facet) and found.shape[found.dims.index(dim)] > 1]
    problems, given = [], []
    for place, name in (("x", x), ("y", y)):
        if name is None:
            continue
        try:
            given.append(resolve(name, dict.fromkeys(found.parameters)))
        except UnknownNameError:
            problems.append(Problem(place, unknown_name("parameter", name, found.parameters)))
    if len(set(given)) < len(given):
        problems.append(Problem("y", f"got {y!r} on both axes; give another parameter"))
    if problems:
        raise ParameterError(problems)
    names = given or own[:2] or list(found.parameters)[:1]
    if x is None and y is not None:
        names = [next(n for n in (*own, *found.parameters) if n != given[0]), given[0]]
    if y is None and x is not None:
        names = [given[0], *[n for n in own if n != given[0]][:1]] if given[0] in own else given
    sampled = [n not in found.dims for n in names]
    if any(sampled) and not all(sampled):
        raise ParameterError([Problem("y", "one parameter is sampled, the other on a grid; choose two of one kind")])
    return tuple(names)


def take(found: MapResult, names: Sequence[str], results: Sequence[str], at: Mapping[str, Any] | None = None) -> View:
    """Read a section of a map.

    Parameters
    ----------
    found : MapResult
    names : sequence of str
        Full names of the one or two parameters on the axes.
    results : sequence of str
    at : mapping of str to float or str, optional
        Fixed values of other parameters; by default those nearest to the rig's own.

    Raises
    ------
    ParameterError
        If a name or value is wrong.
    """
    with _damage_reported(found):
        return _read_view(found, found.dataset, names, results, at or {})


@contextmanager
def _damage_reported(found: MapResult) -> Iterator[None]:
    try:
        yield
    except (ValueError, RuntimeError) as error:
        if isinstance(error, SteadyslipError):
            raise
        raise found.store.damage("results", error) from error


def _read_view(
    found: MapResult, data: Any, names: Sequence[str], results: Sequence[str], at: Mapping[str, Any]
) -> View:
    held, place = _fixed_values(found, data, names, at)
    scattered = names[0] not in found.dims
    steps: dict[str, slice] = {}
    free = [n for n in names if n in found.dims]
    for name in free:
        steps[name] = slice(None, None, -(-data.sizes[name] // MOST))
    if SAMPLE in found.dims:
        others = int(np.prod([len(range(data.sizes[n])[steps[n]]) for n in free], dtype=int))
        most = MOST_SCATTERED if scattered else max(100, MOST_IN_ALL // max(others, 1))
        steps[SAMPLE] = slice(None, None, -(-data.sizes[SAMPLE] // most))
    with_status = ["status"] if "status" in data and "status" not in results else []
    part = data[[*results, *with_status, *(n for n in names if scattered)]].isel(place | steps)
    places = tuple(np.asarray(part[name].values) for name in names)
    values, bands, shares, missing = {}, {}, {}, {}
    for result in results:
        order = [*(names[::-1] if not scattered else ()), *((SAMPLE,) if SAMPLE in found.dims else ())]
        numbers = np.asarray(part[result].transpose(*order, ...).values)
        if SAMPLE not in found.dims or scattered:
            values[result] = numbers
            continue
        axis = len(order) - 1
        words = found.words(result)
        if words:
            known = np.sum(numbers >= 0, axis=axis)
            counts = np.stack([np.sum(numbers == code, axis=axis) for code in range(len(words))])
            with np.errstate(invalid="ignore"):  # NaN where nothing is computed yet
                shares[result] = counts / known
            values[result] = np.where(known > 0, np.argmax(counts, axis=0), -1)
        else:
            absent = np.mean(~np.isfinite(numbers), axis=axis)
            if result in FAILING:
                numbers, absent = _with_failures(numbers, _stable_samples(found, part, order), result)
            bands[result] = _quantiles(numbers, axis)
            values[result] = np.where(np.isinf(bands[result][1]), np.nan, bands[result][1])
            missing[result] = absent
    return View(tuple(names), places, values, bands, shares, held, scattered, missing)


def _stable_samples(found: MapResult, part: Any, order: Sequence[str]) -> Array | None:
    """Mask of the samples that are stable, with axes in the given order; None if the map has no status."""
    if "status" not in part:
        return None
    stable: Array = np.asarray(part["status"].transpose(*order).values) == STABLE
    return stable


def _with_failures(numbers: Array, stable: Array | None, result: str) -> tuple[Array, Array]:
    """Values with missing values replaced, and share of failures.

    A failed sample gets the lowest value, a stable sample without an edge an infinite value.
    """
    none = ~np.isfinite(numbers)
    always = np.zeros_like(none) if stable is None else none & stable
    failed = none & ~always
    least = -np.inf if result == "margin" else 0.0  # margin is the logarithm of the safety factor
    return np.where(always, np.inf, np.where(failed, least, numbers)), np.mean(failed, axis=-1)


def _quantiles(numbers: Array, axis: int) -> Array:
    """Quantiles `BAND` along an axis, of all values but NaN; NaN where all values are NaN; (3, ...)."""
    empty = np.all(np.isnan(numbers), axis=axis, keepdims=True)
    # with infinite values, quantiles are values of samples, because interpolation with infinity is undefined
    method: Any = "closest_observation" if np.isinf(numbers).any() else "linear"
    found = np.nanquantile(np.where(empty, 0.0, numbers), BAND, axis=axis, method=method)
    return np.asarray(np.where(np.squeeze(empty, axis), np.nan, found))


def _fixed_values(
    found: MapResult, data: Any, names: Sequence[str], at: Mapping[str, Any]
) -> tuple[dict[str, float], dict[str, int]]:
    """Fixed value and index of each dimension that is not on an axis of the figure, by name."""
    others = [dim for dim in found.dims if dim not in (*names, SAMPLE)]
    known, problems, wanted = dict.fromkeys(others), [], {}
    if not isinstance(at, Mapping):
        raise ParameterError([Problem("at", f"got {at!r}; allowed: names of parameters and values")])
    for name, value in at.items():
        try:
            full = resolve(name, known)
            wanted[full] = parse(value, found.unit(full)) if isinstance(value, str) else float(value)
        except UnknownNameError:
            problems.append(Problem("at", unknown_name("parameter", name, others)))
        except (ValueError, TypeError) as error:
            problems.append(Problem(f"at.{name}", str(error)))
    if problems:
        raise ParameterError(problems)
    held, place = {}, {}
    for dim in others:
        values = np.asarray(data[dim].values)
        value = wanted.get(dim, own_value(found, dim))
        target = values[len(values) // 2] if value is None else value
        place[dim] = int(np.argmin(np.abs(values - target)))
        held[dim] = float(values[place[dim]])
    return held, place


def own_value(found: MapResult, name: str) -> float | None:
    """Value (SI) of a parameter in the map's rig; None if it cannot be read."""
    try:
        rig = found.rig
        return rig.value(name)
    except (NotAvailable, ParameterError, UnknownNameError):
        return None
