"""Random machines that ring: bodies in a row on springs with dampings down to 1e-4 of critical, some on surfaces.

``python tests/helpers/ringing_machines.py COUNT SEED`` seeks the thresholds of many by hand, each checked by long
simulations just below and just above.
"""

import sys
import time
from dataclasses import dataclass

import numpy as np

import steadyslip as ss

DECADES = 3  # below 0.1 of critical damping, to which the mode that rings longest belongs in turn
BESIDE = 0.03  # distance from a threshold, as a share of it, at which simulations check it
STEADY = 1e-3  # swing of velocities, as a share of the drive's, below which sliding is steady; not so above `GOES_ON`
GOES_ON = 0.1
SOUGHT = {
    "precision": 1e-3,
    "rtol": 1e-6,
}  # of thresholds: motions that ring take a third of the steps of the usual 1e-8
TURNS = 300.0  # of the leading mode in one part of a simulation,
PARTS = 8  # times at most that it is made twice as long
SAMPLES = 500  # in a tenth of it


@dataclass(frozen=True)
class Ringing:
    """A machine, how long it rings, and a kick of it."""

    machine: ss.Machine
    damping: float
    kick: str
    at: str | None
    direction: int

    def amount(self, found, share):
        """Kick in SI units that is a share of a threshold's size, of a velocity of the logarithm's."""
        return found.amount**share if self.kick == "velocity" else found.amount * share

    def threshold(self, **more):
        return ss.threshold(self.machine, self.kick, at=self.at, direction=self.direction, **SOUGHT, **more)


def drawn(seed):
    """Two or three bodies of which one or more slide; steady sliding is stable, at velocity 1."""
    random, decade = np.random.default_rng([36, seed]), seed % DECADES

    def size(low, high):
        return float(10 ** random.uniform(low, high))

    while True:
        count = int(random.integers(2, 4))
        names = [f"b{i}" for i in range(count)]
        slides = [bool(random.random() < 0.3) for _ in names[:-1]] + [True]
        if count == 3 and random.random() < 0.3:
            slides = [False, True, False]  # the last one rings alone
        evolution = ss.laws.Aging() if random.random() < 0.5 else ss.laws.Slip()
        contacts = {}
        for name, rubs in zip(names, slides, strict=True):
            a = 0.01 * size(-0.3, 0.3)
            law = ss.laws.RateState(
                a=a, b=a * (1 + random.uniform(0.1, 1.2)), d_c=1.0, mu_ref=0.6, v_ref=1.0, evolution=evolution,
                regularised=True,
            )  # fmt: skip
            if rubs:
                contacts[f"{name}-bed"] = ss.machine.Surface(
                    body=name, friction=law, contact=ss.laws.ConstantNormalStress(preload=1.0)
                )
        masses = [0.01 * size(-1.5, 0.5) for _ in names]
        springs = [0.01 * size(-0.7, 0.7), *(0.01 * size(0.5, 2.5) for _ in names[1:])]
        dampings = [0.01 * size(-2.0, 0.0)]
        for i in range(1, count):
            together = masses[i - 1] * masses[i] / (masses[i - 1] + masses[i])
            dampings.append(2 * size(-2.3 - decade, -0.5 - decade) * float(np.sqrt(springs[i] * together)))
        links = {
            f"l{i}": ss.machine.Spring(
                between=("drive" if i == 0 else names[i - 1], name), stiffness=springs[i], damping=dampings[i]
            )
            for i, name in enumerate(names)
        }
        bodies = {name: ss.machine.SlidingBody(mass=mass) for name, mass in zip(names, masses, strict=True)}
        machine = ss.Machine(
            bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=1.0)
        )  # fmt: skip
        kick = str(random.choice(["velocity", "impulse", "force"]))
        at = None if kick == "velocity" else str(random.choice(names))
        direction = int(random.choice([-1, 1, 1]))
        near, share = random.random() < 0.5, size(-1.5, -0.3)
        damping = least_damping(machine)
        if not 0.1 ** (decade + 2) <= damping <= 0.1 ** (decade + 1):
            continue
        if near:  # softer, to where it is almost unstable
            edges = [one.value for one in ss.boundary(machine, "links.l0.stiffness") if one.value < springs[0]]
            softer = machine.with_values({"links.l0.stiffness": max(edges, default=springs[0]) * (1 + share)})
            damping = least_damping(softer)
            if not damping > 0.1 ** (decade + 2):
                continue
            machine = softer
        return Ringing(machine, damping, kick, at, direction)


