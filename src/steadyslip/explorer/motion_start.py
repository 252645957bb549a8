"""Programs that initialise a motion on a page: scales and settings, starting values, shares of disturbances.

They read the array R: parameters, steady normal stresses, then the symbols of `Shares`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import sympy as sp

from steadyslip.core.symbols import inner_symbol
from steadyslip.explorer.programs import program
from steadyslip.explorer.sliding import characteristic_polynomial
from steadyslip.kernels.layout import SETTINGS
from steadyslip.kernels.nodes import Node, Program, Value, as_node, select
from steadyslip.linear import crossing
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import NORMAL
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Contact, Coordinate, Model
from steadyslip.model.posed import balance_jacobian
from steadyslip.model.reducing import share_of
from steadyslip.model.reduction import Reduction
from steadyslip.model.scales import (
    contact_scales,
    direct_effect_scale,
    machine_scales,
    scale_expressions,
    shortest_time,
)
from steadyslip.model.weights import Weights, weight_expressions
from steadyslip.motion.jobs import Options, numbers


@dataclass(frozen=True)
class Shares:
    """Symbols: shares of a disturbance on coordinates and contacts, and factors of a blow on velocities.

    For sliders `pushed` and `pressed` are empty (disturbances act on the block), and `blown` has the key "".
    """

    pushed: dict[str, sp.Symbol]
    pressed: dict[str, sp.Symbol]
    blown: dict[str, sp.Symbol]

    @classmethod
    def of(cls, rig: Slider | Machine, model: Model) -> Shares:
        if not isinstance(rig, Machine):
            return cls({}, {}, {"": _blow_factor(model.coordinates[0])} if model.inertial else {})
        own = [one for one in model.coordinates if one.name in rig.bodies]
        return cls(
            {one.name: share_of(one.push) for one in model.coordinates},
            {contact.name: share_of(contact.press) for contact in model.contacts},
            {one.name: _blow_factor(one) for one in own if one.inertial and one.speed != 0},
        )

    @property
    def symbols(self) -> list[sp.Symbol]:
        """All symbols, in their order in the array R."""
        return [*self.pushed.values(), *self.pressed.values(), *self.blown.values()]

    def places(self) -> dict[str, dict[str, int]]:
        """Index of each share, counted in R from after the normal stresses, by kind of disturbance and by name."""
        order = {symbol: place for place, symbol in enumerate(self.symbols)}
        along = {name: symbol for name, symbol in self.pushed.items() if not name.endswith(NORMAL)}
        named = {"pull": along, "normal": self.pressed, "blow": self.blown}
        return {kind: {name: order[symbol] for name, symbol in own.items()} for kind, own in named.items()}


def _blow_factor(coordinate: Coordinate) -> sp.Symbol:
    """Symbol for the ratio of a coordinate's starting velocity to its velocity in steady sliding."""
    return inner_symbol(f"blow_on_{coordinate.velocity.name}", positive=True)


# -- starting values


def start_program(reduction: Reduction, shares: Shares) -> Program:
    """Program of the starting values: variables continuous at jumps, then initial guesses of the unknowns.

    Values are those of steady sliding, with velocities multiplied by the factors of a blow.
    """
    model = reduction.model
    memory = {item.symbol: sp.sympify(model.steady[item.symbol]) for item in (*model.memory, *model.states)}
    speeds = {one.velocity: one.speed * _blow_on(one, model, shares) for one in model.coordinates}
    found = {**memory, **speeds}
    for contact, sliding in zip(model.contacts, reduction.slidings, strict=True):
        if sliding.variable is not None:
            slip = _slip_rate(contact, model, speeds)
            found[sliding.variable.w] = sliding.variable.w_of_v.xreplace(memory | {contact.velocity: slip})
    starts = [found.get(symbol, sp.Integer(0)) for symbol in reduction.continuous]
    guesses = [found.get(symbol, model.steady.get(symbol, sp.Integer(0))) for symbol in reduction.searched]
    return program(model, "start", [*starts, *guesses], shares.symbols)


def _blow_on(coordinate: Coordinate, model: Model, shares: Shares) -> sp.Expr:
    name = coordinate.name if model.contacts[0].name else ""
    return shares.blown.get(name, sp.Integer(1))


