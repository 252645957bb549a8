"""Maps hold what the functions say, whatever the chunks, workers and files; refusals say what to do."""

import os
import resource
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from dimensionless import unit_rig
from steadyslip.maps.plan.axes import LARGEST_HYPERCUBE, make_sampling
from steadyslip.maps.plan.map import roles
from steadyslip.maps.work.chunk import do_chunk, job_of
from steadyslip.nonlinear.onset.hopf import onset_map

ANGLES = ss.Grid("-80 deg", "80 deg", 41)
STIFFNESSES = ss.Grid("0.1 GPa/m", "100 GPa/m", 30, "log")
LINEAR = ("status", "critical_stiffness", "safety_factor", "margin", "growth_rate", "stable_stiffness")


def rig(**changes):
    friction = ss.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=ss.LinkerDieterich(alpha=0.56)
    )
    contact = ss.InclinedSpring(preload=5e6, angle=-np.pi / 4)
    parts = {"friction": friction, "contact": contact, "stiffness": 9e9, "drive": ss.Steady(1e-6)}
    return ss.Slider(**(parts | changes))


def chart(**options):
    return ss.Map(rig(), {"angle": ANGLES, "stiffness": STIFFNESSES}, **({"compute": LINEAR} | options))


def made(plan, folder, name="map.zarr", **options):
    found = ss.run_map(plan, folder / name, workers=1, **options)
    assert found.complete
    return found


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
    small = made(chart(chunk=7), tmp_path, "small.zarr").dataset
    two = ss.run_map(chart(chunk=200), tmp_path / "two.zarr", workers=2).dataset
    for name in LINEAR:
        np.testing.assert_array_equal(whole[name], small[name])
        np.testing.assert_array_equal(whole[name], two[name])


