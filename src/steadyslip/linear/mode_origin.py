"""Forces that feed energy into a mode, and pairs of modes that couple.

With λ the eigenvalue, every force of the linearised machine does work on the mode's motion. Elastic and kinetic energy
E grow at 2 Re λ E, so that the powers of all other forces, over 2 E, add up exactly to the growth rate. The power of a
contact's friction is split into two parts: of friction that follows slip rate (it feeds energy if it falls with
velocity), and of friction that follows the normal force, which couples two modes whose frequencies would meet without
damping (theory 11, 13).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.core.pages import Displayed
from steadyslip.linear.roots import ComplexArray
from steadyslip.model.numeric.balance import state_of
from steadyslip.model.numeric.machine_matrices import Site
from steadyslip.model.numeric.machine_point import MachinePoint

WORDS = {
    "coupling": "modes {first} and {second} meet at {frequency} where friction at {name} exceeds {friction}, damping "
    "left aside: friction that follows the normal force couples them",
    "early": "mode {number} at {frequency} grows: friction at {name}, which follows the normal force, couples modes "
    "{first} and {second}; without damping they would meet, and one grow, only where friction exceeds {friction}",
    "normal force": "mode {number} at {frequency} grows: friction at {name}, which follows the normal force, feeds it",
    "velocity": "mode {number} at {frequency} grows: friction at {name} falls with velocity and feeds it",
    "other": "mode {number} at {frequency} grows: the {name} feeds it",
}
"""Sentences on why an oscillation grows, by the kind of `Origin`."""
BY_VELOCITY, BY_NORMAL = " by velocity", " by normal force"
CONTROLLER = "drive.controller"
_STEPS = 16  # number of steps between no friction and the machine's friction, at which the two modes are followed
_MOST = 4.0  # largest multiple of the machine's friction up to which a meeting of frequencies is sought
_ROUNDS, _LAST = 60, 4 * np.finfo(float).eps  # regula falsi: most steps, and relative size of the last step
_SAME = 1e-6  # relative difference of frequencies that counts as rounding of a double root
_ALIKE = 0.5  # other contacts are counted if they feed at least this share of what the largest contact feeds
_NEAR = 0.25  # largest relative difference between the frequency of a growing mode and that at which two modes meet


@dataclass(frozen=True)
class Origin(Displayed):
    """Reason why an oscillation grows; `words` is its text.

    Attributes
    ----------
    kind : str
        A key of `WORDS`.
    name : str
        Contact, or dotted name of another force, that feeds most energy into the mode.
    number : int
        `Mode.number` of the mode.
    frequency : float
        Frequency (Hz) of the mode, or at which two modes meet.
    feeds : dict of str to float
        Contributions to the growth rate (1/s) by name of the force; their sum is the growth rate.
    modes : tuple of int
        Numbers by rising frequency of the two modes that meet; empty if none do.
    friction : float or None
        Friction coefficient of the contact at which the modes meet, if friction of all contacts is scaled alike.
    others : int
        Number of further contacts that feed the mode by the same mechanism, each at least half as much.
    """

    kind: str
    name: str
    number: int
    frequency: float
    feeds: Mapping[str, float]
    modes: tuple[int, ...] = ()
    friction: float | None = None
    others: int = 0

    @property
    def words(self) -> str:
        """The reason as a clause."""
        friction = "" if self.friction is None else f"{self.friction:.3g}"
        first, second = self.modes or (0, 0)
        frequency = format_quantity(self.frequency, "Hz")
        several = f" and {self.others} other contact{'s' * (self.others > 1)}" if self.others else ""
        return WORDS[self.kind].format(
            number=self.number,
            frequency=frequency,
            name=self.name + several,
            friction=friction,
            first=first,
            second=second,
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units."""
        return asdict(self) | {"feeds": dict(self.feeds), "modes": list(self.modes), "words": self.words}


