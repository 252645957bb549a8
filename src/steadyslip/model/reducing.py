"""Reduction of a Model to explicit rates: assignment of equations to unknowns, and solution for velocities.

Each contact has a velocity variable w, which replaces the velocity of one body (`kinematics.py`). The balance of forces
of a coordinate with inertia determines its acceleration. Without inertia it determines the slip rate of the contact
that acts there, in one of three forms:

- *eliminated*: logarithmic laws. ln v is integrated, and one memory variable follows from the balance, which is linear
  in it; no equation has to be solved numerically, and the balance cannot drift.
- *explicit*: the balances have a closed solution for the velocity variables.
- *implicit*: Newton's method solves the balances for the velocity variables at every evaluation.

Accelerations have a closed form if the balances are linear in them; friction stresses have one if the law is linear in
the normal force that depends on them. All remaining unknowns are solved for together by Newton's method.

The balance of a massless coordinate without contact is linear; it is solved for the velocity or, without a dashpot, for
the displacement.

The velocity variable w is ln(v/v0) if the law is singular at rest, the argument of the regularised law's asinh if it
has one (exact through rest and reversal), and v otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import InternalError, NotAvailable
from steadyslip.core.expressions import derivative, replaced
from steadyslip.core.symbols import inner_symbol
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.model.dead_time import USUAL_ORDER
from steadyslip.model.equations import Contact, Coordinate, Model
from steadyslip.model.kinematics import in_variables, kinematics, solve_jointly, solve_sequentially
from steadyslip.model.reduction import JUMP, SPEED, TIME, V_LP, Reduction, Sliding, channels_for, slope_of

Replacements = dict[sp.Symbol, sp.Expr]
Equations = list[tuple[sp.Expr, sp.Symbol]]
EVERYWHERE = "*"
"""Name meaning that a disturbance acts on every coordinate, or at every contact, with a constant share for each."""
FREE, SWITCH = f"{LOAD_POINT}.free", f"{LOAD_POINT}.switch"
"""Names of disturbance channels of a released drive. FREE: 1 while the force is imposed, else 0. SWITCH: nonzero at
segments where FREE changes, 1 to keep the present force, 2 to take the imposed force."""
PORES = ".pores"
"""Suffix of a contact's name: the channel changes the surrounding pore pressure instead of the normal stress."""
STANDSTILL = -200
"""Lower bound of ln(v/v0) in the rates of blocks with mass: v is far below any velocity of interest, and powers of 1/v
up to the third stay below 1e308."""


@cached
def reduce_model(
    model: Model,
    eliminate: int | tuple[int | None, ...] | None = 0,
    pushes: tuple[str, ...] = (),
    presses: tuple[str, ...] = (),
    order: int = USUAL_ORDER,
) -> Reduction:
    """Choose the variables of a Model and derive their rates.

    Parameters
    ----------
    model : Model
    eliminate : int or tuple of int, optional
        Index of the memory variable (of its contact) that follows from the balance if the form *eliminated* is
        possible; one index for all contacts or one for each. None forbids that form, for variables of little weight in
        friction.
    pushes, presses : tuple of str, optional
        Names of the coordinates on which disturbances act, and of the contacts with added normal stress, one channel
        each; or `EVERYWHERE`. `pushes` may contain `steadyslip.machine.mechanism.LOAD_POINT`, `presses` a contact's
        name with `PORES` appended. A slider needs no names.
    order : int, optional
        Number of variables of each late signal, if the model has delays.

    Raises
    ------
    NotAvailable
        If the equations cannot be brought into one of the three forms.
    """
    model = model if model.for_motion is None else model.for_motion(order)
    each = eliminate if isinstance(eliminate, tuple) else (eliminate,) * len(model.contacts)
    return _Reducer(model, pushes, presses).reduction(each)


