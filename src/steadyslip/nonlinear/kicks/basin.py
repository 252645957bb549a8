"""Basin of steady sliding: the initial states in a phase plane from which motion returns to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import BRANCH, NAME, NUMBERS, THREADS, checked, finite
from steadyslip.core.pictures import draw
from steadyslip.core.progress import progress_bar, progress_text
from steadyslip.core.results import ReadOnly
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.range import out_of_range_error
from steadyslip.model.scales import natural_scales
from steadyslip.model.sliding import steady_states
from steadyslip.motion import History, simulate
from steadyslip.motion.jobs import prepare
from steadyslip.nonlinear.kicks.kicks import options_for
from steadyslip.nonlinear.kicks.neighbourhood import Neighbourhood
from steadyslip.nonlinear.kicks.outcomes import contacts_of, outcomes_of
from steadyslip.nonlinear.kicks.places import steady_speeds
from steadyslip.nonlinear.kicks.rest import Rest
from steadyslip.nonlinear.kicks.settled import rest_of
from steadyslip.nonlinear.kicks.spans import (
    BLOW_UP,
    CONTACT_LOST,
    INTERRUPTED,
    OUTCOMES,
    MotionBatch,
    StepBudget,
    doubt_of,
)
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.follow import cycles

POINTS = 81  # default number of grid points along each axis: the edge of the basin is located to 1.2 % of the axis
STEPS = 2e9  # limit of integration steps for all motions of a basin


@dataclass(frozen=True, eq=False)
class Basin(ReadOnly):
    """Outcome of the motion from every starting point on a grid of the phase plane.

    Attributes
    ----------
    rig : Slider or Machine
    x : ndarray (n,)
        Slip ahead of the load point at the start, m; for a machine the displacement of a body, m or rad.
    v : ndarray (m,)
        Velocity at the start, m/s or rad/s, or the second variable in `names`.
    outcome : ndarray of str (m, n)
        ``returns``, ``blow-up``, ``oscillation``, ``contact lost``, ``no solution``, ``undecided``, ``interrupted``.
    doubt : ndarray of str (m, n)
        Reason for which a point is undecided; else empty.
    cycles : tuple of History
        One period of each unstable cycle of this rig that was found; with two state variables, it bounds the basin.
    names : tuple of str
        Variables of the plane: ``x`` and ``v``; for a machine a body's displacement and velocity, or without mass a
        memory variable of a contact.
    units : tuple of str
        SI units of the variables.
    steady : tuple of float
        Steady sliding in the plane, SI units.
    contact : ndarray of str (m, n)
        For a machine, the contact that is lost, or that is the fastest in a blow-up; else empty.
    """

    rig: Slider | Machine
    x: Array = field(repr=False)
    v: Array = field(repr=False)
    outcome: Array = field(repr=False)
    doubt: Array = field(repr=False)
    cycles: tuple[History, ...] = field(repr=False)
    names: tuple[str, str] = ("x", "v")
    units: tuple[str, str] = ("m", "m/s")
    steady: tuple[float, float] = (0.0, 0.0)
    contact: Array = field(default_factory=lambda: np.array(""), repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "contact", np.broadcast_to(self.contact, np.shape(self.outcome)))
        super().__post_init__()

    @property
    def share(self) -> float:
        """Fraction of the grid points from which the motion returns to steady sliding."""
        return float(np.mean(self.outcome == "returns"))

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C came before all points were decided."""
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
    at=NAME,
)
def basin(
    rig: Slider | Machine,
    x: Sequence[float] | None = None,
    v: Sequence[float] | None = None,
    *,
    at: str | None = None,
    along: str | None = None,
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> Basin:
    """Outcomes of motions from every point of a grid of the phase plane: which return to steady sliding.

    Parameters
    ----------
    rig : Slider or Machine
    x : array_like, optional
        Slip ahead of the load point, m (negative: the spring is stretched); by default 81 values, 15 natural lengths to
        each side. For a machine the displacement of a body from steady sliding, m or rad.
    v : array_like, optional
        Velocity, m/s or rad/s; by default 81 values, four decades to each side of steady sliding. Without mass, the
        first memory variable of a slider follows from it; for a machine `v` is the memory variable itself. All other
        variables start as in steady sliding.
    at : str, optional
        Body of a machine to whose motion the plane belongs; by default the body whose contact moves most in the leading
        mode.
    along : str, optional
        Parameter along which unstable cycles of this rig are searched for; by default the stiffness of a slider. For a
        machine cycles are searched for only if it is given.
    rtol, threads, progress, branch
        As for `threshold_map`. After Ctrl-C, points without an outcome are ``interrupted``, and `cycles` are those
        found by then.

    Returns
    -------
    Basin

    Raises
    ------
    NotAvailable
        If steady sliding is unstable, so that nothing returns to it, or numbers leave the range of floating point.

    Notes
    -----
    All motions together take at most two billion integration steps, fewer for machines with more variables, some
    minutes on two cores; motions without an outcome by then are undecided.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> found = ss.basin(rig, x=[0], v=[1e-6, 1e-4])
    >>> found.outcome.tolist()
    [['returns'], ['returns']]
    """
    steady_states(rig)  # raises NoSteadySliding with the reason
    if problems := rig.place_problems("at", at, rig.ends()):
        raise ParameterError(problems)
    options = options_for(operating_point(rig, branch=branch).model, rtol)
    own = prepare(rig, None, 1.0, {}, {}, options, branch)
    rest = rest_of(own, np.atleast_1d(np.asarray(own.point.drive, dtype=float)), np.zeros(1))
    if not rest.exists[0]:
        raise out_of_range_error(own.point)
    if not (rest.stable[0] or rest.neutral[0]):
        raise NotAvailable(
            "no basin: steady sliding of this rig is unstable, so that no starting point returns to it; "
            "`cycles` follows what the rig does instead, `simulate` shows it"
        )
    plane = _plane_of(rig, rest, at)
    x = plane.length * np.linspace(-15.0, 15.0, POINTS) if x is None else x  # type: ignore[assignment]
    v = plane.heights if v is None else v  # type: ignore[assignment]
    across, up = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (x, v))
    if across.ndim != 1 or up.ndim != 1 or not (np.all(np.isfinite(across)) and np.all(np.isfinite(up))):
        raise ParameterError([Problem("x, v", "allowed: one-dimensional arrays of finite numbers, m and m/s")])
    width = np.broadcast_to(across, (len(up), len(across)))
    height = np.broadcast_to(up[:, None], width.shape)
    start = dict(zip(plane.names, (width.ravel(), height.ravel()), strict=True))
    jobs = prepare(rig, None, 1.0, {}, start, options, branch)
    count, budget = width.size, StepBudget.of(STEPS, rest.state.shape[1])
    near, every = Neighbourhood(rest), np.zeros(count, dtype=int)
    near.computed()
    one = (rest.part(every), near.part(every))
    runs = MotionBatch(replace(jobs, size=count), *one, np.zeros(count), every, budget=budget)
    with progress_bar(count, progress, "starting points") as advanced:
        found = outcomes_of(runs, threads, advanced)
    contact = contacts_of(runs, np.flatnonzero(np.isin(found, (CONTACT_LOST, BLOW_UP))), threads)
    reasons = [doubt_of(code) for code in range(len(OUTCOMES))]
    outcome, doubt = (np.array(words)[found].reshape(width.shape) for words in (OUTCOMES, reasons))
    along = rig.default_along if along is None else along
    orbits = () if along is None or np.any(found == INTERRUPTED) else _unstable_cycles(rig, along, branch, progress)
    return Basin(
        rig, across, up, outcome, doubt, orbits, plane.names, plane.units, (0.0, plane.steady),
        contact.reshape(width.shape),
    )  # fmt: skip


