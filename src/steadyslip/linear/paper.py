"""The closed forms of Dupont & Bapna (1994), eqs 17-32, each with its number, validity and erratum.

*Stability of sliding frictional surfaces with varying normal force*, J. Vib. Acoust. 116. Where the printed
equation is wrong, the function is right and its docstring says what is printed. All functions take
and return numbers, or arrays that broadcast, in SI units per unit area.

Symbols of eqs 17-21 (argument names in brackets): f = ∂τ/∂v [f], f1 = ∂τ/∂σ [f1], λ with
dτss/dv = −λf [lam], λ1 with dτss/dσ = λ1 f1 [lam1], decay rate r [r], mass m [m], B0...B3 of eq. 12,
stiffness k [k], angular frequency β [beta]. Symbols of eqs 22-32: A [a], B [b], L [d_c], μss [mu_ss],
α [alpha], σss [sigma_ss], v0 [v0], spring angle ψ [angle, rad; positive pulls out of the surface],
dimensionless mass m* = m v0²/(σss L) [m_star], dimensionless stiffness κ = k L/σss [kappa].
"""

from __future__ import annotations

import numpy as np

from steadyslip.core.expressions import Num
from steadyslip.linear import cubic


def characteristic_at(
    beta: Num,
    k: Num,
    *,
    m: Num,
    f: Num,
    f1: Num,
    r: Num,
    lam: Num,
    lam1: Num,
    B0: Num,
    B1: Num,
    B2: Num,
    B3: Num,
) -> Num:
    """Eq. 17: the real part condition at s = iβ; zero at (β, k) on the stability boundary.

    Right as printed. Together with eq. 18 it is the characteristic equation at s = iβ.
    """
    K = k * B2 + B3
    square = beta**2
    middle = -(r**2) * (m + B0 * lam1 * f1) + k + f1 * K + B1 * (lam1 - 1) * r * f1 - (1 + lam) * r * f
    return -(square**2) * (m + B0 * f1) + square * middle + r**2 * (k + f1 * lam1 * K)


def critical_frequency_squared(
    k: Num, *, f: Num, f1: Num, r: Num, lam: Num, lam1: Num, B0: Num, B1: Num, B2: Num, B3: Num
) -> Num:
    """Eq. 18: β² at stiffness k, from the imaginary part at s = iβ. Right as printed.

    A negative value means that no oscillatory boundary exists at this k.
    """
    K = k * B2 + B3
    numerator = K * (lam1 - 1) * r * f1 + r**2 * (f * lam - f1 * B1 * lam1)
    return numerator / (B0 * (lam1 - 1) * r * f1 + f + B1 * f1)


def spurious_stiffness(*, f: Num, f1: Num, r: Num, lam: Num, lam1: Num, B0: Num, B1: Num, B2: Num, B3: Num) -> Num:
    """Eq. 19: the root of the quadratic in k that belongs to β² = −r² (eq. 21) and is discarded.

    Erratum: the last term of the numerator is printed f1(λ + 1); it must be r f (λ + 1).
    """
    numerator = f1 * (lam1 - 1) * (B3 - B1 * r + B0 * r**2) + r * f * (lam + 1)
    return -numerator / (B2 * f1 * (lam1 - 1))


def spurious_frequency_squared(r: Num) -> Num:
    """Eq. 21: β² = −r² of the discarded root. Right as printed."""
    return -(r**2)


def critical_stiffness(
    *, m: Num, f: Num, f1: Num, r: Num, lam: Num, lam1: Num, B0: Num, B1: Num, B2: Num, B3: Num
) -> Num:
    """Eq. 20: the critical stiffness of the general linear contact.

    Errata: the numerator is printed with f1(λ1 − λ) for r f (λ1 − λ), and the denominator lacks B1 f1; right
    is D = (f + B1 f1)(1 + f1 B2) + r f1 (λ1 − 1)(B0 − m B2). The paper does not say that stability is
    *below* this stiffness where D < 0. It is a boundary only together with the other Hurwitz conditions;
    see `steadyslip.stable_stiffness` for the whole set. Needs f1 != 0 for λ1 to be finite.
    """
    numerator, denominator = cubic.hopf_line(f=f, S=-lam * f, r=r, f1=f1, mu=lam1 * f1, B0=B0, B1=B1, B2=B2, B3=B3, m=m)
    return numerator / denominator


