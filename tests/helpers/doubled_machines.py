"""Random machines of two bodies with unlike laws, whose cycles may double their period below the edge.

``python tests/helpers/doubled_machines.py COUNT SEED`` does many by hand, with ``otherwise`` behind of other laws.
"""

import sys

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss

ALONG = "links.l0.stiffness"


def drawn(random):
    """A chain of two bodies that slide with friction of two kinds, the first pulled by a spring of little damping.

    The second is the bristle model, at speeds below that of Stribeck; stiffness and masses are such that the chain
    rings about once while a bristle bends.
    """
    v = 10 ** random.uniform(-4, -2)
    first, second = rate_state(random, v), lugre(random, v)
    loads = 10 ** random.uniform(0.5, 2, size=2)
    bend = second.mu_static / second.bristle_stiffness
    stiff = second.bristle_stiffness * loads[1] * 10 ** random.uniform(-1, 0.3, size=2) * (1.0, 4.0)
    mass = stiff[0] * (bend / v) ** 2 * 10 ** random.uniform(-2.5, -0.5, size=2)
    damping = 10 ** random.uniform(-2.5, -1.3, size=2) * np.sqrt(stiff * mass.min())
    return chain(v, (first, second), loads, stiff, mass, damping)


def drawn_otherwise(random):
    """Such a chain of another pair: bristles first, or two states before bristles or before rate-and-state friction."""
    v, kind = 10 ** random.uniform(-4, -2), int(random.integers(3))
    loads = 10 ** random.uniform(0.5, 2, size=2)
    if kind == 0:
        first, second = lugre(random, v), rate_state(random, v)
        length = first.mu_static / first.bristle_stiffness
        stiff = first.bristle_stiffness * loads[0] * 10 ** random.uniform(-1, 0.3, size=2) * (1.0, 4.0)
    else:
        a, length = random.uniform(0.005, 0.02), 10 ** random.uniform(-6, -5)
        b = a * random.uniform(1.0, 2.0), a * random.uniform(0.3, 1.0)
        d_c = length, length * 10 ** random.uniform(0.5, 2)
        states = tuple(ss.laws.State(b=one, d_c=d) for one, d in zip(b, d_c, strict=True))
        first = ss.laws.RateState(a=a, mu_ref=0.6, v_ref=v, evolution=ss.laws.Slip(), states=states)
        stiff = (sum(b) - a) * loads[0] / np.sqrt(d_c[0] * d_c[1]) * 10 ** random.uniform(-0.3, 1, size=2)
        second = lugre(random, v) if kind == 1 else one_state(random, v, a, length)
        loads[1] = loads[0] * 10 ** random.uniform(-1, 0.3)
    mass = stiff[0] * (length / v) ** 2 * 10 ** random.uniform(-2.5, -0.5, size=2)
    damping = 10 ** random.uniform(-2.5, -1.3, size=2) * np.sqrt(stiff * mass.min())
    return chain(v, (first, second), loads, stiff, mass, damping)


def chain(v, laws, loads, stiff, mass, damping):
    """The machine of two bodies p and q, in this order behind the drive."""
    contacts = {
        name: ss.machine.Surface(body=body, friction=law, contact=ss.laws.ConstantNormalStress(preload=load))
        for name, body, law, load in zip(("cp", "cq"), "pq", laws, loads, strict=True)
    }
    links = {
        name: ss.machine.Spring(between=ends, stiffness=k, damping=c)
        for name, ends, k, c in zip(("l0", "l1"), (("drive", "p"), ("p", "q")), stiff, damping, strict=True)
    }
    bodies = {name: ss.machine.SlidingBody(mass=m) for name, m in zip("pq", mass, strict=True)}
    return ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=v))


def one_state(random, v, a, d_c):
    """Rate-and-state friction with healing at rest."""
    own = {
        "a": a * random.uniform(0.7, 2),
        "b": a * random.uniform(0.3, 2),
        "d_c": d_c * 10 ** random.uniform(-0.5, 1.5),
    }
    mu_ref = random.uniform(0.4, 0.7)
    evolution = (ss.laws.Aging(), ss.laws.PRZ())[int(random.integers(2))]
    return ss.laws.RateState(**own, mu_ref=mu_ref, v_ref=v, evolution=evolution)


def rate_state(random, v):
    """Rate-and-state friction, by slip of one state or of two, or of Perrin, Rice and Zheng."""
    a, d_c = random.uniform(0.005, 0.02), 10 ** random.uniform(-6, -5)
    b = a * (1 + random.uniform(0.2, 1.5))
    more = {"b": b, "d_c": d_c}
    kind = int(random.integers(3))
    if kind == 2:
        states = ss.laws.State(b=0.6 * b, d_c=d_c), ss.laws.State(b=0.4 * b, d_c=d_c * 10 ** random.uniform(0.3, 1.3))
        more = {"states": states}
    evolution = (ss.laws.Slip(), ss.laws.PRZ(), ss.laws.Slip())[kind]
    return ss.laws.RateState(a=a, mu_ref=random.uniform(0.4, 0.7), v_ref=v, evolution=evolution, **more)


def lugre(random, v):
    """Bristles at speeds around that of Stribeck."""
    static = random.uniform(0.3, 0.6)
    return ss.laws.LuGre(
        mu_coulomb=static * random.uniform(0.6, 0.9), mu_static=static, v_stribeck=v * 10 ** random.uniform(-0.1, 0.6),
        bristle_stiffness=10 ** random.uniform(4, 5.5), bristle_damping=10 ** random.uniform(0.3, 1.2),
        viscous=10 ** random.uniform(-3, -2) / v, stribeck_exponent=1.0,
    )  # fmt: skip


