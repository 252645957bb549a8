"""The same three questions put to steadyslip, SciPy, python-control and rsfmodel, with errors and times.

    python benchmarks/others.py

Prints the table of docs/explanation/comparison.md. Lines are those that a user writes, in the functions below.
1. Velocity step of a press under constant normal stress: friction after 80 s, against Radau at rtol 1e-12.
2. Critical stiffness of the inclined spring, against the closed form of Dupont & Bapna.
3. d_c of a computed record with noise, against the value that it was computed with.

rsfmodel is on no package index; it is asked where it can be imported, as with its checkout on PYTHONPATH.
"""

from __future__ import annotations

import argparse
import inspect
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import control
import numpy as np
from quick import parsed
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

import steadyslip as ss

try:
    from rsfmodel import rsf, staterelations
except ImportError:
    rsf = None

A, B, D_C, MU, SIGMA, K, V0, V1 = 0.012, 0.015, 1e-5, 0.6, 5e6, 30e9, 1e-6, 3e-6
"""Of the record in examples/data/made_velocity_step.csv."""
EXAMPLES = Path(__file__).parents[1] / "examples"
RECORD = EXAMPLES / "data/made_velocity_step.csv"
VALUES = {"a": A, "b": B, "d_c": D_C, "mu_ref": MU, "stiffness": K, "steady_normal_stress": SIGMA}

# --- 1. velocity step -------------------------------------------------------------------------------


def step_by_steadyslip() -> float:
    rig = ss.lab_rig("slip").with_values(VALUES)
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=20, to=V1), until=80, times=[80.0])
    return float(run["friction"][-1])


def slope(t: float, y: np.ndarray, a: float, b: float, d_c: float, mu: float, k: float, load: float) -> list[float]:
    v = V0 * np.exp((y[0] - mu - b * y[1]) / a)
    return [k / SIGMA * (load - v), -v / d_c * (y[1] + np.log(v / V0))]


def step_by_scipy(rtol: float = 1e-8, method: str = "LSODA") -> float:
    values = (A, B, D_C, MU, K, V1)
    return float(solve_ivp(slope, (20, 80), [MU, 0.0], method, args=values, rtol=rtol, atol=rtol * 1e-2).y[0, -1])


def step_by_rsfmodel() -> float:
    model, state = rsf.Model(), staterelations.RuinaState()
    model.mu0, model.a, model.vref, model.k = MU, A, V0, K / SIGMA
    state.b, state.Dc = B, D_C
    model.state_relations = [state]
    model.time = np.linspace(0, 80, 801)
    model.loadpoint_velocity = np.where(model.time < 20, V0, V1)
    return float(model.solve().friction[-1])


# --- 2. critical stiffness --------------------------------------------------------------------------


def edge_by_steadyslip() -> float:
    return float(ss.critical_stiffness(ss.read_rig(EXAMPLES / "inclined-spring.toml")))


def state_matrix(k: float) -> np.ndarray:
    """Of the inclined spring, linearised by hand: sigma = sigma_0 - T tan psi, memory of Linker & Dieterich."""
    a, b, d_c, mu, alpha, v0, psi, preload = 0.0145, 0.016, 1e-6, 0.7, 0.56, 1e-6, np.radians(-45), 5e6
    sigma = preload / (1 + mu * np.tan(psi))
    # dT = -k x, dsigma = -dT tan psi, and sigma (a dv/v0 + dPsi - alpha dsigma/sigma) + mu dsigma = dT give dv
    v_x = v0 / (a * sigma) * (-k - (mu - alpha) * k * np.tan(psi))
    v_psi = -v0 / a
    sigma_x = k * np.tan(psi)
    psi_x = -v0 / d_c * (b * v_x / v0 - alpha * sigma_x / sigma)
    return np.array([[v_x, v_psi], [psi_x, -v0 / d_c * (1 + b * v_psi / v0)]])


def edge_by_scipy() -> float:
    return float(brentq(lambda k: np.linalg.eigvals(state_matrix(k)).real.max(), 1e9, 1e12, rtol=1e-14))


def edge_by_control() -> float:
    def growth(k: float) -> float:
        return float(control.ss(state_matrix(k), np.zeros((2, 1)), np.eye(2), np.zeros((2, 1))).poles().real.max())

    return float(brentq(growth, 1e9, 1e12, rtol=1e-14))


# --- 3. fit -----------------------------------------------------------------------------------------


def fit_by_steadyslip() -> float:
    return float(ss.fit(ss.lab_rig("slip"), ss.read_record(RECORD))["d_c"].value)


def fit_by_scipy() -> float:
    """From a guess that is wrong by a factor of 2 in every parameter but mu, with the time of the step given."""
    t, _, friction, _ = np.loadtxt(RECORD, delimiter=",", skiprows=1).T
    after = t >= 20

    def misfit(p: np.ndarray) -> np.ndarray:
        a, b, d_c, k = np.exp(p[:4])
        run = solve_ivp(
            slope, (20, 80), [p[4], 0.0], "LSODA", t_eval=t[after], args=(a, b, d_c, p[4], k, V1), rtol=1e-7, atol=1e-9
        )
        return np.concatenate([p[4] - friction[~after], run.y[0] - friction[after]])

    found = least_squares(misfit, [*np.log([2 * A, 2 * B, 2 * D_C, 2 * K]), MU], x_scale="jac")
    return float(np.exp(found.x[2]))


# --- table ------------------------------------------------------------------------------------------


def lines_of(*functions: Callable[..., Any]) -> int:
    """Lines of code, without comments and docstrings."""
    source = [line.strip() for one in functions for line in inspect.getsource(one).splitlines()]
    return sum(bool(line) and not line.startswith(("#", '"""')) for line in source)


def timed(call: Callable[[], float], runs: int) -> tuple[float, float]:
    """Result, and median seconds of several calls after a first one."""
    found, seconds = call(), []
    for _ in range(runs):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return found, statistics.median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="calls whose median time is printed")
    runs = parsed(parser, runs=1).runs
    closed = (0.016 - 0.0145) * 5e6 / 0.3 / (1e-6 * (1 - 0.7 + 0.56))  # of the paper, at -45 degrees
    exact = step_by_scipy(1e-12, "Radau")
    rows = [
        ("friction after a velocity step", "steadyslip", step_by_steadyslip, (step_by_steadyslip,), exact),
        ("", "scipy", step_by_scipy, (slope, step_by_scipy), exact),
        *([("", "rsfmodel", step_by_rsfmodel, (step_by_rsfmodel,), exact)] if rsf else []),
        ("critical stiffness", "steadyslip", edge_by_steadyslip, (edge_by_steadyslip,), closed),
        ("", "scipy", edge_by_scipy, (state_matrix, edge_by_scipy), closed),
        ("", "control", edge_by_control, (state_matrix, edge_by_control), closed),
        ("d_c of a record", "steadyslip", fit_by_steadyslip, (fit_by_steadyslip,), D_C),
        ("", "scipy", fit_by_scipy, (slope, fit_by_scipy), D_C),
    ]
    print("| question | program | lines | answer | relative error | time |\n|---|---|---|---|---|---|")
    for question, name, call, written, truth in rows:
        found, seconds = timed(call, runs)
        program = name if name in ("steadyslip", "rsfmodel") else f"{name} {version(name)}"
        numbers = f"{found:.6g}", f"{abs(found / truth - 1):.1e}", f"{seconds * 1e3:.3g} ms"
        row = (question, program, lines_of(*written), *numbers)
        print("|", " | ".join(map(str, row)), "|")


if __name__ == "__main__":
    main()
