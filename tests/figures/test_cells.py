"""Words and edges of areas of one kind each, such as those of maps of hunting and of basins."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from steadyslip.figures.cells import mark_areas
from steadyslip.figures.style import AREA_WORD

WORDS = {0: "settles", 1: "hunts", 2: "runs away"}


def nearest(values, at):
    return int(np.argmin(np.abs(values - at)))


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_words_stand_in_their_areas_and_lines_between_two(scale):
    x, y = (
        (np.geomspace(1, 300, 17), np.geomspace(0.1, 9, 13)) if scale == "log" else (np.arange(17.0), np.arange(13.0))
    )
    row, column = np.indices((13, 17))
    kinds = np.where(row + column > 20, 2, np.where(row < 4, 0, 1))
    ax = Figure(figsize=(6, 4)).subplots()
    ax.set(xscale=scale, yscale=scale, xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    mark_areas(ax, x, y, kinds, WORDS)
    assert {text.get_text() for text in ax.texts} == set(WORDS.values())
    for text in ax.texts:
        at = text.get_position()
        assert WORDS[kinds[nearest(y, at[1]), nearest(x, at[0])]] == text.get_text()
        assert text.get_gid() == AREA_WORD
    (line,) = ax.lines
    sides = line.get_xydata().reshape(-1, 3, 2)[:, :2]
    assert len(sides) == np.count_nonzero(np.diff(kinds)) + np.count_nonzero(np.diff(kinds, axis=0))
    for middle, along in zip(sides.mean(axis=1), np.diff(sides, axis=1)[:, 0], strict=True):
        across = 1e-6 * np.sign(along[::-1])
        ends = (middle + across * middle, middle - across * middle)
        assert len({kinds[nearest(y, end[1]), nearest(x, end[0])] for end in ends}) == 2


def test_one_kind_has_its_word_and_no_edge():
    ax = Figure().subplots()
    ax.set(xlim=(0, 1), ylim=(0, 1))
    mark_areas(ax, np.linspace(0, 1, 5), np.linspace(0, 1, 4), np.ones((4, 5), int), WORDS)
    assert [text.get_text() for text in ax.texts] == ["hunts"]
    assert not ax.lines
