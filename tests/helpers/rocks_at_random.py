"""Populations of rocks with known means, spreads and correlations: do intervals hold the truth, is P(b > a) right?

    python tests/helpers/rocks_at_random.py [--count 30] [--seed 0] [--rocks 5]

Each case draws a population: medians of a and d_c, a − b that every rock has alike, or that differs a little, and
spreads of a and d_c that go together. Each rock has one noisy record with a velocity step, fitted on its own. Printed
are the shares of 95 % intervals that hold the means, spreads, and the parameters of one more rock, and the largest
error of the probability that another rock has b > a.
"""

import argparse
import time
from dataclasses import dataclass
from math import erf, sqrt

import numpy as np

import lab_records as lab
import steadyslip as ss

NAMES = ("friction.a", "a - b", "friction.d_c")


@dataclass(frozen=True)
class Rocks:
    """Population: medians of a and d_c (m), mean of a − b; spreads of ln a, a − b and ln d_c; correlation of the first
    and the last."""

    a: float
    level: float
    d_c: float
    spreads: tuple[float, float, float]
    correlation: float

    def drawn(self, random):
        """a, a − b and d_c of one rock."""
        first, second, third = random.standard_normal(3)
        third = self.correlation * first + sqrt(1 - self.correlation**2) * third
        x, y, z = (s * u for s, u in zip(self.spreads, (first, second, third), strict=True))
        return self.a * np.exp(x), self.level + y, self.d_c * np.exp(z)

    @property
    def weakening(self):
        """Probability of b > a."""
        if not self.spreads[1]:
            return float(self.level < 0)
        return 0.5 * (1 + erf(-self.level / self.spreads[1] / sqrt(2)))


def rocks_at_random(random, alike=True):
    """A population; with a − b alike in every rock, of either sign."""
    level = float(random.choice([-1, 1])) * 10 ** random.uniform(-3, -2.4)
    spread = 0.0 if alike else abs(level) * random.uniform(0.2, 1.0)
    return Rocks(
        random.uniform(0.009, 0.015), level, 10 ** random.uniform(-5.2, -4.7),
        (random.uniform(0.05, 0.3), spread, random.uniform(0.05, 0.4)), random.uniform(-0.9, 0.9),
    )  # fmt: skip


def fitted(one, random):
    """Fit to a record of a rock with a, a − b and d_c."""
    a, level, d_c = one
    stiffness = max(2e10, 4 * lab.STRESS * abs(level) / d_c)
    rig = lab.rig(a=a, b=a - level, d_c=d_c).with_values({"slider.stiffness": stiffness})
    protocol = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=40.13, to=5e-6),), until=40 + 8 * d_c / 1e-6)
    return ss.fit(ss.lab_rig(), lab.record(rig, protocol, int(random.integers(2**31)), count=500))


def case(random, rocks, alike):
    """Whether each 95 % interval holds the truth, by its name; and the error of the probability of b > a."""
    truth = rocks_at_random(random, alike)
    fits = {f"rock {j + 1}": fitted(truth.drawn(random), random) for j in range(rocks)}
    found = ss.population(fits, ["a", "b", "d_c"], count=1000, seed=int(random.integers(2**31)))
    hits = {}
    new, middles = truth.drawn(random), (truth.a, truth.level, truth.d_c)
    for name, middle, spread, value in zip(NAMES, middles, truth.spreads, new, strict=True):
        mean, other, (_, low, high) = found.mean(name), found.another(name), found.spread(name)
        hits[f"mean {name}"] = mean.low <= middle <= mean.high
        hits[f"next {name}"] = other.low <= value <= other.high
        if spread:
            hits[f"spread {name}"] = low <= spread <= high
    other = found.another("a - b")
    return hits, found.weakening - truth.weakening, other.error


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rocks", type=int, default=5)
    parser.add_argument("--differ", action="store_true", help="a - b differs from rock to rock")
    given = parser.parse_args()
    begin, every, errors = time.process_time(), [], []
    for i in range(given.count):
        hits, error, spread = case(np.random.default_rng([given.seed, i]), given.rocks, not given.differ)
        every.append(hits)
        errors.append(error)
        missed = ", ".join(name for name, hit in hits.items() if not hit) or "none"
        print(f"{i}: P(b > a) off by {error:+.3f}, next a - b ± {spread:.2g}, missed: {missed}", flush=True)
    for name in every[0]:
        print(f"{name}: {np.mean([one[name] for one in every]):.3f}")
    print(f"P(b > a) off by {np.max(np.abs(errors)):.3f} at most; {time.process_time() - begin:.0f} CPU s")


if __name__ == "__main__":
    main()