def _slip_rate(contact: Contact, model: Model, speeds: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Slip rate of a contact for given coordinate velocities, with the load point as in steady sliding."""
    load = model.inputs["load_velocity"]
    slip = sp.sympify(model.definitions.get(contact.velocity, contact.velocity))
    return slip.xreplace({load: model.steady[load], **speeds})


# -- scales


def scales_program(reduction: Reduction, eliminate: int | tuple[int | None, ...] | None, options: Options) -> Program:
    """Program of the scales of a motion and the settings of the driver.

    It stores the displacement scale of the load point (m), 1 if the motion is well-posed (else 0), the least weight of
    an eliminated state; then slip rate and area of every contact; then the settings.
    """
    model = reduction.model
    wanted: list[Any] = [model.parameters["drive.velocity"]]
    wanted += [model.steady[contact.velocity] for contact in model.contacts]
    wanted += [contact.sigma_ss for contact in model.contacts]
    wanted += [contact.area for contact in model.contacts]
    several = [weight_expressions(model, index) for index in range(len(model.contacts))]
    wanted += [sp.sympify(e).xreplace({sp.zoo: sp.nan}) for own in several for e in own]  # a division by zero gives NaN
    if model.contacts[0].name:
        wanted += scale_expressions(model)
    if not model.is_single:
        wanted += [e for row in balance_jacobian(model) for e in row]
    each = eliminate if isinstance(eliminate, tuple) else (eliminate,)
    return program(
        model, "scales", wanted, then=partial(_scale_values, reduction, each, options, list(map(len, several)))
    )


def _scale_values(
    reduction: Reduction, eliminate: tuple[int | None, ...], options: Options, counts: list[int], found: list[Node]
) -> Sequence[Value]:
    model, many = reduction.model, len(reduction.model.contacts)
    drive, *rest = found
    speeds, stresses, areas = (rest[start : start + many] for start in (0, many, 2 * many))
    rest = rest[3 * many :]
    weights = []
    for count in counts:
        weights.append(Weights.of(rest[:count]))
        rest = rest[count:]
    own = [
        contact_scales(one, speed, reduction, select, i)
        for i, (one, speed) in enumerate(zip(weights, speeds, strict=True))
    ]
    natural_slip: Any
    if model.contacts[0].name:
        count = len(scale_expressions(model))
        directs = [direct_effect_scale(one, select) for one in weights]
        scales, searched = machine_scales(reduction, rest[:count], speeds, stresses, directs, own, select)
        natural_slip, searched, rest = speeds[0] * shortest_time(scales, select), searched or (1.0,), rest[count:]
    else:
        scales, unknown = own[0]
        natural_slip, searched = scales["x"], (unknown,)
    posed = weights[0].by_unknown > 0 if model.is_single else _all_eigenvalues_positive(rest)
    shares: Any = 1.0
    for one, which in zip(weights, eliminate, strict=True):
        if which is not None:
            share = abs(one.by_memory[which] / one.direct)
            shares = select(share < shares, share, shares)
    given = {"watch": 1.0, "record": 1.0, "guess": 0.0}
    settings = given | numbers(speeds[0], stresses[0], natural_slip, searched[0], options)
    rows = [settings[name] for name in SETTINGS] + [options.rtol * scales[name] for name in reduction.names]
    rows += [0.0] * (len(searched) - 1) + list(searched[1:])
    per_contact = [value for pair in zip(speeds, areas, strict=True) for value in pair]
    return [natural_slip * drive / speeds[0], select(posed, 1.0, 0.0), shares, *per_contact, *rows]


def _all_eigenvalues_positive(entries: list[Node]) -> Any:
    """Node that is true if all eigenvalues of a square matrix, given row by row, have positive real parts."""
    size = round(len(entries) ** 0.5)
    less: list[list[Value | None]] = [
        [None if _is_zero(e) else -e for e in entries[size * i : size * (i + 1)]] for i in range(size)
    ]
    c = list(map(as_node, characteristic_polynomial(less)))
    return crossing.is_hurwitz(c, select, spare=0) if size else as_node(True)


def _is_zero(node: Node) -> bool:
    return node.op == "number" and node.args[0] == 0
