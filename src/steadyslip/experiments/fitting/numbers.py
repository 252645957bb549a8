"""Numbers of a slider's fit: derived quantities such as the critical stiffness, and short refits with other models."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.comparison import Comparison
from steadyslip.experiments.fitting.derived import DERIVED, Minimum, derived_estimates, derived_values, joint_errors
from steadyslip.experiments.fitting.equal_minima import opened
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.growing import stress_alone
from steadyslip.experiments.fitting.memories import Rival, equal_memories, forgets_changes
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.refit import RampFit, driven_as_measured, with_ramps
from steadyslip.experiments.fitting.remedies import (
    STRONG_EVIDENCE,
    Remedy,
    continued,
    mended,
    ranked,
    remedies,
    slow_state,
)
from steadyslip.experiments.fitting.unknowns import Unknown
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.machine.slider import Slider

BEYOND = 3.0  # an unbounded fit may move the time of a change out of its window by up to this many standard errors
SIGNIFICANT_GAIN = 9.0  # a larger decrease of the sum of squares, in variances of a sample, is significant: three σ
DIFFERENCE = re.compile(r"^\s*(a\s*[-−]\s*b|b\s*[-−]\s*a)(?=@|\s*$)")  # a minus the sum of all b, or its negative


@dataclass(frozen=True, eq=False)
class FitNumbers(Fitted):  # noqa: D101 -- its base has it
    __doc__: str | None = f"""{(Fitted.__doc__ or "").rstrip()}
    joint : mapping of str to float
        Errors of derived quantities that depend on undetermined parameters; see `derived.joint_errors`.
    """

    plan: Plan
    joint: Mapping[str, float] = field(default_factory=dict, repr=False)

    @cached_property
    def comparison(self) -> Comparison:
        return self.plan.comparison()

    def __getitem__(self, name: str) -> Estimate:
        """Estimate of a parameter or derived quantity by name; ``b - a`` is the negative of ``a - b``."""
        return self._derived(name) or super().__getitem__(name)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a parameter or derived quantity in SI units; see `Fitted.interval`."""
        if (one := self._derived(name)) is None:
            return super().interval(name, level)
        share = self._reach(level) / self._reach(0.95)
        low, high = ((end / one.value) ** share * one.value if DIFFERENCE.search(name) is None else
                     one.value + share * (end - one.value) for end in (one.low, one.high))  # fmt: skip
        return low, high

    def _derived(self, name: str) -> Estimate | None:
        """Derived quantity with a name; None if no derived quantity has this name."""
        found = DIFFERENCE.sub("a - b", name)
        own = (
            next((one for one in self.derived if one.name == found), None)
            if found.partition("@")[0] in DERIVED
            else None
        )
        if own is None or not name.lstrip().startswith("b"):
            return own
        return replace(own, name=name, value=-own.value, low=-own.high, high=-own.low)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals (friction coefficient, not weighted)."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def nearly(self) -> float:
        """Ratio of sums of squares below which two minima fit nearly as well."""
        worth = self.samples / float(np.mean([max(noise.inflation, 1.0) for noise in self.noise]))
        return 1 + SIGNIFICANT_GAIN / worth

    @cached_property
    def derived(self) -> tuple[Estimate, ...]:
        """Quantities that follow from the parameters: ``a - b``, critical stiffness ``k_c``, ``k/k_c``, ``k/k_cal``."""
        return derived_estimates(self._minimum, [part.rig for part in self.comparison.parts], self.plan.calibrated)

    def derived_at(self, coordinates: Array) -> dict[str, Array]:
        """Values (m,) of the quantities in `derived` at coordinates (m, p), by name; NaN if undefined."""
        rigs = [part.rig for part in self.comparison.parts]
        found = derived_values(self.space, rigs, self.plan.calibrated, coordinates)
        return {one.name: found[one.name] for one in self.derived}

    @cached_property
    def as_measured(self) -> dict[str, float] | None:
        """Values, by name, of a fit driven by the measured columns instead of the commanded loading.

        They are None if the loading of the fit is not commanded, the measured columns have hardly any noise, or the
        search was stopped before it ended.
        """
        return None if not self.search.converged else driven_as_measured(self.plan, self.values, self._ends)

    @cached_property
    def as_ramps(self) -> tuple[RampFit, ...]:
        """Fits in which ramps replace the velocity steps that the displacement does not distinguish from ramps."""
        return with_ramps(self.plan, self.values, self._ends, self.ssq * self.nearly)

    @cached_property
    def remedies(self) -> tuple[Remedy, ...]:
        """Short fits with other laws, a lag or a trend, if residuals have structure or a fit is better; the best first.

        Otherwise, if the normal stress changes, short fits with a memory of it that are as good as without a memory.
        """
        forgets = forgets_changes(self.plan)
        if self.whiteness.p < STRUCTURE or (
            not forgets and self.search.converged and mended(self.plan, self.ssq, self.values)
        ):
            ended = self.search.converged
            reached = self.ssq if ended else continued(self.plan, self.ssq, self.values)
            return remedies(self.plan, reached, self.values)
        return tuple(one.remedy for one in self._equal_memories()) if forgets else ()

    def with_open(self, covariance: Array, near: Array) -> Self:
        """Fit with errors of derived quantities that depend on undetermined parameters; see `Fitted.with_open`."""
        if not self._minimum.lost or not self.search.converged:
            return self
        return replace(self, joint=self._joint(replace(self._minimum, covariance=covariance), self.covariance, near))

    def _joint(self, minimum: Minimum, covariance: Array, near: Array) -> dict[str, float]:
        """Errors, at `minimum`, of derived quantities that depend on parameters undetermined in a covariance (p, p).

        The result is empty if no rate changes: only friction at two rates determines a - b without a and b.
        """
        rigs, lost = [part.rig for part in self.comparison.parts], replace(minimum, covariance=covariance).lost
        if stress_alone(self.plan):
            return {}
        near = np.vstack([minimum.coordinates, near])
        return joint_errors(minimum, rigs, self.plan.calibrated, lost, near) if lost else {}

    def with_memories(self) -> Self:
        """Fit with larger errors of parameters that change if a memory of normal stress is added that fits as well.

        Parameters that change much become undetermined. If another memory, or another law with a memory, fits better,
        this fit is unchanged and `remedies` contains the better model, as for residuals with structure.
        """
        if self.plan.trend and self.search.converged:
            return self._without_weakening()
        forgets = forgets_changes(self.plan)
        if not ((forgets or stress_alone(self.plan)) and self.search.converged) or self.whiteness.p < STRUCTURE:
            return self
        rivals = self._equal_memories()
        if not (rivals or forgets):
            return self
        other = forgets and mended(self.plan, self.ssq, self.values)
        better = remedies(self.plan, self.ssq, self.values, 1) if other else ()
        if better and better[0].gain - max((one.remedy.gain for one in rivals), default=0.0) > STRONG_EVIDENCE:
            same = replace(self)
            same.__dict__["remedies"] = better
            return same
        equal = [one for one in rivals if one.remedy.gain < STRONG_EVIDENCE]
        equal = equal if len(equal) == len(rivals) else []
        covariance, found = opened(self.space, self.covariance, equal)
        near = self.coordinates + np.array([one.shift(self.space) for one in equal]).reshape(-1, len(self.space))
        same = replace(self, covariance=covariance, unidentified=self.unidentified + found,
                       joint=self._joint(self._minimum, covariance, near))  # fmt: skip
        own = [one.remedy for one in rivals]
        if max((one.gain for one in own), default=0.0) >= STRONG_EVIDENCE:  # sizes of memories were held, not fitted
            own = list(ranked([*(better or remedies(self.plan, self.ssq, self.values, 1)), *own], self.ssq))
        same.__dict__["remedies"] = tuple(own)
        return same

    def _without_weakening(self) -> Self:
        """Fit without errors of b and a - b, if a second state of long slip distance fits as well as the fit's trend.

        If residuals have structure, neither model is right, and the state must fit better by strong evidence.
        """
        slow = slow_state(self.plan, self.ssq, self.plan, self.values)
        noise = self.whiteness.p >= STRUCTURE
        if slow is None or slow.gain < (-STRONG_EVIDENCE if noise else STRONG_EVIDENCE):
            return self
        lost = np.array([one.kind == "evolution effect" for one in self.space.unknowns])
        covariance = np.where(lost | lost[:, None], 0.0, self.covariance)
        covariance[lost, lost] = np.inf
        same = replace(self, covariance=covariance, joint={})
        if noise:
            same.__dict__["remedies"] = (slow,)
        return same

    def with_variants(self) -> Self:
        """This fit, after the short refits for its text have been computed, so that it is printed quickly."""
        _ = self.as_measured, self.as_ramps, self.remedies
        return self

    def _equal_memories(self) -> list[Rival]:
        return equal_memories(self.plan, self.ssq, self.values, self._minimum.deviations, self._independent)

    @property
    def _independent(self) -> float:
        """Number of independent samples in the residuals."""
        parts = zip(self.comparison.slices, self.noise, strict=True)
        return float(sum((where.stop - where.start) / max(noise.inflation, 1.0) for where, noise in parts))

    @property
    def _minimum(self) -> Minimum:
        return Minimum(self.space, self.coordinates, self.covariance, self.degrees, self.joint)

    @property
    def _ends(self) -> dict[str, tuple[float, float]]:
        """Bounds of the search, in coordinates, by name of the unknown."""
        return dict(zip(self.names, zip(*self.bounds, strict=True), strict=True))

    def rig(self, record: int = 0) -> Slider:
        """Rig with the fitted values, and the initial velocity and normal stress of a record."""
        driven = self.comparison.parts[record].rig
        own = {
            one.parameter: self.values[one.name]
            for one in self.space.unknowns
            if one.record in (None, record) and one.parameter in driven.parameters()
        }
        return driven.with_values(own)

    def _beyond_window(self, one: Unknown, when: str) -> str:
        """Explanation for the time of a change that ended at a bound of its window; empty for other unknowns."""
        if not (self.plan.follows and one.parameter.startswith("step.") and one.parameter.endswith(".at")):
            return ""
        return (
            f": by friction the change is {when} than the record's other columns allow; the model does not follow "
            "friction around it (another law, two states, a ramp), or friction was not sampled at the same times"
        )

    def _beyond(self, which: int) -> bool:
        one = self.space.unknowns[which]
        if not (self.plan.follows and one.parameter.startswith("step.") and one.parameter.endswith(".at")):
            return True
        deviation = float(np.sqrt(self.covariance[which, which]))
        if self.whiteness.p < STRUCTURE:  # the model may be wrong, and every time at a bound is a sign of this
            return True
        return not np.isfinite(deviation) or abs(float(self._released[which])) > BEYOND * deviation

    @cached_property
    def _released(self) -> Array:
        """Gauss-Newton step (p,) from the minimum, in coordinates, computed as if there were no bounds."""
        residuals, jacobian = (own[0] for own in self.comparison.residuals(self.coordinates[None]))
        return np.asarray(np.linalg.lstsq(jacobian @ jacobian.T, -jacobian @ residuals)[0])

    def _between_samples(self, one: Unknown) -> bool:
        """True if an unknown is the time of a jump or a step that lies between two neighbouring samples."""
        if one.parameter.startswith("jump."):
            return True
        time = self.plan.records[one.record or 0].time
        return one.parameter.startswith("step.") and one.high - one.low < 1.01 * float(np.max(np.diff(time)))
