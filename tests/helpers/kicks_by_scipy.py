"""Outcomes of random kicks by SciPy with equations typed by hand, and by long simulation.

The reference integrates x, ln v and ln θ (LuGre: x, v and z) by DOP853, or Radau where it is stiff, and looks at the
last half of the motion; it shares no equation with the package. `simulated` looks at a long run of the package so.
"""

from dataclasses import replace
from time import process_time

import numpy as np
from numba import njit
from scipy.integrate import DOP853, Radau

import steadyslip as ss
from kicks_at_random import D_C, MU, V_REF, Drawn, by_preload

LOWEST = -100.0  # of ln v: slower than this the block keeps still

# -- equations, typed by hand; p: law, m, eta, k, tan, sigma0, pressure, load, then what the law has

SLIP, AGING, PRZ, NAGATA, LUGRE = range(5)


@njit(cache=False)
def stresses(x, p):
    spring = p[8] - p[3] * x
    return spring, p[5] - spring * p[4] + p[6]


@njit(cache=False)
def memory_friction(u, p):
    return p[10] + p[12] * u[0] + (p[13] * u[1] if p[9] > 1 else 0.0)


@njit(cache=False)
def massless_w(x, u, p):
    """ln v that balances forces."""
    spring, sigma = stresses(x, p)
    target, a, eta = spring / sigma - memory_friction(u, p), p[11], p[2]
    w = min(target / a, 600.0)
    if eta > 0:
        w = min(w, np.log(max(spring, 1e-300) / eta))
        for _ in range(200):
            value = a * w + eta / sigma * np.exp(w) - target
            change = value / (a + eta / sigma * np.exp(w))
            w -= change
            if abs(change) < 1e-13 * (1 + abs(w)):
                break
    return w


@njit(cache=False)
def rates(y, t, p):
    out = np.zeros(len(y))
    law, m, k, tan, load = p[0], p[1], p[3], p[4], p[7]
    x = y[0]
    spring, sigma = stresses(x, p)
    if law == LUGRE:
        z = y[-1]
        v = y[1] if m > 0 else bristle_speed(spring, sigma, z, p)
        zdot = v - p[10] * abs(v) * z / curve(v, p)
        out[0], out[-1] = v - load, zdot
        if m > 0:
            out[1] = (spring - p[2] * v - sigma * (p[10] * z + p[11] * zdot + p[12] * v)) / m
        return out
    first = 2 if m > 0 else 1
    u = y[first:]
    w = y[1] if m > 0 else massless_w(x, u, p)
    v = np.exp(min(w, 600.0))
    out[0] = v - load
    sigma_dot = k * tan * (v - load)
    wdot = 0.0
    if m > 0:
        push = spring - p[2] * v - (memory_friction(u, p) + p[11] * w) * sigma
        wdot = push / (m * np.exp(min(max(w, LOWEST), 600.0)))
        out[1] = wdot
    for i in range(int(p[9])):
        d = 1.0 if i == 0 else p[14]
        if law == SLIP:
            change = -v / d * (w + u[i])
        elif law == PRZ:
            change = 0.5 / d * (np.exp(-u[i]) - v * np.exp(w + u[i]))
        else:
            change = (np.exp(-u[i]) - v) / d
        change -= p[15] / p[12] * sigma_dot / sigma
        if law == NAGATA and m > 0:  # the ratio of stresses is mu + a w + b u
            change = (change - p[16] * p[11] / p[12] * wdot) / (1 + p[16])
        elif law == NAGATA:
            change -= p[16] / p[12] * (-k * (v - load) / sigma - spring * sigma_dot / sigma**2)
        out[first + i] = change
    return out


@njit(cache=False)
def in_slip(y, p):
    """Rates over those of a clock that the block drives when it is fast; time itself comes last."""
    found = rates(y[:-1], 0.0, p)
    fast = 1 + found[0] + p[7]
    out = np.empty(len(y))
    for i in range(len(found)):  # numba compiles assigned slices for seconds
        out[i] = found[i] / fast
    out[-1] = 1 / fast
    return out


@njit(cache=False)
def slopes(y, t, p, size):
    """Jacobian, by differences that rounding in the acceleration of a small mass does not drown."""
    out = np.empty((len(y), len(y)))
    for j in range(len(y)):
        beside = y.copy()
        beside[j] = y[j] + 10 * size[j]
        above = rates(beside, t, p)
        beside[j] = y[j] - 10 * size[j]
        below = rates(beside, t, p)
        for i in range(len(y)):
            out[i, j] = (above[i] - below[i]) / (20 * size[j])
    return out


