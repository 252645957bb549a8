"""Cures of random rigs: `analyze`'s verdict is asked on both sides of every edge of every window.

As a script: python tests/helpers/cures_at_random.py 500 0 judges the windows of 500 random rigs, of seeds from 0 on.
"""

import math
import sys

import numpy as np

import steadyslip as ss
from rigs_of_theory import CONTACTS, rate_state, rig

BESIDE = 1e-6  # relative distance from an edge at which both sides are judged


def random_rig(seed):
    """A slider with random numbers, of any contact and either of two laws."""
    chance = np.random.default_rng(seed)
    contact = CONTACTS[seed % len(CONTACTS)]
    law = rate_state() if seed % 2 else rate_state(evolution=ss.laws.Aging())
    found = rig(friction=law, contact=contact, mass=1e3, damping=1e5)
    names = [n for n in ("friction.a", "friction.b", "slider.stiffness", "slider.mass", "slider.damping",
                         "drive.velocity") if found.value(n)]  # fmt: skip
    scatter = {"friction.a": 0.1, "friction.b": 0.1}
    return found.with_values({n: found.value(n) * math.exp(scatter.get(n, 2) * chance.normal()) for n in names})


def wrong_ends(rig):
    """Ends of windows of a rig without tolerances that `stability` contradicts on a side, and the number of sides."""
    wrong, sides = [], 0
    for one in ss.cure(rig).windows:
        for window in one.windows:
            for end, inner in zip(window, (1, -1), strict=True):
                if end in one.limits or not end:
                    continue
                for side in (inner, -inner):
                    value = end * (1 + side * BESIDE * math.copysign(1, end))
                    word = ss.stability(rig.with_values({one.parameter: value}))
                    sides += 1
                    if (word == "stable") != (side == inner):
                        wrong.append((one.parameter, value, word))
    return wrong, sides


def main(count, first):
    judged, failed = 0, []
    for seed in range(first, first + count):
        wrong, sides = wrong_ends(random_rig(seed))
        judged += sides
        failed += [(seed, *one) for one in wrong]
    print(f"{count} rigs from seed {first}: {judged} sides of edges judged, {len(failed)} wrong", *failed, sep="\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
