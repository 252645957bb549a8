"""Pictures that must not mislead: spacing of axes, samples without a value, runs that hardly change, probabilities."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

import lab_records as lab
import steadyslip as ss
from dimensionless import unit_rig
from steadyslip import figures
from steadyslip.core import palette
from steadyslip.core.format import format_percent
from steadyslip.experiments.answers.predict import probability_text
from steadyslip.figures.hunting import hunting
from steadyslip.figures.map_axes import Scale, is_geometric
from steadyslip.figures.style import AREA_WORD, EDGES, fit_words, plain_log_ticks, save_with_footer
from steadyslip.maps.view.cut import _quantiles, _with_failures


@pytest.mark.parametrize("ratio", [2.0, 9.0, 1e4])
def test_axes_are_spaced_as_their_grid_is(ratio):
    """Also over less than two decades."""
    for spaced, log in ((np.geomspace, True), (np.linspace, False)):
        values = 3.0 * spaced(1.0, ratio, 7)
        assert is_geometric(values) == log
        assert Scale("slider.stiffness", "Pa/m", values).log == log


def test_samples_without_a_safety_factor_count_as_failures():
    """56 % have none and 41 % are stable: the median is none of the stable ones'."""
    factors = np.concatenate([np.full(56, np.nan), np.linspace(0.5, 0.9, 3), np.linspace(8, 12, 41)])
    numbers, failed = _with_failures(factors, None, "safety_factor")
    assert failed == pytest.approx(0.56)
    assert _quantiles(numbers, 0)[1] == 0
    always = np.isnan(factors)  # the same, if they are stable at every stiffness
    numbers, failed = _with_failures(factors, always, "safety_factor")
    assert failed == 0
    assert _quantiles(numbers, 0)[1] == np.inf


def test_a_settled_run_is_drawn_flat_with_ticks_that_differ():
    """Round-off in the velocity is no change."""
    run = ss.simulate(unit_rig("aging", 0.5, 1.5), ss.protocol.VelocityStep(at=5.0, to=1.0), until=60.0)
    figure = Figure()
    panels = run.plot(ax=figure.subplots(3, 1))
    figure.canvas.draw()
    for panel in panels:
        low, high = panel.get_ylim()
        assert high - low >= 1e-3 * abs(high)
        labels = [tick.get_text() for tick in panel.get_yticklabels() if tick.get_text()]
        assert len(labels) == len(set(labels)) > 1
        assert not panel.yaxis.get_offset_text().get_text()


def test_no_probability_is_rounded_to_certainty():
    assert probability_text(1.0, 4000) == "more than 99.92 %"
    assert probability_text(0.99975, 4000) == "99.975 %"
    assert format_percent(0.0001) == "0.01 %"
    assert format_percent(1e-9) != "0 %"


def test_a_dollar_in_a_name_is_a_dollar(tmp_path):
    """Names of files are text, not formulas: with one dollar Matplotlib would fail, with two it would set italics."""
    source = lab.record(lab.rig(), lab.STEP, 0)
    for name in ("5$.txt", "a$b_{1}$.txt"):
        record = replace(source, source=name)
        axes = np.ravel(record.plot())
        axes[0].figure.savefig(tmp_path / "record.png")
        title = axes[0].title
        assert name.partition(".")[0] in title.get_text()
        assert not title.get_parse_math()
        plt.close(axes[0].figure)


def lightness(colour: str) -> float:
    """Lightness L* (0 to 100, CIE 1976) of a colour such as ``#D55E00``, that of its grey."""
    shares = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in shares]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return 116 * luminance ** (1 / 3) - 16 if luminance > (6 / 29) ** 3 else luminance * (29 / 3) ** 3


@pytest.mark.parametrize("theme", [palette.LIGHT, palette.DARK])
def test_areas_differ_in_grey(theme):
    """A quarter of the lightness scale between any two of these, so that a print in grey tells them apart."""
    light = {name: lightness(theme[name]) for name in ("stable", "unstable", "blow-up")}
    assert abs(light["stable"] - light["unstable"]) >= 25
    assert abs(light["blow-up"] - light["unstable"]) >= 25
    if theme is palette.LIGHT:
        assert abs(light["blow-up"] - light["stable"]) >= 25


