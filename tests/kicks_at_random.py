"""Random kicks of random rigs, and what comes of them by SciPy and equations typed by hand.

The reference integrates x, ln v and ln θ by LSODA (massless) or Radau (with mass) and looks at the last tenth of the
motion; it shares no equation with the package.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import LSODA, Radau

import steadyslip as ss
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.outcomes import OUTCOMES

D_C, V_REF, MU = 1e-6, 1e-6, 0.6
KINDS = ("slip-tilted", "aging", "slip-mass", "aging-mass", "aging-damped", "prz-mass")
FACTORS = (0.5, 0.9, 1.03, 1.1, 1.3, 2.0)


@dataclass(frozen=True)
class Drawn:
    """A rig and one kick of it."""

    kind: str
    rig: ss.Slider
    factor: float
    kick: str
    direction: int
    size: float

    def __str__(self) -> str:
        friction, contact = self.rig.friction, self.rig.contact
        return (
            f"{self.kind} a={friction.a:.5g} b={friction.b:.5g} k/k_cr={self.factor} k={self.rig.stiffness!r} "
            f"m={self.rig.mass:.4g} eta={self.rig.radiation_damping:.4g} psi={getattr(contact, 'angle', 0):.4g} "
            f"{self.kick} {self.direction:+d} size {self.size!r}"
        )


def drawn(random: np.random.Generator, only: tuple[str, ...]) -> Drawn:
    """A random kick of a random rig."""
    kind = str(random.choice(only))
    law = {"slip": ss.Slip(), "aging": ss.Aging(), "prz": ss.PRZ()}[kind.split("-")[0]]
    a = 0.01 * random.uniform(0.7, 1.5)
    b = a * (1 + random.uniform(0.1, 1.0))
    tilted = "tilted" in kind
    memory = ss.LinkerDieterich(alpha=random.uniform(0.1, 0.56)) if tilted else None
    rock = ss.RateState(a=a, b=b, d_c=D_C, mu_ref=MU, v_ref=V_REF, evolution=law,
                        **({"normal_memory": memory} if tilted else {}))  # fmt: skip
    contact = ss.InclinedSpring(preload=5e6, angle=random.uniform(-0.6, 0.6)) if tilted else ss.Constant(preload=5e6)
    more = {}
    if "mass" in kind:  # m v0²/(a σ d_c)
        more["mass"] = 10 ** random.uniform(-6, 0) * a * 5e6 * D_C / V_REF**2
    if "damped" in kind:
        more["radiation_damping"] = 10 ** random.uniform(-6, -2) * a * 5e6 / V_REF
    base = ss.Slider(friction=rock, contact=contact, stiffness=5e9, drive=ss.Steady(V_REF), **more)
    factor = float(random.choice(FACTORS))
    rig = base.with_values({"stiffness": factor * ss.critical_stiffness(base)})
    kicks = ["velocity", "displacement", "normal-stress"] + (["impulse"] if "mass" in kind else [])
    kick, direction = str(random.choice(kicks)), int(random.choice([-1, 1]))
    low, high = {"velocity": (0.02, 5), "displacement": (0.1, 60), "normal-stress": (0.003, 0.9),
                 "impulse": (0.05, 100 if direction > 0 else 0.95)}[kick]  # fmt: skip
    return Drawn(kind, rig, factor, kick, direction, float(np.exp(random.uniform(np.log(low), np.log(high)))))


class Reference:
    """One kicked motion in units of d_c, v0 and aσ, typed by hand."""

    def __init__(self, case: Drawn) -> None:
        rig, friction = case.rig, case.rig.friction
        self.law = case.kind.split("-")[0]
        self.a, self.b = friction.a, friction.b
        self.k = rig.stiffness * D_C
        self.tan = np.tan(getattr(rig.contact, "angle", 0.0))
        self.alpha = getattr(friction.normal_memory, "alpha", 0.0) or 0.0
        self.m, self.eta = rig.mass * V_REF**2 / D_C, rig.radiation_damping * V_REF
        self.sigma0 = rig.contact.preload
        own = (self.sigma0 - self.eta * self.tan) / (1 + MU * self.tan)
        self.spring, self.pressure, self.load = MU * own + self.eta, 0.0, 1.0
        self.x, self.w, self.u = 0.0, 0.0, 0.0  # slip ahead of the load point, ln v, ln θ
        size = case.size * case.direction
        if case.kick == "velocity":
            self.load = np.exp(size)
        elif case.kick == "displacement":
            self.x = -size * natural_length(case)
        elif case.kick == "impulse":
            self.w = np.log1p(size)
        else:
            self.pressure = size * own
        self.u -= self.alpha / self.b * np.log(self.stresses(self.x)[1] / own)  # what a jump of stress does to memory
        self.period = 2 * np.pi / np.abs(ss.analyze(case.rig).eigenvalues[0]) * V_REF / D_C

    def stresses(self, x):
        spring = self.spring - self.k * x
        return spring, self.sigma0 - spring * self.tan + self.pressure

    def velocity(self, x, u):
        """ln v that balances forces without mass."""
        spring, sigma = self.stresses(x)
        target = spring / sigma - MU - self.b * u
        w = min(target / self.a, 600.0)
        if self.eta:
            w = min(w, np.log(max(spring, 1e-300) / self.eta))
            for _ in range(200):
                value = self.a * w + self.eta / sigma * np.exp(w) - target
                change = value / (self.a + self.eta / sigma * np.exp(w))
                w -= change
                if abs(change) < 1e-13 * (1 + abs(w)):
                    break
        return w

    def rates(self, t, y):
        x, u = y[0], y[-1]
        w = y[1] if self.m else self.velocity(x, u)
        v = np.exp(min(w, 600.0))
        spring, sigma = self.stresses(x)
        omega = w + u
        if self.law == "slip":
            change = -v * omega
        elif self.law == "aging":
            change = np.exp(-u) - v
        else:
            change = 0.5 * (np.exp(-u) - v * np.exp(omega))
        change -= self.alpha / self.b * self.k * self.tan * (v - self.load) / sigma
        if not self.m:
            return [v - self.load, change]
        friction = (MU + self.a * w + self.b * u) * sigma
        return [v - self.load, (spring - self.eta * v - friction) / (self.m * v), change]

    def outcome(self, turns=150, most_steps=60_000):
        """returns, blow-up, contact lost, oscillation; or ? where it cannot be told."""

        y = [self.x, self.u] if not self.m else [self.x, self.w, self.u]
        end = turns * self.period / min(self.load, 1.0) + 3 * abs(self.x) / self.load
        solver = (Radau if self.m else LSODA)(self.rates, 0.0, y, end, rtol=1e-8, atol=1e-10)
        times, sizes = [], []
        while True:
            x, speed = solver.y[0], solver.y[1] if self.m else self.velocity(solver.y[0], solver.y[-1])
            times.append(solver.t)
            sizes.append(abs(speed - np.log(self.load)))
            if speed > 200:
                return "blow-up"
            if self.stresses(x)[1] <= 0:
                return "contact lost"
            if solver.status != "running" or len(times) > most_steps:
                break
            if len(times) % 200 == 0:  # at rest for two periods, spring and block alike
                lately = np.array(times) > solver.t - 2 * self.period / min(self.load, 1.0)
                if not lately.all() and np.array(sizes)[lately].max() < 1e-5:
                    return "returns"
            solver.step()
        if solver.status != "finished":
            return "blow-up" if not self.m and speed > 20 else "?"
        times, sizes = np.array(times), np.array(sizes)
        late, before = (sizes[(times > i * end) & (times <= j * end)].max(initial=0) for i, j in ((0.9, 1), (0.6, 0.7)))
        if late < 1e-4 or (late < 0.02 and late < 0.5 * before):
            return "returns"
        if abs(late - before) < 0.02 * late and late > 0.02:
            return "oscillation"
        return "?"


def natural_length(case: Drawn) -> float:
    return float(Kicked(case.rig, "displacement", 1, "before", {}, 0, None).length[0]) / D_C


def outcome_of(case: Drawn, size: float | None = None) -> str:
    kicked = Kicked(case.rig, case.kick, case.direction, "before", {}, 0, None)
    return OUTCOMES[int(kicked.outcomes(np.zeros(1, dtype=int), np.array([size or case.size]))[0])]
