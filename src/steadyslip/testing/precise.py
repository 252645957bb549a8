"""Symbolic laws evaluated to fifty digits, and comparisons used by all checks.

With fifty digits rounding is negligible: relative to the terms that cancel, the error at the steady state is 1e-40 for
a correct law and far above `TOLERANCE` for a wrong one, so that the tolerance needs no tuning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import mpmath
import sympy as sp

from steadyslip.core.errors import NotAvailable, SteadyslipError
from steadyslip.core.expressions import supported
from steadyslip.core.records import FrozenRecord, parameters, with_values
from steadyslip.laws.contact import ContactInputs

DIGITS = 50  # decimal digits of all evaluations: rounding stays far below `TOLERANCE` after any cancellation
#: Allowed error relative to the terms that cancel: far above rounding at fifty digits and above constants
#: that a law's author typed as ordinary floats, far below any real mistake.
TOLERANCE = mpmath.mpf("1e-9")


class ContractViolation(SteadyslipError, AssertionError):
    """Error: a law breaks a rule of the contract. The message names the rule, the numbers and the remedy."""


def require(condition: Any, law: FrozenRecord, message: str) -> None:
    """Raise `ContractViolation` about `law` unless the condition holds (NaN does not)."""
    if not bool(condition):
        raise ContractViolation(f"{law!r}: {message}")


def symbolic_copy(law: FrozenRecord) -> tuple[Any, dict[sp.Symbol, float]]:
    """Copy of a law with symbols for its parameters, and the number of each symbol; structural zeros stay zero."""
    values: dict[str, Any] = {}
    numbers: dict[sp.Symbol, float] = {}
    for name, address in parameters(law).items():
        if address.value is None:
            continue
        if address.role.structural and address.value == 0:
            values[name] = sp.Integer(0)
            continue
        low = address.role.domain.low
        positive = low == 0 and not address.role.domain.low_allowed
        symbol = sp.Dummy(name.replace(".", "_"), real=True, positive=positive or None, nonnegative=low == 0 or None)
        values[name], numbers[symbol] = symbol, address.value
    return with_values(law, values), numbers


def call_with_symbols(law: FrozenRecord, what: str, method: Callable[..., Any], *arguments: Any) -> Any:
    """SymPy result of a method of a law called with symbols.

    Raises
    ------
    ContractViolation
        If the method does not accept symbols, or uses something that `ContactInputs` does not offer.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", r"ContactInputs\.", DeprecationWarning)
            result = method(*arguments)
    except DeprecationWarning as error:
        raise ContractViolation(f"{law!r}: {what} uses a former name: {error}") from error
    except (TypeError, ValueError, AttributeError, LookupError, sp.SympifyError) as error:
        if isinstance(error, AttributeError) and isinstance(error.obj, ContactInputs):
            offered = ", ".join([*(item.name for item in fields(ContactInputs)), "steady"])
            raise ContractViolation(
                f"{law!r}: {what} uses motion.{error.name}, which does not exist; allowed: {offered}"
            ) from error
        raise ContractViolation(
            f"{law!r}: {what} does not accept SymPy symbols ({type(error).__name__}: {error}); write it with "
            "arithmetic and functions of sympy (sympy.log, not math.log or numpy.log), and branches as sympy.Piecewise"
        ) from error
    if isinstance(result, (tuple, list)):
        return tuple(sp.sympify(item) for item in result)
    return sp.sympify(result)


def require_known_symbols(law: FrozenRecord, what: str, expression: sp.Expr, allowed: Sequence[sp.Symbol]) -> None:
    """Raise `ContractViolation` unless an expression contains only `allowed` symbols and supported functions."""
    foreign = sorted(str(s) for s in expression.free_symbols - set(allowed))
    foreign += sorted(str(d) for d in expression.atoms(sp.Derivative, sp.core.function.AppliedUndef))
    require(
        not foreign,
        law,
        f"{what} contains {', '.join(foreign)}; allowed: the arguments of the method and the law's own parameters. "
        "A rate of change such as that of the normal stress is not among them: choose memory variables that stay "
        "continuous when velocity and normal stress jump, such as Θ + (α/b) ln σ",
    )
    try:
        supported(expression, what)
    except NotAvailable as error:
        raise ContractViolation(f"{law!r}: {error}") from error


