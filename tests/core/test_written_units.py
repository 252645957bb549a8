"""Rigs, their results and figures are told in the units of the file that the rig was read from."""

import dataclasses
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from explored import page_modules
from explored_edges import same_text
from guide_and_seal import GUIDE_AND_SEAL
from javascript import Script
from steadyslip.core.dimensions import unit
from steadyslip.core.format import digits_apart, format_quantity, own_units
from steadyslip.core.quantities import parse
from steadyslip.core.written import display_units
from steadyslip.explorer.assembly import _data
from steadyslip.explorer.equations import linear_part
from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
from steadyslip.files.specifications.write import stored_text
from steadyslip.reports.brief import _results_table
from steadyslip.reports.rig import input_table
from steadyslip.verdict.words import format_parameter

EXAMPLES = Path(__file__).parents[2] / "examples"
AXIS = """
[friction]
law = "lugre"
mu_coulomb = 0.11
mu_static = 0.19
v_stribeck = "8 ± 10 % mm/min"
bristle_stiffness = "400 N/um at 3.2 kN"
[contact]
law = "constant"
preload = "3.2 kN"
[slider]
area = "200 cm^2"
stiffness = "12 N/um"
mass = "240 kg"
damping = "5 N s/mm"
[drive]
velocity = "0.5 mm/min"
"""


@pytest.fixture(scope="module")
def axis():
    return ss.rig_from_text(AXIS)


def plain(rig):
    """The same rig in SI, as if built in Python, of laws of its own: those of a file know its units."""
    laws = {name: dataclasses.replace(getattr(rig, name)) for name in ("friction", "contact", "drive")}
    return ss.Slider(**laws, **{name: getattr(rig, name) for name in ("stiffness", "mass", "damping", "area")})


def test_texts_of_results_keep_the_units_of_the_file(axis):
    told = str(ss.analyze(axis))
    for word in ("at 0.5 mm/min", "stiffness 12 N/um is", "N s/mm", "400 N/um at 3.2 kN"):
        assert word in told
    assert "mm/min" in str(ss.steady_state(axis))
    assert "N/um" in str(ss.boundary(axis, "stiffness")[0])
    assert "mm/min" in str(ss.simulate(axis, until=0.1))
    assert "mm/min" not in str(ss.analyze(plain(axis)))


def test_friction_per_load_is_told_at_the_load_that_was_named(axis):
    told = str(ss.analyze(axis))
    assert "bristle_damping" in told
    assert re.search(r"bristle_damping +0 N s/mm at 3\.2 kN +-> [\d.]+ N s/mm at 3\.2 kN", told)
    assert " s/m " not in told


def test_stored_results_are_told_in_them(axis, tmp_path):
    over = {"stiffness": ["10 N/um", "14 N/um"]}  # totals, as in the file
    found, run = ss.run_map(ss.Map(axis, over), tmp_path / "map.zarr"), ss.simulate(axis, until=0.1)
    assert found.dataset["slider.stiffness"].values * 0.02 == pytest.approx([10e6, 14e6])
    run.save(tmp_path / "run.nc")
    for one, again in ((found, ss.open_map(tmp_path / "map.zarr")), (run, ss.load_history(tmp_path / "run.nc"))):
        assert str(again) == str(one)
        assert set(again.rig.written_in) >= {"N/um", "mm/min", "N/um at 3.2 kN"}
    assert "N/um" in str(found)
    with pytest.raises(ss.ParameterError, match="has the wrong dimension"):
        ss.Map(axis, {"stiffness": ["10 N"]})


def test_units_are_no_part_of_the_value_and_leak_nowhere(axis):
    assert axis == plain(axis)
    assert hash(axis) == hash(plain(axis))
    str(ss.analyze(axis))
    assert format_quantity(axis.drive.velocity, "m/s") == "8.333 um/s"
    assert pickle.loads(pickle.dumps(axis)).written_in == axis.written_in


def test_a_changed_rig_keeps_them_and_gains_those_of_its_values(axis):
    changed = axis.with_values({"velocity": "60 mm/h"})
    assert "at 60 mm/h" in str(ss.steady_state(changed))
    assert "N/um" in str(ss.boundary(changed, "stiffness")[0])


def test_a_copy_by_dataclasses_keeps_them_and_other_rigs_do_not_get_them(axis):
    copy = dataclasses.replace(axis, stiffness=1.1 * axis.stiffness)
    assert set(copy.written_in) == set(axis.written_in) != set()
    assert "N/um" in str(ss.analyze(copy)).splitlines()[1]
    assert not plain(axis).written_in


