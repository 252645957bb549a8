"""Motion of a held rig from mode to mode and from sample to sample, and its strokes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.kernels.layout import Control, Held
from steadyslip.nonlinear.hunting.bristles import BristleSteps
from steadyslip.nonlinear.hunting.held_modes import HeldMode, HeldPiece, Switch
from steadyslip.nonlinear.hunting.in_mode import CompiledMotion
from steadyslip.nonlinear.hunting.plant import Array, HeldContact, Plant
from steadyslip.nonlinear.hunting.steps import NODES, POWERS, ExactSteps, first_crossing
from steadyslip.protocol.segments import Segments

BEYOND = 1e-12  # relative excess of a force over static friction that counts as rounding
STILL_ERROR = 0.1  # factor on rtol: smaller relative speeds of bristles are numerical noise (by trial)
STILL = 1e-9  # a body counts as at rest below this share of the largest speed so far
AT_ONCE = 100  # limit of successive switches at one time; more switches would never end
AWAY = 1e4  # ratio of the error to that which friction, load or target explain, above which friction is negligible
KEPT = slice(0, None, 8)  # nodes of a step at which values are recorded


LEAST_LOAD = 1e-13  # share of the largest load below which a load's sign is ignored: its friction is within rounding
RINGING = 0.1  # a stroke shorter than this share of the longest one in the later half is ringing, as for slip events


@dataclass
class Stroke:
    """Motion between two rests: times (s) of start and end, errors then (m or rad), extremes of error and speed."""

    start: float
    begins: float
    end: float = np.nan
    ends: float = np.nan
    fastest: float = 0.0
    lowest: float = np.inf
    highest: float = -np.inf


def swings(strokes: Iterable[Stroke]) -> list[Stroke]:
    """Complete strokes in alternating directions.

    Successive strokes in one direction are joined, and strokes shorter than `RINGING` allows are left out.

    A ringing drive rests for moments on its way, and its bristles spring back a little.
    """
    done = [one for one in strokes if np.isfinite(one.end)]
    longest = max((abs(one.ends - one.begins) for one in done[len(done) // 2 :]), default=0.0)
    found: list[Stroke] = []
    for one in done:
        if abs(one.ends - one.begins) < RINGING * longest:
            continue
        last = found[-1] if found else None
        if last is None or (one.ends - one.begins) * (last.ends - last.begins) < 0:
            found.append(one)
            continue
        found[-1] = Stroke(
            last.start, last.begins, one.end, one.ends, max(last.fastest, one.fastest), min(last.lowest, one.lowest),
            max(last.highest, one.highest),
        )  # fmt: skip
    return found


@dataclass
class Trace:
    """Record of a motion: its strokes, and rows of time, error, measured velocity, controller force, further values."""

    rows: list[Array] = field(default_factory=list)
    strokes: list[Stroke] = field(default_factory=list)


class Motion:
    """A motion from rest at position 0 under a target.

    Parameters
    ----------
    plant : Plant
    segments : Segments
        Motion of the target, in one lane, to the end of the motion.
    rtol : float
        Relative error allowed per step with nonlinear friction.
    besides : sequence of ndarray (width,)
        Rows of further values that are recorded.

    Attributes
    ----------
    changes : int
        Changes of the target that are still to come.
    """

    def __init__(self, plant: Plant, segments: Segments, rtol: float, besides: Sequence[Array] = ()) -> None:
        self.plant, self.segments = plant, segments
        self.state = np.zeros(plant.width)
        self.state[-1] = 1.0
        self.time, self.trace, self.steps, self.fastest, self.farthest = 0.0, Trace(), 0, 0.0, 0.0
        gain, steady = plant.gains[0][0], float(np.abs(plant.force).sum())
        self.largest_load = steady + abs(gain) * _reach(segments)
        loads = steady + sum(friction_at_rest(one, steady) for one in plant.contacts)
        self.expected = loads / gain if gain else 0.0
        self.mode = HeldMode((0,) * len(plant.contacts), (1,) * sum(len(one.loads) for one in plant.contacts))
        self.pieces: dict[tuple[HeldMode, float], HeldPiece] = {}
        self.acceleration = 0.0
        self.changes = len(segments.end[0])
        self.exact = not any(one.curved for one in plant.contacts)
        self.still = STILL if self.exact else max(STILL, STILL_ERROR * rtol)
        self._exact_steps = ExactSteps()
        self._bristle_steps = BristleSteps(plant, rtol, natural_sizes(plant, self.largest_load))
        self.sampled = plant.limits.sample_time is not None
        self.core = CompiledMotion(plant, self._bristle_steps)
        self.fresh: frozenset[tuple[str, int]] = frozenset()
        self.at_once = 0
        self.watched = np.array([plant.error(), plant.row(None, plant.places[0]), plant.row(), *besides])

    # -- the run

    def run(self) -> Iterator[Stroke | None]:
        """Advance to the end of the target's segments; after each step, yield the stroke that has ended, or None."""
        spans = zip(
            self.segments.end[0], self.segments.jump[0], self.segments.value[0, :, 0], self.segments.slope[0, :, 0],
            strict=True,
        )  # fmt: skip
        n = self.plant.size
        for end, jump, velocity, slope in spans:
            self.changes -= 1
            self.core.control[Control.CONSTANT] = 0.0  # no sample has measured the new target yet
            self.state[2 * n + 1] += jump
            self.expected = max(self.expected, abs(self.state[2 * n + 1]))
            self.state[2 * n + 2] = velocity
            self.acceleration = float(slope)
            self._placed()
            yield None
            while self.time < end:
                yield from self._to(float(end))

    def table(self) -> Array:
        """Recorded values so far (times, 4 or more): time, error, measured velocity, force and further values."""
        self.watched[2] = self._piece().force
        now = np.array([[self.time, *(self.watched @ self.state)]])
        kept = [*self.trace.rows, *([now] if self.time > 0 else [])]
        return np.concatenate(kept) if kept else np.zeros((0, 1 + len(self.watched)))

    def _to(self, end: float) -> Iterator[Stroke | None]:
        """Advance towards `end` (s): by the compiled core until the mode may change, then by a step or to a sample."""
        piece = self._piece()
        if self.sampled or not piece.linear or (piece.fastest > 0 and not self.fresh):
            end = self._follow(end)
            yield None
        while self.time < end:
            yield self._step(end)
            if not self.sampled:
                break

    def _follow(self, end: float) -> float:
        """Advance in this mode by the compiled core; returns the time (s) up to which single steps are needed."""
        clock, strokes = self.core.clock, self.trace.strokes
        last = strokes[-1] if strokes else Stroke(0.0, 0.0)
        rests = self.sampled and not any(self.mode.contacts)
        since = last.end if np.isfinite(last.end) else 0.0
        if not self._piece().linear:
            self._bristle_steps.begin(self._piece(), self.state)
        clock[[Held.TIME, Held.END, Held.RESTS, Held.SINCE]] = self.time, end, rests, since
        clock[[Held.LOWEST, Held.HIGHEST, Held.FASTEST]] = last.lowest, last.highest, last.fastest
        clock[[Held.STILL, Held.PACE, Held.FAR]] = self.still, self._pace, self._far
        self.watched[2] = self._piece().force
        may_switch, rows = self.core.follow(self._piece(), self.watched, self.state, bool(self.fresh))
        if len(rows):
            self.trace.rows.append(rows.copy())
        if self.time < clock[Held.TIME]:
            self.time, self.at_once = float(clock[Held.TIME]), 0
            if strokes:
                self._widen(*clock[[Held.LOWEST, Held.HIGHEST, Held.FASTEST]])
        if clock[Held.CHANGED] and may_switch:
            clock[Held.CHANGED] = 0.0
            self._placed()
        return float(clock[Held.STOP]) if may_switch else self.time

    def _piece(self) -> HeldPiece:
        key = (self.mode, self.acceleration)
        if key not in self.pieces:
            self.pieces[key] = HeldPiece(self.plant, *key, LEAST_LOAD * self.largest_load)
        return self.pieces[key]

    @property
    def _stepper(self) -> ExactSteps | BristleSteps:
        return self._exact_steps if self._piece().linear else self._bristle_steps

    def _step(self, end: float) -> Stroke | None:
        """Take one step, at most to the next switch or to `end` (s); returns the stroke that it completes, or None."""
        piece, stepper = self._piece(), self._stepper
        length, coefficients = stepper.step(piece, self.state, end - self.time)
        self.steps += 1
        rows, switches = piece.guards
        guards = rows @ coefficients.T
        fresh = np.array([(one.name, one.number) in self.fresh for one in switches], dtype=bool)
        noise = stepper.noise(piece, rows, coefficients, length) if fresh.any() else np.zeros((len(rows), 3))
        begun = [
            one.name == "contact" and bool(self.mode.contacts[one.number]) and not self.plant.contacts[one.number].slow
            for one in switches
        ]
        noise[np.array(begun, dtype=bool) & fresh, 0] = np.inf  # a slip rate that is 0 except for rounding
        crossed = first_crossing(guards, fresh, noise) if len(rows) else None
        share = 1.0 if crossed is None else crossed[0]
        if share > 0:
            self._record(coefficients, length, share)
            self.fresh = frozenset()
        before, self.time = self.time, self.time + share * length
        if self.time > before:
            self.at_once = 0
        if crossed is None:
            self.state = coefficients.sum(axis=0)
            if self.time + 1e-15 * abs(end) >= end:
                self.time = end
            return None
        self.state = stepper.until(piece, self.state, coefficients, length, share)
        self.at_once += 1
        if self.at_once > AT_ONCE:
            raise NotAvailable(
                f"contacts switched between rest and sliding {AT_ONCE} times at one instant, so that the motion is "
                "not determined; try a friction law with bristles, law = 'lugre'"
            )
        return self._switched(switches[crossed[1]])

    # -- switches

    def _switched(self, switch: Switch) -> Stroke | None:
        """Change the mode by a switch; returns the stroke that ends thereby, or None."""
        moved = any(self.mode.contacts)
        self.fresh |= {(switch.name, switch.number)}
        self.mode = self.mode.switched(switch)
        if switch.name == "contact" and not self.plant.contacts[switch.number].slow:
            self._stop(switch.number)
            self._settle_contacts()
        return self._stroke(moved)

    def _stop(self, index: int) -> None:
        """Set the slip rate of a contact to exactly 0 by the smallest possible change of momentum."""
        contact, n = self.plant.contacts[index], self.plant.size
        slip = float(self.plant.slip(contact) @ self.state)
        share = contact.row / self.plant.inertia
        self.state[n : 2 * n] -= share * (slip / float(contact.row @ share))

    def _settle_contacts(self) -> None:
        """Switch those contacts to sliding that would need more than the largest static friction to stay at rest."""
        for _ in self.plant.contacts:
            piece = self._piece()
            forces = {i: float(row @ self.state) for i, row in piece.resting.items()}
            excess = {i: _excess(abs(force), float(piece.rest(i) @ self.state)) for i, force in forces.items()}
            worst = max(excess, key=excess.__getitem__, default=None)
            if worst is None or excess[worst] <= BEYOND:
                return
            self._stop(worst)  # the slip rate of contact `worst` is zero only up to rounding
            self.mode = self.mode.switched(Switch("contact", worst, 1 if forces[worst] > 0 else -1))
            self.fresh |= {("contact", worst)}

    def _placed(self) -> None:
        """Determine the mode anew after a jump of the target or of the force."""
        plant, limits, moved = self.plant, self.plant.limits, any(self.mode.contacts)
        if not self.sampled:
            if limits.dead_band is not None:
                self.mode = self.mode.switched(_side("band", float(plant.error() @ self.state), limits.dead_band))
            if limits.integral is not None and plant.integral:
                held, grows = plant.integral * self.state[2 * plant.size], float(self._piece().banded @ self.state)
                side = int(np.sign(held)) if abs(held) >= limits.integral and held * grows > 0 else 0
                self.mode = self.mode.switched(Switch("clamp", 0, side))
            if limits.force is not None:
                wanted = float(self._piece().wanted @ self.state)
                self.mode = self.mode.switched(_side("limit", wanted, limits.force))
        for i, (_, pull) in enumerate(self._piece().pulls):
            if (now := float(pull @ self.state)) * self.mode.loads[i] < 0:
                self.mode = self.mode.switched(Switch("load", i, int(np.sign(now))))
        self._settle_contacts()
        self._stroke(moved)

    # -- recording

    def _stroke(self, moved: bool) -> Stroke | None:
        """Begin or end a stroke if contacts have started or stopped sliding; returns the stroke that ended, or None."""
        moves, strokes = any(self.mode.contacts), self.trace.strokes
        error = float(self.watched[0] @ self.state)
        if moves and not moved:
            strokes.append(Stroke(self.time, error))
        elif moved and not moves:
            strokes[-1].end, strokes[-1].ends = self.time, error
            return strokes[-1]
        return None

    def _record(self, coefficients: Array, length: float, share: float) -> None:
        self.watched[2] = self._piece().force
        degrees = np.arange(len(coefficients))
        values = (self.watched @ coefficients.T * share**degrees) @ POWERS[: len(coefficients)]
        self._keep(self.time + share * length * NODES, values)

    def _keep(self, times: Array, values: Array) -> None:
        """Record values (rows, nodes) of a step at its times, and the extremes of the stroke."""
        self.trace.rows.append(np.array([times[KEPT], *values[:, KEPT]]).T)
        if self.trace.strokes:
            self._widen(_least(values[0]), -_least(-values[0]), -_least(-np.abs(values[1])))

    def _widen(self, lowest: float, highest: float, fastest: float) -> None:
        """Extend the extremes of the last stroke and of the motion."""
        last = self.trace.strokes[-1]
        last.lowest, last.highest = min(last.lowest, float(lowest)), max(last.highest, float(highest))
        last.fastest = max(last.fastest, float(fastest))
        self.fastest = max(self.fastest, last.fastest)
        self.farthest = max(self.farthest, last.highest, -last.lowest)

    @property
    def _far(self) -> float:
        """Error (m or rad) above which it grows for ever; infinite if no friction, load or target sets a scale."""
        far = AWAY * max(self.expected, abs(float(self.state[2 * self.plant.size + 1])))
        return far or np.inf

    @property
    def _pace(self) -> float:
        """Scale of speed (m/s or rad/s): the largest speed so far, or the speed scale of bristles."""
        return max([self.fastest, *(one.slow for one in self.plant.contacts)])

    @property
    def runs_away(self) -> bool:
        """True if the error has become so large that it will grow for ever."""
        return self._far < self.farthest

    @property
    def at_rest(self) -> bool:
        """True if all speeds are zero and the controller's integral is constant, or winds up behind a force limit.

        An ever slower approach to the target, in sliding or with bristles, counts as rest once the error is below
        `STILL` of the largest.
        """
        n = self.plant.size
        if self.state[2 * n + 2] or self.acceleration or (any(self.mode.contacts) and self.plant.memory):
            return False
        if self.sampled and not (self.core.constant and not any(self.mode.contacts)):
            return False
        pace = self.still * self._pace
        if np.any(np.abs(self.state[n : 2 * n]) > pace):
            return False
        rates = self._stepper.rate(self._piece(), self.state)
        moves = any(self.mode.contacts) or bool(self.plant.memory)  # bristles bend at any force
        if moves and np.any(np.abs(rates[n : 2 * n]) > pace * self._stepper.fastest(self._piece(), self.state)):
            return False
        if self.sampled:
            return True
        winds_up = self.mode.limit * float(self._piece().wanted @ rates) > 0  # if so, the force stays at its limit
        return winds_up or bool(abs(rates[2 * n]) <= (self.still * self.farthest if moves else 0.0))


