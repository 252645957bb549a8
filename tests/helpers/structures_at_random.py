"""Random structures under contacts, with equations typed by hand as a second route; and the reed of theory 13.

``python tests/helpers/structures_at_random.py COUNT SEED LARGEST`` compares the eigenvalues of COUNT structures of 20
to LARGEST degrees of freedom with QZ of the equations typed here.
"""

import sys
import time

import numpy as np
import scipy.linalg as la

import steadyslip as ss
from steadyslip.machine import Machine, Pull, StructureBody, StructureData, StructurePoint, Surface

ROCK = ss.laws.RateState(
    a=0.010, b=0.016, d_c=20e-6, mu_ref=0.45, v_ref=0.05, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
)
"""Friction of the reed."""
REED = """
[bodies.reed]
kind = "structure"
{body}
[bodies.reed.points.{point}]
{place}
angle = "60 deg"
[contacts.tip]
body = "drive"
against = "reed.{point}"
[contacts.tip.friction]
law = "rate-state"
a = 0.010
b = 0.016
d_c = "20 um"
mu_ref = 0.45
v_ref = "50 mm/s"
[contacts.tip.friction.normal_memory]
law = "linker-dieterich"
alpha = 0.3
[contacts.tip.contact]
law = "compliant"
normal_stiffness = "5 MN/m"
steady_normal_stress = "100 N"
[drive]
control = "steady"
velocity = "50 mm/s"
"""


def reed_file(folder, body, point, place=""):
    """A file of the machine of `reed`, with keys of the body, and of its point where it touches."""
    path = folder / "machine.toml"
    path.write_text(REED.format(body=body, point=point, place=place), encoding="utf-8")
    return path


def reed_matrices(elements=20, length=0.12, width=0.02, height=0.003, modulus=210e9, density=7850.0):
    """M, C and K of a clamped reed of frame elements; of each node x along the reed, y across, and the rotation."""
    size, step, area, second = 3 * (elements + 1), length / elements, width * height, width * height**3 / 12
    mass, stiffness = np.zeros((2, size, size))
    axial = modulus * area / step * np.array([[1, -1], [-1, 1]])
    carried = density * area * step / 6 * np.array([[2, 1], [1, 2]])
    bent = modulus * second / step**3 * np.array(
        [[12, 6 * step, -12, 6 * step], [6 * step, 4 * step**2, -6 * step, 2 * step**2],
         [-12, -6 * step, 12, -6 * step], [6 * step, 2 * step**2, -6 * step, 4 * step**2]]
    )  # fmt: skip
    swung = density * area * step / 420 * np.array(
        [[156, 22 * step, 54, -13 * step], [22 * step, 4 * step**2, 13 * step, -3 * step**2],
         [54, 13 * step, 156, -22 * step], [-13 * step, -3 * step**2, -22 * step, 4 * step**2]]
    )  # fmt: skip
    for e in range(elements):
        along, across = [3 * e, 3 * e + 3], [3 * e + 1, 3 * e + 2, 3 * e + 4, 3 * e + 5]
        stiffness[np.ix_(along, along)] += axial
        mass[np.ix_(along, along)] += carried
        stiffness[np.ix_(across, across)] += bent
        mass[np.ix_(across, across)] += swung
    mass, stiffness = mass[3:, 3:], stiffness[3:, 3:]
    return mass, 2e-6 * stiffness + 1.0 * mass, stiffness


def beam_matrices(elements, length, width, height, modulus=210e9, density=7850.0):
    """M and K of a clamped beam, bent alone; of each node y across it and the rotation."""
    mass, _, stiffness = reed_matrices(elements, length, width, height, modulus, density)
    across = np.arange(len(mass)) % 3 != 0
    return mass[np.ix_(across, across)], stiffness[np.ix_(across, across)]


def reed(normal_force=100.0, body=None):
    """The reed's tip on a moving surface, at 60 degrees to it."""
    mass, damping, stiffness = reed_matrices()
    tip = StructurePoint(x=len(mass) - 2, y=len(mass) - 1, angle=np.radians(60))
    body = body or StructureBody(matrices=StructureData(mass, damping, stiffness, 0 * mass), points={"tip": tip})
    friction = ss.laws.RateState(
        a=0.010, b=0.016, d_c=20e-6, mu_ref=0.45, v_ref=0.05, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
    )
    contact = ss.laws.Compliant(normal_stiffness=5e6, steady_normal_stress=normal_force)
    surface = Surface(body="drive", against="reed.tip", friction=friction, contact=contact)
    return Machine(bodies={"reed": body}, contacts={"tip": surface}, drive=Pull(velocity=0.05))


