"""Random rigs of every law, contact and drive, and whether every sentence of their verdict is true by another route.

The other route: eigenvalues of the rig with one number changed, from the Jacobian of its state space, and the paper's
conditions; never the verdict's own search. ``python tests/helpers/words_at_random.py 1000`` scans on.
"""

import math
import re
import sys
import warnings

import numpy as np

import steadyslip as ss
from steadyslip.core.errors import NoSteadySliding, NotAvailable, ParameterError
from steadyslip.laws.friction.law import State
from steadyslip.laws.friction.normal_memory import NoMemory
from steadyslip.linear.state_space import jacobian
from steadyslip.verdict.causes import why_never_stable

V0 = 1e-6


def some_rig(rng):
    """Any rig; numbers within two decades of a laboratory's."""
    a = 10 ** rng.uniform(-3, -1.5)
    b = a * rng.choice([rng.uniform(1.02, 3), rng.uniform(0.2, 1)], p=[0.8, 0.2])
    d_c = 10 ** rng.uniform(-6.5, -4.5)
    alpha = rng.choice([0.0, rng.uniform(0.05, 1.2)])
    memory = [NoMemory(), ss.laws.LinkerDieterich(alpha=alpha), ss.laws.PrakashClifton(direct_share=rng.uniform(0, 1))]
    common = {"a": a, "mu_ref": rng.uniform(0.2, 0.9), "v_ref": V0, "normal_memory": memory[rng.integers(3)]}
    evolution = [ss.laws.Slip(), ss.laws.Aging(), ss.laws.PRZ(), ss.laws.Nagata(c_nagata=rng.uniform(0.1, 2))][
        rng.integers(4)
    ]
    law = rng.integers(6)
    if law == 0:
        size = 10 ** rng.uniform(3, 5)
        friction = ss.laws.LuGre(mu_coulomb=0.2, mu_static=rng.uniform(0.15, 0.4), v_stribeck=10 ** rng.uniform(-7, -4),
                            bristle_stiffness=size, bristle_damping=10 ** rng.uniform(-1, 2),
                            viscous=rng.choice([0.0, 10 ** rng.uniform(0, 4)]))  # fmt: skip
    elif law == 1:
        states = [State(b=b, d_c=d_c), State(b=a * rng.uniform(-0.5, 1), d_c=d_c * 10 ** rng.uniform(-2, 2))]
        friction = ss.laws.RateState(
            **(common | {"normal_memory": memory[rng.integers(2)]}), states=states, evolution=ss.laws.Slip()
        )
    else:
        friction = ss.laws.RateState(**common, b=b, d_c=d_c, evolution=evolution, regularised=bool(rng.integers(2)))
    sigma = 10 ** rng.uniform(5, 7.5)
    k = sigma * abs(b - a) / d_c * 10 ** rng.uniform(-1, 1)
    angle = rng.uniform(-1.2, 1.4)
    sign = rng.choice([-1.0, 1.0])
    contact = [
        lambda: ss.laws.ConstantNormalStress(preload=sigma),
        lambda: ss.laws.InclinedSpring(preload=sigma, angle=angle),
        lambda: ss.laws.InclinedSpring(preload=sigma, angle=angle),
        lambda: ss.laws.Triaxial(confining_pressure=sigma, angle=abs(angle)),
        lambda: ss.laws.SelfEnergising(preload=sigma, gain=rng.uniform(-2, 2)),
        lambda: ss.laws.DilatingLayer(
            preload=sigma, ram_stiffness=1e11, dilatancy=sign * 10 ** rng.uniform(-9, -6), v_ref=V0
        ),
        lambda: ss.laws.Lift(preload=sigma, lift=sign * sigma * 10 ** rng.uniform(-3, 0) / V0 * a, v_ref=V0),
        lambda: ss.laws.SlopedGuide(preload=sigma, guide_stiffness=10 ** rng.uniform(8, 11),
        slope=rng.uniform(-0.5, 0.5)),
        lambda: ss.laws.LinearNormalStress(steady_normal_stress=sigma, b0=rng.choice([0, 1e9, -1e7, 1e11]),
        b1=rng.choice([0, 1, -1])
                          * a * sigma / V0 * rng.uniform(0, 2), b2=rng.uniform(-2, 2), b3=rng.choice([0, 1, -1]) * k),
    ][rng.integers(9)]()  # fmt: skip
    rest = {"mass": rng.choice([0.0, a * sigma * d_c / V0**2 * 10 ** rng.uniform(-6, 1.5)])}
    rest["damping"] = rng.choice([0.0, a * sigma / V0 * 10 ** rng.uniform(-4, 0.5)], p=[0.7, 0.3])
    rest["radiation_damping"] = rng.choice([0.0, a * sigma / V0 * 10 ** rng.uniform(-4, 0.5)], p=[0.6, 0.4])
    drive = ss.machine.SteadyDrive(V0)
    kind = rng.integers(6)
    if kind == 0:
        drive = ss.machine.PD(V0, kp=k, kd=rest.pop("damping") + 1.0)
    if kind == 1:
        drive = ss.machine.PID(V0, kp=k, ki=k * V0 / d_c * 10 ** rng.uniform(-3, 1), kd=rest.pop("damping") + 1.0)
    return ss.Slider(friction=friction, contact=contact, stiffness=k * rng.uniform(0.3, 2), drive=drive, **rest)


