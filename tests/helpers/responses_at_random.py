"""Responses of the reed of theory 13 and of random structures under contacts, and their roots by QZ typed by hand.

``python tests/helpers/responses_at_random.py COUNT SEED`` counts the growing roots of COUNT structures, half of them
unstable, from their responses alone: exact over the whole band, and with noise over bands cut at both ends.
"""

import sys

import numpy as np
import scipy.linalg as la

from steadyslip.machine import Machine, ResponseData, StructureBody, StructurePoint
from steadyslip.model.numeric.measured import measured_machine
from structures_at_random import by_hand, random_structure, reed_matrices


def noisy(chance, shape):
    """Complex numbers of mean square one."""
    return (chance.standard_normal(shape) + 1j * chance.standard_normal(shape)) / np.sqrt(2)


def response_of(mass, damping, stiffness, places, names, omega, noise=0.0, chance=None):
    """Response at degrees of freedom, with relative complex noise of known deviation."""
    dynamic = stiffness + 1j * omega[:, None, None] * damping - omega[:, None, None] ** 2 * mass
    found = np.linalg.solve(
        dynamic, np.broadcast_to(np.eye(len(mass))[:, places], (len(omega), len(mass), len(places)))
    )
    return _with_noise(omega, found[:, places], names, noise, chance)


def _with_noise(omega, found, names, noise, chance):
    error = noise * np.abs(found)
    if noise:
        found = found + error * noisy(chance, found.shape)
    return ResponseData(omega, found, error, tuple(names))


def band(mass, damping, stiffness, speed, contacts):
    """Frequencies (rad/s) that resolve every mode, from far below the first to far beyond contacts and modes."""
    n = len(mass)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-la.solve(mass, stiffness), -la.solve(mass, damping)]])
    roots = la.eigvals(state)
    roots = roots[roots.imag > 0]
    first, last = np.min(np.abs(roots)), np.max(np.abs(roots))
    end, found = 30 * max(last, *(speed / one[5] for one in contacts)), [1e-3 * first]
    while found[-1] < end:
        near = np.maximum(-0.07 * roots.real, 0.03 * np.abs(found[-1] - roots.imag))
        found.append(found[-1] + min(np.min(near), 0.03 * found[-1]))
    return np.array(found), first, last


def reed_response(omega, noise=0.0, chance=None):
    mass, _, stiffness = reed_matrices()
    squares, shapes = la.eigh(stiffness, mass)
    rows = shapes[[len(mass) - 3, len(mass) - 2]]
    den = 1 / (squares - omega[:, None] ** 2 + 1j * omega[:, None] * (1 + 2e-6 * squares))
    return _with_noise(omega, np.einsum("ia,pa,ja->pij", rows, den, rows), ("tip.x", "tip.y"), noise, chance)


def measured(machine, numbers, omega, noise=0.0, chance=None):
    """The machine with the response of its structure in place of the matrices."""
    mass, damping, stiffness, _, contacts = numbers
    places = [place for one in contacts for place in one[:2]]
    names = [f"p{i}.{axis}" for i in range(len(contacts)) for axis in "xy"]
    data = response_of(mass, damping, stiffness, places, names, omega, noise, chance)
    points = {name: StructurePoint(angle=one.angle) for name, one in machine.bodies["s"].points.items()}
    body = StructureBody(response=data, points=points)
    return Machine(bodies={"s": body}, contacts=dict(machine.contacts), drive=machine.drive)


def growing_by_hand(numbers):
    e, a = by_hand(*numbers)
    roots = la.eigvals(a, e)
    return int(np.sum(roots.real > 1e-9 * np.abs(roots)))


def reed_band():
    """Frequencies (rad/s) to 10 kHz, no more than .05 Hz apart near modes."""
    near = [mode + np.arange(-15, 15, 0.05) for mode in (174.066, 1090.855, 3054.469, 5985.6, 9894.0)]
    hertz = np.unique(np.concatenate([np.arange(0, 10e3, 4.0), *near]).round(6))
    return 2 * np.pi * hertz


def compared(count, seed):
    """How many counts are right, wrong and not decided, by kind of response."""
    chance, kinds = np.random.default_rng(seed), ("exact", "noise", "cut", "cut, noise")
    tally, left = {kind: {} for kind in kinds}, [count - count // 2, count // 2]
    tally["unstable"] = left[1]
    while any(left):
        machine, numbers = random_structure(chance, int(chance.integers(4, 13)), int(chance.integers(1, 3)))
        right = growing_by_hand(numbers)
        if not left[right > 0]:
            continue
        left[right > 0] -= 1
        omega, first, last = band(*numbers)
        cut = omega[(omega > first * 10 ** chance.uniform(-2, 0.7)) & (omega < last * 10 ** chance.uniform(-1, 1))]
        cut = cut if len(cut) >= 50 else omega[50:]
        for kind, places in zip(kinds, (omega, omega, cut, cut), strict=True):
            noise = 0.01 * kind.endswith("noise")
            found = measured_machine(measured(machine, numbers, places, noise, chance)).count.growing
            word = "undecided" if found is None else "right" if found == right else "wrong"
            tally[kind][word] = tally[kind].get(word, 0) + 1
    return tally


if __name__ == "__main__":
    print(compared(*map(int, sys.argv[1:])))