@dataclass(frozen=True)
class _Plane:
    """Coordinates of the phase plane: their names, scales and steady values."""

    names: tuple[str, str]
    units: tuple[str, str]
    length: float
    heights: Array
    steady: float


def _plane_of(rig: Slider | Machine, rest: Rest, at: str | None) -> _Plane:
    """Phase plane of a slider's block, or of the body `at` of a machine; by default that whose contact moves most."""
    if isinstance(rig, Slider):
        drive = rig.drive.velocity
        heights = drive * np.geomspace(1e-4, 1e4, POINTS)
        return _Plane(("x", "v"), ("m", "m/s"), float(rest.natural_slip[0]), heights, drive)
    model, scales = rest.reduction.model, natural_scales(rest.point, rest.reduction)[0]
    touch = list(rig.contacts)[rest.contact]
    body = at or rig.contacts[touch].held
    by_name = {item.name: item for item in model.variables}
    if f"{body}.x" not in by_name:
        raise NotAvailable(
            f"a basin is drawn over displacement and velocity of one body, and {body} is a point of a structure, which "
            "has several; use threshold for the largest kick that is survived at this point"
        )
    place, speed = by_name[f"{body}.x"], f"{body}.v"
    length = float(np.ravel(scales[place.name])[0])
    if speed in by_name or model.is_single:
        steady = float(np.ravel(steady_speeds(rest.point, body))[0])
        own = float(np.ravel(scales[speed])[0]) if speed in scales else abs(steady)
        decades = np.geomspace(1e-4, 1e4, POINTS)
        heights = steady * decades if steady else own * np.linspace(-15.0, 15.0, POINTS)
        return _Plane((place.name, speed), (place.unit, f"{place.unit}/s"), length, heights, steady)
    rubs = [name for name, one in rig.contacts.items() if body in (one.body, one.against)]
    memory = next((item for name in rubs for item in model.memory if item.name.startswith(f"{name}.")), None)
    if memory is None:
        others = [name for name in rig.bodies if f"{name}.v" in by_name]
        words = f"; allowed: {', '.join(others)}" if others else ""
        raise ParameterError([Problem("at", f"{body!r} has neither a mass nor a contact with memory{words}")])
    steady = float(np.ravel(rest.point.evaluate(model.function([model.steady[memory.symbol]]))[0])[0])
    heights = steady + float(np.ravel(scales[memory.name])[0]) * np.linspace(-15.0, 15.0, POINTS)
    return _Plane((place.name, memory.name), (place.unit, memory.unit), length, heights, steady)


