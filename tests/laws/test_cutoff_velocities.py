"""Direct and evolution effects that fade at speed (Okubo 1989; theory 12)."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import PchipInterpolator

import steadyslip as ss
from cutoff_rigs import ByHand, check_eigenvalues, check_motion
from explored import Explored, compared
from friction_laws import EVOLUTIONS, ONE, ROCK, ingredients, modest, rig_with, small, velocities

FAST = 1e30  # m/s, beyond all velocities: the law without cut-offs


def law_with(**own):
    return ss.laws.RateState(**({"a": 0.006, "b": 0.010, "d_c": 8e-6, "mu_ref": 0.6, "v_ref": 1e-5} | own))


def rig_of(law, **own):
    drive = {"stiffness": 1e9, "drive": ss.machine.SteadyDrive(1e-5)}
    return ss.Slider(friction=law, contact=ss.laws.ConstantNormalStress(preload=1e7), **(drive | own))


cutoffs = st.floats(1e-9, 1e-2)


@modest
@given(
    a=small, b=small, v=velocities, v_a=cutoffs, v_b=cutoffs, alpha=st.floats(0.01, 0.6),
    which=st.sampled_from(EVOLUTIONS),
)  # fmt: skip
def test_small_perturbations(a, b, v, v_a, v_b, alpha, which):
    """f, S, r, f1 and μ of theory 12; α is its value far below the cut-off."""
    memory = ss.laws.LinkerDieterich(alpha=alpha)
    law = ss.laws.RateState(
        a=a, b=b, d_c=2e-6, mu_ref=0.7, v_ref=1e-6, evolution=which, normal_memory=memory,
        a_cutoff_velocity=v_a, b_cutoff_velocity=v_b,
    )  # fmt: skip
    sigma, c = 3e6, getattr(which, "c_nagata", 0.0)
    a1, b1 = a * v_a / (v_a + v), b * v_b / (v_b + v)
    mu = 0.7 + a * (np.log1p(v_a / 1e-6) - np.log1p(v_a / v)) + b * (np.log1p(v_b / v) - np.log1p(v_b / 1e-6))
    grip = 1 + c * b1 / b
    # at fixed Φ friction answers c times as much less; the memory fades that much more slowly
    expected = [a1 * sigma / v / grip, (a1 - b1) * sigma / v, v / 2e-6 / grip, mu - alpha * b1 / b / grip, mu]
    size = [sigma / v * (a + b), sigma / v * (a + b), v / 2e-6, 1, 1]
    np.testing.assert_array_less(np.abs(np.subtract(ingredients(law, v, sigma), expected)), 1e-12 * np.array(size))


def test_critical_stiffness_of_the_theory():
    law = law_with(evolution=ss.laws.Aging(), b_cutoff_velocity=1e-4)
    assert ss.critical_stiffness(rig_of(law)) == pytest.approx(42.5e9 / 11, rel=1e-12)
    (edge,) = ss.boundary(rig_of(law, stiffness=1.0), "drive.velocity")
    assert (edge.value, edge.stable) == (pytest.approx(200e-6 / 3, rel=1e-6), "above")


@pytest.mark.parametrize("evolution", EVOLUTIONS, ids=lambda one: one.name)
def test_cutoffs_beyond_all_velocities_are_none(evolution):
    memory = ss.laws.LinkerDieterich(alpha=0.3)
    without = ss.laws.RateState(**ROCK, **ONE, evolution=evolution, normal_memory=memory)
    far = ss.laws.RateState(
        **ROCK, **ONE, evolution=evolution, normal_memory=memory, a_cutoff_velocity=FAST, b_cutoff_velocity=FAST
    )
    for v in (1e-12, 1e-6, 1.0):
        np.testing.assert_allclose(
            ingredients(far, v, 5e6), ingredients(without, v, 5e6), rtol=1e-12, atol=1e-13 * 5e6 / v * 0.03
        )
    one, other = ss.eigenvalues(rig_with(far, mass=1e3)), ss.eigenvalues(rig_with(without, mass=1e3))
    np.testing.assert_allclose(one, other, rtol=1e-11)


@pytest.mark.parametrize("evolution", EVOLUTIONS, ids=lambda one: one.name)
def test_everything_is_finite_from_creep_to_slip(evolution):
    memory = ss.laws.LinkerDieterich(alpha=0.2)
    law = law_with(a_cutoff_velocity=1e-2, b_cutoff_velocity=1e-4, normal_memory=memory, evolution=evolution)
    speeds = np.logspace(-30, 1, 63)
    assert np.all(np.isfinite(ss.growth_rate(rig_of(law), {"drive.velocity": speeds})))
    steady = [ss.steady_state(rig_of(law, drive=ss.machine.SteadyDrive(v))).shear_stress for v in speeds[::10]]
    assert np.all(np.isfinite(steady))


def test_against_equations_typed_by_hand():
    for seed in range(3, 11):
        assert check_eigenvalues(ByHand(np.random.default_rng(seed))) < 1e-12
    rig = ByHand(np.random.default_rng(2))  # two states, one of which fades, on an inclined spring
    difference = check_motion(rig)
    assert difference is not None
    assert difference < 3e-9


@pytest.mark.campaign
def test_random_rigs_against_equations_typed_by_hand():
    compared = 0
    for seed in range(3, 9):
        rig = ByHand(np.random.default_rng(seed))
        assert check_eigenvalues(rig) < 1e-12, seed
        if (difference := check_motion(rig)) is not None:
            compared += 1
            assert difference < 3e-8, seed
    assert compared > 4


PEAKS = {  # mm/s at κ = .75, .78, .89 (theory 12), silent at 1.1
    ("slip", 3e-4): (0.83, 0.66, 0.22),
    ("aging", 3e-4): (0.59, 0.47, 0.17),
    ("aging", 1e-3): (3.1, 2.4, 0.76),
}


@pytest.mark.campaign
@pytest.mark.parametrize(("evolution", "v_b"), PEAKS, ids=str)
def test_peak_velocities_of_slow_slip(evolution, v_b):
    law = law_with(evolution={"slip": ss.laws.Slip(), "aging": ss.laws.Aging()}[evolution], b_cutoff_velocity=v_b)
    rig = rig_of(law, mass=500)
    critical = 1e7 * (0.010 * v_b / (v_b + 1e-5) - 0.006) / 8e-6
    kick = [ss.protocol.VelocityStep(at=0.1, to=1.05e-5), ss.protocol.VelocityStep(at=0.2, to=1e-5)]
    for kappa, peak in zip((0.75, 0.78, 0.89), PEAKS[evolution, v_b], strict=True):
        run = ss.simulate(rig.with_values({"stiffness": kappa * critical}), kick, until=1500)
        late = run["v"][run["t"] > 1000]
        assert np.max(late) * 1e3 == pytest.approx(peak, rel=0.02)
    silent = ss.simulate(rig.with_values({"stiffness": 1.1 * critical}), kick, until=1500)
    assert silent["v"][-1] == pytest.approx(1e-5, rel=1e-3)


def test_a_law_that_fades_at_speed_does_not_run_away():
    """Without mass the direct effect outlasts evolution, unless it fades too."""
    kick = ss.protocol.VelocityStep(at=1, to=1.2e-5)
    bounded = ss.simulate(rig_of(law_with(b_cutoff_velocity=1e-4), stiffness=3e9), kick, until=60)
    assert bounded.status == "done"
    text = str(ss.analyze(rig_of(law_with(b_cutoff_velocity=1e-4))))
    assert "run-away" not in text
    assert "run-away" in str(ss.analyze(rig_of(law_with(a_cutoff_velocity=1e-4))))


def test_refusals():
    with pytest.raises(ss.ParameterError, match="a_cutoff_velocity: not defined for the regularised law"):
        law_with(regularised=True, a_cutoff_velocity=1e-3)
    states = (ss.laws.State(b=0.01, d_c=1e-5),)
    with pytest.raises(ss.ParameterError, match="b_cutoff_velocity: given beside states"):
        law_with(b=None, d_c=None, states=states, b_cutoff_velocity=1e-3)
    with pytest.raises(ss.ParameterError, match="b: got 0; "):
        law_with(b=0.0, b_cutoff_velocity=1e-3, normal_memory=ss.laws.LinkerDieterich(alpha=0.3))
    assert law_with(b=0.0, b_cutoff_velocity=1e-3).b == 0


FADING = {"a_cutoff_velocity": 1e-2, "b_cutoff_velocity": 1e-4}


@pytest.mark.parametrize("evolution", EVOLUTIONS, ids=lambda one: one.name)
def test_the_onset_of_creep_is_that_without_cutoffs(evolution):
    """What cut-offs add to the cubic coefficient goes to zero with v/v_b, in units of v/d_c."""

    def coefficient(v, **own):
        return (
            ss.hopf(rig_of(law_with(evolution=evolution, **own), drive=ss.machine.SteadyDrive(v))).coefficient
            * 8e-6
            / v
        )

    added = [(coefficient(v, **FADING) - coefficient(v)) * 1e-4 / v for v in (1e-30, 1e-20, 1e-12)]
    if abs(coefficient(1e-30)) < 1e-9:  # without cut-offs neither kind: digits are left to see that it is linear
        np.testing.assert_allclose(added, added[0], rtol=1e-6)
    assert coefficient(1e-30, **FADING) == pytest.approx(coefficient(1e-30), rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("mass", [0.0, 500.0])
def test_motion_of_creep_is_that_of_any_other_creep(mass):
    """Far below the cut-offs only the drive's own velocity counts; at speeds where both have faded runs are finite."""
    found = []
    for v in (1e-30, 1e-20, 10.0):
        own = rig_of(
            law_with(evolution=ss.laws.Aging(), **FADING), stiffness=5.5e9, mass=mass, drive=ss.machine.SteadyDrive(v)
        )
        times = np.linspace(0, 100e-6 / v, 50)
        run = ss.simulate(own, ss.protocol.VelocityStep(at=8e-6 / v, to=1.2 * v), until=times[-1], times=times)
        assert run.status == "done"
        found.append(run["v"] / v)
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-5)
    assert np.ptp(found[0]) > 0.3


