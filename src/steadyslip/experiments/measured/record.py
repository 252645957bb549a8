"""Record of an experiment: clean columns in SI units, with notes on every change made to them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.caching import HasCache, cached
from steadyslip.core.domains import real
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.results import read_only
from steadyslip.core.roles import Parameter
from steadyslip.experiments.loading.across import yielding
from steadyslip.experiments.loading.kinks import load_course
from steadyslip.experiments.loading.loading import Loading
from steadyslip.experiments.loading.pressing import LoadStep, oscillation, steps_of, stress_course
from steadyslip.experiments.numerics.noise import lasting
from steadyslip.files.output import write_columns

FEWEST_ROWS = 20
"""Least number of samples of a record; chosen by trial: fewer do not determine rates and noise."""
DRIFT = 0.02
"""Largest relative change of the normal stress that counts as drift of its servo, not as a command; chosen by trial."""


@dataclass(frozen=True, eq=False)
class Record(Displayed, HasCache):
    """Record of an experiment; made by `read_record` or `record_from_arrays`.

    Attributes
    ----------
    time : ndarray (n,)
        Rising times, s.
    friction : ndarray (n,)
        Shear stress over normal stress.
    normal : ndarray (n,) or None
        Effective normal stress, Pa: total minus `pore_pressure` if that was measured.
    shear : ndarray (n,) or None
        Pa.
    displacement : ndarray (n,) or None
        Displacement of the load point, m; the integral of its rate if only the rate was measured.
    velocity : ndarray (n,) or None
        Rate of the load point, m/s; None if not measured.
    source : str
    notes : tuple of str
        Notes on everything that was noticed or changed.
    integrated : bool
        True if the displacement is the integral of the velocity.
    worth : ndarray (n,) or None
        Weights in fits, if each sample is the mean of several measured samples: the number of these that are
        independent, which is smaller than their count if the noise is correlated. None if the samples were measured.
    commanded : Loading or None
        Commanded loading, if it was found before samples were left out or averaged.
    """

    time: Array = field(repr=False)
    friction: Array = field(repr=False)
    normal: Array | None = field(repr=False)
    shear: Array | None = field(repr=False)
    displacement: Array | None = field(repr=False)
    velocity: Array | None = field(repr=False)
    source: str
    notes: tuple[str, ...] = ()
    integrated: bool = False
    worth: Array | None = field(default=None, repr=False)
    commanded: Loading | None = field(default=None, repr=False)
    pore_pressure: Array | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def steps(self) -> tuple[LoadStep, ...]:
        """Changes made during the experiment, in order of time."""
        return steps_of(self.loading, None if (total := self.total_normal) is None else oscillation(self.time, total))

    @cached_property
    def loading(self) -> Loading:
        """Commanded loading, as found in the measured displacement and normal stress.

        If a spring lies between the displacement sensor and the load point, as for a sensor across the fault, its
        stretch is added to the displacement first.
        """
        if self.commanded is not None:
            return self.commanded
        load = None if self.displacement is None else load_course(self.time, self.displacement, self.integrated)
        if load is not None and self.displacement is not None and not self.integrated:
            behind = yielding(self.time, self.displacement, self.friction, load)
            load = load if behind is None else behind.course
        total = self.total_normal
        pore = None
        if self.pore_pressure is not None and total is not None:  # shifted so that it is never zero
            size = float(np.mean(total))
            pore = stress_course(self.time, self.pore_pressure + size).lowered(size)
        return Loading(load, None if total is None else stress_course(self.time, total), pore)

    @property
    def total_normal(self) -> Array | None:
        """Total normal stress, Pa; None if no normal stress was measured."""
        if self.normal is None or self.pore_pressure is None:
            return self.normal
        return np.asarray(self.normal + self.pore_pressure)

    @cached_property
    def stress_changes(self) -> bool:
        """True if the normal stress was changed by steps, ramps or oscillations, or by more than drift of a servo."""
        stress = self.loading.stress
        if stress is None:
            return False
        pore = self.loading.pore
        along = stress.at(self.time) - (0.0 if pore is None else pore.at(self.time))
        changes = bool(stress.changes) or self.pressure_changes
        return changes or float(np.ptp(along)) > DRIFT * float(np.mean(along))

    @cached_property
    def pressure_changes(self) -> bool:
        """True if the pore pressure was changed by steps or ramps, or smoothly by more than drift."""
        pore = self.loading.pore
        if pore is None or self.normal is None:
            return False
        return bool(pore.changes) or float(np.ptp(pore.at(self.time))) > DRIFT * float(np.mean(self.normal))

    @cached_property
    def initial_rate(self) -> float | None:
        """Load-point velocity before its first change, m/s; None if the displacement was not measured."""
        return None if self.loading.load is None else float(self.loading.load.at(self.time[:1])[0])

    @cached_property
    def rate(self) -> Array | None:
        """Load-point velocity at the samples, m/s: measured, or the slope of the displacement over seven samples."""
        if self.velocity is not None or self.displacement is None:
            return self.velocity
        half = 3
        n = len(self.time)
        low, high = np.clip(np.arange(n) - half, 0, n - 1), np.clip(np.arange(n) + half, 0, n - 1)
        rate: Array = (self.displacement[high] - self.displacement[low]) / (self.time[high] - self.time[low])
        return np.asarray(read_only(rate))

    def taken(self, rows: Any, note: str) -> Record:
        """Record of the samples that `rows` (mask, slice or indices) selects; `note` is added to its notes."""

        def of(values: Array | None) -> Array | None:
            return None if values is None else frozen(values[rows])

        columns = {name: of(getattr(self, name)) for name in ("time", "friction", *_OPTIONAL, "worth")}
        return replace(self, **columns, commanded=None, notes=(*self.notes, note))  # type: ignore[arg-type]

    def between(self, start: Any, end: Any) -> Record:
        """Part between two times (s, or text such as ``"11.6e3 s"``).

        Raises
        ------
        ParameterError
            If fewer than twenty samples are left.
        """
        first, last = seconds("start", start), seconds("end", end)
        rows = (self.time >= first) & (self.time <= last)
        if np.sum(rows) < FEWEST_ROWS:
            span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
            message = f"got {first!r} to {last!r} s, which leaves {np.sum(rows)} samples; the record is from {span}"
            raise ParameterError([Problem("between", message)])
        return self.taken(rows, f"cut to {first:.6g} to {last:.6g} s, {np.sum(rows)} of {len(self)} samples")

    def decimated(self, count: int) -> Record:
        """Record of about `count` samples, dense after every change and sparse in steady parts.

        Each sample is the mean of neighbouring samples with no change among them; `worth` is the number of these that
        are independent.
        """
        if count >= len(self):
            return self
        return binned(self, bin_starts(self, count))

    def detrended(self, order: int = 1) -> Record:
        """Record with a trend subtracted from friction: a polynomial in the load point's displacement.

        If the displacement was not measured, the polynomial is in time. It is fitted to the steady parts before every
        change and at the end, with a different constant in each part. The option ``trend`` of a fit is better: it fits
        the trend together with the law, so that confidence intervals include the uncertainty of the trend.
        """
        if not (isinstance(order, int) and 1 <= order <= 5):
            raise ParameterError([Problem("order", f"got {order!r}; allowed: a whole number from 1 to 5")])
        axis = self.time if self.displacement is None else self.displacement
        s = (axis - axis[0]) / (axis[-1] - axis[0])
        edges = np.searchsorted(self.time, [self.time[0], *(step.time for step in self.steps), np.inf])
        columns, rows = [], []
        for first, last in pairwise(edges):
            if last - first >= FEWEST_ROWS:
                part = np.arange(first + (last - first) * (0 if first == 0 else 2) // 3, last)
                rows.append(part)
        if not rows:
            raise NotAvailable(
                f"no part between steps has {FEWEST_ROWS} samples or more, so that a trend cannot be separated from "
                "the steps; fit with trend= instead"
            )
        level = np.zeros((sum(map(len, rows)), len(rows)))
        place = 0
        for i, part in enumerate(rows):
            level[place : place + len(part), i] = 1.0
            place += len(part)
        chosen = np.concatenate(rows)
        columns = [s**k for k in range(1, order + 1)]
        matrix = np.hstack([level, np.column_stack([c[chosen] for c in columns])])
        solution = np.linalg.lstsq(matrix, self.friction[chosen], rcond=None)[0][len(rows) :]
        trend = sum(c * x for c, x in zip(columns, solution, strict=True))
        note = (
            f"a polynomial of order {order} was taken out of friction; it changes by {trend[-1] - trend[0]:.3g} over it"
        )
        return replace(self, friction=frozen(self.friction - trend), shear=None, notes=(*self.notes, note))

    def windows(self, before: Any = None, after: Any = None) -> tuple[Record, ...]:
        """Parts of the record around each velocity step, hold with its reslide, or step of normal stress.

        Each part keeps the loading (rates, stresses, response of a servo) that was found in the whole record.

        Parameters
        ----------
        before, after : float or str, optional
            Time to keep on each side, s; by default halfway to the neighbouring changes.
        """
        steps = [s for s in self.steps if s.kind != "reslide"]
        if not steps:
            raise NotAvailable(f"{self.source}: no steps were found in this record")
        times = [s.time for s in steps]
        ends = [self.time[0], *times, self.time[-1]]
        found = []
        for i, moment in enumerate(times):
            low = 0.5 * (ends[i] + moment) if before is None and i else ends[0]
            high = ends[i + 2] if i + 2 == len(ends) - 1 else 0.5 * (moment + ends[i + 2])
            low = low if before is None else max(moment - seconds("before", before), self.time[0])
            high = high if after is None else min(moment + seconds("after", after), self.time[-1])
            found.append(replace(self.between(low, high), commanded=self.loading.within(low, high)))
        return tuple(found)

    def summary(self) -> str:
        """Summary as text: duration, ranges of the columns, steps found and notes."""
        span = self.time[-1] - self.time[0]
        spacing = np.diff(self.time)
        low, high = float(np.min(self.friction)), float(np.max(self.friction))
        lines = [
            f"{self.source}: {len(self)} samples over {format_quantity(float(span), 's')}, "
            f"one every {format_quantity(float(np.median(spacing)), 's')}",
            f"friction        {low:.4g} to {high:.4g}",
        ]
        if self.normal is not None:
            stress = self.normal
            lines.append(
                f"normal stress   {format_quantity(float(stress.min()), 'Pa')} to "
                f"{format_quantity(float(stress.max()), 'Pa')}"
            )
        if self.pore_pressure is not None:
            ends = (format_quantity(float(end(self.pore_pressure)), "Pa") for end in (np.min, np.max))
            lines.append(f"pore pressure   {' to '.join(ends)}")
        if self.displacement is not None:
            moved = float(self.displacement[-1] - self.displacement[0])
            lines.append(
                f"load point      {format_quantity(moved, 'm')}, at first "
                f"{format_quantity(self.initial_rate or 0.0, 'm/s')}"
            )
        lines += [f"step            {step}" for step in self.steps] or ["step            none found"]
        lines += [f"note            {note}" for note in self.notes]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()

    def plot(self, ax: Any = None) -> Any:
        """Plot friction, load-point velocity and normal stress over time, with the steps found.

        Returns
        -------
        array of matplotlib.axes.Axes
        """
        return draw(self, ax=ax)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the columns, with units in the header, to a CSV file that `read_record` can read.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        names = {"time": "Time (s)", "displacement": "Load displacement (m)", "velocity": "Load velocity (m/s)",
                 "friction": "Friction", "shear": "Shear stress (Pa)", "total_normal": "Normal stress (Pa)",
                 "pore_pressure": "Pore pressure (Pa)"}  # fmt: skip
        if self.integrated:
            del names["displacement"]
        present = {title: getattr(self, n) for n, title in names.items() if getattr(self, n) is not None}
        write_columns(path, present, "%.12g")


_OPTIONAL = ("normal", "shear", "displacement", "velocity", "pore_pressure")


def whole_record(
    source: str, notes: tuple[str, ...], integrated: bool, commanded: Loading | None = None, **columns: Array | None
) -> Record:
    """Record from columns that were saved from a cleaned record.

    Raises
    ------
    ParameterError
        If times do not rise, numbers are not finite, or samples are too few.
    """
    present = {name: frozen(values) for name, values in columns.items() if values is not None}
    time = present["time"]
    problems = [Problem(name, "is not finite throughout") for name, a in present.items() if not np.all(np.isfinite(a))]
    if len(time) < FEWEST_ROWS:
        problems.append(Problem("time", f"has {len(time)} samples; a record needs {FEWEST_ROWS} or more"))
    elif not np.all(np.diff(time) > 0):
        problems.append(Problem("time", "does not rise throughout"))
    for name in ("normal", "worth"):
        if name in present and not np.all(present[name] > 0):
            problems.append(Problem(name, "is not > 0 throughout"))
    if problems:
        raise ParameterError(problems, title=source)
    return Record(
        **{name: present.get(name) for name in ("time", "friction", *_OPTIONAL, "worth")},  # type: ignore[arg-type]
        source=source, notes=notes, integrated=integrated, commanded=commanded,
    )  # fmt: skip


def frozen(values: Any) -> Array:
    """Copy of `values` as a read-only float array."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def seconds(name: str, value: Any) -> float:
    """Time (s) from a number or text with a unit."""
    try:
        return Parameter("s", real, name).checked(value)
    except ParameterError as error:
        raise ParameterError([p.under(name) for p in error.problems]) from error


