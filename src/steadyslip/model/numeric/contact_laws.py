"""Steady stresses of one contact, and derivatives at steady sliding, evaluated from the expressions of its laws.

Code is compiled once for each pair of laws with the same structure, whatever machine they belong to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.records import FrozenRecord, parameters, shape_of, with_values
from steadyslip.core.symbols import inner_symbol, inner_symbols
from steadyslip.laws.contact import ContactInputs, ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.model.forces import all_of_law, of_law

X, V, ACCELERATION, SPRING, DISTANCE, APPROACH, TAU = inner_symbols("n_x n_v n_a n_T n_u n_du n_tau", real=True)
_V0, _SIGMA = inner_symbol("n_v0", positive=True), inner_symbol("n_sigma", positive=True)
_SPRING_SS, _TAU_SS, _DISTANCE_SS, _STIFFNESS = inner_symbols("n_Tss n_tauss n_uss n_k", real=True)


@dataclass(frozen=True)
class SteadyNumbers:
    """Stresses (Pa) of a contact in steady sliding by its laws, and their derivatives.

    Shapes are those of the arguments.

    Attributes
    ----------
    friction, friction_by_stress
        τss, and its derivative with respect to the normal stress.
    pressed, by_spring, by_friction, by_distance
        Normal stress by the contact law, and its derivatives with respect to T, τ and the distance of the surfaces.
    coupled_by_spring, coupled_by_friction
        Derivatives with respect to T and τ of the part of the normal stress due to motion; these differ from
        `by_spring` and `by_friction` if the steady normal stress is given.
    """

    friction: Any
    friction_by_stress: Any
    pressed: Any
    by_spring: Any
    by_friction: Any
    by_distance: Any
    coupled_by_spring: Any
    coupled_by_friction: Any


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a contact's laws at steady sliding.

    Attributes
    ----------
    strength : ndarray (..., 3 + m)
        Derivatives of the friction stress with respect to v, σ, τ and the m memory variables.
    rates : ndarray (..., m, 3 + m)
        Derivatives of the rates of the memory variables, with respect to the same.
    normal : ndarray (..., 7 + p)
        Derivatives of the normal stress with respect to x, v, v̇, T, τ, the distance and its rate, and the p states of
        the contact law.
    state_rates : ndarray (..., p, 7 + p)
        Derivatives of the rates of these states, with respect to the same.
    """

    strength: Array
    rates: Array
    normal: Array
    state_rates: Array