def _unstable_cycles(rig: Slider | Machine, along: str, branch: int, progress: bool | None) -> tuple[History, ...]:
    """One period of each unstable cycle of the rig as it is; empty where no branch of cycles can be followed."""
    with progress_text("following cycles", progress) as show:

        def report(count: int, _: Cycle) -> None:
            show(f"following cycles, {count} so far; Ctrl-C draws the basin with these")

        try:
            found = cycles(rig, along, doublings=0, branch=branch, progress=report)
        except NotAvailable:
            return ()
    own = float(rig.parameters()[found.along].value)  # type: ignore[arg-type]
    return tuple(orbit(rig, cycle) for cycle in found.at(own) if not cycle.stable)


@checked(periods=finite(0, 1e4))
def orbit(rig: Slider | Machine, cycle: Cycle, periods: float = 1.0) -> History:
    """Simulated motion over some periods of a cycle, from its start, for plots.

    Parameters
    ----------
    rig : Slider or Machine
        The rig that has this cycle (its parameter at ``cycle.value``).
    cycle : Cycle
    periods : float
        Number of periods; a simulation leaves an unstable cycle after a few.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["radiation_damping=1 GPa s/m"])
    >>> (cycle,) = ss.cycles(rig).at(20e9)
    >>> run = ss.orbit(rig.with_values({"stiffness": 20e9}), cycle)
    >>> round(run.end / cycle.period, 6)
    1.0
    """
    return simulate(rig, until=periods * cycle.period, initial=cycle.start, rtol=1e-10)
