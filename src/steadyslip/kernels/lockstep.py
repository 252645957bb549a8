"""Kernel of fits: all lanes follow one table of inputs together, with sensitivities.

Measured histories have a breakpoint at every sample. Lanes with breakpoints of their own would spend most time there;
lanes that share the samples of one record enter each row of the table together, take steps of their own size and wait
for the last one. The observable and its derivatives in several directions are interpolated at every sample by dense
output.
"""

from __future__ import annotations

from functools import cached_property

import sympy as sp

from steadyslip.kernels.formulation import Choice, Formulation
from steadyslip.kernels.layout import Layout, Row, make_layout
from steadyslip.kernels.nodes import Program, as_node, select
from steadyslip.kernels.record import Evaluator, Values
from steadyslip.kernels.step import Step
from steadyslip.model.reduction import Reduction


class LockstepKernel(Formulation):
    """Writer of the programs of one lockstep kernel.

    Parameters
    ----------
    reduction : Reduction
        From `with_directions`, massless models in the form *explicit* or *implicit*: the state is continuous.
    choice : Choice
        Of level ``linear``, not dense.
    observed : sympy.Expr
        Observable in terms of state, unknowns and inputs.
    """

    def __init__(self, reduction: Reduction, choice: Choice, observed: sp.Expr) -> None:
        self.observed = observed
        self.varied_inputs = reduction.channels
        self.own = len(reduction.state) // (1 + len(reduction.directions))
        super().__init__(reduction, choice)

    def _write(self) -> None:
        self.counted = self.own  # the error norm averages without sensitivities, which have tolerances of their own
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
        """One step; a lane at the end of the row stays as it is."""
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
        """Observable and derivatives at the current state."""
        record = Evaluator(self, Program("see_lanes"))
        return self._seen(record, record.point(record.program.load(Row.TAU)))

    def _extend_program(self) -> Program:
        """Polynomials of the dense output of the last step."""
        record = Evaluator(self, Program("extend_lanes"))
        record.store_polynomials()
        return record.program

    def _look_program(self) -> Program:
        """Observable and derivatives at `Row.NEXT_TIME`, within the last step."""
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
        """Indices of the rates of change of inputs among the constants, by direction and input; -1 if absent."""
        order = {pair: len(self.constants.symbols) + i for i, pair in enumerate(self.constants.rates)}
        directions = range(len(self.reduction.directions))
        return tuple(order.get((c, d), -1) for d in directions for c in self.varied_inputs)
