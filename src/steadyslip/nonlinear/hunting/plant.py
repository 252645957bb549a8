"""Numeric matrices of a rig whose drive holds a position: inertia, springs, controller and contacts.

The state is Y = [q, w, I, r, r', u, z, 1]: positions and velocities of the coordinates, integral of the error, target
and its velocity, force of a sampled controller, memory of the contacts, and the constant 1. A row is an array (width,)
that gives a quantity as the product row·Y.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.errors import NotAvailable
from steadyslip.laws.contact import ContactInputs, ContactLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, Limits, Mechanism
from steadyslip.machine.slider import Slider

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Load:
    """A pull T that adds to the normal stress of a contact: `forward` T if T > 0, −`back` T if T < 0.

    Attributes
    ----------
    places, speeds : ndarray (coordinates + 1,)
        T per position and per velocity of each coordinate, and of the target (last).
    controller : float
        T per force of the controller.
    forward, back : float
        Normal stress per T for T > 0, and per −T for T < 0.
    rest, coulomb, drag : float
        Largest friction force at rest, constant part of sliding friction, and sliding friction per slip rate; all per
        normal stress, and 0 for a law with memory.
    """

    places: Array
    speeds: Array
    controller: float
    forward: float
    back: float
    rest: float = 0.0
    coulomb: float = 0.0
    drag: float = 0.0


@dataclass(frozen=True, eq=False)
class HeldContact:
    """A contact whose friction F acts on the coordinates with the forces −`row` F.

    Without loads F = `coulomb` sign(v) + `drag` v, where the slip rate is v = `row`·w − `belt` r'.

    Attributes
    ----------
    row : ndarray (coordinates,)
        Share of each coordinate's velocity in the slip rate.
    belt : float
        Share of the target's velocity in the slip rate.
    rest : float
        Largest friction force at rest (N, or Pa).
    coulomb, drag : float
        Constant part of sliding friction, and that per slip rate; 0 for a law with memory.
    port : ContactPort
        The contact in the mechanism, with its friction law.
    normal : float
        Normal stress (Pa), or force, without its loads.
    slow : float
        Slip rate (m/s) below which a contact with memory counts as at rest; 0 for a contact without memory.
    loads : tuple of Load
    """

    row: Array
    belt: float
    rest: float
    coulomb: float
    drag: float
    port: ContactPort
    normal: float
    slow: float = 0.0
    loads: tuple[Load, ...] = ()

    @property
    def curved(self) -> bool:
        """True if friction is a nonlinear function of the state: bristles, or drag proportional to a load."""
        return bool(self.slow) or any(load.drag for load in self.loads)


@dataclass(frozen=True, eq=False)
class Plant:
    """Matrices of a rig at rest; `size` is the number of coordinates, `memory` the number of memory variables."""

    inertia: Array
    stiffness: Array
    damping: Array
    target_stiffness: Array
    target_damping: Array
    force: Array
    acts: Array
    places: tuple[Array, ...]
    gains: tuple[tuple[float, float], ...]
    integral: float
    delay: float
    limits: Limits
    contacts: tuple[HeldContact, ...]

    @property
    def size(self) -> int:
        return len(self.inertia)

    @property
    def memory(self) -> int:
        return sum(len(one.port.friction.memory()) for one in self.contacts if one.slow)

    @property
    def width(self) -> int:
        """Length of Y."""
        return 2 * self.size + 5 + self.memory

    @property
    def bands_rate(self) -> bool:
        """True if the dead band acts on the derivative of the error too; not for the speed loop of a cascade."""
        limits = self.limits
        return (
            limits.dead_band is not None and not (limits.of_integral or limits.on_measurement) and len(self.gains) == 1
        )

    def row(self, place: Array | None = None, velocity: Array | None = None, **others: float) -> Array:
        """Row (width,) made of the given coefficients of positions (`place`) and velocities; the rest is 0.

        `others` are coefficients named ``integral``, ``target``, ``target_velocity``, ``held`` and ``one``."""
        n = self.size
        found = np.zeros(self.width)
        if place is not None:
            found[:n] = place
        if velocity is not None:
            found[n : 2 * n] = velocity
        where = {"integral": 2 * n, "target": 2 * n + 1, "target_velocity": 2 * n + 2, "held": 2 * n + 3, "one": -1}
        for name, value in others.items():
            found[where[name]] = value
        return found

    def error(self, loop: int = 0) -> Array:
        """Row that gives the error of one loop of the controller; for a speed loop, the integral of its error.

        The target is left out if the speed loop takes derivatives of the measurement only.
        """
        kicked = loop == 0 or not self.limits.on_measurement
        return self.row(-self.places[loop], target=1.0 if kicked else 0.0)

    def error_rate(self, loop: int = 0) -> Array:
        """Row that gives the time derivative of `error`, or with `limits.on_measurement` of the measured position."""
        return self.row(None, -self.places[loop], target_velocity=0.0 if self.limits.on_measurement else 1.0)

    def passive(self, load: Load) -> Array:
        """Row that gives the pull T of a load without the part that the controller's force adds."""
        return self.row(load.places[:-1], load.speeds[:-1], target=load.places[-1], target_velocity=load.speeds[-1])

    def slip(self, contact: HeldContact) -> Array:
        """Row that gives the slip rate of a contact."""
        return self.row(None, contact.row, target_velocity=-contact.belt)


