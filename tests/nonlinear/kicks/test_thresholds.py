"""How large a kick is survived: closed forms, theory 7's table, and simulated motion on both sides."""

from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy.special import lambertw

import steadyslip as ss
from dimensionless import unit_rig
from rigs_of_theory import rate_state, rig


def inclined(angle, factor=1.2, law=None, **more):
    """The paper's rig at a multiple of its critical stiffness."""
    rock = ss.laws.RateState(a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, evolution=law or ss.laws.Slip(),
                        normal_memory=ss.laws.LinkerDieterich(alpha=0.56))  # fmt: skip
    contact = ss.laws.InclinedSpring(preload=5e6, angle=np.radians(angle))
    base = ss.Slider(friction=rock, contact=contact, stiffness=9e9, drive=ss.machine.SteadyDrive(1e-6), **more)
    return base.with_values({"stiffness": factor * ss.critical_stiffness(base)})


survived = cache(ss.threshold)


# -- closed forms of theory 7, slip law at the edge


@pytest.mark.parametrize("lam", [0.0015 / 0.0145, pytest.param(0.3, marks=pytest.mark.campaign), 1.0])
def test_velocity_step_at_the_edge(lam):
    """ln(v_new/v_old) = ln(b/(b − a))."""
    found = survived(unit_rig("slip", lam, lam))
    assert found.size == pytest.approx(np.log((1 + lam) / lam), rel=1e-6)
    assert found.outcome == "blow-up"
    assert found.bracket[0] <= found.size <= found.bracket[1]
    assert found.amount == pytest.approx((1 + lam) / lam, rel=1e-6)


@pytest.mark.parametrize("lam", [0.0015 / 0.0145, 0.5])
def test_displacement_step_at_the_edge(lam):
    """d/d_c = [1 + W(−λ/(e(1+λ)))]/λ, branches 0 (forward) and −1 (backward)."""
    argument = -lam / (np.e * (1 + lam))
    forward = (1 + lambertw(argument, 0).real) / lam
    backward = (1 + lambertw(argument, -1).real) / lam
    assert survived(unit_rig("slip", lam, lam), "displacement").size == pytest.approx(forward, rel=1e-6)
    found = survived(unit_rig("slip", lam, lam), "displacement", direction=-1)
    assert (found.size, found.amount) == pytest.approx((-backward, backward), rel=1e-6)


def test_printed_thresholds():
    """Theory 7: 2.3671236, 9.321144 and −38.3832 d_c with the paper's a and b."""
    a_rig = unit_rig("slip", 0.0015 / 0.0145, 0.0015 / 0.0145)
    assert survived(a_rig).size == pytest.approx(2.3671236, abs=1e-6)
    assert survived(a_rig, "displacement").size == pytest.approx(9.321144, abs=1e-6)
    assert survived(a_rig, "displacement", direction=-1).size == pytest.approx(38.3832, abs=1e-4)


@pytest.mark.parametrize(
    ("angle", "velocity", "displacement"), [(0, 2.6757, 9.4292), (30, 2.9124, 9.3924), (-30, 2.2918, 9.4181)]
)
def test_table_of_theory(angle, velocity, displacement):
    """Theory 7, at 1.2 times the critical stiffness, everything taken at the new rate."""
    assert survived(inclined(angle), reference="after").size == pytest.approx(velocity, abs=1e-4)
    assert survived(inclined(angle), "displacement").size == pytest.approx(displacement, abs=1e-4)


def test_supercritical_rig_survives_smaller_kicks_than_the_subcritical_one():
    """Theory 7's warning: the kind of onset says nothing about large kicks."""
    pair = [inclined(-30), inclined(30)]
    assert [ss.hopf(a_rig).kind for a_rig in pair] == ["supercritical", "subcritical"]
    sizes = [ss.threshold(a_rig, reference="after").size for a_rig in pair]
    assert sizes[0] < sizes[1]


