"""From rigs, a protocol and starting values to the arrays that kernels take."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import InternalError, NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.expressions import array_function
from steadyslip.core.records import parameters, twin
from steadyslip.kernels.kernel import Choice
from steadyslip.kernels.methods import METHODS as TABLEAUS
from steadyslip.kernels.program import Program, program
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.point import Values, check_together, model_values
from steadyslip.model.reduction import TIME, V_LP, P, Q, Reduction, W, reduce_model
from steadyslip.model.steady import steady_stress
from steadyslip.protocol import Protocol, Segments, pack

METHODS = {"auto": "", "explicit": "tsit5", "rosenbrock": "rodas4"} | {name: name for name in TABLEAUS}
TIGHT = 0.0  # rtol up to which the explicit pair of order 8 is chosen
LEAST_WEIGHT = 1e-5  # db/da below which a memory variable is not eliminated: rounding is amplified by its inverse
BLOW_UP = np.exp(200.0)  # bounded orbits reach e^14 and more (theory 7); this far beyond the drive there is no return
CONTACT_SHARE = 1e-9  # of the steady normal stress: below, contact is lost


@dataclass(frozen=True)
class Options:
    """How to integrate and what to watch.

    Attributes
    ----------
    method : str
        ``auto``, ``explicit``, ``rosenbrock`` or a method's own name.
    rtol : float
        Error allowed per step, relative to each variable's size or scale; the scale is 1 for ln v.
    most_steps : int
        Limit of steps.
    arrest : float
        Share of the drive velocity below which the block counts as arrested.
    """

    method: str = "auto"
    rtol: float = 1e-7
    most_steps: int = 10_000_000
    arrest: float = 1e-3

    def __post_init__(self) -> None:
        problems = []
        if self.method not in METHODS:
            problems.append(Problem("method", unknown_name("method", self.method, METHODS)))
        checks = {"rtol": 1e-14 <= self.rtol <= 0.1, "arrest": 0 <= self.arrest < 1, "most_steps": self.most_steps >= 1}
        allowed = {"rtol": "a number from 1e-14 to 0.1", "arrest": "a number from 0 to below 1",
                   "most_steps": "a whole number >= 1"}  # fmt: skip
        for name, good in checks.items():
            if not good:
                problems.append(Problem(name, f"got {getattr(self, name)!r}; allowed: {allowed[name]}"))
        if problems:
            raise ParameterError(problems)


@dataclass(frozen=True)
class Jobs:
    """Everything about a set of trajectories except the kernel that runs them.

    Attributes
    ----------
    values : Values
        Model and parameters.
    sigma : ndarray
        Steady normal stress, NaN where there is no steady sliding.
    posed : ndarray of bool
        Whether the balance of forces rises with its unknown (velocity, or acceleration) in steady sliding: if not,
        the least lag or mass that was left out decides the motion.
    segments : Segments
    initial : ndarray (jobs, continuous variables)
    reduction : Reduction
    options : Options
    size : int
    """

    values: Values
    sigma: np.ndarray
    segments: Segments
    initial: np.ndarray
    velocity: np.ndarray
    posed: np.ndarray
    reduction: Reduction
    eliminate: int | None
    options: Options
    size: int

    def choice(self, lanes: int, dense: bool) -> Choice:
        """The kernel that these jobs need."""
        method = METHODS[self.options.method] or automatic_method(self.reduction, self.options.rtol)
        harmonics = self.segments.amplitude.shape[-1]
        return Choice(method, self.segments.level(), harmonics, lanes, dense)

    def program(self, lanes: int, dense: bool) -> Program:
        return program(self.reduction.model, self.choice(lanes, dense), self.eliminate)

    def part(self, start: int, stop: int) -> tuple[Any, ...]:
        """Arguments and σss of some jobs."""
        cut = [a[start:stop] if np.ndim(a) and len(a) > 1 else a for a in self.values.arguments]
        return tuple(cut), self.sigma[start:stop] if len(self.sigma) > 1 else self.sigma

    def tables(self, machine: Program, start: int, stop: int, watch: bool, record: bool) -> tuple[np.ndarray, ...]:
        """Constants, initial, settings and segment rows of some jobs."""
        arguments, sigma = self.part(start, stop)
        constants = machine.constants(arguments, sigma)
        scales, unknown = natural_scales(self.reduction, arguments, sigma)
        rtol = self.options.rtol
        drive = dict(zip(self.values.model.parameters, arguments, strict=True))["drive.velocity"]
        initial = self.initial[start:stop] if len(self.initial) > 1 else self.initial
        velocity = self.velocity[start:stop] if len(self.velocity) > 1 else self.velocity
        settings = machine.settings(
            {
                "rtol": rtol,
                "most_steps": self.options.most_steps,
                "v_high": drive * BLOW_UP,
                "v_low": drive * self.options.arrest,
                "sigma_low": CONTACT_SHARE * sigma,
                "watch": float(watch),
                "record": float(record),
                "guess": _guess(self.reduction, arguments, sigma, initial, velocity),
                "z_scale": unknown,
                "first_step": scales["x"] / drive,
                "v_drive": drive,
            },
            rtol * np.column_stack(np.broadcast_arrays(*(np.atleast_1d(scales[n]) for n in self.reduction.names))),
        )
        return constants, initial, settings, segment_rows(self.segments, start, stop)


def automatic_method(reduction: Reduction, rtol: float = np.inf) -> str:
    """Explicit for massless models in ln v or asinh, which are not stiff; Rosenbrock for the others.

    Mass makes the stick phase stiff (rate a/m*), bristles the whole motion. Of the explicit pairs that of order 8 needs
    less time for a given error where tolerances are tight: `benchmarks/methods.py`.
    """
    if reduction.model.inertial or reduction.velocity == "linear":
        return "rodas4"
    return "dop853" if rtol <= TIGHT else "tsit5"


def segment_rows(segments: Segments, start: int, stop: int) -> np.ndarray:
    """Segments as the kernels read them: start, end, jump, values, slopes, waves."""
    lanes = slice(start, stop) if len(segments.start) > 1 else slice(None)
    parts = [segments.start, segments.end, segments.jump]
    rows = [part[lanes, :, None] for part in parts] + [segments.value[lanes], segments.slope[lanes]]
    for wave in (segments.amplitude, segments.angular_frequency, segments.phase):
        block = wave[lanes]
        rows.append(block.reshape(*block.shape[:2], -1))
    return np.ascontiguousarray(np.concatenate(rows, axis=2))


def prepare(
    rig: Slider,
    protocol: Any,
    until: Any,
    vary: Mapping[str, Any],
    initial: Mapping[str, Any],
    options: Options,
    branch: int = 0,
) -> Jobs:
    """Check everything and bring it into arrays.

    Parameters
    ----------
    vary : mapping
        Parameters of the rig and, as ``protocol.pieces.1.to`` or ``protocol.until``, of the protocol: flat arrays
        of equal length or numbers.
    initial : mapping
        Starting values of model variables, as `vary`.

    Raises
    ------
    ParameterError
        Listing everything that is wrong.
    NotAvailable
        If the rig cannot move as asked.
    """
    plan = Protocol.of(protocol)
    own = {name: value for name, value in vary.items() if not name.startswith("protocol.")}
    changed = _protocol_values(plan, {name: value for name, value in vary.items() if name not in own})
    if changed:
        check_together(plan, "protocol.", changed)
        plan = twin(plan, changed, "protocol.")
    values = model_values(rig, own, branch=branch)
    _refuse_singular(rig, values)
    final = plan.until if until is None else until
    if final is None:
        raise ParameterError([Problem("until", "missing; give the end of the run in s, such as until=200")])
    drive = values.named()["drive.velocity"]
    segments = pack(plan, drive, final)
    if np.any(segments.jump) and (rig.damping or rig.drive.derivative()):
        raise ParameterError(
            [Problem("protocol", "a displacement step through a dashpot (slider.damping, kd) is an infinite force; "
                     "use a short velocity step instead")]
        )  # fmt: skip
    sigma = np.atleast_1d(np.asarray(steady_stress(values), dtype=float))
    eliminate = _eliminable(values, sigma)
    reduction = reduce_model(values.model, eliminate)
    start, velocity = initial_values(reduction, values, sigma, initial)
    size = max(len(sigma), len(segments.start), len(start), *(np.size(a) for a in values.arguments), 1)
    posed = np.atleast_1d(_numbers(values.model, values.arguments, sigma)[-1] > 0)
    return Jobs(values, sigma, segments, start, velocity, posed, reduction, eliminate, options, size)


def _protocol_values(plan: Protocol, given: Mapping[str, Any]) -> dict[str, Any]:
    """Checked arrays of the protocol's own parameters, completed by its other numbers."""
    from steadyslip.model.point import checked_array

    if not given:
        return {}
    known = parameters(plan, "protocol.")
    problems, found = [], {}
    for name, value in given.items():
        if name not in known:
            problems.append(Problem(name, unknown_name("parameter", name, known)))
            continue
        try:
            found[name] = checked_array(name, known[name].role, value)
        except ParameterError as error:
            problems += error.problems
    if problems:
        raise ParameterError(problems)
    return {name: address.value for name, address in known.items()} | found


