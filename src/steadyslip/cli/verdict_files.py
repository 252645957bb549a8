"""Files of a verdict: figure or document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from steadyslip.figures import root_locus, stability_chart
from steadyslip.files.html_document import write_page
from steadyslip.files.output import write_by_ending
from steadyslip.machine.slider import Slider
from steadyslip.reports.recommendation import Order
from steadyslip.reports.rig import chart_pairs
from steadyslip.verdict import Analysis, Tolerated


def write_verdict(found: Analysis, within: Tolerated | None, path: Path, source: Path) -> None:
    """Write the verdict on a rig as document (.html) or figure: for machines its panels, for sliders a stability chart.

    The chart is over parameters that can be changed, as in the document.

    Raises
    ------
    NotAvailable
        If the file cannot be written, or nothing can be drawn.
    """
    shown: Any = found if within is None else within

    def drawn() -> Any:
        if found.rig.in_forces:
            return found.plot()
        rig: Slider = found.rig
        adjustable = getattr(within.tolerances, "adjust", {}) if within is not None else {}
        pairs = chart_pairs(found, Order((), adjustable))
        return stability_chart(rig, *pairs[0]) if pairs else root_locus(rig)

    write_by_ending(path, {".html": lambda p: write_page(shown, p, "Verdict", source=source)}, drawn, found)
