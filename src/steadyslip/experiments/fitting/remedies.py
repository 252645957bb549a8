"""Trials of other models for a fit whose residuals have structure: other laws, a lag, a trend.

A test of residuals for structure cannot distinguish a misfit after one step of velocity from correlated noise, and does
not show which law or channel is wrong. Fits with another law, a lag or a trend do, by Schwarz's criterion.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.effort import Budget, Effort
from steadyslip.experiments.fitting.plan import Plan, with_lag
from steadyslip.experiments.fitting.planning import can_be_free
from steadyslip.experiments.fitting.search import MAX_ITERATIONS, SearchResult, find_minimum, first_computable
from steadyslip.experiments.fitting.starts import features_of, search_bounds
from steadyslip.experiments.fitting.unknowns import Unknown
from steadyslip.experiments.numerics.least_squares import DAMPING_NEAR, minimise
from steadyslip.experiments.numerics.noise import STRUCTURE, describe, whiteness
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.slider import Slider

STRONG_EVIDENCE = 6.0  # a larger difference of BIC counts as strong evidence (Kass & Raftery 1995)
ROUNDS = 2  # number of changes of a model that are tried together
TRIAL_EFFORT, TRIAL_STARTS = 0.02, 3
"""Effort and starts of each trial; for simulated records they lead to the same minima as the default values."""
MEMORY_EFFORT = 0.1
"""Effort of trials with a memory of normal stress that the law lacks. On a record with one step of the stress, trials
with an effort of 0.02 reduced the sum of squares only to 0.68 of its value, instead of 0.42."""
MAX_TREND = 2  # highest order of a trend that is tried
SMALL_FALL = 0.1  # a short search ends if −2 log likelihood (white noise) falls by less: too little to matter

SLOWER = np.geomspace(3.0, 300.0, 8)  # slip distances of a second state that are tried, as multiples of the first
TWO_STATES = "two states"
WEAKENING = "a - b"

NESTED = {"lag", "trend"}
"""Kinds of unknowns that have no effect at 0, so that a fit with them can start at the minimum without them."""
LAGS = (0.0, -0.3, 0.3, -1.0, 1.0, -3.0, 3.0)  # starting values of the coordinate of a lag; chosen by trial


@dataclass(frozen=True)
class FoundMinimum:
    """Minimum of the sum of squares of a comparison, with its coordinates (p,)."""

    comparison: Comparison
    coordinates: Array
    ssq: float


@dataclass(frozen=True)
class Remedy:
    """Trial fit with another law, or with a further option, that may replace a fit.

    Attributes
    ----------
    choice : str
        Settings that differ from those of the fit, as for the option `--set`.
    ssq : float
        Sum of squares.
    gain : float
        Decrease of Schwarz's criterion (BIC), with the number of independent samples in the remaining residuals.
    p : float
        Probability from the whiteness test of the residuals.
    values : dict of str to float
        Values of all unknowns, by name, and of `WEAKENING` (for the first record) if the law has a and b.
    independent : float
        Number of independent samples in its residuals; NaN in a fit that was read from a file.
    added : int
        Number of its unknowns minus that of the fit.
    """

    choice: str
    ssq: float
    gain: float
    p: float
    values: dict[str, float]
    independent: float = field(default=np.nan, compare=False, repr=False)
    added: int = field(default=0, compare=False, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Dict for JSON with what is stored of it."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.compare}


def remedies(plan: Plan, ssq: float, values: Mapping[str, float], rounds: int = ROUNDS) -> tuple[Remedy, ...]:
    """Trial fits with up to `rounds` changes of the plan, the best first.

    Changes that take little time are tried first and, if the normal stress changes, all memories of it that the law
    lacks. The search ends once a change leaves no structure in the residuals. Each trial is short: a longer search may
    find a better minimum.

    Parameters
    ----------
    plan : Plan
    ssq : float
        Sum of squares of the fit of the unchanged plan.
    values : mapping of str to float
        Fitted values, by name of the unknown, from which fits with a lag or a trend start.
    rounds : int, optional
        Number of changes that are tried together.
    """
    found: list[Remedy] = []
    base, known, size = plan, {""}, len(plan.space())
    for _ in range(rounds):
        tried: list[tuple[Remedy, Plan]] = []
        changed = {_choice(plan, own): own for own in _changed(base)}
        new = [own for choice, own in changed.items() if choice not in known]
        known |= set(changed)
        lacks = [_recalls(own, base) for own in new]
        longer = [not _is_brief(own, values) and not recalls for own, recalls in zip(new, lacks, strict=True)]
        for long, recalls, own in sorted(zip(longer, lacks, new, strict=True), key=lambda each: each[:2]):
            if long and _is_mended(one for one, other in tried if not any(lacks) or _recalls(other, base)):
                break
            share = MEMORY_EFFORT if recalls else TRIAL_EFFORT
            if (one := _fitted(own, plan, ssq, size, values, share)) is not None:
                tried.append((one, own))
        found += [one for one, _ in tried]
        trends = [(one, own) for one, own in tried if own.trend > base.trend and one.gain > STRONG_EVIDENCE]
        found += [
            slow for one, own in trends if (slow := slow_state(plan, one.ssq, own, one.values, one.gain)) is not None
        ]
        if _is_mended(one for one, other in tried if not any(lacks) or _recalls(other, base)):
            break
        best = max(tried, key=lambda pair: pair[0].gain, default=None)
        if best is None or best[0].gain <= max([STRONG_EVIDENCE, *(one.gain for one in found if one is not best[0])]):
            break
        base, values = best[1], best[0].values
    return ranked(found, ssq)


def _is_mended(tried: Iterable[Remedy]) -> bool:
    """True if one of the trials leaves no structure in the residuals and fits better by strong evidence."""
    return any(one.p >= STRUCTURE and one.gain > STRONG_EVIDENCE for one in tried)


def mended(plan: Plan, ssq: float, values: Mapping[str, float]) -> bool:
    """True if a trial that takes little time (lag, trend, other evolution law) fits better by strong evidence.

    Parameters
    ----------
    plan, ssq, values
        As for `remedies`.
    """
    size, samples = len(plan.space()), sum(map(len, plan.records))
    wanted = ssq * float(np.exp(-STRONG_EVIDENCE / samples))  # a larger sum is no strong evidence, even in white noise
    for own in _changed(plan):
        if not _choice(plan, own) or not _is_brief(own, values) or _lacks_memory(own, plan):
            continue
        try:
            best = _from_minimum(own, _effort(own), values, LAGS[:3], wanted)
        except NotAvailable:
            continue
        if best.ssq > wanted:
            continue  # this fit is not better: skip the noise model, which takes longer
        if remedy(plan, own, best.comparison, best.coordinates, ssq, size).gain > STRONG_EVIDENCE:
            return True
    return False


def continued(plan: Plan, ssq: float, values: Mapping[str, float]) -> float:
    """Sum of squares that a continued search reaches with the effort of a trial; parameters as for `remedies`."""
    try:
        return min(ssq, _from_minimum(plan, _effort(plan), values).ssq)
    except NotAvailable:
        return ssq


def on_common_terms(found: Sequence[Remedy], ssq: float) -> list[Remedy]:
    """Remedies with gains for one number of independent samples, that of the least sum of squares.

    With the number of each, noise of that number alone would decide between models that follow the records as well.

    Parameters
    ----------
    found : sequence of Remedy
    ssq : float
        Sum of squares of the fit that they may replace.
    """
    known = [one for one in found if np.isfinite(one.independent)]
    if not known:
        return list(found)
    count = min(known, key=lambda one: one.ssq).independent
    return [
        replace(one, gain=_gain(ssq, one.ssq, one.added, count)) if np.isfinite(one.independent) else one
        for one in found
    ]


def _gain(ssq: float, least: float, added: int, independent: float) -> float:
    """Decrease of BIC from one sum of squares to another, for numbers of added unknowns and independent samples."""
    return independent * float(np.log(ssq / least)) - added * float(np.log(max(independent, 2.0)))


def ranked(found: Sequence[Remedy], ssq: float = np.nan) -> tuple[Remedy, ...]:
    """Remedies without duplicates, the best first; a second state that is hardly better than a trend comes after it."""
    found = on_common_terms(found, ssq)
    trend = any("fit.trend" in one.choice for one in found)
    own = {one.choice: one for one in sorted(found, key=lambda one: one.gain)}.values()
    ahead = {one.choice: STRONG_EVIDENCE * (trend and "fit.states" in one.choice) for one in own}
    return tuple(sorted(own, key=lambda one: ahead[one.choice] - one.gain))


def _changed(plan: Plan) -> Iterator[Plan]:
    """Plans that each differ in one thing: lag, evolution law, memory, number of states, or trend."""
    if plan.follows and not plan.lag:
        yield with_lag(plan)
    law, words = plan.rig.friction, plan.rig.friction.alternatives()
    pressed = plan.pressed and any(record.stress_changes for record in plan.records)
    memories = {word for own in law.decided_by_stress.values() for word in own}
    choices = [*product(*law.decided_by_stress.values())] if pressed else []
    forms = [word for word in words if word not in memories]
    for form, memory in product(forms, choices or [()]):
        yield with_words(plan, [form, *memory])
    if plan.trend < MAX_TREND:
        yield replace(plan, trend=plan.trend + 1)


def with_words(plan: Plan, words: Sequence[str]) -> Plan:
    """Plan with the alternative of its law that `words` name; parameters that the new law has in addition are free."""
    law: FrictionLaw = plan.rig.friction
    known = law.alternatives()
    for word in (word for word in known if word in words):
        law = known[word](law)
    rig = replace(plan.rig, friction=law)
    before, after = can_be_free(plan.rig), can_be_free(rig)
    free = *(name for name in plan.free if name in after or name not in before), *(n for n in after if n not in before)
    return replace(plan, rig=rig, free=free, separate=tuple(name for name in plan.separate if name in free))


def _fitted(own: Plan, plan: Plan, ssq: float, size: int, values: Mapping[str, float], share: float) -> Remedy | None:
    """Remedy of the plan `own` from a search with a share of a fit's effort; None if it cannot follow the records."""
    effort = _effort(own, share)
    try:
        if _is_brief(own, values):
            best: FoundMinimum | SearchResult = _from_minimum(own, effort, values)
        else:
            best = find_minimum(own, TRIAL_STARTS, effort, None)
    except NotAvailable:
        return None
    return remedy(plan, own, best.comparison, best.coordinates, ssq, size)