def eigenvalues_of(rig):
    """Eigenvalues of the Jacobian of the equations of motion; None without steady sliding or if ill-posed."""
    try:
        return np.linalg.eigvals(jacobian(rig))
    except NoSteadySliding:
        return None


def fate(rig):
    """Fate of small disturbances as a word: stable, oscillation, growth, absent or ill-posed."""
    try:
        rates = ss.eigenvalues(rig)
        if np.isinf(ss.growth_rate(rig)):
            return "ill-posed"
        found = eigenvalues_of(rig)
    except NotAvailable as error:
        beyond = "floating point", "double precision"  # of numbers: of the rig this tells nothing
        return "undecided" if any(words in str(error) for words in beyond) else "ill-posed"
    if found is None or np.all(np.isnan(rates)):
        return "absent"
    if abs(found.real.max()) < 1e-11 * np.abs(found).max():  # less than this route can tell beside fast eigenvalues
        return "undecided"
    if found.real.max() < 0:
        return "stable"
    return "oscillation" if abs(found[np.argmax(found.real)].imag) > 0 else "growth"


BEYOND = {"an oscillation grows": ("oscillation",), "a disturbance grows without oscillating": ("growth",),
          "becomes stable": ("stable",), "the equations become ill-posed": ("ill-posed",), "it locks up": ("absent",),
          "it lifts off": ("absent",), "steady sliding ceases to exist": ("absent",),
          "slides steadily, but unstable": ("oscillation", "growth", "ill-posed")}  # fmt: skip


def changed(rig, name, value):
    try:
        return rig.with_values({name: value})
    except ParameterError:
        return None


def false_sentences(rig):
    """Every sentence of a verdict that another route does not bear out."""
    verdict = ss.analyze(rig)
    text = re.sub(r"\s+", " ", str(verdict))
    found = [f"{word!r} in the text" for word in ("nan", " inf ", "None") if re.search(rf"(?<!\w){word}(?!\w)", text)]
    own = fate(rig)
    if own == "undecided":
        return found
    if verdict.on_edge:
        return found + ([] if text.startswith("ON THE EDGE") else ["edge not said"])
    if verdict.stable != {"stable": True, "absent": None}.get(own, False):
        found.append(f"headline {text[:9]}, but {own}")
    if verdict.stable is None:
        return found
    found += [*_stiffness(rig, verdict, text), *_edges(rig, verdict, str(verdict)), *_causes(rig, verdict, text)]
    if ("run-away (blow-up)" in text) != (
        own in ("oscillation", "growth") and isinstance(rig.friction, ss.laws.RateState)
        and not (rig.mass or rig.damping or rig.radiation_damping or rig.drive.dashpot())
    ):  # fmt: skip
        found.append("run-away")
    if "stick-slip sets in" in text or "may still start stick-slip" in text:
        found.append("stick-slip is promised")
    near = "this rig is near" in text
    onset = verdict.onset
    if onset is not None and onset.kind == "subcritical":
        name = onset.along
        amplitude = abs(onset.growth_slope * (rig.parameters()[name].value - onset.value) / onset.coefficient) ** 0.5
        if near != (bool(verdict.stable) and amplitude < 1 and _same_side(rig, verdict)):
            found.append(f"near a subcritical edge: said {near}, amplitude {amplitude}")
    elif near:
        found.append("near an edge that is not subcritical")
    return found


def _same_side(rig, verdict):
    onset = verdict.onset
    return (rig.parameters()[onset.along].value > onset.value) == (onset.stable == "above")


