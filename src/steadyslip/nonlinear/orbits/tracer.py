"""Follow one piece of a branch of cycles by continuation, from a first cycle to where it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import InternalError
from steadyslip.nonlinear.continuation import Failure, Point, SolutionCurve
from steadyslip.nonlinear.inner_coordinates import inner_count
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.branch_piece import BranchPiece
from steadyslip.nonlinear.orbits.cut_segments import MOST_GROWTH, cut
from steadyslip.nonlinear.orbits.cycle import IMPRECISE, UNCERTAIN, Cycle, End, SpecialCycle
from steadyslip.nonlinear.orbits.cycle_from_motion import cycle_data
from steadyslip.nonlinear.orbits.end_reasons import ENDS, RETRACED, SHRUNK, STANDING, EndRules, retraces, stands, winds
from steadyslip.nonlinear.orbits.flow import FAR_MORE, HARDLY_HEARD, MORE, FlowFailure
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.shooting import ONE, Orbit, Shooting
from steadyslip.nonlinear.orbits.special import SMALL, BranchPoint, changes, may_return

LARGEST_STEP = 0.5  # largest step of arclength; unknowns are logarithms, so about a factor 1.6 of a state
HALVINGS = 3  # number of halvings of a step in which a test function may have two zeros: to 1/8 of LARGEST_STEP
SMALLEST_STEP = 1e-9  # smallest step of arclength, the order of the Newton tolerance
CREEP = 60  # a branch is stuck after this many steps in a row below 1e-3 of LARGEST_STEP that do not grow
SLOW_STEPS, SLOW, FASTER_AGAIN = 8, 0.2, 3.0  # rescaling: after 8 steps below 0.2 of LARGEST_STEP and 3 times the first
OF_RANGE = 3.0  # scale of a state variable, in units of its range in the cycle, after rescaling
UNRESOLVED = 1e-7  # a small cycle's multiplier closer to 1 than this does not decide stability
MOST_STEPS = 4_000_000  # limit of integration steps of all pieces of a branch: two example machines take three million
USUAL = 3  # number of variables to which MOST_STEPS refers for structures; the cost of a step grows with its square
OVER = 0.25  # the last step along a branch may exceed the limit of integration steps by this share
LOST = 1e-5  # more segments are tried if the error of the trivial multiplier exceeds this
LED = 30.0  # factor on LOST where sensitivities have loose tolerances (`FlowRunner.led`); still below `IMPRECISE`
HIDDEN = 0.1  # largest allowed rounding error in a small cycle's distance from the edge, as a share of this distance
INTERRUPTED = "interrupted by the user"
USED_UP = "the limit of steps was reached"


class Tracer:
    """Follows pieces of the branch of cycles of one rig along one parameter.

    Parameters
    ----------
    flow : Flow
    onset : Onset
    limits : tuple of float
        Range of the parameter.
    most : int
        Largest number of cycles on a piece.
    progress : callable, optional
        Called with the number of cycles found on all pieces and the latest cycle.
    """

    def __init__(
        self, flow: Flow, onset: Onset, limits: tuple[float, float], most: int,
        progress: Callable[[int, Cycle], None] | None = None,
    ) -> None:  # fmt: skip
        self.flow, self.onset, self.limits, self.most, self.progress = flow, onset, limits, most, progress
        self.ends = EndRules(flow, onset)
        self.logarithmic = flow.domain.low == 0 and onset.value > 0
        self.unit_of_value = abs(onset.value) or 1.0
        self.count, self.interrupted = 0, False
        self.structures = inner_count(flow.reduction.model) > 0
        self.most_steps = self.last_step = self.allowance

    @property
    def allowance(self) -> int:
        """Limit of the integration steps of a branch: `MOST_STEPS`, with structures as many as take some 5 CPU s."""
        return int(MOST_STEPS * min(1.0, (USUAL / self.flow.size) ** 2 if self.structures else 1.0))

    def begin_branch(self) -> None:
        """Allow the integration steps of another branch."""
        self.last_step = self.flow.steps + self.allowance

    def allot(self, parts: int) -> None:
        """Limit the integration steps of the next piece to 1/`parts` of those that the branch has left."""
        self.most_steps = self.flow.steps + max(0, self.last_step - self.flow.steps) // parts

    @property
    def is_spent(self) -> bool:
        """True if the branch has no integration steps left."""
        return self.flow.steps >= self.last_step

    def shooting(self, fractions: Array = ONE, amplitude: float = 1.0, scales: Array | None = None) -> Shooting:
        """Shooting equations for given segments (shares of the period) and a typical amplitude (natural sizes)."""
        equations = Shooting(self.flow, fractions, self.logarithmic, self.unit_of_value, scales)
        equations.amplitude = amplitude
        return equations

    def unknown(self, value: float) -> float:
        """Convert a parameter value (SI units) to the last unknown of the shooting equations."""
        return float(np.log(value / self.unit_of_value)) if self.logarithmic else value / self.unit_of_value

    # -- where a piece starts

    def small(self, amplitude: float) -> tuple[Shooting, Point]:
        """Solve for the cycle of a given small amplitude of ln v, starting from the critical eigenvector.

        Raises
        ------
        Failure
            If there is none, or its distance from the edge is mostly rounding error.
        """
        flow, onset = self.flow, self.onset
        setting = flow.setting(onset.value)
        steady = flow.steady(onset.value)
        _, jacobian, _ = flow.field(setting, steady[None])
        ratio = flow.scales[None, :] / flow.scales[:, None]
        roots, vectors = np.linalg.eig(jacobian[0] * ratio)
        i = int(np.argmin(np.abs(roots - 1j * onset.angular_frequency)))
        vector = vectors[:, i] * flow.scales
        # unit amplitude of v/v0 at the watched contact, real and positive
        size = setting.speed / 2 / (1j * onset.angular_frequency * complex(setting.slip @ vector))
        start = 2 * (size * vector).imag  # a quarter of a period before the peak
        shooting = self.shooting(amplitude=amplitude)
        guess = Orbit((steady + amplitude * start)[None], 2 * np.pi / onset.angular_frequency, onset.value)
        tangent = np.append(start / np.hypot(flow.scales, steady), [0.0, 0.0])
        first = shooting.curve().start(shooting.packed(guess), tangent / np.linalg.norm(tangent))
        away = abs(onset.coefficient / onset.growth_slope) * amplitude**2 / self.unit_of_value
        if not onset.is_weak and first.rounding > HIDDEN * away:
            raise Failure("the distance of the small cycle from the edge is lost in rounding")
        return shooting, first

    def doubled(self, cycle: Cycle, size: float) -> BranchPoint:
        """Solve for a cycle of twice the period, `size` (in unknowns) away along the eigenvector of multiplier −1.

        Raises
        ------
        Failure
            If there is none, or it is `cycle` itself, run through twice.
        """
        flow, (vector, pieces) = self.flow, self.deviation(cycle, -1.0)
        orbit = orbit_of(cycle)
        count = len(orbit.fractions)
        aside = [size * vector]
        for piece in (*pieces, *pieces[:-1]):
            aside.append(piece @ aside[-1])
        fractions = np.tile(orbit.fractions, 2) / 2
        fractions[count - 1] += fractions[count]  # no cut after the first turn: the motion is fast where cycles begin
        states = np.delete(np.tile(orbit.states, (2, 1)) + aside, count, axis=0)
        fractions = np.delete(fractions, count)
        shooting = self.shooting(fractions, scales=orbit.scales)
        tangent = np.zeros(states.size + 2)
        tangent[: flow.size] = aside[0] / np.hypot(shooting.scales, orbit.states[0])
        curve = shooting.curve()
        guess = shooting.packed(replace(orbit, states=states, period=2 * cycle.period))
        flow.far_more = MORE
        try:
            return self.branch_point(shooting, curve.start(guess, tangent / curve.size(tangent)))
        finally:
            flow.far_more = FAR_MORE

    def deviation(self, cycle: Cycle, multiplier: complex) -> tuple[Array, Array]:
        """Eigenvector (n,) of one multiplier at a cycle's start, and the sensitivities of the segments (K, n, n).

        To first order the eigenvector leaves slip at the load point's velocity; its largest entry is 1 in units of the
        shooting unknowns.

        Raises
        ------
        Failure
            If the motion over a period cannot be integrated.
        """
        flow, orbit = self.flow, orbit_of(cycle)
        setting = flow.setting(cycle.value)
        _, pieces, _ = flow.run(setting, orbit.states, orbit.fractions * orbit.period)
        whole = np.linalg.multi_dot([*pieces[::-1], np.eye(flow.size)])
        roots, vectors = np.linalg.eig(whole * flow.scales[None, :] / flow.scales[:, None])
        vector = np.real(vectors[:, int(np.argmin(np.abs(roots - multiplier)))]) * flow.scales
        rates, jacobian, _ = flow.field(setting, orbit.states[:1])
        gradient = setting.slip @ jacobian[0]
        vector -= rates[0] * (gradient @ vector) / (gradient @ rates[0])
        scales = flow.scales if orbit.scales is None else orbit.scales
        return vector / np.max(np.abs(vector / np.hypot(scales, orbit.states[0]))), pieces

    def resumed(
        self, orbit: Orbit, amplitude: float, direction: Array | None = None, length: float = 0.0
    ) -> BranchPoint:
        """Solve for the cycle next to a known orbit; `direction` (first state, period, parameter) orients its tangent.

        Raises
        ------
        Failure
            If the shooting equations do not converge near the orbit.
        """
        shooting = self.shooting(orbit.fractions, amplitude, orbit.scales)
        u = shooting.packed(orbit)
        _, jacobian = shooting.equations(u)
        tangent = np.linalg.svd(jacobian)[2][-1]
        curve = shooting.curve()
        tangent /= curve.size(tangent)
        if direction is not None and tangent[[*range(self.flow.size), -2, -1]] @ direction < 0:
            tangent = -tangent
        return self.branch_point(shooting, curve.corrected(u, tangent, length, 0.1 * amplitude))

    # -- the piece

    def followed(
        self, shooting: Shooting, first: Point | BranchPoint, step: float, *, twice: bool = False,
        met: Callable[[BranchPoint], bool] | None = None,
    ) -> BranchPiece:  # fmt: skip
        """Piece of the branch from a first cycle to where it ends.

        Parameters
        ----------
        twice : bool
            True for a branch from a period doubling, which may end at another one.
        met : callable, optional
            Returns True for a cycle that is known already; the piece ends before it.
        """

        def points() -> Iterator[tuple[BranchPoint, BranchPoint]]:
            start = self.branch_point(shooting, first) if isinstance(first, Point) else first
            yield start, start
            yield from self._points(start, step)

        return self.gone_on(BranchPiece(rest=points(), twice=twice), met)

    def gone_on(self, piece: BranchPiece, met: Callable[[BranchPoint], bool] | None = None) -> BranchPiece:
        """Extend a piece that has a `rest`, until it ends or its integration steps are used up."""
        points, begun = piece.rest or iter(()), self.flow.steps
        piece.rest, piece.end = None, ""
        self.flow.last_step = self.most_steps + OVER * self.allowance
        try:
            for before, here in points:
                if not piece.points:
                    self._add(piece, here)
                    continue
                if met is not None and met(here):
                    piece.end, piece.whole, piece.beyond = "", True, here
                    return piece
                piece.end, keep = self.ends.finished(self.limits, before, here, piece.points[0], piece.twice)
                if piece.end == ENDS["steady"]:
                    piece.stops = self.ends.other_edge([known.cycle for known in piece.points[-2:]])
                if piece.end.startswith("end of the range"):
                    here = self._at_limit(before, here)
                    piece.stops = End("range", here.cycle.value, here.cycle)
                if keep:
                    self._add_changes(piece, before, here)
                    self._add(piece, here)
                else:
                    piece.beyond = here
                if not piece.end and winds(piece.special):
                    piece.end = ENDS["winds"]
                if not piece.end and retraces([known.cycle for known in piece.points]):
                    piece.end = ENDS["retraces"]
                    del piece.points[-RETRACED:]
                    piece.special = [one for one in piece.special if one.index <= len(piece.points)]
                if not piece.end and stands([known.cycle for known in piece.points[-STANDING:]]):
                    piece.end = ENDS["stands"]
                if piece.end:
                    break
                if len(piece.points) >= self.most:
                    piece.end = f"most_points = {self.most} reached"
                    break
                if self.flow.steps > self.most_steps:
                    piece.rest, piece.steps = points, piece.steps + self.flow.steps - begun
                    piece.end = self._spent(piece.steps)
                    break
            lost = {ENDS["retraces"], ENDS["growth"], ENDS["runs away"], ENDS["winds"], ENDS["stands"]}
            lost |= set() if piece.points[-1].cycle.stable else {ENDS["precision"]}
            piece.whole = piece.end not in lost
        except KeyboardInterrupt:
            piece.end, piece.whole, self.interrupted = INTERRUPTED, True, True
        except FlowFailure as failure:
            piece.end = self.ends.words(failure.status, failure.contact) or f"broke off: {failure}"
            piece.whole, piece.contact = failure.status == "contact lost", failure.contact
        except (Failure, np.linalg.LinAlgError) as failure:
            piece.end = f"broke off: the equations of a cycle were not solved any further ({failure})"
        if self.flow.steps >= self.flow.last_step:
            piece.end, piece.whole = self._spent(piece.steps + self.flow.steps - begun), True
        self.flow.last_step = np.inf
        return piece

    def _spent(self, steps: int) -> str:
        """Reason for the end of a piece whose integration steps are used up, with advice on how to go on."""
        fewer = ", or give structures fewer modes (kept_modes) or more damping" if self.structures else ""
        return (
            f"{steps / 1e6:.2g} million steps of integration taken, all that are spent on this part; ask for the rest "
            f"with between=(low, high){fewer}"
        )

    def _add_changes(self, piece: BranchPiece, before: BranchPoint, here: BranchPoint) -> None:
        """Append the bifurcations between two neighbouring cycles, and a cycle between each two bifurcations."""
        earlier = piece.points[-2] if len(piece.points) > 1 else before
        for one in self._changes(earlier, before, here, len(piece.points), HALVINGS):
            last = piece.special[-1] if piece.special else None
            if last is not None and last.index == len(piece.points):
                with suppress(Failure):
                    self._add(piece, self._on_the_way(before, here, 0.5 * (last._length + one._length)))
            piece.special.append(replace(one, index=len(piece.points)))

    def _changes(
        self, earlier: BranchPoint, before: BranchPoint, here: BranchPoint, index: int, halvings: int
    ) -> list[SpecialCycle]:
        """Bifurcations between two neighbouring cycles; the step is halved where two of one kind may cancel."""
        found = changes(before, here, self.branch_point, index)
        if found or halvings == 0 or not may_return(earlier, before, here):
            return found
        try:
            middle = self._on_the_way(before, here, 0.5 * (before.point.length + here.point.length))
        except Failure:
            return found
        first = self._changes(earlier, before, middle, index, halvings - 1)
        return first + self._changes(before, middle, here, index, halvings - 1)

    def _on_the_way(self, before: BranchPoint, here: BranchPoint, length: float) -> BranchPoint:
        """Solve for the cycle at an arclength between those of two neighbours.

        Raises
        ------
        Failure
            If it is not found.
        """

        def measure(point: Point) -> float:
            return point.length - length

        ends = measure(before.point), measure(here.point)
        point = here.shooting.curve().located(before.point, here.point, measure, *ends, width=np.inf)[1]
        return self.branch_point(here.shooting, point)

    def _add(self, piece: BranchPiece, known: BranchPoint) -> None:
        """Append a point to the piece and report progress."""
        piece.points.append(known)
        self.count += 1
        if self.progress is not None:
            self.progress(self.count, known.cycle)

    def _points(self, here: BranchPoint, step: float) -> Iterator[tuple[BranchPoint, BranchPoint]]:
        """Yield pairs of consecutive points of the piece, each pair in one set of unknowns.

        Cycles are cut into new segments where they are too unstable, where deviations grow and shrink so much within a
        segment that the trivial multiplier is inaccurate, or where continuation fails. Where steps stay small, states
        are scaled by their range in the cycle (see `_rescaled`).
        """
        limit, error, again, idle = MOST_GROWTH, self._lost, True, 0
        steps: list[float] = []
        while True:
            found: dict[int, BranchPoint] = {}
            curve = self._curve(here)

            def accept(point: Point, shooting: Shooting = here.shooting, found: dict[int, BranchPoint] = found) -> None:
                found[0] = self.branch_point(shooting, point)
                if found[0].cycle.amplitude > SHRUNK and self.ends.slows(found[0]):
                    raise Failure("the cycle begins where slip slows down")

            finer = None
            try:
                for point in curve.follow(here.point, step, SMALLEST_STEP, LARGEST_STEP, accept):
                    taken = point.length - here.point.length
                    idle = idle + 1 if taken <= step and taken < 1e-3 * LARGEST_STEP else 0
                    if idle > CREEP:
                        raise Failure("steps along the branch stay tiny")
                    before, here, step, again = here, found[0], taken, True
                    curve.tolerance = self._curve(here).tolerance
                    yield before, here
                    finer = self._begun_anew(here)
                    if finer is not None:
                        break
                    steps = [*steps[1 - SLOW_STEPS :], taken]
                    if len(steps) == SLOW_STEPS and max(steps) < min(SLOW * LARGEST_STEP, FASTER_AGAIN * steps[0]):
                        steps, finer = [], self._rescaled(here)
                        if finer is not None:
                            break
                    unstable = here.cycle.growth > limit**here.shooting.segments
                    lost = abs(here.cycle.trivial - 1) > error
                    if unstable or lost:
                        finer = self._finer(here)
                        if finer is not None:
                            break
                        limit, error = limit * (10.0 if unstable else 1.0), error * (10.0 if lost else 1.0)
            except Failure:
                finer = self._finer(here) if again else None
                if finer is None:
                    raise
                step, again = max(step, 1e-2 * LARGEST_STEP), False
            if finer is not None:
                here = finer

    def _rescaled(self, known: BranchPoint) -> BranchPoint | None:
        """Point of the branch in unknowns scaled by the states' ranges in the cycle; None if scales change little.

        While one body sticks, another may ring, and the phase of that small oscillation at the onset of slip changes
        with the parameter. In unknowns scaled by natural sizes this makes the branch wind.
        """
        shooting, count = known.shooting, self.flow.size
        scales = np.maximum(self.flow.scales, OF_RANGE * known.extent)
        changed = scales / shooting.scales
        if not np.any((changed > 2) | (changed < 0.5)):
            return None
        orbit = replace(shooting.orbit(known.point.u), scales=scales)
        state, tangent = orbit.states[0], known.point.tangent
        moved = tangent[:count] * np.hypot(shooting.scales, state) / np.hypot(scales, state)
        try:
            return self.resumed(orbit, shooting.amplitude, np.append(moved, tangent[-2:]), known.point.length)
        except (Failure, np.linalg.LinAlgError):
            return None

    def _begun_anew(self, known: BranchPoint) -> BranchPoint | None:
        """Point of the branch whose cycle starts at a steeper passage through the load point's velocity, or None."""
        if known.begin is None:
            return None
        direction = np.append(np.zeros(self.flow.size), known.point.tangent[-2:])
        try:
            return self.resumed(known.begin, known.shooting.amplitude, direction, known.point.length)
        except (Failure, np.linalg.LinAlgError):
            return None

    def _curve(self, known: BranchPoint) -> SolutionCurve:
        """Continuation curve through a point, with a Newton tolerance that suits its rounding errors."""
        curve = known.shooting.curve()
        curve.tolerance = max(curve.tolerance, min(1e-6, 0.01 * abs(known.cycle.trivial - 1)))
        return curve

    def _finer(self, known: BranchPoint) -> BranchPoint | None:
        """Point of the branch in more shooting segments; None if more do not help."""
        try:
            orbit = cut(known.shooting, known.point.u)
            if orbit is None:
                return None
            direction = known.point.tangent[[*range(self.flow.size), -2, -1]]
            return self.resumed(orbit, known.shooting.amplitude, direction, known.point.length)
        except (Failure, np.linalg.LinAlgError):
            return None

    def branch_point(self, shooting: Shooting, point: Point) -> BranchPoint:
        """Cycle with its properties, from a solution of the shooting equations.

        Raises
        ------
        Failure
            If the solution is a shorter cycle, run through several times.
        """
        orbit = shooting.orbit(point.u)
        away = np.abs(orbit.states - self.flow.steady(orbit.value)) / self.flow.scales
        shooting.amplitude = float(min(1.0, away.max()))
        found = cycle_data(shooting, point.u)
        while self.flow.led and found.cycle.multiplier_error > self._lost:
            self.flow.slack = HARDLY_HEARD if self.flow.costly and self.flow.slack > HARDLY_HEARD else 1.0
            shooting.forget()
            found = cycle_data(shooting, point.u)
        if found.turns > 1:
            raise Failure(f"a shorter cycle, run through {found.turns} times")
        cycle = replace(found.cycle, stable=self._attracts(found.cycle))
        return BranchPoint(point, shooting, cycle, found.half, found.extent, found.begin)

    @property
    def _lost(self) -> float:
        """Error of the trivial multiplier beyond which tolerances of the sensitivities are tightened."""
        return LOST * (LED if self.flow.slack == HARDLY_HEARD else 1.0)

    def _attracts(self, cycle: Cycle) -> bool:
        """True if the cycle is stable: all multipliers lie inside the unit circle.

        For a small cycle with a multiplier too close to the circle, the kind of onset decides.
        """
        if self.onset.is_weak and abs(cycle.growth - 1) < IMPRECISE:
            return False
        if cycle.amplitude < SMALL and abs(cycle.growth - 1) < max(UNRESOLVED, UNCERTAIN * cycle.multiplier_error):
            return self.onset.kind == "supercritical"
        return cycle.growth < 1

    def _at_limit(self, inside: BranchPoint, outside: BranchPoint) -> BranchPoint:
        """Cycle at the limit of the parameter's range, between two neighbours; `outside` if it is not found."""
        low, high = self.limits
        try:
            return self.between(inside, outside, low if outside.cycle.value <= low else high)
        except Failure:
            return outside

    def between(self, near: BranchPoint, far: BranchPoint, value: float) -> BranchPoint:
        """Solve for the cycle at a parameter value between those of two neighbours with the same unknowns.

        Raises
        ------
        Failure
            If it is not found.
        """
        shooting, target = far.shooting, self.unknown(value)

        def measure(point: Point) -> float:
            return float(point.u[-1]) - target

        ends = measure(near.point), measure(far.point)
        if ends[0] * ends[1] > 0:
            raise Failure("the parameter value is not between those of the two cycles")
        curve = shooting.curve()
        close = curve.located(near.point, far.point, measure, *ends, width=1e-7)[1]
        guess = np.append(close.u[:-1], target)
        point = curve.corrected(guess, np.eye(len(guess))[-1], close.length, 0.1 * shooting.amplitude)
        if point.tangent @ (curve.weights * close.tangent) < 0:
            point = replace(point, tangent=-point.tangent)
        return self.branch_point(shooting, point)


def orbit_of(cycle: Cycle) -> Orbit:
    """`Orbit` (states and period) from which a cycle was computed."""
    if cycle._orbit is None:
        raise InternalError("a cycle has no solution of its equations to start from; this is a bug, please report it")
    return cycle._orbit
