"""Stability verdict at every moment of a slow change (frozen time), compared with the simulated motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.areas import outside
from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.core.options import DURATION, checked
from steadyslip.core.pictures import draw
from steadyslip.core.records import parameters, replaced
from steadyslip.core.results import ReadOnly
from steadyslip.files.output import write_columns
from steadyslip.laws.contact import ContactInputs, ContactLaw
from steadyslip.linear.stiffness import critical_stiffness, growth_rate
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.reducing import PORES
from steadyslip.motion import History, simulate
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol
from steadyslip.protocol.inputs import inputs_at, segment_of
from steadyslip.protocol.protocol import LOAD_POINT
from steadyslip.protocol.segments import pack

MOMENTS = 1000  # number of evenly spaced times at which stability is computed; the times of jumps are added
REFINED = 100  # number of further times between two neighbouring times with different verdicts
DEPARTED = 2.0  # ratio of slip rate to commanded slip rate above which motion has departed, as for a slip event
ENDED = ("contact lost", "blow-up", "stuck", "no velocity")  # statuses that end both steady sliding and the motion


@dataclass(frozen=True, eq=False)
class FrozenVerdicts(ReadOnly):
    """Stability of steady sliding at each moment of a protocol, and the time at which motion departs from it.

    Attributes
    ----------
    rig : Slider or Machine
    run : History
        The motion under the protocol.
    t : ndarray (n,)
        Moments, s.
    values : dict of str to ndarray (n,)
        Parameters of the rig that the protocol changes, SI units: velocity of the drive, preloads; a preload minus
        the injected pressure is the effective normal stress.
    labels : dict of str to str
        Display names of the parameters in `values`: their names, or ``effective normal stress``.
    growth_rate : ndarray (n,)
        Growth rate of the leading eigenvalue, 1/s; NaN where there is no steady sliding.
    critical_stiffness : ndarray (n,)
        Critical stiffness of a slider, Pa/m; NaN where there is none, and for machines.
    crossings : tuple of (float, str)
        Times (s) at which the verdict changes, each with the new verdict: ``unstable``, ``stable`` or ``no steady
        sliding``.
    departure : float
        First time (s) after sliding became unstable at which slip is twice as fast as commanded and twice as fast as
        when sliding became unstable (a ramp of the load by itself slows or speeds up slip), or at which motion cannot
        go on; NaN if there is no such time.
    e_folds : float
        Growth of a small disturbance between loss of stability and departure: integral of the growth rate.
    """

    rig: Slider | Machine = field(repr=False)
    run: History = field(repr=False)
    t: Array = field(repr=False)
    values: dict[str, Array] = field(repr=False)
    labels: dict[str, str] = field(repr=False)
    growth_rate: Array = field(repr=False)
    critical_stiffness: Array = field(repr=False)
    crossings: tuple[tuple[float, str], ...]
    departure: float
    e_folds: float

    def __str__(self) -> str:
        lines = [f"at the start: {_verdict(self.growth_rate[0])}"]
        for time, verdict in self.crossings:
            lines.append(f"from {format_quantity(time, 's')} on: {verdict}, {self._at(time)}")
        if not self.crossings:
            lines.append("the verdict is the same at every moment")
        begun = _first_unstable(self.growth_rate, self.crossings)
        if np.isfinite(self.departure):
            later = f", {format_quantity(self.departure - begun, 's')} later" if begun else ""
            lines.append(
                f"motion departs at {format_quantity(self.departure, 's')}{later}: "
                f"small disturbances have grown by {self.e_folds:.3g} e-folds by then"
            )
        elif np.isfinite(begun):
            lines.append("motion does not depart from steady sliding before the run ends")
        if self.run.status != "done":
            lines.append(f"the motion ends at {format_quantity(self.run.end, 's')}: {self.run.status}")
        return "\n".join(lines)

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C cut the motion short; the verdicts are complete."""
        return self.run.status == "interrupted"

    @cached_property
    def slip_rates(self) -> dict[str, Array]:
        """Slip rate (m/s) at the times ``run["t"]``, by name of the contact (``""`` for a slider)."""
        return {name: self.run[f"{name}.slip_rate" if name else "v"] for name in self.rig.laws_by_contact()}

    def _at(self, time: float) -> str:
        found = {name: float(np.interp(time, self.t, own)) for name, own in self.values.items()}
        rows = ((value, *self._display(name)) for name, value in found.items())
        return ", ".join(f"{label} {format_quantity(factor * value, unit)}" for value, label, factor, unit in rows)

    def _display(self, name: str) -> tuple[str, float, str]:
        """Label, factor and display unit of a changed parameter; stresses become forces if the rig has an area."""
        factor, unit = outside(self.rig.parameters()[name].role.unit, self.rig.printed_area(name))
        label = self.labels[name]
        return label.replace("normal stress", "normal force") if unit == "N" else label, factor, unit

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units; missing values are null."""
        return {
            "t": self.t.tolist(),
            "values": {name: own.tolist() for name, own in self.values.items()},
            "labels": self.labels,
            "growth_rate": _plain(self.growth_rate),
            "critical_stiffness": _plain(self.critical_stiffness),
            "crossings": [list(one) for one in self.crossings],
            "departure": _plain(np.array([self.departure]))[0],
            "e_folds": _plain(np.array([self.e_folds]))[0],
            "status": self.run.status,
        }

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write one row for each moment: changed parameters, growth rate, critical stiffness, slip rates of the motion.

        Missing values are ``nan``. Stresses become forces if the rig has an area.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        columns = {"time (s)": self.t}
        for name, own in self.values.items():
            label, factor, unit = self._display(name)
            columns[f"{label} ({unit})"] = factor * own
        columns["growth rate (1/s)"] = self.growth_rate
        if self.rig.default_along:
            factor, unit = outside("Pa/m", self.rig.area)
            columns[f"critical stiffness ({unit})"] = factor * self.critical_stiffness
        for name, own in self.slip_rates.items():
            moved = np.interp(self.t, self.run["t"], own, right=np.nan)
            columns[f"{name} slip rate (m/s)".strip()] = moved
        write_columns(path, columns, "%.12g")

    def plot(self, ax: Any = None) -> Any:
        """Draw growth rate and slip rate over time; see `steadyslip.figures.frozen_verdicts`."""
        return draw(self, ax=ax)


STABLE, UNSTABLE, ABSENT = "stable", "unstable", "no steady sliding"


def _first_unstable(rates: Array, crossings: Sequence[tuple[float, str]]) -> float:
    """Time (s) at which steady sliding becomes unstable for the first time; 0 for the start, NaN if never."""
    return 0.0 if rates[0] > 0 else next((time for time, verdict in crossings if verdict == UNSTABLE), np.nan)


def _verdict(rate: float) -> str:
    return ABSENT if np.isnan(rate) else UNSTABLE if rate > 0 else STABLE


def _plain(values: Array) -> list[float | None]:
    return [float(one) if np.isfinite(one) else None for one in values]


@checked(until=DURATION)
def frozen_verdicts(
    rig: Slider | Machine,
    protocol: Any,
    *,
    until: float | str | None = None,
    rtol: float = 1e-7,
    progress: Callable[[float], None] | None = None,
) -> FrozenVerdicts:
    """Verdict at every moment of a slow change of load, velocity or pressure, compared with the motion.

    At each moment the protocol's load-point velocity, normal stresses and injected pressures are held constant, and
    the stability of steady sliding with these values is computed. The verdict is that of an infinitely slow change;
    motion departs later, because disturbances need time to grow, or earlier, where a change is itself a kick.

    Parameters
    ----------
    rig : Slider or Machine
        Contacts whose normal stress or pore pressure the protocol changes need a parameter of load, such as `preload`.
    protocol : Protocol, Piece or sequence of Piece
        Changes of the drive's velocity, of normal stresses and of injected pressures.
    until : float or str, optional
        End, s; the protocol's own unless given.
    rtol : float, optional
        Relative tolerance of the motion.
    progress : callable, optional
        Called with the time reached, s, while the motion goes on.

    Returns
    -------
    FrozenVerdicts

    Raises
    ------
    NotAvailable
        If the protocol pushes a body or releases the drive, or a contact refers its normal stress to the steady
        sliding at the start: these are not steady sliding with other parameters.
    ParameterError
        If an argument is not allowed.

    Examples
    --------
    A rock is pressed ever harder: σ(b − a)/d_c reaches the stiffness of the press at 10 MPa, after 100 s.

    >>> import steadyslip as ss
    >>> rock = ss.laws.RateState(a=.010, b=.015, d_c=1e-5, mu_ref=.6, v_ref=1e-5)
    >>> face, drive = ss.laws.ConstantNormalStress(preload=5e6), ss.machine.SteadyDrive(1e-5)
    >>> press = ss.Slider(friction=rock, contact=face, stiffness=5e9, mass=1e4, drive=drive)
    >>> found = ss.frozen_verdicts(press, ss.protocol.NormalStressRamp(at=0, by=10e6, duration=200), until=400)
    >>> [(round(time), verdict) for time, verdict in found.crossings]
    [(100, 'unstable')]
    >>> found.departure > 100
    True
    """
    slow = _Slow(rig, in_units_of(rig, Protocol.of(protocol)))
    run = simulate(rig, protocol, until=until, rtol=rtol, progress=progress)
    end = float(run.protocol.until or np.nan)
    t = slow.moments(end)
    values = slow.values(t)
    rates, critical = slow.growth_rate(values), slow.critical_stiffness(values)
    crossings = tuple(slow.crossings(t, rates))
    begun = _first_unstable(rates, crossings)
    changed = {name: own for name, own in values.items() if np.ptp(own) > 0}
    labels = {name: slow.effective.get(name, name) for name in changed}
    found = FrozenVerdicts(rig, run, t, changed, labels, rates, critical, crossings, np.nan, np.nan)
    departure = _departure(found, begun)
    between = (t >= begun) & (t <= departure)
    grown = np.trapezoid(np.where(np.isnan(rates), 0.0, rates)[between], t[between]) if np.any(between) else np.nan
    return replace(found, departure=departure, e_folds=float(grown))


class _Slow:
    """A rig whose parameters change by a protocol."""

    def __init__(self, rig: Slider | Machine, plan: Protocol) -> None:
        self.rig, self.plan, self.acting = rig, plan, targets(rig, plan)
        if self.acting.pushes:
            raise NotAvailable("a push or creep has no verdict of its own; change velocity, normal stress or injection")
        _refuse_remembered(rig)
        self.changes: dict[str, dict[int, float]] = {}  # change of each parameter per unit of each input channel
        self.effective: dict[str, str] = {}  # display names of loads reduced by an injected pressure
        for channel, kind, target in self.acting.named().values():
            if kind == "press":
                contact, injected = target.removesuffix(PORES), target.endswith(PORES)
                name, share = _load_of(rig, contact)
                self.changes.setdefault(name, {})[channel] = -share if injected else share
                if injected:
                    self.effective[name] = "effective normal stress" + (f" of {contact}" if contact else "")

    def moments(self, end: float) -> Array:
        """Times (s) of evaluation: evenly spaced, and just before and after each jump."""
        self.segments = pack(self.plan, float(self.rig.drive.velocity), end, self.acting.channels)
        breaks = self.segments.start[0]
        before = np.nextafter(breaks[breaks > 0], 0.0)
        return np.unique(np.concatenate([np.linspace(0.0, end, MOMENTS), breaks, before]))

    def values(self, t: Array) -> dict[str, Array]:
        """Values (n,) of drive velocity and changed loads at times `t` (n,), s; SI units, by name of the parameter."""
        lane = np.zeros(len(t), dtype=int)
        inputs = inputs_at(self.segments, lane, segment_of(self.segments, lane, t), t)
        found = {"drive.velocity": inputs[:, LOAD_POINT]}
        for name, shares in self.changes.items():
            change = np.sum([share * inputs[:, channel] for channel, share in shares.items()], axis=0)
            found[name] = float(self.rig.value(name) or 0.0) + change
        return found

    def growth_rate(self, values: dict[str, Array]) -> Array:
        """Growth rate (n,) of the leading eigenvalue, 1/s; NaN where there is no steady sliding."""
        return self._where_it_slides(growth_rate, values)

    def critical_stiffness(self, values: dict[str, Array]) -> Array:
        """Critical stiffness (n,) of a slider, Pa/m; NaN for a machine."""
        if self.rig.default_along:
            return self._where_it_slides(critical_stiffness, values)
        return np.full(len(values["drive.velocity"]), np.nan)

    def _where_it_slides(self, quantity: Callable[..., Any], values: dict[str, Array]) -> Array:
        """Values (n,) of `quantity` for the rig with changed parameters; NaN where velocity or a load is not > 0."""
        sliding = np.logical_and.reduce([own > 0 for own in values.values()])
        found = np.full(len(sliding), np.nan)
        if np.any(sliding):
            found[sliding] = quantity(self.rig, {name: own[sliding] for name, own in values.items()})
        return found

    def crossings(self, t: Array, rates: Array) -> Iterator[tuple[float, str]]:
        """Yield times (s) at which the verdict changes, each with the new verdict."""
        for i in _changes(rates):
            between = np.linspace(t[i - 1], t[i], REFINED)
            own = self.growth_rate(self.values(between))
            own[0], own[-1] = rates[i - 1], rates[i]
            for j in _changes(own):
                low, high = own[j - 1], own[j]
                share = low / (low - high) if np.isfinite(low) and np.isfinite(high) and low != high else 1.0
                yield float(between[j - 1] + share * (between[j] - between[j - 1])), _verdict(high)


def _changes(rates: Array) -> Array:
    """Indices of the growth rates (n,) whose verdict differs from the verdict at the index before."""
    verdicts = np.array([_verdict(one) for one in rates])
    return np.flatnonzero(verdicts[1:] != verdicts[:-1]) + 1


def _contacts(rig: Slider | Machine) -> dict[str, tuple[ContactLaw, float]]:
    """Contact law and area (m², 1 if the rig has none) of each contact, by the prefix of its parameters' names."""
    return {f"{own.prefix}contact.": (own.contact, own.area or 1.0) for own in rig.laws_by_contact().values()}


