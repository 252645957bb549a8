"""The text of a kernel that takes all lanes through one table of inputs together, with sensitivities.

Measured histories have a breakpoint at every sample. Lanes that each looked after their own breakpoints would spend
most of their time there; lanes that share the samples of one record need not: they enter every row of the table
together, each takes as many steps of its own size as it needs, and all wait for the last. What is observed and its
derivatives in several directions are written down at every sample.
"""

from __future__ import annotations

from importlib.resources import files

import sympy as sp

from steadyslip.compiled.kernel import CHANNELS, Choice, KernelText
from steadyslip.compiled.reduction import V_LP, P, Q, Reduction
from steadyslip.compiled.source import Lines, indented, statements
from steadyslip.errors import InternalError


class LockstepText(KernelText):
    """Writes the source of one such kernel.

    Parameters
    ----------
    reduction : Reduction
        From `with_directions`, massless models in the form *explicit* or *implicit*: the state is continuous.
    choice : Choice
        Of level ``linear``, not dense.
    observed : sympy.Expr
        What is written down, in terms of state, unknown and inputs.
    """

    varied_inputs = (V_LP, Q, P)

    def __init__(self, reduction: Reduction, choice: Choice, observed: sp.Expr) -> None:
        self.observed = observed
        self.own = len(reduction.state) // (1 + len(reduction.directions))
        super().__init__(reduction, choice)

    def _blocks(self) -> None:
        self.counted = self.own  # sensitivities have tolerances of their own, and are not diluted by each other
        super()._blocks()
        self.full_lines = self.rate_lines
        expression = self._fixed(self.observed)
        wanted = [("seen0", expression)]
        for direction, column in enumerate(self.reduction.directions):
            total = self._change(expression, direction)
            for variable, change in zip(self.reduction.state[: self.own], column, strict=True):
                total += self._fixed(self.reduction.derivative(self.observed, variable)) * change
            wanted.append((f"seen{direction + 1}", total))
        self.seen_lines = self._solve_lines() + statements(wanted, self.names)

    def _further_rows(self) -> dict[str, int]:
        return {"SEEN": 1 + len(self.reduction.directions), "BEFORE": self.own}

    def _bookkeeping(self) -> Lines:
        """Keep or reject the step; a lane that has arrived stays as it is."""
        cell = self.cell
        lines = [f"{cell('Y', i)} = y{i} if good else b{i}" for i in range(self.size)]
        lines += [f"{cell('F', i)} = g{i} if good else f{i}" for i in range(self.size)]
        if self.reduction.unknown is not None:
            lines.append(f"{cell('Z')} = z if good else {cell('Z')}")
        return [
            *lines,
            "moves = 1.0 if rest > 0.0 else 0.0",
            f"{cell('ERROR')} = size if good and rest > 0.0 else earlier",
            f"{cell('TAU')} = after if good else tau",
            f"{cell('H')} = next_h",
            f"{cell('ACCEPTED')} += moves if good else 0.0",
            f"{cell('REJECTED')} += 0.0 if good else moves",
            f"{cell('FAILURES')} = 0.0 if good else {cell('FAILURES')} + 1.0",
        ]

    def _lanes(self, name: str, lines: Lines) -> str:
        load = self._load_constants() + self._loads([(f"y{i}", "Y", i) for i in range(self.size)] + [("tau", "TAU", 0)])
        body = [*load, *self._inputs_at("tau"), *lines]
        return f"\n\n@njit(**FLAT)\ndef {name}(S):\n    for l in range(W):\n" + indented(body, 2)

    def text(self) -> str:
        """The whole kernel, to be compiled behind the primitives and a preamble."""
        header = {f"ROW_{name}": row for name, row in self.rows.items()}
        directions = len(self.reduction.directions)
        header |= {"W": self.choice.lanes, "N": self.size, "OWN": self.own, "DIRECTIONS": directions}
        header |= {"ROWS": self.row_count, "NC": len(self.constants.all)}
        header |= {"POSITION": self.reduction.names.index("x")}
        constants = "".join(f"{name} = {value!r}\n" for name, value in header.items())
        constants += f"INPUT_RATES = {self._input_rates()!r}\n"
        rates = [*self.rate_lines, *(f"{self.cell('F', i)} = g{i}" for i in range(self.size))]
        if self.reduction.unknown is not None:
            rates.append(f"{self.cell('Z')} = z")
        seen = [*self.seen_lines, *(f"{self.cell('SEEN', i)} = seen{i}" for i in range(1 + directions))]
        step = "\n\n@njit(**FLAT)\ndef step_lanes(S):\n    for l in range(W):\n" + indented(self.step(), 2)
        driver = files("steadyslip.compiled").joinpath("lockstep_driver.py").read_text(encoding="utf-8")
        return constants + self._lanes("rates_lanes", rates) + self._lanes("see_lanes", seen) + step + "\n\n" + driver

    def _input_rates(self) -> tuple[int, ...]:
        """Where the rates of change of the inputs lie among the constants, direction by direction; -1 if nowhere."""
        order = {pair: len(self.constants.symbols) + i for i, pair in enumerate(self.constants.rates)}
        directions = range(len(self.reduction.directions))
        if len(CHANNELS) != len(self.varied_inputs):
            raise InternalError("len(CHANNELS) == len(self.varied_inputs)")
        return tuple(order.get((c, d), -1) for d in directions for c in self.varied_inputs) or (-1,)
