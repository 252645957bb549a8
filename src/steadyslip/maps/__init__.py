"""Maps: analyses of millions of rigs, on this machine or a cluster, stored on disk chunk by chunk.

A `Map` (`plan`: axes, measures) is computed chunk by chunk (`work`) by processes on this machine or a cluster, stored
in a Zarr group (`store`) and returned as a `MapResult` (`view`), which can be exported, drawn and refined. Does not
import figures or reports.
"""

from __future__ import annotations

from steadyslip.maps.plan.axes import Grid, Samples
from steadyslip.maps.plan.edges import Edge, LogMargin, OnsetKind, SafetyFactor, StableValues
from steadyslip.maps.plan.held import Hunting
from steadyslip.maps.plan.map import Map
from steadyslip.maps.plan.map_file import map_from_text, read_map
from steadyslip.maps.plan.measures import Events, KickThreshold, Measure, measure
from steadyslip.maps.refine import Refined, refine
from steadyslip.maps.sensitivity import Sensitivity, sensitivity
from steadyslip.maps.view.map_result import MapResult, open_map
from steadyslip.maps.work.run import run_map

__all__ = [
    "Edge",
    "Events",
    "Grid",
    "Hunting",
    "KickThreshold",
    "LogMargin",
    "Map",
    "MapResult",
    "Measure",
    "OnsetKind",
    "Refined",
    "SafetyFactor",
    "Samples",
    "Sensitivity",
    "StableValues",
    "map_from_text",
    "measure",
    "open_map",
    "read_map",
    "refine",
    "run_map",
    "sensitivity",
]