# -- decimation


@cached
def transient_rows(record: Record, count: int) -> Array:
    """Indices of about `count` rows: dense just after each change of the loading, then further and further apart."""
    cumulated = np.cumsum(_samples_wanted(record, count))
    last = len(record) - 1
    chosen = np.searchsorted(cumulated, np.arange(0.5, cumulated[-1], 1.0))
    return np.unique(np.concatenate([[0], np.minimum(chosen, last), [last]]))


def bin_starts(record: Record, count: int) -> Array:
    """Index of the first row of each of about `count` groups to be averaged; no group contains a change of loading."""
    cumulated = np.cumsum(_samples_wanted(record, count))
    fresh = np.flatnonzero(np.diff(np.floor(cumulated - 1e-9), prepend=-1.0))
    moments = [m for step in record.steps for m in (step.time, step.time + step.duration)]
    edges = np.searchsorted(record.time, moments)
    return np.unique(np.concatenate([[0], fresh, edges[edges < len(record)]]))


def binned(record: Record, starts: Array) -> Record:
    """Record whose samples are the means of groups of rows; `starts` holds the first row of each group."""
    counts = np.diff(starts, append=len(record))
    weights = np.ones(len(record)) if record.worth is None else record.worth
    total = np.add.reduceat(weights, starts)
    memory = lasting(record.friction)
    k = np.maximum(counts, 1.0)  # variance of the mean of k samples whose correlation is memory**lag
    variance = (1 + memory) / (1 - memory) / k - 2 * memory * (1 - memory**k) / ((1 - memory) * k) ** 2
    worth = total / counts / variance

    def mean(values: Array | None) -> Array | None:
        return None if values is None else frozen(np.add.reduceat(weights * values, starts) / total)

    columns = {name: mean(getattr(record, name)) for name in ("time", "friction", *_OPTIONAL)}
    note = f"{len(record)} samples became {len(counts)} means of up to {counts.max()} of them, dense after steps"
    notes = (*record.notes, note)
    return replace(record, **columns, worth=frozen(worth), commanded=record.loading, notes=notes)  # type: ignore[arg-type]


