"""Ensembles of random rigs over threads, order and company: every number must stay the same, bit for bit.

    python benchmarks/equality.py [--count 200] [--seed S] [--lanes 96]

Each trial draws a law, a contact, a mass, a drive and a protocol, varies the stiffness (and more, by chance), and runs
the lanes on one thread; then on two, in another order, and half of them only. Rig-wise stability of the same points is
compared the same way. Counted: trials in which any number differs.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from quick import parsed

import steadyslip as ss
from fuzz_rigs import DRIVES, FRICTION, PROTOCOLS, _rig
from rigs_of_theory import CONTACTS

STEPS = 4000


def numbers(ensemble: ss.motion.Ensemble) -> Iterator[tuple[str, np.ndarray]]:
    """All that an ensemble holds for each run."""
    yield "status", np.asarray(ensemble.status)
    yield "steps", np.asarray(ensemble.steps)
    for kind in ("final", "events", "samples"):
        for name, values in getattr(ensemble, kind).items():
            yield f"{kind} {name}", np.asarray(values)


def differing(one: ss.motion.Ensemble, other: ss.motion.Ensemble, chosen: np.ndarray) -> list[str]:
    """Names of what is not the same in `other` as in the chosen runs of `one`."""
    again = dict(numbers(other))
    return [name for name, values in numbers(one) if values[chosen].tobytes() != again[name].tobytes()]


def trial(chance: random.Random, lanes: int) -> tuple[str, list[str], int]:
    """The rig in words, the names of numbers that changed, and how many runs were done."""
    contact, mass = chance.choice(CONTACTS), chance.choice((0.0, 0.0, 1e6, 1e9))
    rig = _rig(chance.choice(FRICTION), contact, mass, chance.choice(DRIVES))
    protocol = chance.choice(PROTOCOLS[:-1])
    draw = np.random.default_rng(chance.randrange(2**32))
    vary: dict[str, np.ndarray] = {"stiffness": rig.stiffness * 10 ** draw.uniform(-1, 1, lanes)}
    if chance.random() < 0.5:
        vary["drive.velocity"] = 1e-6 * 10 ** draw.uniform(-1, 1, lanes)
    until = chance.uniform(0.5, 5.0)
    times = np.linspace(0.0, until, 7) if chance.random() < 0.5 else None
    events = chance.random() < 0.7

    def run(chosen: np.ndarray, threads: int) -> ss.motion.Ensemble:
        some: Mapping[str, np.ndarray] = {name: values[chosen] for name, values in vary.items()}
        return ss.simulate_many(
            rig, some, protocol, until=until, times=times, events=events, threads=threads, most_steps=STEPS
        )  # fmt: skip

    every = np.arange(lanes)
    order, half = draw.permutation(lanes), np.sort(draw.choice(lanes, lanes // 2, replace=False))
    first = run(every, 1)
    found = [f"threads: {name}" for name in differing(first, run(every, 2), every)]
    found += [f"order: {name}" for name in differing(first, run(order, 2), order)]
    found += [f"company: {name}" for name in differing(first, run(half, 1), half)]
    for question in (ss.growth_rate, ss.critical_stiffness):
        values = np.asarray(question(rig, vary))
        if values[order].tobytes() != np.asarray(question(rig, {n: v[order] for n, v in vary.items()})).tobytes():
            found.append(f"order: {question.__name__}")
    done = int(np.sum(np.asarray(first.status) == "done"))
    return f"{type(rig.friction).__name__} {contact.name} m={mass:g} {rig.drive.name}", found, done


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--lanes", type=int, default=96)
    given = parsed(parser, count=2, lanes=16)
    start, wrong, done, refused = time.process_time(), 0, 0, 0
    for i in range(given.count):
        try:
            name, found, good = trial(random.Random(f"{given.seed}-{i}"), given.lanes)
        except ss.ParameterError:  # such as a displacement step through a dashpot
            refused += 1
            continue
        wrong, done = wrong + bool(found), done + good
        if found:
            print(f"{i:5} {name}: {', '.join(found)}", flush=True)
    rigs = given.count - refused
    print(f"{rigs} rigs ({refused} refused), {rigs * given.lanes} runs ({done} done): {wrong} differ")
    print(f"{time.process_time() - start:.0f} CPU s")


if __name__ == "__main__":
    main()
