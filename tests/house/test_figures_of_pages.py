"""Figures of pages show what the program computes, and can be read in grey at the width of a column."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.colors import to_rgb

DOCS = Path(__file__).parents[2] / "docs"
FOLDER = DOCS / "figures"
COSTLY = ("slow-slip", "oscillating-normal-stress")
DRAW = runpy.run_path(str(FOLDER / "draw.py"))


def test_every_figure_is_on_a_page():
    pages = "".join(page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md"))
    assert {path.stem for path in FOLDER.glob("*.svg")} == {*DRAW["FIGURES"]}
    assert {*re.findall(r"\.\./figures/([\w-]+)\.svg", pages)} == {*DRAW["FIGURES"]}


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=pytest.mark.campaign if one in COSTLY else ()) for one in DRAW["FIGURES"]]
)
def test_figures_show_what_is_computed(name):
    """Drawn anew, with the numbers in the file; of motion that sticks and slips some moments may differ."""
    with rc_context(DRAW["STYLE"]):
        axes = DRAW["FIGURES"][name]()
    kept = DRAW["drawn"](FOLDER / f"{name}.svg")
    for now, then in zip(DRAW["numbers"](axes), kept, strict=True):
        for new, old in zip(now, then, strict=True):
            right = np.isclose(new, old, rtol=1e-2, atol=1e-3 * np.max(np.abs(old)))
            assert np.mean(right) > 0.97, f"run python docs/figures/draw.py {name}"
    figure = axes[0].figure
    assert figure.get_figwidth() == pytest.approx(85 / 25.4)
    figure.draw_without_rendering()
    texts = [text for text in figure.findobj(lambda part: hasattr(part, "get_fontsize")) if text.get_text()]
    assert min(text.get_fontsize() for text in texts) >= 6.5
    for ax in axes:
        assert in_grey(ax), "two lines that differ in nothing but colour"


def in_grey(ax):
    """Whether lines with a label differ in dashes, mark or a brightness that can be told."""
    looks = []
    for line in ax.get_lines():
        if not line.get_label().startswith("_"):
            bright = round(4 * float(np.dot(to_rgb(line.get_color()), (0.3, 0.59, 0.11))))
            looks.append((line.get_linestyle(), line.get_marker(), bright))
    return len(looks) == len(set(looks))
