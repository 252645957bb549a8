"""Random kicks of random rigs against long integrations by SciPy, and thresholds against motion on both sides.

    python benchmarks/kicks.py [--kicks 300] [--thresholds 40] [--seed 1] [--only aging-mass,...]

Prints each disagreement and a table: right, wrong, undecided, unclear to the reference itself; CPU seconds.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import steadyslip as ss

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from kicks_at_random import KINDS, Reference, drawn, outcome_of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kicks", type=int, default=300)
    parser.add_argument("--thresholds", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(KINDS))
    options = parser.parse_args()
    random, only = np.random.default_rng(options.seed), tuple(options.only.split(","))
    counts = dict.fromkeys(("right", "wrong", "undecided", "unclear"), 0)
    own = other = 0.0
    for _ in range(options.kicks):
        case = drawn(random, only)
        start = time.process_time()
        found = outcome_of(case)
        middle = time.process_time()
        truth = Reference(case).outcome()
        own, other = own + middle - start, other + time.process_time() - middle
        word = (
            "undecided"
            if found == "undecided"
            else "unclear"
            if truth == "?"
            else "right"
            if found == truth
            else "wrong"
        )
        counts[word] += 1
        if word != "right":
            print(f"{word}: {found} (reference: {truth}): {case}", flush=True)
    print(f"kicks: {counts}; CPU {own:.1f} s, SciPy {other:.1f} s", flush=True)
    counts = dict.fromkeys(("change", "none", "wrong", "undecided"), 0)
    start = time.process_time()
    for _ in range(options.thresholds):
        case = drawn(random, only)
        limit = ss.threshold(case.rig, case.kick, direction=case.direction)
        if limit.size in (0, np.inf):
            counts["none"] += 1
            continue
        pair = [outcome_of(case, limit.size * factor) for factor in (0.99, 1.01)] if limit.size > 0 else ["undecided"]
        good = pair[0] == "returns" and pair[-1] not in ("returns", "undecided")
        word = "change" if good else "undecided" if "undecided" in pair else "wrong"
        word = "change" if limit.edge and pair[0] == "returns" and pair[-1] != "returns" else word
        counts[word] += 1
        if word != "change":
            print(f"{word}: {pair}, {limit}: {case}", flush=True)
    print(f"thresholds: {counts}; CPU {time.process_time() - start:.1f} s")


if __name__ == "__main__":
    main()
