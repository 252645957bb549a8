"""Base class of friction laws: strength, memory variables, and the steady state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import sympy as sp

from steadyslip.core.domains import Condition, nonnegative, positive, real
from steadyslip.core.records import FrozenRecord, parameter

Expression = Any  # SymPy expression, or a plain number when a law is evaluated by hand
Expressions = tuple[Expression, ...]  # one expression for each memory variable or state


class FrictionLaw(FrozenRecord, family="friction law"):
    """Base of friction laws: stress τ(v, σ, memory) and rates of the memory variables.

    Memory variables are combinations of the states that stay continuous when velocity or normal stress jump (theory:
    Φ, σ_e, z). Every method is pure, reads the record's own fields and returns SymPy expressions; the same methods
    serve numbers and symbols.

    Subclasses define `memory`, `strength`, `rates` and `steady_memory`; all other methods have defaults. Stresses are
    in Pa per unit nominal area, velocity in m/s, positive in the direction of loading.
    """

    compared: ClassVar[tuple[str, ...]] = ()
    decided_by_stress: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    decided_besides: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def doubts(self) -> Iterator[str]:
        """Yield a sentence on each allowed but unusual value; it begins with the parameter's name in ``friction.``."""
        yield from ()

    def memory(self) -> tuple[str, ...]:
        """Names of the memory variables, in the order of all other methods; empty if there are none."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """SI units of the memory variables; dimensionless unless overridden."""
        return tuple("1" for _ in self.memory())

    def strength(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expression:
        """Friction stress τ (Pa).

        `tau` is the friction stress itself, for laws whose state depends on it (Nagata); other laws ignore `tau`.
        """
        raise NotImplementedError

    def rates(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expressions:
        """Time derivatives of the memory variables (their unit per s)."""
        return ()

    def steady_memory(self, v: Expression, sigma: Expression) -> Expressions:
        """Memory variables in steady sliding at velocity `v` > 0 and normal stress `sigma` > 0."""
        return ()

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        """Friction stress in steady sliding, τss(v, σ)."""
        return self.strength(v, sigma, self.steady_memory(v, sigma), sp.nan)

    def lateness(self) -> Expression:
        """Time delay (s) of friction behind velocity; 0 for laws without a delay."""
        return 0

    def late_strength(
        self, v: Expression, late: Expression, sigma: Expression, memory: Expressions, tau: Expression
    ) -> Expression:
        """Friction stress (Pa) of a law with a delay; `late` is the velocity (m/s) a time `lateness` ago."""
        return self.strength(v, sigma, memory, tau)

    def rest_strength(self, sigma: Expression) -> Expression:
        """Largest friction stress (Pa) at rest of a law without memory; by default the limit of slow sliding."""
        v = sp.Symbol("v", positive=True)
        return sp.sympify(self.strength(v, sigma, (), sp.nan)).subs(v, 0)

    def slow_velocity(self) -> Expression | None:
        """Velocity (m/s) below which a contact with memory counts as at rest; None for laws without static friction."""
        return None

    def direction(self, v: Expression, velocity: Expression) -> Expression:
        """Smooth replacement of sign(v) in simulations, which cannot integrate a step at rest.

        By default tanh(v/w) with w a millionth of the drive's `velocity` (m/s), so that a block that should stick
        creeps more slowly than w. The smaller w, the stiffer the equations; a millionth is chosen by trial.
        """
        return sp.tanh(v / (1e-6 * velocity))

    def completed_by(self, other: FrictionLaw) -> FrictionLaw:
        """Copy of this fitted law with parameters that the records cannot determine taken from `other`."""
        return self

    def alternatives(self) -> Mapping[str, Callable[[Any], FrictionLaw]]:
        """Functions that turn a law into an alternative of the same kind, by word, in the order of application.

        A label of a law is a list of these words: `aging, two states`. The class attribute `compared` lists the labels
        that are fitted by default. By field of the law, `decided_by_stress` has the words that records with changing
        normal stress can discriminate, and `decided_besides` words of other fields that are compared as well.
        """
        return {}

    def forgets_stress(self) -> bool:
        """True if the law has no memory of normal stress although other laws of its kind have such a memory."""
        return False

    def runs_away(self) -> bool:
        """True if velocity can become infinite in finite time under this law without mass and damping."""
        return False

    def motion_conditions(self) -> Iterator[Condition]:
        """Yield conditions between parameters that simulation needs in addition to `conditions`."""
        yield from ()

    def observables(
        self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression
    ) -> dict[str, tuple[Expression, str]]:
        """States in the literature's form as functions of the memory variables: name to (expression, SI unit)."""
        return {
            name: (value, unit) for name, value, unit in zip(self.memory(), memory, self.memory_units(), strict=True)
        }

    def meanings(self) -> dict[str, str]:
        """Short explanations of `observables` and `memory` by name, for pages and reports; may be incomplete."""
        return {}


class State(FrozenRecord):
    """One of several states of a rate-and-state law."""

    b: float = parameter(
        "1", real, "evolution effect of this state", kind="evolution effect", size=0.01, standing=0.01, idle=0.0
    )
    d_c: float = parameter("m", positive, "slip distance of this state", kind="slip distance", standing=1e-5)
    alpha: float | None = parameter(
        "1", nonnegative, "this state's part of α", default=None, kind="stress share", size=0.2, idle=0.0
    )
    b_cutoff_velocity: float | None = parameter(
        "m/s", positive, "velocity above which this state's effect fades; infinite unless given", default=None,
        kind="velocity scale", letter="v_b",
    )  # fmt: skip
