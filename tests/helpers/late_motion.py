"""Motion with delays at random, and integration of the delay equations typed by hand (method of steps, SciPy).

`python tests/helpers/late_motion.py 40 1` draws 40 rigs with seed 1 and compares the package's motion with them.
"""

import sys
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from time import process_time

import numpy as np
from scipy.integrate import DOP853, Radau

import steadyslip as ss
from machines import surface

RAMP = 0.02  # of the push, over the steady normal force
PUSH = 1.02  # starting velocity of the body that slides, over the drive's


@dataclass(frozen=True)
class Late:
    """A rig with its equations: y' = `rates`(y, `late` signals), which are `signals`(y) a time `delays` ago.

    Slip rate v of the contact is `speed`(y), in units of the drive's velocity 1; y[0] is the slip ahead of the drive.
    """

    rig: object
    steady: np.ndarray
    start: np.ndarray
    rates: object
    signals: object
    delays: tuple
    speed: object
    body: str
    natural: float
    stiff: bool = False


def pushed(one, t):
    """A push that rises from 0 to `RAMP` within the natural time."""
    return RAMP * min(max(t / one.natural, 0.0), 1.0)


def history(one, until, start=None, rtol=1e-10):
    """Times of steps and a function of the state at a time, by the method of steps.

    From the state `start` after steady sliding; without one under `pushed`.
    """
    times, pieces = [0.0], []
    y = one.steady if start is None else start
    at_rest = one.signals(one.steady)
    shortest = min(one.delays)

    def state(t):
        return pieces[min(bisect_right(times, t) - 1, len(pieces) - 1)](t)

    def rates(t, y):
        late = [rest if t <= d else one.signals(state(t - d))[i]
                for i, (d, rest) in enumerate(zip(one.delays, at_rest, strict=True))]  # fmt: skip
        return one.rates(y, late, pushed(one, t) if start is None else 0.0)

    kinks = [0.0] if start is not None else [0.0, one.natural]
    breaks = sorted({kink + d * k for kink in kinks for d in one.delays for k in range(6)} | {until})
    for end in breaks:  # where derivatives jump
        if end > until or end <= times[-1]:
            continue
        solver = (Radau if one.stiff else DOP853)(rates, times[-1], y, end, max_step=shortest, rtol=rtol, atol=1e-12)
        while solver.status == "running":
            with np.errstate(over="ignore", invalid="ignore"):  # in a step that is tried and made shorter
                solver.step()
            pieces.append(solver.dense_output())
            times.append(solver.t)
        if solver.status == "failed":
            raise ValueError("the reference fails")
        y = solver.y
    return np.array(times), state


def slips(one, until, rtol=1e-8):
    """Beginnings, slips and peaks of what slips faster than twice the drive, between passages of its velocity."""
    times, state = history(one, until, one.start, rtol)
    fine = np.unique(np.concatenate([np.linspace(a, b, 6) for a, b in pairwise(times)]))
    states = np.array([state(t) for t in fine])
    v = np.array([one.speed(y) for y in states])
    way = states[:, 0] + fine
    up = np.flatnonzero((v[:-1] < 1) & (v[1:] >= 1))
    down = np.flatnonzero((v[:-1] > 1) & (v[1:] <= 1))
    found = []
    for i in up:
        later = down[down > i]
        if not len(later):
            break
        j = later[0]
        peak = v[i : j + 2].max()
        if peak > 2:
            t = [fine[k] + (1 - v[k]) / (v[k + 1] - v[k]) * (fine[k + 1] - fine[k]) for k in (i, j)]
            places = np.interp(t, fine, way)
            found.append((t[0], places[1] - places[0], peak))
    return np.array(found).reshape(-1, 3)


# -- rigs and their equations


def memory_rate(law, v, psi, b):
    return -v * (psi + b * np.log(v)) if law == "slip" else b * (np.exp(-psi / b) - v)


def law_of(law, a, b):
    evolution = ss.laws.Slip() if law == "slip" else ss.laws.Aging()
    return ss.laws.RateState(a=a, b=b, d_c=1.0, mu_ref=0.6, v_ref=1.0, evolution=evolution)


