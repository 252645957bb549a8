"""From a Model to its Reduction: which equation fixes what, and how velocities are found.

A contact brings a velocity variable w, which takes the place of one velocity of a body (`kinematics.py`). Coordinates
with inertia have accelerations, from their balances of forces. Without inertia the balance fixes the velocity of the
contact that acts there, and `reduce_model` turns that into explicit rates in one of three ways and records which:

- *eliminated*: logarithmic laws. ln v is integrated and one memory variable follows from the balance, which
  is linear in it; no equation is left to solve and nothing can drift.
- *explicit*: the velocity variables have a closed form.
- *implicit*: they are found by Newton's method at every evaluation.

Accelerations follow in closed form where balances are linear in them, and so does friction where a law is linear in the
normal force that it changes itself. Whatever has no closed form is an unknown: all unknowns are found together
(`unknowns.py`).

Where nothing rubs on a coordinate without inertia its balance is linear; it is solved for the velocity or, without a
dashpot, for the displacement.

The velocity variable w is ln(v/v0) where a law is singular at rest, the argument of the regularised law's
asinh where there is one (exact through rest and reversal), v itself otherwise.
"""

from __future__ import annotations

import sympy as sp

from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.core.expressions import derivative, replaced
from steadyslip.core.questions import question
from steadyslip.core.symbols import inner_symbol
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.model.equations import Contact, Coordinate, Model
from steadyslip.model.kinematics import in_variables, kinematics, solved_in_turn, solved_together
from steadyslip.model.reduction import SPEED, TIME, V_LP, Reduction, Sliding, channels_for, slope_of

Replacements = dict[sp.Symbol, sp.Expr]
Equations = list[tuple[sp.Expr, sp.Symbol]]
EVERYWHERE = "*"
"""In place of a name: disturbances act on every coordinate, or at every contact, by a share that is a constant."""
FREE, SWITCH = f"{LOAD_POINT}.free", f"{LOAD_POINT}.switch"
"""In place of the name of what is pushed: whether the drive pulls with a force of its own, 1 or 0; and, where a segment
begins with a change of that, 1 if its force goes on, 2 if it is told what to be."""
PORES = ".pores"
"""Behind the name of a contact: what would press there changes the pressure of the fluid around it."""
STANDSTILL = -200
"""Of ln(v/v0): a block with mass slower than this keeps still to every purpose; products of 1/v stay numbers there."""


@question
def reduce_model(
    model: Model,
    eliminate: int | tuple[int | None, ...] | None = 0,
    pushes: tuple[str, ...] = (),
    presses: tuple[str, ...] = (),
) -> Reduction:
    """Choose the variables of a model and write their rates.

    Parameters
    ----------
    model : Model
    eliminate : int or tuple of int, optional
        Index of the memory variable, among those of its contact, that follows from the balance, where the form
        *eliminated* is possible, for all contacts or each; None forbids that form (the variable's weight in friction is
        zero or tiny).
    pushes, presses : tuple of str, optional
        The coordinates that disturbances push, and the contacts at which they press, a channel each; where there is but
        one of them, that; or `EVERYWHERE`, with shares that are constants. One that is pushed may be
        `steadyslip.machine.mechanism.LOAD_POINT`; one that is pressed, a contact's name with `PORES` behind it.

    Raises
    ------
    NotAvailable
        If the motion cannot be brought into this form.
    """
    each = eliminate if isinstance(eliminate, tuple) else (eliminate,) * len(model.contacts)
    return _Reducing(model, pushes, presses).reduction(each)


@question
def can_eliminate(model: Model, index: int, which: int) -> bool:
    """Whether a memory variable of a contact follows from the balance of forces there."""
    return _Reducing(model, (), ()).victim(index, which) is not None


