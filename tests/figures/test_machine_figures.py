"""Sketches of machines, pictures of their verdicts, documents: what is on them, and that no words lie on others."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import steadyslip as ss
from command import run
from machines import at_random, brake, rate_state, three_bodies, two_blocks, two_mass
from read_pages import words
from steadyslip import figures
from steadyslip.core.palette import STABLE
from steadyslip.figures.style import parameter_label
from steadyslip.machine.letters import label_of

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "machines").glob("*.toml"))
MACHINES = {path.stem: ss.read_rig(path) for path in EXAMPLES} | {
    "three bodies": three_bodies(), "two blocks": two_blocks(1.0, -0.1, 0.2),
    "mode coupling": brake(rate_state(1, 0, 1)),
    "late": replace(two_mass(), drive=ss.machine.Cascade(velocity=1.0, body="motor", measured="table", kv=1.0, kp=1.0,
    tn=1.0,
                                                 delay=0.1)),
    **{f"random {seed}": at_random(seed)[0] for seed in range(12)},
}  # fmt: skip


@cache
def analysed(name):
    return ss.analyze(MACHINES[name])


def boxes(ax):
    """Every text with where it is, in points of the picture."""
    figure = ax.get_figure()
    figure.canvas.draw()
    found = [one for one in ax.texts if one.get_text()]
    return [(one.get_text(), one.get_window_extent(figure.canvas.get_renderer())) for one in found]


@pytest.mark.parametrize("name", MACHINES)
def test_a_sketch_names_everything_and_no_words_lie_on_others(name):
    machine = MACHINES[name]
    ax = figures.machine_sketch(machine)
    texts = boxes(ax)
    words = "\n".join(text for text, _ in texts)
    for one in (*machine.bodies, *machine.links, *machine.contacts):
        assert one in words
    whole = ax.get_figure().bbox
    for i, (text, box) in enumerate(texts):
        assert whole.x0 - 1 <= box.x0 < box.x1 <= whole.x1 + 1, text
        assert whole.y0 - 1 <= box.y0 < box.y1 <= whole.y1 + 1, text
        for other, where in texts[i + 1 :]:
            assert not box.overlaps(where), (text, other)


def test_a_sketch_says_what_the_drive_does():
    late = "\n".join(text for text, _ in boxes(figures.machine_sketch(MACHINES["late"])))
    for piece in ("P-PI", "100 ms late", "place", "speed"):
        assert piece in late
    pulled = "\n".join(text for text, _ in boxes(figures.machine_sketch(MACHINES["two-guides"])))
    assert "20 µm/s" in pulled
    assert "0.4 N/µm" in pulled
    rotary = "\n".join(text for text, _ in boxes(figures.machine_sketch(MACHINES["telescope"])))
    for piece in ("900 kg m²", "MN m/rad", "gear 0.002", "20 kN at 0.6 m", "rad/s"):
        assert piece in rotary


def test_bars_are_the_stable_values():
    """Of every parameter that is drawn and whose stable set is known exactly."""
    for name in ("feed-axis", "telescope", "two-surfaces", "late"):
        found = analysed(name)
        ax = figures.stable_ranges(found)
        rows = [label.get_text() for label in ax.get_yticklabels()]
        known = {m.parameter: m for m in found.margins}
        seen = 0
        for row, label in enumerate(rows):
            full = next(n for n in known if parameter_label(found.rig, n) == label)
            bars = [p for p in ax.patches if abs(p.get_y() + p.get_height() / 2 - row) < 0.01]
            bars = sorted((p.get_x(), p.get_x() + p.get_width()) for p in bars if p.get_facecolor() == to_rgba(STABLE))
            try:
                exact = ss.stable_values(found.rig, full) / known[full].value
            except ss.NotAvailable:
                continue
            exact = [(max(a, 0.01), min(b, 100.0)) for a, b in exact if a < 100 and b > 0.01]
            assert np.array(bars) == pytest.approx(np.array(exact), rel=1e-6), (name, full)
            seen += 1
        assert seen > (2 if name != "late" else 0)  # whose other edges are far or not exact


def test_hatching_is_where_sliding_is_not_steady():
    """Beyond an edge at which a contact lifts off, and nowhere in bars of parameters without one."""
    from steadyslip.figures.machine_verdict import LOST, _pieces
    from steadyslip.linear.status import ABSENT

    margins = {one.parameter: one for one in analysed("geared-servo").margins if one.edges and one.value > 0}
    for margin in margins.values():
        lost = [edge.value for edge in margin.edges if edge.kind in LOST and edge.value > 0]
        absent = [piece for piece in _pieces(margin) if piece[2] == ABSENT]
        assert bool(absent) == bool(lost)
        assert all(not low < margin.value < high for low, high, _ in absent)
    (beyond,) = [piece for piece in _pieces(margins["contacts.guide.friction.b"]) if piece[2] == ABSENT]
    assert beyond[0] > 2
    ax = figures.stable_ranges(analysed("geared-servo"))
    assert not [patch for patch in ax.patches if patch.get_hatch()]
    assert sorted(text.get_text() for text in ax.get_legend().get_texts()) == ["stable", "unstable"]


def test_what_bars_leave_out_is_said():
    """Every edge is drawn, or counted below the bars and named under the picture."""
    from steadyslip.figures.machine_verdict import undrawn_edges

    found = analysed("brake-pad")
    ax = figures.stable_ranges(found)
    left = undrawn_edges(found)
    drawn = [one.parameter for one in found.margins if one.edge is not None and one.parameter not in left]
    assert len(ax.get_yticks()) == len(drawn)
    assert f"{len(left)} more edges not drawn" in ax.get_xlabel()
    document = ss.report(found, explorer=False).html
    named = ", ".join(label_of(found.rig, name) for name in left)
    assert f"the edges of {named}: a factor of 100 away or more" in words(document)


def test_the_leading_mode_and_the_eigenvalues_are_those_of_the_analysis():
    found = analysed("brake-pad")
    ax = figures.mode_shape(found)
    widths = [p.get_width() for p in ax.patches][: len(found.mode.amplitudes)]
    assert np.abs(widths) == pytest.approx([abs(a) for a in found.mode.amplitudes.values()])
    assert min(widths) < 0 < max(widths)
    plane = figures.eigenvalue_plane(found)
    points = np.concatenate([line.get_xydata() for line in plane.lines if line.get_label() in ("grows", "decays")])
    assert np.sort(points[:, 0]) == pytest.approx(np.sort(np.real(found.eigenvalues)))
    assert found.plot("mode") is not None
    assert len(found.plot()) == 3


def test_without_steady_sliding_there_are_ranges_only():
    off = ss.analyze(MACHINES["brake-pad"].with_values({"bodies.pad.press": -1.0}))
    assert off.stable is None
    for kind in ("mode", "eigenvalues"):
        with pytest.raises(ss.NotAvailable, match="this rig has no"):
            off.plot(kind)


@pytest.mark.parametrize("name", [pytest.param("brake-pad", marks=pytest.mark.campaign), "feed-axis"])
def test_a_machine_has_a_document_with_its_sketch_and_its_picture(name, tmp_path):
    path = EXAMPLES[0].with_name(f"{name}.toml")
    done = run("report", str(path), "-o", "a.html", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    text, explorer, _ = (tmp_path / "a.html").read_text("utf-8").partition('<div class="steadyslip-root"')
    machine = ss.read_rig(path)
    assert explorer
    assert text.count("<svg") == 6  # sketch, mode in wide and narrow windows, chart, motion over time and in its plane
    for one in (*machine.bodies, *machine.links, *machine.contacts):
        assert one in text
    assert "NaN" not in text
    onset = analysed(name).onset
    assert onset is None or "<th>onset" in text or ">onset<" in text
    assert "<svg" in machine._repr_html_()
    assert "<svg" in analysed(name)._repr_html_()


def test_a_formula_is_refused_in_words():
    done = run("analyze", str(EXAMPLES[1]), "--formula")
    assert done.returncode == 0
    assert "No formula: " in done.stdout
    assert '"formula": null' in run("analyze", str(EXAMPLES[1]), "--formula", "--json").stdout


def test_along_the_drive_steady_sliding_is_as_fast_as_each_value_says():
    """Where no cycle was found, too: the onset is on the line of steady sliding, not at the velocity of the rig."""
    rig = ss.read_rig(Path(__file__).parents[2] / "examples" / "stick-slip.toml")
    branch = ss.cycles(rig, "drive.velocity", doublings=0)
    for one in (branch, replace(branch, cycles=(), special=(), gaps=())):
        line, onset = (next(x for x in one.plot().lines if word in x.get_label()) for word in ("steady", "onset"))
        unit = onset.get_ydata()[0] / branch.onset.value
        factor = onset.get_xdata()[0] / branch.onset.value
        assert line.get_ydata() / unit == pytest.approx(line.get_xdata() / factor)
        assert onset.get_xdata()[0] in line.get_xdata()


def test_mode_charts_draw_frequencies_and_dampings_of_the_result():
    from steadyslip.linear import mode_chart

    found = mode_chart(ss.read_rig("examples/machines/brake-pad.toml"), "links.caliper.stiffness")
    upper, lower = found.plot()
    for ax, table in ((upper, found.frequencies), (lower, found.damping_ratios)):
        lines = {line.get_label(): line for line in ax.get_lines()}
        for title, column in zip(found.titles, table.T, strict=True):
            np.testing.assert_allclose(lines[title].get_ydata(), column)
            np.testing.assert_allclose(lines[title].get_xdata(), found.values / 1e6)
        assert lines["_edge"].get_xdata()[0] == pytest.approx(11.0483, rel=1e-5)
        assert lines["_own"].get_xdata()[0] == 6.0
        assert np.array_equal(np.isfinite(lines["_grows"].get_ydata()), found.damping_ratios[:, 0] < 0)
    assert upper.get_ylabel() == "frequency (Hz)"
    assert lower.get_xlabel().endswith("(N/µm)")
    with pytest.raises(ss.ParameterError, match="two, for frequencies and damping ratios"):
        found.plot(ax=[upper])


def test_wide_charts_of_many_modes_are_logarithmic_and_leave_the_others_grey():
    from steadyslip.linear import mode_chart
    from structures_at_random import reed

    upper, lower = mode_chart(reed(), "steady_normal_stress", (10.0, 1e4)).plot()
    assert (upper.get_xscale(), upper.get_yscale(), lower.get_yscale()) == ("log", "log", "linear")
    assert sum(one.get_text().startswith("mode ") for one in upper.get_legend().get_texts()) == 8
    assert sum(line.get_label() == "_other" for line in upper.get_lines()) == 18
    styles = [
        (line.get_color(), line.get_linestyle()) for line in upper.get_lines() if line.get_label().startswith("mode ")
    ]
    assert len(set(styles)) == 8