def origin_of(point: MachinePoint, s: complex, number: int) -> Origin:
    """Reason why the oscillation with the eigenvalue `s` (1/s) grows; `number` is its place by frequency."""
    feeds = feeds_of(point, s)
    most = max(feeds, key=lambda name: feeds[name])
    name, frequency = most.partition(".")[2], abs(s.imag) / (2 * np.pi)
    if most.endswith(BY_VELOCITY):
        alike = [one for key, one in feeds.items() if key.endswith(BY_VELOCITY) and one >= _ALIKE * feeds[most]]
        return Origin("velocity", name.removesuffix(BY_VELOCITY), number, frequency, feeds, others=len(alike) - 1)
    if not most.endswith(BY_NORMAL):
        return Origin("other", name, number, frequency, feeds)
    name = name.removesuffix(BY_NORMAL)
    met = _Undamped(point, s).meeting()
    if met is None:
        return Origin("normal force", name, number, frequency, feeds)
    share, first, where = met
    at = next(i for i, site in enumerate(point.matrices.sites) if site.name == name)
    friction = share * float(point.balance.tau[at] / point.balance.sigma[at])
    if share > 1:
        return Origin("early", name, number, frequency, feeds, (first, first + 1), friction)
    return Origin("coupling", name, number, where / (2 * np.pi), feeds, (first, first + 1), friction)


def feeds_of(point: MachinePoint, s: complex) -> dict[str, float]:
    """Contributions to the growth rate Re `s` (1/s) by dotted name of the force; springs contribute none."""
    names, mechanism = point.matrices.names, point.machine.mechanism()
    state = point.pencil.mode(s)
    q: ComplexArray = state[: len(names)]
    places = dict(zip(names, q, strict=True))
    work: dict[str, float] = {}
    energy = 0.25 * abs(s) ** 2 * _form(point.matrices.mass, q)

    def add(name: str, rate: Any, force: Any, held: float = 0.0) -> None:
        """Add the power of a force at the velocity `rate`; `held` is the elastic energy that it stores."""
        nonlocal energy
        work[name] = work.get(name, 0.0) + 0.5 * float((np.conj(rate) * force).real) + 2 * s.real * held
        energy += held

    for part in mechanism.structures:
        own = np.array([places[name] for name in part.coordinates])
        held = 0.25 * _form(part.stiffness, own)
        add(f"bodies.{part.name}", 1.0, -np.conj(s * own) @ (part.stiffness + s * part.damping) @ own, held)
    for one in mechanism.elements:
        acts, senses = ({n: float(c) for n, c in row.items() if n in places} for row in (one.acts, one.senses))
        moved, sensed = (sum(c * places[n] for n, c in row.items()) for row in (acts, senses))
        held = 0.25 * float(one.stiffness) * abs(moved) ** 2 if acts == senses else 0.0
        add(one.name or CONTROLLER, s * moved, -(float(one.stiffness) + s * float(one.damping)) * sensed, held)
    if mechanism.integral is not None:
        moved = sum(float(c) * places[n] for n, c in mechanism.integral.acts.items())
        add(CONTROLLER, s * moved, -float(mechanism.integral.gain) * state[-1])
    start = 2 * len(names)
    for i, site in enumerate(point.matrices.sites):
        answer = _ContactResponse(point, i, s)
        width = len(site.laws.memory) + len(site.laws.states)
        inner = state[start + len(site.laws.memory) : start + width]
        start += width
        rate, apart = s * (site.slip @ q), site.apart @ q
        sigma = answer.normal(q, inner, state[-1] if point.matrices.integrates else 0.0, rate)
        add(f"contacts.{site.name}{BY_VELOCITY}", rate, -site.area * answer.by_velocity * rate)
        add(f"contacts.{site.name}{BY_NORMAL}", rate, -site.area * answer.by_normal * sigma)
        held = 0.25 * float(site.area) * max(-answer.slopes.normal[5], 0.0) * abs(apart) ** 2
        add(f"contacts.{site.name}", s * apart, site.area * sigma, held)
    return {name: value / (2 * energy) for name, value in work.items()}


def _form(matrix: Array, shape: ComplexArray) -> float:
    return float((shape.conj() @ matrix @ shape).real)


class _ContactResponse:
    """Response of a contact's friction to slip rate and normal stress at one s (1/s): τ = Z v + m σ (theory 13)."""

    def __init__(self, point: MachinePoint, i: int, s: complex) -> None:
        self.site: Site = point.matrices.sites[i]
        self.s = s
        given = state_of(self.site, point.balance, i, point.matrices.speeds)
        self.slopes = self.site.laws.slopes(self.site.own, *given)
        by = self.slopes.strength[:3].astype(complex)
        if (many := len(self.slopes.rates)) > 0:
            inner = s * np.eye(many) - self.slopes.rates[:, 3:]
            by += self.slopes.strength[3:] @ np.linalg.solve(inner, self.slopes.rates[:, :3])
        self.by_velocity, self.by_normal = by[0] / (1 - by[2]), by[1] / (1 - by[2])

    def normal(self, q: ComplexArray, states: ComplexArray, integral: complex, rate: Any) -> Any:
        """Normal stress in a mode with displacements q, states of the contact law and integral of the controller."""
        site, s, n = self.site, self.s, self.slopes.normal
        pull = site.pull @ q + s * (site.pull_rate @ q) + site.pull_integral * integral
        free = (n[0] / s + n[1] + n[2] * s) * rate + n[3] * pull + (n[5] + s * n[6]) * (site.apart @ q) + n[7:] @ states
        return (free + n[4] * self.by_velocity * rate) / (1 - n[4] * self.by_normal)

    def undamped(self) -> tuple[float, Array, Array]:
        """Re m, and derivatives of the normal stress by displacements and by accelerations (n,), without damping."""
        site, n = self.site, self.slopes.normal
        return float(self.by_normal.real), n[0] * site.slip + n[3] * site.pull + n[5] * site.apart, n[2] * site.slip


