"""Hunting by a second route: a mass under PID with Coulomb friction, larger at rest, by SciPy and by hand.

As a script: python tests/helpers/hunting_by_scipy.py 200 1 compares 200 random axes with seed 1.
"""

import sys
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss

RINGING = """
[bodies.motor]
motion = "rotation"
inertia = "40 kg cm^2"
[bodies.table]
mass = "240 kg"
[links.screw]
kind = "screw"
between = ["motor", "table"]
lead = "10 mm/rev"
stiffness = "120 N/um"
damping = "5 N s/mm"
[contacts.guide]
body = "table"
[contacts.guide.friction]
law = "coulomb"
mu_coulomb = 0.11
mu_static = 0.19
[contacts.guide.contact]
law = "constant"
preload = "3.2 kN"
[drive]
control = "rotary-pid"
body = "motor"
measured = "table"
velocity = 0
velocity_of = "table"
kp = "5 N m/rad"
kd = "0.2 N m s/rad"
ki = "50 N m/(rad s)"
"""
"""An axis behind a compliant screw."""


def axis(mass, rest, sliding, viscous, kp, kd, ki, **more):
    """A slider of area 1 m² that holds a place."""
    drive = ss.machine.PID(0.0, kp=kp, kd=kd, ki=ki, **more)
    friction = ss.laws.Coulomb(mu_coulomb=sliding, mu_static=rest, viscous=viscous)
    return ss.Slider(
        friction=friction, contact=ss.laws.ConstantNormalStress(preload=1.0), mass=mass, area=1.0, drive=drive
    )


def random_axis(random):
    """Numbers of an axis that moves: a dict for `axis`."""
    sliding = float(random.uniform(0.3, 2.0))
    mass, kp = float(random.uniform(0.3, 3.0)), float(random.uniform(1.0, 10.0))
    kd = float(random.uniform(0.2, 2.0) * 2 * np.sqrt(kp * mass))
    return {
        "mass": mass, "rest": sliding * float(random.uniform(1.05, 2.0)), "sliding": sliding,
        "viscous": float(random.uniform(0.0, 0.5)), "kp": kp, "kd": kd,
        "ki": float(random.uniform(0.1, 0.8) * kp * (kd + 0.1) / mass),
    }  # fmt: skip


def strokes_by_scipy(step, count, until, *, mass, rest, sliding, viscous, kp, kd, ki):
    """Starts, ends (s) and errors at the ends of the first strokes, (strokes, 3); integrated from rest to rest."""
    time, place, integral, found = 0.0, 0.0, 0.0, []
    while len(found) < count:
        error = step - place
        pull = kp * error + ki * integral
        if abs(pull) < rest:  # waits until the integral has grown
            wait = (np.sign(error) * rest - pull) / (ki * error)
            time, integral = time + wait, integral + wait * error
            pull = np.sign(error) * rest
        if time > until:
            break
        start, speed = time, 0.0
        while True:
            way = np.sign(pull) if speed == 0 else np.sign(speed)

            def moved(_, y, way=way):
                x, v, i = y
                return [v, (kp * (step - x) - kd * v + ki * i - way * sliding - viscous * v) / mass, step - x]

            def stops(_, y):
                return y[1]

            stops.terminal, stops.direction = True, -way
            first = 1e-6  # the velocity is 0 at the start
            begun = solve_ivp(moved, (0, first), [place, speed, integral], method="DOP853", rtol=1e-13, atol=1e-16)
            run = solve_ivp(moved, (first, 1e4), begun.y[:, -1], method="DOP853", rtol=1e-13, atol=1e-15, events=stops)
            time += run.t_events[0][0]
            place, speed, integral = run.y_events[0][0][0], 0.0, run.y_events[0][0][2]
            pull = kp * (step - place) + ki * integral
            if abs(pull) <= rest:
                break
        if abs(step - place) < 1e-12 * step:  # it creeps onto the target and never stops: the velocity ends in noise
            break
        found.append((start, time, step - place))
    return np.reshape(found, (-1, 3))


