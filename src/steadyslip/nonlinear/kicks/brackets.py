"""Thresholds of many rigs at once: all their brackets are narrowed together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.options import BRANCH, NAME, SIGN, THREADS, checked, finite
from steadyslip.core.progress import progress_bar
from steadyslip.core.version import version
from steadyslip.machine.letters import label_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.many import broadcast_arrays, regimes
from steadyslip.nonlinear.kicks.kicks import Kicked, kicks_of
from steadyslip.nonlinear.kicks.spans import (
    BLOW_UP,
    CERTAIN,
    CONTACT_LOST,
    DOUBTS,
    INTERRUPTED,
    OUTCOMES,
    RETURNS,
    UNDECIDED,
)
from steadyslip.nonlinear.kicks.threshold import edges
from steadyslip.protocol import Protocol

COARSE = 48  # number of kick sizes in the first scan of each rig
WIDE = 0.1  # if an undecided bracket is wider (relative), the threshold is NaN and not the middle of the bracket
BEYOND = (*OUTCOMES[:UNDECIDED], *(f"undecided: {doubt}" for doubt in DOUBTS), "edge", "unstable", "no steady sliding",
          "out of range")  # fmt: skip
"""What limits the kicks of a rig: outcome of the smallest kick that fails (`RETURNS` if none fails), or a reason.
"""
EDGE, UNSTABLE, ABSENT, BEYOND_FLOATS = range(len(BEYOND) - 4, len(BEYOND))


@dataclass(frozen=True, eq=False)
class Brackets:
    """Thresholds of many rigs, with their brackets and limiting outcomes, as arrays of equal shape.

    Attributes
    ----------
    size : ndarray
        Thresholds, as returned by `threshold_map`.
    low, high : ndarray
        Largest size up to which all simulated kicks return, and smallest size known not to return.
    beyond : ndarray of int
        Limit, an index into `BEYOND`.
    contact : ndarray of str
        For machines: the contact that is lost after a larger kick, or fastest in a blow-up; else empty.
    """

    size: Array
    low: Array
    high: Array
    beyond: Array
    contact: Array


@checked(
    precision=finite(1e-13, 0.1),
    threads=THREADS,
    branch=BRANCH,
    kick=NAME,
    reference=NAME,
    direction=SIGN,
    up_to=finite(0),
)
def threshold_map(
    rig: Slider | Machine,
    vary: Mapping[str, Any],
    kick: str = "velocity",
    *,
    at: str | None = None,
    direction: int = 1,
    reference: str = "before",
    up_to: float | None = None,
    precision: float = 1e-4,
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> Any:
    """Smallest kicks that do not return to steady sliding, for many rigs, such as a grid of two parameters.

    Parameters
    ----------
    rig, kick, at, direction, reference, up_to, precision, rtol, branch
        As for `threshold`.
    vary : mapping of str to array_like or xarray.DataArray
        Arrays of values (SI units) by dotted name of the parameter; broadcast, DataArrays by dimension name.
    threads : int, optional
        Number of threads; by default that of all cores.
    progress : bool, optional
        True to show a progress bar; by default on a terminal only.

    Returns
    -------
    ndarray or xarray.DataArray
        Dimensionless sizes, as `Threshold.size`: 0 where steady sliding is unstable, inf where no kick in the range
        fails, NaN where there is no steady sliding, and where kicks over more than a tenth of the size are undecided
        (see `threshold` for a single rig). After Ctrl-C, NaN too where no kick is known to fail, else the middle of the
        bracket reached. A DataArray has a coordinate ``limit``: the outcome of larger kicks, or ``edge``, ``unstable``,
        ``no steady sliding``, ``out of range`` (of floating point) or ``undecided`` with the reason; ``returns`` where
        none fails. For machines a coordinate ``contact``: the contact that is lost, or the fastest in a blow-up.
        Dimensions have ``units`` and ``long_name`` of the parameter that varies along them.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> ss.threshold_map(rig, {"stiffness": [20e9, 40e9]}).round(3)
    array([0.   , 2.038])
    """
    found, dims, coords = threshold_brackets(
        rig, vary, kick, at=at, direction=direction, reference=reference, up_to=up_to, precision=precision, rtol=rtol,
        threads=threads, progress=progress, branch=branch,
    )  # fmt: skip
    if not dims:
        return found.size if found.size.ndim else float(found.size)
    import xarray as xr

    about = {"units": "1", "long_name": f"{kick} kick that is survived, {kicks_of(rig)[kick].size}"}
    about["steadyslip"] = version()
    beside = {"limit": (dims, np.array(BEYOND)[found.beyond])}
    if rig.contact_names:
        beside["contact"] = (dims, found.contact)
    array = xr.DataArray(found.size, dims=dims, coords={**coords, **beside}, name=f"{kick}_threshold", attrs=about)
    return array.assign_coords({dim: array[dim].assign_attrs(own) for dim, own in _axes(array, rig, vary).items()})


def _axes(array: Any, rig: Slider | Machine, vary: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Attributes ``units`` and ``long_name`` of the dimensions along which a parameter varies, by dimension.

    Attributes that the DataArrays have already are kept.
    """
    found = {}
    for given, values in vary.items():
        for dim in getattr(values, "dims", ()):
            if dim in array.coords and np.array_equal(values, array[dim]):
                name = rig.resolve(given)
                own = {"units": rig.parameters()[name].role.unit, "long_name": label_of(rig, name)}
                found[dim] = own | dict(array[dim].attrs)
    return found


