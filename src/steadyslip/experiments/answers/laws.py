"""Comparison of friction laws by fits to the same records, with information criteria and cross-validation."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from steadyslip.core.errors import (
    NotAvailable,
    ParameterError,
    Problem,
    UnknownNameError,
    keywords_of,
    refuse_unknown,
)
from steadyslip.core.format import enumerated
from steadyslip.core.names import resolve
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.experiments.answers.validation import cross_validate
from steadyslip.experiments.fitting.fit import fit, refit_from, search_fit
from steadyslip.experiments.fitting.planning import can_be_free
from steadyslip.experiments.fitting.remedies import STRONG_EVIDENCE
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.measured.record import Record
from steadyslip.machine.slider import Slider

WIDTH = 100  # largest number of characters in a line of text
SCREENING_EFFORT = 0.1  # share of the effort for a first fit of each law; laws that may be the best get the full effort
MAX_SSQ_RATIO = 2.0  # laws above this multiple of the least sum of squares do not get a longer search
MIN_SHOWN_RATIO = 2.0  # the text gives ratios of sums of squares above this number, and percentages below it


@dataclass(frozen=True, eq=False)
class LawComparison(Displayed):
    """Fits of several models to the same records, the best first.

    Attributes
    ----------
    fits : dict of str to Fit
        Fits by label.
    criteria : dict of str to (float, float)
        AIC and BIC by label, computed with the same number of independent samples for all models.
    left_out : tuple of str
        Labels of models that were not fitted before Ctrl-C.
    refused : tuple of str
        Labels of models that cannot follow the records from any start.
    predicted : dict of str to float
        Root mean square error in the prediction of samples that were left out (see `cross_validate`), by label, for
        models near the best; empty unless computed.
    """

    fits: dict[str, Fit]
    criteria: dict[str, tuple[float, float]]
    left_out: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    predicted: Mapping[str, float] = field(default_factory=dict)

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C came before all models were fitted."""
        return bool(self.left_out)

    @property
    def best(self) -> str:
        """Label of the model with the least BIC, which penalises additional parameters.

        If the records do not decide whether friction has a memory of normal stress, a model without this memory is
        ranked behind the next model in which the memory is free.
        """
        return next(iter(self.fits))

    @property
    def weights(self) -> dict[str, float]:
        """Schwarz weights: probability of each model, by label, if all have the same prior probability."""
        least = min(bic for _, bic in self.criteria.values())
        raw = {label: float(np.exp(-0.5 * (bic - least))) for label, (_, bic) in self.criteria.items()}
        return {label: value / sum(raw.values()) for label, value in raw.items()}

    def __str__(self) -> str:
        wide = max(map(len, self.fits))
        unseen = "  left out, predicted to" if self.predicted else ""
        lines = [f"{'model':<{wide}}  parameters  sum of squares   AIC    BIC  weight{unseen}"]
        aic, bic = (min(pair[i] for pair in self.criteria.values()) for i in (0, 1))
        for label, one in self.fits.items():
            mine = self.criteria[label]
            lines.append(
                f"{label:<{wide}}  {len(one.space):>10}  {one.ssq:>14.6g}  {mine[0] - aic:>4.1f}  "
                f"{mine[1] - bic:>5.1f}  {self.weights[label]:>6.3f}"
                + (f"  {self.predicted[label]:>22.4g}" if label in self.predicted else "")
            )
        lines += textwrap.wrap(self.verdict, WIDTH)
        if self.refused:
            lines.append(f"cannot follow the records from any start: {'; '.join(self.refused)}")
        if self.left_out:
            lines.append(f"stopped before these were fitted: {'; '.join(self.left_out)}")
        return "\n".join(lines)

    @property
    def verdict(self) -> str:
        """Sentence that names the best model and its lead over the next model; empty for a single model."""
        best, *others = self.fits
        if not others:
            return ""
        other = others[0]
        own, next_best = self.fits[best], self.fits[other]
        ahead = self.criteria[other][1] - self.criteria[best][1]
        times = next_best.ssq / own.ssq
        less = (
            f"{times:.3g} times the sum of squares" if times > MIN_SHOWN_RATIO else f"a sum of squares {times - 1:+.2%}"
        )
        if taken := _taken_as_none(next_best) & set(own.names):
            return (
                f"'{best}' is the best, though the records do not determine {enumerated(sorted(taken))}: '{other}', "
                f"which lacks {'it' if len(taken) == 1 else 'them'}, has {less} and is {abs(ahead):.1f} "
                f"{'behind' if ahead > 0 else 'ahead'} in BIC; {_agreement(own, next_best)}."
            )
        if ahead < STRONG_EVIDENCE:
            return (
                f"The records hardly distinguish '{best}' from '{other}', which has {less} and is {ahead:.1f} behind "
                f"in BIC; {_agreement(own, next_best)}."
            )
        return f"'{best}' is the best: '{other}', the next, has {less} and is {ahead:.1f} behind in BIC."

    def plot(self, ax: Any = None) -> Any:
        """Plot the difference of each law from the best.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return draw(self, ax=ax)


def _taken_as_none(one: Fit) -> set[str]:
    """Names of parameters that a model lacks although they would affect it, such as a memory of normal stress."""
    return {name for own in one.unidentified for name in own.weights} - set(one.names)


def _agreement(one: Fit, other: Fit) -> str:
    """Clause that names the numbers on which two fits agree: the value of each fit is in the other's interval."""
    both = {own.name for own in (*one.estimates, *one.derived)}
    pairs = [(one[e.name], e) for e in (*other.estimates, *other.derived) if e.name in both and e.unit != "s"]
    agreed = [a.name for a, b in pairs if a.determined and b.determined and a.low <= b.value <= a.high
              and b.low <= a.value <= b.high]  # fmt: skip
    if len(agreed) == len(pairs):
        return "they agree on all numbers that both have"
    return f"they agree on {enumerated(agreed)} only" if agreed else "they agree on no number"


