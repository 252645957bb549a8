"""Random kicks of random rigs against long integrations by SciPy and long simulations; thresholds and basins likewise.

    python benchmarks/kicks.py [--kicks 300] [--thresholds 60] [--basins 6] [--seed 1] [--only "aging mass level,..."]

Every law (two states, Nagata, LuGre), with and without mass or radiation damping, level and tilted contacts, every
kind of kick, stable and unstable rigs. Prints each disagreement and tables: right (found is what both say, or what one
says where the other cannot tell), wrong, undecided, unclear (neither can tell); CPU seconds. A threshold is right where
the outcome changes at .99 and 1.01 of it, and simulation says so too where it can tell.
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

import steadyslip as ss

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from kicks_at_random import KINDS, Reference, drawn, judged, outcome_of, simulated

EVERY = 25  # lines of the table


def word_of(found: str, truths: tuple[str, ...]) -> str:
    """Right, wrong, undecided or unclear."""
    told = {truth for truth in truths if truth != "?"}
    if found == "undecided":
        return found
    if not told:
        return "unclear"
    return "right" if told == {found} else "wrong"


def kicks(count: int, random: np.random.Generator, only: tuple[str, ...]) -> None:
    counts: Counter[str] = Counter()
    both = 0
    spent = np.zeros(3)
    for i in range(count):
        case = drawn(random, only)
        found, truths, times = "", [], [time.process_time()]
        for route in (outcome_of, lambda case: Reference(case).outcome(), simulated):
            truths.append(route(case))
            times.append(time.process_time())
        spent += np.diff(times)
        found, *truths = truths
        word = word_of(found, tuple(truths))
        counts[word] += 1
        both += word == "right" and "?" not in truths
        if word != "right":
            print(f"{word}: {found} (SciPy: {truths[0]}, simulated: {truths[1]}): {case}", flush=True)
        if i + 1 == count or (i + 1) % EVERY == 0:
            costs = "CPU {:.0f} s, SciPy {:.0f} s, simulations {:.0f} s".format(*spent)
            print(f"kicks {i + 1}: {dict(counts)}, right by both {both}; {costs}", flush=True)


def thresholds(count: int, random: np.random.Generator, only: tuple[str, ...]) -> None:
    """Until so many have been found; those of unstable rigs, and where no kick fails, are counted beside."""
    counts: Counter[str] = Counter()
    spent = []
    while sum(counts.values()) - counts["none fails"] - counts["unstable"] < count:
        case = drawn(random, only)
        begun = time.process_time()
        limit = ss.threshold(case.rig, case.kick, direction=case.direction, reference=case.reference, precision=1e-5)
        spent.append(time.process_time() - begun)
        if limit.size in (0, np.inf):
            counts["unstable" if limit.size == 0 else "none fails"] += 1
            continue
        word, pair, truths = "undecided", [], []
        if limit.size > 0:
            pair = [outcome_of(case, limit.size * factor) for factor in (0.99, 1.01)]
            truths = [simulated(case, limit.size * factor) for factor in (0.99, 1.01)]
            beyond = limit.edge or pair[1] != "undecided"
            word = "right" if pair[0] == "returns" != pair[1] and beyond else "wrong"
            word = "undecided" if word == "wrong" and "undecided" in pair else word
            if truths[0] not in ("returns", "?") or truths[1] == "returns":
                word = "wrong" if word == "right" else word
        counts[word] += 1
        if word != "right":
            print(f"{word}: {pair} (simulated: {truths}), {limit}: {case}", flush=True)
        if sum(counts.values()) % EVERY == 0:
            print(f"thresholds: {dict(counts)}", flush=True)
    print(f"thresholds: {dict(counts)}; CPU median {np.median(spent):.1f} s, largest {max(spent):.1f} s", flush=True)


def basins(count: int, random: np.random.Generator, only: tuple[str, ...]) -> None:
    """Twelve starting points of each rig that can be started anywhere and has no end of turns to be waited for."""
    counts: Counter[str] = Counter()
    done = 0
    spent = np.zeros(2)
    while done < count:
        case = drawn(random, only)
        rig, reference, rest = case.rig, Reference(case), case.kicked().rest
        if not rest.exists[0] or abs(rest.leading[0].real) < 1e-3 * abs(rest.leading[0]):
            continue
        drive, begun = rig.drive.velocity, time.process_time()
        x, v = reference.length * np.linspace(-20, 8, 4), drive * np.geomspace(0.1, 30, 3)
        found = ss.basin(rig, x, v, progress=False)
        between = time.process_time()
        turn = 2 * np.pi / abs(rest.leading[0])
        end = min(200 * turn, 1000 * reference.length / drive + 60 * turn) + 3 * abs(x[0]) / drive
        for i, j in np.ndindex(found.outcome.shape):
            truth = followed(rig, reference, {"x": x[j], "v": v[i]}, end)
            word = word_of(str(found.outcome[i, j]), (truth,))
            counts[word] += 1
            if word != "right":
                print(
                    f"{word}: {found.outcome[i, j]} (simulated: {truth}) from x={x[j]!r}, v={v[i]!r}: {case}",
                    flush=True,
                )
        done += 1
        spent += between - begun, time.process_time() - between
        print("basins {}: {}; CPU {:.0f} s, simulations {:.0f} s".format(done, dict(counts), *spent), flush=True)


def followed(rig: ss.Slider, reference: Reference, start: dict[str, float], end: float) -> str:
    """What a long simulation from a starting point comes to."""
    try:
        run = ss.simulate(rig, until=end, initial=start, times=np.linspace(0, end, 4001), rtol=1e-8, events=False,
                          most_steps=300_000)  # fmt: skip
    except ss.SteadyslipError:
        return "?"
    if run.status != "done":
        return run.status if run.status in ("blow-up", "contact lost") else "?"
    return judged(reference.from_load(run["v"] / rig.drive.velocity))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kicks", type=int, default=300)
    parser.add_argument("--thresholds", type=int, default=60)
    parser.add_argument("--basins", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(KINDS))
    options = parser.parse_args()
    only = tuple(options.only.split(","))
    for part, count in ((kicks, options.kicks), (thresholds, options.thresholds), (basins, options.basins)):
        if count:
            part(count, np.random.default_rng(options.seed), only)


if __name__ == "__main__":
    main()
