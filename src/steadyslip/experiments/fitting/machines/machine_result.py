"""Result of a fit of a machine, with its text, data and file."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.checks import Check, in_words
from steadyslip.core.format import format_quantity
from steadyslip.core.pictures import draw
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.fitted_words import WIDTH, chance, fitted_dict, fitted_warnings, quality
from steadyslip.experiments.fitting.machines import machine_store
from steadyslip.experiments.fitting.machines.machine_plan import MachinePlan
from steadyslip.experiments.fitting.machines.series import EXACT
from steadyslip.experiments.fitting.residuals import residual_checks
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.machine.machine import Machine


@dataclass(frozen=True, eq=False, repr=False)
class MachineFit(Fitted):
    """Machine fitted to records of its motions, forces or frequency responses.

    Attributes
    ----------
    plan : MachinePlan
        Machine, records and options of the fit. Other attributes are as for `Fit`.
    """

    plan: MachinePlan

    def __str__(self) -> str:
        return _words(self)

    def __repr__(self) -> str:
        inner = ", ".join(f"{e.name}={e.value:.4g}" for e in self.estimates)
        return f"<MachineFit: {inner}; print it for errors and warnings>"

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the sum of squares, the convergence, and the noise model from which errors are computed."""
        return residual_checks(self)

    @property
    def scatter(self) -> dict[str, float]:
        """Root mean square of the residuals by name of the series, SI units; ``@2`` marks the second record."""
        several = len(self.plan.records) > 1
        return {
            f"{one.name}@{one.record + 1}" if several else one.name: float(np.sqrt(np.mean(self.residuals[where] ** 2)))
            for one, where in zip(self.plan.series, self.comparison.slices, strict=True)
        }

    def rig(self, record: int = 0) -> Machine:
        """Machine with the fitted values; if values differ between records, with the values of `record`."""
        known = self.plan.rig.parameters()
        return self.plan.rig.with_values({
            one.parameter: self.values[one.name]
            for one in self.space.unknowns
            if one.record in (None, record) and one.parameter in known
        })  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data in SI units, as printed by ``--json``; None for missing numbers."""
        return fitted_dict(self) | {"scatter": self.scatter, "warnings": _warnings(self)}

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fit and its records to a netCDF file; `load_fit` reads it back."""
        machine_store.save(self, path)

    def plot(self, kind: str = "fit", ax: Any = None) -> Any:
        """Plot the fit: every measured column with the prediction of the machine, and the residuals.

        Returns
        -------
        array of matplotlib.axes.Axes
        """
        return draw(self, kind, ax=ax)


def _words(fit: MachineFit) -> str:
    sources = ", ".join(dict.fromkeys(record.source or "responses" for record in fit.plan.records))
    wide = max(map(len, fit.names))
    lines = [f"machine fitted to {fit.samples} samples of {sources}"]
    for one in fit.estimates:
        interval = f"   95 %: {one.range()}" if one.determined else ""
        lines.append(f"  {one.name:<{wide}}  {one.shown()}{interval}")
    units = {one.name: one.unit for one in fit.plan.series}
    left = ", ".join(
        f"{format_quantity(rms, units[name.partition('@')[0]], 3)} of {name}" for name, rms in fit.scatter.items()
    )
    lines += ["", *textwrap.wrap(f"residuals       rms {left}", WIDTH, subsequent_indent=" " * 16), *quality(fit)]
    lines.append(in_words(residual_checks(fit)))
    for warning in _warnings(fit):
        lines += textwrap.wrap(f"! {warning}", WIDTH, subsequent_indent="  ")
    return "\n".join(lines)


def _warnings(fit: MachineFit) -> list[str]:
    """Sentences with warnings that a user must know before using the numbers of a fit."""
    found = fitted_warnings(fit)
    seen = any(rms > np.sqrt(EXACT) * one.size for rms, one in zip(fit.scatter.values(), fit.plan.series, strict=True))
    if seen and fit.whiteness.p < STRUCTURE:
        found.append(
            f"residuals have structure (whiteness {chance(fit.whiteness.p)}): the real machine does something that "
            "this model does not; plot the residuals, and free a damping, an offset, a trend, or the initial state"
        )
    return found