def _refuse_singular(rig: Slider, values: Values) -> None:
    """Rates that divide by b = 0 are right in the limit of small motions only."""
    from steadyslip.laws.friction import RateState

    friction = rig.friction
    if not isinstance(friction, RateState) or not friction._is_scaled() or friction.evolution.name == "slip":
        return
    named = values.named()
    for name, value in named.items():
        if name.startswith("friction.") and name.endswith(".b") and np.any(np.asarray(value) == 0):
            raise NotAvailable(
                f"{name} = 0 with memory of normal stress: the {friction.evolution.name} law's rate divides by b; "
                "use a small b, or the slip law, which has the limit"
            )


# -- weights and scales at steady sliding


@lru_cache(maxsize=64)
def _weights(model: Model) -> Callable[..., list[Any]]:
    """Derivatives at steady sliding: friction in ln v, balance in x, friction in each memory, each memory's own rate;
    then the memories themselves, and the balance in its unknown."""
    v, x = model.symbols["v"], model.symbols["x"]
    memory = [m.symbol for m in model.variables if m.symbol not in (x, v) and m.name != "integral"]
    inlined = model.balance
    for symbol, definition in reversed(model.definitions.items()):
        inlined = inlined.xreplace({symbol: definition})
    rates = dict(zip((m.symbol for m in model.variables), model.rates, strict=True))
    unknown = sp.diff(inlined, model.unknown)
    wanted = [v * sp.diff(model.balance, v), sp.diff(inlined, x)]
    wanted += [sp.diff(model.balance, m) for m in memory]
    wanted += [sp.diff(rates[m], m) for m in memory]
    wanted += [*memory, unknown]
    at_steady = [e.doit().xreplace(model.steady) for e in wanted]
    return array_function([*model.parameters.values(), model.sigma_ss], at_steady)


