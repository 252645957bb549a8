"""What is written takes the place of a file, whole or not at all, and of nothing but a file."""

import os
import stat

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import rig
from steadyslip.files.output import whole_file, write_by_ending, write_text


@pytest.fixture(scope="module")
def history():
    return ss.simulate(rig(stiffness=9e9), ss.protocol.VelocityStep(at=1.0, to=2e-6), until=2.0, times=[0.0, 2.0])


@pytest.fixture(scope="module")
def writers(history, tmp_path_factory):
    plan = ss.Map(rig(), {"stiffness": ss.maps.Grid(1e9, 3e9, 3)}, ["status"])
    found = ss.run_map(plan, tmp_path_factory.mktemp("map") / "map.zarr", workers=1, progress=False)
    return {
        "to_csv": history.to_csv,
        "save": history.save,
        "write_rig": lambda path: ss.write_rig(rig(), path),
        "to_netcdf": found.to_netcdf,
        "to_parquet": found.to_parquet,
        "explore": lambda path: ss.explore(rig()).save(path),
        "figure": lambda path: write_by_ending(path.with_suffix(".png"), {}, found.plot, found),
    }


NAMES = ("to_csv", "save", "write_rig", "to_netcdf", "to_parquet", "explore", "figure")


@pytest.mark.parametrize("name", NAMES)
def test_a_pipe_is_never_replaced(writers, name, tmp_path):
    pipe = tmp_path / ("pipe.nc" if name == "save" else "pipe.png")
    os.mkfifo(pipe)
    with pytest.raises(ss.NotAvailable, match="it is a device or a pipe; give the name of a file"):
        writers[name](pipe)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert os.listdir(tmp_path) == [pipe.name]


def test_a_saved_run_is_named_as_the_netcdf_that_it_is(history, tmp_path):
    with pytest.raises(ss.NotAvailable, match=r"run.csv.*allowed endings are .nc"):
        history.save(tmp_path / "run.csv")


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/null", "/dev/fd/1", "/proc/self/fd/1"])
def test_nor_is_a_device(history, name):
    before = os.lstat(name).st_mode
    with pytest.raises(ss.NotAvailable, match="device or a pipe"):
        history.to_csv(name)
    assert os.lstat(name).st_mode == before


def test_nor_a_folder(history, tmp_path):
    with pytest.raises(ss.NotAvailable, match="it is a folder"):
        history.to_csv(tmp_path)


def test_a_link_stays_one_and_what_it_leads_to_is_written(history, tmp_path):
    (tmp_path / "there").mkdir()
    target, link, dangling = tmp_path / "there" / "run.csv", tmp_path / "run.csv", tmp_path / "new.csv"
    target.write_text("before")
    link.symlink_to(target)
    history.to_csv(link)
    assert link.is_symlink()
    assert target.read_text().startswith("t (s),")
    dangling.symlink_to(tmp_path / "there" / "new.csv")
    history.to_csv(dangling)
    assert (tmp_path / "there" / "new.csv").read_text() == target.read_text()
    assert sorted(os.listdir(tmp_path / "there")) == ["new.csv", "run.csv"]


def test_a_private_file_takes_the_place_of_a_link(tmp_path):
    """Nobody else chooses where what is for the owner alone is written."""
    (tmp_path / "theirs").write_text("before")
    (tmp_path / "mine").symlink_to(tmp_path / "theirs")
    with whole_file(tmp_path / "mine", private=True) as temporary, open(temporary, "w") as file:
        file.write("secret")
    assert (tmp_path / "theirs").read_text() == "before"
    assert not (tmp_path / "mine").is_symlink()
    assert stat.S_IMODE((tmp_path / "mine").stat().st_mode) == 0o600


def test_a_fault_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")

    def half_way():
        with whole_file(path) as temporary:
            np.savetxt(temporary, np.zeros(3))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        half_way()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
