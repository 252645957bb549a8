"""How steady sliding answers an input that swings for ever: gain, phase, mean and distortion, small and large."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.format import format_quantity
from steadyslip.core.options import FLAG, NAME, NUMBERS, checked
from steadyslip.core.pictures import draw
from steadyslip.core.progress import progress_bar
from steadyslip.core.records import parameters
from steadyslip.core.results import ReadOnly
from steadyslip.files.output import write_text
from steadyslip.linear.state_space import state_matrices
from steadyslip.linear.stiffness import growth_rate
from steadyslip.machine.input_units import unit_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model, build_model
from steadyslip.motion import simulate
from steadyslip.protocol import DisturbanceHarmonic, InjectionHarmonic, NormalStressHarmonic, VelocityHarmonic
from steadyslip.protocol.shapes import Harmonic

Array = np.ndarray
INPUTS = {"drive-velocity": "", "normal-stress": ".press", "push": ".push", "injection": ".pores"}
"""What swings, and how a machine's input of that kind is named behind its body or contact."""
PIECES: dict[str, type[Harmonic]] = {
    "drive-velocity": VelocityHarmonic, "normal-stress": NormalStressHarmonic, "push": DisturbanceHarmonic,
    "injection": InjectionHarmonic,
}  # fmt: skip
OF_SLIDERS = {
    "drive-velocity": "load_velocity", "normal-stress": "normal_disturbance", "push": "disturbance",
}  # fmt: skip
SAMPLES = 256  # a period: harmonics up to the 127th are told apart
LEAST_PERIODS, MOST_PERIODS = 10, 2560  # waited for; twice as many each time
SETTLED = 1e-7  # two periods that differ by less, of the range of the output, are the same
FAINT = 1e-5  # of its range, by which an output may be uncertain that swings little beside errors of integration
ROUGHLY = 1e-4  # the same for limits, which are told to a twentieth
DEPARTED = 0.05  # a gain this far from that of small amplitudes is no longer linear
LEAST_SHARE, MOST_SHARE = 1e-3, 0.99  # amplitudes tried for limits, of the steady value: just before it changes sign
HALVINGS = 7  # of the logarithm of amplitude between smallest and largest: limits are right to 6 %
COMPARED = 5  # periods at the end that are compared: repetition up to every 4th is seen
PERIODIC, NOT_SETTLED, IRREGULAR = "periodic", "not settled", "irregular"


