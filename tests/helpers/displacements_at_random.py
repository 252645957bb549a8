"""Records whose displacement is the load point's or the fault's, at random: is the one told from the other, is k right?

python tests/helpers/displacements_at_random.py 100 1 fits 100 records of each kind of press, servo and displacement
with seed 1 and prints a line for each (fitted over true stiffness, deviation in standard errors, CPU seconds, what the
text has of the displacement), then counts. Further arguments ("soft", "across", "lag") take kinds with them in their
names alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import steadyslip as ss
from fits_at_random import fit_deviation, noise_of
from servo_records import response

SLOW = 1e-6
PRESSES = {"soft": ((8e9, 16e9), (5e6, 10e6)), "stiff": ((20e9, 120e9), (5e6, 40e6))}
"""Ranges of stiffness (Pa/m) and normal stress (Pa)."""
SERVOS = {"ideal": ((0, 0), (0, 0)), "lag": ((0.05, 0.5), (0, 0)), "overshoot": ((0, 0), (0.05, 0.35))}
"""Ranges of lag (s) and overshoot."""
KINDS = tuple(f"{press}, {servo}, {what}" for press in PRESSES for servo in SERVOS for what in ("across", "load point"))


@dataclass(frozen=True)
class Drawn:
    """A record, and what it was made with."""

    kind: str
    law: str
    rig: ss.Slider
    record: ss.experiments.Record


def rig_of(rng: np.random.Generator, press: str, law: str) -> ss.Slider:
    """A press and a sample that slide steadily at all rates."""
    (low, high), stresses = PRESSES[press]
    stiffness, stress = np.exp(rng.uniform(np.log(low), np.log(high))), rng.uniform(*stresses)
    a, b, d_c = rng.uniform(0.006, 0.014), rng.uniform(0.006, 0.018), np.exp(rng.uniform(np.log(2e-6), np.log(3e-5)))
    if 1.3 * stress * (b - a) > stiffness * d_c:
        raise ValueError("sticks and slips")
    friction = ss.laws.RateState(
        a=a, b=b, d_c=d_c, mu_ref=rng.uniform(0.5, 0.7), v_ref=SLOW, evolution=getattr(ss.laws, law.title())()
    )
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=stress)
    return ss.Slider(friction=friction, contact=contact, stiffness=stiffness, drive=ss.machine.SteadyDrive(SLOW))


def case(rng: np.random.Generator, kind: str) -> Drawn:
    """One or two steps of the rate."""
    press, servo, what = kind.split(", ")
    law = str(rng.choice(["slip", "aging"]))
    rig = rig_of(rng, press, law)
    lag, beyond = (rng.uniform(*ends) if ends[1] else 0.0 for ends in SERVOS[servo])
    spring = rig.friction.a * ss.steady_state(rig).normal_stress / rig.value("slider.stiffness")
    unit = (rig.value("friction.d_c") + spring) / SLOW  # s of sliding in which friction settles
    ratio = float(np.exp(rng.uniform(np.log(3), np.log(10))))
    at = unit * rng.uniform(6, 15)
    steps, until = [(at, ratio * SLOW)], at + unit * rng.uniform(8, 25) / ratio
    if rng.random() < 0.6:
        steps.append((until, SLOW))
        until += unit * rng.uniform(6, 15)
    fine = np.linspace(0, until, 2001)
    fine = np.concatenate([fine, *(start + np.append(0, np.geomspace(1e-4, 20, 3000)) for start, _ in steps)])
    fine = np.unique(fine[fine <= until])
    v, before = np.full(len(fine), SLOW), SLOW
    for start, to in steps:
        v += (to - before) * response(fine - start, lag, beyond)
        before = to
    place = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(fine))])
    piece = ss.protocol.LoadPointTable(time=tuple(fine), displacement=tuple(place))
    count = int(rng.choice([600, 1000, 2000]))
    times = np.linspace(0, until, count)
    run = ss.simulate(rig, ss.Protocol(pieces=(piece,), until=until), times=times, rtol=1e-9, events=False)
    if run.status != "done" or np.max(run["v"]) > 300 * np.max(v):
        raise ValueError("a burst: a matter of inertia")
    shear, normal, moved = (np.asarray(run[name]) for name in ("shear_stress", "normal_stress", "load_displacement"))
    if what == "across":
        moved = moved - (shear - shear[0]) / rig.value("slider.stiffness")
    white = rng.random() < 0.5
    kinds = [rng.standard_normal(count) if white else noise_of(rng, count, 0.9) for _ in range(2)]
    sensor, size = np.exp(rng.uniform(np.log(2e-8), np.log(5e-7))), 10 ** rng.uniform(-4, -3.4)
    columns = {
        "time": times,
        "shear": shear + size * kinds[0] * normal,
        "normal": normal * (1 + 2e-4 * rng.standard_normal(count)),
        "displacement": moved + sensor * kinds[1],
    }
    return Drawn(kind, law, rig, ss.record_from_arrays(**columns, source=kind))


def drawn(kind: str, count: int, seed: int) -> Iterator[Drawn]:
    """So many records of a kind."""
    made, chances = 0, iter(np.random.default_rng([seed, KINDS.index(kind)]).spawn(20 * count))
    while made < count:
        try:
            yield case(next(chances), kind)
            made += 1
        except ValueError:
            continue


def outcome(one: Drawn) -> tuple[float, float, float, str]:
    """Fitted over true stiffness, its deviation in standard errors, CPU seconds, and what the text has of it."""
    begun = time.process_time()
    fit = ss.fit(ss.lab_rig(one.law), one.record)
    seconds = time.process_time() - begun
    text, true = " ".join(str(fit).split()), one.rig.value("slider.stiffness")
    named = "across" if "as across the fault" in text else "part" if "a part of the press" in text else ""
    place, found = fit.names.index("slider.stiffness"), fit.values["slider.stiffness"]
    z = fit_deviation(fit, place, true) if fit.estimates[place].determined else np.nan
    return found / true, z, seconds, named


def main(kinds: list[str], count: int, seed: int) -> None:
    for kind in kinds:
        found = []
        for i, one in enumerate(drawn(kind, count, seed)):
            try:
                own = outcome(one)
            except ss.NotAvailable as problem:
                print(f"{i:4d} refused: {problem}", flush=True)
                continue
            found.append(own)
            ratio, z, seconds, named = own
            print(f"{i:4d} {one.law:<6} k {ratio:7.3f} of its truth, z {z:7.2f}  {seconds:.2f} s  {named}", flush=True)
        every = np.array([own[1] for own in found])
        known = every[np.isfinite(every)]
        silent = [own for own in found if abs(own[1]) > 3 and not own[3]]
        print(f"{kind}: {len(found)} fits, across named in {sum(bool(own[3]) for own in found)};"
              f" k: rms z {np.sqrt(np.mean(known**2)):.2f}, 95 % cover"
              f" {np.mean(np.abs(known) < 1.96):.2f} of {len(known)}, off by over 3 errors in silence {len(silent)},"
              f" median {np.median([own[2] for own in found]):.2f} s")  # fmt: skip


if __name__ == "__main__":
    wanted = sys.argv[3:]
    main([kind for kind in KINDS if all(part in kind for part in wanted)], int(sys.argv[1]), int(sys.argv[2]))
