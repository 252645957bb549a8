"""Do intervals of populations contain the truth as often as they say, with 3 to 10 experiments?

    python benchmarks/population.py [--trials 200]

Two coordinates that every experiment tells with correlated errors, of a population with known mean and spread.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from quick import QUICK, parsed

from steadyslip.experiments.numerics.pooling import ExperimentEstimate, pooled

MEAN = np.array([-4.5, 1.2])


def trial(rng: np.random.Generator, count: int, spread: np.ndarray, seed: int) -> list[bool]:
    """Whether 95 % intervals of mean, spread, the first member and another experiment contain the truth."""
    told, truth = [], []
    for _ in range(count):
        own = MEAN + spread * rng.standard_normal(2)
        deviation = np.array([0.03, 0.04]) * 10 ** rng.uniform(-0.3, 0.3, 2)
        covariance = np.outer(deviation, deviation) * np.array([[1.0, 0.8], [0.8, 1.0]])
        told.append(
            ExperimentEstimate(np.arange(2), rng.multivariate_normal(own, covariance), covariance, np.array([1.0]))
        )
        truth.append(own)
    found = pooled(told, 2, np.ones(2), 1000, seed)
    other = found.another(seed)
    wanted = [(found.mean[:, 0, 0], MEAN[0]), (found.spread[:, 0], spread[0]), (found.members[:, 0, 0], truth[0][0]),
              (other[:, 0], MEAN[0] + spread[0] * rng.standard_normal())]  # fmt: skip
    return [bool(np.quantile(draws, 0.025) <= value <= np.quantile(draws, 0.975)) for draws, value in wanted]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    trials = parsed(parser, trials=1).trials
    print("experiments  spread of errors   mean  spread  member  another   CPU s each")
    for count in (3,) if QUICK else (3, 4, 6, 10):
        for spread in (0.1,) if QUICK else (0.02, 0.1, 0.4):
            begin = time.process_time()
            hits = [trial(np.random.default_rng([count, int(1e3 * spread), i]), count, np.array([spread, 0.05]), i)
                    for i in range(trials)]  # fmt: skip
            shares = np.mean(hits, axis=0)
            seconds = (time.process_time() - begin) / trials
            print(
                f"{count:>11}  {spread / 0.03:>16.1f}  " + "  ".join(f"{x:5.3f}" for x in shares) + f"  {seconds:.2f}"
            )


if __name__ == "__main__":
    main()
