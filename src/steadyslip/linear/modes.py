"""Modes of a machine: complex amplitude of every coordinate, and shares of the energy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.core.pages import Displayed
from steadyslip.laws.contact import ContactInputs
from steadyslip.linear.pencil import matrix_function
from steadyslip.linear.roots import ComplexArray
from steadyslip.linear.spectrum import spectrum
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import NORMAL, ContactPort, Mechanism
from steadyslip.model.linearisation import characteristic_rows
from steadyslip.model.numeric.machine_point import MachinePoint
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import delays_of
from steadyslip.model.start import coordinate_speeds

WORDS = {
    "oscillate": "oscillates|oscillate", "drift": "drifts|drift", "still": "hardly moves|hardly move",
    "opposed": " against each other", "the": "the {name}", "and": " and ", "way": " ({way})",
    "along": "along the surface", "away": "away from the surface", "both": "along the surface and away from it",
    "hardly_along": " and hardly along it", "hardly_away": " and hardly away from it",
    "share": "{name} with {share} of the largest amplitude",
    "energy": "; {share} of the energy is in the {name}", "most": " most, of {count} coordinates",
    "unseen": "no named point moves",
}  # fmt: skip
"""Phrases for `Mode.words`, singular|plural; pages use the same keys."""
MOVES, HARDLY = 0.5, 0.1  # share of the largest amplitude from which a body oscillates; below which it hardly moves
UNSEEN = 1e-9  # share of a structure's largest amplitude below which the motion of points is rounding error
MANY, NAMED = 8, 3  # if a machine has more coordinates than MANY, a sentence names the NAMED that move most


@dataclass(frozen=True)
class Mode(Displayed):
    """One mode of small motion about steady sliding.

    Attributes
    ----------
    eigenvalue : complex
        Eigenvalue, 1/s.
    amplitudes : dict of str to complex
        Amplitude of every coordinate over the largest. Amplitudes of bodies that move in steady sliding are first
        divided by the ratio of their speed to the drive's, so that motors and tables compare. Names that end in
        ``.normal`` are motion away from the surface.
    kinetic, elastic : dict of str to float
        Shares of the energy over a cycle, by dotted name of bodies, links and contacts; their total is one.
    number : int
        Place among the oscillations by rising frequency, from 1; 0 without oscillation.
    """

    eigenvalue: complex
    amplitudes: Mapping[str, complex]
    kinetic: Mapping[str, float]
    elastic: Mapping[str, float]
    number: int = 0

    @property
    def energy(self) -> dict[str, float]:
        """Shares of the energy, kinetic and elastic together, by dotted name."""
        both = dict.fromkeys((*self.kinetic, *self.elastic))
        return {name: self.kinetic.get(name, 0.0) + self.elastic.get(name, 0.0) for name in both}

    @property
    def frequency(self) -> float:
        """Frequency in Hz; 0 without oscillation."""
        return abs(self.eigenvalue.imag) / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio −Re λ/|λ|; negative if the mode grows."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if self.eigenvalue else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units."""
        return {
            "eigenvalue": [self.eigenvalue.real, self.eigenvalue.imag],
            "number": self.number,
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "amplitudes": {name: [one.real, one.imag] for name, one in self.amplitudes.items()},
            "energy": self.energy,
            "kinetic": dict(self.kinetic),
            "elastic": dict(self.elastic),
            "words": self.words(),
        }

    def words(self) -> str:
        """Sentence that describes which bodies move, how, and where the energy is."""
        sizes = {name: abs(one) for name, one in self.amplitudes.items()}
        leads = [name for name, size in sizes.items() if size >= MOVES]
        rest = [name for name, size in sizes.items() if HARDLY <= size < MOVES]
        still = [name for name, size in sizes.items() if size < HARDLY]
        if many := len(sizes) > MANY:
            leads, rest, still = sorted(sizes, key=lambda name: -sizes[name])[:NAMED], [], []
        movers = list(dict.fromkeys(name.removesuffix(NORMAL) for name in leads))
        moves = _does("oscillate" if self.eigenvalue.imag else "drift", movers)
        if not movers:
            parts, still = [WORDS["unseen"]], []
        elif len(movers) == 1:
            parts = [f"{_listed(movers)} {moves}{self._direction(movers[0], leads, still)}"]
            still = [name for name in still if name.removesuffix(NORMAL) != movers[0]]
        else:
            parts = [f"{_listed([self._with_way(name, leads) for name in movers])} {moves}"]
        if many:
            parts[0] += WORDS["most"].format(count=len(sizes))
        if len(leads) == 2 and self._opposed(*leads):
            parts[0] += WORDS["opposed"]
        if rest:
            called = ((self._with_way(name.removesuffix(NORMAL), [name]), sizes[name]) for name in rest)
            parts.append(
                ", ".join(WORDS["share"].format(name=name, share=format_percent(size)) for name, size in called)
            )
        if still:
            bodies = list(dict.fromkeys(name.removesuffix(NORMAL) for name in still))
            parts.append(f"{_listed([self._with_way(one, still) for one in bodies])} {_does('still', bodies)}")
        text = ", ".join(parts)
        if self.energy:
            shares = {
                name: round(share, 3) for name, share in self.energy.items()
            }  # kinetic and elastic energy often have similar shares
            most = max(shares, key=lambda name: shares[name])
            text += WORDS["energy"].format(share=format_percent(shares[most]), name=most.partition(".")[2])
        return text

    def _way(self, body: str, names: list[str]) -> str:
        """Directions in which a body moves, by the coordinates in `names`.

        Empty for a body that can only move along its surface.
        """
        if body + NORMAL not in self.amplitudes:
            return ""
        away = body + NORMAL in names
        return WORDS["both" if away and body in names else "away" if away else "along"]

    def _with_way(self, body: str, names: list[str]) -> str:
        way = self._way(body, names)
        return body + WORDS["way"].format(way=way) if way else body

    def _direction(self, body: str, leads: list[str], still: list[str]) -> str:
        """Clause that says in which directions the only oscillating body moves, and in which it hardly moves."""
        way = self._way(body, leads)
        hardly = WORDS["hardly_along"] if body in still else WORDS["hardly_away"] if body + NORMAL in still else ""
        return f" {way}{hardly}" if way else ""

    def _opposed(self, one: str, other: str) -> bool:
        same = one.removesuffix(NORMAL) == other.removesuffix(NORMAL)
        return not same and bool((self.amplitudes[one] * np.conj(self.amplitudes[other])).real < 0)

    def __str__(self) -> str:
        rows = [f"mode with eigenvalue {self.eigenvalue:.6g} 1/s: {self.words()}"]
        rows += [
            f"  {name:<20} {abs(a):.4g} at {np.degrees(np.angle(a)):.4g} deg" for name, a in self.amplitudes.items()
        ]
        rows += [f"  {name:<20} {format_percent(round(share, 3))} of the energy" for name, share in self.energy.items()]
        if self.eigenvalue.imag:
            rows.append(f"  period {format_quantity(2 * np.pi / abs(self.eigenvalue.imag), 's')}")
        return "\n".join(rows)


