"""Random sliders whose direct and evolution effects fade at speed, and their equations typed by hand (theory 12).

``python tests/helpers/cutoff_rigs.py COUNT SEED`` compares many: eigenvalues with a matrix, motion with SciPy.
"""

import sys

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import steadyslip as ss

V_REF, MU, PRELOAD = 1e-5, 0.6, 1e7
EVOLUTIONS = {
    "slip": ss.laws.Slip(),
    "aging": ss.laws.Aging(),
    "prz": ss.laws.PRZ(),
    "nagata": ss.laws.Nagata(c_nagata=0.4),
}


class ByHand:
    """A slider on an inclined spring with numbers of its own, and the equations of its motion."""

    def __init__(self, random):
        self.evolution = random.choice([*EVOLUTIONS])
        states = 1 if self.evolution == "nagata" else int(random.integers(1, 4))
        self.a = random.uniform(0.004, 0.012)
        self.b = random.uniform(0.2, 1.6, states) * self.a
        self.d_c = 1e-5 * 10 ** random.uniform(-0.5, 0.5, states)
        self.v0 = 1e-5 * 10 ** random.uniform(-1, 1)
        self.v_a = random.choice([np.inf, self.v0 * 10 ** random.uniform(-0.5, 3)])
        self.v_b = np.where(random.random(states) < 0.7, self.v0 * 10 ** random.uniform(-0.5, 3, states), np.inf)
        self.alpha = random.choice([0.0, random.uniform(0.05, 0.5)])
        self.tan = np.tan(random.uniform(-0.6, 0.6))
        self.c_nagata = 0.4 if self.evolution == "nagata" else 0.0
        self.kappa = 10 ** random.uniform(-0.5, 0.5)
        self.m = random.choice([0.0, 10 ** random.uniform(-3, 0)])
        self.sigma = PRELOAD / (1 + self._steady() * self.tan)
        self.k = self.kappa * self.sigma * max(self.a, 0.2 * np.sum(self.b)) / np.min(self.d_c)
        self.m *= self.a * self.sigma * np.min(self.d_c) / self.v0**2

    def _steady(self):
        return MU + self.a * self._direct(self.v0) + np.sum(self.b * self._evolved(-np.log(self.v0 / V_REF)))

    def _direct(self, v):
        return np.log(v / V_REF) - (np.log((v + self.v_a) / (V_REF + self.v_a)) if np.isfinite(self.v_a) else 0.0)

    def _evolved(self, theta):
        """ln(1 + v_b θ/d_c) − ln(1 + v_b/v*), with θ/2 for PRZ; both are e^Θ/v*."""
        finite = np.isfinite(self.v_b)
        own = np.log(np.where(finite, self.v_b, 1.0) / V_REF)
        return np.where(finite, np.logaddexp(0, theta + own) - np.logaddexp(0, own), theta)

    def slider(self):
        cutoffs = [{} if np.isinf(v) else {"b_cutoff_velocity": v} for v in self.v_b]
        if len(self.b) == 1:
            own = {"b": self.b[0], "d_c": self.d_c[0], **cutoffs[0]}
        else:
            own = {
                "states": [
                    ss.laws.State(b=b, d_c=d, **one) for b, d, one in zip(self.b, self.d_c, cutoffs, strict=True)
                ]
            }
        if np.isfinite(self.v_a):
            own["a_cutoff_velocity"] = self.v_a
        if self.alpha:
            own["normal_memory"] = ss.laws.LinkerDieterich(alpha=self.alpha, sigma_ref=1e6)
        law = ss.laws.RateState(a=self.a, mu_ref=MU, v_ref=V_REF, evolution=EVOLUTIONS[self.evolution], **own)
        contact = ss.laws.InclinedSpring(preload=PRELOAD, angle=np.arctan(self.tan))
        return ss.Slider(
            friction=law, contact=contact, stiffness=self.k, mass=self.m, drive=ss.machine.SteadyDrive(velocity=self.v0)
        )

    # Small perturbations, with a' = a v_a/(v_a + v) and b' alike.

    def eigenvalues(self):
        """Eigenvalues in the variables x, v (with mass) and Ψ_i = b_i Θ_i + α_i ln σ + c_N τ/σ."""
        v, n, sigma, mu = self.v0, len(self.b), self.sigma, self._steady()
        a1 = self.a if np.isinf(self.v_a) else self.a * self.v_a / (self.v_a + v)
        b1 = np.array([b if np.isinf(own) else b * own / (own + v) for b, own in zip(self.b, self.v_b, strict=True)])
        part = self.alpha * self.b / np.sum(self.b)
        # friction's change F from x, v and Ψ: F (1 + c_N b'/b) = μσ' (1 + c_N b'/b) + σ (a' v'/v + Σ b' Θ' less c_N)
        d_sigma = self.k * self.tan  # per x
        grip = 1 + self.c_nagata * np.sum(b1 / self.b)
        f_x = d_sigma * (mu * grip - np.sum(b1 / self.b * part)) / grip
        f_v = sigma * a1 / v / grip
        f_psi = sigma * (b1 / self.b) / grip
        size = n + 1 + (self.m > 0)
        rows = np.zeros((size, size))
        at = size - n
        v_row = np.zeros(size)  # v' in terms of the variables
        if self.m > 0:
            v_row[1] = 1.0
            rows[1, 0] = (-self.k - f_x) / self.m
            rows[1, 1] = -f_v / self.m
            rows[1, at:] = -f_psi / self.m
        else:
            v_row[0] = (-self.k - f_x) / f_v
            v_row[at:] = -f_psi / f_v
        rows[0] = v_row
        friction = f_v * v_row
        friction[0] += f_x
        friction[at:] += f_psi
        for i in range(n):
            own = -part[i] * np.eye(size)[0] * d_sigma / sigma  # b Θ' from Ψ'
            own = own + np.eye(size)[at + i] - self.c_nagata * (friction - mu * d_sigma * np.eye(size)[0]) / sigma
            rows[at + i] = -self.b[i] / self.d_c[i] * v_row - v / self.d_c[i] * own
        return np.linalg.eigvals(rows)

    # Motion.

    def _friction(self, v, sigma, psi):
        def excess(ratio):
            theta = (psi - self.parts * np.log(sigma / 1e6) - self.c_nagata * ratio) / self.b
            return ratio - MU - self.a * self._direct(v) - np.sum(self.b * self._evolved(theta))

        return sigma * (brentq(excess, -5, 5, xtol=1e-15) if self.c_nagata else -excess(0.0))

    @property
    def parts(self):
        return self.alpha * self.b / np.sum(self.b)

    def motion(self, times, faster):
        """Velocities at times after the load point begins to move `faster` times as fast."""
        steady = self._steady() * self.sigma
        theta = -np.log(self.v0 / V_REF) * np.ones(len(self.b))
        psi = self.b * theta + self.parts * np.log(self.sigma / 1e6) + self.c_nagata * steady / self.sigma

        def velocity(x, psi):
            """Without mass: friction is what the spring exerts, and the direct effect says the velocity."""
            spring = steady - self.k * x
            sigma = PRELOAD - spring * self.tan
            theta = (psi - self.parts * np.log(sigma / 1e6) - self.c_nagata * spring / sigma) / self.b
            level = (spring / sigma - MU - np.sum(self.b * self._evolved(theta))) / self.a
            if np.isinf(self.v_a):
                return V_REF * np.exp(level)
            return self.v_a / ((1 + self.v_a / V_REF) * np.exp(-level) - 1)

        def rates(_, y):
            x, psi = y[0], y[1 + (self.m > 0) :]
            v = np.exp(y[1]) if self.m else velocity(x, psi)
            spring = steady - self.k * x
            sigma = PRELOAD - spring * self.tan
            friction = self._friction(v, sigma, psi) if self.m else spring
            theta = (psi - self.parts * np.log(sigma / 1e6) - self.c_nagata * friction / sigma) / self.b
            if self.evolution == "slip":
                own = -v / self.d_c * (np.log(v / V_REF) + theta)
            elif self.evolution == "prz":
                own = V_REF / (2 * self.d_c) * np.exp(-theta) - v**2 / (2 * self.d_c * V_REF) * np.exp(theta)
            else:
                own = V_REF / self.d_c * np.exp(-theta) - v / self.d_c
            inertia = [(spring - friction) / (self.m * v)] if self.m else []
            return [v - faster * self.v0, *inertia, *(self.b * own)]

        start = [0.0, *([np.log(self.v0)] if self.m else []), *psi]
        run = solve_ivp(
            rates, (0, times[-1]), start, "Radau", times, rtol=1e-9, atol=[1e-16] + [1e-11] * len(start[1:])
        )
        if not run.success:
            return None
        return np.exp(run.y[1]) if self.m else np.array([velocity(y[0], y[1:]) for y in run.y.T])