@checked()
def compare(fits: Mapping[str, Fit]) -> LawComparison:
    """Comparison of fits to the same records by information criteria.

    The number of independent samples is estimated from the residuals of the fit with the least sum of squares and used
    for all fits: a model must not seem better because it leaves more structure in its residuals.

    Parameters
    ----------
    fits : mapping of str to Fit

    Raises
    ------
    ParameterError
        If the fits are of different records.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> print(ss.experiments.compare({"slip": fit, "the same": fit}))
    model     parameters  sum of squares   AIC    BIC  weight
    slip               6     1.56072e-05   0.0    0.0   0.500
    the same           6     1.56072e-05   0.0    0.0   0.500
    The records hardly distinguish 'slip' from 'the same', which has a sum of squares +0.00% and is 0.0
    behind in BIC; they agree on all numbers that both have.
    """
    if len(fits) < 2:
        raise ParameterError([Problem("fits", f"got {len(fits)}; allowed: two or more")])
    return _in_order(fits)


def _in_order(fits: Mapping[str, Fit]) -> LawComparison:
    first = next(iter(fits.values()))
    for label, one in fits.items():
        same = len(one.plan.records) == len(first.plan.records) and all(
            np.array_equal(a.friction, b.friction) for a, b in zip(one.plan.records, first.plan.records, strict=True)
        )
        if not same:
            raise ParameterError([Problem(label, "is a fit to other records; allowed: fits to the same records")])
    best = min(fits.values(), key=lambda f: f.ssq)
    criteria = {label: one.criteria(best.noise) for label, one in fits.items()}
    order = sorted(fits, key=lambda label: criteria[label][1])
    taken = _taken_as_none(fits[order[0]])
    if freed := next((label for label in order if taken & set(fits[label].names)), None):
        order.insert(0, order.pop(order.index(freed)))
    return LawComparison({label: fits[label] for label in order}, {label: criteria[label] for label in order})


