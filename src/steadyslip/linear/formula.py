"""Formulas for the critical stiffness of a given rig, or for the edge of stability in another parameter."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from threading import Thread

import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.core.options import checked
from steadyslip.core.symbols import inner_symbol
from steadyslip.linear import cubic
from steadyslip.linear.response import response
from steadyslip.linear.stable_values import is_own_stiffness, name_along
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model, build_model
from steadyslip.model.equations import Contact
from steadyslip.model.linearisation import characteristic_coefficients

LONGEST = 4.0
"""Time limit (s) of each of two simplifications; an expression that takes longer is not simplified."""
LEGIBLE, SHORT = 60, 3
"""Most operations of a formula written as one equation, and of a quantity that gets no letter and equation."""
LARGEST, LONG = 4, 400
"""Limits above which no formula is written: degree of the characteristic polynomial; operations of the formula."""
_LETTERS = {"mu": "mu_ss", "f1": "f_1"} | {f"B{i}": f"B_{i}" for i in range(4)}
MU_SS = sp.Symbol("mu_ss", real=True)
MEANINGS = {
    "k_cr": ("Pa/m", "critical stiffness of the spring along the sliding direction, beside the gain of a controller"),
    "mu_ss": ("1", "friction coefficient in steady sliding"),
    "f": ("Pa s/m", "rise of friction stress with velocity at once, dampings included"),
    "S": ("Pa s/m", "rise of friction stress with velocity in steady sliding, dampings included"),
    "r": ("1/s", "rate at which the memory of friction decays"),
    "f_1": ("1", "rise of friction stress with normal stress at once"),
    "B_0": ("kg/m^2", "rise of normal stress with the acceleration of the block"),
    "B_1": ("Pa s/m", "rise of normal stress with its velocity"),
    "B_2": ("1", "rise of normal stress with the stress of the spring"),
    "B_3": ("Pa/m", "rise of normal stress with its displacement"),
}
"""SI unit and meaning of letters that occur in formulas but not in the equations of a Model."""


@checked()
def formula(rig: Slider | Machine, along: str | None = None) -> sp.Eq:
    """Critical stiffness of a rig with one memory variable as a SymPy equation, or the edge in another parameter.

    Parameters
    ----------
    rig : Slider or Machine
        Only its structure matters: the formula holds for every rig with the same terms.
    along : str, optional
        Dotted name, or a unique last part, of the parameter whose oscillatory edge is written; the stiffness of a
        slider or of a machine's only spring unless given.

    Returns
    -------
    sympy.Eq
        ``k_cr = N/D`` (Pa/m along the sliding direction); with a position controller ``k_cr + kp = N/D``. In
        terms of the rig's parameters, the steady normal stress ``sigma_ss`` and the steady friction coefficient
        ``mu_ss``. Stable above k_cr while D > 0, below while D < 0 (theory 3; eq. 20 corrected). For another
        parameter, or for a machine, the value at which the last but one Hurwitz determinant vanishes;
        `stable_values` tells which side is stable, and whether another Hurwitz condition fails nearer.

    Raises
    ------
    NotAvailable
        If there is no short formula: for the stiffness of a slider with several memory variables, none, or integral
        control; for another parameter if the characteristic polynomial has a degree above four, or the Hurwitz
        determinant does not depend linearly on the parameter. `stable_values` then computes the edge as a number.

    Notes
    -----
    Each of two simplifications by SymPy is stopped after `LONGEST` seconds; the formula is then longer.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.formula(rig).rhs
    sigma_ss*(-a + b)/(d_c*(-alpha*tan(psi) + mu_ss*tan(psi) + 1))
    """
    model, full = build_model(rig), _name(rig, along)
    return _formula(model) if is_own_stiffness(rig, full) else _condition(model, full)


def _name(rig: Slider | Machine, along: str | None) -> str:
    """Dotted name of the parameter `along`; by default a slider's stiffness, or a machine's only stiffness."""
    if along is None and rig.default_along is None:
        springs = [name for name, one in rig.parameters().items() if one.value and one.role.kind == "stiffness"]
        if len(springs) == 1:
            return springs[0]
        example = f"formula(machine, {springs[0]!r})" if springs else "formula(machine, NAME)"
        raise NotAvailable(f"a machine has several stiffnesses; {example} writes the edge in one, where it is short")
    return name_along(rig, along)


@cached
def _condition(model: Model, name: str) -> sp.Eq:
    """Equation for the value of a parameter at which the last but one Hurwitz determinant is zero.

    There two roots are imaginary.
    """
    symbol, c = model.parameters.get(name), tuple(map(model.written, characteristic_coefficients(model)))
    degree, numbers = len(c) - 1, f"; stable_values(rig, {name!r}) gives its edges as numbers"
    if symbol is None:
        raise NotAvailable(f"{name} is not in the equations of this rig")
    if not 1 < degree <= LARGEST:
        raise NotAvailable(
            f"the characteristic polynomial has degree {degree}: no short formula has its edges{numbers}"
        )
    if any(symbol in e.free_symbols for one in model.contacts for e in _stresses(one)):
        raise NotAvailable(f"the steady normal stress depends on {name}, and no short formula has its edges{numbers}")
    symbol = model.written(symbol)
    whole = {2: lambda: c[1], 3: lambda: c[1] * c[2] - c[0] * c[3],
             4: lambda: c[1] * c[2] * c[3] - c[0] * c[3] ** 2 - c[4] * c[1] ** 2}[degree]()  # fmt: skip
    slope = derivative(whole, symbol)
    if slope == 0 or sp.expand(derivative(slope, symbol)) != 0:
        raise NotAvailable(f"the condition of stability does not depend on {name} linearly{numbers}")
    level = whole.xreplace({symbol: sp.Integer(0)})
    found = _in_time(lambda: _shortest(-level, slope), -level / slope)
    if (size := sp.count_ops(found)) > LONG:
        raise NotAvailable(f"the formula of {name} has {size} operations, more than anyone reads{numbers}")
    return sp.Eq(sp.Symbol(f"{symbol}_cr"), found, evaluate=False)


def _stresses(contact: Contact) -> list[sp.Expr]:
    own = (contact.steady_load, contact.steady_coupling, contact.steady_stress)
    return [sp.sympify(one) for one in own if one is not None]


@cached
def _formula(model: Model) -> sp.Eq:
    known = _answers(model)
    friction = model.written(model.steady[model.contact.friction] / model.contact.sigma_ss)
    mu = _in_time(lambda: sp.simplify(friction), friction)
    levels = [model.written(model.parameters[name]) for name in model.with_role("friction level")]
    numerator, denominator = cubic.hopf_line(**known)
    short = _in_time(
        lambda: _shortest(*(_with_mu(part, mu, levels) for part in (numerator, denominator))), numerator / denominator
    )
    return sp.Eq(sp.Symbol("k_cr") + model.written(model.gain), short, evaluate=False)


def _answers(model: Model) -> dict[str, sp.Expr]:
    """Expressions of the small-signal response by name (f, S, r, ...), without the stiffness k."""
    return {name: model.written(value) for name, value in response(model).as_dict().items() if name != "k"}


def formula_in_parts(rig: Slider | Machine, along: str | None = None) -> list[sp.Eq]:
    """Result of `formula` as one equation if short, else with an equation for each letter in it.

    Letters stand for quantities of `small_signal`; only the formula of a slider's stiffness is parted.

    Raises
    ------
    NotAvailable
        In the same cases as `formula`.
    """
    whole = formula(rig, along)
    if sp.count_ops(whole) <= LEGIBLE or not is_own_stiffness(rig, _name(rig, along)):
        return [whole]
    known = _answers(build_model(rig))
    letters = {name: sp.Symbol(_LETTERS.get(name, name), real=True) for name in known}
    letters = {name: letters["mu"] if known[name] == known["mu"] else one for name, one in letters.items()}
    lettered = {name: value for name, value in known.items() if sp.count_ops(value) > SHORT}
    numerator, denominator = cubic.hopf_line(**(known | {name: letters[name] for name in lettered}))
    found = [sp.Eq(whole.lhs, sp.factor_terms(numerator) / sp.factor_terms(denominator), evaluate=False)]
    lines = {letters[name]: value for name, value in lettered.items() if found[0].has(letters[name])}
    return found + [sp.Eq(letter, _gathered(value), evaluate=False) for letter, value in lines.items()]


def _gathered(value: sp.Expr) -> sp.Expr:
    """The sum with common factors taken out of each of its terms; roots and functions are not expanded."""
    kept = [one for one in sp.ordered(value.atoms(sp.Pow, sp.Function)) if one.is_Function or not one.exp.is_Integer]
    names = {one: inner_symbol(f"kept_{i:03d}") for i, one in enumerate(kept)}
    terms = [sp.factor(term) for term in sp.Add.make_args(value.xreplace(names))]
    back = {name: one for one, name in names.items()}
    return min((value, sp.Add(*terms).xreplace(back)), key=sp.count_ops)


class _TooLong(Exception):
    """Raised in the thread of a simplification when its time is over."""


def _in_time(work: Callable[[], sp.Expr], otherwise: sp.Expr) -> sp.Expr:
    """Result of `work`, or `otherwise` if it takes more than `LONGEST` seconds, as SymPy's simplifications may."""
    found: list[sp.Expr] = []
    faults: list[Exception] = []

    def run() -> None:
        try:
            found.append(work())
        except _TooLong:
            pass
        except Exception as error:  # raised again below, in the calling thread
            faults.append(error)

    thread = Thread(target=run, daemon=True)
    thread.start()
    thread.join(LONGEST)
    # SymPy is pure Python, so an exception can be raised in its thread; SymPy may catch it, hence the repetition
    for _ in range(10):
        if thread.is_alive() and thread.ident is not None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(_TooLong))
            thread.join(0.1)
    if faults:
        raise faults[0]
    return found[0] if found else otherwise


