"""`modes`: all modes of a machine, the cause of growth, and the effect of changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.entries import Whole
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.files.html_document import write_page
from steadyslip.files.output import FIGURES, write_by_ending, write_columns
from steadyslip.linear.mode_changes import ModeChange, changes_of
from steadyslip.linear.mode_origin import Origin, origin_of
from steadyslip.linear.modes import Mode, matrix_mode, mode_of
from steadyslip.linear.spectrum import spectrum
from steadyslip.linear.status import ON_THE_EDGE
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.numeric import by_matrices, in_numbers
from steadyslip.model.numeric.machine_point import MachinePoint, machine_point
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import explain_absence, steady_machine

ENDINGS = (".csv", ".html", *FIGURES)
MOST = 8  # largest number of modes printed (rightmost first), and of parameters printed (largest effect first)
LEAST = 1e-3  # contributions to the growth rate below this share of the largest are not printed


@dataclass(frozen=True, repr=False)
class Modes(Displayed):
    """All modes of a machine as a sequence of `Mode`; first the mode that grows fastest or decays slowest.

    Attributes
    ----------
    rig : Machine
    found : tuple of Mode
        Modes, for a pair of eigenvalues the one with β > 0.
    chosen : Mode
        Mode that `origin` and `changes` describe: the first unless another was requested.
    origin : Origin or None
        Reason why the chosen mode grows, if it is an oscillation that grows.
    changes : tuple of ModeChange
        Derivatives of the chosen mode's eigenvalue by every parameter, largest effect on the growth rate first, then by
        springs, dampers and masses that could be added. Empty with a delay.
    """

    rig: Machine
    found: tuple[Mode, ...]
    chosen: Mode
    origin: Origin | None
    changes: tuple[ModeChange, ...]

    def __len__(self) -> int:
        return len(self.found)

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.found)

    def __getitem__(self, place: int) -> Mode:
        return self.found[place]

    @property
    def mode(self) -> Mode:
        """The chosen mode; verdicts have an attribute of this name too."""
        return self.chosen

    def plot(self, kind: str | None = None, ax: Any = None) -> Any:
        """Figure of amplitudes and energies of the chosen mode; kind ``"mode"``."""
        return draw(self, kind, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it."""
        return {
            "modes": [one.to_dict() for one in self.found],
            "chosen": self.found.index(self.chosen),
            "why_it_grows": self.origin and self.origin.to_dict(),
            "changes": [one.to_dict() for one in self.changes],
        }

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write a CSV file with one row for each mode; the header has the units.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        columns = {
            "number": [one.number for one in self.found],
            "frequency (Hz)": [one.frequency for one in self.found],
            "growth (1/s)": [one.eigenvalue.real for one in self.found],
            "damping ratio": [one.damping_ratio for one in self.found],
        }
        for name in self.chosen.amplitudes:
            columns[f"amplitude of {name}"] = [abs(one.amplitudes[name]) for one in self.found]
            columns[f"phase of {name} (rad)"] = [float(np.angle(one.amplitudes[name])) for one in self.found]
        for kind in ("kinetic", "elastic"):
            for name in getattr(self.chosen, kind):
                columns[f"{kind} energy of {name}"] = [getattr(one, kind).get(name, np.nan) for one in self.found]
        write_columns(path, {name: np.array(values, dtype=float) for name, values in columns.items()}, "%.12g")

    def __str__(self) -> str:
        shown = [*self.found[:MOST], *([self.chosen] if self.chosen not in self.found[:MOST] else [])]
        rows = [("mode", "frequency", "damping", "growth rate", "")]
        rows += [
            (f"{one.number or '-'}", format_quantity(one.frequency, "Hz") if one.number else "-",
             f"{one.damping_ratio:.3g}", f"{one.eigenvalue.real:.4g} 1/s", one.words())
            for one in shown
        ]  # fmt: skip
        widths = [max(len(row[i]) for row in rows) for i in range(4)]
        lines = ["  ".join([*map(str.ljust, row[:4], widths), row[4]]).rstrip() for row in rows]
        left = len(self.found) - len(shown)
        lines += [f"and {left} that die out faster; files and JSON have all"] if left else []
        if self.origin is not None:
            lines += ["", self.origin.words, "the growth rate is the sum of"]
            feeds = sorted(self.origin.feeds.items(), key=lambda item: -abs(item[1]))
            lines += [f"  {value:+.4g} 1/s  {name}" for name, value in feeds if abs(value) > LEAST * abs(feeds[0][1])]
        return "\n".join([*lines, *self._ranking(), *self._additions()])

    def _ranking(self) -> list[str]:
        """Lines that name the parameters which change the growth rate of the chosen mode most."""
        known = [one for one in self.changes if not one.added][:MOST]
        width = max((len(one.name) for one in known), default=0)
        rows = [
            f"  {one.name:<{width}}  {0.01 * one.relative.real:+.4g} 1/s"
            + (f", frequency {one.relative.imag / self.chosen.eigenvalue.imag:+.2g} %" if self.chosen.number else "")
            for one in known
        ]
        return ["", f"growth rate of {self._title}, to first order, for 1 % more of", *rows] if rows else []

    def _additions(self) -> list[str]:
        """Lines that say how added springs, dampers and masses would change the growth rate of the chosen mode."""
        rows: dict[str, list[str]] = {}
        for one in self.changes:
            if one.added:
                rows.setdefault(one.name, []).append(f"{one.added} {one.slope.real:+.4g} for each {one.unit}")
        width = max(map(len, rows), default=0)
        title = f"growth rate (1/s) of {self._title}, to first order, for what is added in a link or to the ground"
        return ["", title, *(f"  {name:<{width}}  {', '.join(texts)}" for name, texts in rows.items())] if rows else []

    @property
    def _title(self) -> str:
        return f"mode {self.chosen.number}" if self.chosen.number else "the mode without oscillation"


