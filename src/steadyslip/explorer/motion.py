"""A rig's motion as JavaScript: its kernel, and what starts it at any values of its parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.explorer.equations import program
from steadyslip.kernels.formulation import Choice
from steadyslip.kernels.kernel import Kernel
from steadyslip.kernels.layout import LOG_COLUMNS, Cursor, Final, Kind, Out, Recorded, Setting
from steadyslip.kernels.printers import javascript
from steadyslip.kernels.printers.transpile import transpiled
from steadyslip.kernels.runner import STATUSES, TALLY
from steadyslip.linear.boundary import present_zeros
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.point import operating_point
from steadyslip.model.reduction import Reduction, W, reduce_model
from steadyslip.model.scales import LEAST_WEIGHT, eliminable, posed, weighed
from steadyslip.motion.jobs import BLOW_UP, CONTACT_SHARE, Options, automatic_method

RTOL = 1e-6
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
    reduction = reduce_model(point.model, eliminate)
    kernel = Kernel(reduction, Choice(automatic_method(reduction, RTOL), "constant", 0, 1, True))
    kernel_text = javascript.machine(kernel.programs, kernel.layout)
    model = point.model
    programs = [
        program(model, "constants", list(kernel.constants.symbols)),
        program(model, "weights", weighed(model)),
        program(model, "start", _start(reduction), BLOW),
        program(model, "dashpot", [-sp.diff(model.definitions[model.contact.spring], model.contact.velocity)]),
    ]
    functions = "".join(javascript.text(one) for one in programs)
    text = f"(() => {{\n{functions}return {{ constants, weights, start, dashpot, ...{kernel_text} }};\n}})()"
    return text, _facts(reduction, kernel, eliminate, set(present_zeros(rig)) - set(kept))


def _start(reduction: Reduction) -> list[sp.Expr]:
    """Variables that jumps leave alone, and behind them the velocity variable: of steady sliding, but for a blow."""
    model = reduction.model
    steady = {item.symbol: sp.sympify(model.steady[item.symbol]) for item in model.memory}
    speed = reduction.w_of_v.xreplace(steady | {model.contact.velocity: BLOW * model.parameters["drive.velocity"]})
    found = steady | {W: speed}
    return [*(found.get(symbol, sp.Integer(0)) for symbol in reduction.continuous), speed]


def _facts(reduction: Reduction, kernel: Kernel, eliminate: int | None, missing: set[str]) -> dict[str, Any]:
    model, options = reduction.model, Options()
    kinds = ["memory" if name in {m.name for m in model.memory} else name for name in reduction.names]
    integrals = {item.name for item in model.integrals}
    return {
        "parameters": list(model.parameters),
        "constants": len(kernel.constants.symbols),
        "all": len(kernel.constants.all),
        "kept": len(reduction.continuous),
        "rows": kernel.layout.rows,
        "memory": [item.name for item in model.memory],
        "names": list(reduction.names),
        "kinds": ["integral" if n in integrals else k for n, k in zip(reduction.names, kinds, strict=True)],
        "eliminated": eliminate,
        "least": LEAST_WEIGHT,
        "inertial": model.inertial,
        "linear": reduction.velocity == "linear",
        "missing": sorted(missing),
        "rtol": RTOL,
        "blowUp": float(BLOW_UP),
        "contactShare": CONTACT_SHARE,
        "arrest": options.arrest,
        "settings": {name.name: int(name) for name in Setting},
        "cursor": {name.name: int(name) for name in Cursor},
        "kind": {name.name: int(name) for name in Kind},
        "out": {name.name: int(name) for name in Out},
        "final": int(Final.POINT),
        "recorded": int(Recorded.POINT),
        "tally": len(TALLY),
        "logged": LOG_COLUMNS,
        "statuses": list(STATUSES),
    }
