"""Decide why a piece of a branch ends, from its last cycles, and the texts of these reasons."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.linear.boundary import boundary
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.onset.hopf import Onset
from steadyslip.nonlinear.orbits.cycle import IMPRECISE, Cycle, End, SpecialCycle
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.special import MET, ROUNDING, SMALL, BranchPoint, lies_between

WINDINGS = 6  # number of folds at ever smaller distances after which a branch counts as winding round one value
STANDING = 12  # a branch ends after this many cycles that differ by less than 5 % at one parameter value
RETRACED = 4  # number of consecutive cycles between known neighbours after which the branch has turned back
TOO_UNSTABLE = 1e8  # largest growth of deviations in a period: more loses half of the digits of double precision
SHRUNK = 0.5  # only a cycle with a smaller amplitude of ln v may be about to shrink to steady sliding
LARGE = 1e6  # a cycle counts as growing without bound if its peak velocity exceeds this multiple of the drive's
STILL = 1e-3  # value and period are constant if they change by less than this share of the peak velocity's change
ENDS = {
    "blow-up": "blow-up: the velocity of the massless model becomes infinite; give the {block} a mass or {damping} to "
    "follow the cycles further",
    "unbounded": "blow-up: the peak velocity grows without bound as the cycle nears the motions of the massless model "
    "that reach infinite velocity; give the {block} a mass or {damping} to follow the cycles further",
    "large": "the cycles grow without bound while parameter and period stand still: at large velocities the motion is "
    "linear, and undamped at this value",
    "growth": "the cycle is too unstable to matter: deviations grow 1e8-fold in each period",
    "contact lost": "contact lost: the normal {force} falls to zero in the cycle",
    "stuck": "the equations have no solution in part of the cycle",
    "too many steps": "the integration needs ever smaller steps, as it does where the cycle comes close to states at "
    "which no velocity balances the forces; mass or damping helps",
    "no velocity": "the equations have no solution in part of the cycle",
    "precision": "precision is lost; a smaller rtol may lead further",
    "steady": "back at steady sliding, at another edge of stability",
    "doubling": "back at a period doubling, where it joins the branch of half the period",
    "winds": "folds close in on one value of the parameter while the period grows (a connection of a steady state with "
    "itself, through ever longer spirals)",
    "stands": "the parameter stands still in its last digits while the cycles hardly change, as in a canard",
    "retraces": "rounding turns it back onto itself",
    "runs away": "the period runs away while the parameter stands still (a connection to another steady state)",
}


@dataclass(frozen=True, eq=False)
class EndRules:
    """Criteria for the end of a branch piece, for one rig and onset."""

    flow: Flow
    onset: Onset

    def finished(
        self, limits: tuple[float, float], before: BranchPoint, now: BranchPoint, first: BranchPoint, twice: bool
    ) -> tuple[str, bool]:
        """Reason for which a piece ends at cycle `now` (empty if it goes on), and True if `now` still belongs to it."""
        low, high = limits
        cycle = now.cycle
        if not low < cycle.value < high:
            end = format_quantity(
                low if cycle.value <= low else high, self.onset.unit, area=self.onset.rig.printed_area(self.onset.along)
            )
            return f"end of the range, {end}", True
        if cycle.amplitude < SHRUNK and self.slows(now):
            return ENDS["steady"], False
        if twice and before.half @ now.half < -0.5 * np.linalg.norm(before.half) * np.linalg.norm(now.half):
            return ENDS["doubling"], False
        setting = self.flow.setting(cycle.value)
        fast = cycle.peak_velocity > LARGE * setting.speed
        bounded = self.flow.reduction.model.inertial or is_damped(self.flow.rig)
        if abs(cycle.trivial - 1) > IMPRECISE and cycle.amplitude > SMALL:
            return self.words("unbounded" if fast and not bounded else "precision"), True
        if cycle.growth > TOO_UNSTABLE:
            return ENDS["growth"], True
        if self.onset.is_weak and fast and not bounded:
            return self.words("unbounded"), True
        longer = np.log(cycle.period / before.cycle.period)
        further = abs(cycle.value - before.cycle.value) / (abs(before.cycle.value) or 1.0)
        grown = np.log(cycle.peak_velocity / before.cycle.peak_velocity)
        if fast and bounded and max(further, abs(longer)) < STILL * grown:
            return ENDS["large"], True
        if cycle.period > 1e3 * first.cycle.period and longer > 1e3 * further:
            return ENDS["runs away"], True
        return "", True

    def words(self, status: str, contact: str = "") -> str:
        """Text for a status, with the contact of a machine; empty if the status is not in `ENDS`."""
        if status not in ENDS:
            return ""
        rig = self.flow.rig
        head, colon, reason = ENDS[status].format(force=rig.result_name("stress"), **rig.words).partition(": ")
        return f"{head} at {contact}{colon}{reason}" if contact else head + colon + reason

    def slows(self, now: BranchPoint) -> bool:
        """True if slip decelerates where the cycle starts: the continuation has passed a cycle of zero size.

        With mass, rounding of the state may dominate the acceleration computed at the start. The acceleration carried
        round the cycle once by the sensitivities is accurate, so both have to be negative.
        """
        orbit = now.shooting.orbit(now.point.u)
        setting = self.flow.setting(orbit.value)
        rates, jacobian, _ = self.flow.field(setting, orbit.states)
        carried = rates[0]
        for sensitivity in now.shooting.sensitivities(now.point.u):
            carried = sensitivity @ (carried / self.flow.scales) * self.flow.scales
        faster = setting.slip @ jacobian[0]
        return bool(faster @ rates[0] <= 0 and faster @ carried <= 0)

    def other_edge(self, last: list[Cycle]) -> End | None:
        """Edge of stability at which shrinking cycles end, extrapolated from the last two; None if none is near."""
        if len(last) < 2:
            return None
        sizes = [cycle.amplitude**2 for cycle in last]
        slope = (last[1].value - last[0].value) / (sizes[0] - sizes[1])
        ahead = last[1].value + slope * sizes[1]
        try:
            edges = boundary(self.onset.rig, self.onset.along, branch=self.flow.branch)
        except NotAvailable:
            return None
        near = [edge.value for edge in edges if edge.kind == "oscillatory"]
        edge = min(near, key=lambda value: abs(value - ahead), default=np.inf)
        reach = abs(ahead - last[1].value) + abs(last[1].value - last[0].value)
        return End("edge", edge) if abs(edge - ahead) <= reach else None


def is_damped(rig: Slider | Machine) -> bool:
    """True if the rig has damping that limits the velocity of a massless block."""
    return any(bool(np.any(one.damping)) for one in rig.mechanism().elements)


def winds(special: list[SpecialCycle]) -> bool:
    """True if the last folds converge to one value of the parameter while the period grows (Shilnikov)."""
    folds = [point.cycle for point in special if point.kind == "fold"][-WINDINGS:]
    if len(folds) < WINDINGS:
        return False
    apart = np.abs(np.diff([cycle.value for cycle in folds]))
    return bool(np.all(apart[1:] < 0.8 * apart[:-1]) and np.all(np.diff([cycle.period for cycle in folds]) > 0))


def retraces(known: list[Cycle]) -> bool:
    """True if the last cycles lie between earlier neighbours, in amplitude too: the continuation has turned back.

    Small cycles differ little in period and velocity, and where a branch begins vertically, as at a degenerate onset,
    their parameter values differ by rounding only: amplitudes show that the branch goes on.
    """
    last, passed = known[-RETRACED:], known[: -2 * RETRACED]
    if len(passed) < 2 or (known[-1].value - known[-2].value) * (known[-2].value - known[-3].value) < 0:
        return False
    return all(any(lies_between(a, b, one) and _sized(a, b, one) for a, b in pairwise(passed)) for one in last)


def _sized(a: Cycle, b: Cycle, cycle: Cycle) -> bool:
    """True if the amplitude of a cycle lies between the amplitudes of the cycles `a` and `b`."""
    *ends, size = (float(np.log(min(one.amplitude, LARGE))) for one in (a, b, cycle))
    spread = MET + 0.3 * (ends[1] - ends[0]) ** 2
    return min(ends) - spread < size < max(ends) + spread


def stands(last: list[Cycle]) -> bool:
    """True if the last `STANDING` cycles differ by less than 5 % and their parameter values by rounding only."""
    if len(last) < STANDING:
        return False
    value = np.array([cycle.value for cycle in last])
    looks = [(cycle.period, cycle.peak_velocity, min(cycle.amplitude, LARGE)) for cycle in last]
    return bool(np.ptp(value) <= ROUNDING * np.abs(value).max() and np.ptp(np.log(looks), axis=0).max() < 0.05)
