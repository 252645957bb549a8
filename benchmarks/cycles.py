"""Are the cycles that `steadyslip.cycles` finds those that a rig comes to?

    python benchmarks/cycles.py [--rigs N] [--seed S] [--aging] [--truths FILE] [--only I,J,...]

Branches of random rigs (every evolution law, two states, LuGre; radiation damping or mass; constant or inclined) are
followed, and at several stiffnesses beyond the edge the stable cycle there is compared with a long simulation that
starts elsewhere. `--aging` takes the 32 rigs of the aging law at constant normal stress, λ = .25...2, H = 1e-2...1e-8
instead. A truth is kept in FILE, if one is named, and not simulated again. The last lines are a table: right, wrong
(another period), broke off (no stable cycle on the branch), undecided (the simulation shows none, or none that repeats
itself), and CPU seconds for a branch, kernels compiled before.
"""

from __future__ import annotations

import argparse
import json
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from quick import parsed

import steadyslip as ss

SHARES = (0.99, 0.8, 0.5)  # of the edge
SAME = 1e-6
MOST_DOUBLINGS = 5  # that are followed where the first does not tell
LAWS = ("aging", "slip", "prz", "nagata", "two states", "lugre")


def random_rig(index: int, seed: int) -> tuple[str, ss.Slider]:
    """A rig with an oscillatory edge along the stiffness, and what it is."""
    rng = np.random.default_rng([seed, index])
    kinds = [(law, m, c) for law in LAWS for m in ("damping", "mass") for c in ("constant", "inclined")]
    law, inertia, contact = kinds[index % len(kinds)]
    while True:
        rig = (lugre if law == "lugre" else rate_state)(rng, law, inertia, contact)
        with suppress(ss.NotAvailable):
            ss.hopf(rig)
            return f"{law}, {inertia}, {contact}", rig


def lugre(rng: np.random.Generator, law: str, inertia: str, contact: str) -> ss.Slider:
    """Bristles of every damping, at speeds around that of Stribeck."""
    sigma, static, v_stribeck = 10 ** rng.uniform(6, 7.5), rng.uniform(0.15, 0.5), 10 ** rng.uniform(-3.5, -2.5)
    friction = ss.laws.LuGre(
        mu_coulomb=static * rng.uniform(0.5, 0.9), mu_static=static, v_stribeck=v_stribeck,
        bristle_stiffness=10 ** rng.uniform(4, 5.5), bristle_damping=10 ** rng.uniform(0.5, 2),
        viscous=10 ** rng.uniform(-1, 1),
    )  # fmt: skip
    v0 = v_stribeck * 10 ** rng.uniform(-0.5, 0.3)
    still = {"mass": 10 ** rng.uniform(2.5, 4)}
    if inertia == "damping":
        still = {"radiation_damping": 10 ** rng.uniform(-6, -3) * sigma / v0}
    return ss.Slider(
        friction=friction,
        contact=pressed(rng, sigma, contact),
        stiffness=1e10,
        drive=ss.machine.SteadyDrive(v0),
        **still,
    )


def pressed(rng: np.random.Generator, sigma: float, contact: str) -> object:
    """A contact of either kind."""
    if contact == "inclined":
        return ss.laws.InclinedSpring(preload=sigma, angle=rng.uniform(-0.6, 0.6))
    return ss.laws.ConstantNormalStress(preload=sigma)


def rate_state(rng: np.random.Generator, law: str, inertia: str, contact: str) -> ss.Slider:
    """Rate-and-state friction."""
    sigma, v0 = 10 ** rng.uniform(6, 7.5), 10 ** rng.uniform(-7, -5)
    a, lam, d_c = rng.uniform(0.005, 0.02), rng.uniform(0.1, 2.0), 10 ** rng.uniform(-6, -4.5)
    b = a * (1 + lam)
    more: dict[str, object] = {"b": b, "d_c": d_c}
    if law == "two states":
        share = rng.uniform(0.3, 0.7)
        states = (
            ss.laws.State(b=b * share, d_c=d_c),
            ss.laws.State(b=b * (1 - share), d_c=d_c * 10 ** rng.uniform(0.3, 1.3)),
        )
        more = {"states": states}
    evolution = {"aging": ss.laws.Aging(), "slip": ss.laws.Slip(), "prz": ss.laws.PRZ(), "two states": ss.laws.Slip(),
                 "nagata": ss.laws.Nagata(c_nagata=rng.uniform(0.1, 1.0))}[law]  # fmt: skip
    memory = ss.laws.LinkerDieterich(alpha=rng.uniform(0.1, 0.5)) if contact == "inclined" else ss.laws.NoMemory()
    friction = ss.laws.RateState(a=a, mu_ref=0.6, v_ref=v0, evolution=evolution, normal_memory=memory, **more)
    press = pressed(rng, sigma, contact)
    size = 10 ** rng.uniform(-6, -1)
    still = (
        {"radiation_damping": size * a * sigma / v0}
        if inertia == "damping"
        else {"mass": size * a * sigma * d_c / v0**2}
    )
    stiffness = 0.8 * b * lam / (1 + lam) * sigma / d_c
    return ss.Slider(friction=friction, contact=press, stiffness=stiffness, drive=ss.machine.SteadyDrive(v0), **still)