def right_hand_side(machine):
    """Rates of motion of such a machine, typed by hand: places from those in steady sliding, velocities, memories."""
    first, second = (machine.contacts[name] for name in ("cp", "cq"))
    own, bristles = first.friction, second.friction
    masses = np.array([machine.bodies[name].mass for name in "pq"])
    pull, bar, v0 = machine.links["l0"], machine.links["l1"], machine.drive.velocity
    states = own.states or (ss.laws.State(b=own.b, d_c=own.d_c),)
    b, d_c = np.array([one.b for one in states]), np.array([one.d_c for one in states])

    def frictions(v, theta, bend):
        log_v = np.log(v[0] / own.v_ref)
        change = -v[0] / d_c * (log_v + theta)
        if isinstance(own.evolution, ss.laws.PRZ):  # dθ/dt = 1 - (vθ/2d_c)², Θ = ln(v* θ/2 d_c)
            change = own.v_ref / (2 * d_c) * np.exp(-theta) * (1 - np.exp(2 * (log_v + theta)))
        dry = first.contact.preload * (own.mu_ref + own.a * log_v + b @ theta)
        fall = np.exp(-(abs(v[1] / bristles.v_stribeck) ** bristles.stribeck_exponent))
        limit = bristles.mu_coulomb + (bristles.mu_static - bristles.mu_coulomb) * fall
        bending = v[1] - bristles.bristle_stiffness * abs(v[1]) / limit * bend
        wet = bristles.bristle_stiffness * bend + bristles.bristle_damping * bending + bristles.viscous * v[1]
        return dry, second.contact.preload * wet, np.append(change, bending), limit / bristles.bristle_stiffness

    straight = np.array([v0, v0])
    steady = np.full(len(states), -np.log(v0 / own.v_ref))
    dry_0, wet_0, *_ = frictions(straight, steady, frictions(straight, steady, 0.0)[3])

    def rates(_time, y):
        x, v = y[:2], y[2:4]
        dry, wet, memories, _ = frictions(v, y[4:-1], y[-1])
        pulled = dry_0 + wet_0 - pull.stiffness * x[0] - pull.damping * (v[0] - v0)
        drawn_on = wet_0 - bar.stiffness * (x[1] - x[0]) - bar.damping * (v[1] - v[0])
        return np.concatenate([v - v0, np.array([pulled - drawn_on - dry, drawn_on - wet]) / masses, memories])

    return rates


def closing(machine, cycle):
    """Distance of the end of one period from its start, by SciPy: as a share of what each variable goes through."""
    start = np.array(list(cycle.start.values()))
    order = [0, 2, 1, 3, *range(4, len(start))]  # places, velocities, memories
    done = solve_ivp(
        right_hand_side(machine), (0, cycle.period), start[order], method="Radau", rtol=1e-10,
        atol=1e-10 * np.abs(start[order]),
    )  # fmt: skip
    assert done.success
    return float(np.max(np.abs(done.y[:, -1] - done.y[:, 0]) / np.ptp(done.y, axis=1)))


def places(branch, many):
    """Values of the parameter between a period doubling and the next, or the end of the branch."""
    flips = [point.cycle.value for point in branch.special if point.kind == "period doubling"]
    ends = [*flips, branch.bounds[-1][1].value]
    shares = (np.arange(many) + 0.5) / many
    return [low + share * (high - low) for low, high in zip(ends[::2], ends[1::2], strict=False) for share in shares]


def judged(branch, value):
    """Result of `at` at a value, its stable cycles, and True if one cycle has twice the period."""
    found = branch.at(value)
    return found, [cycle for cycle in found if cycle.stable], 2 in found.multiples


def folds_without_multiplier_one(branch):
    """Folds, of a branch and its doublings, at which no multiplier is 1 to a thousandth: there is none."""
    return [
        one.cycle.value for level in (branch, branch.doubled) for one in level.special
        if one.kind == "fold" and min(abs(m - 1) for m in one.cycle.multipliers) > 1e-3
    ]  # fmt: skip


def main(count, seed, otherwise="", many=7):
    """Machines with doublings, until there are so many."""
    number = {"places": 0, "twice": 0, "other": 0, "in words": 0, "silent": 0, "machines": 0}
    while number["machines"] < count:
        seed += 1
        machine = (drawn_otherwise if otherwise else drawn)(np.random.default_rng(seed))
        try:
            onset = ss.hopf(machine, ALONG)
            low, high = (0.4, 1.05) if onset.stable == "above" else (0.95, 2.5)
            branch = ss.cycles(machine, ALONG, between=(low * onset.value, high * onset.value))
        except ss.NotAvailable:
            continue
        if branch.doubled is None:
            continue
        number["machines"] += 1
        told, worst = [], 0.0
        for value in places(branch, many):
            found, stable, twice = judged(branch, value)
            what = "twice" if twice else "other" if stable else "in words" if found.simulated else "silent"
            number[what] += 1
            number["places"] += 1
            told += [] if twice else [f"    {value / onset.value:.4f} {line}" for line in str(found).splitlines()]
            at = machine.with_values({ALONG: value})
            worst = max([worst, *(closing(at, cycle) for cycle in stable if not otherwise)])
        flips = [one.cycle.value / onset.value for one in branch.special if one.kind == "period doubling"]
        ends = [[end.kind for end in pair] for pair in branch.doubled.bounds]
        words = *branch.doubled.broken, branch.doubled.end
        print(
            seed, np.round(flips, 4), ends, *words, f"closing {worst:.1g}", folds_without_multiplier_one(branch) or ""
        )
        print("\n".join([*told, f"    {number}"]), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
