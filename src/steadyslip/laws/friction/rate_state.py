"""Rate-and-state friction: logarithmic or regularised, any number of states, with normal-stress memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
import sympy as sp

from steadyslip.core.domains import Condition, positive, real
from steadyslip.core.errors import InternalError, Problem
from steadyslip.core.expressions import asinh_exp
from steadyslip.core.records import option, parameter, part, parts, stand_in
from steadyslip.laws.friction.evolution import Evolution, Slip
from steadyslip.laws.friction.law import Expression, Expressions, FrictionLaw, State
from steadyslip.laws.friction.normal_memory import NoMemory, NormalMemory


class RateState(FrictionLaw, name="rate-state"):
    """Rate-and-state friction.

    τ = σ[μ* + a ln(v/v*) + Σ b_i Θ_i] (theory 2; eq. 1 of Dupont & Bapna), or regularised
    τ = σ a asinh[(v/2v*) exp((μ* + Σ b_i Θ_i)/a)], which is defined at rest and in reverse.

    Symbols of the paper: A = a, B = b, L = d_c, θ = Θ. One state is given by `b` and `d_c`, several by
    `states`. `a` > 0 and `d_c` > 0; `b` may have either sign (some gouges are measured with b < 0).

    Both effects may fade at speed (Okubo 1989; theory 12): with `a_cutoff_velocity` v_a and `b_cutoff_velocity` v_b
    τ = σ[μ* + a ln((1 + v_a/v*)/(1 + v_a/v)) + Σ b_i ln((v* + v_b e^Θ_i)/(v* + v_b))], which near steady sliding at v
    is the law with a v_a/(v_a + v) for a and b v_b/(v_b + v) for b. A cut-off that is not given is infinite.
    """

    a: float = parameter("1", positive, "direct effect", kind="direct effect", standing=0.01)
    b: float | None = parameter(
        "1", real, "evolution effect (one state)", default=None, kind="evolution effect", size=0.01, standing=0.01
    )
    d_c: float | None = parameter(
        "m", positive, "characteristic slip distance (one state)", default=None, kind="slip distance", standing=1e-5
    )
    mu_ref: float = parameter(
        "1", positive, "friction coefficient in steady sliding at v_ref", kind="friction level", size=0.01, standing=0.6
    )
    v_ref: float = parameter("m/s", positive, "reference velocity v_ref", kind="reference rate", standing=1e-6)
    a_cutoff_velocity: float | None = parameter(
        "m/s", positive, "velocity v_a above which the direct effect fades; infinite unless given", default=None,
        kind="velocity scale", letter="v_a",
    )  # fmt: skip
    b_cutoff_velocity: float | None = parameter(
        "m/s", positive, "velocity v_b above which the evolution effect fades (one state); infinite unless given",
        default=None, kind="velocity scale", letter="v_b",
    )  # fmt: skip
    states: tuple[State, ...] = parts(State, "several states, each with its own b and d_c", default=())
    evolution: Evolution = part(Evolution, "evolution of the state", default=Slip(), inline=True)
    regularised: bool = option(False, True, doc="regularised at low velocity (asinh form)", default=False)
    normal_memory: NormalMemory = part(NormalMemory, "memory of normal stress", default=NoMemory())

    compared: ClassVar[tuple[str, ...]] = ("slip", "aging", "prz", "slip, two states")
    decided_by_stress: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "normal_memory": ("none", "linker-dieterich", "prakash-clifton")
    }
    decided_besides: ClassVar[Mapping[str, tuple[str, ...]]] = {"evolution": ("slip", "aging")}

    def inconsistencies(self) -> Iterator[Problem]:
        single = {"b": self.b, "d_c": self.d_c}
        if self.states:
            for name, value in {**single, "b_cutoff_velocity": self.b_cutoff_velocity}.items():
                if value is not None:
                    yield Problem(name, "given beside states; give it in each state instead")
        else:
            for name, value in single.items():
                if value is None:
                    yield Problem(name, "missing; give b and d_c (one state) or a list of states")
        if self.regularised:
            for name, value in self._cutoffs().items():
                if value is not None:
                    yield Problem(
                        name, "not defined for the regularised law; leave it out, or set regularised to false"
                    )
        yield from self.evolution.problems(self.states, self.normal_memory)
        yield from self.normal_memory.problems(self.states)

    def conditions(self) -> Iterator[Condition]:
        yield from self.evolution.conditions_with(self.b)
        yield from self.normal_memory.conditions_with(self.states)
        for name, b, cutoff in self._named_effects() if self._has_offset() else ():
            if cutoff is not None:
                message = "got 0; a state whose effect fades at speed has b > 0 or b < 0: leave b_cutoff_velocity out"
                yield Condition(name, np.asarray(b) != 0, message, (b,))

    def runs_away(self) -> bool:
        """True unless all evolution effects, and not the direct effect, have cut-off velocities."""
        return self.a_cutoff_velocity is not None or any(cutoff is None for cutoff in self._state_cutoffs())

    def motion_conditions(self) -> Iterator[Condition]:
        if not self._has_offset() or not self.evolution.divides():
            return
        message = (
            f"got {{}}, with memory of normal stress; the rate of {self.evolution.name} divides by b: use a small b"
        )
        for name, b, _ in self._named_effects():
            yield Condition(name, np.asarray(b) != 0, message, (b,))

    def completed_by(self, other: FrictionLaw) -> FrictionLaw:
        """Copy with the memory of normal stress of `other`: records at constant normal stress cannot determine it."""
        if isinstance(other, RateState) and isinstance(self.normal_memory, NoMemory):
            return replace(self, normal_memory=other.normal_memory)
        return self

    def alternatives(self) -> Mapping[str, Callable[[RateState], RateState]]:
        """Alternatives: each evolution law without parameters (one state), two states, each memory of normal stress."""
        found: dict[str, Callable[[RateState], RateState]] = {}
        for name, law in Evolution.registry.items():
            if issubclass(law, Evolution) and not fields(law):
                found[name] = partial(RateState._with_one_state, evolution=law())
        found["two states"] = RateState._with_two_states
        for name, memory in NormalMemory.registry.items():
            if issubclass(memory, NormalMemory) and (usual := stand_in(memory)) is not None:
                found[name] = partial(RateState._remembering, memory=usual)
        return found

    def _one_state(self) -> dict[str, Any]:
        """Parameters of the only state, or of the first of several states, by name."""
        one = self.states[0] if self.states else self
        if one.b is None or one.d_c is None:
            raise InternalError("b and d_c, or states, to be given")
        return {"b": one.b, "d_c": one.d_c, "b_cutoff_velocity": one.b_cutoff_velocity}

    def _with_one_state(self, evolution: Evolution) -> RateState:
        return replace(self, evolution=evolution, states=(), **self._one_state())

    def _with_two_states(self) -> RateState:
        own = self._one_state()
        pair = tuple(
            State(**own | {"b": share * own["b"], "d_c": times * own["d_c"]}) for share, times in ((0.6, 1), (0.4, 10))
        )  # starting values of a fit; by trial
        return replace(self, states=pair, b=None, d_c=None, b_cutoff_velocity=None)

    def _remembering(self, memory: NormalMemory) -> RateState:
        if type(memory) is type(self.normal_memory):
            return self
        states = tuple(replace(state, alpha=None) for state in self.states)
        return replace(self, states=states, normal_memory=memory)

    def forgets_stress(self) -> bool:
        """True if the memory of normal stress is `NoMemory`."""
        return isinstance(self.normal_memory, NoMemory)

    # parts of the law, valid for numbers and symbols

    def _cutoffs(self) -> dict[str, Expression]:
        """Cut-off velocities (m/s) by field name, None if not given."""
        found: dict[str, Expression] = {
            "a_cutoff_velocity": self.a_cutoff_velocity, "b_cutoff_velocity": self.b_cutoff_velocity
        }  # fmt: skip
        return found | {
            f"states.{i}.b_cutoff_velocity": s.b_cutoff_velocity for i, s in enumerate(self.states, start=1)
        }

    def _named_effects(self) -> Iterator[tuple[str, Expression, Expression]]:
        """Yield field name, b and cut-off velocity v_b of every state."""
        for number, ((b, _), cutoff) in enumerate(zip(self._all_states(), self._state_cutoffs(), strict=True), start=1):
            yield (f"states.{number}.b" if self.states else "b"), b, cutoff

    def _state_cutoffs(self) -> Expressions:
        """Cut-off velocity v_b of every state, None if not given."""
        return tuple(s.b_cutoff_velocity for s in self.states) if self.states else (self.b_cutoff_velocity,)

    def _direct_factor(self, v: Expression) -> Expression:
        """Factor of a in the friction coefficient: ln(v/v*), limited above the cut-off velocity v_a."""
        effect, cutoff = sp.log(v / self.v_ref), self.a_cutoff_velocity
        return effect if cutoff is None else effect - sp.log((v + cutoff) / (self.v_ref + cutoff))

    def _evolution_factor(self, theta: Expression, cutoff: Expression) -> Expression:
        """Factor of b in the friction coefficient: Θ, or ln((v* + v_b e^Θ)/(v* + v_b)) with a cut-off velocity v_b."""
        return theta if cutoff is None else sp.log((self.v_ref + cutoff * sp.exp(theta)) / (self.v_ref + cutoff))

    def _all_states(self) -> tuple[tuple[Expression, Expression], ...]:
        """Pairs (b, d_c) of all states."""
        return tuple((s.b, s.d_c) for s in self.states) if self.states else ((self.b, self.d_c),)

    def _has_offset(self) -> bool:
        """True if the memory variables are not Θ but Ψ = bΘ + offset, which are also valid for b = 0."""
        return self.normal_memory.has_offset() or self.evolution.has_offset()

    def _offsets(self, sigma: Expression, tau: Expression) -> Expressions:
        """Offsets Ψ_i − b_iΘ_i of all states, by which the memory variables stay continuous when stresses jump."""
        whole = self.normal_memory.offset(sigma)
        if not self.states:
            return (whole + self.evolution.offset(sigma, tau),)
        return tuple(part * whole for part in self.normal_memory.parts(self.states))

    def _stress_memory(self, memory: Expressions) -> Expressions:
        """Memory variables that belong to the memory of normal stress: the last ones."""
        return memory[len(self._all_states()) :]

    def _b_theta(self, sigma: Expression, memory: Expressions, tau: Expression) -> Expressions:
        """Products b_iΘ_i of all states, from the memory variables."""
        states = self._all_states()
        if not self._has_offset():
            return tuple(b * theta for (b, _), theta in zip(states, memory, strict=False))
        return tuple(psi - off for psi, off in zip(memory, self._offsets(sigma, tau), strict=False))

    def _effects(self, sigma: Expression, memory: Expressions, tau: Expression) -> Iterator[Expression]:
        """Yield the contribution of every state to the friction coefficient: b_iΘ_i, less with a cut-off velocity."""
        states = zip(self._all_states(), self._state_cutoffs(), strict=True)
        for ((b, _), cutoff), b_theta, stored in zip(
            states, self._b_theta(sigma, memory, tau), memory, strict=False
        ):  # fmt: skip
            if cutoff is None:
                yield b_theta
            else:
                yield b * self._evolution_factor(b_theta / b if self._has_offset() else stored, cutoff)

    def _slip_rate(self, v: Expression) -> Expression:
        return sp.Abs(v) if self.regularised else v

    def _coefficient(self, v: Expression, b_theta: Expression) -> Expression:
        """Friction coefficient μ(v, Σ bΘ): logarithmic or regularised."""
        if self.regularised:
            return self.a * asinh_exp(v / (2 * self.v_ref), (self.mu_ref + b_theta) / self.a)
        return self.mu_ref + self.a * self._direct_factor(v) + b_theta

    def memory(self) -> tuple[str, ...]:
        letter = "Psi" if self._has_offset() else "Theta"
        count = len(self._all_states())
        names = (letter,) if count == 1 else tuple(f"{letter}_{i}" for i in range(1, count + 1))
        return names + self.normal_memory.memory()

    def memory_units(self) -> tuple[str, ...]:
        return ("1",) * len(self._all_states()) + self.normal_memory.memory_units()

    def strength(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expression:
        coefficient = self._coefficient(v, sum(self._effects(sigma, memory, tau)))
        return self.normal_memory.strength(sigma, self._stress_memory(memory)) * coefficient

    def rates(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expressions:
        speed = self._slip_rate(v)
        rates: list[Expression] = []
        for (b, d_c), b_theta, stored in zip(
            self._all_states(), self._b_theta(sigma, memory, tau), memory, strict=False
        ):
            if self._has_offset():
                rates.append(self.evolution.scaled_rate(speed, b_theta, b, d_c, self.v_ref))
            else:
                rates.append(self.evolution.rate(speed, stored, d_c, self.v_ref))
        return (*rates, *self.normal_memory.rates(speed, sigma, self._stress_memory(memory), self.d_c))

    def steady_memory(self, v: Expression, sigma: Expression) -> Expressions:
        theta = -sp.log(v / self.v_ref)
        states = self._all_states()
        if self._has_offset():
            offsets = self._offsets(sigma, self.steady_strength(v, sigma))
            steady = tuple(b * theta + off for (b, _), off in zip(states, offsets, strict=True))
        else:
            steady = tuple(theta for _ in states)
        return steady + self.normal_memory.steady_memory(sigma)

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        stress = self.normal_memory.steady_strength(sigma)
        if all(cutoff is None for cutoff in self._cutoffs().values()):
            total = sum(b for b, _ in self._all_states())
            if self.regularised:
                return stress * self._coefficient(v, -total * sp.log(v / self.v_ref))
            return stress * (self.mu_ref + (self.a - total) * sp.log(v / self.v_ref))
        theta = -sp.log(v / self.v_ref)
        states = zip(self._all_states(), self._state_cutoffs(), strict=True)
        return stress * self._coefficient(
            v, sum(b * self._evolution_factor(theta, cutoff) for (b, _), cutoff in states)
        )

    def observables(
        self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression
    ) -> dict[str, tuple[Expression, str]]:
        """Θ (dimensionless) and θ (s) of every state, and the variables of the memory of normal stress."""
        found: dict[str, tuple[Expression, str]] = {}
        states = self._all_states()
        b_thetas = self._b_theta(sigma, memory, tau)
        for index, ((b, d_c), b_theta) in enumerate(zip(states, b_thetas, strict=True), start=1):
            suffix = "" if len(states) == 1 else f"_{index}"
            theta = b_theta / b if self._has_offset() else memory[index - 1]
            found["Theta" + suffix] = (theta, "1")
            found["theta" + suffix] = (self.evolution.state_time(theta, d_c, self.v_ref), "s")
        own = self.normal_memory
        found |= {
            n: (e, u) for n, e, u in zip(own.memory(), self._stress_memory(memory), own.memory_units(), strict=True)
        }
        return found

    def meanings(self) -> dict[str, str]:
        count = len(self._all_states())
        found = self.normal_memory.meanings()
        for suffix in [""] if count == 1 else [f"_{i}" for i in range(1, count + 1)]:
            found["Theta" + suffix] = f"state of friction, of which b{suffix} Θ{suffix} is added to the coefficient"
            found["theta" + suffix] = "the same state, expressed as a time"
            if self._has_offset():
                found["Psi" + suffix] = f"b{suffix} Θ{suffix} with the part of the stresses, continuous where they jump"
        return found
