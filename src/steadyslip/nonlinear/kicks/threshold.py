"""Find the smallest kick after which sliding does not become steady again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.areas import total
from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import BRANCH, NAME, SIGN, checked, finite
from steadyslip.core.pages import Displayed
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.range import out_of_range_error
from steadyslip.model.sliding import steady_states
from steadyslip.nonlinear.kicks.kicks import PATIENCE, Kicked, kicks_of
from steadyslip.nonlinear.kicks.spans import (
    BLOW_UP,
    CERTAIN,
    CONTACT_LOST,
    EXHAUSTED,
    INTERRUPTED,
    LATE,
    OUTCOMES,
    RETURNS,
    SPENT,
    UNDECIDED,
    doubt_of,
)
from steadyslip.protocol import DisplacementStep, DisturbanceStep, NormalStressStep, VelocityStep

COARSE = 192  # number of kick sizes in the first scan
BLOCK = 48  # number of sizes simulated side by side
FINE = 47  # number of sizes between the ends of a bracket in each round of narrowing
AT_EDGE = 1e-5  # least relative width of a bracket at an edge of stability, near which motions return very slowly
LASTING = (
    "velocity",
    "normal-stress",
    "normal-force",
    "force",
)  # kicks that change an input for good, except blows
USED_UP = tuple(map(doubt_of, (LATE, EXHAUSTED, SPENT)))  # doubts about motions cut short
TOGETHER = 256  # number of steady slidings after kicks that are solved for together
BITS = 60  # number of halvings that narrow a bracket to rounding
BEYOND = 1.01  # the outcome beyond an edge is simulated at this multiple of the edge's size


@dataclass(frozen=True)
class Threshold(Displayed):
    """Largest kick of one kind that steady sliding survives, with its bracket and the outcome beyond.

    Attributes
    ----------
    rig : Slider or Machine
    kick : str
    direction : int
    size : float
        Smallest kick that does not return, dimensionless: ln(new/old velocity), natural lengths, share of the steady
        normal stress, or change of velocity over the drive's. 0 if steady sliding is unstable, inf if every kick up to
        `searched` returns, NaN if some kicks are undecided and none is known to fail.
    bracket : tuple of float
        Largest size up to which all simulated kicks return, and smallest size known not to return.
    amount : float
        `size` in SI units: velocity after the step (or before it, with ``reference="after"``), displacement,
        change of normal stress, or impulse.
    unit : str
    outcome : str
        Outcome of kicks just beyond: ``blow-up``, ``oscillation`` (that does not die out), ``contact lost``, ``no
        solution``, or ``undecided``.
    searched : float
        Largest size of the search.
    edge : bool
        True if `size` is the edge of stability of the steady sliding after the kick: beyond it, there is no stable
        steady sliding to return to.
    decided : bool
        True if the bracket is as narrow as `precision`. If not, kicks inside it were simulated for the longest time
        allowed without a certain outcome.
    interrupted : bool
        True if Ctrl-C ended the search; the bracket is as narrow as reached by then.
    doubt : str
        Reason for which kicks inside the bracket, or beyond it, are undecided; empty if there are no such kicks.
    survived : float
        Lower end of the bracket in SI units, as `amount`: all smaller kicks that were simulated return.
    at : str
        For a machine: the body or contact that is kicked; empty for its drive.
    contact : str
        For a machine: the contact that is lost after a slightly larger kick, or the fastest in a blow-up; else empty.
    """

    rig: Slider | Machine = field(repr=False)
    kick: str
    direction: int
    size: float
    bracket: tuple[float, float]
    amount: float
    unit: str
    outcome: str
    searched: float
    edge: bool = False
    decided: bool = True
    interrupted: bool = False
    doubt: str = ""
    survived: float = np.nan
    at: str = ""
    contact: str = ""

    @property
    def area(self) -> float | None:
        """Area (m²) that converts a stress amount to a force for display; None for a rig without area."""
        return self.rig.area

    def __str__(self) -> str:
        return self._found() + self._way_out()

    def _way_out(self) -> str:
        """Clause on how to decide more kicks, if time or steps were used up; empty otherwise."""
        if self.decided or self.interrupted or self.doubt not in USED_UP:
            return ""
        modes = ", fewer modes (kept_modes)" if self.rig.mechanism().structures else ""
        return (
            f"; fewer steps suffice for smaller kicks (up_to), larger errors per step (rtol=1e-6), more damping{modes}"
        )

    def _found(self) -> str:
        """Text on the bracket, and on the outcome beyond it or why that is not known."""
        lasts = " that lasts" if self.kick in LASTING and not (self.at and self.kick == "velocity") else ""
        what = f"{self.kick} kick{lasts}{f' at {self.at}' if self.at else ''}"
        low, _ = self.bracket
        if self.size == 0:
            return f"{what}: none survived, steady sliding is unstable"
        if self.interrupted and low == 0 and np.isnan(self.size):
            return f"{what}: stopped before anything was found"
        survived = format_quantity(self.survived, self.unit, 4 if not np.isfinite(self.size) else 7, self.area)
        if np.isinf(self.size):
            return f"{what}: survives all up to {survived}, the largest tried"
        why = "stopped there" if self.interrupted else f"not decided: {self.doubt}"
        if np.isnan(self.size):
            return f"{what}: {f'survives up to {survived}; beyond ' if low else ''}{why}"
        amount = format_quantity(self.amount, self.unit, 7, self.area)
        edge = ", the edge of stability of the steady sliding that it leads to" if self.edge else ""
        where = f" at {self.contact}" if self.contact else ""
        after = self.outcome + where if self.outcome != "undecided" else f"not decided ({self.doubt})"
        if self.decided:
            return f"{what}: survives up to {amount}{edge}; beyond: {after}"
        return f"{what}: survives up to {survived}; from there to {amount}{edge}, {why}; beyond: {after}"

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units."""

        def plain(x: float) -> float | None:
            return float(x) if np.isfinite(x) else None

        return {
            "kick": self.kick,
            **({"at": self.at} if self.at else {}),
            "direction": self.direction,
            "size": plain(self.size),
            "bracket": [plain(x) for x in self.bracket],
            "amount": plain(self.amount),
            "survived": plain(self.survived),
            "unit": self.unit,
            "outcome": self.outcome,
            **({"contact": self.contact} if self.contact else {}),
            "searched": self.searched,
            "edge": self.edge,
            "decided": self.decided,
            "doubt": self.doubt,
            "interrupted": self.interrupted,
        } | total(plain(self.amount), self.unit, self.area)


