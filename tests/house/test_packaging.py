"""What is shipped: the source distribution holds every file that its own README names."""

import re
import shutil
import subprocess
import tarfile
import tomllib
from pathlib import Path

import pytest

from steadyslip.core.version import RELEASE, digest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    from hatchling.builders.sdist import SdistBuilder

    (path,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("dist")), versions=["standard"])
    with tarfile.open(path) as archive:
        return {name.partition("/")[2] for name in archive.getnames()}


def test_every_file_of_the_readme_is_shipped(shipped):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    named = {word.rstrip(".,;:)") for word in re.findall(r"[\w./-]+/[\w.-]+|\b[\w-]+\.(?:py|txt|toml|md)\b", text)}
    files = {name for name in named if (ROOT / name).is_file()}
    assert {"run.py", "examples/inclined-spring.toml"} <= files
    assert files <= shipped


def test_what_git_has_is_shipped(shipped):
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a checkout")
    assert {name for name in listed.stdout.splitlines() if not name.startswith(".")} <= shipped


def test_wheel_and_source_distribution_are_the_program_of_the_checkout(tmp_path):
    """Also where there is no version control, which nothing asks."""
    from hatchling.builders.sdist import SdistBuilder
    from hatchling.builders.wheel import WheelBuilder

    (source,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    checked = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # from Python 3.11.4 on
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path / "source", **checked)
    (unpacked,) = (tmp_path / "source").iterdir()
    (wheel,) = WheelBuilder(str(unpacked)).build(directory=str(tmp_path), versions=["standard"])
    shutil.unpack_archive(wheel, tmp_path / "wheel", "zip")
    own = digest(ROOT / "src" / "steadyslip")
    assert digest(unpacked / "src" / "steadyslip") == own
    assert digest(tmp_path / "wheel" / "steadyslip") == own
    assert Path(wheel).name.startswith(f"steadyslip-{RELEASE}-")


def test_oldest_pins_are_the_declared_floors():
    about = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    floors = dict(word.split(">=") for word in about["dependencies"])
    pins = dict(line.split("==") for line in (ROOT / "pins-oldest.txt").read_text().splitlines() if "==" in line)

    def plain(version):
        return re.sub(r"(\.0)+$", "", version)

    assert {name: plain(pins.get(name, "missing")) for name in floors} == {n: plain(v) for n, v in floors.items()}
