"""A Mechanism in symbols to its Model: variables and their rates, contacts, coordinates, steady sliding, observables.

This is the one way in which models come about, of a single block as of many bodies.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from steadyslip.core.roles import Parameter
from steadyslip.core.symbols import Letters
from steadyslip.machine.mechanism import LOAD_POINT, Element, Mechanism, Shares
from steadyslip.model.equations import HELD, MOVED, TIME, V_LP, Contact, Coordinate, Model, P, Q, Variable
from steadyslip.model.forces import INTEGRAL, Forces, SymbolicContact
from steadyslip.model.names import Observables, check_names, joined
from steadyslip.model.statics import row_of


def assemble(
    mechanism: Mechanism, given: dict[str, sp.Symbol], roles: Mapping[str, Parameter], letters: Letters,
    drive: str = MOVED,
) -> Model:  # fmt: skip
    """The Model of a mechanism in symbols.

    Parameters
    ----------
    mechanism : Mechanism
    given : dict of str to sympy.Symbol
        The parameters by dotted name.
    roles : mapping of str to Parameter
        What is declared of them.
    letters : Letters
        Those of the parameters; further ones join them.
    drive : str
        Whether it moves, pulls with a force of its own, or both by turns.

    Raises
    ------
    NotAvailable
        If it is open what a force of the drive does.
    """
    return _Assembly(mechanism, letters, drive).model(given, roles)


class _Assembly(Forces):
    """One pass from a mechanism to its Model."""

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
        if self.by_turns:
            disturbances["free"] = self.free
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
            letters=self.letters.known,
            gain=sp.sympify(self.mechanism.gain),
            axial_share=None if share is None else sp.sympify(share),
            steady=self._steady(coordinates),
            observables=self._observables(),
            late=self.late,
            letting_go=self.letting_go,
            carried=None if self.single else self.statics.carried,
        )

    def _contact(self, i: int) -> Contact:
        place, motion = self.places[i], self.motions[i]
        friction, contact = place.port.friction, place.port.contact
        own = f"{place.port.name}." if place.port.name else ""
        units = friction.memory_units()
        remembered = zip(friction.memory(), place.memory, units, strict=True)
        inertial = self.single and self.inertial[self.mechanism.coordinates[0].name]
        own_unknown = place.acceleration if inertial else place.velocity
        load = contact.load()
        return Contact(
            name=place.port.name,
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
            area=sp.sympify(place.port.area),
            press=place.press,
            outside=place.outside if contact.has_pores() else None,
        )

    def _strength(self, place: SymbolicContact) -> sp.Expr:
        """Friction as its law states it."""
        law, now = place.port.friction, (place.sigma, place.memory, place.tau)
        delay = law.lateness()
        if delay == 0:
            return sp.sympify(law.strength(place.velocity, *now))
        late = row_of(place.port.slip, self._before(delay, self.moving))
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
            law = place.port.friction
            rates += [sp.sympify(e) for e in law.rates(place.velocity, place.sigma, place.memory, place.tau)]
            rates += [sp.sympify(e) for e in place.port.contact.rates(motion)]
        integral = self.mechanism.integral
        if integral is not None:
            what = "time integral of x (controller)" if self.single else "time integral of the controller's error"
            unit = next(one.unit for one in self.mechanism.coordinates if one.name in integral.acts)
            variables.append(Variable("integral", INTEGRAL, f"{unit} s", what, "integral"))
            rates.append(self._sensed(integral.senses))
        if self.by_turns:
            what = "force of the drive that its motion does not make"
            variables.append(Variable(HELD, self.held, "Pa" if self.bare else "N", what, "held"))
            rates.append(sp.Integer(0))
        return tuple(variables), tuple(rates)

    def _sensed(self, senses: Shares) -> sp.Expr:
        """What a controller integrates: nothing while its drive is let go, and then from where the drive goes on."""
        found = row_of(senses, self.x)
        if not self.by_turns:
            return found
        behind = sp.Add(*(share * self.speeds[n] for n, share in senses.items() if n != LOAD_POINT))
        ahead = 0 if self.letting_go is None else self.letting_go.ahead
        return (1 - self.free) * (found - behind / self.mechanism.velocity * ahead)

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
            memory = place.port.friction.steady_memory(place.speed, place.sigma_ss)
            found |= dict(zip(place.memory, map(sp.sympify, memory), strict=True))
            found |= dict(zip(place.states, motion.steady_memory, strict=True))
        found |= {late: found[symbol] for late, (symbol, _) in self.late.items()}
        without = (*self.push.values(), *(one for place in self.places for one in (place.press, place.outside)))
        own = [self.loading] * self.imposed + ([self.free, self.held] if self.by_turns else [])
        none = dict.fromkeys((*without, *own), zero)
        return found | {V_LP: sp.sympify(self.mechanism.velocity)} | none

    def _observables(self) -> dict[str, tuple[sp.Expr, str]]:
        """The named results that every stage shows, with units; totals where contacts have names."""
        tables: list[tuple[str, Observables]] = []
        for one in self.mechanism.coordinates:
            own = "" if self.bare else f"{one.name}."
            moving = {f"{own}x": (self.x[one.name], one.unit), f"{own}v": (self.v[one.name], f"{one.unit}/s")}
            tables.append(("the block" if self.bare else one.name, moving))
        tables += [("the equations", self._observed(place)) for place in self.places]
        laws = [one for place in self.places for one in self._stated(place)]
        tables += [(owner, seen) for owner, _, seen in laws]
        tables += [(element.name, self._carried(element)) for element in self.mechanism.elements if element.name]
        every = joined([*tables, *((owner, remembered) for owner, remembered, _ in laws)])
        return {name: every[name] for _, table in tables for name in table}

    def _observed(self, place: SymbolicContact) -> Observables:
        """What is seen at every contact."""
        own, area = (f"{place.port.name}.", place.port.area) if place.port.name else ("", 1)
        words = ("friction_force", "normal_force") if own else ("shear_stress", "normal_stress")
        unit = "N" if own else "Pa"
        seen = {
            f"{own}friction": (place.tau / place.sigma, "1"),
            own + words[0]: (area * place.tau, unit),
            own + words[1]: (area * place.sigma, unit),
        }
        if not own:
            seen["spring_stress"] = (place.spring, "Pa")
        return seen

    def _stated(self, place: SymbolicContact) -> list[tuple[str, Observables, Observables]]:
        """Of both laws of a contact: whose they are, what they remember, and what they let see."""
        port, own = place.port, f"{place.port.name}." if place.port.name else ""
        stated = port.friction.observables(place.velocity, place.sigma, place.memory, place.tau)
        found: list[tuple[str, Observables, Observables]] = []
        for kind, law, symbols in (
            ("friction", port.friction, place.memory),
            ("contact", port.contact, place.states),
        ):
            remembered = dict(zip(law.memory(), zip(symbols, law.memory_units(), strict=True), strict=True))
            seen = remembered if kind == "contact" else {n: (sp.sympify(e), unit) for n, (e, unit) in stated.items()}
            check_names(f"contacts.{own}{kind}" if own else kind, law, [*law.memory(), *(seen.keys() - remembered)])
            kept, shown = ({f"{own}{name}": one for name, one in table.items()} for table in (remembered, seen))
            found.append((f"the {kind} law of {port.name}" if own else f"the {kind} law", kept, shown))
        return found

    def _carried(self, element: Element) -> Observables:
        """The force in a link."""
        resting = self._known(self.statics.tension(element))
        twisted = all(one.unit == "rad" for one in self.mechanism.coordinates if one.name in element.acts)
        force = -resting - self._tension(element, self.x, self.moving)
        if self.imposed and LOAD_POINT in element.senses:
            force = -resting - self._tension(element, {}, self.speeds) + self._beyond(element)
        return {f"{element.name}.force": (force, "N m" if twisted else "N")}