def plant_of(rig: Slider | Machine) -> Plant:
    """Matrices of a rig that holds a position.

    Raises
    ------
    NotAvailable
        If a coordinate has no inertia, or a contact or friction law is not supported at rest.
    """
    mechanism = rig.mechanism()
    names = [one.name for one in mechanism.coordinates]
    contacts = _merged([_contact(mechanism, one, names) for one in mechanism.contacts])
    plant = replace(free_plant(rig), contacts=contacts)
    _check_forces_at_rest(plant)
    return plant


def free_plant(rig: Slider | Machine) -> Plant:
    """Matrices of a rig without its contacts, at any velocity.

    Raises
    ------
    NotAvailable
        If a coordinate has no inertia.
    """
    mechanism = rig.mechanism()
    names = [one.name for one in mechanism.coordinates]
    for one in mechanism.coordinates:
        if not one.inertia:
            raise NotAvailable(
                f"{rig.words['place'].format(one.name)} has no mass; hunting needs the inertia of all that moves"
            )
    size = len(names)
    stiffness, damping = np.zeros((size, size + 1)), np.zeros((size, size + 1))
    for element in mechanism.elements:
        if element.active:
            continue
        acts, senses = _row(element.acts, names), _row(element.senses, names, True)
        stiffness += np.outer(acts, senses) * float(element.stiffness or 0)
        damping += np.outer(acts, senses) * float(element.damping or 0)
    return Plant(
        inertia=np.array([float(one.inertia) for one in mechanism.coordinates]),
        stiffness=stiffness[:, :-1], damping=damping[:, :-1],
        target_stiffness=stiffness[:, -1], target_damping=damping[:, -1],
        force=np.array([float(one.force) for one in mechanism.coordinates]),
        contacts=(), **_controller(mechanism, names),
    )  # fmt: skip


def _row(shares: Mapping[str, Any], names: list[str], target: bool = False) -> Array:
    """Convert shares by name to an array over the coordinates; with `target` the load point's share is appended."""
    found = [float(shares.get(name, 0)) for name in names]
    return np.array([*found, float(shares.get(LOAD_POINT, 0))] if target else found)


def _controller(mechanism: Mechanism, names: list[str]) -> dict[str, Any]:
    """Fields of `Plant` that describe the controller; each loop has an error, and gains on error and derivative."""
    active = [one for one in mechanism.elements if one.active]
    integral = mechanism.integral
    return {
        "acts": _row(active[0].acts, names),
        "places": tuple(_row(one.senses, names) for one in active),
        "gains": tuple((float(one.stiffness), float(one.damping)) for one in active),
        "integral": 0.0 if integral is None else float(integral.gain),
        "delay": max(float(one.delay) for one in active),
        "limits": mechanism.limits or Limits(),
    }


