"""Random sliders and machines whose edges are asked for in other words: in other ranges, from another own value of the
parameter, in another unit of stress or force, with bodies and contacts in another order.

The edges are the same. ``python tests/helpers/edges_at_random.py COUNT SEED`` asks many by hand.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import steadyslip as ss
from counting import count_differences
from rigs_of_theory import CONTACTS, LAWS
from steadyslip.core.errors import SteadyslipError

MACHINES = sorted((Path(__file__).parents[2] / "examples" / "machines").glob("*.toml"))
DRIVES = (
    ss.machine.SteadyDrive(1e-6),
    ss.machine.PD(1e-6, kp=4e9, kd=1e9),
    ss.machine.PID(1e-6, kp=4e9, ki=1e8, kd=1e5),
)
SAME = 1e-6  # share by which edges may differ: rounding of an edge at which damping hardly changes
UNIT = 1024.0  # of stress or force: powers of two change no digit


def drawn(chance):
    """A slider or a machine of an example, half its numbers changed."""
    if chance.random() < 0.4:
        rig = ss.read_rig(MACHINES[chance.integers(len(MACHINES))])
    else:
        laws = list(LAWS.values())
        rig = ss.Slider(
            friction=laws[chance.integers(len(laws))],
            contact=CONTACTS[chance.integers(len(CONTACTS))],
            drive=DRIVES[chance.integers(len(DRIVES))],
            stiffness=7e9,
            mass=float(chance.choice([0.0, 1e3, 1e9])),
            damping=float(chance.choice([0.0, 1e6, 1e12])),
        )
    changed = {}
    for name, one in rig.parameters().items():
        if one.value and not one.role.gauge and chance.random() < 0.5:
            by_law = ".friction." in f".{name}"
            angle = one.role.unit == "rad"
            value = one.value + 0.3 * chance.normal() if angle else one.value * np.exp(chance.normal() * 0.1**by_law)
            if one.role.domain.contains(value):
                changed[name] = float(value)
    return rig.with_values(changed)


def names_of(rig):
    """Parameters that have edges to ask for."""
    return [name for name, one in rig.parameters().items() if one.value and not one.role.gauge]


def range_around(rig, name, edges, chance):
    """A range within the usual one, around an edge or the rig's own value; None where that leaves the domain."""
    one = rig.parameters()[name]
    middle = edges[chance.integers(len(edges))].value if edges and chance.random() < 0.7 else one.value
    if np.isfinite(one.role.domain.high) or one.role.domain.low < 0:
        width = 10 ** chance.uniform(-3, 0.5)
        low, high = middle - width * chance.random(), middle + width * chance.random()
    else:
        width = 10 ** chance.uniform(-3, 0.8)
        low, high = (middle * 10 ** (sign * width * chance.random()) for sign in (-1, 1))
        if low < 1e-6 * one.value or high > 1e6 * one.value:
            return None
    good = one.role.domain.contains(low) and one.role.domain.contains(high) and low < high
    return (float(low), float(high)) if good else None


def reordered(rig):
    """Machine with its bodies, links and contacts listed in reverse order."""
    parts = ("bodies", "links", "contacts")
    return replace(rig, **{part: dict(list(getattr(rig, part).items())[::-1]) for part in parts})


def in_other_unit(rig):
    """Rig with stress, or force, in a smaller unit, and the factor on the number of each parameter."""
    factors = {}
    for name, one in rig.parameters().items():
        if one.value is not None:
            factors[name] = UNIT if one.role.unit.startswith(("Pa", "kg", "N")) else 1.0
    inverse = {name for name, one in rig.parameters().items() if one.role.unit.endswith(("/Pa", "/N"))}
    factors |= dict.fromkeys(inverse & factors.keys(), 1 / UNIT)
    known = rig.parameters()
    return rig.with_values({name: known[name].value * by for name, by in factors.items() if by != 1}), factors


def unlike(found, wanted, factor=1.0):
    """Words on what differs between two lists of edges; empty if nothing does."""
    alike = len(found) == len(wanted) and all(
        abs(one.value - factor * other.value) <= SAME * abs(factor * other.value)
        and (one.kind, one.stable) == (other.kind, other.stable)
        for one, other in zip(found, wanted, strict=True)
    )
    told = [
        [(edge.value / by, edge.kind, edge.stable) for edge in edges] for edges, by in ((found, factor), (wanted, 1))
    ]
    return "" if alike else f"{told[0]}, not {told[1]}"


def differences(seed):
    """Differences for one random rig and two of its parameters, and number of comparisons."""
    chance = np.random.default_rng(seed)
    compared, found = 0, []
    try:
        rig = drawn(chance)
        names = chance.choice(names_of(rig), 2, replace=False).tolist()
        scaled, factors = in_other_unit(rig)
        others = {"unit": scaled} | ({"order": reordered(rig)} if isinstance(rig, ss.Machine) else {})
    except SteadyslipError:
        return 0, []
    for name in names:
        try:
            edges = ss.boundary(rig, name)
            ranges = [ends for _ in range(3) if (ends := range_around(rig, name, edges, chance))]
            asked = [
                (
                    f"in {low, high}",
                    [e for e in edges if low <= e.value <= high],
                    ss.boundary(rig, name, (low, high)),
                    1,
                )
                for low, high in ranges
            ]
            asked += [(what, edges, ss.boundary(other, name), factors[name] if what == "unit" else 1)
                      for what, other in others.items()]  # fmt: skip
            value = rig.value(name) * 10 ** chance.uniform(-5, 5)
            if rig.parameters()[name].role.unit != "rad" and rig.parameters()[name].role.domain.contains(value):
                low, high = max(value, rig.value(name)) / 1e6, min(value, rig.value(name)) * 1e6
                both = (edges, ss.boundary(rig.with_values({name: value}), name))
                within = [[e for e in part if low <= abs(e.value) <= high] for part in both]
                asked.append((f"from {value}", *within, 1))
        except SteadyslipError:
            continue
        compared += len(asked)
        found += [
            f"{seed}: {name} {what}: {words}" for what, want, got, by in asked if (words := unlike(got, want, by))
        ]
    return compared, found


if __name__ == "__main__":
    count_differences(differences, *map(int, sys.argv[1:3]))
