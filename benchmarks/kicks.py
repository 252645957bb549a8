"""Random kicks of random rigs against long integrations by SciPy and long simulations; thresholds and basins likewise.

    python benchmarks/kicks.py [--kicks 300] [--thresholds 60] [--basins 6] [--seed 1] [--only "aging mass level,..."]
                               [--first 0] [--truths FILE]

Every law (two states, Nagata, LuGre), with and without mass or radiation damping, level and tilted contacts, every
kind of kick, stable and unstable rigs. Prints each disagreement and tables: right (found is what both say, or what one
says where the other cannot tell), wrong, undecided, unclear (neither can tell, not even in four times as long); CPU
seconds. A threshold is right where
the outcome changes at .99 and 1.01 of it, and simulation says so too where it can tell.

Each case has a number of its own, drawn from it and the seed: `--first` begins a scan anywhere. What SciPy says of a
kick is kept in FILE, if one is named, and not integrated again.
"""

import argparse
import json
import sys
import time
from collections import Counter
from itertools import count as numbers
from pathlib import Path

import numpy as np
from quick import parsed

import steadyslip as ss

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))
from kicks_at_random import KINDS, Drawn, drawn, outcome_of
from kicks_by_scipy import Reference, judged, simulated

EVERY = 25  # lines of the table
TURNS, SECONDS = 150.0, 8.0  # that references follow a motion for,
LONGER = 4.0  # and so many times longer where none can tell
SLOW = 5.0  # CPU seconds from which a threshold is named


def word_of(found: str, truths: tuple[str, ...]) -> str:
    """Right, wrong, undecided or unclear."""
    told = {truth for truth in truths if truth != "?"}
    if found == "undecided":
        return found
    if not told:
        return "unclear"
    return "right" if told == {found} else "wrong"


class Cases:
    """Random cases by number, and what SciPy says of each."""

    def __init__(self, seed: int, only: tuple[str, ...], truths: Path | None) -> None:
        self.seed, self.only, self.file = seed, only, truths
        self.said: dict[str, str] = json.loads(truths.read_text()) if truths and truths.exists() else {}

    def __getitem__(self, i: int) -> Drawn:
        return drawn(np.random.default_rng([self.seed, i]), self.only)

    def by_scipy(self, i: int, case: Drawn, longer: float = 1.0) -> str:
        key = f"{self.seed} {i} {case}" + (f" {longer}" if longer > 1 else "")
        if key not in self.said:
            self.said[key] = Reference(case).outcome(turns=longer * TURNS, limit=longer * SECONDS)
            if self.file:
                self.file.write_text(json.dumps(self.said, indent=0))
        return self.said[key]


def kicks(cases: Cases, first: int, count: int) -> None:
    counts: Counter[str] = Counter()
    both = 0
    spent, slowest = np.zeros(3), 0.0
    for i in range(first, first + count):
        case = cases[i]
        found, truths, times = "", [], [time.process_time()]
        for route in (outcome_of, lambda case, i=i: cases.by_scipy(i, case), simulated):
            truths.append(route(case))
            times.append(time.process_time())
        spent += np.diff(times)
        slowest = max(slowest, times[1] - times[0])
        found, *truths = truths
        if found != "undecided" and set(truths) == {"?"}:
            truths = [cases.by_scipy(i, case, LONGER), simulated(case, turns=LONGER * TURNS)]
        word = word_of(found, tuple(truths))
        counts[word] += 1
        both += word == "right" and "?" not in truths
        if word != "right":
            print(f"{i} {word}: {found} (SciPy: {truths[0]}, simulated: {truths[1]}): {case}", flush=True)
        if i + 1 == first + count or (i + 1) % EVERY == 0:
            costs = "CPU {:.0f} s (largest {:.1f}), SciPy {:.0f} s, simulations {:.0f} s".format(
                spent[0], slowest, *spent[1:]
            )
            print(f"kicks {first} to {i}: {dict(counts)}, right by both {both}; {costs}", flush=True)


def thresholds(cases: Cases, first: int, count: int) -> None:
    """Until so many have been found; those of unstable rigs, and where no kick fails, are counted beside."""
    counts: Counter[str] = Counter()
    spent = []
    for i in numbers(first):
        if sum(counts.values()) - counts["none fails"] - counts["unstable"] >= count:
            break
        case = cases[i]
        begun = time.process_time()
        limit = ss.threshold(case.rig, case.kick, direction=case.direction, reference=case.reference, precision=1e-5)
        spent.append(time.process_time() - begun)
        if spent[-1] > SLOW:
            print(f"{i} slow: {spent[-1]:.1f} s, {limit}: {case}", flush=True)
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
            print(f"{i} {word}: {pair} (simulated: {truths}), {limit}, {spent[-1]:.1f} s: {case}", flush=True)
        if (i + 1) % EVERY == 0:
            print(f"thresholds {first} to {i}: {dict(counts)}", flush=True)
    print(f"thresholds: {dict(counts)}; CPU median {np.median(spent):.1f} s, largest {max(spent):.1f} s", flush=True)


def basins(cases: Cases, first: int, count: int) -> None:
    """Twelve starting points of each rig that can be started anywhere and has no end of turns to be waited for."""
    counts: Counter[str] = Counter()
    done = 0
    spent = np.zeros(2)
    for i in numbers(first):
        if done >= count:
            break
        case = cases[i]
        rig, reference, rest = case.rig, Reference(case), case.kicked().rest
        if not rest.exists[0] or abs(rest.leading[0].real) < 1e-3 * abs(rest.leading[0]):
            continue
        drive, begun = rig.drive.velocity, time.process_time()
        x, v = reference.length * np.linspace(-20, 8, 4), drive * np.geomspace(0.1, 30, 3)
        found = ss.basin(rig, x, v, progress=False)
        between = time.process_time()
        turn = 2 * np.pi / abs(rest.leading[0])
        end = min(200 * turn, 1000 * reference.length / drive + 60 * turn) + 3 * abs(x[0]) / drive
        for (row, column), outcome in np.ndenumerate(found.outcome):
            start = {"x": x[column], "v": v[row]}
            truth = followed(rig, reference, start, end)
            word = word_of(str(outcome), (truth,))
            counts[word] += 1
            if word != "right":
                print(f"{i} {word}: {outcome} (simulated: {truth}) from {start}: {case}", flush=True)
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
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--truths", type=Path)
    options = parsed(parser, kicks=1, thresholds=0, basins=0)
    cases = Cases(options.seed, tuple(options.only.split(",")), options.truths)
    for part, count in ((kicks, options.kicks), (thresholds, options.thresholds), (basins, options.basins)):
        if count:
            part(cases, options.first, count)


if __name__ == "__main__":
    main()