@dataclass(frozen=True, eq=False)
class FrequencyResponse(ReadOnly):
    """Answer of one output to one input that swings about its steady value.

    Attributes
    ----------
    rig : Slider or Machine
    input, output : str
        As in `steadyslip.build_model`: a name of ``inputs``, and one of ``observables``.
    units : tuple of str
        Of input and output.
    periods : ndarray (n,)
        s.
    gain, phase : ndarray (n,)
        Of small amplitudes, from the linearised equations: amplitude of the output over that of the input, and by how
        much it leads, degrees from -180 to 180.
    amplitudes : ndarray (m,)
        Of the input, where motion was simulated; may be empty.
    gains, phases : ndarray (m, n)
        At these amplitudes: of the output's part that swings with the input's period.
    shift : ndarray (m, n)
        Mean of the output less its steady value.
    mean_friction : ndarray (m, n)
        Mean friction over mean normal stress (or force), of the slider or of the contact whose output it is; else NaN.
    distortion : ndarray (m, n)
        Root of the sum of squares of all higher harmonics, over the amplitude of the first.
    status : ndarray of str (m, n)
        ``periodic``, ``every 2nd period`` and so on, ``irregular``, ``not settled``, or how the motion ended
        (``blow-up``, ``contact lost``, ...); numbers are NaN where it did.
    linear_to, lost_at : ndarray (n,)
        Amplitude up to which the gain is within 5 % of that of small ones, and amplitude at which steady sliding is
        lost: motion ends, or no longer repeats with the input. NaN where not asked for, and inf where larger than the
        steady value of what swings.
    stable : bool
        Whether steady sliding is stable; if not, no small periodic answer is ever reached.
    """

    rig: Slider | Machine = field(repr=False)
    input: str
    output: str
    units: tuple[str, str]
    periods: Array = field(repr=False)
    gain: Array = field(repr=False)
    phase: Array = field(repr=False)
    amplitudes: Array = field(repr=False)
    gains: Array = field(repr=False)
    phases: Array = field(repr=False)
    shift: Array = field(repr=False)
    mean_friction: Array = field(repr=False)
    distortion: Array = field(repr=False)
    status: Array = field(repr=False)
    linear_to: Array = field(repr=False)
    lost_at: Array = field(repr=False)
    stable: bool = True

    @property
    def resonance(self) -> tuple[float, float] | None:
        """Period (s) and gain of the largest small-amplitude answer; None where that lies at an end of the periods."""
        best = int(np.argmax(self.gain))
        if best in (0, len(self.gain) - 1):
            return None
        return float(self.periods[best]), float(self.gain[best])

    def __str__(self) -> str:
        unit = _ratio(*self.units)
        lines = [f"{self.output} under {self.input}: gain and phase of small amplitudes"]
        if not self.stable:
            lines.append("  steady sliding is UNSTABLE: this answer is never reached, any disturbance outgrows it")
        for i in _some(len(self.periods)):
            lines.append(
                f"  {format_quantity(self.periods[i], 's'):>12}  {self.gain[i]:.5g}{unit}  {self.phase[i]:.4g} deg"
            )
        if (found := self.resonance) is not None:
            lines.append(f"resonance  period {format_quantity(found[0], 's')}, gain {found[1]:.5g}{unit}")
        for j, amplitude in enumerate(self.amplitudes):
            lines.append(f"amplitude {format_quantity(amplitude, self.units[0])}")
            for i in _some(len(self.periods)):
                lines.append(f"  {format_quantity(self.periods[i], 's'):>12}  {self._at(j, i)}")
        lines += self._limits()
        return "\n".join(lines)

    def _at(self, j: int, i: int) -> str:
        if self.status[j, i] != PERIODIC:
            return str(self.status[j, i])
        return (
            f"{self.gains[j, i]:.5g}{_ratio(*self.units)}  {self.phases[j, i]:.4g} deg, mean shifted by "
            f"{format_quantity(self.shift[j, i], self.units[1])}, distortion {100 * self.distortion[j, i]:.3g} %"
        )

    def _limits(self) -> list[str]:
        lines = []
        limits = (("linear to within 5 % up to", self.linear_to), ("steady sliding is lost from", self.lost_at))
        for words, found in limits:
            if np.any(np.isfinite(found)):
                least = int(np.nanargmin(found))
                place = format_quantity(self.periods[least], "s")
                lines.append(
                    f"{words} an amplitude of {format_quantity(found[least], self.units[0])}, at period {place}"
                )
            elif np.any(np.isinf(found)):
                lines.append(f"{words} no amplitude below the steady value")
        return lines

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units; what does not exist is null."""
        arrays = ("periods", "gain", "phase", "amplitudes", "gains", "phases", "shift", "mean_friction", "distortion",
                  "linear_to", "lost_at")  # fmt: skip
        return {
            "input": self.input, "output": self.output, "units": list(self.units), "stable": self.stable,
            **{name: _plain(getattr(self, name)) for name in arrays}, "status": self.status.tolist(),
        }  # fmt: skip

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write one row for each period and amplitude; amplitude 0 stands for small ones.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        unit = _ratio(*self.units).strip() or "1"
        titles = (f"amplitude ({self.units[0]})", "period (s)", f"gain ({unit})", "phase (deg)",
                  f"shift ({self.units[1]})", "distortion (1)", "status")  # fmt: skip
        rows: list[tuple[Any, ...]] = [titles]
        rows += [(0, *one, 0, 0, "linear") for one in zip(self.periods, self.gain, self.phase, strict=True)]
        for j, amplitude in enumerate(self.amplitudes):
            columns = (self.gains[j], self.phases[j], self.shift[j], self.distortion[j], self.status[j])
            rows += [(amplitude, *one) for one in zip(self.periods, *columns, strict=True)]
        words = (",".join(one if isinstance(one, str) else f"{one:.12g}" for one in row) for row in rows)
        write_text(path, "\n".join([*words, ""]))

    def plot(self, ax: Any = None) -> Any:
        """Draw gain and phase over the period; see `steadyslip.figures.frequency_response`."""
        return draw(self, ax=ax)


def _ratio(given: str, answered: str) -> str:
    """Unit of a gain, with a blank before it; none where both are alike."""
    return "" if given == answered else f" {answered}/({given})"


def _some(count: int) -> list[int]:
    """Places of at most nine lines of a table."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, 9))})


