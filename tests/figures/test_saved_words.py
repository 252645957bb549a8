"""Words in and below figures: what pulls, what is held, no raw letters or units."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import steadyslip as ss
from steadyslip import figures
from steadyslip.figures.style import OWN_RIG, save_with_footer

matplotlib.use("Agg")
EXAMPLES = Path(__file__).parents[2] / "examples"


def footer_of(axes, result, folder):
    save_with_footer(axes, str(folder / "figure.svg"), result)
    return np.ravel(axes)[0].figure.texts[-1].get_text().replace("\xa0", " ").replace("\n", " ")


def test_below_a_chart_stand_its_file_and_what_it_holds(tmp_path):
    """What is on an axis has many values there, so the rig's own is not told as held."""
    rig = ss.read_rig(EXAMPLES / "slow-axis.toml", ["preload=500 N"])
    changed = rig.with_values({"drive.velocity": "30 um/s"})
    axes = figures.stability_chart(changed, "friction.b", "drive.kp", points=5)
    text = footer_of(axes, ss.analyze(changed), tmp_path)
    assert text.startswith("slow-axis.toml. held: direct effect a 0.01, ")
    assert "preload σ₀ 500 N" in text
    assert "30 µm/s" in text
    assert "evolution effect" not in text
    assert "proportional gain" not in text


def test_below_a_run_stands_its_protocol_and_what_it_changes_is_not_held(tmp_path):
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml", ["stiffness=32 GPa/m"])
    step, wave = ss.protocol.VelocityStep(at=1.0, to="2 um/s"), ss.protocol.NormalStressStep(at=2.0, by=1e5)
    run = ss.simulate(rig, step, until=3.0)
    held, _, rest = footer_of(run.plot(), run, tmp_path).partition(". at first: ")
    assert "drive velocity" not in held
    assert "preload" in held
    assert rest.startswith("drive velocity v₀ 1 µm/s. protocol: velocity step at 1 s, to 2 µm/s. steadyslip")
    pressed = ss.simulate(rig, wave, until=3.0)
    held, _, rest = footer_of(pressed.plot(), pressed, tmp_path).partition(". at first: ")
    assert "drive velocity v₀ 1 µm/s" in held
    assert rest.startswith("preload σ₀ 5 MPa. protocol: normal stress step at 2 s, by 100 kPa. steadyslip")


def test_the_phase_plane_marks_where_a_run_ended_early():
    rig = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=1.0, to="2 um/s"), until=60.0)
    axes = figures.phase_plane(run)
    (end,) = [line for line in axes.lines if line.get_label().startswith(f"{run.status} at ")]
    curve = next(line for line in axes.lines if line.get_label() == "the run").get_xydata()
    assert end.get_xydata()[0] == pytest.approx(curve[np.isfinite(curve).all(axis=1)][-1])


def test_no_figure_has_a_bare_power_of_ten(tmp_path):
    """It stands in the unit, as a number beside an axis touches the legend and says nothing of its own."""
    rig = ss.read_rig(EXAMPLES / "lead-screw.toml")
    axes = figures.root_locus(rig)
    save_with_footer(axes, str(tmp_path / "locus.svg"), ss.analyze(rig))
    assert axes.get_xlabel() == "growth rate Re s ($10^{4}$ 1/s)"
    axes.figure.draw_without_rendering()
    assert not axes.xaxis.offsetText.get_visible()
    assert not axes.yaxis.offsetText.get_visible()


def test_the_name_of_a_file_below_a_figure_is_no_mathematics(tmp_path):
    path = tmp_path / "5$ a_b $k_x$ {-z.toml"
    path.write_text((EXAMPLES / "slow-axis.toml").read_text())
    found = ss.analyze(ss.read_rig(path))
    text = footer_of(found.plot(), found, tmp_path)
    assert text.startswith(r"5\$ a_b \$k_x\$ {-z.toml. held: direct effect a 0.01, ")


def test_below_a_reopened_map_stands_the_file_of_its_rig(tmp_path):
    rig = ss.read_rig(EXAMPLES / "slow-axis.toml")
    grids = {"friction.b": ss.maps.Grid(0.011, 0.02, 3), "drive.kp": ss.maps.Grid("0.1 N/um", "2 N/um", 3)}
    ss.run_map(ss.Map(rig, grids, ["status"]), tmp_path / "own.zarr", workers=1)
    again = ss.open_map(tmp_path / "own.zarr")
    assert footer_of(again.plot(), again, tmp_path).startswith("slow-axis.toml. held: ")


@pytest.fixture(scope="module")
def found():
    record = ss.read_record(EXAMPLES / "data/made_velocity_step.csv")
    return ss.fit(ss.lab_rig("slip"), record, starts=1, effort=0.05)