@checked(
    precision=finite(0, 0.1),
    branch=BRANCH,
    kick=NAME,
    reference=NAME,
    direction=SIGN,
    up_to=finite(0),
)
def threshold(
    rig: Slider | Machine,
    kick: str = "velocity",
    *,
    at: str | None = None,
    direction: int = 1,
    reference: str = "before",
    up_to: float | None = None,
    precision: float = 1e-8,
    rtol: float | None = None,
    branch: int = 0,
    progress: Callable[[int, float, float], None] | None = None,
) -> Threshold:
    """Smallest kick of one kind after which the motion does not return to steady sliding.

    Parameters
    ----------
    rig : Slider or Machine
    kick : str, optional
        ``velocity`` (step of the load-point velocity), ``displacement`` (step of the load point), ``normal-stress``
        (step of the normal stress) or ``impulse`` (blow on a block with mass). Of machines: ``velocity`` and
        ``displacement`` of the drive, or with `at` of a body; ``force`` (a step) and ``impulse`` on a body;
        ``normal-force`` (a step) at a contact.
    at : str, optional
        For machines: the body or contact that is kicked.
    direction : int, optional
        1: faster, forward, pressed harder; -1: the reverse.
    reference : str, optional
        For ``velocity``: the rig's drive velocity is that ``before`` or ``after`` the step. Use ``after`` to compare
        with results that take normal stress and critical stiffness at the new velocity.
    up_to : float, optional
        Largest size that is searched, dimensionless like `Threshold.size`. By default 1e4 times the velocity (of the
        drive, or of the body that gets the blow), 1e5 natural lengths, or 10 times the normal force or stress.
    precision : float, optional
        Relative width of the bracket; never below 1e-5 at an edge of stability of the steady sliding after the kick,
        near which motions return very slowly.
    rtol : float, optional
        Relative error allowed per integration step; by default 1e-10, with mass or bristles 1e-8.
    branch : int, optional
        Index of the steady sliding, by rising normal stress, where a rig has several.
    progress : callable, optional
        Called with the number of kicks decided so far and the ends of the bracket reached. Ctrl-C, or a
        KeyboardInterrupt that it raises, returns the bracket reached.

    Returns
    -------
    Threshold

    Raises
    ------
    NoSteadySliding
        If the rig has no steady sliding.
    NotAvailable
        If the kick is not possible, the motion ill-posed, or numbers leave the range of floating point.
    ParameterError
        If an argument is wrong.

    Notes
    -----
    Kicks of rising size are simulated side by side, and the bracket of the first that fails is narrowed. The outcome of
    a motion is decided by `steadyslip.nonlinear.kicks.outcomes`: it returns if it enters a neighbourhood of steady
    sliding that no motion leaves; it does not if it blows up, loses contact or is on a closed orbit that attracts; else
    it is undecided. Where the steady sliding after a kick is not stable nothing returns, and the search ends. If it is
    neutrally stable, small motions persist, and every bounded motion counts as returning. All motions together take at
    most a billion integration steps, fewer for machines with more variables, about a minute on two cores, and some 10
    CPU s for machines with structures; motions without an outcome by then are undecided.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> print(ss.threshold(rig))
    velocity kick that lasts: survives up to 7.67288... um/s; beyond: blow-up
    """
    if not 1e-12 <= precision <= 0.1:
        raise ParameterError([Problem("precision", f"got {precision!r}; allowed: from 1e-12 to 0.1")])
    steady_states(rig)  # raises NoSteadySliding with the reason
    kicked = Kicked(rig, kick, direction, reference, {}, branch, rtol, at, up_to)
    if not kicked.exists[0]:
        raise out_of_range_error(kicked.jobs.point)
    if not kicked.stable[0]:
        nothing = float(kicked.amount(0.0)[0])
        return Threshold(rig, kick, direction, 0.0, (0.0, 0.0), nothing, kicked.unit_name, "unstable", kicked.highest,
                         survived=nothing, at=kicked.at)  # fmt: skip
    search = _Search(kicked, progress)
    try:
        search.run(precision)
    except KeyboardInterrupt:
        search.interrupted = True
    return search.result(rig, precision)


