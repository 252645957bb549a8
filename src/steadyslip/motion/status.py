"""Statuses of runs, and advice for each."""

from __future__ import annotations

from steadyslip.core.areas import stress_name
from steadyslip.kernels.runner import STATUSES

WORDS = (*STATUSES, "interrupted", "no steady sliding", "ill-posed", "out of range")

REMEDIES = {
    "done": "",
    "contact lost": "the normal {stress} fell to zero; press harder (preload), or change what takes the load off",
    "blow-up": "the massless model reaches infinite velocity at this time; give {mass} to follow the motion further",
    "too many steps": "the limit of steps is used up; shorten the run (--until), loosen --rtol, or report at given "
    "times (--samples, in Python times), for which more steps are allowed; in Python most_steps raises the limit",
    "stuck": "no step is small enough: the equations have no solution beyond this point (without mass, friction that "
    "falls at once when the block speeds up; or a normal {stress} that answers too strongly to acceleration), or "
    "change faster than floating point can follow (a mass near zero, say); give {mass}, or check the contact law",
    "no velocity": "no velocity that floating point can hold balances the forces after a jump of the inputs (or at the "
    "start); make the jump smaller, give {mass}, or look for a parameter that is too small or too large by orders of "
    "magnitude",
    "interrupted": "stopped by the user; run it again for the rest",
    "no steady sliding": "there is no steady sliding to start from (lock-up or lift-off); see steadyslip.steady_state",
    "ill-posed": "without mass, friction falls at once when the block speeds up (or the normal {stress} answers too "
    "strongly to acceleration): the smallest lag left out decides the motion; give {mass}",
    "out of range": "numbers of the rig or of its motion leave the range of floating point (1e308), or are so far "
    "apart that rounding decides how the block moves; look for a parameter that is too small or too large by orders "
    "of magnitude (b, d_c, a normal stress near zero)",
    "running": "",
}
_MASS = {
    True: "the body that slips there a mass (or a damped link to the ground)",
    False: "the slider mass or radiation_damping",
}


def remedy(word: str, machine: bool, area: float | None = None) -> str:
    """Advice for a status, worded for a machine or for a slider (with forces if it has an area); empty if done."""
    normal = "force" if machine else stress_name("stress", area)
    return REMEDIES[word].format(mass=_MASS[machine], stress=normal)
