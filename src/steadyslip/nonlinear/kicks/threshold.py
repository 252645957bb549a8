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
    INTERRUPTED,
    LATE,
    OUTCOMES,
    RETURNS,
    UNDECIDED,
    StepBudget,
    doubt_of,
)
from steadyslip.protocol import DisplacementStep, DisturbanceStep, NormalStressStep, VelocityStep

COARSE = 192  # sizes in the first scan of a single rig
BLOCK = 48  # sizes simulated at a time
FINE = 47  # sizes between the ends of a bracket in each round of narrowing
STEPS = 1e9  # integration steps for all motions of one threshold
AT_EDGE = 1e-5  # relative width of a bracket that ends at an edge: motions return ever more slowly towards it
LASTING = ("velocity", "normal-stress", "normal-force", "force")  # steps of what stays; others move a place, or blow
BEYOND = 1.01  # factor on the size of an edge at which the outcome beyond is simulated


@dataclass(frozen=True)
class Threshold(Displayed):
    """Largest kick of one kind that steady sliding survives, with its bracket and the outcome beyond.

    Attributes
    ----------
    rig : Slider or Machine
    kick : str
    direction : int
    size : float
        Smallest kick that does not return, without unit: ln(new/old velocity), natural lengths, share of the steady
        normal stress, or change of velocity over the drive's. 0 if steady sliding is unstable, inf if every
        kick up to `searched` returns, NaN if nothing in it is known to fail and not all is known to return.
    bracket : tuple of float
        Sizes of the largest kick up to which all that were tried return, and of the smallest known not to.
    amount : float
        The size in SI units: velocity after the step (or before it, with ``reference="after"``), displacement,
        change of normal stress, or impulse.
    unit : str
    outcome : str
        What happens beyond: ``blow-up``, ``oscillation`` (that does not die out), ``contact lost``, ``no solution``,
        or ``undecided``.
    searched : float
        Largest size tried.
    edge : bool
        Whether the limit is the edge of stability of the steady sliding that the kick leads to: beyond, there is none
        to return to. `size` is that edge then.
    decided : bool
        Whether the bracket is as narrow as was asked for. If not, kicks inside it were followed for the longest time
        allowed without coming to an end.
    interrupted : bool
        Whether Ctrl-C ended the search; the bracket is what was known by then.
    doubt : str
        Why kicks inside the bracket, or beyond it, are undecided; empty where none of them is.
    survived : float
        The lower end of the bracket in SI units, as `amount`: all smaller kicks that were tried return.
    at : str
        Of a machine: the body or contact that is kicked; empty for its drive.
    contact : str
        Of a machine, where contact is lost beyond: which; in a blow-up the one that is fastest; else empty.
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
        """Contact area by which a stress amount is multiplied for display as a force; None without one."""
        return self.rig.area

    def __str__(self) -> str:
        what = f"{self.kick} kick{' that lasts' if self.kick in LASTING else ''}{f' at {self.at}' if self.at else ''}"
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
    """Find the smallest kick of a given kind that does not return to steady sliding.

    Parameters
    ----------
    rig : Slider or Machine
    kick : str, optional
        ``velocity`` (step of the load-point velocity), ``displacement`` (step of the load point), ``normal-stress``
        (step of the normal stress) or ``impulse`` (blow on a block with mass). Of machines: ``velocity`` and
        ``displacement`` of the drive, or with `at` of a body; ``force`` (a step) and ``impulse`` on a body;
        ``normal-force`` (a step) at a contact.
    at : str, optional
        Of machines: the body or contact.
    direction : int, optional
        1: faster, forward, pressed harder; -1: the reverse.
    reference : str, optional
        For ``velocity``: whether the rig's drive is the velocity ``before`` or ``after`` the step. After is right
        for comparing with results that take normal stress and critical stiffness at the new velocity.
    up_to : float, optional
        Largest size that is searched, without unit like `Threshold.size`. Unless given it is 1e4 times the velocity
        (of the drive, or of the body that gets the blow), 1e5 natural lengths, or 10 times the normal force or stress.
    precision : float, optional
        Relative width of the bracket; 1e-5 is enough at the edge of stability of what a kick leads to, near which
        motions return ever more slowly.
    rtol : float, optional
        Error allowed per step of integration; 1e-10, with mass or bristles 1e-8, unless given.
    branch : int, optional
        Which steady sliding, where there are several.
    progress : callable, optional
        Called with the number of kicks decided so far and the ends of the bracket reached. Ctrl-C (or
        KeyboardInterrupt from here) returns what there is.

    Returns
    -------
    Threshold

    Raises
    ------
    NoSteadySliding
        If there is none to kick.
    NotAvailable
        If the kick is not possible, the motion ill-posed, or numbers leave the range of floating point.
    ParameterError
        If an argument is wrong.

    Notes
    -----
    Kicks of rising size are tried side by side, and the bracket of the first that fails is narrowed. What comes of a
    motion is decided by `steadyslip.nonlinear.kicks.outcomes`: it has returned when it is in a neighbourhood of steady
    sliding that is never left, it has not when it blows up, loses contact or is on a closed orbit that attracts; it may
    also be undecided. Where the steady sliding that a kick leads to is not stable nothing returns, and the search ends
    there. At the edge of stability itself small motions persist; there all that stays bounded counts as returning.
    All motions together take a billion steps of integration at most, of machines with more variables fewer, about a
    minute on two cores; what is open then is undecided.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> print(ss.threshold(rig))
    velocity kick that lasts: survives up to 7.67288... um/s; beyond: blow-up
    """
    if not 1e-12 <= precision <= 0.1:
        raise ParameterError([Problem("precision", f"got {precision!r}; allowed: from 1e-12 to 0.1")])
    steady_states(rig)  # raises, and says why
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
    """Search for the bracket of one threshold: a scan of rising sizes, then rounds inside it.

    Attributes
    ----------
    low, high : float
        Largest size up to which all return, smallest known not to (inf: none).
    outcome : int
        What comes of the latter; why the first doubt is one, where that is all that is known.
    doubt : int
        Why kicks inside the bracket are undecided; `RETURNS` where none is.
    """

    def __init__(self, kicked: Kicked, progress: Callable[[int, float, float], None] | None) -> None:
        self.kicked, self.progress = kicked, progress
        kicked.budget = StepBudget.of(STEPS, kicked.rest.state.shape[1])
        self.low, self.high, self.edge = 0.0, np.inf, np.inf
        self.outcome = self.doubt = RETURNS
        self.tried, self.interrupted = 0, False

    def run(self, precision: float) -> None:
        """Scan, then narrow to a relative precision."""
        sizes = np.geomspace(self.kicked.kick.low, self.kicked.highest, COARSE)
        self.edge = self.high = float(edges(self.kicked, np.zeros(1, dtype=int), sizes)[0])
        self._scan(sizes[sizes < self.edge])
        least = precision * self.kicked.kick.low  # smaller kicks, where even they fail, are none
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
            self.outcome = LATE if found == RETURNS else found  # neutral sliding at the edge survives nothing

    def _enough(self, precision: float) -> float:
        """Width of the bracket at which it is narrow enough."""
        return self.high * (max(precision, AT_EDGE) if self.at_edge else precision)

    @property
    def at_edge(self) -> bool:
        """True if the steady sliding after kicks loses its stability before any other limit is met."""
        return bool(np.isfinite(self.high) and self.high == self.edge)

    def _scan(self, sizes: Array) -> None:
        """Simulate rising sizes up to the first failure, at most one block beyond the first undecided one."""
        for start in range(0, len(sizes), BLOCK):
            block, low = sizes[start : start + BLOCK], self.low
            doubt = self.outcome >= UNDECIDED
            self._narrow(block[:: 2 if doubt else 1], 1.0)
            if doubt:
                self.low = low
            if doubt or self.outcome in CERTAIN:
                break

    def _narrow(self, sizes: Array, effort: float) -> None:
        """Simulate rising sizes inside the bracket and narrow it."""
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
        """Simulate kicks of some sizes; outcomes as indices into `OUTCOMES`."""

        def advanced(count: int) -> None:
            self.tried += count
            if self.progress is not None:
                self.progress(self.tried, self.low, self.high)

        return self.kicked.outcomes(np.zeros(len(sizes), dtype=int), sizes, None, advanced, effort)

    def result(self, rig: Slider | Machine, precision: float) -> Threshold:
        """Build the `Threshold` from the present bracket."""
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

    Looked for between rising `sizes`, then bisected to rounding.
    """
    found = np.full(len(which), np.inf)
    if not kicked.moves_rest:
        return found
    low, high = np.zeros(len(which)), np.full(len(which), np.inf)
    going = np.arange(len(which))
    for size in sizes:
        good = kicked.may_return(which[going], np.full(len(going), size))
        high[going[~good]] = size
        low[going[good]] = size
        going = going[good]
        if not len(going):
            break
    open_ = np.flatnonzero(np.isfinite(high))
    for _ in range(60):
        middle = 0.5 * (low[open_] + high[open_])
        good = kicked.rest_after(which[open_], middle).leading.real < 0
        low[open_[good]], high[open_[~good]] = middle[good], middle[~good]
    found[open_] = high[open_]
    return found


