"""Chains of up to three bodies that are driven, let go, pushed and driven again: SciPy Radau typed by hand."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steadyslip as ss
from machines import rate_state, surface

TIMES = np.linspace(0.0, 20.0, 41)
MU = 0.6


class Chain:
    """A chain on a drive, of which one body rubs. The state is load point, places, speeds, Θ, force held."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.law = rate_state(
            10 ** random.uniform(-1, 0), 10 ** random.uniform(-2, -0.5), 10 ** random.uniform(-0.5, 0.5)
        )
        self.n = n = int(random.integers(1, 4))
        self.masses, self.k, self.c = (10 ** random.uniform(*span, n) for span in ((-1, 1), (0, 1.5), (-1.5, 0)))
        self.rub, self.pushed = (int(i) for i in random.integers(0, n, 2))
        self.edges = [0.0, *np.sort(random.uniform(1, 18, 4)), 20.0]
        first, last = random.uniform(0.5, 1.5, 2)
        self.speeds = [1.0, first, first, first, last]
        self.told = random.uniform(0.55, 0.65) if random.random() < 0.4 else None
        self.by, self.push = random.uniform(-0.03, 0.03), random.uniform(-0.05, 0.02)

    def machine(self):
        names = [f"b{i}" for i in range(self.n)]
        ends = pairwise(["drive", *names])
        links = {
            f"l{i}": ss.machine.Spring(between=two, stiffness=self.k[i], damping=self.c[i])
            for i, two in enumerate(ends)
        }
        return ss.Machine(
            bodies={name: ss.machine.SlidingBody(mass=mass) for name, mass in zip(names, self.masses, strict=True)},
            links=links, contacts={"rock": surface(names[self.rub], self.law)}, drive=ss.machine.Pull(velocity=1.0),
        )  # fmt: skip

    def plan(self):
        _, step, free, more, again, _ = self.edges
        return [
            ss.protocol.VelocityStep(at=step, to=self.speeds[1]),
            ss.protocol.Creep(at=free, duration=again - free, to=self.told),
            ss.protocol.CreepStep(at=more, by=self.by), ss.protocol.DisturbanceStep(at=more, by=self.push,
            on=f"b{self.pushed}"),
            ss.protocol.VelocityStep(at=again, to=self.speeds[4]),
        ]  # fmt: skip

    def pull(self, y, speed):
        return MU + self.k[0] * (y[0] - y[1]) + self.c[0] * (speed - y[1 + self.n])

    def right(self, span, y):
        n, force = self.n, np.zeros(self.n + 1)
        u, v, theta = y[1 : 1 + n], y[1 + n : 1 + 2 * n], y[1 + 2 * n]
        force[0] = y[-1] if span in (2, 3) else self.pull(y, self.speeds[span])
        for i in range(1, n):  # links behind the body that rubs carry nothing in steady sliding
            force[i] = MU * (i <= self.rub) + self.k[i] * (u[i - 1] - u[i]) + self.c[i] * (v[i - 1] - v[i])
        total = force[:-1] - force[1:]
        total[self.rub] -= MU + self.law.a * np.log(v[self.rub]) + self.law.b * theta
        total[self.pushed] += self.push * (span >= 3)
        change = -v[self.rub] / self.law.d_c * (np.log(v[self.rub]) + theta)
        return np.concatenate([[self.speeds[span]], v, total / self.masses, [change, 0.0]])

    def solved(self):
        n, found = self.n, []
        y = np.concatenate([np.zeros(1 + n), np.ones(n), [0.0, 0.0]])
        for span, (begin, end) in enumerate(pairwise(self.edges)):
            if span == 2:
                y[-1] = self.pull(y, self.speeds[1]) if self.told is None else self.told
            if span == 3:
                y[-1] += self.by
            if span == 4:
                y[0] = y[1] + (y[-1] - MU - self.c[0] * (self.speeds[4] - y[1 + n])) / self.k[0]
            done = solve_ivp(lambda _, y, s=span: self.right(s, y), (begin, end), y, "Radau", dense_output=True,
                             rtol=1e-9, atol=1e-11)  # fmt: skip
            inside = TIMES[(begin <= TIMES) & ((end > TIMES) | (span == 4))]
            found.append(done.sol(inside) if len(inside) else np.empty((len(y), 0)))
            y = done.y[:, -1].copy()
        return np.concatenate(found, axis=1)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(8))
def test_random_chains_are_let_go_and_taken_up_as_typed_by_hand(seed):
    chain = Chain(seed)
    run = ss.simulate(chain.machine(), chain.plan(), until=20.0, times=TIMES, rtol=1e-9)
    expected = chain.solved()
    for i in range(chain.n):
        assert run[f"b{i}.v"] == pytest.approx(expected[1 + chain.n + i], rel=1e-5, abs=1e-6)
