"""Units all the way: a machine without areas is in forces, one with an area too; text is read as its user writes it."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run
from machines import three_bodies, two_mass

FOLDER = Path(__file__).parents[2] / "examples" / "machines"
AXIS = ss.read_rig(FOLDER / "feed-axis.toml")
TELESCOPE = ss.read_rig(FOLDER / "telescope.toml")
SHEAR = ss.read_rig(FOLDER / "two-surfaces.toml")


@pytest.mark.usefixtures("unpainted")
def test_no_stress_is_spoken_of_where_nobody_gave_an_area():
    for machine in (AXIS, TELESCOPE, two_mass(), three_bodies()):
        found = ss.analyze(machine)
        texts = [str(found), found.to_json(), str(found.steady), machine._repr_html_(), found._repr_html_()]
        texts += [str(edge) for edge in found.boundaries]
        for text in texts:
            assert not re.search(r"\b[kMG]?Pa\b", text)
        assert not [one.role.doc for one in machine.parameters().values() if one.role.doc.startswith("normal stress")]
    (row,) = [r for r in ss.analyze(AXIS).to_dict()["boundaries"] if r["parameter"].endswith("preload")]
    assert row["unit"] == "N"
    assert row["value"] == pytest.approx(11105.535448629415)
    assert "total" not in row


def test_with_an_area_totals_stand_beside_stresses():
    (row, *_) = [
        r for r in ss.analyze(SHEAR).to_dict()["boundaries"] if r["parameter"].endswith("first.contact.preload")
    ]
    assert row["unit"] == "Pa"
    assert (row["total_unit"], row["total"]) == ("N", pytest.approx(row["value"] * 25e-4))


def test_stresses_of_a_contact_are_printed_as_stresses():
    """As the file and the page have them: the areas of contacts may differ, and vary."""
    found = ss.analyze(SHEAR)
    (line,) = [one for one in str(found).splitlines() if one.strip().startswith("contacts.first.contact.preload")]
    assert "15 MPa" in line
    assert "kN" not in line
    edge = next(one.edge for one in found.margins if one.parameter == "contacts.first.contact.preload")
    assert "MPa" in str(edge)


@pytest.mark.parametrize("machine", [AXIS, SHEAR], ids=["no area", "area"])
def test_text_is_read_in_the_units_of_its_user(machine):
    name = "contacts.first.contact.preload" if machine is SHEAR else "contacts.guide.contact.preload"
    area = 25e-4 if machine is SHEAR else 1.0
    assert machine.with_values({name: "4 kN"}).value(name) == pytest.approx(4e3 / area)
    edges = ss.boundary(machine, name, between=("1 kN", "900 kN"))
    assert edges == ss.boundary(machine, name, between=(1e3 / area, 9e5 / area))
    assert ss.growth_rate(machine, {name: "4 kN"}) == ss.growth_rate(machine, {name: 4e3 / area})
    with pytest.raises(ss.ParameterError, match=name):
        machine.with_values({name: "4 m"})
    with pytest.raises(ss.ParameterError, match=name):
        ss.growth_rate(machine, {name: "4 m"})


def test_a_slider_with_an_area_reads_forces_too():
    rig = ss.read_rig(FOLDER.parent / "slow-axis.toml")
    assert rig.with_values({"preload": "800 N"}).value("preload") == pytest.approx(800 / 40e-4)
    assert ss.growth_rate(rig, {"preload": "800 N"}) == ss.growth_rate(rig, {"preload": 800 / 40e-4})
    plain = replace(rig, area=None)
    with pytest.raises(ss.ParameterError, match="area"):
        plain.with_values({"preload": "800 N"})


def test_a_wrong_number_is_refused_in_the_unit_of_its_user():
    with pytest.raises(ss.ParameterError, match="in N"):
        ss.growth_rate(AXIS, {"contacts.guide.contact.preload": [-1.0]})
    done = run("analyze", str(FOLDER / "feed-axis.toml"), "--set", "preload=-1")
    assert done.returncode == 2
    assert "in N, or text" in done.stderr
    done = run("analyze", str(FOLDER / "feed-axis.toml"), "--set", "links.screw.lead=10 mm")
    assert "such as '10 mm/rev'" in done.stderr or "for example '10 mm/rev'" in done.stderr


def test_shafts_carry_torques_and_links_say_what_they_carry():
    steady = ss.steady_state(TELESCOPE)
    assert steady.units["links.worm"] == "N m"
    assert "worm carries 70.94 N m" in str(steady)
    assert steady.links["worm"] == pytest.approx(118.22810569583844 * 0.6)
    data = json.loads(ss.analyze(TELESCOPE).to_json())["steady"]
    assert data["units"] == {"drive": "rad/s", "motor": "rad/s", "tube": "rad/s", "links.worm": "N m"}
    axis = ss.steady_state(AXIS)
    assert (axis.units["links.screw"], axis.units["table"], axis.units["motor"]) == ("N", "m/s", "rad/s")


def test_what_is_zero_is_searched_around_a_size_of_its_own():
    """Mass and damping that are not there: of forces, the size that stresses with area one have."""
    slider = ss.Slider(
        friction=ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-6),
        contact=ss.laws.ConstantNormalStress(preload=5e6),
        stiffness=1e9, drive=ss.machine.SteadyDrive(1e-6),
    )  # fmt: skip
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody()},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=1e9)},
        contacts={"slide": ss.machine.Surface(body="block", friction=slider.friction, contact=slider.contact)},
        drive=ss.machine.Pull(velocity=1e-6),
    )
    for mine, other in (("slider.damping", "links.spring.damping"), ("slider.mass", "bodies.block.mass")):
        one, two = ss.boundary(slider, mine), ss.boundary(machine, other)
        assert [e.value for e in two] == pytest.approx([e.value for e in one], rel=1e-8)
    assert np.isfinite(ss.boundary(machine, "links.spring.damping")[0].value)


def test_constructors_take_text_in_the_units_of_their_user():
    """Forces of a contact without area; with one, forces and stresses alike; sliders with an area too."""
    rock = ss.laws.RateState(a=0.01, b=0.015, d_c="5 um", mu_ref=0.6, v_ref="1 um/s")

    def surface(preload, **area):
        return ss.machine.Surface(
            body="block", friction=rock, contact=ss.laws.ConstantNormalStress(preload=preload), **area
        )

    assert surface("3 kN") == surface(3e3)
    assert surface("3 kN", area="50 cm^2") == surface("600 kPa", area="50 cm^2") == surface(6e5, area=50e-4)
    assert type(surface("3 kN").contact.preload) is float
    soft = ss.machine.Surface(
        body="pad", friction=rock, contact=ss.laws.Compliant(normal_stiffness="8 N/um", normal_damping="2 N s/m")
    )
    assert (soft.contact.normal_stiffness, soft.contact.normal_damping) == (8e6, 2.0)

    def slider(**further):
        return ss.Slider(
            friction=rock, contact=ss.laws.ConstantNormalStress(preload="600 N"), mass="8 kg", damping="5 N s/m",
            drive=ss.machine.PD("20 um/s", kp="0.6 N/um"), **further,
        )  # fmt: skip

    rig = slider(area="40 cm^2")
    assert (rig.contact.preload, rig.mass, rig.damping, rig.drive.kp) == pytest.approx((1.5e5, 2e3, 1250.0, 1.5e8))
    assert {type(one.value) for one in rig.parameters().values() if one.value is not None} == {float}
    assert replace(rig, stiffness="1 N/um").stiffness == pytest.approx(2.5e8)
    with pytest.raises(ss.ParameterError) as caught:
        slider()
    assert {p.name for p in caught.value.problems} == {"contact.preload", "slider.mass", "slider.damping", "drive.kp"}
    assert "give the contact's area" in str(caught.value)
    for wrong in ("-3 kN", "3 m", "3 kN kN"):
        with pytest.raises(ss.ParameterError, match="preload"):
            surface(wrong)


def test_a_law_that_waits_for_its_area_says_its_numbers():
    waiting = ss.laws.ConstantNormalStress(preload="3 kN")
    assert repr(waiting) == "ConstantNormalStress(preload=3000.0)"
    assert replace(waiting, preload="4 kN").preload == 4e3
