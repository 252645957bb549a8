"""a − b, critical stiffness and k/k_c of a fit: against its draws, the formula, and the truth."""

import numpy as np
import pytest

import steadyslip as ss
from lab_records import STEP, STIFFNESS, TRUTH, columns, record, rig, stepped, two_states
from steadyslip.experiments.fitting.estimates import whole_covariance

TRUE_LEVEL = -0.0035


def by_name(fit):
    return {one.name: one for one in fit.derived}


def test_derived_numbers_are_those_of_the_rig_and_their_errors_those_of_draws():
    fit = stepped()
    found, fitted = by_name(fit), fit.rig()
    assert list(found) == ["a - b", "k_c", "k/k_c"]
    assert found["a - b"].value == fit.values["friction.a"] - fit.values["friction.b"]
    assert found["k_c"].value == pytest.approx(float(ss.critical_stiffness(fitted)), rel=1e-12)
    assert found["k/k_c"].value == pytest.approx(float(ss.safety_factor(fitted)), rel=1e-12)
    draws = ss.experiments.normal_draws(fit, 20_000)
    stress = fitted.contact.steady_normal_stress
    level = draws["friction.a"] - draws["friction.b"]
    edge = -stress * level / draws["friction.d_c"]
    assert fit["k_c"] == found["k_c"]
    np.testing.assert_allclose(draws["k_c"], edge, rtol=1e-9)
    assert f"  a - b  {found['a - b'].value:.4g} ± {found['a - b'].error:.2g}" in str(draws)
    for name, drawn in (("a - b", level), ("k_c", edge), ("k/k_c", draws["slider.stiffness"] / edge)):
        assert found[name].error == pytest.approx(np.std(drawn), rel=0.03)
        assert (found[name].low, found[name].high) == pytest.approx(np.quantile(drawn, [0.025, 0.975]), rel=0.003)
    assert abs(found["a - b"].value - TRUE_LEVEL) < 3 * found["a - b"].error
    assert found["a - b"].error < 0.3 * fit.errors["friction.a"]  # a and b go along with each other
    text = str(fit)
    assert all(f"  {name} " in text for name in found)
    assert fit.to_dict()["derived"]["a - b"]["error"] == found["a - b"].error


@pytest.mark.parametrize(
    ("b", "seed"),
    [(0.0145, 1), *(pytest.param(b, n, marks=pytest.mark.campaign) for b in (0.008, 0.0145) for n in range(2, 6))],
)
def test_steady_sliding_tells_a_minus_b_where_samples_miss_the_transient(b, seed, tmp_path):
    """These tell a and b, d_c and k only together, but the levels before and after tell the difference."""
    found = columns(rig(b=b), STEP, 20)
    friction = found["friction"] + 3e-5 * np.random.default_rng(seed).standard_normal(20)
    fit = ss.fit(ss.lab_rig(), ss.record_from_arrays(**found | {"friction": friction}))
    assert not all(fit[name].determined for name in ("friction.a", "friction.b"))
    assert list(by_name(fit)) == ["a - b"]
    level = fit["a - b"]
    assert level.error < 1e-4
    assert abs(level.value - (TRUTH["a"] - b)) < 3.5 * level.error
    assert "  a - b  " in str(fit)
    fit.save(tmp_path / "fit.nc")
    assert ss.load_fit(tmp_path / "fit.nc").derived == fit.derived


def test_directions_of_which_data_tell_nothing_leave_what_the_others_tell():
    """The difference of two unknowns with an error of .001, their sum with next to no information."""
    along, across = np.array([1.0, 1.0]) / np.sqrt(2), np.array([1.0, -1.0]) / np.sqrt(2)
    for little in (0.0, 1e-12, 1e-6, 1e-2):
        information = 1e6 * np.outer(across, across) + little * np.outer(along, along)
        found = whole_covariance(information, information)
        assert across @ found @ across == pytest.approx(1e-6, rel=1e-9)
        assert np.max(np.sqrt(np.diag(found))) == pytest.approx(2.0, rel=1e-6)  # nobody believes further


