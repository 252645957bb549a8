"""Mistakes that one makes when a data sheet becomes a rig file: each is answered once, with what to write instead."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from data_sheets import SHEETS
from steadyslip.core.errors import UnitWarning
from toleranced import AXIS

MISTAKES = {
    "a mass for a force": ('"2.56..3.84 kN"', '"320 kg"', "a mass presses with its weight"),
    "a weight for a mass": ('"240 kg"', '"2354 N"', "it is the weight of 240 kg"),
    "a per cent sign behind the unit": (
        '"2.56..3.84 kN"',
        '"3.2 ± 20 kN %"',
        "the per cent sign must follow its number",
    ),
    "a range in words": ('"2.56..3.84 kN"', '"2.56 to 3.84 kN"', "or '10..14 N/um'"),
    "a distribution of another name": ('"2.56..3.84 kN"', '"3.2 ± 0.2 kN (gauss)"', "'12 ± 2 N/um (normal)'"),
    "a decimal comma": ('"0.11 ± 20 %"', "0,11", "0,11 has a decimal comma: write 0.11"),
    "a decimal comma before a unit": ('"0.5 mm/min"', '"0,5 mm/min"', "has a decimal comma: write 0.5"),
    "a decimal comma in a tolerance": ('"0.11 ± 20 %"', '"0.11 ± 0,02"', "has a decimal comma: write 0.11 ± 0.02"),
    "a decimal comma before an exponent": ('"240 kg"', '"2,4e2 kg"', "has a decimal comma: write 2.4e2 kg"),
    "no digit before the point": ('"0.11 ± 20 %"', ".11", "a number begins with a digit, as in 0.8"),
    "no digit before the point and no unit": ('"240 kg"', '".5"', "write for example '0.5 kg'"),
    "a key without its mark": ("mu_static =", "MuStatic =", "did you mean 'mu_static'"),
    "a law by its curve": ('"lugre"', '"stribeck"', "did you mean 'coulomb-stribeck'"),
    "a key in another language": ("mass =", "masse =", "did you mean 'mass'"),
    "a share without its sign": ('"2.56..3.84 kN"', '"3.2 kN ± 20"', "write '± 20 %'"),
    "no load named": ('"125000 ± 20 % 1/m"', '"400 N/um"', "name the load that it is of: '400 N/um at 3.2 kN'"),
    "no contact area": ('area = "200 cm^2"\n', "", "add the contact's area"),
    "a unit on a pure number": ("0.8", '"0.8 mm"', "expected a number without unit"),
    "a ratio that may be read both ways": ("0.8", '"1:100"', 'write "1/100" or "100/1"'),
    "a full stop behind a unit": ('"0.5 mm/min"', '"0.5 mm/min."', "'mm/min.' is not a unit"),
    "a letter for a key": ("mu_static =", "mu_s =", "unknown key 'mu_s'; did you mean 'mu_static'"),
    "a unit without quotes": ('"0.5 mm/min"', "0.5 mm/min", "'velocity = 0.5 mm/min'; a number with a unit stands in"),
    "a comment of another language": ("[drive]", "// feed\n[drive]", "a comment begins with #"),
    "a colon": ("mass =", "mass:", "write KEY = VALUE"),
    "a quote left open": ('"240 kg"', '"240 kg', "a text ends on its line with the quote"),
    "a table in two places": ("[drive]", "[friction]\n[drive]", "the table [friction] is there before"),
    "capital units": ('"240 kg"', '"240 KG"', "did you mean kg?"),
    "a word that begins with inf": ('"12 ± 20 % N/um"', '"infinite"', "'infinite' is not a quantity in N/m"),
    "a key in the wrong table": ("area =", 'preload = "3 kN"\narea =', "it is a key of [contact]"),
    "a word for two tables": ("[contact]", "[guide]", "unknown table 'guide'; allowed"),
    "a place held by a load point": ('"0.5 mm/min"', "0", "0 to hold a place with control = 'pid'"),
    "a force for a coefficient": (
        'mu_coulomb = "0.11 ± 20 %"',
        'mu_coulomb = "350 N"',
        "expected a number without unit",
    ),
}


MACHINE = (Path(__file__).parents[2] / "examples/machines/feed-axis.toml").read_text(encoding="utf-8")
MISTAKES_OF_MACHINES = {
    "a pitch for a lead": ("lead =", "pitch =", "did you mean 'lead'"),
    "an area of a law": ('preload = "3 kN"', 'preload = "3 kN"\narea = "1 m^2"', "it is a key of [contacts.NAME]"),
    "a stiffness for what turns": ('"120 N/um"', '"120 N m/rad"', "at a radius, divide by its square"),
    "a mass for an inertia": ('"40 kg cm^2"', '"40 kg"', "expected a quantity in kg m^2, for example '1 kg m^2'"),
    "a speed of what turns": ('v_ref = "1 mm/s"', 'v_ref = "6.5 rad/s"', "at a radius, multiply by the radius"),
    "a diameter": ("[contacts.guide]", '[contacts.guide]\ndiameter = "40 mm"', "did you mean 'radius'"),
    "a torque for a force": ('"3 kN"', '"3 Nm"', "at a radius, divide by the radius"),
    "bristles of what turns": ('"5 um"', '"5 deg"', "at a radius, multiply by the radius"),
}


ALL = [(AXIS, name, *one) for name, one in MISTAKES.items()]
ALL += [(MACHINE, name, *one) for name, one in MISTAKES_OF_MACHINES.items()]


@pytest.mark.parametrize(("text", "right", "wrong", "answer"), [pytest.param(t, *rest, id=n) for t, n, *rest in ALL])
def test_a_mistake_is_answered_by_what_to_write(text, right, wrong, answer):
    mistaken = text.replace(right, wrong, 1)
    assert mistaken != text
    with pytest.raises(ss.RigFileError, match=re.escape(answer)) as raised:
        ss.rig_from_text(mistaken)
    assert text is AXIS or "per unit area" not in str(raised.value)  # a machine's sizes are totals


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("[bodies.", "[body."), ("[links.", "[link."), ("[contacts.", "[contact."), ("[drive]", "[drives]")],
)
@pytest.mark.parametrize("count", [1, -1])
def test_a_misspelt_table_is_one_problem_on_its_line(right, wrong, count):
    mistaken = MACHINE.replace(right, wrong, count)
    name = wrong.strip("[].")
    line = next(i for i, one in enumerate(mistaken.splitlines(), start=1) if one.startswith(wrong))
    with pytest.raises(ss.RigFileError) as raised:
        ss.rig_from_text(mistaken)
    (problem,) = raised.value.problems
    assert problem.line == line
    assert f"unknown table {name!r}; did you mean {right.strip('[].')!r}?" in problem.message


def test_a_part_under_nearly_the_name_of_its_contact_is_one_problem():
    """There were three: two of what the misspelt one lacks, and one of what the other does."""
    text = SHEETS["telescope worm"].replace("[contacts.bearing.contact]", "[contacts.bearings.contact]")
    with pytest.raises(ss.RigFileError, match=r"only contact, which contacts\.bearing lacks; did you mean 'bearing'"):
        ss.rig_from_text(text)
    both = MACHINE + '[bodies.tables]\nmotion = "rotation"\n'  # a body of its own, joined to nothing
    with pytest.raises(ss.RigFileError) as raised:
        ss.rig_from_text(both)
    assert "did you mean" not in str(raised.value)


def test_a_misspelt_table_hides_no_other_problem():
    with pytest.raises(ss.RigFileError) as raised:
        ss.rig_from_text(MACHINE.replace("[bodies.", "[body.").replace('"300 kg"', '"300 m"'))
    assert [one.name for one in raised.value.problems] == ["body", "bodies.table.mass"]


@pytest.mark.parametrize(
    ("right", "wrong", "answer"),
    [
        ("v_stribeck =", "v_stribek =", "unknown key 'v_stribek'; did you mean 'v_stribeck'?"),
        ("mu_coulomb =", "mu_coulom =", "unknown key 'mu_coulom'; did you mean 'mu_coulomb'?"),
        ("preload =", "preloat =", "unknown key 'preloat'; did you mean 'preload'?"),
        ("[contact]", "[contacts]", "unknown table 'contacts'; did you mean 'contact'?"),
        ('"240 kg"', '"-240 kg"', "got -240.0; allowed: a finite number >= 0 in kg,"),
    ],
)
def test_a_mistake_has_one_message(right, wrong, answer):
    with pytest.raises(ss.RigFileError) as raised:
        ss.rig_from_text(AXIS.replace(right, wrong, 1))
    (problem,) = raised.value.problems
    assert problem.message.startswith(answer)
    assert problem.line


@pytest.mark.parametrize(
    ("wrong", "answer"),
    [
        (
            "sample_time = 0",
            "sample_time: got 0; allowed: a finite number > 0 in s, or text such as '1 ms'; or leave it out",
        ),
        ('sample_time = "1 mm"', "expected a quantity in s, for example '1 ms'"),
        ('delay = "2 mm"', "expected a quantity in s, for example '2 ms'"),
    ],
)
def test_times_of_controllers_have_examples_of_their_size(wrong, answer):
    """A dead time of 10 s is none."""
    text = AXIS.replace('velocity = "0.5 mm/min"', f'velocity = 0\ncontrol = "pid"\nkp = "9 N/um"\nki = 0\n{wrong}')
    with pytest.raises(ss.RigFileError, match=re.escape(answer)):
        ss.rig_from_text(text)


def test_a_stiffness_without_a_unit_is_asked_about():
    """12 N/m of an axis that 3.2 kN press; in N/um, written so, it is none to ask about."""
    with pytest.warns(UnitWarning, match=r"slider.stiffness = 12 has no unit and is read as 12 N/m, .* 320 m|266.7 m"):
        ss.rig_from_text(AXIS.replace('"12 ± 20 % N/um"', "12"))
    ss.rig_from_text(AXIS.replace('"12 ± 20 % N/um"', "12e6"))


ROCK = (Path(__file__).parents[2] / "examples/inclined-spring.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("right", "wrong", "answer"),
    [
        (
            r"d_c = .*",
            "d_c = 12",
            "friction.d_c = 12 is read as 12 m; the largest measured are some 100 mm: write the unit",
        ),
        (
            r"alpha = [\d.]*",
            "alpha = 56",
            "friction.normal_memory.alpha = 56 is read as 56; the largest measured are some 0.6",
        ),
    ],
)
def test_friction_far_above_all_that_was_measured_is_asked_about(right, wrong, answer):
    mistaken, count = re.subn(right, wrong, ROCK, count=1)
    assert count == 1
    with pytest.warns(UnitWarning, match=re.escape(answer)):
        ss.rig_from_text(mistaken)
    ss.rig_from_text(ROCK)


def test_advice_is_given_once():
    """Of a file without an area each force has the same: its first line has the advice, all have their fault."""
    with pytest.raises(ss.RigFileError) as raised:
        ss.rig_from_text(AXIS.replace('area = "200 cm^2"\n', ""))
    assert len(raised.value.problems) > 2
    assert str(raised.value).count("add the contact's area to the rig file") == 1
    assert str(raised.value).count("has the wrong dimension; expected a quantity in") == len(raised.value.problems)


def test_a_tolerance_wider_than_its_value_is_told_in_its_unit():
    answer = (
        "a tolerance of '20 N/um' is too wide: it reaches -8 N/um; allowed: a finite number >= 0; for a share of the "
    )
    with pytest.raises(ss.RigFileError, match=re.escape(answer)):
        ss.rig_from_text(AXIS.replace('"12 ± 20 % N/um"', '"12 ± 20 N/um"'))


HUNTING = (Path(__file__).parents[2] / "examples/hunting-axis.toml").read_text(encoding="utf-8")
GEARED = (Path(__file__).parents[2] / "examples/machines/telescope.toml").read_text(encoding="utf-8")
SHEET = SHEETS["feed axis"]
UNITLESS = {
    "a load in kN": (SHEET, '"8 kN"\n', "8\n", "contact.preload = 8 has no unit and is read as 8 N; what slides there"),
    "a stress in MPa": (ROCK, '"5 MPa"', "5", "contact.preload = 5 has no unit and is read as 5 Pa, less than 10 cm"),
    "per cent": (SHEET, "= 0.05", "= 9.7", "largest measured are some 1.5: a number in per cent .* as a share, 0.097$"),
    "bristles": (SHEET, '"300 N/um at 8 kN"', "300", 'friction would bend .* 400 um; .* "300 N/um at 8 kN"$'),
    "an encoder": (
        HUNTING,
        "kp =",
        "sample_time = 1e-3\nresolution = 0.05\nkp =",
        "= 0.05 is read as 50 mm; .* 100 um",
    ),
    "samples": (
        HUNTING,
        "kp =",
        "sample_time = 1\nkp =",
        "sample_time = 1 is read as 1 s; the largest in use .* 20 ms",
    ),
    "a dead time": (HUNTING, "kp =", "delay = 2\nkp =", "delay = 2 is read as 2 s; the largest in use are some 100 ms"),
    "a gear the other way": (
        GEARED,
        "gear = 0.002",
        "gear = 500",
        'a reduction is written "1/500", this one "500/1"$',
    ),
    "a lead": (MACHINE, '"10 mm/rev"', "10", "lead = 10 is read as .*; the largest in use are some 100 mm/rev: write"),
    "a damping ratio": (
        SHEETS["guide with seal"],
        '"0.5 N s/mm"',
        "0.05",
        "critical damping; .* ratio write 1.732 kN s/m",
    ),
    "the speed of an axis": (
        SHEETS["telescope worm"],
        'velocity_of = "axis"',
        "",
        'of axis write velocity_of = "axis"$',
    ),
    "an integral time": (MACHINE, '"20 ms"', "20", "tn = 20 is read as 20 s; the largest in use are some 1 s: write"),
}


@pytest.mark.parametrize(
    ("text", "wrong", "answer"),
    [
        (HUNTING, 'control = "pid"\n', "drive.control: missing; kp, .* keys of control = 'pid': write that"),
        (
            MACHINE,
            'control = "rotary-p-pi"\n',
            "drive.control: missing; body, .* are keys of control = 'rotary-p-pi': write that",
        ),
    ],
    ids=["slider", "machine"],
)
def test_keys_of_a_controller_without_its_name_are_one_problem(text, wrong, answer):
    """There were four, and of a motor "got 'steady', but 'motor' turns"."""
    assert wrong in text
    with pytest.raises(ss.RigFileError, match=answer) as caught:
        ss.rig_from_text(text.replace(wrong, ""))
    assert len(caught.value.problems) == 1


def test_tables_of_a_slider_in_a_machine_are_one_problem():
    """There were eight, of which the first asked for a table [fit]."""
    with pytest.raises(
        ss.RigFileError, match=r"line 2: friction: got the tables friction and slider .*\[contacts\] of a machine; in"
    ):
        ss.rig_from_text(SHEETS["guide with seal"].replace("[contact]", "[contacts.seal]"))


def test_a_clause_that_is_left_out_closes_its_bracket():
    two = 'contact = { law = "constant", preload = "1 N" }\nfriction = { law = "coulomb", mu_coulomb = 0.5 }\n'
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(f"[bodies.a]\nmass = 1\n[contacts.one]\n{two}[contacts.two]\n{two}[drive]\nvelocity = 1\n")
    for line in str(caught.value).splitlines():
        assert line.count("(") == line.count(")")


@pytest.mark.parametrize(("text", "right", "wrong", "answer"), UNITLESS.values(), ids=UNITLESS)
def test_a_number_without_its_unit_is_asked_about_once(text, right, wrong, answer):
    mistaken = text.replace(right, wrong, 1)
    assert mistaken != text
    with pytest.warns(UnitWarning, match=answer) as caught:
        ss.rig_from_text(mistaken)
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.rig_from_text(text)


def test_the_step_of_an_encoder_is_that_of_the_measured_body():
    text = MACHINE.replace('velocity = "0.05 rpm"', 'velocity = 0\nsample_time = "1 ms"\nresolution = "1 um"')
    rig = ss.rig_from_text(text)
    assert rig.drive.resolution == 1e-6
    assert rig.mechanism().limits.resolution == pytest.approx(1e-6 * 2 * np.pi / 10e-3)
    assert ss.rig_from_text(ss.rig_to_text(rig)) == rig
    assert "resolution = 1e-06  # m\n" in ss.rig_to_text(rig)
    assert rig.with_values({"drive.resolution": "5 um"}).drive.resolution == 5e-6
    with pytest.raises(ss.ParameterError, match=r"drive.resolution: '5 arcsec' .* expected a quantity in m, for"):
        ss.rig_from_text(text.replace("1 um", "5 arcsec"))
    motor = text.replace('measured = "table"', "#").replace("1 um", "5 arcsec")
    assert ss.rig_from_text(motor).mechanism().limits.resolution == pytest.approx(5 * np.pi / 180 / 3600)


@pytest.mark.parametrize("key", ["mu_static = 0.16", 'bristle_stiffness = "20 N/um at 125 N"', "viscous = 0"])
def test_friction_of_what_turns_is_told_how_to_be_given(key):
    """A torque, a torque by angle or by angular speed in place of friction per load."""
    name, unit = key.split(" = ")[0], {"mu_static": "N m", "bristle_stiffness": "N m/rad", "viscous": "N m s/rad"}
    text = SHEETS["telescope worm"].replace("[contacts.bearing.contact]", "viscous = 0\n[contacts.bearing.contact]")
    wrong = text.replace(key, f'{name} = "38 {unit[name]}"')
    assert wrong != text
    with pytest.raises(
        ss.RigFileError, match=r"at a radius, divide by .* and name the load that presses there, as in '20"
    ):
        ss.rig_from_text(wrong)


ORDINARY = """
[friction]
law = "lugre"
mu_coulomb = {mu_c:.4g}
mu_static = {mu_s:.4g}
v_stribeck = "{v_s:.4g} mm/s"
bristle_stiffness = {bristles:.4g}
[contact]
law = "constant"
preload = {preload:.4g}
[slider]
area = "1 m^2"
mass = {mass:.4g}
[drive]
velocity = 0
control = "pid"
kp = {kp:.4g}
ki = {kp:.4g}
delay = {delay:.4g}
sample_time = {sample:.4g}
resolution = {step:.4g}
"""


def test_ordinary_numbers_are_not_asked_about():
    """500 axes whose numbers without a unit are of the sizes of catalogues and laboratories."""
    chance = np.random.default_rng(33)

    def between(low, high):
        return float(np.exp(chance.uniform(np.log(low), np.log(high))))

    for _ in range(500):
        mu, mass = between(1e-3, 1.2), between(1e-2, 1e5)
        numbers = {
            "mu_c": mu, "mu_s": mu * chance.uniform(1, 1.6), "v_s": between(1e-2, 100),
            "bristles": mu / between(1e-8, 1e-4),
            "mass": mass, "preload": 9.81 * mass * between(0.1, 100), "kp": 9.81 * mass * between(1e2, 1e6),
            "delay": between(1e-5, 0.5), "sample": between(1e-5, 0.1), "step": between(1e-9, 1e-4),
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ss.rig_from_text(ORDINARY.format(**numbers))
