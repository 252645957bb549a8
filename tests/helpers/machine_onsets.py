"""The cubic coefficient of an onset from motion alone: the rates that kernels integrate, differentiated in steps."""

import numpy as np
import sympy as sp

import steadyslip as ss
from machines import at_random
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.kicks.field import solved_at
from steadyslip.nonlinear.kicks.settled import rest_of

STEPS = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)  # in natural sizes: how curved rates are differs by decades


def coefficient_of_motion(machine, onset):
    """c1 by Kuznetsov's formula, all derivatives by central differences of the rates; and how sure it is.

    Of several steps those are taken that agree best with each other: larger ones miss, smaller ones are rounding.
    """
    found = _by_differences(machine, onset)
    apart = np.abs(np.diff(found))
    best = int(np.nanargmin(apart))
    return found[best + 1], apart[best]


def _by_differences(machine, onset):
    """With each step."""
    edge = machine.with_values({onset.along: onset.value})
    jobs = prepare(edge, None, 1.0, {}, {}, Options())
    drive = np.atleast_1d(np.asarray(jobs.point.drive, dtype=float))
    rest = rest_of(jobs, drive, np.zeros(1))
    place = [one.name for one in jobs.point.model.contacts].index(onset.contact)
    scales = rest.scales[0]

    def rates(*away):
        states = rest.state[0] + scales * np.array(away)
        return solved_at(rest, states[None])[0][0] / scales

    def double(v, h):
        up, middle, down = rates(h * v, 0 * v, -h * v)
        return (up - 2 * middle + down) / h**2

    def triple(v, h):
        far, up, down, back = rates(2 * h * v, h * v, -h * v, -2 * h * v)
        return (far - 2 * up + 2 * down - back) / (2 * h**3)

    def both(u, v, h):
        """Second derivative in two complex directions."""
        real = lambda x, y: (double(x + y, h) - double(x - y, h)) / 4  # noqa: E731
        a, b, c, d = u.real, u.imag, v.real, v.imag
        return real(a, c) - real(b, d) + 1j * (real(a, d) + real(b, c))

    matrix = rest.matrix[0]
    roots, vectors = np.linalg.eig(matrix)
    k = int(np.argmin(np.abs(roots - 1j * onset.angular_frequency)))
    q, iw = vectors[:, k], 1j * onset.angular_frequency
    sliding = jobs.reduction.slidings[place]
    slip = jobs.point.model.function([*(sp.diff(sliding.slip, s) for s in jobs.reduction.state), sliding.ratio])
    *row, ratio = (float(np.ravel(one)[0]) for one in jobs.point.evaluate(slip))
    q = q / (2 * iw * (np.array(row) * scales) @ q) * abs(ratio * drive[0])
    rows, left = np.linalg.eig(matrix.T)
    p = left[:, int(np.argmin(np.abs(rows - roots[k])))]
    p = p / (p @ q)  # of the transposed matrix: no conjugate
    a, b, one = q.real, q.imag, np.eye(len(q))
    found = []
    for h in STEPS:
        plus, minus, ca, cb = triple(a + b, h), triple(a - b, h), triple(a, h), triple(b, h)
        abb, aab = (plus + minus - 2 * ca) / 6, (plus - minus - 2 * cb) / 6
        mean = np.linalg.solve(matrix, both(q, q.conj(), h))
        twice = np.linalg.solve(2 * iw * one - matrix, both(q, q, h))
        terms = ca + abb + 1j * (aab + cb) - 2 * both(q, mean, h) + both(q.conj(), twice, h)
        found.append(0.5 * float(np.real(p @ terms)))
    return np.array(found)


def compared(seed):
    """Difference of both coefficients of a random machine beyond their error, as a share of the terms they are
    sums of; None where there is nothing to compare.
    """
    machine, _ = at_random(seed)
    try:
        onset = ss.analyze(machine).onset
        if onset is None:
            return None
        found, unsure = coefficient_of_motion(machine, onset)
    except ss.NotAvailable:  # motion is not offered, or lost in rounding
        return None
    return max(abs(onset.coefficient - found) - 3 * unsure, 0.0) * onset.share / abs(onset.coefficient)
