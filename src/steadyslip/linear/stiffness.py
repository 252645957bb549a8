"""Critical stiffness, stable stiffness, eigenvalues: for one rig or for arrays of any parameters.

Three methods: for rigs with one memory variable the cubic in closed form, which is fast and loses no digits if the mass
is large; for other rigs the Model's characteristic polynomial p(s) + k q(s), split in symbols; with a delay
`linear_sets`, which splits numerically and handles every parameter that enters linearly. Their results agree to
rounding (tests).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.caching import cached
from steadyslip.core.errors import IllPosedWarning, InternalError, UndecidedWarning
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import checked, slider
from steadyslip.core.symbols import inner_symbol
from steadyslip.linear import cubic, matrix_route
from steadyslip.linear.linear_sets import linear_set, most_values, sets_of, too_many_windows_error
from steadyslip.linear.nearness import nearest_end
from steadyslip.linear.polynomials import StableSet, stable_set
from steadyslip.linear.response import Response, has_closed_form, response, response_numbers
from steadyslip.linear.roots import Array, ComplexArray, quietly
from steadyslip.linear.spectrum import among_many, growth, is_ill_posed, spectrum, unstable_roots
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.linearisation import stiffness_split
from steadyslip.model.numeric import by_matrices
from steadyslip.model.point import OperatingPoint, Vary, operating_point, stacked
from steadyslip.model.posed import spare_powers
from steadyslip.model.range import in_range, quasipolynomial, require_range, surely_in_range, warn_of_range
from steadyslip.model.steady import steady_equation

STIFFNESS = "slider.stiffness"
ONE_STIFFNESS = slider("of a machine's stiffnesses safety_factor and stable_values tell, each by its name")
_CHUNK = 32768  # number of rigs computed together: arrays of 256 KiB, so that intermediate results stay in the cache
_LEAST = 1e-290  # smaller products (or larger than the inverse) use the general method; doubles end at 1e-308


@checked(rig=ONE_STIFFNESS)
def critical_stiffness(rig: Slider, vary: Vary | None = None) -> Any:
    """Critical stiffness: the edge of the stable set nearest to the rig's own stiffness.

    Parameters
    ----------
    rig : Slider
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary, by dotted name, in SI units; they broadcast.

    Returns
    -------
    float, ndarray or xarray.DataArray
        Pa/m along the sliding direction; NaN where stability has no edge at a positive stiffness, or under a delay
        none that is known, where steady sliding does not exist, and where numbers leave the range of floating point;
        `stability` tells which.

    Raises
    ------
    ParameterError
        If a name or value is not allowed.
    NotAvailable
        If the numbers of a single rig leave the range of floating point; of several, `OutOfRangeWarning` is issued.

    Notes
    -----
    Eq. 20 of Dupont & Bapna with its errata corrected, or the general route (theory 3). One number is
    never a verdict: see `stable_stiffness`.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> round(ss.critical_stiffness(rig) / 1e9, 3)
    29.07
    >>> (ss.critical_stiffness(rig, {"contact.angle": [-0.5, 0, 0.5]}) / 1e9).round(3)
    array([13.15,  7.5 ,  5.04])
    """
    point = operating_point(rig, vary)
    return point.wrap(in_chunks(point, _nearest_edge), "critical_stiffness", "Pa/m")


def own_safety_factor(point: OperatingPoint) -> Array:
    """Safety factor of sliders, (...): stiffness k + kp over its critical value, with the gain kp of a controller.

    The critical value may be below kp if the gain alone is more than enough. With a delay it may not, as a delayed gain
    is not a stiffness.
    """

    def kernel(part: OperatingPoint) -> Array:
        own = np.asarray(part.named()[STIFFNESS] + part.gain)
        if part.model.delays:
            return np.asarray(own / (_nearest_edge(part) + part.gain))
        return np.asarray(own / _nearest(*_total_ends(part), own))

    return in_chunks(point, kernel)


@checked(rig=ONE_STIFFNESS)
def stable_stiffness(rig: Slider, vary: Vary | None = None) -> Any:
    """All stiffnesses k > 0 at which steady sliding is stable, as intervals.

    Parameters
    ----------
    rig, vary
        As for `critical_stiffness`.

    Returns
    -------
    ndarray or xarray.DataArray, shape (..., m, 2)
        Open intervals (low, high) in Pa/m, in rising order; high is inf where there is no upper limit.
        Rigs with fewer than m intervals are padded with NaN; all NaN means that no stiffness is stable.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.stable_stiffness(rig)
    array([[2.90697674e+10,            inf]])
    """
    point = operating_point(rig, vary)
    most = 1 if has_closed_form(point.model) else most_values(point)

    def kernel(part: OperatingPoint) -> Array:
        low, high = interval_ends(part)
        found = np.full((*part.shape, most, 2), np.nan)
        found[..., : low.shape[-1], 0], found[..., : low.shape[-1], 1] = low, high
        return found

    intervals = in_chunks(point, kernel)
    used = np.flatnonzero(np.any(np.isfinite(intervals[..., 0]), axis=tuple(range(intervals.ndim - 2))))
    intervals = intervals[..., : max(used[-1] + 1 if used.size else 1, 1), :]
    return point.wrap(intervals, "stable_stiffness", "Pa/m", ("interval", "end"))


@checked()
def eigenvalues(rig: Slider | Machine, vary: Vary | None = None) -> Any:
    """Eigenvalues of small perturbations of steady sliding.

    Parameters
    ----------
    rig, vary
        As for `critical_stiffness`.

    Returns
    -------
    ndarray or xarray.DataArray, shape (..., n), complex
        1/s, sorted by falling real part; NaN where steady sliding does not exist or numbers leave the range of
        floating point (see `stability`), and for the root that a rig lacks when its mass is zero. With a delay, which
        makes infinitely many, the rightmost, as many as there are without it; NaN, with an `IllPosedWarning`, where
        infinitely many grow (on a body without mass, what acts late outweighs what acts at once), and, with an
        `UndecidedWarning`, for eigenvalues that cannot be separated from infinitely many others close to them.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.eigenvalues(rig).round(6)
    array([0.03571+0.099485j, 0.03571-0.099485j])
    """
    if by_matrices(rig):
        return matrix_route.eigenvalues(rig, vary)
    point = operating_point(rig, vary)

    def kernel(part: OperatingPoint) -> ComplexArray:
        return spectrum(part)

    found = in_chunks(point, kernel)
    if point.model.delays and np.any(lost := np.all(np.isnan(found), axis=-1)):
        if point.single:
            unstable_roots(point)  # raises NotAvailable if roots cannot be counted
        _warn_of_delays(int(np.count_nonzero(lost & is_ill_posed(point) & point.exists)), point.size)
    if count := int(np.count_nonzero(among_many(point, found))):
        which = f"of {count} of {point.size} rigs some" if point.size > 1 else "some"
        message = (
            f"{which} eigenvalues are not known (NaN): on a body without mass that follows velocity late, infinitely "
            "many are nearly alike and cannot be distinguished; growth_rate gives the rate of the rightmost"
        )
        warnings.warn(message, UndecidedWarning, stacklevel=4)
    return point.wrap(found, "eigenvalues", "1/s", ("mode",))


def _warn_of_delays(count: int, size: int) -> None:
    """Issue an `IllPosedWarning` that `count` of `size` rigs have no rightmost eigenvalue."""
    if count:
        which = f"{count} of {size} rigs have" if size > 1 else "this rig has"
        message = (
            f"{which} no rightmost eigenvalue (NaN): on a body without mass, what follows velocity late outweighs what "
            "follows it at once, so that infinitely many grow; give that body a mass, or damping that acts at once"
        )
        warnings.warn(message, IllPosedWarning, stacklevel=5)


@checked()
def growth_rate(rig: Slider | Machine, vary: Vary | None = None) -> Any:
    """Largest real part of the eigenvalues (1/s): positive grows, negative decays.

    The result is inf where the problem is ill-posed (theory 3: a3 < 0, or a3 = 0 and a2 <= 0), and NaN without steady
    sliding or where numbers leave the range of floating point (see `stability`). Where a highest derivative is delayed
    (a body without mass under a late controller, for example) there may be no slowest decay, only infinitely many rates
    with a limit. The result is that limit, for the given delays or delays arbitrarily near them, and NaN if the limit
    is not known to a thousandth.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> round(ss.growth_rate(rig), 6)
    0.03571
    >>> ss.growth_rate(rig, {"stiffness": [10e9, 30e9]}).round(6)
    array([ 0.033931, -0.001655])
    """
    if by_matrices(rig):
        return matrix_route.growth_rate(rig, vary)
    point = operating_point(rig, vary)

    def kernel(part: OperatingPoint) -> Array:
        known = np.all(np.isfinite(quasipolynomial(part)[0]), axis=(-2, -1))
        return np.where(is_ill_posed(part), np.inf, np.where(known, growth(part), np.nan))

    return point.wrap(in_chunks(point, kernel), "growth_rate", "1/s")


# --- coefficients as arrays -------------------------------------------------------------------------


def stiffness_polynomials(point: OperatingPoint) -> tuple[Array, Array]:
    """p and q of p(s) + k q(s), each (..., n+1), lowest power first; k is the stiffness of the spring."""
    both = point.evaluate(_split_function(point.model))
    half = len(both) // 2
    return stacked(both[:half], point), stacked(both[half:], point)


def _total_ends(point: OperatingPoint) -> tuple[Array, Array]:
    """Lower and upper ends of the stable intervals of stiffness plus a controller's gain, (..., m) each."""
    if has_closed_form(point.model):
        low, high, _, lost = _closed_form_total(point)
        if not np.any(lost):
            return np.asarray(low)[..., None], np.asarray(high)[..., None]
    p, q = stiffness_polynomials(point)
    gain = np.broadcast_to(np.asarray(point.gain, dtype=float), point.shape)[..., None]
    intervals = stable_set(p - gain * q, q, spare_powers(point)).intervals
    return intervals[..., 0], intervals[..., 1]