def test_maps_are_finite_from_creep_to_slip(tmp_path):
    over = {"drive.velocity": np.logspace(-30, 1, 9), "friction.b_cutoff_velocity": np.array([1e-30, 1e-9, 1e-4, 1.0])}
    rig = rig_of(law_with(**FADING), mass=500)
    found = ss.run_map(ss.Map(rig, over, compute=["status", "growth_rate", "critical_stiffness"]), tmp_path / "m.zarr")
    v, v_b = np.meshgrid(*over.values(), indexing="ij")
    weakens = 0.010 * v_b / (v_b + v) - 0.006 * 1e-2 / (1e-2 + v)
    exact = 1e7 * weakens / 8e-6 * (1 + 500 * v**2 / (0.006 * 1e-2 / (1e-2 + v) * 1e7 * 8e-6))
    data = found.dataset
    critical = np.asarray(data["critical_stiffness"])
    assert np.all(np.isfinite(np.asarray(data["growth_rate"])))
    np.testing.assert_array_equal(np.isfinite(critical), weakens > 0)
    np.testing.assert_allclose(critical[weakens > 0], exact[weakens > 0], rtol=1e-11)


@pytest.mark.campaign
def test_kicks_of_creep_that_just_run_away():
    """Cut-offs end slip that runs away: the smallest kick that does reaches them from fifteen decades below."""
    v = 1e-20
    own = rig_of(law_with(evolution=ss.laws.Aging(), **FADING), stiffness=6e9, drive=ss.machine.SteadyDrive(v))
    size = ss.threshold(own, "velocity", up_to=25.0).size
    steps = [ss.protocol.VelocityStep(at=0.0, to=v * np.exp(share * size)) for share in (0.99, 1.01)]
    ends = [ss.simulate(own, step, until=200 * 8e-6 / step.to).status for step in steps]
    assert ends == ["done", "blow-up"]


