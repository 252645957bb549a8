"""History of one run: samples, events, status, rig and protocol."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import stress_name, totals
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pictures import draw
from steadyslip.core.version import of_another
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion import store
from steadyslip.motion.events import AnySlip, ContactSlip, Event, SlipEvent, slip_events
from steadyslip.motion.history import HistoryData
from steadyslip.motion.sentence import drop_of, joined, oscillations, sentences
from steadyslip.motion.status import remedy

NUDGED, FASTER = 0.1, 1.1  # a message suggests to speed up the drive by FASTER for this share of the run
STEADY_SPREAD = 1e-4  # a run is steady if velocity varies by less than this share: below the printed digits


@dataclass(frozen=True, eq=False)
class History(HistoryData):  # noqa: D101 -- its base has it
    __doc__ = HistoryData.__doc__

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C ended the run early."""
        return self.status == "interrupted"

    @property
    def message(self) -> str:
        """Sentence on status and end of the run, with advice if it ended early."""
        where = f" ({self.contact})" if self.contact else ""
        head = f"{self.status}{where} at {format_quantity(self.end, 's')}"
        advice = remedy(self.status, self.rig)
        return f"{head}: {advice}" if advice else head

    @property
    def contact(self) -> str:
        """Contact of a machine at which a run ended early (lost, or the fastest in a blow-up); else empty."""
        last = next((e for e in reversed(self.events) if e.kind == self.status), None)
        return last.contact if last else ""

    @cached_property
    def slip_events(self) -> tuple[AnySlip, ...]:
        """Complete slip events; see `SlipEvent` and, for machines, `ContactSlip`."""
        return slip_events(self.events)

    @cached_property
    def sentence(self) -> str:
        """Sentence on the slip events, as "judders: every 4.92 s it sticks, then slips 33.2 um ...".

        Without slip events in the last half of the run, on the oscillation in that half, as "oscillates: every 75.5 s
        between ...".
        """
        return joined(self.rig, self._sentences)

    @cached_property
    def _sentences(self) -> dict[str, str]:
        """Sentence of each contact that slips or oscillates, by name."""
        slips = sentences(self.rig, self.events, self.slip_events, end=self.end)
        if any(one.begin > 0.5 * self.end for one in self.slip_events):
            return slips
        swings = oscillations(self.events, self.end)
        return slips | {name: f"{slips[name]}; then {own}" if name in slips else own for name, own in swings.items()}

    def summary(self) -> str:
        """Text of a few lines: status, velocities, stresses, slip events and solver."""
        lines = [f"{self.message}", *self._contacts(), *self._block()]
        until = self.protocol.until or np.inf
        begins = [(piece.name, float(getattr(piece, "at", 0.0))) for piece in self.protocol.pieces]
        if late := [f"{name} at {format_quantity(at, 's')}" for name, at in begins if at >= until]:
            lines.append(f"left out        {', '.join(late)}: the run is to end at {format_quantity(until, 's')}")
        lines += self._caveats()
        arrests = sum(event.kind == "arrest" for event in self.events)
        if arrests and not self.slip_events:  # a ringing contact is arrested many times between slip events
            lines.append(f"arrests         {arrests}")
        lines.append(f"solver          {self.method}, rtol {self.rtol:g}, {self.steps} steps, {self.rejected} rejected")
        if other := of_another(self.version):
            lines.append(f"version         {other}")
        return "\n".join(lines)

    @property
    def undisturbed(self) -> bool:
        """True if nothing disturbed steady sliding, so that the run does not show whether it is stable."""
        acts = any(float(getattr(piece, "at", 0.0)) < self.end for piece in self.protocol.pieces)
        known = self.velocities.values() if isinstance(self.velocities, dict) else [self.velocities]
        still = all(high - low <= STEADY_SPREAD * abs(high) for low, high in known)
        return not acts and still and self.status == "done"

    @property
    def nudge(self) -> tuple[str, str]:
        """Text of two protocol pieces: the drive is faster by a tenth for a tenth of the run, then as before."""
        value, unit = self.rig.display_value("drive.velocity", float(self.rig.drive.velocity))
        begin, end = (format_quantity(share * self.end, "s") for share in (NUDGED, 2 * NUDGED))
        faster = format_quantity(FASTER * value, unit)
        return f"velocity-step at='{begin}' to='{faster}'", f"velocity-step at='{end}' to='{value!r} {unit}'"

    def _caveats(self) -> list[str]:
        """Lines that warn of easily misread runs."""
        lines = []
        if self.protocol.frees_load_point:
            lines.append("drive           pulls with a force of its own; its motion does not hold anything back")
        if self.protocol.lets_go:
            lines.append("drive           is let go for some time, and pulls then with a force of its own (creep = 1)")
        if np.isinf(self.late_error):
            lines.append(
                "delay           resolved; single slips part with any change of accuracy, as the motion is irregular"
            )
        elif np.isfinite(self.late_error):
            error = 100 * max(self.late_error, self.rtol)
            lines.append(f"delay           slips, peaks, times between and velocities are known within {error:.1g} %")
        if self.undisturbed:
            lines += [
                "disturbance     none: steady sliding goes on even if it is unstable; run analyze, or disturb it:",
                f'                --protocol "{self.nudge[0]}"',
            ]
        return lines

    def _contacts(self) -> list[str]:
        """Summary lines of a machine's contacts."""
        lines: list[str] = []
        velocities = self.velocities
        for name, (lowest, highest) in velocities.items() if isinstance(velocities, dict) else ():
            v, forces = self.data[f"{name}.slip_rate"], self.data[f"{name}.normal_force"]
            if not len(v):
                continue
            rates = (
                f"{format_quantity(lowest, 'm/s')} to {format_quantity(highest, 'm/s')}, at the end "
                f"{format_quantity(v[-1], 'm/s')}"
            )
            low, high = format_quantity(float(forces.min()), "N"), format_quantity(float(forces.max()), "N")
            lines.append(f"{name:<15} slip rate {rates}; normal force {low} to {high}")
            if name in self._sentences:
                lines.append(f"{'':<15} {self._sentences[name]}")
            slips = [one for one in self.slip_events if isinstance(one, ContactSlip) and one.contact == name]
            if slips:
                last, lever = slips[-1], self.rig.lever_at(name)
                again = (
                    f", {format_quantity(last.recurrence, 's')} after the one before"
                    if np.isfinite(last.recurrence)
                    else ""
                )
                lines.append(
                    f"{'':<15} {len(slips)} slip events; the last: peak "
                    f"{format_quantity(last.peak_velocity, 'm/s')}, {'force' if lever is None else 'torque'} drop "
                    f"{format_quantity(*drop_of(last, lever))}, slip {format_quantity(last.slip, 'm')}, lasting "
                    f"{format_quantity(last.duration, 's')}{again}"
                )
        return lines

    def _block(self) -> list[str]:
        """Summary lines of a slider's block."""
        lines: list[str] = []
        if not isinstance(self.velocities, tuple):
            return lines
        v, area = self.data["v"], self.rig.area
        if len(v):
            lowest, highest = self.velocities
            lines.append(
                f"velocity        {format_quantity(lowest, 'm/s')} to {format_quantity(highest, 'm/s')}, "
                f"at the end {format_quantity(v[-1], 'm/s')}"
            )
            stress = [*self.data["normal_stress"], *(e.normal_stress for e in self.events if isinstance(e, Event))]
            low, high = (format_quantity(float(x), "Pa", area=area) for x in (min(stress), max(stress)))
            lines.append(f"{stress_name('normal stress', area):<16}{low} to {high}")
        lines += [self.sentence] if self.sentence else []
        slips = [one for one in self.slip_events if isinstance(one, SlipEvent)]
        if slips:
            last = slips[-1]
            lines.append(
                f"slip events     {len(slips)}; the last: peak {format_quantity(last.peak_velocity, 'm/s')}, "
                f"{stress_name('stress drop', area)} {format_quantity(last.stress_drop, 'Pa', area=area)}, "
                f"slip {format_quantity(last.slip, 'm')}, lasting {format_quantity(last.duration, 's')}"
            )
            if np.isfinite(last.recurrence):
                lines.append(f"recurrence      {format_quantity(last.recurrence, 's')} between the last two")
        return lines

    def __str__(self) -> str:
        return self.summary()

    def to_dict(self) -> dict[str, Any]:
        """Status, events and final values as JSON-ready dict, SI units; samples are left to files."""
        last = {name: float(values[-1]) for name, values in self.data.items() if len(values)}
        return {
            "version": self.version,
            "status": self.status,
            **({"contact": self.contact or None} if self.rig.contact_names else {}),
            "end": self.end,
            "message": self.message,
            "sentence": self.sentence,
            "method": self.method,
            "rtol": self.rtol,
            "steps": self.steps,
            "rejected": self.rejected,
            "final": {name: value if np.isfinite(value) else None for name, value in last.items()},
            "slip_events": [_json_ready(event) for event in self.slip_events],
            "events": [_json_ready(event) for event in self.events],
            "units": self.units,
        } | self._forces(last)

    def _forces(self, last: dict[str, float]) -> dict[str, Any]:
        """Final forces, for the whole contact area; empty for a rig without an area."""
        found = totals(last, self.units, self.rig.area)
        return {"forces": {"area": found["area"], "final": found["values"], "units": found["units"]}} if found else {}

    def to_xarray(self) -> Any:
        """xarray.Dataset over ``time``, events over ``event``, with rig, protocol and versions as attributes."""
        return store.to_dataset(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything to a netCDF file (``.nc``); `load_history` reads it back."""
        store.save(self, path)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the samples as text, one column for each observable, units in the header."""
        store.to_csv(self, path)

    def plot(self, kind: str = "history", ax: Any = None, contact: str | None = None) -> Any:
        """Draw the run: ``history`` (velocity, friction and normal stress in time) or ``phase`` (phase plane).

        For a machine, `contact` selects the contact of the phase plane; by default the contact that moves most.

        Returns
        -------
        matplotlib.axes.Axes or array of them
        """
        if contact is not None and kind == "history":
            raise ParameterError([Problem("contact", f"got {contact!r}; allowed only with kind='phase'")])
        return draw(self, kind, ax=ax, **({} if contact is None else {"contact": contact}))


def check_contact(rig: Slider | Machine, contact: str | None) -> None:
    """Raise ParameterError, with the names that are allowed, if `contact` is given and is no contact of the rig."""
    if problems := rig.place_problems("contact", contact, rig.contacts, "contact"):
        raise ParameterError(problems)


@checked()
def load_history(path: str | PathLike[str]) -> History:
    """History from a file written by `History.save`.

    Nothing in the file is executed; the content is verified.

    Raises
    ------
    NotAvailable
        If the file is not a saved history, is damaged, or cannot be read.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> ss.simulate(rig, until=10).save("run.nc")
    >>> ss.load_history("run.nc").end
    10.0
    """
    return History(**store.read(path))


def _json_ready(record: Any) -> dict[str, Any]:
    """Fields of an event as JSON-ready dict, NaN as None."""
    fields = asdict(record)
    return {n: None if isinstance(v, float) and not np.isfinite(v) else v for n, v in fields.items()}
