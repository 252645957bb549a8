"""Kernel for comparison with an experiment: friction and its derivatives in several directions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.questions import question
from steadyslip.core.symbols import inner_symbol
from steadyslip.kernels.build import Code, compiled, interpreted, interpreting
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.lockstep import LockstepKernel
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import PORES, reduce_model
from steadyslip.model.reduction import Reduction, W
from steadyslip.model.variational import with_directions

LANES = 8  # one vector of doubles; more would exceed the registers, which sensitivities fill


@dataclass(frozen=True, eq=False)
class ExperimentProgram:
    """One lockstep kernel of one model.

    Attributes
    ----------
    reduction : Reduction
        Without sensitivities.
    directions : int
    method : str
    settled : bool
        True if motions begin with steady sliding.
    """

    reduction: Reduction
    directions: int
    method: str
    settled: bool = True
    plain: bool = False

    @cached_property
    def kernel(self) -> LockstepKernel:
        friction = self.reduction.outputs["tau"] / self._measured_stress
        extended = with_directions(self.reduction, self.directions)
        choice = Choice(self.method, level="linear", lanes=1 if self.plain else LANES, dense=False)
        return LockstepKernel(extended, choice, friction)

    @property
    def _measured_stress(self) -> sp.Expr:
        """Normal stress (Pa) by which records divide; with pores the pressure around, not yet drained, is measured."""
        contact, channels = self.reduction.model.contact, self.reduction.channels
        if contact.outside is None:
            return self.reduction.outputs["sigma"]
        return contact.sigma_ss + (channels[2] - channels[3]) / contact.area

    @cached_property
    def code(self) -> Code:
        """Machine code, or Python functions if `plain`."""
        return (interpreted if self.plain else compiled)(self.kernel.programs, self.kernel.layout)

    @cached_property
    def through_table(self) -> Callable[..., object]:
        """`steadyslip.kernels.driver.table.through_table` bound to this model."""
        return partial(self.code.through_table, np.array(self.kernel.input_rates() or (-1,)))

    @cached_property
    def unsettled(self) -> dict[str, sp.Symbol]:
        """Free deviations of the start from steady sliding, by name: friction (spring force), then memory variables."""
        if self.settled:
            return {}
        model = self.reduction.model
        own = [item for item in model.memory if item.unit == "1"]  # a memory of normal stress starts settled
        return {"friction": inner_symbol("initial_friction", real=True)} | {
            item.name: inner_symbol(f"initial_{item.symbol.name}", real=True) for item in own
        }

    @cached_property
    def _start(self) -> list[sp.Expr]:
        model = self.reduction.model
        steady = model.steady | {W: self.reduction.w_of_v.xreplace(model.steady)}
        if not self.unsettled:
            return [steady[symbol] for symbol in self.reduction.continuous]
        pull = derivative(model.definitions[model.contact.spring], model.contact.slip)
        away = {model.contact.slip: self.unsettled["friction"] * model.contact.sigma_ss / pull}
        away |= {item.symbol: self.unsettled[item.name] for item in model.memory if item.name in self.unsettled}
        return [steady[symbol] + away.get(symbol, 0) for symbol in self.reduction.continuous]

    @cached_property
    def _values(self) -> tuple[Any, ArrayFunction]:
        """Constants and starting values with derivatives in every parameter (σss following) and every deviation.

        Indices of the derivatives that are not zero, and the function that computes values and these derivatives.
        """
        model = self.reduction.model
        expressions = [*self.kernel.constants.symbols, *self._start]
        sigma = model.contact.sigma_ss
        residual = model.contact.steady_stress - sigma
        found = []
        for symbol in model.parameters.values():
            stress = -derivative(residual, symbol) / derivative(residual, sigma)
            for expression in expressions:
                found.append(derivative(expression, symbol) + derivative(expression, sigma) * stress)
        found += [derivative(expression, symbol) for symbol in self.unsettled.values() for expression in expressions]
        places = [i for i, expression in enumerate(found) if expression != 0]
        wanted = [*expressions, *(found[i] for i in places)]
        return np.array(places, dtype=int), model.function(wanted, *self.unsettled.values())

    def arrays(self, point: OperatingPoint, chain: np.ndarray, away: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Constants with their rates of change, and starting states with theirs, one row per job.

        Parameters
        ----------
        point : OperatingPoint
            Operating point of each job.
        chain : ndarray (jobs, directions, parameters + unsettled)
            Rates of change of the parameters and deviations in each direction.
        away : ndarray (jobs, unsettled)
            Deviations of the start from steady sliding.
        """
        jobs, _, count = chain.shape
        table, size = self.kernel.constants, len(self.kernel.constants.symbols)
        places, function = self._values
        found, width = point.rows(function, *away.T), size + len(self._start)
        values, slopes = found[:, :width], np.zeros((jobs, count * width))
        slopes[:, places] = found[:, width:]
        with np.errstate(all="ignore"):
            rates = np.matmul(chain, slopes.reshape(jobs, count, width))
        constants = table.with_rates(values[:, :size], rates[:, :, :size], {})
        start = np.concatenate([values[:, None, size:], rates[:, :, size:]], axis=1)
        return constants, np.ascontiguousarray(start.reshape(jobs, -1))


@question
def experiment_program(model: Model, directions: int, method: str, settled: bool = True) -> ExperimentProgram:
    """Kernel for a model (cached)."""
    own = model.contact.name
    presses = () if model.contact.outside is None else (own, own + PORES)
    return ExperimentProgram(
        reduce_model(model, None, presses=presses), directions, method, settled, plain=interpreting()
    )
