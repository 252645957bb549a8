"""Frequency response of a rig's observables to small oscillations of its inputs about steady sliding."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.model import Model
from steadyslip.model.eigenvalues import blocks_of
from steadyslip.model.point import OperatingPoint, stacked


def receptance(
    point: OperatingPoint, omega: Array, outputs: Sequence[str], inputs: Sequence[str]
) -> NDArray[np.complex128]:
    """Complex amplitudes of outputs per unit of inputs, (..., frequencies, outputs, inputs), at omega (rad/s).

    Forces with a delay τ have a factor exp(-iωτ). NaN without steady sliding, and where the balances of forces do not
    determine the motion.

    Parameters
    ----------
    point : OperatingPoint
    omega : ndarray (frequencies,)
    outputs, inputs : sequence of str
        Names of ``Model.observables`` and ``Model.inputs``.
    """
    names, delays = (tuple(outputs), tuple(inputs)), point.model.delays
    now = blocks_of(point, *names)
    one = np.ones((*(1,) * len(point.shape), len(omega), 1, 1), dtype=complex)
    blocks = [block[..., None, :, :] * one for block in now]
    late = stacked(point.evaluate(_delays(point.model)), point) if delays else np.empty(0)
    for i, delay in enumerate(delays):
        turned = np.exp(-1j * omega * late[..., i, None])[..., None, None]
        for k, block in enumerate(blocks_of(point, *names, (delay,))):
            blocks[k] = blocks[k] + turned * (block - now[k])[..., None, :, :]
    rate_x, rate_u, rate_z, out_x, out_u, out_z, balance_x, balance_u, balance_z = blocks
    s = 1j * omega[:, None, None] * np.eye(rate_x.shape[-1])
    upper = np.concatenate([s - rate_x, -rate_z], axis=-1)
    whole = np.concatenate([upper, np.concatenate([balance_x, balance_z], axis=-1)], axis=-2)
    pushed = np.concatenate([rate_u, -balance_u], axis=-2)
    good = np.all(np.isfinite(whole), axis=(-2, -1))
    size = whole.shape[-1]
    try:
        moved = np.linalg.solve(np.where(good[..., None, None], whole, np.eye(size)), pushed)
    except np.linalg.LinAlgError:
        moved = np.full_like(pushed, np.nan)
    moved = np.where(good[..., None, None], moved, np.nan)
    return np.asarray(np.concatenate([out_x, out_z], axis=-1) @ moved + out_u)


@cached
def _delays(model: Model) -> ArrayFunction:
    """Array function of the delays, s."""
    return model.function(model.delays)
