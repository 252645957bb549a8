"""Which law do the records speak for?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import InternalError, ParameterError, Problem
from steadyslip.core.pictures import draw
from steadyslip.experiments.fitting.fit import fit
from steadyslip.experiments.fitting.result import Fit
from steadyslip.laws.friction import PRZ, Aging, RateState, Slip, State
from steadyslip.machine.slider import Slider

EVOLUTIONS = {"slip": Slip, "aging": Aging, "prz": PRZ}


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Fits of several models to the same records, the best first.

    Attributes
    ----------
    fits : dict of str to Fit
        By label.
    criteria : dict of str to (float, float)
        AIC and BIC, with the same number of independent samples for all.
    left_out : tuple of str
        Models that were not fitted before Ctrl-C.
    """

    fits: dict[str, Fit]
    criteria: dict[str, tuple[float, float]]
    left_out: tuple[str, ...] = ()

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
        lines = [f"{'model':<{wide}}  parameters  sum of squares   AIC    BIC  weight"]
        aic, bic = (min(pair[i] for pair in self.criteria.values()) for i in (0, 1))
        for label, one in self.fits.items():
            mine = self.criteria[label]
            lines.append(
                f"{label:<{wide}}  {len(one.space):>10}  {one.ssq:>14.6g}  {mine[0] - aic:>4.1f}  "
                f"{mine[1] - bic:>5.1f}  {self.weights[label]:>6.3f}"
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


def compare_laws(
    rig: Slider, records: Any, laws: Sequence[str] = ("slip", "aging", "prz", "slip, two states"), **options: Any
) -> LawComparison:
    """Fit several rate-and-state laws to the same records.

    Parameters
    ----------
    rig : Slider
        With rate-and-state friction; everything but its evolution law and number of states is kept.
    records : Record or sequence of Record
    laws : sequence of str
        ``slip``, ``aging`` or ``prz``, each also with ``, two states``.
    **options
        As for `fit`. Ctrl-C compares the laws that have been fitted, where there are two or more.

    Raises
    ------
    ParameterError
        If a law is unknown or the rig has another kind of friction.
    """
    fits: dict[str, Fit] = {}
    rigs = {label: with_law(rig, label) for label in laws}
    try:
        for label, one in rigs.items():
            fits[label] = fit(one, records, **options)
    except KeyboardInterrupt:
        if len(fits) < 2:
            raise
    return replace(compare(fits), left_out=tuple(label for label in rigs if label not in fits))


def with_law(rig: Slider, label: str) -> Slider:
    """The rig with the evolution law and number of states that a label names."""
    word, _, states = (part.strip() for part in label.partition(","))
    if word not in EVOLUTIONS or states not in ("", "two states"):
        known = ", ".join(f"{name}, '{name}, two states'" for name in EVOLUTIONS)
        raise ParameterError([Problem("laws", f"got {label!r}; allowed: {known}")])
    friction = rig.friction
    if not isinstance(friction, RateState):
        raise ParameterError([Problem("rig", f"has {type(friction).__name__} friction; allowed: RateState")])
    b, d_c = (friction.b, friction.d_c) if not friction.states else (friction.states[0].b, friction.states[0].d_c)
    if d_c is None:
        raise InternalError("d_c is not None")
    if b is None:
        raise InternalError("b is not None")
    evolution = EVOLUTIONS[word]()
    if states:
        pair = (State(b=0.6 * b, d_c=d_c), State(b=0.4 * b, d_c=10 * d_c))
        changed = replace(friction, evolution=evolution, states=pair, b=None, d_c=None)
    else:
        changed = replace(friction, evolution=evolution, states=(), b=b, d_c=d_c)
    return replace(rig, friction=changed)
