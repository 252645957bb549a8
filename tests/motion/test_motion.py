"""Simulated motion against laws of nature, closed forms and independent numbers."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw

import steadyslip as ss
from dimensionless import A, phi_of, unit_rig, y_of
from rigs_of_theory import LAWS, quarter, rig
from steadyslip.kernels.layout import SLIP_EVENT, Sampled
from steadyslip.kernels.runner import Runner
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare

REFERENCE = Path(__file__).parents[1] / "reference"


def table(name):
    return list(csv.DictReader((REFERENCE / name).read_text("utf-8").splitlines()))


@pytest.mark.parametrize(("lam", "kick"), [(0.1, 0.5), (0.1, 2.3), (0.5, 1.3), (0.5, -0.9), (1.5, 0.8)])
def test_slip_law_at_the_edge_conserves_the_invariant_of_gu(lam, kick):
    """Theory 7: C = e^y [y − 1 + λ(e^−φ − 1 + φ)] on every orbit at k = k_cr."""
    run = ss.simulate(unit_rig("slip", lam, lam), until=100.0, initial={"v": np.exp(kick)}, rtol=1e-9)
    y, phi = y_of(run), phi_of(run)
    invariant = np.exp(y) * (y - 1 + lam * (np.exp(-phi) - 1 + phi))
    assert run.status == "done"
    assert np.ptp(invariant) < 1e-7 * np.exp(y.max()) * (1 + lam * np.exp(-phi.min()))


@pytest.mark.parametrize("lam", [0.1, 0.5])
@pytest.mark.parametrize("size", [0.5, 2.0])
def test_aging_law_at_the_edge_conserves_the_lotka_volterra_function(lam, size):
    """Theory 7: W = κ'(w − ln w) + Ω − ln Ω with w = v0θ/d_c, Ω = vθ/d_c."""
    run = ss.simulate(unit_rig("aging", lam, lam), until=100.0, initial={"x": -size / lam}, rtol=1e-9)
    w, omega = run["theta"], run["v"] * run["theta"]
    conserved = lam * (w - np.log(w)) + omega - np.log(omega)
    assert np.ptp(conserved) < 2e-7 * conserved.max()


@pytest.mark.parametrize("law", ["slip", "aging"])
def test_energy_is_accounted_for(law):
    """What the load point puts in is stored in spring and motion, or spent in friction and damping."""
    mass, damping = 0.5, 0.3
    a_rig = unit_rig(law, 0.5, 0.8, damping, mass)
    run = ss.simulate(
        a_rig, ss.protocol.VelocityStep(at=2.0, to=2.0), until=30.0, times=np.linspace(0, 30, 30001), rtol=1e-10
    )
    v, t = run["v"], run["t"]

    def work(stress, velocity):
        return np.concatenate([[0], np.cumsum(np.diff(t) * 0.5 * ((stress * velocity)[1:] + (stress * velocity)[:-1]))])

    put_in = work(run["spring_stress"], run["load_velocity"])
    spent = work(run["shear_stress"] + damping * A * v, v)
    stored = 0.5 * mass * A * v**2 + run["spring_stress"] ** 2 / (2 * 0.8 * A)
    balance = put_in - spent - (stored - stored[0])
    assert np.max(np.abs(balance)) < 2e-5 * put_in[-1]  # the trapezoidal sums are good to 1e-6; one kink at the step


@pytest.mark.parametrize("row", table("orbits.csv"), ids=lambda row: f"{row['lam']} {row['start']}")
def test_orbits(row):
    lam, phi = float(row["lam"]), float(row["start"].split("=")[-1])
    run = ss.simulate(unit_rig(row["law"], lam, lam), until=80.0, initial={"v": np.exp(phi)}, rtol=1e-10)
    peaks = [event for event in run.events if event.kind == "velocity peak"]
    assert np.log(peaks[-1].velocity) == pytest.approx(float(row["phi_max"]), rel=1e-9)
    assert peaks[-1].time - peaks[-2].time == pytest.approx(float(row["period_DOP853"]), rel=1e-7)
    if float(row["phi_max"]) < np.log(SLIP_EVENT):
        assert run.slip_events == ()
        return
    last = run.slip_events[-1]
    assert last.recurrence == pytest.approx(float(row["period_DOP853"]), rel=1e-9)
    assert np.log(last.peak_velocity) == pytest.approx(float(row["phi_max"]), rel=1e-9)
    assert last.stress_drop / A == pytest.approx(float(row["f_max"]) - float(row["f_min"]), rel=1e-8)


@pytest.mark.parametrize("row", table("aging_periods.csv"), ids=lambda row: f"{row['lam']} {row['ln_Omega0']}")
def test_aging_periods(row):
    lam, size = float(row["lam"]), float(row["ln_Omega0"])
    run = ss.simulate(unit_rig("aging", lam, lam), until=260.0, initial={"x": -size / lam}, rtol=1e-10)
    assert run.slip_events[-1].recurrence == pytest.approx(float(row["period"]), rel=1e-9)


@pytest.mark.parametrize("row", table("stickslip.csv"), ids=lambda row: f"{row['law']} {row['H']}")
def test_stick_slip_cycles(row):
    a_rig = unit_rig(row["law"], float(row["lam"]), float(row["kappa"]), float(row["H"]))
    last = ss.simulate(a_rig, until=1000.0, initial={"v": 1.1}, rtol=1e-10).slip_events[-1]
    assert last.recurrence == pytest.approx(float(row["period_DOP853"]), rel=3e-11)
    assert last.stress_drop / A == pytest.approx(float(row["dtau_DOP853"]), rel=1e-10)
    assert np.log(last.peak_velocity) == pytest.approx(float(row["phimax_DOP853"]), rel=1e-9)


