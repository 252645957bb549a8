"""Random machines with bodies without mass on which a controller acts late, and the count of their growing roots by an
equation typed here: the matrix of a chain of bodies, in s and z = exp(−s delay), and how its determinant winds.

``python tests/helpers/late_light_machines.py COUNT SEED`` compares status and edges of many with that count.
"""

import sys

import numpy as np

import steadyslip as ss
from counting import count_differences
from steadyslip.core.errors import SteadyslipError

INFINITE = -1  # count where infinitely many roots grow
NAMES = ("drive.kp", "drive.kd", "drive.ki", "drive.kv", "drive.delay", "links.l0.stiffness", "links.l0.damping",
         "links.l1.damping", "bodies.b0.mass")  # fmt: skip


def drawn(seed):
    """A chain of one to three bodies between a controller and the ground, at most one of them with mass, none damped
    with certainty."""
    chance = np.random.default_rng(seed)

    def size(low=-1.0, high=1.0):
        return float(10 ** chance.uniform(low, high))

    def some(share, *ends):
        return size(*ends) if chance.random() < share else 0.0

    count = int(chance.integers(1, 4))
    mass = [some(0.5) for _ in range(count)]
    mass[0] = 0.0
    links, oil = {}, some(0.6)
    if chance.random() < 0.4:
        links["l0"] = ss.machine.Spring(between=("drive", "b0"), stiffness=size(), damping=oil)
    elif oil:
        links["l0"] = ss.machine.Spring(between=("ground", "b0"), damping=oil)
    for i in range(1, count):
        links[f"l{i}"] = ss.machine.Spring(between=(f"b{i - 1}", f"b{i}"), stiffness=size(), damping=some(0.5))
    touched = [i for i in range(count) if chance.random() < 0.5 or i == count - 1]
    contacts = {}
    for i in touched:
        level = chance.uniform(0.2, 0.5)
        if chance.random() < 0.5:
            law = ss.laws.RateState(a=size(-2, -1), b=size(-2, -1), d_c=size(), mu_ref=level, v_ref=1.0)
        else:
            law = ss.laws.CoulombStribeck(
                mu_coulomb=level, mu_static=level + size(-2, -1), v_stribeck=size(-0.3, 0.5), viscous=size(-2, 0)
            )
        contacts[f"c{i}"] = ss.machine.Surface(
            body=f"b{i}", friction=law, contact=ss.laws.ConstantNormalStress(preload=size())
        )
    seen, speed = (f"b{int(chance.integers(0, count))}" for _ in range(2))
    given = {
        "velocity": 1.0, "body": "b0", "measured": seen, "velocity_of": speed, "kp": size(), "kd": some(0.7),
        "delay": size(-1.5, 0.7),
    }  # fmt: skip
    kind = chance.random()
    if kind < 0.2:
        given = {name: one for name, one in given.items() if name not in ("velocity_of", "kd")}
        drive = ss.machine.Cascade(**given, speed_measured=speed, kv=size(), tn=size())
    else:
        drive = ss.machine.PositionPID(**given, ki=size()) if kind < 0.4 else ss.machine.PositionPD(**given)
    bodies = {f"b{i}": ss.machine.SlidingBody(mass=m) for i, m in enumerate(mass)}
    return ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=drive)


def friction(law, load, s):
    """Friction force over displacement, of a law that slides at 1 m/s under a load."""
    if isinstance(law, ss.laws.RateState):
        return load * s * (law.a - law.b / (1 + s * law.d_c))
    part = (law.mu_static - law.mu_coulomb) * np.exp(-(1 / law.v_stribeck**2))
    return load * s * (law.viscous - 2 * part / law.v_stribeck**2)


