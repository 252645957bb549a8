"""Records against the model: residuals and their derivatives in the free parameters, for many trials at once."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.results import read_only
from steadyslip.experiments.fitting.commanded import CommandedInputs
from steadyslip.experiments.fitting.forward import Forward, InputTable
from steadyslip.experiments.fitting.inputs import MeasuredInputs, ProtocolInputs, Sharp
from steadyslip.experiments.fitting.unknowns import Space, Unknown
from steadyslip.experiments.loading.loading import Loading, resting_rate
from steadyslip.experiments.measured.record import Record
from steadyslip.machine.slider import Slider

RECENT = 6  # points of which is remembered what the model said,
REMEMBERED = 200_000  # while they are few: of so many samples together


@dataclass(frozen=True, eq=False)
class RecordPart:
    """One record and what it is compared with.

    Attributes
    ----------
    record : Record
    rig : Slider
        As the record drives it: its own initial rate and normal stress.
    forward : Forward
    inputs : CommandedInputs, MeasuredInputs or ProtocolInputs
    data : ndarray (n,)
        What was observed.
    weights : ndarray (n,)
        One over the standard deviation of each sample, up to a common factor.
    rig_places, time_places, begin_places, trend_places : tuple of int
        Where the parameters of the rig, free times, where it begins and the trend lie among the unknowns.
    trend : ndarray (terms, n)
        What multiplies the coefficients of the trend.
    """

    record: Record
    rig: Slider
    forward: Forward
    inputs: CommandedInputs | MeasuredInputs | ProtocolInputs
    data: Array
    weights: Array
    rig_places: tuple[int, ...]
    time_places: tuple[int, ...]
    begin_places: tuple[int, ...]
    trend_places: tuple[int, ...]
    trend: Array

    def table(self, values: Array, sensitive: bool = True) -> InputTable:
        first = len(self.rig_places)
        directions = first + len(self.time_places) if sensitive else 0
        return self.inputs.table(values[:, list(self.time_places)], first, directions)

    @cached_property
    def plain(self) -> Forward:
        """The same without derivatives, several times as fast."""
        own = self.forward
        return Forward(own.rig, own.names, own.rtol, own.shifts, own.unsettled, sensitive=False, effort=own.effort)


class Comparison:
    """All records of a fit together.

    Parameters
    ----------
    parts : sequence of RecordPart
    space : Space
    loss : str
        ``linear`` (least squares) or a loss that outliers weigh less in.
    width : float
        Residual at which that begins.
    """

    def __init__(self, parts: tuple[RecordPart, ...], space: Space, loss: str = "linear", width: float = 1.0) -> None:
        self.parts, self.space, self.loss, self.width = parts, space, loss, width
        ends = np.cumsum([0, *(len(part.data) for part in parts)])
        self.slices = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        self.size = int(ends[-1])
        self.data = np.concatenate([part.data for part in parts])
        self.weights = np.concatenate([part.weights for part in parts])
        self._recent: deque[tuple[bytes, Array, Array]] = deque(maxlen=RECENT)

    def model(self, coordinates: Array) -> tuple[Array, Array]:
        """What the model says, (m, n), and its derivatives, (m, p, n); not weighted.

        What is asked of one point shortly after a few are tried, such as errors at a minimum, costs no run. Nobody may
        write to the answer.
        """
        if len(coordinates) == 1:
            for point, own, slopes in self._recent:
                if point == coordinates.tobytes():
                    return own[None], slopes[None]
        seen, jacobian = (read_only(array) for array in self._run(coordinates))
        if len(coordinates) * self.size <= REMEMBERED:
            rows = zip(coordinates, seen, jacobian, strict=True)
            self._recent.extend((z.tobytes(), own, slopes) for z, own, slopes in rows)
        return seen, jacobian

    def _run(self, coordinates: Array) -> tuple[Array, Array]:
        count = len(coordinates)
        values, slopes = self.space.values(coordinates), self.space.slopes(coordinates)
        seen = np.zeros((count, self.size))
        jacobian = np.zeros((count, len(self.space), self.size))
        for part, where in zip(self.parts, self.slices, strict=True):
            places = list(part.rig_places)
            begin = list(part.begin_places)
            found = part.forward.run(part.table(values), values[:, places], slopes[:, places], values[:, begin])
            seen[:, where] = found[:, 0]
            jacobian[:, places, where] = found[:, 1 : 1 + len(places)]
            for k, place in enumerate((*part.time_places, *begin), start=1 + len(places)):
                jacobian[:, place, where] = found[:, k] * slopes[:, place, None]
            for row, place in zip(part.trend, part.trend_places, strict=True):
                seen[:, where] += values[:, place, None] * row
                jacobian[:, place, where] = slopes[:, place, None] * row
        return seen, jacobian

    def residuals(self, coordinates: Array, data: Array | None = None) -> tuple[Array, Array]:
        """Weighted residuals (data less model) and derivatives of the model, as the loss has them.

        Parameters
        ----------
        coordinates : ndarray (m, p)
        data : ndarray (m, n) or (n,), optional
            Other data than the records' own.
        """
        seen, jacobian = self.model(coordinates)
        r = (self.data if data is None else data) - seen
        if np.any(self.weights != 1.0):
            r, jacobian = r * self.weights, jacobian * self.weights
        if self.loss != "linear":
            r, slope = lost(self.loss, r, self.width)
            jacobian = jacobian * slope[:, None, :]
        return r, jacobian

    def misfit(self, coordinates: Array) -> Array:
        """Sums of squares, as the loss has them, (m,); no derivatives are computed."""
        values = self.space.values(coordinates)
        total = np.zeros(len(coordinates))
        for part in self.parts:
            own = values[:, list(part.rig_places)]
            begin = values[:, list(part.begin_places)]
            seen = part.plain.run(part.table(values, sensitive=False), own, own, begin)[:, 0]
            seen += values[:, list(part.trend_places)] @ part.trend
            r = (part.data - seen) * part.weights
            if self.loss != "linear":
                r, _ = lost(self.loss, r, self.width)
            total += np.einsum("mn,mn->m", r, r)
        return np.where(np.isfinite(total), total, np.inf)


def lost(loss: str, r: Array, width: float) -> tuple[Array, Array]:
    """Residuals whose squares are the loss, and how fast they change with the residual itself."""
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
    """When, between two samples, the normal stress or a measured rate jumped."""
    label = "" if record is None else f"@{record + 1}"
    return [
        Unknown(f"jump.{k}{label}", f"jump.{k}", "s", record, False, late - early, early, late)
        for k, (early, late) in enumerate(sharp.jumps, start=1)
    ]


def step_unknowns(record: int | None, loading: Loading, pressed: bool) -> list[Unknown]:
    """When each commanded change begins and, of a ramp, how long it takes, where the columns leave that open."""
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


LAGGING = 0.02  # of a record: the largest lag between its channels
LEAST_HOLD, LONGEST_HOLD = 1e-3, 1e5  # of a record, before it, where it begins at rest


def start_unknowns(record: int | None, loading: Loading, span: float, lag: bool) -> list[Unknown]:
    """By how much friction comes later than what drives it; how long a record that begins at rest had rested, s."""
    label = "" if record is None else f"@{record + 1}"
    found = []
    if lag:
        reach = LAGGING * span
        found.append(Unknown(f"lag{label}", "lag", "s", record, False, 0.1 * reach, -reach, reach))
    if resting_rate(loading) is not None:
        found.append(
            Unknown(f"start.hold{label}", "start.hold", "s", record, True, 1.0, LEAST_HOLD * span, LONGEST_HOLD * span)
        )
    return found


FARTHEST = 30.0  # natural sizes that a motion may begin away from steady sliding


def initial_unknowns(record: int | None, sizes: dict[str, float]) -> list[Unknown]:
    """How far from steady sliding the motion begins: friction that the spring pulls with, and each memory of it."""
    label = "" if record is None else f"@{record + 1}"
    return [
        Unknown(f"initial.{n}{label}", f"initial.{n}", "1", record, False, size, -FARTHEST * size, FARTHEST * size)
        for n, size in sizes.items()
    ]


def trend_unknowns(record: int | None, order: int, offset: bool) -> list[Unknown]:
    """Coefficients of a polynomial in the share of the record that has passed."""
    names = (["offset"] if offset else []) + [f"trend.{k}" for k in range(1, order + 1)]
    label = "" if record is None else f"@{record + 1}"
    return [Unknown(f"{n}{label}", n, "1", record, False, 0.1, -np.inf, np.inf) for n in names]


def trend_rows(record: Record, order: int, offset: bool, axis: str, moved: Array | None = None) -> Array:
    """Powers of the share of displacement (or time) that has passed; `moved` is the commanded one, where known."""
    driven = record.displacement if moved is None else moved
    along: Any = record.time if axis == "time" or driven is None else driven
    share = (along - along[0]) / (along[-1] - along[0])
    return np.array(([np.ones_like(share)] if offset else []) + [share**k for k in range(1, order + 1)]).reshape(
        -1, len(share)
    )
