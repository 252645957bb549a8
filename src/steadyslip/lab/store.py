"""Fits as netCDF files: everything that is needed to go on with one, records included; opening executes nothing."""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.errors import NotAvailable
from steadyslip.lab.identify import Combination
from steadyslip.lab.noise import Noise
from steadyslip.lab.plan import Plan, with_sharp_changes
from steadyslip.lab.record import Record
from steadyslip.lab.result import Fit, Search
from steadyslip.output import read_dataset, write_dataset

_COLUMNS = ("time", "friction", "normal", "shear", "displacement", "velocity")
_OPTIONS = ("free", "separate", "drive", "trend", "trend_axis", "offset", "loss", "width", "rtol")


def to_dataset(fit: Fit) -> Any:
    """The fit as an xarray.Dataset."""
    import xarray as xr

    from steadyslip.config import rig_to_text

    names = list(fit.names)
    variables: dict[str, Any] = {
        "coordinates": ("parameter", fit.coordinates, {"long_name": "place of the minimum, logarithms where positive"}),
        "value": ("parameter", np.array(list(fit.values.values())), {}),
        "error": ("parameter", np.array(list(fit.errors.values())), {}),
        "unit": ("parameter", np.array([one.unit for one in fit.space.unknowns], dtype=object), {}),
        "covariance": (("parameter", "other"), fit.covariance, {"long_name": "of the coordinates"}),
        "bound": (("parameter", "side"), np.array(fit.bounds).T, {}),
    }
    for i, (record, noise) in enumerate(zip(fit.plan.records, fit.noise, strict=True), start=1):
        dim = f"sample_{i}"
        for name in _COLUMNS:
            if (column := getattr(record, name)) is not None:
                variables[f"{name}_{i}"] = (dim, np.asarray(column), {"units": _unit(name)})
        if fit.plan.weights is not None:
            variables[f"weight_{i}"] = (dim, fit.plan.weights[i - 1], {})
        variables[f"model_{i}"] = (dim, fit.part(fit.model, i - 1), {"units": "1"})
        variables[f"noise_coefficients_{i}"] = (f"order_{i}", noise.coefficients, {})
        variables[f"noise_covariance_{i}"] = (f"lag_{i}", noise.covariance, {})
    attributes = {
        "rig": rig_to_text(fit.plan.rig, fit.plan.protocol),
        "has_protocol": int(fit.plan.protocol is not None),
        "options": json.dumps({name: getattr(fit.plan, name) for name in _OPTIONS}),
        "ssq": fit.ssq,
        "search": json.dumps(vars(fit.search)),
        "unidentified": json.dumps([vars(one) for one in fit.unidentified]),
        "noise": json.dumps([[n.lag1, n.correlated, n.innovation] for n in fit.noise]),
        "records": json.dumps([[r.source, list(r.notes), r.integrated] for r in fit.plan.records]),
        "steadyslip": fit.version,
    }
    return xr.Dataset(variables, coords={"parameter": names, "other": names}, attrs=attributes)


def _unit(name: str) -> str:
    from steadyslip.lab.columns import ROLES

    return ROLES[name]


def save(fit: Fit, path: str | PathLike[str]) -> None:
    """Write a fit; a file of that name is replaced only once the new one is whole.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    write_dataset(to_dataset(fit), path)


def load_fit(path: str | PathLike[str]) -> Fit:
    """Read a fit that `Fit.save` wrote.

    Raises
    ------
    NotAvailable
        If the file is not one of ours or cannot be read.
    """
    dataset = read_dataset(path)
    if "coordinates" not in dataset or "search" not in dataset.attrs:
        raise NotAvailable(f"{str(path)!r} is not a steadyslip fit; write one with 'steadyslip fit ... -o fit.nc'")
    from steadyslip.config import protocol_from_text, rig_from_text

    attributes = dataset.attrs
    text = str(attributes["rig"])
    stored = json.loads(attributes["options"])
    options: dict[str, Any] = {n: tuple(value) if isinstance(value, list) else value for n, value in stored.items()}
    described = json.loads(attributes["records"])
    records = tuple(_record(dataset, i, *about) for i, about in enumerate(described, start=1))
    weights = None
    if "weight_1" in dataset:
        weights = tuple(dataset[f"weight_{i}"].values for i in range(1, len(records) + 1))
    plan = with_sharp_changes(
        Plan(
            rig=rig_from_text(text, str(path)),
            records=records,
            protocol=protocol_from_text(text, str(path)) if attributes["has_protocol"] else None,
            weights=weights,
            **options,
        )
    )
    noises = tuple(
        Noise(lag1, bool(correlated), dataset[f"noise_coefficients_{i}"].values, innovation,
              dataset[f"noise_covariance_{i}"].values)
        for i, (lag1, correlated, innovation) in enumerate(json.loads(attributes["noise"]), start=1)
    )  # fmt: skip
    search = json.loads(attributes["search"])
    search["others"] = tuple(search["others"])
    return Fit(
        plan=plan,
        coordinates=dataset["coordinates"].values,
        ssq=float(attributes["ssq"]),
        search=Search(**search),
        noise=noises,
        covariance=dataset["covariance"].values,
        unidentified=tuple(Combination(**one) for one in json.loads(attributes["unidentified"])),
        bounds=(dataset["bound"].values[:, 0], dataset["bound"].values[:, 1]),
        version=str(attributes["steadyslip"]),
    )


def _record(dataset: Any, i: int, source: str, notes: list[str], integrated: bool) -> Record:
    columns: dict[str, Any] = {
        name: dataset[f"{name}_{i}"].values if f"{name}_{i}" in dataset else None for name in _COLUMNS
    }
    return Record(**columns, source=source, notes=tuple(notes), integrated=bool(integrated))
