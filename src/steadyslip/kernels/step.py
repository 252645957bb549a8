"""Program of one step, explicit or Rosenbrock: error estimate, next step size, and the flag that calls the driver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from steadyslip.kernels.driver.places import earlier_at, guess_at
from steadyslip.kernels.events import COUNTED, EVENTS, ROUNDED, Observed
from steadyslip.kernels.formulation import Formulation
from steadyslip.kernels.layout import MOST_FAILURES, EventPlace, Row
from steadyslip.kernels.nodes import Node, Program, Value, as_node, exp, larger, primitive, select, smaller, weighted
from steadyslip.kernels.record import Evaluator, Values, times, total
from steadyslip.kernels.rosenbrock import factorised, substituted
from steadyslip.kernels.source import Formulas

INSTANT = 1e-13  # a step makes no progress if it is shorter than this share of the time so far and changes no state
UNCHANGED = 1e-9  # a state variable counts as changed if it moves by more than this share of its absolute tolerance
LOG_SAFETY = math.log(0.5)
"""ln of the ratio of the next step to the longest step that the error allows. With a ratio of 0.5 hardly any step is
rejected, and the error after tens of cycles is near rtol."""
LAST_ERROR_WEIGHT, EARLIER_ERROR_WEIGHT = 0.7, 0.3
"""Weights of the last error and of the error before in step control. Without the second weight, steps that stability
limits oscillate about the limit, and every sixth step is rejected."""
SHRINK, GROW = 0.2, 6.0  # limits of the ratio of a step to the previous one; usual values (DOP853: 1/3, 6)
LOWEST_TREND = -3.0  # lower limit of ln e² minus its goal, when the next error is extrapolated; chosen by trial
# at the start of a segment, share of the allowed error above which the sign of an event function is known
INITIAL_SHARE = 1e-3
LOG_SAFETY_REJECTED = math.log(0.8)  # as LOG_SAFETY, after a rejected step; chosen by trial


class Step(Evaluator):
    """Straight-line program of one integration step."""

    def __init__(self, kernel: Formulation, name: str = "step") -> None:
        super().__init__(kernel, Program(name))
        load, layout, n = self.program.load, kernel.layout, kernel.size
        self.old = self.state()
        self.first: list[Value] = [load(layout.rate + i) for i in range(n)]
        self.atol, self.rtol = [load(layout.atol + i) for i in range(n)], load(Row.RTOL)
        self.tau, self.proposed, self.end = load(Row.TAU), load(Row.H), load(Row.LENGTH)
        rest = self.end - self.tau
        self.rest = rest
        self.last = self.proposed >= rest * 0.99999999  # so that rounding does not leave a tiny last step
        self.h: Value = select(self.last, rest, self.proposed)
        self.new: Sequence[Value] = ()
        self.settled: Sequence[Value] = ()  # rates at the end of the step, without the part caused by the step's error
        self.steady = None if kernel.timed else self.inputs(self.tau)

    def advance(self) -> None:
        """Append the instructions of the step itself, of its error, and of the size of the next step."""
        method = self.kernel.method
        errors = self._rosenbrock() if method.implicit else self._runge_kutta()
        error = self._squared(errors)
        error = error * (1 / self.kernel.counted)
        if method.lower_error:
            lower = self._squared(self._estimate(method.lower_error)) * (1 / self.kernel.counted)
            # combination of two error estimates as in DOP853 (Hairer, Nørsett & Wanner II.10)
            error = error * error / larger(error + 0.01 * lower, 1e-300)
        after = abs(as_node(total(self.rates))) < math.inf  # rates must be finite for the next step
        self.good = as_node(error <= 1.0, "bool") & after
        self.size = primitive("rough_log", smaller(larger(error, 1e-10), 1e30))
        self.earlier = self.program.load(Row.ERROR)
        factor = exp(select(self.good, self._log_growth(), LOG_SAFETY_REJECTED - 0.5 / method.order * self.size))
        factor = select(error < 1e60, smaller(larger(factor, SHRINK), GROW), SHRINK)  # SHRINK also if the error is NaN
        self.after = select(self.last, self.end, self.tau + self.h)
        next_h = self.h * factor
        self.next_h = select(self.last & self.good, larger(self.proposed, next_h), next_h)

    def _log_growth(self) -> Node:
        """ln of the ratio of the next step to this one, after an accepted step.

        It is the smaller of two proposals (after Gustafsson 1991, 1994). The first follows from the last two errors;
        the second assumes that errors and steps continue to change as between the last two steps. Before a slip event
        steps shrink by a constant factor, and the second proposal is right; after it steps grow, and the first is
        better.
        """
        per = 0.5 / self.kernel.method.order
        goal = LOG_SAFETY / per
        before = larger(self.earlier, goal + LOWEST_TREND)
        by_errors = per * (LAST_ERROR_WEIGHT * (goal - self.size) - EARLIER_ERROR_WEIGHT * (goal - before))
        trend = primitive("rough_log", self.h * (1.0 / larger(self.program.load(Row.H_OLD), 1e-300)))
        wanted: Node = smaller(by_errors, LOG_SAFETY - per * self.size + trend + per * (before - self.size))
        return wanted

    def _squared(self, errors: Sequence[Value]) -> Value:
        """Sum of the squares of errors divided by the allowed errors."""
        found: Value = 0.0
        for i, e in enumerate(errors):
            scaled = e * (1.0 / (self.atol[i] + self.rtol * larger(abs(self.old[i]), abs(self.new[i]))))
            found = found + scaled * scaled
        return found

    def _estimate(self, weights: Sequence[float]) -> list[Value]:
        """Error estimates of all variables, for an explicit method with given weights of the stages."""
        return [self.h * weighted(weights, [k[i] for k in self.stages]) for i in range(self.kernel.size)]

    def _inputs_of(self, s: int) -> Values:
        """Inputs at the time of stage s."""
        if self.steady is not None:
            return self.steady
        return self.inputs(self.tau + self.kernel.method.nodes[s] * self.h)

    def _found(self, formulas: Formulas, y: Sequence[Value], inputs: Values) -> list[Value]:
        return self.evaluated(formulas, inputs | {f"y{i}": value for i, value in enumerate(y)})

    def _runge_kutta(self) -> list[Value]:
        method, n = self.kernel.method, self.kernel.size
        self.stages: list[list[Value]] = [self.first]
        for s in range(1, method.stages):
            y = [self._reached(method.a[s], i) for i in range(n)]
            whole = s == method.stages - 1
            self.here = self._inputs_of(s)
            found = self._found(self.kernel.full if whole else self.kernel.rates, y, self.here)
            self.stages.append(found[:n])
        self.new, self.rates, self.outputs = y, found[:n], found[n:]
        self.settled = self.rates
        return self._estimate(method.error)

    def _reached(self, weights: Sequence[float], i: int) -> Value:
        """Variable i in the argument of a stage, from the stages so far."""
        known = [k[i] for k in self.stages]
        if self.kernel.choice.lanes > 1:
            return self.old[i] + self.h * weighted(weights, known)
        # to reduce latency, the newest stage is added last: all other terms can be summed while it is computed
        return (self.old[i] + self.h * weighted(weights, known[:-1])) + (self.h * weights[len(known) - 1]) * known[-1]

    def _rosenbrock(self) -> list[Value]:
        kernel, method, n, h = self.kernel, self.kernel.method, self.kernel.size, self.h
        beginning = self.steady if self.steady is not None else self.inputs(self.tau)
        point = beginning | {f"y{i}": value for i, value in enumerate(self.old)}
        entries = self.evaluated(kernel.jacobian, point, found=True)
        jacobian = dict(zip(sorted(kernel.pattern), entries, strict=False))
        in_time = entries[len(jacobian) :]
        inverse = 1.0 / h
        matrix = factorised(kernel.elimination, jacobian, inverse * (1 / method.gamma))
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
                if kernel.timed and abs(method.time_weights[s]) > 1e-12:  # smaller weights are rounding errors of zero
                    right[i] = right[i] + h * method.time_weights[s] * in_time[i]
            self.stages.append(substituted(matrix, right))
        self.new = [y[i] + self.stages[-1][i] for i in range(n)]
        self.here = self.steady if self.steady is not None else self.inputs(self.tau + h)
        found = self._found(kernel.full, self.new, self.here)
        self.rates, self.outputs = found[:n], found[n:]
        self.settled = self._settled(inverse)
        return list(self.stages[-1])

    def _settled(self, inverse: Value) -> list[Value]:
        """Rates at the end y1 of a Rosenbrock step, from the equation of its last stage u.

        The rates are f(y1 − u) + J u = u/(hγ) − Σ c_j u_j/h. In f(y1) the error of y1 is multiplied by the Jacobian,
        and for a stiff system the product exceeds the true rate by far. In the equation of the last stage this error
        cancels, because the method has solved with the same Jacobian.
        """
        method, (*before, last) = self.kernel.method, self.stages
        return [
            inverse * (u * (1 / method.gamma) - weighted(method.c[-1], [one[i] for one in before]))
            for i, u in enumerate(last)
        ]

    def keep(self) -> None:
        """Append instructions that store an accepted or rejected step, and the flag that calls the driver."""
        load, store, good = self.program.load, self.program.store, self.good
        if self.kernel.choice.dense:
            self.store_stages()
        self.store_state()
        before = [load(row) for row in (Row.V, Row.ACCELERATION, Row.SIGMA)]
        v, acceleration, sigma = (select(good, a, b) for a, b in zip(self.outputs[:3], before, strict=True))
        for row, value in ((Row.V, v), (Row.ACCELERATION, acceleration), (Row.SIGMA, sigma)):
            store(row, value)
        moved = select(good, self.after, self.tau)
        store(Row.TAU, moved)
        store(Row.H, self.next_h)
        store(Row.GOOD, select(good, 1.0, 0.0))
        accepted, rejected = load(Row.ACCEPTED) + select(good, 1.0, 0.0), load(Row.REJECTED) + select(good, 0.0, 1.0)
        store(Row.ACCEPTED, accepted)
        store(Row.REJECTED, rejected)
        failures = select(self._made_progress(moved), 0.0, load(Row.FAILURES) + 1.0)
        store(Row.FAILURES, failures)
        reasons = [
            moved >= self.end,
            accepted + rejected >= load(Row.MOST_STEPS),
            failures >= MOST_FAILURES,
            abs(v) >= load(Row.V_HIGH),
            sigma <= load(Row.SIGMA_LOW),
            moved > load(Row.NEXT_TIME),
        ]
        for c, (place, value) in enumerate(self.further_contact_rows(self.outputs)):
            store(place, select(good, value, load(place)))
            if c % 3:
                lost, away = value <= load(Row.SIGMA_LOW), abs(as_node(value)) >= load(Row.V_HIGH)
                reasons.append(good & (lost if c % 3 == 1 else away))
        flag = total([select(reason, 1.0, 0.0) for reason in reasons])
        flag = flag + load(Row.RECORD) * select(good, 1.0, 0.0)
        if self.kernel.choice.dense:
            happened = self._events()
            flag = flag + select(happened > 0.0, 1.0, 0.0)
        store(Row.FLAG, flag * load(Row.ACTIVE))

    def _made_progress(self, moved: Value) -> Node:
        """True if the step was accepted, and time or a state has changed noticeably.

        At a fold of the balance, steps shrink to the rounding of time, change no state and would be accepted forever.
        Folds exist only if a balance has to be solved.
        """
        if not self.kernel.unknowns:
            return as_node(self.good, "bool")
        changed = moved - self.tau > INSTANT * moved
        for new, old, error in zip(self.new, self.old, self.atol, strict=True):
            changed = changed | (abs(new - old) > UNCHANGED * error)
        return as_node(changed, "bool") & self.good

    def _events(self) -> Node:
        """Append instructions for sign changes of event functions.

        Returns their number, zero in lanes that do not watch events.
        """
        load, store, layout = self.program.load, self.program.store, self.kernel.layout
        here = self.here | {f"y{i}": value for i, value in enumerate(self.new)}
        moments = [self._with_errors(one) for one in self.moments(here, self.outputs, self.h, self.settled)]
        count = as_node(0.0)
        for e, value in enumerate(self.event_values(moments)):
            event, at = EVENTS[e % len(EVENTS)], moments[e // len(EVENTS)]
            before = load(layout.event_value + e)
            known, least, small = self.good, as_node(0.0), 0.0
            if event.uncertain is not None:
                least = event.uncertain(at)
                small = event.uncertain(replace(at, error=INITIAL_SHARE * at.error))
                known = known & (abs(value) > least)
            change = as_node(0.0)
            if event.falls:
                change = select((before > small) & (value <= 0.0), -1.0, change)
            if event.rises:
                change = select((before <= -small) & (value > 0.0), 1.0, change)
            change = select(known, change, 0.0)
            change = change * load(Row.WATCH)
            store(layout.sign_change + e, change)
            for kind, own in ((2 * e, change < 0.0), (2 * e + 1, change > 0.0)):
                if COUNTED[kind % len(COUNTED)]:
                    place = layout.event_count + kind
                    store(place, load(place) + select(own, 1.0, 0.0))
            store(layout.event_value + e, select(known, value, before))
            if e % len(EVENTS) not in tuple(EventPlace):  # events that are only counted if no log is kept
                change = select(load(Row.LOG) > 0.0, change, 0.0)
            count = count + abs(change)
        happened = count * load(Row.ACTIVE)
        store(Row.EVENT_COUNT, happened)
        return happened

    def _with_errors(self, moment: Observed) -> Observed:
        """Arguments of event functions with `error` and `rounding` at the end of the step.

        The error of the velocity is rtol times the velocity if its variable is a logarithm, else rtol times the sum of
        velocity and drive velocity. The rounding of the acceleration is that of the velocity over the step.
        """
        one, load = self.kernel.reduction.slidings[moment.contact], self.program.load
        size = abs(as_node(moment.v))
        rounding = ROUNDED * size / as_node(self.h)
        if one.variable is None or one.variable.kind != "logarithm":
            size = size + times(abs(load(Row.V_DRIVE)), self.shares(moment.contact)[0])
        return replace(moment, error=self.rtol * size, rounding=rounding)

    def store_state(self) -> None:
        """Append instructions that store the new state and its rates if the step is accepted, else the old ones."""
        layout, store, good = self.kernel.layout, self.program.store, self.good
        for i in range(self.kernel.size):
            store(layout.state + i, select(good, self.new[i], self.old[i]))
            store(layout.rate + i, select(good, self.rates[i], self.first[i]))
        for k, i in enumerate(self.kernel.moving):
            error = self.rates[i] - as_node(self.settled[i])
            store(layout.rate_error + k, select(good, error, self.rate_error(i)))
        store(Row.ERROR, select(good, self.size, self.earlier))
        store(Row.H_OLD, select(good, self.h, self.program.load(Row.H_OLD)))
        for k, z in enumerate(self.z):
            place = guess_at(layout, k)
            store(place, select(good, z, self.program.load(place)))

    def store_stages(self) -> None:
        """Append instructions that store the old state, the stages and the unknowns, for dense output."""
        layout, n, store = self.kernel.layout, self.kernel.size, self.program.store
        for i in range(n):
            store(layout.state_old + i, self.old[i])
        for s in self.kernel.method.dense_stages:
            for i in range(n):
                store(layout.stage + s * n + i, self.stages[s][i])
        if layout.w >= 0:
            store(Row.W_RATE_OLD, self.settled_rate(layout.w))
        for k in range(self.kernel.unknowns):
            store(earlier_at(layout, k), self.program.load(guess_at(layout, k)))
        store(Row.EXTENDED, 0.0)
        store(Row.STEP_SIZE, self.h)
        store(Row.TAU_OLD, self.tau)