def test_edges_of_different_kinds_look_different():
    styles = [str(style["linestyle"]) for style in EDGES.values()]
    assert len(set(styles)) == len(styles)


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_saved_figure_says_what_it_shows(tmp_path, ending):
    """The rig, the version and the date stand in it, in its own fonts; a figure for a journal is 85 mm wide."""
    run = ss.simulate(unit_rig("aging", 0.5, 1.5), until=1.0)
    with figures.journal():
        axes = run.plot()
        save_with_footer(axes, str(tmp_path / f"run.{ending}"), run)
    figure = axes[0].figure
    (footer,) = figure.texts
    assert "stiffness\xa0k" in footer.get_text()
    assert f"steadyslip\xa0{ss.__version__}" in footer.get_text()
    assert re.search(r"\d{4}-\d\d-\d\d$", footer.get_text())
    assert figure.get_figwidth() == pytest.approx(85 / 25.4)
    figure.canvas.draw()
    box = footer.get_window_extent()
    assert box.x1 <= figure.bbox.x1
    assert box.y1 <= min(ax.get_tightbbox().y0 for ax in axes) + 1
    if ending == "pdf":
        assert b"/FontFile2" in (tmp_path / "run.pdf").read_bytes()
    if ending == "svg":
        assert "<text" not in (tmp_path / "run.svg").read_text(encoding="utf-8")
    plt.close(figure)


def _of_column(kind):
    """A figure of some kind as a column of a journal has it, and the result that it is of."""
    if kind == "machine verdict":
        found = ss.analyze(ss.read_rig("examples/machines/feed-axis.toml"))
        return figures.machine_verdict(found), found
    if kind == "hunting":
        held = ss.hunt(ss.read_rig("examples/hunting-axis.toml"))
        return hunting(held), held
    rig = ss.read_rig("examples/triaxial.toml" if kind == "chart" else "examples/double-direct-shear.toml")
    if kind == "chart":
        return figures.stability_chart(rig, "friction.b", "axial_stiffness", points=21), ss.analyze(rig)
    if kind == "locus":
        return figures.root_locus(rig), ss.analyze(rig)
    rig = ss.read_rig("examples/inclined-spring.toml")
    if kind == "mass":
        return figures.critical_stiffness_against_mass(rig), ss.analyze(rig)
    if kind == "lock-up":
        return figures.stability_chart(rig, "contact.angle", "stiffness", points=41), ss.analyze(rig)
    if kind == "verdicts":
        rig = ss.read_rig("examples/stick-slip.toml")
        frozen = ss.frozen_verdicts(rig, ss.read_protocol("examples/stick-slip.toml"))
        return frozen.plot(), frozen
    if kind == "modes":
        machine = ss.read_rig("examples/machines/brake-pad.toml")
        chart = ss.linear.mode_chart(machine, "contacts.disc.friction.mu_ref")
        return chart.plot(), chart
    if kind == "response":
        found = ss.response(rig.with_values({"stiffness": 4e10}), [1.0, 10.0, 100.0])
        return found.plot(), found
    within = ss.tolerate(rig, {"friction.a": "10 %", "friction.b": "10 %"})
    return figures.tolerances(within), within


COLUMN = [
    "machine verdict",
    "hunting",
    "chart",
    "locus",
    "mass",
    "tolerances",
    "lock-up",
    "verdicts",
    "modes",
    "response",
]
NAMED = {"verdicts": "no steady sliding", "modes": "this machine", "response": "resonance"}


@pytest.mark.parametrize("kind", COLUMN)
def test_a_column_of_a_journal_holds_all_words(tmp_path, kind):
    """Nothing is cut at the edge of a saved figure of 85 mm, numbers of an axis do not touch, and axes keep room."""
    with figures.journal():
        axes, found = _of_column(kind)
        save_with_footer(axes, str(tmp_path / "figure.png"), found)
    figure = np.ravel(axes)[0].figure
    assert figure.get_figwidth() == pytest.approx(85 / 25.4)
    figure.draw_without_rendering()
    assert not re.search(r"\d [a-zA-Zµ]", figure.texts[-1].get_text().partition("steadyslip")[0])  # 10 s
    legends = [text.get_text() for ax in np.ravel(axes) if (known := ax.get_legend()) for text in known.get_texts()]
    assert NAMED.get(kind, "") in " ".join(legends)
    for ax in np.ravel(axes):
        frame = ax.get_window_extent()
        for text in (one for one in ax.texts if one.get_gid() == AREA_WORD and one.get_visible()):
            box = text.get_window_extent()
            assert frame.x0 - 1 <= box.x0 < box.x1 <= frame.x1 + 1
            assert frame.y0 - 1 <= box.y0 < box.y1 <= frame.y1 + 1  # pixels, as letters have whole sizes
        assert ax.get_window_extent().width > 0.25 * figure.bbox.width
        numbers = [one.get_window_extent() for one in ax.get_xticklabels() if one.get_text()]
        assert not any(a.x1 > b.x0 > a.x0 for a, b in pairwise(numbers))
        box = ax.get_tightbbox()
        assert min(box.x0, box.y0) > -1
        assert box.x1 < figure.bbox.x1 + 1
        assert box.y1 < figure.bbox.y1 + 1
    plt.close(figure)