class _Undamped:
    """The machine without damping, and with a given share of the part of friction that follows the normal force."""

    def __init__(self, point: MachinePoint, s: complex) -> None:
        self.target, self.matrices = s, point.matrices
        self.answers = [_ContactResponse(point, i, 1j * abs(s.imag)) for i in range(len(point.matrices.sites))]

    def squares(self, share: float) -> ComplexArray:
        """Values of λ² if friction that follows the normal force is multiplied by `share`."""
        from scipy.linalg import eig  # slow to import

        mass, stiffness = self.matrices.mass.copy(), self.matrices.stiffness.copy()
        for one in self.answers:
            site, (factor, by_place, by_acceleration) = one.site, one.undamped()
            friction = share * factor
            pushed = site.area * (site.apart - friction * site.slip) / (1 - friction * one.slopes.normal[4])
            stiffness -= np.outer(pushed, by_place)
            mass -= np.outer(pushed, by_acceleration)
        found = eig(-stiffness, mass, right=False)
        return np.asarray(found[np.isfinite(found)])

    def _pair(self, share: float, near: complex) -> tuple[complex, float]:
        """Mean of the two roots λ² nearest to `near`, and the square of half their distance: < 0 for a complex pair."""
        found = self.squares(share)
        upper = found[(found.imag >= 0) & (found.real < 0)]
        if not upper.size:
            return near, np.nan
        first = upper[np.argmin(np.abs(upper - near))]
        if first.imag > 0:
            return complex(first.real), -(float(first.imag) ** 2)
        real = np.sort(upper[upper.imag == 0].real)
        if len(real) < 2:
            return near, np.nan
        gaps = np.abs(0.5 * (real[1:] + real[:-1]) - near.real)
        at = int(np.argmin(gaps))
        return complex(0.5 * (real[at] + real[at + 1])), float(0.25 * (real[at + 1] - real[at]) ** 2)

    def meeting(self) -> tuple[float, int, float] | None:
        """Share of friction at which two modes meet, number of the lower mode, and frequency (rad/s).

        None if no modes meet.
        """
        goal = complex(-(abs(self.target.imag) ** 2))
        middle, apart = self._pair(1.0, goal)
        steps = np.linspace(1.0, 0.0, _STEPS + 1)[1:] if apart < 0 else np.linspace(1.0, _MOST, 3 * _STEPS + 1)[1:]
        before, started = 1.0, apart
        for share in steps:
            near = middle
            middle, apart = self._pair(float(share), near)
            if not np.isfinite(apart):
                return None
            if (apart < 0) != (started < 0):
                break
            before = float(share)
        else:
            return None
        found = self._double(before, float(share), near)
        middle, _ = self._pair(found, near)
        where = float(np.sqrt(-middle.real))
        if abs(where - abs(self.target.imag)) > _NEAR * abs(self.target.imag):
            return None
        others = np.sqrt(np.maximum(-self.squares(found).real, 0.0)) / where
        return found, int(np.sum((others > _SAME) & (others < 1 - _SAME))) + 1, where

    def _double(self, low: float, high: float, near: complex) -> float:
        """Share of the friction in a bracket at which the two roots near `near` are equal, by regula falsi."""
        below, above = self._pair(low, near)[1], self._pair(high, near)[1]
        share = low
        for _ in range(_ROUNDS):
            before, share = share, low - below * (high - low) / (above - below)
            now = self._pair(share, near)[1]
            if abs(share - before) <= _LAST * share or now == 0:
                break
            if (now < 0) == (below < 0):
                low, below, above = share, now, 0.5 * above  # Illinois: halve the end that stays
            else:
                high, above, below = share, now, 0.5 * below
        return share