class _Search:
    """Search for the bracket of one threshold: a scan of rising sizes, then rounds of narrowing.

    Attributes
    ----------
    low, high : float
        Largest size up to which all kicks return, and smallest known not to (inf if none).
    outcome : int
        Index into `OUTCOMES` of the kick `high`; if no kick fails, of the smallest undecided kick, or `RETURNS`.
    doubt : int
        Index into `OUTCOMES` of the smallest undecided kick inside the bracket; `RETURNS` if there is none.
    """

    def __init__(self, kicked: Kicked, progress: Callable[[int, float, float], None] | None) -> None:
        self.kicked, self.progress = kicked, progress
        kicked.limit_steps()
        self.low, self.high, self.edge = 0.0, np.inf, np.inf
        self.outcome = self.doubt = RETURNS
        self.tried, self.interrupted = 0, False

    def run(self, precision: float) -> None:
        """Scan all sizes, then narrow the bracket to a relative precision."""
        sizes = np.geomspace(self.kicked.kick.low, self.kicked.highest, COARSE)
        self.edge = self.high = float(edges(self.kicked, np.zeros(1, dtype=int), sizes)[0])
        self._scan(sizes[sizes < self.edge])
        least = precision * self.kicked.kick.low  # sufficient width if even the smallest kicks fail
        while np.isfinite(self.high) and self.high - self.low > max(self._enough(precision), least):
            width = self.high - self.low
            self._narrow(self.low + width * np.arange(1, FINE + 1) / (FINE + 1), PATIENCE)
            if self.high - self.low > 0.5 * width:
                break
        beyond = min(BEYOND * self.high, self.kicked.highest)
        if self.at_edge and beyond > self.high:
            found = int(self._outcomes(np.array([beyond]), PATIENCE)[0])
            if found == INTERRUPTED:
                raise KeyboardInterrupt
            self.outcome = LATE if found == RETURNS else found  # neutrally stable sliding at the edge survives no kick

    def _enough(self, precision: float) -> float:
        """Width of the bracket, dimensionless, at which narrowing ends."""
        return self.high * (max(precision, AT_EDGE) if self.at_edge else precision)

    @property
    def at_edge(self) -> bool:
        """True if the bracket ends where the steady sliding after kicks loses its stability."""
        return bool(np.isfinite(self.high) and self.high == self.edge)

    def _scan(self, sizes: Array) -> None:
        """Simulate kicks of rising sizes up to the first failure, or one block beyond the first undecided kick."""
        for start in range(0, len(sizes), BLOCK):
            block, low = sizes[start : start + BLOCK], self.low
            doubt = self.outcome >= UNDECIDED
            self._narrow(block[:: 2 if doubt else 1], 1.0)
            if doubt:
                self.low = low
            if doubt or self.outcome in CERTAIN:
                break

    def _narrow(self, sizes: Array, effort: float) -> None:
        """Simulate kicks of rising sizes inside the bracket, and narrow the bracket."""
        if not len(sizes):
            return
        found = self._outcomes(sizes, effort)
        others = np.flatnonzero(found != RETURNS)
        survived = int(others[0]) if len(others) else len(sizes)
        failed = np.flatnonzero(np.isin(found, CERTAIN))
        if len(failed):
            self.high, self.outcome = float(sizes[failed[0]]), int(found[failed[0]])
        doubtful = np.flatnonzero((found >= UNDECIDED) & (sizes < self.high))
        self.doubt = int(found[doubtful[0]]) if len(doubtful) else RETURNS
        if len(doubtful) and self.outcome == RETURNS:
            self.outcome = self.doubt
        if survived:
            self.low = float(sizes[survived - 1])
        if np.any(found == INTERRUPTED):
            raise KeyboardInterrupt

    def _outcomes(self, sizes: Array, effort: float) -> Array:
        """Outcomes of kicks of some sizes, as indices into `OUTCOMES`; reports progress."""

        def advanced(count: int) -> None:
            self.tried += count
            if self.progress is not None:
                self.progress(self.tried, self.low, self.high)

        return self.kicked.outcomes(np.zeros(len(sizes), dtype=int), sizes, None, advanced, effort)

    def result(self, rig: Slider | Machine, precision: float) -> Threshold:
        """The `Threshold` with the present bracket."""
        kicked, low, high = self.kicked, self.low, self.high
        decided = bool(high - low <= self._enough(precision)) if np.isfinite(high) else self.outcome == RETURNS
        size = high if self.at_edge else 0.5 * (low + high)
        if np.isinf(high):
            size = np.inf if self.outcome == RETURNS and not self.interrupted else np.nan
        amount, survived = (float(kicked.amount(s)[0]) if np.isfinite(s) else s for s in (size, low))
        doubt = doubt_of(self.doubt) or doubt_of(self.outcome)
        word = "" if self.outcome == RETURNS else OUTCOMES[self.outcome]
        contact = ""
        if self.outcome in (CONTACT_LOST, BLOW_UP) and np.isfinite(high):
            contact = str(kicked.contacts(np.zeros(1, dtype=int), np.array([high]))[0])
        return Threshold(
            rig, kicked.kick.name, int(kicked.sign), size, (low, high), amount, kicked.unit_name, word, kicked.highest,
            self.at_edge, decided and not self.interrupted, self.interrupted, doubt, survived, kicked.at, contact,
        )  # fmt: skip


