"""Convert draws to ArviZ; the only module that imports the package."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable

MEMBERS = "experiment"  # the dimension of what every experiment has


def inference_data(
    values: Mapping[str, Array],
    units: Mapping[str, str],
    chains: int,
    *,
    statistics: Mapping[str, Array] | None = None,
    members: Sequence[str] = (),
) -> Any:
    """Convert draws to the data type of ArviZ.

    Parameters
    ----------
    values : mapping of str to ndarray (m,) or (m, members)
        Draws in SI units, one chain after another, all of equal length.
        units : mapping of str to str
            Unit of each quantity.
        chains : int
            Number of chains.
    statistics : mapping of str to ndarray (m,), optional
        Quantities of the group ``sample_stats``.
    members : sequence of str, optional
        Labels of the experiments.

    Raises
    ------
    NotAvailable
        If ArviZ is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # about versions of its own to come
            import arviz
    except ImportError as error:
        raise NotAvailable("this needs the package arviz; install steadyslip[lab]") from error

    def by_chain(columns: Mapping[str, Array]) -> dict[str, Array]:
        return {name: column.reshape(chains, -1, *column.shape[1:]) for name, column in columns.items()}

    groups: dict[str, Any] = {"posterior": by_chain(values)}
    if statistics:
        groups["sample_stats"] = by_chain(statistics)
    shape: dict[str, Any] = {"dims": {name: [MEMBERS] for name, column in values.items() if column.ndim == 2},
             "coords": {MEMBERS: list(members)} if members else {}}  # fmt: skip
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "More chains", UserWarning)  # walkers are many, and meant to be
        known = hasattr(arviz, "InferenceData")
        found = arviz.from_dict(**groups, **shape) if known else arviz.from_dict(groups, **shape)
    for name, unit in units.items():
        found["posterior"][name].attrs["units"] = unit
    return found
