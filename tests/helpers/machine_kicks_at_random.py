"""Random kicks of random machines, and what comes of them by another route.

`as_machine` makes the machine of one body that a slider is. `chained` draws machines of two or three bodies, each
kicked, and `by_radau` says what comes of that: equations typed by hand, SciPy's Radau, and a look at the end.

``python tests/helpers/machine_kicks_at_random.py COUNT SEED`` does many by hand.
"""

import sys
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.spans import OUTCOMES

OF_MACHINE = {"velocity": ("velocity", None), "displacement": ("displacement", None),
              "normal-stress": ("normal-force", "base"), "impulse": ("impulse", "block")}  # fmt: skip
DECAYS = 30.0  # decay times of steady sliding that the reference follows
TINY = 1e-30  # velocity below which a contact of the reference is at rest


def as_machine(block):
    """The machine of one body that a slider without area is."""
    links = {"spring": ss.machine.Spring(between=("drive", "block"), stiffness=block.stiffness, damping=block.damping)}
    if block.radiation_damping:
        links["waves"] = ss.machine.Spring(between=("ground", "block"), damping=block.radiation_damping)
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=block.mass)}, links=links,
        contacts={"base": ss.machine.Surface(body="block", friction=block.friction, contact=block.contact)},
        drive=ss.machine.Pull(velocity=block.drive.velocity),
    )  # fmt: skip


def outcome(kicked, size):
    return OUTCOMES[int(kicked.outcomes(np.zeros(1, dtype=int), np.array([size]))[0])]


def of_one_body(case):
    """Outcomes of a random kick (`kicks_at_random`) of a slider and of the equivalent machine."""
    kick, at = OF_MACHINE[case.kick]
    machine = Kicked(as_machine(case.rig), kick, case.direction, case.reference, {}, 0, None, at)
    return outcome(case.kicked(), case.size), outcome(machine, case.size)


@dataclass(frozen=True)
class Chain:
    """Bodies in a row behind a load point, each on a surface of its own, and a kick of it."""

    machine: ss.Machine
    kick: str
    at: str | None
    direction: int
    size: float

    def kicked(self):
        return Kicked(self.machine, self.kick, self.direction, "before", {}, 0, 1e-8, self.at)


