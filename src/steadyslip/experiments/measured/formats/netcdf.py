"""Reader of netCDF files: classic files, such as saved runs, are read here; version 4 is read as HDF5."""

from __future__ import annotations

import math
from pathlib import Path

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import MOST_VALUES, Table, check_size, from_vectors
from steadyslip.files import netcdf
from steadyslip.files.inputs import read_bytes


def read(path: Path, table: str | None) -> Table:
    """Numeric variables of a file or, in version 4, of one of its groups."""
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        from steadyslip.experiments.measured.formats import hdf5

        return hdf5.read(path, table)
    if table is not None:
        raise NotAvailable(f"{str(path)!r}: a classic netCDF file has one table; leave table= away")
    found = netcdf.read(read_bytes(path, 8 * MOST_VALUES))
    numeric = {name: one for name, one in found.variables.items() if one.dtype != "S1"}
    check_size(path, sum(math.prod(one.shape) for one in numeric.values()))
    return from_vectors(path, {name: (one.numbers(), one.attributes.get("units")) for name, one in numeric.items()})
