"""The text of a kernel: the equations of one reduced Model in the step of one method, inside the driver.

State of all lanes lies in one flat array: quantity `row` of lane `l` is ``S[row*W + l]``. One pass of the
stepping loop advances every lane by one step of its own size; there is no branch and no call in it, so that it
becomes vector code. Everything rare (breakpoints, events, samples, the end) is done by the driver, lane by
lane. A single run is the same kernel with one lane.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files

import sympy as sp

from steadyslip.compiled.methods import METHODS, Method
from steadyslip.compiled.reduction import INPUTS, SLOPES, TIME, V_LP, Reduction
from steadyslip.compiled.source import Constants, Lines, indented, statements, weighted

LEVELS = ("constant", "linear", "harmonic")
CHANNELS = ("v", "q", "p")
OUTPUTS = ("v", "acceleration", "sigma", "tau", "T")
_SLOPE_NAMES = {s: f"slope_{c}" for s, c in zip(SLOPES[:3], CHANNELS, strict=True)}
_INPUT_NAMES = {s: f"in_{c}" for s, c in zip(INPUTS[:3], CHANNELS, strict=True)} | {TIME: "time"}
NEWTON_STEPS = 6
ABREAST = 3  # chains of operations that are interleaved, each a vector of lanes
PROPORTIONAL, INTEGRAL = 0.7, 0.4  # step control after Gustafsson, with the safety factor below:
# hardly any rejections, and an end error near rtol after tens of cycles
SLIP_EVENT = 2.0  # peak velocity of a slip event over that of the load point, at least: a block that sticks between
# slips, on a spring and constant friction, exceeds twice (see docs/explanation/motion.md)
TALLY_ROWS = 32
Where = Callable[[str, int], str]


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
    field : bool
        Whether the kernel can also be asked for rates at given states.
    """

    method: str
    level: str = "constant"
    harmonics: int = 0
    lanes: int = 1
    dense: bool = True
    field: bool = False