def threshold_brackets(
    rig: Slider | Machine,
    vary: Mapping[str, Any],
    kick: str = "velocity",
    *,
    at: str | None = None,
    direction: int = 1,
    reference: str = "before",
    up_to: float | None = None,
    precision: float = 1e-4,
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> tuple[Brackets, Any, Any]:
    """Brackets of `threshold_map` as plain arrays, and names of dimensions and coordinates if DataArrays are varied."""
    flat, _, together = broadcast_arrays(rig, Protocol(), vary, {})
    shape = together.shape
    size = int(np.prod(shape, dtype=int))
    columns = [*(np.full(size, np.nan) for _ in range(3)), np.full(size, INTERRUPTED), np.full(size, "", dtype=object)]
    rounds = COARSE + int(np.ceil(np.log2(0.35 / precision)))
    with progress_bar(size * rounds, progress) as advanced:
        for group_rig, chosen, index in regimes(rig, flat, size):
            part = {name: np.broadcast_to(np.asarray(a, dtype=float), (size,)) for name, a in chosen.items()}
            part = {name: a if index is None else a[index] for name, a in part.items()}
            kicked = Kicked(group_rig, kick, direction, reference, part, branch, rtol, at, up_to)
            where = slice(None) if index is None else index
            search = _Search(kicked, size if index is None else len(index), threads, advanced)
            search.run(precision)
            for column, own in zip(columns, search.result(), strict=True):
                column[where] = own
    return Brackets(*(column.reshape(shape) for column in columns)), together.dims or (), together.coords


class _Search:
    """Brackets of all rigs for one kind of kick: a scan of sizes, then bisection."""

    def __init__(self, kicked: Kicked, count: int, threads: int | None, advanced: Any) -> None:
        self.kicked, self.threads, self.advanced = kicked, threads, advanced
        self.stable, self.exists = (np.broadcast_to(a, (count,)) for a in (kicked.stable, kicked.exists))
        self.rig = np.arange(count) if kicked.size > 1 else np.zeros(count, dtype=int)
        self.low, self.high = np.zeros(count), np.full(count, np.inf)
        self.doubt = np.full((count, 2), np.nan)  # smallest and largest undecided size inside the bracket
        self.why = np.full(count, UNDECIDED)  # undecided outcome, index into `OUTCOMES`
        absent = np.where(np.broadcast_to(kicked.jobs.in_range, (count,)), ABSENT, BEYOND_FLOATS)
        self.beyond = np.where(self.exists, np.where(self.stable, INTERRUPTED, UNSTABLE), absent)
        self.whole = True

    def run(self, precision: float) -> None:
        """Narrow all brackets to a relative precision, or until Ctrl-C."""
        kicked, alive = self.kicked, np.flatnonzero(self.stable)
        sizes = np.geomspace(max(kicked.kick.low, kicked.highest * 1e-4), kicked.highest, COARSE)
        edge = np.full(len(self.low), np.inf)
        edge[alive] = edges(kicked, self.rig[alive], sizes)
        going = alive
        for size in sizes:  # rising sizes, each for the rigs in which no smaller kick has failed
            over = size >= edge[going]
            self.high[going[over]], self.beyond[going[over]] = edge[going[over]], EDGE
            going = going[~over]
            going = going[self._tried(going, np.full(len(going), size))]
            if not len(going) or not self.whole:
                break
        if self.whole:
            self.beyond[going] = np.where(np.isnan(self.doubt[going, 0]), RETURNS, self.why[going])
        while self.whole:
            point, wide = self._next(precision)
            if not len(wide):
                break
            self._tried(wide, point)

    def _next(self, precision: float) -> tuple[Array, Array]:
        """Indices of the rigs whose brackets are too wide, and the next sizes to simulate for them.

        A size is the middle of the bracket, or a value near undecided sizes.
        """
        low, high, (left, right) = self.low, self.high, self.doubt.T
        with np.errstate(invalid="ignore"):
            clear = np.isnan(left)
            enough = np.maximum(precision * high, np.where(clear, 0.0, 0.1 * (right - left)))
            below = np.where(clear, high - low, left - low)
            above = np.where(clear, 0.0, high - right)
            wide = np.flatnonzero(np.isfinite(high) & (np.maximum(below, above) > enough))
            beside = np.where(below >= above, 0.5 * (low + left), 0.5 * (right + high))
            point = np.where(clear, 0.5 * (low + high), beside)
        return point[wide], wide

    def _tried(self, which: Array, sizes: Array) -> Array:
        """Simulate a kick of each rig `which` (k,) and update its bracket; True (k,) where the kick does not fail."""
        if not len(which):
            return np.zeros(0, dtype=bool)
        found = self.kicked.outcomes(self.rig[which], sizes, self.threads, self.advanced, effort=1.0)
        self.whole = self.whole and not np.any(found == INTERRUPTED)
        failed, back, doubtful = np.isin(found, CERTAIN), found == RETURNS, found >= UNDECIDED
        rig, size = which[failed], sizes[failed]
        self.high[rig], self.beyond[rig] = size, found[failed]
        self.doubt[rig[self.doubt[rig, 0] >= size]] = np.nan
        self.doubt[rig, 1] = np.minimum(self.doubt[rig, 1], size)
        rig, size = which[doubtful], sizes[doubtful]
        self.why[rig] = found[doubtful]
        self.doubt[rig, 0] = np.fmin(self.doubt[rig, 0], size)
        self.doubt[rig, 1] = np.fmax(self.doubt[rig, 1], size)
        rig, size = which[back], sizes[back]
        beyond_doubt = self.doubt[rig, 0] < size
        self.doubt[rig[beyond_doubt], 1] = np.fmax(self.doubt[rig[beyond_doubt], 1], size[beyond_doubt])
        self.low[rig[~beyond_doubt]] = size[~beyond_doubt]
        return np.asarray(~failed & (found != INTERRUPTED))

    def result(self) -> tuple[Array, Array, Array, Array, Array]:
        """Threshold, ends of the bracket, limit (index into `BEYOND`) and contact of every rig, arrays (rigs,)."""
        with np.errstate(invalid="ignore"):
            middle = np.where(self.beyond == EDGE, self.high, 0.5 * (self.low + self.high))
            known = np.isfinite(self.high) & (~self.whole | (self.high - self.low <= WIDE * self.high))
        size = np.where(known, middle, np.nan)
        beyond = np.where(np.isfinite(self.high) & ~known & self.whole, self.why, self.beyond)
        size = np.where(self.beyond == RETURNS, np.inf, size)
        size = np.where(self.beyond == UNSTABLE, 0.0, size)
        low, high = (np.where(self.beyond >= ABSENT, np.nan, a) for a in (self.low, self.high))
        high = np.where(self.beyond == UNSTABLE, 0.0, high)
        low = np.where(self.beyond == INTERRUPTED, np.where(low > 0, low, np.nan), low)
        contact = np.full(len(size), "", dtype=object)
        ends = np.flatnonzero(np.isin(beyond, (CONTACT_LOST, BLOW_UP)) & self.whole)
        if len(ends):
            contact[ends] = self.kicked.contacts(self.rig[ends], self.high[ends], self.threads)
        return size, low, high, beyond, contact