@cached
def can_eliminate(model: Model, index: int, which: int) -> bool:
    """True if memory variable `which` of contact `index` can be eliminated by the balance of forces."""
    model = model if model.for_motion is None else model.for_motion(USUAL_ORDER)
    return _Reducer(model, (), ()).eliminated_memory(index, which) is not None


class _Reducer:
    """Builder of one Reduction."""

    def __init__(self, model: Model, pushes: tuple[str, ...], presses: tuple[str, ...]) -> None:
        self.model, self.moving = model, kinematics(model)
        self.channels = channels_for(len(pushes), len(presses))
        self.given = _inputs(model, self.channels, pushes, presses)
        self.memory = tuple(item.symbol for item in (*model.memory, *model.states))
        self.integrals = tuple(item.symbol for item in model.integrals)
        self.rest = (*self.integrals, *model.held, *(item.symbol for item in model.past))
        owner = {s.symbol: contact for contact in model.contacts for s in (*contact.memory, *contact.own_states)}
        speeds = {contact.velocity for contact in model.contacts}
        self.definitions = {
            s: self._variables(e, self._of(s)) for s, e in model.definitions.items() if s not in speeds
        }  # fmt: skip
        self.balances = [self._variables(contact.balance, contact) for contact in model.contacts]
        self.rates = {symbol: self._variables(rate, owner.get(symbol)) for symbol, rate in model.rate_of.items()}
        self.found: Replacements = {}
        self._solve_frictions()
        self._solve_massless()

    def _of(self, stress: sp.Symbol) -> Contact | None:
        return next((c for c in self.model.contacts if stress in (c.spring, c.friction, c.normal)), None)

    def _variables(self, expression: sp.Expr, contact: Contact | None) -> sp.Expr:
        """The expression with channels in place of inputs, velocity variables, and the smooth replacement of
        sign(v)."""
        expression = expression.xreplace(self.given)
        if contact is not None:
            v, direction = contact.velocity, contact.direction
            expression = expression.replace(sp.sign, lambda argument: direction.xreplace({v: argument}))
        return in_variables(expression, self.moving, self.model)

    def inlined(self, expression: sp.Expr) -> sp.Expr:
        """The expression with T, τ, σ and the displacements or velocities of massless coordinates substituted."""
        return replaced(self.model.inlined(expression, self.definitions), self.found)

    # -- assignment of equations

    def _force_balance(self, coordinate: Coordinate) -> sp.Expr:
        if coordinate.balance is None:  # the only balance of a slider is that of its contact
            return self.balances[0]
        return self._variables(coordinate.balance, None)

    def _solve_frictions(self) -> None:
        """Solve the friction law (without inertia the balance of forces) for each unknown friction stress."""
        equations = []
        for i, contact in enumerate(self.model.contacts):
            if contact.friction in self.model.definitions:
                continue
            place = self.moving.coordinates[i]
            light = place is not None and not place.inertial
            balance = self._force_balance(place) if place is not None and light else self.balances[i]
            equations.append((self.inlined(balance), contact.friction))
        found, self.frictions = solve_sequentially(equations)
        self.definitions = found | self.definitions  # substituted last

    def _reject(self, why: str) -> None:
        raise NotAvailable(f"motion is not offered for this machine yet: {why}; give its bodies mass, or other laws")

    def _solve_massless(self) -> None:
        """Solve for velocities or displacements of massless coordinates whose velocity no contact variable replaces."""
        places = [one for one in self.model.coordinates if not one.inertial and self.moving.contact_at(one) is None]
        equations = []
        for one in places:
            balance = self.inlined(self._force_balance(one))
            equations.append((balance, one.velocity if balance.has(one.velocity) else one.displacement))
        self._check_release(equations)
        found, left = solve_sequentially(equations)
        if left or any(e.has(*(c.acceleration for c in self.model.coordinates)) for e in found.values()):
            names = ", ".join(one.name for one in places)
            self._reject(f"{names} has no mass, and what holds it there does not say how it moves")
        followed = [one for one in places if one.displacement in found]
        if any(found[one.displacement].has(*(s for _, s in self.frictions)) for one in followed if self.frictions):
            self._reject("friction that changes its own normal force displaces a body without mass at once")
        for one in followed:
            found[one.velocity] = self._dependent_velocity(one, found)
        self.found = found

    def _check_release(self, equations: Equations) -> None:
        """Raise NotAvailable if a released drive would leave a massless coordinate undetermined."""
        free = self.given.get(self.model.inputs["free"]) if "free" in self.model.inputs else None
        for balance, symbol in equations if free is not None else ():
            if derivative(balance, symbol).xreplace({free: sp.Integer(1)}) == 0:
                self._reject("the motion of a body without mass is set by the drive alone, which this run releases")

    def _dependent_velocity(self, one: Coordinate, found: Replacements) -> sp.Expr:
        """Velocity of a coordinate whose displacement is a function of other displacements."""
        place = found[one.displacement]
        drift = self.rates[one.displacement].xreplace({one.velocity: sp.Integer(0)})
        terms = [derivative(place, s) * rate for s, rate in self.rates.items() if s is not one.displacement]
        terms += self._in_time(place)
        return (sp.Add(*terms) - drift).xreplace(found)

    # -- rates

    def reduction(self, eliminate: tuple[int | None, ...]) -> Reduction:
        """Make the Reduction."""
        model = self.model
        heavy = [one for one in model.coordinates if one.inertial]
        light = [i for i in range(len(model.contacts)) if self._is_light(i)]
        self._solve(heavy, light, eliminate)
        places = tuple(one.displacement for one in self._independent())
        speeds = tuple(self._speed_of(one) for one in heavy)
        own = tuple(w for _, w in self.light) if self.eliminated else ()
        memory = tuple(symbol for symbol in self.memory if symbol not in self.eliminated)
        state = (*places, *own, *speeds, *memory, *self.rest)
        continuous = (*places, *speeds, *self.memory, *self.rest)
        self._solve_rates(heavy)
        rates = {symbol: self._in_state(self.raw[symbol]) for symbol in state}
        for i, variable in enumerate(self.moving.variables):
            if variable is not None and variable.kind == "logarithm" and i not in light:
                rates = {symbol: _bounded_rate(rate, variable.w) for symbol, rate in rates.items()}
        return Reduction(
            model=model,
            form="eliminated" if self.eliminated else "implicit" if self.unknowns else "explicit",
            state=state,
            names=self._names_of(state),
            continuous=continuous,
            rates=tuple(rates[s] for s in state),
            unknowns=tuple(symbol for _, symbol in self.unknowns),
            residuals=tuple(residual for residual, _ in self.unknowns),
            restarts=self._restarts(),
            restored=tuple(map(self._in_state, continuous)) if self.eliminated else continuous,
            slidings=tuple(map(self._sliding, range(len(model.contacts)))),
            shifts=tuple(one.speed / self._drive for one in self._independent()),
            sped=tuple(self._sped(heavy)),
            further=self._further(),
            channels=self.channels,
            letting_go=self._letting_go(),
        )

    def _sped(self, heavy: list[Coordinate]) -> Iterator[tuple[sp.Symbol, sp.Expr]]:
        """Velocity variables that a jump of the load point's velocity changes, with their values after the jump."""
        drive = self.model.inputs["load_velocity"]
        for i in (self.moving.contact_at(one) for one in heavy):
            if i is None or (variable := self.moving.variables[i]) is None:
                continue
            velocity = self.model.contacts[i].velocity
            share = derivative(sp.sympify(self.model.definitions.get(velocity, velocity)), drive)
            if share == 0:
                continue
            if variable.kind == "logarithm":  # this form is accurate for tiny slip rates
                yield variable.w, variable.w + sp.log(1 + share * JUMP * sp.exp(-variable.w) / variable.scale)
            else:
                yield variable.w, variable.w_of_v.xreplace({velocity: variable.of_w + share * JUMP})

    def _solve(self, heavy: list[Coordinate], light: list[int], eliminate: tuple[int | None, ...]) -> None:
        """Solve for accelerations, velocities of massless contacts and friction stresses, or make them unknowns."""
        self.accelerations, accelerations = solve_sequentially(
            [(self.inlined(self._force_balance(one)), one.acceleration) for one in heavy]
        )
        self.light = [(replaced(self.inlined(self.balances[i]), self.accelerations), self._w(i)) for i in light]
        self.eliminated = self._eliminated_memories(light, eliminate)
        self.closed: Replacements = {}
        velocities: Equations = []
        if not self.eliminated:
            self.closed, velocities = solve_sequentially(self.light)
        self.others = [*((e.xreplace(self.accelerations), friction) for e, friction in self.frictions), *accelerations]
        self.unknowns = [(self._in_state(residual), symbol) for residual, symbol in (*velocities, *self.others)]

    def _restarts(self) -> tuple[tuple[sp.Symbol, sp.Expr], ...]:
        """Variables solved for after a jump, with their balances, the `unknowns` first.

        Empty without massless contacts.
        """
        if not self.light:
            return ()
        frictions = {contact.friction for contact in self.model.contacts}
        # a balance must rise with its unknown; the friction law minus the friction stress falls, hence the sign
        known = {symbol: -e if symbol in frictions else e for e, symbol in self.others}
        known |= {w: balance for balance, w in self.light}
        return tuple(({symbol: known[symbol] for _, symbol in self.unknowns} | known).items())

    def _is_light(self, index: int) -> bool:
        """True if the contact's variable replaces the velocity of a massless coordinate."""
        place = self.moving.coordinates[index]
        return place is not None and not place.inertial

    def _w(self, index: int) -> sp.Symbol:
        variable = self.moving.variables[index]
        if variable is None:
            raise InternalError("the contact to have a velocity variable")
        return variable.w

    def _speed_of(self, coordinate: Coordinate) -> sp.Symbol:
        """Variable that is integrated in place of the velocity of a coordinate."""
        index = self.moving.contact_at(coordinate)
        return coordinate.velocity if index is None else self._w(index)

    @property
    def _drive(self) -> sp.Expr:
        return self.model.steady[self.model.inputs["load_velocity"]]

    def _independent(self) -> list[Coordinate]:
        """Coordinates whose displacement is not a function of other displacements."""
        return [one for one in self.model.coordinates if one.displacement not in self.found]

    def _eliminated_memories(self, light: list[int], eliminate: tuple[int | None, ...]) -> Replacements:
        """Eliminated memory variables with their expressions; empty unless every massless contact has one."""
        found: Replacements = {}
        for i in light:
            own = self.eliminated_memory(i, eliminate[i])
            if own is None:
                return {}
            found |= own
        return found

    def eliminated_memory(self, index: int, which: int | None) -> Replacements | None:
        """Memory variable of a contact solved from its balance; None if the balance is not linear in the variable."""
        variable, memory = self.moving.variables[index], self.model.contacts[index].memory
        if variable is None or variable.kind != "logarithm" or which is None or which >= len(memory):
            return None
        symbol, balance = memory[which].symbol, self.balances[index]
        slope = derivative(balance, symbol)
        if slope == 0 or slope.has(symbol) or slope.has(variable.w):
            return None
        rest = balance.xreplace({symbol: sp.Integer(0)})
        terms = (-term / slope for term in sp.Add.make_args(rest))
        return {symbol: sp.expand_mul(sp.Add(*terms))}  # expanded, so that ln σ cancels

    def _in_state(self, expression: sp.Expr) -> sp.Expr:
        """The expression as a function of state, inputs and unknowns."""
        if self.eliminated:
            expression = replaced(expression, self.eliminated)
        return replaced(replaced(self.inlined(expression), self.accelerations), self.closed)

    def _solve_rates(self, heavy: list[Coordinate]) -> None:
        """Set the rates of all variables, also of eliminated memory variables and of w that balances determine."""
        self.raw: Replacements = {}
        for symbol in (
            *(one.displacement for one in self._independent()),
            *self.memory,
            *self.rest,
        ):
            self.raw[symbol] = replaced(self.inlined(self.rates[symbol]), self.accelerations)
        for one in heavy:
            if self.moving.contact_at(one) is None:
                self.raw[one.velocity] = replaced(self.inlined(one.acceleration), self.accelerations)
        own = (variable.w for variable in self.moving.variables if variable)
        others = self._coupled_unknowns()
        rates = {
            symbol: inner_symbol(f"{symbol.name}_rate", real=True)
            for symbol in (*own, *(symbol for _, symbol in others))
        }
        placed = {self._w(i): one for i, one in enumerate(self.moving.coordinates) if one is not None and one.inertial}
        self.raw |= {w: rates[w] for w in (*placed, *(symbol for _, symbol in (*self.light, *others)))}
        equations = [self._change(self._velocity(one.velocity)) - self._acceleration(one) for one in placed.values()]
        equations += [self._change(balance) for balance, _ in (*self.light, *others)]
        solved = solve_jointly(equations, [rates[w] for w in rates if w in self.raw])
        self.raw = {symbol: replaced(rate, solved) for symbol, rate in self.raw.items()}

    def _coupled_unknowns(self) -> Equations:
        """Unknown friction stresses and accelerations on which massless velocities depend, directly or indirectly."""
        found: Equations = []
        among = [*(balance for balance, _ in self.light), *self.found.values()]
        while more := [(e, s) for e, s in self.others if (e, s) not in found and any(one.has(s) for one in among)]:
            found += more
            among += [e for e, _ in more]
        return found

    def _change(self, expression: sp.Expr) -> sp.Expr:
        """Total time derivative of an expression in variables and inputs."""
        terms = [derivative(expression, symbol) * rate for symbol, rate in self.raw.items()]
        return sp.Add(*terms, *self._in_time(expression))

    def _in_time(self, expression: sp.Expr) -> list[sp.Expr]:
        """Terms of the time derivative of an expression that are due to changing inputs."""
        terms = [derivative(expression, s) * slope_of(s) for s in self.channels]
        return [*terms, derivative(expression, TIME)]

    def _acceleration_at(self, contact: Contact) -> sp.Expr:
        """Rate of a contact's slip rate: from accelerations if all its coordinates have inertia."""
        slip = sp.sympify(self.model.definitions.get(contact.velocity, contact.velocity))
        moving = [one for one in self.model.coordinates if slip.has(one.velocity)]
        if not all(one.inertial for one in moving):
            return self._change(self._velocity(contact.velocity))
        total = derivative(slip, V_LP) * slope_of(V_LP)
        return total + sp.Add(*(derivative(slip, one.velocity) * self._acceleration(one) for one in moving))

    def _acceleration(self, coordinate: Coordinate) -> sp.Expr:
        if coordinate.inertial:
            return replaced(self.inlined(coordinate.acceleration), self.accelerations)
        return self._change(self._velocity(coordinate.velocity))

    def _velocity(self, symbol: sp.Symbol) -> sp.Expr:
        """Velocity of a coordinate or contact as a function of the variables."""
        return self.inlined(in_variables(symbol, self.moving, self.model))

    # -- outputs

    def _sliding(self, index: int) -> Sliding:
        contact = self.model.contacts[index]
        outputs = {
            "v": self._in_state(self._velocity(contact.velocity)),
            "acceleration": self._in_state(self._acceleration_at(contact)),
            "sigma": self._in_state(contact.normal),
            "tau": self._in_state(contact.friction),
            "T": self._in_state(contact.spring),
        }
        ratio = self.model.steady[contact.velocity] / self._drive
        return Sliding(self.moving.variables[index], outputs, self._in_state(contact.slip), ratio)

    def _further(self) -> dict[str, sp.Expr]:
        """Velocities, accelerations and dependent displacements of a machine's coordinates."""
        found: dict[str, sp.Expr] = {}
        for one in self.model.coordinates if self.model.contacts[0].name else ():
            found[f"{one.name}.v"] = self._in_state(self._velocity(one.velocity))
            found[f"{one.name}.acceleration"] = self._in_state(self._acceleration(one))
            if one.displacement in self.found:
                found[f"{one.name}.x"] = self._in_state(one.displacement)
        return found

    def _letting_go(self) -> tuple[sp.Expr, ...]:
        """Expressions of `Reduction.letting_go`."""
        own = self.model.letting_go
        if own is None:
            return ()
        moves = self.model.inputs["load_velocity"]
        at_rest, dashpot = own.driven.xreplace({moves: sp.Integer(0)}), derivative(own.driven, moves)
        return tuple(self._in_state(self._variables(e, None)) for e in (own.force, at_rest, dashpot, own.steady))

    def _names_of(self, state: tuple[sp.Symbol, ...]) -> tuple[str, ...]:
        names = {item.symbol: item.name for item in self.model.variables}
        for variable, contact in zip(self.moving.variables, self.model.contacts, strict=True):
            if variable is not None:
                names[variable.w] = f"{contact.name}.{SPEED}" if contact.name else SPEED
        return tuple(names[symbol] for symbol in state)


