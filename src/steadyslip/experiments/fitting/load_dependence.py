"""Text on how friction depends on the load in a table with several loads, and how a rig file describes this."""

from __future__ import annotations

import numpy as np

from steadyslip.core.format import enumerated, format_quantity
from steadyslip.experiments.fitting.speed_fit import SAME, DirectionFit, SpeedFindings
from steadyslip.experiments.fitting.steady_curve import DAMPING, OFFSET

LISTED = 4  # largest number of loads that are listed one by one
HARDLY = 10.0  # friction hardly depends on the load if the internal preload exceeds this multiple of the largest load
NONE = 1e-6  # an internal preload below this share of the load, or a drag below this share of friction, counts as zero


def loads_of(found: SpeedFindings, one: DirectionFit) -> list[float]:
    """Distinct loads, in rising order, of the rows of one direction, N (N m for torques)."""
    table = found.table
    if table.load is None or table.is_coefficient:
        return []
    own = np.sort(table.load[(table.speed > 0) == one.forward])
    return [float(load) for load in own[np.concatenate([[True], np.diff(own) > SAME * own.max()])]]


def internal_preload(one: DirectionFit) -> float:
    """Internal preload (N or N m), a constant load in addition to the load of the table; 0 if there is none."""
    return 0.0 if abs(one.further(OFFSET)) < NONE * one.load else one.further(OFFSET)


def load_free_drag(one: DirectionFit) -> float:
    """Viscous drag (N s/m or N m s/rad) that does not depend on the load; 0 if there is none."""
    return 0.0 if one.further(DAMPING) * one.speed.max() < NONE * one.friction.max() else one.further(DAMPING)


def load_text(found: SpeedFindings, load: float) -> str:
    """Load with its unit, as text."""
    return format_quantity(load, "N m" if found.table.load_turns else "N")


def loads_text(found: SpeedFindings, one: DirectionFit) -> str:
    """Loads of one direction as text: ``5 N m and 35 N m``, or their number and range."""
    loads = loads_of(found, one)
    if len(loads) <= LISTED:
        return enumerated([load_text(found, load) for load in loads])
    return f"{len(loads)} from {load_text(found, loads[0])} to {load_text(found, loads[-1])}"


def dependence(found: SpeedFindings, one: DirectionFit) -> str | None:
    """Line of text on how friction depends on the load in one direction; None with fewer than two loads."""
    loads = loads_of(found, one)
    if len(loads) < 2:
        return None
    offset = internal_preload(one)
    rises = 100 * ((loads[-1] + offset) / (loads[0] + offset) - 1)
    if offset > HARDLY * loads[-1]:
        return f"  loads {loads_text(found, one)}: friction hardly follows them, and rises by {rises:.2g} %"
    text = f"  loads {loads_text(found, one)}: friction is in proportion to the load"
    if (beside := {estimate.name: estimate for estimate in one.estimates}.get(OFFSET)) is not None:
        text += f" + {OFFSET}"
        if beside.low <= 0 <= beside.high:
            text += ", which may be 0"
    return f"{text}, and rises by {rises:.3g} % between them"


def load_comments(found: SpeedFindings, lever: float) -> list[str]:
    """Comments of the rig file below its constant load: how to write another load, or a load that a link carries.

    `lever` is the load of the rig (N) over the load of the table.
    """
    one, loads = found.main, loads_of(found, found.main)
    if len(loads) < 2:
        return []
    offset = internal_preload(one)
    if offset > HARDLY * loads[-1]:
        return [f"# The table has the loads {loads_text(found, one)}, which friction hardly follows."]
    beside = f" + {load_text(found, offset)}" if offset else ""
    over = "" if lever == 1 else f", over the radius: {lever:.6g} N for 1 N m"
    lines = [f"# The table has the loads {loads_text(found, one)}; friction is in proportion to load{beside}.",
             f"# For another load write load{beside} as the preload{over}."]  # fmt: skip
    if found.table.load_turns and offset >= 0:
        lines += [
            "# For a load that a gear carries, put the contact on the body before the gear, loaded_by = its name, and",
            f'# law = "transmitted", preload = "{lever * offset:.6g} N", transmitted = 1',
        ]
    elif offset >= 0:
        lines += [
            "# For one that is a share of what a screw or gear carries, with loaded_by = its name in [contacts.NAME]:",
            f'# law = "transmitted", preload = "{offset:.6g} N", transmitted = that share',
        ]
    return lines


def summary(found: SpeedFindings, load: float) -> str | None:
    """Sentence on the load of the rig file (N) and the other loads of the table; None with fewer than two loads."""
    loads = loads_of(found, found.main)
    if len(loads) < 2 or internal_preload(found.main) > HARDLY * loads[-1]:
        return None
    return (
        f"The rig file has one constant load, {load_text(found, load)}, the median of the table; its comments say how "
        "to write another load, and a load that changes with what a gear or screw carries (law transmitted)."
    )
