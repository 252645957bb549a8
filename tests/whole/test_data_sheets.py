"""Six data sheets typed in by hand are answered in their own units, by verdicts that hold beside their edges."""

import re

import pytest

import steadyslip as ss
from data_sheets import SHEETS
from steadyslip.machine.letters import label_of


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_is_read_and_its_verdict_holds_on_both_sides_of_its_first_edge(name):
    rig = ss.rig_from_text(SHEETS[name])
    found = ss.analyze(rig)
    assert found.stable in (True, False)
    first = next(one for one in found.margins if one.edge is not None)
    own = 1 if first.edge.value > first.value else -1
    grows = [
        float(ss.growth_rate(rig.with_values({first.parameter: first.edge.value * (1 + side * own * 1e-3)}))) > 0
        for side in (-1, 1)
    ]
    assert grows == [not found.stable, found.stable]


def test_sheets_are_answered_in_their_own_units():
    told = {name: str(ss.analyze(ss.rig_from_text(text))).splitlines()[0] for name, text in SHEETS.items()}
    assert told["feed axis"] == "STABLE: steady sliding at 5 mm/min"
    assert told["brake"] == "UNSTABLE: steady sliding at 2 km/h"


def test_an_oscillation_that_does_not_rest_is_told_as_one():
    """The guide with its seal: between its peaks it comes to a stop for an instant alone, and no slip event begins."""
    rig = ss.rig_from_text(SHEETS["guide with seal"])
    told = re.fullmatch(r"oscillates: every (.*) ms between (.*) um/s and (.*) um/s", ss.analyze(rig).judders)
    assert told is not None
    period, low, high = map(float, told.groups())
    run = ss.simulate(
        rig, [ss.protocol.VelocityStep(at=0.1, to=2e-4), ss.protocol.VelocityStep(at=0.12, to=1e-4)], until=6.0
    )
    late = run["t"] > 4.0
    assert [1e-6 * low, 1e-6 * high] == pytest.approx([run["v"][late].min(), run["v"][late].max()], abs=2e-6)
    peaks = [one for one in run.events if one.kind == "velocity peak" and one.time > 4.0]
    assert 1e-3 * period == pytest.approx((peaks[-1].time - peaks[0].time) / (len(peaks) - 1), rel=5e-3)


def test_the_speed_of_the_axis_is_what_is_changed_limited_and_told(tmp_path):
    """The drive of the telescope turns 360 times as fast; what is written of its speed is the axis's."""
    rig = ss.rig_from_text(SHEETS["telescope worm"])
    faster = rig.with_values({"drive.velocity": "30.08 arcsec/s"})
    assert faster.drive.velocity == pytest.approx(2 * rig.drive.velocity)
    assert str(ss.analyze(faster)).splitlines()[0].endswith("at 30.08 arcsec/s")
    text = SHEETS["telescope worm"].replace("15.04 arcsec/s", "15.04 ± 1 arcsec/s")
    (file := tmp_path / "worm.toml").write_text(text + '[adjust]\n"drive.velocity" = { to = "150.4 arcsec/s" }')
    tolerances = ss.verdict.read_tolerances(file)
    assert tolerances.adjust["drive.velocity"].high == pytest.approx(10 * rig.drive.velocity)
    assert "drive.velocity            14.04 to 16.04 arcsec/s alone" in str(ss.tolerate(rig, tolerances))
    (window,) = ss.cure(rig, adjust=tolerances.adjust).windows
    assert str(window).endswith("to 150.4 arcsec/s")


@pytest.mark.parametrize("name", SHEETS)
def test_the_edge_of_the_first_line_is_that_of_the_first_row(name):
    """Of the servo joint it was one at .0024 of the value (-99.8 %), which the table told last."""
    found = ss.analyze(ss.rig_from_text(SHEETS[name]))
    with_edge = [margin for margin in found.margins if margin.edge is not None]
    remote = [margin.remote for margin in with_edge if margin.value]
    assert remote == sorted(remote)
    text = str(found)
    rows = text.partition("Nearest edges in each parameter")[2].splitlines()[1:]
    first = next(row.split()[0] for row in rows if " -> " in row)
    assert with_edge[0].parameter.endswith(first)
    if "nearest edge is that of" in " ".join(text.split()):
        assert f"nearest edge is that of {label_of(found.rig, with_edge[0].parameter)}" in " ".join(text.split())