def general_set(point: OperatingPoint, *, edges: bool = False) -> StableSet:
    """Stiffness values at which rigs of any Model are stable, from the characteristic equation.

    With a delay the edges are empty.

    With `edges`, an end of an interval that is only the end of the searched range is NaN, as in `sets_of`.
    """
    if point.model.delays:
        nothing = np.empty(0)
        intervals = sets_of(point, STIFFNESS, _size(point), edges=edges)
        return StableSet(intervals, nothing, nothing, nothing.astype(bool))
    return stable_set(*stiffness_polynomials(point), spare_powers(point))


def _size(point: OperatingPoint) -> Array:
    """Stiffness (Pa/m) around which to search, (...): that of the spring if positive, else a controller's gain, else
    1."""
    own = np.broadcast_to(np.asarray(point.named()[STIFFNESS], dtype=float), point.shape)
    gain = np.broadcast_to(np.asarray(point.gain, dtype=float), point.shape)
    return np.where(own > 0, own, np.where(gain > 0, gain, 1.0))


@cached
def _split_function(model: Model) -> ArrayFunction:
    p, q = stiffness_split(model)
    return model.function([*p, *q])


# --- the interval of the closed form ----------------------------------------------------------------


def closed_form_interval(point: OperatingPoint) -> tuple[Array, Array]:
    """Ends (Pa/m) of the only stable interval of stiffness, in closed form, for rigs with one memory variable."""
    low, high, gain, lost = _closed_form_total(point)
    low, high = cubic.without_gain(low, high, gain)
    if np.any(lost):
        ends = general_set(point).intervals[..., 0, :]
        low, high = np.where(lost, ends[..., 0], low), np.where(lost, ends[..., 1], high)
    return low, high