def lugre_starts(speeds, until):
    """Times at which the axis of theory 14 with bristles passes each speed (m/s) after a second at rest or more."""

    def moved(_, y):
        x, v, z, i = y
        bristles = v - abs(v) * 1e5 * z / (1 + 0.5 * np.exp(-((v / 1e-3) ** 2)))
        return [v, 3 * (1 - x) - 6 * v + 4 * i - 1e5 * z - np.sqrt(1e5) * bristles - 0.4 * v, bristles, 1 - x]

    events = [lambda _, y, speed=speed: abs(y[1]) - speed for speed in speeds]
    for one in events:
        one.direction = 1
    run = solve_ivp(moved, (0, until), [0.0] * 4, method="Radau", rtol=1e-9, atol=1e-13, events=events)
    return [times[np.diff(times, prepend=-np.inf) > 1.0] for times in run.t_events]


def strokes(found, count):
    """The same of a `Hunt`."""
    ended = [(one.start, one.end, one.ends) for one in found.strokes if np.isfinite(one.end)]
    return np.reshape(ended[:count], (-1, 3))


def compared(random, count=6):
    """Largest difference of times (relative) and errors (of the step) between the two routes of a random axis."""
    numbers = random_axis(random)
    step = 2 * numbers["rest"] / numbers["kp"]
    theirs = strokes_by_scipy(step, count, 2000.0, **numbers)
    until = float(max(theirs[:, 1], default=100.0)) + 1e-3
    found = ss.hunt(axis(**numbers), ss.protocol.DisplacementStep(at=0, by=step), until=until)
    ours = strokes(found, count)
    assert ours.shape == theirs.shape, (numbers, ours, theirs)
    if not len(theirs):
        return 0.0
    times = np.abs(ours[:, :2] - theirs[:, :2]).max() / theirs[-1, 1]
    return max(times, np.abs(ours[:, 2] - theirs[:, 2]).max() / step)