def _samples_wanted(record: Record, count: int) -> Array:
    """Number of samples (n,), 0 to 1, wanted per row; their sum is `count`, they fall as 1/(time since a change)."""
    time, n = record.time, len(record)
    usual = float(np.median(np.diff(time)))
    weight = np.full(n, 1.0 / (time[-1] - time[0]))  # samples wanted per second
    moments = [time[0], *(step.time for step in record.steps if step.kind != "normal-stress oscillation")]
    for i, moment in enumerate(moments):
        after = time >= moment - 2 * usual
        share = 0.3 if i == 0 and len(moments) > 1 else 1.0  # fewer samples for the sliding before the first change
        weight += (
            share * np.where(after, 1.0 / (np.maximum(time - moment, 0.0) + 5 * usual), 0.0) / 8.0
        )  # 8 is about ln(duration / 5 spacings): each change has the weight of the record
    share = weight * np.gradient(time)
    if count >= n:
        return np.ones(n)
    rising = np.sort(share)  # rows with the largest shares get one sample each, other rows in proportion
    rest = np.cumsum(rising)
    left = count - np.arange(n - 1, -1, -1)  # samples left for row k and smaller shares if each larger share gets one
    k = int(np.flatnonzero((left > 0) & (left * rising <= rest))[-1])
    return np.asarray(np.minimum(share * (left[k] / rest[k]), 1.0))
