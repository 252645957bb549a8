"""A rig's motion as JavaScript: its kernel, and what starts it at any values of its parameters."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.explorer.programs import program
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.kernel import Kernel
from steadyslip.kernels.layout import LOG_COLUMNS, SETTINGS, Cursor, Final, Kind, Out, Recorded, Setting
from steadyslip.kernels.nodes import Node, Program, Value, as_node, select
from steadyslip.kernels.printers import javascript
from steadyslip.kernels.printers.transpile import transpiled
from steadyslip.kernels.runner import STATUSES, TALLY
from steadyslip.linear.boundary import present_zeros
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.point import operating_point
from steadyslip.model.reducing import reduce_model
from steadyslip.model.reduction import Reduction, W
from steadyslip.model.scales import LEAST_WEIGHT, Weights, eliminable, posed, sizes, weighed
from steadyslip.motion.jobs import Options, automatic_method, numbers
from steadyslip.protocol import (
    DisplacementStep,
    DisturbanceStep,
    Hold,
    NormalStressStep,
    Protocol,
    VelocityStep,
    pack,
)

OPTIONS = Options(rtol=1e-6, most_steps=100_000)
DISTURBANCES: dict[str, Callable[[float, float, float], Any] | None] = {
    "velocity": lambda at, size, drive: VelocityStep(at=at, to=drive * size),
    "hold": lambda at, size, drive: Hold(at=at, duration=size),
    "push": lambda at, size, drive: DisplacementStep(at=at, by=size),
    "normal": lambda at, size, drive: NormalStressStep(at=at, by=size),
    "pull": lambda at, size, drive: DisturbanceStep(at=at, by=size),
    "blow": None,  # that is in the start
}
"""What a page can do to a rig at a time: pieces of a protocol of a size, given the velocity of the drive."""
_TOLD = 3.0, 5.0, 1e3, 7.0  # at, size, until, drive: numbers that can be told apart, sums and products too
BLOW = sp.Symbol("blow", positive=True)
"""Velocity of the block at the start over that of steady sliding."""
DRIVER = {"advance": "steadyslip.kernels.driver.lanes", "observe": "steadyslip.kernels.driver.states"}


def driver() -> str:
    """The driver, the same for every rig."""
    return transpiled(DRIVER)


def motion_part(rig: Slider, branch: int) -> tuple[str, dict[str, Any]]:
    """The kernel of a rig as an expression of JavaScript, and what must be known about it.

    Terms that are zero in the rig can be varied from there unless they would give it inertia, which is another kernel.

    Raises
    ------
    NotAvailable
        If the rig does not slide steadily, its motion is ill-posed, or an equation cannot be printed.
    """
    inertial = build_model(rig).inertial
    kept = [name for name in present_zeros(rig) if inertial or not build_model(rig, [name]).inertial]
    point = operating_point(rig, None, kept, branch)
    if not np.all(point.stresses > 0):
        raise NotAvailable("the rig of the file does not slide steadily")
    if not np.all(posed(point)):
        raise NotAvailable("the motion of the rig is ill-posed")
    eliminate = eliminable(point)
    if isinstance(eliminate, tuple):
        raise InternalError("a slider has one contact")
    reduction = reduce_model(point.model, eliminate)
    kernel = Kernel(reduction, Choice(automatic_method(reduction, OPTIONS.rtol), "constant", 0, 1, True))
    kernel_text = javascript.machine(kernel.programs, kernel.layout)
    model = point.model
    programs = [
        program(model, "constants", list(kernel.constants.symbols)),
        program(model, "scales", _weighed(model), then=partial(_scales, reduction, eliminate)),
        program(model, "start", _start(reduction), [BLOW]),
        program(model, "dashpot", [-sp.diff(model.definitions[model.contact.spring], model.contact.velocity)]),
    ]
    segments = [_segments(name, piece) for name, piece in DISTURBANCES.items()]
    functions = "".join(javascript.text(one) for one in (*programs, *segments))
    own, several = (", ".join(one.name for one in some) for some in (programs, segments))
    text = f"(() => {{\n{functions}return {{ {own}, segments: {{ {several} }}, ...{kernel_text} }};\n}})()"
    facts = _facts(reduction, kernel, eliminate, set(present_zeros(rig)) - set(kept))
    return text, facts | {"segments": max(len(one.stores) for one in segments) // facts["segment"]}


def _start(reduction: Reduction) -> list[sp.Expr]:
    """Variables that jumps leave alone, and behind them the velocity variable: of steady sliding, but for a blow."""
    model = reduction.model
    steady = {item.symbol: sp.sympify(model.steady[item.symbol]) for item in (*model.memory, *model.states)}
    speed = reduction.w_of_v.xreplace(steady | {model.contact.velocity: BLOW * model.parameters["drive.velocity"]})
    found = steady | {W: speed}
    return [*(found.get(symbol, sp.Integer(0)) for symbol in reduction.continuous), speed]


def _weighed(model: Model) -> list[sp.Expr]:
    """Drive and steady normal stress, and behind them what scales are made of."""
    return [model.parameters["drive.velocity"], model.contact.sigma_ss, *weighed(model)]


def _scales(reduction: Reduction, eliminate: int | None, found: list[Node]) -> list[Value]:
    """The scale of slip, whether the motion is posed, the weight of the state left out, then settings."""
    drive, stress, *derivatives = found
    weights = Weights.of(derivatives)
    scales, unknown = sizes(weights, drive, reduction, select)
    share = 1.0 if eliminate is None else abs(weights.by_memory[eliminate] / weights.direct)
    given = {"watch": 1.0, "record": 1.0, "guess": 0.0}
    own = given | numbers(drive, stress, scales["x"], unknown, OPTIONS)
    rows = [own[name] for name in SETTINGS] + [OPTIONS.rtol * scales[name] for name in reduction.names]
    return [scales["x"], select(weights.by_unknown > 0, 1.0, 0.0), share, *rows]


def _segments(name: str, piece: Callable[[float, float, float], Any] | None) -> Program:
    """The segments of a disturbance as a program of when, how large, until when and the drive velocity.

    The protocol cuts them with numbers that tell where each comes from. All of it is inside the run: what is not, the
    page leaves out.
    """
    made, (at, size, until, drive) = Program(name), _TOLD
    pieces = () if piece is None else piece(at, size, drive)
    rows = pack(Protocol.of(pieces), drive, until).rows(0, 1)[0]
    known = [made.load(i) for i in range(4)]
    values = {0.0: as_node(0.0), **dict(zip(_TOLD, known, strict=True))}
    values |= {at + size: known[0] + known[1], drive * size: known[3] * known[1]}
    for place, value in enumerate(rows.ravel()):
        made.store(place, values[float(value)], "y")
    return made


def _facts(reduction: Reduction, kernel: Kernel, eliminate: int | None, missing: set[str]) -> dict[str, Any]:
    model = reduction.model
    return {
        "parameters": list(model.parameters),
        "constants": len(kernel.constants.symbols),
        "all": len(kernel.constants.all),
        "kept": len(reduction.continuous),
        "rows": kernel.layout.rows,
        "size": len(reduction.names),
        "eliminated": eliminate,
        "least": LEAST_WEIGHT,
        "inertial": model.inertial,
        "missing": sorted(missing),
        "settings": len(SETTINGS) + len(reduction.names),
        "guess": int(Setting.GUESS),
        "cursor": {name.name: int(name) for name in Cursor},
        "kind": {name.name: int(name) for name in Kind},
        "out": {name.name: int(name) for name in Out},
        "final": int(Final.POINT),
        "recorded": int(Recorded.POINT),
        "segment": pack(Protocol.of(()), 1.0, 1.0).rows(0, 1).shape[-1],
        "tally": len(TALLY),
        "logged": LOG_COLUMNS,
        "statuses": list(STATUSES),
    }