def _is_brief(own: Plan, values: Mapping[str, float]) -> bool:
    """True if the search for a plan can start at the values of a fit: additional unknowns have no effect at 0."""
    return {one.parameter.partition(".")[0] for one in own.space().unknowns if one.name not in values} <= NESTED


def _recalls(own: Plan, base: Plan) -> bool:
    """True if a plan has a memory of normal stress that the plan `base` lacks, but no more states than it."""
    before, after = base.rig, own.rig
    states = len(after.of_kind("evolution effect")) > len(before.of_kind("evolution effect"))
    return before.friction.forgets_stress() and not after.friction.forgets_stress() and not states


def _lacks_memory(own: Plan, base: Plan) -> bool:
    """True if a plan only lacks the memory of normal stress of the plan `base`, so that it fits no better."""
    law, whole = own.rig.friction, base.rig.friction
    return law != whole and replace(law, **{name: getattr(whole, name) for name in whole.decided_by_stress}) == whole


def _effort(own: Plan, share: float = TRIAL_EFFORT) -> Effort:
    return Effort(budget=Budget.of_fit(sum(map(len, own.records)), len(own.space()), share))


def remedy(plan: Plan, own: Plan, comparison: Comparison, z: Array, ssq: float, size: int) -> Remedy:
    """Remedy from a minimum `z` (p,) of the plan `own`, compared with a fit of `plan` (`size` unknowns, sum `ssq`)."""
    space = comparison.space
    r = comparison.residuals(z[None])[0][0]
    parts = [r[where] for where in comparison.slices]
    worth = sum(len(part) / max(describe(part).inflation, 1.0) for part in parts)
    least = float(r @ r)
    added = len(space) - size
    ends = dict(zip((one.name for one in space.unknowns), map(float, space.values(z)), strict=True))
    if (level := weakening(own.rig, ends)) is not None:
        ends[WEAKENING] = level
    gain = _gain(ssq, least, added, worth)
    return Remedy(_choice(plan, own), least, gain, whiteness(parts).p, ends, worth, added)