@njit(cache=False)
def curve(v, p):
    return p[13] + (p[14] - p[13]) * np.exp(-((v / p[15]) ** 2))


@njit(cache=False)
def bristle_excess(v, spring, sigma, z, p):
    zdot = v - p[10] * abs(v) * z / curve(v, p)
    return spring - p[2] * v - sigma * (p[10] * z + p[11] * zdot + p[12] * v)


@njit(cache=False)
def bristle_speed(spring, sigma, z, p):
    """v that balances forces, the first from p[16], by bisection outwards in the direction of the force."""
    v = p[16]
    step = 0.01 * p[7]
    at = bristle_excess(v, spring, sigma, z, p)
    if at == 0.0:
        return v
    sign = 1.0 if at > 0 else -1.0
    low = v
    for _ in range(200):
        high = low + sign * step
        if bristle_excess(high, spring, sigma, z, p) * sign <= 0:
            break
        low, step = high, 1.5 * step
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if bristle_excess(middle, spring, sigma, z, p) * sign > 0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@njit(cache=False)
def jumps(start, end, rate_start, rate_end, span, p):
    """True if v jumps between two states, found by bisection: a velocity that balances forces is lost."""
    p = p.copy()
    low, high, slow = 0.0, 1.0, p[16]
    fast = bristle_speed(*stresses(end[0], p), end[-1], p)
    first = abs(fast - slow)
    if first < 0.05 * (abs(slow) + p[7]):
        return False
    for _ in range(40):
        s = 0.5 * (low + high)
        y = (start * (1 + 2 * s) + span * s * rate_start) * (1 - s) ** 2 + s**2 * (
            end * (3 - 2 * s) - span * (1 - s) * rate_end
        )
        middle = bristle_speed(*stresses(y[0], p), y[-1], p)
        if abs(middle - slow) > abs(fast - middle):
            high, fast = s, middle
        else:
            low, slow = s, middle
            p[16] = slow
    return abs(fast - slow) > 0.2 * first


