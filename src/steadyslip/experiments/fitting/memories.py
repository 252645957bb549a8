"""Search for memories of normal stress that fit as well as no memory: parameters that they change are not determined.

The response to a step of normal stress depends on the memory (α) together with a, b, d_c and the stiffness. A law
without a memory assumes α = 0 and gives small errors of the other parameters, which hold only if α is 0. With another
evolution law, a memory may be needed although the law of the fit needs none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.equal_minima import AS_GOOD, NEAR, EqualMinimum
from steadyslip.experiments.fitting.growing import stress_alone
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.remedies import STRONG_EVIDENCE, Remedy, on_common_terms, remedy, with_words
from steadyslip.experiments.fitting.search import ROUGH_PATIENCE
from steadyslip.experiments.fitting.starts import features_of, search_bounds
from steadyslip.experiments.numerics.least_squares import LOST, Minima, minimise

SIZES = (0.5, 1.0, 1.5, 2.5)  # multiples of the typical α = 0.2 that are tried: 0.1 to 0.5, as in laboratories


@dataclass(frozen=True, eq=False)
class Rival(EqualMinimum):
    """Fit with a memory of normal stress that is as good as the fit without a memory.

    Attributes
    ----------
    remedy : Remedy
    """

    remedy: Remedy


def forgets_changes(plan: Plan) -> bool:
    """True if the normal stress changes in a record and drives the contact, but the law has no memory of it."""
    changes = any(record.stress_changes for record in plan.records)
    return changes and plan.pressed and bool(plan.rig.friction.forgets_stress())


def equal_memories(
    plan: Plan, ssq: float, values: Mapping[str, float], deviations: Array, independent: float
) -> list[Rival]:
    """Fits with another memory of normal stress that are as good and change parameters by more than their errors.

    Such fits are searched for laws without a memory; for laws with a memory only if nothing but the normal stress
    changes. Several sizes of the memory are tried.

    Parameters
    ----------
    plan : Plan
    ssq : float
        Sum of squares of the fit of the plan.
    values : mapping of str to float
        Fitted values, by name of the unknown.
    deviations : ndarray (p,)
        Standard deviations of the fitted coordinates.
    independent : float
        Number of independent samples in the residuals of the fit.
    """
    if not (forgets_changes(plan) or stress_alone(plan)):
        return []
    space, most = plan.space(), ssq * float(np.exp(AS_GOOD / independent))
    others = product(*plan.rig.friction.decided_besides.values())
    found: list[Rival] = []
    laws = [plan.rig.friction]
    for form in ((), *others):  # the first form keeps the evolution law of the plan
        if found and max(one.remedy.gain for one in found) < STRONG_EVIDENCE:
            break  # the records do not determine the memory
        new = [own for own in _with_memory(plan, form) if own.rig.friction not in laws]
        laws += [own.rig.friction for own in new]
        near = [one for own in new for one in _rivals(plan, own, ssq, values, most)]
        found += [one for one in near if np.any(one.far(space, deviations, NEAR))]
    alike = on_common_terms([one.remedy for one in found], ssq)
    found = [replace(one, remedy=own) for one, own in zip(found, alike, strict=True)]
    return sorted(found, key=lambda one: -one.remedy.gain)


def _with_memory(plan: Plan, form: Sequence[str]) -> Iterator[Plan]:
    """Plans with each memory of normal stress, and with the evolution law that `form` names (if empty, the plan's)."""
    for words in product(*plan.rig.friction.decided_by_stress.values()):
        own = with_words(plan, [*form, *words])
        if not own.rig.friction.forgets_stress():
            yield own


def _rivals(plan: Plan, own: Plan, ssq: float, values: Mapping[str, float], most: float) -> Iterator[Rival]:
    """Fits of `own`, a plan with a memory, from the fit of `plan`; searches that cannot reach `most` end early."""
    space, addresses = own.space(), own.rig.parameters()
    remembers = tuple(f"friction.{field}." for field in own.rig.friction.decided_by_stress)
    here, idle, tried = (np.zeros(len(space)) for _ in range(3))
    distances = np.zeros(len(space), dtype=bool)
    for i, one in enumerate(space.unknowns):
        known = values[one.name] if one.name in values else addresses[one.parameter].value
        added = one.parameter.startswith(remembers)
        none = addresses[one.parameter].role.idle if added else None
        distances[i] = added and one.kind == "slip distance"
        if none is not None:
            known, tried[i] = values.get(one.name, none), 1.0 if none < one.high else -1.0
        here[i], idle[i] = (float(one.coordinate(known if value is None else value)) for value in (None, none))
    budget = Budget.of_fit(sum(map(len, own.records)), len(space))
    comparison = own.for_trial().comparison(Effort(patience=ROUGH_PATIENCE, budget=budget))
    low, high = search_bounds(comparison.parts, features_of(comparison.parts), space)

    def minima(begin: Array, held: Array | None) -> Minima:
        stop = budget.part(np.inf)
        return minimise(lambda x, _: comparison.residuals(x), begin, low, high, held=held, stop=stop, known=most)

    ends = minima(idle + np.outer(SIZES, tried), np.tile(tried != 0, (len(SIZES), 1)))
    if most < np.min(ends.ssq) < LOST * most:  # the best size may lie between two sizes
        ends = minima(ends.sorted().coordinates[:1], None)
        if np.any(np.abs(ends.coordinates[0] - idle)[tried != 0] < SIZES[0]):
            return  # the best fit has hardly any memory
    instant = np.any(distances & (ends.coordinates <= low), axis=1)  # decays before the next sample: no memory
    for z in ends.coordinates[(ends.ssq < most) & ~instant]:
        yield Rival(space, z - here, remedy(plan, own, comparison, z, ssq, len(plan.space())))