def test_before_and_after_are_the_same_step_where_normal_stress_is_constant():
    a_rig = unit_rig("slip", 0.3, 0.4)
    after = ss.threshold(a_rig, reference="after")
    assert after.size == pytest.approx(ss.threshold(a_rig).size, rel=1e-7)
    assert after.amount == pytest.approx(np.exp(-after.size), rel=1e-7)


# -- the bracket is one: motion on both sides, by the integrator alone


@pytest.mark.parametrize(
    ("kick", "direction", "near"),
    [
        ("velocity", 1, 1e-3),
        ("displacement", 1, 1e-3),
        ("displacement", -1, 1e-3),
        ("normal-stress", 1, 0.05),  # close to where the rig is unstable at the new stress: everything is slow
        ("normal-stress", -1, 1e-3),
    ],
)
def test_motion_on_both_sides(kick, direction, near):
    a_rig = inclined(30)
    found = ss.threshold(a_rig, kick, direction=direction, precision=1e-6)
    pieces = {
        "velocity": lambda amount: ss.protocol.VelocityStep(at=0.0, to=amount),
        "displacement": lambda amount: ss.protocol.DisplacementStep(at=0.0, by=amount),
        "normal-stress": lambda amount: ss.protocol.NormalStressStep(at=0.0, by=amount),
    }
    for factor, survives in ((1 - near, True), (1 + near, False)):
        amount = found.amount * factor
        run = ss.simulate(a_rig, pieces[kick](amount), until=6e4 if kick == "displacement" else 6000.0, rtol=1e-10)
        drive = run["load_velocity"][-1]
        returned = run.status == "done" and abs(run["v"][-1] / drive - 1) < 0.02
        assert returned == survives


def test_impulse_with_mass():
    """A blow throws the block of the aging law over its unstable cycle; the peak of that cycle bounds it."""
    a_rig = unit_rig("aging", 0.5, 0.525 * 1.003, mass=0.05)
    found = ss.threshold(a_rig, "impulse", precision=5e-3)
    assert found.outcome == "oscillation"
    for factor, survives in ((0.99, True), (1.01, False)):
        v = 1 + found.size * factor
        run = ss.simulate(a_rig, until=2500.0, initial={"v": v}, times=[2490.0, 2500.0])
        peaks = [e.velocity for e in run.events if e.kind == "velocity peak"]
        assert (peaks[-1] < 0.95 * peaks[1]) == survives
        assert (peaks[-1] > 1.05 * peaks[1]) != survives


def test_velocity_that_is_solved_for_is_watched_in_lanes_too():
    """LuGre without mass: the velocity is no variable of the state; kicks and events run side by side all the same."""
    friction = ss.laws.LuGre(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, bristle_stiffness=1e5,
        bristle_damping=10.0,
                        viscous=5.0)  # fmt: skip
    a_rig = ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=1e6),
        stiffness=1e12,
        drive=ss.machine.SteadyDrive(3e-3),
    )
    found = ss.simulate_many(a_rig, {"stiffness": [1e12, 2e12]}, ss.protocol.DisplacementStep(at=0.0, by=1e-7),
        until=0.1,
                             events=True)  # fmt: skip
    assert list(found.status) == ["done", "done"]
    assert ss.threshold(a_rig, "displacement").size == np.inf


def test_no_kick_is_large_enough_for_a_hardening_rig():
    found = ss.threshold(unit_rig("slip", -0.3, 0.5))
    assert found.size == np.inf
    assert "kick that lasts: survives all up to 10000 m/s, the largest tried" in str(found)
    assert found.to_dict()["size"] is None


def test_what_is_survived_is_told_up_to_a_limit():
    """1e4 times the drive's velocity unless told; a threshold beyond the limit is none."""
    a_rig = unit_rig("slip", -0.3, 0.5)
    assert ss.threshold(a_rig).searched == pytest.approx(np.log(1e4))
    found = ss.threshold(a_rig, up_to=3.0)
    assert (found.size, found.searched, found.decided) == (np.inf, 3.0, True)
    assert found.survived == pytest.approx(np.exp(3.0))
    fails = unit_rig("slip", 0.5, 0.5)  # at ln 3
    assert ss.threshold(fails, up_to=1.0).size == np.inf
    assert ss.threshold(fails, up_to=1.2, precision=1e-4).size == pytest.approx(np.log(3), rel=1e-3)
    assert ss.threshold_map(fails, {"stiffness": [0.5]}, up_to=1.0)[0] == np.inf
    with pytest.raises(ss.ParameterError, match=r"up_to: got 30\.0; allowed: 0\.001 to 25"):
        ss.threshold(a_rig, up_to=30.0)


