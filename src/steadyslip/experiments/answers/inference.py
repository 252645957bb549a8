"""Conversion of draws to the data types of ArviZ, which only this module imports."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable


@dataclass(frozen=True)
class SampleDraws:
    """Measured samples of each record or column, with their likelihood and prediction for m draws.

    Attributes
    ----------
    times : dict of str to ndarray (n,)
        s.
    observed : dict of str to ndarray (n,)
    log_likelihood, predicted : dict of str to ndarray (m, n)
        Logarithm of the probability density of each sample given the samples before it, and simulated samples with
        noise. Draws are sorted by chain.
    """

    times: dict[str, Array]
    observed: dict[str, Array]
    log_likelihood: dict[str, Array]
    predicted: dict[str, Array]


MEMBERS = "experiment"  # name of the dimension of quantities that have a value for every experiment


def inference_data(
    values: Mapping[str, Array],
    units: Mapping[str, str],
    chains: int,
    *,
    statistics: Mapping[str, Array] | None = None,
    members: Sequence[str] = (),
    samples: SampleDraws | None = None,
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
    samples : SampleDraws, optional
        Likelihood and prediction of the samples of the records.

    Raises
    ------
    NotAvailable
        If ArviZ is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # ArviZ announces its later versions
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
    if samples is not None:
        groups |= {"observed_data": samples.observed, "log_likelihood": by_chain(samples.log_likelihood),
                   "posterior_predictive": by_chain(samples.predicted)}  # fmt: skip
        for name, time in samples.times.items():
            shape["dims"][name] = [f"{name}.time"]
            shape["coords"][f"{name}.time"] = time
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "More chains", UserWarning)  # posteriors have many short chains on purpose
        known = hasattr(arviz, "InferenceData")
        found = arviz.from_dict(**groups, **shape) if known else arviz.from_dict(groups, **shape)
    for name, unit in units.items():
        found["posterior"][name].attrs["units"] = unit
    for name in () if samples is None else samples.times:
        for group in ("observed_data", "posterior_predictive"):
            found[group][name].attrs["units"] = "1"
            found[group][f"{name}.time"].attrs["units"] = "s"
    return found
