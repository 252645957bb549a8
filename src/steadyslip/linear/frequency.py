"""Transfer functions of the linearised rig at given periods, and its resonances."""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.linear.receptance import receptance
from steadyslip.linear.state_space import state_matrices
from steadyslip.linear.stiffness import eigenvalues
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point

# Chosen by trial: computing time against missed resonances.
PLACES = 200  # number of periods, evenly spaced in their logarithm, at which the gain is computed
PROMINENCE = 0.01  # least rise of ln(gain) above the minima on both sides of a resonance
BESIDE = np.linspace(-8, 8, 33)  # further periods, near each mode: distances from its period, in widths of its peak
SHARPNESS = 1e-5  # tolerance of a resonance's period, relative to the spacing of neighbouring periods


def transfer(rig: Slider | Machine, input: str, output: str, periods: Array) -> Array:
    """Complex transfer function G(iω) from an input to an observable at the given periods (s), in SI units."""
    return _TransferFunction(rig, input, output)(periods)


class _TransferFunction:
    """Transfer function G(iω) = C(iω − A)⁻¹B + D of `steadyslip.state_space`.

    With delays there are no such matrices, and `receptance` is used.
    """

    def __init__(self, rig: Slider | Machine, input: str, output: str) -> None:
        self.point, self.names = operating_point(rig), ((output,), (input,))
        self.late = bool(self.point.model.delays)
        self.blocks = None if self.late else state_matrices(rig, *self.names).blocks()
        self.rig = rig

    def __call__(self, periods: Array) -> Array:
        swing = 2 * np.pi / np.asarray(periods)
        if self.blocks is None:
            return np.asarray(receptance(self.point, swing, *self.names)[:, 0, 0])
        a, b, c, d = self.blocks
        pushed = np.broadcast_to(b, (len(swing), *b.shape))
        inner = np.linalg.solve(1j * swing[:, None, None] * np.eye(len(a)) - a, pushed)
        return np.asarray((c @ inner + d)[:, 0, 0])

    def modes(self) -> Array:
        """Eigenvalues (1/s), (n,); with delays the rightmost ones only."""
        return np.asarray(eigenvalues(self.rig) if self.blocks is None else np.linalg.eigvals(self.blocks[0]))


def resonances(rig: Slider | Machine, input: str, output: str, shortest: float, longest: float) -> Array:
    """Resonances in a range of periods (s), the largest gain first.

    Rows (r, 3) are period (s), gain and phase (degrees).

    The search covers a fine grid and the neighbourhood of every mode's period, so that no lightly damped mode is
    missed.
    """
    from scipy.optimize import minimize_scalar  # slow to import
    from scipy.signal import find_peaks

    answer = _TransferFunction(rig, input, output)
    values = answer.modes()
    swinging = values[values.imag > 0]
    near = 2 * np.pi / swinging.imag * (1 + np.outer(BESIDE, np.abs(swinging.real) / np.abs(swinging)))
    within = near[(near > shortest) & (near < longest)]
    tried = np.unique(np.log(np.concatenate([np.geomspace(shortest, longest, PLACES), within])))

    def lowered(log_period: float) -> float:
        return -float(np.abs(answer(np.exp([log_period])))[0])

    gain = np.abs(answer(np.exp(tried)))
    highest, _ = find_peaks(np.log(np.maximum(gain, np.finfo(float).tiny)), prominence=PROMINENCE)
    found = [
        minimize_scalar(lowered, bounds=(low, high), options={"xatol": SHARPNESS * (high - low)}).x
        for low, high in zip(tried[highest - 1], tried[highest + 1], strict=True)
    ]
    periods = np.exp(found)
    answers = answer(periods) if found else np.empty(0, dtype=complex)
    rows = np.column_stack([periods, np.abs(answers), np.degrees(np.angle(answers))])
    return rows[np.argsort(-rows[:, 1])]
