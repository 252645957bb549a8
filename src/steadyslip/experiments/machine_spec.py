"""Fit files of machines: rig files with bodies and links that also have the tables ``[record]`` and ``[fit]``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, ClassVar

from steadyslip.core.errors import Problem, keywords_of, refuse_unknown
from steadyslip.core.pages import Displayed
from steadyslip.core.records import given
from steadyslip.experiments.fitting.fit import fit
from steadyslip.experiments.fitting.machines.fit_machine import fit_machine
from steadyslip.experiments.fitting.machines.machine_result import MachineFit
from steadyslip.experiments.fitting.settings import FitSettings
from steadyslip.experiments.measured.motion_record import (
    MotionRecord,
    is_response,
    read_frequency_response,
    read_motion,
)
from steadyslip.experiments.measured.settings import RecordSettings
from steadyslip.files.specifications.read import RigFileContents
from steadyslip.machine.machine import Machine
from steadyslip.machine.responses import ResponseData
from steadyslip.protocol import Protocol

READ = ("time", "columns", "table", "between", "sampling", "skip_bad_lines", "averages")
"""Keys of ``[record]`` that are allowed for a machine."""


@dataclass(frozen=True)
class MachineSpec(Displayed):
    """Contents of the fit file of a machine.

    Attributes
    ----------
    rig : Machine
    protocol : Protocol or None
    record : RecordSettings
        Format of the records.
    options : dict
        Arguments of `fit`.
    """

    rig: Machine
    protocol: Protocol | None = None
    record: RecordSettings = field(default_factory=RecordSettings)
    options: dict[str, Any] = field(default_factory=dict)
    population: ClassVar[None] = None

    def read(self, path: str | PathLike[str], skip_bad_lines: bool = False) -> MotionRecord | ResponseData:
        """Frequency responses, or motions over time, read from a file with the settings of the fit file."""
        if is_response(path):
            return read_frequency_response(path, averages=self.record.averages)
        options = {name: value for name, value in self.record.arguments().items() if name != "averages"}
        options["skip_bad_lines"] = skip_bad_lines or options.get("skip_bad_lines", False)
        if isinstance(clock := options.get("time"), dict):
            options["time"] = (clock["column"], clock["unit"])
        return read_motion(path, **options)

    def fit(self, records: Sequence[MotionRecord | ResponseData], **changes: Any) -> MachineFit:
        """Fit to records with the settings of the file; `changes`, as for `steadyslip.fit`, replace some of them."""
        refuse_unknown("MachineSpec.fit", changes, keywords_of(fit, ["rig", "records"]))
        return fit_machine(self.rig, records, **(self.options | {"protocol": self.protocol} | changes))

    def compared(self, records: Sequence[Any]) -> tuple[str, ...]:
        """Empty tuple: friction laws of machines are not compared (see `Spec.compared`)."""
        return ()


def machine_spec(found: RigFileContents) -> MachineSpec:
    """MachineSpec from the contents of a fit file; one error lists all its problems."""
    record, settings = found.further.get("record"), found.further.get("fit")
    record = record if isinstance(record, RecordSettings) else RecordSettings()
    options = {} if settings is None else given(settings)
    only = "has no meaning for a machine; allowed: {}"
    problems = [Problem(f"record.{name}", only.format(", ".join(READ))) for name in given(record) if name not in READ]
    if "population" in found.further:
        problems.append(Problem("population", "needs fits of sliders; leave it out for a machine"))
    if not isinstance(settings, FitSettings) or settings.free is None:
        problems.append(Problem("fit.free", "missing; name the parameters of the machine to fit"))
    rig = found.checked_rig(*problems)
    options = {name: list(value) if isinstance(value, tuple) else value for name, value in options.items()}
    return MachineSpec(rig, found.protocol, record, options)  # type: ignore[arg-type]