@checked()
def compare_laws(
    rig: Slider, records: Record | Sequence[Record], laws: Sequence[str] | None = None, **options: Any
) -> LawComparison:
    """Comparison of fits of several rate-and-state laws to the same records.

    Parameters
    ----------
    rig : Slider
        Rig with rate-and-state friction. Alternatives to its law have another evolution law, one or two states, or
        another memory of normal stress; everything else is kept.
    records : Record or sequence of Record
    laws : sequence of str, optional
        Labels of laws, such as ``aging``, ``slip, two states``, ``aging, linker-dieterich`` or ``prakash-clifton``. Of
        the rig's law, only the parts that a label names are changed. By default a few usual laws are compared; if the
        normal stress changes in the records, each of them with every memory of normal stress.
    **options
        As for `fit`. Parameters in ``free``, ``fixed`` and ``separate`` that a law does not have are ignored for it;
        parameters that the rig's law does not have are free. Ctrl-C compares the laws fitted so far, if there are at
        least two.

    Raises
    ------
    ParameterError
        If a law or an option is unknown, or the rig's friction law has no alternatives.
    NotAvailable
        If none of the laws can follow the records.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> found = ss.compare_laws(ss.lab_rig("slip"), record, ["slip", "aging"], starts=4)
    >>> print(found)
    model  parameters  sum of squares   AIC    BIC  weight  left out, predicted to
    slip            6     1.56072e-05   0.0    0.0   1.000               0.0002016
    aging           6     1.70956e-05  36.5   36.5   0.000               0.0002388
    'slip' is the best: 'aging', the next, has a sum of squares +9.54% and is 36.5 behind in BIC.
    """
    refuse_unknown("compare_laws", options, keywords_of(fit, ["rig", "records"]))
    many = tuple(records) if isinstance(records, (list, tuple)) else (records,)
    rigs = {label: with_law(rig, label) for label in (_usual_labels(rig, many) if laws is None else laws)}
    effort = options.pop("effort", 1.0)
    fits: dict[str, Fit] = {}
    refused: list[str] = []
    predicted: dict[str, float] = {}

    def fitted(label: str, share: float) -> None:
        try:
            fits[label] = search_fit(rigs[label], many, **_options_of(rig, rigs[label], options), effort=share)
        except NotAvailable:
            refused.append(label)

    try:
        for label in rigs:
            fitted(label, SCREENING_EFFORT * effort)
        if not fits:
            raise NotAvailable(f"none of the laws can follow these records from any start: {'; '.join(refused)}")
        fits |= {label: refit_from(own, [f for f in fits.values() if f is not own]) for label, own in fits.items()}
        for label in [label for label in _candidates(fits) if _may_be_missed(fits[label])]:
            fitted(label, effort)
        predicted = {label: cross_validate(fits[label]).rms for label in _candidates(fits)}
    except KeyboardInterrupt:
        if len(fits) < 2:
            raise
    left_out = tuple(label for label in rigs if label not in (*fits, *refused))
    return replace(_in_order(fits), left_out=left_out, refused=tuple(refused), predicted=predicted)


def _may_be_missed(one: Fit) -> bool:
    """True if a longer search might find a better minimum: the search ended before enough starts agreed on one."""
    return one.search.cut and (one.search.is_chance or not one.search.converged)


def _candidates(fits: Mapping[str, Fit]) -> list[str]:
    """Labels of the fits that a longer search might still make the best."""
    least = min(one.ssq for one in fits.values())
    return [label for label, one in fits.items() if one.ssq <= MAX_SSQ_RATIO * least]


def _usual_labels(rig: Slider, records: Sequence[Record]) -> tuple[str, ...]:
    """Labels of the laws compared by default; with every memory of normal stress, if the stress changes in a record."""
    law = rig.friction
    imposed = rig.contact.is_imposed() or rig.contact.has_pores()
    if not (imposed and any(record.stress_changes for record in records)):
        return law.compared
    return tuple(map(", ".join, product(law.compared, *law.decided_by_stress.values())))


def _options_of(rig: Slider, other: Slider, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a fit for `other`, a rig with another law: parameters it lacks are left out, and new ones are free."""
    before, after = (set(can_be_free(each)) for each in (rig, other))
    found = dict(options)
    for key in ("free", "fixed", "separate"):
        if options.get(key) is not None:
            found[key] = [name for name in options[key] if _full_name(name, before) not in before - after]
    if options.get("free") is not None:
        found["free"] += sorted(after - before)
    return found


def _full_name(name: str, known: Iterable[str]) -> str:
    try:
        return resolve(name, dict.fromkeys(known))
    except UnknownNameError:
        return name


def with_law(rig: Slider, label: str) -> Slider:
    """Rig with the friction law that a label names, such as ``"aging, two states"``."""
    known = rig.friction.alternatives()
    if not known:
        raise ParameterError(
            [Problem("rig", f"has {type(rig.friction).__name__} friction, which has no alternatives to compare")]
        )
    words = [word.strip() for word in label.replace("+", ",").split(",")]
    if not set(words) <= set(known):
        allowed = ", ".join(map(repr, known))
        raise ParameterError(
            [Problem("laws", f"got {label!r}; allowed: {allowed}, or several of these with commas between them")]
        )
    friction = rig.friction
    for word, changed in known.items():
        friction = changed(friction) if word in words else friction
    return replace(rig, friction=friction)
