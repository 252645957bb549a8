"""One cycle, and one at which a branch of them changes: what is known of each."""

from __future__ import annotations

from dataclasses import dataclass, field

from steadyslip.core.pages import Displayed
from steadyslip.nonlinear.orbits.shooting import Orbit

UNITS = {"period": "s", "peak_velocity": "m/s", "lowest_velocity": "m/s", "amplitude": "1", "stress_drop": "Pa",
         "lowest_normal_stress": "Pa", "highest_normal_stress": "Pa", "slip": "m", "growth": "1"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Cycle(Displayed):
    """One periodic motion.

    Attributes
    ----------
    value : float
        Of the parameter, SI units.
    period : float
        s.
    peak_velocity, lowest_velocity : float
        m/s, located.
    amplitude : float
        Half of ln(peak velocity/lowest velocity); infinite where the block stops or turns round.
    stress_drop : float
        Highest less lowest spring stress, Pa.
    lowest_normal_stress, highest_normal_stress : float
        Pa.
    multipliers : tuple of complex
        Floquet multipliers by falling size, the trivial one (1) left out.
    trivial : float
        The one that should be 1; its distance from 1 is a measure of precision.
    stable : bool
        Whether the cycle attracts: all multipliers inside the unit circle.
    start : dict of str to float
        State where the block, speeding up, is as fast as the load point: x, v and memory, SI units, for
        ``simulate(rig, initial=...)``.
    """

    value: float
    period: float
    peak_velocity: float
    lowest_velocity: float
    amplitude: float
    stress_drop: float
    lowest_normal_stress: float
    highest_normal_stress: float
    multipliers: tuple[complex, ...]
    trivial: float
    stable: bool
    start: dict[str, float]
    _orbit: Orbit | None = field(default=None, repr=False)

    @property
    def growth(self) -> float:
        """Size of the largest multiplier: factor by which a small deviation grows in one period."""
        return max((abs(m) for m in self.multipliers), default=0.0)

    @property
    def slip(self) -> float:
        """Slip per period, m: the load point's advance."""
        return self.start["v"] * self.period


@dataclass(frozen=True, eq=False)
class SpecialCycle(Displayed):
    """A cycle at which the branch changes.

    Attributes
    ----------
    kind : str
        ``fold``, ``period doubling``, ``torus`` or ``range`` (the end of the range asked for).
    cycle : Cycle
    bracket : tuple of float
        Values of the parameter on both sides (at a fold: of neighbouring cycles).
    precision : float
        Estimated error of the parameter's value there, relative.
    index : int
        Place in the branch: it lies before the cycle of this number.
    """

    kind: str
    cycle: Cycle
    bracket: tuple[float, float]
    precision: float
    index: int = 0
