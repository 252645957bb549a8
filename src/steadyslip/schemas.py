"""JSON schema of rig, protocol, map and fit files, from the tables that each layer declares."""

from __future__ import annotations

from typing import Any

from steadyslip.experiments.spec import TABLES as FIT_TABLES
from steadyslip.files.specifications.schema import DIALECT, partial, protocol_schema, rig_schema
from steadyslip.maps.plan.map_file import TABLE as MAP_TABLE


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of rig, protocol, map and fit files, as ``steadyslip schema`` prints it.

    A file with a table ``[fit]`` or ``[record]`` may leave out parameters that are fitted or follow from records; a
    file with a protocol alone needs no rig.

    Examples
    --------
    >>> ss.json_schema()["title"]
    'steadyslip file'
    """
    whole = rig_schema((MAP_TABLE,))
    every = partial(rig_schema((MAP_TABLE, *FIT_TABLES)))
    of_fit = {"anyOf": [{"required": [table.name]} for table in FIT_TABLES]}
    alone = {"required": ["protocol"], "maxProperties": 1}
    return {
        "$schema": DIALECT,
        "title": "steadyslip file",
        "description": "Numbers are SI, per unit contact area (totals if slider.area is given); text carries a unit.",
        **every,
        "if": {"anyOf": [*of_fit["anyOf"], alone]},
        "then": {"properties": {"protocol": protocol_schema()}},
        "else": whole,
    }