def slider(law="slip", a=0.3, b=0.5, m=0.1, k=0.1, c=0.0, kp=0.2, kd=0.02, ki=0.0, delay=0.3, unused=None):
    """A slider with rate and state, with a late controller beside its spring."""
    drive = {"velocity": 1.0, "kp": kp, "kd": kd, "delay": delay}
    drive = ss.machine.PID(ki=ki, **drive) if ki else ss.machine.PD(**drive)
    rig = ss.Slider(friction=law_of(law, a, b), contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=k,
                    mass=m, damping=c, drive=drive)  # fmt: skip

    def rates(y, late, push=0.0):
        x, w, psi, _ = y
        v = np.exp(w)
        force = push - k * x - c * (v - 1) - late[0] - a * w - psi
        return np.array([v - 1, force / (m * v), memory_rate(law, v, psi, b), x])

    def signals(y):
        return [kp * y[0] + kd * (np.exp(y[1]) - 1) + ki * y[3]]

    steady, start = np.zeros(4), np.array([0.0, np.log(PUSH), 0.0, 0.0])
    return Late(rig, steady, start, rates, signals, (delay,), lambda y: np.exp(y[1]), "", np.sqrt(m / (k + kp)))


def massless(law="slip", a=0.3, b=0.5, k=0.3, kp=0.2, ki=0.0, delay=0.3):
    """A slider without mass: its velocity follows from the balance of forces; it starts by another memory."""
    drive = {"velocity": 1.0, "kp": kp, "delay": delay}
    drive = ss.machine.PID(ki=ki, **drive) if ki else ss.machine.PD(**drive)
    rig = ss.Slider(friction=law_of(law, a, b), contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=k,
                    drive=drive)  # fmt: skip

    def slip_rate(y, late, push):
        return np.exp((push - k * y[0] - late - y[1]) / a)

    def rates(y, late, push=0.0):
        v = slip_rate(y, late[0], push)
        return np.array([v - 1, memory_rate(law, v, y[1], b), y[0]])

    def signals(y):
        return [kp * y[0] + ki * y[2]]

    steady, start = np.zeros(3), np.array([0.0, -a * np.log(PUSH), 0.0])
    return Late(rig, steady, start, rates, signals, (delay,), None, "", 1 / (k + kp))


def axis(law="slip", a=0.5, b=0.8, kp=4.0, kd=3.0, ki=0.0, delay=0.02, measured="motor", motor=2.0, table=5.0,
         screw=100.0, damping=0.5):  # fmt: skip
    """Motor and table on a screw, the table with rate and state, the motor under a late controller."""
    drive = {"velocity": 1.0, "body": "motor", "measured": measured, "kp": kp, "kd": kd, "delay": delay}
    drive = ss.machine.PositionPID(ki=ki, **drive) if ki else ss.machine.PositionPD(**drive)
    rig = ss.Machine(
        bodies={"motor": ss.machine.SlidingBody(mass=motor), "table": ss.machine.SlidingBody(mass=table)},
        links={"screw": ss.machine.Spring(between=("motor", "table"), stiffness=screw, damping=damping)},
        contacts={"guide": surface("table", law_of(law, a, b))},
        drive=drive,
    )
    place, speed = (2, 3) if measured == "motor" else (0, 1)

    def rates(y, late, push=0.0):
        x, w, x1, v1, psi, _ = y
        v = np.exp(w)
        spring = screw * (x1 - x) + damping * (v1 - v)
        return np.array([
            v - 1, (push + spring - a * w - psi) / (table * v), v1 - 1, (-spring - late[0]) / motor,
            memory_rate(law, v, psi, b), y[place],
        ])  # fmt: skip

    def signals(y):
        velocity = np.exp(y[1]) if speed == 1 else y[3]
        return [kp * y[place] + kd * (velocity - 1) + ki * y[5]]

    steady = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    start = np.array([0.0, np.log(PUSH), 0.0, 1.0, 0.0, 0.0])
    return Late(
        rig, steady, start, rates, signals, (delay,), lambda y: np.exp(y[1]), "table", np.sqrt((motor + table) / kp)
    )


def lagging(m=1.0, k=1.0, c=0.05, low=0.3, high=0.5, stribeck=1.0, lag=0.5, kp=0.0, delay=0.0):
    """A slider whose friction falls with an earlier velocity (Hess and Soom); with `kp` under a late controller too."""
    friction = ss.laws.CoulombStribeck(mu_coulomb=low, mu_static=high, v_stribeck=stribeck, lag=lag)
    drive = ss.machine.PD(velocity=1.0, kp=kp, delay=delay) if kp else ss.machine.SteadyDrive(1.0)
    rig = ss.Slider(friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=k, mass=m,
                    damping=c, drive=drive)  # fmt: skip

    def curve(v):
        return low + (high - low) * np.exp(-((v / stribeck) ** 2))

    rest = curve(1.0)

    def rates(y, late, push=0.0):
        friction = curve(late[0]) * np.tanh(y[1] / 1e-6) - rest
        held = k * y[0] + c * (y[1] - 1) + (late[1] if kp else 0)
        return np.array([y[1] - 1, (push - held - friction) / m])

    def signals(y):
        return [y[1], kp * y[0]][: 2 if kp else 1]

    delays = (lag, delay) if kp else (lag,)
    steady, start = np.array([0.0, 1.0]), np.array([0.0, PUSH])
    return Late(rig, steady, start, rates, signals, delays, lambda y: y[1], "", np.sqrt(m / (k + kp)), stiff=True)


