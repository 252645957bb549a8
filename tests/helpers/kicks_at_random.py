"""Random kicks of random rigs, and what the package says of them; what others say: `kicks_by_scipy.py`."""

from dataclasses import dataclass, replace

import numpy as np

import steadyslip as ss
from steadyslip.nonlinear.kicks.kicks import Kicked
from steadyslip.nonlinear.kicks.spans import OUTCOMES

D_C, V_REF, MU, SIGMA = 1e-6, 1e-6, 0.6, 5e6
LAWS = ("slip", "aging", "prz", "nagata", "two-slip", "two-aging", "lugre")
KINDS = tuple(f"{law} {inertia} {contact}" for law in LAWS for inertia in ("massless", "damped", "mass")
              for contact in ("level", "tilted") if (law, inertia) != ("nagata", "damped"))  # fmt: skip
FACTORS = (0.5, 0.9, 1.03, 1.1, 1.3, 2.0)


@dataclass(frozen=True)
class Drawn:
    """A rig and one kick of it."""

    kind: str
    rig: ss.Slider
    factor: float
    kick: str
    direction: int
    size: float
    reference: str = "before"

    def __str__(self) -> str:
        return (f"{self.kind} k/k_cr={self.factor:g} {self.kick} {self.direction:+d} size {self.size!r} "
                f"{self.reference}: {self.rig!r}")  # fmt: skip

    def kicked(self) -> Kicked:
        return Kicked(self.rig, self.kick, self.direction, self.reference, {}, 0, None)


def drawn(random: np.random.Generator, only: tuple[str, ...] = KINDS) -> Drawn:
    """A random kick of a random rig, stable or not."""
    while True:
        kind = str(random.choice(only))
        law, inertia, contact = kind.split()
        base = lugre(random, inertia, contact) if law == "lugre" else rate_state(random, law, inertia, contact)
        factor = float(random.choice(FACTORS))
        try:
            edge = base.stiffness if law == "lugre" else ss.critical_stiffness(base)
            rig = base.with_values({"stiffness": factor * edge})
            moves = np.isfinite(edge) and ss.simulate(rig, until=1e-9).status == "done"
        except ss.SteadyslipError:  # locked up, or ill-posed
            continue
        if not moves:
            continue
        kicks = ["velocity", "displacement", "normal-stress"] + (["impulse"] if inertia == "mass" else [])
        kick, direction = str(random.choice(kicks)), int(random.choice([-1, 1]))
        low, high = {"velocity": (0.02, 5), "displacement": (0.1, 60), "normal-stress": (0.003, 0.9),
                     "impulse": (0.05, 100 if direction > 0 else 0.95)}[kick]  # fmt: skip
        size = float(np.exp(random.uniform(np.log(low), np.log(high))))
        reference = str(random.choice(["before", "after"])) if kick == "velocity" else "before"
        return Drawn(kind, rig, factor, kick, direction, size, reference)


def rate_state(random: np.random.Generator, law: str, inertia: str, contact: str) -> ss.Slider:
    name = law.removeprefix("two-")
    a = 0.01 * random.uniform(0.7, 1.5)
    b = a * (1 + random.uniform(0.1, 1.0))
    more = {"b": b, "d_c": D_C}
    if name != law:
        share = random.uniform(0.3, 0.7)
        more = {"states": (ss.laws.State(b=b * share, d_c=D_C),
                           ss.laws.State(b=b * (1 - share), d_c=D_C * 10 ** random.uniform(0.3, 1.3)))}  # fmt: skip
    elif contact == "tilted":
        more["normal_memory"] = ss.laws.LinkerDieterich(alpha=random.uniform(0.1, 0.56))
    evolution = {"slip": ss.laws.Slip(), "aging": ss.laws.Aging(), "prz": ss.laws.PRZ()}.get(name)
    evolution = evolution or ss.laws.Nagata(c_nagata=random.uniform(0.2, 1.5))
    friction = ss.laws.RateState(a=a, mu_ref=MU, v_ref=V_REF, evolution=evolution, **more)
    still = {}
    if inertia == "mass":  # m v0²/(a σ d_c)
        still["mass"] = 10 ** random.uniform(-6, 0) * a * SIGMA * D_C / V_REF**2
    if inertia == "damped":
        still["radiation_damping"] = 10 ** random.uniform(-6, -2) * a * SIGMA / V_REF
    return ss.Slider(
        friction=friction, contact=pressed(random, contact), stiffness=5e9, drive=ss.machine.SteadyDrive(V_REF), **still
    )


def lugre(random: np.random.Generator, inertia: str, contact: str) -> ss.Slider:
    static, v_stribeck = random.uniform(0.15, 0.5), 10 ** random.uniform(-3.5, -2.5)
    friction = ss.laws.LuGre(
        mu_coulomb=static * random.uniform(0.5, 0.9), mu_static=static, v_stribeck=v_stribeck,
        bristle_stiffness=10 ** random.uniform(4, 5.5), bristle_damping=10 ** random.uniform(0.5, 2),
        viscous=10 ** random.uniform(-1, 1),
    )  # fmt: skip
    v0 = v_stribeck * 10 ** random.uniform(-0.5, 0.5)
    still = {}
    if inertia == "mass":
        still["mass"] = 10 ** random.uniform(2, 4)
    if inertia == "damped":
        still["radiation_damping"] = 10 ** random.uniform(-6, -3) * SIGMA / v0
    base = ss.Slider(
        friction=friction, contact=pressed(random, contact), stiffness=1e10, drive=ss.machine.SteadyDrive(v0), **still
    )
    try:
        edge = ss.hopf(base).value
    except ss.SteadyslipError:
        edge = 10 ** random.uniform(9, 12)
    return base.with_values({"stiffness": edge})


def pressed(random: np.random.Generator, contact: str) -> object:
    if contact == "level":
        return ss.laws.ConstantNormalStress(preload=SIGMA)
    given = str(random.choice(["preload", "steady_normal_stress"]))
    return ss.laws.InclinedSpring(angle=random.uniform(-0.6, 0.6), **{given: SIGMA})


def by_preload(rig: ss.Slider) -> ss.Slider:
    """Rig with its contact given by a preload, which does not change with the drive velocity, in place of σss."""
    contact = rig.contact
    if getattr(contact, "steady_normal_stress", None) is None:
        return rig
    at_rest = ss.steady_state(rig)
    preload = at_rest.normal_stress + at_rest.spring_stress * np.tan(contact.angle)
    return replace(rig, contact=ss.laws.InclinedSpring(preload=float(preload), angle=contact.angle))


def outcome_of(case: Drawn, size: float | None = None) -> str:
    return OUTCOMES[int(case.kicked().outcomes(np.zeros(1, dtype=int), np.array([size or case.size]))[0])]