class Reference:
    """One kicked motion; rate-and-state friction in units of d_c and v0."""

    def __init__(self, case: Drawn) -> None:
        kicked, rig = case.kicked(), by_preload(case.rig)
        self.length = float(kicked.rest.natural_slip[0])
        friction, contact = rig.friction, rig.contact
        bristles = isinstance(friction, ss.laws.LuGre)
        length, speed = (1.0, 1.0) if bristles else (D_C, V_REF)
        drive = rig.drive.velocity / speed
        self.p = p = np.zeros(17)
        p[1:6] = (rig.mass * speed**2 / length, rig.radiation_damping * speed, rig.stiffness * length,
                  np.tan(getattr(contact, "angle", 0.0)), contact.preload)  # fmt: skip
        p[7], sign = drive, case.size * case.direction
        if bristles:
            p[0] = LUGRE
            p[16] = drive * np.exp(-sign) if (case.kick, case.reference) == ("velocity", "after") else drive
            p[10:16] = (friction.bristle_stiffness, friction.bristle_damping, friction.viscous, friction.mu_coulomb,
                        friction.mu_static, friction.v_stribeck)  # fmt: skip
        else:
            self._rate_state(friction)
        p[8] = self.steady(drive)[0]
        start = drive * np.exp(-sign) if (case.kick, case.reference) == ("velocity", "after") else drive
        spring, sigma = self.steady(start)
        before = spring / sigma if p[0] != LUGRE else 0.0
        x, v = (p[8] - spring) / p[3], start
        own = self.steady(drive)[1]
        if case.kick == "velocity" and case.reference == "before":
            p[7] = drive * np.exp(sign)
        elif case.kick == "displacement":
            x -= sign * self.length / length
        elif case.kick == "impulse":
            v = drive * (1 + sign)
        elif case.kick == "normal-stress":
            p[6] = sign * own
        jumped = stresses(x, p)
        if bristles:
            z = curve(start, p) / p[10]
            self.y = np.array([x, v, z] if p[1] else [x, z])
        else:  # what jumps of stress do to memory
            jump = -p[15] / p[12] * np.log(jumped[1] / sigma) if jumped[1] > 0 else 0.0
            if p[0] == NAGATA:
                ratio = jumped[0] / jumped[1] - before
                jump = jump / (1 + p[16]) if p[1] else jump - p[16] / p[12] * ratio
            u = [-np.log(start) + jump] * int(p[9])
            self.y = np.array([x, np.log(v), *u] if p[1] else [x, *u])
        rest = kicked.rest_after(np.zeros(1, dtype=int), np.array([case.size])).leading[0]
        self.period = (
            (2 * np.pi / abs(rest) if np.isfinite(rest) else 100 * self.length / rig.drive.velocity) * speed / length
        )
        thrown = abs(v - p[7]) * np.sqrt(p[1] / p[3])  # as far as the spring alone lets a block go
        self.reload = 3 * (abs(x) + thrown) / p[7]

    def _rate_state(self, friction: ss.laws.RateState) -> None:
        p, states = self.p, friction.states or (friction,)
        p[0] = {"slip": SLIP, "aging": AGING, "prz": PRZ, "nagata": NAGATA}[friction.evolution.name]
        p[9:13] = len(states), MU, friction.a, states[0].b
        if len(states) > 1:
            p[13], p[14] = states[1].b, states[1].d_c / D_C
        p[15] = getattr(friction.normal_memory, "alpha", 0.0) or 0.0
        p[16] = getattr(friction.evolution, "c_nagata", 0.0)

    def steady(self, v: float) -> tuple[float, float]:
        """Spring and normal stress in steady sliding, without the kick's own pressure."""
        p = self.p
        mu = curve(v, p) + p[12] * v if p[0] == LUGRE else p[10] + (p[11] - p[12] - p[13]) * np.log(v)
        sigma = (p[5] - p[2] * v * p[4]) / (1 + mu * p[4])
        return mu * sigma + p[2] * v, sigma

    def speed(self, y: np.ndarray) -> float:
        """v, or where it is positive by its form ln v."""
        p = self.p
        if p[0] == LUGRE:
            return y[1] if p[1] else bristle_speed(*stresses(y[0], p), y[-1], p)
        return y[1] if p[1] else massless_w(y[0], y[1:], p)

    def outcome(self, turns: float = 150.0, limit: float = 8.0) -> str:
        """Outcome of a kick, one of `OUTCOMES`; "?" if it is open within `limit` seconds of computation."""
        p, y = self.p, self.y
        if stresses(y[0], p)[1] <= 0:
            return "contact lost"
        if p[0] == LUGRE and not p[1]:
            p[16] = self.speed(y)  # which the kick itself may have changed at once
        stiff, begun = p[0] == LUGRE or p[1] > 0, process_time()
        times = np.linspace(0, turns * self.period + self.reload, 8001)
        if stiff:
            scale = 1e4 * self.atol() * np.ones(len(y))
            solver = Radau(lambda t, y: rates(y, t, p), 0.0, y, times[-1], rtol=1e-7, atol=100 * self.atol(),
                           jac=lambda t, y: slopes(y, t, p, scale))  # fmt: skip
        else:
            return self.massless(times, begun + limit)
        speeds, now = [], 0.0
        while solver.status == "running" and process_time() - begun < limit:
            before = solver.y
            solver.step()
            if stresses(solver.y[0], p)[1] <= 0:
                return "contact lost"
            if self.lost(before, solver):
                return "no solution"
            now, speed = solver.t, self.speed(solver.y)
            if p[0] != LUGRE and speed > 200:
                return "blow-up"
            between = solver.dense_output()
            for time in times[len(speeds) :]:
                if time > solver.t:
                    break
                speeds.append(self.speed(between(time)))
            if self.rested(speeds, times):
                return "returns"
        if solver.status == "failed" or now < self.reload + 30 * self.period:
            return "?"
        return judged(self.away(np.array(speeds))[int(len(times) * self.reload / times[-1]) :])

    def lost(self, before: np.ndarray, solver: Radau) -> bool:
        """True if the velocity of a massless block of bristles ceased to balance forces in the last step."""
        p = self.p
        if p[0] != LUGRE or p[1]:
            return False
        span = solver.t - (solver.t_old or 0.0)
        if jumps(before, solver.y, rates(before, 0.0, p), rates(solver.y, 0.0, p), span, p):
            return True
        p[16] = self.speed(solver.y)
        return False

    def massless(self, times: np.ndarray, limit: float) -> str:
        """The outcome where velocity may grow without bound: in a time that runs as fast as the block then."""
        p = self.p
        solver = DOP853(lambda s, y: in_slip(y, p), 0.0, np.append(self.y, 0.0), np.inf, rtol=1e-9, atol=self.atol())
        seen = [(0.0, self.speed(self.y))]
        while solver.y[-1] < times[-1]:
            if process_time() > limit or solver.status != "running":
                return "?"
            solver.step()
            seen.append((solver.y[-1], self.speed(solver.y[:-1])))
            if stresses(solver.y[0], p)[1] <= 0:
                return "contact lost"
            if seen[-1][1] > 200:
                return "blow-up"
        speeds = np.interp(times, *np.transpose(seen))
        return judged(self.away(speeds)[int(len(times) * self.reload / times[-1]) :])

    def rested(self, speeds: list[float], times: np.ndarray) -> bool:
        """True if nothing has happened for two periods after the spring was loaded again."""
        some = int(2 * self.period / times[1]) + 1
        if len(speeds) * times[1] < self.reload + 4 * self.period or len(speeds) % 20:
            return False
        return bool(self.away(np.array(speeds[-some:])).max() < 1e-5)

    def away(self, speeds: np.ndarray) -> np.ndarray:
        """Distance of the velocity from the load point's, in logarithms where that can be."""
        if self.p[0] == LUGRE:
            return self.from_load(speeds / self.p[7])
        return np.abs(speeds - np.log(self.p[7]))

    def from_load(self, ratio: np.ndarray) -> np.ndarray:
        """The same, of velocities over the load point's."""
        return np.log1p(np.abs(ratio - 1)) if self.p[0] == LUGRE else np.abs(np.log(np.maximum(ratio, 1e-300)))

    def atol(self) -> np.ndarray | float:
        if self.p[0] != LUGRE:
            return 1e-10
        size = [self.length, self.p[7], self.p[13] / self.p[10]]
        return 1e-9 * np.array(size if self.p[1] else size[::2])


