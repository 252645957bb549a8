"""How fast are maps, how much memory do they take, and what do engines cost?

    python benchmarks/maps.py [--quick]

1. Stability of 1e8 inclined-spring rigs to a store, all cores: seconds, peak memory of all processes.
2. Event statistics of 1e6 damped stick-slip runs, next to `simulate_many` on the same rigs without a store.
3. Two workers next to one, for both, from the first chunk to the last and with the start of the processes.
4. The same map of 1e7 points on a local Dask cluster next to plain workers, likewise.

``--quick`` does a thousandth of each, once. Peak memory needs psutil.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from quick import QUICK

import steadyslip as ss
from steadyslip.maps.work import cluster, local

TIMES = 1 if QUICK else 3
PART = 10_000 if QUICK else 1
RIG = Path(__file__).parents[1] / "examples" / "inclined-spring.toml"


try:
    import psutil
except ImportError:  # it is no dependency of ours
    psutil = None


class PeakMemory:
    """Largest resident memory of this process and its children together, sampled."""

    def __enter__(self) -> PeakMemory:
        self.bytes, self.stopped = 0, threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()
        return self

    def __str__(self) -> str:
        return f"peak {self.bytes / 1e6:.0f} MB in all processes" if psutil else "peak memory not measured: no psutil"

    def _watch(self) -> None:
        if psutil is None:
            return
        me = psutil.Process()
        while not self.stopped.wait(0.1):
            total = 0
            for process in (me, *me.children(recursive=True)):
                try:
                    total += process.memory_info().rss
                except psutil.Error:
                    continue
            self.bytes = max(self.bytes, total)

    def __exit__(self, *_: object) -> None:
        self.stopped.set()


class ChunkTimes:
    """When chunks were finished, so that the start of processes can be told from their work."""

    def __init__(self) -> None:
        self.first = self.last = 0.0
        self.points = self.counted = 0

    def seen(self, points: int) -> None:
        self.last = time.perf_counter()
        if not self.first:
            self.first = self.last
        else:
            self.counted += points
        self.points += points

    @property
    def rate(self) -> float:
        """Points a second after the first chunk; NaN if that was the only one."""
        return self.counted / (self.last - self.first) if self.counted else float("nan")


def run(plan: ss.Map, **options: Any) -> tuple[float, ChunkTimes]:
    """Seconds in all, and times of the chunks."""
    times = ChunkTimes()
    flows = {module: module._finished_chunks for module in (local, cluster)}
    for module, flow in flows.items():

        def watched(*arguments: Any, flow: Any = flow) -> Any:
            for done in flow(*arguments):
                times.seen(done.points)
                yield done

        module._finished_chunks = watched
    try:
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            ss.run_map(plan, Path(folder) / "map.zarr", progress=False, **options)
            return time.perf_counter() - begin, times
    finally:
        for module, flow in flows.items():
            module._finished_chunks = flow


def stability(points: int) -> ss.Map:
    n = round(points**0.5)
    return ss.Map(
        ss.read_rig(RIG),
        {"angle": ss.maps.Grid("-80 deg", "80 deg", n), "stiffness": ss.maps.Grid("0.1 GPa/m", "100 GPa/m", n, "log")},
        compute=["status", "critical_stiffness", "growth_rate"],
    )


def stick_slip(points: int) -> ss.Map:
    """Radiation-damped stick-slip with aging, lengths in d_c and times in d_c/v0, started by a step of 10 %."""
    friction = ss.laws.RateState(a=0.01, b=0.015, d_c=1.0, mu_ref=0.6, v_ref=1.0, evolution=ss.laws.Aging())
    rig = ss.Slider(
        friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=0.003,
        drive=ss.machine.SteadyDrive(1.0),
        radiation_damping=1e-8,
    )  # fmt: skip
    n = round(points**0.5)
    return ss.Map(
        rig,
        {"stiffness": ss.maps.Grid(0.0025, 0.004, n), "friction.b": ss.maps.Grid(0.0145, 0.0155, n)},
        compute=[ss.maps.Events(until=800.0)],
        protocol=ss.protocol.VelocityStep(at=0.0, to=1.1),
    )


def simulated_rate(plan: ss.Map, runs: int) -> float:
    """Runs a second of `simulate_many` on all cores, on rigs of the map spread evenly."""
    generator = np.random.default_rng(0)
    vary = {axis.name: generator.choice(axis.values, runs) for axis in plan.axes}
    options: dict[str, Any] = {"until": 800.0, "observables": (), "progress": False}
    ss.simulate_many(plan.rig, {n: a[:64] for n, a in vary.items()}, plan.protocol, **options)  # compiled and warm
    times = []
    for _ in range(TIMES):
        begin = time.perf_counter()
        ss.simulate_many(plan.rig, vary, plan.protocol, **options)
        times.append(time.perf_counter() - begin)
    return runs / statistics.median(times)


def once_running(ratio: float) -> str:
    """Text of a ratio of rates after the first chunk; NaN where the map has only that."""
    return f"{ratio:.2f} x once they run" if ratio == ratio else "in one chunk, so that the start of processes is part"


def main() -> None:
    plan = stability(10**8 // PART)
    with PeakMemory() as peak:
        seconds, _ = run(plan)
    print(f"{plan.size:.3g} points of status, critical stiffness and growth rate: {seconds:.1f} s, "
          f"{plan.size / seconds:.3g} points/s, {peak}")  # fmt: skip

    plan = stick_slip(10**6 // PART)
    rate = simulated_rate(plan, 60_000 // PART)
    with PeakMemory() as peak:
        seconds, _ = run(plan)
    share = plan.size / seconds / rate
    print(f"{plan.size:.3g} damped stick-slip runs: {seconds:.1f} s, {plan.size / seconds:.3g} runs/s = {share:.2f} of "
          f"simulate_many ({rate:.3g} runs/s), {peak}")  # fmt: skip

    both = (("stability", stability(3 * 10**7 // PART)), ("stick-slip", stick_slip(2 * 10**5 // PART)))
    for name, plan in both[: 1 if QUICK else 2]:
        one, _ = run(plan, workers=1)
        two, times = run(plan, workers=2)
        print(f"{name}, {plan.size:.3g} points: two workers {one / two:.2f} x one in all, "
              f"{once_running(times.rate * one / plan.size)}")  # fmt: skip

    plan = stability(10**7 // PART)
    pairs = [(run(plan, workers=2), run(plan, cluster="local", workers=2)) for _ in range(TIMES)]
    whole = statistics.median(dask[0] / plain[0] for plain, dask in pairs)
    busy = statistics.median(plain[1].rate / dask[1].rate for plain, dask in pairs)
    print(f"Dask, {plan.size:.3g} points: {whole:.2f} x plain workers in all "
          f"({statistics.median(d[0] - p[0] for p, d in pairs):+.1f} s), {once_running(busy)}")  # fmt: skip


if __name__ == "__main__":
    main()
