"""`steadyslip map` and `steadyslip sensitivity` as a user meets them."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

import steadyslip as ss
from file_schema import file_schema
from steadyslip.cli import app, main

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples" / "maps").glob("*.toml"))
SAFE = str(ROOT / "examples" / "maps" / "safe-stiffness.toml")


def run(capsys, monkeypatch, *arguments):
    """Status, output and error output of the command line, in this process."""
    monkeypatch.setattr(sys, "argv", ["steadyslip", *arguments])
    try:
        main()
        status = 0
    except SystemExit as stop:
        status = stop.code or 0
    out, error = capsys.readouterr()
    return status, out, error


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_are_maps_and_keep_to_the_schema(path):
    assert ss.read_map(path).size > 100
    assert ss.read_rig(path) == ss.read_map(path).rig
    file_schema().validate(tomllib.loads(path.read_text(encoding="utf-8")))


def test_map_then_exports_then_figures(capsys, monkeypatch, tmp_path):
    store = str(tmp_path / "safe.zarr")
    status, out, _ = run(capsys, monkeypatch, "map", SAFE, "-o", store, "--workers", "1")
    assert status == 0
    assert "complete" in out
    assert "stable" in out
    files = [str(tmp_path / name) for name in ("a.png", "b.nc", "c.parquet")]
    outputs = [word for name in files for word in ("-o", name)]
    status, out, _ = run(capsys, monkeypatch, "map", store, *outputs, "--facet", "preload", "--json")
    assert status == 0
    data = json.loads(out)
    assert data["dims"] == {"contact.angle": 81, "slider.stiffness": 61, "contact.preload": 3}
    assert sum(data["statistics"]["status"].values()) == pytest.approx(1)
    assert all(Path(name).stat().st_size > 1000 for name in files)


def test_refinement_and_sensitivity(capsys, monkeypatch, tmp_path):
    store, edge, figure = (str(tmp_path / name) for name in ("safe.zarr", "edge.csv", "bars.png"))
    few = (
        "--set",
        "map.over.angle.points=9",
        "--set",
        "map.over.stiffness.points=9",
        "--set",
        "map.over.preload=['5 MPa']",
    )
    status, out, _ = run(capsys, monkeypatch, "map", SAFE, *few, "-o", store, "-o", edge, "--refine", "2")
    assert (status, "new points, where the whole grid" in out) == (0, True)
    assert Path(edge).read_text().startswith("contact.angle (rad)")
    status, out, _ = run(
        capsys, monkeypatch, "sensitivity", SAFE, "--of", "margin", "--points", "256", "--json", "-o", figure
    )
    assert status == 0
    assert set(json.loads(out)["results"]) == {"margin"}
    assert Path(figure).exists()


def test_a_map_that_is_not_finished_says_what_finishes_it(tmp_path, capsys, monkeypatch):
    """Opened by itself it computes nothing, so that the same command would say the same for ever."""
    store = str(tmp_path / "part.zarr")
    part = ["map", SAFE, "--set", "map.over.contact.angle.points=3", "--set", "map.over.slider.stiffness.points=3"]
    assert run(capsys, monkeypatch, *part, "-o", store)[0] == 0
    next(path for path in (tmp_path / "part.zarr" / "complete" / "c").rglob("*") if path.is_file()).unlink()
    status, _, error = run(capsys, monkeypatch, "map", store)
    assert status == 130
    assert error.strip().endswith("are finished and kept; map its rig file again to go on")
    assert run(capsys, monkeypatch, *part, "-o", store)[0] == 0
    assert run(capsys, monkeypatch, "map", store)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("map", SAFE), "give one name for the map, such as -o safe-stiffness.zarr"),
        (("map", SAFE, "-o", "x.nc"), "got x.nc; also give one for the map itself, such as -o x.zarr"),
        (("map", SAFE, "-o", "x.zarr", "-o", "y.zarr"), "got 2 names for the map; give one name for the map, such as"),
        (("map", SAFE, "-o", "a.zarr", "-o", "b.zarr"), "got 2 names"),
        (("map", SAFE, "-o", "a.zarr", "-o", "a.csv"), "allowed endings"),
        (("map", SAFE, "-o", "a.zarr", "--cluster", "host"), "cluster: got 'host'"),
        (("map", SAFE, "-o", "a.zarr", "--set", "map.over.angel.points=3"), "did you mean 'contact.angle'"),
        (("map", SAFE, "-o", "a.zarr", "--set", "map.compute=['statsu']"), "did you mean 'status'"),
        (("map", str(ROOT / "examples" / "lead-screw.toml"), "-o", "a.zarr"), "map: missing table"),
        (("map", "none.zarr"), "there is no map 'none.zarr'"),
        (("map", "none.toml", "-o", "a.zarr"), "no such file"),
        (("map", SAFE, "-o", "a.zarr", "--refine", "1", "--show", "status"), "--show: is for figures of a map"),
        (("map", SAFE, "-o", "a.zarr", "--level", "3"), "--level: applies to a refined edge only"),
        (("map", SAFE, "-o", "a.zarr", "--cluster", "tcp://:"), "allowed: 'local', or an address"),
        (("sensitivity", SAFE, "--points", "100"), "a power of 2"),
        (("sensitivity", SAFE, "--of", "status"), "not one number"),
        (("sensitivity", SAFE, "-o", "a.csv"), "allowed endings"),
    ],
)
def test_bad_input_is_one_message(capsys, monkeypatch, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    status, _, error = run(capsys, monkeypatch, *arguments)
    assert status == 2
    assert message in error
    assert error.count("error:") == 1
    assert not list(tmp_path.iterdir())


def test_names_that_a_map_does_not_have_are_said(capsys, monkeypatch, tmp_path):
    store = str(tmp_path / "safe.zarr")
    few = ("--set", "map.over.angle.points=5", "--set", "map.over.stiffness.points=5")
    assert run(capsys, monkeypatch, "map", SAFE, *few, "-o", store)[0] == 0
    for words, message in {
        ("--x", "angel"): "did you mean 'contact.angle'",
        ("--show", "growth"): "did you mean 'growth_rate'",
        ("--facet", "angel"): "did you mean 'contact.angle'",
        ("--facet", "angle", "--x", "angle"): "is on an axis already",
        ("--x", "angle", "--y", "angle"): "on both axes",
    }.items():
        status, _, error = run(capsys, monkeypatch, "map", store, *words, "-o", str(tmp_path / "a.png"))
        assert (status, message in error) == (2, True), error
    status, _, error = run(capsys, monkeypatch, "map", store, "--set", "a=0.01")
    assert (status, "is a map already" in error) == (2, True)


@pytest.mark.slow
@pytest.mark.campaign
def test_ctrl_c_says_how_to_go_on(tmp_path):
    """Twice: with workers, and after that the rest."""
    store = tmp_path / "big.zarr"
    words = [
        "map",
        SAFE,
        "-o",
        str(store),
        "--set",
        "map.over.angle.points=8001",
        "--set",
        "map.over.stiffness.points=4001",
    ]
    command = [sys.executable, "-m", "steadyslip", *words, "--workers", "2"]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # tests may run where Ctrl-C is ignored
    )  # fmt: skip
    end = time.monotonic() + 60
    while time.monotonic() < end and not (store.exists() and ss.open_map(store).finished[0]):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130, error
    done, count = ss.open_map(store).finished
    assert 0 < done < count
    assert error.strip() == f"stopped: {done} of {count} chunks are finished and kept; the same command goes on"


def test_help_is_quick_and_complete():
    text = CliRunner().invoke(app, ["map", "--help"]).output
    assert "--cluster" in text
