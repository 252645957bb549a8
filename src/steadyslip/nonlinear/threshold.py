"""The smallest kick after which sliding does not become steady again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.errors import NotAvailable, ParameterError, Problem
from steadyslip.motion.many import broadcast_arrays, regimes
from steadyslip.nonlinear.kicks import INTERRUPTED, OUTCOMES, RETURNS, Kicked
from steadyslip.progress import progress_bar
from steadyslip.protocol import DisplacementStep, NormalStressStep, Protocol, VelocityStep
from steadyslip.quantities import shown
from steadyslip.slider import Slider
from steadyslip.steady import steady_states

Array = np.ndarray
COARSE = 240  # sizes of the first scan of a single rig
COARSE_MAP = 48  # and of each rig of a map
FINE = 47  # sizes between the ends of a bracket, at each step of narrowing


@dataclass(frozen=True)
class Threshold:
    """How large a kick steady sliding survives.

    Attributes
    ----------
    rig : Slider
    kick : str
    direction : int
    size : float
        Smallest kick that does not return, without unit: ln(new/old velocity), natural lengths, share of the steady
        normal stress, or change of velocity over the drive's. 0 if steady sliding is unstable, inf if no kick
        in the range searched is large enough.
    bracket : tuple of float
        Sizes of the largest kick known to return and of the smallest known not to.
    amount : float
        The same in SI units: velocity after the step (or before it, with ``reference="after"``), displacement,
        change of normal stress, or impulse.
    unit : str
    outcome : str
        What happens beyond: ``blow-up``, ``oscillation`` (that does not die out), ``contact lost``, ``no solution``.
    searched : float
        Largest size tried.
    """

    rig: Slider = field(repr=False)
    kick: str
    direction: int
    size: float
    bracket: tuple[float, float]
    amount: float
    unit: str
    outcome: str
    searched: float

    def __str__(self) -> str:
        what = f"{self.kick} kick"
        if self.size == 0:
            return f"{what}: none survived, steady sliding is unstable"
        if np.isinf(self.size):
            return f"{what}: none is large enough, up to {self.searched:.4g} (size without unit)"
        return (
            f"{what}: survives up to {shown(self.amount, self.unit, 7, self.rig.area)} (size {self.size:.7g}, bracket "
            f"{self.bracket[0]:.9g} to {self.bracket[1]:.9g}); beyond: {self.outcome}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units."""

        def plain(x: float) -> float | None:
            return float(x) if np.isfinite(x) else None

        return {
            "kick": self.kick,
            "direction": self.direction,
            "size": plain(self.size),
            "bracket": [plain(x) for x in self.bracket],
            "amount": plain(self.amount),
            "unit": self.unit,
            "outcome": self.outcome,
            "searched": self.searched,
        }


def threshold(
    rig: Slider,
    kick: str = "velocity",
    *,
    direction: int = 1,
    reference: str = "before",
    precision: float = 1e-8,
    rtol: float | None = None,
    branch: int = 0,
) -> Threshold:
    """The smallest kick of a given kind that does not return to steady sliding.

    Parameters
    ----------
    rig : Slider
    kick : str, optional
        ``velocity`` (step of the load-point velocity), ``displacement`` (step of the load point), ``normal-stress``
        (step of the normal stress) or ``impulse`` (blow on a block with mass).
    direction : int, optional
        1: faster, forward, pressed harder; -1: the reverse.
    reference : str, optional
        For ``velocity``: whether the rig's drive is the velocity ``before`` or ``after`` the step. After is right
        for comparing with results that take normal stress and critical stiffness at the new velocity.
    precision : float, optional
        Relative width of the bracket.
    rtol : float, optional
        Error allowed per step of integration; 1e-10, with mass 1e-8, unless given.
    branch : int, optional
        Which steady sliding, where there are several.

    Returns
    -------
    Threshold

    Raises
    ------
    NoSteadySliding
        If there is none to kick.
    NotAvailable
        If the kick is not possible, or the motion ill-posed.
    ParameterError
        If an argument is wrong.

    Notes
    -----
    Kicks of rising size are tried side by side, and the bracket of the first that fails is narrowed. A motion has
    returned when two velocity peaks in a row differ from the drive by less than a thousandth. At the edge of
    stability itself small motions persist; there all that stays bounded counts as returning.
    """
    if not 1e-12 <= precision <= 0.1:
        raise ParameterError([Problem("precision", f"got {precision!r}; allowed: from 1e-12 to 0.1")])
    steady_states(rig)  # raises, and says why
    kicked = Kicked(rig, kick, direction, reference, {}, branch, rtol)
    if not kicked.stable[0]:
        return _result(rig, kicked, 0.0, 0.0, "unstable")
    sizes = np.geomspace(kicked.kick.low, kicked.highest, COARSE)
    low, high, outcome = _first_failure(kicked, sizes, 0.0)
    if outcome == RETURNS:
        return _result(rig, kicked, float(sizes[-1]), np.inf, "")
    while high - low > precision * high:
        inside = low + (high - low) * np.arange(1, FINE + 1) / (FINE + 1)
        before = low, high
        low, high, found = _first_failure(kicked, np.append(inside, high), low)
        outcome = found if found != RETURNS else outcome
        if (low, high) == before:
            break
    return _result(rig, kicked, low, high, OUTCOMES[outcome])


