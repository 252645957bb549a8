"""Records of steps in normal stress with a memory drawn at random: does `compare_laws` tell which, and do errors hold?

python tests/helpers/stress_steps_at_random.py 100 1 draws 100 records with seed 1 and prints one line for each, then
how often the memory of normal stress (and the evolution law with it) was told, and the share of 95 % intervals, of fits
of the right law, that contain what the record was made with.
"""

from __future__ import annotations

import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import steadyslip as ss

EVOLUTIONS = ("slip", "aging")
MEMORIES = ("none", "linker-dieterich", "prakash-clifton")
LABELS = tuple(f"{evolution}, {memory}" for evolution in EVOLUTIONS for memory in MEMORIES)
SEEN = ("shear_stress", "normal_stress", "load_displacement")
FASTEST = 300.0  # rates of the drive that slip may reach
SPAN = 100.0  # slip distances that pass in a record


@dataclass(frozen=True)
class Drawn:
    """A record, and what it was made with."""

    rig: ss.Slider
    label: str
    record: ss.experiments.Record


def _rig(rng: np.random.Generator, evolution: str, memory: str) -> ss.Slider:
    """A rig that slides steadily, as those are on which steps of normal stress are made."""
    a, d_c, rate = rng.uniform(0.006, 0.014), 10 ** rng.uniform(-5.3, -4.5), 10 ** rng.uniform(-6, -5)
    b, stress = a * rng.uniform(0.6, 1.4), 10 ** rng.uniform(6.7, 7.6)
    memories = {
        "none": ss.laws.NoMemory(),
        "linker-dieterich": ss.laws.LinkerDieterich(alpha=rng.uniform(0.05, 0.6)),
        "prakash-clifton": ss.laws.PrakashClifton(
            direct_share=rng.uniform(0.1, 0.9), slip_distance=d_c * 10 ** rng.uniform(-0.5, 0.7)
        ),
    }
    friction = ss.laws.RateState(
        a=a, b=b, d_c=d_c, mu_ref=rng.uniform(0.5, 0.7), v_ref=rate,
        evolution=ss.laws.Slip() if evolution == "slip" else ss.laws.Aging(), normal_memory=memories[memory],
    )  # fmt: skip
    stiffness = stress * a / d_c * 10 ** rng.uniform(0.3, 1.0)
    return ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(steady_normal_stress=stress),
        stiffness=stiffness,
        drive=ss.machine.SteadyDrive(rate),
    )


def _protocol(rng: np.random.Generator, rig: ss.Slider) -> ss.Protocol:
    """Steps up and down, a few of which take a while; in every other experiment the rate changes too."""
    stress, rate = ss.steady_state(rig).normal_stress, rig.drive.velocity
    span = SPAN * rig.value("friction.d_c") / rate
    moments = (np.array([0.15, 0.4, 0.65, 0.85]) + rng.uniform(-0.03, 0.03, 4)) * span
    pieces: list[ss.protocol.Piece] = []
    above = 0.0
    for i, at in enumerate(moments):
        if i == 1 and rng.random() < 0.5:
            pieces.append(ss.protocol.VelocityStep(at=at, to=rate * rng.uniform(2, 4)))
            continue
        by = -above if above and rng.random() < 0.6 else stress * rng.uniform(0.02, 0.15) * rng.choice([-1, 1])
        if rng.random() < 0.3:
            pieces.append(ss.protocol.NormalStressRamp(at=at, by=by, duration=span * rng.uniform(0.002, 0.01)))
        else:
            pieces.append(ss.protocol.NormalStressStep(at=at, by=by))
        above += by
    return ss.Protocol(pieces=tuple(pieces), until=span)


def _noise(rng: np.random.Generator, count: int) -> np.ndarray:
    """Noise of friction with standard deviation 1e-4 to 4e-4, correlated in every other record."""
    size, memory = 10 ** rng.uniform(-4, -3.4), rng.choice([0.0, 0.5])
    fresh = rng.standard_normal(count)
    found = fresh.copy()
    for i in range(1, count):
        found[i] = memory * found[i - 1] + np.sqrt(1 - memory**2) * fresh[i]
    return size * found


def drawn(seed: int, count: int, samples: int = 400) -> Iterator[Drawn]:
    """So many records."""
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        label = LABELS[made % len(LABELS)]
        rig = _rig(rng, *label.split(", "))
        protocol = _protocol(rng, rig)
        times = np.linspace(0.0, protocol.until, samples)
        soon = np.array([piece.at for piece in protocol.pieces]) + 1e-6 * protocol.until
        run = ss.simulate(rig, protocol, times=np.union1d(times, soon), rtol=1e-9, events=False)
        if run.status != "done" or np.max(run["v"]) > FASTEST * rig.drive.velocity:  # a burst: a matter of inertia
            continue
        noise = _noise(rng, samples)
        shear, normal, moved = (np.asarray(run[name])[np.isin(run["t"], times)] for name in SEEN)
        stress = normal * (1 + 2e-4 * rng.standard_normal(samples))
        record = ss.record_from_arrays(
            time=times, shear=shear + noise * normal, normal=stress,
            displacement=moved + rng.choice([0.0, 2e-8]) * rng.standard_normal(samples),
            source=f"record {made + 1} of seed {seed}",
        )  # fmt: skip
        made += 1
        yield Drawn(rig, label, record)


def told(one: Drawn) -> tuple[ss.experiments.LawComparison, dict[str, bool]]:
    """The comparison of all laws, and which intervals of the right one contain the truth."""
    compared = ss.compare_laws(ss.lab_rig(v_ref=one.rig.drive.velocity), one.record, LABELS)
    fit = compared.fits[one.label]
    truth = {name: address.value for name, address in one.rig.parameters().items()}
    inside = {}
    for estimate in fit.estimates:
        if estimate.name in truth and estimate.determined:
            inside[estimate.name] = estimate.low <= truth[estimate.name] <= estimate.high
    return compared, inside


def main(count: int, seed: int) -> None:
    right: Counter[str] = Counter()
    covered: defaultdict[str, list[bool]] = defaultdict(list)
    for i, one in enumerate(drawn(seed, count), start=1):
        begun = time.process_time()
        compared, inside = told(one)
        memory = compared.best.split(", ")[1] == one.label.split(", ")[1]
        right["memory"] += memory
        right["both"] += compared.best == one.label
        for name, is_inside in inside.items():
            covered[name].append(is_inside)
        outside = [name.split(".")[-1] for name, is_inside in inside.items() if not is_inside]
        missed = "" if compared.best == one.label else f"  WRONG: {compared.best}" + ("" if memory else " (memory)")
        print(f"{i:4d} {one.label:<26}{missed}  outside: {', '.join(outside) or 'none'}"
              f"  {time.process_time() - begun:.0f} s", flush=True)  # fmt: skip
    print(f"memory right in {right['memory']} of {count}, memory and evolution in {right['both']}")
    for name, all_of in covered.items():
        print(f"{name:<40} inside {np.mean(all_of):.3f} of {len(all_of)}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
