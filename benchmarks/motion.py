"""How fast is simulated motion, next to what a user would integrate with instead?

    python benchmarks/motion.py [--wide] [--quick]

Prints one table: seconds per trajectory at an end error of 1e-6 (in ln v and x/d_c; ensembles: median), found
by running a ladder of tolerances and interpolating, and the ratio to steadyslip; and writes the work-precision
plot motion.png. Everything runs in this one process on one core and is CPU time, but for the lines on two cores. heyoka
and diffrax take part where they are installed. ``--wide`` asks LLVM for 512-bit vectors, which has to happen before
numba is imported.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
if "--wide" in sys.argv:
    import llvmlite.binding as llvm

    os.environ["NUMBA_CPU_NAME"] = llvm.get_host_cpu_name()
    os.environ["NUMBA_CPU_FEATURES"] = llvm.get_host_cpu_features().flatten() + ",-prefer-256-bit"

import time

import numpy as np
import rivals
from jump import jump
from numba import njit
from problems import Problem, problems
from quick import QUICK

import steadyslip as ss
from steadyslip.kernels import linking
from steadyslip.kernels.build import machine_code
from steadyslip.kernels.layout import Final
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.record import Evaluator
from steadyslip.model.reduction import SPEED
from steadyslip.motion.engine import LANES, Call
from steadyslip.motion.jobs import Options, prepare

if "--wide" in sys.argv:
    linking.FEATURES.append("-prefer-256-bit")
TARGET = 1e-6
MANY = 1000 if QUICK else 100_000
Curve = list[tuple[float, float]]  # (error, seconds per trajectory)


def ours_single(problem: Problem, tolerance: float, variants: np.ndarray) -> tuple[np.ndarray, float]:
    """The kernel call for one trajectory, no events."""
    jobs = prepare(problem.rig(), None, problem.until, {}, problem.start, Options(rtol=tolerance))
    machine = jobs.runner(lanes=1, dense=False)
    _ = machine.code.advance
    call = Call(machine, jobs.tables(machine, 0, 1, False, False), 1, np.empty(0))
    begin = time.process_time()
    call.run_steps(10**12)
    seconds = time.process_time() - begin
    names = dict(zip(machine.reduction.names, call.final[0, Final.STATE :], strict=True))
    return np.array([[names[SPEED], names["x"]]]), seconds


def ours_ensemble(
    problem: Problem, tolerance: float, variants: np.ndarray, threads: int | None = 1, events: bool = False,
    clock: Callable[[], float] = time.process_time,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """simulate_many as a user calls it."""
    begin = clock()
    found = ss.simulate_many(
        problem.rig(), problem.vary(len(variants)), until=problem.until, initial=problem.start, rtol=tolerance,
        events=events, observables=["v", "x"], threads=threads, progress=False,
    )  # fmt: skip
    seconds = clock() - begin
    return np.column_stack([np.log(found.final["v"]), found.final["x"]]), seconds


def ladder(
    run: rivals.Run, problem: Problem, variants: np.ndarray, reference: np.ndarray, tolerances: list[float], repeat: int
) -> Curve:
    """Errors and times over tolerances; stops once it is far past the target."""
    curve: Curve = []
    for tolerance in tolerances:
        run(problem, tolerance, variants[: min(len(variants), 16)])  # compiled and warm
        times, ends = [], np.empty(0)
        for _ in range(repeat):
            ends, seconds = run(problem, tolerance, variants)
            times.append(seconds)
        error = float(np.nanmedian(np.abs(ends[:, :2] - reference[: len(ends)]).sum(axis=1)))
        curve.append((error, float(np.median(times)) / len(variants)))
        if error < TARGET / 30 or times[-1] > 60:
            break
    return curve


def at_target(curve: Curve) -> float:
    """Seconds at the target error: interpolated on log axes, extrapolated from the two nearest points."""
    points = sorted((e, s) for e, s in curve if e > 0 and np.isfinite(e))
    if not points:
        return float("nan")
    errors, seconds = np.log([p[0] for p in points]), np.log([p[1] for p in points])
    if len(points) == 1:
        return points[0][1] if points[0][0] <= TARGET else float("nan")
    if errors[0] <= np.log(TARGET) <= errors[-1]:
        return float(np.exp(np.interp(np.log(TARGET), errors, seconds)))
    i = 0 if errors[0] > np.log(TARGET) else len(points) - 2
    slope = (seconds[i + 1] - seconds[i]) / (errors[i + 1] - errors[i])
    return float(np.exp(seconds[i] + slope * (np.log(TARGET) - errors[i])))


def compare(problem: Problem, kind: str) -> dict[str, Curve]:
    """All curves of one problem: single runs or ensembles."""
    single = kind == "single"
    count = 1 if single else (256 if QUICK else 16384)
    variants = problem.variants[:count]
    ours = ours_single if single else ours_ensemble
    reference, _ = ours(problem, 1e-12, variants)
    steps = [10.0**-k for k in (4, 5, 6, 7, 8, 9, 10)]
    curves = {"steadyslip": ladder(ours, problem, variants, reference, steps, 9 if single else 3)}
    methods = ("LSODA", "Radau", "DOP853") if single else ("LSODA",)
    for method in methods:
        if problem.inertial and method == "DOP853":
            continue
        steps = [1e-6, 1e-8, 1e-10] if method == "Radau" else [10.0**-k for k in (5, 7, 8, 9, 10, 11, 12)]
        few = variants[: 1 if single else 4]
        curves[f"SciPy {method}"] = ladder(rivals.scipy_rival(method), problem, few, reference, steps, 1)
    if rivals.installed("heyoka") and not problem.inertial:
        run = rivals.heyoka_single if single else rivals.heyoka_batch
        curves["heyoka" if single else "heyoka batch"] = ladder(
            run, problem, variants, reference, [10.0**-k for k in (3, 5, 6, 7, 8, 9, 10)], 9 if single else 3
        )
    if rivals.installed("diffrax") and not problem.inertial and not single:
        some = variants[:1024]
        curves["diffrax Tsit5"] = ladder(rivals.diffrax_vmap, problem, some, reference, [1e-5, 1e-7, 1e-8], 1)
    return curves


@njit
def repeated(address: int, record: np.ndarray, scratch: np.ndarray, rounds: int) -> None:
    for _ in range(rounds):
        jump(address, record, 0.0, scratch)


def bare_rate(problem: Problem) -> tuple[float, float]:
    """ns per right-hand side: alone in vector code, and in the ensemble kernel (rejected steps counted)."""
    jobs = prepare(problem.rig(), None, problem.until, {}, problem.start, Options(rtol=1e-6))
    kernel = jobs.runner(lanes=LANES, dense=False).kernel
    bare = Evaluator(kernel, Program("step"))
    for i, rate in enumerate(bare.evaluated(kernel.rates, bare.point(0.0))):
        place = kernel.layout.state + i
        bare.program.store(place, bare.program.load(place) + 1e-12 * rate)
    address = machine_code([bare.program], LANES)["step"]
    work, scratch = np.full(kernel.layout.rows * LANES, 0.01), np.zeros(8)
    rounds, best = 200 if QUICK else 20_000, np.inf
    for _ in range(7):
        begin = time.process_time()
        repeated(address, work, scratch, rounds)
        best = min(best, time.process_time() - begin)
    machine = jobs.runner(lanes=LANES, dense=False)
    evaluations = kernel.method.stages - 1  # the first of a step is the last of the one before
    jobs = prepare(problem.rig(), None, problem.until, problem.vary(2048), problem.start, Options(rtol=1e-6))
    quickest, total = np.inf, 1.0
    for _ in range(5):
        call = Call(machine, jobs.tables(machine, 0, 2048, False, False), 2048, np.empty(0))
        begin = time.process_time()
        call.run_steps(10**12)
        quickest = min(quickest, time.process_time() - begin)
        total = float(call.final[:, 2:4].sum()) * evaluations
    return best / rounds / LANES * 1e9, quickest / total * 1e9


def report(title: str, curves: dict[str, Curve]) -> None:
    """One block of the table."""
    mine = at_target(curves["steadyslip"])
    print(f"\n{title}")
    for name, curve in curves.items():
        seconds = at_target(curve)
        best = min(error for error, _ in curve)
        line = f"  {name:<16} {seconds * 1e6:12.1f} us   {seconds / mine:9.2f} x   best error {best:.1e}"
        print(line, flush=True)


def draw(everything: dict[str, dict[str, Curve]]) -> None:
    """Work-precision plots, one panel for each problem."""
    from matplotlib.figure import Figure

    columns = 3
    rows = -(-len(everything) // columns)
    axes = Figure(figsize=(4.2 * columns, 3.4 * rows), layout="constrained").subplots(rows, columns, squeeze=False)
    colours = ["#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"]
    names = dict.fromkeys(name for curves in everything.values() for name in curves)
    marks = dict(zip(names, zip(colours, "os^vDPX", strict=True), strict=False))
    for ax, (title, curves) in zip(axes.flat, everything.items(), strict=False):
        for name, curve in curves.items():
            colour, mark = marks[name]
            ax.loglog(*np.array(curve).T, color=colour, marker=mark, markersize=4, label=name)
        ax.set_title(title, fontsize="small")
        ax.set_xlabel("end error (1)")
        ax.set_ylabel("time per trajectory (s)")
        ax.legend(fontsize="x-small")
    for ax in axes.flat[len(everything) :]:
        ax.remove()
    axes[0, 0].figure.savefig("motion.png", dpi=120)


def main() -> None:
    everything: dict[str, dict[str, Curve]] = {}
    for problem in problems()[: 1 if QUICK else None]:
        for kind in ("single", "ensemble"):
            title = f"{problem.name}, {kind}"
            everything[title] = compare(problem, kind)
            report(title, everything[title])
    print("\nright-hand sides, ns each: bare vector loop, ensemble kernel with rejected steps, ratio")
    for problem in problems(2048)[: 1 if QUICK else 2]:
        bare, used = bare_rate(problem)
        print(f"  {problem.name:<28} {bare:6.2f} {used:6.2f}   {used / bare:5.2f} x")
    spiral = problems(MANY)[0]
    wall = time.perf_counter
    for events in (False, True):
        times = [min(_ensemble(spiral, events, n, wall) for _ in range(3)) for n in (1, 2)]
        print(f"\n{MANY} spirals{', with events' if events else ''}: one core {times[0]:.2f} s, "
              f"two {times[1]:.2f} s, {times[0] / times[1]:.2f} x")  # fmt: skip
    for problem in problems(4096)[: 1 if QUICK else 3]:
        without, watched = (min(_ensemble(problem, events) for _ in range(3)) for events in (False, True))
        print(f"{problem.name}: with events {watched / without:.2f} x")
    print(f"{10 * MANY} spirals on all cores: {_ensemble(problems(10 * MANY)[0], False, None, wall):.1f} s")
    rig, kick = spiral.rig(), spiral.start
    whole = min(_timed(lambda: ss.simulate(rig, until=200.0, initial=kick)) for _ in range(3 if QUICK else 100))
    kernel = min(ours_single(spiral, 1e-7, spiral.variants)[1] for _ in range(3 if QUICK else 100))
    print(f"simulate with events and result {whole * 1e3:.2f} ms, kernel alone {kernel * 1e3:.3f} ms")
    draw(everything)


def _ensemble(
    problem: Problem, events: bool, threads: int | None = 1, clock: Callable[[], float] = time.process_time
) -> float:
    """Seconds for all variants of a problem."""
    return ours_ensemble(problem, 1e-6, problem.variants, threads, events, clock)[1]


def _timed(call: object) -> float:
    assert callable(call)
    begin = time.process_time()
    call()
    return time.process_time() - begin


if __name__ == "__main__":
    main()
