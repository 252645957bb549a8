"""Models nested in the model of a fit; the fit must not have a larger sum of squares than any of them.

A parameter may declare a value at which it has no effect (`Parameter.idle`). The model without this parameter is then a
special case of, or nested in, the model with it. If a nested model comes near the best fit, it is fitted too, exactly
as in a separate fit, and the model of the fit starts from its minimum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.machine.slider import Slider

SCALE_FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # an undetermined scale starts at these multiples of a similar scale


@dataclass(frozen=True)
class NestedModel:
    """Nested model, and the further parameters of the richer model in which it is nested.

    Attributes
    ----------
    plan : Plan
        Plan of the nested model.
    idle : dict of str to float
        Further parameters of the richer model, by name, with the values at which they have no effect.
    scales : tuple of str
        Further parameters that have no effect while the `idle` ones have none, such as the slip distance of a state.
    """

    plan: Plan
    idle: dict[str, float]
    scales: tuple[str, ...]

    def missing(self, space: Space) -> tuple[Array, Array]:
        """Mask (p,) of the richer model's coordinates that the nested model lacks, and their idle values (p,)."""
        held, at = np.zeros(len(space), dtype=bool), np.zeros(len(space))
        for i, one in enumerate(space.unknowns):
            held[i] = one.parameter in self.idle or one.parameter in self.scales
            if one.parameter in self.idle:
                at[i] = float(one.coordinate(self.idle[one.parameter]))
        return held, at

    def points_in(self, space: Space, coordinates: Array, low: Array, high: Array) -> Array:
        """Points (m, p) of the richer model for coordinates of the nested model and m values of undetermined scales."""
        known = dict(zip([one.name for one in self.plan.space().unknowns], coordinates, strict=True))
        _, at = self.missing(space)
        own = np.array([known.get(one.name, at[i]) for i, one in enumerate(space.unknowns)])
        found = np.tile(own, (len(SCALE_FACTORS) if self.scales else 1, 1))
        for i, one in enumerate(space.unknowns):
            if one.parameter in self.scales:
                alike = [k for k, other in enumerate(space.unknowns) if other.kind == one.kind and k != i]
                found[:, i] = np.clip(own[alike[0] if alike else i] + np.log(SCALE_FACTORS), low[i], high[i])
        return found


def nested_models(plan: Plan) -> Iterator[NestedModel]:
    """Models that each lack one thing: last trend term, free initial state, offset, last state, or part of the law."""
    if plan.trend:
        yield NestedModel(replace(plan, trend=plan.trend - 1), {f"trend.{plan.trend}": 0.0}, ())
    if plan.initial == "free":
        away = [one.parameter for one in plan.space().unknowns if one.parameter.startswith("initial.")]
        yield NestedModel(replace(plan, initial="steady"), dict.fromkeys(away, 0.0), ())
    if plan.offset:
        yield NestedModel(replace(plan, offset=False), {"offset": 0.0}, ())
    addresses, seen = plan.rig.parameters(), set()
    for name in plan.free:
        role = addresses[name].role if name in addresses else None
        if role is None:
            continue
        owner, _, _ = name.rpartition(".")
        family, _, member = owner.rpartition(".")
        if not member.isdigit():
            if role.idle is not None:
                rig = plan.rig.with_values({name: role.idle})
                within = [key for key in plan.free if "." in owner and key.startswith(f"{owner}.")]
                scales = tuple(key for key in within if addresses[key].role.idle is None)
                yield NestedModel(_without(plan, rig, [name, *scales]), {name: role.idle}, scales)
            continue
        last = int(member) > 1 and not any(key.startswith(f"{family}.{int(member) + 1}.") for key in addresses)
        if not last or owner in seen:
            continue
        seen.add(owner)
        names = [key for key in plan.free if key.startswith(f"{owner}.")]
        idle = {key: value for key in names if (value := addresses[key].role.idle) is not None}
        if idle:
            scales = tuple(key for key in names if key not in idle)
            yield NestedModel(_without(plan, _shorter(plan.rig, family), names), idle, scales)


def _without(plan: Plan, rig: Slider, names: list[str]) -> Plan:
    free, separate = (tuple(key for key in keys if key not in names) for keys in (plan.free, plan.separate))
    return replace(plan, rig=rig, free=free, separate=separate)


def _shorter(rig: Slider, family: str) -> Slider:
    """Rig without the last member of a list, such as ``friction.states``."""
    part, _, field = family.partition(".")
    law = getattr(rig, part)
    return replace(rig, **{part: replace(law, **{field: getattr(law, field)[:-1]})})
