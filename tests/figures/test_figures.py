"""Figures, read back from their Axes: curves, regions, markers, labels, on ordinary and on odd rigs."""

import itertools
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.path import Path

import steadyslip as ss
from chart_areas import contains, inside, region
from steadyslip import figures
from steadyslip.figures import paper_figure_7
from steadyslip.figures.axis import chart_axis
from steadyslip.figures.style import display_unit, unmanaged_axes
from steadyslip.reproduce import paper_rig
from steadyslip.units import GPa, MPa, deg, m, s, um

matplotlib.use("Agg")

PAPER = {"a": 0.0145, "b": 0.0160, "mu_ss": 0.7, "alpha": 0.56}
ANGLES = np.array([-45, -30, 0, 30, 45]) * deg

STATES = (ss.laws.State(b=0.0145, d_c=1 * um), ss.laws.State(b=0.01218, d_c=20 * um))
TWO_STATES = ss.laws.RateState(a=0.0145, states=STATES, mu_ref=0.7, v_ref=1 * um / s)


def rig_with(friction=None, contact=None, **slider):
    base = paper_rig()
    return replace(base, friction=friction or base.friction, contact=contact or base.contact, **slider)


STRENGTHENING = paper_rig().with_values({"friction.b": 0.01})
PRAKASH_CLIFTON = replace(paper_rig().friction, normal_memory=ss.laws.PrakashClifton())
LUGRE = ss.Slider(
    friction=ss.laws.LuGre(
        bristle_stiffness=1e5, bristle_damping=10.0, mu_coulomb=0.1, mu_static=0.15, v_stribeck=1e-3
    ),
    contact=ss.laws.ConstantNormalStress(preload=1 * MPa),
    stiffness=1e9,
    mass=100.0,
    drive=ss.machine.SteadyDrive(1e-3),
)
CONTROLLED = replace(paper_rig(0.0), stiffness=None, drive=ss.machine.PID(1 * um / s, kp=20e9, kd=0.0, ki=1e8))
PRESS = replace(
    paper_rig(),
    contact=ss.laws.Triaxial(angle=30 * deg, confining_pressure=5 * MPa),
    stiffness=None,
    axial_stiffness=90e9,
)
ODD = {
    "locked-up": paper_rig(-60 * deg),
    "strengthening": STRENGTHENING,
    "two-states": rig_with(TWO_STATES),
    "lugre": LUGRE,
    "controlled": CONTROLLED,
    "axial": PRESS,
    "heavy": paper_rig(30 * deg).with_values({"slider.mass": 1e11}),
}


def labelled(artists, label):
    found = [a for a in artists if a.get_label() == label]
    assert len(found) == 1, (label, [a.get_label() for a in artists])
    return found[0]


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


# --- critical stiffness against mass ----------------------------------------------------------------


@pytest.fixture(scope="module")
def figure_7():
    return figures.critical_stiffness_against_mass(paper_rig(), ax=unmanaged_axes())


def test_curves_are_the_papers_closed_form(figure_7):
    for angle in ANGLES:
        line = labelled(figure_7.lines, f"ψ = {angle / deg:.0f}°".replace("-", "−"))
        m_star, kappa = line.get_data()
        expected = ss.paper.inclined_dimensionless_stiffness(**PAPER, angle=angle, m_star=m_star)
        # a few roundings, magnified near the asymptote where the denominator cancels
        with np.errstate(divide="ignore"):
            cancellation = 1 + np.abs(np.tan(angle)) * m_star * PAPER["alpha"] * expected / (0.0015 * (0.0145 + m_star))
        stable = expected > 0
        assert np.array_equal(np.isnan(kappa), ~stable)
        assert np.all(np.abs(kappa / expected - 1)[stable] < 32 * np.finfo(float).eps * cancellation[stable])


def test_the_two_special_masses_are_marked(figure_7):
    crossing = labelled(figure_7.lines, "_m*_cr1")
    expected = ss.paper.mass_of_equal_stiffness(a=0.0145, mu_ss=0.7, alpha=0.56)
    assert crossing.get_xdata()[0] == pytest.approx(expected, rel=1e-12, abs=0)
    kappa = ss.paper.inclined_dimensionless_stiffness(**PAPER, angle=0.0, m_star=expected)
    assert crossing.get_ydata()[0] == pytest.approx(kappa, rel=1e-12, abs=0)
    limits = sorted(line.get_xdata()[0] for line in figure_7.lines if line.get_label() == "_m*_cr2")
    wanted = [ss.paper.mass_of_no_stiffness(a=0.0145, mu_ss=0.7, alpha=0.56, angle=a * deg) for a in (45, 30)]
    assert limits == pytest.approx(wanted, rel=1e-12, abs=0)


