"""Result of `hunt`: decision whether a held axis hunts or settles, with size and period, in numbers and text."""

from __future__ import annotations

import textwrap
from dataclasses import asdict, dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.format import format_quantity
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.files.output import write_columns
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.hunting.free_loop import unstable_by_itself
from steadyslip.nonlinear.hunting.other_bodies import BodySwing, measured_body, other_bodies, reported_body
from steadyslip.nonlinear.hunting.plant import Array
from steadyslip.nonlinear.hunting.stick_and_slip import STILL, Stroke, swings
from steadyslip.protocol import Protocol

SYMMETRIC = 1e-3  # relative difference of both sides below which one number with ± is printed: numbers have four digits
SETTLED_DIGITS = 3  # digits of the time until rest: the axis creeps to rest, so that rounding changes this time by 2e-3


@dataclass(frozen=True, eq=False)
class Hunt(ReadOnly):
    """Motion of a held axis, and whether it hunts about its target.

    Attributes
    ----------
    rig : Slider or Machine
    protocol : Protocol
        Motion of the target.
    hunts : bool or None
        True if strokes go on without becoming smaller, False if the axis settles; None if neither was seen.
    runs_away : bool
        True if the error grows without limit: the controller is unstable in sliding, or too weak for a load.
    lowest, highest : float
        Extremes of measured position minus target (m or rad), in the last cycle, or since the last rest. For a machine
        they are of the drive, or of the body whose feed is given (`velocity_of`), converted as in steady motion.
    period : float
        Duration of the cycle (s), of strokes both ways; NaN if strokes do not repeat.
    repeats : bool
        True if the last two cycles agree to 1e-9 (with numerical integration to a hundred times `rtol`).
    strokes : tuple of Stroke
        Motions between two rests; `begins` and `ends` are errors (target minus position).
    time, error, velocity, force : ndarray
        The motion: s; m or rad; m/s or rad/s; N, N m or Pa.
    exact : bool
        True if the motion is solved exactly between switches, False if integrated numerically.
    rtol : float
        Relative error allowed per step of numerical integration.
    settled_at : float
        Time from which on the axis rests (s); NaN if it does not.
    unit, force_unit : str
    version : str
    scatter : float
        Largest difference between ends of strokes in one direction (m or rad), among those of `lowest` and `highest`;
        0 for a cycle.
    others : tuple of BodySwing
        Extremes of the other bodies with friction; empty if the axis runs away.
    stopped : bool
        True if the limit of steps ended the motion.
    """

    rig: Slider | Machine
    protocol: Protocol
    hunts: bool | None
    lowest: float
    highest: float
    period: float
    repeats: bool
    runs_away: bool
    strokes: tuple[Stroke, ...]
    time: Array
    error: Array
    velocity: Array
    force: Array
    exact: bool
    rtol: float
    settled_at: float
    unit: str
    force_unit: str
    version: str
    scatter: float = 0.0
    others: tuple[BodySwing, ...] = ()
    stopped: bool = False

    @property
    def _swings(self) -> list[Stroke]:
        return swings(self.strokes)

    @property
    def fastest(self) -> float:
        """Largest speed of the measured position in the last two strokes (m/s or rad/s); 0 without strokes."""
        return max((one.fastest for one in self._swings[-2:]), default=0.0)

    @property
    def every(self) -> float:
        """Time (s) between the starts of the last two strokes, in either direction; NaN with fewer than two."""
        return self._swings[-1].start - self._swings[-2].start if len(self._swings) > 1 else np.nan

    @property
    def sentence(self) -> str:
        """Decision in a line, such as "HUNTS ±63.9 mm about the target every 24.4 s"."""
        far = max(abs(self.lowest), abs(self.highest))
        size = self._sizes(both=False)
        if self.runs_away:
            return f"RUNS AWAY: {size} from the target after {format_quantity(self._end, 's')}, and ever farther"
        if self.hunts:
            size = self._sizes(both=True)
            often = (
                f"every {format_quantity(self.period, 's')}"
                if np.isfinite(self.period)
                else "without a steady period so far"
            )
            often += "" if self.repeats or np.isnan(self.period) else " on average"
            return f"HUNTS {size} about the target {often}"
        if self.hunts is None:
            return f"NOT DECIDED by {format_quantity(self._end, 's')}: {self._so_far}{self._of_late}"
        if np.isfinite(self.settled_at):
            there = far <= 2 * STILL * np.max(np.abs(self.error), initial=0.0)  # within numerical errors
            where = f"on the target{self._beside}" if there else f"within {size} of the target"
            if not self.strokes and not there:
                return f"DOES NOT MOVE: friction at rest holds it {size} from the target"
            return f"SETTLES {where} after {format_quantity(self.settled_at, 's', SETTLED_DIGITS)}"
        if self.approached_at < self._end:
            after = format_quantity(self.approached_at, "s", SETTLED_DIGITS)
            return f"SETTLES on the target{self._beside}, within {size} of it after {after}"
        return f"SETTLES: within {size} of the target by {format_quantity(self._end, 's')}, in ever smaller strokes"

    @property
    def approached_at(self) -> float:
        """Time (s) from which on an axis that ends on its target is as close to the target as in its last strokes.

        Infinite if the axis does not end on its target within numerical errors.
        """
        away = np.abs(self.error)
        if not len(away) or away[-1] > 2 * STILL * np.max(away):
            return np.inf
        farther = np.flatnonzero(away > max(abs(self.lowest), abs(self.highest)) * (1 + 1e-9))
        return float(self.time[min(farther[-1] + 1, len(away) - 1)]) if len(farther) else 0.0

    @property
    def at_body(self) -> str:
        """Name of the body whose error is `error`, such as " at motor"; empty for a rig with one body."""
        return f" at {name}" if (name := reported_body(self.rig)) else ""

    @property
    def force_label(self) -> str:
        """Label of `force`: "force", or "torque" where the drive turns."""
        return "torque of the drive" if self.rig.drive.turns else "force of the drive"

    def _sizes(self, both: bool) -> str:
        """Text of the distances of all bodies from their targets: on `both` sides, or the larger distance."""
        own = self._size(self.lowest, self.highest, self.unit, both)
        if not (name := reported_body(self.rig)):
            return own
        measured = measured_body(self.rig)
        seen = "" if measured == name else f" by the place of {measured}"
        beside = [(self._size(one.lowest, one.highest, one.unit, both), one.body) for one in self.others]
        words = [f"itself {size}" if body == name else f"{size} at {body}" for size, body in beside]
        return f"{own} at {name}{seen}" + (f" ({', '.join(words)})" if words else "")

    @property
    def _beside(self) -> str:
        """Text on bodies that rest off their targets while the reported body is on target; empty if there are none."""
        ratios, way = other_bodies(self.rig), float(np.max(np.abs(self.error), initial=0.0)) / self.rig.feed()[0]
        off = [
            f"{self._size(one.lowest, one.highest, one.unit, False)} off it at {one.body}" for one in self.others
            if max(abs(one.lowest), abs(one.highest)) > SYMMETRIC * abs(ratios[one.body] * way)
        ]  # fmt: skip
        return f"{self.at_body} ({', '.join(off)})" if off else ""

    def _size(self, low: float, high: float, unit: str, both: bool) -> str:
        """Text of a range about the target: one number with ± if both sides agree as printed or within `scatter`."""
        far = max(abs(low), abs(high))
        if not both:
            return format_quantity(far, unit)
        share = self.scatter / max(abs(self.lowest), abs(self.highest))
        if abs(high + low) <= max(SYMMETRIC, share) * far:
            return f"±{format_quantity(far, unit)}"
        return f"from {format_quantity(low, unit)} to {format_quantity(high, unit)}"

    @cached_property
    def unstable_loop(self) -> str:
        """Clause on a controller that is unstable without any friction, with remedies; empty if it is stable."""
        return unstable_by_itself(self.rig)

    @property
    def _encoder(self) -> str:
        """Text of the encoder's step, at its body and at the drive; empty if the encoder is at the drive."""
        drive: Any = self.rig.drive
        ratio = self.rig.seen()[0]
        step = getattr(drive, "resolution", None)
        if not step or ratio == 1.0:
            return ""
        at, acts = format_quantity(*self.rig.display_value("drive.resolution", step)), "rad" if drive.turns else "m"
        return f"{at} of {drive.watched()[0]}, {format_quantity(step / ratio, acts)} of {drive.driven()}"

    @property
    def _so_far(self) -> str:
        """Text on the motion of an axis that, when the simulation ends, neither rests nor hunts."""
        own, now = self._swings, abs(float(self.error[-1])) if len(self.error) else 0.0
        off = f"is {format_quantity(now, self.unit)} from the target{self.at_body}"
        if not own:
            return f"it {off}" + (", still on its first stroke" if self.strokes else ", and has not moved")
        long = format_quantity(abs(own[-1].ends - own[-1].begins), self.unit)
        if len(own) == 1:
            return f"so far it has made one stroke of {long}, and {off}"
        often = f"{format_quantity(self.every, 's')} after the one before"
        return f"so far it has made {len(own)} strokes, the last of {long}, {often}, and {off}"

    @property
    def _of_late(self) -> str:
        """Text of the range of positions in the last third of the motion; empty if the position is constant."""
        places = -self.error[self.time >= self._end * 2 / 3]
        low, high = (format_quantity(float(end(places)), self.unit) for end in (np.min, np.max))
        return "" if low == high else f"; in the last third of this time from {low} to {high} of it"

    @property
    def _end(self) -> float:
        return float(self.time[-1]) if len(self.time) else 0.0

    def __str__(self) -> str:
        lines = [self.sentence]
        if self.unstable_loop:
            lines += textwrap.wrap(f"{self.unstable_loop[0].upper()}{self.unstable_loop[1:]}.", 100)
        if own := self._swings:
            last = own[-1]
            again = f" starts {format_quantity(self.every, 's')} after the one before," if len(own) > 1 else ":"
            rests = f", with brief rests in {len(self.strokes)} parts" if len(self.strokes) > len(own) + 1 else ""
            lines.append(
                f"strokes         {len(own)}{rests}; the last{again} fastest "
                f"{format_quantity(last.fastest, f'{self.unit}/s')}"
            )
        if len(self.force):
            ends = (self.force.min(), self.force.max())
            low, high = (format_quantity(float(force), self.force_unit, area=self.rig.area) for force in ends)
            lines.append(f"controller      {low} to {high}")
        if encoder := self._encoder:
            lines.append(f"encoder         {encoder}")
        accuracy = "exact pieces" if self.exact else f"integrated to a relative error of {self.rtol:g}"
        lines.append(f"motion          {format_quantity(self._end, 's')} from rest, {accuracy}")
        if self.stopped:
            way = "a larger sample_time" if self.exact else "a larger sample_time or rtol"
            if any(one.friction.memory() for one in self.rig.mechanism().contacts):
                way += ", or law = 'coulomb' with mu_static,"
            lines.append(f"stopped there   the limit of steps was reached; {way} takes fewer")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Decision and strokes as JSON-ready dict, SI units; missing values are null."""
        return {
            "hunts": self.hunts,
            "sentence": self.sentence,
            "unstable_loop": self.unstable_loop or None,
            "lowest": self.lowest,
            "highest": self.highest,
            "body": reported_body(self.rig) or None,
            "others": [asdict(one) for one in self.others],
            "runs_away": self.runs_away,
            "period": _finite(self.period),
            "repeats": self.repeats,
            "settled_at": _finite(self.settled_at),
            "fastest": self.fastest,
            "exact": self.exact,
            "unit": self.unit,
            "strokes": [{k: _finite(v) for k, v in asdict(one).items()} for one in self.strokes],
        }

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write one row for each moment: time, error, speed, and force of the drive (N if the rig has an area).

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        factor, force = outside(self.force_unit, self.rig.area)
        columns = {
            "time (s)": self.time,
            f"target minus position{self.at_body} ({self.unit})": self.error,
            f"speed ({self.unit}/s)": self.velocity,
            f"{self.force_label} ({force})": factor * self.force,
        }
        write_columns(path, columns, "%.12g")

    def plot(self, ax: Any = None) -> Any:
        """Draw error and force of the drive over time; see `steadyslip.figures.hunting`."""
        return draw(self, ax=ax)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
