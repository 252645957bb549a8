"""Files to begin with: every combination of laws is a rig that answers, with every key of its laws."""

import re

import pytest

import steadyslip as ss
from command import run
from steadyslip.core.records import key_of
from steadyslip.files.specifications.layout import own_fields, sections
from steadyslip.files.specifications.starter import KINDS, starter_text
from steadyslip.machine.slider import Slider

FAMILIES = {section.name: section.family for section in sections() if section.family is not Slider}
CONTACTS = [name for name in FAMILIES["contact"].registry if name != "compliant" and ":" not in name]


@pytest.mark.parametrize("friction", list(FAMILIES["friction"].registry))
@pytest.mark.parametrize("contact", CONTACTS)
def test_every_law_gives_a_rig_with_all_its_keys(friction, contact):
    if not FAMILIES["friction"].registry[friction].__module__.startswith("steadyslip"):
        pytest.skip("a law of another test")
    for drive in FAMILIES["drive"].registry:
        text = starter_text("rig", friction, contact, drive)
        rig = ss.rig_from_text(text)
        assert (rig.friction.name, rig.contact.name, rig.drive.name) == (friction, contact, drive)
        for law in (type(rig.friction), type(rig.contact), type(rig.drive), Slider):
            missing = [key_of(item) for item, _ in own_fields(law) if f"{key_of(item)} = " not in text]
            assert set(missing) <= {"states"}, missing


@pytest.mark.parametrize("drive", ["steady", "pid"])
@pytest.mark.parametrize("contact", CONTACTS)
def test_commented_values_are_those_of_the_same_slide(contact, drive):
    """Each key that is uncommented alone is read; forces are of a slide, times of a controller."""
    text, faults = starter_text("rig", "lugre", contact, drive), []
    for line in [one for one in text.splitlines() if re.match(r"# [a-z_]+ = ", one)]:
        try:
            ss.rig_from_text(text.replace(line, line.removeprefix("# ")))
        except ss.RigFileError as error:  # of keys that exclude each other, or that need another one
            faults.append(str(error))
    assert not [one for one in faults if re.search("dimension|no unit|not a quantity|allowed: a", one)]
    assert "5 MPa" not in text
    assert 'delay = "1 ms"' in text or drive == "steady"


def test_a_rig_answers_as_it_is(tmp_path):
    path = tmp_path / "axis.toml"
    assert run("init", "-o", path).stdout == f"wrote {path}\n"
    assert run("analyze", path).stdout.startswith("STABLE: steady sliding at 0.5 mm/min")
    assert "exists already" in run("init", "-o", path).stderr
    assert run("init", "--friction", "lugr").stderr.count("did you mean 'lugre'") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_commented_text(kind):
    assert "# " in starter_text(kind)
    assert run("init", kind).stdout.startswith("#")


def test_unknown_kinds_are_refused():
    assert "did you mean 'machine'" in run("init", "machin").stderr