def aging_rig(index: int) -> tuple[str, ss.Slider]:
    """λ and H of the aging law at constant normal stress."""
    lam = 0.25 * (1 + index % 8)
    damping = 10.0 ** (-2 * (1 + index // 8))
    friction = ss.laws.RateState(
        a=0.01, b=0.01 * (1 + lam), d_c=1e-5, mu_ref=0.6, v_ref=1e-6, evolution=ss.laws.Aging()
    )
    rig = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=1e7),
        stiffness=lam * 1e5 / 1e-5 * 0.9,
                    radiation_damping=damping * 1e5 / 1e-6, drive=ss.machine.SteadyDrive(1e-6))  # fmt: skip
    return f"aging, λ = {lam:g}, H = {damping:.0e}", rig


def simulated_period(rig: ss.Slider, natural: float) -> float | str:
    """The period after which peaks and the times between them repeat themselves to 1e-7, or what happens instead."""
    until, friction = 300 * natural, rig.friction
    start = {"x": -2.0 * (friction.d_c or friction.states[0].d_c) if isinstance(friction, ss.laws.RateState) else 1e-6}
    begun = time.process_time()
    while time.process_time() - begun < 3.0:
        run = ss.simulate(rig, until=until, initial=start, rtol=1e-9)
        if run.status != "done":
            return run.status
        peaks = [(e.time, e.velocity) for e in run.events if e.kind == "velocity peak"]
        when, size = np.array(peaks).reshape(-1, 2).T
        for m in range(1, 33):
            if len(when) < 4 * m + 1:
                break
            gaps, heights = np.diff(when)[-3 * m :].reshape(3, m), np.log(size[-3 * m :]).reshape(3, m)
            if np.ptp(gaps, axis=0).max() < 1e-7 * gaps.sum(axis=1).min() and np.ptp(heights, axis=0).max() < 1e-6:
                if np.log(size[-1] / rig.drive.velocity) < 1e-3:
                    return "settles"
                return float(gaps.sum(axis=1)[-1]) / times_round(gaps[-1])
        until *= 3.0
    return "undecided"


def times_round(gaps: np.ndarray) -> int:
    """How often a shorter cycle is run through, where motion comes to it from both sides in turn."""
    for k in range(len(gaps), 1, -1):
        if len(gaps) % k == 0 and np.ptp(gaps.reshape(k, -1), axis=0).max() < 1e-4 * gaps.min():
            return k
    return 1


def judged(branch: ss.nonlinear.CycleBranch | None, value: float, truth: float | str) -> tuple[str, float]:
    """What a branch says at a value, against the truth; and the relative error of the period."""
    if not isinstance(truth, float):
        return "undecided", np.nan
    levels, found = branch, []
    while levels is not None:
        found += [cycle for cycle in levels.at(value) if cycle.stable]
        levels = levels.doubled
    if not found:
        return "broke off", np.nan
    error = min(abs(cycle.period / truth - 1) for cycle in found)
    return "right" if error < SAME else "wrong", error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--aging", action="store_true")
    parser.add_argument("--truths", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--simulate", action="store_true", help="simulate only")
    asked = parsed(parser, only="3")
    truths = json.loads(asked.truths.read_text()) if asked.truths and asked.truths.exists() else {}
    which = [int(i) for i in asked.only.split(",")] if asked.only else range(32 if asked.aging else asked.rigs)
    count = dict.fromkeys(("right", "wrong", "broke off", "undecided"), 0)
    cost = []
    for index in which:
        name, rig = aging_rig(index) if asked.aging else random_rig(index, asked.seed)
        onset = ss.hopf(rig)
        shares = SHARES if onset.stable == "above" else tuple(1 / share for share in SHARES)
        key = f"{'aging' if asked.aging else asked.seed} {index}"
        if key not in truths:
            values = [share * onset.value for share in shares]
            truths[key] = [
                simulated_period(rig.with_values({onset.along: v}), 2 * np.pi / onset.angular_frequency) for v in values
            ]
            if asked.truths:
                asked.truths.write_text(json.dumps(truths))
        if asked.simulate:
            print(key, name, truths[key], flush=True)
            continue
        low, high = sorted((0.5 * onset.value, 1.2 * onset.value) if onset.stable == "above" else
                           (0.8 * onset.value, 2.0 * onset.value))  # fmt: skip
        begun = time.process_time()
        branch = ss.cycles(rig, between=(low * (1 - 1e-9), high * (1 + 1e-9)))
        cost.append(time.process_time() - begun)
        if branch.doubled and any(judged(branch, s * onset.value, t)[0] == "broke off"
                                  for s, t in zip(shares, truths[key], strict=True)):  # fmt: skip
            branch = ss.cycles(rig, between=(low * (1 - 1e-9), high * (1 + 1e-9)), doublings=MOST_DOUBLINGS)
        words = []
        for share, truth in zip(shares, truths[key], strict=True):
            word, error = judged(branch, share * onset.value, truth)
            count[word] += 1
            words.append(f"{share:.3g}: {word}" + (f" {error:.0e}" if error > 0 else ""))
        print(f"{index:3d} {name}: {onset.kind}; {len(branch)} cycles, {cost[-1]:.2f} s; {'; '.join(words)}; "
              f"ends: {branch.end}", flush=True)  # fmt: skip
    if cost:
        print("   ".join(f"{word} {number}" for word, number in count.items()))
        print(f"CPU a branch: median {np.median(cost):.2f} s, largest {max(cost):.2f} s")


if __name__ == "__main__":
    main()
