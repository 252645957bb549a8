"""Simpler models inside a richer one: a fit of the richer must not end above what they reach.

A parameter whose record says at which value it does nothing (`Parameter.idle`) makes the model without it part of the
model with it. Where such a model is anywhere near as good it is fitted too, exactly as anyone would fit it alone, and
where it ends the richer one starts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.machine.slider import Slider

SPREAD = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # multiples of its other scales from which a member that was idle starts


@dataclass(frozen=True)
class Simpler:
    """A simpler model, and what the richer one has besides.

    Attributes
    ----------
    plan : Plan
    idle : dict of str to float
        Values at which further parameters do nothing, by name.
    scales : tuple of str
        Further parameters that say nothing while the others are idle, such as the slip distance of a state.
    """

    plan: Plan
    idle: dict[str, float]
    scales: tuple[str, ...]

    def held(self, space: Space) -> tuple[Array, Array]:
        """Which coordinates of the richer model (p,) the simpler one does not have, and where those do nothing."""
        held, at = np.zeros(len(space), dtype=bool), np.zeros(len(space))
        for i, one in enumerate(space.unknowns):
            held[i] = one.parameter in self.idle or one.parameter in self.scales
            if one.parameter in self.idle:
                at[i] = float(one.coordinate(self.idle[one.parameter]))
        return held, at

    def within(self, space: Space, coordinates: Array, low: Array, high: Array) -> Array:
        """Where coordinates of the simpler model lie in the richer one, (m, p): several places for open scales."""
        known = dict(zip([one.name for one in self.plan.space().unknowns], coordinates, strict=True))
        _, at = self.held(space)
        own = np.array([known.get(one.name, at[i]) for i, one in enumerate(space.unknowns)])
        found = np.tile(own, (len(SPREAD) if self.scales else 1, 1))
        for i, one in enumerate(space.unknowns):
            if one.parameter in self.scales:
                alike = [k for k, other in enumerate(space.unknowns) if other.kind == one.kind and k != i]
                found[:, i] = np.clip(own[alike[0] if alike else i] + np.log(SPREAD), low[i], high[i])
        return found


def simpler(plan: Plan) -> Iterator[Simpler]:
    """The models that lack the last order of a trend, its own beginning, the last of a list, or a part of a law."""
    if plan.trend:
        yield Simpler(replace(plan, trend=plan.trend - 1), {f"trend.{plan.trend}": 0.0}, ())
    if plan.initial == "free":
        away = [one.parameter for one in plan.space().unknowns if one.parameter.startswith("initial.")]
        yield Simpler(replace(plan, initial="steady"), dict.fromkeys(away, 0.0), ())
    if plan.offset:
        yield Simpler(replace(plan, offset=False), {"offset": 0.0}, ())
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
                yield Simpler(_without(plan, rig, [name, *scales]), {name: role.idle}, scales)
            continue
        last = int(member) > 1 and not any(key.startswith(f"{family}.{int(member) + 1}.") for key in addresses)
        if not last or owner in seen:
            continue
        seen.add(owner)
        names = [key for key in plan.free if key.startswith(f"{owner}.")]
        idle = {key: value for key in names if (value := addresses[key].role.idle) is not None}
        if idle:
            scales = tuple(key for key in names if key not in idle)
            yield Simpler(_without(plan, _shorter(plan.rig, family), names), idle, scales)


def _without(plan: Plan, rig: Slider, names: list[str]) -> Plan:
    free, separate = (tuple(key for key in keys if key not in names) for keys in (plan.free, plan.separate))
    return replace(plan, rig=rig, free=free, separate=separate)


def _shorter(rig: Slider, family: str) -> Slider:
    """The rig without the last member of a list, such as ``friction.states``."""
    part, _, field = family.partition(".")
    law = getattr(rig, part)
    return replace(rig, **{part: replace(law, **{field: getattr(law, field)[:-1]})})
