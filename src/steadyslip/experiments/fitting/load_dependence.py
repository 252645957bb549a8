"""What a table with several loads tells of how friction follows them, and how a rig is given that, in words."""

from __future__ import annotations

import numpy as np

from steadyslip.core.format import enumerated, format_quantity
from steadyslip.experiments.fitting.speed_fit import SAME, DirectionFit, SpeedFindings
from steadyslip.experiments.fitting.steady_curve import DAMPING, OFFSET

LISTED = 4  # loads that are told one by one
HARDLY = 10.0  # times the largest load that presses beside it, from which friction is told not to follow the load
NONE = 1e-6  # share of the load, or of friction, below which what is fitted beside it is told as none


def loads_of(found: SpeedFindings, one: DirectionFit) -> list[float]:
    """Different loads of the rows of one direction, rising: N, or N m where they are torques."""
    table = found.table
    if table.load is None or table.is_coefficient:
        return []
    own = np.sort(table.load[(table.speed > 0) == one.forward])
    return [float(load) for load in own[np.concatenate([[True], np.diff(own) > SAME * own.max()])]]


def pressed_beside(one: DirectionFit) -> float:
    """Load (N or N m) that presses beside that of the table; 0 where it is none."""
    return 0.0 if abs(one.beside(OFFSET)) < NONE * one.load else one.beside(OFFSET)


def dragged_beside(one: DirectionFit) -> float:
    """Viscous drag (N s/m or N m s/rad) that does not follow the load; 0 where it is none."""
    return 0.0 if one.beside(DAMPING) * one.speed.max() < NONE * one.friction.max() else one.beside(DAMPING)


def told(found: SpeedFindings, load: float) -> str:
    """A load with its unit."""
    return format_quantity(load, "N m" if found.table.load_turns else "N")


def loads_told(found: SpeedFindings, one: DirectionFit) -> str:
    """The loads of one direction: ``5 N m and 35 N m``, or how many there are and their ends."""
    loads = loads_of(found, one)
    if len(loads) <= LISTED:
        return enumerated([told(found, load) for load in loads])
    return f"{len(loads)} from {told(found, loads[0])} to {told(found, loads[-1])}"


def dependence(found: SpeedFindings, one: DirectionFit) -> str | None:
    """Line on how friction follows the load in one direction; None with fewer than two loads."""
    loads = loads_of(found, one)
    if len(loads) < 2:
        return None
    offset = pressed_beside(one)
    rises = 100 * ((loads[-1] + offset) / (loads[0] + offset) - 1)
    if offset > HARDLY * loads[-1]:
        return f"  loads {loads_told(found, one)}: friction hardly follows them, and rises by {rises:.2g} %"
    text = f"  loads {loads_told(found, one)}: friction is in proportion to the load"
    if (beside := {estimate.name: estimate for estimate in one.estimates}.get(OFFSET)) is not None:
        text += f" + {OFFSET}"
        if beside.low <= 0 <= beside.high:
            text += ", which may be 0"
    return f"{text}, and rises by {rises:.3g} % between them"


def how_to_give_it(found: SpeedFindings, lever: float) -> list[str]:
    """Comments of the rig file beneath its constant load, N: what another load is, and one that a link carries."""
    one, loads = found.main, loads_of(found, found.main)
    if len(loads) < 2:
        return []
    offset = pressed_beside(one)
    if offset > HARDLY * loads[-1]:
        return [f"# The table has the loads {loads_told(found, one)}, which friction hardly follows."]
    beside = f" + {told(found, offset)}" if offset else ""
    over = "" if lever == 1 else f", over the radius: {lever:.6g} N for 1 N m"
    lines = [f"# The table has the loads {loads_told(found, one)}; friction is in proportion to load{beside}.",
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
    """Sentence on the load of the rig file (N) and the others of the table; None with fewer than two loads."""
    loads = loads_of(found, found.main)
    if len(loads) < 2 or pressed_beside(found.main) > HARDLY * loads[-1]:
        return None
    return (
        f"The rig file has one constant load, {told(found, load)}, the middle of the table's; its comments tell how "
        "another is written, and one that changes with what a gear or screw carries (law transmitted)."
    )
