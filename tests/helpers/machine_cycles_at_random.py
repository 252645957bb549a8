"""Cycles of random sliders and of the machines of one body that they are, and of machines with an idle body.

``python tests/helpers/machine_cycles_at_random.py COUNT SEED`` does many by hand.
"""

import sys

import numpy as np

import steadyslip as ss
from kicks_at_random import drawn
from machine_kicks_at_random import as_machine

POINTS = 12


def of_one_body(block, points=POINTS):
    """Values and periods of the first cycles from the edge, of a slider and of its machine; None where it has none."""
    machine, found = as_machine(block), []
    for rig, along in ((block, "stiffness"), (machine, "links.spring.stiffness")):
        try:
            branch = ss.cycles(rig, along, most_points=points, doublings=0)
        except ss.NotAvailable as error:
            found.append(str(error).partition(" along")[0])
            continue
        found.append(branch)
    return found


def apart(own, other):
    """Relative differences of two branches: onset, and periods at equal values."""
    if isinstance(own, str) or isinstance(other, str):
        return 0.0 if isinstance(own, str) == isinstance(other, str) else np.inf
    onset = abs(own.onset.value / other.onset.value - 1)
    kinds = own.onset.kind == other.onset.kind or "degenerate" in (own.onset.kind, other.onset.kind)
    count = min(len(own), len(other))
    if not kinds or (count < 2) != (max(len(own), len(other)) < 2):
        return np.inf
    if count < 2:
        return onset
    periods = [
        abs(a.period / b.period - 1)
        for a, b in zip(own.cycles[:count], other.cycles[:count], strict=True)
        if abs(a.value / b.value - 1) < 1e-9
    ]
    amplitudes = max(len(own), len(other)) / count
    return max([onset, *periods]) if amplitudes < 2 else np.inf


def main(count, seed):
    random, worst = np.random.default_rng(seed), 0.0
    for i in range(count):
        case = drawn(random)
        own, other = of_one_body(case.rig)
        off = apart(own, other)
        worst = max(worst, off if np.isfinite(off) else 0.0)
        if off > 1e-6:
            print("CYCLES", i, off, case.kind, case.rig, str(own), str(other), flush=True)
    print(f"{count} branches, largest difference {worst:.2g}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
