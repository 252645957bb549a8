"""Measures: quantities of a map, computed as named arrays of results from arrays of rig parameters.

A measure is a record like a law, registered under its word in ``[map] compute``, with its options as fields. `measure`
makes a measure from any other function of a rig.
"""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.domains import Domain, below_one, positive, steps, tolerance
from steadyslip.core.entries import Text
from steadyslip.core.errors import ParameterError, Problem, SteadyslipError, unknown_name
from steadyslip.core.records import FrozenRecord, option, parameter, setting
from steadyslip.linear import growth_rate
from steadyslip.linear.response import has_closed_form
from steadyslip.linear.spectrum import is_ill_posed, spectrum
from steadyslip.linear.status import WORDS as STATUS, status
from steadyslip.linear.stiffness import in_chunks
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.motion import simulate_many
from steadyslip.motion.many import event_names, event_unit
from steadyslip.motion.status import WORDS
from steadyslip.nonlinear.kicks.brackets import BEYOND, threshold_brackets
from steadyslip.nonlinear.kicks.kicks import KICKS, OF_MACHINES, kicks_of
from steadyslip.nonlinear.kicks.places import place_problems
from steadyslip.protocol import Protocol

SECONDS_A_STEP = 4e-8  # s, measured CPU time of an integration step in a lane; only sets the size of chunks
SECONDS_OF_DELAY = 1e-2  # s, measured CPU time to count the roots of a rig with delay; only sets the size of chunks
PROBES = 64  # number of points at which the cost of a map is estimated; chosen by trial
NOT_DONE = -1  # integer stored at points that are not computed yet
NOT_SLIDING = "no steady sliding, or out of range"
"""`Output.missing` of results that need steady sliding; the result `status` distinguishes the two reasons."""
NO_EDGE = "no steady sliding, out of range, or no edge"
"""`Output.missing` of results that need an edge; no edge: stable, or unstable, at every value. Summaries analyse rigs
at some of the points to find the reason."""


@dataclass(frozen=True)
class Output:
    """Declaration of one array of a measure.

    Attributes
    ----------
    name, unit, meaning : str
    flags : tuple of str
        Meanings of the numbers 0, 1, ... of an array of small integers, which is -1 at points not computed yet; empty
        for an array of floats.
    extra : tuple of (str, int)
        Name and size of each dimension besides those of the map.
    missing : str
        Reason, for figures and summaries, why a point has no value: `NOT_SLIDING`, `NO_EDGE`, or words such as "does
        not hunt"; empty if every point has a value.
    infinite : str
        Meaning of an infinite value, in words; empty if values are always finite.
    """

    name: str
    unit: str
    meaning: str
    flags: tuple[str, ...] = ()
    extra: tuple[tuple[str, int], ...] = ()
    missing: str = ""
    infinite: str = ""

    @property
    def dtype(self) -> str:
        return "int8" if self.flags else "float64"

    @property
    def fill(self) -> float:
        return NOT_DONE if self.flags else np.nan