def edges(kicked: Kicked, which: Array, sizes: Array) -> Array:
    """Smallest size beyond which no stable steady sliding exists after the kick, (n,); inf if none is found.

    The first of the rising `sizes` without stable steady sliding is found, then the bracket is narrowed to rounding.
    """
    low, high = np.zeros(len(which)), np.full(len(which), np.inf)
    going, start = np.arange(len(which) if kicked.moves_rest else 0), 0
    while len(going) and start < len(sizes):
        block = sizes[start : start + max(1, TOGETHER // len(going))]
        start += len(block)
        tried = np.tile(block, (len(going), 1))
        good = kicked.may_return(np.repeat(which[going], len(block)), tried.ravel()).reshape(tried.shape)
        _bracket(low, high, going, tried, good)
        going = going[np.isinf(high[going])]
    open_ = np.flatnonzero(np.isfinite(high))
    each = max(1, min(FINE, TOGETHER // max(len(open_), 1)))
    for _ in range(int(np.ceil(BITS / np.log2(each + 1))) if len(open_) else 0):
        tried = low[open_, None] + (high - low)[open_, None] * np.arange(1, each + 1) / (each + 1)
        rest = kicked.rest_after(np.repeat(which[open_], each), tried.ravel())
        _bracket(low, high, open_, tried, (rest.leading.real < 0).reshape(tried.shape))
    return high


def _bracket(low: Array, high: Array, which: Array, sizes: Array, good: Array) -> None:
    """Narrow the brackets `low`, `high` of rigs `which` (k,) around the first of rising `sizes` that is not `good`.

    `sizes` and `good` have shape (k, s).
    """
    first = np.where(good.all(axis=1), sizes.shape[1], np.argmin(good, axis=1))
    ends = np.column_stack([low[which], sizes, high[which]])
    low[which], high[which] = (np.take_along_axis(ends, first[:, None] + i, axis=1)[:, 0] for i in (0, 1))


@dataclass(frozen=True)
class KickMargin(Displayed):
    """Distance of an expected disturbance from the smallest kick that is not survived.

    Attributes
    ----------
    step : object
        The protocol piece.
    threshold : Threshold
    ratio : float
        Size of the threshold over that of the step; for velocities sizes are ln(v/v₀). NaN without a threshold.
    outcome : str
        Outcome of the step itself: ``returns``, ``blow-up``, ``oscillation``, ``contact lost``, ``no solution`` or
        ``undecided``. Steps beyond the threshold may return too.
    doubt : str
        Reason for which the outcome is undecided; else empty.
    """

    step: Any
    threshold: Threshold
    ratio: float
    outcome: str
    doubt: str = ""

    @property
    def survives(self) -> bool | None:
        """True if the motion returns to steady sliding after the step; None if undecided."""
        return None if self.outcome == "undecided" else self.outcome == "returns"

    def __str__(self) -> str:
        words = {True: "survives it", False: f"does not survive it ({self.outcome})", None: f"undecided ({self.doubt})"}
        of = ", as logarithms of velocity" if self.threshold.kick == "velocity" else ""
        ratio = f": the limit is {self.ratio:.4g} times this step{of}" if np.isfinite(self.ratio) else ""
        return f"{words[self.survives]}{ratio}\n{self.threshold}"

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units."""
        ratio = float(self.ratio) if np.isfinite(self.ratio) else None
        return {"survives": self.survives, "outcome": self.outcome, "doubt": self.doubt, "ratio": ratio,
                "threshold": self.threshold.to_dict()}  # fmt: skip


@checked(precision=finite(0, 0.1), branch=BRANCH)
def margin_to_kick(rig: Slider | Machine, step: Any, *, precision: float = 1e-6, branch: int = 0) -> KickMargin:
    """Outcome of an expected disturbance, and its distance from the smallest kick that is not survived.

    Parameters
    ----------
    rig : Slider or Machine
    step : VelocityStep, DisplacementStep, NormalStressStep, or of a machine DisturbanceStep
        The disturbance; its time is ignored.
    precision, branch
        As for `threshold`.

    Raises
    ------
    NotAvailable
        If the step is of another kind.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> step = ss.protocol.VelocityStep(at=0, to="2 um/s")
    >>> print(ss.margin_to_kick(rig, step))
    survives it: the limit is 2.94 times this step, as logarithms of velocity
    velocity kick that lasts: survives up to 7.67288... um/s; beyond: blow-up
    """
    possible = kicks_of(rig)
    kinds: dict[type, tuple[str, str]] = {
        kind: (kick, attribute)
        for kind, kick, attribute in (
            (VelocityStep, "velocity", "to"), (DisplacementStep, "displacement", "by"),
            (NormalStressStep, "normal-stress", "by"), (NormalStressStep, "normal-force", "by"),
            (DisturbanceStep, "force", "by"),
        )
        if kick in possible
    }  # fmt: skip
    if type(step) not in kinds:
        names = ", ".join(kind.__name__ for kind in kinds)
        raise NotAvailable(f"a margin is known for {names}, not for {step!r}; simulate it instead")
    kick, attribute = kinds[type(step)]
    amount = float(getattr(step, attribute))
    if kick == "velocity" and not amount > 0:
        raise NotAvailable("a stop or reversal of the drive is no step from one steady sliding to another; simulate it")
    up = amount >= (rig.drive.velocity if kick == "velocity" else 0)
    at = getattr(step, "on", None)
    if at is None and kick in ("force", "normal-force"):
        places = list(rig.ends() if kick == "force" else rig.contacts)
        at = places[0] if len(places) == 1 else None
    found = threshold(rig, kick, at=at, direction=1 if up else -1, precision=precision, branch=branch)
    kicked = Kicked(rig, kick, found.direction, "before", {}, branch, None, at)
    kicked.limit_steps()
    size = kicked.size_of(amount)
    outcome = int(kicked.outcomes(np.zeros(1, dtype=int), np.array([size]))[0])
    if outcome == INTERRUPTED:
        raise KeyboardInterrupt
    ratio = found.size / size if size else np.inf
    return KickMargin(step, found, float(ratio), OUTCOMES[outcome], doubt_of(outcome))