def by_hand(
    step,
    until,
    *,
    mass,
    rest,
    sliding,
    viscous,
    kp,
    kd,
    ki,
    sample,
    on_measurement=False,
    force=np.inf,
    integral_limit=np.inf,
    band=0.0,
    of_integral=False,
    encoder=0.0,
    delay=0,
    bristles=None,
    load=0.0,
):
    """Places at the samples of a sampled PID; delay in samples.

    Spans of constant force by their formula, or of bristles (stiffness, damping, Stribeck velocity) by SciPy. The force
    presses the contact by its share `load`, besides 1 N.
    """

    def banded(e):
        return np.sign(e) * max(abs(e) - band, 0.0)

    def bristled(x, v, z, u):
        stiff, damped, slow = bristles

        def moved(_, y):
            rate = y[1] - stiff * abs(y[1]) * y[2] / (sliding + (rest - sliding) * np.exp(-((y[1] / slow) ** 2)))
            friction = (1 + load * abs(u)) * (stiff * y[2] + damped * rate + viscous * y[1])
            return [y[1], (u - friction) / mass, rate]

        return solve_ivp(moved, (0, sample), [x, v, z], method="LSODA", rtol=1e-10, atol=1e-14).y[:, -1]

    def slid(x, v, z, u):
        left, normal = sample, 1 + load * abs(u)
        while left > 0 and not (v == 0 and abs(u) <= normal * rest):
            way = np.sign(v) if v else np.sign(u)
            far = (u - way * normal * sliding) / (normal * viscous)
            tau = mass / (normal * viscous)
            stop = tau * np.log((v - far) / -far) if v and way * far < 0 else np.inf
            span = min(left, stop)
            x += far * span + (v - far) * tau * -np.expm1(-span / tau)
            v = far + (v - far) * np.exp(-span / tau) if span < stop else 0.0
            left -= span
        return x, v, z

    state, total, before, aim, queue, places = (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, [0.0] * delay, []
    for _ in range(round(until / sample)):
        x = state[0]
        places.append(x)
        seen = np.round(x / encoder) * encoder if encoder else x
        e = step - seen
        total = np.clip(total + sample * banded(e), -integral_limit / ki, integral_limit / ki)
        wide = (lambda e: e) if of_integral else banded
        rate = (before - seen) / sample if on_measurement else (wide(e) - wide(aim - before)) / sample
        queue.append(np.clip(kp * wide(e) + kd * rate + ki * total, -force, force))
        before, aim = seen, step
        state = (bristled if bristles else slid)(*state, queue.pop(0))
    return np.array(places)


SAMPLED = {
    "plain": {},
    "on the measurement": {"derivative": "measurement"},
    "an encoder": {"resolution": 1e-3, "derivative": "measurement"},
    "a limit": {"force_limit": 1.2, "integral_limit": 1.1},
    "a dead band": {"dead_band": 0.02},
    "a dead band of the integral": {"dead_band": 0.02, "dead_band_of": "integral"},
    "late": {"delay": 2},
    "a load": {"load": 0.3},
}
"""Options of a sampled controller: lengths in steps of the target, forces in friction at rest, delay in samples; and of
the contact: the share of the controller's force that presses it."""


def sampled(numbers, more, sample, until, bristles=None, rtol=1e-8):
    """Largest difference of the places at samples between the two routes, of the target's step; and the motion."""
    step = 2 * numbers["rest"] / numbers["kp"]
    units = dict.fromkeys(("force_limit", "integral_limit"), numbers["rest"])
    units |= {"resolution": step, "dead_band": step, "delay": sample}
    load = more.get("load", 0.0)
    more = {key: value for key, value in more.items() if key != "load"}
    given = {key: value if isinstance(value, str) else value * units[key] for key, value in more.items()}
    names = {"force_limit": "force", "integral_limit": "integral_limit", "dead_band": "band", "resolution": "encoder"}
    theirs = by_hand(
        step, until, **numbers, sample=sample, on_measurement="derivative" in more, of_integral="dead_band_of" in more,
        delay=more.get("delay", 0), bristles=bristles, load=load,
        **{names[key]: given[key] for key in given if key in names},
    )  # fmt: skip
    rig = axis(**numbers, sample_time=sample, **given)
    if load:
        rig = replace(rig, contact=ss.laws.Transmitted(preload=1.0, transmitted=load))
    if bristles:
        stiff, damped, slow = bristles
        law = ss.laws.LuGre(
            mu_coulomb=numbers["sliding"], mu_static=numbers["rest"], v_stribeck=slow, viscous=numbers["viscous"],
            bristle_stiffness=stiff, bristle_damping=damped,
        )  # fmt: skip
        rig = replace(rig, friction=law)
    found = ss.hunt(rig, ss.protocol.DisplacementStep(at=0, by=step), until=until, rtol=rtol)
    times = sample * np.arange(1, len(theirs))
    places = np.searchsorted(found.time, times - 1e-6 * sample)  # at rest not every sample is kept
    kept = np.abs(found.time[np.minimum(places, len(found.time) - 1)] - times) < 1e-6 * sample
    differences = np.abs(step - found.error[places[kept]] - theirs[1:][kept]) / step
    assert kept.sum() > 20
    return float(differences.max()), found


def sampled_at_random(random, kind, bristles=False, rtol=1e-8):
    """The same of a random axis with options of a kind."""
    numbers = random_axis(random)
    numbers["viscous"] = max(numbers["viscous"], 0.01)
    time = np.sqrt(numbers["mass"] / numbers["kp"])
    given = None
    if bristles:
        slow = numbers["rest"] / numbers["kp"] / time * float(10 ** random.uniform(-3, -1))
        stiff = numbers["kp"] * float(10 ** random.uniform(2, 4))
        given = (stiff, float(random.uniform(0, 1)) * np.sqrt(stiff * numbers["mass"]), slow)
    sample = time * float(10 ** random.uniform(-1.7, -0.7))
    return sampled(numbers, SAMPLED[kind], sample, (8 if bristles else 25) * time, given, rtol)[0]


def main(count, seed):
    worst = [compared(np.random.default_rng([seed, i])) for i in range(count)]
    print(f"{count} axes, seed {seed}: largest difference {max(worst):.2e}, median {np.median(worst):.2e}")
    print(f"beyond 1e-9: {[i for i, one in enumerate(worst) if one > 1e-9]}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
