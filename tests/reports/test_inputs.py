"""What documents tell of the inputs of a rig: tolerances and speeds as its file has them, and the file itself."""

import html
import math
import re

import numpy as np
import pytest
from typer.testing import CliRunner

import steadyslip as ss
from read_pages import words
from steadyslip.cli.program import app
from steadyslip.core.format import format_quantity
from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
from steadyslip.reports.elements import table
from toleranced import AXIS

CURABLE = (
    AXIS
    + """
[adjust]
slider.stiffness = { to = "1000 N/um", cost = 1 }
slider.damping = { to = "2000 N s/mm", cost = 2 }
[[correlations]]
between = ["friction.mu_coulomb", "friction.mu_static"]
value = 0.8
"""
)
FED = """
[bodies.motor]
motion = "rotation"
inertia = "95 kg cm^2"
[bodies.carriage]
mass = "850 kg"
[links.screw]
kind = "screw"
between = ["motor", "carriage"]
lead = "{lead:.6g} mm/rev"
stiffness = "85 N/um"
[contacts.ways]
body = "carriage"
friction = {{ law = "coulomb-stribeck", mu_coulomb = 0.06, mu_static = 0.14, v_stribeck = "25 mm/s" }}
contact = {{ law = "constant", preload = "12 kN" }}
[drive]
control = "rotary-pd"
velocity = "{speed:.6g} mm/min"
velocity_of = "carriage"
body = "motor"
kp = "2 kN m/rad"
"""


def _written(tmp_path, command, *options):
    """Text of a document, and its source."""
    page = tmp_path / "page.html"
    done = CliRunner().invoke(app, [*command, "-o", str(page), *options])
    assert done.exit_code == 0, done.output
    source = page.read_text(encoding="utf-8")
    return words(source).replace("\u2060", ""), html.unescape(source)


def _cell(text):
    """Text as a table of a document has it."""
    return words(table([[text]])).replace("\u2060", "").strip()


def test_a_document_of_cures_has_the_tolerances_the_file_and_what_to_change(tmp_path):
    """It told "none given" beside a chance, listed the file without them, and the present value beside a cost."""
    path = tmp_path / "axis.toml"
    path.write_text(CURABLE, encoding="utf-8")
    text, source = _written(tmp_path, ["cure", str(path)])
    assert "Tolerances: none given" not in text
    assert "9.6 to 14.4 N/µm" in text
    assert CURABLE in source
    assert "What is to be changed so that this rig is stable with a chance of 95 %, and what does it cost?" in text
    assert "the cures say" not in text
    for one in ss.cure(*rig_and_tolerances(path)).windows:
        assert one.windows
        assert f"{_cell(one.written(one.value))} {_cell(str(one))} {one.cost:.3g}" in text


def test_a_document_of_what_keeps_its_chance_tells_what_would_lose_it():
    rig = ss.rig_from_text(AXIS.replace("0.8", "2")).with_values({"stiffness": "400 N/um"})
    found = ss.cure(rig)
    assert found.chance >= found.sure
    text = words(ss.report(found, explorer=False).html).replace("\u2060", "")
    assert "and what would lose it?" in text
    for one, ends in found.losses().items():
        for end in ends:
            assert _cell(one.written(end)) in text


def test_only_a_document_that_knows_says_that_there_are_no_tolerances(tmp_path):
    """A comparison with chances of 24 % told "none given" of both rigs."""
    path, other = tmp_path / "within.toml", tmp_path / "bare.toml"
    path.write_text(AXIS, encoding="utf-8")
    other.write_text(re.sub(" (±|\\+-|\\+/-) 20 %", "", AXIS).replace("2.56..3.84", "3.2"), encoding="utf-8")
    text, _ = _written(tmp_path, ["compare", str(other), str(path)])
    bare, within = text.split("Inputs of within")
    assert "Tolerances: none given" in bare
    assert "Tolerances: none given" not in within
    assert "9.6 to 14.4 N/µm" in within
    rig = ss.rig_from_text(AXIS)
    assert "none given" not in words(ss.report(ss.simulate(rig, until=0.1), explorer=False).html)


def test_the_speed_of_the_drive_is_told_as_in_the_file_of_the_body_that_it_names():
    """A feed of 30 mm/min was told as 0.15708 rad/s of the motor."""
    chance = np.random.default_rng(33)
    for lead, speed in 10.0 ** chance.uniform(0, 2, (3, 2)):
        rig = ss.rig_from_text(FED.format(lead=lead, speed=speed))
        motor = 2 * math.pi * (speed / 60) / lead
        assert rig.drive.velocity == pytest.approx(motor, rel=1e-5)
        text = words(ss.report(ss.simulate(rig, until=0.01), explorer=False).html)
        shown = re.search(r"drive velocity v.{0,3}0 ([\d.]+) mm/min .*?, that of carriage; in the equations it is that "
                          r"of motor, ([\d.]+ m?rad/s)", text)  # fmt: skip
        assert shown, text
        assert float(shown[1]) == pytest.approx(speed, rel=1e-5)
        assert shown[2] == format_quantity(motor, "rad/s")