@pytest.mark.parametrize("states", [1, 2])
def test_several_intervals_and_parameters_that_bring_in_terms(tmp_path, states):
    members = [ss.State(b=0.016, d_c=1e-6), ss.State(b=-0.004, d_c=2e-5)][:states]
    friction = ss.RateState(a=0.0145, mu_ref=0.7, v_ref=1e-6, states=members)
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
    step = ss.VelocityStep(at=5.0, to=2.0)
    plan = ss.Map(
        base, {"stiffness": [0.003, 0.004, 0.006], "protocol.pieces.1.to": ss.Grid(1.1, 3.0, 4)},
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
    @ss.measure(unit="s")
    def halving(one):
        rate = ss.analyze(one).growth_rate
        return np.log(2) / -rate if rate < 0 else np.nan

    stiffness = [12e9, 40e9]
    base = rig()
    plan = ss.Map(base, {"stiffness": stiffness}, [ss.KickThreshold(precision=1e-3), halving])
    found = made(plan, tmp_path)
    data = found.dataset
    expected = ss.threshold_map(base, {"stiffness": np.array(stiffness)}, precision=1e-3, progress=False)
    np.testing.assert_array_equal(data["threshold"], expected)
    rate = ss.growth_rate(base, {"stiffness": np.array(stiffness)})
    np.testing.assert_allclose(data["halving"], np.where(rate < 0, np.log(2) / -rate, np.nan), rtol=1e-12)
    assert found.unit("halving") == "s"


def test_kinds_of_onset_equal_those_of_single_rigs(tmp_path):
    plan = ss.Map(rig(), {"angle": ss.Grid("-50 deg", "60 deg", 5), "friction.b": [0.013, 0.018]}, ["onset"])
    found = made(plan, tmp_path)
    data = found.dataset
    for i, angle in enumerate(data["contact.angle"].values):
        assert data["onset"].values[i, 0] == 0  # b < a has no edge
        single = ss.hopf(rig().with_values({"contact.angle": angle, "friction.b": 0.018}))
        assert found.words("onset")[int(data["onset"].values[i, 1])] == single.kind
        assert data["onset_edge"].values[i, 1] == pytest.approx(single.value, rel=1e-9)
        assert data["onset_coefficient"].values[i, 1] == pytest.approx(single.coefficient, rel=1e-6, abs=1e-12)


def test_onset_of_a_controlled_rig_is_along_its_gain():
    held = rig(stiffness=None, mass=1e6, drive=ss.PD(1e-6, kp=1e10, kd=1e5))
    gains = np.array([5e9, 4e10])
    found = onset_map(held, {"drive.kp": gains})
    for i, kp in enumerate(gains):
        single = ss.hopf(held.with_values({"drive.kp": kp}))
        assert found["edge"][i] == pytest.approx(single.value, rel=1e-9)
        assert found["coefficient"][i] == pytest.approx(single.coefficient, rel=1e-5)


def test_the_safety_factor_counts_a_gain_with_the_spring():
    spring = ss.safety_factor(rig(stiffness=1e9, drive=ss.PD(1e-6, kp=8e9)))
    assert spring == pytest.approx(ss.safety_factor(rig()), rel=1e-12)
    assert spring == pytest.approx(9e9 / ss.critical_stiffness(rig()), rel=1e-12)


# -- samples -----------------------------------------------------------------------------------------------

RANGES = {"friction.a": (0.01, 0.02), "friction.d_c": ("1 um", "100 um", "log")}


def sampling(points, **options):
    plan = ss.Map(rig(), samples=ss.Samples(RANGES, points, **options), compute=["status"])
    return plan.sampling


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
    plan = ss.Map(rig(), {"angle": [-0.5, 0.5]}, LINEAR[1:2], samples=ss.Samples(RANGES, 64), chunk=30)
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
        samples=ss.Samples({"friction.a": (0.01, 0.02)}, 8), chunk=50,
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
    assert "does not see" in elsewhere.problem


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


# -- refusals ----------------------------------------------------------------------------------------------


def test_another_map_is_refused_and_named(tmp_path):
    made(chart(), tmp_path)
    other = ss.Map(
        rig(stiffness=8e9), {"angle": ss.Grid("-80 deg", "70 deg", 41), "stiffness": STIFFNESSES}, LINEAR[:-1]
    )
    with pytest.raises(ss.NotAvailable) as error:
        made(other, tmp_path)
    text = str(error.value)
    assert "slider.stiffness: was 9000000000.0, is 8000000000.0" in text
    assert "over.contact.angle.to: was 1.39" in text
    assert "compute.stable_stiffness: was {'name': 'stable_stiffness'}, is absent" in text
    swapped = ss.Map(rig(), {"stiffness": STIFFNESSES, "angle": ANGLES}, LINEAR)
    with pytest.raises(ss.NotAvailable, match=r"order was contact\.angle, slider\.stiffness"):
        made(swapped, tmp_path)


def test_another_version_or_function_is_refused(tmp_path, monkeypatch):
    def first(one):
        return 1.0

    made(ss.Map(rig(), {"stiffness": [1e9]}, [first]), tmp_path)

    def first(one):
        return 2.0

    with pytest.raises(ss.NotAvailable, match=r"compute\.first\.text: was"):
        made(ss.Map(rig(), {"stiffness": [1e9]}, [first]), tmp_path)
    made(chart(), tmp_path, "other.zarr")
    monkeypatch.setattr(ss, "__version__", "9.9")
    with pytest.raises(ss.NotAvailable, match=r"steadyslip: was 0\.1\.0, is 9\.9"):
        made(chart(), tmp_path, "other.zarr")


def test_what_a_function_holds_belongs_to_it(tmp_path):
    def times(factor):
        def product(one):
            return factor * one.stiffness

        return product

    made(ss.Map(rig(), {"stiffness": [1e9]}, [times(1.0)]), tmp_path)
    made(ss.Map(rig(), {"stiffness": [1e9]}, [times(1.0)]), tmp_path)
    with pytest.raises(ss.NotAvailable, match=r"compute\.product\.text: was"):
        made(ss.Map(rig(), {"stiffness": [1e9]}, [times(2.0)]), tmp_path)


def test_another_map_under_the_name_of_an_old_one_is_whole(tmp_path):
    """A process that has had the old one open must not take it for the new one."""
    for points in (11, 12):
        shutil.rmtree(tmp_path / "map.zarr", ignore_errors=True)
        data = made(ss.Map(rig(), samples=ss.Samples(RANGES, points), compute=["status"], chunk=6), tmp_path).dataset
        assert data.sizes["sample"] == points
        assert np.all(data["status"] >= 0)
        assert np.all(data["friction.a"] > 0)


@pytest.mark.parametrize("damage", [bytes.fromhex("00"), b""], ids=["changed", "empty"])
def test_damaged_coordinates_are_written_again(tmp_path, damage):
    values = {"friction.a": np.linspace(0.01, 0.02, 5)}
    plan = ss.Map(rig(), {"angle": ANGLES}, ["growth_rate"], samples=values, chunk=40)
    found = made(plan, tmp_path)
    for name in ("contact.angle", "friction.a"):
        file = tmp_path / "map.zarr" / name / "c" / "0"
        file.write_bytes(damage + file.read_bytes()[: -len(damage)] if damage else b"")
    with pytest.raises(ss.NotAvailable, match="is damaged"):
        found.plot()
    with pytest.raises(ss.NotAvailable, match="is damaged"):
        found.to_parquet(tmp_path / "map.parquet")
    data = made(plan, tmp_path).dataset
    np.testing.assert_array_equal(data["contact.angle"], plan.axes[0].values)
    np.testing.assert_array_equal(data["friction.a"], values["friction.a"])


@pytest.mark.filterwarnings("ignore:Consolidated metadata")  # which threads cannot hold back
def test_two_maps_may_be_begun_at_once(tmp_path):
    """Whoever comes second finds the store, or is told that there is another run; nothing is broken."""
    answers = []

    def begin():
        try:
            answers.append(ss.run_map(chart(chunk=40), tmp_path / "map.zarr", workers=1).complete)
        except ss.NotAvailable as error:
            answers.append("another run is working" in str(error) or str(error))
        except Exception as error:
            answers.append(repr(error))

    threads = [threading.Thread(target=begin) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [True] * 4
    assert not list(tmp_path.glob(".*"))


def test_a_path_that_cannot_be_used_is_said_before_anything_is_computed(tmp_path):
    def never(one):
        raise AssertionError

    plan = ss.Map(rig(), {"stiffness": [1e9]}, [never])
    (tmp_path / "file.zarr").write_text("x")
    (tmp_path / "folder.zarr").mkdir()
    (tmp_path / "folder.zarr" / "precious").write_text("x")
    for name, message in {
        "file.zarr": "exists and is a file",
        "folder.zarr": "exists and is not a map",
        "map.nc": r"ends in \.zarr",
        "none/map.zarr": "there is no folder",
    }.items():
        with pytest.raises(ss.SteadyslipError, match=message):
            made(plan, tmp_path, name)
    assert (tmp_path / "folder.zarr" / "precious").read_text() == "x"
    with pytest.raises(ss.NotAvailable, match=r"cannot write '/proc/map\.zarr': \w+"):
        ss.run_map(plan, "/proc/map.zarr")


def test_a_read_only_folder_is_said(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o500)
    if os.access(folder, os.W_OK):
        pytest.skip("the superuser may write anywhere")
    with pytest.raises(ss.NotAvailable, match=r"cannot write .* permission denied"):
        made(chart(), folder)


def test_a_full_disk_keeps_what_is_finished(tmp_path):
    """The system refuses files above a size here; a write that fails half way is the same to the program."""
    program = (
        "import sys, numpy as np, steadyslip as ss\n"
        f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from test_maps import noise_map\n"
        "try:\n    ss.run_map(noise_map(), sys.argv[1], workers=int(sys.argv[2]))\n"
        "except ss.NotAvailable as error:\n    print(error); sys.exit(2)\n"
    )
    store = tmp_path / "map.zarr"
    for workers in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", program, str(store), workers], capture_output=True, text=True, timeout=120,
            env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},  # half a file of that would stay behind
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
        )  # fmt: skip
        assert done.returncode == 2, done.stderr
        assert "cannot write" in done.stdout
        assert "file too large" in done.stdout
        assert "4 of 8 chunks are finished and kept" in done.stdout
        assert "Traceback" not in done.stderr
    found = made(noise_map(), tmp_path)
    np.testing.assert_array_equal(found.dataset["noise"], made(noise_map(), tmp_path, "again.zarr").dataset["noise"])
    assert not list(store.rglob("*.partial"))


