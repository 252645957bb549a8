"""The programs of one reduced Model and one method: a step, and what the driver asks for between steps.

One pass of `step` advances every lane by one step of its own size; there is no branch in it, so that it becomes vector
code. Everything rare (breakpoints, events, samples, the end) is done by the driver, lane by lane, with the other
programs. A single run is the same with one lane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from steadyslip.kernels.layout import MOST_FAILURES, Layout, Out, Row, make_layout
from steadyslip.kernels.methods import METHODS, Method
from steadyslip.kernels.nodes import Loop, Node, Program, Value, exp, larger, log, primitive, select, smaller, weighted
from steadyslip.kernels.rosenbrock import Pattern, factorised, substituted
from steadyslip.kernels.source import Constants, Formulas
from steadyslip.model.reduction import INPUTS, SLOPES, TIME, V_LP, Reduction

LEVELS = ("constant", "linear", "harmonic")
CHANNELS = ("v", "q", "p")
OUTPUTS = ("v", "acceleration", "sigma", "tau", "T")
_SLOPE_NAMES = {s: f"slope_{c}" for s, c in zip(SLOPES[:3], CHANNELS, strict=True)}
_INPUT_NAMES = {s: f"in_{c}" for s, c in zip(INPUTS[:3], CHANNELS, strict=True)} | {TIME: "time"}
NEWTON_STEPS = 6
FASTER = 1.000001  # than the load point, beyond rounding: slipping
PROPORTIONAL, INTEGRAL = 0.7, 0.4  # step control after Gustafsson, with the safety factor below:
# hardly any rejections, and an end error near rtol after tens of cycles
Point = dict[str, Value]


@dataclass(frozen=True)
class Choice:
    """What a kernel is compiled for, beside the equations.

    Attributes
    ----------
    method : str
        Name of the method.
    level : str
        The most that the inputs do within a segment: ``constant``, ``linear`` or ``harmonic``.
    harmonics : int
        Harmonic terms per input (level ``harmonic``).
    lanes : int
        Trajectories side by side.
    dense : bool
        Whether stages are kept for dense output (events, samples).
    """

    method: str
    level: str = "constant"
    harmonics: int = 0
    lanes: int = 1
    dense: bool = True


class Kernel:
    """Writes the programs of one kernel.

    Attributes
    ----------
    layout : Layout
    constants : Constants
    size : int
        Length of the state.
    """

    varied_inputs: tuple[sp.Symbol, ...] = (V_LP,)  # the steady drive is a constant too

    def __init__(self, reduction: Reduction, choice: Choice) -> None:
        self.reduction, self.choice = reduction, choice
        self.method: Method = METHODS[choice.method]()
        self.size = self.counted = len(reduction.state)  # how many errors are averaged
        self.names = {s: f"y{i}" for i, s in enumerate(reduction.state)} | _INPUT_NAMES | _SLOPE_NAMES
        variables = {*reduction.state, *reduction.continuous, *INPUTS, *SLOPES[:3], sp.Symbol("w", real=True)}
        if reduction.unknown is not None:
            self.names[reduction.unknown] = "z"
            variables.add(reduction.unknown)
        self.constants = Constants(variables)
        self._rates = [self._fixed(rate) for rate in reduction.rates]
        self.driven = self._answers_to_constants()
        self.timed = choice.level != "constant" or any(rate.has(TIME) for rate in self._rates)
        self._write()
        self.layout = self._made_layout()

    def _fixed(self, expression: sp.Expr) -> sp.Expr:
        """Lifted; slopes vanish where inputs are constant."""
        if self.choice.level == "constant":
            expression = expression.xreplace(dict.fromkeys(SLOPES[:3], sp.Integer(0)))
        return self.constants.lifted(expression)

    def _answers_to_constants(self) -> dict[int, sp.Expr]:
        """By position in the state: what a change of the constants adds to the rates of `Reduction.direction`."""
        reduction = self.reduction
        found = {
            reduction.state.index(symbol): self._change(self._rates[i], direction)
            for direction, symbols in enumerate(reduction.directions)
            for i, symbol in enumerate(symbols)
        }
        self._rates = [rate + found.get(k, 0) for k, rate in enumerate(self._rates)]
        return found

    def _change(self, expression: sp.Expr, direction: int) -> sp.Expr:
        """How fast an expression in constants and state changes with the constants, at a given state."""

        def explicit(e: sp.Expr) -> sp.Expr:
            known = [*self.constants.symbols.values(), *self.varied_inputs]
            return sp.Add(*(sp.diff(e, c) * self.constants.rate_of(c, direction) for c in known if e.has(c)))

        added = explicit(expression)
        if self.reduction.residual is not None and self.reduction.unknown is not None:
            residual, unknown = self._fixed(self.reduction.residual), self.reduction.unknown
            added -= sp.diff(expression, unknown) * explicit(residual) / sp.diff(residual, unknown)
        return added

    def _entry(self, matrix: list[list[sp.Expr]], i: int, k: int) -> sp.Expr:
        """An entry of the Jacobian, with what changing constants add."""
        entry = self._fixed(matrix[i][k])
        if i not in self.driven:
            return entry
        variable, unknown = self.reduction.state[k], self.reduction.unknown
        entry += sp.diff(self.driven[i], variable)
        if self.reduction.residual is not None and unknown is not None:
            residual = self._fixed(self.reduction.residual)
            entry -= sp.diff(self.driven[i], unknown) * sp.diff(residual, variable) / sp.diff(residual, unknown)
        return entry

    # -- the equations

    def _formulas(self, expressions: Sequence[sp.Expr]) -> Formulas:
        return Formulas(expressions, self.names)

    def _write(self) -> None:
        """All formulas; in this order their constants are numbered."""
        reduction, n = self.reduction, self.size
        outputs = [self._fixed(reduction.outputs[name]) for name in OUTPUTS]
        self.residual: Formulas | None = None
        if reduction.unknown is not None and reduction.residual is not None:
            pair = (reduction.residual, sp.diff(reduction.residual, reduction.unknown))
            self.residual = self._formulas([self._fixed(e) for e in pair])
        self.rates = self._formulas(self._rates)
        self.full = self._formulas(self._rates + outputs[:3])
        self.outputs = self._formulas(outputs)
        self.restored = self._formulas([self._fixed(e) for e in reduction.restored])
        self.pattern: Pattern = set()
        if self.method.implicit:
            matrix = reduction.jacobian()
            found = {(i, k): self._entry(matrix, i, k) for i in range(n) for k in range(n)}
            self.pattern = {place for place, entry in found.items() if entry != 0}
            entries = [found[place] for place in sorted(self.pattern)]
            if self.timed:
                entries += [self._fixed(e) for e in reduction.time_derivative()]
            self.jacobian = self._formulas(entries)
        self.restart: Formulas | None = None
        if reduction.restart is not None:
            w = sp.Symbol("w", real=True)
            known = {s: f"k{i}" for i, s in enumerate(reduction.continuous)} | {w: "w"} | _INPUT_NAMES | _SLOPE_NAMES
            pair = (reduction.restart, sp.diff(reduction.restart, w))
            self.restart = Formulas([self._fixed(e) for e in pair], known)

    def _made_layout(self) -> Layout:
        reduction, choice = self.reduction, self.choice
        massless = reduction.restart is not None
        return make_layout(
            lanes=choice.lanes,
            size=self.size,
            kept=len(reduction.continuous),
            constants=len(self.constants.all),
            harmonics=choice.harmonics,
            stages=self.method.stages if choice.dense else 0,
            massless=massless,
            solved=massless and reduction.unknown is not None,
            w=reduction.names.index("w") if "w" in reduction.names else -1,
            x=reduction.names.index("x"),
        )

    @cached_property
    def programs(self) -> tuple[Program, ...]:
        """All programs, in the order of `Routines`."""
        return (
            self._step(), self._rates_program(), self._outputs_program(), self._restore_program(),
            self._place_program(), self._balance_program(), self._dense_program(),
        )  # fmt: skip

    # -- the step

    def _step(self) -> Program:
        """One step of every lane, from loading to the flag that asks for the driver's attention."""
        step = Step(self)
        step.advance()
        step.keep()
        return step.program

    # -- programs of one record, for the driver

    def _rates_program(self) -> Program:
        record = Record(self, Program("rates"))
        point = record.point(record.program.load(Row.TAU))
        found = record.evaluated(self.full, point)
        for i in range(self.size):
            record.program.store(self.layout.rate + i, found[i])
        for i, row in enumerate((Row.V, Row.ACCELERATION, Row.SIGMA)):
            record.program.store(row, found[self.size + i])
        record.program.store(Row.GAP, found[self.size] - record.faster(point))
        record.keep_unknown()
        return record.program

    def _outputs_program(self) -> Program:
        record = Record(self, Program("outputs"))
        program, n = record.program, self.size
        point = record.inputs(program.number) | {f"y{i}": program.load(i, "y") for i in range(n)}
        for i, value in enumerate(record.evaluated(self.outputs, point)):
            program.store(n + i, value, "y")
        program.store(n + Out.V_LP, point["in_v"], "y")
        return program

    def _restore_program(self) -> Program:
        record = Record(self, Program("restore"))
        point = record.point(record.program.load(Row.TAU))
        for i, value in enumerate(record.evaluated(self.restored, point)):
            record.program.store(self.layout.continuous + i, value)
        return record.program

    def _balance_program(self) -> Program:
        """The balance as a function of w after a jump; without one, velocity simply continues."""
        record = Record(self, Program("balance"))
        program = record.program
        found: list[Value] = [0.0, 1.0]
        if self.restart is not None:
            point = record.inputs(0.0) | {"w": program.number}
            point |= {f"k{i}": program.load(self.layout.continuous + i) for i in range(self.layout.kept)}
            found = self.restart(record.constants | point)
        for i, value in enumerate(found):
            program.store(i, value, "y")
        return program

    def _place_program(self) -> Program:
        """The state from the continuous variables and w."""
        program, reduction = Program("place"), self.reduction
        for i, symbol in enumerate(reduction.state):
            value = program.number
            if symbol in reduction.continuous:
                value = program.load(self.layout.continuous + reduction.continuous.index(symbol))
            program.store(self.layout.state + i, value)
        if reduction.unknown is not None and str(reduction.unknown) == "w":
            program.store(Row.Z, program.number)
        return program

    def _dense_program(self) -> Program:
        program = Program("dense")
        if self.choice.dense:
            for i in range(self.size):
                program.store(i, self._interpolated(program, i, program.number), "y")
        return program

    def _interpolated(self, program: Program, i: int, theta: Node) -> Value:
        """State variable i at the fraction theta of the last step."""
        method, n = self.method, self.size
        old = program.load(self.layout.old + i)
        stages = [program.load(self.layout.stage + s * n + i) for s in range(method.stages)]
        if not method.implicit:
            weights = [theta * horner(polynomial, theta) for polynomial in method.dense]
            terms = [weight * k for weight, k in zip(weights, stages, strict=True)]
            return old + program.load(Row.DONE) * total(terms)
        inner = horner([weighted(row, stages) for row in method.dense], theta)
        change = weighted(method.arguments()[method.stages], stages)
        return old + theta * (change + (1.0 - theta) * inner)