def _contact(mechanism: Mechanism, port: ContactPort, names: list[str]) -> HeldContact:
    """Contact of a plant; raises NotAvailable if its laws are not supported at rest."""
    label = f"contacts.{port.name}." if port.name else ""
    law, contact = port.friction, port.contact
    time = sp.Symbol("t")
    load, slow, shares = contact.load(), law.slow_velocity(), _pull_shares(contact)
    if port.separation or contact.memory() or contact.imposed(time) != 0 or shares is None:
        raise NotAvailable(
            f"{label}contact: the law {contact.name!r} lets the normal force change with the motion, and hunting takes "
            "'constant' with the preload that presses where the axis is held, or 'transmitted'"
        )
    if law.lateness() or (law.memory() and slow is None):
        raise NotAvailable(NOT_AT_REST.format(label, law.name))
    sigma = float((contact.steady_stress() if load is None else load) or 0.0)
    row, belt = _row(port.slip, names), -float(port.slip.get(LOAD_POINT, 0))
    loads: tuple[Load, ...] = (_load(mechanism, port, shares, names),) if any(shares) else ()
    if law.memory() and slow is not None:
        return HeldContact(row, belt, 0.0, 0.0, 0.0, port, sigma, float(slow), loads)
    v = sp.Symbol("v", positive=True)
    sliding = sp.sympify(law.strength(v, 1, (), sp.nan))  # friction without memory is proportional to normal stress
    if sliding.diff(v, 2) != 0:
        raise NotAvailable(NOT_AT_REST.format(label, law.name))
    rest, coulomb, drag = (
        float(port.area * value) for value in (law.rest_strength(1), sliding.subs(v, 0), sliding.diff(v))
    )
    loads = tuple(replace(one, rest=rest, coulomb=coulomb, drag=drag) for one in loads)
    return HeldContact(row, belt, sigma * rest, sigma * coulomb, sigma * drag, port, sigma, loads=loads)


NOT_AT_REST = "{}friction: the law {!r} is not offered at rest; allowed: coulomb, lugre"


def _pull_shares(contact: ContactLaw) -> tuple[float, float] | None:
    """Normal stress that a contact law adds per T > 0, and per −T for T < 0; None if not piecewise linear in T."""
    letters: dict[str, Any] = {one.name: sp.Symbol(one.name) for one in fields(ContactInputs)}
    pull = sp.Symbol("pull", real=True)
    coupling = sp.sympify(contact.coupling(ContactInputs(**letters | {"spring": pull})))
    if coupling.free_symbols - {pull}:
        return None
    forward, back, twice = (float(coupling.subs(pull, value)) for value in (1, -1, 2))
    return (forward, back) if min(forward, back) >= 0 and twice == 2 * forward else None


def _load(mechanism: Mechanism, port: ContactPort, shares: tuple[float, float], names: list[str]) -> Load:
    """The pull T of a contact, as defined in `steadyslip.model.forces`."""
    body, pulling = next(name for name in port.slip if name != LOAD_POINT), mechanism.pulling(port)
    if port.loaded_by:
        body = next(name for name in port.slip if name in pulling[0].acts)
    lever = float(port.slip[body] * port.area)
    places, speeds, controller = np.zeros(len(names) + 1), np.zeros(len(names) + 1), 0.0
    for one in pulling:
        share = float(one.acts.get(body, 0)) / lever
        if one.active:
            controller = share
        else:
            senses = _row(one.senses, names, True)
            places -= share * float(one.stiffness or 0) * senses
            speeds -= share * float(one.damping or 0) * senses
    return Load(places, speeds, controller, *shares)


def _merged(contacts: list[HeldContact]) -> tuple[HeldContact, ...]:
    """The contacts, where contacts without memory whose slip rates are proportional are joined to a single contact.

    At rest, only the sum of the friction forces of joined contacts is known."""
    found: list[HeldContact] = []
    for one in contacts:
        for i, other in enumerate(found):
            own, theirs = np.append(one.row, one.belt), np.append(other.row, other.belt)
            ratio = float(own @ theirs / (theirs @ theirs))
            if not one.slow and not other.slow and np.array_equal(own, ratio * theirs):
                found[i] = HeldContact(
                    other.row, other.belt, other.rest + abs(ratio) * one.rest, other.coulomb + abs(ratio) * one.coulomb,
                    other.drag + ratio**2 * one.drag, other.port, other.normal,
                    loads=other.loads + tuple(
                        replace(
                            load, rest=abs(ratio) * load.rest, coulomb=abs(ratio) * load.coulomb,
                            drag=ratio**2 * load.drag,
                        ) for load in one.loads
                    ),
                )  # fmt: skip
                break
        else:
            found.append(one)
    return tuple(found)


def _check_forces_at_rest(plant: Plant) -> None:
    """Raise NotAvailable if friction at a resting contact would have to balance nonlinear friction elsewhere."""
    for one, other in itertools.permutations(plant.contacts, 2):
        if not one.slow and other.curved and one.row @ (other.row / plant.inertia):
            at_rest, moves = (f"contacts.{contact.port.name}" for contact in (one, other))
            raise NotAvailable(
                f"{at_rest}.friction: at rest it would balance the friction of {moves}, bent by the motion, and "
                "hunting has no such balance; write law = 'lugre' in both"
            )