@dataclass(frozen=True)
class KickMargin(Displayed):
    """Distance of an expected disturbance from the smallest kick that is not survived.

    Attributes
    ----------
    step : object
        The protocol piece.
    threshold : Threshold
    ratio : float
        Threshold over the step's own size, of velocities as logarithms ln(v/v₀); NaN without a threshold.
    outcome : str
        What comes of the step itself: ``returns``, ``blow-up``, ``oscillation``, ``contact lost``, ``no solution`` or
        ``undecided``. Beyond the threshold larger kicks may return again.
    doubt : str
        Why it is undecided; empty where it is not.
    """

    step: Any
    threshold: Threshold
    ratio: float
    outcome: str
    doubt: str = ""

    @property
    def survives(self) -> bool | None:
        """True if the step returns to steady sliding; None if undecided."""
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
    """Compare an expected disturbance with the smallest kick that is not survived, and simulate it.

    Parameters
    ----------
    rig : Slider or Machine
    step : VelocityStep, DisplacementStep, NormalStressStep, or of a machine DisturbanceStep
        Its time does not matter.
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
    size = kicked.size_of(amount)
    outcome = int(kicked.outcomes(np.zeros(1, dtype=int), np.array([size]))[0])
    if outcome == INTERRUPTED:
        raise KeyboardInterrupt
    ratio = found.size / size if size else np.inf
    return KickMargin(step, found, float(ratio), OUTCOMES[outcome], doubt_of(outcome))