def noise_map():
    """Half the chunks pack well, the other half do not."""

    def noise(one, vary):
        k = vary["slider.stiffness"] * np.ones_like(vary["friction.a"])
        return np.where(k < 4.5e9, 1.0, np.sin(1e9 * np.sin(k + 1e9 * vary["friction.a"])))

    plan = ss.Map(
        rig(), {"stiffness": ss.Grid(1e9, 8e9, 8), "friction.a": ss.Grid(0.01, 0.02, 4000)},
        [ss.measure(noise, arrays=True)], chunk=4000,
    )  # fmt: skip
    return plan


def test_everything_wrong_with_a_map_is_said_at_once():
    with pytest.raises(ss.ParameterError) as error:
        ss.Map(
            rig(),
            {"angel": ANGLES, "stiffness": ss.Grid("1 GPa/m", "2 GPa", 3), "friction.b": [0.01, 0.01], "mass": 3.0},
            ["status", "stattus", ss.Events()],
            samples=ss.Samples({"friction.a": (0.01, -0.02), "d_c": (0.0, 1e-6, "log")}, 0, "sobbol", -1),
            chunk=0,
        )
    text = str(error.value)
    for part in (
        "did you mean 'contact.angle'", "compute: unknown measure 'stattus'; did you mean 'status'",
        "map.over.slider.stiffness.to: ",
        "a value comes twice", "allowed: a Grid", "friction.a.to: got -0.02", "friction.d_c.from: got 0.0",
        "samples.points: got 0", "unknown method 'sobbol'", "seed: got -1", "chunk: got 0", "events.until: missing",
    ):  # fmt: skip
        assert part in text, (part, text)
    with pytest.raises(ss.ParameterError, match="over: missing"):
        ss.Map(rig())
    with pytest.raises(ss.ParameterError, match="varies twice"):
        ss.Map(rig(), {"friction.a": [0.01]}, samples={"friction.a": [0.01, 0.02]})
    with pytest.raises(ss.ParameterError, match="nothing that is computed simulates"):
        ss.Map(rig(), {"protocol.pieces.1.to": [1e-6]}, protocol=ss.VelocityStep(at=1.0, to=2e-6))
    with pytest.raises(ss.ParameterError, match="Latin hypercube"):
        sampling(2 * LARGEST_HYPERCUBE, method="latin-hypercube")
    with pytest.raises(ss.ParameterError, match="is the name of something else"):
        ss.Map(rig(), {"angle": ANGLES}, [ss.measure(lambda one: 1.0, name="sample")])
    with pytest.raises(ss.ParameterError, match="is the name of something else"):
        ss.Map(rig(), {"angle": ANGLES}, [ss.measure(lambda one: 1.0, name="complete")])
    assert ss.Map(rig(), {"angle": ANGLES}, ss.measure(lambda one: 1.0, name="one")).outputs()[0].name == "one"
    for compute in (5, None, []):
        with pytest.raises(ss.ParameterError, match="compute"):
            ss.Map(rig(), {"angle": ANGLES}, compute)
    with pytest.raises(ss.ParameterError, match="samples: is empty"):
        ss.Map(rig(), samples={})
    with pytest.raises(ss.ParameterError, match="two ends"):
        ss.Map(rig(), samples=ss.Samples({"angle": 5}, 8))
    with pytest.raises(ss.ParameterError, match="differ in length"):
        make_sampling({"friction.a": [0.01], "friction.b": [0.01, 0.02]}, roles(chart()) | {
            name: address.role for name, address in rig().parameters().items()})  # fmt: skip