def chained(seed):
    """Two or three bodies with mass; slip law or aging, as falls with velocity or not; dashpots beside all springs."""
    random = np.random.default_rng(seed)

    def size(low=-1.0, high=1.0):
        return float(10 ** random.uniform(low, high))

    count = int(random.integers(2, 4))
    names = [f"b{i}" for i in range(count)]
    aging = bool(random.random() < 0.5)
    evolution = ss.laws.Aging() if aging else ss.laws.Slip()
    links, contacts = {}, {}
    for i, name in enumerate(names):
        before = "drive" if i == 0 else names[i - 1]
        links[f"l{i}"] = ss.machine.Spring(between=(before, name), stiffness=size(-0.5, 1.5), damping=size(-2.0, 0.0))
        a = 0.05 * size(-0.5, 0.5)
        b = a * (1 + random.uniform(-0.5, 1.0))
        law = ss.laws.RateState(
            a=a, b=b, d_c=size(-0.5, 0.5), mu_ref=0.6, v_ref=1.0, evolution=evolution, regularised=True
        )
        contacts[f"c{i}"] = ss.machine.Surface(
            body=name, friction=law, contact=ss.laws.ConstantNormalStress(preload=size(-0.5, 0.5))
        )
    machine = ss.Machine(
        bodies={name: ss.machine.SlidingBody(mass=size(-1.5, 0.5)) for name in names}, links=links, contacts=contacts,
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip
    kick = str(random.choice(["velocity", "force", "impulse"]))
    at = None if kick == "velocity" else str(random.choice(names))
    direction = int(random.choice([-1, 1]))
    low, high = {"velocity": (0.02, 3.0), "force": (0.01, 1.0), "impulse": (0.05, 0.9 if direction < 0 else 30.0)}[kick]
    return Chain(machine, kick, at, direction, float(np.exp(random.uniform(np.log(low), np.log(high)))))


def by_radau(case):
    """Outcome of a kick: 'returns', 'oscillation', or '?' if the motion is not conclusive."""
    machine, kicked = case.machine, case.kicked()
    amount, names = float(kicked.amount(case.size)[0]), list(machine.bodies)
    n = len(names)
    mass = np.array([machine.bodies[name].mass for name in names])
    stiff, damp, pull = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, 2))
    for i in range(n):
        link, row = machine.links[f"l{i}"], np.zeros(n)
        row[i] = 1.0
        if i:
            row[i - 1] = -1.0
        else:
            pull[0] = link.stiffness, link.damping
        stiff, damp = stiff + link.stiffness * np.outer(row, row), damp + link.damping * np.outer(row, row)
    laws = [machine.contacts[f"c{i}"].friction for i in range(n)]
    load = np.array([machine.contacts[f"c{i}"].contact.preload for i in range(n)])
    a, b, d_c, mu = (np.array([getattr(law, name) for law in laws]) for name in ("a", "b", "d_c", "mu_ref"))
    aging = type(laws[0].evolution) is ss.laws.Aging
    new = amount if case.kick == "velocity" else 1.0
    push = np.zeros(n)
    if case.kick == "force":
        push[names.index(case.at)] = amount

    def steady(v):
        tau = load * a * np.arcsinh(0.5 * v * np.exp((mu - b * np.log(v)) / a))
        force = -tau + push + np.eye(n)[0] * pull[0, 1] * v - damp @ np.full(n, v)
        return np.linalg.solve(stiff, force)  # places ahead of the load point

    def right(t, y):
        q, v, theta = y[:n], y[n : 2 * n], y[2 * n :]
        tau = load * a * np.arcsinh(0.5 * v * np.exp((mu + b * theta) / a))
        force = -stiff @ q - damp @ v - tau + push
        force[0] += pull[0, 1] * new
        speed = np.maximum(np.abs(v), TINY)
        change = np.exp(-theta) - speed if aging else -speed * (np.log(speed) + theta)
        return np.concatenate([v - new, force / mass, change / d_c])

    push, own = np.zeros(n), push
    start = np.concatenate([steady(1.0), np.ones(n), np.zeros(n)])
    push[:] = own
    if case.kick == "impulse":
        start[n + names.index(case.at)] += amount / mass[names.index(case.at)]
    after = case.machine.with_values({"drive.velocity": new})
    lead = ss.eigenvalues(after)[0].real  # constant forces move the springs only
    until = DECAYS / abs(lead) + 60.0 * float(np.max(d_c)) / new + 100.0
    if until > 4e4:
        return "?"
    done = solve_ivp(right, (0.0, until), start, method="Radau", rtol=1e-8, atol=1e-10)
    if not done.success:
        return "?"
    late = done.y[n : 2 * n, done.t > 0.9 * until]
    swing = float(np.max(np.ptp(late, axis=1))) / new
    back = float(np.max(np.abs(done.y[:n, -1] - steady(new)) / d_c))
    if swing < 1e-4 and back < 1e-2:
        return "returns"
    return "oscillation" if swing > 0.05 else "?"


def compared(seed):
    """Outcomes of a kick of a chain by the package and by SciPy."""
    case = chained(seed)
    kicked = case.kicked()
    if not kicked.exists[0]:
        return "no steady sliding", "?"
    return outcome(kicked, case.size), by_radau(case)


def main(count, seed):
    from kicks_at_random import drawn

    told = wrong = undecided = 0
    for i in range(seed, seed + count):
        found, truth = compared(i)
        told += found == truth
        undecided += found == "undecided"
        if found not in (truth, "undecided") and truth != "?":
            wrong += 1
            print("CHAIN", i, found, truth, flush=True)
    print(f"chains: {told} of {count} agree, {undecided} undecided, {wrong} wrong", flush=True)
    random, same = np.random.default_rng(seed), 0
    for i in range(count):
        case = drawn(random)
        try:
            own, machine = of_one_body(case)
        except ss.SteadyslipError as error:
            print("BLOCK", i, case, str(error)[:300], flush=True)
            continue
        same += own == machine
        if own != machine:
            print("BLOCK", i, own, machine, case, flush=True)
    print(f"blocks: {same} of {count} the same", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
