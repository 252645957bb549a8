"""Simulated motion against laws of nature, closed forms and independent numbers."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import lambertw

import steadyslip as ss
from dimensionless import MU, A, phi_of, unit_rig, y_of
from rigs_of_theory import CONTACTS, ONE_MEMORY, rig
from steadyslip.core.roles import positive, real
from steadyslip.kernels.layout import SLIP_EVENT, Sampled
from steadyslip.kernels.runner import Runner
from steadyslip.motion.engine import run_single
from steadyslip.motion.jobs import Options, prepare
from test_motion_oracle import LAWS, quarter

REFERENCE = Path(__file__).parent / "reference"


def table(name):
    return list(csv.DictReader((REFERENCE / name).read_text("utf-8").splitlines()))


# -- conservation


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
    run = ss.simulate(a_rig, ss.VelocityStep(at=2.0, to=2.0), until=30.0, times=np.linspace(0, 30, 30001), rtol=1e-10)
    v, t = run["v"], run["t"]

    def work(stress, velocity):
        return np.concatenate([[0], np.cumsum(np.diff(t) * 0.5 * ((stress * velocity)[1:] + (stress * velocity)[:-1]))])

    put_in = work(run["spring_stress"], run["load_velocity"])
    spent = work(run["shear_stress"] + damping * A * v, v)
    stored = 0.5 * mass * A * v**2 + run["spring_stress"] ** 2 / (2 * 0.8 * A)
    balance = put_in - spent - (stored - stored[0])
    assert np.max(np.abs(balance)) < 2e-5 * put_in[-1]  # the trapezoidal sums are good to 1e-6; one kink at the step


# -- independent numbers


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


# -- slip events


def excursions(run):
    """Slip events by their definition, from dense samples: (begin, end, peak) of each time ahead of the load point."""
    t, v, load = run["t"], run["v"], run["load_velocity"]
    drive = run.rig.drive.velocity
    ahead = v > np.maximum(load, 1e-3 * drive)
    edges = np.flatnonzero(np.diff(ahead.astype(int)))
    found = []
    for first in edges[~ahead[edges]] + 1:
        later = edges[edges >= first]
        if not len(later):
            break
        part = slice(first, later[0] + 1)
        asked = np.where(load[part] > 1e-3 * drive, load[part], drive)
        if np.any(v[part] >= SLIP_EVENT * np.maximum(asked, v[first - 1])):
            found.append((t[first], t[later[0]], v[part].max()))
    return found


SLOW_LUGRE = ss.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10)


@pytest.mark.parametrize(
    ("a_rig", "protocol", "count"),
    [
        (unit_rig("aging", 0.5, 0.51), ss.VelocityStep(at=5, to=1.03), 0),  # ringing, an overshoot of 2 %
        (unit_rig("aging", 0.5, 0.51), ss.VelocityStep(at=5, to=3.0), 20),  # ringing from an overshoot of 13 times
        (unit_rig("aging", 0.5, 1.5), ss.VelocityStep(at=5, to=0.1), 0),  # slowing down to a tenth
        (unit_rig("aging", 0.5, 20.0), ss.Hold(at=5, duration=30.0), 0),
        (unit_rig("aging", 0.5, 20.0), ss.SlideHoldSlide(at=5, hold=1, factor=10, slide=10, repeats=3), 0),
        (unit_rig("aging", 0.5, 0.3, 1e-3), ss.VelocityStep(at=5, to=1.1) + ss.Hold(at=100, duration=50), None),
    ],
    ids=["overshoot", "ringing", "slower", "hold", "slide-hold-slide", "stick-slip"],
)
def test_slip_events_are_what_their_definition_says(a_rig, protocol, count):
    """Against dense samples; an overshoot, a hold and slide-hold-slide on a stiff rig are not slip events."""
    run = ss.simulate(a_rig, protocol, until=200.0, times=np.linspace(0, 200, 40001))
    expected = excursions(run)
    assert len(run.slip_events) == len(expected)
    assert count is None or len(expected) == count
    for slip, (begin, end, peak) in zip(run.slip_events, expected, strict=True):
        assert (slip.begin, slip.end) == pytest.approx((begin, end), abs=0.006)
        assert slip.peak_velocity >= peak * (1 - 1e-6)
        assert slip.stress_drop > 0
    assert sum(event.kind == "slip begins" for event in run.events) in (len(expected), len(expected) + 1)
    if count is None:
        assert len(expected) > 5
        assert not any(100 < slip.begin < 150 for slip in run.slip_events)
    many = ss.simulate_many(a_rig, {}, protocol, until=200.0)
    assert many.events["events"] == len(expected)
    if not expected:
        assert np.isnan(many.events["event_begin"])
        assert np.isnan(many.events["event_peak_velocity"])
        assert many.events["event_stress_drop"] == 0


def test_a_held_block_that_vibrates_makes_no_slip_events():
    """With mass a held block swings about rest, through both signs of velocity."""
    a_rig = rig(friction=SLOW_LUGRE, mass=1e8, stiffness=4e11)
    protocol = ss.SlideHoldSlide(at=2.0, hold=1.0, factor=3.0, slide=3.0, repeats=3)
    run = ss.simulate(a_rig, protocol, until=25.0, times=np.linspace(0, 25, 20001))
    held = run["load_velocity"] == 0
    assert np.sum(np.diff(np.sign(run["v"][held])) != 0) > 10
    assert run.slip_events == ()


def test_a_kick_during_a_hold_begins_where_it_is_given():
    """The block had not come to rest: the slip event begins at the kick, not with the hold."""
    protocol = ss.Hold(at=5.0, duration=40.0) + ss.NormalStressStep(at=6.0, by=-0.08)
    run = ss.simulate(unit_rig("aging", 0.5, 1.5, 1e-3), protocol, until=60.0)
    (slip, *_) = run.slip_events
    assert slip.begin == pytest.approx(6.0)
    assert slip.peak_velocity > 2.0


def test_error_of_default_settings():
    """What rtol = 1e-7 gives: 1e-7 to 1e-5 in ln v after six spirals, and after thirty cycles of stick-slip."""
    for a_rig, until, kick, most in (
        (rig(contact=CONTACTS[1], stiffness=9.5e9, friction=ONE_MEMORY[1]), 200.0, {"v": 1.01e-6}, 1e-6),
        (unit_rig("aging", 0.5, 0.4, 1e-6), 600.0, {"v": 1.1}, 2e-5),
        (unit_rig("slip", 0.5, 0.4, 0.0, 1e-6 / A), 460.0, {"x": 1.0}, 2e-5),
    ):
        ends = [ss.simulate(a_rig, until=until, initial=kick, rtol=rtol)["v"][-1] for rtol in (1e-7, 1e-11)]
        assert abs(np.log(ends[0] / ends[1])) < most


# -- small motions


@pytest.mark.parametrize(("law", "contact", "mass"), quarter(1))
def test_small_kicks_grow_as_the_eigenvalues_say(law, contact, mass):
    """A small kick is a sum of exponentials with the rates that linear stability gives, and nothing else is left.

    The kick is a millionth of a slip distance and grows to e^4 times that, so that squares of it are not seen.
    """
    if isinstance(contact, ss.Lift):
        contact = ss.Lift(preload=5e6, lift=2e10, v_ref=1e-6)  # far enough from ill-posed for a kick to stay small
    random = np.random.default_rng(31 * len(law) + len(contact.name))
    a_rig = rig(friction=LAWS[law], contact=contact, mass=mass, stiffness=float(random.uniform(3e9, 3e10)))
    if law == "prakash-clifton" and contact.name == "linear" and not mass:
        pytest.skip("ill-posed")
    if law == "lugre" and isinstance(contact, ss.Lift):
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


# -- blow-up


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
    run = ss.simulate(unit_rig(law, lam, share * lam), ss.VelocityStep(at=0.0, to=step), until=1000.0)
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
    assert survives(a_rig, ss.VelocityStep(at=0.0, to=velocity * (1 - 1e-5)), 3000 / scale)
    assert not survives(a_rig, ss.VelocityStep(at=0.0, to=velocity * (1 + 1e-5)), 3000 / scale)
    for branch in (0, -1):
        step = (1 + lambertw(-lam / (np.e * (1 + lam)), branch).real) / lam
        assert survives(a_rig, ss.DisplacementStep(at=0.0, by=step * (1 - 1e-5)))
        assert not survives(a_rig, ss.DisplacementStep(at=0.0, by=step * (1 + 1e-5)))


# -- normal stress that changes


@pytest.mark.parametrize(("evolution", "shift"), [("aging", -0.0034235), ("slip", -0.0075895), ("prz", None)])
def test_fast_modulation_lowers_friction(evolution, shift):
    """Theory 4: mean shear stress under fast oscillation of normal stress; a = .01, b = .015, μ = .6, ε = .02."""
    a, b, mu, eps = A, 0.015, MU, 0.02

    def mean(function):
        return quad(lambda c: function((t_of[0] / (1 + eps * np.cos(c)) - mu) / a), 0, np.pi)[0] / np.pi

    t_of = [mu]
    if evolution == "prz":

        def closure(t):
            t_of[0] = t
            # φ = [T/(1+ε cos) − μ − bϑ]/a with <e^φ> = 1 and ϑ = −½ ln <e^2φ>
            first, second = mean(np.exp), mean(lambda z: np.exp(2 * z))
            theta = a / b * np.log(first)
            return theta + 0.5 * np.log(second / first**2)

        shift = brentq(closure, mu - 0.02, mu) - mu
    a_rig = unit_rig(evolution, b / a - 1, 3.0)
    period = 2e-3
    wave = ss.NormalStressHarmonic(amplitude=eps, period=period, phase=np.pi / 2)
    run = ss.simulate(a_rig, wave, until=30.0, times=np.linspace(30 - period, 30, 9), events=False)
    assert run["spring_stress"].mean() - mu == pytest.approx(shift, abs=2e-6)


@pytest.mark.parametrize("memory", [0.0, 0.3])
def test_response_to_a_small_oscillation_of_normal_stress(memory):
    """Theory 4 (Perfettini et al. 2001): amplitude and phase of ln v, at and off resonance."""
    lam, kappa, eps = 0.5, 0.012, 1e-5
    friction = {"normal_memory": ss.LinkerDieterich(alpha=memory)} if memory else {}
    a_rig = unit_rig("slip", lam, kappa / A, **friction)
    for period in (2 * np.pi * np.sqrt(A / kappa), 3.0):
        s = 2j * np.pi / period
        gain = -s * ((MU - memory) * s + MU) / (A * s**2 + (kappa - lam * A) * s + kappa)
        wave = ss.NormalStressHarmonic(amplitude=eps, period=period)
        times = 60 * period + np.linspace(0, period, 33)[:-1]
        run = ss.simulate(a_rig, wave, until=61 * period, times=times, events=False, rtol=1e-10)
        angle = 2 * np.pi * times / period
        amplitude = 2 * np.mean(phi_of(run) * np.exp(-1j * (angle - np.pi / 2)))
        assert amplitude / eps == pytest.approx(gain, rel=2e-3)


def test_step_of_normal_stress_is_exact():
    """A jump moves Θ by −(α/b) ln(σ2/σ1), leaves x, and τ = T at the new velocity."""
    a_rig = rig(friction=ONE_MEMORY[1], stiffness=2e10)
    run = ss.simulate(a_rig, ss.NormalStressStep(at=1.0, by=5e5), until=2.0)
    before, after = np.flatnonzero(run["t"] == 1.0)
    change = run["Theta"][after] - run["Theta"][before]
    assert change == pytest.approx(-0.4 / 0.016 * np.log(5.5 / 5), rel=1e-12)
    assert run["x"][after] == run["x"][before]
    assert run["Psi"][after] == pytest.approx(run["Psi"][before], rel=1e-14)
    assert run["shear_stress"][after] == run["spring_stress"][after]
    assert run["normal_stress"][after] - run["normal_stress"][before] == pytest.approx(5e5)


# -- protocols


def test_every_breakpoint_is_a_step_of_the_solver():
    protocol = [
        ss.Hold(at=1.0, duration=2.0),
        ss.VelocityRamp(at=4.0, to=3e-6, duration=0.5),
        ss.DisplacementStep(at=5.25, by=1e-8),
        ss.NormalStressPulse(at=6.0, by=1e5, duration=0.125),
        ss.DisturbancePulse(at=7.0, by=1e4, duration=0.3),
    ]
    run = ss.simulate(rig(stiffness=2e10), protocol, until=8.0)
    for moment in (1.0, 3.0, 4.0, 4.5, 5.25, 6.0, 6.125, 7.0, 7.3):
        assert np.sum(np.abs(run["t"] - moment) < 1e-12) == 2, moment
    assert np.all(np.diff(run["t"]) >= 0)
    held = (run["t"] > 1.0) & (run["t"] < 3.0)
    assert np.all(run["load_velocity"][held] == 0)
    assert np.all(np.diff(run["v"][held]) < 0)


def test_breakpoints_where_nothing_happens_change_nothing():
    a_rig = rig(stiffness=9e9)
    plain = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=2e-6), until=20.0, rtol=1e-10)
    idle = [ss.DisturbancePulse(at=t, by=0.0, duration=0.01) for t in (0.5, 3.3, 7.7, 12.0)]
    split = ss.simulate(a_rig, [ss.VelocityStep(at=1.0, to=2e-6), *idle], until=20.0, rtol=1e-10)
    assert split["v"][-1] == pytest.approx(plain["v"][-1], rel=1e-8)


def test_a_table_of_the_load_point_is_followed_exactly():
    """A sampled ramp is the same motion as the ramp of displacement it samples, however it is sampled."""
    random = np.random.default_rng(3)
    time = np.unique(np.concatenate([[0.0, 1.0], random.uniform(0, 6, 200), [6.0]]))
    displacement = 1e-6 * time + 2e-6 * np.maximum(time - 1.0, 0.0)
    a_rig = rig(stiffness=1.2e10)
    table = ss.simulate(a_rig, ss.LoadPointTable(time=time, displacement=displacement), until=6.0, rtol=1e-10)
    step = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=3e-6), until=6.0, rtol=1e-10)
    assert table["v"][-1] == pytest.approx(step["v"][-1], rel=1e-7)
    assert table["load_displacement"][-1] == pytest.approx(displacement[-1], rel=1e-12)


def test_slip_is_that_of_the_load_point_plus_x():
    protocol = [ss.DisplacementStep(at=1.0, by=2e-7), ss.VelocityHarmonic(amplitude=5e-7, period=1.7, at=0.4)]
    run = ss.simulate(rig(stiffness=2e10), protocol, until=5.0, times=np.linspace(0, 5, 4001), rtol=1e-10)
    velocity = 0.5 * (run["v"][1:] + run["v"][:-1])
    slip = np.concatenate([[0], np.cumsum(np.diff(run["t"]) * velocity)])
    assert np.max(np.abs(slip - run["slip"])) < 2e-5 * run["slip"][-1]
    assert run["spring_stress"] == pytest.approx(run["spring_stress"][0] - 2e10 * run["x"], rel=1e-12)


def test_requested_times_agree_with_the_solver_s_own():
    a_rig = rig(stiffness=9e9)
    own = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9)
    asked = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9, times=np.unique(own["t"]))
    last = dict(zip(own["t"], own["v"], strict=True))  # after a jump
    assert asked["v"] == pytest.approx(np.array([last[t] for t in asked["t"]]), rel=1e-9)
    between = np.linspace(0, 10, 777)
    dense = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-9, times=between)
    tight = ss.simulate(a_rig, ss.VelocityStep(at=1.0, to=2e-6), until=10.0, rtol=1e-12, times=between)
    assert dense["v"] == pytest.approx(tight["v"], rel=1e-6)


# -- laws of machines, and of users


def test_coulomb_friction_sticks_and_breaks_loose_at_the_static_limit():
    """Stuck blocks creep at less than a millionth; friction reaches μ_S σ before each slip, no more."""
    friction = ss.CoulombStribeck(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, viscous=0.5)
    contact = ss.Constant(preload=1e5)
    a_rig = ss.Slider(friction=friction, contact=contact, stiffness=1e8, mass=100.0, drive=ss.Steady(1e-3))
    run = ss.simulate(a_rig, ss.VelocityStep(at=0.01, to=1.1e-3), until=1.0)
    assert run.status == "done"
    assert len(run.slip_events) > 4
    late = run["t"] > 0.3
    assert run["shear_stress"][late].max() == pytest.approx(3e4, rel=2e-3)
    stuck = late & (run["v"] < 1e-6)
    assert np.sum(stuck) > 20
    assert np.all(run["v"][stuck] > -1e-8)


class Softening(ss.FrictionLaw):
    """A law of one's own: strength falls with a saturating memory, and a kink."""

    mu: float = ss.parameter("1", positive, "level")
    a: float = ss.parameter("1", positive, "direct effect")
    c: float = ss.parameter("1", real, "evolution effect")
    length: float = ss.parameter("m", positive, "slip distance")
    v_ref: float = ss.parameter("m/s", positive, "reference")

    def memory(self):
        return ("s",)

    def strength(self, v, sigma, memory, tau):
        import sympy as sp

        bent = sp.Piecewise((memory[0], memory[0] > -1), (2 * memory[0] + 1, True))
        return sigma * (self.mu + self.a * sp.log(v / self.v_ref) + self.c * sp.tanh(bent))

    def rates(self, v, sigma, memory, tau):
        import sympy as sp

        return (-v / self.length * (memory[0] + sp.log(v / self.v_ref)),)

    def steady_memory(self, v, sigma):
        import sympy as sp

        return (-sp.log(v / self.v_ref),)


