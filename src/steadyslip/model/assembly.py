"""A Mechanism in symbols to its Model: inertia, dampings and stiffnesses of the coordinates, and the terms of contacts.

This is the one way in which models come about, of a single block as of many bodies. A block with one contact takes its
friction from the balance of forces, τ = T − ηv − m v̇ + q, and its friction law fixes the acceleration or velocity.
Everywhere else friction has a symbol that its law fixes, and each coordinate a balance of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.core.roles import Parameter
from steadyslip.laws.contact import Motion
from steadyslip.machine.mechanism import LOAD_POINT, Element, Mechanism, Touch
from steadyslip.model.equations import Contact, Coordinate, Model, Variable
from steadyslip.model.statics import Statics, row_of, statics

RESERVED = ("x", "v", "a_x", "I_x", "T", "tau", "sigma", "sigma_ss", "v_lp", "q", "p", "t", "mu_ss", "k_cr")
V_LP, Q, P, TIME = (sp.Symbol(name, real=True) for name in ("v_lp", "q", "p", "t"))
INTEGRAL = sp.Symbol("I_x", real=True)
Letters = Callable[[str], str]


@dataclass(frozen=True, eq=False)
class _Place:
    """A contact on its way into the Model: its symbols, and what the laws say in them."""

    touch: Touch
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
        return sp.sympify(self.touch.friction.steady_strength(self.speed, self.sigma_ss))


def assemble(
    mechanism: Mechanism, given: dict[str, sp.Symbol], roles: Mapping[str, Parameter], letter: Letters,
    imposed: bool = False,
) -> Model:  # fmt: skip
    """The Model of a mechanism in symbols.

    Parameters
    ----------
    mechanism : Mechanism
    given : dict of str to sympy.Symbol
        The parameters by dotted name.
    roles : mapping of str to Parameter
        What is declared of them.
    letter : callable
        A letter for a dotted name that nothing else has.
    imposed : bool
        Whether the force of the drive is imposed, and its motion free.

    Raises
    ------
    NotAvailable
        If it is open what a force of the drive does.
    """
    return _Assembly(mechanism, letter, imposed).model(given, roles)


class _Assembly:
    """One pass from a mechanism to its Model."""

    def __init__(self, mechanism: Mechanism, letter: Letters, imposed: bool) -> None:
        self.mechanism, self.letter, self.imposed = mechanism, letter, imposed
        self.loading = sp.Symbol(letter("drive.loading"), real=True) if imposed else sp.Integer(0)
        if imposed:
            self._check_loading()
        names = [one.name for one in mechanism.coordinates]
        self.single = len(names) == 1 and [dict(touch.slip) for touch in mechanism.touches] == [{names[0]: 1}]
        self.bare = not all(touch.name for touch in mechanism.touches)

        def symbols(of: str, alone: str) -> dict[str, sp.Symbol]:
            return {n: sp.Symbol(alone if self.single else letter(f"{n}.{of}"), real=True) for n in names}

        self.x, self.v, self.a = symbols("x", "x"), symbols("v", "v"), symbols("a", "a_x")
        self.push = {names[0]: Q} if self.single else symbols("q", "q")
        self.moving = self.v | {LOAD_POINT: V_LP}
        self.speeds = {c.name: sp.sympify(c.speed) for c in mechanism.coordinates} | {LOAD_POINT: mechanism.velocity}
        self.places = [self._place(touch) for touch in mechanism.touches]
        self.definitions: dict[sp.Symbol, sp.Expr] = {}
        self.late: dict[sp.Symbol, tuple[sp.Symbol, sp.Expr]] = {}
        self._define()

    def _check_loading(self) -> None:
        """One link, or a controller, must carry the force of the drive."""
        acting = [dict(one.acts) for one in self.mechanism.elements if LOAD_POINT in one.senses and _present(one)]
        if not acting or any(acts != acting[0] for acts in acting):
            names = ", ".join(one.name for one in self.mechanism.elements if LOAD_POINT in one.senses and one.name)
            raise NotAvailable(
                f"a drive that pulls with a force of its own needs one link that carries it; {names or 'none'} "
                "would share it, and how is open"
            )
        if any(LOAD_POINT in touch.slip for touch in self.mechanism.touches):
            raise NotAvailable(
                "a drive that pulls with a force of its own is not offered where a contact slides on the drive"
            )

    # -- contacts in symbols

    def _place(self, touch: Touch) -> _Place:
        def symbol(name: str, **assumptions: bool) -> sp.Symbol:
            return sp.Symbol(name if self.single else self.letter(f"{touch.name}.{name}"), **assumptions)

        body = next(iter(touch.slip))
        memory = tuple(
            sp.Symbol(self.letter(f"{touch.name or 'memory'}.{name}"), real=True) for name in touch.friction.memory()
        )
        states = tuple(
            sp.Symbol(self.letter(f"{touch.name or 'contact'}.{name}"), real=True) for name in touch.contact.memory()
        )
        return _Place(
            touch,
            row_of(touch.slip, self.x),
            self.v[body] if self.single else symbol("v", real=True),
            row_of(touch.slip, self.a),
            row_of(touch.slip, self.speeds),
            symbol("T", real=True),
            symbol("tau", real=True),
            symbol("sigma", positive=True),
            symbol("sigma_ss", positive=True),
            memory,
            states,
            P if self.single else symbol("p", real=True),
            sp.Symbol(self.letter(f"{touch.name or 'contact'}.p_out"), real=True),
        )

    @cached_property
    def friction(self) -> dict[sp.Symbol, sp.Expr]:
        """Symbols that stand for friction until the statics are solved, and what it is."""
        return {sp.Symbol(f"friction_{i}"): place.tau_ss for i, place in enumerate(self.places)}

    @cached_property
    def statics(self) -> Statics:
        """How far everything is displaced in steady sliding, in terms of friction and normal stresses."""
        distance = sp.Symbol("distance", real=True)
        friction, normal = {}, {}
        for place, held in zip(self.places, self.friction, strict=True):
            touch = place.touch
            friction[touch.name] = held
            normal[touch.name] = (place.sigma_ss, sp.Integer(0))
            if touch.separation and touch.contact.is_compliant():
                still = replace(self._motion(place, sp.nan, sp.nan, distance, distance), separation_rate=0)
                pressed = sp.sympify(touch.contact.normal_stress(still))
                normal[touch.name] = (pressed.xreplace({distance: sp.Integer(0)}), derivative(pressed, distance))
        return statics(self.mechanism, friction, normal)

    def _known(self, expression: sp.Expr) -> sp.Expr:
        """A result of the statics in lowest terms, so that a stiffness which does not matter is not in it."""
        return sp.cancel(sp.together(expression)).xreplace(self.friction)

    def _motion(self, place: _Place, spring_ss: Any, stiffness: Any, separation: Any, steady_separation: Any) -> Motion:
        return Motion(
            place.slip, place.velocity, place.acceleration, place.spring, spring_ss, place.tau, place.tau_ss,
            stiffness, place.speed, separation, steady_separation, row_of(place.touch.separation, self.v),
            place.states, tuple(map(sp.sympify, place.touch.contact.steady_memory(place.speed))), place.outside,
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
            driven = [one for one in acting if LOAD_POINT in one.senses and _present(one)]
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
        return -sp.sympify(element.acts[name]) / at_drive * self.loading

    def _per_area(self) -> Any:
        """What a unit of the force of the drive is: of a slider a stress."""
        return self.places[0].touch.area if self.bare else 1

    def _before(self, delay: Any, now: Mapping[str, sp.Symbol]) -> Mapping[str, sp.Symbol]:
        """What moves as it was a delay ago, as symbols of its own; what the drive does is steady and has none."""
        return now if delay == 0 else {n: s if s is V_LP else self._late(s, sp.sympify(delay)) for n, s in now.items()}

    def _late(self, symbol: sp.Symbol, delay: sp.Expr) -> sp.Symbol:
        for late, meant in self.late.items():
            if meant == (symbol, delay):
                return late
        others = sum(base is symbol for base, _ in self.late.values())
        late = sp.Symbol(f"{symbol}_late{others + 1 if others else ''}", real=True)
        self.late[late] = (symbol, delay)
        return late

    def _steady_pull(self, name: str, elements: list[Element]) -> sp.Expr:
        """Their force in steady sliding, dashpots that move left out: they are in `_pull`."""
        total = sp.Add(
            *(-one.acts.get(name, 0) * self._tension(one, self.statics.displacement, {}) for one in elements)
        )
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
                self.definitions[place.velocity] = row_of(place.touch.slip, self.moving)
        self.motions = [self._seen(place) for place in self.places]
        self.normal = [
            sp.sympify(p.touch.contact.normal_stress(m)) + p.press
            for p, m in zip(self.places, self.motions, strict=True)
        ]
        self.inertial = {
            one.name: one.inertia != 0 or any(law.has(self.a[one.name]) for law in self.normal)
            for one in self.mechanism.coordinates
        }
        if self.single:
            self.definitions[self.places[0].tau] = self._friction_of_balance()
        self.definitions |= {place.sigma: law for place, law in zip(self.places, self.normal, strict=True)}

    def _seen(self, place: _Place) -> Motion:
        """What a contact law sees; defines T, the pull at the body as a stress of the contact."""
        touch, body = place.touch, next(name for name in place.touch.slip if name != LOAD_POINT)
        belt = LOAD_POINT in touch.slip  # the drive is what it slides on, and links to the ground hold it against that
        elements = self.mechanism.elements
        pulling = [one for one in elements if not (LOAD_POINT in one.senses if belt else one.grounded)]
        if touch.loaded_by:
            pulling = [one for one in self.mechanism.elements if one.name == touch.loaded_by]
            body = next(name for name in touch.slip if name in pulling[0].acts)
        lever = touch.slip[body] * touch.area
        steady = self._single_pull() if self.single else self._steady_pull(body, pulling) / lever
        moving = sp.Add(*(-one.acts.get(body, 0) * self._tension(one, {}, self.speeds) for one in pulling)) / lever
        self.definitions[place.spring] = steady + self._pull(body, pulling) / lever
        behind = (
            pulling
            if touch.loaded_by
            else [one for one in pulling if (one.grounded if belt else LOAD_POINT in one.senses)]
        )
        stiffness = sp.Add(*(sp.sympify(e.acts.get(body, 0) * e.stiffness * e.senses.get(body, 0)) for e in behind))
        distance = self._known(row_of(touch.separation, self.statics.displacement)) if touch.separation else 0
        apart = distance + row_of(touch.separation, self.x)
        return self._motion(place, steady + moving, stiffness / (lever * touch.slip[body]), apart, distance)

    def _single_pull(self) -> sp.Expr:
        """The pull at a block in steady sliding, which no statics are needed for: friction, and what holds it back."""
        (place,), (body,) = self.places, self.mechanism.coordinates
        held = sp.Add(*(self._tension(one, {}, self.speeds) for one in self._held()))
        return place.tau_ss + (held - body.force) / place.touch.area

    def _held(self) -> list[Element]:
        return [one for one in self.mechanism.elements if one.grounded]

    def _friction_of_balance(self) -> sp.Expr:
        """τ of a single block."""
        (place,), (body,) = self.places, self.mechanism.coordinates
        held = -sp.Add(*(self._tension(one, self.x, self.moving) for one in self._held()))
        found = place.spring + (held + body.force - body.inertia * self.a[body.name]) / place.touch.area
        return found + self.push[body.name] / place.touch.area

    def _balance(self, name: str, inertia: Any) -> sp.Expr | None:
        """Inertia less forces of a coordinate, those that are the same in steady sliding left out on both sides."""
        if self.single:
            return None
        total = inertia * self.a[name] - self._pull(name, list(self.mechanism.elements)) - self.push[name]
        for one in self.mechanism.elements:  # what a dashpot that moves steadily carries, springs carry the other way
            total -= one.acts.get(name, 0) * self._tension(one, {}, self.speeds)
        for place in self.places:
            area = place.touch.area
            total += place.touch.slip.get(name, 0) * area * (place.tau - place.tau_ss)
            total -= place.touch.separation.get(name, 0) * area * (place.sigma - place.sigma_ss)
        return total

    # -- the Model

    def model(self, given: dict[str, sp.Symbol], roles: Mapping[str, Parameter]) -> Model:
        coordinates = tuple(
            Coordinate(
                one.name, self.x[one.name], self.v[one.name], self.a[one.name], sp.sympify(one.inertia),
                sp.sympify(one.speed), self.inertial[one.name], self._balance(one.name, one.inertia), one.unit,
                self.push[one.name],
            )
            for one in self.mechanism.coordinates
        )  # fmt: skip
        contacts = tuple(map(self._contact, range(len(self.places))))
        variables, rates = self._variables(coordinates, contacts)
        disturbances = {"disturbance": Q, "normal_disturbance": P}
        if not self.bare:
            disturbances = {f"{one.name}.push": one.push for one in coordinates}
            disturbances |= {f"{one.name}.press": one.press for one in contacts}
        disturbances |= {f"{one.name}.pores": one.outside for one in contacts if one.outside is not None}
        if self.imposed:
            disturbances["loading"] = self.loading
        inputs = {"load_velocity": V_LP, **disturbances, "time": TIME}
        share = self.mechanism.axial_share
        return Model(
            variables=variables,
            rates=rates,
            definitions=self.definitions,
            coordinates=coordinates,
            contacts=contacts,
            inputs=inputs,
            parameters=given,
            roles={name: roles[name] for name in given},
            gain=sp.sympify(self.mechanism.gain),
            axial_share=None if share is None else sp.sympify(share),
            steady=self._steady(coordinates),
            observables=self._observables(),
            late=self.late,
        )

    def _contact(self, i: int) -> Contact:
        place, motion = self.places[i], self.motions[i]
        friction, contact = place.touch.friction, place.touch.contact
        own = f"{place.touch.name}." if place.touch.name else ""
        units = friction.memory_units()
        remembered = zip(friction.memory(), place.memory, units, strict=True)
        inertial = self.single and self.inertial[self.mechanism.coordinates[0].name]
        own_unknown = place.acceleration if inertial else place.velocity
        load = contact.load()
        return Contact(
            name=place.touch.name,
            slip=place.slip,
            velocity=place.velocity,
            acceleration=place.acceleration,
            spring=place.spring,
            friction=place.tau,
            normal=place.sigma,
            memory=tuple(Variable(f"{own}{n}", s, unit, "memory of friction", "memory") for n, s, unit in remembered),
            own_states=tuple(
                Variable(f"{own}{n}", s, unit, "state of the contact", "state")
                for n, s, unit in zip(contact.memory(), place.states, contact.memory_units(), strict=True)
            ),
            balance=self._strength(place) - place.tau,
            unknown=own_unknown if self.single else place.tau,
            sigma_ss=place.sigma_ss,
            steady_stress=sp.sympify(contact.normal_stress(motion.steady)),
            steady_coupling=sp.sympify(contact.coupling(motion.steady)),
            steady_load=None if load is None else sp.sympify(load),
            imposed=sp.sympify(contact.imposed(TIME)),
            direction=sp.sympify(friction.direction(place.velocity, place.speed)),
            area=sp.sympify(place.touch.area),
            press=place.press,
            outside=place.outside if contact.has_pores() else None,
        )

    def _strength(self, place: _Place) -> sp.Expr:
        """Friction as its law states it."""
        law, now = place.touch.friction, (place.sigma, place.memory, place.tau)
        delay = law.lateness()
        if delay == 0:
            return sp.sympify(law.strength(place.velocity, *now))
        late = row_of(place.touch.slip, self._before(delay, self.moving))
        return sp.sympify(law.late_strength(place.velocity, late, *now))

    def _variables(
        self, coordinates: tuple[Coordinate, ...], contacts: tuple[Contact, ...]
    ) -> tuple[tuple[Variable, ...], tuple[sp.Expr, ...]]:
        """Differential variables and their rates: coordinates, memory, the integral of a controller."""
        variables: list[Variable] = []
        rates: list[sp.Expr] = []
        for one, body in zip(coordinates, self.mechanism.coordinates, strict=True):
            name, what = ("", "of the block") if self.bare else (f"{one.name}.", f"of {one.name}")
            doc = "slip of the block" if self.bare else f"displacement {what}"
            variables.append(Variable(f"{name}x", one.displacement, one.unit, f"{doc} ahead of the load point", "slip"))
            rates.append(one.velocity - sp.sympify(body.speed) / self.mechanism.velocity * V_LP)
            if one.inertial:
                variables.append(Variable(f"{name}v", one.velocity, f"{one.unit}/s", f"velocity {what}", "velocity"))
                rates.append(one.acceleration)
        for contact, place, motion in zip(contacts, self.places, self.motions, strict=True):
            variables += [*contact.memory, *contact.own_states]
            law = place.touch.friction
            rates += [sp.sympify(e) for e in law.rates(place.velocity, place.sigma, place.memory, place.tau)]
            rates += [sp.sympify(e) for e in place.touch.contact.rates(motion)]
        integral = self.mechanism.integral
        if integral is not None:
            what = "time integral of x (controller)" if self.single else "time integral of the controller's error"
            unit = next(one.unit for one in self.mechanism.coordinates if one.name in integral.acts)
            variables.append(Variable("integral", INTEGRAL, f"{unit} s", what, "integral"))
            rates.append(row_of(integral.senses, self.x))
        return tuple(variables), tuple(rates)

    def _steady(self, coordinates: tuple[Coordinate, ...]) -> dict[sp.Symbol, sp.Expr]:
        zero = sp.Integer(0)
        found: dict[sp.Symbol, sp.Expr] = {}
        for one in coordinates:
            found |= {one.displacement: zero, one.velocity: one.speed, one.acceleration: zero}
        found[INTEGRAL] = zero
        for place, motion in zip(self.places, self.motions, strict=True):
            found[place.velocity] = place.speed
            found |= {place.spring: sp.sympify(motion.steady_spring), place.tau: place.tau_ss}
            found[place.sigma] = place.sigma_ss
            memory = place.touch.friction.steady_memory(place.speed, place.sigma_ss)
            found |= dict(zip(place.memory, map(sp.sympify, memory), strict=True))
            found |= dict(zip(place.states, motion.steady_memory, strict=True))
        found |= {late: found[symbol] for late, (symbol, _) in self.late.items()}
        without = (*self.push.values(), *(one for place in self.places for one in (place.press, place.outside)))
        none = dict.fromkeys((*without, *([self.loading] if self.imposed else [])), zero)
        return found | {V_LP: sp.sympify(self.mechanism.velocity)} | none

    def _observables(self) -> dict[str, tuple[sp.Expr, str]]:
        """The named results that every stage shows, with units; totals where contacts have names."""
        found: dict[str, tuple[sp.Expr, str]] = {}
        for one in self.mechanism.coordinates:
            own = "" if self.bare else f"{one.name}."
            found |= {f"{own}x": (self.x[one.name], one.unit), f"{own}v": (self.v[one.name], f"{one.unit}/s")}
        for place in self.places:
            own, area = (f"{place.touch.name}.", place.touch.area) if place.touch.name else ("", 1)
            words = ("friction_force", "normal_force") if own else ("shear_stress", "normal_stress")
            unit = "N" if own else "Pa"
            found |= {
                f"{own}friction": (place.tau / place.sigma, "1"),
                own + words[0]: (area * place.tau, unit),
                own + words[1]: (area * place.sigma, unit),
            }
            if not own:
                found["spring_stress"] = (place.spring, "Pa")
            law = place.touch.friction
            seen = law.observables(place.velocity, place.sigma, place.memory, place.tau)
            found |= {f"{own}{name}": (sp.sympify(e), unit) for name, (e, unit) in seen.items()}
            contact = place.touch.contact
            held = zip(contact.memory(), place.states, contact.memory_units(), strict=True)
            found |= {f"{own}{name}": (symbol, unit) for name, symbol, unit in held}
        for element in self.mechanism.elements:
            if element.name:
                resting = self._known(self._tension(element, self.statics.displacement, {}))
                twisted = all(one.unit == "rad" for one in self.mechanism.coordinates if one.name in element.acts)
                force = -resting - self._tension(element, self.x, self.moving)
                if self.imposed and LOAD_POINT in element.senses:
                    force = -resting - self._tension(element, {}, self.speeds)
                    force -= self.loading / element.acts[LOAD_POINT]
                found[f"{element.name}.force"] = (force, "N m" if twisted else "N")
        return found


def _present(element: Element) -> bool:
    """Whether an element carries anything at all."""
    return not (element.stiffness == 0 and element.damping == 0)