def _refuse_remembered(rig: Slider | Machine) -> None:
    """Raise NotAvailable for contact laws that refer to steady sliding at the start: a protocol cannot change that."""
    seen = {one.name: sp.Symbol(one.name) for one in fields(ContactInputs)}
    for prefix, (law, _) in _contacts(rig).items():
        memory = {f"{kind}memory": tuple(sp.symbols([f"{kind}{n}" for n in law.memory()])) for kind in ("", "steady_")}
        stress = sp.sympify(law.normal_stress(ContactInputs(**seen | memory)))
        if any(one.name == "lead" or one.name.startswith("steady_") for one in stress.free_symbols):
            raise NotAvailable(
                f"{prefix.rstrip('.')} refers its normal stress to the steady sliding at the start, which a slow "
                "change leaves; give a preload in place of steady_normal_stress, and none that depends on displacement"
            )


def _load_of(rig: Slider | Machine, contact: str) -> tuple[str, float]:
    """Name of the load parameter of a contact, and its change per unit of the channel that changes normal stress."""
    prefix = f"contacts.{contact}.contact." if contact else "contact."
    law, area = _contacts(rig)[prefix]
    load = law.load()
    for name, own in parameters(law, prefix).items():
        if load is not None and own.role.unit == "Pa" and own.value:
            twice: Any = replaced(law, {name: 2 * own.value}, prefix).load()
            if share := float(twice - load) / own.value:
                return name, 1 / (share * area)
    raise NotAvailable(f"{prefix.rstrip('.')} has no load of its own, such as a preload, that could be changed slowly")


def _departure(found: FrozenVerdicts, begun: float) -> float:
    """First time (s) at which slip is `DEPARTED` times as fast as commanded and as it was at time `begun` (s)."""
    run = found.run
    commanded = run["load_velocity"] / run["load_velocity"][0]
    apart = np.zeros(len(run["t"]), dtype=bool)
    for own in found.slip_rates.values():
        apart |= own > DEPARTED * np.maximum(own[0] * commanded, np.interp(begun, run["t"], own))
    late = np.flatnonzero(apart & (run["t"] >= begun))
    if not late.size and run.status in ENDED and run.end >= begun:
        return run.end
    return float(run["t"][late[0]]) if late.size else np.nan