SEEN_TO_DIE_OUT = 3.0  # decay times that a run must last to tell an oscillation from ringing, next to an edge


def judged(away: np.ndarray) -> str:
    """Outcome from distances from steady sliding at equal time steps."""
    away = np.where(np.isfinite(away), away, 700.0)
    quarters = [np.sqrt(np.mean(part**2)) for part in np.array_split(away, 8)[-4:]]
    before, late = max(quarters[:2]), max(quarters[2:])
    if away[-len(away) // 10 :].max() < 1e-4 or (late < 0.02 and late < 0.7 * before):
        return "returns"
    return "oscillation" if late > 0.02 and abs(late - before) < 0.15 * before else "?"


def simulated(case: Drawn, size: float | None = None, turns: float = 150.0) -> str:
    """The outcome by a long run of the package."""
    case = replace(case, size=size or case.size)
    rig, reference = by_preload(case.rig), Reference(case)
    kicked = case.kicked()
    amount, drive = float(kicked.amount(case.size)[0]), rig.drive.velocity
    load, piece, initial = drive, None, {}
    if case.kick == "velocity" and case.reference == "before":
        load, piece = amount, ss.protocol.VelocityStep(at=0.0, to=amount)
    elif case.kick == "velocity":
        rig, piece = rig.with_values({"drive.velocity": amount}), ss.protocol.VelocityStep(at=0.0, to=drive)
    elif case.kick == "displacement":
        piece = ss.protocol.DisplacementStep(at=0.0, by=amount)
    elif case.kick == "normal-stress":
        piece = ss.protocol.NormalStressStep(at=0.0, by=amount)
    else:
        initial = {"v": drive + amount / rig.mass}
    unit = 1.0 if reference.p[0] == LUGRE else D_C / V_REF
    end = (turns * reference.period + reference.reload) * unit
    try:
        run = ss.simulate(rig, piece, until=end, initial=initial, times=np.linspace(0, end, 8001), rtol=1e-9,
                          events=False, most_steps=3_000_000)  # fmt: skip
    except (ss.NoSteadySliding, ss.NotAvailable):  # at the velocity that a step starts from
        return "?"
    if run.status != "done":
        return run.status if run.status in ("blow-up", "contact lost") else "?"
    begin = int(len(run["v"]) * reference.reload * unit / end)
    found = judged(reference.from_load(run["v"][begin:] / load))
    decay = -kicked.rest_after(np.zeros(1, dtype=int), np.array([case.size])).leading[0].real
    dies_out_too_slowly = 0 < decay * end < SEEN_TO_DIE_OUT
    return "?" if found == "oscillation" and dies_out_too_slowly else found
