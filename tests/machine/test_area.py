"""A rig with a contact area is read, told, drawn and written in forces throughout."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.text import Text

import lab_records as lab
import steadyslip as ss
from steadyslip.core.areas import outside
from steadyslip.core.format import format_quantity, format_range
from steadyslip.maps import Map, run_map
from steadyslip.nonlinear.kicks.kicks import KICKS
from steadyslip.nonlinear.kicks.threshold import Threshold

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"
AREA = 0.01
PER_AREA = re.compile(r"\b[kMGmun]?Pa\b|kg/m\^?2|kg/m²")


@pytest.fixture(scope="module")
def rig():
    return replace(ss.read_rig(EXAMPLE, ["stiffness=32 GPa/m"]), area=AREA)


def words_of(axes):
    figure = np.ravel(axes)[0].figure
    found = [t.get_text() for t in figure.findobj(Text)]
    plt.close(figure)
    return " ".join(found)


def test_one_place_knows_what_a_contact_has():
    for unit in (
        "Pa",
        "Pa/m",
        "kg/m^2",
        "Pa s/m",
        "Pa/m/s",
        *(kick.unit for kick in KICKS.values() if "Pa" in kick.unit),
    ):
        factor, total = outside(unit, AREA)
        assert factor == AREA
        assert format_quantity(2.0 / AREA, unit, area=AREA) == format_quantity(2.0, total)
        assert not PER_AREA.search(total), total
        assert format_range(1.0 / AREA, 2.0 / AREA, unit, AREA) == format_range(1.0, 2.0, total)
    for unit in ("m/s", "s", "1", "rad", "1/m"):
        assert outside(unit, AREA) == (1.0, unit)


def test_analysis(rig):
    found = ss.analyze(rig)
    data = json.loads(found.to_json())
    pressures = [row for row in data["boundaries"] if PER_AREA.search(row["unit"])]
    assert pressures
    for row in data["boundaries"]:
        if row in pressures:
            assert row["total"] == pytest.approx(row["value"] * AREA)
            assert row["total_unit"][0] in "Nk"
        else:
            assert "total" not in row
    assert not PER_AREA.search(str(ss.steady_state(rig)))
    assert not PER_AREA.search(str(ss.hopf(rig)))
    assert not PER_AREA.search(words_of(ss.analyze(rig).plot()))
    assert PER_AREA.search(str(ss.hopf(replace(rig, area=None))))


def test_absence_of_steady_sliding(rig):
    lifted = replace(rig, contact=ss.laws.Lift(preload=1e6, lift=2e12, v_ref=1e-9))
    reason = ss.analyze(lifted).reason
    assert "lift-off" in reason
    assert not PER_AREA.search(reason)


def test_a_run(rig, tmp_path):
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=1.0, to=2e-6), until=5.0)
    plain = replace(run, rig=replace(rig, area=None))
    assert "normal force" in run.summary()
    assert not PER_AREA.search(run.summary())
    assert PER_AREA.search(plain.summary())
    run.to_csv(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert not PER_AREA.search(header)
    table = np.loadtxt(tmp_path / "run.csv", delimiter=",", skiprows=1)
    column = header.split(",").index("normal_stress (N)")
    assert table[:, column] == pytest.approx(run["normal_stress"] * AREA, rel=1e-14)
    data = run.to_dict()
    assert data["forces"]["final"]["normal_stress"] == pytest.approx(data["final"]["normal_stress"] * AREA)
    assert data["forces"]["units"]["normal_stress"] == "N"
    assert "forces" not in plain.to_dict()
    for kind in ("history", "phase"):
        axes = run.plot(kind)
        drawn = np.ravel(axes)[-1]
        last = drawn.lines[0].get_ydata()
        name = "normal_stress" if kind == "history" else "spring_stress"
        ratio = np.nanmedian(run[name]) * AREA / np.nanmedian(last)
        assert ratio == pytest.approx(10.0 ** round(float(np.log10(ratio))))  # a prefix of N
        words = words_of(axes)
        assert "force (" in words
        assert not PER_AREA.search(words)


def test_thresholds(rig):
    kick = Threshold(rig, "normal-stress", 1, 0.5, (0.4, 0.6), 2e6, "Pa", "oscillation", 1.0)
    assert "20 kN" in str(kick)
    assert (kick.to_dict()["total"], kick.to_dict()["total_unit"]) == (2e4, "N")
    assert "total" not in Threshold(rig, "velocity", 1, 0.5, (0.4, 0.6), 2e-6, "m/s", "blow-up", 1.0).to_dict()


def test_edges_and_onsets(rig):
    for name in ("slider.stiffness", "contact.preload"):
        edges = ss.boundary(rig, name)
        assert edges
        for edge in edges:
            assert not PER_AREA.search(str(edge))
            assert PER_AREA.search(str(replace(edge, area=None)))
    data = ss.analyze(rig).to_dict()["onset"]
    assert data["total"] == pytest.approx(data["value"] * AREA)
    assert data["total_unit"] == "N/m"


def test_cycles(rig):
    stick_slip = replace(ss.read_rig(EXAMPLE.parent / "stick-slip.toml"), area=AREA)
    branch = ss.cycles(stick_slip, doublings=0, most_points=12)
    assert not PER_AREA.search(str(branch))
    data = branch.to_dict()
    for row in (*data["cycles"], *data["special"]):
        assert row["forces"]["area"] == AREA
        for name, value in row["forces"]["values"].items():
            assert value == pytest.approx(row[name] * AREA)
        assert row["forces"]["units"]["stress_drop"] == "N"
        assert row["forces"]["units"]["value"] == "N/m"
    assert data["onset"]["total_unit"] == "N/m"
    assert not PER_AREA.search(words_of(branch.plot()))


def test_fits_and_predictions(rig):
    """Estimates, draws, profiles and predictions of a rig with an area, in words, JSON and figures."""
    found = ss.fit(replace(ss.lab_rig(), area=AREA), lab.record(lab.rig(), lab.STEP, 0))
    plain = replace(found, plan=replace(found.plan, rig=replace(found.plan.rig, area=None)))
    stiff = found.to_dict()["parameters"]["slider.stiffness"]
    assert stiff["total"] == pytest.approx(stiff["value"] * AREA)
    assert stiff["total_unit"] == "N/m"
    assert "total" not in plain.to_dict()["parameters"]["slider.stiffness"]
    draws = ss.experiments.bootstrap(found, 32)
    prediction = ss.predict(rig, found)
    asked = prediction.to_dict()
    assert asked["forces"]["critical_stiffness"] == pytest.approx([AREA * x for x in asked["critical_stiffness"]])
    precise = ss.experiments.precision(replace(lab.rig(), area=AREA), lab.STEP, until=150.0)
    for result in (
        found["slider.stiffness"],
        draws,
        ss.experiments.profile(found, "slider.stiffness", count=9),
        prediction,
        precise,
    ):
        assert "N/m" in str(result)
        assert not PER_AREA.search(str(result))
    assert PER_AREA.search(str(plain["slider.stiffness"]))
    for axes in (found.plot("corner"), draws.plot(), prediction.plot()):
        words = words_of(axes)
        assert "N/m" in words
        assert not PER_AREA.search(words)


def test_maps(rig, tmp_path):
    plan = Map(rig, over={"slider.stiffness": [1e10, 2e10, 4e10], "contact.preload": [1e6, 5e6]},
               compute=["critical_stiffness"])  # fmt: skip
    found = run_map(plan, tmp_path / "map.zarr", progress=False)
    assert found.area("critical_stiffness") == AREA
    assert not PER_AREA.search(str(found).split("\n", 2)[2])
    data, plain = found.to_dict(), found.statistics()["critical_stiffness"]
    assert data["forces"]["statistics"]["critical_stiffness"] == pytest.approx(
        {"low": plain["low"] * AREA, "high": plain["high"] * AREA, "unit": "N/m"}
    )
    words = words_of(found.plot())
    assert "N/m" in words
    assert not PER_AREA.search(words)


def test_a_file_without_a_map_is_told_so(rig, tmp_path):
    from steadyslip.cli.map_files import map_file, sensitivity_file

    path = tmp_path / "rig.toml"
    ss.write_rig(rig, path)
    for ask in (lambda: map_file(path, [tmp_path / "map.zarr"]), lambda: sensitivity_file(path)):
        with pytest.raises(ss.ParameterError, match=r"missing table; write \[map\]"):
            ask()