def _closed_form_total(point: OperatingPoint) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Ends of the stable interval of stiffness plus a controller's gain, the gain, and True if digits may be lost."""
    exists, numerator, denominator, mu_b2, mu_b3, a2, a3, gain = _interval_function(point.model)(point)
    low, high = cubic.stable_interval(numerator, denominator, mu_b2, mu_b3, a2, a3)
    return cubic.unless(exists, low), cubic.unless(exists, high), gain, _lost(numerator)


def _lost(product: Array) -> NDArray[np.bool_]:
    """True where a product is so large or small that it may have overflowed or lost digits."""
    size = np.abs(product)
    return np.asarray(~((size > _LEAST) & (size < 1 / _LEAST)))


@cached
def interval_ingredients(model: Model) -> tuple[sp.Expr, ...]:
    """Expressions N, D, μB2, μB3, a2, a3 (arguments of `cubic.stable_interval`) and the gain of a controller.

    They are functions of the model's parameters and σss. The interval is that of the total stiffness, gain included.
    """
    part = response(model)
    known = part.as_dict()
    del known["k"]
    numerator, denominator = _hopf_line(known)
    _, _, a2, a3 = cubic.coefficients(**known, k=sp.Integer(0))
    mu_b2, mu_b3 = part.mu * part.B2, part.mu * part.B3
    equation = steady_equation(model)
    if equation.affine and mu_b2 != 0 and sp.expand(mu_b2 + equation.slope) == 0 and mu_b3 == 0:
        mu_b2 = sp.Integer(0)  # a0 > 0 is then the condition that steady sliding exists, tested anyway
    return numerator, denominator, mu_b2, mu_b3, a2, a3, model.gain