class Measure(FrozenRecord, family="measure"):
    """Base class of the quantities of a map.

    A subclass is registered under a name, declares its `outputs` and computes them in `arrays`. The result at a point
    must depend only on its parameters, not on the other points computed in the same call. Arrays that are shorter than
    declared along extra dimensions are padded.
    """

    moves: ClassVar[bool] = False
    """True if the measure simulates the protocol; otherwise varied protocol parameters are not passed to it."""
    held: ClassVar[bool | None] = False
    """True if the measure is for rigs that hold a place, False if for rigs that slide steadily, None if for both."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        """Declarations of the result arrays, for a map in which the named parameters vary."""
        raise NotImplementedError

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        """Result arrays by output name; `vary` has parameter arrays (SI units) that broadcast against each other."""
        raise NotImplementedError

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        """Yield a Problem for each reason why the measure cannot be computed for this rig."""
        yield from ()

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        """Estimated CPU time per point (s); `probes` has parameter values at some points of the map.

        Must be reproducible (not measured), because the same map must always get chunks of the same size.
        """
        present = [name for name in probes if name in rig.parameters()]
        model = operating_point(rig, None, present).model
        if model.delays:
            return SECONDS_OF_DELAY
        # measured CPU times (s): closed form; eigenvalues of a block; eigenvalues of a machine
        return 1.2e-7 if has_closed_form(model) else 4e-6 if model.is_single else 2e-5

    def definition(self) -> dict[str, Any]:
        """Name and options as a JSON-ready dict, which is equal for equal measures."""
        options = {item.name: getattr(self, item.name) for item in fields(self)}
        found = {"name": self.name, **{name: value for name, value in options.items() if value is not None}}
        if not type(self).__module__.startswith("steadyslip."):
            found["text"] = source_digest(type(self))
        return found


class GrowthRate(Measure, name="growth_rate"):
    """Largest real part of the eigenvalues (1/s); see `steadyslip.growth_rate`."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        meaning = "growth rate of small disturbances"
        return (Output("growth_rate", "1/s", meaning, missing=NOT_SLIDING, infinite="ill-posed"),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        return {"growth_rate": growth_rate(rig, vary)}


class Frequency(Measure, name="frequency"):
    """Frequency and damping ratio of the leading mode; 0 and ±1 where it does not oscillate, NaN where ill-posed."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        return (
            Output("frequency", "Hz", "frequency of the leading mode", missing=NOT_SLIDING),
            Output("damping_ratio", "1", "damping ratio of the leading mode", missing=NOT_SLIDING),
        )

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        found = np.asarray(in_chunks(operating_point(rig, vary), _leading))
        return {"frequency": found[..., 0], "damping_ratio": found[..., 1]}


def _leading(point: OperatingPoint) -> Any:
    """Frequency (Hz) and damping ratio of the rightmost eigenvalue, (..., 2)."""
    found = np.asarray(spectrum(point))
    with np.errstate(all="ignore"):
        first = np.argmax(np.where(np.isnan(found.real), -np.inf, found.real), axis=-1)
        s = np.take_along_axis(found, first[..., None], axis=-1)[..., 0]
        # rigs that are ill-posed or have no steady sliding have no frequency
        s = np.where(is_ill_posed(point) | np.isnan(s.real), complex(np.nan, np.nan), s)
        return np.stack([np.abs(s.imag) / (2 * np.pi), -s.real / np.abs(s)], axis=-1)


class StabilityStatus(Measure, name="status"):
    """Stability of steady sliding: stable, unstable (ill-posed included), or no steady sliding."""

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        return (Output("status", "1", "stability of steady sliding", STATUS),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        values = operating_point(rig, vary)
        found = [
            np.broadcast_to(status(part), part.shape).reshape(-1) for part in values.pieces(2**15)
        ]  # bounds memory
        return {"status": np.concatenate(found).reshape(values.shape)}


small = Domain(0, 0.1, False, True, "a number > 0 and <= 0.1")


class Events(Measure, name="events"):
    """Statistics of slip events under the protocol; see `steadyslip.simulate_many`."""

    moves = True
    until: float | None = parameter("s", positive, "end of every run; that of the protocol unless given", default=None)
    method: str = option("auto", "explicit", "rosenbrock", doc="of integration", default="auto")
    rtol: float = parameter("1", tolerance, "error allowed per step", default=1e-7)
    arrest: float = parameter("1", below_one, "velocity over the drive's below which a block is held", default=1e-3)
    most_steps: float = parameter("1", steps, "steps after which a run is given up", default=1_000_000)

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        ended: tuple[Output, ...] = (
            Output("outcome", "1", "how the run ended", tuple(WORDS)),
            Output("end_time", "s", "time reached"),
        )
        if rig.contact_names:
            meaning = "contact that was lost where a run ended so"
            ended = (*ended, Output("outcome_contact", "1", meaning, ("none", *rig.contact_names)))
        meant = (Output(name, event_unit(name), _meaning(name)) for name in event_names(rig))
        return (*ended, *meant)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        found = self._run(rig, protocol, vary)
        ended = {"outcome": found.status_code, "end_time": found.end}
        return {**ended, **_contact_numbers(rig, "outcome_contact", found.contact), **found.events}

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        if self.until is None and protocol.until is None:
            message = "missing; give the end of the runs, such as '200 s', here or in [protocol]"
            yield Problem("until", message)

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        found = self._run(rig, protocol, probes)
        return float(np.mean(found.steps + found.rejected)) * SECONDS_A_STEP + 1e-6  # 1 µs to prepare a run

    def _run(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Any:
        seen = tuple(f"{name}.normal_force" for name in rig.contact_names)
        return simulate_many(
            rig, vary, protocol, until=self.until, observables=seen, method=self.method, rtol=self.rtol,
            most_steps=int(self.most_steps), arrest=self.arrest, threads=1, progress=False,
        )  # fmt: skip


def _contact_numbers(rig: Slider | Machine, name: str, contact: np.ndarray) -> dict[str, np.ndarray]:
    """Array of contact names as numbers from 0 (none), for the output `name`; empty dict for a slider."""
    if not rig.contact_names:
        return {}
    numbers = {own: number for number, own in enumerate(("", *rig.contact_names))}
    return {name: np.vectorize(numbers.__getitem__, otypes=[int])(contact)}


def _meaning(name: str) -> str:
    """Meaning of a column of event statistics, from its name: words, and the contact of a machine."""
    contact, _, plain = name.rpartition(".")
    return plain.replace("_", " ") + (f" of {contact}" if contact else "")


class KickThreshold(Measure, name="threshold"):
    """Smallest kick that steady sliding does not survive; see `steadyslip.threshold_map`."""

    kick: str = option(*dict.fromkeys([*KICKS, *OF_MACHINES]), doc="kind of kick", default="velocity")
    at: str | None = setting(Text("of a machine: the body or contact that is kicked"), default=None)
    reverse: bool = option(False, True, doc="slower, backward, pressed less", default=False)
    reference: str = option(
        "before", "after", doc="whether the drive's velocity is that before or after a velocity step", default="before"
    )
    precision: float = parameter("1", small, "relative, of the size found", default=1e-4)

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        lost = "contact that is lost beyond, or fastest in a blow-up"
        names = ("none", *rig.contact_names) if rig.contact_names else ()
        meaning = f"size of the smallest {self.kick} kick not survived, not given where undecided"
        return (
            Output("threshold", "1", meaning, infinite="no kick in the range fails"),
            Output("threshold_low", "1", f"size up to which {self.kick} kicks are known to be survived"),
            Output("threshold_high", "1", f"size of the smallest {self.kick} kick known not to be survived"),
            Output("threshold_limit", "1", f"what limits the {self.kick} kicks that are survived", BEYOND),
            *((Output("threshold_contact", "1", lost, names),) if names else ()),
        )

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        direction = -1 if self.reverse else 1
        found, _, _ = threshold_brackets(
            rig, vary, self.kick, at=self.at, direction=direction, reference=self.reference, precision=self.precision,
            threads=1, progress=False,
        )  # fmt: skip
        numbers = {"threshold": found.size, "threshold_low": found.low, "threshold_high": found.high}
        kinds = {"threshold_limit": found.beyond} | _contact_numbers(rig, "threshold_contact", found.contact)
        return numbers | kinds

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        if self.kick not in (known := kicks_of(rig)):
            yield Problem("kick", unknown_name("kick", self.kick, known))
        else:
            yield from place_problems(rig, self.kick, self.at)
        if operating_point(rig).model.delays:
            yield Problem("", "is not offered with a delay")

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        return 5e-3  # measured


@dataclass(frozen=True)
class FunctionMeasure:
    """Measure that calls a function of a rig; `measure` makes it."""

    name: str
    function: Callable[..., Any]
    unit: str = "1"
    takes_arrays: bool = False
    cost: float = 1e-3
    moves: ClassVar[bool] = False
    held: ClassVar[bool | None] = None

    def outputs(self, rig: Slider | Machine, varied: Sequence[str]) -> tuple[Output, ...]:
        return (Output(self.name, self.unit, self.name.replace("_", " ")),)

    def arrays(self, rig: Slider | Machine, protocol: Protocol, vary: Vary) -> Mapping[str, Any]:
        if self.takes_arrays:
            return {self.name: self.function(rig, vary)}
        shape = np.broadcast_shapes(*(np.shape(a) for a in vary.values()))
        columns = {name: np.broadcast_to(a, shape).reshape(-1) for name, a in vary.items()}
        size = int(np.prod(shape, dtype=int))
        found = np.array([self._at(rig, {n: float(c[i]) for n, c in columns.items()}) for i in range(size)])
        return {self.name: found.reshape(shape)}

    def _at(self, rig: Slider | Machine, point: dict[str, float]) -> float:
        """Result at one point; NaN for errors of this package, while other exceptions are reported with the point."""
        try:
            return float(self.function(rig.with_values(point)))
        except SteadyslipError:
            return np.nan
        except Exception as error:
            where = ", ".join(f"{name} = {value!r}" for name, value in point.items())
            message = f"failed with {type(error).__name__}: {error}; at {where}"
            raise ParameterError([Problem(f"map.compute.{self.name}", message)]) from error

    def problems(self, rig: Slider | Machine, protocol: Protocol) -> Iterator[Problem]:
        yield from ()

    def seconds(self, rig: Slider | Machine, protocol: Protocol, probes: Vary) -> float:
        return self.cost

    def definition(self) -> dict[str, Any]:
        return {
            "name": self.name, "function": getattr(self.function, "__qualname__", ""), "unit": self.unit,
            "text": source_digest(self.function),
        }  # fmt: skip


def source_digest(thing: Any) -> str:
    """Hash (16 hexadecimal digits) of a function or class: source and values in closure, defaults and attributes."""
    if isinstance(thing, partial):
        text = f"{source_digest(thing.func)} {thing.args!r} {sorted(thing.keywords.items())!r}"
    else:
        written = thing if inspect.isroutine(thing) or isinstance(thing, type) else type(thing)
        try:
            text = inspect.getsource(written)
        except (OSError, TypeError):  # there is no source code: typed at a prompt, or compiled
            code = getattr(thing, "__code__", None)
            text = repr((code.co_code, code.co_consts, code.co_names)) if code else repr(written)
        held = [getattr(thing, name, None) for name in ("__defaults__", "__kwdefaults__")]
        held += [cell.cell_contents for cell in getattr(thing, "__closure__", None) or ()]
        if written is not thing:
            held += sorted(getattr(thing, "__dict__", {}).items())
        text += repr(held)
    return hashlib.sha256(re.sub(r" at 0x[0-9a-f]+", "", text).encode()).hexdigest()[:16]


def measure(
    function: Callable[..., Any] | None = None,
    *,
    name: str | None = None,
    unit: str = "1",
    arrays: bool = False,
    seconds: float | None = None,
) -> Any:
    """Make a measure from a function of a rig; usable as a decorator.

    Parameters
    ----------
    function : callable
        ``function(rig)`` returns a number; NaN, or an exception of this package, means no value. With `arrays`,
        ``function(rig, vary)`` returns an array for broadcastable parameters by dotted name. The result must depend on
        nothing else, because maps are computed in several processes and may be continued later; a hash of the
        function's source and values detects changes.
    name : str, optional
        Name of the array; by default that of the function.
    unit : str
    arrays : bool
        True if the function takes arrays.
    seconds : float, optional
        CPU time per point; by default 1 ms (1 µs with `arrays`). Determines the size of chunks.

    Returns
    -------
    FunctionMeasure

    Examples
    --------
    >>> @ss.maps.measure(unit="Pa/m")
    ... def double(rig):
    ...     return 2 * ss.critical_stiffness(rig)
    >>> double.name
    'double'
    """
    if function is None:
        return lambda f: measure(f, name=name, unit=unit, arrays=arrays, seconds=seconds)
    problems = []
    if not callable(function):
        problems.append(Problem("measure", f"got {function!r}; allowed: a function of a rig"))
    label = str(name or getattr(function, "__name__", ""))
    if not label.isidentifier():
        problems.append(Problem("measure", f"got the name {label!r}; give a name=... of letters, digits and _"))
    if seconds is not None and not seconds > 0:
        problems.append(Problem("measure", f"got seconds={seconds!r}; allowed: a number > 0"))
    if problems:
        raise ParameterError(problems)
    return FunctionMeasure(label, function, unit, arrays, seconds or (1e-6 if arrays else 1e-3))
