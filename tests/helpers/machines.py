"""Machines of theory 11 and others, for tests."""

from dataclasses import replace

import numpy as np

import steadyslip as ss

BLOCK = """
[bodies.block]
motion = "plane"
mass = 1
press = 10
[links.one]
between = ["drive", "block"]
angle = "30 deg"
stiffness = 3.6666666666666665
[links.two]
between = ["drive", "block"]
angle = "-30 deg"
stiffness = 1
[contacts.belt]
body = "block"
[contacts.belt.friction]
law = "coulomb"
mu_coulomb = 0.5
[contacts.belt.contact]
law = "compliant"
normal_stiffness = 1.3333333333333333
[drive]
control = "steady"
velocity = 1
"""
ALONG = '[links.along]\nbetween = ["drive", "block"]\ndamping = {}\n'
ACROSS = '[links.across]\nbetween = ["ground", "block"]\ndirection = "normal"\ndamping = {}\n'


def block(*more, contact=0.0):
    """Block of Hoffmann & Gaul (theory 13), with further tables and the damping of its contact."""
    return ss.rig_from_text("\n".join([BLOCK, *more])).with_values({"normal_damping": contact})


def undamped_at_random(seed):
    """Block of Hoffmann & Gaul on two random springs, for odd seeds with a second body that hangs on it."""
    chance = np.random.default_rng(seed)

    def spring(*ends, angle=0.0):
        return ss.machine.Spring(between=ends, stiffness=float(chance.uniform(0.5, 5)), angle=angle)

    bodies = {"block": ss.machine.PlanarBody(mass=float(chance.uniform(0.5, 2)), press=float(chance.uniform(5, 20)))}
    angles = chance.uniform(0.1, 1.4), -chance.uniform(0.1, 1.4)
    links = {name: spring("drive", "block", angle=float(angle)) for name, angle in zip("ab", angles, strict=True)}
    if seed % 2:
        bodies["arm"] = ss.machine.SlidingBody(mass=float(chance.uniform(0.5, 2)))
        links["c"] = spring("block", "arm")
    law = ss.laws.Coulomb(mu_coulomb=float(chance.uniform(0.05, 0.8)))
    held = ss.laws.Compliant(normal_stiffness=float(chance.uniform(0.3, 3)))
    belt = ss.machine.Surface(body="block", friction=law, contact=held)
    return ss.Machine(bodies=bodies, links=links, contacts={"belt": belt}, drive=ss.machine.Pull(velocity=1.0))


def leading(machine):
    return ss.eigenvalues(machine)[0]


def rate_state(f, slope, r, mu=0.6, load=1.0, **further):
    """Friction with theory's f, S and r at unit velocity under a load."""
    return ss.laws.RateState(a=f / load, b=(f - slope) / load, d_c=1 / r, mu_ref=mu, v_ref=1.0, **further)


def coulomb(mu):
    return ss.laws.CoulombStribeck(mu_coulomb=mu, mu_static=mu, v_stribeck=1.0)


def surface(body, friction, load=1.0, **further):
    return ss.machine.Surface(
        body=body, friction=friction, contact=ss.laws.ConstantNormalStress(preload=load), **further
    )


def two_mass(kp=1.0, kd=0.1, measured=None, friction=None):
    """The feed axis of theory 11."""
    return ss.Machine(
        bodies={"motor": ss.machine.SlidingBody(mass=2.0), "table": ss.machine.SlidingBody(mass=5.0)},
        links={"screw": ss.machine.Spring(between=("motor", "table"), stiffness=100.0, damping=0.5)},
        contacts={"guide": surface("table", friction or rate_state(0.5, -0.3, 1.0))},
        drive=ss.machine.PositionPD(velocity=1.0, body="motor", measured=measured, kp=kp, kd=kd),
    )