def test_a_function_that_fails_names_the_point(tmp_path):
    def breaks(one):
        return 1 / (one.stiffness - 2e9)

    plan = ss.Map(rig(), {"stiffness": [1e9, 2e9]}, [breaks], chunk=1)
    with pytest.raises(ss.NotAvailable) as error:
        made(plan, tmp_path)
    assert "map.compute.breaks: failed with ZeroDivisionError" in str(error.value)
    assert "slider.stiffness = 2000000000.0" in str(error.value)
    assert "1 of 2 chunks are finished and kept" in str(error.value)


def test_workers_that_cannot_live_are_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr("steadyslip.maps.work.local.PATIENCE", 2)

    def dies(one):
        os.kill(os.getpid(), 9)

    with pytest.raises(ss.NotAvailable, match="worker processes die on chunks 0, 1"):
        ss.run_map(ss.Map(rig(), {"stiffness": [1e9, 2e9, 3e9]}, [dies], chunk=1), tmp_path / "map.zarr", workers=2)


# -- the file ----------------------------------------------------------------------------------------------

FILE = ss.rig_to_text(rig(), replace(ss.Protocol.of(ss.VelocityStep(at=5.0, to=2e-6)), until=50.0))
TABLE = """
[map]
compute = ["status", "events"]
[map.over]
angle = { from = "-30 deg", to = "30 deg", points = 3 }
"slider.stiffness" = ["5 GPa/m", 2e10]
protocol.pieces.1.to = { from = "1.1 um/s", to = "2 um/s", points = 2, spacing = "log" }
[map.samples]
points = 4
seed = 7
[map.samples.over]
friction.a = { from = 0.01, to = 0.02 }
[map.events]
rtol = 1e-6
"""