def test_the_axes_are_named_with_units_and_lock_up_is_noted(figure_7):
    assert figure_7.get_xlabel().endswith("(1)")
    assert figure_7.get_ylabel().endswith("(1)")
    assert "−55.008°" in figure_7.get_legend().get_title().get_text()


def test_a_locked_up_angle_is_in_the_legend_only():
    ax = figures.critical_stiffness_against_mass(paper_rig(), [-60 * deg, 10 * deg], ax=unmanaged_axes())
    assert "ψ = −60°: locked up" in legend_texts(ax)
    assert labelled(ax.lines, "ψ = −60°: locked up").get_xdata().size == 0


def test_only_locked_up_angles_still_draw():
    ax = figures.critical_stiffness_against_mass(paper_rig(), [-60 * deg], ax=unmanaged_axes())
    assert legend_texts(ax) == ["ψ = −60°: locked up"]


def test_the_preload_or_the_steady_stress_give_the_same_curves():
    given = rig_with(contact=ss.laws.InclinedSpring(steady_normal_stress=7 * MPa, angle=0.0))
    m_star = np.geomspace(1e-4, 1e-2, 5)
    curves = [paper_figure_7.dimensionless_critical_stiffness(rig, -0.5, m_star) for rig in (paper_rig(), given)]
    np.testing.assert_allclose(*curves, rtol=32 * np.finfo(float).eps)


def test_rigs_with_other_friction_have_the_figure_too():
    for rig in (STRENGTHENING, rig_with(TWO_STATES), rig_with(PRAKASH_CLIFTON)):
        ax = figures.critical_stiffness_against_mass(rig, m_star=np.geomspace(1e-4, 1e-1, 9), ax=unmanaged_axes())
        assert len(legend_texts(ax)) == len(ANGLES)
    strengthening = paper_figure_7.dimensionless_critical_stiffness(STRENGTHENING, 0.0, 1e-3)
    assert np.isnan(strengthening)


def test_rigs_without_such_a_figure_are_told_why():
    with pytest.raises(ss.NotAvailable, match="inclined-spring"):
        figures.critical_stiffness_against_mass(rig_with(contact=ss.laws.ConstantNormalStress(preload=5 * MPa)))
    no_distance = replace(LUGRE, contact=ss.laws.InclinedSpring(preload=1 * MPa, angle=0.1))
    with pytest.raises(ss.NotAvailable, match="slip distance"):
        figures.critical_stiffness_against_mass(no_distance)
    for bad in ([0.0, 1.0], [1.0], [np.nan, 1.0]):
        with pytest.raises(ss.ParameterError, match="m_star"):
            figures.critical_stiffness_against_mass(paper_rig(), m_star=bad)
    with pytest.raises(ss.ParameterError, match=r"contact\.angle"):
        figures.critical_stiffness_against_mass(paper_rig(), [2.0])


# --- stability chart --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chart():
    ranges = {"x_range": ("-70 deg", "60 deg"), "y_range": (0, 40 * GPa / m)}
    return figures.stability_chart(paper_rig(), "angle", "stiffness", unmanaged_axes(), **ranges)


def test_the_regions_are_where_the_growth_rate_says(chart):
    for angle, k in itertools.product(np.linspace(-68, 58, 10), np.linspace(1, 39, 9)):
        growth = ss.growth_rate(paper_rig(), {"angle": angle * deg, "stiffness": k * GPa})
        inside = [name for name in ("stable", "unstable", "no steady") if contains(chart, name, angle, k)]
        inside = ["no steady"] if "no steady" in inside else inside  # painted last, over the others
        assert inside == ["no steady" if np.isnan(growth) else "stable" if growth < 0 else "unstable"]


def test_the_edge_is_the_critical_stiffness_and_not_a_staircase(chart):
    x, y = labelled(chart.lines, "edge of stability: oscillation").get_data()
    drawn = np.isfinite(x)
    assert drawn.sum() > 50
    expected = ss.critical_stiffness(paper_rig(), {"angle": x[drawn] * deg}) / GPa
    slope = np.gradient(expected, x[drawn])
    # 40 halvings of a grid cell; where the edge was met along x, its slope turns the error into one of y
    assert np.all(np.abs(y[drawn] - expected) <= 1e-10 * (1 + np.abs(slope) * 130 + 40))