@cached
def _interval_function(model: Model) -> Callable[[OperatingPoint], list[Array]]:
    """Function of a point that returns True where steady sliding exists, then the values of `interval_ingredients`."""
    wanted = interval_ingredients(model)
    equation = steady_equation(model)
    arguments = list(model.parameters.values())
    if not equation.affine:
        general = model.function(wanted)

        def by_search(point: OperatingPoint) -> list[Array]:
            return [np.isfinite(point.sigma), *point.evaluate(general)]

        return by_search
    sigma, slope = equation.sigma, equation.slope
    stress = {model.contact.sigma_ss: sigma}
    direct = ArrayFunction(arguments, [sigma, slope, *(sp.sympify(w).xreplace(stress) for w in wanted)])

    def in_one_go(point: OperatingPoint) -> list[Array]:
        with np.errstate(divide="ignore", invalid="ignore"):
            stress, coupling, *rest = direct(*point.arguments)
        return [cubic.positive(1 - coupling) & cubic.positive(stress), *rest]

    return in_one_go


def _hopf_line(known: dict[str, sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
    """N and D of the condition D k > N; both are divided by a2 > 0 if the quotients are polynomials."""
    names = {key: sp.Integer(0) if value == 0 else inner_symbol(key) for key, value in known.items()}
    numerator, denominator = cubic.hopf_line(**names)
    a2 = cubic.coefficients(**names, k=sp.Integer(0))[2]
    if a2 == 0:
        return sp.nan, sp.nan
    point = {symbol: known[key] for key, symbol in names.items() if symbol.is_Symbol}
    polynomial = sp.ring(list(point), sp.ZZ)[0].from_expr  # `sympy.cancel` gives the same in many times the time
    parts = [divmod(polynomial(part), polynomial(a2)) for part in (numerator, denominator)]
    if not any(rest for _, rest in parts):
        numerator, denominator = (quotient.as_expr() for quotient, _ in parts)
    return numerator.xreplace(point), denominator.xreplace(point)


def set_of_one(point: OperatingPoint) -> StableSet:
    """Stiffness values at which a single rig is stable, with the edges of this set.

    The closed form is used if the model has one.

    The closed form keeps its digits where a large mass swamps the direct effect in the polynomial.
    """
    if point.model.delays:
        found = linear_set(point, STIFFNESS, float(_size(point)))
        if found is None:
            raise too_many_windows_error(STIFFNESS)
        return found
    if not has_closed_form(point.model):
        return general_set(point)
    low, high = (float(end) for end in closed_form_interval(point))
    part = response_numbers(point)
    gain = part.k - float(point.named()["slider.stiffness"])
    edges, frequencies = [], []
    for end in (low, high):
        if np.isfinite(end) and end > 0:
            total = Response(**(part.as_dict() | {"k": end + gain}))
            static = abs(total.k * (1 + part.mu * part.B2) + part.mu * part.B3)
            largest = abs(total.k) + abs(part.mu * (total.k * part.B2 + part.B3))
            is_static = static <= 1e-12 * largest
            edges.append(end)
            frequencies.append(0.0 if is_static else float(np.sqrt(cubic.squared_frequency(**total.as_dict()))))
    return StableSet(np.array([[low, high]]), np.array(edges), np.array(frequencies), np.ones(len(edges), dtype=bool))


# --- intervals to answers, chunk by chunk -----------------------------------------------------------


def interval_ends(point: OperatingPoint, *, edges: bool = False) -> tuple[Array, Array]:
    """Lower and upper ends of the stable intervals (Pa/m), (..., m) each; `edges` as in `sets_of`."""
    if has_closed_form(point.model):
        low, high = closed_form_interval(point)
        return np.asarray(low)[..., None], np.asarray(high)[..., None]
    intervals = general_set(point, edges=edges).intervals
    return intervals[..., 0], intervals[..., 1]


def _nearest_edge(point: OperatingPoint) -> Array:
    """Finite positive end of a stable interval (Pa/m) that is nearest to the rig's stiffness, (...).

    NaN if there is none.
    """
    return _nearest(*interval_ends(point, edges=True), point.named()["slider.stiffness"])


def _nearest(low: Array, high: Array, own: Array) -> Array:
    """Finite positive end of intervals, (..., m) each, that is nearest to the value `own`, (...).

    NaN if there is none.
    """
    if low.shape[-1] == 1:
        low, high = low[..., 0], high[..., 0]
        if not np.any(high < np.inf):  # shortcut for the common case, for speed
            return np.asarray(cubic.unless(cubic.positive(low), low))
        is_low = (low > 0) & ~((high < np.inf) & (own > np.sqrt(low) * np.sqrt(high)))  # as in `doublings`
        return np.where(is_low, low, np.where(high < np.inf, high, np.nan))
    ends = np.concatenate([low, high], axis=-1)
    ends = np.where((ends > 0) & np.isfinite(ends), ends, np.nan)
    return np.take_along_axis(ends, nearest_end(ends, own)[..., None], axis=-1)[..., 0]


@quietly
def in_chunks(point: OperatingPoint, kernel: Callable[[OperatingPoint], NDArray[Any]]) -> NDArray[Any]:
    """Results of `kernel` for all rigs, computed `_CHUNK` at a time; NaN where numbers overflow or underflow.

    Raises
    ------
    NotAvailable
        If the numbers of a single rig leave the range of floating point.
    """
    if not point.shape:
        require_range(point)
    whole: NDArray[Any] | None = None
    done = beyond = 0
    for part in point.pieces(_CHUNK):
        result = np.asarray(kernel(part))
        extra = result.shape[len(part.shape) :]
        if not surely_in_range(part, complete=bool(np.all(np.isfinite(result)))):
            outside = ~in_range(part)
            beyond += int(np.count_nonzero(outside))
            result = np.where(outside.reshape(outside.shape + (1,) * len(extra)), np.nan, result)
        if whole is None:
            whole = np.empty((point.size, *extra), dtype=result.dtype)
        whole[done : done + part.size] = np.broadcast_to(result, (*part.shape, *extra)).reshape(-1, *extra)
        done += part.size
    if whole is None:
        raise InternalError("this array of rigs is empty, which operating points exclude; please report it")
    if beyond:
        warn_of_range(beyond, point.size)
    return whole.reshape(point.shape + whole.shape[1:])
