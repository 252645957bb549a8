"""Which explicit pair needs less time for a given error? Tsit5 (order 5) beside DOP853 (order 8).

    python benchmarks/methods.py [--quick]

Prints end error and CPU time per trajectory over tolerances, for one lane and for a row of lanes, on the massless
problems of `problems.py`. `steadyslip.motion.jobs.TIGHT` is the tolerance from which order 8 is chosen.
"""

from __future__ import annotations

import time

import numpy as np
from problems import Problem, problems
from quick import QUICK

from steadyslip.kernels.layout import Final
from steadyslip.model.reduction import SPEED
from steadyslip.motion.engine import LANES, Call
from steadyslip.motion.jobs import Options, prepare

TOLERANCES = [10.0**-k for k in ((4, 8) if QUICK else range(4, 12))]


def measured(
    problem: Problem, count: int, method: str, rtol: float, lanes: int, repeat: int
) -> tuple[np.ndarray, float]:
    """End states (count, 2) and the best CPU time of some runs, s per trajectory."""
    vary = problem.vary(count) if count > 1 else {}
    jobs = prepare(problem.rig(), None, problem.until, vary, problem.start, Options(rtol=rtol, method=method))
    machine = jobs.runner(lanes=lanes, dense=False)
    _ = machine.code.advance
    tables, best = jobs.tables(machine, 0, count, False, False), np.inf
    for _ in range(repeat):
        call = Call(machine, tables, count, np.empty(0))
        begin = time.process_time()
        call.run_steps(10**12)
        best = min(best, time.process_time() - begin)
    names = machine.reduction.names
    return call.final[:, [Final.STATE + names.index(name) for name in (SPEED, "x")]], best / count


def main() -> None:
    for problem in problems(2048)[: 1 if QUICK else 2]:
        for lanes, count, repeat in ((1, 1, 20), (LANES, 2048 if problem.until < 300 else 480, 1 if QUICK else 3)):
            reference, _ = measured(problem, count, "dop853", 1e-13, lanes, 1)
            for method in ("tsit5", "dop853"):
                for rtol in TOLERANCES:
                    ends, seconds = measured(problem, count, method, rtol, lanes, repeat)
                    error = float(np.median(np.abs(ends - reference).sum(axis=1)))
                    line = f"{problem.name:<26} lanes {lanes:2d}  {method:<7} rtol {rtol:.0e}"
                    print(f"{line}  error {error:.1e}  {seconds * 1e6:9.2f} us", flush=True)


if __name__ == "__main__":
    main()