def determinant(machine, s, z):
    """Determinant of the chain's matrix at s (...), z (...) in place of exp(−s delay), times its denominators."""
    bodies = list(machine.bodies)
    at = {name: i for i, name in enumerate(bodies)}
    matrix = np.zeros((*np.shape(s), len(bodies), len(bodies)), dtype=complex)
    for name, body in machine.bodies.items():
        matrix[..., at[name], at[name]] += body.mass * s * s
    for link in machine.links.values():
        pulls = (link.stiffness or 0.0) + link.damping * s
        ends = [at[end] for end in link.between if end in at]
        for i in ends:
            for j in ends:
                matrix[..., i, j] += pulls if i == j else -pulls
    for touch in machine.contacts.values():
        i = at[touch.body]
        matrix[..., i, i] += friction(touch.friction, touch.contact.preload, s)
    drive = machine.drive
    if not isinstance(drive, ss.machine.Pull):
        place, speed = gains(drive, s)
        matrix[..., at[drive.body], at[drive.measured or drive.body]] += place * z
        matrix[..., at[drive.body], at[seen_speed(drive)]] += speed * z
    poles = [s] if isinstance(drive, (ss.machine.PositionPID, ss.machine.Cascade)) else []
    poles += [1 + s * touch.friction.d_c for touch in machine.contacts.values() if hasattr(touch.friction, "d_c")]
    return np.linalg.det(matrix) * np.prod(poles, axis=0)


def gains(drive, s):
    """Force of a controller over the place, and over the place whose speed it measures."""
    if isinstance(drive, ss.machine.Cascade):
        integral = 1 + 1 / (drive.tn * s)
        return drive.kp * drive.kv * integral, drive.kp * s * integral
    return drive.kp + getattr(drive, "ki", 0.0) / s, drive.kd * s


def seen_speed(drive):
    """Body whose speed a controller measures."""
    if isinstance(drive, ss.machine.Cascade):
        return drive.speed_measured or drive.body
    return drive.velocity_of or drive.measured or drive.body


def growing(machine, rate=0.0):
    """Number of roots right of Re s = `rate` (1/s), `INFINITE` if infinitely many; None where this count is not sure.

    det ~ sⁿ (a + b z) at large s. The argument of det/[(s + 1)ⁿ] is followed along it; beyond, a + b z returns to
    a on the way to infinite Re s as |b z| < |a|.
    """
    delay = machine.drive.delay
    far = 1e12 * np.array([1.0, 2.0])
    ends = [determinant(machine, far, np.full(2, z)) for z in (0.0, 1.0, -1.0)]
    degree = round(max(np.log2(abs(one[1] / one[0])) for one in ends if np.all(one)))
    a = (ends[0][1] / far[1] ** degree).real
    b = ((ends[1][1] - ends[2][1]) / (2 * far[1] ** degree)).real
    b *= np.exp(-rate * delay)
    if abs(a) < 1e-5 * abs(b):
        return INFINITE
    if abs(abs(b) - abs(a)) < 1e-3 * abs(a):
        return None
    if abs(b) > abs(a) or a < 0:
        return INFINITE

    def at(omega):
        s = rate + 1j * omega
        return determinant(machine, s, np.exp(-s * delay)) / (1j * omega + 1) ** degree

    end = 10.0
    while True:
        some = end * (1 + np.linspace(0, 1, 50))
        limit = a + b * np.exp(-1j * some * delay)
        if np.all(np.abs(at(some) - limit) < 0.05 * (abs(a) - abs(b))):
            break
        end *= 2
        if end * delay > 1e5 or end > 1e7:
            return None
    omega = np.unique(
        np.concatenate([np.geomspace(1e-9, end, 20000), np.linspace(0, end, int(end * delay * 20) + 2)[1:]])
    )
    value = at(omega)
    for _ in range(20):
        steps = np.angle(value[1:] / value[:-1])
        rough = np.flatnonzero(np.abs(steps) > 0.5)
        if not len(rough):
            break
        middle = 0.5 * (omega[rough] + omega[rough + 1])
        omega, value = np.insert(omega, rough + 1, middle), np.insert(value, rough + 1, at(middle))
    else:
        return None  # a root on the axis, or next to it
    total = np.sum(steps) + np.angle(a / value[-1])
    found = -total / np.pi
    return round(found) if abs(found - round(found)) < 1e-3 else None


