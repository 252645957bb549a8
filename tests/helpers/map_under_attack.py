"""A map whose computing can be counted and killed; also a program that computes it, for tests to kill.

    python map_under_attack.py STORE LOG WORKERS [CLUSTER]

Every point is written down in LOG when it is computed. While there are files in the folder LOG.tokens, a process that
computes takes one at a random point and kills itself.
"""

import contextlib
import math
import os
import random
import signal
import sys
import time
import zlib
from pathlib import Path

import steadyslip as ss

ROWS, COLUMNS, CHUNK = 12, 9, 5  # chunks of 5 and 4: the last one of a row is cut off


def rig():
    friction = ss.laws.RateState(a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6)
    return ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=9e9,
        drive=ss.machine.SteadyDrive(1e-6),
    )


class Costly:
    """A function of a rig that takes its time and leaves a trace; where does not belong to what it is."""

    __name__ = "costly"

    def __call__(self, rig):
        log, pause = os.environ["MAP_LOG"], float(os.environ["MAP_PAUSE"])
        place = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(place, f"{rig.stiffness!r} {rig.value('friction.a')!r} {os.getpid()}\n".encode())
        os.close(place)
        if random.random() < 0.1:
            with contextlib.suppress(OSError):
                token = next(Path(log + ".tokens").iterdir(), None)
                if token is not None:
                    token.unlink()
                    os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(pause)
        if zlib.crc32(repr(rig.stiffness).encode()) % 5 == 0:
            return math.nan
        return math.sin(rig.stiffness) / rig.value("friction.a")


def plan(log, pause=0.01):
    os.environ |= {"MAP_LOG": str(log), "MAP_PAUSE": str(pause)}  # for this process and those that it starts
    # only NaN in the first row: chunks that are all fill value
    stiffness = [1e9 * (i + 1) for i in range(ROWS)]
    return ss.Map(
        rig(),
        {"stiffness": stiffness, "friction.a": ss.maps.Grid(0.01, 0.02, COLUMNS)},
        compute=[ss.maps.measure(Costly()), "status"],
        chunk=CHUNK,
    )


def computed(log):
    """Number of times that each point was computed."""
    counts = {}
    for line in Path(log).read_text().splitlines():
        point = tuple(line.split()[:2])
        counts[point] = counts.get(point, 0) + 1
    return counts


def files(store):
    """All files of a store and what is in them."""
    store = Path(store)
    return {str(p.relative_to(store)): p.read_bytes() for p in sorted(store.rglob("*")) if p.is_file()}


if __name__ == "__main__":
    store, log, workers = sys.argv[1:4]
    found = ss.run_map(plan(log), store, workers=int(workers), cluster=(sys.argv[4:] or [None])[0])
    print(found.finished)
