"""Small-signal response of friction and contact: the quantities in the paper's closed form.

For a law with one memory variable, τ̂ = [f − ĥ(s)] v̂ + [f1 + ĥ1(s)] σ̂ with one rate of decay r (eqs
5-9, 13-16). Instead of the paper's λ and λ1 (infinite for Prakash–Clifton) this uses
S = dτss/dv = −λf and μ = dτss/dσ = λ1 f1, which are finite. S and μ come from the steady state that the law
declares, f, f1 and r from its strength and rate: two independent statements of the law, so the agreement of
this route with the Model's Jacobian checks the law itself.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, Num, derivative
from steadyslip.core.options import checked, slider
from steadyslip.core.pages import Displayed
from steadyslip.linear import cubic
from steadyslip.linear.roots import quietly
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import in_range, require_range, warn_of_range


@dataclass(frozen=True)
class Response(Displayed):
    """Quantities of the paper's cubic, per unit area: SymPy expressions from `response`, numbers from `small_signal`.

    Attributes
    ----------
    f, S
        ∂τ/∂v and dτss/dv at constant σ, dampings c and η included (Pa s/m).
    r
        Rate of decay of the memory (1/s).
    f1, mu
        ∂τ/∂σ at fixed v and memory variable, and dτss/dσ.
    B0, B1, B2, B3
        σ̂ = (B0 s² + B1 s + k B2 + B3) x̂, eq. 12.
    m, k
        Mass, and total stiffness between block and load point.
    """

    f: Num
    S: Num
    r: Num
    f1: Num
    mu: Num
    B0: Num
    B1: Num
    B2: Num
    B3: Num
    m: Num
    k: Num

    def as_dict(self) -> dict[str, Any]:
        """Values by name, as arguments of the functions of `steadyslip.linear.cubic`."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def characteristic_polynomial(self) -> tuple[Num, Num, Num, Num]:
        """a0, a1, a2, a3, lowest power first."""
        return cubic.coefficients(**self.as_dict())

    def critical_stiffness(self) -> Num:
        """N/D, the oscillatory edge in the total stiffness (Pa/m); eq. 20 corrected."""
        known = self.as_dict()
        known.pop("k")
        numerator, denominator = cubic.hopf_line(**known)
        return numerator / denominator

    @property
    def lam(self) -> Num:
        """The paper's λ = −S/f (eq. 15)."""
        return -self.S / self.f

    @property
    def lam1(self) -> Num:
        """The paper's λ1 = μ/f1 (eq. 16)."""
        return self.mu / self.f1


def has_closed_form(model: Model) -> bool:
    """True if the cubic describes the model: one memory variable, no integral control."""
    return model.has_closed_form