@pytest.mark.parametrize(("law", "contact", "mass"), quarter(1))
def test_small_kicks_grow_as_the_eigenvalues_say(law, contact, mass):
    """A small kick is a sum of exponentials with the rates that linear stability gives, and nothing else is left.

    The kick is a millionth of a slip distance and grows to e^4 times that, so that squares of it are not seen.
    """
    if isinstance(contact, ss.laws.Lift):
        contact = ss.laws.Lift(preload=5e6, lift=2e10, v_ref=1e-6)  # far enough from ill-posed for a kick to stay small
    random = np.random.default_rng(31 * len(law) + len(contact.name))
    a_rig = rig(friction=LAWS[law], contact=contact, mass=mass, stiffness=float(random.uniform(3e9, 3e10)))
    if law == "prakash-clifton" and contact.name == "linear" and not mass:
        pytest.skip("ill-posed")
    if law == "lugre" and isinstance(contact, ss.laws.Lift):
        pytest.skip("bristles give way to any lift at this velocity")
    rates = np.atleast_1d(ss.eigenvalues(a_rig)).astype(complex)
    slow = np.abs(rates)[np.abs(rates) < 50 * np.abs(rates).min()]
    until = min(4.0 / slow.max(), 4.0 / max(rates.real.max(), 1e-300))
    times = np.linspace(0.2 * until, until, 40)
    kick, rtol = (1e-9, 1e-9) if law == "lugre" else (1e-12, 1e-11)  # stiff bristles need more to stand out of rounding
    jobs = prepare(a_rig, None, until, {}, {"x": kick}, Options(rtol=rtol))
    machine = Runner(jobs.reduction, jobs.choice(1, True), plain=True)
    with np.errstate(all="ignore"):
        outcome = run_single(jobs, machine, times, False, False)
    assert outcome.status[0] == 1
    x = outcome.samples[0][:, Sampled.STATE]
    right = misfit(times, rates, x)
    assert right < (1e-3 if law == "lugre" else 1e-4)
    if len(rates) < 4:  # with more modes than that, wrong ones can fit forty points of a short record
        assert misfit(times, rates + 0.1 * slow.min(), x) > 3 * right


def misfit(times, rates, x):
    """What is left of x after the best sum of exponentials with given rates, relative to its size."""
    modes = np.exp(np.outer(times, rates))
    size = np.abs(modes).max(axis=0)
    modes = modes[:, size > 1e-30] / size[size > 1e-30]  # others have died out
    weights, *_ = np.linalg.lstsq(modes, x.astype(complex), rcond=1e-12)
    return np.max(np.abs(modes @ weights - x)) / np.max(np.abs(x))


def time_of_blow_up(law, lam, kappa, step):
    """By SciPy in slip-like time (ds = (1 + v) dt) up to φ = 30; what is left of t is below 1e-12."""

    def slope(s, state):
        phi, x, _ = state
        v = np.exp(phi)
        y = -kappa * x
        theta = (y - phi) / (1 + lam)
        rate = {
            "slip": -v * (phi + theta),
            "aging": np.exp(-theta) - v,
            "prz": 0.5 * (np.exp(-theta) - v**2 * np.exp(theta)),
        }[law]
        phi_rate = -kappa * (v - step) - (1 + lam) * rate
        return np.array([phi_rate, v - step, 1.0]) / (1 + v)

    def far(s, state):
        return state[0] - 30.0

    far.terminal = True
    done = solve_ivp(slope, (0, 1e4), [0.0, 0.0, 0.0], "DOP853", rtol=1e-13, atol=1e-14, events=far)
    assert done.t_events[0].size
    return done.y[2, -1]


@pytest.mark.parametrize("step", [10.0, 3.0])
@pytest.mark.parametrize("share", [0.5, 0.8])
@pytest.mark.parametrize("law", ["slip", "aging", "prz"])
def test_time_of_blow_up(law, share, step):
    """Below k_cr a step in rate ends in infinite velocity; the time is a number, good to 1e-6."""
    lam = 0.5
    run = ss.simulate(unit_rig(law, lam, share * lam), ss.protocol.VelocityStep(at=0.0, to=step), until=1000.0)
    assert run.status == "blow-up"
    assert run.events[-1].kind == "blow-up"
    assert run.end == pytest.approx(time_of_blow_up(law, lam, share * lam, step), rel=1e-6)
    assert np.all(np.isfinite(run["v"]))
    assert "mass" in run.message


def survives(a_rig, protocol, until=3000.0):
    return ss.simulate(a_rig, protocol, until=until, rtol=1e-9, events=False).status == "done"


def test_thresholds_in_closed_form():
    """Theory 7, the slip law at k_cr: velocity step ln(b/(b−a)), displacement [1 + W(−λ/(e(1+λ)))]/λ both ways."""
    a, b = 0.0145, 0.0160
    lam = (b - a) / a
    a_rig = unit_rig("slip", lam, lam)
    velocity = b / (b - a)
    scale = velocity  # the edge is that of the new rate, the same for the quasistatic law
    assert survives(a_rig, ss.protocol.VelocityStep(at=0.0, to=velocity * (1 - 1e-5)), 3000 / scale)
    assert not survives(a_rig, ss.protocol.VelocityStep(at=0.0, to=velocity * (1 + 1e-5)), 3000 / scale)
    for branch in (0, -1):
        step = (1 + lambertw(-lam / (np.e * (1 + lam)), branch).real) / lam
        assert survives(a_rig, ss.protocol.DisplacementStep(at=0.0, by=step * (1 - 1e-5)))
        assert not survives(a_rig, ss.protocol.DisplacementStep(at=0.0, by=step * (1 + 1e-5)))
