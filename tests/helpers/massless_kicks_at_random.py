"""Random kicks of bodies without mass on regularised laws, joined by dashpots, and what comes of them by SciPy.

Their velocities balance forces together at every moment. The equations are typed by hand: Newton's method for the
velocities inside the rates, Radau around it.

``python tests/helpers/massless_kicks_at_random.py COUNT SEED`` does many by hand.
"""

import sys

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss
from machine_kicks_at_random import Chain, outcome

DECAYS = 30.0  # decay times of steady sliding that the reference follows


def tied(seed):
    """Two or three bodies in a row, most of them without mass, springs and dashpots between all, kicked."""
    random = np.random.default_rng(seed)

    def size(low=-1.0, high=1.0):
        return float(10 ** random.uniform(low, high))

    count = int(random.integers(2, 4))
    names = [f"b{i}" for i in range(count)]
    heavy = random.random(count) < 0.25
    heavy[random.choice(count, 2, replace=False)] = False  # two at least have none
    evolution = ss.laws.Aging() if random.random() < 0.5 else ss.laws.Slip()
    links, contacts = {}, {}
    for i, name in enumerate(names):
        before = "drive" if i == 0 else names[i - 1]
        damping = 0.0 if i == 0 else size(-1.5, 0.5)
        links[f"l{i}"] = ss.machine.Spring(between=(before, name), stiffness=size(-0.5, 1.5), damping=damping)
        a = 0.05 * size(-0.5, 0.5)
        b = a * (1 + random.uniform(-0.5, 1.0))
        law = ss.laws.RateState(
            a=a, b=b, d_c=size(-0.5, 0.5), mu_ref=0.6, v_ref=1.0, evolution=evolution, regularised=True
        )
        contacts[f"c{i}"] = ss.machine.Surface(
            body=name, friction=law, contact=ss.laws.ConstantNormalStress(preload=size(-0.5, 0.5))
        )
    for i, name in enumerate(names):  # something holds each back, the more the faster it is: no jumps
        links[f"g{i}"] = ss.machine.Spring(between=("ground", name), damping=size(-2.0, -0.5))
    masses = [size(-1.5, 0.5) if own else 0.0 for own in heavy]
    machine = ss.Machine(
        bodies={name: ss.machine.SlidingBody(mass=mass) for name, mass in zip(names, masses, strict=True)}, links=links,
        contacts=contacts, drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip
    kick = str(random.choice(["velocity", "displacement", "force"]))
    at = str(random.choice(names)) if kick == "force" else None
    low, high = {"velocity": (0.05, 4.0), "force": (0.02, 1.0), "displacement": (0.2, 30.0)}[kick]
    return Chain(
        machine, kick, at, int(random.choice([-1, 1])), float(np.exp(random.uniform(np.log(low), np.log(high))))
    )


class Typed:
    """The equations of a chain: rates of places ahead of the load point, of velocities with mass, and of memories."""

    def __init__(self, machine):
        names = list(machine.bodies)
        n = self.n = len(names)
        self.mass = np.array([machine.bodies[name].mass for name in names])
        self.heavy = self.mass > 0
        self.stiff, self.damp, self.ground = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        for i in range(n):
            link, row = machine.links[f"l{i}"], np.zeros(n)
            row[i] = 1.0
            if i:
                row[i - 1] = -1.0
            self.stiff += link.stiffness * np.outer(row, row)
            self.damp += link.damping * np.outer(row, row)
            self.ground[i] = machine.links[f"g{i}"].damping
        laws = [machine.contacts[f"c{i}"].friction for i in range(n)]
        self.load = np.array([machine.contacts[f"c{i}"].contact.preload for i in range(n)])
        self.a, self.b, self.d_c, self.mu = (
            np.array([getattr(law, name) for law in laws]) for name in ("a", "b", "d_c", "mu_ref")
        )
        self.aging = type(laws[0].evolution) is ss.laws.Aging
        self.push, self.drive, self.near = np.zeros(n), 1.0, np.zeros(n)

    def rub(self, v, theta):
        return self.load * self.a * np.arcsinh(0.5 * v * np.exp((self.mu + self.b * theta) / self.a))

    def steady(self, v):
        tau = self.rub(np.full(self.n, v), np.full(self.n, -np.log(v)))
        return np.linalg.solve(self.stiff, -tau + self.push - self.ground * v)

    def velocities(self, q, known, theta):
        """All of them: those of light bodies balance forces, in u = asinh(v/V), friction = load a u."""
        light, v = ~self.heavy, known.copy()
        scale = 2.0 * np.exp(-(self.mu + self.b * theta) / self.a)[light]
        direct = (self.load * self.a)[light]
        matrix = (self.damp + np.diag(self.ground))[np.ix_(light, light)]
        u = self.near[light].copy()
        for _ in range(300):
            v[light] = scale * np.sinh(u)
            left = (-self.stiff @ q - self.damp @ v - self.ground * v + self.push)[light] - direct * u
            change = np.linalg.solve(matrix * (scale * np.cosh(u))[None, :] + np.diag(direct), left)
            change = np.clip(change, -1.0, 1.0)
            u += change
            if np.all(np.abs(change) < 1e-12 * (1 + np.abs(u))):
                break
        else:
            raise ArithmeticError("no velocities")
        self.near[light] = u
        v[light] = scale * np.sinh(u)
        return v

    def right(self, t, y):
        n, count = self.n, int(self.heavy.sum())
        q, theta = y[:n], y[n + count :]
        v = np.zeros(n)
        v[self.heavy] = y[n : n + count]
        v = self.velocities(q, v, theta)
        force = -self.stiff @ q - self.damp @ v - self.ground * v - self.rub(v, theta) + self.push
        speed = np.maximum(np.abs(v), 1e-30)
        change = np.exp(-theta) - speed if self.aging else -speed * (np.log(speed) + theta)
        return np.concatenate([v - self.drive, (force / np.where(self.heavy, self.mass, 1.0))[self.heavy],
                               change / self.d_c])  # fmt: skip


def by_radau(case):
    """Outcome of a kick: 'returns', 'oscillation', or '?' if the motion is not conclusive."""
    typed, kicked = Typed(case.machine), case.kicked()
    amount, n = float(kicked.amount(case.size)[0]), typed.n
    count = int(typed.heavy.sum())
    start = np.concatenate([typed.steady(1.0), np.ones(count), np.zeros(n)])
    if case.kick == "displacement":
        start[:n] -= amount
    if case.kick == "velocity":
        typed.drive = amount
    if case.kick == "force":
        typed.push[int(case.at[1:])] = amount
    new = typed.drive
    lead = ss.eigenvalues(case.machine.with_values({"drive.velocity": new}))[0].real
    until = DECAYS / abs(lead) + 60.0 * float(np.max(typed.d_c)) / new + 100.0
    if until > 3e3:
        return "?"
    try:
        done = solve_ivp(typed.right, (0.0, until), start, method="Radau", rtol=1e-8, atol=1e-10)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError):
        return "?"
    if not done.success:
        return "?"
    late = np.flatnonzero(done.t > 0.9 * until)
    speeds = np.array([typed.right(0.0, done.y[:, k])[:n] for k in late]) + new
    swing = float(np.max(np.ptp(speeds, axis=0))) / new
    back = float(np.max(np.abs(done.y[:n, -1] - typed.steady(new)) / typed.d_c))
    if swing < 1e-4 and back < 1e-2:
        return "returns"
    return "oscillation" if swing > 0.05 else "?"


def compared(seed):
    """Outcomes of a kick of a chain by the package and by SciPy."""
    case = tied(seed)
    kicked = case.kicked()
    assert len(kicked.rest.reduction.unknowns) >= 2
    if not kicked.exists[0]:
        return "no steady sliding", "?"
    return outcome(kicked, case.size), by_radau(case)


def main(count, seed):
    told = wrong = undecided = unsure = 0
    for i in range(seed, seed + count):
        found, truth = compared(i)
        told, undecided, unsure = told + (found == truth), undecided + (found == "undecided"), unsure + (truth == "?")
        if found not in (truth, "undecided") and truth != "?":
            wrong += 1
            print("TIED", i, found, truth, flush=True)
    print(f"{told} of {count} agree, {undecided} undecided, {unsure} not comparable, {wrong} wrong", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
