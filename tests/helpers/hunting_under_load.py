"""Hunting with a normal force that follows a load, by a second route: SciPy from event to event, and samples by hand.

The axis is one body, whose contact the controller's force presses, or a motor with a table behind a spring whose force
presses the motor's contact. As a script: python tests/helpers/hunting_under_load.py 100 1 compares 100 random axes of
either kind, friction and controller with seed 1.
"""

import itertools
import sys

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss

KINDS = tuple(itertools.product(("slider", "machine"), ("coulomb", "viscous", "lugre"), ("continuous", "sampled")))
AHEAD = 1e-9  # of the time scale, between leaving rest and the first look for the next


def random_numbers(random, body, law, control):
    """Numbers of an axis that moves; lengths, times and masses of about one."""
    forward = float(random.uniform(0.0, 0.5))
    found = {
        "mass": float(random.uniform(0.5, 2.0)), "preload": float(random.uniform(0.2, 1.5)), "forward": forward,
        "back": forward if random.random() < 0.3 else float(random.uniform(0.0, 0.5)),
        "sliding": float(random.uniform(0.5, 0.9)), "viscous": 0.0, "kp": float(random.uniform(2.0, 6.0)),
        "kd": float(random.uniform(1.5, 4.0)), "ki": float(random.uniform(0.3, 1.5)), "sample": 0.0, "force": np.inf,
    }  # fmt: skip
    found["rest"] = found["sliding"] * float(random.uniform(1.05, 1.6))
    if random.random() < 0.3:
        found["force"] = float(random.uniform(1.5, 3.0)) * found["rest"] * found["preload"]
    if control == "sampled":
        found["sample"] = float(random.uniform(0.02, 0.1))
    if body == "machine":
        found |= {"table": float(random.uniform(0.3, 1.0)), "spring": float(random.uniform(20.0, 60.0)),
                  "damper": float(random.uniform(0.5, 1.5)), "pull": float(random.uniform(-0.3, 0.3))}  # fmt: skip
    if law == "viscous":
        found["viscous"] = float(random.uniform(0.1, 0.5))
    if law == "lugre":
        found |= {"stiff": float(10 ** random.uniform(2, 3)), "damped": float(random.uniform(3, 10)),
                  "slow": 1e-2, "viscous": float(random.uniform(0.1, 0.5))}  # fmt: skip
    return found


def rig_of(n):
    """The rig with these numbers."""
    if "stiff" in n:
        law = ss.laws.LuGre(
            mu_coulomb=n["sliding"], mu_static=n["rest"], v_stribeck=n["slow"], viscous=n["viscous"],
            bristle_stiffness=n["stiff"], bristle_damping=n["damped"],
        )  # fmt: skip
    else:
        law = ss.laws.Coulomb(mu_coulomb=n["sliding"], mu_static=n["rest"], viscous=n["viscous"])
    contact = ss.laws.Transmitted(preload=n["preload"], transmitted=n["forward"], transmitted_back=n["back"])
    more = {"sample_time": n["sample"] or None, "force_limit": n["force"] if np.isfinite(n["force"]) else None}
    gains = {name: n[name] for name in ("kp", "kd", "ki")}
    if "table" not in n:
        drive = ss.machine.PID(0.0, **gains, **more)
        return ss.Slider(friction=law, contact=contact, mass=n["mass"], area=1.0, drive=drive)
    m = ss.machine
    return ss.Machine(
        bodies={"motor": m.SlidingBody(mass=n["mass"]), "table": m.SlidingBody(mass=n["table"], force=n["pull"])},
        links={"belt": m.Spring(between=("motor", "table"), stiffness=n["spring"], damping=n["damper"])},
        contacts={"guide": m.Surface(body="motor", loaded_by="belt", friction=law, contact=contact)},
        drive=m.PositionPID(body="motor", velocity=0.0, **gains, **more),
    )  # fmt: skip