def random_structure(chance, size, contacts):
    """A machine of one structure on a moving surface, and its numbers for `by_hand`."""
    root, axes = chance.standard_normal((2, size, size))
    mass, axes = root @ root.T / size + np.eye(size), la.qr(axes)[0]
    stiffness = axes @ np.diag(10 ** chance.uniform(3, 7, size)) @ axes.T
    stiffness = 0.5 * (stiffness + stiffness.T)
    damping = 1e-5 * 10 ** chance.uniform(-1, 1.5) * stiffness + chance.uniform(0.1, 3) * mass
    turning = chance.standard_normal((size, size))
    turning = (turning - turning.T) * chance.choice([0, 0.3])
    places, speed = chance.choice(size, 2 * contacts, replace=False), 10 ** chance.uniform(-2, 0)
    points, surfaces, numbers = {}, {}, []
    for i in range(contacts):
        x, y, angle = int(places[2 * i]), int(places[2 * i + 1]), chance.uniform(-1, 1)
        points[f"p{i}"] = StructurePoint(x=x + 1, y=y + 1, angle=angle)
        own = {
            "a": chance.uniform(0.005, 0.02),
            "b": chance.uniform(0.005, 0.03),
            "d_c": 10 ** chance.uniform(-5.5, -4),
        }
        level, alpha, force = chance.uniform(0.2, 0.8), chance.choice([0, 0.3]), 10 ** chance.uniform(0, 3)
        normal, dashpot = 10 ** chance.uniform(4, 6), chance.choice([0, 1.0]) * 10 ** chance.uniform(0, 2)
        more = {"normal_memory": ss.laws.LinkerDieterich(alpha=alpha)} if alpha else {}
        friction = ss.laws.RateState(**own, mu_ref=level, v_ref=speed, **more)
        contact = ss.laws.Compliant(normal_stiffness=normal, normal_damping=dashpot, steady_normal_stress=force)
        surfaces[f"c{i}"] = Surface(body="drive", against=f"s.p{i}", friction=friction, contact=contact)
        numbers.append((x, y, angle, *own.values(), level, alpha, force, normal, dashpot))
    body = StructureBody(matrices=StructureData(mass, damping, stiffness, turning), points=points)
    machine = Machine(bodies={"s": body}, contacts=surfaces, drive=Pull(velocity=speed))
    return machine, (mass, damping + turning, stiffness, speed, numbers)


def by_hand(mass, damping, stiffness, speed, numbers):
    """Pencil A z = s E z of the equations typed by hand (theory 11 and 13), the memory being Θ + (α/b) ln σ."""
    n, size = len(mass), 2 * len(mass) + len(numbers)
    e, a = np.eye(size), np.zeros((size, size))
    e[n : 2 * n, n : 2 * n] = mass
    a[:n, n : 2 * n], a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = np.eye(n), -stiffness, -damping
    for i, (x, y, angle, direct, b, d_c, level, alpha, force, normal, dashpot) in enumerate(numbers):
        t, out = np.zeros((2, n))
        t[x], t[y], out[x], out[y] = np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)
        pressed, slip, memory = np.zeros((3, size))
        pressed[:n], pressed[n : 2 * n], slip[n : 2 * n] = -normal * out, -dashpot * out, -t
        memory[2 * n + i] = 1
        state = memory - alpha / (b * force) * pressed
        pull = level * pressed + force * (direct * slip / speed + b * state)
        a[n : 2 * n] += np.outer(t, pull) + np.outer(out, pressed)
        a[2 * n + i] = -(speed / d_c) * (slip / speed + state)
    faster = np.sqrt(np.max(np.abs(stiffness)))  # displacements as velocities, or QZ loses the slowest roots
    a[:, :n] /= faster
    a[:n] *= faster
    return e, a


def compared(machine, numbers):
    """Growing roots of both routes, and the largest relative distance of a root from those of the other."""
    e, a = by_hand(*numbers)
    own, other = ss.eigenvalues(machine), la.eigvals(a, e)
    apart = np.min(np.abs(own[:, None] - other[None, :]), axis=1) / np.abs(own)
    growing = [int(np.sum(one.real > 1e-9 * np.abs(one))) for one in (own, other)]
    return len(own) == len(other), growing, float(np.max(apart))


def main(count, seed, largest):
    chance, wrong, unstable, worst, slowest = np.random.default_rng(seed), 0, 0, 0.0, 0.0
    for _ in range(count):
        case = random_structure(chance, int(chance.integers(20, largest + 1)), int(chance.integers(1, 4)))
        start = time.process_time()
        ss.eigenvalues(case[0])
        slowest = max(slowest, time.process_time() - start)
        alike, growing, apart = compared(*case)
        wrong += not (alike and growing[0] == growing[1] and apart < 1e-9)
        unstable, worst = unstable + (growing[1] > 0), max(worst, apart)
    print(f"{count} structures, {unstable} unstable: {wrong} wrong, roots within {worst:.1e}, slowest {slowest:.2f} s")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