def least_damping(machine):
    """Share of critical damping of the mode that rings longest; 0 where steady sliding is unstable."""
    roots = np.asarray(ss.eigenvalues(machine))
    turning = roots[roots.imag > 0]
    return float(np.min(-turning.real / np.abs(turning), initial=1.0)) if np.all(roots.real < 0) else 0.0


def simulated(case, amount):
    """What a long simulation shows after a kick of `amount` (SI): 'returns', 'persists', or '?'."""
    machine, roots = case.machine, np.asarray(ss.eigenvalues(case.machine))
    slow = np.max(roots.real)
    part = TURNS * 2 * np.pi / np.max(np.abs(roots[roots.real == slow]))
    after = machine.with_values({"drive.velocity": amount}) if case.kick == "velocity" else machine
    protocol, initial = None, {}
    if case.kick == "velocity":
        protocol = ss.protocol.VelocityStep(at=0.0, to=amount)
    elif case.kick == "force":
        protocol = ss.protocol.DisturbanceStep(at=0.0, by=amount, on=case.at)
    else:
        initial = {f"{case.at}.v": 1.0 + amount / machine.bodies[case.at].mass}
    fast = after.drive.velocity
    until = part / min(fast, 1.0) + 50.0 / fast
    for _ in range(PARTS):
        times = until * np.concatenate([np.linspace(0.45, 0.55, SAMPLES), np.linspace(0.9, 1.0, SAMPLES)])
        run = ss.simulate(machine, protocol, until=until, initial=initial, times=times, rtol=1e-8)
        if run.status != "done":
            return "persists" if run.status in ("blow-up", "contact lost") else "?"
        speeds = np.stack([run[f"{name}.v"] for name in machine.bodies]) / fast
        swings = [float(np.max(np.ptp(part, axis=1))) for part in np.split(speeds, [SAMPLES], axis=1)]
        if swings[1] < STEADY or (swings[1] < GOES_ON and swings[1] < 0.5 * swings[0]):
            return "returns"
        if swings[1] > GOES_ON and swings[1] > 0.9 * swings[0] and until * np.abs(slow) > 10.0:
            return "persists"
        until *= 2.0
    return "?"


def judged(case, found):
    """'right', 'wrong', 'undecided' or 'unclear' for a threshold, by simulations beside it."""
    if found.size == np.inf:
        said = [simulated(case, found.survived), "persists"]
    elif not found.decided:
        return "undecided"
    else:
        said = [simulated(case, float(case.amount(found, 1 + way * BESIDE))) for way in (-1, 1)]
    if said[0] == "persists" or said[1] == "returns":
        return "wrong"
    return "unclear" if "?" in said else "right"


def main(count, seed):
    words, spent = {}, []
    for i in range(seed, seed + count):
        case = drawn(i)
        begun = time.process_time()
        found = case.threshold()
        spent.append(time.process_time() - begun)
        word = judged(case, found)
        words[word] = words.get(word, 0) + 1
        own = time.process_time() - begun - spent[-1]
        print(f"{i} {word} {spent[-1]:.1f} s (checked in {own:.1f} s): damping {case.damping:.1e}, {found}", flush=True)
    print(words, f"CPU median {np.median(spent):.1f} s, largest {max(spent):.1f} s", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