def _numbers(model: Model, arguments: tuple[Any, ...], sigma: Any) -> list[np.ndarray]:
    with np.errstate(all="ignore"):
        found = _weights(model)(*map(np.asarray, arguments), np.asarray(sigma))
        return [np.asarray(x, dtype=float) for x in found]


def _memory_count(model: Model) -> int:
    return len(model.variables) - 1 - model.inertial - ("integral" in model.symbols)


def _eliminable(values: Values, sigma: Any) -> int | None:
    """The memory variable to leave out: of those that allow it, the one with most weight in friction.

    None where there is none, or where in some rig it has no weight to speak of.
    """
    count = _memory_count(values.model)
    if values.model.inertial or not count:
        return None
    numbers = _numbers(values.model, values.arguments, sigma)
    with np.errstate(all="ignore"):
        shares = [float(np.nanmin(np.abs(numbers[2 + i] / numbers[0]), initial=np.inf)) for i in range(count)]
    for i in np.argsort(shares)[::-1]:
        if shares[i] >= LEAST_WEIGHT and reduce_model(values.model, int(i)).form == "eliminated":
            return int(i)
    return None


def natural_scales(reduction: Reduction, arguments: tuple[Any, ...], sigma: Any) -> tuple[dict[str, Any], Any]:
    """The size of each state variable that matters: one e-fold of velocity's worth, or a slip distance.

    By name; and the size of the unknown that is left to solve for, which has no name among them.
    """
    model = reduction.model
    numbers = _numbers(model, arguments, sigma)
    count = _memory_count(model)
    drive = np.asarray(dict(zip(model.parameters, arguments, strict=True))["drive.velocity"], dtype=float)
    with np.errstate(all="ignore"):
        direct = np.abs(numbers[0])
        distances = [drive / np.abs(n) for n in numbers[2 + count : 2 + 2 * count]]
        distances.append(direct / np.abs(numbers[1]))
        finite = [np.where(np.isfinite(d) & (d > 0), d, np.inf) for d in distances]
        x = np.minimum.reduce(np.broadcast_arrays(*finite))
        x = np.where(np.isfinite(x), x, np.abs(drive))
    scales: dict[str, Any] = {"x": x, "w": drive if reduction.velocity == "linear" else 1.0}
    names = [m.name for m in model.variables if m.name not in ("x", "v", "integral")]
    for i, name in enumerate(names):
        with np.errstate(all="ignore"):
            scale = direct / np.abs(numbers[2 + i])
        own = np.abs(numbers[2 + 2 * count + i])
        scale = np.where(np.isfinite(scale) & (scale > 0), scale, np.where(own > 0, own, 1.0))
        scales[name] = np.minimum(scale, np.where(own > 0, np.maximum(own, scale * 1e-3), scale))
    scales["integral"] = x * x / drive
    return scales, drive**2 / x if reduction.model.inertial else scales["w"]


