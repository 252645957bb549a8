"""Sample a probability density by MCMC with emcee; the only module that imports the package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable


def run_walkers(
    log_density: Callable[[Array], Array], begin: Array, steps: int, seed: int, what: str
) -> tuple[Any, float]:
    """Run the walkers of an affine-invariant MCMC sampler.

    Parameters
    ----------
    log_density : callable
        Points (m, p) to logarithms of the density (m,), up to a constant.
    begin : ndarray (walkers, p)
        Starting points.
    steps : int
        Steps of every walker.
    seed : int
    what : str
        Name of the task, for the error message where emcee is missing.

    Returns
    -------
    emcee.EnsembleSampler, float
        The sampler with its chains, and the longest autocorrelation time in steps.

    Raises
    ------
    NotAvailable
        If emcee is not installed.
    """
    try:
        import emcee
    except ImportError as error:
        raise NotAvailable(f"{what} needs the package emcee; install steadyslip[lab]") from error
    sampler = emcee.EnsembleSampler(*begin.shape, log_density, vectorize=True)
    sampler._random = np.random.RandomState(seed % 2**32)
    sampler.run_mcmc(begin, steps, skip_initial_state_check=True)
    return sampler, float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))


def spread_of_chains(chains: Array) -> float:
    """Split R-hat of chains (c, n) of one quantity: 1 where all halves of chains agree, more where they do not."""
    half = chains.shape[1] // 2
    if half < 2:
        return np.inf
    parts = np.concatenate([chains[:, :half], chains[:, -half:]])
    within = float(np.mean(np.var(parts, axis=1, ddof=1)))
    between = float(np.var(np.mean(parts, axis=1), ddof=1))
    return float(np.sqrt((half - 1) / half + between / within)) if within > 0 else np.inf
