"""From where in the phase plane motion returns to steady sliding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import BRANCH, NAME, NUMBERS, THREADS, checked, finite
from steadyslip.core.pictures import draw
from steadyslip.core.progress import progress_bar, progress_text
from steadyslip.core.results import ReadOnly
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.range import beyond_range
from steadyslip.model.sliding import steady_states
from steadyslip.motion import History, simulate
from steadyslip.motion.jobs import prepare
from steadyslip.nonlinear.kicks.kicks import options_for
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.outcomes import outcomes_of
from steadyslip.nonlinear.kicks.rest import rest_of
from steadyslip.nonlinear.kicks.spans import INTERRUPTED, OUTCOMES, Judged, StepBudget, doubt_of
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.cycles import cycles

Array = np.ndarray
POINTS = 81
STEPS = 2e9  # of integration, of all motions of a basin


@dataclass(frozen=True, eq=False)
class Basin(ReadOnly):
    """What comes of every starting point on a grid.

    Attributes
    ----------
    rig : Slider
    x : ndarray (n,)
        Slip ahead of the load point at the start, m.
    v : ndarray (m,)
        Velocity at the start, m/s.
    outcome : ndarray of str (m, n)
        ``returns``, ``blow-up``, ``oscillation``, ``contact lost``, ``no solution``, ``undecided``, ``interrupted``.
    doubt : ndarray of str (m, n)
        Why points are undecided; empty where they are not.
    cycles : tuple of History
        One period of each unstable cycle of this rig that was found: where there is one, it bounds the basin in
        the plane of a rig with two variables.
    """

    rig: Slider
    x: Array = field(repr=False)
    v: Array = field(repr=False)
    outcome: Array = field(repr=False)
    doubt: Array = field(repr=False)
    cycles: tuple[History, ...] = field(repr=False)

    @property
    def share(self) -> float:
        """Share of the grid's points that return."""
        return float(np.mean(self.outcome == "returns"))

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C came before all points were decided."""
        return bool(np.any(self.outcome == OUTCOMES[INTERRUPTED]))

    def plot(self, ax: Any = None) -> Any:
        """Draw the basin; see `steadyslip.figures.basin`."""
        return draw(self, ax=ax)


@checked(
    x=NUMBERS,
    v=NUMBERS,
    threads=THREADS,
    branch=BRANCH,
    along=NAME,
)
def basin(
    rig: Slider,
    x: Sequence[float] | None = None,
    v: Sequence[float] | None = None,
    *,
    along: str = "stiffness",
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> Basin:
    """Start everywhere in the phase plane and see what returns to steady sliding.

    Parameters
    ----------
    rig : Slider
    x : array_like, optional
        Slip ahead of the load point, m (negative: the spring is stretched); 81 values unless given, over the width
        of what a displacement kick survives.
    v : array_like, optional
        Velocity, m/s; 81 values unless given, four decades to each side of the drive. Without mass, the first
        memory variable follows from it; other memory variables start as in steady sliding.
    along : str, optional
        The parameter along which unstable cycles of this rig are looked for.
    rtol, threads, progress, branch
        As for `threshold_map`. After Ctrl-C, points that were not finished are ``interrupted``, and cycles those
        found by then.

    Returns
    -------
    Basin

    Raises
    ------
    NotAvailable
        If numbers leave the range of floating point.

    Notes
    -----
    All motions together take two billion steps of integration at most, some minutes on two cores; what is open then is
    undecided.
    """
    steady_states(rig)  # raises, and says why
    drive = rig.drive.velocity
    options = options_for(operating_point(rig, branch=branch).model, rtol)
    own = prepare(rig, None, 1.0, {}, {}, options, branch)
    rest = rest_of(own, np.full(1, drive), np.zeros(1))
    if not rest.exists[0]:
        raise beyond_range(own.point)
    length = float(rest.way[0])
    x = length * np.linspace(-15.0, 15.0, POINTS) if x is None else x  # type: ignore[assignment]
    v = drive * np.geomspace(1e-4, 1e4, POINTS) if v is None else v  # type: ignore[assignment]
    across, up = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (x, v))
    if across.ndim != 1 or up.ndim != 1 or not (np.all(np.isfinite(across)) and np.all(np.isfinite(up))):
        raise ParameterError([Problem("x, v", "allowed: one-dimensional arrays of finite numbers, m and m/s")])
    width = np.broadcast_to(across, (len(up), len(across)))
    height = np.broadcast_to(up[:, None], width.shape)
    jobs = prepare(rig, None, 1.0, {}, {"x": width.ravel(), "v": height.ravel()}, options, branch)
    count = width.size
    near, every = Neighbourhood(rest), np.zeros(count, dtype=int)
    near.computed()
    runs = Judged(
        replace(jobs, size=count), rest.part(every), near.part(every), np.zeros(count), every, budget=StepBudget(STEPS)
    )
    with progress_bar(count, progress, "starting points") as advanced:
        found = outcomes_of(runs, threads, advanced)
    reasons = [doubt_of(code) for code in range(len(OUTCOMES))]
    outcome, doubt = (np.array(words)[found].reshape(width.shape) for words in (OUTCOMES, reasons))
    orbits = () if np.any(found == INTERRUPTED) else _unstable_cycles(rig, along, branch, progress)
    return Basin(rig, across, up, outcome, doubt, orbits)


def _unstable_cycles(rig: Slider, along: str, branch: int, progress: bool | None) -> tuple[History, ...]:
    """One period of each unstable cycle at the rig's own parameter; none where no branch can be followed."""
    with progress_text("following cycles", progress) as said:

        def told(count: int, _: Cycle) -> None:
            said(f"following cycles, {count} so far; Ctrl-C draws the basin with these")

        try:
            found = cycles(rig, along, doublings=0, branch=branch, progress=told)
        except NotAvailable:
            return ()
    own = float(rig.parameters()[found.along].value)  # type: ignore[arg-type]
    return tuple(orbit(rig, cycle) for cycle in found.at(own) if not cycle.stable)


@checked(periods=finite(0, 1e4))
def orbit(rig: Slider, cycle: Cycle, periods: float = 1.0) -> History:
    """A cycle as a history, for drawing: simulated from its start.

    Parameters
    ----------
    rig : Slider
        The rig that has this cycle (its parameter at ``cycle.value``).
    cycle : Cycle
    periods : float
        How many; unstable cycles leave themselves after a few.
    """
    names = dict(cycle.start)
    if rig.friction.memory() and not operating_point(rig).model.inertial:
        names.pop("v")  # follows from the memory
    return simulate(rig, until=periods * cycle.period, initial=names, rtol=1e-10)
