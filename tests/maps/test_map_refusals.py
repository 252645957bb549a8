"""What is wrong with a map, or with the file of one, is said with what to do; what was computed is kept."""

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

import charts
import steadyslip as ss
from charts import ANGLES, LINEAR, RANGES, STIFFNESSES, chart, made, noise_map, rig, sampling
from steadyslip.maps.plan.axes import LARGEST_HYPERCUBE, make_sampling
from steadyslip.maps.plan.map import roles

# -- refusals ----------------------------------------------------------------------------------------------


def test_another_map_is_refused_and_named(tmp_path):
    made(chart(), tmp_path)
    other = ss.Map(
        rig(stiffness=8e9), {"angle": ss.maps.Grid("-80 deg", "70 deg", 41), "stiffness": STIFFNESSES}, LINEAR[:-1]
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
    monkeypatch.setattr("steadyslip.core.version.version", lambda: "9.9")
    with pytest.raises(ss.NotAvailable, match=r"computed by steadyslip [\d.]+\+s\w{8}, this is 9\.9; .*delete the map"):
        made(chart(), tmp_path, "other.zarr")
    with pytest.raises(ss.NotAvailable, match="points of two programs are not mixed"):
        ss.refine(ss.open_map(tmp_path / "other.zarr"), 2)


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
        data = made(
            ss.Map(rig(), samples=ss.maps.Samples(RANGES, points), compute=["status"], chunk=6), tmp_path
        ).dataset
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


@pytest.mark.parametrize("name", ["slider.stiffness/c/0", "noise/c/0/0", "complete/c/0/0", "zarr.json"])
def test_a_folder_where_a_file_belongs_is_said(tmp_path, name):
    """Of coordinates, results, marks or the description: one message with the folder's name, or it is no map."""
    made(noise_map(), tmp_path)
    store = tmp_path / "map.zarr"
    place = next(store / one for one in (name, name.removesuffix("/0")) if (store / one).is_file())
    place.unlink()
    place.mkdir()
    with pytest.raises(ss.SteadyslipError) as caught:
        made(noise_map(), tmp_path)
    assert str(place if name != "zarr.json" else store) in str(caught.value)


@pytest.mark.campaign
def test_a_full_disk_keeps_what_is_finished(tmp_path):
    """The system refuses files above a size here; a write that fails half way is the same to the program."""
    program = (
        "import sys, numpy as np, steadyslip as ss\n"
        f"sys.path.insert(0, {os.path.dirname(charts.__file__)!r})\n"
        "from charts import noise_map\n"
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


def test_everything_wrong_with_a_map_is_said_at_once():
    with pytest.raises(ss.ParameterError) as error:
        ss.Map(
            rig(),
            {
                "angel": ANGLES,
                "stiffness": ss.maps.Grid("1 GPa/m", "2 GPa", 3),
                "friction.b": [0.01, 0.01],
                "mass": 3.0,
            },
            ["status", "stattus", ss.maps.Events()],
            samples=ss.maps.Samples({"friction.a": (0.01, -0.02), "d_c": (0.0, 1e-6, "log")}, 0, "sobbol", -1),
            chunk=0,
        )
    text = str(error.value)
    for part in (
        "did you mean 'contact.angle'", "compute: unknown measure 'stattus'; did you mean 'status'",
        "map.over.slider.stiffness.to: ",
        "has a value twice", "allowed: a Grid", "friction.a.to: got -0.02", "friction.d_c.from: got 0.0",
        "samples.points: got 0", "unknown method 'sobbol'", "seed: got -1", "chunk: got 0", "events.until: missing",
    ):  # fmt: skip
        assert part in text, (part, text)
    with pytest.raises(ss.ParameterError, match="over: missing"):
        ss.Map(rig())
    with pytest.raises(ss.ParameterError, match="varies twice"):
        ss.Map(rig(), {"friction.a": [0.01]}, samples={"friction.a": [0.01, 0.02]})
    with pytest.raises(ss.ParameterError, match="no measure simulates"):
        ss.Map(rig(), {"protocol.pieces.1.to": [1e-6]}, protocol=ss.protocol.VelocityStep(at=1.0, to=2e-6))
    with pytest.raises(ss.ParameterError, match="Latin hypercube"):
        sampling(2 * LARGEST_HYPERCUBE, method="latin-hypercube")
    with pytest.raises(ss.ParameterError, match="is the name of something else"):
        ss.Map(rig(), {"angle": ANGLES}, [ss.maps.measure(lambda one: 1.0, name="sample")])
    with pytest.raises(ss.ParameterError, match="is the name of something else"):
        ss.Map(rig(), {"angle": ANGLES}, [ss.maps.measure(lambda one: 1.0, name="complete")])
    assert ss.Map(rig(), {"angle": ANGLES}, ss.maps.measure(lambda one: 1.0, name="one")).outputs()[0].name == "one"
    for compute in (5, [None], []):
        with pytest.raises(ss.ParameterError, match="compute"):
            ss.Map(rig(), {"angle": ANGLES}, compute)
    with pytest.raises(ss.ParameterError, match="samples: is empty"):
        ss.Map(rig(), samples={})
    with pytest.raises(ss.ParameterError, match=r"allowed: \(low, high\)"):
        ss.Map(rig(), samples=ss.maps.Samples({"angle": 5}, 8))
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


@pytest.mark.campaign
def test_workers_that_cannot_live_are_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr("steadyslip.maps.work.local.PATIENCE", 2)

    def dies(one):
        os.kill(os.getpid(), 9)

    with pytest.raises(ss.NotAvailable, match="worker processes die on chunks 0, 1"):
        ss.run_map(ss.Map(rig(), {"stiffness": [1e9, 2e9, 3e9]}, [dies], chunk=1), tmp_path / "map.zarr", workers=2)


# -- the file ----------------------------------------------------------------------------------------------

FILE = ss.rig_to_text(rig(), replace(ss.Protocol.of(ss.protocol.VelocityStep(at=5.0, to=2e-6)), until=50.0))
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
            "contact.angle": ss.maps.Grid(-np.pi / 6, np.pi / 6, 3), "stiffness": [5e9, 2e10],
            "protocol.pieces.1.to": ss.maps.Grid(1.1e-6, 2e-6, 2, "log"),
        },
        ["status", ss.maps.Events(rtol=1e-6)], samples=ss.maps.Samples({"friction.a": (0.01, 0.02)}, 4, seed=7),
        protocol=replace(ss.Protocol.of(ss.protocol.VelocityStep(at=5.0, to=2e-6)), until=50.0),
    )  # fmt: skip
    assert plan.definition() == same.definition()
    assert plan.dims == ("contact.angle", "slider.stiffness", "protocol.pieces.1.to", "sample")
    changed = ss.map_from_text(FILE + TABLE, changes=["map.over.angle.points=5", "map.samples.points=8", "a=0.011"])
    assert changed.shape == (5, 2, 2, 8)
    assert changed.rig.value("friction.a") == 0.011
    assert ss.rig_from_text(FILE + TABLE) == rig()  # a rig file it is still


