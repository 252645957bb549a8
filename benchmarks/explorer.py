"""JavaScript beside Python on every law x contact x mass x drive: verdicts, edges, eigenvalues; motion, slip events.

    python benchmarks/explorer.py verdicts [--first N]
    python benchmarks/explorer.py motion [--first N]

Each kind of rig is judged at its own numbers and with some of them changed; each is moved through a velocity step.
Printed are the kinds that differ, how many there were, and the largest differences.
"""

from __future__ import annotations

import argparse
import itertools
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import steadyslip as ss
from explored import Explored, compared
from fuzz_rigs import DRIVES, FRICTION
from moved import moved, slip_events
from rigs_of_theory import CONTACTS

CHANGES = ({}, {"stiffness": 0.01}, {"stiffness": 100.0}, {"drive.velocity": 30.0}, {"stiffness": 3.0, "mass": 10.0})
BAR = 1e-12


def kinds(seed: int = 16) -> Iterator[tuple[str, ss.Slider]]:
    """All combinations, in one order drawn at random, with a name for each."""
    every = list(itertools.product(range(len(FRICTION)), range(len(CONTACTS)), (0.0, 1e6), range(len(DRIVES))))
    random.Random(seed).shuffle(every)
    for law, contact, mass, drive in every:
        rig = ss.Slider(
            friction=FRICTION[law], contact=CONTACTS[contact], stiffness=9e9, mass=mass, drive=DRIVES[drive]
        )
        words = f"{FRICTION[law].name} {law} x {CONTACTS[contact].name}, mass {mass:g}, {DRIVES[drive].name}"
        yield words, rig


def verdicts(first: int) -> None:
    worst = np.zeros(3)
    count = wrong = beyond = 0
    for words, rig in itertools.islice(kinds(), first):
        explored = Explored(rig)
        for change in CHANGES:
            own = rig.with_values(
                {name: factor * (rig.value(rig.resolve(name)) or 0) for name, factor in change.items()}
            )
            apart = compared(explored, own)
            found = np.array([apart.critical, apart.ends, apart.eigenvalues])
            count += 1
            wrong += apart.verdicts[0] != apart.verdicts[1]
            beyond += bool(np.any(found > BAR))
            if apart.verdicts[0] != apart.verdicts[1] or np.any(found > BAR):
                print(f"{words}, {change}: {apart}", flush=True)
            worst = np.maximum(worst, np.where(np.isfinite(found), found, 0.0))
    print(f"{count} rigs: {wrong} other verdicts, {beyond} beyond {BAR:g}; largest: critical stiffness {worst[0]:.2g}, "
          f"ends {worst[1]:.2g}, eigenvalues {worst[2]:.2g}")  # fmt: skip


def motion(first: int) -> None:
    count = wrong = late = refused = events = 0
    worst = 0.0
    for words, rig in itertools.islice(kinds(), first):
        protocol, until = ss.VelocityStep(at=1.0, to=2e-6), 30.0
        try:
            compiled, finer, found = moved(rig, protocol, until, most_steps=200_000)
        except ss.SteadyslipError as error:
            refused += 1
            print(f"{words}: refused, {str(error)[:100]}", flush=True)
            continue
        count += 1
        (own, times), (theirs, when), (truth, exact) = map(slip_events, (found["log"], compiled.log, finer.log))
        events += len(own)
        if own != theirs or found["status"][0] != compiled.status[0]:
            wrong += 1
            print(f"{words}: {len(own)} and {len(theirs)} events, finer {len(truth)}; status {found['status'][0]} and "
                  f"{compiled.status[0]}", flush=True)  # fmt: skip
            continue
        if truth == theirs and len(own):
            allowed = 10 * np.abs(when - exact).max() + 1e-9 * until
            share = float(np.abs(times - when).max() / allowed)
            late += share > 1
            worst = max(worst, share)
            if share > 1:
                print(f"{words}: event times apart by {share:.2g} of what is allowed", flush=True)
    print(
        f"{count} motions, {refused} refused: {wrong} with other events or status, {late} with times beyond ten times"
    )
    print(f"the integration error; {events} begins and ends of slip, largest share of that {worst:.2g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("verdicts", "motion"))
    parser.add_argument("--first", type=int, default=10**6, help="kinds of rig, of those drawn first")
    given = parser.parse_args()
    began = time.process_time()
    {"verdicts": verdicts, "motion": motion}[given.what](given.first)
    print(f"{time.process_time() - began:.0f} CPU s")
