"""Following cycles from the edge of stability, through folds and doublings, to where the branch ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.errors import ParameterError, Problem
from steadyslip.nonlinear.branch import Cycle, CycleBranch, SpecialCycle
from steadyslip.nonlinear.continuation import Curve, Failure, Point
from steadyslip.nonlinear.flow import Flow, FlowFailure
from steadyslip.nonlinear.measure import measured
from steadyslip.nonlinear.onset import Onset, hopf
from steadyslip.nonlinear.shooting import Orbit, Shooting
from steadyslip.quantities import shown
from steadyslip.slider import Slider
from steadyslip.values import checked_array

Array = np.ndarray
TOO_UNSTABLE = 1e4  # growth over one segment beyond which the period is cut into more of them
LARGEST_STEP = 0.5
SMALLEST_STEP = 1e-9
NOISE = 3e-9  # relative differences of the parameter that cannot be told from rounding near the onset
SMALL = 1e-2  # amplitude below which multipliers within UNRESOLVED of one are judged by the kind of onset
UNRESOLVED = 1e-7
MOST_SEGMENTS = 64
MOST_GROWTH = 1e8
IMPRECISE = 1e-3  # error of the trivial multiplier beyond which a cycle cannot be trusted
LARGE = 1e6  # peak velocity, in units of the drive, of a cycle that is about to grow without bound
ENDS = {
    "blow-up": "blow-up: the velocity of the massless model becomes infinite; give the slider a mass or "
    "radiation_damping to follow the cycles further",
    "unbounded": "blow-up: the peak velocity grows without bound as the cycle nears the motions of the massless model "
    "that reach infinite velocity; give the slider a mass or radiation_damping to follow the cycles further",
    "growth": "the cycle is too unstable to matter: deviations grow 1e8-fold in each period",
    "contact lost": "contact lost: the normal stress falls to zero in the cycle",
    "stuck": "the equations have no solution in part of the cycle",
    "no velocity": "the equations have no solution in part of the cycle",
}


def cycles(
    rig: Slider,
    along: str = "stiffness",
    *,
    between: Sequence[Any] | None = None,
    amplitude: float | None = None,
    doublings: int = 1,
    most_points: int = 2000,
    rtol: float | None = None,
    branch: int = 0,
    progress: Callable[[int, Cycle], None] | None = None,
) -> CycleBranch:
    """Follow the cycles that begin at the oscillatory edge of stability nearest to the rig.

    Parameters
    ----------
    rig : Slider
    along : str, optional
        Dotted name, or unique last part, of the parameter that is varied.
    between : (low, high), optional
        Range in which to follow, SI units or text; by default a factor of a thousand to each side of the edge
        for positive parameters, the whole domain for others.
    amplitude : float, optional
        Of ln(v/v0) at which the branch starts; 1e-6, with mass 1e-4, unless given.
    doublings : int, optional
        How many period doublings to follow onto the branch of twice the period, one after another.
    most_points : int, optional
        Limit of cycles on a branch.
    rtol : float, optional
        Error allowed per step of integration; 1e-10, with mass 1e-9, unless given.
    branch : int, optional
        Which steady sliding, where there are several.
    progress : callable, optional
        Called with the number of cycles found and the latest one. Ctrl-C returns what there is.

    Returns
    -------
    CycleBranch

    Raises
    ------
    NotAvailable
        If there is no oscillatory edge along the parameter, or the rig's motion is ill-posed.
    UnknownNameError, ParameterError
        If names or ranges are wrong.

    Notes
    -----
    Pseudo-arclength continuation of shooting equations, with the variational equations integrated beside the
    motion; several shooting segments where one period is too unstable. The doubled branch is entered along the
    eigenvector of the multiplier −1.
    """
    onset = hopf(rig, along, branch=branch)
    if amplitude is not None and not 0 < amplitude <= 0.1:
        raise ParameterError([Problem("amplitude", f"got {amplitude!r}; allowed: above 0, up to 0.1")])
    flow = Flow(_at(rig, onset), onset.along, branch, rtol)
    tracer = _Tracer(flow, onset, _limits(rig, onset, between), most_points, progress)
    amplitude = amplitude or max(1e-6, 1e9 * flow.noise)
    first, shooting = tracer.small(amplitude)
    return tracer.followed(shooting, first, amplitude, doublings)


def cycles_at(branch: CycleBranch, value: float) -> tuple[Cycle, ...]:
    """The branch's cycles at one value of its parameter, in the order of the branch."""
    flow = Flow(branch.rig, branch.along)
    tracer = _Tracer(flow, branch.onset, (-np.inf, np.inf), 1, None)
    found = []
    for low, high in zip(branch.cycles[:-1], branch.cycles[1:], strict=True):
        if (low.value - value) * (high.value - value) > 0 or high.value == value:
            continue
        try:
            found.append(tracer.at(low, high, value))
        except Failure:
            continue
    return tuple(found)


