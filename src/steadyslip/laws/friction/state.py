"""One of several states of a rate-and-state law."""

from __future__ import annotations

from steadyslip.core.domains import nonnegative, positive, real
from steadyslip.core.records import FrozenRecord, parameter


class State(FrozenRecord):
    """One of several states of a rate-and-state law."""

    b: float = parameter(
        "1", real, "evolution effect of this state", kind="evolution effect", size=0.01, standing=0.01, idle=0.0
    )
    d_c: float = parameter("m", positive, "slip distance of this state", kind="slip distance", standing=1e-5)
    alpha: float | None = parameter(
        "1", nonnegative, "this state's part of α", default=None, kind="stress share", size=0.2, idle=0.0
    )
    b_cutoff_velocity: float | None = parameter(
        "m/s", positive, "velocity above which this state's effect fades; infinite unless given", default=None,
        letter="v_b",
    )  # fmt: skip
