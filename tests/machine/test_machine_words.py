"""What people are told of machines: which contact, which kick, which parameter, in which unit."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import steadyslip as ss
from command import run
from machines import brake, rate_state, two_mass
from steadyslip.cli import cycle_files as commands
from steadyslip.core.errors import ParameterError
from steadyslip.core.format import format_quantity, format_range
from steadyslip.core.written import display_units
from steadyslip.model.point import operating_point
from steadyslip.motion.status import remedy
from steadyslip.nonlinear.kicks import several_kicks
from steadyslip.nonlinear.kicks.kicks import OF_MACHINES
from steadyslip.nonlinear.kicks.threshold import Threshold
from steadyslip.verdict.words import threshold_words

PAD = brake(rate_state(1.0, -0.1, 1.0, mu=0.3))


def test_an_edge_of_steady_sliding_names_the_contact():
    found = ss.analyze(PAD)
    (edge,) = [one for one in found.boundaries if one.parameter == "bodies.pad.press" and one.kind == "lift-off"]
    assert edge.contact == "disc"
    assert "lift-off at contact disc" in str(edge)
    assert "disc lifts off" in str(found)
    assert "it lifts off" not in str(found)
    (row,) = [r for r in found.to_dict()["boundaries"] if r["kind"] == "lift-off" and r["parameter"].endswith("press")]
    assert row["contact"] == "disc"
    with pytest.raises(ss.NoSteadySliding) as caught:
        ss.steady_state(PAD.with_values({"bodies.pad.press": -5.0}))
    assert caught.value.contact == "disc"


@pytest.mark.parametrize("kick", OF_MACHINES)
@pytest.mark.parametrize("size", [0.0, 0.3, np.inf, np.nan])
def test_every_kick_of_a_machine_can_be_told(kick, size):
    at = "disc" if kick == "normal-force" else "pad"
    one = Threshold(PAD, kick, 1, size, (0.2, 0.4), 0.3, "N", "contact lost", 25.0, survived=0.2, at=at, contact="disc")
    text = threshold_words(one)
    assert f" at {at}" in text
    assert ("more leads to contact lost at disc" in text) == (size == 0.3)
    assert "nan" not in text
    assert "inf" not in text


def test_all_kicks_are_checked_before_the_first_is_computed(monkeypatch):
    monkeypatch.setattr(several_kicks, "threshold", lambda *_, **__: pytest.fail("computed"))
    with pytest.raises(ss.NotAvailable, match="infinite force"):
        ss.analyze(two_mass(kp=4.0), kick=["velocity", "displacement"])
    with pytest.raises(ParameterError, match="unknown body 'tble'"):
        ss.analyze(two_mass(kp=4.0), kick=["velocity", "force at tble"])
    with pytest.raises(ParameterError, match="unknown kick 'push'"):
        several_kicks.thresholds_shown(two_mass(kp=4.0), ("velocity", "push"))


def test_cycles_follow_the_drive_or_link_nearest_to_an_edge(monkeypatch, tmp_path):
    """Of a machine, which has no one stiffness; a parameter of friction only where no other has an edge."""
    path = tmp_path / "axis.toml"
    path.write_text(ss.rig_to_text(two_mass(kp=4.0)), encoding="utf-8")
    asked = []
    branch = SimpleNamespace(at_rig=())
    monkeypatch.setattr(commands, "cycles", lambda rig, along, **_: asked.append(along) or branch)
    monkeypatch.setattr(commands, "own_motion", lambda rig, along: f"of {along}")
    said = []
    commands.cycles_of_file(path, (), None, None, 1, said.append)
    commands.cycles_of_file(path, (), "drive.kd", None, 1, said.append)
    commands.cycles_of_file("examples/stick-slip.toml", (), None, None, 1, said.append)
    assert asked == ["drive.velocity", "drive.kd", "stiffness"]  # 1.45 times as fast, or kp over 1.52
    assert said == ["of drive.velocity", "of drive.kd", "of drive.velocity"]


def test_what_turns_is_in_angles():
    """The integral of an angle, and what pushes shafts."""
    telescope = ss.read_rig("examples/machines/telescope.toml")
    units = {one.name: one.unit for one in operating_point(telescope).model.variables}
    assert units["integral"] == "rad s"
    slides = replace(two_mass(), drive=ss.machine.PositionPID(velocity=1.0, body="motor", kp=1.0, ki=0.1))
    assert {one.name: one.unit for one in operating_point(slides).model.variables}["integral"] == "m s"
    assert ss.simulate(telescope, until=1e-3).units["disturbance"] == "N m"


def test_speeds_stay_in_the_unit_of_the_file_however_small():
    """Rad/s has no prefixes that would read better."""
    with display_units(["rpm", "mm/yr"]):
        assert format_quantity(2.396e-5, "rad/s") == "0.0002288 rpm"
        assert format_quantity(1.0, "m/s") == "1 m/s"


def test_quantities_are_told_in_those_units_of_a_file_in_which_they_read_best():
    """A fault in mm/yr whose friction is told at 1 um/s; areas and inertias in powers of a unit; never ms/m."""
    with display_units(["mm/yr", "um/s", "km^2", "mm^2", "kg cm^2", "kg m^2", "GN/m"]):
        assert format_quantity(1.2675e-9, "m/s") == "40 mm/yr"
        assert format_quantity(1e-6, "m/s") == "1 um/s"
        assert (format_quantity(2e6, "m^2"), format_quantity(1.2e-4, "m^2")) == ("2 km^2", "120 mm^2")
        assert (format_quantity(3e-5, "kg m^2"), format_quantity(0.8, "kg m^2")) == ("0.3 kg cm^2", "0.8 kg m^2")
        assert format_quantity(8e13, "N/m") == "80000 GN/m"
    assert (format_quantity(1.6e14, "N"), format_quantity(0.1, "s/m"), format_quantity(0.1, "s")) == (
        "160 TN",
        "0.1 s/m",
        "100 ms",
    )
    assert format_range(1.432e13, 1.97e13, "N/m") == "14320 to 19700 GN/m"


def test_what_takes_the_load_off_is_told_in_forces_where_the_rig_is():
    block = ss.read_rig("examples/inclined-spring.toml")
    for one, word in ((two_mass(), "force"), (block.with_values({"area": 0.1}), "force"), (block, "stress")):
        assert remedy("contact lost", one).startswith(f"the normal {word} fell to zero")


def test_kicks_of_the_command_line_end_with_words(tmp_path):
    path = tmp_path / "axis.toml"
    path.write_text(ss.rig_to_text(two_mass(kp=1.0)), encoding="utf-8")
    done = run("analyze", path, "--kick", "force at table")
    assert "no force step at table is survived: steady sliding is unstable" in " ".join(done.stdout.split())
    assert json.loads(run("analyze", path, "--kick", "force at table", "--json").stdout)["kicks"][0]["at"] == "table"


def test_edges_that_are_of_little_use_stand_apart():
    """More than a hundredfold off, as on pages; through zero as well."""
    lines = str(ss.analyze(ss.read_rig("examples/machines/brake-pad.toml"))).splitlines()
    apart = next(i for i, line in enumerate(lines) if line.strip() == "further off than a factor of 100:")
    near, far = "\n".join(lines[:apart]), "\n".join(lines[apart:])
    assert "contacts.disc.contact.normal_stiffness  8 N/um" in near
    assert "-4.246" in far
    assert re.search(r"-> -4.246 +to the other sign", far)
    assert "-4.246" not in near
    assert "bodies.pad.press" in near
