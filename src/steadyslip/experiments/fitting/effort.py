"""How much work a fit may be, counted in steps of the model, so that it ends at the same point on every machine."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.experiment import LANES

MOST_STEPS = 40  # per row of the table and lane, on average, before a motion is given up
LEAST_WORK = 6e7  # that the search of one model may be, however short its records,
RUNS = 1000.0  # and what so many runs through all samples are, a step each
MODELS = 5.0  # searches of models, the simpler ones inside it included, that one fit may be


class Budget:
    """Work that may be done, and how much of it has been.

    A unit of work is one step of eight motions side by side, of the slowest of them, times the numbers that each
    carries along: itself and its derivatives.

    Parameters
    ----------
    total : float
    scale : float
        Of the search of one model, as a multiple of what nearly always suffices.
    """

    def __init__(self, total: float = np.inf, scale: float = 1.0) -> None:
        self.total, self.scale, self.spent = total, scale, 0.0

    @classmethod
    def of_fit(cls, samples: int, unknowns: int, scale: float = 1.0) -> Budget:
        """That of a fit to so many samples."""
        return cls(MODELS * scale * work_of_search(samples, unknowns), scale)

    def spend(self, steps: Array, carried: int) -> None:
        """Count the steps of motions, (jobs,), that carried so many numbers each."""
        groups = np.zeros(-(-len(steps) // LANES) * LANES)
        groups[: len(steps)] = steps
        self.spent += float(np.sum(np.max(groups.reshape(-1, LANES), axis=1, initial=0.0))) * carried

    def part(self, work: float) -> Allowance:
        """So much of it from now on, if there is as much."""
        return Allowance(self, min(self.spent + work, self.total))


@dataclass(eq=False)
class Allowance:
    """Asked whether it is used up.

    Attributes
    ----------
    budget : Budget
    end : float
        Work that will have been done then.
    was_met : bool
        Whether it ever said so: something was left undone.
    """

    budget: Budget
    end: float
    was_met: bool = False

    def __call__(self) -> bool:
        over = self.budget.spent >= self.end
        self.was_met |= over
        return over


@dataclass(frozen=True, eq=False)
class Effort:
    """What running a model may cost.

    Attributes
    ----------
    threads : int or None
        All cores if None.
    patience : int
        Steps per row of the table and lane, on average, before a motion is given up.
    growth : float
        The same as a multiple of the steps of the slowest motion that came to its end so far.
    budget : Budget
        Of the fit to which the runs belong.
    """

    threads: int | None = None
    patience: int = MOST_STEPS
    growth: float = np.inf
    budget: Budget = field(default_factory=Budget)


def work_of_search(samples: int, unknowns: int) -> float:
    """Work that the search of one model may be."""
    return LEAST_WORK + RUNS * samples * (1 + unknowns)
