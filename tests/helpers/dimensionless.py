"""Rigs in the units of theory 5: d_c = v0 = σ = 1, a = .01, so that x, ln v and (T − Tss)/a are as printed there."""

import numpy as np

import steadyslip as ss

A = 0.01
MU = 0.6
LAWS = {"slip": ss.Slip(), "aging": ss.Aging(), "prz": ss.PRZ()}


def unit_rig(law, lam, kappa, damping=0.0, mass=0.0, **friction):
    """λ = (b − a)/a, κ' = k d_c/(aσ), H = η v0/(aσ), M = m v0²/(aσ d_c)."""
    numbers = {"a": A, "b": A * (1 + lam), "d_c": 1.0, "mu_ref": MU, "v_ref": 1.0, "evolution": LAWS[law]}
    return ss.Slider(
        friction=ss.RateState(**(numbers | friction)),
        contact=ss.Constant(preload=1.0),
        stiffness=kappa * A,
        radiation_damping=damping * A,
        mass=mass * A,
        drive=ss.Steady(1.0),
    )


def y_of(run):
    """(T − Tss)/(aσ)."""
    return (run["spring_stress"] - MU) / A


def phi_of(run):
    """ln(v/v0)."""
    return np.log(run["v"])
