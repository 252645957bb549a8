"""Limits on the work of a fit, counted in integration steps so that results are the same on every computer.

The limits were chosen by trial so that nearly all fits converge within them; larger limits cost time in fits whose
model cannot follow the record.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.experiment import LANES

MAX_STEPS_PER_ROW = 40  # a motion is given up after this many integration steps per row of the input table, on average
MIN_WORK = 6e7  # units of work (see `Budget`) that the search of one model may use, however short its records
PASSES = 1000.0  # further work for the search of one model: this many integrations with one step per sample
MODELS = 5.0  # largest work of one fit, nested models included, as a multiple of the work of one search


class Budget:
    """Work that a fit may do, and work that it has done.

    Eight motions are integrated at a time, one in each SIMD lane. One step of the slowest of them counts as one unit of
    work for each number that is integrated in a motion (state variables and their derivatives).

    Parameters
    ----------
    total : float
        Units of work that may be spent.
    scale : float
        Work of the search of one model, as a multiple of the default.
    """

    def __init__(self, total: float = np.inf, scale: float = 1.0) -> None:
        self.total, self.scale, self.spent = total, scale, 0.0

    @classmethod
    def of_fit(cls, samples: int, unknowns: int, scale: float = 1.0) -> Budget:
        """Budget of a fit with the given numbers of samples and unknowns."""
        return cls(MODELS * scale * work_of_search(samples, unknowns), scale)

    def spend(self, steps: Array, carried: int) -> None:
        """Add the work of motions that took `steps` (jobs,), each with `carried` integrated numbers."""
        groups = np.zeros(-(-len(steps) // LANES) * LANES)
        groups[: len(steps)] = steps
        self.spent += float(np.sum(np.max(groups.reshape(-1, LANES), axis=1, initial=0.0))) * carried

    def part(self, work: float) -> Allowance:
        """Allowance of `work` further units, or of the rest of the budget if that is less."""
        return Allowance(self, min(self.spent + work, self.total))


@dataclass(eq=False)
class Allowance:
    """Part of a budget; a call of the allowance returns True once this part is spent.

    Attributes
    ----------
    budget : Budget
    end : float
        Value of ``budget.spent`` at which the allowance is spent.
    was_met : bool
        True once a call has returned True, which ends a computation early.
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
    """Limits on the integration of a model.

    Attributes
    ----------
    threads : int or None
        Number of threads; all cores if None.
    patience : int
        A motion is given up after this number of steps per row of the input table, on average.
    growth : float
        A motion is given up after this multiple of the steps of the slowest motion that was completed.
    budget : Budget
        Budget of the fit to which the runs belong.
    """

    threads: int | None = None
    patience: int = MAX_STEPS_PER_ROW
    growth: float = np.inf
    budget: Budget = field(default_factory=Budget)


def work_of_search(samples: int, unknowns: int) -> float:
    """Units of work that the search of one model may use."""
    return MIN_WORK + PASSES * samples * (1 + unknowns)
