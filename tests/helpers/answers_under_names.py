"""Answers of every stage on a rig whose laws have given names, by question."""

import numpy as np

import steadyslip as ss
from renamed_laws import NAMES, PLAIN, machine, renamed
from steadyslip.explorer.equations import linear_part
from steadyslip.explorer.motion import motion_part
from steadyslip.model.assembly import EVENTS, RESERVED_NAMES

TIMES = np.linspace(0.0, 20.0, 21)
PUSH = [ss.protocol.VelocityStep(at=1.0, to=2e-6), ss.protocol.NormalStressHarmonic(amplitude=1e5, period=3.0)]
PARAMETERS, REMEMBERED = ("a", "film", "share"), ("age", "gap")


def pairs(index):
    """Names of all that can have another, chosen by a number: a parameter of each law, both memories."""
    random = np.random.default_rng(index)
    words = [str(word) for word in random.permutation(NAMES)]
    free = [word for word in words if word not in RESERVED_NAMES and not word.startswith(EVENTS)]
    own = dict(zip(PARAMETERS, (word for word in words if word not in PLAIN), strict=False))
    return tuple((own | dict(zip(REMEMBERED, (w for w in free if w not in own.values()), strict=False))).items())


def moved(own, mass):
    """Histories of a slider and of a machine, alone and in lanes."""
    run = ss.simulate(renamed(own, mass=mass), PUSH, until=20.0, times=TIMES)
    many = ss.simulate_many(
        renamed(own, mass=mass), {"slider.stiffness": [5e9, 7e9]}, PUSH, until=20.0, times=TIMES, progress=False,
        observables=("v",),
    )  # fmt: skip
    names = dict(own)
    seen = [run[name] for name in ("v", "x", "normal_stress", "shear_stress", "slip")]
    return [*seen, *(run[names.get(one, one)] for one in REMEMBERED), many.samples["v"]]


def of_machine(own, mass):
    """Answers on a machine, with its eigenvalues."""
    found = machine(own, mass)
    push = [ss.protocol.VelocityStep(at=1.0, to=2e-6), ss.protocol.DisturbanceStep(at=3.0, by=1e5, on="two")]
    run = ss.simulate(found, push, until=8.0, times=TIMES[:9])
    seen = [run[name] for name in ("one.v", "two.x", "first.friction_force", "second.normal_force")]
    return [np.array(ss.eigenvalues(found)), *seen]


def judged(own, mass):
    """Eigenvalues, critical stiffness and edges in parameters that have other names."""
    rig, names = renamed(own, mass=mass), dict(own)
    edges = [one.value for name in ("a", "film") for one in ss.boundary(rig, f"friction.{names.get(name, name)}")]
    return [np.array(ss.eigenvalues(rig)), np.array([ss.critical_stiffness(rig), *edges])]


def beyond(own, mass):
    """Kind of the onset, cycles, and the kick that is too large."""
    rig = renamed(
        own, contact=ss.laws.ConstantNormalStress(preload=5e6), mass=mass, radiation_damping=1e4, stiffness=7e9
    )
    onset = ss.hopf(rig)
    cycle = ss.cycles(rig, "slider.stiffness", between=(7.3e9, 7.5e9), doublings=0)
    kick = ss.threshold(
        renamed(own, contact=ss.laws.ConstantNormalStress(preload=5e6), mass=mass, stiffness=7.8e9), kick="velocity"
    )
    periods = [np.array([one.period, one.peak_velocity]) for one in cycle.cycles]
    return [np.array([onset.coefficient, onset.value]), *periods, np.array([kick.size])]


def fitted(own, mass):
    """A fit to a record that the rig itself made."""
    rig, names = renamed(own, contact=ss.laws.ConstantNormalStress(preload=5e6), mass=mass, stiffness=2e10), dict(own)
    run = ss.simulate(
        rig, ss.protocol.VelocityStep(at=5.0, to=3e-6), until=30.0, times=np.linspace(0, 30, 301), events=False
    )
    rest = {"friction": run["friction"], "normal": run["normal_stress"], "displacement": run["load_displacement"]}
    record = ss.record_from_arrays(time=run["t"], **rest, source="synthetic")
    fit = ss.fit(rig, record, free=[f"friction.{names.get(one, one)}" for one in ("a", "b", "d_c")])
    return [np.array([one.value for one in fit.estimates])]


def printed(own, mass):
    """The page's JavaScript, in which names stand only as texts."""
    rig = renamed(own, mass=mass)
    return [part(rig, *more)[0] for part, more in ((linear_part, ()), (motion_part, (0,)))]


ASKED = {one.__name__: one for one in (moved, of_machine, judged, printed, fitted, beyond)}


def differing(what, own, mass):
    """Number of answers that change in any bit under other names."""
    one, two = ASKED[what]((), mass), ASKED[what](own, mass)
    same = [
        a == b if isinstance(a, str) else np.array_equal(a, b, equal_nan=True) for a, b in zip(one, two, strict=True)
    ]
    return same.count(False)
