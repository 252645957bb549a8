"""A Mechanism in symbols: forces on its coordinates, and the stresses at its contacts, which follow from the statics.

A block with one contact takes its friction from the balance of forces, τ = T − ηv − m v̇ + q, and its friction law fixes
the acceleration or velocity. Everywhere else friction has a symbol that its law fixes, and each coordinate a balance of
its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.core.symbols import Letters, inner_symbol
from steadyslip.laws.contact import Motion
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, Element, Mechanism
from steadyslip.model.equations import EITHER, MOVED, V_LP, LettingGo, P, Q
from steadyslip.model.statics import Press, Statics, row_of, statics

INTEGRAL = inner_symbol("I_x", real=True)


@dataclass(frozen=True, eq=False)
class SymbolicContact:
    """A contact on its way into the Model: its symbols, and what the laws say in them."""

    port: ContactPort
    slip: sp.Expr
    velocity: sp.Symbol
    acceleration: sp.Expr
    speed: sp.Expr
    spring: sp.Symbol
    tau: sp.Symbol
    sigma: sp.Symbol
    sigma_ss: sp.Symbol
    memory: tuple[sp.Symbol, ...]
    states: tuple[sp.Symbol, ...]
    press: sp.Symbol
    outside: sp.Symbol

    @cached_property
    def tau_ss(self) -> sp.Expr:
        """Friction in steady sliding."""
        return sp.sympify(self.port.friction.steady_strength(self.speed, self.sigma_ss))


class Forces:
    """Symbols of a mechanism, and what its contacts and links do in them."""

    def __init__(self, mechanism: Mechanism, letters: Letters, drive: str) -> None:
        self.mechanism, self.letters, self.imposed, self.by_turns = mechanism, letters, drive != MOVED, drive == EITHER
        self.loading = self._of_the_drive("loading") if self.imposed else sp.Integer(0)
        if self.by_turns:
            self.free, self.held = map(self._of_the_drive, ("free", "held"))
        if self.imposed:
            self._check_loading()
        names = [one.name for one in mechanism.coordinates]
        self.single = len(names) == 1 and [dict(port.slip) for port in mechanism.contacts] == [{names[0]: 1}]
        self.bare = not all(port.name for port in mechanism.contacts)

        def symbols(of: str, alone: str) -> dict[str, sp.Symbol]:
            if self.single:
                return {names[0]: inner_symbol(alone, real=True)}
            return {n: letters.symbol(f"{alone}_{i:03d}", f"{n}.{of}", real=True) for i, n in enumerate(names)}

        self.x, self.v, self.a = symbols("x", "x"), symbols("v", "v"), symbols("a", "a_x")
        self.push = {names[0]: Q} if self.single else symbols("q", "q")
        self.moving = self.v | {LOAD_POINT: V_LP}
        self.speeds = {c.name: sp.sympify(c.speed) for c in mechanism.coordinates} | {LOAD_POINT: mechanism.velocity}
        self.places = [self._place(i, port) for i, port in enumerate(mechanism.contacts)]
        self.definitions: dict[sp.Symbol, sp.Expr] = {}
        self.late: dict[sp.Symbol, tuple[sp.Symbol, sp.Expr]] = {}
        self._define()

    def _check_loading(self) -> None:
        """One link, or a controller, must carry the force of the drive."""
        acting = [dict(one.acts) for one in self.driven]
        if not acting or any(acts != acting[0] for acts in acting):
            names = ", ".join(dict.fromkeys(one.name or "the controller" for one in self.driven))
            raise NotAvailable(
                f"a drive that pulls with a force of its own needs one link that carries it; {names or 'none'} "
                "would share it, and how is open"
            )
        if any(LOAD_POINT in port.slip for port in self.mechanism.contacts):
            raise NotAvailable(
                "a drive that pulls with a force of its own is not offered where a contact slides on the drive"
            )

    # -- contacts in symbols

    def _of_the_drive(self, what: str) -> sp.Symbol:
        return self.letters.symbol(f"drive_{what}", f"drive.{what}", real=True)

    def _place(self, index: int, port: ContactPort) -> SymbolicContact:
        def symbol(name: str, **assumptions: Any) -> sp.Symbol:
            if self.single:
                return inner_symbol(name, **assumptions)
            return self.letters.symbol(f"at_{index:03d}_{name}", f"{port.name}.{name}", **assumptions)

        def remembered(names: tuple[str, ...], kind: str) -> tuple[sp.Symbol, ...]:
            each = enumerate(names)
            return tuple(
                self.letters.symbol(f"at_{index:03d}_{kind}_{i:03d}", f"{port.name or kind}.{name}", real=True)
                for i, name in each
            )

        body = next(iter(port.slip))
        memory, states = (
            remembered(law.memory(), kind) for law, kind in ((port.friction, "memory"), (port.contact, "contact"))
        )
        return SymbolicContact(
            port,
            row_of(port.slip, self.x),
            self.v[body] if self.single else symbol("v", real=True),
            row_of(port.slip, self.a),
            row_of(port.slip, self.speeds),
            symbol("T", real=True),
            symbol("tau", real=True),
            symbol("sigma", positive=True),
            symbol("sigma_ss", positive=True),
            memory,
            states,
            P if self.single else symbol("p", real=True),
            self.letters.symbol(f"at_{index:03d}_p_out", f"{port.name or 'contact'}.p_out", real=True),
        )

    @cached_property
    def friction(self) -> dict[sp.Symbol, sp.Expr]:
        """Symbols that stand for friction until the statics are solved, and what it is."""
        return {inner_symbol(f"friction_{i:03d}"): place.tau_ss for i, place in enumerate(self.places)}

    @cached_property
    def statics(self) -> Statics:
        """How far everything is displaced in steady sliding, in terms of friction and normal stresses."""
        distance = inner_symbol("distance", real=True)
        friction, normal = {}, {}
        for place, held in zip(self.places, self.friction, strict=True):
            port = place.port
            friction[port.name] = held
            normal[port.name] = Press(place.sigma_ss, sp.Integer(0))
            if port.separation and port.contact.is_compliant():
                still = replace(self._motion(place, sp.nan, sp.nan, distance, distance), separation_rate=0)
                pressed = sp.sympify(port.contact.normal_stress(still))
                normal[port.name] = Press(pressed.xreplace({distance: sp.Integer(0)}), derivative(pressed, distance))
        return statics(self.mechanism, friction, normal, self.letters.symbol)

    def _known(self, expression: sp.Expr) -> sp.Expr:
        """A result of the statics in lowest terms, so that a stiffness which does not matter is not in it."""
        if self.statics.carried is not None:
            return expression.xreplace(self.friction)
        return sp.cancel(sp.together(expression)).xreplace(self.friction)

    def _motion(
        self, place: SymbolicContact, spring_ss: Any, stiffness: Any, separation: Any, steady_separation: Any
    ) -> Motion:
        return Motion(
            place.slip, place.velocity, place.acceleration, place.spring, spring_ss, place.tau, place.tau_ss,
            stiffness, place.speed, separation, steady_separation, row_of(place.port.separation, self.v),
            place.states, tuple(map(sp.sympify, place.port.contact.steady_memory(place.speed))), place.outside,
        )  # fmt: skip

    # -- forces

    def _tension(self, element: Element, displacement: Mapping[str, sp.Expr], speed: Mapping[str, Any]) -> sp.Expr:
        """Force in an element."""
        return element.stiffness * row_of(element.senses, displacement) + element.damping * row_of(
            element.senses, speed
        )

    def _grouped(self, elements: list[Element]) -> list[Element]:
        """Elements that act and sense alike made one: a spring and the controller beside it."""
        groups: dict[Any, list[Element]] = {}
        for one in elements:
            groups.setdefault((tuple(one.acts.items()), tuple(one.senses.items()), one.delay), []).append(one)
        return [
            Element(
                "", several[0].acts, several[0].senses, sp.Add(*(sp.sympify(one.stiffness) for one in several)),
                sp.Add(*(sp.sympify(one.damping) for one in several)), several[0].grounded, several[0].delay,
            )
            for several in groups.values()
        ]  # fmt: skip

    def _pull(self, name: str, elements: list[Element]) -> sp.Expr:
        """Force of elements on a coordinate, besides that of steady displacements."""
        total, acting = sp.Integer(0), [one for one in elements if name in one.acts]
        if self.imposed:
            driven = [one for one in acting if one in self.driven]
            acting = [one for one in acting if LOAD_POINT not in one.senses]
            total -= sp.Add(*(one.acts[name] * self._tension(one, {}, self.speeds) for one in driven))
            total += self._loaded(driven[0], name) * self._per_area() if driven else 0
        for one in self._grouped(acting):
            total -= one.acts[name] * one.stiffness * row_of(one.senses, self._before(one.delay, self.x))
            total -= one.acts[name] * one.damping * row_of(one.senses, self._before(one.delay, self.moving))
        late = 0 if self.mechanism.integral is None else self.mechanism.integral.delay
        return total - self._integrated(name, self._before(late, {"": INTEGRAL})[""])

    def _loaded(self, element: Element, name: str) -> sp.Expr:
        """What the imposed force does through its element: as much at the drive's end as is imposed there."""
        at_drive = element.acts.get(LOAD_POINT, -1)
        return -sp.sympify(element.acts[name]) / at_drive * self.force

    @cached_property
    def force(self) -> sp.Expr:
        """Force of a drive that pulls, less that of steady sliding."""
        if not self.by_turns:
            return sp.sympify(self.loading)
        return self.held + self.loading + (1 - self.free) * self._of_drive(self.x, self.moving, INTEGRAL)

    @cached_property
    def driven(self) -> list[Element]:
        """What carries the force of the drive."""
        return [one for one in self.mechanism.elements if LOAD_POINT in one.senses and _present(one)]

    def _of_drive(self, displacement: Mapping[str, Any], speed: Mapping[str, Any], integral: Any) -> sp.Expr:
        """Force that the motion of the drive makes, less that of steady sliding; the integral's share too."""
        steady, acting = (self.speeds if speed else {}), self.mechanism.integral
        pull = sp.Add(
            *(self._tension(one, displacement, speed) - self._tension(one, {}, steady) for one in self.driven)
        )
        if acting is not None:
            pull += acting.gain * integral
        return self._at_drive() * pull / self._per_area()

    def _at_drive(self) -> sp.Expr:
        return sp.sympify(self.driven[0].acts.get(LOAD_POINT, -1))

    @cached_property
    def letting_go(self) -> LettingGo | None:
        """Of a drive that moves and pulls by turns."""
        if not self.by_turns:
            return None
        stiffness = self._at_drive() * sp.Add(*(e.stiffness * e.senses[LOAD_POINT] for e in self.driven))
        stiffness = stiffness / self._per_area()
        velocity = self.mechanism.velocity
        rates = {n: self.v[n] - self.speeds[n] / velocity * V_LP for n in self.x}
        changing = self._of_the_drive("loading_rate")
        own = self._of_drive(self.x, {}, INTEGRAL)
        return LettingGo(
            free=self.free,
            held=self.held,
            force=self.force,
            driven=self._of_drive(self.x, self.moving, INTEGRAL),
            steady=self._steady_force(),
            stiffness=stiffness,
            ahead=(self.held + self.free * (self.loading - own)) / stiffness,
            speed=self.free * (changing - self._of_drive(rates, {}, sp.Integer(0))) / stiffness,
            loading_rate=changing,
        )

    def _steady_force(self) -> sp.Expr:
        """Force of the drive in steady sliding."""
        if self.single:
            return self.motions[0].steady_spring * self.places[0].port.area / self._per_area()
        pull = sp.Add(*(self._known(self.statics.tension(one)) for one in self.driven))
        pull += sp.Add(*(self._tension(one, {}, self.speeds) for one in self.driven))
        if self.mechanism.integral is not None:
            pull += self.mechanism.integral.gain * self._known(self.statics.integral)
        return self._at_drive() * pull / self._per_area()

    def _per_area(self) -> Any:
        """What a unit of the force of the drive is: of a slider a stress."""
        return self.places[0].port.area if self.bare else 1

    def _before(self, delay: Any, now: Mapping[str, sp.Symbol]) -> Mapping[str, sp.Symbol]:
        """What moves as it was a delay ago, as symbols of its own; what the drive does is steady and has none."""
        return now if delay == 0 else {n: s if s is V_LP else self._late(s, sp.sympify(delay)) for n, s in now.items()}

    def _late(self, symbol: sp.Symbol, delay: sp.Expr) -> sp.Symbol:
        for late, meant in self.late.items():
            if meant == (symbol, delay):
                return late
        others = sum(base is symbol for base, _ in self.late.values())
        name = f"{self.letters.known.get(symbol, symbol.name)}_late{others + 1 if others else ''}"
        late = self.letters.symbol(f"{symbol.name}_late_{others:03d}", name, real=True)
        self.late[late] = (symbol, delay)
        return late

    def _steady_pull(self, name: str, elements: list[Element]) -> sp.Expr:
        """Their force in steady sliding, dashpots that move left out: they are in `_pull`."""
        total = sp.Add(*(-one.acts.get(name, 0) * self.statics.tension(one) for one in elements))
        return self._known(total - self._integrated(name, self.statics.integral))

    def _integrated(self, name: str, integral: sp.Expr) -> sp.Expr:
        acting = self.mechanism.integral
        if acting is None or (self.imposed and integral is INTEGRAL):
            return sp.Integer(0)
        return acting.acts.get(name, 0) * acting.gain * integral

    # -- definitions

    def _define(self) -> None:
        """Velocities of slip, then T, τ and σ of the contacts."""
        for place in self.places:
            if place.velocity not in self.v.values():
                self.definitions[place.velocity] = row_of(place.port.slip, self.moving)
        self.motions = [self._seen(place) for place in self.places]
        self.normal = [
            sp.sympify(p.port.contact.normal_stress(m)) + p.press
            for p, m in zip(self.places, self.motions, strict=True)
        ]
        self.inertial = {
            one.name: one.inertia != 0 or any(law.has(self.a[one.name]) for law in self.normal)
            for one in self.mechanism.coordinates
        }
        if self.single:
            self.definitions[self.places[0].tau] = self._friction_of_balance()
        self.definitions |= {place.sigma: law for place, law in zip(self.places, self.normal, strict=True)}

    def _seen(self, place: SymbolicContact) -> Motion:
        """What a contact law sees; defines T, the pull at the body as a stress of the contact."""
        port, body = place.port, next(name for name in place.port.slip if name != LOAD_POINT)
        belt = LOAD_POINT in port.slip  # the drive is what it slides on, and links to the ground hold it against that
        elements = self.mechanism.elements
        pulling = [one for one in elements if not (LOAD_POINT in one.senses if belt else one.grounded)]
        if port.loaded_by:
            pulling = [one for one in self.mechanism.elements if one.name == port.loaded_by]
            body = next(name for name in port.slip if name in pulling[0].acts)
        lever = port.slip[body] * port.area
        steady = self._single_pull() if self.single else self._steady_pull(body, pulling) / lever
        moving = sp.Add(*(-one.acts.get(body, 0) * self._tension(one, {}, self.speeds) for one in pulling)) / lever
        self.definitions[place.spring] = steady + self._pull(body, pulling) / lever
        behind = (
            pulling
            if port.loaded_by
            else [one for one in pulling if (one.grounded if belt else LOAD_POINT in one.senses)]
        )
        stiffness = sp.Add(*(sp.sympify(e.acts.get(body, 0) * e.stiffness * e.senses.get(body, 0)) for e in behind))
        distance = self._known(row_of(port.separation, self.statics.displacement)) if port.separation else 0
        apart = distance + row_of(port.separation, self.x)
        return self._motion(place, steady + moving, stiffness / (lever * port.slip[body]), apart, distance)

    def _single_pull(self) -> sp.Expr:
        """The pull at a block in steady sliding, which no statics are needed for: friction, and what holds it back."""
        (place,), (body,) = self.places, self.mechanism.coordinates
        held = sp.Add(*(self._tension(one, {}, self.speeds) for one in self._held()))
        return place.tau_ss + (held - body.force) / place.port.area

    def _held(self) -> list[Element]:
        return [one for one in self.mechanism.elements if one.grounded]

    def _friction_of_balance(self) -> sp.Expr:
        """τ of a single block."""
        (place,), (body,) = self.places, self.mechanism.coordinates
        held = -sp.Add(*(self._tension(one, self.x, self.moving) for one in self._held()))
        found = place.spring + (held + body.force - body.inertia * self.a[body.name]) / place.port.area
        return found + self.push[body.name] / place.port.area

    def _balance(self, name: str, inertia: Any) -> sp.Expr | None:
        """Inertia less forces of a coordinate, those that are the same in steady sliding left out on both sides."""
        if self.single:
            return None
        total = inertia * self.a[name] - self._pull(name, list(self.mechanism.elements)) - self.push[name]
        for one in self.mechanism.elements:  # what a dashpot that moves steadily carries, springs carry the other way
            total -= one.acts.get(name, 0) * self._tension(one, {}, self.speeds)
        for place in self.places:
            area = place.port.area
            total += place.port.slip.get(name, 0) * area * (place.tau - place.tau_ss)
            total -= place.port.separation.get(name, 0) * area * (place.sigma - place.sigma_ss)
        return total

    def _beyond(self, element: Element) -> sp.Expr:
        """Force in a link of a drive that pulls, beyond that of steady sliding; the first has what is imposed."""
        if not self.by_turns:
            return -self.loading / element.acts[LOAD_POINT]
        moved = self._tension(element, self.x, self.moving) - self._tension(element, {}, self.speeds)
        held = (self.held + self.loading) / element.acts[LOAD_POINT] if element is self.driven[0] else 0
        return -(1 - self.free) * moved - held


def _present(element: Element) -> bool:
    """Whether an element carries anything at all."""
    return not (element.stiffness == 0 and element.damping == 0)
