"""Maps hold what the functions say, whatever the chunks, workers and files."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from charts import ANGLES, LINEAR, RANGES, chart, made, rig, sampling
from dimensionless import unit_rig
from steadyslip.maps.plan.measures import Measure
from steadyslip.maps.work.chunk import do_chunk, job_of
from steadyslip.nonlinear.onset.hopf import onset_map

# -- numbers -----------------------------------------------------------------------------------------------


def test_a_map_holds_what_the_functions_give(tmp_path):
    data = made(chart(chunk=100), tmp_path).dataset
    vary = {"contact.angle": data["contact.angle"].values[:, None], "slider.stiffness": data["slider.stiffness"].values}
    for name in ("critical_stiffness", "safety_factor", "growth_rate", "stable_stiffness"):
        np.testing.assert_array_equal(data[name], getattr(ss, name)(rig(), vary))
    np.testing.assert_array_equal(data["margin"], np.log(data["safety_factor"]))
    stable = data["status"] == 1
    np.testing.assert_array_equal(stable, data["growth_rate"] < 0)
    np.testing.assert_array_equal(data["status"] == 0, np.isnan(data["growth_rate"]))
    inside = (vary["slider.stiffness"][..., None] > data["stable_stiffness"][..., 0]) & (
        vary["slider.stiffness"][..., None] < data["stable_stiffness"][..., 1]
    )
    np.testing.assert_array_equal(stable, inside.any("interval"))
    assert data["contact.angle"].attrs["units"] == "rad"
    assert data["growth_rate"].attrs["units"] == "1/s"
    assert ss.rig_from_text(data.attrs["rig"]) == rig()


def test_chunks_and_workers_change_no_bit(tmp_path):
    whole = made(chart(), tmp_path).dataset
    small = made(chart(chunk=47), tmp_path, "small.zarr").dataset  # divides neither side of the map
    two = ss.run_map(chart(chunk=200), tmp_path / "two.zarr", workers=2).dataset
    for name in LINEAR:
        np.testing.assert_array_equal(whole[name], small[name])
        np.testing.assert_array_equal(whole[name], two[name])


@pytest.mark.parametrize("states", [1, 2])
def test_several_intervals_and_parameters_that_bring_in_terms(tmp_path, states):
    members = [ss.laws.State(b=0.016, d_c=1e-6), ss.laws.State(b=-0.004, d_c=2e-5)][:states]
    friction = ss.laws.RateState(a=0.0145, mu_ref=0.7, v_ref=1e-6, states=members)
    base = rig(friction=friction)
    plan = ss.Map(base, {"slider.mass": [0.0, 1e8, 1e10], "angle": ANGLES}, ["stable_stiffness", "status"], chunk=20)
    data = made(plan, tmp_path).dataset
    for mass in (0, 1):
        vary = {"slider.mass": data["slider.mass"].values[mass], "contact.angle": data["contact.angle"].values}
        one = base.with_values({"slider.mass": vary.pop("slider.mass")})
        expected = ss.stable_stiffness(one, vary)
        found = data["stable_stiffness"].values[mass]
        np.testing.assert_allclose(found[:, : expected.shape[1]], expected, rtol=1e-9)
        assert np.isnan(found[:, expected.shape[1] :]).all()


def test_simulated_results_equal_those_without_a_map(tmp_path):
    base = unit_rig("aging", 0.5, 0.4, 1e-3)
    step = ss.protocol.VelocityStep(at=5.0, to=2.0)
    plan = ss.Map(
        base, {"stiffness": [0.003, 0.004, 0.006], "protocol.pieces.1.to": ss.maps.Grid(1.1, 3.0, 4)},
        ["events", "critical_stiffness"], protocol=replace(ss.Protocol.of(step), until=120.0), chunk=3,
    )  # fmt: skip
    data = made(plan, tmp_path).dataset
    vary = {
        "stiffness": data["slider.stiffness"].values[:, None],
        "protocol.pieces.1.to": data["protocol.pieces.1.to"].values,
    }
    expected = ss.simulate_many(base, vary, step, until=120.0, progress=False)
    np.testing.assert_array_equal(data["outcome"], expected.status_code)
    for name, values in expected.events.items():
        np.testing.assert_array_equal(data[name], values)
    # what does not move does not depend on the protocol
    assert (data["critical_stiffness"] == data["critical_stiffness"][:, :1]).all()


def test_thresholds_and_functions(tmp_path):
    @ss.maps.measure(unit="s")
    def halving(one):
        rate = ss.analyze(one).growth_rate
        return np.log(2) / -rate if rate < 0 else np.nan

    stiffness = [12e9, 40e9]
    base = rig()
    plan = ss.Map(base, {"stiffness": stiffness}, [ss.maps.KickThreshold(precision=1e-3), halving])
    found = made(plan, tmp_path)
    data = found.dataset
    expected = ss.threshold_map(base, {"stiffness": np.array(stiffness)}, precision=1e-3, progress=False)
    np.testing.assert_array_equal(data["threshold"], expected)
    rate = ss.growth_rate(base, {"stiffness": np.array(stiffness)})
    np.testing.assert_allclose(data["halving"], np.where(rate < 0, np.log(2) / -rate, np.nan), rtol=1e-12)
    assert found.unit("halving") == "s"


def test_kinds_of_onset_equal_those_of_single_rigs(tmp_path):
    plan = ss.Map(rig(), {"angle": ss.maps.Grid("-50 deg", "60 deg", 5), "friction.b": [0.013, 0.018]}, ["onset"])
    found = made(plan, tmp_path)
    data = found.dataset
    for i, angle in enumerate(data["contact.angle"].values):
        assert data["onset"].values[i, 0] == 0  # b < a has no edge
        single = ss.hopf(rig().with_values({"contact.angle": angle, "friction.b": 0.018}))
        assert found.words("onset")[int(data["onset"].values[i, 1])] == single.kind
        assert data["onset_edge"].values[i, 1] == pytest.approx(single.value, rel=1e-9)
        assert data["onset_coefficient"].values[i, 1] == pytest.approx(single.coefficient, rel=1e-6, abs=1e-12)


def test_onset_of_a_controlled_rig_is_along_its_gain():
    held = rig(stiffness=None, mass=1e6, drive=ss.machine.PD(1e-6, kp=1e10, kd=1e5))
    gains = np.array([5e9, 4e10])
    found = onset_map(held, {"drive.kp": gains})
    for i, kp in enumerate(gains):
        single = ss.hopf(held.with_values({"drive.kp": kp}))
        assert found["edge"][i] == pytest.approx(single.value, rel=1e-9)
        assert found["coefficient"][i] == pytest.approx(single.coefficient, rel=1e-5)


def test_the_safety_factor_counts_a_gain_with_the_spring():
    spring = ss.safety_factor(rig(stiffness=1e9, drive=ss.machine.PD(1e-6, kp=8e9)))
    assert spring == pytest.approx(ss.safety_factor(rig()), rel=1e-12)
    assert spring == pytest.approx(9e9 / ss.critical_stiffness(rig()), rel=1e-12)


# -- samples -----------------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.data(), st.sampled_from(["sobol", "latin-hypercube"]))
def test_samples_do_not_depend_on_the_pieces_they_are_asked_for_in(data, method):
    points = 500
    whole = sampling(points, method=method, seed=3).part(0, points)
    start = data.draw(st.integers(0, points - 1))
    stop = data.draw(st.integers(start + 1, points))
    part = sampling(points, method=method, seed=3).part(start, stop)
    for name in whole:
        np.testing.assert_array_equal(part[name], whole[name][start:stop])


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube"])
def test_samples_fill_their_ranges_evenly(method):
    points = 256
    found = sampling(points, method=method, seed=5).part(0, points)
    a = (found["friction.a"] - 0.01) / 0.01
    d_c = np.log(found["friction.d_c"] / 1e-6) / np.log(100)
    for column in (a, d_c):  # one point in each of as many strata as there are points
        np.testing.assert_array_equal(np.sort((column * points).astype(int)), np.arange(points))
    other = sampling(points, method=method, seed=6).part(0, points)
    assert not np.any(other["friction.a"] == found["friction.a"])


def test_samples_in_a_map(tmp_path):
    plan = ss.Map(rig(), {"angle": [-0.5, 0.5]}, LINEAR[1:2], samples=ss.maps.Samples(RANGES, 64), chunk=30)
    assert plan.chunks[1] < 64
    data = made(plan, tmp_path).dataset
    expected = plan.sampling.part(0, 64)
    for name, column in expected.items():
        np.testing.assert_array_equal(data[name], column)
        assert name in data.coords
    vary = {"contact.angle": np.array([[-0.5], [0.5]]), **expected}
    np.testing.assert_array_equal(data["critical_stiffness"], ss.critical_stiffness(rig(), vary))


def test_listed_samples(tmp_path):
    values = {"friction.a": [0.01, 0.012, 0.014], "stiffness": [1e9, 1e10, 1e11]}
    plan = ss.Map(rig(), samples=values, compute=["growth_rate"])
    data = made(plan, tmp_path).dataset
    np.testing.assert_array_equal(data["growth_rate"], ss.growth_rate(rig(), values))
    np.testing.assert_array_equal(data["slider.stiffness"], values["stiffness"])


# -- files -------------------------------------------------------------------------------------------------


def test_exports_hold_the_same(tmp_path):
    import pyarrow.parquet as pq

    plan = ss.Map(
        rig(), {"angle": ANGLES, "friction.b": [0.016, 0.018]}, ["status", "growth_rate", "stable_stiffness"],
        samples=ss.maps.Samples({"friction.a": (0.01, 0.02)}, 8), chunk=50,
    )  # fmt: skip
    found = made(plan, tmp_path)
    data = found.dataset
    found.to_netcdf(tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc", mask_and_scale=False) as file:
        for name in (*found.results, *found.parameters):
            np.testing.assert_array_equal(file[name], data[name])
            assert file[name].dims == data[name].dims
            assert file[name].attrs["units"] == data[name].attrs["units"]
        assert ss.rig_from_text(file.attrs["rig"]) == rig()
    found.to_parquet(tmp_path / "map.parquet")
    table = pq.read_table(tmp_path / "map.parquet")
    assert table.num_rows == found.size
    rows = {name: table[name].to_numpy() for name in table.column_names}
    at = (7, 1, 5)
    row = np.flatnonzero(
        (rows["contact.angle"] == data["contact.angle"].values[7])
        & (rows["friction.b"] == 0.018)
        & (rows["friction.a"] == data["friction.a"].values[5])
    )
    assert len(row) == 1
    assert rows["growth_rate"][row[0]] == data["growth_rate"].values[at]
    assert rows["stable_stiffness_1_1"][row[0]] == data["stable_stiffness"].values[(*at, 0, 0)]
    assert rows["status"][row[0]] == found.words("status")[data["status"].values[at]]
    assert table.schema.field("growth_rate").metadata[b"units"] == b"1/s"


CALLS = []


def counted(one):
    CALLS.append(one.stiffness)
    return 1.0


def test_a_finished_map_is_not_computed_again(tmp_path):
    CALLS.clear()
    plan = ss.Map(rig(), {"stiffness": [1e9, 2e9]}, [counted])
    made(plan, tmp_path)
    found = made(plan, tmp_path)
    assert CALLS == [1e9, 2e9]
    assert "complete" in str(found)
    assert found.to_dict()["chunks"] == {"finished": 1, "all": 1}


def test_a_finished_chunk_is_left_alone(tmp_path):
    """As when a worker that was thought lost had finished it."""
    CALLS.clear()
    plan = ss.Map(rig(), {"stiffness": [1e9, 2e9]}, [counted], chunk=1)
    made(plan, tmp_path)
    done = do_chunk(job_of(plan, tmp_path / "map.zarr"), 1)
    assert (done.points, done.seconds, done.problem) == (1, 0.0, "")
    assert len(CALLS) == 2
    elsewhere = do_chunk(job_of(plan, tmp_path / "other.zarr"), 1)
    assert "cannot find" in elsewhere.problem


def test_what_a_map_says_of_itself(tmp_path):
    found = made(chart(chunk=100), tmp_path)
    statistics = found.statistics()
    data = found.dataset
    assert sum(statistics["status"].values()) == pytest.approx(1)
    assert statistics["status"]["stable"] == pytest.approx(float((data["status"] == 1).mean()))
    assert statistics["growth_rate"]["low"] == data["growth_rate"].min()
    assert statistics["growth_rate"]["high"] == data["growth_rate"].max()
    assert statistics["growth_rate"]["share"] == pytest.approx(float(np.isfinite(data["growth_rate"]).mean()))
    assert "no steady sliding" in str(found)


@pytest.mark.parametrize("name", sorted(set(Measure.registry) - {"hunt"}))
def test_numbers_that_can_be_missing_say_why(tmp_path, name):
    """Where there is no steady sliding: unless words beside a number tell it, its declaration does."""
    pushed = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=1.0, to=2e-6),), until=5.0)
    plan = ss.Map(rig(), {"angle": ["-80 deg", "-20 deg"]}, [name], protocol=pushed)
    found = made(plan, tmp_path)
    told = any(output.flags for output in plan.outputs())
    for output in plan.outputs():
        if output.flags:
            continue
        assert np.isnan(found.dataset[output.name].values[0]).all(), output.name
        assert output.missing or told, output.name
        assert found.why_missing(output.name) == output.missing
        assert f"{output.name} " in str(found)
        assert ("compute status as well" in str(found)) != told
