"""Random machines in other units and another order: the kind of onset, and its coefficient, are the same.

``python tests/helpers/onsets_at_random.py COUNT SEED`` does many by hand.
"""

import sys
from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np

import steadyslip as ss
from machines import at_random
from steadyslip.core.dimensions import unit


def in_units(rig, length, force, time):
    """Rig with all numbers in other units of length (m), force (N) and time (s); radians stay."""
    mass = force * time**2 / length

    def factor(role):
        size, dimension = unit(role.unit)
        assert size == 1.0
        return mass**-dimension.mass * length**-dimension.length * time**-dimension.time

    return rig.with_values(
        {name: one.value * factor(one.role) for name, one in rig.parameters().items() if one.value is not None}
    )


def shuffled(machine, random):
    """Bodies, links and contacts in another order."""
    turned = {}
    for what in ("bodies", "links", "contacts"):
        members = list(getattr(machine, what).items())
        turned[what] = dict(members[i] for i in random.permutation(len(members)))
    return replace(machine, **turned)


def drawn(seed):
    """A random machine of two laws of evolution, some with a body that is all but massless or a link that is all but
    rigid, some whose onset is degenerate: one body without mass or damping.
    """
    random = np.random.default_rng([seed, 6])
    machine, _ = at_random(seed)
    law = (ss.laws.Slip(), ss.laws.Aging(), ss.laws.PRZ())[int(random.integers(3))]
    contacts = {
        name: replace(one, friction=replace(one.friction, evolution=law)) for name, one in machine.contacts.items()
    }
    machine = replace(machine, contacts=contacts)
    kind = seed % 4
    springs = [f"links.{name}.stiffness" for name, one in machine.links.items() if getattr(one, "stiffness", None)]
    if kind == 1:
        machine = machine.with_values({f"bodies.{next(iter(machine.bodies))}.mass": 10.0 ** random.uniform(-12, -4)})
    elif kind == 2:
        machine = machine.with_values({springs[-1]: 10.0 ** random.uniform(3, 9)})
    elif kind == 3:
        friction = ss.laws.RateState(a=0.1, b=random.uniform(0.12, 0.5), d_c=1.0, mu_ref=0.6, v_ref=1.0,
                                evolution=(ss.laws.Slip(), ss.laws.Aging())[int(random.integers(2))])  # fmt: skip
        block = ss.machine.Surface(
            body="block", friction=friction, contact=ss.laws.ConstantNormalStress(preload=random.uniform(0.5, 5))
        )
        machine = ss.Machine(
            bodies={"block": ss.machine.SlidingBody(mass=0.0), "end": ss.machine.SlidingBody(mass=0.0)},
            links={"one": ss.machine.Spring(between=("drive", "end"), stiffness=random.uniform(0.2, 1)),
                   "two": ss.machine.Spring(between=("end", "block"), stiffness=random.uniform(0.2, 1))},
            contacts={"base": block}, drive=ss.machine.Pull(velocity=1.0),
        )  # fmt: skip
        springs = ["links.one.stiffness"]
    return machine, (*springs, *(f"contacts.{name}.friction.b" for name in machine.contacts))


def onset(machine, names):
    """At the first of some parameters that has an oscillatory edge; None where none has."""
    for along in names:
        with suppress(ss.NotAvailable):
            return ss.hopf(machine, along)
    return None


def compared(seed):
    """Kinds of onset of a random machine as it is, in other units, and in these and another order; and by how much
    their coefficients differ beyond their errors, as a share. None where there is no oscillatory edge.
    """
    random = np.random.default_rng([seed, 7])
    machine, names = drawn(seed)
    own = onset(machine, names)
    if own is None:
        return None
    along = [own.along]
    length, force, time = 10.0 ** random.uniform(-6, 6, 3)
    scaled = in_units(machine, length, force, time)
    found = [own, onset(scaled, along), onset(shuffled(scaled, random), along)]
    if None in found:
        return [one and one.kind for one in found], np.inf
    times = 1 / np.array([1.0, time, time])
    c1, error = (times * [getattr(one, what) for one in found] for what in ("coefficient", "coefficient_error"))
    apart = np.abs(c1 - c1[0]) - error - error[0]
    size = np.max(np.abs(c1))
    return [one.kind for one in found], float(np.max(apart) / size) if size else 0.0


def alike(kinds):
    """True if all kinds of onset that are decided agree."""
    return len({*kinds} - {"not decided"}) <= 1


def main(count, seed):
    seen = Counter()
    for i in range(seed, seed + count):
        found = compared(i)
        if found is None:
            continue
        kinds, apart = found
        seen.update(kinds)
        if not alike(kinds) or apart > 1e-9 or "not decided" in kinds:
            print("ONSET", i, kinds, apart, flush=True)
    print(dict(seen), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
