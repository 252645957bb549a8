"""A speed without a unit that others make doubtful is questioned, once, wherever the file is read."""

import warnings
from pathlib import Path

import pytest

import steadyslip as ss
from steadyslip.core.errors import UnitWarning

SLIDER = """
friction = {{law = "lugre", mu_coulomb = 0.1, mu_static = 0.2, v_stribeck = {v_stribeck}, bristle_stiffness = 1e5}}
contact = {{law = "constant", preload = "1 kPa"}}
slider = {{stiffness = "1 MPa/m"}}
drive = {{velocity = {velocity}}}
"""
ASKED = {
    "0.5 beside mm/s": ("0.5", '"1 mm/s"', "velocity = 0.5 has no unit and is read as 0.5 m/s; other .* in mm/s"),
    "20 beside mm/s": ("20", '"1 mm/s"', "read as 20 m/s; other"),
    "the friction's": ('"0.5 mm/min"', "0.02", "friction.v_stribeck = 0.02 has no unit"),
    "20, and no speed has a unit": ("20", "1e-5", r"read as 20 m/s, 2e\+06 times friction\.v_stribeck, 10 um/s"),
}
NOT_ASKED = {
    "it has a unit": ('"20 m/s"', '"1 mm/s"'),
    "another is in m/s": ("0.5", '"0.001 m/s"'),
    "so small that only m/s is meant": ("8e-6", '"1 mm/s"'),
    "nearer to the other in m/s": ("0.01", '"1 mm/s"'),
    "slow, and no speed has a unit": ("0.9", "1e-5"),
    "a law as fast": ("20", "1.0"),
}


@pytest.mark.parametrize(("velocity", "v_stribeck", "words"), ASKED.values(), ids=ASKED)
def test_a_doubtful_speed_is_asked_once(velocity, v_stribeck, words):
    with pytest.warns(UnitWarning, match=words) as caught:
        ss.rig_from_text(SLIDER.format(velocity=velocity, v_stribeck=v_stribeck))
    assert len(caught) == 1


@pytest.mark.parametrize(("velocity", "v_stribeck"), NOT_ASKED.values(), ids=NOT_ASKED)
def test_a_clear_speed_is_not(velocity, v_stribeck):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.rig_from_text(SLIDER.format(velocity=velocity, v_stribeck=v_stribeck))


def test_a_file_of_numbers_alone_is_in_si_units():
    text = SLIDER.format(velocity="20", v_stribeck="1e-5").replace('"1 kPa"', "1e3").replace('"1 MPa/m"', "1e6")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rig = ss.rig_from_text(text)
        assert ss.rig_from_text(ss.rig_to_text(rig)) == rig


def test_the_speed_of_a_turning_drive_is_asked_for_in_rpm_and_that_of_the_table_in_m_per_s():
    text = Path("examples/machines/feed-axis.toml").read_text()
    assert 'velocity = "' in text
    bare = text.replace('velocity = "0.05 rpm"', 'velocity = 0.3\nvelocity_of = "table"')
    assert bare != text
    with pytest.warns(UnitWarning, match=r"velocity = 0.3 has no unit and is read as 0.3 m/s; other") as caught:
        ss.rig_from_text(bare)
    assert len(caught) == 1


def test_friction_that_is_smaller_at_rest_is_asked_about():
    text = SLIDER.format(velocity='"1 mm/s"', v_stribeck='"2 mm/s"').replace("mu_static = 0.2", "mu_static = 0.05")
    words = r"friction.mu_static = 0.05 is smaller than mu_coulomb = 0.1: friction rises"
    with pytest.warns(UnitWarning, match=words) as caught:
        ss.rig_from_text(text)
    assert len(caught) == 1


def test_what_two_contacts_share_is_asked_once():
    guide = """
    [contacts.{}]
    body = "table"
    friction = {{law = "coulomb-stribeck", mu_coulomb = 0.1, mu_static = 0.05, v_stribeck = "1 mm/s"}}
    contact = {{law = "constant", preload = "1 kN"}}
    """
    text = """
    bodies = {table = {mass = "10 kg"}}
    links = {screw = {between = ["drive", "table"], stiffness = "10 N/um"}}
    drive = {velocity = "5 mm/s"}
    """
    with pytest.warns(UnitWarning, match=r"^contacts.front and contacts.rear: friction.mu_static = 0.05 is") as caught:
        ss.rig_from_text(text + guide.format("front") + guide.format("rear"))
    assert len(caught) == 1
