"""How well do default fits find the truth when sensors are noisy, glitch and slip? A table by cell.

    python benchmarks/loading.py [--replicates 200] [--designs steps,holds,...] [--noise 0,30,140] [--seed 1]

Records are made by an integrator of their own: the equations typed by hand, SciPy's LSODA, restarted at every change of
the loading. Every cell is one design, noise of the displacement (nm), glitches of 2 to 5 um, slips of the sensor's
level, noise of the normal stress. Reported, over all replicates: mean deviation in quoted errors (bias), and how often
68 and 95 % intervals contain the truth, for a, b, d_c, stiffness and (where normal stress changes) alpha; and how often
the loading was found with the right number of changes.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time as clock
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

import steadyslip as ss

A, B, DC, ALPHA, MU, STRESS, K = 0.0092, 0.0096, 9.4, 0.3, 0.61, 20.0, 6.6e-3  # um, s, MPa; K is k/sigma in 1/um
FRICTION_NOISE, MEMORY = 8e-4, 0.7
QUANTITIES = ("friction.a", "friction.b", "friction.d_c", "slider.stiffness", "friction.normal_memory.alpha")
TRUTH = dict(zip(QUANTITIES, (A, B, 1e-6 * DC, K * 1e6 * STRESS * 1e6, ALPHA), strict=True))


@dataclass(frozen=True)
class Design:
    """Rates (time, um/s) and stresses (time, MPa) from then on, or an oscillating stress (start, amplitude, period)."""

    until: float
    rates: tuple[tuple[float, float], ...]
    stresses: tuple[tuple[float, float], ...] = ((0.0, STRESS),)
    wave: tuple[float, float, float] | None = None
    spacing: float = 0.02
    ends: tuple[float, ...] = field(default=())

    @property
    def pressed(self) -> bool:
        return len(self.stresses) > 1 or self.wave is not None

    def load(self, t: np.ndarray) -> np.ndarray:
        found = self.rates[0][1] * t
        for (_, before), (at, after) in itertools.pairwise(self.rates):
            found = found + (after - before) * np.maximum(t - at, 0.0)
        return found

    def stress(self, t: np.ndarray) -> np.ndarray:
        found = np.full(np.shape(t), self.stresses[0][1])
        for at, value in self.stresses[1:]:
            found = np.where(t > at, value, found)
        if self.wave is not None:
            start, amplitude, period = self.wave
            found = found + np.where(t > start, amplitude * np.sin(2 * np.pi * (t - start) / period), 0.0)
        return found


DESIGNS = {
    "steps": Design(120.0, ((0.0, 3.0), (30.137, 10.0), (60.411, 3.0), (90.263, 10.0))),
    "slide-hold-slide": Design(140.0, ((0.0, 5.0), (25.13, 0.0), (35.31, 5.0), (60.22, 0.0), (90.47, 5.0))),
    "normal steps": Design(100.0, ((0.0, 3.0), (30.137, 10.0)), ((0.0, 20.0), (55.213, 21.0), (78.371, 20.0))),
    "pulses": Design(
        100.0,
        ((0.0, 3.0), (30.137, 10.0)),
        ((0.0, 20.0), (50.21, 21.5), (55.43, 20.0), (75.17, 18.5), (80.29, 20.0)),
    ),
    "harmonic": Design(110.0, ((0.0, 3.0), (30.137, 10.0)), wave=(50.0, 0.8, 6.0)),
}  # fmt: skip


def truth(design: Design, t: np.ndarray) -> np.ndarray:
    """Friction of the slip law with Linker and Dieterich's memory, in ln v and friction's own state."""
    v0 = design.rates[0][1]
    alpha = ALPHA if design.pressed else 0.0

    def rates(at: float, y: np.ndarray, load: float) -> list[float]:
        spring, phi = y  # spring stress over the first normal stress, and Theta + (alpha/b) ln(sigma/sigma0)
        share = float(design.stress(np.array(at))) / STRESS
        theta = phi - alpha / B * np.log(share)
        u = (spring / share - MU - B * theta) / A
        v = v0 * np.exp(u)
        return [K * (load - v), -v / DC * (u + theta)]

    moments = sorted({at for at, _ in (*design.rates, *design.stresses)} | ({design.wave[0]} if design.wave else set()))
    edges = [*moments, design.until]
    found, y = np.empty(len(t)), np.array([MU, 0.0])
    for start, end in itertools.pairwise(edges):
        load = [rate for at, rate in design.rates if at <= start][-1]
        inside = (t > start) & (t <= end) if start else (t <= end)
        nudge = 1e-9 if start else 0.0  # just behind a jump of the stress
        grid = np.concatenate([[start + nudge], t[inside][t[inside] > start + nudge], [end]])
        run = solve_ivp(
            rates, (grid[0], end), y, "LSODA", np.unique(grid), args=(load,), rtol=1e-9, atol=1e-12, max_step=0.5
        )
        found[inside] = np.interp(t[inside], run.t, run.y[0]) / (design.stress(t[inside]) / STRESS)
        y = run.y[:, -1]
    return found


def correlated(rng: np.random.Generator, count: int) -> np.ndarray:
    fresh = FRICTION_NOISE * np.sqrt(1 - MEMORY**2) * rng.standard_normal(count)
    found = np.empty(count)
    found[0] = FRICTION_NOISE * rng.standard_normal()
    for i in range(1, count):
        found[i] = MEMORY * found[i - 1] + fresh[i]
    return found


def spoiled(
    rng: np.random.Generator, t: np.ndarray, load: np.ndarray, noise: float, glitches: int, slips: int
) -> np.ndarray:
    found = load + 1e-3 * noise * rng.standard_normal(len(t))
    for _ in range(glitches):
        middle, width, height = rng.uniform(0, t[-1]), rng.uniform(0.05, 0.5), rng.uniform(2, 5) * rng.choice([-1, 1])
        found += height * np.exp(-0.5 * ((t - middle) / width) ** 2)
    for _ in range(slips):
        found += rng.uniform(-1.5, 1.5) * (t > rng.uniform(0, t[-1]))
    return found


def cell(name: str, noise: float, glitches: int, slips: int, stress_noise: float, count: int, seed: int) -> str:
    """One line of the table."""
    design = DESIGNS[name]
    t = np.arange(0.0, design.until, design.spacing)
    clean, load, stress = truth(design, t), design.load(t), design.stress(t)
    names = QUANTITIES if design.pressed else QUANTITIES[:4]
    deviations, right, failed, begin = [], 0, 0, clock.perf_counter()
    rig = ss.lab_rig(normal_memory="linker-dieterich" if design.pressed else "none")
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        record = ss.record_from_arrays(
            t, friction=clean + correlated(rng, len(t)),
            normal=1e6 * stress * (1 + stress_noise * rng.standard_normal(len(t))),
            displacement=1e-6 * spoiled(rng, t, load, noise, glitches, slips),
        )  # fmt: skip
        course = record.loading.load
        right += course is not None and course.curve is None and len(course.changes) == len(design.rates) - 1
        try:
            fit = ss.fit(rig, record)
        except (ss.NotAvailable, ss.ParameterError):
            failed += 1
            continue
        z, deviation = fit.coordinates, np.sqrt(np.diag(fit.covariance))
        own = []
        for name_of in names:
            k = fit.index(name_of)
            own.append((z[k] - fit.space.unknowns[k].coordinate(TRUTH[name_of])) / deviation[k])
        deviations.append(own)
    z = np.array(deviations).reshape(-1, len(names))
    with np.errstate(all="ignore"):
        parts = []
        for n, column in zip(names, z.T, strict=True):
            shares = [float(np.mean(np.abs(column) < limit)) for limit in (0.9945, 1.96)]
            parts.append(f"{n.rpartition('.')[2]:>9} {np.nanmean(column):+5.2f} {shares[0]:4.2f} {shares[1]:4.2f}")
    seconds = (clock.perf_counter() - begin) / max(count, 1)
    head = f"{name:<16} {noise:>4.0f} {glitches:>2} {slips:>2} {1e2 * stress_noise:5.2f}"
    return f"{head}  {right / count:5.2f} {failed:>3} {seconds:6.2f} |" + " |".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--replicates", type=int, default=200)
    parser.add_argument("--designs", default=",".join(DESIGNS))
    parser.add_argument("--noise", default="0,30,140", help="of the displacement, nm")
    parser.add_argument("--glitches", default="0,4")
    parser.add_argument("--slips", default="0,3")
    parser.add_argument("--stress-noise", default="0,0.0005", help="as a share")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    print("design             nm gl sl  sig %  right fail s/fit | quantity: bias in errors, share within 68 and 95 %")
    lists = [
        [float(x) for x in text.split(",")]
        for text in (chosen.noise, chosen.glitches, chosen.slips, chosen.stress_noise)
    ]
    for name, noise, glitches, slips, stress in itertools.product(chosen.designs.split(","), *lists):
        print(cell(name, noise, int(glitches), int(slips), stress, chosen.replicates, chosen.seed))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
