"""Random machines whose bodies move in the plane and turn, and theory 11's matrix of each, typed with NumPy.

``python tests/helpers/machines_in_the_plane.py FIRST LAST`` compares the eigenvalues of many by hand.
"""

import sys
from collections import Counter
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import steadyslip as ss

KINDS = ("pull", "shaft", "pd", "pid", "p-pi", "rotary-pd", "rotary-pid", "rotary-p-pi")


@dataclass
class InThePlane:
    """A machine; its matrix as a function of s; normal forces in steady sliding, none positive where there is none."""

    machine: ss.Machine
    matrix: object
    normal_forces: list
    delay: float


class _Drawn:
    """A machine being drawn: its parts, and beside them inertias, stiffnesses and dampings as NumPy has them."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.kind = str(self.random.choice(KINDS))
        self.turns = self.kind.startswith(("rotary", "shaft"))
        self.count, self.posts = int(self.random.integers(1, 4)), int(self.random.integers(0, 2))
        self.names = [f"b{i}" for i in range(self.count)] + ["post"] * self.posts
        self.bodies, self.links, self.contacts, self.touches = {}, {}, {}, []
        self.where, self.inertia, self.force, self.speed, self.plane = {}, [], [], [], {}
        for name in self.names:
            self._body(name)
        self.lead, self.gear, self.velocity = self.size(), 1.0, 1.0
        if self.turns:
            self._rotor("motor", 1 / self.lead)
            self.velocity = 1 / self.lead
        if self.kind == "shaft":
            self.gear = self.size(-0.5, 0.5)
            self.velocity = 1 / self.lead / self.gear
            self._rotor("rotor", self.velocity)
        self.n = len(self.inertia)
        self.stiff, self.damp = np.zeros((self.n, self.n)), np.zeros((self.n, self.n))
        self.held_back = np.zeros(self.n)  # by dashpots to the ground, in steady sliding
        self._links()
        self._drive()
        for i, name in enumerate(self.names):
            if name != "post" and (self.plane[name] or i == self.count - 1 or self.chance(0.6)):
                self._contact(i, name)

    def size(self, low=-1.0, high=1.0):
        return float(10 ** self.random.uniform(low, high))

    def chance(self, share):
        return bool(self.random.random() < share)

    def _coordinate(self, name, inertia, force, speed):
        self.where[name] = len(self.inertia)
        self.inertia.append(inertia)
        self.force.append(force)
        self.speed.append(speed)

    def _body(self, name):
        mass, force = self.size(), float(self.random.normal()) if self.chance(0.3) else 0.0
        self.plane[name] = self.chance(0.7)
        self._coordinate(f"{name}.x", mass, force, 0.0 if name == "post" else 1.0)
        if self.plane[name]:
            press = self.size(0, 1)
            self.bodies[name] = ss.machine.PlanarBody(mass=mass, press=press, force=force)
            self._coordinate(f"{name}.y", mass, -press, 0.0)
        else:
            self.bodies[name] = ss.machine.SlidingBody(mass=mass, force=force)

    def _rotor(self, name, speed):
        inertia = self.size()
        self.bodies[name] = ss.machine.RotatingBody(inertia=inertia)
        self._coordinate(f"{name}.x", inertia, 0.0, speed)

    def row(self, end, axis=".x", share=1.0):
        found = np.zeros(self.n)
        if f"{end}{axis}" in self.where:
            found[self.where[f"{end}{axis}"]] = share
        return found

    def _link(self, kind, ends, row, **further):
        stiffness, damping = self.size(0, 2), self.size(-2, 0)
        self.links[f"l{len(self.links)}"] = kind(between=ends, stiffness=stiffness, damping=damping, **further)
        self.stiff += stiffness * np.outer(row, row)
        self.damp += damping * np.outer(row, row)
        if "ground" in ends:
            self.held_back += damping * row * (row @ self.speed)

    def _spring(self, a, b, angle=0.0):
        along, away = (self.row(b, axis) - self.row(a, axis) for axis in (".x", ".y"))
        further = {"angle": angle} if angle else {}
        self._link(ss.machine.Spring, (a, b), np.cos(angle) * along + np.sin(angle) * away, **further)

    def _tilted(self, a, b):
        """A second spring beside one, at an angle where both ends may have one."""
        self._spring(a, b, float(self.random.uniform(-1, 1)) if self.plane.get(a, True) and self.plane.get(b, True)
                     else 0.0)  # fmt: skip

    def _links(self):
        holder = "drive" if self.kind == "pull" else "ground"
        for i in range(self.count):
            before = f"b{int(self.random.integers(0, i))}" if i else "drive" if self.kind == "pull" else None
            if before:
                self._spring(before, f"b{i}")
                if self.chance(0.6):
                    self._tilted(before, f"b{i}")
        for name in self.names:
            if self.plane[name] and (name == "post" or self.chance(0.5)):
                end = "ground" if name == "post" else holder
                self._link(ss.machine.Spring, (end, name), self.row(name, ".y"), direction="normal")
        if self.posts:
            self._spring("ground", "post")
            self._tilted("ground", "post")
        if self.turns:
            row = self.row("b0") - self.row("motor", share=self.lead)
            self._link(ss.machine.Screw, ("motor", "b0"), row, lead=self.lead)
        if self.kind == "shaft":
            row = self.row("motor") - self.row("rotor", share=self.gear)
            self._link(ss.machine.Shaft, ("rotor", "motor"), row, gear=self.gear)
            self._link(ss.machine.Shaft, ("drive", "rotor"), self.row("rotor"), gear=1.0)

    def _drive(self):
        self.acts, self.delay, self.gain, self.place = None, 0.0, lambda s: np.zeros(self.n), np.zeros(self.n)
        if self.kind in ("pull", "shaft"):
            self.drive = (ss.machine.RotaryPull if self.turns else ss.machine.Pull)(velocity=self.velocity)
            return
        self.acts = "motor" if self.turns else "b0"
        measured, other = (str(self.random.choice([self.acts, *self.names[: self.count]])) for _ in range(2))
        share = {name: 1.0 if name == self.acts or not self.turns else 1 / self.lead for name in (measured, other)}
        self.place, speed = self.row(measured, share=share[measured]), self.row(other, share=share[other])
        kp, kd, ki, kv, tn = (self.size(*ends) for ends in ((0, 2), (-1, 1), (-1, 0), (-1, 0), (0, 1)))
        self.delay = self.size(-1, 0.5) if self.chance(0.3) else 0.0
        common = {"velocity": self.velocity, "body": self.acts, "measured": measured, "delay": self.delay}
        law = self.kind.removeprefix("rotary-")
        if law == "pd":
            kind, own = (ss.machine.PositionPD, ss.machine.RotaryPD), {"kp": kp, "kd": kd}
            self.gain = lambda s: (kp + kd * s) * self.place
        elif law == "pid":
            kind, own = (ss.machine.PositionPID, ss.machine.RotaryPID), {"kp": kp, "kd": kd, "ki": ki}
            self.gain = lambda s: (kp + kd * s + ki / s) * self.place
        else:
            kind, own = (
                (ss.machine.Cascade, ss.machine.RotaryCascade),
                {"kv": kv, "kp": kd, "tn": tn, "speed_measured": other},
            )
            self.gain = lambda s: kd * ((kv + kv / (tn * s)) * self.place + (s + 1 / tn) * speed)
        self.drive = kind[self.turns](**own, **common)

    def _contact(self, i, name):
        against = "post" if self.posts and self.chance(0.5) else "ground"
        area = self.size() if self.chance(0.5) else None
        a, b, length, mu, reference = (self.size(-2, -1), self.size(-2, -1), self.size(),
                                       0.2 + 0.3 * self.random.random(), self.size())  # fmt: skip
        alpha = 0.3 * mu if self.chance(0.5) else 0.0
        memory = {"normal_memory": ss.laws.LinkerDieterich(alpha=alpha)} if alpha else {}
        friction = ss.laws.RateState(a=a, b=b, d_c=length, mu_ref=mu, v_ref=reference, **memory)
        slip, away = (self.row(name, axis) - self.row(against, axis) for axis in (".x", ".y"))
        k, c, load = (self.size(0, 2), self.size(-2, 0), 0.0) if np.any(away) else (0.0, 0.0, self.size())
        per = area or 1.0
        contact = (
            ss.laws.Compliant(normal_stiffness=k / per, normal_damping=c / per)
            if k
            else ss.laws.ConstantNormalStress(preload=load / per)
        )
        self.contacts[f"c{i}"] = ss.machine.Surface(
            body=name, against=against, friction=friction, contact=contact, area=area
        )
        level = mu - (a - b) * np.log(reference)
        self.touches.append(SimpleNamespace(slip=slip, away=away, k=k, c=c, load=load, a=a, b=b, rate=1 / length,
                                            mu=level, at_once=level - alpha))  # fmt: skip

    def normal_forces(self):
        """Normal forces (N) of all contacts in steady sliding, with a controlled coordinate held at its target."""
        n = self.n
        whole, right = np.eye(n + 1), np.zeros(n + 1)
        whole[:n, :n], right[:n] = self.stiff, np.array(self.force) - self.held_back
        for one in self.touches:
            whole[:n, :n] += one.k * (np.outer(one.away, one.away) - one.mu * np.outer(one.slip, one.away))
            right[:n] -= one.slip * one.mu * one.load
        if self.acts:
            whole[self.where[f"{self.acts}.x"], n] = -1.0
            whole[n] = [*self.place, 0.0]
        found = np.linalg.solve(whole, right)[:n]
        return [one.load - one.k * (one.away @ found) for one in self.touches]


def in_the_plane(seed):
    """A machine of one to five bodies."""
    one = _Drawn(seed)
    forces = one.normal_forces()
    machine = ss.Machine(bodies=one.bodies, links=one.links, contacts=one.contacts, drive=one.drive)

    def matrix(s):
        whole = np.diag(one.inertia) * s * s + one.stiff + one.damp * s + 0j
        if one.acts:
            whole[one.where[f"{one.acts}.x"]] += one.gain(s) * np.exp(-s * one.delay)
        for touch, force in zip(one.touches, forces, strict=True):
            normal = -(touch.k + touch.c * s) * touch.away
            direct, slope = touch.a * force, (touch.a - touch.b) * force
            friction = s * (direct * s + touch.rate * slope) * touch.slip
            friction = (friction + (touch.at_once * s + touch.rate * touch.mu) * normal) / (s + touch.rate)
            whole += np.outer(touch.slip, friction) - np.outer(touch.away, normal)
        return whole

    return InThePlane(machine, matrix, forces, one.delay)


def is_root(matrix, s):
    """True if a matrix is singular at s, or far closer to singular there than beside s."""
    values, near = (np.linalg.svd(matrix(at), compute_uv=False) for at in (s, s * (1 + 1e-5)))
    return bool(values[-1] < 1e-8 * values[0] or values[-1] < 1e-3 * near[-1])


def compare(seed):
    """Word on the random machine of a seed: "agrees", "no steady sliding", or "WRONG: ..." with the fault."""
    one = in_the_plane(seed)
    found = ss.eigenvalues(one.machine)
    found = found[np.isfinite(found)]
    if min(one.normal_forces) <= 0:
        return "no steady sliding" if not len(found) else "WRONG: slides"
    if not len(found):
        return "WRONG: does not slide"
    return "agrees" if all(is_root(one.matrix, s) for s in found) else "WRONG: eigenvalues"


if __name__ == "__main__":
    outcomes = Counter()
    for seed in range(*map(int, sys.argv[1:3])):
        outcomes[word := compare(seed)] += 1
        if word.startswith("WRONG"):
            print(seed, word)
    print(dict(outcomes))