def two_blocks(k, second_slope, coupling):
    """Two blocks on a common load point, coupled by a spring."""
    return ss.Machine(
        bodies={"one": ss.machine.SlidingBody(mass=0.1), "two": ss.machine.SlidingBody(mass=0.1)},
        links={
            "first": ss.machine.Spring(between=("drive", "one"), stiffness=k),
            "second": ss.machine.Spring(between=("drive", "two"), stiffness=k),
            "between": ss.machine.Spring(between=("one", "two"), stiffness=coupling),
        },
        contacts={
            "one": surface("one", rate_state(2.0, -0.5, 1.0)),
            "two": surface("two", rate_state(2.0, second_slope, 1.0)),
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def brake(friction, k1=1.0, press=1.0):
    """Mode coupling of theory 11: stiffness k1 along the slide, k2 = 1.2 normal, coupled by k12 = 0.3."""
    to = ("drive", "pad")
    return ss.Machine(
        bodies={"pad": ss.machine.PlanarBody(mass=1.0, press=press)},
        links={
            "arm": ss.machine.Spring(between=to, stiffness=k1 - 0.3),
            "lining": ss.machine.Spring(between=to, stiffness=0.1, direction="normal"),
            "caliper": ss.machine.Spring(between=to, stiffness=0.6, angle=np.pi / 4),
        },
        contacts={
            "disc": ss.machine.Surface(body="pad", friction=friction, contact=ss.laws.Compliant(normal_stiffness=0.8))
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def stacked_pads(count, mass=1.0, slope=-0.02):
    """Pads that a drive pulls, each by the one before, along the slide and at an angle."""
    names = [f"pad{i}" for i in range(count)]
    links = {}
    for before, name in zip(["drive", *names], names, strict=False):
        links[f"along-{name}"] = ss.machine.Spring(between=(before, name), stiffness=50.0, damping=0.5)
        links[f"aslant-{name}"] = ss.machine.Spring(between=(before, name), stiffness=20.0, damping=0.2, angle=0.5)
    friction = rate_state(0.05, slope, 2.0, mu=0.4)
    touch = ss.laws.Compliant(normal_stiffness=30.0, normal_damping=0.1)
    return ss.Machine(
        bodies={name: ss.machine.PlanarBody(mass=mass * (i + 1), press=5.0) for i, name in enumerate(names)},
        links=links,
        contacts={f"at-{name}": ss.machine.Surface(body=name, friction=friction, contact=touch) for name in names},
        drive=ss.machine.Pull(velocity=1.0),
    )


def three_bodies():
    """Motor, screw and table with a carriage on two guides: the machine whose speed is measured."""
    deep = {"normal_memory": ss.laws.LinkerDieterich(alpha=0.2, sigma_ref=1.0)}
    return ss.Machine(
        bodies={
            "motor": ss.machine.RotatingBody(inertia=0.5),
            "table": ss.machine.SlidingBody(mass=5.0),
            "head": ss.machine.SlidingBody(mass=1.0),
        },
        links={
            "screw": ss.machine.Screw(between=("motor", "table"), lead=0.5, stiffness=100.0, damping=0.5),
            "column": ss.machine.Spring(between=("table", "head"), stiffness=300.0, damping=0.2),
            "hose": ss.machine.Spring(between=("ground", "table"), damping=0.3),
        },
        contacts={
            "left": surface("table", rate_state(0.5, -0.3, 1.0)),
            "right": surface("table", rate_state(0.4, -0.1, 2.0, **deep)),
            "seal": surface("head", rate_state(0.1, 0.05, 1.0)),
        },
        drive=ss.machine.RotaryPD(velocity=2.0, body="motor", kp=2.0, kd=0.3),
    )


def at_random(seed, delay=0.0):
    """A machine of one to four bodies, and theory 11's matrix of it typed with NumPy: a function of s.

    With a delay it has a controller that acts that late.
    """
    random = np.random.default_rng(seed)

    def size(low=-1.0, high=1.0):
        return float(10 ** random.uniform(low, high))

    count, posts = int(random.integers(1, 4)), int(random.integers(0, 2))
    names = [f"b{i}" for i in range(count)] + ["post"] * posts
    n = len(names)
    mass = np.array([size() if random.random() < 0.8 else 0.0 for _ in names])
    stiff, damp = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2))  # with the ground and the drive
    links, ends = {}, {**{name: i for i, name in enumerate(names)}, "ground": n, "drive": n + 1}
    pull = np.zeros((n, n), dtype=object)  # what pulls at each body, in the columns of all: (k, c)

    def link(a, b, k, c):
        spring = {"stiffness": k} if k else {}
        links[f"l{len(links)}"] = ss.machine.Spring(between=(a, b), damping=c, **spring)
        row = np.zeros(n + 2)
        row[ends[b]], row[ends[a]] = 1.0, -1.0
        stiff[:], damp[:] = stiff + k * np.outer(row, row), damp + c * np.outer(row, row)
        if "ground" not in (a, b):
            for end in (a, b):
                if end != "drive":
                    pull[ends[end]] += np.array([-row[ends[end]] * row[j] * complex(k, c) for j in range(n)])

    for i in range(count):
        link("drive" if i == 0 else names[int(random.integers(0, i))], names[i], size(0, 2), size(-2, 0))
    if count > 2:
        link(names[0], names[count - 1], size(), 0.0)
    if posts:
        link("ground", "post", size(0, 2), size(-2, 0))
    link("ground", names[int(random.integers(0, count))], 0.0, size(-2, 0))

    kp, kd, seen = size(0, 2), size(-2, 0), int(random.integers(0, count))
    controlled = random.random() < 0.5 or delay > 0
    drive = (
        ss.machine.PositionPD(velocity=1.0, body="b0", measured=names[seen], kp=kp, kd=kd, delay=delay)
        if controlled
        else ss.machine.Pull(velocity=1.0)
    )

    touches, contacts = [], {}
    for i in range(count):
        if random.random() < 0.7 or (i == count - 1 and not contacts) or mass[i] == 0:
            against = "post" if posts and random.random() < 0.5 else "ground"
            load, f, slope, r, mu, alpha = size(), size(), -size(-2, 0), size(), 0.1 + 0.4 * random.random(), 0.0
            further = {}
            if random.random() < 0.5:
                alpha = 0.5 * mu
                further["normal_memory"] = ss.laws.LinkerDieterich(alpha=alpha, sigma_ref=1.0)
            tilt = random.uniform(-0.6, 0.6) if random.random() < 0.5 else 0.0
            press = (
                ss.laws.InclinedSpring(steady_normal_stress=load, angle=tilt)
                if tilt
                else ss.laws.ConstantNormalStress(preload=load)
            )
            friction = rate_state(f, slope, r, mu, load, **further)
            contacts[f"c{i}"] = ss.machine.Surface(body=names[i], against=against, friction=friction, contact=press)
            touches.append((i, ends[against], f, slope, r, mu, mu - alpha, np.tan(tilt)))
    machine = ss.Machine(
        bodies={name: ss.machine.SlidingBody(mass=m) for name, m in zip(names, mass, strict=True)}, links=links,
        contacts=contacts, drive=drive,
    )  # fmt: skip

    def matrix(s):
        whole = np.diag(mass * s * s).astype(complex) + stiff[:n, :n] + damp[:n, :n] * s
        if controlled:
            whole[0, seen] += (kp + kd * s) * np.exp(-s * delay)
        for i, other, f, slope, r, mu, f1, tangent in touches:
            slip = np.zeros(n)
            slip[i] += 1.0
            if other < n:
                slip[other] -= 1.0
            seen_pull = np.array([one.real + one.imag * s for one in np.asarray(pull[i], dtype=complex)])
            if controlled and i == 0:
                seen_pull[seen] -= (kp + kd * s) * np.exp(-s * delay)
            normal = -tangent * seen_pull
            friction = (s * (f * s + r * slope) * slip + (f1 * s + r * mu) * normal) / (s + r)
            whole += np.outer(slip, friction)
        return whole

    return machine, matrix


def same_block(seed):
    """A slider, and the machine of one body that it is."""
    random = np.random.default_rng(seed)

    def size(low=-1.0, high=1.0):
        return float(10 ** random.uniform(low, high))

    mu, load = 0.3 + 0.3 * random.random(), size(0, 1)
    own = rate_state(size(-1.5, -0.5), -size(-2, -1), size(), mu, load, regularised=seed % 4 == 1)
    tilt = float(random.uniform(-0.4, 0.4)) if seed % 3 else 0.0
    contact = (
        ss.laws.InclinedSpring(steady_normal_stress=load, angle=tilt)
        if tilt
        else ss.laws.ConstantNormalStress(preload=load)
    )
    mass, damping, k = (0.0 if seed % 5 == 2 else size()), size(-2, 0), size(0, 2)
    block = ss.Slider(
        friction=own, contact=contact, stiffness=k, damping=damping, mass=mass, drive=ss.machine.SteadyDrive(1.0)
    )  # fmt: skip
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=mass)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=k, damping=damping)},
        contacts={"base": ss.machine.Surface(body="block", friction=own, contact=contact)},
        drive=ss.machine.Pull(velocity=1.0),
    )
    return block, machine


def renamed(machine):
    """Machine with renamed bodies, links and contacts, in another order."""
    other = {"motor": "zeta", "table": "alpha"}
    ends = lambda link: tuple(other.get(end, end) for end in link.between)  # noqa: E731
    links = {f"l{name}": replace(one, between=ends(one)) for name, one in list(machine.links.items())[::-1]}
    contacts = {f"c{name}": replace(one, body=other[one.body]) for name, one in machine.contacts.items()}
    return ss.Machine(
        bodies={other.get(name, name): one for name, one in list(machine.bodies.items())[::-1]}, links=links,
        contacts=contacts, drive=replace(machine.drive, body=other[machine.drive.body]),
    )  # fmt: skip
