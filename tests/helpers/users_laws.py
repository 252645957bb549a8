"""Laws as users write them, for tests and campaigns: registered nowhere once they are made."""

import sympy as sp

import steadyslip as ss
from rigs_of_theory import SIGMA, V0, rig
from steadyslip.core.domains import positive

FAMILIES = (ss.laws.FrictionLaw, ss.laws.ContactLaw)
BEFORE = [dict(family.registry) for family in FAMILIES]


class Viscous(ss.laws.FrictionLaw, name="viscous-of-tests"):
    """A user's law: the slip law with viscous friction that saturates."""

    a: float = ss.laws.parameter("1", positive, "direct effect")
    b: float = ss.laws.parameter("1", positive, "evolution effect")
    d_c: float = ss.laws.parameter("m", positive, "slip distance")
    level: float = ss.laws.parameter("1", positive, "friction at 1 µm/s")
    film: float = ss.laws.parameter("Pa", positive, "viscous stress of a fast block")

    def memory(self):
        return ("age",)

    def strength(self, v, sigma, memory, tau):
        dry = sigma * (self.level + self.a * sp.log(v / V0) + self.b * memory[0])
        return dry + self.film * sp.tanh(v / (1000 * V0))

    def rates(self, v, sigma, memory, tau):
        return (-v / self.d_c * (sp.log(v / V0) + memory[0]),)

    def steady_memory(self, v, sigma):
        return (-sp.log(v / V0),)


class Asperities(ss.laws.PreloadedContact, name="asperities-of-tests"):
    """A user's contact, not linear in the stresses: σ = σ0 + c √(T p)."""

    share: float = ss.laws.parameter("1", positive, "share c")
    pressure: float = ss.laws.parameter("Pa", positive, "pressure p")

    def coupling(self, motion):
        return self.share * sp.sqrt(motion.spring * self.pressure)


class Turning(ss.laws.PreloadedContact, name="turning-of-tests"):
    """A user's contact with a function that no kernel has."""

    def coupling(self, motion):
        return 1e5 * sp.atan(motion.friction / 1e6)


for family, registry in zip(FAMILIES, BEFORE, strict=True):
    family.registry = registry

FRICTION = Viscous(a=0.0145, b=0.016, d_c=1e-6, level=0.7, film=1e5)
CONTACT = Asperities(preload=SIGMA, share=0.3, pressure=2e6)
USERS = {
    "friction law": rig(friction=FRICTION, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5)),
    "contact law": rig(contact=CONTACT),
    "both": rig(friction=FRICTION, contact=CONTACT),
}