def _plain(values: Array) -> Any:
    """Nested lists, null for what is no number."""
    found = values.astype(object)
    found[~np.isfinite(values)] = None
    return found.tolist()


@checked(periods=NUMBERS, amplitudes=NUMBERS, input=NAME, output=NAME, on=NAME, limits=FLAG)
def response(
    rig: Slider | Machine,
    periods: Any,
    *,
    input: str = "normal-stress",
    output: str | None = None,
    on: str | None = None,
    amplitudes: Any = (),
    limits: bool = False,
    rtol: float = 1e-9,
    progress: bool | None = None,
) -> FrequencyResponse:
    """Answer of steady sliding to an input that swings as a sine for ever.

    Parameters
    ----------
    rig : Slider or Machine
    periods : array_like
        s, rising.
    input : str, optional
        What swings: ``normal-stress`` (added to that of the contact), ``drive-velocity``, ``push`` (a stress on the
        block, or force on a body) or ``injection`` (pressure of the fluid around a contact).
    output : str, optional
        What answers: an observable of the Model, ``friction``, ``shear-stress``, ``v``, ...; of a machine with the
        name of its contact or body, ``guide.friction``. Unless given friction, of the first contact.
    on : str, optional
        Of a machine: the contact that is pressed or injected at, or the body that is pushed; needed where there are
        several.
    amplitudes : array_like, optional
        Amplitudes of the input (SI) at which motion is simulated until it repeats.
    limits : bool, optional
        Whether to look, at every period, for the amplitudes up to which the gain is linear to within 5 % and from which
        steady sliding is lost.
    rtol : float, optional
        Relative tolerance of the simulations.
    progress : bool, optional
        Whether to show progress; on a terminal unless given.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    UnknownNameError
        If there is no such input or output.
    ParameterError
        If it is open what swings, or a number is wrong.
    NoSteadySliding
        If there is nothing to swing about.
    NotAvailable
        If the rig has a delay, or numbers leave the range of floating point.

    Notes
    -----
    Small amplitudes: G(iω) = C(iω − A)⁻¹B + D of `state_space`, exact. Large ones: the motion is run for 10 periods,
    or as long as transients of small amplitude last, and for twice as long until two periods agree to 1e-7 of their
    range; the last one is taken apart by a discrete Fourier transform.

    Examples
    --------
    >>> import steadyslip as ss
    >>> rock = ss.RateState(a=.010, b=.008, d_c=1e-5, mu_ref=.6, v_ref=1e-5,
    ...                     normal_memory=ss.LinkerDieterich(alpha=.2))
    >>> rig = ss.Slider(friction=rock, contact=ss.Constant(preload=25e6), stiffness=1e10, drive=ss.Steady(1e-5))
    >>> found = ss.response(rig, [1.0, 10.0, 100.0], output="shear-stress")
    >>> found.gain.round(4)
    array([0.0263, 0.6899, 0.6038])
    """
    forced = _Forced(rig, input, on, output, rtol)
    periods = _rising(periods)
    amplitudes = np.ravel(np.asarray(amplitudes, dtype=float))
    if np.any(amplitudes <= 0):
        raise ParameterError([Problem("amplitudes", f"got {amplitudes.min():g}; allowed: numbers > 0, in SI units")])
    answer = forced.linear(periods)
    shape = (len(amplitudes), len(periods))
    numbers = np.full((len(_NUMBERS), *shape), np.nan)
    status = np.full(shape, "", dtype=object)
    bounds = np.full((2, len(periods)), np.nan)
    total = amplitudes.size * periods.size + (periods.size if limits else 0)
    with progress_bar(total, progress if total else False, "answers") as step:
        for i, period in enumerate(periods):
            for j, amplitude in enumerate(amplitudes):
                status[j, i], numbers[:, j, i] = forced.swung(amplitude, period)
                if step:
                    step(1)
            if limits:
                bounds[:, i] = forced.limits(period, abs(answer[i]))
                if step:
                    step(1)
    found = dict(zip(_NUMBERS, numbers, strict=True))
    return FrequencyResponse(
        rig, forced.name, forced.output, forced.units, periods, np.abs(answer), np.degrees(np.angle(answer)),
        amplitudes, **found, status=status.astype(str), linear_to=bounds[0], lost_at=bounds[1],
        stable=bool(growth_rate(rig) < 0),
    )  # fmt: skip