class _Reducing:
    """One pass from a Model to its Reduction."""

    def __init__(self, model: Model, pushes: tuple[str, ...], presses: tuple[str, ...]) -> None:
        if model.delays:
            raise NotAvailable("motion with a delay is not offered; its verdict is: analyze, stable_values, boundary")
        self.model, self.moving = model, kinematics(model)
        self.channels = channels_for(len(pushes), len(presses))
        self.given = _inputs(model, self.channels, pushes, presses)
        self.memory = tuple(item.symbol for item in (*model.memory, *model.states))
        self.integrals = tuple(item.symbol for item in model.integrals)
        owner = {s.symbol: contact for contact in model.contacts for s in (*contact.memory, *contact.own_states)}
        speeds = {contact.velocity for contact in model.contacts}
        self.definitions = {
            s: self._variables(e, self._of(s)) for s, e in model.definitions.items() if s not in speeds
        }  # fmt: skip
        self.balances = [self._variables(contact.balance, contact) for contact in model.contacts]
        self.rates = {symbol: self._variables(rate, owner.get(symbol)) for symbol, rate in model.rate_of.items()}
        self.found: Replacements = {}
        self._forces()
        self._light()

    def _of(self, stress: sp.Symbol) -> Contact | None:
        return next((c for c in self.model.contacts if stress in (c.spring, c.friction, c.normal)), None)

    def _variables(self, expression: sp.Expr, contact: Contact | None) -> sp.Expr:
        """An expression with its inputs and in the velocity variables; what motion takes for sign(v) put in."""
        expression = expression.xreplace(self.given)
        if contact is not None:
            v, direction = contact.velocity, contact.direction
            expression = expression.replace(sp.sign, lambda argument: direction.xreplace({v: argument}))
        return in_variables(expression, self.moving, self.model)

    def inlined(self, expression: sp.Expr) -> sp.Expr:
        """T, τ and σ replaced by what they are, and what is known of light coordinates put in."""
        return replaced(self.model.inlined(expression, self.definitions), self.found)

    # -- which equation fixes what

    def _force_balance(self, coordinate: Coordinate) -> sp.Expr:
        if coordinate.balance is None:  # that of its contact stands in its place
            return self.balances[0]
        return self._variables(coordinate.balance, None)

    def _forces(self) -> None:
        """Friction of the contacts that have a symbol for it: of the law, or without inertia of the forces."""
        equations = []
        for i, contact in enumerate(self.model.contacts):
            if contact.friction in self.model.definitions:
                continue
            place = self.moving.coordinates[i]
            light = place is not None and not place.inertial
            balance = self._force_balance(place) if place is not None and light else self.balances[i]
            equations.append((self.inlined(balance), contact.friction))
        found, self.frictions = solved_in_turn(equations)
        self.definitions = found | self.definitions  # put in last

    def _refuse(self, why: str) -> None:
        raise NotAvailable(f"motion is not offered for this machine yet: {why}; give its bodies mass, or other laws")

    def _light(self) -> None:
        """Coordinates without inertia on which no contact acts that has its velocity from them."""
        places = [one for one in self.model.coordinates if not one.inertial and self.moving.contact_at(one) is None]
        equations = []
        for one in places:
            balance = self.inlined(self._force_balance(one))
            equations.append((balance, one.velocity if balance.has(one.velocity) else one.displacement))
        self._check_let_go(equations)
        found, left = solved_in_turn(equations)
        if left or any(e.has(*(c.acceleration for c in self.model.coordinates)) for e in found.values()):
            names = ", ".join(one.name for one in places)
            self._refuse(f"{names} has no mass, and what holds it there does not say how it moves")
        followed = [one for one in places if one.displacement in found]
        if any(found[one.displacement].has(*(s for _, s in self.frictions)) for one in followed if self.frictions):
            self._refuse("friction that changes its own normal force displaces a body without mass at once")
        for one in followed:
            found[one.velocity] = self._followed(one, found)
        self.found = found

    def _check_let_go(self, equations: Equations) -> None:
        """Whether what a drive alone holds is held by nothing while the drive is let go."""
        free = self.given.get(self.model.inputs["free"]) if "free" in self.model.inputs else None
        for balance, symbol in equations if free is not None else ():
            if derivative(balance, symbol).xreplace({free: sp.Integer(1)}) == 0:
                self._refuse("the drive alone says how a body without mass moves, and is let go in this run")

    def _followed(self, one: Coordinate, found: Replacements) -> sp.Expr:
        """Velocity of a coordinate whose displacement follows from those of others."""
        place = found[one.displacement]
        drift = self.rates[one.displacement].xreplace({one.velocity: sp.Integer(0)})
        terms = [derivative(place, s) * rate for s, rate in self.rates.items() if s is not one.displacement]
        terms += self._in_time(place)
        return (sp.Add(*terms) - drift).xreplace(found)

    # -- rates

    def reduction(self, eliminate: tuple[int | None, ...]) -> Reduction:
        """Everything put together."""
        model = self.model
        heavy = [one for one in model.coordinates if one.inertial]
        light = [i for i in range(len(model.contacts)) if self._is_light(i)]
        self._find(heavy, light, eliminate)
        places = tuple(one.displacement for one in self._free())
        speeds = tuple(self._speed_of(one) for one in heavy)
        own = tuple(w for _, w in self.light) if self.victims else ()
        memory = tuple(symbol for symbol in self.memory if symbol not in self.victims)
        state = (*places, *own, *speeds, *memory, *self.integrals, *model.held)
        continuous = (*places, *speeds, *self.memory, *self.integrals, *model.held)
        self._raw_rates(heavy)
        rates = {symbol: self._written(self.raw[symbol]) for symbol in state}
        for i, variable in enumerate(self.moving.variables):
            if variable is not None and variable.kind == "logarithm" and i not in light:
                rates = {symbol: _kept_moving(rate, variable.w) for symbol, rate in rates.items()}
        return Reduction(
            model=model,
            form="eliminated" if self.victims else "implicit" if self.unknowns else "explicit",
            state=state,
            names=self._names_of(state),
            continuous=continuous,
            rates=tuple(rates[s] for s in state),
            unknowns=tuple(symbol for _, symbol in self.unknowns),
            residuals=tuple(residual for residual, _ in self.unknowns),
            restarts=self._restarts(),
            restored=tuple(map(self._written, continuous)) if self.victims else continuous,
            slidings=tuple(map(self._sliding, range(len(model.contacts)))),
            shifts=tuple(one.speed / self._drive for one in self._free()),
            further=self._further(),
            channels=self.channels,
            letting_go=self._letting_go(),
        )

    def _find(self, heavy: list[Coordinate], light: list[int], eliminate: tuple[int | None, ...]) -> None:
        """Accelerations, velocities of light contacts and frictions in closed form, or as unknowns."""
        self.pushed, accelerations = solved_in_turn(
            [(self.inlined(self._force_balance(one)), one.acceleration) for one in heavy]
        )
        self.light = [(replaced(self.inlined(self.balances[i]), self.pushed), self._w(i)) for i in light]
        self.victims = self._victims(light, eliminate)
        self.closed: Replacements = {}
        velocities: Equations = []
        if not self.victims:
            self.closed, velocities = solved_in_turn(self.light)
        self.others = [*((e.xreplace(self.pushed), friction) for e, friction in self.frictions), *accelerations]
        self.unknowns = [(self._written(residual), symbol) for residual, symbol in (*velocities, *self.others)]

    def _restarts(self) -> tuple[tuple[sp.Symbol, sp.Expr], ...]:
        """What is solved for after a jump, where there are light contacts: the unknowns first."""
        if not self.light:
            return ()
        frictions = {contact.friction for contact in self.model.contacts}
        known = {symbol: -e if symbol in frictions else e for e, symbol in self.others}  # a law less friction falls
        known |= {w: balance for balance, w in self.light}
        return tuple(({symbol: known[symbol] for _, symbol in self.unknowns} | known).items())

    def _is_light(self, index: int) -> bool:
        """Whether the velocity of a contact stands for that of a coordinate without inertia."""
        place = self.moving.coordinates[index]
        return place is not None and not place.inertial

    def _w(self, index: int) -> sp.Symbol:
        variable = self.moving.variables[index]
        if variable is None:
            raise InternalError("a contact without a velocity variable has none")
        return variable.w

    def _speed_of(self, coordinate: Coordinate) -> sp.Symbol:
        """What is integrated in place of a coordinate's velocity, or that."""
        index = self.moving.contact_at(coordinate)
        return coordinate.velocity if index is None else self._w(index)

    @property
    def _drive(self) -> sp.Expr:
        return self.model.steady[self.model.inputs["load_velocity"]]

    def _free(self) -> list[Coordinate]:
        """Coordinates whose displacement does not follow from those of others."""
        return [one for one in self.model.coordinates if one.displacement not in self.found]

    def _victims(self, light: list[int], eliminate: tuple[int | None, ...]) -> Replacements:
        """Memory variables that follow from the balance, and what they are; none unless every light contact has one."""
        found: Replacements = {}
        for i in light:
            own = self.victim(i, eliminate[i])
            if own is None:
                return {}
            found |= own
        return found

    def victim(self, index: int, which: int | None) -> Replacements | None:
        """A memory variable of a contact from its balance; None where that is not linear in it."""
        variable, memory = self.moving.variables[index], self.model.contacts[index].memory
        if variable is None or variable.kind != "logarithm" or which is None or which >= len(memory):
            return None
        symbol, balance = memory[which].symbol, self.balances[index]
        slope = derivative(balance, symbol)
        if slope == 0 or slope.has(symbol) or slope.has(variable.w):
            return None
        rest = balance.xreplace({symbol: sp.Integer(0)})
        terms = (-term / slope for term in sp.Add.make_args(rest))
        return {symbol: sp.expand_mul(sp.Add(*terms))}  # so that ln σ cancels

    def _written(self, expression: sp.Expr) -> sp.Expr:
        """An expression in state, inputs and unknowns."""
        if self.victims:
            expression = replaced(expression, self.victims)
        return replaced(replaced(self.inlined(expression), self.pushed), self.closed)

    def _raw_rates(self, heavy: list[Coordinate]) -> None:
        """Rates of everything that moves, memory variables that follow from a balance and their w included."""
        self.raw: Replacements = {}
        for symbol in (*(one.displacement for one in self._free()), *self.memory, *self.integrals, *self.model.held):
            self.raw[symbol] = replaced(self.inlined(self.rates[symbol]), self.pushed)
        for one in heavy:
            if self.moving.contact_at(one) is None:
                self.raw[one.velocity] = replaced(self.inlined(one.acceleration), self.pushed)
        own = (variable.w for variable in self.moving.variables if variable)
        others = self._felt()
        rates = {
            symbol: inner_symbol(f"{symbol.name}_rate", real=True)
            for symbol in (*own, *(symbol for _, symbol in others))
        }
        placed = {self._w(i): one for i, one in enumerate(self.moving.coordinates) if one is not None and one.inertial}
        self.raw |= {w: rates[w] for w in (*placed, *(symbol for _, symbol in (*self.light, *others)))}
        equations = [self._change(self._velocity(one.velocity)) - self._acceleration(one) for one in placed.values()]
        equations += [self._change(balance) for balance, _ in (*self.light, *others)]
        solved = solved_together(equations, [rates[w] for w in rates if w in self.raw])
        self.raw = {symbol: replaced(rate, solved) for symbol, rate in self.raw.items()}

    def _felt(self) -> Equations:
        """Unknown frictions and accelerations on which velocities depend that have no inertia."""
        found: Equations = []
        among = [*(balance for balance, _ in self.light), *self.found.values()]
        while more := [(e, s) for e, s in self.others if (e, s) not in found and any(one.has(s) for one in among)]:
            found += more
            among += [e for e, _ in more]
        return found

    def _change(self, expression: sp.Expr) -> sp.Expr:
        """Rate of an expression in what moves and the inputs."""
        terms = [derivative(expression, symbol) * rate for symbol, rate in self.raw.items()]
        return sp.Add(*terms, *self._in_time(expression))

    def _in_time(self, expression: sp.Expr) -> list[sp.Expr]:
        """Its rate through the inputs."""
        terms = [derivative(expression, s) * slope_of(s) for s in self.channels]
        return [*terms, derivative(expression, TIME)]

    def _acceleration_at(self, contact: Contact) -> sp.Expr:
        """Rate of a contact's velocity: by forces, where these accelerate all that moves with it."""
        slip = sp.sympify(self.model.definitions.get(contact.velocity, contact.velocity))
        moving = [one for one in self.model.coordinates if slip.has(one.velocity)]
        if not all(one.inertial for one in moving):
            return self._change(self._velocity(contact.velocity))
        total = derivative(slip, V_LP) * slope_of(V_LP)
        return total + sp.Add(*(derivative(slip, one.velocity) * self._acceleration(one) for one in moving))

    def _acceleration(self, coordinate: Coordinate) -> sp.Expr:
        if coordinate.inertial:
            return replaced(self.inlined(coordinate.acceleration), self.pushed)
        return self._change(self._velocity(coordinate.velocity))

    def _velocity(self, symbol: sp.Symbol) -> sp.Expr:
        """A velocity of a coordinate or a contact in the variables."""
        return self.inlined(in_variables(symbol, self.moving, self.model))

    # -- what comes out

    def _sliding(self, index: int) -> Sliding:
        contact = self.model.contacts[index]
        outputs = {
            "v": self._written(self._velocity(contact.velocity)),
            "acceleration": self._written(self._acceleration_at(contact)),
            "sigma": self._written(contact.normal),
            "tau": self._written(contact.friction),
            "T": self._written(contact.spring),
        }
        ratio = self.model.steady[contact.velocity] / self._drive
        return Sliding(self.moving.variables[index], outputs, self._written(contact.slip), ratio)

    def _further(self) -> dict[str, sp.Expr]:
        """What is observed of coordinates that have names of their own."""
        found: dict[str, sp.Expr] = {}
        for one in self.model.coordinates if self.model.contacts[0].name else ():
            found[f"{one.name}.v"] = self._written(self._velocity(one.velocity))
            found[f"{one.name}.acceleration"] = self._written(self._acceleration(one))
            if one.displacement in self.found:
                found[f"{one.name}.x"] = self._written(one.displacement)
        return found

    def _letting_go(self) -> tuple[sp.Expr, ...]:
        """Of a drive that is let go and moves on."""
        own = self.model.letting_go
        if own is None:
            return ()
        moves = self.model.inputs["load_velocity"]
        at_rest, dashpot = own.driven.xreplace({moves: sp.Integer(0)}), derivative(own.driven, moves)
        return tuple(self._written(self._variables(e, None)) for e in (own.force, at_rest, dashpot, own.steady))

    def _names_of(self, state: tuple[sp.Symbol, ...]) -> tuple[str, ...]:
        names = {item.symbol: item.name for item in self.model.variables}
        for variable, contact in zip(self.moving.variables, self.model.contacts, strict=True):
            if variable is not None:
                names[variable.w] = f"{contact.name}.{SPEED}" if contact.name else SPEED
        return tuple(names[symbol] for symbol in state)