@pytest.mark.campaign
def test_cycles_of_creep_are_those_of_any_other_creep():
    """Periods in d_c/v over amplitudes, as steps along branches may differ."""
    found = []
    for v in (1e-30, 1e-20):
        rig = rig_of(law_with(evolution=ss.laws.Slip(), **FADING), stiffness=3e9, drive=ss.machine.SteadyDrive(v))
        branch = ss.cycles(rig, "stiffness", between=(2e9, 6e9))
        assert np.all(np.isfinite(branch["period"]))
        found.append(PchipInterpolator(branch["amplitude"], branch["period"] * v))
    sizes = np.linspace(0.01, 8.0, 40)
    np.testing.assert_allclose(found[0](sizes), found[1](sizes), rtol=1e-3)


@pytest.mark.parametrize("mass", [0.0, 500.0])
def test_pages_from_creep_to_slip_are_those_of_python(mass):
    kept = {"friction": law_with(evolution=ss.laws.PRZ(), **FADING), "mass": mass}
    explored = Explored(rig_of(law_with(evolution=ss.laws.PRZ(), **FADING), mass=mass))
    for v in (1e-30, 1e-12, 1e-5, 1e-3, 10.0):
        for k in (1e9, 1e10):
            own = ss.Slider(
                contact=ss.laws.ConstantNormalStress(preload=1e7), stiffness=k, drive=ss.machine.SteadyDrive(v), **kept
            )
            apart = compared(explored, own)
            assert apart.verdicts[0] == apart.verdicts[1]
            assert max(apart.critical, apart.ends, apart.eigenvalues) < 1e-12


