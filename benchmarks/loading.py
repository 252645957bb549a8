"""How well do default fits find the truth when sensors are noisy, glitch and slip? A table by cell.

    python benchmarks/loading.py replicates.csv [--replicates 200] [--minutes 60] [--noise 0,30,140] ...

Records are made by an integrator of their own: the equations typed by hand, SciPy's LSODA, restarted at every change of
the loading. Every cell is one design, noise of the displacement (nm), glitches of 2 to 5 um, slips of the sensor's
level, noise of the normal stress. Reported, over all replicates: mean deviation in quoted errors (bias), and how often
68 and 95 % intervals contain the truth, for a, b, d_c, stiffness and (where normal stress changes) alpha; and how often
the loading was found with the right number of changes. Every replicate has noise of its own; the file is added to, so
that a campaign can be ended and gone on with, all cells side by side. `loading.txt` is what it printed last.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import time as clock
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from quick import QUICK, parsed
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


@dataclass(frozen=True)
class Cell:
    """One design and its sensors: noise in nm, numbers of glitches and of slips, noise of the stress as a share."""

    design: str
    noise: float
    glitches: int
    slips: int
    stress_noise: float

    def __str__(self) -> str:
        return f"{self.design},{self.noise:g},{self.glitches},{self.slips},{self.stress_noise:g}"

    @property
    def names(self) -> tuple[str, ...]:
        return QUANTITIES if DESIGNS[self.design].pressed else QUANTITIES[:4]


@cache
def clean(name: str) -> tuple[np.ndarray, ...]:
    """Time, friction, displacement and normal stress without noise."""
    design = DESIGNS[name]
    t = np.arange(0.0, design.until, design.spacing)
    return t, truth(design, t), design.load(t), design.stress(t)


def replicate(cell: Cell, seed: int, i: int) -> str:
    """One line: the cell, its replicate, whether the loading was found, CPU seconds, deviations in quoted errors."""
    design = DESIGNS[cell.design]
    t, friction, load, stress = clean(cell.design)
    rng = np.random.default_rng([seed, i, *str(cell).encode()])
    record = ss.record_from_arrays(
        t, friction=friction + correlated(rng, len(t)),
        normal=1e6 * stress * (1 + cell.stress_noise * rng.standard_normal(len(t))),
        displacement=1e-6 * spoiled(rng, t, load, cell.noise, cell.glitches, cell.slips),
    )  # fmt: skip
    rig = ss.lab_rig(normal_memory="linker-dieterich" if design.pressed else "none")
    begin = clock.process_time()
    course = record.loading.load
    right = course is not None and course.curve is None and len(course.changes) == len(design.rates) - 1
    own: list[float] = []
    try:
        fit = ss.fit(rig, record)
    except (ss.NotAvailable, ss.ParameterError):
        pass
    else:
        for name in cell.names:
            k = fit.index(name)
            off = fit.coordinates[k] - fit.space.unknowns[k].coordinate(TRUTH[name])
            own.append(float(off / np.sqrt(fit.covariance[k, k])))
    seconds = clock.process_time() - begin
    return ",".join([str(cell), str(i), str(int(right)), f"{seconds:.3f}", *(f"{z:.4f}" for z in own)])


def table(path: Path) -> None:
    """What a file of replicates says, cell by cell."""
    found: dict[Cell, list[list[float]]] = {}
    for line in path.read_text().splitlines():
        name, noise, glitches, slips, stress, _, *numbers = line.split(",")
        cell = Cell(name, float(noise), int(glitches), int(slips), float(stress))
        found.setdefault(cell, []).append([float(x) for x in numbers])
    print("design             nm gl sl  sig %     n right fail  CPU s | quantity: bias in errors, within 68 and 95 %")
    for cell, rows in found.items():
        z = np.array([row[2:] for row in rows if len(row) > 2]).reshape(-1, len(cell.names))
        right, seconds = np.mean([row[0] for row in rows]), np.median([row[1] for row in rows])
        parts = []
        for n, column in zip(cell.names, z.T, strict=True):
            known = column[np.isfinite(column)]
            shares = [float(np.mean(np.abs(known) < limit)) for limit in (0.9945, 1.96)]
            parts.append(f"{n.rpartition('.')[2]:>9} {np.mean(known):+5.2f} {shares[0]:4.2f} {shares[1]:4.2f}")
        head = f"{cell.design:<16} {cell.noise:>4.0f} {cell.glitches:>2} {cell.slips:>2} {1e2 * cell.stress_noise:5.2f}"
        print(f"{head} {len(rows):>5} {right:5.2f} {len(rows) - len(z):>4} {seconds:6.2f} |" + " |".join(parts))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, nargs="?" if QUICK else None, help="of replicates; it is added to")
    parser.add_argument("--replicates", type=int, default=200, help="up to so many a cell, counting those in the file")
    parser.add_argument("--minutes", type=float, default=np.inf, help="end after so long")
    parser.add_argument("--designs", default=",".join(DESIGNS))
    parser.add_argument("--noise", default="140,0,30", help="of the displacement, nm")
    parser.add_argument("--glitches", default="4,0")
    parser.add_argument("--slips", default="3,0")
    parser.add_argument("--stress-noise", default="0.0005,0", help="as a share")
    parser.add_argument("--seed", type=int, default=1)
    few = {"replicates": 1, "noise": "0", "glitches": "0", "slips": "0", "stress_noise": "0"}
    with tempfile.TemporaryDirectory() as folder:
        replicates(parsed(parser, file=Path(folder) / "replicates.csv", designs=next(iter(DESIGNS)), **few))


def replicates(chosen: argparse.Namespace) -> None:
    """Add to the file what is missing of the replicates, and print the table."""
    end = clock.monotonic() + 60 * chosen.minutes
    lists = [[float(x) for x in text.split(",")]
             for text in (chosen.noise, chosen.glitches, chosen.slips, chosen.stress_noise)]  # fmt: skip
    cells = [Cell(name, noise, int(g), int(s), stress) for noise, g, s, stress, name in
             itertools.product(*lists, chosen.designs.split(","))]  # fmt: skip
    done = chosen.file.read_text().splitlines() if chosen.file.exists() else []
    count = Counter(",".join(line.split(",")[:5]) for line in done)
    with chosen.file.open("a") as file:
        for i in range(chosen.replicates):
            for cell in cells:
                if count[str(cell)] <= i and clock.monotonic() < end:
                    file.write(replicate(cell, chosen.seed, i) + "\n")
                    file.flush()
    table(chosen.file)


if __name__ == "__main__":
    main()