def _inputs(
    model: Model, channels: tuple[sp.Symbol, ...], pushes: tuple[str, ...], presses: tuple[str, ...]
) -> Replacements:  # fmt: skip
    """What stands for the inputs of a Model: a channel where it acts, or a share of it `EVERYWHERE`; else zero."""
    _, first_push, first_press, *more = channels
    given: Replacements = {model.inputs["load_velocity"]: V_LP, model.inputs["time"]: TIME}
    behind = max(len(pushes) - 1, 0)
    acting = dict(zip(pushes, (first_push, *more[:behind]), strict=False))
    pressing = dict(zip(presses, (first_press, *more[behind:]), strict=False))
    if model.is_single:  # it needs no name, and one kernel serves whatever is done to it
        acting = {name or model.coordinates[0].name: s for name, s in (acting or {"": first_push}).items()}
        pressing = pressing or {model.contacts[0].name: first_press}
    if LOAD_POINT in acting:
        given[model.inputs["loading"]] = acting[LOAD_POINT]
    if FREE in acting:
        given[model.inputs["free"]] = acting[FREE]
    for one in model.coordinates:
        given[one.push] = acting.get(one.name, sp.Integer(0))
        if EVERYWHERE in acting:
            given[one.push] = acting[EVERYWHERE] * share_of(one.push)
    for contact in model.contacts:
        pressed = pressing.get(contact.name, sp.Integer(0)) / contact.area
        if EVERYWHERE in pressing:
            pressed = pressing[EVERYWHERE] / contact.area * share_of(contact.press)
        given[contact.press] = pressed + contact.imposed.xreplace({model.inputs["time"]: TIME})
        if contact.outside is not None:
            given[contact.outside] = pressing.get(contact.name + PORES, sp.Integer(0)) / contact.area
    return given


def share_of(input_: sp.Symbol) -> sp.Symbol:
    """The constant that says whether a disturbance acts at an input of a Model, where it may act `EVERYWHERE`."""
    return inner_symbol(f"share_of_{input_.name}", real=True)


def _kept_moving(rate: sp.Expr, w: sp.Symbol) -> sp.Expr:
    """A rate in which the velocity falls no further than to `STANDSTILL`, while friction goes on with ln v.

    Whoever pulls the block back far below its strength would else divide by a velocity beneath floating point.
    """
    least = sp.Piecewise((w, w > STANDSTILL), (sp.Integer(STANDSTILL), True))
    bounded = inner_symbol("w_bounded", real=True)  # put in last: a condition must not be bounded by itself
    slowed = rate.replace(lambda e: isinstance(e, sp.exp) and e.has(w), lambda e: e.xreplace({w: bounded}))
    return slowed.xreplace({bounded: least})
