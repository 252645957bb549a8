"""Notebooks for teaching run as they are, show what their cells print, and have exercises with answers."""

import json
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from notebooks import cells_of, run_cell, shown

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_shows_what_its_cells_print(path, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path / "examples/notebooks")  # where a notebook is opened
    names: dict = {}
    for cell in cells_of(path):
        assert run_cell("".join(cell["source"]), names) == shown(cell)
    plt.close("all")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_exercise_has_an_answer(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    exercises = [i for i, cell in enumerate(cells) if "## Exercise" in "".join(cell["source"])]
    assert len(exercises) == 3
    for begin, end in zip(exercises, [*exercises[1:], len(cells)], strict=True):
        assert any(cell["cell_type"] == "code" for cell in cells[begin:end])


def test_there_are_three():
    assert len(NOTEBOOKS) == 3