def weakening(rig: Slider, values: Mapping[str, float]) -> float | None:
    """a − b (a minus the sum of all b) of the first record from values of unknowns; None for a law without a or b."""
    direct, evolving = (
        [values.get(n, values.get(f"{n}@1", rig.value(n) or 0.0)) for n in rig.of_kind(kind)]
        for kind in ("direct effect", "evolution effect")
    )
    return float(sum(direct) - sum(evolving)) if direct and evolving else None


def _from_minimum(
    own: Plan, effort: Effort, values: Mapping[str, float], lags: Sequence[float] = LAGS, wanted: float = np.inf
) -> FoundMinimum:
    """Minimum of a plan with an added lag or trend, searched from the minimum without it and from several lags.

    Searches that will not reach the sum of squares `wanted` end early.
    """
    space, comparison = own.space(), own.for_trial().comparison(effort)
    begin = space.coordinates(np.array([values.get(one.name, 0.0) for one in space.unknowns]))
    added = np.array([one.parameter == "lag" and one.name not in values for one in space.unknowns])
    z = begin + np.outer(lags if np.any(added) else [0.0], added)
    low, high = np.transpose([one.bounds for one in space.unknowns])
    stop = effort.budget.part(np.inf)
    enough, near = SMALL_FALL / comparison.size, DAMPING_NEAR
    ends = minimise(
        lambda x, _: comparison.residuals(x), z, low, high, MAX_ITERATIONS, tolerance=enough, known=wanted, stop=stop,
        damping=near,
    )  # fmt: skip
    ends = first_computable(comparison, ends.sorted())
    if not np.isfinite(ends.ssq[0]):
        raise NotAvailable("the model cannot follow these records")
    return FoundMinimum(comparison, ends.coordinates[0], float(ends.ssq[0]))


