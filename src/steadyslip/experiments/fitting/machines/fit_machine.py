"""Fit of a machine to records: search, weights of the columns from the scatter of their residuals, errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.at_minimum import fit_with_errors
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.machines.machine_plan import MachineComparison, MachinePlan
from steadyslip.experiments.fitting.machines.machine_planning import make_machine_plan
from steadyslip.experiments.fitting.machines.machine_result import MachineFit
from steadyslip.experiments.fitting.machines.near import find_near
from steadyslip.experiments.fitting.machines.series import EXACT
from steadyslip.experiments.fitting.search import MAX_ITERATIONS, Progress
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.numerics.least_squares import DAMPING_NEAR, minimise
from steadyslip.machine.machine import Machine

MAX_WEIGHINGS = 8  # largest number of times that the scatter of the columns is estimated; three usually suffice
ALIKE = 0.02  # weights are final if the scatter changes by a smaller share: the estimates then change no more


def fit_machine(
    machine: Machine, records: Any, free: Sequence[str] | None = None, *, errors: str = "auto", starts: int = STARTS,
    effort: float = 1.0, threads: int | None = None, progress: Progress | None = None, **options: Any,
) -> MachineFit:  # fmt: skip
    """Fit of a machine to records; see `steadyslip.fit`.

    As columns hold different quantities, each column is weighted by its noise, which is estimated from its residuals.
    """
    plan = make_machine_plan(machine, records, free, errors=errors, starts=starts, effort=effort, **options)
    space = plan.space()
    size = sum(len(one.data) for one in plan.series)
    allowed = Effort(threads, budget=Budget.of_fit(size, len(space), effort))
    z, summary, comparison = find_near(plan, starts, allowed, progress)
    for _ in range(MAX_WEIGHINGS if len(plan.series) > 1 else 0):
        scatter = _scatter(plan, comparison, z)
        known = plan.scatter or tuple(one.size for one in plan.series)
        exact = [np.sqrt(EXACT) * one.size for one in plan.series]
        if all(abs(a / b - 1) < ALIKE or a == c for a, b, c in zip(scatter, known, exact, strict=True)):
            break
        plan = replace(plan, scatter=scatter)
        comparison = plan.comparison(allowed)
        ends = minimise(
            lambda x, _, own=comparison: own.residuals(x), z[None], comparison.low, comparison.high,  # type: ignore[misc]
            most=MAX_ITERATIONS, damping=DAMPING_NEAR, stop=allowed.budget.part(np.inf),
        )  # fmt: skip
        z = ends.coordinates[0]
        summary = replace(summary, converged=bool(ends.converged[0]))
    bounds = (comparison.low, comparison.high)
    return fit_with_errors(MachineFit, plan, comparison, z, summary, errors, bounds)


def _scatter(plan: MachinePlan, comparison: MachineComparison, z: Array) -> tuple[float, ...]:
    """Standard deviation of each series about the model, in SI units; at least the error of numerical integration."""
    r = (comparison.data - comparison.model(z[None])[0][0]) * comparison.weights
    before = plan.scatter or tuple(one.size for one in plan.series)
    return tuple(
        max(float(np.sqrt(np.mean(r[where] ** 2))) * size, np.sqrt(EXACT) * one.size)
        for one, where, size in zip(plan.series, comparison.slices, before, strict=True)
    )
