"""Statuses of runs, advice for each, and the contact at which a run ended early."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.areas import stress_name
from steadyslip.kernels.runner import STATUSES
from steadyslip.machine.rig import Rig
from steadyslip.model.point import OperatingPoint
from steadyslip.model.weights import slip_rates

UNRESOLVED = "delay not resolved"
"""Status of a run with a delay that changes if delayed signals get more variables (`steadyslip.motion.late_check`).
"""
WORDS = (*STATUSES, "interrupted", "no steady sliding", "ill-posed", "out of range", UNRESOLVED)
NEEDS_MASS = "needs a mass: without it the block takes any velocity at once"
THROUGH_DASHPOT = "acts through a dashpot (damping, of a link, a kd) as an infinite force"
"""Clauses on a blow without mass, and on a step of the load point, for messages and the browser page."""
LOST, BLOWN_UP = "contact lost", "blow-up"

CAUSES = {
    "contact lost": "the normal {stress} fell to zero",
    "blow-up": "the massless model reaches infinite velocity",
    "too many steps": "the limit of steps is used up",
    "stuck": "no step is small enough: the equations have no solution beyond this point, or change faster than "
    "floating point can follow",
    "no velocity": "no velocity that floating point can hold balances the forces",
    "no steady sliding": "there is no steady sliding to start from (lock-up or lift-off)",
}
"""Cause of an early end of a run, by status, for messages and the browser page."""

REMEDIES = {
    "done": "",
    "contact lost": "press harder (preload), or change what takes the load off",
    "blow-up": "give {mass} to follow the motion further",
    "too many steps": "shorten the run (--until), loosen --rtol, or report at given times (--samples, in Python "
    "times), for which more steps are allowed; in Python most_steps raises the limit",
    "stuck": "it may be friction that falls at once when a block without mass speeds up, a normal {stress} that "
    "answers too strongly to acceleration, or a mass near zero; give {mass}, or check the contact law",
    "no velocity": "if the inputs jump, make the jump smaller; if they turn the slip round, take a law that slides "
    "both ways (regularised = true); give {mass}, or look for a parameter that is too small or too large by orders of "
    "magnitude",
    "interrupted": "stopped by the user; run it again for the rest",
    "no steady sliding": "see steadyslip.steady_state",
    "ill-posed": "without mass, friction falls at once when the block speeds up (or the normal {stress} answers too "
    "strongly to acceleration): the smallest lag left out decides the motion; give {mass}",
    "out of range": "numbers of the rig or of its motion leave the range of floating point (1e308), or are so far "
    "apart that rounding decides how the block moves; look for a parameter that is too small or too large by orders "
    "of magnitude (b, d_c, a normal stress near zero)",
    UNRESOLVED: "what acts late is not known to 1 %: slips are too sharp for a delay this long, or the run is so long "
    "that small differences grow; shorten the delay or the run, or raise rtol's accuracy (1e-9, say)",
    "running": "",
}


def remedy(word: str, rig: Rig) -> str:
    """Cause of a status and advice, in the rig's terms, with forces if it has an area; empty for ``done``."""
    text = f"{CAUSES[word]}; {REMEDIES[word]}" if word in CAUSES else REMEDIES[word]
    return text.format(mass=rig.words["mass"], stress=stress_name(rig.result_name("stress"), rig.area))


def causes(rig: Rig) -> dict[str, str]:
    """Cause of an early end of a run, by status, in the rig's terms."""
    stress = stress_name(rig.result_name("stress"), rig.area)
    return {word: text.format(stress=stress) for word, text in CAUSES.items()}


def ending_contact(point: OperatingPoint, status: str, stresses: Any, rates: Any) -> np.ndarray:
    """Index of the contact at which a run ended.

    At loss of contact it has the least normal stress relative to steady sliding, in a blow-up the fastest slip.

    Parameters
    ----------
    point : OperatingPoint
        The rigs of k runs, or the one rig of all runs.
    status : str
        Status of the runs, one of `WORDS`.
    stresses, rates : sequence of array_like
        Normal stress (Pa) and slip rate (m/s) of every contact at the end, (k,) each.

    Returns
    -------
    ndarray of int (k,)
        Index of the contact that is lost, or fastest in a blow-up; −1 for other statuses, and for a slider.
    """
    count = np.broadcast_shapes((1,), *(np.shape(one) for one in stresses))
    if status not in (LOST, BLOWN_UP) or not point.model.contacts[0].name:
        return np.full(count, -1)
    with np.errstate(all="ignore"):
        if status == LOST:
            beside = [np.asarray(own) / sigma for own, sigma in zip(stresses, point.sigmas, strict=True)]
        else:
            beside = [-np.abs(own) / np.abs(rate) for own, rate in zip(rates, slip_rates(point), strict=True)]
    found = np.stack([np.broadcast_to(one, count) for one in beside])
    return np.asarray(np.argmin(np.where(np.isnan(found), np.inf, found), axis=0))
