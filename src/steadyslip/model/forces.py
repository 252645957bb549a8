"""Forces of a symbolic mechanism: balances of its coordinates and stresses of its contacts.

A slider's friction stress follows from the balance of forces, τ = T − ηv − m v̇ + q, and the friction law determines
acceleration or velocity. In machines the friction stress of each contact is an unknown determined by the friction law,
and each coordinate has its own balance of forces.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative, supported
from steadyslip.core.symbols import Letters, inner_symbol
from steadyslip.laws.contact import ContactInputs
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, Element, Mechanism
from steadyslip.model.dead_time import LateSignal, late_signal
from steadyslip.model.equations import EITHER, MOVED, V_LP, LettingGo, P, Q
from steadyslip.model.statics import NormalStress, Statics, row_of, statics

INTEGRAL = inner_symbol("I_x", real=True)


@dataclass(frozen=True, eq=False)
class SymbolicContact:
    """Symbols of a contact while the Model is assembled."""

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
        """Friction stress in steady sliding."""
        given = self.speed, self.sigma_ss
        # checked before the strength, which may use the memory
        all_of_law(self.port.friction, "steady_memory", len(self.memory), *given)
        return of_law(self.port.friction, "steady_strength", *given)


def of_law(law: object, method: str, *arguments: Any) -> sp.Expr:
    """Expression returned by a method of a friction or contact law, checked.

    Raises
    ------
    NotAvailable
        If the method returns no expression, or one that cannot be computed; see `supported`.
    """
    return _usable(law, method, _answer(law, method, arguments))


def all_of_law(law: object, method: str, count: int, *arguments: Any) -> tuple[sp.Expr, ...]:
    """Expressions returned by a method of a law for its `count` memory variables, checked as in `of_law`."""
    found = _answer(law, method, arguments)
    if not isinstance(found, (tuple, list)) or len(found) != count:
        given = len(found) if isinstance(found, (tuple, list)) else f"a bare {type(found).__name__}"
        raise NotAvailable(
            f"{method} of {type(law).__name__} gives {given}; allowed: a tuple of {count}, one expression for each "
            "memory variable"
        )
    return tuple(_usable(law, method, one) for one in found)


def _answer(law: object, method: str, arguments: tuple[Any, ...]) -> Any:
    try:
        return getattr(law, method)(*arguments)
    except TypeError as error:  # float() of a symbol, by functions of `math` and `if`
        raise NotAvailable(
            f"{method} of {type(law).__name__} does not work with symbols ({error}); use functions of SymPy such as "
            "sp.log, and sp.Piecewise for branches"
        ) from error


def _usable(law: object, method: str, found: Any) -> sp.Expr:
    if not isinstance(found, (sp.Expr, int, float)):
        raise NotAvailable(f"{method} of {type(law).__name__} gives {found!r}; allowed: a number or an expression")
    return supported(found, f"{method} of {type(law).__name__}")


class Forces:
    """Symbols of a mechanism, forces of its elements and stresses of its contacts.

    Attributes
    ----------
    imposed, alternates : bool
        `imposed`: the force of the drive is imposed for all or part of the run; `alternates`: for part of the run.
    single, bare : bool
        `single`: one block on one contact (a slider); `bare`: contacts have no names.
    x, v, a, push : dict of str to sympy.Symbol
        Displacement, velocity, acceleration and disturbance of each coordinate.
    moving, speeds : dict of str
        Velocity symbols and steady speeds of coordinates and load point.
    sites : list of SymbolicContact
    late : dict of sympy.Symbol to (sympy.Symbol, sympy.Expr)
        `Model.late`; empty in a Model for motion.
    past : list of LateSignal
        Late signals of a Model for motion.
    """

    def __init__(self, mechanism: Mechanism, letters: Letters, drive: str, order: int) -> None:
        self.mechanism, self.letters, self.order = mechanism, letters, order
        self.past: list[LateSignal] = []
        self.imposed, self.alternates = drive != MOVED, drive == EITHER
        self.loading = self._drive_symbol("loading") if self.imposed else sp.Integer(0)
        if self.alternates:
            self.free, self.held = map(self._drive_symbol, ("free", "held"))
        if self.imposed:
            self._check_loading()
        names = [one.name for one in mechanism.coordinates]
        own = [(dict(port.slip), port.loaded_by) for port in mechanism.contacts]
        self.single = len(names) == 1 and own == [({names[0]: 1}, "")]
        self.bare = not all(port.name for port in mechanism.contacts)

        def symbols(of: str, alone: str) -> dict[str, sp.Symbol]:
            if self.single:
                return {names[0]: inner_symbol(alone, real=True)}
            return {n: letters.symbol(f"{alone}_{i:03d}", f"{n}.{of}", real=True) for i, n in enumerate(names)}

        self.x, self.v, self.a = symbols("x", "x"), symbols("v", "v"), symbols("a", "a_x")
        self.push = {names[0]: Q} if self.single else symbols("q", "q")
        self.moving = self.v | {LOAD_POINT: V_LP}
        self.speeds = {c.name: sp.sympify(c.speed) for c in mechanism.coordinates} | {LOAD_POINT: mechanism.velocity}
        self.sites = [self._symbolic_contact(i, port) for i, port in enumerate(mechanism.contacts)]
        self.definitions: dict[sp.Symbol, sp.Expr] = {}
        self.late: dict[sp.Symbol, tuple[sp.Symbol, sp.Expr]] = {}
        self._define()

    def _check_loading(self) -> None:
        """Raise NotAvailable unless a single link, or the controller, carries the imposed force of the drive."""
        acting = [dict(one.acts) for one in self.drive_elements]
        if not acting or any(acts != acting[0] for acts in acting):
            names = ", ".join(dict.fromkeys(one.name or "the controller" for one in self.drive_elements))
            raise NotAvailable(
                f"a drive that pulls with a force of its own needs one link that carries it; {names or 'none'} "
                "would share it, and how is open"
            )
        if any(LOAD_POINT in port.slip for port in self.mechanism.contacts):
            raise NotAvailable(
                "a drive that pulls with a force of its own is not offered where a contact slides on the drive"
            )

    # -- symbols of contacts

    def _drive_symbol(self, what: str) -> sp.Symbol:
        """Symbol of a quantity of the drive, such as ``loading``."""
        return self.letters.symbol(f"drive_{what}", f"drive.{what}", real=True)

    def _symbolic_contact(self, index: int, port: ContactPort) -> SymbolicContact:
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
        """Placeholder symbols of steady friction stresses used to solve the statics, and their expressions."""
        return {inner_symbol(f"friction_{i:03d}"): site.tau_ss for i, site in enumerate(self.sites)}

    @cached_property
    def statics(self) -> Statics:
        """Displacements in steady sliding as functions of friction and normal stresses."""
        distance = inner_symbol("distance", real=True)
        friction, normal = {}, {}
        for site, held in zip(self.sites, self.friction, strict=True):
            port = site.port
            friction[port.name] = held
            normal[port.name] = NormalStress(site.sigma_ss, sp.Integer(0))
            if port.separation and port.contact.is_compliant():
                still = replace(self._motion(site, sp.nan, sp.nan, distance, distance), separation_rate=0)
                pressed = of_law(port.contact, "normal_stress", still)
                at_contact, slope = pressed.xreplace({distance: sp.Integer(0)}), derivative(pressed, distance)
                normal[port.name] = NormalStress(at_contact, slope)
        return statics(self.mechanism, friction, normal, self.letters.symbol)

    def _simplified(self, expression: sp.Expr) -> sp.Expr:
        """Result of the statics in lowest terms, so that stiffnesses cancel on which it does not depend."""
        if self.statics.carried is not None:
            return expression.xreplace(self.friction)
        return sp.cancel(sp.together(expression)).xreplace(self.friction)

    def _motion(
        self, site: SymbolicContact, spring_ss: Any, stiffness: Any, separation: Any, steady_separation: Any
    ) -> ContactInputs:
        return ContactInputs(
            site.slip, site.velocity, site.acceleration, site.spring, spring_ss, site.tau, site.tau_ss,
            stiffness, site.speed, separation, steady_separation, row_of(site.port.separation, self.v),
            site.states, all_of_law(site.port.contact, "steady_memory", len(site.states), site.speed), site.outside,
        )  # fmt: skip

    # -- forces

    def _tension(self, element: Element, displacement: Mapping[str, sp.Expr], speed: Mapping[str, Any]) -> sp.Expr:
        """Tension of an element for given displacements and speeds."""
        return element.stiffness * row_of(element.senses, displacement) + element.damping * row_of(
            element.senses, speed
        )

    def _grouped(self, elements: list[Element]) -> list[Element]:
        """The elements, with those combined that act and sense alike with equal delay, such as a parallel spring and
        controller."""
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

    def _pull(self, name: str, elements: list[Element], integral: bool = True) -> sp.Expr:
        """Force on a coordinate by elements and integral action, minus the force due to steady displacements."""
        total, acting = sp.Integer(0), [one for one in elements if name in one.acts]
        if self.imposed:
            drive_elements = [one for one in acting if one in self.drive_elements]
            acting = [one for one in acting if LOAD_POINT not in one.senses]
            total -= sp.Add(*(one.acts[name] * self._tension(one, {}, self.speeds) for one in drive_elements))
            total += self._imposed_pull(drive_elements[0], name) * self._force_area() if drive_elements else 0
        late = [one for one in acting if self.order and one.delay != 0]
        for one in self._grouped([one for one in acting if one not in late]):
            total -= one.acts[name] * one.stiffness * row_of(one.senses, self._delayed(one.delay, self.x))
            total -= one.acts[name] * one.damping * row_of(one.senses, self._delayed(one.delay, self.moving))
        delay = 0 if self.mechanism.integral is None else self.mechanism.integral.delay
        if self.order and (late or delay != 0):
            return total - self._late_pull(name, late, integral)
        return total - self._integrated(name, self._delayed(delay, {"": INTEGRAL})[""]) if integral else total

    def _late_pull(self, name: str, elements: list[Element], integral: bool) -> sp.Expr:
        """Delayed force on a coordinate by elements and integral action; forces of equal delay make one signal."""
        parts: dict[tuple[Any, Any], list[tuple[sp.Expr, sp.Expr]]] = {}
        for one in elements:
            both = self._tension(one, self.x, self.moving), self._tension(one, {}, self.speeds)
            parts.setdefault((one.acts[name], one.delay), []).append(both)
        acting = self.mechanism.integral
        if integral and acting is not None and not self.imposed and name in acting.acts:
            parts.setdefault((acting.acts[name], acting.delay), []).append((acting.gain * INTEGRAL, sp.Integer(0)))
        unit = "Pa" if self.bare else "N"
        return sp.Add(*(
            share * self._late(sp.Add(*(now for now, _ in each)), sp.Add(*(steady for _, steady in each)), delay, unit)
            for (share, delay), each in parts.items()
        ))  # fmt: skip

    def _late(self, signal: sp.Expr, steady: sp.Expr, delay: Any, unit: str) -> sp.Expr:
        """Value that a signal had one `delay` (s) ago, in a Model for motion."""
        if self.alternates:
            raise NotAvailable(
                "creep as a part of a run is not offered with a delay; let creep last for the whole run, or set the "
                "delay to 0"
            )
        for one in self.past:
            if (one.signal, one.delay) == (signal, delay):
                return one.late
        self.past.append(late_signal(len(self.past), self.order, signal, steady, sp.sympify(delay), unit))
        return self.past[-1].late

    def _imposed_pull(self, element: Element, name: str) -> sp.Expr:
        """Force that an element transmits to a coordinate from the imposed force of the drive."""
        at_drive = element.acts.get(LOAD_POINT, -1)
        return -sp.sympify(element.acts[name]) / at_drive * self.force

    @cached_property
    def force(self) -> sp.Expr:
        """Force of the drive minus its value in steady sliding."""
        if not self.alternates:
            return sp.sympify(self.loading)
        return self.held + self.loading + (1 - self.free) * self._drive_motion_force(self.x, self.moving, INTEGRAL)

    @cached_property
    def drive_elements(self) -> list[Element]:
        """Elements that carry the force of the drive."""
        carrying = [one for one in self.mechanism.elements if one.stiffness != 0 or one.damping != 0]
        return [one for one in carrying if LOAD_POINT in one.senses]

    def _drive_motion_force(self, displacement: Mapping[str, Any], speed: Mapping[str, Any], integral: Any) -> sp.Expr:
        """Force of the drive due to its motion, integral action included, minus its value in steady sliding."""
        steady, acting = (self.speeds if speed else {}), self.mechanism.integral
        pull = sp.Add(
            *(self._tension(one, displacement, speed) - self._tension(one, {}, steady) for one in self.drive_elements)
        )
        if acting is not None:
            pull += acting.gain * integral
        return self._at_drive() * pull / self._force_area()

    def _at_drive(self) -> sp.Expr:
        """Coefficient with which the elements of the drive act on the load point."""
        return sp.sympify(self.drive_elements[0].acts.get(LOAD_POINT, -1))

    @cached_property
    def letting_go(self) -> LettingGo | None:
        """Expressions for a drive whose motion and force are imposed in turn; None for other drives."""
        if not self.alternates:
            return None
        stiffness = self._at_drive() * sp.Add(*(e.stiffness * e.senses[LOAD_POINT] for e in self.drive_elements))
        stiffness = stiffness / self._force_area()
        velocity = self.mechanism.velocity
        rates = {n: self.v[n] - self.speeds[n] / velocity * V_LP for n in self.x}
        changing = self._drive_symbol("loading_rate")
        own = self._drive_motion_force(self.x, {}, INTEGRAL)
        return LettingGo(
            free=self.free,
            held=self.held,
            force=self.force,
            driven=self._drive_motion_force(self.x, self.moving, INTEGRAL),
            steady=self._steady_force(),
            stiffness=stiffness,
            ahead=(self.held + self.free * (self.loading - own)) / stiffness,
            speed=self.free * (changing - self._drive_motion_force(rates, {}, sp.Integer(0))) / stiffness,
            loading_rate=changing,
        )

    def _steady_force(self) -> sp.Expr:
        """Force of the drive in steady sliding (a stress for sliders)."""
        if self.single:
            return self.motions[0].steady_spring * self.sites[0].port.area / self._force_area()
        pull = sp.Add(*(self._simplified(self.statics.tension(one)) for one in self.drive_elements))
        pull += sp.Add(*(self._tension(one, {}, self.speeds) for one in self.drive_elements))
        if self.mechanism.integral is not None:
            pull += self.mechanism.integral.gain * self._simplified(self.statics.integral)
        return self._at_drive() * pull / self._force_area()

    def _force_area(self) -> Any:
        """Divisor of the force of the drive: contact area for a slider (gives a stress), 1 for a machine."""
        return self.sites[0].port.area if self.bare else 1

    def _delayed(self, delay: Any, now: Mapping[str, sp.Symbol]) -> Mapping[str, sp.Symbol]:
        """Symbols of the variables one `delay` (s) ago; the load point's velocity is constant and not delayed."""
        if delay == 0:
            return now
        return {n: s if s is V_LP else self._delayed_symbol(s, sp.sympify(delay)) for n, s in now.items()}

    def _delayed_symbol(self, symbol: sp.Symbol, delay: sp.Expr) -> sp.Symbol:
        for late, meant in self.late.items():
            if meant == (symbol, delay):
                return late
        others = sum(base is symbol for base, _ in self.late.values())
        name = f"{self.letters.known.get(symbol, symbol.name)}_late{others + 1 if others else ''}"
        late = self.letters.symbol(f"{symbol.name}_late_{others:03d}", name, real=True)
        self.late[late] = (symbol, delay)
        return late

    def _steady_pull(self, name: str, elements: list[Element], integral: bool) -> sp.Expr:
        """Force on a coordinate in steady sliding by springs and integral action; `_pull` includes the dashpots."""
        total = sp.Add(*(-one.acts.get(name, 0) * self.statics.tension(one) for one in elements))
        return self._simplified(total - self._integrated(name, self.statics.integral) if integral else total)

    def _integrated(self, name: str, integral: sp.Expr) -> sp.Expr:
        """Force of integral action on a coordinate; only its steady part if the drive's force is imposed."""
        acting = self.mechanism.integral
        if acting is None or (self.imposed and integral is INTEGRAL):
            return sp.Integer(0)
        return acting.acts.get(name, 0) * acting.gain * integral

    # -- definitions

    def _define(self) -> None:
        """Fill `definitions` with slip rates, then T, τ and σ of the contacts."""
        for site in self.sites:
            if site.velocity not in self.v.values():
                self.definitions[site.velocity] = row_of(site.port.slip, self.moving)
        self.motions = [self._contact_motion(site) for site in self.sites]
        self.normal = [
            of_law(p.port.contact, "normal_stress", m) + p.press for p, m in zip(self.sites, self.motions, strict=True)
        ]
        self.inertial = {
            one.name: one.inertia != 0 or any(law.has(self.a[one.name]) for law in self.normal)
            for one in self.mechanism.coordinates
        }
        if self.single:
            self.definitions[self.sites[0].tau] = self._slider_friction()
        self.definitions |= {site.sigma: law for site, law in zip(self.sites, self.normal, strict=True)}

    def _contact_motion(self, site: SymbolicContact) -> ContactInputs:
        """Arguments of the contact law's methods; T, the pull on the body per contact area, is defined too."""
        port, body = site.port, next(name for name in site.port.slip if name != LOAD_POINT)
        belt = LOAD_POINT in port.slip  # the body slides on the moving load point and is held by links to the ground
        pulling = self.mechanism.pulling(port)
        if port.loaded_by:
            body = next(name for name in port.slip if name in pulling[0].acts)
        lever, integral = port.slip[body] * port.area, not (belt or port.loaded_by)
        steady = self._steady_slider_pull() if self.single else self._steady_pull(body, pulling, integral) / lever
        moving = sp.Add(*(-one.acts.get(body, 0) * self._tension(one, {}, self.speeds) for one in pulling)) / lever
        self.definitions[site.spring] = steady + self._pull(body, pulling, integral) / lever
        behind = (
            pulling
            if port.loaded_by
            else [one for one in pulling if (one.grounded if belt else LOAD_POINT in one.senses)]
        )
        stiffness = sp.Add(*(sp.sympify(e.acts.get(body, 0) * e.stiffness * e.senses.get(body, 0)) for e in behind))
        distance = self._simplified(row_of(port.separation, self.statics.displacement)) if port.separation else 0
        apart = distance + row_of(port.separation, self.x)
        return self._motion(site, steady + moving, stiffness / (lever * port.slip[body]), apart, distance)

    def _steady_slider_pull(self) -> sp.Expr:
        """Pull on a slider's block in steady sliding per area (Pa): friction plus the force of grounded elements."""
        (site,), (body,) = self.sites, self.mechanism.coordinates
        held = sp.Add(*(self._tension(one, {}, self.speeds) for one in self._grounded()))
        return site.tau_ss + (held - body.force) / site.port.area

    def _grounded(self) -> list[Element]:
        return [one for one in self.mechanism.elements if one.grounded]

    def _slider_friction(self) -> sp.Expr:
        """Friction stress τ of a slider from the balance of forces."""
        (site,), (body,) = self.sites, self.mechanism.coordinates
        held = -sp.Add(*(self._tension(one, self.x, self.moving) for one in self._grounded()))
        found = site.spring + (held + body.force - body.inertia * self.a[body.name]) / site.port.area
        return found + self.push[body.name] / site.port.area

    def _balance(self, name: str, inertia: Any) -> sp.Expr | None:
        """Balance of forces of a coordinate: inertia minus changes of forces from steady sliding; None for a slider."""
        if self.single:
            return None
        total = inertia * self.a[name] - self._pull(name, list(self.mechanism.elements)) - self.push[name]
        for one in self.mechanism.elements:  # springs balance the steady force of dashpots
            total -= one.acts.get(name, 0) * self._tension(one, {}, self.speeds)
        for site in self.sites:
            area = site.port.area
            total += site.port.slip.get(name, 0) * area * (site.tau - site.tau_ss)
            total -= site.port.separation.get(name, 0) * area * (site.sigma - site.sigma_ss)
        return total

    def _excess_force(self, element: Element) -> sp.Expr:
        """Force in an element of a drive with imposed force, minus that of steady sliding.

        If several elements are parallel (a spring and a controller), the imposed force is assigned to the first of
        them.
        """
        if not self.alternates:
            return -self.loading / element.acts[LOAD_POINT]
        moved = self._tension(element, self.x, self.moving) - self._tension(element, {}, self.speeds)
        held = (self.held + self.loading) / element.acts[LOAD_POINT] if element is self.drive_elements[0] else 0
        return -(1 - self.free) * moved - held