class ContactFunctions:
    """Compiled functions of a friction and a contact law; made by `functions_of`."""

    def __init__(self, friction: FrictionLaw, contact: ContactLaw) -> None:
        friction, own = _with_symbols(friction, "friction")
        contact, other = _with_symbols(contact, "contact")
        symbols = [*own, *other]
        self.memory, self.states = friction.memory(), contact.memory()
        memory = inner_symbols(" ".join(f"n_m{i:03d}" for i in range(len(self.memory))), real=True)
        states = inner_symbols(" ".join(f"n_s{i:03d}" for i in range(len(self.states))), real=True)
        remembered = all_of_law(friction, "steady_memory", len(memory), _V0, _SIGMA)
        kept = all_of_law(contact, "steady_memory", len(states), _V0)
        motion = ContactInputs(
            X, V, ACCELERATION, SPRING, _SPRING_SS, TAU, _TAU_SS, _STIFFNESS, _V0, DISTANCE, _DISTANCE_SS, APPROACH,
            states, kept, sp.Integer(0),
        )  # fmt: skip
        tau_ss = of_law(friction, "steady_strength", _V0, _SIGMA)
        pressed = of_law(contact, "normal_stress", motion.steady)
        steady = [tau_ss, derivative(tau_ss, _SIGMA), pressed]
        steady += [derivative(pressed, one) for one in (_SPRING_SS, _TAU_SS, _DISTANCE_SS)]
        coupled = of_law(contact, "coupling", motion.steady)
        steady += [derivative(coupled, one) for one in (_SPRING_SS, _TAU_SS)]
        self.given = contact.load() is None
        self._steady = ArrayFunction([*symbols, _V0, _SIGMA, _SPRING_SS, _TAU_SS, _DISTANCE_SS, _STIFFNESS], steady)
        normal = of_law(contact, "normal_stress", motion)
        self.follows_pull = bool(normal.free_symbols & {SPRING, _STIFFNESS})
        still = {V: _V0, TAU: _TAU_SS, **dict(zip(memory, remembered, strict=True))}
        still |= {X: sp.Integer(0), ACCELERATION: sp.Integer(0), SPRING: _SPRING_SS, DISTANCE: _DISTANCE_SS}
        still |= {APPROACH: sp.Integer(0), **dict(zip(states, kept, strict=True))}
        strength = of_law(friction, "strength", V, _SIGMA, memory, TAU)
        rates = all_of_law(friction, "rates", len(memory), V, _SIGMA, memory, TAU)
        slipping = (V, _SIGMA, TAU, *memory)
        pressing = (X, V, ACCELERATION, SPRING, TAU, DISTANCE, APPROACH, *states)
        slopes = [_at(derivative(e, one), still) for e in (strength, *rates) for one in slipping]
        changes = all_of_law(contact, "rates", len(states), motion)
        slopes += [_at(derivative(e, one), still) for e in (normal, *changes) for one in pressing]
        self._shapes = (1 + len(rates), len(slipping)), (1 + len(changes), len(pressing))
        self._slopes = ArrayFunction([*symbols, _V0, _SIGMA, _SPRING_SS, _TAU_SS, _DISTANCE_SS, _STIFFNESS], slopes)
        seen = friction.observables(_V0, _SIGMA, remembered, _TAU_SS)
        self.seen = {name: unit for name, (_, unit) in seen.items()}
        self.seen |= dict(zip(self.states, contact.memory_units(), strict=True))
        self._seen = ArrayFunction(
            [*symbols, _V0, _SIGMA, _TAU_SS], [*(sp.sympify(e) for e, _ in seen.values()), *kept]
        )

    def steady(self, own: tuple[Any, ...], *at: Any) -> SteadyNumbers:
        """Stresses at v, σ, T, τ, distance and stiffness; `own` has the laws' parameters from `numbers_of`."""
        return SteadyNumbers(*self._steady(*own, *at))

    def slopes(self, own: tuple[Any, ...], *at: Any) -> Slopes:
        """Derivatives at v, σ, T, τ, distance and stiffness."""
        several = np.broadcast_shapes(*(np.shape(one) for one in (*own, *at)))
        found = np.stack([np.broadcast_to(one, several) for one in self._slopes(*own, *at)], axis=-1).astype(float)
        count = self._shapes[0][0] * self._shapes[0][1]
        slip, press = (
            part.reshape(*several, *shape)
            for part, shape in zip((found[..., :count], found[..., count:]), self._shapes, strict=True)
        )
        return Slopes(slip[..., 0, :], slip[..., 1:, :], press[..., 0, :], press[..., 1:, :])

    def observed(self, own: tuple[Any, ...], v: float, sigma: float, tau: float) -> dict[str, float]:
        """States of the laws in steady sliding by name, as the literature defines them."""
        values = self._seen(*own, v, sigma, tau)
        return {name: float(value) + 0.0 for name, value in zip(self.seen, values, strict=True)}


def _at(slope: sp.Expr, still: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    found = sp.sympify(slope).xreplace(still)
    return found.doit() if found.has(sp.sign, sp.Derivative, sp.Abs, sp.DiracDelta) else found


def _with_symbols(law: Any, kind: str) -> tuple[Any, list[sp.Symbol]]:
    """Copy of a law with symbols in place of its numbers, and the symbols.

    A number that is 0, and whose term is then left out, stays 0.
    """
    symbols: dict[str, Any] = {}
    for place, (name, one) in enumerate(parameters(law).items()):
        if one.value is None:
            continue
        zero = one.role.structural and one.value == 0
        positive = True if one.role.domain.low == 0 and not one.role.domain.low_allowed else None
        symbols[name] = sp.Integer(0) if zero else inner_symbol(f"n_{kind}_{place:03d}", real=True, positive=positive)
    return with_values(law, symbols), [one for one in symbols.values() if one.is_Symbol]


def numbers_of(friction: FrictionLaw, contact: ContactLaw) -> list[Any]:
    """Values of the laws' parameters, numbers or expressions, in the order in which the compiled functions take
    them."""
    given = [one for law in (friction, contact) for one in parameters(law).values() if one.value is not None]
    return [one.value for one in given if not (one.role.structural and one.value == 0)]


class _Pair:
    """Cache key of a pair of laws; keys of pairs with the same structure are equal."""

    def __init__(self, friction: FrictionLaw, contact: ContactLaw) -> None:
        self.friction, self.contact = friction, contact
        self.key = _shape(friction), _shape(contact)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Pair) and self.key == other.key


def _shape(law: FrozenRecord) -> tuple[Any, ...]:
    return shape_of(law)


@lru_cache(maxsize=128)
def _cached(pair: _Pair) -> ContactFunctions:
    return ContactFunctions(pair.friction, pair.contact)


def functions_of(friction: FrictionLaw, contact: ContactLaw) -> ContactFunctions:
    """Compiled functions of a pair of laws (cached by structure).

    Raises
    ------
    NotAvailable
        If the friction law has a delay.
    """
    if friction.lateness() != 0:
        raise NotAvailable("friction with a delay is not offered beside a structure given by matrices")
    return _cached(_Pair(friction, contact))
