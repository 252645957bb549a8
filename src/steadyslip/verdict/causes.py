"""Sentences that explain why a rig is stable at every stiffness, at none, or ill-posed (theory 3).

With one memory variable the conditions of stability are a3 >= 0, a2 > 0, a0 > 0 and D k > N; a0 and D k > N are linear
in the stiffness k; a2 and a3 do not depend on it. A sentence is returned only where a single condition decides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from steadyslip.core.checks import UNDECIDED
from steadyslip.linear.cubic import coefficients, hopf_line
from steadyslip.linear.response import Response, has_closed_form, response_numbers
from steadyslip.linear.roots import quietly
from steadyslip.linear.search import Search
from steadyslip.linear.spectrum import is_stable, outweighing_delays
from steadyslip.linear.stiffness import stiffness_polynomials
from steadyslip.machine.rig import Rig
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.posed import late_on_springs

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings


def _response(analysis: Findings) -> Response | None:
    """Coefficients of the closed form for `analysis.branch`; None unless the law has exactly one memory variable."""
    point = operating_point(analysis.rig, branch=analysis.branch)
    return response_numbers(point) if has_closed_form(point.model) else None


@quietly
def why_always_stable(analysis: Findings) -> str:
    """Clause that explains why the rig is stable at every stiffness; empty if no single condition explains it."""
    known = _response(analysis)
    if known is None or known.B3 != 0:
        return ""
    slope = known.S + known.mu * known.B1  # d(steady resistance)/dV, with the change of normal stress
    if slope < 0:
        return ""
    parts = [word for word, is_in in (("dampings", _has_damping(analysis)), ("normal stress", known.B1 != 0)) if is_in]
    with_all = f" ({' and '.join(parts)} included)" if parts else ""
    return f": the resistance to steady sliding{with_all} {'rises' if slope > 0 else 'does not fall'} with velocity"


def _has_damping(analysis: Findings) -> bool:
    rig = analysis.rig
    return bool(rig.damping or rig.radiation_damping or float(rig.drive.dashpot()))


@quietly
def why_never_stable(analysis: Findings) -> str:
    """Clause that names the stability condition that no stiffness meets; empty if no single condition explains it."""
    known = _response(analysis)
    if known is None:
        return _why_none_in_general(analysis)
    numbers = known.as_dict()
    k = numbers.pop("k")
    _, _, a2, _ = coefficients(**numbers, k=k)
    if a2 <= 0:
        return ": friction and normal stress together feed every motion, whatever the stiffness (a2 > 0 fails)"
    gain = float(analysis.rig.drive.proportional())  # the gain acts as a spring: the least total stiffness
    if not _reachable(1 + known.mu * known.B2, -known.mu * known.B3, gain):
        return ": a disturbance grows without oscillating (static stability, a0 > 0, fails at every stiffness)"
    numerator, denominator = hopf_line(**numbers)
    if not np.isfinite(numerator) or not np.isfinite(denominator):
        return ""  # overflow: cannot decide
    if _reachable(denominator, numerator, gain):
        return ": where no oscillation grows, a disturbance grows without oscillating"
    return f": a disturbance grows at every stiffness{_why_negative(known, denominator)}"


def _reachable(slope: float, right: float, least: float) -> bool:
    """True if slope k > right for some k > least."""
    return slope > 0 or slope * least > right or (slope == 0 and right < 0)


def _why_negative(known: Response, denominator: float) -> str:
    """Clause that names the term which makes D negative; empty unless D < 0.

    D = (f + f1 B1)(1 + f1 B2) + r (μ − f1)(B0 − m B2) is the `denominator` of the critical stiffness.
    """
    coupling, memory = 1 + known.f1 * known.B2, known.r * (known.mu - known.f1)
    direct = known.f + known.f1 * known.B1
    if denominator >= 0:
        return ""
    if direct > 0 and coupling < 0 and memory * (known.B0 - known.m * known.B2) >= 0:
        return (
            "; when the block gets ahead, friction falls at once by more than the spring's pull, "
            "because the spring relieves the normal stress (D < 0)"
        )
    if direct * coupling > 0 and known.B0 == 0 and known.m > 0 and memory * known.B2 > 0:
        return "; with this mass the memory of normal stress drives it (D < 0, eq. 31)"
    return " (D < 0)"


def _why_none_in_general(analysis: Findings) -> str:
    if analysis.characteristic_terms:
        return ""
    p, q = stiffness_polynomials(operating_point(analysis.rig, branch=analysis.branch))
    if p[..., 0] <= 0 and q[..., 0] <= 0:
        return ": a disturbance grows without oscillating (static stability, a0 > 0, fails at every stiffness)"
    if not analysis.rig.friction.memory() and p.shape[-1] == 3 and q[..., 1] == 0 and p[..., 1] <= 0:
        return ": the resistance to sliding falls with velocity, and friction has no memory"
    return ""


ILL_POSED = (
    "the equations are ill-posed: mass, direct effect and dampings do not outweigh what friction, directly or by way "
    "of the normal stress, may fall by at once, so any small lag grows at once"
)
"""Reason given for a slider that is ill-posed without a delay, whichever term causes this."""

DELAY_IS_ILL_POSED = (
    "the equations are ill-posed: on a body without mass, what follows velocity late (by {delays}) outweighs what "
    "follows it at once, so that ever faster oscillations grow; give that body a mass, or make what acts late smaller "
    "than the damping that acts at once"
)
"""Reason given for a rig that a delay makes ill-posed; {delays} are dotted parameter names."""

LATE_ON_SPRINGS = (
    "the equations are ill-posed: on a body without mass that only springs hold, a force follows its motion late, so "
    "that with a mass, however small, ever faster oscillations grow; give that body damping, or the mass that it has"
)
"""Reason given for a rig that is ill-posed by a delayed force on a body without mass and without damping."""

NEEDS_MASS = (
    UNDECIDED + "without mass nothing slows down a change of velocity at once (no direct effect, no damping), and the "
    "equations are ill-posed; with mass, however small, steady sliding is stable: give {names} a value"
)
"""Reason given where steady sliding is not judged without mass; {names} are dotted parameter names."""

_SMALL = np.array([1e-3, 1e-6, 1e-9])  # ever smaller masses that are tried, relative to their natural sizes


def why_delay_is_ill_posed(point: OperatingPoint) -> str:
    """Sentence that names the delays that make the rig at `point` (scalars) ill-posed; empty if none does."""
    if late_on_springs(point):
        return LATE_ON_SPRINGS
    delays = outweighing_delays(point)
    return DELAY_IS_ILL_POSED.format(delays=" and ".join(delays)) if delays else ""


@quietly
def undecided_without_mass(rig: Rig, branch: int = 0) -> str:
    """Reason not to judge an ill-posed rig without delay that becomes stable if zero masses are replaced by small ones.

    An example is bristles without damping whose friction rises with velocity: without mass nothing slows a change of
    velocity; a small mass on them oscillates and decays at a rate that does not depend on the mass. The text is empty
    for other rigs.
    """
    massless = [
        name for name, one in rig.parameters().items()
        if one.value == 0 and one.role.structural and one.role.unit.startswith("kg")
    ]  # fmt: skip
    if not massless or operating_point(rig, branch=branch).model.delays:
        return ""
    sizes = {name: Search(rig, name, (name,), branch).natural_size() for name in massless}
    light = operating_point(rig, {name: size * _SMALL for name, size in sizes.items()}, branch=branch)
    return NEEDS_MASS.format(names=" and ".join(massless)) if np.all(is_stable(light)) else ""


@quietly
def why_ill_posed(analysis: Findings) -> str:
    """Sentence on why the equations are ill-posed: a delay, negative effective mass, friction or the contact law."""
    late = why_delay_is_ill_posed(operating_point(analysis.rig, branch=analysis.branch))
    if late:
        return late
    known = _response(analysis)
    if known is not None:
        numbers = known.as_dict()
        if known.m + known.f1 * known.B0 < 0:
            return (
                "the equations are ill-posed: acceleration changes the normal stress so that friction pushes more than "
                "the mass resists (the effective mass is negative), so any small lag grows at once"
            )
        if numbers["f"] <= 0:
            verb, size = ("falls", "negative") if numbers["f"] < 0 else ("does not rise", "zero")
            return (
                f"the equations are ill-posed: friction {verb} at once when velocity rises (its direct "
                f"effect is {size}, dampings included), and there is no mass to slow that down"
            )
        return (
            "the equations are ill-posed: velocity relieves the normal stress so that friction falls at once by more "
            "than its direct effect and dampings provide, and there is no mass to slow that down"
        )
    return ILL_POSED