def test_unstable_sliding_survives_nothing():
    found = ss.threshold(unit_rig("slip", 0.5, 0.4))
    assert (found.size, found.outcome) == (0.0, "unstable")
    assert "unstable" in str(found)


@pytest.mark.parametrize("above", [1e-3, pytest.param(1e-5, marks=pytest.mark.campaign)])
def test_close_to_a_subcritical_edge_the_unstable_cycle_is_the_limit(above):
    """A displacement kick leaves normal stress as it is: it fails where it starts outside the small unstable cycle."""
    a_rig = inclined(30, 1 + above)
    (cycle,) = ss.cycles(a_rig).at(a_rig.stiffness)
    found = ss.threshold(a_rig, "displacement", precision=5e-3)
    assert found.outcome in ("oscillation", "blow-up")
    around = ss.orbit(a_rig, cycle)
    assert found.amount > 0
    # the kick moves x by −d at the memory of steady sliding; where the cycle has that memory, x is the same
    memory = around["Psi"] - ss.simulate(a_rig, until=1e-3)["Psi"][0]
    below = np.flatnonzero((memory[1:] * memory[:-1] <= 0) & (around["x"][1:] < 0))
    i = int(below[0])
    share = memory[i] / (memory[i] - memory[i + 1])
    x = around["x"][i] + share * (around["x"][i + 1] - around["x"][i])
    assert found.amount == pytest.approx(-x, rel=2e-2)


# -- margins and maps


def test_margin_to_an_expected_step():
    a_rig = inclined(30)
    limit = ss.threshold(a_rig).amount
    good = ss.margin_to_kick(a_rig, ss.protocol.VelocityStep(at=5.0, to=1e-6 * (limit / 1e-6) ** 0.5))
    assert (good.survives, good.ratio) == (True, pytest.approx(2, rel=1e-6))
    bad = ss.margin_to_kick(a_rig, ss.protocol.DisplacementStep(at=0.0, by=2e-5))
    assert not bad.survives
    assert "does not survive" in str(bad)
    with pytest.raises(ss.NotAvailable, match="simulate"):
        ss.margin_to_kick(a_rig, ss.protocol.Hold(at=0.0, duration=1.0))


def test_map_equals_single_thresholds():
    angles, factors = np.radians([-30.0, 0.0, 30.0]), np.array([1.1, 1.6, 3.0])
    base = inclined(0)
    stiffness = factors[:, None] * ss.critical_stiffness(base, {"contact.angle": angles})
    found = ss.threshold_map(base, {"contact.angle": angles, "stiffness": stiffness}, "displacement")
    for i in range(3):
        for j in range(3):
            one = base.with_values({"contact.angle": angles[j], "stiffness": stiffness[i, j]})
            assert found[i, j] == pytest.approx(ss.threshold(one, "displacement").size, rel=2e-4)


def test_map_is_honest_where_there_is_nothing_to_find():
    """Unstable 0, hardening inf, lock-up NaN; labelled arrays stay labelled."""
    base = inclined(0)
    angle = xr.DataArray(np.radians([-80.0, 0.0]), dims="angle")
    b = xr.DataArray([0.010, 0.016], dims="b")
    stiffness = xr.DataArray([5e9, 9e9], dims="k")
    found = ss.threshold_map(base, {"contact.angle": angle, "friction.b": b, "stiffness": stiffness})
    assert set(found.dims) == {"angle", "b", "k"}
    assert np.isnan(found.isel(angle=0)).all()
    level = found.isel(angle=1)
    assert np.isinf(level.isel(b=0)).all()
    assert level.isel(b=1, k=0) == 0
    assert 2 < level.isel(b=1, k=1) < 3