def _stiffness(rig, verdict, text):
    """Faults of a sentence on all stiffnesses, found at many of them."""
    edges = [end for pair in verdict.stable_stiffness for end in pair if 0 < end < math.inf]
    size = rig.stiffness
    tried = np.unique(
        np.concatenate([size * np.geomspace(1e-4, 1e4, 9)] + [e * np.array([0.999, 1.001]) for e in edges])
    )
    gain = float(rig.drive.proportional())
    for k in tried:
        outcome = fate(rig.with_values({"stiffness": float(k)}))
        if outcome == "undecided":
            continue
        is_stable = outcome == "stable"
        said = any(low < k < high for low, high in verdict.stable_stiffness)
        if is_stable != said:
            yield f"stable stiffness: k = {k:.4g} is {'' if is_stable else 'un'}stable"
        critical = verdict.critical_stiffness
        for side in ("above", "below"):
            if f"{side} which sliding is stable" in text and is_stable != ((k > critical) == (side == "above")):
                yield f"{side} which: k = {k:.4g}, gain {gain:.4g}"
        if is_stable and "no stiffness makes sliding stable" in text:
            yield f"no stiffness, but k = {k:.4g} is stable"
        if not is_stable and "sliding is stable at every stiffness" in text:
            yield f"every stiffness, but k = {k:.4g} is not stable"


def _edges(rig, verdict, text):
    """Every edge in the table, just before it and just beyond."""
    own = fate(rig)
    for margin in verdict.margins:
        if margin.edge is None or not margin.absolute:  # none, or a regime that begins at zero
            continue
        first, last = margin.parameter.partition(".")[0], margin.parameter.rpartition(".")[2]
        rows = [row for row in text.splitlines() if "->" in row and row.startswith("  ")]
        line = next(r for r in rows if r.split()[0] in (margin.parameter, f"{first}.{last}"))
        words = next((w for w in BEYOND if line.endswith(w)), None)
        if words is None:
            yield f"unknown words: {line}"
            continue
        found = [list(_beside(rig, margin, own, words, share)) for share in (1e-7, 1e-4)]  # rounding, or another edge
        if all(found):
            yield f"{line.strip()}: {found[0][0]}"


def _beside(rig, margin, own, words, share):
    """Faults of an edge, from the verdicts at two values this share of the edge away from it."""
    step = min(share * abs(margin.edge.value or margin.value), 0.5 * abs(margin.absolute))
    step = math.copysign(step, margin.absolute)
    before, beyond = (changed(rig, margin.parameter, margin.edge.value + s) for s in (-step, step))
    if before is not None and fate(before) != "undecided" and (fate(before) == "stable") != (own == "stable"):
        yield f"{fate(before)} already before"
    if beyond is not None and fate(beyond) not in (*BEYOND[words], "undecided"):
        yield f"{fate(beyond)} beyond"


def _causes(rig, verdict, text):
    """Reasons, by taking away what they name."""
    if "with this mass" in text:
        light = rig.with_values({"mass": 0.0})
        if not rig.mass or "a disturbance grows at every stiffness" in why_never_stable(ss.analyze(light)):
            yield "with this mass: without it as well"
        if not ss.stable_stiffness(light).size or np.all(np.isnan(ss.stable_stiffness(light))):
            yield "with this mass: nor is it stable without"
    known = None
    with_closed_form = True
    try:
        known = ss.small_signal(rig)
    except NotAvailable:
        with_closed_form = False
    if "by more than the spring's pull" in text and not (with_closed_form and 1 + known.f1 * known.B2 < 0):
        yield "spring's pull"
    if "the resistance to steady sliding" in text and known is not None:
        velocities = rig.drive.velocity * np.array([1.0, 1.0001])
        slope = _resistance(rig, velocities[1]) - _resistance(rig, velocities[0])
        if slope < -1e-12 * abs(_resistance(rig, velocities[0])):
            yield f"resistance falls by {slope}"
    if "without oscillating (static stability" in text and "fails at every stiffness" in text:
        for k in rig.stiffness * np.geomspace(1e-4, 1e4, 9):
            if not ss.analyze(rig.with_values({"stiffness": float(k)})).characteristic_polynomial[0] <= 0:
                yield "static stability"


def _resistance(rig, velocity):
    """Steady stress that the slip resists with, dampings included, at a slip velocity: by the small-signal route."""
    known = ss.small_signal(rig)
    steady = ss.steady_state(rig)
    return steady.shear_stress + (known.S + known.mu * known.B1) * (velocity - rig.drive.velocity)


def scan(count, seed=0):
    """Print what is false in `count` verdicts; returns how many verdicts had something."""
    bad = 0
    for i in range(count):
        if i and i % 100 == 0:
            print(f"{i} of {count}", file=sys.stderr, flush=True)
        rng = np.random.default_rng([seed, i])
        try:
            rig = some_rig(rng)
        except ParameterError:
            continue
        try:
            found = false_sentences(rig)
        except NotAvailable as error:
            print(i, "not available:", error)
            continue
        except Exception as error:  # a traceback is a finding like any other, and the scan goes on
            found = [f"{type(error).__name__}: {error}"]
        if found:
            bad += 1
            print(i, found, flush=True)
    return bad


if __name__ == "__main__":
    warnings.simplefilter("error")
    print(scan(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0), "verdicts with a false sentence")
