"""Fits of records drawn at random: does a search that begins at the truth find a lower sum of squares?

python tests/helpers/minima_at_random.py KIND 100 1 fits 100 records of a kind with seed 1 and prints a line for each
that a start at the truth beats: by how much, in variances of one sample, and the values of both minima. Kinds are
`strong` (a step of the rate by three and steps of the normal stress of 2 to 20 %) and those of `fits_at_random`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import numpy as np

import fits_at_random
import steadyslip as ss
from fits_at_random import SEEN, SLOW, Drawn, noise_of
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.fitting.search import minima_near

FASTEST = 50.0  # rates of the drive that slip may reach
BEATEN = 10.0  # fall of the sum of squares, in variances of one sample, that no chance of rounding or ends explains


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
    run = ss.simulate(rig, ss.Protocol(pieces=tuple(pieces), until=at), times=times, rtol=1e-9, events=False)
    if run.status != "done" or np.max(run["v"]) > FASTEST * np.max(run["load_velocity"]):
        raise ValueError("a burst: a matter of inertia")
    shear, normal, moved = (np.asarray(run[name]) for name in SEEN)
    size, sensor = 10 ** rng.uniform(-4.3, -3), 10 ** rng.uniform(-8.3, -6.8)
    noise = size * noise_of(rng, samples)
    record = ss.record_from_arrays(
        time=times, shear=shear + noise * normal,
        normal=normal * (1 + 10 ** rng.uniform(-4.5, -3) * rng.standard_normal(samples)),
        displacement=moved + sensor * rng.standard_normal(samples), source="strong",
    )  # fmt: skip
    return Drawn(rig, law, record)


def drawn(kind: str, count: int, seed: int) -> Iterator[Drawn]:
    """So many records of a kind."""
    if kind != "strong":
        yield from fits_at_random.drawn(kind, count, seed)
        return
    made = 0
    for own in np.random.default_rng([seed, 5]).spawn(20 * count):
        try:
            yield strong(own)
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


def main(kind: str, count: int, seed: int) -> None:
    beaten, seconds, refused = [], [], 0
    for i, one in enumerate(drawn(kind, count, seed)):
        begun = time.process_time()
        try:
            fit, lower, values = below(one)
        except ss.NotAvailable as problem:
            refused += 1
            print(f"{i:4d} refused: {problem}", flush=True)
            continue
        seconds.append(time.process_time() - begun)
        if lower > BEATEN:
            beaten.append(lower)
            truth = {name: address.value for name, address in one.rig.parameters().items()}
            own = "  ".join(f"{name.split('.')[-1]} {fit.values[name]:.3g} ({values[name]:.3g}, true {truth[name]:.3g})"
                            for name in fit.names if name in truth)  # fmt: skip
            print(f"{i:4d} {one.law:<6} beaten by {lower:.0f}, {fit.search.arrived} of {fit.search.starts} starts"
                  f"{'' if fit.search.converged else ', no errors'}{', cut' if fit.search.cut else ''}:"
                  f" {own}", flush=True)  # fmt: skip
    print(f"{kind}: {len(beaten)} of {len(seconds)} beaten by a start at the truth, {refused} refused,"
          f" median {np.median(seconds):.2f} s")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
