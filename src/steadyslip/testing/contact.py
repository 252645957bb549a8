"""Checks of contact laws: one function for each rule of the contract."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import mpmath
import sympy as sp

from steadyslip.core.errors import NoSteadySliding
from steadyslip.laws.contact import ContactInputs, ContactLaw
from steadyslip.laws.friction import FrictionLaw, RateState
from steadyslip.machine.bodies import PlanarBody
from steadyslip.machine.drive import SteadyDrive
from steadyslip.machine.links import Spring
from steadyslip.machine.machine import Machine
from steadyslip.machine.servo import Pull
from steadyslip.machine.slider import Slider
from steadyslip.machine.surfaces import Surface
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import steady_states
from steadyslip.testing.precise import (
    DIGITS,
    TOLERANCE,
    ContractViolation,
    call_with_symbols,
    disagreement,
    format_number,
    precise_function,
    require,
    require_known_symbols,
    symbolic_copy,
)
from steadyslip.testing.routes import round_trip


def _rock() -> FrictionLaw:
    return RateState(a=0.0145, b=0.0160, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, states=(), regularised=False)


@dataclass(frozen=True)
class Surroundings:
    """Rig in which a contact law is checked, with all terms non-zero so that each one is tested.

    For compliant surfaces it is a machine: a body held on the surface by the normal stress `press` (Pa). Units: m/s,
    Pa/m, kg/m², and Pa s/m for the dampings.
    """

    friction: FrictionLaw = field(default_factory=_rock)
    velocity: float = 1e-6
    stiffness: float = 9e9
    mass: float = 1e9
    damping: float = 2e9
    radiation_damping: float = 3e9
    press: float = 5e6

    def rig(self, contact: ContactLaw) -> Slider | Machine:
        """Slider with the given contact law, or machine if the surfaces are compliant."""
        if contact.is_compliant():
            return self._machine(contact)
        return Slider(
            friction=self.friction,
            contact=contact,
            stiffness=self.stiffness,
            mass=self.mass,
            damping=self.damping,
            radiation_damping=self.radiation_damping,
            drive=SteadyDrive(self.velocity),
        )

    def _machine(self, contact: ContactLaw) -> Machine:
        links = {
            "spring": Spring(between=("drive", "block"), stiffness=self.stiffness, damping=self.damping),
            "waves": Spring(between=("ground", "block"), damping=self.radiation_damping),
        }
        return Machine(
            bodies={"block": PlanarBody(mass=self.mass, press=self.press)},
            links=links,
            contacts={"base": Surface(body="block", friction=self.friction, contact=contact)},
            drive=Pull(velocity=self.velocity),
        )

    def steady_stress(self, contact: ContactLaw) -> float:
        """Steady normal stress of the rig (Pa); that of the last steady state if there are several."""
        rig = self.rig(contact)
        try:
            if isinstance(rig, Machine):
                return steady_states(rig)[-1].contacts["base"].normal_force
            return steady_states(rig)[-1].normal_stress
        except NoSteadySliding as error:
            raise ContractViolation(
                f"{contact!r}: {error}; check it with numbers that have a steady state, or give `surroundings`"
            ) from error

    def steady_motion(self, contact: ContactLaw, sigma: float, velocity: float | None = None) -> ContactInputs:
        """Motion in steady sliding at normal stress `sigma` (Pa) and `velocity` (m/s), by default the drive's."""
        v = self.velocity if velocity is None else velocity
        tau = float(self.friction.steady_strength(v, sigma))
        spring = tau + self.radiation_damping * v
        memory = tuple(float(one) for one in contact.steady_memory(v))
        motion = ContactInputs(
            0.0, v, 0.0, spring, spring, tau, tau, self.stiffness, v, memory=memory, steady_memory=memory
        )
        if not contact.is_compliant():
            return motion

        def excess_stress(u: float) -> float:
            return float(contact.normal_stress(replace(motion, separation=u, steady_separation=u))) - sigma

        from scipy.optimize import brentq  # slow to import

        closed = -1e-12  # m, separation, reduced until the stress is at least `sigma`: stress falls as surfaces part
        while excess_stress(closed) < 0:
            closed *= 10
            if closed < -1e12:
                raise ContractViolation(f"{contact!r}: no distance of the surfaces makes a stress of {sigma!r} Pa")
        apart = float(brentq(excess_stress, closed, 0.0, xtol=1e-300, rtol=1e-15))
        return replace(motion, separation=apart, steady_separation=apart)