@checked(number=Whole("number of an oscillation, by rising frequency", 1))
def modes(rig: Slider | Machine, number: int | None = None) -> Modes:
    """All modes of a machine: frequencies, dampings, shapes, energies, cause of growth, and effects of changes.

    Parameters
    ----------
    rig : Machine
    number : int, optional
        Number by rising frequency of the oscillation that is examined in detail. By default the mode that grows
        fastest, or decays slowest.

    Returns
    -------
    Modes
        A sequence of `Mode`, first the mode that grows fastest or decays slowest. A pair of eigenvalues is one mode, β
        > 0.

    Raises
    ------
    NoSteadySliding
        If a contact locks up or lifts off; the message names it.
    ParameterError
        If there is no oscillation with this number.
    NotAvailable
        For a slider.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/brake-pad.toml")
    >>> found = ss.modes(machine)
    >>> found.origin.words[:37]
    'modes 1 and 2 meet at 746.5 Hz where '
    >>> found.changes[0].name
    'contacts.disc.friction.mu_ref'
    """
    rig = with_modes(rig)
    if by_matrices(rig):
        steady_machine(rig)  # raises NoSteadySliding with the contact that locks up or lifts off
        own = machine_point(rig)
        found = tuple(matrix_mode(own, complex(s)) for s in own.pencil.eigenvalues if s.imag >= 0)
    else:
        point = operating_point(rig)
        if not point.exists:
            raise explain_absence(rig, point)
        roots = spectrum(point)
        found = tuple(mode_of(rig, point, complex(s)) for s in roots if np.isfinite(s) and s.imag >= 0)
    if not found:
        raise NotAvailable(
            "modes cannot be distinguished: with a delay on a body without mass infinitely many are nearly alike, or "
            "infinitely many grow; analyze says which, and growth_rate how fast"
        )
    chosen = next((one for one in found if number in (None, one.number)), None)
    if chosen is None:
        count = sum(one.number > 0 for one in found)
        raise ParameterError([Problem("number", f"got {number}; allowed: 1 to {count}, the oscillations by frequency")])
    numeric = _numeric_point(rig)
    changes = () if numeric is None else changes_of(numeric, chosen.eigenvalue)
    return Modes(rig, found, chosen, growth_origin(rig, chosen.eigenvalue, chosen.number), changes)


def with_modes(rig: Slider | Machine) -> Machine:
    """The rig itself if it is a machine; raises NotAvailable for a slider."""
    if isinstance(rig, Slider):
        raise NotAvailable("a slider is one body, which has no modes beside its eigenvalues; see analyze")
    return rig


def growth_origin(rig: Machine, s: complex, number: int) -> Origin | None:
    """Reason why the mode with the eigenvalue `s` (1/s) and a `Mode.number` grows.

    None if the mode does not oscillate or grow, if the machine has a delay, or if no steady state is found numerically.
    """
    point = _numeric_point(rig) if number and s.real > ON_THE_EDGE * abs(s) else None
    return None if point is None else origin_of(point, s, number)


def _numeric_point(rig: Machine) -> MachinePoint | None:
    """Operating point found numerically.

    None with a delay, or if Newton's method does not converge (very stiff links).
    """
    point = machine_point(rig) if in_numbers(rig) else None
    return point if point is not None and not point.balance.problem and point.balance.exists else None


def write_modes(found: Any, path: Path, source: Path | None = None) -> None:
    """Write `Modes` or a `ModeChart` as CSV, HTML document (with the hash of its `source`) or figure, by the ending.

    Raises
    ------
    NotAvailable
        If the ending is none of `ENDINGS`, or the file cannot be written.
    """
    writers = {".csv": found.to_csv, ".html": lambda p: write_page(found, p, "Modes", source=source)}
    write_by_ending(path, writers, found.plot, found)
