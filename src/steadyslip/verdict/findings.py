"""What an analysis found, as one frozen data class, from which texts, JSON and figures are made."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from steadyslip.core.checks import Check
from steadyslip.core.pages import Displayed
from steadyslip.linear.boundary import Margin
from steadyslip.linear.mode_origin import Origin
from steadyslip.linear.modes import Mode
from steadyslip.linear.search import Boundary
from steadyslip.nonlinear.onset.hopf import Onset

if TYPE_CHECKING:
    from steadyslip.nonlinear.kicks.threshold import Threshold


@dataclass(frozen=True, repr=False)
class Findings(Displayed):
    """Verdict on one rig, a slider or a machine; printing it gives the verdict in words.

    Attributes
    ----------
    rig : Slider or Machine
    stable : bool or None
        Whether small disturbances of steady sliding die out; None if steady sliding does not exist.
    reason : str
        Why, in one sentence; of a machine without steady sliding, which contact locks up or lifts off.
    steady : SteadySliding, SteadyMachine or None
    eigenvalues : tuple of complex
        1/s, by falling real part; with a delay the rightmost.
    characteristic_polynomial, routh : tuple of float
        Coefficients, lowest power first (theory 3: a0, a1, ...); first column of the Routh array, stable if all are
        positive. Empty with a delay, for then it is none, and where equations are matrices.
    characteristic_terms : tuple of (float, tuple of float)
        With a delay: delays (s) and the polynomials that stand before exp(−s delay), that without delay first.
    unstable_roots : int or None
        With a delay, or a structure given by its measured response: how many eigenvalues grow.
    growth_rate : float or None
        Largest real part (1/s), inf if ill-posed.
    period : float or None
        Of the least damped oscillation (s).
    damping_ratio : float or None
        Of that oscillation; negative if it grows.
    time_to_halve, time_to_double : float or None
        Of the slowest decay, or of the fastest growth (s).
    on_edge : bool
        Whether the rig is on the edge of stability to within rounding: then neither verdict should be relied on.
    undamped : bool
        Whether nothing damps a machine, its friction included: then no disturbance dies out, and edges are of growth.
    margins : tuple of Margin
        Distance of each parameter to its nearest edge, the most critical first.
    onset : Onset or None
        Kind of onset at the nearest oscillatory edge: of a slider in stiffness, of a machine in any parameter.
    kicks : tuple of Threshold
        Smallest kicks that are not survived, where asked for.
    critical_stiffness : float or None
        Of a slider: edge of the stable set nearest to its own stiffness (Pa/m along the sliding direction).
    critical_side : str or None
        ``above`` or ``below``: where, next to that edge, sliding is stable.
    critical_angular_frequency : float or None
        Of the oscillation at the critical stiffness (rad/s), 0 if it does not oscillate.
    critical_axial_stiffness : float or None
        The same edge as stiffness along the axis of spring, rod or press, where the rig gives one (Pa/m).
    stable_stiffness : tuple of (float, float)
        Of a slider: all stable stiffnesses k > 0 as open intervals (Pa/m); the upper end may be inf.
    mode : Mode or None
        How a machine moves in the mode that grows fastest, or decays slowest.
    origin : Origin or None
        Why that mode grows: what feeds it, and which modes couple. None if it is no oscillation that grows.
    branch : int
        Which steady sliding is judged.
    warnings : tuple of str
    checks : tuple of Check
        The second question that was asked of each number. What failed is left out; a verdict that failed has
        ``stable = None`` and a reason that begins with ``not decided``.
    """

    rig: Any
    stable: bool | None
    reason: str = ""
    margins: tuple[Margin, ...] = ()
    steady: Any = None  # SteadySliding of a slider, SteadyMachine of a machine
    warnings: tuple[str, ...] = ()
    eigenvalues: tuple[complex, ...] = ()
    characteristic_polynomial: tuple[float, ...] = ()
    routh: tuple[float, ...] = ()
    growth_rate: float | None = None
    period: float | None = None
    damping_ratio: float | None = None
    time_to_halve: float | None = None
    time_to_double: float | None = None
    on_edge: bool = False
    undamped: bool = False
    characteristic_terms: tuple[tuple[float, tuple[float, ...]], ...] = ()
    unstable_roots: int | None = None
    checks: tuple[Check, ...] = ()
    onset: Onset | None = None
    kicks: tuple[Threshold, ...] = ()
    critical_stiffness: float | None = None
    critical_side: str | None = None
    critical_angular_frequency: float | None = None
    critical_axial_stiffness: float | None = None
    stable_stiffness: tuple[tuple[float, float], ...] = ()
    mode: Mode | None = None
    origin: Origin | None = None
    branch: int = 0
    version: str = field(default="", repr=False)

    @property
    def boundaries(self) -> tuple[Boundary, ...]:
        """All edges of stability that were found, parameter by parameter."""
        return tuple(edge for margin in self.margins for edge in margin.edges)

    @cached_property
    def judders(self) -> str:
        """What an unstable rig does instead, such as "judders: every 4.92 s it sticks, then slips 33.2 um ...".

        From a simulation after a small disturbance, of bounded work. Empty for a stable rig, and where slip events were
        not found to repeat themselves.
        """
        from steadyslip.verdict.judder import judder_sentence

        asked = self.stable is False and not self.on_edge and self.growth_rate != math.inf
        return judder_sentence(self.rig, self.eigenvalues, self.branch) if asked else ""

    @cached_property
    def unstable_loop(self) -> str:
        """Clause on a controller that is unstable without any friction, with what to change; empty for others."""
        from steadyslip.nonlinear.hunting.free_loop import unstable_by_itself

        return unstable_by_itself(self.rig) if self.stable is False and not self.on_edge else ""
