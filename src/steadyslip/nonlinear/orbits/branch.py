"""Cycles along a parameter, special ones among them, and where their branch ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.areas import outside, stress_name, total, totals
from steadyslip.core.errors import unknown_name
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.telling import shown
from steadyslip.files.output import write_columns
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.cycle import RANGE_UNITS, Cycle, CycleRange, SpecialCycle, quantities
from steadyslip.nonlinear.orbits.values import attracting, cycles_at

Array = np.ndarray


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
    end : str
        Why the branch stops.
    doubled : CycleBranch or None
        The branch of twice the period that begins at the first period doubling.
    gaps : tuple of int
        Numbers of the cycles before which the branch is not continuous: a sheet broke off, and simulation found
        another beyond it; 0 where nothing was found at the edge itself.
    broken : tuple of str
        For each gap, why the sheet before it was not followed any further.
    steady : int
        Which steady sliding, where there are several.
    rtol : float or None
        Error allowed per step, as asked for.
    contact : str
        Of a machine whose branch ends where a contact is lost, or with a blow-up: the contact that lifts off, or that
        is the fastest; else empty.
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

    def __len__(self) -> int:
        return len(self.cycles)

    def __iter__(self) -> Iterator[Cycle]:
        return iter(self.cycles)

    def __getitem__(self, name: str) -> Array:
        """One quantity along the branch: ``value``, ``period``, ``peak_velocity``, ``stress_drop``, ...

        Of a machine ``force_drop`` and so on, at the contact of its cycles; at others ``guide.peak_velocity``.
        """
        own, columns = quantities(self.rig), self._of_contacts()
        if name in columns:
            contact, what = columns[name]
            return np.array([getattr(cycle.contacts[contact], what) for cycle in self.cycles])
        if name not in (known := ("value", *own, "stable", "trivial", "multipliers", *columns)):
            raise KeyError(unknown_name("quantity", name, known))
        return np.array([getattr(cycle, own[name][0] if name in own else name) for cycle in self.cycles])

    def _of_contacts(self) -> dict[str, tuple[str, str]]:
        """Quantities at the contacts of a machine: contact and attribute, by name."""
        contacts = self.rig.contacts if isinstance(self.rig, Machine) else ()
        return {f"{one}.{item.name}": (one, item.name) for one in contacts for item in fields(CycleRange)}

    def _units(self) -> dict[str, str]:
        """Units of the quantities that are numbers."""
        units = {"value": self.unit} | {name: unit for name, (_, unit) in quantities(self.rig).items()}
        return units | {name: RANGE_UNITS[what] for name, (_, what) in self._of_contacts().items()}

    def _area(self, name: str) -> float | None:
        """Area for which people get a quantity as a total."""
        if name == "value" or isinstance(self.rig, Slider):
            return self.rig.area_of(self.along)
        return None

    def at(self, value: float) -> tuple[Cycle, ...]:
        """The cycles that exist at one value of the parameter, corrected to full precision.

        If none of them attracts, on this branch or on those of its doublings, motions are simulated at the value, and
        the stable cycle that one comes to, if it does, is the last: cycles of several slip events may lie on sheets of
        their own, in windows among irregular motion.
        """
        found = self._followed(value)
        levels, stable = self, any(cycle.stable for cycle in found)
        while not stable and levels.doubled is not None:
            levels = levels.doubled
            stable = any(cycle.stable for cycle in levels._followed(value))
        if stable:
            return found
        own = attracting(self.onset, self.steady, self.rtol, value, found)
        return found if own is None else (*found, own)

    def _followed(self, value: float) -> tuple[Cycle, ...]:
        """Those of the branch itself."""
        return cycles_at(self.onset, self.steady, self.rtol, value, self._stretches())

    def _stretches(self) -> list[list[Cycle]]:
        """Cycles from gap to gap, folds among them."""
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

    def to_xarray(self) -> Any:
        """An xarray.Dataset over ``point``."""
        import xarray as xr

        names = self._units()
        data = {name: ("point", self[name].astype(float), {"units": unit}) for name, unit in names.items()}
        data["stable"] = ("point", self["stable"], {})
        attributes = {"parameter": self.along, "end": self.end, "onset": self.onset.kind, "gaps": list(self.gaps)}
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
        """Plain data in SI units, as ``steadyslip cycles --json`` prints it."""

        area, names = self._area("value"), quantities(self.rig)
        units = {"value": self.unit} | {name: unit for name, (_, unit) in names.items()}

        def plain(cycle: Cycle) -> dict[str, Any]:
            found: dict[str, Any] = {"value": cycle.value}
            found |= {name: getattr(cycle, own) for name, (own, _) in names.items()}
            if forces := totals(found, units, area):
                found["forces"] = forces
            found["amplitude"] = cycle.amplitude if np.isfinite(cycle.amplitude) else None
            found |= {"stable": cycle.stable, "start": cycle.start}
            if cycle.contacts:
                found |= {"contact": cycle.contact, "contacts": {n: _plain(one) for n, one in cycle.contacts.items()}}
            return found | {"multipliers": [[m.real, m.imag] for m in (complex(cycle.trivial), *cycle.multipliers)]}

        return {
            "parameter": self.along,
            "unit": self.unit,
            "onset": {"kind": self.onset.kind, "value": self.onset.value} | total(self.onset.value, self.unit, area),
            "end": self.end,
            **({"contact": self.contact} if self.contact else {}),
            "gaps": [{"before": i, "end": why} for i, why in zip(self.gaps, self.broken, strict=True)],
            "cycles": [plain(cycle) for cycle in self.cycles],
            "special": [
                {"kind": s.kind, "bracket": list(s.bracket), "precision": s.precision} | plain(s.cycle)
                for s in self.special
            ],
            "doubled": None if self.doubled is None else self.doubled.to_dict(),
        }

    def plot(self, kind: str = "branch", ax: Any = None) -> Any:
        """Draw the branch; see `steadyslip.figures.cycle_branch`."""
        return draw(self, kind, ax=ax)

    @property
    def _drop(self) -> str:
        return stress_name("stress drop", self.rig.area) if isinstance(self.rig, Slider) else "force drop"

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended the branch early."""
        return self.end.startswith("interrupted")

    def __str__(self) -> str:
        area = self._area("value")
        edge = shown(self.onset.value, self.unit, 6, area)
        drops, drop_unit = ("stress_drop", "Pa") if isinstance(self.rig, Slider) else ("force_drop", "N")
        lines = [f"cycles along {self.along} from the {self.onset.title} at {edge}: {len(self.cycles)} cycles"]
        if self.cycles:
            v = self["peak_velocity"], self["lowest_velocity"]
            period, drop = self["period"], self[drops]
            where = f" at {self.cycles[0].contact}" if self.cycles[0].contact else ""
            lines += [
                f"  velocity     {shown(float(v[1].min()), 'm/s')} to {shown(float(v[0].max()), 'm/s')}{where}",
                f"  period       {shown(float(period.min()), 's')} to {shown(float(period.max()), 's')}",
                f"  {self._drop:<13}up to {shown(float(drop.max()), drop_unit, area=self._area(drops))}",
                f"  stable       {_stretches(self)}",
            ]
        for point in self.special:
            lines.append(
                f"  {point.kind} at {shown(point.cycle.value, self.unit, 7, area)} "
                f"(period {shown(point.cycle.period, 's')}, peak {shown(point.cycle.peak_velocity, 'm/s')})"
            )
        for i, why in zip(self.gaps, self.broken, strict=True):
            before = shown(self.cycles[i - 1].value if i else self.onset.value, self.unit, area=area)
            after = shown(self.cycles[i].value, self.unit, area=area)
            lines += [f"  gap: at {before} {why};", f"    another sheet, found by simulation, from {after} on"]
        lines.append(f"  ends: {self.end}")
        if self.doubled is not None:
            lines += ["twice the period:", *("  " + line for line in str(self.doubled).splitlines())]
        return "\n".join(lines)


def _plain(one: CycleRange) -> dict[str, float | None]:
    """For JSON."""
    found = {item.name: getattr(one, item.name) for item in fields(CycleRange)}
    return {name: value if np.isfinite(value) else None for name, value in found.items()}


def _stretches(branch: CycleBranch) -> str:
    """Where along the branch cycles are stable, in words."""
    stable = branch["stable"]
    if stable.all():
        return "all"
    if not stable.any():
        return "none"
    changes = np.flatnonzero(stable[1:] != stable[:-1]) + 1
    pieces = np.split(np.arange(len(stable)), changes)
    found = [piece for piece in pieces if stable[piece[0]]]
    values, area = branch["value"], branch.rig.area_of(branch.along)
    ends = [(float(values[p].min()), float(values[p].max())) for p in found]
    return "; ".join(f"{shown(a, branch.unit, area=area)} to {shown(b, branch.unit, area=area)}" for a, b in ends)
