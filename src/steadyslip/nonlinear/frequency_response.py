"""Result of `steadyslip.response`: gain and phase over the period, and the limits of amplitude."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.files.output import write_columns
from steadyslip.linear.frequency import transfer
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.status import remedy

PERIODIC, NOT_SETTLED, IRREGULAR = "periodic", "not settled", "irregular"
TOO_MANY_STEPS = "too many steps"  # the simulation stopped; the motion may still be periodic
EXPLAINED = {
    NOT_SETTLED: "the motion still drifts after the most periods that are waited for, so it has no answer yet",
    IRREGULAR: "the motion repeats in no few periods of the input: steady sliding is lost",
    TOO_MANY_STEPS: "the simulation took all the steps that are allowed before it had settled, which says nothing of "
    "the motion; try a larger rtol (in Python), or fewer short periods",
}
BEYOND = "beyond the steady value"
MEGA = 1e6  # factor of the prefix M
MOST_ROWS = 9  # periods listed in the text
MOST_RESONANCES = 4  # listed in the text


@dataclass(frozen=True, eq=False)
class FrequencyResponse(ReadOnly):
    """Response of one output to one input that oscillates about its steady value.

    Attributes
    ----------
    rig : Slider or Machine
    input : str
        Oscillating input: ``normal-stress``, ``drive-velocity``, ``push`` or ``injection``.
    on : str or None
        Body or contact of a machine on which the input acts.
    output : str
        Observable: ``friction``, ``shear-stress``, ``guide.friction-force``, ...
    names : tuple of str
        Names of input and output in the Model of `steadyslip.build_model`: one of its ``inputs`` and ``observables``.
    units : tuple of str
        SI units of input and output.
    periods : ndarray (n,)
        Periods of the input, s.
    gain, phase : ndarray (n,)
        For small amplitudes, from the linearised equations: amplitude of the output over that of the input, and its
        phase lead, degrees from -180 to 180.
    amplitudes : ndarray (m,)
        Amplitudes of the input for which motion was simulated, SI units; may be empty.
    gains, phases : ndarray (m, n)
        Gain and phase at `amplitudes`, of the output's Fourier component with the input's period.
    shift : ndarray (m, n)
        Mean of the output minus its steady value.
    mean_friction : ndarray (m, n)
        Mean friction over mean normal stress (or force) at the slider or the output's contact; NaN for other outputs.
    steady_friction : float
        Friction coefficient in steady sliding, at the place of `mean_friction`.
    distortion : ndarray (m, n)
        Root of the sum of squares of all higher harmonics, over the amplitude of the first.
    status : ndarray of str (m, n)
        ``periodic``, ``every 2nd period`` and so on, ``irregular``, ``not settled``, or how the motion ended
        (``blow-up``, ``contact lost``, ...); the other arrays are NaN unless ``periodic``.
    linear_to, lost_at : ndarray (n,)
        Amplitude up to which the gain is within 5 % of that of small amplitudes, and amplitude at which steady sliding
        is lost: motion ends, or no longer repeats with the input; as a rule it first repeats every second period, most
        easily at half the period of a resonance. Stick-slip once in every period is periodic and not lost. NaN without
        ``limits=True``, inf if above the steady value of the input's quantity, 0 if below a millionth of it.
    resonances : ndarray (r, 3)
        Maxima of the small-amplitude gain within the range of the periods, also between them: period (s), gain, phase
        (degrees); the largest gain first.
    stable : bool
        True if steady sliding is stable; if not, no small periodic response is ever reached.
    """

    rig: Slider | Machine = field(repr=False)
    input: str
    on: str | None
    output: str
    names: tuple[str, str] = field(repr=False)
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
    steady_friction: float = field(repr=False)
    status: Array = field(repr=False)
    linear_to: Array = field(repr=False)
    lost_at: Array = field(repr=False)
    resonances: Array = field(repr=False)
    stable: bool = True

    def transfer(self, periods: Any) -> Array:
        """Small-amplitude transfer function G(iω) at other periods (s), complex, SI units."""
        return transfer(self.rig, *self.names, np.asarray(periods, dtype=float))

    @property
    def shown_units(self) -> tuple[tuple[float, str], tuple[float, str]]:
        """Factor and display unit of input and of output; stresses become forces if the rig has an area."""
        return outside(self.units[0], self._area), outside(self.units[1], self._area)

    @property
    def _area(self) -> float | None:
        return self.rig.area

    @property
    def gain_unit(self) -> tuple[float, str]:
        """Factor and unit of the gain in tables; the unit is empty where input and output have equal units."""
        (below, given), (above, answered) = self.shown_units
        divisor = f"({given})" if set(given) & set("/ ") else given
        return above / below, "" if given == answered else f"{answered}/{divisor}"

    @property
    def drawn_gain_unit(self) -> tuple[float, str]:
        """Factor and unit of the gain in figures: as `gain_unit`, but per MPa if the input is a stress."""
        factor, unit = self.gain_unit
        return (MEGA * factor, f"{unit.removesuffix('Pa')}MPa") if unit.endswith("/Pa") else (factor, unit)

    def __str__(self) -> str:
        lines = [f"{self.title}: gain and phase of small amplitudes"]
        if not self.stable:
            lines.append("  steady sliding is UNSTABLE: this answer is never reached, any disturbance outgrows it")
        for i in _some(len(self.periods)):
            period = format_quantity(self.periods[i], "s")
            lines.append(f"  {period:>12}  {self._gain(self.gain[i])}  {self.phase[i]:.4g} deg{self._limits_at(i)}")
        if len(self.periods) > MOST_ROWS:
            lines.append(f"{MOST_ROWS} of {len(self.periods)} periods; files and JSON have all")
        for period, gain, phase in self.resonances[:MOST_RESONANCES]:
            place = format_quantity(period, "s")
            lines.append(f"resonance  period {place}, gain {self._gain(gain)}, phase {phase:.4g} deg")
        for j, amplitude in enumerate(self.amplitudes):
            lines.append(f"amplitude {self.told(amplitude)}")
            for i in _some(len(self.periods)):
                lines.append(f"  {format_quantity(self.periods[i], 's'):>12}  {self._at(j, i)}")
        return "\n".join([*lines, *self._explained(), *self._limits()])

    @property
    def title(self) -> str:
        """Output and input in words, such as ``shear-stress under normal-stress``."""
        return f"{self.output} under {self.input}" + (f" at {self.on}" if self.on else "")

    def told(self, amplitude: float) -> str:
        """Text of an amplitude of the input, with its display unit."""
        return format_quantity(amplitude, self.units[0], area=self._area)

    def _gain(self, gain: float) -> str:
        """Text of a gain: output per MPa of an input stress, or per unit of other inputs; a number if units agree."""
        factor, unit = self.gain_unit
        if not unit:
            return f"{factor * gain:.5g}"
        below, given = self.shown_units[0]
        step, given = (MEGA, "MPa") if given == "Pa" else (1 / below, given)
        return f"{format_quantity(step * gain, self.units[1], 5, self._area)} per {given}"

    def _at(self, j: int, i: int) -> str:
        if self.status[j, i] != PERIODIC:
            return str(self.status[j, i])
        shift = format_quantity(self.shift[j, i], self.units[1], area=self._area)
        return (
            f"{self._gain(self.gains[j, i])}  {self.phases[j, i]:.4g} deg, mean shifted by {shift}, distortion "
            f"{100 * self.distortion[j, i]:.3g} %"
        )

    def _explained(self) -> list[str]:
        """Lines of text that explain the statuses in the tables, one for each status other than ``periodic``."""
        found = dict.fromkeys(self.status.ravel().tolist())
        return [f"{one}: {self._explanation(one)}" for one in found if one != PERIODIC]

    def _explanation(self, status: str) -> str:
        if status.startswith("every"):
            return "the motion does not repeat with the input, but later: steady sliding is lost"
        return EXPLAINED.get(status) or remedy(status, self.rig)

    def _limits_at(self, i: int) -> str:
        """Text of the amplitudes `linear_to` and `lost_at` at the period of index `i`; empty if not computed."""
        ends = [self.told(one[i]) if np.isfinite(one[i]) else BEYOND for one in (self.linear_to, self.lost_at)]
        return "" if np.isnan(self.linear_to[i]) else ", linear to {}, lost from {}".format(*ends)

    def _limits(self) -> list[str]:
        lines = []
        limits = (("linear to within 5 % up to", self.linear_to), ("steady sliding is lost from", self.lost_at))
        for words, found in limits:
            if np.any(np.isfinite(found)):
                least = int(np.nanargmin(found))
                place = format_quantity(self.periods[least], "s")
                lines.append(f"{words} an amplitude of {self.told(found[least])}, at period {place}")
            elif np.any(np.isinf(found)):
                lines.append(f"{words} no amplitude below the steady value, at these periods")
        return lines

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units; missing values are null."""
        arrays = ("periods", "gain", "phase", "resonances", "amplitudes", "gains", "phases", "shift", "mean_friction",
                  "distortion", "linear_to", "lost_at")  # fmt: skip
        return {
            "input": self.input, "on": self.on, "output": self.output, "units": list(self.units),
            "stable": self.stable, **{name: _plain(getattr(self, name)) for name in arrays},
            "steady_friction": _plain(np.array(self.steady_friction)), "status": self.status.tolist(),
        }  # fmt: skip

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write one row for each period and amplitude; amplitude 0 is the limit of small amplitudes.

        Missing values are ``nan``. Stresses become forces if the rig has an area.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        ((given, amplitude_unit), (answered, shift_unit)), (ratio, unit) = self.shown_units, self.gain_unit
        titles = (f"amplitude ({amplitude_unit})", "period (s)", f"gain ({unit or '1'})", "phase (deg)",
                  f"shift ({shift_unit})", "mean friction (1)", "distortion (1)", "status",
                  f"linear to ({amplitude_unit})", f"lost at ({amplitude_unit})")  # fmt: skip
        limits = (given * self.linear_to, given * self.lost_at)
        nothing, steady = np.zeros_like(self.periods), np.full_like(self.periods, self.steady_friction)
        small = (nothing, self.periods, ratio * self.gain, self.phase, nothing, steady, nothing,
                 np.full(len(nothing), "linear"), *limits)  # fmt: skip
        parts: list[tuple[Array, ...]] = [small]
        for j, amplitude in enumerate(given * self.amplitudes):
            parts.append((np.full_like(nothing, amplitude), self.periods, ratio * self.gains[j], self.phases[j],
                          self.shift[j] * answered, self.mean_friction[j], self.distortion[j], self.status[j],
                          *limits))  # fmt: skip
        columns = map(np.concatenate, zip(*parts, strict=True))
        write_columns(path, dict(zip(titles, columns, strict=True)), "%.12g")

    def plot(self, ax: Any = None) -> Any:
        """Draw gain and phase over the period; see `steadyslip.figures.frequency_response`."""
        return draw(self, ax=ax)


def _some(count: int) -> list[int]:
    """Indices of the table rows that are printed: at most `MOST_ROWS` of `count`, evenly spread."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, MOST_ROWS))})


def _plain(values: Array) -> Any:
    """Convert an array to nested lists for JSON, with None in place of values that are not finite."""
    found = values.astype(object)
    found[~np.isfinite(values)] = None
    return found.tolist()
