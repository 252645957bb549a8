"""kill -9 at random moments of maps: drivers, all their processes, or single workers; what is there afterwards.

    python benchmarks/kills.py [--count 44] [--seed S]

Each trial computes a small map, is killed once to three times, goes on until it is whole, and is then compared byte by
byte with the map of an undisturbed run. Counted: trials whose files differ, and points that were computed again beyond
those of the chunks in hand.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from quick import QUICK, parsed

import map_under_attack as attack
import steadyslip as ss

WORKERS = 1 if QUICK else 2
KINDS = ("driver", "all", "worker")


def started(store: Path, log: Path) -> subprocess.Popen[str]:
    """The program, in a session of its own."""
    command = [sys.executable, attack.__file__, str(store), str(log), str(WORKERS)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )  # fmt: skip


def killed(store: Path, log: Path, chance: random.Random, whole: bool) -> bool:
    """Start, wait for a random moment, and kill the driver or all; whether it was still at work."""
    points = attack.ROWS * attack.COLUMNS
    done = log.read_bytes().count(b"\n") if log.exists() else 0
    process = started(store, log)
    # before the first point, or somewhere among them
    wanted = done + chance.randint(-30, points - 1 - min(done, points - 1))
    begun = time.monotonic()
    while process.poll() is None and time.monotonic() - begun < 60:
        if log.exists() and log.read_bytes().count(b"\n") >= max(wanted, 1):
            break
        if wanted < done and time.monotonic() - begun > chance.uniform(0.1, 2.0):
            break
        time.sleep(0.001)
    time.sleep(chance.uniform(0, 0.05))
    alive = process.poll() is None
    if alive:
        (os.killpg if whole else os.kill)(process.pid, signal.SIGKILL)
    process.communicate()
    return alive


def trial(kind: str, chance: random.Random, folder: Path, undisturbed: dict[str, bytes]) -> tuple[int, str]:
    """How many kills there were, and what is wrong afterwards."""
    store, log = folder / "map.zarr", folder / "log"
    blows = 1 if QUICK else chance.randint(1, 3)
    if kind == "worker":
        (folder / "log.tokens").mkdir()
        for i in range(blows):
            (folder / "log.tokens" / str(i)).touch()
        kills, hands = blows, WORKERS * blows
    else:
        kills = sum(killed(store, log, chance, kind == "all") for _ in range(blows))
        hands = (WORKERS if kind == "all" else 2 * WORKERS) * blows
    process = started(store, log)
    out, error = process.communicate(timeout=300)
    if "(24, 24)" not in out:
        return kills, f"not whole: {out} {error[-300:]}"
    if attack.files(store) != undisturbed:
        return kills, "other bytes"
    counts = attack.computed(log)
    points = attack.ROWS * attack.COLUMNS
    if len(counts) != points or sum(counts.values()) - points > hands * attack.CHUNK:
        return kills, f"{sum(counts.values()) - points} points again"
    return kills, ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=44, help="kills")
    parser.add_argument("--seed", type=int, default=0)
    given = parsed(parser, count=1)
    begun, kills, trials, wrong = time.monotonic(), 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        ss.run_map(attack.plan(place / "log", 0.0), place / "map.zarr", workers=1)
        undisturbed = attack.files(place / "map.zarr")
        attack.plan(place / "log")  # with its pauses again
        while kills < given.count:
            chance = random.Random(f"{given.seed}-{trials}")
            own = place / str(trials)
            own.mkdir()
            kind = KINDS[trials % len(KINDS)]
            count, fault = trial(kind, chance, own, undisturbed)
            trials, kills, wrong = trials + 1, kills + count, wrong + bool(fault)
            print(f"{trials:3} {kind:7} {count} kills  {fault or 'the same bytes'}", flush=True)
    print(f"{kills} kills in {trials} trials: {wrong} wrong, {time.monotonic() - begun:.0f} s")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