@pytest.mark.parametrize("faster", [1.0, 1e-9, 1e3])
@pytest.mark.campaign
def test_a_fit_tells_both_cutoffs(faster):
    """Steps over 3000-fold rates: where both effects fade, the record says at which velocities; of creep, slip too."""
    cutoffs = {"a_cutoff_velocity": 1e-3 * faster, "b_cutoff_velocity": 2e-4 * faster}
    truth = law_with(v_ref=1e-6 * faster, d_c=1e-5, **cutoffs)
    rig = rig_of(truth, stiffness=2e10).with_values({"drive.velocity": 1e-6 * faster})
    steps = [
        ss.protocol.VelocityStep(at=at / faster, to=to * faster)
        for at, to in ((20, 1e-5), (40, 1e-4), (44, 1e-3), (44.5, 3e-3))
    ]
    times = np.concatenate([np.linspace(0, 40, 400), 40 + np.linspace(0.01, 4, 400), 44 + np.linspace(0.001, 0.7, 400)])
    times = times / faster
    run = ss.simulate(rig, steps, until=times[-1], times=times)
    noise = np.random.default_rng(1).normal(scale=1e-4, size=len(times))
    record = ss.record_from_arrays(time=times, friction=run["friction"] + noise, source="synthetic")
    start = rig.with_values({name: value * 3 for name, value in cutoffs.items()})
    fit = ss.fit(start, record, protocol=steps, free=[f"friction.{name}" for name in cutoffs])
    for name, value in cutoffs.items():
        assert abs(fit[name].value - value) < 4 * fit[name].error
        assert fit[name].error < 0.1 * value


def test_alternatives_keep_what_the_law_has():
    """Of one and of two states, with cut-off velocities, a fit may try each."""
    one = law_with(a_cutoff_velocity=1e-4, b_cutoff_velocity=1e-3)
    two = one.alternatives()["two states"](one)
    assert [state.b_cutoff_velocity for state in two.states] == [1e-3, 1e-3]
    for law in (one, two):
        for change in law.alternatives().values():
            assert change(law).a_cutoff_velocity == 1e-4
    assert two.alternatives()["aging"](two).b_cutoff_velocity == 1e-3
