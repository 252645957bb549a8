"""A rig taken apart: coordinates, what acts between them, where surfaces touch. From this alone the Model is assembled.

Numbers are those of the rig, or the symbols of its twin. A *row* says how something follows from the coordinates: a
coefficient for each that takes part, such as {"table": 1, "motor": -lead}; `LOAD_POINT` stands for what moves at the
velocity of the drive. Displacements count from steady sliding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw

Shares = Mapping[str, Any]
LOAD_POINT, GROUND = "drive", "ground"
NORMAL = ".normal"
"""Behind a body's name: its coordinate away from the surface."""


@dataclass(frozen=True)
class DegreeOfFreedom:
    """One way in which a body moves: its name, inertia (kg, kg m²), steady speed, and a constant force along it."""

    name: str
    inertia: Any
    speed: Any
    force: Any = 0
    unit: str = "m"


@dataclass(frozen=True)
class Element:
    """A spring beside a dashpot, or what acts as one: forces −`acts`·(stiffness · stretch + damping · stretch rate).

    Attributes
    ----------
    name : str
        Dotted name of the link, or that of the drive; empty where nobody asks for its force.
    acts : Shares
        Where the force acts.
    senses : Shares
        The stretch; for a spring the same row.
    stiffness, damping
        Zero where there is none.
    grounded : bool
        Whether it holds a body back, rather than pulling at it: its force is no part of what a contact law sees as T.
    delay
        Time (s) by which it senses late.
    """

    name: str
    acts: Shares
    senses: Shares
    stiffness: Any
    damping: Any
    grounded: bool = False
    delay: Any = 0


@dataclass(frozen=True)
class Integral:
    """A controller's integral action: a force −`acts`·gain · I with dI/dt = `senses`; with a delay, I that long ago."""

    acts: Shares
    senses: Shares
    gain: Any
    delay: Any = 0


@dataclass(frozen=True)
class ContactPort:
    """Where a body slides on another, or on the ground.

    Attributes
    ----------
    name : str
        Of the contact; empty where there is but one.
    slip, separation : Shares
        Slip, and distance of the surfaces where bodies move away from them; an empty row where they cannot.
    area : float or 1
        Over which the laws' stresses act.
    loaded_by : str
        The element whose force and stiffness the contact law sees as T and k; empty for the force of all that pull at
        the body, and the stiffness between it and the load point.
    """

    name: str
    friction: FrictionLaw
    contact: ContactLaw
    slip: Shares
    separation: Shares
    area: Any
    loaded_by: str = ""


@dataclass(frozen=True)
class Mechanism:
    """All of it.

    Attributes
    ----------
    velocity
        Of the drive.
    gain
        Stiffness that a controller adds to that of the slider.
    axial_share
        A slider's stiffness along the slide over that along its axis, where the latter is given; else None.
    """

    coordinates: tuple[DegreeOfFreedom, ...]
    elements: tuple[Element, ...]
    integral: Integral | None
    contacts: tuple[ContactPort, ...]
    velocity: Any
    gain: Any = 0
    axial_share: Any = None
