"""Fits of records drawn at random: does a search that begins at the truth find a lower sum of squares?

python tests/helpers/minima_at_random.py KIND 100 1 fits 100 records of a kind with seed 1 and prints a line for each
that a start at the truth beats, by how much, in variances of one sample, with the values of both minima, or that is
over `OFF` standard errors off. Kinds are `strong` (a step of the rate by three and steps of the normal stress of 2 to
20 %), `single` (one step of the normal stress of 2 to 15 %) and those of `fits_at_random`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

import fits_at_random
import steadyslip as ss
from fits_at_random import SEEN, SLOW, Drawn, noise_of
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.fitting.search import minima_near

FASTEST = 50.0  # rates of the drive that slip may reach
BEATEN = 10.0  # fall of the sum of squares, in variances of one sample, that no chance of rounding or ends explains
OFF = 4.0  # standard errors of a value, or of a - b, that none may be off


def single(rng: np.random.Generator) -> Drawn:
    """One step of the normal stress, after which little of the law is told apart."""
    law = rng.choice(["slip", "aging"])
    a, d_c, level = rng.uniform(0.006, 0.014), 10 ** rng.uniform(-5.3, -4.5), 10 ** rng.uniform(6.7, 7.6)
    friction = ss.laws.RateState(
        a=a, b=a * rng.uniform(0.6, 1.5), d_c=d_c, mu_ref=0.6, v_ref=SLOW,
        evolution=getattr(ss.laws, law.title())(), normal_memory=ss.laws.LinkerDieterich(alpha=rng.uniform(0.1, 0.5)),
    )  # fmt: skip
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=level)
    stiffness = level * a / d_c * 10 ** rng.uniform(0.2, 1)
    rig = ss.Slider(friction=friction, contact=contact, stiffness=stiffness, drive=ss.machine.SteadyDrive(SLOW))
    at, by = 10 * d_c / SLOW, level * rng.choice([-1, 1]) * rng.uniform(0.02, 0.15)
    times = np.linspace(0, 4 * at, 600)
    protocol = ss.Protocol(pieces=(ss.protocol.NormalStressStep(at=at, by=by),), until=4 * at)
    return Drawn(rig, law, _seen(rng, rig, protocol, times, 1e-4, 2e-8, lambda: rng.standard_normal(600)))


def strong(rng: np.random.Generator) -> Drawn:
    """A step of the rate by three and steps of the normal stress, in any order, far apart or before all has settled."""
    law = rng.choice(["slip", "aging"])
    a, d_c, level = rng.uniform(0.005, 0.015), 10 ** rng.uniform(-5.5, -4.3), 10 ** rng.uniform(6.5, 7.6)
    friction = ss.laws.RateState(
        a=a, b=a * rng.uniform(0.5, 1.6), d_c=d_c, mu_ref=rng.uniform(0.5, 0.7), v_ref=SLOW,
        evolution=getattr(ss.laws, law.title())(),
        normal_memory=ss.laws.LinkerDieterich(alpha=rng.uniform(0.05, 0.5)),
    )  # fmt: skip
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=level)
    drive = ss.machine.SteadyDrive(SLOW)
    rig = ss.Slider(friction=friction, contact=contact, stiffness=rng.uniform(8e9, 40e9), drive=drive)
    by = level * 10 ** rng.uniform(-1.7, -0.7) * rng.choice([-1, 1])
    unit = rng.choice([60, d_c / SLOW * 10])
    kinds = np.array(["rate", *["stress"] * int(rng.integers(1, 4))])
    mixed = rng.permutation(kinds)
    kinds = kinds if rng.random() < 0.6 else mixed
    at, pieces = unit * rng.uniform(0.3, 2), list[ss.protocol.Piece]()
    ratio = rng.choice([3, 3, 1 / 3])
    for kind in kinds:
        if kind == "rate":
            pieces.append(ss.protocol.VelocityStep(at=at, to=ratio * SLOW))
        else:
            pieces.append(ss.protocol.NormalStressStep(at=at, by=by))
            by *= -1 if rng.random() < 0.8 else 1
        at += rng.uniform(0.2, 1.5) * unit
    samples = int(rng.choice([200, 400, 800, 1600, 3200]))
    times = np.linspace(0, at, samples)
    protocol = ss.Protocol(pieces=tuple(pieces), until=at)
    size, sensor = 10 ** rng.uniform(-4.3, -3), 10 ** rng.uniform(-8.3, -6.8)
    return Drawn(rig, law, _seen(rng, rig, protocol, times, size, sensor, lambda: noise_of(rng, samples)))


def _seen(
    rng: np.random.Generator, rig: ss.Slider, protocol: ss.Protocol, times: np.ndarray, size: float, sensor: float,
    noise: Callable[[], np.ndarray],
) -> ss.experiments.Record:  # fmt: skip
    """A record of a motion, with noise of a size in friction and of a sensor (m)."""
    run = ss.simulate(rig, protocol, times=times, rtol=1e-9, events=False)
    if run.status != "done" or np.max(run["v"]) > FASTEST * np.max(run["load_velocity"]):
        raise ValueError("a burst: a matter of inertia")
    shear, normal, moved = (np.asarray(run[name]) for name in SEEN)
    shear = shear + size * noise() * normal
    normal = normal * (1 + 10 ** rng.uniform(-4.5, -3) * rng.standard_normal(len(times)))
    moved = moved + sensor * rng.standard_normal(len(times))
    return ss.record_from_arrays(time=times, shear=shear, normal=normal, displacement=moved, source="drawn")


KINDS = {"strong": strong, "single": single}


def drawn(kind: str, count: int, seed: int) -> Iterator[Drawn]:
    """So many records of a kind."""
    if kind not in KINDS:
        yield from fits_at_random.drawn(kind, count, seed)
        return
    made = 0
    for own in np.random.default_rng([seed, 5]).spawn(20 * count):
        try:
            yield KINDS[kind](own)
        except ValueError:
            continue
        made += 1
        if made == count:
            return


def below(one: Drawn, **options: object) -> tuple[ss.experiments.Fit, float, dict[str, float]]:
    """Fit, by how much a start at the truth is lower (in variances of one sample), and the values it ends at."""
    fit = search_fit(ss.lab_rig(one.law, normal_memory=one.rig.friction.normal_memory.name), one.record, **options)
    truth = {name: address.value for name, address in one.rig.parameters().items()}
    begin = np.array([truth.get(u.parameter, fit.values[u.name]) for u in fit.space.unknowns])
    effort = Effort()
    ends = minima_near(fit.plan.comparison(effort), fit.space.coordinates(begin[None]), fit.bounds, effort)
    values = dict(zip(fit.names, fit.space.values(ends.coordinates[0]), strict=True))
    return fit, float((fit.ssq / ends.ssq[0] - 1) * fit.samples), values


def far_off(one: Drawn, fit: ss.experiments.Fit) -> dict[str, float]:
    """Values quoted with an error, and a - b, that are over `OFF` standard errors off: by how many."""
    truth = {name: address.value for name, address in one.rig.parameters().items()}
    truth["a - b"] = truth["friction.a"] - truth["friction.b"]
    told = [*(own for own in fit.estimates if own.determined), *fit.derived]
    off = {own.name: (own.value - truth[own.name]) / own.error for own in told if own.name in truth and own.error > 0}
    return {name: z for name, z in off.items() if abs(z) > OFF}


def main(kind: str, count: int, seed: int) -> None:
    beaten, seconds, refused, wrong = [], [], 0, 0
    for i, one in enumerate(drawn(kind, count, seed)):
        begun = time.process_time()
        try:
            fit, lower, values = below(one)
        except ss.NotAvailable as problem:
            refused += 1
            print(f"{i:4d} refused: {problem}", flush=True)
            continue
        seconds.append(time.process_time() - begun)
        if off := far_off(one, fit):
            wrong += 1
            print(f"{i:4d} {one.law:<6} off by {', '.join(f'{name} {z:.1f}' for name, z in off.items())}", flush=True)
        if lower > BEATEN:
            beaten.append(lower)
            truth = {name: address.value for name, address in one.rig.parameters().items()}
            own = "  ".join(f"{name.split('.')[-1]} {fit.values[name]:.3g} ({values[name]:.3g}, true {truth[name]:.3g})"
                            for name in fit.names if name in truth)  # fmt: skip
            print(f"{i:4d} {one.law:<6} beaten by {lower:.0f}, {fit.search.arrived} of {fit.search.starts} starts"
                  f"{'' if fit.search.converged else ', no errors'}{', cut' if fit.search.cut else ''}:"
                  f" {own}", flush=True)  # fmt: skip
    print(f"{kind}: {len(beaten)} of {len(seconds)} beaten by a start at the truth, {refused} refused,"
          f" {wrong} off by over {OFF:g} standard errors,"
          f" median {np.median(seconds):.2f} s")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