def test_a_file_says_the_same_as_python():
    plan = ss.map_from_text(FILE + TABLE)
    same = ss.Map(
        rig(),
        {
            "contact.angle": ss.Grid(-np.pi / 6, np.pi / 6, 3), "stiffness": [5e9, 2e10],
            "protocol.pieces.1.to": ss.Grid(1.1e-6, 2e-6, 2, "log"),
        },
        ["status", ss.Events(rtol=1e-6)], samples=ss.Samples({"friction.a": (0.01, 0.02)}, 4, seed=7),
        protocol=replace(ss.Protocol.of(ss.VelocityStep(at=5.0, to=2e-6)), until=50.0),
    )  # fmt: skip
    assert plan.definition() == same.definition()
    assert plan.dims == ("contact.angle", "slider.stiffness", "protocol.pieces.1.to", "sample")
    changed = ss.map_from_text(FILE + TABLE, changes=["map.over.angle.points=5", "map.samples.points=8", "a=0.011"])
    assert changed.shape == (5, 2, 2, 8)
    assert changed.rig.value("friction.a") == 0.011
    assert ss.rig_from_text(FILE + TABLE) == rig()  # a rig file it is still


def test_a_rig_with_an_area_is_varied_in_its_own_units():
    text = (Path(__file__).parents[1] / "examples" / "slow-axis.toml").read_text(encoding="utf-8")
    table = """
[map]
[map.over]
kp = { from = "1 N/um", to = 5e6, points = 3 }
[map.samples]
points = 2
[map.samples.over]
slider.mass = { from = "10 kg", to = 20 }
"""
    plan = ss.map_from_text(text + table)
    area = plan.rig.area
    assert area not in (None, 1.0)
    (axis,) = plan.axes
    np.testing.assert_allclose(axis.values * area, [1e6, 3e6, 5e6], rtol=1e-12)
    (mass,) = plan.sampling.ranges
    np.testing.assert_allclose(np.array(mass[1:3]) * area, [10, 20], rtol=1e-12)
    with pytest.raises(ss.RigFileError, match=r"map\.over\.kp: .*wrong dimension.*the rig has an area"):
        ss.map_from_text(text + table.replace("1 N/um", "1 MPa"))


