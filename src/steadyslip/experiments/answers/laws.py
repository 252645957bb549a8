"""Which law do the records speak for?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.experiments.answers.validation import cross_validate
from steadyslip.experiments.fitting.fit import fit, started_from
from steadyslip.experiments.fitting.result import Fit
from steadyslip.machine.slider import Slider


@dataclass(frozen=True, eq=False)
class LawComparison(Displayed):
    """Fits of several models to the same records, the best first.

    Attributes
    ----------
    fits : dict of str to Fit
        By label.
    criteria : dict of str to (float, float)
        AIC and BIC, with the same number of independent samples for all.
    left_out : tuple of str
        Models that were not fitted before Ctrl-C.
    predicted : dict of str to float
        Root mean square error of predicting samples that were left out, see `cross_validate`; empty unless asked for.
    """

    fits: dict[str, Fit]
    criteria: dict[str, tuple[float, float]]
    left_out: tuple[str, ...] = ()
    predicted: Mapping[str, float] = field(default_factory=dict)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C came before all were fitted."""
        return bool(self.left_out)

    @property
    def best(self) -> str:
        """Label of the model with the least AIC."""
        return next(iter(self.fits))

    @property
    def weights(self) -> dict[str, float]:
        """Akaike weights: relative support of the models."""
        least = min(aic for aic, _ in self.criteria.values())
        raw = {label: float(np.exp(-0.5 * (aic - least))) for label, (aic, _) in self.criteria.items()}
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
                + (f"  {self.predicted[label]:>22.4g}" if self.predicted else "")
            )
        if self.left_out:
            lines.append(f"stopped before these were fitted: {'; '.join(self.left_out)}")
        return "\n".join(lines)

    def plot(self, ax: Any = None) -> Any:
        """Draw the laws by how much worse than the best they are.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return draw(self, ax=ax)


@checked()
def compare(fits: Mapping[str, Fit]) -> LawComparison:
    """Compare fits to the same records by information criteria.

    Samples count as many times as they are independent. How many that is, the residuals of the fit with the least sum
    of squares say, for all of them: a model that leaves more structure in its residuals must not be excused by it.

    Parameters
    ----------
    fits : mapping of str to Fit

    Raises
    ------
    ParameterError
        If the fits are of different records.
    """
    if len(fits) < 2:
        raise ParameterError([Problem("fits", f"got {len(fits)}; allowed: two or more")])
    first = next(iter(fits.values()))
    for label, one in fits.items():
        same = len(one.plan.records) == len(first.plan.records) and all(
            np.array_equal(a.friction, b.friction) for a, b in zip(one.plan.records, first.plan.records, strict=True)
        )
        if not same:
            raise ParameterError([Problem(label, "is a fit to other records; allowed: the same")])
    best = min(fits.values(), key=lambda f: f.ssq)
    criteria = {label: one.criteria(best.noise) for label, one in fits.items()}
    order = sorted(fits, key=lambda label: criteria[label][0])
    return LawComparison({label: fits[label] for label in order}, {label: criteria[label] for label in order})


@checked()
def compare_laws(rig: Slider, records: Any, laws: Sequence[str] | None = None, **options: Any) -> LawComparison:
    """Fit several rate-and-state laws to the same records.

    Parameters
    ----------
    rig : Slider
        Whose friction law names alternatives: rate-and-state friction every evolution law without parameters of its
        own, with one state or two. Everything else is kept.
    records : Record or sequence of Record
    laws : sequence of str, optional
        Their labels, such as ``aging`` or ``slip, two states``; a few usual ones unless given.
    **options
        As for `fit`. Ctrl-C compares the laws that have been fitted, where there are two or more.

    Raises
    ------
    ParameterError
        If a law is unknown or the rig's friction has no alternatives.
    """
    fits: dict[str, Fit] = {}
    rigs = {label: with_law(rig, label) for label in (rig.friction.compared if laws is None else laws)}
    try:
        for label, one in rigs.items():
            fits[label] = fit(one, records, **options)
        fits = {label: started_from(own, [f for f in fits.values() if f is not own]) for label, own in fits.items()}
        predicted = {label: cross_validate(own).rms for label, own in fits.items()}
    except KeyboardInterrupt:
        if len(fits) < 2:
            raise
        predicted = {}
    left_out = tuple(label for label in rigs if label not in fits)
    return replace(compare(fits), left_out=left_out, predicted=predicted)


def with_law(rig: Slider, label: str) -> Slider:
    """The rig with the friction law, of those that its own names as alternatives, that a label names."""
    known = rig.friction.alternatives()
    if not known:
        raise ParameterError(
            [Problem("rig", f"has {type(rig.friction).__name__} friction, which names no alternatives")]
        )
    word, _, states = (part.strip() for part in label.partition(","))
    friction = known.get(f"{word}, {states}" if states else word)
    if friction is None:
        raise ParameterError([Problem("laws", f"got {label!r}; allowed: {', '.join(map(repr, known))}")])
    return replace(rig, friction=friction)
