"""Every command on every shipped example, and four on every law x contact x mass x drive: how each ends, and when.

    python benchmarks/commands.py examples [--limit SECONDS]
    python benchmarks/commands.py combinations [--count N] [--seed S] [--limit SECONDS]

Each command runs in a process of its own, with a limit on processor time and 2 GB of memory beyond what libraries
map. Printed: one row for each, and a table of endings and times by command. Good are status 0 (answered) and 2 (one
message).
"""

from __future__ import annotations

import argparse
import itertools
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from quick import QUICK, parsed

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))
MEMORY = 6 * 2**30  # of addresses: numba and LLVM map some gigabytes that they never touch
RIG = ("analyze", "simulate", "cycles", "threshold")


def words(command: str, path: Path) -> list[str]:
    """The command line, kept short where a command works for as long as it is allowed to."""
    extra = {"simulate": ["--until", "20 s", "--samples", "5"], "sensitivity": ["--points", "256"]}
    return [command, str(path), *extra.get(command, [])]


def outcome(arguments: list[str], limit: float) -> tuple[str, float, float]:
    """How a command ended, its processor time in s, and its peak memory in GB."""

    def bounds() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, int(limit) + 2))

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-m", "steadyslip", *arguments], cwd=folder, capture_output=True, text=True,
            preexec_fn=bounds, check=False,
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if "Traceback" in done.stderr:
        word = "TRACEBACK " + done.stderr.strip().splitlines()[-1][:100]
    elif done.returncode < 0 or seconds > limit:
        word = f"LIMIT ({done.returncode})"
    elif done.returncode not in (0, 2):
        word = f"STATUS {done.returncode} {done.stderr.strip()[:100]}"
    elif done.returncode == 0 and " nan" in done.stdout.lower():
        word = "NAN"
    else:
        word = "answered" if done.returncode == 0 else "refused"
    return word, seconds, after.ru_maxrss / 2**20


def of_examples() -> Iterator[tuple[str, list[str]]]:
    """Every command that takes a rig."""
    for path in sorted((ROOT / "examples").glob("**/*.toml")):
        folder = path.parent.name
        commands = {"maps": ("analyze", "map", "sensitivity"), "fits": ()}.get(folder, (*RIG, "map", "sensitivity"))
        for command in commands:
            arguments = words(command, path)
            yield path.stem, [*arguments, "-o", "found.zarr"] if command == "map" else arguments


def of_combinations(count: int | None, seed: int, folder: Path) -> Iterator[tuple[str, list[str]]]:
    """The four commands on every combination, or on some by chance."""
    from fuzz_rigs import DRIVES, FRICTION, _rig
    from rigs_of_theory import CONTACTS
    from steadyslip.files.specifications import write_rig

    every = list(itertools.product(range(len(FRICTION)), range(len(CONTACTS)), (0.0, 1e6), range(len(DRIVES)), RIG))
    chosen = every if count is None else random.Random(seed).sample(every, min(count, len(every)))
    for law, contact, mass, drive, command in chosen:
        path = folder / f"{law}-{contact}-{mass:g}-{drive}.toml"
        write_rig(_rig(FRICTION[law], CONTACTS[contact], mass, DRIVES[drive]), path)
        yield f"law {law} {CONTACTS[contact].name} m={mass:g} {DRIVES[drive].name}", words(command, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("examples", "combinations"), nargs="?" if QUICK else None)
    parser.add_argument("--count", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=60.0, help="processor time of one command, s")
    given = parsed(parser, what="combinations", count=1)
    table: dict[tuple[str, str], list[float]] = defaultdict(list)
    start, peak = time.perf_counter(), 0.0
    with tempfile.TemporaryDirectory() as folder:
        cases = of_examples() if given.what == "examples" else of_combinations(given.count, given.seed, Path(folder))
        for name, arguments in cases:
            word, seconds, peak = outcome(arguments, given.limit)
            table[arguments[0], word.split()[0]].append(seconds)
            print(f"{arguments[0]:12} {name:45} {seconds:7.1f} s  {word}", flush=True)
    print(f"\n{'command':12} {'ended':10} {'runs':>5} {'median s':>9} {'longest s':>9}")
    for (command, word), times in sorted(table.items()):
        print(f"{command:12} {word:10} {len(times):5} {sorted(times)[len(times) // 2]:9.1f} {max(times):9.1f}")
    print(f"\nlimit {given.limit:g} s each; {time.perf_counter() - start:.0f} s in all, peak {peak:.2f} GB")


if __name__ == "__main__":
    main()
