"""Contours of k/k_cr in stability charts: where they are, where they end, and their labels."""

import itertools
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.contour import ContourSet

import steadyslip as ss
from chart_areas import contains

matplotlib.use("Agg")


def _contours_of(ax):
    """Levels of k/k_cr and vertices (n, 2) of the lines of a chart."""
    (lines,) = [one for one in ax.collections if isinstance(one, ContourSet)]
    return [(share / (1 - share), path.vertices) for share, path in zip(lines.levels, lines.get_paths(), strict=True)]


def test_contours_reach_the_edges_of_the_chart_and_the_critical_line():
    """k/k_cr has the lines k = level k_cr, down to where k_cr is zero; each label is on its own."""
    rig = ss.read_rig("examples/inclined-spring.toml")
    ax = ss.figures.stability_chart(rig, "friction.b", "stiffness", points=61)
    low, high = ax.get_ylim()
    for level, line in _contours_of(ax):
        b, k = line.T
        assert k.min() == pytest.approx(low, rel=0.3)
        exact = level * ss.critical_stiffness(rig, {"friction.b": b}) / 1e9
        far = (exact > 3 * low * level) & (k < 0.9 * high) & (b > 0.017)
        assert far.any()
        assert np.abs(np.log(k / exact))[far].max() < 0.02
    written = [text for text in ax.texts if re.fullmatch(r"[\d.]+", text.get_text())]
    assert sorted(float(text.get_text()) for text in written) == pytest.approx([level for level, _ in _contours_of(ax)])
    heights = [np.log(text.get_position()[1] / low) / np.log(high / low) for text in written]
    assert min(heights) > 0.1  # where lines are apart


def test_contours_go_on_where_a_gain_is_more_than_enough_alone():
    """Of a controller without a spring they are those of the gain over the critical gain, on both sides of 1."""
    rig = ss.read_rig("examples/slow-axis.toml")
    ax = ss.figures.stability_chart(rig, "friction.b", "drive.kp", points=61)
    known, edge = _edge_over(rig.with_values({"drive.kp": 1e3}), np.linspace(0.012, 0.024, 30))
    found = _contours_of(ax)
    assert [level for level, _ in found] == pytest.approx([0.1, 0.2, 0.5, 2.0, 5.0])
    for level, line in found:
        b, kp = line.T
        inner = (b > known[0]) & (b < known[-1]) & (kp < 0.9 * ax.get_ylim()[1])
        assert np.abs(np.log(kp / (level * np.interp(b, known, edge))))[inner].max() < 0.05


def test_lines_of_a_chart_end_at_its_frame_or_at_an_edge_of_steady_sliding():
    """Contours, edge and areas leave no gap beside lock-up, where k_cr has an asymptote."""
    rig = ss.read_rig("examples/inclined-spring.toml")
    ax = ss.figures.stability_chart(rig, "contact.angle", "stiffness", points=61)
    (left,) = [edge.value * 180 / np.pi for edge in ss.boundary(rig, "contact.angle") if edge.kind == "lock-up"]
    low, high = ax.get_ylim()
    for _, line in _contours_of(ax):
        for angle, k in line[[0, -1]]:
            ends = angle - left, 80 - angle, np.log(k / low), np.log(high / k)
            assert min(ends) < 1e-6  # beyond the edge, where it is cut off, or on the frame
    (lines,) = [one for one in ax.collections if isinstance(one, ContourSet)]
    assert lines.get_clip_path() is not None
    for angle, k in itertools.product(
        [*np.linspace(-79, 79, 9), left - 0.1, left + 0.1], np.geomspace(1.01 * low, 0.99 * high, 9)
    ):
        assert any(contains(ax, name, angle, k) for name in ("stable", "unstable", "no steady"))


def _edge_over(rig, values):
    """Values of b, and the critical gain (N/µm) at each: what is critical beside the gain, and the gain."""
    critical = np.array([ss.critical_stiffness(rig.with_values({"friction.b": float(one)})) for one in values])
    known = np.isfinite(critical)
    return np.array([values, (critical + rig.value("drive.kp")) * rig.area / 1e6])[:, known]


def test_contours_of_a_growth_rate_are_where_it_has_their_levels(tmp_path):
    """They joined the points of a map by straight lines: a tenth of them was off by 90 % or more."""
    rig = ss.read_rig("examples/machines/brake-pad.toml")
    names = "links.caliper.stiffness", "contacts.disc.contact.normal_stiffness"
    grids = dict(zip(names, (np.geomspace(2e5, 2e8, 17), np.geomspace(5e5, 2e8, 15)), strict=True))
    found = ss.run_map(ss.Map(rig, grids, ["status", "growth_rate"]), tmp_path / "pad.zarr", workers=1)
    ax = found.plot()
    (lines,) = [one for one in ax.collections if isinstance(one, ContourSet)]
    for level, path in zip(lines.levels, lines.get_paths(), strict=True):
        rates = ss.growth_rate(rig, dict(zip(names, 1e6 * path.vertices.T, strict=True)))
        off = np.abs(rates - level) / abs(level)
        assert np.median(off) < 0.05
        assert np.quantile(off, 0.9) < 0.3


@pytest.mark.parametrize("x", ["drive.velocity", "friction.mu_static", "lead_angle"])
def test_a_narrow_chart_keeps_its_contours_and_every_area_its_word(x):
    """One piece of a contour beside an edge took the whole contour away; of two stable areas one had its word."""
    with ss.figures.journal():
        ax = ss.figures.stability_chart(ss.read_rig("examples/lead-screw.toml"), x, "stiffness", points=101)
    assert len(_contours_of(ax)) >= 2
    words = sorted(text.get_text() for text in ax.texts if text.get_text().isalpha())
    assert words == (["stable"] if x != "drive.velocity" else ["stable", "stable"]) + ["unstable"]