def _at(rig: Slider, onset: Onset) -> Slider:
    return rig.with_values({onset.along: onset.value})


def _limits(rig: Slider, onset: Onset, between: Sequence[Any] | None) -> tuple[float, float]:
    role = rig.parameters()[onset.along].role
    if between is None:
        if role.domain.low == 0 and onset.value > 0:
            return max(onset.value * 1e-3, role.domain.low), min(onset.value * 1e3, role.domain.high)
        return role.domain.low, role.domain.high
    if len(between) != 2:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: two values, low and high")])
    low, high = (float(checked_array(onset.along, role, x)) for x in between)
    if not low < high:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: low < high")])
    if not low <= onset.value <= high:
        edge = shown(onset.value, onset.unit, 6)
        raise ParameterError([Problem("between", f"got {between!r}; it must contain the edge, {edge}")])
    return low, high


@dataclass(frozen=True, eq=False)
class _Known:
    """A point of the branch with what is derived from it."""

    point: Point
    shooting: Shooting
    cycle: Cycle


class _Tracer:
    """Follows branches of one flow."""

    def __init__(
        self, flow: Flow, onset: Onset, limits: tuple[float, float], most: int,
        progress: Callable[[int, Cycle], None] | None,
    ) -> None:  # fmt: skip
        self.flow, self.onset, self.limits, self.most, self.progress = flow, onset, limits, most, progress
        self.logarithmic = flow.domain.low == 0 and onset.value > 0
        self.unit_of_value = abs(onset.value) or 1.0

    def shooting(self, fractions: Array) -> Shooting:
        return Shooting(self.flow, fractions, self.logarithmic, self.unit_of_value)

    # -- the start

    def small(self, amplitude: float) -> tuple[Point, Shooting]:
        """The cycle of a given small amplitude of ln v, from the critical eigenvector."""
        flow, onset = self.flow, self.onset
        setting = flow.setting(onset.value)
        steady = flow.steady(onset.value)
        _, jacobian, _ = flow.field(setting, steady[None])
        ratio = flow.scales[None, :] / flow.scales[:, None]
        roots, vectors = np.linalg.eig(jacobian[0] * ratio)
        i = int(np.argmin(np.abs(roots - 1j * onset.angular_frequency)))
        vector = vectors[:, i] * flow.scales
        vector *= setting.drive / 2 / (1j * onset.angular_frequency * vector[0])  # unit amplitude of v/v0, in phase
        start = 2 * vector.imag  # a quarter of a period before the peak
        shooting = self.shooting(np.ones(1))
        shooting.amplitude = amplitude
        guess = shooting.packed(
            Orbit((steady + amplitude * start)[None], 2 * np.pi / onset.angular_frequency, onset.value)
        )
        tangent = np.append(start / np.hypot(flow.scales, steady), [0.0, 0.0])
        return shooting.curve().start(guess, tangent / np.linalg.norm(tangent)), shooting

    # -- the branch

    def followed(self, shooting: Shooting, first: Point, step: float, doublings: int) -> CycleBranch:
        """All cycles from a first one on."""
        found: list[_Known] = []
        special: list[SpecialCycle] = []
        doubled: CycleBranch | None = None
        end = ""
        try:
            for known, reason in self._points(shooting, first, step):
                if found:
                    for kind, point in self._changes(found[-1], known):
                        special.append(point)
                        if kind == "period doubling" and doubled is None and doublings > 0:
                            doubled = self._doubled(point, doublings - 1)
                found.append(known)
                end = reason
                if self.progress is not None:
                    self.progress(len(found), known.cycle)
        except KeyboardInterrupt:
            end = "interrupted by the user"
        onset = self.onset
        return CycleBranch(
            onset.rig, onset.along, onset.unit, onset, tuple(k.cycle for k in found), tuple(special), end, doubled
        )

    def _points(self, shooting: Shooting, first: Point, step: float) -> Iterator[tuple[_Known, str]]:
        """Points with the reason for which the branch would end there."""
        here = self._known(shooting, first)
        steady_period = here.cycle.period
        yield here, ""
        count = 1
        while True:
            curve = shooting.curve()
            for point in self._until_failure(curve, here.point, step):
                if isinstance(point, str):
                    yield here, point
                    return
                shooting.amplitude = self._size(shooting, point)
                known = self._known(shooting, point)
                reason = self._finished(here, known, steady_period)
                if reason.startswith("end of the range"):
                    known = self._at_limit(curve, here, known)
                if reason.startswith("back"):
                    yield here, reason
                    return
                yield known, reason
                count += 1
                if reason:
                    return
                if count >= self.most:
                    yield known, f"most_points = {self.most} reached"
                    return
                step, here = point.length - here.point.length, known
                curve.tolerance = max(shooting.curve().tolerance, 0.01 * abs(known.cycle.trivial - 1))
                if self._too_long(known):
                    shooting, point = self._cut(shooting, point)
                    here = replace(known, point=point, shooting=shooting)
                    break

    def _until_failure(self, curve: Curve, here: Point, step: float) -> Iterator[Point | str]:
        """Points, then the reason why there are no more."""
        try:
            yield from curve.follow(here, step, SMALLEST_STEP, LARGEST_STEP)
        except FlowFailure as failure:
            yield ENDS.get(failure.status, str(failure))
        except Failure as failure:
            yield f"{failure}"

    def _size(self, shooting: Shooting, point: Point) -> float:
        """Amplitude, for the absolute errors that integration may make."""
        orbit = shooting.orbit(point.u)
        away = np.abs(orbit.states - self.flow.steady(orbit.value)) / self.flow.scales
        return float(min(1.0, away.max()))

    def _finished(self, before: _Known, now: _Known, steady_period: float) -> str:
        """Why a branch ends at this cycle, or nothing."""
        low, high = self.limits
        if not low < now.cycle.value < high:
            return f"end of the range, {shown(low if now.cycle.value <= low else high, self.onset.unit)}"
        setting = self.flow.setting(now.cycle.value)
        rates, jacobian, _ = self.flow.field(setting, now.shooting.orbit(now.point.u).states[:1])
        if jacobian[0, 0] @ rates[0] <= 0:  # the block no longer speeds up where the cycle starts
            return "back at steady sliding, at another edge of stability"
        if abs(now.cycle.trivial - 1) > IMPRECISE:
            if now.cycle.peak_velocity > LARGE * setting.drive and not self.flow.reduction.model.inertial:
                return ENDS["unbounded"]
            return "precision is lost; a smaller rtol may lead further"
        if now.cycle.growth > MOST_GROWTH:
            return ENDS["growth"]
        if self.onset.kind == "degenerate" and now.cycle.peak_velocity > LARGE * setting.drive:
            return ENDS["unbounded"]
        longer = np.log(now.cycle.period / before.cycle.period)
        further = abs(now.cycle.value / before.cycle.value - 1)
        if now.cycle.period > 1e3 * steady_period and longer > 1e3 * further:
            return "the period runs away while the parameter stands still (a connection to another steady state)"
        return ""

    def _at_limit(self, curve: Curve, inside: _Known, outside: _Known) -> _Known:
        """The cycle on the limit of the range."""
        low, high = self.limits
        limit = low if outside.cycle.value <= low else high
        target = np.log(limit / self.unit_of_value) if self.logarithmic else limit / self.unit_of_value

        def measure(point: Point) -> float:
            return float(point.u[-1]) - target

        try:
            pair = curve.located(inside.point, outside.point, measure, measure(inside.point), measure(outside.point))
        except Failure:
            return inside
        return self._known(outside.shooting, pair[1])

    # -- segments

    def _too_long(self, known: _Known) -> bool:
        """Whether errors grow too much within a segment."""
        growth = max(float(np.linalg.norm(s, 2)) for s in known.shooting.sensitivities(known.point.u))
        return growth > TOO_UNSTABLE and known.shooting.segments < MOST_SEGMENTS

    def _cut(self, shooting: Shooting, point: Point) -> tuple[Shooting, Point]:
        """The same cycle in twice as many segments, each with its share of the solver's steps."""
        orbit = shooting.orbit(point.u)
        setting = self.flow.setting(orbit.value)
        times, states, starts = [], [], np.cumsum(shooting.fractions) - shooting.fractions
        for start, share, state in zip(starts, shooting.fractions, orbit.states, strict=True):
            record = self.flow.watched(setting, state, share * orbit.period).recorded
            times.append(start * orbit.period + record[:-1, 0])
            states.append(record[:-1, 2:])
        every, together = np.concatenate(times), np.vstack(states)
        count = 2 * shooting.segments
        at = np.unique((np.arange(count) * len(every)) // count)
        fractions = np.diff(np.append(every[at], orbit.period)) / orbit.period
        finer = self.shooting(fractions)
        finer.amplitude = shooting.amplitude
        cut = Orbit(together[at], orbit.period, orbit.value)
        return finer, self._resumed(finer, cut, point.tangent[[*range(self.flow.size), -2, -1]], point.length)

    def _resumed(self, shooting: Shooting, orbit: Orbit, direction: Array, length: float) -> Point:
        """A point in new unknowns, its tangent along `direction` of first state, period and parameter."""
        u = shooting.packed(orbit)
        _, jacobian = shooting.equations(u)
        tangent = np.linalg.svd(jacobian)[2][-1]
        if tangent[[*range(self.flow.size), -2, -1]] @ direction < 0:
            tangent = -tangent
        return shooting.curve().corrected(u, tangent, length)

    # -- special points

    def _changes(self, before: _Known, now: _Known) -> list[tuple[str, SpecialCycle]]:
        """Folds, doublings and tori between two neighbouring points."""
        found = []
        pair = (before, now)
        if before.shooting is now.shooting or before.shooting.segments == now.shooting.segments:
            if before.point.tangent[-1] * now.point.tangent[-1] < 0:
                found += self._special("fold", pair, lambda p, s: float(p.tangent[-1]))
            if self.flow.size > 2 and _doubling(before.cycle) * _doubling(now.cycle) < 0:
                found += self._special("period doubling", pair, lambda p, s: _doubling(self._known(s, p).cycle))
            if min(_torus(before.cycle), _torus(now.cycle)) > -1 and _torus(before.cycle) * _torus(now.cycle) < 0:
                found += self._special("torus", pair, lambda p, s: _torus(self._known(s, p).cycle))
        return found

    def _special(
        self, kind: str, pair: tuple[_Known, _Known], test: Callable[[Point, Shooting], float]
    ) -> list[tuple[str, SpecialCycle]]:
        before, now = pair
        shooting = now.shooting

        def measure(point: Point) -> float:
            return test(point, shooting)

        curve = shooting.curve()
        try:
            low, high = curve.located(before.point, now.point, measure, measure(before.point), measure(now.point))
        except Failure:
            return []
        cycle = self._known(shooting, high).cycle
        other = shooting.orbit(low.u).value
        away = [abs(k.cycle.value / cycle.value - 1) for k in pair]
        if kind == "fold" and (min(away) < NOISE or cycle.amplitude < SMALL):
            return []
        precision = max(abs(other / cycle.value - 1), abs(cycle.trivial - 1) * max(away), 1e-12)
        bracket = (before.cycle.value, now.cycle.value) if kind == "fold" else tuple(sorted((other, cycle.value)))
        return [(kind, SpecialCycle(kind, cycle, (bracket[0], bracket[1]), float(precision)))]

    def _doubled(self, point: SpecialCycle, doublings: int) -> CycleBranch | None:
        """The branch of twice the period, entered along the eigenvector of the multiplier −1."""
        flow = self.flow
        cycle = point.cycle
        state = self._state(cycle)
        setting = flow.setting(cycle.value)
        _, sensitivity, _ = flow.run(setting, state[None], np.array([cycle.period]))
        ratio = flow.scales[None, :] / flow.scales[:, None]
        roots, vectors = np.linalg.eig(sensitivity[0] * ratio)
        vector = np.real(vectors[:, int(np.argmin(np.abs(roots + 1)))])
        rates, jacobian, _ = flow.field(setting, state[None])
        gradient, along = jacobian[0, 0] * flow.scales, rates[0] / flow.scales
        vector = vector - along * (gradient @ vector) / (gradient @ along)  # stay where v equals the drive
        vector /= np.linalg.norm(vector)
        shooting = self.shooting(np.ones(1))
        size = 1e-3
        guess = shooting.packed(Orbit((state + size * vector * flow.scales)[None], 2 * cycle.period, cycle.value))
        tangent = np.append(vector * flow.scales / np.hypot(flow.scales, state), [0.0, 0.0])
        tangent /= np.linalg.norm(tangent)
        try:
            first = shooting.curve().start(guess, tangent)
        except Failure:
            return None
        return self.followed(shooting, first, size, doublings)

    def _state(self, cycle: Cycle) -> Array:
        """State variables at a cycle's start."""
        return np.asarray(cycle._orbit[0][0])

    def at(self, low: Cycle, high: Cycle, value: float) -> Cycle:
        """The cycle at a value of the parameter between two neighbours: along the branch, then at the value itself."""
        shooting = self.shooting(np.ones(1))
        ends = [shooting.packed(Orbit(self._state(c)[None], c.period, c.value)) for c in (low, high)]
        target = np.log(value / self.unit_of_value) if self.logarithmic else value / self.unit_of_value
        far = float(np.linalg.norm(ends[1] - ends[0]))
        direction = (ends[1] - ends[0]) / far

        def measure(point: Point) -> float:
            return float(point.u[-1]) - target

        curve = Curve(shooting.equations, tolerance=3e-8)
        first, last = curve.corrected(ends[0], direction, 0.0), curve.corrected(ends[1], direction, far)
        if measure(first) * measure(last) > 0:  # within rounding of one of them
            near = min(first, last, key=lambda point: abs(measure(point)))
        else:
            flat = replace(first, tangent=direction)
            near = curve.located(flat, last, measure, measure(first), measure(last), width=1e-7)[1]
        guess = np.append(near.u[:-1], target)
        return self._known(shooting, curve.corrected(guess, np.eye(len(guess))[-1], 0.0)).cycle

    # -- from unknowns to a cycle

    def _known(self, shooting: Shooting, point: Point) -> _Known:
        """Everything about a cycle."""
        cycle, turns = measured(shooting, point.u)
        if turns > 1:
            raise Failure("a shorter cycle, run through several times")
        return _Known(
            point, shooting, replace(cycle, stable=self._attracts(np.array(cycle.multipliers), cycle.amplitude))
        )

    def _attracts(self, others: Array, amplitude: float) -> bool:
        """Whether all multipliers lie inside the unit circle; by the kind of onset where that is too close to tell."""
        largest = float(np.max(np.abs(others), initial=0.0))
        if self.onset.kind == "degenerate" and abs(largest - 1) < IMPRECISE:
            return False
        if amplitude < SMALL and abs(largest - 1) < UNRESOLVED:
            return self.onset.kind == "supercritical"
        return largest < 1


def _doubling(cycle: Cycle) -> float:
    """Changes sign where a multiplier passes −1: the product of 1 + μ, each kept of order one."""
    product = np.prod([(1 + m) / (1 + abs(m)) for m in cycle.multipliers] or [1.0])
    return float(np.real(product))


def _torus(cycle: Cycle) -> float:
    """Positive where a pair of complex multipliers lies outside the unit circle; -1 where there is none.

    Next to one a pair cannot be told from two real multipliers.
    """
    pairs = [abs(m) - 1 for m in cycle.multipliers if abs(m.imag) > 1e-3 * abs(m)]
    return max(pairs, default=-1.0)
