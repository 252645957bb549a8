"""Residuals of the records and their derivatives by the free parameters, for many parameter sets at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import InternalError
from steadyslip.core.results import read_only
from steadyslip.experiments.fitting.commanded import CommandedInputs
from steadyslip.experiments.fitting.forward import Forward, InputTable
from steadyslip.experiments.fitting.input_tables import MeasuredInputs, ProtocolInputs, Sharp
from steadyslip.experiments.fitting.unknowns import Space, Unknown
from steadyslip.experiments.loading.loading import Course, Loading, resting_rate
from steadyslip.experiments.measured.record import Record
from steadyslip.machine.slider import Slider

CACHED_POINTS = 6  # number of points whose model results are cached
MAX_CACHED_SAMPLES = 200_000  # results of fits with more samples are not cached, to save memory


@dataclass(frozen=True, eq=False)
class RecordPart:
    """Record, and the model with which it is compared.

    Attributes
    ----------
    record : Record
    rig : Slider
        Rig with the initial velocity and normal stress of the record.
    forward : Forward
        Compiled model.
    inputs : CommandedInputs, MeasuredInputs or ProtocolInputs
        Object that makes the input tables of the model.
    data : ndarray (n,)
        Observed friction coefficient.
    weights : ndarray (n,)
        Reciprocal of the standard deviation of each sample, up to a common factor.
    rig_indices, time_indices, begin_indices, trend_indices : tuple of int
        Indices of the rig's parameters, free times, initial states and trend coefficients among the unknowns.
    given_indices : tuple of int
        Indices of free times that are fixed in a fit: the model has no derivatives by them.
    trend : ndarray (terms, n)
        Factors of the trend coefficients.
    known_begin : tuple of float
        Initial differences from steady sliding, in the order of `Forward.unsettled`, if they are known.
    """

    record: Record
    rig: Slider
    forward: Forward
    inputs: CommandedInputs | MeasuredInputs | ProtocolInputs
    data: Array
    weights: Array
    rig_indices: tuple[int, ...]
    time_indices: tuple[int, ...]
    begin_indices: tuple[int, ...]
    trend_indices: tuple[int, ...]
    trend: Array
    known_begin: tuple[float, ...] = ()
    given_indices: tuple[int, ...] = ()

    @cached_property
    def moved_indices(self) -> tuple[int, ...]:
        """Indices, among the unknowns, of the free times by which the model has derivatives."""
        return tuple(place for place in self.time_indices if place not in self.given_indices)

    def begin(self, values: Array) -> Array:
        """Initial differences (m, k) from steady sliding, known or free, at values (m, p) of the unknowns."""
        if self.known_begin:
            return np.tile(self.known_begin, (len(values), 1))
        return np.asarray(values[:, list(self.begin_indices)])

    def table(self, values: Array, sensitive: bool = True) -> InputTable:
        first = len(self.rig_indices)
        directions = first + len(self.moved_indices) if sensitive else 0
        return self.inputs.table(values[:, list(self.time_indices)], first, directions)

    @cached_property
    def without_derivatives(self) -> Forward:
        """The model without derivatives, which runs several times as fast."""
        return self._observing(None)

    def _observing(self, memory: str | None) -> Forward:
        own = self.forward
        return Forward(
            own.rig, own.names, own.rtol, own.shifts, own.unsettled, sensitive=False, effort=own.effort, observed=memory
        )

    def states(self, values: Array) -> dict[str, Array]:
        """Friction (m, n) without a trend, and each memory variable (m, n), at values (m, p) of the unknowns."""
        own, table, begin = values[:, list(self.rig_indices)], self.table(values, sensitive=False), self.begin(values)
        memories = [item.name for item in self.forward.model.memory if item.unit == "1"]
        models = {"friction": self.without_derivatives} | {name: self._observing(name) for name in memories}
        return {name: forward.run(table, own, own, begin)[:, 0] for name, forward in models.items()}

    def begun_from(self, values: Array, begins: Array) -> Array:
        """Friction (m, n) without a trend at values (p,) of the unknowns, for several initial differences (m, k)."""
        many = np.tile(values, (len(begins), 1))
        own = many[:, list(self.rig_indices)]
        return np.asarray(self.without_derivatives.run(self.table(many, sensitive=False), own, own, begins)[:, 0])

    def driven_by(self, values: Array, loads: Sequence[Course]) -> Array:
        """Friction (loads, n) without a trend at values (p,) of the unknowns, for several courses of the load point.

        The times of changes are those in `values`. All courses are run at once, without derivatives.
        """
        if not isinstance(self.inputs, CommandedInputs):
            raise InternalError("only the commanded loading has other courses")
        own = self.forward
        names = (*own.names, "drive.velocity")
        forward = Forward(own.rig, names, own.rtol, own.shifts, own.unsettled, sensitive=False, effort=own.effort)
        rates = [next(level for level in one.levels.tolist() if level > 0) if one.first == 0 else one.first
                 for one in loads]  # fmt: skip
        given = np.column_stack([np.tile(values[list(self.rig_indices)], (len(loads), 1)), rates])
        begin = np.tile(self.begin(values[None]), (len(loads), 1))
        table = self.inputs.table_of(values[list(self.time_indices)], loads)
        return np.asarray(forward.run(table, given, given, begin)[:, 0])


class DataComparison:
    """Comparison of data with a model, whose values and derivatives a subclass computes.

    Parameters
    ----------
    data, weights : sequence of ndarray
        Data, and reciprocal of the standard deviation of each sample up to a common factor, for every series with
        independent noise.
    space : Space
        Unknowns of the fit.
    loss : str
        ``linear`` (least squares), or a loss that gives outliers less weight.
    width : float
        Residual from which outliers have less weight.
    """

    def __init__(
        self, data: Sequence[Array], weights: Sequence[Array], space: Space, loss: str = "linear", width: float = 1.0
    ) -> None:
        self.space, self.loss, self.width = space, loss, width
        ends = np.cumsum([0, *map(len, data)])
        self.slices = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        self.size = int(ends[-1])
        self.data, self.weights = np.concatenate(data), np.concatenate(weights)
        self._recent: deque[tuple[bytes, Array, Array]] = deque(maxlen=CACHED_POINTS)

    def _run(self, coordinates: Array) -> tuple[Array, Array]:
        """Model (m, n) and derivatives (m, p, n) at coordinates (m, p), computed without the cache."""
        raise NotImplementedError

    def model(self, coordinates: Array) -> tuple[Array, Array]:
        """Model (m, n) and derivatives (m, p, n) at coordinates (m, p), not weighted; read-only arrays.

        Results of single points are cached, so that errors at a minimum need no further run. Results of several points
        are not cached: a motion that is completed together with others may fail if it is run alone.
        """
        if len(coordinates) == 1:
            for point, own, slopes in self._recent:
                if point == coordinates.tobytes():
                    return own[None], slopes[None]
        predicted, jacobian = (read_only(array) for array in self._run(coordinates))
        if len(coordinates) == 1 and self.size <= MAX_CACHED_SAMPLES:
            self._recent.append((coordinates.tobytes(), predicted[0], jacobian[0]))
        return predicted, jacobian

    def residuals(self, coordinates: Array, data: Array | None = None) -> tuple[Array, Array]:
        """Weighted residuals (m, n), data minus model, and derivatives (m, p, n) of the model; the loss scales both.

        Parameters
        ----------
        coordinates : ndarray (m, p)
        data : ndarray (m, n) or (n,), optional
            Data that replace those of the records.
        """
        predicted, jacobian = self.model(coordinates)
        r = (self.data if data is None else data) - predicted
        if np.any(self.weights != 1.0):
            r, jacobian = r * self.weights, jacobian * self.weights
        if self.loss != "linear":
            r, slope = scaled_by_loss(self.loss, r, self.width)
            jacobian = jacobian * slope[:, None, :]
        return r, jacobian


class Comparison(DataComparison):
    """Comparison of all records of a fit of a slider with their models.

    Parameters
    ----------
    parts : sequence of RecordPart
    space, loss, width
        As for `DataComparison`.
    """

    def __init__(self, parts: tuple[RecordPart, ...], space: Space, loss: str = "linear", width: float = 1.0) -> None:
        self.parts = parts
        super().__init__([part.data for part in parts], [part.weights for part in parts], space, loss, width)

    def _run(self, coordinates: Array) -> tuple[Array, Array]:
        count = len(coordinates)
        values, slopes = self.space.values(coordinates), self.space.slopes(coordinates)
        predicted = np.zeros((count, self.size))
        jacobian = np.zeros((count, len(self.space), self.size))
        for part, where in zip(self.parts, self.slices, strict=True):
            places = list(part.rig_indices)
            begin = list(part.begin_indices)
            found = part.forward.run(part.table(values), values[:, places], slopes[:, places], part.begin(values))
            predicted[:, where] = found[:, 0]
            jacobian[:, places, where] = found[:, 1 : 1 + len(places)]
            for k, place in enumerate((*part.moved_indices, *begin), start=1 + len(places)):
                jacobian[:, place, where] = found[:, k] * slopes[:, place, None]
            for row, place in zip(part.trend, part.trend_indices, strict=True):
                predicted[:, where] += values[:, place, None] * row
                jacobian[:, place, where] = slopes[:, place, None] * row
        return predicted, jacobian

    def misfit(self, coordinates: Array) -> Array:
        """Sums of squares (m,) of the residuals scaled by the loss, computed without derivatives."""
        values = self.space.values(coordinates)
        total = np.zeros(len(coordinates))
        for part in self.parts:
            own = values[:, list(part.rig_indices)]
            table = part.table(values, sensitive=False)
            predicted = part.without_derivatives.run(table, own, own, part.begin(values))[:, 0]
            predicted += values[:, list(part.trend_indices)] @ part.trend
            r = (part.data - predicted) * part.weights
            if self.loss != "linear":
                r, _ = scaled_by_loss(self.loss, r, self.width)
            total += np.einsum("mn,mn->m", r, r)
        return np.where(np.isfinite(total), total, np.inf)


def scaled_by_loss(loss: str, r: Array, width: float) -> tuple[Array, Array]:
    """Scaled residuals, whose squares are the loss of the residuals `r`, and their derivatives by `r`."""
    z = np.maximum((r / width) ** 2, 1e-20)
    with np.errstate(all="ignore"):
        if loss == "soft-l1":
            rho, slope = 2 * (np.sqrt(1 + z) - 1), 1 / np.sqrt(1 + z)
        elif loss == "huber":
            root = np.sqrt(z)
            rho, slope = np.where(z <= 1, z, 2 * root - 1), np.where(z <= 1, 1.0, 1 / root)
        else:
            rho, slope = np.log1p(z), 1 / (1 + z)
        size = np.sqrt(rho)
        return np.sign(r) * width * size, slope * np.sqrt(z) / size


def jump_unknowns(record: int | None, sharp: Sharp) -> list[Unknown]:
    """Unknown times, s, of jumps of the normal stress or of a measured velocity, each between two samples."""
    label = "" if record is None else f"@{record + 1}"
    return [
        Unknown(f"jump.{k}{label}", f"jump.{k}", "s", record, False, late - early, early, late)
        for k, (early, late) in enumerate(sharp.jumps, start=1)
    ]


def step_unknowns(record: int | None, loading: Loading, pressed: bool) -> list[Unknown]:
    """Unknown times and durations, s, of commanded changes, if the measured columns do not determine them."""
    label = "" if record is None else f"@{record + 1}"
    changes = [one for one in loading.changes if pressed or one[0] == "load"]
    found = []
    for k, (_, _, change) in enumerate(changes, start=1):
        ends = [("at", change.free, change.earliest, change.latest),
                ("duration", change.stretches, change.shortest, change.longest)]  # fmt: skip
        for what, wanted, low, high in ends:
            name = f"step.{k}.{what}"
            if wanted:
                found.append(Unknown(f"{name}{label}", name, "s", record, False, high - low, low, high))
    return found


MAX_LAG = 0.02  # largest lag between the channels, as a share of the record; larger lags are visible
MIN_HOLD, MAX_HOLD = 1e-3, 1e5  # bounds of the hold before a record that begins at rest, as shares of the record


def start_unknowns(record: int | None, loading: Loading, span: float, lag: bool) -> list[Unknown]:
    """Unknowns of a record: lag (s) of friction behind the loading; duration (s) of a hold before a record at rest."""
    label = "" if record is None else f"@{record + 1}"
    found = []
    if lag:
        reach = MAX_LAG * span
        found.append(Unknown(f"lag{label}", "lag", "s", record, False, 0.1 * reach, -reach, reach))
    if resting_rate(loading) is not None:
        found.append(
            Unknown(f"start.hold{label}", "start.hold", "s", record, True, 1.0, MIN_HOLD * span, MAX_HOLD * span)
        )
    return found


MAX_INITIAL = 30.0  # largest initial difference from steady sliding: of ln(state), or of friction over 0.01


def initial_unknowns(record: int | None, sizes: dict[str, float]) -> list[Unknown]:
    """Unknown initial differences from steady sliding, of friction and of each state; `sizes` are typical sizes."""
    label = "" if record is None else f"@{record + 1}"
    return [
        Unknown(
            f"initial.{n}{label}", f"initial.{n}", "1", record, False, size, -MAX_INITIAL * size, MAX_INITIAL * size
        )
        for n, size in sizes.items()
    ]


def trend_unknowns(record: int | None, order: int, offset: bool) -> list[Unknown]:
    """Unknown coefficients of the trend, a polynomial in the elapsed share of the record, and unknown offset."""
    names = (["offset"] if offset else []) + [f"trend.{k}" for k in range(1, order + 1)]
    label = "" if record is None else f"@{record + 1}"
    return [Unknown(f"{n}{label}", n, "1", record, False, 0.1, -np.inf, np.inf) for n in names]


def trend_rows(record: Record, order: int, offset: bool, axis: str, moved: Array | None = None) -> Array:
    """Factors (terms, n) of the trend coefficients: powers of the elapsed share of the displacement, or of the time.

    `moved` is the commanded displacement (m) if it is known; it replaces the measured displacement.
    """
    driven = record.displacement if moved is None else moved
    along: Any = record.time if axis == "time" or driven is None else driven
    share = (along - along[0]) / (along[-1] - along[0])
    return np.array(([np.ones_like(share)] if offset else []) + [share**k for k in range(1, order + 1)]).reshape(
        -1, len(share)
    )
