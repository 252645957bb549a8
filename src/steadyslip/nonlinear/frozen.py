"""The verdict at every moment of a slow change (frozen time), beside the motion that really happens."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked, finite
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.linear.stiffness import critical_stiffness, growth_rate
from steadyslip.machine.input_units import in_units_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.reducing import PORES
from steadyslip.motion import History, simulate
from steadyslip.motion.targets import targets
from steadyslip.protocol import Protocol

Array = np.ndarray
MOMENTS = 1000  # at which the verdict is asked; crossings are interpolated between them
DEPARTED = 2.0  # so many times as fast as asked a block must be for a slip event too


@dataclass(frozen=True, eq=False)
class FrozenVerdicts(ReadOnly):
    """Stability of the steady sliding that belongs to each moment of a protocol, and when motion departs from it.

    Attributes
    ----------
    rig : Slider or Machine
    run : History
        The motion under the protocol.
    t : ndarray (n,)
        Moments, s.
    values : dict of str to ndarray (n,)
        Parameters of the rig that the protocol changes, SI units: velocity of the drive, preloads.
    growth_rate : ndarray (n,)
        Of the leading eigenvalue, 1/s; NaN where there is no steady sliding.
    critical_stiffness : ndarray (n,)
        Of a slider, Pa/m; NaN where there is none, and of machines.
    crossings : tuple of (float, str)
        Times (s) at which the verdict changes, and to what: ``unstable``, ``stable`` or ``no steady sliding``.
    departure : float
        Time (s) at which, after the first of those to unstable, a body is twice as fast as the drive asks, and twice as
        fast as at that crossing (a ramp of the load slows or quickens slip by itself); NaN if that does not happen.
    e_folds : float
        Growth of a small disturbance from that crossing to the departure: integral of the growth rate.
    """

    rig: Slider | Machine = field(repr=False)
    run: History = field(repr=False)
    t: Array = field(repr=False)
    values: dict[str, Array] = field(repr=False)
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
        begun = next((time for time, verdict in self.crossings if verdict == UNSTABLE), None)
        if begun is None and self.growth_rate[0] > 0:
            begun = 0.0
        if begun is not None and np.isfinite(self.departure):
            lines.append(
                f"motion departs at {format_quantity(self.departure, 's')}, "
                f"{format_quantity(self.departure - begun, 's')} later: "
                f"small disturbances have grown by {self.e_folds:.3g} e-folds by then"
            )
        elif begun is not None:
            lines.append("motion does not depart from steady sliding before the run ends")
        return "\n".join(lines)

    def _at(self, time: float) -> str:
        known = self.rig.parameters()
        found = ((name, float(np.interp(time, self.t, own))) for name, own in self.values.items())
        return ", ".join(f"{n} {format_quantity(v, known[n].role.unit, area=self.rig.area_of(n))}" for n, v in found)

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-ready dict, SI units; what does not exist is null."""
        return {
            "t": self.t.tolist(),
            "values": {name: own.tolist() for name, own in self.values.items()},
            "growth_rate": _plain(self.growth_rate),
            "critical_stiffness": _plain(self.critical_stiffness),
            "crossings": [list(one) for one in self.crossings],
            "departure": _plain(np.array([self.departure]))[0],
            "e_folds": _plain(np.array([self.e_folds]))[0],
            "status": self.run.status,
        }

    def plot(self, ax: Any = None) -> Any:
        """Draw growth rate and slip rate over time; see `steadyslip.figures.frozen_verdicts`."""
        return draw(self, ax=ax)


STABLE, UNSTABLE, ABSENT = "stable", "unstable", "no steady sliding"


def _verdict(rate: float) -> str:
    return ABSENT if np.isnan(rate) else UNSTABLE if rate > 0 else STABLE


def _plain(values: Array) -> list[float | None]:
    return [float(one) if np.isfinite(one) else None for one in values]


