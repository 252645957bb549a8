"""Program that finds frequent events in a group of lanes at once and updates their statistics, if no log is kept.

Extremes of velocity, and begin and end of slip, are roots of the velocity variable's dense output or of its derivative.
In other cases a lane keeps its flag, and the driver finds the events: lost contact, several events within a step, the
end of fast slip, backward slip, begin or end of slip while inputs change, a root that is not found in `ROUNDS`
iterations.
"""

from __future__ import annotations

from steadyslip.kernels.formulation import Formulation
from steadyslip.kernels.layout import SLIP_EVENT, EventPlace, Out, Row
from steadyslip.kernels.nodes import Node, Program, Value, as_node, larger, log, select, smaller
from steadyslip.kernels.record import Evaluator, horner, slope_of
from steadyslip.kernels.source import Formulas

ROUNDS = 2  # iterations of Halley's method (cubic convergence), started at the root of the secant
FOUND = 3e-4  # a root is found if its last change is smaller, as share of the step; its error is then near 3e-11


class Watch(Evaluator):
    """Program ``watch_group`` of a kernel; `speed` gives the velocity from the velocity variable."""

    def __init__(self, kernel: Formulation, speed: Formulas) -> None:
        super().__init__(kernel, Program("watch_group"))
        self.speed = speed
        load, layout = self.program.load, kernel.layout
        slip, turn = load(layout.sign_change + EventPlace.SLIP), load(layout.sign_change + EventPlace.TURN)
        self.begins, self.ends = slip > 0.0, slip < 0.0
        self.peak, self.trough = turn < 0.0, turn > 0.0
        self.turns = self.peak | self.trough
        self.tau_old, self.h = load(Row.TAU_OLD), load(Row.STEP_SIZE)
        self.now_from, self.now_event = load(Row.NOW_FROM), load(Row.NOW_EVENT)

    def write(self) -> Program:
        """Write the program and return it."""
        load, store, layout = self.program.load, self.program.store, self.kernel.layout
        self._locate()
        count = load(Row.EVENT_COUNT)
        left = (
            (load(layout.sign_change + EventPlace.CONTACT) < 0.0)
            | (self.turns & (self.begins | self.ends))
            | (self.ends & (self.now_event > 0.0))
            | (abs(load(layout.sign_change + EventPlace.BACKWARD)) > 0.0)
            | ((load(Row.NOW_SIGN) < 0.0) & (self.now_from < float("inf")))
            | ~self.found
        )
        if self.kernel.choice.level != "constant":
            left = left | self.begins | self.ends
        self.here = (count > 0.0) & ~left
        store(Row.EVENT_COUNT, select(self.here, 0.0, count))
        self._turn()
        self._slip()
        store(Row.FLAG, load(Row.FLAG) - select(self.here, 1.0, 0.0))
        return self.program

    def _locate(self) -> None:
        """Append instructions that find the root: the fraction of the step at which velocity has an extreme, or slip
        begins or ends."""
        kernel, program, w = self.kernel, self.program, self.kernel.layout.w
        own, smooth_polynomial = self.polynomial(w), self.smooth_polynomial(w)
        limit = program.load(Row.W_LIMIT)
        crossing: list[Value] = [own[0] - limit, *own[1:]]
        turning = slope_of(smooth_polynomial)
        turning += [0.0] * (len(crossing) - len(turning))
        crossing += [0.0] * (len(turning) - len(crossing))
        wanted = [select(self.turns, a, b) for a, b in zip(turning, crossing, strict=True)]
        rates = program.load(Row.W_RATE_OLD), self.settled_rate(w)
        first = select(self.turns, self.h * rates[0], own[0] - limit)
        last = select(self.turns, self.h * rates[1], program.load(kernel.layout.state + w) - limit)
        theta: Node = first / (first - last)
        change: Node = theta
        slopes = slope_of(wanted)
        bends = slope_of(slopes)
        for _ in range(ROUNDS):
            value, slope, bend = (as_node(horner(c, theta)) for c in (wanted, slopes, bends))
            change = 2.0 * value * slope / (2.0 * slope * slope - value * bend)
            theta = smaller(larger(theta - change, 0.0), 1.0)
        self.found = abs(change) <= FOUND
        self.tau = self.tau_old + theta * self.h
        self.there = self.state_at_fraction(theta)
        start, stop = program.load(Row.START), program.load(Row.STOP)
        self.time = select(self.tau < program.load(Row.LENGTH), smaller(start + self.tau, stop), stop)
        point = self.inputs(self.tau) | {f"y{i}": y for i, y in enumerate(self.there)}
        self.v, self.v_lp = self.speed(self.constants | point)[0], point["in0"]
        self.stress = kernel.outputs(self.constants | point)[Out.T]
        self.place = self.there[kernel.layout.x] + program.load(Row.LOAD_MOVED) + self.load_advance(self.tau)

    def _kept(self, row: int, condition: Node, value: Value) -> Node:
        """Append an instruction that stores a value in a row where a condition is true; returns the row's new value."""
        new: Node = select(condition, value, self.program.load(row))
        self.program.store(row, new)
        return new

    def _turn(self) -> None:
        """Append instructions that update the statistics of peaks and troughs of velocity."""
        load = self.program.load
        peak = self.here & self.peak
        self._kept(Row.PEAK_VELOCITY, peak, larger(load(Row.PEAK_VELOCITY), self.v))
        self._kept(Row.LOWEST_VELOCITY, self.here & self.trough, smaller(load(Row.LOWEST_VELOCITY), self.v))
        size = self._size()
        last, before = load(Row.LAST_PEAK_TIME), load(Row.PEAK_SIZE)
        again = peak & (last >= 0.0)
        self._kept(Row.PEAK_PERIOD, again, self.time - last)
        self._kept(Row.PEAK_GROWTH, again, abs(size) - abs(before))
        self._kept(Row.PEAK_SIZE, peak, size)
        self._kept(Row.LAST_PEAK_TIME, peak, self.time)

    def _size(self) -> Node:
        """ln of the ratio of velocity to load-point velocity; infinite if the load point rests."""
        kernel, v_lp = self.kernel, as_node(self.v_lp)
        size: Value = log(abs(as_node(self.v) / v_lp))
        if kernel.reduction.velocity == "logarithm" and kernel.choice.level == "constant":
            size = self.there[kernel.layout.w] - self.program.load(Row.W_LP)
        found: Node = select((v_lp > 0.0) | (v_lp < 0.0), size, float("inf"))
        return found

    def _slip(self) -> None:
        """Append instructions that update the slip in progress: begin, whether fast at a peak, end if slow."""
        load, here = self.program.load, self.here
        anew = self.trough & (self.now_event <= 0.0) & (as_node(self.v) < self.now_from)
        anew = here & (self.begins | (anew & (self.now_from < float("inf"))))
        over = here & self.ends
        self._kept(Row.NOW_FROM, anew | over, select(anew, self.v, float("inf")))
        v_lp, least = abs(as_node(self.v_lp)), load(Row.V_LOW)
        pace = select(v_lp > least, v_lp, load(Row.V_DRIVE))
        quick = here & self.peak & (as_node(self.v) >= SLIP_EVENT * larger(pace, self.now_from))
        event = select(quick, 1.0, self.now_event)
        self.program.store(Row.NOW_EVENT, select(anew | over, 0.0, event))
        highest = select(here & self.peak, larger(load(Row.NOW_PEAK), self.v), load(Row.NOW_PEAK))
        self.program.store(Row.NOW_PEAK, select(anew, self.v, highest))
        self._kept(Row.NOW_SIGN, anew, 1.0)
        for row, value in ((Row.NOW_BEGIN, self.time), (Row.NOW_STRESS, self.stress), (Row.NOW_X, self.place)):
            self._kept(row, anew, value)