def test_everything_wrong_with_a_file_is_said_with_its_line():
    wrong = TABLE
    for right, bad in (
        ("angle =", "angel ="), ("points = 2", "point = 2"), ('"events"]', '"event"]'), ("5 GPa/m", "5 GPa"),
        ("to = 0.02", "to = -0.02"), ("seed = 7", "sed = 7"),
    ):  # fmt: skip
        wrong = wrong.replace(right, bad)
    with pytest.raises(ss.RigFileError) as error:
        ss.map_from_text(FILE + wrong)
    lines = {problem.message.split(";")[0]: problem.line for problem in error.value.problems}
    first = FILE.count("\n") + 1
    for message, line in lines.items():
        assert line is not None, message
        assert line > first
    text = str(error.value)
    for part in ("'angel'", "'point'", "'event'", "'sed'", "5 GPa", "-0.02"):
        assert part in text, (part, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "missing table"),
        ("map = 3", "allowed: \\[map\\]"),
        ("[map]\nover = 3", "allowed: parameters and their values"),
        ("[map]\ncompute = 3", "allowed: a list of"),
        ("[map]\nchunk = 0.5\n[map.over]\nangle = [0.1]", "allowed: a whole number"),
        ("[map]\n[map.over]\nangle = [0.1]\n[map.threshold]\nkick = 'velocity'", "add 'threshold' to map.compute"),
        ("[map]\ncompute = ['threshold']\n[map.over]\nangle = [0.1]\n[map.threshold]\nkick = 'sideways'", "velocity"),
        ("[map]\n[map.samples]\nfit = 'none.nc'", "cannot read"),
        ("[map]\n[map.samples]\npoints = 3", "over: missing"),
        ("[map]\nchunk = 'x'\n[map.over]\nangle = [0.1]", "allowed: a whole number"),
        ("[map]\n[map.over]\nangle = [[0.1, 0.2], [0.3]]", "value 1: got"),
        ("[map]\ncompute = ['events']\n[map.over]\nangle = [0.1]\n[map.events]\nlaw = 'status'", "is not an option"),
    ],
)
def test_a_file_with_one_fault(text, message):
    front = FILE if not text.startswith("map =") else ""
    with pytest.raises(ss.SteadyslipError, match=message):
        ss.map_from_text((text + "\n" + FILE) if not front else front + "\n" + text)


# -- edges -------------------------------------------------------------------------------------------------


@settings(max_examples=6, deadline=None)
@given(st.integers(5, 12), st.integers(5, 12), st.integers(1, 3))
def test_a_refined_edge_is_that_of_the_fine_grid(tmp_path_factory, columns, rows, rounds):
    """Cells of the fine grid whose corners differ are all found, with the same values; few points are computed."""
    folder = tmp_path_factory.mktemp("refined")
    angles, stiffness = (lambda n: ss.Grid("-50 deg", "70 deg", n)), (lambda n: ss.Grid(1e9, 1e11, n, "log"))
    base = ss.Map(rig(), {"angle": angles(columns), "stiffness": stiffness(rows)}, ["status", "growth_rate"])
    found = ss.refine(made(base, folder), rounds)
    fine = ss.Map(
        rig(), {"angle": angles((columns - 1) * 2**rounds + 1), "stiffness": stiffness((rows - 1) * 2**rounds + 1)},
        ["status"],
    )  # fmt: skip
    full = made(fine, folder, "fine.zarr").dataset
    status = full["status"].values
    crossings = np.count_nonzero(status[1:] != status[:-1]) + np.count_nonzero(status[:, 1:] != status[:, :-1])
    assert len(found.sides) == crossings
    at = full.sel({"contact.angle": xr.DataArray(found.points["contact.angle"]),
                   "slider.stiffness": xr.DataArray(found.points["slider.stiffness"])}, method="nearest")  # fmt: skip
    np.testing.assert_array_equal(at["status"], found.points["status"])
    np.testing.assert_allclose(at["contact.angle"], found.points["contact.angle"], rtol=1e-9, atol=1e-12)
    assert len(found.points["status"]) < 0.8 * fine.size


