"""Machines: how long verdicts and eigenvalues take, and random machines against theory 11's matrix typed with NumPy.

python benchmarks/machines.py [COUNT] [--first SEED]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

import numpy as np
from quick import QUICK, parsed

import steadyslip as ss
from delays import apart, some, spectral, winding
from machine_onsets import compared
from machines import at_random, same_block, three_bodies
from moving_machines import slopes_of_motion
from steadyslip.linear import quasipolynomial as quasi, rightmost as late_roots
from steadyslip.linear.spectrum import unstable_roots
from steadyslip.model.point import operating_point

APART = 1e-3  # of the terms that a cubic coefficient is the sum of
SINGULAR = 1e-8  # smallest over largest singular value of the matrix at an eigenvalue


def seconds(what):
    start = time.process_time()
    what()
    return time.process_time() - start


def times():
    """CPU seconds of a verdict on three bodies with three contacts, and eigenvalues per second."""
    machine = three_bodies()
    print(f"analyze, three bodies: {seconds(lambda: ss.analyze(machine)):.2f} s at first", end=", ")
    other = machine.with_values({"drive.kp": 1.9})
    print(f"{seconds(lambda: ss.analyze(other)):.2f} s again")
    count = 1000 if QUICK else 40_000
    stiffness = {"links.screw.stiffness": np.linspace(50, 500, count)}
    print(f"eigenvalues: {count / seconds(lambda: ss.eigenvalues(machine, stiffness)):,.0f} machines a second")


def campaign(count, first):
    """Eigenvalues at which the matrix is singular, and others."""
    right = wrong = 0
    for seed in range(first, first + count):
        machine, matrix = at_random(seed)
        for s in ss.eigenvalues(machine):
            here, near = (np.linalg.svd(matrix(z), compute_uv=False) for z in (s, s * (1 + 1e-6)))
            good = here[-1] < SINGULAR * here[0] or here[-1] < 1e-3 * near[-1]
            right, wrong = right + good, wrong + (not good)
            if not good:
                print(f"seed {seed}: {s}")
    print(f"{count} random machines: {right} eigenvalues right, {wrong} wrong")


def onsets(count, first):
    """Cubic coefficients of random machines against differences of the rates that kernels integrate."""
    found = [(seed, compared(seed)) for seed in range(first, first + count)]
    told = [one for one in found if one[1] is not None]
    wrong = [seed for seed, apart in told if apart > APART]
    for seed in wrong:
        print(f"seed {seed}: the coefficient of the onset differs")
    print(f"{len(told)} onsets of {count} random machines: {len(wrong)} wrong")


def motions(count, first):
    """Machines of one body against sliders, sample by sample."""
    worst, wrong = 0.0, 0
    times_of = np.linspace(0.0, 20.0, 101)
    for seed in range(first, first + count):
        block, machine = same_block(seed)
        pieces = [
            ss.protocol.VelocityStep(at=0.5, to=1.3),
            ss.protocol.DisturbanceStep(at=1.0, by=0.02),
            ss.protocol.NormalStressStep(at=2.0, by=0.05),
        ]
        try:
            own = ss.simulate(block, pieces, times=times_of, until=20.0)
        except ss.SteadyslipError as error:
            try:
                ss.simulate(machine, pieces, times=times_of, until=20.0)
                wrong += 1
                print(f"seed {seed}: only the slider is refused, {error}")
            except ss.SteadyslipError:
                pass
            continue
        other = ss.simulate(machine, pieces, times=times_of, until=20.0)
        names = {"v": "block.v", "slip": "base.slip", "shear_stress": "base.friction_force"}
        apart = max(np.max(np.abs(other[b] - own[a]) / np.max(np.abs(own[a])), initial=0.0) for a, b in names.items())
        worst = max(worst, apart)
        same = own.status == other.status and [e.kind for e in own.events] == [e.kind for e in other.events]
        if not same or not apart < 1e-7:
            wrong += 1
            print(f"seed {seed}: {own.status}, {other.status}, {apart:.2g}")
    print(f"{count} sliders and machines of one body: {wrong} move differently, by {worst:.2g} at most")


def small_motions(count, first):
    """Slopes of the rates of motion against eigenvalues of the linear verdict."""
    wrong = refused = 0
    for seed in range(first, first + count):
        machine = at_random(seed)[0]
        try:
            found = np.linalg.eigvals(slopes_of_motion(machine)[0])
        except ss.NotAvailable as error:
            refused += 1
            print(f"seed {seed}: {error}")
            continue
        wanted = ss.eigenvalues(machine)
        size = np.max(np.abs(wanted))
        if len(found) != len(wanted) or any(np.min(np.abs(found - s)) > 1e-7 * size for s in wanted):
            wrong += 1
            print(f"seed {seed}: {found}, {wanted}")
    print(f"{count} random machines: slopes of motion of {wrong} have other eigenvalues, {refused} refused")


def delays(count, first):
    """Delay equations at random against discretised ones; late machines against how their matrix turns."""
    right = wrong = unclear = 0
    for seed in range(first, first + count):
        c, h = some(seed, 2 + seed % 2)
        found = spectral(c, h, 50)
        if np.min(np.abs(found.real[:12])) < 1e-6:
            unclear += 1
            continue
        good = int(quasi.count_right(c, h, apart(len(c)))) == np.sum(found.real > 0)
        good &= all(
            np.min(np.abs(found - s)) < 1e-6 * max(1.0, abs(s)) for s in late_roots.rightmost(c, h, apart(len(c)), 3)
        )
        right, wrong = right + good, wrong + (not good)
        if not good:
            print(f"equation {seed}")
    print(f"{count} delay equations: {right} right, {wrong} wrong, {unclear} on the edge")
    right = wrong = 0
    for seed in range(first, first + count // 5):
        machine, matrix = at_random(seed, delay=float(10 ** np.random.default_rng(seed).uniform(-2, 0.3)))
        good = int(unstable_roots(operating_point(machine))) in (winding(matrix, 300.0), quasi.INFINITE)
        inside = [sum(w for w in pair if np.isfinite(w)) / 2 for pair in ss.stable_values(machine, "drive.delay")]
        good &= set(ss.stability(machine, {"drive.delay": inside}).tolist() if inside else ["stable"]) == {"stable"}
        right, wrong = right + good, wrong + (not good)
        if not good:
            print(f"late machine {seed}")
    print(f"{count // 5} late machines: {right} right, {wrong} wrong")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    chosen = parsed(parser, count=1)
    times()
    campaign(chosen.count, chosen.first)
    onsets(chosen.count, chosen.first)
    delays(chosen.count, chosen.first)
    small_motions(chosen.count, chosen.first)
    motions(chosen.count, chosen.first)
