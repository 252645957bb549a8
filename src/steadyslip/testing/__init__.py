"""Public checks of the contract for friction and contact laws, for authors of laws.

::

    from steadyslip.testing import check_friction_law
    check_friction_law(MyLaw(a=0.01, ...))

Each rule of the contract is checked by one function, listed in `FRICTION_CHECKS` or `CONTACT_CHECKS`, so that a test
can be parametrised over them. A law that breaks a rule raises `ContractViolation`, an AssertionError with the value
found, the value required, and what to do.
"""

from __future__ import annotations

from collections.abc import Callable

from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.contact import (
    Surroundings,
    check_axis,
    check_contact_names,
    check_contact_numbers,
    check_contact_round_trip,
    check_linearisation,
    check_lock_up,
    check_steady_stress,
)
from steadyslip.testing.contact_states import check_contact_routes, check_contact_senses, check_contact_states
from steadyslip.testing.friction import (
    check_derivatives,
    check_jumps,
    check_names,
    check_numbers,
    check_signs,
    check_steady_state,
    check_symbols,
)
from steadyslip.testing.precise import ContractViolation
from steadyslip.testing.renaming import check_contact_renaming, check_renaming, under_random_names
from steadyslip.testing.routes import check_friction_round_trip, check_two_routes
from steadyslip.testing.symbolic import Conditions

FRICTION_CHECKS: tuple[Callable[[FrictionLaw, Conditions], None], ...] = (
    check_names,
    check_symbols,
    check_steady_state,
    check_signs,
    check_derivatives,
    check_numbers,
    check_jumps,
    check_two_routes,
    check_friction_round_trip,
    check_renaming,
)
CONTACT_CHECKS: tuple[Callable[[ContactLaw, Surroundings], None], ...] = (
    check_contact_names,
    check_lock_up,
    check_contact_senses,
    check_contact_states,
    check_contact_numbers,
    check_steady_stress,
    check_linearisation,
    check_axis,
    check_contact_routes,
    check_contact_round_trip,
    check_contact_renaming,
)


def check_friction_law(
    law: FrictionLaw,
    *,
    velocity: float = 1e-6,
    normal_stress: float = 5e6,
    velocity_decades: float = 3.0,
    stress_decades: float = 1.0,
    instant_weakening: bool = False,
) -> None:
    """Check a friction law against all rules of the contract, also with its parameters and memory renamed.

    Parameters
    ----------
    law : FrictionLaw
    velocity, normal_stress : float
        Centre of the range of steady sliding that is checked (m/s, Pa).
    velocity_decades, stress_decades : float
        Powers of ten to each side; give less for a law that holds in a narrower range.
    instant_weakening : bool
        Allow friction that falls at once when the velocity rises (LuGre, Coulomb–Stribeck).

    Raises
    ------
    ContractViolation
        On the first rule that the law breaks.

    Examples
    --------
    >>> ss.testing.check_friction_law(ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s"))
    """
    conditions = Conditions(velocity, normal_stress, velocity_decades, stress_decades, instant_weakening)
    for check in FRICTION_CHECKS:
        check(law, conditions)
    with under_random_names(law) as other:
        for check in FRICTION_CHECKS:
            check(other, conditions)


def check_contact_law(contact: ContactLaw, surroundings: Surroundings | None = None) -> None:
    """Check a contact law against all rules of the contract, also with its parameters and states renamed.

    Parameters
    ----------
    contact : ContactLaw
    surroundings : Surroundings, optional
        Friction law, drive velocity, stiffness, mass, dampings and load of the rig in which the law is checked.

    Raises
    ------
    ContractViolation
        On the first rule that the law breaks.

    Examples
    --------
    >>> ss.testing.check_contact_law(ss.laws.ConstantNormalStress(preload="5 MPa"))
    """
    place = surroundings or Surroundings()
    for check in CONTACT_CHECKS:
        check(contact, place)
    with under_random_names(contact) as other:
        for check in CONTACT_CHECKS:
            check(other, place)


__all__ = [
    "CONTACT_CHECKS",
    "FRICTION_CHECKS",
    "Conditions",
    "ContractViolation",
    "Surroundings",
    *sorted(name for name in globals() if name.startswith("check_")),
]
