"""Estimates of several experiments as members of one population: normal in coordinates, spread unknown.

Experiment j has true coordinates θ_j = X_j β + N(0, diag τ²) and says of some of them z_j = θ_j + N(0, C_j). The mean β
is integrated out with a flat prior, the spreads τ have half-normal ones and are sampled; β and θ follow from them
exactly (Gelman et al. 2013, Bayesian Data Analysis, ch. 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.numerics.sampling import walked

LEAST = -16.0  # logarithm of a spread, in units of the prior: below, it is none
WALKERS, BURN = 40, 250
APART = 20  # steps between draws of a walker, about as many as they remember,
FEWEST = 350  # steps, however few draws


@dataclass(frozen=True, eq=False)
class Told:
    """What one experiment says.

    Attributes
    ----------
    seen : ndarray of int (k,)
        Which of the p coordinates it determines.
    values : ndarray (k,)
    covariance : ndarray (k, k)
    design : ndarray (q,)
        1, and how far its conditions are from the mean.
    """

    seen: Array
    values: Array
    covariance: Array
    design: Array

    def slopes(self, size: int) -> Array:
        """How what is seen follows from β, (k, p q)."""
        found = np.zeros((len(self.seen), size, len(self.design)))
        found[np.arange(len(self.seen)), self.seen] = self.design
        return found.reshape(len(self.seen), -1)


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


def log_evidence(told: list[Told], spread: Array) -> tuple[Array, Array, Array]:
    """Logarithm of the probability of what was seen, for spreads (m, p), β's precision and best value."""
    count, size = spread.shape
    width = size * len(told[0].design)
    precision, pull, rest = np.zeros((count, width, width)), np.zeros((count, width)), np.zeros(count)
    for many in {len(one.seen) for one in told} - {0}:  # side by side, as many as see as many coordinates
        alike = [one for one in told if len(one.seen) == many]
        seen = np.array([one.seen for one in alike])
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


def pooled(told: list[Told], size: int, scale: Array, count: int, seed: int) -> Pooled:
    """Draw from the posterior.

    Parameters
    ----------
    told : list of Told
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
        inside = np.all((u > LEAST) & (u < 4.0), axis=1)
        if np.any(inside):
            share = np.exp(u[inside])  # of the prior's scale; the last term is the change to logarithms
            found[inside] = log_evidence(told, scale * share)[0] + np.sum(u[inside] - 0.5 * share**2, axis=1)
        return found

    generator = np.random.default_rng(seed)
    walkers = max(WALKERS, 2 * size + 2)
    begin = np.log(_scatter(told, size, scale) / scale) + 0.5 * generator.standard_normal((walkers, size))
    each = -(-count // walkers)
    steps = max(APART * each, FEWEST)
    sampler, time = walked(log_probability, np.clip(begin, LEAST + 1, 3.0), BURN + steps, seed, "a population")
    kept = sampler.get_chain(discard=BURN)
    own = np.round(np.linspace(0, steps - 1, each)).astype(int)
    spread = scale * np.exp(kept[own].transpose(1, 0, 2).reshape(-1, size))
    return _given(told, spread, time, walkers, generator)


def _scatter(told: list[Told], size: int, scale: Array) -> Array:
    """Rough spreads to begin with: of the estimates themselves."""
    found = np.array(0.3 * scale)
    for p in range(size):
        values = [float(one.values[np.flatnonzero(one.seen == p)[0]]) for one in told if p in one.seen]
        if len(values) > 1 and np.std(values) > 0:
            found[p] = np.std(values, ddof=1)
    return found


def _given(told: list[Told], spread: Array, time: float, chains: int, generator: np.random.Generator) -> Pooled:
    """Means and members for given spreads, exactly."""
    count, size = spread.shape
    _, precision, best = log_evidence(told, spread)
    root = np.linalg.cholesky(precision)
    noise = generator.standard_normal((count, precision.shape[1], 1))
    mean = best + np.linalg.solve(root.transpose(0, 2, 1), noise)[:, :, 0]
    mean = mean.reshape(count, size, -1)
    members = np.empty((count, len(told), size))
    for j, one in enumerate(told):  # a draw from the prior, moved by what it misses (Hoffman & Ribak 1991)
        drawn = mean @ one.design + spread * generator.standard_normal((count, size))
        seen = drawn[:, one.seen] + generator.multivariate_normal(
            np.zeros(len(one.seen)), one.covariance, size=count, method="eigh"
        )
        variance = one.covariance + np.eye(len(one.seen)) * spread[:, None, one.seen] ** 2
        weight = np.linalg.solve(variance, (one.values - seen)[:, :, None])[:, :, 0]
        drawn[:, one.seen] += spread[:, one.seen] ** 2 * weight
        members[:, j] = drawn
    return Pooled(mean, spread, members, time, chains)
