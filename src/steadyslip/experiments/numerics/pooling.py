"""Hierarchical normal model of the estimates of several experiments, with unknown covariance between experiments.

Experiment j has true coordinates θ_j = X_j β + N(0, Σ), some of which are estimated as z_j = θ_j + N(0, C_j). The mean
β is integrated out with a flat prior. The spreads s, roots of the diagonal of Σ, have priors exp(−s²/2)/√s, and
correlation matrices R the density |R|² (Lewandowski, Kurowicka & Joe 2009); both are sampled. For each sample, β and θ
have normal distributions that are known exactly (Gelman et al. 2013, Bayesian Data Analysis, ch. 5). Samples are drawn
by emcee, which only this file imports.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable

MIN_LOG_SPREAD = -16.0  # lower bound of ln(spread / prior scale): spreads below 1e-7 of the scale count as none
WALKERS, BURN = 40, 250  # least number of walkers, and number of first steps that are discarded; chosen by trial
THINNING = 20  # every 20th step of a walker is kept, as its autocorrelation time is about 20 steps
MIN_STEPS = 350  # least number of steps that are not discarded, for a usable estimate of the autocorrelation time
FEWEST_TIMES = 20  # least number of autocorrelation times in the steps of a walker; chosen by trial
MOST_ROUNDS = 3  # the number of steps is doubled at most this often to contain `FEWEST_TIMES` autocorrelation times
ALIKE = 3.0  # exponent η of the prior |R|^(η − 1) of correlation matrices: with η = 1, spreads were too large
SMALL = 0.5
"""Power of a spread in the prior density of its logarithm. With a power of 1 (half-normal prior), medians of the spread
of five rocks were 15 to 26 % too large, and 95 % intervals contained the true spread in 90 to 93 % of 500 cases; with a
power of 0 the posterior cannot be normalised."""
MOST_BEND = 8.0  # largest |artanh| of a partial correlation: closer to 1 than 1e-6 counts as 1


@dataclass(frozen=True, eq=False)
class ExperimentEstimate:
    """Estimates of one experiment, with their covariance.

    Attributes
    ----------
    indices : ndarray of int (k,)
        Indices of those of the p coordinates of the population that the experiment determines.
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
        """Derivatives (k, p q) of the expected estimates with respect to β, in `size` = p coordinates."""
        found = np.zeros((len(self.indices), size, len(self.design)))
        found[np.arange(len(self.indices)), self.indices] = self.design
        return found.reshape(len(self.indices), -1)


@dataclass(frozen=True, eq=False)
class Pooled:
    """Draws from the posterior of a population: m draws in p coordinates.

    Attributes
    ----------
    mean : ndarray (m, p, q)
        β: value at mean conditions, then slope with each condition.
    root : ndarray (m, p, p)
        Lower triangular root L of Σ = LLᵀ.
    members : ndarray (m, experiments, p)
        θ of every experiment.
    time : float
        Longest autocorrelation time of the chains, in steps.
    steps : int
        Number of steps of each walker.
    chains : int
        Number of walkers. Every walker has equally many draws, and all its draws follow each other.
    """

    mean: Array
    root: Array
    members: Array
    time: float
    steps: int = 0
    chains: int = 1

    @property
    def spread(self) -> Array:
        """Standard deviations (m, p) of the coordinates between experiments."""
        return np.asarray(np.linalg.norm(self.root, axis=2))

    @property
    def mixed(self) -> bool:
        """True if the chains are long enough, in autocorrelation times, to be independent of their starting points."""
        return self.steps >= FEWEST_TIMES * self.time

    def another(self, seed: int) -> Array:
        """Coordinates (m, p) of a new experiment at mean conditions."""
        noise = np.random.default_rng(seed).standard_normal((*self.root.shape[:2], 1))
        return np.asarray(self.mean[:, :, 0] + (self.root @ noise)[:, :, 0])