@cached
def response(model: Model) -> Response:
    """Small-signal response of a model with one memory variable, as SymPy expressions.

    Raises
    ------
    NotAvailable
        If the model has no memory, several memory variables, or integral control.
    """
    if not has_closed_form(model):
        if not model.is_slider:
            raise NotAvailable("the closed form is one of a Slider; stable_values gives a machine's edges as numbers")
        further = [f"{len(model.memory)} memory variables"] if len(model.memory) != 1 else []
        further += [what for what, there in (("integral control", model.integrals), ("a delay", model.delays),
                                             ("states of its contact", model.states)) if there]  # fmt: skip
        raise NotAvailable(
            "the closed form needs exactly one memory variable, no integral control, no states of the contact and no "
            f"delay; this model has {', '.join(further)}; stable_stiffness gives the edges as numbers"
        )
    contact, memory = model.contact, model.memory[0].symbol
    v, sigma, tau, balance = contact.velocity, contact.normal, contact.friction, contact.balance
    rate = model.rate_of[memory]

    def at_steady(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace(model.steady).doit()

    # the balance is strength(v, σ, memory, τ) − τ = 0; strength contains τ only if the state depends on it
    own = -at_steady(derivative(balance, tau))
    f = at_steady(derivative(balance, v)) / own
    f1 = at_steady(derivative(balance, sigma)) / own
    by_memory = at_steady(derivative(balance, memory)) / own
    r = -(at_steady(derivative(rate, memory)) + at_steady(derivative(rate, tau)) * by_memory)
    v0 = model.parameters["drive.velocity"]
    tau_ss = model.steady[tau]
    slope, mu = derivative(tau_ss, v0), derivative(tau_ss, contact.sigma_ss)
    m, c, eta, k = _mechanics(model)
    b0, b1, b2, b3 = contact_coefficients(model)
    return Response(f + c + eta, slope + c + eta, r, f1, mu, b0, b1, b2, b3, m, k)


def _mechanics(model: Model) -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """m, c, η and k (with the gains of a controller) from the definitions of T and τ."""
    contact = model.contact
    spring, friction = model.definitions[contact.spring], model.definitions[contact.friction]
    return (
        -derivative(friction, contact.acceleration),
        -derivative(spring, contact.velocity),
        -derivative(friction, contact.velocity),
        -derivative(spring, contact.slip),
    )


@cached
def contact_coefficients(model: Model) -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Coefficients B0, B1, B2, B3 of eq. 12 of a contact law linearised at steady sliding.

    If the normal stress depends on friction, τ is expressed by the balance of forces τ = T − ηv − m v̇, which
    gives B0 = −γm and a part of B1 (theory 3, table of mechanisms).
    """
    contact = model.contact
    law = model.definitions[contact.normal]
    m, c, eta, k = _mechanics(model)

    def partial(symbol: sp.Symbol) -> sp.Expr:
        return derivative(law, symbol).xreplace(model.steady).doit()

    by_spring, by_friction = partial(contact.spring), partial(contact.friction)
    through_spring = by_spring + by_friction
    by_slip = partial(contact.slip)
    spring_constant = model.parameters["slider.stiffness"]
    by_stiffness = derivative(by_slip, spring_constant)
    b0 = partial(contact.acceleration) - m * by_friction
    b1 = partial(contact.velocity) - c * through_spring - eta * by_friction
    b2 = by_stiffness - through_spring
    b3 = sp.expand(by_slip - by_stiffness * k)
    return b0, b1, b2, b3


@checked(rig=slider("state_space gives the response of bodies and contacts of a machine to forces"))
@quietly
def small_signal(rig: Slider, vary: Vary | None = None) -> Response:
    """f, S, r, f1, μ and B0...B3 of a rig as numbers.

    Parameters
    ----------
    rig : Slider
        Slider with one memory variable and without integral control.
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary by dotted name, in SI units.

    Returns
    -------
    Response
        Floats, or arrays (DataArrays) over the varied parameters; NaN without steady sliding.

    Raises
    ------
    NotAvailable
        If the rig has no memory variable, several, or integral control; or if the numbers of a single rig leave the
        range of floating point (of several, `OutOfRangeWarning` is issued).

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> found = ss.small_signal(rig)
    >>> round(found.f / 1e9, 3), round(found.S / 1e9, 3)
    (241.667, -25.0)
    """
    point = operating_point(rig, vary)
    numbers = response_numbers(point).as_dict()
    if not point.shape:
        require_range(point)
    known = in_range(point)
    if not np.all(known):
        warn_of_range(int(np.count_nonzero(~known)), point.size)
    wrapped = {}
    for name, x in numbers.items():
        wrapped[name] = point.wrap(np.where(known, x, np.nan)[()], name, _UNITS[name])
    return Response(**wrapped)


def response_numbers(point: OperatingPoint) -> Response:
    """Response of an operating point as numbers or arrays, not wrapped; NaN where steady sliding does not exist."""
    names, function = _response_function(point.model)
    missing = 0 * point.sigma
    return Response(**{name: x + missing for name, x in zip(names, point.evaluate(function), strict=True)})


_UNITS = {"f": "Pa s/m", "S": "Pa s/m", "r": "1/s", "f1": "1", "mu": "1", "B0": "kg/m^2", "B1": "Pa s/m"}
_UNITS |= {"B2": "1", "B3": "Pa/m", "m": "kg/m^2", "k": "Pa/m"}


@cached
def _response_function(model: Model) -> tuple[list[str], ArrayFunction]:
    known = response(model).as_dict()
    return list(known), model.function(known.values())
