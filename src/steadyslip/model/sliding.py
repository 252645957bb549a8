"""Steady sliding of rigs, and the error if there is none."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import NoSteadySliding
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.laws.contact import ContactLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Model
from steadyslip.model.numeric import by_matrices, has_response
from steadyslip.model.numeric.machine_point import machine_point, steady_of
from steadyslip.model.numeric.measured import measured_machine
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import require_range
from steadyslip.model.steady import JointEquation, joint_equation, steady_equation
from steadyslip.model.steady_results import ABSENT, SteadyContact, SteadyMachine, SteadySliding

REFERENCE = 1e6  # Pa; normal stress at which messages give the friction coefficient


@overload
def steady_state(rig: Slider) -> SteadySliding: ...


@overload
def steady_state(rig: Machine) -> SteadyMachine: ...


@checked()
def steady_state(rig: Slider | Machine) -> SteadySliding | SteadyMachine:
    """Steady sliding of a rig.

    Returns
    -------
    SteadySliding or SteadyMachine
        If several steady states exist, the one with the lowest normal stress; see `steady_states`.

    Raises
    ------
    NoSteadySliding
        If steady sliding does not exist; the error has the condition that fails (lock-up, lift-off) and its shortfall.
    NotAvailable
        If numbers leave the range of floating point.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> round(ss.steady_state(rig).normal_stress / 1e6, 3)
    16.667
    """
    return steady_states(rig)[0]


def steady_machine(rig: Machine) -> SteadyMachine:
    """Steady sliding of a machine, with forces of contacts and links.

    Raises
    ------
    NoSteadySliding
        If a contact locks up or lifts off; the message names it.
    """
    if by_matrices(rig):
        return steady_of(measured_machine(rig) if has_response(rig) else machine_point(rig))
    point = operating_point(rig)
    if not point.exists:
        raise explain_absence(rig, point)
    model = point.model
    names, function = _observable_function(model)
    numbers = dict(zip(names, (float(number) + 0.0 for number in point.evaluate(function)), strict=True))
    contacts = {}
    for contact in model.contacts:
        own = {n.partition(".")[2]: x for n, x in numbers.items() if n.startswith(f"{contact.name}.")}
        slip = float(point.evaluate(model.function([model.steady[contact.velocity]]))[0])
        friction, force = own.pop("friction"), own.pop("friction_force")
        normal = own.pop("normal_force")
        contacts[contact.name] = SteadyContact(slip, normal, force, friction, own)
    links = {n: numbers[f"links.{n}.force"] for n in rig.links}
    units = {n: "rad/s" if body.turns else "m/s" for n, body in rig.bodies.items()}
    units |= {"drive": "rad/s" if rig.drive.turns else "m/s"}
    units |= {f"links.{n}": model.observables[f"links.{n}.force"][1] for n in rig.links}
    speeds = {n: float(speed) for n, speed in rig.speeds().items()}
    return SteadyMachine(float(point.drive), speeds, contacts, links, units)


@overload
def steady_states(rig: Slider) -> tuple[SteadySliding, ...]: ...


@overload
def steady_states(rig: Machine) -> tuple[SteadyMachine, ...]: ...


@checked()
def steady_states(rig: Slider | Machine) -> tuple[SteadySliding, ...] | tuple[SteadyMachine, ...]:
    """All states of steady sliding of a slider, by rising normal stress; the single state of a machine.

    Raises
    ------
    NoSteadySliding
        If there is no steady sliding.
    NotAvailable
        If numbers leave the range of floating point.

    Examples
    --------
    >>> rig = ss.read_rig("examples/double-direct-shear.toml")
    >>> len(ss.steady_states(rig))
    1
    """
    if isinstance(rig, Machine):
        return (steady_machine(rig),)
    point = operating_point(rig)
    require_range(point)
    stresses = point.all_stresses()
    if not stresses:
        raise explain_absence(rig, point)
    names, function = _observable_function(point.model)
    results = []
    for sigma in stresses:
        numbers = {
            name: float(number) + 0.0  # no minus zero
            for name, number in zip(names, function(*point.arguments, sigma), strict=True)
        }
        velocity = float(point.drive)
        shear = numbers.pop("shear_stress")
        spring = numbers.pop("spring_stress")
        friction = numbers.pop("friction")
        units = {name: point.model.observables[name][1] for name in numbers}
        results.append(SteadySliding(velocity, float(sigma), shear, spring, friction, numbers, units, rig.area))
    return tuple(results)


def observed_in_steady_sliding(model: Model) -> tuple[list[str], list[sp.Expr]]:
    """Names and steady expressions of all observables except x, v and the normal stress."""
    names = [name for name in model.observables if name not in ("x", "v", "normal_stress")]
    return names, [model.observables[name][0].xreplace(model.steady) for name in names]


@cached
def _observable_function(model: Model) -> tuple[list[str], ArrayFunction]:
    names, expressions = observed_in_steady_sliding(model)
    return names, model.function(expressions)


def steady_contact_at(rig: Machine, contact: str, velocities: np.ndarray) -> dict[str, np.ndarray]:
    """Steady observables and slip rate of a machine's contact at drive velocities (k,), by name; each (k,).

    NaN without steady sliding.
    """
    point = operating_point(rig, {"drive.velocity": velocities})
    names, function = _observable_function(point.model)
    own = next(one for one in point.model.contacts if one.name == contact)
    with np.errstate(all="ignore"):
        slip = point.evaluate(point.model.function([point.model.steady[own.velocity]]))
        seen = dict(zip(("slip_rate", *names), (*slip, *point.evaluate(function)), strict=True))
    found = {name.removeprefix(f"{contact}."): np.broadcast_to(value, velocities.shape) for name, value in seen.items()}
    return {name: np.where(point.exists, value, np.nan) for name, value in found.items() if "." not in name}


def explain_absence(rig: Rig, point: OperatingPoint) -> NoSteadySliding:
    """Make the NoSteadySliding error of a rig; it names the failing condition, the shortfall and the contact.

    Raises
    ------
    NotAvailable
        If the numbers leave the range of floating point.
    """
    require_range(point)
    joint = joint_equation(point.model)
    if joint is not None:
        return _jointly_absent(point, joint)
    missing = next(place for place, sigma in enumerate(point.sigmas) if not np.isfinite(sigma))
    contact = point.model.contacts[missing]
    own = rig.laws_by_contact()[contact.name]
    return _absent(point, missing, own.contact, (own.area or 1.0) if rig.contact_names else rig.area_of("contact"))


def _absent(point: OperatingPoint, place: int, law: ContactLaw, area: float | None) -> NoSteadySliding:
    """Error for a contact whose steady normal stress does not depend on other contacts."""
    equation = steady_equation(point.model, place)
    name = point.model.contacts[place].name
    at = _at(name)
    force = "stress" if area is None else "force"
    if equation.parts is None:
        return _absence("no solution", name, ABSENT["no solution"].format(at=at, force=force))
    load, offset, slope = (float(part) for part in equation.parts(*point.arguments))
    mu = _friction_coefficient(point, place)
    if not slope < 1:
        margin = 1 - slope
        words = ABSENT["lock-up"].format(at=at, margin=f"{margin:.4g}")
        if law.lock_up:
            inverse, angle = (f"{one:.4g}" for one in (1 / mu, math.degrees(math.atan2(1.0, mu))))
            words += "; " + law.lock_up.format(inverse=inverse, angle=angle)
        return _absence("lock-up", name, words, margin)
    left = load + offset
    had, taken, remains = (format_quantity(one, "Pa", area=area) for one in (load, -offset, left))
    words = ABSENT["lift-off"].format(at=at, force=force, load=had, taken=taken, left=remains)
    return _absence("lift-off", name, words, left)


def _at(name: str) -> str:
    return ABSENT["at"].format(name=name) if name else ""


def _absence(kind: str, contact: str, words: str, margin: float = math.nan) -> NoSteadySliding:
    return NoSteadySliding(f"no steady sliding: {words}", kind, margin, contact)


def _jointly_absent(point: OperatingPoint, joint: JointEquation) -> NoSteadySliding:
    """Error for contacts with coupled steady normal stresses."""
    contacts = point.model.contacts
    sigma, gain = joint.solve(point.arguments)
    least = int(np.argmin(sigma))  # just beyond lock-up, this is the contact that other contacts press most
    name = contacts[least].name
    if not gain < 1:
        words = ABSENT["together"].format(at=_at(name), margin=f"{1 - gain:.4g}")
        return _absence("lock-up", name, words, float(1 - gain))
    force = point.evaluate(point.model.function([contacts[least].area]))[0] * sigma[least]
    words = ABSENT["lifted"].format(at=_at(name), left=format_quantity(float(force), "N"))
    return _absence("lift-off", name, words, float(force))


def friction_coefficient(model: Model, place: int) -> sp.Expr:
    """Friction coefficient in steady sliding at the normal stresses `Contact.sigma_ss`."""
    contact = model.contacts[place]
    return sp.sympify(model.steady[contact.friction] / contact.sigma_ss)


@cached
def _friction_function(model: Model, place: int) -> ArrayFunction:
    return model.function([friction_coefficient(model, place)])


def _friction_coefficient(point: OperatingPoint, place: int) -> float:
    """Friction coefficient in steady sliding at the normal stress `REFERENCE` (exact if τ is proportional to σ)."""
    stresses = (REFERENCE for _ in point.model.contacts)
    value = float(_friction_function(point.model, place)(*point.arguments, *stresses)[0])
    return value if math.isfinite(value) else float("nan")