def test_figures_and_fragments_have_them(axis):
    run = ss.simulate(axis, until=0.1)
    for axes in (run.plot(), ss.figures.history(run)):
        assert "velocity (mm/min)" in [one.get_ylabel() for one in np.ravel(axes)]
    chart = ss.figures.stability_chart(axis, "velocity", "stiffness")
    assert "(mm/min)" in chart.get_xlabel()
    assert "(N/µm)" in chart.get_ylabel()
    assert "mm/min" in ss.analyze(axis)._repr_html_()


def test_an_edge_and_its_value_are_told_at_the_load_of_their_contact():
    """Two contacts, each with a load: 4 s/m at 60 N are 240 N s/m, as in the file; the seal has no load of 500 N."""
    rig = ss.rig_from_text(GUIDE_AND_SEAL)
    for text, then in ((str(ss.analyze(rig)), " +-> "), (str(ss.cure(rig)), " now; from ")):
        assert re.search(rf"guide\.friction\.viscous +250 N s/m at 500 N{then}[\d.]+ N s/m at 500 N", text)
        assert re.search(rf"seal\.friction\.viscous +240 N s/m at 60 N{then}[\d.]+ N s/m at 60 N", text)
    assert rig.load_of("contacts.seal.friction.viscous") == 60.0
    assert rig.load_of("bodies.carriage.mass") is None


def _two_contacts(chance):
    """File of a carriage on two contacts with loads, units and loads of bristles drawn at random, and its texts."""
    names = {"v_stribeck": ("mm/s", "mm/min", "um/s"), "bristle_stiffness": ("N/um", "N/mm")}
    text, written = "[bodies.carriage]\nmass = '35 kg'\n", {}
    for contact in ("guide", "seal"):
        load, at = (f"{chance.integers(1, 900)} {chance.choice(['N', 'kN'])}" for _ in range(2))
        own = {name: f"{chance.integers(1, 900)} {chance.choice(units)}" for name, units in names.items()}
        own["bristle_stiffness"] += f" at {at}"
        text += f"[contacts.{contact}]\nbody = 'carriage'\ncontact = {{ law = 'constant', preload = '{load}' }}\n"
        text += "friction = { law = 'lugre', mu_coulomb = 0.1, mu_static = 0.2, "
        text += ", ".join(f"{name} = '{value}'" for name, value in own.items()) + " }\n"
        written |= {f"contacts.{contact}.friction.{name}": value for name, value in own.items()}
        written |= {f"contacts.{contact}.contact.preload": load}
    speed = f"{chance.integers(1, 900)} {chance.choice(names['v_stribeck'])}"
    text += f"[links.belt]\nbetween = ['drive', 'carriage']\nstiffness = '1 N/um'\n[drive]\nvelocity = '{speed}'\n"
    return text, written | {"drive.velocity": speed}


@pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")
def test_every_parameter_is_told_in_the_unit_and_at_the_load_of_its_own_text():
    """With several units of a kind in a file; bristles of a nut at 6 kN were told at the 4 kN of another contact."""
    chance = np.random.default_rng(33)
    for _ in range(60):
        text, written = _two_contacts(chance)
        rig = ss.rig_from_text(text)
        for one in (rig, rig.with_values({"bodies.carriage.mass": 40.0}), ss.rig_from_text(stored_text(rig))):
            with display_units(one.written_in):
                assert {name: format_parameter(one, name, one.value(name)) for name in written} == written
        with display_units(rig.written_in):
            for contact in ("guide", "seal"):  # what has no text is told at the load of its contact
                load = rig.load_of(f"contacts.{contact}.friction.viscous")
                shown = format_parameter(rig, f"contacts.{contact}.friction.viscous", 2.0)
                force, _, at = shown.partition(" at ")
                assert parse(at, "N") == pytest.approx(load)
                assert parse(force, "N s/m") == pytest.approx(2.0 * load, rel=1e-3)


def test_speeds_are_told_in_the_unit_of_the_drive():
    """Of a file that has others too: that of a press at 0.8 mm/s was told as 48 mm/min."""
    text = AXIS.replace('"0.5 mm/min"', '"0.01 mm/s"')
    told = str(ss.analyze(ss.rig_from_text(text)))
    assert "steady sliding at 0.01 mm/s" in told
    assert re.search(r"v_stribeck +8 mm/min", told)


def test_values_that_are_not_known_and_tolerances_are_told_at_the_load_of_the_file(tmp_path):
    text = GUIDE_AND_SEAL.replace("0.4 N/um at 60 N", "0.4 ± 20 % N/um at 70 N")
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    rig, tolerances = rig_and_tolerances(path)
    found = ss.tolerate(rig, tolerances)
    assert "0.32 to 0.48 N/um at 70 N alone" in str(found)
    with display_units(rig.written_in):
        assert "0.4 N/µm at 70 N" in input_table(rig).replace("\xa0", " ")
    found = ss.verdict.stable_within(rig, {"contacts.seal.friction.bristle_stiffness": (1e3, 1e4)})
    assert "0.07 N/um at 70 N to 0.7 N/um at 70 N" in str(found)


