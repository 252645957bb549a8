"""Result of a fit, with its text, JSON data, files and figures."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

from steadyslip.core.checks import Check
from steadyslip.core.errors import NotAvailable
from steadyslip.core.options import checked
from steadyslip.core.pictures import draw
from steadyslip.experiments.fitting import store
from steadyslip.experiments.fitting.machines import machine_store
from steadyslip.experiments.fitting.machines.machine_result import MachineFit
from steadyslip.experiments.fitting.numbers import FitNumbers
from steadyslip.experiments.fitting.residuals import residual_checks
from steadyslip.experiments.fitting.words import as_dict, words
from steadyslip.files.sealed import holds


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FitNumbers):  # noqa: D101 -- its base has it
    __doc__ = FitNumbers.__doc__

    def __str__(self) -> str:
        return words(self)

    def __repr__(self) -> str:
        inner = ", ".join(f"{e.name}={e.value:.4g}" for e in self.estimates)
        return f"<Fit: {inner}; print it for errors and warnings>"

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of the sum of squares, the convergence, and the noise model from which errors are computed."""
        return residual_checks(self)

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data in SI units, as printed by ``--json``; None for missing numbers."""
        return as_dict(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fit and its records to a netCDF file; `load_fit` reads it back."""
        store.save(self, path)

    def plot(self, kind: str = "fit", ax: Any = None) -> Any:
        """Plot the fit.

        Parameters
        ----------
        kind : str
            ``fit`` (loading, record with model, residuals and their autocorrelation), ``steps`` (each step separately)
            or ``corner`` (estimates against each other).
        ax : array of matplotlib Axes, optional

        Returns
        -------
        array of matplotlib.axes.Axes
        """
        return draw(self, kind, ax=ax)


@checked()
def load_fit(path: str | PathLike[str]) -> Fit | MachineFit:
    """Read a fit that `Fit.save` or `MachineFit.save` wrote.

    Nothing in the file is executed, and any damage is detected.

    Raises
    ------
    NotAvailable
        If the file was not written by these methods, is damaged, or cannot be read.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> fit.save("fit.nc")
    >>> ss.load_fit("fit.nc")["d_c"] == fit["d_c"]
    True
    """
    if holds(path, machine_store.MACHINE_FIT):
        return machine_store.read(path, MachineFit)
    return store.read(path, Fit)


def load_friction_fit(path: str | PathLike[str]) -> Fit:
    """Fit of a slider's friction, read as by `load_fit`.

    Raises
    ------
    NotAvailable
        If the file contains the fit of a machine, is damaged, or cannot be read.
    """
    found = load_fit(path)
    if not isinstance(found, Fit):
        raise NotAvailable(f"{str(path)!r} holds the fit of a machine; allowed: friction fitted to records of a slider")
    return found
