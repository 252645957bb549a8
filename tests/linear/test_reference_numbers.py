"""Numbers found elsewhere at 30 to 60 digits: both routes must give them to rounding."""

import csv
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.linear import cubic
from steadyslip.linear.state_space import jacobian
from steadyslip.linear.stiffness import general_set
from steadyslip.model.point import operating_point

FOLDER = Path(__file__).parents[1] / "reference"
# 12 significant digits, times how much the terms of D cancel
DIGITS = 1e-12


def rows(name):
    with (FOLDER / name).open(encoding="utf-8") as file:
        return [{k: v if v in "+-" else float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def cancellation(f, f1, r, mu, m, B0, B1, B2):
    """Σ|terms|/|D| of the denominator of eq. 20."""
    terms = [f, f * f1 * B2, f1 * B1, f1 * B1 * f1 * B2, r * mu * B0, r * f1 * B0, r * mu * m * B2, r * f1 * m * B2]
    signed = (f + f1 * B1) * (1 + f1 * B2) + r * (mu - f1) * (B0 - m * B2)
    return sum(map(abs, terms)) / abs(signed)


def general_rig(row):
    """A rate-and-state rig with exactly the f, f1, r, λ, λ1 of a row: σ = 1, v0 = 1."""
    mu = row["lam1"] * row["f1"]
    friction = ss.laws.RateState(
        a=row["f"],
        b=row["f"] * (1 + row["lam"]),
        d_c=1 / row["r"],
        mu_ref=mu,
        v_ref=1.0,
        normal_memory=ss.laws.LinkerDieterich(alpha=mu - row["f1"]),
    )
    contact = ss.laws.LinearNormalStress(
        steady_normal_stress=1.0, b0=row["B0"], b1=row["B1"], b2=row["B2"], b3=row["B3"]
    )
    return ss.Slider(
        friction=friction, contact=contact, stiffness=row["k_cr"], mass=row["m"], drive=ss.machine.SteadyDrive(1.0)
    )


def inclined_rig(row):
    friction = ss.laws.RateState(
        a=row["A"],
        b=row["B"],
        d_c=row["L"],
        mu_ref=row["mu_ss"],
        v_ref=row["v0"],
        normal_memory=ss.laws.LinkerDieterich(alpha=row["alpha"]),
    )
    contact = ss.laws.InclinedSpring(steady_normal_stress=row["sigma_ss"], angle=np.radians(row["psi_deg"]))
    return ss.Slider(
        friction=friction,
        contact=contact,
        stiffness=row["k_cr"],
        mass=row["m"],
        drive=ss.machine.SteadyDrive(row["v0"]),
    )


def assert_spectrum(rig, row, prefix, scale, tolerance):
    """The three (two without mass) roots at .9, 1 and 1.1 of k_cr, by polynomial and by Jacobian."""
    for factor, tag in ((0.9, "0.9kcr"), (1.0, "kcr"), (1.1, "1.1kcr")):
        here = rig.with_values({"slider.stiffness": factor * row["k_cr"]})
        expected = [complex(row[f"root{i}_re_{prefix}{tag}"], row[f"root{i}_im_{prefix}{tag}"]) for i in (1, 2, 3)]
        expected = np.array([s * scale for s in expected if s == s])
        found = ss.eigenvalues(here)
        assert len(found) == len(expected)
        for route, limit in ((found, tolerance), (np.linalg.eigvals(jacobian(here)), 1e3 * tolerance)):
            for s in expected:
                assert np.min(np.abs(route - s)) <= limit * abs(s)


@pytest.mark.parametrize("row", rows("general.csv"), ids=lambda r: f"{r['id']:.0f}")
def test_general_rows(row):
    mu = row["lam1"] * row["f1"]
    keys = {k: row[k] for k in ("f", "f1", "r", "m", "B0", "B1", "B2", "B3")}
    tolerance = DIGITS * cancellation(mu=mu, **{k: v for k, v in keys.items() if k != "B3"})
    numerator, denominator = cubic.hopf_line(S=-row["lam"] * row["f"], mu=mu, **keys)
    assert numerator / denominator == pytest.approx(row["k_cr"], rel=tolerance)
    k = {"k": row["k_cr"], "S": -row["lam"] * row["f"], "mu": mu} | keys
    assert np.sqrt(cubic.squared_frequency(**k)) == pytest.approx(row["beta_cr"], rel=tolerance)

    rig = general_rig(row)
    sets = general_set(operating_point(rig))
    nearest = np.nanargmin(np.abs(sets.edges - row["k_cr"]))
    assert sets.edges[nearest] == pytest.approx(row["k_cr"], rel=tolerance)
    assert sets.frequencies[nearest] == pytest.approx(row["beta_cr"], rel=tolerance)
    assert_spectrum(rig, row, "", 1.0, tolerance)
    growth = [ss.growth_rate(rig.with_values({"stiffness": factor * row["k_cr"]})) for factor in (0.9, 1.1)]
    if sets.changes[nearest]:
        signs = ("+", "-") if growth[0] > 0 else ("-", "+")
        assert (row["pair_re_sign_below"], row["pair_re_sign_above"]) == signs


@pytest.mark.parametrize("row", rows("inclined.csv"), ids=lambda r: f"{r['id']:.0f}")
def test_inclined_rows(row):
    rig = inclined_rig(row)
    t = np.tan(np.radians(row["psi_deg"]))
    f, r = row["A"] * row["sigma_ss"] / row["v0"], row["v0"] / row["L"]
    f1 = row["mu_ss"] - row["alpha"]
    tolerance = DIGITS * cancellation(f, f1, r, row["mu_ss"], row["m"], 0, 0, t)
    assert ss.critical_stiffness(rig) == pytest.approx(row["k_cr"], rel=tolerance)
    sets = general_set(operating_point(rig))
    nearest = np.nanargmin(np.abs(sets.edges - row["k_cr"]))
    assert sets.edges[nearest] == pytest.approx(row["k_cr"], rel=tolerance)
    assert sets.frequencies[nearest] == pytest.approx(row["beta_cr"], rel=tolerance)
    closed = ss.paper.inclined_critical_stiffness(
        a=row["A"], b=row["B"], d_c=row["L"], mu_ss=row["mu_ss"], alpha=row["alpha"], sigma_ss=row["sigma_ss"],
        angle=np.radians(row["psi_deg"]), m=row["m"], v0=row["v0"],
    )  # fmt: skip
    assert closed == pytest.approx(row["k_cr"], rel=tolerance)
    assert_spectrum(rig, row, "L/v0_", row["v0"] / row["L"], tolerance)