def horner(coefficients: Sequence[Value], x: Node) -> Value:
    """A polynomial, lowest coefficient first."""
    value: Value = 0.0
    for coefficient in reversed(coefficients):
        value = coefficient + x * value
    return value


def total(terms: Sequence[Value]) -> Value:
    """Their sum, from the left."""
    value = terms[0]
    for term in terms[1:]:
        value = value + term
    return value


class Record:
    """What every evaluation within one program reads: constants, inputs, the unknown."""

    def __init__(self, kernel: Kernel, program: Program) -> None:
        self.kernel, self.program = kernel, program
        layout, load = kernel.layout, program.load
        self.constants: Point = {str(s): load(layout.constant + i) for i, s in enumerate(kernel.constants.all)}
        self.z: Value = 0.0
        if kernel.reduction.unknown is not None:
            self.z, self.z_scale = load(Row.Z), load(Row.Z_SCALE)

    def inputs(self, moment: Value) -> Point:
        """Inputs and their slopes at a local time of the segment."""
        choice, layout, load, found = self.kernel.choice, self.kernel.layout, self.program.load, {}
        for i, c in enumerate(CHANNELS):
            value: Value = load(Row.INPUT + i)
            if choice.level != "constant":
                slope: Value = load(Row.SLOPE + i)
                value = value + slope * moment
                for h in range(choice.harmonics):
                    k = i * choice.harmonics + h
                    amplitude, omega = load(layout.amplitude + k), load(layout.omega + k)
                    angle = omega * moment + load(layout.phase + k)
                    value = value + amplitude * primitive("sin", angle)
                    slope = slope + amplitude * omega * primitive("cos", angle)
                found[f"slope_{c}"] = slope
            found[f"in_{c}"] = value
        if self.kernel.reduction.model.imposed != 0:
            found["time"] = load(Row.START) + moment
        return found

    def state(self) -> list[Node]:
        """The record's own state."""
        return [self.program.load(self.kernel.layout.state + i) for i in range(self.kernel.size)]

    def point(self, moment: Value) -> Point:
        """The record's state and the inputs at a local time."""
        return self.inputs(moment) | {f"y{i}": y for i, y in enumerate(self.state())}

    def evaluated(self, formulas: Formulas, point: Point, solved: bool = True) -> list[Value]:
        """Formulas at a point, the unknown solved for there."""
        if solved and self.kernel.residual is not None:
            self.z = self._solved(self.kernel.residual, point)
        return formulas(self.constants | point | {"z": self.z})

    def _solved(self, residual: Formulas, point: Point) -> Value:
        """Newton's method for the unknown, a fixed number of steps; the failure is NaN."""
        reduction = self.kernel.reduction
        clamped = not (str(reduction.unknown) == "a_x" or reduction.velocity == "linear")

        def improved(z: Node) -> tuple[list[Value], list[Value]]:
            value, slope = residual(self.constants | point | {"z": z})
            change = value / slope
            if clamped:
                change = smaller(larger(change, -2.0), 2.0)
            z = z - change
            return [z], [z, change]

        z, change = Loop(NEWTON_STEPS, [self.z], improved).outcome()
        found: Value = select(abs(change) <= 1e-7 * abs(z) + 1e-9 * abs(self.z_scale), z, float("nan"))
        return found

    def keep_unknown(self) -> None:
        """Store it, as a guess for the next time."""
        if self.kernel.reduction.unknown is not None:
            self.program.store(Row.Z, self.z)

    def faster(self, point: Point) -> Value:
        """The velocity above which the block slips."""
        limit: Value = larger(FASTER * point["in_v"], self.program.load(Row.V_LOW))
        return limit


