"""The paper's cubic and its critical stiffness in closed form (theory 3; eqs 17-20 corrected).

    a3 s³ + a2 s² + a1 s + a0 = 0
    a3 = m + f1 B0                 a2 = m r + f + f1 B1 + r μ B0
    a1 = k + f1 K + r S + r μ B1   a0 = r (k + μ K),   K = k B2 + B3

Plain arithmetic: every function takes numbers, arrays, SymPy expressions or nodes of a program. Arguments are those of
`steadyslip.linear.response.Response`; dampings c and η are part of f and S.
"""

from __future__ import annotations

import numpy as np

from steadyslip.core.expressions import Choose, Num


def coefficients(
    *,
    f: Num,
    S: Num,
    r: Num,
    f1: Num,
    mu: Num,
    B0: Num,
    B1: Num,
    B2: Num,
    B3: Num,
    m: Num,
    k: Num,
) -> tuple[Num, Num, Num, Num]:
    """a0, a1, a2, a3 of the characteristic polynomial, lowest power first."""
    K = k * B2 + B3
    return (
        r * (k + mu * K),
        k + f1 * K + r * S + r * mu * B1,
        m * r + f + f1 * B1 + r * mu * B0,
        m + f1 * B0,
    )


def hopf_line(
    *, f: Num, S: Num, r: Num, f1: Num, mu: Num, B0: Num, B1: Num, B2: Num, B3: Num, m: Num
) -> tuple[Num, Num]:
    """N and D of the Hurwitz condition a2 a1 > a3 a0, written as D k > N.

    D > 0: stable above N/D; D < 0: stable only below. The printed eq. 20 has f1(λ1 − λ) for r f (λ1 − λ)
    in N, and lacks B1 f1 in D; its inequality for D < 0 is not mentioned in the paper.
    """
    a3 = m + f1 * B0
    a2 = m * r + f + f1 * B1 + r * mu * B0
    denominator = (f + f1 * B1) * (1 + f1 * B2) + r * (mu - f1) * (B0 - m * B2)
    numerator = r * mu * B3 * a3 - a2 * (f1 * B3 + r * S + r * mu * B1)
    return numerator, denominator


def squared_frequency(
    *,
    f: Num,
    S: Num,
    r: Num,
    f1: Num,
    mu: Num,
    B0: Num,
    B1: Num,
    B2: Num,
    B3: Num,
    m: Num,
    k: Num,
) -> Num:
    """β² at the critical stiffness, eq. 18: a0/a2 (equal to a1/a3 with inertia)."""
    a0, _, a2, _ = coefficients(f=f, S=S, r=r, f1=f1, mu=mu, B0=B0, B1=B1, B2=B2, B3=B3, m=m, k=k)
    return a0 / a2


def stable_interval(
    numerator: Num, denominator: Num, mu_b2: Num, mu_b3: Num, a2: Num, a3: Num, choose: Choose = np.where
) -> tuple[Num, Num]:
    """Interval of k > 0 (Pa/m) in which all Hurwitz conditions are satisfied.

    Conditions: a3 >= 0 and a2 > 0, which do not contain k, D k > N, and a0 > 0, that is (1 + μB2) k > −μB3. They are
    valid without inertia (a3 = 0) too: D k > N is a1 > 0 then.

    Parameters
    ----------
    choose : callable
        Function ``choose(condition, value, other)``; for nodes of a generated program, the program's own.

    Returns
    -------
    low, high : float or ndarray
        NaN where no k is stable; high may be inf.
    """
    valid = positive(a2, choose) & (a3 >= 0)
    low, high, valid = _half_line(0.0, np.inf, denominator, numerator, valid, choose)
    low, high, valid = _half_line(low, high, 1 + mu_b2, -mu_b3, valid, choose)
    if choose is not np.where or np.ndim(high) or high != np.inf:
        valid = valid & (low < high)
    return unless(valid, low, choose), unless(valid, high, choose)


def without_gain(low: Num, high: Num, gain: Num, choose: Choose = np.where) -> tuple[Num, Num]:
    """Interval of the stiffness of the spring alone, from the interval of its sum with the gain of a controller."""
    if choose is np.where and not np.ndim(gain) and gain == 0:
        return low, high
    left, most = low - gain, high - gain
    some = most > 0
    return choose(some, choose(left > 0, left, 0.0), np.nan), choose(some, most, np.nan)


def positive(value: Num, choose: Choose = np.where) -> Num:
    """True where `value` > 0; plain True for an array that is positive everywhere, which avoids the cost of masks."""
    if choose is not np.where:
        return value > 0
    if np.ndim(value) == 0:
        return bool(value > 0)
    return True if np.min(value) > 0 else value > 0


def unless(valid: Num, value: Num, choose: Choose = np.where) -> Num:
    """`value` where `valid`, NaN elsewhere."""
    if choose is np.where and (valid is True or np.all(valid)):
        return value
    return choose(valid, value, np.nan)


def _half_line(low: Num, high: Num, slope: Num, right: Num, valid: Num, choose: Choose) -> tuple[Num, Num, Num]:
    """Intersection of the interval (low, high) with slope·k > right, and the new `valid`.

    Fast if all slopes are positive.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        if positive(slope, choose) is True:
            return (low if np.ndim(right) == 0 and right == 0 else np.maximum(low, right / slope)), high, valid
        edge = right / slope if choose is not np.where else np.divide(right, slope)
    low = choose((slope > 0) & (edge > low), edge, low)
    high = choose((slope < 0) & (edge < high), edge, high)
    return low, high, valid & ((slope > 0) | (slope < 0) | (right < 0))
