"""Thresholds of several kinds of kick of one rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from steadyslip.core.errors import ParameterError
from steadyslip.core.pages import Displayed
from steadyslip.core.progress import progress_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.kicks.basin import Basin, basin
from steadyslip.nonlinear.kicks.kicks import kick_problems
from steadyslip.nonlinear.kicks.threshold import Threshold, threshold


@dataclass(frozen=True)
class Thresholds(Displayed):
    """Thresholds of several kinds of kick of one rig; `interrupted` is True if Ctrl-C ended the search."""

    rig: Slider | Machine
    found: tuple[Threshold, ...]
    interrupted: bool = False

    def __str__(self) -> str:
        return "\n".join(map(str, self.found))

    def to_dict(self) -> list[dict[str, Any]]:
        """JSON-ready list with one dict for each kind of kick, SI units."""
        return [one.to_dict() for one in self.found]

    @cached_property
    def basin(self) -> Basin:
        """Basin of the rig (cached); for a machine in the plane of the body that is kicked."""
        at = next((one.at for one in self.found if one.at), None)
        if at is not None and at in self.rig.contacts:
            at = self.rig.contacts[at].held
        return basin(self.rig, at=at)


def thresholds_shown(rig: Slider | Machine, kicks: Sequence[str], **options: Any) -> Thresholds:
    """`steadyslip.threshold` for several kinds of kick; shows progress on a terminal, and ends with Ctrl-C."""
    problems = [one for kick in dict.fromkeys(kicks) for one in kick_problems(rig, kick, options.get("at"))]
    if problems:
        raise ParameterError(problems)
    found: list[Threshold] = []
    with progress_text("starting") as show:
        for kick in kicks:
            which = f"{kick} kicks ({len(found) + 1} of {len(kicks)})"

            def report(tried: int, low: float, high: float, which: str = which) -> None:
                bracket = f"survived up to size {low:.6g}" + (f", not at {high:.6g}" if math.isfinite(high) else "")
                show(f"{which}: {tried} run, {bracket}; Ctrl-C keeps what there is")

            report(0, 0.0, math.inf)
            try:
                found.append(threshold(rig, kick, **options, progress=report))
            except KeyboardInterrupt:  # before the search for this kick's threshold began; earlier thresholds are kept
                if not found:
                    raise
                return Thresholds(rig, tuple(found), True)
            if found[-1].interrupted:
                break
    return Thresholds(rig, tuple(found), found[-1].interrupted)