def _inputs(
    model: Model, channels: tuple[sp.Symbol, ...], pushes: tuple[str, ...], presses: tuple[str, ...]
) -> Replacements:  # fmt: skip
    """Replacement of each input of the Model: its channel, its share of the `EVERYWHERE` channel, or zero."""
    _, first_push, first_press, *more = channels
    given: Replacements = {model.inputs["load_velocity"]: V_LP, model.inputs["time"]: TIME}
    behind = max(len(pushes) - 1, 0)
    acting = dict(zip(pushes, (first_push, *more[:behind]), strict=False))
    pressing = dict(zip(presses, (first_press, *more[behind:]), strict=False))
    if model.is_single:  # names of body and contact may be left out, and one kernel serves all protocols
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
        for name, row in model.points.items():
            given[one.push] += acting.get(name, 0) * row.get(one.name, 0)
    for contact in model.contacts:
        pressed = pressing.get(contact.name, sp.Integer(0)) / contact.area
        if EVERYWHERE in pressing:
            pressed = pressing[EVERYWHERE] / contact.area * share_of(contact.press)
        given[contact.press] = pressed + contact.imposed.xreplace({model.inputs["time"]: TIME})
        if contact.outside is not None:
            given[contact.outside] = pressing.get(contact.name + PORES, sp.Integer(0)) / contact.area
    return given


def share_of(input_: sp.Symbol) -> sp.Symbol:
    """Symbol of the constant share with which an `EVERYWHERE` disturbance acts at an input of the Model."""
    return inner_symbol(f"share_of_{input_.name}", real=True)


def _bounded_rate(rate: sp.Expr, w: sp.Symbol) -> sp.Expr:
    """Rate with exp(w) replaced by exp(max(w, `STANDSTILL`)); w outside exponentials is unchanged.

    For a block pulled far less than its strength, the rate would otherwise divide by a velocity that underflows.
    """
    least = sp.Piecewise((w, w > STANDSTILL), (sp.Integer(STANDSTILL), True))
    bounded = inner_symbol("w_bounded", real=True)  # substituted last, so that the condition keeps w itself
    slowed = rate.replace(lambda e: isinstance(e, sp.exp) and e.has(w), lambda e: e.xreplace({w: bounded}))
    return slowed.xreplace({bounded: least})
