"""Translation of runs (operating point, protocol, starting values) to the arrays that kernels take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import INTEGRATION
from steadyslip.core.records import with_values
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.layout import Setting
from steadyslip.kernels.methods import METHODS as TABLEAUS
from steadyslip.kernels.runner import Runner, runner
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.dead_time import USUAL_ORDER
from steadyslip.model.delay_order import order_for
from steadyslip.model.equations import EITHER, PULLED, Model
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.posed import resolved, well_posed
from steadyslip.model.range import in_range, require_range
from steadyslip.model.reducing import reduce_model
from steadyslip.model.reduction import Reduction
from steadyslip.model.scales import natural_scales, shortest_time
from steadyslip.model.start import guesses, initial_values
from steadyslip.model.weights import eliminable, slip_rates
from steadyslip.motion.status import THROUGH_DASHPOT
from steadyslip.motion.targets import NOTHING, Targets, targets
from steadyslip.protocol import Protocol
from steadyslip.protocol.creep import FREE
from steadyslip.protocol.segments import Segments, pack

METHOD_WORDS = {"auto": "", "explicit": "tsit5", "rosenbrock": "rodas4"} | {name: name for name in TABLEAUS}
TIGHT_RTOL = 1e-5  # up to this rtol the explicit pair of order 8 is faster than that of order 5 (benchmarks/methods.py)
MOST_STAGES_SOLVED = 8  # limit of stages of a method that solves equations in each; more take minutes to compile
BLOW_UP = np.exp(200.0)  # a velocity so many times the drive's counts as infinite; bounded orbits reach e^14
ROUNDING_DECIDES = (
    "the forces on the block are so much larger than their change with its velocity that rounding decides how it "
    "moves; look for a parameter that is too small or too large by orders of magnitude (a, a damping, a friction level)"
)
NEEDS_STIFFNESS = (
    "creep as a part of a run needs a stiffness between drive and body, whose force determines where the drive "
    "goes on, not a dashpot alone; give it one, or let creep last for the whole run (creep-step without creep)"
)
CONTACT_SHARE = 1e-9  # contact counts as lost below this share of the steady normal stress: laws are not defined at 0


@dataclass(frozen=True)
class Options:
    """Options of integration.

    Attributes
    ----------
    method : str
        ``auto``, ``explicit``, ``rosenbrock`` or a method's own name.
    rtol : float
        Error allowed per step, relative to the size of each variable or to its scale (1 for ln v), if that is larger.
    most_steps : int
        Limit of steps.
    arrest : float
        Share of the drive velocity below which the block counts as arrested.
    order : int
        Number of variables of each delayed signal (`steadyslip.model.dead_time`); 0 to choose it by the rig.
    """

    method: str = "auto"
    rtol: float = 1e-7
    most_steps: int = 10_000_000
    arrest: float = 1e-3
    order: int = 0

    def __post_init__(self) -> None:
        problems = []
        if self.method not in METHOD_WORDS:
            problems.append(Problem("method", unknown_name("method", self.method, METHOD_WORDS)))
        for name, role in INTEGRATION.items():
            try:
                role.checked(getattr(self, name))
            except ParameterError as error:
                problems += [Problem(name, fault.message) for fault in error.problems]
        if problems:
            raise ParameterError(problems)


@dataclass(frozen=True, eq=False)
class Jobs:
    """Arrays of a set of trajectories, for any kernel.

    Attributes
    ----------
    point : OperatingPoint
        Operating points of all rigs, flat arrays.
    segments : Segments
        Inputs of the jobs.
    initial : ndarray (jobs, continuous variables)
    velocity : ndarray (jobs,)
        Initial velocity, m/s.
    near : ndarray (jobs, searched), optional
        Initial values of the variables to be solved for (`Reduction.searched`); NaN where unknown.
    reduction : Reduction
    eliminate : int or None
        Index of the memory variable that follows from the balance of forces and is not integrated; for a machine, one
        index for each contact.
    options : Options
    size : int
    targets : Targets
        Targets of the pieces of the protocol.
    let_go : OperatingPoint, optional
        Operating points while the drive is released, if the protocol releases it for some time.
    """

    point: OperatingPoint
    segments: Segments
    initial: np.ndarray
    velocity: np.ndarray
    reduction: Reduction
    eliminate: int | tuple[int | None, ...] | None
    options: Options
    size: int
    targets: Targets = NOTHING
    near: np.ndarray | None = None
    let_go: OperatingPoint | None = None

    @property
    def exists(self) -> np.ndarray:
        """True (jobs,) for rigs with steady sliding to start from."""
        return np.atleast_1d(np.asarray(self.point.exists))

    @property
    def late_order(self) -> int:
        """Number of variables of each delayed signal; 0 without delays."""
        return self.reduction.model.late_order

    @property
    def posed(self) -> np.ndarray:
        """True where the equations determine the motion near steady sliding; see `model.posed.well_posed`."""
        found = well_posed(self.point)
        return found if self.let_go is None else found & well_posed(self.let_go)

    @property
    def in_range(self) -> np.ndarray:
        """True (jobs,) where numbers are within the range of floating point and rounding does not decide the motion."""
        return np.asarray(np.atleast_1d(in_range(self.point)) & resolved(self.point))

    def choice(self, lanes: int, dense: bool) -> Choice:
        """Kernel variant for these jobs: method, kind of inputs, lanes, dense output."""
        method = METHOD_WORDS[self.options.method] or automatic_method(self.reduction, self.options.rtol)
        harmonics = self.segments.amplitude.shape[-1]
        return Choice(method, self.segments.level(), harmonics, lanes, dense)

    def runner(self, lanes: int, dense: bool) -> Runner:
        """Compiled kernel for these jobs."""
        acting = self.targets.pushes, self.targets.presses
        return runner(self.reduction.model, self.choice(lanes, dense), self.eliminate, *acting)

    def tables(self, machine: Runner, start: int, stop: int, watch: bool, record: bool) -> tuple[np.ndarray, ...]:
        """Kernel tables of the jobs from `start` to `stop`: constants, initial values, settings and segments."""
        point = self.point.part(slice(start, stop))
        initial = self.initial[start:stop] if len(self.initial) > 1 else self.initial
        velocity = self.velocity[start:stop] if len(self.velocity) > 1 else self.velocity
        found = guesses(self.reduction, point, initial, velocity)
        if self.near is not None:
            near = self.near[start:stop].T
            found = [np.where(np.isfinite(own), own, guess) for own, guess in zip(near, found, strict=False)] or found
        first, *others = found
        make = _cached_settings if point.size == 1 else _settings
        settings = make(point, machine, self.reduction, self.options)
        settings = settings.repeat(max(len(settings), np.size(first)) // len(settings), axis=0)
        settings[:, Setting.GUESS] = first
        for column, value in enumerate(others, start=Setting.ATOL + machine.kernel.size):
            settings[:, column] = value
        settings[:, Setting.WATCH], settings[:, Setting.RECORD] = watch, record
        return machine.constants(point), initial, settings, self.segments.rows(start, stop)


def _settings(point: OperatingPoint, machine: Runner, reduction: Reduction, options: Options) -> np.ndarray:
    """Kernel settings (jobs, columns), without those that depend on the initial state and on recording."""
    scales, (unknown, *others) = natural_scales(point, reduction)
    sizes = np.column_stack(np.broadcast_arrays(*(np.atleast_1d(scales[name]) for name in reduction.names)))
    speed = slip_rates(point)[0]
    way = scales["x"] if "x" in scales else speed * shortest_time(scales)
    own = numbers(speed, np.atleast_1d(point.sigmas[0]), way, unknown, options)
    settings = machine.settings(own | {"watch": 0.0, "record": 0.0, "guess": 0.0}, options.rtol * sizes)
    for column, value in enumerate(others, start=settings.shape[1] - len(others)):
        settings[:, column] = value
    return settings


_cached_settings = cached(_settings)


def numbers(drive: Any, stress: Any, x: Any, unknown: Any, options: Options) -> dict[str, Any]:
    """Kernel settings by name, from drive velocity, steady normal stress and scales: arrays, or nodes of a program."""
    return {
        "rtol": options.rtol,
        "most_steps": options.most_steps,
        "v_high": drive * float(BLOW_UP),
        "v_low": drive * options.arrest,
        "sigma_low": CONTACT_SHARE * stress,
        "z_scale": unknown,
        "first_step": x / drive,
        "v_drive": drive,
    }


def automatic_method(reduction: Reduction, rtol: float = np.inf) -> str:
    """Name of the method for `auto`: explicit for massless models in ln v or asinh, Rosenbrock for stiff others.

    Mass makes the stick phase stiff (rate a/m*), bristles the whole motion. Of the explicit pairs, that of order 8 is
    faster at tight tolerances (`benchmarks/methods.py`), but takes minutes to compile if equations are solved in each
    of its stages, or with the many variables of delayed signals.
    """
    kinds = [one.variable.kind for one in reduction.slidings if one.variable is not None]
    free = "loading" in reduction.model.inputs  # without a spring the block slides fast, which is stiff
    if any(one.inertial for one in reduction.model.coordinates) or "linear" in kinds or free:
        return "rodas4"
    quick = not reduction.unknowns and not reduction.model.late_signals  # quick to compile
    return "dop853" if rtol <= TIGHT_RTOL and quick else "tsit5"


def prepare(
    rig: Slider | Machine,
    protocol: Any,
    until: Any,
    vary: Mapping[str, Any],
    initial: Mapping[str, Any],
    options: Options,
    branch: int = 0,
) -> Jobs:
    """Jobs (arrays for kernels) from the arguments of runs, which are checked.

    Parameters
    ----------
    vary : mapping
        Parameters of the rig and, as ``protocol.pieces.1.to`` or ``protocol.until``, of the protocol: flat arrays
        of equal length or numbers.
    initial : mapping
        Starting values of model variables, arrays as in `vary`.

    Raises
    ------
    ParameterError
        If any argument is not allowed; lists every problem.
    NotAvailable
        If the laws or the drive of the rig exclude the run, or numbers of a single rig leave floating point.
    """
    own = {name: value for name, value in vary.items() if not name.startswith("protocol.")}
    plan = in_units_of(rig, Protocol.of(protocol)).varied(
        {name: value for name, value in vary.items() if name not in own}
    )
    rig.check_branch(branch)
    acting = targets(rig, plan)
    point = operating_point(rig, own, branch=branch, drive=acting.drive)
    _refuse_singular(rig, point, bool(own))
    if not own:
        require_range(point)
        if not np.all(resolved(point)):
            raise NotAvailable(ROUNDING_DECIDES)
    final = plan.until if until is None else until
    if final is None:
        raise ParameterError([Problem("until", "missing; give the end of the run in s, such as until=200")])
    segments = pack(plan, point.drive, final, acting.channels)
    if np.any(segments.jump) and any(one.damping and LOAD_POINT in one.senses for one in rig.mechanism().elements):
        raise ParameterError(
            [Problem("protocol", f"a displacement step {THROUGH_DASHPOT}; use a short velocity step instead")]
        )
    eliminate = eliminable(point)
    order = options.order or (order_for(point) if point.model.delays else USUAL_ORDER)
    reduction = reduce_model(point.model, eliminate, acting.pushes, acting.presses, order)
    _refuse_slow_to_compile(reduction, options.method)
    if acting.drive == EITHER and not np.all(np.asarray(point.evaluate(_taken_up_by(point.model))) > 0):
        raise NotAvailable(NEEDS_STIFFNESS)
    free = segments.value[:, 0, FREE] if acting.drive == EITHER else 0.0
    start, velocity = initial_values(reduction, point, initial, free)
    let_go = operating_point(rig, own, branch=branch, drive=PULLED) if acting.drive == EITHER else None
    size = max(*map(np.size, point.sigmas), len(segments.start), len(start), point.size, 1)
    return Jobs(point, segments, start, velocity, reduction, eliminate, options, size, acting, let_go=let_go)


@cached
def _taken_up_by(model: Model) -> ArrayFunction:
    """Compiled function that returns the stiffness, if any, of the element that carries a released drive's force."""
    return model.function([] if model.letting_go is None else [model.letting_go.stiffness])


def _refuse_slow_to_compile(reduction: Reduction, method: str) -> None:
    """Raise ParameterError for a method that would take minutes to compile: many stages, equations solved in each."""
    if not reduction.unknowns or METHOD_WORDS[method] not in TABLEAUS:
        return
    stages = {name: make().stages for name, make in TABLEAUS.items()}
    if stages[METHOD_WORDS[method]] > MOST_STAGES_SOLVED:
        allowed = ", ".join(["auto", *(name for name, count in stages.items() if count <= MOST_STAGES_SOLVED)])
        message = (
            f"got {method!r}; for this rig velocity follows from an equation that has to be solved in each of its "
            f"{stages[METHOD_WORDS[method]]} stages, which would take minutes to compile; allowed here: {allowed}"
        )
        raise ParameterError([Problem("method", message)])


def _refuse_singular(rig: Slider | Machine, point: OperatingPoint, varied: bool) -> None:
    """Raise NotAvailable for rigs whose friction laws are singular beyond small motions."""
    own = with_values(rig, point.named()) if varied else rig
    for laws in own.laws_by_contact().values():
        for condition in laws.friction.motion_conditions():
            if (problem := condition.problem()) is not None:
                raise NotAvailable(f"{laws.prefix}friction.{problem}")