@checked(until=finite(0))
def frozen_verdicts(
    rig: Slider | Machine, protocol: Any, *, until: float | None = None, rtol: float = 1e-7
) -> FrozenVerdicts:
    """Verdict at every moment of a slow change of load, velocity or pressure, beside the motion.

    At each moment the protocol's load-point velocity, normal stresses and injected pressures are taken for constant,
    and the stability of that steady sliding is asked. It says what a rig would do if it were changed slowly enough;
    motion departs later, because disturbances need time to grow, or earlier, where changes are themselves a kick.

    Parameters
    ----------
    rig : Slider or Machine
        Contacts that are pressed or injected at have a `preload`.
    protocol : Protocol, Piece or sequence of Piece
        Changes of the drive's velocity, of normal stresses and of injected pressures.
    until : float, optional
        End, s; the protocol's own unless given.
    rtol : float, optional
        Relative tolerance of the motion.

    Returns
    -------
    FrozenVerdicts

    Raises
    ------
    NotAvailable
        If the protocol pushes a body or lets the drive go: such a state has no steady sliding with the same parameters.
    ParameterError
        If anything given is wrong.

    Examples
    --------
    A rock is pressed ever harder: σ(b − a)/d_c reaches the stiffness of the press at 10 MPa, after 100 s.

    >>> import steadyslip as ss
    >>> rock = ss.RateState(a=.010, b=.015, d_c=1e-5, mu_ref=.6, v_ref=1e-5)
    >>> face, drive = ss.Constant(preload=5e6), ss.Steady(1e-5)
    >>> press = ss.Slider(friction=rock, contact=face, stiffness=5e9, mass=1e4, drive=drive)
    >>> found = ss.frozen_verdicts(press, ss.NormalStressRamp(at=0, by=10e6, duration=200), until=400)
    >>> [(round(time), verdict) for time, verdict in found.crossings]
    [(100, 'unstable')]
    >>> found.departure > 100
    True
    """
    plan = in_units_of(rig, Protocol.of(protocol))
    acting = targets(rig, plan)
    if acting.pushes:
        raise NotAvailable("a push or creep has no verdict of its own; change velocity, normal stress or injection")
    changed = {name: target for name, (_, kind, target) in acting.named().items() if kind == "press"}
    run = simulate(rig, plan, until=until, rtol=rtol)
    t = np.linspace(0.0, run.end, MOMENTS)
    along = {name: np.interp(t, run["t"], run[name]) for name in ("load_velocity", *changed)}
    values = {"drive.velocity": along["load_velocity"]}
    for name, target in changed.items():
        parameter = _preload(rig, target.removesuffix(PORES))
        before = values.get(parameter, float(rig.value(parameter) or 0.0))
        values[parameter] = before - along[name] if target.endswith(PORES) else before + along[name]
    values = {name: own for name, own in values.items() if np.ptp(own) > 0}
    sliding = np.logical_and.reduce([own > 0 for own in values.values()], initial=True)
    rates, critical = np.full(MOMENTS, np.nan), np.full(MOMENTS, np.nan)
    if np.any(sliding):
        there = {name: own[sliding] for name, own in values.items()}
        rates[sliding] = growth_rate(rig, there)
        if isinstance(rig, Slider):
            critical[sliding] = critical_stiffness(rig, there)
    crossings = tuple(_crossings(t, rates))
    begun = 0.0 if rates[0] > 0 else next((time for time, verdict in crossings if verdict == UNSTABLE), np.nan)
    departure = _departure(run, begun)
    between = (t >= begun) & (t <= departure)
    grown = float(np.trapezoid(np.nan_to_num(rates[between]), t[between])) if np.any(between) else np.nan
    return FrozenVerdicts(rig, run, t, values, rates, critical, crossings, departure, grown)


def _preload(rig: Slider | Machine, contact: str) -> str:
    """The parameter that a constant change of the normal stress adds to."""
    law = rig.contacts[contact].contact if isinstance(rig, Machine) else rig.contact
    prefix = f"contacts.{contact}." if isinstance(rig, Machine) else "contact."
    name = next((one for one in rig.of_kind("normal stress") if one.startswith(prefix)), None)
    if name is None or law.load() is None:
        raise NotAvailable(f"{prefix.rstrip('.')} is not given by its preload; no other can be changed slowly")
    return name


def _crossings(t: Array, rates: Array) -> Iterator[tuple[float, str]]:
    """Where the verdict changes, between moments by a straight line, and what it becomes."""
    verdicts = [_verdict(one) for one in rates]
    for i in range(1, len(t)):
        if verdicts[i] != verdicts[i - 1]:
            low, high = rates[i - 1], rates[i]
            share = low / (low - high) if np.isfinite(low) and np.isfinite(high) and low != high else 1.0
            yield float(t[i - 1] + share * (t[i] - t[i - 1])), verdicts[i]


def _departure(run: History, begun: float) -> float:
    """When a body is first twice as fast as the drive asks, and as it was when sliding became unstable."""
    if np.isnan(begun):
        return np.nan
    asked = run["load_velocity"] / run["load_velocity"][0]
    apart = np.zeros(len(run["t"]), dtype=bool)
    for name in run.data:
        if (name == "v" or name.endswith(".v")) and run[name][0] > 0:
            least = np.maximum(run[name][0] * asked, np.interp(begun, run["t"], run[name]))
            apart |= run[name] > DEPARTED * least
    found = np.flatnonzero(apart & (run["t"] >= begun))
    return float(run["t"][found[0]]) if found.size else np.nan