def test_the_lock_up_edge_is_eq_27(chart):
    x, _ = labelled(chart.lines, "edge: lock-up").get_data()
    assert x[np.isfinite(x)] == pytest.approx(ss.paper.lock_up_angle(0.7) / deg, abs=1e-9)
    assert any("lock-up" in text for text in legend_texts(chart))


def test_the_rig_is_marked_and_the_axes_are_named_with_units(chart):
    own = labelled(chart.lines, "this rig")
    assert own.get_xydata()[0] == pytest.approx([-45, 9])
    assert chart.get_xlabel() == "angle ψ (deg)"
    assert chart.get_ylabel() == "stiffness k (GPa/m)"
    assert (chart.get_xscale(), chart.get_yscale()) == ("linear", "linear")
    assert chart.get_xlim() == pytest.approx((-70, 60))


def test_wide_positive_ranges_are_logarithmic_and_keep_the_edge_in_view():
    ax = figures.stability_chart(paper_rig(), "a", "stiffness", unmanaged_axes(), points=41)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    low, high = ax.get_ylim()
    assert low < ss.critical_stiffness(paper_rig()) / GPa < high
    assert low < 9 < high
    assert ax.get_xlabel() == "direct effect a (1)"


def test_a_point_outside_the_chart_is_not_marked():
    ax = figures.stability_chart(paper_rig(), "angle", "stiffness", unmanaged_axes(), (0, 0.5), points=11)
    assert "this rig" not in legend_texts(ax)


def test_lift_off_is_told_from_lock_up():
    contact = ss.laws.Lift(preload=1 * MPa, lift=1e11, v_ref=1 * um / s)
    ax = figures.stability_chart(
        rig_with(contact=contact),
        "lift",
        "drive.velocity",
        unmanaged_axes(),
        (0, 1e12),
        ("1 um/s", "10 um/s"),
        points=41,
    )
    assert region(ax, "no steady").get_label() == "no steady sliding (lift-off)"
    # σ = 1 MPa − l (v − 1 um/s) vanishes at v = 3 um/s for l = 500 GPa s/m
    assert contains(ax, "no steady", 500, 3.01)
    assert not contains(ax, "no steady", 500, 2.99)


def test_islands_and_holes_are_filled_as_such():
    """The filled outlines of a ring: the hole is not part of it."""
    from steadyslip.figures.regions import on_grid, region_path

    def ring(x, y):
        return np.abs(np.hypot(x - 0.5, y - 0.5) - 0.3) < 0.1

    path = region_path(ring, on_grid(ring, 60))
    assert inside(path, 0.8, 0.5)
    assert not inside(path, 0.5, 0.5)
    assert not inside(path, 0.95, 0.95)
    assert np.count_nonzero(path.codes == Path.MOVETO) == 2
    assert path.vertices[:, 0].max() == pytest.approx(0.9, abs=1e-3)


@pytest.mark.parametrize("name", ODD)
def test_every_rig_has_a_chart(name):
    rig = ODD[name]
    y = "slider.axial_stiffness" if rig.axial_stiffness else "drive.kp" if rig.stiffness is None else "slider.stiffness"
    ax = figures.stability_chart(rig, "drive.velocity", y, unmanaged_axes(), points=15)
    assert ax.patches
    assert ax.get_xlabel().startswith("drive velocity v₀ (")
    assert ax.get_xlabel().endswith("m/s)")
    if name != "heavy":
        assert "this rig" in legend_texts(ax)


def test_a_strengthening_rig_is_stable_everywhere():
    ax = figures.stability_chart(STRENGTHENING, "stiffness", "friction.d_c", unmanaged_axes(), points=9)
    assert region(ax, "stable") is not None
    assert region(ax, "unstable") is None


@pytest.mark.parametrize(
    ("x", "y", "options", "message"),
    [
        ("angle", "angle", {}, "both axes"),
        ("angle", "stiffness", {"points": 1}, "points"),
        ("angle", "stiffness", {"x_range": (1.0, 0.5)}, "low < high"),
        ("angle", "stiffness", {"x_range": "wide"}, "two values"),
        ("angle", "stiffness", {"y_range": ("1 MPa", "2 MPa")}, "wrong dimension"),
        ("angle", "stiffness", {"x_range": (0, 2)}, "-90 deg"),
        ("angle", "axial_stiffness", {}, "does not have it"),
    ],
)
def test_what_a_chart_cannot_show_is_said(x, y, options, message):
    with pytest.raises(ss.ParameterError, match=message):
        figures.stability_chart(paper_rig(), x, y, unmanaged_axes(), **options)