def inclined_normal_stress(x: Num, *, sigma_ss: Num, k: Num, angle: Num) -> Num:
    """Eqs 22-23: σ = σss + k x tan ψ, x the slip of the block ahead of steady sliding (m). Right as printed."""
    return sigma_ss + k * x * np.tan(angle)


def inclined_coefficients(angle: Num) -> tuple[Num, Num, Num, Num]:
    """Eq. 24: (B0, B1, B2, B3) of the inclined spring: 0, 0, tan ψ, 0. Right as printed."""
    return 0.0, 0.0, np.tan(angle), 0.0


def inclined_critical_stiffness(
    *,
    a: Num,
    b: Num,
    d_c: Num,
    mu_ss: Num,
    alpha: Num,
    sigma_ss: Num,
    angle: Num,
    m: Num = 0.0,
    v0: Num = 1.0,
) -> Num:
    """Eq. 25: critical stiffness of the inclined spring with slip or aging law and Linker–Dieterich memory.

    Erratum to the dynamic form, whose printed denominator Aσss/L − α ln ψ m v0/L is garbled: it is
    (Aσss/v0)[1 + (μss − α) tan ψ] − α tan ψ m v0/L. The quasistatic form (m = 0) is right as printed.
    Valid while the denominator is positive (m* < m*_cr2, eq. 31) and the spring not locked (eq. 27).
    """
    tangent = np.tan(angle)
    inertia = m * v0 / d_c
    direct = a * sigma_ss / v0
    numerator = sigma_ss * (b - a) / d_c * (direct + inertia)
    return numerator / (direct * (1 + (mu_ss - alpha) * tangent) - alpha * tangent * inertia)


def inclined_frequency_squared(
    *, a: Num, b: Num, d_c: Num, mu_ss: Num, alpha: Num, angle: Num, v0: Num, m_star: Num = 0.0
) -> Num:
    """Eq. 26: β² at the critical stiffness of the inclined spring.

    Right as printed, for the quasistatic case; with mass the denominator gains −α m* tan ψ (theory 4).
    """
    tangent = np.tan(angle)
    denominator = a * (1 + (mu_ss - alpha) * tangent) - alpha * m_star * tangent
    return (b - a) * (v0 / d_c) ** 2 * (1 + mu_ss * tangent) / denominator


def lock_up_angle(mu_ss: Num) -> Num:
    """Eq. 27: steady sliding needs ψ > −arccot μss (rad). Right as printed, with or without mass."""
    return -np.arctan2(1.0, mu_ss)


def inclined_dimensionless_stiffness(*, a: Num, b: Num, mu_ss: Num, alpha: Num, angle: Num, m_star: Num = 0.0) -> Num:
    """Eq. 28: κ_cr = k_cr L/σss against dimensionless mass. Right as printed.

    Infinite at m*_cr2 (eq. 31), where a positive angle loses its last stabilising stiffness; beyond it the
    value is negative and no stiffness is stable.
    """
    tangent = np.tan(angle)
    denominator = a * (1 + tangent * (mu_ss - alpha)) - tangent * m_star * alpha
    return (b - a) * (a + m_star) / denominator


def quasistatic_mass_limit(a: Num) -> Num:
    """Eq. 29: the quasistatic critical stiffness is a close approximation for m* much below A."""
    return a


def mass_of_equal_stiffness(*, a: Num, mu_ss: Num, alpha: Num) -> Num:
    """Eq. 30: m*_cr1, the mass at which κ_cr does not depend on the angle. Right as printed."""
    return a * (mu_ss - alpha) / alpha


def mass_of_no_stiffness(*, a: Num, mu_ss: Num, alpha: Num, angle: Num) -> Num:
    """Eq. 31: m*_cr2, the mass from which on no finite stiffness is stable; for ψ > 0 only. Right as printed."""
    return mass_of_equal_stiffness(a=a, mu_ss=mu_ss, alpha=alpha) + a / (alpha * np.tan(angle))


def dimensionless_normal_stress(x: Num, *, sigma_ss: Num, kappa: Num, d_c: Num, angle: Num) -> Num:
    """Eq. 32: σ = σss (1 + κ (x/L) tan ψ). Right as printed; loss of contact where it is <= 0."""
    return sigma_ss * (1 + kappa * x / d_c * np.tan(angle))
