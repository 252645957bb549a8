"""Random machines told in other units of length, force and time, or with their members in another order.

What comes of them is the same. ``python tests/helpers/scaled_machines.py COUNT SEED`` does many by hand.
"""

import sys

import numpy as np

import steadyslip as ss
from steadyslip.nonlinear.kicks.kicks import Kicked

KICKS = np.array([0.1, 0.5, 1.0, 2.0, 4.0, 8.0])  # of ln(velocity)
ALONG = "links.pull.stiffness"


def drawn(random):
    """Numbers of a chain of two bodies, the second of which slides; its pulling spring is near its edge."""
    return {
        "masses": random.uniform(0.02, 0.5, 2),
        "damping": random.uniform(0.01, 0.1),
        "stiffness": random.uniform(0.5, 5.0),
        "above": random.uniform(1.05, 1.6),  # times the edge
        "a": random.uniform(0.05, 0.2),
        "falls": random.uniform(0.2, 0.8),
        "evolution": (ss.laws.Slip(), ss.laws.Aging())[int(random.integers(2))],
    }


def built(numbers, length=1.0, force=1.0, time=1.0, turned=False, pull=1.0):
    """The machine of some numbers, in units so many metres, newtons and seconds large."""
    mass, rate = force * time**2 / length, length / time
    friction = ss.laws.RateState(
        a=numbers["a"], b=numbers["a"] * (1 + numbers["falls"]), d_c=length, mu_ref=0.6, v_ref=rate,
        evolution=numbers["evolution"],
    )  # fmt: skip
    bodies = {
        name: ss.machine.SlidingBody(mass=own * mass)
        for name, own in zip(("front", "back"), numbers["masses"], strict=True)
    }
    links = {
        "pull": ss.machine.Spring(between=("drive", "front"), stiffness=pull * force / length),
        "bar": ss.machine.Spring(
            between=("front", "back"), stiffness=numbers["stiffness"] * force / length,
            damping=numbers["damping"] * force / rate,
        ),
    }  # fmt: skip
    if turned:
        bodies, links = dict(reversed(bodies.items())), dict(reversed(links.items()))
    contacts = {
        "guide": ss.machine.Surface(body="back", friction=friction, contact=ss.laws.ConstantNormalStress(preload=force))
    }
    return ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=rate))


def answers(numbers, **units):
    """Onset, cycles and what comes of kicks, without units; None where there is no oscillatory edge."""
    length, force, time = (units.get(name, 1.0) for name in ("length", "force", "time"))
    machine = built(numbers, **units)
    try:
        onset = ss.hopf(machine, ALONG)
    except ss.NotAvailable:
        return None
    edge = onset.value * length / force
    machine = built(
        numbers, **units, pull=edge * (numbers["above"] if onset.stable == "above" else 1 / numbers["above"])
    )
    branch = ss.cycles(machine, ALONG, amplitude=1e-2, most_points=5, doublings=0)
    cycles = [
        (one.value * length / force, one.period / time, one.peak_velocity * time / length) for one in branch.cycles
    ]
    kicked = Kicked(machine, "velocity", 1, "before", {}, 0, None, None)
    outcomes = kicked.outcomes(np.zeros(len(KICKS), dtype=int), KICKS, effort=1.0)
    return edge, onset.normalised, np.array(cycles), outcomes


def apart(own, other):
    """The largest relative difference of answers; infinite where they are of different kinds."""
    if own is None or other is None:
        return 0.0 if own is other else np.inf
    if own[2].shape != other[2].shape or np.any(own[3] != other[3]):
        return np.inf
    numbers = np.array([*own[:2], *own[2].ravel()]), np.array([*other[:2], *other[2].ravel()])
    return float(np.max(np.abs(numbers[0] / numbers[1] - 1)))


def same(random):
    """Numbers of a random machine, its units, and largest change of its answers in other units and order."""
    numbers = drawn(random)
    length, force, time = 10.0 ** random.uniform(-6, 4, 3)
    own = answers(numbers)
    return (
        numbers,
        (length, force, time),
        max(
            apart(own, answers(numbers, length=length, force=force, time=time)),
            apart(own, answers(numbers, turned=True)),
        ),
    )


def main(count, seed):
    random, worst = np.random.default_rng(seed), 0.0
    for i in range(count):
        numbers, units, off = same(random)
        worst = max(worst, off if np.isfinite(off) else 0.0)
        if off > 1e-5:
            print("SCALED", i, off, units, numbers, flush=True)
    print(f"{count} machines, largest difference {worst:.2g}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
