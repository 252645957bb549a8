"""Text of a fit, its warnings, and its data for JSON."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from steadyslip.core.checks import in_words
from steadyslip.core.format import enumerated, format_percent, format_quantity
from steadyslip.experiments.fitting.fitted_words import (
    WIDTH,
    chance,
    estimate_dict,
    fitted_dict,
    fitted_warnings,
    quality,
    version_warnings,
)
from steadyslip.experiments.fitting.loading_words import loading_warnings, own_rate
from steadyslip.experiments.fitting.memories import forgets_changes
from steadyslip.experiments.fitting.numbers import FitNumbers
from steadyslip.experiments.fitting.refit import RampFit, may_be_ramp
from steadyslip.experiments.fitting.remedies import STRONG_EVIDENCE, WEAKENING, Remedy, weakening
from steadyslip.experiments.fitting.residuals import residual_checks
from steadyslip.experiments.loading.loading import Course
from steadyslip.experiments.loading.servo import overshoot
from steadyslip.experiments.measured.clipped import CLIPPED, OFF_FIT, WILD
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.machine.slider import Slider
from steadyslip.model.sliding import steady_state

MAX_END_OFFSET = 3.0  # an end is off the model if its mean residual exceeds this multiple of the record's rms residual
END_SAMPLES = 5  # least number of first or last residuals in this mean; of long records, one residual in 200 is taken
UNLIKE = 0.1  # weights of records are printed if they differ by more than this share; averaging changes them by less
OVERSHOOT = 0.01  # smallest overshoot of a servo that is mentioned, as a share of the step
MAX_JUMP_ERROR = 0.1
"""Errors are not Gaussian if the standard deviation of the time of a jump is larger, in sampling intervals."""


def words(fit: FitNumbers) -> str:
    """Text of a fit: estimates, quality and warnings."""
    wide = max(len(one.name) for one in (*fit.estimates, *fit.derived))
    rows = []
    for one in fit.estimates:
        interval = f"   95 %: {one.range()}" if one.determined else ""
        per_stress = _over_stress(fit, one)
        if per_stress is None or not _stress_assumed(fit):
            rows.append(f"  {one.name:<{wide}}  {one.shown()}{interval}")
        if per_stress is not None:
            rows.append(f"  {'k/σ':<{wide}}  {per_stress}")
    follows = [one for one in fit.derived if one.unit == "1" or not _stress_assumed(fit)]
    rows += [f"  {one.name:<{wide}}  {one.shown()}   95 %: {one.range()}" for one in follows]
    sources = ", ".join(record.source for record in fit.plan.records)
    friction = type(fit.plan.rig.friction).__name__
    lines = [f"{friction} friction fitted to {fit.samples} samples of {sources}", *rows, "", *_quality(fit)]
    for warning in warnings(fit):
        lines += textwrap.wrap(f"! {warning}", WIDTH, subsequent_indent="  ")
    return "\n".join(lines)


def _stress_assumed(fit: FitNumbers) -> bool:
    """True if no record has a column of normal stress, so that the value of the rig is used."""
    return fit.plan.pressed and all(record.normal is None for record in fit.plan.records)


def _over_stress(fit: FitNumbers, one: Any) -> str | None:
    """Text on stiffness over normal stress, which friction determines without any stress; None for other parameters."""
    bare, _, record = one.name.partition("@")
    if bare not in ("slider.stiffness", "slider.axial_stiffness"):
        return None
    stress = steady_state(fit.rig(int(record) - 1 if record else 0)).normal_stress
    value, error, low, high = (1e-6 * x / stress for x in (one.value, one.error, one.low, one.high))
    if not one.determined:
        return f"{value:.4g} /um ({one.undetermined})"
    return f"{value:.4g} ± {error:.2g} /um   95 %: {low:.4g} to {high:.4g} /um"


def _quality(fit: FitNumbers) -> list[str]:
    lag = max((noise.lag1 for noise in fit.noise), key=abs)
    return [
        f"residuals       rms {fit.rms:.3g}, sum of squares {fit.ssq:.6g}, lag-1 autocorrelation {lag:.2g}",
        *quality(fit),
        *_weights(fit),
        *textwrap.wrap(f"driven by       {drive_line(fit)}", WIDTH, subsequent_indent=" " * 16),
        *_range_of_weakening(fit),
        in_words(residual_checks(fit)),
    ]


def _range_of_weakening(fit: FitNumbers) -> list[str]:
    """Line on the largest slip after a change of rate, up to which a - b is known; no line without an a - b."""
    slip = slip_after_changes(fit)
    if not slip or all(one.name.partition("@")[0] != WEAKENING for one in fit.derived):
        return []
    slipped = format_quantity(slip, "m", 2)
    return [f"range           at most {slipped} of slip after a change of rate; a - b lacks what needs more slip"]


def slip_after_changes(fit: FitNumbers) -> float:
    """Longest displacement (m) of a load point from a change of its rate to the next change or the end of the record.

    It is 0 without a change. A state with a longer slip distance hardly evolves in the records, so that a - b of the
    fit does not include its effect.
    """
    longest = 0.0
    for record, loading in zip(fit.plan.records, fit.plan.loading, strict=False):
        if loading.load is not None and loading.load.changes:
            times = [*(change.time for change in loading.load.changes), float(record.time[-1])]
            longest = max(longest, *np.diff(loading.load.integral(np.asarray(times))))
    return longest


def _weights(fit: FitNumbers) -> list[str]:
    """Line on the weights of records, relative to the largest; no line if they are nearly equal."""
    levels = np.array([np.mean(fit.part(fit.comparison.weights, i)) for i in range(len(fit.plan.records))])
    if np.allclose(levels, levels[0], rtol=UNLIKE):
        return []
    shares = ", ".join(f"{x:.2g}" for x in levels / np.max(levels))
    return textwrap.wrap(f"weights         records weigh by their noise: {shares}", WIDTH, subsequent_indent=" " * 16)


def _left_out(fit: FitNumbers) -> list[str]:
    """Warnings on samples that were left out because their channel was at its limit or because they are outliers."""
    return [
        f"{record.source}: {note}; give weights to keep them"
        for record in fit.plan.records
        for note in record.notes
        if any(why in note for why in (CLIPPED, WILD, OFF_FIT))
    ]


def warnings(fit: FitNumbers) -> list[str]:
    """Sentences with warnings that a user must know before using the numbers of a fit.

    A better model is named first. If it leaves only noise, warnings on times at their bounds are omitted, as the better
    model removes their cause.
    """
    best = better(fit)
    follows = fit.at_bounds if best is not None and best.p >= STRUCTURE else ()
    first = _structure(fit) if best is not None else []
    found = [one for one in fitted_warnings(fit) if one not in follows]
    found += _open_memory(fit) + _left_out(fit) + _ends_off_model(fit)
    found += _vague_jumps(fit) + _possible_ramps(fit) + loading_warnings(fit)
    last = _structure(fit) if best is None else []
    return first + found + last + _drained_at_once(fit) + version_warnings(fit)


def _ends_off_model(fit: FitNumbers) -> list[str]:
    """Warnings on records whose first or last samples are off the model, which begins with steady sliding."""
    found = []
    for i, record in enumerate(fit.plan.records):
        own = fit.part(fit.residuals, i)
        few, usual = {END_SAMPLES, max(END_SAMPLES, len(own) // 200)}, float(np.sqrt(np.mean(own**2)))
        begins, ends = (max((float(np.mean(side[:n])) for n in few), key=abs) for side in (own, own[::-1]))
        if fit.plan.initial == "steady" and not fit.plan.rests(i) and abs(begins) > MAX_END_OFFSET * usual:
            if fit.plan.beginnings:
                begun, cure = "as the step before left it", "fit this part alone (between), with its initial state"
            else:
                begun, cure = "with steady sliding", "if the record does not, let its initial state be"
            found.append(
                f"{record.source}: friction begins {begins:+.2g} off the model, which begins {begun}; {cure} free "
                "(initial = 'free'), or cut the beginning off (between)"
            )
        if abs(ends) > MAX_END_OFFSET * usual:
            found.append(
                f"{record.source}: friction ends {ends:+.2g} off the model; if the loading changed at the very end, "
                "cut that off (between)"
            )
    return found


def _vague_jumps(fit: FitNumbers) -> list[str]:
    """Warnings on jumps whose time is poorly determined, so that errors are not Gaussian."""
    found = []
    for i, one in enumerate(fit.space.unknowns):
        if _between_samples(fit, one) and float(fit.covariance[i, i]) > MAX_JUMP_ERROR**2:
            found.append(
                f"the time of the jump of the drive or the normal stress between {one.low:.7g} and {one.high:.7g} s is "
                f"poorly determined ({one.name}); errors of parameters that depend on the jump, such as alpha, are not "
                "Gaussian: use profile or bootstrap"
            )
    return found


def _between_samples(fit: FitNumbers, one: Any) -> bool:
    """True if an unknown is the time of a sudden change between two neighbouring samples."""
    if one.parameter.startswith("jump."):
        return True
    if not one.parameter.startswith("step."):
        return False
    changes = [c for c in fit.plan.loading[one.record or 0].changes if fit.plan.pressed or c[0] == "load"]
    channel, _, change = changes[int(one.parameter.split(".")[1]) - 1]
    return channel != "load" and change.duration == 0


def _possible_ramps(fit: FitNumbers) -> list[str]:
    """Warnings on velocity changes that may be steps or ramps, with the effect of ramps on the fit."""
    found = []
    for record, loading in zip(fit.plan.records, fit.plan.loading if fit.plan.follows else (), strict=False):
        possible = [change for channel, _, change in loading.changes if may_be_ramp(channel, change)]
        if possible:
            times = enumerated([f"{change.time:.7g}" for change in possible])
            longest = format_quantity(max(change.longest for change in possible), "s")
            what, taken, ramps = ("changes", "are taken as steps", "ramps") if len(possible) > 1 else (
                "change", "is taken as a step", "a ramp")  # fmt: skip
            found.append(
                f"{record.source}: the {what} of rate at {times} s {taken}; {ramps} of up to {longest} would fit the "
                "displacement as well"
            )
    if found and fit.as_ramps:
        moved = [abs(one.values[n] - fit.values[n]) > fit.errors[n] for one in _alike(fit, fit.as_ramps)
                 for n in _steep_names(fit.rig(0)) if n in one.values and n in fit.values]  # fmt: skip
        if not any(moved):  # ramps change no parameter by more than its error
            return []
        found[-1] += f"; {_ramp_effect(fit, fit.as_ramps)}"
    return found


def _ramp_effect(fit: FitNumbers, tried: tuple[RampFit, ...]) -> str:
    """Clause on whether friction distinguishes ramps from steps, and on how ramps change the parameters."""
    alike, best = _alike(fit, tried), min(tried, key=lambda one: one.ssq)
    longest = alike[-1] if tried[0] in alike else best
    changes = ", ".join(f"{_symbol(n)} {longest.values[n] / fit.values[n] - 1:+.1%}" for n in _steep_names(fit.rig(0))
                        if n in longest.values and fit.values.get(n))  # fmt: skip
    verdict = "friction does not decide either" if tried[0] in alike else "friction fits ramps better"
    return f"{verdict}: with {_lengths(fit, longest)} the sum of squares is {_relative_change(fit, longest)}; {changes}"


def better(fit: FitNumbers) -> Remedy | None:
    """Best of the models in `remedies` that fit better by strong evidence; None if no model does."""
    return next((one for one in fit.remedies if one.gain >= STRONG_EVIDENCE), None)


def _structure(fit: FitNumbers) -> list[str]:
    """Warning on structure in the residuals, or on a missing memory of normal stress, and the model that removes it."""
    changing = [record.source for record in fit.plan.records if record.stress_changes]
    forgets, structure, best = forgets_changes(fit.plan), fit.whiteness.p < STRUCTURE, better(fit)
    if forgets:
        said = f"the normal stress changes in {enumerated(changing)}, and this law has no memory of it"
    elif structure:
        said = f"residuals have structure (whiteness {chance(fit.whiteness.p)})"
    else:
        said = "residuals alone look like noise, but another model follows the records better"
    if best is None and structure and not fit.search.converged:
        return [f"{said}, which means nothing before the search has ended"]
    if best is None and structure:
        tried = "; ".join(one.choice for one in fit.remedies)
        return [f"{said}; no other model that was tried fits better ({tried}): noise of the machine, or another law"]
    if best is None and fit.plan.trend and fit.remedies:
        return [f"residuals are noise; {_as_slow_state(fit, fit.remedies[0])}"]
    if best is None:
        if not forgets and fit.remedies:
            said = f"only the normal stress changes in {enumerated(changing)}"
        return [f"{said}; {_equal_memories(fit)}"] if forgets or fit.remedies else []
    rest = "noise is left" if best.p >= STRUCTURE else f"structure is left (whiteness {chance(best.p)})"
    follows = f"{', '.join([rest, *_moved(fit, best)])};{_rivals(fit, best)} {_consequence(fit, best)}"
    return [
        f"{said}: with {_asked(fit, best)} the sum of squares is {best.ssq / fit.ssq:.2g} of this, "
        f"BIC {best.gain:.0f} less, {follows} "
        "fit again with these settings, by --set or in the file (lab_rig and fit in Python)"
    ]


def _near(fit: FitNumbers, best: Remedy) -> list[Remedy]:
    """Models in `remedies` that the records hardly distinguish from the best model."""
    return [one for one in fit.remedies if one is not best and best.gain - one.gain < STRONG_EVIDENCE <= one.gain]


def _as_slow_state(fit: FitNumbers, one: Remedy) -> str:
    """Clause on a second state of long slip distance, which fits as well as the trend of a fit."""
    before = weakening(fit.rig(0), fit.values)
    return (
        f"{_asked(fit, one)} in place of the trend fits as well (BIC {-one.gain:+.1f}), with {WEAKENING} "
        f"{one.values[WEAKENING]:.2g} in place of {before:.2g}: these data do not determine a - b; slide further after "
        "each step, or give (fix) known values of b"
    )


def _rivals(fit: FitNumbers, best: Remedy) -> str:
    """Clause on models that the records hardly distinguish from the best model; empty if there are none."""
    near = _near(fit, best)
    said = [
        f"{_asked(fit, one)} (BIC {abs(best.gain - one.gain):.1f} {'less' if one.gain > best.gain else 'more'}, "
        f"{', '.join(_moved(fit, one)) or 'other values alike'})"
        for one in near
    ]
    return f" hardly distinguished from it: {enumerated(said)};" if near else ""


def _consequence(fit: FitNumbers, best: Remedy) -> str:
    """Clause that says whether to use the fitted values: only if the better model changes them within their errors."""
    choices = [one.choice for one in (best, *_near(fit, best))]
    if all(any(f"fit.{word} =" in choice for choice in choices) for word in ("trend", "states")):
        return (
            "a trend and a second state of long slip distance look alike here, so that these data do not determine "
            "a - b; do not use the values above, but"
        )
    steep = _steep_names(fit.rig(0))
    shared = [n for n in steep if n in best.values and n in fit.values]
    shifts = [(best.values[n] - fit.values[n], fit.errors[n]) for n in shared]
    if WEAKENING in best.values:
        shifts += [(best.values[WEAKENING] - one.value, one.error) for one in fit.derived[:1]
                   if one.name.partition("@")[0] == WEAKENING]  # fmt: skip
    near = shifts and all(abs(shift) <= error < np.inf for shift, error in shifts)
    if near:
        return "the values above move by less than their errors;"
    noise = fit.whiteness.p >= STRUCTURE and not forgets_changes(fit.plan)
    return f"{'unless other knowledge excludes that, ' if noise else ''}do not use the values above, but"


def _asked(fit: FitNumbers, one: Remedy) -> str:
    """Settings of another model, with the fitted values of its further parameters."""
    units = {name.rpartition(".")[2]: address.role.unit for name, address in fit.plan.rig.parameters().items()}
    units |= {"lag": "s"}
    added = []
    for n, x in one.values.items():
        if n not in fit.values and n != WEAKENING and not n.startswith(("step.", "jump.")):
            unit = units.get(n.partition("@")[0].rpartition(".")[2], "1")
            added.append(f"{n.removeprefix('friction.')} {format_quantity(x, unit, 3)}")
    return f"{one.choice} ({', '.join(added)})" if added else one.choice


def _moved(fit: FitNumbers, one: Remedy) -> list[str]:
    """Relative changes of the law's parameters and the stiffness in another model, and its a − b next to the fit's."""
    own = weakening(fit.rig(0), fit.values)
    levels = [] if own is None or WEAKENING not in one.values else [
        f"{WEAKENING} {one.values[WEAKENING]:.2g} in place of {own:.2g}"
    ]  # fmt: skip
    return [*_shares(fit, one), *levels]


def _shares(fit: FitNumbers, one: Remedy) -> list[str]:
    """Relative changes of the parameters of the law and of the stiffness in another model."""
    return [f"{_symbol(n)} {one.values[n] / fit.values[n] - 1:+.0%}" for n in _steep_names(fit.rig(0))
            if n in one.values and fit.values.get(n)]  # fmt: skip


def _equal_memories(fit: FitNumbers) -> str:
    """Clause on memories of normal stress with which the fit is as good, for a law without a memory."""
    if not fit.remedies:
        return "residuals are noise, and the fit is worse with the memories that were tried, which speaks against them"
    before = weakening(fit.rig(0), fit.values) or 0.0
    best = max(fit.remedies, key=lambda one: abs(one.values.get(WEAKENING, before) - before))
    after = best.values.get(WEAKENING, before)
    sign = ", so that not even its sign is determined" if before * after < 0 else ""
    taken = "it assumes that there is none; " if forgets_changes(fit.plan) else ""
    return (
        f"{taken}the record is fitted as well with {_asked(fit, best)}, where a - b is {after:.2g} "
        f"in place of {before:.2g}{sign}, {', '.join(_shares(fit, best))}; set it with --set (lab_rig in Python)"
    )


def _open_memory(fit: FitNumbers) -> list[str]:
    """Warning with advice on how to determine a memory of normal stress that the records do not determine."""
    lost = {name for one in fit.unidentified for name in one.weights if "normal_memory." in name}
    if not forgets_changes(fit.plan):  # another memory that fits as well has parameters that this law lacks
        lost &= set(fit.names)
    if not lost:
        return []
    if not any(record.stress_changes for record in fit.plan.records):
        return [
            f"without a change of the normal stress nothing determines {enumerated(sorted(lost))}: leave the memory "
            "out, give (fix) known values, or also fit a record with steps of the normal stress on the same rock"
        ]
    return [
        f"changes of normal stress alone do not separate {enumerated(sorted(lost))} from the rest of the law: also fit "
        "a record with steps of velocity on the same rock, or give (fix) known values of the memory"
    ]


def _drained_at_once(fit: FitNumbers) -> list[str]:
    """Warning that a change of pore pressure acts at once, because the contact has no pores."""
    changing = [record.source for record in fit.plan.records if record.pressure_changes]
    if not changing or fit.plan.rig.contact.has_pores():
        return []
    return [
        f"the pore pressure changes in {enumerated(changing)}, and acts at once in this contact, which has no pores; "
        "where drainage takes time, fit its rate (lab_rig(pores=True), or no table [contact] in the file)"
    ]


def _alike(fit: FitNumbers, tried: tuple[RampFit, ...]) -> list[RampFit]:
    """Fits with ramps that are nearly as good as the best of them."""
    least = min(one.ssq for one in tried)
    return [one for one in tried if one.ssq < least * fit.nearly]


def _lengths(fit: FitNumbers, ramped: RampFit) -> str:
    own = [
        format_quantity(x, "s") for name, x in ramped.values.items() if ".duration" in name and name not in fit.values
    ]
    return enumerated(own)


def _relative_change(fit: FitNumbers, ramped: RampFit) -> str:
    share = ramped.ssq / fit.ssq - 1
    return f"{abs(share):.2%} {'larger' if share > 0 else 'less'}"


def _symbol(name: str) -> str:
    return "k" if name == "slider.stiffness" else name.rpartition(".")[2]


def drive_line(fit: FitNumbers) -> str:
    """Text on the loading of the model, and on its effect on a, b and k."""
    plan = fit.plan
    if plan.protocol is not None:
        return f"the given protocol, from {own_rate(fit)} on"
    if plan.drive == "measured":
        return "load point and normal stress as measured, noise included"
    loads = [loading.load for loading in plan.loading if loading.load is not None]
    if any(course.curve is not None for course in loads):
        return "a smooth curve through the measured displacement"
    count = sum(len(course.changes) for course in loads)
    free = [one.parameter for one in fit.space.unknowns if one.parameter.startswith("step.")]
    what_of = "times and durations" if any(name.endswith(".duration") for name in free) else "times"
    of_each = [[channel for channel, _, _ in loading.changes] for loading in plan.loading if plan.pressed]
    pressed = {what: sum(own.count(channel) for own in of_each)
               for channel, what in (("stress", "normal stress"), ("pore", "pore pressure"))}  # fmt: skip
    text = f"commanded loading found in the record, {count} change{'' if count == 1 else 's'} of rate"
    text += "".join(f" and {number} of {what}" for what, number in pressed.items() if number)
    text += (
        f", {len(free)} of {'its' if count + sum(pressed.values()) == 1 else 'their'} {what_of} fitted" if free else ""
    )
    for record, course in zip(plan.records, loads, strict=False):
        servo = _servo(course)
        text += f"{servo} in {record.source}" if servo and len(loads) > 1 else servo
    if any(one.parameter == "start.hold" for one in fit.space.unknowns):
        text += "; at rest at first, for a fitted time (start.hold)"
    if plan.initial == "free" and any(one.parameter.startswith("initial.") for one in fit.space.unknowns):
        text += "; not steady at first, by fitted differences (initial)"
    if plan.beginnings:
        text += "; at first as the step before left friction"
    slips, glitches = sum(c.slips for c in loads), sum(c.glitches for c in loads)
    if slips or glitches:
        kinds = (slips, "slip", "slips"), (glitches, "glitch", "glitches")
        said = " and ".join(f"{n} {one if n == 1 else many}" for n, one, many in kinds if n)
        text += f"; {said} of the sensor left out"
    other = fit.as_measured
    if other is None:
        return text
    shares = [
        f"{_symbol(name)} {other[name] / fit.values[name] - 1:+.0%}"
        for name in _steep_names(fit.rig(0))
        if name in other and fit.values.get(name) and fit[name].determined
    ]
    return f"{text}; the measured displacement would make {', '.join(shares)}" if shares else text


def _servo(course: Course) -> str:
    """Clause on the response of the load point to its commanded changes; empty for steps and ramps."""
    if any(change.pieces for change in course.changes):
        return (
            "; around changes the load point moves as measured, in straight pieces of its rate, because the "
            "displacement there lies beside steps, ramps and the response of a servo by more than its noise"
        )
    late = next((change for change in course.changes if change.lag), None)
    if late is None:
        return ""
    beyond = overshoot(late.damping)
    over = f", and overshoots by {format_percent(beyond)}" if beyond >= OVERSHOOT else ""
    lag = format_quantity(late.lag, "s")
    return f"; the servo follows late, in the end by {lag}{over}"


def _steep_names(rig: Slider) -> tuple[str, ...]:
    """Names of the parameters on which noise of a displacement has the largest effect: a, b and stiffness."""
    kinds = ("direct effect", "evolution effect", "stiffness")
    return tuple(name for kind in kinds for name in rig.of_kind(kind))


def as_dict(fit: FitNumbers) -> dict[str, Any]:
    """Data of a fit for JSON, in SI units; None for numbers that do not exist."""
    return fitted_dict(fit) | {
        "derived": {one.name: estimate_dict(one) for one in fit.derived},
        "driven_by": drive_line(fit),
        "rms": fit.rms,
        "remedies": [one.to_dict() for one in fit.remedies],
        "warnings": warnings(fit),
        "notes": {record.source: list(record.notes) for record in fit.plan.records},
    }
