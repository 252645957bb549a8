"""What is shipped: the source distribution holds every file that its own README names."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

from command import run
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


def test_the_wheel_brings_the_examples(tmp_path):
    """And copies them, outside a checkout: README's first command works on a copy."""
    from hatchling.builders.wheel import WheelBuilder

    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    shutil.unpack_archive(wheel, tmp_path / "wheel", "zip")
    apart = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(tmp_path / "wheel")}, "check": True}
    program = [sys.executable, "-m", "steadyslip"]
    subprocess.run([*program, "examples", "-o", "examples"], **apart, stdout=subprocess.DEVNULL)
    command = [*program, "analyze", "examples/inclined-spring.toml"]
    assert b"29.07 GPa/m" in subprocess.run(command, **apart, stdout=subprocess.PIPE).stdout
    listed = [path.relative_to(ROOT) for path in (ROOT / "examples").rglob("*") if path.is_file()]
    assert len(listed) > 15
    for path in listed:
        assert (tmp_path / path).read_bytes() == (ROOT / path).read_bytes()


def test_examples_are_listed_and_no_file_of_a_user_is_replaced(tmp_path):
    listed = run("examples").stdout
    for path in (ROOT / "examples").rglob("*.toml"):
        assert re.search(rf"(?m)^{path.relative_to(ROOT / 'examples').as_posix()} +\w[\w ]", listed), path
    assert run("examples", "-o", "mine", folder=tmp_path).returncode == 0
    assert run("examples", "-o", "mine", folder=tmp_path).returncode == 0  # the same again changes nothing
    (tmp_path / "mine/triaxial.toml").write_text("mine")
    (tmp_path / "mine/stick-slip.toml").unlink()
    refused = run("examples", "-o", "mine", folder=tmp_path)
    assert (refused.returncode, refused.stderr.count("triaxial.toml")) == (2, 1)
    assert (tmp_path / "mine/triaxial.toml").read_text() == "mine"
    assert not (tmp_path / "mine/stick-slip.toml").exists()
    (tmp_path / "file").touch()
    assert "Traceback" not in run("examples", "-o", "file", folder=tmp_path).stderr


def test_one_version_is_written_everywhere():
    change = re.search(r"(?m)^## \[(\d[\d.]*)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    recipe = (ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    cited = re.search(r"(?m)^version: (\S+)\ndate-released: (\S+)$", citation)
    assert change.groups() == cited.groups()
    assert {change[1], re.search(r'version: "(.*)"', recipe)[1], archive["version"]} == {RELEASE}


def test_the_conda_recipe_asks_for_what_the_package_needs():
    about = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
    asked = re.findall(r"(?m)^    - (.*)$", recipe.partition("  run:\n")[2].partition("\ntests:")[0])
    wanted = [word.replace(">=", " >=") for word in about["dependencies"]]
    wanted = [word.replace("matplotlib ", "matplotlib-base ") for word in wanted]
    assert asked == ["python >=${{ python_min }}", *wanted]
    assert f'python_min: "{about["requires-python"].removeprefix(">=")}"' in recipe


def test_the_paper_cites_what_is_in_its_list():
    text = (ROOT / "paper/paper.md").read_text(encoding="utf-8")
    listed = re.findall(r"@\w+\{(\w+),", (ROOT / "paper/paper.bib").read_text(encoding="utf-8"))
    assert set(re.findall(r"@(\w+\d{4})", text)) == set(listed)
    assert 750 <= len(text.split("# Summary")[1].split()) <= 1750


def test_oldest_pins_are_the_declared_floors():
    about = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    floors = dict(word.split(">=") for word in about["dependencies"])
    pins = dict(line.split("==") for line in (ROOT / "pins-oldest.txt").read_text().splitlines() if "==" in line)

    def plain(version):
        return re.sub(r"(\.0)+$", "", version)

    assert {name: plain(pins.get(name, "missing")) for name in floors} == {n: plain(v) for n, v in floors.items()}
