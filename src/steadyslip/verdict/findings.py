"""`Findings`: all results of an analysis, as a frozen data class from which texts, JSON and figures are made."""

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
        Explanation in one sentence; without steady sliding, which contact of a machine locks up or lifts off.
    steady : SteadySliding, SteadyMachine or None
    eigenvalues : tuple of complex
        Eigenvalues in 1/s, by falling real part; with a delay only the rightmost.
    characteristic_polynomial, routh : tuple of float
        Coefficients, lowest power first (theory 3: a0, a1, ...); first column of the Routh array, stable if all are
        positive. Empty with a delay (no polynomial then) and for machines given by matrices.
    characteristic_terms : tuple of (float, tuple of float)
        With a delay: each delay (s) and the polynomial that multiplies exp(−s delay), delay 0 first.
    unstable_roots : int or None
        Number of growing eigenvalues, for rigs with a delay or with a structure given by its measured response.
    growth_rate : float or None
        Largest real part (1/s), inf if ill-posed.
    period : float or None
        Period of the least damped oscillation (s).
    damping_ratio : float or None
        Damping ratio of the least damped oscillation; negative if it grows.
    time_to_halve, time_to_double : float or None
        Time (s) in which the slowest decay halves, or the fastest growth doubles, a disturbance.
    on_edge : bool
        True if the rig is on the edge of stability to within rounding: then neither verdict should be relied on.
    undamped : bool
        True if nothing damps a machine, not even friction: no disturbance dies out, and edges are where one grows.
    margins : tuple of Margin
        Distance of each parameter to the nearest edge of stability, the most critical parameter first.
    onset : Onset or None
        Kind of onset at the nearest oscillatory edge: of a slider in stiffness, of a machine in any parameter.
    kicks : tuple of Threshold
        Smallest kicks that are not survived, of the kinds requested.
    critical_stiffness : float or None
        For a slider: edge of the stable set nearest to its own stiffness (Pa/m along the sliding direction).
    critical_side : str or None
        ``above`` or ``below``: side of the critical stiffness on which sliding is stable.
    critical_angular_frequency : float or None
        Angular frequency at the critical stiffness (rad/s); 0 without oscillation.
    critical_axial_stiffness : float or None
        Critical stiffness along the axis of spring, rod or press, for rigs with an axial stiffness (Pa/m).
    stable_stiffness : tuple of (float, float)
        For a slider: all stable stiffnesses k > 0 as open intervals (Pa/m); the upper end may be inf.
    mode : Mode or None
        Leading mode of a machine: that which grows fastest, or decays slowest.
    origin : Origin or None
        Why the leading mode grows: what feeds it, and which modes couple. None unless it is a growing oscillation.
    branch : int
        Index of the steady sliding state that is judged.
    warnings : tuple of str
    checks : tuple of Check
        Second, independent computation of each number. Numbers that fail are left out; a verdict that fails has
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
        """Motion of an unstable rig in words, such as "judders: every 4.92 s it sticks, then slips 33.2 um ...".

        From a simulation after a small disturbance, of bounded work. Empty for a stable rig, and if the simulation
        found no regular motion within that work.
        """
        from steadyslip.verdict.judder import judder_sentence

        asked = self.stable is False and not self.on_edge and self.growth_rate != math.inf
        return judder_sentence(self.rig, self.eigenvalues, self.branch) if asked else ""

    @cached_property
    def unstable_loop(self) -> str:
        """Clause on a controller that is unstable even without friction, and what to change; empty otherwise."""
        from steadyslip.nonlinear.hunting.free_loop import unstable_by_itself

        return unstable_by_itself(self.rig) if self.stable is False and not self.on_edge else ""
