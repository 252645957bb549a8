"""Mechanism of a rig, from which the Model is assembled: coordinates, forces between them, contacts.

Values are the rig's numbers, or symbols. A *row* is a linear combination of coordinates: a mapping of their names to
coefficients, such as {"table": 1, "motor": -lead}. The name `LOAD_POINT` stands for the load point, which moves at
the velocity of the drive. Displacements are relative to steady sliding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw

Shares = Mapping[str, Any]
LOAD_POINT, GROUND = "drive", "ground"
NORMAL = ".normal"
"""Suffix of a body's name that makes the name of its coordinate away from the surface."""


@dataclass(frozen=True)
class DegreeOfFreedom:
    """Coordinate of a body: name, inertia (kg or kg m²), steady speed, constant force along it, unit (m or rad).

    An `inner` coordinate belongs to a structure and is not reported.
    """

    name: str
    inertia: Any
    speed: Any
    force: Any = 0
    unit: str = "m"
    inner: bool = False


@dataclass(frozen=True)
class Element:
    """Linear spring and dashpot, or controller: forces −`acts`·(stiffness · stretch + damping · stretch rate).

    Attributes
    ----------
    name : str
        Dotted name of the link; empty if its force is not reported.
    acts : Shares
        Row of the coordinates on which the force acts.
    senses : Shares
        Row of the stretch; for a spring equal to `acts`.
    stiffness, damping
        Per unit of stretch and of its rate; zero if absent.
    grounded : bool
        True for links to the ground: their force is not part of the spring force T of contact laws.
    delay
        Dead time (s) between sensing and acting.
    active : bool
        True for controllers.
    """

    name: str
    acts: Shares
    senses: Shares
    stiffness: Any
    damping: Any
    grounded: bool = False
    delay: Any = 0
    active: bool = False


@dataclass(frozen=True)
class Integral:
    """Integral action of a controller: force −`acts`·gain·I with dI/dt = `senses`; I is taken `delay` (s) ago."""

    acts: Shares
    senses: Shares
    gain: Any
    delay: Any = 0


@dataclass(frozen=True)
class Limits:
    """Nonlinear parts of a controller that holds a place, in SI units; None for each part that it does not have.

    Attributes
    ----------
    on_measurement : bool
        True if the derivative is taken of the measured place, not of the error.
    force, integral : float or None
        Largest force of all terms, and of the integral term.
    dead_band : float or None
        Largest error that counts as zero; with `of_integral` only for the integral.
    sample_time : float or None
        Time (s) between samples; the force is constant in between.
    resolution : float or None
        Step of the encoder.

    `dead_band` and `resolution` are displacements of the driven body (m or rad).
    """

    on_measurement: bool = False
    force: float | None = None
    integral: float | None = None
    dead_band: float | None = None
    of_integral: bool = False
    sample_time: float | None = None
    resolution: float | None = None

    def over(self, ratio: float) -> Limits:
        """Copy with `dead_band` and `resolution` divided by a ratio."""
        band, step = (None if one is None else one / ratio for one in (self.dead_band, self.resolution))
        return replace(self, dead_band=band, resolution=step)


@dataclass(frozen=True)
class ContactPort:
    """Contact of a body that slides on another, or on the ground.

    Attributes
    ----------
    name : str
        Name of the contact; empty for a slider.
    slip, separation : Shares
        Rows of the slip and of the distance of the surfaces; `separation` is empty if the bodies cannot separate.
    area : float or 1
        Area (m²) over which the stresses act; 1 if the laws are in forces.
    loaded_by : str
        Element whose force and stiffness the contact law uses as T and k; if empty, T is the sum of all elements that
        pull at the body, and k the stiffness between the body and the load point.
    """

    name: str
    friction: FrictionLaw
    contact: ContactLaw
    slip: Shares
    separation: Shares
    area: Any
    loaded_by: str = ""


@dataclass(frozen=True, eq=False)
class StructurePart:
    """A structure in a mechanism: coordinates of its n degrees of freedom, and its matrices (SI units).

    Attributes
    ----------
    name : str
    coordinates : tuple of str
        Names of the n coordinates in rows.
    mass, damping, stiffness : ndarray (n, n)
    force, motion : ndarray (n,)
        Constant forces, and the shape of the rigid motion in steady sliding.
    pace
        Speed of the rigid motion: degrees of freedom move at `motion` · `pace`.
    """

    name: str
    coordinates: tuple[str, ...]
    mass: Any
    damping: Any
    stiffness: Any
    force: Any
    motion: Any
    pace: Any


@dataclass(frozen=True)
class Mechanism:
    """Coordinates, elements and contacts of a rig.

    Attributes
    ----------
    structures : tuple of StructurePart
        Bodies given by matrices; only machines have them.
    points : mapping of str to Shares
        Rows of the points of structures along the slide and, with `NORMAL` after the name, away from the surface.
    velocity
        Velocity of the drive (m/s or rad/s).
    gain
        Stiffness that the controller of a slider adds to the spring's.
    axial_share
        Stiffness of a slider along the slide divided by its `axial_stiffness`; None if the latter is not given.
    limits : Limits or None
        Nonlinear parts of the controller; None without one.
    """

    coordinates: tuple[DegreeOfFreedom, ...]
    elements: tuple[Element, ...]
    integral: Integral | None
    contacts: tuple[ContactPort, ...]
    velocity: Any
    gain: Any = 0
    axial_share: Any = None
    structures: tuple[StructurePart, ...] = ()
    points: Mapping[str, Shares] = field(default_factory=dict)
    limits: Limits | None = None

    def pulling(self, port: ContactPort) -> list[Element]:
        """Elements whose forces add up to the pull T at a contact.

        If `loaded_by` is given, this is the named element, else all elements that do not end at the ground. For a body
        that lies on the moving load point, it is all elements that do not end at the load point.
        """
        if port.loaded_by:
            return [one for one in self.elements if one.name == port.loaded_by]
        belt = LOAD_POINT in port.slip
        return [one for one in self.elements if not (LOAD_POINT in one.senses if belt else one.grounded)]