@pytest.mark.parametrize(
    ("units", "value", "si", "text"),
    [
        (["mm/s"], 8.333e-6, "m/s", "0.008333 mm/s"),
        (["mm/s"], 8e-7, "m/s", "800 nm/s"),
        (["um/s"], 4.73e-3, "m/s", "4730 um/s"),
        (["um/s"], 0.1136, "m/s", "113.6 mm/s"),
        (["um/s", "mm/s"], 0.1136, "m/s", "113.6 mm/s"),
        (["N m/rad"], 0.05, "N m/rad", "0.05 N m/rad"),
        (["N m/rad"], 12e3, "N m/rad", "12 kN m/rad"),
        (["arcsec/s"], 7.2921e-5, "rad/s", "15.04 arcsec/s"),
        (["arcsec/s"], 0.02625, "rad/s", "1.504 deg/s"),
        (["arcsec/s"], 4.564e-6, "rad", "0.9414 arcsec"),
        (["arcsec"], 7.2921e-5, "rad/s", "15.04 arcsec/s"),
        (["deg"], 4.564e-6, "rad", "0.9414 arcsec"),
        ([], 4.564e-6, "rad", "0.9414 arcsec"),
        ([], -0.7853981633974483, "rad", "-45 deg"),
        (["rpm"], 10.0, "rad/s", "95.49 rpm"),
        (["kN"], 393.55, "N", "393.6 N"),
        (["ms"], 4.924, "s", "4.924 s"),
    ],
)
def test_speeds_and_angles_keep_the_scale_of_the_file(units, value, si, text):
    """Within four digits; forces, lengths and times, of which a file has some of other sizes, do not."""
    with display_units(units):
        assert format_quantity(value, si) == text


def test_a_page_tells_speeds_and_angles_alike():
    chance, script = np.random.default_rng(33), Script(f"{page_modules()}")
    for _ in range(200):
        units = [str(one) for one in chance.choice(["mm/s", "um/s", "arcsec/s", "arcsec", "deg", "rpm", "N m/rad"], 2)]
        si, value = str(chance.choice(["m/s", "rad", "rad/s", "N m/rad"])), float(10 ** chance.uniform(-9, 6))
        own = own_units(frozenset(units)).get(unit(si)[1], ())
        written = {si: [(name, unit(name)[0]) for name in own]} if own else {}
        with display_units(units):
            told = format_quantity(value, si)
        none = dict.fromkeys(("m/s", "rad", "rad/s", "N m/rad"))
        shown = script("(tellIn(units), shown(value, si))", units=none | written, value=value, si=si)
        assert same_text(shown, told) or "e" in told, (units, value, si)


def test_close_values_are_told_apart():
    for gap in 10.0 ** np.arange(-11.0, 0.0):
        value, other = 1.0, 1.0 + 2 * gap
        many = digits_apart(value, other)
        assert format_quantity(value, "m", many) != format_quantity(other, "m", many)
    assert digits_apart(1.0, 1.0) == digits_apart(0.0, 1.0) == 4


FAMILIES = {
    "forces": ({}, "N", "N/µm", ("kN", "N/um")),
    "stresses": ({'"12 N/um"': '"0.6 GPa/m"', '"240 kg"': '"12 t/m^2"', '"5 N s/mm"': '"250 kPa s/m"',
                  '"400 N/um at 3.2 kN"': '"125000 1/m"', 'preload = "3.2 kN"': 'preload = "0.16 MPa"'}, "Pa", "MPa/m",
                 ("MPa", "GPa/m")),
    "both": ({'preload = "3.2 kN"': 'preload = "0.16 MPa"'}, "Pa", "N/µm", ("MPa", "N/um")),
    "numbers": ({'"12 N/um"': "12e6", '"240 kg"': "240", '"5 N s/mm"': "5e3", '"400 N/um at 3.2 kN"': '"125000 1/m"',
                 'preload = "3.2 kN"': "preload = 3200"}, "N", "MN/m", ("kN", "MN/m")),
}  # fmt: skip
"""The axis as its author may write it: changes of the text, then units in which stress and stiffness are told, and
those of the file, in which the values and edges of preload and stiffness are told."""