def _does(what: str, names: list[str]) -> str:
    """Verb of the phrase `what`: in the singular for one name, in the plural for several."""
    return WORDS[what].split("|")[len(names) > 1]


def _listed(names: list[str]) -> str:
    words = [WORDS["the"].format(name=name) for name in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + WORDS["and"] + words[-1]


def mode_of(rig: Machine, point: OperatingPoint, s: complex) -> Mode:
    """Mode of a machine for the eigenvalue `s` (1/s)."""
    model = point.model
    size = len(characteristic_rows(model))
    powers, function = matrix_function(model)
    entries = np.array([float(e) for e in point.evaluate(function)]).reshape(size, size, len(powers))
    with np.errstate(all="ignore"):
        late = np.exp(-s * delays_of(point))
        factors = np.array([s ** own[0] * np.prod(late ** np.array(own[1:])) for own in powers])
        shape = _null_vector(entries @ factors, np.abs(entries) @ np.abs(factors))
    if not np.all(np.isfinite(shape)):
        raise NotAvailable("the shape of this mode leaves the range of floating point")
    places = dict(zip((one.name for one in model.coordinates), shape, strict=False))
    speeds = [float(x) for x in point.evaluate(coordinate_speeds(model))]
    drive = float(point.drive)
    scaled = {
        one.name: places[one.name] * (drive / speed if speed else 1.0)
        for one, speed in zip(model.coordinates, speeds, strict=True)
    }
    largest = max(scaled.values(), key=abs)
    if largest == 0:  # memory alone
        largest = 1.0
    amplitudes = {name: complex(one / largest) for name, one in scaled.items()}
    return Mode(s, amplitudes, *_energies(rig, places, s), _number(s, spectrum(point)))


def _number(s: complex, eigenvalues: ComplexArray) -> int:
    """Place of an oscillation by rising frequency among all, from 1; 0 if the eigenvalue `s` does not oscillate."""
    return int(np.sum((eigenvalues.imag > 0) & (eigenvalues.imag <= abs(s.imag))))


def _null_vector(matrix: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Null vector of a singular matrix; rows and columns of very different size are balanced first.

    Balancing uses `sizes`, which are sums of the absolute values of the terms of each entry. If the terms of a row
    cancel at the eigenvalue, the rounding error of the row is then not amplified.
    """
    columns = np.ones(len(matrix))
    for _ in range(3):
        rows = np.max(sizes * columns, axis=1, keepdims=True)
        columns = columns / np.maximum(np.max(sizes * columns / rows, axis=0), 1e-300)
    scaled = matrix * columns / np.max(sizes * columns, axis=1, keepdims=True)
    if not np.all(np.isfinite(scaled)):
        return np.full(len(matrix), np.nan)
    return np.asarray(np.linalg.svd(scaled)[2][-1].conj() * columns)


def matrix_mode(point: MachinePoint, s: complex) -> Mode:
    """Mode of a machine given by matrices for the eigenvalue `s` (1/s), with amplitudes of bodies and named points."""
    machine, names = point.machine, point.matrices.names
    shape = point.pencil.mode(s)[: len(names)]
    places = dict(zip(names, shape, strict=True))
    speeds, drive = machine.speeds(), float(machine.drive.velocity)
    scaled = {}
    for end in machine.ends():
        for name, row in ((end, machine.row(end, "x")), (end + NORMAL, machine.row(end, "y"))):
            if row:
                speed = float(speeds[end]) if name == end else 0.0
                moved = sum(float(share) * places[one] for one, share in row.items())
                scaled[name] = moved * (drive / speed if speed else 1.0)
    largest = max(scaled.values(), key=abs, default=0.0)
    if abs(largest) <= UNSEEN * max(map(abs, places.values())):
        scaled, largest = dict.fromkeys(scaled, 0.0), 1.0
    amplitudes = {name: complex(one / largest) for name, one in scaled.items()}
    return Mode(s, amplitudes, *_energies(machine, places, s), _number(s, point.pencil.eigenvalues))


@dataclass(frozen=True)
class EnergyStore:
    """Energy of a body, link or contact: `weight` · |amplitude along `row`|², times |s|² if the energy is kinetic."""

    name: str
    kinetic: bool
    weight: Any
    row: Mapping[str, Any]


def stores(mechanism: Mechanism) -> list[EnergyStore]:
    """Energies of the bodies, links and contacts of a mechanism, in numbers or symbols; one name may have several."""
    names = {one.name for one in mechanism.coordinates}
    names |= {name for part in mechanism.structures for name in part.coordinates}
    found = [
        EnergyStore(f"bodies.{one.name.removesuffix(NORMAL)}", True, one.inertia, {one.name: 1})
        for one in mechanism.coordinates
        if one.inertia
    ]
    for element in mechanism.elements:
        row = {n: c for n, c in element.senses.items() if n in names}
        beside = not element.delay and row == dict(element.acts)
        # a controller that acts where it senses stores energy like a spring
        if element.stiffness and (element.name or beside):
            found.append(EnergyStore(element.name or "drive.controller", False, element.stiffness, row))
    for touch in mechanism.contacts:
        if touch.separation and touch.contact.is_compliant():
            found.append(
                EnergyStore(f"contacts.{touch.name}", False, touch.area * _stiffness_of(touch), touch.separation)
            )
    return found


def _energies(rig: Machine, places: Mapping[str, complex], s: complex) -> tuple[dict[str, float], dict[str, float]]:
    """Shares of the energy, averaged over a cycle, by name of body, link or contact: kinetic, and elastic."""
    found: tuple[dict[str, float], dict[str, float]] = {}, {}
    mechanism = rig.mechanism()
    for part in mechanism.structures:
        shape = np.array([places[name] for name in part.coordinates])
        for held, matrix, factor in zip(found, (part.mass, part.stiffness), (abs(s) ** 2, 1.0), strict=True):
            held[f"bodies.{part.name}"] = factor * float(np.real(shape.conj() @ matrix @ shape))
    for one in stores(mechanism):
        stretch = sum(float(c) * places[name] for name, c in one.row.items())
        held = found[0 if one.kinetic else 1]
        held[one.name] = held.get(one.name, 0.0) + float(one.weight) * abs(s * stretch if one.kinetic else stretch) ** 2
    total = sum(found[0].values()) + sum(found[1].values())
    if not (total > 0 and np.isfinite(total)):
        return {}, {}
    kinetic, elastic = ({name: value / total for name, value in held.items()} for held in found)
    return kinetic, elastic


def _stiffness_of(touch: ContactPort) -> Any:
    """Normal stiffness of a contact, from its law."""
    at_rest = ContactInputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    apart = replace(at_rest, separation=1.0)
    return touch.contact.normal_stress(at_rest) - touch.contact.normal_stress(apart)
