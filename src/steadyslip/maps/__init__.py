"""Maps: any analysis over millions of rigs, on this machine or on a cluster, kept on disk chunk by chunk.

Map (plan, axes, measures) -> Store (Zarr) <- do_chunk (work) <- workers (local, cluster) <- run_map
Store -> MapResult -> files (export), figures, refine. Knows neither figures nor documents.
"""

from __future__ import annotations

from steadyslip.maps.plan.axes import Grid, Samples
from steadyslip.maps.plan.edges import Edge, LogMargin, OnsetKind, SafetyFactor, StableValues
from steadyslip.maps.plan.map import Map
from steadyslip.maps.plan.map_file import map_from_text, read_map
from steadyslip.maps.plan.measures import Events, KickThreshold, Measure, measure
from steadyslip.maps.refine import Refined, refine
from steadyslip.maps.sensitivity import Sensitivity, sensitivity
from steadyslip.maps.view.result import MapResult, open_map
from steadyslip.maps.work.run import run_map

__all__ = [
    "Edge",
    "Events",
    "Grid",
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
