"""Response of steady sliding to a sinusoidal input: gain, phase, mean and distortion, small and large amplitudes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.options import FLAG, NAME, NUMBERS, Measured, Tested, checked
from steadyslip.core.progress import progress_bar
from steadyslip.core.records import parameters
from steadyslip.linear.frequency import resonances, transfer
from steadyslip.linear.stiffness import growth_rate
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model, build_model
from steadyslip.model.point import operating_point
from steadyslip.model.range import delays_of
from steadyslip.motion import simulate
from steadyslip.nonlinear.frequency_response import IRREGULAR, NOT_SETTLED, PERIODIC, TOO_MANY_STEPS, FrequencyResponse
from steadyslip.protocol import DisturbanceHarmonic, InjectionHarmonic, NormalStressHarmonic, VelocityHarmonic
from steadyslip.protocol.pieces import Harmonic


class SwingingInput(NamedTuple):
    """Names of an oscillating input in the Model of a slider and of a machine, and the protocol piece for it."""

    slider: str  # such as "disturbance"; empty if a slider's input has only the ending as name, such as ".pores"
    machine: str  # ending after the name of a body or contact: ".push" of "table.push"; for the drive the whole name
    piece: type[Harmonic]


INPUTS = {
    "normal-stress": SwingingInput("normal_disturbance", ".press", NormalStressHarmonic),
    "drive-velocity": SwingingInput("load_velocity", "load_velocity", VelocityHarmonic),
    "push": SwingingInput("disturbance", ".push", DisturbanceHarmonic),
    "injection": SwingingInput("", ".pores", InjectionHarmonic),
}
SAMPLES = 256  # samples of the motion per period of the input: harmonics up to the 127th are resolved
LEAST_PERIODS, MOST_PERIODS = 10, 2560  # simulated periods: doubled from the first to the second until motion repeats
SETTLED = 1e-7  # largest difference of two periods, over the output's range, at which the motion counts as periodic
FAINT = 1e-5  # used instead of SETTLED where integration errors hide smaller differences, and after MOST_PERIODS
ROUGHLY = 1e-4  # used instead of SETTLED in the search for limits of amplitude, which are needed to 5 % only
DEPARTED = 0.05  # relative deviation from the small-amplitude gain at which the gain counts as nonlinear
MOST_FADED = 700.0  # largest exponent of e within the range of floating point
IRREGULARLY = 1e-2  # difference of periods, over the output's range, above which motion counts as irregular
TIGHTER, TIGHTEST = 100, 1e-12  # factor by which rtol is reduced where integration errors dominate, and least rtol
MOST_SHARE = 0.99  # largest amplitude tried for limits, over the input's steady value: just below a change of sign
DECADES = 3  # decades of amplitude below MOST_SHARE that are searched, and as many decades below these where needed
STEPS = 12  # number of amplitudes tried in that range, each 1.8 times the last: narrower windows may be missed
HALVINGS = 4  # bisections of the logarithm of amplitude within a step of amplitude: to 4 %
RISING = Measured(
    "numbers > 0 that rise", lambda given: _positive(given) and bool(np.all(np.diff(np.ravel(given)) > 0)), "s"
)
SIZES = Tested("numbers > 0, in SI units", lambda given: np.size(given) == 0 or _positive(given))
COMPARED = 5  # number of last periods that are compared: repetition up to every 4th is found


@checked(periods=RISING, amplitudes=SIZES, input=NAME, output=NAME, on=NAME, limits=FLAG)
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
    """Response of steady sliding to a sinusoidal input: gain and phase at each period, and limits of amplitude.

    Parameters
    ----------
    rig : Slider or Machine
    periods : array_like
        Periods of the input, s, rising.
    input : str, optional
        Oscillating input: ``normal-stress`` (added to that of the contact), ``drive-velocity``, ``push`` (a stress on
        the block, or force on a body) or ``injection`` (pressure of the fluid around a contact).
    output : str, optional
        Observable of the Model: ``friction``, ``shear-stress`` (or ``shear_stress``), ``v``, ...; of a machine with the
        name of its contact or body, ``guide.friction``. By default friction, at the first contact.
    on : str, optional
        Contact or body of a machine on which the input acts; needed where there are several.
    amplitudes : array_like, optional
        Amplitudes of the input (SI) at which motion is simulated until it repeats.
    limits : bool, optional
        True to search, at every period, for the amplitudes up to which the gain is linear to within 5 % and from which
        steady sliding is lost.
    rtol : float, optional
        Relative tolerance of the simulations.
    progress : bool, optional
        True to show progress; by default on a terminal only.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    UnknownNameError
        If there is no such input or output.
    ParameterError
        If `on` is needed and missing, or a number is not allowed.
    NoSteadySliding
        If there is no steady sliding about which the input could oscillate.
    NotAvailable
        If numbers leave the range of floating point.

    Notes
    -----
    Small amplitudes: G(iω) = C(iω − A)⁻¹B + D of `state_space`, exact; with a delay τ, forces get a factor e^(−iωτ).

    Large amplitudes: the motion is simulated for 10 periods, or as long as transients of small amplitude last, and
    again for twice as long, until two periods agree to 1e-7 of their range and the rest of a transient is as small;
    gain and phase follow from a discrete Fourier transform of the last period. After 2560 periods, and where
    integration errors are larger even with a smaller tolerance, 1e-5 suffices.

    Examples
    --------
    >>> rock = ss.laws.RateState(a=.010, b=.008, d_c=1e-5, mu_ref=.6, v_ref=1e-5,
    ...                          normal_memory=ss.laws.LinkerDieterich(alpha=.2))
    >>> press = ss.laws.ConstantNormalStress(preload=25e6)
    >>> rig = ss.Slider(friction=rock, contact=press, stiffness=1e10, drive=ss.machine.SteadyDrive(1e-5))
    >>> found = ss.response(rig, [1.0, 10.0, 100.0], output="shear-stress")
    >>> found.gain.round(4)
    array([0.0263, 0.6901, 0.6038])
    """
    forced = _Forced(rig, input, on, output, rtol)
    periods, amplitudes = (np.ravel(np.asarray(given, dtype=float)) for given in (periods, amplitudes))
    answer = transfer(rig, *forced.names, periods)
    shape = (len(amplitudes), len(periods))
    numbers = np.full((len(_NUMBERS), *shape), np.nan)
    status = np.full(shape, "", dtype=object)
    bounds = np.full((2, len(periods)), np.nan)
    total = amplitudes.size * periods.size + (periods.size if limits else 0)
    with progress_bar(total, progress if total else False, "answers") as step:
        for i, period in enumerate(periods):
            for j, amplitude in enumerate(amplitudes):
                status[j, i], numbers[:, j, i] = forced.final_motion(amplitude, period)
                if step:
                    step(1)
            if limits:
                bounds[:, i] = forced.limits(period, abs(answer[i]))
                if step:
                    step(1)
    found = dict(zip(_NUMBERS, numbers, strict=True))
    return FrequencyResponse(
        rig, forced.kind, forced.on, spelled(forced.output), forced.names, forced.units, periods, np.abs(answer),
        np.degrees(np.angle(answer)), amplitudes, **found, steady_friction=forced.friction(forced.steady),
        status=status.astype(str), linear_to=bounds[0], lost_at=bounds[1],
        resonances=resonances(rig, *forced.names, periods[0], periods[-1]), stable=forced.decay < 0,
    )  # fmt: skip


_NUMBERS = ("gains", "phases", "shift", "mean_friction", "distortion")


def _positive(given: Any) -> bool:
    return NUMBERS.passes(given) and bool(np.all(np.asarray(given) > 0))


def spelled(output: str) -> str:
    """Name of an observable with hyphens for underscores, except in the name of a body or contact before the dot."""
    owner, dot, own = output.rpartition(".")
    return owner + dot + own.replace("_", "-")


def amplitude_unit(rig: Slider | Machine, input: str = "normal-stress", on: str | None = None) -> str:
    """SI unit of the amplitude of an input of this rig."""
    return _Forced(rig, input, on, None, 1e-9).units[0]


class _Forced:
    """One input and one output of a rig."""

    def __init__(self, rig: Slider | Machine, input: str, on: str | None, output: str | None, rtol: float) -> None:
        self.rig, self.kind, self.rtol = rig, input.replace("_", "-"), rtol
        model = build_model(rig)
        if self.kind not in INPUTS:
            raise UnknownNameError("input", input, INPUTS)
        name, self.on = self._input(model, on)
        self.output = self._output(model, output)
        self.names = (name, self.output)
        piece = self._piece(1.0, 1.0)
        unit = next(a.role.unit for name, a in parameters(piece).items() if name == "amplitude")
        self.units = (rig.protocol_unit(piece, unit), model.observables[self.output][1])
        late = np.ravel(delays_of(operating_point(rig)))
        shortest = float(
            min((1.0, *late[late > 0]))
        )  # s: only the state at time 0 is needed, and short delays make small steps
        start = simulate(rig, until=shortest, times=[0.0], events=False)
        self.steady = {name: float(start[name][0]) for name in model.observables}
        self.decay = float(growth_rate(rig))

    def _input(self, model: Model, on: str | None) -> tuple[str, str | None]:
        """Name in the model of the oscillating input, and the body or contact on which it acts."""
        of_slider, ending, _ = INPUTS[self.kind]
        if ending == of_slider:
            return ending, None
        if of_slider in model.inputs and on is None:
            return of_slider, None
        possible = [name.removesuffix(ending) for name in model.inputs if name.endswith(ending)]
        if on is None and len(possible) == 1:
            on = possible[0]
        if on not in possible:
            if not possible and of_slider not in model.inputs:
                wanted = "a contact of law pore-fluid" if self.kind == "injection" else "a place to act on"
                raise NotAvailable(f"input {self.kind} needs {wanted}; this rig has none")
            missing = [Problem("on", f"missing; allowed: {', '.join(possible)}")]
            raise ParameterError(self.rig.place_problems("on", on, possible, "place") or missing)
        return on + ending, on or None

    def _output(self, model: Model, output: str | None) -> str:
        if output is None:
            return next(name for name in model.observables if name.rpartition(".")[2] == "friction")
        known = {spelled(name): name for name in model.observables}
        if spelled(output) not in known:
            raise UnknownNameError("output", output, known)
        return known[spelled(output)]

    def _piece(self, amplitude: float, period: float) -> Harmonic:
        on: dict[str, Any] = {} if self.on is None else {"on": self.on}
        return INPUTS[self.kind].piece(amplitude=amplitude, period=period, **on)

    def final_motion(self, amplitude: float, period: float, settled: float = SETTLED) -> tuple[str, tuple[float, ...]]:
        """Status of the motion after transients, and its quantities named in `_NUMBERS` (NaN unless periodic)."""
        waited = math.log(settled) / self.decay / period if self.decay < 0 else 0.0
        count = int(min(max(LEAST_PERIODS, math.ceil(waited)), MOST_PERIODS))
        nothing, before = (math.nan,) * len(_NUMBERS), math.inf
        rtol = max(self.rtol, settled / 100) if settled > SETTLED else self.rtol
        while True:
            columns, status = self._run(amplitude, period, count, rtol)
            if status != "done":
                return status, nothing
            halfway, *swings = columns[self.output].reshape(1 + COMPARED, SAMPLES)
            size = np.ptp(swings[-1]) or 1.0
            drift, *apart = (float(np.max(np.abs(swings[-1] - one))) / size for one in (halfway, *swings[-2::-1]))
            left = max(apart[0], drift * self._to_come(period * (count - count // 2)))
            most = count >= MOST_PERIODS
            if left < (max(settled, FAINT) if most or rtol <= TIGHTEST else settled):
                return PERIODIC, self._numbers(columns, swings[-1], amplitude)
            stalls = before / 2 < apart[0]  # errors of the integration do not fade with time
            before = apart[0]
            if (stalls or most) and apart[0] < IRREGULARLY and rtol > TIGHTEST:
                rtol = max(rtol / TIGHTER, TIGHTEST)
            elif not most:
                count = min(2 * count, MOST_PERIODS)
            else:
                return _unsettled(apart), nothing

    def _to_come(self, time: float) -> float:
        """Size of a transient now, relative to its decrease during the last `time` seconds."""
        return 1 / float(np.expm1(min(-self.decay * time, MOST_FADED))) if self.decay < 0 else 0.0

    def _run(self, amplitude: float, period: float, count: int, rtol: float) -> tuple[dict[str, Array], str]:
        """Observables over the period before the middle of the run and over the last `COMPARED` periods; its status."""
        first = np.array([count // 2 - 1, *range(count - COMPARED, count)])
        times = period * (first[:, None] + np.arange(SAMPLES) / SAMPLES).ravel()
        run = simulate(
            self.rig, self._piece(amplitude, period), until=count * period, times=times, events=False, rtol=rtol
        )
        if run.interrupted:
            raise KeyboardInterrupt
        return {name: np.asarray(run[name]) for name in self.steady}, run.status

    def _numbers(self, columns: dict[str, Array], last: Array, amplitude: float) -> tuple[float, ...]:
        """Quantities named in `_NUMBERS`, from the observables and the output over the last period."""
        parts = np.fft.rfft(last) / (SAMPLES / 2)
        first = 1j * parts[1] / amplitude  # the input is a sine, which is -i e^(iωt)
        higher = math.sqrt(float(np.sum(np.abs(parts[2:]) ** 2))) / abs(parts[1]) if parts[1] else math.nan
        shift = float(np.mean(last)) - self.steady[self.output]
        friction = self.friction({name: float(np.mean(own[-SAMPLES:])) for name, own in columns.items()})
        return abs(first), float(np.degrees(np.angle(first))), shift, friction, higher

    def friction(self, means: Mapping[str, float]) -> float:
        """Mean friction over mean normal stress (or force) at the output's contact; NaN if the output has none."""
        own = self.output.rpartition(".")[0] + "." if "." in self.output else ""
        for shear, normal in (("shear_stress", "normal_stress"), ("friction_force", "normal_force")):
            if own + shear in means:
                return means[own + shear] / means[own + normal]
        return math.nan

    def limits(self, period: float, gain: float) -> tuple[float, float]:
        """Amplitudes (SI units) up to which the gain is linear, and from which steady sliding is lost."""
        if self.decay >= 0:
            return 0.0, 0.0
        most = MOST_SHARE * self._size()
        tried: dict[float, tuple[str, float]] = {}

        def at(amplitude: float) -> tuple[str, float]:
            if amplitude not in tried:
                status, numbers = self.final_motion(amplitude, period, ROUGHLY)
                tried[amplitude] = status, numbers[0]
            return tried[amplitude]

        def departs(amplitude: float) -> bool:
            status, own = at(amplitude)
            return status != PERIODIC or abs(own / gain - 1) > DEPARTED

        def lost(amplitude: float) -> bool:
            return at(amplitude)[0] not in (PERIODIC, NOT_SETTLED, TOO_MANY_STEPS)

        return _edge(departs, most), _edge(lost, most)

    def _size(self) -> float:
        """Steady value (SI units) of load or velocity, which would change sign at larger amplitudes of the input."""
        if self.kind == "drive-velocity":
            return abs(float(self.rig.drive.velocity))
        normal, shear = ("normal_force", "friction_force") if "." in self.output else ("normal_stress", "shear_stress")
        wanted = shear if self.kind == "push" else normal
        own = f"{self.on}.{wanted}" if self.on is not None and f"{self.on}.{wanted}" in self.steady else None
        found = [abs(v) for name, v in self.steady.items() if name == own or (own is None and name.endswith(wanted))]
        return max(found)


def _unsettled(apart: list[float]) -> str:
    """Status of a motion whose last period differs by `apart` from the 1st, 2nd, ... period before it."""
    for k, own in enumerate(apart[1:], start=2):
        if own < IRREGULARLY * apart[0]:
            return f"every {k}{'nd' if k == 2 else 'rd' if k == 3 else 'th'} period"
    drifts = apart[0] < IRREGULARLY or apart[-1] > 0.5 * len(apart) * apart[0]
    return NOT_SETTLED if drifts else IRREGULAR


def _edge(beyond: Callable[[float], bool], most: float) -> float:
    """Smallest amplitude for which `beyond` is true; inf if there is none up to `most`.

    Amplitudes are tried upwards, and the first step with a change is bisected: at larger amplitudes motion may be
    periodic again.
    """
    low = most / 10**DECADES
    if beyond(low):
        most, low = low, low / 10**DECADES
        if beyond(low):
            return 0.0
    rising = np.geomspace(low, most, STEPS + 1)[1:]
    high = next((float(one) for one in rising if beyond(float(one))), math.inf)
    if math.isinf(high):
        return high
    low = max(low, high * (low / most) ** (1 / STEPS))
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if beyond(middle) else (middle, high)
    return high
