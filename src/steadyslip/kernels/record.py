"""Evaluation of a Model's equations within a program, with values loaded from a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import cycle, pairwise

from steadyslip.kernels.driver.places import earlier_at, guess_at, scale_at
from steadyslip.kernels.events import EVENTS, Observed
from steadyslip.kernels.formulation import OUTPUTS, Formulation
from steadyslip.kernels.layout import Row
from steadyslip.kernels.newton import solved
from steadyslip.kernels.nodes import Node, Program, Value, as_node, cos, sin, weighted
from steadyslip.kernels.source import Formulas
from steadyslip.protocol.inputs import integral_to, level_at, slope_at

Values = dict[str, Value]


def times(value: Value, share: Value) -> Value:
    """Product share * value; the value itself if the share is the number 1."""
    return value if not isinstance(share, Node) and share == 1 else share * value


def horner(coefficients: Sequence[Value], x: Node) -> Value:
    """Polynomial at x, lowest coefficient first, by Horner's rule."""
    value: Value = 0.0
    for coefficient in reversed(coefficients):
        value = coefficient + x * value
    return value


def total(terms: Sequence[Value]) -> Value:
    """Sum of terms, added from left to right."""
    value = terms[0]
    for term in terms[1:]:
        value = value + term
    return value


def slope_of(coefficients: Sequence[Value]) -> list[Value]:
    """Coefficients of a polynomial's derivative."""
    return [coefficients[1], *(float(j) * c for j, c in enumerate(coefficients[2:], start=2))]


