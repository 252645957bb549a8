"""Fits of records drawn at random: do 95 % intervals hold the truth, and is a servo named where there is one?

python tests/helpers/fits_at_random.py KIND 100 1 fits 100 records of a kind with seed 1 and prints a line for each
(deviations from the truth in standard errors, CPU seconds, whether a servo is named), then what they say together.
Kinds are those of `DESIGNS`, and the cells of `SERVOS` and `WAYS` with the law, such as "aging, overshoot".
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import steadyslip as ss
from servo_records import WAYS, record as servo_record

SLOW = 1e-6
SEEN = ("shear_stress", "normal_stress", "load_displacement")
SERVOS: dict[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "ideal": ((0, 0), (0, 0)),
    "brief lag": ((0.05, 0.15), (0, 0)),
    "lag": ((0.15, 0.5), (0, 0)),
    "small overshoot": ((0, 0), (0.05, 0.15)),
    "overshoot": ((0, 0), (0.15, 0.35)),
    "both": ((0.3, 1.0), (0.05, 0.35)),
}
"""Ranges of lag (s; time to settle, where there is an overshoot) and overshoot of each cell."""


@dataclass(frozen=True)
class Drawn:
    """A record, and what it was made with."""

    rig: ss.Slider
    law: str
    record: ss.experiments.Record


@dataclass(frozen=True)
class Outcome:
    """Deviations from the truth in standard errors, by name; cost in CPU seconds; what the fit says of a servo."""

    z: dict[str, float]
    seconds: float
    servo: bool
    structure: float
    ssq: float


def servo_case(rng: np.random.Generator, kind: str) -> Drawn:
    """Two steps by a servo of a cell."""
    law, cell = kind.split(", ")
    if cell in WAYS:
        record, rig = servo_record(int(rng.integers(2**31)), evolution=getattr(ss.laws, law.title())(), way=cell)
        return Drawn(rig, law, record)
    lag, overshoot = (rng.uniform(*ends) if ends[1] else 0.0 for ends in SERVOS[cell])
    record, rig = servo_record(int(rng.integers(2**31)), lag, overshoot, getattr(ss.laws, law.title())())
    return Drawn(rig, law, record)


def noise_of(rng: np.random.Generator, count: int, longest: float = 0.98) -> np.ndarray:
    """White noise plus a first-order autoregression, of standard deviation 1 each or less."""
    memory = rng.uniform(0.3, longest)
    slow = lfilter([np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(count + 1000))[1000:]
    return rng.uniform(0.2, 1) * rng.standard_normal(count) + rng.uniform(0.2, 1) * slow


def rig_of(rng: np.random.Generator, law: str, alpha: float | None = None) -> ss.Slider:
    """A press and a sample that slide steadily at all rates."""
    a, d_c, stress = rng.uniform(0.006, 0.014), 10 ** rng.uniform(-5.3, -4.5), 10 ** rng.uniform(6.7, 7.6)
    friction = ss.laws.RateState(
        a=a, b=a * rng.uniform(0.6, 1.5), d_c=d_c, mu_ref=rng.uniform(0.5, 0.7), v_ref=SLOW,
        evolution=getattr(ss.laws, law.title())(),
        normal_memory=ss.laws.NoMemory() if alpha is None else ss.laws.LinkerDieterich(alpha=alpha),
    )  # fmt: skip
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=stress)
    stiffness = stress * a / d_c * 10 ** rng.uniform(0.2, 1.0)
    return ss.Slider(friction=friction, contact=contact, stiffness=stiffness, drive=ss.machine.SteadyDrive(SLOW))


def simulated(
    rng: np.random.Generator, rig: ss.Slider, protocol: ss.Protocol, samples: int, times: np.ndarray | None = None,
    least: float = 1e-4,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Columns with correlated noise in friction and in displacement; normal stress with white noise."""
    times = np.linspace(0.0, protocol.until, samples) if times is None else times
    run = ss.simulate(rig, protocol, times=times, rtol=1e-9, events=False)
    if run.status != "done" or np.max(run["v"]) > 300 * np.max(run["load_velocity"]):
        raise ValueError("a burst: a matter of inertia")
    shear, normal, moved = (np.asarray(run[name]) for name in SEEN)
    size = 10 ** rng.uniform(np.log10(least), -3.4)
    sensor = 10 ** rng.uniform(-8.3, -7.3)
    return {
        "time": times,
        "shear": shear + size * noise_of(rng, samples) * normal,
        "normal": normal * (1 + 2e-4 * rng.standard_normal(samples)),
        "displacement": moved + sensor * noise_of(rng, samples, 0.9),
    }