def test_map_does_not_depend_on_threads():
    base = inclined(0)
    vary = {"stiffness": np.linspace(8e9, 2e10, 7)}
    assert np.array_equal(ss.threshold_map(base, vary, threads=1), ss.threshold_map(base, vary, threads=2))


# -- the basin


def test_unstable_cycle_bounds_the_basin():
    """In the plane of a massless rig with one memory, inside returns and outside does not."""
    a_rig = inclined(30, 1.005)
    found = ss.basin(a_rig, x=np.linspace(-1.2e-5, 3e-6, 9), v=1e-6 * np.geomspace(0.3, 30, 7))
    (cycle,) = found.cycles
    from matplotlib.path import Path

    outline = Path(np.column_stack([cycle["x"] * 1e6, np.log(cycle["v"] / 1e-6)]))
    for i, v in enumerate(found.v):
        for j, x in enumerate(found.x):
            inside = outline.contains_point((x * 1e6, np.log(v / 1e-6)))
            assert (found.outcome[i, j] == "returns") == inside
    assert 0 < found.share < 1
    ax = found.plot()
    assert "unstable cycle" in ax.get_legend_handles_labels()[1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kick": "veloctiy"}, "velocity"),
        ({"direction": 2}, "allowed: 1, -1"),
        ({"reference": "during"}, "'before' or 'after'"),
        ({"precision": 0.0}, "allowed: a finite number above 0, up to 0.1"),
        ({"kick": "impulse"}, "needs a mass"),
    ],
)
def test_bad_arguments_are_named(options, message):
    with pytest.raises(ss.SteadyslipError, match=message):
        ss.threshold(inclined(0), **options)


def test_lock_up_is_said():
    with pytest.raises(ss.NoSteadySliding):
        ss.threshold(rig(friction=rate_state(mu_ref=0.7), contact=ss.laws.InclinedSpring(preload=5e6, angle=-1.4)))


def test_verdict_with_kicks():
    found = ss.analyze(inclined(30), kick=["velocity", "displacement"])
    assert [kick.kick for kick in found.kicks] == ["velocity", "displacement"]
    assert "survives a lasting velocity step to" in str(found)
    assert found.to_dict()["kicks"][1]["unit"] == "m"


def test_map_is_drawn_with_units():
    """Axes had the last part of a dotted path, mu_ref or d c, and units only if they were given."""
    grids = {"contact.angle": np.radians([-20.0, 0.0, 20.0]), "stiffness": [5e9, 1e10, 1.5e10], "friction.d_c": [1e-6]}
    vary = {name: xr.DataArray(values, dims=name, coords={name: values}) for name, values in grids.items()}
    angle = vary["contact.angle"]
    found = ss.threshold_map(inclined(0), vary, "displacement")[:, :, 0]
    assert not angle["contact.angle"].attrs, "those of the user stay as they are"
    ax = ss.figures.threshold_map(found)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("stiffness k (GPa/m)", "angle ψ (deg)")
    assert found["friction.d_c"].attrs == {"units": "m", "long_name": "slip distance d_c"}
    named = found.assign_coords({"stiffness": found["stiffness"].assign_attrs(long_name="spring k_s")})
    assert ss.figures.threshold_map(named).get_xlabel() == "spring $k_{\\mathrm{s}}$ (GPa/m)"
    assert "steady sliding is unstable" in ax.get_legend_handles_labels()[1]
    with pytest.raises(ss.ParameterError, match="two dimensions"):
        ss.figures.threshold_map(found.values)


def test_a_block_whose_velocity_is_a_formula_has_a_threshold():
    """Regularised PRZ without mass: nothing is left to solve for, so that motion goes on without a guess."""
    friction = ss.laws.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, evolution=ss.laws.PRZ(), regularised=True
    )
    rig = ss.Slider(
        friction=friction,
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=9e9,
        drive=ss.machine.SteadyDrive(1e-6),
    )
    found = ss.threshold(rig, precision=0.01)
    assert found.bracket[0] > 0