# -- where a run starts


@lru_cache(maxsize=64)
def _steady_memory(model: Model) -> Callable[..., list[Any]]:
    memory = [m.symbol for m in model.variables if m.name not in ("x", "v", "integral")]
    return array_function([*model.parameters.values(), model.sigma_ss], [model.steady[m] for m in memory])


@lru_cache(maxsize=64)
def _velocity_variable(reduction: Reduction) -> Callable[..., list[Any]]:
    model = reduction.model
    memory = [m.symbol for m in model.variables if m.name not in ("x", "v", "integral")]
    arguments = [*model.parameters.values(), model.sigma_ss, model.symbols["v"], *memory]
    return array_function(arguments, [reduction.w_of_v])


@lru_cache(maxsize=64)
def _balance(reduction: Reduction, index: int) -> Callable[..., list[Any]]:
    """The balance of a massless model before the protocol begins, and its slope in one memory variable."""
    model = reduction.model
    memory = [m.symbol for m in model.variables if m.name not in ("x", "v", "integral")]
    if reduction.restart is None:
        raise InternalError("reduction.restart is not None")
    at_rest = {V_LP: model.parameters["drive.velocity"], Q: sp.Integer(0), P: sp.Integer(0), TIME: sp.Integer(0)}
    expression = reduction.restart.xreplace({W: reduction.w_of_v}).xreplace(at_rest)
    arguments = [*model.parameters.values(), model.sigma_ss, model.symbols["x"], model.symbols["v"], *memory]
    if reduction.model.symbols.get("integral") is not None:
        expression = expression.xreplace({model.symbols["integral"]: sp.Integer(0)})
    return array_function(arguments, [expression, sp.diff(expression, memory[index])])