@pytest.mark.parametrize("mass", [0.0, 1e9])
def test_a_law_of_one_s_own_moves(mass):
    from oracle import Oracle

    law = Softening(mu=0.6, a=0.01, c=0.015, length=1e-6, v_ref=1e-6)
    a_rig = rig(friction=law, mass=mass, stiffness=2e10, radiation_damping=1e10)
    run = ss.simulate(a_rig, until=2.0, initial={"x": 5e-7}, rtol=1e-9)
    assert run.status == "done"
    expected = Oracle(a_rig).run(2.0, x=5e-7)
    assert [run["x"][-1], run["v"][-1], run["s"][-1]] == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_summary_tells_the_same_whatever_the_steps():
    """Extremes of velocity are located, not picked from samples."""

    def lines(**options):
        run = ss.simulate(unit_rig("slip", 0.5, 0.45, damping=1e-3), until=40.0, initial={"v": 1.5}, **options)
        return str(run).splitlines()[1]

    assert lines() == lines(rtol=1e-11) == lines(times=[0.0, 40.0])


def test_a_method_that_would_compile_for_minutes_is_refused():
    """Where each of many stages would solve the balance of forces; what `auto` and few stages do is not touched."""
    rock = ss.RateState(a=0.014, b=0.016, d_c="1 um", mu_ref=0.7, v_ref="1 um/s", regularised=True)
    slow = ss.Slider(
        friction=rock, contact=ss.Constant(preload="5 MPa"), stiffness="12 GPa/m", drive=ss.Steady("1 um/s"),
        radiation_damping=1e6,
    )  # fmt: skip
    assert prepare(slow, None, 1.0, {}, {}, Options()).reduction.unknown is not None
    for run in (ss.simulate, lambda a_rig, **more: ss.simulate_many(a_rig, {"stiffness": [1e10, 2e10]}, **more)):
        with pytest.raises(ss.ParameterError, match=r"13 stages.*allowed here: auto, tsit5, rodas4, rodas5p"):
            run(slow, until=1.0, method="dop853")
    for method in ("auto", "explicit", "rosenbrock", "rodas5p"):
        assert prepare(slow, None, 1.0, {}, {}, Options(method=method)).reduction.unknown is not None


def test_the_range_of_velocity_is_that_of_the_run_not_of_its_samples():
    """A drop at a step lies between samples; the lowest and highest of the solver's own steps are met."""
    plan = [ss.VelocityStep(at=10.0, to=1e-8), ss.VelocityStep(at=20.0, to=3e-6)]
    a_rig = rig(stiffness=2e10)
    whole = ss.simulate(a_rig, plan, until=30.0)
    few = ss.simulate(a_rig, plan, until=30.0, times=[0.0, 30.0])
    assert few["v"].min() > 1.5 * whole["v"].min()
    assert few.velocities == pytest.approx(whole.velocities, rel=1e-9)
    assert whole.velocities[0] <= whole["v"].min()
    assert whole.velocities[1] >= whole["v"].max()
    assert str(few).splitlines()[1].split(", at")[0] == str(whole).splitlines()[1].split(", at")[0]
