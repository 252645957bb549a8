"""Fits of machines drawn at random to their own records: do 95 % intervals hold the truth?

python tests/helpers/machine_fits_at_random.py KIND 100 1 fits 100 records of a kind ("ring-down", "drive test",
"response") with seeds from 1 and prints a line for each (deviations from the truth in standard errors, what is left
open, CPU seconds), then what they say together.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import binom, chi2

import steadyslip as ss
from steadyslip.linear.receptance import receptance
from steadyslip.model.point import operating_point

MISSED = 1.01  # excess of a fit that ended at another minimum
KINDS = ("ring-down", "drive test", "response")


def drawn_machine(rng):
    """One to three bodies in a row behind a drive, the last on a guide that strengthens; masses near 1, speed 1."""
    count = int(rng.integers(1, 4))
    names = [f"b{i}" for i in range(count)]
    masses, springs = np.exp(rng.uniform(-0.7, 0.7, count)), np.exp(rng.uniform(4.0, 6.0, count))
    dampings = 2 * rng.uniform(0.005, 0.05, count) * np.sqrt(springs * masses)
    links = {
        f"s{i}": ss.machine.Spring(between=(before, name), stiffness=float(k), damping=float(c))
        for i, (before, name, k, c) in enumerate(zip(["drive", *names], names, springs, dampings, strict=False))
    }
    direct, slope, rate = rng.uniform(0.1, 0.4), rng.uniform(0.05, 0.2), rng.uniform(0.5, 3.0)
    friction = ss.laws.RateState(
        a=direct, b=direct - slope, d_c=1 / rate, mu_ref=2.0, v_ref=1.0, regularised=True
    )  # fmt: skip
    guide = ss.machine.Surface(body=names[-1], friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.0))
    bodies = {name: ss.machine.SlidingBody(mass=float(mass)) for name, mass in zip(names, masses, strict=True)}
    return ss.Machine(bodies=bodies, links=links, contacts={"guide": guide}, drive=ss.machine.Pull(velocity=1.0))


@dataclass(frozen=True)
class Drawn:
    """A machine, a record of it, and arguments of the fit."""

    machine: ss.Machine
    record: object
    options: dict


def noise(rng, count, correlated):
    """Noise of deviation 1, white or of a first-order autoregression."""
    memory = 0.6 if correlated else 0.0
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(count + 50))[50:]


def drawn(kind, seed, size=0.02):
    """The case of a seed; `size` is the noise as a share of each column's changes."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    machine = drawn_machine(rng)
    last, slowest = (
        list(machine.bodies)[-1],
        float(np.min(np.abs(ss.eigenvalues(machine).imag[ss.eigenvalues(machine).imag > 0]))),
    )
    size *= float(rng.uniform(0.5, 1.5))
    if kind == "response":
        omega = slowest * np.linspace(0.3, 4.0, 240)
        ends = [last] if rng.uniform() < 0.5 else list(dict.fromkeys(["b0", last]))
        found = receptance(operating_point(machine), omega, [f"{e}.x" for e in ends], [f"{e}.push" for e in ends])
        for i in range(len(ends)):
            for j in range(len(ends)):
                own = found[:, i, j]
                own += size * np.std(own) * (noise(rng, 240, False) + 1j * noise(rng, 240, False))
        data = ss.machine.ResponseData(omega, found, np.zeros(found.shape), tuple(f"{e}.x" for e in ends), "tap")
        return Drawn(machine, data, {})
    correlated = bool(rng.integers(2))
    span = 2 * np.pi / slowest * float(rng.uniform(6, 25))
    times = np.linspace(0.0, span, 500)
    if kind == "ring-down":
        start = {f"{name}.x": float(rng.uniform(-0.02, 0.02)) for name in machine.bodies}
        options, protocol = {"initial": "free"}, None
        names = list(rng.permutation([f"{name}.x" for name in machine.bodies])[: int(rng.integers(1, 3))])
    else:
        start = {}
        step = ss.protocol.VelocityStep(at=0.05 * span, to=float(rng.uniform(1.2, 2.0)))
        push = ss.protocol.DisturbancePulse(
            at=0.5 * span, by=float(rng.uniform(0.2, 1.0)), duration=0.02 * span, on=last
        )
        protocol = [step, push]
        options, names = {"protocol": protocol}, [f"{last}.v", "links.s0.force"]
    run = ss.simulate(machine, protocol, until=span, times=times, initial=start, rtol=1e-10)
    columns = {name: np.array(run[name]) for name in names}
    columns = {name: x + size * np.std(x) * noise(rng, len(x), correlated) for name, x in columns.items()}
    return Drawn(machine, ss.experiments.motion_from_arrays(times, columns), options)


