"""Changes of a plan that would mend the structure in the residuals of its fit: other laws, a lag, a trend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import can_be_free
from steadyslip.experiments.fitting.search import find_minimum
from steadyslip.experiments.numerics.noise import describe
from steadyslip.experiments.numerics.whiteness import whiteness
from steadyslip.laws.friction import FrictionLaw

STRUCTURE = 1e-3  # probability of the whiteness test below which residuals have structure
STRONG_EVIDENCE = 6.0  # difference of BIC that counts as strong evidence (Kass & Raftery 1995)
ROUNDS = 2  # changes that are tried on top of each other
TRIAL_EFFORT, TRIAL_STARTS = 0.02, 3  # of each trial; on made records they end where the default ones do
MAX_TREND = 2  # orders of a trend that are tried


@dataclass(frozen=True)
class Remedy:
    """Minimum with another law, or with a further option.

    Attributes
    ----------
    choice : str
        What to ask for, as `--set` takes it.
    ssq : float
        Sum of squares.
    gain : float
        Fall of Schwarz's criterion (BIC), with as many samples as are independent in the residuals that remain.
    p : float
        Probability of the whiteness test.
    values : dict of str to float
        Values of all unknowns, by name.
    """

    choice: str
    ssq: float
    gain: float
    p: float
    values: dict[str, float]


def remedies(plan: Plan, ssq: float) -> tuple[Remedy, ...]:
    """Minima with changes of the plan, the best first; up to two changes on top of each other.

    The search for them ends once one leaves no structure. Each trial is short: a longer one may find a better minimum.

    Parameters
    ----------
    plan : Plan
    ssq : float
        Sum of squares of the fit of the plan itself.
    """
    found: list[Remedy] = []
    base, known, size = plan, {_key(plan)}, len(plan.space())
    for _ in range(ROUNDS):
        tried: list[tuple[Remedy, Plan]] = []
        for own in _changed(base):
            if _key(own) in known:
                continue
            known.add(_key(own))
            if (one := _fitted(own, plan, ssq, size)) is not None:
                tried.append((one, own))
            if one is not None and one.p >= STRUCTURE and one.gain > STRONG_EVIDENCE:
                return _ranked([*found, one, *(other for other, _ in tried if other is not one)])
        found += [one for one, _ in tried]
        best = max(tried, key=lambda pair: pair[0].gain, default=None)
        if best is None or best[0].gain <= max([STRONG_EVIDENCE, *(one.gain for one in found if one is not best[0])]):
            break
        base = best[1]
    return _ranked(found)


def _ranked(found: list[Remedy]) -> tuple[Remedy, ...]:
    return tuple(sorted(found, key=lambda one: -one.gain))


def _key(plan: Plan) -> tuple[Any, ...]:
    return plan.rig.friction, plan.lag, plan.trend


def _changed(plan: Plan) -> Iterator[Plan]:
    """Plans with one thing changed, those of brief searches first: lag, evolution and memory of the law, states."""
    if plan.follows and not plan.lag:
        yield replace(plan, lag=True)
    law, words = plan.rig.friction, plan.rig.friction.alternatives()
    pressed = plan.pressed and any(record.stress_changes for record in plan.records)
    memories = {word for own in law.decided_by_stress.values() for word in own}
    choices = [*product(*law.decided_by_stress.values())] if pressed else []
    forms = sorted((word for word in words if word not in memories), key=lambda word: len(_with(plan, [word]).free))
    for form, memory in product(forms, choices or [()]):
        yield _with(plan, [form, *memory])
    if plan.trend < MAX_TREND:
        yield replace(plan, trend=plan.trend + 1)


def _with(plan: Plan, words: Sequence[str]) -> Plan:
    """Plan with the alternative of its law that words name; what that has besides is free."""
    law: FrictionLaw = plan.rig.friction
    known = law.alternatives()
    for word in (word for word in known if word in words):
        law = known[word](law)
    rig = replace(plan.rig, friction=law)
    before, after = can_be_free(plan.rig), can_be_free(rig)
    free = *(name for name in plan.free if name in after or name not in before), *(n for n in after if n not in before)
    return replace(plan, rig=rig, free=free, separate=tuple(name for name in plan.separate if name in free))


def _fitted(own: Plan, plan: Plan, ssq: float, size: int) -> Remedy | None:
    space = own.space()
    budget = Budget.of_fit(sum(map(len, own.records)), len(space), TRIAL_EFFORT)
    try:
        best = find_minimum(own, TRIAL_STARTS, Effort(budget=budget), None)
    except NotAvailable:
        return None
    r = best.comparison.residuals(best.coordinates[None])[0][0]
    parts = [r[where] for where in best.comparison.slices]
    worth = sum(len(part) / max(describe(part).inflation, 1.0) for part in parts)
    gain = worth * float(np.log(ssq / best.ssq)) - (len(space) - size) * float(np.log(max(worth, 2.0)))
    values = dict(zip((one.name for one in space.unknowns), map(float, space.values(best.coordinates)), strict=True))
    return Remedy(_choice(plan, own), best.ssq, gain, whiteness(parts).p, values)


def _choice(plan: Plan, other: Plan) -> str:
    """What differs between two plans, as `--set` takes it."""
    law, changed = plan.rig.friction, other.rig.friction
    found = []
    for name in (item.name for item in fields(changed)):
        before, after = getattr(law, name, None), getattr(changed, name)
        if hasattr(after, "name") and before != after:
            found.append(f"friction.{name} = {after.name!r}")
        elif isinstance(after, tuple) and len(after) != len(before or ()):
            found.append(f"fit.{name} = {max(len(after), 1)}")
    found += ["fit.lag = true"] if other.lag != plan.lag else []
    found += [f"fit.trend = {other.trend}"] if other.trend != plan.trend else []
    return ", ".join(found)
