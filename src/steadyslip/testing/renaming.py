"""Checks of laws under random names: equations must not depend on the names of parameters and states."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, replace
from random import Random
from typing import Any, TypeVar

from steadyslip.core.records import FrozenRecord, role_of
from steadyslip.core.roles import Parameter
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.testing.contact import DEFAULT_SURROUNDINGS, Surroundings
from steadyslip.testing.precise import require
from steadyslip.testing.symbolic import DEFAULT_CONDITIONS, Conditions

L = TypeVar("L", FrictionLaw, ContactLaw)
# names with a meaning in equations, SymPy, printers or JavaScript, except names of results
RESERVED_NAMES = (
    "w v_lp_dot q_dot p_dot v_lp q p T tau sigma k m c_0 y0 z0 in0 w_0 e0 D_0 a_x I_x sigma_ss mu_ss k_cr held loading "
    "E I N S pi oo gamma beta Lambda constructor toString arguments function var this eval select define Infinity"
)


def _new_names(law: FrictionLaw | ContactLaw, seed: int) -> tuple[dict[str, str], dict[str, str]]:
    """Random new names by old name: of the parameters of a law, and of its memory or states."""
    random = Random(f"{type(law).__name__} {seed}")
    own = [item.name for item in fields(law) if isinstance(role_of(item), Parameter)]
    taken = {*dir(law), *law.memory()}
    free = [word for word in RESERVED_NAMES.split() if word not in taken]
    random.shuffle(free)
    free += [f"n{random.getrandbits(40):x}" for _ in range(len(own) + len(law.memory()))]
    return dict(zip(own, free, strict=False)), dict(zip(law.memory(), free[len(own) :], strict=False))


def _read_property(name: str) -> property:
    return property(lambda self: getattr(self, name))


def _constructor(renamed_fields: Mapping[str, Any]) -> Callable[..., None]:
    """Function for `__init__` that takes the fields of a record under their new names."""

    def construct(self: FrozenRecord, **given: Any) -> None:
        for name, item in renamed_fields.items():
            object.__setattr__(self, name, given.get(name, item.default))
        self.__post_init__()

    return construct


@contextmanager
def under_random_names(law: L, seed: int = 1) -> Iterator[L]:
    """Copy of a law with random names of its parameters and memory, registered within the ``with`` block."""
    kind: Any = type(law)
    numbers, memory = _new_names(law, seed)
    own = {numbers.get(item.name, item.name): copy.copy(item) for item in fields(law)}
    for name, item in own.items():
        item.name = name

    def about(condition: Any) -> Any:
        first, dot, rest = condition.name.partition(".")
        return replace(condition, name=numbers.get(first, first) + dot + rest)

    body: dict[str, Any] = {old: _read_property(new) for old, new in numbers.items()}
    body["memory"] = lambda self: tuple(memory.values())
    body["conditions"] = lambda self: map(about, kind.conditions(self))
    if "observables" in dir(kind):

        def again(table: dict[str, Any]) -> dict[str, Any]:
            return {memory.get(name, name): one for name, one in table.items()}

        body["observables"] = lambda self, *state: again(kind.observables(self, *state))
        body["meanings"] = lambda self: again(kind.meanings(self))
    registry = dict(kind.registry)
    other = type(kind.__name__, (kind,), body | {"__doc__": kind.__doc__}, name=f"{kind.name}-renamed")
    other.__dataclass_fields__, other.__init__ = own, _constructor(own)  # type: ignore[attr-defined, misc]
    try:
        yield other(**{numbers.get(item.name, item.name): getattr(law, item.name) for item in fields(law)})
    finally:
        kind.registry.clear()
        kind.registry.update(registry)


def _equations(rig: Slider | Machine) -> list[Any]:
    """All expressions of the Model of a rig that enter a computation."""
    from steadyslip.model import build_model

    model = build_model(rig)
    seen = [expression for expression, _ in model.observables.values()]
    steady = [*model.steady.items()]
    contacts = [(one.balance, one.steady_stress, one.direction) for one in model.contacts]
    return [model.rates, [*model.definitions.items()], steady, contacts, seen, [*model.parameters.values()]]


def _require_equal_equations(law: L, rig: Callable[[L], Slider | Machine]) -> None:
    with under_random_names(law) as other:
        require(
            _equations(rig(law)) == _equations(rig(other)),
            law,
            f"has other equations as {other!r}: they must not depend on what parameters and states are called",
        )


def check_renaming(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that the equations of a rig with this friction law do not depend on its names.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_renaming(law)
    """
    from steadyslip.laws.contact import ConstantNormalStress
    from steadyslip.machine.drive import SteadyDrive

    press, drive = ConstantNormalStress(steady_normal_stress=conditions.normal_stress), SteadyDrive(conditions.velocity)
    _require_equal_equations(law, lambda one: Slider(friction=one, contact=press, stiffness=1e9, mass=1.0, drive=drive))


def check_contact_renaming(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that the equations of a rig with this contact law do not depend on its names.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_renaming(contact)
    """
    _require_equal_equations(contact, surroundings.rig)