def test_unknown_names_and_missing_scales_are_said():
    with pytest.raises(ss.UnknownNameError, match=r"contact\.angle"):
        figures.stability_chart(paper_rig(), "contact.angel", "stiffness")
    with pytest.raises(ss.NotAvailable, match="no default range; give one"):
        figures.stability_chart(STRENGTHENING, "slider.mass", "stiffness")


def test_a_far_edge_leaves_the_rig_in_the_middle_of_its_range():
    """The edge of this gain is 30 times away: it stays in view, and the rig stays near the middle of the axis."""
    rig = ss.read_rig("examples/slow-axis.toml")
    axis, own = chart_axis(rig, "drive.kd", None), rig.value("drive.kd")
    assert axis.low < own < max(ss.boundary(rig, "drive.kd")).value < axis.high
    assert 0.4 < np.log(own / axis.low) / np.log(axis.high / axis.low) < 0.6


def test_default_ranges_suit_the_parameter():
    rig = paper_rig()
    angle = chart_axis(rig, "angle", None)
    assert (angle.low / deg, angle.high / deg) == pytest.approx((-80, 80))
    b = chart_axis(rig, "b", None)
    edge = ss.boundary(rig, "b")[-1].value
    assert b.low < min(edge, 0.016)
    assert b.high > max(edge, 0.016)
    heavy = paper_rig(0.0).with_values({"slider.stiffness": 10 * GPa})
    mass_axis = chart_axis(heavy, "slider.mass", None)
    assert (mass_axis.low, mass_axis.log) == (0.0, False)
    assert mass_axis.high > ss.boundary(heavy, "slider.mass")[0].value


def test_units_on_axes_are_those_people_read():
    assert display_unit("Pa/m", 9e9) == (1e9, "GPa/m")
    assert display_unit("m/s", 1e-6) == (1e-6, "µm/s")
    assert display_unit("rad", 1.0) == (deg, "deg")
    assert display_unit("kg/m^2", 1.0) == (1.0, "kg/m²")
    assert display_unit("1", 0.7) == (1.0, "")


# --- root locus -------------------------------------------------------------------------------------


def test_the_locus_shows_the_eigenvalues_of_every_stiffness():
    rig = paper_rig()
    k = np.geomspace(1e9, 1e12, 50)
    ax = figures.root_locus(rig, unmanaged_axes(), k)
    points = labelled(ax.collections, "_k")
    drawn = points.get_offsets() @ np.array([1, 1j])
    expected = ss.eigenvalues(rig, {"stiffness": k}).ravel()
    np.testing.assert_array_equal(np.asarray(drawn), expected[np.isfinite(expected)])
    np.testing.assert_allclose(np.unique(points.get_array()), k / GPa)
    bar = ax.figure.axes[1]
    assert bar.get_ylabel() == "stiffness k (GPa/m)"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("growth rate Re s (1/s)", "angular frequency Im s (rad/s)")


def test_the_crossing_is_at_eq_26_and_the_rig_at_its_own_eigenvalues():
    rig = paper_rig()
    ax = figures.root_locus(rig, unmanaged_axes())
    crossing = labelled(ax.lines, "critical stiffness 29.07\xa0GPa/m")
    beta = np.sqrt(ss.paper.inclined_frequency_squared(**PAPER, d_c=1e-6, v0=1e-6, angle=-45 * deg))
    assert np.sort(crossing.get_ydata()) == pytest.approx([-beta, beta], rel=1e-12, abs=0)
    assert crossing.get_xdata() == pytest.approx(0, abs=1e-12)
    own = labelled(ax.lines, "this rig")
    expected = ss.eigenvalues(rig)
    assert own.get_xdata() + 1j * own.get_ydata() == pytest.approx(expected[np.isfinite(expected)])
    assert labelled(ax.lines, "_imaginary axis").get_xdata() == [0, 0]


def test_fast_eigenvalues_out_of_view_are_named():
    ax = figures.root_locus(paper_rig(0.3).with_values({"slider.mass": 1e3}), unmanaged_axes())
    (text,) = [text for text in legend_texts(ax) if "this rig" in text]
    fast = ss.eigenvalues(paper_rig(0.3).with_values({"slider.mass": 1e3})).real.min()
    digits, power = f"{abs(fast):.2e}".split("e")
    assert rf"−{digits}$\times10^{{{int(power)}}}$" in text