def test_a_parameter_is_told_in_its_own_unit_on_a_page_as_in_python():
    """Edges far from the value too, as of a preload in kN below one."""
    text = AXIS.replace(" ± 10 %", "").replace('"240 kg"', '"0.24 t"').replace('"200 cm^2"', '"0.02 m^2"')
    rig = ss.rig_from_text(text)
    _, facts = linear_part(rig)
    data = _data(rig, "rig", 0, facts, text)
    script = Script(f"{page_modules()}\ntellIn({json.dumps(data['written'])});")
    for one in data["parameters"]:
        given = rig.value(one["name"])
        if one["unit"] == "1" or not given:
            continue
        for many in (4e-3, 0.03, 0.7, 1.0, 33.0, 300.0):
            shown = script("told(one, value)", one={"factor": 1, "own": ["", 1, ""]} | data["usual"] | one,
                           value=one["value"] * many)  # fmt: skip
            with display_units(rig.written_in):
                assert same_text(shown, format_parameter(rig, one["name"], given * many)), (one["name"], many)


def test_forces_of_a_file_in_newtons_stay_so():
    """A preload of 5500 N was told as 5.5 kN beside a shear force of 782.9 N, and damping in kN s/m beside N s/mm."""
    text = AXIS.replace("3.2 kN", "5500 N").replace('"12 N/um"', '"2e6 N/m"').replace('"5 N s/mm"', '"8000 N s/m"')
    told = str(ss.analyze(ss.rig_from_text(text)))
    assert re.search(r"normal force 5500 N \(.*\), shear force [\d.]+ N \(", told)
    assert re.search(r"contact.preload +5500 N +-> [\d.]+ N ", told)
    assert re.search(r"friction.bristle_damping +0 N s/m at 5500 N +-> [\d.e+]+ N s/m at 5500 N ", told)
    assert "kN s/mm" not in told


def test_an_area_given_later_makes_forces():
    """Of a file in stresses without one, as the documents say."""
    stresses = ss.read_rig(EXAMPLES / "inclined-spring.toml")
    assert "normal stress 16.67 MPa" in str(ss.steady_state(stresses))
    assert "normal force 166.7 kN" in str(ss.steady_state(dataclasses.replace(stresses, area=0.01)))


@pytest.mark.parametrize("family", FAMILIES)
def test_a_file_is_told_in_the_forces_or_stresses_that_it_is_written_in(family, tmp_path):
    """Each quantity in its own; a file in MPa with an area was told in forces, in texts, figures, maps and pages."""
    changes, pressed, stiff, (preload, own_stiff) = FAMILIES[family]
    text = AXIS
    for one, other in changes.items():
        assert one in text
        text = text.replace(one, other)
    rig = ss.rig_from_text(text)
    word = {"N": "force", "Pa": "stress"}[pressed]
    told, plain_stiff = str(ss.analyze(rig)), stiff.replace("µ", "u")
    assert re.search(rf"normal {word} [\d.]+ k{pressed} \(", told)
    assert re.search(
        rf"the stiffness [\d.]+ {own_stiff} is [\d.]+ times the critical stiffness [\d.]+ {own_stiff}\b", told
    )
    assert re.search(rf"contact.preload +[\d.]+ {preload} +-> [\d.]+ {preload} ", told)
    assert re.search(rf"normal {word} +[\d.]+ k{pressed} to", str(ss.simulate(rig, until=0.1)))
    assert re.search(rf"normal {word} [\d.]+ k{pressed}, shear {word}", str(ss.steady_state(rig)))
    assert str(ss.boundary(rig, "stiffness")[0]).split()[3] == f"{plain_stiff}:"
    chart = ss.figures.stability_chart(rig, "preload", "stiffness")
    assert (f"(k{pressed})" in chart.get_xlabel(), f"({stiff})" in chart.get_ylabel()) == (True, True)
    found = ss.run_map(ss.Map(rig, {"stiffness": [0.5e9, 0.8e9]}), tmp_path / "map.zarr")
    assert plain_stiff in str(found)
    assert str(ss.open_map(tmp_path / "map.zarr")) == str(found)
    page = ss.explore(rig).html
    area = '"area":null' if pressed == "Pa" else '"area":0.02'
    assert area in page


def test_rates_and_frequencies_are_told_in_their_own_units():
    """With Kv in 1/min a mode was told at 331.7 1/min, and in a file with rpm the frequency of an edge in rpm."""
    with display_units(["1/min", "rpm"]):
        assert format_quantity(5.0, "Hz") == "5 Hz"
        assert format_quantity(20.0, "1/s") == "1200 1/min"
    edge = ss.boundary(ss.rig_from_text(AXIS), "stiffness")[0]
    with display_units(["1/min", "rpm"]):
        table = _results_table([edge], 1.0)
    assert f"{edge.angular_frequency:.4g} rad/s" in re.sub("<[^>]+>", "", table).replace("\xa0", " ")