def steps(rng: np.random.Generator, kind: str) -> Drawn:
    """One or two steps of the rate."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law)
    unit, ratio = rig.value("friction.d_c") / SLOW, rng.choice([0.1, 1 / 3, 3.0, 10.0])
    at = 15 * unit * rng.uniform(0.9, 1.1)
    end = at + 20 * unit / ratio
    pieces = [ss.protocol.VelocityStep(at=at, to=ratio * SLOW)]
    if rng.random() < 0.5:
        pieces.append(ss.protocol.VelocityStep(at=end, to=SLOW))
        end += 15 * unit
    columns = simulated(rng, rig, ss.Protocol(pieces=tuple(pieces), until=end), int(rng.choice([600, 1000, 2000])))
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def five(rng: np.random.Generator, kind: str) -> Drawn:
    """Five steps up and down."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law)
    unit, rates = rig.value("friction.d_c") / SLOW, (3.0, 1.0, 10.0, 3.0, 1.0)
    at, pieces = 15 * unit, []
    for rate in rates:
        pieces.append(ss.protocol.VelocityStep(at=at * rng.uniform(0.99, 1.01), to=rate * SLOW))
        at += 18 * unit / rate
    columns = simulated(rng, rig, ss.Protocol(pieces=tuple(pieces), until=at), 2000)
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def stress(rng: np.random.Generator, kind: str) -> Drawn:
    """A step of the rate, and steps of the normal stress up and down."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law, rng.uniform(0.1, 0.5))
    level, unit = ss.steady_state(rig).normal_stress, rig.value("friction.d_c") / SLOW
    by = level * rng.uniform(0.03, 0.12) * rng.choice([-1, 1])
    moments = np.array([15, 24, 36, 48]) * unit * rng.uniform(0.98, 1.02, 4)
    pieces = (
        ss.protocol.VelocityStep(at=moments[0], to=3 * SLOW),
        ss.protocol.NormalStressStep(at=moments[1], by=by),
        ss.protocol.NormalStressStep(at=moments[2], by=-by),
    )
    columns = simulated(rng, rig, ss.Protocol(pieces=pieces, until=moments[3]), 1200)
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def pressed(rng: np.random.Generator, kind: str) -> Drawn:
    """Steps of the normal stress up and down, at one rate."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law, rng.uniform(0.1, 0.5))
    level, unit = ss.steady_state(rig).normal_stress, rig.value("friction.d_c") / SLOW
    by = level * rng.uniform(0.03, 0.12) * rng.choice([-1, 1])
    moments = np.array([15, 30, 45]) * unit * rng.uniform(0.98, 1.02, 3)
    pieces = tuple(ss.protocol.NormalStressStep(at=at, by=own) for at, own in zip(moments, (by, -by), strict=False))
    columns = simulated(rng, rig, ss.Protocol(pieces=pieces, until=moments[2]), 1200)
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def soft(rng: np.random.Generator, kind: str) -> Drawn:
    """Two steps of a soft press, at 2 to 3 of the critical stiffness; few samples of its swings."""
    law = rng.choice(["slip", "aging"])
    a, d_c, stress = rng.uniform(0.008, 0.014), 10 ** rng.uniform(-5.3, -5), 10 ** rng.uniform(6.5, 7)
    rig = rig_of(rng, law).with_values(
        {"friction.a": a, "friction.b": a * rng.uniform(1.05, 1.08), "friction.d_c": d_c}
    )
    rig = rig.with_values({"contact.steady_normal_stress": stress})
    rig = rig.with_values({"slider.stiffness": float(ss.critical_stiffness(rig)) * rng.uniform(2, 3)})
    times = np.array([30, 59, 145]) * d_c / 7e-6 * rng.uniform(0.98, 1.02, 3)
    pieces = tuple(ss.protocol.VelocityStep(at=at, to=to * SLOW) for at, to in zip(times, (3, 1), strict=False))
    columns = simulated(rng, rig, ss.Protocol(pieces=pieces, until=times[2]), 350, least=2.5e-4)
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def dirty(rng: np.random.Generator, kind: str) -> Drawn:
    """Steps with rows lost, a gap, wild samples, an uneven clock."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law)
    unit = rig.value("friction.d_c") / SLOW
    pieces = (
        ss.protocol.VelocityStep(at=15 * unit, to=5 * SLOW),
        ss.protocol.VelocityStep(at=22 * unit, to=SLOW),
    )
    until, count = 40 * unit, 1500
    times = np.sort(np.linspace(0, until, count) + 0.3 * until / count * rng.uniform(-1, 1, count)) + until / count
    times = times[times < until]
    columns = simulated(rng, rig, ss.Protocol(pieces=pieces, until=until), len(times), times)
    keep = rng.random(len(times)) > 0.03
    gap = rng.uniform(24, 36) * unit
    keep &= (times < gap) | (times > gap + 0.5 * unit)
    columns = {name: values[keep].copy() for name, values in columns.items()}
    wild = rng.choice(len(columns["time"]), 5, replace=False)
    columns["shear"][wild] *= 1 + rng.choice([-1, 1], 5) * rng.uniform(0.05, 0.5, 5)
    columns["displacement"][rng.choice(len(columns["time"]), 3, replace=False)] = np.nan
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


def holds(rng: np.random.Generator, kind: str) -> Drawn:
    """Slides, and holds of 1 to 1000 s."""
    law = rng.choice(["slip", "aging"])
    rig = rig_of(rng, law)
    rate = 10 * SLOW
    rig = rig.with_values({"drive.velocity": rate})
    slide = 25 * rig.value("friction.d_c") / rate
    at, pieces = slide, []
    for length in (1.0, 10.0, 100.0, 1000.0)[: rng.integers(3, 5)]:
        length *= rng.uniform(0.9, 1.1)
        pieces.append(ss.protocol.Hold(at=at, duration=length))
        at += length + slide
    columns = simulated(rng, rig, ss.Protocol(pieces=tuple(pieces), until=at), 10_000)
    return Drawn(rig, law, ss.record_from_arrays(**columns, source=kind))


DESIGNS: dict[str, Callable[[np.random.Generator, str], Drawn]] = {
    "steps": steps, "five": five, "stress": stress, "dirty": dirty, "holds": holds,
} | {f"{law}, {cell}": servo_case for law in ("slip", "aging") for cell in (*SERVOS, *WAYS)}  # fmt: skip
DESIGNS |= {"pressed": pressed, "soft": soft}  # the place of a kind in the table seeds it


def drawn(kind: str, count: int, seed: int) -> Iterator[Drawn]:
    """So many records of a kind."""
    made, chances = 0, iter(np.random.default_rng([seed, [*DESIGNS].index(kind)]).spawn(10 * count))
    while made < count:
        try:
            yield DESIGNS[kind](next(chances), kind)
            made += 1
        except ValueError:
            continue


def outcome(one: Drawn) -> Outcome:
    """Fit of a record with the law it was made with, against the truth."""
    memory = one.rig.friction.normal_memory.name
    begun = time.process_time()
    fit = ss.fit(ss.lab_rig(one.law, normal_memory=memory), one.record)
    seconds = time.process_time() - begun
    truth = {name: address.value for name, address in one.rig.parameters().items()}
    z = {
        estimate.name.split(".")[-1]: fit_deviation(fit, i, truth[estimate.name])
        for i, estimate in enumerate(fit.estimates)
        if estimate.name in truth and estimate.determined and estimate.name != "friction.mu_ref"
    } | derived_deviations(fit, truth)
    servo = any(change.lag or change.pieces for loading in fit.plan.loading for _, _, change in loading.changes)
    return Outcome(z, seconds, servo, fit.whiteness.p, fit.ssq)


def fit_deviation(fit: ss.experiments.Fit, i: int, truth: float) -> float:
    """Estimate less truth, in standard errors of the coordinate in which errors are computed."""
    coordinate = fit.space.unknowns[i].coordinate(truth)
    return float((fit.coordinates[i] - coordinate) / np.sqrt(fit.covariance[i, i]))


def derived_deviations(fit: ss.experiments.Fit, truth: Mapping[str, float]) -> dict[str, float]:
    """Estimates of quantities that follow from parameters, less the truth, in standard errors; of k_c in its logarithm.

    Times of changes do not matter for them.
    """
    pairs = zip(fit.space.unknowns, fit.coordinates, strict=True)
    true = fit.derived_at(np.array([[u.coordinate(truth.get(u.parameter, u.value(c))) for u, c in pairs]]))
    found = {}
    for one in fit.derived:
        is_log = one.name != "a - b"
        off, error = (np.log(one.value / true[one.name][0]), one.error / one.value) if is_log else (
            one.value - true[one.name][0], one.error)  # fmt: skip
        if np.isfinite(off):
            found[one.name] = float(off / error)
    return found


def main(kind: str, count: int, seed: int) -> None:
    found = []
    for i, one in enumerate(drawn(kind, count, seed)):
        try:
            own = outcome(one)
        except ss.NotAvailable as problem:
            print(f"{i:4d} refused: {problem}", flush=True)
            continue
        found.append(own)
        text = "  ".join(f"{name} {z:6.2f}" for name, z in own.z.items())
        print(f"{i:4d} {one.law:<6} {text}  {own.seconds:.2f} s  p {own.structure:.1e}"
              f"{'  servo' if own.servo else ''}", flush=True)  # fmt: skip
    values = np.array([z for own in found for z in own.z.values()])
    print(f"{kind}: {len(found)} fits, rms z {np.sqrt(np.mean(values**2)):.3f}, mean {np.mean(values):.3f},"
          f" 95 % cover {np.mean(np.abs(values) < 1.96):.3f}, median {np.median([o.seconds for o in found]):.2f} s,"
          f" servo named in {sum(own.servo for own in found)}")  # fmt: skip
    for name in dict.fromkeys(name for own in found for name in own.z):
        z = np.array([own.z[name] for own in found if name in own.z])
        print(f"  {name:<14} {np.sum(np.abs(z) < 1.96):4d} of {len(z)} inside, mean {z.mean():6.2f},"
              f" rms {np.sqrt(np.mean(z**2)):.2f}")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
