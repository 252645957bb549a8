"""Motion within one mode by the compiled core."""

from __future__ import annotations

import math

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.kernels.driver.holding import NODES
from steadyslip.kernels.layout import Control, Held, Turn
from steadyslip.nonlinear.hunting.bristles import TOO_SHORT, Bristles
from steadyslip.nonlinear.hunting.held_modes import HeldPiece
from steadyslip.nonlinear.hunting.plant import Array, Plant
from steadyslip.nonlinear.hunting.steps import passage

AT_ONCE = 4096  # limit of steps in one call of the compiled core: some ten milliseconds
NONE = np.zeros((0, 2)), np.zeros((0, 0, 0))  # step lengths and passage matrices of a new piece: none
FEW = 0.25  # largest phase (rad) of the fastest mode between two recorded values


class CompiledMotion:
    """Motion of a plant within one mode, by `steadyslip.kernels.driver.holding`, and the state of its controller.

    Parameters
    ----------
    plant : Plant
    bristles : Bristles

    Attributes
    ----------
    clock, control : ndarray
        See `steadyslip.kernels.layout.Held` and `Control`.
    """

    def __init__(self, plant: Plant, bristles: Bristles) -> None:
        limits = plant.limits
        self.plant, self.bristles = plant, bristles
        self.clock, self.control = bristles.clock, np.zeros(Control.SIZE)
        settings = {
            Control.PERIOD: limits.sample_time or 0.0, Control.RESOLUTION: limits.resolution or 0.0,
            Control.DELAY: plant.delay, Control.ON_MEASUREMENT: limits.on_measurement,
            Control.BAND: limits.dead_band or 0.0, Control.BANDS_RATE: plant.bands_rate,
            Control.OF_INTEGRAL: limits.of_integral, Control.INTEGRAL: plant.integral,
            Control.MOST_INTEGRAL: math.inf if limits.integral is None else limits.integral,
            Control.MOST_FORCE: math.inf if limits.force is None else limits.force,
            Control.ROUNDED: sum(np.array_equal(place, plant.places[0]) for place in plant.places),
        }  # fmt: skip
        self.control[list(settings)] = [float(value) for value in settings.values()]
        self.loops = np.array([[*gains, 0.0, *place] for gains, place in zip(plant.gains, plant.places, strict=True)])
        self.late = np.zeros((3 + (math.ceil(plant.delay / self.period) if self.period else 0), 2))
        self.passages: dict[HeldPiece, tuple[Array, Array]] = {}

    @property
    def period(self) -> float:
        """Sample time (s) of the controller; 0 if it is not sampled."""
        return float(self.control[Control.PERIOD])

    @property
    def constant(self) -> bool:
        """True if the last sample changed neither integral nor force."""
        return bool(self.control[Control.CONSTANT])

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return int(self.clock[Held.STEPS])

    def follow(self, piece: HeldPiece, watched: Array, state: Array, fresh: bool) -> tuple[bool, Array]:
        """Advance the state (in place) to `Held.END`, or until the mode may change or `AT_ONCE` steps are taken.

        Parameters
        ----------
        piece : HeldPiece
        watched : ndarray (values, width)
            Rows of error, speed and force, and of errors of other bodies.
        state : ndarray (width,)
        fresh : bool
            True to take only the sample that is due.

        Returns
        -------
        bool
            True if the mode may change before `Held.STOP`: the end, or the next sample or change of force.
        ndarray (times, 1 + values)
            Recorded times (s) and values of `watched`.
        """
        clock, bristles = self.clock, self.bristles
        guards, _ = piece.guards
        if piece.linear and not (self.period or piece in self.passages):
            self._add(piece, watched, 1.0 / piece.fastest)
        clock[Held.EVERY] = self._every(piece)
        clock[Held.ROWS], clock[Held.MOST_STEPS] = 0, clock[Held.STEPS] + AT_ONCE
        lengths, passages = self.passages.get(piece, NONE)
        parts = int(lengths[:, 1].max(initial=1))
        rows = np.empty(((AT_ONCE + parts) * (1 + (NODES - 1) // int(clock[Held.EVERY])), 1 + len(watched)))
        turn = bristles.code.follow_held(
            *bristles.arrays, piece.matrix, *bristles.maps(piece), bristles.scale, guards, watched, lengths, passages,
            self.loops, self.late, state, clock, self.control, rows, int(fresh),
        )  # fmt: skip
        if turn == Turn.STUCK:
            raise NotAvailable(TOO_SHORT)
        if turn == Turn.LENGTH:
            self._add(piece, watched, float(clock[Held.STOP] - clock[Held.TIME]))
        return turn == Turn.STEP, rows[: int(clock[Held.ROWS])]

    def _every(self, piece: HeldPiece) -> int:
        """Number of nodes of a step between two recorded values; the whole step where its ends are enough."""
        if self.clock[Held.RESTS]:
            return NODES - 1
        if not (piece.linear and self.period):
            return (NODES - 1) // 4
        turned = piece.fastest * self.period
        return (NODES - 1) // (1 if turned <= FEW else 2 if turned <= 2 * FEW else 4)

    def _add(self, piece: HeldPiece, watched: Array, length: float) -> None:
        """Compute the passage matrix for steps of a given length (s), and store it for the piece."""
        lengths, passages = self.passages.get(piece, NONE)
        parts = max(1, math.ceil(piece.fastest * length))
        found = passage(piece, watched, length / parts)
        self.passages[piece] = np.vstack([lengths, [length, parts]]), np.array([*passages, found])