def check_eigenvalues(rig):
    """Largest relative difference of two sets of eigenvalues, each in the order of the other."""
    ours, theirs = ss.eigenvalues(rig.slider()), rig.eigenvalues()
    ours = np.ravel(ours)[np.isfinite(np.ravel(ours))]
    near = np.abs(ours[:, None] - theirs)
    return max(np.max(np.min(near, 0)), np.max(np.min(near, 1))) / np.max(np.abs(theirs))


def check_motion(rig, faster=1.02):
    """Largest difference of ln v after a small step of the drive, or None where SciPy does not come through."""
    times = np.linspace(0, 6 * np.max(rig.d_c) / rig.v0, 25)
    theirs = rig.motion(times, faster)
    if theirs is None or not np.all(np.isfinite(theirs)) or np.max(theirs) > 1e4 * rig.v0:
        return None
    step = ss.protocol.VelocityStep(at=0.0, to=faster * rig.v0)
    run = ss.simulate(rig.slider(), step, until=times[-1], times=times[1:], rtol=1e-9)
    return float(np.max(np.abs(np.log(run["v"][-len(times) + 1 :] / theirs[1:]))))


if __name__ == "__main__":
    count, seed = (int(word) for word in sys.argv[1:3])
    for i in range(seed, seed + count):
        one = ByHand(np.random.default_rng(i))
        print(i, one.evolution, len(one.b), one.m > 0, f"{check_eigenvalues(one):.1e}", check_motion(one), flush=True)
