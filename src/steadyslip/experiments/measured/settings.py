"""Options for reading records, as in the table ``[record]`` of a fit file."""

from __future__ import annotations

from typing import Any

from steadyslip.core.domains import positive
from steadyslip.core.entries import Headings, Label, Span, Text, Whole
from steadyslip.core.records import Settings, given, option, parameter, part, setting
from steadyslip.experiments.measured.columns import ROLES

FEWEST_KEPT = 50
"""Smallest number of samples that the option `decimate` may ask for: fewer cannot show several steps; by trial."""


class ColumnSettings(Settings):
    """Column of a record and its unit; in a file, a name, a number or a unit alone may stand for the table."""

    short = ("column", "unit")
    column: str | int | None = setting(Label("name in the file, number from 1, or unit"), default=None)
    unit: str | None = setting(Text("unit, where the name does not say it"), default=None)


class RecordSettings(Settings):
    """Options for reading records: roles of columns, and the part to use."""

    time: ColumnSettings | None = part(ColumnSettings, "column of the time", default=None)
    displacement: ColumnSettings | None = part(ColumnSettings, "column of the load point's displacement", default=None)
    velocity: ColumnSettings | None = part(ColumnSettings, "column of the load point's velocity", default=None)
    friction: ColumnSettings | None = part(ColumnSettings, "column of the friction coefficient", default=None)
    shear: ColumnSettings | None = part(ColumnSettings, "column of the shear stress or force", default=None)
    normal: ColumnSettings | None = part(ColumnSettings, "column of the normal stress or force", default=None)
    pore_pressure: ColumnSettings | None = part(
        ColumnSettings, "column of the pore pressure; the normal stress is then the total one", default=None
    )
    area: float | None = parameter(
        "m^2", positive, "contact area where shear and normal are forces; 1 m^2 unless given", default=None
    )
    normal_stress: float | None = parameter(
        "Pa", positive, "a constant normal stress where there is no column of it", default=None
    )
    table: str | None = setting(
        Text("group of an HDF5 or TDMS file, variable of a MATLAB file, sheet of a workbook"), default=None
    )
    sampling: float | None = parameter(
        "s", positive, "time between rows of a file without a column of time", default=None
    )
    rate: float | None = parameter(
        "m/s", positive, "constant rate of the load point, for a file with its displacement and no time", default=None
    )
    between: tuple[float, float] | None = setting(Span("part to use", "s"), default=None)
    skip_bad_lines: bool = option(False, True, doc="leave damaged lines out and say so", default=False)
    decimate: int | None = setting(Whole("keep about this many samples, dense after steps", FEWEST_KEPT), default=None)

    columns: dict[str, Any] | None = setting(
        Headings(
            "of a machine: the heading of each column, by the name that a run of the machine has for it, "
            '`{"table.x" = "encoder", "links.screw.force" = ["load cell", "N"]}`; headings that are such names '
            "need none"
        ),
        default=None,
    )
    averages: int = setting(Whole("of a machine: averages behind the coherence of frequency responses", 1), default=1)

    def arguments(self) -> dict[str, Any]:
        """Options that the file gives, as keyword arguments of `read_record`, and ``decimate``."""
        found = given(self)
        for role in ROLES:
            if role in found:
                column = found[role]
                found[role] = column.column if column.unit is None else {"column": column.column, "unit": column.unit}
        return found