@pytest.mark.campaign
def test_all_states_count_and_each_record_has_its_own_edge():
    fit = ss.fit(ss.lab_rig(states=2), record(two_states(), STEP))
    states = [value for name, value in fit.values.items() if name.endswith(".b")]
    assert len(states) == 2
    assert by_name(fit)["a - b"].value == pytest.approx(fit.values["friction.a"] - sum(states), rel=1e-12)
    heavier = rig().with_values({"contact.steady_normal_stress": 2e7, "slider.stiffness": 4e10})
    joint = ss.fit(ss.lab_rig(), [record(rig(), STEP), record(heavier, STEP, 1)], separate=["slider.stiffness"])
    found = by_name(joint)
    assert list(found) == ["a - b", "k_c@1", "k_c@2", "k/k_c@1", "k/k_c@2"]
    assert found["k_c@2"].value == pytest.approx(2 * found["k_c@1"].value, rel=1e-3)


def test_without_an_edge_there_is_a_minus_b_alone():
    fit = ss.fit(ss.lab_rig(), record(rig(b=0.008), STEP))
    assert list(by_name(fit)) == ["a - b"]
    assert by_name(fit)["a - b"].value == pytest.approx(0.003, abs=4 * by_name(fit)["a - b"].error)


def test_a_slip_distance_that_no_rock_has_raises_a_word():
    """Millimetres taken for micrometres leave a and b as they are."""
    found = columns(rig(), STEP, 500)
    for factor, odd in ((1.0, False), (1e3, True), (1e-3, True)):
        record = ss.record_from_arrays(found["time"], friction=found["friction"], normal=found["normal"],
                                       displacement=factor * found["displacement"])  # fmt: skip
        fit = ss.fit(ss.lab_rig(), record)
        assert any("laboratories find" in warning for warning in fit.to_dict()["warnings"]) is odd


def test_without_a_displacement_the_rate_is_asked_for_and_named():
    """With another rate than the record's a came out half: nothing in the record shows it."""
    faster = rig().with_values({"drive.velocity": 3e-6})
    protocol = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=60.13, to=15e-6),), until=150.0)
    found = columns(faster, protocol, 500)
    bare = ss.record_from_arrays(time=found["time"], friction=found["friction"], normal=found["normal"])
    for nobody_says in (ss.lab_rig(), ss.lab_rig("aging").with_values({"friction.a": 0.02})):
        with pytest.raises(ss.ParameterError, match=r"drive.velocity: missing.*velocity='1 um/s'"):
            ss.fit(nobody_says, bare, protocol=protocol)
    full = ss.record_from_arrays(
        found["time"], friction=found["friction"], normal=found["normal"], displacement=found["displacement"]
    )
    assert ss.fit(ss.lab_rig(), full, protocol=protocol).values["friction.a"] == pytest.approx(0.011, rel=0.01)
    fit = ss.fit(ss.lab_rig().with_values({"drive.velocity": 3e-6}), bare, protocol=protocol)
    assert fit.values["friction.a"] == pytest.approx(0.011, rel=0.01)
    text = " ".join(str(fit).split())
    assert "the given protocol, from 3 um/s on" in text
    assert "assumed to move at 3 um/s (drive.velocity)" in text


def test_derived_numbers_have_intervals_and_b_less_a_is_the_negative():
    fit = stepped()
    own, negative = fit["a - b"], fit["b - a"]
    assert (negative.value, negative.low, negative.high) == (-own.value, -own.high, -own.low)
    for name in ("a - b", "k_c", "k/k_c"):
        one, narrow = fit[name], fit.interval(name, 0.68)
        assert fit.interval(name) == pytest.approx((one.low, one.high))
        assert one.low < narrow[0] < one.value < narrow[1] < one.high
    assert fit.interval("b-a") == pytest.approx((negative.low, negative.high))
    with pytest.raises(ss.ParameterError, match="level"):
        fit.interval("a - b", 1.5)


@pytest.mark.parametrize(
    ("calibrated", "said"), [(0.5, "early or a servo that overshoots"), (2.0, "late or a servo that")]
)
def test_a_calibration_is_told_what_makes_the_stiffness_so(calibrated, said):
    fit = ss.fit(ss.lab_rig(), record(rig(), STEP, count=300), starts=2, calibrated=calibrated * STIFFNESS)
    assert f"a channel that comes {said}" in " ".join(str(fit).split())