class Axis:
    """Equations of such an axis; the state is place and speed of the body, of the table, integral, bristles."""

    def __init__(self, numbers, step):
        self.n, self.step = numbers, step
        self.stuck = "stiff" not in numbers
        self.way = 0.0
        self.u = 0.0

    def force(self, y):
        n = self.n
        if n["sample"]:
            return self.u
        wanted = n["kp"] * (self.step - y[0]) - n["kd"] * y[1] + n["ki"] * y[4]
        return min(n["force"], max(-n["force"], wanted))

    def belt(self, y):
        return self.n["spring"] * (y[2] - y[0]) + self.n["damper"] * (y[3] - y[1]) if "table" in self.n else 0.0

    def normal(self, y):
        load = self.belt(y) if "table" in self.n else self.force(y)
        return self.n["preload"] + self.n["forward" if load > 0 else "back"] * abs(load)

    def pushed(self, y):
        """Force on the body but for friction."""
        return self.force(y) + self.belt(y)

    def rates(self, _, y):
        n, bristles = self.n, 0.0
        if "stiff" in n:
            g = n["sliding"] + (n["rest"] - n["sliding"]) * np.exp(-((y[1] / n["slow"]) ** 2))
            bristles = y[1] - n["stiff"] * abs(y[1]) * y[5] / g
            friction = self.normal(y) * (n["stiff"] * y[5] + n["damped"] * bristles + n["viscous"] * y[1])
        else:
            friction = (self.way * n["sliding"] + n["viscous"] * y[1]) * self.normal(y)
        moved = 0.0 if self.stuck else (self.pushed(y) - friction) / n["mass"]
        table = (n["pull"] - self.belt(y)) / n["table"] if "table" in n else 0.0
        integral = 0.0 if n["sample"] else self.step - y[0]
        return np.array([y[1], moved, y[3], table, integral, bristles])

    def run(self, y, start, end):
        """State at the end; Coulomb friction sticks and slides on the way."""
        time, options = start, {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853"}
        if "stiff" in self.n:
            run = solve_ivp(self.rates, (start, end), y, rtol=1e-10, atol=1e-13, method="Radau")
            return run.y[:, -1]
        while time < end:
            spare = self.n["rest"] * self.normal(y) - abs(self.pushed(y))
            if self.stuck and spare <= 0:
                self.stuck, self.way = False, float(np.sign(self.pushed(y)))

            def breaks(_, y):
                return self.n["rest"] * self.normal(y) - abs(self.pushed(y))

            def stops(_, y):
                return self.way * y[1]

            breaks.terminal = stops.terminal = True
            breaks.direction = stops.direction = -1
            event = breaks if self.stuck else stops
            if not self.stuck and y[1] == 0:  # the first moment, in which the event is at its zero
                ahead = min(AHEAD, end - time)
                run = solve_ivp(self.rates, (time, time + ahead), y, **options)
                time, y = run.t[-1], run.y[:, -1]
                continue
            run = solve_ivp(self.rates, (time, end), y, events=event, **options)
            time, y = run.t[-1], run.y[:, -1].copy()
            if run.t_events[0].size:
                time, y = run.t_events[0][0], run.y_events[0][0].copy()
                if self.stuck:
                    self.stuck, self.way = False, float(np.sign(self.pushed(y)))
                else:
                    y[1] = 0.0
                    self.stuck = self.n["rest"] * self.normal(y) >= abs(self.pushed(y))
                    self.way = float(np.sign(self.pushed(y)))
        return y

    def places(self, times, back):
        """Places of the body at the times, which are those of the samples if there are any; from the half on back."""
        n, y, found, before, aim = self.n, np.zeros(6), [0.0], 0.0, 0.0
        for i, (start, end) in enumerate(itertools.pairwise(times)):
            self.step += back if i == len(times) // 2 else 0.0
            if n["sample"]:
                error = self.step - y[0]
                y[4] += n["sample"] * error
                rate = (before - y[0] + self.step - aim) / n["sample"]
                wanted = n["kp"] * error + n["kd"] * rate + n["ki"] * y[4]
                self.u = min(n["force"], max(-n["force"], wanted))
                before, aim = y[0], self.step
            y = self.run(y, start, end)
            found.append(y[0])
        return np.array(found)


def compared(random, kind, until=12.0):
    """Largest difference of places between the two routes of a random axis, of the target's step; and the motion.

    The target steps forward, and back half of the time later.
    """
    found = list(_compared(random, kind, until))
    return max(one for one, _ in found), found[-1][1]


def _compared(random, kind, until):
    n = random_numbers(random, *kind)
    step = 2 * n["rest"] * n["preload"] / n["kp"]
    back = -float(random.uniform(0.3, 2.0)) * step
    times = np.arange(0.0, until, n["sample"] or until / 40)
    half = float(times[len(times) // 2])
    theirs = Axis(n, step).places(times, back)
    steps = [ss.protocol.DisplacementStep(at=0, by=step), ss.protocol.DisplacementStep(at=half, by=back)]
    ends = [until] if n["sample"] else times[5::12]
    for end in ends:
        found = ss.hunt(rig_of(n), steps if end > half else steps[:1], until=end, rtol=1e-10)
        target = step + back * (found.time > half)
        ours = np.interp(times, found.time, target - found.error) if found.time.size else np.zeros(len(times))
        which = (times < end) & (times != half) if n["sample"] else times == end
        yield float(np.abs(ours - theirs)[which].max() / step), found


def main(count, seed):
    for kind in KINDS:
        found = [compared(np.random.default_rng([seed, i]), kind)[0] for i in range(count)]
        print(f"{' '.join(kind)}: {count} axes, largest difference {max(found):.2e}, of axis {np.argmax(found)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