def test_an_edge_is_followed_through_a_side_whose_ends_agree(tmp_path):
    """A bump of the edge pokes into a cell all whose corners are above it."""

    def above(one, vary):
        x, y = np.log10(vary["slider.stiffness"] / 1e9), np.log10(vary["friction.d_c"] / 1e-6)
        return y - 0.9 - 0.35 * np.exp(-(((x - 0.5) / 0.13) ** 2))

    def grid(n):
        over = {"stiffness": ss.Grid(1e9, 1e10, n, "log"), "friction.d_c": ss.Grid(1e-6, 1e-4, 2 * n - 1, "log")}
        return ss.Map(rig(), over, [ss.measure(above, arrays=True)])

    found = ss.refine(made(grid(2), tmp_path), 4, of="above", level=0.0, compute=grid(2).compute)
    fine = made(grid(17), tmp_path, "fine.zarr").dataset["above"].values > 0
    crossings = np.count_nonzero(fine[1:] != fine[:-1]) + np.count_nonzero(fine[:, 1:] != fine[:, :-1])
    assert np.any(found.edge["friction.d_c"] > 1.2e-5)
    assert len(found.sides) == crossings


def test_a_refined_edge_is_the_critical_stiffness(tmp_path):
    base = ss.Map(
        rig(), {"angle": ss.Grid("-40 deg", "60 deg", 6), "stiffness": STIFFNESSES, "friction.b": [0.016, 0.018]},
        ["growth_rate"],
    )  # fmt: skip
    found = ss.refine(made(base, tmp_path), 5)
    edge = found.edge
    exact = ss.critical_stiffness(rig(), {n: v for n, v in edge.items() if n != "slider.stiffness"})
    assert set(edge["friction.b"]) == {0.016, 0.018}  # a list has nothing between its values
    step = np.log(1000) / 29 / 32
    slope = 3 * np.radians(20) / 32  # of ln k_cr over an angle step
    assert np.max(np.abs(np.log(edge["slider.stiffness"] / exact))) < 0.5 * step + slope
    assert str(found).startswith("edge of growth_rate at 0")
    again = ss.refine(ss.open_map(tmp_path / "map.zarr"), 5)
    np.testing.assert_array_equal(again.edge["slider.stiffness"], edge["slider.stiffness"])
    found.to_csv(tmp_path / "edge.csv")
    table = (tmp_path / "edge.csv").read_text().splitlines()
    assert table[0] == "contact.angle (rad),slider.stiffness (Pa/m),friction.b (1),one side,other side"
    assert len(table) == 1 + len(found.sides)


def test_what_cannot_be_refined_is_said(tmp_path):
    sampled = ss.Map(rig(), samples=ss.Samples(RANGES, 16), compute=["status"])
    with pytest.raises(ss.NotAvailable, match="samples have no neighbours"):
        ss.refine(made(sampled, tmp_path, "a.zarr"))
    listed = ss.Map(rig(), {"angle": [0.1, 0.2]}, ["status", "critical_stiffness"])
    listed_found = made(listed, tmp_path, "b.zarr")
    with pytest.raises(ss.NotAvailable, match="no grid to refine"):
        ss.refine(listed_found)
    with pytest.raises(ss.ParameterError, match="give the value of critical_stiffness"):
        ss.refine(listed_found, of="critical_stiffness")
    with pytest.raises(ss.ParameterError, match="rounds"):
        ss.refine(listed_found, 0)
    flat = ss.Map(rig(), {"stiffness": ss.Grid(1e12, 2e12, 3)}, ["status", ss.measure(lambda one: 1.0, name="one")])
    with pytest.raises(ss.NotAvailable, match="computes the function 'one'"):
        ss.refine(made(flat, tmp_path, "c.zarr"))
    with pytest.raises(ss.NotAvailable, match="no edge to refine"):
        ss.refine(ss.open_map(tmp_path / "c.zarr"), compute=["status"])