def precise_function(
    law: FrozenRecord, arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]
) -> Callable[..., list[mpmath.mpf]]:
    """Function of numbers that returns the values of the expressions to fifty digits, NaN where not real."""
    names = {symbol: sp.Symbol(f"p{i}") for i, symbol in enumerate(arguments)}
    renamed = [sp.sympify(e).xreplace(names) for e in expressions]
    own = {"asinh_exp": lambda x, y: mpmath.asinh(x * mpmath.exp(y))}

    def unusable(error: Exception) -> ContractViolation:
        return ContractViolation(
            f"{law!r}: an equation cannot be evaluated ({str(error).splitlines()[0]}); allowed: elementary functions "
            "of sympy and steadyslip.core.expressions.asinh_exp"
        )

    try:
        compiled = sp.lambdify(list(names.values()), renamed, modules=[own, "mpmath"])
    except (NotImplementedError, ValueError) as error:
        raise unusable(error) from error

    def function(*numbers: Any) -> list[mpmath.mpf]:
        with mpmath.workdps(DIGITS):
            try:
                values = [mpmath.mpmathify(value) for value in compiled(*map(_precise, numbers))]
            except (NameError, TypeError) as error:
                raise unusable(error) from error
            except ZeroDivisionError as error:
                raise ContractViolation(
                    f"{law!r}: an equation divides by zero at {[format_number(n) for n in numbers]}"
                ) from error
            return [mpmath.nan if isinstance(value, mpmath.mpc) else value for value in values]  # log of -1

    return function


def _precise(number: Any) -> mpmath.mpf:
    """Number as mpf; an mpf is returned as it is, since copying it takes longer than evaluating most equations."""
    return number if type(number) is mpmath.mpf else mpmath.mpf(number)


def disagreement(
    function: Callable[[Any], Any], derivative: Any, at: Any, scale: Any, terms: Any = 0
) -> tuple[mpmath.mpf, mpmath.mpf]:
    """Central difference of a function at a point, and its error against `derivative` in excess of the allowed error.

    The error of a central difference with step h is c h² + O(h⁴); from steps h and h/2 the error of the
    second is a third of their difference. Three times that, and the rounding of fifty digits, is allowed; `terms` is
    the size of terms that may cancel in the function. The second difference f(x+h) − 2f(x) + f(x−h) over h must halve
    with h; else there is a kink, at which a central difference may agree by chance.
    """
    with mpmath.workdps(DIGITS):
        step = mpmath.mpf("1e-8") * scale
        middle = function(at)
        values = {d: function(at + d * step) for d in (-1.0, -0.5, 0.5, 1.0)}
        wide = (values[1.0] - values[-1.0]) / (2 * step)
        narrow = (values[0.5] - values[-0.5]) / step
        size = max(abs(value) for value in values.values()) + abs(derivative * at) + terms
        rounding = 10**6 * mpmath.eps * size / step  # a million, as terms inside may be larger than the value
        wide_bend = abs(values[1.0] - 2 * middle + values[-1.0]) / step
        narrow_bend = abs(values[0.5] - 2 * middle + values[-0.5]) / (step / 2)
        error = abs(narrow - derivative) - abs(wide - narrow)
        return narrow, max(error, narrow_bend - mpmath.mpf("0.6") * wide_bend) - rounding


def eigenvalues(matrix: Any) -> list[Any]:
    """Eigenvalues of an mpmath matrix as a list; `mpmath.eig` returns another type for a 1 by 1 matrix."""
    return [matrix[0]] if matrix.rows == 1 else list(mpmath.eig(matrix, left=False, right=False))


def format_number(value: Any) -> str:
    """Text of a number with six significant digits."""
    return str(mpmath.nstr(mpmath.mpmathify(value), 6))