def slow_state(
    plan: Plan, ssq: float, with_trend: Plan, values: Mapping[str, float], gain: float = 0.0
) -> Remedy | None:  # fmt: skip
    """Fit with a second state of long slip distance in place of the last order of a trend; None for other laws.

    A state whose slip distance is longer than the slip after a step evolves nearly linearly, as a trend does, but leads
    to another value of a - b.

    Parameters
    ----------
    plan : Plan
        Plan with which the remedy is compared.
    ssq : float
        Sum of squares with the trend.
    with_trend : Plan
        Plan with the trend.
    values : mapping of str to float
        Values of the fit with the trend, by name of the unknown, from which the search begins.
    gain : float, optional
        Gain of the trend, to which the gain of the state over the trend is added: a direct comparison is not possible,
        as the numbers of independent samples in the two fits differ too much.
    """
    if TWO_STATES not in with_trend.rig.friction.alternatives() or len(_evolving(with_trend)) != 1:
        return None
    own = with_words(replace(with_trend, trend=with_trend.trend - 1), [TWO_STATES])
    space, effort = own.space(), _effort(own, MEMORY_EFFORT)
    comparison = own.for_trial().comparison(effort)
    begin = np.empty((len(SLOWER), len(space)))
    for i, one in enumerate(space.unknowns):
        begin[:, i] = one.coordinate(values[one.name] if one.name in values else _of_state(with_trend, one, values))
    low, high = search_bounds(comparison.parts, features_of(comparison.parts), space)
    ends = minimise(
        lambda x, _: comparison.residuals(x), np.clip(begin, low, high), low, high, MAX_ITERATIONS, race=1,
        tolerance=SMALL_FALL / comparison.size, stop=effort.budget.part(np.inf), damping=DAMPING_NEAR,
    )  # fmt: skip
    ends = first_computable(comparison, ends.sorted())
    if not np.isfinite(ends.ssq[0]):
        return None
    found = remedy(with_trend, own, comparison, ends.coordinates[0], ssq, len(with_trend.space()))
    added = len(own.space()) - len(plan.space())
    return replace(found, choice=_choice(plan, own), gain=gain + found.gain, added=added)


def _evolving(plan: Plan) -> tuple[str, ...]:
    return plan.rig.of_kind("evolution effect")


def _of_state(plan: Plan, one: Unknown, values: Mapping[str, float]) -> Array | float:
    """Starting values of an unknown of the first or second state, from values of a plan with a single state."""
    if not (own := plan.rig.of_kind(one.kind)):
        return 0.0
    known = own[0]  # parameters of the law come before parameters of its memories
    value = values.get(known, values.get(f"{known}@1", plan.rig.value(known) or 0.0))
    if ".states.2." not in one.parameter:
        return value
    return np.asarray(value * SLOWER) if one.kind == "slip distance" else 0.0


def _choice(plan: Plan, other: Plan) -> str:
    """Settings of the plan `other` that differ from those of `plan`, as for the option `--set`."""
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
