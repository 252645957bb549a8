"""Programs of one reduced Model and one method: a step, and the programs that the driver calls between steps.

One call of `step` advances every lane by one step of its own size, without branches, so that it becomes vector code.
Rare work (breakpoints, events, samples, the end) is done by the driver, lane by lane, with the other programs. A single
run is one lane.
"""

from __future__ import annotations

from functools import cached_property

from steadyslip.kernels.driver.places import event_functions_at, further_at, guess_at, outputs_at, unknown_at
from steadyslip.kernels.events import faster
from steadyslip.kernels.formulation import OUTPUTS, Formulation
from steadyslip.kernels.layout import Out, Row
from steadyslip.kernels.newton import eliminated
from steadyslip.kernels.nodes import Program, Value, as_node, select
from steadyslip.kernels.record import Evaluator, horner, slope_of, times
from steadyslip.kernels.step import Step
from steadyslip.kernels.watch import Watch
from steadyslip.protocol.creep import FREE, SWITCH


class Kernel(Formulation):
    """Programs of one kernel of a reduced Model."""

    @cached_property
    def programs(self) -> tuple[Program, ...]:
        """All programs, in the order of `Routines`."""
        found: tuple[Program, ...] = (
            self._step(), self._rates_program(), self._outputs_program(), self._restore_program(),
            self._shift_program(), self._place_program(), self._balance_program(), self._dense_program(),
        )  # fmt: skip
        if self.choice.dense:
            found = (*found, self._extend_program())
        if self.layout.watched and self.speed is not None:
            return (*found, Watch(self, self.speed).write())
        return found

    # -- the step

    def _step(self) -> Program:
        """Program of one step of every lane; it sets the flag of lanes that need the driver."""
        step = Step(self)
        step.advance()
        step.keep()
        return step.program

    # -- programs of one record, for the driver

    def _rates_program(self) -> Program:
        record = Evaluator(self, Program("rates"))
        point = record.point(record.program.load(Row.TAU))
        found = record.evaluated(self.full, point)
        for i in range(self.size):
            record.program.store(self.layout.rate + i, found[i])
        for i, row in enumerate((Row.V, Row.ACCELERATION, Row.SIGMA)):
            record.program.store(row, found[self.size + i])
        for place, value in record.further_contact_rows(found[self.size :]):
            record.program.store(place, value)
        rates = [rate - record.rate_error(i) for i, rate in enumerate(found[: self.size])]
        moments = record.moments(point, found[self.size :], rates=rates)
        for e, value in enumerate(record.event_values(moments) if self.choice.dense else ()):
            record.program.store(self.layout.event_value + e, value)
        if self.choice.dense and self.limit is not None:
            for row, v in ((Row.W_LIMIT, faster(moments[0])), (Row.W_LP, moments[0].v_lp)):
                record.program.store(row, self.limit(record.constants | {"v": v})[0])
        record.store_unknowns()
        return record.program

    def _outputs_program(self) -> Program:
        record = Evaluator(self, Program("outputs"))
        program, n = record.program, self.size
        point = record.inputs(program.number) | {f"y{i}": program.load(i, "y") for i in range(n)}
        record.z = [program.load(unknown_at(self.layout, k), "y") for k in range(self.unknowns)]
        found = record.evaluated(self.outputs, point)
        for k, z in enumerate(record.z):
            program.store(unknown_at(self.layout, k), z, "y")
        each = len(OUTPUTS)
        seen = found[: each * self.contacts]
        advance = record.load_advance(program.number)
        moved = program.load(Row.LOAD_MOVED)
        for c in range(self.contacts):
            first, (ratio, share, _) = outputs_at(self.layout, c), record.shares(c)
            for i in range(each):
                program.store(first + i, seen[each * c + i], "y")
            program.store(first + Out.V_LP, times(point["in0"], ratio), "y")
            program.store(first + Out.ADVANCE, times(advance, ratio), "y")
            place = found[len(seen) + len(self.reduction.further) + c] + times(moved, ratio) + times(advance, ratio)
            program.store(first + Out.PLACE, place, "y")
            program.store(first + Out.SHARE, share, "y")
        if self.choice.dense:
            if self.speed is not None:  # take the acceleration's sign from the slope of w's dense output
                seen[1] = program.load(n + Out.W_SLOPE, "y")
            for e, value in enumerate(record.event_values(record.moments(point, seen))):
                program.store(event_functions_at(self.layout) + e, value, "y")
        for i in range(len(self.reduction.further)):
            program.store(further_at(self.layout) + i, found[len(seen) + i], "y")
        return program

    def _restore_program(self) -> Program:
        record = Evaluator(self, Program("restore"))
        point = record.point(record.program.load(Row.TAU))
        for i, value in enumerate(record.evaluated(self.restored, point)):
            record.program.store(self.layout.continuous + i, value)
        moved = record.program.load(Row.LOAD_MOVED) + record.load_advance(record.program.load(Row.TAU))
        record.program.store(Row.LOAD_MOVED, moved)
        if self.reduction.sped:
            record.program.store(Row.LOAD_SPEED, point["in0"])
        if self.reduction.letting_go:
            for row, value in zip((Row.PULL, Row.STRETCH), record.evaluated(self.letting_go, point), strict=False):
                record.program.store(row, value)
        return record.program

    def _balance_program(self) -> Program:
        """Program of the balances after a jump: values, derivatives by their velocity variable, and Newton's changes.

        If there is no balance to solve, the velocity is continuous, and the program writes a dummy balance of zero.
        """
        record = Evaluator(self, Program("balance"))
        program = record.program
        found: list[Value] = [0.0, 1.0]
        if self.restart is not None:
            n = self.layout.massless
            point = record.inputs(program.load(Row.TAU))
            point |= {f"w{k}": program.load(guess_at(self.layout, k)) for k in range(n)}
            point |= {f"k{i}": program.load(self.layout.continuous + i) for i in range(self.layout.kept)}
            values = self.restart(record.constants | point)
            matrix = {(i, k): values[n + n * i + k] for i in range(n) for k in range(n)
                      if self.restart.expressions[n + n * i + k] != 0}  # fmt: skip
            slopes = [values[n + n * k + k] for k in range(n)]
            found = [*values[:n], *slopes, *(eliminated(matrix, values[:n]) if n > 1 else ())]
        for i, value in enumerate(found):
            program.store(i, value, "y")
        return program

    def _place_program(self) -> Program:
        """Program that composes the state from the continuous variables and the velocity variables of the balances."""
        program, reduction = Program("place"), self.reduction
        fixed = [w for w, _ in reduction.restarts]
        for i, symbol in enumerate(reduction.state):
            if symbol in reduction.continuous:
                place = self.layout.continuous + reduction.continuous.index(symbol)
            else:
                place = guess_at(self.layout, fixed.index(symbol))
            program.store(self.layout.state + i, program.load(place))
        return program

    def _shift_program(self) -> Program:
        """Program of a jump of the load point: each variable changes by its share of the jump.

        Before the jump, the force of a drive that is released or attached is updated (`_let_go`).
        """
        record = Evaluator(self, Program("shift"))
        program = record.program
        if self.reduction.letting_go:
            self._let_go(record)
        for i, share in enumerate(self.shift(record.constants)):
            place = self.layout.continuous + i
            program.store(place, program.load(place) - times(program.number, share))
        if self.reduction.sped:
            self._speed_up(record)
        return program

    def _speed_up(self, record: Evaluator) -> None:
        """Update velocity variables, which are relative to the drive, so that bodies' velocities are continuous.

        This is needed for bodies that slide on the drive, when the velocity of the drive jumps.
        """
        program, reduction = record.program, self.reduction
        values = record.constants | {f"k{i}": program.load(self.layout.continuous + i) for i in range(self.layout.kept)}
        steady, *_ = self.sped(values | {"jump": 0.0})
        before = select(as_node(program.load(Row.SEGMENT)) > 0.5, program.load(Row.LOAD_SPEED), as_node(steady))
        jump = record.inputs(program.load(Row.TAU))["in0"] - before
        _, *after = self.sped(values | {"jump": jump})
        for (symbol, _), value in zip(reduction.sped, after, strict=True):
            program.store(self.layout.continuous + reduction.continuous.index(symbol), value)

    def _let_go(self, record: Evaluator) -> None:
        """Update the held force of a drive that is released or attached, from the state before the change."""
        program, (held,) = record.program, self.reduction.model.held
        names = {symbol: f"in{i}" for i, symbol in enumerate(self.reduction.channels)}
        free, switch = (names[self.reduction.channels[place]] for place in (FREE, SWITCH))
        point = record.point(program.load(Row.TAU))
        _, _, dashpot, steady = record.evaluated(self.letting_go, point, found=True)
        driven = program.load(Row.STRETCH) + dashpot * point["in0"]  # with positions and velocities before the jump
        place = self.layout.continuous + self.reduction.continuous.index(held)
        goes_on = program.load(Row.PULL) - select(as_node(point[free]) > 0.5, 0.0, driven)
        change = as_node(point[switch])
        new = select(change > 1.5, -as_node(steady), select(change > 0.5, goes_on, program.load(place)))
        program.store(place, new)

    def _extend_program(self) -> Program:
        """Program that computes the polynomials of the dense output of the last step."""
        record = Evaluator(self, Program("extend"))
        record.store_polynomials()
        return record.program

    def _dense_program(self) -> Program:
        record = Evaluator(self, Program("dense"), extended=True)
        program = record.program
        theta = program.number
        if self.choice.dense:
            for i, y in enumerate(record.state_at_fraction(theta)):
                program.store(i, y, "y")
            if self.speed is not None:
                program.store(
                    self.size + Out.W_SLOPE, horner(slope_of(record.smooth_polynomial(self.layout.w)), theta), "y"
                )
            for k, z in enumerate(record.guesses_at_fraction(theta)):
                program.store(unknown_at(self.layout, k), z, "y")
            if not self.unknowns:
                program.store(unknown_at(self.layout, 0), program.load(Row.Z), "y")
        return program