_NUMBERS = ("gains", "phases", "shift", "mean_friction", "distortion")


def amplitude_unit(rig: Slider | Machine, input: str = "normal-stress", on: str | None = None) -> str:
    """SI unit of an amplitude: that of the input on this rig."""
    return _Forced(rig, input, on, None, 1e-9).units[0]


def _rising(periods: Any) -> Array:
    found = np.ravel(np.asarray(periods, dtype=float))
    if np.any(found <= 0) or np.any(np.diff(found) <= 0):
        raise ParameterError([Problem("periods", "allowed: numbers > 0 that rise, in s")])
    return found


class _Forced:
    """One input and one output of a rig."""

    def __init__(self, rig: Slider | Machine, input: str, on: str | None, output: str | None, rtol: float) -> None:
        self.rig, self.kind, self.rtol = rig, input.replace("_", "-"), rtol
        model = build_model(rig)
        if self.kind not in INPUTS:
            raise UnknownNameError("input", input, INPUTS)
        self.name, self.on = self._input(model, on)
        self.output = self._output(model, output)
        piece = self._piece(1.0, 1.0)
        unit = next(a.role.unit for name, a in parameters(piece).items() if name == "amplitude")
        self.units = (unit_of(rig, piece, unit), model.observables[self.output][1])
        start = simulate(rig, until=1.0, times=[0.0], events=False)
        self.steady = {name: float(start[name][0]) for name in model.observables}
        self.decay = float(growth_rate(rig))

    def _input(self, model: Model, on: str | None) -> tuple[str, str | None]:
        """The Model's name of what swings, and the body or contact it acts on."""
        ending = INPUTS[self.kind]
        if self.kind == "drive-velocity":
            return "load_velocity", None
        if isinstance(self.rig, Slider) and self.kind in OF_SLIDERS:
            return OF_SLIDERS[self.kind], None
        possible = [name.removesuffix(ending) for name in model.inputs if name.endswith(ending)]
        if on is None and len(possible) == 1:
            on = possible[0]
        if on not in possible:
            if not possible:
                raise NotAvailable(f"this rig has nothing that an input of kind {self.kind} acts on")
            came = "missing" if on is None else f"got {on!r}"
            raise ParameterError([Problem("on", f"{came}; allowed: {', '.join(possible)}")])
        return on + ending, on or None

    def _output(self, model: Model, output: str | None) -> str:
        if output is None:
            return next(name for name in model.observables if name.rpartition(".")[2] == "friction")
        name = output if output in model.observables else output.replace("-", "_")
        if name not in model.observables:
            raise UnknownNameError("output", output, model.observables)
        return name

    def _piece(self, amplitude: float, period: float) -> Harmonic:
        on: dict[str, Any] = {} if self.on is None else {"on": self.on}
        return PIECES[self.kind](amplitude=amplitude, period=period, **on)

    def linear(self, periods: Array) -> Array:
        """G(iω) at each period, complex."""
        found = state_matrices(self.rig, (self.output,), (self.name,))
        a, b, c, d = found.blocks()
        swing = 2j * np.pi / periods
        inner = np.linalg.solve(swing[:, None, None] * np.eye(len(a)) - a, np.broadcast_to(b, (len(periods), *b.shape)))
        return np.asarray((c @ inner + d)[:, 0, 0])

    def swung(self, amplitude: float, period: float, settled: float = SETTLED) -> tuple[str, tuple[float, ...]]:
        """How the motion ends up, and the numbers of `_NUMBERS`, NaN where it does not."""
        waited = math.log(settled) / self.decay / period if self.decay < 0 else 0.0
        count = int(min(max(LEAST_PERIODS, math.ceil(waited)), MOST_PERIODS))
        nothing, before = (math.nan,) * len(_NUMBERS), math.inf
        while True:
            rtol = max(self.rtol, settled / 100) if settled > SETTLED else self.rtol
            columns, status = self._run(amplitude, period, count, rtol)
            if status != "done":
                return status, nothing
            swings = columns[self.output].reshape(COMPARED, SAMPLES)
            size = np.ptp(swings) or 1.0
            apart = [float(np.max(np.abs(swings[-1] - swings[-1 - k]))) / size for k in range(1, COMPARED)]
            rounding = min(FAINT, 100 * rtol * float(np.max(np.abs(swings))) / size)
            if apart[0] < max(settled, rounding):
                return PERIODIC, self._numbers(columns, swings[-1], amplitude)
            if count >= MOST_PERIODS:
                break
            before, count = apart[0], min(2 * count, MOST_PERIODS)
        for k, own in enumerate(apart[1:], start=2):
            if own < settled:
                return f"every {k}{'nd' if k == 2 else 'rd' if k == 3 else 'th'} period", nothing
        return (NOT_SETTLED if apart[0] < before / 2 else IRREGULAR), nothing

    def _run(self, amplitude: float, period: float, count: int, rtol: float) -> tuple[dict[str, Array], str]:
        """Observables over the last periods of so many, and how the run ended."""
        times = period * (count - COMPARED + np.arange(COMPARED * SAMPLES) / SAMPLES)
        run = simulate(
            self.rig, self._piece(amplitude, period), until=count * period, times=times, events=False, rtol=rtol
        )
        return {name: np.asarray(run[name]) for name in self.steady}, run.status

    def _numbers(self, columns: dict[str, Array], last: Array, amplitude: float) -> tuple[float, ...]:
        parts = np.fft.rfft(last) / (SAMPLES / 2)
        first = 1j * parts[1] / amplitude  # the input is a sine, which is -i e^(iωt)
        higher = math.sqrt(float(np.sum(np.abs(parts[2:]) ** 2))) / abs(parts[1]) if parts[1] else math.nan
        shift = float(np.mean(last)) - self.steady[self.output]
        friction = math.nan
        for shear, normal in (("shear_stress", "normal_stress"), ("friction_force", "normal_force")):
            own = self.output.rpartition(".")[0] + "." if "." in self.output else ""
            if own + shear in columns:
                means = [float(np.mean(columns[own + one][-SAMPLES:])) for one in (shear, normal)]
                friction = means[0] / means[1]
        return abs(first), float(np.degrees(np.angle(first))), shift, friction, higher

    def limits(self, period: float, gain: float) -> tuple[float, float]:
        """Amplitudes up to which the gain is linear, and from which steady sliding is lost."""
        most = MOST_SHARE * self._size()
        tried: dict[float, tuple[str, float]] = {}

        def at(amplitude: float) -> tuple[str, float]:
            if amplitude not in tried:
                status, numbers = self.swung(amplitude, period, ROUGHLY)
                tried[amplitude] = status, numbers[0]
            return tried[amplitude]

        def departs(amplitude: float) -> bool:
            status, own = at(amplitude)
            return status != PERIODIC or abs(own / gain - 1) > DEPARTED

        def lost(amplitude: float) -> bool:
            return at(amplitude)[0] not in (PERIODIC, NOT_SETTLED)

        return _edge(departs, most), _edge(lost, most)

    def _size(self) -> float:
        """What swings, in steady sliding: beyond it load or velocity would change sign."""
        if self.kind == "drive-velocity":
            return abs(float(self.rig.drive.velocity))
        normal, shear = ("normal_force", "friction_force") if "." in self.output else ("normal_stress", "shear_stress")
        wanted = shear if self.kind == "push" else normal
        own = f"{self.on}.{wanted}" if self.on is not None and f"{self.on}.{wanted}" in self.steady else None
        found = [abs(v) for name, v in self.steady.items() if name == own or (own is None and name.endswith(wanted))]
        return max(found)


def _edge(beyond: Callable[[float], bool], most: float) -> float:
    """The amplitude from which on something is so, by halving logarithms; inf if it is not up to the largest."""
    if not beyond(most):
        return math.inf
    low, high = most * LEAST_SHARE / MOST_SHARE, most
    if beyond(low):
        return low
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if beyond(middle) else (middle, high)
    return high