def _first_failure(kicked: Kicked, sizes: Array, low: float) -> tuple[float, float, int]:
    """The first of rising sizes that does not return, the size before it, and what happens."""
    found = kicked.outcomes(np.zeros(len(sizes), dtype=int), sizes)
    if np.any(found == INTERRUPTED):
        raise KeyboardInterrupt
    failed = np.flatnonzero(found != RETURNS)
    if not len(failed):
        return float(sizes[-1]), float(sizes[-1]), RETURNS
    i = int(failed[0])
    return (float(sizes[i - 1]) if i else low), float(sizes[i]), int(found[i])


def _result(rig: Slider, kicked: Kicked, low: float, high: float, outcome: str) -> Threshold:
    middle = 0.5 * (low + high) if np.isfinite(high) else np.inf
    amount = float(kicked.amount(middle)[0]) if np.isfinite(middle) else np.inf
    return Threshold(rig, kicked.kick.name, int(kicked.sign), middle, (low, high), amount, kicked.kick.unit, outcome,
                     kicked.highest)  # fmt: skip


def threshold_map(
    rig: Slider,
    vary: Mapping[str, Any],
    kick: str = "velocity",
    *,
    direction: int = 1,
    reference: str = "before",
    precision: float = 1e-4,
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> Any:
    """Thresholds of many rigs, as a map over two parameters for instance.

    Parameters
    ----------
    rig, kick, direction, reference, precision, rtol, branch
        As for `threshold`.
    vary : mapping of str to array_like or xarray.DataArray
        Parameters by dotted name, SI units; arrays broadcast, DataArrays by dimension name.
    threads : int, optional
        All cores unless given.
    progress : bool, optional
        Whether to show a progress bar; on a terminal unless given.

    Returns
    -------
    ndarray or xarray.DataArray
        Sizes without unit, as in `Threshold`: 0 where steady sliding is unstable, inf where no kick in the
        range fails, NaN where there is no steady sliding. After Ctrl-C, NaN too where nothing is known yet, and the
        middle of the bracket reached where something is.
    """
    flat, _, shape, dims, coords = broadcast_arrays(rig, Protocol(), vary, {})
    size = int(np.prod(shape, dtype=int))
    found = np.full(size, np.nan)
    rounds = COARSE_MAP + int(np.ceil(np.log2(0.35 / precision)))
    with progress_bar(size * rounds, progress) as advanced:
        for group_rig, chosen, index in regimes(rig, flat, size):
            count = size if index is None else len(index)
            part = {name: np.broadcast_to(np.asarray(a, dtype=float), (size,)) for name, a in chosen.items()}
            part = {name: a if index is None else a[index] for name, a in part.items()}
            kicked = Kicked(group_rig, kick, direction, reference, part, branch, rtol)
            where = slice(None) if index is None else index
            found[where] = _mapped(kicked, count, precision, threads, advanced)
    values = found.reshape(shape)
    if not dims:
        return values if values.ndim else float(values)
    import xarray as xr

    return xr.DataArray(values, dims=dims, coords=coords, name=f"{kick}_threshold", attrs={"units": "1"})


def _mapped(kicked: Kicked, count: int, precision: float, threads: int | None, advanced: Any) -> Array:
    """Thresholds of all rigs of one kind: first a scan of sizes, then bisection of all brackets together."""
    result = np.where(kicked.exists, np.where(kicked.stable, np.inf, 0.0), np.nan)
    result = np.broadcast_to(result, (count,)).copy()
    alive = np.flatnonzero(np.broadcast_to(kicked.stable, (count,)))
    if not len(alive):
        return result
    sizes = np.geomspace(max(kicked.kick.low, kicked.highest * 1e-4), kicked.highest, COARSE_MAP)
    low, high = np.zeros(count), np.full(count, np.inf)
    searching = alive
    for size in sizes:  # rising sizes, for the rigs that have survived all smaller ones
        found = kicked.outcomes(searching, np.full(len(searching), size), threads, advanced)
        if np.any(found == INTERRUPTED):
            result[alive] = np.where(np.isfinite(high[alive]), 0.5 * (low[alive] + high[alive]), np.nan)
            return result
        failed = found != RETURNS
        high[searching[failed]] = size
        searching = searching[~failed]
        low[searching] = size
        if not len(searching):
            break
    open_ = np.flatnonzero(np.isfinite(high))
    while len(open_):
        middle = 0.5 * (low[open_] + high[open_])
        found = kicked.outcomes(open_, middle, threads, advanced)
        known = found != INTERRUPTED
        low[open_[known & (found == RETURNS)]] = middle[known & (found == RETURNS)]
        high[open_[known & (found != RETURNS)]] = middle[known & (found != RETURNS)]
        if not np.all(known):
            break
        open_ = open_[high[open_] - low[open_] > precision * high[open_]]
    bounded = np.isfinite(high)
    result[bounded] = 0.5 * (low[bounded] + high[bounded])
    return result


@dataclass(frozen=True)
class KickMargin:
    """How far an expected disturbance is from the limit.

    Attributes
    ----------
    step : object
        The protocol piece.
    threshold : Threshold
    ratio : float
        Threshold over the step's own size: above 1 it is survived.
    survives : bool
    """

    step: Any
    threshold: Threshold
    ratio: float
    survives: bool

    def __str__(self) -> str:
        word = "survives" if self.survives else "does not survive"
        return f"{word} it: the limit is {self.ratio:.4g} times this step\n{self.threshold}"


def margin_to_kick(rig: Slider, step: Any, *, precision: float = 1e-6, branch: int = 0) -> KickMargin:
    """Distance of an expected disturbance from the smallest that is not survived.

    Parameters
    ----------
    rig : Slider
    step : VelocityStep, DisplacementStep or NormalStressStep
        Its time does not matter.
    precision, branch
        As for `threshold`.

    Raises
    ------
    NotAvailable
        If the step is of another kind.
    """
    kinds: dict[type, tuple[str, str]] = {
        VelocityStep: ("velocity", "to"),
        DisplacementStep: ("displacement", "by"),
        NormalStressStep: ("normal-stress", "by"),
    }
    if type(step) not in kinds:
        names = ", ".join(kind.__name__ for kind in kinds)
        raise NotAvailable(f"a margin is known for {names}, not for {step!r}; simulate it instead")
    kick, attribute = kinds[type(step)]
    amount = float(getattr(step, attribute))
    if kick == "velocity" and not amount > 0:
        raise NotAvailable("a stop or reversal of the drive is no step from one steady sliding to another; simulate it")
    up = amount >= (rig.drive.velocity if kick == "velocity" else 0)
    found = threshold(rig, kick, direction=1 if up else -1, precision=precision, branch=branch)
    size = Kicked(rig, kick, found.direction, "before", {}, branch, 1e-10).size_of(amount)
    ratio = found.size / size if size else np.inf
    return KickMargin(step, found, float(ratio), bool(ratio > 1))