class KernelText:
    """Writes the source of one kernel."""

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
        self.rates = [self._fixed(rate) for rate in reduction.rates]
        self.driven = self._answers_to_constants()
        self.timed = choice.level != "constant" or any(rate.has(TIME) for rate in self.rates)
        self._blocks()
        self._rows()

    def _fixed(self, expression: sp.Expr) -> sp.Expr:
        """Lifted; slopes vanish where inputs are constant."""
        if self.choice.level == "constant":
            expression = expression.xreplace(dict.fromkeys(SLOPES[:3], sp.Integer(0)))
        return self.constants.lifted(expression)

    def _answers_to_constants(self) -> dict[int, sp.Expr]:
        """By position in the state: what a change of the constants adds to the rates of `Reduction.direction`."""
        reduction = self.reduction
        found = {
            reduction.state.index(symbol): self._change(self.rates[i], direction)
            for direction, symbols in enumerate(reduction.directions)
            for i, symbol in enumerate(symbols)
        }
        self.rates = [rate + found.get(k, 0) for k, rate in enumerate(self.rates)]
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

    # -- the equations as lines

    def _blocks(self) -> None:
        reduction = self.reduction
        outputs = [(f"o_{name}", self._fixed(reduction.outputs[name])) for name in OUTPUTS]
        rates = [(f"g{i}", rate) for i, rate in enumerate(self.rates)]
        solve = self._solve_lines()
        self.rate_lines = solve + statements(rates, self.names)
        self.full_lines = solve + statements(rates + outputs[:3], self.names)
        self.output_lines = solve + statements(outputs, self.names)
        n = self.size
        self.restore_lines = solve + statements(
            [(f"k{i}", self._fixed(e)) for i, e in enumerate(reduction.restored)], self.names
        )
        self.jacobian_lines: Lines = []
        self.pattern: Pattern = set()
        if self.method.implicit:
            matrix = reduction.jacobian()
            found = {(i, k): self._entry(matrix, i, k) for i in range(n) for k in range(n)}
            self.pattern = {place for place, entry in found.items() if entry != 0}
            entries = [(f"j{i}_{k}", found[i, k]) for i, k in sorted(self.pattern)]
            if self.timed:
                entries += [(f"ft{i}", self._fixed(e)) for i, e in enumerate(reduction.time_derivative())]
            self.jacobian_lines = statements(entries, self.names)
        self.restart_lines: Lines = []
        if reduction.restart is not None:
            w = sp.Symbol("w", real=True)
            known = {s: f"k{i}" for i, s in enumerate(reduction.continuous)} | {w: "w"} | _INPUT_NAMES | _SLOPE_NAMES
            pair = [("residual", reduction.restart), ("slope", sp.diff(reduction.restart, w))]
            self.restart_lines = statements([(n, self._fixed(e)) for n, e in pair], known)

    def _solve_lines(self) -> Lines:
        """Newton's method for the unknown, a fixed number of steps; the failure is NaN."""
        reduction = self.reduction
        if reduction.unknown is None:
            return []
        pair = [("residual", reduction.residual), ("slope", sp.diff(reduction.residual, reduction.unknown))]
        inner = statements([(n, self._fixed(e)) for n, e in pair], self.names)
        clamped = "change = min(max(residual/slope, -2.0), 2.0)"
        if str(reduction.unknown) == "a_x" or reduction.velocity == "linear":
            clamped = "change = residual/slope"
        return [
            f"for _ in range({NEWTON_STEPS}):",
            *("    " + line for line in inner),
            f"    {clamped}",
            "    z = z - change",
            "z = z if abs(change) <= 1e-7*abs(z) + 1e-9*abs(z_scale) else math.nan",
        ]

    # -- where things lie

    def _rows(self) -> None:
        n, choice = self.size, self.choice
        reduction = self.reduction
        groups = {
            "Y": n, "F": n, "OUT": 3, "GAP": 1, "CONTINUOUS": len(reduction.continuous), "Z": 1, "Z_SCALE": 1,
            "TAU": 1, "H": 1, "END": 1, "START": 1, "STOP": 1, "SEGMENT": 1, "ATOL": n, "RTOL": 1,
            "INPUT": 3, "SLOPE": 3, "AMPLITUDE": 3 * choice.harmonics, "OMEGA": 3 * choice.harmonics,
            "PHASE": 3 * choice.harmonics, "ACTIVE": 1, "FLAG": 1, "GOOD": 1, "ACCEPTED": 1, "REJECTED": 1,
            "FAILURES": 1, "ERROR": 1,
            "MOST": 1, "V_HIGH": 1, "V_LOW": 1, "SIGMA_LOW": 1, "WATCH": 1, "NEXT": 1, "RECORD": 1,
            "SETTLED": 1, "SAME": 1, "SLIPPING": 1, "RESTING": 1, "V_DRIVE": 1, "TALLY": TALLY_ROWS,
            **self._further_rows(),
            "CONSTANT": len(self.constants.all),
        }  # fmt: skip
        if choice.dense:
            groups |= {"OLD": n, "STAGE": n * self.method.stages, "DONE": 1, "TAU_OLD": 1, "OUT_OLD": 3}
        self.rows: dict[str, int] = {}
        position = 0
        for name, count in groups.items():
            self.rows[name] = position
            position += count
        self.row_count = position

    def _further_rows(self) -> dict[str, int]:
        return {}

    def cell(self, name: str, offset: int = 0) -> str:
        """Text of one quantity of lane l."""
        return f"S[{(self.rows[name] + offset) * self.choice.lanes} + l]"

    def entry(self, name: str, offset: int = 0) -> str:
        """Text of one quantity of the record of a lane."""
        return f"R[{self.rows[name] + offset}]"

    def _loads(self, names: list[tuple[str, str, int]], where: Where | None = None) -> Lines:
        return [f"{variable} = {(where or self.cell)(row, offset)}" for variable, row, offset in names]

    def _load_constants(self, where: Where | None = None) -> Lines:
        return self._loads(self._constant_rows(), where)

    def _constant_rows(self) -> list[tuple[str, str, int]]:
        """What every evaluation reads: variable, row, offset."""
        rows = [(str(s), "CONSTANT", i) for i, s in enumerate(self.constants.all)]
        rows += [(f"start_{c}", "INPUT", i) for i, c in enumerate(CHANNELS)]
        if self.choice.level != "constant":
            rows += [(f"rise_{c}", "SLOPE", i) for i, c in enumerate(CHANNELS)]
        for i, c in enumerate(CHANNELS):
            for h in range(self.choice.harmonics):
                k = i * self.choice.harmonics + h
                rows += [(f"amplitude_{c}{h}", "AMPLITUDE", k), (f"omega_{c}{h}", "OMEGA", k)]
                rows.append((f"phase_{c}{h}", "PHASE", k))
        if self._needs_clock():
            rows.append(("start", "START", 0))
        if self.reduction.unknown is not None:
            rows += [("z", "Z", 0), ("z_scale", "Z_SCALE", 0)]
        return rows

    def _needs_clock(self) -> bool:
        return bool(self.reduction.model.imposed != 0)

    def _inputs_at(self, moment: str) -> Lines:
        """Inputs and their slopes at local time `moment` of the segment."""
        level, lines = self.choice.level, []
        for c in CHANNELS:
            text = f"start_{c}" if level == "constant" else f"start_{c} + rise_{c}*({moment})"
            slope = f"rise_{c}"
            for h in range(self.choice.harmonics):
                angle = f"angle_{c}{h}"
                lines.append(f"{angle} = omega_{c}{h}*({moment}) + phase_{c}{h}")
                text += f" + amplitude_{c}{h}*sin({angle})"
                slope += f" + amplitude_{c}{h}*omega_{c}{h}*cos({angle})"
            lines.append(f"in_{c} = {text}")
            if level != "constant":
                lines.append(f"slope_{c} = {slope}")
        if self._needs_clock():
            lines.append(f"time = start + ({moment})")
        return lines

    # -- the step

    def step(self) -> Lines:
        """One step of one lane, from loading to the flag that asks for the driver's attention."""
        n, choice = self.size, self.choice
        lines = self._load_constants()
        lines += self._loads([(f"b{i}", "Y", i) for i in range(n)] + [(f"f{i}", "F", i) for i in range(n)])
        lines += self._loads([(f"atol{i}", "ATOL", i) for i in range(n)] + [("rtol", "RTOL", 0)])
        lines += self._loads([("tau", "TAU", 0), ("proposed", "H", 0), ("end", "END", 0)])
        lines += ["rest = end - tau", "last = proposed >= rest*0.99999999", "h = rest if last else proposed"]
        if not self.timed:
            lines += self._inputs_at("tau")
        lines += self._rosenbrock() if self.method.implicit else self._runge_kutta()
        lines.append("error = 0.0")
        for i in range(n):
            lines += [f"scaled = e{i}/(atol{i} + rtol*max(abs(b{i}), abs(y{i})))", "error += scaled*scaled"]
        lines += [
            f"error = error*{1 / self.counted!r}",
            "good = error <= 1.0",
            "size = log(min(max(error, 1e-10), 1e30))",
            f"earlier = {self.cell('ERROR')}",
            f"kept = {-0.5 * PROPORTIONAL / self.method.order!r}*size + {0.5 * INTEGRAL / self.method.order!r}*earlier",
            f"factor = 0.8*exp(kept if good else {-0.5 / self.method.order!r}*size)",
            "factor = min(max(factor, 0.2), 6.0) if error < 1e60 else 0.2",
            f"{self.cell('ERROR')} = size if good else earlier",
            "after = end if last else tau + h",
            "next_h = h*factor",
            "next_h = max(proposed, next_h) if last and good else next_h",
        ]
        if choice.dense:
            lines += [f"{self.cell('OLD', i)} = b{i}" for i in range(n)]
            lines += [f"{self.cell('STAGE', s * n + i)} = {self._stage(s, i)}" for s in range(self.method.stages)
                      for i in range(n)]  # fmt: skip
            lines += [f"{self.cell('OUT_OLD', i)} = {self.cell('OUT', i)}" for i in range(3)]
            lines += [f"{self.cell('DONE')} = h", f"{self.cell('TAU_OLD')} = tau"]
        lines += self._bookkeeping()
        return lines

    def _stage(self, s: int, i: int) -> str:
        if self.method.implicit:
            return f"u{s}_{i}"
        return f"f{i}" if s == 0 else f"k{s}_{i}"

    def _at_stage(self, s: int) -> Lines:
        return self._inputs_at(f"tau + {self.method.nodes[s]!r}*h") if self.timed else []

    def _runge_kutta(self) -> Lines:
        method, n, lines = self.method, self.size, []
        stage = [[self._stage(s, i) for s in range(method.stages)] for i in range(n)]
        for s in range(1, method.stages):
            lines += [f"y{i} = b{i} + h*({weighted(method.a[s], stage[i])})" for i in range(n)]
            lines += self._at_stage(s)
            lines += self.full_lines if s == method.stages - 1 else self.rate_lines
            lines += [f"k{s}_{i} = g{i}" for i in range(n)]
        return lines + [f"e{i} = h*({weighted(method.error, stage[i])})" for i in range(n)]

    def _rosenbrock(self) -> Lines:
        method, n, lines = self.method, self.size, []
        lines += [f"y{i} = b{i}" for i in range(n)]
        if self.timed:
            lines += self._inputs_at("tau")
        lines += self.jacobian_lines
        lines += ["inverse = 1.0/h", f"diagonal = inverse*{1 / method.gamma!r}"]
        factors, filled = _factorised(n, self.pattern)
        lines += factors
        arguments = method.arguments()
        for s in range(method.stages):
            if s:
                for i in range(n):
                    terms = [f"u{k}_{i}" for k in range(s)]
                    if s < len(method.a):
                        lines.append(f"y{i} = b{i} + {weighted(arguments[s], terms)}")
                    else:
                        lines.append(f"y{i} = y{i} + u{s - 1}_{i}")
                lines += self._at_stage(s)
                lines += self.rate_lines
            for i in range(n):
                right = f"g{i}" if s else f"f{i}"
                if s and any(method.c[s]):
                    right += f" + inverse*({weighted(method.c[s], [f'u{k}_{i}' for k in range(s)])})"
                if self.timed and abs(method.time_weights[s]) > 1e-12:
                    right += f" + h*{method.time_weights[s]!r}*ft{i}"
                lines.append(f"r{i} = {right}")
            lines += _substituted(n, s, filled)
        lines += [f"y{i} = y{i} + u{method.stages - 1}_{i}" for i in range(n)]
        lines += [f"e{i} = u{method.stages - 1}_{i}" for i in range(n)]
        if self.timed:
            lines += self._inputs_at("tau + h")
        return lines + self.full_lines

    def _bookkeeping(self) -> Lines:
        """Keep or reject the step; raise the flag where the driver is needed."""
        n, cell = self.size, self.cell
        lines = [f"{cell('Y', i)} = y{i} if good else b{i}" for i in range(n)]
        lines += [f"{cell('F', i)} = g{i} if good else f{i}" for i in range(n)]
        outputs = ("o_v", "o_acceleration", "o_sigma")
        lines += [f"before{i} = {cell('OUT', i)}" for i in range(3)]
        lines += [f"now{i} = {name} if good else before{i}" for i, name in enumerate(outputs)]
        lines += [f"{cell('OUT', i)} = now{i}" for i in range(3)]
        if self.reduction.unknown is not None:
            lines.append(f"{cell('Z')} = z if good else {cell('Z')}")
        lines += [
            "moved = after if good else tau",
            f"{cell('TAU')} = moved",
            f"{cell('H')} = next_h",
            f"{cell('GOOD')} = 1.0 if good else 0.0",
            f"{cell('ACCEPTED')} += 1.0 if good else 0.0",
            f"{cell('REJECTED')} += 0.0 if good else 1.0",
            f"failures = 0.0 if good else {cell('FAILURES')} + 1.0",
            f"{cell('FAILURES')} = failures",
            f"gap = now0 - max(1.000001*in_v, {cell('V_LOW')}) if good else {cell('GAP')}",
            f"{cell('GAP')} = gap",
            "slipping = 1.0 if gap > 0.0 else 0.0",
            f"resting = 1.0 if abs(now0) < {cell('V_LOW')} else 0.0",
            "turn = 1.0 if before1*h > 1e-10*abs(now0) and now1 <= 0.0 else 0.0",  # more than rounding
            "event = turn + (1.0 if before1*h < -1e-10*abs(now0) and now1 >= 0.0 else 0.0)",
            f"event += abs(slipping - {cell('SLIPPING')}) + abs(resting - {cell('RESTING')})",
            f"event = event*{cell('WATCH')}",
            "flag = 1.0 if moved >= end else 0.0",
            f"flag += 1.0 if {cell('ACCEPTED')} + {cell('REJECTED')} >= {cell('MOST')} else 0.0",
            "flag += 1.0 if failures >= 40.0 else 0.0",
            f"flag += 1.0 if abs(now0) >= {cell('V_HIGH')} else 0.0",
            f"flag += 1.0 if now2 <= {cell('SIGMA_LOW')} else 0.0",
            f"flag += 1.0 if moved > {cell('NEXT')} else 0.0",
            f"flag += {cell('RECORD')}*(1.0 if good else 0.0)",
            f"{cell('FLAG')} = (flag + event)*{cell('ACTIVE')}",
        ]
        return lines

    # -- functions for the driver

    def functions(self) -> str:
        """Scalar functions of one lane that the driver calls."""
        n, load = self.size, self._load_constants(self.entry)
        from_rows = self._loads([(f"y{i}", "Y", i) for i in range(n)] + [("tau", "TAU", 0)], self.entry)
        rates = [*load, *from_rows, *self._inputs_at("tau"), *self.full_lines]
        rates += [f"{self.entry('F', i)} = g{i}" for i in range(n)]
        rates += [f"{self.entry('OUT', i)} = o_{name}" for i, name in enumerate(OUTPUTS[:3])]
        rates.append(f"{self.entry('GAP')} = o_v - max(1.000001*in_v, {self.entry('V_LOW')})")
        outputs = [*load, *(f"y{i} = y[{i}]" for i in range(n)), *self._inputs_at("tau"), *self.output_lines]
        outputs += [f"out[{i}] = o_{name}" for i, name in enumerate(OUTPUTS)] + ["out[5] = in_v"]
        restore = [*load, *from_rows, *self._inputs_at("tau"), *self.restore_lines]
        restore += [f"{self.entry('CONTINUOUS', i)} = k{i}" for i in range(len(self.reduction.continuous))]
        if self.reduction.unknown is not None:
            rates.append(f"{self.entry('Z')} = z")
        text = _function("rates_at(R)", rates) + _function("outputs_at(R, tau, y, out)", outputs)
        text += _function("restore_at(R)", restore)
        text += self._residual_function() + self._state_function()
        return text + _function("dense_at(R, theta, y)", self._dense())

    def _residual_function(self) -> str:
        """The balance as a function of w after a jump; without one, velocity simply continues."""
        if not self.restart_lines:
            return _function("balance_at(R, w)", ["return 0.0, 1.0"])
        continuous = [(f"k{i}", "CONTINUOUS", i) for i in range(len(self.reduction.continuous))]
        lines = [
            *self._load_constants(self.entry),
            *self._loads(continuous, self.entry),
            "tau = 0.0",
            *self._inputs_at("tau"),
        ]
        return _function("balance_at(R, w)", [*lines, *self.restart_lines, "return residual, slope"])

    def _state_function(self) -> str:
        """Y from the continuous variables and w."""
        reduction, lines = self.reduction, []
        for i, symbol in enumerate(reduction.state):
            if symbol in reduction.continuous:
                source = self.entry("CONTINUOUS", reduction.continuous.index(symbol))
            else:
                source = "w"
            lines.append(f"{self.entry('Y', i)} = {source}")
        if reduction.unknown is not None and str(reduction.unknown) == "w":
            lines.append(f"{self.entry('Z')} = w")
        return _function("place_at(R, w)", lines)

    def _dense(self) -> Lines:
        method, n = self.method, self.size
        if not self.choice.dense:
            return ["pass"]
        stage = [[self.entry("STAGE", s * n + i) for s in range(method.stages)] for i in range(n)]
        lines: Lines = []
        if not method.implicit:
            for s, polynomial in enumerate(method.dense):
                text = "0.0"
                for weight in reversed(polynomial):
                    text = f"({weight!r} + theta*{text})"
                lines.append(f"weight{s} = theta*{text}")
            weights = [f"weight{s}" for s in range(method.stages)]
            for i in range(n):
                terms = " + ".join(f"{w}*{k}" for w, k in zip(weights, stage[i], strict=True))
                lines.append(f"y[{i}] = {self.entry('OLD', i)} + {self.entry('DONE')}*({terms})")
            return lines
        last = method.arguments()[method.stages]
        for i in range(n):
            text = "0.0"
            for row in reversed(method.dense):
                text = f"({weighted(row, stage[i])} + theta*{text})"
            change = weighted(last, stage[i])
            lines.append(f"y[{i}] = {self.entry('OLD', i)} + theta*({change} + (1.0 - theta)*{text})")
        return lines

    def text(self) -> str:
        """The whole kernel, to be compiled behind the primitives and a preamble."""
        header: dict[str, float] = {f"ROW_{name}": row for name, row in self.rows.items()}
        for name in ("OLD", "STAGE", "DONE", "TAU_OLD", "OUT_OLD"):
            header.setdefault(f"ROW_{name}", 0)  # named by the driver, not used without dense output
        header |= {"W": self.choice.lanes, "N": self.size, "ROWS": self.row_count, "DENSE": self.choice.dense}
        header |= {"TALLY_ROWS": TALLY_ROWS, "SLIP_EVENT": SLIP_EVENT}
        header |= {"NC": len(self.constants.all), "NK": len(self.reduction.continuous)}
        header |= {"HARMONICS": self.choice.harmonics, "MASSLESS": self.reduction.restart is not None}
        header["STATE_W"] = self.reduction.names.index("w") if "w" in self.reduction.names else -1
        header["IMPLICIT"] = header["MASSLESS"] and self.reduction.unknown is not None
        constants = "".join(f"{name} = {value!r}\n" for name, value in header.items())
        parts = ["driver.py", "field.py"] if self.choice.field else ["driver.py"]
        driver = "\n\n".join(files("steadyslip.compiled").joinpath(p).read_text(encoding="utf-8") for p in parts)
        step, count = self.step(), "W"
        if self.choice.lanes > 1 and not any(line.startswith("for ") for line in step):
            step, count = _abreast(step, self.choice.lanes // ABREAST, ABREAST), f"W // {ABREAST}"
        loop = f"\n\n@njit(**FLAT)\ndef step_lanes(S):\n    for l in range({count}):\n" + indented(step, 2)
        return constants + self.functions() + loop + "\n\n" + driver


def _function(signature: str, lines: Lines) -> str:
    return f"\n\n@njit(**PLAIN)\ndef {signature}:\n" + indented(lines, 1)


def _abreast(lines: Lines, apart: int, count: int) -> Lines:
    """The same statements for lanes l, l + apart, l + 2 apart, ..., line by line.

    One chain of dependent operations leaves a processor idle for most of the time; several fill its gaps
    (measured: two take 1.6 to 1.9 times less time for each lane, three up to 2.4 times, four no less).
    """
    assigned = {match[1] for line in lines if (match := re.match(r"(\w+) \+?= ", line))}
    names = re.compile(rf"\b({'|'.join(sorted(assigned))})\b")

    def moved(line: str, by: int) -> str:
        return re.sub(r"S\[(\d+) \+ l\]", lambda match: f"S[{int(match[1]) + by} + l]", line)

    return [names.sub(rf"\1{'_' * c}", moved(line, c * apart)) for line in lines for c in range(count)]


Pattern = set[tuple[int, int]]


def _factorised(n: int, pattern: Pattern) -> tuple[Lines, Pattern]:
    """LU factors of W = 1/(hγ) − J without pivoting (the diagonal dominates once h is accepted), and where they are.

    Entries that are zero whatever the numbers are left out: those of J outside `pattern`, and what follows from them.
    """
    filled = pattern | {(i, i) for i in range(n)}
    lines = []
    for i, k in sorted(filled):
        parts = (["diagonal"] if i == k else []) + ([f"j{i}_{k}"] if (i, k) in pattern else [])
        lines.append(f"w{i}_{k} = {' - '.join(parts) if i == k else '-' + parts[0]}")
    for k in range(n):
        lines.append(f"p{k} = 1.0/w{k}_{k}")
        for i in range(k + 1, n):
            if (i, k) not in filled:
                continue
            lines.append(f"w{i}_{k} = w{i}_{k}*p{k}")
            for c in range(k + 1, n):
                if (k, c) in filled:
                    before = f"w{i}_{c}" if (i, c) in filled else ""
                    lines.append(f"w{i}_{c} = {before} - w{i}_{k}*w{k}_{c}")
                    filled.add((i, c))
    return lines, filled


def _substituted(n: int, s: int, filled: Pattern) -> Lines:
    """Solve for stage s from r."""
    lines = []
    for i in range(1, n):
        lines += [f"r{i} = r{i} - w{i}_{k}*r{k}" for k in range(i) if (i, k) in filled]
    for i in reversed(range(n)):
        known = "".join(f" - w{i}_{k}*u{s}_{k}" for k in range(i + 1, n) if (i, k) in filled)
        lines.append(f"u{s}_{i} = (r{i}{known})*p{i}")
    return lines
