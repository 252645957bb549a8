"""What programs of a kernel have in common: the numbers of a record, and equations evaluated with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from steadyslip.kernels.events import EVENTS
from steadyslip.kernels.layout import Row
from steadyslip.kernels.nodes import Loop, Node, Program, Value, larger, primitive, select, smaller
from steadyslip.kernels.source import Formulas

if TYPE_CHECKING:
    from steadyslip.kernels.kernel import Kernel

CHANNELS = ("v", "q", "p")
NEWTON_STEPS = 6
Point = dict[str, Value]


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


def slope_of(coefficients: Sequence[Value]) -> list[Value]:
    """Coefficients of a polynomial's derivative."""
    return [coefficients[1], *(float(j) * c for j, c in enumerate(coefficients[2:], start=2))]


@dataclass(frozen=True)
class Moment:
    """What is `steadyslip.kernels.events.Observed` at one moment; what is not asked for is not computed."""

    record: Record
    point: Point
    v: Any
    acceleration: Any
    sigma: Any
    v_lp: Any
    v_low: Any
    sigma_low: Any
    h: Any

    @property
    def tau(self) -> Any:
        return self._output(3)

    @property
    def T(self) -> Any:  # noqa: N802 -- the theory's letter
        return self._output(4)

    def _output(self, place: int) -> Value:
        return self.record.kernel.outputs(self.record.constants | self.point | {"z": self.record.z})[place]


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

    def moment(self, point: Point, found: Sequence[Value], h: Value = 1.0) -> Moment:
        """What events are functions of, from the outputs v, acceleration and sigma at a point."""
        v, acceleration, sigma = found[:3]
        limits = {"v_low": self.program.load(Row.V_LOW), "sigma_low": self.program.load(Row.SIGMA_LOW)}
        return Moment(self, point, v, acceleration, sigma, v_lp=point["in_v"], h=h, **limits)

    def marks(self, moment: Moment) -> list[Value]:
        """Functions of all events."""
        return [event.function(moment) for event in EVENTS]