# -- sensitivity -------------------------------------------------------------------------------------------


def test_sobol_indices_of_a_known_product():
    """k_cr = (b − a) σ/d_c with everything uniform: means and variances by hand."""
    base = rig(contact=ss.Constant(preload=5e6))
    a, b, d = (0.010, 0.012), (0.016, 0.019), (1e-6, 2e-6)
    found = ss.sensitivity(base, {"friction.a": a, "friction.b": b, "friction.d_c": d}, "critical_stiffness",
                           points=8192)  # fmt: skip
    variance = {"a": np.ptp(a) ** 2 / 12, "b": np.ptp(b) ** 2 / 12}
    x = np.mean(b) - np.mean(a)
    x2 = x**2 + variance["a"] + variance["b"]
    y, y2 = np.log(d[1] / d[0]) / np.ptp(d), 1 / (d[0] * d[1])
    whole = x2 * y2 - (x * y) ** 2
    first = [y**2 * variance["a"], y**2 * variance["b"], x**2 * (y2 - y**2)]
    total = [y2 * variance["a"], y2 * variance["b"], x2 * (y2 - y**2)]
    np.testing.assert_allclose(found.first["critical_stiffness"], np.array(first) / whole, atol=0.01)
    np.testing.assert_allclose(found.total["critical_stiffness"], np.array(total) / whole, atol=0.01)
    low, high = found.total_interval["critical_stiffness"]
    assert np.all(low < found.total["critical_stiffness"])
    assert np.all(found.total["critical_stiffness"] < high)
    assert found.ranked("critical_stiffness")[0] == "friction.d_c"
    assert found.missing["critical_stiffness"] == 0


def test_the_margin_is_additive_where_its_parts_multiply():
    """ln(k/k_cr) = ln k + ln d_c − ln(b − a) − ln σ: shares alone are all there is, and add up to one."""
    base = rig(contact=ss.Constant(preload=5e6))
    over = {"stiffness": (1e9, 1e11, "log"), "friction.d_c": (1e-6, 1e-5, "log")}
    found = ss.sensitivity(base, over, ["margin"], points=4096)
    expected = np.array([np.log(100) ** 2, np.log(10) ** 2])
    np.testing.assert_allclose(found.first["margin"], expected / expected.sum(), atol=0.01)
    np.testing.assert_allclose(found.total["margin"], expected / expected.sum(), atol=0.01)


def test_points_without_a_result_are_counted_and_left_out():
    found = ss.sensitivity(rig(), {"friction.a": (0.010, 0.018), "friction.b": (0.015, 0.0151)}, points=1024)
    share = 1 - (0.01505 - 0.010) / 0.008
    assert found.missing["critical_stiffness"] == pytest.approx(share, abs=0.02)
    assert found.points["critical_stiffness"] == 256  # of some 400 sets
    assert "are left out" in str(found)
    assert found.first["critical_stiffness"][0] > 0.9


def test_what_has_no_sensitivity_is_said():
    over = {"friction.a": (0.010, 0.012), "friction.b": (0.016, 0.018)}
    for change, message in {
        "points": "a power of 2", "one": "at least two", "of": "not one number", "none": "exists at 0",
    }.items():  # fmt: skip
        arguments = {"over": over, "of": "margin", "points": 128}
        if change == "points":
            arguments["points"] = 100
        elif change == "one":
            arguments["over"] = {"friction.a": (0.010, 0.012)}
        elif change == "of":
            arguments["of"] = "status"
        else:
            arguments["over"] = {"friction.a": (0.020, 0.022), "friction.b": (0.016, 0.018)}
        with pytest.raises(ss.SteadyslipError, match=message):
            ss.sensitivity(rig(), **arguments)
    flat = {"friction.mu_ref": (0.5, 0.6), "drive.velocity": (1e-6, 2e-6)}
    with pytest.raises(ss.NotAvailable, match="does not depend on"):
        ss.sensitivity(rig(contact=ss.Constant(preload=5e6)), flat, "critical_stiffness", points=64)
