"""Figures of experiments: what they draw is what was measured and found, and regions hold what they say."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.path import Path

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.numerics.noise import autocorrelation, lag_one
from steadyslip.figures.experiments import fits
from steadyslip.figures.experiments.corners import density_level


@pytest.fixture(scope="module")
def record():
    return lab.record(lab.rig(alpha=0.35), lab.PRESSED)


@pytest.fixture(scope="module")
def fit(record):
    return ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), record)


def test_a_record_with_its_commanded_loading(record):
    panels = ss.figures.record(record, Figure().subplots(3, 1))
    np.testing.assert_array_equal(panels[0].lines[0].get_ydata(), record.friction)
    assert [p.get_ylabel() for p in panels] == ["friction τ/σ (1)", "load-point\nrate (µm/s)", "normal\nstress (MPa)"]
    assert len(panels[0].lines) == 1 + len(record.steps)
    for panel, unit, course in ((panels[1], 1e-6, record.loading.load), (panels[2], 1e6, record.loading.stress)):
        seen = np.interp(panel.lines[0].get_xdata(), *panel.lines[1].get_data())
        np.testing.assert_allclose(seen, course.at(record.time) / unit)
    assert panels[2].get_xlabel() == ("time after step (s)" if len(record.steps) == 1 else "time after first step (s)")
    with pytest.raises(ss.ParameterError, match="sequence of 3"):
        ss.figures.record(record, Figure().subplots(2, 1))


def test_a_long_name_and_few_samples_leave_a_readable_picture(record):
    """The name keeps both its ends, the commanded rate its corner between samples, and dots can be seen."""
    few = replace(record.decimated(50), source="sample_" + 80 * "x" + "_run_7.csv")
    panels = few.plot()
    title = panels[0].get_title()
    assert len(title) <= 60
    assert title.startswith("sample_")
    assert title.endswith("_run_7.csv")
    dots, commanded = panels[1].lines[:2]
    assert dots.get_markersize() > 3
    x, y = commanded.get_data()
    corner = int(np.argmax(np.diff(y)))
    assert x[corner : corner + 2] == pytest.approx(0.0, abs=1e-6)
    assert sorted(y[corner : corner + 2]) == pytest.approx([np.min(y), np.max(y)])


def test_steps_that_are_not_drawn_are_counted(fit, monkeypatch):
    monkeypatch.setattr(fits, "MAX_STEPS", 1)
    assert fit.plot("steps")[0, 0].get_xlabel().endswith("1 further step is not drawn")


def test_a_fit_with_its_residuals_and_their_memory(fit):
    _, stress, *panels = ss.figures.fit(fit, Figure().subplots(5, 1))
    loading = fit.plan.records[0].loading
    seen = np.interp(stress.lines[0].get_xdata(), *stress.lines[1].get_data())
    np.testing.assert_allclose(seen, 1e-6 * loading.stress.at(fit.plan.records[0].time))
    assert len(ss.figures.fit(lab.stepped(), Figure().subplots(4, 1))) == 4  # nothing presses there
    np.testing.assert_array_equal(panels[0].lines[1].get_ydata(), fit.model)
    np.testing.assert_allclose(panels[1].lines[0].get_ydata(), 1e3 * fit.residuals)
    heights = [bar.get_height() for bar in panels[2].patches[: len(panels[2].lines[0].get_xdata())]]
    assert heights[0] == 1.0
    assert heights[1] == pytest.approx(lag_one(fit.residuals))


def test_autocorrelation_is_that_of_numpy():
    values = np.random.default_rng(1).standard_normal(300)
    r = values - values.mean()
    full = np.correlate(r, r, "full")[len(r) - 1 :]
    np.testing.assert_allclose(autocorrelation(values, 20), full[:21] / full[0], atol=1e-14)
    np.testing.assert_array_equal(autocorrelation(np.ones(9), 3), np.zeros(4))


def test_every_step_has_a_panel(fit, record):
    rows = -(-len(record.steps) // 3)
    panels = ss.figures.steps(fit, Figure().subplots(rows, min(3, len(record.steps)), squeeze=False))
    shown = [panel for panel in panels.flat if panel.get_visible()]
    assert len(shown) == len(record.steps)
    for panel, step in zip(shown, record.steps, strict=True):
        low, high = panel.lines[0].get_xdata()[[0, -1]]
        assert low < 0 < high
        assert panel.get_title() in str(step).replace("um", "µm")
    still = ss.record_from_arrays(np.arange(100.0), friction=np.full(100, 0.6), normal=1e7)
    with pytest.raises(ss.NotAvailable, match="no steps were found"):
        ss.figures.steps(type("Planned", (), {"plan": type("P", (), {"records": (still,)})})())


def test_the_ellipses_of_a_fit_hold_68_and_95_percent(fit):
    count = len(fit.names)
    panels = ss.figures.corner(fit, Figure(figsize=(9, 9)).subplots(count, count))
    assert panels[-1, 0].get_xlabel() == "a (1)"
    labels = [panel.get_xlabel().partition(" (")[0] for panel in panels[-1]]
    assert {"b", r"$d_{\mathrm{c}}$"} <= set(labels), "letters, as in all else"
    assert not any("_ref" in label for label in labels)
    assert not panels[0, -1].get_visible()
    draws = ss.experiments.normal_draws(fit, 20_000)
    points = np.column_stack([draws["friction.a"], draws["friction.b"]])
    for line, share in zip(panels[1, 0].lines[:2], (0.68, 0.95), strict=True):
        inside = Path(np.column_stack(line.get_data())).contains_points(points)
        assert np.mean(inside) == pytest.approx(share, abs=0.012)


def test_the_contours_of_draws_hold_68_and_95_percent(fit):
    draws = ss.experiments.normal_draws(fit, 4000)
    count = len(fit.names)
    panels = ss.figures.corner(draws, Figure(figsize=(9, 9)).subplots(count, count))
    (found,) = [item for item in panels[1, 0].collections if isinstance(item, ContourSet)]
    points = np.column_stack([draws["friction.a"], draws["friction.b"]])
    for path, share in zip(found.get_paths(), (0.95, 0.68), strict=True):
        assert np.mean(path.contains_points(points)) == pytest.approx(share, abs=0.06)


def test_a_region_holds_its_share():
    x = np.linspace(-5, 5, 401)
    density = np.exp(-0.5 * (x[:, None] ** 2 + x**2))
    for share in (0.5, 0.68, 0.95):  # of the normal distribution of two: exp(-r²/2) at the radius that holds the share
        assert density_level(density, share) == pytest.approx(1 - share, rel=0.01)


def test_a_profile_crosses_its_levels_where_the_intervals_end(fit):
    found = ss.experiments.profile(fit, "d_c", count=17)
    ax = found.plot(Figure().subplots())
    ends = sorted(line.get_xdata()[0] for line in ax.lines if len(set(line.get_xdata())) == 1)
    expected = sorted(1e6 * np.array([*found.interval(0.68), *found.interval(0.95)]))
    np.testing.assert_allclose(ends, expected)
    parabola = next(line for line in ax.lines if line.get_label() == "its error alone")
    np.testing.assert_allclose(parabola.get_ydata()[0], 16.0)  # four standard deviations from the best value
    assert ax.get_title() == "likelihood: " + ("Gaussian" if found.gaussian else "not Gaussian")
    short = replace(found, rise=np.minimum(found.rise, 3.0))
    assert short.plot(Figure().subplots()).get_title().endswith("; the profile ends before 95 %")
    assert ax.get_xlabel() == r"$d_{\mathrm{c}}$ (µm)"


def test_laws_and_experiments_as_bars():
    found = ss.compare_laws(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300), ("slip", "aging"))
    ax = found.plot(Figure().subplots())
    assert [label.get_text() for label in ax.get_yticklabels()] == list(found.fits)[::-1]
    assert min(bar.get_width() for bar in ax.patches) == 0.0
    rig = lab.rig(alpha=0.35)
    ranked = ss.experiments.best_protocol(rig, fixed=["slider.stiffness"], samples=200)
    drawn = ranked.plot(Figure().subplots())
    known = [one.errors[ranked.parameter] for one in ranked.found.values()]
    widths = sorted(bar.get_width() for bar in drawn.patches)
    np.testing.assert_allclose(widths, sorted(error for error in known if np.isfinite(error)))
    words = [text.get_text() for text in drawn.texts]
    assert words.count("not determined") == sum(not np.isfinite(error) for error in known)


def test_a_prediction_is_in_the_unit_of_its_axis(fit):
    drawn = ss.figures.prediction(ss.predict(lab.rig(alpha=0.35), fit), Figure().subplots())
    assert drawn.get_xlabel() == "stiffness (GPa/m)"
    told = [text.get_text() for text in drawn.get_legend().get_texts()]
    (far,) = (words for words in told if words.startswith("this rig"))
    assert far == "this rig: 20 GPa/m, beyond this axis"  # seven times what all draws give to within a hundredth
    assert drawn.get_xlim()[1] < 10


def test_shares_of_kicks_sum_to_all_draws(fit):
    found = ss.predict(lab.rig(alpha=0.35), fit, count=200)
    sizes = np.concatenate([np.linspace(1.0, 2.0, 100), np.full(50, np.inf), np.zeros(30), np.full(20, np.nan)])
    kicked = replace(found, thresholds={"velocity": sizes, "normal-stress": np.full(200, 0.1)})
    panels = kicked.plot("kicks", [Figure().subplots(), Figure().subplots()])
    title = " ".join(panels[0].get_title().split())
    shares = [float(part.split()[-1]) for part in title.split("%")[:-1]]
    assert len(shares) == 4
    assert sum(shares) == pytest.approx(100)
    assert panels[1].get_title() == "fails at a kick: all 200 draws"
    assert panels[0].get_xlabel() == "velocity kick that is survived, ln(new/old velocity) (1)"
    assert panels[1].get_xlabel() == "normal-stress kick that is survived, share of the steady one (1)"
    assert "ln(new/old velocity)" in str(kicked)
    with pytest.raises(ss.NotAvailable, match="kick="):
        found.plot("kicks")


def test_regions_end_where_the_search_did(fit):
    """A step lies between two samples; its region was drawn beyond them."""
    place = next(i for i, name in enumerate(fit.names) if name.startswith("step."))
    low = np.where(np.arange(len(fit.names)) == place, fit.coordinates, fit.bounds[0])
    panels = replace(fit, bounds=(low, fit.bounds[1])).plot("corner")
    said = [text.get_text() for text in panels[0, 0].get_legend().get_texts()]
    assert said == ["holds 68 %", "holds 95 %", "best fit"]
    for line in panels[place, 0].lines[:2]:
        assert np.min(line.get_ydata()) == pytest.approx(0.0, abs=1e-9)
        assert np.max(line.get_ydata()) > 0
    (area,) = panels[place, place].collections
    assert np.min(area.get_paths()[0].vertices[:, 0]) >= -1e-9


def test_noise_does_not_make_an_axis_logarithmic():
    """What is left of noise on such an axis lies above the commanded rate."""
    rng, time = np.random.default_rng(1), np.linspace(0.0, 100.0, 2001)
    moved = 1e-7 * time + 1.9e-6 * np.maximum(time - 50, 0)
    for noise, scale in ((2e-8, "linear"), (0.0, "log")):
        record = ss.record_from_arrays(
            time, friction=0.6 + 1e-3 * rng.standard_normal(2001), normal=1e7,
            displacement=moved + noise * rng.standard_normal(2001),
        )  # fmt: skip
        assert ss.figures.record(record, Figure().subplots(3, 1))[1].get_yscale() == scale


def test_a_corner_of_many_parameters_takes_two_columns_of_a_journal(fit):
    """In one no name would fit below its panel; numbers and names stay inside their panels' width."""
    with ss.figures.journal():
        panels = fit.plot("corner")
    figure = panels[0, 0].get_figure()
    assert figure.get_figwidth() == pytest.approx(180 / 25.4)
    figure.draw_without_rendering()
    boxes = [panel.xaxis.label.get_window_extent() for panel in panels[-1]]
    assert not any(one.x1 > other.x0 for one, other in pairwise(boxes))


def test_no_axis_of_a_corner_hides_part_of_its_numbers(fit):
    panels = fit.plot("corner")
    panels[0, 0].get_figure().draw_without_rendering()
    for panel in panels.ravel():
        assert "+" not in panel.xaxis.get_offset_text().get_text()