def initial_values(
    reduction: Reduction, values: Values, sigma: np.ndarray, given: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Continuous variables at the start and the velocity there.

    Steady sliding, unless a variable is given. Without mass, a given velocity needs a memory that goes with
    it: the first memory variable that is not given itself follows from the balance of forces.
    """
    model = reduction.model
    names = [m.name for m in model.variables if m.name not in ("x", "v", "integral")]
    drive = values.named()["drive.velocity"]
    start = _checked_initial(given, names, model)
    with np.errstate(all="ignore"):
        steady = _steady_memory(model)(*values.arguments, sigma)
    memory = [np.asarray(start.get(name, value), dtype=float) for name, value in zip(names, steady, strict=True)]
    x = np.asarray(start.get("x", 0.0), dtype=float)
    v = np.asarray(start.get("v", drive), dtype=float)
    if reduction.velocity == "logarithm" and not np.all(v > 0):
        raise ParameterError([Problem("initial.v", f"got {given.get('v')!r}; allowed: > 0 m/s with this law")])
    if not model.inertial and "v" in start:
        free = [i for i, name in enumerate(names) if name not in start]
        if not free:
            message = "cannot be given: without mass it follows from the memory; give the memory or the velocity"
            raise ParameterError([Problem("initial.v", message)])
        memory[free[0]] = _matching_memory(reduction, values, sigma, x, v, memory, free[0])
    columns = []
    for symbol in reduction.continuous:
        if symbol is model.symbols["x"]:
            columns.append(x)
        elif symbol is W:
            columns.append(_velocity_variable(reduction)(*values.arguments, sigma, v, *memory)[0])
        elif symbol is model.symbols.get("integral"):
            columns.append(np.asarray(start.get("integral", 0.0), dtype=float))
        else:
            columns.append(memory[[m.symbol for m in model.variables if m.name in names].index(symbol)])
    arrays = np.broadcast_arrays(*(np.atleast_1d(c) for c in columns))
    return np.ascontiguousarray(np.column_stack(arrays).astype(float)), np.atleast_1d(v)


def _checked_initial(given: Mapping[str, Any], memory: list[str], model: Model) -> dict[str, np.ndarray]:
    known = ["x", "v", *memory, *(["integral"] if "integral" in model.symbols else [])]
    problems, found = [], {}
    for name, value in given.items():
        if name not in known:
            problems.append(Problem(f"initial.{name}", unknown_name("variable", name, known)))
            continue
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        if not np.all(np.isfinite(array)):
            problems.append(Problem(f"initial.{name}", f"got {value!r}; allowed: finite numbers in SI units"))
        found[name] = array
    if problems:
        raise ParameterError(problems)
    return found


def _matching_memory(
    reduction: Reduction, values: Values, sigma: Any, x: Any, v: Any, memory: list[Any], index: int
) -> Any:
    """The memory variable that balances forces at a given velocity, by Newton's method (one step where linear)."""
    function = _balance(reduction, index)
    current = [np.asarray(m, dtype=float) for m in memory]
    for _ in range(60):
        with np.errstate(all="ignore"):
            residual, slope = function(*values.arguments, sigma, x, v, *current)
            change = residual / slope
        current[index] = current[index] - change
        if not np.any(np.abs(change) > 1e-15 * (1 + np.abs(current[index]))):
            break
    return current[index]


def _guess(reduction: Reduction, arguments: tuple[Any, ...], sigma: Any, initial: Any, velocity: Any) -> Any:
    """Where Newton's method starts."""
    model = reduction.model
    if model.inertial:
        return 0.0
    order = {symbol: i for i, symbol in enumerate(reduction.continuous)}
    memory = [initial[:, order[m.symbol]] for m in model.variables if m.name not in ("x", "v", "integral")]
    with np.errstate(all="ignore"):
        return _velocity_variable(reduction)(*arguments, sigma, velocity, *memory)[0]