def _side(name: str, value: float, bound: float) -> Switch:
    return Switch(name, 0, int(np.sign(value)) if abs(value) > bound else 0)


def _least(values: Array) -> float:
    """Minimum of a smooth function from evenly spaced values, by a parabola through the least and its neighbours."""
    i = int(np.argmin(values))
    if not 0 < i < len(values) - 1:
        return float(values[i])
    before, here, after = values[i - 1 : i + 2]
    bend = before + after - 2 * here
    return float(here - (after - before) ** 2 / (8 * bend)) if bend > 0 else float(here)


def _excess(force: float, most: float) -> float:
    """Relative excess of a force over the largest static friction `most`; infinite where that is 0."""
    return force / most - 1.0 if most > 0 else (np.inf if force > 0 else -1.0)


def _reach(segments: Segments) -> float:
    """Path length (m or rad) of the target over all segments but the last, which may have no end."""
    rates = np.abs(segments.value[0, :-1, 0]) * (segments.end - segments.start)[0, :-1]
    return float(np.abs(segments.jump[0]).sum() + rates.sum())


def natural_sizes(plant: Plant, pull: float) -> Array:
    """Smallest sizes (width,) of the variables for error control; used with nonlinear friction only.

    `pull` is the size of the loads (N, or Pa) that may act on contacts besides their preload.
    """
    found = np.full(plant.width, 1.0)
    n = plant.size
    friction, speed = 0.0, 0.0
    place = 2 * n + 4
    for one in plant.contacts:
        if not one.slow:
            friction = max(friction, friction_at_rest(one, pull))
            continue
        law, normal = one.port.friction, largest_normal(one, pull)
        memory = [float(value) for value in law.steady_memory(one.slow, normal)]
        found[place : place + len(memory)] = np.abs(memory)
        place += len(memory)
        friction = max(friction, float(one.port.area * law.steady_strength(one.slow, normal)))
        speed = max(speed, one.slow)
    stiff = plant.gains[0][0] + float(np.max(np.diag(plant.stiffness)))
    if not friction:  # without normal force: from the largest deflection of bristles
        friction = (stiff or 1.0) * float(np.max(found[2 * n + 4 : place], initial=0.0)) or 1.0
    found[:n] = found[2 * n + 1] = far = friction / stiff if stiff else 1.0
    speed = speed or float(np.sqrt(friction * far / plant.inertia.max()))  # speed gained over the distance `far`
    found[n : 2 * n] = found[2 * n + 2] = speed
    found[2 * n] = friction / plant.integral if plant.integral else 1.0
    found[2 * n + 3] = friction
    return found


def largest_normal(contact: HeldContact, pull: float) -> float:
    """Largest normal stress (Pa, or N) of a contact with loads of a size `pull` (N, or Pa)."""
    shares = sum(max(one.forward, one.back) for one in contact.loads)
    return contact.normal + pull * shares / float(contact.port.area)


def friction_at_rest(contact: HeldContact, pull: float) -> float:
    """Largest friction force at rest (N, or Pa) with loads of a size `pull`; with bristles that of slow sliding."""
    if not contact.slow:
        return contact.rest + pull * float(sum(one.rest * max(one.forward, one.back) for one in contact.loads))
    slow = contact.slow * 1e-6  # far below the velocity above which friction depends on velocity
    return float(contact.port.area * contact.port.friction.steady_strength(slow, largest_normal(contact, pull)))