def test_below_a_fit_stand_its_law_and_what_is_fitted_and_held(found, tmp_path):
    text = footer_of(found.plot(), found, tmp_path)
    assert text.startswith("rate-state friction (slip). fitted: direct effect a ")
    fitted, _, held = text.partition("held: ")
    assert "time of change 1 of the drive" in fitted or "slip distance" in fitted
    assert "±" in fitted
    assert "reference rate" in held
    assert "direct effect a" not in held


def test_a_constant_normal_force_is_told_in_words():
    """It has a panel where it changes, and where the caller gave three."""
    rig = ss.read_rig(EXAMPLES / "slow-axis.toml")
    run = ss.simulate(rig, until=0.5)
    panels = figures.history(run)
    assert [panel.get_ylabel() for panel in panels] == ["velocity (µm/s)", "friction τ/σ (1)"]
    assert panels[1].get_title(loc="left") == "constant normal force: 600 N"
    assert panels[1].get_xlabel().startswith("time")
    assert len(figures.history(run, Figure().subplots(3, 1))) == 3
    inclined = ss.simulate(
        ss.read_rig(EXAMPLES / "inclined-spring.toml"), ss.protocol.VelocityStep(at=0.1, to="2 um/s"), until=1.0
    )
    assert len(figures.history(inclined)) == 3
    machine = ss.simulate(ss.read_rig(EXAMPLES / "machines/feed-axis.toml"), until=0.1)
    (_, friction) = figures.history(machine)
    assert friction.get_title(loc="left") == "constant normal force: 3 kN"


def test_a_phase_plane_says_what_pulls_and_names_all_it_draws():
    rig = ss.read_rig(EXAMPLES / "slow-axis.toml")
    ax = figures.phase_plane(ss.simulate(rig, until=0.5))
    assert ax.get_ylabel() == "drive force (N)"  # it has no spring
    both = figures.phase_plane(ss.simulate(rig.with_values({"slider.stiffness": 1e6}), until=0.5))
    assert both.get_ylabel() == "spring and drive force (N)"
    machine = figures.phase_plane(ss.simulate(ss.read_rig(EXAMPLES / "machines/feed-axis.toml"), until=0.1))
    for drawn in (ax, machine):
        texts = [text.get_text() for text in drawn.get_legend().get_texts()]
        assert texts == ["the run", "steady states", "steady sliding of the last drive"]
        drawn.figure.draw_without_rendering()
        assert drawn.get_legend().get_window_extent().y0 >= drawn.get_window_extent().y1 - 1  # above, where no data is


def test_bars_of_tolerances_have_typeset_letters_and_units():
    rig = ss.read_rig(EXAMPLES / "machines/brake-pad.toml")
    within = ss.tolerate(rig, {"contacts.disc.contact.normal_stiffness": "10 %"})
    texts = [label.get_text() for label in figures.tolerances(within).get_yticklabels()]
    assert texts == ["all together", "disc normal stiffness $k_{\\mathrm{n}}$\n7.2 to 8.8 N/µm"]


@pytest.fixture(scope="module")
def map_at_its_edge(tmp_path_factory):
    """A map whose first stiffness is the rig's, with growth rates that reach over many powers of ten."""
    rig = ss.read_rig(EXAMPLES / "stick-slip.toml", ["stiffness=1 GPa/m", "d_c=10 um"])
    axes = {"stiffness": np.linspace(1e9, 6e9, 11), "friction.b": np.linspace(0.012, 0.018, 13)}
    return ss.run_map(ss.Map(rig, axes, ["status", "growth_rate"]), tmp_path_factory.mktemp("map") / "map.zarr")


def test_contours_do_not_run_along_the_edge(map_at_its_edge):
    """Levels so small that their contours are as good as the edge are left out; labels are apart."""
    ax = map_at_its_edge.plot()
    written = [one for one in ax.texts if one.get_text().lstrip("−")[:1].isdigit()]
    assert {one.get_text() for one in written} >= {"0.01", "−0.01"}
    assert not any("e" in one.get_text() or "⁻" in one.get_text() for one in written)
    places = [ax.transData.transform(one.get_position()) for one in written]
    assert min(np.hypot(*(a - b)) for i, a in enumerate(places) for b in places[:i]) > 24


def test_the_mark_of_the_rig_is_whole_at_the_end_of_a_map(map_at_its_edge):
    ax = map_at_its_edge.plot()
    low, high = ax.get_xlim()
    assert low < 1 - 0.02 * (high - low)
    assert high == 6
    (mark,) = [line for line in ax.lines if line.get_label() == OWN_RIG["label"]]
    assert mark.get_xdata()[0] == 1