@pytest.mark.parametrize("written", ["contact.angle", "angle", '"contact.angle"'])
@pytest.mark.parametrize("said", ["contact.angle", "angle"])
def test_a_change_means_the_parameter_that_the_file_means(written, said):
    """However either of them is shortened; of samples, and of times and targets of a protocol, alike."""
    text = FILE + TABLE.replace("\nangle =", f"\n{written} =")
    assert ss.map_from_text(text, changes=[f"map.over.{said}.points=5"]).shape == (5, 2, 2, 4)
    (angle, *_) = ss.map_from_text(text, changes=[f"map.over.{said}=[0.1, 0.2]"]).axes
    assert (angle.name, list(angle.values)) == ("contact.angle", [0.1, 0.2])
    for change in ("map.over.pieces.1.to=['3 um/s']", "map.over.protocol.pieces.1.to=['3 um/s']"):
        assert list(ss.map_from_text(text, changes=[change]).axes[2].values) == [3e-6]
    for change in ("map.samples.over.a.to=0.03", "map.samples.over.friction.a.to=0.03"):
        assert ss.map_from_text(text, changes=[change]).sampling.ranges == (("friction.a", 0.01, 0.03, "linear"),)


def test_changes_without_effect_are_refused():
    for change in ("map.over.angle.points=5", "map.chunk=3"):
        with pytest.raises(ss.RigFileError, match="no effect here"):
            ss.rig_from_text(FILE + TABLE, changes=[change])
    with pytest.raises(ss.RigFileError, match="named twice"):
        ss.map_from_text(FILE + TABLE.replace("[map.samples]", "[map.over.slider]\nstiffness = [1e9]\n[map.samples]"))
    with pytest.raises(ss.RigFileError, match="unknown parameter"):
        ss.map_from_text(FILE + TABLE, changes=["map.over.angel.points=5"])


def test_a_rig_with_an_area_is_varied_in_its_own_units():
    text = (Path(__file__).parents[2] / "examples" / "slow-axis.toml").read_text(encoding="utf-8")
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


@pytest.mark.parametrize("how", ["missing", "of another array", "a folder", "of another chunk"])
def test_chunks_that_are_not_those_that_were_written_are_no_results(tmp_path, how):
    """Each file is one that Zarr reads, or takes for a chunk of nothing; the mark of the chunk knows better."""
    over = {"stiffness": ss.maps.Grid(1e9, 9e9, 6), "friction.a": ss.maps.Grid(0.010, 0.014, 4)}
    plan = ss.Map(rig(), over, ["growth_rate", "critical_stiffness"], chunk=6)
    whole = ss.run_map(plan, tmp_path / "m.zarr", workers=1, progress=False).read("growth_rate")
    chunks = [path for path in (tmp_path / "m.zarr" / "growth_rate" / "c").rglob("*") if path.is_file()]
    last = max(chunks)
    if how == "of another array":
        shutil.copy(str(last).replace("growth_rate", "critical_stiffness"), last)
    elif how == "of another chunk":
        shutil.copy(min(chunks), last)
    else:
        last.unlink()
        if how == "a folder":
            last.mkdir()
    found = ss.open_map(tmp_path / "m.zarr")
    np.testing.assert_array_equal(found.read("growth_rate", (0, 0)), whole[0, 0])  # that chunk is as it was
    corner = (slice(1, None, 2), -1)
    for read in (lambda: found.read("growth_rate"), lambda: found.read("growth_rate", corner), found.statistics,
                 lambda: found.dataset["growth_rate"].values):  # fmt: skip
        with pytest.raises(ss.NotAvailable, match="not those that were written"):
            read()
