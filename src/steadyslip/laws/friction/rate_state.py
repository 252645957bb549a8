"""Rate-and-state friction: logarithmic or regularised, any number of states, with normal-stress memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import sympy as sp

from steadyslip.core.errors import Problem
from steadyslip.core.expressions import asinh_exp
from steadyslip.core.records import Condition, FrozenRecord, nonnegative, option, parameter, part, parts, positive, real
from steadyslip.laws.friction.evolution import Evolution, Nagata, Slip
from steadyslip.laws.friction.law import Expression, FrictionLaw
from steadyslip.laws.friction.normal_memory import LinkerDieterich, NoMemory, NormalMemory, PrakashClifton


class State(FrozenRecord):
    """One of several states of a rate-and-state law."""

    b: float = parameter("1", real, "evolution effect of this state")
    d_c: float = parameter("m", positive, "slip distance of this state")
    alpha: float | None = parameter("1", nonnegative, "this state's part of α", default=None)


class RateState(FrictionLaw, name="rate-state"):
    """Rate-and-state friction.

    τ = σ[μ* + a ln(v/v*) + Σ b_i Θ_i] (theory 2; eq. 1 of Dupont & Bapna), or regularised
    τ = σ a asinh[(v/2v*) exp((μ* + Σ b_i Θ_i)/a)], which is defined at rest and in reverse.

    Symbols of the paper: A = a, B = b, L = d_c, θ = Θ. One state is given by `b` and `d_c`, several by
    `states`. `a` > 0 and `d_c` > 0; `b` may have either sign (some gouges are measured with b < 0).
    """

    a: float = parameter("1", positive, "direct effect")
    b: float | None = parameter("1", real, "evolution effect (one state)", default=None)
    d_c: float | None = parameter("m", positive, "characteristic slip distance (one state)", default=None)
    mu_ref: float = parameter("1", positive, "friction coefficient in steady sliding at v_ref")
    v_ref: float = parameter("m/s", positive, "reference velocity v*")
    states: tuple[State, ...] = parts(State, "several states, each with its own b and d_c", default=())
    evolution: Evolution = part(Evolution, "evolution of the state", default=Slip(), inline=True)
    regularised: bool = option(False, True, doc="regularised at low velocity (asinh form)", default=False)
    normal_memory: NormalMemory = part(NormalMemory, "memory of normal stress", default=NoMemory())

    def inconsistencies(self) -> Iterator[Problem]:
        single = {"b": self.b, "d_c": self.d_c}
        if self.states:
            for name, value in single.items():
                if value is not None:
                    yield Problem(name, "given beside states; give it in each state instead")
        else:
            for name, value in single.items():
                if value is None:
                    yield Problem(name, "missing; give b and d_c (one state) or a list of states")
        yield from self._nagata_problems()
        yield from self._normal_memory_problems()

    def _nagata_problems(self) -> Iterator[Problem]:
        if not isinstance(self.evolution, Nagata):
            return
        if self.states:
            yield Problem("evolution", "nagata is defined for one state; use slip, aging or prz")
        if isinstance(self.normal_memory, PrakashClifton):
            yield Problem("normal_memory", "prakash-clifton is not defined with nagata; use none or linker-dieterich")

    def _normal_memory_problems(self) -> Iterator[Problem]:
        memory = self.normal_memory
        own = [state.alpha for state in self.states]
        given = [alpha for alpha in own if alpha is not None]
        if isinstance(memory, PrakashClifton) and self.states and memory.slip_distance is None:
            yield Problem("normal_memory.slip_distance", "missing; it has no default with several states")
        if not isinstance(memory, LinkerDieterich):
            if given:
                yield Problem("states", "alpha needs normal_memory linker-dieterich")
            return
        if given and len(given) < len(own):
            yield Problem("states", "alpha is given for some states only; give it for all or none")
        if given and memory.alpha is not None:
            yield Problem("normal_memory.alpha", "given beside the states' own alpha; their sum is α")
        if not given and memory.alpha is None:
            yield Problem("normal_memory.alpha", f"missing; allowed: {nonnegative.text}")

    def conditions(self) -> Iterator[Condition]:
        if isinstance(self.evolution, Nagata):
            yield Condition("b", self.b != 0, "got 0; nagata divides by b, use aging instead", (self.b,))
        if isinstance(self.normal_memory, LinkerDieterich) and self.states and self.states[0].alpha is None:
            total = sum(state.b for state in self.states)
            message = "Σb = 0 leaves no way to share α; give each state its own alpha"
            yield Condition("states", total != 0, message, (total,))

    def motion_conditions(self) -> Iterator[Condition]:
        if not self._is_scaled() or not self.evolution.divides():
            return
        message = (
            f"got {{}}, with memory of normal stress; the rate of {self.evolution.name} divides by b: use a small b"
        )
        for number, (b, _, _) in enumerate(self._all_states(), start=1):
            name = f"states.{number}.b" if self.states else "b"
            yield Condition(name, np.asarray(b) != 0, message, (b,))

    # The parts of the law; each is valid for numbers and for symbols.

    def _all_states(self) -> tuple[tuple[Expression, Expression, Expression], ...]:
        """(b, d_c, α) of every state."""
        alpha = self.normal_memory.alpha if isinstance(self.normal_memory, LinkerDieterich) else 0
        if not self.states:
            return ((self.b, self.d_c, alpha),)
        if self.states[0].alpha is not None:
            return tuple((s.b, s.d_c, s.alpha) for s in self.states)
        total = sum(s.b for s in self.states)
        shared: Expression = 0 if alpha is None else alpha
        return tuple((s.b, s.d_c, shared * s.b / total if shared != 0 else 0) for s in self.states)

    def _is_scaled(self) -> bool:
        """Whether memory variables are Ψ = bΘ + ... (also right for b = 0) rather than Θ itself."""
        return isinstance(self.normal_memory, LinkerDieterich) or isinstance(self.evolution, Nagata)

    def _offsets(self, sigma: Expression, tau: Expression) -> tuple[Expression, ...]:
        """Ψ_i − b_iΘ_i = α_i ln(σ/σ_ref) + c_N τ/σ: what makes the memory variables continuous."""
        offsets = []
        for _, _, alpha in self._all_states():
            offset: Expression = sp.Integer(0)
            if isinstance(self.normal_memory, LinkerDieterich):
                offset += alpha * sp.log(sigma / self.normal_memory.sigma_ref)
            if isinstance(self.evolution, Nagata):
                offset += self.evolution.c_nagata * tau / sigma
            offsets.append(offset)
        return tuple(offsets)

    def _b_theta(self, sigma: Expression, memory: tuple[Expression, ...], tau: Expression) -> tuple[Expression, ...]:
        """b_iΘ_i of every state."""
        states = self._all_states()
        if not self._is_scaled():
            return tuple(b * theta for (b, _, _), theta in zip(states, memory, strict=False))
        return tuple(psi - off for psi, off in zip(memory, self._offsets(sigma, tau), strict=False))

    def _slip_rate(self, v: Expression) -> Expression:
        return sp.Abs(v) if self.regularised else v

    def _coefficient(self, v: Expression, b_theta: Expression) -> Expression:
        """μ(v, bΘ): logarithmic or regularised."""
        if self.regularised:
            return self.a * asinh_exp(v / (2 * self.v_ref), (self.mu_ref + b_theta) / self.a)
        return self.mu_ref + self.a * sp.log(v / self.v_ref) + b_theta

    def memory(self) -> tuple[str, ...]:
        letter = "Psi" if self._is_scaled() else "Theta"
        count = len(self._all_states())
        names = (letter,) if count == 1 else tuple(f"{letter}_{i}" for i in range(1, count + 1))
        return (*names, "sigma_e") if isinstance(self.normal_memory, PrakashClifton) else names

    def memory_units(self) -> tuple[str, ...]:
        return tuple("Pa" if name == "sigma_e" else "1" for name in self.memory())

    def strength(self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression) -> Expression:
        coefficient = self._coefficient(v, sum(self._b_theta(sigma, memory, tau)))
        if isinstance(self.normal_memory, PrakashClifton):
            g = self.normal_memory.direct_share
            return (g * sigma + (1 - g) * memory[-1]) * coefficient
        return sigma * coefficient

    def rates(
        self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> tuple[Expression, ...]:
        speed = self._slip_rate(v)
        rates: list[Expression] = []
        for (b, d_c, _), b_theta, stored in zip(
            self._all_states(), self._b_theta(sigma, memory, tau), memory, strict=False
        ):
            if self._is_scaled():
                rates.append(self.evolution.scaled_rate(speed, b_theta, b, d_c, self.v_ref))
            else:
                rates.append(self.evolution.rate(speed, stored, d_c, self.v_ref))
        if isinstance(self.normal_memory, PrakashClifton):
            distance = self.normal_memory.slip_distance
            distance = self.d_c if distance is None else distance
            rates.append(-speed / distance * (memory[-1] - sigma))
        return tuple(rates)

    def steady_memory(self, v: Expression, sigma: Expression) -> tuple[Expression, ...]:
        theta = -sp.log(v / self.v_ref)
        states = self._all_states()
        if self._is_scaled():
            offsets = self._offsets(sigma, self.steady_strength(v, sigma))
            steady = tuple(b * theta + off for (b, _, _), off in zip(states, offsets, strict=True))
        else:
            steady = tuple(theta for _ in states)
        return (*steady, sigma) if isinstance(self.normal_memory, PrakashClifton) else steady

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        total = sum(b for b, _, _ in self._all_states())
        if self.regularised:
            return sigma * self._coefficient(v, -total * sp.log(v / self.v_ref))
        return sigma * (self.mu_ref + (self.a - total) * sp.log(v / self.v_ref))

    def observables(
        self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> dict[str, tuple[Expression, str]]:
        """Θ (dimensionless) and θ (s) of every state; the lagging normal stress if there is one."""
        found: dict[str, tuple[Expression, str]] = {}
        states = self._all_states()
        b_thetas = self._b_theta(sigma, memory, tau)
        for index, ((b, d_c, _), b_theta) in enumerate(zip(states, b_thetas, strict=True), start=1):
            suffix = "" if len(states) == 1 else f"_{index}"
            theta = b_theta / b if self._is_scaled() else memory[index - 1]
            found["Theta" + suffix] = (theta, "1")
            found["theta" + suffix] = (self.evolution.state_time(theta, d_c, self.v_ref), "s")
        if isinstance(self.normal_memory, PrakashClifton):
            found["sigma_e"] = (memory[-1], "Pa")
        return found
