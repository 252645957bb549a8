"""Kernel for comparison with an experiment: friction and its derivatives in several directions of parameter space.

Measured histories have a breakpoint at every sample. Lanes with separate breakpoints would spend most time there.
Here lanes share the samples of one record: they enter each row of the table together, take steps of their own size and
wait for the last lane. The observable and its derivatives are interpolated at every sample by dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.symbols import inner_symbol
from steadyslip.kernels.build import Code, code_of, interpreting
from steadyslip.kernels.formulation import Choice, Formulation
from steadyslip.kernels.layout import Layout, Row, make_layout
from steadyslip.kernels.nodes import Program, as_node, select
from steadyslip.kernels.record import Evaluator, Values
from steadyslip.kernels.step import Step
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import PORES, reduce_model
from steadyslip.model.reduction import Reduction, W
from steadyslip.model.variational import with_directions


class LockstepKernel(Formulation):
    """Programs of one lockstep kernel, whose lanes follow one table row by row.

    Parameters
    ----------
    reduction : Reduction
        Result of `with_directions`; for massless models of form *explicit* or *implicit*, so that the state is
        continuous.
    choice : Choice
        Options with level ``linear``, without dense output.
    observed : sympy.Expr
        Observable in terms of state, unknowns and inputs.
    """

    def __init__(self, reduction: Reduction, choice: Choice, observed: sp.Expr) -> None:
        self.observed = observed
        self.varied_inputs = reduction.channels
        self.own = len(reduction.state) // (1 + len(reduction.directions))
        super().__init__(reduction, choice)

    def _write(self) -> None:
        self.counted = self.own  # the error norm averages over the state without sensitivities
        super()._write()
        self.full = self.rates
        expression = self._with_constants(self.observed)
        wanted = [expression]
        for direction, column in enumerate(self.reduction.directions):
            change = self._change(expression, direction)
            for variable, slope in zip(self.reduction.state[: self.own], column, strict=True):
                change += self._with_constants(self.reduction.derivative(self.observed, variable)) * slope
            wanted.append(change)
        self.seen = self._formulas(wanted)

    def _made_layout(self) -> Layout:
        directions = len(self.reduction.directions)
        return make_layout(
            lanes=self.choice.lanes,
            size=self.size,
            kept=0,
            constants=len(self.constants.all),
            inputs=len(self.reduction.channels),
            stages=self.method.stages,
            terms=self.terms,
            extra=self.method.all_stages > self.method.stages,
            own=self.own,
            directions=directions,
            unknowns=self.unknowns,
            x=self.reduction.names.index("x"),
            seen=1 + directions,
        )

    @cached_property
    def programs(self) -> tuple[Program, ...]:
        """Programs that `steadyslip.kernels.driver.table` calls."""
        return self._step(), self._rates_program(), self._see_program(), self._extend_program(), self._look_program()

    def _step(self) -> Program:
        """Program of one step; a lane at the end of the row does not change."""
        step = Step(self)
        step.advance()
        step.store_stages()
        step.store_state()
        load, store, good = step.program.load, step.program.store, step.good
        moves = select(step.rest > 0.0, 1.0, 0.0)
        store(Row.ERROR, select(as_node(good, "bool") & (step.rest > 0.0), step.size, step.earlier))
        store(Row.TAU, select(good, step.after, step.tau))
        store(Row.H, step.next_h)
        store(Row.ACCEPTED, load(Row.ACCEPTED) + select(good, moves, 0.0))
        store(Row.REJECTED, load(Row.REJECTED) + select(good, 0.0, moves))
        store(Row.FAILURES, select(good, 0.0, load(Row.FAILURES) + 1.0))
        return step.program

    def _rates_program(self) -> Program:
        record = Evaluator(self, Program("rates_lanes"))
        point = record.point(record.program.load(Row.TAU))
        for i, value in enumerate(record.evaluated(self.rates, point)):
            record.program.store(self.layout.rate + i, value)
        record.store_unknowns()
        return record.program

    def _see_program(self) -> Program:
        """Program that computes observable and derivatives at the current state."""
        record = Evaluator(self, Program("see_lanes"))
        return self._seen(record, record.point(record.program.load(Row.TAU)))

    def _extend_program(self) -> Program:
        """Program that computes the polynomials of the dense output of the last step."""
        record = Evaluator(self, Program("extend_lanes"))
        record.store_polynomials()
        return record.program

    def _look_program(self) -> Program:
        """Program that computes observable and derivatives at `Row.NEXT_TIME`, within the last step."""
        record = Evaluator(self, Program("look_lanes"), extended=True)
        load = record.program.load
        moment = load(Row.NEXT_TIME)
        theta = (moment - load(Row.TAU_OLD)) / load(Row.STEP_SIZE)
        record.z = record.guesses_at_fraction(theta)
        return self._seen(
            record, record.inputs(moment) | {f"y{i}": y for i, y in enumerate(record.state_at_fraction(theta))}
        )

    def _seen(self, record: Evaluator, point: Values) -> Program:
        for i, value in enumerate(record.evaluated(self.seen, point)):
            record.program.store(self.layout.observable + i, value)
        return record.program

    def input_rates(self) -> tuple[int, ...]:
        """For each direction and input, the index among the constants of the input's rate of change.

        -1 if it has none.
        """
        order = {pair: len(self.constants.symbols) + i for i, pair in enumerate(self.constants.rates)}
        directions = range(len(self.reduction.directions))
        return tuple(order.get((c, d), -1) for d in directions for c in self.varied_inputs)


LANES = 8  # number of lanes: one vector of doubles; sensitivities fill the processor's registers, so no more fit


@dataclass(frozen=True, eq=False)
class ExperimentProgram:
    """One lockstep kernel of one model.

    Attributes
    ----------
    reduction : Reduction
        Equations without sensitivities.
    directions : int
        Number of directions in parameter space for derivatives.
    method : str
    settled : bool
        True if motions begin with steady sliding.
    observed : str or None
        Name of the memory variable that is observed; None for the friction coefficient.
    """

    reduction: Reduction
    directions: int
    method: str
    settled: bool = True
    plain: bool = False
    observed: str | None = None

    @cached_property
    def kernel(self) -> LockstepKernel:
        seen = self.reduction.outputs["tau"] / self._measured_stress
        if self.observed is not None:
            seen = next(item.symbol for item in self.reduction.model.memory if item.name == self.observed)
        extended = with_directions(self.reduction, self.directions)
        choice = Choice(self.method, level="linear", lanes=1 if self.plain else LANES, dense=False)
        return LockstepKernel(extended, choice, seen)

    @property
    def _measured_stress(self) -> sp.Expr:
        """Normal stress (Pa) by which friction in records is divided.

        With pore fluid the applied stress, before drainage.
        """
        contact, channels = self.reduction.model.contact, self.reduction.channels
        if contact.outside is None:
            return self.reduction.outputs["sigma"]
        return contact.sigma_ss + (channels[2] - channels[3]) / contact.area

    @cached_property
    def code(self) -> Code:
        """Machine code, or Python functions if `plain`."""
        return code_of(self.kernel.programs, self.kernel.layout, self.plain)

    @cached_property
    def through_table(self) -> Callable[..., object]:
        """`steadyslip.kernels.driver.table.through_table` bound to this model."""
        return partial(self.code.through_table, np.array(self.kernel.input_rates() or (-1,)))

    @cached_property
    def unsettled(self) -> dict[str, sp.Symbol]:
        """Symbols, by name, of free initial deviations from steady sliding: friction, then memory variables."""
        if self.settled:
            return {}
        model = self.reduction.model
        own = [item for item in model.memory if item.unit == "1"]  # memories of normal stress start in steady state
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
        """Indices of nonzero derivatives, and function that computes constants, initial values and these derivatives.

        The derivatives are with respect to every parameter (with the change of σss) and every initial deviation.
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
        """Constants with their rates of change, and initial states with their rates of change, one row per job.

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


@cached
def experiment_program(
    model: Model, directions: int, method: str, settled: bool = True, observed: str | None = None
) -> ExperimentProgram:
    """ExperimentProgram for a model (cached)."""
    own = model.contact.name
    presses = () if model.contact.outside is None else (own, own + PORES)
    return ExperimentProgram(
        reduce_model(model, None, presses=presses), directions, method, settled, plain=interpreting(), observed=observed
    )