def _with_mu(expression: sp.Expr, mu: sp.Expr, levels: list[sp.Symbol]) -> sp.Expr:
    """The expression with the steady friction coefficient `mu` written as mu_ss.

    It is recognised by one of its reference values, `levels`.
    """
    reference = next((symbol for symbol in levels if mu.diff(symbol) == 1), None)
    if reference is None:
        return expression
    return sp.expand(expression.xreplace({reference: MU_SS - (mu - reference)}))


def _shortest(numerator: sp.Expr, denominator: sp.Expr) -> sp.Expr:
    """Quotient with common factors cancelled; numerator and denominator are factored where that is shorter."""
    top, bottom = sp.fraction(sp.cancel(sp.together(numerator / denominator)))
    top, bottom = (min((sp.factor(part), part), key=sp.count_ops) for part in (top, bottom))
    if bottom.subs(dict.fromkeys(bottom.atoms(sp.tan), 0)).could_extract_minus_sign():
        top, bottom = -top, -bottom
    return _without_minus(sp.factor_terms(top)) / _without_minus(sp.factor_terms(bottom))


def _without_minus(product: sp.Expr) -> sp.Expr:
    """The product with a leading minus sign moved into one of its factors that is a sum: b − a for −(a − b)."""
    sign, factors = product.as_coeff_mul()
    sums = [factor for factor in factors if factor.is_Add]
    if sign >= 0 or not sums:
        return product
    rest = [factor for factor in factors if factor is not sums[0]]
    return sp.Mul(-sign, *rest, sp.expand(-sums[0]))
