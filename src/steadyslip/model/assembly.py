"""Assembly of the Model from a symbolic Mechanism: variables, rates, contacts, coordinates, steady state, observables.

Sliders and machines are both assembled here, and names that laws add to the results are checked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import sympy as sp

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.roles import Parameter
from steadyslip.core.symbols import Letters
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.mechanism import LOAD_POINT, Element, Mechanism, Shares
from steadyslip.model.equations import HELD, MOVED, TIME, V_LP, Contact, Coordinate, Model, P, Q
from steadyslip.model.forces import INTEGRAL, Forces, SymbolicContact, all_of_law, of_law
from steadyslip.model.statics import row_of
from steadyslip.model.variables import Variable


def assemble(
    mechanism: Mechanism, given: dict[str, sp.Symbol], roles: Mapping[str, Parameter], letters: Letters,
    drive: str = MOVED, order: int = 0,
) -> Model:  # fmt: skip
    """Assemble the Model of a symbolic mechanism.

    Parameters
    ----------
    mechanism : Mechanism
    given : dict of str to sympy.Symbol
        Symbols of the parameters by dotted name.
    roles : mapping of str to Parameter
        Roles of the parameters by dotted name.
    letters : Letters
        Display letters of the parameters; those of other symbols are added.
    drive : str
        `MOVED`, `PULLED` or `EITHER`: the drive moves, its force is imposed, or both alternate.
    order : int
        Number of polynomials that represent each delayed signal in a Model for motion; 0 keeps exact delays.

    Raises
    ------
    NotAvailable
        If an imposed force of the drive would act on several links or contacts.
    """
    return _Assembly(mechanism, letters, drive, order).model(given, roles)


class _Assembly(Forces):
    """Builder of one Model from a mechanism with symbols."""

    def model(self, given: dict[str, sp.Symbol], roles: Mapping[str, Parameter]) -> Model:
        coordinates = tuple(
            Coordinate(
                one.name, self.x[one.name], self.v[one.name], self.a[one.name], sp.sympify(one.inertia),
                sp.sympify(one.speed), self.inertial[one.name], self._balance(one.name, one.inertia), one.unit,
                self.push[one.name], one.inner,
            )
            for one in self.mechanism.coordinates
        )  # fmt: skip
        contacts = tuple(map(self._contact, range(len(self.sites))))
        variables, rates = self._variables(coordinates, contacts)
        disturbances = {"disturbance": Q, "normal_disturbance": P}
        if not self.bare:
            disturbances = {f"{one.name}.push": one.push for one in coordinates}
            disturbances |= {f"{one.name}.press": one.press for one in contacts}
        disturbances |= {f"{one.name}.pores": one.outside for one in contacts if one.outside is not None}
        if self.imposed:
            disturbances["loading"] = self.loading
        if self.alternates:
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
            late_signals=tuple(self.past),
            letting_go=self.letting_go,
            carried=None if self.single else self.statics.carried,
            points=self.mechanism.points,
        )

    def _contact(self, i: int) -> Contact:
        site, motion = self.sites[i], self.motions[i]
        friction, contact = site.port.friction, site.port.contact
        own = f"{site.port.name}." if site.port.name else ""
        units, meanings = friction.memory_units(), friction.meanings()
        at = f" (at {site.port.name})" if site.port.name and len(self.sites) > 1 else ""
        remembered = zip(friction.memory(), site.memory, units, strict=True)
        inertial = self.single and self.inertial[self.mechanism.coordinates[0].name]
        own_unknown = site.acceleration if inertial else site.velocity
        load = contact.load()
        return Contact(
            name=site.port.name,
            slip=site.slip,
            velocity=site.velocity,
            acceleration=site.acceleration,
            spring=site.spring,
            friction=site.tau,
            normal=site.sigma,
            memory=tuple(
                Variable(f"{own}{n}", s, unit, f"{meanings.get(n, 'memory of friction')}{at}", "memory")
                for n, s, unit in remembered
            ),
            own_states=tuple(
                Variable(f"{own}{n}", s, unit, "state of the contact", "state")
                for n, s, unit in zip(contact.memory(), site.states, contact.memory_units(), strict=True)
            ),
            balance=self._strength(site) - site.tau,
            unknown=own_unknown if self.single else site.tau,
            sigma_ss=site.sigma_ss,
            steady_stress=of_law(contact, "normal_stress", motion.steady),
            steady_coupling=of_law(contact, "coupling", motion.steady),
            steady_load=None if load is None else sp.sympify(load),
            imposed=sp.sympify(contact.imposed(TIME)),
            direction=sp.sympify(friction.direction(site.velocity, site.speed)),
            area=sp.sympify(site.port.area),
            press=site.press,
            outside=site.outside if contact.has_pores() else None,
        )

    def _strength(self, site: SymbolicContact) -> sp.Expr:
        """Friction stress by the friction law, with the delayed slip rate if the law has a delay."""
        law, now = site.port.friction, (site.sigma, site.memory, site.tau)
        delay = law.lateness()
        if delay == 0:
            return of_law(law, "strength", site.velocity, *now)
        if self.order:
            late = self._late(row_of(site.port.slip, self.moving), site.speed, delay, "m/s")
        else:
            late = row_of(site.port.slip, self._delayed(delay, self.moving))
        return of_law(law, "late_strength", site.velocity, late, *now)

    def _variables(
        self, coordinates: tuple[Coordinate, ...], contacts: tuple[Contact, ...]
    ) -> tuple[tuple[Variable, ...], tuple[sp.Expr, ...]]:
        """Differential variables and their rates: for coordinates, memory, the controller's integral, the held force
        of the drive."""
        variables: list[Variable] = []
        rates: list[sp.Expr] = []
        for one, body in zip(coordinates, self.mechanism.coordinates, strict=True):
            name, what = ("", "of the block") if self.bare else (f"{one.name}.", f"of {one.words}")
            share = sp.sympify(body.speed) / self.mechanism.velocity
            doc = f"{'slip' if self.bare else 'displacement'} {what} {_AHEAD_OF.get(share, AHEAD_OF_STEADY)}"
            variables.append(Variable(f"{name}x", one.displacement, one.unit, doc, "slip"))
            rates.append(one.velocity - share * V_LP)
            if one.inertial:
                variables.append(Variable(f"{name}v", one.velocity, f"{one.unit}/s", f"velocity {what}", "velocity"))
                rates.append(one.acceleration)
        for contact, site, motion in zip(contacts, self.sites, self.motions, strict=True):
            variables += [*contact.memory, *contact.own_states]
            now = site.velocity, site.sigma, site.memory, site.tau
            rates += all_of_law(site.port.friction, "rates", len(site.memory), *now)
            rates += all_of_law(site.port.contact, "rates", len(site.states), motion)
        integral = self.mechanism.integral
        if integral is not None:
            what = "time integral of x (controller)" if self.single else "time integral of the controller's error"
            unit = next(one.unit for one in self.mechanism.coordinates if one.name in integral.acts)
            variables.append(Variable("integral", INTEGRAL, f"{unit} s", what, "integral"))
            rates.append(self._controller_error(integral.senses))
        if self.alternates:
            what = "force of the drive that its motion does not make"
            variables.append(Variable(HELD, self.held, "Pa" if self.bare else "N", what, "held"))
            rates.append(sp.Integer(0))
        for past in self.past:
            variables += past.variables
            rates += past.rates
        return tuple(variables), tuple(rates)

    def _controller_error(self, senses: Shares) -> sp.Expr:
        """Error that a controller integrates.

        0 while the drive is released, and afterwards relative to the place reached.
        """
        found = row_of(senses, self.x)
        if not self.alternates:
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
        for site, motion in zip(self.sites, self.motions, strict=True):
            found[site.velocity] = site.speed
            found |= {site.spring: sp.sympify(motion.steady_spring), site.tau: site.tau_ss}
            found[site.sigma] = site.sigma_ss
            steady = site.speed, site.sigma_ss
            memory = all_of_law(site.port.friction, "steady_memory", len(site.memory), *steady)
            found |= dict(zip(site.memory, memory, strict=True))
            found |= dict(zip(site.states, motion.steady_memory, strict=True))
        found |= {late: found[symbol] for late, (symbol, _) in self.late.items()}
        found |= {symbol: zero for past in self.past for symbol in past.symbols}
        without = (*self.push.values(), *(one for site in self.sites for one in (site.press, site.outside)))
        own = [self.loading] * self.imposed + ([self.free, self.held] if self.alternates else [])
        none = dict.fromkeys((*without, *own), zero)
        return found | {V_LP: sp.sympify(self.mechanism.velocity)} | none

    def _observables(self) -> dict[str, tuple[sp.Expr, str]]:
        """Expression and SI unit of each named result; stresses for a slider, forces for contacts of a machine."""
        tables: list[tuple[str, Observables]] = []
        for one in self.mechanism.coordinates:
            if one.inner:
                continue
            own = "" if self.bare else f"{one.name}."
            moving = {f"{own}x": (self.x[one.name], one.unit), f"{own}v": (self.v[one.name], f"{one.unit}/s")}
            tables.append(("the block" if self.bare else one.name, moving))
        for name, row in self.mechanism.points.items():
            moved, pace = row_of(row, self.x), row_of(row, self.v)
            tables.append((name, {f"{name}.x": (moved, "m"), f"{name}.v": (pace, "m/s")}))
        tables += [("the equations", self._contact_observables(site)) for site in self.sites]
        laws = [one for site in self.sites for one in self._law_observables(site)]
        tables += [(owner, seen) for owner, _, seen in laws]
        tables += [(element.name, self._link_force(element)) for element in self.mechanism.elements if element.name]
        every = merge_observables([*tables, *((owner, remembered) for owner, remembered, _ in laws)])
        return {name: every[name] for _, table in tables for name in table}

    def _contact_observables(self, site: SymbolicContact) -> Observables:
        """Observables of every contact: friction coefficient, friction and normal stress or force."""
        own, area = (f"{site.port.name}.", site.port.area) if site.port.name else ("", 1)
        words = ("friction_force", "normal_force") if own else ("shear_stress", "normal_stress")
        unit = "N" if own else "Pa"
        seen = {
            f"{own}friction": (site.tau / site.sigma, "1"),
            own + words[0]: (area * site.tau, unit),
            own + words[1]: (area * site.sigma, unit),
        }
        if not own:
            seen["spring_stress"] = (site.spring, "Pa")
        return seen

    def _law_observables(self, site: SymbolicContact) -> list[tuple[str, Observables, Observables]]:
        """Observables that the laws of a contact declare: for each law a description, its memory, and its
        observables."""
        port, own = site.port, f"{site.port.name}." if site.port.name else ""
        stated = port.friction.observables(site.velocity, site.sigma, site.memory, site.tau)
        found: list[tuple[str, Observables, Observables]] = []
        for kind, law, symbols in (
            ("friction", port.friction, site.memory),
            ("contact", port.contact, site.states),
        ):
            remembered = dict(zip(law.memory(), zip(symbols, law.memory_units(), strict=True), strict=True))
            seen = remembered if kind == "contact" else {n: (sp.sympify(e), unit) for n, (e, unit) in stated.items()}
            check_names(f"contacts.{own}{kind}" if own else kind, law, [*law.memory(), *(seen.keys() - remembered)])
            kept, shown = ({f"{own}{name}": one for name, one in table.items()} for table in (remembered, seen))
            found.append((f"the {kind} law of {port.name}" if own else f"the {kind} law", kept, shown))
        return found

    def _link_force(self, element: Element) -> Observables:
        """Observable of a link: the force (N) or torque (N m) with which its first end pulls the second."""
        resting = self._simplified(self.statics.tension(element))
        twisted = all(one.unit == "rad" for one in self.mechanism.coordinates if one.name in element.acts)
        force = -resting - self._tension(element, self.x, self.moving)
        if self.imposed and LOAD_POINT in element.senses:
            force = -resting - self._tension(element, {}, self.speeds) + self._excess_force(element)
        return {f"{element.name}.force": (force, "N m" if twisted else "N")}


RESERVED_NAMES = {
    "t": "the time", "time": "the time", "x": "the lead of a block over steady sliding", "v": "the velocity",
    "acceleration": "the acceleration", "displacement": "the displacement of a body", "slip": "the slip",
    "slip_rate": "the slip rate", "load_velocity": "the velocity of the load point",
    "load_displacement": "the displacement of the load point", "disturbance": "the stress that pushes the block",
    "normal_disturbance": "the normal stress that a protocol adds", "injection": "the pressure of an injection",
    "creep": "1 while a creep test releases the drive", "integral": "the integral of a controller's error",
    "friction": "the friction coefficient", "shear_stress": "the friction stress", "normal_stress": "the normal stress",
    "spring_stress": "the stress of the spring", "friction_force": "the friction force",
    "normal_force": "the normal force", "force": "the force of a link",
}  # fmt: skip
"""Names that results of every rig use, with their meanings; laws cannot use them."""
_AHEAD_OF = {sp.Integer(0): "beyond its place in steady sliding", sp.Integer(1): "ahead of the load point"}
"""Phrases for the reference of a displacement, by the ratio of steady speed to the speed of the load point."""
AHEAD_OF_STEADY = "ahead of its steady motion with the load point"
EVENTS = "event_"  # prefix of the columns that mark events in the files of simulated runs

Observables = Mapping[str, tuple[sp.Expr, str]]


def check_names(place: str, law: FrictionLaw | ContactLaw, names: Iterable[str]) -> None:
    """Check names of memory variables, states and observables of a law against reserved names and duplicates.

    Raises
    ------
    ParameterError
        Listing all invalid names.
    """
    owner, problems = type(law).name or type(law).__name__, []
    given = list(names)
    for name in dict.fromkeys(given):
        if name in RESERVED_NAMES or name.startswith(EVENTS):
            what = RESERVED_NAMES.get(name, "a column on events")
            named = f"law {owner!r} calls a memory, state or observable {name!r}"
            problems.append(f"{named}, which in the results of every rig is {what}")
        elif given.count(name) > 1:
            problems.append(f"law {owner!r} calls two memories or states {name!r}")
        elif not name.isidentifier():
            problems.append(f"law {owner!r} calls a memory, state or observable {name!r}; allowed: letters, digits, _")
    if problems:
        raise ParameterError([Problem(place, f"{one}; rename it in the law") for one in problems])


def merge_observables(tables: Iterable[tuple[str, Observables]]) -> dict[str, tuple[sp.Expr, str]]:
    """One table of the observables of several owners; observables with equal names must be equal.

    Raises
    ------
    ParameterError
        If two observables that differ have the same name.
    """
    found: dict[str, tuple[sp.Expr, str]] = {}
    owners: dict[str, str] = {}
    problems = []
    for owner, table in tables:
        for name, seen in table.items():
            if found.setdefault(name, seen) != seen:
                message = f"is the name of two observables, of {owners[name]} and of {owner}; rename one in its law"
                problems.append(Problem(name, message))
            owners.setdefault(name, owner)
    if problems:
        raise ParameterError(problems)
    return found
