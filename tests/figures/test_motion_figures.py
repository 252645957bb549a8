"""Figures of simulated motion: read from the Axes, not from pixels."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import steadyslip as ss
from dimensionless import unit_rig
from steadyslip.reproduce import FIGURES, paper_rig
from steadyslip.reproduce.drawings import simulate_orbit
from steadyslip.units import deg

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def spiral():
    return ss.simulate(unit_rig("slip", 0.5, 0.6), ss.protocol.VelocityStep(at=5.0, to=1.5), until=60.0)


def lines(ax):
    return {line.get_label(): line for line in ax.lines}


def test_history_shows_the_run(spiral):
    figure = Figure()
    panels = spiral.plot(ax=figure.subplots(3, 1))
    assert len(panels) == 3
    assert np.array_equal(lines(panels[0])["block"].get_ydata(), spiral["v"])
    assert np.array_equal(lines(panels[0])["load point"].get_ydata(), spiral["load_velocity"])
    assert panels[0].get_yscale() == "log"
    assert np.array_equal(panels[1].lines[0].get_ydata(), spiral["friction"])
    assert [panel.get_ylabel() for panel in panels] == ["velocity (m/s)", "friction τ/σ (1)", "normal stress (Pa)"]
    assert panels[2].get_xlabel() == "time (min)" or panels[2].get_xlabel() == "time (s)"
    assert len(panels[1].patches) == len(spiral.slip_events)


def test_blow_up_is_said_and_clipped():
    run = ss.simulate(unit_rig("slip", 0.5, 0.3), ss.protocol.VelocityStep(at=5.0, to=1.5), until=60.0)
    panels = run.plot()
    assert "blow-up" in panels[0].get_title()
    assert "drawn up to 10000 times the steady velocity" in panels[0].get_title()
    low, high = panels[0].get_ylim()
    assert low < run["v"].min()  # clipped above only: the slow part stays in view
    assert 1e3 < high < 1e5
    friction = run["friction"][run["v"] < 1e4]
    assert panels[1].get_ylim()[1] < friction.max() + 0.1 * np.ptp(friction)
    assert run.plot("phase", ax=Figure().subplots()).get_xlim()[1] < 1.2 * np.log(1e4)
    assert any(line.get_xdata()[0] == pytest.approx(run.end) for line in panels[1].lines[1:])


def test_phase_plane_shows_the_run_and_steady_states(spiral):
    ax = spiral.plot("phase", ax=Figure().subplots())
    assert np.allclose(ax.lines[0].get_xdata(), np.log(spiral["v"]))
    assert np.array_equal(ax.lines[0].get_ydata(), spiral["spring_stress"])
    steady = lines(ax)["steady states"]
    slope = np.polyfit(steady.get_xdata(), steady.get_ydata(), 1)[0]
    assert slope == pytest.approx(-0.005, rel=1e-9)  # (a − b) σ
    assert ax.get_xlabel() == "ln($v/v_0$) (1)"
    with pytest.raises(ss.NotAvailable, match="history"):
        spiral.plot("orbit")


def test_the_dot_is_where_a_stable_run_ends_and_stress_steps_are_named(spiral):
    dot = lines(spiral.plot("phase", ax=Figure().subplots()))["steady sliding of the last drive"]
    assert dot.get_xdata()[0] == pytest.approx(np.log(1.5))
    assert dot.get_ydata()[0] == pytest.approx(spiral["spring_stress"][-1], rel=1e-3)
    pressed = ss.simulate(paper_rig(), ss.protocol.NormalStressStep(at=1.0, by=1e4), until=5.0)
    drawn = lines(pressed.plot("phase", ax=Figure().subplots()))
    assert "steady states before the change of normal stress" in drawn
    assert "steady sliding of the last drive" not in drawn


def test_history_needs_three_axes(spiral):
    for ax in (Figure().subplots(), Figure().subplots(2, 1)):
        with pytest.raises(ss.ParameterError, match="three"):
            spiral.plot(ax=ax)


def test_reversing_runs_can_be_drawn():
    rig = unit_rig("slip", 0.5, 3.0, regularised=True)
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=1.0, to=-1.0), until=100.0)
    panels = run.plot(ax=Figure().subplots(3, 1))
    assert panels[0].get_yscale() == "linear"
    run.plot("phase", ax=Figure().subplots())


def test_figures_1_and_2_have_the_direct_and_the_evolving_part():
    drawn = {figure.name: figure.draw(Figure().subplots()) for figure in FIGURES if figure.name in ("fig1", "fig2")}
    first, second = (drawn[name].lines[0].get_ydata() for name in ("fig1", "fig2"))
    assert first.max() == pytest.approx(0.0145, rel=1e-3)
    assert first[-1] == pytest.approx(0.0145 - 0.0160, rel=5e-3)
    texts = [text.get_text() for text in drawn["fig1"].texts]
    assert {"A", "B"} <= set(texts)
    assert second[-1] == pytest.approx(0.7 * 0.01, rel=5e-3)
    levels = sorted(line.get_ydata()[0] for line in drawn["fig2"].lines[1:])
    assert levels[1] == pytest.approx((0.7 - 0.56) * 0.01, rel=3e-2)


def test_figure_5_is_a_weak_spiral_at_the_edge():
    """At k = k_cr the paper's orbit closes to linear order only; it shrinks, very slowly (theory 6)."""
    edge = float(ss.critical_stiffness(paper_rig()))
    run = simulate_orbit(-45 * deg, edge, cycles=6.0)
    u = np.log(run["v"] / 1e-6)
    tops = u[1:-1][(u[1:-1] > u[:-2]) & (u[1:-1] > u[2:])]
    assert np.all(np.diff(tops) < 0)
    assert np.all(np.diff(tops) > -0.01)


def test_every_slip_event_can_be_seen():
    """However short it is beside the run: its band has some width on paper, and its middle in it."""
    example = Path(__file__).parents[2] / "examples/stick-slip.toml"
    run = ss.simulate(ss.read_rig(example), ss.read_protocol(example), until=200.0)
    axes = run.plot()
    bands = [patch for patch in axes[0].patches if patch.get_width() > 0]
    assert len(bands) == len(run.slip_events) > 3
    for band, slip in zip(bands, run.slip_events, strict=True):
        assert band.get_width() >= 0.99 * 0.004 * 200
        assert band.get_x() <= 0.5 * (slip.begin + slip.end) <= band.get_x() + band.get_width()


def test_friction_is_seen_where_contact_is_lost():
    """It is a ratio of two forces that vanish: its axis ran to 4 where all but the last sample was at 0.5."""
    rig = ss.read_rig("examples/machines/brake-pad.toml")
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=0.01, to=1.1), until=1.0)
    assert run.status == "contact lost"
    force, friction = run["disc.normal_force"], run["disc.friction"]
    panels = run.plot(ax=Figure().subplots(3, 1))
    low, high = panels[1].get_ylim()
    early = friction[: len(friction) // 2]
    assert low < early.min()
    assert early.max() < high < 1.2 * friction[force > 0.5 * force.max()].max() < friction.max()
    assert np.ptp(friction[force > 0.5 * force.max()]) > 0.3 * (high - low)
    assert np.array_equal(panels[1].lines[0].get_ydata(), friction)