def log_evidence(experiments: list[ExperimentEstimate], covariance: Array) -> tuple[Array, Array, Array]:
    """Log marginal likelihood (m,) for covariances (m, p, p), and the distribution of β for each of them.

    Returns
    -------
    log_likelihood : ndarray (m,)
    precision : ndarray (m, p q, p q)
        Inverse of the covariance of β.
    mean : ndarray (m, p q)
        Mean of β.
    """
    count, size = covariance.shape[:2]
    width = size * len(experiments[0].design)
    precision, pull, rest = np.zeros((count, width, width)), np.zeros((count, width)), np.zeros(count)
    for many in {len(one.indices) for one in experiments} - {0}:  # experiments with equally many estimates together
        alike = [one for one in experiments if len(one.indices) == many]
        seen = np.array([one.indices for one in alike])
        slopes = np.array([one.slopes(size) for one in alike])
        values = np.array([one.values for one in alike])
        among = covariance[:, seen[:, :, None], seen[:, None, :]]
        variance = among + np.array([one.covariance for one in alike])
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
    """Posterior draws of a population: its mean, its covariance, and its experiments, by affine-invariant MCMC.

    Parameters
    ----------
    experiments : list of ExperimentEstimate
    size : int
        Number of coordinates.
    scale : ndarray (p,)
        Scales of the priors of the spreads.
    count : int
        Least number of draws; it is rounded up so that every walker has equally many draws.
    seed : int

    Raises
    ------
    NotAvailable
        If emcee is not installed.
    """

    def log_probability(u: Array) -> Array:
        found = np.full(len(u), -np.inf)
        logs, bends = u[:, :size], u[:, size:]
        inside = np.all((logs > MIN_LOG_SPREAD) & (logs < 4.0), axis=1) & np.all(np.abs(bends) < MOST_BEND, axis=1)
        if np.any(inside):
            share = np.exp(logs[inside])  # spreads in units of the prior's scale
            root = (scale * share)[:, :, None] * correlation_root(bends[inside], size)
            prior = np.sum(SMALL * logs[inside] - 0.5 * share**2, axis=1) + log_prior_of_correlation(
                bends[inside], size
            )
            found[inside] = log_evidence(experiments, root @ root.transpose(0, 2, 1))[0] + prior
        return found

    generator = np.random.default_rng(seed)
    pairs = size * (size - 1) // 2
    walkers = max(WALKERS, 2 * (size + pairs) + 2)
    begin = np.log(_initial_spreads(experiments, size, scale) / scale) + 0.5 * generator.standard_normal(
        (walkers, size)
    )
    begin = np.hstack([np.clip(begin, MIN_LOG_SPREAD + 1, 3.0), 0.5 * generator.standard_normal((walkers, pairs))])
    each = -(-count // walkers)
    steps = max(THINNING * each, MIN_STEPS)
    sampler, time = run_walkers(log_probability, begin, BURN + steps, seed, "a population", True)
    for _ in range(MOST_ROUNDS):
        if steps >= FEWEST_TIMES * time:
            break
        sampler.run_mcmc(None, steps)
        steps *= 2
        time = float(np.max(sampler.get_autocorr_time(discard=BURN, quiet=True, tol=0)))
    own = np.round(np.linspace(0, steps - 1, each)).astype(int)
    kept = sampler.get_chain(discard=BURN)[own].transpose(1, 0, 2).reshape(walkers * each, -1)
    spread = scale * np.exp(kept[:, :size])
    root = spread[:, :, None] * correlation_root(kept[:, size:], size)
    mean, members = _conditional_draws(experiments, root, generator)
    return Pooled(mean, root, members, time, steps, walkers)


def correlation_root(bends: Array, size: int) -> Array:
    """Lower triangular roots (m, p, p) of correlation matrices, from artanh of partial correlations (m, p(p−1)/2)."""
    root = np.zeros((len(bends), size, size))
    partial = np.tanh(bends)
    left = np.ones((len(bends), size))  # of the squared length 1 of each row, the part not yet used
    k = 0
    for i in range(size):
        for j in range(i):
            root[:, i, j] = partial[:, k] * np.sqrt(left[:, i])
            left[:, i] *= 1 - partial[:, k] ** 2
            k += 1
        root[:, i, i] = np.sqrt(left[:, i])
    return root


def log_prior_of_correlation(bends: Array, size: int) -> Array:
    """Logarithm (m,) of the density of artanh of partial correlations, if matrices R have the density |R|^(η − 1).

    The density of partial correlation j of a row is then (1 − r²)^(η − 1 + (p − 1 − j)/2), with j from 1 (Lewandowski
    et al. 2009).
    """
    power = np.array([ALIKE - 1 + 0.5 * (size + 1 - j) for i in range(size) for j in range(1, i + 1)])
    return np.asarray(-2 * np.log(np.cosh(bends)) @ power)


def _initial_spreads(experiments: list[ExperimentEstimate], size: int, scale: Array) -> Array:
    """Starting values (p,) of the spreads: standard deviation of the estimates, or else 0.3 of the prior's scale."""
    found = np.array(0.3 * scale)
    for p in range(size):
        values = [float(one.values[np.flatnonzero(one.indices == p)[0]]) for one in experiments if p in one.indices]
        if len(values) > 1 and np.std(values) > 0:
            found[p] = np.std(values, ddof=1)
    return found


def _conditional_draws(
    experiments: list[ExperimentEstimate], root: Array, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Draws of means (m, p, q) and experiments (m, j, p) from their normal distributions for given `root`."""
    count, size = root.shape[:2]
    covariance = root @ root.transpose(0, 2, 1)
    _, precision, best = log_evidence(experiments, covariance)
    upper = np.linalg.cholesky(precision).transpose(0, 2, 1)
    noise = generator.standard_normal((count, precision.shape[1], 1))
    mean = (best + np.linalg.solve(upper, noise)[:, :, 0]).reshape(count, size, -1)
    members = np.empty((count, len(experiments), size))
    for j, one in enumerate(experiments):  # draw from the prior and correct it by the misfit (Hoffman & Ribak 1991)
        members[:, j] = drawn = mean @ one.design + (root @ generator.standard_normal((count, size, 1)))[:, :, 0]
        if not len(one.indices):  # an experiment that determines no coordinate changes nothing
            continue
        seen = drawn[:, one.indices] + generator.multivariate_normal(
            np.zeros(len(one.indices)), one.covariance, size=count, method="eigh"
        )
        variance = one.covariance + covariance[:, one.indices[:, None], one.indices]
        missed = np.linalg.solve(variance, (one.values - seen)[:, :, None])
        members[:, j] += (covariance[:, :, one.indices] @ missed)[:, :, 0]
    return mean, members


def run_walkers(
    log_density: Callable[[Array], Array], begin: Array, steps: int, seed: int, what: str, differences: bool = False
) -> tuple[Any, float]:
    """Run an affine-invariant MCMC sampler; return it and the longest autocorrelation time.

    Parameters
    ----------
    log_density : callable
        Function of points (m, p) that returns the logarithm of the density (m,), up to a constant.
    begin : ndarray (walkers, p)
        Starting points.
    steps : int
        Steps of every walker.
    seed : int
    what : str
        Name of the task, for the error message if emcee is missing.
    differences : bool
        True to move a walker along the difference of two other walkers (ter Braak & Vrugt 2008) instead of along the
        line to another walker; in 10 to 15 dimensions this needed a third of the steps.

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
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)] if differences else None
    sampler = emcee.EnsembleSampler(*begin.shape, log_density, vectorize=True, moves=moves)
    sampler._random = np.random.RandomState(seed % 2**32)
    sampler.run_mcmc(begin, steps, skip_initial_state_check=True)
    return sampler, float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))


def spread_of_chains(chains: Array) -> float:
    """Split R-hat of chains (c, n) of one quantity: 1 if the halves of all chains agree, larger if they do not."""
    half = chains.shape[1] // 2
    if half < 2:
        return np.inf
    parts = np.concatenate([chains[:, :half], chains[:, -half:]])
    within = float(np.mean(np.var(parts, axis=1, ddof=1)))
    between = float(np.var(np.mean(parts, axis=1), ddof=1))
    return float(np.sqrt((half - 1) / half + between / within)) if within > 0 else np.inf
