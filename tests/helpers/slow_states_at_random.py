"""Records with a second state of long slip distance, or with a true trend: what does the fit say of a - b?

python tests/helpers/slow_states_at_random.py WHAT 20 1 draws 20 records with seed 1, made with two `states` (rate
steps, the second slip distance 10 to 100 times the first) or with a linear `trend`, and prints for each what is named
as a better model, and for fits with `trend=1` and with two states the error of a - b in standard errors, NaN if none.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import steadyslip as ss
from fits_at_random import SLOW, simulated


@dataclass(frozen=True)
class Drawn:
    """A record, the law and a - b that it was made with."""

    record: ss.experiments.Record
    law: str
    weakening: float


def drawn(what: str, count: int, seed: int) -> Iterator[Drawn]:
    """So many records."""
    made = 0
    for rng in np.random.default_rng([seed, 31]).spawn(20 * count):
        try:
            yield _one(rng, what)
        except ValueError:
            continue
        made += 1
        if made == count:
            return


def _one(rng: np.random.Generator, what: str) -> Drawn:
    law = rng.choice(["slip", "aging"])
    a, d_c, stress = rng.uniform(0.006, 0.014), 10 ** rng.uniform(-5.3, -4.7), 10 ** rng.uniform(6.7, 7.6)
    b, share = a * rng.uniform(0.6, 1.4), rng.uniform(0.25, 0.6)
    far = 10 ** rng.uniform(1, 2)
    states = (
        ss.laws.State(b=b * (1 - share), d_c=d_c), ss.laws.State(b=b * share, d_c=d_c * far)
    )  # fmt: skip
    own = {"states": states} if what == "states" else {"b": b, "d_c": d_c}
    friction = ss.laws.RateState(
        a=a, mu_ref=rng.uniform(0.5, 0.7), v_ref=SLOW, evolution=getattr(ss.laws, law.title())(), **own
    )
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=stress)
    stiffness = stress * a / d_c * 10 ** rng.uniform(0.2, 1.0)
    rig = ss.Slider(friction=friction, contact=contact, stiffness=stiffness, drive=ss.machine.SteadyDrive(SLOW))
    unit, at, pieces = d_c / SLOW, 15 * d_c / SLOW, []
    for ratio in [(3.0,), (10.0, 1.0), (3.0, 10.0, 1.0)][rng.integers(3)]:
        pieces.append(ss.protocol.VelocityStep(at=at, to=ratio * SLOW))
        at += 18 * unit / ratio
    columns = simulated(rng, rig, ss.Protocol(pieces=tuple(pieces), until=at), 1200)
    if what == "trend":
        along = (columns["displacement"] - columns["displacement"][0]) / np.ptp(columns["displacement"])
        columns["shear"] = columns["shear"] + 10 ** rng.uniform(-3.3, -2) * rng.choice([-1, 1]) * along * stress
    return Drawn(ss.record_from_arrays(**columns, source=what), law, a - b)


def deviation(fit: ss.experiments.Fit, weakening: float) -> float:
    """Errors by which a - b is off; NaN where the fit has none."""
    own = next((one for one in fit.derived if one.name == "a - b"), None)
    return np.nan if own is None else (own.value - weakening) / own.error


def main(what: str, count: int, seed: int) -> None:
    found: dict[str, list[float]] = {"as it is": [], "trend": [], "states": []}
    both = 0
    for i, one in enumerate(drawn(what, count, seed)):
        text, named = "", ""
        for label, states, trend in (("as it is", 1, 0), ("trend", 1, 1), ("states", 2, 0)):
            begun = time.process_time()
            fit = ss.fit(ss.lab_rig(one.law, states=states), one.record, trend=trend)
            z = deviation(fit, one.weakening)
            found[label].append(z)
            text += f"  {label} {z:6.1f} (p {fit.whiteness.p:.0e}, {time.process_time() - begun:.1f} s)"
            if label == "as it is":
                near = [own for own in fit.remedies if own.gain > fit.remedies[0].gain - 6]
                named = "; ".join(f"{own.choice} {own.gain:.0f}" for own in near) or "nothing"
                both += any("trend" in own.choice for own in near) and any("states" in own.choice for own in near)
        print(f"{i:4d} {one.law:<6}{text}  named: {named}", flush=True)
    for label, z in found.items():
        own = np.abs(z)
        print(f"{label}: a - b quoted in {np.sum(np.isfinite(own))} of {count}, more than 3 errors off in"
              f" {np.sum(own > 3)}")  # fmt: skip
    print(f"both named in {both}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