DEFAULT_SURROUNDINGS = Surroundings()


class SymbolicContactLaw:
    """Normal stress of a contact law as a SymPy expression of its `inputs`."""

    def __init__(self, contact: ContactLaw) -> None:
        self.contact = contact
        self.copy, self.numbers = symbolic_copy(contact)
        x, acceleration, spring, steady_spring, tau, steady_tau = sp.symbols("x a T T_ss tau tau_ss", real=True)
        v, v0 = sp.symbols("v v_0", positive=True)
        k = sp.Symbol("k", nonnegative=True)
        apart = sp.symbols("u u_ss u_dot", real=True)
        outside = sp.Symbol("q", real=True)
        plain = (x, v, acceleration, spring, steady_spring, tau, steady_tau, k, v0, *apart)
        memory = tuple(sp.Symbol(f"m_{i}", real=True) for i in range(len(contact.memory())))
        steady = tuple(sp.Symbol(f"m_ss_{i}", real=True) for i in range(len(contact.memory())))
        self.inputs = (*plain, outside, *memory, *steady)
        self.motion = replace(ContactInputs(*plain), outside=outside, memory=memory, steady_memory=steady)
        self.stress = call_with_symbols(contact, "normal_stress", self.copy.normal_stress, self.motion)
        require_known_symbols(contact, "normal_stress", self.stress, [*self.inputs, *self.numbers])

    def at(self, motion: ContactInputs) -> Any:
        """Normal stress (Pa) to fifty digits, for numeric `ContactInputs`."""
        function = precise_function(self.contact, [*self.inputs, *self.numbers], [self.stress])
        return function(*motion_values(motion), *self.numbers.values())[0]


def motion_values(motion: ContactInputs) -> list[Any]:
    """Numbers of a ContactInputs, in the order of `SymbolicContactLaw.inputs`."""
    plain = [getattr(motion, name) for name in ContactInputs.__dataclass_fields__ if not name.endswith("memory")]
    return [*plain, *motion.memory, *motion.steady_memory]