@dataclass(frozen=True)
class Outcome:
    """Deviations from the truth in standard errors by name; names left open; CPU seconds.

    `excess` is the largest scatter of a column over that of a fit that began at the truth: the search found the minimum
    if it is not above 1.
    """

    z: dict[str, float]
    open: tuple[str, ...]
    seconds: float
    excess: float


def outcome(kind, seed):
    """Fit three parameters of the case of a seed, from up to half as much again."""
    case, rng = drawn(kind, seed), np.random.default_rng([9, seed])
    known = [n for n in case.machine.parameters() if n.endswith((".stiffness", ".damping", ".mass", "friction.a"))]
    free = [str(name) for name in rng.permutation(known)[:3]]
    begin = case.machine.with_values({n: case.machine.value(n) * float(np.exp(rng.uniform(-0.4, 0.4))) for n in free})
    started = time.process_time()
    fit = ss.fit(begin, case.record, free, **case.options)
    seconds = time.process_time() - started
    truth = fit.coordinates.copy()
    for i, one in enumerate(fit.space.unknowns):
        if one.parameter in free:
            truth[i] = one.coordinate(case.machine.value(one.parameter))
    z = {
        n: float(fit.coordinates[i] - truth[i]) / float(np.sqrt(fit.covariance[i, i]))
        for i, n in enumerate(fit.names)
        if n in free and fit[n].determined
    }
    near = ss.fit(case.machine, case.record, free, **case.options, starts=1)
    excess = max(fit.scatter[name] / near.scatter[name] for name in fit.scatter)
    return Outcome(z, tuple(n for n in free if not fit[n].determined), seconds, excess)


def told(outcomes):
    """Rms of z, share within 1.96, and whether both are within what chance does in 999 of 1000 campaigns.

    One deviation of each fit counts, the first: others of it are correlated with it.
    """
    z = np.array([next(iter(one.z.values())) for one in outcomes if one.z])
    rms, held = float(np.sqrt(np.mean(z**2))), int(np.sum(np.abs(z) < 1.96))
    low, high = (float(np.sqrt(chi2.ppf(p, len(z)) / len(z))) for p in (0.0005, 0.9995))
    fewest = int(binom.ppf(0.001, len(z), 0.95))
    return rms, held / len(z), low < rms < high and held >= fewest


if __name__ == "__main__":
    of, count, first = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    every = []
    for k in range(first, first + count):
        one = outcome(of, k)
        every.append(one)
        words = ", ".join(f"{name} {z:+.2f}" for name, z in one.z.items())
        print(k, words, "open:", *one.open, f"{one.seconds:.1f} s, {one.excess:.4f}", flush=True)
    z = np.array([z for one in every for z in one.z.values()])
    print(len(z), "deviations: rms", np.sqrt(np.mean(z**2)), "within 1.96:", np.mean(np.abs(z) < 1.96),
          "worst", np.max(np.abs(z)), "first alone:", told(every))  # fmt: skip
    print(
        "minima missed:",
        sum(one.excess > MISSED for one in every),
        "CPU s",
        np.median([one.seconds for one in every]),
    )