@pytest.mark.parametrize("name", [name for name in ODD if name != "locked-up"])
def test_every_sliding_rig_has_a_locus(name):
    ax = figures.root_locus(ODD[name], unmanaged_axes())
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left < 0 < right
    assert bottom == -top
    assert any("this rig" in text for text in legend_texts(ax))
    own = replace(ODD[name], axial_stiffness=None, stiffness=1.0)
    what = "drive proportional gain" if ODD[name] is CONTROLLED else "stiffness"
    ends = (ss.stable_values(own, "kp") if ODD[name] is CONTROLLED else ss.stable_stiffness(own)).ravel()
    edges = [end for end in ends if 0 < end < np.inf]
    marked = [text for text in legend_texts(ax) if text.startswith(f"critical {what}")]
    assert len(marked) <= len(edges)
    assert bool(marked) == bool(edges)


def test_a_locked_up_rig_has_no_locus():
    with pytest.raises(ss.NoSteadySliding, match="lock-up"):
        figures.root_locus(ODD["locked-up"])


def test_a_locus_needs_a_stiffness_to_start_from():
    loose = STRENGTHENING.with_values({"slider.stiffness": 0.0})
    with pytest.raises(ss.NotAvailable, match="pass stiffness"):
        figures.root_locus(loose)
    with pytest.raises(ss.ParameterError, match="> 0"):
        figures.root_locus(paper_rig(), stiffness=[0.0, 1e9])
    ax = figures.root_locus(loose, unmanaged_axes(), np.geomspace(1e8, 1e10, 9))
    assert ax.collections


# --- habits of all figures --------------------------------------------------------------------------


def test_without_axes_a_pyplot_figure_is_made_and_not_shown(monkeypatch):
    from matplotlib import pyplot as plt

    def fail(*_, **__):
        raise AssertionError("a figure must not show itself")

    monkeypatch.setattr(plt, "show", fail)
    before = plt.get_fignums()
    axes = [
        figures.critical_stiffness_against_mass(paper_rig(), m_star=[1e-4, 1e-3]),
        figures.stability_chart(paper_rig(), "angle", "stiffness", points=5),
        figures.root_locus(paper_rig(), stiffness=[1e9, 1e11]),
    ]
    assert len(plt.get_fignums()) == len(before) + 3
    for ax in axes:
        plt.close(ax.figure)


def test_axes_given_are_the_axes_returned():
    ax = unmanaged_axes()
    assert figures.root_locus(paper_rig(), ax) is ax


@pytest.mark.parametrize("draw", ["mass", "chart", "locus"])
def test_no_text_overlaps_another_or_leaves_the_figure(draw):
    ax = unmanaged_axes()
    if draw == "mass":
        figures.critical_stiffness_against_mass(paper_rig(), ax=ax)
    elif draw == "chart":
        figures.stability_chart(paper_rig(), "angle", "stiffness", ax, points=21)
    else:
        figures.root_locus(paper_rig(0.3).with_values({"slider.mass": 1e3}), ax)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(ax.figure)
    canvas.draw()
    texts = [ax.xaxis.label, ax.yaxis.label, *ax.texts, *ax.get_legend().get_texts()]
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in texts]
    for first, second in itertools.combinations(boxes, 2):
        assert not first.overlaps(second)
    width, height = canvas.get_width_height()
    assert all(b.x0 >= 0 and b.y0 >= 0 and b.x1 <= width and b.y1 <= height for b in boxes)


def test_a_legend_is_no_wider_than_its_axes():
    run = ss.simulate(ss.read_rig("examples/stick-slip.toml"), ss.protocol.VelocityStep(at=1.0, to=2e-6), until=60.0)
    with ss.figures.journal():
        axes = ss.figures.history(run)[0]
    axes.figure.draw_without_rendering()
    assert axes.get_window_extent().width > 0.7 * axes.figure.bbox.width
    assert axes.get_legend().get_window_extent().x1 <= axes.figure.bbox.x1


@pytest.mark.parametrize("width", [3.0, 6.3])
@pytest.mark.parametrize("kind", ["slider", "machine"])
def test_the_end_of_a_run_is_told_clear_of_the_legend(kind, width):
    """In a narrow figure the legend has a line for each entry."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    step = ss.protocol.VelocityStep(at=1.0, to=1.1e-6)
    rig = ss.read_rig("examples/triaxial.toml")
    if kind == "machine":
        rig = ss.read_rig("examples/machines/brake-pad.toml")
        step = ss.protocol.VelocityStep(at=1e-4, to=2.0)
    run = ss.simulate(rig, step, until=1000.0 if kind == "slider" else 0.02)
    assert run.status != "done"
    figure = Figure(figsize=(width, 4.0), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels = figures.history(run, figure.subplots(3, sharex=True))
    canvas.draw()
    title = panels[0].title.get_window_extent(canvas.get_renderer())
    for text in panels[0].get_legend().get_texts():
        assert not title.overlaps(text.get_window_extent(canvas.get_renderer()))