def smooth_error(one, until, rtol=1e-11, push=True):
    """Largest difference of slip ahead of the drive over its range, under `pushed` or after a start at `PUSH`."""
    at = np.linspace(0.0, until, 200)
    _, state = history(one, until, None if push else one.start)
    mine = np.array([state(t)[0] for t in at])
    own = f"{one.body}." if one.body else ""
    ramp = ss.protocol.DisturbanceRamp(on=one.body or None, at=0, by=RAMP, duration=one.natural)
    first = {"protocol": ramp} if push else {"initial": {f"{own}v": PUSH}}
    run = ss.simulate(one.rig, until=until, times=at, rtol=rtol, **first)
    if run.status != "done":
        return np.inf
    return float(np.max(np.abs(run[f"{own}x"] - mine)) / np.ptp(mine))


def event_errors(one, until, most=3):
    """Largest relative differences of slip, of time between events and of peak over the first events; their number."""
    run = ss.simulate(one.rig, until=until, initial={f"{one.body}.v" if one.body else "v": PUSH})
    found = [e for e in run.slip_events if e.slip > 0 and np.isfinite(e.end)][:most]
    if len(found) < 2:
        return np.zeros(3), 0
    typed = slips(one, found[-1].end + 0.5 * (found[-1].begin - found[-2].begin))
    errors, before = [], None
    for event in found:
        near = int(np.argmin(np.abs(typed[:, 2] - event.peak_velocity) / event.peak_velocity
                            + np.abs(typed[:, 0] - event.begin)))  # fmt: skip
        begin, slip, peak = typed[near]
        apart = 0.0 if before is None else (begin - before[0]) / (event.begin - before[1]) - 1
        errors.append((abs(slip / event.slip - 1), abs(apart), abs(peak / event.peak_velocity - 1)))
        before = begin, event.begin
    return np.max(errors, axis=0), len(found)


def drawn(random):
    """A rig at random."""
    law, kind = random.choice(["slip", "aging"]), random.choice(["slider", "axis", "massless", "lagging"])
    a = random.uniform(0.2, 0.6)
    b, late = a + random.uniform(0.1, 0.5), 10 ** random.uniform(-1.5, 0.5)
    total = (b - a) * random.uniform(0.4, 1.6)
    share = random.uniform(0.1, 0.9)
    kp, k = share * total, (1 - share) * total
    ki = random.choice([0.0, 0.05]) * kp
    kd = random.choice([0.0, 1.0]) * random.uniform(0.0, 0.1) * a
    m = 10 ** random.uniform(-1.5, 0.3)
    if kind == "slider":
        return slider(law, a, b, m, k, 0.0, kp, kd, ki, min(late * np.sqrt(m / total), 2.0))
    if kind == "massless":
        return massless(law, a, b, (b - a) * random.uniform(1.02, 1.6), kp, ki, min(late, 0.5))
    if kind == "lagging":
        return lagging(m, total, random.uniform(0.05, 0.3), lag=late * np.sqrt(m / total),
                       **random.choice([{}, {"kp": kp, "delay": 0.5 * late}]))  # fmt: skip
    motor, table, screw = m, m * random.uniform(0.5, 3), total * 10 ** random.uniform(0.5, 2)
    delay = min(late, 1.0) * np.sqrt((motor + table) / total)
    return axis(law, a, b, total, kd, ki, delay, random.choice(["motor", "table"]), motor, table, screw,
                0.1 * np.sqrt(screw * motor))  # fmt: skip


def campaign_errors(seed, i):
    """Error of smooth motion, largest errors of slip events (3,), and how many, of one rig."""
    one = drawn(np.random.default_rng([seed, i]))
    growth = float(np.real(ss.eigenvalues(one.rig)[0]))
    smooth = smooth_error(one, 15 * one.natural)
    if one.speed is None or growth < 0:
        return smooth, np.zeros(3), 0
    return smooth, *event_errors(one, min(60 / growth, 400 * one.natural))


if __name__ == "__main__":
    for place in range(int(sys.argv[1])):
        began = process_time()
        print(place, *campaign_errors(int(sys.argv[2]), place), f"{process_time() - began:.1f} CPU s", flush=True)
