"""Pictures of maps show the numbers of the map, with units, the rig, and the edge where it is."""

import matplotlib.pyplot
import numpy as np
import pytest

import steadyslip as ss
from steadyslip.maps.view.cut import axes_of, take
from steadyslip.nonlinear.onset.hopf import KINDS

matplotlib.use("Agg")


def rig():
    friction = ss.laws.RateState(
        a=0.0145, b=0.016, d_c=1e-6, mu_ref=0.7, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=0.56)
    )
    contact = ss.laws.InclinedSpring(preload=5e6, angle=-np.pi / 4)
    return ss.Slider(friction=friction, contact=contact, stiffness=9e9, drive=ss.machine.SteadyDrive(1e-6))


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    angle, stiffness = ss.maps.Grid("-80 deg", "80 deg", 65), ss.maps.Grid("0.1 GPa/m", "100 GPa/m", 49, "log")

    def made(name, *arguments, **options):
        return ss.run_map(ss.Map(rig(), *arguments, **options), folder / f"{name}.zarr", workers=1)

    return {
        "chart": made("chart", {"angle": angle, "stiffness": stiffness, "friction.b": [0.016, 0.018, 0.02]},
                      ["status", "safety_factor", "growth_rate", "stable_stiffness", "onset", "critical_stiffness"]),
        "samples": made("samples", {"angle": ss.maps.Grid("-50 deg", "50 deg", 11), "stiffness": stiffness},
                        ["status", "critical_stiffness"], samples=ss.maps.Samples({"friction.a": (0.012, 0.0155)}, 64)),
        "points": made("points", compute=["status", "safety_factor"],
                       samples=ss.maps.Samples({"friction.a": (0.01, 0.02), "friction.b": (0.01, 0.02)}, 128)),
    }  # fmt: skip


def labels(ax):
    return [label.split("\n")[0] for label in ax.get_legend_handles_labels()[1]]


def edge_of(ax):
    """Vertices of the thick line of the edge."""
    (line,) = [line for line in ax.lines if line.get_label().startswith("edge of stability")]
    return line.get_xydata()[np.isfinite(line.get_xdata())]


def test_a_chart_has_units_regions_and_the_exact_edge(maps):
    ax = maps["chart"].plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("angle ψ (deg)", "stiffness k (GPa/m)")
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
    assert labels(ax) == [
        "no steady sliding (lock-up)", "edge of stability: oscillation", "this rig", "nearest edge",
        "stiffness over critical $k/k_{\\mathrm{cr}}$",
    ]  # fmt: skip
    assert {"stable", "unstable", "no steady sliding"} < {text.get_text() for text in ax.texts}
    angle, stiffness = edge_of(ax).T
    exact = ss.critical_stiffness(rig(), {"contact.angle": np.radians(angle)}) / 1e9
    # 40 halvings of a grid cell of 0.045 in ln k, or of one of 2.5 degrees on an edge whose slope is below 1 per degree
    assert np.max(np.abs(np.log(stiffness / exact))[angle < 75]) < 1e-9
    (own,) = [line for line in ax.lines if line.get_label() == "this rig"]
    np.testing.assert_allclose([own.get_xdata()[0], own.get_ydata()[0]], [-45, 9])


def test_the_nearest_edge_is_nearest_in_the_picture(maps):
    ax = maps["chart"].plot(show="growth_rate")
    (mark,) = [line for line in ax.lines if line.get_label().startswith("nearest edge")]
    found = mark.get_xdata()[0], mark.get_ydata()[0]
    assert "angle " in mark.get_label()
    angle = np.linspace(-52, 79, 20001)
    k = ss.critical_stiffness(rig(), {"contact.angle": np.radians(angle)}) / 1e9
    seen = k < 100

    def distance(a, b):
        return np.hypot((a + 45) / 160, np.log(b / 9) / np.log(1000))

    best = np.argmin(distance(angle[seen], k[seen]))
    assert distance(*found) == pytest.approx(distance(angle[seen][best], k[seen][best]), rel=0.02)


def test_safety_contours_run_where_the_factor_is_what_they_say(maps):
    ax = maps["chart"].plot(show="safety_factor")
    lines = [c for c in ax.collections if hasattr(c, "levels") and len(c.levels) > 2]
    (contours,) = lines
    levels = contours.levels / (1 - contours.levels)  # drawn of k/(k + k_cr)
    assert levels == pytest.approx([0.1, 0.2, 0.5, 2, 5, 10])
    for level, path in zip(levels, contours.get_paths(), strict=True):
        angle, k = path.vertices[path.vertices[:, 0] > -40].T
        factor = k * 1e9 / ss.critical_stiffness(rig(), {"contact.angle": np.radians(angle)})
        np.testing.assert_allclose(factor, level, rtol=0.02)


