"""The version is that of the files at hand: what two programs computed can be told apart."""

import re
import shutil
from pathlib import Path

import pytest

import steadyslip as ss
from fuzz_files import rig
from steadyslip.core import version as versions

PACKAGE = Path(ss.__file__).parent


def test_it_is_a_version_that_packaging_knows():
    from packaging.version import Version

    assert re.fullmatch(rf"{re.escape(versions.RELEASE)}\+s[0-9a-f]{{8}}", ss.__version__)
    assert str(Version(ss.__version__)) == ss.__version__
    assert Version(ss.__version__).public == versions.RELEASE


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    return Path(shutil.copytree(PACKAGE, tmp_path_factory.mktemp("copy") / "steadyslip"))


def test_a_copy_has_the_same(copy):
    assert versions.version().endswith(versions.digest(copy))


@pytest.mark.parametrize("name", ["laws/friction/rate_state.py", "kernels/printers/runtime.js", "__init__.pyi"])
def test_a_letter_anywhere_is_another_program(copy, name):
    text = (copy / name).read_bytes()
    (copy / name).write_bytes(text + b" ")
    assert not versions.version().endswith(versions.digest(copy))
    (copy / name).write_bytes(text.replace(b"\n", b"\r\n"))
    assert versions.version().endswith(versions.digest(copy)), "lines may end as they do elsewhere"
    (copy / name).rename(copy / "moved.py")
    assert not versions.version().endswith(versions.digest(copy))
    (copy / "moved.py").unlink()
    assert not versions.version().endswith(versions.digest(copy))
    (copy / name).write_bytes(text)


def test_what_is_no_part_of_the_program_does_not_count(copy):
    (copy / "laws" / "__pycache__").mkdir(exist_ok=True)
    (copy / "laws" / "__pycache__" / "more.py").touch()
    (copy / "laws" / ".hidden.py").touch()
    (copy / "notes.txt").touch()
    assert versions.version().endswith(versions.digest(copy))


def test_every_file_of_the_package_counts():
    files = {path.name for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert {name for name in files if not name.endswith(versions.KINDS)} == {"py.typed"}


def test_a_saved_run_keeps_the_version_that_computed_it(tmp_path, monkeypatch):
    run = ss.simulate(rig(), until=2.0)
    assert run.version == ss.__version__
    assert run.to_dict()["version"] == ss.__version__
    assert "version" not in str(run)
    own = versions.version()
    monkeypatch.setattr(versions, "version", lambda: "9.9")
    for _ in range(2):
        run.save(tmp_path / "run.nc")
        run = ss.load_history(tmp_path / "run.nc")
        assert run.version == own
        assert f"computed by steadyslip {own}, this is 9.9" in str(run)
