"""What every friction law provides: strength, memory, and the steady state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import sympy as sp

from steadyslip.core.conditions import Condition
from steadyslip.core.records import FrozenRecord

Expression = Any  # SymPy expression, or a plain number when a law is evaluated by hand


class FrictionLaw(FrozenRecord, family="friction law"):
    """Base of friction laws: τ(v, σ, memory) and the evolution of the memory.

    A law works in *memory variables*: combinations of its states that stay continuous when velocity
    or normal stress jump (theory: Φ, σ_e, z). Every method is pure, reads the record's own fields and
    returns SymPy expressions; the same methods serve numbers and symbols.

    Subclasses set ``memory`` and define `strength`, `rates` and `steady_memory`; the rest has defaults.
    Stresses are in Pa per unit nominal area, velocity in m/s, positive in the direction of loading.
    """

    compared: ClassVar[tuple[str, ...]] = ()

    def memory(self) -> tuple[str, ...]:
        """Names of the memory variables, in the order used everywhere; empty for a law without."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """SI units of the memory variables; dimensionless unless overridden."""
        return tuple("1" for _ in self.memory())

    def strength(self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression) -> Expression:
        """Friction stress τ (Pa).

        `tau` is the stress itself, for the rare law (Nagata) whose state depends on it; others ignore it.
        """
        raise NotImplementedError

    def rates(
        self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> tuple[Expression, ...]:
        """Time derivatives of the memory variables (1/s times their unit)."""
        return ()

    def steady_memory(self, v: Expression, sigma: Expression) -> tuple[Expression, ...]:
        """Memory variables in steady sliding at velocity `v` > 0 and normal stress `sigma` > 0."""
        return ()

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        """Friction stress in steady sliding, τss(v, σ)."""
        return self.strength(v, sigma, self.steady_memory(v, sigma), sp.nan)

    def lateness(self) -> Expression:
        """Time (s) by which friction follows velocity late; 0 for laws whose memory fades with slip or not at all."""
        return 0

    def late_strength(
        self, v: Expression, late: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> Expression:
        """`strength` of a law with a `lateness`: `late` is the velocity that long ago."""
        return self.strength(v, sigma, memory, tau)

    def direction(self, v: Expression, velocity: Expression) -> Expression:
        """What motion takes for sign(v), wherever the law says sign: a step at rest cannot be integrated.

        Unless overridden a smooth step: the block creeps at below a millionth of the drive's `velocity` where it would
        stick. A law whose strength has no step at rest has no use for this.
        """
        return sp.tanh(v / (1e-6 * velocity))

    def completed_by(self, other: FrictionLaw) -> FrictionLaw:
        """This law, as fitted to records, with what they cannot tell taken from `other`."""
        return self

    def alternatives(self) -> Mapping[str, FrictionLaw]:
        """Laws of the same kind that records may speak for instead, by label; `compared` are tried by default."""
        return {}

    def runs_away(self) -> bool:
        """Whether friction alone, without mass or damping, lets velocity grow beyond all bounds in finite time."""
        return False

    def motion_conditions(self) -> Iterator[Condition]:
        """Relations between numbers that motion needs beyond small perturbations; as `conditions`, named likewise."""
        yield from ()

    def observables(
        self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> dict[str, tuple[Expression, str]]:
        """What the field calls the states, from the memory variables: name to (expression, SI unit)."""
        return {
            name: (value, unit) for name, value, unit in zip(self.memory(), memory, self.memory_units(), strict=True)
        }

    def meanings(self) -> dict[str, str]:
        """What `observables` mean, in a few words for people who do not know the law, by name; none must be told."""
        return {}
