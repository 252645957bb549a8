"""Estimates of several experiments as members of one population: normal in coordinates, spread unknown.

Experiment j has true coordinates θ_j = X_j β + N(0, diag τ²) and says of some of them z_j = θ_j + N(0, C_j). The mean β
is integrated out with a flat prior, the spreads τ have half-normal ones and are sampled; β and θ follow from them
exactly (Gelman et al. 2013, Bayesian Data Analysis, ch. 5). Samples are drawn by emcee, which only this file imports.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable

MIN_LOG_SPREAD = -16.0  # lower bound of ln(spread / prior scale): spreads below 1e-7 of the scale count as none
WALKERS, BURN = 40, 250  # least number of walkers, and steps discarded at the start; chosen by trial, for time
THINNING = 20  # steps between the draws that are kept of a walker, about its autocorrelation time
MIN_STEPS = 350  # least number of steps after the discarded ones, for a usable autocorrelation time


@dataclass(frozen=True, eq=False)
class ExperimentEstimate:
    """Estimates of one experiment, with their covariance.

    Attributes
    ----------
    indices : ndarray of int (k,)
        Indices of the coordinates, of p, that the experiment determines.
    values : ndarray (k,)
        Estimates of these coordinates.
    covariance : ndarray (k, k)
        Covariance of the estimates.
    design : ndarray (q,)
        1, then the differences of the experiment's conditions from their means over all experiments.
    """

    indices: Array
    values: Array
    covariance: Array
    design: Array

    def slopes(self, size: int) -> Array:
        """Derivatives of the expected estimates with respect to β, (k, p q)."""
        found = np.zeros((len(self.indices), size, len(self.design)))
        found[np.arange(len(self.indices)), self.indices] = self.design
        return found.reshape(len(self.indices), -1)


@dataclass(frozen=True, eq=False)
class Pooled:
    """Draws from the posterior of a population.

    Attributes
    ----------
    mean : ndarray (m, p, q)
        β: at mean conditions, then per unit of each condition.
    spread : ndarray (m, p)
        τ.
    members : ndarray (m, j, p)
        θ of every experiment.
    time : float
        Autocorrelation time of the spreads, steps.
    chains : int
        Walkers that the draws belong to, one after another and equally long.
    """

    mean: Array
    spread: Array
    members: Array
    time: float
    chains: int = 1


def log_evidence(experiments: list[ExperimentEstimate], spread: Array) -> tuple[Array, Array, Array]:
    """Log marginal likelihood (m,) for spreads (m, p); precision (m, p q, p q) and mean (m, p q) of β given them."""
    count, size = spread.shape
    width = size * len(experiments[0].design)
    precision, pull, rest = np.zeros((count, width, width)), np.zeros((count, width)), np.zeros(count)
    for many in {len(one.indices) for one in experiments} - {
        0
    }:  # experiments that determine equally many coordinates, together
        alike = [one for one in experiments if len(one.indices) == many]
        seen = np.array([one.indices for one in alike])
        slopes = np.array([one.slopes(size) for one in alike])
        values = np.array([one.values for one in alike])
        variance = np.eye(many) * spread[:, seen][..., None] ** 2 + np.array([one.covariance for one in alike])
        root = np.linalg.cholesky(variance)
        right = np.concatenate([slopes, values[:, :, None]], axis=2)
        solved = np.linalg.solve(root, np.broadcast_to(right, (count, *right.shape)))
        products = np.einsum("mjkw,mjkx->mwx", solved, solved)
        precision += products[:, :-1, :-1]
        pull += products[:, :-1, -1]
        rest += products[:, -1, -1] + 2 * np.sum(np.log(np.diagonal(root, axis1=2, axis2=3)), axis=(1, 2))
    best = np.linalg.solve(precision, pull[:, :, None])[:, :, 0]
    rest += np.linalg.slogdet(precision)[1] - np.einsum("mw,mw->m", pull, best)
    return -0.5 * rest, precision, best


def pooled(experiments: list[ExperimentEstimate], size: int, scale: Array, count: int, seed: int) -> Pooled:
    """Draw spreads, means and members of a population from their posterior, by affine-invariant MCMC.

    Parameters
    ----------
    experiments : list of ExperimentEstimate
    size : int
        Number of coordinates.
    scale : ndarray (p,)
        Of the half-normal priors of the spreads.
    count : int
        Draws, at least: as many of every walker.
    seed : int

    Raises
    ------
    NotAvailable
        If emcee is not installed.
    """

    def log_probability(u: Array) -> Array:
        found = np.full(len(u), -np.inf)
        inside = np.all((u > MIN_LOG_SPREAD) & (u < 4.0), axis=1)
        if np.any(inside):
            share = np.exp(u[inside])  # of the prior's scale; the last term is the change to logarithms
            found[inside] = log_evidence(experiments, scale * share)[0] + np.sum(u[inside] - 0.5 * share**2, axis=1)
        return found

    generator = np.random.default_rng(seed)
    walkers = max(WALKERS, 2 * size + 2)
    begin = np.log(_initial_spreads(experiments, size, scale) / scale) + 0.5 * generator.standard_normal(
        (walkers, size)
    )
    each = -(-count // walkers)
    steps = max(THINNING * each, MIN_STEPS)
    sampler, time = run_walkers(
        log_probability, np.clip(begin, MIN_LOG_SPREAD + 1, 3.0), BURN + steps, seed, "a population"
    )
    kept = sampler.get_chain(discard=BURN)
    own = np.round(np.linspace(0, steps - 1, each)).astype(int)
    spread = scale * np.exp(kept[own].transpose(1, 0, 2).reshape(-1, size))
    return _conditional_draws(experiments, spread, time, walkers, generator)


def _initial_spreads(experiments: list[ExperimentEstimate], size: int, scale: Array) -> Array:
    """Starting values of the spreads (p,): standard deviations of the estimates, else 0.3 of the prior scale."""
    found = np.array(0.3 * scale)
    for p in range(size):
        values = [float(one.values[np.flatnonzero(one.indices == p)[0]]) for one in experiments if p in one.indices]
        if len(values) > 1 and np.std(values) > 0:
            found[p] = np.std(values, ddof=1)
    return found


def _conditional_draws(
    experiments: list[ExperimentEstimate], spread: Array, time: float, chains: int, generator: np.random.Generator
) -> Pooled:
    """Draw means and members from their exact distributions given the spreads (m, p)."""
    count, size = spread.shape
    _, precision, best = log_evidence(experiments, spread)
    root = np.linalg.cholesky(precision)
    noise = generator.standard_normal((count, precision.shape[1], 1))
    mean = best + np.linalg.solve(root.transpose(0, 2, 1), noise)[:, :, 0]
    mean = mean.reshape(count, size, -1)
    members = np.empty((count, len(experiments), size))
    for j, one in enumerate(experiments):  # a draw from the prior, moved by what it misses (Hoffman & Ribak 1991)
        drawn = mean @ one.design + spread * generator.standard_normal((count, size))
        seen = drawn[:, one.indices] + generator.multivariate_normal(
            np.zeros(len(one.indices)), one.covariance, size=count, method="eigh"
        )
        variance = one.covariance + np.eye(len(one.indices)) * spread[:, None, one.indices] ** 2
        weight = np.linalg.solve(variance, (one.values - seen)[:, :, None])[:, :, 0]
        drawn[:, one.indices] += spread[:, one.indices] ** 2 * weight
        members[:, j] = drawn
    return Pooled(mean, spread, members, time, chains)


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
