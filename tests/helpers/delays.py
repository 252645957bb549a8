"""Delay equations at random, and two routes to their roots that know nothing of the package."""

from dataclasses import replace

import numpy as np

import steadyslip as ss
from machines import surface, two_mass


def spectral(c, h, nodes=40):
    """Rightmost eigenvalues of Σ c_j(d/dt) x(t − h_j) = 0, c_0 the highest, by collocation at Chebyshev's points."""
    n, longest = len(c[0]) - 1, max(h)
    i = np.arange(nodes + 1)
    x = np.cos(np.pi * i / nodes)
    weights = np.where((i == 0) | (i == nodes), 0.5, 1.0) * (-1.0) ** i
    difference = x[:, None] - x[None, :] + np.eye(nodes + 1)
    slopes = weights[None, :] / weights[:, None] / difference
    slopes -= np.diag(slopes.sum(axis=1))
    whole = np.kron(slopes * 2 / longest, np.eye(n)).astype(float)
    whole[:n] = 0.0
    whole[: n - 1, 1:n] = np.eye(n - 1)
    for row, delay in zip(c, h, strict=True):
        at = 1 - 2 * delay / longest
        near = np.abs(at - x) < 1e-14
        share = near.astype(float) if near.any() else weights / (at - x) / np.sum(weights / (at - x))
        for k in range(n):
            whole[n - 1, k::n] -= share * row[k] / c[0][n]
    found = np.linalg.eigvals(whole)
    return found[np.argsort(-found.real)]


def some(seed, terms=2):
    """A quasi-polynomial of degree 1 to 6 at random, its delays up to a few turns of its roots."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    c = random.normal(size=(terms, n + 1))
    c[1:, n] = 0.0
    c[0, n] = 1.0
    return c, np.concatenate([[0.0], 10 ** random.uniform(-1, 0.6, terms - 1)])


def winding(matrix, fast):
    """Zeros to the right of the axis of a determinant without poles there, by how it turns from 0 to beyond `fast`."""
    omega = np.concatenate([np.geomspace(1e-5, 1.0, 1000), np.geomspace(1.0, fast, 4000)[1:]])
    turns = np.unwrap([np.angle(np.linalg.det(matrix(1j * w))) for w in omega])
    far = np.geomspace(fast, 1e3 * fast, 400)  # where derivatives are delayed, size and turn go up and down for good
    degree = round(np.polyfit(np.log(far), [np.log(abs(np.linalg.det(matrix(1j * w)))) for w in far], 1)[0])
    return round((degree * np.pi / 2 - (turns[-1] - turns[0])) / np.pi)


def apart(terms):
    """Which delays act in each of so many terms of a sum: none in the first, one of its own in every other."""
    return np.eye(terms, dtype=bool)[:, 1:]


def lagging(k, damping=0.05, slope=0.1, lag=1.0):
    """theory 10's lag check: m s² + (c + S exp(−sδ)) s + k with m = 1, S and δ = `slope` and `lag` of the friction."""
    difference = slope / (-2 * np.exp(-1.0))
    friction = ss.laws.CoulombStribeck(mu_coulomb=0.6, mu_static=0.6 + difference, v_stribeck=1.0, lag=lag)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=k, damping=damping)},
        contacts={"guide": surface("block", friction)},
        drive=ss.machine.Pull(velocity=1.0),
    )


def late_axis(delay="0 s"):
    return replace(
        two_mass(kp=4.0, kd=3.0), drive=ss.machine.PositionPD(velocity=1.0, body="motor", kp=4, kd=3, delay=delay)
    )
