"""Machines by their symbolic Model and by matrices: two routes that share the laws' expressions only.

``python tests/helpers/machines_both_ways.py KIND COUNT SEED`` compares eigenvalues and all edges of random
machines, KIND "row" or "plane". `row_of_blocks` is typed here a third time, for machines too large for symbols.
"""

import sys

import numpy as np

import steadyslip as ss
from counting import count_differences
from machines import at_random, rate_state, surface
from machines_in_the_plane import in_the_plane
from steadyslip.linear.coupling import search_for
from steadyslip.linear.matrix_route import require_matrices
from steadyslip.linear.matrix_search import MatrixSearch

TINY = 1e-9  # of a parameter's own value: edges nearer to zero are those of a zero that rounding hides


def row_of_blocks(count, everywhere=False):
    """Blocks in a row that a drive pulls, on the ground at the last or at all; and its matrix of s typed with NumPy."""
    names = [f"b{i}" for i in range(count)]
    masses, springs = 1 + 0.07 * np.arange(count), 50 + 5 * np.arange(count)
    links = {
        f"to-{name}": ss.machine.Spring(between=(before, name), stiffness=k, damping=0.05)
        for before, name, k in zip(["drive", *names], names, springs, strict=False)
    }
    rough = range(count) if everywhere else range(count - 1, count)
    contacts = {f"at-{names[i]}": surface(names[i], rate_state(0.5, -0.3 - 0.01 * i, 1.0)) for i in rough}
    bodies = {name: ss.machine.SlidingBody(mass=mass) for name, mass in zip(names, masses, strict=True)}
    machine = ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=1.0))

    def matrix(s):
        whole = np.diag(masses * s * s).astype(complex)
        for i, k in enumerate(springs):
            row = np.zeros(count)
            row[i], row[i - 1 if i else i] = 1.0, -1.0 if i else 1.0
            whole += (k + 0.05 * s) * np.outer(row, row)
        for i in rough:
            whole[i, i] += s * (0.5 * s - 0.3 - 0.01 * i) / (s + 1)
        return whole

    return machine, matrix


def differences(machine):
    """Words on what the two routes answer differently; empty if they agree."""
    point = require_matrices(machine)
    own = ss.eigenvalues(machine)
    own = own[np.isfinite(own)]
    if not point.balance.exists or not own.size:
        return [] if bool(point.balance.exists) == bool(own.size) else ["steady sliding"]
    found = []
    other = point.pencil.eigenvalues
    if len(own) != len(other) or abs(own[0] - other[np.argmin(abs(other - own[0]))]) > 1e-9 * abs(own[0]):
        found.append("eigenvalues")
    for margin in ss.margins(machine):
        name = margin.parameter
        by_symbols = search_for(machine, name, machine.kept_zeros(name), 0)  # not taken by margins of large machines
        low, high = by_symbols.searched
        least = TINY * abs(margin.value)
        edges = [
            [(e.value, e.kind, e.stable) for e in several if low < e.value < high and not 0 < abs(e.value) < least]
            for several in (by_symbols.boundaries(None), MatrixSearch(machine, name).boundaries())
        ]
        alike = len(edges[0]) == len(edges[1]) and all(
            abs(a[0] - b[0]) <= 1e-6 * abs(a[0]) and a[1:] == b[1:] for a, b in zip(*edges, strict=True)
        )
        if not alike:
            found.append(f"{name} = {margin.value:g}: by symbols {edges[0]}, by matrices {edges[1]}")
    return found


def machine_of(kind, seed):
    """The random machine of a seed; None if it has a delay."""
    one = at_random(seed)[0] if kind == "row" else in_the_plane(seed)
    if kind == "row":
        return one
    return None if one.delay else one.machine


if __name__ == "__main__":

    def compared(seed):
        machine = machine_of(sys.argv[1], seed)
        return (0, []) if machine is None else (1, [f"{seed}: {word}" for word in differences(machine)])

    count_differences(compared, *map(int, sys.argv[2:4]))