def test_curves_bands_and_intervals(maps):
    ax = maps["chart"].plot("angle", "", show="safety_factor")
    (curve,) = [line for line in ax.lines if len(line.get_xdata()) == 65]
    expected = ss.safety_factor(rig(), {"contact.angle": np.radians(curve.get_xdata())})
    held = maps["chart"].dataset["slider.stiffness"].sel({"slider.stiffness": 9e9}, method="nearest")
    np.testing.assert_allclose(curve.get_ydata(), expected * float(held) / 9e9, rtol=1e-9)
    assert ax.get_ylabel() == "safety factor (1)"
    assert labels(ax) == ["stable", "unstable", "no steady sliding", "this rig"]
    ax = maps["chart"].plot("angle", "", show="stable_stiffness")
    assert ax.get_ylabel() == "stable stiffness (GPa/m)"
    ax = maps["chart"].plot("angle", "", show="onset")
    assert [t.get_text() for t in ax.get_yticklabels()] == list(KINDS)


def test_facets_share_axes_and_say_their_value(maps):
    axes = maps["chart"].plot(facet="friction.b", show="critical_stiffness")
    assert [ax.get_title() for ax in axes.flat] == [f"evolution effect b = {b}" for b in (0.016, 0.018, 0.02)]
    assert axes[0, 1].get_ylabel() == ""
    others = maps["chart"].plot(facet="angle")  # which is then on no axis
    assert others[0, 0].get_title() == "angle ψ = −80 deg"
    assert (others[1, 0].get_xlabel(), others[1, 0].get_ylabel()) == ("stiffness k (GPa/m)", "evolution effect b (1)")


def test_a_map_of_statuses_alone_has_the_exact_edge(maps, tmp_path):
    """No growth rate between its points: the edge is found from the rig, and is no staircase."""
    grids = {
        "angle": ss.maps.Grid("-80 deg", "80 deg", 9),
        "stiffness": ss.maps.Grid("0.1 GPa/m", "100 GPa/m", 7, "log"),
    }
    coarse = ss.run_map(ss.Map(rig(), grids, ["status"]), tmp_path / "coarse.zarr", workers=1)
    angle, stiffness = edge_of(coarse.plot()).T
    exact = ss.critical_stiffness(rig(), {"contact.angle": np.radians(angle)}) / 1e9
    slides = np.isfinite(exact)  # the line goes on below the area without steady sliding, which is painted on it
    assert slides.sum() > 5
    stiffness, exact = stiffness[slides], exact[slides]
    np.testing.assert_allclose(stiffness, exact, rtol=1e-8)


def test_the_rig_is_marked_in_its_own_panel_only(maps):
    axes = maps["chart"].plot(facet="friction.b")
    marked = [any(line.get_label() == "this rig" for line in ax.lines) for ax in axes.flat]
    assert marked == [True, False, False]


def test_kinds_have_colours_and_names(maps):
    ax = maps["chart"].plot(show="onset")
    assert labels(ax)[:3] == ["none", "supercritical", "subcritical"]
    with pytest.raises(ss.ParameterError, match="several numbers per point"):
        maps["chart"].plot(show="stable_stiffness")


def test_samples_are_summed_up(maps):
    found = maps["samples"]
    view = take(found, axes_of(found, None, None), ["status", "critical_stiffness"])
    data = found.dataset
    np.testing.assert_allclose(view.shares["status"][1].T, (data["status"] == 1).mean("sample"))
    np.testing.assert_allclose(view.values["critical_stiffness"].T, data["critical_stiffness"].median("sample"))
    ax = found.plot()
    assert ax.figure.axes[1].get_ylabel() == "share of samples that are stable (1)"
    ax = found.plot("angle", "", show="critical_stiffness")
    assert {"median of samples", "95 % of samples"} <= set(labels(ax))
    ax = found.plot("angle", "", show="status")
    assert ax.get_ylabel() == "share of samples (1)"


def test_points_are_scattered(maps):
    ax = maps["points"].plot("friction.a", "friction.b")
    assert labels(ax) == ["unstable", "stable"]
    data = maps["points"].dataset
    (stable,) = [line for line in ax.lines if line.get_label() == "stable"]
    np.testing.assert_array_equal(np.sort(stable.get_xdata()), np.sort(data["friction.a"].values[data["status"] == 1]))
    ax = maps["points"].plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("direct effect a (1)", "safety factor (1)")


def test_other_parameters_are_held_where_the_rig_or_the_user_says(maps):
    found = maps["chart"]
    names = axes_of(found, None, None)
    own = take(found, names, ["critical_stiffness"])
    assert own.held == {"friction.b": 0.016}
    other = take(found, names, ["critical_stiffness"], {"b": 0.0195})
    assert other.held == {"friction.b": 0.02}
    np.testing.assert_array_equal(
        other.values["critical_stiffness"].T, found.dataset["critical_stiffness"].sel({"friction.b": 0.02})
    )
    with pytest.raises(ss.ParameterError, match=r"at.*allowed: friction\.b"):
        take(found, names, ["status"], {"mass": 1.0})


