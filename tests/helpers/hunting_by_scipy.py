"""Hunting by a second route: a mass under PID with Coulomb friction, larger at rest, by SciPy and by hand.

As a script: python tests/helpers/hunting_by_scipy.py 200 1 compares 200 random axes with seed 1.
"""

import sys

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss


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
):
    """Places at the samples of a sampled PID, spans of constant force by their formula; delay in samples."""

    def banded(e):
        return np.sign(e) * max(abs(e) - band, 0.0)

    x, v, total, before, aim, queue, places = 0.0, 0.0, 0.0, 0.0, 0.0, [0.0] * delay, []
    for _ in range(round(until / sample)):
        places.append(x)
        seen = np.round(x / encoder) * encoder if encoder else x
        e = step - seen
        total = np.clip(total + sample * banded(e), -integral_limit / ki, integral_limit / ki)
        wide = (lambda e: e) if of_integral else banded
        rate = (before - seen) / sample if on_measurement else (wide(e) - wide(aim - before)) / sample
        queue.append(np.clip(kp * wide(e) + kd * rate + ki * total, -force, force))
        u, before, aim, left = queue.pop(0), seen, step, sample
        while left > 0:
            if v == 0 and abs(u) <= rest:
                break
            way = np.sign(v) if v else np.sign(u)
            far = (u - way * sliding) / viscous
            tau = mass / viscous
            stop = tau * np.log((v - far) / -far) if v and way * far < 0 else np.inf
            span = min(left, stop)
            x += far * span + (v - far) * tau * -np.expm1(-span / tau)
            v = far + (v - far) * np.exp(-span / tau) if span < stop else 0.0
            left -= span
    return np.array(places)


def main(count, seed):
    worst = [compared(np.random.default_rng([seed, i])) for i in range(count)]
    print(f"{count} axes, seed {seed}: largest difference {max(worst):.2e}, median {np.median(worst):.2e}")
    print(f"beyond 1e-9: {[i for i, one in enumerate(worst) if one > 1e-9]}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