class Evaluator:
    """Nodes of one program for the quantities of a record: constants, inputs, unknowns, dense output."""

    def __init__(self, kernel: Formulation, program: Program, extended: bool = False) -> None:
        self.kernel, self.program = kernel, program
        self.extended = extended  # dense output of the last step is stored as polynomials
        self._polynomials: dict[int, list[Value]] = {}
        layout, load = kernel.layout, program.load
        self.constants: Values = {s.name: load(layout.constant + i) for i, s in enumerate(kernel.constants.all)}
        count = range(kernel.unknowns)
        self.z: list[Value] = [load(guess_at(layout, k)) for k in count]
        self.scales: list[Value] = [load(scale_at(layout, k)) for k in count]

    def inputs(self, moment: Value) -> Values:
        """Inputs and their slopes at a time in the segment, by name."""
        load, found, constant = self.program.load, {}, self.kernel.choice.level == "constant"
        layout = self.kernel.layout
        for i in range(layout.inputs):
            value, slope, waves = load(layout.level + i), load(layout.slope + i), self._waves(i)
            found[f"in{i}"] = value if constant else level_at(moment, value, slope, waves, sin)
            if not constant:
                found[f"slope{i}"] = slope_at(moment, slope, waves, cos)
        if self.kernel.reduction.model.imposed:
            found["time"] = load(Row.START) + moment
        return found

    def _waves(self, channel: int) -> list[tuple[Node, Node, Node]]:
        count, layout, load = self.kernel.choice.harmonics, self.kernel.layout, self.program.load
        groups = (layout.amplitude, layout.omega, layout.phase)
        places = range(channel * count, (channel + 1) * count)
        return [(load(groups[0] + i), load(groups[1] + i), load(groups[2] + i)) for i in places]

    def load_advance(self, moment: Value) -> Value:
        """Displacement of the load point from the start of the segment to a time in it."""
        load, layout = self.program.load, self.kernel.layout
        moved: Value = integral_to(moment, load(layout.level), load(layout.slope), self._waves(0), cos)
        return moved

    def state(self) -> list[Node]:
        """Nodes that load the state from the record."""
        return [self.program.load(self.kernel.layout.state + i) for i in range(self.kernel.size)]

    def point(self, moment: Value) -> Values:
        """State of the record, and inputs at a time in the segment, by name."""
        return self.inputs(moment) | {f"y{i}": y for i, y in enumerate(self.state())}

    def evaluated(self, formulas: Formulas, point: Values, found: bool = False) -> list[Value]:
        """Values of formulas at a point; the unknowns are solved for at this point first, unless `found`."""
        given = self.constants | point
        if self.z and not found:
            self.z = solved(self.kernel, given, self.z, self.scales)
        return formulas(given | self.kernel.named(self.z))

    def store_unknowns(self) -> None:
        """Append instructions that store the unknowns as guesses for the next evaluation."""
        for k, z in enumerate(self.z):
            self.program.store(guess_at(self.kernel.layout, k), z)

    # -- the last step

    @cached_property
    def stages(self) -> list[list[Value]]:
        """Stages of the last step, [stage][variable]: loaded, or computed if only dense output needs them."""
        kernel, method, load, n = self.kernel, self.kernel.method, self.program.load, self.kernel.size
        place = [[kernel.layout.stage + s * n + i for i in range(n)] for s in range(method.stages)]
        found: list[list[Value]] = [[load(row) for row in rows] for rows in place]
        h = load(Row.STEP_SIZE)
        old = [load(kernel.layout.state_old + i) for i in range(n)]
        for s in range(method.stages, method.all_stages):
            y = [old[i] + h * weighted(method.a[s], [k[i] for k in found]) for i in range(n)]
            point = self.inputs(load(Row.TAU_OLD) + method.nodes[s] * h)
            found.append(self.evaluated(kernel.rates, point | {f"y{i}": value for i, value in enumerate(y)}))
        return found

    def polynomial(self, i: int) -> list[Value]:
        """Dense output of state variable i: coefficients of powers of the fraction of the last step (cached)."""
        if i not in self._polynomials:
            self._polynomials[i] = self._polynomial(i)
        return self._polynomials[i]

    def _polynomial(self, i: int) -> list[Value]:
        method, load = self.kernel.method, self.program.load
        if self.extended:
            return [load(self.kernel.layout.polynomial + i * self.kernel.terms + j) for j in range(self.kernel.terms)]
        old, stages = load(self.kernel.layout.state_old + i), [stage[i] for stage in self.stages]
        if not method.implicit:
            h, columns = load(Row.STEP_SIZE), zip(*method.dense, strict=True)
            return [old, *(h * weighted(column, stages) for column in columns)]
        change = weighted(method.arguments()[method.stages], stages)
        inner = [weighted(row, stages) for row in method.dense]  # coefficients of the polynomial in θ (1 − θ) inner(θ)
        return [old, change + inner[0], *(after - now for now, after in pairwise(inner)), -inner[-1]]

    def smooth_polynomial(self, i: int) -> list[Value]:
        """Dense output of variable i, for Rosenbrock methods corrected to have the exact rates at both ends."""
        found = list(self.polynomial(i))
        if not self.kernel.method.implicit:
            return found
        h = self.program.load(Row.STEP_SIZE)
        first = h * self.program.load(Row.W_RATE_OLD) - found[1]
        last = h * self.settled_rate(i) - total(slope_of(found))
        found[1] = found[1] + first
        found[2] = found[2] - (2.0 * first + last)
        found[3] = found[3] + (first + last)
        return found

    def rate_error(self, i: int) -> Value:
        """Error of the rate of variable i at the end of the last step; 0 if velocities do not depend on it."""
        moving = self.kernel.moving
        return self.program.load(self.kernel.layout.rate_error + moving.index(i)) if i in moving else 0.0

    def settled_rate(self, i: int) -> Value:
        """Rate of variable i at the end of the last step without its error."""
        rate = self.program.load(self.kernel.layout.rate + i)
        return rate - self.rate_error(i) if i in self.kernel.moving else rate

    def state_at_fraction(self, theta: Node) -> list[Value]:
        """State at a fraction of the last step."""
        return [horner(self.polynomial(i), theta) for i in range(self.kernel.size)]

    def store_polynomials(self) -> None:
        """Append instructions that store the polynomials of the last step's dense output."""
        for i in range(self.kernel.size):
            for j, coefficient in enumerate(self.polynomial(i)):
                self.program.store(self.kernel.layout.polynomial + i * self.kernel.terms + j, coefficient)
        self.program.store(Row.EXTENDED, 1.0)

    def guesses_at_fraction(self, theta: Node) -> list[Value]:
        """Guesses of the unknowns at a fraction of the last step, by linear interpolation."""
        found: list[Value] = []
        for k in range(self.kernel.unknowns):
            old = self.program.load(earlier_at(self.kernel.layout, k))
            found.append(old + theta * (self.program.load(guess_at(self.kernel.layout, k)) - old))
        return found

    # -- events

    def shares(self, contact: int) -> list[Value]:
        """Ratios for a contact in steady sliding: slip rate over the drive's, slip rate and σ over the first
        contact's."""
        return self.kernel.shares(self.constants)[3 * contact : 3 * contact + 3]

    def moment(self, point: Values, found: Sequence[Value], h: Value = 1.0, contact: int = 0) -> Observed:
        """Arguments of the event functions of a contact, from its outputs `found` (v, acceleration, σ) at a point."""
        v, acceleration, sigma = found[:3]
        ratio, share, pressed = self.shares(contact)

        def outputs() -> Sequence[Value]:
            every = self.kernel.outputs(self.constants | point | self.kernel.named(self.z))
            return every[len(OUTPUTS) * contact :]

        limits = {
            "v_lp": times(point["in0"], ratio),
            "v_low": times(self.program.load(Row.V_LOW), share),
            "sigma_low": times(self.program.load(Row.SIGMA_LOW), pressed),
        }
        return Observed(contact, v, acceleration, sigma, h=h, outputs=outputs, **limits)

    def moments(
        self, point: Values, found: Sequence[Value], h: Value = 1.0, rates: Sequence[Value] = ()
    ) -> list[Observed]:
        """Arguments of the event functions of all contacts; accelerations follow from the state's `rates` if given."""
        each = len(found) // self.kernel.contacts
        moments = [self.moment(point, found[c * each :], h, c) for c in range(self.kernel.contacts)]
        if not (rates and self.kernel.moving):
            return moments
        given = point | {s.name: rate for s, rate in zip(self.kernel.rated, rates, strict=True)}
        accelerations = self.evaluated(self.kernel.accelerations, given, found=True)
        return [replace(one, acceleration=value) for one, value in zip(moments, accelerations, strict=True)]

    def further_contact_rows(self, found: Sequence[Value]) -> list[tuple[int, Value]]:
        """Pairs (row, value) to store for further contacts, from v, acceleration and σ of all contacts."""
        stored: list[tuple[int, Value]] = []
        for c in range(1, self.kernel.contacts):
            v, _, sigma = found[3 * c : 3 * c + 3]
            _, share, pressed = self.shares(c)
            first = self.kernel.layout.further_contact + 3 * (c - 1)
            stored += [(first, v), (first + 1, sigma / as_node(pressed)), (first + 2, v / as_node(share))]
        return stored

    def event_values(self, moments: Sequence[Observed]) -> list[Value]:
        """Values of all event functions, contact by contact.

        Raises
        ------
        TypeError
            If an event function returns a condition instead of a number.
        """
        found = [event.function(moment) for moment in moments for event in EVENTS]
        for event, value in zip(cycle(EVENTS), found, strict=False):
            if isinstance(value, bool) or (isinstance(value, Node) and value.kind == "bool"):
                raise TypeError(
                    f"event {event.name!r}: its function returns a condition; it must return a number that changes "
                    "sign, such as the difference of the two sides of a comparison"
                )
        return found
