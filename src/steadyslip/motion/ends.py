"""Contact at which a run of a machine ended early."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.model.point import OperatingPoint
from steadyslip.model.weights import slip_rates

Array = np.ndarray
LOST, BLOWN_UP = "contact lost", "blow-up"


def ending_contact(point: OperatingPoint, status: str, stresses: Any, rates: Any) -> Array:
    """Contact that is least pressed relative to steady sliding where contact is lost, the fastest in a blow-up.

    Parameters
    ----------
    point : OperatingPoint
        The rigs of k runs, or of one.
    status : str
        Status of the runs, one of `steadyslip.motion.status.WORDS`.
    stresses, rates : sequence of array_like
        Normal stress (Pa) and slip rate (m/s) of every contact at the end, (k,) each.

    Returns
    -------
    ndarray of int (k,)
        Index of the contact; −1 for other statuses, and for a block with one contact, which has no name.
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