def status(machine):
    """Status, None where the count is not sure."""
    found = growing(with_little_mass(machine))
    return None if found is None else "stable" if found == 0 else "unstable"


def with_little_mass(machine):
    """The machine, where the controller pulls at what it measures and only springs hold, with masses as good as none.

    Their oscillation on the springs turns some hundred times during the delay, and a late pull changes it at once.
    """
    drive, names = machine.drive, list(machine.bodies)
    light = np.array([body.mass == 0 for body in machine.bodies.values()])
    held = np.diag(~light) * 1.0  # what resists velocities of bodies without mass
    for link in machine.links.values():
        row = np.array([(name == link.between[1]) * 1.0 - (name == link.between[0]) for name in names]) * light
        held += link.damping * np.outer(row, row)
    for touch in machine.contacts.values():
        held[names.index(touch.body), names.index(touch.body)] += 1.0
    sizes, ways = np.linalg.eigh(held)
    free = ways[:, sizes < 1e-9]
    place, speed = gains(drive, 1e9)
    pull = free[names.index(drive.body)] * abs(place)
    if not np.any(pull @ free[names.index(drive.measured or drive.body)]) or free[names.index(seen_speed(drive))] @ (
        free[names.index(drive.body)] * abs(speed)
    ):
        return machine
    stiffness = sum(one.stiffness or 0.0 for one in machine.links.values())
    mass = 1e-3 * min(abs(place), stiffness) ** 2 * drive.delay**2 / stiffness
    return machine.with_values(
        {f"bodies.{name}.mass": mass for name, one in zip(names, np.any(free, axis=1), strict=True) if one}
    )


def rate_differences(seed, machine):
    """Words where there are roots right of the growth rate told, or none left of it next to it."""
    rate = float(ss.growth_rate(machine))
    if not np.isfinite(rate):
        own = growing(with_little_mass(machine))
        right = own is None or (own if rate > 0 else not own)
        return [] if right else [f"{seed}: rate {rate}, {own} roots grow"]
    right, left = (growing(machine, rate + way * 1e-3 * abs(rate)) for way in (1, -1))
    return [f"{seed}: rate {rate}: {right} and {left} roots right of it"] if right or left == 0 else []


def differences(seed):
    """Number of comparisons, and words on each that differs."""
    machine = drawn(seed)
    compared, wrong = 0, []

    def compare(what, said, own):
        nonlocal compared
        if own is not None and said in ("stable", "unstable"):
            compared += 1
            if said != own:
                wrong.append(f"{seed}: {what}: {said}, not {own}")

    try:
        compare("status", ss.stability(machine), status(machine))
    except SteadyslipError as error:
        return 0, [f"{seed}: {error}"]
    wrong += rate_differences(seed, machine)
    known = machine.parameters()
    for name in NAMES:
        if name not in known or not known[name].value:
            continue
        try:
            edges = ss.boundary(machine, name)
        except SteadyslipError as error:
            print(f"{seed}: {name}: {error}")
            continue
        value = known[name].value
        places = value * np.geomspace(1e-2, 1e2, 13)
        said = ss.stability(machine, {name: places})
        sides = np.array([one.value for one in edges])
        for place, by_count in zip(places, said, strict=True):
            own = status(machine.with_values({name: place}))
            compare(f"{name} = {place:.6g}", by_count, own)
            above, below = sides[sides > place], sides[sides < place]
            words = [edges[list(sides).index(above[0])].stable] if len(above) else []
            by_edges = {"below": "stable"}.get(words[0], "unstable") if words else None
            if by_edges is None and len(below):
                by_edges = "stable" if edges[-1].stable == "above" else "unstable"
            compare(f"{name} = {place:.6g} by its edges {sides}", by_edges or ss.stability(machine), own)
    return compared, wrong


if __name__ == "__main__":
    count_differences(differences, *map(int, sys.argv[1:3]))