class Step(Record):
    """Writes one step."""

    def __init__(self, kernel: Kernel, name: str = "step") -> None:
        super().__init__(kernel, Program(name))
        load, layout, n = self.program.load, kernel.layout, kernel.size
        self.old = self.state()
        self.first: list[Value] = [load(layout.rate + i) for i in range(n)]
        self.atol, self.rtol = [load(layout.atol + i) for i in range(n)], load(Row.RTOL)
        self.tau, self.proposed, self.end = load(Row.TAU), load(Row.H), load(Row.END)
        rest = self.end - self.tau
        self.rest = rest
        self.last = self.proposed >= rest * 0.99999999
        self.h: Value = select(self.last, rest, self.proposed)
        self.new: Sequence[Value] = ()
        self.steady = None if kernel.timed else self.inputs(self.tau)

    def advance(self) -> None:
        """The step itself, its error and the size of the next."""
        method = self.kernel.method
        errors = self._rosenbrock() if method.implicit else self._runge_kutta()
        error: Value = 0.0
        for i, e in enumerate(errors):
            scaled = e / (self.atol[i] + self.rtol * larger(abs(self.old[i]), abs(self.new[i])))
            error = error + scaled * scaled
        error = error * (1 / self.kernel.counted)
        self.good = error <= 1.0
        self.size = log(smaller(larger(error, 1e-10), 1e30))
        self.earlier = self.program.load(Row.ERROR)
        kept = -0.5 * PROPORTIONAL / method.order * self.size + 0.5 * INTEGRAL / method.order * self.earlier
        factor = 0.8 * exp(select(self.good, kept, -0.5 / method.order * self.size))
        factor = select(error < 1e60, smaller(larger(factor, 0.2), 6.0), 0.2)
        self.after = select(self.last, self.end, self.tau + self.h)
        next_h = self.h * factor
        self.next_h = select(self.last & self.good, larger(self.proposed, next_h), next_h)

    def _inputs_of(self, s: int) -> Point:
        """Inputs at stage s."""
        if self.steady is not None:
            return self.steady
        return self.inputs(self.tau + self.kernel.method.nodes[s] * self.h)

    def _found(self, formulas: Formulas, y: Sequence[Value], inputs: Point) -> list[Value]:
        return self.evaluated(formulas, inputs | {f"y{i}": value for i, value in enumerate(y)})

    def _runge_kutta(self) -> list[Value]:
        method, n, h = self.kernel.method, self.kernel.size, self.h
        self.stages: list[Sequence[Value]] = [self.first]
        for s in range(1, method.stages):
            y = [self.old[i] + h * weighted(method.a[s], [k[i] for k in self.stages]) for i in range(n)]
            whole = s == method.stages - 1
            self.here = self._inputs_of(s)
            found = self._found(self.kernel.full if whole else self.kernel.rates, y, self.here)
            self.stages.append(found[:n])
        self.new, self.rates, self.outputs = y, found[:n], found[n:]
        return [h * weighted(method.error, [k[i] for k in self.stages]) for i in range(n)]

    def _rosenbrock(self) -> list[Value]:
        kernel, method, n, h = self.kernel, self.kernel.method, self.kernel.size, self.h
        beginning = self.steady if self.steady is not None else self.inputs(self.tau)
        point = beginning | {f"y{i}": value for i, value in enumerate(self.old)}
        entries = self.evaluated(kernel.jacobian, point, solved=False)
        jacobian = dict(zip(sorted(kernel.pattern), entries, strict=False))
        in_time = entries[len(jacobian) :]
        inverse = 1.0 / h
        matrix = factorised(n, jacobian, inverse * (1 / method.gamma))
        arguments = method.arguments()
        self.stages = []
        y: list[Value] = list(self.old)
        for s in range(method.stages):
            rates: Sequence[Value] = self.first
            if s:
                if s < len(method.a):
                    y = [self.old[i] + weighted(arguments[s], [u[i] for u in self.stages]) for i in range(n)]
                else:
                    y = [y[i] + self.stages[-1][i] for i in range(n)]
                rates = self._found(kernel.rates, y, self._inputs_of(s))
            right = list(rates)
            for i in range(n):
                if s and any(method.c[s]):
                    right[i] = right[i] + inverse * weighted(method.c[s], [u[i] for u in self.stages])
                if kernel.timed and abs(method.time_weights[s]) > 1e-12:
                    right[i] = right[i] + h * method.time_weights[s] * in_time[i]
            self.stages.append(substituted(matrix, right))
        self.new = [y[i] + self.stages[-1][i] for i in range(n)]
        self.here = self.steady if self.steady is not None else self.inputs(self.tau + h)
        found = self._found(kernel.full, self.new, self.here)
        self.rates, self.outputs = found[:n], found[n:]
        return list(self.stages[-1])

    def keep(self) -> None:
        """Keep or reject the step; raise the flag where the driver is needed."""
        load, store, good = self.program.load, self.program.store, self.good
        if self.kernel.choice.dense:
            self._keep_stages()
        self._keep_state()
        before = [load(row) for row in (Row.V, Row.ACCELERATION, Row.SIGMA)]
        v, acceleration, sigma = (select(good, a, b) for a, b in zip(self.outputs, before, strict=True))
        for row, value in ((Row.V, v), (Row.ACCELERATION, acceleration), (Row.SIGMA, sigma)):
            store(row, value)
        moved = select(good, self.after, self.tau)
        store(Row.TAU, moved)
        store(Row.H, self.next_h)
        store(Row.GOOD, select(good, 1.0, 0.0))
        accepted, rejected = load(Row.ACCEPTED) + select(good, 1.0, 0.0), load(Row.REJECTED) + select(good, 0.0, 1.0)
        store(Row.ACCEPTED, accepted)
        store(Row.REJECTED, rejected)
        failures = select(good, 0.0, load(Row.FAILURES) + 1.0)
        store(Row.FAILURES, failures)
        gap = select(good, v - self.faster(self.here), load(Row.GAP))
        store(Row.GAP, gap)
        slipping, resting = select(gap > 0.0, 1.0, 0.0), select(abs(v) < load(Row.V_LOW), 1.0, 0.0)
        change, rounding = before[1] * self.h, 1e-10 * abs(v)  # a turn is more than rounding
        event = select((change > rounding) & (acceleration <= 0.0), 1.0, 0.0)
        event = event + select((change < -rounding) & (acceleration >= 0.0), 1.0, 0.0)
        event = event + (abs(slipping - load(Row.SLIPPING)) + abs(resting - load(Row.RESTING)))
        reasons = [
            moved >= self.end,
            accepted + rejected >= load(Row.MOST),
            failures >= MOST_FAILURES,
            abs(v) >= load(Row.V_HIGH),
            sigma <= load(Row.SIGMA_LOW),
            moved > load(Row.NEXT),
        ]
        flag = total([select(reason, 1.0, 0.0) for reason in reasons])
        flag = flag + load(Row.RECORD) * select(good, 1.0, 0.0)
        store(Row.FLAG, (flag + event * load(Row.WATCH)) * load(Row.ACTIVE))

    def _keep_state(self) -> None:
        layout, store, good = self.kernel.layout, self.program.store, self.good
        for i in range(self.kernel.size):
            store(layout.state + i, select(good, self.new[i], self.old[i]))
            store(layout.rate + i, select(good, self.rates[i], self.first[i]))
        store(Row.ERROR, select(good, self.size, self.earlier))
        if self.kernel.reduction.unknown is not None:
            store(Row.Z, select(good, self.z, self.program.load(Row.Z)))

    def _keep_stages(self) -> None:
        layout, n, load, store = self.kernel.layout, self.kernel.size, self.program.load, self.program.store
        for i in range(n):
            store(layout.old + i, self.old[i])
        for s, stage in enumerate(self.stages):
            for i in range(n):
                store(layout.stage + s * n + i, stage[i])
        for row, now in ((Row.V_OLD, Row.V), (Row.ACCELERATION_OLD, Row.ACCELERATION), (Row.SIGMA_OLD, Row.SIGMA)):
            store(row, load(now))
        store(Row.DONE, self.h)
        store(Row.TAU_OLD, self.tau)
