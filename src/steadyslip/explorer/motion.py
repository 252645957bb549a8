"""JavaScript for the motion of a rig: its kernel, and programs that initialise it for any parameter values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.records import with_values
from steadyslip.explorer.motion_start import Shares, scales_program, start_program
from steadyslip.explorer.programs import program
from steadyslip.kernels.driver.places import guess_count
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.kernel import Kernel
from steadyslip.kernels.layout import (
    EVENT_SHARE,
    LOG_COLUMNS,
    NUMBER,
    SETTINGS,
    Cursor,
    Final,
    Kind,
    Out,
    Recorded,
    Setting,
)
from steadyslip.kernels.nodes import Program, as_node
from steadyslip.kernels.printers import javascript
from steadyslip.kernels.printers.transpile import transpiled
from steadyslip.kernels.runner import LOG_KINDS, STATUSES, TALLY
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.point import operating_point
from steadyslip.model.posed import well_posed
from steadyslip.model.reducing import EVERYWHERE, reduce_model
from steadyslip.model.reduction import Reduction
from steadyslip.model.weights import LEAST_WEIGHT, eliminable
from steadyslip.motion.jobs import Options, automatic_method
from steadyslip.motion.status import NEEDS_MASS, THROUGH_DASHPOT
from steadyslip.protocol import DisplacementStep, DisturbanceStep, Hold, NormalStressStep, Protocol, VelocityStep
from steadyslip.protocol.segments import pack

OPTIONS = Options(rtol=1e-6, most_steps=100_000)  # errors below a pixel, steps for some seconds of computing
DISTURBANCES: dict[str, Callable[[float, float, float], Any] | None] = {
    "velocity": lambda at, size, drive: VelocityStep(at=at, to=drive * size),
    "hold": lambda at, size, drive: Hold(at=at, duration=size),
    "push": lambda at, size, drive: DisplacementStep(at=at, by=size),
    "normal": lambda at, size, drive: NormalStressStep(at=at, by=size),
    "pull": lambda at, size, drive: DisturbanceStep(at=at, by=size),
    "blow": None,  # a blow changes the starting velocity, not the protocol
}
"""Disturbances on a page: function that returns a protocol piece from time (s), size (SI) and drive velocity (m/s)."""
# time, size, end and drive velocity; their sums and products all differ, so that each can be identified in segments
_MARKERS = 3.0, 5.0, 1e3, 7.0
DRIVER = {"advance": "steadyslip.kernels.driver.lanes", "observe": "steadyslip.kernels.driver.states"}


def driver() -> str:
    """JavaScript text of the kernel driver, which does not depend on the rig."""
    return transpiled(DRIVER)


def motion_part(rig: Slider | Machine, branch: int) -> tuple[str, dict[str, Any]]:
    """JavaScript expression with the kernel of a rig and its initialisation programs, and data about it.

    A slider's zero parameters can be varied on the page, except mass, which would need another kernel.

    Raises
    ------
    NotAvailable
        If no steady sliding exists, motion is ill-posed, or an equation has no JavaScript equivalent.
    """
    inertial = build_model(rig).inertial
    kept = [name for name in rig.kept_zeros() if inertial or not build_model(rig, [name]).inertial]
    point = operating_point(rig, None, kept, branch)
    what = rig.words["rig"]
    if not np.all(point.exists):
        raise NotAvailable(f"the {what} of the file does not slide steadily")
    if not np.all(well_posed(point)):
        raise NotAvailable(f"the motion of the {what} is ill-posed")
    eliminate = eliminable(point)
    named = bool(rig.contact_names)
    reduction = reduce_model(point.model, eliminate, *(((EVERYWHERE,), (EVERYWHERE,)) if named else ()))
    kernel = Kernel(reduction, Choice(automatic_method(reduction, OPTIONS.rtol), "constant", 0, 1, True))
    kernel_text = javascript.machine(kernel.programs, kernel.layout)
    model, shares = point.model, Shares.of(rig, point.model)
    programs = [
        program(model, "constants", list(kernel.constants.symbols), shares.symbols),
        scales_program(reduction, eliminate, OPTIONS),
        start_program(reduction, shares),
        program(model, "dashpot", [_load_point_damping(rig, model)]),
    ]
    segments = [_segment_program(name, piece) for name, piece in DISTURBANCES.items()]
    functions = "".join(javascript.text(one) for one in (*programs, *segments))
    own, several = (", ".join(one.name for one in some) for some in (programs, segments))
    text = f"(() => {{\n{functions}return {{ {own}, segments: {{ {several} }}, ...{kernel_text} }};\n}})()"
    facts = _facts(reduction, kernel, set(rig.kept_zeros()) - set(kept))
    facts |= {"shares": shares.places(), "behind": len(shares.symbols)}
    facts["refused"] = {"push": f"a push of the load point {THROUGH_DASHPOT}", "blow": f"a blow {NEEDS_MASS}"}
    return text, facts | {"segments": max(len(one.stores) for one in segments) // facts["segment"]}


def _load_point_damping(rig: Slider | Machine, model: Model) -> Any:
    """Total damping between load point and rig, 0 if none; with damping the load point cannot jump."""
    elements = with_values(rig, dict(model.parameters)).mechanism().elements
    return sp.Add(*(abs(sp.sympify(one.damping)) for one in elements if LOAD_POINT in one.senses))


def _segment_program(name: str, piece: Callable[[float, float, float], Any] | None) -> Program:
    """Program of the protocol segments of a disturbance, from time, size, end of the run and drive velocity.

    The protocol is cut into segments for the values `_MARKERS`; each number in the segments then identifies the input
    it comes from. The disturbance is assumed to lie within the run; the page cuts off the rest.
    """
    made, (at, size, until, drive) = Program(name), _MARKERS
    pieces = () if piece is None else piece(at, size, drive)
    rows = pack(Protocol.of(pieces), drive, until).rows(0, 1)[0]
    known = [made.load(i) for i in range(4)]
    values = {0.0: as_node(0.0), **dict(zip(_MARKERS, known, strict=True))}
    values |= {at + size: known[0] + known[1], drive * size: known[3] * known[1]}
    for place, value in enumerate(rows.ravel()):
        made.store(place, values[float(value)], "y")
    return made


def _facts(reduction: Reduction, kernel: Kernel, missing: set[str]) -> dict[str, Any]:
    """Data that `web/motion.js` needs to run a kernel: names, sizes and indices of arrays."""
    model, layout = reduction.model, kernel.layout
    further, begin = guess_count(layout) - 1, Setting.ATOL + layout.size
    guesses = [int(Setting.GUESS), *range(begin, begin + further)]
    return {
        "parameters": list(model.parameters),
        "contacts": [contact.name for contact in model.contacts],
        "bodies": _bodies(reduction) if model.contacts[0].name else [],
        "kinds": len(LOG_KINDS) - 2,
        "share": EVENT_SHARE,
        "constants": len(kernel.constants.symbols),
        "all": len(kernel.constants.all),
        "kept": len(reduction.continuous),
        "further": len(reduction.further),
        "rows": layout.rows,
        "point": layout.size + guess_count(layout),
        "least": LEAST_WEIGHT,
        "inertial": model.inertial,
        "missing": sorted(missing),
        "settings": len(SETTINGS) + len(reduction.names) + 2 * further,
        "guesses": guesses[: len(reduction.searched)],
        "cursor": {name.name: int(name) for name in Cursor},
        "kind": {name.name: int(name) for name in Kind},
        "out": {name.name: int(name) for name in Out},
        "final": int(Final.POINT),
        "recorded": int(Recorded.POINT),
        "segment": pack(Protocol.of(()), 1.0, 1.0).rows(0, 1).shape[-1],
        "tally": len(TALLY),
        "logged": LOG_COLUMNS,
        "number": NUMBER,
        "statuses": list(STATUSES),
    }


def _bodies(reduction: Reduction) -> list[list[Any]]:
    """For every coordinate: name, unit of displacement, and indices of displacement and velocity in the outputs."""
    first = Out.W_SLOPE * len(reduction.slidings)
    places = {name: first + len(reduction.continuous) + i for i, name in enumerate(reduction.further)}
    kept = {symbol: first + i for i, symbol in enumerate(reduction.continuous)}
    return [
        [one.name, one.unit, kept.get(one.displacement, places.get(f"{one.name}.x", -1)), places[f"{one.name}.v"]]
        for one in reduction.model.coordinates
    ]