def test_words_of_a_report_fit_their_axes():
    """Numbers of a narrow axis do not touch, and the name of a low panel is no longer than it."""
    rigs = [ss.read_rig(f"examples/{name}.toml") for name in ("strengthening-gouge", "inclined-spring")]
    run = ss.simulate(rigs[1], ss.protocol.VelocityStep(at=1.0, to=1.1e-6), until=9.0)
    with figures.journal():
        axes = [figures.root_locus(rigs[0]), *figures.history(run)]
        axes[1:1] = figures.machine_verdict(ss.analyze(ss.read_rig("examples/machines/two-surfaces.toml")))
        for figure in {one.figure for one in axes}:
            fit_words(figure)
            figure.draw_without_rendering()
        for one in axes:
            boxes = [text.get_window_extent() for text in one.get_xticklabels() if text.get_text()]
            assert all(a.x1 < b.x0 for a, b in pairwise(boxes)), one.get_xlabel()
    long = [one.yaxis.label for one in axes if "normal stress" in one.get_ylabel()]
    assert [label.get_text() for label in long] == ["normal stress\n(MPa)"]
    assert long[0].get_window_extent().height <= axes[-1].get_window_extent().height


def test_steady_sliding_of_a_branch_is_stable_on_one_side_of_its_onset():
    rig = ss.read_rig("examples/inclined-spring.toml", ["radiation_damping=1 GPa s/m"])
    branch = ss.cycles(rig)
    ax = figures.cycle_branch(branch)
    lines = {one.get_label(): one.get_xdata() for one in ax.lines if "steady sliding" in one.get_label()}
    onset = branch.onset.value / 1e9
    assert max(lines["steady sliding, unstable"]) == pytest.approx(onset)
    assert min(lines["steady sliding, stable"]) == pytest.approx(onset)
    assert not any("um/s" in one.get_text() for one in ax.get_legend().get_texts())
    plt.close(ax.figure)


@pytest.mark.parametrize(("height", "seen"), [(1.6, True), (1.2, True), (0.5, False)])
def test_words_of_areas_stay_inside_low_axes(height, seen):
    """The upright "no steady sliding" ran through the lower axis of a map 85 mm wide."""
    figure = plt.figure(figsize=(3, height))
    ax = figure.add_axes((0.1, 0.05, 0.8, 0.9))
    text = ax.text(0.1, 0.2, "no steady sliding", rotation=90, ha="center", va="center", gid=AREA_WORD)
    fit_words(figure)
    figure.draw_without_rendering()
    frame, box = ax.get_window_extent(), text.get_window_extent()
    assert text.get_visible() == seen
    if seen:
        assert frame.y0 - 1 <= box.y0 < box.y1 <= frame.y1 + 1  # pixels, as letters have whole sizes
    plt.close(figure)


@pytest.mark.parametrize(("high", "numbers"), [(30.0, {"1", "2", "5", "10", "20"}), (2e3, {1.0, 10.0, 100.0, 1000.0})])
def test_upright_axes_of_few_decades_are_numbered(high, numbers):
    figure, ax = plt.subplots(figsize=(3, 1.2))
    ax.set_yscale("log")
    ax.set_ylim(0.9, high)
    if high < 100:
        plain_log_ticks(ax.yaxis)
    fit_words(figure)
    figure.draw_without_rendering()
    inside = [one for one in ax.yaxis.get_major_ticks() if 0.9 <= one.get_loc() <= high]
    assert {one.label1.get_text() if high < 100 else one.get_loc() for one in inside} == numbers
    plt.close(figure)
