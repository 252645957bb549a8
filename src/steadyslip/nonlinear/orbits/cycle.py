"""Result types of cycles: `Cycle`, `CycleRange` per contact, `SpecialCycle` (bifurcation), `End` of a branch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from steadyslip.core.checks import Check, check
from steadyslip.core.pages import Displayed
from steadyslip.machine.rig import Rig
from steadyslip.nonlinear.orbits.shooting import Orbit

UNITS = {"period": "s", "peak_velocity": "m/s", "lowest_velocity": "m/s", "amplitude": "1", "stress_drop": "Pa",
         "lowest_normal_stress": "Pa", "highest_normal_stress": "Pa", "slip": "m", "growth": "1"}  # fmt: skip


RANGE_UNITS = {"peak_velocity": "m/s", "lowest_velocity": "m/s", "amplitude": "1", "force_drop": "N",
               "lowest_normal_force": "N", "highest_normal_force": "N"}  # fmt: skip


def quantities(rig: Rig) -> dict[str, tuple[str, str]]:
    """Attribute and SI unit of each quantity of a cycle, by its public name; stresses become forces for a machine."""
    return {rig.result_name(name): (name, rig.result_unit(unit)) for name, unit in UNITS.items()}


OPEN = 1e-4  # largest allowed closing error, as a share of the cycle's size; Newton's method leaves a tenth of it
IMPRECISE = 1e-3  # error of the trivial multiplier beyond which a cycle is rejected
RETURNED = 1e-5  # a cycle attracts if states of a simulated motion one period apart differ by less than this
ALIKE = 1e-6  # two cycles are the same if they differ by less than this (relative); Newton's method leaves less
UNCERTAIN = 3.0  # errors of other multipliers are assumed to be up to this multiple of that of the trivial multiplier


@dataclass(frozen=True)
class CycleRange(Displayed):
    """Extremes of slip rate and forces at one contact of a machine over a cycle.

    Attributes
    ----------
    peak_velocity, lowest_velocity : float
        Extreme slip rates, m/s.
    amplitude : float
        Half of ln(peak velocity/lowest velocity); infinite where slip stops or reverses.
    force_drop : float
        Highest minus lowest pull at the contact, N.
    lowest_normal_force, highest_normal_force : float
        Extreme normal forces, N.
    """

    peak_velocity: float
    lowest_velocity: float
    amplitude: float
    force_drop: float
    lowest_normal_force: float
    highest_normal_force: float


@dataclass(frozen=True, eq=False)
class Cycle(Displayed):
    """One periodic motion; for a machine velocities and stresses (as forces) are those at `contact`.

    Attributes
    ----------
    value : float
        Value of the parameter, SI units.
    period : float
        s.
    peak_velocity, lowest_velocity : float
        Extreme slip rates, m/s, located as events.
    amplitude : float
        Half of ln(peak velocity/lowest velocity); infinite where the block stops or reverses.
    stress_drop : float
        Highest minus lowest spring stress in a period, Pa. The `stress_drop` of a `SlipEvent` counts only until the
        block first rests, and is smaller if later ringing reaches a lower stress.
    lowest_normal_stress, highest_normal_stress : float
        Extreme normal stresses, Pa.
    multipliers : tuple of complex
        Floquet multipliers by falling size, the trivial one (1) left out.
    trivial : float
        Computed multiplier along the motion, in theory 1; its distance from 1 is a measure of precision.
    stable : bool
        True if the cycle attracts: all multipliers inside the unit circle.
    start : dict of str to float
        State at which the block, accelerating, is as fast as the load point: x, memory and, with mass, v, SI units, for
        ``simulate(rig, initial=...)``. For a machine: the state at which `contact` slips as fast as in steady sliding.
    speed : float
        Slip rate in steady sliding, m/s.
    contact : str
        For a machine: the contact to which start and numbers of the cycle refer; else empty.
    contacts : dict of str to CycleRange
        For a machine: extremes at each contact, by name.
    closing : float
        Closing error: distance between start and end of one period, integrated without sensitivities, as a share of
        the cycle's size (logarithms of large states, multiples of natural sizes of small ones); or the error of the
        period, as a share of it, if that is more.
    returned : float
        For a cycle found by simulation: largest distance between states one period apart in the last two simulated
        periods, measured as `closing` is; else NaN.
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
    speed: float
    contact: str = ""
    contacts: Mapping[str, CycleRange] = field(default_factory=dict)
    closing: float = 0.0
    returned: float = math.nan
    _orbit: Orbit | None = field(default=None, repr=False)

    @property
    def growth(self) -> float:
        """Size of the largest multiplier: factor by which a small deviation grows in one period."""
        return max((abs(m) for m in self.multipliers), default=0.0)

    @property
    def multiplier_error(self) -> float:
        """Estimated relative error of the multipliers: the distance from 1 of the multiplier along the motion."""
        return abs(self.trivial - 1)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks that the motion closes after a period, and that the largest multiplier clearly differs from 1."""
        room = abs(self.growth - 1) / (UNCERTAIN * self.growth) if self.growth else IMPRECISE
        stability = check(
            "its stability", "the multiplier along the motion is 1", self.multiplier_error, min(IMPRECISE, room)
        )
        if self.stable and not stability.passed and math.isfinite(self.returned):
            stability = check("its stability", "the motion that led to it came back", self.returned, RETURNED)
        return check("the cycle", "closing by an integration of the motion alone", self.closing, OPEN), stability

    def is_like(self, other: Cycle) -> bool:
        """True if period and extreme velocities agree with those of another cycle within `ALIKE`."""
        mine, its = ((one.period, one.peak_velocity, one.lowest_velocity) for one in (self, other))
        return all(math.isclose(a, b, rel_tol=ALIKE) for a, b in zip(mine, its, strict=True))

    @property
    def slip(self) -> float:
        """Slip per period, m: the load point's advance."""
        return self.speed * self.period


@dataclass(frozen=True, eq=False)
class SpecialCycle(Displayed):
    """A cycle at a bifurcation of the branch: fold, period doubling, torus or branch point.

    Attributes
    ----------
    kind : str
        ``fold``, ``period doubling``, ``torus``, or ``branch point`` (a multiplier passes 1 without a fold).
    cycle : Cycle
    bracket : tuple of float
        Values of the parameter on both sides; at a fold, values of the neighbouring cycles.
    precision : float
        Estimated relative error of the parameter's value at the bifurcation.
    index : int
        Index of the branch's cycle that follows it.
    """

    kind: str
    cycle: Cycle
    bracket: tuple[float, float]
    precision: float
    index: int = 0
    _length: float = field(default=0.0, repr=False)


@dataclass(frozen=True, eq=False)
class End:
    """End of a continuous part of a branch.

    Attributes
    ----------
    kind : str
        ``onset``, ``edge`` (another edge of stability, at which cycles shrink to steady sliding), ``period doubling``,
        ``range`` (limit of the parameter), or ``last cycle`` (that could be followed, or that simulation found).
    value : float
        Value of the parameter, SI units.
    cycle : Cycle or None
        The cycle at the end; None if that is steady sliding.
    """

    kind: str
    value: float
    cycle: Cycle | None = None
