"""Machines at random whose stiffnesses and masses lie many orders of magnitude apart, and their equations by hand."""

import mpmath
import numpy as np

import steadyslip as ss

SHARE = 0.3  # of the digits: decades from which on an eigenvalue is one of those that are infinite


def lugre(chance, velocity, ratio):
    """A law at so many times its Stribeck velocity."""
    coulomb = chance.uniform(0.1, 0.4)
    return ss.laws.LuGre(
        mu_coulomb=coulomb, mu_static=coulomb * chance.choice([0.4, 1.6]), v_stribeck=velocity / ratio,
        bristle_stiffness=10 ** chance.uniform(4, 6), bristle_damping=10 ** chance.uniform(-2, 1),
        viscous=chance.choice([0.0, 10 ** chance.uniform(-3, 0)]),
    )  # fmt: skip


def rate_state(chance, velocity):
    return ss.laws.RateState(
        a=10 ** chance.uniform(-3, -1.5), b=10 ** chance.uniform(-3, -1.5), d_c=10 ** chance.uniform(-6, -3),
        mu_ref=0.5, v_ref=velocity,
    )  # fmt: skip


def at_random(chance, decades=10.0, ratio=None):
    """One to five bodies in a tree from the drive, with or without mass, one to three of them on contacts.

    Parameters
    ----------
    decades : float
        By which stiffnesses are above or below 1e6 N/m.
    ratio : float, optional
        Of the velocity over the Stribeck velocity of LuGre laws.
    """
    count = int(chance.integers(1, 6))
    velocity = 10 ** chance.uniform(-6, -1)
    names, leads, bodies, links = [], {}, {}, {}
    for i in range(count):
        before = "drive" if i == 0 else names[int(chance.integers(len(names)))]
        name = f"b{i}"
        turns = i == 0 and count > 1 and chance.random() < 0.3
        lead = 10 ** chance.uniform(-3, -1) if turns else 1.0
        mass = chance.choice([0.0, 10 ** chance.uniform(-6, 2)]) * lead**2
        bodies[name] = ss.machine.RotatingBody(inertia=mass) if turns else ss.machine.SlidingBody(mass=mass)
        stiffness = 10 ** (6 + chance.uniform(-decades, decades))
        damping = chance.choice([0.0, stiffness * 10 ** chance.uniform(-6, -2)])
        if turns:
            links[f"l{i}"] = ss.machine.Shaft(
                between=(before, name), stiffness=stiffness * lead**2, damping=damping * lead**2
            )
        elif leads.get(before, 1.0) != 1.0:
            links[f"l{i}"] = ss.machine.Screw(
                between=(before, name), lead=leads[before], stiffness=stiffness, damping=damping
            )
        else:
            links[f"l{i}"] = ss.machine.Spring(between=(before, name), stiffness=stiffness, damping=damping)
        names.append(name)
        leads[name] = lead
    sliding = [name for name in names if leads[name] == 1.0]
    touched = chance.permutation(sliding)[: int(chance.integers(1, min(len(sliding), 3) + 1))]
    contacts = {}
    for i, name in enumerate(touched):
        own = ratio or 10 ** chance.uniform(0, 1.5)
        law = lugre(chance, velocity, own) if chance.random() < 0.6 else rate_state(chance, velocity)
        load = ss.laws.ConstantNormalStress(preload=10 ** chance.uniform(0, 4))
        contacts[f"c{i}"] = ss.machine.Surface(body=str(name), friction=law, contact=load)
    turning = leads["b0"] != 1.0
    pull = ss.machine.RotaryPull if turning else ss.machine.Pull
    return ss.Machine(
        bodies=bodies,
        links=links,
        contacts=contacts,
        drive=pull(velocity=velocity / leads["b0"] if turning else velocity),
    )


def pencil(machine):
    """A and E of A z = E z' in mpmath's numbers, typed by hand: z are places, velocities and memory."""
    names = list(machine.bodies)
    n, m = len(names), len(machine.contacts)
    a, e = mpmath.zeros(2 * n + m), mpmath.zeros(2 * n + m)
    speeds = {name: mpmath.mpf(speed) for name, speed in machine.speeds().items()}
    for i, body in enumerate(machine.bodies.values()):
        a[i, n + i] = e[i, i] = 1
        e[n + i, n + i] = mpmath.mpf(body.inertia if isinstance(body, ss.machine.RotatingBody) else body.mass)
    for link in machine.links.values():
        row = mpmath.zeros(1, n)
        for end, share in zip(link.between, (-mpmath.mpf(link.ratio()), mpmath.mpf(1)), strict=True):
            if end in names:
                row[names.index(end)] += share
        for i in range(n):
            for j in range(n):
                a[n + i, j] -= row[i] * row[j] * mpmath.mpf(link.stiffness)
                a[n + i, n + j] -= row[i] * row[j] * mpmath.mpf(link.damping)
    for k, touch in enumerate(machine.contacts.values()):
        i, v, load = names.index(touch.body), speeds[touch.body], mpmath.mpf(touch.contact.preload)
        law, z = touch.friction, 2 * n + k
        e[z, z] = 1
        if isinstance(law, ss.laws.LuGre):
            weakening = mpmath.mpf(law.mu_static) - mpmath.mpf(law.mu_coulomb)
            bell = weakening * mpmath.exp(-((v / law.v_stribeck) ** 2))
            g, slope = law.mu_coulomb + bell, -2 * v / mpmath.mpf(law.v_stribeck) ** 2 * bell
            a[z, n + i], a[z, z] = v * slope / g, -law.bristle_stiffness * v / g
            a[n + i, n + i] -= load * (law.bristle_damping * a[z, n + i] + law.viscous)
            a[n + i, z] -= load * (law.bristle_stiffness + law.bristle_damping * a[z, z])
        else:
            a[z, n + i], a[z, z] = -1 / mpmath.mpf(law.d_c), -v / mpmath.mpf(law.d_c)
            a[n + i, n + i] -= load * law.a / v
            a[n + i, z] -= load * law.b
    return a, e


def eigenvalues(machine, digits=1200):
    """All that are finite, at so many digits, by falling real part."""
    with mpmath.workdps(digits):
        a, e = pencil(machine)
        place = mpmath.mpf("1234.567")
        found = mpmath.eig(mpmath.inverse(a - place * e) * e, left=False, right=False)
        finite = [place + 1 / one for one in found if abs(one) > mpmath.mpf(10) ** (-SHARE * digits)]
        return sorted((complex(one) for one in finite), key=lambda s: -s.real)


def worst(found, right):
    """Largest relative difference of two sets of eigenvalues, the nearest beside each other; inf where one has more."""
    from scipy.optimize import linear_sum_assignment

    found, right = np.asarray(found)[~np.isnan(found)], np.asarray(right)
    if len(found) != len(right):
        return np.inf
    apart = np.abs(found[:, None] - right[None, :]) / np.maximum(np.abs(right), 1e-300)[None, :]
    with np.errstate(divide="ignore"):
        rows, columns = linear_sum_assignment(np.log(np.minimum(apart, 1e9) + 1e-18))
    return float(np.max(apart[rows, columns], initial=0.0))