def test_large_maps_are_thinned(tmp_path):
    plan = ss.Map(rig(), {"angle": ss.maps.Grid("-40 deg", "80 deg", 3001)}, ["growth_rate"])
    ax = ss.run_map(plan, tmp_path / "long.zarr", workers=1).plot()
    assert 250 < len(ax.lines[0].get_xdata()) <= 500


def test_refined_points_and_sensitivity_are_drawn(maps, tmp_path):
    small = ss.Map(rig(), {"angle": ss.maps.Grid("-40 deg", "80 deg", 9),
        "stiffness": ss.maps.Grid(1e9, 1e11, 9, "log")},
                   ["status"])  # fmt: skip
    found = ss.refine(ss.run_map(small, tmp_path / "small.zarr", workers=1), 3)
    ax = found.plot()
    assert labels(ax) == ["stable", "unstable", "edge of status"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("angle ψ (deg)", "stiffness k (GPa/m)")
    (edge,) = [line for line in ax.lines if line.get_label().startswith("edge")]
    assert len(edge.get_xdata()) == len(found.sides)
    over = {"friction.a": (0.010, 0.014), "friction.d_c": (1e-6, 1e-5, "log")}
    bars = ss.sensitivity(rig(), over, points=256).plot()
    assert [ax.get_title() for ax in bars] == ["critical stiffness", "margin"]
    assert [t.get_text() for t in bars[1].get_yticklabels()] == ["direct effect a", r"slip distance $d_{\mathrm{c}}$"]
    assert bars[0].get_xlabel() == "share of the variance (1)"


def test_white_has_words(tmp_path):
    """Where a picture has no number, the legend says why: asked of the rigs there, and of the store."""
    over = {"friction.b": ss.maps.Grid(0.010, 0.03, 9), "contact.angle": ss.maps.Grid(-1.4, 1.2, 9)}
    found = ss.run_map(ss.Map(rig(), over, ["critical_stiffness"]), tmp_path / "white.zarr", workers=1)
    expected = "no critical stiffness (no steady sliding, stable at every stiffness)"
    assert expected in labels(found.plot())
    line = found.plot(x="friction.b", y="")
    assert "where there is no line: no critical stiffness (stable at every stiffness)" in labels(line)
    over = {"friction.b": ss.maps.Grid(0.02, 0.03, 4), "contact.angle": ss.maps.Grid(-0.1, 0.1, 4)}
    full = ss.run_map(ss.Map(rig(), over, ["critical_stiffness"]), tmp_path / "full.zarr", workers=1)
    assert labels(full.plot()) == []


def test_numbers_out_of_range_have_words(tmp_path):
    screw = ss.laws.LuGre(mu_coulomb=0.12, mu_static=0.18, v_stribeck=1e-3, bristle_stiffness=2e5, bristle_damping=30.0)
    base = ss.Slider(
        friction=screw, contact=rig().contact, stiffness=4e10, mass=3e3, drive=ss.machine.SteadyDrive(5e-4)
    )
    over = {"friction.v_stribeck": list(np.geomspace(1e-200, 1e-1, 8)), "stiffness": ss.maps.Grid(1e10, 1e12, 4)}
    plan = ss.Map(base, over, ["status", "critical_stiffness"], chunk=4)
    found = ss.run_map(plan, tmp_path / "screw.zarr", workers=1)
    assert found.statistics()["status"]["out of range"] > 0
    ax = found.plot()
    assert "numbers out of the range of floating point" in [*labels(ax), *(text.get_text() for text in ax.texts)]
    assert "numbers out of the range of floating point" in labels(found.plot(x="friction.v_stribeck", y=""))
    bare = ss.run_map(ss.Map(base, over, ["critical_stiffness"]), tmp_path / "bare.zarr", workers=1)
    (words,) = (word for word in labels(bare.plot()) if word.startswith("no critical stiffness"))
    assert "out of range" in words


def test_the_text_of_a_map_without_status_says_where_to_look(tmp_path):
    over = {"friction.b": ss.maps.Grid(0.010, 0.03, 9)}
    bare = ss.run_map(ss.Map(rig(), over, ["critical_stiffness"]), tmp_path / "bare.zarr", workers=1)
    told = ss.run_map(ss.Map(rig(), over, ["critical_stiffness", "status"]), tmp_path / "told.zarr", workers=1)
    hint = "compute status as well to see why the others have none"
    assert hint in str(bare)
    assert hint not in str(told)
