"""Work of thresholds and branches of cycles of random structures of 2 to 8 degrees of freedom.

``python tests/helpers/structure_work_at_random.py COUNT SEED`` prints the CPU seconds of each and what was found.
"""

import sys
import time
from dataclasses import replace

import numpy as np

import steadyslip as ss
from structures_at_random import random_structure

KICKS = {"velocity": "s.p0", "impulse": "s.p0", "force": "s.p0", "normal-force": "c0"}
LONG = 15.0  # CPU seconds beyond which a case is counted as long


def drawn(seed):
    """A machine of one structure with one or two contacts, whose modes ring in every third case."""
    chance = np.random.default_rng([36, seed])
    contacts = int(chance.integers(1, 3))
    size = int(chance.integers(2 * contacts, 9))
    machine, _ = random_structure(chance, size, contacts)
    body = machine.bodies["s"]
    if seed % 3 == 0:
        rings = replace(body.matrices, damping=1e-2 * body.matrices.damping)
        machine = replace(machine, bodies={"s": replace(body, matrices=rings)})
    return machine, list(KICKS)[seed % len(KICKS)], "steady_normal_stress" if contacts == 1 else "drive.velocity"


def timed(ask, *given, **more):
    """CPU seconds of a question, and the first line of its answer or refusal."""
    start = time.process_time()
    try:
        words = str(ask(*given, **more))
    except ss.NotAvailable as refusal:
        words = f"refused: {refusal}"
    return time.process_time() - start, words.splitlines()[0]


def main(count, seed):
    taken = []
    for each in range(seed, seed + count):
        machine, kick, along = drawn(each)
        for found in (timed(ss.threshold, machine, kick, at=KICKS[kick]), timed(ss.cycles, machine, along)):
            taken.append(found[0])
            print(f"{each:4d} {found[0]:6.2f} s  {found[1][:150]}", flush=True)
    long = sum(one > LONG for one in taken)
    print(f"{len(taken)} questions, {long} took more than {LONG:g} CPU s; most {max(taken):.1f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
