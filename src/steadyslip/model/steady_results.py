"""States of steady sliding as results, and the messages for rigs without steady sliding."""

from __future__ import annotations

from dataclasses import dataclass, field

from steadyslip.core.areas import stress_name
from steadyslip.core.format import format_quantity
from steadyslip.core.pages import Displayed

ABSENT = {
    "lock-up": "lock-up{at}. The pull raises friction by more than itself: 1 − μss dσ/dτ = {margin}, must be > 0",
    "lift-off": "lift-off{at}. The motion takes away more normal {force} than the contact has: {load} less {taken} "
    "leaves {left}, must be > 0",
    "no solution": "no positive normal {force} satisfies the contact law at the steady shear {force}{at}",
    "together": "lock-up{at}. Contacts press on each other by more than they are pressed: 1 − gain = {margin}, must be "
    "> 0",
    "lifted": "lift-off{at}. Its normal force would be {left}, must be > 0",
    "at": " at contact {name}",
}
"""Message templates for missing steady sliding, also used by browser pages."""


@dataclass(frozen=True)
class SteadySliding(Displayed):
    """A state of steady sliding of a slider.

    Attributes
    ----------
    velocity : float
        Velocity of the drive, m/s.
    normal_stress, shear_stress, spring_stress : float
        Pa; the spring also carries the damping to the ground.
    friction : float
        Ratio of shear to normal stress.
    states : dict of str to float
        States of the friction law (Θ, θ in s, z in m, ...).
    """

    velocity: float
    normal_stress: float
    shear_stress: float
    spring_stress: float
    friction: float
    states: dict[str, float]
    units: dict[str, str] = field(repr=False)
    area: float | None = field(default=None, repr=False)

    def __str__(self) -> str:
        rows = [
            f"steady sliding at {format_quantity(self.velocity, 'm/s')}: {stress_name('normal stress', self.area)} "
            f"{format_quantity(self.normal_stress, 'Pa', area=self.area)}, {stress_name('shear stress', self.area)} "
            f"{format_quantity(self.shear_stress, 'Pa', area=self.area)}, friction {self.friction:.4g}"
        ]
        rows += [
            f"  {name} = {format_quantity(value, self.units[name], area=self.area)}"
            for name, value in self.states.items()
        ]
        return "\n".join(rows)


@dataclass(frozen=True)
class SteadyContact(Displayed):
    """A contact of a machine in steady sliding.

    Attributes
    ----------
    slip_rate : float
        m/s.
    normal_force, friction_force : float
        N.
    friction : float
        Ratio of friction to normal force.
    states : dict of str to float
    """

    slip_rate: float
    normal_force: float
    friction_force: float
    friction: float
    states: dict[str, float]


@dataclass(frozen=True)
class SteadyMachine(Displayed):
    """Steady sliding of a machine: all bodies move at constant speeds.

    Attributes
    ----------
    velocity : float
        Velocity of the drive, m/s or rad/s.
    speeds : dict of str to float
        Speeds of the bodies, m/s or rad/s.
    contacts : dict of str to SteadyContact
    links : dict of str to float
        Force with which the first end of each link pulls the second, N along the slide or the link; N m in a shaft.
    """

    velocity: float
    speeds: dict[str, float]
    contacts: dict[str, SteadyContact]
    links: dict[str, float]
    units: dict[str, str] = field(repr=False)

    def __str__(self) -> str:
        rows = [f"steady sliding at {format_quantity(self.velocity, self.units['drive'])}"]
        rows += [f"  {name} moves at {format_quantity(speed, self.units[name])}" for name, speed in self.speeds.items()]
        for name, one in self.contacts.items():
            rows.append(
                f"  {name} slides at {format_quantity(one.slip_rate, 'm/s')}: normal force "
                f"{format_quantity(one.normal_force, 'N')}, "
                f"friction force {format_quantity(one.friction_force, 'N')}, friction {one.friction:.4g}"
            )
        rows += [
            f"  {name} carries {format_quantity(f, self.units[f'links.{name}'])}" for name, f in self.links.items()
        ]
        return "\n".join(rows)
