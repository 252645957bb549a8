"""Rigs in the units of theory 5: d_c = v0 = σ = 1, a = .01, so that x, ln v and (T − Tss)/a are as printed there."""

import numpy as np

import steadyslip as ss

A = 0.01
MU = 0.6
LAWS = {"slip": ss.laws.Slip(), "aging": ss.laws.Aging(), "prz": ss.laws.PRZ()}


def unit_rig(law, lam, kappa, damping=0.0, mass=0.0, **friction):
    """λ = (b − a)/a, κ' = k d_c/(aσ), H = η v0/(aσ), M = m v0²/(aσ d_c)."""
    numbers = {"a": A, "b": A * (1 + lam), "d_c": 1.0, "mu_ref": MU, "v_ref": 1.0, "evolution": LAWS[law]}
    return ss.Slider(
        friction=ss.laws.RateState(**(numbers | friction)),
        contact=ss.laws.ConstantNormalStress(preload=1.0),
        stiffness=kappa * A,
        radiation_damping=damping * A,
        mass=mass * A,
        drive=ss.machine.SteadyDrive(1.0),
    )


def y_of(run):
    """(T − Tss)/(aσ)."""
    return (run["spring_stress"] - MU) / A


def phi_of(run):
    """ln(v/v0)."""
    return np.log(run["v"])


def two_states(kappa=0.08):
    """Theory 4: β = (1, .84), ρ = .048; κ = k d_1/(aσ)."""
    states = (ss.laws.State(b=A, d_c=0.048), ss.laws.State(b=0.84 * A, d_c=1.0))
    law = ss.laws.RateState(a=A, states=states, mu_ref=MU, v_ref=1.0, evolution=ss.laws.Slip())
    stiffness = kappa * A / 0.048
    return ss.Slider(
        friction=law,
        contact=ss.laws.ConstantNormalStress(preload=1.0),
        stiffness=stiffness,
        drive=ss.machine.SteadyDrive(1.0),
    )
