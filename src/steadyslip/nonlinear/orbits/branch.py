"""Result of `steadyslip.cycles`: the branch of cycles, its bifurcations, stable ranges and ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import outside, stress_name, total, totals
from steadyslip.core.arrays import Array
from steadyslip.core.checks import Check, as_data, in_words
from steadyslip.core.errors import unknown_name
from steadyslip.core.format import format_quantity
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.version import version
from steadyslip.files.output import write_columns
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.at_value import CyclesAt, cycles_at, simulations, slip_sentence
from steadyslip.nonlinear.orbits.cycle import RANGE_UNITS, Cycle, CycleRange, End, SpecialCycle, quantities
from steadyslip.nonlinear.orbits.ranges import Stretch, checks_of, neighbours, stretches_of


@dataclass(frozen=True, eq=False)
class CycleBranch(Displayed):
    """Cycles that are born at an oscillatory edge of stability, in the order in which they were followed.

    Attributes
    ----------
    rig : Slider or Machine
    along, unit : str
        The parameter and its SI unit.
    onset : Onset
        The edge at which the branch begins.
    cycles : tuple of Cycle
    special : tuple of SpecialCycle
        Bifurcations of the branch.
    end : str
        Reason for which the branch stops.
    doubled : CycleBranch or None
        Cycles of twice the period, one part for each period doubling that begins it; a part ends at another doubling,
        or for the reason in `end` or `broken`.
    gaps : tuple of int
        Indices of the cycles before which the branch is not continuous: a piece broke off, and simulation found
        another beyond it; 0 if no cycle was found at the edge itself. In `doubled`: where the next part begins.
    broken : tuple of str
        For each gap, the reason for which the piece before it ends.
    steady : int
        Index of the steady sliding, by rising normal stress, where a rig has several.
    rtol : float or None
        Relative error allowed per integration step, as given to `steadyslip.cycles`.
    contact : str
        For a machine whose branch ends with loss of contact or a blow-up: the contact that lifts off, or the fastest
        contact; else empty.
    bounds : tuple of (End, End)
        Where each part between two gaps begins and stops.
    repeated : int
        Number of cycles that were computed again with smaller errors per step, because a check failed.
    not_followed : tuple of (End, str)
        Ends from which no cycles were followed, each with the reason: integration steps were used up, or no cycle was
        found.
    """

    rig: Slider | Machine = field(repr=False)
    along: str
    unit: str
    onset: Onset = field(repr=False)
    cycles: tuple[Cycle, ...] = field(repr=False)
    special: tuple[SpecialCycle, ...] = field(repr=False)
    end: str
    doubled: CycleBranch | None = field(default=None, repr=False)
    gaps: tuple[int, ...] = ()
    broken: tuple[str, ...] = ()
    steady: int = 0
    rtol: float | None = None
    contact: str = ""
    bounds: tuple[tuple[End, End], ...] = field(default=(), repr=False)
    repeated: int = 0
    not_followed: tuple[tuple[End, str], ...] = field(default=(), repr=False)

    def __len__(self) -> int:
        return len(self.cycles)

    def __iter__(self) -> Iterator[Cycle]:
        return iter(self.cycles)

    def __getitem__(self, name: str) -> Array:
        """One quantity along the branch: ``value``, ``period``, ``peak_velocity``, ``stress_drop``, ...

        For a machine ``force_drop`` and so on refer to the contact of its cycles; for another contact, its name comes
        first, as in ``guide.peak_velocity``.
        """
        own, columns = quantities(self.rig), self._of_contacts()
        if name in columns:
            contact, what = columns[name]
            return np.array([getattr(cycle.contacts[contact], what) for cycle in self.cycles])
        if name not in (known := ("value", *own, "stable", "trivial", "multipliers", *columns)):
            raise KeyError(unknown_name("quantity", name, known))
        return np.array([getattr(cycle, own[name][0] if name in own else name) for cycle in self.cycles])

    def _of_contacts(self) -> dict[str, tuple[str, str]]:
        """Contact and attribute of each quantity at the contacts of a machine, by public name."""
        return {f"{one}.{item.name}": (one, item.name) for one in self.rig.contact_names for item in fields(CycleRange)}

    def _units(self) -> dict[str, str]:
        """SI unit of each numeric quantity, by name."""
        units = {"value": self.unit} | {name: unit for name, (_, unit) in quantities(self.rig).items()}
        return units | {name: RANGE_UNITS[what] for name, (_, what) in self._of_contacts().items()}

    def _area(self, name: str) -> float | None:
        """Area (m²) that converts a quantity to a force for display; None for a rig without area."""
        return self.rig.printed_area(self.along)

    def at(self, value: float) -> CyclesAt:
        """The cycles that exist at one value of the parameter, corrected to full precision.

        The result has the cycles of the branch first, then those of twice its period, and so on. If none of them is
        stable, motions are simulated at the value, because other branches may have stable cycles (of several slip
        events, in windows of irregular motion). A stable cycle that a simulation reaches is appended; ``simulated``
        describes each simulation. ``between`` are the bifurcations or ends of the branch on both sides of the value,
        ``multiples`` the periods in multiples of the branch's, and ``missed`` the cycles that could not be computed.
        """
        found, multiples, missed = list[Cycle](), list[int](), list[str]()
        branch: CycleBranch | None = self
        levels = list[CycleBranch]()
        while branch is not None:
            here, gaps = cycles_at(self.onset, self.steady, self.rtol, value, branch._continuous())
            here = [one for one in here if not any(map(one.is_like, found))]  # parts of a doubled branch may overlap
            found, multiples = found + here, multiples + len(here) * [2 ** len(levels)]
            missed += [f"a cycle {self._between(*ends)} could not be computed" for ends in gaps]
            levels.append(branch)
            branch = branch.doubled
        if any(cycle.stable for cycle in found):
            return CyclesAt(found, multiples, missed)
        seen = simulations(self.onset, self.steady, self.rtol, value, found)
        also = [one.cycle for one in seen if one.cycle is not None]
        beside = neighbours([(one.special, one.stretches) for one in levels], value)
        places = [one.words(self.unit, self._area("value")) for one in beside if one is not None]
        window = "none of the cycles that were followed attracts" + {0: "", 1: " beyond ", 2: " between "}[len(places)]
        window += " and ".join(places)
        return CyclesAt([*found, *also], [*multiples, *(0 for _ in also)], missed, seen, beside, window)

    @cached_property
    def at_rig(self) -> CyclesAt:
        """The cycles at the rig's own value of the parameter, as from `at` (cached).

        ``sentence`` of the result describes the slip events of the last stable cycle.
        """
        found = self.at(float(self.rig.value(self.along) or 0.0))
        stable = [one for one in found if one.stable]
        return found.with_sentence(slip_sentence(self.rig, stable[-1], self.steady)) if stable else found

    def _between(self, low: Cycle, high: Cycle) -> str:
        """Text of the parameter values and periods of two neighbours, for a message on a missing cycle between them."""
        where = " and ".join(format_quantity(one.value, self.unit, 6, self._area("value")) for one in (low, high))
        periods = " and ".join(format_quantity(one.period, "s") for one in (low, high))
        return f"between {where}, of a period between {periods},"

    def _continuous(self) -> list[list[Cycle]]:
        """List of cycles, folds included, for each continuous part of the branch."""
        starts = (0, *self.gaps, len(self.cycles))
        folds = {point.index: point.cycle for point in self.special if point.kind == "fold"}
        found = []
        for start, stop in pairwise(starts):
            stretch = []
            for i in range(start, stop):
                stretch += [folds[i]] if i in folds and i > start else []
                stretch.append(self.cycles[i])
            found.append(stretch)
        return found

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """Stretches of consecutive cycles of equal stability, in the order of the branch; they end at bifurcations."""
        return tuple(stretches_of(self.cycles, self.special, self.gaps, self.bounds))

    @property
    def stable_ranges(self) -> tuple[tuple[float, float], ...]:
        """Ranges (low, high) of the parameter (SI units) with stable cycles, in branch order; they may overlap."""
        return tuple(one.range for one in self.stretches if one.stable)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the kind of onset, of the closing of the cycles, and of their multipliers."""
        return (*self.onset.checks, *checks_of(self.cycles, self.repeated))

    def to_xarray(self) -> Any:
        """The quantities of the cycles as xarray.Dataset over ``point``, SI units."""
        import xarray as xr

        names = self._units()
        data = {name: ("point", self[name].astype(float), {"units": unit}) for name, unit in names.items()}
        data["stable"] = ("point", self["stable"], {})
        attributes = {"parameter": self.along, "end": self.end, "onset": self.onset.kind, "gaps": list(self.gaps)}
        attributes["stable_ranges"] = [end for one in self.stable_ranges for end in one]
        attributes |= {"checked": in_words(self.checks), "steadyslip": version()}
        return xr.Dataset(data, attrs=attributes)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write one row for each cycle, units in the header.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        written = {name: outside(unit, self._area(name)) for name, unit in self._units().items()}
        titles = {name: f"{self.along if name == 'value' else name} ({unit})" for name, (_, unit) in written.items()}
        columns = {titles[name]: self[name].astype(float) * factor for name, (factor, _) in written.items()}
        write_columns(path, columns | {"stable": self["stable"].astype(float)}, "%.12g")

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units, as ``steadyslip cycles --json`` prints it."""
        at = self.at_rig
        own = [self._cycle_as_dict(one) | {"multiple": n} for one, n in zip(at, at.multiples, strict=True)]
        texts = {"missed": list(at.missed), "simulated": list(map(str, at.simulated)), "sentence": at.sentence}
        return self._as_dict() | {"at_rig": {"value": self.rig.value(self.along), "cycles": own, **texts}}

    def _cycle_as_dict(self, cycle: Cycle) -> dict[str, Any]:
        """A cycle as JSON-ready dict, SI units."""
        names = quantities(self.rig)
        units = {"value": self.unit} | {name: unit for name, (_, unit) in names.items()}
        found: dict[str, Any] = {"value": cycle.value}
        found |= {name: getattr(cycle, own) for name, (own, _) in names.items()}
        if forces := totals(found, units, self._area("value")):
            found["forces"] = forces
        found["amplitude"] = cycle.amplitude if np.isfinite(cycle.amplitude) else None
        found |= {"stable": cycle.stable, "start": cycle.start}
        found |= {"closing": cycle.closing, "multiplier_error": cycle.multiplier_error}
        if cycle.contacts:
            found |= {"contact": cycle.contact, "contacts": {n: _plain(one) for n, one in cycle.contacts.items()}}
        return found | {"multipliers": [[m.real, m.imag] for m in (complex(cycle.trivial), *cycle.multipliers)]}

    def _as_dict(self) -> dict[str, Any]:
        """The branch and its doublings as JSON-ready dict, SI units, without the cycles at the rig."""
        plain = self._cycle_as_dict
        return {
            "parameter": self.along,
            "unit": self.unit,
            "onset": {"kind": self.onset.kind, "value": self.onset.value}
            | total(self.onset.value, self.unit, self._area("value")),
            "end": self.end,
            **({"contact": self.contact} if self.contact else {}),
            "gaps": [{"before": i, "end": why} for i, why in zip(self.gaps, self.broken, strict=True)],
            "not_followed": [{"kind": one.kind, "value": one.value, "why": why} for one, why in self.not_followed],
            "stable_ranges": [list(one) for one in self.stable_ranges],
            "stretches": [
                {"stable": one.stable, "range": list(one.range), "ends": [end.kind for end in one.ends]}
                for one in self.stretches
            ],
            **as_data(self.checks),
            "cycles": [plain(cycle) for cycle in self.cycles],
            "special": [
                {"kind": s.kind, "bracket": list(s.bracket), "precision": s.precision} | plain(s.cycle)
                for s in self.special
            ],
            "doubled": None if self.doubled is None else self.doubled._as_dict(),
        }

    def plot(self, kind: str = "branch", ax: Any = None) -> Any:
        """Draw the branch; see `steadyslip.figures.cycle_branch`."""
        return draw(self, kind, ax=ax)

    @property
    def swing_label(self) -> str:
        """Label of `swings`, whose values differ from the stress drops of slip events in a simulation."""
        if self.cycles and self._lever(self.cycles[0]) is not None:
            return "torque swing"
        return stress_name(self.rig.result_name("stress swing"), self.rig.area)

    def swings(self) -> tuple[Array, str]:
        """Highest minus lowest pull in each cycle, and its unit: Pa; N for a machine, or N m at a body that turns."""
        levers = [self._lever(one) for one in self.cycles]
        unit = "N m" if any(one is not None for one in levers) else self.rig.result_unit("Pa")
        return np.array([one.stress_drop * (by or 1.0) for one, by in zip(self.cycles, levers, strict=True)]), unit

    def _lever(self, cycle: Cycle) -> float | None:
        """Radius (m) of the contact of a cycle if the body turns, else None; the radius may be the varied parameter."""
        lever = self.rig.lever_at(cycle.contact) if cycle.contact else None
        return cycle.value if lever is not None and self.along == f"contacts.{cycle.contact}.radius" else lever

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C ended the branch early."""
        return self.end.startswith("interrupted")

    def __str__(self) -> str:
        rig = format_quantity(self.rig.value(self.along) or 0.0, self.unit, area=self._area("value"))
        lines = [*self._lines(), f"at the rig itself, {rig}:", *("  " + line for line in str(self.at_rig).splitlines())]
        return "\n".join(lines)

    def _lines(self) -> list[str]:
        """Lines of text on the branch and its doublings."""
        area = self._area("value")
        edge = format_quantity(self.onset.value, self.unit, 6, area)
        lines = [f"cycles along {self.along} from the {self.onset.title} at {edge}: {len(self.cycles)} cycles"]
        if self.cycles:
            v = self["peak_velocity"], self["lowest_velocity"]
            period, (swing, swing_unit) = self["period"], self.swings()
            where = f" at {self.cycles[0].contact}" if self.cycles[0].contact else ""
            lines += [
                f"  velocity     {format_quantity(float(v[1].min()), 'm/s')} to "
                f"{format_quantity(float(v[0].max()), 'm/s')}{where}",
                f"  period       {format_quantity(float(period.min()), 's')} to "
                f"{format_quantity(float(period.max()), 's')}",
                f"  {self.swing_label:<13}up to {format_quantity(float(swing.max()), swing_unit, area=area)}",
                f"  stable       {_stable(self)}",
            ]
        for point in self.special:
            lines.append(
                f"  {point.kind} at {format_quantity(point.cycle.value, self.unit, 7, area)} "
                f"(period {format_quantity(point.cycle.period, 's')}, peak "
                f"{format_quantity(point.cycle.peak_velocity, 'm/s')})"
            )
        for (_, stop), (begin, _), why in zip(self.bounds, self.bounds[1:], self.broken, strict=False):
            before, after = (format_quantity(end.value, self.unit, area=area) for end in (stop, begin))
            how = "from the period doubling at" if begin.kind == "period doubling" else "found by simulation, from"
            lines += [f"  gap: at {before} {why};", f"    another sheet, {how} {after} on"]
        lines.append(f"  ends: {self.end}")
        for why in dict.fromkeys(why for _, why in self.not_followed):
            at = [one for one, reason in self.not_followed if reason == why]
            places = ", ".join(format_quantity(one.value, self.unit, 6, area) for one in at)
            lines.append(f"  not followed from the {at[0].kind}{'s' if len(at) > 1 else ''} at {places}: {why}")
        lines += [f"  {in_words(self.checks)}"]
        if self.doubled is not None:
            lines += ["twice the period:", *("  " + line for line in self.doubled._lines())]
        return lines


def _plain(one: CycleRange) -> dict[str, float | None]:
    """A contact's extremes as JSON-ready dict; infinite values become null."""
    found = {item.name: getattr(one, item.name) for item in fields(CycleRange)}
    return {name: value if np.isfinite(value) else None for name, value in found.items()}


def _stable(branch: CycleBranch) -> str:
    """Format the parameter ranges in which the cycles are stable: "all", "none", or ranges."""
    if all(one.stable for one in branch.stretches):
        return "all"
    area = branch.rig.printed_area(branch.along)
    return "; ".join(
        f"{format_quantity(one.range[0], branch.unit, area=area)} to "
        f"{format_quantity(one.range[1], branch.unit, area=area)}"
        + (" (an end is not located)" if any(end.kind == "not located" for end in one.ends) else "")
        for one in branch.stretches if one.stable
    ) or "none"  # fmt: skip
