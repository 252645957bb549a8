"""Maps: any analysis over millions of rigs, on this machine or on a cluster, kept on disk chunk by chunk.

Map (plan, axes, measures) -> Store (Zarr) <- do_chunk (work) <- workers (local, cluster) <- run_map
Store -> MapResult -> files (export), figures, refine
"""

from __future__ import annotations

from steadyslip.sweep.axes import Grid, Samples
from steadyslip.sweep.measures import Events, KickThreshold, Measure, measure
from steadyslip.sweep.plan import Map
from steadyslip.sweep.refine import Refined, refine
from steadyslip.sweep.result import MapResult, open_map
from steadyslip.sweep.run import run_map
from steadyslip.sweep.sensitivity import Sensitivity, sensitivity
from steadyslip.sweep.spec import map_from_text, read_map

__all__ = [
    "Events",
    "Grid",
    "KickThreshold",
    "Map",
    "MapResult",
    "Measure",
    "Refined",
    "Samples",
    "Sensitivity",
    "map_from_text",
    "measure",
    "open_map",
    "read_map",
    "refine",
    "run_map",
    "sensitivity",
]