def check_contact_names(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that the law is registered and gives either a load or a steady normal stress, positive.

    Compliant surfaces may have zero load, as they carry what the machine presses on them.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_names(contact)
    """
    name = type(contact).name
    require(
        name and ContactLaw.registry.get(name) is type(contact),
        contact,
        f"is not registered; write class {type(contact).__name__}(ContactLaw, name='...') for rig files to name it",
    )
    load, steady = contact.load(), contact.steady_stress()
    require(
        (load is None) != (steady is None), contact, "load() and steady_stress(): give exactly one, None for the other"
    )
    given = float(load if load is not None else steady)  # type: ignore[arg-type]  # either load or steady is given
    unloaded = contact.is_compliant() and given == 0
    require(given > 0 or unloaded, contact, f"the load is {given!r} Pa, must be > 0 (compression is positive)")


def check_lock_up(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that the only placeholders in the text `lock_up` are {inverse}, 1/μss, and {angle}, arccot μss in degrees.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_lock_up(contact)
    """
    words = contact.lock_up
    hint = 'write it in the class body as lock_up = "the gain must be below 1/μss = {inverse}"'
    require(isinstance(words, str), contact, f"lock_up is a {type(words).__name__}; allowed: a text; {hint}")
    try:
        words.format(inverse="1.429", angle="55.01")
    except (LookupError, ValueError, AttributeError) as error:
        require(False, contact, f"lock_up is {words!r} ({error!r}); allowed gaps: {{inverse}} and {{angle}}; {hint}")


def check_contact_numbers(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that the normal stress called with floats equals that in symbols, in and near steady sliding.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_numbers(contact)
    """
    symbolic = SymbolicContactLaw(contact)
    sigma = surroundings.steady_stress(contact)
    for factor in (1.0, 1.01, 0.99):
        away = factor - 1
        motion = _displaced(surroundings, contact, sigma, away * 1e-7, surroundings.velocity * factor, away * 1e-6)
        by_hand, exact = float(contact.normal_stress(motion)), symbolic.at(motion)
        require(
            abs(by_hand - exact) <= TOLERANCE * abs(exact),
            contact,
            f"normal_stress() called with floats is {by_hand!r} Pa, in symbols {format_number(exact)} Pa; a law's "
            "method must be one expression for numbers and symbols",
        )


def check_steady_stress(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that the steady normal stress is positive, and equals the normal stress of the law in steady sliding.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_steady_stress(contact)
    """
    symbolic = SymbolicContactLaw(contact)
    sigma = surroundings.steady_stress(contact)
    require(sigma > 0, contact, f"the steady normal stress is {sigma!r} Pa, must be > 0")
    given = contact.steady_stress()
    require(
        given is None or abs(sigma - float(given)) <= TOLERANCE * sigma,
        contact,
        f"the steady normal stress is {sigma!r} Pa, but steady_stress() says {given!r} Pa",
    )
    found = symbolic.at(surroundings.steady_motion(contact, sigma))
    require(
        abs(found - sigma) <= TOLERANCE * sigma,
        contact,
        f"normal_stress() of steady sliding at {sigma!r} Pa is {format_number(found)} Pa; they must agree",
    )


def check_linearisation(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check B0...B3 (eq. 12) against central differences of the normal stress, at two stiffnesses.

    Laws with states or compliant surfaces have no coefficients B0...B3: see `check_contact_routes`.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_linearisation(contact)
    """
    from steadyslip.linear.response import contact_coefficients

    if contact.memory() or contact.is_compliant():
        return
    symbolic = SymbolicContactLaw(contact)
    for place in (surroundings, replace(surroundings, stiffness=2 * surroundings.stiffness)):
        sigma = place.steady_stress(contact)
        values = operating_point(place.rig(contact))
        function = values.model.function(contact_coefficients(values.model))
        b0, b1, b2, b3 = (float(b) for b in function(*values.arguments, sigma))
        k_part = abs(place.stiffness * b2) + abs(b3)
        expected = {
            "lead": (place.stiffness * b2 + b3, k_part),
            "velocity": (b1, abs(b1)),
            "acceleration": (b0, abs(b0)),
        }
        for index, (what, (coefficient, terms)) in enumerate(expected.items()):

            def along(x: Any, index: int = index, place: Surroundings = place, sigma: float = sigma) -> Any:
                moved = [0, place.velocity, 0]
                moved[index] = x
                return symbolic.at(_displaced(place, contact, sigma, *moved))

            scale = (1e-7, place.velocity, place.velocity)[index]
            found, excess = disagreement(along, coefficient, (0, place.velocity, 0)[index], scale)
            with mpmath.workdps(DIGITS):
                # the coefficients are floats, not numbers of fifty digits: rounding of their terms is allowed
                allowed = TOLERANCE * (terms + sigma * 1e-6 / scale)
            require(
                excess <= allowed,
                contact,
                f"∂σ/∂({what}) is {coefficient:.9g} by differentiation and {format_number(found)} by central "
                f"differences, at k = {place.stiffness:g} Pa/m; check kinks and functions of your own",
            )


def _displaced(
    place: Surroundings, contact: ContactLaw, sigma: float, x: Any, v: Any, acceleration: Any
) -> ContactInputs:
    """Motion displaced by x (m) from steady sliding, at v (m/s) and acceleration (m/s²); forces from the balance."""
    rest = place.steady_motion(contact, sigma)
    with mpmath.workdps(DIGITS):
        spring = rest.spring - mpmath.mpf(place.stiffness) * x - place.damping * (v - mpmath.mpf(place.velocity))
        tau = spring - mpmath.mpf(place.radiation_damping) * v - mpmath.mpf(place.mass) * acceleration
        return replace(rest, lead=x, velocity=v, acceleration=acceleration, spring=spring, friction=tau)


def check_axis(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check, for laws with an axis, that the sliding stiffness is a constant share, at most 1, of the axial one.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_axis(contact)
    """
    if not contact.has_axis():
        return
    share, tenfold = (float(contact.sliding_stiffness(k)) for k in (1.0, 10.0))
    require(
        0 < share <= 1 and abs(tenfold - 10 * share) <= 1e-12 * tenfold,
        contact,
        f"sliding_stiffness(1) is {share!r} and sliding_stiffness(10) is {tenfold!r}; a projection is "
        "proportional, with a factor above 0 and at most 1",
    )


def check_contact_round_trip(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that a rig with this contact is unchanged after writing it to a rig file and reading it back.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_round_trip(contact)
    """
    round_trip(contact, surroundings.rig(contact))
